//! Solves one problem and measures it: the one place with a clock, used by the worker and by
//! `signorini solve` alike, so that both write the same document.

use std::{collections::BTreeMap, ops::ControlFlow, time::Instant};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use solver::{
    error::SolveError,
    finite::is_finite,
    mesh::{External, Mesh},
    problem::Problem,
    solution::{
        ContactProfile, Fields, Iteration, Observer, Outcome, Phase, Progress, Solution,
        StepSolution,
    },
};

use crate::digest;

/// What a solved problem is stored, served and written as.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Document {
    /// Scalars, extents, warnings, timings and fingerprints.
    pub summary: Summary,
    /// One row per iteration.
    pub history: Vec<Iteration>,
    /// Columns along each contact boundary.
    pub profiles: BTreeMap<String, ContactProfile>,
    /// The same at the points where friction acts; served by itself, and no part of a written document.
    #[serde(skip)]
    pub friction_profiles: BTreeMap<String, ContactProfile>,
    /// One entry per load step of the problem.
    pub steps: Vec<StepSolution>,
    /// Displacements and stresses at all nodes.
    pub fields: Fields,
}

/// The solver's summary, and what only its caller knows.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct Summary {
    /// What the solver says.
    #[serde(flatten)]
    pub solution: solver::solution::Summary,
    /// Seconds by phase.
    pub timings: Timings,
    /// The program that solved it.
    pub solver_version: String,
    /// Fingerprint of the problem.
    pub input_hash: String,
    /// Fingerprint of the result.
    pub digest: String,
}

/// Seconds by phase.
pub type Timings = BTreeMap<String, f64>;

/// The solver, or what stands in for it in a test.
pub type Solve = fn(&Problem, Option<External>, &mut Observer<'_>) -> Result<Solution, SolveError>;

/// What a run says on its way.
#[derive(Debug)]
pub enum Said<'a> {
    /// What the solver says.
    Progress(Progress<'a>),
    /// A load step has ended, while others are to come.
    Step(SoFar<'a>),
}

/// What finished load steps have found.
#[derive(Debug)]
pub struct SoFar<'a> {
    problem: &'a Problem,
    solution: &'a Solution,
    timings: Timings,
}

impl SoFar<'_> {
    /// As a document without fields. It costs as much as all that it holds: not for every one of many steps.
    pub fn document(&self) -> Result<Document, SolveError> {
        document(self.problem, self.solution.clone(), self.timings.clone())
    }
}

