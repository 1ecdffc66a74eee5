//! The store under random sequences of what its clients, its workers, its disk and its clock do to it; the promises
//! G2 to G5 are checked all the way.
//!
//! One driver does one thing after the other, in simulated time, so that a seed gives the same sequence and the same
//! final state each time. What fails is printed with its seed and what was done before:
//! `SIGNORINI_SIMULATION_SEED=n` runs that seed alone, `SIGNORINI_SIMULATION_SEEDS=count` the first `count`, and
//! `SIGNORINI_SIMULATION_FIRST=n` leaves out those before n.

mod checks;
mod jobs;
mod restarts;
mod submissions;
mod workers;

use parking_lot::Mutex;
use std::{
    collections::BTreeMap,
    panic::{AssertUnwindSafe, catch_unwind},
    path::PathBuf,
    sync::atomic::{AtomicBool, AtomicU64, Ordering},
    time::{Duration, Instant},
};

use base::{
    event::Event,
    job::JobId,
    memory::{Budget, Reservation},
    time::Time,
};
use fastrand::Rng;

use super::*;

/// How many seeds are run unless the environment says otherwise; `tests/reliability/unit.py` runs a thousand.
const SEEDS: u64 = 100;
/// How many things are done in one, at least and at most.
const STEPS: std::ops::Range<usize> = 30..60;
/// No seed takes nearly as long, unless the store waits for ever.
const LONGEST: Duration = Duration::from_secs(120);
/// When the simulated time begins, in microseconds since 1970.
const BEGIN: i64 = 1_700_000_000_000_000;
/// The owners of jobs and keys.
const OWNERS: [&str; 2] = ["ada", "bob"];
/// The memory that running jobs share (bytes): enough for some of them at a time.
const BUDGET: u64 = 8 << 20;

/// What was done so far, a line each.
type Steps = Arc<Mutex<Vec<String>>>;

/// A store, and what is known of it from its answers.
struct World {
    dice: Rng,
    store: Arc<Store>,
    /// Holds a folder for each start of the store.
    home: tempfile::TempDir,
    starts: usize,
    /// The simulated clock of the machine, in microseconds since 1970.
    clock: i64,
    /// The disk may be full.
    full: bool,
    /// Every job that was accepted, by its key.
    jobs: BTreeMap<i64, Known>,
    /// What was submitted under a key, by owner and key: the payload, and the jobs.
    keys: BTreeMap<(String, String), (String, Vec<i64>)>,
    /// Jobs that workers are solving.
    running: BTreeMap<i64, Work>,
    /// Attempts that are over, but whose workers may not know that yet.
    over: Vec<(i64, i32)>,
    /// The queue is paused.
    paused: bool,
    /// The number of every owner's last turn; and how many turns there were.
    turns: BTreeMap<String, usize>,
    turn: usize,
    done: Steps,
}

/// A job that was accepted, and what was seen of it.
struct Known {
    id: JobId,
    owner: String,
    new: NewJob,
    /// Whether it has waited, and was not answered when it was accepted.
    waited: bool,
    /// Its events, as they were read first.
    events: Vec<Event>,
    /// As it was when it was first seen after its end.
    ended: Option<Job>,
    deleted: bool,
    /// How many of its attempts were seen to start.
    attempts: i32,
}

/// A job that a worker is solving.
struct Work {
    attempt: i32,
    /// A client has asked it to stop.
    canceled: bool,
    /// The worker elsewhere that has it; `None`: it is solved here.
    elsewhere: Option<Lessee>,
    /// The result, once some of it may have been written.
    parts: Option<Arc<Parts>>,
    _memory: Option<Reservation>,
}

/// Where files are fast.
fn fast_folder() -> tempfile::TempDir {
    let memory = Path::new("/dev/shm");
    if memory.is_dir() {
        tempfile::tempdir_in(memory).unwrap()
    } else {
        tempfile::tempdir().unwrap()
    }
}

/// An empty store, made once and copied for each seed: its tables take longer than a whole sequence.
fn empty_store() -> tempfile::TempDir {
    let folder = fast_folder();
    runtime().block_on(async {
        let store = Store::open_unwatched(folder.path()).await.unwrap();
        store.close().await;
    });
    folder
}

/// One thread does all the work but for what may block, for which it waits: this keeps the order, and the simulated time is
/// that of the thread.
fn runtime() -> tokio::runtime::Runtime {
    let mut runtime = tokio::runtime::Builder::new_current_thread();
    runtime.enable_all().build().unwrap()
}

impl World {
    async fn new(seed: u64, empty: &Path, done: Steps) -> World {
        Time::from_micros(BEGIN).simulate();
        let home = fast_folder();
        let folder = home.path().join("0");
        restarts::copy(empty, &folder);
        restarts::keep_progress(&folder, home.path());
        let store = Store::open_unwatched(&folder).await.unwrap();
        store.set_budget(Budget::new(BUDGET, 2, 0));
        World {
            dice: Rng::with_seed(seed),
            store,
            home,
            starts: 1,
            clock: BEGIN,
            full: false,
            jobs: BTreeMap::new(),
            keys: BTreeMap::new(),
            running: BTreeMap::new(),
            over: vec![],
            paused: false,
            turns: BTreeMap::new(),
            turn: 0,
            done,
        }
    }

    /// Notes what is done next.
    fn note(&self, what: String) {
        let clock = (self.clock - BEGIN) as f64 / 1e6;
        let line = format!("{clock:>12.3} s  {what}");
        let mut done = self.done.lock();
        done.push(line);
    }

    /// True once in so many cases.
    fn once_in(&mut self, cases: u32) -> bool {
        self.dice.u32(0..cases) == 0
    }

