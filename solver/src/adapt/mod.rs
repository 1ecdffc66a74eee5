//! `refine: {"tolerance": …}`: the mesh is refined where errors come from until all quantities are known to a tolerance.
//!
//! Solves, divides the elements that hold most of the errors above the tolerance, as `accuracy` states them and
//! `origins` places them, and repeats. Edges under a peak of σ_t that are wider than a part of ρ are divided in any
//! case, since the errors of what is not resolved at all are not seen; and edges that an end of the obstacle cuts,
//! until the part left out of the contact counts no more.

mod unmet;
mod watched;

use std::ops::ControlFlow;

use crate::error::SolveError;
use crate::mesh::{self, ExternalMesh, GradedMesh, Mesh};
use crate::model::estimate::{MOST_ADAPTIVE_CONTACT_ELEMENTS, MOST_ADAPTIVE_ELEMENTS};
use crate::model::{ContactModel, Model};
use crate::origins::Origins;
use crate::problem::{AdaptiveRefine, Algorithm, Problem};
use crate::solution::{Observer, Outcome, Progress, Refinement, Solution, Warning};
use unmet::{Unmet, given_up, unfinished};
use watched::{WatchedResults, largest_error};

/// The elements to be divided hold this part of the errors above the tolerance.
const BULK: f64 = 0.6;

/// At least this part of all elements is divided: fewer would not be worth another mesh.
const LEAST_MARKED: f64 = 0.02;

/// Edges under a peak of σ_t are divided until they are this part of ρ.
const PART_OF_RADIUS: f64 = 0.25;

