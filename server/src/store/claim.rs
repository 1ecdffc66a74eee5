//! The next job of the queue, claimed for a worker.

use super::{
    change::Change, coalescing, database::Store, error::Result, lifecycle, rows::read,
    submission::Claim,
};
use crate::job::Cache;

impl Store {
    /// Starts an attempt of the next job of the queue: highest priority first, then in order of arrival. Jobs
    /// before it for which there is a result by now are answered. Also returns all jobs that have changed.
    pub async fn claim_next(&self) -> Result<(Option<Claim>, Vec<i64>)> {
        let mut change = self.change().await?;
        let claim = claim(&mut change).await?;
        let changed = change.commit().await?;
        Ok((claim, changed))
    }
}

/// The next job of the queue. The index is named because the planner, which does not know how many jobs there are,
/// would sort all waiting ones instead.
pub(super) const NEXT: &str = "select id from job indexed by job_queue
     where status = 'queued' and coalesced_into is null order by priority desc, id limit 1";

/// Claims within a transaction. The next job waits until it fits into the memory budget, and those after it wait with
/// it, also if they would fit: the order is strict, so that no large job is overtaken for ever. Running jobs end within
/// their time limits, and each of them alone fits.
pub(super) async fn claim(change: &mut Change<'_>) -> Result<Option<Claim>> {
    /// With more jobs than this, one transaction would take too long.
    const MOST_ANSWERED: usize = 100;
    for _ in 0..MOST_ANSWERED {
        let key: Option<i64> = sqlx::query_scalar(NEXT)
            .fetch_optional(change.sql())
            .await?;
        let Some(key) = key else { return Ok(None) };
        let waiting = read(change.sql(), key).await?;
        // there may be a result by now
        if waiting.cache == Cache::Use
            && let Some(source) = coalescing::earlier_result(change, &waiting.input_hash).await?
        {
            coalescing::answer(change, &waiting, &source).await?;
            coalescing::end_coalesced(change, &waiting).await?;
            continue;
        }
        if waiting.cache == Cache::Use
            && coalescing::coalesce_into_running(change, &waiting).await?
        {
            continue;
        }
        let needed: Option<i64> =
            sqlx::query_scalar("select memory_bytes from problem where input_hash = ?")
                .bind(&waiting.input_hash)
                .fetch_one(change.sql())
                .await?;
        let needed = needed.and_then(|bytes| u64::try_from(bytes).ok());
        // given back if this transaction is rolled back
        let Some(memory) = change.budget().reserve(needed) else {
            return Ok(None);
        };
        let job = lifecycle::start_attempt(change, &waiting).await?;
        let (problem, mesh) = sqlx::query_as("select body, mesh from problem where input_hash = ?")
            .bind(&job.input_hash)
            .fetch_one(change.sql())
            .await?;
        return Ok(Some(Claim {
            job,
            problem,
            mesh,
            memory,
        }));
    }
    Ok(None)
}
