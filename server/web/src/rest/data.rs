//! Answers with data as files: entity tags, digests, ranges.

use std::ops::Range;

use axum::{
    body::{Body, Bytes},
    http::{HeaderName, HeaderValue, StatusCode, header},
    response::{IntoResponse, Response},
};
use base::{digest::hex, job::ResultAvailable};
use base64::{Engine, engine::general_purpose::STANDARD};
use service::{
    error::ApiError, formats::Format, parameters::Description, verbs::results::RESULT_AVAILABLE,
};
use sha2::{Digest, Sha256};

use super::{
    headers::{Tags, header as described, recommended_pattern, text},
    input::{Input, RawInput},
};

/// The input that says which part of a file is requested.
pub(super) const PART: PartHeaders = PartHeaders;

/// The headers that request a part of a file, or a file only if the client does not have it yet.
#[derive(Clone, Copy, Debug)]
pub(super) struct PartHeaders;

/// The requested part of a file, and the version of the file that the client has, as the headers say it.
#[derive(Debug, Default)]
pub(super) struct Part {
    known: Option<Tags>,
    range: Option<String>,
    if_range: Option<String>,
}

impl Part {
    /// The answer to a client that has the file with this entity tag already; `None` if it has not.
    pub(super) fn known(&self, tag: Option<&str>) -> Option<Response> {
        let tag = format!("\"{}\"", tag?);
        let known = self.known.as_ref()?.contain(&tag);
        known.then(|| {
            let tag = [(header::ETAG, tag), (header::VARY, "Accept".to_owned())];
            with(StatusCode::NOT_MODIFIED.into_response(), tag)
        })
    }
}

impl Input for PartHeaders {
    type Value = Part;

    fn descriptions(&self) -> Vec<Description> {
        vec![
            described(
                "If-None-Match",
                text(),
                "ETag of the file that the client has; 304 if it is still current",
            ),
            described(
                "Range",
                recommended_pattern("^bytes=([0-9]{1,6}-[0-9]{0,6}|-[0-9]{1,6})$"),
                "bytes=FIRST-LAST: a part of the file",
            ),
            described(
                "If-Range",
                text(),
                "ETag of the file that the part belongs to; the whole file is sent if it has changed",
            ),
        ]
    }

    fn extract(&self, raw: &RawInput<'_>) -> Result<Part, ApiError> {
        let text = |name: HeaderName| {
            let value = raw.headers.get(name)?.to_str().ok()?;
            Some(value.trim().to_owned())
        };
        Ok(Part {
            known: Tags::of(raw.headers, header::IF_NONE_MATCH.as_str()),
            range: text(header::RANGE),
            if_range: text(header::IF_RANGE),
        })
    }
}

/// The properties of a file that are known before its bytes are read.
pub(super) struct File {
    pub(super) format: Format,
    /// The name of the file without its extension.
    pub(super) name: String,
    pub(super) bytes: u64,
    /// The SHA-256 of the file.
    pub(super) digest: Vec<u8>,
    /// The entity tag, without its quotes; `None`: the SHA-256.
    pub(super) tag: Option<String>,
}

/// Answers with a file whose bytes are in memory, or with the requested part of it.
pub(super) fn whole(
    part: &Part,
    format: Format,
    name: String,
    bytes: impl Into<Bytes>,
) -> Result<Response, ApiError> {
    tagged(part, format, name, bytes, None)
}

/// Answers with a file whose bytes are in memory, and whose entity tag was known before they were made.
pub(super) fn tagged(
    part: &Part,
    format: Format,
    name: String,
    bytes: impl Into<Bytes>,
    tag: Option<String>,
) -> Result<Response, ApiError> {
    let bytes = bytes.into();
    let file = File {
        format,
        name,
        bytes: bytes.len() as u64,
        digest: Sha256::digest(&bytes).to_vec(),
        tag,
    };
    answer(part, &file, |range| {
        Body::from(bytes.slice(range.start as usize..range.end as usize))
    })
}

