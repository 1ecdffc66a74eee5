//! The verdict on a solution, from the errors of its quantities, and the reasons for it in words.

use std::collections::BTreeSet;

use crate::solution::{
    Accuracy, ErrorMethod, EstimatedQuantity, Outcome, QuantityName, Verdict, Warning, WarningCode,
};

/// The largest relative errors of forces for the verdicts `good` and `fair`. `good` promises 1 %; since one stated
/// error in twenty is too small, the limit is three quarters of that (`tests/verification/calibration.rs`).
const FORCES: [f64; 2] = [0.0075, 0.05];

/// The largest relative errors of peaks and extents for the verdicts `good` and `fair`. `good` promises 5 %; since one
/// stated error in twenty is too small, and some by more than for forces, the limit is three fifths of that
/// (`tests/verification/calibration.rs`).
const OTHERS: [f64; 2] = [0.03, 0.2];

/// The same of ends of contact, whose stated error, the distance of the nodes, is seldom too small.
const ENDS_OF_CONTACT: [f64; 2] = [0.04, 0.2];

/// The reason why a quantity has no error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Doubt {
    /// The obstacle reaches into the body between the nodes.
    Unseen,
    /// There is a value on the refined mesh, but no estimate that would show whether both values agree by chance.
    Unestimated,
    /// There is no estimate, and no such quantity on the refined mesh.
    Alone,
}

/// A kind of quantity of a contact whose number of values differs on the refined mesh.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Unpaired {
    pub(super) name: QuantityName,
    pub(super) contact: String,
    /// The number of values on the mesh of the solution.
    pub(super) here: usize,
    /// The number of values on the refined mesh.
    pub(super) there: usize,
}

/// The contribution of one quantity to the verdict.
pub(super) struct Finding {
    /// The best verdict that the quantity permits.
    pub(super) verdict: Verdict,
    /// The error of the quantity divided by the limit for `good`: the most serious reasons come first.
    pub(super) seriousness: f64,
    pub(super) reason: String,
}

impl Finding {
    /// A quantity that the noise of a measured obstacle makes or removes.
    pub(super) fn of_noise(q: &EstimatedQuantity) -> Finding {
        let (name, contact) = (<&str>::from(q.quantity), &q.contact);
        Finding {
            verdict: Verdict::Fair,
            seriousness: 1.0,
            reason: format!(
                "`{name}` at contact `{contact}` has no error: profiles that could have been measured with the declared standard deviation have another number of such ends."
            ),
        }
    }
}

/// The part of the normal force below which a friction force is rounding: nothing rubs.
const NO_FRICTION: f64 = 1e-9;

/// The reference size, not negative, by which the error of a quantity is divided: for a force or a peak its own size;
/// for a tangential force the friction force, and where nothing rubs for both, and for the peak of σ_t, what presses; for an
/// end the length of the contact; for a tangential displacement or a tilt at least the indentation, and that by length of
/// the contact. `own`: the values of a kind at the same contact. `images`: the number of equal parts of the contact, of which one is modelled.
pub(super) fn scale(
    name: QuantityName,
    value: f64,
    own: impl Fn(QuantityName) -> Vec<f64>,
    images: f64,
) -> f64 {
    let of_contact = || {
        images
            * length(
                own(QuantityName::ContactStart).into_iter(),
                own(QuantityName::ContactEnd).into_iter(),
            )
    };
    let sum = |name: QuantityName| own(name).iter().sum::<f64>().abs();
    let pushed = || sum(QuantityName::Indentation);
    let pressed = sum(QuantityName::NormalForce);
    let rubs = sum(QuantityName::FrictionForce) > NO_FRICTION * pressed;
    let scale = match name {
        QuantityName::TangentialForce | QuantityName::FrictionForce if !rubs => pressed,
        QuantityName::PeakTangentialStress if !rubs => sum(QuantityName::PeakNormalStress),
        QuantityName::TangentialForce => own(QuantityName::FrictionForce).iter().sum(),
        name if name.is_extent() => of_contact(),
        // an obstacle may hardly move sideways, or turn, at all
        QuantityName::TangentialDisplacement => f64::abs(value).max(pushed()),
        QuantityName::Tilt => f64::abs(value).max(pushed() / of_contact()),
        _ => value,
    };
    f64::abs(scale)
}

