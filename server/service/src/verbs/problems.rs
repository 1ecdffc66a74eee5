//! The operation that checks a problem without storing it, and checks before a problem becomes a job.

use base::{
    caller::Caller,
    digest,
    mesh::MeshInfo,
    text::{count, size},
};
use futures_util::future::BoxFuture;
use schemars::JsonSchema;
use serde::Serialize;
use solver::{
    Checked, Estimate,
    error::{Reason, Violation},
    mesh::Mesh,
    problem::{Load, MeshInput, Problem, Refine},
    solution::Warning,
};

use super::{meshes, service::Service};
use crate::{
    error::ApiError,
    violations::{PROBLEM, prefixed},
};

/// The result of checking a problem.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Validation {
    /// Whether the problem would be accepted as a job whose time limit is not far below the estimated time.
    pub valid: bool,
    /// All violations of the problem.
    pub violations: Vec<Violation>,
    /// The warnings to consider before relying on the problem's result.
    pub warnings: Vec<Warning>,
    /// The estimated cost of the problem, also of an invalid one; absent if the problem or its stored mesh cannot be read.
    /// With adaptive refinement, the cost of the largest mesh that it may come to: most problems end far below.
    pub estimate: Option<Estimate>,
    /// With adaptive refinement: the estimated cost of the first mesh, below which the problem cannot be solved.
    pub first_mesh: Option<Estimate>,
    /// The fingerprint of the problem; absent if `estimate` is absent.
    pub input_hash: Option<String>,
    /// The problem in words; absent if it cannot be read.
    pub description: Option<String>,
}

/// The problem of a deck.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Converted {
    /// The problem.
    pub problem: Problem,
    /// What the solver treats differently from the program that the deck was written for.
    pub warnings: Vec<Warning>,
}

/// Reads a deck of Abaqus or CalculiX as a problem; stores nothing. The violations of what is not understood have their lines.
pub fn convert<'a>(
    service: &'a Service,
    _caller: &'a Caller,
    deck: String,
) -> BoxFuture<'a, Result<Converted, ApiError>> {
    Box::pin(async move {
        let read = service.work(move || files::abaqus::problem_with_warnings(&deck));
        let (problem, warnings) = read.await?.map_err(ApiError::InvalidProblem)?;
        Ok(Converted { problem, warnings })
    })
}

/// Checks a problem and stores nothing. The violations of an invalid problem are returned as the result, not as an
/// error.
pub fn validate<'a>(
    service: &'a Service,
    caller: &'a Caller,
    problem: Result<Problem, Vec<Violation>>,
) -> BoxFuture<'a, Result<Validation, ApiError>> {
    Box::pin(async move {
        let problem = match problem {
            Ok(problem) => problem,
            Err(violations) => return Ok(Validation::unread(violations)),
        };
        let budget_bytes = service.largest_job_bytes();
        let stored = match stored(service, caller, &problem).await {
            Err(ApiError::InvalidProblem(violations)) => {
                return Ok(Validation::unread(violations));
            }
            stored => stored?,
        };
        let check = move || {
            let within = |estimate: Estimate| {
                if estimate.memory_bytes > budget_bytes {
                    Err(vec![too_large(&problem, &estimate, budget_bytes)])
                } else {
                    Ok(())
                }
            };
            // told by the checked problem, which has all numbers; of an invalid one only by what comes before meshing
            let (mut estimate, mut first_mesh) = (None, None);
            let checked = || {
                let before = self::estimate(&problem, stored.as_ref()).map_err(|v| vec![v])?;
                estimate = Some(before);
                within(before)?;
                let checked = check(&problem, stored)?;
                estimate = Some(checked.estimate);
                first_mesh = checked.first_mesh;
                within(checked.estimate)?;
                Ok(checked.warnings)
            };
            let (warnings, violations) = match checked() {
                Ok(warnings) => (warnings, vec![]),
                Err(violations) => (vec![], violations),
            };
            let at = |warning: Warning| Warning {
                pointer: format!("{PROBLEM}{}", warning.pointer),
                ..warning
            };
            Validation {
                valid: violations.is_empty(),
                violations,
                warnings: warnings.into_iter().map(at).collect(),
                estimate,
                first_mesh,
                input_hash: digest::input_hash(&problem).ok(),
                description: Some(files::plot::description(&problem)),
            }
        };
        service.work(check).await
    })
}

impl Validation {
    fn unread(violations: Vec<Violation>) -> Validation {
        Validation {
            valid: false,
            violations,
            warnings: vec![],
            estimate: None,
            first_mesh: None,
            input_hash: None,
            description: None,
        }
    }
}

/// The violation of a problem that exceeds the memory budget.
fn too_large(problem: &Problem, estimate: &Estimate, budget_bytes: u64) -> Violation {
    let pointer = match problem.mesh.refine {
        Refine::Times(0) => format!("{PROBLEM}/mesh"),
        Refine::Times(_) | Refine::Adaptive(_) => format!("{PROBLEM}/mesh/refine"),
    };
    too_large_at(pointer, estimate, budget_bytes)
}

