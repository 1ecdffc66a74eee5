//! The messages of a running solver.

use std::ops::ControlFlow;

use base::{event::Payload, memory::Outgrown, sweep::MemberRow, time::Time};
use store::Parts;

/// A message of a solver; the answer is whether it should continue.
pub(super) enum Told {
    /// A report to be recorded.
    Report(Report),
    /// The solver needs more memory than its share.
    OutOfMemory(Outgrown),
    /// No news; the solver asks whether to continue.
    Nothing,
    /// The solver could share its next work with a second thread; the answer is whether a processor is free.
    SecondThread,
}

/// Continues if `yes`, else breaks.
pub(super) fn go_on_if(yes: bool) -> ControlFlow<()> {
    if yes {
        ControlFlow::Continue(())
    } else {
        ControlFlow::Break(())
    }
}

/// A report of a solver.
#[derive(Debug)]
pub(super) enum Report {
    /// An event, with the time when it happened.
    Event(Time, Payload),
    /// A member of a sweep that is solved, or cannot be, with the time.
    Member(Time, Box<MemberRow>),
    /// A partial result, ready to be stored.
    Partial(Box<Parts>),
    /// The problem has one load level on one grid: when its iterations end, the job ends, so that the time until then
    /// can be estimated.
    OneLevel,
}
