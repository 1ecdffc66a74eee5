//! Which jobs a list contains, and in what order.

use strum::{EnumString, IntoStaticStr, VariantArray};

use crate::{
    caller::Owners,
    job::{Status, SweepId},
    time::Time,
};

/// Conditions on jobs; absent ones match every job.
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
    /// Of this sweep.
    pub sweep: Option<SweepId>,
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
    /// Most labels in one filter.
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

    /// The same filter restricted to these owners; `None` if it requests the jobs of another.
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

    /// It matches every job.
    pub fn is_empty(&self) -> bool {
        *self == Filter::default()
    }
}

/// The order of a list; jobs of equal times are in order of arrival.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Order {
    /// The time to sort by.
    pub by: OrderBy,
    /// Latest first.
    pub descending: bool,
}

/// The time that orders a list; its name is that of the column.
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
    /// Its key.
    pub key: i64,
}

/// What jobs are grouped by; its name is that of the column.
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
