//! Owners share the service: they take turns, and none fills the queue for all.

use std::collections::BTreeMap;

use futures_util::{StreamExt, stream::FuturesUnordered};
use reqwest::StatusCode;
use rpc::pb::{self, job_service_client::JobServiceClient};
use serde_json::{Value, json};
use suite::{
    example_json,
    harness::{Server, soon},
};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tonic::{Code, Request};
use tonic_types::StatusExt;

use crate::SIGNORINI;

/// A server that takes the user from a header, so that tests need no tokens.
async fn shared(more: &[&str]) -> Server {
    let proxy = ["--trusted-proxy", "127.0.0.1", "--proxy-admin", "root"];
    let mut arguments = proxy.to_vec();
    arguments.extend(["--proxy-user-header", "x-remote-user"]);
    arguments.extend(more);
    Server::start(SIGNORINI, &arguments).await
}

/// Submits so many different jobs at once; the status of the answer and its content.
async fn batch(server: &Server, user: &str, count: usize) -> (StatusCode, Value) {
    let job = |n: usize| {
        let mut problem = example_json("rectangular_punch");
        let depth = 0.01 * (1.0 + n as f64 / 1e5);
        problem["contacts"][0]["indentation"] = json!(depth);
        json!({"problem": problem, "cache": "off"})
    };
    let jobs: Vec<Value> = (0..count).map(job).collect();
    let request = server.post("/v1/jobs/batch").header("x-remote-user", user);
    let response = request.json(&json!({"jobs": jobs})).send().await.unwrap();
    let status = response.status();
    (status, response.json().await.unwrap())
}

async fn get(server: &Server, user: &str, path: &str) -> Value {
    let request = server.get(path).header("x-remote-user", user);
    request.send().await.unwrap().json().await.unwrap()
}

async fn queue(server: &Server, verb: &str) {
    let request = server
        .post(&format!("/v1/queue/{verb}"))
        .header("x-remote-user", "root");
    assert_eq!(request.send().await.unwrap().status(), StatusCode::OK);
}

/// R23, with fewer jobs: `tests/reliability/shares.py` has five thousand.
#[tokio::test]
async fn owners_take_turns() {
    let server = shared(&["--workers", "1"]).await;
    queue(&server, "pause").await;
    assert_eq!(batch(&server, "ada", 200).await.0, StatusCode::ACCEPTED);
    let (_, of_bob) = batch(&server, "bob", 2).await;
    let ahead = |n: usize| of_bob["jobs"][n]["queue"]["ahead"].as_u64().unwrap();
    // before it one of ada's at most, who was first; and then one more
    assert_eq!((ahead(0), ahead(1)), (1, 3));
    for n in 0..20 {
        assert_eq!(
            batch(&server, &format!("user{n:02}"), 3).await.0,
            StatusCode::ACCEPTED
        );
    }
    queue(&server, "resume").await;
    // of 22 owners the first 44 starts are two of each
    let all = loop {
        let list = get(
            &server,
            "root",
            "/v1/jobs?page_size=1000&status=succeeded,running",
        )
        .await;
        let jobs = list["jobs"].as_array().unwrap().clone();
        if jobs.len() > 60 {
            break jobs;
        }
        let waiting = get(
            &server,
            "root",
            "/v1/jobs?status=queued&page_size=1&order_by=created_at",
        )
        .await;
        let next = waiting["jobs"][0]["id"].as_str().unwrap().to_owned();
        get(&server, "root", &format!("/v1/jobs/{next}?wait=1")).await;
    };
    let mut started: Vec<(&str, &str)> = all
        .iter()
        .map(|job| {
            (
                job["started_at"].as_str().unwrap(),
                job["owner"].as_str().unwrap(),
            )
        })
        .collect();
    started.sort_unstable();
    let mut of_each = BTreeMap::<&str, usize>::new();
    for (_, owner) in &started[..44] {
        *of_each.entry(owner).or_default() += 1;
    }
    assert_eq!(of_each.len(), 22);
    assert!(of_each.values().all(|count| *count == 2), "{of_each:?}");
}

