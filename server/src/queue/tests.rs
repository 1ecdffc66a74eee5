//! The queue with stand-ins for the solver: what a real one does only on its worst days.
#![allow(clippy::unwrap_used)]

use std::time::Instant;

use solver::{
    error::SolveError,
    mesh::Mesh,
    problem::Problem,
    solution::{Observer, Outcome, Progress, Solution},
};

use super::*;
use crate::{
    digest,
    event::{Event, Payload},
    fake,
    job::{Cache, JobId, Limits, Reason, ResultAvailable, Waiting},
    store::{Edit, Filter, GroupBy, NewJob, Order, RequestKey, StoreError},
};

struct Rig {
    store: Arc<Store>,
    queue: Arc<Queue>,
    folder: tempfile::TempDir,
}

async fn rig(solve: Solve) -> Rig {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let queue = Queue::new(store.clone(), solve, 1);
    Rig {
        store,
        queue,
        folder,
    }
}

/// A job that is solved on its own.
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
        title: problem.title.clone(),
        input_hash: digest::input_hash(&problem).unwrap(),
        problem: serde_json::to_string(&problem).unwrap(),
        mesh: None,
        payload: "payload".into(),
    }
}

impl Rig {
    async fn submit(&self) -> Job {
        self.submit_as(new(0)).await
    }

    async fn submit_as(&self, new: NewJob) -> Job {
        let submission = Submission {
            jobs: vec![new],
            key: None,
            max_queued: 10,
            claim: false,
        };
        let accepted = self.queue.submit(submission).await.unwrap();
        accepted.jobs.into_iter().next().unwrap()
    }

    /// Ends a start by hand.
    async fn finish(&self, job: &Job, attempt: i32) -> Option<Vec<i64>> {
        let last = LastWords::default();
        let ending = Ending::canceled();
        let finished = self.store.finish(job.key, attempt, &ending, last, None);
        finished.await.unwrap()
    }

    async fn until(&self, job: &Job, done: impl Fn(&Event) -> bool) -> Vec<Event> {
        let mut news = self.queue.subscribe(job.key);
        loop {
            let events = self.store.events_after(job.key, 0, 100_000).await.unwrap();
            if events.iter().any(&done) {
                return events;
            }
            news.news().await;
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
            // The number in our store is not part of the story.
            Payload::Done { job: done } => Job {
                key: job.key,
                result_key: job.key,
                cache: job.cache,
                ..*done
            },
            other => unreachable!("{other:?} after done"),
        }
    }
}

#[tokio::test]
async fn a_job_runs_to_its_end_and_its_result_is_stored() {
    let rig = rig(fake::solve).await;
    rig.queue.start();
    let job = rig.submit().await;
    let done = rig.until_done(&job).await;
    assert_eq!(
        (done.status, done.result_available, done.attempt),
        (Status::Succeeded, ResultAvailable::Final, 1)
    );
    assert!(
        rig.store
            .piece(job.key, "fields", 0)
            .await
            .unwrap()
            .is_some()
    );
    let mut snapshot = rig.store.snapshot(job.id).await.unwrap().unwrap();
    assert_eq!(snapshot.profiled_boundaries().await.unwrap(), ["top"]);
}

#[tokio::test]
async fn a_panicking_solver_fails_its_job_and_not_its_worker() {
    let rig = rig(fake::solve_with_a_panic).await;
    rig.queue.start();
    for _ in 0..2 {
        let job = rig.submit().await;
        let done = rig.until_done(&job).await;
        assert_eq!(
            (done.status, done.reason),
            (Status::Failed, Some(Reason::Internal))
        );
        let detail = done.failure.unwrap().detail;
        assert!(
            detail.contains("incident") && !detail.contains("on purpose"),
            "{detail}"
        );
    }
}

#[tokio::test]
async fn a_canceled_running_job_keeps_its_last_state() {
    let rig = rig(fake::solve_until_stopped).await;
    rig.queue.start();
    let job = rig.submit().await;
    rig.until(&job, |event| matches!(event.payload, Payload::Iteration(_)))
        .await;
    assert_eq!(
        rig.queue.cancel(job.key).await.unwrap(),
        CancelOutcome::Requested { attempt: 1 }
    );
    let done = rig.until_done(&job).await;
    assert_eq!(
        (done.status, done.result_available),
        (Status::Canceled, ResultAvailable::Partial)
    );
    assert!(
        rig.store
            .piece(job.key, "fields", 0)
            .await
            .unwrap()
            .is_none(),
        "a canceled job has no fields"
    );
}

