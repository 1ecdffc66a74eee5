//! `/v1/jobs/{id}/plots/{plot}.svg`.

use axum::{
    http::{HeaderName, header},
    response::IntoResponse,
};
use files::plot::{Plot, Stress, Style, Theme};

use super::{call::Call, data::marked};
use crate::{
    error::ApiError,
    job::JobId,
    verbs::plots::{self as verbs, STRESS, THEME},
};

pub(super) async fn plot(
    call: Call,
    id: JobId,
    plot: Plot,
    theme: Option<Theme>,
    stress: Option<Stress>,
) -> Result<impl IntoResponse, ApiError> {
    // it has no effect on the other plots
    if stress.is_some() && plot != Plot::Deformed {
        return Err(ApiError::UnknownParameter {
            name: STRESS.name.into(),
            known: THEME.name.into(),
        });
    }
    let style = Style {
        theme: theme.unwrap_or_default(),
        stress: stress.unwrap_or_default(),
    };
    let found = verbs::plot(&call.service, &call.caller, id, plot, style).await?;
    Ok(marked((HEADERS, found.content), found.available))
}

/// A figure may not run scripts or load anything: its texts come from clients.
const HEADERS: [(HeaderName, &str); 2] = [
    (header::CONTENT_TYPE, "image/svg+xml"),
    (
        header::CONTENT_SECURITY_POLICY,
        "default-src 'none'; style-src 'unsafe-inline'",
    ),
];
