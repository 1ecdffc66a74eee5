//! The outboxes of workers against a queue, under random faults: messages are lost, repeated and late, workers die, the service
//! restarts. Every job ends once, and has each event of its last attempt once, in order.
//!
//! `SIGNORINI_SIMULATION_SEED=n` runs that seed alone, `SIGNORINI_SIMULATION_SEEDS=count` the first `count`, and
//! `SIGNORINI_SIMULATION_FIRST=n` leaves out those before n.
#![allow(clippy::unwrap_used, clippy::panic)]

use std::{
    panic::{AssertUnwindSafe, catch_unwind, resume_unwind},
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering::Relaxed},
    },
    time::{Duration, Instant},
};

use base::{
    caller::Owners,
    digest,
    event::{Event, Payload},
    job::{Cache, Job, Limits, ResultAvailable, Status},
    memory::Budget,
};
use fastrand::Rng;
use service::queue::{About, Ask, End, Packed, Queue, Solver, Supervisor, WorkerId};
use store::{Ending, NewJob, Parts, QueueLimits, Store, Submission};
use tempfile::TempDir;
use tokio::runtime::Runtime;

use super::outbox::{News, Outbox, Teller};
use crate::{grpc::workers, pb::worker as pb};

/// How many seeds are run unless the environment says otherwise.
const SEEDS: u64 = 20;
/// How many are run at the same time.
const AT_ONCE: usize = 8;
const JOBS: usize = 4;
/// The events of each job.
const EVENTS: u32 = 12;
/// How many faults there are of each kind that costs an attempt: a job fails after three.
const MOST_DEATHS: u32 = 2;
/// Longer than a busy machine keeps a thread waiting: three leases that end by that would fail a job.
const LEASE: Duration = Duration::from_secs(1);
/// Nothing takes nearly as long, unless it waits for ever.
const LONGEST: Duration = Duration::from_secs(20);

struct World {
    dice: Rng,
    store: Arc<Store>,
    queue: Arc<Queue>,
    workers: Vec<Worker>,
    /// Reports that arrive, or arrive again, later.
    late: Vec<(WorkerId, pb::JobReport)>,
    deaths: u32,
    calm: bool,
}

struct Worker {
    secret: u64,
    number: u64,
    jobs: Vec<Held>,
}

struct Held {
    id: String,
    attempt: i32,
    outbox: Arc<Outbox>,
    told: u32,
}

impl Worker {
    fn new(secret: u64) -> Worker {
        Worker {
            secret,
            number: 1,
            jobs: vec![],
        }
    }

    fn id(&self) -> WorkerId {
        WorkerId::of(&self.secret.to_le_bytes())
    }
}

/// All of these jobs, of one owner.
pub(super) fn submission(jobs: Vec<NewJob>) -> Submission {
    Submission {
        owner: "ada".into(),
        jobs,
        sweep: None,
        key: None,
        limits: QueueLimits {
            queued: 100,
            queued_of_owner: None,
        },
    }
}

/// A job of the fake problem.
pub(super) fn new_job() -> NewJob {
    let problem = fake::problem();
    NewJob {
        id: None,
        name: None,
        labels: Default::default(),
        priority: 0,
        limits: Limits::default(),
        cache: Cache::Off,
        parent: None,
        sweep: None,
        title: None,
        input_hash: digest::input_hash(&problem).unwrap(),
        problem: serde_json::to_string(&problem).unwrap(),
        mesh: None,
        memory_bytes: 1 << 20,
        payload: "payload".into(),
    }
}

fn end() -> End {
    End::Solved {
        ending: Ending {
            status: Status::Succeeded,
            reason: None,
            failure: None,
            result: ResultAvailable::Final,
            overview: Default::default(),
        },
        unverified: false,
        iterations: EVENTS as usize,
    }
}

impl World {
    async fn new(seed: u64, folder: &Path) -> World {
        let store = Store::open(folder).await.unwrap();
        store.set_budget(Budget::new(1 << 30, 0, 0));
        let queue = new_queue(&store);
        start(&queue).await;
        World {
            dice: Rng::with_seed(seed),
            store,
            queue,
            workers: vec![Worker::new(1), Worker::new(2)],
            late: vec![],
            deaths: 0,
            calm: false,
        }
    }

