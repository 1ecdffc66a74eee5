//! Forces and displacements that are given at nodes of the first mesh, transferred to a refined mesh.
//!
//! Where they are given at all nodes of a side, they apply to the whole side: a support holds it, as those nodes do on
//! the first mesh, and forces become the traction that does the same work for all displacements of that side. Both have
//! a limit as the mesh is refined. At other nodes they are kept. The sides of elements with corners only, which got
//! midsides when their file was read, have linear displacements for this purpose.

use std::collections::{BTreeMap, BTreeSet};

use crate::contact::edge_length;
use crate::element::edge3;
use crate::mesh::{Edge, FirstSide, Mesh};
use crate::problem::{Load, Problem};

/// Forces by node of the first mesh.
pub(super) type Forces = BTreeMap<u32, [f64; 2]>;

/// The sides of a first mesh that have other nodes on the refined mesh.
pub(super) struct FirstSides<'a> {
    mesh: &'a Mesh,
    /// The sides, by midside node.
    sides: BTreeMap<u32, FirstSide>,
}

impl<'a> FirstSides<'a> {
    /// Finds the sides, if the problem gives forces or displacements at nodes; else none.
    pub(super) fn new(mesh: &'a Mesh, problem: &Problem) -> Self {
        let at_nodes = |load: &Load| matches!(load, Load::Force(..) | Load::Nodal(..));
        let given = problem.loads.iter().any(at_nodes)
            || problem
                .supports
                .iter()
                .any(|support| support.nodes.is_some());
        let sides = if given && mesh.has_later_nodes() {
            mesh.first_sides()
        } else {
            BTreeMap::new()
        };
        FirstSides { mesh, sides }
    }

    /// Transfers forces at nodes of the first mesh to this mesh: first, for each load, the forces on surface sides all
    /// of whose nodes the load names; then the remaining forces of all loads together, which may be given node by node.
    pub(super) fn carried(&self, loads: Vec<Forces>) -> Vec<(u32, [f64; 2])> {
        let mut found = Vec::new();
        let mut left = Forces::new();
        for mut forces in loads {
            let nodes = forces.keys();
            let of_midsides = nodes.filter_map(|node| Some((*node, self.sides.get(node)?)));
            let sides: Vec<_> = of_midsides.filter(|(_, side)| !side.inside).collect();
            self.spread(&mut forces, &sides, &mut found);
            for (node, [x, y]) in forces {
                let sum = left.entry(node).or_default();
                *sum = [sum[0] + x, sum[1] + y];
            }
        }
        for inside in [false, true] {
            let sides = self.sides.iter().map(|(mid, side)| (*mid, side));
            let sides: Vec<_> = sides.filter(|(_, side)| side.inside == inside).collect();
            self.spread(&mut left, &sides, &mut found);
        }
        found.extend(left);
        found
    }

    /// Removes from `forces` the forces on all nodes of `sides`, and adds them to `found` as forces on the nodes of the
    /// sides' parts.
    fn spread(
        &self,
        forces: &mut Forces,
        sides: &[(u32, &FirstSide)],
        found: &mut Vec<(u32, [f64; 2])>,
    ) {
        let nodes = sides.iter().filter_map(|(_, side)| {
            let edge = side.parts.first()?.side;
            self.is_given(&edge, |node| forces.contains_key(&node))
                .then_some((edge, *side))
        });
        let loaded: Vec<(Edge, &FirstSide)> = nodes.collect();
        // sides share the force on their common corner by their lengths, as those of a uniform traction do
        let mut around: BTreeMap<u32, f64> = BTreeMap::new();
        for ([a, b, mid], _) in &loaded {
            let length = edge_length(self.mesh, &[*a, *b, *mid]);
            for node in [a, b] {
                *around.entry(*node).or_default() += length;
            }
        }
        let mut spent = BTreeSet::new();
        for (edge, side) in loaded {
            let length = edge_length(self.mesh, &edge);
            let share = |node: u32| {
                let part = around.get(&node).map_or(1.0, |sum| length / sum);
                Some(forces.get(&node)?.map(|f| part * f))
            };
            let [start, end, middle] = edge.map(share);
            let zero = [0.0; 2];
            let ends = [start.unwrap_or(zero), end.unwrap_or(zero)];
            for part in &side.parts {
                let places = part.places();
                let each = [0, 1].map(|a| {
                    let ends = ends.map(|force| force[a]);
                    on_part(ends, middle.map(|force| force[a]), places)
                });
                let at = |k: usize| (part.edge[k], [each[0][k], each[1][k]]);
                found.extend([0, 1, 2].map(at));
            }
            spent.extend(edge);
        }
        forces.retain(|node, _| !spent.contains(node));
    }

