//! Rigid obstacles: the part of a boundary that faces one, and its distance.

use crate::contact::ContactBoundary;
use crate::mesh::{Edge, Mesh};
use crate::problem::{Along, Obstacle};

/// Positions count as equal to `from`, `to`, a circle's edge and the ends of a polyline within this
/// part of the boundary's length: they coincide with grid lines only up to rounding.
const ROUNDING: f64 = 1e-9;

/// The part of a boundary that faces an obstacle.
#[derive(Clone, Debug, PartialEq)]
pub struct Facing {
    /// Edges whose three nodes all face the obstacle, in connected runs.
    pub runs: Vec<FacingRun>,
    /// Coordinates c of edges that `from` or `to` cut and that were therefore left out.
    pub cut: Vec<[f64; 2]>,
    /// The same edges, each with the length of it that the obstacle covers.
    pub cut_edges: Vec<(Edge, f64)>,
}

/// A chain of edges and the obstacle's profile at its nodes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FacingRun {
    /// Edges, following one another.
    pub chain: Vec<Edge>,
    /// The obstacle at each node of the chain.
    pub profile: Vec<Profile>,
    /// The coordinate c there.
    pub coordinate: Vec<f64>,
}

/// Distance and slope of an obstacle at a place on the boundary.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Profile {
    /// Distance along the body's normal (length); the indentation is not yet subtracted.
    pub distance: f64,
    /// Its change per length along t; the mean of both sides at a kink.
    pub slope: f64,
}

/// Finds the part of `boundary` (edges that follow one another) that faces the obstacle.
pub fn facing(mesh: &Mesh, boundary: &[Edge], obstacle: &Obstacle) -> Facing {
    let (from, to, along) = obstacle.span();
    // geometry only: the depth of the section does not matter
    let whole = ContactBoundary::new(mesh, boundary, |_| 1.0);
    let coordinate = |node: usize| match along {
        Along::X => whole.positions[node][0],
        Along::ArcLength => whole.s[node],
    };
    let rounding = ROUNDING * whole.s[whole.s.len() - 1];
    let in_space = matches!(obstacle, Obstacle::Polyline { .. } | Obstacle::Line { .. });
    let surface = if in_space { mesh.surface() } else { Vec::new() };
    let seen_from = |node: usize| {
        let (place, n, t) = (
            whole.positions[node],
            whole.normals[node],
            whole.tangent(node),
        );
        match obstacle {
            Obstacle::Polyline { points, .. } => {
                let segments = points.windows(2).map(|pair| (pair[0], pair[1], [0.0, 1.0]));
                let depth = depth(mesh, &surface, place, n, rounding);
                along_normal(place, n, t, segments, depth, rounding)
            }
            Obstacle::Line { point, angle, .. } => {
                let (sine, cosine) = angle.to_radians().sin_cos();
                let end = [point[0] + cosine, point[1] + sine];
                let endless = [f64::NEG_INFINITY, f64::INFINITY];
                let depth = depth(mesh, &surface, place, n, rounding);
                along_normal(
                    place,
                    n,
                    t,
                    std::iter::once((*point, end, endless)),
                    depth,
                    rounding,
                )
            }
            _ => {
                let (distance, slope) = profile(obstacle, coordinate(node), rounding)?;
                let per_length = match along {
                    Along::X => t[0],
                    Along::ArcLength => 1.0,
                };
                Some(Profile {
                    distance,
                    slope: slope * per_length,
                })
            }
        }
    };
    let (low, high) = (
        from.unwrap_or(f64::NEG_INFINITY),
        to.unwrap_or(f64::INFINITY),
    );
    let mut found = Facing {
        runs: Vec::new(),
        cut: Vec::new(),
        cut_edges: Vec::new(),
    };
    let mut continues = false;
    for (k, edge) in boundary.iter().enumerate() {
        let nodes = crate::contact::edge_nodes(k);
        let c = nodes.map(coordinate);
        let (least, most) = (
            c.iter().fold(f64::INFINITY, |a, &b| a.min(b)),
            c.iter().fold(f64::NEG_INFINITY, |a, &b| a.max(b)),
        );
        let within = least >= low - rounding && most <= high + rounding;
        let touches = most > low + rounding && least < high - rounding;
        if touches && !within {
            found.cut.push([least, most]);
            found
                .cut_edges
                .push((*edge, most.min(high) - least.max(low)));
        }
        match nodes.map(seen_from) {
            [Some(a), Some(b), Some(m)] if within => {
                if !continues {
                    found.runs.push(FacingRun {
                        chain: Vec::new(),
                        profile: vec![a],
                        coordinate: vec![c[0]],
                    });
                }
                if let Some(run) = found.runs.last_mut() {
                    run.chain.push(*edge);
                    run.profile.extend([m, b]);
                    run.coordinate.extend([c[2], c[1]]);
                }
                continues = true;
            }
            _ => continues = false,
        }
    }
    found
}

