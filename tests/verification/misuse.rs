//! Problems that ask for what the model does not have, or that have no solution: each is told in words, and what is near
//! to it and sound is not.

use serde_json::{Value, json};
use solver::model::Model;
use solver::problem::Refine;
use solver::solution::{Summary, Warning, WarningCode};

use crate::support::{example, problem, solve};

/// The warning of a kind.
fn told(warnings: &[Warning], code: WarningCode) -> Option<&str> {
    let mut found = warnings.iter().filter(|w| w.code == code);
    found.next().map(|w| &w.message[..])
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
fn a_drag_beyond_the_contact_is_told() {
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
    for name in [
        "rectangular_punch",
        "cylinder",
        "annular_punch",
        "cylinder_on_end",
        "sheet",
    ] {
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
fn a_drag_of_half_a_body_is_told() {
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
