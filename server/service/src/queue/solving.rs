//! Solves a problem on a blocking thread, and reports the progress.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use base::{
    digest,
    job::Reason,
    memory::{Allowance, Budget, Meter, Outgrown},
    run::{
        self, Run, Solve,
        members::{Members, is_alone, row_of},
    },
    sweep::MemberRow,
};
use files::sweep::Plan;
use solver::{
    Prepared,
    error::SolveError,
    family::{Family, Member},
    mesh::{External, Mesh},
    observer::{Observer, Progress},
    problem::{Problem, Refine, Step},
    solution::{Outcome, Phase, Solution, Verdict},
};
use store::{MembersTask, Overview, Parts, Store};

use super::{
    ending::{NoSolution, Solved, ending_of_solution},
    supervisor::Supervisor,
};

/// Reads the stored form of a mesh, which was stored when the job was accepted.
pub(super) async fn stored_mesh(store: &Arc<Store>, hash: &str) -> Result<Vec<u8>, NoSolution> {
    let failed =
        |cause: &dyn std::fmt::Display| NoSolution::Internal(format!("mesh {hash}: {cause}"));
    let body = store.mesh_body(hash).await;
    let body = body.map_err(|error| failed(&error))?;
    body.ok_or_else(|| failed(&"it is not stored"))
}

/// Decodes a mesh from its stored form.
pub(super) fn read_mesh(body: &[u8]) -> Result<Mesh, NoSolution> {
    base::mesh::read_stored(body)
        .map_err(|error| NoSolution::Internal(format!("a stored mesh cannot be read: {error}")))
}

/// Reads the members of a sweep that belong to the job with this key, and which of them are not solved yet.
pub(super) async fn members_of(store: &Arc<Store>, key: i64) -> Result<MembersTask, NoSolution> {
    let failed = |cause: String| NoSolution::Internal(format!("the members of the job: {cause}"));
    let task = store.members_task(key).await;
    let task = task.map_err(|error| failed(error.to_string()))?;
    task.ok_or_else(|| failed("they are not stored".into()))
}

/// Solves the problem of a job within the memory of the job, and members of its sweep, if it has any. Call this on a
/// blocking thread.
pub(super) fn solve_task(
    problem: &str,
    mesh: Option<Mesh>,
    members: Option<&MembersTask>,
    solve: Solve,
    allowance: Allowance<'_>,
    supervisor: &mut dyn Supervisor,
) -> Result<Solved, NoSolution> {
    let partials = Partials::paced();
    solve_with_partials(
        problem, mesh, members, solve, allowance, partials, supervisor,
    )
}

/// Solves as [`solve_task`] does; `partials` decides when partial results are stored.
pub(super) fn solve_with_partials(
    problem: &str,
    mesh: Option<Mesh>,
    members: Option<&MembersTask>,
    solve: Solve,
    allowance: Allowance<'_>,
    partials: Partials,
    supervisor: &mut dyn Supervisor,
) -> Result<Solved, NoSolution> {
    let Allowance { share, bodies } = allowance;
    let meter = Meter::new(share);
    let no_solution = |error| match (error, members) {
        // members are not checked on their meshes before
        (SolveError::Invalid(violations), Some(_)) => {
            let detail = SolveError::Invalid(violations).to_string();
            NoSolution::Failed(Reason::InvalidProblem, detail)
        }
        (error, _) => NoSolution::from(error),
    };
    let start = Instant::now();
    let problem = files::parse(problem);
    let problem = problem.map_err(|violations| no_solution(SolveError::Invalid(violations)))?;
    let run = Run::new(&problem, start.elapsed().as_secs_f64());
    if members.is_none() && has_one_level(&problem) {
        supervisor.one_level();
    }
    let mut metered = Metered {
        supervisor,
        meter: &meter,
        run: Some(&run),
        partials,
        verifying: false,
        outgrown: None,
    };
    let solved = solve_metered(&run, mesh, members, solve, bodies, &mut metered);
    solved.map_err(|error| match (error, metered.outgrown) {
        (SolveError::Stopped, Some(outgrown)) => NoSolution::OutOfMemory(outgrown),
        (error, _) => no_solution(error),
    })
}

/// Whether a problem has one load level on one grid.
fn has_one_level(problem: &Problem) -> bool {
    let single = |step: &Step| step.increments == 1;
    problem.steps.len() <= 1
        && problem.steps.iter().all(single)
        && matches!(problem.mesh.refine, Refine::Times(_))
        && !problem.solver.verifies()
}

