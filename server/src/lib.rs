//! The service: contact problems as jobs, over REST and gRPC. A room uses only rooms of its own group and of the groups
//! above it; ARCHITECTURE.md has the finer order.
//!
//! # Where to look
//!
//! The map of the service by subject. `rest`, `verbs`, `store`, `queue`, `listener` and `cli` have a map of their own
//! in their `mod.rs`. The same file name in several rooms is the same subject: `sweeps` is the routes in `rest`, the
//! operations in `verbs`, the tables in `store`.
//!
//! | subject | where |
//! |---|---|
//! | routes, bodies and headers of requests | `rest` |
//! | operations, the same for both protocols | `verbs` |
//! | everything stored, and all SQL | `store` |
//! | how jobs start, are recorded and end | `queue` |
//! | one solution with its times | `run` |
//! | sweeps: operations | `verbs/sweeps.rs` |
//! | sweeps: tables | `store/sweeps.rs` |
//! | sweeps: solving the members | `run/members.rs` |
//! | conversions between messages of gRPC and our types: the list of types | `server/build/mirrors.rs` |
//! | conversions between messages of gRPC and our types: the generator | `server/build/conversions.rs` |
//! | conversions between messages of gRPC and our types: those written by hand | `convert` |
//! | kinds of errors, with status, gRPC code and explanation | `catalog.rs` |
//! | an error of one request, with its details | `error.rs` |
//! | a parameter of requests, for both protocols | `parameters`, and beside its verb in `verbs` |
//! | callers, owners and scopes | `caller.rs` |
//! | tokens | `token.rs`, `verbs/tokens.rs`, `store/tokens.rs`, `cli/token.rs` |
//! | connections and TLS | `listener` |
//! | bytes of requests and answers in memory | `transfer.rs` |
//! | how fast clients must send and read | `pace.rs` |
//! | size of gRPC messages | `codec.rs` |
//! | the memory budget | `memory.rs` |
//! | the estimate of a problem | `solver/src/model/estimate.rs` |
//! | bodies kept for later jobs | `bodies.rs` |
//! | settings: the struct | `config.rs` |
//! | settings: their sources | `cli/settings.rs` |
//! | the log | `cli/log.rs`, `cli/log_line.rs` |
//! | metrics | `metrics`, `verbs/metrics.rs` |
//! | spans | `spans.rs` |
//! | the trace of a request | `trace.rs` |
//! | systemd and `signorini health` | `cli/notify.rs`, `cli/health.rs`, `contrib/systemd` |
//! | start and stop | `app.rs` |
//! | formats of a result, by name and media type | `formats.rs` |
//! | fingerprints of problem, result and body | `digest` |
//! | points where tests make a job fail | `failpoint.rs` |

// Basic types, for every module: the address of the service, kept bodies, callers and their tokens, kinds of errors, points in time, jobs and their changes of status, sweeps, events.
pub mod address;
pub mod bodies;
pub mod caller;
pub mod catalog;
pub mod event;
pub mod job;
pub mod memory;
pub mod mesh;
pub mod metrics;
pub mod sweep;
pub mod time;
pub mod token;
pub mod trace;

// The messages of gRPC, read within a limit.
pub mod codec;

// What is told of requests and jobs to a collector.
pub mod spans;

// Errors of requests, their parameters, the bytes that they may occupy, and the configuration.
pub mod config;
pub mod error;
pub mod pace;
pub mod parameters;
pub mod rates;
pub mod transfer;
pub mod violations;

// Where tests make a job fail.
mod failpoint;

// Solves one problem and measures it; fingerprints of problem and result; the formats of a result.
pub mod digest;
pub mod formats;
pub mod run;

// Everything durable, and the only SQL.
pub mod store;

// Takes jobs from the queue, solves them, records and ends them.
pub mod queue;

// The operations of the service, whatever the protocol.
pub mod verbs;

// The two protocols; they only translate. `convert` converts between the generated gRPC types and ours.
pub mod convert;
pub mod grpc;
pub mod rest;

// Accepts connections, and ends those that are idle, stalled or abusive.
pub mod listener;

// Starts and stops the service; and the commands.
pub mod app;
pub mod cli;

/// The gRPC contract, as generated from `proto/signorini/v1/signorini.proto`.
#[allow(missing_docs, unreachable_pub, clippy::all)]
pub mod pb {
    tonic::include_proto!("signorini.v1");

    /// The contract in binary form, served by reflection.
    pub const DESCRIPTORS: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/descriptors.bin"));
}

#[cfg(test)]
mod fake;

/// The counting allocator, as in the program, so that tests see what a job allocates.
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
