//! gRPC: the same operations as over REST, with health and reflection.

mod keep_alive;
mod messages;
mod router;
mod service;
pub(crate) mod workers;

pub use router::{report_draining, router, serve_processes};

pub(crate) use router::{FRAME_BYTES, MOST_AT_ONCE_HERE, WINDOW_BYTES};
