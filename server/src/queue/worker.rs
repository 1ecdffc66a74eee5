//! A worker: has a claimed job solved, and ends it.

use std::{any::Any, ops::ControlFlow, sync::Arc, time::Duration, time::Instant};

use solver::{
    error::SolveError,
    mesh::Mesh,
    problem::{Problem, Refine, Step},
    solution::{Outcome, Progress},
};
use tokio::{sync::mpsc, task::JoinError};
use tracing::{error, info, warn};
use uuid::Uuid;

use super::{
    backoff::Pauses,
    recorder::{self, Line},
    running::{Running, Why},
    state::Queue,
};
use crate::{
    event::Payload,
    job::{Failure, Job, Reason, ResultAvailable, Status},
    run::{self, Document, Said, SoFar, Solve},
    store::{Claim, Ending, LastWords, Parts, Store},
    time::Time,
};

/// Lines that a solver may be ahead of its recorder; then it waits.
const AHEAD: usize = 256;

/// A solver whose job has run out of time gets this long to leave its last state; `Limits` says so.
const LAST_STATE: Duration = Duration::from_secs(2);

/// One start of a job, from claim to end.
pub(super) async fn attempt(queue: &Arc<Queue>, claim: Claim, running: Running) {
    let Claim {
        job, problem, mesh, ..
    } = claim;
    info!(job.id = %job.id, job.attempt, "job {} started", job.id);
    let (say, lines) = mpsc::channel(AHEAD);
    let stop = running.stop.clone();
    let solve = queue.solve;
    let store = queue.store.clone();
    let solving = tokio::task::spawn_blocking(move || {
        let mesh = mesh.map(|hash| stored_mesh(&store, &hash)).transpose()?;
        solve_aloud(&problem, mesh, solve, |line| {
            // An error means that the recorder is gone, and with it everybody who would listen.
            let heard = line.is_none_or(|line| say.blocking_send(line).is_ok());
            if heard && stop.get().is_none() {
                ControlFlow::Continue(())
            } else {
                ControlFlow::Break(())
            }
        })
        .map_err(Unsolved::Solve)
    });
    let clock = tokio::spawn(time_out(queue.clone(), job.clone(), running.clone()));
    let last = recorder::record(queue, &job, &running, lines).await;
    let solved = solving.await;
    clock.abort();
    let (ending, parts) = judge(&job, solved, running.stop.get() == Some(&Why::OutOfTime));
    // at a drain it is put back, by that or by the next start, and not canceled
    if !(ending.status == Status::Canceled && queue.stopping.is_cancelled()) {
        end(queue, &job, ending, last, parts).await;
    }
    queue.release(&job);
}

