//! Requests over a limit are refused, and others continue.

use std::time::{Duration, Instant};

use reqwest::StatusCode;
use serde_json::{Value, json};
use suite::{
    example_json,
    harness::{Server, answer, large},
};
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt},
    net::TcpStream,
};

use crate::{SIGNORINI, server};

/// Operations: CreateJob
#[tokio::test]
async fn a_body_over_the_limit_is_refused() {
    let server = server().await;
    let body = format!("{{\"problem\": \"{}\"}}", "x".repeat(17 << 20));
    let post = || {
        server
            .post("/v1/jobs")
            .header("Content-Type", "application/json")
    };
    let response = post().body(body.clone()).send().await.unwrap();
    assert_eq!(response.status(), StatusCode::PAYLOAD_TOO_LARGE);
    assert_eq!(
        response.json::<Value>().await.unwrap()["code"],
        "payload-too-large"
    );
    // also if the length is not declared
    let pieces = body
        .into_bytes()
        .chunks(1 << 16)
        .map(|piece| Ok::<_, String>(piece.to_vec()))
        .collect::<Vec<_>>();
    let stream = futures_util::stream::iter(pieces);
    let response = post()
        .body(reqwest::Body::wrap_stream(stream))
        .send()
        .await
        .unwrap();
    assert_eq!(response.status(), StatusCode::PAYLOAD_TOO_LARGE);
}

/// Behind a proxy that shows the service below a path, probes are probes, and the links of errors lead there.
#[tokio::test]
async fn below_a_path_probes_are_answered_and_errors_explained_when_all_connections_are_busy() {
    let arguments = ["--max-connections", "1", "--path-prefix", "/lab"];
    let server = Server::start(SIGNORINI, &arguments).await;
    let mut busy = TcpStream::connect(server.url.trim_start_matches("http://"))
        .await
        .unwrap();
    // it waits for the body, as soon as it says so
    let head = "POST /v1/jobs HTTP/1.1\r\nhost: localhost\r\ncontent-type: application/json\r\n\
                content-length: 9\r\nexpect: 100-continue\r\n\r\n";
    busy.write_all(head.as_bytes()).await.unwrap();
    let mut told = [0; 12];
    busy.read_exact(&mut told).await.unwrap();
    assert_eq!(&told, b"HTTP/1.1 100");
    for probe in ["/livez", "/lab/livez", "/lab/readyz"] {
        let answer = server.get(probe).send().await.unwrap();
        assert_eq!(answer.status(), StatusCode::OK, "{probe}");
    }
    let (status, refused) = answer(server.get("/lab/v1/jobs")).await;
    assert_eq!(status, StatusCode::SERVICE_UNAVAILABLE);
    assert_eq!(refused["instance"], "/lab/v1/jobs");
    assert_eq!(refused["type"], "/lab/v1/errors/overloaded");
    drop((busy, server)); // a test that wants the machine for itself may wait for it

    // of a job, whose failure is stored
    let server = Server::start(SIGNORINI, &arguments[2..]).await;
    let body =
        json!({"problem": example_json("rectangular_punch"), "limits": {"queue_ttl_s": 0.2}});
    server.post("/v1/queue/pause").send().await.unwrap();
    let job = server.solve(&body).await;
    let explained = job["failure"]["type"].as_str().unwrap();
    assert_eq!(explained, "/lab/v1/errors/queue-expired");
    let explanation = server.get(explained).send().await.unwrap();
    assert_eq!(explanation.status(), StatusCode::OK);
}

/// Each support has five violations, each of which is reported.
fn faulty(supports: usize) -> Value {
    let mut problem = example_json("sheet");
    let wrong = json!({ "bundary": "left", "ux": "0", "uy": "0", "uz": 0 });
    problem["supports"] = vec![wrong; supports].into();
    json!({ "problem": problem })
}

/// Operations: CreateJob
#[tokio::test]
async fn bodies_with_many_violations_do_not_delay_other_requests() {
    let server = Server::start_alone(SIGNORINI, &[]).await;
    let body = faulty(14_000).to_string();
    assert!(body.len() > 600_000, "{}", body.len());
    // as many as there are cores, and so as many as there are async threads
    let cores = std::thread::available_parallelism().unwrap().get();
    let sent = (0..cores).map(|_| {
        let post = server.post("/v1/problems/validate");
        post.header("Content-Type", "application/json")
            .body(body.clone())
            .send()
    });
    let all = futures_util::future::join_all(sent);
    tokio::pin!(all);
    let mut longest = Duration::ZERO;
    let answers = loop {
        let start = Instant::now();
        let alive = server.get("/livez").send();
        tokio::select! {
            answers = &mut all => break answers,
            answer = alive => assert_eq!(answer.unwrap().status(), StatusCode::OK),
        }
        longest = longest.max(start.elapsed());
    };
    for answer in answers {
        let judgement: Value = answer.unwrap().json().await.unwrap();
        assert_eq!(judgement["valid"], false);
    }
    println!("the longest answer took {longest:?}");
    assert!(longest < Duration::from_secs(1), "{longest:?}");
}

