//! Tests of how attempts end: by themselves, canceled, timed out, requeued when the service stops.

use solver::{phase::Phase, problem::AccuracyMode};

use super::*;

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
            .json_of(job.key, "fields")
            .await
            .unwrap()
            .is_some()
    );
    let mut snapshot = rig
        .store
        .snapshot(Owners::All, job.id)
        .await
        .unwrap()
        .unwrap();
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
async fn a_running_job_whose_record_is_damaged_stops_and_frees_its_worker() {
    for canceled in [false, true] {
        let rig = rig(fake::solve_until_stopped).await;
        rig.queue.start();
        let damaged = rig.submit().await;
        rig.until_at_work(&damaged).await;
        rig.store.damage_job(damaged.key).await;
        if canceled {
            let refused = rig.queue.cancel(damaged.key).await;
            assert!(
                matches!(refused, Err(StoreError::Damaged(_))),
                "{refused:?}"
            );
        }
        let next = rig.submit().await;
        rig.until_at_work(&next).await;
        let unreadable = rig.store.job(Owners::All, damaged.id).await;
        assert!(matches!(unreadable, Err(StoreError::Damaged(_))));
    }
}

#[tokio::test]
async fn a_job_whose_end_a_damaged_database_cannot_store_frees_its_worker() {
    let folder = tempfile::tempdir().unwrap();
    Store::open(folder.path()).await.unwrap().close().await;
    Store::erase_table(folder.path(), "job_size").await;
    let store = Store::open(folder.path()).await.unwrap();
    let queue = Queue::new(store.clone(), Solver::Threads(fake::solve), 1);
    queue.start();
    let rig = Rig {
        store,
        queue,
        folder,
    };
    let job = rig.submit().await;
    let broken = async {
        while rig.store.health().await.is_ok() || rig.queue.state().idle == 0 {
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    };
    tokio::time::timeout(Duration::from_secs(10), broken)
        .await
        .unwrap();
    let refused = rig.queue.submit(submission(vec![new(0)], None)).await;
    assert!(matches!(refused, Err(StoreError::Broken(_))));
    let Rig {
        mut store,
        queue,
        folder,
    } = rig;
    // the service did not die with it, however often it is stopped and started so
    for starts in 1..5 {
        let found = store.job(Owners::All, job.id).await.unwrap().unwrap();
        assert_eq!(found.status, Status::Running);
        queue.drain().await;
        store.close().await;
        store = Store::open(folder.path()).await.unwrap();
        assert_eq!(store.requeue_interrupted().await.unwrap(), 1);
        let claim = store.claim_next().await.unwrap().0.unwrap();
        assert_eq!(claim.job.attempt, starts + 1);
        assert_eq!(claim.job.max_attempts, 3 + starts);
    }
}

#[tokio::test]
async fn a_canceled_running_job_keeps_its_last_state() {
    let rig = rig(fake::solve_until_stopped).await;
    rig.queue.start();
    let job = rig.submit().await;
    rig.until_at_work(&job).await;
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
            .json_of(job.key, "fields")
            .await
            .unwrap()
            .is_none(),
        "a canceled job has no fields"
    );
}

/// A solver that verifies until it is stopped.
fn verify_until_stopped(
    problem: &Problem,
    mesh: Option<External>,
    observer: &mut dyn Observer,
) -> std::result::Result<Solution, SolveError> {
    let mut problem = problem.clone();
    problem.solver.accuracy = Some(AccuracyMode::Verify);
    solver::solve_on(&problem, mesh, &mut Verifies(observer))
}

/// An observer that does not let a verification get anywhere.
struct Verifies<'a>(&'a mut dyn Observer);

