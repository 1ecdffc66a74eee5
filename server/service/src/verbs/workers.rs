//! Operations of workers elsewhere, which solve the jobs of every owner.

use std::{sync::Arc, time::Duration};

use base::{
    caller::Caller,
    job::JobId,
    text::{number_of, size},
};
use futures_util::future::join_all;
use schemars::JsonSchema;
use serde::Serialize;

use super::service::Service;
use crate::{
    error::ApiError,
    queue::{Ask, Granted, JobAnswer, JobReport, Pace, WorkerId, WorkerState},
};

/// The workers on other machines.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Workers {
    /// The workers, in the order of their names.
    pub workers: Vec<WorkerState>,
}

/// Returns the workers that solve jobs of this service.
pub fn list(service: &Service, _caller: &Caller) -> Workers {
    let workers = service.queue.workers();
    Workers { workers }
}

/// The longest time that a request for a job may wait.
const LONGEST_WAIT: Duration = Duration::from_secs(30);
/// The largest number of jobs in a report.
const MOST_JOBS: usize = 1024;
/// The smallest memory of a worker (bytes).
const LEAST_MEMORY: u64 = 1 << 20;
/// The sizes of a worker's secret (bytes).
const SECRET_BYTES: std::ops::RangeInclusive<usize> = 16..=64;
/// The largest number of characters of a worker's name.
const LONGEST_NAME: usize = 100;

/// What the processor of a worker must have, so that a job has the same bits wherever it is solved.
pub const PROCESSOR: [&str; 2] = ["avx2", "fma"];

/// A worker that asks for a job.
#[derive(Clone, Debug)]
pub struct Applicant {
    /// The secret of the worker.
    pub secret: Vec<u8>,
    /// The version of its program.
    pub version: String,
    /// What its processor has, of [`PROCESSOR`].
    pub processor: Vec<String>,
    /// Its request.
    pub ask: Ask,
}

/// Leases a job to a worker, and waits for one; `None` if there is none in this time.
pub async fn lease(
    service: &Service,
    _caller: &Caller,
    applicant: Applicant,
    wait: Duration,
) -> Result<Option<Arc<Granted>>, ApiError> {
    let worker = admitted(&applicant)?;
    let leased = service
        .queue
        .lease(&worker, applicant.ask, wait.min(LONGEST_WAIT))
        .await;
    let leased = leased.map_err(|_| ApiError::Overloaded)?;
    // the next service has jobs again
    if leased.is_none() {
        service.accepting()?;
    }
    Ok(leased)
}

/// How often workers are to report: those elsewhere, or the processes on this machine.
pub fn pace(service: &Service, here: bool) -> Pace {
    service.queue.pace(here)
}

/// The name of a worker that may take jobs; an error says everything that speaks against it.
fn admitted(applicant: &Applicant) -> Result<WorkerId, ApiError> {
    let ours = env!("CARGO_PKG_VERSION");
    let (version, about) = (&applicant.version, &applicant.ask.about);
    let mut wrong = vec![];
    if version != ours {
        wrong.push(format!(
            "its version is {version:?}, that of the service {ours}: install the same program, since only that gives the same bits"
        ));
    }
    let lacks: Vec<&str> = PROCESSOR
        .into_iter()
        .filter(|feature| !applicant.processor.iter().any(|has| has == feature))
        .collect();
    if !lacks.is_empty() {
        wrong.push(format!(
            "its processor lacks {}, without which a job has other bits: use another machine",
            lacks.join(" and ")
        ));
    }
    if about.slots == 0 || about.slots > 1024 {
        wrong.push(format!(
            "it has {}, expected 1 to 1024",
            number_of(about.slots as usize, "slot")
        ));
    }
    if about.memory_bytes < LEAST_MEMORY {
        let (found, least) = (size(about.memory_bytes), size(LEAST_MEMORY));
        wrong.push(format!(
            "it has {found} of memory, expected at least {least}"
        ));
    }
    let plain = |c: char| !c.is_control();
    if about.name.chars().count() > LONGEST_NAME || !about.name.chars().all(plain) {
        wrong.push(format!(
            "its name is not a line of at most {LONGEST_NAME} characters"
        ));
    }
    if !SECRET_BYTES.contains(&applicant.secret.len()) {
        wrong.push(format!(
            "its secret has {} bytes, expected {} to {}",
            applicant.secret.len(),
            SECRET_BYTES.start(),
            SECRET_BYTES.end()
        ));
    }
    match wrong.is_empty() {
        true => Ok(WorkerId::of(&applicant.secret)),
        false => Err(ApiError::BadRequest(format!(
            "this worker cannot take jobs: {}",
            wrong.join("; ")
        ))),
    }
}

/// Takes what a worker reports of its jobs; the answers are in the same order.
pub async fn report(
    service: &Service,
    _caller: &Caller,
    (secret, free_bytes): (&[u8], u64),
    reports: Vec<(JobId, i32, JobReport)>,
) -> Result<Vec<JobAnswer>, ApiError> {
    if reports.len() > MOST_JOBS {
        return Err(ApiError::BadRequest(format!(
            "a report is about {} jobs, expected at most {MOST_JOBS}",
            reports.len()
        )));
    }
    let worker = WorkerId::of(secret);
    service.queue.has_free(&worker, free_bytes);
    let taking = reports.into_iter().map(|(job, attempt, report)| {
        let worker = &worker;
        async move {
            let answer = service.queue.take_report(worker, job, attempt, report).await;
            if let Some(why) = &answer.refused {
                tracing::warn!(%worker, job.id = %job, attempt, "a report of {worker} was refused: {why}");
            }
            answer
        }
    });
    let answers = join_all(taking).await;
    // a service that stops has no leases any more: what they were about goes on with the next one
    service.accepting()?;
    Ok(answers)
}

/// The job that was leased to a worker last, with its task.
pub fn task(
    service: &Service,
    _caller: &Caller,
    secret: &[u8],
    (job, attempt): (JobId, i32),
) -> Result<Arc<Granted>, ApiError> {
    service.accepting()?;
    let worker = WorkerId::of(secret);
    let task = service.queue.leased_task(&worker, job, attempt);
    task.map_err(ApiError::NotFound)
}

/// The stored form of the mesh of a job that is leased to a worker.
pub async fn mesh(
    service: &Service,
    _caller: &Caller,
    secret: &[u8],
    (job, attempt): (JobId, i32),
) -> Result<Arc<Vec<u8>>, ApiError> {
    service.accepting()?;
    let worker = WorkerId::of(secret);
    let mesh = service.queue.leased_mesh(&worker, job, attempt).await;
    mesh.map_err(ApiError::NotFound)
}
