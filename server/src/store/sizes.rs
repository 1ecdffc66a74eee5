//! What jobs and owners keep, in bytes.

use std::collections::HashMap;

use sqlx::SqliteConnection;

use super::{database::Store, error::Result};
use crate::job::Job;

/// What an owner keeps.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct OwnerSize {
    /// Their name.
    pub owner: String,
    /// Jobs that have ended.
    pub jobs: u64,
    /// Bytes of these: results, problems, events, members of sweeps.
    pub job_bytes: u64,
    /// Bytes of the meshes that they have uploaded.
    pub mesh_bytes: u64,
}

impl OwnerSize {
    /// All bytes.
    pub fn bytes(&self) -> u64 {
        self.job_bytes + self.mesh_bytes
    }
}

/// The columns of an owner's size.
type Columns = (String, i64, i64, i64);

fn size((owner, jobs, job_bytes, mesh_bytes): Columns) -> OwnerSize {
    let count = |count: i64| u64::try_from(count).unwrap_or(0);
    OwnerSize {
        owner,
        jobs: count(jobs),
        job_bytes: count(job_bytes),
        mesh_bytes: count(mesh_bytes),
    }
}

pub(super) const WAITING_BYTES: &str = "select coalesce(sum(bytes), 0) from content where id in
         (select content from attachment where kind = 'job' and name = 'problem' and key in
              (select min(id) from job indexed by job_queued_by_owner
               where owner = ? and status = 'queued' group by input_hash))";

impl Store {
    /// What an owner keeps.
    pub async fn size_of_owner(&self, owner: &str) -> Result<OwnerSize> {
        let row: Option<Columns> = sqlx::query_as(
            "select owner, jobs, job_bytes, mesh_bytes from owner_size where owner = ?",
        )
        .bind(owner)
        .fetch_optional(&self.reader)
        .await?;
        let nothing = || OwnerSize {
            owner: owner.to_owned(),
            ..OwnerSize::default()
        };
        Ok(row.map_or_else(nothing, size))
    }

    /// Bytes of the problems of an owner's jobs that wait, each once.
    pub async fn waiting_bytes_of(&self, owner: &str) -> Result<u64> {
        let bytes: i64 = sqlx::query_scalar(WAITING_BYTES)
            .bind(owner)
            .fetch_one(&self.reader)
            .await?;
        Ok(u64::try_from(bytes).unwrap_or(0))
    }

    /// What every owner keeps, who keeps most first: at most `limit` of them.
    pub async fn sizes_of_owners(&self, limit: i64) -> Result<Vec<OwnerSize>> {
        let rows: Vec<Columns> = sqlx::query_as(
            "select owner, jobs, job_bytes, mesh_bytes from owner_size
             order by job_bytes + mesh_bytes desc, owner limit ?",
        )
        .bind(limit)
        .fetch_all(&self.reader)
        .await?;
        Ok(rows.into_iter().map(size).collect())
    }

    /// Whether the fields of this job were deleted by themselves.
    pub async fn lost_fields(&self, key: i64) -> Result<bool> {
        let read = async {
            let mut connection = self.reader.acquire().await?;
            lost_fields(&mut connection, key).await
        };
        self.damages.noting(read).await
    }
}

/// Whether the fields of a job were deleted by themselves.
pub(super) async fn lost_fields(connection: &mut SqliteConnection, key: i64) -> Result<bool> {
    let lost = "select exists (select 1 from job_size where job_id = ? and fields = 2)";
    Ok(sqlx::query_scalar(lost)
        .bind(key)
        .fetch_one(connection)
        .await?)
}

/// Counts what a job keeps that has just ended.
pub(super) async fn count(tx: &mut SqliteConnection, key: i64) -> Result<()> {
    sqlx::query(
        "insert into job_size (job_id, owner, bytes, finished_at, fields)
         select job_id, owner, bytes, finished_at, fields from job_kept where job_id = ?",
    )
    .bind(key)
    .execute(tx)
    .await?;
    Ok(())
}

/// Fills in what jobs keep.
pub(super) async fn add_sizes(connection: &mut SqliteConnection, jobs: &mut [Job]) -> Result<()> {
    let ended = jobs.iter().filter(|job| job.status.is_terminal());
    let keys: Vec<i64> = ended.map(|job| job.key).collect();
    if keys.is_empty() {
        return Ok(());
    }
    let sizes: Vec<(i64, i64)> = sqlx::query_as(
        "select job_id, bytes from job_size where job_id in (select value from json_each(?))",
    )
    .bind(serde_json::to_string(&keys)?)
    .fetch_all(connection)
    .await?;
    let sizes: HashMap<i64, i64> = sizes.into_iter().collect();
    for job in jobs {
        let bytes = sizes.get(&job.key);
        job.stored_bytes = bytes.and_then(|bytes| u64::try_from(*bytes).ok());
    }
    Ok(())
}
