//! What the solution of a job tells the service, and asks it.

use base::{event::Payload, sweep::MemberRow};
use store::Parts;

/// Whoever has a job solved. In the service that is the worker of the job, in a worker process the connection to the
/// service: a process solves a job as a thread does.
pub(super) trait Supervisor {
    /// Is told that the problem has one load level on one grid: when its iterations end, the job ends, so that the time
    /// until then can be estimated.
    fn one_level(&mut self);

    /// Is told an event of the job, as it is stored.
    fn event(&mut self, payload: Payload);

    /// Is told a member of a sweep that is solved, or cannot be.
    fn member(&mut self, row: MemberRow);

    /// Is given a partial result, ready to be stored.
    fn partial(&mut self, parts: Parts);

    /// Whether the solver should stop.
    fn stop(&mut self) -> bool;

    /// How many threads may share the next work.
    fn threads(&mut self) -> usize;
}
