//! The axis of a body of revolution: one criterion for supports, contacts and friction.

use crate::elasticity::Section;
use crate::mesh::Mesh;

/// A radius below this fraction of the body's largest radius counts as 0: mesh generators place nodes on the axis up to
/// rounding, and the contact area of such a node would be pure rounding error.
const ROUNDING: f64 = 1e-12;

/// The axis of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    /// The largest radius that counts as 0; `None` for a body in the plane.
    reach: Option<f64>,
}

impl Axis {
    pub(super) fn new(section: &Section, mesh: &Mesh) -> Self {
        let largest = || mesh.nodes.iter().map(|[r, _]| *r).fold(0.0, f64::max);
        let reach = section.axisymmetric().then(|| ROUNDING * largest());
        Axis { reach }
    }

    /// The end nodes of a contact that lie on the axis, each with the midside node beside it, as indices into
    /// `positions`.
    pub fn ends(&self, positions: &[[f64; 2]]) -> Vec<[usize; 2]> {
        let Some(last) = positions.len().checked_sub(1).filter(|last| *last > 0) else {
            return Vec::new();
        };
        let ends = [[0, 1], [last, last - 1]].into_iter();
        ends.filter(|[end, _]| self.holds(positions[*end]))
            .collect()
    }

    /// Whether the point (r, z) lies on the axis; never true for a body in the plane.
    pub fn holds(&self, [r, _]: [f64; 2]) -> bool {
        self.reach.is_some_and(|reach| r <= reach)
    }
}
