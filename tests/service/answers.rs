//! What an answer says of itself: warnings on a job, partial results, links to plots, merge patches, compression.

use reqwest::{Method, StatusCode, header};
use rpc::pb::{self, job_service_client::JobServiceClient};
use serde_json::{Value, json};
use suite::{
    example_json,
    harness::{Server, answer, block},
};

use tonic_types::StatusExt;

use crate::{SIGNORINI, server};

/// A body that never touches the obstacle.
fn untouched() -> Value {
    let mut problem = block(4, 4);
    problem["contacts"][0]["indentation"] = json!(-1);
    problem
}

/// Operations: GetJob, ListJobs
#[tokio::test]
async fn a_job_has_the_warnings_of_its_result() {
    let server = server().await;
    let body = json!({ "problem": untouched(), "name": "first" });
    let job = server.solve(&body).await;
    assert_eq!(job["status"], "succeeded");
    assert_eq!(job["warnings"][0]["code"], "no_contact", "{job:#}");
    let id = job["id"].as_str().unwrap();
    let result = server.json(&format!("/v1/jobs/{id}/result")).await;
    let all = result["summary"]["warnings"].as_array().unwrap();
    assert!(all.contains(&job["warnings"][0]));

    // one that it answers, the list, and the other protocol
    let again = server.solve(&body).await;
    assert_eq!(again["cached_from"], job["id"]);
    assert_eq!(again["warnings"], job["warnings"]);
    let list = server.json("/v1/jobs?name=first").await;
    assert_eq!(list["jobs"][0]["warnings"], job["warnings"]);
    let mut grpc = JobServiceClient::connect(server.url.clone()).await.unwrap();
    let request = pb::GetJobRequest { id: id.into() };
    let by_grpc = grpc.get_job(request).await.unwrap().into_inner();
    assert_eq!(by_grpc.warnings[0].code, "no_contact");

    let body = json!({ "problem": example_json("rectangular_punch") });
    let plain = server.solve(&body).await;
    let codes: Vec<_> = plain["warnings"].as_array().unwrap().iter().collect();
    assert!(
        codes.iter().all(|one| one["code"] != "no_contact"),
        "{codes:?}"
    );
}

/// Operations: GetPlot
#[tokio::test]
async fn a_job_links_to_the_plots_that_there_are() {
    let server = server().await;
    let links = |job: &Value| -> Vec<(String, String)> {
        let links = job["links"].as_object().unwrap();
        let plots = links.iter().filter(|(name, _)| name.starts_with("plot_"));
        plots
            .map(|(name, link)| (name.clone(), link.as_str().unwrap().to_owned()))
            .collect()
    };
    let mut elastic = block(4, 4);
    elastic["contacts"] = json!([]);
    elastic["loads"] = json!([{ "boundary": "top", "pressure": 1 }]);
    let mut unfinished = example_json("rectangular_punch");
    unfinished["solver"] = json!({ "max_iterations": 3 });
    for (problem, count) in [(block(4, 4), 4), (elastic, 2), (unfinished, 4)] {
        let job = server.solve(&json!({ "problem": problem })).await;
        let found = links(&job);
        assert_eq!(found.len(), count, "{found:?} of {job:#}");
        for (name, link) in found {
            let plot = server.get(&link).send().await.unwrap();
            // of a job without a solution they are found, but have to be asked for
            if job["status"] == "failed" && name != "plot_mesh" {
                assert_eq!(plot.status(), StatusCode::CONFLICT, "{name}");
            }
            let plot = server.get(&format!("{link}?partial=true"));
            let plot = plot.send().await.unwrap();
            assert_eq!(plot.status(), StatusCode::OK, "{name}");
            let whole = if job["status"] == "succeeded" {
                "final"
            } else {
                "partial"
            };
            assert_eq!(plot.headers()["result-available"], whole, "{name}");
        }
    }
    answer(server.post("/v1/queue/pause")).await;
    let body = json!({ "problem": block(4, 4), "cache": "off" });
    let waiting = server.create_job(&body).await;
    assert_eq!(links(&waiting).len(), 1);
}

