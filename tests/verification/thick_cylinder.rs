//! docs/verification.md, row 3. Thick cylinder, Lamé's solution: a = 1, b = 2, inner pressure 1, E = 1000,
//! ν = .3; once as a quarter ring in plane strain with curved elements, once axisymmetric.

use serde_json::json;
use solver::problem::Problem;
use solver::solution::Fields;

use crate::record::{Line, held};
use crate::support::{Lattice, node, problem, solve};

const MATERIAL: &str = r#"[{"youngs_modulus": 1000, "poissons_ratio": 0.3}]"#;

/// Quarter ring of `radial` × `round` elements, midsides on their circles.
fn ring(radial: usize, round: usize) -> Problem {
    let lattice = Lattice::new(radial, round, |i, j| {
        let (sin, cos) = (std::f64::consts::FRAC_PI_2 * j as f64 / (2 * round) as f64).sin_cos();
        let r = 1.0 + i as f64 / (2 * radial) as f64;
        [r * cos, r * sin]
    });
    problem(
        &json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"inline": {"nodes": lattice.nodes, "elements": lattice.elements, "boundaries": {
                "inner": lattice.edges(round, |k| (0, k)),
                "below": lattice.edges(radial, |k| (k, 0)),
                "side": lattice.edges(radial, |k| (k, 2 * round)),
            }}},
            "materials": serde_json::from_str::<serde_json::Value>(MATERIAL).unwrap(),
            "supports": [{"boundary": "below", "uy": 0}, {"boundary": "side", "ux": 0}],
            "loads": [{"boundary": "inner", "pressure": 1}],
        })
        .to_string(),
    )
}

/// A slice of the wall, held in z.
fn wall(radial: usize) -> Problem {
    let x: Vec<f64> = (0..=radial)
        .map(|i| 1.0 + i as f64 / radial as f64)
        .collect();
    problem(
        &json!({
            "analysis": {"kind": "axisymmetric"},
            "mesh": {"grid": {"x": x, "y": [0, 0.25]}},
            "materials": serde_json::from_str::<serde_json::Value>(MATERIAL).unwrap(),
            "supports": [{"boundary": "bottom", "uy": 0}, {"boundary": "top", "uy": 0}],
            "loads": [{"boundary": "left", "pressure": 1}],
        })
        .to_string(),
    )
}

/// Displacements converge with the third power of h or better and are within 1e-5 at eight
/// elements; recovered stresses at a surface are a one-sided extrapolation: 1 % there.
fn hold(kind: &str, fields: &Fields, hoop: &[f64]) {
    let (a, b) = (node(fields, 1.0, 0.0), node(fields, 2.0, 0.0));
    for (name, computed, exact, allowed) in [
        ("u(a)", fields.ux[a], 1.906667e-3, 1e-5),
        ("u(b)", fields.ux[b], 1.213333e-3, 1e-5),
        ("σ_θ(a)", hoop[a], 5.0 / 3.0, 0.01),
        ("σ_θ(b)", hoop[b], 2.0 / 3.0, 0.01),
    ] {
        let what = format!("thick cylinder, {kind}: {name}");
        held(3, &what, "8 elements across", computed, exact, allowed);
    }
}

#[test]
fn a_pressurised_ring_in_plane_strain_has_lames_solution() {
    let fields = solve(&ring(8, 8)).fields;
    hold("plane strain", &fields, &fields.stress_yy); // on y = 0 the hoop direction is y
}

#[test]
fn a_pressurised_wall_in_axisymmetry_has_lames_solution() {
    let fields = solve(&wall(8)).fields;
    hold("axisymmetric", &fields, &fields.stress_zz);
}

/// The exact displacement is 1.3/1000 · (a²/(b² − a²)) · ((1 − 2ν) r + b²/r).
#[test]
fn the_error_of_displacement_falls_with_the_third_power_of_the_element_or_better() {
    let exact = |r: f64| 1.3e-3 / 3.0 * (0.4 * r + 4.0 / r);
    let error = |problem: &Problem| {
        let f = solve(problem).fields;
        let at = |k: usize| (f.ux[k].hypot(f.uy[k]), f.x[k].hypot(f.y[k]));
        (0..f.x.len())
            .map(|k| {
                let (u, r) = at(k);
                (u - exact(r)).abs()
            })
            .fold(0.0, f64::max)
    };
    let rate = (error(&ring(2, 2)) / error(&ring(4, 4))).log2();
    keep_rate("plane strain", rate);
    assert!(rate > 3.0, "plane strain: rate {rate:.2}");
    let radial = |n: usize| {
        let f = solve(&wall(n)).fields;
        (0..f.x.len())
            .map(|k| (f.ux[k] - exact(f.x[k])).abs())
            .fold(0.0, f64::max)
    };
    let rate = (radial(4) / radial(8)).log2();
    keep_rate("axisymmetric", rate);
    assert!(rate > 3.0, "axisymmetric: rate {rate:.2}");
}

/// Nodal values may do better than the third power, never worse.
fn keep_rate(kind: &str, rate: f64) {
    Line {
        row: 3,
        what: &format!("thick cylinder, {kind}: order of u, 3 at least"),
        mesh: "halved",
        expected: 3.0,
        computed: rate,
        allowed: 0.6,
        order: Some(rate),
    }
    .hold();
}

/// `refine` of an inline mesh keeps curved sides curved. What remains is the distance of the
/// coarse mesh's parabolas from the circle, which falls with the fourth power of their length.
#[test]
fn refining_a_curved_mesh_converges_to_its_curve() {
    let error = |n: usize, refine: u32| {
        let mut ring = ring(n, n);
        ring.mesh.refine = solver::problem::Refine::Times(refine);
        let fields = solve(&ring).fields;
        (fields.ux[node(&fields, 1.0, 0.0)] / 1.906667e-3 - 1.0).abs()
    };
    let errors = [2, 4, 8].map(|n| error(n, 2));
    assert!(errors[0] < 7e-4, "{errors:?}");
    for pair in errors.windows(2) {
        assert!(pair[1] < pair[0] / 12.0, "{errors:?}");
    }
}
