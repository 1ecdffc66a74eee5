//! What a job has found: summary, history, profiles, fields.

use std::sync::Arc;

use async_stream::try_stream;
use futures_util::Stream;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use solver::solution::{ContactProfile, Fields, Iteration};

use super::{Service, jobs};
use crate::{
    error::ApiError,
    event::Payload,
    formats::{self, Format},
    job::{Job, JobId, ResultAvailable},
    run::Summary,
    store::{PIECE_BYTES, PartInfo, ProfilePoints, Snapshot},
    violations,
};

/// What is said of one load step.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct StepResult {
    /// Its name in the problem, or its number from 0.
    pub name: String,
    /// Its end.
    pub summary: solver::solution::Summary,
}

/// The scalars of a result, whole and by load step.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(rename = "Result")]
pub struct JobResult {
    /// As of the job: `partial` where it has not come to its end, or to none that can be trusted. The summary
    /// may say that the last finished load step has converged; the others are missing all the same.
    pub result_available: ResultAvailable,
    /// That of the last load step that is done.
    pub summary: Summary,
    /// Those that are done.
    pub steps: Vec<StepResult>,
}

/// The scalars of a job that has some.
pub async fn result(service: &Service, id: JobId) -> Result<JobResult, ApiError> {
    let load = async {
        let mut found = with_result(service, id).await?;
        let summary = found.part("summary").await?;
        let summary = summary.ok_or_else(|| ApiError::internal(format!("{id} has no summary")))?;
        let steps = found.part("steps").await?;
        Ok((found.job.result_available, summary, steps))
    };
    let read = |(result_available, summary, steps): (_, Vec<u8>, Option<Vec<u8>>)| {
        let steps = steps.map_or(Ok(vec![]), |steps| serde_json::from_slice(&steps));
        Ok(JobResult {
            result_available,
            summary: serde_json::from_slice(&summary).map_err(ApiError::internal)?,
            steps: steps.map_err(ApiError::internal)?,
        })
    };
    service.work_on(load, read).await?
}

async fn steps(found: &mut Snapshot) -> Result<Vec<StepResult>, ApiError> {
    let bytes = found.part("steps").await?;
    bytes.map_or(Ok(vec![]), |bytes| {
        serde_json::from_slice(&bytes).map_err(ApiError::internal)
    })
}

/// The rows of the last start of a job, at most so many of them: those of its result, or as long as
/// there is none those that its watchers were told.
pub async fn history(
    service: &Service,
    id: JobId,
    max_points: Option<usize>,
) -> Result<Vec<Iteration>, ApiError> {
    let load = async {
        let mut found = jobs::snapshot(service, id).await?;
        StoredHistory::load(service, &mut found).await
    };
    let mut rows = service.work_on(load, StoredHistory::read).await??;
    if let Some(most) = max_points {
        thin(&mut rows, most);
    }
    Ok(rows)
}

/// A history as it is stored.
pub(super) enum StoredHistory {
    /// With the result.
    Whole(Vec<u8>),
    /// Row by row, as it was told.
    Told(Vec<String>),
}

impl StoredHistory {
    pub(super) async fn load(
        service: &Service,
        found: &mut Snapshot,
    ) -> Result<StoredHistory, ApiError> {
        let job = &found.job;
        // of a job that runs, its watchers were told more than its finished load steps hold
        if job.status.is_terminal() && job.result_available != ResultAvailable::None {
            let whole = found.part("history").await?;
            if let Some(whole) = whole {
                return Ok(StoredHistory::Whole(whole));
            }
        }
        let job = &found.job;
        let told = service.store.iterations(job.key, job.attempt).await?;
        Ok(StoredHistory::Told(told))
    }

    pub(super) fn read(self) -> Result<Vec<Iteration>, ApiError> {
        let rows = match self {
            StoredHistory::Whole(bytes) => serde_json::from_slice(&bytes),
            StoredHistory::Told(lines) => lines.iter().map(|line| row(line)).collect(),
        };
        rows.map_err(ApiError::internal)
    }
}

fn row(line: &str) -> serde_json::Result<Iteration> {
    match serde_json::from_str(line)? {
        Payload::Iteration(row) => Ok(row),
        other => Err(serde::de::Error::custom(format!(
            "{} where an iteration belongs",
            other.kind()
        ))),
    }
}

/// Leaves at most `most` rows (2 or more), evenly spread, the first and the last among them.
fn thin(rows: &mut Vec<Iteration>, most: usize) {
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

/// Where a profile has its values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Points {
    /// At the nodes of the boundary.
    Nodes,
    /// Where friction acts, which is what forces and peaks are made of.
    Friction,
    /// At so many places, equally spaced in arc length, the ends among them.
    Spaced(usize),
}

impl Points {
    /// What can be said.
    pub const EXPECTED: &str = "nodes, friction, or a whole number from 2 to 100000";

    /// Reads `nodes`, `friction` or a number.
    pub fn parse(text: &str) -> Option<Points> {
        match text {
            "nodes" => Some(Points::Nodes),
            "friction" => Some(Points::Friction),
            _ => {
                let count = text.parse().ok().filter(|n| (2..=100_000).contains(n));
                count.map(Points::Spaced)
            }
        }
    }
}

