//! Contact and friction on the condensed system, FORMULATION 4.
//!
//! Algorithms are functions of one signature: from a [`System`] to its final [`State`], an
//! iteration at a time to the observer.

mod convex;
mod fixed_point;
mod profile;
mod report;
mod system;

pub use convex::{Minimum, minimise};
pub use fixed_point::{Finished, run};
pub use report::report;
pub use system::{ContactNode, Patch, Point, State, System};
