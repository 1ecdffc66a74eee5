//! Problems that ask for what the model does not have, or that have no solution: each is told in words, and what is near
//! to it and sound is not.

use serde_json::{Value, json};
use solver::model::Model;
use solver::problem::{Problem, Refine};
use solver::solution::{Outcome, Solution, Summary, Warning, WarningCode};

use crate::support::{Lattice, example, problem, quiet, solve};

/// The warning of a kind.
fn told(warnings: &[Warning], code: WarningCode) -> Option<&str> {
    let mut found = warnings.iter().filter(|w| w.code == code);
    found.next().map(|w| &w.message[..])
}

/// Solves a problem that may end in any way.
fn ended(problem: &Problem) -> Solution {
    let external = files::external_mesh(problem, None);
    solver::solve_on(problem, external, &mut quiet).unwrap()
}

#[track_caller]
fn says(text: Option<&str>, parts: &[&str]) {
    let text = text.unwrap_or("no warning");
    for part in parts {
        assert!(text.contains(part), "{part:?} in {text:?}");
    }
}

/// A block of half-width 2 on its base, all lengths times `scale`.
fn block(contact: &Value, scale: f64) -> Value {
    let x: Vec<f64> = (-20..=20).map(|k| 0.1 * scale * f64::from(k)).collect();
    let y = [-2.0, -1.0, -0.5, -0.2, 0.0].map(|y| scale * y);
    json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grid": {"x": x, "y": y}, "boundaries": {"middle": {"side": "top", "x": [-0.5 * scale, 0.5 * scale]}}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
        "contacts": [contact],
    })
}

/// A parabola pressed in so that it touches about 0.8 of the top, and dragged.
fn dragged(obstacle: &Value, drag: f64, scale: f64) -> Summary {
    let contact = json!({"boundary": "top", "obstacle": obstacle, "indentation": 0.02 * scale,
        "tangential_displacement": drag * scale,
        "friction": {"coefficient": 0.3, "nonlocal_radius": 0.2 * scale, "elastic_slip": 1e-4 * scale}});
    solve(&problem(&block(&contact, scale).to_string())).summary
}

/// Gaps are those of the places before deformation. Dragged by three lengths of the contact, the obstacle would press on
/// other material: it is told, with slip and length, once, in any unit of length; a drag of a third of it is not.
#[test]
fn a_drag_beyond_the_contact_is_reported() {
    for scale in [1.0, 1e-6, 1e6] {
        let obstacle = json!({"kind": "parabola", "radius": 8.0 * scale});
        let still = dragged(&obstacle, 0.0, scale);
        let [from, to] = still.contacts["top"].contact[0];
        let width = (to - from) / scale;
        assert!(width > 0.5 && width < 1.5, "{width}");
        let far = dragged(&obstacle, 3.0 * width, scale);
        let message = told(&far.warnings, WarningCode::LargeSlip);
        says(
            message,
            &[
                "slides along the obstacle by",
                "the contact is",
                "linear kinematics",
            ],
        );
        let numbers: Vec<f64> = message
            .unwrap()
            .split([' ', ',', ':'])
            .filter_map(|word| word.parse().ok())
            .collect();
        let [slip, length] = numbers[..] else {
            panic!("{numbers:?}")
        };
        // the body follows by a few per cent of the contact; its contact may reach a node farther on each side
        assert!(
            slip > 2.8 * width * scale && slip < 3.0 * width * scale,
            "{slip}"
        );
        assert!(
            length >= width * scale && length < (width + 0.21) * scale,
            "{length}"
        );
        for code in [WarningCode::LargeDisplacement, WarningCode::LargeStrain] {
            assert_eq!(told(&far.warnings, code), None);
        }
        let near = dragged(&obstacle, 0.3 * width, scale);
        assert_eq!(told(&near.warnings, WarningCode::LargeSlip), None);
    }
}

