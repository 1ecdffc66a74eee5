//! The body reduced to Γ_C: one factorisation, then a small dense system.
//!
//! Ŝ v = f̂ + (forces on Γ_C), with v the displacements of the contact nodes along n and t. Every
//! contact and friction iteration runs on it; [`ElasticBody::displacements`] computes
//! the whole field by one back-substitution. The factor is private to this module.

use crate::elasticity::{self, Axes, Dof, DofMap};
use crate::error::SolveError;
use crate::linear::{Breaks, Dense, Factor, FactorError, Graph, Ordering, SparseSymmetric};
use crate::model::{Held, Level, Model};
use crate::solution::{Observer, Phase, Progress};

/// A body, assembled, supported and condensed onto its contact boundaries.
pub struct ElasticBody {
    /// Ŝ, on the contact unknowns in the order of `contact_dofs`.
    pub stiffness: Dense,
    /// f̂ of the loads.
    load_of_loads: Vec<f64>,
    /// f̂ of the prescribed displacements.
    load_of_supports: Vec<f64>,
    /// Normal and tangential displacement of every contact node, all contacts in a row; free ones
    /// count from 0 in Ŝ. Where the node's axes are oblique: u_n and its other component.
    pub contact_dofs: Vec<[Dof; 2]>,
    /// Where the axes of a contact node are oblique: the coefficients of these two in u_t.
    pub tangents: Vec<Option<[f64; 2]>>,
    /// External forces at every node along x and y, without those of contact.
    pub nodal_loads: Vec<[f64; 2]>,
    /// Which displacements are unknown.
    pub map: DofMap,
    matrix: SparseSymmetric,
    /// Forces of the loads, and of the prescribed displacements, on all unknowns.
    right_hand_sides: [Vec<f64>; 2],
    /// Added to the diagonal of the contact unknowns in `matrix`, and subtracted from Ŝ: without it a body that
    /// only contact holds has no factor (force/length).
    spring: f64,
    factor: Factor,
    /// Normal unknowns of contact nodes on the axis, each with that of the midside node beside it.
    axis_ends: Vec<[usize; 2]>,
}

/// The unknown of the midside node beside a contact's end on the axis is u_n − a u_n⁰, with u_n⁰ of that end, which has
/// no area of its own: ∫ h₀ r dr = 0. With a = 1/8 the end's unknown moves h₀ + h₁/8, of which the area is that of h₁
/// over 8, and the pressure there, its reaction over that area, is exact for p = p₀ + β r² (formulation 3.5).
pub const AXIS_SHARE: f64 = 0.125;

