//! What the service does, each verb once, whatever the protocol. The skins only translate. A verb takes the
//! service, then who asks, then what is asked; the parameters that a request may say stand beside it.

// What every verb works with.
mod service;

// Parts of requests: a job and what comes beside its problem, a key, filters, pages.
pub mod envelope;
pub mod filters;
pub mod key;
pub mod page;

// Meshes and problems; from there to the queue.
pub mod meshes;
pub mod problems;

mod admission;

// Jobs: submitted, looked after, watched.
pub mod bulk;
pub mod jobs;
pub mod lists;
pub mod retry;
pub mod submit;
pub mod watch;

// What they have found.
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