/// A punch, and a straight obstacle on a part of a straight side, have a place from which the body slides away; a plane
/// under a whole side has none. Nor do the examples, and their refined twins, slide too far (the sheet by .18, along a
/// contact that is .29 long at least).
#[test]
fn sliding_along_a_plane_and_in_the_examples_is_sound() {
    let large = |boundary: &str, obstacle: Value, drag: f64| {
        let contact = json!({"boundary": boundary, "obstacle": obstacle, "indentation": 0.02, "tangential_displacement": drag,
            "friction": {"coefficient": 0.3, "nonlocal_radius": 0.2, "elastic_slip": 1e-4}});
        let summary = solve(&problem(&block(&contact, 1.0).to_string())).summary;
        told(&summary.warnings, WarningCode::LargeSlip).is_some()
    };
    let punch = json!({"kind": "flat", "from": -0.5, "to": 0.5});
    let plane = json!({"kind": "flat"});
    assert!(large("top", punch.clone(), 1.5) && !large("top", punch, 0.5));
    assert!(large("middle", plane.clone(), 1.5) && !large("middle", plane.clone(), 0.5));
    assert!(!large("top", plane, 10.0));
    assert!(!large(
        "top",
        json!({"kind": "line", "point": [0, 0], "angle": 0}),
        10.0
    ));
    for name in suite::EXAMPLES {
        for refine in 0..=2 {
            let mut problem = example(name);
            problem.mesh.refine = Refine::Times(refine);
            let warnings = solve(&problem).summary.warnings;
            assert_eq!(
                told(&warnings, WarningCode::LargeSlip),
                None,
                "{name}, {refine}"
            );
        }
    }
}

/// Half a body under a drag has another half that would be dragged the opposite way; so has one that turns about an axis.
#[test]
fn a_drag_of_half_a_body_is_reported() {
    let warnings = |analysis: &str, left: Value, from: f64, drag: f64, steps: Value| {
        let mut p = json!({
            "analysis": {"kind": analysis},
            "mesh": {"grid": {"x": [0, 0.2, 0.4, 0.6, 1, 2], "y": [-2, -1, -0.5, -0.2, 0]}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": [left, {"boundary": "bottom", "ux": 0, "uy": 0}],
            "contacts": [{"boundary": "top", "obstacle": {"kind": "flat", "from": from, "to": 0.6},
                "indentation": 0.01, "tangential_displacement": drag,
                "friction": {"coefficient": 0.3, "nonlocal_radius": 0.1, "elastic_slip": 1e-4}}],
        });
        if !steps.is_null() {
            p["steps"] = steps;
        }
        Model::new(&problem(&p.to_string()), None).unwrap().warnings
    };
    let symmetric = || json!({"boundary": "left", "ux": 0});
    let half = warnings("plane_strain", symmetric(), 0.0, 0.01, Value::Null);
    let message = told(&half, WarningCode::SymmetricDrag);
    says(
        message,
        &[
            "at (0, 0)",
            "0.01",
            "the opposite way",
            "Model the whole body",
        ],
    );
    let round = warnings("axisymmetric", symmetric(), 0.0, 0.01, Value::Null);
    says(
        told(&round, WarningCode::SymmetricDrag),
        &["the axis", "cannot be dragged"],
    );
    let clamped = json!({"boundary": "left", "ux": 0, "uy": 0});
    let never = json!([{"tangential_displacement": 0}]);
    for sound in [
        warnings("plane_strain", symmetric(), 0.0, 0.0, Value::Null),
        warnings("plane_strain", symmetric(), 0.2, 0.01, Value::Null),
        warnings("plane_strain", clamped, 0.2, 0.01, Value::Null),
        warnings("plane_strain", symmetric(), 0.0, 0.01, never),
        warnings("axisymmetric", symmetric(), 0.2, 0.01, Value::Null),
    ] {
        assert_eq!(told(&sound, WarningCode::SymmetricDrag), None);
    }
}

/// A block 2 × 1 of squares, pressed on a plane by a pressure and pushed by a traction on its side.
fn pushed(push: f64, friction: Value, supports: Value) -> Solution {
    let lines: Vec<f64> = (0..=8).map(|k| 0.25 * f64::from(k)).collect();
    let text = json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grid": {"x": lines, "y": [0, 0.5, 1]}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": supports,
        "loads": [{"boundary": "top", "pressure": 5}, {"boundary": "left", "traction": [push, 0]}],
        "contacts": [{"boundary": "bottom", "obstacle": {"kind": "flat"}, "friction": friction}],
    });
    ended(&problem(&text.to_string()))
}

