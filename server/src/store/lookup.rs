//! One job: found by its public id; details of it by its key.

use super::{database::Store, error::Result, rows::with_id};
use crate::{
    caller::Owners,
    job::{Job, JobId, Status},
};

impl Store {
    /// The job with this public id, with its queue position.
    pub async fn job(&self, owners: Owners<'_>, id: JobId) -> Result<Option<Job>> {
        let mut connection = self.reader.acquire().await?;
        let Some(mut job) = with_id(&mut connection, owners, id).await? else {
            return Ok(None);
        };
        self.add_queue_positions(&mut connection, std::slice::from_mut(&mut job))
            .await?;
        Ok(Some(job))
    }

    /// The title of a job, and its problem as JSON without the title.
    pub async fn problem(&self, key: i64) -> Result<Option<(Option<String>, String)>> {
        Ok(sqlx::query_as(
            "select job.title, problem.body from job join problem on problem.input_hash = job.input_hash
             where job.id = ?",
        )
        .bind(key)
        .fetch_optional(&self.reader)
        .await?)
    }

    /// Whether the job is terminal, so that its events contain `done`; `None` if it no longer exists.
    pub async fn has_ended(&self, key: i64) -> Result<Option<bool>> {
        let status: Option<String> = sqlx::query_scalar("select status from job where id = ?")
            .bind(key)
            .fetch_optional(&self.reader)
            .await?;
        Ok(status.map(|word| word.parse().is_ok_and(Status::is_terminal)))
    }

    /// The key of the newest job; 0 when there is none.
    pub async fn last_key(&self) -> Result<i64> {
        let last = sqlx::query_scalar("select coalesce(max(id), 0) from job");
        Ok(last.fetch_one(&self.reader).await?)
    }
}
