//! Repeated requests: idempotency keys, and ids chosen by the client.

use reqwest::StatusCode;
use rpc::pb;
use serde_json::{Value, json};
use suite::{example, example_json, harness::answer};
use tonic::Code;

use crate::{
    grpc::{connect, message},
    server,
};

fn body(name: &str) -> Value {
    json!({ "problem": example_json("sheet"), "name": name, "cache": "off" })
}

/// The same over gRPC.
fn grpc_body(name: &str) -> pb::CreateJobRequest {
    pb::CreateJobRequest {
        problem: Some(message(&example("sheet"))),
        name: Some(name.into()),
        cache: pb::Cache::Off.into(),
        ..Default::default()
    }
}

/// Operations: CreateJob
#[tokio::test]
async fn a_repeated_key_returns_the_current_state_of_the_same_job() {
    let server = server().await;
    let post = async |body: Value, key: &str| {
        let request = server.post("/v1/jobs").header("Idempotency-Key", key);
        let response = request.json(&body).send().await.unwrap();
        let replayed = response.headers().contains_key("idempotency-replayed");
        let status = response.status();
        (status, replayed, response.json::<Value>().await.unwrap())
    };
    let (status, replayed, first) = post(body("a"), "k").await;
    assert_eq!((status, replayed), (StatusCode::ACCEPTED, false));
    let id = first["id"].as_str().unwrap();
    server.until_done(id).await;
    let (status, replayed, again) = post(body("a"), "k").await;
    assert_eq!((status, replayed), (StatusCode::ACCEPTED, true));
    assert_eq!(
        (&again["id"], &again["status"]),
        (&first["id"], &json!("succeeded"))
    );
    let (status, _, refused) = post(body("b"), "k").await;
    assert_eq!(status, StatusCode::UNPROCESSABLE_ENTITY);
    assert_eq!(refused["code"], "idempotency-key-reuse");
    let (status, replayed, other) = post(body("a"), "another").await;
    assert_eq!((status, replayed), (StatusCode::ACCEPTED, false));
    assert_ne!(other["id"], first["id"]);
    let (status, _, refused) = post(body("a"), &"k".repeat(256)).await;
    assert_eq!(status, StatusCode::BAD_REQUEST);
    assert_eq!(refused["code"], "bad-parameter");

    // the same key over the other protocol is the same request
    let mut grpc = connect(&server).await;
    let request = |name| pb::CreateJobRequest {
        request_id: Some("k".into()),
        ..grpc_body(name)
    };
    let over_grpc = grpc.create_job(request("a")).await.unwrap();
    assert_eq!(
        over_grpc.metadata().get("idempotency-replayed").unwrap(),
        "true"
    );
    assert_eq!(first["id"], over_grpc.into_inner().id);
    let refused = grpc.create_job(request("b")).await.unwrap_err();
    assert_eq!(refused.code(), Code::AlreadyExists);

    // a key outlives its job, and is answered with *deleted*
    let deleted = server
        .delete(&format!("/v1/jobs/{id}"))
        .send()
        .await
        .unwrap();
    assert_eq!(deleted.status(), StatusCode::NO_CONTENT);
    let (status, _, gone) = post(body("a"), "k").await;
    assert_eq!(
        (status, &gone["code"]),
        (StatusCode::GONE, &json!("deleted"))
    );
}

/// A thousand answers, fifty jobs.
/// Operations: CreateJob
#[tokio::test]
async fn many_clients_with_the_same_key_at_once_make_one_job() {
    let server = server().await;
    let mut asking = vec![];
    for n in 0..1000 {
        let request = server
            .post("/v1/jobs")
            .header("Idempotency-Key", format!("key {}", n % 50))
            .json(&body("x"));
        asking.push(async move {
            let response = request.send().await.unwrap();
            assert_eq!(response.status(), StatusCode::ACCEPTED);
            let job: Value = response.json().await.unwrap();
            (n % 50, job["id"].as_str().unwrap().to_owned())
        });
    }
    let answers = futures_util::future::join_all(asking).await;
    let mut pairs: Vec<_> = answers.into_iter().collect();
    pairs.sort();
    pairs.dedup();
    assert_eq!(pairs.len(), 50);
    assert_eq!(server.json("/v1/jobs/count").await["total"], 50);
}

