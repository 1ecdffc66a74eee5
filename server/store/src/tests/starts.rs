//! Starting on what is there: a store is opened whole, or refused with a reason.

use std::{
    fs,
    os::unix::fs::{MetadataExt, PermissionsExt},
    path::PathBuf,
    sync::atomic::{AtomicU32, Ordering::Relaxed},
};

use base::{job::ResultAvailable, time::Time};

use super::*;

/// The files of a store at this moment, as a crash would leave them.
fn crashed(folder: &Path) -> tempfile::TempDir {
    let copy = tempfile::tempdir().unwrap();
    for file in ["signorini.db", "signorini.db-wal", "signorini.progress"] {
        let _ = fs::copy(folder.join(file), copy.path().join(file));
    }
    copy
}

async fn refused(folder: &Path) -> StoreError {
    Store::open(folder).await.unwrap_err()
}

async fn submit(store: &Arc<Store>, input: &str) -> Result<Job> {
    let accepted = store
        .submit(by("ada", vec![new(input)], None), false)
        .await?;
    Ok(accepted.jobs.into_iter().next().unwrap())
}

#[tokio::test]
async fn a_store_that_has_lost_transactions_is_refused_until_that_is_accepted() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let older = crashed(folder.path());
    submit(&store, "1").await.unwrap();
    let database = |folder: &Path| -> PathBuf { folder.join("signorini.db") };
    let log = |folder: &Path| -> PathBuf { folder.join("signorini.db-wal") };
    type Harm<'a> = (&'a str, &'a dyn Fn(&Path));
    let whole = crashed(folder.path());
    Store::open(whole.path()).await.unwrap();
    let harms: [Harm<'_>; 6] = [
        ("log removed", &|f| fs::remove_file(log(f)).unwrap()),
        ("log emptied", &|f| fs::write(log(f), b"").unwrap()),
        ("log zeroed", &|f| {
            let zeros = vec![0; fs::metadata(log(f)).unwrap().len() as usize];
            fs::write(log(f), zeros).unwrap();
        }),
        ("log cut", &|f| {
            let file = fs::OpenOptions::new().write(true).open(log(f)).unwrap();
            file.set_len(file.metadata().unwrap().len() - 5000).unwrap();
        }),
        ("database emptied", &|f| {
            fs::write(database(f), b"").unwrap()
        }),
        ("older", &|f| {
            fs::remove_file(log(f)).unwrap();
            fs::copy(database(older.path()), database(f)).unwrap();
            fs::copy(log(older.path()), log(f)).unwrap();
        }),
    ];
    for (harm, apply) in harms {
        let copy = crashed(folder.path());
        apply(copy.path());
        let error = refused(copy.path()).await;
        assert!(matches!(error, StoreError::Lost(_)), "{harm}: {error}");
        assert!(error.to_string().contains("doctor --accept"), "{error}");
        assert!(!error.to_string().contains('\n'), "{error}");
        refused(copy.path()).await; // also the second time
        accept(copy.path()).unwrap();
        let opened = Store::open(copy.path()).await;
        assert!(opened.is_ok(), "{harm}: {:?}", opened.err());
    }
    // a record that cannot be read tells nothing
    let copy = crashed(folder.path());
    fs::write(copy.path().join("signorini.progress"), b"\0\0").unwrap();
    Store::open(copy.path()).await.unwrap();
    // another store
    let other = tempfile::tempdir().unwrap();
    Store::open(other.path()).await.unwrap().close().await;
    fs::copy(
        folder.path().join("signorini.progress"),
        other.path().join("signorini.progress"),
    )
    .unwrap();
    assert!(
        refused(other.path())
            .await
            .to_string()
            .contains("another store")
    );
}

#[tokio::test]
async fn a_clean_end_needs_no_log() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    submit(&store, "1").await.unwrap();
    store.close().await;
    drop(store);
    let _ = fs::remove_file(folder.path().join("signorini.db-wal"));
    let store = Store::open(folder.path()).await.unwrap();
    assert_eq!(store.waiting(), 1);
}

#[tokio::test]
async fn a_folder_is_used_by_one_server_whatever_is_removed_from_it() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    for name in ["lock", "signorini.progress", "signorini.reserve"] {
        let _ = fs::remove_file(folder.path().join(name));
    }
    let error = refused(folder.path()).await;
    assert!(matches!(error, StoreError::Locked(_)), "{error}");
    store.close().await;
    drop(store);
    Store::open(folder.path()).await.unwrap();
}

