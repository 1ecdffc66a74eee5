//! Reading the result of a job.

use std::sync::Arc;

use solver::solution::Fields;
use sqlx::{Sqlite, Transaction};

use super::{
    damage::{Damages, Table},
    database::Store,
    encoding::{Content, PartInfo},
    error::Result,
    intact,
    parts::{ProfilePoints, profile_part},
    rows::with_id,
};
use crate::{
    caller::Owners,
    job::{Job, JobId},
};

/// The name of the part that is served in pieces and in other formats.
const FIELDS: &str = "fields";

impl Store {
    /// Size and hash of the JSON of the fields under this key, if they were read whole and found intact before.
    pub async fn fields_info(&self, key: i64) -> Result<Option<PartInfo>> {
        if !self.intact.contains(key, FIELDS) {
            return Ok(None);
        }
        let read = async {
            let mut connection = self.reader.acquire().await?;
            let known = intact::part_info(&mut connection, key, FIELDS).await?;
            Ok(known.map(|known| known.info))
        };
        self.damages.noting(read).await
    }

    /// The memory that reading the fields under this key takes at most, in bytes; `None` if there are none.
    pub async fn fields_memory(&self, key: i64) -> Result<Option<usize>> {
        self.part_memory(key, FIELDS).await
    }

    /// The same of another part.
    pub async fn part_memory(&self, key: i64, part: &str) -> Result<Option<usize>> {
        let read = async {
            let mut connection = self.reader.acquire().await?;
            intact::memory_to_read(&mut connection, key, part).await
        };
        self.damages.noting(read).await
    }

    /// The fields under this key, with size and hash of their JSON.
    pub async fn fields(&self, key: i64) -> Result<Option<(PartInfo, Fields)>> {
        let read = async {
            let mut connection = self.reader.acquire().await?;
            let stored = intact::stored_part(&mut connection, key, FIELDS).await?;
            drop(connection); // to decode them takes long
            let Some(stored) = stored else {
                return Ok(None);
            };
            let (info, content) = stored.decoded().await?;
            let fields = match content {
                Content::Fields(fields) => *fields,
                Content::Json(json) => serde_json::from_slice(&json)
                    .map_err(|error| intact::part_of(key, FIELDS).damaged(error))?,
            };
            Ok(Some((info, fields)))
        };
        let found = self.damages.noting(read).await?;
        if found.is_some() {
            self.intact.insert(key, FIELDS);
        }
        Ok(found)
    }

    /// A job and its result at one moment: the parts may be replaced while the job runs, and are removed when it is
    /// deleted.
    pub async fn snapshot(&self, owners: Owners<'_>, id: JobId) -> Result<Option<Snapshot>> {
        let read = async {
            let mut tx = self.reader.begin().await?;
            let job = with_id(&mut tx, owners, id).await?;
            if job.is_none() {
                self.damages.have_all(&[Table::Jobs])?;
            }
            Ok(job.map(|job| Snapshot {
                job,
                tx,
                damages: self.damages.clone(),
            }))
        };
        self.damages.noting(read).await
    }
}

/// A job and its result at one moment. It holds a connection, and should be dropped soon.
pub struct Snapshot {
    /// The job, without its queue position.
    pub job: Job,
    tx: Transaction<'static, Sqlite>,
    damages: Arc<Damages>,
}

impl Snapshot {
    /// The JSON of a part.
    pub async fn part(&mut self, part: &str) -> Result<Option<Vec<u8>>> {
        let read = intact::read_part(&mut self.tx, self.job.result_key, part);
        let found = self.damages.noting(read).await?;
        Ok(match found {
            Some((_, Content::Json(json))) => Some(json),
            Some((_, Content::Fields(fields))) => Some(serde_json::to_vec(&fields)?),
            None => None,
        })
    }

    /// The profile of a boundary, at the end or at the end of a load step (from 0).
    pub async fn profile(
        &mut self,
        boundary: &str,
        points: ProfilePoints,
        step: Option<usize>,
    ) -> Result<Option<Vec<u8>>> {
        self.part(&profile_part(boundary, points, step)).await
    }

    /// The boundaries that have a profile.
    pub async fn profiled_boundaries(&mut self) -> Result<Vec<String>> {
        let prefix = profile_part("", ProfilePoints::Nodes, None);
        let names: Vec<String> = sqlx::query_scalar(
            "select name from result_part where job_id = ? and piece = 0 and substr(name, 1, ?) = ? order by name",
        )
        .bind(self.job.result_key)
        .bind(prefix.len() as i64)
        .bind(&prefix)
        .fetch_all(&mut *self.tx)
        .await?;
        Ok(names
            .iter()
            .map(|name| name[prefix.len()..].to_string())
            .collect())
    }
}
