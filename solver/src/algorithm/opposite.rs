//! What lies opposite a contact and moves: rigid obstacles whose loads are given instead of their motions, and other elastic
//! bodies. Its unknowns q are eliminated, so that every method works with displacements relative to it.
//!
//! With the displacements v of the kept unknowns, those of contact nodes and those of nodes that face them, and P, which has the
//! displacements of all these under unit q (a unit displacement of a facing node moves itself, and the contact nodes that follow
//! it),
//!
//!   v = w + P q,     A = K + PᵀŜP,     S_w = Ŝ − ŜP A⁻¹ PᵀŜ,     f_w = f̂ − ŜP A⁻¹ (f_q + Pᵀf̂)
//!
//! and afterwards q = A⁻¹ (f_q + Pᵀ(f̂ − Ŝw)), with the loads f_q and the springs K of obstacles; the loads on other bodies are in f̂.
//! w is zero but at contact nodes. In w the gap is that before the unknown motions; reactions, slip and friction are the same as
//! in v. S_w is the Schur complement of A in the stiffness on (q, w).

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use crate::body::ElasticBody;
use crate::elasticity::Dof;
use crate::error::SolveError;
use crate::linear::{Dense, Eliminated, Interrupt, Unsolved};
use crate::model::{ContactModel, Level, Model};
use crate::observer::{Observer, take};

/// An unknown motion of an obstacle: the contact, by its place in the model, and 0 for the indentation, 1 for the tangential
/// displacement, 2 for the tilt.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FreeMotion {
    /// The contact.
    pub patch: usize,
    /// The number of the motion.
    pub motion: usize,
}

/// A column of P: unknowns with their displacements, the others being at rest.
type Column = Vec<(usize, f64)>;

/// The unknowns of what lies opposite the contacts, on one body or several.
pub struct Opposite {
    /// The unknown motions of obstacles, the first of the unknowns q, in order.
    pub motions: Vec<FreeMotion>,
    /// The columns of P on the kept unknowns.
    columns: Vec<Column>,
    /// The elimination of q.
    eliminated: Eliminated,
    /// The stiffness S_w.
    pub stiffness: Arc<Dense>,
    /// By contact node, how far the prescribed displacements of other bodies move what it follows, along n and t.
    prescribed: Vec<[f64; 2]>,
    /// By contact and node of the body that faces it: its two components, each with the displacement that its unit is; none of a
    /// node that no contact node follows.
    facing: Vec<Vec<Option<[Component; 2]>>>,
    /// A unit load of the problem, divided by 2π in axisymmetry.
    unit: f64,
}

/// A component of the displacement of a node, and the displacement that its unit is.
type Component = (Dof, [f64; 2]);

