//! Tests with two callers of one service: each finds only their own jobs, with every verb.
#![allow(clippy::unwrap_used)]

use std::{path::Path, sync::Arc};

use base::{
    caller::{Caller, Scope},
    job::{Cache, Job, JobId, Limits, Status},
    sweep::Sweep,
};
use futures_util::StreamExt;
use store::{Edit, Filter, GroupBy, Store};

use super::{
    admission::time_violation,
    bulk,
    envelope::{Envelope, JobRequest},
    fields, history, jobs,
    key::IDEMPOTENCY_KEY,
    lists,
    page::Paging,
    plots::{self, Figure},
    profiles::{self, Points},
    results, retry,
    service::Service,
    submit,
    sweeps::{self, SweepRequest},
    watch::{self, Until},
};
use crate::{
    config::{
        Config, Isolation, MemoryBudget, Placement, ProxyTrust, RetentionLimits, StoreFolder,
        Telemetry, Tls, WEEK_S, Web,
    },
    error::ApiError,
    formats::Format,
    queue::{Queue, Solver},
};

/// A service whose queue has not been started.
pub(super) async fn service(folder: &Path) -> Arc<Service> {
    let config = Config {
        listen: ([127, 0, 0, 1], 0).into(),
        store: StoreFolder {
            data: folder.to_path_buf(),
        },
        tls: Tls::default(),
        web: Web::default(),
        trust: ProxyTrust::default(),
        allow_unauthenticated: false,
        workers: 1,
        lease_s: 30,
        isolation: Isolation::Thread,
        max_queued: 10,
        max_queued_per_owner: 10,
        max_running_per_owner: None,
        max_timeout_s: WEEK_S,
        max_bytes_per_owner: None,
        max_submissions_per_owner_per_minute: None,
        retention: RetentionLimits::default(),
        memory: MemoryBudget::default(),
        body_cache_bytes: None,
        max_body_bytes: 1 << 20,
        max_mesh_bytes: 1 << 20,
        max_connections: 100,
        max_received_bytes: 64 << 20,
        max_sent_bytes: 128 << 20,
        grace_s: 1,
        placement: Placement::default(),
        telemetry: Telemetry::default(),
    };
    let store = Store::open(folder).await.unwrap();
    let queue = Queue::new(store.clone(), Solver::Threads(fake::solve), 1);
    Arc::new(Service::new(config, store, queue))
}

/// A caller who may do everything with their own jobs.
pub(super) fn caller(owner: &str) -> Caller {
    Caller::new(owner, [Scope::Read, Scope::Submit, Scope::Cancel])
}

fn request() -> JobRequest {
    let envelope = Envelope {
        cache: Cache::Off,
        ..Envelope::default()
    };
    JobRequest {
        envelope,
        problem: Ok(fake::problem()),
    }
}

async fn create(service: &Arc<Service>, caller: &Caller, id: Option<JobId>) -> Job {
    let submitted = submit::create(service, caller, Box::new(|| Ok(request())), id, None).await;
    submitted.unwrap().accepted
}

/// A job that waits, since the queue was not started.
pub(super) async fn waiting(service: &Arc<Service>, caller: &Caller) -> JobId {
    create(service, caller, None).await.id
}

/// Starts the queue, which solves a job.
pub(super) async fn solved(service: &Arc<Service>, caller: &Caller) -> JobId {
    service.queue.start();
    let id = create(service, caller, None).await.id;
    let ended = watch::wait(service, caller, id, Until::Terminal, 60.0).await;
    assert_eq!(ended.unwrap().0.status, Status::Succeeded);
    id
}

/// Asserts that the answer is *not found*.
fn unknown<T>(verb: &str, answer: Result<T, ApiError>) {
    assert!(matches!(answer, Err(ApiError::NotFound(_))), "{verb}");
}

