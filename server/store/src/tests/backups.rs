//! Backups, and who may use a store that was saved.

use std::{fs, path::PathBuf};

use base::{
    caller::Scope,
    time::Time,
    token::{SecretHash, Token},
};

use super::*;

/// Two stores' worth of folders.
fn folders() -> (tempfile::TempDir, PathBuf, PathBuf, PathBuf) {
    let top = tempfile::tempdir().unwrap();
    let [data, backup, new] = ["data", "backup", "new"].map(|name| top.path().join(name));
    (top, data, backup, new)
}

async fn submit(store: &Arc<Store>, input: &str) -> Job {
    let accepted = store.submit(by("ada", vec![new(input)], None), false).await;
    accepted.unwrap().jobs.remove(0)
}

async fn with_token(store: &Arc<Store>, id: &str) {
    let token = Token {
        id: id.into(),
        name: "laptop".into(),
        owner: "ada".into(),
        scopes: [Scope::Read].into(),
        created_at: Time::now(),
        expires_at: None,
        revoked_at: None,
    };
    store
        .insert_token(&token, SecretHash([7; 32]))
        .await
        .unwrap();
}

#[tokio::test]
async fn a_backup_of_an_open_store_has_what_was_stored_before() {
    let (_top, data, backup, new) = folders();
    let store = Store::open(&data).await.unwrap();
    let first = submit(&store, "1").await;
    store.claim_next().await.unwrap().0.unwrap();
    let made = back_up(&data, &backup, true).await.unwrap();
    assert_eq!(
        (made.manifest.jobs, made.manifest.unfinished, made.findings),
        (1, 1, vec![])
    );
    submit(&store, "2").await;
    let again = back_up(&data, &backup, true).await;
    assert!(matches!(again, Err(StoreError::Folder(_))), "{again:?}");
    let in_use = restore(&backup, &data, true).await;
    assert!(matches!(in_use, Err(StoreError::Locked(_))), "{in_use:?}");
    restore(&backup, &new, false).await.unwrap();
    let restored = Store::open(&new).await.unwrap();
    // what ran then is run again, and has not lost its worker by that
    assert!(restored.was_stopped);
    assert_eq!(restored.requeue_interrupted().await.unwrap(), 1);
    let everything = Filter::default();
    let jobs = restored.jobs(Owners::All, &everything, Order::NEWEST_FIRST, None, 10);
    let jobs: Vec<_> = jobs.await.unwrap().iter().map(|job| job.id).collect();
    assert_eq!(jobs, [first.id]);
}

#[tokio::test]
async fn a_backup_of_a_damaged_store_is_made_and_tells_of_it() {
    let (_top, data, backup, _) = folders();
    let store = Store::open(&data).await.unwrap();
    submit(&store, "1").await;
    submit(&store, "2").await;
    store.damage_job(1).await;
    let made = back_up(&data, &backup, true).await.unwrap();
    assert_eq!(made.manifest.damaged, Some(1), "{:?}", made.findings);
    let unchecked = back_up(&data, &backup.with_extension("2"), false).await;
    assert_eq!(unchecked.unwrap().manifest.damaged, None);
}

#[tokio::test]
async fn a_restore_that_was_interrupted_is_not_opened_but_done_again() {
    let (_top, data, backup, new) = folders();
    Store::open(&data).await.unwrap().close().await;
    back_up(&data, &backup, true).await.unwrap();
    fs::create_dir(&new).unwrap();
    fs::write(new.join("signorini.db.restoring"), "half").unwrap();
    let opened = Store::open(&new).await;
    assert!(matches!(opened, Err(StoreError::Folder(_))), "{opened:?}");
    restore(&backup, &new, false).await.unwrap();
    Store::open(&new).await.unwrap();
}

#[tokio::test]
async fn a_store_is_put_aside_as_a_whole_also_if_that_is_interrupted() {
    let (_top, data, backup, _) = folders();
    Store::open(&data).await.unwrap().close().await;
    back_up(&data, &backup, true).await.unwrap();
    // killed when the database was moved, and nothing else
    let partial = data.join("replaced-1.partial");
    fs::create_dir(&partial).unwrap();
    fs::rename(data.join("signorini.db"), partial.join("signorini.db")).unwrap();
    fs::write(data.join("signorini.db.restoring"), "").unwrap();
    fs::write(data.join("signorini.db-wal"), "its log").unwrap();
    let restored = restore(&backup, &data, true).await.unwrap();
    let aside = data.join("replaced-1");
    assert_eq!(restored.replaced.as_deref(), Some(&*aside));
    assert!(aside.join("signorini.db").exists() && !partial.exists());
    assert_eq!(
        fs::read(aside.join("signorini.db-wal")).unwrap(),
        b"its log"
    );
    Store::open(&data).await.unwrap().close().await;
    // the next one gets a folder of its own
    let again = restore(&backup, &data, true)
        .await
        .unwrap()
        .replaced
        .unwrap();
    assert!(again != aside && again.join("signorini.db").exists());
}

#[tokio::test]
async fn nobody_gets_into_a_saved_store_because_tokens_are_damaged() {
    let harms: [(&str, Option<&'static str>, usize); 4] = [
        ("nothing", None, 2),
        // one of them, which identifies nobody
        (
            "a token",
            Some("update token set scopes = '[\"admin\"]' where id = '000000000001'"),
            1,
        ),
        ("token", None, 0),
        ("setting", None, 2),
    ];
    for (what, statement, left) in harms {
        let (_top, data, _, new) = folders();
        let store = Store::open(&data).await.unwrap();
        submit(&store, "1").await;
        with_token(&store, "000000000001").await;
        with_token(&store, "000000000002").await;
        if let Some(statement) = statement {
            run(&store, statement).await;
        }
        store.close().await;
        drop(store);
        if ["token", "setting"].contains(&what) {
            Store::erase_table(&data, what).await;
        }
        let report = inspect(&data, Some(&new)).await.unwrap();
        assert_eq!(
            report.findings.is_empty(),
            what == "nothing",
            "{what}: {report:?}"
        );
        assert_eq!((report.jobs, report.intact), (1, 1), "{what}: {report:?}");
        let saved = Store::open(&new).await.unwrap();
        assert!(saved.has_tokens(), "{what}");
        assert_eq!(saved.tokens().len(), left, "{what}");
    }
}

#[tokio::test]
async fn a_saved_store_without_tokens_needs_none_unless_that_is_unknown() {
    for (what, closed) in [("nothing", false), ("token", true), ("setting", true)] {
        let (_top, data, _, new) = folders();
        let store = Store::open(&data).await.unwrap();
        submit(&store, "1").await;
        store.close().await;
        drop(store);
        if what != "nothing" {
            Store::erase_table(&data, what).await;
        }
        inspect(&data, Some(&new)).await.unwrap();
        let saved = Store::open(&new).await.unwrap();
        assert_eq!(saved.has_tokens(), closed, "{what}");
    }
}
