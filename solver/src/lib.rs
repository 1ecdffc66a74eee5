//! Frictional contact in linear elasticity by finite elements, with the nonlocal, nonlinear law of Oden and Pires (A.C.
//! Bolt, MSc thesis, University of Cape Town, 1983). Comments cite the thesis by its numbers, and docs/formulation.md
//! as "formulation 4.3".
//!
//! A library of pure functions: no clock, file or network; the same problem gives the same bits. A large body is
//! ordered and factored, its stresses are recovered and its errors stated on two threads if the observer lets it
//! ([`observer::Observer::threads`]), with the same bits as on one.
//! Reading and writing of any format is left to the crate `files`. The modules are listed from the ground up; each uses
//! only the modules above it in the list.
//!
//! ```
//! // a block that is pressed by a rigid punch, as JSON: `files::parse` reads it with all violations at once
//! let problem = serde_json::from_str(r#"{
//!     "analysis": {"kind": "plane_strain"},
//!     "mesh": {"grid": {"x": [0, 0.5, 1, 2], "y": [-2, -1, 0]}},
//!     "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
//!     "supports": [{"boundary": "left", "ux": 0}, {"boundary": "bottom", "ux": 0, "uy": 0}],
//!     "contacts": [{
//!         "boundary": "top",
//!         "obstacle": {"kind": "flat", "from": 0, "to": 1},
//!         "indentation": 0.01,
//!         "friction": {"coefficient": 0.3, "nonlocal_radius": 0.1, "elastic_slip": 1e-4}
//!     }]
//! }"#)?;
//! let solution = solver::solve(&problem, &mut ())?;
//! println!("normal force {}", solution.summary.normal_force);
//! assert!(solution.summary.converged && solution.summary.normal_force > 0.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`family`] solves many problems on one body; `examples/friction.rs` shows it.
//!
//! # Where to look
//!
//! The map by sections of the thesis, and of what goes beyond it. A room with many files has a map of its own in its
//! `mod.rs`; docs/theory.md leads from each equation to its function.
//!
//! | subject | where |
//! |---|---|
//! | 1.2 the friction law | `friction` |
//! | 1.3 Hooke's law | `elasticity` |
//! | supports and loads | `model` |
//! | the contact boundary Γ_C, its gap and the obstacles | `contact` |
//! | 1.4 the energy (1.21) and its minimum | `algorithm/convex` |
//! | 2.1, 2.3 master elements and Gauss integration | `element` |
//! | 2.2 stiffness, loads and stresses | `elasticity` |
//! | the factorisation | `linear` |
//! | 3.1 the iteration exactly as printed, with 3.3, 3.4.1 and 3.4.2 | `algorithm/thesis` |
//! | the iterations that replace it (formulation 4) | `algorithm` |
//! | 3.3 normals and tangents | `contact` |
//! | 3.5 the criterion R_F and the history of an iteration | `algorithm/recorder.rs` |
//! | 4 the examples | `examples` |
//! | the examples on meshes of the thesis's size | `tests/data/thesis`, `tests/verification/examples.rs` |
//! | 5 a law that depends on the load path | `friction`, `steps.rs` |
//! | codes of violations | `error/reason.rs` |
//! | codes of warnings | `solution` |
//! | what is told while it solves; stopping it, its memory and threads | `observer.rs` |
//! | summary, profiles and fields of a result: their fields | `solution` |
//! | summary, profiles and fields of a result: how they are computed | `algorithm/report.rs`, `algorithm/profile` |
//! | stated errors by estimation, and the verdict | `accuracy` |
//! | errors by a second solution on the refined mesh | `verify.rs` |
//! | errors by the noise of measured obstacles | `measured.rs`, `accuracy/measurement.rs` |
//! | adaptive refinement | `adapt`, `origins.rs` |
//! | names of the first mesh on a refined one | `mesh/lineage.rs`, `mesh/first.rs`, `model/nodes.rs` |
//! | many problems on one body, each solved from a neighbour | `family.rs`, `model/variable.rs`, `algorithm/neighbour.rs` |
//! | memory and time that a problem needs | `model/estimate.rs` |

// The phases of a solution.
pub mod phase;

// Violations, and errors that end a solution.
pub mod error;

// Pure maths on numbers: master elements and rules; matrices (the one room that names faer); NaN and infinity; curves
// through points.
pub mod element;
pub mod finite;
pub mod linear;
pub mod spline;

// Plain data: the question and the answer.
pub mod problem;
pub mod solution;

// What is told and asked on the way from one to the other.
pub mod observer;

// Nodes, elements and named boundaries.
pub mod mesh;

// The friction law, along arc length only.
pub mod friction;

