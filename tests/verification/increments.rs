//! What too few increments of the incremental law leave open is a part of the stated errors.

use serde_json::{Value, json};
use solver::problem::{AccuracyMode, AdaptiveRefine, Problem, Refine};
use solver::solution::{Accuracy, QuantityName, Solution, Summary, Verdict, WarningCode};

use crate::pairs::{distance, pairs};
use crate::support::{example, problem, solve};

/// An obstacle on half a block, in these steps.
fn pressed(obstacle: Value, steps: Value) -> Problem {
    let fine: Vec<f64> = (0..=22).map(|k| 0.05 * f64::from(k)).collect();
    let x = [&fine[..], &[1.3, 1.8, 3.0, 5.0, 8.0]].concat();
    let whole = json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grid": {"x": x, "y": [-8, -4.5, -2.5, -1.4, -0.8, -0.5, -0.3, -0.2, -0.1, -0.05, 0]}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "left", "ux": 0}, {"boundary": "bottom", "ux": 0, "uy": 0}],
        "contacts": [{"boundary": "top", "obstacle": obstacle, "indentation": 0.2, "friction":
            {"coefficient": 0.3, "nonlocal_radius": 0.1, "elastic_slip": 1e-4, "history": "incremental"}}],
        "steps": steps,
    });
    problem(&whole.to_string())
}

fn parabola() -> Value {
    json!({"kind": "parabola", "radius": 8})
}

fn accuracy(solution: &Solution) -> &Accuracy {
    solution.summary.accuracy.as_ref().unwrap()
}

/// The end in many increments, on the same mesh: every quantity is within what is stated for the increments alone, but for a
/// thousandth.
fn holds(few: &Summary, many: &Summary, what: &str) {
    let mut compared = 0;
    for (a, b) in pairs(few, many) {
        let (Some(error), Some(open)) = (a.error, a.increments) else {
            continue;
        };
        compared += 1;
        let off = distance(a, b);
        assert!(
            error >= open && off <= open + 1e-3 * a.value.abs(),
            "{what}: {off:.2e} for {a:?}"
        );
    }
    assert!(compared >= 5, "{what}: {compared}");
}

/// Cylinders and wedges, pressed, dragged, and let go in part: in one increment of each step, in two and in four, of either
/// spacing.
#[test]
fn errors_of_too_few_increments_are_stated() {
    let wedge = json!({"kind": "wedge", "angle": 5});
    type Path<'a> = (&'a str, Value, &'a dyn Fn(u32, &str) -> Value);
    let paths: [Path<'_>; 4] = [
        (
            "a cylinder",
            parabola(),
            &|n, spacing| json!([{"increments": n, "spacing": spacing}]),
        ),
        (
            "a wedge",
            wedge,
            &|n, spacing| json!([{"increments": n, "spacing": spacing}]),
        ),
        (
            "a cylinder let go in part",
            parabola(),
            &|n, spacing| json!([{"increments": n, "spacing": spacing}, {"indentation": 0.7, "increments": n}]),
        ),
        (
            "a cylinder pressed in two steps",
            parabola(),
            &|n, spacing| json!([{"indentation": 0.5, "increments": n, "spacing": spacing}, {"increments": n}]),
        ),
    ];
    for (what, obstacle, steps) in paths {
        for spacing in ["uniform", "contact_width"] {
            let many = solve(&pressed(obstacle.clone(), steps(80, spacing))).summary;
            for n in [1, 2, 4] {
                let few = solve(&pressed(obstacle.clone(), steps(n, spacing)));
                holds(
                    &few.summary,
                    &many,
                    &format!("{what}, {n} increments, {spacing}"),
                );
            }
        }
    }
}

/// One increment is the total law: 10 % off, and no longer `good`, with what to do; nor where it is verified, or on
/// a mesh that is refined to a tolerance. Many increments are good.
#[test]
fn too_few_increments_are_not_good_and_the_reason_says_what_to_do() {
    let one = pressed(parabola(), json!([]));
    let mut verified = one.clone();
    verified.solver.accuracy = Some(AccuracyMode::Verify);
    let mut refined = one.clone();
    refined.mesh.refine = Refine::Adaptive(AdaptiveRefine { tolerance: 0.05 });
    for problem in [&one, &verified, &refined] {
        let solution = solve(problem);
        let accuracy = accuracy(&solution);
        assert_eq!(accuracy.verdict, Verdict::Poor);
        let told = |reason: &String| reason.contains("give `steps` more `increments`");
        assert!(accuracy.reasons.iter().any(told), "{:#?}", accuracy.reasons);
        // what the increments leave open does not keep the mesh from being fine enough
        let unfinished =
            |w: &&solver::solution::Warning| w.code == WarningCode::RefinementUnfinished;
        assert_eq!(
            solution.summary.warnings.iter().filter(unfinished).count(),
            0
        );
    }
    let many = solve(&pressed(parabola(), json!([{"increments": 160}])));
    let told = |reason: &String| reason.contains("increments");
    assert!(
        !accuracy(&many).reasons.iter().any(told),
        "{:#?}",
        accuracy(&many).reasons
    );
}

/// Forces and peaks under a flat punch do not depend on the increments, and nothing is added. (The ends of stick, where the
/// slip of the last increment is ε, do by a hundredth of the contact.)
#[test]
fn under_a_flat_punch_nothing_is_left_open() {
    for increments in [1, 4] {
        let mut problem = example("rectangular_punch");
        problem.mesh.refine = Refine::Times(1);
        let total = solve(&problem);
        problem.contacts[0].friction.as_mut().unwrap().history =
            solver::problem::History::Incremental;
        let steps = json!([{"increments": increments}]);
        problem.steps = serde_json::from_value(steps).unwrap();
        let solution = solve(&problem);
        let known = |q: &&solver::solution::EstimatedQuantity| {
            q.error.is_some() && q.quantity != QuantityName::StickEnd
        };
        for q in accuracy(&solution).quantities.iter().filter(known) {
            assert!(
                q.increments.unwrap() <= 1e-8 * q.value.abs().max(1.0),
                "{q:?}"
            );
        }
        assert_eq!(accuracy(&solution).verdict, accuracy(&total).verdict);
    }
}

/// What an earlier step ends with is told beside it, and at the end.
#[test]
fn too_few_increments_of_earlier_steps_are_reported() {
    let solution = solve(&pressed(
        parabola(),
        json!([{"name": "press", "increments": 1}, {"name": "let go", "indentation": 0, "increments": 4}]),
    ));
    assert_eq!(solution.summary.normal_force, 0.0);
    let matter = |w: &solver::solution::Warning| w.code == WarningCode::IncrementsMatter;
    assert!(solution.steps[0].summary.warnings.iter().any(matter));
    let told = solution
        .summary
        .warnings
        .iter()
        .find(|w| matter(w))
        .unwrap();
    assert!(told.message.contains("\"press\""), "{}", told.message);
    let enough = solve(&pressed(
        parabola(),
        json!([{"increments": 40}, {"indentation": 0, "increments": 4}]),
    ));
    assert!(!enough.summary.warnings.iter().any(matter));
}
