//! Solves a problem on a blocking thread, and reports the progress.

use std::{
    ops::ControlFlow,
    sync::Arc,
    time::{Duration, Instant},
};

use base::{
    digest,
    event::Payload,
    job::Reason,
    memory::{Allowance, Budget, Meter},
    run::{
        self, PartialSolution, Solve, Update,
        members::{Members, Step as MemberStep, is_alone, row_of},
    },
    sweep::MemberRow,
    time::Time,
};
use files::sweep::Plan;
use solver::{
    Prepared,
    error::SolveError,
    family::{Family, Member},
    mesh::{External, Mesh},
    problem::{Problem, Refine, Step},
    solution::{Observer, Outcome, Phase, Progress},
};
use store::{MembersTask, Parts, Store};

use super::{
    ending::{NoSolution, Solved, ending_of_solution},
    report::{Report, Told},
};

/// Reads the stored form of a mesh, which existed when the job was accepted. Call this on a blocking thread.
pub(super) fn stored_mesh(store: &Arc<Store>, hash: &str) -> Result<Vec<u8>, NoSolution> {
    let failed =
        |cause: &dyn std::fmt::Display| NoSolution::Internal(format!("mesh {hash}: {cause}"));
    let body = tokio::runtime::Handle::current().block_on(store.mesh_body(hash));
    let body = body.map_err(|error| failed(&error))?;
    body.ok_or_else(|| failed(&"it is not stored"))
}

/// Decodes a mesh from its stored form.
pub(super) fn read_mesh(body: &[u8]) -> Result<Mesh, NoSolution> {
    base::mesh::read_stored(body)
        .map_err(|error| NoSolution::Internal(format!("a stored mesh cannot be read: {error}")))
}

/// Reads the members of a sweep that a job still has to solve. Call this on a blocking thread.
pub(super) fn members_of(store: &Arc<Store>, key: i64) -> Result<MembersTask, NoSolution> {
    let failed = |cause: String| NoSolution::Internal(format!("the members of the job: {cause}"));
    let task = tokio::runtime::Handle::current().block_on(store.members_task(key));
    let task = task.map_err(|error| failed(error.to_string()))?;
    task.ok_or_else(|| failed("they are not stored".into()))
}

/// Solves the problem of a job within its memory, and with it members of its sweep. Call this on a blocking thread.
pub(super) fn solve_task(
    problem: &str,
    mesh: Option<Mesh>,
    members: Option<&MembersTask>,
    solve: Solve,
    allowance: Allowance<'_>,
    tell: impl FnMut(Told) -> ControlFlow<()>,
) -> Result<Solved, NoSolution> {
    let solved = solve_and_store(
        problem,
        mesh,
        members,
        solve,
        allowance,
        Partials::paced(),
        tell,
    );
    solved.map_err(|error| match (error, members) {
        // members are not checked on their meshes before
        (SolveError::Invalid(violations), Some(_)) => {
            let detail = SolveError::Invalid(violations).to_string();
            NoSolution::Failed(Reason::InvalidProblem, detail)
        }
        (error, _) => NoSolution::from(error),
    })
}

