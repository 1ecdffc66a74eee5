//! Contact nodes whose two directions are not perpendicular: the corner between two contacts, and a sloping obstacle at a
//! line of symmetry.

use serde_json::{Value, json};
use solver::model::Model;
use solver::solution::{Outcome, Solution};

use crate::input::{pair, violations};
use crate::support::{Lattice, problem, solve};

/// A parallelogram of 4 × 3 elements with sides of length 1, one turned by `turn` and the next at `angle` to it (degrees),
/// pressed into a corner of that angle by a pressure of 5 on the other two sides.
fn pressed(turn: f64, angle: f64, contact: &Value) -> Value {
    let line = |i: usize| (i as f64 / 8.0, i as f64 / 6.0);
    let [(b, a), (d, c)] = [turn, turn + angle].map(|angle| angle.to_radians().sin_cos());
    let body = Lattice::new(4, 3, |i, j| {
        let (u, v) = (line(i).0, line(j).1);
        [a * u + c * v, b * u + d * v]
    });
    let side = |name: &str| {
        let mut contact = contact.clone();
        (contact["boundary"], contact["obstacle"]) =
            (json!(name), json!({"kind": "flat", "along": "arc_length"}));
        contact
    };
    json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"inline": {"nodes": body.nodes, "elements": body.elements, "boundaries": {
            "floor": body.edges(4, |k| (k, 0)), "ceiling": body.edges(4, |k| (k, 6)),
            "wall": body.edges(3, |k| (0, k)), "face": body.edges(3, |k| (8, k)),
        }}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "loads": [{"boundary": "ceiling", "pressure": 5}, {"boundary": "face", "pressure": 5}],
        "contacts": [side("floor"), side("wall")],
    })
}

fn solved(value: &Value) -> Solution {
    solve(&problem(&value.to_string()))
}

/// Without friction the stress is -5 everywhere, and the body shrinks towards the corner: exact for the elements, so to
/// rounding, in a right angle, an acute and an obtuse one, whatever the directions of the walls.
#[test]
fn a_block_in_a_corner_has_the_uniform_pressure_of_its_load() {
    for (turn, angle) in [(0.0, 90.0), (30.0, 90.0), (0.0, 60.0), (-17.0, 130.0)] {
        for normal in ["body", "obstacle"] {
            let solution = solved(&pressed(turn, angle, &json!({"normal": normal})));
            for name in ["floor", "wall"] {
                let stress = &solution.node_profiles[name].normal_stress;
                let off = stress
                    .iter()
                    .fold(0.0f64, |off, s| off.max((s + 5.0).abs()));
                assert!(off < 1e-8, "{turn} {angle} {name}: {stress:?}");
                let force = solution.summary.contacts[name].normal_force;
                assert!((force - 5.0).abs() < 1e-8, "{turn} {angle} {name}: {force}");
                // (1 + ν)(1 − 2ν)/E · 5 towards the corner
                let profile = &solution.node_profiles[name];
                for ((x, y), u) in profile
                    .x
                    .iter()
                    .zip(&profile.y)
                    .zip(&profile.tangential_displacement)
                {
                    let distance = x.hypot(*y);
                    assert!((u.abs() - 5.0 * 1.3 * 0.4 / 1000.0 * distance).abs() < 1e-10);
                }
            }
            assert!(solution.summary.residuals.equilibrium < 1e-9);
            let sharp =
                |w: &solver::solution::Warning| w.code == solver::solution::WarningCode::SharpEdge;
            // at the free ends of the walls where the body's angle there is obtuse, and never in the corner
            let found = solution
                .summary
                .warnings
                .iter()
                .filter(|w| sharp(w))
                .count();
            assert_eq!(found, if angle < 90.0 { 2 } else { 0 }, "{turn} {angle}");
        }
    }
}

