//! Filters and orders of lists of jobs. The filters are defined here, in `job_filters`; REST, gRPC, the command line
//! and the documentation use this definition.

use base::{
    caller::Owners,
    id::Ids,
    job::{JobId, Status, SweepId},
    time::Time,
    values::{Text, Times, Values, Words},
};
use rusqlite::types::Value;
use solver::solution::{Verdict, WarningCode};
use strum::{EnumString, IntoStaticStr, VariantArray};

/// All filters except the one by labels, whose name in requests depends on the label. Each line has the field of
/// [`Filter`], its type, the name in requests (that of the field in the proto), the column and the comparison
/// (`Comparison`), the
/// index that lists the jobs of a value in order of arrival, if there is one, and the meaning. `$use` is a macro that
/// receives the lines.
#[macro_export]
macro_rules! job_filters {
    ($use:ident) => {
        $use! {
            statuses: Vec<Status>, status, "status" "=", Some("job_by_status"),
                "Only jobs with this status; several may be given";
            ids: Vec<JobId>, id, "uuid" "=", None, "Only jobs with this id; several may be given";
            owner: Option<String>, owner, "owner" "=", Some("job_by_owner"), "Only jobs of this owner";
            name: Option<String>, name, "name" "=", Some("job_by_name"), "Only jobs with this name";
            name_contains: Option<String>, name_contains, "name" "contains", None,
                "Only jobs whose name contains this text, whatever the case of the letters A to Z";
            text: Option<String>, text, "name" "mentions", None,
                "Only jobs that have this text in their name, title, owner, id or labels, whatever the case of the letters A to Z";
            verdicts: Vec<Verdict>, verdict, "verdict" "=", Some("job_by_verdict"),
                "Only jobs with this verdict on their result; several may be given";
            warnings: Vec<WarningCode>, warning, "warnings" "has", None,
                "Only jobs that have one of these warnings among the five worst; several may be given";
            parent: Option<JobId>, parent, "parent" "=", None, "Only jobs that retry this job";
            pinned: Option<bool>, pinned, "pinned" "=", None, "Only jobs that are kept permanently (true), or the others (false)";
            input_hash: Option<String>, input_hash, "input_hash" "=", Some("job_by_input"),
                "Only jobs with this fingerprint of the problem";
            sweep: Option<SweepId>, sweep, "sweep" "=", Some("job_by_sweep"), "Only jobs of this sweep";
            created_after: Option<Time>, created_after, "created_at" ">=", None,
                "Only jobs accepted at this time or later";
            created_before: Option<Time>, created_before, "created_at" "<", None,
                "Only jobs accepted before this time";
            finished_after: Option<Time>, finished_after, "finished_at" ">=", None,
                "Only jobs that ended at this time or later";
            finished_before: Option<Time>, finished_before, "finished_at" "<", None,
                "Only jobs that ended before this time";
        }
    };
}

macro_rules! define {
    ($($field:ident: $type:ty, $name:ident, $column:literal $comparison:literal, $index:expr, $meaning:literal;)*) => {
        /// The conditions of a list on its jobs; absent conditions match every job.
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct Filter {
            $(#[doc = $meaning] pub $field: $type,)*
            /// Only jobs with all of these labels.
            pub labels: Vec<(String, String)>,
            /// Only jobs with none of these labels.
            pub excluded_labels: Vec<(String, String)>,
        }

        /// All filters except the one by labels.
        pub const FILTERS: &[Field] = &[$(Field {
            name: stringify!($name),
            meaning: $meaning,
            several: <$type as Criterion>::SEVERAL,
            schema: || <$type as Criterion>::Value::allowed().schema(),
            expected: || <$type as Criterion>::Value::allowed().expected(),
            set: |filter, text| filter.$field.set(text),
            column: $column,
            comparison: Comparison::of($comparison),
            index: $index,
            values: |filter| filter.$field.stored(),
        }),*];
    };
}
job_filters!(define);

/// A filter: its name and description, how its values are read, and its condition.
#[derive(Clone, Copy, Debug)]
pub struct Field {
    /// The name of the filter in requests.
    pub name: &'static str,
    /// The condition in words: one line, without a full stop.
    pub meaning: &'static str,
    /// Whether several values may be given: jobs with any of them match.
    pub several: bool,
    /// The JSON Schema of a value.
    pub schema: fn() -> serde_json::Value,
    /// The possible values in words.
    pub expected: fn() -> String,
    /// Adds the value that this text stands for; false if the text is not allowed.
    pub set: fn(&mut Filter, &str) -> bool,
    pub(super) column: &'static str,
    pub(super) comparison: Comparison,
    pub(super) index: Option<&'static str>,
    /// The values in a filter, in the form in which the column has them.
    pub(super) values: fn(&Filter) -> Vec<Value>,
}

/// How a filter compares the column of a job with its values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Comparison {
    /// The column is one of the values: `=`.
    Is,
    /// The column is the value or later: `>=`.
    From,
    /// The column is before the value: `<`.
    Before,
    /// The text of the column contains the value: `contains`.
    Contains,
    /// One of the columns in which people look for a text contains the value: `mentions`.
    Mentions,
    /// The JSON of the column has one of the values as a `code`: `has`.
    HasCode,
}

