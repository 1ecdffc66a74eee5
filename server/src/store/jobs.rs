//! The life of a job: claimed, ended, put back. Every change of status goes through `change`.

use sqlx::SqliteConnection;

use super::{
    Result, Store, StoreError,
    change::Change,
    events,
    line::Move,
    results::{self, Parts, running},
    rows::{find, from_row, read},
    twins,
};
use crate::{
    event::{Payload, Requeue},
    job::{Cache, Failure, Job, Progress, Reason, ResultAvailable, Status},
    time::Time,
};

/// A job that a worker has just taken.
#[derive(Debug)]
pub struct Claim {
    /// The job, running.
    pub job: Job,
    /// Its problem as JSON, without the title.
    pub problem: String,
    /// The stored mesh that it names.
    pub mesh: Option<String>,
}

/// How a running job ends.
#[derive(Clone, Debug)]
pub struct Ending {
    /// A terminal status.
    pub status: Status,
    /// Why, unless it succeeded.
    pub reason: Option<Reason>,
    /// What went wrong, if it failed.
    pub failure: Option<Failure>,
    /// What is stored with it.
    pub result: ResultAvailable,
}

impl Ending {
    /// Canceled, with nothing to show.
    pub fn canceled() -> Self {
        let reason = Some(Reason::UserCancel);
        Ending {
            status: Status::Canceled,
            reason,
            failure: None,
            result: ResultAvailable::None,
        }
    }

    /// Failed, with nothing to show.
    pub fn failed(reason: Reason, detail: impl Into<String>) -> Self {
        let failure = Some(Failure::new(reason, detail));
        Ending {
            status: Status::Failed,
            reason: Some(reason),
            failure,
            result: ResultAvailable::None,
        }
    }
}

/// The last that a solver has said, with what it amounts to.
#[derive(Clone, Debug, Default)]
pub struct LastWords {
    /// Events not yet written.
    pub lines: Vec<(Time, Payload)>,
    /// How far it has come.
    pub progress: Progress,
}

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
    /// The next job of the queue, now running; highest priority first, then in order of arrival.
    /// Jobs before it that a result has come for are answered; all that have changed come with it.
    pub async fn claim_next(&self) -> Result<(Option<Claim>, Vec<i64>)> {
        let mut change = self.change().await?;
        let claim = claim(&mut change).await?;
        let changed = change.commit().await?;
        Ok((claim, changed))
    }

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

    /// Puts a running job back for a drain, which does not count against it; one that was asked to
    /// stop is canceled instead. Gives its new status; `None` when the start is no longer current.
    pub async fn requeue_drained(&self, key: i64, attempt: i32) -> Result<Option<Status>> {
        let mut change = self.change().await?;
        if !is_current(change.sql(), key, attempt).await? {
            return Ok(None);
        }
        let job = read(change.sql(), key).await?;
        // Somebody who asked it to stop is not made to wait for the restart.
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

    /// Takes care of jobs that were running when the process died: back to the queue, or to their
    /// end when somebody wanted that or when too many starts were lost. Before the listener opens.
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
                    "the process died during each of {} starts",
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

/// Whether this start of the job still has the word.
pub(super) async fn is_current(tx: &mut SqliteConnection, key: i64, attempt: i32) -> Result<bool> {
    Ok(sqlx::query_scalar(
        "select exists (select 1 from job where id = ? and status = 'running' and attempt = ?)",
    )
    .bind(key)
    .bind(attempt)
    .fetch_one(tx)
    .await?)
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
        let job = start(change, &waiting).await?;
        let (problem, mesh) = sqlx::query_as("select body, mesh from problem where input_hash = ?")
            .bind(&job.input_hash)
            .fetch_one(change.sql())
            .await?;
        return Ok(Some(Claim { job, problem, mesh }));
    }
    Ok(None)
}

