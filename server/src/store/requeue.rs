//! Running jobs back in the queue: when the service stops, and after it has crashed.

use sqlx::SqliteConnection;
use tracing::info;

use super::{
    change::Change,
    coalescing,
    database::Store,
    end::end,
    error::Result,
    rows::from_row,
    rules::{self, Ending, Interrupted},
};
use crate::{
    event::Requeue,
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
        if !change.is_current(key, attempt).await? {
            return Ok(None);
        }
        let job = change.read(key).await?;
        // the client that asked it to stop does not have to wait for the restart
        let stop = self.is_asked_to_stop(&job);
        interrupt(&mut change, &job, Requeue::Drain, stop, "").await?;
        let status = change.read(key).await?.status;
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
            .fetch_all(change.sql().await?)
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
            let why = match self.was_stopped {
                true => Requeue::Drain,
                false => Requeue::WorkerLost,
            };
            let (stop, how) = (job.cancel_requested, "the service died with it");
            interrupt(&mut change, &job, why, stop, how).await?;
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
        if !change.is_current(key, attempt).await? {
            return Ok(vec![]);
        }
        let job = change.read(key).await?;
        let stop = self.is_asked_to_stop(&job);
        interrupt(&mut change, &job, Requeue::WorkerLost, stop, how).await?;
        let changed = change.commit().await?;
        self.cancels().remove(&key);
        Ok(changed)
    }
}

/// Requeues a job that was interrupted, or ends it. `stop`: a client has asked it to stop; `how`: in which way its process
/// died, if it did.
async fn interrupt(
    change: &mut Change<'_>,
    job: &Job,
    why: Requeue,
    stop: bool,
    how: &str,
) -> Result<()> {
    match rules::interrupted(job, why, stop) {
        Interrupted::Cancel => end(change, job.key, &Ending::canceled()).await,
        Interrupted::Requeue(why) => requeue(change, job.key, why).await,
        Interrupted::Fail => {
            let deaths = count_deaths(change.sql().await?, job.key).await? + 1;
            let detail = format!(
                "the process died during {deaths} attempts to solve this job; the last time {how}"
            );
            end(change, job.key, &Ending::failed(Reason::WorkerLost, detail)).await
        }
    }
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
async fn requeue(change: &mut Change<'_>, key: i64, why: Requeue) -> Result<()> {
    let now = change.now();
    change.update(key, |row| row.requeue(why, now)).await?;
    // as its time in the queue begins again, so does that of the jobs coalesced into it
    for job in coalescing::coalesced_jobs(change, key).await? {
        change.set(job.key, |row| row.waits_from(now)).await?;
    }
    // it no longer runs: a coalesced job of higher priority does not have to wait for it
    coalescing::replace_if_outranked(change, key).await
}
