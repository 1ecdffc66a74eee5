//! Rigid obstacles whose loads are given instead of their motions: the unknown motions q are eliminated, so that every
//! method works with displacements relative to the obstacles.
//!
//! With the displacements v of the contact unknowns and P, which has the displacements of these unknowns under unit
//! motions of the obstacles,
//!
//!   w = v − P q,     A = K + PᵀŜP,     S_w = Ŝ − ŜP A⁻¹ PᵀŜ,     f_w = f̂ − ŜP A⁻¹ (f_q + Pᵀf̂)
//!
//! and afterwards q = A⁻¹ (f_q + Pᵀ(f̂ − Ŝw)), with the loads f_q and the springs K of the obstacles. In w the gap is that of
//! the obstacles before their unknown motions; reactions, slip and friction are the same as in v.

use std::sync::Arc;

use crate::body::ElasticBody;
use crate::elasticity::Dof;
use crate::error::SolveError;
use crate::linear::{Cholesky, Dense, Interrupt, Unsolved};
use crate::model::{Level, Model};
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

/// The unknown motions of all obstacles, on one body.
pub struct Tools {
    /// The unknown motions q, in order.
    pub motions: Vec<FreeMotion>,
    /// The columns of P.
    moves: Vec<Vec<f64>>,
    /// The columns of ŜP.
    forces: Vec<Vec<f64>>,
    /// The factor of A.
    factor: Cholesky,
    /// The stiffness S_w.
    pub stiffness: Arc<Dense>,
    /// A unit load of the problem, divided by 2π in axisymmetry.
    unit: f64,
}

impl Tools {
    /// The unknown motions of a model's obstacles; none if all motions are given.
    ///
    /// # Errors
    ///
    /// [`SolveError::ObstacleUnheld`] if an obstacle and the body may move together without a force.
    pub fn new(
        model: &Model,
        body: &ElasticBody,
        observer: &mut dyn Observer,
    ) -> Result<Option<Self>, SolveError> {
        let motions: Vec<FreeMotion> = free_motions(model).collect();
        if motions.is_empty() {
            return Ok(None);
        }
        let size = body.stiffness.size();
        take(observer, Dense::bytes(size))?;
        let moves: Vec<Vec<f64>> = motions
            .iter()
            .map(|free| moves(model, body, free))
            .collect();
        let forces: Vec<Vec<f64>> = moves.iter().map(|p| body.stiffness.times(p)).collect();
        let unit = 1.0 / model.section.circumference();
        let entry = |i: usize, j: usize| {
            let own = if i == j {
                unit * spring(model, &motions[i])
            } else {
                0.0
            };
            own + dot(&moves[i], &forces[j])
        };
        let mut stop = || observer.stop();
        let interrupt = &mut Interrupt::new(&mut stop);
        // what is left of a motion that meets no resistance is rounding
        let resists = |i: usize| {
            let size = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
            entry(i, i)
                > RESISTS * size(&moves[i]) * size(&forces[i]).max(stiffest(body) * size(&moves[i]))
        };
        let factor = match Cholesky::new(motions.len(), entry, &[], None, interrupt) {
            Ok(factor) if (0..motions.len()).all(resists) => factor,
            Err(Unsolved::Stopped) => return Err(SolveError::Stopped),
            Err(Unsolved::TooLarge { bytes }) => {
                return Err(SolveError::ResourceExhausted { bytes });
            }
            Ok(_) | Err(Unsolved::Singular) => {
                return Err(SolveError::ObstacleUnheld {
                    contact: model.contacts[motions[0].patch].name.clone(),
                    motion: "it moves together with the body, which no support holds".to_owned(),
                });
            }
        };
        let too_large = SolveError::ResourceExhausted {
            bytes: Dense::bytes(size),
        };
        let mut stiffness = Dense::try_zero(size, interrupt)?.ok_or(too_large)?;
        // S_w = Ŝ − (ŜP) A⁻¹ (ŜP)ᵀ
        let solved = |row: usize| {
            let mut x: Vec<f64> = forces.iter().map(|force| force[row]).collect();
            factor.solve(&mut x);
            x
        };
        for j in 0..size {
            let x = solved(j);
            for i in 0..size {
                let part: f64 = forces.iter().zip(&x).map(|(force, x)| force[i] * x).sum();
                stiffness.set(i, j, body.stiffness.at(i, j) - part);
            }
            interrupt.worked(size as f64)?;
        }
        Ok(Some(Tools {
            motions,
            moves,
            forces,
            factor,
            stiffness: Arc::new(stiffness),
            unit,
        }))
    }

