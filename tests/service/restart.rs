//! Jobs survive the end of the service, by a crash or on request.

use std::process::Command;

use reqwest::StatusCode;
use serde_json::{Value, json};
use suite::{
    example_json,
    harness::{Server, block, large},
};

use crate::SIGNORINI;

#[tokio::test]
async fn a_job_killed_in_the_middle_is_finished_after_the_restart() {
    let mut server = Server::start_alone(SIGNORINI, &[]).await;
    let (large, small) = (
        server.submit(&large()).await,
        server.submit(&block(80, 80)).await,
    );
    server
        .until(&large, |event| event["stage"] == "factor")
        .await;
    server.kill().await;
    server.restart().await;
    for id in [&large, &small] {
        let job = server.until_done(id).await;
        assert_eq!(job["status"], "succeeded", "{job:#}");
    }
    let job = server.job(&large).await;
    assert_eq!(
        (&job["attempt"], &job["max_attempts"]),
        (&json!(2), &json!(3))
    );
    let events = server.events(&large, 0).await.rest().await;
    assert!(
        events
            .iter()
            .map(|event| event["seq"].as_i64().unwrap())
            .eq(1..=events.len() as i64)
    );
}

#[tokio::test]
async fn a_stop_under_load_requeues_running_jobs_and_exits_with_0() {
    let mut server = Server::start_alone(SIGNORINI, &["--grace-s", "5"]).await;
    let mut ids = vec![server.submit(&large()).await, server.submit(&large()).await];
    for _ in 0..5 {
        ids.push(server.submit(&example_json("sheet")).await);
    }
    server.until_running(&ids[0]).await;
    server.until_running(&ids[1]).await;
    let mut stream = server.events(&ids[0], 0).await;
    let start = std::time::Instant::now();
    let status = server.terminate().await;
    assert_eq!(status.code(), Some(0));
    assert!(
        start.elapsed().as_secs_f64() < 6.0,
        "grace + 1 s: {:?}",
        start.elapsed()
    );
    assert!(
        stream
            .rest()
            .await
            .iter()
            .all(|event| event["type"] != "done"),
        "the stream ended without done"
    );

    server.restart().await;
    let job = server.job(&ids[0]).await;
    assert_eq!(
        job["max_attempts"], 4,
        "a drain does not count against the job"
    );
    for id in &ids {
        assert_eq!(server.until_done(id).await["status"], "succeeded");
    }
}

#[tokio::test]
async fn a_job_asked_to_stop_just_before_a_crash_is_canceled_after_it() {
    let mut server = Server::start_alone(SIGNORINI, &["--workers", "1"]).await;
    let id = server.submit(&large()).await;
    server.until(&id, |event| event["stage"] == "factor").await;
    assert_eq!(server.cancel(&id).await["outcome"], "cancel_requested");
    server.kill().await;
    server.restart().await;
    let job = server.job(&id).await;
    assert_eq!(
        (&job["status"], &job["reason"]),
        (&json!("canceled"), &json!("user_cancel"))
    );
}

#[tokio::test]
async fn results_are_kept_across_a_restart() {
    let mut server = Server::start(SIGNORINI, &[]).await;
    let id = server.submit(&example_json("cylinder")).await;
    let job = server.until_done(&id).await;
    let before = server.json(&format!("/v1/jobs/{id}/result")).await;
    server.kill().await;
    server.restart().await;
    assert_eq!(server.job(&id).await, job);
    assert_eq!(server.json(&format!("/v1/jobs/{id}/result")).await, before);
}

#[tokio::test]
async fn a_second_server_on_the_same_folder_is_refused_in_one_line() {
    let server = Server::start(SIGNORINI, &[]).await;
    let second = Command::new(SIGNORINI)
        .args(["serve", "--listen", "127.0.0.1:0", "--data"])
        .arg(server.data())
        .output()
        .unwrap();
    assert!(!second.status.success());
    let output = String::from_utf8(second.stderr).unwrap();
    assert!(
        output.lines().count() == 1 && output.contains("another server"),
        "{output}"
    );
    assert!(second.stdout.is_empty());
}

#[tokio::test]
async fn a_port_in_use_is_refused_in_one_line() {
    let server = Server::start(SIGNORINI, &[]).await;
    let folder = tempfile::tempdir().unwrap();
    let address = server.url.trim_start_matches("http://");
    let second = Command::new(SIGNORINI)
        .args(["serve", "--listen", address, "--data"])
        .arg(folder.path().join("data"))
        .output()
        .unwrap();
    assert!(!second.status.success());
    let output = String::from_utf8(second.stderr).unwrap();
    assert!(
        output.lines().count() == 1 && output.contains("cannot listen"),
        "{output}"
    );
}

/// Operations: CreateJob
#[tokio::test]
async fn an_accepted_job_survives_a_crash_right_after_the_answer() {
    let mut server = Server::start(SIGNORINI, &[]).await;
    let body = json!({ "problem": example_json("sheet"), "name": "kept", "labels": { "k": "v" } });
    let response = server.post("/v1/jobs").json(&body).send().await.unwrap();
    server.kill().await;
    assert_eq!(response.status(), StatusCode::ACCEPTED);
    let id = response.json::<Value>().await.unwrap()["id"]
        .as_str()
        .unwrap()
        .to_string();
    server.restart().await;
    let job = server.until_done(&id).await;
    assert_eq!(
        (&job["status"], &job["name"], &job["labels"]["k"]),
        (&json!("succeeded"), &json!("kept"), &json!("v"))
    );
}