impl Opposite {
    /// What lies opposite the contacts of a model; none if nothing there moves by an unknown.
    ///
    /// # Errors
    ///
    /// [`SolveError::ObstacleUnheld`] if an obstacle and the body may move together without a force;
    /// [`SolveError::BodiesUnheld`] if bodies in contact may.
    pub fn new(
        model: &Model,
        body: &ElasticBody,
        observer: &mut dyn Observer,
    ) -> Result<Option<Self>, SolveError> {
        let motions: Vec<FreeMotion> = free_motions(model).collect();
        let paired = model.contacts.iter().any(|contact| contact.pair.is_some());
        if motions.is_empty() && !paired {
            return Ok(None);
        }
        let kept = body.stiffness.size();
        let mut columns: Vec<Column> = motions
            .iter()
            .map(|free| sparse(&moves(model, body, free)))
            .collect();
        let (of_bodies, prescribed) = followed(model, body);
        columns.extend(of_bodies);
        let (count, own) = (columns.len(), body.contact_unknown_count());
        let bytes = 8 * (count as u64) * (kept as u64);
        take(observer, Dense::bytes(count + own).saturating_add(bytes))?;
        let mut stop = || observer.stop();
        let interrupt = &mut Interrupt::new(&mut stop);
        let mut forces: Vec<Vec<f64>> = Vec::with_capacity(count);
        for column in &columns {
            forces.push(times(&body.stiffness, column));
            interrupt.worked((kept * column.len()) as f64)?;
        }
        let unit = 1.0 / model.section.circumference();
        let spring = |i: usize| {
            motions
                .get(i)
                .map_or(0.0, |free| unit * spring(model, free))
        };
        // on (q, w), of which the lower triangle is asked for
        let entry = |i: usize, j: usize| match (i.checked_sub(count), j.checked_sub(count)) {
            (None, _) => {
                let own = if i == j { spring(i) } else { 0.0 };
                own + columns[i]
                    .iter()
                    .map(|(k, p)| p * forces[j][*k])
                    .sum::<f64>()
            }
            (Some(i), None) => forces[j][i],
            (Some(i), Some(j)) => body.stiffness.at(i, j),
        };
        // what is left of a motion that meets no resistance is rounding
        let stiffest = (0..kept).fold(0.0, |most, i| body.stiffness.at(i, i).max(most));
        let resists = |i: usize| {
            let size =
                |values: &mut dyn Iterator<Item = f64>| values.map(|x| x * x).sum::<f64>().sqrt();
            let moved = size(&mut columns[i].iter().map(|(_, p)| *p));
            let force = size(&mut forces[i].iter().copied());
            entry(i, i) > RESISTS * moved * force.max(stiffest * moved)
        };
        let unheld = || match motions.first() {
            Some(free) => SolveError::ObstacleUnheld {
                contact: model.contacts[free.patch].name.clone(),
                motion: "it moves together with the body, which no support holds".to_owned(),
            },
            None => SolveError::BodiesUnheld,
        };
        if !(0..motions.len()).all(resists) {
            return Err(unheld());
        }
        let (eliminated, stiffness) = Eliminated::new(count + own, count, entry, interrupt)
            .map_err(|error| match error {
                Unsolved::Stopped => SolveError::Stopped,
                Unsolved::TooLarge { bytes } => SolveError::ResourceExhausted { bytes },
                Unsolved::Singular => unheld(),
            })?;
        Ok(Some(Opposite {
            motions,
            columns,
            eliminated,
            stiffness: Arc::new(stiffness),
            prescribed,
            facing: facing(model, body),
            unit,
        }))
    }

    /// The load f_w on relative displacements, from the load f̂ of the kept unknowns at a load level; and what
    /// [`Opposite::motions`] needs.
    pub(super) fn reduced(
        &self,
        model: &Model,
        level: &Level,
        load: &[f64],
    ) -> (Vec<f64>, Vec<f64>) {
        let work = |column: &Column| column.iter().map(|(k, p)| p * load[*k]).sum::<f64>();
        let mut both: Vec<f64> = self.columns.iter().map(work).collect();
        for (work, free) in both.iter_mut().zip(&self.motions) {
            *work += self.load(model, level, free);
        }
        both.extend_from_slice(&load[..self.stiffness.size()]);
        self.eliminated.reduce(&mut both);
        let on_relative = both.split_off(self.columns.len());
        (on_relative, both)
    }

    /// The load on an obstacle along a motion at a load level (without 2π).
    pub(super) fn load(&self, model: &Model, level: &Level, free: &FreeMotion) -> f64 {
        let tool = model.contacts[free.patch].tool.as_ref();
        let load = tool.and_then(|tool| tool.loads[free.motion]);
        self.unit * level.forces[free.motion] * load.unwrap_or(0.0)
    }

    /// The stiffness of the spring between an obstacle and the ground against a motion (without 2π).
    pub(super) fn spring(&self, model: &Model, free: &FreeMotion) -> f64 {
        self.unit * spring(model, free)
    }

    /// The unknowns q from relative displacements w. `at_rest`: from [`Opposite::reduced`].
    pub(super) fn motions(&self, at_rest: &[f64], w: &[f64]) -> Vec<f64> {
        let mut both = [at_rest, w].concat();
        self.eliminated.expand(&mut both);
        both.truncate(self.columns.len());
        both
    }

    /// The displacements w + P q of the kept unknowns.
    pub(super) fn displaced(&self, w: &[f64], q: &[f64]) -> Vec<f64> {
        let last = self.columns.iter().flatten().map(|(k, _)| k + 1).max();
        let mut v = w.to_vec();
        v.resize(last.unwrap_or(0).max(w.len()), 0.0);
        for (column, q) in self.columns.iter().zip(q) {
            column.iter().for_each(|(k, p)| v[*k] += q * p);
        }
        v
    }

