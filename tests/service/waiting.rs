//! Waiting for a job: entity tags, long polls, submit-and-stream, JSON Lines.

use std::time::{Duration, Instant};

use reqwest::StatusCode;
use rpc::pb;
use serde_json::{Value, json};
use suite::{
    example, example_json,
    harness::{Server, answer},
};

use crate::{
    SIGNORINI,
    grpc::{connect, message},
    server,
};

/// Operations: GetJob
#[tokio::test]
async fn a_client_that_has_the_current_version_is_answered_with_304() {
    let server = server().await;
    let id = server.submit(&example_json("sheet")).await;
    server.until_done(&id).await;
    let get = async |tag: &str| {
        let request = server.get(&format!("/v1/jobs/{id}"));
        request.header("If-None-Match", tag).send().await.unwrap()
    };
    let tag = get("\"0\"").await.headers()["etag"]
        .to_str()
        .unwrap()
        .to_owned();
    for seen in [
        tag.clone(),
        tag.strip_prefix("W/").unwrap().to_owned(),
        format!("\"x\", {tag}"),
        "*".into(),
    ] {
        let response = get(&seen).await;
        assert_eq!(response.status(), StatusCode::NOT_MODIFIED, "{seen}");
        assert_eq!(response.headers()["etag"].to_str().unwrap(), tag);
    }
    assert_eq!(get("\"x\"").await.status(), StatusCode::OK);
}

/// Operations: GetJob, WaitJob
#[tokio::test]
async fn a_long_poll_returns_with_the_next_version_or_at_its_limit() {
    let server = Server::start(SIGNORINI, &[]).await;
    server.post("/v1/queue/pause").send().await.unwrap();
    let id = server.submit(&example_json("sheet")).await;
    let version = server.job(&id).await["version"].as_i64().unwrap();
    let poll = async |query: &str, seen: Option<i64>| {
        let mut request = server.get(&format!("/v1/jobs/{id}?{query}"));
        if let Some(seen) = seen {
            request = request.header("If-None-Match", format!("\"{seen}\""));
        }
        let start = Instant::now();
        let response = request.send().await.unwrap();
        (response.status(), start.elapsed())
    };
    // no change: at the limit 304, or the job if there is no tag
    let (status, time) = poll("wait=0.2", Some(version)).await;
    assert_eq!(status, StatusCode::NOT_MODIFIED);
    assert!(time >= Duration::from_millis(200));
    assert_eq!(poll("wait=0.2", None).await.0, StatusCode::OK);
    // the client has another version: answered at once
    let (status, time) = poll("wait=30", Some(version - 1)).await;
    assert_eq!(status, StatusCode::OK);
    assert!(time < Duration::from_secs(5));
    // an edit, and then the start, end the wait
    let waiting = poll("wait=30", Some(version));
    let edit = async {
        tokio::time::sleep(Duration::from_millis(100)).await;
        let patch = server.request(reqwest::Method::PATCH, &format!("/v1/jobs/{id}"));
        patch.json(&json!({ "name": "n" })).send().await.unwrap();
    };
    let ((status, time), ()) = tokio::join!(waiting, edit);
    assert_eq!(status, StatusCode::OK);
    assert!(time < Duration::from_secs(10), "{time:?}");
    let until_end = poll("wait=30&until=terminal", None);
    let resume = async {
        server.post("/v1/queue/resume").send().await.unwrap();
    };
    let ((status, time), ()) = tokio::join!(until_end, resume);
    assert_eq!(status, StatusCode::OK);
    assert!(time < Duration::from_secs(20), "{time:?}");
    assert_eq!(server.job(&id).await["status"], "succeeded");
    // terminal already: answered at once, also for a client that knows no version
    for query in ["wait=30&until=terminal", "wait=30"] {
        let (status, time) = poll(query, None).await;
        assert_eq!(status, StatusCode::OK);
        assert!(time < Duration::from_secs(5), "{query}");
    }
    for bad in ["wait=61", "wait=-1", "wait=x", "until=tomorrow", "for=ever"] {
        assert_eq!(poll(bad, None).await.0, StatusCode::BAD_REQUEST, "{bad}");
    }

    let mut grpc = connect(&server).await;
    let request = |version, until_terminal| pb::WaitJobRequest {
        id: id.clone(),
        wait: 0.1,
        version,
        until_terminal,
    };
    let met = grpc
        .wait_job(request(None, true))
        .await
        .unwrap()
        .into_inner();
    assert!(met.met && met.job.as_ref().unwrap().status() == pb::Status::Succeeded);
    let version = met.job.unwrap().version;
    for (known, met) in [(None, true), (Some(1), true), (Some(version), false)] {
        let waited = grpc.wait_job(request(known, false)).await.unwrap();
        assert_eq!(waited.into_inner().met, met, "{known:?}");
    }
}

