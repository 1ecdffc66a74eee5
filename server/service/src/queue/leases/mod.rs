//! Jobs that workers in other processes solve: elsewhere, and on this machine.
//!
//! A worker asks for a job, and waits until there is one: its request is an offer of a slot, which the dispatcher treats as
//! it does an idle slot of its own. The job is then leased to the worker for one attempt. The worker reports what its solver
//! tells, in order, sends results in pieces, and says how the attempt has ended; each report renews the lease. A lease that
//! is not renewed in time has ended: the job is requeued with a new attempt, and what the worker sends for the old one is
//! refused. So it makes no difference to the rest of the queue where a job is solved: `Lease` passes on reports as a solver
//! on this machine does.
//!
//! Every message may be lost, repeated or late. Requests for jobs have numbers: a repeated one gets the same job. Reports
//! and pieces have places: what has arrived before is passed over, and the answer says what is expected next.
//!
//! # Where to look
//!
//! | subject | where |
//! |---|---|
//! | what service and worker tell each other | `messages` |
//! | a result as bytes, sent in pieces | `packed` |
//! | one leased job: its reports and its end | `lease` |
//! | the workers, their offers | `workers` |
//! | a task, as the worker solves it | `task` |

mod lease;
mod messages;
mod packed;
mod task;
mod workers;

pub use self::{
    messages::{About, Ask, End, Granted, JobAnswer, JobReport, Piece, Report, WorkerId},
    packed::Packed,
    task::{Task, solve_leased},
    workers::{Pace, WorkerState},
};

pub(super) use self::{
    lease::{Lease, Told},
    workers::{Found, Leases, Offer},
};
