//! Jobs at workers elsewhere, which are played here: messages are lost, repeated, late, in the wrong order, or wrong.

use solver::solution::Fields;

use super::*;
use crate::queue::leases::{
    About, Ask, End, JobAnswer, JobReport, Packed, Piece, Report, Task, WorkerId, solve_leased,
};

const MIB: u64 = 1 << 20;
/// How long leases last in these tests.
const LEASE: Duration = Duration::from_millis(400);
/// As long as no test waits.
const LONG: Duration = Duration::from_secs(60);

/// A queue without slots of its own.
async fn rig_without_slots() -> Rig {
    let rig = rig_of(fake::solve, 0).await;
    rig.store.set_budget(Budget::new(100 * MIB, 0, 0));
    rig.queue.set_lease(LEASE);
    rig.queue.start();
    rig
}

/// A worker, as the queue sees it.
struct Played<'a> {
    queue: &'a Queue,
    id: WorkerId,
    number: u64,
    memory: u64,
}

/// A job in the hands of a worker.
struct Held {
    id: JobId,
    attempt: i32,
    task: Task,
}

impl Played<'_> {
    fn new<'a>(rig: &'a Rig, secret: &str) -> Played<'a> {
        Played {
            queue: &rig.queue,
            id: WorkerId::of(secret.as_bytes()),
            number: 1,
            memory: 50 * MIB,
        }
    }

    async fn ask(&self, wait: Duration) -> Option<Held> {
        let ask = Ask {
            number: self.number,
            free_bytes: self.memory,
            takes: true,
            about: About {
                name: "node".into(),
                slots: 1,
                cores: 1,
                memory_bytes: self.memory,
                here: false,
            },
        };
        let granted = self.queue.lease(&self.id, ask, wait).await.unwrap()?;
        Some(Held {
            id: granted.job,
            attempt: granted.attempt,
            task: serde_json::from_slice(&granted.task).unwrap(),
        })
    }

    async fn next(&mut self) -> Held {
        let held = self.ask(LONG).await.unwrap();
        self.number += 1;
        held
    }

    async fn report(&self, held: &Held, report: JobReport) -> JobAnswer {
        let session = self.queue.session;
        self.report_in(held, JobReport { session, ..report }).await
    }

    async fn report_in(&self, held: &Held, report: JobReport) -> JobAnswer {
        let (id, attempt) = (held.id, held.attempt);
        self.queue.take_report(&self.id, id, attempt, report).await
    }

    /// Solves a job, and reports it in pieces of this many bytes.
    async fn finish(&self, held: &Held, most: usize) -> JobAnswer {
        let (reports, end, result) = solved(&held.task);
        let all = JobReport {
            reports,
            ..JobReport::default()
        };
        let told = self.report(held, all).await;
        assert_eq!(told.refused, None);
        let mut answer = JobAnswer::default();
        while answer.upload_bytes < result.total() {
            answer = self
                .piece(held, told.received, &result, answer.upload_bytes, most)
                .await;
            assert_eq!(answer.refused, None);
        }
        self.end(held, told.received, &end).await
    }

    async fn piece(
        &self,
        held: &Held,
        first: u64,
        result: &Packed,
        at: u64,
        most: usize,
    ) -> JobAnswer {
        let piece = piece_of(result, at, most);
        let report = JobReport {
            first,
            piece: Some(piece),
            ..JobReport::default()
        };
        self.report(held, report).await
    }

    async fn end(&self, held: &Held, first: u64, end: &End) -> JobAnswer {
        let report = JobReport {
            first,
            end: Some(serde_json::to_vec(end).unwrap()),
            ..JobReport::default()
        };
        self.report(held, report).await
    }
}

fn piece_of(result: &Packed, offset: u64, most: usize) -> Piece {
    Piece {
        upload: 1,
        partial: false,
        total: result.total(),
        sha256: result.sha256().to_vec(),
        offset,
        bytes: result.piece(offset, most),
    }
}

/// What a solver tells of a task, how it ends, and its result.
fn solved(task: &Task) -> (Vec<Vec<u8>>, End, Packed) {
    let mut reports = vec![];
    let mut supervisor = looking(|event| {
        reports.push(serde_json::to_vec(&Report::Event(event.clone())).unwrap());
        false
    });
    let allowance = base::memory::Allowance {
        share: u64::MAX,
        bodies: None,
    };
    let (end, result) = solve_leased(task, None, fake::solve, allowance, true, &mut supervisor);
    (reports, end, result.unwrap())
}

