//! Frictional contact in linear elasticity by finite elements, with the nonlocal, nonlinear law of
//! Oden and Pires (A.C. Bolt, MSc thesis, University of Cape Town, 1983). Comments cite the thesis by its
//! numbers, and docs/formulation.md as "formulation 4.3".
//!
//! A library of pure functions: no clock, thread, file or network; the same problem gives the same
//! bits. Reading and writing of any format is the business of the crate `files`. From the ground up; each
//! room uses only rooms in the groups above it.

// What is asked and answered, as plain data; violations and errors; numbers that are none.
pub mod error;
pub mod finite;
pub mod phase;
pub mod problem;
pub mod solution;

// Pure maths on numbers: master elements and rules; matrices (the one room that names faer).
pub mod element;
pub mod linear;

// The friction law, along arc length only; nodes, elements and named boundaries.
pub mod friction;
pub mod mesh;

// A standard elastic program; the geometry of the contact boundary.
pub mod contact;
pub mod elasticity;

// Every check: the only door to a problem that can be solved.
pub mod model;

// The body as felt from the contact boundary: one factorisation, then a small dense system.
pub mod body;

// Contact and friction on that system.
pub mod algorithm;

// Load steps, one after the other.
pub mod steps;

// Finer and finer grids until the results settle.
pub mod adapt;

use body::ElasticBody;
use error::{SolveError, Violation};
use mesh::External;
use model::Model;
use problem::{Problem, Refine};
use solution::{Observer, Phase, Progress, Solution, Warning};

/// Solves a problem: the whole flow on one screen.
///
/// `observe` is told every phase and iteration and may break off: then the last state comes back
/// as `Outcome::Canceled`, or `SolveError::Stopped` when there is none yet.
pub fn solve(problem: &Problem, observe: &mut Observer<'_>) -> Result<Solution, SolveError> {
    solve_on(problem, None, observe)
}

/// Solves a problem that may only name or quote its mesh: `external` is what was read.
pub fn solve_on(
    problem: &Problem,
    external: Option<External>,
    observe: &mut Observer<'_>,
) -> Result<Solution, SolveError> {
    match problem.mesh.refine {
        Refine::Times(_) => prepare(problem, external, observe)?.solve(observe),
        Refine::Adaptive(goal) => {
            let model = Model::new(problem, external).map_err(SolveError::Invalid)?;
            let contacts = model.contacts;
            // only grids are refined so, and a grid stands in the problem itself
            let solve = |problem: &Problem, observe: &mut Observer<'_>| {
                prepare(problem, None, observe)?.solve(observe)
            };
            adapt::run(problem, &goal, &contacts, &solve, observe)
        }
    }
}

/// A problem up to its iterations: checked, and its body factored and condensed onto its contacts.
///
/// What comes before the iterations is most of the work, and problems that differ in friction, indentation, drag,
/// load steps or tolerances only have the same body. (An obstacle of another shape may face other nodes, or turn their
/// normals.)
pub struct Prepared {
    /// What is to be solved.
    pub model: Model,
    /// The body as felt from its contacts.
    pub body: ElasticBody,
}

/// Prepares a problem on the one mesh that it gives; adaptive refinement goes through several.
pub fn prepare(
    problem: &Problem,
    external: Option<External>,
    observe: &mut Observer<'_>,
) -> Result<Prepared, SolveError> {
    notify(observe, Progress::Phase(Phase::Mesh))?;
    let model = Model::new(problem, external).map_err(SolveError::Invalid)?;
    for warning in &model.warnings {
        notify(observe, Progress::Warning(warning))?;
    }
    let body = ElasticBody::new(&model, observe)?;
    Ok(Prepared { model, body })
}

impl Prepared {
    /// Contact and friction, load step by load step.
    pub fn solve(&self, observe: &mut Observer<'_>) -> Result<Solution, SolveError> {
        steps::run(&self.model, &self.body, observe)
    }

    /// Solves another problem on this body; `None`: its body is not the same.
    pub fn solve_other(
        &self,
        model: &Model,
        observe: &mut Observer<'_>,
    ) -> Option<Result<Solution, SolveError>> {
        ElasticBody::same(&self.model, model).then(|| steps::run(model, &self.body, observe))
    }
}

/// Checks a problem without solving it: its warnings, or everything that is wrong with it.
pub fn check(
    problem: &Problem,
    external: Option<External>,
) -> Result<Vec<Warning>, Vec<Violation>> {
    Model::new(problem, external).map(|model| model.warnings)
}

fn notify(observe: &mut Observer<'_>, progress: Progress<'_>) -> Result<(), SolveError> {
    match observe(progress).is_break() {
        true => Err(SolveError::Stopped),
        false => Ok(()),
    }
}

pub use model::estimate::{Estimate, MeshSize, estimate};

#[cfg(test)]
mod tests {
    #[test]
    #[should_panic(expected = "attempt to add with overflow")]
    fn an_overflow_is_a_panic_in_the_profile_that_ships() {
        let most = std::hint::black_box(u32::MAX);
        std::hint::black_box(most + 1);
    }
}
