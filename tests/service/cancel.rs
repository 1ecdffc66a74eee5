//! POST /v1/jobs/{id}/cancel.

use std::time::{Duration, Instant};

use serde_json::json;
use suite::{
    example_json,
    harness::{Server, block, large},
};

use crate::{SIGNORINI, server};

/// Operations: CancelJob
#[tokio::test]
async fn a_queued_job_is_canceled_at_once_and_never_runs() {
    let server = Server::start_alone(SIGNORINI, &["--workers", "1"]).await;
    let front = server.submit(&large()).await;
    let waiting = server.submit(&example_json("sheet")).await;
    let answer = server.cancel(&waiting).await;
    assert_eq!(
        (&answer["outcome"], &answer["job"]["status"]),
        (&json!("canceled"), &json!("canceled"))
    );
    assert_eq!(answer["job"]["reason"], "user_cancel");
    let events = server.events(&waiting, 0).await.rest().await;
    let kinds: Vec<_> = events
        .iter()
        .map(|event| event["type"].as_str().unwrap())
        .collect();
    assert_eq!(kinds, ["status", "done"]);
    assert_eq!(server.cancel(&waiting).await["outcome"], "already_terminal");
    server.cancel(&front).await;
}

/// In every phase, also during the factorisation, which cannot be interrupted.
/// Operations: CancelJob
#[tokio::test]
async fn a_running_large_job_is_canceled_within_half_a_second_in_any_phase() {
    let server = Server::start_alone(SIGNORINI, &[]).await;
    for stage in ["mesh", "assemble", "order", "factor", "condense", "iterate"] {
        let other = server.submit(&large()).await; // the other core is busy too
        let id = server.submit(&large()).await;
        server
            .until(&id, |event| {
                event["type"] == "stage" && event["stage"] == stage
            })
            .await;
        let start = Instant::now();
        let answer = server.cancel(&id).await;
        let answered = start.elapsed();
        assert!(
            ["cancel_requested", "already_terminal"].contains(&answer["outcome"].as_str().unwrap())
        );
        let job = server.until_done(&id).await;
        let ended = start.elapsed();
        println!("in {stage}: answered after {answered:?}, ended after {ended:?}");
        assert_eq!(job["status"], "canceled", "in {stage}: {job:#}");
        assert_eq!(
            (&job["reason"], &job["cancel_requested"]),
            (&json!("user_cancel"), &json!(true))
        );
        assert!(ended < Duration::from_millis(500), "in {stage}: {ended:?}");
        server.cancel(&other).await;
    }
}

/// Operations: CancelJob, WatchJob
#[tokio::test]
async fn a_canceled_job_has_one_end_and_the_next_job_runs() {
    let server = Server::start(SIGNORINI, &["--workers", "1"]).await;
    let id = server.submit(&block(100, 100)).await;
    server.until_running(&id).await;
    server.cancel(&id).await;
    server.cancel(&id).await; // a second request changes nothing
    server.until_done(&id).await;
    let next = server.submit(&example_json("sheet")).await;
    assert_eq!(server.until_done(&next).await["status"], "succeeded");
    let events = server.events(&id, 0).await.rest().await;
    assert_eq!(
        events
            .iter()
            .filter(|event| event["type"] == "done")
            .count(),
        1
    );
    assert_eq!(events.last().unwrap()["type"], "done");
}

/// Operations: CancelJob
#[tokio::test]
async fn canceling_a_finished_job_does_not_change_it() {
    let server = server().await;
    let id = server.submit(&example_json("sheet")).await;
    let done = server.until_done(&id).await;
    let answer = server.cancel(&id).await;
    assert_eq!(answer["outcome"], "already_terminal");
    assert_eq!(answer["job"], done);
}
