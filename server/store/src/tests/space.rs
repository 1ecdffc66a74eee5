//! What jobs and owners keep, what is removed, and the space that this gives back.

use base::{job::ResultAvailable, time::Time};
use files::columns::Law;
use solver::solution::Fields;

use super::{
    connections::{Mode, open},
    *,
};
use crate::parts::Part;

/// Solves a job of this owner; its result has fields that cannot be compressed.
async fn solved(store: &Arc<Store>, owner: &str, input: &str, bytes: usize) -> Job {
    solve(store, owner, new(input), bytes).await
}

/// The same with a job that may be answered by another.
async fn solve(store: &Arc<Store>, owner: &str, job: NewJob, bytes: usize) -> Job {
    let job = NewJob {
        cache: Cache::Use,
        ..job
    };
    store
        .submit(by(owner, vec![job], None), false)
        .await
        .unwrap();
    let Some(claim) = store.claim_next().await.unwrap().0 else {
        return jobs(store).await.remove(0); // answered at once
    };
    let ending = Ending {
        status: Status::Succeeded,
        reason: None,
        failure: None,
        result: ResultAvailable::Final,
        overview: Default::default(),
    };
    // no two jobs have the same
    let first = 1000 * claim.job.key as u64;
    let body = (first..).map(|n| (n.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 56) as u8);
    let parts = Arc::new(Parts::new(vec![
        Part::new("summary".into(), b"{}"),
        Part::plain(body.take(bytes).collect()),
    ]));
    assert!(
        store
            .write_before_end(claim.job.key, 1, &parts)
            .await
            .unwrap()
    );
    let last = FinalBatch::default();
    let finished = store.finish(claim.job.key, 1, &ending, last, Some(&parts));
    finished.await.unwrap().unwrap();
    store.job(Owners::All, claim.job.id).await.unwrap().unwrap()
}

/// A moment when nothing is young any more.
fn later() -> Time {
    Time::now().after_s(3600.0)
}

/// All jobs, newest first.
async fn jobs(store: &Arc<Store>) -> Vec<Job> {
    let (all, order) = (Filter::default(), Order::NEWEST_FIRST);
    store
        .jobs(Owners::All, &all, order, None, 100)
        .await
        .unwrap()
}

async fn left(store: &Arc<Store>) -> Vec<i64> {
    let mut keys: Vec<i64> = jobs(store).await.iter().map(|job| job.key).collect();
    keys.sort_unstable();
    keys
}

/// What is counted is what there is.
async fn are_right(store: &Arc<Store>) -> bool {
    let wrong = "select (select count(*) from job_kept left join job_size using (job_id)
                         where job_size.bytes is not job_kept.bytes)
                        + (select count(*) from job_size where job_id not in (select job_id from job_kept))";
    value::<i64>(store, wrong).await == 0
}

async fn pin(store: &Arc<Store>, key: i64) {
    let edit = Edit {
        pinned: Some(true),
        ..Edit::default()
    };
    let all = jobs(store).await;
    let job = all.iter().find(|job| job.key == key).unwrap();
    store
        .edit(Owners::All, job.id, move |_| Ok::<_, ()>(edit.clone()))
        .await
        .unwrap();
}

fn small_mesh() -> base::mesh::MeshInfo {
    serde_json::from_value(serde_json::json!({
        "hash": "sha256:mesh", "format": "gmsh", "bytes": 1, "nodes": 8, "quadrilaterals": 1, "triangles": 0,
        "dofs": 16, "extent": [[0, 1], [0, 1]], "boundaries": {}, "groups": {}, "node_sets": {}, "warnings": [],
        "quality": { "least_jacobian_ratio": 1, "worst_element": 0 }, "created_at": "2023-11-14T22:13:20Z"
    }))
    .unwrap()
}

