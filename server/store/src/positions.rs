//! The position of a job in the queue, from the mirror in memory.

use std::{collections::BTreeSet, sync::Arc};

use base::job::{Job, QueuePosition, Status, Waiting};
use rusqlite::Connection;

use super::{
    database::Store,
    error::Result,
    rows::find,
    sizes,
    sql::Sql,
    waiting::{Move, Owner, Place, WaitingJobs},
};

/// The jobs that wait for a worker.
pub(super) const WAITING: &str = "select priority, owner, id from job indexed by job_queue
     where status = 'queued' and coalesced_into is null order by priority desc, id";

impl Store {
    /// Reads the waiting jobs, when the store is opened.
    pub(super) async fn read_waiting_jobs(self: &Arc<Self>) -> Result<()> {
        *self.waiting_jobs() = self.waiting_in_database().await?;
        Ok(())
    }

    /// The waiting jobs as the database has them; whose turn it was is not stored.
    pub(super) async fn waiting_in_database(self: &Arc<Self>) -> Result<WaitingJobs> {
        self.read(|_, connection| waiting_in_database(connection))
            .await
    }

    /// How many jobs of this owner wait, and how many run.
    pub fn load_of(&self, owner: &str) -> (usize, usize) {
        let waiting = self.waiting_jobs();
        (waiting.len_of(owner), waiting.running(owner))
    }

    /// The owners of jobs that wait or run.
    pub fn owners_with_load(&self) -> BTreeSet<String> {
        self.waiting_jobs().owners().map(str::to_owned).collect()
    }

    /// Sets how many jobs of one owner may run at the same time; once and before any is claimed.
    pub fn set_most_running_of_owner(&self, most: usize) {
        let _ = self.most_running.set(most); // fails if it is set already, which is kept
    }

    /// How many jobs of one owner may run at the same time.
    pub fn most_running_of_owner(&self) -> usize {
        self.most_running.get().copied().unwrap_or(usize::MAX)
    }

    /// How many jobs wait for a worker, or for the job that they are coalesced into.
    pub fn waiting(&self) -> usize {
        self.waiting_jobs().len()
    }

    /// Fills in the queue positions, and what jobs keep that have ended, if they can be read: a request that has changed
    /// something is answered even without them.
    pub(super) fn try_to_complete(&self, connection: &Connection, jobs: &mut [Job]) {
        if let Err(cause) = self.damages.noting(self.complete(connection, jobs)) {
            tracing::warn!(%cause, "queue positions and sizes could not be read: {cause}");
        }
    }

    /// Fills in what is not in the row of a job: its position in the queue, and what it keeps once it has ended.
    pub(super) fn complete(&self, connection: &Connection, jobs: &mut [Job]) -> Result<()> {
        self.add_queue_positions(connection, jobs)?;
        self.add_full_disk(jobs);
        sizes::add_sizes(connection, jobs)
    }

    /// What running jobs find cannot be stored while the disk is full: one that is solved stays running.
    fn add_full_disk(&self, jobs: &mut [Job]) {
        if !self.reserve.was_disk_full() {
            return;
        }
        for job in jobs.iter_mut().filter(|job| job.status == Status::Running) {
            let progress = job.progress.get_or_insert_default();
            progress.stage = <&str>::from(Waiting::LowDisk).to_owned();
            progress.eta_s = None;
        }
    }

    /// Fills in the queue positions of those that are queued. A coalesced job has the position and the progress of
    /// its primary.
    fn add_queue_positions(&self, connection: &Connection, jobs: &mut [Job]) -> Result<()> {
        for job in jobs.iter_mut().filter(|job| job.status == Status::Queued) {
            let position = |job: &Job| {
                let waiting = self.waiting_jobs();
                let ahead = waiting.ahead(job.priority, &job.owner, job.key)? as i64;
                Some((ahead + 1, ahead))
            };
            let Some(primary) = job.coalesced_into else {
                let reason = match self.is_paused() {
                    true => Waiting::Paused,
                    false if self.reserve.was_disk_full() => Waiting::LowDisk,
                    false if self.load_of(&job.owner).1 >= self.most_running_of_owner() => {
                        Waiting::OwnerLimit
                    }
                    false if self.budget().is_short() => Waiting::Memory,
                    false => Waiting::WorkersBusy,
                };
                // none if it has been started since it was read
                job.queue = position(job).map(|(position, ahead)| QueuePosition {
                    position,
                    ahead,
                    reason,
                });
                continue;
            };
            let Some(primary) = find(connection, primary)? else {
                continue; // it ended, and was deleted, since this job was read
            };
            let (position, ahead) = position(&primary).unwrap_or_default();
            job.progress = primary.progress;
            job.queue = Some(QueuePosition {
                position,
                ahead,
                reason: Waiting::Coalesced,
            });
        }
        Ok(())
    }
}

/// The waiting jobs as the database has them; whose turn it was is not stored.
fn waiting_in_database(connection: &Connection) -> Result<WaitingJobs> {
    let waiting = match connection.rows(WAITING, (), |row| Ok(row.try_into()?)) {
        Ok(waiting) => waiting,
        // a page or a name that cannot be read: the others go on
        Err(_) => waiting_one_by_one(connection)?,
    };
    // what cannot be read counts for nobody
    let owners_of = |statement| connection.values(statement, ()).unwrap_or_default();
    let coalesced: Vec<String> =
        owners_of("select owner from job where coalesced_into is not null");
    let running = owners_of("select owner from job where status = 'running'");
    let mut mirror = WaitingJobs::default();
    let mut names: BTreeSet<Owner> = BTreeSet::new();
    // one text for all jobs of an owner
    let mut named = |name: String| match names.get(name.as_str()) {
        Some(known) => known.clone(),
        None => {
            let name = Owner::from(name);
            names.insert(name.clone());
            name
        }
    };
    for (priority, owner, key) in waiting {
        let owner = named(owner);
        mirror.apply(Move::Enter(Place {
            priority,
            owner,
            key,
        }));
    }
    for owner in coalesced {
        mirror.apply(Move::Attach(named(owner)));
    }
    for owner in running {
        mirror.apply(Move::Start(named(owner)));
    }
    Ok(mirror)
}

/// The same as `WAITING`, without jobs that cannot be read.
fn waiting_one_by_one(connection: &Connection) -> Result<Vec<(i32, String, i64)>> {
    let keys: Vec<(i32, i64)> = connection.rows(
        "select priority, id from job indexed by job_queue
         where status = 'queued' and coalesced_into is null order by priority desc, id",
        (),
        |row| Ok(row.try_into()?),
    )?;
    let mut found = vec![];
    for (priority, key) in keys {
        match connection.value("select owner from job where id = ?", [key]) {
            Ok(owner) => found.push((priority, owner, key)),
            Err(error) => {
                tracing::error!(job.key = key, %error, "a waiting job cannot be read and will not be started: {error}");
            }
        }
    }
    Ok(found)
}
