//! Springs between a body and the ground. Sources: equilibrium, springs in series, and Hetényi, Beams on Elastic Foundation
//! (1946), the infinite beam: w = P λ/(2k) under a force P, with λ⁴ = k/(4 E I).

use serde_json::{Value, json};
use solver::model::Model;
use solver::problem::{Elasticity, Problem};
use solver::solution::Solution;

use crate::record::held;
use crate::support::{close, problem, solve};

const E: f64 = 1000.0;
/// Stiffness of the foundation (stress per length).
const K: f64 = 40.0;

fn theories() -> [Value; 3] {
    [
        json!({"kind": "plane_stress", "thickness": 0.7}),
        json!({"kind": "plane_strain"}),
        json!({"kind": "axisymmetric"}),
    ]
}

/// A block of 3 × 2 elements of equal size and ν = 0 between x = 0 and 3, y = 0 and 2.
fn block(analysis: &Value, supports: Value, more: Value) -> Problem {
    let mut text = json!({
        "analysis": analysis,
        "mesh": {"grid": {"x": [0, 1, 2, 3], "y": [0, 1, 2]}},
        "materials": [{"youngs_modulus": E, "poissons_ratio": 0}],
        "supports": supports,
    });
    let more = more.as_object().unwrap().clone();
    text.as_object_mut().unwrap().extend(more);
    problem(&text.to_string())
}

/// The displacement of the node at a place.
fn at(solution: &Solution, place: [f64; 2]) -> [f64; 2] {
    let fields = &solution.fields;
    let is_there = |i: &usize| [fields.x[*i], fields.y[*i]] == place;
    let node = (0..fields.x.len()).find(is_there).unwrap();
    [fields.ux[node], fields.uy[node]]
}

/// A pressure p on a column of height H: p/k below and p/k + pH/E above, whatever the refinement. The grid has elements of
/// one shape, some with springs and some without. Along y and along the normal are the same here.
#[test]
fn a_column_sinks_into_its_foundation() {
    for analysis in theories() {
        for direction in ["normal", "y"] {
            for refine in [0, 1, 2] {
                let supports = json!([
                    {"boundary": "left", "ux": 0},
                    {"boundary": "bottom", "stiffness": {direction: K}},
                ]);
                let load = json!({"loads": [{"boundary": "top", "pressure": 8}]});
                let mut problem = block(&analysis, supports, load);
                problem.mesh.refine = solver::problem::Refine::Times(refine);
                let solution = solve(&problem);
                for (y, expected) in [(0.0, -8.0 / K), (2.0, -8.0 / K - 8.0 * 2.0 / E)] {
                    close(at(&solution, [3.0, y])[1], expected, 1e-11);
                }
                assert!(solution.summary.residuals.equilibrium < 1e-11);
            }
        }
    }
}

/// A foundation and the column above it are springs in series against a punch: p = δ/(1/k + H/E). Also on a tilted bottom,
/// where the springs are along the surface and across it.
#[test]
fn a_punch_presses_a_column_and_its_foundation_in_series() {
    for analysis in theories() {
        let supports = json!([
            {"boundary": "left", "ux": 0},
            {"boundary": "bottom", "stiffness": {"normal": K}},
        ]);
        let contact = json!({"boundary": "top", "obstacle": {"kind": "flat"}, "indentation": 0.3});
        let summary = solve(&block(&analysis, supports, json!({"contacts": [contact]}))).summary;
        let area = match analysis["kind"].as_str().unwrap() {
            "axisymmetric" => std::f64::consts::PI * 9.0,
            _ => 3.0 * analysis["thickness"].as_f64().unwrap_or(1.0),
        };
        let pressure = 0.3 / (1.0 / K + 2.0 / E);
        close(summary.normal_force, pressure * area, 1e-10);
        assert!(summary.residuals.equilibrium < 1e-10);
        // the springs have a part of the energy
        let energy = 0.5 * pressure * 0.3 * area;
        close(summary.energy, energy, 1e-9);
        close(
            summary.strain_energy.unwrap(),
            energy * (2.0 / E) / (1.0 / K + 2.0 / E),
            1e-9,
        );
    }
}