#[tokio::test]
async fn a_job_ends_as_if_it_had_been_solved_here() {
    let rig = rig_without_slots().await;
    let mut worker = Played::new(&rig, "one");
    let job = rig.submit().await;
    let held = worker.next().await;
    assert_eq!((held.id, held.attempt), (job.id, 1));
    let answer = worker.finish(&held, 100).await;
    assert!(answer.over && answer.refused.is_none(), "{answer:?}");
    let there = rig.until_done(&job).await;
    let events = |rig: Rig, job: Job| async move {
        let events = rig.store.events_after(job.key, 0, 1000).await.unwrap();
        let events = events.iter().map(|event| event.read().unwrap().payload);
        events
            .map(|payload| std::mem::discriminant(&payload))
            .collect::<Vec<_>>()
    };
    let here = rig_of(fake::solve, 1).await;
    here.queue.start();
    let other = here.submit().await;
    let done = here.until_done(&other).await;
    assert_eq!((there.status, there.verdict), (done.status, done.verdict));
    assert_eq!(events(rig, job).await, events(here, other).await);
}

#[tokio::test]
async fn a_repeated_request_gets_the_same_job() {
    let rig = rig_without_slots().await;
    let mut worker = Played::new(&rig, "one");
    assert!(
        worker.ask(Duration::ZERO).await.is_none(),
        "there is no job"
    );
    let (first, second) = (rig.submit().await, rig.submit().await);
    let [once, again] = [
        worker.ask(LONG).await.unwrap(),
        worker.ask(LONG).await.unwrap(),
    ];
    assert_eq!([once.id, again.id], [first.id; 2]);
    worker.number += 1;
    assert_eq!(worker.ask(LONG).await.unwrap().id, second.id);
    worker.number += 1;
    assert!(worker.ask(Duration::from_millis(50)).await.is_none());
}

#[tokio::test]
async fn what_has_arrived_before_is_passed_over_and_a_gap_is_told() {
    let rig = rig_without_slots().await;
    let mut worker = Played::new(&rig, "one");
    let job = rig.submit().await;
    let held = worker.next().await;
    let (reports, end, result) = solved(&held.task);
    let count = reports.len() as u64;
    let some = |first: u64, range: std::ops::Range<usize>| JobReport {
        first,
        reports: reports[range].to_vec(),
        ..JobReport::default()
    };
    assert_eq!(worker.report(&held, some(0, 0..2)).await.received, 2);
    let gap = worker.report(&held, some(3, 3..4)).await;
    assert!(gap.received == 2 && gap.refused.unwrap().contains("from 3 on came after 2"));
    let early = worker.end(&held, 2, &end).await;
    assert!(early.refused.unwrap().contains("has not arrived"));
    for _ in 0..2 {
        assert_eq!(
            worker
                .report(&held, some(0, 0..reports.len()))
                .await
                .received,
            count
        );
    }
    let gap = worker.piece(&held, count, &result, 10, 10).await;
    assert!(gap.refused.unwrap().contains("came after 0 of"));
    for at in [0, 5, 0] {
        assert_eq!(
            worker.piece(&held, count, &result, at, 10).await.refused,
            None
        );
    }
    let answer = worker
        .piece(&held, count, &result, 15, usize::MAX >> 1)
        .await;
    assert_eq!(answer.upload_bytes, result.total());
    for _ in 0..2 {
        assert!(worker.end(&held, count, &end).await.over);
    }
    let done = rig.until_done(&job).await;
    assert_eq!(done.status, Status::Succeeded);
    let events = rig.store.events_after(job.key, 0, 1000).await.unwrap();
    let of_solver =
        |event: &Event| !matches!(event.payload, Payload::Status { .. } | Payload::Done { .. });
    let events: Vec<Event> = events.iter().map(|event| event.read().unwrap()).collect();
    assert_eq!(
        events.iter().filter(|event| of_solver(event)).count(),
        reports.len()
    );
}