/// Distance before the obstacle is pushed, and its change with c, at coordinate c; `None` where there
/// is no obstacle.
fn profile(obstacle: &Obstacle, c: f64, rounding: f64) -> Option<(f64, f64)> {
    // a circle of radius R that leaves the surface at x = 0
    let round = |radius: f64, x: f64| {
        let root = (radius * radius - x * x).max(0.0).sqrt();
        let slope = x / root.max(ROUNDING * radius);
        (x.abs() <= radius + rounding).then_some((radius - root, slope))
    };
    // 0 at 0: the mean of both sides
    let sign = |x: f64| if x == 0.0 { 0.0 } else { x.signum() };
    match *obstacle {
        Obstacle::Flat { .. } => Some((0.0, 0.0)),
        Obstacle::Circle { radius, center, .. } => round(radius, c - center),
        Obstacle::Parabola { radius, center, .. } => {
            let x = c - center;
            Some((x * x / (2.0 * radius), x / radius))
        }
        Obstacle::Wedge { angle, center, .. } | Obstacle::Cone { angle, center, .. } => {
            let (x, tangent) = (c - center, angle.to_radians().tan());
            Some((x.abs() * tangent, sign(x) * tangent))
        }
        Obstacle::Tilted { slope, center, .. } => Some((slope * (c - center), slope)),
        Obstacle::Power {
            coefficient,
            exponent,
            center,
            ..
        } => {
            let x = c - center;
            let slope = coefficient * exponent * x.abs().powf(exponent - 1.0) * sign(x);
            Some((coefficient * x.abs().powf(exponent), slope))
        }
        Obstacle::RoundedFlat {
            half_width,
            radius,
            center,
            ..
        } => {
            let x = c - center;
            let beyond = (x.abs() - half_width).max(0.0);
            round(radius, beyond).map(|(distance, slope)| (distance, sign(x) * slope))
        }
        Obstacle::Table { ref x, ref gap, .. } => tabulated(x, gap, c, rounding),
        // curves in space are met along the normal instead
        Obstacle::Polyline { .. } | Obstacle::Line { .. } => None,
    }
}

/// Linear between the points of a table; at a point the mean of both slopes.
fn tabulated(x: &[f64], y: &[f64], at: f64, rounding: f64) -> Option<(f64, f64)> {
    let last = x.len() - 1;
    if at < x[0] - rounding || at > x[last] + rounding {
        return None;
    }
    let slope = |k: usize| (y[k + 1] - y[k]) / (x[k + 1] - x[k]);
    let k = (x.partition_point(|x| *x <= at).max(1) - 1).min(last - 1);
    let distance = y[k] + slope(k) * (at - x[k]);
    let mean = if k > 0 && at - x[k] <= rounding {
        0.5 * (slope(k - 1) + slope(k))
    } else {
        slope(k)
    };
    Some((distance, mean))
}

/// How far the body reaches from a place of its surface along −n (length), by the chords of its sides.
fn depth(mesh: &Mesh, surface: &[Edge], place: [f64; 2], n: [f64; 2], rounding: f64) -> f64 {
    let across = |edge: &Edge| {
        let [p, q, _] = mesh.edge_nodes(edge);
        let (along, to) = (
            [q[0] - p[0], q[1] - p[1]],
            [place[0] - p[0], place[1] - p[1]],
        );
        // place − λ n = p + μ (q − p)
        let det = along[0] * n[1] - along[1] * n[0];
        let mu = (to[0] * n[1] - to[1] * n[0]) / det;
        let lambda = (along[0] * to[1] - along[1] * to[0]) / det;
        ((0.0..=1.0).contains(&mu) && lambda > rounding).then_some(lambda)
    };
    surface
        .iter()
        .filter_map(across)
        .fold(f64::INFINITY, f64::min)
}

