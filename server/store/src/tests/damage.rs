//! Nothing that a disk has changed is served.

use std::{fs, path::Path};

use base::{
    job::{JobId, ResultAvailable},
    mesh::MeshInfo,
};

use super::*;
use crate::{damage::Table, parts::Part as ResultPart};

const PARTS: [&str; 4] = ["summary", "history", "steps", "fields"];

/// A result that no other job has.
fn result_of(key: i64) -> Arc<Parts> {
    let json = |name: &str| format!("{{\"{name}\":{key}.25}}");
    let part = |name: &&str| ResultPart::new(name.to_string(), json(name).as_bytes());
    Arc::new(Parts::new(PARTS.iter().map(part).collect()))
}

/// Submits a job, solves it, and returns it.
async fn solved(store: &Arc<Store>, new: NewJob) -> Job {
    store
        .submit(by("ada", vec![new], None), false)
        .await
        .unwrap();
    let claim = store.claim_next().await.unwrap().0.unwrap();
    let (key, attempt) = (claim.job.key, claim.job.attempt);
    let ending = Ending {
        status: Status::Succeeded,
        reason: None,
        failure: None,
        result: ResultAvailable::Final,
        overview: Default::default(),
    };
    let parts = result_of(key);
    assert!(store.write_before_end(key, attempt, &parts).await.unwrap());
    let last = FinalBatch::default();
    let finished = store
        .finish(key, attempt, &ending, last, Some(&parts))
        .await;
    finished.unwrap().unwrap();
    store.job(Owners::All, claim.job.id).await.unwrap().unwrap()
}

/// Everything that clients can read of a job, by name and as text.
async fn everything(
    store: &Arc<Store>,
    id: JobId,
    mesh: &str,
) -> Vec<(&'static str, Result<String>)> {
    fn text<T: std::fmt::Debug>(read: Result<T>) -> Result<String> {
        read.map(|read| format!("{read:?}"))
    }
    let mut all = vec![
        ("job", text(store.job(Owners::All, id).await)),
        ("problem", text(store.problem(1).await)),
        ("events", text(store.events_after(1, 0, 100).await)),
        ("mesh", text(store.mesh(Owners::All, mesh).await)),
        ("mesh body", text(store.mesh_body(mesh).await)),
    ];
    match store.snapshot(Owners::All, id).await {
        Err(error) => all.extend(["snapshot"].map(|name| (name, Err(error.for_another())))),
        Ok(None) => {}
        Ok(Some(mut found)) => {
            for part in PARTS {
                all.push((part, text(found.part(part).await)));
            }
            drop(found);
            all.push(("memory", text(store.fields_memory(1).await)));
        }
    }
    all
}

/// Sets a column of the only row of a table to a value written in SQL.
async fn set(store: &Arc<Store>, table: &str, row: i64, column: &str, value: &str) {
    let key = if table == "event" { "seq" } else { "rowid" };
    let statement = format!("update {table} set {column} = {value} where {key} = {row}");
    run(store, statement).await;
}

