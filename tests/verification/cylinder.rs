//! docs/verification.md, row 9. Hertz: a rigid cylinder on a half-space, frictionless. R = 8, E = 1000,
//! ν = .3: contact half-width a = 1 needs P = 107.884 (full load) and gives p₀ = 68.681.

use serde_json::json;
use solver::solution::{Solution, WarningCode};

use crate::record::held;
use crate::support::{close, graded, problem, solve, union};

/// The block is 200 a wide and deep; `h`: element size in the contact.
fn cylinder(indentation: f64, h: f64) -> Solution {
    let fine: Vec<f64> = (0..=(1.2 / h).round() as usize)
        .map(|k| k as f64 * h)
        .collect();
    let x = union(&[fine, graded(1.2, 200.0, h, 1.35)]);
    let y: Vec<f64> = graded(0.0, -200.0, h, 1.35).into_iter().rev().collect();
    solve(&problem(
        &json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"grid": {"x": x, "y": y}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "left", "ux": 0}, {"boundary": "bottom", "ux": 0, "uy": 0}],
            "contacts": [{"boundary": "top", "obstacle": {"kind": "parabola", "radius": 8, "from": 0, "to": 2}, "indentation": indentation}],
        })
        .to_string(),
    ))
}

/// The indentation of a plane half-space has no meaning of its own: it is adjusted by the secant
/// rule until the load is Hertz's, and the contact must then be Hertz's too.
fn at_load(load: f64, h: f64) -> Solution {
    let (mut d0, mut d1) = (0.4, 0.45);
    let mut f0 = 2.0 * cylinder(d0, h).summary.normal_force - load;
    for _ in 0..12 {
        let solution = cylinder(d1, h);
        let f1 = 2.0 * solution.summary.normal_force - load;
        if f1.abs() < 1e-6 * load {
            return solution;
        }
        (d0, d1, f0) = (d1, d1 - f1 * (d1 - d0) / (f1 - f0), f1);
    }
    panic!("no indentation found for the load {load}");
}

/// Half-width to one element, pressures to 1 % within .8 a, and the better the finer.
#[test]
fn a_cylinder_has_hertzs_solution() {
    let e_star = 1000.0 / 0.91;
    let (load, p0) = (
        std::f64::consts::PI * e_star / (4.0 * 8.0),
        e_star / (2.0 * 8.0),
    );
    close(load, 107.884, 1e-5);
    close(p0, 68.681, 1e-5);
    let error = |h: f64| {
        let solution = at_load(load, h);
        let contact = &solution.summary.contacts["top"];
        let [_, a] = contact.contact[0];
        assert!((a - 1.0).abs() <= h, "a = {a} with elements of {h}");
        let peak = -contact.peak_normal_stress.unwrap().value;
        let mesh = format!("block of 200 a, h = {h} a");
        held(9, "Hertz, cylinder: p₀", &mesh, peak, p0, 0.01);
        let profile = &solution.node_profiles["top"];
        let inside = (0..profile.s.len()).filter(|&i| profile.x[i] <= 0.8);
        inside
            .map(|i| {
                (-profile.normal_stress[i] / (p0 * (1.0 - profile.x[i].powi(2)).sqrt()) - 1.0).abs()
            })
            .fold(0.0, f64::max)
    };
    let (coarse, fine) = (error(0.1), error(0.025));
    held(
        9,
        "Hertz, cylinder: largest error of p inside .8 a, at P = 107.884",
        "block of 200 a, h = .025 a",
        fine,
        0.0,
        0.01,
    );
    assert!(fine < 0.5 * coarse, "{coarse:.2e} → {fine:.2e}");
}

/// What `mesh_too_coarse_for_contact` says of the peak holds for every place of the contact's end
/// between the nodes: .28/n², n elements across the whole contact, of which this is a half.
#[test]
fn the_peak_of_a_coarse_contact_is_within_the_error_of_its_warning() {
    for n in [1.0, 2.0, 3.0, 5.0] {
        for shift in [0.0, 0.3, 0.6, 0.9] {
            let solution = cylinder(0.38, 1.0 / (n + shift));
            let contact = &solution.summary.contacts["top"];
            let load = 2.0 * solution.summary.normal_force;
            let exact = (load * 1000.0 / 0.91 / (std::f64::consts::PI * 8.0)).sqrt();
            let off = (-contact.peak_normal_stress.unwrap().value / exact - 1.0).abs();
            let received = solution.summary.warnings.iter();
            let mut received = received.filter(|w| w.code == WarningCode::MeshTooCoarseForContact);
            if n > 2.0 {
                assert_eq!(received.next(), None);
                assert!(off <= 0.28 / (4.0 * n * n) + 0.003, "{off} with {n}");
                continue;
            }
            let message = &received.next().expect("no warning").message;
            let percent = message
                .split("up to ")
                .nth(1)
                .and_then(|m| m.split(' ').next());
            let reported: f64 = percent.unwrap().parse().unwrap();
            // the block is no half-space: a few tenths of a percent
            assert!(100.0 * off <= reported + 0.3, "{off} against: {message}");
        }
    }
}
