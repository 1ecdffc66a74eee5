//! The end of an iteration: what every method returns, and what is kept of it.

use crate::algorithm::slides::Slide;
use crate::algorithm::system::State;
use crate::algorithm::track::{Cycle, Measured, Track};
use crate::solution::{Iteration, Outcome, Residuals, Stage};

/// The end of the iterations at one load level.
#[derive(Clone)]
pub struct Finished {
    /// The final state.
    pub state: State,
    /// The friction bound used for it, at every friction point.
    pub bound: Vec<f64>,
    /// σ_t at every friction point.
    pub tractions: Vec<f64>,
    /// The tractions are those of the thesis's own iteration, not those of the law at this state.
    pub own_tractions: bool,
    /// How it ended.
    pub outcome: Outcome,
    /// The stage that produced the final state.
    pub stage: Stage,
    /// kkt, friction and monolithic; equilibrium is computed from the body.
    pub residuals: Residuals,
    /// Last q = |Δτ_k|/|Δτ_{k−1}| of plain sweeps.
    pub contraction: Option<f64>,
    /// All rows.
    pub history: Vec<Iteration>,
    /// Period and nodes of a cycle.
    pub cycle: Option<Cycle>,
    /// Why there is no equilibrium, where the body slides away.
    pub slide: Option<Slide>,
}

/// Where a method ended.
pub(super) struct End {
    pub(super) measured: Measured,
    pub(super) stage: Stage,
    pub(super) outcome: Outcome,
    pub(super) cycle: Option<Cycle>,
    /// Last q of sweeps that were not accelerated.
    pub(super) contraction: Option<f64>,
    /// The limit of iterations is reached.
    pub(super) exhausted: bool,
}

impl End {
    /// Without a cycle or a contraction, and with iterations left.
    pub(super) fn new(measured: Measured, stage: Stage, outcome: Outcome) -> Self {
        End {
            measured,
            stage,
            outcome,
            cycle: None,
            contraction: None,
            exhausted: false,
        }
    }

    /// A method that does not converge, and has no cycle, is reported with the cycle found by the other method.
    pub(super) fn with_cycle_of(mut self, other: &End) -> Self {
        if self.outcome == Outcome::NotConverged && other.cycle.is_some() {
            self.cycle.clone_from(&other.cycle);
            self.outcome = Outcome::ContactCycling;
        }
        self
    }

    /// No other method is to be tried: it converged, or the observer or the limit ended it.
    pub(super) fn ended(&self) -> bool {
        matches!(self.outcome, Outcome::Converged | Outcome::Canceled) || self.exhausted
    }
}

pub(super) fn finish(track: Track<'_, '_>, end: End) -> Finished {
    let measured = end.measured;
    Finished {
        tractions: track.system.tractions(&measured.state.v, &measured.bound),
        own_tractions: false,
        outcome: end.outcome,
        stage: end.stage,
        residuals: measured.residuals,
        contraction: end.contraction,
        history: track.history,
        cycle: end.cycle,
        slide: None,
        state: measured.state,
        bound: measured.bound,
    }
}
