//! Errors over REST, which are always sent as `application/problem+json`.

use std::any::Any;

use axum::{
    body::Body,
    extract::Request,
    http::{HeaderMap, HeaderValue, header},
    middleware::Next,
    response::{IntoResponse, Response},
};
use base::address::{self, link};
use service::error::ApiError;

use super::{coding, refused};

/// Writes errors as documents whose `instance` is the path of the request.
pub(super) async fn errors_as_documents(request: Request, next: Next) -> Response {
    let path = request.uri().path().to_string();
    let response = next.run(request).await;
    with_document(response, &path)
}

/// Adds the headers that belong to an error to the headers of an answer.
fn add_headers(headers: &mut HeaderMap, error: &ApiError) {
    if let Some(seconds) = error.retry_after_s() {
        headers.insert(header::RETRY_AFTER, HeaderValue::from(seconds));
    }
    if let ApiError::Unauthenticated(_) = error {
        // `browser` adds another way, on a line of its own
        const BEARER: HeaderValue = HeaderValue::from_static("Bearer realm=\"signorini\"");
        headers.insert(header::WWW_AUTHENTICATE, BEARER);
    }
    if let ApiError::UnsupportedEncoding(_) = error {
        const CODINGS: HeaderValue = HeaderValue::from_static(coding::UNDERSTOOD);
        headers.insert(header::ACCEPT_ENCODING, CODINGS);
    }
    if let ApiError::RangeNotSatisfiable(bytes) = error
        && let Ok(value) = HeaderValue::from_str(&format!("bytes */{bytes}"))
    {
        headers.insert(header::CONTENT_RANGE, value);
    }
}

/// Adds to an answer that is an error its headers and its document; any other answer is unchanged.
fn with_document(mut response: Response, path: &str) -> Response {
    let Some(error) = response.extensions_mut().remove::<ApiError>() else {
        return response;
    };
    add_headers(response.headers_mut(), &error);
    let code = error.code().kind().code;
    refused::note(code, path);
    let document = error.document(&link(path)).to_string();
    let (mut parts, _) = response.into_parts();
    parts.headers.insert(
        header::CONTENT_TYPE,
        HeaderValue::from_static("application/problem+json"),
    );
    parts.headers.remove(header::CONTENT_LENGTH);
    Response::from_parts(parts, Body::from(document))
}

/// Whether the client uses gRPC.
pub(super) fn is_grpc(request: &Request) -> bool {
    let content_type = request.headers().get(header::CONTENT_TYPE);
    content_type.is_some_and(|value| value.as_bytes().starts_with(b"application/grpc"))
}

/// Refuses a request before it reaches its handler: with a gRPC status, or with an error document.
pub(super) fn refusal(grpc: bool, path: &str, error: ApiError) -> Response {
    if grpc {
        refused::note(error.code().kind().code, path);
        tonic::Status::from(error).into_http()
    } else {
        with_document(error.into_response(), path)
    }
}

/// Refuses a request before it is routed.
pub fn refuse(request: &Request, error: ApiError) -> Response {
    let path = address::without_prefix(request.uri().path());
    refusal(is_grpc(request), path, error)
}

/// Answers a request for an unknown path: with a gRPC status for a gRPC client, with an error document for others.
pub(super) async fn not_found(request: Request) -> Response {
    if is_grpc(&request) {
        let name = request.uri().path();
        return tonic::Status::unimplemented(format!("there is no method {name}")).into_http();
    }
    ApiError::NotFound(format!("there is no resource at {}", request.uri().path())).into_response()
}

/// The answer to a request whose handler has panicked: an incident like any other unexpected error.
pub(super) fn panicked(panic: Box<dyn Any + Send>) -> Response {
    let text = panic
        .downcast_ref::<String>()
        .cloned()
        .or_else(|| panic.downcast_ref::<&str>().map(|text| text.to_string()))
        .unwrap_or_default();
    ApiError::internal(format!("a handler panicked: {text}")).into_response()
}
