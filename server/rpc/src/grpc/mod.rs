//! gRPC: the same operations as over REST, with health and reflection.

mod messages;
mod router;
mod service;

pub use router::{report_draining, router};
