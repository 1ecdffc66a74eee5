//! Filters and orders of lists of jobs.

use reqwest::StatusCode;
use rpc::pb;
use serde_json::{Value, json};
use suite::{example_json, harness::Server};

use crate::{SIGNORINI, grpc::connect, server};

async fn submit(server: &Server, name: &str, labels: Value) -> Value {
    let body =
        json!({ "problem": example_json("sheet"), "name": name, "labels": labels, "cache": "off" });
    server.solve(&body).await
}

/// The ids of a list, two a page: the pages are one list.
async fn listed(server: &Server, query: &str) -> Vec<String> {
    let (mut ids, mut token) = (vec![], String::new());
    loop {
        let page = server
            .json(&format!("/v1/jobs?page_size=2&page_token={token}&{query}"))
            .await;
        let jobs = page["jobs"].as_array().unwrap();
        ids.extend(
            jobs.iter()
                .map(|job| job["id"].as_str().unwrap().to_owned()),
        );
        match page["next_page_token"].as_str() {
            Some(next) => token = next.to_owned(),
            None => return ids,
        }
    }
}

/// Operations: ListJobs, CountJobs
#[tokio::test]
async fn every_filter_finds_its_jobs_alone_and_combined() {
    let server = server().await;
    let mut jobs = vec![];
    for n in 0..9 {
        let labels = json!({ "third": (n % 3).to_string(), "both": "yes", "a b/c": "d&e" });
        jobs.push(submit(&server, if n % 2 == 0 { "even" } else { "odd" }, labels).await);
    }
    let failing = {
        let mut problem = example_json("rectangular_punch");
        problem["solver"] = json!({ "max_iterations": 2 });
        server.submit(&problem).await
    };
    server.until_done(&failing).await;
    let found = async |query: &str| -> Vec<usize> {
        let known = |id: &String| jobs.iter().position(|job| job["id"] == id.as_str());
        let ids = listed(&server, query).await;
        let found: Vec<usize> = ids
            .iter()
            .map(|id| known(id).unwrap_or(jobs.len()))
            .collect();
        let count = server.json(&format!("/v1/jobs/count?{query}")).await;
        assert_eq!(count["total"], found.len(), "{query}");
        found
    };
    assert_eq!(found("").await, [9, 8, 7, 6, 5, 4, 3, 2, 1, 0]);
    assert_eq!(found("name=even").await, [8, 6, 4, 2, 0]);
    assert_eq!(found("label.third=1").await, [7, 4, 1]);
    assert_eq!(found("label.third=1&label.both=yes&name=odd").await, [7, 1]);
    assert_eq!(
        found("label.a%20b%2Fc=d%26e&label.third=0").await,
        [6, 3, 0]
    );
    assert_eq!(found("label.third=1&label.third=2").await, [0usize; 0]);
    assert_eq!(found("status=failed").await, [9]);
    assert_eq!(
        found("status=failed,succeeded&name=odd").await,
        [7, 5, 3, 1]
    );
    assert_eq!(found("status=failed,succeeded,queued").await.len(), 10);
    assert_eq!(found("owner=local&status=succeeded").await.len(), 9);
    assert_eq!(found("owner=nobody").await, [0usize; 0]);
    let hash = jobs[0]["input_hash"].as_str().unwrap();
    assert_eq!(
        found(&format!("input_hash={hash}&label.third=2")).await,
        [8, 5, 2]
    );
    let at = |n: usize, name: &str| jobs[n][name].as_str().unwrap().to_owned();
    let (from, to) = (at(3, "created_at"), at(6, "created_at"));
    let between = format!("created_after={from}&created_before={to}");
    assert_eq!(found(&between).await, [5, 4, 3], "from, and before");
    assert_eq!(found(&format!("{between}&label.third=1")).await, [4]);
    assert_eq!(
        found(&format!("{between}&status=succeeded,failed")).await,
        [5, 4, 3]
    );
    let ended = at(2, "finished_at");
    assert_eq!(found(&format!("finished_before={ended}")).await, [1, 0]);
    assert_eq!(
        found(&format!("finished_after={ended}&name=even")).await,
        [8, 6, 4, 2]
    );
}

