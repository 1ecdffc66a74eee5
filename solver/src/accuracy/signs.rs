//! Peaks of σ_t whose sign is not known: one in the other direction is as large within the stated error.

use crate::solution::{QuantityName, Solution, Warning, WarningCode};

/// The part of the peak below which one in the other direction is no rival, whatever the error: then the peak is not known at all.
const LEAST: f64 = 0.5;

/// Adds a note for each contact whose largest tangential stress may have the other sign, and removes those of earlier errors. `pointer`: the place of a contact in the
/// problem, by its name.
pub fn note_unknown_signs(solution: &mut Solution, pointer: impl Fn(&str) -> String) {
    let warnings = &mut solution.summary.warnings;
    warnings.retain(|warning| warning.code != WarningCode::PeakSignUnknown);
    let Some(accuracy) = &solution.summary.accuracy else {
        return;
    };
    let peaks = accuracy.quantities.iter();
    let peaks = peaks.filter(|q| q.quantity == QuantityName::PeakTangentialStress);
    let unknown = peaks.filter_map(|peak| {
        let error = peak.error?;
        let profiles = [&solution.node_profiles, &solution.friction_profiles];
        let profiles = profiles
            .into_iter()
            .filter_map(|all| all.get(&peak.contact));
        let mut points: Vec<[f64; 2]> = profiles
            .flat_map(|profile| {
                let stresses = profile.tangential_stress.iter();
                let stresses = stresses.map(|stress| -peak.value.signum() * stress);
                profile.s.iter().copied().zip(stresses).map(<[f64; 2]>::from)
            })
            .collect();
        points.sort_by(|a, b| a[0].total_cmp(&b[0]));
        points.dedup_by(|a, b| a[0] == b[0]);
        let opposite = highest(&points);
        let size = peak.value.abs();
        let unknown = opposite > LEAST * size && size - opposite <= error;
        unknown.then(|| Warning {
            code: WarningCode::PeakSignUnknown,
            pointer: pointer(&peak.contact),
            message: format!(
                "The largest tangential stress is {:.5e}, and {:.5e} in the other direction: by its error, {error:.1e}, either may be the larger. The size of peak_tangential_stress is known to that error, its sign and place are not.",
                peak.value,
                -opposite * peak.value.signum(),
            ),
        })
    });
    let notes: Vec<Warning> = unknown.collect();
    solution.summary.warnings.extend(notes);
}

/// The largest value of a curve through points, or 0 if that is larger. Between two points it may have a kink, as where stick ends:
/// there the lines through the two points on either side meet.
fn highest(points: &[[f64; 2]]) -> f64 {
    /// The largest part by which such a kink may exceed the points beside it.
    const BEYOND: f64 = 0.5;
    let at_points = points
        .iter()
        .fold(0.0, |most: f64, point| most.max(point[1]));
    let kink = |four: &[[f64; 2]]| {
        let [a, b, c, d] = [four[0], four[1], four[2], four[3]];
        let slope = |p: [f64; 2], q: [f64; 2]| (q[1] - p[1]) / (q[0] - p[0]);
        let (rise, fall) = (slope(a, b), slope(c, d));
        let place = (c[1] - b[1] + rise * b[0] - fall * c[0]) / (rise - fall);
        let value = b[1] + rise * (place - b[0]);
        let inside = place >= b[0] && place <= c[0] && rise > 0.0 && fall < 0.0;
        (inside && value <= (1.0 + BEYOND) * b[1].max(c[1])).then_some(value)
    };
    points.windows(4).filter_map(kink).fold(at_points, f64::max)
}
