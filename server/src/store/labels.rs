//! Labels in a table of their own, for searches.

use super::{change::Change, error::Result};
use crate::job::Job;

/// Writes the labels of a job.
pub(super) async fn write(change: &mut Change<'_>, job: &Job) -> Result<()> {
    for (name, value) in &job.labels {
        sqlx::query("insert into job_label (key, value, created_at, job_id) values (?, ?, ?, ?)")
            .bind(name)
            .bind(value)
            .bind(job.created_at.micros())
            .bind(job.key)
            .execute(change.sql().await?)
            .await?;
    }
    Ok(())
}

/// Writes the labels of a job in place of earlier ones.
pub(super) async fn replace(change: &mut Change<'_>, job: &Job) -> Result<()> {
    sqlx::query("delete from job_label where job_id = ?")
        .bind(job.key)
        .execute(change.sql().await?)
        .await?;
    write(change, job).await
}
