//! The state of the checks of one problem: violations and warnings so far.

use crate::error::{Checked, Findings, Reason, Refused};
use crate::solution::{Warning, WarningCode};

/// Relative tolerance for directions along an axis and for equal prescribed values.
pub(super) const ALIGNED: f64 = 1e-9;

/// The violations and warnings found so far. Every check is a method that returns whether it holds.
#[derive(Default)]
pub(super) struct Checks {
    pub(super) found: Findings,
    pub(super) warnings: Vec<Warning>,
    /// Nodes of the given mesh that lie at the place of another node without being connected to it.
    pub(super) unmerged: Vec<[u32; 2]>,
}

impl Checks {
    /// Adds a violation.
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

    /// Adds a violation unless a number is in its range.
    pub(super) fn require(
        &mut self,
        holds: bool,
        pointer: impl AsRef<str>,
        got: f64,
        expected: &str,
        hint: &str,
    ) -> Checked {
        if holds {
            Ok(())
        } else {
            Err(self.report(pointer, Reason::OutOfRange, got, expected, hint))
        }
    }

    /// Adds a warning.
    pub(super) fn warn(&mut self, code: WarningCode, pointer: &str, message: String) {
        self.warnings.push(Warning {
            code,
            pointer: pointer.to_owned(),
            message,
        });
    }
}

/// The expected value where a name is unknown: one of the names that the mesh has, or the remark that the mesh has no
/// `kind`.
pub(super) fn one_of<'a>(kind: &str, names: impl ExactSizeIterator<Item = &'a String>) -> String {
    match names.len() {
        0 => format!("{kind}; this mesh has none"),
        _ => format!("one of {}", known(names)),
    }
}

/// A list of the existing names, cut after the first ones if there are many.
pub(super) fn known<'a>(names: impl ExactSizeIterator<Item = &'a String>) -> String {
    const SHOWN: usize = 20;
    let count = names.len();
    let shown: Vec<String> = names
        .take(SHOWN)
        .map(|name| format!("`{name:.80}`"))
        .collect();
    match count.saturating_sub(SHOWN) {
        0 => shown.join(", "),
        more => format!("{} and {more} more", shown.join(", ")),
    }
}
