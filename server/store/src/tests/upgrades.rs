//! Stores that were written by earlier versions of the program.

use super::{
    connections::{Mode, open},
    *,
};

/// A store with the tables up to this migration, and with the rows that these statements insert.
fn older_store(folder: &Path, last: i64, statements: &[&str]) {
    let database = open(&folder.join("signorini.db"), Mode::Create).unwrap();
    migrations::run_to(&database, last).unwrap();
    for statement in statements {
        database.execute_batch(statement).unwrap();
    }
}

/// A job that had ended, and one that was waiting.
const BEFORE_THE_JOB_API: [&str; 4] = [
    "insert into problem (input_hash, body) values ('sha256:1', '{}')",
    "insert into job (uuid, status, input_hash, labels, created_at, started_at, finished_at, attempt, result_available)
     values ('01890a5d-ac96-774b-bcce-b302099a8057', 'succeeded', 'sha256:1', '{\"a\": \"b\"}', 1, 2, 3, 1, 'final')",
    "insert into job (uuid, status, input_hash, created_at)
     values ('01890a5d-ac96-774b-bcce-b302099a8058', 'queued', 'sha256:1', unixepoch() * 1000000)",
    "insert into result_part (job_id, name, piece, body) values (1, 'fields', 0, x'7b'), (1, 'fields', 1, x'7d')",
];

/// A job that waits, two that wait for its end, and one that was deleted; all of the only owner of that time.
const BEFORE_OWNERS: [&str; 5] = [
    "insert into problem (input_hash, body) values ('sha256:1', '{}')",
    "insert into job (uuid, status, input_hash, created_at)
     values ('01890a5d-ac96-774b-bcce-b302099a8057', 'queued', 'sha256:1', 1)",
    "insert into job (uuid, status, input_hash, created_at, twin_of)
     values ('01890a5d-ac96-774b-bcce-b302099a8058', 'queued', 'sha256:1', 2, 1)",
    "insert into job (uuid, status, input_hash, created_at, twin_of)
     values ('01890a5d-ac96-774b-bcce-b302099a8059', 'queued', 'sha256:1', 3, 1)",
    "insert into deleted_job (uuid, id, deleted_at) values ('01890a5d-ac96-774b-bcce-b302099a8056', 99, 1)",
];

#[tokio::test]
async fn a_store_from_before_the_job_api_is_upgraded_with_its_content() {
    let folder = tempfile::tempdir().unwrap();
    older_store(folder.path(), 2, &BEFORE_THE_JOB_API);
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
    let key = jobs[0].key;
    let mut found = store
        .snapshot(Owners::All, jobs[0].id)
        .await
        .unwrap()
        .unwrap();
    assert_eq!(found.part("fields").await.unwrap().unwrap(), b"{}");
    drop(found);
    let result = store.read(move |_, connection| results::StoredResult::of(connection, key));
    let result = result.await.unwrap().unwrap();
    let (_, info) = result.fields().unwrap();
    assert_eq!((info.bytes, info.digest.len()), (2, 32));
    // the waiting job is in the queue, and does not count as having waited too long
    assert_eq!(store.waiting(), 1);
    assert!(
        store
            .expire_queued(base::time::Time::now())
            .await
            .unwrap()
            .is_empty()
    );
    assert!(store.claim_next().await.unwrap().0.is_some());
    // a result of an older program answers no other job
    assert_eq!(
        store.delete(Owners::All, key).await.unwrap(),
        Deletion::Deleted
    );
    assert_eq!(store.fields_memory(key).await.unwrap(), None);
    assert_eq!(store.json_of(key, "fields").await.unwrap(), None);
}

