//! Reads bodies of requests as bytes and as text.

use std::time::Duration;

use axum::{
    body::{Body, BodyDataStream},
    http::{HeaderMap, header},
};
use futures_util::StreamExt;
use service::{error::ApiError, transfer::Received};

use super::coding;

/// The content type of a request's body, as its headers declare it.
pub(super) fn content_type(headers: &HeaderMap) -> &str {
    let value = headers.get(header::CONTENT_TYPE);
    value
        .and_then(|value| value.to_str().ok())
        .unwrap_or("nothing")
}

/// The content type without its parameters, in lower case.
fn essence(content_type: &str) -> String {
    let essence = content_type.split(';').next().unwrap_or_default();
    essence.trim().to_ascii_lowercase()
}

/// Whether the headers declare the body as a merge patch (RFC 7396).
pub(super) fn is_merge_patch(headers: &HeaderMap) -> bool {
    essence(content_type(headers)) == "application/merge-patch+json"
}

/// Checks that the headers declare the body as JSON, and returns them.
pub(super) fn is_json(headers: &HeaderMap) -> Result<&HeaderMap, ApiError> {
    let content_type = content_type(headers);
    let essence = essence(content_type);
    // a patch format has another meaning
    let json = essence.starts_with("application/")
        && essence.ends_with("+json")
        && !essence.ends_with("-patch+json");
    if essence != "application/json" && !json {
        return Err(ApiError::UnsupportedMedia {
            expected: "application/json",
            got: content_type.into(),
        });
    }
    Ok(headers)
}

/// Reads a body as text; an error if it is too large, alone or together with the bodies of other requests.
pub(super) async fn json_text(
    headers: &HeaderMap,
    body: Body,
    limit_bytes: usize,
    received: &Received,
) -> Result<String, ApiError> {
    let mut body = body.into_data_stream();
    let text = text(headers, &mut body, limit_bytes, received).await;
    if text.is_err() {
        tokio::spawn(discard(body));
    }
    text
}

async fn text(
    headers: &HeaderMap,
    body: &mut BodyDataStream,
    limit_bytes: usize,
    received: &Received,
) -> Result<String, ApiError> {
    let too_large = ApiError::PayloadTooLarge { limit_bytes };
    let mut pieces = coding::decoded(headers, body, received, coding::FREE_COLLECTED)?;
    if declared_length(headers).is_some_and(|length| length > limit_bytes) {
        return Err(too_large);
    }
    let mut bytes = Vec::new();
    while let Some(piece) = pieces.next().await {
        let piece = piece?;
        if bytes.len() + piece.len() > limit_bytes {
            return Err(too_large);
        }
        received.count(piece.len())?;
        // twice as much as before, as usual, but never more than can be needed
        if bytes.capacity() < bytes.len() + piece.len() {
            let wanted = (2 * bytes.len()).clamp(bytes.len() + piece.len(), limit_bytes);
            bytes.reserve_exact(wanted - bytes.len());
        }
        bytes.extend_from_slice(&piece);
        // what is decoded may be there at once, and others have their turn
        tokio::task::consume_budget().await;
    }
    // what some clients of Windows write before a text
    let mut mark = [0; 3];
    if bytes.starts_with(files::BYTE_ORDER_MARK.encode_utf8(&mut mark).as_bytes()) {
        bytes.drain(..mark.len());
    }
    String::from_utf8(bytes).map_err(|error| ApiError::MalformedJson(error.to_string()))
}

/// The length of the body that the headers declare.
pub(super) fn declared_length(headers: &HeaderMap) -> Option<usize> {
    let value = headers.get(header::CONTENT_LENGTH)?;
    value.to_str().ok()?.parse().ok()
}

/// Reads the rest of a refused body for a limited time, and drops it: many clients read the answer only after they have
/// sent everything, and would see a broken connection if the server closed it earlier.
pub(super) async fn discard(mut pieces: BodyDataStream) {
    const MOST_BYTES: usize = 256 << 20;
    const LONGEST: Duration = Duration::from_secs(10);
    let all = async {
        let mut bytes = 0;
        while let Some(Ok(piece)) = pieces.next().await {
            bytes += piece.len();
            if bytes > MOST_BYTES {
                break;
            }
        }
    };
    let _ = tokio::time::timeout(LONGEST, all).await; // complete or not, reading ends here
}