    /// The motions q for w = 0, from the load f̂ of the body at a load level.
    pub(super) fn at_rest(&self, model: &Model, level: &Level, load: &[f64]) -> Vec<f64> {
        let moved = self.motions.iter().zip(&self.moves);
        let mut q: Vec<f64> = moved
            .map(|(free, moves)| self.load(model, level, free) + dot(moves, load))
            .collect();
        self.factor.solve(&mut q);
        q
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

    /// The load f_w = f̂ − ŜP q₀ on displacements relative to the obstacles. `at_rest`: q₀ of [`Tools::at_rest`].
    pub(super) fn reduced(&self, mut load: Vec<f64>, at_rest: &[f64]) -> Vec<f64> {
        for (force, q) in self.forces.iter().zip(at_rest) {
            load.iter_mut().zip(force).for_each(|(f, s)| *f -= q * s);
        }
        load
    }

    /// The motions q = q₀ − A⁻¹ PᵀŜ w.
    pub(super) fn motions(&self, at_rest: &[f64], w: &[f64]) -> Vec<f64> {
        let mut back: Vec<f64> = self.forces.iter().map(|force| dot(force, w)).collect();
        self.factor.solve(&mut back);
        at_rest.iter().zip(back).map(|(q, b)| q - b).collect()
    }

    /// The displacements w + P q of the contact unknowns.
    pub(super) fn displaced(&self, w: &[f64], q: &[f64]) -> Vec<f64> {
        let mut v = w.to_vec();
        for (moves, q) in self.moves.iter().zip(q) {
            v.iter_mut().zip(moves).for_each(|(v, p)| *v += q * p);
        }
        v
    }

    /// The derivatives of the unknown motion number `k` by w, −ŜP A⁻¹ e_k.
    pub(super) fn gradient(&self, k: usize) -> Vec<f64> {
        let unit = self.unit_response(k);
        let mut gradient = vec![0.0; self.stiffness.size()];
        for (force, a) in self.forces.iter().zip(unit) {
            gradient
                .iter_mut()
                .zip(force)
                .for_each(|(g, s)| *g -= a * s);
        }
        gradient
    }

    /// A⁻¹ e_k: the motions by a unit load along motion number `k`, with w = 0.
    pub(super) fn unit_response(&self, k: usize) -> Vec<f64> {
        let mut unit: Vec<f64> = (0..self.motions.len()).map(|i| f64::from(i == k)).collect();
        self.factor.solve(&mut unit);
        unit
    }

    /// The number of an unknown motion.
    pub(super) fn number(&self, patch: usize, motion: usize) -> Option<usize> {
        let wanted = FreeMotion { patch, motion };
        self.motions.iter().position(|free| *free == wanted)
    }
}

/// The resistance of a motion, as a part of the stiffness of the nodes that it moves, below which it is rounding.
const RESISTS: f64 = 1e-12;

/// The stiffness of the spring against a motion, as the problem gives it.
fn spring(model: &Model, free: &FreeMotion) -> f64 {
    let tool = model.contacts[free.patch].tool.as_ref();
    tool.map_or(0.0, |tool| tool.stiffness[free.motion])
}

fn stiffest(body: &ElasticBody) -> f64 {
    (0..body.stiffness.size()).fold(0.0, |most, i| body.stiffness.at(i, i).max(most))
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

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
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