/// Reads the problem and solves it within its memory, with partial results as `partials` decides.
pub(super) fn solve_and_store(
    problem: &str,
    mesh: Option<Mesh>,
    members: Option<&MembersTask>,
    solve: Solve,
    allowance: Allowance<'_>,
    mut partials: Partials,
    mut tell: impl FnMut(Told) -> ControlFlow<()>,
) -> Result<Solved, SolveError> {
    let Allowance { share, bodies } = allowance;
    let meter = Meter::new(share);
    let start = Instant::now();
    let problem: Problem = files::parse(problem).map_err(SolveError::Invalid)?;
    let parse_s = start.elapsed().as_secs_f64();
    let single = |step: &Step| step.increments == 1;
    if members.is_none()
        && problem.steps.len() <= 1
        && problem.steps.iter().all(single)
        && matches!(problem.mesh.refine, Refine::Times(_))
        && !problem.solver.verifies()
    {
        // the next report asks again whether to stop
        let _ = tell(Told::Report(Report::OneLevel));
    }
    let event = |payload| Some(Report::Event(Time::now(), payload));
    let stored = mesh.clone().filter(|_| members.is_some());
    let mut family = None;
    let solve = |observe: &mut Observer<'_>| {
        let external = files::external_mesh(&problem, mesh);
        if is_alone(&problem) || (members.is_none() && bodies.is_none()) {
            return solve(&problem, external, observe);
        }
        let prepared = prepare(&problem, external, bodies, &meter, observe)?;
        match members {
            Some(_) => {
                let family = family.insert(Family::of(prepared, &problem));
                family.solution(&problem, observe)
            }
            None => prepared.solve(observe),
        }
    };
    let mut verifying = false;
    let document = run::run(&problem, parse_s, solve, &mut |update| {
        let (mut needed, mut room) = (0, 0);
        if matches!(update, Update::SecondThread) {
            return tell(Told::SecondThread);
        }
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
                Update::Pulse | Update::SecondThread => None,
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
    });
    if let (Err(SolveError::ResourceExhausted { .. }), Some(bodies)) = (&document, bodies) {
        meter.hand_over(|| bodies.drop_bodies());
    }
    if let Some(task) = members {
        let first = match &document {
            Ok(document) => {
                let summary = &document.summary.solution;
                match summary.outcome {
                    Outcome::Canceled => None,
                    _ => Some(MemberRow::solved(task.first, Member::of(summary))),
                }
            }
            Err(SolveError::Stopped | SolveError::ResourceExhausted { .. }) => None,
            Err(error) => Some(row_of(task.first, error.clone())?),
        };
        if let Some(first) = first {
            solve_others(
                &problem,
                stored,
                (task, first),
                family,
                (bodies, &meter),
                &mut tell,
            )?;
        }
    }
    let document = document?;
    let accuracy = document.summary.solution.accuracy.as_ref();
    let unverified = accuracy.and_then(|accuracy| accuracy.verified) == Some(false);
    let (ending, iterations) = (ending_of_solution(&document), document.history.len());
    let mut go_on = run::patient(|| tell(Told::Nothing));
    let parts = Parts::of(document, &mut go_on).map_err(|_| SolveError::NonFinite {
        phase: Phase::Recover,
    })?;
    let parts = parts.ok_or(SolveError::Stopped)?;
    Ok(Solved {
        ending,
        unverified,
        iterations,
        parts,
    })
}

/// Prepares a problem on its body, which is made and kept unless it is kept already. Two jobs that begin at the same
/// time each make their own, since the first body is not finished yet.
pub(super) fn prepare(
    problem: &Problem,
    external: Option<External>,
    bodies: Option<&Budget>,
    meter: &Meter,
    observe: &mut Observer<'_>,
) -> Result<Prepared, SolveError> {
    let model = solver::checked(problem, external, observe)?;
    let key = bodies.and_then(|bodies| Some((bodies, digest::of_body(&model).ok()?)));
    let Some((bodies, key)) = key else {
        return Prepared::new(model, observe);
    };
    if let Some((body, bytes)) = bodies.kept_body(&key, &model) {
        // as if the job had made it
        meter.lend(bytes);
        return Ok(Prepared { model, body });
    }
    let before = meter.used();
    let prepared = Prepared::new(model, observe)?;
    let made = |meter: &Meter| meter.used().saturating_sub(before);
    if made(meter) <= bodies.of_bodies() {
        let kept = prepared.clone();
        let dropped = bodies.keep(key, kept, made(meter));
        // other threads have taken that memory
        meter.hand_over(|| drop(dropped));
    }
    Ok(prepared)
}

