//! Contact and friction on the condensed system, docs/formulation.md section 4.
//!
//! Algorithms are functions from a [`System`] to its final state, and show each iteration to the observer. [`run`]
//! chooses among them.
//!
//! # Where to look
//!
//! | subject | where |
//! |---|---|
//! | the condensed system at one load level, and a state of it | `system` |
//! | methods: the thesis's own | `thesis` |
//! | methods: sweeps over the friction bound | `fixed_point` |
//! | methods: Newton's | `newton` |
//! | methods: the convex problem for a given bound | `convex` |
//! | the nodes that may touch | `may_touch` |
//! | factors that are used again | `factors` |
//! | a start from a neighbour's solution | `neighbour` |
//! | what every method records and returns | `recorder`, `finished` |
//! | what rounding leaves of residuals | `rounding` |
//! | a second solution: uniqueness, twice the increments | `uniqueness` |
//! | from the final state to the result | `report` |
//! | forces, extents, peaks and warnings of one contact | `profile` |
//! | what a small force would change in a quantity: the adjoint, for stated errors | `adjoint` |
//! | common ends of contacts | `corners` |
//! | obstacles whose motion is unknown, and that nothing holds | `opposite`, `unheld` |
//! | bodies that slide away, slide far, or strain much | `slides`, `large_slip`, `small_strain` |

mod adjoint;
mod convex;
mod corners;
mod factors;
mod finished;
mod fixed_point;
mod large_slip;
mod may_touch;
mod neighbour;
mod newton;
mod opposite;
mod profile;
mod recorder;
mod report;
mod rounding;
mod slides;
mod small_strain;
mod system;
mod thesis;
mod unheld;
mod uniqueness;

pub use adjoint::{Gradient, influences};
pub use convex::{Minimum, minimise};
pub use corners::{better, closed_on_axis, open_on_axis, touched_by_both};
pub use finished::Finished;
pub use may_touch::{Extent, Region, follow_neighbour, run_reduced};
pub use opposite::{FreeMotion, Opposite, free_motions};
pub use profile::{DisplacedNode, Estimable, Missed, Quantity};
pub use recorder::{Cycle, Place};
pub use report::{AlongContacts, Reported, numbers, quantities, report};
pub use rounding::Rounding;
pub use slides::Slide;
pub use system::{Averages, ContactNode, Patch, Path, Point, State, System};
pub use uniqueness::{
    EndForces, note_doubled_increments, note_uniqueness, other_solution, rounding_of_forces,
    warn_of_increments,
};

use crate::observer::{Filtered, Observer, Progress};
use crate::problem::{Algorithm, SolverControls};
use crate::solution::{Outcome, Stage};
use finished::{End, finish};
use fixed_point::{all_sticking, sweep};
use recorder::{Measured, Recorder, Row};

/// The largest number of Newton steps after the sweeps.
const NEWTON_STEPS: u32 = 60;

/// Solves a system at its load level with the chosen algorithm, from the result of the previous increment if there is
/// one. If the loads push the body away, the result has a `slide`.
pub fn run(
    system: &System<'_>,
    controls: &SolverControls,
    place: Place,
    before: Option<&Finished>,
    observer: &mut dyn Observer,
) -> Finished {
    if system.semidefinite
        && let Some(slide) = slides::certain(system)
    {
        return away(Recorder::new(system, controls, place), slide, observer);
    }
    let finished = iterate(system, controls, place, before, observer);
    let slide = match finished.outcome {
        Outcome::Converged | Outcome::Canceled => None,
        _ if system.semidefinite => slides::found(system, &finished.state),
        _ => None,
    };
    Finished { slide, ..finished }
}

/// The result for a body that slides away: the bonded state with all the friction that its pressure permits.
fn away(mut recorder: Recorder<'_, '_>, slide: Slide, observer: &mut dyn Observer) -> Finished {
    let (bonded, stopped) = bonded_state(recorder.system, recorder.controls, observer);
    let measured = slides::slid(recorder.system, bonded, &slide);
    let row = Row {
        stage: Stage::Bonded,
        residual: measured.residuals.kkt,
        contraction: None,
        inner: 0,
        tractions: recorder
            .system
            .tractions(&measured.state.v, &measured.bound),
        own_r_f: None,
    };
    let stopped = recorder.record(&measured, row, observer) || stopped;
    let outcome = if stopped {
        Outcome::Canceled
    } else {
        Outcome::NotConverged
    };
    Finished {
        slide: Some(slide),
        ..finish(recorder, End::new(measured, Stage::Bonded, outcome))
    }
}

fn iterate(
    system: &System<'_>,
    controls: &SolverControls,
    place: Place,
    before: Option<&Finished>,
    observer: &mut dyn Observer,
) -> Finished {
    let mut recorder = Recorder::new(system, controls, place);
    if controls.algorithm == Algorithm::Thesis {
        let (end, tractions) = thesis::run(&mut recorder, observer);
        return Finished {
            tractions,
            own_tractions: true,
            ..finish(recorder, end)
        };
    }
    let (start, stopped) = start(&mut recorder, before, observer);
    // without friction, or if friction never acts, the first solution is final
    let solved = start.within(controls.tolerance) && before.is_none();
    if system.points.is_empty() || solved || stopped {
        let outcome = match stopped {
            _ if start.within(controls.tolerance) => Outcome::Converged,
            true => Outcome::Canceled,
            false => Outcome::NotConverged,
        };
        return finish(recorder, End::new(start, Stage::Frictionless, outcome));
    }
    let end = match controls.algorithm {
        Algorithm::FixedPoint => fixed_point::run(&mut recorder, start, false, observer),
        Algorithm::Newton => newton::run(&mut recorder, &start, controls.max_iterations, observer),
        Algorithm::Auto | Algorithm::Thesis => return auto(recorder, start, observer),
    };
    finish(recorder, end)
}

