//! Two owners: each sees only their own jobs, and a caller who sees every owner's jobs sees both.

use base::job::{Job, JobId};

use super::*;

fn only(owner: &str) -> Owners {
    Owners::Only(owner.into())
}

struct Two {
    _folder: tempfile::TempDir,
    store: Arc<Store>,
    ada: Job,
    bob: Job,
}

/// A job of each, equal in all but the owner: submitted under the same key, with the same name and label.
async fn two_owners() -> Two {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let submit = async |owner| {
        let job = NewJob {
            id: Some(JobId::new()),
            name: Some("beam".into()),
            labels: [("part".to_string(), "rail".to_string())].into(),
            ..new("1")
        };
        let submission = by(owner, vec![job], Some("key"));
        let accepted = store.submit(submission, false).await.unwrap();
        assert!(
            !accepted.replayed,
            "the key of another owner is a different key"
        );
        accepted.jobs.into_iter().next().unwrap()
    };
    let (ada, bob) = (submit("ada").await, submit("bob").await);
    assert_eq!((ada.owner.as_str(), bob.owner.as_str()), ("ada", "bob"));
    Two {
        _folder: folder,
        store,
        ada,
        bob,
    }
}

/// Runs all waiting jobs, which succeed.
async fn run_all(store: &Arc<Store>) {
    let ending = Ending {
        status: Status::Succeeded,
        reason: None,
        failure: None,
        result: base::job::ResultAvailable::Final,
        overview: Default::default(),
    };
    while let Some(Claim { job, .. }) = store.claim_next().await.unwrap().0 {
        let (last, parts) = (FinalBatch::default(), Arc::new(Parts::of_a_summary()));
        let finished = store.finish(job.key, job.attempt, &ending, last, Some(&parts));
        finished.await.unwrap().unwrap();
    }
}

#[tokio::test]
async fn a_job_is_found_by_its_owner_and_by_a_caller_who_sees_all() {
    let Two {
        _folder,
        store,
        ada,
        bob,
    } = two_owners().await;
    for (owners, sees_ada, sees_bob) in [
        (only("ada"), true, false),
        (only("bob"), false, true),
        (Owners::All, true, true),
    ] {
        for (job, sees) in [(&ada, sees_ada), (&bob, sees_bob)] {
            let found = store.job(owners.clone(), job.id).await.unwrap();
            assert_eq!(
                found.map(|job| job.id),
                sees.then_some(job.id),
                "{owners:?}"
            );
            let found = store.snapshot(owners.clone(), job.id).await.unwrap();
            assert_eq!(found.is_some(), sees, "{owners:?}");
        }
    }
}

#[tokio::test]
async fn lists_counts_and_keys_contain_only_the_visible_jobs() {
    let Two {
        _folder,
        store,
        ada,
        bob,
    } = two_owners().await;
    run_all(&store).await;
    let all = Filter::default();
    let filters = [
        all.clone(),
        Filter {
            statuses: vec![Status::Succeeded],
            ..all.clone()
        },
        Filter {
            statuses: vec![Status::Queued, Status::Succeeded],
            ..all.clone()
        },
        Filter {
            labels: vec![("part".into(), "rail".into())],
            ..all.clone()
        },
        Filter {
            name: Some("beam".into()),
            ..all.clone()
        },
        Filter {
            input_hash: Some(ada.input_hash.clone()),
            ..all.clone()
        },
        Filter {
            finished_after: Some(ada.created_at),
            ..all.clone()
        },
    ];
    for (owners, expected) in [
        (only("ada"), vec![ada.key]),
        (only("bob"), vec![bob.key]),
        (Owners::All, vec![ada.key, bob.key]),
    ] {
        for filter in &filters {
            for by in [OrderBy::CreatedAt, OrderBy::FinishedAt] {
                let order = Order {
                    by,
                    descending: false,
                };
                let listed = store
                    .jobs(owners.clone(), filter, order, None, 10)
                    .await
                    .unwrap();
                let listed: Vec<i64> = listed.iter().map(|job| job.key).collect();
                assert_eq!(listed, expected, "{owners:?} {filter:?} {order:?}");
            }
            let found = store
                .keys(owners.clone(), filter, None, bob.key, 10)
                .await
                .unwrap();
            assert_eq!(
                (found.keys, found.next),
                (expected.clone(), None),
                "{owners:?} {filter:?}"
            );
            let counted = store.count(owners.clone(), filter, None).await.unwrap();
            assert_eq!(
                counted[0].1 as usize,
                expected.len(),
                "{owners:?} {filter:?}"
            );
        }
    }
    let counted = store
        .count(only("ada"), &all, Some(GroupBy::Owner))
        .await
        .unwrap();
    assert_eq!(counted, [("ada".to_string(), 1)]);
    // a filter for another owner's jobs finds none
    let bobs = Filter {
        owner: Some("bob".into()),
        ..all
    };
    assert!(
        store
            .jobs(only("ada"), &bobs, Order::NEWEST_FIRST, None, 10)
            .await
            .unwrap()
            .is_empty()
    );
    assert!(
        store
            .count(only("ada"), &bobs, None)
            .await
            .unwrap()
            .is_empty()
    );
    assert!(
        store
            .keys(only("ada"), &bobs, None, bob.key, 10)
            .await
            .unwrap()
            .keys
            .is_empty()
    );
    assert_eq!(
        store
            .keys(only("bob"), &bobs, None, bob.key, 10)
            .await
            .unwrap()
            .keys,
        [bob.key]
    );
}