#[tokio::test]
async fn what_jobs_and_meshes_take_is_counted_for_their_owners() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let job = solved(&store, "ada", "1", 10_000).await;
    let own = job.stored_bytes.unwrap();
    assert!((10_000..13_000).contains(&own), "{own}");
    let again = solved(&store, "bob", "1", 10_000).await;
    assert_eq!(again.cached_from, Some(job.id), "answered by the other");
    assert!(
        again.stored_bytes.unwrap() < 3000,
        "{:?}",
        again.stored_bytes
    );
    let mesh = small_mesh();
    store_mesh(&store, "bob", &mesh, &[1; 500]).await;
    let of = async |owner| store.size_of_owner(owner).await.unwrap();
    assert_eq!((of("ada").await.jobs, of("ada").await.bytes()), (1, own));
    assert_eq!(of("bob").await.mesh_bytes, 500);
    assert_eq!(of("eve").await.bytes(), 0);
    let all = store.sizes_of_owners(10).await.unwrap();
    assert_eq!(
        all.iter().map(|size| &*size.owner).collect::<Vec<_>>(),
        ["ada", "bob"]
    );
    store.remove_mesh(Owners::All, &mesh.hash).await.unwrap();
    store.delete(Owners::All, job.key).await.unwrap();
    assert_eq!((of("ada").await.jobs, of("ada").await.bytes()), (0, 0));
    assert_eq!(of("bob").await.mesh_bytes, 0);
}

/// Whoever deletes the job that was solved keeps nothing less as long as others have its result.
#[tokio::test]
async fn what_a_deleted_job_shared_with_others_is_counted_for_the_next_of_them() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let job = || NewJob {
        problem: format!("\"{}\"", "x".repeat(5000)),
        ..new("1")
    };
    for owner in ["ada", "bob", "eve"] {
        solve(&store, owner, job(), 10_000).await;
    }
    let bytes = async |owner| store.size_of_owner(owner).await.unwrap().bytes();
    let all = bytes("ada").await;
    assert!(all > 15_000 && bytes("bob").await < 3000);
    assert!(are_right(&store).await);
    store.delete(Owners::All, 2).await.unwrap();
    assert!(are_right(&store).await && bytes("eve").await < 3000);
    store.delete(Owners::All, 1).await.unwrap();
    assert!(are_right(&store).await && bytes("eve").await > 15_000);
    solve(&store, "bob", job(), 10_000).await;
    assert!(bytes("bob").await < 3000);
    store.delete(Owners::All, 3).await.unwrap();
    assert!(are_right(&store).await && bytes("bob").await > 15_000);
    store.delete_fields(Owners::All, 4).await.unwrap();
    assert!(are_right(&store).await && bytes("bob").await < 8000);
}

#[tokio::test]
async fn problems_that_wait_are_counted_once_for_each_input() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let job = |input: &str| NewJob {
        problem: input.repeat(1000),
        ..new(input)
    };
    let jobs = vec![job("1"), job("1"), job("2")];
    store.submit(by("ada", jobs, None), false).await.unwrap();
    let waiting = async |owner| store.waiting_bytes_of(owner).await.unwrap();
    assert_eq!((waiting("ada").await, waiting("bob").await), (2000, 0));
}

#[tokio::test]
async fn fields_are_deleted_by_themselves_and_with_the_last_job_that_has_them() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let first = solved(&store, "ada", "1", 10_000).await;
    let second = solved(&store, "bob", "1", 10_000).await;
    let fields = async |key| store.json_of(key, "fields").await.unwrap();
    let unknown = store
        .delete_fields(Owners::Only("eve".into()), first.key)
        .await
        .unwrap();
    assert_eq!(unknown, Deletion::Unknown);
    store
        .delete_fields(Owners::Only("ada".into()), first.key)
        .await
        .unwrap();
    assert!(store.lost_fields(first.key).await.unwrap());
    assert_eq!(fields(first.key).await, None);
    assert!(!store.lost_fields(second.key).await.unwrap() && fields(second.key).await.is_some());
    store.delete_fields(Owners::All, second.key).await.unwrap();
    assert_eq!(fields(second.key).await, None);
    assert!(store.json_of(first.key, "summary").await.unwrap().is_some());
    assert!(store.size_of_owner("ada").await.unwrap().bytes() < 3000);
    // what has lost its fields answers nobody
    let third = solved(&store, "ada", "1", 10_000).await;
    assert_eq!(third.cached_from, None);
    let ada = store.size_of_owner("ada").await.unwrap();
    store.close().await;
    drop(store);
    let saved = tempfile::tempdir().unwrap();
    let report = crate::inspect(folder.path(), Some(saved.path()));
    let report = report.await.unwrap();
    assert!(report.findings.is_empty(), "{report:?}");
    // nor does it in a store that was saved
    let store = Store::open(saved.path()).await.unwrap();
    for (key, lost) in [(1, true), (2, true), (3, false)] {
        assert_eq!(store.lost_fields(key).await.unwrap(), lost, "job {key}");
    }
    assert!(are_right(&store).await);
    assert_eq!(store.size_of_owner("ada").await.unwrap(), ada);
}

