//! Steps from the solution of a neighbour, a problem with slightly different numbers, to the solution of a system.
//!
//! Each step takes the friction bound that the present pressure implies, and makes one step of the convex problem with
//! the last factor while that is accurate enough: sweeps with one inner step each. The residual shrinks by a constant
//! factor, down to rounding. If it does not, the neighbour is too different, and the usual methods start anew.

use crate::algorithm::convex::{close, least_along, update_active};
use crate::algorithm::factors::{Factors, free_dofs};
use crate::algorithm::finished::Finished;
use crate::algorithm::system::{State, System};
use crate::observer::Observer;
use crate::problem::SolverControls;
use crate::solution::{Outcome, Residuals, Stage};

/// The largest number of steps; eight to twelve are usual.
const MOST_STEPS: u32 = 40;

/// The part of the tolerance that the residual must reach, so that the start has hardly any influence on the result.
const AIM: f64 = 0.1;

/// The part of the residual that a step may leave; if it leaves more, the next step has a new factor.
const SERVES: f64 = 0.2;

/// The largest number of steps that leave more than [`SLOW`] of the residual: at first contact sets change.
const PATIENCE: u32 = 6;

/// The part of the residual above which a step is slow. If many steps are slow, the solution may not be the only one.
const SLOW: f64 = 0.7;

/// The solution of a system close to `start`, and the number of steps to it. None if the steps do not converge quickly.
pub(super) fn follow(
    system: &System<'_>,
    controls: &SolverControls,
    start: &State,
    factors: &mut Factors,
    observer: &mut dyn Observer,
) -> Option<(Finished, u32)> {
    let (tolerance, most) = (controls.tolerance, controls.max_iterations.min(MOST_STEPS));
    let mut state = start.clone();
    let (mut residual_before, mut slow, mut changed) = (f64::INFINITY, 0, true);
    close(system, &mut state);
    let mut elastic_force = system.elastic_force(&state.v);
    let mut before: Option<(Vec<f64>, Vec<f64>)> = None;
    for steps in 0..=most {
        let pressures = system.pressures(&system.reactions_of(&state, &elastic_force));
        let bound = system.friction_bound(&pressures);
        let tractions = system.tractions(&state.v, &bound);
        let mut force = vec![0.0; state.v.len()];
        system.add_traction_force(&tractions, &mut force);
        let residual = system.kkt_residual_of(&state, &elastic_force, &force);
        if steps > 0 && !changed && residual <= AIM * tolerance {
            let finished = Finished {
                state,
                elastic_force,
                bound,
                tractions,
                own_tractions: false,
                outcome: Outcome::Converged,
                stage: Stage::Outer,
                residuals: Residuals {
                    kkt: residual,
                    monolithic: residual,
                    ..Residuals::default()
                },
                contraction: None,
                history: Vec::new(),
                cycle: None,
                slide: None,
                rounding: None,
            };
            return Some((finished, steps));
        }
        let stalls = residual > SLOW * residual_before;
        slow += u32::from(stalls);
        if slow > PATIENCE || observer.stop() {
            return None;
        }
        if residual > SERVES * residual_before {
            factors.renew();
        }
        residual_before = residual;
        let free = free_dofs(system, |i| state.active[i]);
        let renewed = factors.prepare(system, &bound, &state.v, &free, observer)?;
        let sums = force.iter_mut().zip(&elastic_force);
        sums.for_each(|(force, elastic)| *force += elastic);
        let direction = factors.direction(&force)?;
        // whole steps may go to and fro between stick and slip
        let part = if stalls {
            least_along(system, &bound, &state.v, &direction)
        } else {
            1.0
        };
        let from = state.v.clone();
        let moved = state.v.iter_mut().zip(&direction);
        moved.for_each(|(v, d)| *v += part * d);
        // steps that each follow from the one before by the same linear map
        if let Some(before) = before.filter(|_| !(changed || renewed || stalls)) {
            let further = further(&before, (&from, &direction));
            let further = state.v.iter_mut().zip(further);
            further.for_each(|(v, more)| *v += more);
        }
        before = (!stalls).then_some((from, direction));
        elastic_force = system.elastic_force(&state.v);
        changed = update_active(system, &elastic_force, &mut state);
        if close(system, &mut state) {
            elastic_force = system.elastic_force(&state.v);
        }
    }
    None
}

/// Anderson's acceleration with one step remembered (formulation 4.9). From two steps d₁, d₂ and the places x₁, x₂
/// where they began, the further step is −γ (x₂ − x₁ + d₂ − d₁) with the γ that makes d₂ − γ (d₂ − d₁) smallest. Empty
/// unless |γ| < 1.
fn further(
    (place_before, step_before): &(Vec<f64>, Vec<f64>),
    (place, step): (&[f64], &[f64]),
) -> Vec<f64> {
    let changes = step
        .iter()
        .zip(step_before)
        .map(|(now, before)| now - before);
    let [along, size] = step
        .iter()
        .zip(changes.clone())
        .fold([0.0; 2], |[along, size], (step, change)| {
            [along + step * change, size + change * change]
        });
    let part = along / size;
    // steps that do not shrink have no end
    if part.is_nan() || part.abs() >= 1.0 {
        return Vec::new();
    }
    let moved = place.iter().zip(place_before).zip(changes);
    moved
        .map(|((now, before), change)| -part * (now - before + change))
        .collect()
}