/// Operations: CreateJob, SubmitAndWatch
#[tokio::test]
async fn a_job_is_submitted_and_followed_in_one_request() {
    let server = server().await;
    let request = server
        .post("/v1/jobs")
        .header("Accept", "text/event-stream");
    let response = request
        .json(&json!({ "problem": example_json("sheet"), "cache": "off" }))
        .send()
        .await
        .unwrap();
    assert_eq!(response.status(), StatusCode::ACCEPTED);
    let location = response.headers()["location"].to_str().unwrap().to_owned();
    let text = response.text().await.unwrap();
    assert!(
        text.starts_with("id: 1\n") || text.contains("\nid: 1\n"),
        "{text}"
    );
    let last = text
        .lines()
        .filter_map(|line| line.strip_prefix("data: "))
        .next_back()
        .unwrap();
    let done: Value = serde_json::from_str(last).unwrap();
    assert_eq!(
        (&done["type"], &done["job"]["status"]),
        (&json!("done"), &json!("succeeded"))
    );
    assert!(location.ends_with(done["job"]["id"].as_str().unwrap()));

    let mut grpc = connect(&server).await;
    let request = pb::CreateJobRequest {
        problem: Some(message(&example("sheet"))),
        cache: pb::Cache::Off.into(),
        ..Default::default()
    };
    let mut events = grpc.submit_and_watch(request).await.unwrap().into_inner();
    let mut seqs = vec![];
    while let Some(event) = events.message().await.unwrap() {
        seqs.push(event.seq);
    }
    assert!(seqs.len() > 3 && seqs.iter().copied().eq(1..=seqs.len() as i64));
}

/// Operations: WatchJob, CreateJob
#[tokio::test]
async fn events_are_sent_as_lines_if_the_client_prefers_them() {
    let server = server().await;
    let id = server.submit(&example_json("sheet")).await;
    let events = server.events(&id, 0).await.rest().await;
    for media in ["application/jsonl", "application/x-ndjson"] {
        let request = server.get(&format!("/v1/jobs/{id}/events?after_seq=2"));
        let response = request.header("Accept", media).send().await.unwrap();
        assert_eq!(response.headers()["content-type"], "application/jsonl");
        let text = response.text().await.unwrap();
        let lines: Vec<Value> = text
            .lines()
            .map(|line| serde_json::from_str(line).unwrap())
            .collect();
        assert_eq!(lines, events[2..]);
    }
    let request = server.get(&format!("/v1/jobs/{id}/events"));
    let (status, refused) = answer(request.header("Accept", "image/png")).await;
    assert_eq!(status, StatusCode::NOT_ACCEPTABLE);
    let detail = refused["detail"].as_str().unwrap();
    assert_eq!(
        detail,
        "not available as image/png; available: text/event-stream, application/jsonl"
    );
    // also for a submission
    let body = json!({ "problem": example_json("sheet"), "cache": "off" });
    let request = server
        .post("/v1/jobs")
        .header("Accept", "application/jsonl");
    let response = request.json(&body).send().await.unwrap();
    assert_eq!(response.status(), StatusCode::ACCEPTED);
    let text = response.text().await.unwrap();
    let last: Value = serde_json::from_str(text.lines().last().unwrap()).unwrap();
    assert_eq!(last["type"], "done");
}
