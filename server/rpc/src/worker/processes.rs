//! Tests of solvers in separate processes: a crash of one costs only its job (R21).

#![allow(clippy::unwrap_used, clippy::panic)]

use std::{
    process::Command,
    sync::Arc,
    time::{Duration, Instant},
};

use base::{
    caller::Owners,
    digest,
    event::{Event, Payload},
    job::{Job, Reason, Status},
    memory::Budget,
};
use clap::Parser as _;
use service::{
    config::Config,
    queue::{Processes, Queue, Solver},
    verbs::Service,
};
use solver::{
    error::SolveError, mesh::External, observer::Observer, problem::Problem, solution::Solution,
};
use store::{NewJob, Store};
use tempfile::TempDir;
use tokio::runtime::Runtime;

use super::{
    run_as_process,
    simulation::{new_job, submission},
};
use crate::grpc::serve_processes;

/// The environment variable that makes the test below serve as a worker process.
const SERVES: &str = "SIGNORINI_TEST_WORKER_PROCESS";

/// The command that runs this test program as a worker process.
fn worker_process() -> Command {
    let mut command = Command::new(std::env::current_exe().unwrap());
    let this = "worker::processes::serve_as_a_worker_process";
    command.args(["--exact", this]).env(SERVES, "");
    command
}

#[test]
fn serve_as_a_worker_process() {
    if std::env::var_os(SERVES).is_some() {
        let runtime = Runtime::new().unwrap();
        runtime.block_on(run_as_process(poisoned)).unwrap();
        // not its solvers, of which one may never end
        runtime.shutdown_background();
    }
}

/// The ways in which a solver fails; the modulus of the problem is the index in this list.
const POISONS: [&str; 8] = [
    "", "harmless", "abort", "overflow", "exit", "panic", "allocate", "loop",
];

/// Fails in the way that the modulus selects.
fn poisoned(
    problem: &Problem,
    external: Option<External>,
    observer: &mut dyn Observer,
) -> Result<Solution, SolveError> {
    let modulus = serde_json::to_value(problem).unwrap()["materials"][0]["youngs_modulus"].as_f64();
    match POISONS.get(modulus.unwrap() as usize).copied() {
        Some("abort") => std::process::abort(),
        Some("overflow") => assert!(overflow(1) > 0),
        Some("exit") => std::process::exit(42),
        Some("panic") => panic!("on purpose"),
        // more than its share, and less than any machine has
        Some("allocate") => assert!(std::hint::black_box(vec![1u8; 1 << 30]).len() > 1),
        Some("loop") => loop {
            std::hint::spin_loop();
        },
        _ => {}
    }
    fake::solve(problem, external, observer)
}

#[allow(unconditional_recursion)]
fn overflow(depth: u64) -> u64 {
    std::hint::black_box([depth; 1024]);
    overflow(depth + 1) + 1
}

/// A service with one slot, and a folder that lives as long as it.
struct Rig {
    store: Arc<Store>,
    queue: Arc<Queue>,
    _folder: TempDir,
}

/// The settings of a service, as from its command line.
#[derive(clap::Parser)]
struct Settings {
    #[command(flatten)]
    config: Config,
}

/// A service that solves in processes, or on a thread.
async fn rig(in_processes: bool) -> Rig {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    store.set_budget(Budget::new(256 << 20, 1, 0));
    let (processes, sockets) = Processes::new(worker_process);
    let solver = match in_processes {
        true => Solver::Processes(processes),
        false => Solver::Threads(fake::solve),
    };
    let queue = Queue::new(store.clone(), solver, 1);
    let data = folder.path().to_str().unwrap();
    let Settings { config } = Settings::parse_from(["serve", "--data", data]);
    let service = Arc::new(Service::new(config, store.clone(), queue.clone()));
    tokio::spawn(serve_processes(service, sockets));
    queue.start();
    Rig {
        store,
        queue,
        _folder: folder,
    }
}

