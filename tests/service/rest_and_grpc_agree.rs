//! One problem over REST, over gRPC and from the command line gives bit-identical results.

use std::process::Command;

use rpc::pb;
use serde_json::{Value, json};
use suite::{
    example, example_json,
    harness::{Server, soon},
};

use crate::{
    SIGNORINI,
    by_name::{self, assert_same},
    grpc::{connect, message},
    server,
};

/// Operations: CreateJob, GetResult
#[tokio::test]
async fn rest_grpc_and_the_command_line_give_bit_identical_results() {
    let server = server().await;
    let mut grpc = connect(&server).await;
    let folder = tempfile::tempdir().unwrap();
    for name in suite::EXAMPLES {
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
async fn both_protocols_report_a_failed_job_equally() {
    let server = server().await;
    let mut grpc = connect(&server).await;
    let mut problem = example_json("rectangular_punch");
    problem["solver"] = json!({ "max_iterations": 3 });
    let id = server.submit(&problem).await;
    let job = server.until_done(&id).await;
    let over_grpc = grpc.get_job(pb::GetJobRequest { id }).await.unwrap();
    assert!(job["progress"]["rate"].is_number(), "{job:#}");
    assert!(job["failure"]["code"].is_string(), "{job:#}");
    agree(&job, "Job", &over_grpc.into_inner());
}

/// The message has the content of the JSON except for its links, and nothing else.
fn agree(by_rest: &Value, name: &str, by_grpc: &impl prost::Message) {
    let mut by_rest = by_rest.clone();
    for part in ["", "/job"] {
        let part = by_rest.pointer_mut(part).and_then(Value::as_object_mut);
        part.map(|fields| fields.remove("links"));
    }
    assert_same(&by_rest, &by_name::json(name, by_grpc), name);
}

/// Operations: WatchJob, GetProfile
#[tokio::test]
async fn both_protocols_report_the_same_events_and_profiles_of_a_job() {
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
        let over_grpc = stream.message().await.unwrap().unwrap();
        assert_eq!(
            (event["seq"].as_i64(), event["attempt"].as_i64()),
            (Some(over_grpc.seq), Some(over_grpc.attempt as i64))
        );
        agree(event, "Event", &over_grpc);
    }
    assert!(stream.message().await.unwrap().is_none());

    let profile = server.json(&format!("/v1/jobs/{id}/profiles/top")).await;
    let over_grpc = grpc
        .get_profile(pb::GetProfileRequest {
            id,
            boundary: "top".into(),
            ..Default::default()
        })
        .await
        .unwrap()
        .into_inner();
    agree(&profile, "ContactProfile", &over_grpc);
}

/// Load steps: indentation, then tangential displacement, by the incremental law; with the second solution.
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
    let over_grpc = grpc
        .get_result(pb::GetResultRequest { id: id.clone() })
        .await
        .unwrap()
        .into_inner();
    assert_eq!(result["result_available"], "final");
    assert_eq!(over_grpc.result_available(), pb::ResultAvailable::Final);
    agree(&result, "Result", &over_grpc);
    let steps = result["steps"].as_array().unwrap();
    assert_eq!((steps.len(), over_grpc.steps.len()), (2, 2));
    assert!(steps[1]["summary"]["uniqueness"]["agrees"].is_boolean());
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
        ..Default::default()
    });
    let profile = profile.await.unwrap().into_inner();
    assert_eq!(first["tangential_stress"], json!(profile.tangential_stress));
    let none = grpc.get_profile(pb::GetProfileRequest {
        id,
        boundary: "top".into(),
        step: Some("unload".into()),
        ..Default::default()
    });
    assert_eq!(none.await.unwrap_err().code(), tonic::Code::NotFound);
}

#[tokio::test]
async fn both_protocols_return_a_problem_as_it_was_submitted() {
    let server = server().await;
    let mut grpc = connect(&server).await;
    server.post("/v1/queue/pause").send().await.unwrap();
    for name in suite::EXAMPLES {
        let by_rest = server.submit(&example_json(name)).await;
        let by_rest = server.json(&format!("/v1/jobs/{by_rest}/problem")).await;
        let request = pb::CreateJobRequest {
            problem: Some(message(&example(name))),
            cache: pb::Cache::Off.into(),
            ..Default::default()
        };
        let by_grpc = grpc.create_job(request).await.unwrap().into_inner();
        let id = by_grpc.id.clone();
        assert_eq!(
            server.json(&format!("/v1/jobs/{id}/problem")).await,
            by_rest,
            "{name}"
        );
        let problem = grpc.get_job_problem(pb::GetJobProblemRequest { id });
        agree(&by_rest, "Problem", &problem.await.unwrap().into_inner());
    }
}

#[tokio::test]
async fn both_protocols_report_the_service_meshes_and_problems_equally() {
    // alone: the queue must not change between the two requests
    let server = Server::start_alone(SIGNORINI, &[]).await;
    let mut grpc = connect(&server).await;
    // right after the start the dispatcher holds a worker while it looks for a job
    soon("all workers are idle", async {
        while server.json("/v1/queue").await["idle"] != 2 {
            tokio::task::yield_now().await;
        }
    })
    .await;
    let queue = grpc.get_queue(pb::GetQueueRequest {}).await.unwrap();
    agree(
        &server.json("/v1/queue").await,
        "QueueState",
        &queue.into_inner(),
    );
    let info = grpc.get_server_info(pb::GetServerInfoRequest {}).await;
    let (mut info, mut by_rest) = (info.unwrap().into_inner(), server.json("/v1/info").await);
    // other programs use the same disk between the two requests
    let free = &mut info.disk.as_mut().unwrap().free_bytes;
    assert!(*free > 0 && by_rest["disk"]["free_bytes"].as_u64().unwrap() > 0);
    by_rest["disk"]["free_bytes"] = json!(*free);
    agree(&by_rest, "ServerInfo", &info);
    let caller = grpc.get_caller(pb::GetCallerRequest {}).await.unwrap();
    agree(&server.json("/v1/me").await, "Caller", &caller.into_inner());

    let mesh = r#"{"nodes": [[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0], [1, 0.5], [0.5, 1], [0, 0.5]],
        "elements": [[0, 1, 2, 3, 4, 5, 6, 7]], "boundaries": {"top": [[3, 2, 6]]}, "groups": {"all": [0]}, "node_sets": {"corner": [0]}}"#;
    let stored = server.post("/v1/meshes").body(mesh).send().await.unwrap();
    let stored: Value = stored.json().await.unwrap();
    let hash = stored["hash"].as_str().unwrap().to_owned();
    let mesh = grpc.get_mesh(pb::GetMeshRequest { hash }).await.unwrap();
    agree(&stored, "MeshInfo", &mesh.into_inner());

    let mut wrong = example_json("sheet");
    wrong["materials"][0]["poissons_ratio"] = json!(0.7);
    for problem in [example_json("sheet"), wrong] {
        let request = pb::ValidateProblemRequest {
            problem: Some(by_name::message("Problem", &problem)),
        };
        let by_grpc = grpc.validate_problem(request).await.unwrap().into_inner();
        let request = server
            .post("/v1/problems/validate")
            .json(&json!({ "problem": problem }));
        let by_rest: Value = request.send().await.unwrap().json().await.unwrap();
        agree(&by_rest, "ValidateProblemResponse", &by_grpc);
    }
}
