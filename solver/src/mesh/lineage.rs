//! Which part of which side of the first mesh a side of a refined one is.
//!
//! Names mean the first mesh, and so do forces and supports at its nodes, which keep their numbers. Those on all nodes of
//! a side act on that side, into however many parts it is split.

use std::collections::{BTreeMap, HashMap};

use super::{Edge, Mesh};
use crate::element::Element;

/// How a mesh was made from the first one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lineage {
    /// Nodes of the first mesh; none: this is it.
    first_nodes: Option<u32>,
    /// Parts of its sides that are split, by their midside nodes.
    parts: HashMap<u32, Part>,
}

/// A part of a side of the first mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// The side of the first mesh.
    pub side: Edge,
    /// The part of it, as a side of this mesh.
    pub edge: Edge,
    /// Where the part starts and ends on the side, −1 … 1 from the side's start to its end.
    pub range: [f64; 2],
}

impl Part {
    /// The same part from the start of `edge` to its end, and with the side in that direction.
    fn along(mut self, edge: &Edge) -> Part {
        if self.edge[0] != edge[0] {
            self.range.reverse();
        }
        self.edge = *edge;
        let [start, end] = self.range;
        let [a, b, mid] = self.side;
        match start > end {
            true => self.of(&[b, a, mid]),
            false => self,
        }
    }

    /// The same part of the side in the direction of `side`.
    fn of(mut self, side: &Edge) -> Part {
        if self.side[0] != side[0] {
            self.range = self.range.map(|place| -place);
        }
        self.side = *side;
        self
    }

    /// Places of the start, end and midside of the part on the side.
    pub fn places(&self) -> [f64; 3] {
        let [start, end] = self.range;
        [start, end, 0.5 * (start + end)]
    }
}

impl Lineage {
    /// From now on the mesh is no longer the first one.
    pub(super) fn leave_first(&mut self, nodes: usize) {
        self.first_nodes.get_or_insert(nodes as u32);
    }

    /// Of the mesh to be made from this one.
    pub(super) fn of_finer(mesh: &Mesh) -> Lineage {
        Lineage {
            first_nodes: Some(mesh.first_nodes()),
            parts: mesh.lineage.parts.clone(),
        }
    }

    fn part(&self, edge: &Edge) -> Option<Part> {
        let known = self.parts.get(&edge[2]);
        let whole = || Part {
            side: *edge,
            edge: *edge,
            range: [-1.0, 1.0],
        };
        // the midside of a side inside an element of the first mesh is a later node
        let first = self.first_nodes.is_none_or(|count| edge[2] < count);
        known
            .map(|part| part.along(edge))
            .or_else(|| first.then(whole))
    }

    /// A side is split at its middle; `halves`: the midsides of its two halves, from its start on.
    pub(super) fn split(&mut self, edge: &Edge, halves: [u32; 2]) {
        self.split_at(edge, 0.0, halves);
    }

    /// A side is split at the place ξ of it, −1 … 1, where its midside node then is.
    pub(super) fn split_at(&mut self, edge: &Edge, xi: f64, halves: [u32; 2]) {
        let Some(part) = self.part(edge) else { return };
        let [start, end, _] = part.places();
        let middle = 0.5 * ((1.0 - xi) * start + (1.0 + xi) * end);
        let [a, b, mid] = *edge;
        let (first, second) = ([a, mid, halves[0]], [mid, b, halves[1]]);
        for (edge, range) in [(first, [start, middle]), (second, [middle, end])] {
            let part = Part {
                edge,
                range,
                ..part
            };
            self.parts.insert(edge[2], part);
        }
    }
}

impl Mesh {
    /// Number of nodes of the first mesh: they come first.
    pub fn first_nodes(&self) -> u32 {
        let all = self.nodes.len() as u32;
        self.lineage.first_nodes.unwrap_or(all)
    }

    /// The part of a side of the first mesh that a side is, both in its direction; none for a side inside an element of the
    /// first mesh.
    pub fn part(&self, edge: &Edge) -> Option<Part> {
        self.lineage.part(edge)
    }

    /// Whether a side has a midside that the mesh's file did not have: displacements of the file are linear there.
    pub fn is_raised(&self, side: &Edge) -> bool {
        self.added_midsides
            .is_some_and(|first| (first..self.first_nodes()).contains(&side[2]))
    }

    /// The nodes of the first mesh that a set holds, without midsides that its file did not have.
    pub fn given_nodes(&self, set: &[u32]) -> Vec<u32> {
        let first = self.first_nodes();
        let count = self.added_midsides.map_or(first, |added| added.min(first));
        let given = set.iter().copied().filter(|node| *node < count);
        given.collect()
    }

    /// Whether forces and supports at nodes have to be carried to others: sides are split, or had no midsides.
    pub fn has_later_nodes(&self) -> bool {
        self.lineage.first_nodes.is_some() || self.added_midsides.is_some()
    }

    /// All sides of the first mesh by their midsides, with their parts in this one.
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
    /// Its parts, all with the side in the same direction.
    pub parts: Vec<Part>,
    /// It lies between two elements.
    pub inside: bool,
}
