//! The target of a request (a route or an rpc) and the name of its status, from small fixed sets: labels for logs, metrics
//! and spans.

use std::{collections::BTreeSet, sync::LazyLock};

use axum::{
    extract::{MatchedPath, Request},
    http::Method,
};
use tonic::Code;

use super::{operations, page, reply::is_grpc};

/// The label of a target that is neither a route nor an rpc.
pub(super) const UNKNOWN: &str = "unknown";

/// The path of the gRPC service for workers elsewhere, before the names of its rpcs.
pub(super) const WORKER_SERVICE: &str = "/signorini.worker.v1.WorkerService/";
/// The rpcs of that service.
const WORKER_RPCS: [&str; 3] = ["Lease", "Report", "GetContent"];

/// The target of a request, as a label with few values.
#[derive(Clone, Debug)]
pub(super) enum RequestTarget {
    /// A method and the template of a route.
    Route(&'static str, MatchedPath),
    /// A method, and a path that is no route.
    NoRoute(&'static str),
    /// A gRPC method, by its name after the name of its service; `UNKNOWN` if there is no such method.
    Rpc(&'static str),
}

impl RequestTarget {
    /// Finds the target by the path of the request, or by the route that the router has matched.
    pub(super) fn of(request: &Request) -> RequestTarget {
        /// All rpcs of the service, by their paths.
        static RPCS: LazyLock<BTreeSet<String>> = LazyLock::new(|| {
            let all = operations::all().into_iter();
            let ours = all.flat_map(|operation| operation.rpcs.iter());
            let ours = ours.map(|rpc| format!("/signorini.v1.JobService/{rpc}"));
            let ours = ours.chain(WORKER_RPCS.map(|rpc| format!("{WORKER_SERVICE}{rpc}")));
            let others = [
                "/grpc.health.v1.Health/Check",
                "/grpc.health.v1.Health/List",
                "/grpc.health.v1.Health/Watch",
                "/grpc.reflection.v1.ServerReflection/ServerReflectionInfo",
                "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo",
            ];
            ours.chain(others.map(str::to_owned)).collect()
        });
        let rpcs: &'static BTreeSet<String> = &RPCS;
        let path = request.uri().path();
        if let Some(rpc) = rpcs.get(path) {
            return RequestTarget::Rpc(rpc.trim_start_matches('/'));
        }
        let method = method(request.method());
        match request.extensions().get::<MatchedPath>() {
            Some(route) if route.as_str() == page::FILES => {
                RequestTarget::Route(method, route.clone())
            }
            // a service of the contract, without such a method
            Some(route) if route.as_str().contains('*') => RequestTarget::Rpc(UNKNOWN),
            Some(route) => RequestTarget::Route(method, route.clone()),
            None if is_grpc(request) => RequestTarget::Rpc(UNKNOWN),
            None => RequestTarget::NoRoute(method),
        }
    }
}

/// The name of a usual HTTP method, or one name for all others, since clients may send any word.
fn method(method: &Method) -> &'static str {
    match *method {
        Method::GET => "GET",
        Method::HEAD => "HEAD",
        Method::POST => "POST",
        Method::PUT => "PUT",
        Method::PATCH => "PATCH",
        Method::DELETE => "DELETE",
        Method::OPTIONS => "OPTIONS",
        _ => "OTHER",
    }
}

/// The name of a status code, as the gRPC specification writes it.
pub(super) fn name_of(code: Code) -> &'static str {
    match code {
        Code::Ok => "OK",
        Code::Cancelled => "CANCELLED",
        Code::Unknown => "UNKNOWN",
        Code::InvalidArgument => "INVALID_ARGUMENT",
        Code::DeadlineExceeded => "DEADLINE_EXCEEDED",
        Code::NotFound => "NOT_FOUND",
        Code::AlreadyExists => "ALREADY_EXISTS",
        Code::PermissionDenied => "PERMISSION_DENIED",
        Code::ResourceExhausted => "RESOURCE_EXHAUSTED",
        Code::FailedPrecondition => "FAILED_PRECONDITION",
        Code::Aborted => "ABORTED",
        Code::OutOfRange => "OUT_OF_RANGE",
        Code::Unimplemented => "UNIMPLEMENTED",
        Code::Internal => "INTERNAL",
        Code::Unavailable => "UNAVAILABLE",
        Code::DataLoss => "DATA_LOSS",
        Code::Unauthenticated => "UNAUTHENTICATED",
    }
}

/// Whether a request is one of those that programs send all the time, which the log does not tell.
pub(super) fn is_routine(path: &str) -> bool {
    is_probe(path) || path.starts_with(WORKER_SERVICE)
}

/// Whether a request is for one of the probes or for metrics, which are answered even if all connections are busy.
pub fn is_probe(path: &str) -> bool {
    matches!(
        path,
        "/livez" | "/readyz" | "/metrics" | "/grpc.health.v1.Health/Check"
    )
}
