//! Coalescing: jobs of the same input are solved once.
//!
//! A job is answered by the result of an earlier job, or coalesced into a job that waits or runs, its *primary*. A
//! coalesced job is not solved itself: it waits until its primary has ended, and ends with the same result. If the
//! primary ends for a reason that concerns no other job (if it was canceled, for example), the first of the jobs
//! coalesced into it takes its place.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};

use base::job::{Cache, Job, Reason, Status};
use rusqlite::Connection;

use super::{
    change::Change,
    content::{self, Holder},
    database::{Store, Writer},
    end_job::end_job,
    error::Result,
    intact, results,
    rows::{JobRow, from_row},
    rules::Ending,
    sizes,
    sql::Sql,
    submission::NewJob,
    turns,
};

/// The largest number of jobs that are coalesced into one primary: they end in one transaction with it. Further jobs
/// wait for a worker, and are answered when it is their turn.
const MOST_COALESCED: i64 = 100;

pub(super) const EARLIER_RESULT: &str = "select id from job indexed by job_answer
     where input_hash = ? and status = 'succeeded' and result_available = 'final' and cache <> 'off'
           and solver_version = ?
     order by id desc limit 4";

pub(super) const PRIMARY: &str = "select id from job indexed by job_under_way
     where input_hash = ? and status in ('queued', 'running') and coalesced_into is null and cache <> 'off'
           and cancel_requested = 0 and (status = 'running' or (priority >= ? and owner = ?))
     order by id limit 1";

/// A priority above that of any job: as the lowest priority that a queued primary may have, it leaves running primaries
/// only.
const ONLY_RUNNING: i32 = i32::MAX;

/// The newest job of this input whose final result, found by this version of the program, may answer other jobs.
pub(super) fn earlier_result(change: &mut Change<'_>, input_hash: &str) -> Result<Option<Job>> {
    let version = env!("CARGO_PKG_VERSION");
    let found: Vec<i64> = change
        .sql()?
        .values(EARLIER_RESULT, [input_hash, version])?;
    for key in found {
        let job = change.read(key);
        // a damaged one answers nobody
        if let Some(job) = change.unless_damaged(job)?
            // what has lost its fields answers nobody
            && !sizes::lost_fields(change.sql()?, job.key)?
            && change.has_intact_result(&job)?
        {
            return Ok(Some(job));
        }
    }
    Ok(None)
}

impl Store {
    /// Checks the result that may answer a job of this input, before the transaction that needs the result: in it, the
    /// check would occupy the single writer. A result that is not intact answers no job.
    pub(super) async fn check_earlier_result(self: &Arc<Self>, input_hash: &str) {
        if self.intact.inputs.contains(input_hash) {
            return;
        }
        let hash = input_hash.to_owned();
        let _ = self
            .read(move |store, connection| check_earlier_result(store, connection, &hash))
            .await;
    }

    /// Checks the result that may answer the job that is probably claimed next, as `check_earlier_result` does.
    pub(super) async fn check_result_for_next(self: &Arc<Self>) {
        if self.waiting() == 0 {
            return;
        }
        let _ = self
            .read(move |store, connection| {
                let most_running = store.most_running_of_owner();
                let Some(key) = turns::next(connection, &BTreeSet::new(), most_running)? else {
                    return Ok(());
                };
                let hash = "select input_hash from job where id = ? and cache = 'use'";
                match connection.optional_value::<String>(hash, [key]) {
                    Ok(Some(hash)) => check_earlier_result(store, connection, &hash),
                    Ok(None) | Err(_) => Ok(()),
                }
            })
            .await;
    }
}

fn check_earlier_result(store: &Store, connection: &Connection, input_hash: &str) -> Result<()> {
    let version = env!("CARGO_PKG_VERSION");
    let newest = connection.optional_value(EARLIER_RESULT, [input_hash, version])?;
    if let Some(key) = newest {
        let attached = content::all(connection, Holder::Job(key))?;
        intact::check_result(connection, &store.intact, key, attached)?;
        store.intact.inputs.insert(input_hash.to_owned());
    }
    Ok(())
}

/// Whether an earlier result may answer one of these jobs and was not checked since the store was opened.
pub(super) fn has_result_to_check(writer: &Writer<'_>, jobs: &[NewJob]) -> bool {
    let inputs = &writer.store.intact.inputs;
    let jobs = jobs.iter().filter(|job| job.cache == Cache::Use);
    let mut unchecked = jobs.filter(|job| !inputs.contains(&job.input_hash));
    unchecked.any(|job| {
        let version = env!("CARGO_PKG_VERSION");
        let newest: Result<Option<i64>> = writer
            .beside()
            .optional_value(EARLIER_RESULT, [&job.input_hash, version]);
        matches!(newest, Ok(Some(_)))
    })
}

/// The primary that the new job of this owner may be coalesced into. Jobs that wait with a lower priority or belong to
/// another owner, and jobs that are about to be canceled, are not primaries: they would delay the new job.
pub(super) fn primary_for(
    change: &mut Change<'_>,
    owner: &str,
    new: &NewJob,
) -> Result<Option<i64>> {
    let same = (&new.input_hash, new.priority, owner);
    let primary = change.sql()?.optional_value(PRIMARY, same)?;
    Ok(match primary {
        Some(primary) if count_coalesced(change, primary)? < MOST_COALESCED => Some(primary),
        _ => None,
    })
}

