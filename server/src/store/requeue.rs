//! Back to the queue: at a drain, and after the process has died under a job.

use super::{
    change::Change,
    database::Store,
    end::end,
    error::Result,
    events,
    life::{self, Ending},
    rows::{from_row, is_current, read},
    twins,
};
use crate::{
    event::{Payload, Requeue},
    job::{Job, Reason, Status},
    time::Time,
};

impl Store {
    /// Puts a running job back for a drain, which does not count against it; one that was asked to
    /// stop is canceled instead. Gives its new status; `None` when the start is no longer current.
    pub async fn requeue_drained(&self, key: i64, attempt: i32) -> Result<Option<Status>> {
        let mut change = self.change().await?;
        if !is_current(change.sql(), key, attempt).await? {
            return Ok(None);
        }
        let job = read(change.sql(), key).await?;
        // Somebody who asked it to stop is not made to wait for the restart.
        let status = if job.cancel_requested {
            end(&mut change, &job, &Ending::canceled()).await?;
            Status::Canceled
        } else {
            requeue(&mut change, &job, Requeue::Drain).await?;
            Status::Queued
        };
        change.commit().await?;
        Ok(Some(status))
    }

    /// Takes care of jobs that were running when the process died: back to the queue, or to their
    /// end when somebody wanted that or when too many starts were lost. Before the listener opens.
    pub async fn requeue_interrupted(&self) -> Result<usize> {
        let mut change = self.change().await?;
        let rows = sqlx::query("select * from job where status = 'running'")
            .fetch_all(change.sql())
            .await?;
        for row in &rows {
            let job = from_row(row)?;
            if job.cancel_requested {
                end(&mut change, &job, &Ending::canceled()).await?;
            } else if job.attempt >= job.max_attempts {
                let detail = format!(
                    "the process died during each of {} starts",
                    job.max_attempts
                );
                end(
                    &mut change,
                    &job,
                    &Ending::failed(Reason::WorkerLost, detail),
                )
                .await?;
            } else {
                requeue(&mut change, &job, Requeue::WorkerLost).await?;
            }
        }
        change.commit().await?;
        Ok(rows.len())
    }
}

async fn requeue(change: &mut Change<'_>, job: &Job, why: Requeue) -> Result<()> {
    life::change(change, job, Status::Queued).await?;
    // The start keeps its number, so that events tell starts apart, but a drain gives it back.
    let given_back = i32::from(why == Requeue::Drain);
    sqlx::query("update job set max_attempts = max_attempts + ? where id = ?")
        .bind(given_back)
        .bind(job.key)
        .execute(change.sql())
        .await?;
    // its waiting begins anew, and that of the jobs that wait for it
    sqlx::query("update job set expires_at = ? + cast(queue_ttl_s * 1e6 as integer) where id = ? or twin_of = ?")
        .bind(Time::now().micros())
        .bind(job.key)
        .bind(job.key)
        .execute(change.sql())
        .await?;
    // it runs no more: a twin of a higher priority need not wait for it
    twins::overtake(change, job.key, job.priority).await?;
    let back = [(Time::now(), Payload::requeued(why))];
    events::append(change.sql(), job.key, job.attempt, &back).await?;
    change.changed(job.key);
    Ok(())
}