/// Solves one model, and notes where the errors of its results come from.
pub type Solve<'a> =
    dyn Fn(Model, &mut Origins, &mut Observer<'_>) -> Result<Solution, SolveError> + 'a;

/// Solves on finer and finer meshes; returns the solution on the finest, with the sequence of meshes, and that mesh.
///
/// `first`: the problem on its own mesh. `solve`: solves it there, and on the others. The observer sees the phases of
/// every mesh, its iterations (but no load steps) as tentative ones, and those of the last mesh again once it is known
/// to be the last.
pub fn run(
    problem: &Problem,
    goal: &AdaptiveRefine,
    first: Model,
    solve: &Solve<'_>,
    observe: &mut Observer<'_>,
) -> Result<(Solution, Mesh), SolveError> {
    // what the mesh itself was warned of is told again with each
    let of_mesh = |warning: &&Warning| warning.pointer.starts_with("/mesh");
    let notes: Vec<Warning> = first.warnings.iter().filter(of_mesh).cloned().collect();
    let most_at_contacts: Vec<usize> = first.contacts.iter().map(most_elements).collect();
    let mut graded = GradedMesh::new(&first.mesh);
    let mut parts: Vec<u32> = (0..first.mesh.elements.len() as u32).collect();
    let mut model = first;
    let mut sequence: Vec<Refinement> = Vec::new();
    let mut before: Option<Solved> = None;
    loop {
        let elements = model.mesh.elements.len() as u64;
        let answer = observe(Progress::Refinement {
            number: sequence.len() as u32 + 1,
            elements,
            error: sequence.last().and_then(|row| row.error),
        });
        if answer.is_break() {
            return Err(SolveError::Stopped);
        }
        let mut origins = Origins::new(&model, goal.tolerance);
        let (mesh, contacts) = (model.mesh.clone(), model.contacts.clone());
        let unknowns = model.estimate_of_mesh().dofs;
        let (solved, mut on_mesh) = solve_on(model, &mut origins, solve, before.is_some(), observe);
        if let (Some(unmet), Some(before)) = (on_mesh.failed(&solved, unknowns), before.take()) {
            let of_before = sequence.iter().rev().nth(1);
            let _ = observe(Progress::Refinement {
                number: sequence.len() as u32,
                elements: before.mesh.elements.len() as u64,
                error: of_before.and_then(|row| row.error),
            });
            return Ok(before.ended(problem, goal, sequence, Some(unmet), observe));
        }
        let solution = solved?;
        let cut = cut_edges(&contacts, &solution, &mesh, goal.tolerance);
        let results = WatchedResults::new(&solution);
        let change = sequence.last().map(|before| results.change(before));
        let unsolved = unsolved(solution.summary.outcome);
        let error = match unsolved {
            None => largest_error(&solution).max(cut.error),
            Some(_) => f64::INFINITY,
        };
        sequence.push(results.row(change, error));

        let mut next = None;
        let unmet = if on_mesh.stopped || solution.summary.outcome == Outcome::Canceled {
            None
        } else if let Some(why) = unsolved {
            Some(Unmet::First(why))
        } else if error <= goal.tolerance {
            Some(Unmet::Nothing)
        } else if let Some(unmet) = given_up(&sequence, goal.tolerance) {
            Some(unmet)
        } else {
            let marked = marks(&contacts, &solution, &origins, &cut.elements);
            match finer(problem, &mut graded, &mesh, &mut parts, &marked) {
                Ok(mesh) => {
                    let warnings = notes.clone();
                    let given = ExternalMesh { mesh, warnings };
                    let model = Model::on_mesh(problem, given).map_err(SolveError::Invalid)?;
                    let too_large = too_large(&model, &most_at_contacts, observe)?;
                    next = too_large.is_none().then_some(model);
                    too_large
                }
                Err(unmet) => Some(unmet),
            }
        };
        let here = Solved {
            solution,
            mesh,
            warnings: std::mem::take(&mut on_mesh.warnings),
            cut: cut.error,
        };
        match next {
            Some(finer) => (model, before) = (finer, Some(here)),
            None => return Ok(here.ended(problem, goal, sequence, unmet, observe)),
        }
    }
}

/// A mesh and the solution on it.
struct Solved {
    solution: Solution,
    mesh: Mesh,
    /// What was found while it was solved.
    warnings: Vec<Warning>,
    /// [`Cut::error`].
    cut: f64,
}

impl Solved {
    /// This is the result: with the sequence of meshes, why it ends here, and what the observer has not seen yet.
    fn ended(
        mut self,
        problem: &Problem,
        goal: &AdaptiveRefine,
        sequence: Vec<Refinement>,
        unmet: Option<Unmet>,
        observe: &mut Observer<'_>,
    ) -> (Solution, Mesh) {
        let solution = &mut self.solution;
        let unmet =
            unmet.and_then(|unmet| unfinished(problem, goal, solution, &sequence, unmet, self.cut));
        if let Some(warning) = unmet {
            solution.summary.warnings.push(warning.clone());
            self.warnings.push(warning);
        }
        solution.summary.refinements = sequence;
        for warning in &self.warnings {
            let _ = observe(Progress::Warning(warning));
        }
        for row in &solution.history {
            let _ = observe(Progress::Iteration(row));
        }
        (self.solution, self.mesh)
    }
}

/// What the observer was asked while a mesh was solved, and what it said.
#[derive(Default)]
struct OnMesh {
    warnings: Vec<Warning>,
    /// It is to end.
    stopped: bool,
    /// So much memory was needed that there is not (bytes).
    short: Option<u64>,
}

impl OnMesh {
    /// Why a mesh has no solution that could take the place of the one before.
    fn failed(&self, solved: &Result<Solution, SolveError>, unknowns: u64) -> Option<Unmet> {
        match (self.short, solved) {
            _ if self.stopped => None,
            (Some(bytes), _) => Some(Unmet::Memory { unknowns, bytes }),
            (_, Err(SolveError::Stopped | SolveError::Invalid(_))) => None,
            (_, Err(error)) => Some(Unmet::Failed(unknowns, error.to_string())),
            (_, Ok(solution)) => {
                let why = unsolved(solution.summary.outcome)?;
                Some(Unmet::Failed(unknowns, why.to_owned()))
            }
        }
    }
}

/// Why an outcome is no solution, unless it is one or was stopped.
fn unsolved(outcome: Outcome) -> Option<&'static str> {
    match outcome {
        Outcome::Converged | Outcome::Canceled => None,
        Outcome::NotConverged => Some("its iteration does not converge"),
        Outcome::ContactCycling => Some("its contact and slip repeat themselves"),
        Outcome::FalseConvergence => Some(
            "its forces do not balance, or its residual is false: the stiffness is nearly singular",
        ),
    }
}

