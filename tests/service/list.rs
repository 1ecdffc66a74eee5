//! GET /v1/jobs.

use reqwest::StatusCode;
use serde_json::Value;
use suite::{example_json, harness::large};

use crate::{SIGNORINI, server};

/// Operations: ListJobs
#[tokio::test]
async fn pages_contain_every_job_once_newest_first() {
    let server = server().await;
    let mut ids = vec![];
    for _ in 0..7 {
        ids.push(server.submit(&example_json("sheet")).await);
    }
    ids.reverse();
    let (mut seen, mut token) = (vec![], String::new());
    loop {
        let page = server
            .json(&format!("/v1/jobs?page_size=3&page_token={token}"))
            .await;
        let jobs = page["jobs"].as_array().unwrap();
        assert!(jobs.len() <= 3);
        seen.extend(
            jobs.iter()
                .map(|job| job["id"].as_str().unwrap().to_string()),
        );
        match page["next_page_token"].as_str() {
            Some(next) => token = next.to_string(),
            None => break,
        }
    }
    assert_eq!(seen, ids);
}

/// Operations: ListJobs
#[tokio::test]
async fn jobs_are_found_by_status_with_their_queue_positions() {
    let server = suite::harness::Server::start_alone(SIGNORINI, &["--workers", "1"]).await;
    let front = server.submit(&large()).await;
    server.until_running(&front).await;
    let waiting = [
        server.submit(&example_json("sheet")).await,
        server.submit(&example_json("sheet")).await,
    ];
    let ids = async |query: &str| -> Vec<String> {
        let page = server.json(&format!("/v1/jobs?{query}")).await;
        page["jobs"]
            .as_array()
            .unwrap()
            .iter()
            .map(|job| job["id"].as_str().unwrap().to_string())
            .collect()
    };
    assert_eq!(ids("status=running").await, [front.as_str()]);
    assert_eq!(
        ids("status=queued").await,
        [waiting[1].as_str(), waiting[0].as_str()]
    );
    assert_eq!(ids("status=queued,running").await.len(), 3);
    assert_eq!(ids("status=queued&status=running").await.len(), 3);
    assert_eq!(ids("status=failed").await.len(), 0);
    let queue = server.job(&waiting[1]).await["queue"].take();
    assert_eq!(
        (queue["position"].as_i64(), queue["ahead"].as_i64()),
        (Some(2), Some(1))
    );
    assert_eq!(queue["reason"], "workers_busy");
    // A token belongs to its list.
    let page = server.json("/v1/jobs?status=queued&page_size=1").await;
    let token = page["next_page_token"].as_str().unwrap();
    let other = server
        .get(&format!(
            "/v1/jobs?status=running&page_size=1&page_token={token}"
        ))
        .send()
        .await
        .unwrap();
    assert_eq!(other.status(), StatusCode::BAD_REQUEST);
    assert_eq!(
        other.json::<Value>().await.unwrap()["code"],
        "bad-page-token"
    );
}
