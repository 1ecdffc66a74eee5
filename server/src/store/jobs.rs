//! Jobs: accepted, claimed, ended, listed. Every change of status goes through `change`.

use std::collections::BTreeMap;

use sqlx::{QueryBuilder, Sqlite, SqliteConnection};

use super::{
    Result, Store, StoreError, events, meshes,
    rows::{from_row, place, read},
};
use crate::{
    event::{Payload, Requeue},
    job::{Failure, Job, JobId, Reason, ResultAvailable, Status},
    time::Time,
};

/// A job that is about to be accepted.
#[derive(Clone, Debug)]
pub struct NewJob {
    /// A name for people.
    pub name: Option<String>,
    /// Labels for programs.
    pub labels: BTreeMap<String, String>,
    /// −10 … 10.
    pub priority: i32,
    /// The problem's title, exactly.
    pub title: Option<String>,
    /// Fingerprint of the problem.
    pub input_hash: String,
    /// The problem as JSON, without its title.
    pub problem: String,
    /// The stored mesh that it names.
    pub mesh: Option<String>,
}

/// A job that a worker has just taken.
#[derive(Debug)]
pub struct Claim {
    /// The job, running.
    pub job: Job,
    /// Its problem as JSON, without the title.
    pub problem: String,
    /// The stored mesh that it names.
    pub mesh: Option<String>,
    /// The event that says so.
    pub seq: i64,
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
    /// What was stored before.
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

/// What asking a job to stop did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CancelOutcome {
    /// Nobody ran it and it is canceled, by the event of this number.
    Canceled(i64),
    /// This start of it is running and should stop.
    Requested {
        /// The number of the start.
        attempt: i32,
    },
    /// It had ended.
    AlreadyTerminal,
}

impl Store {
    /// Accepts a job, unless `max_queued` are waiting. It is on the disk when this returns.
    pub async fn insert_job(&self, new: &NewJob, max_queued: u32) -> Result<Job> {
        let mut tx = self.begin().await?;
        let full: bool = sqlx::query_scalar(
            "select count(*) >= ?1 from (select 1 from job where status = 'queued' limit ?1)",
        )
        .bind(max_queued)
        .fetch_one(&mut *tx)
        .await?;
        if full {
            return Err(StoreError::QueueFull);
        }
        meshes::require(&mut tx, new.mesh.as_deref()).await?;
        sqlx::query(
            "insert into problem (input_hash, body, mesh) values (?, ?, ?) on conflict do nothing",
        )
        .bind(&new.input_hash)
        .bind(&new.problem)
        .bind(&new.mesh)
        .execute(&mut *tx)
        .await?;
        let now = Time::now();
        let key: i64 = sqlx::query_scalar(
            "insert into job (uuid, status, name, title, labels, priority, input_hash, created_at)
             values (?, 'queued', ?, ?, ?, ?, ?, ?) returning id",
        )
        .bind(JobId::new().0.to_string())
        .bind(&new.name)
        .bind(&new.title)
        .bind(serde_json::to_string(&new.labels)?)
        .bind(new.priority)
        .bind(&new.input_hash)
        .bind(now.micros())
        .fetch_one(&mut *tx)
        .await?;
        events::append(&mut tx, key, 0, &[(now, Payload::status(Status::Queued))]).await?;
        let mut job = read(&mut tx, key).await?;
        place(&mut tx, std::slice::from_mut(&mut job)).await?;
        tx.commit().await?;
        Ok(job)
    }

    /// The job of that name.
    pub async fn job(&self, id: JobId) -> Result<Option<Job>> {
        let mut connection = self.reader.acquire().await?;
        let row = sqlx::query("select * from job where uuid = ?")
            .bind(id.0.to_string())
            .fetch_optional(&mut *connection)
            .await?;
        let Some(row) = row else { return Ok(None) };
        let mut job = from_row(&row)?;
        place(&mut connection, std::slice::from_mut(&mut job)).await?;
        Ok(Some(job))
    }

