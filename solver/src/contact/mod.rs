//! The geometry of Γ_C, thesis 1.3(c) and 3.3.1: a chain of edges in order of arc length, with
//! normals, weights and the points where friction is evaluated.
//!
//! # Where to look
//!
//! | subject | where |
//! |---|---|
//! | which part of a boundary faces an obstacle, distances at nodes, and what lies between nodes | `obstacle` |
//! | the shape of each kind of obstacle: a function, or a curve in space | `shape`, `curve` |
//! | an obstacle that is displaced along a direction | `displaced` |
//! | another body that faces the contact | `mortar` |
//! | where the surface is smooth and where it has a corner | `smooth` |

mod curve;
mod displaced;
pub mod mortar;
pub mod obstacle;
mod shape;
pub mod smooth;

pub use displaced::Displaced;
pub use smooth::edge_normals;

use std::collections::BTreeMap;

use crate::element::edge3;
use crate::element::gauss::GAUSS_3;
use crate::mesh::{Edge, Mesh};

/// Positions count as equal within this fraction of a length, since they coincide with grid lines only up to rounding.
const ROUNDING: f64 = 1e-9;

/// The share a = 1/8 in the unknown u_n − a u_n⁰ of the midside node beside a contact's end on the axis, with u_n⁰ the
/// displacement of this end. The end has no area of its own: ∫ h₀ r dr = 0. With a = 1/8 the end's unknown moves h₀ +
/// h₁/8, whose area is 1/8 of the area of h₁, and the pressure at the end, the unknown's reaction over this area, is
/// exact for p = p₀ + β r² (formulation 3.5).
pub const AXIS_SHARE: f64 = 0.125;

/// The directions (unit vectors, with their errors as angles) along which supports hold nodes.
pub type HeldDirections = BTreeMap<u32, ([f64; 2], f64)>;

/// Distance and slope of an obstacle at a place on the boundary.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Profile {
    /// Distance along the body's normal (length); the indentation is not yet subtracted.
    pub distance: f64,
    /// The change of the distance per length along t; at a kink the mean of the changes on both sides.
    pub slope: f64,
}

/// Γ_C as points in arc-length order.
///
/// ```text
///        body on the right of the direction of s
///   0 ---1--- 2 ---3--- 4        even: corners, odd: midsides; edge k has nodes 2k, 2k+2, 2k+1
///   s = 0 at the start of the named boundary; t along growing s; n = t turned counter-clockwise, out of the body
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ContactBoundary {
    /// The mesh nodes.
    pub nodes: Vec<u32>,
    /// The positions of the nodes.
    pub positions: Vec<[f64; 2]>,
    /// The arc length from the start of the named boundary, whatever part of it faces the obstacle.
    pub s: Vec<f64>,
    /// The unit outward normal; at a corner the mean of the normals of both edges, also at an end where the surface
    /// continues smoothly.
    pub normals: Vec<[f64; 2]>,
    /// How far each normal may deviate from the normal of the surface (angle).
    pub normal_errors: Vec<f64>,
    /// The area ∫ h_i with the depth of the section; a nodal force divided by it is a pressure.
    pub weights: Vec<f64>,
    /// The points where friction acts, three Gauss points on each edge.
    pub friction_points: Vec<FrictionPoint>,
}

/// A point where friction acts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrictionPoint {
    /// The arc length.
    pub s: f64,
    /// The three chain nodes of the point's edge.
    pub nodes: [usize; 3],
    /// The shape functions of these nodes at the point.
    pub shape: [f64; 3],
    /// Weight of the point in an integral along Γ_C, with the depth of the section.
    pub weight: f64,
}

