//! A problem and solvers for the unit tests of the service: plausible and quick; the solvers stop when asked.

use std::sync::LazyLock;

use base::event::TimedIteration;
use solver::{
    error::SolveError,
    mesh::External,
    observer::{Observer, Progress},
    problem::Problem,
    solution::{
        ContactCount, ForcePair, FrictionCount, Iteration, Outcome, Phase, Solution, Stage,
    },
};

/// A small problem.
pub fn problem() -> Problem {
    serde_json::from_value(serde_json::json!({
        "title": "fake",
        "analysis": { "kind": "plane_strain" },
        "mesh": { "grid": { "x": [0, 1, 2], "y": [-1, 0] } },
        "materials": [{ "youngs_modulus": 1000, "poissons_ratio": 0.3 }],
        "supports": [{ "boundary": "bottom", "ux": 0, "uy": 0 }],
        "contacts": [{
            "boundary": "top",
            "obstacle": { "kind": "circle", "radius": 8 },
            "indentation": 0.1,
            "friction": { "coefficient": 0.3, "nonlocal_radius": 0.01, "elastic_slip": 1e-4 }
        }]
    }))
    .unwrap_or_else(|error| unreachable!("the fake problem is well formed: {error}"))
}

/// The solution of [`problem`], with a history of three rows.
pub fn solution() -> Solution {
    static SOLVED: LazyLock<Solution> = LazyLock::new(|| {
        solver::solve(&problem(), &mut ())
            .unwrap_or_else(|error| unreachable!("the fake problem is solved: {error}"))
    });
    let mut solution = SOLVED.clone();
    solution.history = (1..=3).map(iteration).collect();
    solution.summary.iterations = 3;
    solution
}

/// The row `k` of a history.
pub fn iteration(k: u32) -> Iteration {
    Iteration {
        k,
        stage: if k == 1 {
            Stage::Frictionless
        } else {
            Stage::Outer
        },
        step: 0,
        increment: 0,
        residual: 10f64.powi(-4 * k as i32),
        friction_residual: 10f64.powi(-3 * k as i32),
        r_f: (k > 1).then_some(1e-3),
        tolerance: 1e-10,
        contact: ContactCount {
            active: 5,
            entered: 1,
            left: 0,
        },
        friction: FrictionCount { slip: 2, stick: 3 },
        force: ForcePair {
            normal: 50.0,
            tangential: 14.0,
        },
        motion: None,
        contraction: (k > 2).then_some(0.1),
        inner: 2,
    }
}

/// The row `k` of a history, computed after `k` half seconds.
pub fn timed(k: u32) -> TimedIteration {
    TimedIteration {
        row: iteration(k),
        wall_s: 0.5 * f64::from(k),
    }
}

/// Solves any problem at once, with the result [`solution`].
pub fn solve(
    _: &Problem,
    _: Option<External>,
    observer: &mut dyn Observer,
) -> Result<Solution, SolveError> {
    iterate(observer)
}

/// Reports the iterations and returns the solution, for any problem.
pub fn iterate(observer: &mut dyn Observer) -> Result<Solution, SolveError> {
    let mut solution = solution();
    for phase in [Phase::Mesh, Phase::Factor, Phase::Iterate] {
        observer.event(Progress::Phase(phase));
        if observer.stop() {
            return Err(SolveError::Stopped);
        }
    }
    for row in &solution.history {
        observer.event(Progress::Iteration(row));
        if observer.stop() {
            solution.summary.outcome = Outcome::Canceled;
            solution.summary.converged = false;
            return Ok(solution);
        }
    }
    Ok(solution)
}

/// Iterates until it is stopped.
pub fn solve_until_stopped(
    _: &Problem,
    _: Option<External>,
    observer: &mut dyn Observer,
) -> Result<Solution, SolveError> {
    let mut solution = solution();
    for k in 1.. {
        observer.event(Progress::Iteration(&iteration(k)));
        if observer.stop() {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    solution.summary.outcome = Outcome::Canceled;
    solution.summary.converged = false;
    Ok(solution)
}

/// Panics, which the real solver never does on purpose.
pub fn solve_with_a_panic(
    _: &Problem,
    _: Option<External>,
    _: &mut dyn Observer,
) -> Result<Solution, SolveError> {
    unreachable!("the fake solver panics on purpose")
}