/// Settles where the forces do not balance.
fn unbalanced(
    _: &Problem,
    _: Option<&Mesh>,
    _: &mut Observer<'_>,
) -> std::result::Result<Solution, SolveError> {
    let mut solution = fake::solution();
    solution.summary.outcome = Outcome::FalseConvergence;
    solution.summary.converged = false;
    solution.summary.residuals.equilibrium = 0.5;
    Ok(solution)
}

#[tokio::test]
async fn a_job_that_converged_to_no_balance_fails_and_keeps_its_result() {
    let rig = rig(unbalanced).await;
    rig.queue.start();
    let job = rig.submit().await;
    let done = rig.until_done(&job).await;
    assert_eq!(
        (done.status, done.reason, done.result_available),
        (
            Status::Failed,
            Some(Reason::FalseConvergence),
            ResultAvailable::Partial
        )
    );
    let failure = done.failure.unwrap();
    assert_eq!(failure.code, "false-convergence");
    assert!(failure.detail.contains("5.000e-1"), "{}", failure.detail);
    assert!(
        rig.store
            .piece(job.key, "fields", 0)
            .await
            .unwrap()
            .is_some()
    );
}

/// At work in one long phase, with nothing to tell.
fn busy(
    _: &Problem,
    _: Option<&Mesh>,
    observe: &mut Observer<'_>,
) -> std::result::Result<Solution, SolveError> {
    while observe(Progress::Pulse).is_continue() {
        std::thread::sleep(Duration::from_millis(1));
    }
    Err(SolveError::Stopped)
}

#[tokio::test]
async fn a_pulse_is_answered_and_not_recorded() {
    let rig = rig(busy).await;
    rig.queue.start();
    let job = rig.submit().await;
    rig.until(&job, |event| event.seq == 2).await; // running
    let start = Instant::now();
    rig.queue.cancel(job.key).await.unwrap();
    let done = rig.until_done(&job).await;
    assert!(start.elapsed() < COOPERATION, "{:?}", start.elapsed());
    assert_eq!((done.status, done.progress), (Status::Canceled, None));
    let events = rig.store.events_after(job.key, 0, 100).await.unwrap();
    let kinds: Vec<_> = events.iter().map(|event| event.payload.kind()).collect();
    assert_eq!(kinds, ["status", "status", "done"]);
}

/// As one long factorisation: deaf for a second.
fn deaf(
    problem: &Problem,
    _: Option<&Mesh>,
    observe: &mut Observer<'_>,
) -> std::result::Result<Solution, SolveError> {
    std::thread::sleep(Duration::from_secs(1));
    fake::solve(problem, None, observe)
}

#[tokio::test]
async fn a_deaf_solver_delays_only_its_slot_and_not_the_cancel() {
    let rig = rig(deaf).await;
    rig.queue.start();
    let job = rig.submit().await;
    rig.until(&job, |event| {
        matches!(
            event.payload,
            Payload::Status {
                status: Status::Running,
                ..
            }
        )
    })
    .await;
    let start = Instant::now();
    rig.queue.cancel(job.key).await.unwrap();
    let done = rig.until_done(&job).await;
    assert!(
        start.elapsed() < Duration::from_millis(500),
        "{:?}",
        start.elapsed()
    );
    assert_eq!(
        (done.status, done.result_available),
        (Status::Canceled, ResultAvailable::None)
    );
    // The slot comes back, and the late result changes nothing.
    let next = rig.submit().await;
    assert_eq!(rig.until_done(&next).await.status, Status::Succeeded);
    assert_eq!(rig.store.job(job.id).await.unwrap().unwrap(), done);
}

#[tokio::test]
async fn a_running_job_that_no_worker_holds_is_canceled_at_once() {
    let rig = rig(fake::solve).await; // its workers never start: nobody holds what we claim
    let job = rig.submit().await;
    rig.store.claim_next().await.unwrap().0.unwrap();
    let outcome = rig.queue.cancel(job.key).await.unwrap();
    assert!(matches!(outcome, CancelOutcome::Canceled(_)), "{outcome:?}");
    assert_eq!(rig.until_done(&job).await.status, Status::Canceled);
    assert_eq!(
        rig.queue.cancel(job.key).await.unwrap(),
        CancelOutcome::AlreadyTerminal
    );
}