/// Pushed by more than μN = 3 (cohesion or a prescribed bound: what they add), a body without support has no equilibrium.
/// The outcome says so at once, with both forces; just above the limit after the iterations; below it the body rests. (3 %:
/// on edges longer than the radius the average of a single node is not exact; 5 %: where a corner lifts nothing rubs.)
#[test]
fn a_body_pushed_beyond_its_friction_is_said_to_slide_away() {
    let coulomb =
        json!({"coefficient": 0.3, "nonlocal_radius": 0, "elastic_slip": 1e-4, "points": "nodal"});
    let gauss = json!({"coefficient": 0.3, "nonlocal_radius": 0, "elastic_slip": 1e-4});
    let averaged = json!({"coefficient": 0.3, "nonlocal_radius": 0.2, "elastic_slip": 1e-4, "normalization": "conserving"});
    let tanh = json!({"coefficient": 0.3, "nonlocal_radius": 0, "elastic_slip": 1e-4, "points": "nodal", "transition": "tanh"});
    let cohesive = json!({"coefficient": 0.3, "nonlocal_radius": 0.2, "elastic_slip": 1e-4, "cohesion": 0.5, "normalization": "conserving"});
    let capped =
        json!({"coefficient": 9, "nonlocal_radius": 0.2, "elastic_slip": 1e-4, "shear_cap": 1.5});
    let given = json!({"bound": 1.5, "elastic_slip": 1e-4});
    for (friction, limit) in [
        (coulomb, 3.0),
        (gauss, 3.0),
        (averaged, 3.0),
        (tanh, 3.0),
        (cohesive, 4.0),
        (capped, 3.0),
        (given, 3.0),
    ] {
        let rests = pushed(0.9 * limit, friction.clone(), json!([])).summary;
        assert_eq!(rests.outcome, Outcome::Converged, "{friction}");
        for part in [1.002, 1.5] {
            let slides = pushed(part * limit, friction.clone(), json!([])).summary;
            assert_eq!(slides.outcome, Outcome::NotConverged, "{friction}, {part}");
            let message = told(&slides.warnings, WarningCode::SlidesAway);
            let push: f64 = format!("{:.5e}", part * limit).parse().unwrap();
            let push = format!("with a force of {push:?} along x");
            says(
                message,
                &[
                    &push,
                    "Only friction resists",
                    "there is no equilibrium",
                    "Support the body",
                ],
            );
            let hold = message
                .unwrap()
                .split(['d', ' ', ':'])
                .filter_map(|word| word.parse::<f64>().ok())
                .next_back();
            assert!(
                (hold.unwrap() / limit - 1.0).abs() < 0.03,
                "{friction}: {message:?}"
            );
            for code in [
                WarningCode::NotConverged,
                WarningCode::LargeDisplacement,
                WarningCode::OutOfBalance,
            ] {
                assert_eq!(told(&slides.warnings, code), None, "{friction}, {part}");
            }
            // known from equilibrium: no iteration is made
            if part > 1.2 {
                says(message, &["can resist at most"]);
                assert_eq!(slides.iterations, 1, "{friction}");
                assert!(
                    (slides.friction_force / limit - 1.0).abs() < 0.05,
                    "{friction}: {}",
                    slides.friction_force
                );
            }
        }
        // any support holds it
        let held = json!([{"boundary": "right", "ux": 0}]);
        assert_eq!(
            pushed(1.5 * limit, friction, held).summary.outcome,
            Outcome::Converged
        );
    }
}

