//! Judging a problem before it becomes a job.

use serde::Serialize;
use solver::{Estimate, error::Violation, problem::Problem, solution::Warning};

use super::Service;
use crate::{digest, error::ApiError};

/// What there is to say about a problem.
#[derive(Clone, Debug, Serialize)]
pub struct Judgement {
    /// It would be accepted.
    pub valid: bool,
    /// Everything that is wrong with it.
    pub violations: Vec<Violation>,
    /// What to know before trusting its result.
    pub warnings: Vec<Warning>,
    /// What it would cost; absent when it is invalid.
    pub estimate: Option<Estimate>,
    /// Its fingerprint; absent when it could not be read.
    pub input_hash: Option<String>,
}

/// Where requests carry the problem; pointers start there.
pub const AT: &str = "/problem";

/// Judges a problem and stores nothing. An invalid one is an answer too, not an error.
pub async fn validate(
    service: &Service,
    problem: Result<Problem, Vec<Violation>>,
) -> Result<Judgement, ApiError> {
    let judgement = match problem {
        Ok(problem) => {
            let estimate = affordable(service, &problem)?;
            let input_hash = digest::input_hash(&problem).ok();
            match check(service, problem).await? {
                Ok((_, warnings)) => Judgement {
                    valid: true,
                    violations: vec![],
                    warnings,
                    estimate: Some(estimate),
                    input_hash,
                },
                Err(violations) => Judgement {
                    valid: false,
                    violations,
                    warnings: vec![],
                    estimate: None,
                    input_hash,
                },
            }
        }
        Err(violations) => Judgement {
            valid: false,
            violations,
            warnings: vec![],
            estimate: None,
            input_hash: None,
        },
    };
    Ok(judgement)
}

/// Admits a problem that is affordable and means something.
pub async fn admit(service: &Service, problem: Problem) -> Result<Problem, ApiError> {
    affordable(service, &problem)?;
    let (problem, _) = check(service, problem)
        .await?
        .map_err(ApiError::InvalidProblem)?;
    Ok(problem)
}

/// The estimate is made before anything is meshed: a mesh may be what we cannot afford.
fn affordable(service: &Service, problem: &Problem) -> Result<Estimate, ApiError> {
    let estimate = solver::estimate(problem);
    let budget_bytes = service.memory_budget_bytes;
    if estimate.memory_bytes > budget_bytes {
        return Err(ApiError::ProblemTooLarge {
            estimate,
            budget_bytes,
        });
    }
    Ok(estimate)
}

/// Meshes and checks on a blocking thread, a few at a time.
async fn check(
    service: &Service,
    problem: Problem,
) -> Result<Result<(Problem, Vec<Warning>), Vec<Violation>>, ApiError> {
    let _permit = service.checks.acquire().await.map_err(ApiError::internal)?;
    let checked = tokio::task::spawn_blocking(move || match solver::check(&problem) {
        Ok(warnings) => Ok((problem, warnings)),
        Err(violations) => Err(violations),
    });
    let checked = checked.await.map_err(ApiError::internal)?;
    Ok(checked.map_err(|violations| prefixed(AT, violations)))
}

/// Moves violations to where their subject stands in a request.
pub fn prefixed(prefix: &str, violations: Vec<Violation>) -> Vec<Violation> {
    violations
        .into_iter()
        .map(|v| Violation {
            pointer: format!("{prefix}{}", v.pointer),
            ..v
        })
        .collect()
}
