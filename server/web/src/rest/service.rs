//! Operations on the service itself: queue, info, caller, errors, descriptions, probes.

use axum::{
    Json,
    http::header,
    response::{IntoResponse, Response},
};
use base::{
    catalog::{self, Code, Kind, WarningKind},
    values::Words,
};
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;
use service::{
    error::ApiError,
    parameters::Variable,
    verbs::{
        info::{self as about, Info, Me, OwnerUse},
        metrics::metrics as all_metrics,
        queue::{self as verbs, QueueState},
    },
};
use solver::solution::WarningCode;

use super::{accept::prefers, call::Call};

pub(super) async fn queue(call: Call) -> Result<Json<QueueState>, ApiError> {
    Ok(Json(verbs::state(&call.service, &call.caller)))
}

pub(super) async fn pause(call: Call) -> Result<Json<QueueState>, ApiError> {
    Ok(Json(verbs::pause(&call.service, &call.caller).await?))
}

pub(super) async fn resume(call: Call) -> Result<Json<QueueState>, ApiError> {
    Ok(Json(verbs::resume(&call.service, &call.caller).await?))
}

pub(super) async fn info(call: Call) -> Result<Json<Info>, ApiError> {
    Ok(Json(about::info(&call.service, &call.caller).await?))
}

pub(super) async fn me(call: Call) -> Result<Json<Me>, ApiError> {
    Ok(Json(about::me(&call.service, &call.caller).await?))
}

/// The owners and their use of the service.
#[derive(Serialize, JsonSchema)]
pub(super) struct Owners {
    /// The owners, those with the most stored bytes first.
    owners: Vec<OwnerUse>,
}

pub(super) async fn owners(call: Call) -> Result<Json<Owners>, ApiError> {
    let owners = about::owners(&call.service, &call.caller).await?;
    Ok(Json(Owners { owners }))
}

/// A kind of error in a path.
pub(super) const CODE: Variable<Words<Code>> = Variable {
    name: "code",
    kind: "error",
    meaning: "The kind of error",
    values: Words::all(),
};

/// The explanation of a kind of error: as JSON for programs, or as a page for people.
pub(super) async fn error(call: Call, code: Code) -> Result<Response, ApiError> {
    let kind = code.kind();
    let vary = [(header::VARY, "Accept")];
    if prefers(&call.headers, &["text/html"]) {
        let html = [
            (header::CONTENT_TYPE, "text/html; charset=utf-8"),
            (
                header::CONTENT_SECURITY_POLICY,
                "default-src 'none'; style-src 'unsafe-inline'",
            ),
        ];
        return Ok((vary, html, page(&kind)).into_response());
    }
    Ok((vary, Json(kind)).into_response())
}

/// The explanation as a page. Its texts are constants without any character that HTML would interpret.
fn page(kind: &Kind) -> String {
    let Kind {
        code,
        title,
        explanation,
        ..
    } = kind;
    let facts: String = kind
        .facts()
        .iter()
        .map(|fact| format!("<p>{fact}</p>"))
        .collect();
    format!(
        "<!doctype html><html lang=en><meta charset=utf-8><meta name=viewport content=\"width=device-width\">\
         <title>{code} – Signorini</title>\
         <style>body{{font:1rem/1.5 system-ui,sans-serif;max-width:40rem;margin:3rem auto;padding:0 1rem}}\
         code{{font-size:1.1em}}</style>\
         <h1>{title}</h1><p><code>{code}</code></p>{facts}<p>{explanation}</p></html>\n"
    )
}

/// A warning in a path.
pub(super) const WARNING: Variable<Words<WarningCode>> = Variable {
    name: "code",
    kind: "warning",
    meaning: "The code of a warning",
    values: Words::all(),
};

/// The explanation of a warning.
pub(super) async fn warning(_: Call, code: WarningCode) -> Result<Json<WarningKind>, ApiError> {
    Ok(Json(catalog::warning(code)))
}

/// Returns the JSON Schema of a problem.
pub(super) async fn schema(_: Call) -> Result<Json<Value>, ApiError> {
    Ok(Json(files::schema()))
}

/// Returns the description of the API over REST.
pub(super) async fn openapi(call: Call) -> Result<Json<&'static Value>, ApiError> {
    Ok(Json((call.openapi)()))
}

/// Returns the description of the API over gRPC.
pub(super) async fn proto(_: Call) -> Result<impl IntoResponse, ApiError> {
    const TEXT: &str = include_str!("../../../../proto/signorini/v1/signorini.proto");
    Ok(([(header::CONTENT_TYPE, "text/plain; charset=utf-8")], TEXT))
}

/// Whether a request is for one of the probes or for metrics, which are answered even if all connections are busy.
pub fn is_probe(path: &str) -> bool {
    matches!(
        path,
        "/livez" | "/readyz" | "/metrics" | "/grpc.health.v1.Health/Check"
    )
}

/// Returns metrics in the text format of OpenMetrics, which Prometheus and others read whatever format they request.
pub(super) async fn metrics(call: Call) -> Result<impl IntoResponse, ApiError> {
    let text = all_metrics(&call.service, &call.caller).await?;
    Ok(([(header::CONTENT_TYPE, OPENMETRICS)], text))
}

/// The media type of metrics.
pub(super) const OPENMETRICS: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

/// Answers that the process is alive.
pub(super) async fn livez(_: Call) -> Result<&'static str, ApiError> {
    Ok("ok\n")
}

/// Answers whether the service works; further lines say what does not. A damaged record is not an error here, since a
/// proxy would then send no more requests, not even for intact records.
pub(super) async fn readyz(call: Call) -> Result<String, ApiError> {
    let health = call.service.health().await?;
    let mut text = String::from(if health.is_whole() {
        "ok\n"
    } else {
        "degraded\n"
    });
    for line in health.lines() {
        text.push_str(&line);
        text.push('\n');
    }
    Ok(text)
}
