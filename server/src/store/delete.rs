//! Deleting jobs, and remembering for a while that they were there.

use sqlx::SqliteConnection;

use super::{database::Store, error::Result, results, rows::find};
use crate::{caller::Owners, job::JobId, time::Time};

/// A deleted job's name answers *gone* for so long, then *unknown*.
const REMEMBERED_S: f64 = 7.0 * 86_400.0;

/// What deleting a job did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Deletion {
    /// It is gone.
    Deleted,
    /// It waits or runs.
    Active,
    /// There is none of that number, or no more.
    Unknown,
}

impl Store {
    /// Deletes a terminal job with its events, and its result unless another job serves it.
    pub async fn delete(&self, owners: Owners<'_>, key: i64) -> Result<Deletion> {
        let mut change = self.change().await?;
        let job = find(change.sql(), key).await?;
        let Some(job) = job.filter(|job| owners.include(&job.owner)) else {
            return Ok(Deletion::Unknown);
        };
        if !job.status.is_terminal() {
            return Ok(Deletion::Active);
        }
        let tx = change.sql();
        sqlx::query("insert into deleted_job (uuid, id, owner, deleted_at) values (?, ?, ?, ?)")
            .bind(job.id.0.to_string())
            .bind(key)
            .bind(&job.owner)
            .bind(Time::now().micros())
            .execute(&mut *tx)
            .await?;
        for statement in [
            "delete from event where job_id = ?",
            "delete from job_label where job_id = ?",
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
            if !is_served(tx, result).await? {
                results::remove(tx, result).await?;
            }
        }
        change.commit().await?;
        Ok(Deletion::Deleted)
    }

    /// Whether a job of that public id was deleted not long ago.
    pub async fn was_deleted(&self, owners: Owners<'_>, id: JobId) -> Result<bool> {
        let mut connection = self.reader.acquire().await?;
        let owner = owner_of_deleted(&mut connection, id).await?;
        Ok(owner.is_some_and(|owner| owners.include(&owner)))
    }

    /// Forgets names of jobs that were deleted long ago.
    pub async fn forget_deleted(&self, now: Time) -> Result<()> {
        let before = now.after_s(-REMEMBERED_S).micros();
        let some: bool =
            sqlx::query_scalar("select exists (select 1 from deleted_job where deleted_at < ?)")
                .bind(before)
                .fetch_one(&self.reader)
                .await?;
        if some {
            let mut tx = self.begin().await?;
            sqlx::query("delete from deleted_job where deleted_at < ?")
                .bind(before)
                .execute(&mut *tx)
                .await?;
            tx.commit().await?;
        }
        Ok(())
    }
}

/// Whose a job was that was deleted not long ago; none if there was no such job.
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

/// The public id of a deleted job by its number.
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

/// Whether a job serves the result of this number: its own, or another's.
async fn is_served(tx: &mut SqliteConnection, result: i64) -> Result<bool> {
    Ok(sqlx::query_scalar(
        "select exists (select 1 from job where id = ?1) or exists (select 1 from job where result_job = ?1)",
    )
    .bind(result)
    .fetch_one(tx)
    .await?)
}