#[tokio::test]
async fn a_job_whose_worker_is_silent_is_solved_by_another_and_the_first_is_refused() {
    let rig = rig_without_slots().await;
    let (mut one, mut two) = (Played::new(&rig, "one"), Played::new(&rig, "two"));
    let job = rig.submit().await;
    let lost = one.next().await;
    // each report renews the lease
    for _ in 0..4 {
        tokio::time::sleep(LEASE / 2).await;
        assert!(!one.report(&lost, JobReport::default()).await.over);
    }
    let held = two.next().await;
    assert_eq!((held.id, held.attempt), (job.id, 2));
    let late = one.finish_late(&lost).await;
    assert!(late.over && late.refused.is_some(), "{late:?}");
    // nor can it report for the other
    let of_other = Held { attempt: 2, ..lost };
    let refused = one
        .end(&of_other, 0, &End::GivenBack)
        .await
        .refused
        .unwrap();
    assert!(refused.contains("is leased to worker_"), "{refused}");
    assert!(two.finish(&held, 1 << 20).await.over);
    let done = rig.until_done(&job).await;
    assert_eq!((done.status, done.attempt), (Status::Succeeded, 2));
}

impl Played<'_> {
    async fn finish_late(&self, held: &Held) -> JobAnswer {
        let (_, end, _) = solved(&held.task);
        self.end(held, 0, &end).await
    }
}

#[tokio::test]
async fn a_job_that_is_given_back_starts_again_and_nothing_is_charged() {
    let rig = rig_without_slots().await;
    let mut worker = Played::new(&rig, "one");
    let job = rig.submit().await;
    for attempt in 1..=5 {
        let held = worker.next().await;
        assert_eq!((held.id, held.attempt), (job.id, attempt));
        assert!(worker.end(&held, 0, &End::GivenBack).await.over);
    }
    let held = worker.next().await;
    worker.finish(&held, 1 << 20).await;
    assert_eq!(rig.until_done(&job).await.status, Status::Succeeded);
}

#[tokio::test]
async fn a_worker_that_is_not_to_be_trusted_loses_its_job_and_nothing_is_stored() {
    let rig = rig_without_slots().await;
    let mut worker = Played::new(&rig, "one");
    let job = rig.submit().await;
    let held = worker.next().await;
    let (reports, end, result) = solved(&held.task);
    let whole = piece_of(&result, 0, usize::MAX >> 1);
    let with = |piece: Piece| JobReport {
        piece: Some(piece),
        ..JobReport::default()
    };
    let huge = Piece {
        total: 10 << 30,
        ..whole.clone()
    };
    let hash = Piece {
        sha256: vec![1; 32],
        ..whole.clone()
    };
    let nonsense = JobReport {
        reports: vec![b"{\"Event\": NaN}".to_vec()],
        ..JobReport::default()
    };
    let no_end = JobReport {
        end: Some(b"{}".to_vec()),
        ..JobReport::default()
    };
    let first = rig.store.events_after(job.key, 0, 1).await.unwrap();
    let of_service = Report::Event(first[0].read().unwrap().payload);
    let forged = JobReport {
        reports: vec![serde_json::to_vec(&of_service).unwrap()],
        ..JobReport::default()
    };
    let unending = End::Solved {
        ending: Ending {
            status: Status::Queued,
            ..Ending::canceled()
        },
        unverified: false,
        iterations: 1,
    };
    let unending = JobReport {
        end: Some(serde_json::to_vec(&unending).unwrap()),
        ..JobReport::default()
    };
    let mut attempts = vec![
        (with(huge), "announced a result of 10"),
        (with(hash), "SHA-256"),
        (nonsense, "a report that cannot be read"),
        (no_end, "an end that cannot be read"),
        (forged, "an event of the service"),
        (unending, "an end that is none"),
    ];
    for parts in wrong_results() {
        let packed = Packed::new(parts, true).unwrap();
        attempts.push((
            with(piece_of(&packed, 0, usize::MAX >> 1)),
            "a result that is refused",
        ));
    }
    // a job allows three lost attempts: the wrong ones come from as many jobs
    let mut held = Some(held);
    for (number, (wrong, why)) in attempts.into_iter().enumerate() {
        let one = match held.take() {
            Some(held) => held,
            None => {
                rig.submit().await;
                worker.next().await
            }
        };
        let answer = worker.report(&one, wrong).await;
        assert!(answer.over, "{number}");
        let refused = answer.refused.unwrap();
        assert!(refused.contains(why), "{number}: {refused}");
        // the next attempt is another's
        let again = worker.next().await;
        assert_eq!((again.id, again.attempt), (one.id, 2), "{number}");
        worker.finish(&again, 1 << 20).await;
    }
    let done = rig.until_done(&job).await;
    assert_eq!((done.status, done.attempt), (Status::Succeeded, 2));
    assert!(!reports.is_empty() && matches!(end, End::Solved { .. }));
}