#[tokio::test]
async fn no_column_can_change_unnoticed() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    run(&store, "pragma foreign_keys = off").await;
    let mesh: MeshInfo = serde_json::from_value(serde_json::json!({
        "hash": "sha256:mesh", "format": "gmsh", "bytes": 1, "nodes": 8, "quadrilaterals": 1, "triangles": 0,
        "dofs": 16, "extent": [[0, 1], [0, 1]], "boundaries": {}, "groups": {}, "node_sets": {}, "warnings": [],
        "quality": { "least_jacobian_ratio": 1, "worst_element": 0 }, "created_at": "2023-11-14T22:13:20Z"
    }))
    .unwrap();
    store_mesh(&store, "local", &mesh, &[1; PIECE_BYTES + 1]).await;
    let job = solved(
        &store,
        NewJob {
            title: Some("a title".into()),
            ..new("1")
        },
    )
    .await;
    let before = everything(&store, job.id, &mesh.hash).await;
    assert!(before.iter().all(|(_, read)| read.is_ok()), "{before:?}");
    // by which a row is found: another value is another row; and of which job's size content is a part
    let not_compared = |table: &str| match table {
        "job" => ["id", "uuid", "input_hash"].as_slice(),
        "event" => &["job_id"],
        "content" => &["id", "holder"],
        "attachment" => &[],
        _ => &["id", "hash"],
    };
    for table in [
        "job",
        "event",
        "content",
        "content_piece",
        "attachment",
        "mesh",
    ] {
        let key = match table {
            "event" => "seq",
            "attachment" => "name",
            _ => "rowid",
        };
        let columns = format!("select name from pragma_table_info('{table}')");
        let columns: Vec<String> = values(&store, columns).await;
        let places = format!("select quote({key}) from {table}");
        let places: Vec<String> = values(&store, places).await;
        for place in places {
            for column in columns.iter().map(String::as_str) {
                if not_compared(table).contains(&column) {
                    continue;
                }
                let old = format!("select quote({column}) from {table} where {key} = {place}");
                let old: String = value(&store, old).await;
                let put = async |value: &str, key: &str| {
                    let statement =
                        format!("update {table} set {column} = {value} where {key} = {place}");
                    run(&store, statement).await;
                };
                let other = match old.as_str() {
                    "NULL" if column == "checksum" => continue,
                    "NULL" => "7".into(),
                    text if text.starts_with('\'') => match (table, column) {
                        ("job", "status") => "'failed'".into(),
                        ("job", "cache") => "'use'".into(),
                        ("job", "result_available") => "'partial'".into(),
                        ("attachment", "kind") if text == "'job'" => "'mesh'".into(),
                        ("attachment", "kind") => "'job'".into(),
                        _ => format!("'x' || {text}"),
                    },
                    blob if blob.starts_with("X'") => "x'00'".into(),
                    number if matches!(column, "seq" | "piece" | "content") => {
                        format!("{number} + 100")
                    }
                    number => format!("{number} + 1"),
                };
                put(&other, key).await;
                let after = everything(&store, job.id, &mesh.hash).await;
                let noticed = after
                    .iter()
                    .any(|(_, read)| matches!(read, Err(StoreError::Damaged(_))));
                assert!(noticed, "{table}.{column} {place}: {old} to {other}");
                for (name, read) in &after {
                    let was = before.iter().find(|(other, _)| other == name);
                    if let (Some((_, Ok(was))), Ok(read)) = (was, read) {
                        assert_eq!(was, read, "{table}.{column}: {name}");
                    }
                }
                // the number by which it is found may be what was changed
                if column == key {
                    let back = format!("update {table} set {column} = {old} where {key} = {other}");
                    run(&store, back).await;
                } else {
                    put(&old, key).await;
                }
            }
        }
    }
    let again = everything(&store, job.id, &mesh.hash).await;
    assert_eq!(format!("{again:?}"), format!("{before:?}"));
    assert!(store.health().await.unwrap().damaged > 10);
}

/// No statement leaves a row without its checksum, and none gives it one later.
#[tokio::test]
async fn a_job_without_a_checksum_is_damaged_and_stays_so() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let mut jobs = vec![];
    for input in ["1", "2", "3"] {
        let accepted = store.submit(by("ada", vec![new(input)], None), false).await;
        jobs.extend(accepted.unwrap().jobs);
    }
    let running = store.claim_next().await.unwrap().0.unwrap().job;
    assert_eq!(running.key, jobs[0].key);
    run(&store, "update job set checksum = null where id < 3").await;
    let damaged = |told: &StoreError| told.is_damage_of(1) || told.is_damage_of(2);
    let (key, events) = (running.key, vec![(base::time::Time::now(), fake_event())]);
    let progress = Default::default();
    let appended = store.append_events(key, 1, events, &progress).await;
    assert!(appended.is_err_and(|told| damaged(&told)));
    let parts = Arc::new(Parts::of_a_summary());
    let partial = store.write_partial(key, 1, &parts).await;
    assert!(partial.is_err_and(|told| damaged(&told)));
    let (ending, last) = (Ending::canceled(), FinalBatch::default());
    let ended = store.finish(key, 1, &ending, last, None);
    assert!(ended.await.is_err_and(|told| damaged(&told)));
    let lost = store.requeue_lost(key, 1, "so").await;
    assert!(lost.is_err_and(|told| damaged(&told)));
    let drained = store.requeue_drained(key, 1).await;
    assert!(drained.is_err_and(|told| damaged(&told)));
    let edit = Edit {
        pinned: Some(true),
        ..Edit::default()
    };
    let edited = store
        .edit(Owners::All, jobs[1].id, move |_| Ok::<_, ()>(edit.clone()))
        .await;
    assert!(edited.is_err_and(|told| damaged(&told)));
    let canceled = store.request_cancel(2).await;
    assert!(canceled.is_err_and(|told| damaged(&told)));
    assert_eq!(store.cancel_queued(&[2]).await.unwrap().done, 0);
    assert!(store.delete(Owners::All, 2).await.is_err());
    let found = store.job(Owners::All, jobs[1].id).await;
    assert!(found.is_err_and(|told| damaged(&told)));
    // the others go on
    let next = store.claim_next().await.unwrap().0.unwrap().job;
    assert_eq!(next.key, jobs[2].key);
    let left = "select id from job where checksum is null order by id";
    let left: Vec<i64> = values(&store, left).await;
    assert_eq!(left, [1, 2]);
    assert_eq!(store.health().await.unwrap().damaged, 2);
    store.close().await;
    let report = inspect(folder.path(), None).await.unwrap();
    let told = |key: usize| {
        let name = jobs[key].id.to_string();
        report
            .findings
            .iter()
            .any(|line| line.contains(&name) && line.contains("checksum"))
    };
    assert!(told(0) && told(1) && !told(2), "{report:?}");
}

