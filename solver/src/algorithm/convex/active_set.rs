//! Primal–dual active set with semi-smooth Newton steps.

use super::step::{AIM, Minimum, close, free_dofs, gradient, newton_direction};
use crate::algorithm::rounding::{PATIENCE, is_rounding};
use crate::algorithm::system::{State, System};
use crate::elasticity::Dof;
use crate::solution::{Observer, Progress};

/// Steps of the active set before falling back.
const ACTIVE_SET_STEPS: u32 = 30;

/// Guesses the active set, solves with one Newton step, and corrects the guess.
pub(super) fn run(
    system: &System<'_>,
    bound: &[f64],
    start: &State,
    tolerance: f64,
    observe: &mut Observer<'_>,
) -> Minimum {
    let mut state = start.clone();
    let mut best: Option<Minimum> = None;
    let mut without_gain = 0;
    for step in 1..=ACTIVE_SET_STEPS {
        close(system, &mut state);
        let free: Vec<usize> = free_dofs(system, |i| state.active[i]);
        let force = gradient(system, &state.v, bound);
        let Some(delta) = newton_direction(system, bound, &state.v, &force, &free, observe) else {
            break;
        };
        free.iter()
            .zip(&delta)
            .for_each(|(&dof, d)| state.v[dof] += d);
        let changed = update_active(system, &mut state);
        let residual = system.kkt_residual(&state, bound);
        // with settled sets a step is exact up to rounding: no further gain is possible
        let gained = best.as_ref().is_none_or(|b| residual <= 0.5 * b.residual);
        let settled = !changed && !gained;
        without_gain = if gained { 0 } else { without_gain + 1 };
        if best.as_ref().is_none_or(|b| residual < b.residual) {
            best = Some(Minimum {
                state: state.clone(),
                steps: step,
                residual,
                rounded: false,
            });
        }
        let reached = best.as_ref().map_or(f64::INFINITY, |b| b.residual);
        let arrived = !changed && residual <= AIM * tolerance || settled && reached <= tolerance;
        if let Some(best) = &mut best
            && without_gain >= PATIENCE
            && is_rounding(system, (&best.state, bound), best.residual, tolerance)
        {
            best.rounded = true;
            break;
        }
        if arrived || observe(Progress::Pulse).is_break() {
            break;
        }
    }
    let steps = best.as_ref().map_or(0, |b| b.steps);
    best.unwrap_or(Minimum {
        state,
        steps,
        residual: f64::INFINITY,
        rounded: false,
    })
}

/// Keeps nodes that are pressed, adds nodes that have passed the obstacle; true on any change.
pub(in crate::algorithm) fn update_active(system: &System<'_>, state: &mut State) -> bool {
    // friction acts along t only: it does not enter the reactions
    let force = system.elastic_force(&state.v);
    let mut changed = false;
    for (i, node) in system.nodes.iter().enumerate() {
        let Dof::Free(dof) = node.normal else {
            continue;
        };
        if node.bonded {
            continue;
        }
        let active = if state.active[i] {
            -force[dof] >= 0.0
        } else {
            state.v[dof] > node.gap
        };
        changed |= active != state.active[i];
        state.active[i] = active;
    }
    changed
}
