//! The sizes of what jobs and owners keep, in bytes.

use std::{collections::HashMap, sync::Arc};

use base::job::Job;
use rusqlite::Connection;

use super::{database::Store, error::Result, sql::Sql};

/// The size of what an owner keeps.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct OwnerSize {
    /// The name of the owner.
    pub owner: String,
    /// The number of ended jobs.
    pub jobs: u64,
    /// The size of the ended jobs (bytes): results, problems, events, members of sweeps.
    pub job_bytes: u64,
    /// The size of the meshes that the owner has uploaded (bytes).
    pub mesh_bytes: u64,
}

impl OwnerSize {
    /// The size of jobs and meshes together (bytes).
    pub fn bytes(&self) -> u64 {
        self.job_bytes + self.mesh_bytes
    }
}

/// The columns of a row of the table `owner_size`.
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
    /// The size of what an owner keeps.
    pub async fn size_of_owner(self: &Arc<Self>, owner: &str) -> Result<OwnerSize> {
        let owner = owner.to_owned();
        self.read(move |_, connection| {
            let row: Option<Columns> = connection.row(
                "select owner, jobs, job_bytes, mesh_bytes from owner_size where owner = ?",
                [&owner],
                |row| Ok(row.try_into()?),
            )?;
            let nothing = || OwnerSize {
                owner,
                ..OwnerSize::default()
            };
            Ok(row.map_or_else(nothing, size))
        })
        .await
    }

    /// The size of the problems of an owner's waiting jobs (bytes), each problem once.
    pub async fn waiting_bytes_of(self: &Arc<Self>, owner: &str) -> Result<u64> {
        let owner = owner.to_owned();
        self.read(move |_, connection| {
            let bytes: i64 = connection.value(WAITING_BYTES, [owner])?;
            Ok(u64::try_from(bytes).unwrap_or(0))
        })
        .await
    }

    /// The sizes of what owners keep, the largest first, of at most `limit` owners.
    pub async fn sizes_of_owners(self: &Arc<Self>, limit: i64) -> Result<Vec<OwnerSize>> {
        self.read(move |_, connection| {
            connection.rows(
                "select owner, jobs, job_bytes, mesh_bytes from owner_size
                 order by job_bytes + mesh_bytes desc, owner limit ?",
                [limit],
                |row| Ok(size(row.try_into()?)),
            )
        })
        .await
    }

    /// Whether the fields of this job were deleted alone, and the job was kept.
    pub async fn lost_fields(self: &Arc<Self>, key: i64) -> Result<bool> {
        self.read(move |_, connection| lost_fields(connection, key))
            .await
    }
}

/// Whether the fields of a job were deleted alone, and the job was kept.
pub(super) fn lost_fields(connection: &Connection, key: i64) -> Result<bool> {
    let lost = "select exists (select 1 from job_size where job_id = ? and fields = 2)";
    connection.value(lost, [key])
}

/// Counts the size of a job that has just ended.
pub(super) fn count(tx: &Connection, key: i64) -> Result<()> {
    tx.run(
        "insert into job_size (job_id, owner, bytes, finished_at, fields)
         select job_id, owner, bytes, finished_at, fields from job_kept where job_id = ?",
        [key],
    )?;
    Ok(())
}

/// Fills in the sizes of ended jobs.
pub(super) fn add_sizes(connection: &Connection, jobs: &mut [&mut Job]) -> Result<()> {
    let ended = jobs.iter().filter(|job| job.status.is_terminal());
    let keys: Vec<i64> = ended.map(|job| job.key).collect();
    if keys.is_empty() {
        return Ok(());
    }
    let sizes: Vec<(i64, i64)> = connection.rows(
        "select job_id, bytes from job_size where job_id in (select value from json_each(?))",
        [serde_json::to_string(&keys)?],
        |row| Ok(row.try_into()?),
    )?;
    let sizes: HashMap<i64, i64> = sizes.into_iter().collect();
    for job in jobs {
        let bytes = sizes.get(&job.key);
        job.stored_bytes = bytes.and_then(|bytes| u64::try_from(*bytes).ok());
    }
    Ok(())
}
