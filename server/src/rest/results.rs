//! `/v1/jobs/{id}/result`, `/history`, `/profiles/{boundary}` and `/fields`.

use axum::{
    Json,
    body::Body,
    extract::{RawQuery, State},
    http::HeaderMap,
    response::Response,
};

use super::{
    Rest, data,
    request::{JobPath, Params, accepted, weight},
};
use crate::{
    error::ApiError,
    formats::{self, Format},
    verbs::{
        fields, history,
        profiles::{self, Points},
        results::{self, JobResult},
    },
    violations,
};

pub(super) async fn result(
    State(rest): State<Rest>,
    RawQuery(query): RawQuery,
    path: JobPath,
) -> Result<Json<JobResult>, ApiError> {
    Params::parse(query.as_deref(), &[])?;
    Ok(Json(results::result(&rest.service, path.id).await?))
}

pub(super) async fn history(
    State(rest): State<Rest>,
    RawQuery(query): RawQuery,
    headers: HeaderMap,
    path: JobPath,
) -> Result<Response, ApiError> {
    // without the first and the last row it would not be the history
    const POINTS: &str = "a whole number, 2 or more";
    let params = Params::parse(query.as_deref(), &["format", "max_points"])?;
    let format = choose(Format::OF_TABLES, params.one("format"), &headers)?;
    let most = params.number("max_points", 2..=i64::from(u32::MAX), POINTS)?;
    let most = most.and_then(|most| usize::try_from(most).ok());
    let rows = history::history(&rest.service, path.id, most).await?;
    let bytes = rest.service.work(move || formats::history(&rows, format));
    let bytes = bytes.await?.map_err(ApiError::internal)?;
    data::whole(&headers, format, format!("{}.history", path.id), bytes)
}

pub(super) async fn profile(
    State(rest): State<Rest>,
    RawQuery(query): RawQuery,
    headers: HeaderMap,
    path: JobPath,
) -> Result<Response, ApiError> {
    let params = Params::parse(query.as_deref(), &["format", "step", "points"])?;
    let format = choose(Format::OF_TABLES, params.one("format"), &headers)?;
    let step = params.one("step");
    let points = params.word("points", Points::parse, Points::EXPECTED)?;
    let points = points.unwrap_or(Points::Nodes);
    let profile = profiles::profile(&rest.service, path.id, &path.boundary, step, points).await?;
    let bytes = rest
        .service
        .work(move || formats::profile(&profile, format));
    let bytes = bytes.await?.map_err(ApiError::internal)?;
    let name = format!("{}.profile.{}", path.id, path.boundary);
    data::whole(&headers, format, name, bytes)
}

pub(super) async fn fields(
    State(rest): State<Rest>,
    RawQuery(query): RawQuery,
    headers: HeaderMap,
    path: JobPath,
) -> Result<Response, ApiError> {
    let params = Params::parse(query.as_deref(), &["format"])?;
    let format = choose(Format::OF_FIELDS, params.one("format"), &headers)?;
    let name = format!("{}.fields", path.id);
    if format != Format::Json {
        let bytes = fields::converted_fields(&rest.service, path.id, format).await?;
        return data::whole(&headers, format, name, bytes);
    }
    // as they are stored, so they are passed on
    let fields = fields::fields(&rest.service, path.id).await?;
    let file = data::File {
        format,
        name,
        bytes: fields.info.bytes,
        digest: fields.info.digest.clone(),
    };
    data::answer(&headers, &file, |range| {
        Body::from_stream(fields.bytes(&rest.service, range.start, range.end))
    })
}

/// The format to answer in: the parameter overrides the header, the first is the default.
fn choose(
    formats: &[Format],
    parameter: Option<&str>,
    headers: &HeaderMap,
) -> Result<Format, ApiError> {
    let names: Vec<&str> = formats.iter().map(|format| format.name()).collect();
    let none = |got: &str| ApiError::NotAcceptable {
        got: violations::name(got),
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
    // Each range with its weight; the best wanted format wins, ours first among equals.
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

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

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
