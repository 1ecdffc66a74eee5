//! `refine: {"tolerance": …}`: the mesh is refined where errors come from until all quantities are known to a
//! tolerance.
//!
//! Solves, divides the elements that hold most of the errors above the tolerance, as `accuracy` states them and
//! `origins` places them, divides those of their parts again that are expected to hold most of what is left, and
//! repeats. Edges under a peak of σ_t that are wider than a part of ρ are divided in any case, since an estimate does
//! not see what the mesh does not resolve at all. So are edges inside which the obstacle ends, until the part that is
//! left out of the contact is negligible.

mod mesh_results;
mod stopping;

use crate::error::SolveError;
use crate::mesh::{self, ExternalMesh, GradedMesh, Mesh};
use crate::model::estimate::{MOST_ADAPTIVE_CONTACT_ELEMENTS, MOST_ADAPTIVE_ELEMENTS};
use crate::model::{ContactModel, Model};
use crate::observer::{Observer, Progress, notify};
use crate::origins::Origins;
use crate::problem::{AdaptiveRefine, Algorithm, Problem};
use crate::solution::{Outcome, Refinement, Solution, Warning};
use mesh_results::{MeshResults, largest_error};
use stopping::{StopReason, given_up, unfinished};

/// The elements to be divided hold this fraction of the errors above the tolerance.
const BULK: f64 = 0.6;

/// At least this fraction of all elements is divided: fewer would not be worth another mesh.
const LEAST_MARKED: f64 = 0.02;

/// From one mesh to the next an element is divided at most this many times: where errors come from few elements, a mesh with
/// one more division there would be nearly as large, and nearly as inaccurate.
const MOST_DIVISIONS: usize = 4;

/// Elements are divided again, for the same next mesh, until there are this many times as many as before.
const GROWTH: f64 = 1.7;

/// Elements are not divided again if the errors expected on the next mesh, as multiples of the tolerance, have a sum below
/// this.
const ENOUGH: f64 = 0.5;

/// The relative difference of two contributions that count as equal: solutions within the tolerance differ by less.
const EQUAL: f64 = 1e-9;

/// Edges under a peak of σ_t are divided until their length is this fraction of ρ.
const PART_OF_RADIUS: f64 = 0.25;

/// A function that solves one model, and notes where the errors of the results come from.
pub type Solve<'a> =
    dyn Fn(Model, &mut Origins, &mut dyn Observer) -> Result<Solution, SolveError> + 'a;

/// Solves on finer and finer meshes; returns the solution on the finest, with the sequence of meshes, and this mesh.
///
/// `first`: the problem on its own mesh. `solve`: solves the problem on one mesh. The observer sees the phases of every
/// mesh, its iterations (but no load steps) as tentative ones, and the iterations of the last mesh once more when it is
/// known to be the last.
pub fn run(
    problem: &Problem,
    goal: &AdaptiveRefine,
    first: Model,
    solve: &Solve<'_>,
    observer: &mut dyn Observer,
) -> Result<(Solution, Mesh), SolveError> {
    let limits = Limits::new(&first);
    let mut divided = Divided {
        graded: GradedMesh::new(&first.mesh),
        parts: (0..first.mesh.elements.len() as u32).collect(),
    };
    let mut model = first;
    let mut sequence: Vec<Refinement> = Vec::new();
    let mut before: Option<Solved> = None;
    loop {
        let elements = model.mesh.elements.len() as u64;
        let begins = Progress::Refinement {
            number: sequence.len() as u32 + 1,
            elements,
            error: sequence.last().and_then(|row| row.error),
        };
        notify(observer, begins)?;
        let mut origins = Origins::new(&model, goal.tolerance);
        let (mesh, contacts) = (model.mesh.clone(), model.contacts.clone());
        let unknowns = model.estimate_of_mesh().dofs;
        let mut on_this_mesh = MeshObserver {
            observer: &mut *observer,
            later: before.is_some(),
            on_mesh: OnMesh::default(),
        };
        let solved = solve(model, &mut origins, &mut on_this_mesh);
        let mut on_mesh = on_this_mesh.on_mesh;
        if let (Some(reason), Some(before)) = (on_mesh.failed(&solved, unknowns), before.take()) {
            let of_before = sequence.iter().rev().nth(1);
            observer.event(Progress::Refinement {
                number: sequence.len() as u32,
                elements: before.mesh.elements.len() as u64,
                error: of_before.and_then(|row| row.error),
            });
            return Ok(before.ended(problem, goal, sequence, Some(reason), observer));
        }
        let solution = solved?;
        let truncation = cut_edges(&contacts, &solution, &mesh, goal.tolerance);
        let results = MeshResults::new(&solution);
        let change = sequence.last().map(|before| results.change(before));
        let unsolved = unsolved(solution.summary.outcome);
        let error = match unsolved {
            None => largest_error(&solution).max(truncation.error),
            Some(_) => f64::INFINITY,
        };
        sequence.push(results.row(change, error));

        let next = if on_mesh.stopped || solution.summary.outcome == Outcome::Canceled {
            Err(None)
        } else if let Some(why) = unsolved {
            Err(Some(StopReason::First(why)))
        } else if error <= goal.tolerance {
            Err(Some(StopReason::Nothing))
        } else if let Some(reason) = given_up(&sequence, goal.tolerance) {
            Err(Some(reason))
        } else {
            let marked = marks(&contacts, &solution, &origins, &truncation.elements);
            let errors = (&marked[..], &origins.elements[..]);
            next_model(problem, &limits, &mut divided, (&mesh, errors), observer)?.map_err(Some)
        };
        let here = Solved {
            solution,
            mesh,
            warnings: std::mem::take(&mut on_mesh.warnings),
            truncation: truncation.error,
        };
        match next {
            Ok(finer) => {
                observer.event(Progress::Mesh(&here.solution));
                (model, before) = (finer, Some(here));
            }
            Err(reason) => return Ok(here.ended(problem, goal, sequence, reason, observer)),
        }
    }
}

