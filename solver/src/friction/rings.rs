//! The integral of a kernel around a place over rings around the axis, for `measure: surface`.
//!
//! A ring of radius r′, `along` away on the meridian from a place at distance r from the axis, has points at
//!
//!   d² = along² + 4 r r′ sin²(θ/2)
//!
//! from it. With b = 1 − (along/ρ)², q = b ρ²/(4 r r′) and sin(θ/2) = √q z, 1 − d²/ρ² is b (1 − z²), and for q < 1
//!
//!   ∫ ω dθ = 4 √q ∫₀¹ ω̂(b (1 − z²)) / √(1 − q z²) dz = 4 √q Σ_k a_k qᵏ m_k(b),   m_k(b) = ∫₀¹ ω̂(b (1 − z²)) z²ᵏ dz
//!
//! with the coefficients a_k of (1 − x)^(−1/2): the moments m_k depend on one number, and are tabulated.

use std::sync::LazyLock;

use super::moments::hermite;
use crate::element::gauss;
use crate::problem::Kernel;

/// The number of terms of the series: up to [`LARGEST`] the next term is below 10⁻¹⁵ of the first.
const TERMS: usize = 20;

/// The largest q for which the series is used: rings farther from the axis than about half of ρ.
pub(super) const LARGEST: f64 = 0.25;

/// A term of the series below this fraction of the first is left out, with all terms after it.
const ROUNDING: f64 = 1e-17;

/// The number of cells of the table on 0 ≤ b ≤ 1; the error of its polynomials of degree five is 10⁻¹⁴.
const CELLS: usize = 1024;
/// The length of a cell.
const CELL: f64 = 1.0 / CELLS as f64;

/// The coefficients a_k of (1 − x)^(−1/2) = Σ a_k xᵏ.
static COEFFICIENTS: LazyLock<[f64; TERMS]> = LazyLock::new(|| {
    let mut a = [1.0; TERMS];
    for k in 1..TERMS {
        a[k] = a[k - 1] * (2 * k - 1) as f64 / (2 * k) as f64;
    }
    a
});

/// a_k m_k of the bump at the ends of cells, with their first and second derivatives times the cell's length and its
/// square.
static BUMP: LazyLock<Vec<[[f64; 3]; TERMS]>> = LazyLock::new(|| {
    let rule = gauss::rule(40);
    let at = |cell: usize| {
        let b = cell as f64 * CELL;
        let mut moments = [[0.0; 3]; TERMS];
        if cell == 0 {
            return moments; // the bump and all its derivatives vanish
        }
        for half in [0.25, 0.75] {
            for (xi, w) in &rule {
                let z = half + 0.25 * xi;
                // ω̂ = exp(−1/x) of x = b (1 − z²)
                let x = b * (1.0 - z * z);
                let omega = 0.25 * w * (-1.0 / x).exp();
                let (slope, curvature) = (omega / (b * x), omega / (b * x) * (1.0 / x - 2.0) / b);
                let mut power = 1.0;
                for (moment, a) in moments.iter_mut().zip(&*COEFFICIENTS) {
                    moment[0] += a * power * omega;
                    moment[1] += a * power * slope * CELL;
                    moment[2] += a * power * curvature * CELL * CELL;
                    power *= z * z;
                }
            }
        }
        moments
    };
    (0..=CELLS).map(at).collect()
});

/// The integral ∫ ω̂ dθ around a ring, for a kernel without its scale, with 0 < b ≤ 1 and 0 < q ≤ [`LARGEST`].
pub(super) fn around(kernel: Kernel, b: f64, q: f64) -> f64 {
    let terms = terms(q);
    let sum = match kernel {
        Kernel::Bump => {
            let place = b / CELL;
            let cell = (place as usize).min(CELLS - 1);
            let (near, far) = hermite(place - cell as f64);
            let (start, end) = (&BUMP[cell], &BUMP[cell + 1]);
            let term = |k: usize| {
                let (a, b) = (&start[k], &end[k]);
                near[0] * a[0] + near[1] * a[1] + near[2] * a[2] + far[0] * b[0] - far[1] * b[1]
                    + far[2] * b[2]
            };
            (0..terms).rev().fold(0.0, |sum, k| sum * q + term(k))
        }
        Kernel::Parabola => {
            let term = |k: usize| {
                let of_power = |power: usize| 1.0 / power as f64;
                COEFFICIENTS[k] * b * (of_power(2 * k + 1) - of_power(2 * k + 3))
            };
            (0..terms).rev().fold(0.0, |sum, k| sum * q + term(k))
        }
    };
    4.0 * q.sqrt() * sum
}

/// The number of terms of the series that matter for q.
fn terms(q: f64) -> usize {
    let (mut count, mut power) = (1, q);
    while power > ROUNDING && count < TERMS {
        power *= q;
        count += 1;
    }
    count
}

#[cfg(test)]
mod tests {
    use super::super::moments::shape;
    use super::*;

    /// The integral ∫ ω̂ dθ by 80 points.
    fn exact(kernel: Kernel, b: f64, q: f64) -> f64 {
        let rule = gauss::rule(40);
        let most = 2.0 * q.sqrt().min(1.0).asin();
        let mut sum = 0.0;
        for half in [0.25, 0.75] {
            for (xi, w) in &rule {
                let sine = (0.5 * most * (half + 0.25 * xi)).sin();
                let rest = b * (1.0 - sine * sine / q);
                sum += 0.25 * w * shape(kernel, (1.0 - rest).sqrt());
            }
        }
        2.0 * most * sum
    }

    #[test]
    fn the_series_is_the_integral_around_the_ring() {
        for kernel in [Kernel::Bump, Kernel::Parabola] {
            for q in [1e-6, 1e-3, 0.02, 0.1, 0.2, LARGEST] {
                for k in 1..=313 {
                    let b = f64::from(k) / 313.0;
                    let (found, exact) = (around(kernel, b, q), exact(kernel, b, q));
                    let off = (found - exact).abs();
                    assert!(off <= 1e-13 * q.sqrt(), "{b} {q}: {found} {exact}");
                }
            }
        }
    }
}
