//! Tests of the queue with substitutes for the solver, which fail in ways that the real one rarely does.
#![allow(clippy::unwrap_used, clippy::too_many_lines)]

mod attempts;
mod bodies;
mod coalescing;
mod estimates;
mod failpoints;
mod leases;
mod memory;
mod order;
mod submits;

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use base::{
    caller::Owners,
    digest,
    event::{Event, Payload},
    job::{Cache, Job, JobId, Limits, Reason, ResultAvailable, Status, Waiting},
    memory::Budget,
    run::Solve,
    sweep::MemberRow,
    time::Time,
};
use solver::{
    error::SolveError,
    mesh::External,
    observer::{Observer, Progress},
    problem::Problem,
    solution::{Outcome, Solution},
};
use store::{
    Accepted, CancelOutcome, Edit, Ending, Filter, FinalBatch, GroupBy, NewJob, Order, Parts,
    QueueLimits, RequestKey, Store, StoreError, Submission,
};

use super::{cancel::CANCEL_GRACE, running::StopReason, supervisor::Supervisor, *};

/// The owner of the jobs.
const OWNER: &str = "ada";

struct Rig {
    store: Arc<Store>,
    queue: Arc<Queue>,
    folder: tempfile::TempDir,
}

async fn rig(solve: Solve) -> Rig {
    rig_of(solve, 1).await
}

async fn rig_of(solve: Solve, workers: u16) -> Rig {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let queue = Queue::new(store.clone(), Solver::Threads(solve), workers);
    Rig {
        store,
        queue,
        folder,
    }
}

/// A job that no other job shares a result with.
fn new(priority: i32) -> NewJob {
    let problem = fake::problem();
    NewJob {
        id: None,
        name: None,
        labels: Default::default(),
        priority,
        limits: Limits::default(),
        cache: Cache::Off,
        parent: None,
        sweep: None,
        title: problem.title.clone(),
        input_hash: digest::input_hash(&problem).unwrap(),
        problem: serde_json::to_string(&problem).unwrap(),
        mesh: None,
        memory_bytes: 1 << 20,
        payload: "payload".into(),
    }
}

impl Rig {
    async fn submit(&self) -> Job {
        self.submit_as(new(0)).await
    }

    async fn submit_as(&self, new: NewJob) -> Job {
        let submission = Submission {
            owner: OWNER.into(),
            jobs: vec![new],
            sweep: None,
            key: None,
            limits: QueueLimits {
                queued: 10,
                queued_of_owner: None,
            },
        };
        let accepted = self.queue.submit(submission).await.unwrap();
        accepted.jobs.into_iter().next().unwrap()
    }

    /// Waits until the job's solver has reported something.
    async fn until_at_work(&self, job: &Job) {
        self.until(job, |event| matches!(event.payload, Payload::Iteration(_)))
            .await;
    }

    async fn set_priority(&self, job: &Job, priority: i32) -> Job {
        let edit = Edit {
            priority: Some(priority),
            ..Edit::default()
        };
        let edited = self
            .store
            .edit(Owners::All, job.id, move |_| Ok::<_, ()>(edit.clone()))
            .await
            .unwrap();
        edited.unwrap().unwrap()
    }

    /// Ends an attempt by hand.
    async fn finish(&self, job: &Job, attempt: i32) -> Option<Vec<i64>> {
        let last = FinalBatch::default();
        let ending = Ending::canceled();
        let finished = self.store.finish(job.key, attempt, &ending, last, None);
        finished.await.unwrap()
    }

    async fn until(&self, job: &Job, done: impl Fn(&Event) -> bool) -> Vec<Event> {
        let mut subscription = self.queue.subscribe(job.key);
        loop {
            let events = self.store.events_after(job.key, 0, 100_000).await.unwrap();
            let events: Vec<Event> = events.iter().map(|event| event.read().unwrap()).collect();
            if events.iter().any(&done) {
                return events;
            }
            subscription.changed().await;
        }
    }

    async fn until_done(&self, job: &Job) -> Job {
        let events = self
            .until(job, |event| matches!(event.payload, Payload::Done { .. }))
            .await;
        assert!(
            events
                .iter()
                .map(|event| event.seq)
                .eq(1..=events.len() as i64),
            "seq is dense from 1"
        );
        match events.into_iter().next_back().unwrap().payload {
            // the keys in the store are no part of the event
            Payload::Done { job: done } => Job {
                key: job.key,
                memory_bytes: job.memory_bytes,
                cache: job.cache,
                ..*done
            },
            other => unreachable!("{other:?} after done"),
        }
    }
}

/// A supervisor that records nothing. A function sees each event, and answers whether to stop from then on.
struct Looking<F> {
    see: F,
    stopped: bool,
}

fn looking<F: FnMut(&Payload) -> bool>(see: F) -> Looking<F> {
    Looking {
        see,
        stopped: false,
    }
}

impl<F: FnMut(&Payload) -> bool> Supervisor for Looking<F> {
    fn one_level(&mut self) {}

    fn event(&mut self, payload: Payload) {
        self.stopped |= (self.see)(&payload);
    }

    fn member(&mut self, _: MemberRow) {}

    fn partial(&mut self, _: Parts) {}

    fn stop(&mut self) -> bool {
        self.stopped
    }

    fn threads(&mut self) -> usize {
        1
    }
}

/// A job with the same input as others of this kind, which may be answered with their result.
fn same() -> NewJob {
    NewJob {
        cache: Cache::Use,
        ..new(0)
    }
}

fn submission(jobs: Vec<NewJob>, key: Option<&str>) -> Submission {
    let key = key.map(|key| RequestKey {
        key: key.into(),
        payload: jobs[0].payload.clone(),
    });
    Submission {
        owner: OWNER.into(),
        jobs,
        sweep: None,
        key,
        limits: QueueLimits {
            queued: 1000,
            queued_of_owner: None,
        },
    }
}
