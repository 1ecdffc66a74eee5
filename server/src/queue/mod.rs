//! The queue: which task may do what, and what wakes it.
//!
//! `workers` tasks each take the next job from the store, have it solved on a blocking thread and
//! record what it says. A worker *subscribes* to the wake-up before it looks for work, so that a
//! job accepted in between is not overlooked. Beside each running solver a recorder task commits
//! its events in batches and then announces the number of the last one; watchers read rows from
//! the store up to that number. No event travels through a channel to a watcher, so none is seen
//! twice, missed, or taken back by a crash.
//!
//! Who may end a job? Any of worker, canceler and drain may try; the store lets one of them, by
//! checking in one transaction that the start is still current. The others are too late.

mod live;
mod recorder;
mod worker;

use std::{
    collections::HashMap,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    time::Duration,
};

use tokio::sync::Notify;
use tokio_util::sync::CancellationToken;
use tracing::{error, info};

use live::Live;
pub use live::Subscription;

use crate::{
    job::{Job, Status},
    run::Solve,
    store::{CancelOutcome, Claim, Ending, Result, Store},
};

/// A solver that was asked to stop gets this long; then the job is canceled over its head and only
/// the worker's slot waits for it. Half of what the API promises, the rest is for commits.
const COOPERATION: Duration = Duration::from_millis(250);

/// Accepts no jobs itself (the store does), but runs, cancels and announces them.
#[derive(Debug)]
pub struct Queue {
    store: Arc<Store>,
    solve: Solve,
    wake: Notify,
    live: Live,
    /// Jobs in the hands of a worker of this process.
    running: Mutex<HashMap<i64, Running>>,
    /// Held while a job is claimed and entered into `running`, and while one is asked to stop: a
    /// cancel never falls between the two.
    gate: tokio::sync::Mutex<()>,
    stopping: CancellationToken,
}

/// The handle on a solver at work.
#[derive(Clone, Debug)]
struct Running {
    attempt: i32,
    stop: Arc<AtomicBool>,
}

impl Queue {
    /// A queue over `store`, its workers not yet started.
    pub fn new(store: Arc<Store>, solve: Solve) -> Arc<Queue> {
        Arc::new(Queue {
            store,
            solve,
            wake: Notify::new(),
            live: Live::default(),
            running: Mutex::default(),
            gate: tokio::sync::Mutex::default(),
            stopping: CancellationToken::new(),
        })
    }

    /// Starts the workers. They run until the drain.
    pub fn start(self: &Arc<Self>, workers: u16) {
        for _ in 0..workers {
            tokio::spawn(worker::work(self.clone()));
        }
    }

    /// Says that there is a new job.
    pub fn wake(&self) {
        self.wake.notify_waiters();
    }

    /// Listens to a job. Subscribe before reading its rows.
    pub fn subscribe(&self, key: i64) -> Subscription<'_> {
        self.live.subscribe(key)
    }

    /// Ends when the service is about to stop; streams end with it.
    pub fn stopping(&self) -> &CancellationToken {
        &self.stopping
    }

    /// Asks a job to stop. A queued one is canceled when this returns, a running one within half a
    /// second.
    pub async fn cancel(self: &Arc<Self>, key: i64) -> Result<CancelOutcome> {
        let _gate = self.gate.lock().await;
        let mut outcome = self.store.request_cancel(key).await?;
        if let CancelOutcome::Requested { attempt } = outcome {
            let running = self.running().get(&key).cloned();
            match running {
                Some(running) => {
                    running.stop.store(true, Ordering::Relaxed);
                    tokio::spawn(self.clone().cancel_over_its_head(key, running.attempt));
                }
                // Its worker could not end it and has given it up: nobody else would.
                None => {
                    let ended = self.store.finish(key, attempt, &Ending::canceled()).await?;
                    outcome = ended.map_or(CancelOutcome::AlreadyTerminal, CancelOutcome::Canceled);
                }
            }
        }
        if let CancelOutcome::Canceled(seq) = outcome {
            self.live.announce(key, seq);
        }
        Ok(outcome)
    }

    async fn cancel_over_its_head(self: Arc<Self>, key: i64, attempt: i32) {
        tokio::time::sleep(COOPERATION).await;
        match self.store.finish(key, attempt, &Ending::canceled()).await {
            Ok(Some(seq)) => self.live.announce(key, seq),
            Ok(None) => {} // it stopped by itself
            Err(cause) => error!(job.key = key, %cause, "job could not be canceled: {cause}"),
        }
    }

    /// Takes no more jobs and puts those that are running back for the next start of the service,
    /// without waiting for their solvers.
    pub async fn drain(&self) {
        self.stopping.cancel();
        let _gate = self.gate.lock().await; // whoever is claiming has entered its job
        let running: Vec<(i64, Running)> = self
            .running()
            .iter()
            .map(|(key, running)| (*key, running.clone()))
            .collect();
        for (key, Running { attempt, stop }) in running {
            stop.store(true, Ordering::Relaxed);
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

    /// Takes the next job and enters it as running.
    async fn claim(&self) -> Result<Option<(Claim, Running)>> {
        let _gate = self.gate.lock().await;
        if self.stopping.is_cancelled() {
            return Ok(None);
        }
        let Some(claim) = self.store.claim_next().await? else {
            return Ok(None);
        };
        let running = Running {
            attempt: claim.job.attempt,
            stop: Arc::default(),
        };
        self.running().insert(claim.job.key, running.clone());
        self.live.announce(claim.job.key, claim.seq);
        Ok(Some((claim, running)))
    }

    fn release(&self, job: &Job) {
        self.running().remove(&job.key);
    }

    fn running(&self) -> MutexGuard<'_, HashMap<i64, Running>> {
        // No code panics while it holds this lock; if one did, the map would still be whole.
        self.running.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests;