fn solve_metered(
    run: &Run<'_>,
    mesh: Option<Mesh>,
    members: Option<&MembersTask>,
    solve: Solve,
    bodies: Option<&Budget>,
    metered: &mut Metered<'_>,
) -> Result<Solved, SolveError> {
    let (problem, meter) = (run.problem, metered.meter);
    let stored = mesh.clone().filter(|_| members.is_some());
    let mut family = None;
    let solve = |observer: &mut dyn Observer| {
        let external = files::external_mesh(problem, mesh);
        let samples = members.is_none() && solver::measured::is_measured(problem);
        if samples || is_alone(problem) || (members.is_none() && bodies.is_none()) {
            return solve(problem, external, observer);
        }
        let prepared = prepare(problem, external, bodies, meter, observer)?;
        match members {
            Some(_) => {
                let family = family.insert(Family::of(prepared, problem));
                family.solution(problem, observer)
            }
            None => prepared.solve(observer),
        }
    };
    let document = run.solve(solve, metered);
    let mut verdict = None;
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
            verdict = solve_others(problem, stored, (task, first), family, bodies, metered)?;
        }
    }
    let document = document?;
    let accuracy = document.summary.solution.accuracy.as_ref();
    let unverified = accuracy.and_then(|accuracy| accuracy.verified) == Some(false);
    let mut ending = ending_of_solution(&document, metered.outgrown);
    if members.is_some() {
        // the document is that of the first member: the row of the job would have its numbers under the sweep's name
        ending.overview = Overview {
            verdict,
            ..Overview::default()
        };
    }
    let iterations = document.history.len();
    let mut go_on = run::patient(|| metered.is_to_stop());
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

/// Observes a solution for a supervisor, and keeps the solution within the memory of its job.
struct Metered<'a> {
    supervisor: &'a mut dyn Supervisor,
    meter: &'a Meter,
    /// The run whose events are reported; `None` while other members of a sweep are solved.
    run: Option<&'a Run<'a>>,
    partials: Partials,
    /// Whether the solution is complete and is only being verified: a lack of memory now ends only the verification.
    verifying: bool,
    /// The lack of memory for which the solver is to stop.
    outgrown: Option<Outgrown>,
}

impl Metered<'_> {
    fn is_to_stop(&mut self) -> bool {
        self.outgrown.is_some() || self.supervisor.stop()
    }

    /// Makes the solver stop for lack of memory, unless it is to stop anyway.
    fn outgrow(&mut self, outgrown: Outgrown) {
        if !self.is_to_stop() {
            self.outgrown = Some(outgrown);
        }
    }

    /// Reports the result of a member of a sweep; an error if the solver is to stop.
    fn member(&mut self, row: MemberRow) -> Result<(), SolveError> {
        self.meter.hand_over(|| self.supervisor.member(row));
        match self.is_to_stop() {
            true => Err(SolveError::Stopped),
            false => Ok(()),
        }
    }
}

impl Observer for Metered<'_> {
    fn event(&mut self, progress: Progress<'_>) {
        if let Progress::OutOfMemory { bytes } = progress {
            return self.outgrow(self.meter.refused(bytes));
        }
        let Some(run) = self.run else { return };
        self.verifying |= matches!(progress, Progress::Phase(Phase::Verify));
        // what is told belongs to the recorder then, whose thread frees it
        self.meter.hand_over(|| match progress {
            Progress::Step(solution) => {
                if let Some(parts) = self.partials.next(run, solution) {
                    self.supervisor.partial(parts);
                }
            }
            Progress::Mesh(solution) => {
                if let Some(parts) = self.partials.of_mesh(run, solution) {
                    self.supervisor.partial(parts);
                }
            }
            progress => {
                if let Some(payload) = run.payload(progress) {
                    self.supervisor.event(payload);
                }
            }
        });
    }

    fn stop(&mut self) -> bool {
        match self.meter.check(0) {
            Err(_) if self.verifying => return true,
            Err(outgrown) => self.outgrow(outgrown),
            Ok(()) => {}
        }
        self.is_to_stop()
    }

    fn may_use(&mut self, bytes: u64) -> bool {
        self.meter.check(bytes).is_ok()
    }

    fn threads(&mut self) -> usize {
        self.supervisor.threads()
    }
}

/// Prepares a problem on its condensed body: a kept body with the same content, or a new one, which is then kept. Two
/// jobs that begin at the same time each make a body, since the first is not finished yet.
pub(super) fn prepare(
    problem: &Problem,
    external: Option<External>,
    bodies: Option<&Budget>,
    meter: &Meter,
    observer: &mut dyn Observer,
) -> Result<Prepared, SolveError> {
    let model = solver::checked(problem, external, observer)?;
    let key = bodies.and_then(|bodies| Some((bodies, digest::of_body(&model).ok()?)));
    let Some((bodies, key)) = key else {
        return Prepared::new(model, observer);
    };
    if let Some((body, bytes)) = bodies.kept_body(&key, &model) {
        // as if the job had made it
        meter.lend(bytes);
        return Ok(Prepared { model, body });
    }
    let before = meter.used();
    let prepared = Prepared::new(model, observer)?;
    let made = |meter: &Meter| meter.used().saturating_sub(before);
    if made(meter) <= bodies.of_bodies() {
        let kept = prepared.clone();
        let dropped = bodies.keep(key, kept, made(meter));
        // other threads have taken that memory
        meter.hand_over(|| drop(dropped));
    }
    Ok(prepared)
}

