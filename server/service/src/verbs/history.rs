//! The operation that returns the iterations of a job, one row for each.

use std::sync::Arc;

use base::{
    caller::Caller,
    event::{HistoryRow, Payload, TimedIteration},
    job::{JobId, ResultAvailable},
    values::Integers,
};
use futures_util::future::BoxFuture;
use store::Snapshot;

use super::{
    jobs,
    results::{Found, is_wanted, room_for},
    service::{Service, detached},
};
use crate::{error::ApiError, parameters::Parameter};

/// The maximum number of rows; the first and the last one are always included.
pub const MAX_POINTS: Parameter<Integers> = Parameter {
    name: "max_points",
    meaning: "Maximum number of rows; the first and the last are included",
    values: Integers(2..=i64::MAX),
};

/// Returns the iterations of the last attempt of a job, reduced to a maximum number of rows. They are read from the
/// result or, while there is none, from the job's events. `partial`: whether those of a job without a solution will do.
pub fn history<'a>(
    service: &'a Arc<Service>,
    caller: &'a Caller,
    id: JobId,
    max_points: Option<i64>,
    partial: bool,
) -> BoxFuture<'a, Result<Found<Vec<HistoryRow>>, ApiError>> {
    Box::pin(async move {
        let (service, caller) = (service.clone(), caller.clone());
        // what is read goes on if the client does not wait, and its memory counts until then
        detached(async move { read_history(&service, &caller, id, max_points, partial).await })
            .await
    })
}

async fn read_history(
    service: &Service,
    caller: &Caller,
    id: JobId,
    max_points: Option<i64>,
    partial: bool,
) -> Result<Found<Vec<HistoryRow>>, ApiError> {
    let share = room_for(service, caller, id, &["history"]).await?;
    let load = async {
        let mut found = jobs::snapshot(service, caller, id).await?;
        is_wanted(&found.job, partial)?;
        let available = found.job.result_available;
        let content = StoredHistory::load(&mut found).await?;
        Ok(Found {
            available,
            content,
            share,
        })
    };
    let read = |found: Found<StoredHistory>| {
        let Found {
            available,
            content,
            share,
        } = found;
        let content = content.read()?;
        Ok::<_, ApiError>(Found {
            available,
            content,
            share,
        })
    };
    let mut rows = service.work_on(load, read).await??;
    if let Some(most) = max_points {
        downsample(
            &mut rows.content,
            usize::try_from(most).unwrap_or(usize::MAX),
        );
    }
    Ok(rows)
}

/// The rows of a history in their stored form.
pub(super) enum StoredHistory {
    /// A history that is stored with the result.
    Whole(Vec<u8>),
    /// Rows that are stored one by one, as events, each with its number.
    Events(Vec<(i64, String)>),
}

impl StoredHistory {
    pub(super) async fn load(found: &mut Snapshot) -> Result<StoredHistory, ApiError> {
        let job = &found.job;
        // a partial result ends with the last finished load step; the events go on
        if job.status.is_terminal() && job.result_available == ResultAvailable::Final {
            let whole = found.part("history").await?;
            if let Some(whole) = whole {
                return Ok(StoredHistory::Whole(whole));
            }
        }
        Ok(StoredHistory::Events(found.iterations().await?))
    }

    pub(super) fn read(self) -> Result<Vec<HistoryRow>, ApiError> {
        let rows = match self {
            StoredHistory::Whole(bytes) => serde_json::from_slice(&bytes)
                .map(|rows: Vec<TimedIteration>| rows.into_iter().map(Into::into).collect()),
            StoredHistory::Events(lines) => {
                let numbered = |(seq, line): &(i64, String)| {
                    let timed = row(line)?;
                    let seq = Some(*seq);
                    Ok(HistoryRow { seq, timed })
                };
                lines.iter().map(numbered).collect()
            }
        };
        rows.map_err(ApiError::internal)
    }
}

fn row(line: &str) -> serde_json::Result<TimedIteration> {
    match serde_json::from_str(line)? {
        Payload::Iteration(row) => Ok(row),
        other => Err(serde::de::Error::custom(format!(
            "{} in place of an iteration",
            other.kind()
        ))),
    }
}

/// Keeps at most `most` rows (`most` is 2 or more), evenly distributed, including the first and the last.
fn downsample<T>(rows: &mut Vec<T>, most: usize) {
    let count = rows.len();
    if count <= most || most < 2 {
        return;
    }
    // the n-th row that is kept; strictly increasing, since most ≤ count
    let kept = |n: usize| (n * (count - 1) + (most - 1) / 2) / (most - 1);
    let (mut place, mut next) = (0, 0);
    rows.retain(|_| {
        let keep = place == kept(next);
        place += 1;
        next += usize::from(keep);
        keep
    });
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_reduced_history_has_its_ends_and_at_most_the_requested_number_of_rows() {
        for count in 0..40 {
            for most in 2..45 {
                let all: Vec<u32> = (1..=count).collect();
                let mut rows: Vec<_> = all.iter().map(|k| fake::timed(*k)).collect();
                downsample(&mut rows, most);
                let kept: Vec<u32> = rows.iter().map(|timed| timed.row.k).collect();
                assert_eq!(kept.len(), most.min(all.len()), "{count} {most}");
                assert_eq!((kept.first(), kept.last()), (all.first(), all.last()));
                assert!(kept.is_sorted());
            }
        }
    }

    #[test]
    fn the_event_of_an_iteration_contains_its_row() {
        let event = Payload::Iteration(fake::timed(3));
        let line = serde_json::to_string(&event).unwrap();
        assert_eq!(row(&line).unwrap(), fake::timed(3));
        assert!(row(r#"{"type":"stage","stage":"mesh"}"#).is_err());
    }
}
