//! Rigid obstacles: which part of a boundary faces one, and how far away it is.

use crate::contact::arc_lengths;
use crate::mesh::{Edge, Mesh};
use crate::problem::{Along, Obstacle};

/// Positions count as equal to `from`, `to` and a circle's edge within this part of the
/// boundary's length: they meet grid lines only to rounding.
const ROUNDING: f64 = 1e-9;

/// The part of a boundary that faces an obstacle.
#[derive(Clone, Debug, PartialEq)]
pub struct Facing {
    /// Edges whose three nodes all face the obstacle, in runs that hang together.
    pub runs: Vec<FacingRun>,
    /// Coordinates c of edges that `from` or `to` cut and that were therefore left out.
    pub cut: Vec<[f64; 2]>,
}

/// A chain of edges and the obstacle's profile at its nodes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FacingRun {
    /// Edges, following one another.
    pub chain: Vec<Edge>,
    /// Profile at each node of the chain (length; the indentation is not yet subtracted).
    pub profile: Vec<f64>,
    /// The coordinate c there.
    pub coordinate: Vec<f64>,
}

/// Finds the part of `boundary` (edges that follow one another) that faces the obstacle.
pub fn facing(mesh: &Mesh, boundary: &[Edge], obstacle: &Obstacle) -> Facing {
    let (from, to, along) = span(obstacle);
    let s = arc_lengths(mesh, boundary);
    let coordinate = |node: usize, mesh_node: u32| match along {
        Along::X => mesh.nodes[mesh_node as usize][0],
        Along::ArcLength => s[node],
    };
    let rounding = ROUNDING * s[s.len() - 1];
    let (low, high) = (
        from.unwrap_or(f64::NEG_INFINITY),
        to.unwrap_or(f64::INFINITY),
    );
    let mut found = Facing {
        runs: Vec::new(),
        cut: Vec::new(),
    };
    let mut continues = false;
    for (k, edge) in boundary.iter().enumerate() {
        let [start, end, mid] = *edge;
        let c = [
            coordinate(2 * k, start),
            coordinate(2 * k + 2, end),
            coordinate(2 * k + 1, mid),
        ];
        let (least, most) = (
            c.iter().fold(f64::INFINITY, |a, &b| a.min(b)),
            c.iter().fold(f64::NEG_INFINITY, |a, &b| a.max(b)),
        );
        let within = least >= low - rounding && most <= high + rounding;
        let touches = most > low + rounding && least < high - rounding;
        if touches && !within {
            found.cut.push([least, most]);
        }
        let profiles = c.map(|c| profile(obstacle, c, rounding));
        match profiles {
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

/// Profile of the obstacle at coordinate c: distance before it is pushed; `None` where it is not.
fn profile(obstacle: &Obstacle, c: f64, rounding: f64) -> Option<f64> {
    match *obstacle {
        Obstacle::Flat { .. } => Some(0.0),
        Obstacle::Circle { radius, center, .. } => {
            let c = c - center;
            (c.abs() <= radius + rounding)
                .then(|| radius - (radius * radius - c * c).max(0.0).sqrt())
        }
        Obstacle::Parabola { radius, center, .. } => {
            Some((c - center) * (c - center) / (2.0 * radius))
        }
    }
}

/// `from`, `to` and `along`, which every kind has.
pub fn span(obstacle: &Obstacle) -> (Option<f64>, Option<f64>, Along) {
    match *obstacle {
        Obstacle::Flat { from, to, along }
        | Obstacle::Circle {
            from, to, along, ..
        }
        | Obstacle::Parabola {
            from, to, along, ..
        } => (from, to, along),
    }
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
    fn a_flat_takes_the_edges_between_its_ends_and_says_which_it_cuts() {
        let punch = Obstacle::Flat {
            from: Some(1.0),
            to: Some(2.5),
            along: Along::X,
        };
        let found = face(&[0.0, 1.0, 2.0, 3.0, 4.0], &punch);
        assert_eq!(found.runs.len(), 1);
        assert_eq!(
            (found.runs[0].chain.len(), found.runs[0].profile.clone()),
            (1, vec![0.0; 3])
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
                .all(|(a, b)| (a - b).abs() < 1e-15)
        );
        let parabola = Obstacle::Parabola {
            radius: 2.0,
            center: 1.0,
            from,
            to,
            along,
        };
        assert_eq!(
            face(&[0.0, 1.0, 3.0], &parabola).runs[0].profile,
            [0.25, 0.0625, 0.0, 0.25, 1.0]
        );
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
}
