//! Retention: ended jobs are removed when they are old, or when they are too many or too large, the oldest first.
//! Pinned jobs are never removed, and do not count.
//!
//! The sums of what owners keep have no checksums. They are compared with the sums of the jobs before anything is
//! removed because there is too much, and a job is removed only if its own record says that it ended so long ago.

use std::{
    collections::HashSet,
    num::ParseIntError,
    sync::{Arc, Weak},
    time::Duration,
};

use base::{text::size, time::Time};
use futures_util::future::BoxFuture;
use rusqlite::{Connection, params};

use super::{
    bulk::{Batch, Discard},
    clock::NOTED_MICROS,
    database::Store,
    delete::PAUSE,
    error::{Record, Result, StoreError},
    forget::MOST_REMEMBERED,
    repeated_error::RepeatedError,
    sql::Sql,
};

/// The limits of what is kept; `None` means no limit.
#[derive(Clone, Copy, Debug, Default)]
pub struct Retention {
    /// The time for which a job is kept after its end (s).
    pub age_s: Option<f64>,
    /// The time for which the fields of a job are kept after its end (s); fields are most of a result.
    pub fields_age_s: Option<f64>,
    /// The largest number of ended jobs.
    pub jobs: Option<u64>,
    /// The largest size of all ended jobs (bytes).
    pub bytes: Option<u64>,
    /// The largest number of ended jobs of one owner.
    pub jobs_of_owner: Option<u64>,
    /// The largest size of the ended jobs of one owner (bytes).
    pub bytes_of_owner: Option<u64>,
}

/// The number of jobs that are read at a time: more than one transaction removes.
const AT_ONCE: usize = 200;

/// The time (s) after its end in which a job is never removed because there is too much: clients that wait for it must
/// get its result.
const YOUNG_S: f64 = 60.0;

/// What one application of the limits has removed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Retired {
    /// The number of jobs that were removed.
    pub jobs: usize,
    /// The number of jobs whose fields were removed.
    pub fields: usize,
}

/// The number and size of the ended jobs of an owner, or of those that are too much.
#[derive(Clone, Debug)]
struct Kept {
    owner: String,
    jobs: u64,
    bytes: u64,
}

pub(super) const OLD_JOBS: &str = "select id from job indexed by job_to_retire
     where finished_at is not null and pinned = 0 and finished_at < ? order by finished_at, id limit ?";

const COUNT_OLD: &str = "select count(*) from job indexed by job_to_retire
     where finished_at is not null and pinned = 0 and finished_at < ?";

const COUNT_YOUNG: &str = "select count(*) from job indexed by job_to_retire
     where finished_at is not null and pinned = 0 and finished_at >= ?";

pub(super) const OLD_FIELDS: &str =
    "select job_id from job_size indexed by job_size_with_fields join job on job.id = job_id
     where fields = 1 and job_size.finished_at < ? and pinned = 0 order by job_size.finished_at limit ?";

pub(super) const OLDEST_OF_OWNER: &str =
    "select id, bytes from job indexed by job_to_retire_by_owner join job_size on job_id = id
     where job.owner = ? and job.finished_at is not null and pinned = 0 and job.finished_at < ?
     order by job.finished_at, id limit ?";

/// The number and size of every owner's ended jobs that are not pinned, owners with the largest size first.
pub(super) const KEPT: &str =
    "select owner, owner_size.jobs - coalesce(pinned.jobs, 0), job_bytes - coalesce(pinned.bytes, 0)
     from owner_size left join
          (select job.owner as owner, count(*) as jobs, sum(bytes) as bytes
           from job indexed by job_pinned join job_size on job_id = id
           where pinned = 1 and job.finished_at is not null group by job.owner) pinned using (owner)
     order by 3 desc, owner";

/// The time between two applications of the limits, each of which also gives space back.
const INTERVAL: Duration = Duration::from_secs(10);
/// The time between two applications of the limits while the disk is full.
const INTERVAL_WHEN_FULL: Duration = Duration::from_secs(1);
/// The number of applications of the limits after which the present moment is stored.
const NOTED_EVERY: u32 = (NOTED_MICROS / INTERVAL.as_micros() as i64) as u32;

