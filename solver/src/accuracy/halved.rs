//! Errors of quantities by comparison with a refined mesh, on which every element is split in two.
//!
//! With q_h on the mesh of the solution and q_h/2 on the refined mesh, a quantity q that converges with order p has the
//! error
//!
//!   |q_h − q| = |q_h − q_h/2| / (1 − 2⁻ᵖ)
//!
//! p is taken as 1 for forces, 0.74 for peaks and 0.58 for ends of stick, which covers smoother quantities. If q_2h, on
//! the mesh that was split into that of the solution, is known and shows a lower order, that order is taken, but at
//! least ½. Two values may agree by chance, so the bound is never below a part of the estimate from one mesh. The
//! factors are calibrated on random problems by `tests/verification/calibration.rs`.

use super::verdict::{Doubt, Unpaired, conclude, relative, scale};
use crate::algorithm::{Estimable, Quantity};
use crate::solution::{Accuracy, ErrorMethod, EstimatedQuantity, Outcome, QuantityName};

/// The lowest order of convergence that is assumed, for example of a peak at an edge of its neighbourhood.
const LEAST_ORDER: f64 = 0.5;

/// The largest difference, as a part of a quantity's reference size, that is an error of the iterations and shows no
/// order.
const ROUNDING: f64 = 1e-9;

/// Calibrated factors of an error: on the difference between two meshes, and on the estimate, which is a lower limit.
fn factors(name: QuantityName) -> [f64; 2] {
    use QuantityName::*;
    match name {
        NormalForce => [2.0, 0.3],
        TangentialForce | FrictionForce => [2.0, 0.4],
        PeakNormalStress | PeakTangentialStress => [2.5, 0.4],
        // to the end on the finer mesh, and from there as far as that is known: half as far as on this one
        ContactStart | ContactEnd => [1.0, 0.5],
        StickEnd => [3.0, 0.6],
        Indentation | TangentialDisplacement | Tilt => [2.0, 0.3],
    }
}

/// The value of a quantity on another mesh of the same problem.
#[derive(Clone, Debug, PartialEq)]
pub struct OnOtherMesh {
    name: QuantityName,
    contact: String,
    pub(super) value: f64,
    estimable: Estimable,
    /// The number of equal parts of the contact, [`Quantity::images`].
    pub(super) images: f64,
}

impl OnOtherMesh {
    /// Keeps what the comparison of a quantity on two meshes needs.
    pub fn new(quantity: &Quantity, contact: &str) -> Self {
        OnOtherMesh {
            name: quantity.name,
            contact: contact.to_owned(),
            value: quantity.value,
            estimable: quantity.estimable,
            images: quantity.images,
        }
    }
}

/// Bounds the errors of quantities by comparison with the refined mesh (`finer`) and, if there is one, with the mesh
/// that was split into this one (`coarser`). `estimated`: the estimates from this mesh for a converged solution.
pub fn verified(
    estimated: &Accuracy,
    finer: &[OnOtherMesh],
    coarser: Option<&[OnOtherMesh]>,
) -> Accuracy {
    let all = &estimated.quantities;
    let (mut quantities, mut doubts) = (Vec::new(), Vec::new());
    let mut unpaired: Vec<Unpaired> = Vec::new();
    let mut note = |name: QuantityName, contact: &str, here: usize, there: usize| {
        let noted = unpaired
            .iter()
            .any(|other| other.name == name && other.contact == contact);
        if here != there && !noted {
            let contact = contact.to_owned();
            unpaired.push(Unpaired {
                name,
                contact,
                here,
                there,
            });
        }
    };
    for (i, own) in all.iter().enumerate() {
        let same = |q: &&EstimatedQuantity| q.quantity == own.quantity && q.contact == own.contact;
        let (before, here) = (
            all[..i].iter().filter(same).count(),
            all.iter().filter(same).count(),
        );
        let there = of_kind(own.quantity, &own.contact, finer);
        let mut quantity = own.clone();
        let too_many = there.iter().any(|q| q.estimable == Estimable::TooMany);
        if too_many || own.method == ErrorMethod::TooMany {
            forget_error(&mut quantity);
            quantity.method = ErrorMethod::TooMany;
            quantities.push(quantity);
            doubts.push(None);
            continue;
        }
        note(own.quantity, &own.contact, here, there.len());
        doubts.push(if there.len() == here {
            let coarser = coarser.map(|coarser| of_kind(own.quantity, &own.contact, coarser));
            let coarser = coarser.filter(|coarser| coarser.len() == here);
            let coarser = coarser.map(|coarser| coarser[before]);
            let scale = scale_of(own, all, there[before].images);
            compare(&mut quantity, there[before], coarser, scale)
        } else {
            Some(Doubt::Alone)
        });
        quantities.push(quantity);
    }
    for other in finer {
        let same = |q: &&EstimatedQuantity| q.quantity == other.name && q.contact == other.contact;
        let there = of_kind(other.name, &other.contact, finer).len();
        let here = all.iter().filter(same).count();
        let too_many = all
            .iter()
            .filter(same)
            .any(|q| q.method == ErrorMethod::TooMany);
        if too_many || other.estimable == Estimable::TooMany {
            continue;
        }
        note(other.name, &other.contact, here, there);
    }
    Accuracy {
        verified: Some(true),
        ..conclude(Outcome::Converged, quantities, &doubts, &unpaired)
    }
}

