//! Mesh, displacements and stresses: as JSON in pieces, or in another format.

use std::sync::Arc;

use async_stream::try_stream;
use files::fields_json::FieldsJson;
use futures_util::Stream;

use super::{
    loaded::{Loaded, Shared},
    results::{Found, no_result, with_result},
    service::{Service, detached},
};
use crate::{
    caller::Caller,
    error::ApiError,
    formats::{self, Format},
    job::{Job, JobId},
    store::PartInfo,
};

/// The fields of a job: JSON of known length and fingerprint, in pieces.
#[derive(Debug)]
pub struct StoredFields {
    /// Length and fingerprint.
    pub info: PartInfo,
    id: JobId,
    result_key: i64,
    /// If they had to be read to know that they are intact.
    loaded: Option<Arc<Loaded>>,
}

/// The fields at all nodes as JSON.
pub async fn fields(
    service: &Service,
    caller: &Caller,
    id: JobId,
) -> Result<Found<StoredFields>, ApiError> {
    let found = with_result(service, caller, id).await?;
    let job = found.job.clone();
    drop(found);
    let result_key = job.result_key;
    are_kept(service, &job).await?;
    let (info, loaded) = match service.store.fields_info(result_key).await? {
        Some(info) => (info, None),
        None => {
            let loaded = load(service, result_key).await?;
            let loaded = loaded.ok_or_else(|| no_result(&job))?;
            (loaded.info.clone(), Some(loaded))
        }
    };
    let content = StoredFields {
        info,
        id,
        result_key,
        loaded,
    };
    Ok(Found {
        available: job.result_available,
        content,
    })
}

/// An error if the fields of a job that has ended were deleted.
pub(super) async fn are_kept(service: &Service, job: &Job) -> Result<(), ApiError> {
    let lost = job.status.is_terminal() && service.store.lost_fields(job.key).await?;
    match lost {
        true => Err(ApiError::FieldsDeleted(job.id)),
        false => Ok(()),
    }
}

/// Fields in memory, once there is room for them; `None` if there are none.
async fn load(service: &Service, key: i64) -> Result<Option<Arc<Loaded>>, ApiError> {
    if let Some(loaded) = service.fields_in_memory.find(key) {
        return Ok(Some(loaded));
    }
    let Some(bytes) = service.store.fields_memory(key).await? else {
        return Ok(None);
    };
    let share = service.sent.wait_for(bytes).await?;
    if let Some(loaded) = service.fields_in_memory.find(key) {
        return Ok(Some(loaded)); // read by another meanwhile
    }
    let Some((info, fields)) = service.store.fields(key).await? else {
        return Ok(None);
    };
    let loaded = Arc::new(Loaded {
        info,
        fields,
        _share: share,
    });
    service.fields_in_memory.insert(key, &loaded);
    Ok(Some(loaded))
}

impl StoredFields {
    /// The bytes from `start` to before `end`, in pieces, since there may be many. What comes before is written and left out:
    /// a millisecond for each megabyte.
    pub fn bytes(
        &self,
        service: &Arc<Service>,
        start: u64,
        end: u64,
    ) -> impl Stream<Item = Result<Vec<u8>, ApiError>> + Send + use<> {
        let (service, id, key) = (service.clone(), self.id, self.result_key);
        let loaded = self.loaded.clone();
        try_stream! {
            let loaded = match loaded {
                Some(loaded) => loaded,
                None => {
                    // in a task of its own: a client that does not read may stop this stream at any point
                    let load = detached(async move { load(&service, key).await });
                    load.await?.ok_or(ApiError::Deleted(id))?
                }
            };
            let (mut json, mut place) = (FieldsJson::new(Shared(loaded)), 0);
            while place < end {
                let next = move || (json.piece(), json);
                let (piece, rest) = tokio::task::spawn_blocking(next).await.map_err(ApiError::internal)?;
                json = rest;
                let Some(mut piece) = piece.map_err(ApiError::internal)? else { break };
                let first = place;
                place += piece.len() as u64;
                if place > start {
                    piece.truncate(end.saturating_sub(first).min(piece.len() as u64) as usize);
                    yield piece.split_off(start.saturating_sub(first) as usize);
                }
            }
        }
    }
}

/// The fields in another format, in memory.
pub async fn converted_fields(
    service: &Service,
    caller: &Caller,
    id: JobId,
    format: Format,
) -> Result<Found<Vec<u8>>, ApiError> {
    let read = async {
        let found = with_result(service, caller, id).await?;
        let job = found.job.clone();
        drop(found);
        are_kept(service, &job).await?;
        let loaded = load(service, job.result_key).await?;
        let content = loaded.ok_or_else(|| no_result(&job))?;
        Ok(Found {
            available: job.result_available,
            content,
        })
    };
    let written = service.work_on(read, move |found| {
        let content = formats::fields(&found.content.fields, format)?;
        Ok::<_, String>(Found {
            available: found.available,
            content,
        })
    });
    written.await?.map_err(ApiError::internal)
}