/// The parts of the result of a job, as paths below it; with whether they are there without `partial`.
const PARTS: [(&str, bool); 12] = [
    ("result", true),
    ("problem", true),
    ("plots/mesh.svg", true),
    ("history", false),
    ("history?max_points=2&format=csv", false),
    ("profiles/top", false),
    ("profiles/top?points=5&format=arrow", false),
    ("fields", false),
    ("fields?format=json", false),
    ("plots/profile.svg", false),
    ("plots/convergence.png", false),
    ("plots/deformed.pdf", false),
];

/// Whoever plots the last state of a job that failed takes it for a solution, unless it has to be asked for.
/// Operations: GetResult, ListIterations, GetProfile, StreamResult, GetPlot
#[tokio::test]
async fn the_state_of_a_job_without_a_solution_has_to_be_asked_for() {
    let server = server().await;
    let mut problem = example_json("rectangular_punch");
    problem["solver"] = json!({ "max_iterations": 3 });
    let job = server.solve(&json!({ "problem": problem })).await;
    assert_eq!(job["reason"], "not_converged", "{job:#}");
    let id = job["id"].as_str().unwrap();
    for (path, open) in PARTS {
        let path = format!("/v1/jobs/{id}/{path}");
        let found = server.get(&path).send().await.unwrap();
        if !open {
            assert_eq!(found.status(), StatusCode::CONFLICT, "{path}");
            let error: Value = found.json().await.unwrap();
            assert_eq!(error["code"], "partial-result", "{error:#}");
            assert_eq!(error["retryable"], false, "{error:#}");
            assert_eq!(error["reason"], "not_converged", "{error:#}");
            assert_eq!(error["failure"], job["failure"], "{error:#}");
            let detail = error["detail"].as_str().unwrap();
            for told in [id, "did not converge: after", "partial=true", "--partial"] {
                assert!(detail.contains(told), "{detail}");
            }
        }
        if path.ends_with("/result") || path.ends_with("/problem") {
            assert_eq!(found_status(&server, &path).await, StatusCode::OK, "{path}");
            continue; // they have no such parameter
        }
        let sign = if path.contains('?') { '&' } else { '?' };
        let asked = format!("{path}{sign}partial=");
        let found = server.get(&format!("{asked}true")).send().await.unwrap();
        assert_eq!(found.status(), StatusCode::OK, "{path}");
        assert_eq!(found.headers()["result-available"], "partial", "{path}");
        if path.ends_with("profile.svg") {
            let figure = found.text().await.unwrap();
            assert!(figure.contains("PARTIAL"), "the figure says so");
        }
        let refused = if open {
            StatusCode::OK
        } else {
            StatusCode::CONFLICT
        };
        assert_eq!(
            found_status(&server, &format!("{asked}false")).await,
            refused
        );
        let wrong = found_status(&server, &format!("{asked}yes")).await;
        assert_eq!(wrong, StatusCode::BAD_REQUEST);
    }
    let explained = server.json("/v1/errors/partial-result").await;
    assert_eq!(
        (&explained["status"], &explained["grpc"]),
        (&json!(409), &json!("FAILED_PRECONDITION"))
    );
    // what has a solution is served as before
    let solved = server
        .solve(&json!({ "problem": example_json("rectangular_punch") }))
        .await;
    let id = solved["id"].as_str().unwrap();
    for path in [
        "history",
        "history?partial=true",
        "profiles/top?partial=false",
        "plots/profile.svg?partial=true",
    ] {
        let path = format!("/v1/jobs/{id}/{path}");
        assert_eq!(found_status(&server, &path).await, StatusCode::OK, "{path}");
    }
}

