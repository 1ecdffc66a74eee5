//! What a solver reports while it is at work.

use std::ops::ControlFlow;

use crate::{event::Payload, memory::Outgrown, store::Parts, sweep::MemberRow, time::Time};

/// What a solver tells; the answer is whether it is to continue.
pub(super) enum Told {
    /// To record.
    Report(Report),
    /// It needs more memory than its share.
    OutOfMemory(Outgrown),
    /// It only asks.
    Nothing,
    /// It could share its next work with a second thread: the answer is whether there is a processor for it.
    SecondThread,
}

/// The answer of a yes or no.
pub(super) fn go_on_if(yes: bool) -> ControlFlow<()> {
    match yes {
        true => ControlFlow::Continue(()),
        false => ControlFlow::Break(()),
    }
}

/// A report of a solver.
#[derive(Debug)]
pub(super) enum Report {
    /// An event, with the time when it happened.
    Event(Time, Payload),
    /// A member of a sweep is solved, or cannot be, with the time of that.
    Member(Time, Box<MemberRow>),
    /// A partial result, ready to be stored.
    Partial(Box<Parts>),
    /// There is one load level on one grid: when its iterations end, the job ends, and the time until then can be
    /// estimated.
    OneLevel,
}
