//! `/v1/jobs/{id}/plots/{plot}.svg`.

use axum::{
    extract::{RawQuery, State},
    http::{HeaderName, header},
    response::IntoResponse,
};
use files::plot::{Plot, Style};

use super::{
    Rest,
    request::{JobPath, Params},
};
use crate::{error::ApiError, verbs::plots, violations};

pub(super) async fn plot(
    State(rest): State<Rest>,
    RawQuery(query): RawQuery,
    path: JobPath,
) -> Result<impl IntoResponse, ApiError> {
    let plot: Option<Plot> = path
        .plot
        .strip_suffix(".svg")
        .and_then(|name| name.parse().ok());
    let Some(plot) = plot else {
        return Err(ApiError::NotFound(format!(
            "there is no plot {:?}; there are: mesh.svg, deformed.svg, profile.svg, convergence.svg",
            violations::name(&path.plot)
        )));
    };
    let known: &[&str] = match plot {
        Plot::Deformed => &["theme", "stress"],
        _ => &["theme"],
    };
    let params = Params::parse(query.as_deref(), known)?;
    let style = Style {
        theme: choice(&params, "theme", "light or dark")?,
        stress: choice(&params, "stress", "von_mises, xx, yy, zz or xy")?,
    };
    let svg = plots::plot(&rest.service, path.id, plot, style).await?;
    Ok((HEADERS, svg))
}

/// A figure is looked at, and does nothing: texts in it are a client's.
const HEADERS: [(HeaderName, &str); 2] = [
    (header::CONTENT_TYPE, "image/svg+xml"),
    (
        header::CONTENT_SECURITY_POLICY,
        "default-src 'none'; style-src 'unsafe-inline'",
    ),
];

/// One of the words that a type knows; its default when nothing was said.
fn choice<T: std::str::FromStr + Default>(
    params: &Params,
    name: &'static str,
    expected: &'static str,
) -> Result<T, ApiError> {
    let Some(text) = params.one(name) else {
        return Ok(T::default());
    };
    text.parse().map_err(|_| ApiError::BadParameter {
        name,
        got: text.into(),
        expected,
    })
}
