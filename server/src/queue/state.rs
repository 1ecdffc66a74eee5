//! What all tasks of the queue share, and how it stands.

use std::{
    collections::HashMap,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use tokio::sync::{Notify, RwLock, Semaphore};
use tokio_util::sync::CancellationToken;

use super::{
    running::Running,
    watchers::{Live, Subscription},
};
use crate::{
    job::Job,
    run::Solve,
    store::{Ending, LastWords, Result, Store},
};

/// Runs, cancels and announces jobs.
#[derive(Debug)]
pub struct Queue {
    pub(super) store: Arc<Store>,
    pub(super) solve: Solve,
    /// One permit for each worker that has nothing to do.
    pub(super) slots: Arc<Semaphore>,
    pub(super) workers: u16,
    /// Something may be ready to be claimed.
    pub(super) wake: Notify,
    pub(super) live: Live,
    /// Jobs in the hands of a worker of this process.
    pub(super) running: Mutex<HashMap<i64, Running>>,
    /// Read while a job is claimed and entered into `running`, written while one is asked to stop: a
    /// cancel never falls between the two.
    pub(super) gate: RwLock<()>,
    pub(super) stopping: CancellationToken,
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

    /// Ends a start of a job without its solver; false if it was no longer current.
    pub(super) async fn end(&self, key: i64, attempt: i32, ending: &Ending) -> Result<bool> {
        let last = LastWords::default();
        let changed = self.store.finish(key, attempt, ending, last, None).await?;
        if let Some(changed) = &changed {
            self.announce(changed);
            self.wake.notify_one();
        }
        Ok(changed.is_some())
    }

    pub(super) fn release(&self, job: &Job) {
        self.running().remove(&job.key);
    }

    pub(super) fn running(&self) -> MutexGuard<'_, HashMap<i64, Running>> {
        // No code panics while it holds this lock; if one did, the map would still be whole.
        self.running.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
