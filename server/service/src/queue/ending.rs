//! Decides how a job ends, from the result of its solver.

use std::any::Any;

use base::{
    job::{Failure, Job, Reason, ResultAvailable, Status, without_solution},
    memory::Outgrown,
    run::Document,
    text::size,
};
use serde::{Deserialize, Serialize};
use solver::{
    error::{SolveError, shortened},
    solution::{EstimatedQuantity, Outcome, Summary, Warning},
};
use store::{Ending, Overview, Parts};
use tracing::{debug, error};
use uuid::Uuid;

use super::running::StopReason;

/// A solution ready to be stored.
pub(super) struct Solved {
    pub(super) ending: Ending,
    /// Whether the requested verification is missing.
    pub(super) unverified: bool,
    pub(super) iterations: usize,
    pub(super) parts: Parts,
}

/// Why an attempt to solve a job has no solution.
#[derive(Debug, Serialize, Deserialize)]
pub enum NoSolution {
    /// The solver was asked to stop before it had a state to return.
    Stopped,
    /// The job needs more memory than its share.
    OutOfMemory(Outgrown),
    /// The job fails for this reason, with this detail.
    Failed(Reason, String),
    /// An error of the service, not of the client.
    Internal(String),
    /// The worker that solved the job was lost, for the reason given in words.
    Lost(String),
    /// The worker that solved the job has given it back, since it is to end.
    GivenBack,
}

impl From<SolveError> for NoSolution {
    fn from(error: SolveError) -> Self {
        let detail = error.to_string();
        match error {
            SolveError::Stopped => NoSolution::Stopped,
            SolveError::SingularSystem { .. }
            | SolveError::Unheld { .. }
            | SolveError::BodiesUnheld
            | SolveError::ObstacleUnheld { .. } => {
                NoSolution::Failed(Reason::SingularSystem, detail)
            }
            SolveError::NonFinite { .. } => NoSolution::Failed(Reason::NonFinite, detail),
            SolveError::ResourceExhausted { .. } => {
                NoSolution::Failed(Reason::ResourceExhausted, detail)
            }
            // it was checked before it was accepted
            SolveError::Invalid(_) | SolveError::OtherBody => NoSolution::Internal(detail),
        }
    }
}

/// The largest number of warnings that are stored with a job: jobs are read in lists of a thousand.
const MOST_WARNINGS: usize = 5;
/// The largest number of characters of a warning's message and of its pointer.
const LONGEST_WARNING: usize = 400;

/// The most severe warnings of a result, the most severe first.
fn worst(warnings: &[Warning]) -> Vec<Warning> {
    let mut found: Vec<&Warning> = warnings.iter().collect();
    found.sort_by_key(|warning| warning.code.severity()); // stable: else in their order
    let short = |warning: &Warning| Warning {
        message: shortened(&warning.message, LONGEST_WARNING),
        pointer: shortened(&warning.pointer, LONGEST_WARNING),
        ..*warning
    };
    found.into_iter().take(MOST_WARNINGS).map(short).collect()
}

/// The largest number of quantities that are stored with a job, and of characters of a contact's name in them: jobs are
/// read in lists of a thousand.
const MOST_QUANTITIES: usize = 10;
const LONGEST_NAME: usize = 100;

/// What the row of a job says about this result.
fn overview(summary: &Summary) -> Overview {
    let accuracy = summary.accuracy.as_ref();
    let quantities = accuracy.map_or(&[][..], |accuracy| &accuracy.quantities);
    let shown = quantities.iter().filter(|q| !q.quantity.is_extent());
    let short = |q: &EstimatedQuantity| EstimatedQuantity {
        contact: shortened(&q.contact, LONGEST_NAME),
        ..q.clone()
    };
    Overview {
        verdict: accuracy.map(|accuracy| accuracy.verdict),
        quantities: shown.take(MOST_QUANTITIES).map(short).collect(),
        warnings: worst(&summary.warnings),
    }
}

/// The end of a job that follows from the outcome of its solution; `outgrown`: the lack of memory for which the solver
/// was stopped.
pub(super) fn ending_of_solution(document: &Document, outgrown: Option<Outgrown>) -> Ending {
    let (summary, partial) = (&document.summary.solution, ResultAvailable::Partial);
    let failed = |reason| {
        let detail = without_solution(summary.outcome, summary.iterations, &summary.residuals);
        let detail = format!("{detail}; the last state and the history are kept");
        Ending {
            result: partial,
            overview: overview(summary),
            ..Ending::failed(reason, detail)
        }
    };
    match summary.outcome {
        Outcome::Converged => Ending {
            status: Status::Succeeded,
            reason: None,
            failure: None,
            result: ResultAvailable::Final,
            overview: overview(summary),
        },
        Outcome::NotConverged => failed(Reason::NotConverged),
        Outcome::ContactCycling => failed(Reason::ContactCycling),
        Outcome::FalseConvergence => failed(Reason::FalseConvergence),
        Outcome::Canceled | Outcome::Unfinished => Ending {
            result: partial,
            ..outgrown.map_or_else(Ending::canceled, out_of_memory)
        },
    }
}

