//! Load steps and their increments: the incremental law (formulation 1.5), and results along a load
//! history for both laws.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

use crate::accuracy::{self, Increments, Solved};
use crate::algorithm::{
    self, AlongContacts, Averages, EndForces, Extent, Finished, Place, Quantity, Region, Reported,
    Rounding, System, follow_neighbour, report, run_reduced,
};
use crate::body::ElasticBody;
use crate::error::SolveError;
use crate::model::{Alone, Level, Model};
use crate::observer::{Filtered, Observer, Progress};
use crate::origins::Origins;
use crate::problem::{Algorithm, Spacing, Step};
use crate::solution::{
    ContactSummary, Fields, Iteration, Outcome, Phase, Solution, StepSolution, Summary, Warning,
    WarningCode,
};

/// An increment that does not converge is halved this many times before the step ends with it.
const MOST_HALVINGS: u32 = 6;

/// Solves all steps; the end of the last step is the solution. After a step that does not converge no further step is
/// solved. `origins`: receives where the errors of the results come from.
pub fn run(
    model: &Model,
    body: &ElasticBody,
    mut origins: Option<&mut Origins>,
    observer: &mut dyn Observer,
) -> Result<Solution, SolveError> {
    if !has_uncertain_ends(model) {
        let load_history = LoadHistory::new(model, System::new(model, body, observer)?);
        let (solution, _) = run_steps(load_history, body, origins, observer)?;
        return Ok(solution);
    }
    let solved = with_corners(
        (model, body),
        |solution: &Solution| solution.summary.converged,
        observer,
        &mut |load_history, body, observer| {
            if let Some(origins) = origins.as_deref_mut() {
                origins.forget();
            }
            // which contacts the nodes are of may change, and which are open, and with it the solution
            let tentative = &mut Filtered {
                observer,
                seen: |progress| match progress {
                    Progress::Iteration(row) => Some(Progress::Tentative(row)),
                    Progress::Step(_) | Progress::Mesh(_) => None,
                    other => Some(other),
                },
            };
            run_steps(load_history, body, origins.as_deref_mut(), tentative)
        },
    )?;
    for row in &solved.history {
        observer.event(Progress::Iteration(row));
    }
    Ok(solved)
}