// A standard elastic program; the geometry of the contact boundary.
pub mod contact;
pub mod elasticity;

// All checks: the only way to obtain a problem that can be solved.
pub mod model;

// The body reduced to its contact boundary: one factorisation, then a small dense system.
pub mod body;

// Contact and friction on that system.
pub mod algorithm;

// What the mesh may have done to each number, and where.
pub mod accuracy;
pub mod origins;

// Load steps, one after the other.
pub mod steps;

// The errors by the noise of a measured obstacle.
pub mod measured;

// The errors by solving on the mesh split in two.
pub mod verify;

// Finer meshes until the errors are small enough.
pub mod adapt;

// A problem up to its iterations; many problems on one body.
pub mod family;
mod prepared;

use error::{SolveError, Violation};
use mesh::{External, Mesh};
use model::Model;
use observer::{Observer, Progress};
use origins::Origins;
use problem::{Problem, Refine};
use solution::{Phase, Solution, Warning};
use verify::Verification;

/// Solves a problem.
///
/// `observer` is told every phase and iteration, and asked again and again in long work whether to stop (`&mut ()`
/// ignores all progress and never stops): the result is then the last state as `Outcome::Canceled`. A method that does
/// not converge is an [`Outcome`](solution::Outcome) too, with its history.
///
/// # Errors
///
/// [`SolveError::Invalid`] with all violations, if the problem is wrong or names a mesh that only its caller can read
/// (see [`solve_on`]). The other kinds of [`SolveError`] mean that no state could be computed: the body is not held,
/// memory does not suffice, a number is not finite, or the observer stopped before there was a state, or while the
/// state's stresses and profiles were computed, if these were much work.
pub fn solve(problem: &Problem, observer: &mut dyn Observer) -> Result<Solution, SolveError> {
    solve_on(problem, None, observer)
}

/// Solves a problem like [`solve`]; if the problem only names its mesh or contains it as text, `external` is this mesh
/// (`files::external_mesh` reads it).
///
/// # Errors
///
/// The errors of [`solve`]; violations of the external mesh are among those of the problem.
pub fn solve_on(
    problem: &Problem,
    external: Option<External>,
    observer: &mut dyn Observer,
) -> Result<Solution, SolveError> {
    solve_with_mesh(problem, external, observer).map(|(solution, _)| solution)
}

/// Solves a problem like [`solve_on`], and also returns the refined mesh, on which the solution is.
///
/// # Errors
///
/// The errors of [`solve`].
pub fn solve_with_mesh(
    problem: &Problem,
    external: Option<External>,
    observer: &mut dyn Observer,
) -> Result<(Solution, Mesh), SolveError> {
    let mut verification = Verification::of(problem, &external);
    let (mut solution, mesh) = match problem.mesh.refine {
        Refine::Times(_) => {
            let prepared = prepare(problem, external, observer)?;
            (prepared.solve(observer)?, prepared.model.mesh)
        }
        Refine::Adaptive(goal) => {
            let first = Model::new(problem, external).map_err(SolveError::Invalid)?;
            verification = verification.map(|verification| verification.limited(&first));
            let solve = |model: Model, origins: &mut Origins, observer: &mut dyn Observer| {
                observer::notify(observer, Progress::Phase(Phase::Mesh))?;
                prepared::tell_warnings(&model, observer)?;
                let Prepared { model, body } = Prepared::new(model, observer)?;
                steps::run(&model, &body, Some(origins), observer)
            };
            adapt::run(problem, &goal, first, &solve, observer)?
        }
    };
    if let Some(verification) = verification {
        verification.verify(problem, &mesh, &mut solution, observer);
    }
    measured::add_error(problem, &mesh, &mut solution, observer);
    accuracy::note_unknown_signs(&mut solution, |name| {
        let place = problem
            .contacts
            .iter()
            .position(|contact| contact.boundary == name);
        place.map_or(String::new(), |i| format!("/contacts/{i}"))
    });
    Ok((solution, mesh))
}

/// The result of checking a valid problem without solving it.
#[derive(Clone, Debug)]
pub struct Checked {
    /// The warnings about the problem.
    pub warnings: Vec<Warning>,
    /// The estimated cost of solving the problem; with adaptive refinement, of the largest mesh that it may come to.
    pub estimate: Estimate,
    /// With adaptive refinement: the estimated cost of the first mesh.
    pub first_mesh: Option<Estimate>,
}

/// Checks a problem without solving it: returns its warnings and the cost of solving it.
///
/// # Errors
///
/// All violations of the problem, each with its place, what was found, what was expected and what to do.
pub fn check(problem: &Problem, external: Option<External>) -> Result<Checked, Vec<Violation>> {
    let model = Model::new(problem, external)?;
    let adaptive = matches!(problem.mesh.refine, problem::Refine::Adaptive(_));
    Ok(Checked {
        estimate: model.estimate(problem),
        first_mesh: adaptive.then(|| model.estimate_of_mesh()),
        warnings: model.warnings,
    })
}

