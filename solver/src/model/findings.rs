//! What the checks have found so far.

use crate::error::Violation;
use crate::solution::Warning;

/// Directions count as equal to an axis, and prescribed values as equal, to this.
pub(super) const ALIGNED: f64 = 1e-9;

/// A radius below this part of the largest is the axis: a mesh generator may miss 0 by rounding.
pub(super) const AXIS: f64 = 1e-12;

/// More violations than this are counted, not listed: nobody reads them, and the answer stays small.
pub(super) const MOST_LISTED: usize = 100;

/// Violations and warnings, gathered by every check.
#[derive(Default)]
pub(super) struct Findings {
    pub(super) violations: Vec<Violation>,
    pub(super) warnings: Vec<Warning>,
    unlisted: usize,
}

impl Findings {
    pub(super) fn say(
        &mut self,
        pointer: impl Into<String>,
        reason: &str,
        got: impl ToString,
        expected: impl Into<String>,
        hint: impl Into<String>,
    ) {
        if self.violations.len() >= MOST_LISTED {
            self.unlisted += 1;
            return;
        }
        self.violations.push(Violation {
            pointer: pointer.into(),
            reason: reason.to_owned(),
            got: got.to_string(),
            expected: expected.into(),
            hint: hint.into(),
        });
    }

    /// Takes over what a mesh has found.
    pub(super) fn adopt(&mut self, faults: Vec<Violation>) {
        for fault in faults {
            let Violation {
                pointer,
                reason,
                got,
                expected,
                hint,
            } = fault;
            self.say(pointer, &reason, got, expected, hint);
        }
    }

    /// All violations; those beyond the first hundred are counted in the last one's hint.
    pub(super) fn into_violations(mut self) -> Vec<Violation> {
        if let Some(last) = self.violations.last_mut().filter(|_| self.unlisted > 0) {
            last.hint
                .push_str(&format!(" ({} more violations.)", self.unlisted));
        }
        self.violations
    }

    pub(super) fn warn(&mut self, code: &str, pointer: &str, message: String) {
        self.warnings.push(Warning {
            code: code.to_owned(),
            pointer: pointer.to_owned(),
            message,
        });
    }

    pub(super) fn require(
        &mut self,
        holds: bool,
        pointer: String,
        got: f64,
        expected: &str,
        hint: &str,
    ) {
        if !holds {
            self.say(pointer, "out_of_range", got, expected, hint);
        }
    }
}
