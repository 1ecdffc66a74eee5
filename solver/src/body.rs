//! The body reduced to Γ_C: one factorisation, then a small dense system.
//!
//! Ŝ v = f̂ + (forces on Γ_C), with v the displacements of the contact nodes along n and t. Every
//! contact and friction iteration runs on it; [`ElasticBody::displacements`] computes
//! the whole field by one back-substitution. The factor is private to this module.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use serde::Serialize;

use crate::contact::AXIS_SHARE;
use crate::elasticity::{
    self, Axes, Dof, DofMap, ElementStiffness, ElementTables, Elements, Loads, Section, Springs,
};
use crate::error::SolveError;
use crate::linear::{
    Cells, Dense, Dissection, ElementMatrix, Factor, FactorError, Fronts, Interrupt,
    SMALLEST_SHARED, Stopped,
};
use crate::mesh::Mesh;
use crate::model::{Alone, Held, Level, Model};
use crate::observer::{Observer, Progress, notify, take};
use crate::solution::Phase;

/// A body, assembled, supported and condensed onto its contact boundaries.
pub struct ElasticBody {
    /// The condensed stiffness Ŝ, on the contact unknowns in the order of `contact_dofs`, and after them on those of nodes of other
    /// bodies that face contacts.
    pub stiffness: Arc<Dense>,
    /// The load f̂ that the problem's loads condense to.
    load_of_loads: Vec<f64>,
    /// The load f̂ that the prescribed displacements condense to.
    load_of_supports: Vec<f64>,
    /// The normal and tangential displacement of every contact node, for all contacts one after another; free ones are
    /// numbered from 0 as in Ŝ. Where the node's axes are oblique: u_n and the other component. At a common end of two
    /// contacts that belongs to one contact alone: the displacements along the axes of this contact.
    pub contact_dofs: Vec<[Dof; 2]>,
    /// Where the axes of a contact node are oblique: the coefficients of the node's two displacements in u_t.
    pub tangents: Vec<Option<[f64; 2]>>,
    /// External forces at every node along x and y, without the forces of contact.
    pub nodal_loads: Vec<[f64; 2]>,
    /// Which displacements are unknown, with their numbers.
    pub map: DofMap,
    /// L⁻¹ f of the unknowns away from contact: for the forces f of the loads, and for the forces f of the prescribed
    /// displacements.
    reduced: [Vec<f64>; 2],
    factor: Factor,
    /// The number of unknowns of nodes of other bodies that face contacts, the last ones of Ŝ.
    facing_unknowns: usize,
    /// The normal unknowns of contact nodes on the axis, each with the unknown of the midside node beside it.
    axis_ends: Vec<[usize; 2]>,
    /// Tables of the elements of the models that have this body.
    tables: ElementTables,
}

/// The part of a model that determines its body: models with equal parts have the same body. Anything else that
/// [`ElasticBody::new`] reads follows from this part.
#[derive(PartialEq, Serialize)]
pub struct Source<'a> {
    mesh: &'a Mesh,
    section: &'a Section,
    quadrature: u32,
    fixed: &'a BTreeMap<u32, Held>,
    /// The nodes of other bodies that face contacts; skipped where there are none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    facing: Vec<u32>,
    /// Skipped where there are none, so that bodies without springs keep their fingerprints.
    #[serde(skip_serializing_if = "Springs::is_empty")]
    springs: &'a Springs,
    loads: &'a Loads,
    alone: &'a Alone,
    open_on_axis: &'a BTreeSet<u32>,
    /// Nodes and normals of each contact.
    contacts: Vec<(&'a [u32], &'a [[f64; 2]])>,
}

impl<'a> Source<'a> {
    /// The part of `model` that determines its body.
    pub fn of(model: &'a Model) -> Self {
        let boundaries = model.contacts.iter().map(|contact| &contact.boundary);
        Source {
            mesh: &model.mesh,
            section: &model.section,
            quadrature: model.quadrature,
            fixed: &model.fixed,
            facing: facing(model),
            springs: &model.springs,
            loads: &model.loads,
            alone: &model.alone,
            open_on_axis: &model.open_on_axis,
            contacts: boundaries
                .map(|boundary| (&boundary.nodes[..], &boundary.normals[..]))
                .collect(),
        }
    }
}