#[tokio::test]
async fn a_drain_puts_a_running_job_back_without_using_up_a_start() {
    let rig = rig(fake::solve_until_stopped).await;
    rig.queue.start();
    let job = rig.submit().await;
    rig.until(&job, |event| matches!(event.payload, Payload::Iteration(_)))
        .await;
    rig.queue.drain().await;
    let drained = rig.store.job(job.id).await.unwrap().unwrap();
    assert_eq!(
        (drained.status, drained.attempt, drained.max_attempts),
        (Status::Queued, 1, 4)
    );
}

#[tokio::test]
async fn a_job_that_loses_three_workers_fails() {
    let rig = rig(fake::solve).await; // its workers never start: we claim, and die, in their place
    let job = rig.submit().await;
    for attempt in 1..=3 {
        let claim = rig.store.claim_next().await.unwrap().0.unwrap();
        assert_eq!((claim.job.id, claim.job.attempt), (job.id, attempt));
        assert_eq!(rig.store.requeue_interrupted().await.unwrap(), 1);
    }
    let done = rig.until_done(&job).await;
    assert_eq!(
        (done.status, done.reason),
        (Status::Failed, Some(Reason::WorkerLost))
    );
}

#[tokio::test]
async fn a_running_job_with_a_cancel_request_is_canceled_at_the_next_start() {
    let rig = rig(fake::solve).await;
    let job = rig.submit().await;
    rig.store.claim_next().await.unwrap().0.unwrap();
    rig.store.request_cancel(job.key).await.unwrap();
    rig.store.requeue_interrupted().await.unwrap();
    assert_eq!(rig.until_done(&job).await.status, Status::Canceled);
}

#[tokio::test]
async fn a_drain_says_what_became_of_each_job() {
    let rig = rig(fake::solve).await;
    let (one, two) = (rig.submit().await, rig.submit().await);
    for _ in 0..2 {
        rig.store.claim_next().await.unwrap().0.unwrap();
    }
    rig.store.request_cancel(one.key).await.unwrap();
    let drain = async |job: &Job| rig.store.requeue_drained(job.key, 1).await.unwrap();
    assert_eq!(drain(&one).await, Some(Status::Canceled));
    assert_eq!(drain(&two).await, Some(Status::Queued));
    assert_eq!(drain(&two).await, None, "it runs no more");
}

#[tokio::test]
async fn what_an_overtaken_start_says_is_not_recorded() {
    let rig = rig(fake::solve).await;
    let job = rig.submit().await;
    rig.store.claim_next().await.unwrap().0.unwrap();
    rig.store.requeue_interrupted().await.unwrap();
    let again = rig.store.claim_next().await.unwrap().0.unwrap();
    let line = [(
        crate::time::Time::now(),
        Payload::Iteration(fake::iteration(1)),
    )];
    assert!(
        !rig.store
            .append_events(job.key, 1, &line, &Default::default())
            .await
            .unwrap()
    );
    assert_eq!(rig.finish(&job, 1).await, None);
    assert!(
        rig.store
            .append_events(job.key, again.job.attempt, &line, &Default::default())
            .await
            .unwrap()
    );
}

#[tokio::test]
async fn the_queue_is_ordered_by_priority_then_by_arrival() {
    let rig = rig(fake::solve).await;
    let mut jobs = vec![];
    for priority in [0, 5, 0, -1] {
        jobs.push(rig.submit_as(new(priority)).await);
    }
    let places: Vec<i64> = jobs
        .iter()
        .map(|job| job.queue.as_ref().unwrap().position)
        .collect();
    assert_eq!(places, [1, 1, 3, 4], "as they were when each arrived");
    let mut claimed = vec![];
    while let Some(claim) = rig.store.claim_next().await.unwrap().0 {
        claimed.push(claim.job.id);
    }
    assert_eq!(claimed, [jobs[1].id, jobs[0].id, jobs[2].id, jobs[3].id]);
}

#[tokio::test]
async fn a_second_server_on_the_same_folder_is_refused() {
    let rig = rig(fake::solve).await;
    let refused = Store::open(rig.folder.path()).await.unwrap_err();
    assert!(refused.to_string().contains("another server"), "{refused}");
}

