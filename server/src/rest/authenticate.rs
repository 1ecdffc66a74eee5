//! The one place where the caller of a request is identified, for both protocols.

use axum::{extract::Request, middleware::Next, response::Response};

use crate::caller::Caller;

/// Puts the caller of a request into its extensions, where handlers and rpcs read it. There is no authentication yet:
/// every request comes from the local caller. Probes pass through here as well; they have no credentials, and an
/// authentication must let them through.
pub(super) async fn authenticate(mut request: Request, next: Next) -> Response {
    request.extensions_mut().insert(Caller::local());
    next.run(request).await
}
