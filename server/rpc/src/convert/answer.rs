//! Converts parts of answers whose shape differs from the shape of their messages: points in time, names, words,
//! events, and what the service adds to a summary.

use std::collections::BTreeSet;

use base::{
    caller::Scope,
    event::{Event, HistoryRow, Payload, TimedIteration},
    id::{Id, Kind},
    job::{Reason, Waiting},
    run::Summary,
    sweep::{SweepEvent, SweepPayload},
    time::Time,
};
use prost_types::Timestamp;
use solver::solution::{Phase, Stage, WarningCode};

use super::IntoMessage;
use crate::pb;

impl IntoMessage<Timestamp> for Time {
    fn into_message(self) -> Timestamp {
        let (seconds, micros) = (
            self.micros().div_euclid(1_000_000),
            self.micros().rem_euclid(1_000_000),
        );
        Timestamp {
            seconds,
            nanos: micros as i32 * 1000,
        }
    }
}

impl IntoMessage<Option<Timestamp>> for Time {
    fn into_message(self) -> Option<Timestamp> {
        Some(self.into_message())
    }
}

impl<K: Kind> IntoMessage<String> for Id<K> {
    fn into_message(self) -> String {
        self.to_string()
    }
}

/// Implements the conversion to a text for enums that are texts both in JSON and in messages.
macro_rules! words {
    ($($type:ty),*) => {
        $(impl IntoMessage<String> for $type {
            fn into_message(self) -> String {
                <&str>::from(self).to_owned()
            }
        })*
    };
}

words!(
    solver::error::Reason,
    Phase,
    Reason,
    Stage,
    Waiting,
    WarningCode
);

impl IntoMessage<Vec<String>> for BTreeSet<Scope> {
    fn into_message(self) -> Vec<String> {
        let scopes = self.into_iter().map(<&str>::from);
        scopes.map(str::to_owned).collect()
    }
}

impl From<Event> for pb::Event {
    fn from(event: Event) -> Self {
        use pb::event::Payload as Out;
        let Event {
            seq,
            attempt,
            t,
            payload,
        } = event;
        let payload = match payload {
            Payload::Status { status, reason } => Out::Status(pb::StatusEvent {
                status: status.into_message(),
                reason,
            }),
            Payload::Stage { stage } => Out::Stage(pb::StageEvent {
                stage: stage.into_message(),
            }),
            Payload::Mesh {
                number,
                elements,
                error,
            } => Out::Mesh(pb::MeshEvent {
                number,
                elements,
                error,
            }),
            Payload::Iteration(row) => Out::Iteration(row.into()),
            Payload::Warning(warning) => Out::Warning(warning.into()),
            Payload::Done { job } => Out::Done(pb::DoneEvent {
                job: job.into_message(),
            }),
        };
        pb::Event {
            seq,
            attempt,
            t: t.into_message(),
            payload: Some(payload),
        }
    }
}

/// Converts the value of a parameter of any type to its JSON.
impl IntoMessage<String> for base::sweep::ParameterValue {
    fn into_message(self) -> String {
        self.json().to_owned()
    }
}

impl From<SweepEvent> for pb::SweepEvent {
    fn from(event: SweepEvent) -> Self {
        use pb::sweep_event::Payload as Out;
        let SweepEvent { seq, t, payload } = event;
        let payload = match payload {
            SweepPayload::Member { member } => Out::Member((*member).into()),
            SweepPayload::Done { sweep } => Out::Done((*sweep).into()),
        };
        pb::SweepEvent {
            seq,
            t: t.into_message(),
            payload: Some(payload),
        }
    }
}

impl From<TimedIteration> for pb::Iteration {
    fn from(TimedIteration { row, wall_s }: TimedIteration) -> Self {
        pb::Iteration {
            wall_s,
            ..row.into()
        }
    }
}

impl From<HistoryRow> for pb::Iteration {
    fn from(HistoryRow { seq, timed }: HistoryRow) -> Self {
        pb::Iteration {
            seq,
            ..timed.into()
        }
    }
}

impl From<Summary> for pb::Summary {
    fn from(ours: Summary) -> Self {
        let Summary {
            solution,
            timings,
            body_reused,
            solver_version,
            input_hash,
            digest,
        } = ours;
        pb::Summary {
            timings,
            body_reused: Some(body_reused),
            solver_version,
            input_hash,
            digest,
            ..solution.into()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_before_1970_keeps_its_nanoseconds_positive() {
        let stamp: Timestamp = Time::from_micros(-1).into_message();
        assert_eq!((stamp.seconds, stamp.nanos), (-1, 999_999_000));
    }
}
