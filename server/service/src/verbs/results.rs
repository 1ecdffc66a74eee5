//! The operation that returns the summary of a result, and help to find out whether there is a result.

use std::sync::Arc;

use base::{
    caller::Caller,
    job::{Job, JobId, ResultAvailable},
    run::Summary,
    values::Words,
};
use futures_util::future::BoxFuture;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use solver::accuracy::{Assessment, assessment};
use store::Snapshot;

use super::{
    jobs,
    service::{Service, detached},
};
use crate::{error::ApiError, parameters::Parameter, transfer::Share};

/// The scalars of a result at the end of one load step.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct StepResult {
    /// The step's name in the problem, or its number from 0.
    pub name: String,
    /// The summary at the end of the step.
    pub summary: solver::solution::Summary,
}

/// The scalars of a result: at its end, and for each load step.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(rename = "Result")]
pub struct JobResult {
    /// How much of the result is available, as the job says: `partial` if the job has not ended or has not converged,
    /// even if the last finished load step converged.
    pub result_available: ResultAvailable,
    /// The summary of the last finished load step.
    pub summary: Summary,
    /// The verdict on the result as data and in a sentence; absent without stated errors.
    pub assessment: Option<Assessment>,
    /// The finished load steps.
    pub steps: Vec<StepResult>,
}

/// A part of a job's result, and whether that result is partial or final.
#[derive(Debug)]
pub struct Found<T> {
    /// Whether the result is partial or final, at the time at which it was read.
    pub available: ResultAvailable,
    /// The requested part.
    pub content: T,
    /// The share of the memory for answers that a large result holds; `None` for a small result.
    pub share: Option<Share>,
}

impl<T> Found<T> {
    /// A small part of a result, without a share of the memory for answers.
    pub(super) fn new(available: ResultAvailable, content: T) -> Found<T> {
        Found {
            available,
            content,
            share: None,
        }
    }
}

/// The largest size of parts of a result that are read without reserving memory (bytes).
const SMALL: usize = 4 << 20;

/// Reserves memory for parts of a result before they are read; `None` if they are small. The summaries of a job of many
/// contacts and steps take a hundred megabytes, and many clients may request them at once.
pub(super) async fn room_for(
    service: &Service,
    caller: &Caller,
    id: JobId,
    parts: &[&str],
) -> Result<Option<Share>, ApiError> {
    // without the connection that a snapshot holds: others need that while this waits
    let key = jobs::snapshot(service, caller, id).await?.job.key;
    let mut bytes = 0;
    for part in parts {
        bytes += service.store.part_memory(key, part).await?.unwrap_or(0);
    }
    match bytes {
        ..=SMALL => Ok(None),
        _ => service.sent.wait_for(bytes).await.map(Some),
    }
}

/// The name of the header, and of the entry in the metadata over gRPC, that says whether a result is partial or final.
pub const RESULT_AVAILABLE: &str = "result-available";

/// Returns the scalars of the result of a job; an error if the job has no result.
pub fn result<'a>(
    service: &'a Arc<Service>,
    caller: &'a Caller,
    id: JobId,
) -> BoxFuture<'a, Result<Found<JobResult>, ApiError>> {
    Box::pin(async move {
        let (service, caller) = (service.clone(), caller.clone());
        // what is read goes on if the client does not wait, and its memory counts until then
        detached(async move { read_result(&service, &caller, id).await }).await
    })
}

async fn read_result(
    service: &Service,
    caller: &Caller,
    id: JobId,
) -> Result<Found<JobResult>, ApiError> {
    let share = room_for(service, caller, id, &["summary", "steps"]).await?;
    let load = async {
        let mut found = with_result(service, caller, id).await?;
        let summary = found.part("summary").await?;
        let summary = summary.ok_or_else(|| ApiError::internal(format!("{id} has no summary")))?;
        let steps = found.part("steps").await?;
        Ok((found.job.result_available, summary, steps))
    };
    let read = move |(result_available, summary, steps): (_, Vec<u8>, Option<Vec<u8>>)| {
        let steps = steps.map_or(Ok(vec![]), |steps| read(&steps));
        let summary: Summary = read(&summary)?;
        let content = JobResult {
            result_available,
            assessment: assessment(&summary.solution),
            summary,
            steps: steps?,
        };
        Ok(Found {
            available: result_available,
            content,
            share,
        })
    };
    service.work_on(load, read).await?
}

/// Opens a snapshot of a job that has a result: a final one or, while the job runs, the result of its finished load
/// steps. An error if it has none.
pub(super) async fn with_result(
    service: &Service,
    caller: &Caller,
    id: JobId,
) -> Result<Snapshot, ApiError> {
    let found = jobs::snapshot(service, caller, id).await?;
    match found.job.result_available {
        ResultAvailable::Partial | ResultAvailable::Final => Ok(found),
        ResultAvailable::None => Err(no_result(&found.job)),
    }
}

/// Whether the state at which a job without a solution stopped will do.
pub const PARTIAL: Parameter<Words<bool>> = Parameter {
    name: "partial",
    meaning: "Whether a job that failed or was canceled is served too, with the state at which it stopped, which is not a solution; a load step that converged is served anyway; default false",
    values: Words(|| vec![("false", false), ("true", true)]),
};

/// Fails if the job ended without a solution and the state at which it stopped is not wanted (`partial`). Who plots that
/// state without having asked for it takes it for a solution. The result document needs no such question: it says in
/// `converged` and `outcome` what it is.
pub(super) fn is_wanted(job: &Job, partial: bool) -> Result<(), ApiError> {
    if partial || !job.status.is_without_solution() {
        return Ok(());
    }
    Err(ApiError::PartialResult {
        id: job.id,
        status: job.status,
        reason: job.reason,
        failure: job.failure.clone().map(Box::new),
    })
}

/// As `is_wanted`, for a load step: one that converged is a solution, whatever became of the job after it. No step: the end.
pub(super) fn is_step_wanted(
    job: &Job,
    step: Option<&StepResult>,
    partial: bool,
) -> Result<(), ApiError> {
    is_wanted(
        job,
        partial || step.is_some_and(|step| step.summary.converged),
    )
}

/// Reads a stored part of a result from its JSON.
pub(super) fn read<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, ApiError> {
    serde_json::from_slice(bytes).map_err(ApiError::internal)
}

/// The error of a job without a result, or without a result yet. A job that was canceled or still runs has history
/// and profiles, but no fields.
pub(super) fn no_result(job: &Job) -> ApiError {
    if job.status.is_terminal() {
        ApiError::NoResult(job.status)
    } else {
        ApiError::ResultNotReady(job.status)
    }
}