/// The number of jobs from which on a removal because of age is logged as a warning, if they are also at least half of
/// all.
const MUCH: i64 = 10;

/// Keeps a store within its limits, and gives space back to the file system, until the store is dropped or closed.
pub fn keep_within(store: Weak<Store>, retention: Retention) -> BoxFuture<'static, ()> {
    Box::pin(retire_regularly(store, retention))
}

async fn retire_regularly(store: Weak<Store>, retention: Retention) {
    let mut retiring = RepeatedError::new("retention");
    if let Some(store) = store.upgrade() {
        retiring.note(store.announce(&retention).await);
    }
    let mut rounds = 0u32;
    loop {
        pause(&store).await;
        let Some(store) = store.upgrade() else {
            return;
        };
        rounds = rounds.wrapping_add(1);
        if rounds.is_multiple_of(NOTED_EVERY) {
            store.note_alive().await;
        }
        let retired = store.retire(&retention, Time::now()).await;
        if store.is_closed() {
            return;
        }
        match retiring.note(retired) {
            None | Some(Retired { jobs: 0, fields: 0 }) => {}
            Some(Retired { jobs, fields }) => tracing::info!(
                jobs,
                fields,
                "retention: {jobs} jobs were removed, and the fields of {fields}"
            ),
        }
        match store.give_space_back().await {
            Ok(pages) if pages > 0 => {
                tracing::debug!(pages, "{pages} pages were returned to the file system");
            }
            Ok(_) => {}
            Err(cause) => {
                tracing::debug!(%cause, "space could not be returned to the file system: {cause}")
            }
        }
    }
}

/// Waits until the limits must be applied again.
async fn pause(store: &Weak<Store>) {
    let mut left = INTERVAL;
    while !left.is_zero() {
        tokio::time::sleep(INTERVAL_WHEN_FULL).await;
        let full = |store: Arc<Store>| store.reserve.was_disk_full();
        if store.upgrade().is_none_or(full) {
            return;
        }
        left = left.saturating_sub(INTERVAL_WHEN_FULL);
    }
}

impl Store {
    /// Removes jobs and fields that the limits no longer allow. Damaged jobs, which cannot be removed, stay.
    pub async fn retire(self: &Arc<Self>, retention: &Retention, now: Time) -> Result<Retired> {
        let now = self.by_our_clock(now);
        let mut retired = Retired::default();
        self.forget_beyond(MOST_REMEMBERED).await?;
        if self.retention_begins().await?.is_some_and(|at| now < at) {
            return Ok(retired);
        }
        let mut left_alone = HashSet::new();
        if let Some(age_s) = retention.age_s {
            let before = self.cutoff(now, age_s);
            self.tell_if_much(before).await?;
            let old = Discard::OldJobs(before);
            retired.jobs += self
                .discard_old(OLD_JOBS, before, old, &mut left_alone)
                .await?;
        }
        if let Some(age_s) = retention.fields_age_s {
            let before = self.cutoff(now, age_s);
            let old = Discard::OldFields(before);
            retired.fields += self
                .discard_old(OLD_FIELDS, before, old, &mut left_alone)
                .await?;
        }
        let not_young = self.cutoff(now, YOUNG_S);
        let mut compared = false;
        loop {
            let (limits, alone) = (*retention, left_alone.clone());
            let jobs = self
                .read(move |_, connection| too_much(connection, &limits, not_young, &alone))
                .await?;
            if jobs.is_empty() {
                return Ok(retired);
            }
            if !compared {
                self.compare_sums().await?;
                compared = true;
            }
            let old = Discard::OldJobs(not_young);
            retired.jobs += self.discard(&old, &jobs, &mut left_alone).await?;
            tokio::time::sleep(PAUSE).await;
        }
    }

