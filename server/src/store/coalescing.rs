//! Coalescing: jobs of the same input are solved once.
//!
//! A job is answered by the result of an earlier job, or coalesced into a job that waits or runs, its *primary*.
//! A coalesced job is not solved itself: it waits until its primary has ended, and ends with the same result. If
//! the end concerns the primary alone (if it was canceled, for example), the first of the jobs coalesced into it
//! takes its place.

use std::collections::{BTreeMap, BTreeSet};

use super::{
    change::Change,
    content::{self, Holder},
    database::Store,
    end_job::end_job,
    error::{Result, StoreError},
    intact, results,
    rows::{JobRow, from_row},
    rules::Ending,
    sizes,
    submission::NewJob,
};
use crate::job::{Job, Reason, Status};

/// Most jobs that are coalesced into one: they end in one transaction with it. Further ones wait for a worker, and
/// are answered when it is their turn.
const MOST_COALESCED: i64 = 100;

pub(super) const EARLIER_RESULT: &str = "select * from job indexed by job_answer
     where input_hash = ? and status = 'succeeded' and result_available = 'final' and cache <> 'off'
           and solver_version = ?
     order by id desc limit 4";

pub(super) const PRIMARY: &str = "select id from job indexed by job_under_way
     where input_hash = ? and status in ('queued', 'running') and coalesced_into is null and cache <> 'off'
           and cancel_requested = 0 and (status = 'running' or (priority >= ? and owner = ?))
     order by id limit 1";

/// A priority above that of any job: as the lowest priority of a waiting primary it excludes all but running ones.
const ONLY_RUNNING: i32 = i32::MAX;

/// The newest job of this input whose final result, found by this version of the program, may answer others.
pub(super) async fn earlier_result(
    change: &mut Change<'_>,
    input_hash: &str,
) -> Result<Option<Job>> {
    let rows = sqlx::query(EARLIER_RESULT)
        .bind(input_hash)
        .bind(env!("CARGO_PKG_VERSION"))
        .fetch_all(change.sql().await?)
        .await?;
    for row in &rows {
        // a damaged one answers nobody
        if let Some(job) = change.unless_damaged(from_row(row)).await?
            // what has lost its fields answers nobody
            && !sizes::lost_fields(change.sql().await?, job.key).await?
            && change.has_intact_result(&job).await?
        {
            return Ok(Some(job));
        }
    }
    Ok(None)
}

impl Store {
    /// Checks the result that may answer a job of this input, before the transaction that needs it, which would occupy the
    /// single writer meanwhile. What is not found intact answers nobody.
    pub(super) async fn check_earlier_result(&self, input_hash: &str) {
        let checked = self.try_to_check_earlier_result(input_hash);
        let _ = self.damages.noting(checked).await;
    }

    /// The same for the job that is probably claimed next.
    pub(super) async fn check_result_for_next(&self) {
        let read = async {
            let most_running = self.most_running_of_owner();
            let next = self.waiting_jobs().next(&BTreeSet::new(), most_running);
            let Some((key, _)) = next else {
                return Ok(None);
            };
            let hash = "select input_hash from job where id = ? and cache = 'use'";
            let hash = sqlx::query_scalar(hash).bind(key);
            Ok::<Option<String>, StoreError>(hash.fetch_optional(&self.reader).await?)
        };
        if let Ok(Some(input_hash)) = read.await {
            self.check_earlier_result(&input_hash).await;
        }
    }

    async fn try_to_check_earlier_result(&self, input_hash: &str) -> Result<()> {
        let row = sqlx::query(EARLIER_RESULT)
            .bind(input_hash)
            .bind(env!("CARGO_PKG_VERSION"))
            .fetch_optional(&self.reader)
            .await?;
        let Some(Ok(job)) = row.as_ref().map(from_row) else {
            return Ok(());
        };
        let mut connection = self.reader.acquire().await?;
        let attached = content::all(&mut connection, Holder::Job(job.key)).await?;
        intact::check_result(&mut connection, &self.intact, job.key, attached).await
    }
}

/// The job that a new one of this owner may be coalesced into. One that waits with a lower priority or for another owner's
/// turn, or that is about to be canceled, would delay the new one.
pub(super) async fn primary_for(
    change: &mut Change<'_>,
    owner: &str,
    new: &NewJob,
) -> Result<Option<i64>> {
    let primary: Option<i64> = sqlx::query_scalar(PRIMARY)
        .bind(&new.input_hash)
        .bind(new.priority)
        .bind(owner)
        .fetch_optional(change.sql().await?)
        .await?;
    Ok(match primary {
        Some(primary) if count_coalesced(change, primary).await? < MOST_COALESCED => Some(primary),
        _ => None,
    })
}

async fn count_coalesced(change: &mut Change<'_>, primary: i64) -> Result<i64> {
    let count = sqlx::query_scalar("select count(*) from job where coalesced_into = ?")
        .bind(primary)
        .fetch_one(change.sql().await?);
    Ok(count.await?)
}

