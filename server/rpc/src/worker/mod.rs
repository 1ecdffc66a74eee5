//! A worker elsewhere: leases jobs of a service, solves them, and reports to the service.
//!
//! One task asks for jobs, as long as a slot is free; one reports for all jobs together. Each job has a thread that solves it,
//! and an outbox, from which the reports are taken. A service that does not answer is asked again and again: jobs go on
//! meanwhile, and their reports wait.
//!
//! # Where to look
//!
//! | subject | where |
//! |---|---|
//! | taking jobs, solving them, reporting, ending | `work` |
//! | calls of the service, and which may be repeated | `calls` |
//! | what is to be reported of one job | `outbox` |
//! | messages that are lost, repeated and late | `simulation.rs` |

// In order of use: no file uses one below it.
mod outbox;
mod settings;

mod calls;

mod work;

#[cfg(test)]
mod simulation;

pub use self::{
    settings::Settings,
    work::{Unwanted, run},
};