fn poison(name: &str) -> NewJob {
    let place = POISONS.iter().position(|poison| *poison == name).unwrap();
    let mut problem = serde_json::to_value(fake::problem()).unwrap();
    problem["materials"][0]["youngs_modulus"] = place.into();
    let problem: Problem = serde_json::from_value(problem).unwrap();
    NewJob {
        input_hash: digest::input_hash(&problem).unwrap(),
        problem: serde_json::to_string(&problem).unwrap(),
        ..new_job()
    }
}

impl Rig {
    async fn submit(&self, job: NewJob) -> Job {
        let submission = submission(vec![job]);
        self.queue.submit(submission).await.unwrap().jobs.remove(0)
    }

    async fn until_done(&self, job: &Job) -> Job {
        loop {
            let now = self.store.job(Owners::All, job.id).await.unwrap().unwrap();
            if now.status.is_terminal() {
                return now;
            }
            tokio::time::sleep(Duration::from_millis(2)).await;
        }
    }

    /// How a job with this failure ends, while the next one succeeds.
    async fn end_of(&self, name: &str) -> Job {
        let job = self.submit(poison(name)).await;
        let next = self.submit(poison("harmless")).await;
        let done = self.until_done(&job).await;
        assert_eq!(self.until_done(&next).await.status, Status::Succeeded);
        done
    }
}

#[tokio::test]
async fn a_process_solves_as_a_thread_does_and_is_kept() {
    let ours = rig(true).await;
    let job = ours.submit(poison("harmless")).await;
    assert_eq!(ours.until_done(&job).await.status, Status::Succeeded);
    let events = ours.store.events_after(job.key, 0, 10_000).await.unwrap();
    let events: Vec<Event> = events.iter().map(|event| event.read().unwrap()).collect();
    let iterations = events
        .iter()
        .filter(|e| matches!(e.payload, Payload::Iteration(_)));
    assert_eq!(iterations.count(), 3);
    let threads = rig(false).await;
    let same = threads.submit(poison("harmless")).await;
    threads.until_done(&same).await;
    for part in ["steps", "profile/top", "fields"] {
        let piece = ours.store.json_of(job.key, part).await.unwrap();
        assert_eq!(piece, threads.store.json_of(same.key, part).await.unwrap());
        assert!(piece.is_some(), "{part}");
    }
}

#[tokio::test]
async fn a_crash_of_the_process_costs_only_its_job() {
    let ours = rig(true).await;
    for (name, how) in [
        ("abort", "signal 6"),
        ("overflow", "signal 6"),
        ("exit", "exit code 42"),
    ] {
        let done = ours.end_of(name).await;
        let (reason, detail) = (done.reason, done.failure.unwrap().detail);
        assert_eq!(
            (done.status, reason, done.attempt),
            (Status::Failed, Some(Reason::WorkerLost), 3),
            "{name}"
        );
        assert!(
            detail.contains("during 3 attempts") && detail.contains(how),
            "{detail}"
        );
    }
}

#[tokio::test]
async fn memory_that_the_system_refuses_and_panics_end_the_job_at_once() {
    let ours = rig(true).await;
    let done = ours.end_of("allocate").await;
    assert_eq!(
        (done.reason, done.attempt),
        (Some(Reason::ResourceExhausted), 1)
    );
    let done = ours.end_of("panic").await;
    assert_eq!((done.reason, done.attempt), (Some(Reason::Internal), 1));
    assert!(!done.failure.unwrap().detail.contains("on purpose"));
}

#[tokio::test]
async fn an_endless_loop_is_killed_when_it_is_canceled() {
    let ours = rig(true).await;
    let job = ours.submit(poison("loop")).await;
    let next = ours.submit(poison("harmless")).await;
    while ours.queue.state().running == 0 {
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    ours.queue.cancel(job.key).await.unwrap();
    let canceled = Instant::now();
    assert_eq!(ours.until_done(&job).await.status, Status::Canceled);
    assert!(canceled.elapsed() < Duration::from_millis(500));
    assert_eq!(ours.until_done(&next).await.status, Status::Succeeded);
    // the worker is free a second after the end; the rest is for a slow machine
    assert!(
        canceled.elapsed() < Duration::from_secs(3),
        "{:?}",
        canceled.elapsed()
    );
}
