//! A worker: solves a claimed job, and ends it.

use std::{any::Any, ops::ControlFlow, sync::Arc, time::Duration, time::Instant};

use solver::{
    error::SolveError,
    mesh::Mesh,
    problem::{Problem, Refine, Step},
    solution::Outcome,
};
use tokio::{sync::mpsc, task::JoinError};
use tracing::{error, info, warn};
use uuid::Uuid;

use super::{
    backoff::Backoff,
    recorder::{self, Report},
    running::{Running, StopReason},
    state::Queue,
};
use crate::{
    event::Payload,
    job::{Failure, Job, Reason, ResultAvailable, Status},
    run::{self, Document, PartialSolution, Solve, Update},
    store::{Claim, Ending, FinalBatch, Parts, Store},
    time::Time,
};

/// Most reports of a solver that are not recorded yet; then it waits.
const MOST_UNRECORDED: usize = 256;

/// How long the solver of a job that has reached its time limit may take to return its last state (see `Limits`).
const TIMEOUT_GRACE: Duration = Duration::from_secs(2);

/// One attempt to solve a job, from claim to end.
pub(super) async fn run_attempt(queue: &Arc<Queue>, claim: Claim, running: Running) {
    let Claim {
        job, problem, mesh, ..
    } = claim;
    info!(job.id = %job.id, job.attempt, "job {} started", job.id);
    let (sender, reports) = mpsc::channel(MOST_UNRECORDED);
    let stop = running.stop.clone();
    let solve = queue.solve;
    let store = queue.store.clone();
    let solving = tokio::task::spawn_blocking(move || {
        let mesh = mesh.map(|hash| stored_mesh(&store, &hash)).transpose()?;
        solve_and_report(&problem, mesh, solve, |report| {
            // an error means that the recorder has ended: there is nobody to solve for
            let recording = report.is_none_or(|report| sender.blocking_send(report).is_ok());
            if recording && stop.get().is_none() {
                ControlFlow::Continue(())
            } else {
                ControlFlow::Break(())
            }
        })
        .map_err(Unsolved::Solve)
    });
    let timer = tokio::spawn(time_out(queue.clone(), job.clone(), running.clone()));
    let last = recorder::record(queue, &job, &running, reports).await;
    let solved = solving.await;
    timer.abort();
    let (ending, parts) = ending_of_attempt(
        &job,
        solved,
        running.stop.get() == Some(&StopReason::OutOfTime),
    );
    // when the service stops, it is requeued then or at the next start, and not canceled
    if !(ending.status == Status::Canceled && queue.stopping.is_cancelled()) {
        end_with_retries(queue, &job, ending, last, parts).await;
    }
    queue.release(&job);
}

/// Stops a job at its time limit, and ends it by force if its solver does not stop.
async fn time_out(queue: Arc<Queue>, job: Job, running: Running) {
    tokio::time::sleep(Duration::from_secs_f64(job.limits.timeout_s)).await;
    running.stop(StopReason::OutOfTime);
    tokio::time::sleep(TIMEOUT_GRACE).await;
    // in a task of its own: a solver that returns now stops this timer, but not a commit that has begun
    tokio::spawn(async move {
        let ending = timed_out(&job);
        if let Err(cause) = queue.end_attempt(job.key, running.attempt, &ending).await {
            error!(job.id = %job.id, %cause, "job {} could not be ended: {cause}", job.id);
        }
    });
}

fn timed_out(job: &Job) -> Ending {
    let detail = format!(
        "it was stopped after {} s; see limits.timeout_s",
        job.limits.timeout_s
    );
    Ending::failed(Reason::TimedOut, detail)
}

/// Why there is no solution.
enum Unsolved {
    Solve(SolveError),
    /// The mesh, which was there when the job was accepted, cannot be read.
    Mesh(String),
}

/// Reads a mesh from the store. On a blocking thread.
fn stored_mesh(store: &Store, hash: &str) -> Result<Mesh, Unsolved> {
    let failed = |cause: &dyn std::fmt::Display| Unsolved::Mesh(format!("mesh {hash}: {cause}"));
    let body = tokio::runtime::Handle::current().block_on(store.mesh_body(hash));
    let body = body.map_err(|error| failed(&error))?;
    let body = body.ok_or_else(|| failed(&"it is not stored"))?;
    postcard::from_bytes(&body).map_err(|error| failed(&error))
}

