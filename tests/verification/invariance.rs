//! docs/verification.md, row 24: units, mirrors and numbering change nothing.

use serde_json::{Value, json};
use solver::problem::{Algorithm, Elasticity, Problem};

use crate::record::held;
use crate::support::{Lattice, example, problem, solve};

/// The problem with all its lengths times `length` and all its stresses times `stress`.
fn scaled(problem: &Problem, length: f64, stress: f64) -> Problem {
    let mut value = serde_json::to_value(problem).unwrap();
    fn multiply(value: &mut Value, factor: f64) {
        match value {
            Value::Number(number) => *value = json!(number.as_f64().unwrap() * factor),
            Value::Array(items) => items.iter_mut().for_each(|item| multiply(item, factor)),
            Value::Object(fields) => fields.values_mut().for_each(|item| multiply(item, factor)),
            _ => {}
        }
    }
    let mut apply = |pointer: &str, factor: f64| {
        if let Some(value) = value.pointer_mut(pointer) {
            multiply(value, factor);
        }
    };
    for pointer in [
        "/analysis/thickness",
        "/mesh/grid/x",
        "/mesh/grid/top",
        "/mesh/boundaries/taper/x",
        "/supports/0/ux",
        "/supports/1/ux",
        "/contacts/0/indentation",
        "/contacts/0/obstacle/from",
        "/contacts/0/obstacle/to",
        "/contacts/0/obstacle/radius",
        "/contacts/0/obstacle/center",
        "/contacts/0/friction/nonlocal_radius",
        "/contacts/0/friction/elastic_slip",
    ] {
        apply(pointer, length);
    }
    // the y lines of a strip are fractions of its height
    if problem.mesh.grid().unwrap().top.is_none() {
        apply("/mesh/grid/y", length);
    }
    apply("/materials/0/youngs_modulus", stress);
    serde_json::from_value(value).unwrap()
}

/// Scales are no powers of two, so bits differ; 1e-9 is what the tolerance leaves of forces.
#[test]
fn units_change_no_iteration_and_scale_the_result() {
    for name in suite::EXAMPLES {
        for algorithm in [Algorithm::Auto, Algorithm::Newton] {
            let mut original = example(name);
            original.solver.algorithm = algorithm;
            let reference = solve(&original).summary;
            for (length, stress) in [
                (1e6, 1.0),
                (1e-6, 1.0),
                (1.0, 1e6),
                (1.0, 1e-6),
                (1e6, 1e-6),
            ] {
                let summary = solve(&scaled(&original, length, stress)).summary;
                assert_eq!(
                    (summary.iterations, summary.stage),
                    (reference.iterations, reference.stage),
                    "{name} by {algorithm:?}, lengths × {length:e}, stresses × {stress:e}"
                );
                let dimension = match original.analysis {
                    solver::problem::Analysis::PlaneStrain {} => length,
                    _ => length * length,
                };
                let force = dimension * stress;
                let what = format!("{name}: T with lengths × {length:e}, stresses × {stress:e}");
                let mesh = format!("thesis mesh, {algorithm:?}");
                let scaled_back = summary.tangential_force / force;
                held(
                    24,
                    &what,
                    &mesh,
                    scaled_back,
                    reference.tangential_force,
                    1e-9,
                );
            }
        }
    }
}

/// Example 1 with a load and a traction, all stresses times 1e±6: loads scale too.
#[test]
fn loads_scale_with_the_modulus() {
    let loaded = |stress: f64| {
        let mut p = example("rectangular_punch");
        p.materials[0].elasticity = Elasticity::Isotropic {
            youngs_modulus: 1000.0 * stress,
            poissons_ratio: 0.3,
        };
        let load = json!({"boundary": "right", "pressure": [3.0 * stress, 1.0 * stress]});
        p.loads = vec![serde_json::from_value(load).unwrap()];
        solve(&p).summary
    };
    let reference = loaded(1.0);
    for stress in [1e6, 1e-6] {
        let summary = loaded(stress);
        assert_eq!(summary.iterations, reference.iterations);
        let force = summary.tangential_force / stress;
        held(
            24,
            &format!("loads and modulus × {stress:e}: T"),
            "example 1",
            force,
            reference.tangential_force,
            1e-9,
        );
    }
}