/// A function that solves all steps on one body, and returns the result with the load history.
type SolveOn<'s, T> = dyn for<'a> FnMut(
        LoadHistory<'a>,
        &ElasticBody,
        &mut dyn Observer,
    ) -> Result<(T, LoadHistory<'a>), SolveError>
    + 's;

/// Whether only the solution can show which contact owns a common end of two, or whether an end on the axis stays open.
fn has_uncertain_ends(model: &Model) -> bool {
    !model.common_nodes().is_empty() || model.hollow_at_axis()
}

/// Solves with common ends of contacts as the model assigns them, and again while the solution shows another
/// assignment: each end is tried with one contact, then the other, and finally with both. Where the node on the axis is
/// open and the midside node is pressed, the steps are solved once more with the node on the axis left open; if the
/// node then touches, or the iterations do not converge, the solution before is used.
fn with_corners<T>(
    (model, body): (&Model, &ElasticBody),
    converged: impl Fn(&T) -> bool,
    observer: &mut dyn Observer,
    solve: &mut SolveOn<'_, T>,
) -> Result<T, SolveError> {
    let mut tried = vec![model.alone.clone()];
    let mut both: BTreeSet<u32> = BTreeSet::new();
    let mut other: Option<(Model, ElasticBody)> = None;
    let mut closed: Option<T> = None;
    loop {
        let (model, body) = match &other {
            Some((model, body)) => (model, body),
            None => (model, body),
        };
        let (solved, next, open) = {
            let load_history = LoadHistory::new(model, System::new(model, body, observer)?);
            let solved = solve(load_history, body, observer);
            let fails = solved
                .as_ref()
                .map_or(true, |(solved, _)| !converged(solved));
            if fails && let Some(closed) = closed.take() {
                return Ok(closed);
            }
            let (solved, mut load_history) = solved?;
            let wrong = !load_history.of_both.is_empty();
            both.append(&mut load_history.of_both);
            let end = load_history.last.as_ref().map(|last| &last.state);
            let next = algorithm::better(&load_history.system, end, &both);
            let untried = next.filter(|next| !tried.contains(next));
            // what does not come to rest is of both in the end, also where that was tried at first: in a solution that is
            // wrong a body passes an obstacle
            let next = untried.or(wrong.then(Alone::new));
            let system = &load_history.system;
            if end.is_some_and(|end| algorithm::closed_on_axis(system, end))
                && let Some(closed) = closed.take()
            {
                return Ok(closed);
            }
            let open = end.map(|end| algorithm::open_on_axis(system, end));
            let open =
                open.filter(|open| closed.is_none() && !open.is_empty() && model.hollow_at_axis());
            (solved, next, open)
        };
        let next = match (next, open) {
            (Some(next), _) => {
                tried.push(next.clone());
                model.with_alone(next)
            }
            (None, Some(open)) => {
                closed = Some(solved);
                model.with_open_on_axis(open)
            }
            (None, None) => return Ok(solved),
        };
        let body = ElasticBody::new(&next, observer)?;
        other = Some((next, body));
    }
}

fn run_steps<'a>(
    mut load_history: LoadHistory<'a>,
    body: &ElasticBody,
    mut origins: Option<&mut Origins>,
    observer: &mut dyn Observer,
) -> Result<(Solution, LoadHistory<'a>), SolveError> {
    let model = load_history.model;
    let steps = &steps_of(model);
    let mut so_far: Option<Solution> = None;
    let mut more = Again::default();
    let mut fields = Fields::default();
    for (number, step) in steps.iter().enumerate() {
        if let Some(solution) = &so_far {
            observer.event(Progress::Step(solution));
        }
        observer.event(Progress::Phase(Phase::Iterate));
        let (finished, rows) = load_history.step(number as u32, step, observer);
        // a stopped solution is reported too, if that is little work
        observer.event(Progress::Phase(Phase::Recover));
        load_history.system.threads = body.threads(observer);
        let reported = report(&load_history.system, &finished, observer)?;
        let outcome = reported.summary.outcome;
        let last = number + 1 == steps.len() || !can_continue(outcome);
        let assessed = last && !model.contacts.is_empty();
        if last && outcome == Outcome::Converged && model.depends_on_path() {
            let finer = Increments::more(steps);
            (load_history, more) = again_in(load_history, &finer, observer);
        }
        let accuracy = assessed.then(|| {
            let (system, mut origins) = (&load_history.system, origins.take());
            if let Some(origins) = origins.as_deref_mut() {
                let places = reported.along.missed.iter();
                places.for_each(|place| origins.add_place(model, place.patch, place.s));
            }
            let increments = model.depends_on_path().then(|| {
                let quantities = std::mem::take(&mut more.quantities);
                Increments::new(steps, &Increments::more(steps), quantities)
            });
            let solved = Solved {
                system,
                finished: &finished,
                reported: &reported,
            };
            accuracy::assess(solved, increments.as_ref(), origins, observer)
        });
        let mut summary = reported.summary;
        summary.accuracy = accuracy;
        if assessed && summary.converged && observer.stop() {
            // its errors would be unknown for no reason of its own, and others would be given them
            summary.accuracy = None;
            (summary.outcome, summary.converged) = (Outcome::Canceled, false);
        }
        if model.controls.check_uniqueness && summary.converged {
            let (system, controls) = (&load_history.system, &model.controls);
            let second = algorithm::other_solution(system, controls, &finished, observer);
            algorithm::note_uniqueness(&mut summary, second);
        }
        summary.increments = load_history.increments;
        summary.cut_backs = load_history.cut_backs;
        fields = reported.fields;
        let name = step.name.clone().unwrap_or_else(|| number.to_string());
        so_far = Some(with_step(
            so_far.take(),
            name,
            summary,
            rows,
            reported.along,
        ));
        if !can_continue(outcome) {
            break;
        }
    }
    let Some(mut solution) = so_far else {
        unreachable!(
            "there is at least one load step: `steps_of` gives one for a problem that lists none"
        )
    };
    // those of the last step are a part of its errors
    let earlier = solution.steps.len().saturating_sub(1);
    for (step, forces) in solution.steps.iter_mut().take(earlier).zip(&more.forces) {
        algorithm::warn_of_increments(step, forces);
    }
    if model.controls.check_increments && solution.summary.converged {
        let summary = &mut solution.summary;
        load_history = note_doubled(model, load_history, steps, summary, observer);
    }
    tell_of_earlier_steps(&mut solution);
    let summary = &mut solution.summary;
    if let Some(accuracy) = &mut summary.accuracy {
        accuracy::limit_by(&summary.warnings, accuracy);
    }
    accuracy::note_unknown_signs(&mut solution, |name| {
        let own = model.contacts.iter().find(|contact| contact.name == name);
        own.map_or(String::new(), |contact| contact.pointer.clone())
    });
    if model.steps.is_empty() {
        solution.steps.clear();
    }
    solution.fields = fields;
    Ok((solution, load_history))
}