/// The state from which iterations with friction start, and whether to stop: the state of the previous increment, or
/// without one the frictionless solution with u_t = d, from which friction at first pulls with full stiffness.
fn start(
    recorder: &mut Recorder<'_, '_>,
    before: Option<&Finished>,
    observer: &mut dyn Observer,
) -> (Measured, bool) {
    let system = recorder.system;
    if let (Some(before), false) = (before, system.points.is_empty()) {
        let (state, bound) = (before.state.clone(), before.bound.clone());
        // its reactions are not valid at the new level; its friction bound is a good guess
        let measured = Measured {
            implied_bound: bound.clone(),
            ..Measured::new(system, state, bound)
        };
        return (measured, false);
    }
    let none = vec![0.0; system.points.len()];
    let rest = before.map_or_else(|| system.rest(), |before| before.state.clone());
    let stage = Stage::Frictionless;
    let (mut measured, stopped) = sweep(recorder, stage, none, &rest, observer, |_| None);
    let solved = measured.within(recorder.controls.tolerance);
    if system.points.is_empty() || solved || stopped {
        return (measured, stopped);
    }
    let tolerance = recorder.controls.tolerance;
    let rounded = || rounding::limit(system, &measured, tolerance).is_some();
    if system.semidefinite && measured.residuals.kkt > tolerance && !rounded() {
        // only friction holds this body: without it, it slides away
        let (bonded, stopped) = bonded_state(system, recorder.controls, observer);
        return (bonded, stopped);
    }
    measured.state = all_sticking(system, &measured.state);
    measured.elastic_force = system.elastic_force(&measured.state.v);
    (measured, stopped)
}

/// The bonded state, u_t = d throughout, measured with the friction bound that it implies, and whether to stop.
fn bonded_state(
    system: &System<'_>,
    controls: &SolverControls,
    observer: &mut dyn Observer,
) -> (Measured, bool) {
    let bonded = system.bonded();
    let mut recorder = Recorder::new(&bonded, controls, Place::default());
    let (found, stopped) = sweep(
        &mut recorder,
        Stage::Bonded,
        Vec::new(),
        &bonded.rest(),
        &mut quiet(observer),
        |_| None,
    );
    let none = vec![0.0; system.points.len()];
    (Measured::new(system, found.state, none), stopped)
}

/// An observer for iterations that are not shown to `observer`, which may still stop them.
pub(crate) fn quiet(observer: &mut dyn Observer) -> Filtered<'_> {
    Filtered {
        observer,
        seen: |progress| matches!(progress, Progress::OutOfMemory { .. }).then_some(progress),
    }
}

/// Sweeps; if they do not converge, Newton's method from the best sweep; if that fails too, both again from the bonded
/// state: beyond a fold the free branch of solutions ends, and only a jammed state exists.
fn auto(mut recorder: Recorder<'_, '_>, start: Measured, observer: &mut dyn Observer) -> Finished {
    let first = both(&mut recorder, start, observer);
    if first.ended() {
        return finish(recorder, first);
    }
    let (bonded, stopped) = bonded_state(recorder.system, recorder.controls, observer);
    if stopped {
        let outcome = Outcome::Canceled;
        return finish(recorder, End { outcome, ..first });
    }
    recorder.forget();
    let second = both(&mut recorder, bonded, observer);
    let nearer = second.outcome == Outcome::Converged
        || second.rounding.is_some()
        || second.outcome == Outcome::Canceled
        || second.measured.residuals.monolithic < first.measured.residuals.monolithic;
    let (nearest, other) = if nearer {
        (second, first)
    } else {
        (first, second)
    };
    finish(recorder, nearest.with_cycle_of(&other))
}

/// Sweeps, then Newton's method from the best sweep; returns the better result of both.
fn both(recorder: &mut Recorder<'_, '_>, start: Measured, observer: &mut dyn Observer) -> End {
    let (system, tolerance) = (recorder.system, recorder.controls.tolerance);
    let swept = fixed_point::run(recorder, start, true, observer);
    let swept = swept.settled(system, tolerance, &recorder.history);
    if swept.ended() {
        return swept;
    }
    recorder.forget();
    let newton = newton::run(recorder, &swept.measured, NEWTON_STEPS, observer);
    let newton = newton.settled(system, tolerance, &recorder.history);
    let nearer = newton.outcome == Outcome::Converged
        || newton.rounding.is_some()
        || newton.outcome == Outcome::Canceled
        || newton.measured.residuals.monolithic < swept.measured.residuals.monolithic;
    let contraction = swept.contraction;
    let (nearest, other) = if nearer {
        (newton, swept)
    } else {
        (swept, newton)
    };
    End {
        contraction,
        ..nearest.with_cycle_of(&other)
    }
}
