//! Jobs on a body that an earlier job has left.

use rpc::pb;
use serde_json::{Value, json};
use suite::{
    example_json,
    harness::{Server, answer},
};

use crate::{SIGNORINI, grpc::connect, server};

/// An example with another friction coefficient, which its body does not depend on.
fn with_coefficient(coefficient: f64) -> Value {
    let mut problem = example_json("cylinder");
    problem["mesh"]["refine"] = json!(1);
    problem["contacts"][0]["friction"]["coefficient"] = json!(coefficient);
    problem
}

/// The summary of a problem that is solved.
async fn summary(server: &Server, problem: &Value) -> Value {
    let job = server
        .solve(&json!({"problem": problem, "cache": "off"}))
        .await;
    assert_eq!(job["status"], "succeeded", "{job}");
    let id = job["id"].as_str().unwrap();
    server.json(&format!("/v1/jobs/{id}/result")).await["summary"].take()
}

async fn body_cache(server: &Server) -> Value {
    server.json("/v1/info").await["body_cache"].take()
}

/// Operations: GetServerInfo, GetResult
#[tokio::test]
async fn a_second_job_on_the_same_body_factors_nothing_and_has_the_result_of_its_own() {
    let server = server().await;
    let without = Server::start(SIGNORINI, &["--body-cache-bytes", "0"]).await;
    for (coefficient, reused) in [(0.2, false), (0.4, true), (0.6, true)] {
        let problem = with_coefficient(coefficient);
        let kept = summary(&server, &problem).await;
        let alone = summary(&without, &problem).await;
        assert_eq!(kept["digest"], alone["digest"]);
        assert_eq!(
            (&kept["body_reused"], &alone["body_reused"]),
            (&json!(reused), &json!(false))
        );
        for phase in ["assemble", "order", "factor", "condense"] {
            let seconds = kept["timings"][phase].as_f64().unwrap();
            assert_eq!(seconds == 0.0, reused, "{phase}: {seconds}");
        }
        assert!(kept["timings"]["iterate"].as_f64().unwrap() > 0.0);
    }
    let mut other = with_coefficient(0.2);
    other["materials"][0]["youngs_modulus"] = json!(12_345);
    let kept = summary(&server, &other).await;
    assert_eq!(kept["body_reused"], false);
    assert_eq!(kept["digest"], summary(&without, &other).await["digest"]);
    // a job that verifies is solved on meshes of its own
    let mut verified = with_coefficient(0.2);
    verified["solver"]["accuracy"] = json!("verify");
    assert_eq!(summary(&server, &verified).await["body_reused"], false);

    let figures = body_cache(&server).await;
    let bytes = figures["bytes"].as_u64().unwrap();
    assert!(bytes > 10_000, "{bytes}");
    assert_eq!(
        figures,
        json!({"bodies": 2, "bytes": bytes, "hits": 2, "misses": 2, "evictions": 0})
    );
    let nothing = json!({"bodies": 0, "bytes": 0, "hits": 0, "misses": 0, "evictions": 0});
    assert_eq!(body_cache(&without).await, nothing);
    let limits = server.json("/v1/info").await["limits"].take();
    let bytes_of = |name: &str| limits[name].as_u64().unwrap();
    assert_eq!(
        bytes_of("body_cache_bytes"),
        bytes_of("memory_budget_bytes") / 4
    );
    assert_eq!(
        without.json("/v1/info").await["limits"]["body_cache_bytes"],
        0
    );

    // the same over gRPC
    let mut grpc = connect(&server).await;
    let info = grpc.get_server_info(pb::GetServerInfoRequest {}).await;
    let expected = pb::BodyCache {
        bodies: 2,
        bytes,
        hits: 2,
        misses: 2,
        evictions: 0,
    };
    assert_eq!(info.unwrap().into_inner().body_cache, Some(expected));
    let job = server
        .solve(&json!({"problem": with_coefficient(0.3), "cache": "off"}))
        .await;
    let id = job["id"].as_str().unwrap().to_owned();
    let result = grpc.get_result(pb::GetResultRequest { id }).await;
    assert!(
        result
            .unwrap()
            .into_inner()
            .summary
            .is_some_and(|summary| summary.body_reused == Some(true))
    );
}

