//! Mesh, displacements and stresses: in their stored form, or in another format.

use std::sync::Arc;

use async_stream::try_stream;
use futures_util::Stream;
use solver::solution::Fields;

use super::{
    results::{Found, no_result, with_result},
    service::{Service, detached},
};
use crate::{
    caller::Caller,
    error::ApiError,
    formats::{self, Format},
    job::JobId,
    store::{PIECE_BYTES, PartInfo},
};

/// The stored fields of a job: JSON of known length and fingerprint, in pieces.
#[derive(Debug)]
pub struct StoredFields {
    /// Length and fingerprint.
    pub info: PartInfo,
    id: JobId,
    result_key: i64,
}

/// The fields at all nodes in their stored form.
pub async fn fields(
    service: &Service,
    caller: &Caller,
    id: JobId,
) -> Result<Found<StoredFields>, ApiError> {
    let mut found = with_result(service, caller, id).await?;
    let (available, result_key) = (found.job.result_available, found.job.result_key);
    match found.checked_part_info("fields").await? {
        Some(info) => {
            let content = StoredFields {
                info,
                id,
                result_key,
            };
            Ok(Found { available, content })
        }
        None => Err(no_result(&found.job)),
    }
}

impl StoredFields {
    /// The bytes from `start` to before `end`, in pieces, since there may be many.
    pub fn bytes(
        &self,
        service: &Arc<Service>,
        start: u64,
        end: u64,
    ) -> impl Stream<Item = Result<Vec<u8>, ApiError>> + Send + use<> {
        let (service, id, key) = (service.clone(), self.id, self.result_key);
        const PIECE: u64 = PIECE_BYTES as u64;
        try_stream! {
            for piece in start / PIECE..end.div_ceil(PIECE) {
                // in a task of its own: a client that does not read may stop this stream at any point
                let service = service.clone();
                let read = detached(async move {
                    let share = service.sent.wait_for(PIECE_BYTES).await?;
                    let found = service.store.piece(key, "fields", piece as i64).await?;
                    Ok((share, found.ok_or(ApiError::Deleted(id))?))
                });
                let (share, mut bytes) = read.await?;
                let first = piece * PIECE;
                bytes.truncate(end.saturating_sub(first) as usize);
                let skipped = start.saturating_sub(first) as usize;
                yield bytes.split_off(skipped.min(bytes.len()));
                drop(share); // the next piece is asked for: this one is on its way
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
    let load = async {
        let mut found = with_result(service, caller, id).await?;
        let fields = found.part("fields").await?;
        let content = fields.ok_or_else(|| no_result(&found.job))?;
        let available = found.job.result_available;
        Ok(Found { available, content })
    };
    let written = service.work_on(load, move |stored| {
        let Found { available, content } = stored;
        let fields: Fields = serde_json::from_slice(&content).map_err(|error| error.to_string())?;
        drop(content); // they may be large
        let content = formats::fields(&fields, format)?;
        Ok::<_, String>(Found { available, content })
    });
    written.await?.map_err(ApiError::internal)
}