impl ContactBoundary {
    /// The contact along consecutive edges, with the first node at arc length `start`; `depth` as in
    /// `elasticity::Section`. A normal that is parallel or perpendicular to a direction of `held`, within the errors of
    /// both, is made exactly parallel or perpendicular: on a line of symmetry it lies in that line.
    pub fn new(
        mesh: &Mesh,
        chain: &[Edge],
        start: f64,
        held: &HeldDirections,
        depth: impl Fn(f64) -> f64,
    ) -> Self {
        let count = 2 * chain.len() + 1;
        let mut boundary = ContactBoundary {
            nodes: vec![0; count],
            positions: vec![[0.0; 2]; count],
            s: arc_lengths(mesh, chain).iter().map(|s| start + s).collect(),
            normals: vec![[0.0; 2]; count],
            normal_errors: vec![0.0; count],
            weights: vec![0.0; count],
            friction_points: Vec::with_capacity(3 * chain.len()),
        };
        for (k, edge) in chain.iter().enumerate() {
            let local = edge_nodes(k);
            let positions = mesh.edge_nodes(edge);
            let error = smooth::direction_error(&positions);
            for (i, [x, y]) in edge_normals(&positions).into_iter().enumerate() {
                let known = &mut boundary.normal_errors[local[i]];
                *known = error.max(*known);
                boundary.nodes[local[i]] = edge[i];
                boundary.positions[local[i]] = positions[i];
                boundary.normals[local[i]][0] += x;
                boundary.normals[local[i]][1] += y;
            }
            for (xi, w) in GAUSS_3 {
                let shape = edge3::shape(xi);
                let ([x, _], [dx, dy]) = edge3::map(&positions, xi);
                let weight = w * dx.hypot(dy) * depth(x);
                (0..3).for_each(|i| boundary.weights[local[i]] += weight * shape[i]);
                let s = edge3::interpolate(&shape, &local.map(|i| boundary.s[i]));
                boundary.friction_points.push(FrictionPoint {
                    s,
                    nodes: local,
                    shape,
                    weight,
                });
            }
        }
        let beyond = smooth::normals_beyond(mesh, chain);
        for i in 0..count {
            let (node, [mut x, mut y]) = (boundary.nodes[i], boundary.normals[i]);
            if let Some([a, b]) = beyond.get(&node) {
                (x, y) = (x + a, y + b);
            }
            let length = x.hypot(y);
            let mut normal = [x / length, y / length];
            if let Some((direction, error)) = held.get(&node) {
                normal = aligned(normal, *direction, boundary.normal_errors[i] + error);
            }
            // + 0.0 turns −0 into 0, so that an axis-parallel normal is exactly that
            boundary.normals[i] = normal.map(|n| n + 0.0);
        }
        boundary
    }

    /// The arc length from the first node to the last.
    pub fn length(&self) -> f64 {
        self.s[self.s.len() - 1] - self.s[0]
    }

    /// Number of edges.
    pub fn edge_count(&self) -> usize {
        self.nodes.len() / 2
    }

    /// The tangent at a node: the normal turned clockwise.
    pub fn tangent(&self, node: usize) -> [f64; 2] {
        let [x, y] = self.normals[node];
        [y, -x]
    }

    /// The angle by which the body's surface turns at a node between two edges: 0 where it is smooth, positive at a corner
    /// that points at the obstacle.
    pub fn corner(&self, node: usize) -> f64 {
        self.sides_at(node)
            .map_or(0.0, |[before, after]| smooth::corner(&before, &after))
    }

    /// The angle by which the body's surface turns at a node between two edges, also where it is taken as smooth.
    pub fn turn(&self, node: usize) -> f64 {
        self.sides_at(node)
            .map_or(0.0, |[before, after]| smooth::turn(&before, &after))
    }

    /// The two sides that meet at a node; none at midside nodes and at the ends.
    fn sides_at(&self, node: usize) -> Option<[smooth::Side; 2]> {
        let side = |edge: usize| edge_nodes(edge).map(|i| self.positions[i]);
        let between = node.is_multiple_of(2) && node > 0 && node + 1 < self.nodes.len();
        between.then(|| [side(node / 2 - 1), side(node / 2)])
    }

    /// Arc lengths of an edge's nodes (start, end, midside).
    pub fn edge_arc(&self, edge: usize) -> [f64; 3] {
        edge_nodes(edge).map(|i| self.s[i])
    }
}

/// The normal (unit vector), or `direction` or its perpendicular if the normal agrees with one of them within `error`
/// (angle).
fn aligned(normal: [f64; 2], direction: [f64; 2], error: f64) -> [f64; 2] {
    let ([a, b], [x, y]) = (normal, direction);
    let (sine, cosine) = (a * y - b * x, a * x + b * y);
    match error.sin() {
        error if sine.abs() <= error => [x, y].map(|d| cosine.signum() * d),
        error if cosine.abs() <= error => [y, -x].map(|d| sine.signum() * d),
        _ => normal,
    }
}

