//! Sweeps: rows are stored once, by the current attempt, and not served if a disk has changed them.

use base::{
    job::{Reason, SweepId},
    sweep::{MemberRow, Sweep},
    time::Time,
};

use super::*;

fn rows(numbers: &[usize]) -> Vec<(Time, MemberRow)> {
    let row = |n: &usize| match n % 2 {
        0 => MemberRow {
            number: *n as u32,
            status: Status::Succeeded,
            normal_force: Some(*n as f64),
            ..MemberRow::default()
        },
        _ => MemberRow::failed(*n, Reason::NotConverged, "so".into()),
    };
    numbers.iter().map(|n| (Time::now(), row(n))).collect()
}

/// A sweep of two jobs, of which the first was claimed.
async fn submitted(store: &Arc<Store>) -> (Sweep, Job) {
    let id = SweepId::new();
    let job = |input: &str| NewJob {
        sweep: Some(id),
        ..new(input)
    };
    let submission = Submission {
        sweep: Some(NewSweep {
            id,
            name: Some("s".into()),
            labels: [("k".to_owned(), "v".to_owned())].into(),
            paths: vec!["/a".into()],
            definition: "{}".into(),
            groups: vec![vec![0, 2, 3], vec![1]],
        }),
        ..by("ada", vec![job("1"), job("2")], None)
    };
    let accepted = store.submit(submission, true).await.unwrap();
    let ada = Owners::Only("ada".into());
    let sweep = store.sweep(ada, id).await.unwrap().unwrap();
    (sweep, accepted.claim.unwrap().job)
}

#[tokio::test]
async fn a_row_is_stored_once_and_by_the_current_attempt_only() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let (sweep, job) = submitted(&store).await;
    assert_eq!((sweep.status, sweep.jobs), (Status::Running, 2));
    assert_eq!((sweep.members.running, sweep.members.queued), (3, 1));
    let record = async |attempt, numbers: &[usize]| {
        let rows = rows(numbers);
        store.record_members(job.key, attempt, rows).await.unwrap()
    };
    assert_eq!(record(job.attempt, &[2]).await, Some(sweep.key));
    // of another attempt; again, with another; of another job
    assert_eq!(record(job.attempt + 1, &[3]).await, None);
    assert_eq!(record(job.attempt, &[2, 3]).await, Some(sweep.key));
    assert_eq!(record(job.attempt, &[1]).await, Some(sweep.key));
    let read = store
        .member_events(sweep.key, 0, 10)
        .await
        .unwrap()
        .unwrap();
    let order: Vec<(i64, u32)> = read
        .events
        .iter()
        .map(|(seq, _, row)| (*seq, row.number))
        .collect();
    assert_eq!((order, read.last), (vec![(1, 2), (2, 3)], 2));
    let counts = read.sweep.members;
    assert_eq!(
        (
            counts.succeeded,
            counts.failed,
            counts.running,
            counts.queued
        ),
        (1, 1, 1, 1)
    );

    // what is left, for the next attempt
    store.requeue_drained(job.key, job.attempt).await.unwrap();
    let task = store.members_task(job.key).await.unwrap().unwrap();
    assert_eq!((task.first, task.numbers), (0, vec![0]));
    let members = store.members(sweep.key, 0, 10).await.unwrap();
    let status: Vec<Status> = members.iter().map(|row| row.status).collect();
    assert_eq!(
        status,
        [
            Status::Queued,
            Status::Queued,
            Status::Succeeded,
            Status::Failed
        ]
    );
    assert!(!store.delete_sweep(sweep.key).await.unwrap(), "it has jobs");
}

#[tokio::test]
async fn members_of_a_failed_job_have_failed_also_without_it_and_a_sweep_goes_with_its_last_job() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let (sweep, job) = submitted(&store).await;
    let solved = rows(&[2]);
    let stored = store.record_members(job.key, job.attempt, solved);
    stored.await.unwrap();
    let failed = Ending::failed(Reason::WorkerLost, "so");
    let fail = async |job: &Job| {
        let last = FinalBatch::default();
        let ended = store.finish(job.key, job.attempt, &failed, last, None);
        ended.await.unwrap().unwrap();
    };
    fail(&job).await;
    let other = store.claim_next().await.unwrap().0.unwrap().job;
    fail(&other).await;
    let members = async || store.members(sweep.key, 0, 10).await.unwrap();
    let counts = async || {
        let read = store.sweep(Owners::All, sweep.id).await.unwrap();
        read.unwrap().members
    };
    let (before, counted) = (members().await, counts().await);
    assert_eq!((counted.succeeded, counted.failed), (1, 3));
    let definition = async |key| {
        let all = store.job(Owners::All, key).await.unwrap().unwrap();
        all.stored_bytes.unwrap()
    };
    let small = definition(other.id).await;
    assert_eq!(
        store.delete(Owners::All, job.key).await.unwrap(),
        Deletion::Deleted
    );
    assert_eq!(
        definition(other.id).await,
        small + 2,
        "the definition of the sweep"
    );
    assert_eq!((members().await, counts().await), (before, counted));
    let events = store
        .member_events(sweep.key, 0, 10)
        .await
        .unwrap()
        .unwrap();
    assert_eq!(events.events.len(), 1);
    store.delete(Owners::All, other.key).await.unwrap();
    assert!(store.sweep(Owners::All, sweep.id).await.unwrap().is_none());
    assert!(
        store
            .sweep_was_deleted(Owners::All, sweep.id)
            .await
            .unwrap()
    );
    assert!(store.delete_sweep(sweep.key).await.unwrap(), "it is gone");
    store.close().await;
    let report = inspect(folder.path(), None).await.unwrap();
    assert!(report.findings.is_empty(), "{report:?}");
}

#[tokio::test]
async fn a_row_that_a_disk_has_changed_is_not_served() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let (sweep, job) = submitted(&store).await;
    let solved = rows(&[0, 2]);
    let stored = store.record_members(job.key, job.attempt, solved);
    stored.await.unwrap();
    let harm = "update sweep_member set body = replace(body, '2.0', '3.0') where number = 2";
    run(&store, harm).await;
    let read = store.members(sweep.key, 0, 10).await;
    assert!(
        matches!(&read, Err(StoreError::Damaged(damage)) if damage.record.name.contains("member 2"))
    );
    assert!(
        store.members(sweep.key, 3, 10).await.is_ok(),
        "others are served"
    );
    assert!(store.member_events(sweep.key, 0, 10).await.is_err());
    let definition = "update content_piece set body = x'7b7d20'
                      where content in (select content from attachment where name = 'definition')";
    run(&store, definition).await;
    assert!(store.members_task(job.key).await.is_err());
    run(&store, "update sweep set last_seq = 7").await;
    assert!(store.sweep(Owners::All, sweep.id).await.is_err());
    store.close().await;
    let report = inspect(folder.path(), None).await.unwrap();
    let text = report.findings.join("\n");
    for what in [
        "record of sweep number 1",
        "definition: ",
        "member 2 of sweep number 1",
    ] {
        assert!(text.contains(what), "{text}");
    }
}
