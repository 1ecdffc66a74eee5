//! Workers elsewhere: the program `signorini worker` solves the jobs of a service that solves none itself.

use std::{
    process::{Command as Blocking, Output},
    time::{Duration, Instant},
};

use rpc::pb;
use serde_json::{Value, json};
use suite::{
    example_json,
    harness::{Server, answer, large},
    pressed,
};
use tokio::process::{Child, Command};

use crate::{SIGNORINI, auth::create, grpc::connect, meshes::file};

/// A service without slots of its own, whose leases end after two seconds.
const ELSEWHERE: [&str; 4] = ["--workers", "0", "--lease-s", "2"];

fn worker(server: &Server, more: &[&str]) -> Child {
    let mut command = Command::new(SIGNORINI);
    command.args(["worker", "--server", &server.url]).args(more);
    command.kill_on_drop(true).spawn().unwrap()
}

async fn signal(worker: &Child, name: &str) {
    let kill = format!("kill -{name} {}", worker.id().unwrap());
    let sent = Command::new("sh").args(["-c", &kill]).status().await;
    assert!(sent.unwrap().success());
}

async fn digest(server: &Server, id: &str) -> Value {
    let job = server.until_done(id).await;
    assert_eq!(job["status"], "succeeded", "{job:#}\n{}", server.log());
    server.json(&format!("/v1/jobs/{id}/result")).await["summary"]["digest"].take()
}

/// Operations: ListWorkers
#[tokio::test]
async fn workers_are_listed_with_what_they_do() {
    let server = Server::start_alone(SIGNORINI, &ELSEWHERE).await;
    assert_eq!(server.json("/v1/workers").await, json!({ "workers": [] }));
    let _workers = ["one", "two"].map(|name| {
        let memory = "4294967296";
        worker(
            &server,
            &[
                "--name",
                name,
                "--slots",
                "2",
                "--memory-budget-bytes",
                memory,
            ],
        )
    });
    while server.json("/v1/queue").await["workers"] != 4 {}
    let id = server.submit(&large()).await;
    server.until(&id, |event| event["stage"] == "factor").await;
    let listed = server.json("/v1/workers").await["workers"].take();
    let listed = listed.as_array().unwrap();
    let names: Vec<&Value> = listed.iter().map(|worker| &worker["name"]).collect();
    assert_eq!(names, ["one", "two"]);
    for worker in listed {
        assert_eq!(
            (&worker["slots"], &worker["memory_bytes"]),
            (&json!(2), &json!(1_u64 << 32))
        );
        assert!(worker["silent_s"].as_f64().unwrap() < 30.0, "{worker:#}");
    }
    let jobs: i64 = listed
        .iter()
        .map(|worker| worker["jobs"].as_i64().unwrap())
        .sum();
    assert_eq!(jobs, 1);
    let queue = server.json("/v1/queue").await;
    assert_eq!((&queue["workers"], &queue["idle"]), (&json!(4), &json!(3)));
    let mut grpc = connect(&server).await;
    let same = grpc
        .list_workers(pb::ListWorkersRequest {})
        .await
        .unwrap()
        .into_inner();
    let ids: Vec<Value> = same
        .workers
        .into_iter()
        .map(|worker| worker.id.into())
        .collect();
    let listed: Vec<Value> = listed.iter().map(|worker| worker["id"].clone()).collect();
    assert_eq!(ids, listed);
}

#[tokio::test]
async fn results_have_the_bits_of_those_that_the_service_solves_itself() {
    let (there, here) = (
        Server::start(SIGNORINI, &ELSEWHERE).await,
        Server::start(SIGNORINI, &[]).await,
    );
    let _workers = [
        worker(&there, &["--slots", "1"]),
        worker(&there, &["--slots", "2"]),
    ];
    let mut problems = vec![];
    for name in ["rectangular_punch", "cylinder", "sheet", "annular_punch"] {
        problems.push((name, example_json(name)));
    }
    let mesh = file("gmsh/fillet-quad8-msh41-binary.msh");
    let mut stored = json!(null);
    for server in [&there, &here] {
        let (_, info) = answer(server.post("/v1/meshes").body(mesh.clone())).await;
        stored = pressed(json!({ "stored": info["hash"] }));
    }
    problems.push(("a stored mesh", stored));
    let mut jobs = vec![];
    for (name, problem) in problems {
        jobs.push((
            name,
            there.submit(&problem).await,
            here.submit(&problem).await,
        ));
    }
    for (name, one, other) in jobs {
        assert_eq!(
            digest(&there, &one).await,
            digest(&here, &other).await,
            "{name}"
        );
        // and the same events
        let kinds = async |server: &Server, id: &str| {
            let events = server.events(id, 0).await.rest().await;
            events
                .into_iter()
                .map(|mut event| event["type"].take())
                .collect::<Vec<_>>()
        };
        assert_eq!(
            kinds(&there, &one).await,
            kinds(&here, &other).await,
            "{name}"
        );
    }
    let sweep = json!({
        "base": example_json("rectangular_punch"),
        "axes": [
            { "path": "/contacts/0/friction/coefficient", "linspace": { "start": 0.1, "stop": 0.4, "count": 5 } },
            { "path": "/contacts/0/friction/nonlocal_radius", "values": [0.01, 0.02] },
        ],
    });
    let rows = async |server: &Server| {
        let (_, sweep) = answer(server.post("/v1/sweeps").json(&sweep)).await;
        let id = sweep["id"].as_str().unwrap();
        let sweep = server.json(&format!("/v1/sweeps/{id}?wait=30")).await;
        assert_eq!(sweep["status"], "succeeded", "{sweep:#}");
        let path = format!("/v1/sweeps/{id}/results?page_size=100");
        server.json(&path).await["members"].take()
    };
    assert_eq!(rows(&there).await, rows(&here).await);
}

