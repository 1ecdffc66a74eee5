//! Matrices and index sets only; the one room that names faer.
//!
//! # Where to look
//!
//! | subject | where |
//! |---|---|
//! | the order of elimination by nested dissection | `dissection` |
//! | shorter cuts between two halves | `halves` |
//! | the multifrontal factor: parts that are equal | `alike` |
//! | the multifrontal factor: its plan | `fronts` |
//! | the multifrontal factor: the factor itself | `multifrontal` |
//! | the multifrontal factor: one front | `front` |
//! | the multifrontal factor: solutions with it | `substitution` |
//! | dense matrices | `dense` |
//! | interruptible factors | `blocked` |
//! | a system without some unknowns | `eliminated` |
//! | eigenvalues | `spectrum` |
//! | two threads with the same bits as one | `parallel` |
//! | where long work asks whether to go on | `breaks` |

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
