//! Operations of administrators on tokens: create, list and revoke a token, and replace its secret.

use std::{collections::BTreeSet, fmt, sync::Arc};

use base::{
    caller::{Caller, MAX_OWNER, Scope, is_owner},
    time::Time,
    token::{Secret, Token, new_id},
    values::Values,
};
use futures_util::future::BoxFuture;
use schemars::JsonSchema;
use serde::Serialize;
use solver::error::{Findings, Reason, Violation};
use store::Store;
use tracing::{info, warn};

use super::service::detached;
use crate::{error::ApiError, parameters::Variable};

/// The largest number of characters of a token's name.
pub const MAX_NAME: usize = 64;
/// The largest number of tokens that are valid at the same time.
pub const MAX_TOKENS: usize = 10_000;
/// The shortest time until a token expires (seconds).
pub const MIN_EXPIRES_IN_S: f64 = 60.0;
/// The longest time until a token expires (seconds): ten years.
pub const MAX_EXPIRES_IN_S: f64 = 10.0 * 366.0 * 86400.0;

/// The id of a token in a path.
pub const TOKEN: Variable<TokenIds> = Variable {
    name: "token",
    kind: "token",
    meaning: "The token, by its id",
    values: TokenIds,
};

/// The allowed values of the variable: all ids of tokens.
#[derive(Clone, Copy, Debug)]
pub struct TokenIds;

impl Values for TokenIds {
    type Value = String;

    fn schema(&self) -> serde_json::Value {
        serde_json::json!({ "type": "string", "pattern": "^[0-9a-f]{12}$" })
    }

    fn expected(&self) -> String {
        "12 digits from 0 to f, in lower case".into()
    }

    fn read(&self, text: &str) -> Option<String> {
        let digit = |byte: u8| matches!(byte, b'0'..=b'9' | b'a'..=b'f');
        (text.len() == 12 && text.bytes().all(digit)).then(|| text.to_owned())
    }
}

/// The request for a new token.
#[derive(Clone, Debug, Default)]
pub struct TokenRequest {
    /// A name for people, such as where the token is used.
    pub name: String,
    /// The owner of the jobs that are submitted with the token.
    pub owner: String,
    /// The scopes of the token.
    pub scopes: Vec<String>,
    /// The seconds until the token expires; absent: it does not expire.
    pub expires_in_s: Option<f64>,
}

/// A new token with its secret, which is shown only this once.
#[derive(Clone, Serialize, JsonSchema)]
pub struct NewToken {
    /// The token.
    pub token: Token,
    /// The secret that clients send as `Authorization: Bearer SECRET`. It is not stored, and cannot be shown again.
    pub secret: String,
}

impl fmt::Debug for NewToken {
    /// Formats the token without the secret.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "NewToken({:?})", self.token)
    }
}

/// A mark in the extensions of an answer whose request has changed tokens, perhaps the token of its own caller. The
/// answer is sent anyway, since it may have the only copy of a secret.
#[derive(Clone, Copy, Debug)]
pub struct TokensChanged;

/// Checks a request for a token; the error has all violations. `first`: there is no token yet.
fn checked(request: &TokenRequest, first: bool) -> Result<BTreeSet<Scope>, ApiError> {
    let mut found = Findings::default();
    let mut wrong = |pointer: &str, reason, got: &str, expected: String, hint: &str| {
        found.add(Violation::new(pointer, reason, got, expected, hint));
    };
    let length = request.name.chars().count();
    if !(1..=MAX_NAME).contains(&length) || request.name.chars().any(char::is_control) {
        wrong(
            "/name",
            Reason::OutOfRange,
            &format!("{length} characters"),
            format!("1 … {MAX_NAME} characters, none of them a control character"),
            "Name the place where the token is used, such as laptop or nightly study.",
        );
    }
    if !is_owner(&request.owner) {
        wrong(
            "/owner",
            Reason::OutOfRange,
            &format!("{:?}", request.owner),
            format!("1 … {MAX_OWNER} of the characters A-Z a-z 0-9 . _ @ + -"),
            "The name of the person, or of the program, that submits jobs with the token.",
        );
    }
    let mut scopes = BTreeSet::new();
    for (n, word) in request.scopes.iter().enumerate() {
        match word.parse() {
            Ok(scope) => {
                scopes.insert(scope);
            }
            Err(_) => wrong(
                &format!("/scopes/{n}"),
                Reason::UnknownName,
                &format!("{word:?}"),
                "read, submit, cancel or admin".into(),
                "The scope admin includes the other scopes, for the jobs of all owners.",
            ),
        }
    }
    if request.scopes.is_empty() {
        wrong(
            "/scopes",
            Reason::Missing,
            "none",
            "one or more of read, submit, cancel and admin".into(),
            "read, submit and cancel are for users; admin also creates tokens and pauses the queue.",
        );
    } else if first && !scopes.contains(&Scope::Admin) {
        wrong(
            "/scopes",
            Reason::Missing,
            &request.scopes.join(", "),
            "admin, since this is the first token".into(),
            "Once there is a token every request needs one, and without the scope admin nobody could create another.",
        );
    }
    if let Some(seconds) = request.expires_in_s
        && !(MIN_EXPIRES_IN_S..=MAX_EXPIRES_IN_S).contains(&seconds)
    {
        wrong(
            "/expires_in_s",
            Reason::OutOfRange,
            &seconds.to_string(),
            format!("{MIN_EXPIRES_IN_S} … {MAX_EXPIRES_IN_S} seconds"),
            "Without expires_in_s the token does not expire.",
        );
    }
    found.into_result(scopes).map_err(ApiError::InvalidProblem)
}

