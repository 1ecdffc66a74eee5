//! The handle on a running solver.

use std::sync::{Arc, atomic::AtomicU64};

use base::job::{Job, JobId};
use tokio::sync::SetOnce;

/// The handle on a running solver.
#[derive(Clone, Debug)]
pub(super) struct Running {
    /// The job's id, for the log.
    pub(super) id: JobId,
    /// The number of the attempt.
    pub(super) attempt: i32,
    /// Set to ask the solver to stop; the solver checks it in every iteration.
    pub(super) stop: Arc<SetOnce<StopReason>>,
    /// The number of reports of the solver that are stored.
    pub(super) stored: Arc<AtomicU64>,
    /// Whether the solver runs on this machine.
    pub(super) here: bool,
}

impl Running {
    /// The handle on the solver of an attempt that begins.
    pub(super) fn begin(job: &Job, here: bool) -> Running {
        Running {
            id: job.id,
            attempt: job.attempt,
            stop: Arc::default(),
            stored: Arc::default(),
            here,
        }
    }

    /// Asks the solver to stop for this reason. If it was asked before, the first reason is kept.
    pub(super) fn stop(&self, reason: StopReason) {
        let _ = self.stop.set(reason); // fails if a reason is set already, which is kept
    }
}

/// Why a solver should stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum StopReason {
    /// The job has reached its time limit.
    OutOfTime,
    /// The result is not needed: the job was canceled or requeued.
    Unwanted,
}