#[tokio::test]
async fn fields_are_deleted_with_the_last_job_that_has_them() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let first = solved(&store, "ada", "1", 10_000).await;
    let second = solved(&store, "bob", "1", 10_000).await;
    let stored = async || {
        let fields = "select count(*) from content where bytes = 10000";
        value::<i64>(&store, fields).await
    };
    store.delete_fields(Owners::All, first.key).await.unwrap();
    assert_eq!(stored().await, 1);
    assert!(store.json_of(first.key, "fields").await.unwrap().is_none());
    store.delete(Owners::All, second.key).await.unwrap();
    assert_eq!(stored().await, 0);
    assert!(store.json_of(first.key, "summary").await.unwrap().is_some());
    assert!(are_right(&store).await);
}

#[tokio::test]
async fn the_oldest_are_removed_when_they_are_old_or_too_many_and_pinned_ones_never() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    for (owner, input) in [
        ("ada", "1"),
        ("bob", "2"),
        ("ada", "3"),
        ("ada", "4"),
        ("bob", "5"),
    ] {
        solved(&store, owner, input, 10_000).await;
    }
    pin(&store, 1).await;
    let retire = async |retention: Retention, now| store.retire(&retention, now).await.unwrap();
    let nothing = Retired::default();
    let three = Retention {
        jobs: Some(3),
        ..Retention::default()
    };
    assert_eq!(store.foreseen(&three, later()).await.unwrap().0, 1);
    assert_eq!(retire(three, Time::now()).await, nothing, "all are young");
    let month = Retention {
        age_s: Some(30.0 * 86_400.0),
        ..Retention::default()
    };
    assert_eq!(retire(month, later()).await, nothing);
    let of_each = Retention {
        jobs_of_owner: Some(1),
        ..Retention::default()
    };
    assert_eq!(retire(of_each, later()).await.jobs, 2);
    assert_eq!(
        left(&store).await,
        [1, 4, 5],
        "but for the oldest that are not pinned"
    );
    let fields = Retention {
        fields_age_s: Some(60.0),
        ..Retention::default()
    };
    assert_eq!(
        retire(fields, later()).await,
        Retired { jobs: 0, fields: 2 }
    );
    assert!(!store.lost_fields(1).await.unwrap() && store.lost_fields(4).await.unwrap());
    let hour = Retention {
        age_s: Some(600.0),
        ..Retention::default()
    };
    assert_eq!(retire(hour, later()).await.jobs, 2);
    assert_eq!(left(&store).await, [1]);
    assert_eq!(store.size_of_owner("bob").await.unwrap().bytes(), 0);
}

#[tokio::test]
async fn pinned_jobs_do_not_count_and_one_owner_does_not_drive_out_the_others() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    for (owner, input) in [("ada", "1"), ("bob", "2"), ("bob", "3")] {
        solved(&store, owner, input, 10_000).await;
    }
    for input in 4..9 {
        solved(&store, "eve", &input.to_string(), 10_000).await;
    }
    for key in [2, 3] {
        pin(&store, key).await;
    }
    let retire = async |retention: Retention| store.retire(&retention, later()).await.unwrap();
    let bytes = Retention {
        bytes: Some(40_000),
        ..Retention::default()
    };
    assert_eq!(retire(bytes).await.jobs, 3);
    assert_eq!(left(&store).await, [1, 2, 3, 7, 8]);
    let jobs = Retention {
        jobs: Some(1),
        ..Retention::default()
    };
    assert_eq!(retire(jobs).await.jobs, 2);
    assert_eq!(left(&store).await, [1, 2, 3]);
}

