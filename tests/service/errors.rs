//! Every error is a problem document.

use std::collections::BTreeSet;

use reqwest::{Method, RequestBuilder, StatusCode};
use serde_json::Value;
use suite::example;

use crate::server;

/// The error of a request: its status, and its document.
async fn refused(request: RequestBuilder) -> (StatusCode, Value) {
    let response = request.send().await.unwrap();
    let status = response.status();
    assert_eq!(
        response.headers()["content-type"],
        "application/problem+json"
    );
    let document: Value = response.json().await.unwrap();
    assert_eq!(document["status"], status.as_u16());
    assert_eq!(
        document["type"],
        format!("/v1/errors/{}", document["code"].as_str().unwrap())
    );
    for name in ["title", "detail", "instance"] {
        assert!(
            !document[name].as_str().unwrap().is_empty(),
            "{name} of {document}"
        );
    }
    assert!(document["retryable"].is_boolean() && document["errors"].is_array());
    (status, document)
}

/// Operations: GetJob, WatchJob, GetResult
#[tokio::test]
async fn unknown_resources_are_not_found() {
    let server = server().await;
    let unknown = "job_01900000-0000-7000-8000-000000000000";
    for path in [
        "/v1/nothing".to_string(),
        format!("/v1/jobs/{unknown}"),
        format!("/v1/jobs/{unknown}/events"),
        format!("/v1/jobs/{unknown}/result"),
        "/v1/jobs/7".into(),
        "/v1/jobs/job_7/profiles/top".into(),
        "/v1/jobs/%ff".into(),
        format!("/v1/jobs/{}", unknown.to_uppercase()),
    ] {
        let (status, document) = refused(server.get(&path)).await;
        assert_eq!(
            (status, document["code"].as_str()),
            (StatusCode::NOT_FOUND, Some("not-found")),
            "{path}"
        );
        assert_eq!(document["instance"], path);
    }
}

#[tokio::test]
async fn a_wrong_method_is_answered_with_the_allowed_ones() {
    let server = server().await;
    let client = suite::harness::client();
    for (method, path, allowed) in [
        (Method::PATCH, "/v1/jobs", "GET,HEAD,POST,DELETE"),
        (Method::GET, "/v1/problems/validate", "POST"),
        (Method::POST, "/livez", "GET,HEAD"),
    ] {
        let request = client.request(method, format!("{}{path}", server.url));
        let response = request.try_clone().unwrap().send().await.unwrap();
        // in any order
        let header = response.headers()["allow"].to_str().unwrap();
        let methods: BTreeSet<&str> = header.split(',').collect();
        assert_eq!(methods, allowed.split(',').collect(), "{path}");
        assert_eq!(refused(request).await.0, StatusCode::METHOD_NOT_ALLOWED);
    }
}

/// Operations: CreateJob
#[tokio::test]
async fn malformed_json_is_distinguished_from_an_invalid_body() {
    let server = server().await;
    let post = |kind: &str, body: &str| {
        server
            .post("/v1/jobs")
            .header("Content-Type", kind)
            .body(body.to_string())
    };
    let problem = format!("{{\"problem\": {}}}", example("sheet"));
    assert_eq!(
        refused(post("text/plain", &problem)).await.0,
        StatusCode::UNSUPPORTED_MEDIA_TYPE
    );
    for text in [
        "",
        "{",
        "{\"problem\": {}",
        "{\"problem\": {}} x",
        "{\"problem\": NaN}",
    ] {
        let (status, document) = refused(post("application/json", text)).await;
        assert_eq!(
            (status, document["code"].as_str()),
            (StatusCode::BAD_REQUEST, Some("malformed-json")),
            "{text}"
        );
    }
    for text in [
        "[]",
        "7",
        "null",
        "{}",
        "{\"problem\": 7}",
        "{\"problem\": {}}",
    ] {
        let (status, document) = refused(post("application/json; charset=utf-8", text)).await;
        assert_eq!(
            (status, document["code"].as_str()),
            (StatusCode::UNPROCESSABLE_ENTITY, Some("invalid-problem")),
            "{text}"
        );
        assert!(!document["errors"].as_array().unwrap().is_empty());
    }
}

/// Operations: ListJobs
#[tokio::test]
async fn unknown_parameters_and_invalid_values_are_refused() {
    let server = server().await;
    for (query, code) in [
        ("color=red", "unknown-parameter"),
        ("status=done", "bad-parameter"),
        ("page_size=0", "bad-parameter"),
        ("page_size=1001", "bad-parameter"),
        ("page_size=many", "bad-parameter"),
        ("page_token=abc", "bad-page-token"),
    ] {
        let (status, document) = refused(server.get(&format!("/v1/jobs?{query}"))).await;
        assert_eq!(
            (status, document["code"].as_str()),
            (StatusCode::BAD_REQUEST, Some(code)),
            "{query}"
        );
    }
}

/// Operations: Live, Ready, GetProblemSchema
#[tokio::test]
async fn the_probes_and_the_schema_answer() {
    let server = server().await;
    for path in ["/livez", "/readyz"] {
        assert_eq!(
            server.get(path).send().await.unwrap().status(),
            StatusCode::OK
        );
    }
    assert!(server.json("/v1/schema/problem.json").await["properties"]["mesh"].is_object());
}
