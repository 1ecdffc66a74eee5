//! The workers elsewhere: their offers of slots, and the jobs that are leased to them.

use std::{
    collections::{BTreeMap, HashMap},
    sync::Arc,
    time::Duration,
};

use base::{job::JobId, tasks};
use parking_lot::Mutex;
use schemars::JsonSchema;
use serde::Serialize;
use store::{Lessee, Room};
use tokio::{
    sync::{Notify, Semaphore},
    time::{Instant, timeout},
};

use super::{
    lease::{Lease, room_for_results},
    messages::{About, Ask, Granted, JobAnswer, JobReport, WorkerId},
};

/// How long a lease lasts from the last report of its worker on, unless the settings say something else.
const LEASE: Duration = Duration::from_secs(30);
/// The largest number of workers.
const MOST_WORKERS: usize = 10_000;
/// A worker that has not been heard of for as many leases is forgotten.
const FORGOTTEN_AFTER: u32 = 20;
/// How long an answer waits for what was reported; after that the worker asks again.
const LONGEST_TAKING: Duration = Duration::from_millis(500);
/// How many reports that only renew leases all workers together may send in a second.
const PULSES_PER_S: f64 = 250.0;
/// The shortest and the longest time between two reports of a worker that has a job: a cancel reaches it with the answer.
const PULSES: (Duration, Duration) = (Duration::from_millis(100), Duration::from_millis(800));

/// The workers elsewhere, and the jobs that they solve.
#[derive(Debug)]
pub(in crate::queue) struct Leases {
    workers: Mutex<BTreeMap<WorkerId, Known>>,
    leases: Mutex<HashMap<(JobId, i32), Arc<Lease>>>,
    /// The memory for results that are arriving.
    room: Arc<Semaphore>,
    /// How long a lease lasts.
    lasts: Mutex<Duration>,
    /// The memory of the largest worker before the service was restarted (bytes), and until when it counts.
    before: Mutex<(u64, Instant)>,
}

impl Default for Leases {
    fn default() -> Self {
        Leases {
            workers: Mutex::default(),
            leases: Mutex::default(),
            room: room_for_results(),
            lasts: Mutex::new(LEASE),
            before: Mutex::new((0, Instant::now())),
        }
    }
}

/// How often a worker reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pace {
    /// The longest time between two reports of a worker that has a job.
    pub pulse: Duration,
    /// How long a lease lasts that is not renewed.
    pub lease: Duration,
}

/// A worker on another machine.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct WorkerState {
    /// Its id.
    pub id: String,
    /// A name for people, such as that of its machine.
    pub name: String,
    /// The number of jobs that it solves at the same time.
    pub slots: u32,
    /// The number of processors that it may use.
    pub cores: u32,
    /// The memory that all its jobs together may take (bytes).
    pub memory_bytes: u64,
    /// The number of jobs that it solves now.
    pub jobs: u64,
    /// The time since it was last heard of (s).
    pub silent_s: f64,
}

/// A worker that has been heard of.
#[derive(Debug)]
struct Known {
    about: About,
    heard: Instant,
    /// The number of its last request for a job.
    number: u64,
    bid: Bid,
    /// The memory that it has free (bytes).
    free_bytes: u64,
    /// How many of its requests wait; a request that was repeated may wait twice.
    waiting: u32,
    /// Wakes the requests that wait.
    wake: Arc<Notify>,
}

impl Known {
    fn new(about: About, number: u64) -> Known {
        Known {
            about,
            heard: Instant::now(),
            number,
            bid: Bid::Open,
            free_bytes: 0,
            waiting: 0,
            wake: Arc::default(),
        }
    }

    fn grant(&mut self, granted: Granted) {
        self.bid = Bid::Granted(Arc::new(granted));
        self.wake.notify_waiters();
    }

    /// How long it has not been heard of; one that waits for a job is heard of all the time.
    fn silence(&self) -> Duration {
        match self.waiting {
            0 => self.heard.elapsed(),
            _ => Duration::ZERO,
        }
    }
}

