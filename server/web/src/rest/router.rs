//! Makes the router of the service, with all routes on one port.

use std::sync::Arc;

use axum::{Router, extract::DefaultBodyLimit, middleware};
use service::{error::ApiError, verbs::Service};
use tower::{
    Layer,
    util::{MapRequestLayer, option_layer},
};
use tower_http::catch_panic::CatchPanicLayer;

use super::{
    authenticate::authenticate, browser, call::AppState, compressed::compressed, forwarded,
    limits::limits, openapi::openapi, operations, origin, page, reply, request_report,
};

/// All routes, REST and gRPC. Unknown paths are answered by `reply::not_found`.
pub fn router(service: Arc<Service>, grpc: Router) -> Router {
    let (prefix, sent) = (service.config.web.path_prefix.clone(), service.sent.clone());
    let is_shared = !service.config.web.allowed_origins.is_empty();
    let routes = operations::routes()
        .merge(page::routes())
        .method_not_allowed_fallback(async || ApiError::MethodNotAllowed)
        .with_state(AppState {
            service: service.clone(),
            openapi,
        })
        .merge(grpc)
        // after the merge: the fallback of the gRPC router would answer every unknown path with a gRPC status.
        .fallback(reply::not_found)
        .layer(middleware::from_fn_with_state(
            service.clone(),
            authenticate,
        ))
        .layer(CatchPanicLayer::custom(reply::panicked))
        // `body::json_text` has a limit of its own, and answers with an error document
        .layer(DefaultBodyLimit::disable())
        .layer(middleware::from_fn_with_state(service.clone(), limits))
        .layer(middleware::from_fn(reply::errors_as_documents))
        // outside of the limits: the bytes that are compressed are counted, and there are never more of the others
        .layer(middleware::from_fn_with_state(sent, compressed))
        // outside of the authentication: a browser asks beforehand, without the token; and of the limits, whose refusals a page
        // may read
        .layer(option_layer(origin::cors(&service.config.web)))
        .layer(middleware::from_fn_with_state(
            service.clone(),
            origin::own_site,
        ))
        // outside of all that refuses: also refusals are read by browsers
        .layer(middleware::from_fn_with_state(
            is_shared,
            browser::for_browsers,
        ))
        // outermost: it sees what the client is answered
        .layer(middleware::from_fn_with_state(
            service,
            request_report::observe,
        ));
    if prefix.is_empty() {
        routes
    } else {
        // outside of the routes, which are found by the rest of the path
        let without = move |request| forwarded::without_prefix(request, &prefix);
        Router::new().fallback_service(MapRequestLayer::new(without).layer(routes))
    }
}