fn fake_event() -> base::event::Payload {
    base::event::Payload::Iteration(fake::timed(1))
}

#[tokio::test]
async fn a_damaged_result_answers_no_other_job() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let cached = || NewJob {
        cache: Cache::Use,
        ..new("1")
    };
    let first = solved(&store, cached()).await;
    set(&store, "content_piece", 2, "body", "x'7b7d'").await;
    let accepted = store
        .submit(by("ada", vec![cached()], None), false)
        .await
        .unwrap();
    assert_eq!(accepted.jobs[0].status, Status::Queued);
    assert_eq!(store.health().await.unwrap().damaged, 1);
    // an intact one does
    let second = solved(
        &store,
        NewJob {
            cache: Cache::Refresh,
            ..new("2")
        },
    )
    .await;
    let like_it = NewJob {
        cache: Cache::Use,
        ..new("2")
    };
    // the queue still holds the job of the first input, which was claimed and solved instead
    let accepted = store
        .submit(by("ada", vec![like_it], None), false)
        .await
        .unwrap();
    assert_ne!(first.id, second.id);
    assert_eq!(accepted.jobs[0].input_hash, "sha256:2");
}

/// The first bytes of fields tell how much memory it takes to read them: noise there may ask for more than there is.
#[tokio::test]
async fn the_memory_for_fields_is_told_by_intact_ones_only() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let job = solved(&store, new("1")).await;
    assert!(store.fields_memory(job.key).await.unwrap().is_some());
    store.close().await;
    let store = Store::open(folder.path()).await.unwrap();
    let noise = "update content_piece set body = zeroblob(length(body))
                 where content = (select content from attachment where name = 'fields')";
    run(&store, noise).await;
    let told = store.fields_memory(job.key).await;
    assert!(told.is_err_and(|told| told.is_damage_of(job.key)));
}

async fn submit_three(store: &Arc<Store>) {
    for input in ["1", "2", "3"] {
        let job = NewJob {
            problem: format!("{{\"n\":{input}}}"),
            ..new(input)
        };
        store
            .submit(by("ada", vec![job], None), false)
            .await
            .unwrap();
    }
}

#[tokio::test]
async fn a_damaged_job_does_not_stop_a_change_of_many() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    submit_three(&store).await;
    store.damage_job(2).await;
    let canceled = store.cancel_queued(&[1, 2, 3]).await.unwrap();
    assert_eq!((canceled.seen, canceled.done), (3, 2));
    let deleted = store.delete_ended(Owners::All, &[1, 2, 3]).await.unwrap();
    assert_eq!((deleted.seen, deleted.done), (3, 2));
}

