//! Comparisons with a second solution: with one from the bonded state, as a test of uniqueness, and with one in twice
//! the increments.

use crate::algorithm::recorder::{Measured, Recorder};
use crate::algorithm::rounding::Rounding;
use crate::algorithm::system::System;
use crate::algorithm::{End, Finished, Place, bonded_state, both, fixed_point, quiet};
use crate::observer::Observer;
use crate::problem::SolverControls;
use crate::solution::{Comparison, Outcome, StepSolution, Summary, Warning, WarningCode};

/// Adds a comparison with a second solution to the summary, and a warning if the two differ.
pub fn note_uniqueness(summary: &mut Summary, second: Comparison) {
    let warning = if !second.converged {
        Some((
            WarningCode::UniquenessUnknown,
            "From the bonded state the method does not converge, so it is unknown whether there is a second solution.".to_owned(),
        ))
    } else if !second.agrees {
        Some((
            WarningCode::NotUnique,
            format!(
                "There is a second solution: from the bonded state (u_t = d) the solver finds a normal force of {:.6} and a tangential force of {:.6} instead of {:.6} and {:.6}. Which one occurs depends on the history of loading, which the incremental law with load steps can follow.",
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

/// Adds a comparison with a solution in twice the increments to the summary, and a warning if that solution differs.
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
                    " (and the iterations do not converge)"
                }
            ),
        });
    }
    summary.doubled_increments = Some(second);
}

/// The forces ∫p, ∫σ_t and ∫|σ_t| at the end of a step.
pub struct EndForces {
    forces: [f64; 3],
    converged: bool,
}

impl EndForces {
    /// The forces in a final state, with the anchors from which its slip was measured.
    pub fn new(system: &System<'_>, finished: &Finished) -> Self {
        let (state, bound) = (finished.state.clone(), finished.bound.clone());
        EndForces {
            forces: forces(system, &Measured::new(system, state, bound)),
            converged: finished.outcome == Outcome::Converged,
        }
    }

    /// Compares these forces with the forces of a solution, which should agree to `tolerance`.
    pub fn compared(&self, solution: &Summary, tolerance: f64) -> Comparison {
        let first = [
            solution.normal_force,
            solution.tangential_force,
            solution.friction_force,
        ];
        let change = force_change(first, self.forces);
        let [normal_force, tangential_force, friction_force] = self.forces;
        Comparison {
            agrees: self.converged && change <= tolerance,
            converged: self.converged,
            normal_force,
            tangential_force,
            friction_force,
            change,
        }
    }
}

/// The largest relative change of the forces at the end of a step, by more increments, with which they count as
/// accurate: their error is then less than twice that, and `good` promises 1 %.
const KNOWN: f64 = 0.004;

/// The same for the tangential force and the friction force, as parts of the friction force, as in verdicts: the error is of the
/// first order of the increments, and about as large as the change.
const FRICTION_KNOWN: f64 = 0.01;

/// The friction force below which changes are compared with this part of the normal force instead.
const LEAST_FRICTION: f64 = 1e-3;

/// Adds a warning to a step before the last whose forces depend on the number of increments; for the last step errors
/// are stated instead. `more`: the forces at the end of the step in at least twice as many increments.
pub fn warn_of_increments(step: &mut StepSolution, more: &EndForces) {
    let compared = more.compared(&step.summary, KNOWN);
    let own = &step.summary;
    // friction that is next to nothing may change by any part of itself
    let friction = own.friction_force.max(LEAST_FRICTION * own.normal_force);
    let of_friction = relative(own.friction_force, compared.friction_force, friction).max(
        relative(own.tangential_force, compared.tangential_force, friction),
    );
    if compared.agrees && of_friction <= FRICTION_KNOWN {
        return;
    }
    let found = if compared.agrees {
        format!(
            "more increments change friction by {:.1} % of the friction force",
            100.0 * of_friction
        )
    } else if compared.converged {
        format!(
            "more increments change the forces by {:.1} %",
            100.0 * compared.change
        )
    } else {
        "with more increments the iterations do not converge".to_owned()
    };
    step.summary.warnings.push(Warning {
        code: WarningCode::IncrementsMatter,
        pointer: "/steps".to_owned(),
        message: format!(
            "This step has too few increments for the incremental law: at its end {found}. Give this step and the steps before it more `increments`."
        ),
    });
}

/// The error of a sum of forces, as a multiple of the largest residual, which is the residual of one node.
const NODES: f64 = 10.0;

/// The error, due to rounding, of the forces of two solutions.
pub fn rounding_of_forces(solutions: [Option<Rounding>; 2]) -> f64 {
    let residuals = solutions.iter().flatten().map(|rounding| rounding.residual);
    NODES * residuals.fold(0.0, f64::max)
}

/// The largest difference of the forces a and b, relative to the largest force.
fn force_change(a: [f64; 3], b: [f64; 3]) -> f64 {
    let scale = a.iter().chain(&b).fold(0.0f64, |m, f| m.max(f.abs()));
    (0..3)
        .map(|k| relative(a[k], b[k], scale))
        .fold(0.0, f64::max)
}

fn relative(a: f64, b: f64, scale: f64) -> f64 {
    if a == b { 0.0 } else { (a - b).abs() / scale }
}

/// The largest relative difference of forces and friction bounds with which two solutions are equal: far above the
/// error that the tolerance leaves, far below the difference of two states.
const AGREES: f64 = 1e-6;

/// Solves a system from the bonded state (u_t = d everywhere) and compares the solution with `first`.
pub fn other_solution(
    system: &System<'_>,
    controls: &SolverControls,
    first: &Finished,
    observer: &mut dyn Observer,
) -> Comparison {
    let quiet = &mut quiet(observer);
    let (start, _) = bonded_state(system, controls, quiet);
    let mut recorder = Recorder::new(system, controls, Place::default());
    let mut end = both(&mut recorder, start, quiet);
    if !end.ended() {
        // no solution is near the bonded state: sweeps may move further away from it
        recorder.forget();
        end = fixed_point::run(&mut recorder, end.measured, false, quiet);
    }
    let end = end.settled(system, controls.tolerance, &recorder.history);
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

/// The forces ∫p, ∫σ_t and ∫|σ_t| over all contacts.
fn forces(system: &System<'_>, measured: &Measured) -> [f64; 3] {
    let tractions = system.tractions(&measured.state.v, &measured.bound);
    let held = system.tangential_reactions(&measured.elastic_force);
    let points = system.points.iter().zip(&tractions);
    let [tangential, friction] = system.tangential_forces(points, &held);
    let normal = system.normal_force(0..system.nodes.len(), &measured.reactions);
    [normal, tangential, friction].map(|f| system.circumference * f)
}
