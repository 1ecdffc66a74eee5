//! Solves one problem and measures the times: the only place with a clock, used by the worker and by `signorini solve`,
//! so that both write the same document.

mod document;
pub mod members;
mod stopwatch;

use std::{
    collections::BTreeMap,
    ops::ControlFlow,
    time::{Duration, Instant},
};

use solver::{
    error::SolveError,
    finite::is_finite,
    mesh::External,
    problem::Problem,
    solution::{Fields, Observer, Outcome, Phase, Progress, Solution, StepSolution, Warning},
};

use crate::event::TimedIteration;
pub use document::{Document, Step, Summary};
pub use stopwatch::Timings;
use stopwatch::{Stopwatch, Times};

/// The solver, or its substitute in a test.
pub type Solve = fn(&Problem, Option<External>, &mut Observer<'_>) -> Result<Solution, SolveError>;

/// A report of a run while it is solved.
#[derive(Debug)]
pub enum Update<'a> {
    /// A phase begins.
    Phase(Phase),
    /// Adaptive refinement begins to solve on a mesh, or returns to the one before.
    Mesh {
        /// The number of the mesh, from 1.
        number: u32,
        /// The number of its elements.
        elements: u64,
        /// The largest relative error on the mesh before.
        error: Option<f64>,
    },
    /// An iteration of the solution.
    Iteration(TimedIteration),
    /// A warning about the problem or its solution.
    Warning(&'a Warning),
    /// A load step has ended, and others follow.
    Step(PartialSolution<'a>),
    /// No news: the solver is working, and asks whether to continue.
    Pulse,
    /// The solver is about to take more memory, and asks whether it may.
    Needs {
        /// The number of bytes.
        bytes: u64,
    },
    /// The solver could continue with more memory, and asks whether it is available; if not, it ends with its results
    /// so far.
    Room {
        /// The number of bytes.
        bytes: u64,
    },
    /// The solver could share its next work with a second thread, and asks whether there is a processor for it.
    SecondThread,
    /// There was not enough memory.
    OutOfMemory {
        /// The number of bytes that the solver needed.
        bytes: u64,
    },
}

/// The size of a profile apart from its points, in points.
const OF_A_PROFILE: usize = 5;

/// How long writing the results of a stopped job may take, so that a worker is not occupied by a result that nobody
/// waits for.
const WRITING: Duration = Duration::from_millis(250);

/// A function that still returns true for `WRITING` after the first refusal.
pub fn patient(mut asked: impl FnMut() -> ControlFlow<()>) -> impl FnMut() -> bool {
    let mut stopped: Option<Instant> = None;
    move || asked().is_continue() || stopped.get_or_insert_with(Instant::now).elapsed() < WRITING
}

/// The solution at the end of a load step that is not the last.
#[derive(Debug)]
pub struct PartialSolution<'a> {
    problem: &'a Problem,
    solution: &'a Solution,
    times: Times,
}

impl PartialSolution<'_> {
    /// The document of these results without fields. Making it costs as much as all its data, so it is not made for
    /// every step.
    pub fn document(&self) -> Result<Document, SolveError> {
        Document::new(
            self.problem,
            self.solution.clone(),
            &self.times,
            &mut || true,
        )
    }

    /// The number of points of all profiles of all load steps: the size of the document.
    pub fn points(&self) -> usize {
        let of_step = |step: &StepSolution| -> usize {
            let profiles = [&step.profiles, &step.node_profiles, &step.friction_profiles];
            let profiles = profiles.into_iter().flat_map(BTreeMap::values);
            profiles.map(|profile| OF_A_PROFILE + profile.s.len()).sum()
        };
        self.solution.steps.iter().map(of_step).sum()
    }
}