    /// Logs a warning if the jobs that ended before `before`, which are about to be removed for their age, are many.
    async fn tell_if_much(self: &Arc<Self>, before: Time) -> Result<()> {
        self.read(move |_, connection| {
            let old: i64 = connection.value(COUNT_OLD, [before.micros()])?;
            if old < MUCH {
                return Ok(());
            }
            let young: i64 = connection.value(COUNT_YOUNG, [before.micros()])?;
            if old >= young {
                tracing::warn!(
                    jobs = old, kept = young, %before,
                    "retention removes {old} of {} jobs that have ended, all that ended before {before} (--retain-days)",
                    old.saturating_add(young)
                );
            }
            Ok(())
        })
        .await
    }

    /// Discards the jobs that `statement` finds, which ended before `before`, or their fields; returns how many.
    async fn discard_old(
        self: &Arc<Self>,
        statement: &'static str,
        before: Time,
        what: Discard,
        left_alone: &mut HashSet<i64>,
    ) -> Result<usize> {
        let mut discarded = 0;
        loop {
            let limit = (AT_ONCE + left_alone.len()) as i64;
            let old = self.read(move |_, connection| {
                connection.values(statement, params![before.micros(), limit])
            });
            let mut old: Vec<i64> = old.await?;
            old.retain(|key| !left_alone.contains(key));
            if old.is_empty() {
                return Ok(discarded);
            }
            let done = self.discard(&what, &old, left_alone).await?;
            discarded += done;
            // what was cut off, since others write all the time, goes on when it is its turn again
            if done >= old.len() {
                tokio::time::sleep(PAUSE).await;
            }
        }
    }

    /// Discards the first of these jobs, or their fields; returns how many. Jobs that cannot be discarded are added to
    /// `left_alone`.
    async fn discard(
        self: &Arc<Self>,
        what: &Discard,
        keys: &[i64],
        left_alone: &mut HashSet<i64>,
    ) -> Result<usize> {
        let mut discarded = 0;
        match self.try_to_discard(what.clone(), keys).await {
            Ok(Batch { done, left, .. }) => {
                left_alone.extend(left);
                return Ok(done);
            }
            // a page that cannot be read, of nobody knows which of them
            Err(StoreError::Damaged(_)) => {}
            Err(cause) => return Err(cause),
        }
        for key in keys {
            let one = std::slice::from_ref(key);
            match self.try_to_discard(what.clone(), one).await {
                Ok(Batch { done: 1, .. }) => discarded += 1,
                Ok(_) | Err(StoreError::Damaged(_)) => {
                    left_alone.insert(*key);
                }
                Err(cause) => return Err(cause),
            }
        }
        Ok(discarded)
    }

    /// An error unless the sums by owner match the jobs and meshes.
    pub(super) async fn compare_sums(self: &Arc<Self>) -> Result<()> {
        self.read(|_, connection| {
            let differ: bool = connection.value(
                "with of_jobs as (select owner, count(*) as jobs, sum(bytes) as bytes from job_size group by owner),
                      of_meshes as (select owner, sum(bytes) as bytes
                                    from mesh_owner join mesh using (hash) join attachment on kind = 'mesh' and key = mesh.id
                                         join content on content.id = content group by owner)
                 select exists (select 1 from owner_size left join of_jobs using (owner) left join of_meshes using (owner)
                                where owner_size.jobs <> coalesce(of_jobs.jobs, 0) or job_bytes <> coalesce(of_jobs.bytes, 0)
                                      or mesh_bytes <> coalesce(of_meshes.bytes, 0))
                        or exists (select 1 from of_jobs where owner not in (select owner from owner_size))",
                (),
            )?;
            if differ {
Err(Record::named("sum of what owners keep").damaged(
                    "it does not match their jobs, so no jobs are removed for their size; `signorini doctor --salvage` counts again",
                ))
} else {
Ok(())
}
        })
        .await
    }