/// Where the pressure does not follow from equilibrium, the state that the iterations leave tells: pressed by a support, or
/// a shaft in a hub. A wall ahead ends the motion: nothing is claimed then, and the body rests there.
#[test]
fn friction_is_checked_where_equilibrium_does_not_decide() {
    let coulomb = json!({"coefficient": 0.3, "nonlocal_radius": 0.2, "elastic_slip": 1e-4});
    let pressed = json!([{"boundary": "top", "uy": -0.01}]);
    let slides = pushed(100.0, coulomb.clone(), pressed.clone()).summary;
    let message = told(&slides.warnings, WarningCode::SlidesAway);
    says(
        message,
        &["with a force of 100.0 along x", "at the computed pressure"],
    );
    assert_eq!(
        pushed(2.0, coulomb.clone(), pressed).summary.outcome,
        Outcome::Converged
    );

    let shaft = |push: f64| {
        let text = json!({
            "analysis": {"kind": "axisymmetric"},
            "mesh": {"grid": {"x": [0, 0.25, 0.5, 0.75, 1], "y": [0, 0.5, 1, 1.5, 2]}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "loads": [{"boundary": "top", "traction": [0, -push]}],
            "contacts": [{"boundary": "right", "obstacle": {"kind": "flat"}, "indentation": 0.01, "friction": coulomb}],
        });
        ended(&problem(&text.to_string())).summary
    };
    assert_eq!(shaft(1.0).outcome, Outcome::Converged);
    let slides = shaft(50.0);
    assert_ne!(slides.outcome, Outcome::Converged);
    // π r² times the traction
    let message = told(&slides.warnings, WarningCode::SlidesAway);
    says(message, &["with a force of 157.08 along the axis"]);

    let walled = |gap: f64| {
        let lines: Vec<f64> = (0..=8).map(|k| 0.25 * f64::from(k)).collect();
        let text = json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"grid": {"x": lines, "y": [0, 0.5, 1]}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "loads": [{"boundary": "top", "pressure": 5}, {"boundary": "left", "traction": [4, 0]}],
            "contacts": [
                {"boundary": "bottom", "obstacle": {"kind": "flat"}, "friction": {"coefficient": 0.3, "nonlocal_radius": 0.2, "elastic_slip": 1e-4}},
                {"boundary": "right", "obstacle": {"kind": "flat"}, "indentation": -gap},
            ],
        });
        ended(&problem(&text.to_string())).summary
    };
    let rests = walled(0.05);
    assert_eq!(told(&rests.warnings, WarningCode::SlidesAway), None);
    assert_eq!(rests.outcome, Outcome::Converged);
    assert!(rests.contacts["right"].normal_force > 0.9);
}

/// A plate on a pin at its corner, which friction with a prescribed bound at its top holds against turning:
/// a moment beyond it is told, and one below it is held.
#[test]
fn a_plate_that_is_turned_beyond_its_friction_is_said_to_turn() {
    let lattice = Lattice::new(8, 4, |i, j| [0.125 * i as f64, 0.125 * j as f64]);
    let sides =
        json!({"top": lattice.edges(8, |k| (k, 8)), "right": lattice.edges(4, |k| (16, k))});
    let pin = lattice.nodes.iter().position(|x| *x == [0.0, 0.0]).unwrap();
    let turned = |shear: f64| {
        let text = json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"inline": {"nodes": lattice.nodes, "elements": lattice.elements, "boundaries": sides, "node_sets": {"pin": [pin]}}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": [{"nodes": "pin", "ux": 0, "uy": 0}],
            "loads": [{"boundary": "right", "traction": [0, shear]}],
            "contacts": [{"boundary": "top", "obstacle": {"kind": "flat"}, "condition": "none",
                "friction": {"bound": 3, "elastic_slip": 1e-4}}],
        });
        ended(&problem(&text.to_string())).summary
    };
    // the top, 2 long and 1 above the pin, holds 3 · 2 · 1; the right side, 1 long and 2 away, turns with 2 per unit
    assert_eq!(turned(2.9).outcome, Outcome::Converged);
    let slides = turned(3.1);
    assert_eq!(
        (slides.outcome, slides.iterations),
        (Outcome::NotConverged, 1)
    );
    let message = told(&slides.warnings, WarningCode::SlidesAway);
    says(
        message,
        &[
            "turn the body with a moment of 6.2 in rotation about (0, 0)",
            "can resist at most 6.0:",
        ],
    );
}

