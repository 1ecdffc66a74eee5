//! The events of a job, as its watchers receive them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use solver::solution::{Iteration, Phase, Warning};
use strum::IntoStaticStr;

use crate::{
    job::{Job, Status},
    time::Time,
};

/// One event of a job. `seq` counts from 1 without gaps, across attempts and restarts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Event {
    /// The number of the event.
    pub seq: i64,
    /// The attempt that the event belongs to; 0 before the first attempt.
    pub attempt: i32,
    /// The time of the event.
    pub t: Time,
    /// The content of the event.
    #[serde(flatten)]
    pub payload: Payload,
}

/// An [`Event`] as it is stored: its payload is JSON, which is passed on as it is.
#[derive(Clone, Debug, PartialEq)]
pub struct StoredEvent {
    /// The number of the event.
    pub seq: i64,
    /// The attempt that the event belongs to; 0 before the first attempt.
    pub attempt: i32,
    /// The time of the event.
    pub t: Time,
    /// The word for the kind of event, [`Payload::kind`].
    pub kind: String,
    /// The payload as a JSON object, which is not empty.
    pub payload: String,
}

impl StoredEvent {
    /// Whether this is the last event of its job.
    pub fn is_done(&self) -> bool {
        self.kind == "done"
    }

    /// The event as JSON, as an [`Event`] is written.
    pub fn json(&self) -> String {
        let StoredEvent {
            seq, attempt, t, ..
        } = self;
        let members = self.payload.strip_prefix('{').unwrap_or_default();
        format!(r#"{{"seq":{seq},"attempt":{attempt},"t":"{t}",{members}"#)
    }

    /// The event with its payload read; an error if the payload is none of this version.
    pub fn read(&self) -> serde_json::Result<Event> {
        Ok(Event {
            seq: self.seq,
            attempt: self.attempt,
            t: self.t,
            payload: serde_json::from_str(&self.payload)?,
        })
    }
}

/// The content of an event.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, IntoStaticStr)]
#[serde(tag = "type", rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum Payload {
    /// The status of the job has changed, but the job has not ended.
    Status {
        /// The new status.
        status: Status,
        /// The reason why the job was requeued.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        reason: Option<String>,
    },
    /// A phase of the solution has begun.
    Stage {
        /// The phase.
        stage: Phase,
    },
    /// Adaptive refinement has begun to solve on a mesh, or has returned to the mesh before. Iterations are reported
    /// once the mesh is known to be the last.
    Mesh {
        /// The number of the mesh, from 1.
        number: u32,
        /// The number of the mesh's elements.
        elements: u64,
        /// The largest relative error on the mesh before; absent for the first mesh, and where the error is unknown.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        error: Option<f64>,
    },
    /// An iteration.
    Iteration(TimedIteration),
    /// A warning about the problem or its solution.
    Warning(Warning),
    /// The job has ended. A job has exactly one `done` event, which is its last.
    Done {
        /// The job in its final state.
        job: Box<Job>,
    },
}

/// A row of the history, and the time at which it was computed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "Iteration")]
pub struct TimedIteration {
    /// The row.
    #[serde(flatten)]
    pub row: Iteration,
    /// Seconds from the start of the solver to the end of this iteration.
    pub wall_s: f64,
}

/// A row of the history of a job, with the number of its event.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct HistoryRow {
    /// The number of the row's event, after which a stream of events goes on; absent once the job has ended with a result.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seq: Option<i64>,
    /// The row.
    #[serde(flatten)]
    pub timed: TimedIteration,
}

impl From<TimedIteration> for HistoryRow {
    /// The row of a result.
    fn from(timed: TimedIteration) -> Self {
        HistoryRow { seq: None, timed }
    }
}

impl Payload {
    /// The word for the kind of event: the value of `type` in JSON.
    pub fn kind(&self) -> &'static str {
        self.into()
    }

    /// The event of a change of status.
    pub fn status(status: Status) -> Self {
        Payload::Status {
            status,
            reason: None,
        }
    }

    /// The event that a job was requeued, for this reason.
    pub fn requeued(reason: Requeue) -> Self {
        Payload::Status {
            status: Status::Queued,
            reason: Some(<&str>::from(reason).into()),
        }
    }
}

/// Why a running job is requeued.
#[derive(Clone, Copy, Debug, PartialEq, Eq, IntoStaticStr)]
#[strum(serialize_all = "snake_case")]
pub enum Requeue {
    /// The process that ran the job died.
    WorkerLost,
    /// The service stopped.
    Drain,
}

#[cfg(test)]
mod tests {
    use super::*;
    use solver::solution::WarningCode;

    #[test]
    fn the_kind_of_an_event_is_its_type_in_json_and_a_stored_event_is_written_alike() {
        for payload in [
            Payload::status(Status::Running),
            Payload::requeued(Requeue::Drain),
            Payload::Stage {
                stage: Phase::Factor,
            },
            Payload::Mesh {
                number: 2,
                elements: 1200,
                error: Some(0.04),
            },
            Payload::Iteration(TimedIteration {
                row: fake::iteration(1),
                wall_s: 0.5,
            }),
            Payload::Warning(Warning {
                code: WarningCode::KinkInContact,
                pointer: "/contacts/0".to_owned(),
                message: "a \"kink\" {at} ρ\n".to_owned(),
            }),
        ] {
            let json = serde_json::to_value(&payload).unwrap_or_default();
            assert_eq!(json["type"], payload.kind());
            let event = Event {
                seq: 7,
                attempt: 2,
                t: Time::from_micros(1_700_000_000_000_001),
                payload,
            };
            let stored = StoredEvent {
                seq: 7,
                attempt: 2,
                t: event.t,
                kind: event.payload.kind().to_owned(),
                payload: serde_json::to_string(&event.payload).unwrap_or_default(),
            };
            assert_eq!(
                stored.json(),
                serde_json::to_string(&event).unwrap_or_default()
            );
            assert_eq!(stored.read().ok(), Some(event));
        }
    }

    #[test]
    fn a_lost_worker_has_the_same_name_as_event_and_as_failure() {
        let (lost, failed) = (Requeue::WorkerLost, crate::job::Reason::WorkerLost);
        assert_eq!(<&str>::from(lost), <&str>::from(failed));
    }
}
