//! POST /v1/jobs.

use reqwest::StatusCode;
use serde_json::{Value, json};
use suite::example_json;

use crate::server;

/// Operations: CreateJob
#[tokio::test]
async fn a_submitted_job_is_accepted_with_its_address_and_version() {
    let server = server().await;
    let body = json!({
        "problem": example_json("rectangular_punch"), "name": "first", "labels": { "a": "b" }, "priority": 3
    });
    let response = server.post("/v1/jobs").json(&body).send().await.unwrap();
    assert_eq!(response.status(), StatusCode::ACCEPTED);
    let headers = response.headers().clone();
    let job: Value = response.json().await.unwrap();
    assert_eq!(
        headers["location"],
        format!("/v1/jobs/{}", job["id"].as_str().unwrap())
    );
    assert_eq!(headers["etag"], format!("W/\"{}\"", job["version"]));
    assert!(headers.contains_key("retry-after"));
    assert_eq!(
        (&job["name"], &job["labels"]["a"], &job["priority"]),
        (&json!("first"), &json!("b"), &json!(3))
    );
    // both workers are free: the commit that accepts the job also starts it
    assert_eq!(
        (&job["status"], &job["attempt"], &job["owner"]),
        (&json!("running"), &json!(1), &json!("local"))
    );
    assert!(job["input_hash"].as_str().unwrap().starts_with("sha256:"));
}

/// Operations: CreateJob
#[tokio::test]
async fn a_preference_to_wait_returns_the_terminal_job() {
    let server = server().await;
    let body = json!({ "problem": example_json("rectangular_punch") });
    let response = server
        .post("/v1/jobs")
        .header("Prefer", "wait=30")
        .json(&body)
        .send()
        .await
        .unwrap();
    assert_eq!(response.status(), StatusCode::CREATED);
    assert_eq!(response.headers()["preference-applied"], "wait=30");
    assert!(response.headers().contains_key("location"));
    let job: Value = response.json().await.unwrap();
    assert_eq!(
        (&job["status"], &job["result_available"]),
        (&json!("succeeded"), &json!("final"))
    );
}

/// Operations: CreateJob
#[tokio::test]
async fn a_wait_that_is_too_short_returns_the_job_as_it_is() {
    let server = server().await;
    let body = json!({ "problem": suite::harness::block(150, 150) });
    let response = server
        .post("/v1/jobs")
        .header("Prefer", "wait=0")
        .json(&body)
        .send()
        .await
        .unwrap();
    assert_eq!(response.status(), StatusCode::ACCEPTED);
    assert!(!response.headers().contains_key("preference-applied"));
    assert!(response.headers().contains_key("retry-after"));
}

/// Operations: CreateJob, GetResult
#[tokio::test]
async fn the_same_problem_has_the_same_hash_and_digest_whatever_its_title() {
    let server = server().await;
    let mut problem = example_json("sheet");
    let first = server.submit(&problem).await;
    problem["title"] = json!("another title");
    let second = server.submit(&problem).await;
    let (first_job, second_job) = (
        server.until_done(&first).await,
        server.until_done(&second).await,
    );
    assert_eq!(first_job["input_hash"], second_job["input_hash"]);
    let digest = async |id: &str| {
        server.json(&format!("/v1/jobs/{id}/result")).await["summary"]["digest"].take()
    };
    assert_eq!(digest(&first).await, digest(&second).await);
}

/// Operations: CreateJob, GetResult
#[tokio::test]
async fn a_problem_that_does_not_converge_fails_and_keeps_its_state() {
    let server = server().await;
    let mut problem = example_json("rectangular_punch");
    problem["solver"] = json!({ "max_iterations": 1 });
    let id = server.submit(&problem).await;
    let job = server.until_done(&id).await;
    assert_eq!(
        (&job["status"], &job["reason"]),
        (&json!("failed"), &json!("not_converged"))
    );
    assert_eq!(
        (&job["result_available"], &job["failure"]["code"]),
        (&json!("partial"), &json!("not-converged"))
    );
    let summary = &server.json(&format!("/v1/jobs/{id}/result")).await["summary"];
    assert_eq!(
        (&summary["outcome"], &summary["converged"]),
        (&json!("not_converged"), &json!(false))
    );
    assert!(
        !server
            .json(&format!("/v1/jobs/{id}/profiles/top?partial=true"))
            .await["s"]
            .as_array()
            .unwrap()
            .is_empty()
    );
}

/// Operations: CreateJob
#[tokio::test]
async fn all_violations_of_a_job_are_reported_together() {
    let server = server().await;
    let mut problem = example_json("rectangular_punch");
    problem["materials"][0]["poissons_ratio"] = json!(0.7);
    problem["contacts"][0]["friction"]["elastic_slip"] = json!(-1);
    let body = json!({ "problem": problem, "priority": 11 });
    let response = server.post("/v1/jobs").json(&body).send().await.unwrap();
    assert_eq!(response.status(), StatusCode::UNPROCESSABLE_ENTITY);
    assert_eq!(
        response.headers()["content-type"],
        "application/problem+json"
    );
    let document: Value = response.json().await.unwrap();
    assert_eq!(document["code"], "invalid-problem");
    let pointers: Vec<_> = document["errors"]
        .as_array()
        .unwrap()
        .iter()
        .map(|e| e["pointer"].as_str().unwrap())
        .collect();
    for pointer in [
        "/priority",
        "/problem/materials/0/poissons_ratio",
        "/problem/contacts/0/friction/elastic_slip",
    ] {
        assert!(pointers.contains(&pointer), "{pointer} in {pointers:?}");
    }
    assert_eq!(
        server.json("/v1/jobs").await["jobs"],
        json!([]),
        "nothing was accepted"
    );
}