/// What has become of the last request of a worker.
#[derive(Debug)]
enum Bid {
    /// It is open.
    Open,
    /// A job is being claimed for it.
    Taken,
    /// It has got a job.
    Granted(Arc<Granted>),
}

/// A worker that waits for a job.
#[derive(Clone, Debug)]
pub(in crate::queue) struct Offer {
    pub(in crate::queue) worker: WorkerId,
    pub(in crate::queue) name: String,
    pub(in crate::queue) number: u64,
    pub(in crate::queue) room: Room,
}

impl Offer {
    /// The worker, as it is stored.
    pub(in crate::queue) fn lessee(&self) -> Lessee {
        Lessee {
            worker: self.worker.to_string(),
            name: self.name.clone(),
        }
    }

    /// An offer that was taken before the service restarted.
    pub(in crate::queue) fn of_before(Lessee { worker, name }: Lessee) -> Offer {
        Offer {
            worker: WorkerId::stored(worker),
            name,
            number: 0,
            room: Room { whole: 0, free: 0 },
        }
    }
}

/// A request that waits for a job. When it is dropped, it waits no longer.
pub(in crate::queue) struct Waiting<'a> {
    leases: &'a Leases,
    worker: WorkerId,
    pub(in crate::queue) wake: Arc<Notify>,
}

/// What a request for a job finds at once.
pub(in crate::queue) enum Found<'a> {
    /// It was answered before.
    Granted(Arc<Granted>),
    /// It waits.
    Waits(Waiting<'a>),
    /// It does not wait.
    Nothing,
    /// There are too many workers.
    TooMany,
}

impl Drop for Waiting<'_> {
    fn drop(&mut self) {
        if let Some(known) = self.leases.workers.lock().get_mut(&self.worker) {
            known.waiting = known.waiting.saturating_sub(1);
            known.heard = Instant::now(); // until now
        }
    }
}

impl Leases {
    /// Sets how long leases last.
    pub(in crate::queue) fn set_lasts(&self, lasts: Duration) {
        *self.lasts.lock() = lasts;
    }

    /// How long a lease lasts.
    pub(in crate::queue) fn lasts(&self) -> Duration {
        *self.lasts.lock()
    }

    /// How often workers are to report: those elsewhere less often if there are many, the processes on this machine as often as
    /// may be.
    pub(in crate::queue) fn pace(&self, here: bool) -> Pace {
        let workers = match here {
            true => 0.0,
            false => self.elsewhere(&self.workers.lock()).count() as f64,
        };
        let (shortest, longest) = PULSES;
        let lease = self.lasts();
        let longest = longest.min(lease / 4);
        Pace {
            pulse: Duration::from_secs_f64(workers / PULSES_PER_S)
                .clamp(shortest.min(longest), longest),
            lease,
        }
    }

    /// The number of jobs that workers elsewhere solve.
    pub(in crate::queue) fn count(&self) -> usize {
        let leases = self.leases.lock();
        leases.values().filter(|lease| !lease.is_here()).count()
    }

    /// The number of slots of the workers that are there.
    pub(in crate::queue) fn slots(&self) -> usize {
        let lasts = self.lasts();
        let workers = self.workers.lock();
        let there = self
            .elsewhere(&workers)
            .filter(|(_, known)| known.silence() <= lasts);
        there.map(|(_, known)| known.about.slots as usize).sum()
    }

    /// The workers, in the order of their names.
    pub(in crate::queue) fn states(&self) -> Vec<WorkerState> {
        let mut jobs: BTreeMap<WorkerId, u64> = BTreeMap::new();
        for lease in self.leases.lock().values() {
            *jobs.entry(lease.worker.clone()).or_default() += 1;
        }
        let (lasts, workers) = (self.lasts(), self.workers.lock());
        let mut states: Vec<WorkerState> = self
            .elsewhere(&workers)
            .filter(|(id, known)| known.silence() <= lasts || jobs.contains_key(id))
            .map(|(id, known)| WorkerState {
                id: id.to_string(),
                name: known.about.name.clone(),
                slots: known.about.slots,
                cores: known.about.cores,
                memory_bytes: known.about.memory_bytes,
                jobs: jobs.get(id).copied().unwrap_or(0),
                silent_s: known.silence().as_secs_f64(),
            })
            .collect();
        states.sort_by(|one, other| (&one.name, &one.id).cmp(&(&other.name, &other.id)));
        states
    }

