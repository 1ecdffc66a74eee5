//! φ_ε, from stick to slip, thesis (1.7), as functions of r = (u_t − d)/ε.
//!
//! Odd in r: the sign of the thesis's (1.8) is included. Even primitive ψ, thesis (1.19).

use crate::problem::Transition;

/// The transition φ(r), between −1 and 1.
pub fn phi(transition: Transition, r: f64) -> f64 {
    match transition {
        Transition::Linear => r.clamp(-1.0, 1.0),
        Transition::Tanh => r.tanh(),
    }
}

/// The derivative dφ/dr.
pub fn phi_slope(transition: Transition, r: f64) -> f64 {
    match transition {
        Transition::Linear => f64::from(u8::from(r.abs() < 1.0)),
        Transition::Tanh => {
            let t = r.tanh();
            1.0 - t * t
        }
    }
}

/// The primitive ψ(r) = ∫₀ʳ φ.
pub fn psi(transition: Transition, r: f64) -> f64 {
    let r = r.abs();
    match transition {
        Transition::Linear if r < 1.0 => 0.5 * r * r,
        Transition::Linear => r - 0.5,
        // ln cosh r without overflow
        Transition::Tanh => r + (-2.0 * r).exp().ln_1p() - std::f64::consts::LN_2,
    }
}

#[cfg(test)]
mod tests {
    use strum::VariantArray;

    use super::*;

    /// The transition has the four properties of thesis (1.6).
    #[test]
    fn phi_is_odd_monotone_bounded_and_tends_to_one() {
        for transition in Transition::VARIANTS.iter().copied() {
            let mut last = -1.0;
            for k in -4000..=4000 {
                let r = f64::from(k) / 100.0;
                let value = phi(transition, r);
                assert!(value >= last && value.abs() <= 1.0);
                assert_eq!(value, -phi(transition, -r));
                last = value;
            }
            assert_eq!(phi(transition, 0.0), 0.0);
            assert!((phi(transition, 1.0 / 1e-8) - 1.0).abs() < 1e-15);
        }
    }

    #[test]
    fn phi_is_the_slope_of_psi_and_phi_slope_that_of_phi() {
        let step = 1e-6;
        for transition in Transition::VARIANTS.iter().copied() {
            for r in [-40.0, -1.7, -0.6, 0.2, 0.9, 3.0, 500.0] {
                let slope = |f: fn(Transition, f64) -> f64| {
                    (f(transition, r + step) - f(transition, r - step)) / (2.0 * step)
                };
                assert!((slope(psi) - phi(transition, r)).abs() < 1e-6);
                assert!((slope(phi) - phi_slope(transition, r)).abs() < 1e-9);
            }
        }
    }
}
