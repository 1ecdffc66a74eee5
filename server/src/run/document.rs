//! What a solved problem is stored, served and written as.

use std::collections::BTreeMap;

use files::columns::Law;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use solver::{
    error::SolveError,
    problem::Problem,
    solution::{ContactProfile, Fields, Solution, StepSolution},
};

use super::stopwatch::{Times, Timings};
use crate::{digest, event::TimedIteration};

/// What a solved problem is stored, served and written as.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Document {
    /// Scalars, extents, warnings, timings and fingerprints.
    pub summary: Summary,
    /// One row per iteration.
    pub history: Vec<TimedIteration>,
    /// Columns along each contact boundary, at all points where the solution is known, peaks included.
    pub profiles: BTreeMap<String, ContactProfile>,
    /// The same at the nodes; served by itself, and no part of a written document.
    #[serde(skip)]
    pub node_profiles: BTreeMap<String, ContactProfile>,
    /// The same at the points where friction acts; as `node_profiles`.
    #[serde(skip)]
    pub friction_profiles: BTreeMap<String, ContactProfile>,
    /// One entry per load step of the problem.
    pub steps: Vec<Step>,
    /// Displacements and stresses at all nodes.
    pub fields: Fields,
    /// By which stresses follow from displacements: fields are stored compactly with it.
    #[serde(skip)]
    pub law: Law,
}

/// The end of one load step.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Step {
    /// Its name in the problem, or its number from 0.
    pub name: String,
    /// As of a whole solution.
    pub summary: solver::solution::Summary,
    /// Rows of this step.
    pub history: Vec<TimedIteration>,
    /// Columns along each contact boundary.
    pub profiles: BTreeMap<String, ContactProfile>,
    /// As of a whole document; no part of a written one here either.
    #[serde(skip)]
    pub node_profiles: BTreeMap<String, ContactProfile>,
    /// As of a whole document; no part of a written one here either.
    #[serde(skip)]
    pub friction_profiles: BTreeMap<String, ContactProfile>,
}

/// The solver's summary, and what only its caller knows.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct Summary {
    /// What the solver says.
    #[serde(flatten)]
    pub solution: solver::solution::Summary,
    /// Seconds by phase.
    pub timings: Timings,
    /// Its body was kept from an earlier job with the same mesh, materials, supports, loads and contact boundaries: it was
    /// not assembled and factored again, which changes no number.
    #[serde(default)]
    pub body_reused: bool,
    /// The program that solved it.
    pub solver_version: String,
    /// Fingerprint of the problem.
    pub input_hash: String,
    /// Fingerprint of the result.
    pub digest: String,
}

impl Document {
    /// A solution with what only its caller knows; [`SolveError::Stopped`] if `go_on` says no.
    pub(super) fn new(
        problem: &Problem,
        solution: Solution,
        times: &Times,
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<Document, SolveError> {
        let non_finite = SolveError::NonFinite {
            phase: solver::solution::Phase::Recover,
        };
        if !solution.is_finite() {
            return Err(non_finite);
        }
        let non_finite = |_| non_finite.clone();
        let input_hash = digest::input_hash(problem).map_err(non_finite)?;
        let digest = digest::digest(&solution, &input_hash, go_on).map_err(non_finite)?;
        let digest = digest.ok_or(SolveError::Stopped)?;
        let Solution {
            summary,
            history,
            profiles,
            node_profiles,
            friction_profiles,
            steps,
            fields,
        } = solution;
        let solver_version = env!("CARGO_PKG_VERSION").to_string();
        let summary = Summary {
            solution: summary,
            timings: times.phases.clone(),
            body_reused: !times.factored,
            solver_version,
            input_hash,
            digest,
        };
        let step = |step| Step::new(step, times);
        Ok(Document {
            summary,
            history: times.of(history),
            profiles,
            node_profiles,
            friction_profiles,
            steps: steps.into_iter().map(step).collect(),
            fields,
            law: Law::of(problem),
        })
    }
}

impl Step {
    fn new(step: StepSolution, times: &Times) -> Step {
        let StepSolution {
            name,
            summary,
            history,
            profiles,
            node_profiles,
            friction_profiles,
        } = step;
        Step {
            name,
            summary,
            history: times.of(history),
            profiles,
            node_profiles,
            friction_profiles,
        }
    }
}