#[tokio::test]
async fn a_damaged_job_does_not_stop_the_queue() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    submit_three(&store).await;
    store.damage_job(1).await;
    set(&store, "content_piece", 2, "body", "x'7b7d'").await;
    let claim = store.claim_next().await.unwrap().0.unwrap();
    assert_eq!(claim.job.key, 3);
    let second = Filter {
        input_hash: Some("sha256:2".into()),
        ..Filter::default()
    };
    let jobs = store.jobs(Owners::All, &second, Order::NEWEST_FIRST, None, 10);
    let failed = jobs.await.unwrap();
    assert_eq!(failed[0].status, Status::Failed);
    assert!(
        failed[0]
            .failure
            .clone()
            .unwrap()
            .detail
            .contains("problem")
    );
    assert!(store.claim_next().await.unwrap().0.is_none());
    // to start again is possible
    drop(claim);
    assert_eq!(store.requeue_interrupted().await.unwrap(), 1);
}

#[tokio::test]
async fn an_index_that_lacks_a_job_is_noticed() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let job = solved(&store, new("1")).await;
    store
        .damages
        .note_table(Table::Jobs, "row 1 missing from index");
    assert!(store.job(Owners::All, job.id).await.is_ok());
    let unknown = store.job(Owners::All, JobId::default()).await;
    assert!(
        matches!(unknown, Err(StoreError::Damaged(_))),
        "{unknown:?}"
    );
}

/// Every place of a text in the database.
fn places(folder: &Path, text: &str) -> Vec<usize> {
    let bytes = std::fs::read(folder.join("signorini.db")).unwrap();
    let found = bytes.windows(text.len()).enumerate();
    let found = found.filter(|(_, window)| *window == text.as_bytes());
    found.map(|(place, _)| place).collect()
}

/// Changes a bit of a store, opens it and reads it once in the background.
async fn opened_with_changed_bit(folder: &Path, place: usize) -> Result<Arc<Store>> {
    let file = folder.join("signorini.db");
    let mut bytes = std::fs::read(&file).unwrap();
    bytes[place] ^= 1;
    std::fs::write(&file, bytes).unwrap();
    let store = Store::open(folder).await?;
    scrub::read_once(&Arc::downgrade(&store)).await;
    Ok(store)
}

/// Wherever the bit lies: in a row, in an index, or in neither.
#[tokio::test]
async fn a_changed_bit_makes_no_second_job_and_hides_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let job = NewJob {
        name: Some("namezero".into()),
        labels: [("key".to_string(), "valzero".to_string())].into(),
        ..new("1")
    };
    let submission = || by("ada", vec![job.clone()], Some("keyzero"));
    let first = store
        .submit(submission(), false)
        .await
        .unwrap()
        .jobs
        .remove(0);
    store.close().await;
    drop(store);
    let labeled = Filter {
        labels: vec![("key".into(), "valzero".into())],
        ..Filter::default()
    };
    let named = Filter {
        name: Some("namezero".into()),
        ..Filter::default()
    };
    let (mut told, mut tried) = (0, 0);
    for text in ["valzero", "namezero", "keyzero"] {
        let places = places(folder.path(), text);
        assert!(places.len() > 1, "{text}");
        for place in places {
            let copy = tempfile::tempdir().unwrap();
            for name in ["signorini.db", "signorini.progress"] {
                std::fs::copy(folder.path().join(name), copy.path().join(name)).unwrap();
            }
            tried += 1;
            let Ok(store) = opened_with_changed_bit(copy.path(), place).await else {
                told += 1;
                continue;
            };
            for filter in [&labeled, &named] {
                match store
                    .jobs(Owners::All, filter, Order::NEWEST_FIRST, None, 10)
                    .await
                {
                    Ok(found) => assert_eq!(found.len(), 1, "{text} at {place}"),
                    Err(error) => assert!(matches!(error, StoreError::Damaged(_)), "{error}"),
                }
            }
            match store.submit(submission(), false).await {
                Ok(again) => assert_eq!(again.jobs[0].id, first.id, "{text} at {place}"),
                Err(error) => assert!(matches!(error, StoreError::Damaged(_)), "{error}"),
            }
            // others are not held up by one damaged key
            if text == "keyzero" {
                let other = NewJob {
                    payload: "other".into(),
                    ..new("2")
                };
                let other = Submission {
                    key: Some(RequestKey {
                        key: "other".into(),
                        payload: "other".into(),
                    }),
                    ..by("ada", vec![other], None)
                };
                store.submit(other, false).await.unwrap();
            }
            told += usize::from(store.damages.summary().0 > 0);
            store.close().await;
        }
    }
    assert!(tried > 6 && told + 1 >= tried, "{told} of {tried}");
}