#[tokio::test]
async fn nothing_is_removed_because_of_sums_that_a_disk_has_changed() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    for input in 0..3 {
        solved(&store, "ada", &input.to_string(), 100).await;
    }
    let most = Retention {
        bytes: Some(100_000),
        ..Retention::default()
    };
    let harm = "update owner_size set job_bytes = job_bytes + 1000000";
    run(&store, harm).await;
    let retired = store.retire(&most, later()).await;
    assert!(
        matches!(retired, Err(StoreError::Damaged(_))),
        "{retired:?}"
    );
    run(&store, harm.replace('+', "-")).await;
    // nor is a job that ended later than an index says
    let begin = Time::from_micros(1);
    let kept = store.try_to_discard(bulk::Discard::OldJobs(begin), &[1, 2]);
    let kept = kept.await.unwrap();
    assert_eq!((kept.done, kept.left), (0, vec![1, 2]));
    assert_eq!(left(&store).await, [1, 2, 3]);
}

#[tokio::test]
async fn a_damaged_job_stays_and_others_are_removed() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    for input in 0..4 {
        solved(&store, "ada", &input.to_string(), 100).await;
    }
    store.damage_job(2).await;
    let all = Retention {
        age_s: Some(1.0),
        ..Retention::default()
    };
    assert_eq!(store.retire(&all, later()).await.unwrap().jobs, 3);
    let again = store.retire(&all, later()).await.unwrap();
    assert_eq!(again, Retired::default());
    let everything = Filter::default();
    let left = store.count(Owners::All, &everything, None).await.unwrap();
    assert_eq!(left[0].1, 1);
}

#[tokio::test]
async fn a_request_key_is_forgotten_with_the_last_of_its_jobs() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    for (key, inputs) in [("a", vec!["1", "2"]), ("b", vec!["3"])] {
        let jobs = inputs.into_iter().map(new).collect();
        let submission = by("ada", jobs, Some(key));
        store.submit(submission, false).await.unwrap();
    }
    for job in jobs(&store).await {
        store.request_cancel(job.key).await.unwrap();
    }
    let known = async || {
        let keys = "select key from request_key order by key";
        values::<String>(&store, keys).await.concat()
    };
    store.delete(Owners::All, 1).await.unwrap();
    store.delete(Owners::All, 3).await.unwrap();
    store.forget_beyond(1).await.unwrap();
    assert_eq!(
        known().await,
        "ab",
        "one of its jobs is there, and one is remembered"
    );
    store.delete(Owners::All, 2).await.unwrap();
    store.forget_beyond(1).await.unwrap();
    assert_eq!(known().await, "a");
    store
        .forget_deleted(later().after_s(30.0 * 86_400.0))
        .await
        .unwrap();
    assert_eq!(known().await, "");
}

#[tokio::test]
async fn the_space_of_what_is_removed_is_given_back_to_the_file_system() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    for input in 0..8 {
        solved(&store, "ada", &input.to_string(), 2 << 20).await;
    }
    let before = store.space().await.unwrap();
    assert!(before.used > 16 << 20 && before.free > 0, "{before:?}");
    let all = Retention {
        age_s: Some(1.0),
        ..Retention::default()
    };
    assert_eq!(store.retire(&all, later()).await.unwrap().jobs, 8);
    assert!(store.give_space_back().await.unwrap() > 2000);
    let path = folder.path().join("signorini.db");
    let cut = std::fs::metadata(&path).unwrap().len();
    assert!(cut < 6 << 20, "{cut} bytes");
    store.identity.check().unwrap();
    solved(&store, "ada", "more", 10_000).await;
    // unless it becomes smaller than that has made it
    let file = std::fs::File::options().write(true).open(&path).unwrap();
    file.set_len(cut / 2).unwrap();
    assert!(store.identity.check().is_err());
}

#[tokio::test]
async fn on_a_full_disk_all_space_of_what_is_removed_is_given_back() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open_unwatched(folder.path()).await.unwrap();
    let job = solved(&store, "ada", "1", 3 << 20).await;
    let path = folder.path().join("signorini.db");
    let bytes = || std::fs::metadata(&path).unwrap().len();
    store.delete(Owners::All, job.key).await.unwrap();
    assert_eq!(
        store.give_space_back().await.unwrap(),
        0,
        "new jobs fill it soon"
    );
    assert!(store.reserve.release());
    // the log is emptied as well, as soon as nobody reads it
    let log = || {
        std::fs::metadata(path.with_extension("db-wal"))
            .unwrap()
            .len()
    };
    let reader = open(&path, Mode::Read).unwrap();
    let reading = reader.unchecked_transaction().unwrap();
    reading.values::<i64>("select id from job", ()).unwrap();
    assert!(store.give_space_back().await.unwrap() > 700);
    assert!(log() > 3 << 20, "{}", log());
    drop(reading);
    store.give_space_back().await.unwrap();
    assert_eq!(log(), 0);
    assert!(bytes() < 1 << 20, "{}", bytes());
    store.health().await.unwrap();
    assert!(store.reserve.retake());
    solved(&store, "ada", "2", 10_000).await;
}

