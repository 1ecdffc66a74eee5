//! Where the surface of a body is smooth: one criterion for everything that depends on the direction of its normal.
//!
//! A side is a parabola through three nodes. On a curve, the direction at its ends differs from the curve's by an angle
//! that follows from the side itself: α³/4 for a side of a circle that turns by 2α; 4δα for a side whose midside node
//! is away from the middle by a part δ of its length. Two sides of different lengths h on a curve of curvature κ differ
//! at their common node by
//! |h₁ − h₂|·|κ₁ − κ₂|/6. Directions that differ by a few such errors are taken as equal; beyond that the surface has a corner.
//! Straight sides have no such error: where they meet at an angle, there is a corner.

use std::collections::BTreeMap;

use crate::element::edge3;
use crate::mesh::{Edge, Mesh};

/// A curve is smooth where directions differ by at most this many times the errors of the sides (as on ellipses, waves
/// and cubics of ten or more sides, also of unequal length, and on circles of four).
const ERRORS: f64 = 4.0;

/// The factor on the error by different lengths and curvatures of two sides.
const DIFFERENCES: f64 = 2.0;

/// The error of a side's direction if coordinates have six to eight digits (angle): 0.03°.
const PRINTED: f64 = 5e-4;

/// The surface has a corner where it turns by more than this angle, however coarse its sides are: 15°.
const CORNER: f64 = 0.26;

/// Positions of a side's start, end and midside.
pub type Side = [[f64; 2]; 3];

/// Unit outward normals of an edge at its start, end and midside.
pub fn edge_normals(positions: &Side) -> [[f64; 2]; 3] {
    [-1.0, 1.0, 0.0].map(|xi| edge_normal(positions, xi))
}

/// Unit outward normal of an edge at the place `xi` on it, −1 … 1.
pub fn edge_normal(positions: &Side, xi: f64) -> [f64; 2] {
    let [dx, dy] = edge3::map(positions, xi).1;
    let length = dx.hypot(dy);
    [-dy / length, dx / length]
}

/// How far the direction of a side at its ends may deviate from the direction of the surface (angle).
pub fn direction_error(side: &Side) -> f64 {
    let shape = SideShape::of(side);
    (ERRORS * shape.error + PRINTED).min(CORNER)
}

/// The angle by which the surface turns from one side to the next: 0 where it is smooth, positive at a corner that
/// points out of the body, and negative at a corner that points into the body.
pub fn corner(before: &Side, after: &Side) -> f64 {
    let turn = turn(before, after);
    let [a, b] = [before, after].map(SideShape::of);
    let differs = (a.length - b.length).abs() * (a.curvature - b.curvature).abs() / 6.0;
    let error = ERRORS * (a.error + b.error) + DIFFERENCES * differs + 2.0 * PRINTED;
    if turn.abs() <= error.min(CORNER) {
        0.0
    } else {
        turn
    }
}

/// The angle by which the surface turns from one side to the next, also where it is taken as smooth; sign as of [`corner`].
pub fn turn(before: &Side, after: &Side) -> f64 {
    let [[ax, ay], [bx, by]] = [end_direction(before, 1.0), end_direction(after, -1.0)];
    // the body lies on the right
    (ay * bx - ax * by).atan2(ax * bx + ay * by)
}

/// The unit normals of the sides of the surface beyond the ends of a boundary, by the node where they meet, if the
/// surface continues smoothly there.
pub fn normals_beyond(mesh: &Mesh, boundary: &[Edge]) -> BTreeMap<u32, [f64; 2]> {
    // nodes that one side of the boundary has, and how it reaches them
    let mut ends: BTreeMap<(u32, bool), Edge> = BTreeMap::new();
    for edge in boundary {
        for (node, starts) in [(edge[0], true), (edge[1], false)] {
            if ends.remove(&(node, !starts)).is_none() {
                ends.insert((node, starts), *edge);
            }
        }
    }
    let mut found = BTreeMap::new();
    if ends.is_empty() {
        return found;
    }
    for side in mesh.surface() {
        for (node, starts) in [(side[0], true), (side[1], false)] {
            let Some(own) = ends.get(&(node, !starts)) else {
                continue;
            };
            let [own, beyond] = [own, &side].map(|edge| mesh.edge_nodes(edge));
            let (before, after) = if starts {
                (&own, &beyond)
            } else {
                (&beyond, &own)
            };
            if corner(before, after) == 0.0 {
                let [start, end, _] = edge_normals(&beyond);
                found.insert(node, if starts { start } else { end });
            }
        }
    }
    found
}

/// The direction of a side at one of its ends, ξ = ∓1, as a vector of any length.
fn end_direction([start, end, middle]: &Side, xi: f64) -> [f64; 2] {
    [0, 1].map(|a| {
        let bow = middle[a] - 0.5 * (start[a] + end[a]);
        0.5 * (end[a] - start[a]) - 2.0 * xi * bow
    })
}

/// Length, curvature and error of a side as a part of a curve.
struct SideShape {
    /// The length of the side's chord.
    length: f64,
    /// The angle by which the side turns per length of its chord, with sign.
    curvature: f64,
    /// The error of the side's directions at its ends, if it stands for a curve (angle).
    error: f64,
}

