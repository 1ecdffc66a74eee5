//! The friction bound τ: from the averaged pressure, or prescribed.

use crate::friction::{Averaging, Chain, Row};
use crate::problem::{Friction, PrescribedBound};

/// How the friction bound comes about.
#[derive(Clone, Debug)]
pub enum BoundLaw {
    /// τ = min(cap, cohesion + μ S) where S > 0, else 0: thesis (1.3) with an offset and a cap.
    Pressure {
        /// μ.
        coefficient: f64,
        /// c (stress).
        cohesion: f64,
        /// Largest τ (stress); infinite without one.
        shear_cap: f64,
        /// S_ρ.
        averaging: Averaging,
    },
    /// Tresca's law: τ is given.
    Prescribed(PrescribedBound),
}

/// Where the bound at one place comes from.
#[derive(Clone, Debug, PartialEq)]
pub enum Source {
    /// The pressures of these nodes.
    Average(Row),
    /// It is given (stress).
    Given(f64),
}

impl Source {
    /// S_ρ(p) (stress); 0 where the bound is given.
    pub fn nonlocal_pressure(&self, pressures: &[f64]) -> f64 {
        match self {
            Source::Average(row) => row.apply(pressures),
            Source::Given(_) => 0.0,
        }
    }

    /// The same with nodes numbered from `first` on.
    pub fn shifted(mut self, first: usize) -> Self {
        if let Source::Average(row) = &mut self {
            row.first += first;
        }
        self
    }
}

impl BoundLaw {
    /// The law on a chain of contact edges.
    pub fn new(friction: &Friction, chain: Chain) -> Self {
        match &friction.bound {
            Some(bound) => BoundLaw::Prescribed(bound.clone()),
            None => BoundLaw::Pressure {
                coefficient: friction.coefficient.unwrap_or(0.0),
                cohesion: friction.cohesion,
                shear_cap: friction.shear_cap.unwrap_or(f64::INFINITY),
                averaging: Averaging::new(friction, chain),
            },
        }
    }

    /// Where the bound at arc length s comes from.
    pub fn source(&self, s: f64) -> Source {
        match self {
            BoundLaw::Pressure { averaging, .. } => Source::Average(averaging.row(s)),
            BoundLaw::Prescribed(PrescribedBound::Constant(bound)) => Source::Given(*bound),
            BoundLaw::Prescribed(PrescribedBound::Table(table)) => {
                Source::Given(interpolate(&table.s, &table.bound, s))
            }
        }
    }

    /// τ (stress, ≥ 0) for the nodal pressures (stress).
    pub fn bound(&self, source: &Source, pressures: &[f64]) -> f64 {
        match (self, source) {
            (_, Source::Given(bound)) => *bound,
            (_, Source::Average(row)) => self.of_average(row.apply(pressures)),
        }
    }

    /// τ from an averaged pressure S.
    pub fn of_average(&self, nonlocal_pressure: f64) -> f64 {
        match self {
            BoundLaw::Pressure {
                coefficient,
                cohesion,
                shear_cap,
                ..
            } if nonlocal_pressure > 0.0 => {
                (cohesion + coefficient * nonlocal_pressure).min(*shear_cap)
            }
            _ => 0.0,
        }
    }

    /// dτ/dS.
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

/// Linear between the points of a table, 0 outside.
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
    use crate::friction::tests::friction;
    use crate::problem::BoundTable;

    #[test]
    fn cohesion_and_cap_bound_the_bound() {
        let friction = Friction {
            cohesion: 2.0,
            shear_cap: Some(4.0),
            ..friction(0.0)
        };
        let law = BoundLaw::new(&friction, Chain::plain(vec![0.0, 0.5, 1.0]));
        let tau = |s: f64| (law.of_average(s), law.slope(s));
        assert_eq!(tau(-1.0), (0.0, 0.0));
        assert_eq!(tau(0.0), (0.0, 0.0));
        assert_eq!(tau(5.0), (3.5, 0.3));
        assert_eq!(tau(50.0), (4.0, 0.0));
    }

    #[test]
    fn a_prescribed_bound_knows_nothing_of_pressure() {
        let table = BoundTable {
            s: vec![0.0, 1.0, 3.0],
            bound: vec![2.0, 4.0, 0.0],
        };
        let friction = Friction {
            bound: Some(PrescribedBound::Table(table)),
            ..friction(0.0)
        };
        let law = BoundLaw::new(&friction, Chain::plain(vec![0.0, 2.0, 4.0]));
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
            assert_eq!(law.bound(&source, &[9.0; 3]), tau, "{s}");
            assert_eq!(source.nonlocal_pressure(&[9.0; 3]), 0.0);
        }
    }
}
