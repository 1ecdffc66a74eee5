//! A problem up to its iterations.

use std::sync::Arc;

use crate::body::{ElasticBody, notify};
use crate::error::SolveError;
use crate::mesh::{External, Mesh};
use crate::model::Model;
use crate::problem::Problem;
use crate::solution::{Observer, Phase, Progress, Solution};
use crate::steps;

/// A problem up to its iterations: checked, and its body factored and condensed onto its contacts.
///
/// This is most of the work, and problems that differ only in friction, indentation, drag, load steps or tolerances
/// share it. (An obstacle of another shape may face other nodes, or turn their normals.) Errors are estimated here, whatever
/// `solver.accuracy` is: [`solve`](crate::solve) verifies them.
#[derive(Clone)]
pub struct Prepared {
    /// The checked problem.
    pub model: Model,
    /// The body reduced to its contacts, which other problems may share.
    pub body: Arc<ElasticBody>,
}

/// Prepares a problem on its own mesh; adaptive refinement prepares it on each of several.
pub fn prepare(
    problem: &Problem,
    external: Option<External>,
    observe: &mut Observer<'_>,
) -> Result<Prepared, SolveError> {
    Prepared::new(checked(problem, external, observe)?, observe)
}

/// Checks a problem and tells its warnings: what comes before its body.
pub fn checked(
    problem: &Problem,
    external: Option<External>,
    observe: &mut Observer<'_>,
) -> Result<Model, SolveError> {
    notify(observe, Progress::Phase(Phase::Mesh))?;
    let model = Model::new(problem, external).map_err(SolveError::Invalid)?;
    tell_warnings(&model, observe)?;
    Ok(model)
}

/// Prepares a problem on another mesh of its body, with all boundaries, groups and node sets of its own.
pub fn prepare_on_mesh(
    problem: &Problem,
    mesh: Mesh,
    observe: &mut Observer<'_>,
) -> Result<Prepared, SolveError> {
    notify(observe, Progress::Phase(Phase::Mesh))?;
    let model = Model::on_mesh(problem, mesh.into()).map_err(SolveError::Invalid)?;
    tell_warnings(&model, observe)?;
    Prepared::new(model, observe)
}

pub(crate) fn tell_warnings(model: &Model, observe: &mut Observer<'_>) -> Result<(), SolveError> {
    let mut warnings = model.warnings.iter();
    warnings.try_for_each(|warning| notify(observe, Progress::Warning(warning)))
}

impl Prepared {
    /// Factors and condenses the body of a model.
    pub fn new(model: Model, observe: &mut Observer<'_>) -> Result<Prepared, SolveError> {
        let body = Arc::new(ElasticBody::new(&model, observe)?);
        Ok(Prepared { model, body })
    }

    /// Contact and friction, load step by load step.
    pub fn solve(&self, observe: &mut Observer<'_>) -> Result<Solution, SolveError> {
        steps::run(&self.model, &self.body, None, observe)
    }

    /// Solves another problem on this body; `None`: its body is not the same.
    pub fn solve_other(
        &self,
        model: &Model,
        observe: &mut Observer<'_>,
    ) -> Option<Result<Solution, SolveError>> {
        ElasticBody::same(&self.model, model).then(|| steps::run(model, &self.body, None, observe))
    }
}

impl std::fmt::Debug for Prepared {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Prepared")
    }
}