/// The index of the pieces names their rows by numbers: a changed one is that of another job's content.
#[tokio::test]
async fn a_damaged_index_of_pieces_serves_nothing_of_another_job() {
    const KEYS: [i64; 3] = [1, 2, 3];
    async fn read(store: &Arc<Store>) -> Vec<Result<Option<Vec<u8>>>> {
        let mut found = vec![];
        for key in KEYS {
            for part in PARTS {
                found.push(store.json_of(key, part).await);
            }
            let problem = store.problem(key).await;
            found.push(problem.map(|found| found.map(|(_, body)| body.into_bytes())));
        }
        found
    }
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    for key in KEYS {
        solved(&store, new(&key.to_string())).await;
    }
    let before = read(&store).await;
    let root = "select rootpage from sqlite_schema where name = 'sqlite_autoindex_content_piece_1'";
    let page: i64 = value(&store, root).await;
    let size: i64 = value(&store, "pragma page_size").await;
    store.close().await;
    drop(store);
    let (start, size) = ((page - 1) * size, size as usize);
    let file = fs::read(folder.path().join("signorini.db")).unwrap();
    let cells = &file[start as usize..][..size];
    let first = usize::from(u16::from_be_bytes([cells[5], cells[6]]));
    let mut told = 0;
    for place in start as usize + first..start as usize + size {
        let copy = tempfile::tempdir().unwrap();
        for name in ["signorini.db", "signorini.progress"] {
            fs::copy(folder.path().join(name), copy.path().join(name)).unwrap();
        }
        let Ok(store) = opened_with_changed_bit(copy.path(), place).await else {
            told += 1;
            continue;
        };
        for (found, before) in read(&store).await.into_iter().zip(&before) {
            match found {
                Ok(found) => assert_eq!(Some(&found), before.as_ref().ok(), "at {place}"),
                Err(error) => {
                    assert!(matches!(error, StoreError::Damaged(_)), "{error}");
                    told += 1;
                }
            }
        }
        store.close().await;
    }
    assert!(told > 10, "{told}");
}

#[tokio::test]
async fn what_is_intact_is_saved_and_the_rest_is_named() {
    let (folder, new_folder) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let store = Store::open(folder.path()).await.unwrap();
    let mut jobs = vec![];
    for input in ["1", "2", "3", "4"] {
        let labels = [("set".to_string(), input.to_string())].into();
        jobs.push(
            solved(
                &store,
                NewJob {
                    labels,
                    ..new(input)
                },
            )
            .await,
        );
    }
    // one that waits for another that is damaged
    let waiting = || NewJob {
        cache: Cache::Use,
        ..new("5")
    };
    for _ in 0..2 {
        store
            .submit(by("ada", vec![waiting()], Some("key")), false)
            .await
            .unwrap();
    }
    store
        .submit(by("ada", vec![waiting()], None), false)
        .await
        .unwrap();
    set(&store, "event", 2, "t", "t + 1").await; // the second event of every job that has one
    for key in [1, 3, 4] {
        let back = format!("update event set t = t - 1 where seq = 2 and job_id = {key}");
        run(&store, back).await;
    }
    let third = "update content_piece set body = x'00'
                 where content = (select content from attachment where key = 3 and name = 'fields')";
    run(&store, third).await;
    set(&store, "job", 5, "owner", "'bob'").await;
    store.close().await;
    drop(store);
    let report = inspect(folder.path(), Some(new_folder.path()))
        .await
        .unwrap();
    let told = report.findings.join("\n");
    assert_eq!((report.jobs, report.intact), (6, 3), "{told}");
    assert!(told.contains(&format!("{}: event 2", jobs[1].id)), "{told}");
    assert!(told.contains(&format!("{}: fields", jobs[2].id)), "{told}");
    assert!(told.contains("(number 5): record"), "{told}");
    let saved = Store::open(new_folder.path()).await.unwrap();
    for kept in [&jobs[0], &jobs[3]] {
        let found = saved.job(Owners::All, kept.id).await.unwrap().unwrap();
        assert_eq!(format!("{found:?}"), format!("{kept:?}"));
        let mut found = saved.snapshot(Owners::All, kept.id).await.unwrap().unwrap();
        let fields = format!("{{\"fields\":{}.25}}", kept.key);
        assert_eq!(
            found.part("fields").await.unwrap().unwrap(),
            fields.as_bytes()
        );
    }
    let labeled = Filter {
        labels: vec![("set".into(), "4".into())],
        ..Filter::default()
    };
    let listed = saved
        .jobs(Owners::All, &labeled, Order::NEWEST_FIRST, None, 9)
        .await
        .unwrap();
    assert_eq!(listed.len(), 1);
    // the last one waits by itself now
    assert_eq!(saved.claim_next().await.unwrap().0.unwrap().job.key, 6);
    saved.close().await;
    drop(saved);
    let report = inspect(new_folder.path(), None).await.unwrap();
    assert_eq!(report.findings, Vec::<String>::new());
    assert_eq!((report.jobs, report.intact), (3, 3));
}

