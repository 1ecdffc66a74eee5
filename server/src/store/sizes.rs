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

pub(super) const WAITING_BYTES: &str =
    "select coalesce(sum(octet_length(body)), 0) from problem where input_hash in
         (select input_hash from job indexed by job_queued_by_owner where owner = ? and status = 'queued')";

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
        let mut connection = self.reader.acquire().await?;
        lost_fields(&mut connection, key).await
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

/// A job that has ended later than others, but is older, may be the first of those that were answered with a result whose own job is
/// gone: then it has the result, and the one that had it no longer does.
pub(super) async fn take_over(tx: &mut SqliteConnection, key: i64) -> Result<()> {
    sqlx::query(
        "with answered(result) as (select result_job from job where id = ?1 and result_job is not null)
         update job_size set bytes = bytes -
             (select coalesce(sum(length(body)), 0) from result_part where job_id = (select result from answered))
         where job_id = (select min(id) from job where result_job = (select result from answered) and id > ?1)
               and not exists (select 1 from job where id = (select result from answered))
               and not exists (select 1 from job where result_job = (select result from answered) and id < ?1)",
    )
    .bind(key)
    .execute(tx)
    .await?;
    Ok(())
}

/// Counts what a job that was just deleted shared with others, if it was counted for that job, for the next of them. One that
/// has not ended yet counts it when it ends.
pub(super) async fn hand_on(tx: &mut SqliteConnection, deleted: &Job) -> Result<()> {
    let to_the_first_answered_and_to_the_oldest = "
        update job_size set bytes = bytes +
             (select coalesce(sum(length(body)), 0) from result_part where job_id = ?2)
         where job_id = (select min(id) from job where result_job = ?2) and (?1 = ?2 or job_id > ?1)
               and not exists (select 1 from job where id = ?2);
        update job_size set bytes = bytes +
             coalesce((select octet_length(body) from problem where input_hash = ?3), 0)
         where job_id = (select id from job where input_hash = ?3 order by created_at, id limit 1)
               and not exists (select 1 from job where input_hash = ?3 and (created_at, id) < (?4, ?1));";
    sqlx::query(to_the_first_answered_and_to_the_oldest)
        .bind(deleted.key)
        .bind(deleted.result_key)
        .bind(&deleted.input_hash)
        .bind(deleted.created_at.micros())
        .execute(&mut *tx)
        .await?;
    let Some(sweep) = deleted.sweep else {
        return Ok(());
    };
    let of_the_first = "update job_size set bytes = bytes +
             coalesce((select octet_length(body) from sweep_definition join sweep on sweep.id = sweep where uuid = ?1), 0)
         where job_id = (select id from job where sweep = ?1 order by created_at, id limit 1)
               and not exists (select 1 from job where sweep = ?1 and (created_at, id) < (?2, ?3))";
    sqlx::query(of_the_first)
        .bind(sweep.0.to_string())
        .bind(deleted.created_at.micros())
        .bind(deleted.key)
        .execute(tx)
        .await?;
    Ok(())
}

/// Deletes the fields under this key, unless a job with that result still has them.
pub(super) async fn remove_unused_fields(tx: &mut SqliteConnection, result: i64) -> Result<()> {
    let needed: bool = sqlx::query_scalar(
        "select exists (select 1 from job_size where job_id = ?1 and fields = 1)
             or exists (select 1 from job join job_size on job_id = id where result_job = ?1 and fields = 1)",
    )
    .bind(result)
    .fetch_one(&mut *tx)
    .await?;
    if needed {
        return Ok(());
    }
    for statement in [
        "update job_size set bytes = bytes - (select coalesce(sum(length(body)), 0) from result_part
                                              where job_id = ?1 and name = 'fields')
         where job_id = coalesce((select id from job where id = ?1), (select min(id) from job where result_job = ?1))",
        "delete from result_part where job_id = ? and name = 'fields'",
        "delete from result_info where job_id = ? and name = 'fields'",
    ] {
        sqlx::query(statement)
            .bind(result)
            .execute(&mut *tx)
            .await?;
    }
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