/// Reports the row of the first member, and solves the others; an error if that was stopped.
fn solve_others(
    problem: &Problem,
    mesh: Option<Mesh>,
    (task, first): (&MembersTask, MemberRow),
    family: Option<Family>,
    (bodies, meter): (Option<&Budget>, &Meter),
    tell: &mut impl FnMut(Told) -> ControlFlow<()>,
) -> Result<(), SolveError> {
    let MembersTask {
        definition,
        first: number,
        group,
        numbers,
    } = task;
    let plan: Plan = serde_json::from_str(definition).map_err(|_| SolveError::OtherBody)?;
    let external = |problem: &Problem| files::external_mesh(problem, mesh.clone());
    let prepare = |problem: &Problem, external: Option<External>, observe: &mut Observer<'_>| {
        prepare(problem, external, bodies, meter, observe)
    };
    let mesh = &problem.mesh;
    let mut members = Members::new(&plan, group, mesh, &external, &prepare, family);
    let mut report = |row: Box<MemberRow>| {
        let report = Report::Member(Time::now(), row);
        tell(Told::Report(report))
    };
    if numbers.contains(number) && report(Box::new(first)).is_break() {
        return Err(SolveError::Stopped);
    }
    let others: Vec<usize> = numbers.iter().copied().filter(|n| n != number).collect();
    members.solve(&others, &mut |step| {
        let (needed, room) = match step {
            MemberStep::Row(row) => {
                let report = Report::Member(Time::now(), row);
                return meter.hand_over(|| tell(Told::Report(report)));
            }
            MemberStep::Progress(Progress::Needs { bytes } | Progress::OutOfMemory { bytes }) => {
                (bytes, 0)
            }
            MemberStep::Progress(Progress::Room { bytes }) => (0, bytes),
            MemberStep::Progress(Progress::SecondThread) => return tell(Told::SecondThread),
            MemberStep::Progress(_) => (0, 0),
        };
        match meter.check(needed) {
            ControlFlow::Break(outgrown) => tell(Told::OutOfMemory(outgrown))?,
            ControlFlow::Continue(()) => tell(Told::Nothing)?,
        }
        meter.check(room).map_break(|_| ())
    })
}

/// Decides when the results of finished load steps are stored as a partial result: not after each step, since
/// everything is written each time and a problem may have a thousand steps; and not at all once the partial result is
/// large.
pub(super) struct Partials {
    /// The shortest time between two partial results.
    pause: Duration,
    /// Storing takes at most this part of the time (1/n).
    part: u32,
    /// The time when the next one may be stored; `None` once one was too large.
    next: Option<Instant>,
}

impl Partials {
    /// Stores at most once a second, and for at most a tenth of the time.
    fn paced() -> Self {
        Partials {
            pause: Duration::from_secs(1),
            part: 10,
            next: Some(Instant::now()),
        }
    }

    /// Stores after every step, as on a slow machine, so that tests do not depend on the clock.
    #[cfg(test)]
    pub(super) fn every_step() -> Self {
        Partials {
            pause: Duration::ZERO,
            part: 0,
            ..Partials::paced()
        }
    }

    /// The partial result, if it is time to store one.
    fn next(&mut self, partial: &PartialSolution<'_>) -> Option<Report> {
        /// The largest partial result: it is written in one transaction, which occupies the single writer for some 40
        /// ms.
        const MOST_BYTES: usize = 4 << 20;
        /// The largest number of points: writing them takes a tenth of a second without a check whether to stop.
        const MOST_POINTS: usize = 20_000;
        let start = Instant::now();
        if self.next.is_none_or(|next| start < next) {
            return None;
        }
        if partial.points() > MOST_POINTS {
            self.next = None;
            return None;
        }
        // numbers that are not finite, and so have no JSON, are reported at the end
        let document = partial.document().ok();
        let parts = document.and_then(|mut document| {
            document.history = vec![]; // its events tell that, up to now
            Parts::of(document, &mut || true).ok()?
        });
        self.next = match &parts {
            Some(parts) if parts.bytes() > MOST_BYTES => None,
            _ => Some(start + (start.elapsed() * self.part).max(self.pause)),
        };
        let parts = parts.filter(|parts| parts.bytes() <= MOST_BYTES)?;
        Some(Report::Partial(Box::new(parts)))
    }
}
