//! Changes of many jobs, some in one transaction: each commit waits for the disk, and so would each job.

use std::time::{Duration, Instant};

use super::{
    database::Store,
    delete::{Deletion, delete},
    end::end,
    error::Result,
    lifecycle::Ending,
    rows::find,
};
use crate::{caller::Owners, job::Status};

/// How long one transaction may occupy the single writer, so that other requests are answered meanwhile.
const LONGEST: Duration = Duration::from_millis(20);

/// What one transaction has done to the first of some jobs.
#[derive(Debug, Default)]
pub struct Batch {
    /// How many jobs it has dealt with; the others were left for the next one.
    pub seen: usize,
    /// How many of them it has canceled or deleted.
    pub done: usize,
    /// Those that run, and were left alone.
    pub running: Vec<i64>,
    /// Jobs that have changed, these or others, for their watchers.
    pub changed: Vec<i64>,
}

impl Store {
    /// Cancels the first of these jobs, if they wait.
    pub async fn cancel_queued(&self, keys: &[i64]) -> Result<Batch> {
        self.control(|| self.try_to_cancel_queued(keys)).await
    }

    async fn try_to_cancel_queued(&self, keys: &[i64]) -> Result<Batch> {
        let mut change = self.control_change().await?;
        let (mut batch, start) = (Batch::default(), Instant::now());
        for key in keys {
            let found = find(change.sql(), *key).await;
            // a damaged one stays as it is
            match change.unless_damage_of(*key, found).await?.flatten() {
                Some(job) if job.status == Status::Queued => {
                    end(&mut change, &job, &Ending::canceled()).await?;
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
        batch.changed = change.commit().await?;
        Ok(batch)
    }

    /// Deletes the first of these jobs, if they have ended.
    pub async fn delete_ended(&self, owners: Owners<'_>, keys: &[i64]) -> Result<Batch> {
        self.control(|| self.try_to_delete_ended(owners, keys))
            .await
    }

    async fn try_to_delete_ended(&self, owners: Owners<'_>, keys: &[i64]) -> Result<Batch> {
        let mut change = self.control_change().await?;
        let (mut batch, start) = (Batch::default(), Instant::now());
        for key in keys {
            let deletion = delete(&mut change, owners, *key).await;
            let deletion = change.unless_damage_of(*key, deletion).await?;
            batch.done += usize::from(deletion == Some(Deletion::Deleted));
            batch.seen += 1;
            if start.elapsed() >= LONGEST {
                break;
            }
        }
        batch.changed = change.commit().await?;
        Ok(batch)
    }
}
