//! Obstacles that move as rigid bodies: a load, instead of a motion, is given along some of their three motions.
//!
//! The motions are the indentation along the direction of the contact, the tangential displacement perpendicular to it,
//! and the tilt about a point. Where a load is given, the motion is unknown: `algorithm::opposite` eliminates it.

use super::level::Level;
use crate::contact::ContactBoundary;
use crate::problem::Contact;

/// An obstacle that moves as a rigid body.
#[derive(Clone, Debug, PartialEq)]
pub struct Tool {
    /// The given motions: indentation, tangential displacement and tilt; 0 where a load is given.
    motions: [f64; 3],
    /// The load along each motion that is free: the normal force, the tangential force and the moment on the body.
    pub loads: [Option<f64>; 3],
    /// The stiffness of the springs between the obstacle and the ground, against each motion.
    pub stiffness: [f64; 3],
    /// Whether a point is given, about which it turns or the moment that keeps it from turning is stated.
    pub has_point: bool,
    /// The direction of the indentation, a unit vector.
    direction: [f64; 2],
    /// By node and motion: the components of a unit motion against the contact's normal and along its t.
    rows: Vec<[[f64; 2]; 3]>,
}

impl Tool {
    /// The obstacle of a contact; none if it has neither a load nor a tilt. `direction`: the unit vector of its indentation.
    pub(super) fn new(
        contact: &Contact,
        boundary: &ContactBoundary,
        [a, b]: [f64; 2],
    ) -> Option<Tool> {
        if !contact.is_tool() {
            return None;
        }
        let about = contact.about.unwrap_or(boundary.positions[0]);
        let row = |i: usize| {
            let ([x, y], n, t) = (
                boundary.positions[i],
                boundary.normals[i],
                boundary.tangent(i),
            );
            // the tangent of a body whose outward normal is against the direction
            let moves = [[a, b], [-b, a], [about[1] - y, x - about[0]]];
            // + 0.0 turns −0 into 0
            moves.map(|[u, v]| [-(u * n[0] + v * n[1]) + 0.0, u * t[0] + v * t[1] + 0.0])
        };
        let stiffness = contact.stiffness.unwrap_or_default();
        let mut tool = Tool {
            motions: [0.0; 3],
            loads: [None; 3],
            stiffness: [stiffness.normal, stiffness.tangential, stiffness.rotational],
            has_point: contact.about.is_some(),
            direction: [a, b],
            rows: (0..boundary.nodes.len()).map(row).collect(),
        };
        tool.take(contact);
        Some(tool)
    }

    /// Takes the motions and loads of a contact whose obstacle has the same free motions.
    pub(super) fn take(&mut self, contact: &Contact) {
        self.motions = contact.obstacle_motions();
        self.loads = contact.obstacle_loads();
    }

    /// The motions that are unknown.
    pub fn free(&self) -> impl Iterator<Item = usize> {
        let loads = self.loads;
        (0..3).filter(move |k| loads[*k].is_some())
    }

    /// The given motions at a load level; 0 where they are unknown.
    pub fn motions(&self, level: &Level) -> [f64; 3] {
        std::array::from_fn(|k| level.motions[k] * self.motions[k])
    }

    /// The force along x and y, from its components along the indentation and along the tangential displacement.
    pub fn force(&self, [normal, tangential]: [f64; 2]) -> [f64; 2] {
        let [a, b] = self.direction;
        [normal * a - tangential * b, normal * b + tangential * a]
    }

    /// The components of a force along the indentation and along the tangential displacement.
    pub fn components(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [a, b] = self.direction;
        [x * a + y * b, y * a - x * b]
    }

    /// The components of a unit motion at a node, against the contact's normal and along its t.
    pub fn row(&self, node: usize, motion: usize) -> [f64; 2] {
        self.rows[node][motion]
    }

    /// How far motions move the obstacle at a node, against the contact's normal and along its t.
    pub fn moved(&self, node: usize, motions: &[f64; 3]) -> [f64; 2] {
        let parts = motions.iter().zip(&self.rows[node]);
        parts.fold([0.0; 2], |[n, t], (q, row)| {
            [n + q * row[0], t + q * row[1]]
        })
    }
}