/// Everything was kept until now.
#[tokio::test]
async fn nothing_of_an_earlier_version_is_removed_before_a_day_has_passed() {
    let folder = tempfile::tempdir().unwrap();
    older_store(folder.path(), 2, &BEFORE_THE_JOB_API);
    Store::open(folder.path()).await.unwrap().close().await;
    // a second start makes it neither shorter nor longer
    let store = Store::open(folder.path()).await.unwrap();
    let retention = Retention {
        age_s: Some(90.0 * 86_400.0),
        ..Retention::default()
    };
    let in_hours = |hours: f64| base::time::Time::now().after_s(3600.0 * hours);
    let foreseen = store.foreseen(&retention, in_hours(24.0)).await.unwrap();
    assert!(foreseen.0 == 1 && foreseen.1 > 0, "{foreseen:?}");
    let early = store.retire(&retention, in_hours(23.0)).await.unwrap();
    assert_eq!(early, Retired::default());
    let late = store.retire(&retention, in_hours(24.1)).await.unwrap();
    assert_eq!(late.jobs, 1);
}

/// Rows of versions that wrote no checksums are given theirs once, whether or not the first start dies meanwhile; from then on
/// one without a checksum is damaged.
#[tokio::test]
async fn jobs_of_a_version_without_checksums_are_given_theirs_once() {
    let folder = tempfile::tempdir().unwrap();
    older_store(folder.path(), 3, &BEFORE_OWNERS);
    // the start dies before anything is moved to content
    let database = open(&folder.path().join("signorini.db"), Mode::ReadWrite).unwrap();
    migrations::run_to(&database, migrations::CONTENT).unwrap();
    let unsealed = "select count(*) from job where checksum is null";
    assert_eq!(database.value::<i64>(unsealed, ()).unwrap(), 3);
    drop(database);
    let early = inspect(folder.path(), None).await;
    assert!(matches!(early, Err(StoreError::Schema(_))), "{early:?}");
    let store = Store::open(folder.path()).await.unwrap();
    let sealed: Vec<i64> = values(&store, "select checksum from job order by id").await;
    assert_eq!(sealed.len(), 3);
    run(&store, "update job set checksum = null where id = 2").await;
    store.close().await;
    drop(store);
    let store = Store::open(folder.path()).await.unwrap();
    let left: i64 = value(&store, unsealed).await;
    assert_eq!(left, 1, "a later start gives none");
    store.close().await;
    let report = inspect(folder.path(), None).await.unwrap();
    assert_eq!((report.jobs, report.intact), (3, 2), "{report:?}");
}

#[tokio::test]
async fn a_store_from_before_owners_keeps_its_coalesced_and_its_deleted_jobs() {
    let folder = tempfile::tempdir().unwrap();
    older_store(folder.path(), 3, &BEFORE_OWNERS);
    let store = Store::open(folder.path()).await.unwrap();
    assert_eq!(store.waiting(), 3);
    let local = || Owners::Only("local".into());
    let oldest_first = Order {
        descending: false,
        ..Order::NEWEST_FIRST
    };
    let everything = Filter::default();
    let jobs = store.jobs(local(), &everything, oldest_first, None, 10);
    let jobs: Vec<Job> = jobs.await.unwrap();
    let coalesced: Vec<Option<i64>> = jobs.iter().map(|job| job.coalesced_into).collect();
    assert_eq!(coalesced, [None, Some(1), Some(1)]);
    // the one that was solved first is canceled: the next takes its place, with the other coalesced into it
    store.request_cancel(1).await.unwrap();
    let claim = store.claim_next().await.unwrap().0.unwrap();
    assert_eq!(claim.job.id, jobs[1].id);
    let last = store.job(local(), jobs[2].id).await.unwrap().unwrap();
    assert_eq!(last.coalesced_into, Some(jobs[1].key));
    let deleted = "job_01890a5d-ac96-774b-bcce-b302099a8056";
    let deleted = base::job::JobId::parse(deleted).unwrap();
    assert!(store.was_deleted(local(), deleted).await.unwrap());
    assert!(
        !store
            .was_deleted(Owners::Only("ada".into()), deleted)
            .await
            .unwrap()
    );
}

