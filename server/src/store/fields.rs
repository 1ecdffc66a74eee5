//! The fields of a job, which are most of its result, deleted by themselves.

use super::{
    change::Change,
    content::{self, Holder, name},
    database::Store,
    delete::Deletion,
    error::Result,
};
use crate::{caller::Owners, job::Job};

impl Store {
    /// Deletes the fields of a job that has ended: its summary, history and profiles stay.
    pub async fn delete_fields(&self, owners: Owners<'_>, key: i64) -> Result<Deletion> {
        self.control(|| self.try_to_delete_fields(owners, key))
            .await
    }

    async fn try_to_delete_fields(&self, owners: Owners<'_>, key: i64) -> Result<Deletion> {
        let mut change = self.control_change().await?;
        let job = change.find(key).await?;
        let Some(job) = job.filter(|job| owners.include(&job.owner)) else {
            return Ok(Deletion::Unknown);
        };
        if !job.status.is_terminal() {
            return Ok(Deletion::Active);
        }
        remove_fields(&mut change, &job).await?;
        change.commit().await?;
        Ok(Deletion::Deleted)
    }
}

/// Deletes the fields of a job that has ended. Others with the same result keep them.
pub(super) async fn remove_fields(change: &mut Change<'_>, job: &Job) -> Result<()> {
    let tx = change.sql().await?;
    sqlx::query("update job_size set fields = 2 where job_id = ? and fields = 1")
        .bind(job.key)
        .execute(&mut *tx)
        .await?;
    content::detach(tx, Holder::Job(job.key), &[name::FIELDS]).await
}
