//! The data that all tasks of the queue share, and the state of the queue.

use parking_lot::{Mutex, MutexGuard};
use std::{
    collections::{BTreeMap, HashMap},
    sync::Arc,
};

use base::{job::Job, run::Solve, time::Time, trace::Trace};
use store::{Ending, FinalBatch, Store};
use tokio::sync::{Notify, OwnedSemaphorePermit, RwLock, Semaphore, SemaphorePermit};
use tokio_util::sync::CancellationToken;

use super::{
    leases::Leases,
    load::{LastHour, LoadPoint},
    process::Processes,
    running::Running,
    watchers::{Subscription, Watchers},
};

/// The largest number of waiting requests that read jobs at the same time: a few for each connection to the database.
const MOST_TURNS: usize = 16;
/// The largest number of jobs for which the submitting request is remembered: by default as many as may be queued.
const MOST_ORIGINS: usize = 100_000;

/// Where problems are solved.
#[derive(Debug)]
pub enum Solver {
    /// On blocking threads of this process.
    Threads(Solve),
    /// In processes.
    Processes(Processes),
}

/// Runs, cancels and announces jobs.
#[derive(Debug)]
pub struct Queue {
    pub(super) store: Arc<Store>,
    pub(super) solver: Solver,
    /// One permit for each idle worker.
    pub(super) slots: Arc<Semaphore>,
    pub(super) workers: u16,
    /// Notified when a job may be ready to be claimed.
    pub(super) wake: Notify,
    pub(super) watchers: Watchers,
    /// The watchers of sweeps, by the sweeps' keys.
    pub(super) sweeps: Watchers,
    /// Limits how many waiting requests may read jobs at the same time.
    turns: Semaphore,
    /// Jobs that a worker of this process is solving.
    pub(super) running: Mutex<HashMap<i64, Running>>,
    /// Locked for reading while a job is claimed and entered into `running`, and for writing while a job is asked to
    /// stop, so that no cancel comes between the two steps of a claim.
    pub(super) claiming: RwLock<()>,
    /// The traces of the requests that submitted the jobs, by the jobs' keys, for spans. They are not stored: after a
    /// restart a job begins a trace of its own.
    origins: Mutex<BTreeMap<i64, Trace>>,
    /// The load of the last hour.
    pub(super) last_hour: LastHour,
    /// The workers elsewhere, and the jobs that they solve.
    pub(super) leases: Leases,
    /// The number of this run of the queue in reports of workers elsewhere.
    pub(super) session: u64,
    /// The token that is canceled when the service is about to stop.
    pub(super) stopping: CancellationToken,
}

/// A busy worker. When the last clone of a `Slot` is dropped the worker is idle, and the next job is claimed.
#[derive(Debug)]
pub(super) struct Slot {
    pub(super) permit: Option<OwnedSemaphorePermit>,
    pub(super) queue: Arc<Queue>,
}

impl Drop for Slot {
    fn drop(&mut self) {
        drop(self.permit.take());
        self.queue.wake.notify_one();
    }
}

/// The state of the queue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct State {
    /// Whether the queue is paused, so that no new job is started.
    pub paused: bool,
    /// The number of jobs that wait for a worker, or for the job that they are coalesced into.
    pub queued: usize,
    /// The number of jobs that workers are solving.
    pub running: usize,
    /// The number of jobs that can be solved at the same time: the workers here, and the slots of those elsewhere.
    pub workers: u32,
    /// The number of idle workers. A worker whose job was ended by force stays busy until its solver returns.
    pub idle: usize,
}

impl Queue {
    /// A queue over `store` that is not started yet.
    pub fn new(store: Arc<Store>, solver: Solver, workers: u16) -> Arc<Queue> {
        Arc::new(Queue {
            store,
            solver,
            slots: Arc::new(Semaphore::new(0)),
            workers,
            wake: Notify::new(),
            watchers: Watchers::default(),
            sweeps: Watchers::default(),
            turns: Semaphore::new(MOST_TURNS),
            running: Mutex::default(),
            claiming: RwLock::default(),
            origins: Mutex::default(),
            last_hour: LastHour::default(),
            leases: Leases::default(),
            session: Time::now().micros().unsigned_abs(),
            stopping: CancellationToken::new(),
        })
    }

