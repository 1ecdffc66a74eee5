//! docs/verification.md, rows 8 and 11: frictionless flat punches on a half-space, a = .5, E = 1000, ν = .3.
//!
//! ```text
//!      |<- a ->|  punch, pushed by δ
//!   ---+=======+-----------------------+
//!   x=0|                               |  the half-space is a block of half-width and depth
//!      |   symmetry                    |  `size`, graded towards the punch's edge
//!      +-------------------------------+  clamped
//! ```

use serde_json::json;
use solver::problem::Problem;
use solver::solution::{ContactProfile, Solution};

use crate::record::held;
use crate::support::{close, graded, problem, solve, union};

const A: f64 = 0.5;
const E_STAR: f64 = 1000.0 / 0.91;

fn punch(kind: &str, size: f64, edge: f64, refine: u32, indentation: f64) -> Problem {
    let growth = 1.25;
    let x = union(&[graded(A, 0.0, edge, growth), graded(A, size, edge, growth)]);
    let y = graded(0.0, -size, edge, growth)
        .into_iter()
        .rev()
        .collect::<Vec<_>>();
    problem(
        &json!({
            "analysis": {"kind": kind},
            "mesh": {"grid": {"x": x, "y": y}, "refine": refine},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "left", "ux": 0}, {"boundary": "bottom", "ux": 0, "uy": 0}],
            "contacts": [{"boundary": "top", "obstacle": {"kind": "flat", "from": 0, "to": A}, "indentation": indentation}],
        })
        .to_string(),
    )
}

/// Largest relative error of the pressure at nodes inside .8 a.
fn pressure_error(profile: &ContactProfile, exact: impl Fn(f64) -> f64) -> f64 {
    let inside = (0..profile.s.len()).filter(|&i| profile.x[i] <= 0.8 * A);
    inside
        .map(|i| (-profile.normal_stress[i] / exact(profile.x[i]) - 1.0).abs())
        .fold(0.0, f64::max)
}

/// Row 8. p = P / (π √(a² − x²)), P the full load: within 1 %, and the better the finer.
#[test]
fn a_plane_punch_presses_as_the_inverse_root() {
    let error = |refine: u32| {
        let solution = solve(&punch("plane_strain", 200.0 * A, 2e-3, refine, 0.1));
        let load = 2.0 * solution.summary.normal_force;
        pressure_error(&solution.node_profiles["top"], |x| {
            load / (std::f64::consts::PI * (A * A - x * x).sqrt())
        })
    };
    let (coarse, fine) = (error(0), error(2));
    held(
        8,
        "plane flat punch: largest error of p inside .8 a",
        "block of 200 a, refined twice",
        fine,
        0.0,
        0.01,
    );
    assert!(fine < 0.5 * coarse, "{coarse:.2e} → {fine:.2e}");
}

/// Row 11. P = 2 E* a δ and p(0) = P / (2π a²): within 1 % on a block of 200 a, and the error
/// falls as the block grows and as the mesh is refined.
#[test]
fn a_round_punch_has_boussinesqs_load() {
    let delta = 0.2;
    let exact = 2.0 * E_STAR * A * delta;
    close(exact, 219.780, 2e-6); // three decimals are published
    let solve = |size: f64, edge: f64| solve(&punch("axisymmetric", size * A, edge, 0, delta));
    let large = solve(200.0, 2.5e-4);
    let mesh = "block of 200 a, edge at 5e-4 a";
    held(
        11,
        "round flat punch: P",
        mesh,
        large.summary.normal_force,
        exact,
        0.01,
    );
    let centre = -large.node_profiles["top"].normal_stress[0];
    held(11, "round flat punch: p(0)", mesh, centre, 139.916, 0.01);
    let pressure = |r: f64| exact / (2.0 * std::f64::consts::PI * A * (A * A - r * r).sqrt());
    assert!(pressure_error(&large.node_profiles["top"], pressure) < 0.01);
    let error = |solution: &Solution| (solution.summary.normal_force / exact - 1.0).abs();
    assert!(
        error(&large) < 0.5 * error(&solve(50.0, 2.5e-4)),
        "a larger block must be nearer to the half-space"
    );
    assert!(
        error(&large) < error(&solve(200.0, 8e-3)),
        "a finer mesh must be nearer to the exact load"
    );
}
