//! The service behind its protocols: the operations, each once (`verbs`), and the queue that solves jobs (`queue`),
//! with what they need of errors, parameters, settings and formats.
//!
//! # Where to look
//!
//! | subject | where |
//! |---|---|
//! | operations, the same for both protocols | `verbs` |
//! | how jobs start, are recorded and end | `queue` |
//! | sweeps: operations | `verbs/sweeps.rs` |
//! | an error of one request, with its details | `error.rs` |
//! | a parameter of requests, for both protocols | `parameters`, and beside its operation in `verbs` |
//! | bytes of requests and answers in memory | `transfer.rs` |
//! | how fast clients must send and read | `pace.rs` |
//! | the estimate of a problem | `solver/src/model/estimate.rs` |
//! | settings: the struct | `config.rs` |
//! | spans | `spans.rs` |
//! | formats of a result, by name and media type | `formats.rs` |

// The configuration; errors of requests, their parameters, and the bytes that they may occupy.
pub mod config;
pub mod error;
pub mod pace;
pub mod parameters;
pub mod rates;
pub mod transfer;
pub mod violations;

// What is told of requests and jobs to a collector.
pub mod spans;

// The formats of a result.
pub mod formats;

// Takes jobs from the queue, solves them, records and ends them.
pub mod queue;

// The operations, whatever the protocol.
pub mod verbs;

/// The allocator of the program `signorini`, so that tests can measure the memory that a job holds.
#[cfg(test)]
#[global_allocator]
static ALLOCATOR: allocator::Counting = allocator::Counting;
