//! Whose turn it is, and the positions and counts that follow.

use super::*;

/// A job of its own input with this priority.
fn job(priority: i32, number: usize) -> NewJob {
    NewJob {
        priority,
        ..new(&format!("{priority} {number}"))
    }
}

async fn submit(store: &Arc<Store>, owner: &str, jobs: Vec<NewJob>) -> Vec<i64> {
    let accepted = store.submit(by(owner, jobs, None), false).await.unwrap();
    accepted.jobs.iter().map(|job| job.key).collect()
}

/// The keys of all jobs that wait, by their positions.
async fn positions(store: &Arc<Store>) -> Vec<i64> {
    let all = Filter::default();
    let jobs = store.jobs(Owners::All, &all, Order::NEWEST_FIRST, None, 10_000);
    let mut places: Vec<(i64, i64)> = (jobs.await.unwrap().iter())
        .filter_map(|job| Some((job.queue.as_ref()?.ahead, job.key)))
        .collect();
    places.sort_unstable();
    assert!(
        places
            .iter()
            .map(|(ahead, _)| *ahead)
            .eq(0..places.len() as i64)
    );
    places.into_iter().map(|(_, key)| key).collect()
}

async fn claim(store: &Arc<Store>) -> Option<i64> {
    let claim = store.claim_next().await.unwrap().0?;
    Some(claim.job.key)
}

/// Starts all jobs; their order.
async fn started(store: &Arc<Store>) -> Vec<i64> {
    let mut order = vec![];
    while let Some(key) = claim(store).await {
        order.push(key);
    }
    order
}

async fn are_right(store: &Arc<Store>) -> bool {
    let right = store.read(|_, connection| turns::are_right(connection));
    right.await.unwrap()
}

#[tokio::test]
async fn owners_take_turns_and_positions_say_so() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let ada = submit(&store, "ada", (0..6).map(|n| job(0, n)).collect()).await;
    let bob = submit(&store, "bob", (6..8).map(|n| job(0, n)).collect()).await;
    let eve = submit(&store, "eve", vec![job(0, 8)]).await;
    let first = submit(&store, "ada", vec![job(1, 9)]).await;
    let last = submit(&store, "eve", vec![job(-10, 10)]).await;
    // the high priority first; then each in turn, the oldest job of each
    assert_eq!(claim(&store).await, Some(first[0]));
    let expected = [
        bob[0], eve[0], ada[0], bob[1], ada[1], ada[2], ada[3], ada[4], ada[5], last[0],
    ];
    assert_eq!(positions(&store).await, expected);
    assert_eq!(claim(&store).await, Some(expected[0]));
    // turns go on where they were
    store.close().await;
    drop(store);
    let store = Store::open(folder.path()).await.unwrap();
    assert_eq!(positions(&store).await, expected[1..]);
    assert_eq!(started(&store).await, expected[1..]);
    assert!(are_right(&store).await);
}

#[tokio::test]
async fn owners_with_as_many_running_as_they_may_are_passed_over() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    store.set_most_running_of_owner(1);
    let ada = submit(&store, "ada", vec![job(3, 0), job(3, 1)]).await;
    let bob = submit(&store, "bob", vec![job(0, 2)]).await;
    assert_eq!(started(&store).await, [ada[0], bob[0]]);
    let load = store.load_of("ada").await.unwrap();
    assert_eq!((load.queued, load.running), (1, 1));
    let loads = store.loads().await.unwrap();
    assert_eq!((loads.len(), loads["bob"].running), (2, 1));
    let waits = positions(&store).await;
    assert_eq!(waits, [ada[1]]);
}

/// The middle of a long queue, in any order of asking.
#[tokio::test]
async fn positions_in_a_long_queue() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let keys = submit(&store, "ada", (0..500).map(|n| job(0, n)).collect()).await;
    assert_eq!(positions(&store).await, keys);
    let asked: Vec<usize> = vec![250, 0, 499, 3, 250, 251, 100];
    let mine = keys.clone();
    let found = store.read(move |_, connection| {
        let mut line = turns::Line::read(connection)?;
        let mut found = vec![];
        for place in asked {
            let job = rows::find(connection, mine[place])?.unwrap();
            found.push((line.ahead(&job)?, Some(place as i64)));
        }
        Ok(found)
    });
    for (ahead, place) in found.await.unwrap() {
        assert_eq!(ahead, place);
    }
}

/// What a disk or another program has changed in the counts is mended at the next start.
#[tokio::test]
async fn wrong_counts_are_mended_at_a_start() {
    for harm in [
        "update waiting set jobs = 7",
        "delete from waiting",
        "update owner_queue set jobs = jobs + 1, running = 3",
        "delete from owner_queue",
        "update queue set jobs = 0",
    ] {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(folder.path()).await.unwrap();
        let mut jobs = vec![job(0, 0), job(2, 1), job(0, 0)];
        jobs.iter_mut().for_each(|job| job.cache = Cache::Use);
        let keys = submit(&store, "ada", jobs).await;
        run(&store, harm).await;
        assert!(!are_right(&store).await, "{harm}");
        store.close().await;
        drop(store);
        let store = Store::open(folder.path()).await.unwrap();
        assert!(are_right(&store).await, "{harm}");
        assert_eq!(store.waiting(), 3, "{harm}");
        assert_eq!(started(&store).await, [keys[1], keys[0]], "{harm}");
        let load = store.load_of("ada").await.unwrap();
        assert_eq!((load.queued, load.running), (1, 2), "{harm}");
    }
}