/// A block of 4 × 2 under a wedge off its middle, dragged along; `mirror` turns x and the drag round.
fn block(mirror: f64, order: &dyn Fn(usize, usize) -> usize) -> Problem {
    let (columns, rows) = (16, 4);
    let lattice = Lattice::new(columns, rows, |i, j| {
        [
            mirror * (i as f64 / 8.0 - 2.0 + mirror * 0.0),
            j as f64 / 4.0,
        ]
    });
    let place = |node: usize| order(node, lattice.nodes.len());
    let mut nodes = vec![[0.0; 2]; lattice.nodes.len()];
    lattice
        .nodes
        .iter()
        .enumerate()
        .for_each(|(n, x)| nodes[place(n)] = *x);
    let turn = |e: &[usize; 8]| {
        if mirror < 0.0 {
            [e[1], e[0], e[3], e[2], e[4], e[7], e[6], e[5]]
        } else {
            *e
        }
    };
    let mut elements: Vec<[usize; 8]> = lattice
        .elements
        .iter()
        .map(|e| turn(e).map(place))
        .collect();
    let count = elements.len();
    let shuffled: Vec<[usize; 8]> = (0..count).map(|e| elements[order(e, count)]).collect();
    elements = shuffled;
    let edges = |at: &dyn Fn(usize) -> (usize, usize)| -> Vec<[usize; 3]> {
        lattice
            .edges(columns, at)
            .into_iter()
            .map(|edge| edge.map(place))
            .collect()
    };
    problem(
        &json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"inline": {"nodes": nodes, "elements": elements,
                "boundaries": {"top": edges(&|k| (k, 2 * rows)), "base": edges(&|k| (k, 0))}}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "base", "ux": 0, "uy": 0}],
            "contacts": [{"boundary": "top", "indentation": 0.05, "tangential_displacement": 0.003 * mirror,
                "obstacle": {"kind": "parabola", "radius": 3, "center": 0.3 * mirror},
                "friction": {"coefficient": 0.4, "nonlocal_radius": 0.1, "elastic_slip": 1e-3}}]
        })
        .to_string(),
    )
}

fn in_order(n: usize, _: usize) -> usize {
    n
}

#[test]
fn a_mirrored_problem_has_the_mirrored_result() {
    let (left, right) = (
        solve(&block(1.0, &in_order)),
        solve(&block(-1.0, &in_order)),
    );
    let (a, b) = (&left.summary, &right.summary);
    assert!(a.tangential_force.abs() > 0.1 && a.iterations == b.iterations);
    held(
        24,
        "mirrored: Y",
        "block of 64 elements",
        b.normal_force,
        a.normal_force,
        1e-11,
    );
    held(
        24,
        "mirrored: T",
        "block of 64 elements",
        b.tangential_force,
        -a.tangential_force,
        1e-9,
    );
    let (p, q) = (&left.node_profiles["top"], &right.node_profiles["top"]);
    let largest = p.normal_stress.iter().fold(0.0f64, |m, s| m.max(s.abs()));
    for (i, stress) in p.tangential_stress.iter().enumerate() {
        let other = q.s.len() - 1 - i;
        assert!((stress + q.tangential_stress[other]).abs() < 1e-8 * largest);
        assert!((p.normal_stress[i] - q.normal_stress[other]).abs() < 1e-8 * largest);
    }
}

#[test]
fn renumbered_nodes_and_elements_give_the_same_result() {
    let reference = solve(&block(1.0, &in_order)).summary;
    // 11 and 7 have no factor in common with the counts (233 and 64)
    let shuffle = |n: usize, count: usize| (n * if count == 64 { 7 } else { 11 } + 5) % count;
    let summary = solve(&block(1.0, &shuffle)).summary;
    assert_eq!(summary.iterations, reference.iterations);
    held(
        24,
        "renumbered: Y",
        "block of 64 elements",
        summary.normal_force,
        reference.normal_force,
        1e-11,
    );
    held(
        24,
        "renumbered: T",
        "block of 64 elements",
        summary.tangential_force,
        reference.tangential_force,
        1e-9,
    );
}