#[tokio::test]
async fn an_owner_has_a_limit_of_queued_jobs_and_the_error_names_it() {
    let server = shared(&["--max-queued-per-owner", "3"]).await;
    queue(&server, "pause").await;
    let (status, refused) = batch(&server, "ada", 4).await;
    assert_eq!(
        (status, refused["code"].as_str()),
        (StatusCode::TOO_MANY_REQUESTS, Some("quota-exceeded"))
    );
    assert_eq!(
        refused["quota"],
        json!({"owner": "ada", "of": "queued", "limit": 3, "used": 0, "asked": 4})
    );
    assert_eq!(batch(&server, "ada", 3).await.0, StatusCode::ACCEPTED);
    let me = get(&server, "ada", "/v1/me").await;
    assert_eq!(me["queued"], json!({"used": 3, "limit": 3}));
    // others are not affected
    assert_eq!(batch(&server, "bob", 3).await.0, StatusCode::ACCEPTED);
    let mut grpc = JobServiceClient::connect(server.url.clone()).await.unwrap();
    let mut request = Request::new(pb::CreateJobRequest {
        problem: Some(crate::grpc::message(&suite::example("rectangular_punch"))),
        ..Default::default()
    });
    request
        .metadata_mut()
        .insert("x-remote-user", "ada".parse().unwrap());
    let refused = grpc.create_job(request).await.unwrap_err();
    assert_eq!(refused.code(), Code::ResourceExhausted);
    let failure = refused.get_details_quota_failure().unwrap();
    assert_eq!(failure.violations[0].subject, "owner:ada");
    assert!(refused.get_details_retry_info().is_some());
}

#[tokio::test]
async fn an_owner_may_have_so_many_jobs_running() {
    let server = shared(&["--workers", "2", "--max-running-per-owner", "1"]).await;
    let mut slow = example_json("rectangular_punch");
    slow["mesh"]["refine"] = json!(5);
    let submit = async |user: &str, problem: &Value| -> Value {
        let body = json!({"problem": problem, "cache": "off"});
        let request = server
            .post("/v1/jobs")
            .header("x-remote-user", user)
            .json(&body);
        request.send().await.unwrap().json().await.unwrap()
    };
    let first = submit("ada", &slow).await;
    let second = submit("ada", &slow).await;
    assert_eq!(
        (first["status"].as_str(), second["status"].as_str()),
        (Some("running"), Some("queued"))
    );
    assert_eq!(second["queue"]["reason"], "owner_limit");
    // the other worker is idle, for others
    let other = submit("bob", &example_json("rectangular_punch")).await;
    let path = format!(
        "/v1/jobs/{}?wait=60&until=terminal",
        other["id"].as_str().unwrap()
    );
    assert_eq!(get(&server, "bob", &path).await["status"], "succeeded");
    let path = format!("/v1/jobs/{}", second["id"].as_str().unwrap());
    assert_eq!(get(&server, "ada", &path).await["status"], "queued");
    let me = get(&server, "ada", "/v1/me").await;
    assert_eq!(
        (&me["running"], &me["queued"]["used"]),
        (&json!({"used": 1, "limit": 1}), &json!(1))
    );
    let path = format!("/v1/jobs/{}/cancel", first["id"].as_str().unwrap());
    server
        .post(&path)
        .header("x-remote-user", "ada")
        .send()
        .await
        .unwrap();
    let path = format!(
        "/v1/jobs/{}?wait=60&until=terminal",
        second["id"].as_str().unwrap()
    );
    assert_eq!(get(&server, "ada", &path).await["status"], "succeeded");
}

#[tokio::test]
async fn a_priority_above_0_is_for_administrators() {
    let server = shared(&[]).await;
    queue(&server, "pause").await;
    let submit = async |user: &str, priority: i32| {
        let body = json!({"problem": example_json("rectangular_punch"), "priority": priority, "cache": "off"});
        let request = server
            .post("/v1/jobs")
            .header("x-remote-user", user)
            .json(&body);
        let response = request.send().await.unwrap();
        let status = response.status().as_u16();
        (status, response.json::<Value>().await.unwrap())
    };
    assert_eq!(submit("ada", 1).await.0, 403);
    assert_eq!(submit("root", 1).await.0, 202);
    let (status, job) = submit("ada", -1).await;
    assert_eq!(status, 202);
    let path = format!("/v1/jobs/{}", job["id"].as_str().unwrap());
    let edit = async |user: &str, priority: i32| {
        let request = server
            .request(reqwest::Method::PATCH, &path)
            .header("x-remote-user", user);
        request
            .json(&json!({"priority": priority}))
            .send()
            .await
            .unwrap()
            .status()
            .as_u16()
    };
    assert_eq!(
        (
            edit("ada", 5).await,
            edit("ada", 0).await,
            edit("root", 5).await
        ),
        (403, 200, 200)
    );
}

/// Waits until the job has ended, as this user.
async fn ended(server: &Server, user: &str, job: &Value) -> Value {
    let path = format!(
        "/v1/jobs/{}?wait=30&until=terminal",
        job["id"].as_str().unwrap()
    );
    get(server, user, &path).await
}

