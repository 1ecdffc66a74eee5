//! How requests are read: strictly.

use std::{collections::BTreeMap, time::Duration};

use axum::{
    body::{Body, BodyDataStream},
    extract::{FromRequestParts, Path},
    http::{HeaderMap, header, request::Parts},
};
use futures_util::StreamExt;

use crate::{error::ApiError, job::JobId, time::Time, verbs::watch::MAX_WAIT_S, violations};

/// A job's name in a path, and what follows it. An ill-formed name is a job that does not exist.
pub(super) struct JobPath {
    pub(super) id: JobId,
    pub(super) boundary: String,
    pub(super) plot: String,
}

impl<S: Send + Sync> FromRequestParts<S> for JobPath {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, ApiError> {
        let path = Path::<BTreeMap<String, String>>::from_request_parts(parts, state).await;
        let Ok(Path(mut path)) = path else {
            return Err(ApiError::NotFound("the path is not well formed".into()));
        };
        let id = path.remove("id").unwrap_or_default();
        let boundary = path.remove("boundary").unwrap_or_default();
        let plot = path.remove("plot").unwrap_or_default();
        match JobId::parse(&id) {
            Some(id) => Ok(JobPath { id, boundary, plot }),
            None => Err(ApiError::NotFound(format!(
                "there is no job {:?}: ids are job_ and a UUID in lower case",
                violations::name(&id)
            ))),
        }
    }
}

/// A text in a path; one that is not text names nothing.
pub(super) struct TextPath(pub(super) String);

impl<S: Send + Sync> FromRequestParts<S> for TextPath {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, ApiError> {
        match Path::<String>::from_request_parts(parts, state).await {
            Ok(Path(text)) => Ok(TextPath(text)),
            Err(_) => Err(ApiError::NotFound("the path is not well formed".into())),
        }
    }
}

/// Parameters `label.{key}` stand for any key.
pub(super) const ANY_LABEL: &str = "label.{key}";
const LABEL: &str = "label.";
/// Parameters that may come several times.
const REPEATABLE: [&str; 2] = ["status", ANY_LABEL];

/// The parameters of a query, each of them known.
pub(super) struct Params(Vec<(String, String)>);

impl Params {
    /// Reads a query; a name that is not among `known` is refused, since it was meant to do something, and so
    /// is a second value, since the first was.
    pub(super) fn parse(query: Option<&str>, known: &[&'static str]) -> Result<Params, ApiError> {
        let pairs: Vec<(String, String)> =
            form_urlencoded::parse(query.unwrap_or_default().as_bytes())
                .into_owned()
                .collect();
        for (n, (name, value)) in pairs.iter().enumerate() {
            let label = name.starts_with(LABEL) && known.contains(&ANY_LABEL);
            let own = if label { ANY_LABEL } else { name };
            let Some(known) = known.iter().find(|known| **known == own) else {
                let known = match known {
                    [] => "none".into(),
                    known => known.join(", "),
                };
                let name = name.clone();
                return Err(ApiError::UnknownParameter { name, known });
            };
            let again = pairs[..n].iter().any(|(other, _)| other == name);
            if again && !REPEATABLE.contains(known) {
                return Err(ApiError::BadParameter {
                    name: known,
                    got: format!("a second one, {value}"),
                    expected: "one value",
                });
            }
        }
        Ok(Params(pairs))
    }

    /// The value of that name.
    pub(super) fn one(&self, name: &str) -> Option<&str> {
        self.all(name).next()
    }

    /// All values of that name.
    pub(super) fn all(&self, name: &str) -> impl Iterator<Item = &str> {
        self.0
            .iter()
            .filter(move |(key, _)| key == name)
            .map(|(_, value)| value.as_str())
    }

    /// Keys and values of the parameters `label.{key}`.
    pub(super) fn labels(&self) -> impl Iterator<Item = (String, String)> {
        self.0.iter().filter_map(|(name, value)| {
            let key = name.strip_prefix(LABEL)?;
            Some((key.to_owned(), value.clone()))
        })
    }

    /// A point in time.
    pub(super) fn time(&self, name: &'static str) -> Result<Option<Time>, ApiError> {
        let Some(text) = self.one(name) else {
            return Ok(None);
        };
        let time = Time::parse(text);
        time.map(Some).ok_or_else(|| ApiError::BadParameter {
            name,
            got: text.into(),
            expected: "a time as 2026-01-31T12:00:00Z (RFC 3339)",
        })
    }

    /// Seconds that a request may wait.
    pub(super) fn wait_s(&self, name: &'static str) -> Result<Option<f64>, ApiError> {
        let Some(text) = self.one(name) else {
            return Ok(None);
        };
        let seconds = text.parse::<f64>().ok();
        let seconds = seconds.filter(|seconds| (0.0..=MAX_WAIT_S).contains(seconds));
        seconds.map(Some).ok_or_else(|| ApiError::BadParameter {
            name,
            got: text.into(),
            expected: "0 … 60 seconds",
        })
    }

    /// One of several words; none when nothing was said.
    pub(super) fn word<T>(
        &self,
        name: &'static str,
        read: impl Fn(&str) -> Option<T>,
        expected: &'static str,
    ) -> Result<Option<T>, ApiError> {
        let Some(text) = self.one(name) else {
            return Ok(None);
        };
        read(text).map(Some).ok_or_else(|| ApiError::BadParameter {
            name,
            got: text.into(),
            expected,
        })
    }

    /// A number, within bounds.
    pub(super) fn number(
        &self,
        name: &'static str,
        range: std::ops::RangeInclusive<i64>,
        expected: &'static str,
    ) -> Result<Option<i64>, ApiError> {
        let Some(text) = self.one(name) else {
            return Ok(None);
        };
        match text.parse() {
            Ok(number) if range.contains(&number) => Ok(Some(number)),
            _ => Err(ApiError::BadParameter {
                name,
                got: text.into(),
                expected,
            }),
        }
    }
}

/// The versions that a header of entity tags names; `None`: the header is absent. Tags that are not ours
/// name none.
pub(super) fn versions(headers: &HeaderMap, name: header::HeaderName) -> Option<Tags> {
    let mut values = headers.get_all(name).iter().peekable();
    values.peek()?;
    let tags: Vec<String> = values
        .filter_map(|value| value.to_str().ok())
        .flat_map(|value| value.split(','))
        .map(|tag| tag.trim().to_owned())
        .collect();
    Some(Tags(tags))
}

/// Entity tags of a conditional request.
#[derive(Debug)]
pub(super) struct Tags(Vec<String>);

impl Tags {
    /// Whether this tag, with its quotes, is among them, as `If-None-Match` compares: weakly.
    pub(super) fn contain(&self, tag: &str) -> bool {
        let same = |own: &String| own == "*" || own.strip_prefix("W/").unwrap_or(own) == tag;
        self.0.iter().any(same)
    }

