//! Tests of waiting jobs: their order, the pause of the queue, and how long they may wait.

use super::*;

#[tokio::test]
async fn the_queue_is_ordered_by_priority_then_by_arrival() {
    let rig = rig(fake::solve).await;
    let mut jobs = vec![];
    for priority in [0, 5, 0, -1] {
        jobs.push(rig.submit_as(new(priority)).await);
    }
    let places: Vec<i64> = jobs
        .iter()
        .map(|job| job.queue.as_ref().unwrap().position)
        .collect();
    assert_eq!(places, [1, 1, 3, 4], "as they were when each arrived");
    let mut claimed = vec![];
    while let Some(claim) = rig.store.claim_next().await.unwrap().0 {
        claimed.push(claim.job.id);
    }
    assert_eq!(claimed, [jobs[1].id, jobs[0].id, jobs[2].id, jobs[3].id]);
}

#[tokio::test]
async fn a_second_server_on_the_same_folder_is_refused() {
    let rig = rig(fake::solve).await;
    let refused = Store::open(rig.folder.path()).await.unwrap_err();
    assert!(refused.to_string().contains("another server"), "{refused}");
}

#[tokio::test]
async fn a_job_that_waits_too_long_fails_with_a_reason_of_its_own() {
    let rig = rig(fake::solve_until_stopped).await;
    rig.queue.start();
    let busy = rig.submit().await;
    let mut short = new(0);
    short.limits.queue_ttl_s = 0.1;
    let job = rig.submit_as(short).await;
    let done = rig.until_done(&job).await;
    assert_eq!(
        (done.status, done.reason, done.attempt),
        (Status::Failed, Some(Reason::QueueExpired), 0)
    );
    assert_eq!(rig.store.waiting(), 0);
    let busy = rig.store.job(Owners::All, busy.id).await.unwrap().unwrap();
    assert_eq!(busy.status, Status::Running);
}

#[tokio::test]
async fn a_paused_queue_starts_nothing_until_it_is_resumed_even_across_a_restart() {
    let rig = rig(fake::solve).await;
    rig.queue.start();
    rig.queue.pause().await.unwrap();
    let job = rig.submit().await;
    assert_eq!(job.status, Status::Queued);
    assert_eq!(job.queue.as_ref().unwrap().reason, Waiting::Paused);
    rig.store.close().await;
    let Rig {
        store,
        queue,
        folder,
    } = rig;
    queue.drain().await;
    drop((store, queue));
    // the task that commits submissions drops the store when it next looks
    let store = loop {
        match Store::open(folder.path()).await {
            Ok(store) => break store,
            Err(_) => tokio::time::sleep(Duration::from_millis(10)).await,
        }
    };
    let queue = Queue::new(store.clone(), Solver::Threads(fake::solve), 1);
    queue.start();
    assert!(queue.state().paused);
    let rig = Rig {
        store,
        queue,
        folder,
    };
    tokio::time::sleep(Duration::from_millis(100)).await;
    let waiting = rig.store.job(Owners::All, job.id).await.unwrap().unwrap();
    assert_eq!(waiting.status, Status::Queued);
    rig.queue.resume().await.unwrap();
    assert_eq!(rig.until_done(&job).await.status, Status::Succeeded);
}

#[tokio::test]
async fn positions_are_those_in_which_jobs_start() {
    let rig = rig(fake::solve).await;
    let all = Filter::default();
    for priority in [0, 3, 0, -2, 3] {
        rig.submit_as(new(priority)).await;
    }
    let moved = rig
        .store
        .some_jobs(Owners::All, &all, Order::NEWEST_FIRST, None, 10);
    let moved = moved.await.unwrap().items;
    let edit = Edit {
        priority: Some(9),
        ..Edit::default()
    };
    rig.store
        .edit(Owners::All, moved[1].id, move |_| Ok::<_, ()>(edit.clone()))
        .await
        .unwrap();
    rig.queue.cancel(moved[2].key).await.unwrap();
    let jobs = rig
        .store
        .some_jobs(Owners::All, &all, Order::NEWEST_FIRST, None, 10);
    let mut places: Vec<(i64, JobId)> = (jobs.await.unwrap().items.into_iter())
        .filter_map(|job| Some((job.queue?.position, job.id)))
        .collect();
    places.sort_by_key(|(position, _)| *position);
    let mut claimed = vec![];
    while let Some(claim) = rig.store.claim_next().await.unwrap().0 {
        claimed.push((claimed.len() as i64 + 1, claim.job.id));
    }
    assert_eq!(places, claimed);
    assert_eq!(claimed[0].1, moved[1].id);
    assert_eq!(rig.store.waiting(), 0);
}

#[tokio::test]
async fn a_job_and_one_coalesced_into_it_may_expire_at_the_same_moment() {
    let rig = rig(fake::solve).await; // its workers never start
    let short = || {
        let mut job = same();
        job.limits.queue_ttl_s = 0.05;
        job
    };
    let jobs = [rig.submit_as(short()).await, rig.submit_as(short()).await];
    assert!(jobs[1].coalesced_into.is_some());
    tokio::time::sleep(Duration::from_millis(100)).await;
    rig.store.expire_queued(Time::now()).await.unwrap();
    for job in &jobs {
        let job = rig.store.job(Owners::All, job.id).await.unwrap().unwrap();
        assert_eq!(job.reason, Some(Reason::QueueExpired));
    }
    assert_eq!(rig.store.waiting(), 0);
    let next = rig.submit().await;
    assert_eq!(next.queue.unwrap().position, 1);
}