    /// One of some.
    fn one_of<T: Clone>(&mut self, some: &[T]) -> Option<T> {
        if some.is_empty() {
            None
        } else {
            Some(some[self.dice.usize(0..some.len())].clone())
        }
    }

    /// Lets some time pass: often none, sometimes more than a job may wait.
    fn let_time_pass(&mut self) {
        let seconds = match self.dice.u32(0..40) {
            0 => self.dice.i64(0..400_000),
            1..20 => self.dice.i64(0..60),
            _ => 0,
        };
        self.clock += seconds * 1_000_000 + self.dice.i64(0..1000);
        Time::from_micros(self.clock).simulate();
    }

    /// Does something. A full disk may refuse it, and then nothing has changed.
    async fn step(&mut self) {
        self.let_time_pass();
        if self.full && self.once_in(10) {
            self.free_the_disk().await;
        }
        let before = if self.full {
            match self.dice.u32(0..4) {
                0 | 1 => {
                    let more = self.dice.i64(0..6);
                    self.store.bound(more).await;
                }
                2 => {
                    let commits = self.dice.u32(1..3);
                    self.store.full_commits.store(commits, Ordering::Relaxed);
                }
                _ => {}
            }
            Some(self.rows().await)
        } else {
            None
        };
        let did = match self.dice.u32(0..100) {
            0..28 => self.submit().await,
            28..44 => self.claim().await,
            44..52 => self.report().await,
            52..55 => self.write_partial().await,
            55..69 => self.finish().await,
            69..75 => self.cancel().await,
            75..77 => self.cancel_waiting().await,
            77..81 => self.edit().await,
            81..84 => self.delete().await,
            84..86 => self.expire().await,
            86..88 => self.pause_or_resume().await,
            88..90 => self.lose_worker().await,
            90..94 => self.report_too_late().await,
            94..97 => self.fill_the_disk().await,
            97 => self.stop_and_start().await,
            _ => self.crash().await,
        };
        match did {
            Ok(()) => {}
            Err(StoreError::Full) => {
                let before = before.expect("the disk is not full");
                checks::same(&before, &self.rows().await, "a refusal");
                self.note("    refused: the disk is full".into());
            }
            Err(error) => panic!("{error}"),
        }
        match self.dice.u32(0..12) {
            0 => self.check(true).await,
            1..4 => self.check(false).await,
            _ => {} // most of the time would be spent with checks
        }
    }

    /// Ends every job, as workers do that nothing disturbs.
    async fn drain(&mut self) {
        self.note("drain".into());
        self.free_the_disk().await;
        self.store.set_paused(false).await.unwrap();
        self.paused = false;
        for _ in 0..1000 {
            let first = self.running.keys().next().copied();
            match first {
                Some(key) => self.succeed(key).await.unwrap(),
                None if self.store.waiting() == 0 => return,
                None => self.claim().await.unwrap(),
            }
        }
        panic!("jobs wait for ever");
    }
}

/// Runs one seed on a thread of its own; returns the final state of the store.
fn run(seed: u64, empty: &Path, done: Steps) -> Vec<String> {
    let work = async {
        let mut world = World::new(seed, empty, done).await;
        for _ in 0..world.dice.usize(STEPS) {
            world.step().await;
        }
        world.drain().await;
        world.check_the_end().await;
        let rows = world.rows().await;
        world.store.close().await;
        rows
    };
    let limited = async { tokio::time::timeout(LONGEST, work).await };
    runtime().block_on(limited).expect("it waits for ever")
}

fn setting(name: &str) -> Option<u64> {
    let text = std::env::var(name).ok()?;
    Some(text.parse().expect("a number"))
}

#[test]
fn jobs_keys_and_events_are_kept_whatever_happens() {
    let (first, end) = match setting("SIGNORINI_SIMULATION_SEED") {
        Some(seed) => (seed, seed + 1),
        None => (
            setting("SIGNORINI_SIMULATION_FIRST").unwrap_or(0),
            setting("SIGNORINI_SIMULATION_SEEDS").unwrap_or(SEEDS),
        ),
    };
    let (next, failed) = (AtomicU64::new(first), AtomicBool::new(false));
    let empty = empty_store();
    let (start, steps) = (Instant::now(), AtomicU64::new(0));
    let work = || {
        while !failed.load(Ordering::Relaxed) {
            let seed = next.fetch_add(1, Ordering::Relaxed);
            if seed >= end {
                return;
            }
            let done = Steps::default();
            let ran = catch_unwind(AssertUnwindSafe(|| run(seed, empty.path(), done.clone())));
            let done = done.lock();
            steps.fetch_add(done.len() as u64, Ordering::Relaxed);
            if ran.is_err() {
                failed.store(true, Ordering::Relaxed);
                eprintln!(
                    "{}\nSIGNORINI_SIMULATION_SEED={seed} failed",
                    done.join("\n")
                );
            }
        }
    };
    let threads = std::thread::available_parallelism().map_or(2, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(work);
        }
    });
    assert!(!failed.into_inner(), "see the seed above");
    println!(
        "{} seeds, {} steps, {:.1} s",
        end - first,
        steps.into_inner(),
        start.elapsed().as_secs_f64()
    );
}

#[test]
fn a_seed_gives_the_same_steps_and_the_same_final_state() {
    let empty = empty_store();
    for seed in 0..3 {
        let [first, second] = [(); 2].map(|()| {
            let done = Steps::default();
            let work = || run(seed, empty.path(), done.clone());
            let rows = std::thread::scope(|scope| scope.spawn(work).join()).unwrap();
            let done = done.lock().clone();
            (done, rows)
        });
        assert_eq!(first.0, second.0);
        checks::same(&first.1, &second.1, "the same seed");
    }
}
