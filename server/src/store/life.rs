//! The life of one job: started, and ended. Every change of status goes through `change`.

use super::{
    change::Change,
    error::{Result, StoreError},
    events,
    line::Move,
    results,
    rows::{read, running},
};
use crate::{
    event::Payload,
    job::{Failure, Job, Reason, ResultAvailable, Status},
    time::Time,
};

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
    .bind(ending.reason.map(<&str>::from))
    .bind(failure)
    .bind(<&str>::from(result))
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

/// The one place where a status changes, and with it the line.
pub(super) async fn change(change: &mut Change<'_>, job: &Job, next: Status) -> Result<()> {
    if !job.status.may_become(next) {
        return Err(StoreError::Corrupt(format!(
            "{} cannot go from {:?} to {next:?}",
            job.id, job.status
        )));
    }
    sqlx::query("update job set status = ?, version = version + 1 where id = ?")
        .bind(<&str>::from(next))
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
