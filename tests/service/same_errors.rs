//! Both protocols reject the same requests, with the same code, the same message and the same list of violations.

use reqwest::Method;
use rpc::pb;
use serde_json::{Value, json};
use suite::{example, example_json, harness::soon};
use tonic::{Response, Status};
use tonic_types::StatusExt;

use crate::{
    grpc::{connect, message},
    server,
};

/// The error's code and its message.
fn refused<T>(answer: Result<Response<T>, Status>) -> (String, String) {
    let status = answer.map(|_| ()).expect_err("it should have been refused");
    let details = status.get_error_details();
    let info = details.error_info().expect("every error has its code");
    assert_eq!(info.domain, "signorini");
    let (code, text) = status.message().split_once(": ").unwrap();
    assert_eq!(code, info.reason);
    (code.to_owned(), text.to_owned())
}

/// Operations: CreateJob, BatchCreateJobs, GetJob, GetJobProblem, WatchJob, WaitJob, GetResult, ListIterations, StreamResult, GetProfile, CancelJob, RetryJob, DeleteJob, UpdateJob, ListJobs, CountJobs, CancelJobs, DeleteJobs, GetMesh, DeleteMesh
#[tokio::test]
async fn both_protocols_reject_the_same_requests() {
    let server = server().await;
    let mut grpc = connect(&server).await;
    let done = server.submit(&example_json("sheet")).await;
    server.until_done(&done).await;
    let unknown = "job_01890a5d-ac96-774b-bcce-b302099a8057".to_owned();
    let rest = async |method: Method, path: &str, body: Option<Value>| {
        let mut request = server.request(method, path);
        if let Some(body) = &body {
            request = request.json(body);
        }
        let document: Value = request.send().await.unwrap().json().await.unwrap();
        let text = |name: &str| document[name].as_str().unwrap().to_owned();
        (text("code"), text("detail"))
    };
    let get = async |path: &str| rest(Method::GET, path, None).await;

    let mut wrong = example_json("sheet");
    wrong["materials"][0]["poissons_ratio"] = json!(0.7);
    wrong["contacts"][0]["boundary"] = json!("nowhere");
    let mut text: Value = serde_json::from_str(&example("sheet")).unwrap();
    text["materials"][0]["poissons_ratio"] = json!(0.7);
    text["contacts"][0]["boundary"] = json!("nowhere");
    let create = pb::CreateJobRequest {
        problem: Some(message(&text.to_string())),
        priority: 12,
        ..Default::default()
    };
    let body = json!({ "problem": wrong, "priority": 12 });
    let by_grpc = grpc.create_job(create.clone()).await;
    let violations = by_grpc.as_ref().unwrap_err().get_error_details();
    let violations = &violations.bad_request().unwrap().field_violations;
    let document: Value = (server.post("/v1/jobs").json(&body).send().await.unwrap())
        .json()
        .await
        .unwrap();
    let errors = document["errors"].as_array().unwrap();
    assert_eq!(errors.len(), violations.len());
    for (error, violation) in errors.iter().zip(violations) {
        assert_eq!(error["pointer"], violation.field);
        assert!(
            violation
                .description
                .contains(error["hint"].as_str().unwrap())
        );
    }
    assert_eq!(
        refused(by_grpc),
        rest(Method::POST, "/v1/jobs", Some(body)).await
    );

    for id in [&unknown, &"job_7".to_owned()] {
        let at = |verb: &str| format!("/v1/jobs/{id}{verb}");
        let id = id.clone();
        let get_job = grpc.get_job(pb::GetJobRequest { id: id.clone() }).await;
        assert_eq!(refused(get_job), get(&at("")).await);
        let problem = grpc.get_job_problem(pb::GetJobProblemRequest { id: id.clone() });
        assert_eq!(refused(problem.await), get(&at("/problem")).await);
        let after_seq = 0;
        let watch = pb::WatchJobRequest {
            id: id.clone(),
            after_seq,
        };
        assert_eq!(
            refused(grpc.watch_job(watch).await),
            get(&at("/events")).await
        );
        let wait = pb::WaitJobRequest {
            id: id.clone(),
            wait: 1.0,
            ..Default::default()
        };
        assert_eq!(
            refused(grpc.wait_job(wait).await),
            get(&at("?wait=1")).await
        );
        let result = grpc
            .get_result(pb::GetResultRequest { id: id.clone() })
            .await;
        assert_eq!(refused(result), get(&at("/result")).await);
        let rows = pb::ListIterationsRequest {
            id: id.clone(),
            max_points: None,
            ..Default::default()
        };
        assert_eq!(
            refused(grpc.list_iterations(rows).await),
            get(&at("/history")).await
        );
        let fields = pb::StreamResultRequest {
            id: id.clone(),
            ..Default::default()
        };
        assert_eq!(
            refused(grpc.stream_result(fields).await),
            get(&at("/fields")).await
        );
        let profile = pb::GetProfileRequest {
            id: id.clone(),
            boundary: "top".into(),
            ..Default::default()
        };
        assert_eq!(
            refused(grpc.get_profile(profile).await),
            get(&at("/profiles/top")).await
        );
        let cancel = grpc
            .cancel_job(pb::CancelJobRequest { id: id.clone() })
            .await;
        assert_eq!(
            refused(cancel),
            rest(Method::POST, &at("/cancel"), None).await
        );
        let retry = pb::RetryJobRequest {
            id: id.clone(),
            ..Default::default()
        };
        let retried = rest(Method::POST, &at("/retry"), None).await;
        assert_eq!(refused(grpc.retry_job(retry).await), retried);
        let delete = grpc
            .delete_job(pb::DeleteJobRequest { id: id.clone() })
            .await;
        assert_eq!(refused(delete), rest(Method::DELETE, &at(""), None).await);
        let update = pb::UpdateJobRequest {
            id,
            pinned: Some(true),
            ..Default::default()
        };
        let edit = Some(json!({ "pinned": true }));
        let updated = rest(Method::PATCH, &at(""), edit).await;
        assert_eq!(refused(grpc.update_job(update).await), updated);
    }

    let at = |verb: &str| format!("/v1/jobs/{done}{verb}");
    let profile = |boundary: &str, step: Option<&str>| pb::GetProfileRequest {
        id: done.clone(),
        boundary: boundary.into(),
        step: step.map(Into::into),
        ..Default::default()
    };
    let nowhere = grpc.get_profile(profile("nowhere", None)).await;
    assert_eq!(refused(nowhere), get(&at("/profiles/nowhere")).await);
    let boundary = example_json("sheet")["contacts"][0]["boundary"].take();
    let boundary = boundary.as_str().unwrap();
    let never = grpc.get_profile(profile(boundary, Some("never"))).await;
    assert_eq!(
        refused(never),
        get(&at(&format!("/profiles/{boundary}?step=never"))).await
    );
    let rows = pb::ListIterationsRequest {
        id: done.clone(),
        max_points: Some(1),
        ..Default::default()
    };
    let few = grpc.list_iterations(rows).await;
    assert_eq!(refused(few), get(&at("/history?max_points=1")).await);
    let wait = pb::WaitJobRequest {
        id: done.clone(),
        wait: 61.0,
        ..Default::default()
    };
    let (long, by_rest) = (
        refused(grpc.wait_job(wait).await),
        get(&at("?wait=61")).await,
    );
    assert_eq!(long.0, by_rest.0);
    let stale = pb::UpdateJobRequest {
        id: done.clone(),
        pinned: Some(true),
        version: Some(99),
        ..Default::default()
    };
    let request = server
        .request(Method::PATCH, &at(""))
        .header("If-Match", "\"99\"");
    let document: Value = (request
        .json(&json!({ "pinned": true }))
        .send()
        .await
        .unwrap())
    .json()
    .await
    .unwrap();
    let (code, text) = refused(grpc.update_job(stale).await);
    assert_eq!(
        (&document["code"], &document["detail"]),
        (&json!(code), &json!(text))
    );

    let list = |token: &str, order: &str| pb::ListJobsRequest {
        page_token: token.into(),
        order_by: order.into(),
        ..Default::default()
    };
    let token = grpc.list_jobs(list("x", "")).await;
    assert_eq!(refused(token), get("/v1/jobs?page_token=x").await);
    let order = grpc.list_jobs(list("", "size")).await;
    assert_eq!(refused(order), get("/v1/jobs?order_by=size").await);
    let group = pb::CountJobsRequest {
        group_by: "size".into(),
        ..Default::default()
    };
    let grouped = get("/v1/jobs/count?group_by=size").await;
    assert_eq!(refused(grpc.count_jobs(group).await), grouped);
    let none = grpc
        .cancel_jobs(pb::CancelJobsRequest { filter: None })
        .await;
    assert_eq!(
        refused(none),
        rest(Method::POST, "/v1/jobs/cancel", None).await
    );
    let none = grpc
        .delete_jobs(pb::DeleteJobsRequest { filter: None })
        .await;
    assert_eq!(refused(none), rest(Method::DELETE, "/v1/jobs", None).await);
    let none = grpc
        .batch_create_jobs(pb::BatchCreateJobsRequest::default())
        .await;
    let empty = Some(json!({ "jobs": [] }));
    assert_eq!(
        refused(none),
        rest(Method::POST, "/v1/jobs/batch", empty).await
    );
    let mesh = grpc
        .get_mesh(pb::GetMeshRequest {
            hash: "sha256:0".into(),
        })
        .await;
    assert_eq!(refused(mesh), get("/v1/meshes/sha256:0").await);
    let mesh = grpc
        .delete_mesh(pb::DeleteMeshRequest {
            hash: "sha256:0".into(),
        })
        .await;
    assert_eq!(
        refused(mesh),
        rest(Method::DELETE, "/v1/meshes/sha256:0", None).await
    );
}