/// Operations: GetProfile, GetPlot
#[tokio::test]
async fn a_load_step_that_converged_is_served_although_a_later_one_failed() {
    let server = server().await;
    let mut problem = example_json("rectangular_punch");
    problem["solver"] = json!({ "max_iterations": 3 });
    problem["steps"] = json!([{ "name": "rest", "indentation": 0.0 }, { "name": "press" }]);
    let job = server.solve(&json!({ "problem": problem })).await;
    assert_eq!(job["reason"], "not_converged", "{job:#}");
    let id = job["id"].as_str().unwrap();
    for (part, step, status) in [
        ("profiles/top", "step=rest", StatusCode::OK),
        ("profiles/top", "step=press", StatusCode::CONFLICT),
        ("profiles/top", "step=press&partial=true", StatusCode::OK),
        ("plots/profile.svg", "step=rest", StatusCode::OK),
        ("plots/profile.svg", "step=press", StatusCode::CONFLICT),
        (
            "plots/profile.svg",
            "step=press&partial=true",
            StatusCode::OK,
        ),
        ("plots/convergence.svg", "step=0", StatusCode::OK),
        ("plots/convergence.svg", "step=1", StatusCode::CONFLICT),
    ] {
        let path = format!("/v1/jobs/{id}/{part}?{step}");
        let found = server.get(&path).send().await.unwrap();
        assert_eq!(found.status(), status, "{path}");
        if status == StatusCode::OK && part.ends_with("profile.svg") {
            let figure = found.text().await.unwrap();
            assert_eq!(figure.contains("PARTIAL"), step != "step=rest", "{path}");
        }
    }
}

async fn found_status(server: &Server, path: &str) -> StatusCode {
    server.get(path).send().await.unwrap().status()
}

/// Operations: ListIterations, GetProfile, StreamResult
#[tokio::test]
async fn the_state_of_a_job_without_a_solution_has_to_be_asked_for_over_grpc_too() {
    let server = server().await;
    let mut problem = example_json("rectangular_punch");
    problem["solver"] = json!({ "max_iterations": 3 });
    let job = server.solve(&json!({ "problem": problem })).await;
    let id = job["id"].as_str().unwrap();
    let mut grpc = JobServiceClient::connect(server.url.clone()).await.unwrap();
    let result = pb::GetResultRequest { id: id.into() };
    assert!(grpc.get_result(result).await.is_ok());
    let profile = pb::GetProfileRequest {
        id: id.into(),
        boundary: "top".into(),
        ..Default::default()
    };
    let rows = pb::ListIterationsRequest {
        id: id.into(),
        ..Default::default()
    };
    let fields = pb::StreamResultRequest {
        id: id.into(),
        ..Default::default()
    };
    let mut json_fields = fields.clone();
    json_fields.set_format(pb::FieldFormat::Json);
    let refused = [
        grpc.get_profile(profile.clone()).await.map(drop),
        grpc.list_iterations(rows.clone()).await.map(drop),
        grpc.stream_result(fields.clone()).await.map(drop),
        grpc.stream_result(json_fields.clone()).await.map(drop),
    ];
    for refused in refused {
        let status = refused.unwrap_err();
        assert_eq!(status.code(), tonic::Code::FailedPrecondition);
        assert!(status.message().starts_with("partial-result: "), "{status}");
        assert!(status.message().contains("did not converge"), "{status}");
        let details = status.get_error_details();
        let info = details.error_info().unwrap();
        assert_eq!(
            (info.reason.as_str(), info.metadata["reason"].as_str()),
            ("partial-result", "not_converged")
        );
    }
    let partial = true;
    let profile = grpc
        .get_profile(pb::GetProfileRequest { partial, ..profile })
        .await;
    let rows = grpc
        .list_iterations(pb::ListIterationsRequest { partial, ..rows })
        .await;
    let fields = grpc
        .stream_result(pb::StreamResultRequest { partial, ..fields })
        .await;
    let json_fields = pb::StreamResultRequest {
        partial,
        ..json_fields
    };
    let json_fields = grpc.stream_result(json_fields).await;
    for metadata in [
        profile.unwrap().metadata(),
        rows.unwrap().metadata(),
        fields.unwrap().metadata(),
        json_fields.unwrap().metadata(),
    ] {
        assert_eq!(metadata.get("result-available").unwrap(), "partial");
    }
}

