//! A worker: leases jobs of a service, solves them, and reports to the service. It is a program on another machine, or a process
//! of the service, so that a crash of the solver costs only its job.
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
//! | a process of the service, with a socket for a connection | `process` |
//! | calls of the service, and which may be repeated | `calls` |
//! | what is to be reported of one job | `outbox` |
//! | messages that are lost, repeated and late | `simulation.rs` |

// In order of use: no file uses one below it.
mod outbox;
mod settings;

mod calls;

mod work;

mod process;

#[cfg(test)]
mod processes;
#[cfg(test)]
mod simulation;

pub use self::{
    process::run_as_process,
    settings::Settings,
    work::{Unwanted, run},
};
