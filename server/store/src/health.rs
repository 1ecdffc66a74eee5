//! Whether the store works, as `/readyz` tells it, and the task that watches the store's files.

use std::{
    sync::{Arc, Weak},
    time::Duration,
};

use base::{job::Job, text::number_of, time::Time};
use rusqlite::Connection;
use uuid::Uuid;

use super::{
    database::Store,
    error::{Result, StoreError},
    rows::from_row,
    sql::Sql,
};

/// How often the files of the store are checked.
const INTERVAL: Duration = Duration::from_secs(1);

/// How well the store works.
#[derive(Clone, Debug, Default)]
pub struct Health {
    /// Whether the disk is full: only canceling, deleting, pausing and reading work.
    pub full: bool,
    /// The number of records that were found damaged.
    pub damaged: usize,
    /// The incident numbers of the first damaged records, by which the log has them.
    pub incidents: Vec<Uuid>,
}

impl Health {
    /// Whether everything works.
    pub fn is_whole(&self) -> bool {
        !self.full && self.damaged == 0
    }

    /// Texts for operators about everything that does not work.
    pub fn lines(&self) -> Vec<String> {
        let mut lines = vec![];
        if self.full {
            lines.push(
                "the disk is full: only canceling, deleting, pausing and reading work".into(),
            );
        }
        if self.damaged > 0 {
            let incidents: Vec<String> = self.incidents.iter().map(Uuid::to_string).collect();
            lines.push(format!(
                "{} found damaged since the start, see the log for incident {}; the others can be read; \
                 stop the service and run `signorini doctor`",
                number_of(self.damaged, "record"),
                incidents.join(", ")
            ));
        }
        lines
    }
}

impl Store {
    /// Reads the newest and the oldest job as clients do, and checks the files; an error if that does not work. A
    /// damaged record of a job is no error: the others can be read.
    pub async fn health(self: &Arc<Self>) -> Result<Health> {
        self.identity.check()?;
        self.identity.check_header()?;
        self.damages.can_write()?;
        let newest = self.read(first("select * from job order by id desc limit 1"));
        let oldest = self.read_list(first("select * from job order by id limit 1"));
        for read in [newest.await, oldest.await] {
            match read {
                // of a job: the others can be read
                Err(StoreError::Damaged(damage)) if damage.record.job.is_some() => {}
                // lists use all connections, which shows that they are answered
                Ok(_) | Err(StoreError::Busy) => {}
                Err(error) => return Err(error),
            }
        }
        let (damaged, incidents) = self.damages.summary();
        Ok(Health {
            full: self.reserve.is_disk_full(),
            damaged,
            incidents,
        })
    }
}

impl Store {
    /// Waits until the single writer and a reader have answered, even with an error: neither a full disk nor a damaged
    /// database gets better by a restart. False if no connection becomes free in time.
    pub async fn answers(self: &Arc<Self>) -> bool {
        let write = self.write(|writer| {
            let _ = writer.begin_control(); // rolled back
            Ok(())
        });
        let read = self.read(|_, connection| {
            let _ = connection.optional_value::<i64>("select 1 from job limit 1", ());
            Ok(())
        });
        let is_busy = |answer| matches!(answer, Err(StoreError::Busy));
        !is_busy(write.await) && !is_busy(read.await)
    }

    /// An error if the disk has no space except for control operations; for data that are written beside the database.
    pub fn has_room(&self) -> Result<()> {
        self.reserve.has_room()
    }
}

/// A query for its first job.
fn first(
    query: &'static str,
) -> impl FnOnce(&Store, &Connection) -> Result<Option<Job>> + Send + 'static {
    move |_, connection| connection.row(query, (), from_row)
}

/// Checks the files of the store, flushes the file that records its progress, and takes its reserve again, until the
/// store is dropped or closed.
pub(super) async fn watch(store: Weak<Store>) {
    let (mut set_by_s, mut was_full) = (0.0, false);
    loop {
        tokio::time::sleep(INTERVAL).await;
        let now_s = Time::clock_was_set_by_s();
        if (now_s - set_by_s).abs() > 1.0 {
            tracing::warn!(
                "the clock of the machine was set by {:+.0} s; the times of jobs ignore this until the next start",
                now_s - set_by_s
            );
            set_by_s = now_s;
        }
        let Some(store) = store.upgrade() else { return };
        if store.is_closed() {
            return;
        }
        let watched = tokio::task::spawn_blocking(move || {
            let _ = store.identity.check(); // logs what is wrong
            store.reserve.retake();
            (store.reserve.is_disk_full(), store.progress.sync())
        });
        let Ok((full, synced)) = watched.await else {
            continue;
        };
        if let Err(error) = synced {
            tracing::debug!(%error, "the progress could not be flushed: {error}");
        }
        match (was_full, full) {
            (false, true) => tracing::warn!(
                "the disk is full: no job is accepted and no result is stored until there is space; \
                 canceling, deleting, pausing and reading work"
            ),
            (true, false) => {
                tracing::info!("there is space on the disk again: jobs are accepted");
            }
            _ => {}
        }
        was_full = full;
    }
}