/// The chain nodes (start, end, midside) of an edge.
pub fn edge_nodes(edge: usize) -> [usize; 3] {
    [2 * edge, 2 * edge + 2, 2 * edge + 1]
}

/// Arc length at the nodes of a chain of edges, from its first node.
pub fn arc_lengths(mesh: &Mesh, chain: &[Edge]) -> Vec<f64> {
    let mut s = vec![0.0];
    for edge in chain {
        for half in halves(mesh, edge) {
            s.push(s[s.len() - 1] + half);
        }
    }
    s
}

/// Arc length of an edge.
pub fn edge_length(mesh: &Mesh, edge: &Edge) -> f64 {
    let [first, second] = halves(mesh, edge);
    first + second
}

/// Arc length of an edge, given the positions of its start, end and midside.
pub(crate) fn length_through(positions: &[[f64; 2]; 3]) -> f64 {
    let [first, second] = halves_through(positions);
    first + second
}

/// Arc lengths of an edge from its start to its midside, and on to its end.
fn halves(mesh: &Mesh, edge: &Edge) -> [f64; 2] {
    halves_through(&mesh.edge_nodes(edge))
}

fn halves_through(positions: &[[f64; 2]; 3]) -> [f64; 2] {
    // each half by three points: exact for a straight edge, enough for a gently curved one
    [-0.5, 0.5].map(|centre| {
        let part = |(xi, w): &(f64, f64)| {
            let [dx, dy] = edge3::map(positions, centre + 0.5 * xi).1;
            0.5 * w * dx.hypot(dy)
        };
        GAUSS_3.iter().map(part).sum()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn top(points: &[[f64; 2]]) -> (Mesh, Vec<Edge>) {
        let chain = (0..points.len() / 2)
            .map(|k| edge_nodes(k).map(|n| n as u32))
            .collect();
        (
            Mesh {
                nodes: points.to_vec(),
                ..Mesh::default()
            },
            chain,
        )
    }

    #[test]
    fn a_top_edge_has_its_normal_up_and_its_tangent_along_x() {
        let (mesh, chain) = top(&[[0.0, 1.0], [1.0, 1.0], [2.0, 1.0], [2.5, 1.0], [3.0, 1.0]]);
        let boundary = ContactBoundary::new(&mesh, &chain, 0.0, &BTreeMap::new(), |_| 1.0);
        assert_eq!(boundary.s, [0.0, 1.0, 2.0, 2.5, 3.0]);
        for i in 0..5 {
            assert_eq!(
                (boundary.normals[i], boundary.tangent(i)),
                ([0.0, 1.0], [1.0, 0.0])
            );
        }
        let exact = [
            2.0 / 6.0,
            8.0 / 6.0,
            2.0 / 6.0 + 1.0 / 6.0,
            4.0 / 6.0,
            1.0 / 6.0,
        ];
        assert!(
            boundary
                .weights
                .iter()
                .zip(exact)
                .all(|(w, e)| (w - e).abs() < 1e-15)
        );
    }

    #[test]
    fn a_node_on_the_axis_has_no_weight() {
        let (mesh, chain) = top(&[[0.0, 0.0], [0.5, 0.0], [1.0, 0.0]]);
        let boundary = ContactBoundary::new(&mesh, &chain, 0.0, &BTreeMap::new(), |r| r);
        assert!(boundary.weights[0].abs() < 1e-16);
        assert!((boundary.weights.iter().sum::<f64>() - 0.5).abs() < 1e-15);
    }

    #[test]
    fn arc_length_of_a_quarter_circle_of_two_edges_is_close_to_the_arc() {
        let at = |k: usize| (std::f64::consts::FRAC_PI_2 * (1.0 - k as f64 / 4.0)).sin_cos();
        let points: Vec<_> = (0..5)
            .map(|k| {
                let (s, c) = at(k);
                [c, s]
            })
            .collect();
        let (mesh, chain) = top(&points);
        let s = arc_lengths(&mesh, &chain);
        assert!((s[4] - std::f64::consts::FRAC_PI_2).abs() < 2e-3);
        let edges: f64 = chain.iter().map(|edge| edge_length(&mesh, edge)).sum();
        assert!((edges - s[4]).abs() < 1e-15);
        // the chords are 2.5 % shorter
        assert!(edges > 1.02 * 4.0 * (std::f64::consts::FRAC_PI_4 / 2.0).sin());
    }
}
