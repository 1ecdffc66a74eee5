//! Waiting before a failed write to the store is retried.

use std::time::Duration;

use tokio_util::sync::CancellationToken;

/// Increasing waits between attempts to store data that must not be lost.
#[derive(Debug)]
pub(super) struct Backoff(Duration);

impl Default for Backoff {
    fn default() -> Self {
        Backoff(Duration::from_millis(100))
    }
}

impl Backoff {
    /// Waits; false if the service stops meanwhile.
    pub(super) async fn wait(&mut self, stopping: &CancellationToken) -> bool {
        const LONGEST: Duration = Duration::from_secs(5);
        let pause = self.0;
        self.0 = (pause * 3).min(LONGEST);
        tokio::select! {
            () = tokio::time::sleep(pause) => true,
            () = stopping.cancelled() => false,
        }
    }
}
