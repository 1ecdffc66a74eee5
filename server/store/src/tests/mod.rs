//! The store alone.
#![allow(clippy::unwrap_used, clippy::too_many_lines)]

mod backups;
mod damage;
mod lists;
mod owners;
mod plans;
mod simulation;
mod space;
mod starts;
mod sweeps;
mod taking_turns;
mod upgrades;

use base::{
    caller::Owners,
    job::{Cache, Job, Limits, ResultAvailable, Status},
};
use rusqlite::types::FromSql;

use super::{sql::Sql, *};

/// Runs statements of which the store does not know.
async fn run(store: &Arc<Store>, statements: impl Into<String>) {
    let statements = statements.into();
    let done = store.write(move |writer| Ok(writer.connection().execute_batch(&statements)?));
    done.await.unwrap();
}

/// The first column of all rows of a query.
async fn values<T: FromSql + Send + 'static>(
    store: &Arc<Store>,
    query: impl Into<String>,
) -> Vec<T> {
    let query = query.into();
    let read = store.read(move |_, connection| connection.values(&query, ()));
    read.await.unwrap()
}

/// The first column of the only row of a query.
async fn value<T: FromSql + Send + 'static>(store: &Arc<Store>, query: impl Into<String>) -> T {
    values(store, query).await.pop().unwrap()
}

impl parts::Part {
    /// A part that is stored as it is, however well it could be compressed.
    fn plain(body: Vec<u8>) -> parts::Part {
        parts::Part {
            name: "fields".into(),
            encoding: encoding::Encoding::Plain,
            info: encoding::info_of_json(&body),
            body,
        }
    }
}

/// Stores a mesh with this body.
async fn store_mesh(store: &Arc<Store>, owner: &str, info: &base::mesh::MeshInfo, body: &[u8]) {
    let content = Fingerprint::of([body]);
    let pieces = body.chunks(PIECE_BYTES).map(<[u8]>::to_vec).collect();
    store.write_pieces(&content, 0, pieces).await.unwrap();
    let inserted = store.insert_mesh(owner, info, &content).await;
    inserted.unwrap().unwrap();
}

/// A job with an input of its own, whose result answers no other job.
fn new(input: &str) -> NewJob {
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
        input_hash: format!("sha256:{input}"),
        problem: format!("{{\"input\":\"{input}\"}}"),
        mesh: None,
        memory_bytes: 1 << 20,
        payload: "payload".into(),
    }
}

/// A submission of this owner.
fn by(owner: &str, jobs: Vec<NewJob>, key: Option<&str>) -> Submission {
    let key = key.map(|key| RequestKey {
        key: key.into(),
        payload: "request".into(),
    });
    Submission {
        owner: owner.into(),
        jobs,
        sweep: None,
        key,
        limits: QueueLimits {
            queued: 1_000_000,
            queued_of_owner: None,
        },
    }
}

/// SQLite ends a transaction by itself when the disk is full.
#[tokio::test]
async fn a_full_disk_refuses_jobs_and_writing_continues_when_there_is_space() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    store.bound(4).await;
    let submission = |problem: &str| {
        let job = NewJob {
            name: Some("x".repeat(1000)),
            problem: problem.into(),
            ..new(&problem.len().to_string())
        };
        by("ada", vec![job], None)
    };
    let mut accepted = 0;
    let refused = loop {
        match store.submit(submission("{}"), false).await {
            Ok(_) => accepted += 1,
            Err(refused) => break refused,
        }
    };
    assert!(matches!(refused, StoreError::Full), "{refused}");
    assert_eq!(
        store.waiting(),
        accepted,
        "the waiting jobs are those on the disk"
    );
    store.bound(4).await;
    // so large that the database has to write before the commit, and undoes everything by itself
    let large = store.submit(submission(&"x".repeat(20 << 20)), false).await;
    assert!(matches!(large, Err(StoreError::Full)), "{large:?}");
    store.bound(1_000_000).await; // there is room again
    store.submit(submission("{}"), false).await.unwrap();
    assert_eq!(store.waiting(), accepted + 1);
}