    /// The forces on all kept unknowns of forces on contact unknowns, by what lies opposite: those on other bodies are opposite.
    pub(super) fn with_reactions(&self, force: &[f64]) -> Vec<f64> {
        let mut all = self.displaced(force, &[]);
        for column in &self.columns[self.motions.len()..] {
            let Some((own, _)) = column.last() else {
                continue;
            };
            let work = column.iter().filter(|(k, _)| *k < force.len());
            all[*own] = -work.map(|(k, p)| p * force[*k]).sum::<f64>();
        }
        all
    }

    /// How far the prescribed displacements of another body move what a contact node follows, along n and t.
    pub(super) fn prescribed(&self, node: usize) -> [f64; 2] {
        self.prescribed[node]
    }

    /// The displacement of a node of the body that faces a contact, by its place in the boundary there; none if no contact node
    /// follows it. `displaced`: the displacements of the kept unknowns.
    pub(super) fn facing_displacement(
        &self,
        patch: usize,
        node: usize,
        displaced: &[f64],
    ) -> Option<[f64; 2]> {
        let components = self.facing.get(patch)?.get(node)?.as_ref()?;
        let moved = |sum: [f64; 2], (dof, moves): &Component| {
            let value = match dof {
                Dof::Free(unknown) => displaced[*unknown],
                Dof::Fixed(value) => *value,
            };
            [sum[0] + value * moves[0], sum[1] + value * moves[1]]
        };
        Some(components.iter().fold([0.0; 2], moved))
    }

    /// The derivatives of the unknown number `k` by w, −ŜP A⁻¹ e_k.
    pub(super) fn gradient(&self, k: usize) -> Vec<f64> {
        self.unit_load(k).split_off(self.columns.len())
    }

    /// What [`Opposite::motions`] needs for a unit load along number `k`, or for none.
    pub(super) fn unit_at_rest(&self, k: Option<usize>) -> Vec<f64> {
        match k {
            None => vec![0.0; self.columns.len()],
            Some(k) => {
                let mut both = self.unit_load(k);
                both.truncate(self.columns.len());
                both
            }
        }
    }

    fn unit_load(&self, k: usize) -> Vec<f64> {
        let count = self.columns.len() + self.stiffness.size();
        let mut both: Vec<f64> = (0..count).map(|i| f64::from(i == k)).collect();
        self.eliminated.reduce(&mut both);
        both
    }

    /// The number of an unknown motion.
    pub(super) fn number(&self, patch: usize, motion: usize) -> Option<usize> {
        let wanted = FreeMotion { patch, motion };
        self.motions.iter().position(|free| *free == wanted)
    }
}

/// The entries of a vector that are not zero.
fn sparse(values: &[f64]) -> Column {
    let all = values.iter().copied().enumerate();
    all.filter(|(_, value)| *value != 0.0).collect()
}

/// The product of a matrix and a column.
fn times(matrix: &Dense, column: &Column) -> Vec<f64> {
    let mut product = vec![0.0; matrix.size()];
    for (k, p) in column {
        let terms = product.iter_mut().zip(matrix.column(*k));
        terms.for_each(|(sum, entry)| *sum += p * entry);
    }
    product
}

/// The columns of P of the unknowns of other bodies, each with itself last; and how far prescribed displacements move what the
/// contact nodes follow, along n and t.
fn followed(model: &Model, body: &ElasticBody) -> (Vec<Column>, Vec<[f64; 2]>) {
    let body_own = body.contact_unknown_count();
    let count = body.stiffness.size() - body_own;
    let mut columns: Vec<BTreeMap<usize, f64>> = vec![BTreeMap::new(); count];
    let mut prescribed = vec![[0.0; 2]; body.contact_dofs.len()];
    let mut first = 0;
    for contact in &model.contacts {
        let boundary = &contact.boundary;
        let rows = contact
            .pair
            .iter()
            .flat_map(|pair| pair.rows.iter().enumerate());
        for (i, row) in rows {
            let axes = body.axes(boundary.nodes[i]);
            let dofs = body.kept_dofs(boundary.nodes[i]);
            let (n, t) = (boundary.normals[i], boundary.tangent(i));
            for (k, weight) in row {
                let there = contact.pair.as_ref().map_or(0, |pair| pair.nodes[*k]);
                let moves = body.axes(there).moves;
                for (dof, moves) in body.kept_dofs(there).into_iter().zip(moves) {
                    match dof {
                        Dof::Free(unknown) => {
                            for (own, along) in dofs.into_iter().zip(axes.along) {
                                if let Dof::Free(own) = own {
                                    let column = &mut columns[unknown - body_own];
                                    *column.entry(own).or_default() += weight * inner(along, moves);
                                }
                            }
                        }
                        Dof::Fixed(value) => {
                            let [along_n, along_t] = &mut prescribed[first + i];
                            *along_n += weight * value * inner(n, moves);
                            *along_t += weight * value * inner(t, moves);
                        }
                    }
                }
            }
        }
        first += boundary.nodes.len();
    }
    let column = |(k, entries): (usize, BTreeMap<usize, f64>)| {
        let mut values = vec![0.0; body_own];
        entries.into_iter().for_each(|(i, value)| values[i] = value);
        body.contact_unknowns(&mut values);
        let mut column = sparse(&values);
        column.push((body_own + k, 1.0));
        column
    };
    (
        columns.into_iter().enumerate().map(column).collect(),
        prescribed,
    )
}

