//! The operations on tokens.

use base::{catalog::Code, token::Token};
use service::verbs::tokens::{NewToken, TOKEN};

use super::{
    content::json,
    headers::location,
    operation::{ADMIN, Operation, delete, get, post},
};
use crate::rest::{bodies::TokenFields, tokens};

pub(super) fn operations() -> Vec<Operation> {
    vec![
        post(ADMIN, "/v1/tokens", (), tokens::create)
            .rpcs(&["CreateToken"])
            .summary("Creates a token; its secret is in this answer and never shown again. Once there is a token, every request needs one")
            .body(json::<TokenFields>())
            .answers(201, "The token and its secret", json::<NewToken>())
            .with([location()])
            .fails(&[Code::InvalidProblem, Code::StorageFull]),
        get(ADMIN, "/v1/tokens", (), tokens::list)
            .rpcs(&["ListTokens"])
            .summary("Lists all tokens, without their secrets")
            .answers(200, "The tokens", json::<tokens::List>()),
        delete(ADMIN, "/v1/tokens/{token}", (TOKEN,), tokens::revoke)
            .rpcs(&["RevokeToken"])
            .summary("Revokes a token, which is refused from then on; it remains in the list")
            .answers(200, "The revoked token", json::<Token>())
            .fails(&[Code::StorageFull]),
        post(ADMIN, "/v1/tokens/{token}/rotate", (TOKEN,), tokens::rotate)
            .rpcs(&["RotateToken"])
            .summary("Gives a token a new secret; the old one is refused from then on")
            .answers(200, "The token and its new secret", json::<NewToken>())
            .fails(&[Code::StorageFull]),
    ]
}
