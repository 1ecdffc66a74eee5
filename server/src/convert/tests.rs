//! What is possible in messages but not in JSON, and fields that they leave out. tests/service/every_field.rs
//! checks against the contract that every field arrives under its name.
#![allow(clippy::unwrap_used)]

use solver::{error::Violation, problem::Problem};

use strum::VariantArray;

use super::read;
use crate::{cli::examples, fake, job::Status, pb};

fn refused(message: pb::Problem) -> Vec<Violation> {
    read::<_, Problem>(message).unwrap_err()
}

#[test]
fn every_example_is_unchanged_by_conversion_to_a_message_and_back() {
    for (name, text) in examples::ALL {
        let problem: Problem = files::parse(text).unwrap();
        let message = pb::Problem::from(problem.clone());
        assert_eq!(read(message), Ok(problem), "{name}");
    }
}

#[test]
fn what_a_message_leaves_out_has_the_defaults_of_the_json() {
    let json = r#"{ "analysis": { "kind": "plane_strain" }, "mesh": { "grid": { "x": [0, 1], "y": [0, 1] } }, "materials": [{ "youngs_modulus": 1, "poissons_ratio": 0.5 }],
                    "steps": [{}], "contacts": [{ "boundary": "top", "obstacle": { "kind": "flat" }, "friction": { "elastic_slip": 1 } }],
                    "solver": { "thesis": {} } }"#;
    let grid = pb::Grid {
        x: vec![0.0, 1.0],
        y: vec![0.0, 1.0],
        ..Default::default()
    };
    let message = pb::Problem {
        analysis: Some(pb::Analysis {
            kind: Some(pb::analysis::Kind::PlaneStrain(pb::PlaneStrain {})),
        }),
        mesh: Some(pb::Mesh {
            source: Some(pb::mesh::Source::Grid(grid)),
            ..Default::default()
        }),
        materials: vec![pb::Material {
            youngs_modulus: Some(1.0),
            poissons_ratio: Some(0.5),
            ..Default::default()
        }],
        steps: vec![pb::Step::default()],
        contacts: vec![pb::Contact {
            boundary: "top".into(),
            obstacle: Some(pb::Obstacle {
                kind: Some(pb::obstacle::Kind::Flat(pb::Flat {})),
                ..Default::default()
            }),
            friction: Some(pb::Friction {
                elastic_slip: 1.0,
                ..Default::default()
            }),
            ..Default::default()
        }],
        solver: Some(pb::SolverControls {
            thesis: Some(pb::ThesisOptions::default()),
            ..Default::default()
        }),
        ..Default::default()
    };
    let problem: Problem = serde_json::from_str(json).unwrap();
    assert_eq!(read(message), Ok(problem));
}

#[test]
fn at_most_a_hundred_violations_are_reported() {
    let message = pb::Problem {
        supports: vec![
            pb::Support {
                ux: Some(pb::BoundaryValue {
                    start: f64::NAN,
                    end: None
                }),
                ..Default::default()
            };
            1000
        ],
        ..Default::default()
    };
    assert_eq!(refused(message).len(), 100);
}

#[test]
fn all_missing_fields_of_a_message_are_reported_together() {
    let message = pb::Problem {
        loads: vec![pb::Load {
            traction: Some(pb::Traction::default()),
            ..Default::default()
        }],
        contacts: vec![pb::Contact {
            obstacle: Some(pb::Obstacle::default()),
            ..Default::default()
        }],
        ..Default::default()
    };
    let pointers: Vec<_> = refused(message).into_iter().map(|v| v.pointer).collect();
    assert_eq!(
        pointers,
        [
            "/analysis",
            "/mesh",
            "/loads/0/traction/0",
            "/loads/0/traction/1",
            "/contacts/0/obstacle/kind"
        ]
    );
}

#[test]
fn numbers_that_json_cannot_express_are_refused() {
    let mut message = pb::Problem::from(fake::problem());
    message.materials[0].youngs_modulus = Some(f64::NAN);
    message.contacts[0].friction.as_mut().unwrap().kernel = 99;
    let found = refused(message);
    let found: Vec<_> = found
        .iter()
        .map(|v| (v.pointer.as_str(), v.reason.as_str()))
        .collect();
    assert_eq!(
        found,
        [
            ("/materials/0/youngs_modulus", "not_finite"),
            ("/contacts/0/friction/kernel", "unknown_alternative")
        ]
    );
}

#[test]
fn statuses_keep_their_numbers_and_zero_is_none() {
    for status in Status::VARIANTS.iter().copied() {
        assert_eq!(read(pb::Status::from(status) as i32), Ok(status));
    }
    assert!(read::<_, Status>(0).is_err());
    assert!(read::<_, Status>(17).is_err());
}