async fn delete(server: &Server, user: &str, path: &str) -> (StatusCode, String) {
    let request = server.delete(path).header("x-remote-user", user);
    let response = request.send().await.unwrap();
    (response.status(), response.text().await.unwrap())
}

/// A result is stored as columns, compressed: what a smallest and a large one may take.
#[tokio::test]
async fn results_are_stored_compactly() {
    let server = shared(&[]).await;
    for (refine, most) in [(None, 20_000), (Some(5), 15_000_000)] {
        let mut problem = example_json("rectangular_punch");
        if let Some(refine) = refine {
            problem["mesh"]["refine"] = json!(refine);
        }
        let request = server.post("/v1/jobs").header("x-remote-user", "ada");
        let job = request
            .json(&json!({"problem": problem, "cache": "off"}))
            .send()
            .await;
        let job: Value = job.unwrap().json().await.unwrap();
        let ends = async {
            loop {
                let job = ended(&server, "ada", &job).await;
                if job["status"] == "succeeded" {
                    return job;
                }
                assert_eq!(job["status"], "running", "{job}");
            }
        };
        let job = soon("a large job", ends).await;
        let stored = job["stored_bytes"].as_u64().unwrap();
        assert!(stored <= most, "refine {refine:?}: {stored} bytes");
    }
}

/// Meshes that arrive at the same time count together, and none of them waits for the others to end.
#[tokio::test]
async fn uploads_at_once_stay_within_the_share_of_their_owner() {
    let server = shared(&["--max-bytes-per-owner", "300000"]).await;
    let begin = |user: &str| {
        let (pieces, arriving) = tokio::sync::mpsc::channel::<std::io::Result<Vec<u8>>>(1);
        let stream = futures_util::stream::unfold(arriving, |mut arriving| async {
            Some((arriving.recv().await?, arriving))
        });
        let request = server.post("/v1/meshes").header("x-remote-user", user);
        let sent = request.body(reqwest::Body::wrap_stream(stream)).send();
        (pieces, tokio::spawn(sent))
    };
    // two that arrive at once are too much, though each would fit: one is refused, or both
    let (two, mut answers): (Vec<_>, FuturesUnordered<_>) = (0..2).map(|_| begin("ada")).unzip();
    for pieces in &two {
        pieces.try_send(Ok(vec![b'*'; 200_000])).unwrap();
    }
    let refused = soon("a refusal", answers.next()).await;
    let refused: reqwest::Response = refused.unwrap().unwrap().unwrap();
    assert_eq!(refused.status(), StatusCode::TOO_MANY_REQUESTS);
    let refusal: Value = refused.json().await.unwrap();
    assert_eq!(refusal["code"], "quota-exceeded", "{refusal}");
    assert_eq!(refusal["quota"]["of"], "stored_bytes", "{refusal}");
    // the same would be refused for as long as the other arrives, and sent as a whole each time
    assert_eq!(refusal["retryable"], false, "{refusal}");
    drop(two);
    soon("the other answer", answers.next()).await;
    // eight begin, of eleven; another owner's does, too
    let (more, answers): (Vec<_>, FuturesUnordered<_>) = (0..11).map(|_| begin("ada")).unzip();
    for pieces in &more {
        // one that was refused takes nothing any more
        let _ = pieces.try_send(Ok(b"*".to_vec()));
    }
    let refused: Vec<_> = soon("three refusals", answers.take(3).collect()).await;
    for answer in refused {
        let answer: reqwest::Response = answer.unwrap().unwrap();
        assert_eq!(answer.status(), StatusCode::SERVICE_UNAVAILABLE);
        let refusal: Value = answer.json().await.unwrap();
        assert_eq!(refusal["code"], "overloaded", "{refusal}");
        let said = refusal["detail"].as_str().unwrap();
        assert!(
            said.starts_with("ada uploads 8 meshes at the same time"),
            "{said}"
        );
    }
    let (pieces, answer) = begin("bob");
    pieces.try_send(Ok(b"nothing".to_vec())).unwrap();
    drop(pieces);
    let answer = soon("bob's answer", answer).await.unwrap().unwrap();
    assert_eq!(answer.status(), StatusCode::UNPROCESSABLE_ENTITY);
}

