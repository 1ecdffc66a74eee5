//! The end of the iterations, as every method returns it.

use crate::algorithm::recorder::{Cycle, Measured, Recorder};
use crate::algorithm::rounding::{self, Rounding};
use crate::algorithm::slides::Slide;
use crate::algorithm::system::{State, System};
use crate::problem::Algorithm;
use crate::solution::{Iteration, Outcome, Residuals, Stage};

/// The result of the iterations at one load level.
#[derive(Clone)]
pub struct Finished {
    /// The final state.
    pub state: State,
    /// The elastic force Ŝ v − f̂ of the final state.
    pub elastic_force: Vec<f64>,
    /// The friction bound in the final state, at every friction point.
    pub bound: Vec<f64>,
    /// The tangential stress σ_t at every friction point.
    pub tractions: Vec<f64>,
    /// Whether `tractions` are those of the thesis's own iteration, and not those of the law in the final state.
    pub own_tractions: bool,
    /// How the iteration ended.
    pub outcome: Outcome,
    /// The stage that produced the final state.
    pub stage: Stage,
    /// The residuals kkt, friction and monolithic; equilibrium is computed from the body later.
    pub residuals: Residuals,
    /// The last contraction q = |Δτ_k|/|Δτ_{k−1}| of the sweeps, as long as they were not accelerated.
    pub contraction: Option<f64>,
    /// All iterations, one row each.
    pub history: Vec<Iteration>,
    /// The cycle that the iterations fell into, if any.
    pub cycle: Option<Cycle>,
    /// The motion by which the body slides away, if there is no equilibrium.
    pub slide: Option<Slide>,
    /// Present if rounding keeps residuals above the tolerance.
    pub rounding: Option<Rounding>,
}

/// The result of one method: its best state, and how the method ended.
pub(super) struct End {
    pub(super) measured: Measured,
    pub(super) stage: Stage,
    pub(super) outcome: Outcome,
    pub(super) cycle: Option<Cycle>,
    /// The last contraction q of the sweeps, as long as they were not accelerated.
    pub(super) contraction: Option<f64>,
    /// Whether the method has reached the limit of iterations.
    pub(super) exhausted: bool,
    /// Present if rounding keeps residuals above the tolerance.
    pub(super) rounding: Option<Rounding>,
}

impl End {
    /// The result of a method without cycle and contraction, and with iterations left.
    pub(super) fn new(measured: Measured, stage: Stage, outcome: Outcome) -> Self {
        End {
            measured,
            stage,
            outcome,
            cycle: None,
            contraction: None,
            exhausted: false,
            rounding: None,
        }
    }

    /// Sets outcome and rounding if only rounding keeps the residuals above the tolerance. If that rounding is small,
    /// the state is converged; if it is not, no other method would get further. Cycles and contractions that rounding
    /// causes are removed.
    pub(super) fn settled(
        mut self,
        system: &System<'_>,
        tolerance: f64,
        rows: &[Iteration],
    ) -> Self {
        use Outcome::{ContactCycling, Converged, NotConverged};
        if !matches!(self.outcome, Converged | NotConverged | ContactCycling) {
            return self;
        }
        let Some((rounding, friction)) = rounding::limit(system, &self.measured, tolerance) else {
            return self;
        };
        self.outcome = if rounding.negligible() {
            Converged
        } else {
            NotConverged
        };
        self.rounding = Some(rounding);
        self.cycle = None;
        let known = rows
            .iter()
            .rev()
            .filter(|row| row.friction_residual > friction);
        self.contraction = known.filter_map(|row| row.contraction).next();
        self
    }

    /// Adds the cycle of another method to the result of this one, if this method did not converge and has no cycle.
    pub(super) fn with_cycle_of(mut self, other: &End) -> Self {
        if self.outcome == Outcome::NotConverged && other.cycle.is_some() {
            self.cycle.clone_from(&other.cycle);
            self.outcome = Outcome::ContactCycling;
        }
        self
    }

    /// Whether no other method is to be tried: this method converged, or rounding, the observer or the limit ended it.
    pub(super) fn ended(&self) -> bool {
        matches!(self.outcome, Outcome::Converged | Outcome::Canceled)
            || self.exhausted
            || self.rounding.is_some()
    }
}

/// The state without contact, if what touches presses by rounding only: two bodies that touch where they are at rest, or that
/// move together. Friction then has the bound of no pressure. Else the state itself.
fn opened(system: &System<'_>, measured: Measured, outcome: Outcome) -> Measured {
    if outcome != Outcome::Converged || system.presses(&measured.reactions) {
        return measured;
    }
    let mut state = measured.state;
    for (active, node) in state.active.iter_mut().zip(&system.nodes) {
        *active = node.bonded;
    }
    let without = vec![0.0; system.nodes.len()];
    let bound = system.friction_bound(&without);
    Measured::with_force(system, state, measured.elastic_force, bound)
}

pub(super) fn finish(recorder: Recorder<'_, '_>, end: End) -> Finished {
    let end = match recorder.controls.algorithm {
        // stops by a test of its own
        Algorithm::Thesis => end,
        _ => end.settled(
            recorder.system,
            recorder.controls.tolerance,
            &recorder.history,
        ),
    };
    let measured = opened(recorder.system, end.measured, end.outcome);
    Finished {
        tractions: recorder
            .system
            .tractions(&measured.state.v, &measured.bound),
        own_tractions: false,
        outcome: end.outcome,
        stage: end.stage,
        residuals: measured.residuals,
        contraction: end.contraction,
        history: recorder.history,
        cycle: end.cycle,
        slide: None,
        rounding: end.rounding,
        state: measured.state,
        elastic_force: measured.elastic_force,
        bound: measured.bound,
    }
}
