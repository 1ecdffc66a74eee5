//! REST: the whole API as one list of routes. Handlers only translate; see `verbs`.

mod events;
mod jobs;
mod meshes;
mod plots;
mod reply;
mod request;
mod results;
mod submission;

use std::sync::Arc;

use axum::{
    Json, Router,
    extract::{DefaultBodyLimit, State},
    http::StatusCode,
    middleware,
    routing::{get, post},
};
use serde_json::Value;
use tower_http::catch_panic::CatchPanicLayer;

use crate::{error::ApiError, verbs::Service};

/// What handlers see.
#[derive(Clone, Debug)]
struct Rest {
    service: Arc<Service>,
    max_body_bytes: usize,
}

/// All routes. `grpc` shares the port; what neither knows is answered by `reply::not_found`.
pub fn router(service: Arc<Service>, max_body_bytes: usize, grpc: Router) -> Router {
    #[rustfmt::skip]
    let routes = Router::new()
        .route("/v1/jobs",                           get(jobs::list).post(jobs::create))
        .route("/v1/jobs/{id}",                      get(jobs::get))
        .route("/v1/jobs/{id}/events",               get(events::watch))
        .route("/v1/jobs/{id}/history",              get(results::history))
        .route("/v1/jobs/{id}/result",               get(results::result))
        .route("/v1/jobs/{id}/profiles/{boundary}",  get(results::profile))
        .route("/v1/jobs/{id}/fields",               get(results::fields))
        .route("/v1/jobs/{id}/plots/{plot}",         get(plots::plot))
        .route("/v1/jobs/{id}/cancel",               post(jobs::cancel))
        .route("/v1/meshes",                         get(meshes::list).post(meshes::upload))
        .route("/v1/meshes/{hash}",                  get(meshes::get).delete(meshes::delete))
        .route("/v1/problems/validate",              post(jobs::validate))
        .route("/v1/schema/problem.json",            get(schema))
        .route("/livez",                             get(livez))
        .route("/readyz",                            get(readyz));
    routes
        .method_not_allowed_fallback(async || ApiError::MethodNotAllowed)
        .with_state(Rest {
            service,
            max_body_bytes,
        })
        .merge(grpc)
        // After the merge: the gRPC router brings a fallback of its own, which would answer every
        // unknown path with a gRPC status.
        .fallback(reply::not_found)
        .layer(CatchPanicLayer::custom(reply::panicked))
        // `request::body` has our own limit, with our own answer.
        .layer(DefaultBodyLimit::disable())
        .layer(middleware::from_fn(reply::errors_as_documents))
}

/// The JSON Schema of a problem.
async fn schema() -> Json<Value> {
    Json(solver::schema())
}

/// The process is alive.
async fn livez() -> &'static str {
    "ok\n"
}

/// The service takes jobs.
async fn readyz(State(rest): State<Rest>) -> Result<(StatusCode, &'static str), ApiError> {
    rest.service.accepting()?;
    rest.service.store.ping().await?;
    Ok((StatusCode::OK, "ok\n"))
}