/// The solution of the load steps `so_far` and of one more, which ended with `summary` after the iterations `rows`; `along` has
/// its profiles. Fields of nodes and elements are left empty: those of the last step are added at the end.
fn with_step(
    so_far: Option<Solution>,
    name: String,
    mut summary: Summary,
    rows: Vec<Iteration>,
    along: AlongContacts,
) -> Solution {
    let (mut history, mut steps) = match so_far {
        Some(solution) => (solution.history, solution.steps),
        None => (Vec::new(), Vec::new()),
    };
    summary.iterations = rows.len() as u32;
    history.extend(rows.iter().cloned());
    steps.push(StepSolution {
        name,
        summary: Summary {
            accuracy: None,
            ..summary.clone()
        },
        history: rows,
        profiles: along.profiles.clone(),
        node_profiles: along.node_profiles.clone(),
        friction_profiles: along.friction_profiles.clone(),
    });
    summary.iterations = history.len() as u32;
    Solution {
        summary,
        history,
        profiles: along.profiles,
        node_profiles: along.node_profiles,
        friction_profiles: along.friction_profiles,
        steps,
        fields: Fields::default(),
    }
}

/// Data that problems on one body share.
#[derive(Default)]
pub struct Shared {
    averages: Averages,
    region: Region,
}

/// The final state of a problem without load steps, from which problems with slightly different numbers can start.
#[derive(Clone)]
pub struct End {
    finished: Finished,
    /// The displacements v of the final state that this problem started from by [`Start::Next`], if it did.
    before: Option<Vec<f64>>,
    extent: Extent,
}