/// Creates a token. After the first one, the service refuses requests without a token.
pub fn create<'a>(
    store: &'a Arc<Store>,
    caller: &'a Caller,
    request: TokenRequest,
) -> BoxFuture<'a, Result<NewToken, ApiError>> {
    Box::pin(async move {
        let now = Time::of_the_machine();
        let scopes = checked(&request, !store.has_tokens())?;
        let valid = store.tokens().iter().filter(|t| t.is_valid(now)).count();
        if valid >= MAX_TOKENS {
            return Err(ApiError::InvalidProblem(vec![Violation::new(
                "",
                Reason::TooMany,
                format!("{valid} valid tokens"),
                format!("at most {MAX_TOKENS}"),
                "Revoke tokens that are no longer used, or let tokens expire.",
            )]));
        }
        let id = new_id().map_err(ApiError::internal)?;
        let (secret, hash) = Secret::new(&id).map_err(ApiError::internal)?;
        let token = Token {
            id,
            name: request.name,
            owner: request.owner,
            scopes,
            created_at: now,
            expires_at: request.expires_in_s.map(|seconds| now.after_s(seconds)),
            revoked_at: None,
        };
        let (store, by) = (store.clone(), caller.owner().to_owned());
        detached(async move {
            store.insert_token(&token, hash).await?;
            let Token { id, owner, .. } = &token;
            info!(
                token.id = id,
                owner, by, "token {id} of {owner} was created by {by}"
            );
            Ok(NewToken {
                token,
                secret: secret.reveal(),
            })
        })
        .await
    })
}

/// Lists all tokens, the oldest first, including tokens that are no longer valid.
pub fn list(store: &Store, _caller: &Caller) -> Vec<Token> {
    store.tokens()
}

/// Revokes a token, which is refused from now on; streams that it has opened end.
pub fn revoke<'a>(
    store: &'a Arc<Store>,
    caller: &'a Caller,
    id: &'a str,
) -> BoxFuture<'a, Result<Token, ApiError>> {
    Box::pin(async move {
        let (store, by, id) = (store.clone(), caller.owner().to_owned(), id.to_owned());
        detached(async move {
            let now = Time::of_the_machine();
            let revoked = store.revoke_token(&id, now).await?;
            let token = revoked.ok_or_else(|| unknown(&id))?;
            info!(token.id = id, by, "token {id} was revoked by {by}");
            let is_admin = |token: &Token| token.is_valid(now) && token.scopes.contains(&Scope::Admin);
            if token.scopes.contains(&Scope::Admin) && !store.tokens().iter().any(is_admin) {
                warn!(
                    "no valid token has the scope admin: stop the service, and create one with `signorini token create \
                     --scope admin`"
                );
            }
            Ok(token)
        })
        .await
    })
}

/// Gives a token a new secret; the old secret is refused from now on.
pub fn rotate<'a>(
    store: &'a Arc<Store>,
    caller: &'a Caller,
    id: &'a str,
) -> BoxFuture<'a, Result<NewToken, ApiError>> {
    Box::pin(async move {
        let (store, by, id) = (store.clone(), caller.owner().to_owned(), id.to_owned());
        let (secret, hash) = Secret::new(&id).map_err(ApiError::internal)?;
        detached(async move {
            let rotated = store
                .rotate_token(&id, hash, Time::of_the_machine())
                .await?;
            let token = rotated
                .ok_or_else(|| ApiError::NotFound(format!("there is no valid token {id}")))?;
            info!(token.id = id, by, "token {id} has a new secret, by {by}");
            Ok(NewToken {
                token,
                secret: secret.reveal(),
            })
        })
        .await
    })
}

fn unknown(id: &str) -> ApiError {
    ApiError::NotFound(format!("there is no token {id}"))
}
