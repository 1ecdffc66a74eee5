//! Queries about one job: the job by its public id, and details by its key.

use std::sync::Arc;

use base::{
    caller::Owners,
    job::{Job, JobId, Status},
};

use super::{
    content::{self, Holder, name},
    damage::Table,
    database::Store,
    error::Result,
    rows::{find_row, with_id},
    sql::Sql,
};

impl Store {
    /// The job with this public id, with its queue position.
    pub async fn job(self: &Arc<Self>, owners: Owners, id: JobId) -> Result<Option<Job>> {
        self.read(move |store, connection| {
            let Some(mut job) = with_id(connection, &owners, id)? else {
                store.damages.have_all(&[Table::Jobs])?;
                return Ok(None);
            };
            store.complete(connection, &mut [&mut job])?;
            Ok(Some(job))
        })
        .await
    }

    /// The title of a job, and its problem as JSON without the title.
    pub async fn problem(self: &Arc<Self>, key: i64) -> Result<Option<(Option<String>, String)>> {
        self.read(move |_, connection| {
            let tx = connection.unchecked_transaction()?;
            let Some((row, _)) = find_row(&tx, key)? else {
                return Ok(None);
            };
            let body = content::read_text(&tx, Holder::Job(key), name::PROBLEM)?;
            Ok(Some((row.title, body)))
        })
        .await
    }

    /// The problem of a job as JSON without its title, if it has at most `most` bytes.
    pub async fn small_problem(self: &Arc<Self>, key: i64, most: usize) -> Result<Option<String>> {
        self.read(move |_, connection| {
            let tx = connection.unchecked_transaction()?;
            let holder = Holder::Job(key);
            match content::find(&tx, holder, name::PROBLEM)? {
                Some(found) if found.fingerprint.bytes <= most => {
                    Ok(Some(content::read_text(&tx, holder, name::PROBLEM)?))
                }
                _ => Ok(None),
            }
        })
        .await
    }

    /// Whether the job has ended, so that its events contain `done`; `None` if the job no longer exists.
    pub async fn has_ended(self: &Arc<Self>, key: i64) -> Result<Option<bool>> {
        self.read(move |_, connection| {
            let status = "select status from job where id = ?";
            let status: Option<String> = connection.optional_value(status, [key])?;
            Ok(status.map(|word| word.parse().is_ok_and(Status::is_terminal)))
        })
        .await
    }

    /// The key of the newest job; 0 when there is none.
    pub async fn last_key(self: &Arc<Self>) -> Result<i64> {
        self.read(|_, connection| connection.value("select coalesce(max(id), 0) from job", ()))
            .await
    }
}
