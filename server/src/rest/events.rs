//! `/v1/jobs/{id}/events`: replayed and then live, as server-sent events or as JSON Lines.

use std::{sync::Arc, time::Duration};

use axum::{
    body::Body,
    extract::{RawQuery, State},
    http::{HeaderMap, StatusCode, header},
    response::{
        IntoResponse, Response,
        sse::{self, KeepAlive, Sse},
    },
};
use futures_util::{StreamExt, TryStreamExt};

use super::{
    Rest,
    request::{JobPath, Params, accepted, wants, weight},
};
use crate::{
    error::ApiError,
    event::Event,
    job::Job,
    verbs::{Service, jobs, watch as verbs},
    violations,
};

/// Tells proxies and clients that the line still stands.
const PING: Duration = Duration::from_secs(15);
/// Server-sent events.
const SSE: &str = "text/event-stream";
/// A JSON object per line, by its names.
const LINES: [&str; 2] = ["application/jsonl", "application/x-ndjson"];

pub(super) async fn watch(
    State(rest): State<Rest>,
    RawQuery(query): RawQuery,
    headers: HeaderMap,
    path: JobPath,
) -> Result<Response, ApiError> {
    const SEQ: &str = "a whole number, 0 or more";
    let params = Params::parse(query.as_deref(), &["after_seq"])?;
    let asked = params.number("after_seq", 0..=i64::MAX, SEQ)?;
    // The header wins: a browser reconnects to the same address, and knows better than that.
    let seen = match headers.get("last-event-id") {
        Some(value) => {
            let text = String::from_utf8_lossy(value.as_bytes());
            let seq = text.trim().parse::<i64>().ok().filter(|seq| *seq >= 0);
            let bad = ApiError::BadParameter {
                name: "Last-Event-ID",
                got: text.to_string(),
                expected: SEQ,
            };
            Some(seq.ok_or(bad)?)
        }
        None => None,
    };
    let after = seen.or(asked).unwrap_or(0);
    let job = jobs::get(&rest.service, path.id).await?;
    if verbs::is_silent(&rest.service, &job, after).await? {
        return Ok(StatusCode::NO_CONTENT.into_response());
    }
    let accepted = accepted(&headers);
    let some = |media: &str| weight(&accepted, media).0 > 0.0;
    if !accepted.is_empty()
        && ![SSE, LINES[0], LINES[1], "application/json"]
            .into_iter()
            .any(some)
    {
        return Err(ApiError::NotAcceptable {
            got: violations::name(&accepted.join(", ")),
            available: format!("{SSE}, {}", LINES[0]),
        });
    }
    Ok(wanted(&headers, &rest.service, &job, after)
        .unwrap_or_else(|| stream(&rest.service, &job, after)))
}

/// The events of a job after number `after`, if the client wants these rather than JSON.
pub(super) fn wanted(
    headers: &HeaderMap,
    service: &Arc<Service>,
    job: &Job,
    after: i64,
) -> Option<Response> {
    if wants(headers, &[SSE]) {
        return Some(stream(service, job, after));
    }
    wants(headers, &LINES).then(|| lines(service, job, after))
}

/// As server-sent events.
fn stream(service: &Arc<Service>, job: &Job, after: i64) -> Response {
    // An error just ends the stream: without `done` the client knows that there is more to come.
    let events = verbs::watch(service.clone(), (job.id, job.key), after)
        .map(|event| event.and_then(|event| told(&event)))
        .inspect_err(|error| tracing::debug!(%error, "event stream ended: {error}"))
        .take_while(|event| std::future::ready(event.is_ok()));
    Sse::new(events)
        .keep_alive(KeepAlive::new().interval(PING).text("ping"))
        .into_response()
}

/// A line each.
fn lines(service: &Arc<Service>, job: &Job, after: i64) -> Response {
    let lines = verbs::watch(service.clone(), (job.id, job.key), after)
        .map(|event| {
            let mut line = serde_json::to_vec(&event?).map_err(ApiError::internal)?;
            line.push(b'\n');
            Ok::<_, ApiError>(line)
        })
        .take_while(|line| std::future::ready(line.is_ok()));
    let headers = [
        (header::CONTENT_TYPE, LINES[0]),
        (header::CACHE_CONTROL, "no-cache"),
    ];
    (headers, Body::from_stream(lines)).into_response()
}

fn told(event: &Event) -> Result<sse::Event, ApiError> {
    let data = serde_json::to_string(event).map_err(ApiError::internal)?;
    Ok(sse::Event::default()
        .id(event.seq.to_string())
        .event(event.payload.kind())
        .data(data))
}