impl ElasticBody {
    /// Assembles, factors and condenses, and reports each phase to the observer.
    pub fn new(model: &Model, observe: &mut Observer<'_>) -> Result<Self, SolveError> {
        notify(observe, Progress::Phase(Phase::Assemble))?;
        let (map, interior) = number(model);
        let graph = Graph::from_cliques(
            model.mesh.nodes.len(),
            model.mesh.elements.iter().map(|e| &e[..]),
        );
        let (mut matrix, of_supports) = elasticity::assemble_stiffness(
            &model.mesh,
            &model.section,
            model.quadrature,
            &map,
            &graph,
        );
        let nodal_loads =
            elasticity::assemble_loads(&model.mesh, &model.section, model.quadrature, &model.loads);
        let mut condensed = nodal_loads.clone();
        elasticity::condense_body_force(&model.mesh, &model.section, &model.loads, &mut condensed);
        let of_loads = on_unknowns(&map, &condensed);
        let right_hand_sides = [of_loads, of_supports];
        let finite = |forces: &Vec<f64>| forces.iter().all(|f| f.is_finite());
        if !matrix.is_finite() || !right_hand_sides.iter().all(finite) {
            return Err(SolveError::NonFinite {
                phase: Phase::Assemble,
            });
        }
        let spring = if model.held_by_contact {
            matrix.mean_diagonal(interior)
        } else {
            0.0
        };
        for i in interior..map.unknowns {
            matrix.add(i, i, spring);
        }

        notify(observe, Progress::Phase(Phase::Order))?;
        let contact_unknowns = map.unknowns - interior;
        let ordering = elimination_order(model, &map, interior)
            .and_then(|order| Ordering::new(&matrix, &order, contact_unknowns))
            .map_err(|error| solve_error(error, &map))?;

        notify(observe, Progress::Phase(Phase::Factor))?;
        let bytes = ordering.bytes();
        notify(observe, Progress::Needs { bytes })?;
        let factor = Factor::new(
            &matrix,
            ordering,
            &mut Breaks::new(&mut || observe(Progress::Pulse)),
        );
        let factor = factor.map_err(|error| solve_error(error, &map))?;

        notify(observe, Progress::Phase(Phase::Condense))?;
        let bytes = Dense::bytes(contact_unknowns);
        notify(observe, Progress::Needs { bytes })?;
        let stiffness =
            factor.trailing_schur_complement(&mut Breaks::new(&mut || observe(Progress::Pulse)));
        let mut stiffness = stiffness.map_err(|error| solve_error(error, &map))?;
        // f̂ = Ŝ u_c with u_c of the whole system, springs included, under the loads alone
        let condensed = |forces: &Vec<f64>| {
            if forces.iter().all(|f| *f == 0.0) {
                return vec![0.0; contact_unknowns];
            }
            let mut u = forces.clone();
            factor.solve(&mut u);
            stiffness.times(&u[interior..])
        };
        let (load_of_loads, load_of_supports) = (
            condensed(&right_hand_sides[0]),
            condensed(&right_hand_sides[1]),
        );
        for i in 0..contact_unknowns {
            stiffness.set(i, i, stiffness.at(i, i) - spring);
        }
        if !(0..stiffness.size()).all(|j| stiffness.column(j).iter().all(|v| v.is_finite())) {
            return Err(SolveError::NonFinite {
                phase: Phase::Condense,
            });
        }
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
        let axis_ends = axis_ends(model, &contact_dofs);
        let (mut load_of_loads, mut load_of_supports) = (load_of_loads, load_of_supports);
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
            stiffness,
            load_of_loads,
            load_of_supports,
            contact_dofs,
            tangents,
            nodal_loads,
            map,
            matrix,
            right_hand_sides,
            spring,
            factor,
            axis_ends,
        })
    }

    /// The forces on contact nodes along n and t, from those on the contact unknowns.
    pub fn nodal_forces(&self, contact_force: &[f64]) -> Vec<f64> {
        let mut forces = contact_force.to_vec();
        for &[end, beside] in &self.axis_ends {
            forces[end] -= AXIS_SHARE * forces[beside];
        }
        forces
    }

    /// The displacements of contact nodes along n and t, from the contact unknowns.
    pub fn nodal_displacements(&self, contact_displacement: &[f64]) -> Vec<f64> {
        let mut displacements = contact_displacement.to_vec();
        for &[end, beside] in &self.axis_ends {
            displacements[beside] += AXIS_SHARE * displacements[end];
        }
        displacements
    }

    /// Forces on the contact nodes in the system with its springs, from forces on and values of the contact unknowns.
    fn forces_with_springs<'a>(
        &'a self,
        contact_force: &[f64],
        contact_displacement: &[f64],
    ) -> impl Iterator<Item = f64> + 'a {
        let forces = self.nodal_forces(contact_force).into_iter();
        let displacements = self.nodal_displacements(contact_displacement);
        forces
            .zip(displacements)
            .map(|(force, displacement)| force + self.spring * displacement)
    }

    /// Whether the body of one model is the body of another: all that [`ElasticBody::new`] reads is equal.
    pub fn same(a: &Model, b: &Model) -> bool {
        let on_boundary = |model: &Model| -> Vec<(Vec<u32>, Vec<[f64; 2]>)> {
            let boundaries = model.contacts.iter().map(|contact| &contact.boundary);
            boundaries
                .map(|boundary| (boundary.nodes.clone(), boundary.normals.clone()))
                .collect()
        };
        a.mesh == b.mesh
            && a.section == b.section
            && a.quadrature == b.quadrature
            && a.fixed == b.fixed
            && a.loads == b.loads
            && a.held_by_contact == b.held_by_contact
            && on_boundary(a) == on_boundary(b)
    }

    /// f̂ at a load level.
    pub fn load(&self, level: &Level) -> Vec<f64> {
        let parts = self.load_of_loads.iter().zip(&self.load_of_supports);
        parts
            .map(|(a, b)| level.loads * a + level.supports * b)
            .collect()
    }

    /// Displacements along x and y of every node at a load level, under the given forces on the
    /// contact unknowns; their displacements are known from the condensed system.
    pub fn displacements(
        &self,
        contact_force: &[f64],
        contact_displacement: &[f64],
        level: &Level,
    ) -> Vec<[f64; 2]> {
        let [of_loads, of_supports] = &self.right_hand_sides;
        let both = of_loads.iter().zip(of_supports);
        let mut rhs: Vec<f64> = both
            .map(|(a, b)| level.loads * a + level.supports * b)
            .collect();
        let interior = rhs.len() - contact_force.len();
        let forces = self.forces_with_springs(contact_force, contact_displacement);
        rhs[interior..]
            .iter_mut()
            .zip(forces)
            .for_each(|(rhs, force)| *rhs += force);
        let mut u = rhs.clone();
        self.factor.solve(&mut u);
        // one step of iterative refinement: the residual is known to far more digits than u
        let mut correction: Vec<f64> = self
            .matrix
            .times(&u)
            .iter()
            .zip(&rhs)
            .map(|(a, b)| b - a)
            .collect();
        self.factor.solve(&mut correction);
        u.iter_mut().zip(&correction).for_each(|(u, c)| *u += c);
        self.map.displacements(&u, level.supports)
    }

    /// Displacements along x and y of every node under the given displacements of the contact unknowns alone, of
    /// several such fields at once. To fewer digits than [`ElasticBody::displacements`]: enough for an estimate.
    pub fn displacements_without_loads(
        &self,
        contact_displacements: &[Vec<f64>],
    ) -> Vec<Vec<[f64; 2]>> {
        let n = self.map.unknowns;
        let mut u = vec![0.0; n * contact_displacements.len()];
        for (u, contact_displacement) in u.chunks_mut(n.max(1)).zip(contact_displacements) {
            let contact_force = self.stiffness.times(contact_displacement);
            let interior = n - contact_force.len();
            let forces = self.forces_with_springs(&contact_force, contact_displacement);
            u[interior..]
                .iter_mut()
                .zip(forces)
                .for_each(|(u, force)| *u = force);
        }
        self.factor.solve(&mut u);
        let fields = u.chunks(n.max(1));
        fields.map(|u| self.map.displacements(u, 0.0)).collect()
    }
}

