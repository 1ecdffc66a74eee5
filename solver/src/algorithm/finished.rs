//! The end of an iteration: what every method returns, and what is kept of it.

use crate::algorithm::rounding::{self, Rounding};
use crate::algorithm::slides::Slide;
use crate::algorithm::system::{State, System};
use crate::algorithm::track::{Cycle, Measured, Track};
use crate::problem::Algorithm;
use crate::solution::{Iteration, Outcome, Residuals, Stage};

/// The end of the iterations at one load level.
#[derive(Clone)]
pub struct Finished {
    /// The final state.
    pub state: State,
    /// Ŝ v − f̂ of it.
    pub elastic_force: Vec<f64>,
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
    /// Present where rounding keeps residuals above the tolerance.
    pub rounding: Option<Rounding>,
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
    /// Rounding keeps residuals above the tolerance.
    pub(super) rounding: Option<Rounding>,
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
            rounding: None,
        }
    }

    /// Where rounding is all that keeps the residuals above the tolerance, nothing more can be reached: this is converged,
    /// or if rounding is not small, no method gets any further. What follows from it alone is no cycle and no
    /// contraction.
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
        self.outcome = match rounding.negligible() {
            true => Converged,
            false => NotConverged,
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

    /// A method that does not converge, and has no cycle, is reported with the cycle found by the other method.
    pub(super) fn with_cycle_of(mut self, other: &End) -> Self {
        if self.outcome == Outcome::NotConverged && other.cycle.is_some() {
            self.cycle.clone_from(&other.cycle);
            self.outcome = Outcome::ContactCycling;
        }
        self
    }

    /// No other method is to be tried: it converged, or rounding, the observer or the limit ended it.
    pub(super) fn ended(&self) -> bool {
        matches!(self.outcome, Outcome::Converged | Outcome::Canceled)
            || self.exhausted
            || self.rounding.is_some()
    }
}

pub(super) fn finish(track: Track<'_, '_>, end: End) -> Finished {
    let end = match track.controls.algorithm {
        // stops by a test of its own
        Algorithm::Thesis => end,
        _ => end.settled(track.system, track.controls.tolerance, &track.history),
    };
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
        rounding: end.rounding,
        state: measured.state,
        elastic_force: measured.elastic_force,
        bound: measured.bound,
    }
}