#[tokio::test]
async fn a_request_key_belongs_to_the_owner_who_used_it() {
    let Two {
        _folder,
        store,
        ada,
        bob,
    } = two_owners().await;
    let key = by("", vec![], Some("key")).key.unwrap();
    for (owner, job) in [("ada", &ada), ("bob", &bob)] {
        let replayed = store.replay(owner, &key).await.unwrap().unwrap();
        assert_eq!(replayed[0].id, job.id);
        let again = by(owner, vec![new("1")], Some("key"));
        let again = store.submit(again, false).await.unwrap();
        assert!(again.replayed && again.jobs[0].id == job.id);
    }
    assert!(store.replay("eve", &key).await.unwrap().is_none());
}

#[tokio::test]
async fn an_id_of_another_owner_is_refused_without_revealing_the_job() {
    let Two {
        _folder,
        store,
        ada,
        ..
    } = two_owners().await;
    let job = |id| NewJob {
        id: Some(id),
        ..new("1")
    };
    let submit = async |owner| {
        store
            .submit(by(owner, vec![job(ada.id)], None), false)
            .await
    };
    assert!(submit("ada").await.unwrap().replayed);
    let replayed = async |owner| {
        store
            .replay_with_id(owner, ada.id, "payload")
            .await
            .unwrap()
    };
    assert_eq!(replayed("ada").await.unwrap().id, ada.id);
    assert!(replayed("bob").await.is_none());
    // the same answer whether that job exists or was deleted
    let refused = submit("bob").await;
    assert!(
        matches!(refused, Err(StoreError::IdConflict(id)) if id == ada.id),
        "{refused:?}"
    );
    run_all(&store).await;
    store.delete(only("ada"), ada.key).await.unwrap();
    let refused = submit("bob").await;
    assert!(
        matches!(refused, Err(StoreError::IdConflict(id)) if id == ada.id),
        "{refused:?}"
    );
    let gone = submit("ada").await;
    assert!(
        matches!(gone, Err(StoreError::Deleted(id)) if id == ada.id),
        "{gone:?}"
    );
}

#[tokio::test]
async fn a_job_of_another_owner_cannot_be_changed_or_deleted() {
    let Two {
        _folder,
        store,
        ada,
        bob,
    } = two_owners().await;
    let edit = |_: &Job| {
        let pinned = Some(true);
        Ok::<_, ()>(Edit {
            pinned,
            ..Edit::default()
        })
    };
    assert!(
        store
            .edit(only("bob"), ada.id, edit)
            .await
            .unwrap()
            .is_none()
    );
    let edited = store.edit(only("ada"), ada.id, edit).await.unwrap();
    let edited = edited.unwrap().unwrap();
    assert!(
        edited.pinned && edited.version == ada.version + 1,
        "by its owner, and once"
    );
    assert!(
        store
            .edit(Owners::All, bob.id, edit)
            .await
            .unwrap()
            .is_some()
    );
    run_all(&store).await;
    assert_eq!(
        store.delete(only("bob"), ada.key).await.unwrap(),
        Deletion::Unknown
    );
    assert_eq!(
        store.delete(only("ada"), ada.key).await.unwrap(),
        Deletion::Deleted
    );
    assert_eq!(
        store.delete(Owners::All, bob.key).await.unwrap(),
        Deletion::Deleted
    );
    for (owners, knows) in [
        (only("ada"), true),
        (only("bob"), false),
        (Owners::All, true),
    ] {
        assert_eq!(
            store.was_deleted(owners.clone(), ada.id).await.unwrap(),
            knows,
            "{owners:?}"
        );
    }
}

/// Results are found by their input alone: whether owners share them is a policy that does not exist yet.
#[tokio::test]
async fn a_result_answers_jobs_of_the_same_input_of_any_owner() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let submit = async |owner| {
        let job = NewJob {
            cache: Cache::Use,
            ..new("1")
        };
        let accepted = store.submit(by(owner, vec![job], None), false).await;
        accepted.unwrap().jobs.into_iter().next().unwrap()
    };
    let (ada, bob) = (submit("ada").await, submit("bob").await);
    // it waits for its own owner's turn, and is answered then
    assert_eq!(bob.coalesced_into, None);
    assert_eq!(submit("ada").await.coalesced_into, Some(ada.key));
    run_all(&store).await;
    let later = submit("eve").await;
    assert!(later.cached_from.is_some());
    let bob = store.job(only("bob"), bob.id).await.unwrap().unwrap();
    assert_eq!(
        (bob.status, bob.cached_from.is_some()),
        (Status::Succeeded, true)
    );
    assert!(store.job(only("bob"), ada.id).await.unwrap().is_none());
}
