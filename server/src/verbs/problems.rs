//! Judging a problem before it becomes a job.

use schemars::JsonSchema;
use serde::Serialize;
use solver::{Estimate, error::Violation, mesh::Mesh, problem::Problem, solution::Warning};

use super::{Service, meshes};
use crate::{digest, error::ApiError, mesh::MeshInfo};

/// What there is to say about a problem.
#[derive(Clone, Debug, Serialize, JsonSchema)]
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
    let problem = match problem {
        Ok(problem) => problem,
        Err(violations) => return Ok(Judgement::invalid(violations, None)),
    };
    let budget_bytes = service.memory_budget_bytes;
    let stored = match stored(service, &problem).await {
        Err(ApiError::InvalidProblem(violations)) => {
            return Ok(Judgement::invalid(violations, None));
        }
        stored => stored?,
    };
    let judge = move || {
        let estimate = affordable(&problem, stored.as_ref(), budget_bytes)?;
        let input_hash = digest::input_hash(&problem).ok();
        Ok(match check(&problem, stored.as_ref()) {
            Ok(warnings) => Judgement {
                valid: true,
                violations: vec![],
                warnings,
                estimate: Some(estimate),
                input_hash,
            },
            Err(violations) => Judgement::invalid(violations, input_hash),
        })
    };
    service.work(judge).await?
}

impl Judgement {
    fn invalid(violations: Vec<Violation>, input_hash: Option<String>) -> Judgement {
        Judgement {
            valid: false,
            violations,
            warnings: vec![],
            estimate: None,
            input_hash,
        }
    }
}

/// A problem that was found good, as it is stored.
#[derive(Debug)]
pub struct Admitted {
    /// The title, which is the job's.
    pub title: Option<String>,
    /// Fingerprint of the rest.
    pub input_hash: String,
    /// The rest as JSON.
    pub json: String,
    /// The stored mesh that it names.
    pub mesh: Option<String>,
}

/// The stored mesh that a problem names, unless it would not be looked at anyway.
async fn stored(
    service: &Service,
    problem: &Problem,
) -> Result<Option<(MeshInfo, Mesh)>, ApiError> {
    match &problem.mesh.stored {
        Some(hash) => Ok(Some(meshes::load(service, hash).await?)),
        None => Ok(None),
    }
}

/// Admits a problem that is affordable and means something.
pub async fn admit(service: &Service, mut problem: Problem) -> Result<Admitted, ApiError> {
    let budget_bytes = service.memory_budget_bytes;
    let stored = stored(service, &problem).await?;
    let admit = move || {
        affordable(&problem, stored.as_ref(), budget_bytes)?;
        check(&problem, stored.as_ref()).map_err(ApiError::InvalidProblem)?;
        let input_hash = digest::input_hash(&problem).map_err(ApiError::internal)?;
        let title = problem.title.take();
        let json = serde_json::to_string(&problem).map_err(ApiError::internal)?;
        Ok(Admitted {
            title,
            input_hash,
            json,
            mesh: problem.mesh.stored,
        })
    };
    service.work(admit).await?
}

/// The estimate is made before anything is meshed: a mesh may be what we cannot afford.
fn affordable(
    problem: &Problem,
    stored: Option<&(MeshInfo, Mesh)>,
    budget_bytes: u64,
) -> Result<Estimate, ApiError> {
    let size = stored.map(|(info, _)| info.size());
    let estimate = solver::estimate(problem, size.as_ref());
    if estimate.memory_bytes > budget_bytes {
        return Err(ApiError::ProblemTooLarge {
            estimate,
            budget_bytes,
        });
    }
    Ok(estimate)
}

fn check(
    problem: &Problem,
    stored: Option<&(MeshInfo, Mesh)>,
) -> Result<Vec<Warning>, Vec<Violation>> {
    solver::check(problem, stored.map(|(_, mesh)| mesh))
        .map_err(|violations| prefixed(AT, violations))
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
