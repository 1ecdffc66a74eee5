//! `/docs`: Swagger UI showing `/openapi.json`. It is compiled in, so the page works without a network.

use axum::{
    extract::RawQuery,
    http::{HeaderName, header},
    response::IntoResponse,
};

use super::request::{Params, TextPath};
use crate::{error::ApiError, violations};

const PAGE: &str = include_str!("index.html");

/// Name, type and content of what the page loads; `build.rs` takes the parts of Swagger UI out of its archive.
const FILES: [(&str, &str, &str); 4] = [
    (
        "swagger-ui.css",
        "text/css; charset=utf-8",
        include_str!(concat!(env!("OUT_DIR"), "/swagger-ui.css")),
    ),
    (
        "swagger-ui-bundle.js",
        "text/javascript; charset=utf-8",
        include_str!(concat!(env!("OUT_DIR"), "/swagger-ui-bundle.js")),
    ),
    (
        "start.js",
        "text/javascript; charset=utf-8",
        include_str!("start.js"),
    ),
    // Swagger UI is under the Apache licence, which wants to come with it.
    (
        "license.txt",
        "text/plain; charset=utf-8",
        include_str!(concat!(env!("OUT_DIR"), "/swagger-ui-license.txt")),
    ),
];

/// Their names.
pub(super) const NAMES: [&str; 4] = [FILES[0].0, FILES[1].0, FILES[2].0, FILES[3].0];

pub(super) async fn page(RawQuery(query): RawQuery) -> Result<impl IntoResponse, ApiError> {
    Params::parse(query.as_deref(), &[])?;
    Ok((headers("text/html; charset=utf-8"), PAGE))
}

pub(super) async fn file(
    RawQuery(query): RawQuery,
    TextPath(name): TextPath,
) -> Result<impl IntoResponse, ApiError> {
    Params::parse(query.as_deref(), &[])?;
    let found = FILES.iter().find(|(known, ..)| *known == name);
    let Some((_, kind, content)) = found else {
        return Err(ApiError::NotFound(format!(
            "the page has no file {:?}; it has: {}",
            violations::name(&name),
            NAMES.join(", ")
        )));
    };
    Ok((headers(kind), *content))
}

/// The page may load from here and ask here, and nothing else. Swagger UI sets styles of its elements, and
/// has its icons in its stylesheet.
fn headers(kind: &'static str) -> [(HeaderName, &'static str); 4] {
    [
        (header::CONTENT_TYPE, kind),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::CACHE_CONTROL, "max-age=3600"),
        (
            header::CONTENT_SECURITY_POLICY,
            "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; \
             connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
        ),
    ]
}
