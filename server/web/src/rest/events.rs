//! The operation `/v1/jobs/{id}/events`: past events, then live ones, as server-sent events or as JSON Lines.

use std::{
    cmp::Ordering, collections::BTreeSet, convert::Infallible, pin::pin, sync::Arc, time::Duration,
};

use async_stream::stream;
use axum::{
    body::Body,
    http::{HeaderMap, StatusCode, header},
    response::{IntoResponse, Response},
};
use base::{
    event::StoredEvent,
    job::JobId,
    sweep::SweepEvent,
    values::{Integers, Text},
};
use futures_util::{Stream, StreamExt};
use serde_json::json;
use service::{
    error::ApiError,
    parameters::Parameter,
    verbs::{
        watch::{AFTER_SEQ, watch},
        watch_list::{self, AFTER, ListEvent, ListPayload},
    },
    violations,
};
use store::Filter;
use tokio::time::timeout;

use super::{
    accept::{accepted, prefers, weight},
    call::Call,
    job_row::row,
};

/// The interval of the comments that keep a connection open through proxies and clients.
const PING: Duration = Duration::from_secs(15);
/// How soon a browser connects again after a stream was cut (ms).
const RETRY_MS: u32 = 1000;
/// The most events that are sent together: each watcher holds the text of so many in memory.
const AT_ONCE: usize = 16;
/// The media type of server-sent events.
const SSE: &str = "text/event-stream";
/// The media types of JSON Lines, a JSON object on each line.
const LINES: [&str; 2] = ["application/jsonl", "application/x-ndjson"];

/// The header that a browser adds when it reconnects to the same address.
pub(super) const LAST_EVENT_ID: Parameter<Integers> = Parameter {
    name: "Last-Event-ID",
    meaning: "Same as after_seq; takes precedence over it",
    values: AFTER_SEQ.values,
};

/// The header that a browser adds when it reconnects to the stream of a list.
pub(super) const LAST_LIST_EVENT_ID: Parameter<Text> = Parameter {
    name: "Last-Event-ID",
    meaning: "Same as after; takes precedence over it",
    values: AFTER.values,
};

pub(super) async fn events(
    call: Call,
    id: JobId,
    asked: Option<i64>,
    seen: Option<i64>,
) -> Result<Response, ApiError> {
    let after = seen.or(asked).unwrap_or(0);
    let events = watch(&call.service, &call.caller, id, after).await?;
    answer(&call.headers, events)
}

/// Answers with a stream of events in the format that the client asks for; `None` is answered with *no content*.
pub(super) fn answer<E: Numbered>(
    headers: &HeaderMap,
    events: Option<impl Stream<Item = Result<E, ApiError>> + Send + 'static>,
) -> Result<Response, ApiError> {
    let Some(events) = events else {
        return Ok(StatusCode::NO_CONTENT.into_response());
    };
    Ok(write(events, chosen(headers)?))
}

/// The format of events that the client prefers; server-sent events if it prefers both formats equally, or sends no
/// `Accept`.
fn chosen(headers: &HeaderMap) -> Result<Encoding, ApiError> {
    let accepted = accepted(headers);
    let most = |media: &[&str]| {
        let weights = media.iter().map(|media| weight(&accepted, media));
        let positive = weights.filter(|weight| weight.0 > 0.0);
        positive.max_by(|one, other| one.partial_cmp(other).unwrap_or(Ordering::Equal))
    };
    match (most(&[SSE]), most(&LINES)) {
        _ if accepted.is_empty() => Ok(Encoding::Stream),
        (None, None) => Err(ApiError::NotAcceptable {
            got: violations::quoted(&accepted.join(", ")),
            available: format!("{SSE}, {}", LINES[0]),
        }),
        (stream, lines) if lines > stream => Ok(Encoding::Lines),
        _ => Ok(Encoding::Stream),
    }
}

/// An event with a number and a type.
pub(super) trait Numbered: Send + 'static {
    /// The id after which a stream goes on; `None` for an event before the last of those that belong together.
    fn id(&self) -> Option<String>;
    /// The event's type.
    fn kind(&self) -> &str;
    /// The event as JSON.
    fn json(&self) -> serde_json::Result<String>;
}

impl Numbered for Arc<StoredEvent> {
    fn id(&self) -> Option<String> {
        Some(self.seq.to_string())
    }

    fn kind(&self) -> &str {
        &self.kind
    }

    fn json(&self) -> serde_json::Result<String> {
        Ok(StoredEvent::json(self))
    }
}

impl Numbered for SweepEvent {
    fn id(&self) -> Option<String> {
        Some(self.seq.to_string())
    }

    fn kind(&self) -> &str {
        (&self.payload).into()
    }

    fn json(&self) -> serde_json::Result<String> {
        serde_json::to_string(self)
    }
}

/// An event of a list as it is sent: jobs have the fields that were asked for.
pub(super) struct SentListEvent {
    id: Option<String>,
    kind: &'static str,
    json: serde_json::Result<String>,
}

impl Numbered for SentListEvent {
    fn id(&self) -> Option<String> {
        self.id.clone()
    }

    fn kind(&self) -> &str {
        self.kind
    }

    fn json(&self) -> serde_json::Result<String> {
        match &self.json {
            Ok(json) => Ok(json.clone()),
            Err(error) => Err(serde::ser::Error::custom(error)),
        }
    }
}