#[tokio::test]
async fn the_files_are_for_their_owner_alone() {
    let parent = tempfile::tempdir().unwrap();
    let folder = parent.path().join("data");
    let mode = |path: &Path| fs::metadata(path).unwrap().mode() & 0o7777;
    let files = || {
        fs::read_dir(&folder)
            .unwrap()
            .map(|entry| entry.unwrap().path())
    };
    let all_closed = || {
        assert_eq!(mode(&folder), 0o700);
        for file in files() {
            assert_eq!(mode(&file), 0o600, "{}", file.display());
        }
    };
    let store = Store::open(&folder).await.unwrap();
    submit(&store, "1").await.unwrap();
    assert!(files().count() >= 4);
    all_closed();
    store.close().await;
    drop(store);
    for file in files() {
        fs::set_permissions(&file, fs::Permissions::from_mode(0o644)).unwrap();
    }
    fs::set_permissions(&folder, fs::Permissions::from_mode(0o755)).unwrap();
    let store = Store::open(&folder).await.unwrap();
    all_closed();
    store.close().await;
    drop(store);
    // a folder with other things in it is left as it is
    fs::write(folder.join("thesis.pdf"), b"").unwrap();
    fs::set_permissions(&folder, fs::Permissions::from_mode(0o755)).unwrap();
    Store::open(&folder).await.unwrap();
    assert_eq!(mode(&folder), 0o755);
}

#[tokio::test]
async fn tables_of_a_later_version_or_another_program_are_refused_untouched() {
    let statements = [
        "insert into _sqlx_migrations (version, description, success, checksum, execution_time)
         values (9999, 'later', true, x'00', 0)",
        "update _sqlx_migrations set checksum = x'00' where version = 3",
        "drop table _sqlx_migrations",
        "drop index job_queue",
    ];
    for statement in statements {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(folder.path()).await.unwrap();
        run(&store, statement).await;
        store.close().await;
        drop(store);
        let error = refused(folder.path()).await;
        assert!(
            matches!(error, StoreError::Schema(_)),
            "{statement}: {error}"
        );
    }
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("signorini.db"), "x".repeat(8192)).unwrap();
    let error = refused(folder.path()).await;
    assert!(matches!(error, StoreError::Lost(_)), "{error}");
}

#[tokio::test]
async fn nothing_is_accepted_once_the_files_are_gone() {
    type Harm = fn(&Path);
    let harms: [Harm; 4] = [
        |folder| fs::remove_file(folder.join("signorini.db")).unwrap(),
        |folder| fs::remove_file(folder.join("signorini.db-wal")).unwrap(),
        |folder| {
            let database = folder.join("signorini.db");
            fs::copy(&database, folder.join("copy")).unwrap();
            fs::rename(folder.join("copy"), database).unwrap();
        },
        |folder| fs::write(folder.join("signorini.db"), b"").unwrap(),
    ];
    for harm in harms {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(folder.path()).await.unwrap();
        submit(&store, "1").await.unwrap();
        assert!(store.health().await.is_ok());
        harm(folder.path());
        let error = submit(&store, "2").await.unwrap_err();
        assert!(matches!(error, StoreError::Replaced(_)), "{error}");
        let health = store.health().await;
        assert!(matches!(health, Err(StoreError::Replaced(_))), "{health:?}");
    }
}

#[tokio::test]
async fn on_a_full_disk_jobs_are_canceled_and_deleted_and_the_queue_paused() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    for input in ["1", "2", "3"] {
        submit(&store, input).await.unwrap();
    }
    let running = store.claim_next().await.unwrap().0.unwrap().job;
    assert!(store.reserve.release());
    assert!(matches!(submit(&store, "4").await, Err(StoreError::Full)));
    assert!(store.health().await.unwrap().full);
    assert!(matches!(
        store.request_cancel(2).await.unwrap(),
        CancelOutcome::Canceled(_)
    ));
    assert_eq!(
        store.delete(Owners::All, 2).await.unwrap(),
        Deletion::Deleted
    );
    store.set_paused(true).await.unwrap();
    assert!(matches!(
        store.request_cancel(running.key).await.unwrap(),
        CancelOutcome::Requested { .. }
    ));
    // there is space again within seconds
    for _ in 0..100 {
        tokio::time::sleep(std::time::Duration::from_millis(100)).await;
        if submit(&store, "4").await.is_ok() {
            return;
        }
    }
    panic!("no job is accepted again");
}