/// A slip that was too large in an earlier load step is told at the end, which rests on it.
#[test]
fn the_end_of_a_path_tells_of_a_large_slip_before_it() {
    let contact = json!({"boundary": "top", "obstacle": {"kind": "parabola", "radius": 8}, "indentation": 0.02,
        "tangential_displacement": 3,
        "friction": {"coefficient": 0.3, "nonlocal_radius": 0.2, "elastic_slip": 1e-4, "history": "incremental"}});
    let mut whole = block(&contact, 1.0);
    whole["steps"] = json!([
        {"name": "away", "indentation": 1, "tangential_displacement": 1},
        {"name": "back", "indentation": 1, "tangential_displacement": 0},
    ]);
    let problem = problem(&whole.to_string());
    let solution = solver::solve(&problem, &mut crate::support::quiet).unwrap();
    let of_step = &solution.steps[0].summary.warnings;
    let slid = of_step.iter().any(|w| w.code == WarningCode::LargeSlip);
    assert!(slid, "{of_step:#?}");
    let at_end = &solution.summary.warnings;
    let told = at_end.iter().find(|w| w.code == WarningCode::LargeSlip);
    assert!(told.unwrap().message.starts_with("In load step \"away\": "));
}

/// Load steps that lead elsewhere than was meant are told, and the same steps without the fault are not.
#[test]
fn load_steps_that_leave_something_out_are_told() {
    let codes = |history: &str, steps: Value| {
        let contact = json!({"boundary": "top", "obstacle": {"kind": "parabola", "radius": 8.0}, "indentation": 0.02,
            "tangential_displacement": 0.002,
            "friction": {"coefficient": 0.3, "nonlocal_radius": 0.2, "elastic_slip": 1e-6, "history": history}});
        let mut document = block(&contact, 1.0);
        document["loads"] = json!([{"boundary": "left", "pressure": 1}]);
        document["steps"] = steps;
        let model = Model::new(&problem(&document.to_string()), None).unwrap();
        let mut codes: Vec<&str> = model.warnings.iter().map(|w| w.code.as_str()).collect();
        codes.sort_unstable();
        codes.join(" ")
    };
    let press = json!({"name": "press"});
    let drag = json!({"tangential_displacement": 1});
    let unload = json!({"indentation": 0.5});
    let kept = json!({"indentation": 0.5, "tangential_displacement": 1});
    let back = json!({"tangential_displacement": -1});
    for (history, steps, told) in [
        ("incremental", json!([press]), "never_applied"),
        ("incremental", json!([press, drag]), ""),
        ("incremental", json!([drag, unload]), "drag_returns"),
        ("incremental", json!([drag, kept]), ""),
        ("incremental", json!([drag, {"indentation": 0}]), ""),
        ("incremental", json!([drag, press]), ""),
        ("incremental", json!([drag, back]), ""),
        (
            "incremental",
            json!([{"tangential_displacement": 1, "loads": 0}]),
            "never_applied",
        ),
        ("total", json!([press, drag]), ""),
        ("total", json!([drag, back]), "path_forgotten"),
        ("total", json!([drag, kept]), "path_forgotten"),
    ] {
        assert_eq!(codes(history, steps.clone()), told, "{history} {steps}");
    }
}

/// Points that scatter as measured ones do are told, with what they scatter by, whatever holds them; shapes are not: smooth
/// ones, kinked ones, and those whose rounding does not matter.
#[test]
fn noise_without_a_standard_deviation_is_told() {
    let x: Vec<f64> = (-30..=30).map(|k| 0.05 * f64::from(k)).collect();
    // a fixed sequence that has no pattern
    let mut seed = 7_u64;
    let noise: Vec<f64> = x
        .iter()
        .map(|_| {
            seed = seed
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (seed >> 33) as f64 / f64::from(1u32 << 31) - 0.5
        })
        .collect();
    let told_of = |y: &dyn Fn(usize) -> f64, kind: &str| {
        let obstacle = match kind {
            "polyline" => {
                json!({"kind": kind, "points": (0..x.len()).map(|k| [x[k], y(k)]).collect::<Vec<_>>()})
            }
            _ => {
                json!({"kind": kind, "x": x, "gap": (0..x.len()).map(y).collect::<Vec<_>>(), "interpolation": "cubic"})
            }
        };
        let contact = json!({"boundary": "middle", "obstacle": obstacle, "indentation": 0.02});
        let model = Model::new(&problem(&block(&contact, 1.0).to_string()), None).unwrap();
        told(&model.warnings, WarningCode::NoiseUndeclared).map(str::to_owned)
    };
    let shape = |k: usize| x[k] * x[k] / 16.0;
    for kind in ["table", "polyline"] {
        let text = told_of(&|k| shape(k) + 1e-3 * noise[k], kind);
        says(text.as_deref(), &["scatter by", "standard_deviation"]);
        let with_an_edge = |k: usize| shape(k) + 1e-3 * noise[k] + if k > 50 { 0.2 } else { 0.0 };
        assert!(
            told_of(&with_an_edge, kind).is_some(),
            "an edge does not hide it"
        );
        for sound in [
            &shape as &dyn Fn(usize) -> f64,
            &|k| x[k].powi(4),
            &|k| 0.1 * x[k].abs(),
            &|k| 0.02 * (3.0 * x[k]).sin(),
            &|k| 0.1 * x[k].abs() + if k % 10 == 0 { 0.01 } else { 0.0 },
            &|k| shape(k) + 1e-6 * noise[k],
        ] {
            assert_eq!(told_of(sound, kind), None, "{kind}");
        }
    }
}