#[tokio::test]
async fn a_store_of_an_earlier_version_is_inspected_after_its_upgrade() {
    let folder = tempfile::tempdir().unwrap();
    older_store(folder.path(), 3, &BEFORE_OWNERS);
    let early = inspect(folder.path(), None).await;
    assert!(matches!(early, Err(StoreError::Schema(_))), "{early:?}");
    Store::open(folder.path()).await.unwrap().close().await;
    let report = inspect(folder.path(), None).await.unwrap();
    // these jobs were written by hand, without events
    assert_eq!((report.jobs, report.intact), (3, 3), "{report:?}");
}

/// The last step before that which drops models.
const WITH_MODELS: i64 = 13;

/// A job that was deleted and whose result two others have, of which one has lost its fields; one whose result a disk has
/// changed; one with a partial result that runs; one whose result is not complete.
const BEFORE_CONTENT: [&str; 9] = [
    "insert into problem (input_hash, body, mesh, memory_bytes) values ('sha256:1', '{}', 'sha256:m', 77)",
    "insert into job (id, uuid, status, input_hash, created_at, started_at, finished_at, attempt, result_available, result_job)
     values (2, '01890a5d-ac96-774b-bcce-b302099a8002', 'succeeded', 'sha256:1', 1, 2, 3, 1, 'final', 1),
            (3, '01890a5d-ac96-774b-bcce-b302099a8003', 'succeeded', 'sha256:1', 1, 2, 3, 1, 'final', 1),
            (4, '01890a5d-ac96-774b-bcce-b302099a8004', 'succeeded', 'sha256:1', 1, 2, 3, 1, 'final', null)",
    "insert into job (id, uuid, status, input_hash, created_at, started_at, attempt, result_available)
     values (5, '01890a5d-ac96-774b-bcce-b302099a8005', 'running', 'sha256:1', 1, 2, 1, 'partial'),
            (6, '01890a5d-ac96-774b-bcce-b302099a8006', 'running', 'sha256:1', 1, 2, 1, 'none')",
    "insert into job_size (job_id, owner, bytes, finished_at, fields) values
        (2, 'local', 0, 3, 1), (3, 'local', 0, 3, 2), (4, 'local', 0, 3, 0)",
    "insert into result_part (job_id, name, piece, body) values
        (1, 'summary', 0, x'7b'), (1, 'summary', 1, x'7d'), (1, 'fields', 0, x'7b7d'), (4, 'summary', 0, x'7b7c'),
        (-5, 'summary', 0, x'7b7d'), (6, 'summary', 0, x'7b7d')",
    "insert into result_info (job_id, name, bytes, digest) values
        (1, 'fields', 2, x'44136fa355b3678a1146ad16f7e8649e94fb4fc21fe77e8310c060f61caaff8a'),
        (4, 'summary', 2, x'44136fa355b3678a1146ad16f7e8649e94fb4fc21fe77e8310c060f61caaff8a'),
        (1, 'history', 2, x'44136fa355b3678a1146ad16f7e8649e94fb4fc21fe77e8310c060f61caaff8a')",
    "insert into mesh (hash, info, created_at) values ('sha256:m', '{}', 1)",
    "insert into mesh_piece (hash, piece, body) values ('sha256:m', 0, x'01'), ('sha256:m', 1, x'02')",
    "insert into mesh_owner (hash, owner, created_at) values ('sha256:m', 'local', 1)",
];