/// Control is tried once more with the space that was reserved for it.
#[tokio::test]
async fn a_full_disk_releases_the_reserve() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let tries = Arc::new(AtomicU32::new(0));
    let counted = tries.clone();
    let second_time = store.control(move |_| match counted.fetch_add(1, Relaxed) {
        0 => Err(StoreError::Full),
        _ => Ok(()),
    });
    second_time.await.unwrap();
    assert_eq!(tries.load(Relaxed), 2);
    let left = fs::metadata(folder.path().join("signorini.reserve")).unwrap();
    assert!(left.len() < 16 << 20, "{}", left.len());
}

#[tokio::test]
async fn a_canceled_job_does_not_succeed_even_if_the_cancel_could_not_be_stored() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    for (n, stored) in [(1, true), (2, false)] {
        submit(&store, &n.to_string()).await.unwrap();
        let job = store.claim_next().await.unwrap().0.unwrap().job;
        if stored {
            store.request_cancel(job.key).await.unwrap();
        } else {
            store.cancels.lock().insert(job.key);
        }
        let ending = Ending {
            status: Status::Succeeded,
            reason: None,
            failure: None,
            result: ResultAvailable::Final,
            overview: Default::default(),
        };
        let parts = Arc::new(Parts::new(vec![]));
        let last = FinalBatch::default();
        let finished = store
            .finish(job.key, job.attempt, &ending, last, Some(&parts))
            .await;
        finished.unwrap().unwrap();
        let ended = store.job(Owners::All, job.id).await.unwrap().unwrap();
        assert_eq!(
            (ended.status, ended.result_available),
            (Status::Canceled, ResultAvailable::Partial)
        );
    }
    assert!(store.cancels.lock().is_empty());
}

#[tokio::test]
async fn a_clock_that_was_set_back_keeps_the_order_of_jobs() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let hour = 3600.0;
    store.ahead.store(3_600_000_000, Relaxed);
    let first = submit(&store, "1").await.unwrap();
    assert!(Time::now().seconds_until(first.created_at) > hour - 10.0);
    store.close().await;
    drop(store);
    // the next server finds the clock an hour behind
    let store = Store::open(folder.path()).await.unwrap();
    let second = submit(&store, "2").await.unwrap();
    assert!(second.created_at >= first.created_at);
    let all = Filter::default();
    let jobs = store.jobs(Owners::All, &all, Order::NEWEST_FIRST, None, 10);
    let ids: Vec<_> = jobs.await.unwrap().iter().map(|job| job.id).collect();
    assert_eq!(ids, [second.id, first.id]);
    let claimed = store.claim_next().await.unwrap().0.unwrap().job;
    let ended = Ending::canceled();
    store
        .finish(claimed.key, 1, &ended, FinalBatch::default(), None)
        .await
        .unwrap()
        .unwrap();
    let ended = store.job(Owners::All, claimed.id).await.unwrap().unwrap();
    assert!(
        ended.run_s.unwrap() < 10.0 && ended.queue_wait_s.unwrap() < 10.0,
        "{ended:?}"
    );
    assert!(store.expire_queued(Time::now()).await.unwrap().is_empty());
}

#[tokio::test]
async fn a_clock_that_was_set_back_keeps_the_events_of_a_job_in_order() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let job = submit(&store, "1").await.unwrap();
    // it is started an hour later; the next server finds the clock set back by that hour
    let hour = 3_600_000_000;
    store.ahead.store(hour, Relaxed);
    store.claim_next().await.unwrap().0.unwrap();
    store.close().await;
    drop(store);
    let store = Store::open(folder.path()).await.unwrap();
    assert_eq!(store.requeue_interrupted().await.unwrap(), 1);
    let events = store.events_after(job.key, 0, 10).await.unwrap();
    assert_eq!(events.len(), 3);
    assert!(events.is_sorted_by_key(|event| event.t), "{events:?}");
}

#[tokio::test]
async fn a_canceled_job_is_not_requeued_even_if_the_cancel_could_not_be_stored() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    for (input, stops) in [("1", true), ("2", false)] {
        submit(&store, input).await.unwrap();
        let job = store.claim_next().await.unwrap().0.unwrap().job;
        store.cancels.lock().insert(job.key);
        if stops {
            store.requeue_drained(job.key, 1).await.unwrap();
        } else {
            store.requeue_lost(job.key, 1, "killed").await.unwrap();
        }
        let ended = store.job(Owners::All, job.id).await.unwrap().unwrap();
        assert_eq!(ended.status, Status::Canceled);
    }
    assert!(store.cancels.lock().is_empty());
}
