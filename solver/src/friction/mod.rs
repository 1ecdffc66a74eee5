//! The friction law, thesis 1.2: numbers along arc length only, no mesh.

mod kernel;
mod transition;

pub use kernel::{Averaging, Chain, Row};
pub use transition::{phi, phi_slope, psi};

use crate::problem::{Friction, Transition};

/// From pressure and tangential displacement along Γ_C to the tangential traction,
/// σ_t = −τ φ_ε(|u_t − d|) sign(u_t − d), τ = μ max(S_ρ(p), 0): thesis (1.3), (1.8).
#[derive(Clone, Debug)]
pub struct FrictionLaw {
    /// μ.
    pub coefficient: f64,
    /// ε (length).
    pub elastic_slip: f64,
    /// φ_ε.
    pub transition: Transition,
    /// S_ρ.
    pub averaging: Averaging,
}

impl FrictionLaw {
    /// The law on a chain of contact edges.
    pub fn new(friction: &Friction, chain: Chain) -> Self {
        FrictionLaw {
            coefficient: friction.coefficient,
            elastic_slip: friction.elastic_slip,
            transition: friction.transition,
            averaging: Averaging::new(friction, chain),
        }
    }

    /// τ = μ max(S, 0) from the averaged pressure S (stress).
    pub fn bound(&self, nonlocal_pressure: f64) -> f64 {
        self.coefficient * nonlocal_pressure.max(0.0)
    }

    /// φ_ε with the sign of `slip` = u_t − d.
    pub fn phi(&self, slip: f64) -> f64 {
        phi(self.transition, slip / self.elastic_slip)
    }

    /// dφ/du_t (1/length).
    pub fn phi_slope(&self, slip: f64) -> f64 {
        phi_slope(self.transition, slip / self.elastic_slip) / self.elastic_slip
    }

    /// ψ_ε, the primitive of φ_ε (length).
    pub fn psi(&self, slip: f64) -> f64 {
        self.elastic_slip * psi(self.transition, slip / self.elastic_slip)
    }
}
