//! The friction bound τ: from the averaged pressure, or prescribed.

use std::sync::Arc;

use crate::friction::{Average, Averaging, Row};
use crate::problem::PrescribedBound;

/// With cohesion, an averaged pressure below this fraction of the largest nodal pressure counts as zero, so that
/// rounding does not switch on the cohesion where nothing touches. Pressures are known to far more digits, and the
/// kernel is negligible at its very end.
const NO_PRESSURE: f64 = 1e-9;

/// The source of the friction bound; `A` as in [`FrictionLaw`](crate::friction::FrictionLaw).
#[derive(Clone, Debug, PartialEq)]
pub enum BoundLaw<A = Averaging> {
    /// τ = min(cap, cohesion + μ S) where S > 0, else 0: thesis (1.3) with an offset and a cap. With cohesion, S > 0
    /// means more than a billionth of the largest nodal pressure.
    Pressure {
        /// The coefficient μ.
        coefficient: f64,
        /// The cohesion c (stress).
        cohesion: f64,
        /// The largest τ (stress); infinite without a cap.
        shear_cap: f64,
        /// The average that gives S_ρ.
        average: A,
    },
    /// Tresca's law: τ is prescribed.
    Prescribed(PrescribedBound),
}

/// The source that the bound at one place is computed from.
#[derive(Clone, Debug, PartialEq)]
pub enum Source {
    /// The pressures of some nodes, averaged by a row of weights.
    Average(Arc<Row>),
    /// A prescribed bound (stress).
    Given(f64),
}

impl Source {
    /// The averaged pressure S_ρ(p) (stress); 0 where the bound is prescribed.
    pub fn nonlocal_pressure(&self, pressures: &[f64]) -> f64 {
        match self {
            Source::Average(row) => row.apply(pressures),
            Source::Given(_) => 0.0,
        }
    }

    /// The same source for a system in which the contact's nodes are numbered from `first` on.
    pub fn shifted(mut self, first: usize) -> Self {
        // rows are shared with the operator: those of the first contact stay so
        if let Source::Average(row) = &mut self
            && first > 0
        {
            Arc::make_mut(row).first += first;
        }
        self
    }
}

impl BoundLaw<Average> {
    /// The law along a chain of contact edges, with an averaging operator instead of the parameters of the average.
    pub fn along(&self, operator: impl FnOnce(&Average) -> Averaging) -> BoundLaw {
        match self {
            BoundLaw::Prescribed(bound) => BoundLaw::Prescribed(bound.clone()),
            BoundLaw::Pressure {
                coefficient,
                cohesion,
                shear_cap,
                average,
            } => BoundLaw::Pressure {
                coefficient: *coefficient,
                cohesion: *cohesion,
                shear_cap: *shear_cap,
                average: operator(average),
            },
        }
    }

    /// The radius ρ of the average (length); `None` where the bound is prescribed.
    pub fn radius(&self) -> Option<f64> {
        match self {
            BoundLaw::Pressure { average, .. } => Some(average.radius),
            BoundLaw::Prescribed(_) => None,
        }
    }

    /// The radius ρ > 0 (length) if the bound depends on an average, with μ > 0.
    pub fn averaged_over(&self) -> Option<f64> {
        match self {
            BoundLaw::Pressure {
                coefficient,
                average,
                ..
            } if *coefficient > 0.0 && average.radius > 0.0 => Some(average.radius),
            _ => None,
        }
    }
}

impl<A> BoundLaw<A> {
    /// Whether friction acts: with μ = 0 and no cohesion the bound is zero.
    pub fn acts(&self) -> bool {
        match self {
            BoundLaw::Pressure {
                coefficient,
                cohesion,
                ..
            } => *coefficient > 0.0 || *cohesion > 0.0,
            BoundLaw::Prescribed(_) => true,
        }
    }

    /// Whether the bound can be above zero, so that friction can hold a body.
    pub fn holds(&self) -> bool {
        match self {
            BoundLaw::Pressure { .. } => self.acts(),
            BoundLaw::Prescribed(PrescribedBound::Constant(bound)) => *bound > 0.0,
            BoundLaw::Prescribed(PrescribedBound::Table(table)) => {
                table.bound.iter().any(|bound| *bound > 0.0)
            }
        }
    }
}

impl BoundLaw {
    /// The distance up to which the bound depends on pressures (length); `None` where the bound is prescribed.
    pub fn reach(&self) -> Option<f64> {
        match self {
            BoundLaw::Pressure { average, .. } => Some(average.radius()),
            BoundLaw::Prescribed(_) => None,
        }
    }

    /// The work of computing a source (multiplications).
    pub fn work(&self, source: &Source) -> usize {
        match (self, source) {
            (BoundLaw::Pressure { average, .. }, Source::Average(row)) => average.work(row),
            _ => 0,
        }
    }

