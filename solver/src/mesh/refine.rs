//! Uniform refinement: every element is split into four, every side into two.

use std::collections::{BTreeMap, HashMap};
use std::ops::Range;

use crate::element::{Element, edge3, quad8, tri6};
use crate::mesh::{Edge, Lineage, Mesh};

/// New nodes lie half-way between old nodes, in master coordinates.
const STEP: f64 = 0.5;

/// The distance of new nodes from the sides of a triangle, in master coordinates.
const QUARTER: f64 = 0.25;

/// Refines a mesh: every element becomes four, every edge two. New nodes lie on the parent element's map, so that
/// curved sides keep their shape.
pub fn refine(mesh: &Mesh) -> Mesh {
    let mut finer = Finer::new(mesh);
    let elements = mesh.elements.iter();
    let elements = elements.flat_map(|parent| finer.children(parent)).collect();
    let mut boundaries = BTreeMap::new();
    for (name, edges) in &mesh.boundaries {
        let children = edges.iter().flat_map(|&[a, b, mid]| {
            let (first, second) = finer.split([a, b, mid]);
            [[a, mid, first], [mid, b, second]]
        });
        boundaries.insert(name.clone(), children.collect());
    }
    // the children of an element follow one another
    let four = |e: &u32| (0..4).map(|child| 4 * e + child).collect::<Vec<u32>>();
    let groups = mesh.groups.iter();
    let groups = groups
        .map(|(name, group)| (name.clone(), group.iter().flat_map(four).collect()))
        .collect();
    Mesh {
        nodes: finer.nodes,
        elements,
        boundaries,
        groups,
        node_sets: finer.sets.into_named(mesh.node_sets.keys()),
        added_midsides: mesh.added_midsides,
        nodes_left_out: mesh.nodes_left_out.clone(),
        temperatures: finer.temperatures,
        lineage: finer.lineage,
    }
}

/// The refined mesh while it is built.
#[derive(Clone)]
pub(super) struct Finer {
    pub(super) nodes: Vec<[f64; 2]>,
    /// The change of temperature at each node; empty where there is none.
    pub(super) temperatures: Vec<f64>,
    /// The halves of each side, by its midside node: start corner, midside of the first half, midside of the second.
    halves: Vec<Option<(u32, u32, u32)>>,
    pub(super) sets: Sets,
    pub(super) lineage: Lineage,
}

impl Finer {
    pub(super) fn new(mesh: &Mesh) -> Self {
        Finer {
            nodes: mesh.nodes.clone(),
            temperatures: mesh.temperatures.clone(),
            halves: vec![None; mesh.nodes.len()],
            sets: Sets::new(mesh),
            lineage: mesh.lineage.of_finer(mesh.nodes.len()),
        }
    }

    /// The midsides of the two halves of a side, from `start` on; `None` if the side is not split.
    pub(super) fn halves(&self, mid: u32, start: u32) -> Option<(u32, u32)> {
        let (from, first, second) = (*self.halves.get(mid as usize)?)?;
        Some(if from == start {
            (first, second)
        } else {
            (second, first)
        })
    }

    /// Splits a side; returns the midsides of the two halves, from the side's start on.
    pub(super) fn split(&mut self, [a, b, mid]: Edge) -> (u32, u32) {
        // midsides of new sides are not in the list yet
        if self.halves.len() < self.nodes.len() {
            self.halves.resize(self.nodes.len(), None);
        }
        let (start, first, second) = match self.halves[mid as usize] {
            Some(known) => known,
            None => {
                let ends = [a, b, mid].map(|n| self.nodes[n as usize]);
                let number = self.nodes.len() as u32;
                self.nodes.push(edge3::map(&ends, -STEP).0);
                self.nodes.push(edge3::map(&ends, STEP).0);
                if !self.temperatures.is_empty() {
                    let ends = [a, b, mid].map(|n| self.temperatures[n as usize]);
                    let at = |xi: f64| edge3::interpolate(&edge3::shape(xi), &ends);
                    self.temperatures.extend([at(-STEP), at(STEP)]);
                }
                self.sets.inherit(&[a, b, mid], number..number + 2);
                self.lineage.split(&[a, b, mid], [number, number + 1]);
                *self.halves[mid as usize].insert((a, number, number + 1))
            }
        };
        if start == a {
            (first, second)
        } else {
            (second, first)
        }
    }

    /// Adds nodes inside an element, at places in master coordinates.
    pub(super) fn inside<const N: usize>(
        &mut self,
        parent: &Element,
        places: [[f64; 2]; N],
    ) -> [u32; N] {
        let (family, positions) = (parent.family(), parent.gather(|n| self.nodes[n as usize]));
        let first = self.nodes.len() as u32;
        for place in places {
            let h = family.shape(place);
            let at = |a: usize| (0..family.nodes()).map(|i| h[i] * positions[i][a]).sum();
            self.nodes.push([at(0), at(1)]);
            if !self.temperatures.is_empty() {
                let own = parent.iter().zip(h);
                let own = own.map(|(node, h)| h * self.temperatures[*node as usize]);
                let sum = own.sum();
                self.temperatures.push(sum);
            }
        }
        self.sets.inherit(parent, first..first + N as u32);
        std::array::from_fn(|i| first + i as u32)
    }

