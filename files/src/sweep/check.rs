//! Checks all members of a sweep before the first is solved, and groups members that share a body.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::json;
use solver::error::{Findings, Violation};
use solver::model::Model;
use solver::problem::{MeshSource, NormalOf, Obstacle, Problem, Refine};

use super::numbers::{Problems, Read};
use super::read::Sweep;

/// The largest number of violations of members that are reported.
pub const MOST_TOLD: usize = 50;

/// The numbers of the members that share a body, in order.
pub type Group = Vec<usize>;

/// Divides the members of a sweep into groups that share a body. Structure and numbers of each member are checked;
/// faults that only the mesh can show are not found here.
///
/// # Errors
///
/// The violations of some of the members, at most [`MOST_TOLD`].
pub fn groups(sweep: &Sweep) -> Result<Vec<Group>, Vec<Violation>> {
    let plan = &sweep.plan;
    let mut found = Findings::default();
    let mut places = BTreeSet::new();
    let mut groups: Vec<Group> = vec![];
    let mut by_body: BTreeMap<String, usize> = BTreeMap::new();
    let mut problems = Problems::new(plan);
    // the group of the member before
    let mut last = None;
    for number in 0..plan.count() {
        let read = problems.read(number).and_then(|read| {
            let violations = violations(read.problem);
            if violations.is_empty() {
                Ok(read)
            } else {
                Err(violations)
            }
        });
        match read {
            Ok(Read { problem, same_body }) if places.is_empty() => {
                let known = last.filter(|_| same_body && !is_alone(problem, sweep));
                let group = known.unwrap_or_else(|| {
                    let body = body(problem, sweep, number);
                    *by_body.entry(body).or_insert_with(|| {
                        groups.push(vec![]);
                        groups.len() - 1
                    })
                });
                groups[group].push(number);
                last = Some(group);
            }
            Ok(_) => {}
            Err(list) => {
                for violation in list {
                    let pointer = plan.place(number, &violation);
                    // the same value is a part of many members
                    if places.insert((pointer.clone(), violation.reason)) {
                        let hint = format!("{} (Member {number}.)", violation.hint);
                        found.add(Violation {
                            pointer,
                            hint,
                            ..violation
                        });
                    }
                }
                if places.len() >= MOST_TOLD {
                    let left = plan.count() - number - 1;
                    return Err(with_rest(found.into_violations(), left));
                }
            }
        }
    }
    found.into_result(groups)
}

fn with_rest(mut violations: Vec<Violation>, left: usize) -> Vec<Violation> {
    violations.truncate(MOST_TOLD);
    if let Some(last) = violations.last_mut().filter(|_| left > 0) {
        last.hint
            .push_str(&format!(" (The last {left} members were not checked.)"));
    }
    violations
}

/// The violations of a problem that do not depend on its mesh.
fn violations(problem: &Problem) -> Vec<Violation> {
    let mut meshless = problem.clone();
    meshless.mesh.source = MeshSource::Gmsh(String::new());
    // a mesh that cannot be read, without a reason: all that is checked before it is told
    Model::new(&meshless, Some(Err(vec![])))
        .err()
        .unwrap_or_default()
}

/// Whether a problem with this refinement has meshes of its own and shares no body with others.
pub fn has_own_meshes(problem: &Problem, refine: &Refine) -> bool {
    problem.solver.verifies() || matches!(refine, Refine::Adaptive(_))
}

/// Whether a member shares no body with others.
fn is_alone(problem: &Problem, sweep: &Sweep) -> bool {
    let refine = if sweep.plan.changes_mesh() {
        &problem.mesh.refine
    } else {
        &sweep.base.mesh.refine
    };
    has_own_meshes(problem, refine)
}

/// A text that is the same for members on one body: the data that determine the body. Whether two members share a body
/// is finally decided by the solver.
fn body(problem: &Problem, sweep: &Sweep, number: usize) -> String {
    let Problem {
        analysis,
        mesh,
        materials,
        supports,
        loads,
        contacts,
        quadrature,
        solver: _,
        title: _,
        units: _,
        steps: _,
    } = problem;
    let contacts: Vec<_> = contacts
        .iter()
        .map(|contact| {
            let turned = contact.normal == Some(NormalOf::Obstacle);
            json!([
                contact.boundary,
                contact.normal,
                contact.obstacle.as_ref().map(Obstacle::span),
                turned.then_some(&contact.obstacle),
                contact.against,
                contact.gap.is_some(),
            ])
        })
        .collect();
    let mesh = sweep.plan.changes_mesh().then_some(mesh);
    json!([
        analysis,
        mesh,
        materials,
        supports,
        loads,
        contacts,
        quadrature,
        is_alone(problem, sweep).then_some(number),
    ])
    .to_string()
}