#[tokio::test]
async fn a_job_that_another_answers_keeps_no_piece_of_its_interrupted_attempt() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let submit = async |priority, cache| {
        let job = NewJob {
            priority,
            cache,
            ..new("1")
        };
        let accepted = store.submit(by("ada", vec![job], None), true).await;
        accepted.unwrap().claim.unwrap().job
    };
    let first = submit(0, Cache::Use).await;
    let large = Arc::new(Parts::new(vec![parts::Part::plain(vec![b' '; 3 << 20])]));
    let written = store.write_before_end(first.key, first.attempt, &large);
    assert!(written.await.unwrap());
    store
        .requeue_drained(first.key, first.attempt)
        .await
        .unwrap();
    let second = submit(1, Cache::Refresh).await;
    assert_ne!(second.key, first.key);
    let ending = Ending {
        status: Status::Succeeded,
        reason: None,
        failure: None,
        result: ResultAvailable::Final,
        overview: Default::default(),
    };
    let (parts, last) = (Arc::new(Parts::of_a_summary()), FinalBatch::default());
    let finished = store
        .finish(second.key, second.attempt, &ending, last, Some(&parts))
        .await;
    finished.unwrap().unwrap();
    assert!(store.claim_next().await.unwrap().0.is_none());
    let answered = store.job(Owners::All, first.id).await.unwrap().unwrap();
    assert_eq!(answered.status, Status::Succeeded);
    // what was written of its own result is removed by whoever wrote it, and else at the next start
    assert!(store.discard_unattached().await.unwrap() > 10);
    assert_eq!(store.json_of(first.key, "fields").await.unwrap(), None);
    let left: i64 = value(&store, "select count(*) from content_piece").await;
    assert_eq!(left, 2, "the problem and the result of both");
}

#[tokio::test]
async fn what_answers_a_job_is_checked_before_and_by_what_is_stored() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    for owner in ["ada", "bob"] {
        let job = NewJob {
            cache: Cache::Use,
            ..new("1")
        };
        let submission = by(owner, vec![job], None);
        store.submit(submission, false).await.unwrap();
    }
    let job = store.claim_next().await.unwrap().0.unwrap().job;
    // intact as it is stored, but not what it should decode to, which only whoever is served it needs to know
    let body = vec![7; PIECE_BYTES + 1];
    let fields = parts::Part {
        encoding: encoding::Encoding::Deflated,
        ..parts::Part::plain(body)
    };
    let parts = Parts::new(vec![parts::Part::new("summary".into(), b"{}"), fields]);
    let ending = Ending {
        status: Status::Succeeded,
        reason: None,
        failure: None,
        result: ResultAvailable::Final,
        overview: Default::default(),
    };
    let last = FinalBatch::default();
    let parts = Arc::new(parts);
    let ended = store.finish(job.key, 1, &ending, last, Some(&parts));
    ended.await.unwrap().unwrap();
    let numbers = format!(
        "select content from attachment where key = {} and name <> 'problem' order by name",
        job.key
    );
    let numbers: Vec<i64> = values(&store, numbers).await;
    let is_known = || {
        numbers
            .iter()
            .all(|number| store.intact.content.contains(number))
    };
    assert!(!is_known());
    // the other owner's turn is next
    store.check_result_for_next().await;
    assert!(is_known());
    assert!(store.json_of(job.key, "fields").await.is_err());
    let fields = numbers[0];
    let missing = format!("delete from content_piece where content = {fields} and piece = 1");
    run(&store, missing).await;
    let checked = store.read(move |_, connection| {
        let attached = content::all(connection, content::Holder::Job(job.key))?;
        intact::check_result(connection, &intact::Intact::default(), job.key, attached)
    });
    let checked = checked.await;
    assert!(
        matches!(checked, Err(StoreError::Damaged(_))),
        "{checked:?}"
    );
}