    /// Subscribes to the changes of a job. Call this before its rows are read.
    pub fn subscribe(&self, key: i64) -> Subscription<'_> {
        self.watchers.subscribe(key)
    }

    /// Notifies the watchers of these jobs that there is something new to read.
    pub fn announce(&self, jobs: &[i64]) {
        jobs.iter().for_each(|key| self.watchers.announce(*key));
    }

    /// Notifies the watchers of this job that it has new events but is otherwise unchanged.
    pub(super) fn announce_events(&self, key: i64) {
        self.watchers.announce_events(key);
    }

    /// Subscribes to the rows of a sweep's members. Call this before the rows are read.
    pub fn subscribe_to_sweep(&self, key: i64) -> Subscription<'_> {
        self.sweeps.subscribe(key)
    }

    /// Notifies the watchers of a sweep that more of its members have ended.
    pub(super) fn announce_sweep(&self, key: i64) {
        self.sweeps.announce(key);
    }

    /// A permit for a waiting request to read its job. The number of permits is limited, since one change may wake
    /// thousands of requests.
    pub async fn turn(&self) -> Option<SemaphorePermit<'_>> {
        self.turns.acquire().await.ok()
    }

    /// The token that is canceled when the service is about to stop; streams of events then end.
    pub fn stopping(&self) -> &CancellationToken {
        &self.stopping
    }

    /// The state of the queue.
    pub fn state(&self) -> State {
        let slots = self.leases.slots();
        State {
            paused: self.store.is_paused(),
            queued: self.store.waiting(),
            running: self.running().len(),
            workers: u32::from(self.workers) + slots as u32,
            idle: self.slots.available_permits() + slots.saturating_sub(self.leases.count()),
        }
    }

    /// The load of the last hour, a point for each minute that the service ran.
    pub fn last_hour(&self) -> Vec<LoadPoint> {
        self.last_hour.points()
    }

    /// Pauses the queue: no more jobs are started until it is resumed, also after a restart; running jobs continue.
    pub async fn pause(&self) -> store::Result<()> {
        let _guard = self.claiming.write().await; // no claim is under way
        self.store.set_paused(true).await
    }

    /// Resumes the queue.
    pub async fn resume(&self) -> store::Result<()> {
        let _guard = self.claiming.write().await; // no pause is under way
        self.store.set_paused(false).await?;
        self.wake.notify_one();
        Ok(())
    }

    /// Ends an attempt without waiting for its solver; false if the attempt was no longer the current one.
    pub(super) async fn end_attempt(
        &self,
        key: i64,
        attempt: i32,
        ending: &Ending,
    ) -> store::Result<bool> {
        let last = FinalBatch::default();
        let changed = self.store.finish(key, attempt, ending, last, None).await?;
        if let Some(changed) = &changed {
            self.announce(changed);
            self.wake.notify_one();
        }
        Ok(changed.is_some())
    }

    /// Remembers the request that submitted these jobs, by its trace; beyond `MOST_ORIGINS` jobs the oldest are
    /// forgotten.
    pub fn remember_origin(&self, jobs: &[Job], trace: &Trace) {
        let mut origins = self.origins();
        for job in jobs.iter().filter(|job| !job.status.is_terminal()) {
            origins.insert(job.key, trace.clone());
        }
        while origins.len() > MOST_ORIGINS {
            origins.pop_first();
        }
    }

    /// The trace of the request that submitted a job.
    pub(super) fn origin(&self, key: i64) -> Option<Trace> {
        self.origins().get(&key).cloned()
    }

    /// Forgets the request of a job that has ended, or whose request is no longer needed.
    pub(super) fn forget_origin(&self, key: i64) {
        self.origins().remove(&key);
    }

    fn origins(&self) -> MutexGuard<'_, BTreeMap<i64, Trace>> {
        self.origins.lock()
    }

    /// Records that the worker of this attempt has finished with the job. If the job was requeued, another worker may
    /// be solving it already.
    pub(super) fn release(&self, job: &Job) {
        let mut running = self.running();
        let ours = |running: &Running| running.attempt == job.attempt;
        if running.get(&job.key).is_some_and(ours) {
            running.remove(&job.key);
        }
    }

    /// Whether there are processors for a second thread of every running job. A job that starts a moment later shares
    /// these processors.
    pub(super) fn has_spare_processor(&self) -> bool {
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        let running = self.running();
        2 * running.values().filter(|running| running.here).count() <= processors
    }

    /// Jobs that a worker of this process is solving, by key.
    pub(super) fn running(&self) -> MutexGuard<'_, HashMap<i64, Running>> {
        self.running.lock()
    }
}