/// A mesh and the solution on it.
struct Solved {
    solution: Solution,
    mesh: Mesh,
    /// The warnings that were given while the mesh was solved, not yet passed to the observer.
    warnings: Vec<Warning>,
    /// The largest error by truncation, [`Truncation::error`].
    truncation: f64,
}

impl Solved {
    /// The final result, with the sequence of meshes and the warning of [`unfinished`], if there is one. Tells the
    /// observer the warnings and iterations of this mesh.
    fn ended(
        mut self,
        problem: &Problem,
        goal: &AdaptiveRefine,
        sequence: Vec<Refinement>,
        reason: Option<StopReason>,
        observer: &mut dyn Observer,
    ) -> (Solution, Mesh) {
        let solution = &mut self.solution;
        let warning = reason.and_then(|reason| {
            unfinished(problem, goal, solution, &sequence, reason, self.truncation)
        });
        if let Some(warning) = warning {
            solution.summary.warnings.push(warning.clone());
            self.warnings.push(warning);
        }
        solution.summary.refinements = sequence;
        for warning in &self.warnings {
            observer.event(Progress::Warning(warning));
        }
        for row in &solution.history {
            observer.event(Progress::Iteration(row));
        }
        (self.solution, self.mesh)
    }
}

/// The warnings of the solution on one mesh, and what stopped it.
#[derive(Default)]
struct OnMesh {
    warnings: Vec<Warning>,
    /// Whether the observer asked to stop.
    stopped: bool,
    /// The memory that was needed and not available (bytes).
    short: Option<u64>,
}

/// Observes the solution on one mesh of the sequence, which may not be the last.
struct MeshObserver<'a> {
    observer: &'a mut dyn Observer,
    /// Whether this is not the first mesh: if it needs too much memory, the solution on the mesh before is kept, and
    /// this is no error.
    later: bool,
    on_mesh: OnMesh,
}

impl Observer for MeshObserver<'_> {
    fn event(&mut self, progress: Progress<'_>) {
        match progress {
            Progress::Iteration(row) => self.observer.event(Progress::Tentative(row)),
            Progress::Step(_) => {}
            Progress::Warning(warning) => self.on_mesh.warnings.push(warning.clone()),
            Progress::OutOfMemory { bytes } if self.later => {
                if !self.stop() {
                    self.on_mesh.short = Some(bytes);
                }
            }
            other => self.observer.event(other),
        }
    }

    fn stop(&mut self) -> bool {
        let on_mesh = &mut self.on_mesh;
        on_mesh.stopped |= on_mesh.short.is_none() && self.observer.stop();
        on_mesh.stopped || on_mesh.short.is_some()
    }

    fn behind(&mut self) -> Option<&mut dyn Observer> {
        Some(self.observer)
    }
}

impl OnMesh {
    /// Why the solution on this mesh cannot replace the solution on the mesh before; `None` if it can, or was stopped.
    fn failed(&self, solved: &Result<Solution, SolveError>, unknowns: u64) -> Option<StopReason> {
        match (self.short, solved) {
            _ if self.stopped => None,
            (Some(bytes), _) => Some(StopReason::Memory { unknowns, bytes }),
            (_, Err(SolveError::Stopped | SolveError::Invalid(_))) => None,
            (_, Err(error)) => Some(StopReason::Failed(unknowns, error.to_string())),
            (_, Ok(solution)) => {
                let why = unsolved(solution.summary.outcome)?;
                Some(StopReason::Failed(unknowns, why.to_owned()))
            }
        }
    }
}