/// With the input of the others, and ready to be answered with theirs.
fn same() -> NewJob {
    NewJob {
        cache: Cache::Use,
        ..new(0)
    }
}

#[tokio::test]
async fn an_earlier_result_answers_at_once_and_survives_its_source() {
    let rig = rig(fake::solve).await;
    rig.queue.start();
    let source = rig.submit_as(same()).await;
    rig.until_done(&source).await;
    let cached = rig.submit_as(same()).await;
    assert_eq!(
        (cached.status, cached.cached_from, cached.attempt),
        (Status::Succeeded, Some(source.id), 1)
    );
    let events = rig.store.events_after(cached.key, 0, 100).await.unwrap();
    let kinds: Vec<_> = events.iter().map(|event| event.payload.kind()).collect();
    assert_eq!(kinds, ["status", "status", "done"]);
    let part = |key| rig.store.piece(key, "fields", 0);
    let bytes = part(source.key).await.unwrap().unwrap();
    assert_eq!(cached.result_key, source.key);
    rig.store.delete(source.key).await.unwrap();
    assert_eq!(part(cached.result_key).await.unwrap(), Some(bytes));
    // and goes with the last that serves it
    rig.store.delete(cached.key).await.unwrap();
    assert_eq!(part(cached.result_key).await.unwrap(), None);
    let fresh = rig.submit_as(same()).await;
    assert_eq!(fresh.cached_from, None);
}

#[tokio::test]
async fn who_wants_no_earlier_result_gets_none_and_may_keep_his_own() {
    let rig = rig(fake::solve).await;
    rig.queue.start();
    let off = rig.submit().await;
    rig.until_done(&off).await;
    let used = rig.submit_as(same()).await;
    assert_eq!(used.cached_from, None, "an answer that was to stay private");
    rig.until_done(&used).await;
    let anew = NewJob {
        cache: Cache::Refresh,
        ..new(0)
    };
    let anew = rig.submit_as(anew).await;
    assert_eq!(anew.cached_from, None);
    rig.until_done(&anew).await;
    let later = rig.submit_as(same()).await;
    assert_eq!(later.cached_from, Some(anew.id));
}

#[tokio::test]
async fn a_twin_ends_as_its_source_ends() {
    let rig = rig(fake::solve).await; // its workers start later
    let source = rig.submit_as(same()).await;
    let twin = rig.submit_as(same()).await;
    let place = twin.queue.clone().unwrap();
    assert_eq!((place.position, place.reason), (1, Waiting::Joined));
    assert_eq!(rig.store.waiting(), 2, "one in line, one for its end");
    rig.queue.start();
    let done = rig.until_done(&twin).await;
    assert_eq!(
        (done.status, done.cached_from, done.attempt),
        (Status::Succeeded, Some(source.id), 1)
    );
    let twin = rig.store.job(twin.id).await.unwrap().unwrap();
    assert_eq!(twin.result_key, source.key);
}

#[tokio::test]
async fn canceling_one_of_two_twins_leaves_the_other() {
    let rig = rig(fake::solve_until_stopped).await;
    rig.queue.start();
    let source = rig.submit_as(same()).await;
    let first = rig.submit_as(same()).await;
    let second = rig.submit_as(same()).await;
    // the twin alone
    rig.queue.cancel(first.key).await.unwrap();
    assert_eq!(rig.until_done(&first).await.status, Status::Canceled);
    let source_now = rig.store.job(source.id).await.unwrap().unwrap();
    assert_eq!(source_now.status, Status::Running);
    // the source: the other twin takes its place
    rig.queue.cancel(source.key).await.unwrap();
    assert_eq!(rig.until_done(&source).await.status, Status::Canceled);
    rig.until(&second, |event| event.seq == 2).await;
    let second_now = rig.store.job(second.id).await.unwrap().unwrap();
    assert_eq!(
        (
            second_now.status,
            second_now.cached_from,
            second_now.twin_of
        ),
        (Status::Running, None, None)
    );
}

#[tokio::test]
async fn a_job_out_of_time_fails_and_keeps_its_last_state() {
    let rig = rig(fake::solve_until_stopped).await;
    rig.queue.start();
    let mut short = new(0);
    short.limits.timeout_s = 0.05;
    let job = rig.submit_as(short).await;
    let done = rig.until_done(&job).await;
    assert_eq!(
        (done.status, done.reason, done.result_available),
        (
            Status::Failed,
            Some(Reason::TimedOut),
            ResultAvailable::Partial
        )
    );
    assert_eq!(done.failure.unwrap().code, "timed-out");
}