    /// The title of a job, and its problem as JSON without it.
    pub async fn problem(&self, key: i64) -> Result<(Option<String>, String)> {
        Ok(sqlx::query_as(
            "select job.title, problem.body from job join problem on problem.input_hash = job.input_hash
             where job.id = ?",
        )
        .bind(key)
        .fetch_one(&self.reader)
        .await?)
    }

    /// Whether the job is terminal, and its `done` so among its events.
    pub async fn has_ended(&self, key: i64) -> Result<bool> {
        let status: String = sqlx::query_scalar("select status from job where id = ?")
            .bind(key)
            .fetch_one(&self.reader)
            .await?;
        Ok(Status::parse(&status).is_some_and(Status::is_terminal))
    }

    /// Jobs of these statuses (none: all), newest first, that arrived before the one numbered
    /// `before`.
    pub async fn jobs(
        &self,
        statuses: &[Status],
        before: Option<i64>,
        limit: i64,
    ) -> Result<Vec<Job>> {
        let mut query = QueryBuilder::<Sqlite>::new("select * from job where true");
        if !statuses.is_empty() {
            query.push(" and status in (");
            let mut list = query.separated(", ");
            statuses.iter().for_each(|status| {
                list.push_bind(status.as_str());
            });
            query.push(")");
        }
        if let Some(before) = before {
            query.push(" and id < ").push_bind(before);
        }
        query.push(" order by id desc limit ").push_bind(limit);
        let mut connection = self.reader.acquire().await?;
        let rows = query.build().fetch_all(&mut *connection).await?;
        let mut jobs = rows.iter().map(from_row).collect::<Result<Vec<Job>>>()?;
        place(&mut connection, &mut jobs).await?;
        Ok(jobs)
    }

    /// The next job of the queue, now running; highest priority first, then in order of arrival.
    pub async fn claim_next(&self) -> Result<Option<Claim>> {
        let mut tx = self.begin().await?;
        let now = Time::now();
        let row = sqlx::query(
            "update job set status = 'running', attempt = attempt + 1, version = version + 1, started_at = ?,
                            progress = null
             where id = (select id from job where status = 'queued' order by priority desc, id limit 1)
             returning *",
        )
        .bind(now.micros())
        .fetch_optional(&mut *tx)
        .await?;
        let Some(row) = row else { return Ok(None) };
        let job = from_row(&row)?;
        let (problem, mesh) = sqlx::query_as("select body, mesh from problem where input_hash = ?")
            .bind(&job.input_hash)
            .fetch_one(&mut *tx)
            .await?;
        let started = [(now, Payload::status(Status::Running))];
        let seq = events::append(&mut tx, job.key, job.attempt, &started).await?;
        tx.commit().await?;
        Ok(Some(Claim {
            job,
            problem,
            mesh,
            seq,
        }))
    }

    /// Notes that somebody wants the job to stop; a queued one is canceled at once.
    pub async fn request_cancel(&self, key: i64) -> Result<CancelOutcome> {
        let mut tx = self.begin().await?;
        let job = read(&mut tx, key).await?;
        let requested = CancelOutcome::Requested {
            attempt: job.attempt,
        };
        let outcome = match job.status {
            Status::Queued => {
                CancelOutcome::Canceled(end(&mut tx, &job, &Ending::canceled()).await?)
            }
            Status::Running if job.cancel_requested => requested,
            Status::Running => {
                sqlx::query(
                    "update job set cancel_requested = 1, version = version + 1 where id = ?",
                )
                .bind(key)
                .execute(&mut *tx)
                .await?;
                requested
            }
            Status::Succeeded | Status::Failed | Status::Canceled => CancelOutcome::AlreadyTerminal,
        };
        tx.commit().await?;
        Ok(outcome)
    }

    /// Ends this start of a job, and gives the number of its last event; `None` when the start is
    /// no longer current, because the job was canceled or put back meanwhile.
    pub async fn finish(&self, key: i64, attempt: i32, ending: &Ending) -> Result<Option<i64>> {
        let mut tx = self.begin().await?;
        if !is_current(&mut tx, key, attempt).await? {
            return Ok(None);
        }
        let job = read(&mut tx, key).await?;
        let seq = end(&mut tx, &job, ending).await?;
        tx.commit().await?;
        Ok(Some(seq))
    }