impl Observer for Verifies<'_> {
    fn event(&mut self, progress: Progress<'_>) {
        let verifies = matches!(progress, Progress::Phase(Phase::Verify));
        self.0.event(progress);
        while verifies && !self.0.stop() {
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    fn stop(&mut self) -> bool {
        self.0.stop()
    }
}

/// A job that is stopped while it verifies keeps its solution with the estimated errors: a time limit applies to the
/// verification, too.
#[tokio::test]
async fn a_job_that_is_stopped_while_it_verifies_keeps_its_solution() {
    let rig = rig(verify_until_stopped).await;
    rig.queue.start();
    let timeout_s = 0.5;
    let limited = NewJob {
        limits: Limits {
            timeout_s,
            ..Limits::default()
        },
        ..new(0)
    };
    for (new, ends) in [
        (new(0), (Status::Canceled, Reason::UserCancel)),
        (limited, (Status::Failed, Reason::TimedOut)),
    ] {
        let job = rig.submit_as(new).await;
        let verifies = |event: &Event| {
            matches!(
                event.payload,
                Payload::Stage {
                    stage: Phase::Verify
                }
            )
        };
        rig.until(&job, verifies).await;
        if ends.0 == Status::Canceled {
            rig.queue.cancel(job.key).await.unwrap();
        }
        let done = rig.until_done(&job).await;
        assert_eq!((done.status, done.reason), (ends.0, Some(ends.1)));
        assert_eq!(done.result_available, ResultAvailable::Partial);
        assert_eq!(done.progress.unwrap().stage, "verify");
        let fields = rig.store.json_of(job.key, "fields").await.unwrap();
        assert!(fields.is_some(), "{ends:?}");
    }
}

/// A solver that converges to a state whose forces do not balance.
fn unbalanced(
    _: &Problem,
    _: Option<External>,
    _: &mut dyn Observer,
) -> std::result::Result<Solution, SolveError> {
    let mut solution = fake::solution();
    solution.summary.outcome = Outcome::FalseConvergence;
    solution.summary.converged = false;
    solution.summary.residuals.equilibrium = 0.5;
    Ok(solution)
}

#[tokio::test]
async fn a_job_whose_forces_do_not_balance_fails_and_keeps_its_result() {
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
            .json_of(job.key, "fields")
            .await
            .unwrap()
            .is_some()
    );
}

