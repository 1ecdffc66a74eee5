//! Matrices and index sets only; the one room that names faer.

mod dense;
mod factor;
mod sparse;

pub use dense::{Dense, least_squares, solve_general, solve_positive_definite};
pub use factor::{Factor, FactorError, Ordering};
pub use sparse::{Graph, SparseSymmetric};