/// Normal unknowns of contact nodes on the axis, each with that of the midside node beside it, if both are free.
fn axis_ends(model: &Model, contact_dofs: &[[Dof; 2]]) -> Vec<[usize; 2]> {
    let (mut first, mut ends) = (0, Vec::new());
    for contact in &model.contacts {
        for pair in model.axis.ends(&contact.boundary.positions) {
            if let [Dof::Free(end), Dof::Free(beside)] = pair.map(|i| contact_dofs[first + i][0]) {
                ends.push([end, beside]);
            }
        }
        first += contact.boundary.nodes.len();
    }
    ends
}

/// Contact nodes of all contacts in a row.
fn contact_nodes(model: &Model) -> impl Iterator<Item = u32> {
    model
        .contacts
        .iter()
        .flat_map(|contact| contact.boundary.nodes.iter().copied())
}

/// Numbers the unknowns, contact nodes last and turned to (n, t); also the number of the others.
fn number(model: &Model) -> (DofMap, usize) {
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
    for contact in &model.contacts {
        for (i, &node) in contact.boundary.nodes.iter().enumerate() {
            let (n, t) = (contact.boundary.normals[i], contact.boundary.tangent(i));
            axes[node as usize] = Some(match model.oblique.get(&node) {
                Some(along) => Axes::oblique(*along),
                None => Axes::perpendicular([n, t]),
            });
            in_contact[node as usize] = true;
        }
    }
    let mut map = DofMap {
        dofs: vec![[Dof::Fixed(0.0); 2]; count],
        axes,
        unknowns: 0,
    };
    let assign = |map: &mut DofMap, node: u32| {
        let axes = map.axes[node as usize].map_or([[1.0, 0.0], [0.0, 1.0]], |axes| axes.along);
        let held = model.fixed.get(&node);
        for a in 0..2 {
            // Model::new checks that a single direction is one of the node's axes
            map.dofs[node as usize][a] = match held.and_then(|held| held.along(axes[a])) {
                Some(value) => Dof::Fixed(value),
                None => {
                    map.unknowns += 1;
                    Dof::Free(map.unknowns - 1)
                }
            };
        }
    };
    (0..count as u32)
        .filter(|&node| !in_contact[node as usize])
        .for_each(|node| assign(&mut map, node));
    let interior = map.unknowns;
    // a node of two contacts is numbered once
    let new = |node: &u32| std::mem::replace(&mut in_contact[*node as usize], false);
    contact_nodes(model)
        .filter(new)
        .for_each(|node| assign(&mut map, node));
    (map, interior)
}

/// Minimum degree on the nodes away from contact, a node's unknowns together; then the contact
/// unknowns in their own order.
fn elimination_order(
    model: &Model,
    map: &DofMap,
    interior: usize,
) -> Result<Vec<usize>, FactorError> {
    let free = |node: &u32| {
        map.dofs[*node as usize]
            .iter()
            .any(|dof| matches!(dof, Dof::Free(i) if *i < interior))
    };
    let mut number = vec![u32::MAX; model.mesh.nodes.len()];
    let mut nodes = Vec::new();
    for node in (0..number.len() as u32).filter(free) {
        number[node as usize] = nodes.len() as u32;
        nodes.push(node);
    }
    let cliques: Vec<Vec<u32>> = model
        .mesh
        .elements
        .iter()
        .map(|element| {
            element
                .iter()
                .map(|&n| number[n as usize])
                .filter(|&n| n != u32::MAX)
                .collect()
        })
        .collect();
    let graph = Graph::from_cliques(nodes.len(), cliques.iter().map(|c| &c[..]));
    let mut order = Vec::with_capacity(map.unknowns);
    for vertex in Ordering::minimum_degree(&graph)? {
        for dof in map.dofs[nodes[vertex] as usize] {
            if let Dof::Free(i) = dof {
                order.push(i);
            }
        }
    }
    order.extend(interior..map.unknowns);
    Ok(order)
}

/// Nodal forces along x and y as forces on the unknowns.
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
        FactorError::TooLarge { bytes } => SolveError::ResourceExhausted { bytes },
        FactorError::Stopped => SolveError::Stopped,
    }
}

fn notify(observe: &mut Observer<'_>, progress: Progress<'_>) -> Result<(), SolveError> {
    match observe(progress).is_break() {
        true => Err(SolveError::Stopped),
        false => Ok(()),
    }
}
