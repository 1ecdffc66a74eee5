//! What a job has found: summary, profiles, fields.

use std::sync::Arc;

use async_stream::try_stream;
use futures_util::Stream;
use serde::{Deserialize, Serialize};
use solver::solution::ContactProfile;

use super::{Service, jobs};
use crate::{
    error::ApiError,
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

/// The job, if it has ended with something to show.
pub(super) async fn finished(service: &Service, id: JobId) -> Result<Job, ApiError> {
    let job = jobs::get(service, id).await?;
    match (job.status.is_terminal(), job.result_available) {
        (false, _) => Err(ApiError::ResultNotReady(job.status.as_str())),
        (true, ResultAvailable::None) => Err(ApiError::NoResult(job.status.as_str())),
        (true, ResultAvailable::Partial | ResultAvailable::Final) => Ok(job),
    }
}
