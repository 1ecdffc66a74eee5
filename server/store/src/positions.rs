//! Fills in what the row of a job does not have: its position in the queue, and the size of what it keeps.

use base::job::{Job, QueuePosition, Status, Waiting};
use rusqlite::Connection;

use super::{database::Store, error::Result, rows::find, sizes, turns::Line};

impl Store {
    /// Fills in the queue positions, and the size of what ended jobs keep, if they can be read: a request that has
    /// changed something is answered even without them.
    pub(super) fn try_to_complete(&self, connection: &Connection, jobs: &mut [&mut Job]) {
        if let Err(cause) = self.damages.noting(self.complete(connection, jobs)) {
            tracing::warn!(%cause, "queue positions and sizes could not be read: {cause}");
        }
    }

    /// Fills in the positions of queued jobs, and the size of what ended jobs keep.
    pub(super) fn complete(&self, connection: &Connection, jobs: &mut [&mut Job]) -> Result<()> {
        self.add_queue_positions(connection, jobs)?;
        self.add_full_disk(jobs);
        sizes::add_sizes(connection, jobs)
    }

    /// Sets the stage `low_disk` in the progress of running jobs while the disk is full: their results cannot be
    /// stored, and a job that is solved stays running.
    fn add_full_disk(&self, jobs: &mut [&mut Job]) {
        if !self.reserve.was_disk_full() {
            return;
        }
        for job in jobs.iter_mut().filter(|job| job.status == Status::Running) {
            let progress = job.progress.get_or_insert_default();
            progress.stage = <&str>::from(Waiting::LowDisk).to_owned();
            progress.eta_s = None;
        }
    }

    /// Fills in the queue positions of the queued jobs. A coalesced job has the position and the progress of its
    /// primary.
    fn add_queue_positions(&self, connection: &Connection, jobs: &mut [&mut Job]) -> Result<()> {
        let mut queue = None;
        for job in jobs.iter_mut().filter(|job| job.status == Status::Queued) {
            let queue = match &mut queue {
                Some(queue) => queue,
                none => none.insert(Line::read(connection)?),
            };
            let Some(primary) = job.coalesced_into else {
                // none if it has been started since it was read
                let ahead = queue.ahead(job)?;
                let reason = self.why_it_waits(job, queue.running_of(&job.owner));
                job.queue = ahead.map(|ahead| position(ahead, reason));
                continue;
            };
            let Some(primary) = find(connection, primary)? else {
                continue; // it ended, and was deleted, since this job was read
            };
            let ahead = queue.ahead(&primary)?;
            job.progress = primary.progress;
            job.queue = Some(match ahead {
                Some(ahead) => position(ahead, Waiting::Coalesced),
                // it runs
                None => QueuePosition {
                    position: 0,
                    ahead: 0,
                    reason: Waiting::Coalesced,
                },
            });
        }
        Ok(())
    }

    /// Why a job waits for a worker, if its owner has this many running jobs.
    fn why_it_waits(&self, job: &Job, running: i64) -> Waiting {
        if self.is_paused() {
            Waiting::Paused
        } else if self.reserve.was_disk_full() {
            Waiting::LowDisk
        } else if running >= self.most_running_of_owner() {
            Waiting::OwnerLimit
        } else if self.budget().fits_nowhere(job.memory_bytes) {
            Waiting::NoWorkerFits
        } else if self.budget().is_short() {
            Waiting::Memory
        } else {
            Waiting::WorkersBusy
        }
    }
}

fn position(ahead: i64, reason: Waiting) -> QueuePosition {
    QueuePosition {
        position: ahead + 1,
        ahead,
        reason,
    }
}
