//! Rigid obstacles under loads. Source: the duality of loads and displacements; the half-space under an eccentric flat punch,
//! whose tilt is 4Pe/(πE*a²); Hertz. Goal: the motions that loads cause are those that cause the loads, to 1e-8, and the stated
//! errors of the motions hold.

use serde_json::{Value, json};
use solver::error::SolveError;
use solver::family::{Family, Start};
use solver::solution::{ContactSummary, QuantityName, Solution, WarningCode};

use crate::record::held;
use crate::support::{graded, problem, solve, union};

/// A whole block of half-width and depth `size` under an obstacle over its middle, with elements of size `h` there.
fn block(size: f64, h: f64, contact: &Value) -> Value {
    let fine: Vec<f64> = (0..=(1.2 / h).round() as usize)
        .map(|k| k as f64 * h)
        .collect();
    let right = union(&[fine, graded(1.2, size, h, 1.5)]);
    let left: Vec<f64> = right[1..].iter().rev().map(|x| -x).collect();
    let x = [left, right].concat();
    let y: Vec<f64> = graded(0.0, -size, h, 1.5).into_iter().rev().collect();
    json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grid": {"x": x, "y": y}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
        "contacts": [contact],
        "solver": {"tolerance": 1e-12},
    })
}

/// Grid lines that are graded to the edges of a punch of half-width `a`.
fn to_the_edges(a: f64, size: f64) -> Vec<f64> {
    let h = 1e-3;
    let inside: Vec<f64> = graded(a, 0.0, h, 1.4).into_iter().rev().collect();
    let right = union(&[inside, graded(a, size, h, 1.4)]);
    let left: Vec<f64> = right[1..].iter().rev().map(|x| -x).collect();
    [left, right].concat()
}

fn merged(mut value: Value, more: Value) -> Value {
    let (Some(into), Value::Object(more)) = (value.as_object_mut(), more) else {
        panic!("two objects");
    };
    into.extend(more);
    value
}

fn top(solution: &Solution) -> &ContactSummary {
    &solution.summary.contacts["top"]
}

fn solved(value: &Value) -> Solution {
    let solution = solve(&problem(&value.to_string()));
    assert!(
        solution.summary.converged,
        "{:?}",
        solution.summary.warnings
    );
    solution
}

/// The violations of a problem, as pointers.
fn refused(value: &Value) -> Vec<String> {
    match solver::prepare(&problem(&value.to_string()), None, &mut ()) {
        Err(SolveError::Invalid(violations)) => violations.into_iter().map(|v| v.pointer).collect(),
        Err(error) => panic!("{error}"),
        Ok(_) => Vec::new(),
    }
}

fn law() -> Value {
    json!({"coefficient": 0.3, "nonlocal_radius": 0.1, "elastic_slip": 2e-3})
}