#[tokio::test]
async fn a_deaf_solver_out_of_time_is_ended_over_its_head() {
    fn very_deaf(
        _: &Problem,
        _: Option<&Mesh>,
        _: &mut Observer<'_>,
    ) -> std::result::Result<Solution, SolveError> {
        std::thread::sleep(Duration::from_secs(4));
        Err(SolveError::Stopped)
    }
    let rig = rig(very_deaf).await;
    rig.queue.start();
    let mut short = new(0);
    short.limits.timeout_s = 0.05;
    let job = rig.submit_as(short).await;
    let start = Instant::now();
    let done = rig.until_done(&job).await;
    assert_eq!(done.reason, Some(Reason::TimedOut));
    assert!(
        start.elapsed() < Duration::from_secs(3),
        "{:?}",
        start.elapsed()
    );
    assert_eq!(rig.queue.state().idle, 0, "its slot waits for the solver");
}

#[tokio::test]
async fn a_job_that_waits_too_long_fails_with_a_reason_of_its_own() {
    let rig = rig(fake::solve_until_stopped).await;
    rig.queue.start();
    let busy = rig.submit().await;
    let mut short = new(0);
    short.limits.queue_ttl_s = 0.1;
    let job = rig.submit_as(short).await;
    let done = rig.until_done(&job).await;
    assert_eq!(
        (done.status, done.reason, done.attempt),
        (Status::Failed, Some(Reason::QueueExpired), 0)
    );
    assert_eq!(rig.store.waiting(), 0);
    let busy = rig.store.job(busy.id).await.unwrap().unwrap();
    assert_eq!(busy.status, Status::Running);
}

#[tokio::test]
async fn a_paused_queue_starts_nothing_until_it_is_resumed_also_after_a_restart() {
    let rig = rig(fake::solve).await;
    rig.queue.start();
    rig.queue.pause().await.unwrap();
    let job = rig.submit().await;
    assert_eq!(job.status, Status::Queued);
    assert_eq!(job.queue.as_ref().unwrap().reason, Waiting::Paused);
    rig.store.close().await;
    let Rig {
        store,
        queue,
        folder,
    } = rig;
    queue.drain().await;
    drop((store, queue));
    // the committing task lets go of the store when it next looks
    let store = loop {
        match Store::open(folder.path()).await {
            Ok(store) => break store,
            Err(_) => tokio::time::sleep(Duration::from_millis(10)).await,
        }
    };
    let queue = Queue::new(store.clone(), fake::solve, 1);
    queue.start();
    assert!(queue.state().paused);
    let rig = Rig {
        store,
        queue,
        folder,
    };
    tokio::time::sleep(Duration::from_millis(100)).await;
    let waiting = rig.store.job(job.id).await.unwrap().unwrap();
    assert_eq!(waiting.status, Status::Queued);
    rig.queue.resume().await.unwrap();
    assert_eq!(rig.until_done(&job).await.status, Status::Succeeded);
}

fn submission(jobs: Vec<NewJob>, key: Option<&str>) -> Submission {
    let key = key.map(|key| RequestKey {
        key: key.into(),
        payload: jobs[0].payload.clone(),
    });
    Submission {
        jobs,
        key,
        max_queued: 1000,
        claim: false,
    }
}

#[tokio::test]
async fn one_key_is_one_job_however_many_ask_at_once() {
    let rig = rig(fake::solve).await;
    let asking = (0..50).map(|_| rig.queue.submit(submission(vec![new(0)], Some("k"))));
    let answers = futures_util::future::join_all(asking).await;
    let answers: Vec<Accepted> = answers.into_iter().map(|answer| answer.unwrap()).collect();
    let id = answers[0].jobs[0].id;
    assert!(answers.iter().all(|answer| answer.jobs[0].id == id));
    let new_ones = answers.iter().filter(|answer| !answer.replayed).count();
    assert_eq!((new_ones, rig.store.waiting()), (1, 1));
    let mut other = submission(vec![new(0)], Some("k"));
    other.key.as_mut().unwrap().payload = "another".into();
    let refused = rig.queue.submit(other).await.unwrap_err();
    assert!(matches!(refused, StoreError::KeyReuse), "{refused}");
    // a key outlives its job, and says so
    rig.queue
        .cancel(rig.store.last_key().await.unwrap())
        .await
        .unwrap();
    rig.store
        .delete(rig.store.last_key().await.unwrap())
        .await
        .unwrap();
    let gone = rig.queue.submit(submission(vec![new(0)], Some("k")));
    assert!(matches!(gone.await, Err(StoreError::Deleted(gone)) if gone == id));
}