#[tokio::test]
async fn a_log_that_a_reader_has_made_long_is_cut_when_the_reader_is_gone() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open_unwatched(folder.path()).await.unwrap();
    let log = folder.path().join("signorini.db-wal");
    let bytes = || std::fs::metadata(&log).unwrap().len();
    let reader = open(&folder.path().join("signorini.db"), Mode::Read).unwrap();
    let reading = reader.unchecked_transaction().unwrap();
    reading.values::<i64>("select id from job", ()).unwrap();
    solved(&store, "ada", "1", 20 << 20).await;
    store.give_space_back().await.unwrap();
    assert!(bytes() > 16 << 20, "{}", bytes());
    drop(reading);
    store.give_space_back().await.unwrap();
    assert!(bytes() <= crate::folder::LOG_BYTES, "{}", bytes());
}

#[tokio::test]
async fn a_store_that_died_while_it_became_smaller_goes_on() {
    let (folder, killed) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let store = Store::open_unwatched(folder.path()).await.unwrap();
    for input in 0..8 {
        solved(&store, "ada", &input.to_string(), 2 << 20).await;
    }
    run(&store, "pragma wal_checkpoint(truncate)").await;
    // the file stays as long as it is while this reads
    let reader = open(&folder.path().join("signorini.db"), Mode::Read).unwrap();
    let reading = reader.unchecked_transaction().unwrap();
    reading.values::<i64>("select id from job", ()).unwrap();
    for key in 1..=8 {
        store.delete(Owners::All, key).await.unwrap();
    }
    assert!(store.give_space_back().await.unwrap() > 2000);
    for name in ["signorini.db", "signorini.db-wal", "signorini.progress"] {
        std::fs::copy(folder.path().join(name), killed.path().join(name)).unwrap();
    }
    drop(reading);
    let path = killed.path().join("signorini.db");
    let bytes = || std::fs::metadata(&path).unwrap().len();
    assert!(bytes() > 16 << 20, "{}", bytes());
    let store = Store::open_unwatched(killed.path()).await.unwrap();
    store.health().await.unwrap();
    run(&store, "pragma wal_checkpoint(passive)").await;
    assert!(bytes() < 6 << 20, "{}", bytes());
    store.health().await.unwrap();
}

#[tokio::test]
async fn what_frees_space_works_on_a_full_disk() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open_unwatched(folder.path()).await.unwrap();
    let mesh = small_mesh();
    let contents = [vec![1; 500], vec![2; 500]].map(|body| (Fingerprint::of([&*body]), body));
    store_mesh(&store, "bob", &mesh, &contents[0].1).await;
    for (content, body) in &contents {
        let pieces = vec![body.clone()];
        store.write_pieces(content, 0, pieces).await.unwrap();
    }
    let expiring = NewJob {
        limits: Limits {
            queue_ttl_s: 1.0,
            ..Limits::default()
        },
        ..new("1")
    };
    let submitted = store.submit(by("bob", vec![expiring], None), false).await;
    submitted.unwrap();
    assert!(store.reserve.release());
    assert!(matches!(store.has_room(), Err(StoreError::Full)));
    for (content, _) in &contents {
        store.discard_content(&[content]).await.unwrap();
    }
    let body = store.mesh_body(&mesh.hash).await.unwrap().unwrap();
    assert_eq!(body, contents[0].1, "what has a mesh stays");
    let left = "select count(*) from content where bytes = 500";
    assert_eq!(value::<i64>(&store, left).await, 1);
    let removed = store.remove_mesh(Owners::All, &mesh.hash).await.unwrap();
    assert_eq!(removed, Removal::Removed);
    assert_eq!(store.expire_queued(later()).await.unwrap().len(), 1);
    store.forget_deleted(later()).await.unwrap();
}

