//! One job: found by its public id; details of it by its key.

use super::{
    content::{self, Holder, name},
    damage::Table,
    database::Store,
    error::Result,
    rows::{find_row, with_id},
};
use crate::{
    caller::Owners,
    job::{Job, JobId, Status},
};

impl Store {
    /// The job with this public id, with its queue position.
    pub async fn job(&self, owners: Owners<'_>, id: JobId) -> Result<Option<Job>> {
        let read = async {
            let mut connection = self.reader.acquire().await?;
            let Some(mut job) = with_id(&mut connection, owners, id).await? else {
                self.damages.have_all(&[Table::Jobs])?;
                return Ok(None);
            };
            self.complete(&mut connection, std::slice::from_mut(&mut job))
                .await?;
            Ok(Some(job))
        };
        self.damages.noting(read).await
    }

    /// The title of a job, and its problem as JSON without the title.
    pub async fn problem(&self, key: i64) -> Result<Option<(Option<String>, String)>> {
        let read = async {
            let mut tx = self.reader.begin().await?;
            let Some((row, _)) = find_row(&mut tx, key).await? else {
                return Ok(None);
            };
            let body = content::read_text(&mut tx, Holder::Job(key), name::PROBLEM).await?;
            Ok(Some((row.title, body)))
        };
        self.damages.noting(read).await
    }

    /// Whether the job is terminal, so that its events contain `done`; `None` if it no longer exists.
    pub async fn has_ended(&self, key: i64) -> Result<Option<bool>> {
        let status: Option<String> = sqlx::query_scalar("select status from job where id = ?")
            .bind(key)
            .fetch_optional(&self.reader)
            .await?;
        Ok(status.map(|word| word.parse().is_ok_and(Status::is_terminal)))
    }

    /// The age of the oldest job that waits for a worker (seconds).
    pub async fn oldest_wait_s(&self) -> Result<Option<f64>> {
        let Some(key) = self.waiting_jobs().oldest() else {
            return Ok(None);
        };
        let created: Option<i64> = sqlx::query_scalar("select created_at from job where id = ?")
            .bind(key)
            .fetch_optional(&self.reader)
            .await?;
        Ok(created.map(|at| (self.now().micros() - at).max(0) as f64 / 1e6))
    }

    /// The key of the newest job; 0 when there is none.
    pub async fn last_key(&self) -> Result<i64> {
        let last = sqlx::query_scalar("select coalesce(max(id), 0) from job");
        Ok(last.fetch_one(&self.reader).await?)
    }
}
