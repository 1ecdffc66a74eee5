//! Curves for boundaries of which a mesh knows only the corners of elements: a mesh of the first order that is raised
//! to the second has straight sides, with corners between them that the real body does not have.

use super::{Edge, Mesh, runs};
use crate::problem::{Curve, CurveKind};
use crate::spline::Spline;

/// Corners of elements lie on a circle if their distance from it is at most this fraction of its radius.
const OFF_CIRCLE: f64 = 1e-4;

/// A smooth curve is laid through the corners of a boundary if the boundary turns by less than 45° at each (cosine).
const SHARPEST: f64 = 0.7;

/// The number of points by which a closed curve is continued beyond its ends; the influence of each point is a quarter
/// of the influence of the one before.
const AROUND: usize = 16;

/// Why a boundary does not lie on its curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OffCurve {
    /// A corner of an element is too far from the curve (lengths).
    Distance {
        /// The node.
        node: u32,
        /// The distance from the curve.
        distance: f64,
        /// The largest distance allowed.
        most: f64,
    },
    /// The boundary has a corner at a node, where it turns by an angle: the node and the angle.
    Turns(u32, f64),
}

/// Moves the nodes of a boundary onto its curve: all nodes radially onto a circle; only the midside nodes onto a spline
/// through the corners, half-way between them.
pub(super) fn put_on_curve(
    nodes: &mut [[f64; 2]],
    boundary: &[Edge],
    curve: &Curve,
) -> Result<(), OffCurve> {
    match (curve.kind, curve.center, curve.radius) {
        (CurveKind::Circle, Some(center), Some(radius)) => {
            on_circle(nodes, boundary, center, radius)
        }
        (CurveKind::Circle, ..) => Ok(()),
        (CurveKind::Spline, ..) => runs(boundary)
            .iter()
            .try_for_each(|run| on_spline(nodes, run)),
    }
}

impl Mesh {
    /// Moves the nodes of a boundary of the mesh onto its curve.
    ///
    /// # Errors
    ///
    /// [`OffCurve`] if the boundary is too far from the curve, or turns too much to lie on it.
    pub fn put_on_curve(&mut self, boundary: &str, curve: &Curve) -> Result<(), OffCurve> {
        match self.boundaries.get(boundary) {
            Some(edges) => put_on_curve(&mut self.nodes, edges, curve),
            None => Ok(()),
        }
    }
}

fn on_circle(
    nodes: &mut [[f64; 2]],
    boundary: &[Edge],
    [a, b]: [f64; 2],
    radius: f64,
) -> Result<(), OffCurve> {
    let away = |[x, y]: [f64; 2]| (x - a).hypot(y - b);
    let most = OFF_CIRCLE * radius;
    for node in boundary.iter().flat_map(|[start, end, _]| [*start, *end]) {
        let distance = (away(nodes[node as usize]) - radius).abs();
        if distance.is_nan() || distance > most {
            return Err(OffCurve::Distance {
                node,
                distance,
                most,
            });
        }
    }
    for node in boundary.iter().flatten() {
        let place = &mut nodes[*node as usize];
        let ([x, y], distance) = (*place, away(*place));
        // a node that lies there stays, to the last digit
        let off = radius / distance - 1.0;
        if off.is_finite() && off.abs() > f64::EPSILON {
            *place = [x + off * (x - a), y + off * (y - b)];
        }
    }
    Ok(())
}

