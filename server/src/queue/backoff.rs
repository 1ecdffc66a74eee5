//! Trying again what could not be stored.

use std::time::Duration;

use tokio_util::sync::CancellationToken;

/// Ever longer waits between tries to store what must not be lost.
#[derive(Debug)]
pub(super) struct Pauses(Duration);

impl Default for Pauses {
    fn default() -> Self {
        Pauses(Duration::from_millis(100))
    }
}

impl Pauses {
    /// Waits; false if the service stops meanwhile.
    pub(super) async fn next(&mut self, stopping: &CancellationToken) -> bool {
        const LONGEST: Duration = Duration::from_secs(10);
        let pause = self.0;
        self.0 = (pause * 3).min(LONGEST);
        tokio::select! {
            () = tokio::time::sleep(pause) => true,
            () = stopping.cancelled() => false,
        }
    }
}
