//! The caller of a request: its owner name, its scopes, and the owners whose jobs it can see.

use std::{collections::BTreeSet, net::IpAddr, sync::Arc};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use strum::VariantArray;

use crate::trace::Trace;

/// What a caller may do.
#[derive(
    Clone,
    Copy,
    Debug,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    Serialize,
    Deserialize,
    JsonSchema,
    strum::EnumString,
    strum::IntoStaticStr,
    strum::VariantArray,
)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum Scope {
    /// Get and list jobs, results and meshes.
    Read,
    /// Submit jobs, upload meshes.
    Submit,
    /// Cancel and delete jobs, delete meshes.
    Cancel,
    /// Solve the jobs of every owner as a worker elsewhere: receive their problems, and report their results.
    Work,
    /// All of the other scopes for the jobs of every owner; also pause the queue, manage tokens, and give priorities
    /// above 0.
    Admin,
}

/// The address that a request comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Peer(pub IpAddr);

/// Who may use an operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Everyone, without authentication.
    Open,
    /// Every caller who is authenticated.
    Identified,
    /// Callers with this scope, and those with the scope `admin`.
    Needs(Scope),
}

impl Access {
    /// The name for people and programs: `open`, `identified`, or the scope.
    pub fn name(self) -> &'static str {
        match self {
            Access::Open => "open",
            Access::Identified => "identified",
            Access::Needs(scope) => scope.into(),
        }
    }
}

/// The caller of a request; every operation of the service takes one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Caller {
    /// The owner of the jobs that this caller submits.
    owner: String,
    /// The scopes of this caller.
    scopes: BTreeSet<Scope>,
    /// The trace that the request belongs to.
    trace: Option<Trace>,
    /// The name of the request in the log.
    request: Option<RequestId>,
}

/// The name of a request in the log and in the response.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RequestId(pub String);

impl Caller {
    /// A caller with this name and these scopes.
    pub fn new(owner: impl Into<String>, scopes: impl IntoIterator<Item = Scope>) -> Caller {
        Caller {
            owner: owner.into(),
            scopes: scopes.into_iter().collect(),
            trace: None,
            request: None,
        }
    }

    /// The caller of every request to a service without authentication: one owner, with all scopes.
    pub fn local() -> Caller {
        Caller::new(LOCAL, Scope::VARIANTS.iter().copied())
    }

    /// A caller who is not authenticated, and may use open operations only.
    pub fn anonymous() -> Caller {
        Caller::new("", [])
    }

    /// The same caller with the trace and the name of a request.
    pub fn asking(self, trace: Option<Trace>, request: Option<RequestId>) -> Caller {
        Caller {
            trace,
            request,
            ..self
        }
    }

    /// The name of the caller's request.
    pub fn request_id(&self) -> Option<&str> {
        self.request.as_ref().map(|RequestId(id)| id.as_str())
    }

    /// The trace of the caller's request.
    pub fn trace(&self) -> Option<&Trace> {
        self.trace.as_ref()
    }

    /// Whether this caller may use operations that need this scope.
    pub fn may(&self, scope: Scope) -> bool {
        self.scopes.contains(&scope) || self.is_admin()
    }

    /// Whether this caller may do everything, with the jobs of every owner.
    pub fn is_admin(&self) -> bool {
        self.scopes.contains(&Scope::Admin)
    }

    /// The owner of what this caller submits.
    pub fn owner(&self) -> &str {
        &self.owner
    }

    /// The scopes of this caller.
    pub fn scopes(&self) -> impl Iterator<Item = Scope> {
        self.scopes.iter().copied()
    }

    /// The owners whose jobs this caller sees.
    pub fn visible_owners(&self) -> Owners {
        if self.is_admin() {
            Owners::All
        } else {
            Owners::Only(self.owner.as_str().into())
        }
    }
}

/// The owner of everything that is submitted to a service without authentication.
pub const LOCAL: &str = "local";

/// The largest length of an owner's name.
pub const MAX_OWNER: usize = 64;

/// Whether a text is allowed as the name of an owner: it is used in URLs, logs and headers.
pub fn is_owner(name: &str) -> bool {
    let allowed = |byte: u8| byte.is_ascii_alphanumeric() || b"._@+-".contains(&byte);
    (1..=MAX_OWNER).contains(&name.len()) && name.bytes().all(allowed)
}

/// The owners whose jobs a query to the store is about.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Owners {
    /// Every owner.
    All,
    /// This owner.
    Only(Arc<str>),
}

impl Owners {
    /// Whether `owner` is one of these owners.
    pub fn include(&self, owner: &str) -> bool {
        match self {
            Owners::All => true,
            Owners::Only(only) => **only == *owner,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_caller_who_is_not_an_administrator_sees_only_their_own_jobs() {
        let local = Caller::local();
        assert_eq!(local.visible_owners(), Owners::All);
        let ada = Caller::new("ada", [Scope::Read, Scope::Submit]);
        assert_eq!(ada.visible_owners(), Owners::Only("ada".into()));
        assert!(ada.visible_owners().include("ada") && !ada.visible_owners().include("bob"));
        assert!(local.visible_owners().include("bob"));
    }

    #[test]
    fn a_scope_allows_itself_and_admin_allows_all() {
        let ada = Caller::new("ada", [Scope::Read, Scope::Submit]);
        assert!(ada.may(Scope::Read) && ada.may(Scope::Submit));
        assert!(!ada.may(Scope::Cancel) && !ada.may(Scope::Admin));
        let root = Caller::new("root", [Scope::Admin]);
        assert!(Scope::VARIANTS.iter().all(|scope| root.may(*scope)));
        assert!(
            !Scope::VARIANTS
                .iter()
                .any(|scope| Caller::anonymous().may(*scope))
        );
    }
}
