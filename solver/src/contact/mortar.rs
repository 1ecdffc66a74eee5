//! Where two chains of edges face one another: dual multipliers on the edges of one of them, integrated segment by segment.
//!
//! On each edge of the chain that carries the law, with its shape functions h and the weight ds times the depth,
//!
//!   D = diag(∫hᵢ),   M = ∫h hᵀ,   ψ = D M⁻¹ h   (∫ψᵢ hⱼ = δᵢⱼ ∫hᵢ)
//!   Pᵢₖ = Σ ∫ψᵢ h²ₖ(χ(s)) ds / Dᵢ,   gapᵢ = Σ ∫ψᵢ g(s) ds / Dᵢ,   Dᵢ = Σ ∫hᵢ over both edges
//!
//! χ projects along the field of normals, which is interpolated between the nodes, and g is the length of that projection. Where
//! the other chain has a corner node, the integrals are split. A row of P adds up to 1.

use std::collections::{BTreeMap, BTreeSet};

use super::{AXIS_SHARE, ContactBoundary, HeldDirections, aligned, edge_nodes};
use crate::element::edge3;
use crate::element::gauss::GAUSS_3;

/// The largest angle between a mean normal and a line of symmetry in which it is put: 20°.
const MIRRORED: f64 = 0.35;

/// How far beyond its very ends the other chain is continued (part of its last edge).
pub const BEYOND: f64 = 0.05;

/// The number of equal parts of a segment that are integrated by three points each: exact for straight edges in one.
const PARTS: usize = 2;

/// Two places ξ of an edge that are closer than this count as one.
const SAME_PLACE: f64 = 1e-9;

/// The number of halvings in the search for the place that faces a corner.
const HALVINGS: u32 = 60;

/// The least cosine between the normal of one chain and the opposite normal of the other where they face one another: 80°.
const FACING: f64 = 0.17;

/// How one chain follows the other.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Coupling {
    /// By node: the nodes of the other chain, by their places in it, with their weights, which add up to 1. Empty at a node of
    /// edges that are not covered.
    pub rows: Vec<Vec<(usize, f64)>>,
    /// The gap at each node, averaged by the multiplier (length).
    pub gaps: Vec<f64>,
    /// Whether the other chain faces all of an edge.
    pub covered: Vec<bool>,
    /// Where corner nodes of the other chain face covered edges: the edge, the place on it, −1 … 1, and the corner node.
    pub corners: Vec<(usize, f64, usize)>,
}

/// A place of the other chain that faces a place of this one.
#[derive(Clone, Copy, Debug)]
struct Hit {
    edge: usize,
    /// The place on that edge, −1 … 1.
    eta: f64,
    /// The distance along the normal, negative where the chains overlap.
    gap: f64,
}

/// The chain that carries the law, and the one that faces it.
struct Facing<'a> {
    own: &'a ContactBoundary,
    other: &'a ContactBoundary,
    blocks: Vec<Block>,
    /// Whether the other chain is a closed loop, which goes on at its ends.
    closed: bool,
}

/// Consecutive edges of the other chain, within a circle: a line that misses the circle misses them.
struct Block {
    edges: std::ops::Range<usize>,
    centre: [f64; 2],
    radius: f64,
}

impl<'a> Facing<'a> {
    fn new(own: &'a ContactBoundary, other: &'a ContactBoundary) -> Self {
        /// The number of edges of a block: about the root of the longest chains.
        const EDGES: usize = 64;
        let count = other.edge_count();
        let block = |first: usize| {
            let edges = first..count.min(first + EDGES);
            let nodes = &other.positions[2 * edges.start..=2 * edges.end];
            let number = nodes.len() as f64;
            let centre = [0, 1].map(|a| nodes.iter().map(|x| x[a]).sum::<f64>() / number);
            let distance = |x: &[f64; 2]| (x[0] - centre[0]).hypot(x[1] - centre[1]);
            let farthest = nodes.iter().map(distance).fold(0.0, f64::max);
            // parabolic edges bulge, and the last ones go on for a little
            let radius = 1.25 * farthest;
            Block {
                edges,
                centre,
                radius,
            }
        };
        Facing {
            own,
            other,
            blocks: (0..count).step_by(EDGES).map(block).collect(),
            closed: other.nodes[0] == other.nodes[2 * count],
        }
    }

    /// The edges of the other chain that the lines along the normals at some places of an edge, or between two of them, may hit.
    fn near(&self, lines: &[([f64; 2], [f64; 2])]) -> impl Iterator<Item = usize> + '_ {
        let hit = |block: &&Block| {
            let off = |(x, n): &([f64; 2], [f64; 2])| {
                cross([block.centre[0] - x[0], block.centre[1] - x[1]], *n)
            };
            let (low, high) = lines
                .iter()
                .map(off)
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), off| {
                    (low.min(off), high.max(off))
                });
            low <= block.radius && high >= -block.radius
        };
        let near: Vec<&Block> = self.blocks.iter().filter(hit).collect();
        near.into_iter().flat_map(|block| block.edges.clone())
    }
}