    /// The displacements at all nodes of sides that have prescribed displacements at all their nodes of the first mesh.
    pub(super) fn between(&self, prescribed: &BTreeMap<u32, f64>) -> Vec<(u32, f64)> {
        let mut found = Vec::new();
        for side in self.sides.values() {
            for part in &side.parts {
                if !self.is_given(&part.side, |node| prescribed.contains_key(&node)) {
                    break;
                }
                let [start, end, middle] = part.side.map(|node| prescribed.get(&node).copied());
                let (Some(start), Some(end)) = (start, end) else {
                    break;
                };
                let middle = middle.unwrap_or(0.5 * (start + end));
                let values = [start, end, middle];
                let at = |xi: f64| edge3::interpolate(&edge3::shape(xi), &values);
                found.extend(part.edge.into_iter().zip(part.places().map(at)));
            }
        }
        found
    }

    /// Whether all nodes of a side are given, apart from a midside that the mesh's file did not have.
    fn is_given(&self, [a, b, mid]: &Edge, given: impl Fn(u32) -> bool) -> bool {
        let raised = || self.mesh.is_raised(&[*a, *b, *mid]);
        given(*a) && given(*b) && (given(*mid) || raised())
    }
}

/// The forces on the start, end and midside of a part of a side, in one direction. The first two arguments are the
/// forces on the ends and on the middle of the side; without a middle the side has linear displacements. `places`: the
/// places of the part's nodes on the side.
///
/// With the side's shape functions h_i(ξ), −1 ≤ ξ ≤ 1, and the forces F_i on its nodes, the traction per dξ is the
/// combination q of the h_i with ∫ q h_i dξ = F_i. The forces on the nodes of a part of the side are ∫ q H_k dξ, with
/// the shape functions H_k of the part.
fn on_part([start, end]: [f64; 2], middle: Option<f64>, places: [f64; 3]) -> [f64; 3] {
    if places == [-1.0, 1.0, 0.0]
        && let Some(middle) = middle
    {
        return [start, end, middle];
    }
    // the inverse of the matrix of the ∫ h_i h_k dξ, apart for what is even and what is odd in ξ
    let traction = match middle {
        Some(middle) => {
            let (even, odd) = (0.5 * (start + end), 1.5 * (start - end));
            let at_ends = 6.0 * even - 0.75 * middle;
            let in_middle = 1.125 * middle - 1.5 * even;
            [at_ends + odd, at_ends - odd, in_middle]
        }
        None => [2.0 * start - end, 2.0 * end - start, 0.5 * (start + end)],
    };
    let at = |xi: f64| edge3::interpolate(&edge3::shape(xi), &traction);
    let [a, b, m] = places.map(at);
    let half = 0.5 * (places[1] - places[0]).abs() / 15.0;
    [
        half * (4.0 * a - b + 2.0 * m),
        half * (4.0 * b - a + 2.0 * m),
        half * (2.0 * a + 2.0 * b + 16.0 * m),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Forces on parts do the work of those on the side: on the side itself they are unchanged, and on its parts they
    /// have the same sum and the same moments, of any order that the side's displacements have.
    #[test]
    fn forces_on_parts_do_the_work_of_those_on_the_side() {
        let (ends, middle) = ([2.0, -7.0], 11.0);
        assert_eq!(
            on_part(ends, Some(middle), [-1.0, 1.0, 0.0]),
            [2.0, -7.0, 11.0]
        );
        let breaks = [-1.0, -0.75, -0.5, 0.0, 0.5, 1.0];
        for power in 0..=2 {
            let work = |middle: Option<f64>| -> f64 {
                let parts = breaks.windows(2).map(|ends_of| {
                    let places = [ends_of[0], ends_of[1], 0.5 * (ends_of[0] + ends_of[1])];
                    let forces = on_part(ends, middle, places);
                    let each = forces.iter().zip(places).map(|(f, xi)| f * xi.powi(power));
                    each.sum::<f64>()
                });
                parts.sum()
            };
            let of_ends = ends[0] * (-1f64).powi(power) + ends[1];
            let of_middle = middle * 0f64.powi(power);
            assert!((work(Some(middle)) - of_ends - of_middle).abs() < 1e-13);
            if power < 2 {
                assert!((work(None) - of_ends).abs() < 1e-13);
            }
        }
    }

    /// Forces in the ratio 1 : 4 : 1, and 1 : 1 on a linear side, are those of a uniform traction.
    #[test]
    fn forces_of_a_uniform_traction_are_that_traction() {
        let quarter = [-1.0, -0.5, -0.75];
        let uniform = [1.0 / 24.0, 1.0 / 24.0, 4.0 / 24.0];
        let close = |found: [f64; 3]| (0..3).all(|k| (found[k] - uniform[k]).abs() < 1e-15);
        assert!(close(on_part([1.0 / 6.0; 2], Some(4.0 / 6.0), quarter)));
        assert!(close(on_part([0.5; 2], None, quarter)));
    }
}
