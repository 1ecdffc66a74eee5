//! Forgets the ids of deleted jobs and sweeps, which are remembered for a while, and with the ids of jobs the request
//! keys under which they were submitted.

use std::sync::Arc;

use base::time::Time;
use rusqlite::params;

use super::{database::Store, delete::PAUSE, error::Result, keys, sql::Sql, sweeps};

/// How long (s) the id of a deleted job or sweep is remembered, and requests for it are answered that it was deleted;
/// after that it is unknown.
const REMEMBERED_S: f64 = 7.0 * 86_400.0;

/// The largest number of ids of deleted jobs that are remembered, some 160 bytes each: jobs that are deleted as fast as
/// they are solved do not fill the disk.
pub(super) const MOST_REMEMBERED: u32 = 100_000;
/// The number of ids that are forgotten in one transaction, with their request keys: it takes some milliseconds of the
/// single writer.
const FORGOTTEN_AT_ONCE: u32 = 250;

impl Store {
    /// Forgets the ids of jobs and sweeps that were deleted long ago.
    pub async fn forget_deleted(self: &Arc<Self>, now: Time) -> Result<()> {
        let before = self.cutoff(self.by_our_clock(now), REMEMBERED_S).micros();
        self.forget_up_to(before - 1).await?;
        let some = "select exists (select 1 from deleted_sweep where deleted_at < ?)";
        let some = self.read(move |_, connection| connection.value::<bool>(some, [before]));
        if !some.await? {
            return Ok(());
        }
        self.control(move |writer| {
            let tx = writer.begin_control()?;
            sweeps::forget_deleted(&tx, before)?;
            tx.commit()
        })
        .await
    }

    /// Forgets the oldest ids of deleted jobs, so that at most `most` remain.
    pub(super) async fn forget_beyond(self: &Arc<Self>, most: u32) -> Result<()> {
        let newest = self.read(move |_, connection| connection.optional_value(BEYOND, [most]));
        match newest.await? {
            Some(newest) => self.forget_up_to(newest).await,
            None => Ok(()),
        }
    }

    /// Forgets the ids of jobs that were deleted up to the time `last` (µs), some at a time.
    async fn forget_up_to(self: &Arc<Self>, last: i64) -> Result<()> {
        let some = "select exists (select 1 from deleted_job where deleted_at <= ?)";
        while self
            .read(move |_, connection| connection.value::<bool>(some, [last]))
            .await?
        {
            let forget = self.control(move |writer| {
                let tx = writer.begin_control()?;
                let gone: Vec<i64> = tx.values(
                    "delete from deleted_job where uuid in (select uuid from deleted_job indexed by deleted_job_by_time
                     where deleted_at <= ? order by deleted_at limit ?) returning id",
                    params![last, FORGOTTEN_AT_ONCE],
                )?;
                for job in gone {
                    keys::forget(&tx, job)?;
                }
                tx.commit()
            });
            forget.await?;
            tokio::time::sleep(PAUSE).await;
        }
        Ok(())
    }
}

pub(super) const BEYOND: &str = "select deleted_at from deleted_job indexed by deleted_job_by_time order by deleted_at desc limit 1 offset ?";
