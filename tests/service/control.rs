//! Control of jobs and of the queue: retry, edit, delete, bulk operations, pause.

use reqwest::{Method, StatusCode};
use rpc::pb;
use serde_json::{Value, json};
use suite::{
    example_json,
    harness::{Server, answer, block, large},
};
use tonic::Code;

use crate::{SIGNORINI, grpc::connect, server};

/// Operations: RetryJob
#[tokio::test]
async fn an_ended_job_is_retried_as_a_new_one() {
    let server = server().await;
    let mut problem = example_json("rectangular_punch");
    problem["solver"] = json!({ "max_iterations": 3 });
    let body = json!({ "problem": problem, "name": "n", "labels": { "a": "b" }, "limits": { "timeout_s": 7 } });
    let first = server.solve(&body).await;
    assert_eq!(first["reason"], "not_converged");
    let path = format!("/v1/jobs/{}/retry", first["id"].as_str().unwrap());
    let response = server
        .post(&path)
        .header("Idempotency-Key", "r")
        .send()
        .await
        .unwrap();
    assert_eq!(response.status(), StatusCode::ACCEPTED);
    let second: Value = response.json().await.unwrap();
    assert_eq!(second["parent"], first["id"]);
    for field in ["name", "labels", "priority", "limits", "input_hash"] {
        assert_eq!(second[field], first[field], "{field}");
    }
    let again: Value = server
        .post(&path)
        .header("Idempotency-Key", "r")
        .send()
        .await
        .unwrap()
        .json()
        .await
        .unwrap();
    assert_eq!(again["id"], second["id"]);
    let id = second["id"].as_str().unwrap();
    let done = server.until_done(id).await;
    assert_eq!(
        (&done["status"], &done["cached_from"]),
        (&json!("failed"), &Value::Null)
    );
    let title = server.json(&format!("/v1/jobs/{id}/problem")).await["title"].take();
    assert_eq!(title, problem["title"]);
    let mut grpc = connect(&server).await;
    let request = pb::RetryJobRequest {
        id: id.into(),
        ..Default::default()
    };
    let third = grpc.retry_job(request).await.unwrap().into_inner();
    assert_eq!(third.parent.as_deref(), Some(id));
}

/// Operations: RetryJob
#[tokio::test]
async fn a_job_that_timed_out_is_retried_with_a_higher_limit() {
    let server = server().await;
    let body = json!({ "problem": large(), "cache": "off", "limits": { "timeout_s": 0.3, "queue_ttl_s": 60 } });
    let first = server.solve(&body).await;
    assert_eq!(first["reason"], "timed_out");
    let retry = format!("/v1/jobs/{}/retry", first["id"].as_str().unwrap());
    let (status, second) = answer(
        server
            .post(&retry)
            .json(&json!({ "limits": { "timeout_s": 900 }, "priority": 3 })),
    )
    .await;
    assert_eq!(status, StatusCode::ACCEPTED);
    assert_eq!(
        (&second["limits"], &second["priority"]),
        (
            &json!({ "timeout_s": 900.0, "queue_ttl_s": 60.0 }),
            &json!(3)
        )
    );
    assert_eq!(second["parent"], first["id"]);
    server.cancel(second["id"].as_str().unwrap()).await;
    // unknown fields, and values out of bounds
    for (body, pointer) in [
        (json!({ "timeout_s": 900 }), "/timeout_s"),
        (
            json!({ "limits": { "timeout_s": -1 } }),
            "/limits/timeout_s",
        ),
        (json!({ "priority": 11 }), "/priority"),
    ] {
        let (status, refused) = answer(server.post(&retry).json(&body)).await;
        assert_eq!(status, StatusCode::UNPROCESSABLE_ENTITY);
        assert_eq!(refused["errors"][0]["pointer"], pointer, "{refused}");
    }
    let request = pb::RetryJobRequest {
        id: first["id"].as_str().unwrap().into(),
        limits: Some(pb::Limits {
            timeout_s: Some(800.0),
            queue_ttl_s: None,
        }),
        priority: Some(-2),
        ..Default::default()
    };
    let third = connect(&server).await.retry_job(request).await;
    let third = third.unwrap().into_inner();
    assert_eq!(
        (third.limits.unwrap().timeout_s, third.priority),
        (Some(800.0), -2)
    );
    server.cancel(&third.id).await;
}

