//! One problem, three doors, the same bits.

use std::process::Command;

use serde_json::{Value, json};
use service::pb;
use suite::{example, example_json};

use crate::{
    SIGNORINI,
    grpc::{connect, message},
    server,
};

const EXAMPLES: [&str; 5] = [
    "rectangular_punch",
    "cylinder",
    "annular_punch",
    "cylinder_on_end",
    "sheet",
];

/// Operations: CreateJob, GetResult
#[tokio::test]
async fn rest_grpc_and_the_command_line_find_the_same_bits() {
    let server = server().await;
    let mut grpc = connect(&server).await;
    let folder = tempfile::tempdir().unwrap();
    for name in EXAMPLES {
        let by_rest = server.submit(&example_json(name)).await;
        server.until_done(&by_rest).await;
        let by_rest = server.json(&format!("/v1/jobs/{by_rest}/result")).await["summary"].take();

        let request = pb::CreateJobRequest {
            problem: Some(message(&example(name))),
            wait: Some(60.0),
            ..Default::default()
        };
        let job = grpc.create_job(request).await.unwrap().into_inner();
        let by_grpc = grpc
            .get_result(pb::GetResultRequest { id: job.id })
            .await
            .unwrap()
            .into_inner();
        let by_grpc = by_grpc.summary.unwrap();

        let (problem, result) = (
            folder.path().join("problem.json"),
            folder.path().join("result.json"),
        );
        std::fs::write(&problem, example(name)).unwrap();
        let solved = Command::new(SIGNORINI)
            .arg("solve")
            .arg(&problem)
            .arg("-o")
            .arg(&result)
            .output()
            .unwrap();
        assert_eq!(
            solved.status.code(),
            Some(0),
            "{}",
            String::from_utf8_lossy(&solved.stderr)
        );
        let by_command: Value = serde_json::from_slice(&std::fs::read(&result).unwrap()).unwrap();
        let by_command = &by_command["summary"];

        for field in [
            "digest",
            "input_hash",
            "normal_force",
            "tangential_force",
            "energy",
            "residuals",
        ] {
            assert_eq!(by_rest[field], by_command[field], "{field} of {name}");
        }
        assert_eq!(by_rest["digest"], by_grpc.digest, "{name}");
        assert_eq!(by_rest["input_hash"], by_grpc.input_hash, "{name}");
        assert_eq!(
            by_rest["tangential_force"].as_f64(),
            Some(by_grpc.tangential_force),
            "{name}"
        );
    }
}

/// Operations: GetJob
#[tokio::test]
async fn both_protocols_say_the_same_of_a_job_that_failed() {
    let server = server().await;
    let mut grpc = connect(&server).await;
    let mut problem = example_json("rectangular_punch");
    problem["solver"] = json!({ "max_iterations": 3 });
    let id = server.submit(&problem).await;
    let job = server.until_done(&id).await;
    let twin = grpc.get_job(pb::GetJobRequest { id }).await.unwrap();
    let twin = twin.into_inner();
    let (progress, failure) = (twin.progress.unwrap(), twin.failure.unwrap());
    assert!(job["progress"]["rate"].is_number(), "{job:#}");
    assert_eq!(
        job["progress"],
        json!({
            "stage": progress.stage,
            "iteration": progress.iteration,
            "residual": progress.residual,
            "tolerance": progress.tolerance,
            "contact_changes": progress.contact_changes,
            "rate": progress.rate,
            "eta_s": progress.eta_s,
        })
    );
    assert_eq!(
        job["failure"],
        json!({
            "type": failure.r#type,
            "title": failure.title,
            "code": failure.code,
            "detail": failure.detail,
        })
    );
}

