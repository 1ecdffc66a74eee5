//! Writes labels to a table of their own, in which jobs are found by label.

use base::job::Job;
use rusqlite::params;

use super::{change::Change, error::Result, sql::Sql};

/// Writes the labels of a job.
pub(super) fn write(change: &mut Change<'_>, job: &Job) -> Result<()> {
    if job.labels.is_empty() {
        return Ok(());
    }
    let tx = change.sql()?;
    for (name, value) in &job.labels {
        tx.run(
            "insert into job_label (key, value, created_at, job_id) values (?, ?, ?, ?)",
            params![name, value, job.created_at.micros(), job.key],
        )?;
    }
    Ok(())
}

/// Replaces the stored labels of a job by its present ones.
pub(super) fn replace(change: &mut Change<'_>, job: &Job) -> Result<()> {
    let tx = change.sql()?;
    tx.run("delete from job_label where job_id = ?", [job.key])?;
    write(change, job)
}
