//! The relation of a refined mesh to the first one.

use std::collections::BTreeMap;

use super::Mesh;
use super::edge::Edge;
use super::lineage::Part;
use crate::element::Element;

impl Mesh {
    /// Gives midsides that the mesh's file did not have the mean of the temperatures at the ends.
    pub(super) fn add_temperatures(&mut self) {
        let Some(first) = self
            .added_midsides
            .filter(|_| !self.temperatures.is_empty())
        else {
            return;
        };
        let sides = self.elements.iter().flat_map(Element::sides);
        for [a, b, mid] in sides.filter(|[_, _, mid]| *mid >= first) {
            let [a, b] = [a, b].map(|node| self.temperatures[node as usize]);
            self.temperatures[mid as usize] = 0.5 * (a + b);
        }
    }

    /// The number of nodes of the first mesh, which come first.
    pub fn first_nodes(&self) -> u32 {
        let all = self.nodes.len() as u32;
        self.lineage.first_nodes.unwrap_or(all)
    }

    /// The part of a side of the first mesh that `edge` is, with the part and the side in the direction of `edge`;
    /// `None` for a side inside an element of the first mesh.
    pub fn part(&self, edge: &Edge) -> Option<Part> {
        self.lineage.part(edge)
    }

    /// Whether a side has a midside that the mesh's file did not have: displacements given by the file are linear along
    /// it.
    pub fn is_raised(&self, side: &Edge) -> bool {
        self.added_midsides
            .is_some_and(|first| (first..self.first_nodes()).contains(&side[2]))
    }

    /// The nodes of the first mesh that a set contains, without midsides that the mesh's file did not have.
    pub fn given_nodes(&self, set: &[u32]) -> Vec<u32> {
        let first = self.first_nodes();
        let count = self.added_midsides.map_or(first, |added| added.min(first));
        let given = set.iter().copied().filter(|node| *node < count);
        given.collect()
    }

    /// Whether forces and supports given at nodes act on other nodes too, because sides are split or had no midsides.
    pub fn has_later_nodes(&self) -> bool {
        self.lineage.first_nodes.is_some() || self.added_midsides.is_some()
    }

    /// All sides of the first mesh by their midsides, with their parts in this mesh.
    pub fn first_sides(&self) -> BTreeMap<u32, FirstSide> {
        let mut sides: BTreeMap<u32, FirstSide> = BTreeMap::new();
        for edge in self.elements.iter().flat_map(Element::sides) {
            let Some(part) = self.part(&edge) else {
                continue;
            };
            let side = sides.entry(part.side[2]).or_default();
            let known = |known: &Part| known.edge[2] == edge[2];
            if side.parts.iter().any(known) {
                side.inside = true;
                continue;
            }
            let first = side.parts.first().map_or(part.side, |first| first.side);
            // most have one: a mesh that is not refined has no others
            side.parts.reserve_exact(1);
            side.parts.push(part.of(&first));
        }
        sides
    }
}

/// A side of the first mesh.
#[derive(Clone, Debug, Default)]
pub struct FirstSide {
    /// The parts of the side in this mesh, all directed like the side.
    pub parts: Vec<Part>,
    /// Whether the side lies between two elements.
    pub inside: bool,
}
