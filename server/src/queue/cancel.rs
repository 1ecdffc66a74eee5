//! Ends before the solver's own: a client's cancel, and the drain of the service.

use std::{sync::Arc, time::Duration};

use tracing::{error, info};

use super::{
    running::{Running, Why},
    state::Queue,
};
use crate::{
    job::Status,
    store::{CancelOutcome, Ending, Result},
};

/// A solver that was asked to stop gets this long; then the job is canceled over its head and only
/// the worker's slot waits for it. Half of what the API promises, the rest is for commits.
pub(super) const COOPERATION: Duration = Duration::from_millis(250);

impl Queue {
    /// Asks a job to stop. A queued one is canceled when this returns, a running one within half a
    /// second.
    pub async fn cancel(self: &Arc<Self>, key: i64) -> Result<CancelOutcome> {
        let _gate = self.gate.write().await;
        let mut outcome = self.store.request_cancel(key).await?;
        if let CancelOutcome::Requested { attempt } = outcome {
            let running = self.running().get(&key).cloned();
            match running {
                Some(running) => {
                    self.announce(&[key]); // the wish is a new version
                    running.stop(Why::Unwanted);
                    tokio::spawn(self.clone().cancel_over_its_head(key, running.attempt));
                }
                // Its worker has let it go, as the service stops: nobody else would end it.
                None => {
                    let ended = self.end(key, attempt, &Ending::canceled()).await?;
                    outcome = match ended {
                        true => CancelOutcome::Canceled(vec![]),
                        false => CancelOutcome::AlreadyTerminal,
                    };
                }
            }
        }
        if let CancelOutcome::Canceled(changed) = &outcome {
            self.announce(changed);
            self.wake.notify_one(); // a twin may have taken its place
        }
        Ok(outcome)
    }

    async fn cancel_over_its_head(self: Arc<Self>, key: i64, attempt: i32) {
        tokio::time::sleep(COOPERATION).await;
        if let Err(cause) = self.end(key, attempt, &Ending::canceled()).await {
            error!(job.key = key, %cause, "job could not be canceled: {cause}");
        }
    }

    /// Takes no more jobs and puts those that are running back for the next start of the service,
    /// without waiting for their solvers.
    pub async fn drain(&self) {
        self.stopping.cancel();
        let _gate = self.gate.write().await; // whoever is claiming has entered its job
        let running: Vec<(i64, Running)> = self
            .running()
            .iter()
            .map(|(key, running)| (*key, running.clone()))
            .collect();
        for (key, running) in running {
            running.stop(Why::Unwanted);
            let attempt = running.attempt;
            match self.store.requeue_drained(key, attempt).await {
                Ok(Some(Status::Canceled)) => {
                    info!(
                        job.key = key,
                        attempt, "job canceled, as was asked before the stop"
                    );
                }
                Ok(Some(_)) => info!(job.key = key, attempt, "job put back for the next start"),
                Ok(None) => {}
                // The next start finds it running and puts it back.
                Err(cause) => error!(job.key = key, %cause, "job could not be put back: {cause}"),
            }
        }
    }
}
