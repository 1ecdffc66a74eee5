//! Solves one problem and measures the times: the only place with a clock, used by the worker and by `signorini solve`,
//! so that both write the same document.

mod document;
pub mod members;
mod stopwatch;

use std::{
    cell::RefCell,
    collections::BTreeMap,
    time::{Duration, Instant},
};

use solver::{
    error::SolveError,
    finite::is_finite,
    mesh::External,
    observer::{Observer, Progress},
    problem::Problem,
    solution::{Fields, Outcome, Phase, Solution, StepSolution},
};

use crate::event::Payload;
pub use document::{Document, Step, Summary};
use stopwatch::Stopwatch;
pub use stopwatch::Timings;

/// The solver, or its substitute in a test.
pub type Solve = fn(&Problem, Option<External>, &mut dyn Observer) -> Result<Solution, SolveError>;

/// The size of a profile without its points, counted in points.
const OF_A_PROFILE: usize = 5;

/// How long writing the results of a stopped job may take, so that a worker is not occupied by a result that nobody
/// waits for.
const WRITING: Duration = Duration::from_millis(250);

/// The number of nodes from which a second thread is worth its start: one thread takes some 20 ms for the text of the digest then.
const SHARED_DIGEST: usize = 10_000;

/// A function that tells whether to go on writing: it is still true for `WRITING` after `stop` was first true.
pub fn patient(mut stop: impl FnMut() -> bool) -> impl FnMut() -> bool {
    let mut stopped: Option<Instant> = None;
    move || !stop() || stopped.get_or_insert_with(Instant::now).elapsed() < WRITING
}

/// The number of points of all profiles of all load steps so far: the size of a document without fields.
pub fn points(solution: &Solution) -> usize {
    let of_step = |step: &StepSolution| -> usize {
        let profiles = [&step.profiles, &step.node_profiles, &step.friction_profiles];
        let profiles = profiles.into_iter().flat_map(BTreeMap::values);
        profiles.map(|profile| OF_A_PROFILE + profile.s.len()).sum()
    };
    solution.steps.iter().map(of_step).sum()
}

/// The solution of one problem, with the times of its phases and iterations.
pub struct Run<'a> {
    /// The problem.
    pub problem: &'a Problem,
    watch: RefCell<Stopwatch>,
}

impl<'a> Run<'a> {
    /// Starts the measurement. `parse_s` is the time (s) that the caller took to read the problem.
    pub fn new(problem: &'a Problem, parse_s: f64) -> Run<'a> {
        Run {
            problem,
            watch: RefCell::new(Stopwatch::new(parse_s)),
        }
    }

    /// The event of a job for what the solver has just reported to the observer of this run; `None` if clients are not
    /// told of it.
    pub fn payload(&self, progress: Progress<'_>) -> Option<Payload> {
        match progress {
            Progress::Phase(stage) => Some(Payload::Stage { stage }),
            Progress::Refinement {
                number,
                elements,
                error,
            } => Some(Payload::Mesh {
                number,
                elements,
                error,
            }),
            Progress::Iteration(row) => {
                let row = self.watch.borrow().timed(row.clone());
                Some(Payload::Iteration(row))
            }
            Progress::Warning(warning) => Some(Payload::Warning(warning.clone())),
            Progress::Tentative(_)
            | Progress::Step(_)
            | Progress::Mesh(_)
            | Progress::OutOfMemory { .. } => None,
        }
    }

    /// The document of the solution at the end of a load step or on a mesh that is not the last, without fields. Making it costs as
    /// much as all its data, so it is not made for every step.
    pub fn document_so_far(&self, solution: &Solution) -> Result<Document, SolveError> {
        let times = self.watch.borrow_mut().times();
        let mut so_far = solution.clone();
        // each of these steps says itself that it converged
        so_far.summary.outcome = Outcome::Unfinished;
        so_far.summary.converged = false;
        Document::new(self.problem, so_far, &times, 1, &mut || true)
    }

    /// Solves the problem by `solve`, and records the times.
    ///
    /// `solve` is [`solver::solve_on`] for a single problem; problems that share a condensed body are each solved by
    /// [`solver::Prepared::solve_other`]. The results of a stopped solution are given up if writing them takes too
    /// long.
    pub fn solve(
        &self,
        solve: impl FnOnce(&mut dyn Observer) -> Result<Solution, SolveError>,
        observer: &mut dyn Observer,
    ) -> Result<Document, SolveError> {
        let watch = &self.watch;
        // reading an external mesh is a part of meshing, which the solver begins with
        watch.borrow_mut().enter(Phase::Mesh);
        let mut timed = Timed {
            observer: &mut *observer,
            watch,
            non_finite: false,
        };
        let solved = solve(&mut timed);
        if timed.non_finite {
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
        let threads = match solution.fields.x.len() >= SHARED_DIGEST {
            true => observer.threads().clamp(1, 2),
            false => 1,
        };
        let mut go_on = patient(|| observer.stop());
        let times = watch.borrow_mut().times();
        Document::new(self.problem, solution, &times, threads, &mut go_on)
    }
}

/// An observer that records the times of what the solver reports, and stops it at a number that is not finite: JSON
/// cannot write such a number, and going on is pointless.
struct Timed<'a> {
    observer: &'a mut dyn Observer,
    watch: &'a RefCell<Stopwatch>,
    non_finite: bool,
}

impl Observer for Timed<'_> {
    fn event(&mut self, progress: Progress<'_>) {
        let mut watch = self.watch.borrow_mut();
        match &progress {
            Progress::Phase(phase) => watch.enter(*phase),
            Progress::Refinement { number, .. } => watch.on_mesh(*number),
            Progress::Tentative(row) => watch.done_tentatively(row),
            Progress::Iteration(row) => watch.done(row),
            Progress::Warning(_)
            | Progress::Step(_)
            | Progress::Mesh(_)
            | Progress::OutOfMemory { .. } => {}
        }
        drop(watch);
        if let Progress::Tentative(row) | Progress::Iteration(row) = &progress {
            self.non_finite |= !is_finite(*row);
        }
        if !self.non_finite {
            self.observer.event(progress);
        }
    }

