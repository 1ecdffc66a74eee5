//! The store by itself.
#![allow(clippy::unwrap_used)]

mod owners;
mod plans;

use sqlx::{SqlitePool, migrate::Migrator, sqlite::SqliteConnectOptions};

use super::*;
use crate::{
    caller::Owners,
    job::{Cache, Limits, Status},
};

impl Store {
    /// Makes the disk full after so many more pages, until that is found out: the connection that has met it is
    /// replaced.
    pub(crate) async fn bound(&self, more: i64) {
        let pages: i64 = sqlx::query_scalar("pragma page_count")
            .fetch_one(&self.writer)
            .await
            .unwrap();
        let limit = sqlx::AssertSqlSafe(format!("pragma max_page_count = {}", pages + more));
        sqlx::query(limit).execute(&self.writer).await.unwrap();
    }

    /// Nobody has found out yet.
    pub(crate) async fn is_bound(&self) -> bool {
        let pages: i64 = sqlx::query_scalar("pragma max_page_count")
            .fetch_one(&self.writer)
            .await
            .unwrap();
        pages < 1_000_000
    }
}

/// A job with an input of its own, which answers nobody else.
fn new(input: &str) -> NewJob {
    NewJob {
        id: None,
        name: None,
        labels: Default::default(),
        priority: 0,
        limits: Limits::default(),
        cache: Cache::Off,
        parent: None,
        title: None,
        input_hash: format!("sha256:{input}"),
        problem: "{}".into(),
        mesh: None,
        payload: "payload".into(),
    }
}

/// What this owner hands in.
fn by(owner: &str, jobs: Vec<NewJob>, key: Option<&str>) -> Submission {
    let key = key.map(|key| RequestKey {
        key: key.into(),
        payload: "request".into(),
    });
    Submission {
        owner: owner.into(),
        jobs,
        key,
        max_queued: 1_000_000,
    }
}

/// A store as it was before the job API, with a job that had ended and one that was waiting.
async fn older_store(folder: &Path) {
    let migrations = folder.join("migrations");
    std::fs::create_dir(&migrations).unwrap();
    let now = Path::new(env!("CARGO_MANIFEST_DIR")).join("../migrations");
    for name in ["0001_jobs.sql", "0002_meshes.sql"] {
        std::fs::copy(now.join(name), migrations.join(name)).unwrap();
    }
    let options = SqliteConnectOptions::new()
        .filename(folder.join("signorini.db"))
        .create_if_missing(true);
    let db = SqlitePool::connect_with(options).await.unwrap();
    let migrator = Migrator::new(migrations.as_path()).await.unwrap();
    migrator.run(&db).await.unwrap();
    for statement in [
        "insert into problem (input_hash, body) values ('sha256:1', '{}')",
        "insert into job (uuid, status, input_hash, labels, created_at, started_at, finished_at, attempt, result_available)
         values ('01890a5d-ac96-774b-bcce-b302099a8057', 'succeeded', 'sha256:1', '{\"a\": \"b\"}', 1, 2, 3, 1, 'final')",
        "insert into job (uuid, status, input_hash, created_at)
         values ('01890a5d-ac96-774b-bcce-b302099a8058', 'queued', 'sha256:1', unixepoch() * 1000000)",
        "insert into result_part (job_id, name, piece, body) values (1, 'fields', 0, x'7b'), (1, 'fields', 1, x'7d')",
    ] {
        sqlx::query(statement).execute(&db).await.unwrap();
    }
    db.close().await;
}

#[tokio::test]
async fn an_older_store_is_brought_up_to_date_with_all_that_is_in_it() {
    let folder = tempfile::tempdir().unwrap();
    older_store(folder.path()).await;
    let store = Store::open(folder.path()).await.unwrap();
    let labeled = Filter {
        labels: vec![("a".into(), "b".into())],
        ..Filter::default()
    };
    let jobs = store.jobs(Owners::All, &labeled, Order::NEWEST_FIRST, None, 10);
    let jobs = jobs.await.unwrap();
    assert_eq!(jobs.len(), 1, "found by its label");
    assert_eq!(
        (jobs[0].status, jobs[0].limits),
        (Status::Succeeded, Limits::default())
    );
    let key = jobs[0].result_key;
    let mut found = store
        .snapshot(Owners::All, jobs[0].id)
        .await
        .unwrap()
        .unwrap();
    assert_eq!(found.part("fields").await.unwrap().unwrap(), b"{}");
    let info = found.part_info("fields").await.unwrap().unwrap();
    drop(found);
    assert_eq!((info.bytes, info.digest.len()), (2, 32));
    // the one that waited is in line, and is not taken for one that has waited too long
    assert_eq!(store.waiting(), 1);
    assert!(
        store
            .expire_queued(crate::time::Time::now())
            .await
            .unwrap()
            .is_empty()
    );
    assert!(store.claim_next().await.unwrap().0.is_some());
    // what an older program has found answers nobody
    assert_eq!(
        store.delete(Owners::All, key).await.unwrap(),
        Deletion::Deleted
    );
    assert_eq!(store.piece(key, "fields", 0).await.unwrap(), None);
}

/// SQLite ends a transaction by itself when the disk is full, and the driver does not notice.
#[tokio::test]
async fn a_full_disk_refuses_and_does_not_end_the_writing_for_ever() {
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
    assert_eq!(store.waiting(), accepted, "the line is what is on the disk");
    store.bound(4).await;
    // so large that the database has to write before it is told to commit, and undoes everything by itself
    let large = store.submit(submission(&"x".repeat(20 << 20)), false).await;
    assert!(matches!(large, Err(StoreError::Full)), "{large:?}");
    store.bound(1_000_000).await; // there is room again
    store.submit(submission("{}"), false).await.unwrap();
    assert_eq!(store.waiting(), accepted + 1);
}