    /// The same as `If-Match` compares: strongly.
    pub(super) fn contain_strongly(&self, tag: &str) -> bool {
        self.0.iter().any(|own| own == tag)
    }

    /// Whether anything matches.
    pub(super) fn any(&self) -> bool {
        self.0.iter().any(|own| own == "*")
    }

    /// The first number among them.
    pub(super) fn version(&self) -> Option<i64> {
        let number = |tag: &String| {
            let tag = tag.strip_prefix("W/").unwrap_or(tag);
            tag.trim_matches('"').parse().ok()
        };
        self.0.iter().find_map(number)
    }
}

/// The client's key for a request that it may repeat.
pub(super) fn idempotency_key(headers: &HeaderMap) -> Result<Option<String>, ApiError> {
    let Some(value) = headers.get("idempotency-key") else {
        return Ok(None);
    };
    let text = value.to_str().map_err(|_| ApiError::BadParameter {
        name: "Idempotency-Key",
        got: String::from_utf8_lossy(value.as_bytes()).into_owned(),
        expected: "printable ASCII",
    })?;
    Ok(Some(text.to_owned()))
}

/// The media types that the client takes, as it says.
pub(super) fn accepted(headers: &HeaderMap) -> Vec<&str> {
    let values = headers.get_all(header::ACCEPT).iter();
    values
        .filter_map(|value| value.to_str().ok())
        .flat_map(|value| value.split(','))
        .collect()
}

/// How much a media type is wanted: the weight of the most specific range that covers it; how specific that is;
/// and where it stands, the first one highest.
pub(super) fn weight(accepted: &[&str], media: &str) -> (f32, u8, isize) {
    let group = media.split('/').next().unwrap_or_default();
    let mut found = (0.0, 0, 0);
    for (place, range) in (0..).zip(accepted) {
        let mut parts = range.split(';').map(str::trim);
        let name = parts.next().unwrap_or_default().to_ascii_lowercase();
        let q = parts
            .find_map(|part| part.strip_prefix("q=")?.parse().ok())
            .unwrap_or(1.0);
        let specific = match name.split_once('/') {
            _ if name == media => 3,
            Some((start, "*")) if start == group => 2,
            Some(("*", "*")) => 1,
            _ => continue,
        };
        if specific >= found.1 {
            found = (q, specific, -place);
        }
    }
    found
}

/// Whether the client wants one of these media types rather than JSON.
pub(super) fn wants(headers: &HeaderMap, media: &[&str]) -> bool {
    let accepted = accepted(headers);
    let json = weight(&accepted, "application/json");
    let mut weights = media.iter().map(|media| weight(&accepted, media));
    weights.any(|weight| weight.0 > 0.0 && weight > json)
}

/// The body as text, if it says that it is JSON and is not too large.
pub(super) async fn json_text(
    headers: &HeaderMap,
    body: Body,
    limit_bytes: usize,
) -> Result<String, ApiError> {
    let content_type = headers
        .get(header::CONTENT_TYPE)
        .and_then(|value| value.to_str().ok())
        .unwrap_or("nothing");
    let essence = content_type
        .split(';')
        .next()
        .unwrap_or_default()
        .trim()
        .to_ascii_lowercase();
    // a patch format has a meaning of its own, which is not ours
    let json = essence.starts_with("application/")
        && essence.ends_with("+json")
        && !essence.ends_with("-patch+json");
    if essence != "application/json" && !json {
        return Err(ApiError::UnsupportedMedia(content_type.into()));
    }
    if let Some(coding) = headers.get(header::CONTENT_ENCODING)
        && coding.as_bytes() != b"identity"
    {
        let coding = String::from_utf8_lossy(coding.as_bytes());
        return Err(ApiError::UnsupportedMedia(format!(
            "a body coded as {coding}"
        )));
    }
    let mut pieces = body.into_data_stream();
    let length = declared_length(headers);
    let mut bytes = Vec::new();
    let mut too_large = length.is_some_and(|length| length > limit_bytes);
    while !too_large && let Some(piece) = pieces.next().await {
        let piece = piece
            .map_err(|error| ApiError::MalformedJson(format!("the body broke off: {error}")))?;
        too_large = bytes.len() + piece.len() > limit_bytes;
        if !too_large {
            bytes.extend_from_slice(&piece);
        }
    }
    if too_large {
        tokio::spawn(discard(pieces));
        return Err(ApiError::PayloadTooLarge { limit_bytes });
    }
    String::from_utf8(bytes).map_err(|error| ApiError::MalformedJson(error.to_string()))
}

/// How long the body says that it is.
pub(super) fn declared_length(headers: &HeaderMap) -> Option<usize> {
    let value = headers.get(header::CONTENT_LENGTH)?;
    value.to_str().ok()?.parse().ok()
}

/// Takes in, for a while, what nobody reads: many clients look at the answer only after they have
/// sent everything, and see a broken connection if we hang up before.
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
    let _ = tokio::time::timeout(LONGEST, all).await; // late or not, it is over
}

