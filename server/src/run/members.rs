//! Solves members of a sweep that share a body, one after the other: for the worker and for `signorini sweep` alike.

use std::ops::ControlFlow;

use files::sweep::Plan;
use solver::{
    Prepared,
    error::SolveError,
    family::{Family, Member},
    mesh::External,
    problem::{MeshInput, Problem, Refine},
    solution::{Observer, Outcome, Progress},
};

use crate::{job::Reason, sweep::MemberRow};

/// What solving members tells; the answer is whether to go on.
pub enum Step<'a> {
    /// The solver is at work.
    Progress(Progress<'a>),
    /// A member is solved, or cannot be.
    Row(Box<MemberRow>),
}

/// Checks a problem, and factors and condenses its body or finds it: [`solver::prepare`].
pub type Prepare<'a> =
    dyn Fn(&Problem, Option<External>, &mut Observer<'_>) -> Result<Prepared, SolveError> + 'a;

/// Members on one body.
pub struct Members<'a> {
    /// All members of the sweep.
    pub plan: &'a Plan,
    /// The mesh of the base, for those without one of their own.
    pub mesh: &'a MeshInput,
    /// The mesh that a problem only names or quotes.
    pub external: &'a dyn Fn(&Problem) -> Option<External>,
    /// Prepares the first of them.
    pub prepare: &'a Prepare<'a>,
    /// Their body, once a member was found that has one.
    pub family: Option<Family>,
}

impl Members<'_> {
    /// Solves members, and tells each row; a failure is a row. An error ends all: the solver was stopped.
    pub fn solve(
        &mut self,
        numbers: &[usize],
        tell: &mut dyn FnMut(Step<'_>) -> ControlFlow<()>,
    ) -> Result<(), SolveError> {
        for (place, number) in numbers.iter().enumerate() {
            let row = match self.member(*number, &mut |progress| tell(Step::Progress(progress))) {
                Ok(member) if member.outcome == Outcome::Canceled => {
                    return Err(SolveError::Stopped);
                }
                Ok(member) => MemberRow::solved(*number, member),
                Err(Failed::Member(error)) => row_of(*number, error)?,
                // the others have the same body
                Err(Failed::Body(error)) => {
                    for number in &numbers[place..] {
                        let row = Box::new(row_of(*number, error.clone())?);
                        if tell(Step::Row(row)).is_break() {
                            return Err(SolveError::Stopped);
                        }
                    }
                    return Ok(());
                }
            };
            if tell(Step::Row(Box::new(row))).is_break() {
                return Err(SolveError::Stopped);
            }
        }
        Ok(())
    }

    fn member(&mut self, number: usize, observe: &mut Observer<'_>) -> Result<Member, Failed> {
        let problem = self.plan.problem(number).map_err(SolveError::Invalid)?;
        if let Some(family) = &mut self.family {
            match family.member(&problem, observe) {
                Err(SolveError::OtherBody) => {}
                solved => return Ok(solved?),
            }
        }
        let problem = match self.plan.changes_mesh() {
            true => problem,
            false => Problem {
                mesh: self.mesh.clone(),
                ..problem
            },
        };
        let external = (self.external)(&problem);
        if self.family.is_some() || is_alone(&problem) {
            let solution = solver::solve_on(&problem, external, observe)?;
            return Ok(Member::of(&solution.summary));
        }
        let prepared = (self.prepare)(&problem, external, observe);
        let prepared = prepared.map_err(|error| match error {
            SolveError::SingularSystem { .. } | SolveError::NonFinite { .. } => Failed::Body(error),
            error => Failed::Member(error),
        })?;
        let family = Family::of(prepared, &problem);
        // the first on a body is solved whole, as in the service: its balance of forces tells whether the body is sound
        let solution = self.family.insert(family).solution(&problem, observe)?;
        Ok(Member::of(&solution.summary))
    }
}

/// Whether a problem shares no body with others: it is solved on meshes of its own.
pub fn is_alone(problem: &Problem) -> bool {
    problem.solver.verifies() || matches!(problem.mesh.refine, Refine::Adaptive(_))
}

/// Why a member has no numbers.
enum Failed {
    Member(SolveError),
    /// The body that it shares with the others cannot be factored.
    Body(SolveError),
}

impl From<SolveError> for Failed {
    fn from(error: SolveError) -> Self {
        Failed::Member(error)
    }
}

/// The row of a member without numbers; an error if the solver was stopped.
pub fn row_of(number: usize, error: SolveError) -> Result<MemberRow, SolveError> {
    let reason = match error {
        SolveError::Stopped => return Err(error),
        SolveError::Invalid(violations) => return Ok(MemberRow::invalid(number, violations)),
        SolveError::SingularSystem { .. } | SolveError::Unheld { .. } => Reason::SingularSystem,
        SolveError::NonFinite { .. } => Reason::NonFinite,
        SolveError::ResourceExhausted { .. } => Reason::ResourceExhausted,
        SolveError::OtherBody => Reason::Internal,
    };
    Ok(MemberRow::failed(number, reason, error.to_string()))
}
