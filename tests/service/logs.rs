//! The log: a line for each request and each end of a job, nothing secret, nothing that a client can break.

use std::time::Duration;

use reqwest::StatusCode;
use rpc::pb::{self, job_service_client::JobServiceClient};
use serde_json::{Value, json};
use suite::{example_json, harness::Server};
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt},
    net::TcpStream,
};

use crate::SIGNORINI;

/// The log, as soon as it has what is wanted: its lines are written by a thread of their own.
async fn log_with(server: &Server, wanted: &str) -> String {
    for _ in 0..500 {
        let log = server.log();
        if log.contains(wanted) {
            return log;
        }
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    panic!("the log has no {wanted:?}\n{}", server.log());
}

/// The lines of a log of JSON.
fn objects(log: &str) -> Vec<Value> {
    let object =
        |line: &str| serde_json::from_str(line).unwrap_or_else(|error| panic!("{line}: {error}"));
    log.lines().map(object).collect()
}

async fn grpc(server: &Server) -> JobServiceClient<tonic::transport::Channel> {
    JobServiceClient::connect(server.url.clone()).await.unwrap()
}

/// Sends bytes as they are; gives what is answered.
async fn raw(server: &Server, request: &[u8]) -> String {
    let address = server.url.trim_start_matches("http://");
    let mut stream = TcpStream::connect(address).await.unwrap();
    stream.write_all(request).await.unwrap();
    let mut answer = vec![];
    let _ = stream.read_to_end(&mut answer).await;
    String::from_utf8_lossy(&answer).into_owned()
}

#[tokio::test]
async fn each_request_and_each_end_of_a_job_is_one_line() {
    let server = Server::start(SIGNORINI, &["--log-format", "json"]).await;
    let problem = example_json("rectangular_punch");
    let submit = server
        .post("/v1/jobs")
        .header("x-request-id", "my.submit-1");
    let submit = submit.header("Prefer", "wait=60");
    let submit = submit.json(&json!({"problem": problem, "cache": "off"}));
    let job: Value = submit.send().await.unwrap().json().await.unwrap();
    let id = job["id"].as_str().unwrap();
    let request = server
        .get(&format!("/v1/jobs/{id}?wait=0"))
        .header("x-request-id", "my.request-1");
    let traced = request.header(
        "traceparent",
        "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01",
    );
    let answer = traced.send().await.unwrap();
    assert_eq!(answer.headers()["x-request-id"], "my.request-1");
    let bytes = answer.bytes().await.unwrap().len();
    let answer = server
        .get("/nowhere/at/all")
        .header("x-request-id", "not an id!")
        .send()
        .await
        .unwrap();
    let given = answer.headers()["x-request-id"]
        .to_str()
        .unwrap()
        .to_owned();
    assert_eq!((answer.status(), given.len()), (StatusCode::NOT_FOUND, 32));
    server.get("/livez").send().await.unwrap();
    let mut calls = grpc(&server).await;
    let unknown = pb::GetJobRequest {
        id: "job_00000000-0000-7000-8000-000000000000".into(),
    };
    assert!(calls.get_job(unknown).await.is_err());
    calls
        .get_server_info(pb::GetServerInfoRequest::default())
        .await
        .unwrap();

    let log = log_with(&server, "GetServerInfo").await;
    let lines = objects(&log);
    let of = |name: &str, value: &str| -> Vec<&Value> {
        lines.iter().filter(|line| line[name] == value).collect()
    };
    let routed = of("route", "/v1/jobs/{id}");
    assert_eq!(routed.len(), 1, "{log}");
    assert_eq!(routed[0]["target"], "service::request");
    assert_eq!(
        (&routed[0]["method"], &routed[0]["status"]),
        (&json!("GET"), &json!(200))
    );
    assert_eq!(
        (&routed[0]["owner"], &routed[0]["bytes"]),
        (&json!("local"), &json!(bytes))
    );
    assert_eq!(routed[0]["request_id"], "my.request-1");
    assert_eq!(routed[0]["client"], "127.0.0.1");
    assert_eq!(routed[0]["trace_id"], "4bf92f3577b34da6a3ce929d0e0e4736");
    assert!(routed[0]["duration_s"].as_f64().unwrap() > 0.0);
    let unknown = of("route", "unknown");
    assert_eq!(
        (
            unknown.len(),
            &unknown[0]["status"],
            &unknown[0]["request_id"]
        ),
        (1, &json!(404), &json!(given))
    );
    assert!(of("route", "/livez").is_empty(), "probes are for debug");
    let refused = of("rpc", "signorini.v1.JobService/GetJob");
    assert_eq!(
        (refused.len(), &refused[0]["code"]),
        (1, &json!("NOT_FOUND"))
    );
    assert_eq!(
        of("rpc", "signorini.v1.JobService/GetServerInfo")[0]["code"],
        "OK"
    );

    let accepted: Vec<&Value> = lines
        .iter()
        .filter(|line| line["job.id"] == id && line["job.input_hash"].is_string())
        .collect();
    assert_eq!(accepted.len(), 1, "{log}");
    assert_eq!(
        (&accepted[0]["owner"], &accepted[0]["request_id"]),
        (&json!("local"), &json!("my.submit-1"))
    );

    let ended: Vec<&Value> = lines
        .iter()
        .filter(|line| line["job.id"] == id && line["job.status"] == "succeeded")
        .collect();
    assert_eq!(ended.len(), 1, "{log}");
    assert_eq!(ended[0]["owner"], "local");
    let seconds = |name: &str| ended[0][name].as_f64().unwrap();
    assert!(seconds("wait_s") >= 0.0 && seconds("run_s") > 0.0);
}

#[tokio::test]
async fn no_secret_is_ever_in_the_log() {
    for format in ["text", "json"] {
        for level in ["debug", "trace"] {
            let server = Server::start(SIGNORINI, &["--log-format", format, "--log", level]).await;
            let body = json!({"name": "test", "owner": "root", "scopes": ["admin"]});
            let new: Value = server
                .post("/v1/tokens")
                .json(&body)
                .send()
                .await
                .unwrap()
                .json()
                .await
                .unwrap();
            let good = new["secret"].as_str().unwrap().to_owned();
            let secret = good.rsplit_once('_').map(|_| &good[17..]).unwrap();
            let bad = format!("{}{}", &good[..40], "Q".repeat(good.len() - 40));
            for token in [&good, &bad] {
                for request in [
                    server.get("/v1/jobs").bearer_auth(token),
                    server.get("/v1/jobs").basic_auth("me", Some(token)),
                    server
                        .get(&format!("/v1/jobs?token={token}"))
                        .bearer_auth(&good),
                    server.get(&format!("/v1/jobs/{token}")).bearer_auth(&good),
                    server
                        .post(&format!("/v1/tokens/{token}/revoke"))
                        .bearer_auth(&good),
                    server
                        .get(&format!("/{token}"))
                        .bearer_auth(token)
                        .header("x-request-id", token),
                    server
                        .get("/v1/me")
                        .header("x-remote-user", token)
                        .header("cookie", token),
                    server
                        .post("/v1/problems/validate")
                        .bearer_auth(&good)
                        .json(&json!({"problem": token})),
                ] {
                    request.send().await.unwrap();
                }
                let mut calls = grpc(&server).await;
                let mut request = tonic::Request::new(pb::GetCallerRequest::default());
                request
                    .metadata_mut()
                    .insert("authorization", format!("Bearer {token}").parse().unwrap());
                assert_eq!(calls.get_caller(request).await.is_ok(), *token == good);
            }
            let log = log_with(&server, "GetCaller").await;
            for hidden in [secret, &"Q".repeat(10)] {
                let found = log.lines().find(|line| line.contains(hidden));
                assert_eq!(found, None, "{format}, {level}");
            }
            assert!(!log.contains("token="), "no query is logged");
        }
    }
}

#[tokio::test]
async fn nothing_that_a_client_sends_adds_a_line_or_a_long_one() {
    for format in ["text", "json"] {
        let server = Server::start(SIGNORINI, &["--log-format", format, "--log", "debug"]).await;
        let evil = "x\n2026-01-01T00:00:00Z  INFO forged\r\u{1b}[2J\u{202e}\u{85}";
        let problem = example_json("rectangular_punch");
        let body = json!({"problem": problem, "name": evil, "labels": {"k": evil}, "cache": "off"});
        let job = server.solve(&body).await;
        assert!(job["id"].is_string() || job["code"].is_string(), "{job}");
        let long = "y".repeat(60_000);
        for path in ["/a%0aforged", "/%1b%5b2J%0d%0aforged", &format!("/{long}")] {
            server.get(path).send().await.unwrap();
        }
        // bytes that no client library would send
        raw(
            &server,
            b"GET /\xff\xfe\x80forged HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n",
        )
        .await;
        raw(&server, b"GET / HTTP/1.1\r\nhost: localhost\r\nx-request-id: a\x80\x1bforged\r\nconnection: close\r\n\r\n").await;
        raw(
            &server,
            b"FORGED\x0b / HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n",
        )
        .await;
        server.get("/v1/me").send().await.unwrap();
        let log = log_with(&server, "/v1/me").await;
        for line in log.lines() {
            assert!(line.len() < 4200, "{} bytes", line.len());
            assert!(
                !line.chars().any(|c| c.is_control() || c == '\u{202e}'),
                "{line:?}"
            );
            match format {
                "json" => {
                    assert!(serde_json::from_str::<Value>(line).unwrap()["timestamp"].is_string())
                }
                _ => assert!(
                    line.starts_with("20") && !line.starts_with("2026-01-01T00:00:00Z"),
                    "{line:?}"
                ),
            }
        }
    }
}

/// Anyone could fill the disk with requests that need no token, as well as with those that are refused.
#[tokio::test]
async fn unidentified_callers_have_a_limited_number_of_log_lines() {
    const REQUESTS: usize = 400;
    let server = Server::start(SIGNORINI, &[]).await;
    let body = json!({"name": "test", "owner": "root", "scopes": ["admin"]});
    let created = server.post("/v1/tokens").json(&body).send().await.unwrap();
    let created: Value = created.json().await.unwrap();
    let admin = created["secret"].as_str().unwrap();
    let begun = std::time::Instant::now();
    for _ in 0..REQUESTS {
        let open = server.get("/v1/errors/not-found").send().await.unwrap();
        assert_eq!(open.status(), StatusCode::OK);
    }
    let seconds = begun.elapsed().as_secs() as usize;
    server
        .get("/v1/me")
        .bearer_auth(admin)
        .send()
        .await
        .unwrap();
    let log = log_with(&server, "/v1/me").await;
    let lines = log
        .lines()
        .filter(|line| line.contains("/v1/errors/"))
        .count();
    assert!(
        (1..=20 * (seconds + 2)).contains(&lines),
        "{lines} lines in {seconds} s"
    );
}

/// Who tries what they may not do is known, however many others are refused.
#[tokio::test]
async fn the_owner_of_a_refused_request_is_in_its_line() {
    let server = Server::start(SIGNORINI, &["--log-format", "json"]).await;
    let token = async |admin: Option<&str>, scope: &str, owner: &str| {
        let body = json!({"name": "test", "owner": owner, "scopes": [scope]});
        let mut request = server.post("/v1/tokens").json(&body);
        if let Some(admin) = admin {
            request = request.bearer_auth(admin);
        }
        let created: Value = request.send().await.unwrap().json().await.unwrap();
        created["secret"].as_str().unwrap().to_owned()
    };
    let admin = token(None, "admin", "root").await;
    let ada = token(Some(&admin), "read", "ada").await;
    for _ in 0..100 {
        server.get("/v1/jobs").send().await.unwrap();
    }
    let refused = server.get("/v1/tokens").bearer_auth(&ada);
    let answer = refused.header("x-request-id", "by-ada").send().await;
    assert_eq!(answer.unwrap().status(), StatusCode::FORBIDDEN);
    let log = log_with(&server, "by-ada").await;
    let lines = objects(&log);
    let line = lines.iter().find(|line| line["request_id"] == "by-ada");
    let line = line.unwrap();
    assert_eq!(
        (&line["owner"], &line["status"]),
        (&json!("ada"), &json!(403))
    );
}

#[tokio::test]
async fn the_filter_is_taken_from_rust_log_by_default() {
    let folder = tempfile::tempdir().unwrap();
    let start = |variables: &[(&str, &str)]| {
        let mut command = std::process::Command::new(SIGNORINI);
        command.env_remove("SIGNORINI_LOG").env_remove("RUST_LOG");
        command.envs(variables.iter().copied());
        // it cannot listen there: it ends soon, and logs what comes before that
        command.args([
            "serve",
            "--listen",
            "192.0.2.1:1",
            "--allow-unauthenticated",
            "--data",
        ]);
        let output = command.arg(folder.path().join("data")).output().unwrap();
        String::from_utf8(output.stderr).unwrap()
    };
    let debug = |log: &str| log.contains(" DEBUG ");
    assert!(debug(&start(&[("RUST_LOG", "debug")])));
    assert!(!debug(&start(&[
        ("RUST_LOG", "debug"),
        ("SIGNORINI_LOG", "info")
    ])));
    assert!(!debug(&start(&[])));
    assert!(start(&[("RUST_LOG", "a[b{c=d}]=debug,,")]).contains("RUST_LOG"));
}
