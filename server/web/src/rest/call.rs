//! A request on its way to its handler: its input is read and checked, then the handler runs.

use std::sync::Arc;

use axum::{
    body::{Body, HttpBody},
    extract::{Request, State},
    http::HeaderMap,
    response::{IntoResponse, Response},
    routing::{MethodFilter, MethodRouter, on},
};
use base::caller::Caller;
use serde_json::Value;
use service::{error::ApiError, transfer::Received, verbs::Service};

use super::{
    body,
    input::{Input, RawInput},
    origin::Https,
};

/// The state that all handlers share.
#[derive(Clone, Debug)]
pub(super) struct AppState {
    pub(super) service: Arc<Service>,
    /// Returns the OpenAPI document, which is made from all operations and served by one of them.
    pub(super) openapi: fn() -> &'static Value,
}

/// A request without its parameters, which handlers receive as separate arguments.
pub(super) struct Call {
    pub(super) service: Arc<Service>,
    pub(super) caller: Caller,
    pub(super) headers: HeaderMap,
    /// Whether the client has used https.
    pub(super) https: bool,
    pub(super) body: Body,
    /// Counts the part of the body that is in memory.
    pub(super) received: Received,
    pub(super) openapi: fn() -> &'static Value,
}

impl Call {
    /// Reads the body as text; an error if it is not declared as JSON or is too large.
    pub(super) async fn json(&mut self) -> Result<String, ApiError> {
        let body = std::mem::take(&mut self.body);
        body::json_text(
            body::is_json(&self.headers)?,
            body,
            self.service.config.max_body_bytes,
            &self.received,
        )
        .await
    }

    /// Reads the body as text; an error if it is not declared as a merge patch or is too large.
    pub(super) async fn merge_patch(&mut self) -> Result<String, ApiError> {
        let body = std::mem::take(&mut self.body);
        let limit_bytes = self.service.config.max_body_bytes;
        body::json_text(&self.headers, body, limit_bytes, &self.received).await
    }

    /// Whether the request has a body.
    pub(super) fn has_body(&self) -> bool {
        !self.body.is_end_stream()
    }
}

/// The handler of an operation: an async function of the call and of the operation's input values, in the order in
/// which the operation lists them.
pub(super) trait Handler<Values>: Clone + Send + Sync + 'static {
    /// Runs the operation.
    fn handle(
        &self,
        call: Call,
        values: Values,
    ) -> impl Future<Output = Result<Response, ApiError>> + Send;
}

macro_rules! functions {
    ($(($($T:ident)*))*) => {$(
        #[allow(non_snake_case)]
        impl<F, Answering, Answer, $($T: Send),*> Handler<($($T,)*)> for F
        where
            F: Fn(Call, $($T),*) -> Answering + Clone + Send + Sync + 'static,
            Answering: Future<Output = Result<Answer, ApiError>> + Send,
            Answer: IntoResponse,
        {
            async fn handle(&self, call: Call, ($($T,)*): ($($T,)*)) -> Result<Response, ApiError> {
                Ok(self(call, $($T),*).await?.into_response())
            }
        }
    )*};
}
functions!(() (A) (A B) (A B C) (A B C D) (A B C D E) (A B C D E G) (A B C D E G H) (A B C D E G H I));

/// Makes the route of an operation: it reads and checks the input, and calls the handler. A `strict` route refuses
/// unknown parameters.
pub(super) fn route<T, H>(
    method: MethodFilter,
    input: T,
    strict: bool,
    handler: H,
) -> MethodRouter<AppState>
where
    T: Input<Value: Send> + Send + Sync + 'static,
    H: Handler<T::Value>,
{
    let described = input.descriptions();
    let operation = Arc::new((input, described));
    on(
        method,
        move |State(site): State<AppState>, request: Request| {
            let (handler, operation) = (handler.clone(), operation.clone());
            async move {
                let (mut parts, body) = request.into_parts();
                let variables = RawInput::variables(&mut parts).await?;
                let caller = parts.extensions.remove::<Caller>();
                let caller = caller.ok_or_else(|| {
                    ApiError::internal("the caller of a request was not identified")
                })?;
                let https = parts.extensions.get::<Https>();
                let https = https.is_some_and(|Https(https)| *https);
                let received = parts.extensions.remove::<Received>();
                let received = received.unwrap_or_else(|| Received::new(&site.service.received));
                let raw = RawInput::new(variables, parts.uri.query(), &parts.headers);
                let (input, described) = &*operation;
                if strict {
                    raw.check(described)?;
                }
                let values = input.extract(&raw)?;
                let call = Call {
                    service: site.service,
                    caller,
                    headers: parts.headers,
                    https,
                    body,
                    received,
                    openapi: site.openapi,
                };
                handler.handle(call, values).await
            }
        },
    )
}
