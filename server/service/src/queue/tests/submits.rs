//! Tests of submissions: keys, and refused submissions next to accepted ones.

use super::*;

#[tokio::test]
async fn many_simultaneous_submissions_with_one_key_make_one_job() {
    let rig = rig(fake::solve).await;
    let asking = (0..50).map(|_| rig.queue.submit(submission(vec![new(0)], Some("k"))));
    let answers = futures_util::future::join_all(asking).await;
    let answers: Vec<Accepted> = answers.into_iter().map(|answer| answer.unwrap()).collect();
    let id = answers[0].jobs[0].id;
    assert!(answers.iter().all(|answer| answer.jobs[0].id == id));
    let new_ones = answers.iter().filter(|answer| !answer.replayed).count();
    assert_eq!((new_ones, rig.store.waiting()), (1, 1));
    let mut other = submission(vec![new(0)], Some("k"));
    other.key.as_mut().unwrap().payload = "another".into();
    let refused = rig.queue.submit(other).await.unwrap_err();
    assert!(matches!(refused, StoreError::KeyReuse), "{refused}");
    // the key outlives its job, and is answered with *deleted*
    rig.queue
        .cancel(rig.store.last_key().await.unwrap())
        .await
        .unwrap();
    rig.store
        .delete(Owners::All, rig.store.last_key().await.unwrap())
        .await
        .unwrap();
    let gone = rig.queue.submit(submission(vec![new(0)], Some("k")));
    assert!(matches!(gone.await, Err(StoreError::Deleted(gone)) if gone == id));
}

#[tokio::test]
async fn a_refused_submission_does_not_affect_the_others_in_its_commit() {
    let rig = rig(fake::solve).await;
    let id = JobId::new();
    let named = |payload: &str| NewJob {
        id: Some(id),
        payload: payload.into(),
        ..new(0)
    };
    rig.queue
        .submit(submission(vec![named("a")], None))
        .await
        .unwrap();
    // two of three are new, but the id of the other belongs to another job: none is accepted
    let batch = vec![new(0), named("b"), new(0)];
    let asking = [
        submission(vec![new(0)], None),
        submission(batch, None),
        submission(vec![new(0), new(0)], None),
        submission(vec![named("a")], None),
    ];
    let asking = asking.map(|submission| rig.queue.submit(submission));
    let answers = futures_util::future::join_all(asking).await;
    assert!(answers[0].is_ok() && answers[2].is_ok());
    assert!(matches!(answers[1], Err(StoreError::IdConflict(other)) if other == id));
    let again = answers[3].as_ref().unwrap();
    assert!(again.replayed && again.jobs[0].id == id);
    assert_eq!(rig.store.waiting(), 4);
    let all = Filter::default();
    let by_status = rig.store.count(Owners::All, &all, Some(GroupBy::Status));
    assert_eq!(by_status.await.unwrap(), [("queued".to_string(), 4)]);
}

#[tokio::test]
async fn a_key_is_answered_with_its_remaining_jobs() {
    let rig = rig(fake::solve).await;
    rig.queue.start();
    let two = submission(vec![new(0), new(0)], Some("k"));
    let accepted = rig.queue.submit(two.clone()).await.unwrap();
    for job in &accepted.jobs {
        rig.until_done(job).await;
    }
    rig.store
        .delete(Owners::All, accepted.jobs[0].key)
        .await
        .unwrap();
    let again = rig.queue.submit(two.clone()).await.unwrap();
    assert!(again.replayed);
    assert_eq!(again.jobs.len(), 1);
    assert_eq!(again.jobs[0].id, accepted.jobs[1].id);
    rig.store
        .delete(Owners::All, accepted.jobs[1].key)
        .await
        .unwrap();
    let gone = rig.queue.submit(two.clone()).await;
    assert!(matches!(gone, Err(StoreError::Deleted(_))));
    // removed with the ids of its jobs
    let later = base::time::Time::now().after_s(8.0 * 86_400.0);
    rig.store.forget_deleted(later).await.unwrap();
    assert!(!rig.queue.submit(two).await.unwrap().replayed);
}