/// The part of the friction that the average carries beyond the contact grows with the radius, and is told above 5 %.
#[test]
fn friction_beyond_the_contact_is_told() {
    let told_of = |radius: f64| {
        let contact = json!({"boundary": "top", "obstacle": {"kind": "parabola", "radius": 8.0}, "indentation": 0.02,
            "tangential_displacement": 0.05,
            "friction": {"coefficient": 0.3, "nonlocal_radius": radius, "elastic_slip": 1e-4}});
        let found = solve(&problem(&block(&contact, 1.0).to_string()));
        let text = told(&found.summary.warnings, WarningCode::FrictionBeyondContact);
        text.map(|text| text.split(' ').next().unwrap().parse::<f64>().unwrap())
    };
    assert_eq!([told_of(0.0), told_of(0.05)], [None, None]);
    let (some, more) = (told_of(0.4).unwrap(), told_of(0.8).unwrap());
    assert!(5.0 < some && some < more && more < 60.0, "{some} {more}");
}

/// Values in `steps` are factors. Lengths in their place are told, if none of them comes near to the whole.
#[test]
fn factors_of_steps_that_look_like_lengths_are_told() {
    let contact = json!({"boundary": "top", "obstacle": {"kind": "parabola", "radius": 8.0}, "indentation": 0.02,
        "tangential_displacement": 0.002,
        "friction": {"coefficient": 0.3, "nonlocal_radius": 0.2, "elastic_slip": 1e-5}});
    let codes = |steps: Value| {
        let mut document = block(&contact, 1.0);
        document["steps"] = steps;
        let problem = problem(&document.to_string());
        let model = Model::new(&problem, None).unwrap();
        let mut all = model.warnings.into_iter();
        all.find(|w| w.code == WarningCode::FactorsSmall)
            .map(|w| w.message)
    };
    let lengths = json!([{"indentation": 0.01, "tangential_displacement": 0}, {"indentation": 0.02, "tangential_displacement": 0.5}]);
    says(
        codes(lengths).as_deref(),
        &[
            "0.02 times the `indentation` of 0.02",
            "4.0000e-4",
            "factors",
        ],
    );
    let drag = json!([{"indentation": 1, "tangential_displacement": 0.002}]);
    says(
        codes(drag).as_deref(),
        &["`tangential_displacement` of 0.002"],
    );
    for sound in [
        json!([]),
        json!([{"indentation": 0.01}, {"indentation": 1}, {"indentation": 0.0}]),
        json!([{"indentation": 1, "tangential_displacement": 0}]),
    ] {
        assert_eq!(codes(sound), None);
    }
}