pub use prepared::{Prepared, checked, prepare, prepare_on_mesh};

pub use model::estimate::{Estimate, MeshSize, estimate};

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use solution::Outcome;

    /// An observer that counts the questions whether to stop, and stops after some.
    struct StopsAfter {
        most: usize,
        asked: usize,
        /// The iterations since then.
        iterations: usize,
    }

    impl StopsAfter {
        fn new(most: usize) -> StopsAfter {
            StopsAfter {
                most,
                asked: 0,
                iterations: 0,
            }
        }
    }

    impl Observer for StopsAfter {
        fn event(&mut self, progress: Progress<'_>) {
            if let (true, Progress::Iteration(row)) = (self.asked > self.most, progress) {
                self.iterations += 1;
                assert!(finite::is_finite(row), "{row:?} after {}", self.most);
            }
        }

        fn stop(&mut self) -> bool {
            self.asked += 1;
            self.asked > self.most
        }
    }

    /// The problem of a strip one element wide whose long side is in contact: most of the work is dense.
    fn wall(lines: u32, algorithm: &str) -> Problem {
        let y: Vec<u32> = (0..lines).collect();
        let problem = serde_json::json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"grid": {"x": [0, 1], "y": y}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "left", "ux": 0}, {"boundary": "bottom", "uy": 0}],
            "contacts": [{
                "boundary": "right",
                "obstacle": {"kind": "flat", "from": 0, "to": lines - 1},
                "indentation": 0.01,
                "friction": {"coefficient": 0.3, "nonlocal_radius": 2, "elastic_slip": 1e-4}
            }],
            "solver": {"algorithm": algorithm, "check_uniqueness": true}
        });
        serde_json::from_value(problem).unwrap()
    }

    /// A solution stops whenever it is told to: after that it starts nothing large, and asks only a few times more.
    #[test]
    fn a_solution_stops_at_any_question() {
        for algorithm in ["auto", "fixed_point", "newton", "thesis"] {
            let problem = wall(120, algorithm);
            let mut whole = StopsAfter::new(usize::MAX);
            assert!(solve(&problem, &mut whole).is_ok());
            let questions = whole.asked;
            assert!(questions > 100, "{algorithm}: {questions}");
            for most in (0..questions).step_by(1 + questions / 60) {
                let mut observer = StopsAfter::new(most);
                let stopped = solve(&problem, &mut observer);
                let after = observer.asked.saturating_sub(most);
                assert!(after <= 60, "{algorithm}: {after} questions after {most}");
                let iterations = observer.iterations;
                assert!(iterations <= 3, "{algorithm}: {iterations} iterations");
                match stopped {
                    Err(error) => assert_eq!(error, SolveError::Stopped),
                    // a stop during the comparisons at the end leaves the solution
                    Ok(solution) => {
                        assert!(matches!(
                            solution.summary.outcome,
                            Outcome::Canceled
                                | Outcome::Converged
                                | Outcome::FalseConvergence
                                | Outcome::ContactCycling
                                | Outcome::NotConverged
                        ));
                        // and one while errors are estimated leaves none, rather than one whose errors are unknown
                        let reasons = solution.summary.accuracy.map(|accuracy| accuracy.reasons);
                        let reasons = reasons.unwrap_or_default().join(" ");
                        assert!(!reasons.contains("no unique solution"), "{reasons}");
                    }
                }
            }
        }
    }

    /// Large matrices are announced before they are allocated: the factor with Ŝ, then the matrices of the iterations.
    #[test]
    fn large_matrices_are_announced() {
        struct Needs(Vec<u64>);
        impl Observer for Needs {
            fn event(&mut self, _: Progress<'_>) {}

            fn may_use(&mut self, bytes: u64) -> bool {
                self.0.push(bytes);
                true
            }
        }
        let mut needs = Needs(Vec::new());
        let solution = solve(&wall(120, "auto"), &mut needs).unwrap();
        let (m, needs) = (solution.summary.contact_dofs, needs.0);
        assert!(needs[0] > 8 * m * m, "{needs:?}");
        assert!(needs.len() > 3 && needs[1..].iter().all(|bytes| *bytes <= 8 * m * m));
    }

    #[test]
    #[should_panic(expected = "attempt to add with overflow")]
    fn an_overflow_is_a_panic_in_the_profile_that_ships() {
        let most = std::hint::black_box(u32::MAX);
        std::hint::black_box(most + 1);
    }
}