/// The start of a problem without load steps.
#[derive(Clone, Copy)]
pub enum Start<'a> {
    /// The problem's own start.
    Anew,
    /// The final state of a neighbour.
    Near(&'a End),
    /// The final state of a neighbour that was solved just before: its factors may be reused, and if the neighbour
    /// itself started from [`Start::Next`], both states are extrapolated. Whether this or [`Start::Near`] is used
    /// decides about the last bits.
    Next(&'a End),
}

/// The results at the end of all steps that need no displacements inside the body.
pub struct Numbers {
    /// The end of the last step.
    pub finished: Finished,
    /// The scalars by the names of the contacts.
    pub contacts: BTreeMap<String, ContactSummary>,
    /// The number of iterations: those of the history or, if the solution began at that of a similar problem, those since
    /// this beginning.
    pub iterations: u32,
    /// What to consider before relying on the numbers.
    pub warnings: Vec<Warning>,
}

/// Solves all steps for the numbers at the end only; also returns the final state, if other problems can start from it.
/// If a problem does not converge well from its start, it is solved as [`run`] does.
pub fn run_to_numbers(
    model: &Model,
    body: &ElasticBody,
    shared: &mut Shared,
    start: Start<'_>,
    observer: &mut dyn Observer,
) -> Result<(Numbers, Option<End>), SolveError> {
    if has_uncertain_ends(model) {
        let numbers = with_corners(
            (model, body),
            |numbers: &Numbers| numbers.finished.outcome == Outcome::Converged,
            observer,
            &mut |mut load_history, _, observer| {
                Ok((load_history.numbers(observer)?, load_history))
            },
        )?;
        return Ok((numbers, None));
    }
    let system = System::with_averages(model, body, &mut shared.averages, observer)?;
    let mut load_history = LoadHistory::new(model, system);
    let region = &mut shared.region;
    let (end, next) = match start {
        Start::Anew => (None, false),
        Start::Near(end) => (Some(end), false),
        Start::Next(end) => (Some(end), true),
    };
    match end {
        Some(end) => region.reach(&end.extent, next),
        None => region.reach(&Extent::default(), false),
    }
    let near = end.and_then(|end| {
        let system = &load_history.system;
        let last = &end.finished;
        let sizes = [last.state.v.len(), last.bound.len()];
        if !model.steps.is_empty() || sizes != [system.load.len(), system.points.len()] {
            return None;
        }
        let before = end.before.as_deref().filter(|_| next);
        follow_neighbour(system, &model.controls, (last, before), region, observer)
    });
    let (finished, iterations) = match near {
        Some(near) => near,
        None => {
            std::mem::swap(&mut load_history.region, region);
            let followed = load_history.follow(&steps_of(model), observer);
            std::mem::swap(&mut load_history.region, region);
            let Some(finished) = followed else {
                unreachable!(
                    "there is at least one load step: `steps_of` gives one for a problem that lists none"
                )
            };
            (finished, load_history.row_count)
        }
    };
    if finished.outcome == Outcome::Canceled {
        return Err(SolveError::Stopped);
    }
    let (contacts, warnings) = algorithm::numbers(&load_history.system, &finished, observer)?;
    let others_begin = finished.outcome == Outcome::Converged && model.steps.is_empty();
    let left = others_begin.then(|| End {
        finished: Finished {
            history: Vec::new(),
            ..finished.clone()
        },
        before: match start {
            Start::Next(before) => Some(before.finished.state.v.clone()),
            Start::Anew | Start::Near(_) => None,
        },
        extent: region.extent(),
    });
    let numbers = Numbers {
        finished,
        contacts,
        iterations,
        warnings,
    };
    Ok((numbers, left))
}

/// Repeats at the end of the path those warnings about earlier steps that concern the end too: kinematics that are not
/// small, too few increments, and a second solution.
fn tell_of_earlier_steps(solution: &mut Solution) {
    let Some((_, earlier)) = solution.steps.split_last() else {
        return;
    };
    for step in earlier {
        for warning in &step.summary.warnings {
            let lasting = matches!(
                warning.code,
                WarningCode::LargeSlip
                    | WarningCode::LargeStrain
                    | WarningCode::LargeDisplacement
                    | WarningCode::IncrementsMatter
                    | WarningCode::NotUnique
            );
            let told = &mut solution.summary.warnings;
            let known = told
                .iter()
                .any(|other| other.code == warning.code && other.pointer == warning.pointer);
            if lasting && !known {
                told.push(Warning {
                    message: format!("In load step {:?}: {}", step.name, warning.message),
                    ..warning.clone()
                });
            }
        }
    }
}

/// Solves all steps to the end without assessing the solution or comparing it with another: for a solution that is
/// itself used in a comparison.
pub fn run_to_compare(
    model: &Model,
    body: &ElasticBody,
    observer: &mut dyn Observer,
) -> Result<Reported, SolveError> {
    with_corners(
        (model, body),
        |reported: &Reported| reported.summary.converged,
        observer,
        &mut |mut load_history, body, observer| {
            let model = load_history.model;
            match load_history.follow(&steps_of(model), observer) {
                Some(finished) if finished.outcome != Outcome::Canceled => {
                    load_history.system.threads = body.threads(observer);
                    let reported = report(&load_history.system, &finished, observer)?;
                    Ok((reported, load_history))
                }
                _ => Err(SolveError::Stopped),
            }
        },
    )
}

/// The load steps of a model; a problem without steps has one step.
fn steps_of(model: &Model) -> Cow<'_, [Step]> {
    match &model.steps[..] {
        [] => Cow::Owned(vec![Step::whole()]),
        steps => Cow::Borrowed(steps),
    }
}

/// The result of following a load path again in other increments.
#[derive(Default)]
struct Again {
    /// The quantities at the end of the path; empty if the path did not converge.
    quantities: Vec<Quantity>,
    /// The forces at the end of every step.
    forces: Vec<EndForces>,
    rounding: Option<Rounding>,
}

/// Follows the load path of `first` again in `steps`, without reporting to the observer. It restores the load history
/// afterwards: the finer path must not change any result through the common ends of contacts, so that results do not
/// depend on whether errors are requested.
fn again_in<'a>(
    first: LoadHistory<'a>,
    steps: &[Step],
    observer: &mut dyn Observer,
) -> (LoadHistory<'a>, Again) {
    let quiet = &mut algorithm::quiet(observer);
    let mut system = first.system;
    let path = system.restart();
    let mut second = LoadHistory::new(first.model, system);
    let mut again = Again::default();
    for (number, step) in steps.iter().enumerate() {
        let (finished, _) = second.step(number as u32, step, quiet);
        again.forces.push(EndForces::new(&second.system, &finished));
        if number + 1 == steps.len() && finished.outcome == Outcome::Converged {
            again.quantities = algorithm::quantities(&second.system, &finished, quiet);
        }
        if !can_continue(finished.outcome) {
            break;
        }
    }
    again.rounding = second.rounding;
    system = second.system;
    system.resume(path);
    (LoadHistory { system, ..first }, again)
}

