//! Violations of a problem, and errors that end a solution.
//!
//! A method that does not converge is neither: it is an [`Outcome`](crate::solution::Outcome) with its history.

mod findings;
mod reason;

pub use findings::{AllChecks, Checked, Findings, MOST_LISTED, Refused, rounded, shortened};
pub use reason::Reason;

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::phase::Phase;

/// A fault of a problem, described so that its author can correct it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Violation {
    /// JSON Pointer (RFC 6901) into the problem, e.g. `/contacts/0/friction/elastic_slip`.
    pub pointer: String,
    /// The kind of violation, stable for programs.
    pub reason: Reason,
    /// The value found at the place of `pointer`.
    pub got: String,
    /// The requirement on the value at the place of `pointer`.
    pub expected: String,
    /// How to correct the violation.
    pub hint: String,
}

impl Violation {
    /// A violation from its parts, in the order of the fields.
    pub fn new(
        pointer: impl Into<String>,
        reason: Reason,
        got: impl ToString,
        expected: impl Into<String>,
        hint: impl Into<String>,
    ) -> Self {
        Violation {
            pointer: pointer.into(),
            reason,
            got: got.to_string(),
            expected: expected.into(),
            hint: hint.into(),
        }
    }
}

impl Violation {
    /// The line of the file where the violation is, and the value found on this line: readers of files begin `got` by
    /// `line 61: `.
    fn on_line(&self) -> Option<(u64, &str)> {
        let rest = self.got.strip_prefix("line ")?;
        let (line, got) = rest.split_once(": ").filter(|_| self.pointer.is_empty())?;
        Some((line.parse().ok()?, got))
    }

    /// The line of a deck or mesh file where the violation is, counted from 1; `None` if the violation is not about one
    /// line.
    pub fn line(&self) -> Option<u64> {
        self.on_line().map(|(line, _)| line)
    }

    /// The violation as one line of text about a file: `deck.inp:61: expected …, got …. …`
    pub fn in_file(&self, file: impl fmt::Display) -> String {
        match self.on_line() {
            Some((line, got)) => format!(
                "{file}:{line}: expected {}, got {got}. {}",
                self.expected, self.hint
            ),
            None => format!("{file}: {self}"),
        }
    }
}

/// Lists which of several alternatives were given, where exactly one is required.
pub fn either(given: &[(&str, bool)]) -> String {
    let given = given.iter().filter(|(_, given)| *given);
    let names: Vec<String> = given.map(|(name, _)| format!("`{name}`")).collect();
    if names.is_empty() {
        "none of them".to_owned()
    } else {
        names.join(" and ")
    }
}

/// A name as a token of a JSON Pointer (RFC 6901).
pub fn escape(name: &str) -> String {
    name.replace('~', "~0").replace('/', "~1")
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.on_line() {
            Some((line, _)) => write!(f, "line {line}")?,
            None if self.pointer.is_empty() => f.write_str("(the whole problem)")?,
            None => f.write_str(&self.pointer)?,
        }
        let got = self.on_line().map_or(&self.got[..], |(_, got)| got);
        write!(f, ": expected {}, got {got}. {}", self.expected, self.hint)
    }
}

/// Why no solution could be computed.
#[derive(Clone, Debug, PartialEq)]
pub enum SolveError {
    /// The problem cannot be solved, because it has these violations.
    Invalid(Vec<Violation>),
    /// The stiffness matrix has no Cholesky factor although the supports looked sufficient.
    SingularSystem {
        /// The node at which the factorisation stopped.
        node: u32,
        /// The direction in which nothing holds the node.
        direction: [f64; 2],
    },
    /// Neither the supports nor the contacts of the final state hold the body.
    Unheld {
        /// The free motion, in words.
        motion: String,
        /// A node that moves in the free motion.
        node: u32,
    },
    /// Bodies in contact may move together without a force.
    BodiesUnheld,
    /// Nothing in the final state holds an obstacle whose loads are given.
    ObstacleUnheld {
        /// The boundary of the obstacle's contact.
        contact: String,
        /// The free motion, in words.
        motion: String,
    },
    /// There is not enough memory for a matrix.
    ResourceExhausted {
        /// The number of bytes that the matrix needs.
        bytes: u64,
    },
    /// A phase computed NaN or infinity.
    NonFinite {
        /// The phase that computed the number.
        phase: Phase,
    },
    /// The problem has another body than the one that it was to be solved on.
    OtherBody,
    /// The observer stopped the solution before there was a state to return.
    Stopped,
}