#[tokio::test]
async fn what_earlier_versions_stored_becomes_content_of_the_jobs_that_had_it() {
    let folder = tempfile::tempdir().unwrap();
    older_store(folder.path(), migrations::CONTENT - 1, &BEFORE_CONTENT);
    let store = Store::open(folder.path()).await.unwrap();
    let part = async |key, part| {
        let read = store.json_of(key, part).await;
        read.map(|json| json.map(|json| String::from_utf8(json).unwrap()))
    };
    let whole = Some("{}".to_owned());
    for key in [2, 3, 5] {
        assert_eq!(part(key, "summary").await.unwrap(), whole, "job {key}");
    }
    assert_eq!(part(2, "fields").await.unwrap(), whole);
    assert_eq!(part(3, "fields").await.unwrap(), None, "they were deleted");
    assert_eq!(part(2, "history").await.unwrap(), None);
    let changed = part(4, "summary").await;
    assert!(changed.is_err_and(|told| told.is_damage_of(4)));
    assert_eq!(part(6, "summary").await.unwrap(), None);
    for key in 2..7 {
        let (_, problem) = store.problem(key).await.unwrap().unwrap();
        assert_eq!(problem, "{}");
    }
    assert_eq!(store.mesh_body("sha256:m").await.unwrap().unwrap(), [1, 2]);
    let in_use = store.remove_mesh(Owners::All, "sha256:m").await.unwrap();
    assert_eq!(in_use, Removal::InUse, "by the jobs that run");
    let running = store.read(|_, connection| rows::find(connection, 5));
    let running = running.await.unwrap().unwrap();
    assert_eq!(
        (running.mesh.as_deref(), running.memory_bytes),
        (Some("sha256:m"), Some(77))
    );
    // what is shared is counted once: the problem, the summary with its index, and the fields
    let size = store.size_of_owner("local").await.unwrap();
    assert_eq!(size.mesh_bytes, 2);
    let of_content = "select sum(bytes) from content where holder in (2, 3, 4)";
    let of_content: i64 = value(&store, of_content).await;
    assert_eq!(size.job_bytes, of_content as u64);
    store.compare_sums().await.unwrap();
}

/// Two owners with a model of the same name, a title with a quotation mark and a number that no shorter text has; a third whose
/// row a disk has changed.
const MODELS: [&str; 2] = [
    r#"insert into model (owner, name, description, created_at, updated_at, checksum) values
        ('ada', 'punch', '{"title":"a \"flat\" punch","inputs":[["/a"]],"outputs":[{"scalars":["normal_force"]}],"base_input":[[0.1]]}', 1, 2, null),
        ('..', 'punch', '{"title":null,"inputs":[["/b"]],"outputs":[],"base_input":[[1.0]]}', 1, 2, null),
        ('eve', 'punch', '{"title":null,"inputs":[["/c"]],"outputs":[],"base_input":[[1.0]]}', 1, 2, 7)"#,
    r#"insert into model_problem (model, body) values
        (1, '{"a":0.10000000000000000555}'), (2, '{"b":1}'), (3, '{"c":1}')"#,
];

#[tokio::test]
async fn registered_models_become_files_before_their_tables_go() {
    let folder = tempfile::tempdir().unwrap();
    older_store(folder.path(), WITH_MODELS, &MODELS);
    let store = Store::open(folder.path()).await.unwrap();
    let read = |owner: &str| {
        let name = format!("models/punch,{owner}.json");
        std::fs::read_to_string(folder.path().join(name))
    };
    assert_eq!(
        read("ada").unwrap(),
        r#"{"title":"a \"flat\" punch","inputs":[["/a"]],"outputs":[{"scalars":["normal_force"]}],"problem":{"a":0.10000000000000000555}}"#
    );
    assert_eq!(
        read("..").unwrap(),
        r#"{"title":null,"inputs":[["/b"]],"outputs":[],"problem":{"b":1}}"#
    );
    assert!(read("eve").is_err(), "it was damaged");
    let tables = "select count(*) from sqlite_schema where name like '%model%'";
    assert_eq!(value::<i64>(&store, tables).await, 0);
    store.close().await;
    // a store without the tables has no folder for them
    std::fs::remove_dir_all(folder.path().join("models")).unwrap();
    Store::open(folder.path()).await.unwrap().close().await;
    assert!(read("ada").is_err());
}
