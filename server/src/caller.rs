//! The caller of a request: its owner name, its scopes, and whose jobs it sees.

use std::collections::BTreeSet;

use schemars::JsonSchema;
use serde::Serialize;
use strum::VariantArray;

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
    JsonSchema,
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
    /// Cancel and delete them.
    Cancel,
    /// All of these on the jobs of every owner, and pause the queue.
    Admin,
}

/// The caller of a request; every verb takes one.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Caller {
    /// The owner of the jobs that this caller submits.
    owner: String,
    /// What this caller may do.
    scopes: BTreeSet<Scope>,
}

impl Caller {
    /// A caller of that name, with these scopes.
    pub fn new(owner: impl Into<String>, scopes: impl IntoIterator<Item = Scope>) -> Caller {
        Caller {
            owner: owner.into(),
            scopes: scopes.into_iter().collect(),
        }
    }

    /// The caller of every request as long as there is no authentication: one owner, with all scopes.
    pub fn local() -> Caller {
        Caller::new("local", Scope::VARIANTS.iter().copied())
    }

    /// The owner of what this caller submits.
    pub fn owner(&self) -> &str {
        &self.owner
    }

    /// What this caller may do.
    pub fn scopes(&self) -> impl Iterator<Item = Scope> {
        self.scopes.iter().copied()
    }

    /// The owners whose jobs this caller sees.
    pub fn visible_owners(&self) -> Owners<'_> {
        match self.scopes.contains(&Scope::Admin) {
            true => Owners::All,
            false => Owners::Only(&self.owner),
        }
    }
}

/// The owners whose jobs a query to the store is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Owners<'a> {
    /// Every owner.
    All,
    /// This owner.
    Only(&'a str),
}

impl Owners<'_> {
    /// Whether `owner` is one of them.
    pub fn include(self, owner: &str) -> bool {
        match self {
            Owners::All => true,
            Owners::Only(only) => only == owner,
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
        assert_eq!(ada.visible_owners(), Owners::Only("ada"));
        assert!(ada.visible_owners().include("ada") && !ada.visible_owners().include("bob"));
        assert!(local.visible_owners().include("bob"));
    }
}