/// Stops a job that runs longer than it may, if need be over its solver's head.
async fn time_out(queue: Arc<Queue>, job: Job, running: Running) {
    tokio::time::sleep(Duration::from_secs_f64(job.limits.timeout_s)).await;
    running.stop(Why::OutOfTime);
    tokio::time::sleep(LAST_STATE).await;
    // in a task of its own: a solver that returns now stops this clock, but not a commit under way
    tokio::spawn(async move {
        let ending = timed_out(&job);
        if let Err(cause) = queue.end(job.key, running.attempt, &ending).await {
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
    /// The mesh that was there when the job was accepted cannot be had.
    Mesh(String),
}

/// A mesh from the store. On a blocking thread.
fn stored_mesh(store: &Store, hash: &str) -> Result<Mesh, Unsolved> {
    let failed = |cause: &dyn std::fmt::Display| Unsolved::Mesh(format!("mesh {hash}: {cause}"));
    let body = tokio::runtime::Handle::current().block_on(store.mesh_body(hash));
    let body = body.map_err(|error| failed(&error))?;
    let body = body.ok_or_else(|| failed(&"it is not stored"))?;
    postcard::from_bytes(&body).map_err(|error| failed(&error))
}

/// Reads the problem and solves it, telling everything on the way, or nothing where it only asks
/// whether to go on. On a blocking thread.
fn solve_aloud(
    problem: &str,
    mesh: Option<Mesh>,
    solve: Solve,
    mut say: impl FnMut(Option<Line>) -> ControlFlow<()>,
) -> Result<Solved, SolveError> {
    let start = Instant::now();
    let problem: Problem = files::parse(problem).map_err(SolveError::Invalid)?;
    let parse_s = start.elapsed().as_secs_f64();
    let single = |step: &Step| step.increments == 1;
    if problem.steps.len() <= 1
        && problem.steps.iter().all(single)
        && matches!(problem.mesh.refine, Refine::Times(_))
    {
        // whether anybody listens is seen at the next word
        let _ = say(Some(Line::OneLevel));
    }
    let event = |payload| Some(Line::Event(Time::now(), payload));
    let mut partials = Partials::default();
    let document = run::run(&problem, mesh, parse_s, solve, &mut |said| {
        say(match said {
            Said::Step(so_far) => partials.next(&so_far),
            Said::Progress(progress) => match progress {
                Progress::Phase(stage) => event(Payload::Stage { stage }),
                Progress::Iteration(row) => event(Payload::Iteration(row.clone())),
                Progress::Warning(warning) => event(Payload::Warning(warning.clone())),
                Progress::Step(_) | Progress::Pulse => None,
            },
        })
    })?;
    let parts = Parts::of(&document).map_err(|_| SolveError::NonFinite { phase: "recover" })?;
    Ok(Solved {
        ending: ending_of(&document),
        iterations: document.history.len(),
        parts,
    })
}

/// What finished load steps have found, from time to time: each time all of it is written, and a problem may
/// have a thousand steps. Where it has grown large the last that was written stays until the end.
#[derive(Default)]
struct Partials {
    /// Not before this moment.
    next: Option<Instant>,
}

impl Partials {
    /// What there is, if it is time for it.
    fn next(&mut self, so_far: &SoFar<'_>) -> Option<Line> {
        /// They are written at once, and hold the single writer for so long: some 40 ms.
        const MOST_BYTES: usize = 4 << 20;
        /// A tenth of the time, and at most once a second.
        const SHARE: u32 = 10;
        const PAUSE: Duration = Duration::from_secs(1);
        let start = Instant::now();
        if self.next.is_some_and(|next| start < next) {
            return None;
        }
        // what is not finite, or has no JSON, is told at the end
        let parts = Parts::of(&so_far.document().ok()?).ok();
        self.next = Some(start + (start.elapsed() * SHARE).max(PAUSE));
        let parts = parts.filter(|parts| parts.bytes() <= MOST_BYTES)?;
        Some(Line::Partial(Box::new(parts)))
    }
}

/// A solution ready to be stored.
struct Solved {
    ending: Ending,
    iterations: usize,
    parts: Parts,
}

/// What the outcome of a solution means for its job.
fn ending_of(document: &Document) -> Ending {
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

/// What a solver's answer, or its panic, means for the job.
fn judge(
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
                // it stopped because it was asked to, and says no more than that
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
        // It was checked before it was accepted: ours to explain, not the client's.
        Ok(Err(error @ SolveError::Invalid(_))) => (internal(job, &error), None),
        Err(panic) => (internal(job, &panicked(panic)), None),
    }
}

fn failed(reason: Reason, error: &SolveError) -> (Ending, Option<Parts>) {
    (Ending::failed(reason, error.to_string()), None)
}

/// Logs the cause under an incident number, which is all that the client is told.
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

/// Stores the result, then the end. What fails is tried again for as long as it takes, since a job must not
/// stay running: a full disk may pass. When the service stops, its next start puts the job back.
async fn end(queue: &Queue, job: &Job, ending: Ending, last: LastWords, parts: Option<Parts>) {
    let mut pauses = Pauses::default();
    while let Err(cause) = try_to_end(queue, job, &ending, &last, parts.as_ref()).await {
        warn!(job.id = %job.id, %cause, "job {} could not be ended yet: {cause}", job.id);
        if !pauses.next(&queue.stopping).await {
            return;
        }
    }
}

async fn try_to_end(
    queue: &Queue,
    job: &Job,
    ending: &Ending,
    last: &LastWords,
    parts: Option<&Parts>,
) -> crate::store::Result<()> {
    let (key, attempt) = (job.key, job.attempt);
    let current = match parts {
        Some(parts) => queue.store.write_ahead(key, attempt, parts).await?,
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