/// Operations: CreateSweep, GetServerInfo
#[tokio::test]
async fn a_sweep_finds_the_body_of_an_earlier_job_and_leaves_its_own() {
    let server = server().await;
    let sweep = async |youngs_modulus: u32| {
        let mut problem = with_coefficient(0.3);
        problem["materials"][0]["youngs_modulus"] = json!(youngs_modulus);
        let axis = json!({"path": "/contacts/0/friction/coefficient", "values": [0.1, 0.2, 0.5]});
        let sweep = json!({"base": problem, "axes": [axis]});
        let (_, sweep) = answer(server.post("/v1/sweeps").json(&sweep)).await;
        let id = sweep["id"].as_str().unwrap();
        let ended = server.json(&format!("/v1/sweeps/{id}?wait=60")).await;
        assert_eq!(ended["status"], "succeeded", "{ended}");
        let path = format!("/v1/sweeps/{id}/results?format=csv");
        let table = server.get(&path).send().await.unwrap();
        table.text().await.unwrap()
    };
    let first = sweep(2000).await;
    assert_eq!(first, sweep(2000).await);
    assert_ne!(first, sweep(3000).await);
    let mut problem = with_coefficient(0.9);
    problem["materials"][0]["youngs_modulus"] = json!(3000);
    assert_eq!(summary(&server, &problem).await["body_reused"], true);
    let figures = body_cache(&server).await;
    assert_eq!(
        (&figures["bodies"], &figures["hits"], &figures["misses"]),
        (&json!(2), &json!(2), &json!(2))
    );
}

/// Operations: GetServerInfo, ValidateProblem
#[tokio::test]
async fn a_kept_body_is_dropped_for_a_job_that_needs_its_memory() {
    let mut small = with_coefficient(0.2);
    small["mesh"]["refine"] = json!(3);
    let mut large = small.clone();
    large["mesh"]["refine"] = json!(4);
    let needs = async |server: &Server, problem: &Value| {
        let post = server.post("/v1/problems/validate");
        let told = post.json(&json!({"problem": problem})).send().await;
        let told: Value = told.unwrap().json().await.unwrap();
        told["estimate"]["memory_bytes"].as_u64().unwrap()
    };
    let first = server().await;
    let need = needs(&first, &large).await;
    assert!(need > 2 * needs(&first, &small).await);
    summary(&first, &small).await;
    let bytes = body_cache(&first).await["bytes"].as_u64().unwrap();
    assert!(bytes > 1 << 20, "{bytes}");
    drop(first);

    // the large one fits, but not beside that body
    let budget = (need + bytes / 2).to_string();
    let of_bodies = (bytes * 3 / 2).to_string();
    let server = Server::start(
        SIGNORINI,
        &[
            "--memory-budget-bytes",
            &budget,
            "--body-cache-bytes",
            &of_bodies,
        ],
    )
    .await;
    assert_eq!(summary(&server, &small).await["body_reused"], false);
    assert_eq!(body_cache(&server).await["bodies"], 1);
    assert_eq!(summary(&server, &large).await["body_reused"], false);
    let figures = body_cache(&server).await;
    // its own body is larger than what is for bodies
    assert_eq!(
        figures,
        json!({"bodies": 0, "bytes": 0, "hits": 0, "misses": 2, "evictions": 1})
    );
}

/// Operations: GetServerInfo
#[tokio::test]
async fn worker_processes_keep_no_bodies() {
    let server = Server::start(SIGNORINI, &["--isolation", "process"]).await;
    for coefficient in [0.2, 0.4] {
        let found = summary(&server, &with_coefficient(coefficient)).await;
        assert_eq!(found["body_reused"], false);
    }
    assert_eq!(body_cache(&server).await["misses"], 0);
    assert_eq!(
        server.json("/v1/info").await["limits"]["body_cache_bytes"],
        0
    );
}
