//! Operations that return mesh, displacements and stresses, as JSON in pieces or in another format.

use std::{fmt::Display, sync::Arc};

use async_stream::try_stream;
use base::{
    caller::Caller,
    job::{Job, JobId},
};
use files::fields_json::FieldsJson;
use futures_util::Stream;
use futures_util::future::BoxFuture;
use store::PartInfo;

use super::{
    fields_in_memory::{LoadedFields, Shared},
    results::{Found, is_wanted, no_result, with_result},
    service::{Service, detached},
};
use crate::{
    error::ApiError,
    formats::{self, Format},
};

/// The fields of a job as JSON of known length and fingerprint, which is made in pieces.
#[derive(Debug)]
pub struct StoredFields {
    /// The length and fingerprint of the JSON.
    pub info: PartInfo,
    id: JobId,
    key: i64,
    /// The fields in memory, if they had to be read to check that they are intact.
    loaded: Option<Arc<LoadedFields>>,
}

/// Returns the fields at all nodes, as JSON. `partial`: whether those of a job without a solution will do.
pub fn fields<'a>(
    service: &'a Arc<Service>,
    caller: &'a Caller,
    id: JobId,
    partial: bool,
) -> BoxFuture<'a, Result<Found<StoredFields>, ApiError>> {
    Box::pin(async move {
        let found = with_result(service, caller, id).await?;
        is_wanted(&found.job, partial)?;
        let job = found.job.clone();
        drop(found);
        are_kept(service, &job).await?;
        let (info, loaded) = match service.store.fields_info(job.key).await? {
            Some(info) => (info, None),
            None => {
                let loaded = load(service, job.key).await?;
                let loaded = loaded.ok_or_else(|| no_result(&job))?;
                (loaded.info.clone(), Some(loaded))
            }
        };
        let content = StoredFields {
            info,
            id,
            key: job.key,
            loaded,
        };
        Ok(Found::new(job.result_available, content))
    })
}

/// Fails if the fields of a job that has ended were deleted.
pub(super) async fn are_kept(service: &Service, job: &Job) -> Result<(), ApiError> {
    let lost = job.status.is_terminal() && service.store.lost_fields(job.key).await?;
    if lost {
        Err(ApiError::FieldsDeleted(job.id))
    } else {
        Ok(())
    }
}

/// Loads the fields of a job once there is memory for them; `None` if there are none. This runs in a task of its own:
/// reading goes on if the client does not wait, and its memory counts until it ends.
pub(super) async fn load(
    service: &Arc<Service>,
    key: i64,
) -> Result<Option<Arc<LoadedFields>>, ApiError> {
    let service = service.clone();
    detached(async move { try_to_load(&service, key).await }).await
}

async fn try_to_load(service: &Service, key: i64) -> Result<Option<Arc<LoadedFields>>, ApiError> {
    if let Some(loaded) = service.fields_in_memory.find(key) {
        return Ok(Some(loaded));
    }
    let Some(bytes) = service.store.fields_memory(key).await? else {
        return Ok(None);
    };
    let mut share = service.sent.wait_for(bytes).await?;
    if let Some(loaded) = service.fields_in_memory.find(key) {
        return Ok(Some(loaded)); // read by another meanwhile
    }
    let Some((info, fields)) = service.store.fields(key).await? else {
        return Ok(None);
    };
    // reading took several times as much
    share.shrink_to(files::fields::memory(&fields));
    let loaded = Arc::new(LoadedFields {
        info,
        fields,
        _share: share,
    });
    service.fields_in_memory.insert(key, &loaded);
    Ok(Some(loaded))
}

