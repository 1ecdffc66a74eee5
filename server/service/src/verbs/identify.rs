//! Identifies the caller of a request: by a token, or by the user header of a trusted proxy; if the service needs
//! neither, all callers are taken for one.

use base::{
    caller::{Caller, LOCAL, Peer, is_owner},
    time::Time,
    token::{Presented, Token},
};
use store::Store;

use crate::{config::ProxyTrust, error::ApiError};

/// The credentials of a request.
#[derive(Clone, Debug, Default)]
pub struct Credentials {
    /// The token, if one was sent; `Err` if the text that was sent is not a token.
    pub token: Option<Result<Presented, ()>>,
    /// The users named by the header of a proxy; more than one is an error.
    pub users: Vec<String>,
    /// The tokens in the cookies of a browser, which may have several of other services at the same host.
    pub cookies: Vec<Presented>,
}

/// A caller, and the kind of identification.
#[derive(Clone, Debug)]
pub struct Identified {
    /// The caller.
    pub caller: Caller,
    /// The kind of identification.
    pub by: By,
}

/// The kind of identification of a caller.
#[derive(Clone, Debug)]
pub enum By {
    /// A token.
    Token(Presented),
    /// The header of a trusted proxy.
    Proxy,
    /// Nothing, since the service needs no token.
    NoTokensNeeded,
    /// Nothing, since the operation is open to everyone.
    OpenOperation,
}

impl By {
    /// Whether the identification is still valid.
    pub fn is_valid(&self, store: &Store) -> bool {
        match self {
            By::Token(Presented { id, hash }) => {
                store.is_valid_token(id, Some(*hash), Time::of_the_machine())
            }
            By::NoTokensNeeded => !store.has_tokens(),
            By::Proxy | By::OpenOperation => true,
        }
    }
}

/// The first valid token in the cookies of a browser. What else stands in `Authorization`, such as the password for a proxy, does
/// not hide it; a token does.
fn of_cookies<'a>(store: &Store, credentials: &'a Credentials) -> Option<(&'a Presented, Token)> {
    let now = Time::of_the_machine();
    let cookies = credentials.cookies.iter();
    let mut valid = cookies.filter_map(|sent| Some((sent, store.find_token(sent, now)?)));
    valid.next()
}

/// Identifies the caller of a request from `peer`; the error says why there is none.
pub fn identify(
    store: &Store,
    trust: &ProxyTrust,
    peer: Option<Peer>,
    credentials: &Credentials,
) -> Result<Identified, ApiError> {
    const UNKNOWN: &str = "the token is unknown, was revoked or has expired";
    if let Some(Ok(presented)) = &credentials.token {
        let token = store.find_token(presented, Time::of_the_machine());
        let token = token.ok_or(ApiError::Unauthenticated(UNKNOWN))?;
        return Ok(Identified {
            caller: token.caller(),
            by: By::Token(presented.clone()),
        });
    }
    // one that is not valid is as none: it may be that of another service at this host
    if let Some((presented, token)) = of_cookies(store, credentials) {
        return Ok(Identified {
            caller: token.caller(),
            by: By::Token(presented.clone()),
        });
    }
    if peer.is_some_and(|Peer(address)| trust.includes(address)) {
        match &credentials.users[..] {
            [user] if user == LOCAL => {
                return Err(ApiError::Unauthenticated(
                    "the proxy names the user local, which is everybody's name on a service without tokens",
                ));
            }
            [user] if is_owner(user) => {
                return Ok(Identified {
                    caller: trust.caller(user),
                    by: By::Proxy,
                });
            }
            [] => {}
            [..] => {
                return Err(ApiError::Unauthenticated(
                    "the proxy does not name one user in the characters A-Z a-z 0-9 . _ @ + -",
                ));
            }
        }
    }
    // what is not a token may be what a proxy asks for, but of nobody else
    if credentials.token.is_some() {
        return Err(ApiError::Unauthenticated(UNKNOWN));
    }
    if store.has_tokens() || trust.names_users() {
        Err(ApiError::Unauthenticated(
            "this service needs a token: send it as `Authorization: Bearer TOKEN`",
        ))
    } else {
        Ok(Identified {
            caller: Caller::local(),
            by: By::NoTokensNeeded,
        })
    }
}
