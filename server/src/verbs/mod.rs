//! What the service does, each verb once, whatever the protocol. The skins only translate.

mod service;

pub mod envelope;
pub mod problems;

mod admission;
pub mod page;

pub mod fields;
pub mod history;
pub mod jobs;
pub mod meshes;
pub mod plots;
pub mod profiles;
pub mod queue;
pub mod results;
pub mod retry;
pub mod submit;
pub mod watch;

pub use service::Service;
