//! Compresses answers with gzip or zstd, if the client accepts it and the answer is large text. Streams of events are
//! not compressed, nor are data that are compressed already; a range refers to the uncompressed bytes. tower-http's
//! layer is not used, since it answers 406 after the handler has run, and leaves entity tags strong.

use axum::{
    body::HttpBody,
    extract::{Request, State},
    http::{HeaderName, HeaderValue, Method, StatusCode, Version, header},
    middleware::Next,
    response::Response,
};
use service::transfer::{Limit, Share};

use super::coding::Coding;

/// The smallest size of an answer that is compressed (bytes); smaller answers, such as jobs, fit into a few packets
/// anyway.
const SMALLEST: u64 = 16 << 10;

/// Compresses an answer if that is worth it and there is memory for an encoder: the encoder stays in memory as long as
/// the answer, even if the client reads nothing.
pub(super) async fn compressed(
    State(sent): State<Limit>,
    request: Request,
    next: Next,
) -> Response {
    // over HTTP/1.0 an answer without a length ends with the connection: nobody would notice one that is cut
    let has_an_end = request.version() >= Version::HTTP_11;
    let wanted = Coding::accepted(request.headers())
        .filter(|_| has_an_end && request.method() != Method::HEAD);
    let mut response = next.run(request).await;
    if !is_worth_it(&response) {
        return response;
    }
    response
        .headers_mut()
        .append(header::VARY, HeaderValue::from_static("Accept-Encoding"));
    let room = |coding: Coding| Some((coding, sent.take(coding.encoder_bytes()).ok()?));
    match wanted.and_then(room) {
        Some((coding, share)) => encoded(response, coding, share),
        None => response,
    }
}

/// Whether the answer is large, text, complete and of known length, which excludes streams of events.
fn is_worth_it(response: &Response) -> bool {
    let headers = response.headers();
    let declared = headers.get(header::CONTENT_LENGTH);
    let declared = declared.and_then(|value| value.to_str().ok()?.parse().ok());
    let bytes = response.body().size_hint().exact().or(declared);
    let kind = headers.get(header::CONTENT_TYPE);
    let kind = kind
        .and_then(|value| value.to_str().ok())
        .unwrap_or_default();
    let is_text = [
        "text/",
        "application/json",
        "application/jsonl",
        "application/vnd.vtk",
        "image/svg+xml",
        "application/vnd.signorini.view",
    ]
    .iter()
    .any(|start| kind.starts_with(start))
        || kind.contains("+json")
        || kind.contains("+xml");
    response.status() == StatusCode::OK
        && bytes.is_some_and(|bytes| bytes >= SMALLEST)
        && is_text
        && !headers.contains_key(header::CONTENT_ENCODING)
}

fn encoded(response: Response, coding: Coding, share: Share) -> Response {
    let (mut parts, body) = response.into_parts();
    let headers = &mut parts.headers;
    // of the other bytes
    headers.remove(header::CONTENT_LENGTH);
    headers.remove(header::ACCEPT_RANGES);
    for name in ["content-digest", "repr-digest"] {
        headers.remove(HeaderName::from_static(name));
    }
    // other bytes of the same content: what RFC 9110 has weak tags for
    if let Some(tag) = headers.get(header::ETAG)
        && !tag.as_bytes().starts_with(b"W/")
        && let Ok(weak) = HeaderValue::from_bytes(&[b"W/", tag.as_bytes()].concat())
    {
        headers.insert(header::ETAG, weak);
    }
    let name = HeaderValue::from_static(coding.name());
    headers.insert(header::CONTENT_ENCODING, name);
    Response::from_parts(parts, coding.encoded(body, share))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use axum::{Router, body::Body, middleware, routing::get};
    use tower::ServiceExt;

    use super::*;

    #[tokio::test]
    async fn an_answer_stays_as_it_is_where_there_is_no_room_for_an_encoder() {
        let limit = Limit::new(Coding::Gzip.encoder_bytes());
        let large = get(async || "x".repeat(20 << 10));
        let router = Router::new().route("/", large);
        let router = router.layer(middleware::from_fn_with_state(limit, compressed));
        let ask = async || {
            let request = Request::get("/").header(header::ACCEPT_ENCODING, "gzip");
            let request = request.body(Body::empty()).unwrap();
            router.clone().oneshot(request).await.unwrap()
        };
        let is_encoded =
            |answer: &Response| answer.headers().contains_key(header::CONTENT_ENCODING);
        let (first, second) = (ask().await, ask().await);
        assert!(is_encoded(&first) && !is_encoded(&second));
        assert_eq!(second.headers()[header::VARY], "Accept-Encoding");
        drop(first);
        assert!(is_encoded(&ask().await));
    }

    #[tokio::test]
    async fn an_answer_over_http_1_0_keeps_its_length() {
        let limit = Limit::new(1 << 20);
        let large = get(async || "x".repeat(20 << 10));
        let router = Router::new().route("/", large);
        let router = router.layer(middleware::from_fn_with_state(limit, compressed));
        for (version, encoded) in [(Version::HTTP_10, false), (Version::HTTP_11, true)] {
            let request = Request::get("/").version(version);
            let request = request.header(header::ACCEPT_ENCODING, "gzip");
            let request = request.body(Body::empty()).unwrap();
            let answer = router.clone().oneshot(request).await.unwrap();
            let found = answer.headers().contains_key(header::CONTENT_ENCODING);
            assert_eq!(found, encoded, "{version:?}");
            assert_eq!(answer.body().size_hint().exact().is_some(), !encoded);
        }
    }
}