/// A range that ends inside an edge or inside elements names whole ones only, which is told; one that ends at nodes, or beside a
/// corner of the body, is not told of.
#[test]
fn a_range_that_cuts_the_mesh_is_told() {
    let told_of = |foot: serde_json::Value, soft: serde_json::Value| {
        let text = json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"grid": {"x": [0, 0.1, 0.2, 0.3, 0.4, 1], "y": [0, 0.25, 0.5, 1]},
                "boundaries": {"foot": foot}, "groups": {"soft": soft}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3},
                {"youngs_modulus": 10, "poissons_ratio": 0.3, "group": "soft"}],
            "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
            "loads": [{"boundary": "foot", "pressure": 1}],
        });
        let model = Model::new(&problem(&text.to_string()), None).unwrap();
        let found = model.warnings.iter();
        let found = found.filter(|w| w.code == WarningCode::RangeCutsMesh);
        found.map(|w| w.pointer.clone()).collect::<Vec<_>>()
    };
    let whole = json!({"y": [0.25, 0.5]});
    for foot in [
        json!({"box": [[0, 0.9], [0.3, 1.1]]}),
        json!({"y": [0.9, 1.1]}),
        json!({"side": "top", "x": [0.1, 1]}),
        json!({"normal": [0, 1]}),
    ] {
        assert_eq!(told_of(foot, whole.clone()), [""; 0]);
    }
    let cut = json!({"box": [[0, 0.9], [0.349, 1.1]]});
    assert_eq!(told_of(cut, whole), ["/mesh/boundaries/foot"]);
    let upper = json!({"side": "top", "x": [0.15, 0.4]});
    assert_eq!(
        told_of(upper, json!({"y": [0.2, 0.6]})),
        ["/mesh/boundaries/foot", "/mesh/groups/soft"]
    );
}

/// A quarter of a ring on a rigid pin with interference: the pressure is uniform, N = p π/2, and the force is p along x and y.
#[test]
fn the_force_of_a_curved_contact_is_told_as_a_vector() {
    let (radial, round) = (4, 16);
    let lattice = crate::support::Lattice::new(radial, round, |i, j| {
        let (sin, cos) = (std::f64::consts::FRAC_PI_2 * j as f64 / (2 * round) as f64).sin_cos();
        let r = 1.0 + i as f64 / (2 * radial) as f64;
        [r * cos, r * sin]
    });
    let text = json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"inline": {"nodes": lattice.nodes, "elements": lattice.elements, "boundaries": {
            "below": lattice.edges(radial, |k| (k, 0)), "side": lattice.edges(radial, |k| (k, 2 * round)),
            "bore": lattice.edges(round, |k| (0, k)),
        }}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "below", "uy": 0}, {"boundary": "side", "ux": 0}],
        "contacts": [{"boundary": "bore", "obstacle": {"kind": "flat", "along": "arc_length"}, "indentation": 0.001}],
    });
    let summary = solve(&problem(&text.to_string())).summary;
    let text = told(&summary.warnings, WarningCode::NormalsDiffer).unwrap();
    let numbers = &text[text.find('[').unwrap() + 1..text.find(']').unwrap()];
    let expected = summary.normal_force / std::f64::consts::FRAC_PI_2;
    for number in numbers.split(", ") {
        let force: f64 = number.parse().unwrap();
        assert!(
            (force / expected - 1.0).abs() < 1e-3,
            "{force}, not {expected}"
        );
    }
}

/// A cylinder with friction, pressed into a block; where `edge` is given, a flat punch up to it instead.
fn pressed(modulus: f64, friction: &Value, edge: Option<f64>) -> Summary {
    let x: Vec<f64> = (0..=30)
        .map(|k| 0.05 * f64::from(k))
        .chain([2.0, 3.0, 5.0, 9.0, 20.0, 40.0])
        .collect();
    let y = [-40.0, -20.0, -9.0, -4.0, -2.0, -1.0, -0.5, -0.25, -0.1, 0.0];
    let obstacle = match edge {
        Some(to) => json!({"kind": "flat", "from": -to, "to": to}),
        None => json!({"kind": "circle", "radius": 10}),
    };
    let mut law = json!({"coefficient": 0.3, "nonlocal_radius": 0.05, "elastic_slip": 1e-4});
    law.as_object_mut()
        .unwrap()
        .extend(friction.as_object().unwrap().clone());
    let text = json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grid": {"x": x, "y": y}},
        "materials": [{"youngs_modulus": modulus, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "left", "ux": 0}, {"boundary": "bottom", "ux": 0, "uy": 0}],
        "contacts": [{"boundary": "top", "obstacle": obstacle, "indentation": 0.1, "friction": law}],
    });
    solve(&problem(&text.to_string())).summary
}

