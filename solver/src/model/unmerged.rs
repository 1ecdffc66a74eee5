//! Unintended cracks: distinct nodes at the same place that a mesh generator did not merge.

use std::collections::BTreeSet;

use super::checks::Checks;
use super::contact_model::ContactModel;
use crate::mesh::Mesh;
use crate::solution::WarningCode;

impl Checks {
    /// Warns of nodes at the same place that are not connected. This is no violation, since a crack may be intended: if
    /// both sides of the crack are contacts, or the two sides of one, there is no warning. (Parts that can move independently are refused.)
    pub(super) fn warn_of_unmerged(&mut self, mesh: &Mesh, contacts: &[ContactModel]) {
        let meant: BTreeSet<u32> = contacts
            .iter()
            .flat_map(|contact| {
                let facing = contact.pair.iter().flat_map(|pair| &pair.nodes);
                contact.boundary.nodes.iter().chain(facing).copied()
            })
            .collect();
        self.unmerged
            .retain(|pair| !pair.iter().all(|node| meant.contains(node)));
        let Some(&[first, second]) = self.unmerged.first() else {
            return;
        };
        let [x, y] = mesh.nodes[first as usize];
        let others = match self.unmerged.len() {
            1 => String::new(),
            count => format!(" ({count} such pairs)"),
        };
        self.warn(
            WarningCode::CoincidentNodes,
            "/mesh",
            format!(
                "Two nodes, {first} and {second} counted from 0, are both at ({x}, {y}) and belong to different elements{others}: the body has a crack there, along which its parts are not connected. Merge them where the mesh was made, in Gmsh with `Coherence Mesh;` or `removeDuplicateNodes`, unless the crack is intended."
            ),
        );
    }

    /// A hint for messages about a body that falls into parts, or a boundary into pieces: nodes that are not merged may
    /// be the cause. Empty if all nodes are merged.
    pub(super) fn hint_to_merge(&self, mesh: &Mesh) -> String {
        let Some(&[first, second]) = self.unmerged.first() else {
            return String::new();
        };
        let [x, y] = mesh.nodes[first as usize];
        format!(
            " Two nodes, {first} and {second} counted from 0, are both at ({x}, {y}) and not connected ({} such pairs in total): merge them where the mesh was made, in Gmsh with `Coherence Mesh;`, unless two bodies touch there.",
            self.unmerged.len()
        )
    }
}
