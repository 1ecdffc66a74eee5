//! The body as nodes, 8-node elements and named boundaries.

mod grid;
mod inline;
mod refine;

pub use grid::{grid_mesh, grid_violations};
pub use inline::inline_mesh;
pub use refine::refine;

use std::collections::BTreeMap;

use crate::element::gauss::GAUSS_3;
use crate::element::quad8;

/// A side of an element on the surface of the body: start, end, midside node, so directed that the
/// body lies on the right (a top edge runs along +x). The outward normal is the direction turned
/// counter-clockwise; in other words t, the normal turned clockwise, is the direction.
pub type Edge = [u32; 3];

/// Nodes, elements and named boundaries, without a word of what they are for.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Positions.
    pub nodes: Vec<[f64; 2]>,
    /// Eight nodes each, as in `element::quad8`.
    pub elements: Vec<[u32; 8]>,
    /// Surface edges by name.
    pub boundaries: BTreeMap<String, Vec<Edge>>,
}

impl Mesh {
    /// Node positions of an element.
    pub fn element_nodes(&self, element: &[u32; 8]) -> [[f64; 2]; 8] {
        element.map(|n| self.nodes[n as usize])
    }

    /// Node positions of an edge.
    pub fn edge_nodes(&self, edge: &Edge) -> [[f64; 2]; 3] {
        edge.map(|n| self.nodes[n as usize])
    }

    /// The first Gauss point (element, point from 0, det J) at which an element is inverted.
    pub fn inverted_elements(&self) -> Vec<(usize, usize, f64)> {
        let inverted = |(e, element): (usize, &[u32; 8])| {
            let nodes = self.element_nodes(element);
            (0..9).find_map(|g| {
                let det = quad8::map(&nodes, GAUSS_3[g % 3].0, GAUSS_3[g / 3].0).det;
                (det.is_nan() || det <= 0.0).then_some((e, g, det))
            })
        };
        self.elements
            .iter()
            .enumerate()
            .filter_map(inverted)
            .collect()
    }

    /// The parts that hang together, each as a list of its nodes.
    pub fn connected_parts(&self) -> Vec<Vec<u32>> {
        // union–find over the nodes, one element at a time
        let mut parent: Vec<u32> = (0..self.nodes.len() as u32).collect();
        for element in &self.elements {
            let root = find(&mut parent, element[0]);
            for &node in &element[1..] {
                let other = find(&mut parent, node);
                parent[other as usize] = root;
            }
        }
        let mut parts: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for node in 0..self.nodes.len() as u32 {
            parts.entry(find(&mut parent, node)).or_default().push(node);
        }
        parts.into_values().collect()
    }
}

fn find(parent: &mut [u32], node: u32) -> u32 {
    let mut root = node;
    while parent[root as usize] != root {
        parent[root as usize] = parent[parent[root as usize] as usize];
        root = parent[root as usize];
    }
    root
}

/// Edges sorted into runs, each from its start to its end; a closed loop starts at its first edge.
pub fn runs(edges: &[Edge]) -> Vec<Vec<Edge>> {
    let by_start: BTreeMap<u32, usize> = edges.iter().enumerate().map(|(i, e)| (e[0], i)).collect();
    let ends: std::collections::BTreeSet<u32> = edges.iter().map(|e| e[1]).collect();
    let mut used = vec![false; edges.len()];
    let mut runs = Vec::new();
    let heads = (0..edges.len()).filter(|&i| !ends.contains(&edges[i][0]));
    for first in heads.chain(0..edges.len()) {
        let mut run = Vec::new();
        let mut next = Some(first);
        while let Some(i) = next.filter(|&i| !used[i]) {
            used[i] = true;
            run.push(edges[i]);
            next = by_start.get(&edges[i][1]).copied();
        }
        if !run.is_empty() {
            runs.push(run);
        }
    }
    runs
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
    fn a_closed_loop_is_one_run() {
        assert_eq!(runs(&[[0, 2, 1], [2, 4, 3], [4, 0, 5]]).len(), 1);
    }
}