/// By displacement and tilt; then the force and the moment that these need, as loads, one, two or all three of them: the same
/// motions, forces and profiles.
#[test]
fn loads_cause_the_motions_that_need_them() {
    let parabola = json!({"boundary": "top", "obstacle": {"kind": "parabola", "radius": 8}, "friction": law(), "about": [0, 0]});
    let flat = json!({"boundary": "top", "obstacle": {"kind": "flat", "from": -0.6, "to": 0.6}, "friction": law(), "about": [0.1, 0.3]});
    let frictionless = json!({"boundary": "top", "obstacle": {"kind": "flat", "from": -0.6, "to": 0.6}, "about": [0, 0]});
    let bonded = json!({"boundary": "top", "obstacle": {"kind": "flat", "from": -0.6, "to": 0.6}, "condition": "bonded", "about": [0, 0]});
    for (name, base, [y, x, tilt]) in [
        ("parabola", &parabola, [0.18, 0.01, 1e-9]),
        ("tilted parabola", &parabola, [0.18, -0.004, 0.01]),
        ("flat", &flat, [0.02, 0.001, -0.004]),
        ("frictionless", &frictionless, [0.02, 0.0, 0.01]),
        ("bonded", &bonded, [0.01, 0.02, 0.003]),
    ] {
        let given = json!({"indentation": y, "tangential_displacement": x, "tilt": tilt});
        let first = solved(&block(6.0, 0.1, &merged(base.clone(), given)));
        let contact = top(&first);
        let [fx, fy] = contact.force.unwrap();
        let loads = [-fy, fx, contact.moment.unwrap()];
        let motions = [y, x, tilt];
        for free in 1..8u32 {
            // without friction nothing holds an obstacle against sliding
            if name == "frictionless" && free & 2 > 0 {
                continue;
            }
            let fields = [
                ["indentation", "normal_force"],
                ["tangential_displacement", "tangential_force"],
                ["tilt", "moment"],
            ];
            let mut given = json!({});
            for (k, [motion, load]) in fields.into_iter().enumerate() {
                match free & (1 << k) > 0 {
                    true => given[load] = loads[k].into(),
                    false => given[motion] = motions[k].into(),
                }
            }
            let second = solved(&block(6.0, 0.1, &merged(base.clone(), given.clone())));
            let found = top(&second);
            let pairs = [
                (found.indentation, y, 1e-8 * y),
                (found.tangential_displacement, x, 1e-8 * y),
                (found.tilt, tilt, 1e-8 * y),
                (found.moment, loads[2], 1e-8 * loads[0].abs()),
                (found.force.map(|f| f[0]), fx, 1e-8 * loads[0].abs()),
                (found.force.map(|f| f[1]), fy, 1e-8 * loads[0].abs()),
                (
                    Some(found.normal_force),
                    contact.normal_force,
                    1e-8 * loads[0].abs(),
                ),
                (
                    Some(found.friction_force),
                    contact.friction_force,
                    1e-8 * loads[0].abs(),
                ),
                (
                    Some(second.summary.strain_energy.unwrap()),
                    first.summary.strain_energy.unwrap(),
                    1e-7 * first.summary.strain_energy.unwrap(),
                ),
            ];
            for (k, (value, right, tolerance)) in pairs.into_iter().enumerate() {
                let off = (value.unwrap() - right).abs();
                assert!(
                    off <= tolerance,
                    "{name} {given} {k}: {value:?} for {right}"
                );
            }
            let (a, b) = (&first.node_profiles["top"], &second.node_profiles["top"]);
            for i in 0..a.s.len() {
                let near = |a: f64, b: f64, size: f64| (a - b).abs() <= 1e-7 * size;
                assert!(near(a.gap[i], b.gap[i], 1.0), "{name} {given} gap {i}");
                assert!(
                    near(a.normal_displacement[i], b.normal_displacement[i], 1.0)
                        && near(
                            a.tangential_displacement[i],
                            b.tangential_displacement[i],
                            1.0
                        ),
                    "{name} {given} u {i}"
                );
                assert!(
                    near(a.normal_stress[i], b.normal_stress[i], 1e3),
                    "{name} {given} p {i}"
                );
            }
            assert!(second.summary.residuals.equilibrium < 1e-9);
        }
    }
}

/// A flat punch under an eccentric force: forces and moments balance, and it tilts as on a half-space.
#[test]
fn an_eccentric_punch_tilts_as_on_a_half_space() {
    let (a, p) = (0.5, 100.0);
    let e_star = 1000.0 / 0.91;
    for e in [0.1, 0.25, -0.2] {
        let contact = json!({"boundary": "top", "obstacle": {"kind": "flat", "from": -a, "to": a},
            "normal_force": p, "moment": -p * e, "about": [0, 0]});
        let mut punch = block(20.0, 0.05, &contact);
        let y: Vec<f64> = graded(0.0, -20.0, 1e-3, 1.4).into_iter().rev().collect();
        punch["mesh"]["grid"] = json!({"x": to_the_edges(a, 20.0), "y": y});
        let solution = solved(&punch);
        let contact = top(&solution);
        assert!((contact.normal_force / p - 1.0).abs() < 1e-10);
        assert!((contact.moment.unwrap() + p * e).abs() < 1e-10 * p);
        // positive e is to the right, where the punch goes down: clockwise
        let exact = -4.0 * p * e / (std::f64::consts::PI * e_star * a * a);
        held(
            26,
            &format!("eccentric flat punch, a .5, P 100, e {e}: tilt 4Pe/(πE*a²)"),
            "block of 20, graded to the edges by 10⁻³",
            contact.tilt.unwrap(),
            exact,
            2e-3,
        );
        let accuracy = solution.summary.accuracy.as_ref().unwrap();
        let tilt = accuracy
            .quantities
            .iter()
            .find(|q| q.quantity == QuantityName::Tilt);
        let tilt = tilt.unwrap();
        assert!((tilt.value - exact).abs() <= tilt.error.unwrap() + 2e-3 * exact.abs());
        assert!(tilt.error.unwrap() < 0.05 * exact.abs(), "{:?}", tilt.error);
    }
}

