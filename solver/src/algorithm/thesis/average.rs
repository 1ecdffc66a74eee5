//! The nonlocal integral by Gauss points, thesis (3.2) and 3.4.2.

use crate::element::gauss;
use crate::friction::BoundLaw;

/// One element of the line of integration, with values at its Gauss points.
pub(super) struct Stretch<'a> {
    /// The arc length of the element's start.
    pub(super) from: f64,
    /// The arc length of the element's end.
    pub(super) to: f64,
    /// σ_n at the points of the integration rule.
    pub(super) values: &'a [f64],
}

/// The average ∫ω_ρ(|s − y|) σ_n(y) dy over the given elements (stress).
///
/// The part of each element under the kernel has `local_points` Gauss points of its own, to which σ_n is interpolated
/// linearly, 3.4.2 (i). For ρ = 0 the average is σ_n at s.
pub(super) fn nonlocal(
    law: &BoundLaw,
    stretches: &[Stretch<'_>],
    rule: &[(f64, f64)],
    local_points: u32,
    s: f64,
) -> f64 {
    let BoundLaw::Pressure { average, .. } = law else {
        return 0.0;
    };
    let value = |stretch: &Stretch<'_>, y: f64| {
        let zeta = (2.0 * y - stretch.from - stretch.to) / (stretch.to - stretch.from);
        linear(rule, stretch.values, zeta)
    };
    let radius = average.radius();
    if radius == 0.0 {
        let own = stretches.iter().find(|t| t.from <= s && s <= t.to);
        return own.map_or(0.0, |own| value(own, s));
    }
    let local = gauss::rule(local_points as usize);
    let mut sum = 0.0;
    for stretch in stretches {
        let (low, high) = (stretch.from.max(s - radius), stretch.to.min(s + radius));
        if high <= low {
            continue;
        }
        for (zeta, w) in &local {
            let y = low + 0.5 * (high - low) * (1.0 + zeta);
            sum += 0.5 * (high - low) * w * average.omega(y - s) * value(stretch, y);
        }
    }
    sum
}

/// The value at ζ of the line through the values at the Gauss points nearest to it.
pub(super) fn linear(rule: &[(f64, f64)], values: &[f64], zeta: f64) -> f64 {
    let k = usize::from(rule.len() > 2 && zeta > 0.0);
    let (a, b) = (rule[k].0, rule[k + 1].0);
    values[k] + (zeta - a) / (b - a) * (values[k + 1] - values[k])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::friction::{Average, Averaging, Chain};
    use crate::problem::{Kernel, Measure, Normalization};

    /// The average of a linear stress over two elements is the value itself, where the kernel lies within both.
    #[test]
    fn a_linear_stress_is_averaged_to_itself_within_two_elements() {
        let law = BoundLaw::Pressure {
            coefficient: 0.3,
            cohesion: 0.0,
            shear_cap: f64::INFINITY,
            average: Average {
                radius: 0.4,
                kernel: Kernel::Bump,
                normalization: Normalization::UnitIntegral,
                measure: Measure::Line,
            },
        };
        let law = law
            .along(|average| Averaging::new(average, Chain::plain(vec![0.0, 0.5, 1.0, 1.5, 2.0])));
        let rule = gauss::of_order(3);
        let stress = |from: f64, to: f64| -> Vec<f64> {
            let at = |(zeta, _): &(f64, f64)| 5.0 - (from + 0.5 * (to - from) * (1.0 + zeta));
            rule.iter().map(at).collect()
        };
        let (left, right) = (stress(0.0, 1.0), stress(1.0, 2.0));
        let stretches = [
            Stretch {
                from: 0.0,
                to: 1.0,
                values: &left,
            },
            Stretch {
                from: 1.0,
                to: 2.0,
                values: &right,
            },
        ];
        let average = nonlocal(&law, &stretches, rule, 20, 0.9);
        assert!((average - 4.1).abs() < 1e-6, "{average}");
        // few points miss the shape of the kernel; without an element its part is missing
        let coarse = nonlocal(&law, &stretches, rule, 2, 0.9);
        assert!((coarse / 4.1 - 1.0).abs() > 0.01, "{coarse}");
        let cut = nonlocal(&law, &stretches[..1], rule, 20, 0.9);
        assert!(cut < 0.8 * average, "{cut}");
    }
}