/// A changed byte in the definition of a table changes the name of a column, and what it names then is no text at all: the
/// service does not start on it, and the doctor tells of it, and saves what does not depend on this table.
#[tokio::test]
async fn a_damaged_definition_of_a_table_is_told() {
    for (table, column, kept) in [
        ("token", "scopes", 3),
        ("sweep", "paths", 3),
        ("event", "body", 0),
    ] {
        for byte in ["'_'", "cast(x'ff' as text)"] {
            let (folder, new_folder) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
            let store = Store::open(folder.path()).await.unwrap();
            submit_three(&store).await;
            store.close().await;
            drop(store);
            let database = rusqlite::Connection::open(folder.path().join("signorini.db")).unwrap();
            let changed = format!(
                "pragma writable_schema = on; update sqlite_schema \
                 set sql = replace(sql, '{column}', {byte} || substr('{column}', 2)) where name = '{table}'"
            );
            database.execute_batch(&changed).unwrap();
            drop(database);
            assert!(Store::open(folder.path()).await.is_err(), "{table} {byte}");
            let report = inspect(folder.path(), Some(new_folder.path()))
                .await
                .unwrap();
            let told = report.findings.join("\n");
            assert!(
                told.contains(&format!(
                    "database: {table} is missing, or defined differently"
                )),
                "{told}"
            );
            assert_eq!(
                (report.intact, report.incomplete),
                (kept, kept == 0),
                "{told}"
            );
            let saved = Store::open(new_folder.path()).await.unwrap();
            // a token that was lost may have been the last
            let closed = table != "sweep";
            assert_eq!(
                saved.any_tokens.load(std::sync::atomic::Ordering::Relaxed),
                closed,
                "{table}"
            );
            saved.close().await;
        }
    }
}

#[tokio::test]
async fn nothing_is_written_to_a_damaged_database() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    submit_three(&store).await;
    store.close().await;
    drop(store);
    Store::erase_table(folder.path(), "request_key").await;
    let store = Store::open(folder.path()).await.unwrap();
    assert!(store.health().await.is_ok());
    let first = store.submit(by("ada", vec![new("4")], Some("key")), false);
    let first = first.await.unwrap_err();
    assert!(matches!(first, StoreError::Broken(_)), "{first}");
    let claimed = store.claim_next().await;
    assert!(matches!(claimed, Err(StoreError::Broken(_))));
    let paused = store.set_paused(true).await;
    assert!(matches!(paused, Err(StoreError::Broken(_))), "{paused:?}");
    let refused = store
        .submit(by("ada", vec![new("4")], None), false)
        .await
        .unwrap_err();
    assert!(matches!(refused, StoreError::Broken(_)), "{refused}");
    let health = store.health().await;
    assert!(matches!(health, Err(StoreError::Broken(_))), "{health:?}");
    // what is intact can be read
    let all = Filter::default();
    let jobs = store.jobs(Owners::All, &all, Order::NEWEST_FIRST, None, 9);
    assert_eq!(jobs.await.unwrap().len(), 3);
}

/// Of a file that has lost its end everything is saved that the end had no part of.
#[tokio::test]
async fn a_database_that_was_cut_short_is_saved_up_to_its_end() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    for number in 0..20 {
        solved(&store, new(&number.to_string())).await;
    }
    store.close().await;
    drop(store);
    let file = fs::File::options()
        .write(true)
        .open(folder.path().join("signorini.db"));
    let file = file.unwrap();
    file.set_len(file.metadata().unwrap().len() - 4096).unwrap();
    let saved = tempfile::tempdir().unwrap();
    let report = inspect(folder.path(), Some(saved.path())).await.unwrap();
    assert!(!report.findings.is_empty());
    assert!(report.intact >= 10, "{report:?}");
    let new_store = Store::open(saved.path()).await.unwrap();
    let filter = Filter::default();
    let all = new_store.jobs(Owners::All, &filter, Order::NEWEST_FIRST, None, 50);
    assert_eq!(all.await.unwrap().len() as u64, report.intact);
    new_store.close().await;
}

