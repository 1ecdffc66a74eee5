//! What is submitted beside a problem, and its violations.

use std::collections::BTreeMap;

use serde::Serialize;
use solver::{
    error::{Violation, escape},
    problem::Problem,
};

use crate::{
    job::{Cache, Limits},
    violations::{Violations, shortened},
};

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
    pub(super) fn violations(&self) -> Violations {
        let mut found = Violations::default();
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
                    reason: "out_of_range".into(),
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
    const MOST: usize = 256;
    let length = name.chars().count();
    (length > MOST).then(|| Violation {
        pointer: "/name".into(),
        reason: "out_of_range".into(),
        got: format!("{length} characters"),
        expected: "at most 256 characters".into(),
        hint: "Shorten it.".into(),
    })
}

/// What is wrong with a priority.
pub(super) fn priority_violation(priority: i32) -> Option<Violation> {
    (!(-10..=10).contains(&priority)).then(|| Violation {
        pointer: "/priority".into(),
        reason: "out_of_range".into(),
        got: priority.to_string(),
        expected: "-10 … 10".into(),
        hint: "Higher runs first; 0 is usual.".into(),
    })
}

/// What is wrong with labels.
pub(super) fn label_violations(labels: &BTreeMap<String, String>) -> Vec<Violation> {
    const MOST: usize = 256; // characters of a key or value
    const LABELS: usize = 64;
    let violation = |pointer: String, got: String, expected: &str, hint: &str| Violation {
        pointer,
        reason: "out_of_range".into(),
        got,
        expected: expected.into(),
        hint: hint.into(),
    };
    let mut found = vec![];
    if labels.len() > LABELS {
        found.push(violation(
            "/labels".into(),
            labels.len().to_string(),
            "at most 64 labels",
            "Leave some out.",
        ));
    }
    for (key, value) in labels.iter().take(LABELS) {
        let pointer = || format!("/labels/{}", escape(&shortened(key, MOST)));
        let length = key.chars().count();
        if length == 0 || length > MOST {
            let (got, hint) = (
                format!("a key of {length} characters"),
                "Name it otherwise.",
            );
            found.push(violation(pointer(), got, "a key of 1 … 256", hint));
        }
        let length = value.chars().count();
        if length > MOST {
            let got = format!("a value of {length} characters");
            found.push(violation(pointer(), got, "at most 256", "Shorten it."));
        }
    }
    found
}
