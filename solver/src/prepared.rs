//! A problem up to its iterations.

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
pub struct Prepared {
    /// The checked problem.
    pub model: Model,
    /// The body reduced to its contacts.
    pub body: ElasticBody,
}

/// Prepares a problem on its own mesh; adaptive refinement prepares it on each of several.
pub fn prepare(
    problem: &Problem,
    external: Option<External>,
    observe: &mut Observer<'_>,
) -> Result<Prepared, SolveError> {
    notify(observe, Progress::Phase(Phase::Mesh))?;
    Prepared::new(
        Model::new(problem, external).map_err(SolveError::Invalid)?,
        observe,
    )
}

/// Prepares a problem on another mesh of its body, with all boundaries, groups and node sets of its own.
pub fn prepare_on_mesh(
    problem: &Problem,
    mesh: Mesh,
    observe: &mut Observer<'_>,
) -> Result<Prepared, SolveError> {
    notify(observe, Progress::Phase(Phase::Mesh))?;
    let model = Model::on_mesh(problem, mesh.into()).map_err(SolveError::Invalid)?;
    Prepared::new(model, observe)
}

impl Prepared {
    /// Tells the warnings of a model, and factors and condenses its body.
    pub(crate) fn new(model: Model, observe: &mut Observer<'_>) -> Result<Prepared, SolveError> {
        for warning in &model.warnings {
            notify(observe, Progress::Warning(warning))?;
        }
        let body = ElasticBody::new(&model, observe)?;
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