#[tokio::test]
async fn the_job_of_a_killed_worker_is_solved_by_another() {
    let server = Server::start_alone(SIGNORINI, &ELSEWHERE).await;
    let mut first = worker(&server, &["--slots", "1"]);
    let id = server.submit(&large()).await;
    server.until(&id, |event| event["stage"] == "factor").await;
    first.kill().await.unwrap();
    let killed = Instant::now();
    let _second = worker(&server, &["--slots", "1"]);
    let again = server
        .until(&id, |event| event["reason"] == "worker_lost")
        .await;
    assert_eq!(again["status"], "queued");
    assert!(
        killed.elapsed() < Duration::from_secs(10),
        "a lease lasts two seconds"
    );
    let job = server.until_done(&id).await;
    assert_eq!(
        (&job["status"], &job["attempt"]),
        (&json!("succeeded"), &json!(2))
    );
    assert!(server.log().contains("was not heard of for 2 s"));
}

#[tokio::test]
async fn a_worker_that_is_to_end_gives_its_job_back() {
    let server = Server::start_alone(SIGNORINI, &ELSEWHERE).await;
    let mut first = worker(&server, &["--slots", "1", "--grace", "0"]);
    let id = server.submit(&large()).await;
    server.until(&id, |event| event["stage"] == "factor").await;
    signal(&first, "TERM").await;
    let ended = tokio::time::timeout(Duration::from_secs(10), first.wait()).await;
    assert_eq!(ended.unwrap().unwrap().code(), Some(0));
    let job = server.job(&id).await;
    assert_eq!(
        (&job["status"], &job["max_attempts"]),
        (&json!("queued"), &json!(4)),
        "{job:#}"
    );
    let _second = worker(&server, &["--slots", "1"]);
    assert_eq!(server.until_done(&id).await["status"], "succeeded");
}

#[tokio::test]
async fn a_job_goes_on_at_its_worker_when_the_service_restarts() {
    for kill in [true, false] {
        let mut server = Server::start_alone(SIGNORINI, &ELSEWHERE).await;
        let _worker = worker(&server, &["--slots", "1"]);
        let id = server.submit(&large()).await;
        server.until(&id, |event| event["stage"] == "factor").await;
        let address = server.url.trim_start_matches("http://").to_owned();
        if kill {
            server.kill().await;
        } else {
            server.terminate().await;
        }
        server.restart_at(&address).await;
        let job = server.until_done(&id).await;
        assert_eq!(
            (&job["status"], &job["attempt"]),
            (&json!("succeeded"), &json!(1)),
            "{job:#}\n{}",
            server.log()
        );
        let events = server.events(&id, 0).await.rest().await;
        let seqs = events.iter().map(|event| event["seq"].as_i64().unwrap());
        assert!(seqs.eq(1..=events.len() as i64));
        let stages = events.iter().filter(|event| event["type"] == "stage");
        let stages: Vec<&Value> = stages.map(|event| &event["stage"]).collect();
        assert!(
            !stages.windows(2).any(|two| two[0] == two[1]),
            "told twice: {stages:?}"
        );
        // and it takes more
        let next = server.submit(&example_json("sheet")).await;
        assert_eq!(server.until_done(&next).await["status"], "succeeded");
    }
}

#[tokio::test]
async fn a_worker_without_jobs_ends_if_it_is_asked_to() {
    let server = Server::start(SIGNORINI, &ELSEWHERE).await;
    let mut idle = worker(&server, &["--idle-exit", "1s"]);
    let ended = tokio::time::timeout(Duration::from_secs(20), idle.wait()).await;
    assert_eq!(ended.unwrap().unwrap().code(), Some(0));
    assert!(
        server.log().matches("WARN").count() == 0,
        "{}",
        server.log()
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_worker_needs_a_token_with_the_scope_work() {
    let server = Server::start(SIGNORINI, &ELSEWHERE).await;
    let token = |scope: &str| json!({"name": scope, "owner": "ada", "scopes": [scope]});
    let (_, admin) = create(&server, None, token("admin")).await;
    let (_, reads) = create(&server, Some(&admin), token("read")).await;
    let (_, works) = create(&server, Some(&admin), token("work")).await;
    let file = server.data().join("token");
    let run = |secret: &str| -> Output {
        std::fs::write(&file, format!("{secret}\n")).unwrap();
        let mut command = Blocking::new(SIGNORINI);
        command.args([
            "worker",
            "--server",
            &server.url,
            "--idle-exit",
            "0.1s",
            "--token-file",
        ]);
        command.arg(&file).output().unwrap()
    };
    for (secret, told) in [
        (
            &*reads,
            "this needs the scope work, which the token of ada does not have",
        ),
        ("sgn_nonsense", "token"),
    ] {
        let Output { status, stderr, .. } = tokio::task::block_in_place(|| run(secret));
        let said = String::from_utf8_lossy(&stderr);
        assert_eq!(status.code(), Some(1), "{said}");
        assert!(
            said.contains("does not accept this worker") && said.contains(told),
            "{said}"
        );
    }
    let output = tokio::task::block_in_place(|| run(&works));
    assert_eq!(output.status.code(), Some(0), "{output:?}");
}
