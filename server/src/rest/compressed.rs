//! Answers as gzip, where the client takes it and the answer is large text. Streams of events are not compressed, nor is what
//! is compressed already; a range is one of the bytes as they are.

use std::io::{self, Write};

use axum::{
    body::{Body, BodyDataStream, Bytes, HttpBody},
    extract::Request,
    http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode, header},
    middleware::Next,
    response::Response,
};
use flate2::{Compression, write::GzEncoder};
use futures_util::{Stream, StreamExt};

/// Smaller answers are sent in a few packets anyway; jobs are among them, whose entity tags stay strong.
const SMALLEST: u64 = 16 << 10;
/// Pieces in which it is compressed.
const PIECE_BYTES: usize = 32 << 10;

/// Compresses the answer if it should be.
pub(super) async fn compressed(request: Request, next: Next) -> Response {
    let wanted = takes_gzip(request.headers());
    let head = request.method() == Method::HEAD;
    let mut response = next.run(request).await;
    if !is_worth_it(&response) {
        return response;
    }
    response
        .headers_mut()
        .append(header::VARY, HeaderValue::from_static("Accept-Encoding"));
    match wanted && !head {
        true => gzip(response),
        false => response,
    }
}

/// Whether gzip is named, or any encoding, and not with the weight 0 (RFC 9110, 12.5.3).
fn takes_gzip(headers: &HeaderMap) -> bool {
    let values = headers.get_all(header::ACCEPT_ENCODING).iter();
    let mut any = false;
    for item in values
        .filter_map(|value| value.to_str().ok())
        .flat_map(|text| text.split(','))
    {
        let mut parts = item.split(';').map(str::trim);
        let name = parts.next().unwrap_or_default();
        let refused = parts.any(|part| {
            let weight = part.strip_prefix("q=").or(part.strip_prefix("Q="));
            weight.is_some_and(|weight| weight.parse::<f32>().is_ok_and(|weight| weight <= 0.0))
        });
        match name {
            _ if name.eq_ignore_ascii_case("gzip") || name.eq_ignore_ascii_case("x-gzip") => {
                return !refused;
            }
            "*" => any = !refused,
            _ => {}
        }
    }
    any
}

/// Whether it is large, text, complete and of known length, which streams of events are not.
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

fn gzip(response: Response) -> Response {
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
    headers.insert(header::CONTENT_ENCODING, HeaderValue::from_static("gzip"));
    let body = Body::from_stream(pieces(body.into_data_stream()));
    Response::from_parts(parts, body)
}

/// The same as gzip. By hand and not by tower-http's layer, which answers 406 after the handler has run, and leaves entity
/// tags strong.
fn pieces(mut bytes: BodyDataStream) -> impl Stream<Item = io::Result<Bytes>> + Send {
    async_stream::try_stream! {
        let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
        while let Some(piece) = bytes.next().await {
            let piece = piece.map_err(io::Error::other)?;
            // no more at once, so that others get their turn
            for part in piece.chunks(PIECE_BYTES) {
                encoder.write_all(part)?;
                let made = std::mem::take(encoder.get_mut());
                match made.is_empty() {
                    true => tokio::task::yield_now().await,
                    false => yield Bytes::from(made),
                }
            }
        }
        yield Bytes::from(encoder.finish()?);
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn gzip_is_taken_as_the_rfc_specifies() {
        let takes = |text: &str| {
            let mut headers = HeaderMap::new();
            headers.insert(header::ACCEPT_ENCODING, text.parse().unwrap());
            takes_gzip(&headers)
        };
        for yes in [
            "gzip",
            "br, gzip;q=0.5",
            "GZIP",
            "*",
            "identity;q=0, *",
            "br;q=1,*;q=0.1",
        ] {
            assert!(takes(yes), "{yes}");
        }
        for no in ["", "br", "identity", "gzip;q=0", "gzip;q=0.0, *", "*;q=0"] {
            assert!(!takes(no), "{no}");
        }
        assert!(!takes_gzip(&HeaderMap::new()));
    }
}
