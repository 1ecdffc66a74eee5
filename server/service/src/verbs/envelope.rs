//! The envelope of a submission: its fields other than the problem, and their violations.

use std::collections::BTreeMap;

use base::{
    job::{Cache, Limits, MAX_PRIORITY, MIN_PRIORITY},
    values::{Integers, Values},
};
use serde::Serialize;
use solver::{
    error::{Findings, Reason, Violation, escape, shortened},
    problem::Problem,
};

/// The largest number of characters of a name.
pub const MAX_NAME: usize = 256;
/// The largest number of labels of a job.
pub const MAX_LABELS: usize = 64;
/// The largest number of characters of a label's key or value.
pub const MAX_LABEL: usize = 256;
/// All allowed priorities.
pub const PRIORITIES: Integers = Integers(MIN_PRIORITY as i64..=MAX_PRIORITY as i64);
/// The longest time that a job may wait, in seconds: thirty days.
const MAX_QUEUE_TTL_S: f64 = 30.0 * 86_400.0;

/// The fields that a client submits in addition to the problem.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Envelope {
    /// A name for people.
    pub name: Option<String>,
    /// Labels for programs.
    pub labels: BTreeMap<String, String>,
    /// Jobs of higher priority run first.
    pub priority: i32,
    /// Time limits.
    pub limits: Limits,
    /// Whether earlier results may be used.
    pub cache: Cache,
}

/// A request for a job.
#[derive(Clone, Debug)]
pub struct JobRequest {
    /// The fields other than the problem.
    pub envelope: Envelope,
    /// The problem, or all its violations.
    pub problem: Result<Problem, Vec<Violation>>,
}

impl Envelope {
    /// The violations of the fields of this envelope. `max_timeout_s`: the longest time that a job may run, in seconds.
    pub(super) fn violations(&self, max_timeout_s: u32) -> Findings {
        let mut found = Findings::default();
        found.extend(self.name.as_deref().and_then(name_violation));
        found.extend(priority_violation(self.priority));
        found.extend(label_violations(&self.labels));
        let Limits {
            timeout_s,
            queue_ttl_s,
        } = self.limits;
        for (name, seconds, most) in [
            ("timeout_s", timeout_s, f64::from(max_timeout_s)),
            ("queue_ttl_s", queue_ttl_s, MAX_QUEUE_TTL_S),
        ] {
            if !(seconds > 0.0 && seconds <= most) {
                found.add(Violation {
                    pointer: format!("/limits/{name}"),
                    reason: Reason::OutOfRange,
                    got: seconds.to_string(),
                    expected: format!("more than 0, at most {most} seconds"),
                    hint: "Without this limit the default applies.".into(),
                });
            }
        }
        found
    }
}

/// The violation of an invalid name, for submissions and edits.
pub(super) fn name_violation(name: &str) -> Option<Violation> {
    let length = name.chars().count();
    (length > MAX_NAME).then(|| Violation {
        pointer: "/name".into(),
        reason: Reason::OutOfRange,
        got: format!("{length} characters"),
        expected: format!("at most {MAX_NAME} characters"),
        hint: "Shorten the name.".into(),
    })
}

/// The violation of an invalid priority.
pub(super) fn priority_violation(priority: i32) -> Option<Violation> {
    (!PRIORITIES.0.contains(&priority.into())).then(|| Violation {
        pointer: "/priority".into(),
        reason: Reason::OutOfRange,
        got: priority.to_string(),
        expected: PRIORITIES.expected(),
        hint: "Jobs of higher priority run first; 0 is usual.".into(),
    })
}

/// The violation of an edit that changes more labels than a job could lose and get.
pub(super) fn label_changes_violation(changes: usize) -> Option<Violation> {
    (changes > 2 * MAX_LABELS).then(|| Violation {
        pointer: "/labels".into(),
        reason: Reason::OutOfRange,
        got: changes.to_string(),
        expected: format!("changes of at most {} labels", 2 * MAX_LABELS),
        hint: "Change fewer labels at a time, or set null for all labels.".into(),
    })
}

/// The violations of invalid labels.
pub(super) fn label_violations(labels: &BTreeMap<String, String>) -> Vec<Violation> {
    let violation = |pointer: String, got: String, expected: String, hint: &str| Violation {
        pointer,
        reason: Reason::OutOfRange,
        got,
        expected,
        hint: hint.into(),
    };
    let mut found = vec![];
    if labels.len() > MAX_LABELS {
        found.push(violation(
            "/labels".into(),
            labels.len().to_string(),
            format!("at most {MAX_LABELS} labels"),
            "Remove some labels.",
        ));
    }
    for (key, value) in labels.iter().take(MAX_LABELS) {
        let pointer = || format!("/labels/{}", escape(&shortened(key, MAX_LABEL)));
        let length = key.chars().count();
        if length == 0 || length > MAX_LABEL {
            let got = format!("a key of {length} characters");
            let expected = format!("a key of 1 … {MAX_LABEL}");
            found.push(violation(pointer(), got, expected, "Choose another key."));
        }
        let length = value.chars().count();
        if length > MAX_LABEL {
            let got = format!("a value of {length} characters");
            let expected = format!("at most {MAX_LABEL}");
            found.push(violation(pointer(), got, expected, "Shorten the value."));
        }
    }
    found
}
