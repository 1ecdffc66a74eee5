//! `"accuracy": "verify"`: the errors by the mesh split in two, over both protocols.

use std::time::{Duration, Instant};

use rpc::pb;
use serde_json::{Value, json};
use suite::{
    example_json,
    harness::{Server, block},
};

use crate::{
    SIGNORINI,
    grpc::{connect, message},
    server,
};

/// Operations: CreateJob, GetResult, ValidateProblem
#[tokio::test]
async fn both_protocols_verify_and_show_the_same() {
    let server = server().await;
    let mut grpc = connect(&server).await;
    let mut problem = example_json("cylinder");
    problem["mesh"]["refine"] = json!(1);
    let estimated = server.solve(&json!({ "problem": problem })).await;
    problem["solver"] = json!({ "accuracy": "verify" });
    let job = server.solve(&json!({ "problem": problem })).await;
    let id = job["id"].as_str().unwrap().to_owned();
    assert_eq!(job["status"], "succeeded", "{job:#}");
    // another job than the one that estimates: not answered from its result
    assert_eq!(job["cached_from"], Value::Null);
    assert_ne!(job["input_hash"], estimated["input_hash"]);
    let events = server.events(&id, 0).await.rest().await;
    let stages = events.iter().filter(|event| event["type"] == "stage");
    let stages: Vec<&str> = stages
        .map(|event| event["stage"].as_str().unwrap())
        .collect();
    assert_eq!(stages.last(), Some(&"verify"), "{stages:?}");
    assert_eq!(stages.iter().filter(|stage| **stage == "factor").count(), 1);

    let result = server.json(&format!("/v1/jobs/{id}/result")).await;
    let accuracy = &result["summary"]["accuracy"];
    assert_eq!(accuracy["verified"], true);
    assert!(result["summary"]["timings"]["verify"].as_f64().unwrap() > 0.0);
    let quantities = accuracy["quantities"].as_array().unwrap();
    let force = &quantities[0];
    assert_eq!(
        (&force["quantity"], &force["method"]),
        (&json!("normal_force"), &json!("mesh_halved"))
    );
    let number = |field: &str| force[field].as_f64().unwrap();
    assert!(number("error") >= number("difference") && number("difference") > 0.0);
    assert!((number("finer") - number("value")).abs() == number("difference"));
    assert!(number("order") > 0.0);

    // the same job over gRPC is answered from that result, field by field
    let request = pb::CreateJobRequest {
        problem: Some(message(&problem.to_string())),
        wait: Some(60.0),
        ..Default::default()
    };
    let again = grpc.create_job(request).await.unwrap().into_inner();
    assert_eq!(again.cached_from.as_deref(), Some(&*id));
    let summary = grpc.get_result(pb::GetResultRequest { id: again.id });
    let summary = summary.await.unwrap().into_inner().summary.unwrap();
    let over_grpc = summary.accuracy.unwrap();
    assert_eq!(over_grpc.verified, Some(true));
    assert_eq!(over_grpc.quantities.len(), quantities.len());
    for (by_grpc, by_rest) in over_grpc.quantities.iter().zip(quantities) {
        assert_eq!(Some(by_grpc.value), by_rest["value"].as_f64());
        assert_eq!(by_grpc.finer, by_rest["finer"].as_f64());
        assert_eq!(by_grpc.difference, by_rest["difference"].as_f64());
        assert_eq!(by_grpc.order, by_rest["order"].as_f64());
        assert_eq!(by_grpc.error, by_rest["error"].as_f64());
        let halved = by_grpc.method() == pb::ErrorMethod::MeshHalved;
        assert_eq!(halved, by_rest["method"] == "mesh_halved");
    }

    // a mode that there is not, and what it costs
    problem["solver"] = json!({ "accuracy": "certain" });
    let refused = server
        .post("/v1/jobs")
        .json(&json!({ "problem": problem }))
        .send()
        .await
        .unwrap();
    assert_eq!(refused.status(), 422);
    let refused: Value = refused.json().await.unwrap();
    let violation = &refused["errors"][0];
    assert_eq!(
        violation["pointer"], "/problem/solver/accuracy",
        "{refused:#}"
    );
    assert!(violation["got"].as_str().unwrap().contains("certain"));
    assert!(violation["expected"].as_str().unwrap().contains("verify"));
}

/// Operations: CancelJob
#[tokio::test]
async fn a_job_that_verifies_is_canceled_within_a_second() {
    let server = Server::start_alone(SIGNORINI, &[]).await;
    let mut problem = block(60, 60);
    problem["solver"] = json!({ "accuracy": "verify" });
    let id = server.submit(&problem).await;
    server
        .until(&id, |event| {
            event["type"] == "stage" && event["stage"] == "verify"
        })
        .await;
    let start = Instant::now();
    server.cancel(&id).await;
    let job = server.until_done(&id).await;
    assert!(
        start.elapsed() < Duration::from_secs(1),
        "{:?}",
        start.elapsed()
    );
    assert_eq!(job["status"], "canceled", "{job:#}");
}
