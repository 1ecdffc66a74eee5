//! Linear algebra: matrices and index sets only. No other room uses the crate faer.
//!
//! # Where to look
//!
//! | subject | where |
//! |---|---|
//! | the order of elimination by nested dissection | `dissection` |
//! | shorter cuts between two halves | `bisection` |
//! | the multifrontal factor: parts that are equal | `equal_parts` |
//! | the multifrontal factor: its plan | `fronts` |
//! | the multifrontal factor: the factor itself | `multifrontal` |
//! | the multifrontal factor: one front | `front` |
//! | the multifrontal factor: solutions with it | `substitution` |
//! | dense matrices | `dense` |
//! | interruptible factors | `blocked` |
//! | a system without some unknowns | `eliminated` |
//! | eigenvalues | `spectrum` |
//! | two threads with the same bits as one | `parallel` |
//! | where long work may be stopped | `interrupt` |

mod bisection;
mod blocked;
mod dense;
mod dissection;
mod eliminated;
mod equal_parts;
mod front;
mod fronts;
mod interrupt;
mod multifrontal;
mod parallel;
mod spectrum;
mod substitution;

pub use dense::{Cholesky, Dense, General, Unsolved, least_squares, solve_positive_definite};
pub use dissection::{Cells, Dissection, SMALLEST_SHARED};
pub use eliminated::Eliminated;
pub use fronts::Fronts;
pub use interrupt::{Interrupt, Stopped};
pub use multifrontal::{ElementMatrix, Factor, FactorError};
pub use parallel::for_each_in_order;
pub use spectrum::{Rows, near_null, quadratic_eigenvalues};
