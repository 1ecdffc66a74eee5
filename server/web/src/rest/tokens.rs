//! The operations on `/v1/tokens`.

use axum::{
    Extension, Json,
    http::{StatusCode, header},
    response::{IntoResponse, Response},
};
use base::{address::link, token::Token};
use schemars::JsonSchema;
use serde::Serialize;
use service::{
    error::ApiError,
    verbs::tokens::{self as verbs, NewToken, TokensChanged},
};

use super::{bodies, call::Call};

/// All tokens.
#[derive(Serialize, JsonSchema)]
#[schemars(rename = "TokenList")]
pub(super) struct List {
    /// The tokens, the oldest first, including those that are no longer valid.
    tokens: Vec<Token>,
}

pub(super) async fn create(mut call: Call) -> Result<Response, ApiError> {
    let request = bodies::token(&call.json().await?)?;
    let new = verbs::create(&call.service.store, &call.caller, request).await?;
    let location = link(&format!("/v1/tokens/{}", new.token.id));
    let headers = [(header::LOCATION, location)];
    Ok((StatusCode::CREATED, headers, shown_once(new)).into_response())
}

pub(super) async fn list(call: Call) -> Result<Json<List>, ApiError> {
    let tokens = verbs::list(&call.service.store, &call.caller);
    Ok(Json(List { tokens }))
}

pub(super) async fn revoke(call: Call, id: String) -> Result<impl IntoResponse, ApiError> {
    let revoked = verbs::revoke(&call.service.store, &call.caller, &id).await?;
    Ok((Extension(TokensChanged), Json(revoked)))
}

pub(super) async fn rotate(call: Call, id: String) -> Result<Response, ApiError> {
    let new = verbs::rotate(&call.service.store, &call.caller, &id).await?;
    Ok(shown_once(new).into_response())
}

/// Answers with a secret that no cache on the way may store.
fn shown_once(new: NewToken) -> impl IntoResponse {
    let headers = [(header::CACHE_CONTROL, "no-store")];
    (Extension(TokensChanged), headers, Json(new))
}
