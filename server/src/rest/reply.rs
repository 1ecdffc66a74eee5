//! Errors over REST, which are always sent as `application/problem+json`.

use std::any::Any;

use axum::{
    body::Body,
    extract::Request,
    http::{HeaderValue, header},
    middleware::Next,
    response::{IntoResponse, Response},
};

use super::{coding, refused};
use crate::{
    address::{self, link},
    error::ApiError,
};

impl IntoResponse for ApiError {
    /// An answer with only the status and the error itself; `errors_as_documents` writes the document, since it knows
    /// the path.
    fn into_response(self) -> Response {
        let mut response = self.http_status().into_response();
        if let Some(seconds) = self.retry_after_s() {
            response
                .headers_mut()
                .insert(header::RETRY_AFTER, HeaderValue::from(seconds));
        }
        if let ApiError::Unauthenticated(_) = &self {
            // a browser takes the second one, and asks for a password: the token
            const WAYS: HeaderValue = HeaderValue::from_static(
                "Bearer realm=\"signorini\", Basic realm=\"signorini: any name, and a token as the password\"",
            );
            response
                .headers_mut()
                .insert(header::WWW_AUTHENTICATE, WAYS);
        }
        if let ApiError::UnsupportedEncoding(_) = &self {
            const CODINGS: HeaderValue = HeaderValue::from_static(coding::UNDERSTOOD);
            response
                .headers_mut()
                .insert(header::ACCEPT_ENCODING, CODINGS);
        }
        if let ApiError::RangeNotSatisfiable(bytes) = &self
            && let Ok(value) = HeaderValue::from_str(&format!("bytes */{bytes}"))
        {
            response.headers_mut().insert(header::CONTENT_RANGE, value);
        }
        response.extensions_mut().insert(self);
        response
    }
}

/// Writes errors as documents whose `instance` is the path of the request.
pub(super) async fn errors_as_documents(request: Request, next: Next) -> Response {
    let path = request.uri().path().to_string();
    let response = next.run(request).await;
    with_document(response, &path)
}

/// An error with its document; any other answer unchanged.
fn with_document(mut response: Response, path: &str) -> Response {
    let Some(error) = response.extensions_mut().remove::<ApiError>() else {
        return response;
    };
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

/// The answer to an unknown path: a gRPC status for a gRPC client, an error document for others.
pub(super) async fn not_found(request: Request) -> Response {
    if is_grpc(&request) {
        let name = request.uri().path();
        return tonic::Status::unimplemented(format!("there is no method {name}")).into_http();
    }
    ApiError::NotFound(format!("there is no resource at {}", request.uri().path())).into_response()
}

/// The answer when a handler has panicked: an incident like any other unexpected error.
pub(super) fn panicked(panic: Box<dyn Any + Send>) -> Response {
    let text = panic
        .downcast_ref::<String>()
        .cloned()
        .or_else(|| panic.downcast_ref::<&str>().map(|text| text.to_string()))
        .unwrap_or_default();
    ApiError::internal(format!("a handler panicked: {text}")).into_response()
}