/// Solves on one mesh. `later`: it is not the first, and if it needs too much memory the solution before remains; the observer is
/// asked whether there is room, and not told that there has to be.
fn solve_on(
    model: Model,
    origins: &mut Origins,
    solve: &Solve<'_>,
    later: bool,
    observe: &mut Observer<'_>,
) -> (Result<Solution, SolveError>, OnMesh) {
    let mut on_mesh = OnMesh::default();
    let solved = solve(model, origins, &mut |progress| {
        if on_mesh.short.is_some() {
            return ControlFlow::Break(());
        }
        let answer = match progress {
            Progress::Iteration(row) => observe(Progress::Tentative(row)),
            Progress::Step(_) => observe(Progress::Pulse),
            Progress::Warning(warning) => {
                on_mesh.warnings.push(warning.clone());
                ControlFlow::Continue(())
            }
            Progress::Needs { bytes } if later => match has_room(bytes, observe) {
                Ok(true) => ControlFlow::Continue(()),
                Ok(false) => {
                    on_mesh.short = Some(bytes);
                    return ControlFlow::Break(());
                }
                Err(_) => ControlFlow::Break(()),
            },
            Progress::OutOfMemory { bytes } if later => {
                on_mesh.short = Some(bytes);
                return ControlFlow::Break(());
            }
            other => observe(other),
        };
        on_mesh.stopped |= answer.is_break();
        answer
    });
    (solved, on_mesh)
}

/// Whether there is so much memory; an error if the solution is to end anyhow.
fn has_room(bytes: u64, observe: &mut Observer<'_>) -> Result<bool, SolveError> {
    match observe(Progress::Room { bytes }) {
        ControlFlow::Continue(()) => Ok(true),
        ControlFlow::Break(()) => match observe(Progress::Pulse) {
            ControlFlow::Continue(()) => Ok(false),
            ControlFlow::Break(()) => Err(SolveError::Stopped),
        },
    }
}

/// Why a mesh is not solved: too many elements at a contact, or too much memory.
fn too_large(
    model: &Model,
    most_at_contacts: &[usize],
    observe: &mut Observer<'_>,
) -> Result<Option<Unmet>, SolveError> {
    let at_contacts = model.contacts.iter().zip(most_at_contacts);
    let too_many = at_contacts
        .map(|(contact, most)| (contact.boundary.edge_count(), *most))
        .find(|(count, most)| count > most);
    if let Some((count, most)) = too_many {
        return Ok(Some(Unmet::ContactElements(count, most)));
    }
    let estimate = model.estimate_of_mesh();
    let (unknowns, bytes) = (estimate.dofs, estimate.memory_bytes);
    let fits = has_room(bytes, observe)?;
    Ok((!fits).then_some(Unmet::Memory { unknowns, bytes }))
}

/// Most elements at a contact, which are as many as the estimate of the memory assumes.
fn most_elements(contact: &ContactModel) -> usize {
    MOST_ADAPTIVE_CONTACT_ELEMENTS.max(contact.boundary.edge_count())
}

/// The next mesh, whose elements are each a part of one of `graded`: `parts`.
fn finer(
    problem: &Problem,
    graded: &mut GradedMesh,
    mesh: &Mesh,
    parts: &mut Vec<u32>,
    marked: &[bool],
) -> Result<Mesh, Unmet> {
    // closures have triangles, which the thesis's own iteration does not know
    let finer = if problem.solver.algorithm == Algorithm::Thesis {
        mesh::refine(mesh)
    } else {
        if !marked.contains(&true) {
            return Err(Unmet::Stalled);
        }
        let mut divided = vec![false; graded.elements()];
        for (part, _) in parts.iter().zip(marked).filter(|(_, marked)| **marked) {
            divided[*part as usize] = true;
        }
        graded.refine(&divided);
        // those of divisions to come are made from them
        for (boundary, curve) in &problem.mesh.curves {
            graded.put_on_curve(boundary, curve);
        }
        let (finer, of) = graded.closed();
        *parts = of;
        finer
    };
    let elements = finer.elements.len();
    if elements > MOST_ADAPTIVE_ELEMENTS {
        return Err(Unmet::Elements(elements));
    }
    if !finer.inverted_elements(false).is_empty() {
        return Err(Unmet::Folded);
    }
    Ok(finer)
}

/// What is left out of contacts because an end of the obstacle lies inside an edge.
struct Cut {
    /// The largest such part in lengths of its contact.
    error: f64,
    /// Elements at edges where it is above the tolerance.
    elements: Vec<usize>,
}