    fn once_in(&mut self, cases: u32) -> bool {
        !self.calm && self.dice.u32(0..cases) == 0
    }

    async fn step(&mut self) {
        let worker = self.dice.usize(0..self.workers.len());
        match self.dice.u32(0..30) {
            0..8 => self.ask(worker).await,
            8..16 => self.solve(worker),
            16..27 => self.report(worker).await,
            27 if !self.calm => self.restart().await,
            28 if !self.calm && self.deaths < MOST_DEATHS => {
                self.deaths += 1;
                self.workers[worker] = Worker::new(self.dice.u64(3..));
            }
            _ => self.deliver_late().await,
        }
    }

    async fn ask(&mut self, worker: usize) {
        let (memory, lost) = (1 << 30, self.once_in(4));
        let worker = &mut self.workers[worker];
        if worker.jobs.len() >= 2 {
            return;
        }
        let ask = Ask {
            number: worker.number,
            free_bytes: memory,
            takes: true,
            about: About {
                name: "node".into(),
                slots: 2,
                cores: 2,
                memory_bytes: memory,
                here: false,
            },
        };
        let id = worker.id();
        let asked = self.queue.lease(&id, ask, Duration::from_millis(5));
        let granted = asked.await.unwrap();
        if lost {
            return;
        }
        if let Some(granted) = granted {
            worker.number += 1;
            worker.jobs.push(Held {
                id: granted.job.to_string(),
                attempt: granted.attempt,
                outbox: Arc::new(Outbox::new(Arc::<News>::default(), granted.session, false)),
                told: 0,
            });
        }
    }

    /// The solvers of a worker go on.
    fn solve(&mut self, worker: usize) {
        for held in &mut self.workers[worker].jobs {
            let mut teller = Teller::new(held.outbox.clone(), Box::new(|| false));
            for _ in 0..self.dice.u32(0..4) {
                if held.told < EVENTS {
                    held.told += 1;
                    teller.event(Payload::Iteration(fake::timed(held.told)));
                }
            }
            if self.dice.u32(0..6) == 0 && held.told < EVENTS {
                teller.partial(Parts::of_a_summary());
            }
            if held.told == EVENTS {
                let result = Packed::new(Parts::of_a_summary(), true).unwrap();
                held.outbox.finish(&end(), Some(result));
            }
        }
    }

    async fn report(&mut self, worker: usize) {
        let id = self.workers[worker].id();
        for place in 0..self.workers[worker].jobs.len() {
            let held = &self.workers[worker].jobs[place];
            // small messages, so that much has to be sent in several
            let mut left = self.dice.usize(20..2000);
            let report = pb::JobReport {
                id: held.id.clone(),
                attempt: held.attempt,
                ..held.outbox.report(&mut left)
            };
            let outbox = held.outbox.clone();
            if self.once_in(5) {
                self.late.push((id.clone(), report));
                continue; // it may arrive later
            }
            if self.once_in(8) {
                self.take(&id, report.clone()).await;
                self.late.push((id.clone(), report.clone()));
            }
            let answer = self.take(&id, report).await;
            if !self.once_in(5) {
                outbox.answered(&answer);
            }
        }
        self.workers[worker]
            .jobs
            .retain(|held| !held.outbox.over.is_cancelled());
    }

    async fn take(&self, worker: &WorkerId, report: pb::JobReport) -> pb::JobAnswer {
        let (job, attempt, report) = workers::read(report).unwrap();
        workers::written(self.queue.take_report(worker, job, attempt, report).await)
    }

    async fn deliver_late(&mut self) {
        if !self.late.is_empty() {
            let place = self.dice.usize(0..self.late.len());
            let (worker, report) = self.late.swap_remove(place);
            self.take(&worker, report).await;
        }
    }