/// The motions on a coarse mesh lie within their stated errors of those on a fine one.
#[test]
fn motions_are_within_their_stated_errors() {
    let cases = [
        json!({"boundary": "top", "obstacle": {"kind": "parabola", "radius": 8}, "normal_force": 60, "friction": law()}),
        json!({"boundary": "top", "obstacle": {"kind": "parabola", "radius": 8}, "normal_force": 60, "tangential_force": 5, "friction": law()}),
        json!({"boundary": "top", "obstacle": {"kind": "flat", "from": -0.6, "to": 0.6}, "normal_force": 60, "tangential_force": 6, "moment": 3, "about": [0, 0], "friction": law()}),
        json!({"boundary": "top", "obstacle": {"kind": "flat", "from": -0.6, "to": 0.6}, "normal_force": 60, "tangential_force": 6, "moment": 3, "about": [0, 0], "condition": "bonded"}),
    ];
    let mut checked = 0;
    for case in &cases {
        let fine = solved(&block(6.0, 0.0125, case));
        for h in [0.2, 0.1, 0.05] {
            let coarse = solved(&block(6.0, h, case));
            let motions = |s: &Solution| {
                let contact = top(s);
                [
                    contact.indentation,
                    contact.tangential_displacement,
                    contact.tilt,
                ]
                .map(Option::unwrap)
            };
            let right = motions(&fine);
            for q in &coarse.summary.accuracy.as_ref().unwrap().quantities {
                let right = match q.quantity {
                    QuantityName::Indentation => right[0],
                    QuantityName::TangentialDisplacement => right[1],
                    QuantityName::Tilt => right[2],
                    _ => continue,
                };
                let (off, error) = ((q.value - right).abs(), q.error.unwrap());
                println!(
                    "{case} {h} {:?}: {} ± {error:.1e}, right {right}: {:.2}",
                    q.quantity,
                    q.value,
                    off / error
                );
                assert!(
                    off <= 1.05 * error + 1e-12,
                    "{case} {h} {:?}: {} ± {error} for {right}",
                    q.quantity,
                    q.value
                );
                checked += 1;
            }
        }
    }
    assert!(checked >= 24, "{checked}");
}

/// A spring between the obstacle and the ground bears its part of the load: what is left presses the body.
#[test]
fn springs_bear_their_part_of_the_loads() {
    let base = json!({"boundary": "top", "obstacle": {"kind": "flat", "from": -0.6, "to": 0.6}, "condition": "bonded", "about": [0, 0]});
    let stiffness = json!({"normal": 300, "tangential": 200, "rotational": 100});
    let loads =
        json!({"normal_force": 50, "tangential_force": -20, "moment": 8, "stiffness": stiffness});
    let solution = solved(&block(6.0, 0.2, &merged(base, loads)));
    let contact = top(&solution);
    let [fx, fy] = contact.force.unwrap();
    let left = [
        50.0 - 300.0 * contact.indentation.unwrap() + fy,
        -20.0 - 200.0 * contact.tangential_displacement.unwrap() - fx,
        8.0 - 100.0 * contact.tilt.unwrap() - contact.moment.unwrap(),
    ];
    assert!(left.iter().all(|rest| rest.abs() < 1e-9), "{left:?}");
}

/// A sphere under a force is pushed as far as the force needs; total forces and springs include 2π.
#[test]
fn a_sphere_under_a_force_moves_along_the_axis() {
    let with = |contact: Value| {
        let x = union(&[
            (0..=12).map(|k| 0.1 * f64::from(k)).collect(),
            graded(1.2, 20.0, 0.1, 1.5),
        ]);
        let y: Vec<f64> = graded(0.0, -20.0, 0.1, 1.5).into_iter().rev().collect();
        json!({
            "analysis": {"kind": "axisymmetric"},
            "mesh": {"grid": {"x": x, "y": y}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "bottom", "uy": 0}],
            "contacts": [merged(json!({"boundary": "top", "obstacle": {"kind": "parabola", "radius": 8}, "friction": law()}), contact)],
            "solver": {"tolerance": 1e-12},
        })
    };
    let first = solved(&with(json!({"indentation": 0.12})));
    let force = first.summary.normal_force;
    let second = solved(&with(json!({"normal_force": force})));
    assert!((top(&second).indentation.unwrap() / 0.12 - 1.0).abs() < 1e-8);
    assert!((second.summary.normal_force / force - 1.0).abs() < 1e-10);
    let third = solved(&with(
        json!({"normal_force": force + 500.0 * 0.12, "stiffness": {"normal": 500}}),
    ));
    assert!((top(&third).indentation.unwrap() / 0.12 - 1.0).abs() < 1e-8);
    for field in ["tangential_force", "moment"] {
        let contact = json!({"normal_force": force, field: 1, "about": [0, 0]});
        assert!(
            refused(&with(contact)).contains(&format!("/contacts/0/{field}")),
            "{field}"
        );
    }
}