/// Operations: ListIterations, GetPlot, GetProfile
#[tokio::test]
async fn a_job_that_ran_out_of_time_or_was_canceled_has_no_solution_either() {
    let server = Server::start_alone(SIGNORINI, &["--workers", "1"]).await;
    let mut long = block(80, 80);
    long["contacts"][0]["friction"]["history"] = json!("incremental");
    long["steps"] = json!([{ "increments": 10_000 }]);
    let late = json!({ "problem": long, "cache": "off", "limits": { "timeout_s": 3 } });
    let late = server.solve(&late).await;
    assert_eq!(late["reason"], "timed_out", "{late:#}");
    let canceled = server.submit(&long).await;
    server.until(&canceled, |event| event["k"] == 3).await;
    // while it runs there is no question
    let history = format!("/v1/jobs/{canceled}/history");
    assert_eq!(found_status(&server, &history).await, StatusCode::OK);
    server.cancel(&canceled).await;
    server.until_done(&canceled).await;
    for (id, why) in [
        (late["id"].as_str().unwrap(), "time limit"),
        (&canceled, "was canceled"),
    ] {
        for part in ["history", "plots/convergence.svg"] {
            let path = format!("/v1/jobs/{id}/{part}");
            let refused = server.get(&path).send().await.unwrap();
            assert_eq!(refused.status(), StatusCode::CONFLICT, "{path}");
            let error: Value = refused.json().await.unwrap();
            assert!(error["detail"].as_str().unwrap().contains(why), "{error:#}");
            let asked = format!("{path}?partial=true");
            assert_eq!(
                found_status(&server, &asked).await,
                StatusCode::OK,
                "{asked}"
            );
        }
    }
    // without any result there is nothing to ask for
    let waiting = server.submit(&long).await;
    let never = server.submit(&example_json("sheet")).await;
    server.cancel(&never).await;
    let none = format!("/v1/jobs/{never}/profiles/top");
    assert_eq!(found_status(&server, &none).await, StatusCode::NOT_FOUND);
    server.cancel(&waiting).await;
}

async fn patch(server: &Server, id: &str, body: &str) -> (StatusCode, Value) {
    let request = server
        .request(Method::PATCH, &format!("/v1/jobs/{id}"))
        .header(header::CONTENT_TYPE, "application/merge-patch+json")
        .body(body.to_owned());
    answer(request).await
}