fn on_spline(nodes: &mut [[f64; 2]], run: &[Edge]) -> Result<(), OffCurve> {
    let mut corners: Vec<u32> = run.iter().map(|edge| edge[0]).collect();
    let closed = run[0][0] == run[run.len() - 1][1];
    corners.extend(run.last().map(|edge| edge[1]));
    let count = run.len();
    let at = |node: u32| nodes[node as usize];
    let chord = |edge: &Edge| {
        let [[x0, y0], [x1, y1]] = [at(edge[0]), at(edge[1])];
        [x1 - x0, y1 - y0]
    };
    let neighbours = run.iter().zip(run.iter().cycle().skip(1));
    for (before, after) in neighbours.take(if closed { count } else { count - 1 }) {
        let ([ax, ay], [bx, by]) = (chord(before), chord(after));
        let cosine = (ax * bx + ay * by) / (ax.hypot(ay) * bx.hypot(by));
        if cosine < SHARPEST {
            return Err(OffCurve::Turns(after[0], cosine.clamp(-1.0, 1.0).acos()));
        }
    }
    let around = if closed { AROUND } else { 0 };
    // corners by their number along the curve, and beyond the ends of a closed one
    let corner = |k: usize| {
        if closed {
            corners[(k + count * AROUND - around) % count]
        } else {
            corners[k]
        }
    };
    let mut along = vec![0.0];
    let points: Vec<[f64; 2]> = (0..=count + 2 * around).map(|k| at(corner(k))).collect();
    for pair in points.windows(2) {
        let [[x0, y0], [x1, y1]] = [pair[0], pair[1]];
        along.push(along[along.len() - 1] + (x1 - x0).hypot(y1 - y0));
    }
    let splines = [0, 1].map(|a| {
        let values = points.iter().map(|place| place[a]).collect();
        Spline::new(along.clone(), values)
    });
    for (k, edge) in run.iter().enumerate() {
        let middle = 0.5 * (along[around + k] + along[around + k + 1]);
        nodes[edge[2] as usize] = [0, 1].map(|a| splines[a].at(middle)[0]);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The sides of a polygon through points of a curve, from one end to the other or closed.
    fn polygon(points: &[[f64; 2]], closed: bool) -> (Vec<[f64; 2]>, Vec<Edge>) {
        let count = points.len();
        let mut nodes = points.to_vec();
        let sides = if closed { count } else { count - 1 };
        let edges = (0..sides).map(|k| {
            let next = (k + 1) % count;
            nodes.push([0, 1].map(|a| 0.5 * (points[k][a] + points[next][a])));
            [k as u32, next as u32, (count + k) as u32]
        });
        let edges = edges.collect();
        (nodes, edges)
    }

    fn spline() -> Curve {
        Curve {
            kind: CurveKind::Spline,
            center: None,
            radius: None,
        }
    }

    #[test]
    fn midsides_come_onto_their_circle_and_corners_off_it_are_named() {
        let circle = Curve {
            kind: CurveKind::Circle,
            center: Some([1.0, 2.0]),
            radius: Some(4.0),
        };
        let at = |k: usize| {
            let (s, c) = (0.2 * k as f64).sin_cos();
            [1.0 + 4.0 * c, 2.0 + 4.0 * s]
        };
        let (mut nodes, edges) = polygon(&[at(0), at(1), at(2), at(3)], false);
        put_on_curve(&mut nodes, &edges, &circle).unwrap();
        for node in &nodes {
            assert!(((node[0] - 1.0).hypot(node[1] - 2.0) - 4.0).abs() < 1e-14);
        }
        let (x, y) = (0.5f64 * 0.2).sin_cos();
        let [mx, my] = nodes[4];
        assert!((mx - 1.0 - 4.0 * y).abs() < 1e-14 && (my - 2.0 - 4.0 * x).abs() < 1e-14);
        nodes[2][0] += 1e-3;
        let found = put_on_curve(&mut nodes, &edges, &circle);
        assert!(
            matches!(found, Err(OffCurve::Distance { node: 2, .. })),
            "{found:?}"
        );
    }

    /// A spline through the corners approximates their curve to fourth order, also where a closed curve begins.
    #[test]
    fn a_spline_through_the_corners_is_near_their_curve() {
        let ellipse = |t: f64| [3.0 * t.cos(), 2.0 * t.sin()];
        let off = |count: usize, closed: bool| {
            let turn = if closed { 1.0 } else { 0.4 };
            let steps = if closed { count } else { count - 1 };
            let at = |k: usize| ellipse(turn * std::f64::consts::TAU * k as f64 / steps as f64);
            let points: Vec<[f64; 2]> = (0..count).map(at).collect();
            let (mut nodes, edges) = polygon(&points, closed);
            put_on_curve(&mut nodes, &edges, &spline()).unwrap();
            let distance = |[x, y]: &[f64; 2]| ((x / 3.0).hypot(y / 2.0) - 1.0).abs();
            nodes.iter().map(distance).fold(0.0, f64::max)
        };
        for closed in [true, false] {
            let [coarse, fine] = [off(24, closed), off(48, closed)];
            assert!(coarse < 1e-4 && fine < coarse / 12.0, "{coarse}, {fine}");
        }
    }

    #[test]
    fn a_spline_does_not_go_around_a_corner() {
        let (mut nodes, edges) = polygon(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]], false);
        let found = put_on_curve(&mut nodes, &edges, &spline());
        assert!(matches!(found, Err(OffCurve::Turns(1, _))), "{found:?}");
    }
}
