//! What is wrong with a mesh, gathered while it is made.

use std::collections::HashMap;

use super::Mesh;
use crate::error::Violation;

/// More violations of one kind than this are not listed.
pub(super) const MOST_LISTED: usize = 20;

/// The inverted elements of a mesh that is otherwise sound. `pointer`: to an element by its number; `of`:
/// which mesh, after that number. For [`Mesh::inverted_elements`] `at_nodes`.
pub fn inverted(
    mesh: &Mesh,
    at_nodes: bool,
    pointer: impl Fn(usize) -> String,
    of: &str,
) -> Vec<Violation> {
    let fault = |(e, place, det): (usize, String, f64)| Violation {
        pointer: pointer(e),
        reason: "inverted_element".to_owned(),
        got: format!("element {e}{of} with det J = {det:.3e} at {place}"),
        expected: "det J > 0 at all Gauss points and at the nodes".to_owned(),
        hint: "List corners counter-clockwise, and keep midsides near the middle of their sides."
            .to_owned(),
    };
    let inverted = mesh.inverted_elements(at_nodes).into_iter();
    inverted.take(MOST_LISTED).map(fault).collect()
}

/// The faults of one mesh.
#[derive(Default)]
pub(super) struct Faults<'a> {
    /// Pointer to the mesh.
    pointer: &'a str,
    list: Vec<Violation>,
    unlisted: HashMap<&'static str, usize>,
}

impl<'a> Faults<'a> {
    pub(super) fn new(pointer: &'a str) -> Self {
        Faults {
            pointer,
            ..Faults::default()
        }
    }

    /// `place`: pointer from the mesh on.
    pub(super) fn say(
        &mut self,
        place: &str,
        reason: &'static str,
        got: impl ToString,
        expected: &str,
        hint: &str,
    ) {
        if self.list.iter().filter(|v| v.reason == reason).count() == MOST_LISTED {
            *self.unlisted.entry(reason).or_default() += 1;
            return;
        }
        self.list.push(Violation {
            pointer: format!("{}{place}", self.pointer),
            reason: reason.to_owned(),
            got: got.to_string(),
            expected: expected.to_owned(),
            hint: hint.to_owned(),
        });
    }

    pub(super) fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Goes on where nothing is wrong so far.
    pub(super) fn end(&mut self) -> Result<(), Vec<Violation>> {
        if self.is_empty() {
            Ok(())
        } else {
            Err(std::mem::take(&mut self.list))
        }
    }

    /// The list; the last of each kind says how many more there are.
    pub(super) fn counted(mut self) -> Vec<Violation> {
        for (reason, count) in self.unlisted {
            if let Some(last) = self.list.iter_mut().rfind(|v| v.reason == reason) {
                last.hint
                    .push_str(&format!(" ({count} more of this kind.)"));
            }
        }
        self.list
    }
}
