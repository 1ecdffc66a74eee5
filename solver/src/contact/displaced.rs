//! An obstacle displaced as a rigid body, and the profile that the nodes of a contact face after the displacement.

use super::curve::Ray;
use super::shape::Shape;
use super::{ContactBoundary, Profile, ROUNDING, edge_nodes};
use crate::element::edge3;
use crate::problem::{Along, Obstacle};

/// An obstacle that may be displaced in the plane. An obstacle given along the boundary is first converted to a curve,
/// by its distance from the body.
pub struct Displaced<'a> {
    shape: Shape<'a>,
    along: Along,
    boundary: &'a ContactBoundary,
    /// The normals of the body at the nodes.
    normals: &'a [[f64; 2]],
    rounding: f64,
}

impl<'a> Displaced<'a> {
    /// The obstacle at a contact boundary. `normals`: the body's normals at the nodes of the boundary.
    pub fn new(
        obstacle: &'a Obstacle,
        boundary: &'a ContactBoundary,
        normals: &'a [[f64; 2]],
    ) -> Self {
        Displaced {
            shape: Shape::new(obstacle),
            along: obstacle.span().2,
            boundary,
            normals,
            rounding: ROUNDING * boundary.s[boundary.s.len() - 1],
        }
    }

    /// The profile at a node after the displacement `by`. If the node's normal meets the curve several times, the
    /// crossing nearest to `expected` counts. `None` where the obstacle no longer faces the node.
    pub fn profile(&self, node: usize, by: [f64; 2], expected: f64) -> Option<Profile> {
        let ([x, y], n) = (self.boundary.positions[node], self.normals[node]);
        let t = [n[1], -n[0]];
        match self.shape.in_space() {
            Some(curve) => {
                let place = [x - by[0], y - by[1]];
                curve.crossing_near(&Ray { place, n, t }, self.rounding, expected)
            }
            None => self.before(node, by),
        }
    }

    /// The profile at a node after the displacement `by`, for an obstacle given along the boundary: the profile at the
    /// point of the obstacle that the displacement moves in front of the node.
    fn before(&self, node: usize, by: [f64; 2]) -> Option<Profile> {
        let (place, n) = (self.boundary.positions[node], self.normals[node]);
        let t = [n[1], -n[0]];
        let from_node = |q: f64| -> Option<[f64; 2]> {
            let point = self.point(q)?;
            let beside = [0, 1].map(|a| point[a] + by[a] - place[a]);
            Some([dot(beside, n), dot(beside, t)])
        };
        let start = 0.5 * node as f64;
        let ahead = |q: f64| from_node(q).map(|[_, ahead]| ahead);
        let mut near = (start, ahead(start)?);
        if near.1.abs() > self.rounding {
            // from node to node, to the first beyond; past the ends of the boundary, too
            let step = -0.5 * near.1.signum();
            let most = 2 * self.boundary.nodes.len();
            let mut places = (1..=most).map(|k| start + step * k as f64);
            let mut far = loop {
                let q = places.next()?;
                let there = ahead(q)?;
                if there * near.1 <= 0.0 {
                    break q;
                }
                near = (q, there);
            };
            // to rounding
            for _ in 0..60 {
                let middle = 0.5 * (near.0 + far);
                let there = ahead(middle)?;
                if there * near.1 > 0.0 {
                    near = (middle, there);
                } else {
                    far = middle;
                }
            }
        }
        const BESIDE: f64 = 1e-5;
        let [distance, _] = from_node(near.0)?;
        let [low, high] = [-BESIDE, BESIDE].map(|d| from_node(near.0 + d));
        let here = from_node(near.0);
        let ([a, b], [c, d]) = (low.or(here)?, high.or(here)?);
        Some(Profile {
            distance,
            slope: (c - a) / (d - b),
        })
    }

    /// A point of the obstacle before it is displaced, over the place q of the boundary (in edges from the boundary's
    /// start); beyond its ends the boundary is continued along its tangents there.
    fn point(&self, q: f64) -> Option<[f64; 2]> {
        let boundary = self.boundary;
        let count = boundary.edge_count();
        let edge = (q.max(0.0) as usize).min(count - 1);
        let xi = (2.0 * (q - edge as f64) - 1.0).clamp(-1.0, 1.0);
        let (h, nodes) = (edge3::shape(xi), edge_nodes(edge));
        let along = |f: &dyn Fn(usize) -> f64| edge3::interpolate(&h, &nodes.map(f));
        let n = [0, 1].map(|a| along(&|i| self.normals[i][a]));
        let n = n.map(|x| x / n[0].hypot(n[1]));
        let [start, end, _] = boundary.edge_arc(edge);
        let beyond = (q - q.clamp(0.0, count as f64)) * (end - start);
        let t = [n[1], -n[0]];
        let place = [0, 1].map(|a| along(&|i| boundary.positions[i][a]) + beyond * t[a]);
        let c = match self.along {
            Along::X => place[0],
            Along::ArcLength => along(&|i| boundary.s[i]) + beyond,
        };
        let (distance, _) = self.shape.at(c, self.rounding)?;
        Some([0, 1].map(|a| place[a] + distance * n[a]))
    }
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::HeldDirections;
    use crate::mesh::grid_mesh;
    use crate::problem::{Grid, Interpolation};

    /// A parabola moved across the body has the profile of a parabola elsewhere, whether it is given along the top or
    /// as a curve, also if it comes from beyond the ends of the boundary.
    #[test]
    fn a_parabola_that_is_moved_is_a_parabola_elsewhere() {
        let mesh = grid_mesh(&Grid {
            x: (0..=10).map(|i| 0.2 * f64::from(i) - 1.0).collect(),
            y: vec![0.0, 1.0],
            top: None,
            bottom: None,
        });
        let chain = &mesh.boundaries["top"];
        let boundary = ContactBoundary::new(&mesh, chain, 0.0, &HeldDirections::new(), |_| 1.0);
        let (from, to) = (None, None);
        let points = (-400..=400)
            .map(|i| {
                let x = 0.005 * f64::from(i);
                [x, 1.0 + 0.25 * x * x]
            })
            .collect();
        let obstacles = [
            Obstacle::Parabola {
                radius: 2.0,
                center: 0.0,
                from,
                to,
                along: Along::X,
            },
            Obstacle::Parabola {
                radius: 2.0,
                center: 1.0,
                from,
                to,
                along: Along::ArcLength,
            },
            Obstacle::Polyline {
                points,
                interpolation: Interpolation::Cubic,
                from,
                to,
                along: Along::X,
            },
        ];
        for obstacle in &obstacles {
            let displaced = Displaced::new(obstacle, &boundary, &boundary.normals);
            for by in [[0.0, 0.0], [0.3, -0.1], [-0.17, 0.2], [0.9, 0.0]] {
                for (i, place) in boundary.positions.iter().enumerate() {
                    let x = place[0] - by[0];
                    let found = displaced.profile(i, by, 0.0).unwrap();
                    let distance = 0.25 * x * x + by[1];
                    assert!((found.distance - distance).abs() < 1e-8, "{by:?} {place:?}");
                    assert!((found.slope - 0.5 * x).abs() < 1e-5, "{by:?} {place:?}");
                }
            }
        }
    }
}
