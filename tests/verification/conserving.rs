//! What the average of the pressure loses beyond the ends of the contact boundary, and `normalization: conserving`.

use serde_json::json;
use solver::solution::{Solution, WarningCode};

use crate::support::{graded, problem, solve, union};

/// A flat punch of half-width .5 that slides: T / (μ N).
fn sliding(normalization: &str, kernel: &str, radius: f64) -> (f64, Solution) {
    let fine: Vec<f64> = (-20..=20).map(|k| 0.025 * f64::from(k)).collect();
    let mut left: Vec<f64> = graded(-0.5, -8.0, 0.025, 1.5);
    left.reverse();
    let x = union(&[left, fine, graded(0.5, 8.0, 0.025, 1.5)]);
    let y: Vec<f64> = graded(0.0, -8.0, 0.025, 1.5).into_iter().rev().collect();
    let solution = solve(&problem(
        &json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"grid": {"x": x, "y": y}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
            "contacts": [{
                "boundary": "top", "obstacle": {"kind": "flat", "from": -0.5, "to": 0.5},
                "indentation": 0.01, "tangential_displacement": 0.5,
                "friction": {"coefficient": 0.3, "nonlocal_radius": radius, "elastic_slip": 1e-4,
                    "normalization": normalization, "kernel": kernel},
            }],
        })
        .to_string(),
    ));
    let summary = &solution.summary;
    (
        summary.friction_force / (0.3 * summary.normal_force),
        solution,
    )
}

fn warning(solution: &Solution) -> Option<&str> {
    let code = WarningCode::FrictionLostAtEnd;
    let warnings = &solution.summary.warnings;
    warnings
        .iter()
        .find(|w| w.code == code)
        .map(|w| w.message.as_str())
}

/// What is left of the friction under Boussinesq's pressure 1/√(a² − x²), x = a sin θ: the mean over θ of the part of the
/// kernel within ±a.
fn left_at_the_edges(kernel: &str, radius: f64) -> f64 {
    let shape = |x: f64| match kernel {
        _ if x.abs() >= 1.0 => 0.0,
        "bump" => (1.0 / (x * x - 1.0)).exp(),
        _ => 1.0 - x * x,
    };
    let middle = |k: usize, n: usize| (k as f64 + 0.5) / n as f64;
    let inside = |from: f64, to: f64| {
        let x = |k: usize| from + (to - from) * middle(k, 400);
        (to - from) * (0..400).map(|k| shape(x(k))).sum::<f64>() / 400.0
    };
    let part = |x: f64| {
        let [from, to] = [-0.5 - x, 0.5 - x].map(|end| (end / radius).clamp(-1.0, 1.0));
        inside(from, to) / inside(-1.0, 1.0)
    };
    let theta = |k: usize| std::f64::consts::PI * (middle(k, 400) - 0.5);
    (0..400).map(|k| part(0.5 * theta(k).sin())).sum::<f64>() / 400.0
}

/// With a radius of .4 of the half-width a sixth of the friction is lost at the two edges of a punch; the warning gives the
/// size. With the other normalization all of it is there, to what three points an edge integrate.
#[test]
fn friction_lost_at_the_edges_is_reported_and_can_be_conserved() {
    for kernel in ["bump", "parabola"] {
        let (ratio, solution) = sliding("unit_integral", kernel, 0.2);
        // friction itself and the finite block change the pressure a little
        let expected = left_at_the_edges(kernel, 0.2);
        assert!(
            (ratio - expected).abs() < 0.01,
            "{kernel}: {ratio} for {expected}"
        );
        let message = warning(&solution).unwrap();
        let told = message
            .split("would be ")
            .nth(1)
            .and_then(|rest| rest.split(' ').next());
        let told: f64 = told.unwrap().parse().unwrap();
        assert!((told - ratio).abs() < 0.005, "{told} for {ratio}");
        for radius in [0.05, 0.2, 0.7] {
            let (ratio, solution) = sliding("conserving", kernel, radius);
            assert!((ratio - 1.0).abs() < 2e-3, "{kernel}, {radius}: {ratio}");
            assert_eq!(warning(&solution), None);
        }
    }
}