impl ElasticBody {
    /// Assembles, factors and condenses the body of a model, and reports each phase to the observer.
    ///
    /// # Errors
    ///
    /// [`SolveError::SingularSystem`] with the node and direction that nothing holds; [`SolveError::ResourceExhausted`]
    /// and [`SolveError::NonFinite`] if a matrix does not fit into memory or is not finite; [`SolveError::Stopped`] if
    /// the observer says so.
    pub fn new(model: &Model, observer: &mut dyn Observer) -> Result<Self, SolveError> {
        notify(observer, Progress::Phase(Phase::Assemble))?;
        let nodal_loads =
            elasticity::assemble_loads(&model.mesh, &model.section, model.quadrature, &model.loads);
        let mut condensed = nodal_loads.clone();
        elasticity::add_inner_forces(
            &model.mesh,
            &model.section,
            model.quadrature,
            &model.loads,
            &mut condensed,
        );

        notify(observer, Progress::Phase(Phase::Order))?;
        let tables = ElementTables::new(&model.mesh, &model.section, model.quadrature);
        let elements = tables.elements(&model.mesh, &model.section, &model.springs);
        let threads = match model.mesh.elements.len() >= SMALLEST_SHARED {
            true => observer.threads(),
            false => 1,
        };
        let (map, fronts) = number(model, elements, threads)?;
        let mut of_loads = on_unknowns(&map, &condensed);

        notify(observer, Progress::Phase(Phase::Factor))?;
        let contact_unknowns = fronts.kept();
        let bytes = |threads| fronts.bytes(threads) + Dense::bytes(contact_unknowns);
        let threads =
            match fronts.is_large() && observer.threads() > 1 && observer.may_use(bytes(2)) {
                true => 2,
                false => 1,
            };
        take(observer, bytes(threads))?;
        let element_stiffness = ElementStiffness::new(elements, &map);
        let mut of_supports = element_stiffness.load_of_supports();
        let factored = Factor::new(
            fronts,
            &|e, matrix: &mut ElementMatrix| element_stiffness.put(e, matrix),
            threads,
            &mut Interrupt::new(&mut || observer.stop()),
        );
        let (factor, mut stiffness) = factored.map_err(|error| solve_error(error, &map))?;

        notify(observer, Progress::Phase(Phase::Condense))?;
        let non_finite = |phase| Err(SolveError::NonFinite { phase });
        if [&of_loads, &of_supports].iter().any(|f| !all_finite(f)) {
            return non_finite(Phase::Assemble);
        }
        let interior = map.unknowns - contact_unknowns;
        let [mut load_of_loads, mut load_of_supports] =
            [&mut of_loads, &mut of_supports].map(|forces| {
                if forces.iter().any(|f| *f != 0.0) {
                    factor.forward(forces);
                }
                forces.split_off(interior)
            });
        if !(0..stiffness.size()).all(|j| all_finite(stiffness.column(j))) {
            return non_finite(Phase::Condense);
        }
        let (contact_dofs, tangents) = contact_dofs(model, &map, interior);
        let free = |node: u32| {
            map.dofs[node as usize]
                .iter()
                .filter(|dof| matches!(dof, Dof::Free(_)))
        };
        let facing_unknowns = facing(model)
            .into_iter()
            .map(|node| free(node).count())
            .sum();
        let axis_ends = axis_ends(model, &contact_dofs);
        for &[end, beside] in &axis_ends {
            for load in [&mut load_of_loads, &mut load_of_supports] {
                load[end] += AXIS_SHARE * load[beside];
            }
            let turned = |i: usize| stiffness.at(i, end) + AXIS_SHARE * stiffness.at(i, beside);
            let mut column: Vec<f64> = (0..stiffness.size()).map(turned).collect();
            column[end] += AXIS_SHARE * column[beside];
            for (i, value) in column.into_iter().enumerate() {
                stiffness.set(i, end, value);
            }
        }
        Ok(ElasticBody {
            stiffness: Arc::new(stiffness),
            load_of_loads,
            load_of_supports,
            contact_dofs,
            tangents,
            nodal_loads,
            map,
            reduced: [of_loads, of_supports],
            factor,
            facing_unknowns,
            axis_ends,
            tables,
        })
    }

