//! The checks of one problem: what they have found so far.

use crate::error::{Checked, Findings, Reason, Refused};
use crate::solution::{Warning, WarningCode};

/// Directions count as equal to an axis, and prescribed values as equal, to this.
pub(super) const ALIGNED: f64 = 1e-9;

/// Every check is a method; each answers whether it held.
#[derive(Default)]
pub(super) struct Checks {
    pub(super) found: Findings,
    pub(super) warnings: Vec<Warning>,
}

impl Checks {
    /// Something is wrong.
    pub(super) fn report(
        &mut self,
        pointer: impl AsRef<str>,
        reason: Reason,
        got: impl ToString,
        expected: impl Into<String>,
        hint: impl Into<String>,
    ) -> Refused {
        self.found.report(pointer, reason, got, expected, hint)
    }

    /// A number is in its range, or something is wrong.
    pub(super) fn require(
        &mut self,
        holds: bool,
        pointer: impl AsRef<str>,
        got: f64,
        expected: &str,
        hint: &str,
    ) -> Checked {
        match holds {
            true => Ok(()),
            false => Err(self.report(pointer, Reason::OutOfRange, got, expected, hint)),
        }
    }

    /// Something is accepted, and yet worth knowing.
    pub(super) fn warn(&mut self, code: WarningCode, pointer: &str, message: String) {
        self.warnings.push(Warning {
            code,
            pointer: pointer.to_owned(),
            message,
        });
    }
}
