//! The error that too few load increments cause under the incremental friction law, by comparison with more increments.
//!
//! The law is of first order in the increments. With q_n from n increments and q_m from m > n increments, the error is
//!
//!   |q_n − q| ≈ |q_n − q_m| / (1 − n/m)
//!
//! Both solutions have the same mesh, whose error is added. Since very few increments show no order yet, each step is
//! compared with at least [`LEAST`] increments.

use crate::algorithm::Quantity;
use crate::problem::Step;
use crate::solution::QuantityName;

/// The smallest number of increments in which a step is solved again; larger steps are solved in twice their
/// increments.
const LEAST: u32 = 32;

/// A safety factor on the error that the first order predicts (`tests/verification/increments.rs`).
const MARGIN: f64 = 1.25;

/// The quantities at the end of the load path, solved in more increments.
#[derive(Default)]
pub struct Increments {
    /// The quantities of the solution in more increments; empty if it did not converge.
    quantities: Vec<Quantity>,
    /// The error of a quantity, divided by its difference between the two solutions.
    factor: f64,
}

impl Increments {
    /// The load steps with more increments.
    pub fn more(steps: &[Step]) -> Vec<Step> {
        let more = |step: &Step| Step {
            increments: (2 * step.increments).max(LEAST),
            ..step.clone()
        };
        steps.iter().map(more).collect()
    }

    /// Prepares the comparison of `steps` with `finer`, the same steps in more increments. `quantities`: those at the
    /// end of `finer`.
    pub fn new(steps: &[Step], finer: &[Step], quantities: Vec<Quantity>) -> Self {
        let part = |(a, b): (&Step, &Step)| f64::from(a.increments) / f64::from(b.increments);
        let most = steps.iter().zip(finer).map(part).fold(0.0, f64::max);
        Increments {
            quantities,
            factor: MARGIN / (1.0 - most),
        }
    }

    /// The error of a quantity due to the increments, from its difference to the value with more increments. `here`:
    /// all quantities of the solution with fewer increments. None if the other solution has no quantity of this kind.
    ///
    /// The two solutions may have different numbers of stick ends: each end is compared with the nearest end of the
    /// other solution, and with every end there to which it is the nearest.
    pub(super) fn left_open(&self, quantity: &Quantity, here: &[Quantity]) -> Option<f64> {
        let alike = |q: &&Quantity| (q.name, q.patch) == (quantity.name, quantity.patch);
        let values =
            |all: &[Quantity]| -> Vec<f64> { all.iter().filter(alike).map(size).collect() };
        let (here, there) = (values(here), values(&self.quantities));
        let own = size(quantity);
        let to_there = (nearest(&there, own)? - own).abs();
        let from_there = there
            .iter()
            .filter(|other| nearest(&here, **other) == Some(own))
            .map(|other| (other - own).abs());
        Some(self.factor * from_there.fold(to_there, f64::max))
    }
}

/// The value that is nearest to `to`; none if there are no values.
fn nearest(values: &[f64], to: f64) -> Option<f64> {
    let by_distance = |a: &f64, b: &f64| (a - to).abs().total_cmp(&(b - to).abs());
    values.iter().copied().min_by(by_distance)
}

/// The value of a quantity; of a peak of σ_t without its sign, since such a peak may occur twice with both signs.
fn size(quantity: &Quantity) -> f64 {
    match quantity.name {
        QuantityName::PeakTangentialStress => quantity.value.abs(),
        _ => quantity.value,
    }
}
