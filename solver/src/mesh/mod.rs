//! The body as nodes, elements and named boundaries.
//!
//! # Where to look
//!
//! | subject | where |
//! |---|---|
//! | meshes from grids and strips | `grid` |
//! | meshes written in the problem | `inline` |
//! | meshes from files | `build` |
//! | uniform refinement | `refine` |
//! | local refinement | `graded` |
//! | long elements, halved before they are refined | `halving` |
//! | sides and nodes of the first mesh on a refined one | `lineage`, `first` |
//! | a side divided where an obstacle ends | `divide` |
//! | boundaries on their curves | `curved` |
//! | inverted elements | `inverted` |
//! | distinct nodes at one place | `coincident` |

mod build;
mod coincident;
mod curved;
mod divide;
mod edge;
mod first;
mod graded;
mod grid;
mod halving;
mod inline;
mod inverted;
mod lineage;
mod refine;

pub use build::{NO_NODE, RawMesh, build};
pub use coincident::coincident_nodes;
pub use curved::OffCurve;
pub use edge::Edge;
pub use first::FirstSide;
pub use graded::GradedMesh;
pub use grid::{check_grid, grid_mesh, largest_cut};
pub use inline::inline_mesh;
pub use inverted::check_inverted;
pub use lineage::{Lineage, Part};
pub use refine::refine;

use std::collections::{BTreeMap, HashMap};

use serde::{Deserialize, Serialize};

use crate::element::Element;
use crate::error::Violation;
use crate::solution::Warning;

/// Nodes, elements and named boundaries, independent of their use.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Mesh {
    /// The positions of the nodes.
    pub nodes: Vec<[f64; 2]>,
    /// The elements: quadrilaterals and triangles.
    pub elements: Vec<Element>,
    /// Surface edges by name, in runs from start to end ([`Mesh::order_boundaries`]).
    pub boundaries: BTreeMap<String, Vec<Edge>>,
    /// Elements by the name of their group.
    pub groups: BTreeMap<String, Vec<u32>>,
    /// Nodes by the name of their set: the set's nodes of the first mesh, and later nodes on sides and in elements all
    /// of whose nodes are in the set.
    pub node_sets: BTreeMap<String, Vec<u32>>,
    /// The first of the midside nodes that were added to elements with corners only, if any were added; they are the
    /// last nodes of the first mesh. In a stored mesh this field comes after the others.
    #[serde(skip)]
    pub added_midsides: Option<u32>,
    /// How many nodes of each set were left out because they belong to no element. In a stored mesh this field comes
    /// after the others.
    #[serde(skip)]
    pub nodes_left_out: BTreeMap<String, u32>,
    /// The change of temperature at each node, interpolated by the shape functions; empty if none is given at nodes.
    /// In a stored mesh this field comes after the others.
    #[serde(skip)]
    pub temperatures: Vec<f64>,
    /// The relation to the first mesh. It is not stored, since every stored mesh is a first one.
    #[serde(skip)]
    pub lineage: Lineage,
}

/// A mesh that a problem only names or contains as text, read or fetched by the caller of the solver.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ExternalMesh {
    /// The mesh, before it is refined.
    pub mesh: Mesh,
    /// Warnings about changes made when the mesh was read; pointers are those of the problem.
    pub warnings: Vec<Warning>,
}

/// The result of reading an external mesh: the mesh, or all its violations. Pointers are those of the problem.
pub type External = Result<ExternalMesh, Vec<Violation>>;

impl From<Mesh> for ExternalMesh {
    fn from(mesh: Mesh) -> Self {
        ExternalMesh {
            mesh,
            warnings: Vec::new(),
        }
    }
}

impl Mesh {
    /// Adds a separate body: its elements as a group `name`, and its boundaries with that name before theirs.
    pub fn join(&mut self, name: &str, body: Mesh) {
        let (nodes, elements) = (self.nodes.len() as u32, self.elements.len() as u32);
        let count = body.elements.len() as u32;
        self.nodes.extend(body.nodes);
        let moved = body.elements.iter().map(|own| own.map_nodes(|n| n + nodes));
        self.elements.extend(moved);
        for (side, edges) in body.boundaries {
            let edges = edges.into_iter().map(|edge| edge.map(|n| n + nodes));
            self.boundaries
                .insert(format!("{name}.{side}"), edges.collect());
        }
        let own = elements..elements + count;
        self.groups.insert(name.to_owned(), own.collect());
    }

    /// Puts the edges of all boundaries into one defined order: run after run, each from its start to its end.
    pub fn order_boundaries(&mut self) {
        for edges in self.boundaries.values_mut() {
            *edges = runs(edges).concat();
        }
    }

