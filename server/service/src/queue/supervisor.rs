//! What the solution of a job reports to the service, and asks it.

use base::{event::Payload, sweep::MemberRow};
use store::Parts;

/// The side that has a job solved. On a thread of the service this is the worker of the job, in a worker process, and
/// elsewhere, what is to be told to the service: so both solve a job as a thread does.
pub trait Supervisor {
    /// Receives that the problem has one load level on one grid: the job ends with its iterations, so that the time
    /// until then can be estimated.
    fn one_level(&mut self);

    /// Receives an event of the job, in the form in which it is stored.
    fn event(&mut self, payload: Payload);

    /// Receives the row of a member of a sweep that is solved, or cannot be solved.
    fn member(&mut self, row: MemberRow);

    /// Receives a partial result, ready to be stored.
    fn partial(&mut self, parts: Parts);

    /// Returns whether the solver should stop.
    fn stop(&mut self) -> bool;

    /// Returns how many threads may share the next work of the solver.
    fn threads(&mut self) -> usize;
}