#[tokio::test]
async fn the_ids_of_the_last_deleted_jobs_are_remembered() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let mut ids = vec![];
    for input in 0..5 {
        let job = solved(&store, "ada", &input.to_string(), 100).await;
        ids.push(job.id);
        store.delete(Owners::All, job.key).await.unwrap();
    }
    store.forget_beyond(3).await.unwrap();
    for (id, remembered) in ids.into_iter().zip([false, false, true, true, true]) {
        assert_eq!(
            store.was_deleted(Owners::All, id).await.unwrap(),
            remembered
        );
    }
}

#[tokio::test]
async fn a_store_is_rebuilt_without_unused_space_and_only_while_no_service_uses_it() {
    let folder = tempfile::tempdir().unwrap();
    assert!(
        compact_folder(folder.path()).await.is_err(),
        "there is none"
    );
    let store = Store::open(folder.path()).await.unwrap();
    for input in 0..4 {
        solved(&store, "ada", &input.to_string(), 2 << 20).await;
    }
    for key in 1..4 {
        store.delete(Owners::All, key).await.unwrap();
    }
    let used = compact_folder(folder.path()).await;
    assert!(matches!(used, Err(StoreError::Locked(_))), "{used:?}");
    store.close().await;
    drop(store);
    let (before, after) = compact_folder(folder.path()).await.unwrap();
    assert!(before > 8 << 20 && after < 3 << 20, "{before} and {after}");
    let store = Store::open(folder.path()).await.unwrap();
    assert_eq!(left(&store).await, [4]);
}

#[test]
fn fields_are_stored_as_columns_and_everything_else_deflated() {
    let mut fields = Fields::default();
    fields.gauss.order = 3;
    fields.x = vec![0.0; 1000];
    for column in [
        &mut fields.y,
        &mut fields.ux,
        &mut fields.uy,
        &mut fields.stress_xx,
        &mut fields.stress_yy,
        &mut fields.stress_xy,
        &mut fields.stress_zz,
    ] {
        *column = vec![1.5; 1000];
    }
    fields.contact_state = vec![-1; 1000];
    let part = Part::of_fields(&fields, &Law::default()).unwrap();
    assert!(part.body.len() < 500, "{}", part.body.len());
    let (info, content) = encoding::decoded(part.body, part.encoding, &part.info).unwrap();
    assert_eq!(info, part.info);
    assert!(matches!(content, encoding::Decoded::Fields(found) if *found == fields));
}

const DAY_S: f64 = 86_400.0;

fn a_month() -> Retention {
    Retention {
        age_s: Some(30.0 * DAY_S),
        ..Retention::default()
    }
}

/// A machine without a battery begins with an old time, and hears of the right one later.
#[tokio::test]
async fn what_ended_under_a_wrong_clock_is_kept_as_long_as_anything_else() {
    let folder = tempfile::tempdir().unwrap();
    let right = Time::now();
    right.after_s(-120.0 * DAY_S).simulate();
    let store = Store::open(folder.path()).await.unwrap();
    solved(&store, "ada", "1", 10).await;
    let deleted = solved(&store, "ada", "2", 10).await;
    store.delete(Owners::All, deleted.key).await.unwrap();
    let waits = || by("ada", vec![new("3")], Some("key"));
    store.submit(waits(), false).await.unwrap();
    store.close().await;
    drop(store);

    right.simulate();
    let store = Store::open(folder.path()).await.unwrap();
    let month = Retention {
        age_s: Some(90.0 * DAY_S),
        fields_age_s: Some(30.0 * DAY_S),
        ..Retention::default()
    };
    let retire = async |days| {
        let now = right.after_s(days * DAY_S);
        store.retire(&month, now).await.unwrap()
    };
    assert_eq!(retire(0.0).await, Retired::default());
    assert_eq!(store.expire_queued(right).await.unwrap(), [0; 0]);
    let again = store.submit(waits(), false).await.unwrap();
    assert!(again.replayed);
    let ttl_s = again.jobs[0].limits.queue_ttl_s;
    let later = right.after_s(ttl_s + 10.0);
    assert_eq!(store.expire_queued(later).await.unwrap().len(), 1);
    store
        .forget_deleted(right.after_s(6.9 * DAY_S))
        .await
        .unwrap();
    assert!(store.was_deleted(Owners::All, deleted.id).await.unwrap());
    store
        .forget_deleted(right.after_s(7.1 * DAY_S))
        .await
        .unwrap();
    assert!(!store.was_deleted(Owners::All, deleted.id).await.unwrap());
    assert_eq!(retire(89.0).await.jobs, 0);
    assert_eq!(retire(90.1).await.jobs, 2);
    // the jobs that are left are intact: a row that was changed has a new checksum
    store.close().await;
    let report = inspect(folder.path(), None).await.unwrap();
    assert!(report.findings.is_empty(), "{:?}", report.findings);
}

