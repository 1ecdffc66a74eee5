//! What a job has found: summary, profiles, fields.

use std::sync::Arc;

use async_stream::try_stream;
use futures_util::Stream;
use solver::solution::ContactProfile;

use super::{Service, jobs};
use crate::{
    error::ApiError,
    job::{Job, JobId, ResultAvailable},
    run::Summary,
    violations,
};

/// The summary of a job that has one.
pub async fn summary(service: &Service, id: JobId) -> Result<Summary, ApiError> {
    let job = finished(service, id).await?;
    let bytes = service.store.part(job.key, "summary").await?;
    let bytes = bytes.ok_or_else(|| ApiError::internal(format!("{id} has no summary")))?;
    serde_json::from_slice(&bytes).map_err(ApiError::internal)
}

/// The profile of one contact boundary.
pub async fn profile(
    service: &Service,
    id: JobId,
    boundary: &str,
) -> Result<ContactProfile, ApiError> {
    let job = finished(service, id).await?;
    let Some(bytes) = service.store.profile(job.key, boundary).await? else {
        let known = service.store.profiled_boundaries(job.key).await?.join(", ");
        return Err(ApiError::NotFound(format!(
            "{id} has no contact boundary {:?}; it has: {known}",
            violations::name(boundary)
        )));
    };
    serde_json::from_slice(&bytes).map_err(ApiError::internal)
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
async fn finished(service: &Service, id: JobId) -> Result<Job, ApiError> {
    let job = jobs::get(service, id).await?;
    match (job.status.is_terminal(), job.result_available) {
        (false, _) => Err(ApiError::ResultNotReady(job.status.as_str())),
        (true, ResultAvailable::None) => Err(ApiError::NoResult(job.status.as_str())),
        (true, ResultAvailable::Partial | ResultAvailable::Final) => Ok(job),
    }
}