impl Comparison {
    const fn of(word: &str) -> Comparison {
        match word.as_bytes() {
            b"=" => Comparison::Is,
            b">=" => Comparison::From,
            b"<" => Comparison::Before,
            b"contains" => Comparison::Contains,
            b"mentions" => Comparison::Mentions,
            _ => Comparison::HasCode,
        }
    }
}

/// The type of a filter's values.
trait Asked: Sized {
    fn allowed() -> impl Values<Value = Self>;

    fn stored(&self) -> Value;
}

impl Asked for Status {
    fn allowed() -> impl Values<Value = Self> {
        Words::all()
    }

    fn stored(&self) -> Value {
        Value::Text(<&str>::from(*self).to_owned())
    }
}

impl Asked for Verdict {
    fn allowed() -> impl Values<Value = Self> {
        Words::all()
    }

    fn stored(&self) -> Value {
        Value::Text(<&str>::from(*self).to_owned())
    }
}

impl Asked for WarningCode {
    fn allowed() -> impl Values<Value = Self> {
        Words::all()
    }

    fn stored(&self) -> Value {
        Value::Text(format!("\"code\":\"{}\"", self.as_str()))
    }
}

impl Asked for bool {
    fn allowed() -> impl Values<Value = Self> {
        Words(|| vec![("false", false), ("true", true)])
    }

    fn stored(&self) -> Value {
        Value::Integer(i64::from(*self))
    }
}

impl Asked for JobId {
    fn allowed() -> impl Values<Value = Self> {
        Ids::all()
    }

    fn stored(&self) -> Value {
        Value::Text(self.0.to_string())
    }
}

impl Asked for String {
    fn allowed() -> impl Values<Value = Self> {
        Text
    }

    fn stored(&self) -> Value {
        Value::Text(self.clone())
    }
}

impl Asked for SweepId {
    fn allowed() -> impl Values<Value = Self> {
        Ids::all()
    }

    fn stored(&self) -> Value {
        Value::Text(self.0.to_string())
    }
}

impl Asked for Time {
    fn allowed() -> impl Values<Value = Self> {
        Times
    }

    fn stored(&self) -> Value {
        Value::Integer(self.micros())
    }
}

/// The field of a filter that holds its values: one, or several.
trait Criterion {
    type Value: Asked;
    const SEVERAL: bool;

    fn add(&mut self, value: Self::Value);

    fn values(&self) -> &[Self::Value];

    fn set(&mut self, text: &str) -> bool {
        let value = Self::Value::allowed().read(text);
        value.map(|value| self.add(value)).is_some()
    }

    fn stored(&self) -> Vec<Value> {
        self.values().iter().map(Asked::stored).collect()
    }
}

impl<T: Asked> Criterion for Option<T> {
    type Value = T;
    const SEVERAL: bool = false;

    fn add(&mut self, value: T) {
        *self = Some(value);
    }

    fn values(&self) -> &[T] {
        self.as_slice()
    }
}

impl<T: Asked> Criterion for Vec<T> {
    type Value = T;
    const SEVERAL: bool = true;

    fn add(&mut self, value: T) {
        self.push(value);
    }

    fn values(&self) -> &[T] {
        self
    }
}

impl Filter {
    /// The largest number of ids in one filter.
    pub const MOST_IDS: usize = 1000;
    /// The largest number of labels in one filter.
    pub const MOST_LABELS: usize = 64;

