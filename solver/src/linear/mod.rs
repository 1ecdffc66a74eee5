//! Matrices and index sets only; the one room that names faer.

mod blocked;
mod breaks;
mod dense;
mod factor;
mod sparse;
mod supernodal;

pub use breaks::{Breaks, Stopped};
pub use dense::{Dense, General, Unsolved, least_squares, solve_positive_definite};
pub use factor::{Factor, FactorError, Ordering};
pub use sparse::{Graph, SparseSymmetric};