/// σ_t is largest where stick ends. On which side of that place rounding puts the peak changes nothing: the stated error is
/// that of the same problem in another unit of stress.
#[test]
fn the_error_of_a_peak_where_stick_ends_is_not_made_by_rounding() {
    let relative = |modulus: f64| {
        let accuracy = pressed(modulus, &json!({}), None).accuracy.unwrap();
        let mut peaks = accuracy.quantities.into_iter();
        let peak =
            peaks.find(|q| q.quantity == solver::solution::QuantityName::PeakTangentialStress);
        peak.unwrap().relative.unwrap()
    };
    let expected = relative(1000.0);
    for modulus in [999.0, 1001.0, 1.0, 1e6, 2.1e11, 1e-3] {
        let found = relative(modulus);
        assert!(
            (found / expected - 1.0).abs() < 1e-3,
            "{modulus}: {found}, not {expected}"
        );
    }
}

/// The total law is no law of the way to the end: it is told where the contact grows and sticks, and nowhere else.
#[test]
fn the_total_law_is_told_where_the_way_matters() {
    let told_of = |friction: Value, edge: Option<f64>| {
        let summary = pressed(1000.0, &friction, edge);
        told(&summary.warnings, WarningCode::TotalLaw).map(str::to_owned)
    };
    says(
        told_of(json!({}), None).as_deref(),
        &["the contact grows", "\"history\": \"incremental\""],
    );
    // a contact that is there from the beginning, the other law, none
    assert_eq!(told_of(json!({}), Some(1.0)), None);
    assert_eq!(told_of(json!({"history": "incremental"}), None), None);
    assert_eq!(told_of(json!({"coefficient": 0}), None), None);
}

/// Half of a block under half of an obstacle: without its line of symmetry, and with it; an obstacle beside the end, and one
/// that is flat.
#[test]
fn a_half_model_without_its_line_of_symmetry_is_told() {
    let told_with = |supports: Value, obstacle: Value, friction: Value| {
        let x: Vec<f64> = (0..=20)
            .map(|k| 0.05 * f64::from(k))
            .chain([1.3, 2.0, 4.0])
            .collect();
        let text = json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"grid": {"x": x, "y": [-4, -2, -1, -0.5, -0.2, -0.1, 0]}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": supports,
            "contacts": [{"boundary": "top", "obstacle": obstacle, "indentation": 0.01,
                "friction": friction}],
        });
        let summary = solve(&problem(&text.to_string())).summary;
        let verdict = summary.accuracy.unwrap().verdict;
        let told = told(&summary.warnings, WarningCode::SymmetryMissing).map(str::to_owned);
        assert!(told.is_none() || verdict >= solver::solution::Verdict::Fair);
        told
    };
    let friction = json!({"coefficient": 0.3, "nonlocal_radius": 0.05, "elastic_slip": 1e-5});
    let told_of =
        |supports: Value, obstacle: Value| told_with(supports, obstacle, friction.clone());
    let free = json!([{"boundary": "bottom", "ux": 0, "uy": 0}]);
    let half = json!([{"boundary": "bottom", "ux": 0, "uy": 0}, {"boundary": "left", "ux": 0}]);
    for kind in ["circle", "parabola"] {
        let obstacle = json!({"kind": kind, "radius": 8});
        says(
            told_of(free.clone(), obstacle.clone()).as_deref(),
            &["s = 0.0000", "`center`"],
        );
        // without friction the free corner sinks away
        says(
            told_with(free.clone(), obstacle.clone(), json!(null)).as_deref(),
            &["s = 0.0000", "`center`"],
        );
        assert_eq!(told_of(half.clone(), obstacle.clone()), None);
        for center in [-0.05, 0.05, 2.0] {
            let beside = json!({"kind": kind, "radius": 8, "center": center});
            assert_eq!(told_of(free.clone(), beside), None, "{center}");
        }
    }
    assert_eq!(
        told_of(free.clone(), json!({"kind": "flat", "to": 0.5})),
        None
    );
    // at the other end
    let right = json!({"kind": "circle", "radius": 8, "center": 4});
    says(told_of(free, right).as_deref(), &["s = 4.0000"]);
}
