//! Retention: what has ended is removed when it is old, or when there is too much, the oldest first. Pinned jobs never are.

use std::{collections::HashSet, sync::Weak, time::Duration};

use super::{
    change::Change,
    database::Store,
    delete::{self, Deletion, PAUSE},
    error::Result,
    fields,
    rows::find,
    sweeps,
};
use crate::{caller::Owners, time::Time};

/// How long and how much is kept; `None` without limit.
#[derive(Clone, Copy, Debug, Default)]
pub struct Retention {
    /// Seconds after its end.
    pub age_s: Option<f64>,
    /// Seconds that fields are kept, which are most of a result.
    pub fields_age_s: Option<f64>,
    /// Jobs that have ended.
    pub jobs: Option<u64>,
    /// Bytes of jobs that have ended.
    pub bytes: Option<u64>,
    /// Jobs of one owner.
    pub jobs_of_owner: Option<u64>,
    /// Bytes of the jobs of one owner.
    pub bytes_of_owner: Option<u64>,
}

/// Jobs that are removed in one transaction: some milliseconds of the single writer.
const AT_ONCE: usize = 50;

/// What has just ended is never removed for being too much: whoever waits for it must get it.
const YOUNG_S: f64 = 60.0;

/// The effect of one application of the limits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Retired {
    /// Jobs that were removed.
    pub jobs: usize,
    /// Jobs whose fields were removed.
    pub fields: usize,
}

/// Jobs to be removed, the oldest first; how many more, and how many more bytes, are too much.
struct Excess<'a> {
    owner: Option<&'a str>,
    jobs: u64,
    bytes: u64,
}

/// How often the limits are applied.
const INTERVAL: Duration = Duration::from_secs(10);

/// Keeps a store within its limits, and gives space back to the file system, until the store is dropped or closed.
pub async fn keep_within(store: Weak<Store>, retention: Retention) {
    loop {
        tokio::time::sleep(INTERVAL).await;
        let Some(store) = store.upgrade().filter(|store| !store.writer.is_closed()) else {
            return;
        };
        match store.retire(&retention, Time::now()).await {
            Ok(Retired { jobs: 0, fields: 0 }) => {}
            Ok(Retired { jobs, fields }) => tracing::info!(
                jobs,
                fields,
                "retention: {jobs} jobs were removed, and the fields of {fields}"
            ),
            Err(cause) => tracing::warn!(%cause, "retention: {cause}"),
        }
        match store.give_space_back().await {
            Ok(pages) if pages > 0 => {
                tracing::debug!(pages, "{pages} pages were given back to the file system");
            }
            Ok(_) => {}
            Err(cause) => tracing::debug!(%cause, "space could not be given back: {cause}"),
        }
    }
}

impl Store {
    /// Removes what is no longer kept. Jobs that cannot be removed, since they are damaged, stay.
    pub async fn retire(&self, retention: &Retention, now: Time) -> Result<Retired> {
        let now = self.by_our_clock(now);
        let (mut retired, mut left_alone) = (Retired::default(), HashSet::new());
        loop {
            let jobs = self.jobs_to_retire(retention, now, &left_alone).await?;
            if jobs.is_empty() {
                break;
            }
            retired.jobs += self.remove(&jobs, &mut left_alone, true).await?;
            tokio::time::sleep(PAUSE).await;
        }
        while let Some(age_s) = retention.fields_age_s {
            let before = now.after_s(-age_s).micros();
            let old = sqlx::query_scalar(
                "select job_id from job_size indexed by job_size_with_fields join job on job.id = job_id
                 where fields = 1 and job_size.finished_at < ? and pinned = 0
                 order by job_size.finished_at limit ?",
            );
            let old = old.bind(before).bind((AT_ONCE + left_alone.len()) as i64);
            let mut old: Vec<i64> = old.fetch_all(&self.reader).await?;
            old.retain(|key| !left_alone.contains(key));
            if old.is_empty() {
                break;
            }
            retired.fields += self.remove(&old, &mut left_alone, false).await?;
            tokio::time::sleep(PAUSE).await;
        }
        if let Some(age_s) = retention.age_s {
            self.forget_keys(now.after_s(-age_s)).await?;
        }
        self.forget_beyond(delete::MOST_REMEMBERED).await?;
        Ok(retired)
    }

