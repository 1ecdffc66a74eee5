//! docs/verification.md, row 12. Frictionless flat punch b ≤ r ≤ a on a half-space: P/(2E* a δ) by an independent
//! integral-equation code.
//!
//! ```text
//!   axis   b     a
//!   |      +=====+   pushed by δ
//!   +------+-----+-----------------+  graded towards both edges; block of 200 a, clamped below
//! ```

use serde_json::json;

use crate::record::Line;
use crate::support::{graded, problem, solve, union};

const E_STAR: f64 = 1000.0 / 0.91;

/// P/(2E* a δ) for a = 1; b = 0: a full punch.
fn ratio(b: f64, size: f64, edge: f64) -> f64 {
    let growth = 1.3;
    let x = if b > 0.0 {
        let middle = 0.5 * (b + 1.0);
        union(&[
            graded(b, 0.0, edge, growth),
            graded(b, middle, edge, growth),
            graded(1.0, middle, edge, growth),
            graded(1.0, size, edge, growth),
        ])
    } else {
        union(&[
            graded(1.0, 0.0, edge, growth),
            graded(1.0, size, edge, growth),
        ])
    };
    let y: Vec<f64> = graded(0.0, -size, edge, growth).into_iter().rev().collect();
    let delta = 0.1;
    let text = json!({
        "analysis": {"kind": "axisymmetric"},
        "mesh": {"grid": {"x": x, "y": y}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
        "contacts": [{"boundary": "top", "obstacle": {"kind": "flat", "from": b, "to": 1}, "indentation": delta}],
    });
    solve(&problem(&text.to_string())).summary.normal_force / (2.0 * E_STAR * delta)
}

/// 1 % against the half-space. That would not tell b/a = .1 from a full punch. But what a block lacks
/// of the half-space's compliance is the same far away from either punch: δ/P of the two differ as on
/// the half-space. So compared the ratio is held to 5e-5, which the mesh leaves.
#[test]
fn an_annular_punch_bears_a_little_less_than_a_full_one() {
    let (size, edge) = (200.0, 2.5e-4);
    let full = ratio(0.0, size, edge);
    for (b, exact) in [
        (0.1, 0.999864),
        (0.3, 0.996209),
        (0.5, 0.981018),
        (0.7, 0.939503),
    ] {
        let found = ratio(b, size, edge);
        let beside_full = 1.0 / (1.0 / found - 1.0 / full + 1.0);
        let error = |found: f64| (found / exact - 1.0).abs();
        let small = ratio(b, 50.0, edge);
        assert!(
            error(found) < 0.5 * error(small),
            "b/a = {b}: a larger block must be nearer to the half-space"
        );
        for (against, computed, allowed) in [
            ("2E* a δ", found, 0.01),
            ("2E* a δ, less what the block lacks", beside_full, 5e-5),
        ] {
            let what = format!("annular punch, b/a = {b}: P divided by {against}");
            Line {
                row: 12,
                what: &what,
                mesh: "block of 200 a, edges graded to a/4000",
                expected: exact,
                computed,
                allowed,
                order: None,
            }
            .hold();
        }
    }
}