    /// This filter with each of its statuses and labels once.
    pub fn tidied(mut self) -> Self {
        self.statuses
            .sort_unstable_by_key(|status| <&str>::from(*status));
        self.statuses.dedup();
        self.ids.sort_unstable_by_key(|id| id.0);
        self.ids.dedup();
        self.verdicts.sort_unstable();
        self.verdicts.dedup();
        self.warnings.sort_unstable_by_key(|code| code.as_str());
        self.warnings.dedup();
        for labels in [&mut self.labels, &mut self.excluded_labels] {
            labels.sort_unstable();
            labels.dedup();
        }
        self
    }

    /// This filter restricted to the jobs of these owners; `None` if it requests the jobs of an owner who is not one of
    /// them.
    pub(super) fn among(&self, owners: &Owners) -> Option<Self> {
        let mut filter = self.clone();
        if let Owners::Only(owner) = owners {
            let asked = filter.owner.get_or_insert_with(|| owner.to_string());
            if **asked != **owner {
                return None;
            }
        }
        Some(filter)
    }

    /// Whether the filter matches every job.
    pub fn is_empty(&self) -> bool {
        *self == Filter::default()
    }
}

/// The order of a list; jobs of equal times are in order of arrival.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Order {
    /// The time to sort by.
    pub by: OrderBy,
    /// Whether the latest or longest time is first.
    pub descending: bool,
}

/// The time that orders a list. The name of the variant is that of the field of a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq, IntoStaticStr, EnumString, VariantArray)]
#[strum(serialize_all = "snake_case")]
pub enum OrderBy {
    /// When the jobs were accepted.
    CreatedAt,
    /// When the jobs ended; jobs that have not ended are left out.
    FinishedAt,
    /// How long the jobs have run; jobs that have not ended, or never started, are left out.
    RunS,
}

impl OrderBy {
    /// The expression that orders the rows, and the index that has it for the jobs that satisfy the condition.
    pub(super) fn sql(self) -> (&'static str, &'static str, &'static str) {
        match self {
            OrderBy::CreatedAt => ("job.created_at", "job_by_created", "true"),
            OrderBy::FinishedAt => (
                "job.finished_at",
                "job_by_finished",
                "job.finished_at is not null",
            ),
            OrderBy::RunS => (
                "(job.finished_at - job.started_at)",
                "job_by_run_time",
                "job.finished_at is not null and job.started_at is not null",
            ),
        }
    }
}

/// The last job of a page, after which the next one begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cursor {
    /// The time of the last job by which the list is ordered, as a point in time or a duration (µs).
    pub micros: i64,
    /// The key of the last job.
    pub key: i64,
}

/// The property by which jobs are counted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum GroupBy {
    /// The status of the jobs.
    Status,
    /// The owner of the jobs.
    Owner,
    /// The verdict on their results; `none` for jobs without one.
    Verdict,
    /// The keys of their labels: a job counts for each of its labels.
    LabelKeys,
    /// The values of the labels with this key.
    Label(String),
}

impl GroupBy {
    /// The largest number of groups, those with the most jobs: each job may have a label of its own.
    pub const MOST: i64 = 1000;

    /// Whether every job belongs to exactly one group.
    pub fn is_partition(&self) -> bool {
        !matches!(self, GroupBy::LabelKeys | GroupBy::Label(_))
    }
}

impl Order {
    /// Jobs by the time of acceptance, newest first.
    pub const NEWEST_FIRST: Order = Order {
        by: OrderBy::CreatedAt,
        descending: true,
    };

    /// Jobs by the time of acceptance, in order of arrival.
    pub const OLDEST_FIRST: Order = Order {
        by: OrderBy::CreatedAt,
        descending: false,
    };

    /// Whether the place `one` comes before the place `other` in a list of this order.
    pub(super) fn is_before(self, one: Cursor, other: Cursor) -> bool {
        let (one, other) = ((one.micros, one.key), (other.micros, other.key));
        if self.descending {
            one > other
        } else {
            one < other
        }
    }

    /// The direction in SQL: `desc` or `asc`.
    pub fn direction(self) -> &'static str {
        if self.descending { "desc" } else { "asc" }
    }
}
