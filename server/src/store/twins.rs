//! Jobs of one input: answered by an earlier result, or by the end of one that is at work on it, their source,
//! whose twins they are until then.

use super::{
    change::Change,
    error::Result,
    life::{self, Ending},
    line::Move,
    rows::{from_row, read},
    submission::NewJob,
};
use crate::job::{Job, Reason, Status};

/// Jobs that wait for the end of one other at most.
const MOST_TWINS: i64 = 100;

pub(super) const EARLIER: &str = "select * from job indexed by job_answer
     where input_hash = ? and status = 'succeeded' and result_available = 'final' and cache <> 'off'
           and solver_version = ?
     order by id desc limit 1";

pub(super) const UNDER_WAY: &str = "select id from job indexed by job_under_way
     where input_hash = ? and status in ('queued', 'running') and twin_of is null and cache <> 'off'
           and cancel_requested = 0 and (status = 'running' or priority >= ?)
     order by id limit 1";

/// The newest job of this input with a final result of this very program that may answer others.
pub(super) async fn earlier(change: &mut Change<'_>, input_hash: &str) -> Result<Option<Job>> {
    let row = sqlx::query(EARLIER)
        .bind(input_hash)
        .bind(env!("CARGO_PKG_VERSION"))
        .fetch_optional(change.sql())
        .await?;
    row.as_ref().map(from_row).transpose()
}

/// A job at work on this input that will answer the new one too. One that waits behind the new one's
/// priority, or that is about to be canceled, would make it late.
pub(super) async fn under_way(change: &mut Change<'_>, new: &NewJob) -> Result<Option<i64>> {
    let source: Option<i64> = sqlx::query_scalar(UNDER_WAY)
        .bind(&new.input_hash)
        .bind(new.priority)
        .fetch_optional(change.sql())
        .await?;
    // Twins end in one transaction with their source. Those beyond wait in line, and are answered when it is
    // their turn.
    Ok(match source {
        Some(source) if count(change, source).await? < MOST_TWINS => Some(source),
        _ => None,
    })
}

async fn count(change: &mut Change<'_>, source: i64) -> Result<i64> {
    let twins = sqlx::query_scalar("select count(*) from job where twin_of = ?")
        .bind(source)
        .fetch_one(change.sql());
    Ok(twins.await?)
}

/// Lets a job whose turn it is wait for one that runs on the same input, and its own twins with it; false if
/// there is none, or too many wait for it. They are apart where one had to go before the other.
pub(super) async fn join_running(change: &mut Change<'_>, job: &Job) -> Result<bool> {
    let source: Option<i64> = sqlx::query_scalar(UNDER_WAY)
        .bind(&job.input_hash)
        .bind(NOBODY_WAITING)
        .fetch_optional(change.sql())
        .await?;
    let Some(source) = source else {
        return Ok(false);
    };
    if count(change, source).await? + count(change, job.key).await? >= MOST_TWINS {
        return Ok(false);
    }
    sqlx::query("update job set twin_of = ? where id = ? or twin_of = ?")
        .bind(source)
        .bind(job.key)
        .bind(job.key)
        .execute(change.sql())
        .await?;
    let (priority, key) = (job.priority, job.key);
    change.moves(Move::Leave { priority, key });
    change.moves(Move::Join);
    Ok(true)
}

/// A priority that none that waits has: only running ones are left.
const NOBODY_WAITING: i32 = i32::MAX;

/// The jobs that wait for the end of this one, in the order in which they would run.
async fn twins_of(change: &mut Change<'_>, source: i64) -> Result<Vec<Job>> {
    let rows = sqlx::query("select * from job where twin_of = ? order by priority desc, id")
        .bind(source)
        .fetch_all(change.sql())
        .await?;
    rows.iter().map(from_row).collect()
}

/// What becomes of the jobs that waited for the end of this one: they end as it has ended, or the first of
/// them takes its place.
pub(super) async fn settle(change: &mut Change<'_>, job: &Job) -> Result<()> {
    let twins = twins_of(change, job.key).await?;
    let Some(first) = twins.first() else {
        return Ok(());
    };
    let source = read(change.sql(), job.key).await?;
    if !is_shared(source.status, source.reason) {
        return succeed(change, first, job.key).await;
    }
    for twin in &twins {
        answer(change, twin, &source).await?;
    }
    Ok(())
}

/// A queued job has a lower priority now. If one of its twins goes before it, the others wait for that one.
pub(super) async fn overtake(change: &mut Change<'_>, source: i64, priority: i32) -> Result<()> {
    let twins = twins_of(change, source).await?;
    match twins.first() {
        Some(first) if first.priority > priority => succeed(change, first, source).await,
        _ => Ok(()),
    }
}

/// A twin takes the place of its source; the others wait for it.
async fn succeed(change: &mut Change<'_>, twin: &Job, source: i64) -> Result<()> {
    part(change, twin, twin.priority).await?;
    sqlx::query("update job set twin_of = ? where twin_of = ?")
        .bind(twin.key)
        .bind(source)
        .execute(change.sql())
        .await?;
    Ok(())
}

/// A twin waits in line itself.
async fn part(change: &mut Change<'_>, twin: &Job, priority: i32) -> Result<()> {
    let key = twin.key;
    sqlx::query("update job set twin_of = null where id = ?")
        .bind(key)
        .execute(change.sql())
        .await?;
    change.moves(Move::Part);
    change.moves(Move::Enter { priority, key });
    Ok(())
}

/// Whether the end of a job is that of its twins too.
fn is_shared(status: Status, reason: Option<Reason>) -> bool {
    match status {
        Status::Succeeded => true,
        // what has cost the process several times is not tried again for each of them
        Status::Failed => reason
            .is_some_and(|reason| reason.belongs_to_the_problem() || reason == Reason::WorkerLost),
        Status::Queued | Status::Running | Status::Canceled => false,
    }
}

/// Answers a queued job with the end of another one of the same input: it runs, and has ended.
pub(super) async fn answer(change: &mut Change<'_>, job: &Job, source: &Job) -> Result<()> {
    let job = life::start(change, job).await?;
    sqlx::query(
        "update job set cached_from = ?, twin_of = null,
                        result_job = (select coalesce(result_job, id) from job where id = ?) where id = ?",
    )
    .bind(source.id.0.to_string())
    .bind(source.key)
    .bind(job.key)
    .execute(change.sql())
    .await?;
    let ending = Ending {
        status: source.status,
        reason: source.reason,
        failure: source.failure.clone(),
        result: source.result_available,
    };
    life::close(change, &job, &ending).await
}

/// A twin that is to run before its source waits for it no longer.
pub(super) async fn leave_source(
    change: &mut Change<'_>,
    job: &Job,
    source: i64,
    priority: i32,
) -> Result<()> {
    let source = read(change.sql(), source).await?;
    if source.status != Status::Queued || source.priority >= priority {
        return Ok(());
    }
    part(change, job, priority).await
}