/// Springs of a nearly rigid body: the force along x is borne by tangential springs on the bottom and by normal ones on the
/// sides, and by springs at nodes.
#[test]
fn a_stiff_body_moves_by_its_force_over_all_stiffnesses() {
    let plane = json!({"kind": "plane_strain"});
    let force = 6.0 * 0.5; // body force times area
    for (springs, stiffness) in [
        (
            json!([{"boundary": "bottom", "stiffness": {"tangential": K}}]),
            3.0 * K,
        ),
        (
            json!([{"boundary": "bottom", "stiffness": {"x": K}}]),
            3.0 * K,
        ),
        (
            json!([{"boundary": "left", "stiffness": {"normal": K}}, {"boundary": "right", "stiffness": {"normal": 2.0 * K, "tangential": 5}}]),
            6.0 * K,
        ),
    ] {
        let mut supports = vec![json!({"boundary": "bottom", "uy": 0})];
        supports.extend(springs.as_array().unwrap().clone());
        let load = json!({"loads": [{"body_force": [0.5, 0]}]});
        let mut problem = block(&plane, json!(supports), load);
        problem.materials[0].elasticity = Elasticity::Isotropic {
            youngs_modulus: 1e9,
            poissons_ratio: 0.0,
        };
        let moved = at(&solve(&problem), [3.0, 2.0])[0];
        close(moved, force / stiffness, 1e-6);
    }
}

/// A foundation turns with the surface: a strip under a uniform pressure along its own axis, in any direction.
#[test]
fn a_turned_column_sinks_as_far() {
    for angle in [30.0f64, 90.0, 217.0] {
        let (sin, cos) = angle.to_radians().sin_cos();
        let lattice = crate::support::Lattice::new(3, 2, |i, j| {
            let (x, y) = (0.5 * i as f64, 0.5 * j as f64);
            [cos * x - sin * y, sin * x + cos * y]
        });
        let text = json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"inline": {"nodes": lattice.nodes, "elements": lattice.elements, "boundaries": {
                "below": lattice.edges(3, |k| (k, 0)), "above": lattice.edges(3, |k| (6 - k, 4)),
            }}},
            "materials": [{"youngs_modulus": E, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "below", "ut": 0, "stiffness": {"normal": K}}],
            "loads": [{"boundary": "above", "pressure": 8}],
        });
        let solution = solve(&problem(&text.to_string()));
        let fields = &solution.fields;
        let ends = lattice.edges(3, |k| (k, 0));
        let mut sunk = 0.0;
        for node in ends.iter().map(|edge| edge[2]) {
            sunk += (-sin * fields.ux[node] + cos * fields.uy[node]) / 3.0;
        }
        // held along the bottom, the column bulges above: the mean is that of equilibrium
        close(sunk, -8.0 / K, 0.02);
        assert!(solution.summary.residuals.equilibrium < 1e-11);
    }
}

/// A long beam on an elastic foundation, with a force in its middle.
#[test]
fn a_beam_on_a_foundation_bends_as_hetenyi_has_it() {
    let (height, k, force) = (0.1, 0.002, 1e-4);
    let inertia = f64::powi(height, 3) / 12.0;
    let lambda = (k / (4.0 * E * inertia)).powf(0.25);
    let half = 8.0 / lambda;
    let x: Vec<f64> = (0..=120).map(|i| half * f64::from(i) / 120.0).collect();
    let text = json!({
        "analysis": {"kind": "plane_stress", "thickness": 1},
        "mesh": {"grid": {"x": x, "y": [0, height]}},
        "materials": [{"youngs_modulus": E, "poissons_ratio": 0}],
        "supports": [{"boundary": "left", "ux": 0}, {"boundary": "bottom", "stiffness": {"normal": k}}],
        "loads": [{"boundary": "left", "traction": [0, -0.5 * force / height]}],
    });
    let solution = solve(&problem(&text.to_string()));
    let deepest = at(&solution, [0.0, 0.0])[1];
    let expected = -0.5 * force * lambda / k;
    // shear adds about (λh)²
    held(
        0,
        "Hetényi's beam on an elastic foundation, deflection under the force",
        "120 elements",
        deepest,
        expected,
        0.01,
    );
}

