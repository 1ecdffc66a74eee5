//! Jobs of one input: earlier results, and twins.

use super::*;

#[tokio::test]
async fn an_earlier_result_answers_at_once_and_survives_its_source() {
    let rig = rig(fake::solve).await;
    rig.queue.start();
    let source = rig.submit_as(same()).await;
    rig.until_done(&source).await;
    let cached = rig.submit_as(same()).await;
    assert_eq!(
        (cached.status, cached.cached_from, cached.attempt),
        (Status::Succeeded, Some(source.id), 1)
    );
    let events = rig.store.events_after(cached.key, 0, 100).await.unwrap();
    let kinds: Vec<_> = events.iter().map(|event| event.payload.kind()).collect();
    assert_eq!(kinds, ["status", "status", "done"]);
    let part = |key| rig.store.piece(key, "fields", 0);
    let bytes = part(source.key).await.unwrap().unwrap();
    assert_eq!(cached.result_key, source.key);
    rig.store.delete(Owners::All, source.key).await.unwrap();
    assert_eq!(part(cached.result_key).await.unwrap(), Some(bytes));
    // and goes with the last that serves it
    rig.store.delete(Owners::All, cached.key).await.unwrap();
    assert_eq!(part(cached.result_key).await.unwrap(), None);
    let fresh = rig.submit_as(same()).await;
    assert_eq!(fresh.cached_from, None);
}

#[tokio::test]
async fn who_wants_no_earlier_result_gets_none_and_may_keep_his_own() {
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
async fn a_twin_ends_as_its_source_ends() {
    let rig = rig(fake::solve).await; // its workers start later
    let source = rig.submit_as(same()).await;
    let twin = rig.submit_as(same()).await;
    let place = twin.queue.clone().unwrap();
    assert_eq!((place.position, place.reason), (1, Waiting::Joined));
    assert_eq!(rig.store.waiting(), 2, "one in line, one for its end");
    rig.queue.start();
    let done = rig.until_done(&twin).await;
    assert_eq!(
        (done.status, done.cached_from, done.attempt),
        (Status::Succeeded, Some(source.id), 1)
    );
    let twin = rig.store.job(Owners::All, twin.id).await.unwrap().unwrap();
    assert_eq!(twin.result_key, source.key);
}

#[tokio::test]
async fn canceling_one_of_two_twins_leaves_the_other() {
    let rig = rig(fake::solve_until_stopped).await;
    rig.queue.start();
    let source = rig.submit_as(same()).await;
    let first = rig.submit_as(same()).await;
    let second = rig.submit_as(same()).await;
    // the twin alone
    rig.queue.cancel(first.key).await.unwrap();
    assert_eq!(rig.until_done(&first).await.status, Status::Canceled);
    let source_now = rig
        .store
        .job(Owners::All, source.id)
        .await
        .unwrap()
        .unwrap();
    assert_eq!(source_now.status, Status::Running);
    // the source: the other twin takes its place
    rig.queue.cancel(source.key).await.unwrap();
    assert_eq!(rig.until_done(&source).await.status, Status::Canceled);
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
            second_now.twin_of
        ),
        (Status::Running, None, None)
    );
}

#[tokio::test]
async fn twins_count_as_waiting_and_one_that_is_to_go_first_goes_alone() {
    let rig = rig(fake::solve).await; // its workers start later
    let source = rig.submit_as(same()).await;
    let twin = rig.submit_as(same()).await;
    let other = rig.submit_as(same()).await;
    assert_eq!(rig.store.waiting(), 3);
    let full = Submission {
        max_queued: 3,
        ..submission(vec![same()], None)
    };
    let refused = rig.queue.submit(full).await.unwrap_err();
    assert!(matches!(refused, StoreError::QueueFull), "{refused}");
    let twin = rig.put_at(&twin, 5).await;
    let place = twin.queue.unwrap();
    assert_eq!(
        (place.position, place.reason),
        (1, Waiting::WorkersBusy),
        "before its source"
    );
    assert_eq!(rig.store.waiting(), 3);
    rig.queue.start();
    // the source is answered by it when its turn comes, and the other twin by the source
    for job in [&source, &other] {
        assert_eq!(rig.until_done(job).await.status, Status::Succeeded);
    }
    let source = rig
        .store
        .job(Owners::All, source.id)
        .await
        .unwrap()
        .unwrap();
    assert!(source.cached_from.is_some());
    assert_eq!(rig.store.waiting(), 0);
}