    async fn restart(&mut self) {
        if self.dice.bool() {
            self.queue.drain().await;
        }
        self.queue.stopping().cancel();
        let old = Arc::downgrade(&self.queue);
        self.queue = new_queue(&self.store);
        // a process that has ended writes nothing more: neither do tasks of the old service, once all have ended
        let end = Instant::now() + LONGEST;
        while old.strong_count() > 0 {
            assert!(Instant::now() < end, "the old service does not end");
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
        self.store.requeue_interrupted().await.unwrap();
        start(&self.queue).await;
    }

    async fn jobs(&self, ids: &[Job]) -> Vec<Job> {
        let mut found = vec![];
        for job in ids {
            found.extend(self.store.job(Owners::All, job.id).await.unwrap());
        }
        found
    }
}

fn new_queue(store: &Arc<Store>) -> Arc<Queue> {
    let queue = Queue::new(store.clone(), Solver::Threads(fake::solve), 0);
    queue.set_lease(LEASE);
    queue
}

async fn start(queue: &Arc<Queue>) {
    queue.go_on().await.unwrap();
    queue.start();
}

/// A folder where files are fast.
fn fast_folder() -> TempDir {
    let memory = Path::new("/dev/shm");
    let folder = match memory.is_dir() {
        true => tempfile::tempdir_in(memory),
        false => tempfile::tempdir(),
    };
    folder.unwrap()
}

/// An empty store, made once and copied for each seed: its tables take as long as a whole sequence.
async fn empty_store() -> TempDir {
    let folder = fast_folder();
    Store::open(folder.path()).await.unwrap().close().await;
    folder
}

async fn simulate(seed: u64, empty: &Path) {
    let folder = fast_folder();
    std::fs::copy(
        empty.join("signorini.db"),
        folder.path().join("signorini.db"),
    )
    .unwrap();
    let mut world = World::new(seed, folder.path()).await;
    let submission = submission((0..JOBS).map(|_| new_job()).collect());
    let jobs = world.queue.submit(submission).await.unwrap().jobs;
    for _ in 0..120 {
        world.step().await;
    }
    world.calm = true;
    let end = Instant::now() + LONGEST;
    while !world
        .jobs(&jobs)
        .await
        .iter()
        .all(|job| job.status.is_terminal())
    {
        assert!(
            Instant::now() < end,
            "jobs do not end: {:#?}",
            world.jobs(&jobs).await
        );
        for _ in 0..10 {
            world.step().await;
        }
        // some leases have to end before anything can be done
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    for job in world.jobs(&jobs).await {
        assert_eq!(job.status, Status::Succeeded, "{job:#?}");
        let events = world.store.events_after(job.key, 0, 10_000).await.unwrap();
        let events: Vec<Event> = events.iter().map(|event| event.read().unwrap()).collect();
        let done = events
            .iter()
            .filter(|event| matches!(event.payload, Payload::Done { .. }));
        assert_eq!(done.count(), 1);
        let last = events.iter().filter(|event| event.attempt == job.attempt);
        let rows: Vec<u32> = last
            .filter_map(|event| match &event.payload {
                Payload::Iteration(timed) => Some(timed.row.k),
                _ => None,
            })
            .collect();
        assert_eq!(rows, (1..=EVENTS).collect::<Vec<_>>(), "{}", job.id);
    }
    world.queue.stopping().cancel();
    world.store.close().await;
}

#[test]
fn every_job_ends_once_with_every_event_once() {
    let number = |name| std::env::var(name).ok().and_then(|text| text.parse().ok());
    let seeds = match number("SIGNORINI_SIMULATION_SEED") {
        Some(seed) => seed..seed + 1,
        None => {
            let first = number("SIGNORINI_SIMULATION_FIRST").unwrap_or(0);
            first..number("SIGNORINI_SIMULATION_SEEDS").unwrap_or(SEEDS)
        }
    };
    let empty = runtime().block_on(empty_store());
    // they wait for most of their time
    let next = AtomicU64::new(seeds.start);
    std::thread::scope(|scope| {
        for _ in 0..AT_ONCE {
            scope.spawn(|| {
                loop {
                    let seed = next.fetch_add(1, Relaxed);
                    if seed >= seeds.end {
                        return;
                    }
                    play(seed, empty.path());
                }
            });
        }
    });
}

fn runtime() -> Runtime {
    let mut runtime = tokio::runtime::Builder::new_current_thread();
    runtime.enable_all().build().unwrap()
}

fn play(seed: u64, empty: &Path) {
    let runtime = runtime();
    let ran = catch_unwind(AssertUnwindSafe(|| runtime.block_on(simulate(seed, empty))));
    if let Err(panic) = ran {
        eprintln!("SIGNORINI_SIMULATION_SEED={seed}");
        resume_unwind(panic);
    }
}
