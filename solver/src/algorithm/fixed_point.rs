//! The outer sweeps, thesis (1.18)–(1.22) and 3.1. A sweep freezes the friction bound and solves the convex problem;
//! the next sweep takes the bound that the pressure of the solution implies. If the sweeps contract slowly, the next
//! bound is extrapolated from the last few (Anderson acceleration).

use crate::algorithm::convex::{Minimum, minimise_with};
use crate::algorithm::finished::End;
use crate::algorithm::recorder::{Measured, Recorder, Row};
use crate::algorithm::rounding;
use crate::algorithm::system::{State, System};
use crate::elasticity::Dof;
use crate::friction::Source;
use crate::linear::least_squares;
use crate::observer::Observer;
use crate::solution::{Outcome, Stage};

/// The contraction q above which sweeps are accelerated.
const SLOW: f64 = 0.7;

/// The number of earlier sweeps that an acceleration uses.
const DEPTH: usize = 5;

/// The number of sweeps without progress after which another method is tried.
const PATIENCE: usize = 15;

/// The part of the previous residual above which a residual may consist of rounding.
const STEADY: f64 = 0.5;

/// The number of sweeps in a row with only rounding left after which no better sweep is expected: each has tried
/// several steps.
const SETTLED: u32 = 3;

/// Solves the convex problem for one bound, and measures and records its solution. Also returns whether to stop.
pub(super) fn sweep(
    recorder: &mut Recorder<'_, '_>,
    stage: Stage,
    bound: Vec<f64>,
    start: &State,
    observer: &mut dyn Observer,
    contraction: impl FnOnce(&Measured) -> Option<f64>,
) -> (Measured, bool) {
    let tolerance = recorder.controls.tolerance;
    let Minimum {
        state,
        elastic_force,
        steps,
        residual,
        ..
    } = minimise_with(
        recorder.system,
        &bound,
        start,
        tolerance,
        &mut recorder.factors,
        observer,
    );
    let measured = Measured::with_force(recorder.system, state, elastic_force, bound);
    let row = Row {
        stage,
        residual,
        contraction: contraction(&measured),
        inner: steps,
        tractions: recorder
            .system
            .tractions(&measured.state.v, &measured.bound),
        own_r_f: None,
    };
    let stopped = recorder.record(&measured, row, observer);
    (measured, stopped)
}

/// Sweeps from a state and the bound that it implies until state and bound no longer change.
///
/// The sweeps have converged if the contact set is unchanged and the kkt, friction and monolithic residuals are at or
/// below the tolerance (formulation 4.4).
pub(super) fn run(
    recorder: &mut Recorder<'_, '_>,
    start: Measured,
    give_up_early: bool,
    observer: &mut dyn Observer,
) -> End {
    let given = |source: &Source| matches!(source, Source::Given(_));
    let prescribed = recorder.system.points.iter().all(|p| given(&p.source));
    let stage = if prescribed {
        Stage::Inner
    } else {
        Stage::Outer
    };
    let tolerance = recorder.controls.tolerance;
    let mut swept = End::new(start, stage, Outcome::NotConverged);
    let mut best: Option<Measured> = None;
    let mut since_best = 0;
    let mut memory = Memory::default();
    let mut change_before: Option<f64> = None;
    let mut slow = 0;
    let mut accelerated = false;
    let mut rounded: Option<(Measured, u32)> = None;
    let mut residual_before = f64::INFINITY;
    let mut next = swept.measured.implied_bound.clone();
    for count in 0..recorder.controls.max_iterations {
        let before = change_before.filter(|_| !accelerated);
        let quotient = |m: &Measured| {
            let before = before.filter(|b| *b > 0.0 && m.bound_change > 0.0)?;
            Some(m.bound_change / before)
        };
        let start = swept.measured.state.clone();
        let (measured, stopped) = sweep(recorder, stage, next, &start, observer, quotient);
        let q = quotient(&measured);
        swept.contraction = q.or(swept.contraction);
        let (change, friction) = (measured.bound_change, measured.residuals.friction);
        let settled = count > 0 || !recorder.contact_changed || prescribed;
        swept.measured = measured;
        if settled && (!recorder.contact_changed || prescribed) && swept.measured.within(tolerance)
        {
            swept.outcome = Outcome::Converged;
            swept.cycle = None;
            return swept;
        }
        if stopped {
            swept.outcome = Outcome::Canceled;
            return swept;
        }
        // what still shrinks is not rounding
        let residual = swept.measured.residuals.monolithic;
        rounded = if residual > STEADY * residual_before {
            nearer(rounded, &swept.measured, recorder.system, tolerance)
        } else {
            None
        };
        residual_before = residual;
        if let Some((nearest, _)) = rounded.take_if(|(_, count)| *count >= SETTLED) {
            swept.measured = nearest;
            swept.outcome = Outcome::Converged;
            swept.cycle = None;
            return swept;
        }
        let better = |b: &Measured| friction < 0.9 * b.residuals.friction;
        if best.as_ref().is_none_or(better) {
            best = Some(swept.measured.clone());
            since_best = 0;
        } else {
            since_best += 1;
        }
        if let Some(cycle) = recorder.note(&swept.measured.state, friction) {
            // an acceleration may still lead out of the cycle; if not, it is what is reported at the end
            swept.cycle = Some(cycle);
            if give_up_early && !accelerated {
                break;
            }
            accelerated = true;
        }
        slow = if q.is_some_and(|q| q > SLOW) {
            slow + 1
        } else {
            0
        };
        accelerated |= slow >= 2 || q.is_some_and(|q| q >= 1.0);
        memory.push(&swept.measured.bound, &swept.measured.implied_bound);
        next = if accelerated {
            memory.extrapolate()
        } else {
            swept.measured.implied_bound.clone()
        };
        // the quotient of changes that are rounding is no contraction
        change_before = (friction > tolerance).then_some(change);
        if give_up_early && accelerated && since_best >= PATIENCE {
            break;
        }
        swept.exhausted = count + 1 == recorder.controls.max_iterations;
    }
    if swept.cycle.is_some() {
        swept.outcome = Outcome::ContactCycling;
    }
    if let Some(best) = best
        && best.residuals.friction < swept.measured.residuals.friction
    {
        swept.measured = best;
    }
    swept
}