/// Operations: PutJob
#[tokio::test]
async fn a_job_may_have_an_id_chosen_by_the_client() {
    let server = server().await;
    let id = "job_01890a5d-ac96-774b-bcce-b302099a8057";
    let put = async |id: &str, body: Value| {
        answer(server.put(&format!("/v1/jobs/{id}")).json(&body)).await
    };
    let (status, job) = put(id, body("a")).await;
    assert_eq!((status, &job["id"]), (StatusCode::ACCEPTED, &json!(id)));
    server.until_done(id).await;
    let (status, job) = put(id, body("a")).await;
    assert_eq!(
        (status, &job["status"]),
        (StatusCode::OK, &json!("succeeded"))
    );
    let (status, refused) = put(id, body("b")).await;
    assert_eq!(
        (status, &refused["code"]),
        (StatusCode::CONFLICT, &json!("id-conflict"))
    );
    let (status, _) = put("job_7", body("a")).await;
    assert_eq!(status, StatusCode::NOT_FOUND);
    let mut grpc = connect(&server).await;
    let request = |name| pb::CreateJobRequest {
        job_id: Some(id.into()),
        ..grpc_body(name)
    };
    let over_grpc = grpc.create_job(request("a")).await.unwrap().into_inner();
    assert_eq!(over_grpc.status(), pb::Status::Succeeded);
    let refused = grpc.create_job(request("b")).await.unwrap_err();
    assert_eq!(refused.code(), Code::AlreadyExists);
    let deleted = server
        .delete(&format!("/v1/jobs/{id}"))
        .send()
        .await
        .unwrap();
    assert_eq!(deleted.status(), StatusCode::NO_CONTENT);
    let (status, _) = put(id, body("a")).await;
    assert_eq!(status, StatusCode::GONE, "a name is not given twice");
}

/// Operations: BatchCreateJobs
#[tokio::test]
async fn a_batch_is_accepted_completely_or_not_at_all() {
    let server = server().await;
    let post = async |body: Value| {
        let request = server.post("/v1/jobs/batch").header("Idempotency-Key", "b");
        answer(request.json(&body)).await
    };
    let mut broken = example_json("sheet");
    broken["materials"][0]["poissons_ratio"] = json!(0.7);
    let jobs = json!({ "jobs": [body("a"), { "problem": broken, "priority": 99 }, { "name": 7 }] });
    let (status, refused) = post(jobs).await;
    assert_eq!(status, StatusCode::UNPROCESSABLE_ENTITY);
    let pointers: Vec<&str> = refused["errors"]
        .as_array()
        .unwrap()
        .iter()
        .map(|error| error["pointer"].as_str().unwrap())
        .collect();
    assert_eq!(
        pointers,
        ["/jobs/2/name", "/jobs/2/problem"],
        "structure first"
    );
    let jobs = json!({ "jobs": [body("a"), { "problem": broken, "priority": 99 }] });
    let (_, refused) = post(jobs).await;
    let pointers: Vec<&str> = refused["errors"]
        .as_array()
        .unwrap()
        .iter()
        .map(|error| error["pointer"].as_str().unwrap())
        .collect();
    assert_eq!(
        pointers,
        [
            "/jobs/1/priority",
            "/jobs/1/problem/materials/0/poissons_ratio"
        ]
    );
    assert_eq!(server.json("/v1/jobs/count").await["total"], 0);

    let jobs = json!({ "jobs": [body("a"), body("b"), body("c")] });
    let (status, batch) = post(jobs.clone()).await;
    assert_eq!(status, StatusCode::ACCEPTED);
    let ids = |batch: &Value| -> Vec<Value> {
        batch["jobs"]
            .as_array()
            .unwrap()
            .iter()
            .map(|job| job["id"].clone())
            .collect()
    };
    assert_eq!(batch["jobs"][1]["name"], "b");
    let (_, again) = post(jobs).await;
    assert_eq!(ids(&again), ids(&batch), "in the same order");
    let (status, refused) = post(json!({ "jobs": [] })).await;
    assert_eq!(
        (status, &refused["errors"][0]["pointer"]),
        (StatusCode::UNPROCESSABLE_ENTITY, &json!("/jobs"))
    );

    let mut grpc = connect(&server).await;
    let request = pb::BatchCreateJobsRequest {
        jobs: vec![grpc_body("a"), grpc_body("b"), grpc_body("c")],
        request_id: Some("b".into()),
    };
    let over_grpc = grpc.batch_create_jobs(request).await.unwrap().into_inner();
    let ids_over_grpc: Vec<Value> = over_grpc
        .jobs
        .into_iter()
        .map(|job| json!(job.id))
        .collect();
    assert_eq!(ids_over_grpc, ids(&batch));
}
