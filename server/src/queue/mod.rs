//! The queue: which task may do what, and what wakes it.
//!
//! `workers` slots each hold one job at a time. The dispatcher claims the next job of the store whenever a
//! slot is free; a submit that finds one free has that done in its own transaction, and hands the claim to
//! the slot. Each claim is solved on a blocking thread. Beside each running solver a recorder task commits
//! its events in batches and then announces that there are some; watchers read them from the store. No event
//! travels through a channel to a watcher, so none is seen twice, missed, or taken back by a crash.
//!
//! Who may end a job? Any of worker, canceler, clock and drain may try; the store lets one of them, by
//! checking in one transaction that the start is still current. The others are too late.

mod live;
mod recorder;
mod worker;

use std::{
    collections::HashMap,
    sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError},
    time::Duration,
};

use tokio::sync::{Notify, OwnedSemaphorePermit, RwLock, Semaphore};
use tokio_util::sync::CancellationToken;
use tracing::{error, info};

use live::Live;
pub use live::Subscription;

use crate::{
    job::{Job, Status},
    run::Solve,
    store::{Accepted, CancelOutcome, Claim, Ending, LastWords, Result, Store, Submission},
    time::Time,
};

/// A solver that was asked to stop gets this long; then the job is canceled over its head and only
/// the worker's slot waits for it. Half of what the API promises, the rest is for commits.
const COOPERATION: Duration = Duration::from_millis(250);

/// The longest that a job waits for its end after the end of its time in the queue.
const TICK: Duration = Duration::from_secs(1);

/// Runs, cancels and announces jobs.
#[derive(Debug)]
pub struct Queue {
    store: Arc<Store>,
    solve: Solve,
    /// One permit for each worker that has nothing to do.
    slots: Arc<Semaphore>,
    workers: u16,
    /// Something may be ready to be claimed.
    wake: Notify,
    live: Live,
    /// Jobs in the hands of a worker of this process.
    running: Mutex<HashMap<i64, Running>>,
    /// Read while a job is claimed and entered into `running`, written while one is asked to stop: a
    /// cancel never falls between the two.
    gate: RwLock<()>,
    stopping: CancellationToken,
}

/// The handle on a solver at work.
#[derive(Clone, Debug)]
struct Running {
    attempt: i32,
    /// Looked at by the solver in every iteration.
    stop: Arc<OnceLock<Why>>,
}

impl Running {
    /// Asks the solver to stop. The first reason given is the one that counts.
    fn stop(&self, why: Why) {
        let _ = self.stop.set(why); // an earlier one stays: that is the error of it, and no harm
    }
}

/// Why a solver should stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Why {
    /// The job has run longer than it may.
    OutOfTime,
    /// Nobody waits for what it finds: the job was canceled or put back.
    Unwanted,
}

/// Ever longer waits between tries to store what must not be lost.
#[derive(Debug)]
struct Pauses(Duration);

impl Default for Pauses {
    fn default() -> Self {
        Pauses(Duration::from_millis(100))
    }
}

impl Pauses {
    /// Waits; false if the service stops meanwhile.
    async fn next(&mut self, queue: &Queue) -> bool {
        const LONGEST: Duration = Duration::from_secs(10);
        let pause = self.0;
        self.0 = (pause * 3).min(LONGEST);
        tokio::select! {
            () = tokio::time::sleep(pause) => true,
            () = queue.stopping.cancelled() => false,
        }
    }
}

/// How the queue stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct State {
    /// No new job is started.
    pub paused: bool,
    /// Jobs that wait for a worker, or for the end of another one of the same input.
    pub queued: usize,
    /// Jobs in the hands of workers.
    pub running: usize,
    /// How many workers there are.
    pub workers: u16,
    /// How many of them have nothing to do. A worker whose job was ended over its solver's head is not
    /// free before the solver is.
    pub idle: usize,
}

impl Queue {
    /// A queue over `store`, not yet started.
    pub fn new(store: Arc<Store>, solve: Solve, workers: u16) -> Arc<Queue> {
        Arc::new(Queue {
            store,
            solve,
            slots: Arc::new(Semaphore::new(0)),
            workers,
            wake: Notify::new(),
            live: Live::default(),
            running: Mutex::default(),
            gate: RwLock::default(),
            stopping: CancellationToken::new(),
        })
    }

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

    /// Listens to a job. Subscribe before reading its rows.
    pub fn subscribe(&self, key: i64) -> Subscription<'_> {
        self.live.subscribe(key)
    }

    /// Says that something new about these jobs is on the disk.
    pub fn announce(&self, jobs: &[i64]) {
        jobs.iter().for_each(|key| self.live.announce(*key));
    }

    /// Ends when the service is about to stop; streams end with it.
    pub fn stopping(&self) -> &CancellationToken {
        &self.stopping
    }

    /// How the queue stands.
    pub fn state(&self) -> State {
        State {
            paused: self.store.is_paused(),
            queued: self.store.waiting(),
            running: self.running().len(),
            workers: self.workers,
            idle: self.slots.available_permits(),
        }
    }

    /// Lets no job start until the queue is resumed, also after a restart; those that run go on.
    pub async fn pause(&self) -> Result<()> {
        let _gate = self.gate.write().await; // whoever is claiming has done so
        self.store.set_paused(true).await
    }

    /// Lets jobs start again.
    pub async fn resume(&self) -> Result<()> {
        let _gate = self.gate.write().await; // no pause at the same time
        self.store.set_paused(false).await?;
        self.wake.notify_one();
        Ok(())
    }

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

    /// Ends a start of a job without its solver; false if it was no longer current.
    async fn end(&self, key: i64, attempt: i32, ending: &Ending) -> Result<bool> {
        let last = LastWords::default();
        let changed = self.store.finish(key, attempt, ending, last, None).await?;
        if let Some(changed) = &changed {
            self.announce(changed);
            self.wake.notify_one();
        }
        Ok(changed.is_some())
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