/// The clock is wrong now, and was right before.
#[tokio::test]
async fn a_start_with_a_clock_that_is_ahead_removes_nothing_and_leaves_no_trace() {
    let folder = tempfile::tempdir().unwrap();
    let right = Time::now();
    right.simulate();
    let store = Store::open(folder.path()).await.unwrap();
    solved(&store, "ada", "1", 10).await;
    store.close().await;
    drop(store);
    let month = a_month();
    let ahead = right.after_s(400.0 * DAY_S);
    ahead.simulate();
    let store = Store::open(folder.path()).await.unwrap();
    assert_eq!(store.retire(&month, ahead).await.unwrap().jobs, 0);
    store.close().await;
    drop(store);
    let soon = right.after_s(60.0);
    soon.simulate();
    let store = Store::open(folder.path()).await.unwrap();
    let before = soon.after_s(29.0 * DAY_S);
    assert_eq!(store.retire(&month, before).await.unwrap().jobs, 0);
    let after = soon.after_s(30.1 * DAY_S);
    assert_eq!(store.retire(&month, after).await.unwrap().jobs, 1);
}

#[tokio::test]
async fn nights_count_and_a_damaged_record_of_pauses_removes_nothing_early() {
    let folder = tempfile::tempdir().unwrap();
    let start = Time::now();
    start.simulate();
    let store = Store::open(folder.path()).await.unwrap();
    solved(&store, "ada", "1", 10).await;
    store.close().await;
    drop(store);
    let month = a_month();
    let night = start.after_s(0.5 * DAY_S);
    night.simulate();
    let store = Store::open(folder.path()).await.unwrap();
    let now = start.after_s(30.1 * DAY_S);
    let harm = "update setting set value = replace(value, ']]', '9]]') where name = 'pauses'";
    run(&store, harm).await;
    let early = start.after_s(29.9 * DAY_S);
    assert_eq!(store.retire(&month, early).await.unwrap().jobs, 0);
    store.close().await;
    drop(store);
    let store = Store::open(folder.path()).await.unwrap();
    assert_eq!(
        store.retire(&month, now).await.unwrap().jobs,
        0,
        "nothing is known of the time before"
    );
    let later = night.after_s(30.1 * DAY_S);
    assert_eq!(store.retire(&month, later).await.unwrap().jobs, 1);
}

/// Nothing that a disk changes sets the clock: jobs would be removed as too old.
#[tokio::test]
async fn a_changed_time_in_a_row_or_an_index_removes_nothing() {
    let far = 1_i64 << 61;
    let harms = [
        format!("update job set finished_at = {far} where id = 1"),
        format!("update job set created_at = {far} where id = 1"),
        format!("update event set t = {far} where job_id = 3"),
        format!("update job set finished_at = {far}, checksum = null where id = 1"),
    ];
    for harm in harms {
        let folder = tempfile::tempdir().unwrap();
        let right = Time::now();
        right.simulate();
        let store = Store::open(folder.path()).await.unwrap();
        solved(&store, "ada", "1", 10).await;
        solved(&store, "ada", "2", 10).await;
        let waits = by("ada", vec![new("3")], None);
        store.submit(waits, false).await.unwrap();
        run(&store, harm.as_str()).await;
        store.close().await;
        drop(store);
        let store = Store::open(folder.path()).await.unwrap();
        let month = a_month();
        let retired = store.retire(&month, right).await.unwrap();
        assert_eq!(retired.jobs, 0, "{harm}");
        assert!(store.now().seconds_until(right) > -1.0, "{harm}");
        assert!(
            store.expire_queued(right).await.unwrap().is_empty(),
            "{harm}"
        );
    }
}
