//! REST. The whole API is one list, `operations`. Handlers only translate; see `verbs`.

mod bodies;
mod data;
mod docs;
mod events;
mod filters;
mod jobs;
mod meshes;
mod openapi;
mod operations;
mod plots;
mod reference;
mod reply;
mod request;
mod results;
mod service;

mod submit;

use std::sync::Arc;

use axum::{Router, extract::DefaultBodyLimit, middleware};
use tower_http::catch_panic::CatchPanicLayer;

use crate::{error::ApiError, verbs::Service};

pub use openapi::openapi;
pub use reference::reference;

/// What handlers see.
#[derive(Clone, Debug)]
struct Rest {
    service: Arc<Service>,
}

/// All routes. `grpc` shares the port; what neither knows is answered by `reply::not_found`.
pub fn router(service: Arc<Service>, grpc: Router) -> Router {
    operations::routes()
        .method_not_allowed_fallback(async || ApiError::MethodNotAllowed)
        .with_state(Rest { service })
        .merge(grpc)
        // After the merge: the gRPC router brings a fallback of its own, which would answer every
        // unknown path with a gRPC status.
        .fallback(reply::not_found)
        .layer(CatchPanicLayer::custom(reply::panicked))
        // `request::body` has our own limit, with our own answer.
        .layer(DefaultBodyLimit::disable())
        .layer(middleware::from_fn(reply::errors_as_documents))
}
