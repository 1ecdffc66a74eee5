//! docs/verification.md, row 7. Contact patch test: a block of distorted elements on a rigid flat under uniform
//! stress must press on it uniformly, to round-off.
//!
//! ```text
//!    ↓ ↓ ↓ ↓ p, or u_y prescribed
//!   +---+----+--+
//!   |   \    |  |      lateral faces free (x: a roller on the left), the base on the flat
//!   +---+----+--+
//!   ============= rigid
//! ```

use serde_json::{Value, json};
use solver::solution::Solution;

use crate::record::held;
use crate::support::{Lattice, problem, solve};

const E: f64 = 1000.0;
const RATIOS: [f64; 2] = [0.3, 0.4999];

/// Width 3, height 2; uneven corners along the base too. The flat comes to `gap` below it.
fn block(kind: &Value, ratio: f64, top: (&str, Value), gap: f64) -> Solution {
    let shift = |i: usize, j: usize| match (i, j) {
        (1, 0) => [0.2, 0.0],
        (2, 0) => [-0.15, 0.0],
        (1, 1) => [0.15, -0.2],
        (2, 1) => [-0.2, 0.1],
        _ => [0.0, 0.0],
    };
    let corner = |i: usize, j: usize| {
        let [dx, dy] = shift(i, j);
        [1.0 + i as f64 + dx, j as f64 + dy]
    };
    let lattice = Lattice::new(3, 2, |i, j| {
        let (a, b) = (corner(i / 2, j / 2), corner(i.div_ceil(2), j.div_ceil(2)));
        [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])]
    });
    let round = kind["kind"] == "axisymmetric";
    let mut text = json!({
        "analysis": kind,
        "mesh": {"inline": {"nodes": lattice.nodes, "elements": lattice.elements, "boundaries": {
            "bottom": lattice.edges(3, |k| (6 - k, 0)), "top": lattice.edges(3, |k| (k, 4)),
            "left": lattice.edges(2, |k| (0, k)),
        }}},
        "materials": [{"youngs_modulus": E, "poissons_ratio": ratio}],
        // a ring must be free to grow
        "supports": if round { json!([]) } else { json!([{"boundary": "left", "ux": 0}]) },
        "loads": [],
        "contacts": [{"boundary": "bottom", "obstacle": {"kind": "flat"}, "indentation": -gap}],
    });
    let (list, mut entry) = top;
    entry["boundary"] = json!("top");
    text[list].as_array_mut().unwrap().push(entry);
    solve(&problem(&text.to_string()))
}

/// Largest deviation of the pressure, relative.
fn unevenness(solution: &Solution, pressure: f64) -> f64 {
    let stress = &solution.node_profiles["bottom"].normal_stress;
    stress
        .iter()
        .map(|s| (s / pressure + 1.0).abs())
        .fold(0.0, f64::max)
}

fn theories() -> impl Iterator<Item = (Value, f64)> {
    let kinds = [
        json!({"kind": "plane_strain"}),
        json!({"kind": "plane_stress", "thickness": 0.3}),
        json!({"kind": "axisymmetric"}),
    ];
    let at = |kind: Value| RATIOS.map(|ratio| (kind.clone(), ratio));
    kinds.into_iter().flat_map(at)
}

/// 1e-11: rounding of a system whose condition is about 1e3; λ/G = 5000 of the nearly incompressible one multiplies it.
fn allowed(ratio: f64) -> f64 {
    if ratio > 0.48 { 1e-9 } else { 1e-11 }
}

fn described(kind: &Value, ratio: f64) -> String {
    let kind = kind["kind"].as_str().unwrap();
    match ratio {
        0.3 => kind.to_owned(),
        _ => format!("{kind}, ν = {ratio}"),
    }
}

/// Pressed down by a prescribed displacement: p = E′ δ/h with E′ = E/(1 − ν²) in plane strain, else E.
#[test]
fn a_block_squeezed_against_a_flat_presses_evenly() {
    for (kind, ratio) in theories() {
        let modulus = if kind["kind"] == "plane_strain" {
            E / (1.0 - ratio * ratio)
        } else {
            E
        };
        let (squeeze, gap) = (0.02, 0.01);
        let exact = modulus * (squeeze - gap) / 2.0;
        let solution = block(&kind, ratio, ("supports", json!({"uy": -squeeze})), gap);
        let what = format!(
            "contact patch test, {}, squeezed: unevenness of p",
            described(&kind, ratio)
        );
        held(
            7,
            &what,
            "6 distorted Q8",
            unevenness(&solution, exact),
            0.0,
            allowed(ratio),
        );
    }
}

/// Pressed down by a pressure, with nothing but contact to hold it up.
#[test]
fn a_block_pressed_on_a_flat_that_alone_holds_it_presses_evenly() {
    for (kind, ratio) in theories() {
        let solution = block(&kind, ratio, ("loads", json!({"pressure": 5})), 0.01);
        let what = format!(
            "contact patch test, {}, held by contact alone: unevenness of p",
            described(&kind, ratio)
        );
        held(
            7,
            &what,
            "6 distorted Q8",
            unevenness(&solution, 5.0),
            0.0,
            allowed(ratio),
        );
        assert!(solution.summary.residuals.equilibrium < allowed(ratio));
    }
}
