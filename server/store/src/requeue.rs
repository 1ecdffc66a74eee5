//! Puts running jobs back in the queue: when the service stops, and after it has crashed.

use std::sync::Arc;

use base::{
    event::Requeue,
    job::{Job, Reason, Status},
};
use rusqlite::{Connection, params};
use tracing::{info, warn};

use super::{
    change::Change,
    coalescing,
    database::{Store, Writer},
    end::end,
    error::Result,
    rows::from_row,
    rules::{self, Ending, Interrupted},
    sql::Sql,
};

impl Store {
    /// Requeues a running job because the service stops, which does not count against the job's attempts; a job that
    /// was asked to stop is canceled instead. Returns the job's new status; `None` when the attempt is no longer the
    /// current one.
    pub async fn requeue_drained(
        self: &Arc<Self>,
        key: i64,
        attempt: i32,
    ) -> Result<Option<Status>> {
        self.control(move |writer| requeue_drained(writer, key, attempt))
            .await
    }

    /// Requeues the jobs that were running here when the service ended; ends those that were asked to stop, and, if the
    /// process died, those whose attempts are used up. Must be called before the listener opens. Returns the number of
    /// these jobs.
    pub async fn requeue_interrupted(self: &Arc<Self>) -> Result<usize> {
        self.control(requeue_interrupted).await
    }

    /// The keys of the running jobs, with the numbers of their attempts.
    pub async fn running(self: &Arc<Self>) -> Result<Vec<(i64, i32)>> {
        self.read(|_, connection| {
            let running = "select id, attempt from job where status = 'running'";
            connection.rows(running, (), |row| Ok(row.try_into()?))
        })
        .await
    }

    /// Requeues a running job whose worker process died; ends it if it was asked to stop, or if its attempts are used
    /// up. In the last case `how` tells the client how the process died. Returns the keys of the jobs whose status has
    /// changed.
    pub async fn requeue_lost(
        self: &Arc<Self>,
        key: i64,
        attempt: i32,
        how: &str,
    ) -> Result<Vec<i64>> {
        let how = how.to_owned();
        self.control(move |writer| requeue_lost(writer, key, attempt, &how))
            .await
    }
}

fn requeue_drained(writer: &Writer<'_>, key: i64, attempt: i32) -> Result<Option<Status>> {
    let mut change = writer.control_change()?;
    if !change.is_current(key, attempt)? {
        return Ok(None);
    }
    let job = change.read(key)?;
    // the client that asked it to stop does not have to wait for the restart
    let stop = writer.store.is_asked_to_stop(&job);
    interrupt(&mut change, &job, Requeue::Drain, stop, "")?;
    let status = change.read(key)?.status;
    change.commit()?;
    writer.store.cancels().remove(&key);
    Ok(Some(status))
}

fn requeue_interrupted(writer: &Writer<'_>) -> Result<usize> {
    let mut change = writer.control_change()?;
    // a job of a worker elsewhere goes on there, unless it was asked to stop
    let running = "select * from job where status = 'running' and (cancel_requested
        or not exists (select 1 from lease where lease.job = job.id and lease.attempt = job.attempt))";
    let running = change.sql()?.rows(running, (), |row| Ok(from_row(row)))?;
    if running.is_empty() {
        return Ok(0); // nothing is written: the disk may be full
    }
    let mut interrupted = vec![];
    for job in running {
        let Ok(job) = writer.store.damages.noting(job) else {
            continue; // damaged: the service starts with the others
        };
        // the service that stopped could not store that it requeued it
        let why = if writer.store.was_stopped {
            Requeue::Drain
        } else {
            Requeue::WorkerLost
        };
        let (stop, how) = (job.cancel_requested, "the service died with it");
        interrupt(&mut change, &job, why, stop, how)?;
        interrupted.push(job);
    }
    change.commit()?;
    for Job { id, attempt, .. } in &interrupted {
        if writer.store.was_stopped {
            info!(job.id = %id, attempt, "job {id} was interrupted when the service last ended");
        } else {
            warn!(job.id = %id, attempt, "job {id} was interrupted: the service died while it was solved");
        }
    }
    Ok(interrupted.len())
}

fn requeue_lost(writer: &Writer<'_>, key: i64, attempt: i32, how: &str) -> Result<Vec<i64>> {
    let mut change = writer.control_change()?;
    if !change.is_current(key, attempt)? {
        return Ok(vec![]);
    }
    let job = change.read(key)?;
    let stop = writer.store.is_asked_to_stop(&job);
    interrupt(&mut change, &job, Requeue::WorkerLost, stop, how)?;
    let changed = change.commit()?;
    writer.store.cancels().remove(&key);
    Ok(changed)
}

/// Requeues a job that was interrupted, or ends it. `stop`: whether a client has asked it to stop; `how`: how its
/// process died, if it did.
fn interrupt(
    change: &mut Change<'_>,
    job: &Job,
    why: Requeue,
    stop: bool,
    how: &str,
) -> Result<()> {
    match rules::interrupted(job, why, stop) {
        Interrupted::Cancel => end(change, job.key, &Ending::canceled()),
        Interrupted::Requeue(why) => requeue(change, job.key, why),
        Interrupted::Fail => {
            let deaths = count_deaths(change.sql()?, job.key)? + 1;
            let detail = format!(
                "the process died during {deaths} attempts to solve this job; the last time {how}"
            );
            end(change, job.key, &Ending::failed(Reason::WorkerLost, detail))
        }
    }
}

/// The number of earlier attempts at a job in which the process died.
fn count_deaths(tx: &Connection, key: i64) -> Result<i64> {
    let lost = <&str>::from(Requeue::WorkerLost);
    tx.value(
        "select count(*) from event where job_id = ? and type = 'status' and json_extract(body, '$.reason') = ?",
        params![key, lost],
    )
}

/// Puts a running job back in the queue, for the reason `why`.
fn requeue(change: &mut Change<'_>, key: i64, why: Requeue) -> Result<()> {
    let now = change.now();
    change.update(key, |row| row.requeue(why, now))?;
    // as its time in the queue begins again, so does that of the jobs coalesced into it
    for job in coalescing::coalesced_jobs(change, key)? {
        change.set(job.key, |row| row.waits_from(now))?;
    }
    // it no longer runs: a coalesced job of higher priority does not have to wait for it
    coalescing::replace_if_outranked(change, key)
}
