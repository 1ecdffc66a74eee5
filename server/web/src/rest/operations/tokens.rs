//! The operations on tokens.

use axum::{
    Extension, Json,
    http::{StatusCode, header},
    response::{IntoResponse, Response},
};
use base::{address::link, catalog::Code, token::Token};
use schemars::JsonSchema;
use serde::Serialize;
use service::{
    error::ApiError,
    verbs::tokens::{self as verbs, NewToken, TOKEN, TokensChanged},
};

use super::{
    content::json,
    headers::location,
    operation::{ADMIN, Operation, delete, get, post},
};
use crate::rest::{
    bodies::{self, TokenFields},
    call::Call,
};

pub(super) fn operations() -> Vec<Operation> {
    vec![
        post(ADMIN, "/v1/tokens", (), create_token)
            .rpcs(&["CreateToken"])
            .summary("Creates a token; its secret is in this answer and never shown again. Once there is a token, every request needs one")
            .body(json::<TokenFields>())
            .answers(201, "The token and its secret", json::<NewToken>())
            .with([location()])
            .fails(&[Code::InvalidProblem, Code::StorageFull]),
        get(ADMIN, "/v1/tokens", (), list_tokens)
            .rpcs(&["ListTokens"])
            .summary("Lists all tokens, without their secrets")
            .answers(200, "The tokens", json::<List>()),
        delete(ADMIN, "/v1/tokens/{token}", (TOKEN,), revoke_token)
            .rpcs(&["RevokeToken"])
            .summary("Revokes a token, which is refused from then on; it remains in the list")
            .answers(200, "The revoked token", json::<Token>())
            .fails(&[Code::StorageFull]),
        post(ADMIN, "/v1/tokens/{token}/rotate", (TOKEN,), rotate_token)
            .rpcs(&["RotateToken"])
            .summary("Gives a token a new secret; the old one is refused from then on")
            .answers(200, "The token and its new secret", json::<NewToken>())
            .fails(&[Code::StorageFull]),
    ]
}

/// All tokens.
#[derive(Serialize, JsonSchema)]
#[schemars(rename = "TokenList")]
struct List {
    /// The tokens, the oldest first, including those that are no longer valid.
    tokens: Vec<Token>,
}

async fn create_token(mut call: Call) -> Result<Response, ApiError> {
    let request = bodies::token(&call.json().await?)?;
    let new = verbs::create(&call.service.store, &call.caller, request).await?;
    let location = link(&format!("/v1/tokens/{}", new.token.id));
    let headers = [(header::LOCATION, location)];
    Ok((StatusCode::CREATED, headers, shown_once(new)).into_response())
}

async fn list_tokens(call: Call) -> Result<Json<List>, ApiError> {
    let tokens = verbs::list(&call.service.store, &call.caller);
    Ok(Json(List { tokens }))
}

async fn revoke_token(call: Call, id: String) -> Result<impl IntoResponse, ApiError> {
    let revoked = verbs::revoke(&call.service.store, &call.caller, &id).await?;
    Ok((Extension(TokensChanged), Json(revoked)))
}

async fn rotate_token(call: Call, id: String) -> Result<Response, ApiError> {
    let new = verbs::rotate(&call.service.store, &call.caller, &id).await?;
    Ok(shown_once(new).into_response())
}

/// Answers with a new token and its secret, which no cache on the way may store.
fn shown_once(new: NewToken) -> impl IntoResponse {
    let headers = [(header::CACHE_CONTROL, "no-store")];
    (Extension(TokensChanged), headers, Json(new))
}