/// A mesh that an owner has adds nothing when it is uploaded again, as after an answer that was lost.
#[tokio::test]
async fn a_mesh_that_is_there_can_be_uploaded_again_whatever_is_left() {
    let file = crate::meshes::file("gmsh/fillet-mixed-msh41-binary.msh");
    let server = shared(&["--max-bytes-per-owner", "30000"]).await;
    let upload = async |file: Vec<u8>| {
        let request = server.post("/v1/meshes").header("x-remote-user", "ada");
        let answer = request.body(file).send().await.unwrap();
        (answer.status(), answer.json::<Value>().await.unwrap())
    };
    // as many as fit, which are not many
    let first = upload(file.clone()).await;
    assert_eq!(first.0, StatusCode::CREATED, "{}", first.1);
    let mut refused = None;
    for family in ["tri6", "quad8", "quad9", "mixed"] {
        let name = format!("gmsh/fillet-{family}-msh22-ascii.msh");
        let (status, document) = upload(crate::meshes::file(&name)).await;
        if status == StatusCode::TOO_MANY_REQUESTS {
            refused = Some(document);
        }
    }
    let refused = refused.expect("all of them fit");
    assert_eq!(refused["quota"]["limit"], 30_000, "{refused}");
    let kept = get(&server, "ada", "/v1/me").await["stored_bytes"]["used"].clone();
    assert!(kept.as_u64().unwrap() <= 30_000, "{kept}");
    let (status, again) = upload(file).await;
    assert_eq!((status, &again["hash"]), (StatusCode::OK, &first.1["hash"]));
}

/// A file for which an owner has no room is refused by the length that its request declares: nothing of it is read.
#[tokio::test]
async fn a_mesh_over_the_share_is_refused_before_it_arrives() {
    let server = shared(&["--max-bytes-per-owner", "30000"]).await;
    let address = server.url.strip_prefix("http://").unwrap().to_owned();
    let mut stream = tokio::net::TcpStream::connect(&address).await.unwrap();
    let head = format!(
        "POST /v1/meshes HTTP/1.1\r\nHost: {address}\r\nX-Remote-User: ada\r\nContent-Length: 30001\r\n\r\n"
    );
    stream.write_all(head.as_bytes()).await.unwrap();
    let mut answer = vec![0; 12];
    let read = stream.read_exact(&mut answer);
    let read = tokio::time::timeout(std::time::Duration::from_secs(20), read).await;
    read.expect("the server waits for the file").unwrap();
    assert_eq!(String::from_utf8_lossy(&answer), "HTTP/1.1 429");
}

/// Operations: DeleteFields, ListOwners, GetCaller, GetServerInfo
#[tokio::test]
async fn stored_bytes_of_an_owner_are_reported_and_limited_and_fields_can_be_deleted_alone() {
    let server = shared(&["--max-bytes-per-owner", "300000"]).await;
    let (_, first) = batch(&server, "ada", 1).await;
    let job = ended(&server, "ada", &first["jobs"][0]).await;
    let kept = job["stored_bytes"].as_u64().unwrap();
    assert!(kept > 5000, "{job}");
    let me = get(&server, "ada", "/v1/me").await;
    assert_eq!(me["stored_bytes"], json!({"used": kept, "limit": 300000}));
    let info = get(&server, "ada", "/v1/info").await;
    for part in ["used_bytes", "free_bytes"] {
        assert!(info["disk"][part].as_u64().unwrap() > 10_000, "{info}");
    }
    let path = format!("/v1/jobs/{}", job["id"].as_str().unwrap());
    let fields = format!("{path}/fields");
    assert_eq!(
        delete(&server, "bob", &fields).await.0,
        StatusCode::NOT_FOUND
    );
    for _ in 0..2 {
        assert_eq!(
            delete(&server, "ada", &fields).await.0,
            StatusCode::NO_CONTENT
        );
    }
    for (part, code) in [
        ("/fields", "no-result"),
        ("/fields?format=json", "no-result"),
        ("/plots/deformed.svg", "no-result"),
    ] {
        let answer = get(&server, "ada", &format!("{path}{part}")).await;
        assert_eq!(answer["code"], code, "{answer}");
        assert!(
            answer["detail"].as_str().unwrap().contains("deleted"),
            "{answer}"
        );
    }
    for part in ["/result", "/history", "/profiles/top"] {
        let request = server
            .get(&format!("{path}{part}"))
            .header("x-remote-user", "ada");
        assert_eq!(
            request.send().await.unwrap().status(),
            StatusCode::OK,
            "{part}"
        );
    }
    let less = get(&server, "ada", &path).await["stored_bytes"]
        .as_u64()
        .unwrap();
    assert!(less < kept, "{less} of {kept}");

    // more than allowed: nothing until some is deleted
    loop {
        let (status, answer) = batch(&server, "ada", 1).await;
        if status == StatusCode::TOO_MANY_REQUESTS {
            assert_eq!(answer["quota"]["of"], "stored_bytes", "{answer}");
            assert_eq!(answer["quota"]["limit"], 300000);
            assert_eq!(answer["retryable"], false, "waiting deletes nothing");
            break;
        }
        ended(&server, "ada", &answer["jobs"][0]).await;
    }
    let mesh = server.post("/v1/meshes").header("x-remote-user", "ada");
    let refused = mesh.body("$MeshFormat").send().await.unwrap();
    assert_eq!(refused.status(), StatusCode::TOO_MANY_REQUESTS);
    assert_eq!(batch(&server, "bob", 1).await.0, StatusCode::ACCEPTED);
    let owners = get(&server, "root", "/v1/owners").await;
    assert_eq!(owners["owners"][0]["owner"], "ada", "{owners}");
    assert_eq!(get(&server, "ada", "/v1/owners").await["code"], "forbidden");
    let mut client = JobServiceClient::connect(server.url.clone()).await.unwrap();
    let as_user = |user: &'static str| {
        let mut request = Request::new(pb::ListOwnersRequest {});
        request
            .metadata_mut()
            .insert("x-remote-user", user.parse().unwrap());
        request
    };
    let listed = client
        .list_owners(as_user("root"))
        .await
        .unwrap()
        .into_inner();
    assert_eq!(
        listed.owners[0].job_bytes,
        owners["owners"][0]["job_bytes"].as_u64().unwrap()
    );
    assert_eq!(
        client.list_owners(as_user("ada")).await.unwrap_err().code(),
        Code::PermissionDenied
    );
    let mut request = Request::new(pb::DeleteFieldsRequest {
        id: job["id"].as_str().unwrap().into(),
    });
    request
        .metadata_mut()
        .insert("x-remote-user", "ada".parse().unwrap());
    client.delete_fields(request).await.unwrap();
    assert_eq!(
        delete(&server, "ada", "/v1/jobs?status=succeeded").await.0,
        StatusCode::OK
    );
    assert_eq!(batch(&server, "ada", 1).await.0, StatusCode::ACCEPTED);
}