/// One list tells which results are poor, and has their forces; so does the answer to a submission, and that over gRPC.
///
/// Operations: CreateJob, ListJobs, CountJobs
#[tokio::test]
async fn the_verdict_stands_in_rows_and_finds_jobs() {
    let server = server().await;
    let mut refined = example_json("rectangular_punch");
    refined["mesh"]["refine"] = json!({ "tolerance": 0.005 });
    let good = server.solve(&json!({ "problem": refined })).await;
    let coarse = example_json("rectangular_punch");
    let answer = server
        .post("/v1/jobs")
        .header("Prefer", "wait=30")
        .json(&json!({ "problem": coarse }))
        .send()
        .await
        .unwrap();
    let poor: Value = answer.json().await.unwrap();
    let again = server.solve(&json!({ "problem": coarse })).await;
    assert_eq!(again["cached_from"], poor["id"]);
    for (job, verdict) in [(&good, "good"), (&poor, "poor"), (&again, "poor")] {
        assert_eq!(job["verdict"], verdict, "{job:#}");
        let id = job["id"].as_str().unwrap();
        let summary = server.json(&format!("/v1/jobs/{id}/result")).await["summary"].clone();
        let all = summary["accuracy"]["quantities"].as_array().unwrap();
        let expected: Vec<&Value> = all
            .iter()
            .filter(|q| {
                !["contact_start", "contact_end", "stick_end"]
                    .contains(&q["quantity"].as_str().unwrap())
            })
            .collect();
        assert_eq!(expected.len(), 5, "{all:#?}");
        assert_eq!(job["quantities"], json!(expected));
        let row = server.json(&format!("/v1/jobs/{id}")).await;
        assert_eq!(
            (&row["verdict"], &row["quantities"]),
            (&job["verdict"], &job["quantities"])
        );
    }
    let ids = |jobs: &[&Value]| -> Vec<String> {
        jobs.iter()
            .map(|job| job["id"].as_str().unwrap().to_owned())
            .collect()
    };
    assert_eq!(listed(&server, "verdict=poor").await, ids(&[&again, &poor]));
    assert_eq!(listed(&server, "verdict=good").await, ids(&[&good]));
    assert_eq!(listed(&server, "verdict=fair,good").await, ids(&[&good]));
    assert_eq!(listed(&server, "verdict=fair").await, [""; 0]);
    assert_eq!(server.json("/v1/jobs/count?verdict=poor").await["total"], 2);
    let wrong = server.get("/v1/jobs?verdict=bad").send().await.unwrap();
    assert_eq!(wrong.status(), StatusCode::BAD_REQUEST);

    let filter = pb::JobFilter {
        verdict: vec![pb::Verdict::Poor.into()],
        ..Default::default()
    };
    let request = pb::ListJobsRequest {
        filter: Some(filter),
        ..Default::default()
    };
    let mut grpc = connect(&server).await;
    let found = grpc.list_jobs(request).await.unwrap().into_inner().jobs;
    let names: Vec<&str> = found.iter().map(|job| job.id.as_str()).collect();
    assert_eq!(names, ids(&[&again, &poor]));
    assert_eq!(found[0].verdict(), pb::Verdict::Poor);
    assert_eq!(found[0].quantities[0].value, poor["quantities"][0]["value"]);
}

/// Operations: ListJobs
#[tokio::test]
async fn lists_are_ordered_by_the_requested_time_in_both_directions() {
    let server = Server::start(SIGNORINI, &["--workers", "1"]).await;
    server.post("/v1/queue/pause").send().await.unwrap();
    let mut ids = vec![];
    for priority in [0, 5, -5, 9] {
        let body = json!({ "problem": example_json("sheet"), "priority": priority, "cache": "off", "labels": { "l": "x" } });
        let job = server.create_job(&body).await;
        ids.push(job["id"].as_str().unwrap().to_owned());
    }
    server.post("/v1/queue/resume").send().await.unwrap();
    for id in &ids {
        server.until_done(id).await;
    }
    let waiting = {
        server.post("/v1/queue/pause").send().await.unwrap();
        server.submit(&example_json("sheet")).await
    };
    ids.push(waiting);
    let order = async |query: &str| -> Vec<usize> {
        let listed = listed(&server, query).await;
        let place = |id: &String| ids.iter().position(|known| known == id).unwrap();
        listed.iter().map(place).collect()
    };
    assert_eq!(order("").await, [4, 3, 2, 1, 0]);
    assert_eq!(order("order_by=created_at").await, [4, 3, 2, 1, 0]);
    assert_eq!(order("order_by=created_at%20asc").await, [0, 1, 2, 3, 4]);
    // by the time of the end: by priority, without the job that has not ended
    assert_eq!(order("order_by=finished_at%20asc").await, [3, 1, 0, 2]);
    assert_eq!(order("order_by=finished_at").await, [2, 0, 1, 3]);
    assert_eq!(
        order("order_by=finished_at&status=succeeded,queued").await,
        [2, 0, 1, 3]
    );
    assert_eq!(order("order_by=finished_at&label.l=x").await, [2, 0, 1, 3]);
    assert_eq!(
        order("order_by=finished_at&owner=local").await,
        [2, 0, 1, 3]
    );
    for bad in [
        "order_by=priority",
        "order_by=created_at%20up",
        "created_after=yesterday",
        "color=red",
        "label=x",
    ] {
        let response = server.get(&format!("/v1/jobs?{bad}")).send().await.unwrap();
        assert_eq!(response.status(), StatusCode::BAD_REQUEST, "{bad}");
    }
}