    /// The positions of an element's nodes.
    pub fn element_nodes(&self, element: &Element) -> [[f64; 2]; 8] {
        element.gather(|n| self.nodes[n as usize])
    }

    /// Largest minus smallest coordinate along an axis (0: x, 1: y).
    pub fn extent(&self, axis: usize) -> f64 {
        let span = |(low, high): (f64, f64), x: &[f64; 2]| (low.min(x[axis]), high.max(x[axis]));
        let (low, high) = self
            .nodes
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), span);
        high - low
    }

    /// The positions of an edge's nodes.
    pub fn edge_nodes(&self, edge: &Edge) -> [[f64; 2]; 3] {
        edge.map(|n| self.nodes[n as usize])
    }

    /// Elements that are inverted somewhere: number, place and det J. Elements are checked at the Gauss points of the
    /// larger rule and, with `at_nodes`, at the nodes: a midside node far from the middle inverts its element at a
    /// corner first.
    pub fn inverted_elements(&self, at_nodes: bool) -> Vec<(usize, String, f64)> {
        let inverted = |(e, element): (usize, &Element)| {
            let (family, nodes) = (element.family(), self.element_nodes(element));
            let points = family.rule(3).iter().map(|point| point.place);
            let corners = family.places().iter().copied().filter(|_| at_nodes);
            let (place, det) = points
                .chain(corners)
                .map(|place| family.map(&nodes, place).det)
                .enumerate()
                .find(|(_, det)| det.is_nan() || *det <= 0.0)?;
            let name = match place.checked_sub(family.rule(3).len()) {
                None => format!("Gauss point {place}"),
                Some(node) => format!("its node {node}"),
            };
            Some((e, name, det))
        };
        self.elements
            .iter()
            .enumerate()
            .filter_map(inverted)
            .collect()
    }

    /// The smallest ratio, over all elements, of the smallest to the largest det J within an element, and the element
    /// that has it: 1 for a parallelogram or a triangle with straight sides, near 0 for an element that is almost
    /// inverted.
    pub fn worst_element(&self) -> (f64, usize) {
        let ratio = |element: &Element| {
            let (family, nodes) = (element.family(), self.element_nodes(element));
            let points = family.rule(3).iter().map(|point| point.place);
            let (low, high) = points
                .chain(family.places().iter().copied())
                .map(|place| family.map(&nodes, place).det)
                .fold((f64::INFINITY, 0.0f64), |(low, high), det| {
                    (low.min(det), high.max(det))
                });
            low / high
        };
        let ratios = self.elements.iter().map(ratio).enumerate();
        ratios.fold(
            (1.0, 0),
            |worst, (e, ratio)| if ratio < worst.0 { (ratio, e) } else { worst },
        )
    }

    /// The parts of the mesh that are connected by sides of elements, each as a list of its nodes. Parts that touch
    /// only in a corner are separate although they share the corner's node.
    pub fn connected_parts(&self) -> Vec<Vec<u32>> {
        // union–find over the elements; a side is known by its midside node
        let mut parent: Vec<u32> = (0..self.elements.len() as u32).collect();
        let mut first_with_side = vec![u32::MAX; self.nodes.len()];
        for (e, element) in self.elements.iter().enumerate() {
            for [_, _, mid] in element.sides() {
                let first = &mut first_with_side[mid as usize];
                if *first == u32::MAX {
                    *first = e as u32;
                } else {
                    let (a, b) = (find(&mut parent, *first), find(&mut parent, e as u32));
                    parent[b as usize] = a;
                }
            }
        }
        let mut number = vec![usize::MAX; self.elements.len()];
        let mut members: Vec<Vec<u32>> = Vec::new();
        for e in 0..self.elements.len() as u32 {
            let root = find(&mut parent, e) as usize;
            if number[root] == usize::MAX {
                number[root] = members.len();
                members.push(Vec::new());
            }
            members[number[root]].push(e);
        }
        // part by part: a node that several parts share comes once in each
        let mut seen_by = vec![usize::MAX; self.nodes.len()];
        let nodes = |(part, members): (usize, Vec<u32>)| {
            let nodes = members
                .iter()
                .flat_map(|e| self.elements[*e as usize].iter());
            let new = |node: &u32| std::mem::replace(&mut seen_by[*node as usize], part) != part;
            nodes.copied().filter(new).collect()
        };
        members.into_iter().enumerate().map(nodes).collect()
    }
}

/// The two corners of a side, in ascending order.
fn key(a: u32, b: u32) -> (u32, u32) {
    (a.min(b), a.max(b))
}

fn find(parent: &mut [u32], node: u32) -> u32 {
    let mut root = node;
    while parent[root as usize] != root {
        parent[root as usize] = parent[parent[root as usize] as usize];
        root = parent[root as usize];
    }
    root
}

