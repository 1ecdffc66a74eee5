//! The friction law, thesis 1.2: numbers along arc length only, no mesh.
//!
//! # Where to look
//!
//! | subject | where |
//! |---|---|
//! | 1.2.1 the kernel ω_ρ and the averaged pressure S_ρ | `kernel` |
//! | integrals of ω, also over rings around the axis | `moments`, `rings` |
//! | 1.2.2 the transition φ_ε | `transition` |
//! | the bound τ, from the averaged pressure or prescribed | `bound` |

mod bound;
mod kernel;
mod moments;
mod rings;
mod transition;

pub use bound::{BoundLaw, Source, largest_pressure};
pub use kernel::{Average, Averaging, Chain, Row};
pub use transition::{phi, phi_slope, psi};

use crate::problem::{FrictionPoints, History, Transition};

/// From pressure and tangential displacement along Γ_C to the tangential traction, σ_t = −τ φ_ε(|e|) sign(e): thesis
/// (1.3), (1.8). e = u_t − d in the total law; in the incremental law e = u_t − d − g with the anchor g of the point,
/// formulation 1.5.
///
/// `A`: the average over the pressure: its parameters in a model ([`Average`]), an operator along Γ_C in a system
/// ([`Averaging`]).
#[derive(Clone, Debug, PartialEq)]
pub struct FrictionLaw<A = Averaging> {
    /// The friction bound τ.
    pub bound: BoundLaw<A>,
    /// The elastic slip ε (length).
    pub elastic_slip: f64,
    /// The transition function φ_ε.
    pub transition: Transition,
    /// Whether points have an anchor (incremental law).
    pub history: History,
    /// The points where friction is evaluated.
    pub points: FrictionPoints,
}

impl FrictionLaw<Average> {
    /// The law along a chain of contact edges, with an averaging operator instead of the parameters of the average.
    pub fn along(&self, operator: impl FnOnce(&Average) -> Averaging) -> FrictionLaw {
        FrictionLaw {
            bound: self.bound.along(operator),
            elastic_slip: self.elastic_slip,
            transition: self.transition,
            history: self.history,
            points: self.points,
        }
    }
}

impl<A> FrictionLaw<A> {
    /// The transition φ_ε with the sign of the slip e (length).
    pub fn phi(&self, slip: f64) -> f64 {
        phi(self.transition, slip / self.elastic_slip)
    }

    /// The derivative dφ/du_t (1/length).
    pub fn phi_slope(&self, slip: f64) -> f64 {
        phi_slope(self.transition, slip / self.elastic_slip) / self.elastic_slip
    }

    /// The primitive ψ_ε of φ_ε (length).
    pub fn psi(&self, slip: f64) -> f64 {
        self.elastic_slip * psi(self.transition, slip / self.elastic_slip)
    }

    /// Whether a point with the slip e sticks: |e| < ε. Slip that the incremental law moves to ε lies beside it by rounding,
    /// and more where it is interpolated between points; a relative distance of 10⁻⁹ from ε is none.
    pub fn sticks(&self, slip: f64) -> bool {
        slip.abs() < self.elastic_slip * (1.0 - 1e-9)
    }

    /// The move of a point's anchor at the end of an increment: the slip beyond the elastic slip; the whole slip if
    /// the point is `open` (length).
    pub fn anchor_move(&self, slip: f64, open: bool) -> f64 {
        match self.history {
            History::Total => 0.0,
            History::Incremental if open => slip,
            History::Incremental => slip - slip.clamp(-self.elastic_slip, self.elastic_slip),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::{Kernel, Measure, Normalization};

    /// The average that most tests use.
    pub(super) fn average(radius: f64) -> Average {
        Average {
            radius,
            kernel: Kernel::Bump,
            normalization: Normalization::UnitIntegral,
            measure: Measure::Line,
        }
    }

    #[test]
    fn anchors_of_sliding_and_open_points_move() {
        let law = FrictionLaw {
            bound: BoundLaw::Pressure {
                coefficient: 0.3,
                cohesion: 0.0,
                shear_cap: f64::INFINITY,
                average: average(0.0),
            },
            elastic_slip: 1e-4,
            transition: Transition::Linear,
            history: History::Incremental,
            points: FrictionPoints::Gauss3,
        };
        assert_eq!(law.anchor_move(0.5e-4, false), 0.0);
        assert!((law.anchor_move(-3e-4, false) + 2e-4).abs() < 1e-18);
        assert_eq!(law.anchor_move(0.5e-4, true), 0.5e-4);
        let total = FrictionLaw {
            history: History::Total,
            ..law
        };
        assert_eq!(total.anchor_move(1.0, true), 0.0);
    }
}
