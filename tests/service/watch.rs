//! GET /v1/jobs/{id}/events.

use reqwest::StatusCode;
use serde_json::Value;
use suite::{
    example_json,
    harness::{Server, block, large, soon},
};

use crate::{SIGNORINI, server};

/// Operations: WatchJob
#[tokio::test]
async fn the_events_of_a_job_are_in_order_and_can_be_replayed() {
    let server = server().await;
    let id = server.submit(&example_json("rectangular_punch")).await;
    let live = server.events(&id, 0).await.rest().await;
    let again = server.events(&id, 0).await.rest().await;
    assert_eq!(live, again);
    assert_dense(&live);
    assert_eq!(
        (&live[0]["status"], &live[1]["status"]),
        (&"queued".into(), &"running".into())
    );
    let rows: Vec<&Value> = live
        .iter()
        .filter(|event| event["type"] == "iteration")
        .collect();
    assert!(
        rows.iter()
            .map(|row| row["k"].as_u64().unwrap())
            .eq(1..=rows.len() as u64)
    );
    for name in [
        "stage",
        "residual",
        "friction_residual",
        "tolerance",
        "contact",
        "friction",
        "force",
        "wall_s",
    ] {
        assert!(!rows[0][name].is_null(), "{name}");
    }
    let done = &live.last().unwrap()["job"];
    assert_eq!(done["status"], "succeeded");
    assert_eq!(*done, server.job(&id).await);
}

/// Operations: WatchJob
#[tokio::test]
async fn a_stream_continues_after_the_last_received_event() {
    let server = server().await;
    let id = server.submit(&example_json("rectangular_punch")).await;
    let all = server.events(&id, 0).await.rest().await;
    let n = all.len();
    assert_eq!(server.events(&id, 5).await.rest().await, all[5..]);
    // the parameter does the same; the header takes precedence
    let get = |after: usize| server.get(&format!("/v1/jobs/{id}/events?after_seq={after}"));
    let text = get(n - 1).send().await.unwrap().text().await.unwrap();
    // how long a browser waits before it asks again
    let first = format!("retry: 1000\nid: {n}\n");
    assert!(text.starts_with(&first), "{text}");
    let text = get(0)
        .header("Last-Event-ID", (n - 1).to_string())
        .send()
        .await
        .unwrap()
        .text()
        .await
        .unwrap();
    assert!(text.starts_with(&first), "{text}");
    // there are no events after the last
    let silent = get(n).send().await.unwrap();
    assert_eq!(silent.status(), StatusCode::NO_CONTENT);
    for wrong in ["-1", "last", ""] {
        let response = get(0).header("Last-Event-ID", wrong).send().await.unwrap();
        assert_eq!(response.status(), StatusCode::BAD_REQUEST, "{wrong:?}");
    }
}

/// Over both protocols: a client with a wrong number does not wait without end.
/// Operations: WatchJob
#[tokio::test]
async fn a_stream_from_beyond_the_last_event_ends_with_the_job() {
    let server = Server::start_alone(SIGNORINI, &["--workers", "1"]).await;
    let front = server.submit(&large()).await;
    let id = server.submit(&example_json("sheet")).await; // waits behind it
    let mut by_rest = server.events(&id, 1_000_000).await;
    let mut grpc = crate::grpc::connect(&server).await;
    let request = rpc::pb::WatchJobRequest {
        id: id.clone(),
        after_seq: 1_000_000,
    };
    let mut by_grpc = grpc.watch_job(request).await.unwrap().into_inner();
    assert_eq!(server.cancel(&id).await["outcome"], "canceled");
    assert_eq!(by_rest.next().await, None);
    let end = soon("the stream's end", by_grpc.message()).await;
    assert_eq!(end.unwrap(), None);
    server.cancel(&front).await;
}

/// Operations: WatchJob
#[tokio::test]
async fn closing_a_stream_does_not_cancel_the_job() {
    let server = server().await;
    let id = server.submit(&block(60, 60)).await;
    let mut events = server.events(&id, 0).await;
    events.next().await.unwrap();
    drop(events);
    assert_eq!(server.until_done(&id).await["status"], "succeeded");
}

/// The client disconnects after each event and reconnects with the number of the last; meanwhile the
/// service is killed before the job starts, killed during the job, and stopped during the job.
/// Operations: WatchJob
#[tokio::test]
async fn a_client_that_reconnects_after_each_event_gets_every_event_exactly_once() {
    let mut server = Server::start_alone(SIGNORINI, &["--workers", "1"]).await;
    let front = server.submit(&large()).await;
    server.until_running(&front).await;
    let id = server.submit(&block(120, 110)).await;

    let mut story: Vec<Value> = vec![];
    let mut connections = 0;
    let (mut connections_before_start, mut ends_of_the_service) = (0, 0);
    while story.last().is_none_or(|event| event["type"] != "done") {
        let mut stream = server.events(&id, story.len() as i64).await;
        connections += 1;
        let started = story.iter().any(|event| event["status"] == "running");
        if !started {
            connections_before_start += 1;
        }
        if !started && story.len() == 1 && ends_of_the_service == 0 {
            // connected, and waiting for the start, which does not come: the service is killed
            server.kill().await;
            assert_eq!(stream.next().await, None, "the line is dead");
            server.restart().await;
            ends_of_the_service = 1;
            continue;
        }
        if !started && story.len() == 1 {
            server.cancel(&front).await;
        }
        let event = stream.next().await.expect("an event");
        drop(stream);
        let (attempt, stage) = (
            event["attempt"].as_i64().unwrap(),
            event["stage"].as_str().unwrap_or_default(),
        );
        let mid_job = event["type"] == "stage" && stage == "assemble";
        story.push(event);
        if mid_job && attempt == 1 {
            server.kill().await;
            server.restart().await;
            ends_of_the_service += 1;
        } else if mid_job && attempt == 2 {
            assert!(server.terminate().await.success());
            server.restart().await;
            ends_of_the_service += 1;
        }
    }
    assert_dense(&story);
    assert!(connections > 20, "{connections} connections");
    assert!(connections_before_start >= 3 && ends_of_the_service == 3);
    let job = &story.last().unwrap()["job"];
    assert_eq!(
        (job["status"].as_str(), job["attempt"].as_i64()),
        (Some("succeeded"), Some(3))
    );
    assert_eq!(
        server.events(&id, 0).await.rest().await,
        story,
        "as one reads it in one go"
    );
    let reasons: Vec<_> = story
        .iter()
        .filter_map(|event| event["reason"].as_str())
        .collect();
    assert_eq!(reasons, ["worker_lost", "drain"]);
}

/// seq counts from 1 without gaps, and there is exactly one end.
fn assert_dense(events: &[Value]) {
    let numbers: Vec<i64> = events
        .iter()
        .map(|event| event["seq"].as_i64().unwrap())
        .collect();
    assert!(
        numbers.iter().copied().eq(1..=events.len() as i64),
        "{numbers:?}"
    );
    let ends = events
        .iter()
        .filter(|event| event["type"] == "done")
        .count();
    assert_eq!(
        (ends, events.last().unwrap()["type"].as_str()),
        (1, Some("done"))
    );
}