/// Couples the nodes of `own` to those of `other`. `depth`: the depth of the section at x; `axis_ends`: the ends on the axis of a
/// body of revolution, each with the midside node beside it.
pub fn couple(
    own: &ContactBoundary,
    other: &ContactBoundary,
    depth: impl Fn(f64) -> f64,
    axis_ends: &[[usize; 2]],
) -> Coupling {
    let facing = Facing::new(own, other);
    let count = own.nodes.len();
    let mut weights: Vec<BTreeMap<usize, f64>> = vec![BTreeMap::new(); count];
    let (mut gaps, mut areas) = (vec![0.0; count], vec![0.0; count]);
    let mut covered = vec![false; own.edge_count()];
    let mut corners: Vec<(usize, f64, usize)> = Vec::new();
    let mut met: BTreeSet<usize> = BTreeSet::new();
    for (edge, covered) in covered.iter_mut().enumerate() {
        let end = axis_ends
            .iter()
            .find(|[end, beside]| *beside == 2 * edge + 1 && edge_nodes(edge).contains(end));
        let on_axis = end.and_then(|[end, _]| edge_nodes(edge).iter().position(|i| i == end));
        let segments = facing.segments(edge);
        let points = segments.and_then(|all| facing.points(edge, &all, &depth, on_axis));
        let Some((points, dual)) = points.and_then(|points| {
            let dual = dual_shapes(&points)?;
            Some((points, dual))
        }) else {
            continue;
        };
        *covered = true;
        let seen = facing
            .corners(edge)
            .filter(|(_, corner)| met.insert(*corner));
        corners.extend(seen.map(|(xi, corner)| (edge, xi, corner)));
        for point in &points {
            let psi: [f64; 3] =
                std::array::from_fn(|i| (0..3).map(|j| dual[i][j] * point.shape[j]).sum());
            let h = edge3::shape(point.hit.eta);
            for (i, node) in edge_nodes(edge).into_iter().enumerate() {
                areas[node] += point.weight * point.shape[i];
                gaps[node] += point.weight * psi[i] * point.hit.gap;
                for (k, there) in edge_nodes(point.hit.edge).into_iter().enumerate() {
                    *weights[node].entry(there).or_default() += point.weight * psi[i] * h[k];
                }
            }
        }
    }
    for i in (0..count).filter(|i| areas[*i] != 0.0) {
        gaps[i] /= areas[i];
        weights[i].values_mut().for_each(|w| *w /= areas[i]);
    }
    // the unknown of the node beside the axis is what its end leaves of it: u₁ − a u₀
    for &[end, beside] in axis_ends {
        gaps[beside] += AXIS_SHARE * gaps[end];
        for (k, weight) in weights[end].clone() {
            *weights[beside].entry(k).or_default() += AXIS_SHARE * weight;
        }
    }
    Coupling {
        rows: weights
            .into_iter()
            .map(|row| row.into_iter().collect())
            .collect(),
        gaps,
        covered,
        corners,
    }
}

/// The number of places of an edge at which it is seen whether the other chain faces it.
pub const SAMPLES: usize = 32;

/// How much of an edge the other chain faces, as a part of it, and the least distance there (length); none if it faces nothing.
pub fn partly_faced(
    own: &ContactBoundary,
    other: &ContactBoundary,
    edge: usize,
) -> Option<(f64, f64)> {
    let facing = Facing::new(own, other);
    let at = |k: usize| (2 * k + 1) as f64 / SAMPLES as f64 - 1.0;
    let hits = (0..SAMPLES).filter_map(|k| {
        let (x, n) = own.place(edge, at(k));
        facing.nearest(x, n)
    });
    let gaps: Vec<f64> = hits.map(|hit| hit.gap.abs()).collect();
    let least = gaps.iter().copied().fold(f64::INFINITY, f64::min);
    (!gaps.is_empty()).then_some((gaps.len() as f64 / SAMPLES as f64, least))
}

