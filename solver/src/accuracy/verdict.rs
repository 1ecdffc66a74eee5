//! The verdict on a solution by the errors of its quantities, and its reasons in words.

use std::collections::BTreeSet;

use crate::solution::{
    Accuracy, ErrorMethod, EstimatedQuantity, Outcome, QuantityName, Verdict, Warning, WarningCode,
};

/// Largest relative errors for the verdict `good`, and for `fair`: of forces, and of peaks and extents. `good` promises
/// 1 % and 5 %. Since one stated error in twenty is too small, the limits are three quarters of that for forces and
/// three fifths for the others, some of which are too small by more (`tests/verification/calibration.rs`).
const FORCES: [f64; 2] = [0.0075, 0.05];
const OTHERS: [f64; 2] = [0.03, 0.2];

/// Why a quantity has no error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Doubt {
    /// The obstacle reaches into the body between the nodes.
    Unseen,
    /// There is a value on the refined mesh, but no estimate that would show whether the two agree by chance.
    Unestimated,
    /// There is neither an estimate nor a counterpart on the refined mesh.
    Alone,
}

/// Quantities of one kind and contact whose number differs on the refined mesh.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Unpaired {
    pub(super) name: QuantityName,
    pub(super) contact: String,
    /// Their number on the mesh of the solution.
    pub(super) here: usize,
    /// Their number on the refined mesh.
    pub(super) there: usize,
}

/// A reason of a verdict, and how serious it is: its error divided by the limit for `good`.
type Reason = (f64, String);

/// The reference size for the error of a quantity, without its sign: a force or a peak itself; for a tangential force
/// the friction force; for an end the length of the contact. `own`: values of that kind at the same contact, which has
/// `images` parts like the one that is modelled.
pub(super) fn scale(
    name: QuantityName,
    value: f64,
    own: impl Fn(QuantityName) -> Vec<f64>,
    images: f64,
) -> f64 {
    let scale = match name {
        QuantityName::TangentialForce => own(QuantityName::FrictionForce).iter().sum(),
        QuantityName::ContactStart | QuantityName::ContactEnd | QuantityName::StickEnd => {
            images
                * length(
                    own(QuantityName::ContactStart).into_iter(),
                    own(QuantityName::ContactEnd).into_iter(),
                )
        }
        _ => value,
    };
    f64::abs(scale)
}

/// The length from the first start of contact to its last end, in the part that is modelled.
pub(super) fn length(starts: impl Iterator<Item = f64>, ends: impl Iterator<Item = f64>) -> f64 {
    ends.fold(f64::NEG_INFINITY, f64::max) - starts.fold(f64::INFINITY, f64::min)
}

/// An error divided by its reference size; none if that is 0.
pub(super) fn relative(error: f64, scale: f64) -> Option<f64> {
    let relative = match error {
        0.0 => 0.0,
        error => error / scale,
    };
    Some(relative).filter(|relative| relative.is_finite())
}

/// The verdict and its reasons. `doubts`: why quantities have no error. `unpaired`: quantities whose number differs on
/// the refined mesh.
pub(super) fn conclude(
    outcome: Outcome,
    quantities: Vec<EstimatedQuantity>,
    doubts: &[Option<Doubt>],
    unpaired: &[Unpaired],
) -> Accuracy {
    let mut found: Vec<(Verdict, Reason)> = Vec::new();
    if outcome == Outcome::Converged {
        let assessed = quantities.iter().zip(doubts);
        found.extend(assessed.filter_map(|(quantity, doubt)| by_error(quantity, *doubt)));
        found.extend(unpaired.iter().map(by_number));
    } else {
        let reason = "The iterations did not converge, so the errors are unknown.";
        found.push((Verdict::Poor, (f64::INFINITY, reason.to_owned())));
    }
    let verdicts = found.iter().map(|(verdict, _)| *verdict);
    let verdict = verdicts.fold(Verdict::Good, Verdict::max);
    let mut reasons: Vec<Reason> = found.into_iter().map(|(_, reason)| reason).collect();
    // the most serious first; equal ones stay in order
    reasons.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut told = BTreeSet::new();
    reasons.retain(|(_, reason)| told.insert(reason.clone()));
    Accuracy {
        verdict,
        reasons: reasons.into_iter().map(|(_, reason)| reason).collect(),
        quantities,
        verified: None,
    }
}