fn count_coalesced(change: &mut Change<'_>, primary: i64) -> Result<i64> {
    let count = "select count(*) from job where coalesced_into = ?";
    change.sql()?.value(count, [primary])
}

/// Coalesces a job whose turn it is, and the jobs coalesced into it, into a running job of the same input; false if
/// none is running, or if they are too many. This happens if the later of two jobs of the same input had the higher
/// priority: it was not coalesced into the waiting one when it was submitted, and runs first.
pub(super) fn coalesce_into_running(change: &mut Change<'_>, job: &Job) -> Result<bool> {
    let same = (&job.input_hash, ONLY_RUNNING, &job.owner);
    let primary = change.sql()?.optional_value(PRIMARY, same)?;
    let Some(primary) = primary else {
        return Ok(false);
    };
    let (there, more) = (
        count_coalesced(change, primary)?,
        count_coalesced(change, job.key)?,
    );
    if there + more >= MOST_COALESCED {
        return Ok(false);
    }
    let coalesced = coalesced_jobs(change, job.key)?;
    for job in coalesced.iter().chain([job]) {
        coalesce(change, job.key, primary)?;
    }
    Ok(true)
}

/// The intact jobs coalesced into `primary`, in the order in which they would be started.
pub(super) fn coalesced_jobs(change: &mut Change<'_>, primary: i64) -> Result<Vec<Job>> {
    let coalesced = "select * from job where coalesced_into = ? order by priority desc, id";
    let found = change
        .sql()?
        .rows(coalesced, [primary], |row| Ok(from_row(row)))?;
    let mut jobs = vec![];
    for job in found {
        jobs.extend(change.unless_damaged(job)?);
    }
    Ok(jobs)
}

/// Ends the jobs coalesced into a job in the way in which it has ended, or makes the first of them the new primary.
pub(super) fn end_coalesced(change: &mut Change<'_>, primary: i64) -> Result<()> {
    let coalesced = coalesced_jobs(change, primary)?;
    let Some(first) = coalesced.first() else {
        return Ok(());
    };
    let primary = change.read(primary)?;
    if !is_shared(primary.status, primary.reason) {
        return replace_primary(change, first, primary.key);
    }
    for job in &coalesced {
        answer(change, job.key, &primary)?;
    }
    Ok(())
}

/// Makes the first job coalesced into the queued job `primary` the primary, if its priority is higher.
pub(super) fn replace_if_outranked(change: &mut Change<'_>, primary: i64) -> Result<()> {
    let coalesced = coalesced_jobs(change, primary)?;
    let Some(first) = coalesced.first() else {
        return Ok(());
    };
    if first.priority > change.read(primary)?.priority {
        replace_primary(change, first, primary)
    } else {
        Ok(())
    }
}

/// Lets `job` wait for a worker in place of its primary, and the first coalesced job of every other owner wait in that
/// owner's turn. The other jobs of each owner, and the primary's other jobs of the same owner, are coalesced into it.
fn replace_primary(change: &mut Change<'_>, job: &Job, primary: i64) -> Result<()> {
    change.set(job.key, JobRow::waits_by_itself)?;
    let others = coalesced_jobs(change, primary)?;
    let mut first_of = BTreeMap::from([(job.owner.clone(), job.key)]);
    for other in &others {
        match first_of.get(&other.owner) {
            Some(first) => coalesce(change, other.key, *first)?,
            None => {
                first_of.insert(other.owner.clone(), other.key);
                change.set(other.key, JobRow::waits_by_itself)?;
            }
        }
    }
    Ok(())
}

/// Coalesces the job with this key into this primary.
fn coalesce(change: &mut Change<'_>, key: i64, primary: i64) -> Result<()> {
    change.set(key, |row| row.job.coalesced_into = Some(primary))?;
    Ok(())
}

/// Lets a coalesced job, whose priority may have changed, wait by itself if its primary is queued with a lower
/// priority.
pub(super) fn detach_if_ahead(change: &mut Change<'_>, job: &Job, primary: i64) -> Result<()> {
    let primary = change.read(primary)?;
    if primary.status == Status::Queued && primary.priority < job.priority {
        change.set(job.key, JobRow::waits_by_itself)?;
    }
    Ok(())
}

/// Whether the jobs coalesced into a job end together with it, given how it has ended.
fn is_shared(status: Status, reason: Option<Reason>) -> bool {
    match status {
        Status::Succeeded => true,
        // a job that has killed the process several times is not tried again for each of them
        Status::Failed => reason
            .is_some_and(|reason| reason.belongs_to_the_problem() || reason == Reason::WorkerLost),
        Status::Queued | Status::Running | Status::Canceled => false,
    }
}

/// Starts a queued job and ends it at once, with the result of `source`, a job of the same input.
pub(super) fn answer(change: &mut Change<'_>, key: i64, source: &Job) -> Result<()> {
    let now = change.now();
    let job = change.update(key, |row| row.start_with_answer(source, now))?;
    let tx = change.sql_beside_jobs();
    if job.attempt > 1 {
        // that of finished load steps of an earlier attempt
        results::remove(tx, key)?;
    }
    results::share(tx, source.key, key)?;
    end_job(change, key, &Ending::like(source))
}