pub(super) async fn list_events(
    call: Call,
    filter: Filter,
    fields: Option<BTreeSet<&'static str>>,
    asked: Option<String>,
    seen: Option<String>,
) -> Result<Response, ApiError> {
    let events = watch_list::watch(&call.service, &call.caller, filter, seen.or(asked))?;
    let fields = fields.map(Arc::new);
    let events = events.map(move |event| {
        let ListEvent { id, payload } = event?;
        let kind = payload.kind();
        let mut with_id = match payload {
            ListPayload::Job { job } => serde_json::to_value(row(*job, fields.as_ref()))
                .map(|job| json!({ "type": kind, "job": job })),
            other => serde_json::to_value(other),
        };
        // also in JSON Lines, which have no place for it
        if let (Ok(value), Some(id)) = (&mut with_id, &id) {
            value["after"] = json!(id);
        }
        let json = with_id.map(|value| value.to_string());
        Ok(SentListEvent { id, kind, json })
    });
    answer(&call.headers, Some(events))
}

/// The format of a stream of events.
#[derive(Clone, Copy, Debug)]
pub(super) enum Encoding {
    /// Server-sent events.
    Stream,
    /// JSON Lines.
    Lines,
}

/// The format of events that the client prefers to an answer in JSON; `None` if it prefers JSON.
pub(super) fn preferred(headers: &HeaderMap) -> Option<Encoding> {
    if prefers(headers, &[SSE]) {
        return Some(Encoding::Stream);
    }
    prefers(headers, &LINES).then_some(Encoding::Lines)
}

/// A header for nginx, which as a proxy would otherwise hold back events until they have four kilobytes.
const UNBUFFERED: [(&str, &str); 1] = [("x-accel-buffering", "no")];

/// Answers with a stream of events.
pub(super) fn write<E: Numbered>(
    events: impl Stream<Item = Result<E, ApiError>> + Send + 'static,
    encoding: Encoding,
) -> Response {
    let media = match encoding {
        Encoding::Stream => SSE,
        Encoding::Lines => LINES[0],
    };
    let headers = [
        (header::CONTENT_TYPE, media),
        (header::CACHE_CONTROL, "no-cache"),
    ];
    let pieces = pieces(events, encoding).map(Ok::<_, Infallible>);
    (UNBUFFERED, headers, Body::from_stream(pieces)).into_response()
}

/// The events as text: those that are there already together, and between server-sent events a comment after each pause.
/// An error ends the text without `done`, so that the client knows that it is incomplete.
fn pieces<E: Numbered>(
    events: impl Stream<Item = Result<E, ApiError>> + Send + 'static,
    encoding: Encoding,
) -> impl Stream<Item = String> + Send {
    stream! {
        let mut events = pin!(events.ready_chunks(AT_ONCE));
        // it stands in the block of the first event: simple clients take each block for an event
        let mut retry = match encoding {
            Encoding::Stream => Some(format!("retry: {RETRY_MS}\n")),
            Encoding::Lines => None,
        };
        loop {
            let next = match encoding {
                Encoding::Stream => timeout(PING, events.next()).await,
                Encoding::Lines => Ok(events.next().await),
            };
            let Ok(next) = next else {
                yield ": ping\n\n".to_owned();
                continue;
            };
            let Some(chunk) = next else { return };
            let mut piece = retry.take().unwrap_or_default();
            let added = chunk.into_iter().try_for_each(|event| add(&event?, encoding, &mut piece));
            if !piece.is_empty() {
                yield piece;
            }
            if let Err(error) = added {
                tracing::debug!(%error, "event stream ended: {error}");
                return;
            }
        }
    }
}

/// Adds an event to a text in the format `encoding`. JSON has no line breaks.
fn add(event: &impl Numbered, encoding: Encoding, text: &mut String) -> Result<(), ApiError> {
    let json = event.json().map_err(ApiError::internal)?;
    if let Encoding::Lines = encoding {
        text.push_str(&format!("{json}\n"));
        return Ok(());
    }
    if let Some(id) = event.id() {
        text.push_str(&format!("id: {id}\n"));
    }
    text.push_str(&format!("event: {}\ndata: {json}\n\n", event.kind()));
    Ok(())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn events_come_in_a_format_that_the_client_takes_or_not_at_all() {
        let chosen = |accept: Option<&str>| {
            let mut headers = HeaderMap::new();
            if let Some(accept) = accept {
                headers.insert(header::ACCEPT, accept.parse().unwrap());
            }
            chosen(&headers)
        };
        for stream in [
            None,
            Some("*/*"),
            Some("text/event-stream"),
            Some("application/json, text/event-stream"),
            Some("application/json, text/plain, */*"),
            Some("text/event-stream, application/jsonl"),
            Some("application/jsonl;q=0.5, text/event-stream"),
        ] {
            let found = chosen(stream);
            assert!(matches!(found, Ok(Encoding::Stream)), "{stream:?}");
        }
        for lines in [
            "application/jsonl",
            "application/x-ndjson",
            "application/jsonl, */*",
            "application/*",
            "text/event-stream;q=0.5, application/jsonl",
            "text/event-stream;q=0, */*",
        ] {
            let found = chosen(Some(lines));
            assert!(matches!(found, Ok(Encoding::Lines)), "{lines}");
        }
        for neither in ["application/json", "text/html", "application/*;q=0"] {
            let found = chosen(Some(neither));
            assert!(
                matches!(found, Err(ApiError::NotAcceptable { .. })),
                "{neither}"
            );
        }
    }
}
