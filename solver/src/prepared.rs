//! A problem that is ready for its iterations.

use std::sync::Arc;

use crate::body::ElasticBody;
use crate::error::SolveError;
use crate::mesh::{External, Mesh};
use crate::model::Model;
use crate::observer::{Observer, Progress, notify};
use crate::problem::Problem;
use crate::solution::{Phase, Solution};
use crate::steps;

/// A problem that is ready for its iterations: checked, and its body factored and condensed onto its contacts.
///
/// This is most of the work, and problems that differ only in friction, indentation, drag, load steps or tolerances
/// share it. (An obstacle of another shape may face other nodes, or turn their normals.) Errors are always estimated
/// here, whatever `solver.accuracy` is; [`solve`](crate::solve) verifies them.
#[derive(Clone)]
pub struct Prepared {
    /// The checked problem.
    pub model: Model,
    /// The body reduced to its contacts, which other problems may share.
    pub body: Arc<ElasticBody>,
}

/// Checks a problem on its own mesh, and factors and condenses its body; `external` is the mesh that the problem only
/// names or contains as text.
///
/// # Errors
///
/// [`SolveError::Invalid`] with all violations of the problem; [`SolveError::SingularSystem`], `ResourceExhausted` or
/// `NonFinite` if the body cannot be factored; [`SolveError::Stopped`] if the observer says so.
pub fn prepare(
    problem: &Problem,
    external: Option<External>,
    observer: &mut dyn Observer,
) -> Result<Prepared, SolveError> {
    Prepared::new(checked(problem, external, observer)?, observer)
}

/// Checks a problem, and passes its warnings to the observer: the part of [`prepare`] before the body.
///
/// # Errors
///
/// [`SolveError::Invalid`] with all violations of the problem; [`SolveError::Stopped`] if the observer says so.
pub fn checked(
    problem: &Problem,
    external: Option<External>,
    observer: &mut dyn Observer,
) -> Result<Model, SolveError> {
    notify(observer, Progress::Phase(Phase::Mesh))?;
    let model = Model::new(problem, external).map_err(SolveError::Invalid)?;
    tell_warnings(&model, observer)?;
    Ok(model)
}

/// Prepares a problem like [`prepare`], on another mesh of its body; this mesh must have all boundaries, groups and
/// node sets itself.
///
/// # Errors
///
/// The errors of [`prepare`].
pub fn prepare_on_mesh(
    problem: &Problem,
    mesh: Mesh,
    observer: &mut dyn Observer,
) -> Result<Prepared, SolveError> {
    notify(observer, Progress::Phase(Phase::Mesh))?;
    let model = Model::on_mesh(problem, mesh.into()).map_err(SolveError::Invalid)?;
    tell_warnings(&model, observer)?;
    Prepared::new(model, observer)
}

pub(crate) fn tell_warnings(model: &Model, observer: &mut dyn Observer) -> Result<(), SolveError> {
    let mut warnings = model.warnings.iter();
    warnings.try_for_each(|warning| notify(observer, Progress::Warning(warning)))
}

impl Prepared {
    /// Factors and condenses the body of a model.
    ///
    /// # Errors
    ///
    /// [`SolveError::SingularSystem`], `ResourceExhausted` or `NonFinite` if the body cannot be factored;
    /// [`SolveError::Stopped`] if the observer says so.
    pub fn new(model: Model, observer: &mut dyn Observer) -> Result<Prepared, SolveError> {
        let body = Arc::new(ElasticBody::new(&model, observer)?);
        Ok(Prepared { model, body })
    }

    /// Solves contact and friction on the prepared body, load step by load step.
    ///
    /// # Errors
    ///
    /// [`SolveError::Unheld`] if nothing holds the body in its final state; `ResourceExhausted` or `NonFinite` if a
    /// state cannot be computed; [`SolveError::Stopped`] if the observer says so before there is a state.
    pub fn solve(&self, observer: &mut dyn Observer) -> Result<Solution, SolveError> {
        steps::run(&self.model, &self.body, None, observer)
    }

    /// Solves another problem on this body; `None` if the body of `model` is not the same.
    ///
    /// # Errors
    ///
    /// The errors of [`Prepared::solve`].
    pub fn solve_other(
        &self,
        model: &Model,
        observer: &mut dyn Observer,
    ) -> Option<Result<Solution, SolveError>> {
        ElasticBody::same(&self.model, model).then(|| steps::run(model, &self.body, None, observer))
    }
}

impl std::fmt::Debug for Prepared {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Prepared")
    }
}