/// The components of the nodes that face each contact, of those that a contact node follows.
fn facing(model: &Model, body: &ElasticBody) -> Vec<Vec<Option<[Component; 2]>>> {
    let of_contact = |contact: &ContactModel| {
        let Some(pair) = &contact.pair else {
            return Vec::new();
        };
        let followed: BTreeSet<usize> = pair.rows.iter().flatten().map(|(k, _)| *k).collect();
        let components = |k: usize| {
            let node = *pair.nodes.get(k).filter(|_| followed.contains(&k))?;
            let ([a, b], [x, y]) = (body.kept_dofs(node), body.axes(node).moves);
            Some([(a, x), (b, y)])
        };
        (0..pair.nodes.len()).map(components).collect()
    };
    model.contacts.iter().map(of_contact).collect()
}

fn inner(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

/// The resistance of a motion, as a part of the stiffness of the nodes that it moves, below which it is rounding.
const RESISTS: f64 = 1e-12;

/// The stiffness of the spring against a motion, as the problem gives it.
fn spring(model: &Model, free: &FreeMotion) -> f64 {
    let tool = model.contacts[free.patch].tool.as_ref();
    tool.map_or(0.0, |tool| tool.stiffness[free.motion])
}

/// The unknown motions of a model's obstacles.
pub fn free_motions(model: &Model) -> impl Iterator<Item = FreeMotion> {
    let contacts = model.contacts.iter().enumerate();
    contacts.flat_map(|(patch, contact)| {
        let free = contact.tool.iter().flat_map(|tool| tool.free());
        free.map(move |motion| FreeMotion { patch, motion })
    })
}

/// A column of P: the displacements of all contact unknowns under a unit motion of an obstacle.
fn moves(model: &Model, body: &ElasticBody, free: &FreeMotion) -> Vec<f64> {
    let mut moves = vec![0.0; body.stiffness.size()];
    let before = model.contacts[..free.patch].iter();
    let first: usize = before.map(|contact| contact.boundary.nodes.len()).sum();
    let contact = &model.contacts[free.patch];
    let Some(tool) = &contact.tool else {
        return moves;
    };
    for (i, node) in contact.boundary.nodes.iter().enumerate() {
        // the displacements of a node of another contact alone are along the axes of that contact
        if model
            .alone
            .get(node)
            .is_some_and(|owner| *owner != free.patch)
        {
            continue;
        }
        let [against_n, along_t] = tool.row(i, free.motion);
        let [normal, tangent] = body.contact_dofs[first + i];
        if let Dof::Free(dof) = normal {
            moves[dof] = -against_n;
        }
        // where two contacts meet, the other unknown is along the normal of the other contact
        if let (Dof::Free(dof), None) = (tangent, body.tangents[first + i]) {
            moves[dof] = along_t;
        }
    }
    body.contact_unknowns(&mut moves);
    moves
}

/// The unknown motions of the obstacle of a contact, as (indentation, tangential displacement, tilt), with 0 for given ones.
pub(super) fn of_patch(motions: &[FreeMotion], q: &[f64], patch: usize) -> [f64; 3] {
    let mut own = [0.0; 3];
    for (free, q) in motions
        .iter()
        .zip(q)
        .filter(|(free, _)| free.patch == patch)
    {
        own[free.motion] = *q;
    }
    own
}
