//! What every part of the service shares: the types of its contract (jobs, callers, kinds of errors, points in
//! time), the memory that running jobs hold, and the solution of one problem with measured times. Nothing here depends
//! on the store or on a protocol.
//!
//! # Where to look
//!
//! | subject | where |
//! |---|---|
//! | the solution of one problem, with its times | `run` |
//! | sweeps: solving the members | `run/members.rs` |
//! | kinds of errors, with status, gRPC code and explanation | `catalog/mod.rs` |
//! | callers, owners and scopes | `caller.rs` |
//! | tokens | `token.rs`, `server/service/src/verbs/tokens.rs`, `server/store/src/tokens.rs`, `server/cli/src/token.rs` |
//! | the memory budget | `memory.rs` |
//! | bodies kept for later jobs | `bodies.rs` |
//! | metrics | `metrics`, `server/service/src/verbs/metrics.rs` |
//! | the trace of a request | `trace.rs` |
//! | fingerprints of problem, result and body | `digest` |
//! | points where tests make a job fail | `failpoint.rs` |
//! | ids of jobs and sweeps | `id.rs` |
//! | allowed values of parameters | `values.rs` |
//! | work on other threads and in separate tasks | `tasks.rs` |

// Where clients reach the service; texts for people; points in time, and other values of parameters; traces; counts.
pub mod address;
pub mod metrics;
pub mod text;
pub mod time;
pub mod trace;
pub mod values;

// Who may do what; kinds of errors.
pub mod caller;
pub mod catalog;
pub mod token;

// Jobs, sweeps, meshes and events; their ids.
pub mod event;
pub mod id;
pub mod job;
pub mod mesh;
pub mod sweep;

// What jobs hold in memory, and bodies kept for later ones.
pub mod bodies;
pub mod memory;

// Work on other threads.
pub mod tasks;

// Fingerprints; one problem solved and measured; where tests make a job fail.
pub mod digest;
pub mod failpoint;
pub mod run;

/// The allocator of the program, which tests need, too, to measure what a job holds.
#[cfg(test)]
#[global_allocator]
static ALLOCATOR: allocator::Counting = allocator::Counting;

#[cfg(test)]
mod tests {
    #[test]
    #[should_panic(expected = "attempt to add with overflow")]
    fn an_overflow_panics_in_the_release_profile() {
        let most = std::hint::black_box(u32::MAX);
        std::hint::black_box(most + 1);
    }
}
