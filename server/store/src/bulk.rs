//! Cancels and deletions of many jobs, several in one transaction: each commit waits for the disk, and one for each job
//! would take long.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use base::{
    caller::Owners,
    job::{Job, Status},
    time::Time,
};

use super::{
    change::Change,
    database::{Store, Writer},
    delete::{Deletion, delete, remove},
    end::end,
    error::Result,
    fields::remove_fields,
    rules::Ending,
};

/// How long one transaction may occupy the single writer, so that other requests are answered meanwhile.
const LONGEST: Duration = Duration::from_millis(20);
/// The longest that a transaction may occupy the single writer when it deletes jobs or fields, and other changes occupy
/// the writer all the time: it takes as long as it has waited for its turn, up to this limit. It then has a fair share
/// of the writer, and deletions keep pace with submissions.
const LONGEST_LATE: Duration = Duration::from_millis(150);

/// What one transaction has done: it deals with the first of the given jobs, as many as its time allows.
#[derive(Debug, Default)]
pub struct Batch {
    /// How many of the given jobs the transaction has dealt with; the others are left for the next transaction.
    pub seen: usize,
    /// How many of the jobs seen were canceled or deleted.
    pub done: usize,
    /// The keys of the jobs seen that are running, and were not canceled.
    pub running: Vec<i64>,
    /// The keys of the jobs seen that were to be deleted, and were not.
    pub left: Vec<i64>,
    /// The keys of all jobs that have changed, which may include jobs that were not given: their watchers are woken.
    pub changed: Vec<i64>,
}

/// Which of the jobs that have ended are deleted, or lose their fields.
#[derive(Clone, Debug)]
pub(super) enum Discard {
    /// Deletes the jobs of these owners.
    Jobs(Owners),
    /// Deletes the jobs that ended before this time, unless they are pinned.
    OldJobs(Time),
    /// Deletes the fields of the jobs that ended before this time, unless they are pinned.
    OldFields(Time),
}

impl Store {
    /// Cancels those of the given jobs that wait, as many as one transaction has time for.
    pub async fn cancel_queued(self: &Arc<Self>, keys: &[i64]) -> Result<Batch> {
        let keys = keys.to_vec();
        self.control(move |writer| cancel_queued(writer, &keys))
            .await
    }

    /// Deletes those of the given jobs that have ended, as many as one transaction has time for.
    pub async fn delete_ended(self: &Arc<Self>, owners: Owners, keys: &[i64]) -> Result<Batch> {
        self.try_to_discard(Discard::Jobs(owners), keys).await
    }

    /// Discards the given jobs or their fields, as many as one transaction has time for.
    pub(super) async fn try_to_discard(
        self: &Arc<Self>,
        what: Discard,
        keys: &[i64],
    ) -> Result<Batch> {
        let (asked, keys) = (Instant::now(), keys.to_vec());
        self.control(move |writer| {
            let longest = asked.elapsed().clamp(LONGEST, LONGEST_LATE);
            discard_first(writer, &what, &keys, longest)
        })
        .await
    }
}

fn cancel_queued(writer: &Writer<'_>, keys: &[i64]) -> Result<Batch> {
    let mut change = writer.control_change()?;
    let (mut batch, start) = (Batch::default(), Instant::now());
    for key in keys {
        let found = change.find(*key);
        // a damaged one stays as it is
        match change.unless_damage_of(*key, found)?.flatten() {
            Some(job) if job.status == Status::Queued => {
                end(&mut change, job.key, &Ending::canceled())?;
                batch.done += 1;
            }
            Some(job) if job.status == Status::Running => batch.running.push(*key),
            _ => {} // it has ended, or was deleted
        }
        batch.seen += 1;
        if start.elapsed() >= LONGEST {
            break;
        }
    }
    batch.changed = change.commit()?;
    Ok(batch)
}

fn discard_first(
    writer: &Writer<'_>,
    what: &Discard,
    keys: &[i64],
    longest: Duration,
) -> Result<Batch> {
    let mut change = writer.control_change()?;
    let (mut batch, start) = (Batch::default(), Instant::now());
    for key in keys {
        let discarded = discard(&mut change, what, *key);
        match change.unless_damage_of(*key, discarded)? {
            Some(true) => batch.done += 1,
            Some(false) | None => batch.left.push(*key),
        }
        batch.seen += 1;
        if start.elapsed() >= longest {
            break;
        }
    }
    batch.changed = change.commit()?;
    Ok(batch)
}

/// Discards a job or its fields; false if `what` does not apply to the job.
fn discard(change: &mut Change<'_>, what: &Discard, key: i64) -> Result<bool> {
    let (before, fields_alone) = match what {
        Discard::Jobs(owners) => {
            return Ok(delete(change, owners, key)? == Deletion::Deleted);
        }
        Discard::OldJobs(before) => (*before, false),
        Discard::OldFields(before) => (*before, true),
    };
    // as it is now, and by its own record, which has a checksum: it may have been pinned
    let job = change.find(key)?;
    let old = |job: &Job| !job.pinned && job.finished_at.is_some_and(|at| at < before);
    let Some(job) = job.filter(old) else {
        return Ok(false);
    };
    if fields_alone {
        remove_fields(change, &job)?
    } else {
        remove(change, &job)?
    }
    Ok(true)
}