/// Operations: GetServerInfo, GetCaller, GetQueue, CountJobs, ListJobs, GetJobProblem, ListIterations
#[tokio::test]
async fn both_protocols_return_the_same_about_the_service() {
    let server = server().await;
    let mut grpc = connect(&server).await;
    let info = server.json("/v1/info").await;
    let over_grpc = grpc
        .get_server_info(pb::GetServerInfoRequest {})
        .await
        .unwrap()
        .into_inner();
    let limits = over_grpc.limits.unwrap();
    assert_eq!(
        (&info["version"], &info["api_version"]),
        (&json!(over_grpc.version), &json!(over_grpc.api_version))
    );
    assert_eq!(
        info["limits"]["memory_budget_bytes"],
        limits.memory_budget_bytes
    );
    assert_eq!(info["limits"]["max_wait_s"], limits.max_wait_s);
    assert_eq!(info["field_formats"], json!(over_grpc.field_formats));
    assert_eq!(info["isolation"], "thread");
    assert_eq!(over_grpc.isolation(), pb::Isolation::Thread);
    let caller = grpc
        .get_caller(pb::GetCallerRequest {})
        .await
        .unwrap()
        .into_inner();
    let me = server.json("/v1/me").await;
    let share = |share: Option<pb::Share>| {
        let share = share.unwrap();
        json!({ "used": share.used, "limit": share.limit })
    };
    assert_eq!(
        me,
        json!({ "owner": caller.owner, "scopes": caller.scopes,
            "queued": share(caller.queued), "running": share(caller.running),
            "stored_bytes": { "used": caller.stored_bytes.unwrap().used, "limit": null } })
    );
    // right after the start the dispatcher holds a worker while it looks for a job
    let queue = soon("all workers are idle", async {
        loop {
            let queue = server.json("/v1/queue").await;
            if queue["idle"] == queue["workers"] {
                return queue;
            }
        }
    })
    .await;
    let over_grpc = grpc
        .get_queue(pb::GetQueueRequest {})
        .await
        .unwrap()
        .into_inner();
    let same = json!({ "paused": over_grpc.paused, "queued": over_grpc.queued, "running": over_grpc.running,
        "workers": over_grpc.workers, "idle": over_grpc.idle, "max_queued": over_grpc.max_queued });
    assert_eq!(queue, same);

    for (n, name) in ["sheet", "cylinder", "sheet"].into_iter().enumerate() {
        let body = json!({ "problem": example_json(name), "name": name, "labels": { "n": n.to_string() }, "cache": "off" });
        let request = server
            .post("/v1/jobs")
            .header("Prefer", "wait=60")
            .json(&body);
        assert!(request.send().await.unwrap().status().is_success());
    }
    let count = server
        .json("/v1/jobs/count?group_by=status&status=succeeded")
        .await;
    let status = vec![pb::Status::Succeeded.into()];
    let filter = pb::JobFilter {
        status,
        ..Default::default()
    };
    let request = pb::CountJobsRequest {
        filter: Some(filter.clone()),
        group_by: "status".into(),
    };
    let over_grpc = grpc.count_jobs(request).await.unwrap().into_inner();
    assert_eq!(
        count,
        json!({ "total": over_grpc.total, "groups": over_grpc.groups })
    );
    assert_eq!(count["groups"], json!({ "succeeded": 3 }));
    let page = server
        .json("/v1/jobs?status=succeeded&order_by=finished_at%20asc&name=sheet")
        .await;
    let filter = pb::JobFilter {
        name: Some("sheet".into()),
        ..filter
    };
    let request = pb::ListJobsRequest {
        filter: Some(filter),
        order_by: "finished_at asc".into(),
        ..Default::default()
    };
    let over_grpc = grpc.list_jobs(request).await.unwrap().into_inner();
    let ids: Vec<&Value> = page["jobs"]
        .as_array()
        .unwrap()
        .iter()
        .map(|job| &job["id"])
        .collect();
    let ids_over_grpc: Vec<Value> = over_grpc.jobs.iter().map(|job| json!(job.id)).collect();
    assert_eq!(ids.len(), 2);
    assert!(ids.into_iter().eq(ids_over_grpc.iter()));

    let id = over_grpc.jobs[0].id.clone();
    let problem = server.json(&format!("/v1/jobs/{id}/problem")).await;
    let over_grpc = grpc
        .get_job_problem(pb::GetJobProblemRequest { id: id.clone() })
        .await
        .unwrap()
        .into_inner();
    assert_eq!(over_grpc, message(&problem.to_string()));
    let rows = server
        .json(&format!("/v1/jobs/{id}/history?max_points=3"))
        .await;
    let request = pb::ListIterationsRequest {
        id,
        max_points: Some(3),
        ..Default::default()
    };
    let over_grpc = grpc
        .list_iterations(request)
        .await
        .unwrap()
        .into_inner()
        .iterations;
    let residuals: Vec<&Value> = rows
        .as_array()
        .unwrap()
        .iter()
        .map(|row| &row["residual"])
        .collect();
    assert!(
        residuals.into_iter().eq(&over_grpc
            .iter()
            .map(|row| json!(row.residual))
            .collect::<Vec<_>>())
    );
}
