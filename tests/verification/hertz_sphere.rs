//! docs/verification.md, row 10. Hertz: a rigid sphere on a half-space, frictionless. With R = 8, E = 1000, ν = .3
//! and δ = a²/R for a = 1: P = 4/3 E* √R δ^1.5 = 4 E* a³/(3R), p = p₀ √(1 − r²/a²), p₀ = 2E* a/(πR).

use serde_json::json;
use solver::solution::{EstimatedQuantity, QuantityName, Solution};

use crate::record::Line;
use crate::support::{graded, problem, solve, union};

const R: f64 = 8.0;
const E_STAR: f64 = 1000.0 / 0.91;

/// A block of radius and depth `size`, elements of size `h` in the contact.
fn sphere(size: f64, h: f64) -> Solution {
    let fine: Vec<f64> = (0..=(1.2 / h).round() as usize)
        .map(|k| k as f64 * h)
        .collect();
    let x = union(&[fine, graded(1.2, size, h, 1.35)]);
    let y: Vec<f64> = graded(0.0, -size, h, 1.35).into_iter().rev().collect();
    let text = json!({
        "analysis": {"kind": "axisymmetric"},
        "mesh": {"grid": {"x": x, "y": y}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
        "contacts": [{"boundary": "top", "obstacle": {"kind": "parabola", "radius": R, "from": 0, "to": 2}, "indentation": 1.0 / R}],
    });
    solve(&problem(&text.to_string()))
}

/// P and p₀ to 1 %, the radius to an element, p to 1 % within .8 a. The load's error is the block's,
/// 3/2 of the share of δ that the clamped base takes, and falls with its size; the error of p falls with h.
#[test]
fn a_sphere_has_hertzs_solution() {
    let (load, p0) = (
        4.0 * E_STAR / (3.0 * R),
        2.0 * E_STAR / (std::f64::consts::PI * R),
    );
    let of_load = |solution: &Solution| (solution.summary.normal_force / load - 1.0).abs();
    // p is compared for the load that there is: a³ goes with it
    let of_pressure = |solution: &Solution| {
        let a = (solution.summary.normal_force / load).cbrt();
        let profile = &solution.node_profiles["top"];
        (0..profile.s.len())
            .filter(|&i| profile.x[i] <= 0.8)
            .map(|i| {
                let exact = p0 * (a * a - profile.x[i].powi(2)).sqrt();
                (-profile.normal_stress[i] / exact - 1.0).abs()
            })
            .fold(0.0, f64::max)
    };
    let h = 0.025;
    let (small, large, coarse) = (sphere(100.0, h), sphere(400.0, h), sphere(400.0, 4.0 * h));
    assert!(
        of_load(&large) < 0.5 * of_load(&small),
        "load: {:.2e} → {:.2e}",
        of_load(&small),
        of_load(&large)
    );
    let (before, after) = (of_pressure(&coarse), of_pressure(&large));
    assert!(after < 0.5 * before, "pressure: {before:.2e} → {after:.2e}");
    let contact = &large.summary.contacts["top"];
    let [_, a] = contact.contact[0];
    assert!((a - 1.0).abs() <= h, "a = {a} with elements of {h}");
    let line = |what: &str, computed: f64, expected: f64, order: Option<f64>| {
        Line {
            row: 10,
            what,
            mesh: "block of 400 a, elements of a/40",
            expected,
            computed,
            allowed: 0.01,
            order,
        }
        .hold();
    };
    line("Hertz sphere: P", large.summary.normal_force, load, None);
    line(
        "Hertz sphere: p₀",
        -contact.peak_normal_stress.unwrap().value,
        p0,
        None,
    );
    let order = (before / after).log(4.0);
    line(
        "Hertz sphere: largest error of p within .8 a",
        after,
        0.0,
        Some(order),
    );
}

/// Spheres pressed to many depths: as the end of contact moves from node to node, force and peak stay within their stated errors of
/// those on a mesh four times as fine.
#[test]
fn spheres_of_all_depths_are_within_their_stated_errors() {
    let (mut within, mut all) = (0, 0);
    for k in 0..16 {
        let depth = 0.001 + 8e-5 * f64::from(k);
        let at = |refine: u32| {
            let text = json!({
                "analysis": {"kind": "axisymmetric"},
                "mesh": {"refine": refine, "grid": {
                    "x": [0, 0.02, 0.04, 0.06, 0.08, 0.1, 0.12, 0.16, 0.25, 0.5, 1, 2, 4, 8, 16],
                    "y": [-16, -8, -4, -2, -1, -0.5, -0.25, -0.15, -0.1, -0.06, -0.03, 0]}},
                "materials": [{"youngs_modulus": 175_731, "poissons_ratio": 0.213}],
                "supports": [{"boundary": "left", "ux": 0}, {"boundary": "bottom", "ux": 0, "uy": 0}],
                "contacts": [{"boundary": "top", "obstacle": {"kind": "circle", "radius": 19.2}, "indentation": depth}],
            });
            solve(&problem(&text.to_string()))
                .summary
                .accuracy
                .unwrap()
                .quantities
        };
        let (own, finer) = (at(2), at(4));
        for name in [QuantityName::NormalForce, QuantityName::PeakNormalStress] {
            let of = |all: &[EstimatedQuantity]| {
                let found = all.iter().find(|q| q.quantity == name).unwrap();
                (found.value, found.error.unwrap())
            };
            let ((value, error), (fine, _)) = (of(&own), of(&finer));
            let off = (value - fine).abs();
            all += 1;
            within += usize::from(off <= error);
            assert!(
                off <= 1.2 * error && error < 3e-3 * value.abs(),
                "{depth}: {value} ± {error}, finer {fine}"
            );
        }
    }
    assert!(within + 1 >= all, "{within} of {all}");
}
