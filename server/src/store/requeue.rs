//! Running jobs back in the queue: when the service stops, and after it has crashed.

use super::{
    change::Change,
    coalescing,
    database::Store,
    end::end,
    error::Result,
    events,
    lifecycle::{self, Ending},
    rows::{from_row, is_current, read},
};
use crate::{
    event::{Payload, Requeue},
    job::{Job, Reason, Status},
    time::Time,
};

impl Store {
    /// Requeues a running job because the service stops, which does not count against its attempts; one that was
    /// asked to stop is canceled instead. Returns its new status; `None` when the attempt is no longer the current one.
    pub async fn requeue_drained(&self, key: i64, attempt: i32) -> Result<Option<Status>> {
        let mut change = self.change().await?;
        if !is_current(change.sql(), key, attempt).await? {
            return Ok(None);
        }
        let job = read(change.sql(), key).await?;
        // the client that asked it to stop does not have to wait for the restart
        let status = if job.cancel_requested {
            end(&mut change, &job, &Ending::canceled()).await?;
            Status::Canceled
        } else {
            requeue(&mut change, &job, Requeue::Drain).await?;
            Status::Queued
        };
        change.commit().await?;
        Ok(Some(status))
    }

    /// Requeues the jobs that were running when the process died; ends those that were asked to stop, and those
    /// whose attempts are used up. To be called before the listener opens. Returns their number.
    pub async fn requeue_interrupted(&self) -> Result<usize> {
        let mut change = self.change().await?;
        let rows = sqlx::query("select * from job where status = 'running'")
            .fetch_all(change.sql())
            .await?;
        for row in &rows {
            let job = from_row(row)?;
            if job.cancel_requested {
                end(&mut change, &job, &Ending::canceled()).await?;
            } else if job.attempt >= job.max_attempts {
                let detail = format!(
                    "the process died during each of {} attempts",
                    job.max_attempts
                );
                end(
                    &mut change,
                    &job,
                    &Ending::failed(Reason::WorkerLost, detail),
                )
                .await?;
            } else {
                requeue(&mut change, &job, Requeue::WorkerLost).await?;
            }
        }
        change.commit().await?;
        Ok(rows.len())
    }
}

/// Puts a running job back in the queue.
async fn requeue(change: &mut Change<'_>, job: &Job, reason: Requeue) -> Result<()> {
    lifecycle::set_status(change, job, Status::Queued).await?;
    // The attempt keeps its number, by which events are distinguished; if it does not count, one more is allowed.
    let one_more = i32::from(reason == Requeue::Drain);
    sqlx::query("update job set max_attempts = max_attempts + ? where id = ?")
        .bind(one_more)
        .bind(job.key)
        .execute(change.sql())
        .await?;
    // its time in the queue begins again, and that of the jobs coalesced into it
    sqlx::query("update job set expires_at = ? + cast(queue_ttl_s * 1e6 as integer) where id = ? or coalesced_into = ?")
        .bind(Time::now().micros())
        .bind(job.key)
        .bind(job.key)
        .execute(change.sql())
        .await?;
    // it no longer runs: a coalesced job of higher priority does not have to wait for it
    coalescing::replace_if_outranked(change, job.key, job.priority).await?;
    let requeued = [(Time::now(), Payload::requeued(reason))];
    events::append(change.sql(), job.key, job.attempt, &requeued).await?;
    change.changed(job.key);
    Ok(())
}
