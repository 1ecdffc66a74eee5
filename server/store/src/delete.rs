//! Deletes jobs, and tells which were deleted.

use std::{sync::Arc, time::Duration};

use base::{
    caller::Owners,
    job::{Job, JobId},
};
use rusqlite::Connection;

use super::{change::Change, damage::Table, database::Store, error::Result, sql::Sql, sweeps};

/// The pause between two transactions of a long removal, in which other changes are written.
pub(super) const PAUSE: Duration = Duration::from_millis(20);

/// The effect of deleting a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Deletion {
    /// The job was deleted.
    Deleted,
    /// The job waits or runs, and was not deleted.
    Active,
    /// There is no such job.
    Unknown,
}

impl Store {
    /// Deletes a job that has ended, with its events and its result. Other jobs that were answered with the result keep
    /// it.
    pub async fn delete(self: &Arc<Self>, owners: Owners, key: i64) -> Result<Deletion> {
        self.control(move |writer| {
            let mut change = writer.control_change()?;
            let deletion = delete(&mut change, &owners, key)?;
            if deletion == Deletion::Deleted {
                change.commit()?;
            }
            Ok(deletion)
        })
        .await
    }

    /// Whether a job of these owners with this public id was deleted recently.
    pub async fn was_deleted(self: &Arc<Self>, owners: Owners, id: JobId) -> Result<bool> {
        self.read(move |store, connection| {
            let owner = owner_of_deleted(connection, id)?;
            if owner.is_none() {
                store.damages.have_all(&[Table::Deleted])?;
            }
            Ok(owner.is_some_and(|owner| owners.include(&owner)))
        })
        .await
    }
}

/// Deletes a job that has ended.
pub(super) fn delete(change: &mut Change<'_>, owners: &Owners, key: i64) -> Result<Deletion> {
    let job = change.find(key)?;
    let Some(job) = job.filter(|job| owners.include(&job.owner)) else {
        return Ok(Deletion::Unknown);
    };
    if !job.status.is_terminal() {
        return Ok(Deletion::Active);
    }
    remove(change, &job)?;
    Ok(Deletion::Deleted)
}

/// Removes a job that has ended, and its sweep if it was the sweep's last job.
pub(super) fn remove(change: &mut Change<'_>, job: &Job) -> Result<()> {
    change.delete(job)?;
    if let Some(sweep) = job.sweep
        && !sweeps::remove_without_jobs(change, sweep)?
    {
        sweeps::keep_failures(change.sql()?, job)?;
    }
    Ok(())
}

/// The owner of a job that was deleted recently; `None` if there was no such job.
pub(super) fn owner_of_deleted(connection: &Connection, id: JobId) -> Result<Option<String>> {
    let owner = "select owner from deleted_job where uuid = ?";
    connection.optional_value(owner, [id.0.to_string()])
}

/// The public id of a deleted job, by its key.
pub(super) fn deleted_id(connection: &Connection, key: i64) -> Result<Option<JobId>> {
    let uuid = "select uuid from deleted_job where id = ?";
    let uuid: Option<String> = connection.optional_value(uuid, [key])?;
    Ok(uuid
        .and_then(|text| text.parse::<uuid::Uuid>().ok())
        .map(JobId::from))
}