    /// Remembers the memory of the largest worker before the service was restarted (bytes): workers have the time of a lease to
    /// call again.
    pub(in crate::queue) fn remember(&self, bytes: u64) {
        *self.before.lock() = (bytes, Instant::now() + self.lasts());
    }

    /// The memory of the largest worker before the service was restarted (bytes).
    pub(in crate::queue) fn remembered(&self) -> u64 {
        self.before.lock().0
    }

    /// The memory of the largest worker (bytes); 0 without one.
    pub(in crate::queue) fn largest(&self) -> u64 {
        let (before, until) = *self.before.lock();
        let before = if Instant::now() < until { before } else { 0 };
        let workers = self.workers.lock();
        let forgotten = self.lasts() * FORGOTTEN_AFTER;
        let known = self.elsewhere(&workers);
        let memory = known.filter(|(_, known)| known.silence() <= forgotten);
        let memory = memory.map(|(_, known)| known.about.memory_bytes);
        memory.max().unwrap_or(0).max(before)
    }

    /// Notes a request for a job.
    pub(in crate::queue) fn ask(&self, worker: &WorkerId, ask: Ask) -> Found<'_> {
        let forgotten = self.lasts() * FORGOTTEN_AFTER;
        let mut workers = self.workers.lock();
        if !workers.contains_key(worker) {
            workers.retain(|_, known| known.silence() <= forgotten);
            if workers.len() >= MOST_WORKERS && !ask.about.here {
                return Found::TooMany;
            }
        }
        let known = workers
            .entry(worker.clone())
            .or_insert_with(|| Known::new(ask.about.clone(), ask.number));
        known.heard = Instant::now();
        known.about = ask.about;
        if known.number != ask.number {
            (known.number, known.bid) = (ask.number, Bid::Open);
        }
        if let Bid::Granted(granted) = &known.bid {
            return Found::Granted(granted.clone());
        }
        if !ask.takes && matches!(known.bid, Bid::Open) {
            // it ends: if it has no job, it is gone
            if !self.has_job(worker) {
                workers.remove(worker);
            }
            return Found::Nothing;
        }
        known.free_bytes = ask.free_bytes.min(known.about.memory_bytes);
        known.waiting += 1;
        Found::Waits(Waiting {
            leases: self,
            worker: worker.clone(),
            wake: known.wake.clone(),
        })
    }

    /// Whether a worker has a job.
    fn has_job(&self, worker: &WorkerId) -> bool {
        let leases = self.leases.lock();
        leases.values().any(|lease| lease.worker == *worker)
    }

    /// The job that the last request of a worker has got.
    pub(in crate::queue) fn last_granted(&self, worker: &WorkerId) -> Option<Arc<Granted>> {
        match &self.workers.lock().get(worker)?.bid {
            Bid::Granted(granted) => Some(granted.clone()),
            Bid::Open | Bid::Taken => None,
        }
    }

    /// The job that a request with this number has got.
    pub(in crate::queue) fn granted(&self, worker: &WorkerId, number: u64) -> Option<Arc<Granted>> {
        let last = self.last_granted(worker);
        last.filter(|granted| granted.number == number)
    }

    /// Takes the offers of workers that wait for a job: of all, since the next job may have room at one only. Each must be granted
    /// a job, or given back.
    pub(in crate::queue) fn take_offers(&self) -> Vec<Offer> {
        let mut workers = self.workers.lock();
        let waiting = workers.iter_mut().filter(|(_, known)| {
            known.waiting > 0 && matches!(known.bid, Bid::Open) && !known.about.here
        });
        let take = |(worker, known): (&WorkerId, &mut Known)| {
            known.bid = Bid::Taken;
            Offer {
                worker: worker.clone(),
                name: known.about.name.clone(),
                number: known.number,
                room: Room {
                    whole: known.about.memory_bytes,
                    free: known.free_bytes,
                },
            }
        };
        waiting.map(take).collect()
    }

    /// Gives back an offer that was taken, unless it was granted a job; of a process on this machine, its job is over.
    pub(in crate::queue) fn give_back(&self, worker: &WorkerId, number: u64) {
        if let Some(known) = self.workers.lock().get_mut(worker)
            && known.number == number
            && (matches!(known.bid, Bid::Taken) || known.about.here)
        {
            known.bid = Bid::Open;
        }
    }

    /// Grants a job to a worker whose offer was taken.
    pub(in crate::queue) fn grant(&self, worker: &WorkerId, granted: Granted) {
        if let Some(known) = self.workers.lock().get_mut(worker)
            && known.number == granted.number
        {
            known.grant(granted);
        }
    }

    /// Grants a job to a process on this machine, also if it does not ask for it yet.
    pub(in crate::queue) fn grant_here(&self, worker: &WorkerId, granted: Granted) {
        let mut workers = self.workers.lock();
        let known = workers.entry(worker.clone()).or_insert_with(|| {
            let about = About {
                name: String::new(),
                slots: 1,
                cores: 1,
                memory_bytes: 0,
                here: true,
            };
            Known::new(about, granted.number)
        });
        known.number = granted.number;
        known.grant(granted);
    }

    /// Forgets a worker.
    pub(in crate::queue) fn forget(&self, worker: &WorkerId) {
        self.workers.lock().remove(worker);
    }

    /// The workers elsewhere.
    fn elsewhere<'a>(
        &self,
        workers: &'a BTreeMap<WorkerId, Known>,
    ) -> impl Iterator<Item = (&'a WorkerId, &'a Known)> {
        workers.iter().filter(|(_, known)| !known.about.here)
    }

    /// Enters a lease, which is then in force.
    pub(in crate::queue) fn enter(&self, lease: &Arc<Lease>) {
        let key = (lease.job.id, lease.job.attempt);
        self.leases.lock().insert(key, lease.clone());
    }

    /// Removes a lease that has ended.
    pub(in crate::queue) fn remove(&self, lease: &Lease) {
        self.leases
            .lock()
            .remove(&(lease.job.id, lease.job.attempt));
    }

    /// The lease of this job and attempt, if this worker has it. `Err`: why it has none.
    pub(in crate::queue) fn lease_of(
        &self,
        worker: &WorkerId,
        job: JobId,
        attempt: i32,
    ) -> Result<Arc<Lease>, String> {
        let found = self.leases.lock().get(&(job, attempt)).cloned();
        match found {
            Some(lease) if lease.worker == *worker => Ok(lease),
            Some(lease) => Err(format!(
                "attempt {attempt} of {job} is leased to {}",
                lease.worker
            )),
            None => Err(format!(
                "attempt {attempt} of {job} is not leased any more: the attempt has ended, or its lease was not renewed in time"
            )),
        }
    }

    /// Notes that a worker reports, and what memory it has free then (bytes).
    pub(in crate::queue) fn has_free(&self, worker: &WorkerId, free_bytes: u64) {
        if let Some(known) = self.workers.lock().get_mut(worker) {
            known.heard = Instant::now();
            known.free_bytes = free_bytes.min(known.about.memory_bytes);
        }
    }

    /// Takes what a worker reports of one job.
    pub(in crate::queue) async fn take(
        &self,
        worker: &WorkerId,
        (job, attempt): (JobId, i32),
        report: JobReport,
    ) -> JobAnswer {
        match self.lease_of(worker, job, attempt) {
            Ok(lease) => {
                let (room, nothing) = (self.room.clone(), lease.nothing_taken());
                // to its end, also if the connection breaks: half of a report must not count as taken
                let taking = async move { lease.take(report, &room).await };
                // a large result takes a while to check: the other jobs of the worker do not wait for that
                match timeout(LONGEST_TAKING, tasks::detached(taking)).await {
                    Ok(taken) => taken.unwrap_or(nothing),
                    Err(_) => nothing,
                }
            }
            Err(why) => JobAnswer {
                over: true,
                refused: Some(why),
                ..JobAnswer::default()
            },
        }
    }
}
