//! Solving a problem on a blocking thread, and reporting it.

use std::{ops::ControlFlow, time::Duration, time::Instant};

use solver::{
    error::SolveError,
    mesh::Mesh,
    problem::{Problem, Refine, Step},
    solution::{Observer, Phase},
};

use super::{
    ending::{NoSolution, Solved, ending_of_solution},
    report::{Report, Told},
};
use crate::{
    event::Payload,
    memory::Meter,
    run::{self, PartialSolution, Solve, Update},
    store::{Parts, Store},
    time::Time,
};

/// The stored form of a mesh, which was there when the job was accepted. On a blocking thread.
pub(super) fn stored_mesh(store: &Store, hash: &str) -> Result<Vec<u8>, NoSolution> {
    let failed =
        |cause: &dyn std::fmt::Display| NoSolution::Internal(format!("mesh {hash}: {cause}"));
    let body = tokio::runtime::Handle::current().block_on(store.mesh_body(hash));
    let body = body.map_err(|error| failed(&error))?;
    body.ok_or_else(|| failed(&"it is not stored"))
}

/// A mesh from its stored form.
pub(super) fn read_mesh(body: &[u8]) -> Result<Mesh, NoSolution> {
    postcard::from_bytes(body)
        .map_err(|error| NoSolution::Internal(format!("a stored mesh cannot be read: {error}")))
}

/// Reads the problem and solves it, within a share of memory (bytes). On a blocking thread.
pub(super) fn solve_and_report(
    problem: &str,
    mesh: Option<Mesh>,
    solve: Solve,
    share: u64,
    tell: impl FnMut(Told) -> ControlFlow<()>,
) -> Result<Solved, SolveError> {
    solve_and_store(problem, mesh, solve, share, Partials::paced(), tell)
}

/// As [`solve_and_report`], with partial results as `partials` decides.
pub(super) fn solve_and_store(
    problem: &str,
    mesh: Option<Mesh>,
    solve: Solve,
    share: u64,
    mut partials: Partials,
    mut tell: impl FnMut(Told) -> ControlFlow<()>,
) -> Result<Solved, SolveError> {
    let mut meter = Meter::new(share);
    let start = Instant::now();
    let problem: Problem = files::parse(problem).map_err(SolveError::Invalid)?;
    let parse_s = start.elapsed().as_secs_f64();
    let single = |step: &Step| step.increments == 1;
    if problem.steps.len() <= 1
        && problem.steps.iter().all(single)
        && matches!(problem.mesh.refine, Refine::Times(_))
        && !problem.solver.verifies()
    {
        // the next report asks again whether to stop
        let _ = tell(Told::Report(Report::OneLevel));
    }
    let event = |payload| Some(Report::Event(Time::now(), payload));
    let solve =
        |observe: &mut Observer<'_>| solve(&problem, files::external_mesh(&problem, mesh), observe);
    let mut verifying = false;
    let document = run::run(&problem, parse_s, solve, &mut |update| {
        let (mut needed, mut room) = (0, 0);
        verifying |= matches!(update, Update::Phase(Phase::Verify));
        // what is reported belongs to the recorder then, whose thread frees it
        let told = meter.hand_over(|| {
            let report = match update {
                Update::Phase(stage) => event(Payload::Stage { stage }),
                Update::Mesh {
                    number,
                    elements,
                    error,
                } => event(Payload::Mesh {
                    number,
                    elements,
                    error,
                }),
                Update::Iteration(row) => event(Payload::Iteration(row)),
                Update::Warning(warning) => event(Payload::Warning(warning.clone())),
                Update::Step(partial) => partials.next(&partial),
                Update::Pulse => None,
                Update::Needs { bytes } => {
                    needed = bytes;
                    None
                }
                Update::Room { bytes } => {
                    room = bytes;
                    None
                }
                Update::OutOfMemory { bytes } => {
                    // the machine has less than the share: more than it is needed, whatever is used
                    needed = bytes.max(share);
                    None
                }
            };
            report.map_or(ControlFlow::Continue(()), |report| {
                tell(Told::Report(report))
            })
        });
        told?;
        match meter.check(needed) {
            // the solution is there, and stays
            ControlFlow::Break(_) if verifying => return ControlFlow::Break(()),
            ControlFlow::Break(outgrown) => tell(Told::OutOfMemory(outgrown))?,
            ControlFlow::Continue(()) => tell(Told::Nothing)?,
        }
        // no room is an answer, and no reason to stop
        meter.check(room).map_break(|_| ())
    })?;
    let parts = Parts::of(&document).map_err(|_| SolveError::NonFinite {
        phase: Phase::Recover,
    })?;
    let accuracy = document.summary.solution.accuracy.as_ref();
    Ok(Solved {
        ending: ending_of_solution(&document),
        unverified: accuracy.and_then(|accuracy| accuracy.verified) == Some(false),
        iterations: document.history.len(),
        parts,
    })
}

/// Decides when the results of finished load steps are stored as a partial result: not after each, since all of it is
/// written each time and a problem may have a thousand steps; and not at all once the partial result has grown large.
pub(super) struct Partials {
    /// The least time between two.
    pause: Duration,
    /// Storing takes at most one part in so many of the time.
    part: u32,
    /// When the next one may be stored; `None` once one was too large.
    next: Option<Instant>,
}

impl Partials {
    /// At most once a second, and at most a tenth of the time.
    fn paced() -> Self {
        Partials {
            pause: Duration::from_secs(1),
            part: 10,
            next: Some(Instant::now()),
        }
    }

    /// After every step: what a slow machine may do, so that tests do not depend on the clock.
    #[cfg(test)]
    pub(super) fn every_step() -> Self {
        Partials {
            pause: Duration::ZERO,
            part: 0,
            ..Partials::paced()
        }
    }

    /// The partial result, if it is time to store it.
    fn next(&mut self, partial: &PartialSolution<'_>) -> Option<Report> {
        /// A result of this size is written in one transaction, which occupies the single writer for some 40 ms.
        const MOST_BYTES: usize = 4 << 20;
        let start = Instant::now();
        if self.next.is_none_or(|next| start < next) {
            return None;
        }
        // numbers that are not finite, and so have no JSON, are reported at the end
        let document = partial.document().ok();
        let parts = document.and_then(|document| Parts::of(&document).ok());
        self.next = match &parts {
            Some(parts) if parts.bytes() > MOST_BYTES => None,
            _ => Some(start + (start.elapsed() * self.part).max(self.pause)),
        };
        let parts = parts.filter(|parts| parts.bytes() <= MOST_BYTES)?;
        Some(Report::Partial(Box::new(parts)))
    }
}
