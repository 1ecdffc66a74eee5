//! docs/verification.md, row 13. A rigid punch of even profile f on a half-plane, frictionless: at half-width a
//!
//!   P = E* ∫₀ᵃ x f′(x)/√(a² − x²) dx
//!
//! and, as a contact grows by flat punches one wider than the other, p(x) = ∫ₓᵃ P′(t)/(π√(t² − x²)) dt:
//!
//!   f = |x| tan θ:  P = E* a tan θ,         p = E* tan θ/π · arcosh(a/x)
//!   f = c x⁴:       P = 3π/4 · E* c a⁴,     p = E* c (a² + 2x²) √(a² − x²)

use serde_json::{Value, json};
use solver::solution::Solution;

use crate::record::Line;
use crate::support::{graded, problem, solve, union};

const E_STAR: f64 = 1000.0 / 0.91;

/// Elements of size `h` to 1.2, finer towards x = 0, where a wedge has its singular pressure.
fn punch(obstacle: &Value, indentation: f64, h: f64) -> Solution {
    let fine: Vec<f64> = (0..=(1.0 / h).round() as usize)
        .map(|k| 0.2 + k as f64 * h)
        .collect();
    let x = union(&[
        graded(0.0, 0.2, 0.05 * h, 1.25),
        fine,
        graded(1.2, 200.0, h, 1.35),
    ]);
    let y: Vec<f64> = graded(0.0, -200.0, 0.05 * h, 1.25)
        .into_iter()
        .rev()
        .collect();
    let mut obstacle = obstacle.clone();
    (obstacle["from"], obstacle["to"]) = (json!(0), json!(1.2));
    let text = json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grid": {"x": x, "y": y}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "left", "ux": 0}, {"boundary": "bottom", "ux": 0, "uy": 0}],
        "contacts": [{"boundary": "top", "obstacle": obstacle, "indentation": indentation}],
    });
    solve(&problem(&text.to_string()))
}

/// An indentation of a half-plane has no meaning of its own: the secant rule finds the one at which the
/// full load is that of a = 1.
fn at_load(obstacle: &Value, load: f64, start: f64, h: f64) -> Solution {
    let (mut d0, mut d1) = (start, 1.1 * start);
    let mut f0 = 2.0 * punch(obstacle, d0, h).summary.normal_force - load;
    for _ in 0..20 {
        let solution = punch(obstacle, d1, h);
        let f1 = 2.0 * solution.summary.normal_force - load;
        if f1.abs() < 1e-6 * load {
            return solution;
        }
        (d0, d1, f0) = (d1, d1 - f1 * (d1 - d0) / (f1 - f0), f1);
    }
    panic!("no indentation found for the load {load}");
}

/// The half-width to one element, p to 1 % for .1 a ≤ x ≤ .8 a, and the better the finer.
fn hold(name: &str, obstacle: &Value, load: f64, start: f64, pressure: impl Fn(f64) -> f64) {
    let errors = [0.1, 0.025].map(|h| {
        let solution = at_load(obstacle, load, start, h);
        let [_, a] = solution.summary.contacts["top"].contact[0];
        assert!((a - 1.0).abs() <= h, "{name}: a = {a} with elements of {h}");
        let profile = &solution.node_profiles["top"];
        (0..profile.s.len())
            .filter(|&i| (0.1..=0.8).contains(&profile.x[i]))
            .map(|i| (-profile.normal_stress[i] / pressure(profile.x[i]) - 1.0).abs())
            .fold(0.0, f64::max)
    });
    let [coarse, fine] = errors;
    assert!(fine < 0.5 * coarse, "{name}: {coarse:.2e} → {fine:.2e}");
    let what = format!("{name} on a half-plane: largest error of p, .1 a ≤ x ≤ .8 a");
    Line {
        row: 13,
        what: &what,
        mesh: "block of 200 a, elements of a/40",
        expected: 0.0,
        computed: fine,
        allowed: 0.01,
        order: Some((coarse / fine).log(4.0)),
    }
    .hold();
}

#[test]
fn a_wedge_has_the_load_of_its_integral() {
    let angle = 5.0;
    let slope = f64::to_radians(angle).tan();
    let exact = |x: f64| E_STAR * slope / std::f64::consts::PI * (1.0 / x).acosh();
    let wedge = json!({"kind": "wedge", "angle": angle});
    hold("wedge", &wedge, E_STAR * slope, 0.3, exact);
}

#[test]
fn a_profile_of_fourth_power_has_the_load_of_its_integral() {
    let c = 0.05;
    let load = 0.75 * std::f64::consts::PI * E_STAR * c;
    let exact = |x: f64| E_STAR * c * (1.0 + 2.0 * x * x) * (1.0 - x * x).sqrt();
    let power = json!({"kind": "power", "coefficient": c, "exponent": 4});
    hold("|x|⁴", &power, load, 0.3, exact);
}
