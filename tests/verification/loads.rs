//! Loads in all their forms: what says the same in two ways must do the same, and totals must be those
//! that are written down.

use serde_json::{Value, json};
use solver::solution::{Fields, Solution};

use crate::support::{problem, solve};

/// A wedge of a block with an oblique top, on its base; `refine`: once, so that boundaries have more nodes
/// than were written down.
fn block(analysis: &Value, loads: Value) -> Solution {
    let text = json!({
        "analysis": analysis,
        "mesh": {"grid": {"x": [1, 2, 3], "y": [0, 0.5, 1], "top": [[1, 1], [3, 2]]}, "refine": 1},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
        "loads": loads,
    });
    solve(&problem(&text.to_string()))
}

fn theories() -> [Value; 3] {
    [
        json!({"kind": "plane_strain"}),
        json!({"kind": "plane_stress", "thickness": 0.2}),
        json!({"kind": "axisymmetric"}),
    ]
}

/// To 1e-12 of the largest displacement: rounding.
#[track_caller]
fn same(a: &Fields, b: &Fields) {
    let size = a.ux.iter().chain(&a.uy).fold(0.0f64, |m, u| m.max(u.abs()));
    assert!(size > 1e-4, "a load must do something");
    let pairs = a.ux.iter().zip(&b.ux).chain(a.uy.iter().zip(&b.uy));
    let off = pairs.fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
    assert!(off < 1e-12 * size, "{:.1e} of {size:.1e}", off / size);
}

/// The top rises by 1 on 2: n = (−1, 2)/√5, t = (2, 1)/√5.
#[test]
fn pressure_traction_normal_and_tangential_are_one_stress() {
    let root = 5f64.sqrt();
    for analysis in theories() {
        let load = |load: Value| {
            let mut load = load;
            load["boundary"] = json!("top");
            block(&analysis, json!([load])).fields
        };
        // linear from 2 to 6 along the top
        let pushed = load(json!({"pressure": [2, 6]}));
        same(&pushed, &load(json!({"normal": [-2, -6]})));
        let along = |a: f64| json!([a * 2.0 / root, a * 6.0 / root]);
        same(
            &pushed,
            &load(json!({"traction": [along(1.0), along(-2.0)]})),
        );
        let sheared = load(json!({"tangential": [3, 1], "normal": 4}));
        let part = |n: f64, t: f64| json!([(4.0 * n + 3.0 * t) / root, (4.0 * n + t) / root]);
        same(
            &sheared,
            &load(json!({"traction": [part(-1.0, 2.0), part(2.0, 1.0)]})),
        );
    }
}

/// The forces that a uniform traction puts on the nodes of a straight edge are 1 : 4 : 1 in the plane; in
/// axisymmetry those of whole rings, 2π ∫ r h ds, which is linear shape times quadratic: on an edge
/// from r₁ to r₂ of length L they are 2πL (r₁/6, (r₁ + r₂)/3, r₂/6).
#[test]
fn nodal_forces_are_those_of_whole_rings() {
    let stress = [3.0, -2.0];
    for analysis in theories() {
        let (round, depth) = (
            analysis["kind"] == "axisymmetric",
            analysis["thickness"].as_f64().unwrap_or(1.0),
        );
        let r: Vec<f64> = (0..=4).map(|k| 1.0 + 0.5 * f64::from(k)).collect();
        let mut shares = [0.0; 9];
        for k in 0..4 {
            let length = 0.5 * 1.25f64.sqrt();
            let parts = if round {
                let ring = 2.0 * std::f64::consts::PI;
                [r[k] / 6.0, (r[k] + r[k + 1]) / 3.0, r[k + 1] / 6.0].map(|p| ring * p)
            } else {
                [1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0].map(|p| depth * p)
            };
            (0..3).for_each(|i| shares[2 * k + i] += length * parts[i]);
        }
        let nodal: Vec<[f64; 2]> = shares.iter().map(|s| stress.map(|t| s * t)).collect();
        let by_node = block(&analysis, json!([{"boundary": "top", "nodal": nodal}])).fields;
        let by_stress = block(&analysis, json!([{"boundary": "top", "traction": stress}])).fields;
        same(&by_node, &by_stress);
    }
}

/// A column under its own weight, free to grow sideways without Poisson's effect:
/// u_y = −γ/E (H y − y²/2), in every theory.
#[test]
fn a_column_sinks_under_its_own_weight() {
    let (weight, height, e) = (6.0, 2.0, 1000.0);
    for analysis in theories() {
        let text = json!({
            "analysis": analysis,
            "mesh": {"grid": {"x": [1, 1.5, 3], "y": [0, 0.7, height]}},
            "materials": [{"youngs_modulus": e, "poissons_ratio": 0}],
            "supports": [{"boundary": "bottom", "uy": 0}, {"boundary": "left", "ux": 0}],
            "loads": [{"body_force": [0, -weight]}, {"body_force": [0, weight / 2.0]}],
        });
        let fields = solve(&problem(&text.to_string())).fields;
        for (y, u) in fields.y.iter().zip(&fields.uy) {
            let exact = -0.5 * weight / e * (height * y - 0.5 * y * y);
            assert!((u - exact).abs() < 1e-14, "{u} at {y}, not {exact}");
        }
    }
}

/// What contact bears is what the loads weigh: thickness, or 2π r, included.
#[test]
fn contact_bears_the_loads_of_the_whole_body() {
    for analysis in theories() {
        let text = json!({
            "analysis": analysis,
            "mesh": {"grid": {"x": [1, 2, 3], "y": [0, 1, 2]}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "left", "ux": 0}],
            "loads": [{"body_force": [0, -3]}, {"boundary": "top", "pressure": 5},
                {"boundary": "top", "nodal": [[0, 0], [0, 0], [0, -7], [0, 0], [0, 0]]}],
            "contacts": [{"boundary": "bottom", "obstacle": {"kind": "flat"}}],
        });
        let area = match analysis["kind"].as_str().unwrap() {
            "axisymmetric" => std::f64::consts::PI * (9.0 - 1.0),
            _ => 2.0 * analysis["thickness"].as_f64().unwrap_or(1.0),
        };
        let solution = solve(&problem(&text.to_string()));
        let (found, exact) = (
            solution.summary.normal_force,
            area * (3.0 * 2.0 + 5.0) + 7.0,
        );
        assert!((found / exact - 1.0).abs() < 1e-12, "{found}, not {exact}");
    }
}
