//! The position of a job in the queue, from the mirror in memory.

use sqlx::SqliteConnection;

use super::{database::Store, error::Result, rows::find, waiting::Move};
use crate::job::{Job, QueuePosition, Status, Waiting};

impl Store {
    /// Reads the waiting jobs, when the store is opened.
    pub(super) async fn read_waiting_jobs(&self) -> Result<()> {
        let waiting: Vec<(i32, i64)> = sqlx::query_as(
            "select priority, id from job where status = 'queued' and coalesced_into is null order by priority desc, id",
        )
        .fetch_all(&self.reader)
        .await?;
        let coalesced: i64 =
            sqlx::query_scalar("select count(*) from job where coalesced_into is not null")
                .fetch_one(&self.reader)
                .await?;
        let mut mirror = self.waiting_jobs();
        for (priority, key) in waiting {
            mirror.apply(Move::Enter { priority, key });
        }
        (0..coalesced).for_each(|_| mirror.apply(Move::Attach));
        Ok(())
    }

    /// How many jobs wait for a worker, or for the job that they are coalesced into.
    pub fn waiting(&self) -> usize {
        self.waiting_jobs().len()
    }

    /// Fills in the queue positions, if they can be read: a request that has changed something is answered even without
    /// them.
    pub async fn try_add_queue_positions(&self, jobs: &mut [Job]) {
        if jobs.iter().all(|job| job.status != Status::Queued) {
            return;
        }
        let added = async {
            let mut connection = self.reader.acquire().await?;
            self.add_queue_positions(&mut connection, jobs).await
        };
        if let Err(cause) = added.await {
            tracing::warn!(%cause, "queue positions could not be read: {cause}");
        }
    }

    /// Fills in the queue positions of those that are queued. A coalesced job has the position and the progress of
    /// its primary.
    pub(super) async fn add_queue_positions(
        &self,
        connection: &mut SqliteConnection,
        jobs: &mut [Job],
    ) -> Result<()> {
        for job in jobs.iter_mut().filter(|job| job.status == Status::Queued) {
            let position = |priority, key| {
                let ahead = self.waiting_jobs().ahead(priority, key)? as i64;
                Some((ahead + 1, ahead))
            };
            let Some(primary) = job.coalesced_into else {
                let reason = match self.is_paused() {
                    true => Waiting::Paused,
                    false if self.budget().is_short() => Waiting::Memory,
                    false => Waiting::WorkersBusy,
                };
                // none if it has been started since it was read
                job.queue =
                    position(job.priority, job.key).map(|(position, ahead)| QueuePosition {
                        position,
                        ahead,
                        reason,
                    });
                continue;
            };
            let Some(primary) = find(connection, primary).await? else {
                continue; // it ended, and was deleted, since this job was read
            };
            let (position, ahead) = position(primary.priority, primary.key).unwrap_or_default();
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