    /// Some jobs that are no longer kept.
    async fn jobs_to_retire(
        &self,
        retention: &Retention,
        now: Time,
        left_alone: &HashSet<i64>,
    ) -> Result<Vec<i64>> {
        if let Some(age_s) = retention.age_s {
            let old = sqlx::query_scalar(
                "select id from job indexed by job_to_retire
                 where finished_at is not null and pinned = 0 and finished_at < ? order by finished_at, id limit ?",
            );
            let old = old.bind(now.after_s(-age_s).micros());
            let old = old.bind((AT_ONCE + left_alone.len()) as i64);
            let mut old: Vec<i64> = old.fetch_all(&self.reader).await?;
            old.retain(|key| !left_alone.contains(key));
            if !old.is_empty() {
                return Ok(old);
            }
        }
        let too_much =
            |limit: Option<u64>, found: u64| limit.map_or(0, |limit| found.saturating_sub(limit));
        let owners = self.sizes_of_owners(i64::MAX).await?;
        let (jobs, bytes) = owners.iter().fold((0, 0), |(jobs, bytes), owner| {
            (jobs + owner.jobs, bytes + owner.job_bytes)
        });
        let of_all = Excess {
            owner: None,
            jobs: too_much(retention.jobs, jobs),
            bytes: too_much(retention.bytes, bytes),
        };
        let of_each = owners.iter().map(|owner| Excess {
            owner: Some(&owner.owner),
            jobs: too_much(retention.jobs_of_owner, owner.jobs),
            bytes: too_much(retention.bytes_of_owner, owner.job_bytes),
        });
        for excess in of_each.chain([of_all]) {
            let found = self.oldest(&excess, now, left_alone).await?;
            if !found.is_empty() {
                return Ok(found);
            }
        }
        Ok(vec![])
    }

    /// The oldest jobs, as many as are too many or have the bytes that are too many.
    async fn oldest(
        &self,
        excess: &Excess<'_>,
        now: Time,
        left_alone: &HashSet<i64>,
    ) -> Result<Vec<i64>> {
        if excess.jobs == 0 && excess.bytes == 0 {
            return Ok(vec![]);
        }
        let statement = match excess.owner {
            None => sqlx::query_as(
                "select id, bytes from job indexed by job_to_retire join job_size on job_id = id
                 where job.finished_at is not null and pinned = 0 and job.finished_at < ?
                 order by job.finished_at, id limit ?",
            ),
            Some(owner) => sqlx::query_as(
                "select id, bytes from job indexed by job_to_retire_by_owner join job_size on job_id = id
                 where job.owner = ? and job.finished_at is not null and pinned = 0 and job.finished_at < ?
                 order by job.finished_at, id limit ?",
            )
            .bind(owner),
        };
        let rows: Vec<(i64, i64)> = statement
            .bind(now.after_s(-YOUNG_S).micros())
            .bind((AT_ONCE + left_alone.len()) as i64)
            .fetch_all(&self.reader)
            .await?;
        let (mut jobs, mut bytes) = (excess.jobs, excess.bytes);
        let mut found = vec![];
        for (key, size) in rows {
            if left_alone.contains(&key) {
                continue;
            }
            if jobs == 0 && bytes == 0 {
                break;
            }
            jobs = jobs.saturating_sub(1);
            bytes = bytes.saturating_sub(u64::try_from(size).unwrap_or(0));
            found.push(key);
        }
        Ok(found)
    }

    /// Removes these jobs, or only their fields; how many were. What is damaged is left alone.
    async fn remove(
        &self,
        keys: &[i64],
        left_alone: &mut HashSet<i64>,
        whole: bool,
    ) -> Result<usize> {
        let all = self.control(|| self.try_to_remove(keys, whole)).await;
        if let Ok(removed) = all {
            // one that was changed meanwhile is not met for ever
            left_alone.extend(keys.iter().skip(removed));
            return Ok(removed);
        }
        let mut removed = 0;
        for key in keys {
            let one = std::slice::from_ref(key);
            match self.control(|| self.try_to_remove(one, whole)).await {
                Ok(1) => removed += 1,
                Ok(_) => {
                    left_alone.insert(*key);
                }
                Err(cause) => {
                    tracing::warn!(job.key = key, %cause, "a job that is no longer kept could not be removed: {cause}");
                    left_alone.insert(*key);
                }
            }
        }
        Ok(removed)
    }

    async fn try_to_remove(&self, keys: &[i64], whole: bool) -> Result<usize> {
        let mut change = self.control_change().await?;
        let mut removed = 0;
        for key in keys {
            // as it is now: it may have been pinned or deleted
            let Some(job) = find(change.sql(), *key).await?.filter(|job| !job.pinned) else {
                continue;
            };
            if !whole {
                fields::remove_fields(&mut change, &job).await?;
                removed += 1;
                continue;
            }
            if delete::delete(&mut change, Owners::All, *key).await? == Deletion::Deleted {
                removed += 1;
                if let Some(sweep) = job.sweep {
                    sweeps::remove_without_jobs(&mut change, sweep).await?;
                }
            }
        }
        change.commit().await?;
        Ok(removed)
    }

    /// Removes request keys from before this time whose jobs are gone.
    async fn forget_keys(&self, before: Time) -> Result<()> {
        const OLD: &str = "select 1 from request_key where created_at < ?1
             and not exists (select 1 from job where id between first_job and first_job + jobs - 1) limit 1";
        let some: Option<i64> = sqlx::query_scalar(OLD)
            .bind(before.micros())
            .fetch_optional(&self.reader)
            .await?;
        if some.is_none() {
            return Ok(());
        }
        let forget = async {
            let mut change: Change<'_> = self.control_change().await?;
            sqlx::query(
                "delete from request_key where created_at < ?1
                 and not exists (select 1 from job where id between first_job and first_job + jobs - 1)",
            )
            .bind(before.micros())
            .execute(change.sql())
            .await?;
            change.commit().await?;
            Ok(())
        };
        self.writing(forget).await
    }
}