/// Where the straight line along the normal n through `place` meets the nearest of the segments
/// (start, end, range of the parameter between them).
fn along_normal(
    place: [f64; 2],
    n: [f64; 2],
    t: [f64; 2],
    segments: impl Iterator<Item = ([f64; 2], [f64; 2], [f64; 2])>,
    depth: f64,
    rounding: f64,
) -> Option<Profile> {
    let mut hits: Vec<Profile> = Vec::new();
    for (start, end, [least, most]) in segments {
        let direction = [end[0] - start[0], end[1] - start[1]];
        let length = direction[0].hypot(direction[1]);
        let across = direction[0] * t[0] + direction[1] * t[1];
        if across.abs() <= ROUNDING * length {
            continue; // seen end on
        }
        let towards = [place[0] - start[0], place[1] - start[1]];
        let part = (towards[0] * t[0] + towards[1] * t[1]) / across;
        let slack = rounding / length;
        if part < least - slack || part > most + slack {
            continue;
        }
        let meet = [
            start[0] + part * direction[0] - place[0],
            start[1] + part * direction[1] - place[1],
        ];
        hits.push(Profile {
            distance: meet[0] * n[0] + meet[1] * n[1],
            slope: (direction[0] * n[0] + direction[1] * n[1]) / across,
        });
    }
    // an obstacle behind the body faces its other side
    hits.retain(|hit| hit.distance >= -depth);
    let nearest = hits
        .iter()
        .map(|hit| hit.distance.abs())
        .fold(f64::INFINITY, f64::min);
    // two segments meet in a kink: the mean of their slopes
    hits.retain(|hit| hit.distance.abs() <= nearest + rounding);
    let count = hits.len() as f64;
    let slope = hits.iter().map(|hit| hit.slope).sum::<f64>() / count;
    hits.first().map(|hit| Profile { slope, ..*hit })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::grid_mesh;
    use crate::problem::Grid;

    fn face(x: &[f64], obstacle: &Obstacle) -> Facing {
        let mesh = grid_mesh(&Grid {
            x: x.to_vec(),
            y: vec![0.0, 1.0],
            top: None,
            bottom: None,
        });
        facing(&mesh, &mesh.boundaries["top"], obstacle)
    }

    #[test]
    fn a_flat_covers_the_edges_between_its_ends_and_reports_cut_edges() {
        let punch = Obstacle::Flat {
            from: Some(1.0),
            to: Some(2.5),
            along: Along::X,
        };
        let found = face(&[0.0, 1.0, 2.0, 3.0, 4.0], &punch);
        assert_eq!(found.runs.len(), 1);
        assert_eq!(
            (found.runs[0].chain.len(), found.runs[0].profile.clone()),
            (1, vec![Profile::default(); 3])
        );
        assert_eq!(found.cut, [[2.0, 3.0]]);
    }

    #[test]
    fn a_circle_ends_at_its_radius_and_a_parabola_does_not() {
        let (from, to, along) = (None, None, Along::X);
        let circle = Obstacle::Circle {
            radius: 2.0,
            center: 0.0,
            from,
            to,
            along,
        };
        let found = face(&[0.0, 1.0, 2.0, 3.0], &circle);
        let exact = [
            0.0,
            2.0 - 3.75f64.sqrt(),
            2.0 - 3f64.sqrt(),
            2.0 - 1.75f64.sqrt(),
            2.0,
        ];
        assert!(
            found.runs[0]
                .profile
                .iter()
                .zip(exact)
                .all(|(a, b)| (a.distance - b).abs() < 1e-15)
        );
        let parabola = Obstacle::Parabola {
            radius: 2.0,
            center: 1.0,
            from,
            to,
            along,
        };
        let found = face(&[0.0, 1.0, 3.0], &parabola);
        let seen = |f: fn(&Profile) -> f64| found.runs[0].profile.iter().map(f).collect::<Vec<_>>();
        assert_eq!(seen(|p| p.distance), [0.25, 0.0625, 0.0, 0.25, 1.0]);
        assert_eq!(seen(|p| p.slope), [-0.5, -0.25, 0.0, 0.5, 1.0]);
    }

    #[test]
    fn arc_length_counts_from_the_start_of_the_boundary() {
        let punch = Obstacle::Flat {
            from: Some(0.0),
            to: Some(1.0),
            along: Along::ArcLength,
        };
        let found = face(&[5.0, 6.0, 8.0], &punch);
        assert_eq!(found.runs[0].chain.len(), 1);
    }

    #[test]
    fn every_profile_has_the_slope_of_its_distance() {
        let (from, to, along) = (None, None, Along::X);
        let kinds = [
            Obstacle::Circle {
                radius: 5.0,
                center: 0.7,
                from,
                to,
                along,
            },
            Obstacle::Wedge {
                angle: 20.0,
                center: 0.7,
                from,
                to,
                along,
            },
            Obstacle::Cone {
                angle: 5.0,
                center: -0.2,
                from,
                to,
                along,
            },
            Obstacle::Tilted {
                slope: 0.3,
                center: 0.1,
                from,
                to,
                along,
            },
            Obstacle::Power {
                coefficient: 0.4,
                exponent: 3.0,
                center: 0.6,
                from,
                to,
                along,
            },
            Obstacle::RoundedFlat {
                half_width: 0.5,
                radius: 2.0,
                center: 0.9,
                from,
                to,
                along,
            },
            Obstacle::Table {
                x: vec![0.0, 0.8, 2.0],
                gap: vec![1.0, 0.0, 3.0],
                from,
                to,
                along,
            },
        ];
        let step = 1e-6;
        for obstacle in kinds {
            for c in [0.05, 0.5, 1.1, 1.9] {
                let at = |c| profile(&obstacle, c, 0.0).unwrap();
                let difference = (at(c + step).0 - at(c - step).0) / (2.0 * step);
                assert!((at(c).1 - difference).abs() < 1e-8, "{obstacle:?} at {c}");
            }
        }
        let rounded = Obstacle::RoundedFlat {
            half_width: 0.5,
            radius: 2.0,
            center: 0.0,
            from,
            to,
            along,
        };
        assert_eq!(profile(&rounded, 0.4, 0.0), Some((0.0, 0.0)));
        assert_eq!(profile(&rounded, 2.6, 0.0), None);
        let wedge = Obstacle::Wedge {
            angle: 45.0,
            center: 1.0,
            from,
            to,
            along,
        };
        assert_eq!(profile(&wedge, 1.0, 0.0), Some((0.0, 0.0)));
    }

    #[test]
    fn a_table_has_ends_and_the_mean_slope_at_kinks() {
        let (x, y) = ([0.0, 1.0, 3.0], [1.0, 0.0, 4.0]);
        assert_eq!(tabulated(&x, &y, 1.0, 1e-12), Some((0.0, 0.5)));
        assert_eq!(tabulated(&x, &y, 3.0, 1e-12), Some((4.0, 2.0)));
        assert_eq!(tabulated(&x, &y, 3.1, 1e-12), None);
    }

    /// A roof over a flat top: distances and slopes along its normal, no obstacle beside it.
    #[test]
    fn curves_in_space_are_met_along_the_normal() {
        let (from, to, along) = (None, None, Along::X);
        let points = vec![[0.5, 1.0], [1.5, 2.0], [2.5, 1.0]];
        let roof = Obstacle::Polyline {
            points,
            from,
            to,
            along,
        };
        let found = face(&[0.0, 0.5, 1.5, 2.5, 3.0], &roof);
        assert_eq!(found.runs.len(), 1);
        let run = &found.runs[0];
        assert_eq!(run.chain.len(), 2);
        let close = |a: f64, b: f64| (a - b).abs() < 1e-12;
        for (profile, (distance, slope)) in
            run.profile
                .iter()
                .zip([(0.0, 1.0), (0.5, 1.0), (1.0, 0.0), (0.5, -1.0), (0.0, -1.0)])
        {
            assert!(
                close(profile.distance, distance) && close(profile.slope, slope),
                "{profile:?}"
            );
        }
        let line = Obstacle::Line {
            point: [0.0, 1.5],
            angle: 45.0,
            from,
            to,
            along,
        };
        let seen = face(&[0.0, 2.0], &line).runs[0].profile.clone();
        assert!(close(seen[2].distance, 2.5) && close(seen[2].slope, 1.0));
    }
}
