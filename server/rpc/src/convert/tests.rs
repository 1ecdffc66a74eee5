//! What is possible in messages but not in JSON, and fields that they leave out. tests/service/every_field.rs
//! checks against the contract that every field arrives under its name.
#![allow(clippy::unwrap_used)]

use solver::{error::Violation, problem::Problem};

use base::job::Status;
use strum::VariantArray;
use suite::{EXAMPLES, shipped_example};

use super::read;
use crate::pb;

fn refused(message: pb::Problem) -> Vec<Violation> {
    read::<_, Problem>(message).unwrap_err()
}

#[test]
fn every_example_is_unchanged_by_conversion_to_a_message_and_back() {
    for name in EXAMPLES {
        let problem: Problem = files::parse(&shipped_example(name)).unwrap();
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

/// Messages of any bytes: decoded and converted, or refused. See `suite::fuzzing`, also for longer runs.
#[test]
fn changed_messages_are_converted_or_refused() {
    use prost::Message;
    let jobs = EXAMPLES.map(|name| {
        let problem: Problem = files::parse(&shipped_example(name)).unwrap();
        pb::CreateJobRequest {
            problem: Some(problem.into()),
            name: Some("a".to_owned()),
            labels: [("a".to_owned(), "b".to_owned())].into(),
            priority: 3,
            ..Default::default()
        }
    });
    let batch = pb::BatchCreateJobsRequest {
        jobs: jobs.to_vec(),
        ..Default::default()
    };
    let mut seeds: Vec<Vec<u8>> = jobs.iter().map(Message::encode_to_vec).collect();
    seeds.push(batch.encode_to_vec());
    let filter = pb::JobFilter {
        status: vec![1, 2],
        created_after: Some(prost_types::Timestamp {
            seconds: 1,
            nanos: 1,
        }),
        ..Default::default()
    };
    seeds.push(filter.encode_to_vec());
    let target = suite::fuzzing::Target {
        name: "messages",
        seeds,
        words: &[
            "\n",
            "\u{a}\u{0}",
            "\u{12}\u{2}",
            "\u{7f}\u{7f}",
            "top",
            "\0\0\0\0\0\0\u{0}\u{7f}",
        ],
        cases: 40_000,
    };
    let figures = target.attack(|input| {
        let kind = |found: Vec<Violation>| {
            assert!(!found.is_empty() && found.len() <= 100);
            let depth = found[0].pointer.matches('/').count();
            format!("{} {depth} {}", found[0].reason, found.len().min(5))
        };
        let one = match pb::CreateJobRequest::decode(input) {
            Ok(message) => match super::job_request(message).problem {
                Ok(_) => "read".to_owned(),
                Err(found) => kind(found),
            },
            Err(_) => "undecodable".to_owned(),
        };
        let many = match pb::BatchCreateJobsRequest::decode(input) {
            Ok(message) => {
                let jobs = message.jobs.into_iter().map(super::job_request);
                let sound = jobs.filter(|job| job.problem.is_ok()).count();
                format!("{} jobs", sound.min(5))
            }
            Err(_) => "undecodable".to_owned(),
        };
        let filter = match pb::JobFilter::decode(input) {
            Ok(message) => super::filter(Some(message)).is_ok().to_string(),
            Err(_) => "undecodable".to_owned(),
        };
        format!("{one}; {many}; {filter}")
    });
    assert!(figures.answers > 20, "{figures:?}");
}
