//! What is submitted beside a problem, and its violations.

use std::collections::BTreeMap;

use serde::Serialize;
use solver::{
    error::{Findings, Reason, Violation, escape, shortened},
    problem::Problem,
};

use crate::{
    job::{Cache, Limits, MAX_PRIORITY, MIN_PRIORITY},
    parameters::{Integers, Values},
};

/// Characters of the longest name.
pub const MAX_NAME: usize = 256;
/// Most labels of a job.
pub const MAX_LABELS: usize = 64;
/// Characters of the longest key or value of a label.
pub const MAX_LABEL: usize = 256;
/// All priorities.
pub const PRIORITIES: Integers = Integers(MIN_PRIORITY as i64..=MAX_PRIORITY as i64);
/// Longest time that a job may run, in seconds: a week.
const MAX_TIMEOUT_S: f64 = 7.0 * 86_400.0;
/// Longest time that it may wait: thirty days.
const MAX_QUEUE_TTL_S: f64 = 30.0 * 86_400.0;

/// What a client submits beside the problem.
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
    /// What comes beside the problem.
    pub envelope: Envelope,
    /// The problem, or all that is wrong with it.
    pub problem: Result<Problem, Vec<Violation>>,
}

impl Envelope {
    /// What is out of bounds.
    pub(super) fn violations(&self) -> Findings {
        let mut found = Findings::default();
        found.extend(self.name.as_deref().and_then(name_violation));
        found.extend(priority_violation(self.priority));
        found.extend(label_violations(&self.labels));
        let Limits {
            timeout_s,
            queue_ttl_s,
        } = self.limits;
        for (name, seconds, most) in [
            ("timeout_s", timeout_s, MAX_TIMEOUT_S),
            ("queue_ttl_s", queue_ttl_s, MAX_QUEUE_TTL_S),
        ] {
            if !(seconds > 0.0 && seconds <= most) {
                found.add(Violation {
                    pointer: format!("/limits/{name}"),
                    reason: Reason::OutOfRange,
                    got: seconds.to_string(),
                    expected: format!("more than 0, at most {most} seconds"),
                    hint: "Leave it out for the default.".into(),
                });
            }
        }
        found
    }
}

/// What is wrong with a name, as an envelope and an edit have one.
pub(super) fn name_violation(name: &str) -> Option<Violation> {
    let length = name.chars().count();
    (length > MAX_NAME).then(|| Violation {
        pointer: "/name".into(),
        reason: Reason::OutOfRange,
        got: format!("{length} characters"),
        expected: format!("at most {MAX_NAME} characters"),
        hint: "Shorten it.".into(),
    })
}

/// What is wrong with a priority.
pub(super) fn priority_violation(priority: i32) -> Option<Violation> {
    (!PRIORITIES.0.contains(&priority.into())).then(|| Violation {
        pointer: "/priority".into(),
        reason: Reason::OutOfRange,
        got: priority.to_string(),
        expected: PRIORITIES.expected(),
        hint: "Higher runs first; 0 is usual.".into(),
    })
}

/// What is wrong with labels.
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
            "Leave some out.",
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
            found.push(violation(pointer(), got, expected, "Shorten it."));
        }
    }
    found
}
