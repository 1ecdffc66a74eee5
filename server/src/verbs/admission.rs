//! How a job that was read becomes one that is queued: fingerprinted, checked in depth, handed to the queue.

use std::sync::Arc;

use solver::{error::Violation, problem::Problem};
use tracing::info;

use super::{
    Service,
    envelope::{Draft, Envelope},
    meshes,
    problems::{self, Admitted},
};
use crate::{
    digest,
    error::ApiError,
    job::{Job, JobId},
    store::{Accepted, NewJob, RequestKey, StoreError, Submission},
    violations::{Violations, shortened},
};

/// Longest key of a request, in characters.
const MOST_KEY: usize = 255;

/// A job that was read, but not yet checked in depth.
pub(super) struct Prepared {
    envelope: Envelope,
    problem: Result<Problem, Vec<Violation>>,
    violations: Violations,
    pub(super) id: Option<JobId>,
    /// Fingerprint of all that was handed in.
    pub(super) payload: String,
}

pub(super) async fn prepare(
    service: &Service,
    (envelope, problem): Draft,
    id: Option<JobId>,
) -> Result<Prepared, ApiError> {
    let violations = envelope.violations();
    service
        .work(move || {
            let payload = match &problem {
                Ok(problem) => {
                    digest::of_json(&(&envelope, problem, id)).map_err(ApiError::internal)?
                }
                Err(_) => String::new(), // it is refused before anybody compares
            };
            Ok(Prepared {
                envelope,
                problem,
                violations,
                id,
                payload,
            })
        })
        .await?
}

/// The jobs of a key that was used before, for the same request.
pub(super) async fn replayed(
    service: &Service,
    key: Option<&RequestKey>,
) -> Result<Option<Vec<Job>>, ApiError> {
    match key {
        Some(key) if !key.payload.is_empty() => {
            Ok(service.store.replay(&service.owner(), key).await?)
        }
        _ => Ok(None),
    }
}

pub(super) async fn admit(service: &Service, prepared: Prepared) -> Result<NewJob, ApiError> {
    let Prepared {
        envelope,
        problem,
        mut violations,
        id,
        payload,
    } = prepared;
    let admitted = match problem {
        Ok(problem) => match problems::admit(service, problem).await {
            Err(ApiError::InvalidProblem(more)) => Err(more),
            admitted => Ok(admitted?),
        },
        Err(more) => Err(more),
    };
    match admitted {
        Ok(admitted) if violations.is_empty() => {
            let Admitted {
                title,
                input_hash,
                json,
                mesh,
            } = admitted;
            let Envelope {
                name,
                labels,
                priority,
                limits,
                cache,
            } = envelope;
            Ok(NewJob {
                id,
                name,
                labels,
                priority,
                limits,
                cache,
                parent: None,
                title,
                input_hash,
                problem: json,
                mesh,
                payload,
            })
        }
        refused => {
            violations.extend(refused.err().into_iter().flatten());
            Err(ApiError::InvalidProblem(violations.into_vec()))
        }
    }
}

pub(super) async fn hand_in(
    service: &Arc<Service>,
    jobs: Vec<NewJob>,
    key: Option<RequestKey>,
) -> Result<Accepted, ApiError> {
    let limit = service.max_queued;
    let hash = jobs.iter().find_map(|job| job.mesh.clone());
    let submission = Submission {
        owner: service.owner(),
        jobs,
        key,
        max_queued: limit,
    };
    let accepted = service.queue.submit(submission).await;
    let accepted = accepted.map_err(|error| match error {
        StoreError::QueueFull => ApiError::QueueFull { limit },
        // it was there when the problem was checked, and has been removed since
        StoreError::UnknownMesh => {
            ApiError::InvalidProblem(vec![meshes::missing(&hash.unwrap_or_default())])
        }
        other => other.into(),
    })?;
    for job in &accepted.jobs {
        info!(job.id = %job.id, job.input_hash, "job {} accepted", job.id);
    }
    Ok(accepted)
}

pub(super) fn checked_key(key: String) -> Result<String, ApiError> {
    let length = key.chars().count();
    if (1..=MOST_KEY).contains(&length) && !key.chars().any(char::is_control) {
        Ok(key)
    } else {
        Err(ApiError::BadParameter {
            name: "Idempotency-Key",
            got: shortened(&key, 80),
            expected: "1 … 255 characters, none of them a control character",
        })
    }
}