/// Reads the problem and solves it. `report` is called with everything that is to be recorded, and with nothing where
/// the solver only asks whether to go on. On a blocking thread.
fn solve_and_report(
    problem: &str,
    mesh: Option<Mesh>,
    solve: Solve,
    mut report: impl FnMut(Option<Report>) -> ControlFlow<()>,
) -> Result<Solved, SolveError> {
    let start = Instant::now();
    let problem: Problem = files::parse(problem).map_err(SolveError::Invalid)?;
    let parse_s = start.elapsed().as_secs_f64();
    let single = |step: &Step| step.increments == 1;
    if problem.steps.len() <= 1
        && problem.steps.iter().all(single)
        && matches!(problem.mesh.refine, Refine::Times(_))
    {
        // whether to stop is asked again at the next report
        let _ = report(Some(Report::OneLevel));
    }
    let event = |payload| Some(Report::Event(Time::now(), payload));
    let mut partials = Partials::default();
    let document = run::run(&problem, mesh, parse_s, solve, &mut |update| {
        report(match update {
            Update::Phase(stage) => event(Payload::Stage { stage }),
            Update::Iteration(row) => event(Payload::Iteration(row)),
            Update::Warning(warning) => event(Payload::Warning(warning.clone())),
            Update::Step(partial) => partials.next(&partial),
            Update::Pulse => None,
        })
    })?;
    let parts = Parts::of(&document).map_err(|_| SolveError::NonFinite { phase: "recover" })?;
    Ok(Solved {
        ending: ending_of_solution(&document),
        iterations: document.history.len(),
        parts,
    })
}

/// Decides when the results of finished load steps are stored as a partial result: not after each, since all of it is
/// written each time and a problem may have a thousand steps; and no longer once it has grown large.
#[derive(Default)]
struct Partials {
    /// Not before this time.
    next: Option<Instant>,
}

impl Partials {
    /// The partial result, if it is time to store it.
    fn next(&mut self, partial: &PartialSolution<'_>) -> Option<Report> {
        /// It is written in one transaction, which holds up the single writer for some 40 ms.
        const MOST_BYTES: usize = 4 << 20;
        /// It takes at most a tenth of the time, and happens at most once a second.
        const SHARE: u32 = 10;
        const PAUSE: Duration = Duration::from_secs(1);
        let start = Instant::now();
        if self.next.is_some_and(|next| start < next) {
            return None;
        }
        // numbers that are not finite, and so have no JSON, are reported at the end
        let parts = Parts::of(&partial.document().ok()?).ok();
        self.next = Some(start + (start.elapsed() * SHARE).max(PAUSE));
        let parts = parts.filter(|parts| parts.bytes() <= MOST_BYTES)?;
        Some(Report::Partial(Box::new(parts)))
    }
}

/// A solution ready to be stored.
struct Solved {
    ending: Ending,
    iterations: usize,
    parts: Parts,
}

/// What the outcome of a solution means for its job.
fn ending_of_solution(document: &Document) -> Ending {
    let (summary, partial) = (&document.summary.solution, ResultAvailable::Partial);
    let residuals = &summary.residuals;
    let failed = |reason, found: String| {
        let detail = format!(
            "after {} iterations {found}; the last state and the history are kept",
            summary.iterations
        );
        Ending {
            result: partial,
            ..Ending::failed(reason, detail)
        }
    };
    let unsettled = || {
        format!(
            "the residual is {:.3e} and the friction residual {:.3e}",
            residuals.kkt, residuals.friction
        )
    };
    let unbalanced = || {
        format!(
            "the forces on the body are out of balance by {:.3e} of their size",
            residuals.equilibrium
        )
    };
    match summary.outcome {
        Outcome::Converged => Ending {
            status: Status::Succeeded,
            reason: None,
            failure: None,
            result: ResultAvailable::Final,
        },
        Outcome::NotConverged => failed(Reason::NotConverged, unsettled()),
        Outcome::ContactCycling => failed(Reason::ContactCycling, unsettled()),
        Outcome::FalseConvergence => failed(Reason::FalseConvergence, unbalanced()),
        Outcome::Canceled => Ending {
            result: partial,
            ..Ending::canceled()
        },
    }
}

