//! The moments of a kernel up to a place, which give the kernel's integral over a part of a straight edge.

use std::sync::LazyLock;

use crate::element::gauss;
use crate::problem::Kernel;

/// The kernel shape ω(t) on (−1, 1), without its scale: exp(1/(t² − 1)) or 1 − t².
pub(super) fn shape(kernel: Kernel, t: f64) -> f64 {
    let rest = 1.0 - t * t;
    match kernel {
        _ if rest <= 0.0 => 0.0,
        // exp(ρ²/(x² − ρ²)): the exponent's sign as formulation 2.1 reads (1.2)
        Kernel::Bump => (-1.0 / rest).exp(),
        Kernel::Parabola => rest,
    }
}

/// The total variation of the slope ω′(t) on the whole line, rounded up.
pub(super) fn total_variation_of_slope(kernel: Kernel) -> f64 {
    match kernel {
        // from 0 to its largest value 0.7984…, to the opposite value and back
        Kernel::Bump => 3.194,
        // from 0 to 2 at the start of the kernel, to −2 and back to 0 at its end
        Kernel::Parabola => 8.0,
    }
}

/// ∫ ω(t) tᵏ dt from −1 to x, for k = 0, 1, 2; −1 ≤ x ≤ 1. The error for the bump is 10⁻¹⁵.
#[rustfmt::skip]
pub(super) fn moments_up_to(kernel: Kernel, x: f64) -> [f64; 3] {
    match kernel {
        Kernel::Bump => of_bump(x),
        Kernel::Parabola => [
            x - x.powi(3) / 3.0 + 2.0 / 3.0,
            x.powi(2) / 2.0 - x.powi(4) / 4.0 - 0.25,
            x.powi(3) / 3.0 - x.powi(5) / 5.0 + 2.0 / 15.0,
        ],
    }
}

/// The number of cells of the table. A quarter of the cells would give an error of 3·10⁻¹²; the error falls with the
/// sixth power of their number.
const CELLS: usize = 1024;
/// The length of a cell.
const CELL: f64 = 2.0 / CELLS as f64;

/// The values at an end of a cell: the moments up to this place, ω and ω′.
struct Known {
    moments: [f64; 3],
    omega: f64,
    slope: f64,
}

static BUMP: LazyLock<Vec<Known>> = LazyLock::new(|| {
    let rule = gauss::rule(6);
    let mut moments = [0.0; 3];
    let mut table = Vec::with_capacity(CELLS + 1);
    for k in 0..=CELLS {
        let start = k as f64 * CELL - 1.0;
        let (omega, rest) = (shape(Kernel::Bump, start), 1.0 - start * start);
        table.push(Known {
            moments,
            omega,
            slope: match omega {
                0.0 => 0.0,
                _ => -2.0 * start / (rest * rest) * omega,
            },
        });
        for (xi, w) in &rule {
            let t = start + 0.5 * CELL * (1.0 + xi);
            let part = 0.5 * CELL * w * shape(Kernel::Bump, t);
            (0..3).for_each(|k| moments[k] += part * t.powi(k as i32));
        }
    }
    table
});

/// Hermite's polynomials of degree five on a cell of length 1, at r from its start: the weights of value, slope and
/// curvature at its start, and at its end, where the slope counts with the opposite sign.
pub(super) fn hermite(r: f64) -> ([f64; 3], [f64; 3]) {
    let own = |r: f64| {
        let rest = (1.0 - r).powi(3);
        [
            rest * (1.0 + 3.0 * r + 6.0 * r * r),
            rest * r * (1.0 + 3.0 * r),
            rest * 0.5 * r * r,
        ]
    };
    (own(r), own(1.0 - r))
}

/// The moments of the bump up to x: between the ends of a cell, the polynomial of degree five with the right values and
/// first two derivatives at both ends.
fn of_bump(x: f64) -> [f64; 3] {
    let place = (x + 1.0) / CELL;
    let cell = (place as usize).min(CELLS - 1);
    let r = place - cell as f64;
    let ends = [&BUMP[cell], &BUMP[cell + 1]];
    let at = [cell as f64 * CELL - 1.0, (cell + 1) as f64 * CELL - 1.0];
    let (near, far) = hermite(r);
    std::array::from_fn(|k| {
        let derivatives = |end: usize| {
            let (Known { omega, slope, .. }, t) = (ends[end], at[end]);
            let [power, of_power] = [[1.0, 0.0], [t, 1.0], [t * t, 2.0 * t]][k];
            [
                ends[end].moments[k],
                CELL * power * omega,
                CELL * CELL * (power * slope + of_power * omega),
            ]
        };
        let (a, b) = (derivatives(0), derivatives(1));
        near[0] * a[0] + near[1] * a[1] + near[2] * a[2] + far[0] * b[0] - far[1] * b[1]
            + far[2] * b[2]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_are_integrals_of_the_kernel() {
        // pieces that no cell of the table begins or ends with
        let rule = gauss::rule(20);
        for kernel in [Kernel::Bump, Kernel::Parabola] {
            let (mut exact, mut at) = ([0.0; 3], -1.0);
            for piece in 1..=97 {
                let next = f64::from(piece) / 48.5 - 1.0;
                for (xi, w) in &rule {
                    let t = at + 0.5 * (next - at) * (1.0 + xi);
                    let part = 0.5 * (next - at) * w * shape(kernel, t);
                    (0..3).for_each(|k| exact[k] += part * t.powi(k as i32));
                }
                at = next;
                for (found, exact) in moments_up_to(kernel, at).iter().zip(exact) {
                    assert!((found - exact).abs() < 2e-15, "{at}: {found} {exact}");
                }
            }
        }
    }
}