    #[rustfmt::skip]
    pub(super) fn children(&mut self, parent: &Element) -> [Element; 4] {
        match parent {
            Element::Quad(p) => {
                let [south, east, north, west] =
                    quad8::SIDES.map(|side| self.split(side.map(|i| p[i])));
                let [centre, to_south, to_east, to_north, to_west] = self.inside(
                    parent,
                    [[0.0, 0.0], [0.0, -STEP], [STEP, 0.0], [0.0, STEP], [-STEP, 0.0]],
                );
                [
                    [p[0], p[4], centre, p[7], south.0, to_south, to_west, west.1],
                    [p[4], p[1], p[5], centre, south.1, east.0, to_east, to_south],
                    [centre, p[5], p[2], p[6], to_east, east.1, north.0, to_north],
                    [p[7], centre, p[6], p[3], to_west, to_north, north.1, west.0],
                ].map(Element::Quad)
            }
            Element::Triangle(p) => {
                let [first, second, third] =
                    tri6::SIDES.map(|side| self.split(side.map(|i| p[i])));
                // the sides of the triangle in the middle, each across one corner
                let [across_0, across_1, across_2] = self.inside(
                    parent,
                    [[QUARTER, QUARTER], [STEP, QUARTER], [QUARTER, STEP]],
                );
                [
                    [p[0], p[3], p[5], first.0, across_0, third.1],
                    [p[3], p[1], p[4], first.1, second.0, across_1],
                    [p[5], p[4], p[2], across_2, second.1, third.0],
                    [p[3], p[4], p[5], across_1, across_2, across_0],
                ].map(Element::Triangle)
            }
        }
    }
}

/// The node sets of each node: a new node is in the sets that contain all nodes of its side or element.
#[derive(Clone)]
pub(super) struct Sets {
    of_node: HashMap<u32, Vec<usize>>,
}

impl Sets {
    fn new(mesh: &Mesh) -> Self {
        let mut of_node: HashMap<u32, Vec<usize>> = Default::default();
        for (k, set) in mesh.node_sets.values().enumerate() {
            for node in set {
                of_node.entry(*node).or_default().push(k);
            }
        }
        Sets { of_node }
    }

    fn inherit(&mut self, parents: &[u32], children: Range<u32>) {
        let Some(sets) = self.of_node.get(&parents[0]) else {
            return;
        };
        let holds = |k: &usize, node: &u32| self.of_node.get(node).is_some_and(|s| s.contains(k));
        let all = |k: &&usize| parents.iter().all(|node| holds(k, node));
        let common: Vec<usize> = sets.iter().filter(all).copied().collect();
        for child in children.filter(|_| !common.is_empty()) {
            self.of_node.insert(child, common.clone());
        }
    }

    pub(super) fn into_named<'a>(
        self,
        names: impl ExactSizeIterator<Item = &'a String>,
    ) -> BTreeMap<String, Vec<u32>> {
        let mut sets = vec![Vec::new(); names.len()];
        for (node, of) in self.of_node {
            of.into_iter().for_each(|k| sets[k].push(node));
        }
        sets.iter_mut().for_each(|set| set.sort_unstable());
        names.cloned().zip(sets).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::grid_mesh;
    use crate::problem::Grid;

    #[test]
    fn refining_a_grid_is_the_grid_with_halved_lines() {
        let coarse = Grid {
            x: vec![0.0, 1.0, 4.0],
            y: vec![-2.0, 0.0],
            top: None,
            bottom: None,
        };
        let fine = Grid {
            x: vec![0.0, 0.5, 1.0, 2.5, 4.0],
            y: vec![-2.0, -1.0, 0.0],
            top: None,
            bottom: None,
        };
        let (refined, direct) = (refine(&grid_mesh(&coarse)), grid_mesh(&fine));
        let sorted = |mesh: &Mesh| {
            let mut nodes = mesh.nodes.clone();
            nodes.sort_by(|a, b| a.partial_cmp(b).unwrap());
            nodes
        };
        assert_eq!(sorted(&refined), sorted(&direct));
        assert_eq!(refined.elements.len(), direct.elements.len());
        assert!(refined.inverted_elements(true).is_empty());
        for (name, edges) in &refined.boundaries {
            let place = |mesh: &Mesh, e: &Edge| mesh.edge_nodes(e);
            let expected: Vec<_> = direct.boundaries[name]
                .iter()
                .map(|e| place(&direct, e))
                .collect();
            assert_eq!(
                edges.iter().map(|e| place(&refined, e)).collect::<Vec<_>>(),
                expected,
                "{name}"
            );
        }
    }
}
