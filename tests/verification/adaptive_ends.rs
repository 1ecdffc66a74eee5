//! Adaptive refinement that cannot go on, for memory or because a later mesh has no solution: the mesh before is the
//! result, with its errors and the reason.

use serde_json::json;
use solver::mesh::Mesh;
use solver::observer::{Observer, Progress};
use solver::problem::{AdaptiveRefine, Algorithm, History, Problem, Refine, ThesisOptions};
use solver::solution::{Outcome, Solution, WarningCode};

use crate::support::example;

fn cylinder() -> Problem {
    let mut problem = example("cylinder");
    problem.mesh.refine = Refine::Adaptive(AdaptiveRefine { tolerance: 0.002 });
    problem
}

/// What was seen of a solution, and the bytes of every question for memory beyond the first mesh.
struct Seen {
    solution: Solution,
    mesh: Mesh,
    asked: Vec<u64>,
    /// Numbers of meshes in the order in which they were named.
    meshes: Vec<u32>,
    rows: usize,
}

/// An observer that grants memory by the number of the question and its bytes.
struct Grants<F> {
    room: F,
    /// Questions that come before those, and are granted.
    first: usize,
    asked: Vec<u64>,
    meshes: Vec<u32>,
    rows: usize,
}

impl<F: Fn(usize, u64) -> bool> Observer for Grants<F> {
    fn event(&mut self, progress: Progress<'_>) {
        match progress {
            Progress::Refinement { number, .. } => self.meshes.push(number),
            Progress::Iteration(_) => self.rows += 1,
            _ => {}
        }
    }

    fn may_use(&mut self, bytes: u64) -> bool {
        if self.first > 0 {
            self.first -= 1;
            return true;
        }
        self.asked.push(bytes);
        (self.room)(self.asked.len() - 1, bytes)
    }
}

/// Solves with an observer that grants memory by the number of the question and its bytes. What the first mesh needs is
/// granted in any case: without it there is no solution.
fn solve(problem: &Problem, room: impl Fn(usize, u64) -> bool) -> Seen {
    seen(problem, questions_on_the_first_mesh(problem), room)
}

fn questions_on_the_first_mesh(problem: &Problem) -> usize {
    let mut once = problem.clone();
    once.mesh.refine = Refine::Times(0);
    let count = seen(&once, 0, |_, _| true).asked.len();
    assert!(count > 0);
    count
}

fn seen(problem: &Problem, first: usize, room: impl Fn(usize, u64) -> bool) -> Seen {
    let mut observer = Grants {
        room,
        first,
        asked: Vec::new(),
        meshes: Vec::new(),
        rows: 0,
    };
    let solved = solver::solve_with_mesh(problem, None, &mut observer);
    let (solution, mesh) = solved.unwrap();
    let Grants {
        asked,
        meshes,
        rows,
        ..
    } = observer;
    Seen {
        solution,
        mesh,
        asked,
        meshes,
        rows,
    }
}

fn reason(solution: &Solution) -> &str {
    let mut warnings = solution.summary.warnings.iter();
    let unfinished = warnings.find(|w| w.code == WarningCode::RefinementUnfinished);
    &unfinished.unwrap().message
}

/// `seen` ended at the mesh `count` of `whole`, and is all that it was there.
fn assert_is_the_mesh(count: usize, seen: &Seen, whole: &Seen) {
    let (summary, all) = (&seen.solution.summary, &whole.solution.summary.refinements);
    assert_eq!(summary.outcome, Outcome::Converged);
    assert_eq!(summary.refinements, all[..count]);
    let last = &all[count - 1];
    assert_eq!(summary.normal_force, last.normal_force);
    assert_eq!(seen.mesh.elements.len() as u64, last.elements);
    assert_eq!(seen.solution.fields.elements.len() as u64, last.elements);
    // its own errors, and its own rows
    let accuracy = summary.accuracy.as_ref().unwrap();
    let relative = accuracy.quantities.iter().filter_map(|q| q.relative);
    assert_eq!(relative.fold(0.0, f64::max), last.error.unwrap());
    assert_eq!(seen.rows, seen.solution.history.len());
}