#[tokio::test]
async fn a_job_of_another_is_not_found_by_any_verb() {
    let folder = tempfile::tempdir().unwrap();
    let service = &service(folder.path()).await;
    let (ada, bob) = (&caller("ada"), &caller("bob"));
    let id = solved(service, ada).await;

    unknown("get", jobs::get(service, bob, id).await);
    unknown("problem", jobs::problem(service, bob, id).await);
    let wait = watch::wait(service, bob, id, Until::Terminal, 0.0);
    unknown("wait", wait.await);
    unknown("watch", watch::watch(service, bob, id, 0).await);
    unknown("result", results::result(service, bob, id).await);
    unknown(
        "history",
        history::history(service, bob, id, None, true).await,
    );
    let profile = profiles::profile(service, bob, id, "top", None, Points::Nodes, true);
    unknown("profile", profile.await);
    unknown("fields", fields::fields(service, bob, id, true).await);
    let npz = fields::converted_fields(service, bob, id, Format::Npz, true);
    unknown("fields", npz.await);
    let figure = Figure {
        plot: files::plot::Plot::Mesh,
        format: Format::Svg,
        style: Default::default(),
        step: None,
        partial: true,
    };
    unknown("plot", plots::plot(service, bob, id, figure).await);
    let edit = Edit {
        pinned: Some(true),
        ..Edit::default()
    };
    unknown(
        "update",
        jobs::update(service, bob, id, edit, jobs::LabelChanges::new(), None).await,
    );
    unknown("cancel", jobs::cancel(service, bob, id).await);
    let again = retry::retry(service, bob, id, Default::default(), None);
    unknown("retry", again.await);
    unknown("delete", jobs::delete(service, bob, id).await);

    // and its owner still finds it unchanged
    let job = jobs::get(service, ada, id).await.unwrap();
    assert_eq!((job.owner.as_str(), job.pinned), ("ada", false));
    let events = watch::watch(service, ada, id, 0).await.unwrap().unwrap();
    assert!(events.count().await > 2);
    assert!(results::result(service, ada, id).await.is_ok());
    jobs::delete(service, ada, id).await.unwrap();
    let gone = jobs::get(service, ada, id).await;
    assert!(matches!(gone, Err(ApiError::Deleted(_))));
    unknown("a deleted one", jobs::get(service, bob, id).await);
}

#[tokio::test]
async fn bulk_operations_apply_to_the_jobs_that_the_caller_sees() {
    let folder = tempfile::tempdir().unwrap();
    let service = &service(folder.path()).await;
    let (ada, bob, admin) = (&caller("ada"), &caller("bob"), &Caller::local());
    for caller in [ada, ada, bob] {
        create(service, caller, None).await;
    }
    let all = &Filter::default();
    for (caller, own) in [(ada, 2), (bob, 1), (admin, 3)] {
        let page = lists::list(service, caller, all, None, &Paging::default()).await;
        assert_eq!(page.unwrap().items.len(), own);
        let count = lists::count(service, caller, all, Some(GroupBy::Owner)).await;
        assert_eq!(count.unwrap().total, own as i64);
    }
    let of_ada = Filter {
        owner: Some("ada".into()),
        ..Filter::default()
    };
    let page = lists::list(service, bob, &of_ada, None, &Paging::default()).await;
    assert_eq!(page.unwrap().items.len(), 0);
    let queued = Filter {
        statuses: vec![Status::Queued],
        ..Filter::default()
    };
    let canceled = bulk::cancel_many(service, bob, of_ada.clone()).await;
    assert_eq!(canceled.unwrap().matched, 0);
    let canceled = bulk::cancel_many(service, bob, queued.clone()).await;
    assert_eq!(canceled.unwrap().changed, 1);
    let canceled = bulk::cancel_many(service, admin, queued).await;
    assert_eq!(canceled.unwrap().changed, 2);
    let deleted = bulk::delete_many(service, bob, of_ada.clone()).await;
    assert_eq!(deleted.unwrap().matched, 0);
    let deleted = bulk::delete_many(service, ada, of_ada).await;
    assert_eq!(deleted.unwrap().changed, 2);
    let left = lists::count(service, admin, all, None).await.unwrap();
    assert_eq!(left.total, 1);
}

#[tokio::test]
async fn keys_and_ids_belong_to_the_owner_who_used_them() {
    let folder = tempfile::tempdir().unwrap();
    let service = &service(folder.path()).await;
    let (ada, bob) = (&caller("ada"), &caller("bob"));
    let key = || Some(IDEMPOTENCY_KEY.read("k").unwrap());
    let mut ids = vec![];
    for caller in [ada, bob, ada] {
        let submitted =
            submit::create(service, caller, Box::new(|| Ok(request())), None, key()).await;
        ids.push(submitted.unwrap().accepted.id);
    }
    assert_eq!(ids[0], ids[2]);
    assert_ne!(ids[0], ids[1]);

    let id = JobId::new();
    create(service, ada, Some(id)).await;
    assert_eq!(create(service, ada, Some(id)).await.id, id);
    let theirs = submit::create(service, bob, Box::new(|| Ok(request())), Some(id), None).await;
    assert!(matches!(theirs, Err(ApiError::IdConflict(_))));
}

