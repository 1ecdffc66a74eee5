//! The next job of the queue, given to a worker.

use super::{
    change::Change, database::Store, error::Result, life, rows::read, submission::Claim, twins,
};
use crate::job::Cache;

impl Store {
    /// The next job of the queue, now running; highest priority first, then in order of arrival.
    /// Jobs before it that a result has come for are answered; all that have changed come with it.
    pub async fn claim_next(&self) -> Result<(Option<Claim>, Vec<i64>)> {
        let mut change = self.change().await?;
        let claim = claim(&mut change).await?;
        let changed = change.commit().await?;
        Ok((claim, changed))
    }
}

/// The next job of the queue. The index is named because the planner, which knows nothing of how many jobs
/// there are, would rather sort all that wait.
pub(super) const NEXT: &str = "select id from job indexed by job_queue
     where status = 'queued' and twin_of is null order by priority desc, id limit 1";

pub(super) async fn claim(change: &mut Change<'_>) -> Result<Option<Claim>> {
    /// A transaction that answers more than these is too long.
    const ANSWERED: usize = 100;
    for _ in 0..ANSWERED {
        let key: Option<i64> = sqlx::query_scalar(NEXT)
            .fetch_optional(change.sql())
            .await?;
        let Some(key) = key else { return Ok(None) };
        let waiting = read(change.sql(), key).await?;
        // a result may have come since it was accepted
        if waiting.cache == Cache::Use
            && let Some(source) = twins::earlier(change, &waiting.input_hash).await?
        {
            twins::answer(change, &waiting, &source).await?;
            twins::settle(change, &waiting).await?;
            continue;
        }
        if waiting.cache == Cache::Use && twins::join_running(change, &waiting).await? {
            continue;
        }
        let job = life::start(change, &waiting).await?;
        let (problem, mesh) = sqlx::query_as("select body, mesh from problem where input_hash = ?")
            .bind(&job.input_hash)
            .fetch_one(change.sql())
            .await?;
        return Ok(Some(Claim { job, problem, mesh }));
    }
    Ok(None)
}