/// Turns the normals of a chain to the mean of its own and the opposite ones of the other chain where they face one another:
/// (n₁ − n₂)/|n₁ − n₂|. On a line of symmetry, whose nodes are in `held`, it lies in the line.
pub fn take_mean_normals(
    own: &mut ContactBoundary,
    other: &ContactBoundary,
    held: &HeldDirections,
) {
    /// The place that a node faces depends on its normal.
    const PASSES: usize = 2;
    let outward = own.normals.clone();
    for _ in 0..PASSES {
        let facing = Facing::new(own, other);
        let mean = |i: usize| {
            let hit = facing.nearest(own.positions[i], own.normals[i])?;
            let there = other.normal_at(hit.edge, hit.eta);
            let [x, y] = [0, 1].map(|a| outward[i][a] - there[a]);
            let length = x.hypot(y);
            let mean = [x / length, y / length];
            Some(match held.get(&own.nodes[i]) {
                // beyond a line of symmetry both surfaces go on, mirrored
                Some((direction, _)) => aligned(mean, *direction, MIRRORED),
                None => mean,
            })
        };
        let normals: Vec<_> = (0..own.nodes.len())
            .map(|i| mean(i).unwrap_or(own.normals[i]).map(|n| n + 0.0))
            .collect();
        own.normals = normals;
    }
}

/// A point of integration on an edge.
struct Point {
    /// The shape functions of the edge; beside the axis h₀ + a h₁ in place of h₀.
    shape: [f64; 3],
    weight: f64,
    hit: Hit,
}

/// ψ = D M⁻¹ h on an edge: the coefficients of the shape functions in each ψ; none if they are not finite.
fn dual_shapes(points: &[Point]) -> Option<[[f64; 3]; 3]> {
    let sum = |f: &dyn Fn(&[f64; 3]) -> f64| -> f64 {
        points.iter().map(|p| p.weight * f(&p.shape)).sum()
    };
    let mass: [[f64; 3]; 3] =
        std::array::from_fn(|i| std::array::from_fn(|j| sum(&|h| h[i] * h[j])));
    let area: [f64; 3] = std::array::from_fn(|i| sum(&|h| h[i]));
    let minor = |i: usize, j: usize| {
        let [a, b] = [(i + 1) % 3, (i + 2) % 3];
        let [c, d] = [(j + 1) % 3, (j + 2) % 3];
        mass[a][c] * mass[b][d] - mass[a][d] * mass[b][c]
    };
    let determinant: f64 = (0..3).map(|j| mass[0][j] * minor(0, j)).sum();
    let dual: [[f64; 3]; 3] =
        std::array::from_fn(|i| std::array::from_fn(|j| area[i] * minor(j, i) / determinant));
    dual.as_flattened()
        .iter()
        .all(|x| x.is_finite())
        .then_some(dual)
}

