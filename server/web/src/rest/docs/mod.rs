//! `/docs`: Swagger UI showing `/openapi.json`. It is compiled in, so the page works without a network.

use axum::{
    http::{HeaderName, header},
    response::IntoResponse,
};
use base::values::Words;
use service::{error::ApiError, parameters::Variable};

use super::call::Call;

const PAGE: &str = include_str!("index.html");

/// The type and content of a file that the page loads.
#[derive(Clone, Copy, Debug)]
pub(super) struct File {
    kind: &'static str,
    content: &'static str,
}

/// A file of the page, in a path. `build/main.rs` extracts the files of Swagger UI from its archive.
pub(super) const FILE: Variable<Words<File>> = Variable {
    name: "file",
    kind: "file of the page",
    meaning: "File that the page loads",
    values: Words(|| {
        let file = |name, kind, content| (name, File { kind, content });
        vec![
            file(
                "swagger-ui.css",
                "text/css; charset=utf-8",
                include_str!(concat!(env!("OUT_DIR"), "/swagger-ui.css")),
            ),
            file(
                "swagger-ui-bundle.js",
                "text/javascript; charset=utf-8",
                include_str!(concat!(env!("OUT_DIR"), "/swagger-ui-bundle.js")),
            ),
            file(
                "start.js",
                "text/javascript; charset=utf-8",
                include_str!("start.js"),
            ),
            // Swagger UI is under the Apache licence, whose text must come with it.
            file(
                "license.txt",
                "text/plain; charset=utf-8",
                include_str!(concat!(env!("OUT_DIR"), "/swagger-ui-license.txt")),
            ),
        ]
    }),
};

pub(super) async fn page(_: Call) -> Result<impl IntoResponse, ApiError> {
    Ok((headers("text/html; charset=utf-8"), PAGE))
}

pub(super) async fn file(_: Call, file: File) -> Result<impl IntoResponse, ApiError> {
    Ok((headers(file.kind), file.content))
}

/// Headers with which the page may load files from this service and send requests to it, but to no other. Swagger UI
/// sets styles on its elements, and its stylesheet contains its icons.
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