impl StoredFields {
    /// Returns the bytes of the JSON from `start` to before `end`, in pieces, since there may be many. The bytes before
    /// `start` are computed and skipped, which takes a millisecond for each megabyte.
    pub fn bytes(
        &self,
        service: &Arc<Service>,
        start: u64,
        end: u64,
    ) -> impl Stream<Item = Result<Vec<u8>, ApiError>> + Send + use<> {
        let (service, id, key) = (service.clone(), self.id, self.key);
        let loaded = self.loaded.clone();
        try_stream! {
            let loaded = match loaded {
                Some(loaded) => loaded,
                None => load(&service, key).await?.ok_or(ApiError::Deleted(id))?,
            };
            let (mut json, mut place) = (FieldsJson::new(Shared(loaded)), 0);
            while place < end {
                let next = move || (json.piece(), json);
                let (piece, rest) = service.work(next).await?;
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

/// Returns the fields in another format than JSON, in memory; `partial` as for `fields`.
pub fn converted_fields<'a>(
    service: &'a Arc<Service>,
    caller: &'a Caller,
    id: JobId,
    format: Format,
    partial: bool,
) -> BoxFuture<'a, Result<Found<Vec<u8>>, ApiError>> {
    written_fields(service, caller, id, partial, move |loaded| {
        formats::fields(&loaded.fields, format)
    })
}

/// Writes the fields of a job in a form that is made in memory; `partial` as for `fields`.
pub(super) fn written_fields<'a, E: Display + Send + 'static>(
    service: &'a Arc<Service>,
    caller: &'a Caller,
    id: JobId,
    partial: bool,
    write: impl FnOnce(&LoadedFields) -> Result<Vec<u8>, E> + Send + 'static,
) -> BoxFuture<'a, Result<Found<Vec<u8>>, ApiError>> {
    Box::pin(async move {
        let found = with_result(service, caller, id).await?;
        is_wanted(&found.job, partial)?;
        let job = found.job.clone();
        drop(found);
        are_kept(service, &job).await?;
        // before there is a permit to work: who has that must not wait for memory, which others keep until they have worked
        let loaded = load(service, job.key).await?;
        let loaded = loaded.ok_or_else(|| no_result(&job))?;
        let written = service.work(move || write(&loaded));
        let content = written.await?.map_err(ApiError::internal)?;
        Ok(Found::new(job.result_available, content))
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::panic)]
    use std::{pin::pin, sync::mpsc, time::Duration};

    use futures_util::{FutureExt, StreamExt};
    use tokio::{sync::oneshot, task::spawn_blocking, time::timeout};

    use super::*;
    use crate::verbs::tests::{caller, service, solved};

    #[tokio::test]
    async fn conversions_that_wait_for_memory_do_not_hold_up_the_work_of_others() {
        let folder = tempfile::tempdir().unwrap();
        let service = &service(folder.path()).await;
        let ada = &caller("ada");
        let id = solved(service, ada).await;
        let all = service.sent.take(usize::MAX).unwrap();
        let convert = || converted_fields(service, ada, id, Format::Npz, false);
        let mut conversions = pin!(async { tokio::join!(convert(), convert(), convert()) });
        tokio::select! {
            biased;
            _ = &mut conversions => panic!("there was no memory"),
            // for ever, if they have both permits
            worked = timeout(Duration::from_secs(60), service.work(|| 7)) => assert_eq!(worked.unwrap().unwrap(), 7),
        }
        drop(all);
        let (first, second, third) = conversions.await;
        for converted in [first, second, third] {
            assert!(converted.unwrap().content.starts_with(b"PK"));
        }
    }

    #[tokio::test]
    async fn a_stream_is_written_in_the_bounded_pool_and_keeps_the_memory_of_its_fields_only() {
        let folder = tempfile::tempdir().unwrap();
        let service = &service(folder.path()).await;
        let ada = &caller("ada");
        let id = solved(service, ada).await;
        let found = fields(service, ada, id, false).await.unwrap().content;
        let mut pieces = pin!(found.bytes(service, 0, u64::MAX));
        let mut json = pieces.next().await.unwrap().unwrap();
        assert!(service.sent.take(128 << 20).is_err());
        assert!(service.sent.take((128 << 20) - (64 << 10)).is_ok());

        let mut busy = vec![];
        for _ in 0..2 {
            let (service, (send, received)) = (service.clone(), mpsc::channel::<()>());
            let (start, started) = oneshot::channel();
            let work = move || (start.send(()), received.recv().is_err());
            tokio::spawn(async move { service.work(work).await.map(drop) });
            started.await.unwrap();
            busy.push(send);
        }
        for _ in 0..20 {
            assert!(pieces.next().now_or_never().is_none());
            spawn_blocking(|| ()).await.unwrap();
        }
        drop(busy);
        while let Some(piece) = pieces.next().await {
            json.extend(piece.unwrap());
        }
        assert_eq!(json.len() as u64, found.info.bytes);
    }
}
