//! Limits for every request of either protocol: a body must keep arriving, and the bytes of bodies and answers are
//! counted over all requests.

use std::sync::Arc;

use axum::{
    extract::{Request, State},
    http::Method,
    middleware::Next,
    response::Response,
};

use service::{
    error::ApiError,
    transfer::{HasShare, NoRoom, Received, arriving, with_share},
    verbs::Service,
};
use tonic_types::StatusExt;

use super::{
    body::content_type,
    refused,
    reply::{is_grpc, refusal},
    request_target::is_probe,
};

/// The path of the gRPC method for uploads, whose bytes are written to a file as they arrive and not kept in memory.
const UPLOAD: &str = "/signorini.v1.JobService/UploadMesh";

pub(super) async fn limits(
    State(service): State<Arc<Service>>,
    request: Request,
    next: Next,
) -> Response {
    let (grpc, path) = (is_grpc(&request), request.uri().path().to_owned());
    // tonic would take it, and its bytes would not be counted
    if !grpc && is_of_grpc(&path) {
        let error = ApiError::UnsupportedMedia {
            expected: "application/grpc",
            got: content_type(request.headers()).to_owned(),
        };
        return refusal(grpc, &path, error);
    }
    // its answer would be refused when the work is done
    if !is_probe(&path) && !service.sent.has_room() {
        return refusal(grpc, &path, ApiError::Overloaded);
    }
    let no_room = if only_reads(grpc, request.method(), &path) {
        NoRoom::Refuse
    } else {
        NoRoom::Wait
    };
    let received = Received::new(&service.received);
    let (mut parts, body) = request.into_parts();
    // over REST, they are counted where they are collected
    let kept = grpc && path != UPLOAD;
    let body = arriving(body, kept.then(|| received.clone()));
    parts.extensions.insert(received.clone());
    let response = next.run(Request::from_parts(parts, body)).await;
    // the bytes, and what was made of them, were needed until here
    drop(received);
    if grpc && let Some(status) = tonic::Status::from_header_map(response.headers()) {
        note_status(&status, &path);
    }
    let (parts, body) = response.into_parts();
    if is_probe(&path) || parts.extensions.get::<HasShare>().is_some() {
        return Response::from_parts(parts, body);
    }
    match with_share(body, &service.sent, no_room).await {
        Ok(body) => Response::from_parts(parts, body),
        Err(error) => refusal(grpc, &path, error),
    }
}

/// Whether a path belongs to one of the gRPC services.
fn is_of_grpc(path: &str) -> bool {
    ["/signorini.", "/grpc."]
        .iter()
        .any(|start| path.starts_with(start))
}

/// Whether a request changes nothing, so that it may be repeated.
fn only_reads(grpc: bool, method: &Method, path: &str) -> bool {
    const READING: [&str; 8] = [
        "Get", "List", "Count", "Wait", "Watch", "Stream", "Validate", "Convert",
    ];
    match path.strip_prefix("/signorini.v1.JobService/") {
        Some(name) => READING.iter().any(|prefix| name.starts_with(prefix)),
        None => grpc || method.is_safe() || path.starts_with("/v1/problems/"),
    }
}

/// Records the status with which a gRPC request was refused before any message, for the log of refused requests.
fn note_status(status: &tonic::Status, path: &str) {
    if status.code() != tonic::Code::Ok {
        let kind = status.get_details_error_info().map(|info| info.reason);
        let kind = kind.unwrap_or_else(|| format!("gRPC {:?}", status.code()));
        refused::note(&kind, path);
    }
}
