//! Moves boundaries onto the curves that a problem names for them.

use super::checks::{Checks, one_of};
use crate::error::{AllChecks, Checked, Reason, escape};
use crate::mesh::{self, Mesh, OffCurve};
use crate::problem::{Curve, CurveKind, MeshInput};

impl Checks {
    /// Moves nodes of boundaries onto their curves. `of`: the words for the mesh in messages about an element that is
    /// inverted by the move.
    pub(super) fn curves(&mut self, mesh: &mut Mesh, input: &MeshInput, of: &str) -> Checked {
        let mut all = AllChecks::default();
        for (name, curve) in &input.curves {
            all.check(self.curve(mesh, name, curve));
        }
        all.finish(())?;
        if input.curves.is_empty() {
            return Ok(());
        }
        let whole = |_| "/mesh/curves".to_owned();
        self.found
            .merge(mesh::check_inverted(mesh, true, whole, of))
    }

    fn curve(&mut self, mesh: &mut Mesh, name: &str, curve: &Curve) -> Checked {
        let pointer = format!("/mesh/curves/{}", escape(name));
        let mut all = AllChecks::default();
        match (curve.kind, curve.center, curve.radius) {
            (CurveKind::Circle, Some(_), Some(radius)) => {
                let pointer = format!("{pointer}/radius");
                all.check(self.require(radius > 0.0, pointer, radius, "> 0", "A length."));
            }
            (CurveKind::Circle, ..) => {
                all.fail(self.report(
                    &pointer,
                    Reason::Missing,
                    "a circle without `center` or without `radius`",
                    "both",
                    "For example {\"kind\": \"circle\", \"center\": [0, 0], \"radius\": 4}.",
                ));
            }
            (CurveKind::Spline, None, None) => {}
            (CurveKind::Spline, ..) => {
                all.fail(self.report(
                    &pointer,
                    Reason::NotUsed,
                    "`center` or `radius` of a spline",
                    "neither",
                    "A spline goes through the corners of the boundary's sides.",
                ));
            }
        }
        if !mesh.boundaries.contains_key(name) {
            all.fail(self.report(
                &pointer,
                Reason::UnknownBoundary,
                name,
                one_of("a boundary", mesh.boundaries.keys()),
                "Check the spelling.",
            ));
        }
        all.finish(())?;
        let Err(off) = mesh.put_on_curve(name, curve) else {
            return Ok(());
        };
        let at = |node: u32| mesh.nodes[node as usize];
        let (reason, got, expected, hint) = match off {
            OffCurve::Distance {
                node,
                distance,
                most,
            } => (
                Reason::Conflict,
                format!(
                    "node {node} at {:?}, {distance:.3e} from the circle",
                    at(node)
                ),
                format!("corners of elements within {most:.3e} of the circle, 1e-4 of its radius"),
                "Check the center and the radius; name the part of the boundary that lies on the circle.",
            ),
            OffCurve::Turns(node, angle) => (
                Reason::TurnsCorner,
                format!(
                    "a boundary that turns by {:.0}° at node {node}, {:?}",
                    angle.to_degrees(),
                    at(node)
                ),
                "a boundary that turns by less than 45° at every node".to_owned(),
                "Give each side a spline of its own, or refine the mesh.",
            ),
        };
        Err(self.report(pointer, reason, got, expected, hint))
    }
}
