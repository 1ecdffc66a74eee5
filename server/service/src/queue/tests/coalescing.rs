//! Tests of jobs with the same input: answered with earlier results, and coalesced.

use super::*;

#[tokio::test]
async fn an_earlier_result_answers_at_once_and_outlives_its_job() {
    let rig = rig(fake::solve).await;
    rig.queue.start();
    let primary = rig.submit_as(same()).await;
    rig.until_done(&primary).await;
    let cached = rig.submit_as(same()).await;
    assert_eq!(
        (cached.status, cached.cached_from, cached.attempt),
        (Status::Succeeded, Some(primary.id), 1)
    );
    let events = rig.store.events_after(cached.key, 0, 100).await.unwrap();
    let kinds: Vec<_> = events.iter().map(|event| &event.kind[..]).collect();
    assert_eq!(kinds, ["status", "status", "done"]);
    let part = |key| rig.store.json_of(key, "fields");
    let bytes = part(primary.key).await.unwrap().unwrap();
    assert_eq!(cached.cached_from, Some(primary.id));
    rig.store.delete(Owners::All, primary.key).await.unwrap();
    assert_eq!(part(cached.key).await.unwrap(), Some(bytes));
    // and goes with the last job that was answered with it
    rig.store.delete(Owners::All, cached.key).await.unwrap();
    assert_eq!(part(cached.key).await.unwrap(), None);
    let fresh = rig.submit_as(same()).await;
    assert_eq!(fresh.cached_from, None);
}

#[tokio::test]
async fn a_job_without_the_cache_is_solved_again_and_its_result_is_not_reused() {
    let rig = rig(fake::solve).await;
    rig.queue.start();
    let off = rig.submit().await;
    rig.until_done(&off).await;
    let used = rig.submit_as(same()).await;
    assert_eq!(used.cached_from, None, "an answer that was to stay private");
    rig.until_done(&used).await;
    let anew = NewJob {
        cache: Cache::Refresh,
        ..new(0)
    };
    let anew = rig.submit_as(anew).await;
    assert_eq!(anew.cached_from, None);
    rig.until_done(&anew).await;
    let later = rig.submit_as(same()).await;
    assert_eq!(later.cached_from, Some(anew.id));
}

#[tokio::test]
async fn a_coalesced_job_ends_as_its_primary_ends() {
    let rig = rig(fake::solve).await; // its workers start later
    let primary = rig.submit_as(same()).await;
    let coalesced = rig.submit_as(same()).await;
    let place = coalesced.queue.clone().unwrap();
    assert_eq!((place.position, place.reason), (1, Waiting::Coalesced));
    assert_eq!(
        rig.store.waiting(),
        2,
        "one for a worker, one for its primary"
    );
    rig.queue.start();
    let done = rig.until_done(&coalesced).await;
    assert_eq!(
        (done.status, done.cached_from, done.attempt),
        (Status::Succeeded, Some(primary.id), 1)
    );
    let coalesced = rig
        .store
        .job(Owners::All, coalesced.id)
        .await
        .unwrap()
        .unwrap();
    assert_eq!(coalesced.cached_from, Some(primary.id));
}

#[tokio::test]
async fn canceling_a_job_leaves_those_it_was_coalesced_with() {
    let rig = rig(fake::solve_until_stopped).await;
    rig.queue.start();
    let primary = rig.submit_as(same()).await;
    let first = rig.submit_as(same()).await;
    let second = rig.submit_as(same()).await;
    // a coalesced job alone
    rig.queue.cancel(first.key).await.unwrap();
    assert_eq!(rig.until_done(&first).await.status, Status::Canceled);
    let primary_now = rig
        .store
        .job(Owners::All, primary.id)
        .await
        .unwrap()
        .unwrap();
    assert_eq!(primary_now.status, Status::Running);
    // the primary: the other coalesced job takes its place
    rig.queue.cancel(primary.key).await.unwrap();
    assert_eq!(rig.until_done(&primary).await.status, Status::Canceled);
    rig.until(&second, |event| event.seq == 2).await;
    let second_now = rig
        .store
        .job(Owners::All, second.id)
        .await
        .unwrap()
        .unwrap();
    assert_eq!(
        (
            second_now.status,
            second_now.cached_from,
            second_now.coalesced_into
        ),
        (Status::Running, None, None)
    );
}

#[tokio::test]
async fn coalesced_jobs_count_as_waiting_and_one_of_higher_priority_is_detached() {
    let rig = rig(fake::solve).await; // its workers start later
    let primary = rig.submit_as(same()).await;
    let coalesced = rig.submit_as(same()).await;
    let other = rig.submit_as(same()).await;
    assert_eq!(rig.store.waiting(), 3);
    let full = Submission {
        limits: QueueLimits {
            queued: 3,
            queued_of_owner: None,
        },
        ..submission(vec![same()], None)
    };
    let refused = rig.queue.submit(full).await.unwrap_err();
    assert!(matches!(refused, StoreError::QueueFull), "{refused}");
    let coalesced = rig.set_priority(&coalesced, 5).await;
    let place = coalesced.queue.unwrap();
    assert_eq!(
        (place.position, place.reason),
        (1, Waiting::WorkersBusy),
        "before its primary"
    );
    assert_eq!(rig.store.waiting(), 3);
    rig.queue.start();
    // the primary is answered with its result when its turn comes, and the other job by the primary
    for job in [&primary, &other] {
        assert_eq!(rig.until_done(job).await.status, Status::Succeeded);
    }
    let primary = rig
        .store
        .job(Owners::All, primary.id)
        .await
        .unwrap()
        .unwrap();
    assert!(primary.cached_from.is_some());
    assert_eq!(rig.store.waiting(), 0);
}

