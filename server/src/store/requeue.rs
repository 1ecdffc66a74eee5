//! Running jobs back in the queue: when the service stops, and after it has crashed.

use sqlx::SqliteConnection;
use tracing::info;

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
};

impl Store {
    /// Requeues a running job because the service stops, which does not count against its attempts; one that was
    /// asked to stop is canceled instead. Returns its new status; `None` when the attempt is no longer the current one.
    pub async fn requeue_drained(&self, key: i64, attempt: i32) -> Result<Option<Status>> {
        self.control(|| self.try_to_requeue_drained(key, attempt))
            .await
    }

    async fn try_to_requeue_drained(&self, key: i64, attempt: i32) -> Result<Option<Status>> {
        let mut change = self.control_change().await?;
        if !is_current(change.sql(), key, attempt).await? {
            return Ok(None);
        }
        let job = read(change.sql(), key).await?;
        // the client that asked it to stop does not have to wait for the restart
        let status = if self.is_asked_to_stop(&job) {
            end(&mut change, &job, &Ending::canceled()).await?;
            Status::Canceled
        } else {
            requeue(&mut change, &job, Requeue::Drain).await?;
            Status::Queued
        };
        change.commit().await?;
        self.cancels().remove(&key);
        Ok(Some(status))
    }

    /// Requeues the jobs that were running when the service ended; ends those that were asked to stop, and, if the process
    /// died, those whose attempts are used up. To be called before the listener opens. Returns their number.
    pub async fn requeue_interrupted(&self) -> Result<usize> {
        self.control(|| self.try_to_requeue_interrupted()).await
    }

    async fn try_to_requeue_interrupted(&self) -> Result<usize> {
        let mut change = self.control_change().await?;
        let rows = sqlx::query("select * from job where status = 'running'")
            .fetch_all(change.sql())
            .await?;
        if rows.is_empty() {
            return Ok(0); // nothing is written: the disk may be full
        }
        let mut interrupted = vec![];
        for row in &rows {
            let Ok(job) = self.damages.noting(async { from_row(row) }).await else {
                continue; // damaged: the service starts with the others
            };
            // the service that stopped could not store that it requeued it
            match self.was_stopped && !job.cancel_requested {
                true => requeue(&mut change, &job, Requeue::Drain).await?,
                false => {
                    requeue_after_death(&mut change, &job, "the service died with it").await?;
                }
            }
            interrupted.push(job);
        }
        change.commit().await?;
        for Job { id, attempt, .. } in &interrupted {
            info!(job.id = %id, attempt, "job {id} was interrupted when the service last ended");
        }
        Ok(interrupted.len())
    }

    /// The jobs that run, with the numbers of their attempts.
    pub async fn running(&self) -> Result<Vec<(i64, i32)>> {
        let running = sqlx::query_as("select id, attempt from job where status = 'running'");
        let read = async { Ok(running.fetch_all(&self.reader).await?) };
        self.damages.noting(read).await
    }

    /// Requeues a running job whose own process died; ends it if it was asked to stop, or if its attempts are used up.
    /// `how` it died is told to the client then. Returns the jobs that have changed.
    pub async fn requeue_lost(&self, key: i64, attempt: i32, how: &str) -> Result<Vec<i64>> {
        self.control(|| self.try_to_requeue_lost(key, attempt, how))
            .await
    }

    async fn try_to_requeue_lost(&self, key: i64, attempt: i32, how: &str) -> Result<Vec<i64>> {
        let mut change = self.control_change().await?;
        if !is_current(change.sql(), key, attempt).await? {
            return Ok(vec![]);
        }
        let mut job = read(change.sql(), key).await?;
        job.cancel_requested = self.is_asked_to_stop(&job);
        requeue_after_death(&mut change, &job, how).await?;
        let changed = change.commit().await?;
        self.cancels().remove(&key);
        Ok(changed)
    }
}

/// Requeues a job whose process died, or ends it.
async fn requeue_after_death(change: &mut Change<'_>, job: &Job, how: &str) -> Result<()> {
    if job.cancel_requested {
        return end(change, job, &Ending::canceled()).await;
    }
    if job.attempt < job.max_attempts {
        return requeue(change, job, Requeue::WorkerLost).await;
    }
    let deaths = count_deaths(change.sql(), job.key).await? + 1;
    let detail =
        format!("the process died during {deaths} attempts at this job; the last time {how}");
    end(change, job, &Ending::failed(Reason::WorkerLost, detail)).await
}

/// How many attempts at a job ended with the process, before the current one.
async fn count_deaths(tx: &mut SqliteConnection, key: i64) -> Result<i64> {
    let counting = sqlx::query_scalar(
        "select count(*) from event where job_id = ? and type = 'status' and json_extract(body, '$.reason') = ?",
    );
    let lost = <&str>::from(Requeue::WorkerLost);
    Ok(counting.bind(key).bind(lost).fetch_one(tx).await?)
}

/// Puts a running job back in the queue.
async fn requeue(change: &mut Change<'_>, job: &Job, reason: Requeue) -> Result<()> {
    lifecycle::set_status(change, job, Status::Queued).await?;
    // The attempt keeps its number, by which events are distinguished; if it does not count, one more is allowed.
    let one_more = i32::from(reason == Requeue::Drain);
    sqlx::query("update job set max_attempts = max_attempts + ?, checksum = null where id = ?")
        .bind(one_more)
        .bind(job.key)
        .execute(change.sql())
        .await?;
    // its time in the queue begins again, and that of the jobs coalesced into it
    let coalesced = coalescing::coalesced_jobs(change, job.key).await?;
    let now = change.now().micros();
    for key in coalesced.iter().map(|job| job.key).chain([job.key]) {
        sqlx::query(
            "update job set expires_at = ? + cast(queue_ttl_s * 1e6 as integer), checksum = null where id = ?",
        )
        .bind(now)
        .bind(key)
        .execute(change.sql())
        .await?;
        change.touched(key);
    }
    // it no longer runs: a coalesced job of higher priority does not have to wait for it
    coalescing::replace_if_outranked(change, job.key, job.priority).await?;
    let requeued = [(change.now(), Payload::requeued(reason))];
    events::append(change.sql(), job.key, job.attempt, &requeued).await?;
    change.changed(job.key);
    Ok(())
}