impl SideShape {
    fn of([start, end, middle]: &Side) -> Self {
        let chord = [end[0] - start[0], end[1] - start[1]];
        let bow = [0, 1].map(|a| middle[a] - 0.5 * (start[a] + end[a]));
        let square = chord[0].powi(2) + chord[1].powi(2);
        let along = (chord[0] * bow[0] + chord[1] * bow[1]) / square;
        let across = (chord[0] * bow[1] - chord[1] * bow[0]) / square;
        // half of the turn
        let alpha = (4.0 * across).atan();
        let length = square.sqrt();
        SideShape {
            length,
            curvature: 2.0 * alpha / length,
            error: alpha.abs().powi(3) / 4.0 + 4.0 * along.abs() * alpha.abs(),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{PI, TAU};

    use super::*;

    /// A side of a curve between two parameters, with its midside at the mean parameter.
    fn side(curve: impl Fn(f64) -> [f64; 2], from: f64, to: f64) -> Side {
        [from, to, 0.5 * (from + to)].map(curve)
    }

    /// A side turned, moved, scaled, and rounded to `digits` digits.
    fn placed(side: Side, angle: f64, scale: f64, digits: usize) -> Side {
        let (s, c) = angle.sin_cos();
        side.map(|[x, y]| {
            [c * x - s * y, s * x + c * y].map(|value| {
                let value = scale * (value + 0.3);
                format!("{value:.digits$e}").parse().unwrap()
            })
        })
    }

    /// The angles at all joints of a closed curve whose sides end at these parts of the whole parameter.
    fn turns(curve: impl Fn(f64) -> [f64; 2] + Copy, places: &[f64]) -> Vec<f64> {
        let mut found = Vec::new();
        for (angle, scale, digits) in [(0.0, 1.0, 16), (0.7, 1e-6, 7), (2.2, 1e6, 7)] {
            let sides: Vec<Side> = places
                .windows(2)
                .map(|pair| placed(side(curve, pair[0], pair[1]), angle, scale, digits))
                .collect();
            let pairs = sides.iter().zip(sides.iter().cycle().skip(1));
            found.extend(pairs.map(|(a, b)| corner(a, b)));
        }
        found
    }

    /// Parameters from 0 to a whole turn, in equal steps or, if `uneven`, in steps that differ by half.
    fn places(count: usize, uneven: bool) -> Vec<f64> {
        let step = |k: usize| {
            if uneven {
                1.0 + 0.25 * ((7 * k * k + 3 * k) % 5) as f64 / 4.0
            } else {
                1.0
            }
        };
        let whole: f64 = (0..count).map(step).sum();
        let mut found = vec![0.0];
        (0..count).for_each(|k| found.push(found[k] + TAU * step(k) / whole));
        found
    }

    #[test]
    fn circles_ellipses_and_waves_are_smooth() {
        for uneven in [false, true] {
            for count in [4, 8, 12, 60] {
                let circle = |t: f64| [-(t.cos()), t.sin()];
                let found = turns(circle, &places(count, uneven));
                assert!(found.iter().all(|turn| *turn == 0.0), "{count}: {found:?}");
            }
            for count in [12, 24, 60] {
                for b in [0.5, 0.7, 2.0] {
                    let ellipse = |t: f64| [-(t.cos()), b * t.sin()];
                    let found = turns(ellipse, &places(count, uneven));
                    assert!(found.iter().all(|turn| *turn == 0.0), "{count}: {found:?}");
                }
                // closed, with waves of its radius
                let wavy = |t: f64| {
                    let r = 1.0 + 0.05 * (3.0 * t).sin();
                    [-r * t.cos(), r * t.sin()]
                };
                let found = turns(wavy, &places(2 * count, uneven));
                assert!(found.iter().all(|turn| *turn == 0.0), "{count}: {found:?}");
            }
        }
    }

    /// A corner of one degree between two arcs or lines is still detected between sides that turn by 10°.
    #[test]
    fn a_corner_of_a_degree_stays_one() {
        for degrees in [1.0f64, 2.0, 5.0, -1.0, -5.0] {
            let turn = degrees.to_radians();
            for of_side in [0.0, 0.05, 10f64.to_radians()] {
                let arc = |t: f64| match of_side {
                    0.0 => [t, 0.0],
                    curvature => [
                        (curvature * t).sin() / curvature,
                        ((curvature * t).cos() - 1.0) / curvature,
                    ],
                };
                let before = side(arc, -1.0, 0.0);
                let after = placed(side(arc, 0.0, 1.0), -turn, 1.0, 16);
                let shift = [0, 1].map(|a| before[1][a] - after[0][a]);
                let after = after.map(|place| [0, 1].map(|a| place[a] + shift[a]));
                let found = corner(&before, &after);
                assert!(
                    (found - turn).abs() < 0.1 * turn.abs(),
                    "{degrees}° is {found}"
                );
            }
        }
    }

    /// The normal of an arc that ends on a line of symmetry lies along that line, within its stated error.
    #[test]
    fn a_side_knows_the_error_of_its_direction() {
        for count in [2, 4, 8, 40] {
            for b in [0.5, 1.0, 2.0] {
                let ellipse = |t: f64| [-(t.cos()), b * t.sin()];
                let side = side(ellipse, 0.0, 0.5 * PI / count as f64);
                let [x, y] = end_direction(&side, -1.0);
                let off = x.atan2(y).abs();
                assert!(off <= direction_error(&side), "{count}, {b}: {off}");
            }
        }
    }
}