/// Why an outcome is no solution; `None` if it is a solution, or was stopped.
fn unsolved(outcome: Outcome) -> Option<&'static str> {
    match outcome {
        Outcome::Converged | Outcome::Canceled | Outcome::Unfinished => None,
        Outcome::NotConverged => Some("its iterations do not converge"),
        Outcome::ContactCycling => Some("its contact and slip states repeat in a cycle"),
        Outcome::FalseConvergence => Some(
            "its forces do not balance, or its residual is not the true one: the stiffness is nearly singular",
        ),
    }
}

/// Limits and warnings that hold for all meshes, taken from the first.
struct Limits {
    /// What the mesh itself was warned of, which is told again with each.
    notes: Vec<Warning>,
    /// The largest number of elements at each contact, as the estimate of the memory assumes.
    most_at_contacts: Vec<usize>,
}

impl Limits {
    fn new(first: &Model) -> Self {
        let of_mesh = |warning: &&Warning| warning.pointer.starts_with("/mesh");
        let most = |contact: &ContactModel| {
            contact
                .boundary
                .edge_count()
                .max(MOST_ADAPTIVE_CONTACT_ELEMENTS)
        };
        Limits {
            notes: first.warnings.iter().filter(of_mesh).cloned().collect(),
            most_at_contacts: first.contacts.iter().map(most).collect(),
        }
    }

    /// Why a mesh is not solved: too many elements at a contact, or too much memory.
    fn refusal(
        &self,
        model: &Model,
        observer: &mut dyn Observer,
    ) -> Result<Option<StopReason>, SolveError> {
        let at_contacts = model.contacts.iter().zip(&self.most_at_contacts);
        let too_many = at_contacts
            .map(|(contact, most)| (contact.boundary.edge_count(), *most))
            .find(|(count, most)| count > most);
        if let Some((count, most)) = too_many {
            return Ok(Some(StopReason::ContactElements(count, most)));
        }
        let estimate = model.estimate_of_mesh();
        let (unknowns, bytes) = (estimate.dofs, estimate.memory_bytes);
        match observer.may_use(bytes) {
            true => Ok(None),
            false if observer.stop() => Err(SolveError::Stopped),
            false => Ok(Some(StopReason::Memory { unknowns, bytes })),
        }
    }
}

/// The elements as they are divided so far, of which each mesh is made.
#[derive(Clone)]
struct Divided {
    graded: GradedMesh,
    /// For each element of the last mesh, the element of `graded` that contains it.
    parts: Vec<u32>,
}

/// The model on the next mesh, or why there is none. Where a mesh with several divisions is refused, which may be for its
/// size, one with a single division is tried. `errors`: the elements to be divided, and what each contributes to the
/// errors.
fn next_model(
    problem: &Problem,
    limits: &Limits,
    divided: &mut Divided,
    (mesh, errors): (&Mesh, (&[bool], &[f64])),
    observer: &mut dyn Observer,
) -> Result<Result<Model, StopReason>, SolveError> {
    let mut most = MOST_DIVISIONS;
    loop {
        let mut finer = divided.clone();
        let (mesh, divisions) = finer.next(problem, mesh, errors, most);
        let refused = match mesh {
            Ok(mesh) => {
                let warnings = limits.notes.clone();
                let model = Model::on_mesh(problem, ExternalMesh { mesh, warnings });
                let model = model.map_err(SolveError::Invalid)?;
                match limits.refusal(&model, observer)? {
                    None => {
                        *divided = finer;
                        return Ok(Ok(model));
                    }
                    Some(reason) => reason,
                }
            }
            Err(reason) => reason,
        };
        if divisions <= 1 {
            return Ok(Err(refused));
        }
        most = 1;
    }
}

impl Divided {
    /// Divides elements up to `most` times; returns the mesh, or why there is none, and how often it was.
    fn next(
        &mut self,
        problem: &Problem,
        mesh: &Mesh,
        (marked, contributions): (&[bool], &[f64]),
        most: usize,
    ) -> (Result<Mesh, StopReason>, usize) {
        // closures have triangles, which the thesis's own iteration does not know
        let (finer, divisions) = if problem.solver.algorithm == Algorithm::Thesis {
            (mesh::refine(mesh), 1)
        } else {
            if !marked.contains(&true) {
                return (Err(StopReason::Stalled), 0);
            }
            let divisions = self.divide(problem, marked, contributions, most);
            let (finer, parts) = self.graded.closed();
            self.parts = parts;
            (finer, divisions)
        };
        let elements = finer.elements.len();
        let finer = if elements > MOST_ADAPTIVE_ELEMENTS {
            Err(StopReason::Elements(elements))
        } else if !finer.inverted_elements(false).is_empty() {
            Err(StopReason::Inverted)
        } else {
            Ok(finer)
        };
        (finer, divisions)
    }