/// A solver with one long phase and nothing to report.
fn busy(
    _: &Problem,
    _: Option<External>,
    observer: &mut dyn Observer,
) -> std::result::Result<Solution, SolveError> {
    while !observer.stop() {
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
    assert!(start.elapsed() < CANCEL_GRACE, "{:?}", start.elapsed());
    assert_eq!((done.status, done.progress), (Status::Canceled, None));
    let events = rig.store.events_after(job.key, 0, 100).await.unwrap();
    let kinds: Vec<_> = events.iter().map(|event| &event.kind[..]).collect();
    assert_eq!(kinds, ["status", "status", "done"]);
}

/// A solver that does not react for a second, as in a long factorisation.
fn unresponsive(
    problem: &Problem,
    _: Option<External>,
    observer: &mut dyn Observer,
) -> std::result::Result<Solution, SolveError> {
    std::thread::sleep(Duration::from_secs(1));
    fake::solve(problem, None, observer)
}

#[tokio::test]
async fn an_unresponsive_solver_delays_only_its_worker_and_not_the_cancel() {
    let rig = rig(unresponsive).await;
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
    // the worker is free again, and the late result changes nothing
    let next = rig.submit().await;
    assert_eq!(rig.until_done(&next).await.status, Status::Succeeded);
    assert_eq!(
        rig.store.job(Owners::All, job.id).await.unwrap().unwrap(),
        done
    );
}

#[tokio::test]
async fn a_running_job_without_a_worker_is_canceled_at_once() {
    let rig = rig(fake::solve).await; // its workers never start: claimed jobs are not solved
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
async fn a_drain_requeues_a_running_job_without_using_up_an_attempt() {
    let rig = rig(fake::solve_until_stopped).await;
    rig.queue.start();
    let job = rig.submit().await;
    rig.until_at_work(&job).await;
    rig.queue.drain().await;
    let drained = rig.store.job(Owners::All, job.id).await.unwrap().unwrap();
    assert_eq!(
        (drained.status, drained.attempt, drained.max_attempts),
        (Status::Queued, 1, 4)
    );
}

/// A job that could not be requeued when the service stopped is not canceled: the next start of the service finds it
/// running.
#[tokio::test]
async fn a_job_that_could_not_be_requeued_is_not_canceled() {
    let rig = rig(fake::solve_until_stopped).await;
    rig.queue.start();
    let job = rig.submit().await;
    rig.until_at_work(&job).await;
    let running = rig.queue.running().get(&job.key).cloned().unwrap();
    rig.queue.stopping.cancel();
    running.stop(StopReason::Unwanted);
    while rig.queue.state().running > 0 {
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    assert_eq!(rig.store.requeue_interrupted().await.unwrap(), 1);
    let job = rig.store.job(Owners::All, job.id).await.unwrap().unwrap();
    assert_eq!((job.status, job.attempt), (Status::Queued, 1));
}

#[tokio::test]
async fn a_job_that_loses_three_workers_fails() {
    let rig = rig(fake::solve).await; // its workers never start: jobs are claimed, and lost, here
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
async fn a_drain_returns_the_new_status_of_each_job() {
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
async fn events_of_an_earlier_attempt_are_not_recorded() {
    let rig = rig(fake::solve).await;
    let job = rig.submit().await;
    rig.store.claim_next().await.unwrap().0.unwrap();
    rig.store.requeue_interrupted().await.unwrap();
    let again = rig.store.claim_next().await.unwrap().0.unwrap();
    let events = vec![(base::time::Time::now(), Payload::Iteration(fake::timed(1)))];
    assert!(
        !rig.store
            .append_events(job.key, 1, events.clone(), &Default::default())
            .await
            .unwrap()
    );
    assert_eq!(rig.finish(&job, 1).await, None);
    assert!(
        rig.store
            .append_events(job.key, again.job.attempt, events, &Default::default())
            .await
            .unwrap()
    );
}

#[tokio::test]
async fn a_job_that_times_out_fails_and_keeps_its_last_state() {
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
async fn a_job_that_times_out_is_ended_by_force_if_its_solver_does_not_react() {
    fn very_unresponsive(
        _: &Problem,
        _: Option<External>,
        _: &mut dyn Observer,
    ) -> std::result::Result<Solution, SolveError> {
        std::thread::sleep(Duration::from_secs(4));
        Err(SolveError::Stopped)
    }
    let rig = rig(very_unresponsive).await;
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
    assert_eq!(rig.queue.state().idle, 0, "its worker waits for the solver");
}

/// Partial results of eight steps that take no time are stored once, and not after each.
#[tokio::test]
async fn partial_results_of_many_quick_steps_are_not_stored_after_each() {
    fn quick_steps(
        _: &Problem,
        _: Option<External>,
        observer: &mut dyn Observer,
    ) -> std::result::Result<Solution, SolveError> {
        let mut solution = fake::solution();
        for _ in 0..8 {
            observer.event(Progress::Step(&solution));
            if observer.stop() {
                return Err(SolveError::Stopped);
            }
        }
        while !observer.stop() {
            std::thread::sleep(Duration::from_millis(1));
        }
        solution.summary.outcome = Outcome::Canceled;
        Err(SolveError::Stopped)
    }
    let rig = rig(quick_steps).await;
    rig.queue.start();
    let job = rig.submit().await;
    let found = loop {
        let job = rig.store.job(Owners::All, job.id).await.unwrap().unwrap();
        if job.result_available == ResultAvailable::Partial {
            break job;
        }
        tokio::time::sleep(Duration::from_millis(5)).await;
    };
    assert_eq!(found.status, Status::Running);
    rig.queue.cancel(job.key).await.unwrap();
    let done = rig.until_done(&job).await;
    assert_eq!(
        (done.status, done.result_available),
        (Status::Canceled, ResultAvailable::Partial)
    );
    let mut kept = rig
        .store
        .snapshot(Owners::All, job.id)
        .await
        .unwrap()
        .unwrap();
    assert!(kept.part("summary").await.unwrap().is_some());
    assert!(
        kept.part("history").await.unwrap().is_none(),
        "its events continued after it"
    );
}

/// A full disk, on which the events of a job cannot be stored for a while, delays the job and does not end it.
#[tokio::test]
async fn a_full_disk_delays_a_job_and_does_not_end_it() {
    let rig = rig(fake::solve_until_stopped).await;
    rig.queue.start();
    let mut short = new(0);
    short.limits.timeout_s = 1.0;
    let job = rig.submit_as(short).await;
    rig.until_at_work(&job).await;
    rig.store.bound(0).await;
    let done = rig.until_done(&job).await;
    assert!(!rig.store.is_bound().await, "the disk was full meanwhile");
    assert_eq!(
        (done.status, done.reason),
        (Status::Failed, Some(Reason::TimedOut))
    );
    let found = rig.store.snapshot(Owners::All, job.id).await;
    let stored = found.unwrap().unwrap().iterations(None).await.unwrap();
    assert_eq!(stored.len(), done.progress.unwrap().iteration as usize);
}
