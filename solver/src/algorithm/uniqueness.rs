//! A test of uniqueness: the solution is computed once more, from the bonded state.

use crate::algorithm::rounding::Rounding;
use crate::algorithm::system::System;
use crate::algorithm::track::{Measured, Track};
use crate::algorithm::{End, Finished, Place, bonded_state, both, fixed_point, quiet};
use crate::problem::SolverControls;
use crate::solution::{Comparison, Observer, Outcome, Summary, Warning, WarningCode};

/// Adds a comparison with a second solution to the summary, and a warning if the two differ.
pub fn note_uniqueness(summary: &mut Summary, second: Comparison) {
    let warning = if !second.converged {
        Some((
            WarningCode::UniquenessUnknown,
            "Started from the bonded state the method does not converge: whether there is a second solution is unknown.".to_owned(),
        ))
    } else if !second.agrees {
        Some((
            WarningCode::NotUnique,
            format!(
                "There is a second solution: started from the bonded state (u_t = d) the forces are Y = {:.6}, T = {:.6} instead of Y = {:.6}, T = {:.6}. Which one occurs depends on the history of loading, which the incremental law with load steps can follow.",
                second.normal_force,
                second.tangential_force,
                summary.normal_force,
                summary.tangential_force
            ),
        ))
    } else {
        None
    };
    if let Some((code, message)) = warning {
        summary.warnings.push(Warning {
            code,
            pointer: "/solver/check_uniqueness".to_owned(),
            message,
        });
    }
    summary.uniqueness = Some(second);
}

/// Adds a comparison with a solution in twice the increments to the summary, and a warning if it differs.
pub fn note_doubled_increments(summary: &mut Summary, second: Comparison) {
    if !second.agrees {
        summary.warnings.push(Warning {
            code: WarningCode::IncrementsMatter,
            pointer: "/steps".to_owned(),
            message: format!(
                "Twice the increments change the forces by {:.2e}{}.",
                second.change,
                if second.converged {
                    ""
                } else {
                    " (and do not converge)"
                }
            ),
        });
    }
    summary.doubled_increments = Some(second);
}

/// Compares the forces of a second state with those of a solution, which are to agree to `tolerance`.
pub fn compared(
    system: &System<'_>,
    solution: &Summary,
    second: Option<&Finished>,
    tolerance: f64,
) -> Comparison {
    let converged = second.is_some_and(|second| second.outcome == Outcome::Converged);
    let first = [
        solution.normal_force,
        solution.tangential_force,
        solution.friction_force,
    ];
    let second = second.map_or([0.0; 3], |second| {
        let (state, bound) = (second.state.clone(), second.bound.clone());
        forces(system, &Measured::new(system, state, bound))
    });
    let change = force_change(first, second);
    Comparison {
        agrees: converged && change <= tolerance,
        converged,
        normal_force: second[0],
        tangential_force: second[1],
        friction_force: second[2],
        change,
    }
}

/// A sum of forces may be off by this many times the largest residual, which is that of one node.
const NODES: f64 = 10.0;

/// What rounding leaves unknown of the forces of two solutions.
pub fn rounding_of_forces(solutions: [Option<Rounding>; 2]) -> f64 {
    let residuals = solutions.iter().flatten().map(|rounding| rounding.residual);
    NODES * residuals.fold(0.0, f64::max)
}

/// Largest difference of forces, relative to the largest force.
fn force_change(a: [f64; 3], b: [f64; 3]) -> f64 {
    let scale = a.iter().chain(&b).fold(0.0f64, |m, f| m.max(f.abs()));
    (0..3)
        .map(|k| relative(a[k], b[k], scale))
        .fold(0.0, f64::max)
}

fn relative(a: f64, b: f64, scale: f64) -> f64 {
    if a == b { 0.0 } else { (a - b).abs() / scale }
}

/// Solutions agree if their forces and friction bounds do so to this part: far above the error that the tolerance
/// leaves, far below the difference of two states.
const AGREES: f64 = 1e-6;

/// Solves a system from the bonded state (u_t = d everywhere) and compares with `first`.
pub fn other_solution(
    system: &System<'_>,
    controls: &SolverControls,
    first: &Finished,
    observe: &mut Observer<'_>,
) -> Comparison {
    let quiet: &mut Observer<'_> = &mut quiet(observe);
    let (start, _) = bonded_state(system, controls, quiet);
    let mut track = Track::new(system, controls, Place::default());
    let mut end = both(&mut track, start, quiet);
    if !end.ended() {
        // no solution is near the bonded state: sweeps may move further away from it
        track.forget();
        end = fixed_point::run(&mut track, end.measured, false, quiet);
    }
    let end = end.settled(system, controls.tolerance, &track.history);
    let End {
        measured: second,
        outcome,
        rounding,
        ..
    } = end;
    let converged = outcome == Outcome::Converged;
    let allowed = AGREES.max(rounding_of_forces([first.rounding, rounding]));
    let first = Measured::new(system, first.state.clone(), first.bound.clone());
    let (a, b) = (forces(system, &first), forces(system, &second));
    let change = force_change(a, b);
    let most = first
        .bound
        .iter()
        .chain(&second.bound)
        .fold(0.0f64, |m, tau| m.max(*tau));
    let bounds = first.bound.iter().zip(&second.bound);
    let bound_change = bounds
        .map(|(a, b)| relative(*a, *b, most))
        .fold(0.0, f64::max);
    Comparison {
        agrees: change <= allowed && bound_change <= allowed,
        converged,
        normal_force: b[0],
        tangential_force: b[1],
        friction_force: b[2],
        change,
    }
}

/// ∫p, ∫σ_t and ∫|σ_t| over all contacts.
fn forces(system: &System<'_>, measured: &Measured) -> [f64; 3] {
    let tractions = system.tractions(&measured.state.v, &measured.bound);
    let held = system.tangential_reactions(&measured.elastic_force);
    let points = system.points.iter().zip(&tractions);
    let [tangential, friction] = system.tangential_forces(points, &held);
    let normal = system.normal_force(0..system.nodes.len(), &measured.reactions);
    [normal, tangential, friction].map(|f| system.circumference * f)
}