/// Reports the result of the first member of a sweep, and solves the other members. Returns the worst verdict on a member;
/// an error if the solver was stopped.
fn solve_others(
    problem: &Problem,
    mesh: Option<Mesh>,
    (task, first): (&MembersTask, MemberRow),
    family: Option<Family>,
    bodies: Option<&Budget>,
    metered: &mut Metered<'_>,
) -> Result<Option<Verdict>, SolveError> {
    let MembersTask {
        definition,
        first: number,
        group,
        numbers,
    } = task;
    let meter = metered.meter;
    let plan: Plan = serde_json::from_str(definition).map_err(|_| SolveError::OtherBody)?;
    // other jobs may solve the rest of it
    let group = plan.divided(*number).unwrap_or(group);
    // the problem of the job is that of the first of them, so that all pieces have the same body and end alike
    let is_first = group.first() == Some(number);
    let external = |problem: &Problem| files::external_mesh(problem, mesh.clone());
    let prepare = |problem: &Problem, external: Option<External>, observer: &mut dyn Observer| {
        prepare(problem, external, bodies, meter, observer)
    };
    let mesh = &problem.mesh;
    let mut members = Members::new(&plan, group, mesh, &external, &prepare, family);
    (metered.run, metered.verifying) = (None, false);
    let mut worst = first.verdict;
    if is_first && numbers.contains(number) {
        metered.member(first)?;
    }
    for other in numbers.iter().filter(|n| !is_first || *n != number) {
        let row = members.row(*other, metered)?;
        worst = worst.max(row.verdict);
        metered.member(row)?;
    }
    Ok(worst)
}

/// Decides when the results of finished load steps are stored as a partial result: not after each step, since all of
/// these results are written each time and a problem may have a thousand steps; and not at all once the partial result
/// is large.
pub(super) struct Partials {
    /// The shortest time between two partial results.
    pause: Duration,
    /// The largest part of the time that storing partial results may take, as 1/`part`.
    part: u32,
    /// When the job began.
    begun: Instant,
    /// The time when the next partial result may be stored; `None` once a partial result was too large.
    next: Option<Instant>,
}

impl Partials {
    /// Partial results are stored at most once a second, and storing takes at most a tenth of the time.
    fn paced() -> Self {
        Partials {
            pause: Duration::from_secs(1),
            part: 10,
            begun: Instant::now(),
            next: Some(Instant::now()),
        }
    }

    /// Partial results are stored after every step, as on a slow machine, so that tests do not depend on the clock.
    #[cfg(test)]
    pub(super) fn every_step() -> Self {
        Partials {
            pause: Duration::ZERO,
            part: 0,
            ..Partials::paced()
        }
    }

    /// The partial result on a mesh that is not the last, if it is time to store one: not in the first second, in which most
    /// problems come to their last mesh.
    fn of_mesh(&mut self, run: &Run<'_>, solution: &Solution) -> Option<Parts> {
        let is_late = self.begun.elapsed() >= self.pause;
        if is_late {
            self.next(run, solution)
        } else {
            None
        }
    }

    /// The partial result, if it is time to store one.
    fn next(&mut self, run: &Run<'_>, solution: &Solution) -> Option<Parts> {
        /// The largest partial result (bytes): it is written in one transaction, which occupies the single writer for
        /// some 40 ms.
        const MOST_BYTES: usize = 4 << 20;
        /// The largest number of points of a partial result: writing them takes a tenth of a second without a check
        /// whether to stop.
        const MOST_POINTS: usize = 20_000;
        let start = Instant::now();
        if self.next.is_none_or(|next| start < next) {
            return None;
        }
        if run::points(solution) > MOST_POINTS {
            self.next = None;
            return None;
        }
        // numbers that are not finite, and so have no JSON, are reported at the end
        let document = run.document_so_far(solution).ok();
        let parts = document.and_then(|mut document| {
            document.history = vec![]; // its events tell that, up to now
            Parts::of(document, &mut || true).ok()?
        });
        self.next = match &parts {
            Some(parts) if parts.bytes() > MOST_BYTES => None,
            _ => Some(start + (start.elapsed() * self.part).max(self.pause)),
        };
        parts.filter(|parts| parts.bytes() <= MOST_BYTES)
    }
}