/// Operations: RetryJob, DeleteJob
#[tokio::test]
async fn a_job_that_waits_or_runs_is_neither_retried_nor_deleted() {
    let server = Server::start(SIGNORINI, &["--workers", "1"]).await;
    let running = server.submit(&large()).await;
    let waiting = server.submit(&example_json("sheet")).await;
    let mut grpc = connect(&server).await;
    for id in [&running, &waiting] {
        let response = server
            .post(&format!("/v1/jobs/{id}/retry"))
            .send()
            .await
            .unwrap();
        assert_eq!(response.status(), StatusCode::CONFLICT);
        let response = server
            .delete(&format!("/v1/jobs/{id}"))
            .send()
            .await
            .unwrap();
        assert_eq!(response.status(), StatusCode::CONFLICT);
        assert_eq!(
            response.json::<Value>().await.unwrap()["code"],
            "job-active"
        );
        let refused = grpc
            .delete_job(pb::DeleteJobRequest { id: id.clone() })
            .await
            .unwrap_err();
        assert_eq!(refused.code(), Code::FailedPrecondition);
    }
    server.cancel(&running).await;
}

/// Operations: DeleteJob
#[tokio::test]
async fn a_deleted_job_is_removed_with_its_events_and_result() {
    let server = server().await;
    let id = server.submit(&example_json("sheet")).await;
    server.until_done(&id).await;
    assert_eq!(
        server
            .delete(&format!("/v1/jobs/{id}"))
            .send()
            .await
            .unwrap()
            .status(),
        StatusCode::NO_CONTENT
    );
    for what in [
        "",
        "/events",
        "/history",
        "/result",
        "/problem",
        "/fields",
        "/profiles/top",
    ] {
        let response = server
            .get(&format!("/v1/jobs/{id}{what}"))
            .send()
            .await
            .unwrap();
        assert_eq!(response.status(), StatusCode::GONE, "{what}");
        assert_eq!(response.json::<Value>().await.unwrap()["code"], "deleted");
    }
    assert_eq!(server.json("/v1/jobs").await["jobs"], json!([]));
    let mut grpc = connect(&server).await;
    let refused = grpc
        .get_job(pb::GetJobRequest { id: id.clone() })
        .await
        .unwrap_err();
    assert_eq!(refused.code(), Code::NotFound);
    assert!(refused.message().starts_with("deleted"), "{refused}");
}

/// Operations: UpdateJob
#[tokio::test]
async fn name_labels_priority_and_pin_are_changed_if_the_version_matches() {
    let server = server().await;
    let id = server.submit(&example_json("sheet")).await;
    let done = server.until_done(&id).await;
    let path = format!("/v1/jobs/{id}");
    let patch = async |body: Value, version: Option<&str>| {
        let mut request = server.request(Method::PATCH, &path).json(&body);
        if let Some(version) = version {
            request = request.header("If-Match", version);
        }
        answer(request).await
    };
    let seen = format!("\"{}\"", done["version"]);
    let edit = json!({ "name": "n", "labels": { "a": "b" }, "priority": 4, "pinned": true });
    let (status, job) = patch(edit, Some(&seen)).await;
    assert_eq!(status, StatusCode::OK);
    assert_eq!(
        (
            &job["name"],
            &job["labels"],
            &job["priority"],
            &job["pinned"]
        ),
        (&json!("n"), &json!({ "a": "b" }), &json!(4), &json!(true))
    );
    assert_eq!(
        job["version"].as_i64(),
        done["version"].as_i64().map(|version| version + 1)
    );
    let (status, refused) = patch(json!({ "name": "m" }), Some(&seen)).await;
    assert_eq!(
        (status, &refused["code"]),
        (StatusCode::PRECONDITION_FAILED, &json!("stale-version"))
    );
    let (status, refused) = patch(json!({ "name": 7, "priority": 99, "color": "red" }), None).await;
    assert_eq!(status, StatusCode::UNPROCESSABLE_ENTITY);
    let errors = refused["errors"].as_array().unwrap();
    assert_eq!(errors.len(), 2, "{errors:?}"); // ranges are checked only if the types are right
    let (status, _) = patch(json!({ "priority": 11 }), None).await;
    assert_eq!(status, StatusCode::UNPROCESSABLE_ENTITY);
    let (_, job) = patch(json!({ "name": null }), None).await;
    assert_eq!(
        (&job["name"], &job["labels"]),
        (&Value::Null, &json!({ "a": "b" }))
    );
    // found by its new label, and not by an old one
    let found =
        async |query: &str| server.json(&format!("/v1/jobs/count?{query}")).await["total"].take();
    assert_eq!(
        (found("label.a=b").await, found("label.a=c").await),
        (json!(1), json!(0))
    );

    let mut grpc = connect(&server).await;
    let request = pb::UpdateJobRequest {
        id: id.clone(),
        update_mask: Some(prost_types::FieldMask {
            paths: vec!["labels".into(), "pinned".into()],
        }),
        ..Default::default()
    };
    let job = grpc.update_job(request).await.unwrap().into_inner();
    assert_eq!((job.labels.len(), job.pinned, job.priority), (0, false, 4));
    let request = pb::UpdateJobRequest {
        id,
        priority: Some(1),
        version: Some(1),
        ..Default::default()
    };
    assert_eq!(
        grpc.update_job(request).await.unwrap_err().code(),
        Code::Aborted
    );
}

