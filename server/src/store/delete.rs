//! Deleting jobs.

use std::time::Duration;

use sqlx::SqliteConnection;

use super::{change::Change, damage::Table, database::Store, error::Result, sweeps};
use crate::{
    caller::Owners,
    job::{Job, JobId},
};

/// Between two transactions that remove things others write.
pub(super) const PAUSE: Duration = Duration::from_millis(20);

/// The effect of deleting a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Deletion {
    /// It was deleted.
    Deleted,
    /// It waits or runs, and was not deleted.
    Active,
    /// There is no such job.
    Unknown,
}

impl Store {
    /// Deletes a job that has ended, with its events and its result. Others that were answered with it keep it.
    pub async fn delete(&self, owners: Owners<'_>, key: i64) -> Result<Deletion> {
        self.control(|| self.try_to_delete(owners, key)).await
    }

    async fn try_to_delete(&self, owners: Owners<'_>, key: i64) -> Result<Deletion> {
        let mut change = self.control_change().await?;
        let deletion = delete(&mut change, owners, key).await?;
        if deletion == Deletion::Deleted {
            change.commit().await?;
        }
        Ok(deletion)
    }

    /// Whether a job of these owners with this public id was deleted recently.
    pub async fn was_deleted(&self, owners: Owners<'_>, id: JobId) -> Result<bool> {
        let read = async {
            let mut connection = self.reader.acquire().await?;
            let owner = owner_of_deleted(&mut connection, id).await?;
            if owner.is_none() {
                self.damages.have_all(&[Table::Deleted])?;
            }
            Ok(owner.is_some_and(|owner| owners.include(&owner)))
        };
        self.damages.noting(read).await
    }
}

/// Deletes a job that has ended.
pub(super) async fn delete(
    change: &mut Change<'_>,
    owners: Owners<'_>,
    key: i64,
) -> Result<Deletion> {
    let job = change.find(key).await?;
    let Some(job) = job.filter(|job| owners.include(&job.owner)) else {
        return Ok(Deletion::Unknown);
    };
    if !job.status.is_terminal() {
        return Ok(Deletion::Active);
    }
    remove(change, &job).await?;
    Ok(Deletion::Deleted)
}

/// Removes a job that has ended, and the sweep that it was the last job of.
pub(super) async fn remove(change: &mut Change<'_>, job: &Job) -> Result<()> {
    change.delete(job).await?;
    if let Some(sweep) = job.sweep
        && !sweeps::remove_without_jobs(change, sweep).await?
    {
        sweeps::keep_failures(change.sql().await?, job).await?;
    }
    Ok(())
}

/// The owner of a job that was deleted recently; `None` if there was no such job.
pub(super) async fn owner_of_deleted(
    connection: &mut SqliteConnection,
    id: JobId,
) -> Result<Option<String>> {
    Ok(
        sqlx::query_scalar("select owner from deleted_job where uuid = ?")
            .bind(id.0.to_string())
            .fetch_optional(connection)
            .await?,
    )
}

/// The public id of a deleted job, by its key.
pub(super) async fn deleted_id(
    connection: &mut SqliteConnection,
    key: i64,
) -> Result<Option<JobId>> {
    let uuid: Option<String> = sqlx::query_scalar("select uuid from deleted_job where id = ?")
        .bind(key)
        .fetch_optional(connection)
        .await?;
    Ok(uuid.and_then(|text| text.parse().ok()).map(JobId))
}