/// Operations: CreateJob
#[tokio::test]
async fn a_problem_over_the_memory_budget_is_refused_with_the_estimate() {
    let server = Server::start(SIGNORINI, &["--memory-budget-bytes", "1000000000"]).await;
    let body = json!({ "problem": large() });
    let (status, document) = answer(server.post("/v1/jobs").json(&body)).await;
    assert_eq!(
        (status, &document["code"]),
        (StatusCode::PAYLOAD_TOO_LARGE, &json!("problem-too-large"))
    );
    assert!(document["estimate"]["memory_bytes"].as_u64().unwrap() > 1_000_000_000);
    assert_eq!(document["memory_budget_bytes"], 1_000_000_000);
    let detail = document["detail"].as_str().unwrap();
    assert!(detail.contains("the budget is 953.7 MiB"), "{detail}");
    // a validation is answered with the same numbers
    let (status, judgement) = answer(server.post("/v1/problems/validate").json(&body)).await;
    assert_eq!(
        (status, &judgement["valid"]),
        (StatusCode::OK, &json!(false))
    );
    let violation = &judgement["violations"][0];
    assert_eq!(
        (&violation["pointer"], &violation["reason"]),
        (&json!("/problem/mesh"), &json!("too_large"))
    );
    assert_eq!(judgement["estimate"], document["estimate"]);
    // a size beyond all integers is refused as quickly, with the place of the number
    let mut hopeless = example_json("sheet");
    hopeless["mesh"]["refine"] = json!(4_000_000_000u32);
    let body = json!({ "problem": hopeless });
    let (status, document) = answer(server.post("/v1/jobs").json(&body)).await;
    assert_eq!(
        (status, &document["errors"][0]["pointer"]),
        (
            StatusCode::UNPROCESSABLE_ENTITY,
            &json!("/problem/mesh/refine")
        )
    );
}

/// Operations: CreateJob
#[tokio::test]
async fn a_full_queue_refuses_jobs_and_no_other_request() {
    let server = Server::start_alone(SIGNORINI, &["--workers", "1", "--max-queued", "2"]).await;
    let front = server.submit(&large()).await;
    server.until_running(&front).await;
    let waiting = [
        server.submit(&example_json("sheet")).await,
        server.submit(&example_json("sheet")).await,
    ];
    let body = json!({ "problem": example_json("sheet") });
    let full = server.post("/v1/jobs").json(&body).send().await.unwrap();
    assert_eq!(full.status(), StatusCode::SERVICE_UNAVAILABLE);
    assert!(full.headers().contains_key("retry-after"));
    assert_eq!(full.json::<Value>().await.unwrap()["code"], "queue-full");
    assert_eq!(server.job(&waiting[0]).await["status"], "queued");
    assert_eq!(server.cancel(&waiting[0]).await["outcome"], "canceled");
    server.submit(&example_json("sheet")).await; // there is room again
}

/// Operations: CreateJob
#[tokio::test]
async fn two_large_jobs_run_at_once_and_a_third_waits() {
    let server = Server::start_alone(SIGNORINI, &[]).await;
    let (first, second) = (server.submit(&large()).await, server.submit(&large()).await);
    let third = server.submit(&large()).await;
    server.until_running(&first).await;
    server.until_running(&second).await;
    let status = async |id: &str| server.job(id).await["status"].as_str().unwrap().to_string();
    assert_eq!(
        [status(&first).await, status(&second).await],
        ["running", "running"]
    );
    assert_eq!(status(&third).await, "queued");
    assert_eq!(server.job(&third).await["queue"]["position"], 1);
    // The third starts when one of the two has ended; all three have bit-identical results.
    server.until_running(&third).await;
    let running = server.json("/v1/jobs?status=running").await;
    assert!(running["jobs"].as_array().unwrap().len() <= 2);
    let mut digests = vec![];
    for id in [&first, &second, &third] {
        let job = server.until_done(id).await;
        assert_eq!(job["status"], "succeeded", "{job:#}");
        let summary = server.json(&format!("/v1/jobs/{id}/result")).await["summary"].take();
        assert!(summary["dofs"].as_u64().unwrap() >= 500_000);
        digests.push(summary["digest"].clone());
    }
    assert!(digests.iter().all(|digest| *digest == digests[0]));
}

/// Operations: CreateJob, CreateSweep, ValidateProblem
#[tokio::test]
async fn a_job_that_would_only_run_into_its_time_limit_is_refused_with_the_estimate() {
    let server = server().await;
    let validated = server.post("/v1/problems/validate");
    let (_, validated) = answer(validated.json(&json!({ "problem": large() }))).await;
    let run_s = validated["estimate"]["run_s"].as_f64().unwrap();
    let limits = json!({ "timeout_s": run_s / 20.0 });
    let axes = json!([{ "path": "/materials/0/youngs_modulus", "values": [1000, 2000] }]);
    for (route, body) in [
        ("/v1/jobs", json!({ "problem": large(), "limits": limits })),
        (
            "/v1/sweeps",
            json!({ "base": large(), "axes": axes, "limits": limits }),
        ),
    ] {
        let (status, refused) = answer(server.post(route).json(&body)).await;
        assert_eq!(status, StatusCode::UNPROCESSABLE_ENTITY, "{route}");
        let errors = refused["errors"].as_array().unwrap();
        assert_eq!(errors.len(), 1, "{errors:#?}");
        assert_eq!(errors[0]["pointer"], "/limits/timeout_s");
        let expected = errors[0]["expected"].as_str().unwrap();
        let told = expected.rsplit(' ').nth(1).unwrap();
        let told: f64 = told.parse().unwrap();
        assert!(run_s <= told && told < 1.1 * run_s, "{expected}");
    }
}
