//! What too few increments leave open under the incremental law: quantities at the end of the same path in more of them.
//!
//! The law is of first order in the increments, so that with q_n in n of them and q_m in m
//!
//!   |q_n − q| ≈ |q_n − q_m| / (1 − n/m)
//!
//! The mesh is the same, and what it leaves open comes on top. Few increments are of no order yet: each step is compared with
//! [`LEAST`] at least.

use crate::algorithm::Quantity;
use crate::problem::Step;
use crate::solution::QuantityName;

/// A step is solved again in twice its increments, and in no fewer than so many.
const LEAST: u32 = 32;

/// A margin on what the order says (`tests/verification/increments.rs`).
const MARGIN: f64 = 1.25;

/// The quantities of the end in more increments.
#[derive(Default)]
pub struct Increments {
    /// None if it did not converge.
    quantities: Vec<Quantity>,
    /// From a difference to an error.
    factor: f64,
}

impl Increments {
    /// The same steps in more increments.
    pub fn more(steps: &[Step]) -> Vec<Step> {
        let more = |step: &Step| Step {
            increments: (2 * step.increments).max(LEAST),
            ..step.clone()
        };
        steps.iter().map(more).collect()
    }

    /// `quantities` of the end of `finer`, which are `steps` in more increments.
    pub fn new(steps: &[Step], finer: &[Step], quantities: Vec<Quantity>) -> Self {
        let part = |(a, b): (&Step, &Step)| f64::from(a.increments) / f64::from(b.increments);
        let most = steps.iter().zip(finer).map(part).fold(0.0, f64::max);
        Increments {
            quantities,
            factor: MARGIN / (1.0 - most),
        }
    }

    /// What the increments leave open in a quantity, by those of its kind `here` and in more increments; none if there are
    /// none of its kind there.
    ///
    /// Ends of stick may be more or fewer: each is compared with the nearest there, and with those there that have none
    /// nearer here.
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

/// The value nearest to one.
fn nearest(values: &[f64], to: f64) -> Option<f64> {
    let by_distance = |a: &f64, b: &f64| (a - to).abs().total_cmp(&(b - to).abs());
    values.iter().copied().min_by(by_distance)
}

/// A peak of σ_t may occur twice with both signs.
fn size(quantity: &Quantity) -> f64 {
    match quantity.name {
        QuantityName::PeakTangentialStress => quantity.value.abs(),
        _ => quantity.value,
    }
}
