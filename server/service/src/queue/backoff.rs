//! Pauses before a failed write to the store is retried.

use std::time::Duration;

use base::job::JobId;
use store::StoreError;
use tokio_util::sync::CancellationToken;
use tracing::error;

/// The number of attempts to store data, over some seconds, after which an unreadable disk is not tried again.
const MOST_TRIES_TO_READ: u32 = 5;

/// Growing pauses between attempts to store data that must not be lost.
#[derive(Debug)]
pub(super) struct Backoff {
    pause: Duration,
    tries: u32,
}

impl Default for Backoff {
    fn default() -> Self {
        Backoff {
            pause: Duration::from_millis(100),
            tries: 1,
        }
    }
}

impl Backoff {
    /// Whether further attempts to store data of this job are useless. If so, this is logged, and the caller should
    /// give the job up, so that its worker is free for other jobs.
    pub(super) fn gives_up(&self, id: JobId, key: i64, cause: &StoreError) -> bool {
        let unreadable =
            matches!(cause, StoreError::Damaged(_)) && self.tries >= MOST_TRIES_TO_READ;
        let gives_up = unreadable || cause.is_lasting(key);
        if gives_up {
            error!(job.id = %id, %cause, "job {id} cannot be stored any more: {cause}");
        }
        gives_up
    }

    /// Waits for the next pause; returns false if the service stops in the meantime.
    pub(super) async fn wait(&mut self, stopping: &CancellationToken) -> bool {
        const LONGEST: Duration = Duration::from_secs(5);
        let pause = self.pause;
        self.pause = (pause * 3).min(LONGEST);
        self.tries += 1;
        tokio::select! {
            () = tokio::time::sleep(pause) => true,
            () = stopping.cancelled() => false,
        }
    }
}
