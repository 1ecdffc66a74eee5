//! Changes of many jobs, some in one transaction: each commit waits for the disk, and so would each job.

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
/// One that discards, where others occupy the writer all the time: as long as it has waited for its turn, but no longer than
/// this. So it has a fair share of the writer, and what is removed keeps pace with what is submitted.
const LONGEST_LATE: Duration = Duration::from_millis(150);

/// What one transaction has done to the first of some jobs.
#[derive(Debug, Default)]
pub struct Batch {
    /// How many jobs it has dealt with; the others were left for the next one.
    pub seen: usize,
    /// How many of them it has canceled or deleted.
    pub done: usize,
    /// Jobs that run, and were left alone.
    pub running: Vec<i64>,
    /// Jobs that were to be deleted and were not.
    pub left: Vec<i64>,
    /// Jobs that have changed, these or others, for their watchers.
    pub changed: Vec<i64>,
}

/// Which jobs are discarded that have ended, and what of them.
#[derive(Clone, Debug)]
pub(super) enum Discard {
    /// The jobs of these owners.
    Jobs(Owners),
    /// Jobs that ended before this time, unless they are pinned.
    OldJobs(Time),
    /// The fields of those.
    OldFields(Time),
}

impl Store {
    /// Cancels the first of these jobs, if they wait.
    pub async fn cancel_queued(self: &Arc<Self>, keys: &[i64]) -> Result<Batch> {
        let keys = keys.to_vec();
        self.control(move |writer| cancel_queued(writer, &keys))
            .await
    }

    /// Deletes the first of these jobs, if they have ended.
    pub async fn delete_ended(self: &Arc<Self>, owners: Owners, keys: &[i64]) -> Result<Batch> {
        self.try_to_discard(Discard::Jobs(owners), keys).await
    }

    /// Discards the first of these jobs.
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

/// Discards a job; false if it is not one of those.
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