/// Answers with a file or a range of it, or with 304 if the client has it already. `body` returns the bytes of a range.
pub(super) fn answer(
    part: &Part,
    file: &File,
    body: impl FnOnce(Range<u64>) -> Body,
) -> Result<Response, ApiError> {
    let tag = file.tag.clone().unwrap_or_else(|| hex(&file.digest));
    let tag = format!("\"{tag}\"");
    let digest = format!("sha-256=:{}:", STANDARD.encode(&file.digest));
    let vary = "Accept".to_owned();
    let known = [
        (header::ETAG, tag.clone()),
        (header::VARY, vary),
        // of the whole file, whatever part of it is sent
        (HeaderName::from_static("repr-digest"), digest.clone()),
        (header::ACCEPT_RANGES, "bytes".to_owned()),
    ];
    if part.known.as_ref().is_some_and(|tags| tags.contain(&tag)) {
        return Ok(with(StatusCode::NOT_MODIFIED.into_response(), known));
    }
    let range = match select(part, &tag, file.bytes) {
        Selection::All => None,
        Selection::Part(range) => Some(range),
        Selection::Nothing => return Err(ApiError::RangeNotSatisfiable(file.bytes)),
    };
    let (status, content) = match &range {
        None => (
            StatusCode::OK,
            (HeaderName::from_static("content-digest"), digest),
        ),
        Some(Range { start, end }) => (
            StatusCode::PARTIAL_CONTENT,
            (
                header::CONTENT_RANGE,
                format!("bytes {start}-{}/{}", end - 1, file.bytes),
            ),
        ),
    };
    let range = range.unwrap_or(0..file.bytes);
    let length = range.end - range.start;
    // a boundary may have any name; that of a file must be valid on every system
    let plain = |c: char| {
        if c.is_ascii_alphanumeric() || "._-".contains(c) {
            c
        } else {
            '_'
        }
    };
    let name: String = file.name.chars().map(plain).collect();
    let disposition = format!("attachment; filename=\"{name}.{}\"", file.format.name());
    let response = with((status, body(range)).into_response(), known);
    Ok(with(
        response,
        [
            content,
            (header::CONTENT_TYPE, file.format.content_type()),
            (header::CONTENT_DISPOSITION, disposition),
            (header::CONTENT_LENGTH, length.to_string()),
        ],
    ))
}

/// Adds to an answer the header that says whether its result is partial or final.
pub(super) fn marked(response: impl IntoResponse, available: ResultAvailable) -> Response {
    let words: &str = available.into();
    let header = [(RESULT_AVAILABLE, words)];
    (header, response).into_response()
}

fn with<const N: usize>(mut response: Response, headers: [(HeaderName, String); N]) -> Response {
    for (name, value) in headers {
        if let Ok(value) = HeaderValue::from_str(&value) {
            response.headers_mut().insert(name, value);
        }
    }
    response
}

/// The part of a file that is sent.
#[derive(Debug, PartialEq, Eq)]
enum Selection {
    All,
    Part(Range<u64>),
    /// Nothing: the requested range begins after the end of the file.
    Nothing,
}

/// The part of a file of `length` bytes that a request selects; the whole file if the range was requested of another
/// version than `tag`. Several ranges, and invalid ones, select the whole file, as RFC 9110 specifies.
fn select(part: &Part, tag: &str, length: u64) -> Selection {
    if part.if_range.as_ref().is_some_and(|of| of != tag) {
        return Selection::All;
    }
    let range = part.range.as_deref();
    let Some(range) = range.and_then(|range| range.strip_prefix("bytes=")) else {
        return Selection::All;
    };
    let Some((first, last)) = range.split_once('-') else {
        return Selection::All;
    };
    let number = |text: &str| text.trim().parse::<u64>().ok();
    let (start, end) = match (number(first), number(last)) {
        (Some(start), Some(last)) if start <= last => (start, last.saturating_add(1)),
        (Some(start), None) if last.trim().is_empty() => (start, length),
        (None, Some(suffix)) if first.trim().is_empty() => {
            if suffix == 0 {
                return Selection::Nothing;
            }
            (length.saturating_sub(suffix), length)
        }
        _ => return Selection::All,
    };
    if start >= length {
        return Selection::Nothing;
    }
    Selection::Part(start..end.min(length))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn asked(range: &str) -> Selection {
        let range = Some(range.to_owned());
        let part = Part {
            range,
            ..Part::default()
        };
        select(&part, "\"t\"", 10)
    }

    #[test]
    fn ranges_are_read_as_the_rfc_specifies() {
        assert_eq!(asked("bytes=0-3"), Selection::Part(0..4));
        assert_eq!(asked("bytes=3-"), Selection::Part(3..10));
        assert_eq!(asked("bytes=-3"), Selection::Part(7..10));
        assert_eq!(asked("bytes=-30"), Selection::Part(0..10));
        assert_eq!(asked("bytes=8-99"), Selection::Part(8..10));
        assert_eq!(asked("bytes=10-"), Selection::Nothing);
        assert_eq!(asked("bytes=-0"), Selection::Nothing);
        for all in [
            "bytes=0-1,3-4",
            "bytes=5-2",
            "lines=0-1",
            "bytes=a-b",
            "bytes=-",
        ] {
            assert_eq!(asked(all), Selection::All, "{all}");
        }
    }

    #[test]
    fn a_range_of_another_version_is_not_mixed_with_this_one() {
        let asked = |of: &str| {
            let part = Part {
                range: Some("bytes=2-3".into()),
                if_range: Some(of.into()),
                known: None,
            };
            select(&part, "\"t\"", 10)
        };
        assert_eq!(asked("\"other\""), Selection::All);
        assert_eq!(asked("\"t\""), Selection::Part(2..4));
    }

    #[test]
    fn a_file_has_a_plain_name_whatever_the_boundary_is_called() {
        let name = "job_1.profile.a\"; b/\r\nñ".to_owned();
        let response = whole(&Part::default(), Format::Csv, name, Bytes::new()).unwrap();
        let headers = response.headers();
        assert_eq!(
            headers["content-disposition"],
            "attachment; filename=\"job_1.profile.a___b____.csv\""
        );
        assert_eq!(headers["content-type"], "text/csv; charset=utf-8");
    }
}