/// The end of a job that follows from the result of its solver, with the result to be stored.
pub(super) fn ending_of_attempt(
    job: &Job,
    solved: Result<Solved, NoSolution>,
    stopped: Option<StopReason>,
) -> (Ending, Option<Parts>) {
    let no_solution = match solved {
        Ok(Solved {
            ending,
            unverified,
            iterations,
            parts,
        }) => {
            // a verification that fails is told in the result; one that is stopped leaves the job unfinished
            let unfinished = unverified && stopped.is_some();
            let ending = match ending.status {
                Status::Canceled => Ending {
                    result: ending.result,
                    ..stopped_for(job, stopped)
                },
                Status::Succeeded if unfinished => Ending {
                    result: ResultAvailable::Partial,
                    overview: ending.overview,
                    ..stopped_for(job, stopped)
                },
                _ => ending,
            };
            debug!(job.id = %job.id, iterations, "job {}: its solver returned after {iterations} iterations", job.id);
            return (ending, Some(parts));
        }
        Err(no_solution) => no_solution,
    };
    let ending = match no_solution {
        NoSolution::Stopped => stopped_for(job, stopped),
        NoSolution::OutOfMemory(outgrown) => out_of_memory(outgrown),
        NoSolution::Failed(reason, detail) => Ending::failed(reason, detail),
        // (a job whose worker was lost or has given it back is requeued)
        NoSolution::Internal(cause) | NoSolution::Lost(cause) => internal(job, &cause),
        NoSolution::GivenBack => internal(job, &"it was given back"),
    };
    (ending, None)
}

/// The end of a job whose solver was asked to stop, depending on the reason.
fn stopped_for(job: &Job, reason: Option<StopReason>) -> Ending {
    match reason {
        Some(StopReason::OutOfTime) => timed_out(job),
        Some(StopReason::Unwanted) | None => Ending::canceled(),
    }
}

/// The failure of a job that needs more memory than its share, without a result.
fn out_of_memory(
    Outgrown {
        used,
        needed,
        share,
    }: Outgrown,
) -> Ending {
    let detail = format!(
        "the job used {} and needed {} more, but its share is {}: use a coarser mesh, above all along the contacts, or \
         fewer load steps",
        size(used),
        size(needed),
        size(share)
    );
    Ending::failed(Reason::ResourceExhausted, detail)
}

/// The failure of a job that has used its share of the memory (bytes) and whose process was refused `bytes` more by the
/// system.
pub(super) fn refused_memory(bytes: u64, share: u64) -> NoSolution {
    let detail = format!(
        "the job has used its share of {} of the memory and was refused {} more: use a coarser mesh, fewer contacts or fewer \
         load steps",
        size(share),
        size(bytes)
    );
    NoSolution::Failed(Reason::ResourceExhausted, detail)
}

/// The failure of a job that has reached its time limit without a result.
pub(super) fn timed_out(job: &Job) -> Ending {
    let detail = format!(
        "the job was stopped after {} s; see limits.timeout_s",
        job.limits.timeout_s
    );
    Ending::failed(Reason::TimedOut, detail)
}

/// Logs the cause under an incident number, and tells the client only that number.
pub(super) fn internal(job: &Job, cause: &dyn std::fmt::Display) -> Ending {
    let incident = Uuid::now_v7();
    error!(job.id = %job.id, %incident, %cause, "job {} failed, incident {incident}: {cause}", job.id);
    let detail = format!("an unexpected error, logged as incident {incident}");
    let failure = Failure::new(Reason::Internal, detail);
    Ending {
        failure: Some(failure),
        ..Ending::failed(Reason::Internal, "")
    }
}

/// The text that `who` panicked, with the message of the panic.
pub(super) fn panicked(who: &str, panic: &(dyn Any + Send)) -> String {
    let text = |panic: &(dyn Any + Send)| {
        panic
            .downcast_ref::<String>()
            .cloned()
            .or_else(|| panic.downcast_ref::<&str>().map(|text| text.to_string()))
    };
    format!("{who} panicked: {}", text(panic).unwrap_or_default())
}