/// How the job ends, by what its solver has returned, or its panic.
fn ending_of_attempt(
    job: &Job,
    solved: Result<Result<Solved, Unsolved>, JoinError>,
    out_of_time: bool,
) -> (Ending, Option<Parts>) {
    let solved = match solved {
        Ok(Err(Unsolved::Mesh(cause))) => return (internal(job, &cause), None),
        Ok(Err(Unsolved::Solve(error))) => Ok(Err(error)),
        Ok(Ok(solved)) => Ok(Ok(solved)),
        Err(panic) => Err(panic),
    };
    match solved {
        Ok(Ok(Solved {
            ending,
            iterations,
            parts,
        })) => {
            let ending = match ending.status {
                // the solver was asked to stop, and does not know why
                Status::Canceled if out_of_time => Ending {
                    result: ending.result,
                    ..timed_out(job)
                },
                _ => ending,
            };
            let status = ending.status;
            info!(job.id = %job.id, %status, iterations, "job {} solved: {status} after {iterations} iterations", job.id);
            (ending, Some(parts))
        }
        Ok(Err(SolveError::Stopped)) if out_of_time => (timed_out(job), None),
        Ok(Err(SolveError::Stopped)) => (Ending::canceled(), None),
        Ok(Err(error @ (SolveError::SingularSystem { .. } | SolveError::Unheld { .. }))) => {
            failed(Reason::SingularSystem, &error)
        }
        Ok(Err(error @ SolveError::NonFinite { .. })) => failed(Reason::NonFinite, &error),
        Ok(Err(error @ SolveError::ResourceExhausted)) => failed(Reason::ResourceExhausted, &error),
        // it was checked before it was accepted: an error of the service, not of the client
        Ok(Err(error @ SolveError::Invalid(_))) => (internal(job, &error), None),
        Err(panic) => (internal(job, &panicked(panic)), None),
    }
}

fn failed(reason: Reason, error: &SolveError) -> (Ending, Option<Parts>) {
    (Ending::failed(reason, error.to_string()), None)
}

/// Logs the cause under an incident number, and tells the client only that number.
fn internal(job: &Job, cause: &dyn std::fmt::Display) -> Ending {
    let incident = Uuid::now_v7();
    error!(job.id = %job.id, %incident, %cause, "job {} failed, incident {incident}: {cause}", job.id);
    let detail = format!("an unexpected error, logged as incident {incident}");
    let failure = Failure::new(Reason::Internal, detail);
    Ending {
        failure: Some(failure),
        ..Ending::failed(Reason::Internal, "")
    }
}

fn panicked(error: JoinError) -> String {
    let Ok(panic) = error.try_into_panic() else {
        return "the solver's thread was lost".into();
    };
    let text = |panic: &(dyn Any + Send)| {
        panic
            .downcast_ref::<String>()
            .cloned()
            .or_else(|| panic.downcast_ref::<&str>().map(|text| text.to_string()))
    };
    format!("the solver panicked: {}", text(&*panic).unwrap_or_default())
}

/// Stores the result, then the end. This is retried for as long as it takes, since the disk may be full for a while
/// and a job must not stay running. If the service stops meanwhile, its next start requeues the job.
async fn end_with_retries(
    queue: &Queue,
    job: &Job,
    ending: Ending,
    last: FinalBatch,
    parts: Option<Parts>,
) {
    let mut backoff = Backoff::default();
    while let Err(cause) = try_to_end(queue, job, &ending, &last, parts.as_ref()).await {
        warn!(job.id = %job.id, %cause, "job {} could not be ended yet: {cause}", job.id);
        if !backoff.wait(&queue.stopping).await {
            return;
        }
    }
}

async fn try_to_end(
    queue: &Queue,
    job: &Job,
    ending: &Ending,
    last: &FinalBatch,
    parts: Option<&Parts>,
) -> crate::store::Result<()> {
    let (key, attempt) = (job.key, job.attempt);
    let current = match parts {
        Some(parts) => queue.store.write_before_end(key, attempt, parts).await?,
        None => true,
    };
    if !current {
        return Ok(());
    }
    let changed = queue
        .store
        .finish(key, attempt, ending, last.clone(), parts);
    if let Some(changed) = changed.await? {
        queue.announce(&changed);
    }
    Ok(())
}
