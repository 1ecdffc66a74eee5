//! REST: the whole API as one list of routes. Handlers only translate; see `verbs`.

mod data;
mod events;
mod filters;
mod jobs;
mod meshes;
mod plots;
mod reply;
mod request;
mod results;
mod service;
mod submission;
mod submit;

use std::sync::Arc;

use axum::{
    Router,
    extract::DefaultBodyLimit,
    middleware,
    routing::{get, post},
};
use tower_http::catch_panic::CatchPanicLayer;

use crate::{error::ApiError, verbs::Service};

/// What handlers see.
#[derive(Clone, Debug)]
struct Rest {
    service: Arc<Service>,
}

/// All routes. `grpc` shares the port; what neither knows is answered by `reply::not_found`.
pub fn router(service: Arc<Service>, grpc: Router) -> Router {
    #[rustfmt::skip]
    let routes = Router::new()
        .route("/v1/jobs",                           get(jobs::list).post(submit::create).delete(jobs::delete_many))
        .route("/v1/jobs/batch",                     post(submit::create_batch))
        .route("/v1/jobs/cancel",                    post(jobs::cancel_many))
        .route("/v1/jobs/count",                     get(jobs::count))
        .route("/v1/jobs/{id}",                      get(jobs::get).put(submit::put).patch(jobs::update).delete(jobs::delete))
        .route("/v1/jobs/{id}/problem",              get(jobs::problem))
        .route("/v1/jobs/{id}/events",               get(events::watch))
        .route("/v1/jobs/{id}/history",              get(results::history))
        .route("/v1/jobs/{id}/result",               get(results::result))
        .route("/v1/jobs/{id}/profiles/{boundary}",  get(results::profile))
        .route("/v1/jobs/{id}/fields",               get(results::fields))
        .route("/v1/jobs/{id}/plots/{plot}",         get(plots::plot))
        .route("/v1/jobs/{id}/cancel",               post(jobs::cancel))
        .route("/v1/jobs/{id}/retry",                post(submit::retry))
        .route("/v1/meshes",                         get(meshes::list).post(meshes::upload))
        .route("/v1/meshes/{hash}",                  get(meshes::get).delete(meshes::delete))
        .route("/v1/problems/validate",              post(submit::validate))
        .route("/v1/queue",                          get(service::queue))
        .route("/v1/queue/pause",                    post(service::pause))
        .route("/v1/queue/resume",                   post(service::resume))
        .route("/v1/info",                           get(service::info))
        .route("/v1/me",                             get(service::me))
        .route("/v1/errors/{code}",                  get(service::error))
        .route("/v1/schema/problem.json",            get(service::schema))
        .route("/livez",                             get(service::livez))
        .route("/readyz",                            get(service::readyz));
    routes
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