    /// The elements of a model that has this body.
    pub fn elements<'a>(&'a self, model: &'a Model) -> Elements<'a> {
        self.tables
            .elements(&model.mesh, &model.section, &model.springs)
    }

    /// Converts forces on the contact unknowns to forces on contact nodes along n and t.
    pub fn nodal_forces(&self, contact_force: &[f64]) -> Vec<f64> {
        let mut forces = contact_force.to_vec();
        for &[end, beside] in &self.axis_ends {
            forces[end] -= AXIS_SHARE * forces[beside];
        }
        forces
    }

    /// Converts contact unknowns to displacements of contact nodes along n and t.
    pub fn nodal_displacements(&self, contact_displacement: &[f64]) -> Vec<f64> {
        let mut displacements = contact_displacement.to_vec();
        for &[end, beside] in &self.axis_ends {
            displacements[beside] += AXIS_SHARE * displacements[end];
        }
        displacements
    }

    /// Converts displacements of contact nodes along n and t, in the order of Ŝ, to contact unknowns: the inverse of
    /// [`ElasticBody::nodal_displacements`].
    pub fn contact_unknowns(&self, displacements: &mut [f64]) {
        for &[end, beside] in &self.axis_ends {
            displacements[beside] -= AXIS_SHARE * displacements[end];
        }
    }

    /// The number of unknowns of contact nodes, the first ones of Ŝ.
    pub fn contact_unknown_count(&self) -> usize {
        self.stiffness.size() - self.facing_unknowns
    }

    /// The two components of a node that is kept: a contact node, or one that faces a contact.
    pub fn kept_dofs(&self, node: u32) -> [Dof; 2] {
        let interior = self.map.unknowns - self.stiffness.size();
        self.map.dofs[node as usize].map(|dof| match dof {
            Dof::Free(i) => Dof::Free(i - interior),
            fixed => fixed,
        })
    }

    /// The axes of the two components of a node.
    pub fn axes(&self, node: u32) -> Axes {
        let usual = Axes::perpendicular([[1.0, 0.0], [0.0, 1.0]]);
        self.map.axes[node as usize].unwrap_or(usual)
    }

    /// Whether two models have the same body: all that [`ElasticBody::new`] reads is equal.
    pub fn same(a: &Model, b: &Model) -> bool {
        Source::of(a) == Source::of(b)
    }

    /// The condensed load f̂ at a load level.
    pub fn load(&self, level: &Level) -> Vec<f64> {
        let parts = self.load_of_loads.iter().zip(&self.load_of_supports);
        parts
            .map(|(a, b)| level.loads * a + level.supports * b)
            .collect()
    }

    /// The number of entries of the factor and of the lower triangle of Ŝ: the stored part of the stiffness.
    pub fn factor_entries(&self) -> usize {
        let kept = self.stiffness.size();
        self.factor.entries() + kept * (kept + 1) / 2
    }

    /// How many threads may work on the fields of this body: the observer is asked for a second thread if that is worth
    /// it.
    pub fn threads(&self, observer: &mut dyn Observer) -> usize {
        if self.factor.has_large_fields() && observer.threads() > 1 {
            2
        } else {
            1
        }
    }

    /// Displacements along x and y of every node at a load level, from the displacements of the contact unknowns.
    pub fn displacements(&self, contact_displacement: &[f64], level: &Level) -> Vec<[f64; 2]> {
        self.displacements_on(1, contact_displacement, level)
    }

    /// The result of [`ElasticBody::displacements`], computed on `threads` threads.
    pub fn displacements_on(
        &self,
        threads: usize,
        contact_displacement: &[f64],
        level: &Level,
    ) -> Vec<[f64; 2]> {
        let [of_loads, of_supports] = &self.reduced;
        let both = of_loads.iter().zip(of_supports);
        let reduced = both.map(|(a, b)| level.loads * a + level.supports * b);
        let contact = self.nodal_displacements(contact_displacement);
        let mut u: Vec<[f64; 1]> = reduced.chain(contact).map(|u| [u]).collect();
        self.factor.backward(&mut u, threads);
        self.map.displacements(|i| u[i][0], level.supports)
    }

