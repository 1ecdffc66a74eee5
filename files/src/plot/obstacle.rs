//! Draws the obstacle next to a body: its face, and a band behind the face.

use solver::model::ContactModel;
use solver::problem::Condition;

use super::body::{Frame, Path};
use super::page::{px, tinted};
use super::style::Style;
use super::theme::hex;

/// The depth of the band behind the face (pixels).
pub(super) const DEPTH: i32 = 13;

/// The face of an obstacle as points, with the direction out of the body at each.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Face {
    pub(super) points: Vec<[f64; 2]>,
    outward: Vec<[f64; 2]>,
}

impl Face {
    /// The face of the obstacle before it is pushed; empty for a contact without an obstacle.
    pub(super) fn before(contact: &ContactModel) -> Face {
        let mut face = Face::default();
        // another body has elements of its own
        if contact.condition == Condition::None || contact.pair.is_some() {
            return face;
        }
        let boundary = &contact.boundary;
        let nodes = &boundary.positions;
        let mut places = contact.places.iter().peekable();
        for (i, position) in nodes.iter().enumerate() {
            // edge k has the nodes 2k, 2k + 1 in its middle, and 2k + 2
            let (edge, middle) = (i / 2, i % 2 == 1);
            let before = |place: &&&solver::contact::obstacle::Place| {
                if middle {
                    place.edge < edge || (place.edge == edge && place.xi < 0.0)
                } else {
                    place.edge < edge
                }
            };
            while let Some(place) = places.next_if(|place| before(&place)) {
                let first = 2 * place.edge;
                let Some([a, m, b]) = nodes.get(first..first + 3) else {
                    continue;
                };
                let xi = place.xi;
                let shape = [0.5 * xi * (xi - 1.0), 1.0 - xi * xi, 0.5 * xi * (xi + 1.0)];
                let at = [0, 1].map(|c| shape[0] * a[c] + shape[1] * m[c] + shape[2] * b[c]);
                face.push(at, place.normal, place.profile.distance);
            }
            // along the body's normal, whichever the contact uses
            let ([a, b], n, t) = (contact.push[i], boundary.normals[i], boundary.tangent(i));
            let outward = [0, 1].map(|c| a * n[c] - b * t[c]);
            face.push(*position, outward, contact.profile[i] / a);
        }
        face
    }

    /// The face of the obstacle in the final state: on the surface of the body where both touch, elsewhere beyond the
    /// surface by the gap. `surface`: in order of arc length, the place of each node before deformation, its place in
    /// the figure, and the distance of the obstacle from it.
    pub(super) fn after(surface: &[([f64; 2], [f64; 2], f64)]) -> Face {
        let mut face = Face::default();
        for (i, &(_, drawn, gap)) in surface.iter().enumerate() {
            let before = surface[i.saturating_sub(1)].0;
            let after = surface[(i + 1).min(surface.len() - 1)].0;
            let along = [after[0] - before[0], after[1] - before[1]];
            let length = along[0].hypot(along[1]);
            if length > 0.0 {
                let t = along.map(|c| c / length);
                face.push(drawn, [-t[1], t[0]], gap);
            }
        }
        face
    }

    fn push(&mut self, at: [f64; 2], outward: [f64; 2], distance: f64) {
        if distance.is_finite() {
            self.points
                .push([0, 1].map(|c| at[c] + distance * outward[c]));
            self.outward.push(outward);
        }
    }

    /// The SVG of the face and its band inside a frame.
    pub(super) fn drawn(&self, style: Style, frame: &Frame) -> String {
        if self.points.len() < 2 {
            return String::new();
        }
        let palette = style.palette();
        let face: Vec<[f64; 2]> = self.points.iter().map(|p| frame.at(*p)).collect();
        let depth = f64::from(px(DEPTH));
        // down is positive on the page
        let behind = face.iter().zip(&self.outward);
        let behind = behind.map(|([x, y], [a, b])| [x + depth * a, y - depth * b]);
        let around: Vec<[f64; 2]> = face.iter().copied().chain(behind.rev()).collect();
        let (mut band, mut line) = (Path::default(), Path::default());
        band.polygon(&around);
        line.line(&face);
        let edge = hex(palette.text);
        band.drawn(&tinted(palette.obstacle, 0.8))
            + &line.drawn(&format!(r#"fill="none" stroke="{edge}" stroke-width="8""#))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::tests::problem;
    use solver::model::Model;

    #[test]
    fn a_cylinder_stands_over_its_lowest_point() {
        let model = Model::new(&problem(), None).unwrap();
        let face = Face::before(&model.contacts[0]);
        // radius 8 about x = 0, over the side y = 0 from 0 to 2
        for [x, y] in &face.points {
            let height = 8.0 - (64.0 - x * x).sqrt();
            assert!((y - height).abs() < 1e-9, "{x} {y} {height}");
        }
        assert!(
            face.points
                .windows(2)
                .all(|pair| pair[0][0] <= pair[1][0] + 1e-12)
        );
    }

    #[test]
    fn a_slope_is_the_same_whichever_normal_the_contact_uses() {
        let mut problem = problem();
        problem.contacts[0].obstacle =
            serde_json::from_value(serde_json::json!({ "kind": "wedge", "angle": 20 })).unwrap();
        let face = |problem: &solver::problem::Problem| {
            Face::before(&Model::new(problem, None).unwrap().contacts[0]).points
        };
        let of_body = face(&problem);
        problem.contacts[0].normal = Some(solver::problem::NormalOf::Obstacle);
        for (p, q) in of_body.iter().zip(face(&problem)) {
            assert!((p[0] - q[0]).hypot(p[1] - q[1]) < 1e-9, "{p:?} {q:?}");
            assert!(
                (p[1] - p[0] * 20f64.to_radians().tan()).abs() < 1e-9,
                "{p:?}"
            );
        }
    }

    #[test]
    fn the_obstacle_lies_on_the_body_where_they_touch() {
        let surface = [
            ([0.0, 0.0], [0.0, -0.1], 0.0),
            ([1.0, 0.0], [1.0, -0.1], 0.0),
            ([2.0, 0.0], [2.1, 0.0], 0.3),
        ];
        let face = Face::after(&surface);
        assert_eq!(face.points, [[0.0, -0.1], [1.0, -0.1], [2.1, 0.3]]);
        assert_eq!(Face::after(&surface[..1]), Face::default());
    }
}