/// Operations: WatchJob, GetProfile
#[tokio::test]
async fn both_protocols_tell_the_same_story_of_one_job() {
    let server = server().await;
    let mut grpc = connect(&server).await;
    let id = server.submit(&example_json("cylinder")).await;
    let by_rest = server.events(&id, 0).await.rest().await;
    let mut stream = grpc
        .watch_job(pb::WatchJobRequest {
            id: id.clone(),
            after_seq: 0,
        })
        .await
        .unwrap()
        .into_inner();
    for event in &by_rest {
        let twin = stream.message().await.unwrap().unwrap();
        assert_eq!(
            (event["seq"].as_i64(), event["attempt"].as_i64()),
            (Some(twin.seq), Some(twin.attempt as i64))
        );
        match twin.payload.unwrap() {
            pb::event::Payload::Status(_) => assert_eq!(event["type"], "status"),
            pb::event::Payload::Stage(stage) => assert_eq!(event["stage"], stage.stage),
            pb::event::Payload::Warning(warning) => assert_eq!(event["message"], warning.message),
            pb::event::Payload::Done(done) => assert_eq!(event["job"]["id"], done.job.unwrap().id),
            pb::event::Payload::Iteration(row) => {
                assert_eq!(event["k"].as_u64(), Some(row.k.into()));
                assert_eq!(event["stage"], row.stage);
                assert_eq!(event["residual"].as_f64(), Some(row.residual));
                assert_eq!(
                    event["friction_residual"].as_f64(),
                    Some(row.friction_residual)
                );
                assert_eq!(event["force"]["normal"].as_f64(), Some(row.normal_force));
                assert_eq!(event["wall_s"].as_f64(), Some(row.wall_s));
            }
        }
    }
    assert!(stream.message().await.unwrap().is_none());

    let profile = server.json(&format!("/v1/jobs/{id}/profiles/top")).await;
    let twin = grpc
        .get_profile(pb::GetProfileRequest {
            id,
            boundary: "top".into(),
            step: None,
            points: None,
        })
        .await
        .unwrap()
        .into_inner();
    let column = |name: &str| -> Vec<f64> {
        profile[name]
            .as_array()
            .unwrap()
            .iter()
            .map(|value| value.as_f64().unwrap())
            .collect()
    };
    assert_eq!(column("s"), twin.s);
    assert_eq!(column("normal_stress"), twin.normal_stress);
    assert_eq!(column("tangential_stress"), twin.tangential_stress);
    assert_eq!(column("friction_bound"), twin.friction_bound);
}

/// Load steps: indented, then dragged, by the incremental law; the second solution asked for.
/// Operations: GetResult, GetProfile
#[tokio::test]
async fn both_protocols_serve_every_load_step() {
    let server = server().await;
    let mut grpc = connect(&server).await;
    let mut problem = example_json("cylinder");
    problem["contacts"][0]["friction"]["history"] = json!("incremental");
    problem["contacts"][0]["tangential_displacement"] = json!(0.01);
    problem["solver"] = json!({ "check_uniqueness": true });
    problem["steps"] = json!([
        { "name": "indent", "increments": 2, "spacing": "contact_width" },
        { "name": "drag", "tangential_displacement": 1 },
    ]);
    let id = server.submit(&problem).await;
    assert_eq!(server.until_done(&id).await["status"], "succeeded");
    let result = server.json(&format!("/v1/jobs/{id}/result")).await;
    let twin = grpc
        .get_result(pb::GetResultRequest { id: id.clone() })
        .await
        .unwrap()
        .into_inner();
    assert_eq!(result["result_available"], "final");
    assert_eq!(twin.result_available(), pb::ResultAvailable::Final);
    let (steps, twins) = (result["steps"].as_array().unwrap(), twin.steps);
    assert_eq!((steps.len(), twins.len()), (2, 2));
    for (step, twin) in steps.iter().zip(twins) {
        assert_eq!(step["name"], twin.name);
        let summary = twin.summary.unwrap();
        let force = step["summary"]["tangential_force"].as_f64();
        assert_eq!(force, Some(summary.tangential_force));
        let second = summary.uniqueness.unwrap();
        assert_eq!(step["summary"]["uniqueness"]["agrees"], second.agrees);
    }
    assert_eq!(result["summary"]["increments"], 3);
    assert_eq!(
        steps[1]["summary"]["normal_force"],
        result["summary"]["normal_force"]
    );

    let at = |step: &str| format!("/v1/jobs/{id}/profiles/top{step}");
    let end = server.json(&at("")).await;
    assert_eq!(end, server.json(&at("?step=drag")).await);
    assert_eq!(end, server.json(&at("?step=1")).await);
    let first = server.json(&at("?step=indent")).await;
    assert_ne!(end, first);
    let profile = grpc.get_profile(pb::GetProfileRequest {
        id: id.clone(),
        boundary: "top".into(),
        step: Some("0".into()),
        points: None,
    });
    let profile = profile.await.unwrap().into_inner();
    assert_eq!(first["tangential_stress"], json!(profile.tangential_stress));
    let none = grpc.get_profile(pb::GetProfileRequest {
        id,
        boundary: "top".into(),
        step: Some("unload".into()),
        points: None,
    });
    assert_eq!(none.await.unwrap_err().code(), tonic::Code::NotFound);
}
