//! The operation that returns the iterations of a job, one row for each.

use std::sync::Arc;

use base::{
    caller::Caller,
    event::{HistoryRow, Payload, TimedIteration},
    job::{JobId, ResultAvailable},
    values::Integers,
};
use futures_util::future::BoxFuture;
use store::{Snapshot, spread};

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
    let most = max_points.map(|most| usize::try_from(most).unwrap_or(usize::MAX));
    let load = async {
        let mut found = jobs::snapshot(service, caller, id).await?;
        is_wanted(&found.job, partial)?;
        let available = found.job.result_available;
        let content = StoredHistory::load(&mut found, most).await?;
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
    service.work_on(load, read).await?
}

/// The rows of a history in their stored form.
pub(super) enum StoredHistory {
    /// A history that is stored with the result, and how many of its rows are wanted.
    Whole(Vec<u8>, Option<usize>),
    /// Rows that are stored one by one, as events, each with its number.
    Events(Vec<(i64, String)>),
}

impl StoredHistory {
    /// At most `most` rows, evenly distributed, including the first and the last.
    pub(super) async fn load(
        found: &mut Snapshot,
        most: Option<usize>,
    ) -> Result<StoredHistory, ApiError> {
        let job = &found.job;
        // a partial result ends with the last finished load step; the events go on
        if job.status.is_terminal() && job.result_available == ResultAvailable::Final {
            let whole = found.part("history").await?;
            if let Some(whole) = whole {
                return Ok(StoredHistory::Whole(whole, most));
            }
        }
        Ok(StoredHistory::Events(found.iterations(most).await?))
    }

    pub(super) fn read(self) -> Result<Vec<HistoryRow>, ApiError> {
        let rows = match self {
            StoredHistory::Whole(bytes, most) => {
                serde_json::from_slice(&bytes).map(|rows: Vec<TimedIteration>| {
                    let mut kept = spread(rows.len(), most).peekable();
                    let rows = rows.into_iter().enumerate();
                    rows.filter(|(place, _)| kept.next_if_eq(place).is_some())
                        .map(|(_, row)| row.into())
                        .collect()
                })
            }
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

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn the_event_of_an_iteration_contains_its_row() {
        let event = Payload::Iteration(fake::timed(3));
        let line = serde_json::to_string(&event).unwrap();
        assert_eq!(row(&line).unwrap(), fake::timed(3));
        assert!(row(r#"{"type":"stage","stage":"mesh"}"#).is_err());
    }
}
