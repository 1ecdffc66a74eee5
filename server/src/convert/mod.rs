//! Between the types of the gRPC contract and ours: `problem` on the way in (and, for our own
//! client, out), `answer` on the way out.

mod answer;
mod problem;

pub use answer::{judgement, pb_status, status};
pub use problem::{problem_from_pb, problem_to_pb};
