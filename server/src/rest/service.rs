//! The service itself: queue, info, caller, errors, schema, probes.

use axum::{
    Json,
    extract::{RawQuery, State},
    http::{HeaderMap, StatusCode, header},
    response::{IntoResponse, Response},
};
use serde_json::Value;

use super::{
    Rest,
    request::{Params, TextPath, wants},
};
use crate::{
    catalog::{Code, Kind},
    error::ApiError,
    verbs::queue::{self as verbs, Caller, Info, QueueState},
    violations,
};

pub(super) async fn queue(
    State(rest): State<Rest>,
    RawQuery(query): RawQuery,
) -> Result<Json<QueueState>, ApiError> {
    Params::parse(query.as_deref(), &[])?;
    Ok(Json(verbs::state(&rest.service)))
}

pub(super) async fn pause(
    State(rest): State<Rest>,
    RawQuery(query): RawQuery,
) -> Result<Json<QueueState>, ApiError> {
    Params::parse(query.as_deref(), &[])?;
    Ok(Json(verbs::pause(&rest.service).await?))
}

pub(super) async fn resume(
    State(rest): State<Rest>,
    RawQuery(query): RawQuery,
) -> Result<Json<QueueState>, ApiError> {
    Params::parse(query.as_deref(), &[])?;
    Ok(Json(verbs::resume(&rest.service).await?))
}

pub(super) async fn info(
    State(rest): State<Rest>,
    RawQuery(query): RawQuery,
) -> Result<Json<Info>, ApiError> {
    Params::parse(query.as_deref(), &[])?;
    Ok(Json(verbs::info(&rest.service)))
}

pub(super) async fn me(RawQuery(query): RawQuery) -> Result<Json<Caller>, ApiError> {
    Params::parse(query.as_deref(), &[])?;
    Ok(Json(verbs::caller()))
}

/// What a kind of error means: for programs, or as a page for people.
pub(super) async fn error(
    RawQuery(query): RawQuery,
    headers: HeaderMap,
    TextPath(code): TextPath,
) -> Result<Response, ApiError> {
    Params::parse(query.as_deref(), &[])?;
    let Some(found) = Code::parse(&code) else {
        let known: Vec<&str> = Code::ALL.iter().map(|code| code.kind().code).collect();
        return Err(ApiError::NotFound(format!(
            "there is no error {:?}; there are: {}",
            violations::name(&code),
            known.join(", ")
        )));
    };
    let kind = found.kind();
    let vary = [(header::VARY, "Accept")];
    if wants(&headers, &["text/html"]) {
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

/// The explanation as a page. All its texts are our own, and hold nothing that HTML would read.
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

/// The JSON Schema of a problem.
pub(super) async fn schema(RawQuery(query): RawQuery) -> Result<Json<Value>, ApiError> {
    Params::parse(query.as_deref(), &[])?;
    Ok(Json(files::schema()))
}

/// The API over gRPC.
pub(super) async fn proto(RawQuery(query): RawQuery) -> Result<impl IntoResponse, ApiError> {
    const TEXT: &str = include_str!("../../../proto/signorini/v1/signorini.proto");
    Params::parse(query.as_deref(), &[])?;
    Ok(([(header::CONTENT_TYPE, "text/plain; charset=utf-8")], TEXT))
}

/// The process is alive.
pub(super) async fn livez() -> &'static str {
    "ok\n"
}

/// The service takes jobs.
pub(super) async fn readyz(
    State(rest): State<Rest>,
) -> Result<(StatusCode, &'static str), ApiError> {
    rest.service.accepting()?;
    rest.service.store.ping().await?;
    Ok((StatusCode::OK, "ok\n"))
}
