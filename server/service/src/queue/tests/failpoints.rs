//! Tests of every boundary between two stages of a job, with a panic and, where there may be one, an error: it costs
//! the job at most, but no other job and no worker.

use base::failpoint::{self, Failing, Point};
use futures_util::StreamExt;
use solver::problem::AccuracyMode;
use strum::VariantArray;

use super::*;

/// How long a test may wait: a lost job is found within a second.
const PATIENCE: Duration = Duration::from_secs(30);

/// A solver with a verification and a partial result.
fn solve_with_a_step(
    problem: &Problem,
    mesh: Option<External>,
    observer: &mut dyn Observer,
) -> std::result::Result<Solution, SolveError> {
    let mut problem = problem.clone();
    problem.solver.accuracy = Some(AccuracyMode::Verify);
    let solution = solver::solve_on(&problem, mesh, observer)?;
    observer.event(Progress::Step(&solution));
    if observer.stop() {
        Err(SolveError::Stopped)
    } else {
        Ok(solution)
    }
}

/// Whether an error of the store or the machine may happen at a point; elsewhere only the program itself may fail.
fn may_be_an_error(point: Point) -> bool {
    match point {
        Point::Accepted
        | Point::Claimed
        | Point::MeshRead
        | Point::EventsReported
        | Point::PartialReported
        | Point::Solved
        | Point::AlmostStored
        | Point::Ended => true,
        Point::Answered
        | Point::Given
        | Point::Begun
        | Point::Parsed
        | Point::Meshing
        | Point::Assembling
        | Point::Ordering
        | Point::Factoring
        | Point::Condensing
        | Point::Iterating
        | Point::Recovering
        | Point::Verifying
        | Point::EventsStored
        | Point::Unannounced
        | Point::Done => false,
    }
}

/// Runs jobs on two workers with a failure at a point. If the workers start later, the dispatcher claims the first
/// jobs; otherwise their submissions do.
async fn fail_at(point: Point, failing: Failing, start_later: bool) {
    let case = format!("{point:?}, {failing:?}, workers start later: {start_later}");
    let rig = rig_of(solve_with_a_step, 2).await;
    if !start_later {
        rig.queue.start();
    }
    let id = JobId::new();
    failpoint::set(point, id, failing);
    let failing_one = NewJob {
        id: Some(id),
        ..new(0)
    };
    // in a task of its own, as the verb does it
    let (queue, failing_one) = (rig.queue.clone(), submission(vec![failing_one], None));
    let submitted = tokio::spawn(async move { queue.submit(failing_one).await }).await;
    let accepted = matches!(submitted, Ok(Ok(_)));
    let other = rig.submit().await;
    if start_later {
        rig.queue.start();
    }
    let later = async {
        assert_eq!(rig.until_done(&other).await.status, Status::Succeeded);
        let later = rig.submit().await;
        assert_eq!(rig.until_done(&later).await.status, Status::Succeeded);
    };
    let later = tokio::time::timeout(PATIENCE, later).await;
    later.unwrap_or_else(|_| panic!("{case}: another job waits for ever"));
    let job = rig.store.job(Owners::All, id).await.unwrap();
    assert!(
        job.is_some() || !accepted,
        "{case}: an accepted job is lost"
    );
    if let Some(job) = job {
        let done = tokio::time::timeout(PATIENCE, rig.until_done(&job)).await;
        let done = done.unwrap_or_else(|_| panic!("{case}: it runs for ever"));
        let internal = done.reason == Some(Reason::Internal);
        assert!(
            internal || done.status == Status::Succeeded,
            "{case}: {done:?}"
        );
        let repeated = failing == Failing::Error && point != Point::MeshRead;
        assert!(
            !internal || !repeated,
            "{case}: a write that fails is repeated"
        );
        if let Some(failure) = done.failure {
            assert!(failure.detail.contains("incident"), "{case}: {failure:?}");
        }
    }
    let start = Instant::now();
    while (rig.queue.state().idle, rig.queue.state().running) != (2, 0) {
        assert!(
            start.elapsed() < PATIENCE,
            "{case}: a worker is lost: {:?}",
            rig.queue.state()
        );
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    assert!(
        !failpoint::was_missed(point, id),
        "{case}: it never came there"
    );
    rig.queue.drain().await;
    rig.store.close().await;
}

#[tokio::test]
async fn a_failure_at_any_boundary_costs_its_job_alone() {
    let cases = Point::VARIANTS.iter().flat_map(|point| {
        let failings = if may_be_an_error(*point) {
            &[Failing::Panic, Failing::Error][..]
        } else {
            &[Failing::Panic]
        };
        let both = |failing| [false, true].map(|later| fail_at(*point, failing, later));
        failings.iter().copied().flat_map(both)
    });
    // some at a time: they mostly wait
    let cases = futures_util::stream::iter(cases.map(Box::pin)).buffer_unordered(4);
    cases.collect::<Vec<()>>().await;
}
