//! Who asks: the one place where that is found out, for both protocols.

use axum::{extract::Request, middleware::Next, response::Response};

use crate::caller::Caller;

/// Puts the caller of a request into its extensions, where handlers and rpcs find it. As long as callers are not told
/// apart, everybody is the local one. Probes come through here as well: whoever asks them has nothing to show, and
/// has to be let through.
pub(super) async fn authenticate(mut request: Request, next: Next) -> Response {
    request.extensions_mut().insert(Caller::local());
    next.run(request).await
}
