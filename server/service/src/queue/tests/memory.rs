//! Tests of the memory budget of running jobs.

use super::*;

const MIB: u64 = 1 << 20;

/// A queue of two workers with a budget of 100 MiB.
async fn rig_of_100_mib(solve: Solve) -> Rig {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    store.set_budget(Budget::new(100 * MIB, 2, 0));
    let queue = Queue::new(store.clone(), Solver::Threads(solve), 2);
    queue.start();
    Rig {
        store,
        queue,
        folder,
    }
}

/// A job with an input of its own whose estimate is this much memory.
fn needing(mib: u64) -> NewJob {
    NewJob {
        input_hash: format!("sha256:{mib}"),
        memory_bytes: mib * MIB,
        ..new(0)
    }
}

#[tokio::test]
async fn a_job_waits_until_it_fits_beside_the_running_ones_and_is_not_overtaken() {
    let rig = rig_of_100_mib(fake::solve_until_stopped).await;
    let first = rig.submit_as(needing(60)).await;
    rig.until_at_work(&first).await;
    let second = rig.submit_as(needing(50)).await;
    let third = rig.submit_as(needing(10)).await;
    tokio::time::sleep(Duration::from_millis(100)).await;
    for (job, position) in [(&second, 1), (&third, 2)] {
        let waiting = rig.store.job(Owners::All, job.id).await.unwrap().unwrap();
        let place = waiting.queue.unwrap();
        assert_eq!(
            (place.position, place.reason),
            (position, Waiting::Memory),
            "the third would fit, and a worker is idle"
        );
    }
    // while a claim is tried, a worker is reserved for it
    for _ in 0..500 {
        if rig.queue.state().idle == 1 {
            break;
        }
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    assert_eq!(rig.queue.state().idle, 1);
    rig.queue.cancel(first.key).await.unwrap();
    // both fit now
    rig.until_at_work(&second).await;
    rig.until_at_work(&third).await;
}

#[tokio::test]
async fn a_job_of_more_than_the_budget_runs_alone() {
    let rig = rig_of_100_mib(fake::solve_until_stopped).await;
    let large = rig.submit_as(needing(1000)).await;
    rig.until_at_work(&large).await;
    let small = rig.submit_as(needing(1)).await;
    tokio::time::sleep(Duration::from_millis(100)).await;
    let waiting = rig.store.job(Owners::All, small.id).await.unwrap().unwrap();
    assert_eq!(waiting.status, Status::Queued);
    rig.queue.cancel(large.key).await.unwrap();
    rig.until_at_work(&small).await;
}

/// A solver that needs more than its share, and stops when it is told to.
fn solve_greedily(
    _: &Problem,
    _: Option<External>,
    observer: &mut dyn Observer,
) -> Result<Solution, SolveError> {
    let bytes = 1 << 40;
    if observer.may_use(bytes) {
        return Ok(fake::solution());
    }
    observer.event(Progress::OutOfMemory { bytes });
    assert!(observer.stop());
    Err(SolveError::Stopped)
}

#[tokio::test]
async fn a_job_that_outgrows_its_share_fails_with_figures_and_its_worker_goes_on() {
    let rig = rig_of_100_mib(solve_greedily).await;
    for _ in 0..3 {
        let job = rig.submit_as(needing(10)).await;
        let ended = rig.until_done(&job).await;
        assert_eq!(ended.status, Status::Failed);
        assert_eq!(ended.reason, Some(Reason::ResourceExhausted));
        let detail = ended.failure.unwrap().detail;
        assert!(
            detail.contains("1.0 TiB more") || detail.contains("1024.0 GiB more"),
            "{detail}"
        );
        assert!(detail.contains("its share is 74.0 MiB"), "{detail}");
    }
}

/// A solver that asks for more memory, and returns its result so far if there is none.
fn solve_with_what_there_is(
    _: &Problem,
    _: Option<External>,
    observer: &mut dyn Observer,
) -> Result<Solution, SolveError> {
    let asked = [MIB, 1 << 40, MIB].map(|bytes| observer.may_use(bytes));
    // no answer stops it
    if asked == [true, false, true] && !observer.stop() {
        Ok(fake::solution())
    } else {
        Err(SolveError::Stopped)
    }
}

#[tokio::test]
async fn a_job_that_finds_no_room_for_more_goes_on_without() {
    let rig = rig_of_100_mib(solve_with_what_there_is).await;
    let job = rig.submit_as(needing(10)).await;
    let ended = rig.until_done(&job).await;
    assert_eq!(ended.status, Status::Succeeded, "{:?}", ended.failure);
}
