//! The iterations of a job, a row each.

use super::{jobs, service::Service};
use crate::{
    caller::Caller,
    error::ApiError,
    event::{Payload, TimedIteration},
    job::{JobId, ResultAvailable},
    parameters::{Parameter, Whole},
    store::Snapshot,
};

/// How many rows to give; the first and the last one are always among them.
pub const MAX_POINTS: Parameter<Whole> = Parameter {
    name: "max_points",
    meaning: "At most so many rows; the first and the last are kept",
    values: Whole(2..=i64::MAX),
};

/// The rows of the last start of a job, at most so many of them: those of its result, or as long as
/// there is none those of its events.
pub async fn history(
    service: &Service,
    caller: &Caller,
    id: JobId,
    max_points: Option<i64>,
) -> Result<Vec<TimedIteration>, ApiError> {
    let load = async {
        let mut found = jobs::snapshot(service, caller, id).await?;
        StoredHistory::load(service, &mut found).await
    };
    let mut rows = service.work_on(load, StoredHistory::read).await??;
    if let Some(most) = max_points {
        downsample(&mut rows, usize::try_from(most).unwrap_or(usize::MAX));
    }
    Ok(rows)
}

/// A history as it is stored.
pub(super) enum StoredHistory {
    /// With the result.
    Whole(Vec<u8>),
    /// Row by row, as events.
    Events(Vec<String>),
}

impl StoredHistory {
    pub(super) async fn load(
        service: &Service,
        found: &mut Snapshot,
    ) -> Result<StoredHistory, ApiError> {
        let job = &found.job;
        // of a job that runs there are more events than its finished load steps hold
        if job.status.is_terminal() && job.result_available != ResultAvailable::None {
            let whole = found.part("history").await?;
            if let Some(whole) = whole {
                return Ok(StoredHistory::Whole(whole));
            }
        }
        let job = &found.job;
        let lines = service.store.iterations(job.key, job.attempt).await?;
        Ok(StoredHistory::Events(lines))
    }

    pub(super) fn read(self) -> Result<Vec<TimedIteration>, ApiError> {
        let rows = match self {
            StoredHistory::Whole(bytes) => serde_json::from_slice(&bytes),
            StoredHistory::Events(lines) => lines.iter().map(|line| row(line)).collect(),
        };
        rows.map_err(ApiError::internal)
    }
}

fn row(line: &str) -> serde_json::Result<TimedIteration> {
    match serde_json::from_str(line)? {
        Payload::Iteration(row) => Ok(row),
        other => Err(serde::de::Error::custom(format!(
            "{} where an iteration belongs",
            other.kind()
        ))),
    }
}

/// Leaves at most `most` rows (2 or more), evenly spread, the first and the last among them.
fn downsample(rows: &mut Vec<TimedIteration>, most: usize) {
    let count = rows.len();
    if count <= most || most < 2 {
        return;
    }
    // the n-th row that stays; strictly rising, since most ≤ count
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
    use crate::fake;

    #[test]
    fn a_thinned_history_has_its_ends_and_never_more_rows_than_asked_for() {
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
    fn the_event_of_an_iteration_holds_the_row_itself() {
        let event = Payload::Iteration(fake::timed(3));
        let line = serde_json::to_string(&event).unwrap();
        assert_eq!(row(&line).unwrap(), fake::timed(3));
        assert!(row(r#"{"type":"stage","stage":"mesh"}"#).is_err());
    }
}
