//! The row of one mesh in the sequence of refinements: its results, and how much they changed.

use crate::solution::{ErrorMethod, EstimatedQuantity, QuantityName, Refinement, Solution};

/// A force below this fraction of the largest force is not compared between meshes.
const SMALL_FORCE: f64 = 1e-3;

/// The results that are compared from mesh to mesh.
pub(super) struct MeshResults<'a> {
    solution: &'a Solution,
    /// Whether the peak of σ_n has a limit as the mesh is refined.
    normal_peak: bool,
    /// Whether the peak of σ_t has a limit as the mesh is refined.
    tangential_peak: bool,
}

impl<'a> MeshResults<'a> {
    pub(super) fn new(solution: &'a Solution) -> Self {
        let has_limit = |name: QuantityName| {
            let accuracy = solution.summary.accuracy.iter();
            let mut quantities = accuracy.flat_map(|accuracy| &accuracy.quantities);
            !quantities.any(|q| q.quantity == name && q.method == ErrorMethod::NoLimit)
        };
        MeshResults {
            solution,
            normal_peak: has_limit(QuantityName::PeakNormalStress),
            tangential_peak: has_limit(QuantityName::PeakTangentialStress),
        }
    }

    /// The largest |σ_t| and |σ_n| of all contacts.
    fn peaks(&self) -> (f64, f64) {
        let contacts = self.solution.summary.contacts.values();
        contacts.fold((0.0, 0.0), |(tangential, normal): (f64, f64), contact| {
            let size = |peak: &Option<crate::solution::Peak>| peak.map_or(0.0, |p| p.value.abs());
            (
                tangential.max(size(&contact.peak_tangential_stress)),
                normal.max(size(&contact.peak_normal_stress)),
            )
        })
    }

    pub(super) fn row(&self, change: Option<f64>, error: f64) -> Refinement {
        let summary = &self.solution.summary;
        let (peak_tangential_stress, peak_normal_stress) = self.peaks();
        Refinement {
            elements: self.solution.fields.elements.len() as u64,
            dofs: summary.dofs,
            normal_force: summary.normal_force,
            tangential_force: summary.tangential_force,
            friction_force: summary.friction_force,
            peak_tangential_stress,
            peak_normal_stress,
            change,
            error: Some(error).filter(|error| error.is_finite()),
        }
    }

    /// The largest relative change of the forces, and of the peaks that converge, since the mesh of `before`.
    pub(super) fn change(&self, before: &Refinement) -> f64 {
        let now = self.row(None, 0.0);
        let relative = |a: f64, b: f64| {
            if a == b {
                0.0
            } else {
                (a - b).abs() / a.abs().max(b.abs())
            }
        };
        let largest = now.normal_force.abs().max(now.friction_force.abs());
        let mut change: f64 = 0.0;
        for (a, b) in [
            (now.normal_force, before.normal_force),
            (now.tangential_force, before.tangential_force),
            (now.friction_force, before.friction_force),
        ] {
            if a.abs().max(b.abs()) > SMALL_FORCE * largest {
                change = change.max(relative(a, b));
            }
        }
        if self.normal_peak {
            change = change.max(relative(now.peak_normal_stress, before.peak_normal_stress));
        }
        if self.tangential_peak {
            let (a, b) = (now.peak_tangential_stress, before.peak_tangential_stress);
            change = change.max(relative(a, b));
        }
        change
    }
}

/// The largest relative error of the quantities that have a limit and a stated error; infinite if one is unknown.
pub(super) fn largest_error(solution: &Solution) -> f64 {
    let accuracy = solution.summary.accuracy.iter();
    let quantities = accuracy.flat_map(|accuracy| &accuracy.quantities);
    quantities.map(relative_error).fold(0.0, f64::max)
}

/// The relative error of a quantity due to the mesh: 0 if the quantity has no limit or belongs to too many ends of
/// stick, infinite if the error is unknown.
pub(super) fn relative_error(quantity: &EstimatedQuantity) -> f64 {
    match (quantity.method, quantity.error, quantity.relative) {
        (ErrorMethod::NoLimit | ErrorMethod::TooMany, ..) | (_, Some(0.0), _) => 0.0,
        (_, Some(error), Some(relative)) => match quantity.of_mesh() {
            Some(of_mesh) => relative * (of_mesh / error),
            None => relative,
        },
        _ => f64::INFINITY,
    }
}
