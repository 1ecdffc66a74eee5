//! What happens to a job, as its watchers are told.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use solver::solution::{Iteration, Phase, Warning};

use crate::{
    job::{Job, Reason, Status},
    time::Time,
};

/// One line of a job's story; `seq` is dense from 1, across attempts and restarts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Event {
    /// Number of the event.
    pub seq: i64,
    /// The start it belongs to; 0 before the first.
    pub attempt: i32,
    /// When it happened.
    pub t: Time,
    /// What happened.
    #[serde(flatten)]
    pub payload: Payload,
}

/// What happened.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum Payload {
    /// The job changed its status, but is not at its end.
    Status {
        /// The new status.
        status: Status,
        /// Why it went back to the queue.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        reason: Option<String>,
    },
    /// A phase of the solution began.
    Stage {
        /// Which.
        stage: Phase,
    },
    /// One more row of history.
    Iteration(Iteration),
    /// Something to know.
    Warning(Warning),
    /// The end, and the job as it ended. There is exactly one of these.
    Done {
        /// The terminal job.
        job: Box<Job>,
    },
}

impl Payload {
    /// The word in `type`.
    pub fn kind(&self) -> &'static str {
        match self {
            Payload::Status { .. } => "status",
            Payload::Stage { .. } => "stage",
            Payload::Iteration(_) => "iteration",
            Payload::Warning(_) => "warning",
            Payload::Done { .. } => "done",
        }
    }

    /// A change of status.
    pub fn status(status: Status) -> Self {
        Payload::Status {
            status,
            reason: None,
        }
    }

    /// Back to the queue, and why.
    pub fn requeued(reason: Requeue) -> Self {
        Payload::Status {
            status: Status::Queued,
            reason: Some(reason.as_str().into()),
        }
    }
}

/// Why a running job goes back to the queue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Requeue {
    /// The process died under it.
    WorkerLost,
    /// The service was asked to stop.
    Drain,
}

impl Requeue {
    /// The word in the status event.
    pub fn as_str(self) -> &'static str {
        match self {
            Requeue::WorkerLost => Reason::WorkerLost.as_str(),
            Requeue::Drain => "drain",
        }
    }
}
