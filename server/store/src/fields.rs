//! Deletes the fields of a job, which are most of its result, and keeps the rest.

use std::sync::Arc;

use base::{caller::Owners, job::Job};

use super::{
    change::Change,
    content::{self, Holder, name},
    database::Store,
    delete::Deletion,
    error::Result,
    sql::Sql,
};

impl Store {
    /// Deletes the fields of a job that has ended: its summary, history and profiles stay.
    pub async fn delete_fields(self: &Arc<Self>, owners: Owners, key: i64) -> Result<Deletion> {
        self.control(move |writer| {
            let mut change = writer.control_change()?;
            let job = change.find(key)?;
            let Some(job) = job.filter(|job| owners.include(&job.owner)) else {
                return Ok(Deletion::Unknown);
            };
            if !job.status.is_terminal() {
                return Ok(Deletion::Active);
            }
            remove_fields(&mut change, &job)?;
            change.commit()?;
            Ok(Deletion::Deleted)
        })
        .await
    }
}

/// Deletes the fields of a job that has ended. Other jobs with the same result keep the fields.
pub(super) fn remove_fields(change: &mut Change<'_>, job: &Job) -> Result<()> {
    let tx = change.sql()?;
    tx.run(
        "update job_size set fields = 2 where job_id = ? and fields = 1",
        [job.key],
    )?;
    content::detach(tx, Holder::Job(job.key), &[name::FIELDS])
}