/// Operations: CreateJob
#[tokio::test]
async fn an_owner_submits_no_more_jobs_in_a_minute_than_allowed() {
    let server = shared(&["--max-submissions-per-owner-per-minute", "5"]).await;
    assert_eq!(batch(&server, "ada", 4).await.0, StatusCode::ACCEPTED);
    let (status, answer) = batch(&server, "ada", 3).await;
    assert_eq!(
        (status, &answer["code"]),
        (StatusCode::TOO_MANY_REQUESTS, &json!("rate-limited"))
    );
    assert_eq!(answer["quota"]["of"], "submissions", "{answer}");
    assert_eq!(answer["retryable"], true);
    let (_, answer) = batch(&server, "bob", 6).await;
    assert!(
        answer["detail"].as_str().unwrap().contains("in parts"),
        "{answer}"
    );
    assert_eq!(answer["retryable"], false, "more than there ever is");
    let me = get(&server, "ada", "/v1/me").await;
    assert_eq!(me["submissions"], json!({"per_minute": 5, "left": 1}));
    // a repeated request is no submission
    for _ in 0..3 {
        let request = server.post("/v1/jobs").header("x-remote-user", "ada");
        let request = request.header("Idempotency-Key", "the same");
        let body = json!({"problem": example_json("rectangular_punch"), "cache": "off"});
        let answer = request.json(&body).send().await.unwrap();
        assert_eq!(answer.status(), StatusCode::ACCEPTED);
    }
    let me = get(&server, "ada", "/v1/me").await;
    assert_eq!(me["submissions"]["left"], 0);
}

/// Operations: ListOwners
#[tokio::test]
async fn owners_who_keep_nothing_yet_are_listed_with_their_jobs() {
    let server = shared(&[]).await;
    queue(&server, "pause").await;
    batch(&server, "bob", 2).await;
    let owners = get(&server, "root", "/v1/owners").await;
    let found = &owners["owners"][0];
    assert_eq!(
        (&found["owner"], &found["queued"], &found["jobs"]),
        (&json!("bob"), &json!(2), &json!(0)),
        "{owners}"
    );
}

/// Operations: DeleteJob
#[tokio::test]
async fn jobs_that_are_too_old_are_removed_automatically() {
    // some two seconds, in days
    let server = Server::start(SIGNORINI, &["--retain-days", "0.00002"]).await;
    let id = server.submit(&example_json("sheet")).await;
    server.until_done(&id).await;
    for _ in 0..60 {
        let status = server
            .get(&format!("/v1/jobs/{id}"))
            .send()
            .await
            .unwrap()
            .status();
        if status == StatusCode::GONE {
            return;
        }
        tokio::time::sleep(std::time::Duration::from_millis(500)).await;
    }
    panic!("it is still there");
}
