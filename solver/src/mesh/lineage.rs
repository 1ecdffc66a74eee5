//! Maps sides of a refined mesh to parts of sides of the first mesh.
//!
//! Names refer to the first mesh, and so do forces and supports at its nodes, which keep their numbers. Those on all
//! nodes of a side act on that side, however many parts it is split into.

use std::collections::HashMap;

use super::edge::Edge;

/// How a mesh was made from the first one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lineage {
    /// The number of nodes of the first mesh; `None` if this is the first mesh.
    pub(super) first_nodes: Option<u32>,
    /// The parts of split sides of the first mesh, by the midside nodes of the parts.
    parts: HashMap<u32, Part>,
}

/// A part of a side of the first mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// The side of the first mesh.
    pub side: Edge,
    /// The part, as a side of the refined mesh.
    pub edge: Edge,
    /// The range of the part on the first mesh's side, −1 … 1 from the side's start to its end.
    pub range: [f64; 2],
}

impl Part {
    /// The part directed from the start of `edge` to its end, with its side of the first mesh in the same direction.
    fn along(mut self, edge: &Edge) -> Part {
        if self.edge[0] != edge[0] {
            self.range.reverse();
        }
        self.edge = *edge;
        let [start, end] = self.range;
        let [a, b, mid] = self.side;
        if start > end {
            self.of(&[b, a, mid])
        } else {
            self
        }
    }

    /// This part with its side of the first mesh in the direction of `side`.
    pub(super) fn of(mut self, side: &Edge) -> Part {
        if self.side[0] != side[0] {
            self.range = self.range.map(|place| -place);
        }
        self.side = *side;
        self
    }

    /// The places of the part's start, end and midside on the side.
    pub fn places(&self) -> [f64; 3] {
        let [start, end] = self.range;
        [start, end, 0.5 * (start + end)]
    }
}

impl Lineage {
    /// Marks the mesh, which has `nodes` nodes, as no longer the first one.
    pub(super) fn leave_first(&mut self, nodes: usize) {
        self.first_nodes.get_or_insert(nodes as u32);
    }

    /// The lineage of a mesh that is made from this one; `nodes`: the number of nodes of this mesh.
    pub(super) fn of_finer(&self, nodes: usize) -> Lineage {
        let mut finer = self.clone();
        finer.leave_first(nodes);
        finer
    }

    pub(super) fn part(&self, edge: &Edge) -> Option<Part> {
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

    /// Records that a side is split at its middle; `halves`: the midsides of the two halves, from the side's start on.
    pub(super) fn split(&mut self, edge: &Edge, halves: [u32; 2]) {
        self.split_at(edge, 0.0, halves);
    }

    /// Records that a side is split at the place ξ, −1 … 1, to which its midside node is moved.
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
