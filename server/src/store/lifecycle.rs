//! The lifecycle of one job: its attempts start, and it ends. Every change of status goes through `set_status`.

use serde::{Deserialize, Serialize};
use solver::solution::Warning;

use super::{
    change::Change,
    error::{Damage, Result, StoreError},
    events, results,
    rows::{partial_key, read},
    sizes,
    waiting::{Move, Place},
};
use crate::{
    event::Payload,
    job::{Failure, Job, Reason, ResultAvailable, Status},
    time::Time,
};

/// How a job ends.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Ending {
    /// A terminal status.
    pub status: Status,
    /// Why, unless it succeeded.
    pub reason: Option<Reason>,
    /// What went wrong, if it failed.
    pub failure: Option<Failure>,
    /// The result that is stored with it.
    pub result: ResultAvailable,
    /// The worst warnings of that result.
    #[serde(default)]
    pub warnings: Vec<Warning>,
}

impl Ending {
    /// Canceled, without a result.
    pub fn canceled() -> Self {
        let reason = Some(Reason::UserCancel);
        Ending {
            status: Status::Canceled,
            reason,
            failure: None,
            result: ResultAvailable::None,
            warnings: vec![],
        }
    }

    /// Failed, since what it needs is damaged.
    pub(super) fn damaged(damage: &Damage) -> Self {
        Ending::failed(Reason::Internal, damage.to_string())
    }

    /// Failed, without a result.
    pub fn failed(reason: Reason, detail: impl Into<String>) -> Self {
        let failure = Some(Failure::new(reason, detail));
        Ending {
            status: Status::Failed,
            reason: Some(reason),
            failure,
            result: ResultAvailable::None,
            warnings: vec![],
        }
    }
}

/// Starts an attempt of a queued job; returns the started job.
pub(super) async fn start_attempt(change: &mut Change<'_>, job: &Job) -> Result<Job> {
    let now = change.now().max(job.created_at);
    set_status(change, job, Status::Running).await?;
    sqlx::query(
        "update job set attempt = attempt + 1, started_at = ?, progress = null, result_available = 'none',
                        warnings = null, checksum = null where id = ?",
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

/// Ends a job, with its one `done` event. Jobs coalesced into it are not touched.
pub(super) async fn end_job(change: &mut Change<'_>, job: &Job, ending: &Ending) -> Result<()> {
    assert!(ending.status.is_terminal());
    // lists rely on the fact that no job ends before it was accepted, even if the clock was set back
    let now = change.now().max(job.started_at.unwrap_or(job.created_at));
    let failure = ending
        .failure
        .as_ref()
        .map(serde_json::to_string)
        .transpose()?;
    let warnings = (!ending.warnings.is_empty()).then(|| serde_json::to_string(&ending.warnings));
    let warnings = warnings.transpose()?;
    // the results of finished load steps are kept, whatever the status
    let result = ending.result.max(job.result_available);
    set_status(change, job, ending.status).await?;
    sqlx::query(
        "update job set reason = ?, failure = ?, result_available = ?, warnings = ?, finished_at = ?, coalesced_into = null,
                        solver_version = ?, checksum = null where id = ?",
    )
    .bind(ending.reason.map(<&str>::from))
    .bind(failure)
    .bind(<&str>::from(result))
    .bind(warnings)
    .bind(now.micros())
    .bind(env!("CARGO_PKG_VERSION"))
    .bind(job.key)
    .execute(change.sql())
    .await?;
    match (ending.result, result) {
        // it never ran, so that no pieces were written; thousands of such jobs may be canceled at once
        (ResultAvailable::None, ResultAvailable::None) if job.attempt == 0 => {}
        (ResultAvailable::None, ResultAvailable::None) => {
            // removes pieces that were written for a result that is not kept
            results::remove(change.sql(), job.key).await?;
            results::remove(change.sql(), partial_key(job.key)).await?;
        }
        (ResultAvailable::None, _) => results::keep_partial(change.sql(), job.key).await?,
        _ => results::remove(change.sql(), partial_key(job.key)).await?,
    }
    // the same as is told of it later
    let mut ended = read(change.sql(), job.key).await?;
    sizes::count(change.sql(), job.key).await?;
    if ended.result_key != ended.key {
        sizes::take_over(change.sql(), job.key).await?;
    }
    sizes::add_sizes(change.sql(), std::slice::from_mut(&mut ended)).await?;
    let done = Payload::Done {
        job: Box::new(ended),
    };
    events::append(change.sql(), job.key, job.attempt, &[(now, done)]).await?;
    change.changed(job.key);
    let failure = ending.failure.as_ref();
    let detail = failure.map_or_else(String::new, |failure| failure.detail.clone());
    let seconds = |from: Time, to: Time| (to.micros() - from.micros()) as f64 / 1e6;
    let started = job.started_at.filter(|_| job.status == Status::Running);
    let times = started.map(|at| (seconds(job.created_at, at), seconds(at, now)));
    change.ended(job, times, ending.status, ending.reason, detail);
    Ok(())
}

/// Changes the status of a job, and with it the waiting jobs. Only this function does.
pub(super) async fn set_status(change: &mut Change<'_>, job: &Job, next: Status) -> Result<()> {
    if !job.status.may_become(next) {
        return Err(StoreError::Unexpected(format!(
            "{} cannot go from {:?} to {next:?}",
            job.id, job.status
        )));
    }
    sqlx::query("update job set status = ?, version = version + 1, checksum = null where id = ?")
        .bind(<&str>::from(next))
        .bind(job.key)
        .execute(change.sql())
        .await?;
    change.touched(job.key);
    let place = Place::of(job);
    let owner = place.owner.clone();
    change.move_job(match job.status {
        Status::Running => Move::Stop(owner.clone()),
        _ if job.waits_for_a_worker() => Move::Leave(place.clone()),
        _ => Move::Detach(owner.clone()), // queued: what has ended changes no more
    });
    match next {
        Status::Queued => change.move_job(Move::Enter(place)),
        Status::Running => change.move_job(Move::Start(owner)),
        Status::Succeeded | Status::Failed | Status::Canceled => {}
    }
    Ok(())
}
