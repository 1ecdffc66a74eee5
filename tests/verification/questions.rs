//! How often a solution asks whether to go on. Who stops it waits for the next question.
//!
//! Work of one kind takes the same part of the whole on any machine, so the longest time without a question is held to a part
//! of the whole time, of problems that take about a second: the work between two questions takes some hundredths of one. Of
//! several runs the best counts, since the machine may pause. Where the stated errors and the averages at the points of
//! profiles were computed without a question, that part was a third and more.

use std::time::{Duration, Instant};

use serde_json::{Value, json};
use solver::error::SolveError;
use solver::observer::Progress;
use solver::problem::Problem;
use solver::solution::Phase;

use crate::support::{problem, watching};

/// A strip with so many contacts in a row on its top.
fn many_contacts(count: usize) -> Value {
    let place = |i: f64| i / count as f64;
    let x: Vec<f64> = (0..=2 * count).map(|i| place(0.5 * i as f64)).collect();
    let parts = (0..count).map(|i| {
        let ends = [place(i as f64) - 1e-9, place(i as f64 + 0.5) + 1e-9];
        (format!("c{i}"), json!({"side": "top", "x": ends}))
    });
    let parts: serde_json::Map<String, Value> = parts.collect();
    let contact = |name: &String| {
        json!({"boundary": name, "obstacle": {"kind": "flat"}, "indentation": 0.01,
            "friction": {"coefficient": 0.3, "nonlocal_radius": place(2.0), "elastic_slip": 1e-4}})
    };
    let contacts: Vec<Value> = parts.keys().map(contact).collect();
    json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grid": {"x": x, "y": [0, 0.3, 0.6, 1]}, "boundaries": parts},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
        "contacts": contacts,
    })
}

/// A contact of so many edges, each average over a quarter of it.
fn wide_averages(edges: usize, accuracy: &str) -> Value {
    // of unequal lengths, so that no table serves
    let x: Vec<f64> = (0..=edges)
        .map(|i| (i as f64 / edges as f64).powf(1.1))
        .collect();
    json!({
        "analysis": {"kind": "axisymmetric"},
        "mesh": {"grid": {"x": x, "y": [-1, -0.5, -0.1, 0]}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}, {"boundary": "left", "ux": 0}],
        "contacts": [{"boundary": "top", "obstacle": {"kind": "parabola", "radius": 4}, "indentation": 0.05,
            "friction": {"coefficient": 0.3, "nonlocal_radius": 0.25, "elastic_slip": 1e-4, "measure": "surface"}}],
        "solver": {"accuracy": accuracy}
    })
}

/// The longest time without a question, as a part of the whole.
fn longest_pause(problem: &Problem) -> f64 {
    let start = Instant::now();
    let (mut last, mut longest) = (start, Duration::ZERO);
    let mut timed = watching(|_| {
        longest = longest.max(last.elapsed());
        last = Instant::now();
        false
    });
    let solution = solver::solve(problem, &mut timed);
    assert!(solution.unwrap().summary.converged);
    longest.max(last.elapsed()).as_secs_f64() / start.elapsed().as_secs_f64()
}

#[test]
fn no_stage_is_long_without_a_question() {
    for (name, value) in [
        ("contacts", many_contacts(180)),
        ("averages", wide_averages(150, "estimate")),
        ("averages on two meshes", wide_averages(90, "verify")),
    ] {
        let problem = problem(&value.to_string());
        let asked = |_| longest_pause(&problem) < 0.1;
        assert!(
            (0..3).any(asked),
            "{name}: a tenth of the time without a question"
        );
    }
}

/// The last state of a stopped solution is reported if that is little work, and given up soon if it is much.
#[test]
fn results_of_a_stopped_solution_are_not_waited_for() {
    for (value, whole) in [
        (many_contacts(3), true),
        (wide_averages(12, "estimate"), true),
        (many_contacts(400), true),
        (wide_averages(120, "estimate"), false),
    ] {
        let problem = problem(&value.to_string());
        let (mut stopped, mut after) = (false, 0);
        let mut recovers = watching(|progress| {
            stopped |= matches!(progress, Some(Progress::Phase(Phase::Recover)));
            after += u32::from(stopped && progress.is_none());
            stopped
        });
        let solution = solver::solve(&problem, &mut recovers);
        assert!(after < 20, "{after} questions after the stop");
        match solution {
            Ok(_) => assert!(whole),
            Err(error) => assert!(error == SolveError::Stopped && !whole, "{error}"),
        }
    }
}
