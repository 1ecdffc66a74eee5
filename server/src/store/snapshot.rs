//! Reading the result of a job.

use sha2::{Digest, Sha256};
use sqlx::{Sqlite, Transaction};

use super::{
    database::Store,
    error::Result,
    parts::{ProfilePoints, profile_part},
    rows::with_id,
};
use crate::{
    caller::Owners,
    job::{Job, JobId},
};

/// Size and hash of a part.
#[derive(Clone, Debug)]
pub struct PartInfo {
    /// Its size.
    pub bytes: u64,
    /// Its SHA-256.
    pub digest: Vec<u8>,
}

impl Store {
    /// A job and its result at one moment: the parts may be replaced while the job runs, and are removed when it is
    /// deleted.
    pub async fn snapshot(&self, owners: Owners<'_>, id: JobId) -> Result<Option<Snapshot>> {
        let mut tx = self.reader.begin().await?;
        let job = with_id(&mut tx, owners, id).await?;
        Ok(job.map(|job| Snapshot { job, tx }))
    }

    /// One piece of a part, from 0; `None` after the last.
    pub async fn piece(&self, key: i64, part: &str, piece: i64) -> Result<Option<Vec<u8>>> {
        Ok(sqlx::query_scalar(
            "select body from result_part where job_id = ? and name = ? and piece = ?",
        )
        .bind(key)
        .bind(part)
        .bind(piece)
        .fetch_optional(&self.reader)
        .await?)
    }
}

/// A job and its result at one moment. It holds a connection, and should be dropped soon.
pub struct Snapshot {
    /// The job, without its queue position.
    pub job: Job,
    tx: Transaction<'static, Sqlite>,
}

impl Snapshot {
    /// Size and hash of a part.
    pub async fn part_info(&mut self, part: &str) -> Result<Option<PartInfo>> {
        let found: Option<(i64, Vec<u8>)> =
            sqlx::query_as("select bytes, digest from result_info where job_id = ? and name = ?")
                .bind(self.job.result_key)
                .bind(part)
                .fetch_optional(&mut *self.tx)
                .await?;
        if let Some((bytes, digest)) = found {
            let bytes = bytes as u64;
            return Ok(Some(PartInfo { bytes, digest }));
        }
        // written by a version that did not store size and hash
        let body = self.part(part).await?;
        Ok(body.map(|body| PartInfo {
            bytes: body.len() as u64,
            digest: Sha256::digest(&body).to_vec(),
        }))
    }

    /// A whole part.
    pub async fn part(&mut self, part: &str) -> Result<Option<Vec<u8>>> {
        let pieces: Vec<Vec<u8>> = sqlx::query_scalar(
            "select body from result_part where job_id = ? and name = ? order by piece",
        )
        .bind(self.job.result_key)
        .bind(part)
        .fetch_all(&mut *self.tx)
        .await?;
        Ok((!pieces.is_empty()).then(|| pieces.concat()))
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