/// Springs at the nodes of a set: forces per length at each, in axisymmetry of the whole circle. Refinement adds none.
#[test]
fn springs_at_nodes_are_counted_once_each() {
    let nodes: Vec<[f64; 2]> = vec![
        [0.0, 0.0],
        [2.0, 0.0],
        [2.0, 1.0],
        [0.0, 1.0],
        [1.0, 0.0],
        [2.0, 0.5],
        [1.0, 1.0],
        [0.0, 0.5],
    ];
    for (analysis, force) in [
        (json!({"kind": "plane_strain"}), 3.0 * 2.0),
        (
            json!({"kind": "axisymmetric"}),
            3.0 * std::f64::consts::PI * 4.0,
        ),
    ] {
        for refine in [0, 1] {
            let text = json!({
                "analysis": analysis,
                "mesh": {"inline": {"nodes": nodes, "elements": [[0, 1, 2, 3, 4, 5, 6, 7]],
                    "boundaries": {"left": [[3, 0, 7]]}, "node_sets": {"feet": [0, 1]}}, "refine": refine},
                "materials": [{"youngs_modulus": 1e9, "poissons_ratio": 0}],
                "supports": [{"boundary": "left", "ux": 0}, {"nodes": "feet", "stiffness": {"y": 50}}],
                "loads": [{"body_force": [0, -3]}],
            });
            let solution = solve(&problem(&text.to_string()));
            let fields = &solution.fields;
            let feet = [0usize, 1].map(|node| -50.0 * fields.uy[node]);
            close(feet[0] + feet[1], force, 1e-6);
        }
    }
}

/// Springs hold what they act against, and no more; what is wrong with them is told.
#[test]
fn springs_hold_the_body_and_their_faults_are_told() {
    let plane = json!({"kind": "plane_strain"});
    let free = |stiffness: Value| {
        let supports = json!([{"boundary": "bottom", "stiffness": stiffness}]);
        let problem = block(
            &plane,
            supports,
            json!({"loads": [{"boundary": "top", "pressure": 1}]}),
        );
        match Model::new(&problem, None) {
            Ok(_) => String::new(),
            Err(list) => list
                .iter()
                .map(|v| format!("{} {}", v.pointer, v.got))
                .collect(),
        }
    };
    assert_eq!(free(json!({"normal": 1, "tangential": 1})), "");
    assert_eq!(free(json!({"x": 1, "y": 1})), "");
    let along = free(json!({"normal": 1}));
    assert!(
        along.starts_with("/supports a body free to move: along x"),
        "{along}"
    );
    let faults = free(json!({"normal": -1}));
    assert!(
        faults.contains("/supports/0/stiffness/normal -1"),
        "{faults}"
    );
    assert!(free(json!({})).contains("no stiffness above 0"));
    let text = json!({
        "analysis": plane,
        "mesh": {"inline": {"nodes": [[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0], [1, 0.5], [0.5, 1], [0, 0.5]],
            "elements": [[0, 1, 2, 3, 4, 5, 6, 7]], "boundaries": {"left": [[3, 0, 7]]}, "node_sets": {"feet": [0, 1]}}},
        "materials": [{"youngs_modulus": E, "poissons_ratio": 0}],
        "supports": [{"nodes": "feet", "stiffness": {"normal": 5}}],
    });
    let list = Model::new(&problem(&text.to_string()), None).unwrap_err();
    assert!(
        list.iter().any(|v| v.got.contains("on a set of nodes")),
        "{list:?}"
    );
}
