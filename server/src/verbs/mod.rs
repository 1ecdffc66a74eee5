//! What the service does, each verb once, whatever the protocol; `rest` and `grpc` only translate. A verb takes the
//! service, the caller, and then what the caller asks for. The parameters of requests are defined beside the verb that
//! they belong to.

// What every verb works with.
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

// Jobs.
pub mod bulk;
pub mod jobs;
pub mod lists;
pub mod retry;
pub mod submit;
pub mod watch;

// Results.
pub mod fields;
pub mod history;
pub mod plots;
pub mod profiles;
pub mod results;

// The service itself.
pub mod info;
pub mod queue;

pub use service::Service;

#[cfg(test)]
mod tests;
