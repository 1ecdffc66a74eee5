//! Linear elasticity is left where strains are large, whatever the size of the body.

use serde_json::json;
use solver::problem::Refine;
use solver::solution::{Solution, WarningCode};

use crate::support::{example, graded, problem, solve, union};

/// A flat punch of half-width .5 on half of a block of this size.
fn punch(size: f64, indentation: f64) -> Solution {
    let fine: Vec<f64> = (0..=10).map(|k| 0.1 * f64::from(k)).collect();
    let x = union(&[fine, graded(1.0, size, 0.1, 1.5)]);
    let y: Vec<f64> = graded(0.0, -size, 0.1, 1.5).into_iter().rev().collect();
    solve(&problem(
        &json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"grid": {"x": x, "y": y}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "left", "ux": 0}, {"boundary": "bottom", "ux": 0, "uy": 0}],
            "contacts": [{"boundary": "top", "obstacle": {"kind": "flat", "to": 0.5}, "indentation": indentation}],
        })
        .to_string(),
    ))
}

fn warned(solution: &Solution) -> bool {
    let warnings = &solution.summary.warnings;
    warnings.iter().any(|w| w.code == WarningCode::LargeStrain)
}

/// A punch pressed in by four of its half-widths is beyond linear elasticity in a small block and in one a hundred times as
/// large, where nothing is large beside the body; by less than one it is not. Nor are the examples, whose largest mean
/// strain is .22 (the cylinder on its end, refined twice).
#[test]
fn strains_are_judged_where_the_load_acts() {
    for size in [4.0, 40.0, 400.0] {
        assert!(warned(&punch(size, 2.0)), "size {size}");
        assert!(!warned(&punch(size, 0.2)), "size {size}");
    }
    for name in suite::EXAMPLES {
        let mut problem = example(name);
        problem.mesh.refine = Refine::Times(2);
        assert!(!warned(&solve(&problem)), "{name}");
    }
}

/// It is said once.
#[test]
fn large_strain_and_large_displacement_are_one_warning() {
    let solution = punch(4.0, 2.0);
    let codes: Vec<WarningCode> = solution.summary.warnings.iter().map(|w| w.code).collect();
    assert!(
        !codes.contains(&WarningCode::LargeDisplacement),
        "{codes:?}"
    );
    let message = solution
        .summary
        .warnings
        .iter()
        .find(|w| w.code == WarningCode::LargeStrain);
    assert!(
        message
            .unwrap()
            .message
            .contains("linear elasticity is valid up to")
    );
}