/// Records how much the forces change with twice as many increments. The load history is restored afterwards.
fn note_doubled<'a>(
    model: &Model,
    first: LoadHistory<'a>,
    steps: &[Step],
    summary: &mut Summary,
    observer: &mut dyn Observer,
) -> LoadHistory<'a> {
    let twice = |step: &Step| Step {
        increments: 2 * step.increments,
        ..step.clone()
    };
    let twice: Vec<Step> = steps.iter().map(twice).collect();
    let rounding = first.rounding;
    let (first, second) = again_in(first, &twice, observer);
    let rounding = algorithm::rounding_of_forces([rounding, second.rounding]);
    let tolerance = model.controls.tolerance.max(rounding);
    if let Some(forces) = second.forces.last() {
        let second = forces.compared(summary, tolerance);
        algorithm::note_doubled_increments(summary, second);
    }
    first
}

/// Whether another increment can start after one with this outcome: the thesis's own iteration may converge to false
/// states and continue from them.
fn can_continue(outcome: Outcome) -> bool {
    matches!(outcome, Outcome::Converged | Outcome::FalseConvergence)
}

/// The state while the load steps are solved.
struct LoadHistory<'a> {
    model: &'a Model,
    system: System<'a>,
    /// The part of the contacts that may touch.
    region: Region,
    /// The end of the last increment.
    last: Option<Finished>,
    /// The load level at the end of the last increment.
    level: Level,
    /// Whether the anchors have moved since the end of the last increment.
    anchors_moved: bool,
    rows: Vec<Iteration>,
    row_count: u32,
    increments: u32,
    cut_backs: u32,
    /// Common ends of contacts that were assigned to one contact alone, although both contacts touch there in some
    /// increment.
    of_both: BTreeSet<u32>,
    /// The rounding of the increment, of those so far, where rounding leaves the largest residual.
    rounding: Option<Rounding>,
}

impl<'a> LoadHistory<'a> {
    fn new(model: &'a Model, system: System<'a>) -> Self {
        LoadHistory {
            model,
            system,
            region: Region::default(),
            last: None,
            level: Level::ZERO,
            anchors_moved: true,
            rows: Vec::new(),
            row_count: 0,
            increments: 0,
            cut_backs: 0,
            of_both: BTreeSet::new(),
            rounding: None,
        }
    }

    /// Solves all steps for the numbers at their end.
    fn numbers(&mut self, observer: &mut dyn Observer) -> Result<Numbers, SolveError> {
        let finished = self.follow(&steps_of(self.model), observer);
        let Some(finished) = finished.filter(|end| end.outcome != Outcome::Canceled) else {
            return Err(SolveError::Stopped);
        };
        let (contacts, warnings) = algorithm::numbers(&self.system, &finished, observer)?;
        Ok(Numbers {
            finished,
            contacts,
            iterations: self.row_count,
            warnings,
        })
    }

    /// Solves one step after another until one does not converge; returns the end of the last one solved.
    fn follow(&mut self, steps: &[Step], observer: &mut dyn Observer) -> Option<Finished> {
        let mut last = None;
        for (number, step) in steps.iter().enumerate() {
            let (finished, _) = self.step(number as u32, step, observer);
            let hopeful = can_continue(finished.outcome);
            last = Some(finished);
            if !hopeful {
                break;
            }
        }
        last
    }

    /// Solves one step; returns the end of the step, and the step's rows of the history.
    fn step(
        &mut self,
        number: u32,
        step: &Step,
        observer: &mut dyn Observer,
    ) -> (Finished, Vec<Iteration>) {
        let path = StepPath {
            from: self.level,
            step,
            power: self.model.contacts.iter().find_map(|c| c.power),
        };
        let count = step.increments;
        let mut increment = 0;
        for k in 1..=count {
            let (from, to) = (
                f64::from(k - 1) / f64::from(count),
                f64::from(k) / f64::from(count),
            );
            let place = (number, &mut increment);
            let finished = self.advance(&path, place, from, to, 0, observer);
            if !can_continue(finished.outcome) || k == count {
                let finished = Finished {
                    rounding: self.rounding,
                    ..finished
                };
                return (finished, std::mem::take(&mut self.rows));
            }
        }
        unreachable!("a step has at least one increment: Model::new checks it")
    }