/// A waiting job that is answered in the commit of another submission is reported as changed to its watchers.
#[tokio::test]
async fn a_job_answered_in_the_commit_of_another_submission_is_reported_as_changed() {
    let rig = rig(fake::solve).await; // its workers never start: jobs are claimed here
    let waiting = rig.submit_as(same()).await;
    let anew = NewJob {
        cache: Cache::Refresh,
        ..new(5)
    };
    let primary = rig.submit_as(anew).await;
    let claim = rig.store.claim_next().await.unwrap().0.unwrap();
    assert_eq!(claim.job.id, primary.id);
    let solved = Ending {
        status: Status::Succeeded,
        reason: None,
        failure: None,
        result: ResultAvailable::Final,
        overview: Default::default(),
    };
    let parts = Arc::new(Parts::of_a_summary());
    let finished = rig
        .store
        .finish(primary.key, 1, &solved, FinalBatch::default(), Some(&parts));
    finished.await.unwrap().unwrap();
    let submission = submission(vec![new(0)], None);
    let accepted = rig.store.submit(submission, true).await.unwrap();
    assert!(accepted.changed.contains(&waiting.key), "{accepted:?}");
    let answered = rig
        .store
        .job(Owners::All, waiting.id)
        .await
        .unwrap()
        .unwrap();
    assert_eq!(
        (answered.status, answered.cached_from),
        (Status::Succeeded, Some(primary.id))
    );
    let claimed = accepted.claim.unwrap().job;
    assert_eq!(claimed.id, accepted.jobs[0].id);
}

#[tokio::test]
async fn a_primary_whose_priority_is_lowered_is_replaced_by_the_first_coalesced_job() {
    let rig = rig(fake::solve).await; // its workers start later
    let primary = rig.submit_as(same()).await;
    let coalesced = rig.submit_as(same()).await;
    let other = rig.submit_as(same()).await;
    let primary = rig.set_priority(&primary, -1).await;
    assert_eq!(primary.queue.unwrap().position, 2);
    let found = async |job: &Job| rig.store.job(Owners::All, job.id).await.unwrap().unwrap();
    assert_eq!(found(&coalesced).await.queue.unwrap().position, 1);
    assert_eq!(found(&other).await.coalesced_into, Some(coalesced.key));
    assert_eq!(rig.store.waiting(), 3);
    rig.queue.start();
    for job in [&coalesced, &other] {
        assert_eq!(rig.until_done(job).await.status, Status::Succeeded);
    }
    assert_eq!(found(&other).await.cached_from, Some(coalesced.id));
}

#[tokio::test]
async fn a_job_that_kills_the_process_does_so_three_times_and_not_again_for_a_coalesced_one() {
    let rig = rig(fake::solve).await; // its workers never start: jobs are claimed, and lost, here
    let deadly = rig.submit_as(same()).await;
    let coalesced = rig.submit_as(same()).await;
    for _ in 1..=3 {
        let claim = rig.store.claim_next().await.unwrap().0.unwrap();
        assert_eq!(claim.job.key, deadly.key);
        rig.store.requeue_interrupted().await.unwrap();
    }
    for job in [&deadly, &coalesced] {
        let job = rig.store.job(Owners::All, job.id).await.unwrap().unwrap();
        assert_eq!(
            (job.status, job.reason),
            (Status::Failed, Some(Reason::WorkerLost))
        );
    }
    assert!(rig.store.claim_next().await.unwrap().0.is_none());
}

#[tokio::test]
async fn a_requeued_primary_is_replaced_by_a_coalesced_job_of_higher_priority() {
    let rig = rig(fake::solve).await; // its workers never start: jobs are claimed, and lost, here
    let at = |priority| NewJob { priority, ..same() };
    let primary = rig.submit_as(at(-5)).await;
    rig.store.claim_next().await.unwrap().0.unwrap();
    let coalesced = rig.submit_as(at(5)).await;
    assert_eq!(coalesced.coalesced_into, Some(primary.key));
    let between = rig.submit().await;
    rig.store.requeue_interrupted().await.unwrap();
    let place = async |job: &Job| {
        let job = rig.store.job(Owners::All, job.id).await.unwrap().unwrap();
        job.queue.unwrap().position
    };
    assert_eq!((place(&coalesced).await, place(&between).await), (1, 2));
}

#[tokio::test]
async fn a_job_whose_turn_it_is_is_coalesced_into_one_that_runs_on_the_same_input() {
    let rig = rig(fake::solve).await; // its workers never start: jobs are claimed here
    let first = rig.submit_as(same()).await;
    let coalesced = rig.submit_as(same()).await;
    let before = rig
        .submit_as(NewJob {
            priority: 5,
            ..same()
        })
        .await;
    assert_eq!(
        before.coalesced_into, None,
        "it is not delayed by one behind it"
    );
    let claim = rig.store.claim_next().await.unwrap().0.unwrap();
    assert_eq!(claim.job.key, before.key);
    assert!(rig.store.claim_next().await.unwrap().0.is_none());
    for job in [&first, &coalesced] {
        let job = rig.store.job(Owners::All, job.id).await.unwrap().unwrap();
        assert_eq!(job.coalesced_into, Some(before.key));
    }
    assert_eq!(rig.store.waiting(), 2);
    let ending = Ending {
        status: Status::Succeeded,
        reason: None,
        failure: None,
        result: ResultAvailable::Final,
        overview: Default::default(),
    };
    let last = FinalBatch::default();
    rig.store
        .finish(before.key, 1, &ending, last, None)
        .await
        .unwrap();
    let first = rig.store.job(Owners::All, first.id).await.unwrap().unwrap();
    assert_eq!(first.cached_from, Some(before.id));
    assert_eq!(rig.store.waiting(), 0);
}