/// A start of a queued job.
pub(super) async fn start(change: &mut Change<'_>, job: &Job) -> Result<Job> {
    let now = Time::now();
    self::change(change, job, Status::Running).await?;
    sqlx::query(
        "update job set attempt = attempt + 1, started_at = ?, progress = null, result_available = 'none'
         where id = ?",
    )
    .bind(now.micros())
    .bind(job.key)
    .execute(change.sql())
    .await?;
    let job = read(change.sql(), job.key).await?;
    let started = [(now, Payload::status(Status::Running))];
    events::append(change.sql(), job.key, job.attempt, &started).await?;
    change.changed(job.key);
    Ok(job)
}

/// Ends a job with its one `done` event, and its twins with it.
async fn end(change: &mut Change<'_>, job: &Job, ending: &Ending) -> Result<()> {
    close(change, job, ending).await?;
    twins::settle(change, job).await
}

/// The end itself. The last word on a job.
pub(super) async fn close(change: &mut Change<'_>, job: &Job, ending: &Ending) -> Result<()> {
    debug_assert!(ending.status.is_terminal());
    // Lists count on it that nobody ends before it was accepted, also where the clock was set back.
    let now = Time::now().max(job.created_at);
    let failure = ending
        .failure
        .as_ref()
        .map(serde_json::to_string)
        .transpose()?;
    // what finished load steps have left stays, however the job ends
    let result = ending.result.max(job.result_available);
    self::change(change, job, ending.status).await?;
    sqlx::query(
        "update job set reason = ?, failure = ?, result_available = ?, finished_at = ?, twin_of = null,
                        solver_version = ? where id = ?",
    )
    .bind(ending.reason.map(Reason::as_str))
    .bind(failure)
    .bind(result.as_str())
    .bind(now.micros())
    .bind(env!("CARGO_PKG_VERSION"))
    .bind(job.key)
    .execute(change.sql())
    .await?;
    match (ending.result, result) {
        (ResultAvailable::None, ResultAvailable::None) => {
            // Pieces of a result that came too late.
            results::remove(change.sql(), job.key).await?;
            results::remove(change.sql(), running(job.key)).await?;
        }
        (ResultAvailable::None, _) => results::promote(change.sql(), job.key).await?,
        _ => results::remove(change.sql(), running(job.key)).await?,
    }
    let done = Payload::Done {
        job: Box::new(read(change.sql(), job.key).await?),
    };
    events::append(change.sql(), job.key, job.attempt, &[(now, done)]).await?;
    change.changed(job.key);
    Ok(())
}

async fn requeue(change: &mut Change<'_>, job: &Job, why: Requeue) -> Result<()> {
    self::change(change, job, Status::Queued).await?;
    // The start keeps its number, so that events tell starts apart, but a drain gives it back.
    let given_back = i32::from(why == Requeue::Drain);
    sqlx::query("update job set max_attempts = max_attempts + ? where id = ?")
        .bind(given_back)
        .bind(job.key)
        .execute(change.sql())
        .await?;
    // its waiting begins anew, and that of the jobs that wait for it
    sqlx::query("update job set expires_at = ? + cast(queue_ttl_s * 1e6 as integer) where id = ? or twin_of = ?")
        .bind(Time::now().micros())
        .bind(job.key)
        .bind(job.key)
        .execute(change.sql())
        .await?;
    // it runs no more: a twin of a higher priority need not wait for it
    twins::overtake(change, job.key, job.priority).await?;
    let back = [(Time::now(), Payload::requeued(why))];
    events::append(change.sql(), job.key, job.attempt, &back).await?;
    change.changed(job.key);
    Ok(())
}

/// The one place where a status changes, and with it the line.
async fn change(change: &mut Change<'_>, job: &Job, next: Status) -> Result<()> {
    if !job.status.may_become(next) {
        return Err(StoreError::Corrupt(format!(
            "{} cannot go from {:?} to {next:?}",
            job.id, job.status
        )));
    }
    sqlx::query("update job set status = ?, version = version + 1 where id = ?")
        .bind(next.as_str())
        .bind(job.key)
        .execute(change.sql())
        .await?;
    let (priority, key) = (job.priority, job.key);
    if job.waits_in_line() {
        change.moves(Move::Leave { priority, key });
    } else if job.status == Status::Queued {
        change.moves(Move::Part);
    }
    if next == Status::Queued {
        change.moves(Move::Enter { priority, key });
    }
    Ok(())
}
