//! gRPC: the same verbs as messages, with health and reflection.

mod messages;
mod router;
mod service;

pub use router::{report_draining, router};