/// Solves `problem` by `solve`, and records the time of each iteration and phase. `parse_s`: seconds for reading the
/// problem, which the caller has done.
///
/// `solve` is [`solver::solve_on`] for a single problem; problems that share a condensed body are each solved by
/// [`solver::Prepared::solve_other`]. The results of a stopped solution are given up if writing them takes too long.
pub fn run(
    problem: &Problem,
    parse_s: f64,
    solve: impl FnOnce(&mut Observer<'_>) -> Result<Solution, SolveError>,
    report: &mut dyn FnMut(Update<'_>) -> ControlFlow<()>,
) -> Result<Document, SolveError> {
    let mut watch = Stopwatch::new(parse_s);
    let mut non_finite = false;
    // reading an external mesh is a part of meshing, which the solver begins with
    watch.enter(Phase::Mesh);
    let solved = solve(&mut |progress| {
        let update = match progress {
            Progress::Phase(phase) => {
                watch.enter(phase);
                Update::Phase(phase)
            }
            Progress::Refinement {
                number,
                elements,
                error,
            } => {
                watch.on_mesh(number);
                Update::Mesh {
                    number,
                    elements,
                    error,
                }
            }
            Progress::Tentative(row) => {
                non_finite |= !is_finite(row);
                watch.done_tentatively(row);
                Update::Pulse
            }
            Progress::Iteration(row) => {
                // JSON cannot write such a number, and going on is pointless
                non_finite |= !is_finite(row);
                let wall_s = watch.done(row);
                let row = row.clone();
                Update::Iteration(TimedIteration { row, wall_s })
            }
            Progress::Warning(warning) => Update::Warning(warning),
            Progress::Step(solution) => Update::Step(PartialSolution {
                problem,
                solution,
                times: watch.times(),
            }),
            Progress::Pulse => Update::Pulse,
            Progress::Needs { bytes } => Update::Needs { bytes },
            Progress::Room { bytes } => Update::Room { bytes },
            Progress::SecondThread => Update::SecondThread,
            Progress::OutOfMemory { bytes } => Update::OutOfMemory { bytes },
        };
        if non_finite {
            ControlFlow::Break(())
        } else {
            report(update)
        }
    });
    if non_finite {
        return Err(SolveError::NonFinite {
            phase: Phase::Iterate,
        });
    }
    let mut solution = solved?;
    if solution.summary.outcome == Outcome::Canceled {
        // Who cancels wants the end, not fifty megabytes of it: a canceled job must be terminal
        // within half a second, and writing the fields of a large one takes longer.
        solution.fields = Fields::default();
    }
    let mut go_on = patient(|| report(Update::Pulse));
    Document::new(problem, solution, &watch.times(), &mut go_on)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use solver::problem::{AdaptiveRefine, Refine, Step};

    use super::*;

    #[test]
    fn every_iteration_is_stamped_and_every_phase_has_a_time() {
        let mut stamps = vec![];
        let document = run(&fake::problem(), 0.5, fake::iterate, &mut |update| {
            if let Update::Iteration(row) = update {
                stamps.push(row.wall_s);
            }
            ControlFlow::Continue(())
        })
        .unwrap();
        assert_eq!(stamps.len(), 3);
        assert!(stamps.is_sorted() && stamps[0] > 0.0);
        assert_eq!(document.summary.timings.len(), 8);
        assert_eq!(document.summary.timings["parse"], 0.5);
    }

    /// Every row has the time at which it was computed, also on the meshes of adaptive refinement and in load steps.
    #[test]
    fn every_row_has_the_time_at_which_it_was_computed() {
        let mut problem = fake::problem();
        problem.mesh.refine = Refine::Adaptive(AdaptiveRefine { tolerance: 0.05 });
        let whole = Step::whole();
        problem.steps = [0.5, 1.0]
            .map(|indentation| Step {
                indentation,
                ..whole.clone()
            })
            .into();
        let (start, mut recovers_s) = (Instant::now(), 0.0);
        let mut told = vec![];
        let document = run(
            &problem,
            0.0,
            |observe| solver::solve(&problem, observe),
            &mut |update| {
                match update {
                    Update::Phase(Phase::Recover) => recovers_s = start.elapsed().as_secs_f64(),
                    Update::Iteration(row) => told.push(row),
                    _ => {}
                }
                ControlFlow::Continue(())
            },
        )
        .unwrap();
        let history = &document.history;
        assert!(document.summary.solution.refinements.len() > 1 && history.len() > 2);
        assert!(history.iter().zip(1..).all(|(row, k)| row.row.k == k));
        assert!(history.is_sorted_by(|a, b| a.wall_s < b.wall_s));
        // all were done before the stresses of the last mesh were recovered
        assert!(history.iter().all(|row| row.wall_s < recovers_s));
        assert_eq!(&told, history);
        let by_step = document.steps.iter().flat_map(|step| &step.history);
        assert!(by_step.eq(history) && document.steps.len() == 2);
    }

    /// Rows of the mesh before keep their times if there is no memory for the next mesh.
    #[test]
    fn rows_of_the_mesh_before_keep_their_times() {
        let mut problem = fake::problem();
        problem.mesh.refine = Refine::Adaptive(AdaptiveRefine { tolerance: 0.05 });
        let solve = |observe: &mut Observer<'_>| solver::solve(&problem, observe);
        let start = Instant::now();
        let (mut meshes, mut second_s, mut asked) = (vec![], f64::INFINITY, 0);
        let document = run(&problem, 0.0, solve, &mut |update| {
            match update {
                Update::Mesh { number, .. } => {
                    meshes.push(number);
                    if number == 2 {
                        second_s = start.elapsed().as_secs_f64();
                    }
                }
                // no more room after the factor of the second mesh, Ŝ and matrices of some iterations
                Update::Room { .. } if meshes == [1, 2] => {
                    asked += 1;
                    if asked > 5 {
                        return ControlFlow::Break(());
                    }
                }
                _ => {}
            }
            ControlFlow::Continue(())
        })
        .unwrap();
        assert_eq!(meshes, [1, 2, 1]);
        assert_eq!(document.summary.solution.refinements.len(), 1);
        assert!(!document.history.is_empty());
        let rows = document.history.iter();
        assert!(
            rows.clone()
                .all(|row| 0.0 < row.wall_s && row.wall_s < second_s)
        );
        assert!(rows.is_sorted_by(|a, b| a.wall_s < b.wall_s));
    }

    #[test]
    fn results_of_finished_steps_have_the_times_of_the_whole() {
        let mut problem = fake::problem();
        problem.steps = vec![Step::whole(); 2];
        let mut first = None;
        let document = run(
            &problem,
            0.0,
            |observe| solver::solve(&problem, observe),
            &mut |update| {
                if let Update::Step(partial) = update {
                    first = Some(partial.document().unwrap());
                }
                ControlFlow::Continue(())
            },
        )
        .unwrap();
        let first = first.unwrap().history;
        assert!(!first.is_empty() && document.history.starts_with(&first));
    }

    #[test]
    fn one_bad_number_anywhere_is_found() {
        assert!(fake::solution().is_finite());
        for spoil in [
            |s: &mut Solution| s.summary.energy = f64::NAN,
            |s: &mut Solution| s.summary.contraction = Some(f64::NAN),
            |s: &mut Solution| s.history[0].residual = f64::INFINITY,
            |s: &mut Solution| s.fields.ux[0] = f64::NAN,
            |s: &mut Solution| s.fields.gauss.x.push(f64::NAN),
            |s: &mut Solution| {
                s.profiles
                    .values_mut()
                    .for_each(|p| p.gap[1] = f64::NEG_INFINITY)
            },
            // no part of the document, and yet it is served
            |s: &mut Solution| {
                s.friction_profiles = s.profiles.clone();
                s.friction_profiles
                    .values_mut()
                    .for_each(|p| p.gap[1] = f64::NAN)
            },
        ] {
            let mut spoiled = fake::solution();
            spoil(&mut spoiled);
            assert!(!spoiled.is_finite());
        }
    }

    #[test]
    fn the_same_problem_has_the_same_digest_and_another_one_another() {
        let solved = |problem: &Problem| {
            let go_on = &mut |_: Update<'_>| ControlFlow::Continue(());
            let document = run(
                problem,
                0.0,
                |observe| solver::solve(problem, observe),
                go_on,
            )
            .unwrap();
            assert!(document.summary.solution.converged);
            document.summary
        };
        let problem = fake::problem();
        let here = solved(&problem);
        let there = std::thread::scope(|scope| scope.spawn(|| solved(&problem)).join().unwrap());
        assert_eq!(here.digest, there.digest);
        let mut deeper = problem.clone();
        deeper.contacts[0].indentation *= 1.5;
        let deeper = solved(&deeper);
        assert!(deeper.solution.normal_force > here.solution.normal_force);
        assert_ne!(here.digest, deeper.digest);
    }

    #[test]
    fn problems_that_share_a_body_are_solved_on_it_as_they_are_on_their_own() {
        let go_on = &mut |_: Update<'_>| ControlFlow::Continue(());
        let problem = fake::problem();
        let prepared = solver::prepare(&problem, None, &mut |_| ControlFlow::Continue(()));
        let prepared = prepared.unwrap();
        for coefficient in [0.1, 0.6] {
            let mut problem = problem.clone();
            let friction = problem.contacts[0].friction.as_mut().unwrap();
            friction.coefficient = Some(coefficient);
            let model = solver::model::Model::new(&problem, None).unwrap();
            let solve = |observe: &mut Observer<'_>| prepared.solve_other(&model, observe).unwrap();
            let shared = run(&problem, 0.0, solve, go_on).unwrap();
            let alone = |observe: &mut Observer<'_>| solver::solve(&problem, observe);
            let alone = run(&problem, 0.0, alone, go_on).unwrap();
            assert_eq!(shared.summary.digest, alone.summary.digest);
        }
        let mut other = problem;
        other.materials[0].elasticity = solver::problem::Elasticity::Isotropic {
            youngs_modulus: 2000.0,
            poissons_ratio: 0.3,
        };
        let model = solver::model::Model::new(&other, None).unwrap();
        let go_on = &mut |_: solver::solution::Progress<'_>| ControlFlow::Continue(());
        assert!(prepared.solve_other(&model, go_on).is_none());
    }

    #[test]
    fn a_summary_that_an_earlier_version_stored_is_still_read() {
        let stored = include_str!("stored_summary.json");
        let read: Summary = serde_json::from_str(stored).unwrap();
        assert_eq!(read.solution.iterations, 8);
    }

    #[test]
    fn a_summary_is_read_back_as_it_was_written() {
        let summary = run(&fake::problem(), 0.0, fake::iterate, &mut |_| {
            ControlFlow::Continue(())
        })
        .unwrap()
        .summary;
        let text = serde_json::to_string(&summary).unwrap();
        let back: Summary = serde_json::from_str(&text).unwrap();
        assert_eq!(serde_json::to_string(&back).unwrap(), text);
    }
}