impl Facing<'_> {
    /// The pieces of an edge between which another edge of the other chain faces it: their ends, and the number of that edge.
    /// None if it does not face all of the edge.
    fn segments(&self, edge: usize) -> Option<Vec<([f64; 2], usize)>> {
        let mut places = vec![-1.0, 1.0];
        places.extend(self.corners(edge).map(|(xi, _)| xi));
        places.sort_by(f64::total_cmp);
        places.dedup_by(|a, b| *a - *b < SAME_PLACE);
        // the last of two that are one is kept at the end of the edge
        if let Some(last) = places.last_mut() {
            *last = 1.0;
        }
        let segment = |ends: &[f64]| {
            let [a, b] = [ends[0], ends[1]];
            let (x, n) = self.own.place(edge, 0.5 * (a + b));
            let there = self.nearest(x, n)?.edge;
            // all of it
            let inside = [a, b].into_iter().all(|xi| {
                let (x, n) = self.own.place(edge, xi);
                self.hit(x, n, there).is_some_and(|hit| {
                    let [low, high] = self.reach(there, 10.0 * SAME_PLACE);
                    (low..=high).contains(&hit.eta)
                })
            });
            inside.then_some(([a, b], there))
        };
        places.windows(2).map(segment).collect()
    }

    /// The corner nodes of the other chain that face an edge, each after its place on the edge.
    fn corners(&self, edge: usize) -> impl Iterator<Item = (f64, usize)> + '_ {
        let ends = [-1.0, 0.0, 1.0].map(|xi| self.own.place(edge, xi));
        let near: BTreeSet<usize> = self
            .near(&ends)
            .flat_map(|edge| [2 * edge, 2 * edge + 2])
            .collect();
        let place = move |corner: usize| Some((self.facing_corner(edge, corner)?, corner));
        near.into_iter().filter_map(place)
    }

    /// The place of an edge that a corner node of the other chain faces.
    fn facing_corner(&self, edge: usize, corner: usize) -> Option<f64> {
        let at = self.other.positions[corner];
        let off = |xi: f64| {
            let (x, n) = self.own.place(edge, xi);
            cross([at[0] - x[0], at[1] - x[1]], n)
        };
        let (mut low, mut high) = (-1.0, 1.0);
        let (start, end) = (off(low), off(high));
        if start * end > 0.0 {
            return None;
        }
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            match off(middle) * start > 0.0 {
                true => low = middle,
                false => high = middle,
            }
        }
        let xi = match [start == 0.0, end == 0.0] {
            [true, _] => -1.0,
            [_, true] => 1.0,
            _ => 0.5 * (low + high),
        };
        let mut nodes = [-1.0, 0.0, 1.0].into_iter();
        let xi = nodes
            .rfind(|node| f64::abs(node - xi) < SAME_PLACE)
            .unwrap_or(xi);
        let (_, n) = self.own.place(edge, xi);
        faces(n, self.other.normals[corner]).then_some(xi)
    }

    /// The range of places, −1 … 1, in which an edge of the other chain counts: its first and its last go on for a little.
    fn reach(&self, edge: usize, rounding: f64) -> [f64; 2] {
        let last = self.other.edge_count() - 1;
        let beyond = |ends: bool| match ends && !self.closed {
            true => 2.0 * BEYOND + rounding,
            false => rounding,
        };
        [-1.0 - beyond(edge == 0), 1.0 + beyond(edge == last)]
    }

    /// The place of an edge of the other chain that faces a place along a normal, also beyond its ends.
    fn hit(&self, x: [f64; 2], n: [f64; 2], edge: usize) -> Option<Hit> {
        let nodes = edge_nodes(edge);
        let positions = nodes.map(|i| self.other.positions[i]);
        let away = positions.map(|p| [p[0] - x[0], p[1] - x[1]]);
        let roots = edge3::roots(&away.map(|a| cross(a, n))).into_iter();
        let eta = roots.min_by(|a, b| a.abs().total_cmp(&b.abs()))?;
        let (there, _) = edge3::map(&away, eta);
        let hit = Hit {
            edge,
            eta,
            gap: there[0] * n[0] + there[1] * n[1],
        };
        hit.eta.is_finite().then_some(hit)
    }

    /// The nearest place of the other chain that faces a place along a normal.
    fn nearest(&self, x: [f64; 2], n: [f64; 2]) -> Option<Hit> {
        let hits = self.near(&[(x, n)]).filter_map(|edge| {
            let hit = self.hit(x, n, edge)?;
            let [low, high] = self.reach(edge, SAME_PLACE);
            let inside = (low..=high).contains(&hit.eta);
            (inside && faces(n, self.other.normal_at(edge, hit.eta))).then_some(hit)
        });
        hits.min_by(|a, b| a.gap.abs().total_cmp(&b.gap.abs()))
    }

    /// The points of integration on an edge; none if one of them faces nothing. `on_axis`: which of its nodes (start, end) lies on the
    /// axis.
    fn points(
        &self,
        edge: usize,
        segments: &[([f64; 2], usize)],
        depth: &impl Fn(f64) -> f64,
        on_axis: Option<usize>,
    ) -> Option<Vec<Point>> {
        let positions = edge_nodes(edge).map(|i| self.own.positions[i]);
        let mut points = Vec::new();
        for &([a, b], there) in segments {
            for part in 0..PARTS {
                let step = (b - a) / PARTS as f64;
                let middle = a + (part as f64 + 0.5) * step;
                for (xi, w) in GAUSS_3 {
                    let xi = middle + 0.5 * step * xi;
                    let (x, n) = self.own.place(edge, xi);
                    let hit = self.hit(x, n, there)?;
                    let (_, [dx, dy]) = edge3::map(&positions, xi);
                    let mut shape = edge3::shape(xi);
                    if let Some(end) = on_axis {
                        shape[end] += AXIS_SHARE * shape[2];
                    }
                    points.push(Point {
                        shape,
                        weight: 0.5 * step * w * dx.hypot(dy) * depth(x[0]),
                        hit,
                    });
                }
            }
        }
        Some(points)
    }
}

impl ContactBoundary {
    /// The position at a place of an edge, −1 … 1, and the normal there, interpolated between the nodes.
    fn place(&self, edge: usize, xi: f64) -> ([f64; 2], [f64; 2]) {
        let (x, _) = edge3::map(&edge_nodes(edge).map(|i| self.positions[i]), xi);
        (x, self.normal_at(edge, xi))
    }

    /// The normal at a place of an edge (unit vector).
    fn normal_at(&self, edge: usize, xi: f64) -> [f64; 2] {
        let ([x, y], _) = edge3::map(&edge_nodes(edge).map(|i| self.normals[i]), xi);
        let length = x.hypot(y);
        [x / length, y / length]
    }
}

/// Whether two surfaces with these outward normals face one another.
fn faces(n: [f64; 2], other: [f64; 2]) -> bool {
    n[0] * other[0] + n[1] * other[1] <= -FACING
}

fn cross(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}