/// A job that waits, with somebody who watches it, is answered in the commit of another one's submit.
#[tokio::test]
async fn who_is_answered_beside_a_submit_is_told_of_it() {
    let rig = rig(fake::solve).await; // its workers never start: we claim in their place
    let waiting = rig.submit_as(same()).await;
    let anew = NewJob {
        cache: Cache::Refresh,
        ..new(5)
    };
    let source = rig.submit_as(anew).await;
    let claim = rig.store.claim_next().await.unwrap().0.unwrap();
    assert_eq!(claim.job.id, source.id);
    let solved = Ending {
        status: Status::Succeeded,
        reason: None,
        failure: None,
        result: ResultAvailable::Final,
    };
    let finished = rig
        .store
        .finish(source.key, 1, &solved, LastWords::default(), None);
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
        (Status::Succeeded, Some(source.id))
    );
    let claimed = accepted.claim.unwrap().job;
    assert_eq!(claimed.id, accepted.jobs[0].id);
}

#[tokio::test]
async fn a_source_that_is_to_go_later_leaves_its_place_to_its_first_twin() {
    let rig = rig(fake::solve).await; // its workers start later
    let source = rig.submit_as(same()).await;
    let twin = rig.submit_as(same()).await;
    let other = rig.submit_as(same()).await;
    let source = rig.put_at(&source, -1).await;
    assert_eq!(source.queue.unwrap().position, 2);
    let found = async |job: &Job| rig.store.job(Owners::All, job.id).await.unwrap().unwrap();
    assert_eq!(found(&twin).await.queue.unwrap().position, 1);
    assert_eq!(found(&other).await.twin_of, Some(twin.key));
    assert_eq!(rig.store.waiting(), 3);
    rig.queue.start();
    for job in [&twin, &other] {
        assert_eq!(rig.until_done(job).await.status, Status::Succeeded);
    }
    assert_eq!(found(&other).await.cached_from, Some(twin.id));
}

#[tokio::test]
async fn a_poison_job_takes_the_process_down_three_times_and_not_once_more_for_a_twin() {
    let rig = rig(fake::solve).await; // its workers never start: we claim, and die, in their place
    let poison = rig.submit_as(same()).await;
    let twin = rig.submit_as(same()).await;
    for _ in 1..=3 {
        let claim = rig.store.claim_next().await.unwrap().0.unwrap();
        assert_eq!(claim.job.key, poison.key);
        rig.store.requeue_interrupted().await.unwrap();
    }
    for job in [&poison, &twin] {
        let job = rig.store.job(Owners::All, job.id).await.unwrap().unwrap();
        assert_eq!(
            (job.status, job.reason),
            (Status::Failed, Some(Reason::WorkerLost))
        );
    }
    assert!(rig.store.claim_next().await.unwrap().0.is_none());
}

#[tokio::test]
async fn a_source_that_is_put_back_leaves_its_place_to_a_twin_that_goes_first() {
    let rig = rig(fake::solve).await; // its workers never start: we claim, and die, in their place
    let at = |priority| NewJob { priority, ..same() };
    let source = rig.submit_as(at(-5)).await;
    rig.store.claim_next().await.unwrap().0.unwrap();
    let twin = rig.submit_as(at(5)).await;
    assert_eq!(twin.twin_of, Some(source.key));
    let between = rig.submit().await;
    rig.store.requeue_interrupted().await.unwrap();
    let place = async |job: &Job| {
        let job = rig.store.job(Owners::All, job.id).await.unwrap().unwrap();
        job.queue.unwrap().position
    };
    assert_eq!((place(&twin).await, place(&between).await), (1, 2));
}

#[tokio::test]
async fn whose_turn_it_is_joins_a_job_that_runs_on_the_same_input() {
    let rig = rig(fake::solve).await; // its workers never start: we claim in their place
    let first = rig.submit_as(same()).await;
    let twin = rig.submit_as(same()).await;
    let before = rig
        .submit_as(NewJob {
            priority: 5,
            ..same()
        })
        .await;
    assert_eq!(before.twin_of, None, "it is not made late by one behind it");
    let claim = rig.store.claim_next().await.unwrap().0.unwrap();
    assert_eq!(claim.job.key, before.key);
    assert!(rig.store.claim_next().await.unwrap().0.is_none());
    for job in [&first, &twin] {
        let job = rig.store.job(Owners::All, job.id).await.unwrap().unwrap();
        assert_eq!(job.twin_of, Some(before.key));
    }
    assert_eq!(rig.store.waiting(), 2);
    let ending = Ending {
        status: Status::Succeeded,
        reason: None,
        failure: None,
        result: ResultAvailable::Final,
    };
    let last = LastWords::default();
    rig.store
        .finish(before.key, 1, &ending, last, None)
        .await
        .unwrap();
    let first = rig.store.job(Owners::All, first.id).await.unwrap().unwrap();
    assert_eq!(first.cached_from, Some(before.id));
    assert_eq!(rig.store.waiting(), 0);
}
