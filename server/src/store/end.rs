//! The end of a job, whoever ends it: its worker, who cancels it, or the clock.

use super::{
    change::Change,
    database::Store,
    error::Result,
    events::{self, LastWords},
    life::{self, Ending},
    parts::Parts,
    results,
    rows::{find, is_current, read},
    twins,
};
use crate::{
    job::{Job, Reason, Status},
    time::Time,
};

/// What asking a job to stop did.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CancelOutcome {
    /// Nobody ran it and it is canceled.
    Canceled(Vec<i64>),
    /// This start of it is running and should stop.
    Requested {
        /// The number of the start.
        attempt: i32,
    },
    /// It had ended.
    AlreadyTerminal,
}

impl Store {
    /// Notes that somebody wants the job to stop; a queued one is canceled at once.
    pub async fn request_cancel(&self, key: i64) -> Result<CancelOutcome> {
        let mut change = self.change().await?;
        let Some(job) = find(change.sql(), key).await? else {
            return Ok(CancelOutcome::AlreadyTerminal); // and deleted since
        };
        let attempt = job.attempt;
        match job.status {
            Status::Queued => {
                end(&mut change, &job, &Ending::canceled()).await?;
                return Ok(CancelOutcome::Canceled(change.commit().await?));
            }
            Status::Running if job.cancel_requested => {}
            Status::Running => {
                sqlx::query(
                    "update job set cancel_requested = 1, version = version + 1 where id = ?",
                )
                .bind(key)
                .execute(change.sql())
                .await?;
                change.commit().await?;
            }
            Status::Succeeded | Status::Failed | Status::Canceled => {
                return Ok(CancelOutcome::AlreadyTerminal);
            }
        }
        Ok(CancelOutcome::Requested { attempt })
    }

    /// Ends this start of a job, with the last that it said and the rest of its result; `None` when the
    /// start is no longer current, because the job was canceled or put back meanwhile.
    pub async fn finish(
        &self,
        key: i64,
        attempt: i32,
        ending: &Ending,
        last: LastWords,
        result: Option<&Parts>,
    ) -> Result<Option<Vec<i64>>> {
        let mut change = self.change().await?;
        if !is_current(change.sql(), key, attempt).await? {
            return Ok(None);
        }
        if !last.lines.is_empty() {
            events::tell(change.sql(), key, attempt, &last.lines, &last.progress).await?;
        }
        if let Some(parts) = result {
            results::write_last(change.sql(), key, parts).await?;
        }
        let job = read(change.sql(), key).await?;
        end(&mut change, &job, ending).await?;
        Ok(Some(change.commit().await?))
    }

    /// Ends jobs that have waited longer than they may, some at a time. A job that another one, already
    /// running, will answer does not wait for a start.
    pub async fn expire_queued(&self, now: Time) -> Result<Vec<i64>> {
        const AT_ONCE: i64 = 100;
        // nearly always there is none: readers do not hold up the writer to find that out
        let some = sqlx::query(LATE)
            .bind(now.micros())
            .bind(1)
            .fetch_optional(&self.reader)
            .await?;
        if some.is_none() {
            return Ok(vec![]);
        }
        let mut change = self.change().await?;
        let late: Vec<i64> = sqlx::query_scalar(LATE)
            .bind(now.micros())
            .bind(AT_ONCE)
            .fetch_all(change.sql())
            .await?;
        for key in late {
            // as it is now: it may have been a twin of one that has just ended
            let job = read(change.sql(), key).await?;
            let detail = format!(
                "it was not started within {} s; see limits.queue_ttl_s",
                job.limits.queue_ttl_s
            );
            end(
                &mut change,
                &job,
                &Ending::failed(Reason::QueueExpired, detail),
            )
            .await?;
        }
        change.commit().await
    }
}

/// Jobs that have waited too long, at most so many.
pub(super) const LATE: &str = "select id from job indexed by job_expiry
     where status = 'queued' and expires_at <= ?
           and (twin_of is null or exists
                (select 1 from job source where source.id = job.twin_of and source.status = 'queued'))
     order by expires_at limit ?";

/// Ends a job with its one `done` event, and its twins with it.
pub(super) async fn end(change: &mut Change<'_>, job: &Job, ending: &Ending) -> Result<()> {
    life::close(change, job, ending).await?;
    twins::settle(change, job).await
}