    /// The time from which on jobs are removed, if the store was written by a version that kept everything.
    async fn retention_begins(self: &Arc<Self>) -> Result<Option<Time>> {
        self.read(|_, connection| {
            let begins = "select value from setting where name = 'retention_begins'";
            let begins: Option<String> = connection.optional_value(begins, ())?;
            let Some(text) = begins else { return Ok(None) };
            let damaged =
                |error: ParseIntError| Record::named("setting retention_begins").damaged(error);
            let micros: i64 = text.parse().map_err(damaged)?;
            Ok(Some(Time::from_micros(micros)))
        })
        .await
    }

    /// Logs what will be removed, if the store was written by a version that kept everything.
    async fn announce(self: &Arc<Self>, retention: &Retention) -> Result<()> {
        let begins = self.retention_begins().await?;
        let Some(begins) = begins.filter(|at| self.now() < *at) else {
            return Ok(());
        };
        let (jobs, bytes) = self.foreseen(retention, begins).await?;
        if jobs > 0 {
            tracing::warn!(
                jobs, bytes, %begins,
                "this store was written by a version that kept everything; at {begins} about {jobs} jobs with {} will be removed, \
                 and from then on all jobs that exceed the limits on age, number and size: to keep jobs, pin them, or set other \
                 limits (--retain-days, --retain-bytes and others, 0 for none)",
                size(bytes)
            );
        }
        Ok(())
    }

    /// About how many of the present jobs the limits would remove at the time `at`, and their size (bytes).
    pub(super) async fn foreseen(
        self: &Arc<Self>,
        retention: &Retention,
        at: Time,
    ) -> Result<(u64, u64)> {
        let oldest = retention
            .age_s
            .map_or(i64::MIN, |age_s| self.cutoff(at, age_s).micros());
        let rows = self.read(move |_, connection| {
            connection.rows(
                "select job.finished_at < ? as old, count(*), sum(bytes) from job indexed by job_to_retire join job_size on job_id = id
                 where job.finished_at is not null and pinned = 0 group by old, job.owner",
                [oldest],
                |row| Ok(row.try_into()?),
            )
        });
        let rows: Vec<(bool, i64, i64)> = rows.await?;
        let (mut gone, mut all, mut kept) = ((0, 0), (0, 0), (0, 0));
        for (old, jobs, bytes) in rows {
            let (jobs, bytes) = (jobs.unsigned_abs(), bytes.unsigned_abs());
            if old {
                gone = (gone.0 + jobs, gone.1 + bytes);
                continue;
            }
            all = (all.0 + jobs, all.1 + bytes);
            kept.0 += jobs.min(retention.jobs_of_owner.unwrap_or(jobs));
            kept.1 += bytes.min(retention.bytes_of_owner.unwrap_or(bytes));
        }
        let jobs = all.0 - kept.0.min(retention.jobs.unwrap_or(kept.0));
        let bytes = all.1 - kept.1.min(retention.bytes.unwrap_or(kept.1));
        // of the average size
        let of_bytes = bytes.saturating_mul(all.0).div_ceil(all.1.max(1));
        let of_jobs = jobs.saturating_mul(all.1) / all.0.max(1);
        Ok((gone.0 + jobs.max(of_bytes), gone.1 + bytes.max(of_jobs)))
    }
}

