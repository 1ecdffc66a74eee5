//! Solves members of a sweep that share a body, one after another, both for the worker and for `signorini sweep`. A
//! later attempt stores no row a second time, and solves a member with a stored row only if other members start from
//! it.

use files::sweep::{Group, Neighbour, Plan, Problems, has_own_meshes};
use solver::{
    Prepared,
    error::SolveError,
    family::{End, Family, Member, Start},
    mesh::External,
    observer::Observer,
    problem::{MeshInput, Problem},
    solution::{Outcome, Verdict},
};

use crate::{job::Reason, sweep::MemberRow};

/// A function that checks a problem and prepares its body, which is made or reused: see [`solver::prepare`].
pub type Prepare<'a> =
    dyn Fn(&Problem, Option<External>, &mut dyn Observer) -> Result<Prepared, SolveError> + 'a;

/// The members of a group of a sweep, which may share a body.
pub struct Members<'a> {
    plan: &'a Plan,
    problems: Problems<'a>,
    /// All members of the group, in order.
    group: &'a Group,
    /// The mesh of the sweep's base problem, for members without a mesh of their own.
    mesh: &'a MeshInput,
    /// Reads the mesh that a problem only names or contains as text.
    external: &'a dyn Fn(&Problem) -> Option<External>,
    /// Prepares the body of the first member that is solved.
    prepare: &'a Prepare<'a>,
    /// The common body, once a member on it was prepared.
    family: Option<Family>,
    /// Why the common body cannot be factored, so that no member on it can be solved.
    unsound: Option<SolveError>,
    /// By line of the sweep: the last member that was solved on the line, with its end, or with its neighbour's end if
    /// it has none.
    lines: Vec<Option<(usize, Option<End>)>>,
}

impl<'a> Members<'a> {
    /// The members `group` of a plan, with the mesh of its base. `external` reads meshes that problems name; `family`
    /// is the common body, if it is known.
    pub fn new(
        plan: &'a Plan,
        group: &'a Group,
        mesh: &'a MeshInput,
        external: &'a dyn Fn(&Problem) -> Option<External>,
        prepare: &'a Prepare<'a>,
        family: Option<Family>,
    ) -> Self {
        Members {
            plan,
            problems: Problems::new(plan),
            group,
            mesh,
            external,
            prepare,
            family,
            unsound: None,
            lines: (0..plan.lines()).map(|_| None).collect(),
        }
    }

    /// Solves the member with this number; members are solved in order. A failure is returned as a row; an error means
    /// that the solver was stopped.
    pub fn row(
        &mut self,
        number: usize,
        observer: &mut dyn Observer,
    ) -> Result<MemberRow, SolveError> {
        if let Some(error) = &self.unsound {
            return row_of(number, error.clone());
        }
        match self.member(number, observer) {
            Ok(member) if member.outcome == Outcome::Canceled => Err(SolveError::Stopped),
            Ok(mut member) => {
                if member.verdict.is_none() && self.group.last() == Some(&number) {
                    member.verdict = self.verdict(number, observer)?;
                }
                Ok(MemberRow::solved(number, member))
            }
            Err(Failed::Member(error)) => row_of(number, error),
            // the others have the same body
            Err(Failed::Body(error)) => row_of(number, self.unsound.insert(error).clone()),
        }
    }

    /// The verdict on a member's own solution on the common body; an error if the solver was stopped.
    fn verdict(
        &self,
        number: usize,
        observer: &mut dyn Observer,
    ) -> Result<Option<Verdict>, SolveError> {
        let problem = self.plan.whole_problem(number, self.mesh);
        let (Some(family), Ok(problem)) = (&self.family, problem) else {
            return Ok(None);
        };
        match family.solution(&problem, observer) {
            Err(SolveError::Stopped) => Err(SolveError::Stopped),
            Err(_) => Ok(None),
            Ok(solution) if solution.summary.outcome == Outcome::Canceled => {
                Err(SolveError::Stopped)
            }
            Ok(solution) => Ok(Member::of(&solution.summary).verdict),
        }
    }

    fn member(&mut self, number: usize, observer: &mut dyn Observer) -> Result<Member, Failed> {
        if self.family.is_some() {
            for ancestor in self.missing(number) {
                // what is wrong with it is told in its own row
                if let Err(SolveError::Stopped) = self.on_body(ancestor, observer) {
                    return Err(Failed::Member(SolveError::Stopped));
                }
            }
            match self.on_body(number, observer) {
                Err(SolveError::OtherBody) => {}
                solved => return Ok(solved?),
            }
        }
        let problem = self.plan.whole_problem(number, self.mesh);
        let problem = problem.map_err(SolveError::Invalid)?;
        let external = (self.external)(&problem);
        if self.family.is_some() || is_alone(&problem) {
            let solution = solver::solve_on(&problem, external, observer)?;
            return Ok(Member::of(&solution.summary));
        }
        let prepared = (self.prepare)(&problem, external, observer);
        let prepared = prepared.map_err(|error| match error {
            SolveError::SingularSystem { .. } | SolveError::NonFinite { .. } => Failed::Body(error),
            error => Failed::Member(error),
        })?;
        let family = self.family.insert(Family::of(prepared, &problem));
        if self.group.first() == Some(&number) {
            // it is solved whole, as in the service: its balance of forces tells whether the body is sound
            return Ok(family.whole_member(&problem, observer)?);
        }
        // the first one was refused, or was solved before a restart
        self.member(number, observer)
    }

