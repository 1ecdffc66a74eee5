//! The force of a contact as a vector, and a note where the sum of the pressures is another number.

use super::PatchView;
use crate::elasticity::Dof;
use crate::problem::Condition;
use crate::solution::{Warning, WarningCode};

/// The largest difference between the size of the force and the sums of pressures and tangential stresses that is not told,
/// as a part of the force: a tenth of what `good` promises of a force.
const SAME: f64 = 0.001;

/// The same for an obstacle whose normal force is given.
const SAME_AS_GIVEN: f64 = 1e-4;

/// The sine of the largest angle with the radius of normals that count as radial.
const RADIAL: f64 = 1e-9;

impl PatchView<'_> {
    /// The force on the body along x and y; in axisymmetry its radial component is 0.
    pub(super) fn resultant(&self) -> [f64; 2] {
        let (system, range) = (self.system, self.system.range(self.patch));
        let boundary = &self.patch.contact.boundary;
        let mut unknowns = vec![0.0; self.finished.state.v.len()];
        for i in range.clone() {
            if let Dof::Free(dof) = system.nodes[i].normal {
                unknowns[dof] += self.forces.reactions[i];
            }
        }
        // a contact's end on the axis shares its unknown with the node beside it
        let pressed = system.body.nodal_forces(&unknowns);
        let mut tangential = self.forces.tangential_reactions[range.clone()].to_vec();
        let own = system.points.iter().zip(&self.finished.tractions);
        for (point, traction) in own.filter(|(point, _)| point.patch == self.p) {
            for (node, shape) in point.nodes.into_iter().zip(point.shape) {
                tangential[node - range.start] += point.weight * traction * shape;
            }
        }
        let mut sum = [0.0; 2];
        for (k, i) in range.enumerate() {
            let normal = match system.nodes[i].normal {
                Dof::Free(dof) => pressed[dof],
                Dof::Fixed(_) => 0.0,
            };
            let ([nx, ny], [tx, ty]) = (boundary.normals[k], boundary.tangent(k));
            sum[0] += tangential[k] * tx - normal * nx;
            sum[1] += tangential[k] * ty - normal * ny;
        }
        if system.model.section.axisymmetric() {
            sum[0] = 0.0;
        }
        sum.map(|force| system.circumference * force)
    }

    /// Tells of a contact whose normals differ so much that the sum of its pressures is not its force.
    pub(super) fn warn_of_turning_normals(&self, warnings: &mut Vec<Warning>) {
        let contact = self.patch.contact;
        if contact.condition != Condition::Unilateral {
            return;
        }
        let summary = self.summary();
        let [x, y] = self.resultant();
        let revolved = self.system.model.section.axisymmetric();
        let sums = match revolved {
            true => summary.normal_force,
            false => summary.normal_force.hypot(summary.tangential_force),
        };
        let size = x.hypot(y);
        // who gives the force compares it
        let given = contact.tool.as_ref().filter(|tool| tool.loads[0].is_some());
        let differs = match given {
            Some(tool) => {
                let [along, _] = tool.components([x, y]);
                (summary.normal_force - along).abs() > SAME_AS_GIVEN * sums
            }
            None => (sums - size).abs() > SAME * sums,
        };
        // a cylinder has no axial force to compare
        let radial = |n: &[f64; 2]| revolved && n[1].abs() <= RADIAL;
        if !differs || contact.boundary.normals.iter().all(radial) {
            return;
        }
        let force = match revolved {
            true => format!("{y:.6e} along the axis"),
            false => format!("[{x:.6e}, {y:.6e}] along x and y, of the size {size:.6e}"),
        };
        warnings.push(Warning {
            code: WarningCode::NormalsDiffer,
            pointer: contact.pointer.clone(),
            message: format!(
                "The normals in the contact differ: its force on the body is {force}, and on {} the opposite. `normal_force`, {:.6e}, and `tangential_force`, {:.6e}, are sums of pressures and tangential stresses in all directions.",
                contact.opposite(),
                summary.normal_force,
                summary.tangential_force
            ),
        });
    }
}
