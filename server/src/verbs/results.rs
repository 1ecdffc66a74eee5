//! What a job has found: summary, history, profiles, fields.

use std::sync::Arc;

use async_stream::try_stream;
use futures_util::Stream;
use serde::{Deserialize, Serialize};
use solver::solution::{ContactProfile, Iteration};

use super::{Service, jobs};
use crate::{
    error::ApiError,
    event::Payload,
    job::{Job, JobId, ResultAvailable},
    run::Summary,
    violations,
};

/// What is said of one load step.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct StepResult {
    /// Its name in the problem, or its number from 1.
    pub name: String,
    /// Its end.
    pub summary: solver::solution::Summary,
}

/// The summary of a job that has one, and those of its load steps.
pub async fn summary(service: &Service, id: JobId) -> Result<(Summary, Vec<StepResult>), ApiError> {
    let job = finished(service, id).await?;
    let bytes = service.store.part(job.key, "summary").await?;
    let bytes = bytes.ok_or_else(|| ApiError::internal(format!("{id} has no summary")))?;
    let summary = serde_json::from_slice(&bytes).map_err(ApiError::internal)?;
    Ok((summary, steps(service, &job).await?))
}

async fn steps(service: &Service, job: &Job) -> Result<Vec<StepResult>, ApiError> {
    let bytes = service.store.part(job.key, "steps").await?;
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
    let job = jobs::get(service, id).await?;
    let store = &service.store;
    let load = async {
        let stored = match job.result_available {
            ResultAvailable::None => None,
            ResultAvailable::Partial | ResultAvailable::Final => {
                store.part(job.key, "history").await?
            }
        };
        let told = match stored {
            Some(_) => vec![],
            None => store.iterations(job.key, job.attempt).await?,
        };
        Ok((stored, told))
    };
    let rows = service.work_on(load, |(stored, told)| match stored {
        Some(bytes) => serde_json::from_slice(&bytes),
        None => told.iter().map(|line| row(line)).collect(),
    });
    let mut rows: Vec<Iteration> = rows.await?.map_err(ApiError::internal)?;
    if let Some(most) = max_points {
        thin(&mut rows, most);
    }
    Ok(rows)
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

/// The profile of one contact boundary: at the end, or at the end of a load step, by its name or its
/// number from 0.
pub async fn profile(
    service: &Service,
    id: JobId,
    boundary: &str,
    step: Option<&str>,
) -> Result<ContactProfile, ApiError> {
    let job = finished(service, id).await?;
    let step = match step {
        None => None,
        Some(wanted) => Some(step_number(&steps(service, &job).await?, wanted, id)?),
    };
    let Some(bytes) = service.store.profile(job.key, boundary, step).await? else {
        let known = service.store.profiled_boundaries(job.key).await?.join(", ");
        return Err(ApiError::NotFound(format!(
            "{id} has no contact boundary {:?}; it has: {known}",
            violations::name(boundary)
        )));
    };
    serde_json::from_slice(&bytes).map_err(ApiError::internal)
}

fn step_number(steps: &[StepResult], wanted: &str, id: JobId) -> Result<usize, ApiError> {
    let named = steps.iter().position(|step| step.name == wanted);
    let numbered = wanted.parse().ok().filter(|n| *n < steps.len());
    named.or(numbered).ok_or_else(|| {
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

/// The fields at all nodes as JSON, piece by piece: they may be large.
pub async fn fields(
    service: &Arc<Service>,
    id: JobId,
) -> Result<impl Stream<Item = Result<Vec<u8>, ApiError>> + Send + use<>, ApiError> {
    let job = finished(service, id).await?;
    let Some(first) = service.store.piece(job.key, "fields", 0).await? else {
        // A canceled job keeps its history and profiles, but no fields.
        return Err(ApiError::NoResult(job.status.as_str()));
    };
    let service = service.clone();
    Ok(try_stream! {
        yield first;
        for piece in 1.. {
            match service.store.piece(job.key, "fields", piece).await? {
                Some(bytes) => yield bytes,
                None => return,
            }
        }
    })
}

/// The same at once, for who writes them in another format.
pub async fn whole_fields(service: &Service, id: JobId) -> Result<Vec<u8>, ApiError> {
    let job = finished(service, id).await?;
    let fields = service.store.part(job.key, "fields").await?;
    fields.ok_or(ApiError::NoResult(job.status.as_str()))
}

/// The job, if it has ended with something to show.
async fn finished(service: &Service, id: JobId) -> Result<Job, ApiError> {
    let job = jobs::get(service, id).await?;
    match (job.status.is_terminal(), job.result_available) {
        (false, _) => Err(ApiError::ResultNotReady(job.status.as_str())),
        (true, ResultAvailable::None) => Err(ApiError::NoResult(job.status.as_str())),
        (true, ResultAvailable::Partial | ResultAvailable::Final) => Ok(job),
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
