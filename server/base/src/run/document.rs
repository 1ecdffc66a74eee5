//! The document of a solved problem, as it is stored, served and written.

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

/// A solved problem, as it is stored, served and written.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Document {
    /// Scalars, extents, warnings, timings and fingerprints.
    pub summary: Summary,
    /// The iterations, one row each.
    pub history: Vec<TimedIteration>,
    /// Columns along each contact boundary, at all points where the solution is known, peaks included.
    pub profiles: BTreeMap<String, ContactProfile>,
    /// Columns along each contact boundary at the nodes only; served separately, and not part of a written document.
    #[serde(skip)]
    pub node_profiles: BTreeMap<String, ContactProfile>,
    /// Columns along each contact boundary at the points where friction acts only; served separately, and not part of a
    /// written document.
    #[serde(skip)]
    pub friction_profiles: BTreeMap<String, ContactProfile>,
    /// One entry for each load step of the problem.
    pub steps: Vec<Step>,
    /// Displacements and stresses at all nodes.
    pub fields: Fields,
    /// The elastic law by which stresses follow from displacements; with it, fields are stored compactly.
    #[serde(skip)]
    pub law: Law,
}

/// The end of one load step.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Step {
    /// The step's name in the problem, or its number from 0.
    pub name: String,
    /// Scalars, extents and warnings at the end of the step.
    pub summary: solver::solution::Summary,
    /// The iterations of this step.
    pub history: Vec<TimedIteration>,
    /// Columns along each contact boundary.
    pub profiles: BTreeMap<String, ContactProfile>,
    /// Columns along each contact boundary at the nodes only; not part of a written document.
    #[serde(skip)]
    pub node_profiles: BTreeMap<String, ContactProfile>,
    /// Columns along each contact boundary at the points where friction acts only; not part of a written document.
    #[serde(skip)]
    pub friction_profiles: BTreeMap<String, ContactProfile>,
}

/// The solver's summary, with timings and fingerprints.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct Summary {
    /// The summary that the solver has made.
    #[serde(flatten)]
    pub solution: solver::solution::Summary,
    /// Seconds by phase.
    pub timings: Timings,
    /// Whether the body was kept from an earlier job with the same mesh, materials, supports, loads and contact
    /// boundaries. It was then not assembled and factored again, which changes no number.
    #[serde(default)]
    pub body_reused: bool,
    /// The version of the program that solved the problem.
    pub solver_version: String,
    /// The fingerprint of the problem.
    pub input_hash: String,
    /// The fingerprint of the result.
    pub digest: String,
}

impl Document {
    /// The document of a solution, made on `threads` threads; [`SolveError::Stopped`] if `go_on` returns false.
    pub(super) fn new(
        problem: &Problem,
        solution: Solution,
        times: &Times,
        threads: usize,
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
        let digest = digest::digest(&solution, &input_hash, threads, go_on).map_err(non_finite)?;
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
