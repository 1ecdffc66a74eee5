//! All routes on one port.

use std::sync::Arc;

use axum::{Router, extract::DefaultBodyLimit, middleware};
use tower_http::catch_panic::CatchPanicLayer;

use super::{authenticate::authenticate, call::Site, openapi::openapi, operations, reply};
use crate::{error::ApiError, verbs::Service};

/// All routes. `grpc` shares the port; what neither knows is answered by `reply::not_found`.
pub fn router(service: Arc<Service>, grpc: Router) -> Router {
    operations::routes()
        .method_not_allowed_fallback(async || ApiError::MethodNotAllowed)
        .with_state(Site { service, openapi })
        .merge(grpc)
        // After the merge: the gRPC router brings a fallback of its own, which would answer every
        // unknown path with a gRPC status.
        .fallback(reply::not_found)
        .layer(middleware::from_fn(authenticate))
        .layer(CatchPanicLayer::custom(reply::panicked))
        // `body::json_text` has our own limit, with our own answer.
        .layer(DefaultBodyLimit::disable())
        .layer(middleware::from_fn(reply::errors_as_documents))
}
