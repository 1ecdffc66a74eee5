//! Answers from earlier results, and jobs that share one solution.

use rpc::pb;
use serde_json::{Value, json};
use suite::{
    example, example_json,
    harness::{Server, block},
};

use crate::{
    SIGNORINI,
    grpc::{connect, message},
    server,
};

/// Operations: CreateJob
#[tokio::test]
async fn the_same_input_is_answered_from_the_first_result() {
    let server = server().await;
    let mut problem = example_json("cylinder");
    let first = server.solve(&json!({ "problem": problem })).await;
    assert_eq!(
        (&first["status"], &first["cached_from"]),
        (&json!("succeeded"), &Value::Null)
    );
    problem["title"] = json!("the title is for people");
    let second = server
        .solve(&json!({ "problem": problem, "name": "mine" }))
        .await;
    assert_eq!(second["cached_from"], first["id"]);
    assert_eq!(second["name"], "mine");
    let id = second["id"].as_str().unwrap();
    let events = server.events(id, 0).await.rest().await;
    let kinds: Vec<&str> = events
        .iter()
        .map(|event| event["type"].as_str().unwrap())
        .collect();
    assert_eq!(kinds, ["status", "status", "done"]);

    // all results of the source exist, even after the source is deleted
    let everything = async |id: &str| {
        let at = |what: &str| format!("/v1/jobs/{id}/{what}");
        let mut all = vec![];
        for what in ["result", "history", "profiles/top", "fields?format=json"] {
            all.push(server.json(&at(what)).await);
        }
        all
    };
    let source = first["id"].as_str().unwrap();
    let before = everything(source).await;
    assert!(
        server
            .delete(&format!("/v1/jobs/{source}"))
            .send()
            .await
            .unwrap()
            .status()
            .is_success()
    );
    assert_eq!(everything(id).await, before);
    assert_eq!(
        server.json(&format!("/v1/jobs/{id}/problem")).await["title"],
        "the title is for people"
    );

    // the same over gRPC; not with the two other values of `cache`
    let mut grpc = connect(&server).await;
    let create = |cache: pb::Cache| pb::CreateJobRequest {
        problem: Some(message(&example("cylinder"))),
        cache: cache.into(),
        wait: Some(60.0),
        ..Default::default()
    };
    let over_grpc = grpc
        .create_job(create(pb::Cache::Unspecified))
        .await
        .unwrap()
        .into_inner();
    assert_eq!(over_grpc.cached_from.as_deref(), Some(id));
    for cache in [pb::Cache::Refresh, pb::Cache::Off] {
        let over_grpc = grpc.create_job(create(cache)).await.unwrap().into_inner();
        assert_eq!(
            (over_grpc.status(), over_grpc.cached_from),
            (pb::Status::Succeeded, None)
        );
    }
}

/// Operations: CreateJob, CancelJob
#[tokio::test]
async fn two_jobs_of_the_same_input_are_solved_once_and_canceled_separately() {
    let server = Server::start_alone(SIGNORINI, &["--workers", "2"]).await;
    let post = async || {
        let job = server
            .create_job(&json!({ "problem": block(120, 110) }))
            .await;
        job["id"].as_str().unwrap().to_owned()
    };
    let (source, coalesced, canceled) = (post().await, post().await, post().await);
    let waiting = server.job(&coalesced).await;
    assert_eq!(waiting["queue"]["reason"], "coalesced");
    assert_eq!(
        server.json("/v1/queue").await["running"],
        1,
        "one worker of two"
    );
    assert_eq!(server.cancel(&canceled).await["outcome"], "canceled");
    assert_eq!(server.until_done(&source).await["status"], "succeeded");
    let done = server.until_done(&coalesced).await;
    assert_eq!(
        (&done["status"], &done["cached_from"]),
        (&json!("succeeded"), &json!(source))
    );
    let digest = async |id: &str| {
        server.json(&format!("/v1/jobs/{id}/result")).await["summary"]["digest"].take()
    };
    assert_eq!(digest(&source).await, digest(&coalesced).await);
    // if the problem does not converge, both fail, with the partial result
    let mut problem = block(60, 60);
    problem["solver"] = json!({ "max_iterations": 2 });
    let post = async || {
        let job = server.create_job(&json!({ "problem": problem })).await;
        job["id"].as_str().unwrap().to_owned()
    };
    for id in [post().await, post().await] {
        let done = server.until_done(&id).await;
        assert_eq!(
            (&done["status"], &done["reason"]),
            (&json!("failed"), &json!("not_converged"))
        );
        assert_eq!(done["result_available"], "partial");
        assert_eq!(
            server.json(&format!("/v1/jobs/{id}/result")).await["summary"]["converged"],
            false
        );
    }
}