/// A block on a plate under a loaded obstacle: the body itself is held by contact alone along y.
#[test]
fn a_block_between_a_plate_and_a_loaded_obstacle_is_in_equilibrium() {
    let text = json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grid": {"x": [-1, -0.6, -0.3, 0, 0.3, 0.6, 1], "y": [0, 0.25, 0.5, 0.75, 1]}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "contacts": [
            {"boundary": "bottom", "obstacle": {"kind": "flat"}, "friction": law()},
            {"boundary": "top", "obstacle": {"kind": "flat"}, "normal_force": 40, "tangential_force": 3, "friction": law()},
        ],
        "solver": {"tolerance": 1e-12},
    });
    let solution = solved(&text);
    let bottom = &solution.summary.contacts["bottom"];
    assert!((bottom.normal_force - 40.0).abs() < 1e-8);
    assert!((top(&solution).normal_force - 40.0).abs() < 1e-8);
    // t points along −x at the bottom
    assert!(
        (bottom.tangential_force - 3.0).abs() < 1e-8,
        "{}",
        bottom.tangential_force
    );
    assert!(solution.summary.residuals.equilibrium < 1e-9);
}

/// Cattaneo and Mindlin under given forces, to and fro: each step has its forces, and the obstacle returns on another way.
#[test]
fn forces_to_and_fro_draw_a_loop_of_displacements() {
    let friction = json!({"coefficient": 0.3, "nonlocal_radius": 0, "elastic_slip": 1e-4, "history": "incremental", "points": "nodal"});
    let contact = json!({"boundary": "top", "obstacle": {"kind": "parabola", "radius": 8}, "normal_force": 50, "tangential_force": 10, "friction": friction});
    let factors = [0.0, 1.0, 0.0, -1.0, 0.0, 1.0, 0.0, -1.0, 0.0, 1.0];
    let steps: Vec<Value> = factors
        .iter()
        .map(|f| json!({"tangential_force": f, "increments": 8}))
        .collect();
    let solution = solved(&merged(block(6.0, 0.1, &contact), json!({"steps": steps})));
    let mut shifts = Vec::new();
    for (step, factor) in solution.steps.iter().zip(factors) {
        let contact = &step.summary.contacts["top"];
        assert!((contact.force.unwrap()[1] + 50.0).abs() < 1e-8);
        assert!((contact.force.unwrap()[0] - 10.0 * factor).abs() < 1e-8);
        shifts.push(contact.tangential_displacement.unwrap());
    }
    let [rest, _, _, _, _, right, back, left, again, last] = shifts[..] else {
        panic!("ten steps");
    };
    let most = right.abs();
    assert!(rest.abs() < 1e-6 * most);
    // the second cycle is closed, and the way back is not the way there
    assert!((right - last).abs() < 1e-9 * most, "{shifts:?}");
    // pressing has left friction outwards, which the two ways begin from: the loop is not quite symmetric
    assert!((right + left).abs() < 0.1 * most, "{shifts:?}");
    assert!(back - again > 0.03 * most, "{shifts:?}");
}

