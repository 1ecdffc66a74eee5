//! The place of a job in the queue, from the mirror in memory.

use sqlx::SqliteConnection;

use super::{database::Store, error::Result, line::Move, rows::find};
use crate::job::{Job, QueuePosition, Status, Waiting};

impl Store {
    /// Fills the line with the jobs that wait.
    pub(super) async fn fill_line(&self) -> Result<()> {
        let waiting: Vec<(i32, i64)> = sqlx::query_as(
            "select priority, id from job where status = 'queued' and twin_of is null order by priority desc, id",
        )
        .fetch_all(&self.reader)
        .await?;
        let joined: i64 = sqlx::query_scalar("select count(*) from job where twin_of is not null")
            .fetch_one(&self.reader)
            .await?;
        let mut line = self.line();
        for (priority, key) in waiting {
            line.make(Move::Enter { priority, key });
        }
        (0..joined).for_each(|_| line.make(Move::Join));
        Ok(())
    }

    /// How many jobs wait for a worker, or for another job.
    pub fn waiting(&self) -> usize {
        self.line().len()
    }

    /// As `place`, where the work is done already, and an answer without places is better than none.
    pub async fn try_to_place(&self, jobs: &mut [Job]) {
        if jobs.iter().all(|job| job.status != Status::Queued) {
            return;
        }
        let placed = async {
            let mut connection = self.reader.acquire().await?;
            self.place(&mut connection, jobs).await
        };
        if let Err(cause) = placed.await {
            tracing::warn!(%cause, "places could not be told: {cause}");
        }
    }

    /// Fills in the places of those that are queued. A job that another one will answer is where that one
    /// is, and has come as far.
    pub(super) async fn place(
        &self,
        connection: &mut SqliteConnection,
        jobs: &mut [Job],
    ) -> Result<()> {
        for job in jobs.iter_mut().filter(|job| job.status == Status::Queued) {
            let position = |priority, key| {
                let ahead = self.line().ahead(priority, key)? as i64;
                Some((ahead + 1, ahead))
            };
            let Some(source) = job.twin_of else {
                let reason = match self.is_paused() {
                    true => Waiting::Paused,
                    false => Waiting::WorkersBusy,
                };
                // none: it left the line since it was read
                job.queue =
                    position(job.priority, job.key).map(|(position, ahead)| QueuePosition {
                        position,
                        ahead,
                        reason,
                    });
                continue;
            };
            let Some(source) = find(connection, source).await? else {
                continue; // it ended, and was deleted, since this job was read
            };
            let (position, ahead) = position(source.priority, source.key).unwrap_or_default();
            job.progress = source.progress;
            job.queue = Some(QueuePosition {
                position,
                ahead,
                reason: Waiting::Joined,
            });
        }
        Ok(())
    }
}
