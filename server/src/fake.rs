//! A problem and a solver for the unit tests of this crate: plausible, quick, and obedient.

use std::ops::ControlFlow;

use solver::{
    error::SolveError,
    mesh::External,
    problem::Problem,
    solution::{
        ContactCount, ContactProfile, ErrorEstimate, Fields, ForcePair, FrictionCount, Iteration,
        NodeState, Observer, Outcome, Phase, Progress, Residuals, Solution, Stage, Summary,
    },
};

use crate::event::TimedIteration;

/// A small problem.
pub(crate) fn problem() -> Problem {
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

/// A small solution.
pub(crate) fn solution() -> Solution {
    Solution {
        summary: Summary {
            outcome: Outcome::Converged,
            converged: true,
            normal_force: 50.0,
            tangential_force: 14.1,
            friction_force: 14.2,
            contacts: Default::default(),
            iterations: 3,
            stage: Stage::Outer,
            contraction: Some(0.1),
            residuals: Residuals::default(),
            energy: -1.5,
            friction_work: 0.1,
            error_estimate: ErrorEstimate::default(),
            increments: 1,
            cut_backs: 0,
            uniqueness: None,
            doubled_increments: None,
            refinements: vec![],
            warnings: vec![],
            dofs: 26,
            contact_dofs: 10,
        },
        history: (1..=3).map(iteration).collect(),
        profiles: [(
            "top".to_string(),
            ContactProfile {
                s: vec![0.0, 1.0],
                x: vec![0.0, 1.0],
                y: vec![0.0, 0.0],
                gap: vec![-0.1, 0.1],
                normal_displacement: vec![-0.1, 0.0],
                tangential_displacement: vec![0.0, 0.01],
                normal_stress: vec![-20.0, 0.0],
                tangential_stress: vec![0.1, 0.0],
                nonlocal_pressure: vec![19.0, 0.0],
                friction_bound: vec![5.7, 0.0],
                friction_ratio: vec![0.02, 1.0],
                state: vec![NodeState::Stick, NodeState::Open],
            },
        )]
        .into(),
        friction_profiles: Default::default(),
        steps: vec![],
        fields: Fields {
            x: vec![0.0, 1.0],
            y: vec![0.0, 0.0],
            ux: vec![0.1, 0.2],
            ..Fields::default()
        },
    }
}

/// Row `k` of a history.
pub(crate) fn iteration(k: u32) -> Iteration {
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
        contraction: (k > 2).then_some(0.1),
        inner: 2,
    }
}

/// The same after `k` half seconds.
pub(crate) fn timed(k: u32) -> TimedIteration {
    TimedIteration {
        row: iteration(k),
        wall_s: 0.5 * f64::from(k),
    }
}

/// Solves anything at once, as [`solution`].
pub(crate) fn solve(
    _: &Problem,
    _: Option<External>,
    observe: &mut Observer<'_>,
) -> Result<Solution, SolveError> {
    let mut solution = solution();
    for phase in [Phase::Mesh, Phase::Factor, Phase::Iterate] {
        if observe(Progress::Phase(phase)).is_break() {
            return Err(SolveError::Stopped);
        }
    }
    for row in &solution.history {
        if observe(Progress::Iteration(row)).is_break() {
            solution.summary.outcome = Outcome::Canceled;
            solution.summary.converged = false;
            return Ok(solution);
        }
    }
    Ok(solution)
}

/// Iterates until it is stopped.
pub(crate) fn solve_until_stopped(
    _: &Problem,
    _: Option<External>,
    observe: &mut Observer<'_>,
) -> Result<Solution, SolveError> {
    let mut solution = solution();
    for k in 1.. {
        if observe(Progress::Iteration(&iteration(k))) == ControlFlow::Break(()) {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    solution.summary.outcome = Outcome::Canceled;
    solution.summary.converged = false;
    Ok(solution)
}

/// Panics, as no solver should.
pub(crate) fn solve_with_a_panic(
    _: &Problem,
    _: Option<External>,
    _: &mut Observer<'_>,
) -> Result<Solution, SolveError> {
    unreachable!("the fake solver panics on purpose")
}
