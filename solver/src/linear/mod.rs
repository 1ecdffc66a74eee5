//! Matrices and index sets only; the one room that names faer.

mod alike;
mod blocked;
mod breaks;
mod dense;
mod dissection;
mod eliminated;
mod front;
mod fronts;
mod halves;
mod multifrontal;
mod parallel;
mod spectrum;
mod substitution;

pub use breaks::{Breaks, Stopped};
pub use dense::{Cholesky, Dense, General, Unsolved, least_squares, solve_positive_definite};
pub use dissection::{Cells, Dissection};
pub use eliminated::Eliminated;
pub use fronts::Fronts;
pub use multifrontal::{ElementMatrix, Factor, FactorError};
pub use spectrum::{Rows, near_null, quadratic_eigenvalues};