    /// Displacements along x and y of every node if only the contact unknowns are displaced as given, for up to
    /// `FIELDS` sets of such displacements at once, on `threads` threads.
    pub fn displacements_without_loads<const FIELDS: usize>(
        &self,
        contact_displacements: &[Vec<f64>],
        threads: usize,
    ) -> Vec<[[f64; FIELDS]; 2]> {
        let mut u = vec![[0.0; FIELDS]; self.map.unknowns];
        for (k, contact) in contact_displacements.iter().enumerate() {
            let contact = self.nodal_displacements(contact);
            let kept = &mut u[self.map.unknowns - contact.len()..];
            let kept = kept.iter_mut().zip(contact);
            kept.for_each(|(u, contact)| u[k] = contact);
        }
        self.factor.backward(&mut u, threads);
        self.map.displacements_together(&u)
    }
}

fn all_finite(values: &[f64]) -> bool {
    values.iter().all(|value| value.is_finite())
}

/// [`ElasticBody::contact_dofs`] and [`ElasticBody::tangents`]. `interior`: the number of unknowns that are eliminated.
fn contact_dofs(
    model: &Model,
    map: &DofMap,
    interior: usize,
) -> (Vec<[Dof; 2]>, Vec<Option<[f64; 2]>>) {
    let to_contact = |dof| match dof {
        Dof::Free(i) => Dof::Free(i - interior),
        fixed => fixed,
    };
    let (mut contact_dofs, mut tangents) = (Vec::new(), Vec::new());
    for contact in &model.contacts {
        for (i, &node) in contact.boundary.nodes.iter().enumerate() {
            let mut dofs = map.dofs[node as usize].map(to_contact);
            let oblique = map.axes[node as usize].filter(|_| model.oblique.contains_key(&node));
            tangents.push(oblique.map(|mut axes| {
                if axes.along[0] != contact.boundary.normals[i] {
                    dofs.reverse();
                    axes.moves.reverse();
                }
                let [x, y] = contact.boundary.tangent(i);
                axes.moves.map(|[a, b]| x * a + y * b)
            }));
            contact_dofs.push(dofs);
        }
    }
    (contact_dofs, tangents)
}

/// The normal unknowns of contact nodes on the axis, each with the normal unknown of the midside node beside it, if
/// both are free; without the nodes that stay open.
fn axis_ends(model: &Model, contact_dofs: &[[Dof; 2]]) -> Vec<[usize; 2]> {
    let (mut first, mut ends) = (0, Vec::new());
    for contact in &model.contacts {
        let nodes = &contact.boundary.nodes;
        let closed = |[end, _]: &[usize; 2]| !model.open_on_axis.contains(&nodes[*end]);
        let pairs = model.axis.ends(&contact.boundary.positions);
        for pair in pairs.into_iter().filter(closed) {
            if let [Dof::Free(end), Dof::Free(beside)] = pair.map(|i| contact_dofs[first + i][0]) {
                ends.push([end, beside]);
            }
        }
        first += contact.boundary.nodes.len();
    }
    ends
}

/// The nodes of other bodies that face contacts, in order.
fn facing(model: &Model) -> Vec<u32> {
    let pairs = model
        .contacts
        .iter()
        .filter_map(|contact| contact.pair.as_ref());
    let followed = pairs.flat_map(|pair| {
        let rows = pair.rows.iter().flatten();
        rows.map(|(k, _)| pair.nodes[*k])
    });
    let nodes: BTreeSet<u32> = followed.collect();
    nodes.into_iter().collect()
}

