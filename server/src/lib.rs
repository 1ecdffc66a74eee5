//! The service: contact problems as jobs, over REST and gRPC. A room uses only rooms of its own
//! group and of the groups above it; ARCHITECTURE.md has the finer order.

// What everybody may know: who asks, kinds of errors, points in time, a job and its moves, what its watchers are
// told.
pub mod caller;
pub mod catalog;
pub mod event;
pub mod job;
pub mod mesh;
pub mod time;

// What a request can be told went wrong, what it may say beside its body, and what can be set.
pub mod config;
pub mod error;
pub mod parameters;
pub mod violations;

// Solve one problem and measure it; fingerprints of problem and result; the formats of a result.
pub mod digest;
pub mod formats;
pub mod run;

// Remember: everything durable, and the only SQL.
pub mod store;

// Take, solve, record, end, cancel.
pub mod queue;

// What the service does, once.
pub mod verbs;

// Two skins that only translate; `convert` is between the types of proto and ours.
pub mod convert;
pub mod grpc;
pub mod rest;

// Open, recover, listen, stop; and the commands.
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

#[cfg(test)]
mod tests {
    #[test]
    #[should_panic(expected = "attempt to add with overflow")]
    fn an_overflow_is_a_panic_in_the_profile_that_ships() {
        let most = std::hint::black_box(u32::MAX);
        std::hint::black_box(most + 1);
    }
}