/// The length from the first start of contact to the last end, in the part of a contact that is modelled.
pub(super) fn length(starts: impl Iterator<Item = f64>, ends: impl Iterator<Item = f64>) -> f64 {
    ends.fold(f64::NEG_INFINITY, f64::max) - starts.fold(f64::INFINITY, f64::min)
}

/// An error divided by a reference size; none if that size is 0 and the error is not.
pub(super) fn relative(error: f64, scale: f64) -> Option<f64> {
    let relative = match error {
        0.0 => 0.0,
        error => error / scale,
    };
    Some(relative).filter(|relative| relative.is_finite())
}

/// The verdict and its reasons. `doubts`: by quantity, why it has no error. `unpaired`: kinds of quantities whose
/// number differs on the refined mesh.
pub(super) fn conclude(
    outcome: Outcome,
    quantities: Vec<EstimatedQuantity>,
    doubts: &[Option<Doubt>],
    unpaired: &[Unpaired],
) -> Accuracy {
    let mut found: Vec<Finding> = Vec::new();
    if outcome == Outcome::Converged {
        let assessed = quantities.iter().zip(doubts);
        found.extend(assessed.filter_map(|(quantity, doubt)| by_error(quantity, *doubt)));
        found.extend(unpaired.iter().map(by_number));
    } else {
        found.push(Finding {
            verdict: Verdict::Poor,
            seriousness: f64::INFINITY,
            reason: match outcome {
                Outcome::FalseConvergence => {
                    "The iterations ended, but their result does not solve the problem (see the warnings), so the errors are unknown."
                }
                _ => "The iterations did not converge, so the errors are unknown.",
            }
            .to_owned(),
        });
    }
    let verdicts = found.iter().map(|finding| finding.verdict);
    let verdict = verdicts.fold(Verdict::Good, Verdict::max);
    // the most serious first; equal ones stay in order
    found.sort_by(|a, b| b.seriousness.total_cmp(&a.seriousness));
    let mut told = BTreeSet::new();
    found.retain(|finding| told.insert(finding.reason.clone()));
    Accuracy {
        verdict,
        reasons: found.into_iter().map(|finding| finding.reason).collect(),
        quantities,
        verified: None,
    }
}

/// Warnings that make stated errors unreliable, or that say that the result may belong to another problem than was meant;
/// the best verdict that each permits, and the reason in words.
#[rustfmt::skip] // a table
pub(super) const DOUBTFUL: [(WarningCode, Verdict, &str); 8] = [
    (WarningCode::NoContact, Verdict::Fair,
        "A contact never touches its obstacle (`no_contact`): unless that was intended, this is the result of another problem than was meant."),
    (WarningCode::SymmetryMissing, Verdict::Fair,
        "The middle of an obstacle lies at a free side of the body (`symmetry_missing`): unless that was intended, this is the result of another problem than was meant."),
    (WarningCode::NotUnique, Verdict::Poor,
        "There is a second solution with other forces; the errors do not tell which of the two occurs."),
    (WarningCode::NoiseUndeclared, Verdict::Fair,
        "The points of an obstacle scatter as measured ones do, and have no standard deviation (`noise_undeclared`): the stated errors do not contain that."),
    (WarningCode::PolygonInContact, Verdict::Fair,
        "The surface in contact has several corners (`polygon_in_contact`): if it is a polygon in place of a curve, the stated errors are those of the polygon."),
    (WarningCode::PolygonTooCoarse, Verdict::Poor,
        "The surface in contact is a coarse polygon (`polygon_too_coarse`): if it stands for a curve, forces and peaks are not those of the curve."),
    (WarningCode::MeshTooCoarseForContact, Verdict::Fair,
        "The mesh is too coarse for a contact (`mesh_too_coarse_for_contact`), so that the stated errors may be too small."),
    (WarningCode::MeshTooCoarseForRadius, Verdict::Fair,
        "The mesh is too coarse for a nonlocal radius (`mesh_too_coarse_for_radius`), so that the stated errors of friction may be too small."),
];