    /// Puts a running job back for a drain, which does not count against it; one that was asked to
    /// stop is canceled instead. Gives its new status; `None` when the start is no longer current.
    pub async fn requeue_drained(&self, key: i64, attempt: i32) -> Result<Option<Status>> {
        let mut tx = self.begin().await?;
        if !is_current(&mut tx, key, attempt).await? {
            return Ok(None);
        }
        let job = read(&mut tx, key).await?;
        // Somebody who asked it to stop is not made to wait for the restart.
        let status = if job.cancel_requested {
            end(&mut tx, &job, &Ending::canceled()).await?;
            Status::Canceled
        } else {
            requeue(&mut tx, &job, Requeue::Drain).await?;
            Status::Queued
        };
        tx.commit().await?;
        Ok(Some(status))
    }

    /// Takes care of jobs that were running when the process died: back to the queue, or to their
    /// end when somebody wanted that or when too many starts were lost. Before the listener opens.
    pub async fn requeue_interrupted(&self) -> Result<usize> {
        let mut tx = self.begin().await?;
        let rows = sqlx::query("select * from job where status = 'running'")
            .fetch_all(&mut *tx)
            .await?;
        for row in &rows {
            let job = from_row(row)?;
            if job.cancel_requested {
                end(&mut tx, &job, &Ending::canceled()).await?;
            } else if job.attempt >= job.max_attempts {
                let detail = format!(
                    "the process died during each of {} starts",
                    job.max_attempts
                );
                end(&mut tx, &job, &Ending::failed(Reason::WorkerLost, detail)).await?;
            } else {
                requeue(&mut tx, &job, Requeue::WorkerLost).await?;
            }
        }
        tx.commit().await?;
        Ok(rows.len())
    }
}

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

/// Ends a job with its one `done` event. The last word of a transaction.
async fn end(tx: &mut SqliteConnection, job: &Job, ending: &Ending) -> Result<i64> {
    debug_assert!(ending.status.is_terminal());
    let now = Time::now();
    let failure = ending
        .failure
        .as_ref()
        .map(serde_json::to_string)
        .transpose()?;
    change(tx, job, ending.status).await?;
    sqlx::query("update job set reason = ?, failure = ?, result_available = ?, finished_at = ? where id = ?")
        .bind(ending.reason.map(Reason::as_str))
        .bind(failure)
        .bind(ending.result.as_str())
        .bind(now.micros())
        .bind(job.key)
        .execute(&mut *tx)
        .await?;
    if ending.result == ResultAvailable::None {
        // Pieces of a result that came too late.
        sqlx::query("delete from result_part where job_id = ?")
            .bind(job.key)
            .execute(&mut *tx)
            .await?;
    }
    let done = Payload::Done {
        job: Box::new(read(tx, job.key).await?),
    };
    events::append(tx, job.key, job.attempt, &[(now, done)]).await
}

async fn requeue(tx: &mut SqliteConnection, job: &Job, why: Requeue) -> Result<i64> {
    change(tx, job, Status::Queued).await?;
    if why == Requeue::Drain {
        // The start keeps its number, so that events tell starts apart, but is given back.
        sqlx::query("update job set max_attempts = max_attempts + 1 where id = ?")
            .bind(job.key)
            .execute(&mut *tx)
            .await?;
    }
    events::append(
        tx,
        job.key,
        job.attempt,
        &[(Time::now(), Payload::requeued(why))],
    )
    .await
}

/// The one place where a status changes, apart from the claim.
async fn change(tx: &mut SqliteConnection, job: &Job, next: Status) -> Result<()> {
    if !job.status.may_become(next) {
        return Err(StoreError::Corrupt(format!(
            "{} cannot go from {:?} to {next:?}",
            job.id, job.status
        )));
    }
    sqlx::query("update job set status = ?, version = version + 1 where id = ?")
        .bind(next.as_str())
        .bind(job.key)
        .execute(tx)
        .await?;
    Ok(())
}