#[test]
fn a_mesh_for_which_there_is_no_room_leaves_the_one_before() {
    let whole = solve(&cylinder(), |_, _| true);
    let count = whole.solution.summary.refinements.len();
    assert!(count >= 4 && whole.asked.len() > 3 * count, "{count}");
    // the estimates of whole meshes grow, and nothing that one asks for while it is solved is above its own
    let estimates: Vec<u64> = whole.asked.iter().fold(Vec::new(), |mut list, bytes| {
        if list.last().is_none_or(|last| bytes > last) {
            list.push(*bytes);
        }
        list
    });
    assert_eq!(estimates.len(), count - 1);
    for (before, estimate) in estimates.iter().enumerate() {
        let enough = estimates[..before].last().copied().unwrap_or(0);
        let seen = solve(&cylinder(), |_, bytes| bytes <= enough);
        assert_is_the_mesh(before + 1, &seen, &whole);
        assert_eq!(seen.meshes.len(), before + 1, "the next one is not begun");
        // the next mesh, and the one with fewer divisions in its place
        let [.., refused, smaller] = seen.asked[..] else {
            panic!("{:?}", seen.asked)
        };
        assert!(refused == *estimate && (enough + 1..=refused).contains(&smaller));
        let needed = format!(
            " unknowns, would need {} MiB, more than this job has left",
            smaller.div_ceil(1 << 20)
        );
        assert!(
            reason(&seen.solution).contains(&needed),
            "{needed}: {}",
            reason(&seen.solution)
        );
    }
}

/// Refused while a mesh is solved: what is there is thrown away.
#[test]
fn room_that_is_refused_on_the_way_leaves_the_mesh_before_too() {
    let whole = solve(&cylinder(), |_, _| true);
    for refused in (0..whole.asked.len()).step_by(3) {
        let seen = solve(&cylinder(), |question, _| question < refused);
        let count = seen.solution.summary.refinements.len();
        assert!(count < whole.solution.summary.refinements.len());
        assert_is_the_mesh(count, &seen, &whole);
        assert!(reason(&seen.solution).contains("more than this job has left"));
    }
}

