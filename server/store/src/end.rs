//! The end of a job: by its worker, by a cancel, or because it has waited too long.

use parking_lot::MutexGuard;
use std::{collections::HashSet, sync::Arc};

use base::{
    failpoint::{self, Point},
    job::{Job, Reason},
    time::Time,
};
use rusqlite::params;

use super::{
    change::Change,
    coalescing,
    database::{Store, Writer},
    end_job::end_job,
    error::{Result, StoreError},
    events::FinalBatch,
    parts::Parts,
    results,
    rows::JobRow,
    rules::{self, Cancel, Ending},
    sql::Sql,
};

/// The effect of asking a job to stop.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CancelOutcome {
    /// The job was not running, and is canceled; the keys are those of all jobs whose status has changed.
    Canceled(Vec<i64>),
    /// This attempt of the job is running and should stop.
    Requested {
        /// The number of the attempt.
        attempt: i32,
    },
    /// The job had ended before.
    AlreadyTerminal,
}

impl Store {
    /// Records that a client has asked the job to stop; a queued job is canceled at once.
    pub async fn request_cancel(self: &Arc<Self>, key: i64) -> Result<CancelOutcome> {
        self.control(move |writer| request_cancel(writer, key))
            .await
    }

    /// Ends a running job, with its last events and its result. Returns the keys of the jobs whose status has changed;
    /// `None` when this attempt is no longer the current one, because the job was canceled or requeued meanwhile.
    pub async fn finish(
        self: &Arc<Self>,
        key: i64,
        attempt: i32,
        ending: &Ending,
        last: FinalBatch,
        result: Option<&Arc<Parts>>,
    ) -> Result<Option<Vec<i64>>> {
        let (ending, result) = (ending.clone(), result.cloned());
        // the end of a canceled job needs little space
        match result {
            Some(parts) => {
                self.write(move |writer| finish(writer, key, attempt, &ending, &last, Some(&parts)))
                    .await
            }
            None => {
                self.control(move |writer| finish(writer, key, attempt, &ending, &last, None))
                    .await
            }
        }
    }

    /// Whether a client has asked a running job to stop, even if that could not be stored.
    pub(super) fn is_asked_to_stop(&self, job: &Job) -> bool {
        job.cancel_requested || self.cancels().contains(&job.key)
    }

    /// The keys of the running jobs that a client has canceled.
    pub(super) fn cancels(&self) -> MutexGuard<'_, HashSet<i64>> {
        self.cancels.lock()
    }

    /// Ends jobs that have waited longer than allowed, some at a time; returns the keys of the jobs whose status has
    /// changed. A job coalesced into a running job does not wait for a worker, and is left alone.
    pub async fn expire_queued(self: &Arc<Self>, now: Time) -> Result<Vec<i64>> {
        let now = self.by_our_clock(now);
        // nearly always there is none, which a reader finds without occupying the writer
        let some = self.read(move |_, connection| {
            connection.optional_value::<i64>(EXPIRED, params![now.micros(), 1])
        });
        match some.await {
            Ok(None) => Ok(vec![]),
            // the writer meets the same damage, and finds out whether anything can be written
            Ok(Some(_)) | Err(StoreError::Damaged(_)) => {
                self.control(move |writer| end_expired(writer, now)).await
            }
            Err(cause) => Err(cause),
        }
    }
}

fn request_cancel(writer: &Writer<'_>, key: i64) -> Result<CancelOutcome> {
    let mut change = writer.control_change()?;
    let Some(job) = change.find(key)? else {
        return Ok(CancelOutcome::AlreadyTerminal); // and was deleted since
    };
    let attempt = job.attempt;
    match rules::canceling(&job) {
        Cancel::End => {
            end(&mut change, key, &Ending::canceled())?;
            return Ok(CancelOutcome::Canceled(change.commit()?));
        }
        Cancel::Asked => {}
        Cancel::Ask => {
            // kept even if it cannot be stored: no later result makes the job succeed
            writer.store.cancels().insert(key);
            change.set(key, JobRow::ask_to_stop)?;
            change.commit()?;
        }
        Cancel::TooLate => return Ok(CancelOutcome::AlreadyTerminal),
    }
    Ok(CancelOutcome::Requested { attempt })
}

fn finish(
    writer: &Writer<'_>,
    key: i64,
    attempt: i32,
    ending: &Ending,
    last: &FinalBatch,
    result: Option<&Parts>,
) -> Result<Option<Vec<i64>>> {
    let mut change = match result {
        Some(_) => writer.change()?,
        None => writer.control_change()?,
    };
    if !change.is_current(key, attempt)? {
        return Ok(None);
    }
    if let Some(parts) = result {
        results::attach(&mut change, key, parts)?;
    }
    if !last.events.is_empty() {
        change.append_with_progress(key, &last.events, &last.progress)?;
    }
    let job = change.read(key)?;
    if writer.store.is_asked_to_stop(&job) {
        end(&mut change, key, &ending.after_a_request_to_stop())?
    } else {
        end(&mut change, key, ending)?
    }
    if failpoint::fails(Point::Ended, job.id) {
        return Err(StoreError::Full);
    }
    let changed = change.commit()?;
    writer.store.cancels().remove(&key);
    Ok(Some(changed))
}

fn end_expired(writer: &Writer<'_>, now: Time) -> Result<Vec<i64>> {
    const AT_ONCE: i64 = 100;
    let mut change = writer.control_change()?;
    let expired: Vec<i64> = change
        .sql()?
        .values(EXPIRED, params![now.micros(), AT_ONCE])?;
    for key in expired {
        // as it is now: it may have been coalesced into one that has just ended
        let Ok(job) = writer.store.damages.noting(change.read(key)) else {
            continue; // damaged: others still end
        };
        let detail = format!(
            "the job was not started within {} s; see limits.queue_ttl_s",
            job.limits.queue_ttl_s
        );
        end(
            &mut change,
            key,
            &Ending::failed(Reason::QueueExpired, detail),
        )?;
    }
    change.commit()
}

/// The keys of the jobs that have waited too long, up to a limit.
pub(super) const EXPIRED: &str = "select id from job indexed by job_expiry
     where status = 'queued' and expires_at <= ?
           and (coalesced_into is null or exists
                (select 1 from job primary_job where primary_job.id = job.coalesced_into and primary_job.status = 'queued'))
     order by expires_at limit ?";

/// Ends a job; the jobs coalesced into it end, too, or the first of them takes its place.
pub(super) fn end(change: &mut Change<'_>, key: i64, ending: &Ending) -> Result<()> {
    end_job(change, key, ending)?;
    coalescing::end_coalesced(change, key)
}
