//! Between the messages of the gRPC contract and our types.
//!
//! Most of it is written by the build, field by field, for the types that `server/build/mirrors.rs` lists: a
//! field that only the message or only the type has does not compile. By hand stand here the shapes that
//! differ (`problem`, `answer`), and what requests hold beside a problem (`request`).

mod answer;
mod conversions;
mod problem;
mod read;
mod request;
#[cfg(test)]
mod tests;
mod write;

pub use read::{FromMessage, Reader, read};
pub use request::{bad, edit, filter, job_request};
pub use write::IntoMessage;