/// The edges sorted into runs, each from its start to its end, whatever the order of `edges` is. Where a boundary meets
/// itself at a node, runs end; a closed loop has no start, and begins at its first edge.
pub fn runs(edges: &[Edge]) -> Vec<Vec<Edge>> {
    // the edges that start at a node: how many, and one of them; and how many end there
    let mut at: HashMap<u32, (usize, usize, usize)> = HashMap::with_capacity(edges.len() + 1);
    for (i, [start, end, _]) in edges.iter().enumerate() {
        let starting = at.entry(*start).or_default();
        (starting.0, starting.1) = (starting.0 + 1, i);
        at.entry(*end).or_default().2 += 1;
    }
    let through = |node: &u32| match at.get(node) {
        Some((1, next, 1)) => Some(*next),
        _ => None,
    };
    let mut used = vec![false; edges.len()];
    let mut runs = Vec::new();
    let heads = (0..edges.len()).filter(|&i| through(&edges[i][0]).is_none());
    for first in heads.chain(0..edges.len()) {
        let mut run = Vec::new();
        let mut next = Some(first);
        while let Some(i) = next.filter(|&i| !used[i]) {
            used[i] = true;
            run.push(edges[i]);
            next = through(&edges[i][1]);
        }
        if !run.is_empty() {
            runs.push(run);
        }
    }
    runs
}

/// Whether a run ends where it starts.
pub fn is_closed(run: &[Edge]) -> bool {
    match (run.first(), run.last()) {
        (Some(first), Some(last)) => first[0] == last[1],
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shuffled_edges_come_back_as_runs_in_their_direction() {
        let edges = [[4, 6, 5], [0, 2, 1], [2, 4, 3], [10, 12, 11]];
        let sorted = runs(&edges);
        assert_eq!(
            sorted,
            vec![vec![[0, 2, 1], [2, 4, 3], [4, 6, 5]], vec![[10, 12, 11]]]
        );
    }

    #[test]
    fn squares_that_share_a_corner_are_two_parts_and_a_strip_is_one() {
        let square = |o: f64, n: [u32; 8], nodes: &mut Vec<[f64; 2]>| {
            for (node, [x, y]) in n.iter().zip(crate::element::quad8::NODES) {
                nodes[*node as usize] = [o + 0.5 * (1.0 + x), o + 0.5 * (1.0 + y)];
            }
            Element::Quad(n)
        };
        let mut mesh = Mesh {
            nodes: vec![[0.0; 2]; 15],
            ..Mesh::default()
        };
        let first = square(0.0, [0, 1, 2, 3, 4, 5, 6, 7], &mut mesh.nodes);
        let second = square(1.0, [2, 8, 9, 10, 11, 12, 13, 14], &mut mesh.nodes);
        mesh.elements = vec![first, second];
        let parts = mesh.connected_parts();
        assert_eq!(parts.iter().map(Vec::len).collect::<Vec<_>>(), [8, 8]);
        // a third square beside the first, after the second: the shared node still comes once in each part
        mesh.nodes
            .extend([[1.5, 1.0], [2.0, 0.5], [2.0, 0.0], [1.5, 0.0], [2.0, 1.0]]);
        mesh.elements
            .push(Element::Quad([1, 17, 19, 2, 18, 16, 15, 5]));
        let parts = mesh.connected_parts();
        assert_eq!(parts.iter().map(Vec::len).collect::<Vec<_>>(), [13, 8]);
        let strip = crate::problem::Grid {
            x: vec![0.0, 1.0, 2.0],
            y: vec![0.0, 1.0],
            top: None,
            bottom: None,
        };
        assert_eq!(grid_mesh(&strip).connected_parts().len(), 1);
    }

    #[test]
    fn a_closed_loop_is_one_run() {
        let loops = runs(&[[0, 2, 1], [2, 4, 3], [4, 0, 5]]);
        assert_eq!((loops.len(), is_closed(&loops[0])), (1, true));
        assert!(!is_closed(&runs(&[[0, 2, 1], [2, 4, 3]])[0]));
    }

    /// Two squares that share a corner: which side follows there is not a matter of numbers.
    #[test]
    fn runs_end_where_a_boundary_meets_itself() {
        let mut edges = vec![
            [0, 1, 20],
            [1, 2, 21],
            [2, 0, 22],
            [2, 3, 23],
            [3, 4, 24],
            [4, 2, 25],
        ];
        for turn in 0..edges.len() {
            let mut found = runs(&edges);
            found.sort();
            let first = vec![[2, 0, 22], [0, 1, 20], [1, 2, 21]];
            let second = vec![[2, 3, 23], [3, 4, 24], [4, 2, 25]];
            assert_eq!(found, [first, second], "turned by {turn}");
            edges.rotate_left(1);
        }
    }
}