/// What cannot be solved is refused in words before solving: at the field that is wrong, all at once.
#[test]
fn impossible_loads_are_refused_at_their_fields() {
    let flat = |more: Value| {
        let base =
            json!({"boundary": "top", "obstacle": {"kind": "flat", "from": -0.6, "to": 0.6}});
        block(6.0, 0.2, &merged(base, more))
    };
    let at = |field: &str| vec![format!("/contacts/0/{field}")];
    for (more, fields) in [
        (
            json!({"indentation": 0.1, "normal_force": 1}),
            at("normal_force"),
        ),
        (json!({"normal_force": 0}), at("normal_force")),
        (json!({"normal_force": -1}), at("normal_force")),
        (json!({"normal_force": 1, "moment": 1}), at("about")),
        (json!({"indentation": 1, "tilt": 0.1}), at("about")),
        (json!({"indentation": 1, "about": [0, 0]}), at("about")),
        (
            json!({"normal_force": 1, "stiffness": {"tangential": 1}}),
            at("stiffness/tangential"),
        ),
        (
            json!({"normal_force": 1, "stiffness": {"normal": -1}}),
            at("stiffness/normal"),
        ),
        (
            json!({"normal_force": 1, "condition": "none", "friction": {"bound": 1, "elastic_slip": 1e-3}}),
            at("condition"),
        ),
        // beyond what friction bears, or without friction
        (
            json!({"normal_force": 10, "tangential_force": 3.1, "friction": law()}),
            at("tangential_force"),
        ),
        (
            json!({"normal_force": 10, "tangential_force": -3.1, "friction": law()}),
            at("tangential_force"),
        ),
        (
            json!({"normal_force": 10, "tangential_force": 0.1}),
            at("tangential_force"),
        ),
    ] {
        assert_eq!(refused(&flat(more.clone())), fields, "{more}");
    }
    let both = json!({"indentation": 0.1, "normal_force": 1, "tilt": 0.1, "moment": 1});
    assert_eq!(refused(&flat(both)).len(), 3);
    // a curved body needs a direction
    let curved = json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"inline": {
            "nodes": [[0, 0], [1, 0], [1, 1], [0, 1.2], [0.5, 0], [1, 0.5], [0.5, 1.15], [0, 0.6]],
            "elements": [[0, 1, 2, 3, 4, 5, 6, 7]],
            "boundaries": {"bottom": [[0, 1, 4]], "top": [[2, 3, 6]]}}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
        "contacts": [{"boundary": "top", "obstacle": {"kind": "line", "point": [0, 1.2], "angle": 0}, "normal_force": 1}],
    });
    assert_eq!(refused(&curved), at("direction"));
    let mut directed = curved;
    directed["contacts"][0]["direction"] = json!([0, -2]);
    assert!(refused(&directed).is_empty());
    // half a model
    let mut half = flat(json!({"normal_force": 10, "moment": 0, "about": [0, 0]}));
    half["mesh"]["grid"]["x"] = json!([0, 0.3, 0.6, 1, 3, 6]);
    half["contacts"][0]["obstacle"]["from"] = json!(0);
    half["supports"] =
        json!([{"boundary": "left", "ux": 0}, {"boundary": "bottom", "ux": 0, "uy": 0}]);
    assert_eq!(refused(&half), at("moment"));
    // steps
    let mut steps = flat(json!({"normal_force": 10}));
    steps["steps"] = json!([{"normal_force": 1}, {"normal_force": 0}]);
    assert_eq!(refused(&steps), ["/steps/1/normal_force"]);
}