/// Operations: CancelJobs, DeleteJobs
#[tokio::test]
async fn bulk_cancel_and_delete_require_a_filter() {
    let server = Server::start(SIGNORINI, &["--workers", "1"]).await;
    let front = server.submit(&large()).await;
    let mut labeled = vec![];
    for n in 0..6 {
        let body = json!({ "problem": example_json("sheet"), "cache": "off", "labels": { "odd": (n % 2).to_string() } });
        let job = server.create_job(&body).await;
        labeled.push(job["id"].as_str().unwrap().to_owned());
    }
    let act = async |method: Method, path: &str| answer(server.request(method, path)).await;
    for (method, path) in [
        (Method::POST, "/v1/jobs/cancel"),
        (Method::DELETE, "/v1/jobs"),
    ] {
        let (status, refused) = act(method, path).await;
        assert_eq!(
            (status, &refused["code"]),
            (StatusCode::BAD_REQUEST, &json!("missing-filter"))
        );
    }
    let (status, many) = act(Method::POST, "/v1/jobs/cancel?label.odd=1").await;
    assert_eq!(
        (status, many),
        (StatusCode::OK, json!({ "matched": 3, "changed": 3 }))
    );
    for (n, id) in labeled.iter().enumerate() {
        let expected = if n % 2 == 1 { "canceled" } else { "queued" };
        assert_eq!(server.job(id).await["status"], expected);
    }
    // only ended jobs are deleted
    let (_, many) = act(Method::DELETE, "/v1/jobs?status=queued,canceled").await;
    assert_eq!(many, json!({ "matched": 6, "changed": 3 }));
    let mut grpc = connect(&server).await;
    let filter = pb::JobFilter {
        labels: [("odd".to_string(), "0".to_string())].into(),
        ..Default::default()
    };
    let request = pb::CancelJobsRequest {
        filter: Some(filter.clone()),
    };
    let many = grpc.cancel_jobs(request).await.unwrap().into_inner();
    assert_eq!((many.matched, many.changed), (3, 3));
    let request = pb::DeleteJobsRequest {
        filter: Some(filter),
    };
    let many = grpc.delete_jobs(request).await.unwrap().into_inner();
    assert_eq!((many.matched, many.changed), (3, 3));
    let refused = grpc
        .delete_jobs(pb::DeleteJobsRequest { filter: None })
        .await
        .unwrap_err();
    assert_eq!(refused.code(), Code::InvalidArgument);
    server.cancel(&front).await;
}

/// Operations: GetQueue, PauseQueue, ResumeQueue
#[tokio::test]
async fn a_paused_queue_accepts_jobs_and_does_not_start_them() {
    let mut server = server().await;
    let act = async |server: &Server, verb: &str| -> Value {
        server
            .post(&format!("/v1/queue/{verb}"))
            .send()
            .await
            .unwrap()
            .json()
            .await
            .unwrap()
    };
    assert_eq!(act(&server, "pause").await["paused"], true);
    let id = server.submit(&example_json("sheet")).await;
    let job = server.job(&id).await;
    assert_eq!(
        (&job["status"], &job["queue"]["reason"]),
        (&json!("queued"), &json!("paused"))
    );
    server.terminate().await;
    server.restart().await;
    let queue = server.json("/v1/queue").await;
    assert_eq!(
        (&queue["paused"], &queue["queued"]),
        (&json!(true), &json!(1))
    );
    let mut grpc = connect(&server).await;
    let over_grpc = grpc
        .get_queue(pb::GetQueueRequest {})
        .await
        .unwrap()
        .into_inner();
    assert!(over_grpc.paused && over_grpc.queued == 1 && over_grpc.workers == 2);
    let over_grpc = grpc
        .resume_queue(pb::ResumeQueueRequest {})
        .await
        .unwrap()
        .into_inner();
    assert!(!over_grpc.paused);
    assert_eq!(server.until_done(&id).await["status"], "succeeded");
    assert!(
        grpc.pause_queue(pb::PauseQueueRequest {})
            .await
            .unwrap()
            .into_inner()
            .paused
    );
    assert_eq!(act(&server, "resume").await["paused"], false);
}