/// A square is symmetric about its diagonal: both walls bear the same, friction points away from the corner, and the
/// forces on the whole body are in balance (wall + friction on the floor = load). Tolerances: those of the iterations.
#[test]
fn both_walls_of_a_corner_bear_the_same_and_balance_the_load() {
    for points in ["gauss3", "nodal"] {
        for (radius, history) in [(0.0, "total"), (0.2, "total"), (0.2, "incremental")] {
            let friction = json!({"coefficient": 0.3, "nonlocal_radius": radius, "elastic_slip": 1e-4, "points": points, "history": history});
            let mut value = pressed(0.0, 90.0, &json!({"friction": friction}));
            // the same lines both ways
            let body = Lattice::new(4, 4, |i, j| [i as f64 / 8.0, j as f64 / 8.0]);
            value["mesh"] = json!({"inline": {"nodes": body.nodes, "elements": body.elements, "boundaries": {
                "floor": body.edges(4, |k| (k, 0)), "ceiling": body.edges(4, |k| (k, 8)),
                "wall": body.edges(4, |k| (0, k)), "face": body.edges(4, |k| (8, k)),
            }}});
            let solution = solved(&value);
            let [floor, wall] = ["floor", "wall"].map(|name| &solution.summary.contacts[name]);
            let what = format!("{points}, ρ = {radius}, {history}: {floor:?} {wall:?}");
            assert!(
                (floor.normal_force - wall.normal_force).abs() < 1e-7,
                "{what}"
            );
            // t runs along −x on the floor and along y on the wall
            assert!(
                (floor.tangential_force + wall.tangential_force).abs() < 1e-7,
                "{what}"
            );
            assert!(wall.tangential_force > 0.5, "{what}");
            assert!(
                (wall.normal_force - floor.tangential_force - 5.0).abs() < 1e-7,
                "{what}"
            );
            assert!(solution.summary.residuals.equilibrium < 1e-9, "{what}");
            let profile = &solution.node_profiles["wall"];
            let mirrored = &solution.node_profiles["floor"].normal_stress;
            let pairs = profile.normal_stress.iter().zip(mirrored.iter().rev());
            assert!(
                pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-6),
                "{profile:?}"
            );
        }
    }
}

/// Pressed into one wall and pulled off the other, the corner node follows one law alone: the wall bears the load, and the
/// floor nothing.
#[test]
fn a_corner_opens_on_one_side() {
    let mut value = pressed(0.0, 90.0, &json!({}));
    value["loads"] = json!([{"boundary": "face", "pressure": 5}]);
    value["contacts"][0]["indentation"] = json!(-0.01);
    value["supports"] = json!([{"boundary": "ceiling", "uy": 0}]);
    let solution = solved(&value);
    let force = |name: &str| solution.summary.contacts[name].normal_force;
    assert!((force("wall") - 5.0).abs() < 1e-9 && force("floor") == 0.0);
}

/// A square that a roller holds on the left is pressed down between a floor and a wall on the right, each with friction: in no
/// load step does a node of either pass its obstacle, whichever of the two the common node is of.
#[test]
fn no_node_of_a_corner_passes_an_obstacle() {
    let nodal = [true, false];
    let cases = [
        // (friction, indentations, pressure, radius, friction at nodes, end of the first step)
        ([0.5, 0.5], [0.0, -0.003], 10.0, 0.1, [false; 2], None),
        ([0.2, 0.1], [-0.005, 0.014], 2.0, 0.1, [false; 2], None),
        ([0.6, 0.2], [-0.003, 0.009], 10.0, 0.0, [false; 2], None),
        ([0.2, 0.8], [0.002, 0.001], 10.0, 0.0, nodal, None),
        ([0.4, 0.5], [-0.004, 0.007], 2.0, 0.0, [false; 2], None),
        // only at the end of the first of two steps, after which the body opens
        (
            [0.3, 0.2],
            [0.011, -0.003],
            10.0,
            0.0,
            nodal,
            Some([0.5, 0.2]),
        ),
        (
            [0.7, 0.4],
            [0.018, -0.004],
            10.0,
            0.0,
            nodal,
            Some([0.5, 0.2]),
        ),
        (
            [0.4, 0.5],
            [-0.001, 0.02],
            10.0,
            0.0,
            nodal,
            Some([0.5, 0.5]),
        ),
    ];
    for (coefficients, indentations, pressure, radius, nodal, steps) in cases {
        let contact = |k: usize, boundary: &str| {
            json!({
                "boundary": boundary, "obstacle": {"kind": "flat", "along": "arc_length"}, "indentation": indentations[k],
                "friction": {
                    "coefficient": coefficients[k], "nonlocal_radius": radius, "elastic_slip": 1e-3,
                    "points": if nodal[k] { "nodal" } else { "gauss3" },
                },
            })
        };
        let mut value = json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {
                "grid": {"x": [0, 0.25, 0.5, 0.75, 1], "y": [0, 0.25, 0.5, 0.75, 1]},
                "boundaries": {"floor": {"side": "bottom"}, "wall": {"side": "right"}},
            },
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "left", "ux": 0}],
            "loads": [{"boundary": "top", "pressure": pressure}],
            "contacts": [contact(0, "floor"), contact(1, "wall")],
        });
        if let Some([indentation, loads]) = steps {
            value["steps"] = json!([{"indentation": indentation}, {"loads": loads}]);
        }
        let solution = solved(&value);
        assert!(solution.summary.outcome == Outcome::Converged);
        let earlier = solution.steps.iter().map(|step| &step.node_profiles);
        for (name, profile) in earlier.chain([&solution.node_profiles]).flatten() {
            let nodes = profile.normal_displacement.iter().zip(&profile.gap);
            for (k, (u, gap)) in nodes.enumerate() {
                assert!(
                    *u <= gap + 1e-10,
                    "{name}, node {k}: {:.1e} beyond the obstacle in {value}",
                    u - gap
                );
            }
        }
    }
}