/// Warnings with which stated errors cannot be relied on, the best verdict that each permits, and the reason.
#[rustfmt::skip] // a table
const DOUBTFUL: [(WarningCode, Verdict, &str); 3] = [
    (WarningCode::NotUnique, Verdict::Poor,
        "There is a second solution with other forces; the errors do not tell which of the two occurs."),
    (WarningCode::MeshTooCoarseForContact, Verdict::Fair,
        "The mesh is too coarse for a contact (`mesh_too_coarse_for_contact`), so that the stated errors may be too small."),
    (WarningCode::MeshTooCoarseForRadius, Verdict::Fair,
        "The mesh is too coarse for a nonlocal radius (`mesh_too_coarse_for_radius`), so that the stated errors of friction may be too small."),
];

/// Lowers the verdict to the best one that these warnings permit.
pub fn limit_by(warnings: &[Warning], accuracy: &mut Accuracy) {
    for (code, best, reason) in DOUBTFUL {
        let given = warnings.iter().any(|warning| warning.code == code);
        if !given || accuracy.verdict > best {
            continue;
        }
        accuracy.verdict = best;
        if accuracy.reasons.iter().all(|known| known != reason) {
            accuracy.reasons.insert(0, reason.to_owned());
        }
    }
}

/// The verdict on one quantity by its error, or because it has none, with the reason if it is not good.
fn by_error(q: &EstimatedQuantity, doubt: Option<Doubt>) -> Option<(Verdict, Reason)> {
    let (name, contact) = (<&str>::from(q.quantity), &q.contact);
    let [good, fair] = match q.quantity {
        QuantityName::NormalForce | QuantityName::TangentialForce | QuantityName::FrictionForce => {
            FORCES
        }
        _ => OTHERS,
    };
    let judged = |relative: f64| {
        if relative <= fair {
            Verdict::Fair
        } else {
            Verdict::Poor
        }
    };
    let unknown = |why: String| {
        let reason = format!("The error of `{name}` at contact `{contact}` is unknown: {why}.");
        Some((Verdict::Poor, (f64::INFINITY, reason)))
    };
    let finer = q.finer.unwrap_or_default();
    let end = matches!(
        q.quantity,
        QuantityName::ContactStart | QuantityName::ContactEnd | QuantityName::StickEnd
    );
    match (q.error, q.relative, q.method) {
        (Some(_), Some(relative), _) if relative <= good => None,
        (_, _, ErrorMethod::NoLimit) => Some((
            Verdict::Good,
            (
                0.0,
                format!(
                    "`{name}` at contact `{contact}` grows without limit as the mesh is refined (at an edge, a tip or a kink of the obstacle, at a corner of the body or where materials meet), so its value means nothing. The verdict is about the other quantities: forces converge, and so does the averaged pressure."
                ),
            ),
        )),
        (_, _, ErrorMethod::TooMany) => Some((
            Verdict::Fair,
            (
                1.0,
                format!(
                    "Contact `{contact}` has too many ends of stick (`{name}`) to state errors for them: where stick and slip alternate from point to point, they depend on the mesh. Refine the contact, or raise elastic_slip."
                ),
            ),
        )),
        // nothing acts, and nothing is wrong
        (Some(error), None, _) if q.value == 0.0 && error == 0.0 => None,
        (Some(error), relative, _) if q.increments.is_some_and(|part| part > 0.5 * error) => {
            let relative = relative.unwrap_or(f64::INFINITY);
            Some((
                judged(relative),
                (
                    relative / good,
                    format!(
                        "`{name}` at contact `{contact}`, {:.5e}, may be wrong by {}{}, that is {error:.1e}, mostly because the load grows in too few increments: give `steps` more `increments` (without `steps` there is one), or a deck a smaller first number in the row of *STATIC.",
                        q.value,
                        percent(relative),
                        if end {
                            " of the length of the contact"
                        } else {
                            ""
                        },
                    ),
                ),
            ))
        }
        (Some(error), relative, _) if q.direction.is_some_and(|part| part > 0.5 * error) => {
            let relative = relative.unwrap_or(f64::INFINITY);
            Some((
                judged(relative),
                (
                    relative / good,
                    format!(
                        "`{name}` at contact `{contact}`, {:.5e}, may be wrong by {}{}, that is {error:.1e}, mostly because gaps are linear in an indentation along `direction`: draw the obstacle in its final position with an `indentation` of 0, or push it less far.",
                        q.value,
                        percent(relative),
                        if end {
                            " of the length of the contact"
                        } else {
                            ""
                        },
                    ),
                ),
            ))
        }
        (Some(error), relative, ErrorMethod::NodeSpacing) => {
            let relative = relative.unwrap_or(f64::INFINITY);
            Some((
                judged(relative),
                (
                    relative / good,
                    format!(
                        "`{name}` at contact `{contact}`, s = {:.4}, is known only to ±{error:.1e}, {} of the length of the contact: that is the distance of the nodes there, or the obstacle ends between two of them.",
                        q.value,
                        percent(relative)
                    ),
                ),
            ))
        }
        (Some(error), relative, ErrorMethod::MeshHalved) if end => {
            let relative = relative.unwrap_or(f64::INFINITY);
            Some((
                judged(relative),
                (
                    relative / good,
                    format!(
                        "`{name}` at contact `{contact}`, s = {:.4}, is known only to ±{error:.1e}, {} of the length of the contact: on the refined mesh it is s = {finer:.4}.",
                        q.value,
                        percent(relative)
                    ),
                ),
            ))
        }
        (Some(error), relative, method) => {
            let relative = relative.unwrap_or(f64::INFINITY);
            let why = match method {
                ErrorMethod::MeshHalved => format!(
                    "on the refined mesh it is {finer:.5e}, and two meshes may agree by chance"
                ),
                _ => "the mesh is too coarse for it".to_owned(),
            };
            Some((
                judged(relative),
                (
                    relative / good,
                    format!(
                        "`{name}` at contact `{contact}`, {:.5e}, may be wrong by {}, that is {error:.1e}: {why}.",
                        q.value,
                        percent(relative)
                    ),
                ),
            ))
        }
        (None, ..) => match doubt {
            Some(Doubt::Unseen) => {
                unknown("the shape of the obstacle between the nodes is not resolved".to_owned())
            }
            Some(Doubt::Unestimated) => unknown(format!(
                "it has no estimate; on the refined mesh it is {finer:.5e}, which alone does not bound the error"
            )),
            Some(Doubt::Alone) => unknown(
                "it has no estimate, and the refined mesh has no counterpart to compare with"
                    .to_owned(),
            ),
            None => unknown("the linearised problem has no unique solution".to_owned()),
        },
    }
}

/// The reason for intervals of contact or stick that exist on only one of the two meshes.
fn by_number(unpaired: &Unpaired) -> (Verdict, Reason) {
    let Unpaired {
        name,
        contact,
        here,
        there,
    } = unpaired;
    let name = <&str>::from(*name);
    let reason = format!(
        "Contact `{contact}` has {here} of `{name}` on this mesh and {there} on the refined one, so they cannot be compared: their errors are estimates."
    );
    // after what is known to be wrong
    (Verdict::Fair, (1.0, reason))
}

fn percent(part: f64) -> String {
    match 100.0 * part {
        p if p > 100.0 => "more than 100 %".to_owned(),
        p if p < 10.0 => format!("{p:.1} %"),
        p => format!("{p:.0} %"),
    }
}