/// Operations: UpdateJob
#[tokio::test]
async fn a_merge_patch_changes_single_labels() {
    let server = server().await;
    let labels = json!({ "a": "1", "b": "2" });
    let body = json!({ "problem": block(2, 2), "name": "n", "labels": labels, "priority": 3 });
    let job = server.solve(&body).await;
    let id = job["id"].as_str().unwrap();
    let (status, job) = patch(&server, id, r#"{"labels": {"a": null, "c": "3"}}"#).await;
    assert_eq!(
        (status, &job["labels"]),
        (StatusCode::OK, &json!({ "b": "2", "c": "3" }))
    );
    assert_eq!((&job["name"], &job["priority"]), (&json!("n"), &json!(3)));
    let stale = server
        .request(Method::PATCH, &format!("/v1/jobs/{id}"))
        .header(header::CONTENT_TYPE, "application/merge-patch+json")
        .header(header::IF_MATCH, "\"1\"")
        .body(r#"{"labels": {"b": null}}"#);
    assert_eq!(answer(stale).await.0, StatusCode::PRECONDITION_FAILED);
    // a condition is judged only if the request is valid
    let too_many = |count: u32, value: Value| -> Value {
        let labels: serde_json::Map<_, _> =
            (0..count).map(|n| (n.to_string(), value.clone())).collect();
        json!({ "labels": labels })
    };
    for labels in [too_many(65, json!("x")), too_many(129, json!(null))] {
        let invalid = server
            .request(Method::PATCH, &format!("/v1/jobs/{id}"))
            .header(header::CONTENT_TYPE, "application/merge-patch+json")
            .header(header::IF_MATCH, "\"1\"")
            .body(labels.to_string());
        let (status, refused) = answer(invalid).await;
        assert_eq!(status, StatusCode::UNPROCESSABLE_ENTITY, "{refused:#}");
    }
    let nulls = r#"{"name": null, "labels": null, "priority": null, "pinned": null}"#;
    let (_, job) = patch(&server, id, nulls).await;
    assert_eq!(
        (
            &job["name"],
            &job["labels"],
            &job["priority"],
            &job["pinned"]
        ),
        (&json!(null), &json!({}), &json!(0), &json!(false))
    );
    // at most 64 in the end, of which a patch may only add some
    let many = |from: u32| -> String {
        let labels: serde_json::Map<_, _> = (from..from + 40)
            .map(|n| (n.to_string(), json!("x")))
            .collect();
        json!({ "labels": labels }).to_string()
    };
    assert_eq!(patch(&server, id, &many(0)).await.0, StatusCode::OK);
    let (status, refused) = patch(&server, id, &many(40)).await;
    assert_eq!(status, StatusCode::UNPROCESSABLE_ENTITY, "{refused:#}");
    let (status, _) = patch(&server, id, r#"{"labels": {"a": 1}}"#).await;
    assert_eq!(status, StatusCode::UNPROCESSABLE_ENTITY);
    // another patch format, and a merge patch where none is meant
    for (method, path, kind) in [
        (
            Method::PATCH,
            format!("/v1/jobs/{id}"),
            "application/json-patch+json",
        ),
        (
            Method::POST,
            "/v1/jobs".to_owned(),
            "application/merge-patch+json",
        ),
    ] {
        let request = server
            .request(method, &path)
            .header(header::CONTENT_TYPE, kind);
        assert_eq!(
            answer(request.body("{}")).await.0,
            StatusCode::UNSUPPORTED_MEDIA_TYPE
        );
    }
}

/// Operations: StreamResult, GetJob
#[tokio::test]
async fn large_answers_are_compressed_for_clients_that_accept_it() {
    let server = server().await;
    let job = server.solve(&json!({ "problem": block(20, 20) })).await;
    let id = job["id"].as_str().unwrap();
    for path in ["fields?format=json", "fields?format=vtu"] {
        let path = format!("/v1/jobs/{id}/{path}");
        let plain = server.get(&path).send().await.unwrap();
        let (tag, vary) = (
            plain.headers()["etag"].clone(),
            plain.headers().get_all("vary"),
        );
        assert!(vary.iter().any(|value| value == "Accept-Encoding"));
        assert!(!plain.headers().contains_key("content-encoding"));
        let plain = plain.bytes().await.unwrap();

        let asked = |name: &'static str, value: &str| {
            server
                .get(&path)
                .header("Accept-Encoding", "gzip")
                .header(name, value)
                .send()
        };
        let packed = asked("accept", "*/*").await.unwrap();
        let headers = packed.headers().clone();
        assert_eq!(headers["content-encoding"], "gzip");
        assert_eq!(headers["etag"], format!("W/{}", tag.to_str().unwrap()));
        for gone in [
            "content-length",
            "content-digest",
            "repr-digest",
            "accept-ranges",
        ] {
            assert!(!headers.contains_key(gone), "{gone}");
        }
        let packed = packed.bytes().await.unwrap();
        assert!(
            packed.starts_with(b"\x1f\x8b") && packed.len() * 5 < plain.len() * 4,
            "{}",
            packed.len()
        );
        // gzip ends with the length of what it holds
        let length = u32::from_le_bytes(packed[packed.len() - 4..].try_into().unwrap());
        assert_eq!(length as usize, plain.len());

        let known = asked("if-none-match", headers["etag"].to_str().unwrap());
        assert_eq!(known.await.unwrap().status(), StatusCode::NOT_MODIFIED);
        let part = asked("range", "bytes=0-99999").await.unwrap();
        assert_eq!(part.status(), StatusCode::PARTIAL_CONTENT);
        assert!(!part.headers().contains_key("content-encoding"));
        assert_eq!(
            part.bytes().await.unwrap()[..],
            plain[..100_000.min(plain.len())]
        );
    }
    // small ones keep their strong tag, and streams come as they are
    for path in [format!("/v1/jobs/{id}"), format!("/v1/jobs/{id}/events")] {
        let found = server
            .get(&path)
            .header("Accept-Encoding", "gzip")
            .send()
            .await
            .unwrap();
        assert!(!found.headers().contains_key("content-encoding"), "{path}");
    }
}