/// Half a block under an obstacle that slopes at its line of symmetry is half of the block under a wedge: the same
/// displacements, to the tolerance of the iterations; u_y ≤ gap / cos θ is the same condition along either normal there.
#[test]
fn a_slope_at_a_line_of_symmetry_is_half_of_a_wedge() {
    let lines = [0.0, 0.05, 0.1, 0.15, 0.2, 0.3, 0.5, 0.8, 1.2, 2.0];
    let mut whole: Vec<f64> = lines[1..].iter().rev().map(|x| -x).collect();
    whole.extend(lines);
    let text = |x: &[f64], obstacle: Value, supports: Value, friction: Value| {
        let mut value = json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"grid": {"x": x, "y": [-2, -1, -0.5, -0.2, -0.1, 0]}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": supports,
            "contacts": [{"boundary": "top", "normal": "obstacle", "obstacle": obstacle, "indentation": 0.02}],
        });
        if !friction.is_null() {
            value["contacts"][0]["friction"] = friction;
        }
        value
    };
    let base = json!({"boundary": "bottom", "ux": 0, "uy": 0});
    let middle = json!({"boundary": "left", "ux": 0});
    let tilted = json!({"kind": "tilted", "slope": 10f64.to_radians().tan()});
    let half = |friction: Value| {
        solved(&text(
            &lines,
            tilted.clone(),
            json!([base, middle]),
            friction,
        ))
    };
    let (one, both) = (
        half(Value::Null),
        solved(&text(
            &whole,
            json!({"kind": "wedge", "angle": 10}),
            json!([base]),
            Value::Null,
        )),
    );
    assert!(one.summary.normal_force > 1.0);
    let mut compared = 0;
    for n in 0..one.fields.x.len() {
        let here = |m: &usize| {
            both.fields.x[*m] == one.fields.x[n] && both.fields.y[*m] == one.fields.y[n]
        };
        let m = (0..both.fields.x.len()).find(here).unwrap();
        let off =
            (one.fields.ux[n] - both.fields.ux[m]).hypot(one.fields.uy[n] - both.fields.uy[m]);
        assert!(off < 1e-9, "node {n}: {off:.1e}");
        compared += 1;
    }
    assert!(compared > 100);
    assert!(one.summary.residuals.equilibrium < 1e-9);
    // with friction: the forces are in balance, and more than without
    for points in ["gauss3", "nodal"] {
        let friction = json!({"coefficient": 0.3, "nonlocal_radius": 0.05, "elastic_slip": 1e-4, "points": points});
        let rough = half(friction);
        assert!(rough.summary.residuals.equilibrium < 1e-9);
        assert!(
            rough.summary.friction_force > 0.05 * rough.summary.normal_force,
            "{:#?}",
            rough.summary
        );
    }
}

#[test]
fn corners_that_cannot_be_solved_are_refused() {
    let shared = [pair("/contacts/1/boundary", "shared_node")];
    let refusals = |value: &Value| violations(&problem(&value.to_string()));
    // two pieces of one side
    let flat = json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grid": {"x": [0, 1, 2], "y": [0, 1]},
            "boundaries": {"a": {"side": "top", "x": [0, 1]}, "b": {"side": "top", "x": [1, 2]}}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
        "contacts": [{"boundary": "a", "obstacle": {"kind": "flat"}}, {"boundary": "b", "obstacle": {"kind": "flat"}}],
    });
    assert_eq!(refusals(&flat), shared);
    let mut corner = pressed(0.0, 90.0, &json!({}));
    corner["contacts"][1]["condition"] = json!("bonded");
    assert_eq!(refusals(&corner), shared);
    corner["contacts"][1]["condition"] = json!("unilateral");
    corner["solver"] = json!({"algorithm": "thesis"});
    assert!(refusals(&corner).contains(&shared[0]));
    // a support of the corner along one wall is a support along the normal of the other; at 45° it is along neither
    let mut corner = pressed(45.0, 90.0, &json!({}));
    corner["mesh"]["inline"]["node_sets"] = json!({"tip": [0]});
    corner["supports"] = json!([{"nodes": "tip", "ux": 0}]);
    let oblique = [0, 1].map(|i| pair(&format!("/contacts/{i}/boundary"), "oblique_support"));
    assert_eq!(refusals(&corner), oblique);
    let mut corner = pressed(0.0, 90.0, &json!({}));
    corner["mesh"]["inline"]["node_sets"] = json!({"tip": [0]});
    corner["supports"] = json!([{"nodes": "tip", "ux": 0}]);
    assert!(Model::new(&problem(&corner.to_string()), None).is_ok());
    let force = solved(&corner).summary.contacts["wall"].normal_force;
    // the tip's own share is borne by its support: a sixth of an edge of 1/3
    assert!((force - 5.0 * (1.0 - 1.0 / 18.0)).abs() < 1e-8, "{force}");
}