    /// Solves from one part of a step to another; if this does not converge, in two halves.
    fn advance(
        &mut self,
        path: &StepPath<'_>,
        (step, increment): (u32, &mut u32),
        from: f64,
        to: f64,
        halvings: u32,
        observer: &mut dyn Observer,
    ) -> Finished {
        let finished = self.increment(path, (step, *increment), to, observer);
        let hopeful = !self.model.steps.is_empty()
            && self.model.controls.algorithm != Algorithm::Thesis
            // in half an increment displacements are as large
            && finished.rounding.is_none()
            // loads that slide the body away do so in smaller parts too
            && finished.slide.is_none()
            && halvings < MOST_HALVINGS;
        match finished.outcome {
            Outcome::NotConverged | Outcome::ContactCycling if hopeful => {
                self.cut_backs += 1;
                let middle = 0.5 * (from + to);
                let half = self.advance(
                    path,
                    (step, increment),
                    from,
                    middle,
                    halvings + 1,
                    observer,
                );
                if !can_continue(half.outcome) {
                    return half;
                }
                self.advance(path, (step, increment), middle, to, halvings + 1, observer)
            }
            _ => {
                *increment += 1;
                finished
            }
        }
    }

    /// Solves at one load level; the next increment starts from its end if that is converged.
    fn increment(
        &mut self,
        path: &StepPath<'_>,
        (step, increment): (u32, u32),
        to: f64,
        observer: &mut dyn Observer,
    ) -> Finished {
        if let (Some(last), false) = (&self.last, self.anchors_moved) {
            self.system.end_increment(&last.state, &last.bound);
            self.anchors_moved = true;
        }
        let level = path.level(to);
        self.system.set_level(level);
        let place = Place {
            step,
            increment,
            rows: self.row_count,
        };
        let controls = &self.model.controls;
        let last = self.last.as_ref();
        let finished = run_reduced(
            &self.system,
            controls,
            place,
            last,
            &mut self.region,
            observer,
        );
        self.row_count += finished.history.len() as u32;
        self.rows.extend(finished.history.iter().cloned());
        let residual = |rounding: &Option<Rounding>| rounding.map_or(0.0, |r| r.residual);
        if residual(&finished.rounding) > residual(&self.rounding) {
            self.rounding = finished.rounding;
        }
        if finished.outcome != Outcome::Canceled {
            let both = algorithm::touched_by_both(&self.system, &finished.state);
            self.of_both.extend(both);
        }
        if can_continue(finished.outcome) {
            self.increments += 1;
            self.level = level;
            self.last = Some(finished.clone());
            self.anchors_moved = false;
        }
        finished
    }
}

/// The path from the level before a step to the step's end.
struct StepPath<'a> {
    from: Level,
    step: &'a Step,
    /// The exponent of the first obstacle's profile that is a power; `None` if no profile is a power.
    power: Option<f64>,
}

impl StepPath<'_> {
    /// The level at a part of the step, 0 … 1.
    fn level(&self, part: f64) -> Level {
        let to = Level::end_of(self.step);
        let mut level = Level::between(&self.from, &to, part);
        let ([from, ..], [to, ..]) = (self.from.motions, to.motions);
        // a contact's width grows like the root of the indentation
        if let (Spacing::ContactWidth, Some(power)) = (self.step.spacing, self.power)
            && from >= 0.0
            && to >= 0.0
            && part < 1.0
        {
            let [from, to] = [from, to].map(|factor| factor.powf(1.0 / power));
            level.motions[0] = (from + part * (to - from)).powf(power);
        }
        level
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn widths_or_indentations_grow_evenly_and_end_exactly() {
        let mut step = Step {
            indentation: 0.9,
            tangential_displacement: 0.3,
            ..Step::whole()
        };
        let at = |step: &Step, power, part| {
            let path = StepPath {
                from: Level::ZERO,
                step,
                power,
            };
            path.level(part)
        };
        let half = at(&step, Some(2.0), 0.5);
        assert_eq!((half.motions[0], half.loads), (0.45, 0.5));
        step.spacing = Spacing::ContactWidth;
        let half = at(&step, Some(2.0), 0.5);
        assert!((half.motions[0] - 0.225).abs() < 1e-15);
        assert_eq!(half.motions[1], 0.15);
        assert_eq!(at(&step, None, 0.5).motions[0], 0.45);
        assert_eq!(at(&step, Some(2.0), 1.0).motions[0], 0.9);
    }
}