async fn create_sweep(service: &Arc<Service>, caller: &Caller, key: Option<&str>) -> Sweep {
    let base = serde_json::to_string(&fake::problem()).unwrap();
    let axes = r#"[{"path": "/contacts/0/indentation", "values": [0.1, 0.2]}]"#;
    let variation = files::sweep::Variation {
        axes: serde_json::from_str(axes).unwrap(),
        ..Default::default()
    };
    let request = SweepRequest {
        envelope: Envelope::default(),
        limits: None,
        definition: files::sweep::read(&base, variation),
    };
    let key = key.map(|key| IDEMPOTENCY_KEY.read(key).unwrap());
    let created = sweeps::create(service, caller, request, key).await;
    created.unwrap().accepted
}

#[tokio::test]
async fn a_sweep_of_another_owner_does_not_exist() {
    let folder = tempfile::tempdir().unwrap();
    let service = service(folder.path()).await;
    let (ada, bob) = (caller("ada"), caller("bob"));
    let sweep = create_sweep(&service, &ada, Some("k")).await;
    let id = sweep.id;
    assert_eq!((sweep.status, sweep.members.queued), (Status::Queued, 2));
    let (service, bob) = (&service, &bob);
    unknown("get", sweeps::get(service, bob, id).await);
    unknown("wait", sweeps::wait(service, bob, id, 0.1).await);
    unknown(
        "rows",
        sweeps::rows(service, bob, id, &Paging::default()).await,
    );
    let csv = crate::formats::Format::Csv;
    unknown("table", sweeps::table(service, bob, id, csv).await);
    unknown(
        "watch",
        sweeps::watch(service, bob, id, 0).await.map(|_| ()),
    );
    unknown("cancel", sweeps::cancel(service, bob, id).await);
    unknown("delete", sweeps::delete(service, bob, id).await);
    unknown(
        "solve_member",
        sweeps::solve_member(service, bob, id, 0, None)
            .await
            .map(|_| ()),
    );
    let list = sweeps::list(service, bob, &Paging::default())
        .await
        .unwrap();
    assert!(list.items.is_empty());
    // a key belongs to an owner
    let theirs = create_sweep(service, bob, Some("k")).await;
    assert_ne!(theirs.id, id);
    assert_eq!(create_sweep(service, &ada, Some("k")).await.id, id);
    // its own owner may cancel and delete it, also while nothing runs
    let canceled = sweeps::cancel(service, &ada, id).await.unwrap();
    assert_eq!(
        (canceled.status, canceled.members.canceled),
        (Status::Canceled, 2)
    );
    sweeps::delete(service, &ada, id).await.unwrap();
    assert!(matches!(
        sweeps::get(service, &ada, id).await,
        Err(ApiError::SweepDeleted(_))
    ));
    unknown("get", sweeps::get(service, bob, id).await);
}

/// The limit that a refusal asks for has enough digits, and is enough.
#[test]
fn a_refused_time_limit_is_told_which_one_suffices() {
    for (run_s, timeout_s, least, run) in [
        (4.0, 0.3, "0.40", "4.0"),
        (3.641, 0.3, "0.37", "3.7"),
        (0.3641, 0.02, "0.037", "0.37"),
        (12_345.6, 600.0, "1235", "12346"),
    ] {
        let limits = |timeout_s| Limits {
            timeout_s,
            ..Limits::default()
        };
        let violation = time_violation(Some(run_s), &limits(timeout_s)).unwrap();
        let expected = format!("at least {least} s: the job is estimated to take {run} s");
        assert_eq!(violation.expected, expected);
        assert!(time_violation(Some(run_s), &limits(least.parse().unwrap())).is_none());
    }
}

/// A sweep may be watched from any event on, since clients choose the number.
#[tokio::test]
async fn a_sweep_may_be_watched_from_any_event_on() {
    let folder = tempfile::tempdir().unwrap();
    let service = service(folder.path()).await;
    let ada = caller("ada");
    let id = create_sweep(&service, &ada, None).await.id;
    sweeps::cancel(&service, &ada, id).await.unwrap();
    assert!(
        sweeps::watch(&service, &ada, id, i64::MAX)
            .await
            .unwrap()
            .is_none()
    );
    let events = sweeps::watch(&service, &ada, id, 0).await.unwrap().unwrap();
    let events: Vec<_> = events.collect().await;
    let done = events[0].as_ref().unwrap();
    assert_eq!((events.len(), done.seq), (1, 1));
}