/// A stop is no lack of room.
#[test]
fn an_observer_that_stops_is_obeyed_at_a_question_for_room() {
    /// Grants some questions, then refuses, and stops from then on.
    struct Stops {
        granted: usize,
        stopped: bool,
    }
    impl Observer for Stops {
        fn event(&mut self, _: Progress<'_>) {}

        fn stop(&mut self) -> bool {
            self.stopped
        }

        fn may_use(&mut self, _: u64) -> bool {
            self.stopped = self.granted == 0;
            self.granted = self.granted.saturating_sub(1);
            !self.stopped
        }
    }
    let first = questions_on_the_first_mesh(&cylinder());
    // the factor of the first mesh, the second mesh as a whole, its factor
    for granted in [0, first, first + 1] {
        let mut stops = Stops {
            granted,
            stopped: false,
        };
        let ended = solver::solve(&cylinder(), &mut stops);
        assert_eq!(ended.err(), Some(solver::error::SolveError::Stopped));
    }
}

#[test]
fn a_later_mesh_that_does_not_converge_leaves_the_one_before() {
    let whole = solve(&cylinder(), |_, _| true);
    let mut few = cylinder();
    // enough for the first mesh, whose iterations are all sweeps but the first
    let sweeps = |count: usize| {
        let mut once = few.clone();
        once.mesh.refine = Refine::Times(0);
        once.solver.max_iterations = count as u32;
        solve(&once, |_, _| true).solution.summary.converged
    };
    let enough = (1..100).find(|count| sweeps(*count)).unwrap();
    few.solver.max_iterations = enough as u32;
    let seen = solve(&few, |_, _| true);
    let count = seen.solution.summary.refinements.len();
    assert_is_the_mesh(count, &seen, &whole);
    assert!(count < whole.solution.summary.refinements.len());
    // begun, and returned from
    let count = count as u32;
    assert!(
        seen.meshes.ends_with(&[count, count + 1, count]),
        "{:?}",
        seen.meshes
    );
    let why = "has no solution (its iterations do not converge)";
    assert!(
        reason(&seen.solution).contains(why),
        "{}",
        reason(&seen.solution)
    );
}

/// The first mesh is the result where it has no solution, and no error of it is known.
#[test]
fn a_first_mesh_without_a_solution_is_named() {
    for (signed, why) in [
        (false, "the stiffness is nearly singular"),
        (true, "its contact and slip states repeat in a cycle"),
    ] {
        let mut thesis = cylinder();
        thesis.solver.algorithm = Algorithm::Thesis;
        thesis.solver.thesis = Some(ThesisOptions {
            signed,
            ..ThesisOptions::default()
        });
        let seen = solve(&thesis, |_, _| true);
        let summary = &seen.solution.summary;
        assert!(!summary.converged && seen.meshes == [1] && seen.asked.is_empty());
        assert_eq!(summary.refinements.len(), 1);
        assert_eq!(summary.refinements[0].error, None);
        assert!(
            reason(&seen.solution).contains(why),
            "{}",
            reason(&seen.solution)
        );
    }
}

/// The thesis's own iteration knows no triangles: where it converges, its meshes are refined uniformly.
#[test]
fn the_thesis_is_refined_uniformly() {
    let mut thesis = example("rectangular_punch");
    thesis.contacts[0].friction = None;
    thesis.solver.algorithm = Algorithm::Thesis;
    thesis.mesh.refine = Refine::Adaptive(AdaptiveRefine { tolerance: 0.01 });
    let summary = solve(&thesis, |_, _| true).solution.summary;
    let elements: Vec<u64> = summary.refinements.iter().map(|row| row.elements).collect();
    assert!(summary.converged && elements.len() > 1, "{elements:?}");
    let four = elements.windows(2).all(|pair| pair[1] == 4 * pair[0]);
    assert!(four && elements[0] == 56, "{elements:?}");
    assert!(summary.refinements.last().unwrap().error.unwrap() <= 0.01);
}

/// Load steps are solved on each mesh; all of their results are those of the last. Errors are those of the last step: where
/// nothing touches any more then, it is said that the others are not refined for.
#[test]
fn load_steps_are_those_of_the_last_mesh() {
    let steps = |last: serde_json::Value| {
        let mut problem = cylinder();
        let friction = problem.contacts[0].friction.as_mut().unwrap();
        friction.history = History::Incremental;
        problem.steps =
            serde_json::from_value(json!([{"indentation": 0.5, "increments": 2}, last])).unwrap();
        solve(&problem, |_, _| true)
    };
    let pressed = steps(json!({"indentation": 1}));
    let summary = &pressed.solution.summary;
    assert!(summary.refinements.len() > 2 && summary.converged);
    assert!(summary.refinements.last().unwrap().error.unwrap() <= 0.01);
    let nodes = pressed.solution.node_profiles["top"].s.len();
    assert_eq!(pressed.solution.steps.len(), 2);
    for step in &pressed.solution.steps {
        assert!(step.summary.converged && step.summary.refinements.is_empty());
        assert_eq!(step.node_profiles["top"].s.len(), nodes);
    }
    assert_eq!(pressed.rows, pressed.solution.history.len());
    assert!(
        !summary
            .warnings
            .iter()
            .any(|w| w.code == WarningCode::RefinementUnfinished)
    );

    let lifted = steps(json!({"indentation": 0}));
    assert_eq!(lifted.solution.summary.refinements.len(), 1);
    let message = reason(&lifted.solution);
    assert!(
        message.starts_with("Nothing is in contact at the end of the last load step"),
        "{message}"
    );
}
