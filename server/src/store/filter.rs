//! Which jobs a list holds, and in what order.

use strum::{EnumString, IntoStaticStr, VariantArray};

use crate::{caller::Owners, job::Status, time::Time};

/// Which jobs; what is absent leaves none out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Filter {
    /// Of one of these statuses.
    pub statuses: Vec<Status>,
    /// Of this owner.
    pub owner: Option<String>,
    /// With all of these labels.
    pub labels: Vec<(String, String)>,
    /// Of exactly this name.
    pub name: Option<String>,
    /// With this input.
    pub input_hash: Option<String>,
    /// Accepted at this time or later.
    pub created_after: Option<Time>,
    /// Accepted before this time.
    pub created_before: Option<Time>,
    /// Ended at this time or later.
    pub finished_after: Option<Time>,
    /// Ended before this time.
    pub finished_before: Option<Time>,
}

impl Filter {
    /// Labels that a filter may name.
    pub const MOST_LABELS: usize = 64;

    /// The same filter with each status and label once.
    pub fn tidied(mut self) -> Self {
        self.statuses
            .sort_unstable_by_key(|status| <&str>::from(*status));
        self.statuses.dedup();
        self.labels.sort_unstable();
        self.labels.dedup();
        self
    }

    /// The same filter on the jobs of these owners; none if it asks for the jobs of another.
    pub(super) fn among(&self, owners: Owners<'_>) -> Option<Self> {
        let mut filter = self.clone();
        if let Owners::Only(owner) = owners {
            let asked = filter.owner.get_or_insert_with(|| owner.to_owned());
            if asked != owner {
                return None;
            }
        }
        Some(filter)
    }

    /// Leaves no job out.
    pub fn is_empty(&self) -> bool {
        *self == Filter::default()
    }
}

/// The order of a list; of equal times the order of arrival decides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Order {
    /// By which time.
    pub by: OrderBy,
    /// Latest first.
    pub descending: bool,
}

/// The time that orders a list; its word is the column.
#[derive(Clone, Copy, Debug, PartialEq, Eq, IntoStaticStr, EnumString, VariantArray)]
#[strum(serialize_all = "snake_case")]
pub enum OrderBy {
    /// When they were accepted.
    CreatedAt,
    /// When they ended; jobs that have not are left out.
    FinishedAt,
}

/// The last job of a page, after which the next one begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cursor {
    /// Its time in the list's order, in microseconds.
    pub micros: i64,
    /// Its number.
    pub key: i64,
}

/// What jobs are counted by; its word is the column.
#[derive(Clone, Copy, Debug, PartialEq, Eq, IntoStaticStr, EnumString, VariantArray)]
#[strum(serialize_all = "snake_case")]
pub enum GroupBy {
    /// Their status.
    Status,
    /// Their owner.
    Owner,
}

impl Order {
    /// Newest first.
    pub const NEWEST_FIRST: Order = Order {
        by: OrderBy::CreatedAt,
        descending: true,
    };

    /// `desc` or `asc`.
    pub fn direction(self) -> &'static str {
        if self.descending { "desc" } else { "asc" }
    }
}
