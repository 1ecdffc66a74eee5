//! From the queue to the workers: whenever one is free and a job waits.

use std::{sync::Arc, time::Duration};

use tokio::sync::OwnedSemaphorePermit;
use tracing::error;

use super::{running::Running, state::Queue, worker};
use crate::{
    store::{Accepted, Claim, Result, Submission},
    time::Time,
};

/// The longest that a job waits for its end after the end of its time in the queue.
const TICK: Duration = Duration::from_secs(1);

impl Queue {
    /// Starts the workers. They run until the drain.
    pub fn start(self: &Arc<Self>) {
        self.slots.add_permits(usize::from(self.workers));
        tokio::spawn(self.clone().dispatch());
        tokio::spawn(self.clone().watch_the_clock());
    }

    /// Accepts jobs. They are on the disk when this returns; if a worker is free, the first of the queue is
    /// in its hands with the same commit.
    pub async fn submit(self: &Arc<Self>, submission: Submission) -> Result<Accepted> {
        let Some(slot) = self.free_slot() else {
            let mut accepted = self.store.submit(submission, false).await?;
            self.announce(&accepted.changed);
            self.wake.notify_one();
            self.store.try_to_place(&mut accepted.jobs).await;
            return Ok(accepted);
        };
        let _gate = self.gate.read().await;
        let claim = !self.stopping.is_cancelled() && !self.store.is_paused();
        let submitted = self.store.submit(submission, claim).await;
        match submitted {
            Ok(mut accepted) => {
                self.announce(&accepted.changed);
                match accepted.claim.take() {
                    Some(claim) => self.begin(claim, slot),
                    None => drop(slot),
                }
                self.wake.notify_one(); // several may have come, or the slot is free again
                self.store.try_to_place(&mut accepted.jobs).await;
                Ok(accepted)
            }
            Err(cause) => {
                drop(slot);
                self.wake.notify_one();
                Err(cause)
            }
        }
    }

    /// Claims whenever a slot is free and something waits, until the drain.
    async fn dispatch(self: Arc<Self>) {
        loop {
            // A word said from here on is kept for the wait below: nothing is overlooked.
            while let Some(slot) = self.free_slot() {
                match self.claim(slot).await {
                    Ok(true) => {}
                    Ok(false) => break,
                    Err(cause) => {
                        error!(%cause, "no job could be claimed: {cause}");
                        tokio::time::sleep(Duration::from_secs(1)).await; // a full disk may pass
                    }
                }
            }
            tokio::select! {
                () = self.wake.notified() => {}
                () = self.stopping.cancelled() => return,
            }
        }
    }

    /// A worker that may start something.
    fn free_slot(&self) -> Option<OwnedSemaphorePermit> {
        if self.store.is_paused() || self.stopping.is_cancelled() {
            return None;
        }
        self.slots.clone().try_acquire_owned().ok()
    }

    /// Takes the next job, if there is one.
    async fn claim(self: &Arc<Self>, slot: OwnedSemaphorePermit) -> Result<bool> {
        let _gate = self.gate.read().await;
        if self.stopping.is_cancelled() || self.store.is_paused() {
            return Ok(false);
        }
        let (claim, changed) = self.store.claim_next().await?;
        self.announce(&changed);
        match claim {
            Some(claim) => self.begin(claim, slot),
            None if changed.is_empty() => return Ok(false),
            None => {} // some were answered; there may be more
        }
        Ok(true)
    }

    /// Hands a claimed job to a worker. Under the gate.
    fn begin(self: &Arc<Self>, claim: Claim, slot: OwnedSemaphorePermit) {
        let running = Running {
            attempt: claim.job.attempt,
            stop: Arc::default(),
        };
        self.running().insert(claim.job.key, running.clone());
        let queue = self.clone();
        tokio::spawn(async move {
            worker::attempt(&queue, claim, running).await;
            drop(slot);
            queue.wake.notify_one();
        });
    }

    /// Ends jobs that have waited too long, and forgets what was deleted long ago, until the drain.
    async fn watch_the_clock(self: Arc<Self>) {
        loop {
            match self.store.expire_queued(Time::now()).await {
                Ok(changed) if changed.is_empty() => {}
                Ok(changed) => {
                    self.announce(&changed);
                    self.wake.notify_one();
                    continue; // there may be more
                }
                Err(cause) => {
                    error!(%cause, "jobs that waited too long could not be ended: {cause}")
                }
            }
            if let Err(cause) = self.store.forget_deleted(Time::now()).await {
                error!(%cause, "names of deleted jobs could not be forgotten: {cause}");
            }
            tokio::select! {
                () = tokio::time::sleep(TICK) => {}
                () = self.stopping.cancelled() => return,
            }
        }
    }
}
