//! Headers of requests: parameters, and the conditions and preferences of HTTP.

use axum::http::HeaderMap;
use base::values::Values;
use serde_json::{Value, json};
use service::{
    error::ApiError,
    parameters::{Description, Location, Parameter},
    verbs::watch::MAX_WAIT_S,
    violations,
};

use super::input::{Input, RawInput};

/// An input that reads a parameter from a header.
#[derive(Clone, Copy, Debug)]
pub(super) struct Header<V>(pub(super) Parameter<V>);

impl<V: Values> Input for Header<V> {
    type Value = Option<V::Value>;

    fn descriptions(&self) -> Vec<Description> {
        let Parameter {
            name,
            meaning,
            values,
        } = &self.0;
        vec![header(name, values.schema(), meaning)]
    }

    fn extract(&self, raw: &RawInput<'_>) -> Result<Option<V::Value>, ApiError> {
        let name = self.0.name;
        let Some(value) = raw.headers.get(name) else {
            return Ok(None);
        };
        let unreadable = |_| ApiError::BadParameter {
            name,
            got: violations::quoted(&String::from_utf8_lossy(value.as_bytes())),
            expected: "printable ASCII".into(),
        };
        let text = value.to_str().map_err(unreadable)?;
        self.0.read(text.trim()).map(Some)
    }
}

/// Describes a header of a request or of an answer.
pub(super) fn header(name: &'static str, schema: Value, meaning: &'static str) -> Description {
    Description {
        location: Location::Header,
        kind: "",
        name,
        schema,
        meaning,
        repeatable: false,
    }
}

/// The schema of any text.
pub(super) fn text() -> Value {
    json!({ "type": "string" })
}

/// The schema of a text for which a pattern is recommended: preferences and ranges in another form are ignored, not
/// refused.
pub(super) fn recommended_pattern(pattern: &str) -> Value {
    json!({ "type": "string", "anyOf": [{ "pattern": pattern }, {}] })
}

/// The header of a request for a job only if the job has changed.
pub(super) const IF_NONE_MATCH: Condition = Condition {
    name: "If-None-Match",
    meaning: "ETag that the client has; 304 if it is still current",
};

/// The header of a change that is made only if the job has not changed before.
pub(super) const IF_MATCH: Condition = Condition {
    name: "If-Match",
    meaning: "ETag of the job; the change is made only if it is still current",
};

/// The entity tag of a version of a job or sweep. It is weak: the version counts changes of the status and edits, so
/// that two answers with the same tag may differ in progress.
pub(super) fn version_tag(version: i64) -> String {
    format!("W/\"{version}\"")
}

/// An input that reads a header of entity tags, which is a condition of the request.
#[derive(Clone, Copy, Debug)]
pub(super) struct Condition {
    name: &'static str,
    meaning: &'static str,
}

impl Input for Condition {
    type Value = Option<Tags>;

    fn descriptions(&self) -> Vec<Description> {
        vec![header(self.name, text(), self.meaning)]
    }

    fn extract(&self, raw: &RawInput<'_>) -> Result<Option<Tags>, ApiError> {
        Ok(Tags::of(raw.headers, self.name))
    }
}

/// The entity tags of a conditional request; tags in another form match nothing.
#[derive(Debug)]
pub(super) struct Tags(Vec<String>);

impl Tags {
    /// Reads the tags of the header `name`; `None` if the header is absent.
    pub(super) fn of(headers: &HeaderMap, name: &str) -> Option<Tags> {
        headers.get(name)?;
        let values = headers.get_all(name).iter();
        let tags = values
            .filter_map(|value| value.to_str().ok())
            .flat_map(|value| value.split(','))
            .map(|tag| tag.trim().to_owned());
        Some(Tags(tags.collect()))
    }

    /// Whether `tag` is among these tags, compared weakly as for `If-None-Match`.
    pub(super) fn contain(&self, tag: &str) -> bool {
        let same = |own: &String| own == "*" || opaque(own) == opaque(tag);
        self.0.iter().any(same)
    }

    /// The versions in these tags; `None`: all versions. By the RFC `If-Match` compares strongly, so that the weak tag
    /// of a job would match nothing; versions are compared instead, since each change of a job makes a new version.
    pub(super) fn versions(&self) -> Option<Vec<i64>> {
        let any = self.0.iter().any(|tag| tag == "*");
        (!any).then(|| self.0.iter().filter_map(|tag| number(tag)).collect())
    }

    /// The first version in these tags.
    pub(super) fn version(&self) -> Option<i64> {
        self.0.iter().find_map(|tag| number(tag))
    }
}

/// The tag in its quotes, without the mark of a weak tag.
fn opaque(tag: &str) -> &str {
    tag.strip_prefix("W/").unwrap_or(tag)
}

fn number(tag: &str) -> Option<i64> {
    opaque(tag)
        .strip_prefix('"')?
        .strip_suffix('"')?
        .parse()
        .ok()
}

/// The input that reads for how long the client prefers to wait for the end of a submitted job, in whole seconds (RFC
/// 7240).
pub(super) const PREFER: PreferWait = PreferWait;

/// An input that reads the `wait` of a `Prefer` header.
#[derive(Clone, Copy, Debug)]
pub(super) struct PreferWait;

impl Input for PreferWait {
    /// The seconds to wait, at most the longest wait allowed.
    type Value = Option<u64>;

    fn descriptions(&self) -> Vec<Description> {
        vec![header(
            "Prefer",
            recommended_pattern("^wait=([0-9]|[1-5][0-9]|60)$"),
            "wait=0…60: answer with the terminal job if it ends within that many seconds",
        )]
    }

    fn extract(&self, raw: &RawInput<'_>) -> Result<Option<u64>, ApiError> {
        let wait_s = preferred_wait_s(raw.headers);
        Ok(wait_s.map(|seconds| seconds.min(MAX_WAIT_S as u64)))
    }
}

/// The first valid `wait` in the `Prefer` headers, in seconds.
fn preferred_wait_s(headers: &HeaderMap) -> Option<u64> {
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
}