/// A force beyond the ends of a straight contact tips the obstacle over, which is refused; one inside does not, up to the end.
#[test]
fn an_obstacle_that_tips_over_is_refused() {
    let a = 0.6;
    let punch = |more: Value| {
        let base = json!({"boundary": "top", "obstacle": {"kind": "flat", "from": -a, "to": a}});
        block(6.0, 0.1, &merged(base, more))
    };
    // by where the force acts, x, with P = 10 and where there is friction T = 2 along −x or x; about any point
    for friction in [0.0, 2.0, -2.0] {
        for about in [[0.0, 0.0], [0.3, 0.0], [-5.0, 2.0], [0.1, -1.0]] {
            for (x, falls) in [
                (0.61, true),
                (-0.61, true),
                (5.0, true),
                (0.55, false),
                (-0.59, false),
            ] {
                // the force on the body: (T, −P) at (x, 0)
                let moment = -10.0 * (x - about[0]) + friction * about[1];
                let mut contact = json!({"normal_force": 10, "moment": moment, "about": about});
                if friction != 0.0 {
                    contact = merged(
                        contact,
                        json!({"tangential_force": friction, "friction": law()}),
                    );
                }
                let found = refused(&punch(contact));
                let fields: &[&str] = if falls { &["/contacts/0/moment"] } else { &[] };
                assert_eq!(found, fields, "{x} {about:?} {friction}");
            }
        }
    }
    // near an end it still stands, on a part of the contact
    let near = json!({"normal_force": 10, "moment": -5.7, "about": [0, 0], "tangential_force": 2, "friction": law()});
    let solution = solved(&punch(near));
    let part = top(&solution).contact.as_slice();
    assert!(
        matches!(part, [[start, end]] if *start > 6.0 && (end - 6.6).abs() < 1e-9),
        "{part:?}"
    );
    // on every side of a block, pushed against it: a force at e along t is the moment −P e
    for (side, held, about) in [
        ("bottom", "top", [0.0, -6.0]),
        ("left", "right", [-6.0, 0.0]),
        ("right", "left", [6.0, 0.0]),
    ] {
        for (e, falls) in [(5.9, false), (-5.9, false), (6.1, true), (-6.1, true)] {
            let mut block = block(
                6.0,
                0.5,
                &json!({"boundary": side, "obstacle": {"kind": "flat"},
                "normal_force": 10, "moment": -10.0 * e, "about": about}),
            );
            block["mesh"]["grid"]["y"] = json!([-6, -3, 0, 3, 6]);
            block["supports"] = json!([{"boundary": held, "ux": 0, "uy": 0}]);
            assert_eq!(refused(&block).is_empty(), !falls, "{side} {e}");
        }
    }
    // only at the end of a step
    let mut steps = punch(json!({"normal_force": 10, "moment": -4, "about": [0, 0]}));
    steps["steps"] = json!([{"moment": 1}, {"moment": 1.51}, {"moment": 1}]);
    assert_eq!(refused(&steps), ["/contacts/0/moment"]);
    // friction, whatever it is, of up to 3 along x, may shift the force by 0.3 only
    for (x, falls) in [(0.85, false), (0.95, true), (-0.85, false), (-0.95, true)] {
        let contact =
            json!({"normal_force": 10, "moment": -10.0 * x, "about": [0, -1], "friction": law()});
        assert_eq!(refused(&punch(contact)).is_empty(), !falls, "{x}");
    }
    // a body with a round top under a flat plate: no force beyond its normals, refused without friction and told with it
    for (force_at, law, falls) in [
        (0.3, json!(null), false),
        (0.3, law(), false),
        (1.2, json!(null), true),
        (1.2, law(), true),
    ] {
        let mut round = block(
            3.0,
            0.2,
            &json!({
                "boundary": "top", "obstacle": {"kind": "line", "point": [0, 0], "angle": 0}, "direction": [0, -1],
                "normal_force": 10, "moment": -10.0 * force_at, "about": [0, 0], "friction": law,
            }),
        );
        let x: Vec<f64> = (-4..=4).map(|k| 0.25 * f64::from(k)).collect();
        let on_circle: Vec<[f64; 2]> = x
            .iter()
            .map(|x| [*x, (25.0 - x * x).sqrt() - 5.0])
            .collect();
        round["mesh"] = json!({
            "grid": {"x": x, "y": [0, 0.5, 0.8, 1], "top": on_circle, "bottom": [[-1, -3], [1, -3]]},
            "curves": {"top": {"kind": "circle", "center": [0, -5], "radius": 5}},
            "refine": 1,
        });
        let result = solver::solve(&problem(&round.to_string()), &mut ());
        match (&result, law.is_null()) {
            (Ok(solution), _) => assert!(solution.summary.converged && !falls, "{force_at}"),
            (Err(SolveError::Invalid(violations)), true) => {
                assert!(
                    falls && violations[0].pointer == "/contacts/0/moment",
                    "{violations:?}"
                );
            }
            (Err(SolveError::ObstacleUnheld { .. }), false) => assert!(falls, "{force_at}"),
            (Err(error), _) => panic!("{error}"),
        }
    }
    // what a spring bears, or glue, does not tip it over
    for held in [
        json!({"stiffness": {"rotational": 100}}),
        json!({"condition": "bonded"}),
    ] {
        let contact = json!({"normal_force": 10, "moment": -8, "about": [0, 0]});
        assert!(refused(&punch(merged(contact, held))).is_empty());
    }
}

/// An obstacle that is held against turning states the moment that holds it, about the given point: as with a tilt of 0.
#[test]
fn a_held_obstacle_states_its_moment() {
    let punch = |more: Value| {
        let base = json!({"boundary": "top", "obstacle": {"kind": "circle", "radius": 8, "center": 0.2}, "normal_force": 10, "about": [0, 0]});
        solved(&block(6.0, 0.1, &merged(base, more)))
    };
    let (solution, tilted) = (punch(json!({})), punch(json!({"tilt": 0})));
    let [held, tilted] = [&solution, &tilted].map(top);
    let moment = held.moment.unwrap();
    assert!((moment + 2.0).abs() < 0.02, "{moment}");
    assert_eq!(held.moment, tilted.moment);
    let row = solution.history.last().unwrap();
    assert_eq!(
        row.motion.map(|m| (m.indentation, m.tilt)),
        held.indentation.zip(held.tilt)
    );
    assert_eq!(held.tilt, Some(0.0));
}

/// Members of a sweep over a force have the motions of their own jobs, and a force that friction cannot bear is refused in them, too.
#[test]
fn a_sweep_over_a_force_has_the_motions_of_its_jobs() {
    let with = |normal: f64, tangential: f64| {
        let contact = json!({"boundary": "top", "obstacle": {"kind": "parabola", "radius": 8},
            "normal_force": normal, "tangential_force": tangential, "friction": law()});
        problem(&block(6.0, 0.1, &contact).to_string())
    };
    let mut family = Family::new(&with(20.0, 1.0), None, &mut ()).unwrap();
    for (normal, tangential) in [(20.0, 1.0), (40.0, -2.0), (80.0, 5.0)] {
        let given = with(normal, tangential);
        let (member, _) = family.member(&given, Start::Anew, &mut ()).unwrap();
        let own = solve(&given);
        let own = top(&own);
        for (a, b) in [
            (member.indentation, own.indentation),
            (member.tangential_displacement, own.tangential_displacement),
            (member.tilt, own.tilt),
            (Some(member.normal_force), Some(normal)),
            (Some(member.tangential_force), Some(tangential)),
        ] {
            assert!((a.unwrap() - b.unwrap()).abs() < 1e-8, "{a:?} {b:?}");
        }
    }
    let refused = family.member(&with(20.0, 7.0), Start::Anew, &mut ());
    assert!(matches!(refused, Err(SolveError::Invalid(_))));
}