/// Numbers the unknowns in the order of their elimination, and plans the elimination. The unknowns of contact nodes
/// come last, turned to (n, t) and in the order of the contacts.
fn number(
    model: &Model,
    elements: Elements<'_>,
    threads: usize,
) -> Result<(DofMap, Fronts), SolveError> {
    let count = model.mesh.nodes.len();
    let mut axes = vec![None; count];
    // the axes of a node that is held along an oblique direction lie along it
    for (&node, held) in &model.fixed {
        if let Held::Along {
            direction: [x, y], ..
        } = *held
            && x != 0.0
            && y != 0.0
        {
            axes[node as usize] = Some(Axes::perpendicular([[x, y], [y, -x]]));
        }
    }
    let mut in_contact = vec![false; count];
    let mut contact_nodes = Vec::new();
    for (c, contact) in model.contacts.iter().enumerate() {
        for (i, &node) in contact.boundary.nodes.iter().enumerate() {
            if model.alone.get(&node).is_some_and(|owner| *owner != c) {
                continue;
            }
            let (n, t) = (contact.boundary.normals[i], contact.boundary.tangent(i));
            axes[node as usize] = Some(match model.oblique.get(&node) {
                Some(along) => Axes::oblique(*along),
                None => Axes::perpendicular([n, t]),
            });
            // a node of two contacts is numbered once
            if !std::mem::replace(&mut in_contact[node as usize], true) {
                contact_nodes.push(node);
            }
        }
    }
    contact_nodes.extend(facing(model));
    let along = |node: usize| {
        let axes: Option<Axes> = axes[node];
        axes.map_or([[1.0, 0.0], [0.0, 1.0]], |axes| axes.along)
    };
    // Model::new checks that a single direction is one of the node's axes
    let held = |node: u32| {
        let held = model.fixed.get(&node);
        along(node as usize).map(|axis| held.and_then(|held| held.along(axis)))
    };
    let values: Vec<[Option<f64>; 2]> = (0..count as u32).map(held).collect();
    let unknowns_of = |node: u32| values[node as usize].iter().filter(|v| v.is_none()).count();
    let unknown: Vec<bool> = (0..count as u32)
        .map(|node| unknowns_of(node) > 0)
        .collect();
    let cells = Cells {
        elements: &model.mesh.elements,
        positions: &model.mesh.nodes,
        unknown: &unknown,
    };
    let dissection = Dissection::new(&cells, &contact_nodes, threads);
    let mut map = DofMap {
        dofs: values
            .iter()
            .map(|values| values.map(|v| Dof::Fixed(v.unwrap_or(0.0))))
            .collect(),
        axes,
        unknowns: 0,
    };
    for &node in &dissection.nodes {
        for (dof, value) in map.dofs[node as usize]
            .iter_mut()
            .zip(values[node as usize])
        {
            if value.is_none() {
                *dof = Dof::Free(map.unknowns);
                map.unknowns += 1;
            }
        }
    }
    // a node of no element has no stiffness
    let mut numbered = vec![false; count];
    dissection
        .nodes
        .iter()
        .for_each(|node| numbered[*node as usize] = true);
    if let Some(node) = (0..count).find(|node| unknown[*node] && !numbered[*node]) {
        let axes = map.axes[node].map_or([[1.0, 0.0], [0.0, 1.0]], |axes| axes.along);
        let direction = axes[usize::from(values[node][0].is_some())];
        let node = node as u32;
        return Err(SolveError::SingularSystem { node, direction });
    }
    let kept = contact_nodes
        .iter()
        .filter(|node| unknown[**node as usize])
        .count();
    let kinds = elements.kinds(&map);
    let fronts = Fronts::new(dissection, &model.mesh.elements, &kinds, unknowns_of, kept);
    Ok((map, fronts))
}

/// Converts nodal forces along x and y to forces on the unknowns.
fn on_unknowns(map: &DofMap, forces: &[[f64; 2]]) -> Vec<f64> {
    let mut on_unknowns = vec![0.0; map.unknowns];
    for (node, force) in forces.iter().enumerate() {
        for (dof, f) in map.dofs[node].iter().zip(map.to_axes(node, *force)) {
            if let Dof::Free(i) = dof {
                on_unknowns[*i] += f;
            }
        }
    }
    on_unknowns
}

fn solve_error(error: FactorError, map: &DofMap) -> SolveError {
    match error {
        FactorError::NotPositiveDefinite { unknown } => {
            let (node, direction) = map.place_of(unknown);
            SolveError::SingularSystem { node, direction }
        }
        FactorError::NonFinite => SolveError::NonFinite {
            phase: Phase::Assemble,
        },
        FactorError::TooLarge { bytes } => SolveError::ResourceExhausted { bytes },
        FactorError::Stopped => SolveError::Stopped,
    }
}

impl From<Stopped> for SolveError {
    fn from(_: Stopped) -> Self {
        SolveError::Stopped
    }
}