    /// The source of the bound at arc length s.
    pub fn source(&self, s: f64) -> Source {
        match self {
            BoundLaw::Pressure { average, .. } => Source::Average(average.row(s)),
            BoundLaw::Prescribed(PrescribedBound::Constant(bound)) => Source::Given(*bound),
            BoundLaw::Prescribed(PrescribedBound::Table(table)) => {
                Source::Given(interpolate(&table.s, &table.bound, s))
            }
        }
    }

    /// The bound τ (stress, ≥ 0) for the nodal pressures (stress). `largest`: the largest nodal pressure of the
    /// contact.
    pub fn bound(&self, source: &Source, pressures: &[f64], largest: f64) -> f64 {
        match (self, source) {
            (_, Source::Given(bound)) => *bound,
            (_, Source::Average(row)) => self.of_average(row.apply(pressures), largest),
        }
    }

    /// The bound τ for an averaged pressure S, where the largest nodal pressure is `largest`.
    pub fn of_average(&self, nonlocal_pressure: f64, largest: f64) -> f64 {
        match self {
            BoundLaw::Pressure {
                coefficient,
                cohesion,
                shear_cap,
                ..
            } if nonlocal_pressure > least_pressure(*cohesion, largest) => {
                (cohesion + coefficient * nonlocal_pressure).min(*shear_cap)
            }
            _ => 0.0,
        }
    }

    /// The derivative dτ/dS, apart from the jump by the cohesion.
    pub fn slope(&self, nonlocal_pressure: f64) -> f64 {
        match self {
            BoundLaw::Pressure {
                coefficient,
                cohesion,
                shear_cap,
                ..
            } if nonlocal_pressure > 0.0
                && cohesion + coefficient * nonlocal_pressure < *shear_cap =>
            {
                *coefficient
            }
            _ => 0.0,
        }
    }
}

/// The value that the averaged pressure S must exceed to count as pressure.
fn least_pressure(cohesion: f64, largest: f64) -> f64 {
    // without cohesion nothing jumps
    if cohesion > 0.0 {
        NO_PRESSURE * largest
    } else {
        0.0
    }
}

/// The largest of some nodal pressures (stress, ≥ 0).
pub fn largest_pressure(pressures: &[f64]) -> f64 {
    pressures.iter().fold(0.0, |most, p| p.max(most))
}

/// The value at a place, linear between the points of a table and 0 outside.
fn interpolate(x: &[f64], y: &[f64], at: f64) -> f64 {
    let after = x.partition_point(|x| *x < at);
    match after {
        0 if x.first() == Some(&at) => y[0],
        0 => 0.0,
        _ if after == x.len() => 0.0,
        _ => {
            let (x0, x1) = (x[after - 1], x[after]);
            y[after - 1] + (at - x0) / (x1 - x0) * (y[after] - y[after - 1])
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::friction::Chain;
    use crate::friction::tests::average;
    use crate::problem::BoundTable;

    #[test]
    fn cohesion_and_cap_limit_the_friction_bound() {
        let law = BoundLaw::Pressure {
            coefficient: 0.3,
            cohesion: 2.0,
            shear_cap: 4.0,
            average: average(0.0),
        };
        let law = law.along(|average| Averaging::new(average, Chain::plain(vec![0.0, 0.5, 1.0])));
        let tau = |s: f64| (law.of_average(s, 100.0), law.slope(s));
        assert_eq!(tau(-1.0), (0.0, 0.0));
        assert_eq!(tau(2e-14).0, 0.0);
        assert_eq!(tau(2e-7).0, 2.0 + 0.3 * 2e-7);
        assert_eq!(tau(0.0), (0.0, 0.0));
        assert_eq!(tau(5.0), (3.5, 0.3));
        assert_eq!(tau(50.0), (4.0, 0.0));
    }

    #[test]
    fn a_prescribed_bound_does_not_depend_on_pressure() {
        let table = BoundTable {
            s: vec![0.0, 1.0, 3.0],
            bound: vec![2.0, 4.0, 0.0],
        };
        let law: BoundLaw<Average> = BoundLaw::Prescribed(PrescribedBound::Table(table));
        let law = law.along(|average| Averaging::new(average, Chain::plain(vec![0.0, 2.0, 4.0])));
        for (s, tau) in [
            (-0.1, 0.0),
            (0.0, 2.0),
            (0.5, 3.0),
            (1.0, 4.0),
            (2.0, 2.0),
            (3.0, 0.0),
            (3.5, 0.0),
        ] {
            let source = law.source(s);
            assert_eq!(law.bound(&source, &[9.0; 3], 9.0), tau, "{s}");
            assert_eq!(source.nonlocal_pressure(&[9.0; 3]), 0.0);
        }
    }
}
