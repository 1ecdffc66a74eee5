//! The errors of elements by Zienkiewicz and Zhu (Int. J. Numer. Meth. Eng. 24, 1987) against known errors.

use serde_json::{Value, json};
use solver::problem::Problem;
use solver::solution::Solution;

use crate::support::{problem, solve};

/// A thick wall a = 1, b = 2 under inner pressure 1, E = 1000, ν = .3, held in z: Lamé.
fn wall(n: usize, quadrature: u32) -> Problem {
    let x: Vec<f64> = (0..=n).map(|i| 1.0 + i as f64 / n as f64).collect();
    let text = json!({
        "analysis": {"kind": "axisymmetric"}, "quadrature": quadrature,
        "mesh": {"grid": {"x": x, "y": [0, 0.25]}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "bottom", "uy": 0}, {"boundary": "top", "uy": 0}],
        "loads": [{"boundary": "left", "pressure": 1}],
    });
    problem(&text.to_string())
}

/// Norm of the exact solution: twice its energy is the work of the pressure, 2π a H · p u(a).
fn lame_norm() -> f64 {
    let inner = 1.3 / 3000.0 * (0.4 + 4.0);
    f64::sqrt(2.0 * std::f64::consts::PI * 0.25 * inner)
}

/// The exact error follows from the energies: ‖u‖² = ‖u_h‖² + ‖e‖² for full integration. The estimate
/// must tend to it; 10 % on eight elements. Both fall with h².
#[test]
fn the_estimate_tends_to_the_error_of_lames_wall() {
    let mut before: Option<f64> = None;
    for n in [4, 8, 16] {
        let solution = solve(&wall(n, 3));
        let error = total(&solution);
        let exact = f64::sqrt(lame_norm().powi(2) - energy_norm(&solution).powi(2));
        let effectivity = error / exact;
        assert!(
            n < 8 || (effectivity - 1.0).abs() < 0.1,
            "{n} elements: effectivity {effectivity:.3}"
        );
        if let Some(before) = before {
            let rate = (before / error).log2();
            assert!((rate - 2.0).abs() < 0.15, "{n} elements: rate {rate:.2}");
        }
        before = Some(error);
    }
}

/// The norm of the solution, 2π and thickness included.
fn energy_norm(solution: &Solution) -> f64 {
    (2.0 * solution.summary.strain_energy.unwrap()).sqrt()
}

/// The norm of the error of the whole body, of which those of elements are parts.
fn total(solution: &Solution) -> f64 {
    let parts = &solution.fields.element_error;
    parts.iter().map(|e| e * e).sum::<f64>().sqrt()
}

/// The error of the whole body as a part of its exact norm.
pub(crate) fn relative_error(solution: &Solution) -> f64 {
    let error = total(solution);
    error / energy_norm(solution).hypot(error)
}

/// The strain energy is that of the stresses at the points of integration, and a linear body's potential energy is its
/// negative; every element has its error, with either rule.
#[test]
fn every_element_has_its_error_and_the_body_its_strain_energy() {
    for quadrature in [3, 2] {
        let solution = solve(&wall(4, quadrature));
        let strain_energy = solution.summary.strain_energy.unwrap();
        assert!((solution.summary.energy / strain_energy + 1.0).abs() < 1e-12);
        assert_eq!(solution.fields.element_error.len(), 4);
        assert!(
            solution
                .fields
                .element_error
                .iter()
                .all(|error| *error > 0.0)
        );
        let count = 4 * (quadrature * quadrature) as usize;
        assert_eq!(solution.fields.gauss.x.len(), count);
        assert_eq!(solution.fields.gauss.order, quadrature);
    }
}

/// Force × length in the square: twice the thickness of a sheet gives √2 of the error under the same stress.
#[test]
fn the_estimate_scales_with_the_thickness() {
    let sheet = |thickness: f64| {
        let text = json!({
            "analysis": {"kind": "plane_stress", "thickness": thickness},
            "mesh": {"grid": {"x": [0, 1, 2], "y": [0, 1]}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "left", "ux": 0, "uy": 0}],
            "loads": [{"boundary": "right", "traction": [0, 1]}],
        });
        total(&solve(&problem(&text.to_string())))
    };
    assert!((sheet(2.0) / sheet(1.0) / 2f64.sqrt() - 1.0).abs() < 1e-12);
}

/// Two layers stretched side by side: the stress jumps at their interface, as it must, and the elements
/// are exact. A recovery that averaged across would call that an error.
#[test]
fn a_jump_at_an_interface_is_not_an_error() {
    let layers = |materials: Value| {
        let text = json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"grid": {"x": [0, 1, 2], "y": [0, 1, 2]}, "groups": {"stiff": {"y": [1, 2]}}},
            "materials": materials,
            "supports": [{"boundary": "left", "ux": 0}, {"boundary": "right", "ux": 0.02}, {"boundary": "bottom", "uy": 0}],
        });
        solve(&problem(&text.to_string()))
    };
    let solution = layers(json!([
        {"youngs_modulus": 1000, "poissons_ratio": 0},
        {"youngs_modulus": 3000, "poissons_ratio": 0, "group": "stiff"},
    ]));
    assert!(relative_error(&solution) < 1e-12);
    // a node of the interface shows the mean of both
    let fields = &solution.fields;
    for (y, stress) in fields.y.iter().zip(&fields.stress_xx) {
        let exact = if *y < 1.0 {
            10.0
        } else if *y > 1.0 {
            30.0
        } else {
            20.0
        };
        assert!((stress - exact).abs() < 1e-10, "{stress} at y = {y}");
    }
}
