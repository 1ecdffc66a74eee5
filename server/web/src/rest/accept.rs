//! Content negotiation: the format of an answer, chosen by the header `Accept` or the parameter `format`.

use axum::http::{HeaderMap, header};
use serde_json::json;
use service::{
    error::ApiError,
    formats::Format,
    parameters::{Description, Location},
    violations,
};

use super::input::{Input, RawInput};

/// An input that chooses one of these formats: by the parameter `format`, otherwise by `Accept`, otherwise the first
/// format.
#[derive(Clone, Copy, Debug)]
pub(super) struct FormatOf(pub(super) &'static [Format]);

/// The name of the parameter that chooses a format.
const FORMAT: &str = "format";

impl Input for FormatOf {
    type Value = Format;

    fn descriptions(&self) -> Vec<Description> {
        let names: Vec<&str> = self.0.iter().map(|format| format.name()).collect();
        vec![Description {
            location: Location::Query,
            kind: "",
            name: FORMAT,
            schema: json!({ "type": "string", "enum": names }),
            meaning: "Format of the data; takes precedence over Accept",
            repeatable: false,
        }]
    }

    fn extract(&self, raw: &RawInput<'_>) -> Result<Format, ApiError> {
        choose(self.0, raw.one(FORMAT), raw.headers)
    }
}

/// Chooses the format of an answer: the parameter takes precedence over `Accept`, and the first format is the default.
fn choose(
    formats: &[Format],
    parameter: Option<&str>,
    headers: &HeaderMap,
) -> Result<Format, ApiError> {
    let names: Vec<&str> = formats.iter().map(|format| format.name()).collect();
    let none = |got: &str| ApiError::NotAcceptable {
        got: violations::quoted(got),
        available: names.join(", "),
    };
    if let Some(wanted) = parameter {
        let named = formats.iter().find(|format| format.name() == wanted);
        return named.copied().ok_or_else(|| none(wanted));
    }
    let accept = accepted(headers);
    if accept.is_empty() {
        return formats.first().copied().ok_or_else(|| none("anything"));
    }
    // the format with the largest weight; of equal ones the first in our list
    let mut best: Option<(f32, Format)> = None;
    for format in formats {
        let (weight, ..) = weight(&accept, format.media_type());
        if weight > best.map_or(0.0, |(weight, _)| weight) {
            best = Some((weight, *format));
        }
    }
    best.map(|(_, format)| format)
        .ok_or_else(|| none(&accept.join(", ")))
}

/// The media ranges in `Accept`.
pub(super) fn accepted(headers: &HeaderMap) -> Vec<&str> {
    let values = headers.get_all(header::ACCEPT).iter();
    values
        .filter_map(|value| value.to_str().ok())
        .flat_map(|value| value.split(','))
        .collect()
}

/// How much a media type is preferred by these media ranges: the weight of the most specific range that covers it; how
/// specific that range is; and the range's place in the list, as a negative number.
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

/// Whether the client prefers one of these media types to JSON.
pub(super) fn prefers(headers: &HeaderMap, media: &[&str]) -> bool {
    let accepted = accepted(headers);
    let json = weight(&accepted, "application/json");
    let mut weights = media.iter().map(|media| weight(&accepted, media));
    weights.any(|weight| weight.0 > 0.0 && weight > json)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_client_prefers_a_format_to_json_by_its_weights() {
        let prefers = |accept: &str| {
            let mut headers = HeaderMap::new();
            headers.insert("accept", accept.parse().unwrap());
            prefers(&headers, &["text/html"])
        };
        for html in [
            "text/html",
            "text/html,application/xhtml+xml,*/*;q=0.8",
            "text/html, application/json",
            "*/*, text/html",
        ] {
            assert!(prefers(html), "{html}");
        }
        for json in [
            "*/*",
            "application/json, text/html",
            "text/html;q=0.1, application/json",
            "text/html;q=0, */*",
            "image/png",
        ] {
            assert!(!prefers(json), "{json}");
        }
    }

    fn chosen(parameter: Option<&str>, accept: Option<&str>) -> Option<&'static str> {
        let mut headers = HeaderMap::new();
        if let Some(accept) = accept {
            headers.insert("accept", accept.parse().unwrap());
        }
        choose(Format::OF_TABLES, parameter, &headers)
            .ok()
            .map(Format::name)
    }

    #[test]
    fn the_parameter_overrides_the_header_and_json_is_the_default() {
        assert_eq!(chosen(None, None), Some("json"));
        assert_eq!(chosen(None, Some("text/csv")), Some("csv"));
        assert_eq!(chosen(Some("json"), Some("text/csv")), Some("json"));
        assert_eq!(chosen(None, Some("*/*")), Some("json"));
        assert_eq!(
            chosen(None, Some("text/*, application/json;q=0.5")),
            Some("csv")
        );
        assert_eq!(
            chosen(None, Some("text/*;q=0.1, application/x-npz")),
            Some("npz")
        );
        assert_eq!(chosen(None, Some("application/json;q=0, */*")), Some("csv"));
        assert_eq!(chosen(None, Some("image/png")), None);
        assert_eq!(chosen(Some("xml"), None), None);
        assert_eq!(chosen(Some("vtu"), None), None);
    }
}