/// The profile of one contact boundary: at the end, or at the end of a load step, by its name or its
/// number from 0.
pub async fn profile(
    service: &Service,
    id: JobId,
    boundary: &str,
    step: Option<&str>,
    points: Points,
) -> Result<ContactProfile, ApiError> {
    let mut found = with_result(service, id).await?;
    let step = match step {
        None => None,
        Some(wanted) => Some(step_number(&steps(&mut found).await?, wanted, id)?),
    };
    let (here, friction) = match points {
        Points::Nodes => (ProfilePoints::Nodes, false),
        Points::Friction => (ProfilePoints::Friction, false),
        Points::Spaced(_) => (ProfilePoints::Nodes, true),
    };
    let nodes = found.profile(boundary, here, step).await?;
    let friction = match friction {
        true => {
            found
                .profile(boundary, ProfilePoints::Friction, step)
                .await?
        }
        false => None,
    };
    let Some(bytes) = nodes else {
        let known = found.profiled_boundaries().await?;
        if known.iter().any(|name| name == boundary) {
            return Err(ApiError::NotFound(format!(
                "{id} was solved before profiles at friction points were kept; try points=nodes"
            )));
        }
        return Err(ApiError::NotFound(format!(
            "{id} has no contact boundary {:?}; it has: {}",
            violations::name(boundary),
            known.join(", ")
        )));
    };
    drop(found);
    let read = |bytes: &[u8]| serde_json::from_slice(bytes).map_err(ApiError::internal);
    let Points::Spaced(count) = points else {
        return read(&bytes);
    };
    let sampling = service.work(move || {
        let nodes = read(&bytes)?;
        let friction = friction.map_or(Ok(ContactProfile::default()), |bytes| read(&bytes))?;
        Ok(solver::solution::sample(&nodes, &friction, count))
    });
    sampling.await?
}

fn step_number(steps: &[StepResult], wanted: &str, id: JobId) -> Result<usize, ApiError> {
    let named = steps.iter().position(|step| step.name == wanted);
    let numbered = wanted.parse().ok().filter(|n| *n < steps.len());
    named.or(numbered).ok_or_else(|| {
        if steps.is_empty() {
            return ApiError::NotFound(format!("{id} has no load steps; leave `step` out"));
        }
        let names: Vec<_> = steps
            .iter()
            .take(20)
            .map(|step| step.name.as_str())
            .collect();
        ApiError::NotFound(format!(
            "{id} has no load step {:?}; it has {} (by name, or by number from 0): {}",
            violations::name(wanted),
            steps.len(),
            names.join(", ")
        ))
    })
}

/// The fields of a job as they are stored: JSON, of known length and fingerprint, in pieces.
#[derive(Debug)]
pub struct StoredFields {
    /// Length and fingerprint.
    pub info: PartInfo,
    result_key: i64,
}

/// The fields at all nodes as they are stored.
pub async fn fields(service: &Service, id: JobId) -> Result<StoredFields, ApiError> {
    let mut found = with_result(service, id).await?;
    let result_key = found.job.result_key;
    match found.part_info("fields").await? {
        Some(info) => Ok(StoredFields { info, result_key }),
        None => Err(nothing_of(&found.job)),
    }
}

/// There is nothing to show: not yet, or not any more. A job that was canceled, or still runs, has history and
/// profiles, but no fields.
pub(super) fn nothing_of(job: &Job) -> ApiError {
    match job.status.is_terminal() {
        true => ApiError::NoResult(job.status.as_str()),
        false => ApiError::ResultNotReady(job.status.as_str()),
    }
}

impl StoredFields {
    /// The bytes from `start` to before `end`, piece by piece: they may be many.
    pub fn bytes(
        &self,
        service: &Arc<Service>,
        start: u64,
        end: u64,
    ) -> impl Stream<Item = Result<Vec<u8>, ApiError>> + Send + use<> {
        let (service, key) = (service.clone(), self.result_key);
        const PIECE: u64 = PIECE_BYTES as u64;
        try_stream! {
            for piece in start / PIECE..end.div_ceil(PIECE) {
                let found = service.store.piece(key, "fields", piece as i64).await?;
                let mut bytes = found.ok_or_else(|| ApiError::internal("a piece of a result is missing"))?;
                let first = piece * PIECE;
                bytes.truncate(end.saturating_sub(first) as usize);
                let skipped = start.saturating_sub(first) as usize;
                yield bytes.split_off(skipped.min(bytes.len()));
            }
        }
    }
}

/// The same in another format, at once.
pub async fn converted_fields(
    service: &Service,
    id: JobId,
    format: Format,
) -> Result<Vec<u8>, ApiError> {
    let load = async {
        let mut found = with_result(service, id).await?;
        let fields = found.part("fields").await?;
        fields.ok_or_else(|| nothing_of(&found.job))
    };
    let written = service.work_on(load, move |stored| {
        let fields: Fields = serde_json::from_slice(&stored).map_err(|error| error.to_string())?;
        drop(stored); // they may be large
        formats::fields(&fields, format)
    });
    written.await?.map_err(ApiError::internal)
}

/// The job, if it has something to show: at its end, or of finished load steps while it runs.
pub(super) async fn with_result(service: &Service, id: JobId) -> Result<Snapshot, ApiError> {
    let found = jobs::snapshot(service, id).await?;
    match found.job.result_available {
        ResultAvailable::Partial | ResultAvailable::Final => Ok(found),
        ResultAvailable::None => Err(nothing_of(&found.job)),
    }
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
                let mut rows: Vec<_> = all.iter().map(|k| fake::iteration(*k)).collect();
                thin(&mut rows, most);
                let kept: Vec<u32> = rows.iter().map(|row| row.k).collect();
                assert_eq!(kept.len(), most.min(all.len()), "{count} {most}");
                assert_eq!((kept.first(), kept.last()), (all.first(), all.last()));
                assert!(kept.is_sorted());
            }
        }
    }

    #[test]
    fn a_told_iteration_is_the_row_itself() {
        let told = Payload::Iteration(fake::iteration(3));
        let line = serde_json::to_string(&told).unwrap();
        assert_eq!(row(&line).unwrap(), fake::iteration(3));
        assert!(row(r#"{"type":"stage","stage":"mesh"}"#).is_err());
    }
}