/// Solves `problem`, stamps each iteration with the seconds since the start and measures the
/// phases. `stored`: the mesh that it names by its hash. `parse_s`: seconds that reading the problem took,
/// the caller's own phase.
pub fn run(
    problem: &Problem,
    stored: Option<Mesh>,
    parse_s: f64,
    solve: Solve,
    say: &mut dyn FnMut(Said<'_>) -> ControlFlow<()>,
) -> Result<Document, SolveError> {
    let mut watch = Stopwatch::new(parse_s);
    let mut broken = false;
    // reading it is a part of meshing, which the solver begins with
    watch.enter(Phase::Mesh);
    let external = files::external_mesh(problem, stored);
    let solved = solve(problem, external, &mut |mut progress| {
        match &mut progress {
            Progress::Phase(phase) => watch.enter(*phase),
            Progress::Iteration(row) => {
                row.wall_s = watch.elapsed_s();
                // JSON has no word for it, and to go on is pointless.
                broken |= !is_finite(row);
            }
            Progress::Warning(_) | Progress::Step(_) | Progress::Pulse => {}
        }
        if broken {
            return ControlFlow::Break(());
        }
        if let Progress::Step(solution) = progress {
            let timings = watch.so_far();
            return say(Said::Step(SoFar {
                problem,
                solution,
                timings,
            }));
        }
        say(Said::Progress(progress))
    });
    if broken {
        return Err(SolveError::NonFinite { phase: "iterate" });
    }
    let mut solution = solved?;
    if solution.summary.outcome == Outcome::Canceled {
        // Who cancels wants the end, not fifty megabytes of it: a canceled job must be terminal
        // within half a second, and writing the fields of a large one takes longer.
        solution.fields = Fields::default();
    }
    document(problem, solution, watch.so_far())
}

/// A solution with what only its caller knows.
fn document(
    problem: &Problem,
    solution: Solution,
    timings: Timings,
) -> Result<Document, SolveError> {
    let non_finite = SolveError::NonFinite { phase: "recover" };
    if !solution.is_finite() {
        return Err(non_finite);
    }
    let non_finite = |_| non_finite.clone();
    let input_hash = digest::input_hash(problem).map_err(non_finite)?;
    let digest = digest::digest(&solution, &input_hash).map_err(non_finite)?;
    let Solution {
        summary,
        history,
        profiles,
        friction_profiles,
        steps,
        fields,
    } = solution;
    let solver_version = env!("CARGO_PKG_VERSION").to_string();
    let summary = Summary {
        solution: summary,
        timings,
        solver_version,
        input_hash,
        digest,
    };
    Ok(Document {
        summary,
        history,
        profiles,
        friction_profiles,
        steps,
        fields,
    })
}

/// Seconds by phase; every phase is present, also one that was not reached.
struct Stopwatch {
    start: Instant,
    current: Option<(Phase, Instant)>,
    timings: Timings,
}

const PHASES: [Phase; 8] = [
    Phase::Parse,
    Phase::Mesh,
    Phase::Assemble,
    Phase::Order,
    Phase::Factor,
    Phase::Condense,
    Phase::Iterate,
    Phase::Recover,
];

impl Stopwatch {
    fn new(parse_s: f64) -> Self {
        let mut timings: Timings = PHASES
            .into_iter()
            .map(|phase| (phase_name(phase).to_string(), 0.0))
            .collect();
        timings.insert(phase_name(Phase::Parse).to_string(), parse_s);
        Stopwatch {
            start: Instant::now(),
            current: None,
            timings,
        }
    }

    fn elapsed_s(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }

    fn enter(&mut self, phase: Phase) {
        self.leave();
        self.current = Some((phase, Instant::now()));
    }

    fn leave(&mut self) {
        if let Some((phase, since)) = self.current.take() {
            *self
                .timings
                .entry(phase_name(phase).to_string())
                .or_default() += since.elapsed().as_secs_f64();
        }
    }

    fn so_far(&mut self) -> Timings {
        if let Some((phase, _)) = self.current {
            self.enter(phase);
        }
        self.timings.clone()
    }
}

/// The word for a phase, as in JSON.
pub fn phase_name(phase: Phase) -> &'static str {
    match phase {
        Phase::Parse => "parse",
        Phase::Mesh => "mesh",
        Phase::Assemble => "assemble",
        Phase::Order => "order",
        Phase::Factor => "factor",
        Phase::Condense => "condense",
        Phase::Iterate => "iterate",
        Phase::Recover => "recover",
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::fake;

    #[test]
    fn every_iteration_is_stamped_and_every_phase_has_a_time() {
        let mut stamps = vec![];
        let document = run(&fake::problem(), None, 0.5, fake::solve, &mut |progress| {
            if let Said::Progress(Progress::Iteration(row)) = progress {
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
            let go_on = &mut |_: Said<'_>| ControlFlow::Continue(());
            let document = run(problem, None, 0.0, solver::solve_on, go_on).unwrap();
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
    fn a_summary_is_read_back_as_it_was_written() {
        let summary = run(&fake::problem(), None, 0.0, fake::solve, &mut |_| {
            ControlFlow::Continue(())
        })
        .unwrap()
        .summary;
        let text = serde_json::to_string(&summary).unwrap();
        let back: Summary = serde_json::from_str(&text).unwrap();
        assert_eq!(serde_json::to_string(&back).unwrap(), text);
    }
}