#[tokio::test]
async fn one_that_is_refused_undoes_nothing_of_those_in_the_same_commit() {
    let rig = rig(fake::solve).await;
    let id = JobId::new();
    let named = |payload: &str| NewJob {
        id: Some(id),
        payload: payload.into(),
        ..new(0)
    };
    rig.queue
        .submit(submission(vec![named("a")], None))
        .await
        .unwrap();
    // two of three are new, the one between belongs to somebody else: none is accepted
    let batch = vec![new(0), named("b"), new(0)];
    let asking = [
        submission(vec![new(0)], None),
        submission(batch, None),
        submission(vec![new(0), new(0)], None),
        submission(vec![named("a")], None),
    ];
    let asking = asking.map(|submission| rig.queue.submit(submission));
    let answers = futures_util::future::join_all(asking).await;
    assert!(answers[0].is_ok() && answers[2].is_ok());
    assert!(matches!(answers[1], Err(StoreError::IdConflict(other)) if other == id));
    let again = answers[3].as_ref().unwrap();
    assert!(again.replayed && again.jobs[0].id == id);
    assert_eq!(rig.store.waiting(), 4);
    let all = Filter::default();
    let by_status = rig.store.count(&all, Some(GroupBy::Status));
    assert_eq!(by_status.await.unwrap(), [("queued".to_string(), 4)]);
}

#[tokio::test]
async fn the_line_in_memory_is_the_queue_on_the_disk() {
    let rig = rig(fake::solve).await;
    let all = Filter::default();
    for priority in [0, 3, 0, -2, 3] {
        rig.submit_as(new(priority)).await;
    }
    let moved = rig.store.jobs(&all, Order::NEWEST_FIRST, None, 10);
    let moved = moved.await.unwrap();
    let edit = Edit {
        priority: Some(9),
        ..Edit::default()
    };
    rig.store.edit(moved[1].id, &edit, None).await.unwrap();
    rig.queue.cancel(moved[2].key).await.unwrap();
    let jobs = rig.store.jobs(&all, Order::NEWEST_FIRST, None, 10);
    let mut places: Vec<(i64, JobId)> = (jobs.await.unwrap().into_iter())
        .filter_map(|job| Some((job.queue?.position, job.id)))
        .collect();
    places.sort_by_key(|(position, _)| *position);
    let mut claimed = vec![];
    while let Some(claim) = rig.store.claim_next().await.unwrap().0 {
        claimed.push((claimed.len() as i64 + 1, claim.job.id));
    }
    assert_eq!(places, claimed);
    assert_eq!(claimed[0].1, moved[1].id);
    assert_eq!(rig.store.waiting(), 0);
}

#[tokio::test]
async fn twins_count_as_waiting_and_one_that_is_to_go_first_goes_alone() {
    let rig = rig(fake::solve).await; // its workers start later
    let source = rig.submit_as(same()).await;
    let twin = rig.submit_as(same()).await;
    let other = rig.submit_as(same()).await;
    assert_eq!(rig.store.waiting(), 3);
    let full = Submission {
        max_queued: 3,
        ..submission(vec![same()], None)
    };
    let refused = rig.queue.submit(full).await.unwrap_err();
    assert!(matches!(refused, StoreError::QueueFull), "{refused}");
    let first = Edit {
        priority: Some(5),
        ..Edit::default()
    };
    let twin = rig.store.edit(twin.id, &first, None).await.unwrap();
    let place = twin.unwrap().unwrap().queue.unwrap();
    assert_eq!(
        (place.position, place.reason),
        (1, Waiting::WorkersBusy),
        "before its source"
    );
    assert_eq!(rig.store.waiting(), 3);
    rig.queue.start();
    // the source is answered by it when its turn comes, and the other twin by the source
    for job in [&source, &other] {
        assert_eq!(rig.until_done(job).await.status, Status::Succeeded);
    }
    let source = rig.store.job(source.id).await.unwrap().unwrap();
    assert!(source.cached_from.is_some());
    assert_eq!(rig.store.waiting(), 0);
}

