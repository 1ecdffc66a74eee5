//! Deleting jobs; their ids are remembered for a while.

use std::time::Duration;

use sqlx::SqliteConnection;

use super::{change::Change, database::Store, error::Result, results, rows::find, sweeps};
use crate::{caller::Owners, job::JobId, time::Time};

/// How long the id of a deleted job is answered with *deleted*; then it is unknown.
const REMEMBERED_S: f64 = 7.0 * 86_400.0;

/// How many of them are remembered, some 160 bytes each: what is removed as fast as it is solved does not fill the disk.
pub(super) const MOST_REMEMBERED: u32 = 100_000;
/// Between two transactions others write.
pub(super) const PAUSE: Duration = Duration::from_millis(20);

/// Ids that are forgotten in one transaction: some milliseconds of the single writer.
const FORGOTTEN_AT_ONCE: u32 = 1000;

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
    /// Deletes a job that has ended, with its events, and with its result unless other jobs were answered with it.
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
            Ok(owner.is_some_and(|owner| owners.include(&owner)))
        };
        self.damages.noting(read).await
    }

    /// Removes the ids of jobs that were deleted long ago.
    pub async fn forget_deleted(&self, now: Time) -> Result<()> {
        let before = now.after_s(-REMEMBERED_S).micros();
        let forget = async {
            let some = "select exists (select 1 from deleted_job where deleted_at < ?1)
                        or exists (select 1 from deleted_sweep where deleted_at < ?1)";
            let some = sqlx::query_scalar(some).bind(before);
            if some.fetch_one(&self.reader).await? {
                let mut tx = self.begin().await?;
                sqlx::query("delete from deleted_job where deleted_at < ?")
                    .bind(before)
                    .execute(&mut *tx)
                    .await?;
                sweeps::forget_deleted(&mut tx, before).await?;
                tx.commit().await?;
            }
            Ok(())
        };
        self.writing(forget).await
    }

    /// Removes the oldest ids of deleted jobs beyond so many.
    pub(super) async fn forget_beyond(&self, most: u32) -> Result<()> {
        let beyond = "select deleted_at from deleted_job indexed by deleted_job_by_time
             order by deleted_at desc limit 1 offset ?";
        loop {
            let newest: Option<i64> = sqlx::query_scalar(beyond)
                .bind(most)
                .fetch_optional(&self.reader)
                .await?;
            let Some(newest) = newest else {
                return Ok(());
            };
            let forget = async {
                let mut tx = self.begin_control().await?;
                sqlx::query(
                    "delete from deleted_job where uuid in (select uuid from deleted_job indexed by deleted_job_by_time
                     where deleted_at <= ? order by deleted_at limit ?)",
                )
                .bind(newest)
                .bind(FORGOTTEN_AT_ONCE)
                .execute(&mut *tx)
                .await?;
                tx.commit().await
            };
            self.writing(forget).await?;
            tokio::time::sleep(PAUSE).await;
        }
    }
}

/// Deletes a job that has ended.
pub(super) async fn delete(
    change: &mut Change<'_>,
    owners: Owners<'_>,
    key: i64,
) -> Result<Deletion> {
    let job = find(change.sql(), key).await?;
    let Some(job) = job.filter(|job| owners.include(&job.owner)) else {
        return Ok(Deletion::Unknown);
    };
    if !job.status.is_terminal() {
        return Ok(Deletion::Active);
    }
    let now = change.now();
    let tx = change.sql();
    sqlx::query("insert into deleted_job (uuid, id, owner, deleted_at) values (?, ?, ?, ?)")
        .bind(job.id.0.to_string())
        .bind(key)
        .bind(&job.owner)
        .bind(now.micros())
        .execute(&mut *tx)
        .await?;
    for statement in [
        "delete from event where job_id = ?",
        "delete from job_label where job_id = ?",
        "delete from job_size where job_id = ?",
        "delete from job where id = ?",
    ] {
        sqlx::query(statement).bind(key).execute(&mut *tx).await?;
    }
    sqlx::query(
        "delete from problem where input_hash = ?1 and not exists (select 1 from job where input_hash = ?1)",
    )
    .bind(&job.input_hash)
    .execute(&mut *tx)
    .await?;
    for result in [key, job.result_key] {
        if !is_in_use(tx, result).await? {
            results::remove(tx, result).await?;
        }
    }
    change.deleted(job.id);
    change.changed(key);
    Ok(Deletion::Deleted)
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

/// Whether a job has the result under this key, as its own or from another job.
async fn is_in_use(tx: &mut SqliteConnection, result: i64) -> Result<bool> {
    Ok(sqlx::query_scalar(
        "select exists (select 1 from job where id = ?1) or exists (select 1 from job where result_job = ?1)",
    )
    .bind(result)
    .fetch_one(tx)
    .await?)
}