/// The `wait` of a `Prefer` header (RFC 7240) in whole seconds, if there is one that makes sense.
pub(super) fn preferred_wait_s(headers: &HeaderMap) -> Option<u64> {
    headers
        .get_all("prefer")
        .iter()
        .filter_map(|value| value.to_str().ok())
        .flat_map(|value| value.split([',', ';']))
        .find_map(|preference| {
            let (name, value) = preference.split_once('=')?;
            if !name.trim().eq_ignore_ascii_case("wait") {
                return None;
            }
            value.trim().trim_matches('"').parse().ok()
        })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_preference_for_waiting_is_found_among_others() {
        let mut headers = HeaderMap::new();
        assert_eq!(preferred_wait_s(&headers), None);
        headers.insert("prefer", "respond-async, wait=10".parse().unwrap());
        assert_eq!(preferred_wait_s(&headers), Some(10));
        headers.insert("prefer", "wait=soon".parse().unwrap());
        assert_eq!(preferred_wait_s(&headers), None);
    }

    #[test]
    fn what_a_client_wants_rather_than_json_goes_by_its_weights() {
        let wants = |accept: &str| {
            let mut headers = HeaderMap::new();
            headers.insert("accept", accept.parse().unwrap());
            wants(&headers, &["text/html"])
        };
        for html in [
            "text/html",
            "text/html,application/xhtml+xml,*/*;q=0.8",
            "text/html, application/json",
            "*/*, text/html",
        ] {
            assert!(wants(html), "{html}");
        }
        for json in [
            "*/*",
            "application/json, text/html",
            "text/html;q=0.1, application/json",
            "text/html;q=0, */*",
            "image/png",
        ] {
            assert!(!wants(json), "{json}");
        }
    }

    #[test]
    fn a_parameter_that_nobody_knows_is_refused() {
        assert!(Params::parse(Some("status=queued&color=red"), &["status"]).is_err());
        assert!(Params::parse(Some("name=a&name=b"), &["name"]).is_err());
        assert!(Params::parse(Some("label.a=1&label.a=2"), &[ANY_LABEL]).is_ok());
        assert!(Params::parse(Some("status=queued&status=failed"), &["status"]).is_ok());
        assert_eq!(
            Params::parse(Some("status=queued"), &["status"])
                .unwrap()
                .one("status"),
            Some("queued")
        );
    }
}