#[tokio::test]
async fn a_key_stands_for_what_is_left_of_its_jobs() {
    let rig = rig(fake::solve).await;
    rig.queue.start();
    let two = submission(vec![new(0), new(0)], Some("k"));
    let accepted = rig.queue.submit(two.clone()).await.unwrap();
    for job in &accepted.jobs {
        rig.until_done(job).await;
    }
    rig.store.delete(accepted.jobs[0].key).await.unwrap();
    let again = rig.queue.submit(two.clone()).await.unwrap();
    assert!(again.replayed);
    assert_eq!(again.jobs.len(), 1);
    assert_eq!(again.jobs[0].id, accepted.jobs[1].id);
    rig.store.delete(accepted.jobs[1].key).await.unwrap();
    let gone = rig.queue.submit(two.clone()).await;
    assert!(matches!(gone, Err(StoreError::Deleted(_))));
    // forgotten with the names of its jobs
    let later = crate::time::Time::now().after_s(8.0 * 86_400.0);
    rig.store.forget_deleted(later).await.unwrap();
    assert!(!rig.queue.submit(two).await.unwrap().replayed);
}

/// Eight steps that take no time: what they found is written once, and not eight times.
#[tokio::test]
async fn what_many_quick_steps_have_found_is_not_written_after_each() {
    fn quick_steps(
        _: &Problem,
        _: Option<&Mesh>,
        observe: &mut Observer<'_>,
    ) -> std::result::Result<Solution, SolveError> {
        let mut solution = fake::solution();
        for _ in 0..8 {
            if observe(Progress::Step(&solution)).is_break() {
                return Err(SolveError::Stopped);
            }
        }
        while observe(Progress::Pulse).is_continue() {
            std::thread::sleep(Duration::from_millis(1));
        }
        solution.summary.outcome = Outcome::Canceled;
        Err(SolveError::Stopped)
    }
    let rig = rig(quick_steps).await;
    rig.queue.start();
    let job = rig.submit().await;
    let found = loop {
        let job = rig.store.job(job.id).await.unwrap().unwrap();
        if job.result_available == ResultAvailable::Partial {
            break job;
        }
        tokio::time::sleep(Duration::from_millis(5)).await;
    };
    assert_eq!(
        (found.status, found.result_key),
        (Status::Running, -job.key)
    );
    rig.queue.cancel(job.key).await.unwrap();
    let done = rig.until_done(&job).await;
    assert_eq!(
        (done.status, done.result_available),
        (Status::Canceled, ResultAvailable::Partial)
    );
    let mut kept = rig.store.snapshot(job.id).await.unwrap().unwrap();
    assert!(kept.part("summary").await.unwrap().is_some());
    assert!(
        kept.part("history").await.unwrap().is_none(),
        "what was told went on after it"
    );
}

/// A job that waits, with somebody who watches it, is answered in the commit of another one's submit.
#[tokio::test]
async fn who_is_answered_beside_a_submit_is_told_of_it() {
    let rig = rig(fake::solve).await; // its workers never start: we claim in their place
    let waiting = rig.submit_as(same()).await;
    let anew = NewJob {
        cache: Cache::Refresh,
        ..new(5)
    };
    let source = rig.submit_as(anew).await;
    let claim = rig.store.claim_next().await.unwrap().0.unwrap();
    assert_eq!(claim.job.id, source.id);
    let solved = Ending {
        status: Status::Succeeded,
        reason: None,
        failure: None,
        result: ResultAvailable::Final,
    };
    let finished = rig
        .store
        .finish(source.key, 1, &solved, LastWords::default(), None);
    finished.await.unwrap().unwrap();
    let submission = Submission {
        claim: true,
        ..submission(vec![new(0)], None)
    };
    let accepted = rig.store.submit(submission).await.unwrap();
    assert!(accepted.changed.contains(&waiting.key), "{accepted:?}");
    let answered = rig.store.job(waiting.id).await.unwrap().unwrap();
    assert_eq!(
        (answered.status, answered.cached_from),
        (Status::Succeeded, Some(source.id))
    );
    let claimed = accepted.claim.unwrap().job;
    assert_eq!(claimed.id, accepted.jobs[0].id);
}