    fn stop(&mut self) -> bool {
        self.non_finite || self.observer.stop()
    }

    fn behind(&mut self) -> Option<&mut dyn Observer> {
        Some(self.observer)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use solver::problem::{AdaptiveRefine, Refine, Step};

    use super::*;

    #[test]
    fn every_iteration_is_stamped_and_every_phase_has_a_time() {
        let mut stamps = vec![];
        let problem = fake::problem();
        let run = Run::new(&problem, 0.5);
        let document = run.solve(fake::iterate, &mut |progress: Progress<'_>| {
            if let Some(Payload::Iteration(row)) = run.payload(progress) {
                stamps.push(row.wall_s);
            }
        });
        let document = document.unwrap();
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
        let run = Run::new(&problem, 0.0);
        let document = run.solve(
            |observer| solver::solve(&problem, observer),
            &mut |progress: Progress<'_>| match run.payload(progress) {
                Some(Payload::Stage {
                    stage: Phase::Recover,
                }) => recovers_s = start.elapsed().as_secs_f64(),
                Some(Payload::Iteration(row)) => told.push(row),
                _ => {}
            },
        );
        let document = document.unwrap();
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

    /// An observer without more memory after the factor of the second mesh, Ŝ and matrices of some iterations.
    struct Seen {
        meshes: Vec<u32>,
        /// When the second mesh began.
        second: Option<Instant>,
        /// How often memory was asked for on the second mesh.
        asked: usize,
    }

    impl Observer for Seen {
        fn event(&mut self, progress: Progress<'_>) {
            if let Progress::Refinement { number, .. } = progress {
                self.meshes.push(number);
                if number == 2 {
                    self.second = Some(Instant::now());
                }
            }
        }

        fn may_use(&mut self, _: u64) -> bool {
            self.asked += usize::from(self.meshes == [1, 2]);
            self.asked <= 5
        }
    }

    /// Rows of the mesh before keep their times if there is no memory for the next mesh.
    #[test]
    fn rows_of_the_mesh_before_keep_their_times() {
        let mut problem = fake::problem();
        problem.mesh.refine = Refine::Adaptive(AdaptiveRefine { tolerance: 0.05 });
        let mut seen = Seen {
            meshes: vec![],
            second: None,
            asked: 0,
        };
        let start = Instant::now();
        let document = Run::new(&problem, 0.0)
            .solve(|observer| solver::solve(&problem, observer), &mut seen)
            .unwrap();
        assert_eq!(seen.meshes, [1, 2, 1]);
        let second_s = (seen.second.unwrap() - start).as_secs_f64();
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
        let run = Run::new(&problem, 0.0);
        let document = run.solve(
            |observer| solver::solve(&problem, observer),
            &mut |progress: Progress<'_>| {
                if let Progress::Step(solution) = progress {
                    first = Some(run.document_so_far(solution).unwrap());
                }
            },
        );
        let document = document.unwrap();
        let first = first.unwrap();
        assert!(!first.history.is_empty() && document.history.starts_with(&first.history));
        let summary = &first.summary.solution;
        assert_eq!(
            (summary.outcome, summary.converged),
            (Outcome::Unfinished, false)
        );
        assert!(first.steps[0].summary.converged);
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
            let document = Run::new(problem, 0.0)
                .solve(|observer| solver::solve(problem, observer), &mut ())
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
        let problem = fake::problem();
        let prepared = solver::prepare(&problem, None, &mut ());
        let prepared = prepared.unwrap();
        for coefficient in [0.1, 0.6] {
            let mut problem = problem.clone();
            let friction = problem.contacts[0].friction.as_mut().unwrap();
            friction.coefficient = Some(coefficient);
            let model = solver::model::Model::new(&problem, None).unwrap();
            let solve =
                |observer: &mut dyn Observer| prepared.solve_other(&model, observer).unwrap();
            let shared = Run::new(&problem, 0.0).solve(solve, &mut ()).unwrap();
            let alone = |observer: &mut dyn Observer| solver::solve(&problem, observer);
            let alone = Run::new(&problem, 0.0).solve(alone, &mut ()).unwrap();
            assert_eq!(shared.summary.digest, alone.summary.digest);
        }
        let mut other = problem;
        other.materials[0].elasticity = solver::problem::Elasticity::Isotropic {
            youngs_modulus: 2000.0,
            poissons_ratio: 0.3,
        };
        let model = solver::model::Model::new(&other, None).unwrap();
        assert!(prepared.solve_other(&model, &mut ()).is_none());
    }

    #[test]
    fn a_summary_that_an_earlier_version_stored_is_still_read() {
        let stored = include_str!("stored_summary.json");
        let read: Summary = serde_json::from_str(stored).unwrap();
        assert_eq!(read.solution.iterations, 8);
    }

    #[test]
    fn a_summary_is_read_back_as_it_was_written() {
        let problem = fake::problem();
        let document = Run::new(&problem, 0.0).solve(fake::iterate, &mut ());
        let summary = document.unwrap().summary;
        let text = serde_json::to_string(&summary).unwrap();
        let back: Summary = serde_json::from_str(&text).unwrap();
        assert_eq!(serde_json::to_string(&back).unwrap(), text);
    }
}
