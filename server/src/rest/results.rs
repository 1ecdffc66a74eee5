//! `/v1/jobs/{id}/result`, `/profiles/{boundary}` and `/fields`.

use std::fmt::Write;

use axum::{
    Json,
    body::Body,
    extract::{RawQuery, State},
    http::{HeaderMap, StatusCode, header},
    response::{IntoResponse, Response},
};
use serde::Serialize;
use solver::solution::{ContactProfile, NodeState};

use super::{
    Rest,
    reply::json_body,
    request::{JobPath, Params},
};
use crate::{error::ApiError, run::Summary, verbs::results};

/// The scalars of a result, whole and by load step.
#[derive(Serialize)]
pub(super) struct Found {
    summary: Summary,
    steps: Vec<results::StepResult>,
}

pub(super) async fn result(
    State(rest): State<Rest>,
    RawQuery(query): RawQuery,
    path: JobPath,
) -> Result<Json<Found>, ApiError> {
    Params::parse(query.as_deref(), &[])?;
    let (summary, steps) = results::summary(&rest.service, path.id).await?;
    Ok(Json(Found { summary, steps }))
}

pub(super) async fn profile(
    State(rest): State<Rest>,
    RawQuery(query): RawQuery,
    headers: HeaderMap,
    path: JobPath,
) -> Result<Response, ApiError> {
    let params = Params::parse(query.as_deref(), &["format", "step"])?;
    let formats = [("json", "application/json"), ("csv", "text/csv")];
    let format = choose(&formats, "json, csv", params.one("format"), &headers)?;
    let step = params.one("step");
    let profile = results::profile(&rest.service, path.id, &path.boundary, step).await?;
    Ok(match format {
        "csv" => (
            [(header::CONTENT_TYPE, "text/csv; charset=utf-8")],
            csv(&profile),
        )
            .into_response(),
        _ => Json(profile).into_response(),
    })
}

pub(super) async fn fields(
    State(rest): State<Rest>,
    RawQuery(query): RawQuery,
    headers: HeaderMap,
    path: JobPath,
) -> Result<Response, ApiError> {
    let params = Params::parse(query.as_deref(), &["format"])?;
    choose(
        &[("json", "application/json")],
        "json",
        params.one("format"),
        &headers,
    )?;
    let pieces = results::fields(&rest.service, path.id).await?;
    Ok(json_body(StatusCode::OK, Body::from_stream(pieces)))
}

/// The format to answer in: the parameter overrides the header, the first is the default.
fn choose(
    formats: &[(&'static str, &'static str)],
    available: &'static str,
    parameter: Option<&str>,
    headers: &HeaderMap,
) -> Result<&'static str, ApiError> {
    let none = ApiError::NotAcceptable(available);
    if let Some(wanted) = parameter {
        return formats
            .iter()
            .find(|(name, _)| *name == wanted)
            .map(|(name, _)| *name)
            .ok_or(none);
    }
    let accept: Vec<&str> = headers
        .get_all(header::ACCEPT)
        .iter()
        .filter_map(|value| value.to_str().ok())
        .collect();
    if accept.is_empty() {
        return formats.first().map(|(name, _)| *name).ok_or(none);
    }
    // Each range with its weight; the best wanted format wins, ours first among equals.
    let mut best: Option<(f32, &'static str)> = None;
    for (name, media) in formats {
        let weight = weight(&accept, media);
        if weight > best.map_or(0.0, |(weight, _)| weight) {
            best = Some((weight, name));
        }
    }
    best.map(|(_, name)| name).ok_or(none)
}

/// How much a media type is wanted: the weight of the most specific range that covers it.
fn weight(accept: &[&str], media: &str) -> f32 {
    let group = media.split('/').next().unwrap_or_default();
    let mut found = (0, 0.0);
    for range in accept.iter().flat_map(|value| value.split(',')) {
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
        if specific >= found.0 {
            found = (specific, q);
        }
    }
    found.1
}

/// One line per node, the columns in the order of the API.
fn csv(profile: &ContactProfile) -> String {
    let p = profile;
    #[rustfmt::skip]
    let columns: [(&str, &[f64]); 11] = [
        ("s",                       &p.s),
        ("x",                       &p.x),
        ("y",                       &p.y),
        ("gap",                     &p.gap),
        ("normal_displacement",     &p.normal_displacement),
        ("tangential_displacement", &p.tangential_displacement),
        ("normal_stress",           &p.normal_stress),
        ("tangential_stress",       &p.tangential_stress),
        ("nonlocal_pressure",       &p.nonlocal_pressure),
        ("friction_bound",          &p.friction_bound),
        ("friction_ratio",          &p.friction_ratio),
    ];
    let mut text: String = columns.iter().map(|(name, _)| format!("{name},")).collect();
    text.push_str("state\r\n");
    for (node, state) in p.state.iter().enumerate() {
        for (_, column) in &columns {
            // The shortest text that reads back as the same number; nothing for a missing one.
            if let Some(value) = column.get(node) {
                let _ = write!(text, "{value:?}");
            }
            text.push(',');
        }
        text.push_str(match state {
            NodeState::Open => "open\r\n",
            NodeState::Stick => "stick\r\n",
            NodeState::Slip => "slip\r\n",
        });
    }
    text
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::fake;

    const FORMATS: [(&str, &str); 2] = [("json", "application/json"), ("csv", "text/csv")];

    fn chosen(parameter: Option<&str>, accept: Option<&str>) -> Option<&'static str> {
        let mut headers = HeaderMap::new();
        if let Some(accept) = accept {
            headers.insert(header::ACCEPT, accept.parse().unwrap());
        }
        choose(&FORMATS, "json, csv", parameter, &headers).ok()
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
        assert_eq!(chosen(None, Some("application/json;q=0, */*")), Some("csv"));
        assert_eq!(chosen(None, Some("image/png")), None);
        assert_eq!(chosen(Some("xml"), None), None);
    }

    #[test]
    fn a_table_has_a_header_and_a_line_per_node() {
        let profile = fake::solution().profiles.remove("top").unwrap();
        let text = csv(&profile);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 3);
        assert!(lines[0].starts_with("s,x,y,gap,") && lines[0].ends_with(",state"));
        assert_eq!(
            lines[1],
            "0.0,0.0,0.0,-0.1,-0.1,0.0,-20.0,0.1,19.0,5.7,0.02,stick"
        );
    }
}