/// Coalesces a job whose turn it is into one that runs on the same input, and with it those coalesced into it;
/// false if there is none, or if they were too many. Two such jobs arise where the later one had a higher priority.
pub(super) async fn coalesce_into_running(change: &mut Change<'_>, job: &Job) -> Result<bool> {
    let primary: Option<i64> = sqlx::query_scalar(PRIMARY)
        .bind(&job.input_hash)
        .bind(ONLY_RUNNING)
        .bind(&job.owner)
        .fetch_optional(change.sql().await?)
        .await?;
    let Some(primary) = primary else {
        return Ok(false);
    };
    let (there, more) = (
        count_coalesced(change, primary).await?,
        count_coalesced(change, job.key).await?,
    );
    if there + more >= MOST_COALESCED {
        return Ok(false);
    }
    let coalesced = coalesced_jobs(change, job.key).await?;
    for job in coalesced.iter().chain([job]) {
        coalesce(change, job.key, primary).await?;
    }
    Ok(true)
}

/// The jobs coalesced into this one, in the order in which they would be started, but for damaged ones.
pub(super) async fn coalesced_jobs(change: &mut Change<'_>, primary: i64) -> Result<Vec<Job>> {
    let rows = sqlx::query("select * from job where coalesced_into = ? order by priority desc, id")
        .bind(primary)
        .fetch_all(change.sql().await?)
        .await?;
    let mut jobs = vec![];
    for row in &rows {
        jobs.extend(change.unless_damaged(from_row(row)).await?);
    }
    Ok(jobs)
}

/// Ends the jobs coalesced into one that has ended in the same way, or puts the first of them in its place.
pub(super) async fn end_coalesced(change: &mut Change<'_>, primary: i64) -> Result<()> {
    let coalesced = coalesced_jobs(change, primary).await?;
    let Some(first) = coalesced.first() else {
        return Ok(());
    };
    let primary = change.read(primary).await?;
    if !is_shared(primary.status, primary.reason) {
        return replace_primary(change, first, primary.key).await;
    }
    for job in &coalesced {
        answer(change, job.key, &primary).await?;
    }
    Ok(())
}

/// A primary waits: if a job coalesced into it has a higher priority, that job takes its place.
pub(super) async fn replace_if_outranked(change: &mut Change<'_>, primary: i64) -> Result<()> {
    let coalesced = coalesced_jobs(change, primary).await?;
    let Some(first) = coalesced.first() else {
        return Ok(());
    };
    match first.priority > change.read(primary).await?.priority {
        true => replace_primary(change, first, primary).await,
        false => Ok(()),
    }
}

/// Lets a job wait for a worker in place of its primary, and the first of every other owner in their own turn, each with the
/// other jobs of that primary and of the same owner coalesced into it.
async fn replace_primary(change: &mut Change<'_>, job: &Job, primary: i64) -> Result<()> {
    change.set(job.key, JobRow::waits_by_itself).await?;
    let others = coalesced_jobs(change, primary).await?;
    let mut first_of = BTreeMap::from([(job.owner.clone(), job.key)]);
    for other in &others {
        match first_of.get(&other.owner) {
            Some(first) => coalesce(change, other.key, *first).await?,
            None => {
                first_of.insert(other.owner.clone(), other.key);
                change.set(other.key, JobRow::waits_by_itself).await?;
            }
        }
    }
    Ok(())
}

/// Coalesces a job into this primary.
async fn coalesce(change: &mut Change<'_>, key: i64, primary: i64) -> Result<()> {
    let set = change.set(key, |row| row.job.coalesced_into = Some(primary));
    set.await.map(drop)
}

/// The priority of a coalesced job may have changed: if its primary waits with a lower one, it waits by itself.
pub(super) async fn detach_if_ahead(
    change: &mut Change<'_>,
    job: &Job,
    primary: i64,
) -> Result<()> {
    let primary = change.read(primary).await?;
    if primary.status == Status::Queued && primary.priority < job.priority {
        change.set(job.key, JobRow::waits_by_itself).await?;
    }
    Ok(())
}

/// Whether the end of a job is also that of the jobs coalesced into it.
fn is_shared(status: Status, reason: Option<Reason>) -> bool {
    match status {
        Status::Succeeded => true,
        // a job that has killed the process several times is not tried again for each of them
        Status::Failed => reason
            .is_some_and(|reason| reason.belongs_to_the_problem() || reason == Reason::WorkerLost),
        Status::Queued | Status::Running | Status::Canceled => false,
    }
}

/// Starts a queued job and ends it at once, with the result of another one of the same input.
pub(super) async fn answer(change: &mut Change<'_>, key: i64, source: &Job) -> Result<()> {
    let now = change.now();
    let job = change
        .update(key, |row| row.start_with_answer(source, now))
        .await?;
    let tx = change.sql().await?;
    if job.attempt > 1 {
        // that of finished load steps of an earlier attempt
        results::remove(tx, key).await?;
    }
    results::share(tx, source.key, key).await?;
    end_job(change, key, &Ending::like(source)).await
}
