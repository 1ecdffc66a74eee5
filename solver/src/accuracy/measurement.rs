//! The errors of quantities due to the noise of measured obstacles, from pairs of samples with opposite noise.

use std::collections::BTreeSet;

use super::halved::{OnOtherMesh, of_kind};
use super::verdict::{Finding, by_error, relative, scale};
use crate::solution::{Accuracy, ErrorMethod, EstimatedQuantity, QuantityName, Verdict};

/// The factor on the scatter of twelve pairs within which the truth lies in 95 of 100 cases: Student's t.
const STUDENT: f64 = 2.18;

/// The factor on the shift of the samples. Smoothing keeps a part k of a feature, so that the solution is off by 1 − k of it;
/// the samples start from what is left, and shift by k (1 − k). What is kept by less than a half is lost in the noise.
const OF_SHIFT: f64 = 2.0;

/// The least part of the pairs in which a quantity must exist to have an error.
const LEAST_PART: f64 = 0.8;

/// Adds to each error what the noise leaves open: the scatter of the samples, and their mean shift, which smoothing and
/// curvature cause.
pub fn add_measurement(accuracy: &mut Accuracy, pairs: &[[Vec<OnOtherMesh>; 2]]) {
    let all = accuracy.quantities.clone();
    let mut findings: Vec<Finding> = vec![];
    for (i, quantity) in accuracy.quantities.iter_mut().enumerate() {
        let Some(of_mesh) = quantity.error else {
            continue;
        };
        let Some(part) = part(&all, i, pairs) else {
            (quantity.error, quantity.relative) = (None, None);
            quantity.method = ErrorMethod::Unknown;
            findings.push(Finding::of_noise(quantity));
            continue;
        };
        let error = of_mesh + part;
        let images = pairs.iter().flatten().find_map(|sample| {
            of_kind(quantity.quantity, &quantity.contact, sample)
                .first()
                .map(|q| q.images)
        });
        let own = |name: QuantityName| {
            let same = all
                .iter()
                .filter(|q| q.contact == quantity.contact && q.quantity == name);
            same.map(|q| q.value).collect()
        };
        let scale = scale(
            quantity.quantity,
            quantity.value,
            own,
            images.unwrap_or(1.0),
        );
        quantity.error = Some(error);
        quantity.relative = relative(error, scale);
        quantity.measurement = Some(part);
        findings.extend(by_error(quantity, None));
    }
    conclude_again(accuracy, findings);
}

/// Says that the noise of measured obstacles is not part of the errors, and why.
pub fn without_measurement(accuracy: &mut Accuracy, why: &str) {
    let why = why.trim_end_matches('.');
    accuracy.verdict = Verdict::Poor;
    accuracy.reasons.insert(
        0,
        format!("The noise of the measured profile is not part of the errors, since its samples could not be solved: {why}."),
    );
}

/// What the noise leaves open of a quantity; `None` if too few samples have the quantity.
fn part(all: &[EstimatedQuantity], i: usize, pairs: &[[Vec<OnOtherMesh>; 2]]) -> Option<f64> {
    let own = &all[i];
    let same = |q: &&EstimatedQuantity| q.quantity == own.quantity && q.contact == own.contact;
    let (before, here) = (
        all[..i].iter().filter(same).count(),
        all.iter().filter(same).count(),
    );
    // a tangential peak may occur twice with both signs
    let size = |value: f64| match own.quantity {
        QuantityName::PeakTangentialStress => value.abs(),
        _ => value,
    };
    let value = |sample: &Vec<OnOtherMesh>| {
        let found = of_kind(own.quantity, &own.contact, sample);
        (found.len() == here).then(|| size(found[before].value))
    };
    let both = |[one, other]: &[Vec<OnOtherMesh>; 2]| value(one).zip(value(other));
    let found: Vec<(f64, f64)> = pairs.iter().filter_map(both).collect();
    let count = found.len() as f64;
    if found.is_empty() || count < LEAST_PART * pairs.len() as f64 {
        return None;
    }
    let shift = found.iter().map(|(a, b)| 0.5 * (a + b)).sum::<f64>() / count - size(own.value);
    let square = found
        .iter()
        .map(|(a, b)| (0.5 * (a - b)).powi(2))
        .sum::<f64>()
        / count;
    Some(OF_SHIFT * shift.abs() + STUDENT * square.sqrt())
}

/// Lowers the verdict to what the findings permit, and puts their reasons in place of earlier ones about the same
/// quantities.
fn conclude_again(accuracy: &mut Accuracy, mut findings: Vec<Finding>) {
    findings.sort_by(|a, b| b.seriousness.total_cmp(&a.seriousness));
    let verdicts = findings.iter().map(|finding| finding.verdict);
    accuracy.verdict = verdicts.fold(accuracy.verdict, Verdict::max);
    // a reason begins with the names of its quantity and contact
    let about = |reason: &str| reason.splitn(5, '`').take(4).collect::<Vec<_>>().join("`");
    let told: BTreeSet<String> = findings
        .iter()
        .map(|finding| about(&finding.reason))
        .collect();
    accuracy
        .reasons
        .retain(|reason| !reason.starts_with('`') || !told.contains(&about(reason)));
    let new = findings.into_iter().map(|finding| finding.reason);
    accuracy.reasons.splice(0..0, new);
}
