//! Primal–dual active set with semi-smooth Newton steps.

use super::projected_newton::least_along;
use super::step::{AIM, Minimum, close, gradient};
use crate::algorithm::factors::{Factors, free_dofs};
use crate::algorithm::rounding::{PATIENCE, is_rounding};
use crate::algorithm::system::{State, System};
use crate::elasticity::Dof;
use crate::observer::Observer;

/// The largest reaction that counts as zero, as a part of the problem's own force.
const NO_FORCE: f64 = 1e-30;

/// The part of the residual that a step may leave; if it leaves more, the next step is damped.
const STALLED: f64 = 0.7;

/// The largest number of steps; then projected Newton takes over.
const ACTIVE_SET_STEPS: u32 = 30;

/// Minimises J: guesses the active set, solves with one Newton step, and corrects the guess, again and again.
pub(super) fn run(
    system: &System<'_>,
    bound: &[f64],
    start: &State,
    tolerance: f64,
    factors: &mut Factors,
    observer: &mut dyn Observer,
) -> Minimum {
    let mut state = start.clone();
    close(system, &mut state);
    let mut elastic_force = system.elastic_force(&state.v);
    let mut residual_before = system.kkt_residual(&state, &elastic_force, bound);
    let mut stalled = false;
    let mut best: Option<Minimum> = None;
    let mut without_gain = 0;
    for step in 1..=ACTIVE_SET_STEPS {
        if close(system, &mut state) {
            elastic_force = system.elastic_force(&state.v);
        }
        let newton = (system, bound, &mut *factors);
        let from = (&state, &elastic_force[..]);
        let Some(next) = step_from(newton, from, residual_before, stalled, observer) else {
            break;
        };
        stalled = next.residual > STALLED * residual_before;
        let (changed, residual) = (next.changed, next.residual);
        (state, elastic_force, residual_before) = (next.state, next.elastic_force, residual);
        // with settled sets a step is exact up to rounding: no further gain is possible
        let gained = best.as_ref().is_none_or(|b| residual <= 0.5 * b.residual);
        let settled = !changed && !gained;
        without_gain = if gained { 0 } else { without_gain + 1 };
        if best.as_ref().is_none_or(|b| residual < b.residual) {
            best = Some(Minimum {
                state: state.clone(),
                elastic_force: elastic_force.clone(),
                steps: step,
                residual,
                rounded: false,
            });
        }
        let reached = best.as_ref().map_or(f64::INFINITY, |b| b.residual);
        let arrived = !changed && residual <= AIM * tolerance || settled && reached <= tolerance;
        if let Some(best) = &mut best
            && without_gain >= PATIENCE
        {
            let reactions = system.reactions_of(&best.state, &best.elastic_force);
            let known = (&best.state, &reactions[..], bound);
            if is_rounding(system, known, best.residual, tolerance) {
                best.rounded = true;
                break;
            }
        }
        if arrived || observer.stop() {
            break;
        }
    }
    let steps = best.as_ref().map_or(0, |b| b.steps);
    best.unwrap_or(Minimum {
        state,
        elastic_force,
        steps,
        residual: f64::INFINITY,
        rounded: false,
    })
}

/// The state after a step.
struct Next {
    state: State,
    elastic_force: Vec<f64>,
    /// Whether the contact set changed.
    changed: bool,
    residual: f64,
}

/// Makes a step with the factor that was used last; if the residual shrinks too little, discards the result and makes
/// the step with a new factor. A `damped` step ends where J is smallest along it, since whole steps may alternate
/// between stick and slip. None if there is no factor, or the observer stops.
fn step_from(
    (system, bound, factors): (&System<'_>, &[f64], &mut Factors),
    (state, elastic_force): (&State, &[f64]),
    residual_before: f64,
    damped: bool,
    observer: &mut dyn Observer,
) -> Option<Next> {
    /// The largest part of the residual that a step with an older factor may leave. A step with a new factor costs as
    /// much as several steps with an older one.
    const SERVES: f64 = 0.1;
    let free: Vec<usize> = free_dofs(system, |i| state.active[i]);
    let force = gradient(system, &state.v, elastic_force, bound);
    loop {
        let renewed = factors.prepare(system, bound, &state.v, &free, observer)?;
        let direction = factors.direction(&force)?;
        let part = if damped {
            least_along(system, bound, &state.v, &direction)
        } else {
            1.0
        };
        let mut next = state.clone();
        let moved = next.v.iter_mut().zip(&direction);
        moved.for_each(|(v, d)| *v += part * d);
        let elastic_force = system.elastic_force(&next.v);
        let changed = update_active(system, &elastic_force, &mut next);
        let residual = system.kkt_residual(&next, &elastic_force, bound);
        if renewed || residual <= SERVES * residual_before {
            return Some(Next {
                state: next,
                elastic_force,
                changed,
                residual,
            });
        }
        factors.renew();
    }
}

/// Removes nodes that are pulled from the active set, and adds nodes that have passed the obstacle; true if the set
/// changes. `force`: Ŝ v − f̂; friction acts along t only and does not enter the reactions.
pub(in crate::algorithm) fn update_active(
    system: &System<'_>,
    force: &[f64],
    state: &mut State,
) -> bool {
    // a body that is at rest again is left with what underflows: that is no contact
    let none = NO_FORCE * system.reference_force;
    let mut changed = false;
    for (i, node) in system.nodes.iter().enumerate() {
        let Dof::Free(dof) = node.normal else {
            continue;
        };
        if node.bonded {
            continue;
        }
        let active = if state.active[i] {
            -force[dof] >= none
        } else {
            system.stiffness.at(dof, dof) * (state.v[dof] - node.gap) > none
        };
        changed |= active != state.active[i];
        state.active[i] = active;
    }
    changed
}
