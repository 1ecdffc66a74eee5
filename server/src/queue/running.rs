//! The handle on a solver at work.

use std::sync::{Arc, OnceLock};

/// The handle on a solver at work.
#[derive(Clone, Debug)]
pub(super) struct Running {
    pub(super) attempt: i32,
    /// Looked at by the solver in every iteration.
    pub(super) stop: Arc<OnceLock<Why>>,
}

impl Running {
    /// Asks the solver to stop. The first reason given is the one that counts.
    pub(super) fn stop(&self, why: Why) {
        let _ = self.stop.set(why); // an earlier one stays: that is the error of it, and no harm
    }
}

/// Why a solver should stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Why {
    /// The job has run longer than it may.
    OutOfTime,
    /// Nobody waits for what it finds: the job was canceled or put back.
    Unwanted,
}