/// Where the indentation is given, what friction bears is known afterwards: an obstacle that is pulled by more slides away, and the
/// message has both forces.
#[test]
fn an_obstacle_that_is_pulled_beyond_its_friction_slides_away() {
    let contact = json!({"boundary": "top", "obstacle": {"kind": "flat", "from": -0.6, "to": 0.6},
        "indentation": 0.05, "tangential_force": 100, "friction": law()});
    let given = problem(&block(6.0, 0.1, &contact).to_string());
    let solution = solver::solve(&given, &mut ()).unwrap();
    assert!(!solution.summary.converged);
    let mut told = solution.summary.warnings.iter();
    let told = told.find(|w| w.code == WarningCode::SlidesAway).unwrap();
    assert!(
        told.message
            .contains("the obstacle of contact `top` with a force of 100.0"),
        "{}",
        told.message
    );
}

/// A force outside the punch tips it over, which is told, and never a number. A large tilt is warned of.
#[test]
fn an_obstacle_that_nothing_holds_is_told_of() {
    let flat = json!({"boundary": "top", "obstacle": {"kind": "flat", "from": -0.5, "to": 0.5}, "normal_force": 10, "about": [0, 0]});
    let tipping = block(6.0, 0.1, &merged(flat.clone(), json!({"moment": -6.0})));
    let result = solver::solve(&problem(&tipping.to_string()), &mut ());
    let told = match result {
        Err(SolveError::ObstacleUnheld { .. }) => true,
        Err(SolveError::Invalid(violations)) => violations[0].pointer == "/contacts/0/moment",
        Ok(solution) => !solution.summary.converged,
        Err(error) => panic!("{error}"),
    };
    assert!(told);
    let soft = block(
        6.0,
        0.1,
        &merged(flat, json!({"normal_force": 200, "moment": -45.0})),
    );
    let solution = solve(&problem(&soft.to_string()));
    let tilt = top(&solution).tilt.unwrap();
    let warned = solution
        .summary
        .warnings
        .iter()
        .any(|w| w.code == WarningCode::LargeTilt);
    assert_eq!(warned, tilt.abs() > 0.05, "{tilt}");
}

/// While a parabola is pressed straight down with little friction, no friction point sticks, but between slip to the left and slip to
/// the right a place does: the tangential force that follows is borne.
#[test]
fn friction_to_both_sides_holds_an_obstacle() {
    let contact = json!({
        "boundary": "top",
        "obstacle": {"kind": "parabola", "radius": 20},
        "normal_force": 39.26990816987241,
        "tangential_force": -1.5603835450825023,
        "friction": {"coefficient": 0.12383519526292633, "nonlocal_radius": 0.2, "elastic_slip": 3.75e-5, "history": "incremental"},
    });
    let mut problem = block(30.0, 0.15, &contact);
    problem["mesh"]["refine"] = json!(1);
    problem["materials"][0]["poissons_ratio"] = json!(0);
    problem["steps"] = json!([
        {"increments": 8, "spacing": "contact_width"},
        {"tangential_force": 1, "increments": 4},
    ]);
    let found = solved(&problem);
    assert!((top(&found).tangential_force + 1.5603835450825023).abs() < 1e-8);
}

fn told(solution: &Solution, code: WarningCode) -> bool {
    solution
        .summary
        .warnings
        .iter()
        .any(|warning| warning.code == code)
}

/// A circle that turns about its own centre stays where it is. Contact along the body's normals does not know that, which is told;
/// along those of the obstacle it presses as if it had not turned.
#[test]
fn a_rotation_that_shifts_a_round_obstacle_is_told() {
    let circle = |about: [f64; 2], more: Value| {
        let base = json!({"boundary": "top", "obstacle": {"kind": "circle", "radius": 8}, "normal_force": 20, "about": about});
        solved(&block(6.0, 0.1, &merged(base, more)))
    };
    for (about, more, shifts) in [
        ([0.0, 8.0], json!({"tilt": 0.02}), true),
        ([0.0, 8.0], json!({"moment": 0}), true),
        ([0.0, 2.0], json!({"tilt": 0.02}), true),
        ([0.0, 0.2], json!({"tilt": 0.02}), false),
        ([0.0, 8.0], json!({}), false),
    ] {
        let found = told(&circle(about, more.clone()), WarningCode::LargeTilt);
        assert_eq!(found, shifts, "{about:?} {more}");
    }
    let obstacle = json!({"tilt": 0.02, "normal": "obstacle", "direction": [0, -1]});
    let solution = circle([0.0, 8.0], obstacle);
    assert!(!told(&solution, WarningCode::LargeTilt));
    assert!(top(&solution).moment.unwrap().abs() < 1e-4);
}