/// Some of the oldest jobs beyond the limits: of one owner beyond the limits of an owner; otherwise, beyond the limits
/// of all, of the owners who keep most.
fn too_much(
    connection: &Connection,
    retention: &Retention,
    before: Time,
    left_alone: &HashSet<i64>,
) -> Result<Vec<i64>> {
    let owners = kept(connection)?;
    let beyond = |limit: Option<u64>, found: u64| found.saturating_sub(limit.unwrap_or(found));
    for owner in &owners {
        let excess = Kept {
            owner: owner.owner.clone(),
            jobs: beyond(retention.jobs_of_owner, owner.jobs),
            bytes: beyond(retention.bytes_of_owner, owner.bytes),
        };
        let found = oldest(connection, &excess, before, left_alone)?;
        if !found.is_empty() {
            return Ok(found.into_iter().map(|(key, _)| key).collect());
        }
    }
    let jobs: Vec<u64> = owners.iter().map(|owner| owner.jobs).collect();
    let bytes: Vec<u64> = owners.iter().map(|owner| owner.bytes).collect();
    let mut jobs_left = beyond(retention.jobs, jobs.iter().sum());
    let mut bytes_left = beyond(retention.bytes, bytes.iter().sum());
    let (jobs, bytes) = (
        reductions(&jobs, retention.jobs),
        reductions(&bytes, retention.bytes),
    );
    let mut keys = vec![];
    for (owner, (jobs, bytes)) in owners.into_iter().zip(jobs.into_iter().zip(bytes)) {
        let excess = Kept {
            owner: owner.owner,
            jobs: jobs.min(jobs_left),
            bytes: bytes.min(bytes_left),
        };
        for (key, size) in oldest(connection, &excess, before, left_alone)? {
            keys.push(key);
            jobs_left = jobs_left.saturating_sub(1);
            bytes_left = bytes_left.saturating_sub(size);
        }
        if keys.len() >= AT_ONCE {
            break;
        }
    }
    Ok(keys)
}

/// What every owner keeps, without pinned jobs.
fn kept(connection: &Connection) -> Result<Vec<Kept>> {
    let count = |count: i64| u64::try_from(count).unwrap_or(0);
    connection.rows(KEPT, (), |row| {
        Ok(Kept {
            owner: row.get(0)?,
            jobs: count(row.get(1)?),
            bytes: count(row.get(2)?),
        })
    })
}

/// The oldest jobs of an owner with their sizes (bytes), until their number and their size make up the excess.
fn oldest(
    connection: &Connection,
    excess: &Kept,
    before: Time,
    left_alone: &HashSet<i64>,
) -> Result<Vec<(i64, u64)>> {
    if excess.jobs == 0 && excess.bytes == 0 {
        return Ok(vec![]);
    }
    let limit = (AT_ONCE + left_alone.len()) as i64;
    let rows: Vec<(i64, i64)> = connection.rows(
        OLDEST_OF_OWNER,
        params![excess.owner, before.micros(), limit],
        |row| Ok(row.try_into()?),
    )?;
    let (mut jobs, mut bytes) = (excess.jobs, excess.bytes);
    let mut found = vec![];
    for (key, size) in rows {
        if left_alone.contains(&key) {
            continue;
        }
        if jobs == 0 && bytes == 0 {
            break;
        }
        let size = u64::try_from(size).unwrap_or(0);
        jobs = jobs.saturating_sub(1);
        bytes = bytes.saturating_sub(size);
        found.push((key, size));
    }
    Ok(found)
}

/// By how much each of these amounts must be reduced so that their sum is within the limit. The largest amounts are
/// reduced, all to the same rest.
fn reductions(amounts: &[u64], limit: Option<u64>) -> Vec<u64> {
    let mut left = limit.unwrap_or(u64::MAX);
    let mut rising = amounts.to_vec();
    rising.sort_unstable();
    let mut most = u64::MAX;
    for (n, amount) in rising.iter().enumerate() {
        let even = left / (rising.len() - n) as u64;
        if *amount > even {
            most = even;
            break;
        }
        left -= amount;
    }
    amounts
        .iter()
        .map(|amount| amount.saturating_sub(most))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_are_reduced_and_the_others_are_left_alone() {
        assert_eq!(reductions(&[20, 1, 2], Some(10)), [13, 0, 0]);
        assert_eq!(reductions(&[20, 10, 2], Some(12)), [15, 5, 0]);
        assert_eq!(reductions(&[3, 4], Some(7)), [0, 0]);
        assert_eq!(reductions(&[3, 4], Some(0)), [3, 4]);
        assert_eq!(reductions(&[3, 4], None), [0, 0]);
        assert!(reductions(&[], Some(1)).is_empty());
    }
}
