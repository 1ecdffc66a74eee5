//! Between the types of the gRPC contract and ours: `problem` on the way in, `answer` on the way
//! out, and `message` for clients, whose way out is our way in.

mod answer;
mod message;
mod problem;
mod request;

pub use answer::{pb_status, status, validation};
pub use message::problem_to_pb;
pub use problem::problem_from_pb;
pub use request::{bad, edit, filter, job_request};