/// Overwrites a page that is filled with this character, and is not the last of its value.
fn erase_page_of(folder: &Path, character: u8) {
    const PAGE: usize = 4096;
    let database = folder.join("signorini.db");
    let mut bytes = fs::read(&database).unwrap();
    let page = bytes
        .chunks_mut(PAGE)
        .find(|page| page[..4] != [0; 4] && page[4..].iter().all(|byte| *byte == character));
    page.unwrap().fill(0);
    fs::write(database, bytes).unwrap();
}

#[tokio::test]
async fn a_page_of_one_job_that_cannot_be_read_disturbs_no_other() {
    let folder = tempfile::tempdir().unwrap();
    let cached = |input: &str, character: &str| NewJob {
        cache: Cache::Use,
        problem: format!("\"{}\"", character.repeat(50_000)),
        ..new(input)
    };
    let submit = async |store: &Arc<Store>, job| {
        let accepted = store.submit(by("ada", vec![job], None), false).await;
        accepted.unwrap().jobs.remove(0)
    };
    let store = Store::open(folder.path()).await.unwrap();
    submit(&store, cached("1", "p")).await;
    let first = store.claim_next().await.unwrap().0.unwrap().job;
    let ending = Ending {
        status: Status::Succeeded,
        reason: None,
        failure: None,
        result: ResultAvailable::Final,
        overview: Default::default(),
    };
    let large = format!("\"{}\"", "r".repeat(50_000)).into_bytes();
    let result = Parts::new(vec![
        ResultPart::new("summary".into(), b"{}"),
        ResultPart::plain(large),
    ]);
    let last = FinalBatch::default();
    let result = Arc::new(result);
    let finished = store.finish(first.key, 1, &ending, last, Some(&result));
    finished.await.unwrap().unwrap();
    store.close().await;
    drop(store);
    erase_page_of(folder.path(), b'r');
    let store = Store::open(folder.path()).await.unwrap();
    // its result answers no other job, of which the problem is damaged next
    let second = submit(&store, cached("1", "p")).await;
    assert_eq!(second.status, Status::Queued);
    submit(&store, cached("2", "q")).await;
    let third = submit(&store, cached("3", "s")).await;
    let deleted = store.delete(Owners::All, first.key).await;
    // SQLite knows of every page whose it is, and frees what it finds of the broken chain
    assert_eq!(deleted.unwrap(), Deletion::Deleted);
    store.close().await;
    drop(store);
    erase_page_of(folder.path(), b'p');
    erase_page_of(folder.path(), b'q');
    let store = Store::open(folder.path()).await.unwrap();
    let claim = store.claim_next().await.unwrap().0.unwrap();
    assert_eq!(claim.job.id, third.id);
    let failed = store.job(Owners::All, second.id).await.unwrap().unwrap();
    assert_eq!(failed.reason, Some(base::job::Reason::Internal));
    assert!(store.health().await.is_ok());
    submit(&store, new("4")).await;
}

#[tokio::test]
async fn a_damaged_problem_that_is_submitted_again_is_mended_before_it_is_claimed() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    solved(&store, new("1")).await;
    set(&store, "content_piece", 1, "body", "x'5b5d'").await;
    let again = store.submit(by("ada", vec![new("1")], None), true).await;
    assert_eq!(again.unwrap().claim.unwrap().problem, new("1").problem);
    // also a large one, of which a single piece was changed
    let large = || NewJob {
        problem: format!("\"{}\"", "p".repeat(2 * PIECE_BYTES)),
        ..new("2")
    };
    let first = store.submit(by("ada", vec![large()], None), true).await;
    first.unwrap().claim.unwrap();
    let harm = "update content_piece set body = zeroblob(length(body)) where piece = 1";
    run(&store, harm).await;
    let again = store.submit(by("ada", vec![large()], None), true).await;
    assert_eq!(again.unwrap().claim.unwrap().problem, large().problem);
}