/// Operations: CreateJob
#[tokio::test]
async fn time_limits_end_a_job_with_reasons_of_their_own() {
    let server = Server::start_alone(SIGNORINI, &["--workers", "1"]).await;
    let post = async |problem: Value, limits: Value| {
        let body = json!({ "problem": problem, "limits": limits, "cache": "off" });
        let job = server.create_job(&body).await;
        job["id"].as_str().unwrap().to_owned()
    };
    // longer than the second between two looks at what waits
    let long = post(block(600, 280), json!({ "timeout_s": 1.5 })).await;
    let late = post(example_json("sheet"), json!({ "queue_ttl_s": 0.2 })).await;
    let done = server.until_done(&late).await;
    assert_eq!(
        (&done["status"], &done["reason"], &done["attempt"]),
        (&json!("failed"), &json!("queue_expired"), &json!(0))
    );
    assert_eq!(done["failure"]["type"], "/v1/errors/queue-expired");
    let done = server.until_done(&long).await;
    assert_eq!(
        (&done["status"], &done["reason"]),
        (&json!("failed"), &json!("timed_out"))
    );
    let run_s = done["run_s"].as_f64().unwrap();
    assert!((1.0..4.0).contains(&run_s), "{run_s}");
}

/// An administrator's limit holds for jobs, sweeps and retries; what gives no time of its own has less.
#[tokio::test]
async fn no_submission_may_run_longer_than_the_administrator_allows() {
    let server = Server::start(SIGNORINI, &["--max-timeout-s", "900"]).await;
    let problem = example_json("rectangular_punch");
    let refused = |(status, answer): (StatusCode, Value)| {
        assert_eq!(status, StatusCode::UNPROCESSABLE_ENTITY, "{answer:#}");
        let first = &answer["errors"][0];
        assert_eq!(first["pointer"], "/limits/timeout_s", "{answer:#}");
        assert_eq!(first["expected"], "more than 0, at most 900 seconds");
    };
    let long = json!({ "timeout_s": 901 });
    let job = json!({ "problem": problem, "limits": long });
    refused(answer(server.post("/v1/jobs").json(&job)).await);
    let axis = json!({ "path": "/contacts/0/friction/coefficient", "values": [0.1, 0.2] });
    let sweep = json!({ "base": problem, "axes": [axis], "limits": long });
    refused(answer(server.post("/v1/sweeps").json(&sweep)).await);
    // the usual limit of so many members on one body, 594 s and 6 s for each, is cut and not refused
    let path = "/contacts/0/friction/coefficient";
    let many = json!({ "path": path, "linspace": { "start": 0.1, "stop": 0.2, "count": 60 } });
    let sweep = json!({ "base": problem, "axes": [many] });
    let (status, sweep) = answer(server.post("/v1/sweeps").json(&sweep)).await;
    assert_eq!(status, StatusCode::ACCEPTED, "{sweep:#}");
    let of_sweep = format!("/v1/jobs?sweep={}", sweep["id"].as_str().unwrap());
    let (_, page) = answer(server.get(&of_sweep)).await;
    assert_eq!(page["jobs"][0]["limits"]["timeout_s"], 900.0, "{page:#}");
    let done = server
        .solve(&json!({ "problem": problem, "limits": { "timeout_s": 900 } }))
        .await;
    assert_eq!(done["status"], "succeeded");
    let usual = server.solve(&json!({ "problem": problem })).await;
    assert_eq!(usual["limits"]["timeout_s"], 600.0);
    let retry = format!("/v1/jobs/{}/retry", usual["id"].as_str().unwrap());
    refused(answer(server.post(&retry).json(&json!({ "limits": long }))).await);
}