/// Lowers the verdict to the best verdict that the warnings permit.
pub fn limit_by(warnings: &[Warning], accuracy: &mut Accuracy) {
    let mut forces = accuracy
        .quantities
        .iter()
        .filter(|q| q.quantity == QuantityName::NormalForce);
    let nothing_touches = forces.all(|force| force.value == 0.0);
    for (code, best, reason) in DOUBTFUL {
        let best = match code {
            WarningCode::NoContact if nothing_touches => Verdict::Poor,
            _ => best,
        };
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

/// The contribution of a quantity to the verdict, by its error or because it has none; none if the error is `good`.
pub(super) fn by_error(q: &EstimatedQuantity, doubt: Option<Doubt>) -> Option<Finding> {
    let (name, contact) = (<&str>::from(q.quantity), &q.contact);
    let [good, fair] = match q.quantity {
        QuantityName::NormalForce
        | QuantityName::TangentialForce
        | QuantityName::FrictionForce
        | QuantityName::Indentation
        | QuantityName::TangentialDisplacement
        | QuantityName::Tilt => FORCES,
        QuantityName::ContactStart | QuantityName::ContactEnd => ENDS_OF_CONTACT,
        _ => OTHERS,
    };
    if q.error.is_some() && q.relative.is_some_and(|relative| relative <= good) {
        return None;
    }
    let (verdict, seriousness, reason) = match (q.method, q.error) {
        (ErrorMethod::NoLimit, _) => (
            Verdict::Good,
            0.0,
            format!(
                "`{name}` at contact `{contact}` grows without limit as the mesh is refined (at an edge, a tip or a kink of the obstacle, at a corner of the body or where materials meet), so its value means nothing, unless it lies away from such a place and is the same on two meshes. The verdict is about the other quantities: forces converge, and so does the averaged pressure."
            ),
        ),
        (ErrorMethod::TooMany, _) => (
            Verdict::Fair,
            1.0,
            format!(
                "Contact `{contact}` has too many ends of stick (`{name}`) to state errors for them, or some within the length of an edge: where stick and slip alternate from point to point, they depend on the mesh. Refine the contact, or raise elastic_slip."
            ),
        ),
        // nothing acts, and nothing is wrong
        (_, Some(0.0)) if q.value == 0.0 && q.relative.is_none() => return None,
        (_, Some(error)) => {
            let relative = q.relative.unwrap_or(f64::INFINITY);
            let verdict = if relative <= fair {
                Verdict::Fair
            } else {
                Verdict::Poor
            };
            let reason = format!(
                "`{name}` at contact `{contact}`, {}.",
                uncertainty(q, error, relative)
            );
            (verdict, relative / good, reason)
        }
        (_, None) => {
            let why = why_unknown(q, doubt);
            let reason = format!("The error of `{name}` at contact `{contact}` is unknown: {why}.");
            (Verdict::Poor, f64::INFINITY, reason)
        }
    };
    Some(Finding {
        verdict,
        seriousness,
        reason,
    })
}

/// The value of a quantity, how far it may be wrong, and the main cause, in words.
fn uncertainty(q: &EstimatedQuantity, error: f64, relative: f64) -> String {
    let is_end = q.quantity.is_extent();
    let (value, finer) = (q.value, q.finer.unwrap_or_default());
    let of_itself = (error - relative * value.abs()).abs() <= 1e-3 * error;
    let part = match q.quantity {
        _ if of_itself || !relative.is_finite() => percent(relative),
        QuantityName::TangentialDisplacement => format!("{} of the indentation", percent(relative)),
        QuantityName::Tilt => {
            format!(
                "{} of the indentation by the length of the contact",
                percent(relative)
            )
        }
        _ => percent(relative),
    };
    let mostly = |share: Option<f64>| share.is_some_and(|share| share > 0.5 * error);
    let of_load = |why: &str| {
        let of = if is_end {
            " of the length of the contact"
        } else {
            ""
        };
        format!(
            "{value:.5e}, may be wrong by {part}{of}, that is {error:.1e}, mostly because {why}"
        )
    };
    let of_place = |why: &str| {
        format!(
            "s = {value:.4}, is known only to ±{error:.1e}, {part} of the length of the contact: {why}"
        )
    };
    let of_mesh =
        |why: &str| format!("{value:.5e}, may be wrong by {part}, that is {error:.1e}: {why}");
    if mostly(q.increments) {
        return of_load(
            "the load grows in too few increments: give `steps` more `increments` (without `steps` there is one), or a deck a smaller first number in the row of *STATIC",
        );
    }
    if mostly(q.measurement) {
        return of_load(
            "the points of the obstacle are known only to their standard deviation: measure more points, or measure them more exactly",
        );
    }
    if mostly(q.direction) {
        return of_load(
            "gaps are linear in an indentation along `direction`: draw the obstacle in its final position with an `indentation` of 0, or push it less far",
        );
    }
    match q.method {
        ErrorMethod::NodeSpacing => of_place(
            "that is the distance of the nodes there, or the obstacle ends between two of them",
        ),
        ErrorMethod::MeshHalved if is_end => {
            of_place(&format!("on the refined mesh it is s = {finer:.4}"))
        }
        ErrorMethod::MeshHalved => of_mesh(&format!(
            "on the refined mesh it is {finer:.5e}, and two meshes may agree by chance"
        )),
        _ if of_several(q, error) => of_mesh(
            "the mesh, the number of increments and the noise of the obstacle have parts in that, none of them more than half",
        ),
        _ => of_mesh("the mesh is too coarse for it"),
    }
}

/// Whether increments and noise together are more than half of an error, and so more than the mesh.
fn of_several(q: &EstimatedQuantity, error: f64) -> bool {
    q.increments.unwrap_or_default() + q.measurement.unwrap_or_default() > 0.5 * error
}

/// The reason, in words, why the error of a quantity is unknown.
fn why_unknown(q: &EstimatedQuantity, doubt: Option<Doubt>) -> String {
    let why = match doubt {
        Some(Doubt::Unseen) => "the shape of the obstacle between the nodes is not resolved",
        Some(Doubt::Unestimated) => {
            let finer = q.finer.unwrap_or_default();
            return format!(
                "it has no estimate; on the refined mesh it is {finer:.5e}, which alone does not bound the error"
            );
        }
        Some(Doubt::Alone) => {
            "it has no estimate, and the refined mesh has no counterpart to compare with"
        }
        None => "the linearised problem has no unique solution",
    };
    why.to_owned()
}

/// The reason for intervals of contact or stick that exist on only one of the two meshes.
fn by_number(unpaired: &Unpaired) -> Finding {
    let Unpaired {
        name,
        contact,
        here,
        there,
    } = unpaired;
    let name = <&str>::from(*name);
    Finding {
        verdict: Verdict::Fair,
        seriousness: 1.0, // after what is known to be wrong
        reason: format!(
            "Contact `{contact}` has {here} of `{name}` on this mesh and {there} on the refined one, so they cannot be compared: their errors are estimates."
        ),
    }
}

pub(super) fn percent(part: f64) -> String {
    match 100.0 * part {
        p if p > 100.0 => "more than 100 %".to_owned(),
        p if p < 10.0 => format!("{p:.1} %"),
        p => format!("{p:.0} %"),
    }
}