/// Counts the sweeps in a row that leave only rounding above the tolerance, and keeps the best of them. None if `now`
/// is not such a sweep.
fn nearer(
    before: Option<(Measured, u32)>,
    now: &Measured,
    system: &System<'_>,
    tolerance: f64,
) -> Option<(Measured, u32)> {
    rounding::limit(system, now, tolerance)?;
    let monolithic = |measured: &Measured| measured.residuals.monolithic;
    match before {
        Some((best, count)) if monolithic(&best) <= monolithic(now) => Some((best, count + 1)),
        Some((_, count)) => Some((now.clone(), count + 1)),
        None => Some((now.clone(), 1)),
    }
}

/// The last sweeps: by sweep its bound, and the difference between the bound that its pressure implies and its bound.
#[derive(Default)]
struct Memory {
    bounds: Vec<Vec<f64>>,
    defects: Vec<Vec<f64>>,
}

impl Memory {
    fn push(&mut self, bound: &[f64], implied: &[f64]) {
        if self.bounds.len() > DEPTH {
            self.bounds.remove(0);
            self.defects.remove(0);
        }
        self.bounds.push(bound.to_vec());
        self.defects
            .push(implied.iter().zip(bound).map(|(a, b)| a - b).collect());
    }

    /// Anderson's step: the combination of the last bounds that has the smallest difference, plus that difference.
    /// Negative bounds become 0.
    fn extrapolate(&self) -> Vec<f64> {
        let last = self.bounds.len() - 1;
        let (bound, defect) = (&self.bounds[last], &self.defects[last]);
        let mut next: Vec<f64> = bound.iter().zip(defect).map(|(a, b)| a + b).collect();
        let difference = |list: &[Vec<f64>], k: usize| -> Vec<f64> {
            list[last]
                .iter()
                .zip(&list[k])
                .map(|(a, b)| a - b)
                .collect()
        };
        let columns: Vec<Vec<f64>> = (0..last).map(|k| difference(&self.defects, k)).collect();
        if let Some(weights) = least_squares(&columns, defect) {
            for (k, weight) in weights.iter().enumerate() {
                let moved = difference(&self.bounds, k);
                for (i, value) in next.iter_mut().enumerate() {
                    *value -= weight * (moved[i] + columns[k][i]);
                }
            }
        }
        next.iter_mut().for_each(|tau| *tau = tau.max(0.0));
        next
    }
}

/// The state with u_t = d, at rest on the obstacle, at every node of contacts with friction: every point sticks and
/// acts with full stiffness.
pub(super) fn all_sticking(system: &System<'_>, state: &State) -> State {
    let mut state = state.clone();
    for patch in system.patches.iter().filter(|patch| patch.law.is_some()) {
        for node in &system.nodes[system.range(patch)] {
            if let Dof::Free(dof) = node.tangent {
                state.v[dof] = node.drag;
            }
        }
    }
    state
}
