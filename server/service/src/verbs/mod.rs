//! The operations of the service, each defined once for both protocols; `rest` and `grpc` only translate requests and
//! answers. An operation takes the service, the caller, and then the arguments of the request. The parameters of
//! requests are defined next to their operation.
//!
//! An operation returns its future in a box. An async function is compiled in every crate that calls it: each protocol
//! would compile all operations, with what they use of the store.
//!
//! # Where to look
//!
//! | subject | where |
//! |---|---|
//! | the service that all operations receive: its limits and pools | `service` |
//! | submitting jobs | `submit`, `envelope`, `key` |
//! | retrying a job | `retry` |
//! | admission, with shares of owners | `admission` |
//! | checking a problem without storing it | `problems` |
//! | one job | `jobs` |
//! | lists, their filters and pages | `lists`, `filters`, `page` |
//! | jobs and their numbers as one table | `job_table` |
//! | many jobs at once | `bulk` |
//! | watching a job, a list of jobs | `watch`, `watch_list` |
//! | sweeps | `sweeps` |
//! | results: summary, iterations, profiles, fields, figures, views for programs that draw | `results`, `history`, `profiles`, `fields` with `fields_in_memory`, `plots`, `views` |
//! | problems to begin with | `examples` |
//! | meshes and their uploads | `meshes`, `uploads` |
//! | identifying the caller | `identify` |
//! | tokens | `tokens` |
//! | the queue | `queue` |
//! | version, limits and shares | `info` |
//! | workers elsewhere | `workers` |
//! | metrics | `metrics` |

// The service, which every operation receives.
mod service;

// Parts of requests: a job and what comes beside its problem, a key, filters, pages.
pub mod envelope;
pub mod filters;
pub mod key;
pub mod page;

// Meshes and problems; how a job is admitted.
pub mod meshes;
pub mod problems;

mod admission;
mod uploads;

// Jobs.
pub mod bulk;
pub mod job_table;
pub mod jobs;
pub mod lists;
pub mod retry;
pub mod submit;
pub mod watch;
pub mod watch_list;

// Sweeps, which are solved by jobs.
pub mod sweeps;

// Results.
pub mod fields;
mod fields_in_memory;
pub mod history;
pub mod plots;
pub mod profiles;
pub mod results;
pub mod views;

// Who makes a request; tokens.
pub mod identify;
pub mod tokens;

// The service itself.
pub mod examples;
pub mod info;
pub mod metrics;
pub mod queue;
pub mod workers;

pub use service::{MAX_MESSAGE_BYTES, Service};

#[cfg(test)]
mod tests;