    /// Divides the marked elements and, up to `most` times in all, those of their parts that are expected to hold most of
    /// the errors that are left; returns how often.
    fn divide(
        &mut self,
        problem: &Problem,
        marked: &[bool],
        contributions: &[f64],
        most: usize,
    ) -> usize {
        let graded = &mut self.graded;
        let before = graded.elements();
        let mut divided = vec![false; before];
        let mut known = vec![0.0; before];
        for ((part, marked), contribution) in self.parts.iter().zip(marked).zip(contributions) {
            divided[*part as usize] |= marked;
            known[*part as usize] += contribution;
        }
        graded.set_contributions(&known);
        refine_on_curves(problem, graded, &divided);
        for divisions in 1..most {
            let expected = graded.contributions();
            let enough = expected.iter().sum::<f64>() <= ENOUGH;
            if enough || graded.elements() as f64 > GROWTH * before as f64 {
                return divisions;
            }
            let divided = bulk(&expected);
            let more = 3 * divided.iter().filter(|divided| **divided).count();
            if graded.elements() + more > MOST_ADAPTIVE_ELEMENTS {
                return divisions;
            }
            refine_on_curves(problem, graded, &divided);
        }
        most
    }
}

/// Divides the marked elements, and moves the new nodes of boundaries onto their curves: nodes of divisions to come are made
/// from them.
fn refine_on_curves(problem: &Problem, graded: &mut GradedMesh, marked: &[bool]) {
    graded.refine(marked);
    for (boundary, curve) in &problem.mesh.curves {
        graded.put_on_curve(boundary, curve);
    }
}

/// The parts of contacts that are left out because the obstacle ends inside an edge.
struct Truncation {
    /// The largest part left out, divided by the length of the contact that it belongs to.
    error: f64,
    /// The elements at edges of which the part left out is above the tolerance.
    elements: Vec<usize>,
}

fn cut_edges(
    contacts: &[ContactModel],
    solution: &Solution,
    mesh: &Mesh,
    tolerance: f64,
) -> Truncation {
    let mut found = Truncation {
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
    truncation: &[usize],
) -> Vec<bool> {
    // where no error of a quantity is known, those of the stresses have to do
    let known = origins.elements.iter().any(|part| *part > 0.0);
    let mut marked = match known {
        true => bulk(&origins.elements),
        false if truncation.is_empty() && origins.unresolved.is_empty() => {
            bulk(&solution.fields.element_error)
        }
        false => vec![false; origins.elements.len()],
    };
    let unresolved = origins.unresolved.iter();
    unresolved.chain(truncation).for_each(|e| marked[*e] = true);
    under_peaks(contacts, solution, &mut marked);
    marked
}

/// Marks the fewest entries that together hold `BULK` of the sum, the largest first, but at least `LEAST_MARKED` of all
/// entries if so many are not 0. Entries that are equal but for rounding are all marked or all not, so that marks depend
/// neither on the order of elements nor on last digits.
fn bulk(parts: &[f64]) -> Vec<bool> {
    let mut order: Vec<usize> = (0..parts.len()).collect();
    order.sort_by(|&a, &b| parts[b].total_cmp(&parts[a]).then(a.cmp(&b)));
    let total: f64 = parts.iter().sum();
    let least = (LEAST_MARKED * parts.len() as f64) as usize;
    let (mut held, mut smallest) = (0.0, f64::INFINITY);
    let mut chosen = vec![false; parts.len()];
    for (count, i) in order.into_iter().enumerate() {
        let enough = held >= BULK * total && count >= least;
        if enough && parts[i] < (1.0 - EQUAL) * smallest || parts[i] == 0.0 {
            break;
        }
        held += parts[i];
        smallest = parts[i];
        chosen[i] = true;
    }
    chosen
}

/// Marks elements with an edge within ρ of a peak of σ_t whose length exceeds [`PART_OF_RADIUS`] ρ.
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
        let equal = [0.1, 1.0, 1.0 + 1e-12, 0.1, 1.0];
        assert_eq!(bulk(&equal), [false, true, true, false, true]);
    }
}