/// The violation of a problem that exceeds the memory budget, at the place `pointer` of a request.
pub(super) fn too_large_at(pointer: String, estimate: &Estimate, budget_bytes: u64) -> Violation {
    let (unknowns, memory) = (count(estimate.dofs), size(estimate.memory_bytes));
    Violation {
        pointer,
        reason: Reason::TooLarge,
        got: format!("{unknowns} unknowns, which need about {memory}"),
        expected: format!("at most {} of memory", size(budget_bytes)),
        hint: "Use a coarser mesh or less refinement, or ask the operator for a larger budget."
            .into(),
    }
}

/// The estimated time of a problem (seconds). `None` for adaptive refinement, whose estimate is only the time of the
/// largest allowed mesh, which few problems need.
pub(super) fn expected_run_s(problem: &Problem, run_s: f64) -> Option<f64> {
    (!matches!(problem.mesh.refine, Refine::Adaptive(_))).then_some(run_s)
}

/// A problem that was found valid, in the form in which it is stored.
#[derive(Debug)]
pub(super) struct Admitted {
    /// The title of the problem, which becomes the title of the job.
    pub title: Option<String>,
    /// The problem without its title, as JSON.
    pub json: String,
    /// The hash of the stored mesh that the problem refers to.
    pub mesh: Option<String>,
    /// The estimated memory (bytes).
    pub memory_bytes: u64,
    /// The estimated time (seconds); `None` for adaptive refinement.
    pub run_s: Option<f64>,
}

/// Loads the stored mesh that a problem refers to; `None` if it refers to none.
pub(super) async fn stored(
    service: &Service,
    caller: &Caller,
    problem: &Problem,
) -> Result<Option<(MeshInfo, Mesh)>, ApiError> {
    match problem.mesh.stored() {
        Some(hash) => Ok(Some(meshes::load(service, caller, hash).await?)),
        None => Ok(None),
    }
}

/// Admits a problem if it is valid and within the memory budget (bytes). `stored`: the stored mesh that it refers to.
pub(super) fn admit(
    mut problem: Problem,
    stored: Option<(MeshInfo, Mesh)>,
    budget_bytes: u64,
) -> Result<Admitted, ApiError> {
    let within = |estimate: Estimate| {
        if estimate.memory_bytes > budget_bytes {
            Err(ApiError::ProblemTooLarge {
                estimate,
                budget_bytes,
            })
        } else {
            Ok(estimate)
        }
    };
    let before = estimate(&problem, stored.as_ref());
    within(before.map_err(|violation| ApiError::InvalidProblem(vec![violation]))?)?;
    let checked = check(&problem, stored).map_err(ApiError::InvalidProblem)?;
    let Estimate {
        memory_bytes,
        run_s,
        ..
    } = within(checked.estimate)?;
    let title = problem.title.take();
    let json = serde_json::to_string(&problem).map_err(ApiError::internal)?;
    Ok(Admitted {
        title,
        json,
        mesh: problem.mesh.stored().map(str::to_owned),
        memory_bytes,
        run_s: expected_run_s(&problem, run_s),
    })
}

/// The stored mesh of a problem whose first mesh is within the memory budget (bytes): what is drawn needs no more.
pub(super) fn first_mesh_within(
    problem: &Problem,
    stored: Option<(MeshInfo, Mesh)>,
    budget_bytes: u64,
) -> Result<Option<Mesh>, ApiError> {
    let own = Problem {
        mesh: MeshInput {
            refine: match problem.mesh.refine {
                Refine::Adaptive(_) => Refine::Times(0),
                times => times,
            },
            ..problem.mesh.clone()
        },
        ..problem.clone()
    };
    let estimate = estimate(&own, stored.as_ref());
    let estimate = estimate.map_err(|violation| ApiError::InvalidProblem(vec![violation]))?;
    if estimate.memory_bytes > budget_bytes {
        return Err(ApiError::ProblemTooLarge {
            estimate,
            budget_bytes,
        });
    }
    check(&own, stored.clone()).map_err(ApiError::InvalidProblem)?;
    Ok(stored.map(|(_, mesh)| mesh))
}

/// Estimates the cost of a problem before it is meshed, since the mesh itself may need too much memory.
fn estimate(problem: &Problem, stored: Option<&(MeshInfo, Mesh)>) -> Result<Estimate, Violation> {
    let size = stored.map(|(info, _)| info.size());
    let within = |violation| prefixed(PROBLEM, vec![violation]).remove(0);
    solver::estimate(problem, size.as_ref()).map_err(within)
}

fn check(problem: &Problem, stored: Option<(MeshInfo, Mesh)>) -> Result<Checked, Vec<Violation>> {
    let by_set = |load: &Load| matches!(load, Load::Force(..));
    let lacks = |(info, mesh): &(MeshInfo, Mesh)| info.lacks_added_midsides(mesh);
    if stored.as_ref().is_some_and(lacks) && problem.loads.iter().any(by_set) {
        let violation = Violation::new(
            "/mesh/stored",
            Reason::UnknownMesh,
            "a mesh stored by an earlier version, with added midsides in its sets of nodes",
            "a mesh whose sets have only the nodes of its file, for a force on each of them",
            "Delete the mesh, and upload its file again.",
        );
        return Err(prefixed(PROBLEM, vec![violation]));
    }
    let external = files::external_mesh(problem, stored.map(|(_, mesh)| mesh));
    solver::check(problem, external).map_err(|violations| prefixed(PROBLEM, violations))
}