fn cut_edges(contacts: &[ContactModel], solution: &Solution, mesh: &Mesh, tolerance: f64) -> Cut {
    let mut found = Cut {
        error: 0.0,
        elements: Vec::new(),
    };
    for contact in contacts.iter().filter(|contact| !contact.cut.is_empty()) {
        let extents = solution.summary.contacts.get(&contact.name);
        let extents = extents.map_or(&[][..], |summary| &summary.contact);
        let ([first, ..], [.., last]) = (extents, extents) else {
            continue;
        };
        let (nodes, s) = (&contact.boundary.nodes, &contact.boundary.s);
        let end = s.len() - 1;
        for (edge, covered) in &contact.cut {
            // a contact that ends before the obstacle does is not changed by it, but for a friction bound that is given
            let given = contact
                .friction
                .as_ref()
                .is_some_and(|law| law.bound.radius().is_none());
            let pressed = given
                || (edge.contains(&nodes[0]) && first[0] <= s[0])
                || (edge.contains(&nodes[end]) && last[1] >= s[end]);
            let part = covered / (last[1] - first[0]);
            if !pressed || part <= tolerance {
                continue;
            }
            found.error = found.error.max(part);
            let at = |element: &crate::element::Element| element.contains(&edge[2]);
            found.elements.extend(mesh.elements.iter().position(at));
        }
    }
    found
}

/// The elements to be divided.
fn marks(
    contacts: &[ContactModel],
    solution: &Solution,
    origins: &Origins,
    cut: &[usize],
) -> Vec<bool> {
    // where no error of a quantity is known, those of the stresses have to do
    let known = origins.elements.iter().any(|part| *part > 0.0);
    let mut marked = match known {
        true => bulk(&origins.elements),
        false if cut.is_empty() && origins.unresolved.is_empty() => {
            bulk(&solution.fields.element_error)
        }
        false => vec![false; origins.elements.len()],
    };
    let unresolved = origins.unresolved.iter();
    unresolved.chain(cut).for_each(|e| marked[*e] = true);
    under_peaks(contacts, solution, &mut marked);
    marked
}

/// The fewest entries that together hold `BULK` of the sum, or the largest few where those are fewer.
fn bulk(parts: &[f64]) -> Vec<bool> {
    let mut order: Vec<usize> = (0..parts.len()).collect();
    order.sort_by(|&a, &b| parts[b].total_cmp(&parts[a]).then(a.cmp(&b)));
    let total: f64 = parts.iter().sum();
    let least = (LEAST_MARKED * parts.len() as f64) as usize;
    let mut held = 0.0;
    let mut chosen = vec![false; parts.len()];
    for (count, i) in order.into_iter().enumerate() {
        if held >= BULK * total && count >= least || parts[i] == 0.0 {
            break;
        }
        held += parts[i];
        chosen[i] = true;
    }
    chosen
}

/// Marks elements with an edge within ρ of a peak of σ_t that is longer than a part of ρ.
fn under_peaks(contacts: &[ContactModel], solution: &Solution, marked: &mut [bool]) {
    let fields = &solution.fields;
    for contact in contacts {
        let radius = contact.friction.as_ref().and_then(|f| f.bound.radius());
        let peak = solution
            .summary
            .contacts
            .get(&contact.name)
            .and_then(|c| c.peak_tangential_stress);
        let (Some(radius), Some(peak)) = (radius.filter(|r| *r > 0.0), peak) else {
            continue;
        };
        for (element, marked) in fields.elements.iter().zip(&mut *marked) {
            for [a, b, _] in element.sides() {
                let place = |node: u32| [fields.x[node as usize], fields.y[node as usize]];
                let ([x0, y0], [x1, y1]) = (place(a), place(b));
                let length = (x1 - x0).hypot(y1 - y0);
                let along =
                    ((peak.x - x0) * (x1 - x0) + (peak.y - y0) * (y1 - y0)) / (length * length);
                let nearest = along.clamp(0.0, 1.0);
                let distance =
                    (peak.x - x0 - nearest * (x1 - x0)).hypot(peak.y - y0 - nearest * (y1 - y0));
                *marked |= length > PART_OF_RADIUS * radius && distance < radius;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_elements_with_most_of_the_error_are_marked() {
        assert_eq!(bulk(&[0.1, 5.0, 0.0, 4.0]), [false, true, false, true]);
        assert_eq!(bulk(&[0.0, 0.0]), [false, false]);
    }
}