/// Adds to the estimates the reason `why` they could not be verified.
pub fn unverified(mut estimated: Accuracy, why: &str) -> Accuracy {
    let why = why.trim_end_matches('.');
    let reason = format!("The errors are estimates, and not verified: {why}.");
    estimated.reasons.insert(0, reason);
    Accuracy {
        verified: Some(false),
        ..estimated
    }
}

/// The quantities of one kind on another mesh, in order of arc length.
pub(super) fn of_kind<'a>(
    name: QuantityName,
    contact: &str,
    others: &'a [OnOtherMesh],
) -> Vec<&'a OnOtherMesh> {
    let same = |q: &&OnOtherMesh| q.name == name && q.contact == contact;
    others.iter().filter(same).collect()
}

fn scale_of(quantity: &EstimatedQuantity, all: &[EstimatedQuantity], images: f64) -> f64 {
    let own = |name: QuantityName| {
        let same = all
            .iter()
            .filter(|q| q.contact == quantity.contact && q.quantity == name);
        same.map(|q| q.value).collect()
    };
    scale(quantity.quantity, quantity.value, own, images)
}

/// Replaces the error of a quantity by the bound that follows from the values of the quantity on the other meshes.
fn compare(
    quantity: &mut EstimatedQuantity,
    finer: &OnOtherMesh,
    coarser: Option<&OnOtherMesh>,
    scale: f64,
) -> Option<Doubt> {
    let size = |value: f64| match quantity.quantity {
        QuantityName::PeakTangentialStress => value.abs(),
        _ => value,
    };
    let own = size(quantity.value);
    let difference = (own - size(finer.value)).abs();
    let before = coarser.map(|coarser| (own - size(coarser.value)).abs());
    quantity.finer = Some(finer.value);
    quantity.difference = Some(difference);
    quantity.order = before
        .filter(|before| before.min(difference) > ROUNDING * scale)
        .map(|before| (before / difference).log2());
    if quantity.method == ErrorMethod::NoLimit || finer.estimable == Estimable::NoLimit {
        quantity.method = ErrorMethod::NoLimit;
        forget_error(quantity);
        return None;
    }
    let estimate = match quantity.of_mesh() {
        Some(estimate) if finer.estimable != Estimable::Unseen => estimate,
        _ => {
            quantity.method = ErrorMethod::Unknown;
            forget_error(quantity);
            return Some(match finer.estimable {
                Estimable::Unseen => Doubt::Unseen,
                _ => Doubt::Unestimated,
            });
        }
    };
    let error =
        bound(quantity.quantity, difference, quantity.order, estimate) + quantity.beside_mesh();
    quantity.method = ErrorMethod::MeshHalved;
    quantity.error = Some(error);
    quantity.relative = relative(error, scale);
    None
}

/// Makes the error of a quantity unknown.
fn forget_error(quantity: &mut EstimatedQuantity) {
    (quantity.error, quantity.relative) = (None, None);
    (
        quantity.increments,
        quantity.direction,
        quantity.measurement,
    ) = (None, None, None);
}

/// Bounds an error by the difference to the refined mesh and by the estimate from the mesh of the solution.
fn bound(name: QuantityName, difference: f64, order: Option<f64>, estimate: f64) -> f64 {
    let [factor, least] = factors(name);
    if matches!(name, QuantityName::ContactStart | QuantityName::ContactEnd) {
        return factor * difference + least * estimate;
    }
    let slow = order.map_or(0.0, |order| 1.0 / (1.0 - (-order.max(LEAST_ORDER)).exp2()));
    f64::max(factor.max(slow) * difference, least * estimate)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// For a quantity q + c hᵖ the bound is not below the error c hᵖ, for p from ½ if the order is known, and for p
    /// from 1 if it is not.
    #[test]
    fn richardsons_error_is_bounded() {
        for order in [0.5f64, 0.7, 1.0, 1.5, 2.0, 3.0] {
            let difference = 1.0 - (-order).exp2();
            let known = bound(QuantityName::NormalForce, difference, Some(order), 0.0);
            assert!(known >= 1.0 - 1e-12, "{order}: {known}");
            let unknown = bound(QuantityName::NormalForce, difference, None, 0.0);
            assert_eq!(unknown >= 1.0, order >= 1.0, "{order}: {unknown}");
        }
        // below ½, and where the differences grow, no more is concluded
        let [slow, growing] =
            [0.5, -1.0].map(|p| bound(QuantityName::NormalForce, 1.0, Some(p), 0.0));
        assert_eq!(slow, growing);
    }

    #[test]
    fn values_that_agree_by_chance_keep_a_part_of_the_estimate() {
        assert_eq!(bound(QuantityName::NormalForce, 0.0, None, 1.0), 0.3);
        assert_eq!(bound(QuantityName::ContactEnd, 0.0, None, 1.0), 0.5);
        assert_eq!(bound(QuantityName::NormalForce, 1.0, None, 1.0), 2.0);
    }
}