    /// The members from which the member starts, directly or not, and whose ends are not known, in the order in which
    /// they must be solved.
    fn missing(&self, number: usize) -> Vec<usize> {
        let mut missing = Vec::new();
        let mut next = self.neighbour(number);
        while let Some(neighbour) = next {
            let known = self.lines.iter().flatten();
            if known.clone().any(|(number, _)| *number == neighbour.number) {
                break;
            }
            missing.push(neighbour.number);
            next = self.neighbour(neighbour.number);
        }
        missing.reverse();
        missing
    }

    fn neighbour(&self, number: usize) -> Option<Neighbour> {
        let place = self.group.binary_search(&number).ok()?;
        self.plan.neighbour(self.group, place)
    }

    /// Solves a member on the common body; it starts from its neighbour, whose end is known.
    fn on_body(
        &mut self,
        number: usize,
        observer: &mut dyn Observer,
    ) -> Result<Member, SolveError> {
        let neighbour = self.neighbour(number);
        let Some(family) = &mut self.family else {
            return Err(SolveError::OtherBody);
        };
        let from = neighbour.and_then(|neighbour| {
            let mut known = self.lines.iter().flatten();
            let (_, end) = known.find(|(known, _)| *known == neighbour.number)?;
            Some((neighbour, end.as_ref()?))
        });
        let start = match from {
            None => Start::Anew,
            // members are solved in order: it was the last one
            Some((neighbour, end)) if neighbour.adjacent => Start::Next(end),
            Some((_, end)) => Start::Near(end),
        };
        let solved = match self.problems.read(number) {
            Ok(read) => family.member(read.problem, start, observer),
            Err(violations) => Err(SolveError::Invalid(violations)),
        };
        let (member, end) = match solved {
            Ok((member, end)) => (Ok(member), end),
            Err(error) => (Err(error), None),
        };
        let end = end.or_else(|| from.map(|(_, end)| end.clone()));
        let line = neighbour.map_or(0, |neighbour| neighbour.line);
        self.lines[line] = Some((number, end));
        member
    }
}

/// Whether a problem shares its body with no other, since it is solved on meshes of its own.
pub fn is_alone(problem: &Problem) -> bool {
    has_own_meshes(problem, &problem.mesh.refine)
}

/// Why a member has no results.
enum Failed {
    Member(SolveError),
    /// The common body cannot be factored.
    Body(SolveError),
}

impl From<SolveError> for Failed {
    fn from(error: SolveError) -> Self {
        Failed::Member(error)
    }
}

/// The row of a member without results; an error if the solver was stopped.
pub fn row_of(number: usize, error: SolveError) -> Result<MemberRow, SolveError> {
    let reason = match error {
        SolveError::Stopped => return Err(error),
        SolveError::Invalid(violations) => return Ok(MemberRow::invalid(number, violations)),
        SolveError::SingularSystem { .. }
        | SolveError::Unheld { .. }
        | SolveError::BodiesUnheld
        | SolveError::ObstacleUnheld { .. } => Reason::SingularSystem,
        SolveError::NonFinite { .. } => Reason::NonFinite,
        SolveError::ResourceExhausted { .. } => Reason::ResourceExhausted,
        SolveError::OtherBody => Reason::Internal,
    };
    Ok(MemberRow::failed(number, reason, error.to_string()))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use files::sweep::{Variation, read};
    use serde_json::json;

    use super::*;

    /// Rows do not depend on which members were solved before: after a restart of the service, the remaining members
    /// have the same bits.
    #[test]
    fn rows_do_not_depend_on_which_members_were_solved_before() {
        let base = json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"grid": {"x": [0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1, 2], "y": [-2, -1, -0.5, -0.2, 0]}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "left", "ux": 0}, {"boundary": "bottom", "ux": 0, "uy": 0}],
            "contacts": [{"boundary": "top", "obstacle": {"kind": "circle", "radius": 8}, "indentation": 0.02,
                "friction": {"coefficient": 0.3, "nonlocal_radius": 0.05, "elastic_slip": 1e-4}}]
        });
        // a member that is wrong, which is refused before as a rule, is in the middle, or the first
        for coefficients in [[0.1, 0.2, -1.0, 0.4], [-1.0, 0.2, 0.1, 0.4]] {
            let axes = json!([
                {"path": "/contacts/0/friction/coefficient", "values": coefficients},
                {"path": "/contacts/0/friction/nonlocal_radius", "values": [0.05, 0.08]},
                {"path": "/contacts/0/indentation", "values": [0.01, 0.02, 0.03]},
            ]);
            let variation = Variation {
                axes: serde_json::from_value(axes).unwrap(),
                ..Default::default()
            };
            let sweep = read(&base.to_string(), variation).unwrap();
            let group: Group = (0..24).collect();
            let solved = |numbers: &[usize]| {
                let none = |_: &Problem| None;
                let mut members = Members::new(
                    &sweep.plan,
                    &group,
                    &sweep.base.mesh,
                    &none,
                    &solver::prepare,
                    None,
                );
                let rows = numbers.iter().map(|n| members.row(*n, &mut ()).unwrap());
                rows.collect::<Vec<_>>()
            };
            let all = solved(&group);
            assert_eq!(all.iter().filter(|row| row.reason.is_none()).count(), 18);
            for left in [&group[5..], &[9, 11, 23], &[20, 21]] {
                for row in solved(left) {
                    assert_eq!(row, all[row.number as usize]);
                }
            }
        }
    }
}
