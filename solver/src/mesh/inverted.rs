//! Reports elements that are inverted or numbered clockwise.

use super::Mesh;
use crate::error::{AllChecks, Findings, Reason, Violation};

/// Checks that no element of an otherwise valid mesh is inverted. `pointer`: makes a JSON Pointer from an element's
/// number. `of`: the words for the mesh that follow this number. `at_nodes`: as for [`Mesh::inverted_elements`].
pub fn check_inverted(
    mesh: &Mesh,
    at_nodes: bool,
    pointer: impl Fn(usize) -> String,
    of: &str,
) -> Result<(), Vec<Violation>> {
    let mut found = Findings::of_mesh("");
    let mut all = AllChecks::default();
    for (e, place, det) in mesh.inverted_elements(at_nodes) {
        all.fail(found.report(
            pointer(e),
            Reason::InvertedElement,
            format!("element {e}{of} with det J = {det:.3e} at {place}"),
            "det J > 0 at all Gauss points and at the nodes",
            "List corners counter-clockwise, and keep midsides near the middle of their sides.",
        ));
    }
    found.conclude(all.finish(()))
}