/// Results that cannot be served: numbers that are not finite, no summary, twice the same part.
fn wrong_results() -> Vec<Parts> {
    let parts = || Parts::of_a_summary().into_parts().collect::<Vec<_>>();
    let twice = parts().into_iter().chain(parts()).collect();
    let infinite = Fields {
        x: vec![f64::NAN],
        y: vec![0.0],
        ux: vec![0.0],
        uy: vec![0.0],
        stress_xx: vec![0.0],
        stress_yy: vec![0.0],
        stress_xy: vec![0.0],
        stress_zz: vec![0.0],
        contact_state: vec![-1],
        ..Fields::default()
    };
    vec![
        Parts::new(twice),
        Parts::new(vec![]),
        Parts::of_fields(&infinite),
    ]
}

#[tokio::test]
async fn a_cancel_and_a_time_limit_reach_the_worker_with_its_next_answer() {
    let rig = rig_without_slots().await;
    let mut worker = Played::new(&rig, "one");
    let job = rig.submit().await;
    let held = worker.next().await;
    assert!(!worker.report(&held, JobReport::default()).await.stop);
    rig.queue.cancel(job.key).await.unwrap();
    assert!(worker.report(&held, JobReport::default()).await.stop);
    assert_eq!(rig.until_done(&job).await.status, Status::Canceled);

    let mut short = new(0);
    short.limits.timeout_s = 0.2;
    let job = rig.submit_as(short).await;
    let held = worker.next().await;
    tokio::time::sleep(Duration::from_millis(250)).await;
    assert!(worker.report(&held, JobReport::default()).await.stop);
    worker.finish(&held, 1 << 20).await;
    rig.until_done(&job).await;
}

#[tokio::test]
async fn a_job_that_no_worker_has_room_for_waits_and_others_pass_it() {
    let rig = rig_without_slots().await;
    let mut worker = Played::new(&rig, "one");
    assert!(worker.ask(Duration::ZERO).await.is_none());
    let large = NewJob {
        memory_bytes: 60 * MIB,
        ..new(0)
    };
    let large = rig.submit_as(large).await;
    let small = rig.submit().await;
    let held = worker.next().await;
    assert_eq!(held.id, small.id);
    let waits = rig.store.job(Owners::All, large.id).await.unwrap().unwrap();
    assert_eq!(waits.queue.unwrap().reason, Waiting::NoWorkerFits);
    // a larger worker comes
    let mut other = Played::new(&rig, "two");
    other.memory = 70 * MIB;
    assert_eq!(other.next().await.id, large.id);
}

#[tokio::test]
async fn a_job_goes_to_the_worker_that_has_room_whichever_waits_beside_it() {
    for secrets in [["one", "two"], ["two", "one"]] {
        let rig = rig_without_slots().await;
        let [small, mut large] = secrets.map(|secret| Played::new(&rig, secret));
        large.memory = 90 * MIB;
        let job = NewJob {
            memory_bytes: 80 * MIB,
            ..new(0)
        };
        let (nothing, held, job) = tokio::join!(
            small.ask(Duration::from_millis(300)),
            large.ask(LONG),
            rig.submit_as(job)
        );
        assert!(nothing.is_none());
        assert_eq!(held.unwrap().id, job.id);
    }
}

#[tokio::test]
async fn a_worker_keeps_its_room_for_the_job_whose_turn_it_is() {
    let rig = rig_without_slots().await;
    let mut worker = Played::new(&rig, "one");
    let with = |mib: u64| NewJob {
        memory_bytes: mib * MIB,
        ..new(0)
    };
    let first = rig.submit_as(with(30)).await;
    assert_eq!(worker.next().await.id, first.id);
    let (large, small) = (rig.submit_as(with(40)).await, rig.submit_as(with(5)).await);
    // as much is free beside the first
    let whole = std::mem::replace(&mut worker.memory, 50 * MIB);
    let ask = |free: u64, number: u64| Ask {
        number,
        free_bytes: free,
        takes: true,
        about: About {
            name: "node".into(),
            slots: 2,
            cores: 2,
            memory_bytes: whole,
            here: false,
        },
    };
    let nothing = rig
        .queue
        .lease(&worker.id, ask(20 * MIB, 2), Duration::from_millis(50))
        .await;
    assert!(nothing.unwrap().is_none(), "it waits for the large one");
    let next = rig
        .queue
        .lease(&worker.id, ask(50 * MIB, 2), LONG)
        .await
        .unwrap();
    assert_eq!(next.unwrap().job, large.id);
    let next = rig
        .queue
        .lease(&worker.id, ask(10 * MIB, 3), LONG)
        .await
        .unwrap();
    assert_eq!(next.unwrap().job, small.id);
}

