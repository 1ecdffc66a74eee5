//! Stopping solvers: on a client's cancel, and when the service stops.

use std::{sync::Arc, time::Duration};

use base::job::Status;
use store::{CancelOutcome, Ending, Result, StoreError};
use tracing::{error, info, warn};

use super::{
    backoff::Backoff,
    running::{Running, StopReason},
    state::Queue,
};

/// How long a solver may take to stop; after that its job is canceled without waiting for the solver, which keeps its
/// worker busy. This is half of the time that the API promises: the rest is for commits.
pub(super) const CANCEL_GRACE: Duration = Duration::from_millis(250);

impl Queue {
    /// Asks a job to stop. When this function returns, a queued job is canceled; a running job ends within half a
    /// second.
    pub async fn cancel(self: &Arc<Self>, key: i64) -> Result<CancelOutcome> {
        let _guard = self.claiming.write().await;
        let requested = self.store.request_cancel(key).await;
        let mut outcome = match (requested, self.running().get(&key)) {
            // it is remembered by the store, and stored with the end of the job
            (Err(StoreError::Full), Some(running)) => CancelOutcome::Requested {
                attempt: running.attempt,
            },
            // nothing can end it, but its solver need not go on
            (Err(error), Some(running)) if error.is_lasting(key) => {
                running.stop(StopReason::Unwanted);
                return Err(error);
            }
            (requested, _) => requested?,
        };
        if let CancelOutcome::Requested { attempt } = outcome {
            let running = self.running().get(&key).cloned();
            match running {
                Some(running) => {
                    self.announce(&[key]); // the request has changed its version
                    running.stop(StopReason::Unwanted);
                    tokio::spawn(self.clone().force_cancel(key, running));
                }
                // its worker has released it because the service stops: nothing else would end it
                None => {
                    let ended = self.end_attempt(key, attempt, &Ending::canceled()).await?;
                    outcome = if ended {
                        CancelOutcome::Canceled(vec![])
                    } else {
                        CancelOutcome::AlreadyTerminal
                    };
                }
            }
        }
        if let CancelOutcome::Canceled(changed) = &outcome {
            self.announce(changed);
            self.wake.notify_one(); // a job coalesced into it may have taken its place
        }
        Ok(outcome)
    }

    /// Asks the jobs at the beginning of `keys` to stop, all queued ones in one transaction. Returns how many of `keys`
    /// were handled, and how many of the handled jobs had not ended before.
    pub async fn cancel_some(self: &Arc<Self>, keys: &[i64]) -> Result<(usize, usize)> {
        let batch = self.store.cancel_queued(keys).await?;
        self.announce(&batch.changed);
        self.wake.notify_one();
        let mut changed = batch.done;
        for key in batch.running {
            changed += usize::from(self.cancel(key).await? != CancelOutcome::AlreadyTerminal);
        }
        Ok((batch.seen, changed))
    }

    /// Cancels a job whose solver does not stop in time; does nothing if the attempt has ended. This is retried until
    /// it succeeds, since the client was told that the job ends.
    async fn force_cancel(self: Arc<Self>, key: i64, running: Running) {
        let Running { id, attempt, .. } = running;
        tokio::time::sleep(CANCEL_GRACE).await;
        let mut backoff = Backoff::default();
        loop {
            match self.end_attempt(key, attempt, &Ending::canceled()).await {
                Ok(true) => {
                    return warn!(
                        job.id = %id,
                        "job {id} was canceled, but its worker is not free yet"
                    );
                }
                Ok(false) => return,
                Err(cause) if backoff.gives_up(id, key, &cause) => return,
                Err(cause) => {
                    error!(job.id = %id, %cause, "job {id} could not be canceled yet: {cause}")
                }
            }
            if !backoff.wait(&self.stopping).await {
                return;
            }
        }
    }

    /// Stops taking jobs, and requeues those that run here for the next start of the service, without waiting for their
    /// solvers. Jobs of workers elsewhere go on.
    pub async fn drain(&self) {
        self.stopping.cancel();
        let _guard = self.claiming.write().await; // no claim is under way
        let running: Vec<(i64, Running)> = self
            .running()
            .iter()
            .filter(|(_, running)| running.here)
            .map(|(key, running)| (*key, running.clone()))
            .collect();
        for (key, running) in running {
            running.stop(StopReason::Unwanted);
            let Running { id, attempt, .. } = running;
            match self.store.requeue_drained(key, attempt).await {
                Ok(Some(Status::Canceled)) => {
                    info!(
                        job.id = %id,
                        attempt, "job {id} was canceled, as requested before the service stopped"
                    );
                }
                Ok(Some(_)) => info!(
                    job.id = %id,
                    attempt, "job {id} is requeued for the next start of the service"
                ),
                Ok(None) => {}
                // the next start of the service finds it running, and requeues it
                Err(cause) => {
                    error!(job.id = %id, %cause, "job {id} could not be requeued: {cause}")
                }
            }
        }
    }
}