impl fmt::Display for SolveError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SolveError::Invalid(violations) => {
                write!(f, "the problem has {} violation(s)", violations.len())?;
                violations.iter().try_for_each(|v| write!(f, "\n  {v}"))
            }
            SolveError::SingularSystem {
                node,
                direction: [x, y],
            } => write!(
                f,
                "the stiffness matrix is singular to working precision, at node {node} along ({x}, {y}): check the \
                 supports, the ratio of the largest to the smallest element, and whether 2 × 2 \
                 quadrature leaves a mode without stiffness (3 × 3 has none)"
            ),
            SolveError::Unheld { motion, node } => write!(
                f,
                "nothing holds the body: it is free to move {motion}, e.g. at node {node}. The supports rely \
                 on contact to prevent this motion, but in the final state there is no contact where it would \
                 do so. Add a support, or loads that press the body against the obstacle"
            ),
            SolveError::BodiesUnheld => write!(
                f,
                "Bodies in contact may move together: nothing but their contact holds them. Support one of them."
            ),
            SolveError::ObstacleUnheld { contact, motion } => write!(
                f,
                "nothing holds the obstacle of contact `{contact}`: {motion}. Its loads are given, and in the final \
                 state neither pressure nor friction resists this motion, so that there is no equilibrium or any number \
                 of them. Give the motion (`indentation`, `tangential_displacement` or `tilt`) in place of its load, or a \
                 spring by `stiffness`; a normal force must act within the contact"
            ),
            SolveError::ResourceExhausted { bytes } => write!(
                f,
                "a matrix of {:.0} MiB does not fit into memory: use a coarser mesh, above all along the contacts",
                *bytes as f64 / f64::from(1 << 20)
            ),
            SolveError::NonFinite { phase } => write!(
                f,
                "the phase `{}` computed a number that is not finite: check the magnitudes of moduli, lengths and loads",
                phase.as_str()
            ),
            SolveError::OtherBody => write!(
                f,
                "the problem has another body: its mesh, materials, supports, loads or contact nodes differ"
            ),
            SolveError::Stopped => write!(f, "stopped on request"),
        }
    }
}

impl std::error::Error for SolveError {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_violation_of_a_file_is_placed_at_its_line() {
        let new = |pointer: &str, got: &str| {
            Violation::new(pointer, Reason::Malformed, got, "a number", "Write one.")
        };
        let of_deck = new("", "line 61: `x`");
        assert_eq!(of_deck.line(), Some(61));
        assert_eq!(
            of_deck.to_string(),
            "line 61: expected a number, got `x`. Write one."
        );
        assert_eq!(
            of_deck.in_file("a.inp"),
            "a.inp:61: expected a number, got `x`. Write one."
        );
        let whole = new("", "a deck without *STEP");
        assert_eq!(whole.line(), None);
        assert!(
            whole
                .to_string()
                .starts_with("(the whole problem): expected")
        );
        // a deck inside of a problem has lines of its own, which are not those of the file
        let inside = new("/mesh/abaqus", "line 2: `x`");
        assert_eq!(inside.line(), None);
        assert_eq!(
            inside.in_file("a.json"),
            "a.json: /mesh/abaqus: expected a number, got line 2: `x`. Write one."
        );
    }
}