/// What a new user met: a tilt in half a model, a direction away from the body, an obstacle that its spring holds off the body.
#[test]
fn careless_loads_are_refused_or_solved() {
    let mut half = block(
        6.0,
        0.2,
        &json!({"boundary": "top", "obstacle": {"kind": "flat", "from": 0, "to": 0.6}, "normal_force": 10, "tilt": 0.01, "about": [0, 0]}),
    );
    half["mesh"]["grid"]["x"] = json!([0, 0.3, 0.6, 1, 3, 6]);
    half["supports"] =
        json!([{"boundary": "left", "ux": 0}, {"boundary": "bottom", "ux": 0, "uy": 0}]);
    assert!(told(&solved(&half), WarningCode::SymmetricDrag));
    let flat = |more: Value| {
        let base =
            json!({"boundary": "top", "obstacle": {"kind": "flat", "from": -0.6, "to": 0.6}});
        block(6.0, 0.2, &merged(base, more))
    };
    let away = flat(json!({"normal_force": 10, "direction": [0, 1]}));
    assert_eq!(refused(&away), ["/contacts/0/direction"]);
    // glue may be pulled, and sheared
    for direction in [[0, 1], [1, 0]] {
        let glued = json!({"normal_force": 10, "direction": direction, "condition": "bonded"});
        solved(&flat(glued));
    }
    // a force is borne, however small it is beside what moves the obstacle along
    let light = flat(json!({"normal_force": 1e-10, "tangential_displacement": 0.01}));
    assert!((top(&solved(&light)).normal_force / 1e-10 - 1.0).abs() < 1e-6);
    let mut light = flat(json!({"normal_force": 10}));
    light["steps"] = json!([{"normal_force": 1e-12}, {"normal_force": 1}]);
    solved(&light);
    let pulled = solved(&flat(
        json!({"normal_force": -5, "stiffness": {"normal": 5}}),
    ));
    assert!((top(&pulled).indentation.unwrap() + 1.0).abs() < 1e-12);
    let mut fine = flat(json!({"normal_force": -5, "stiffness": {"normal": 5}}));
    fine["mesh"]["refine"] = json!(2);
    solved(&fine);
    assert!(told(&pulled, WarningCode::NoContact) && !told(&pulled, WarningCode::OutOfBalance));
    // factors on what is not there
    let mut steps = flat(json!({"normal_force": 10}));
    steps["steps"] = json!([{"indentation": 0.5}, {"moment": 1}]);
    let found = solved(&steps);
    let pointers: Vec<&str> = found
        .summary
        .warnings
        .iter()
        .map(|w| w.pointer.as_str())
        .collect();
    assert!(pointers.contains(&"/steps"), "{pointers:?}");
    steps["steps"] = json!([{"loads": 0.5}, {"moment": 1}]);
    let found = solved(&steps);
    assert!(!told(&found, WarningCode::NeverApplied));
}

/// What a stiff body beside does not bear makes nothing of what a soft one bears.
#[test]
fn a_stiff_contact_that_is_open_silences_no_soft_one() {
    let solution = solved(&json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grids": {
            "a": {"x": [0, 1, 2], "y": [0, 1]},
            "b": {"x": [5, 6, 7], "y": [0, 1]},
        }, "refine": 2},
        "materials": [
            {"group": "a", "youngs_modulus": 2e11, "poissons_ratio": 0.3},
            {"group": "b", "youngs_modulus": 1e3, "poissons_ratio": 0.3},
        ],
        "supports": [{"boundary": "a.bottom", "ux": 0, "uy": 0}, {"boundary": "b.bottom", "ux": 0, "uy": 0}],
        "contacts": [
            {"boundary": "a.top", "obstacle": {"kind": "flat"}, "indentation": -1},
            {"boundary": "b.top", "obstacle": {"kind": "flat"}, "indentation": 1e-4},
        ],
    }));
    let soft = &solution.summary.contacts["b.top"];
    assert!(soft.normal_force > 0.2, "{}", soft.normal_force);
}