#[tokio::test]
async fn a_job_goes_on_at_its_worker_when_the_service_restarts() {
    for asked_to_stop in [false, true] {
        let rig = rig_without_slots().await;
        let mut worker = Played::new(&rig, "one");
        let job = rig.submit().await;
        let held = worker.next().await;
        let (reports, end, result) = solved(&held.task);
        let some = JobReport {
            reports: reports[..2].to_vec(),
            ..JobReport::default()
        };
        assert_eq!(worker.report(&held, some).await.received, 2);
        let two = |event: &Event| event.seq == 4;
        rig.until(&job, two).await;
        let before = rig.queue.session;
        if asked_to_stop {
            rig.queue.drain().await;
        }
        rig.queue.stopping.cancel();

        let again = Queue::new(rig.store.clone(), Solver::Threads(fake::solve), 0);
        assert_eq!(rig.store.requeue_interrupted().await.unwrap(), 0);
        again.go_on().await.unwrap();
        again.start();
        assert_ne!(again.session, before);
        worker.queue = &again;
        let old = JobReport {
            session: before,
            first: 2,
            reports: reports[2..].to_vec(),
            ..JobReport::default()
        };
        let answer = worker.report_in(&held, old).await;
        assert_eq!(
            (answer.session, answer.events, answer.received),
            (again.session, 2, 0)
        );
        let rest = JobReport {
            reports: reports[2..].to_vec(),
            ..JobReport::default()
        };
        let received = worker.report(&held, rest).await.received;
        assert_eq!(received, reports.len() as u64 - 2);
        worker
            .piece(&held, received, &result, 0, usize::MAX >> 1)
            .await;
        assert!(worker.end(&held, received, &end).await.over);
        let done = rig.store.job(Owners::All, job.id).await.unwrap().unwrap();
        assert_eq!((done.status, done.attempt), (Status::Succeeded, 1));
        let events = rig.store.events_after(job.key, 0, 1000).await.unwrap();
        assert_eq!(events.len(), reports.len() + 3, "queued, running, done");
        assert!(rig.store.leased().await.unwrap().is_empty());
    }
}

#[tokio::test]
async fn a_job_whose_worker_does_not_outlive_the_service_is_solved_by_another() {
    let rig = rig_without_slots().await;
    let mut worker = Played::new(&rig, "one");
    let job = rig.submit().await;
    worker.next().await;
    rig.queue.stopping.cancel();
    let again = Queue::new(rig.store.clone(), Solver::Threads(fake::solve), 1);
    again.set_lease(LEASE);
    rig.store.requeue_interrupted().await.unwrap();
    again.go_on().await.unwrap();
    again.start();
    let mut subscription = again.subscribe(job.key);
    loop {
        let now = rig.store.job(Owners::All, job.id).await.unwrap().unwrap();
        if now.status.is_terminal() {
            assert_eq!((now.status, now.attempt), (Status::Succeeded, 2));
            return;
        }
        subscription.changed().await;
    }
}

#[tokio::test]
async fn a_job_that_only_a_worker_has_room_for_waits_for_it_after_a_restart() {
    let rig = rig_of(fake::solve, 1).await;
    rig.store.set_budget(Budget::new(10 * MIB, 1, 0));
    rig.queue.start();
    let worker = Played::new(&rig, "one");
    assert!(worker.ask(Duration::ZERO).await.is_none());
    while rig.store.workers_memory().await.unwrap() != worker.memory {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    rig.queue.drain().await;
    // as a service that has just started
    rig.store.budget().set_elsewhere(0);
    let again = Queue::new(rig.store.clone(), Solver::Threads(fake::solve), 1);
    again.set_lease(LONG);
    again.go_on().await.unwrap();
    again.start();
    let job = NewJob {
        memory_bytes: 40 * MIB,
        ..new(0)
    };
    let rig = Rig {
        queue: again,
        ..rig
    };
    let (large, small) = (rig.submit_as(job).await, rig.submit().await);
    assert_eq!(rig.until_done(&small).await.status, Status::Succeeded);
    let waits = rig.store.job(Owners::All, large.id).await.unwrap().unwrap();
    assert_eq!(waits.status, Status::Queued);
    let mut worker = Played::new(&rig, "one");
    assert_eq!(worker.next().await.id, large.id);
}
