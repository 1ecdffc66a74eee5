//! One job: by its public id, or what is asked of it by its key.

use super::{database::Store, error::Result, rows::named};
use crate::{
    caller::Owners,
    job::{Job, JobId, Status},
};

impl Store {
    /// The job of that public id, with its place in the queue.
    pub async fn job(&self, owners: Owners<'_>, id: JobId) -> Result<Option<Job>> {
        let mut connection = self.reader.acquire().await?;
        let Some(mut job) = named(&mut connection, owners, id).await? else {
            return Ok(None);
        };
        self.place(&mut connection, std::slice::from_mut(&mut job))
            .await?;
        Ok(Some(job))
    }

    /// The title of a job, and its problem as JSON without it.
    pub async fn problem(&self, key: i64) -> Result<Option<(Option<String>, String)>> {
        Ok(sqlx::query_as(
            "select job.title, problem.body from job join problem on problem.input_hash = job.input_hash
             where job.id = ?",
        )
        .bind(key)
        .fetch_optional(&self.reader)
        .await?)
    }

    /// Whether the job is terminal, and its `done` so among its events; `None` when it is no longer there.
    pub async fn has_ended(&self, key: i64) -> Result<Option<bool>> {
        let status: Option<String> = sqlx::query_scalar("select status from job where id = ?")
            .bind(key)
            .fetch_optional(&self.reader)
            .await?;
        Ok(status.map(|word| word.parse().is_ok_and(Status::is_terminal)))
    }

    /// The number of the job that came last; 0 when there is none.
    pub async fn last_key(&self) -> Result<i64> {
        let last = sqlx::query_scalar("select coalesce(max(id), 0) from job");
        Ok(last.fetch_one(&self.reader).await?)
    }
}
