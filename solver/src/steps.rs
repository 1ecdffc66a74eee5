//! Load steps and their increments: the incremental law (formulation 1.5), and results along a load
//! history for both laws.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

use crate::accuracy::{self, Increments};
use crate::algorithm::{
    self, Averages, EndForces, Extent, Finished, Place, Quantity, Region, Reported, Rounding,
    System, report, run_near, settle_near,
};
use crate::body::ElasticBody;
use crate::error::SolveError;
use crate::model::{Alone, Level, Model};
use crate::origins::Origins;
use crate::problem::{Algorithm, Spacing, Step};
use crate::solution::{
    ContactSummary, Fields, Iteration, Observer, Outcome, Phase, Progress, Solution, StepSolution,
    Summary, Warning, WarningCode,
};

/// An increment that does not converge is halved this often before the step ends there.
const MOST_HALVINGS: u32 = 6;

/// Solves all steps; the end of the last one is the solution. After a step that does not converge no other follows.
/// `origins`: where the errors of its results come from is noted there.
pub fn run(
    model: &Model,
    body: &ElasticBody,
    mut origins: Option<&mut Origins>,
    observe: &mut Observer<'_>,
) -> Result<Solution, SolveError> {
    if !has_uncertain_ends(model) {
        let load_history = LoadHistory::new(model, System::new(model, body, observe)?);
        let (solution, _) = run_steps(load_history, body, origins, observe)?;
        return Ok(solution);
    }
    let solved = with_corners(
        (model, body),
        |solution: &Solution| solution.summary.converged,
        observe,
        &mut |load_history, body, observe| {
            if let Some(origins) = origins.as_deref_mut() {
                origins.forget();
            }
            // which contacts the nodes are of may change, and which are open, and with it the solution
            let tentative: &mut Observer<'_> = &mut |progress| match progress {
                Progress::Iteration(row) => observe(Progress::Tentative(row)),
                Progress::Step(_) => observe(Progress::Pulse),
                other => observe(other),
            };
            run_steps(load_history, body, origins.as_deref_mut(), tentative)
        },
    )?;
    for row in &solved.history {
        let _ = observe(Progress::Iteration(row));
    }
    Ok(solved)
}

/// Solves all steps on one body; the history is given back.
type SolveOn<'s, T> = dyn for<'a> FnMut(
        LoadHistory<'a>,
        &ElasticBody,
        &mut Observer<'_>,
    ) -> Result<(T, LoadHistory<'a>), SolveError>
    + 's;

/// Whether the solution has to show which contact a common end of two is of, or whether an end on the axis stays open.
fn has_uncertain_ends(model: &Model) -> bool {
    !model.common_nodes().is_empty() || model.hollow_at_axis()
}

/// Solves with the common ends of contacts as the model has them, and again while the solution shows that they are of other
/// contacts: each is tried as one contact's or the other's, and in the end as that of both. Where the node on the axis is
/// open and the midside node presses, once more with that node left open; if it touches then, or that does not converge, the
/// solution before stands.
fn with_corners<T>(
    (model, body): (&Model, &ElasticBody),
    converged: impl Fn(&T) -> bool,
    observe: &mut Observer<'_>,
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
            let load_history = LoadHistory::new(model, System::new(model, body, observe)?);
            let solved = solve(load_history, body, observe);
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
        let body = ElasticBody::new(&next, observe)?;
        other = Some((next, body));
    }
}

fn run_steps<'a>(
    mut load_history: LoadHistory<'a>,
    body: &ElasticBody,
    mut origins: Option<&mut Origins>,
    observe: &mut Observer<'_>,
) -> Result<(Solution, LoadHistory<'a>), SolveError> {
    let model = load_history.model;
    let steps = &steps_of(model);
    let mut so_far: Option<Solution> = None;
    let mut more = Again::default();
    let mut fields = Fields::default();
    for (number, step) in steps.iter().enumerate() {
        if let Some(solution) = &so_far {
            let _ = observe(Progress::Step(solution));
        }
        let _ = observe(Progress::Phase(Phase::Iterate));
        let (finished, rows) = load_history.step(number as u32, step, observe);
        // a stopped solution is reported too, if that is little work
        let _ = observe(Progress::Phase(Phase::Recover));
        load_history.system.threads = body.threads(observe);
        let reported = report(model, body, &load_history.system, &finished, observe)?;
        let outcome = reported.summary.outcome;
        let last = number + 1 == steps.len() || !can_continue(outcome);
        let assessed = last && !model.contacts.is_empty();
        if last && outcome == Outcome::Converged && model.depends_on_path() {
            let finer = Increments::more(steps);
            (load_history, more) = again_in(load_history, &finer, observe);
        }
        let accuracy = assessed.then(|| {
            let (system, mut origins) = (&load_history.system, origins.take());
            if let Some(origins) = origins.as_deref_mut() {
                let places = reported.missed.iter();
                places.for_each(|place| origins.add_place(model, place.patch, place.s));
            }
            let increments = model.depends_on_path().then(|| {
                let quantities = std::mem::take(&mut more.quantities);
                Increments::new(steps, &Increments::more(steps), quantities)
            });
            let known = (&finished, &reported, increments.as_ref());
            accuracy::assess(model, body, system, known, origins, observe)
        });
        let mut summary = reported.summary;
        summary.accuracy = accuracy;
        if model.controls.check_uniqueness && summary.converged {
            let (system, controls) = (&load_history.system, &model.controls);
            let second = algorithm::other_solution(system, controls, &finished, observe);
            algorithm::note_uniqueness(&mut summary, second);
        }
        summary.increments = load_history.increments;
        summary.cut_backs = load_history.cut_backs;
        summary.iterations = rows.len() as u32;
        let (mut history, mut ends) = match so_far.take() {
            Some(solution) => (solution.history, solution.steps),
            None => (Vec::new(), Vec::new()),
        };
        history.extend(rows.iter().cloned());
        ends.push(StepSolution {
            name: step.name.clone().unwrap_or_else(|| number.to_string()),
            summary: Summary {
                accuracy: None,
                ..summary.clone()
            },
            history: rows,
            profiles: reported.profiles.clone(),
            node_profiles: reported.node_profiles.clone(),
            friction_profiles: reported.friction_profiles.clone(),
        });
        summary.iterations = history.len() as u32;
        fields = reported.fields;
        so_far = Some(Solution {
            summary,
            history,
            profiles: reported.profiles,
            node_profiles: reported.node_profiles,
            friction_profiles: reported.friction_profiles,
            steps: ends,
            fields: Fields::default(),
        });
        if !can_continue(outcome) {
            break;
        }
    }
    let Some(mut solution) = so_far else {
        unreachable!("there is at least one step: a problem without steps is one step")
    };
    // those of the last step are a part of its errors
    let earlier = solution.steps.len().saturating_sub(1);
    for (step, forces) in solution.steps.iter_mut().take(earlier).zip(&more.forces) {
        algorithm::warn_of_increments(step, forces);
    }
    if model.controls.check_increments && solution.summary.converged {
        let summary = &mut solution.summary;
        load_history = note_doubled(model, load_history, steps, summary, observe);
    }
    tell_of_earlier_steps(&mut solution);
    let summary = &mut solution.summary;
    if let Some(accuracy) = &mut summary.accuracy {
        accuracy::limit_by(&summary.warnings, accuracy);
    }
    if model.steps.is_empty() {
        solution.steps.clear();
    }
    solution.fields = fields;
    Ok((solution, load_history))
}

/// What problems on one body share.
#[derive(Default)]
pub struct Shared {
    averages: Averages,
    region: Region,
}

/// The end of a problem without load steps, from which those begin whose numbers differ a little.
#[derive(Clone)]
pub struct End {
    finished: Finished,
    /// v of the end before it, if it came next after that.
    before: Option<Vec<f64>>,
    extent: Extent,
}

/// Where a problem without load steps begins.
#[derive(Clone, Copy)]
pub enum Start<'a> {
    /// As on its own.
    Anew,
    /// From the end of a neighbour.
    Near(&'a End),
    /// The same, where that neighbour was solved just before: its factors may serve, and if it was the next after another
    /// one itself, the way goes on from both. Whether it is this or [`Start::Near`] decides about the last bits.
    Next(&'a End),
}

/// The numbers of the end of all steps: what is known without the displacements of the whole body.
pub struct Numbers {
    /// The end of the last step.
    pub finished: Finished,
    /// By the names of the contacts.
    pub contacts: BTreeMap<String, ContactSummary>,
    /// Rows of the history, or steps from the neighbour.
    pub iterations: u32,
    /// What to consider before relying on the numbers.
    pub warnings: Vec<Warning>,
}

/// The same path to its end, for its numbers alone; and its end, if others can begin from it. Where a problem does not
/// converge well from its start, it is solved as [`run`] does.
pub fn run_to_numbers(
    model: &Model,
    body: &ElasticBody,
    shared: &mut Shared,
    start: Start<'_>,
    observe: &mut Observer<'_>,
) -> Result<(Numbers, Option<End>), SolveError> {
    if has_uncertain_ends(model) {
        let numbers = with_corners(
            (model, body),
            |numbers: &Numbers| numbers.finished.outcome == Outcome::Converged,
            observe,
            &mut |mut load_history, _, observe| Ok((load_history.numbers(observe)?, load_history)),
        )?;
        return Ok((numbers, None));
    }
    let system = System::with_averages(model, body, &mut shared.averages, observe)?;
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
        settle_near(system, &model.controls, (last, before), region, observe)
    });
    let (finished, iterations) = match near {
        Some(near) => near,
        None => {
            std::mem::swap(&mut load_history.region, region);
            let followed = load_history.follow(&steps_of(model), observe);
            std::mem::swap(&mut load_history.region, region);
            let Some(finished) = followed else {
                unreachable!("there is at least one step: a problem without steps is one step")
            };
            (finished, load_history.row_count)
        }
    };
    if finished.outcome == Outcome::Canceled {
        return Err(SolveError::Stopped);
    }
    let (contacts, warnings) = algorithm::numbers(model, &load_history.system, &finished, observe)?;
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

/// Adds to the end of the path what was told of an earlier step alone and the end rests on: kinematics that were not small,
/// increments that were too few, and another solution.
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

/// The same path to its end, of which nothing is assessed, and which is not compared with another: for a solution that is
/// compared itself.
pub fn run_to_compare(
    model: &Model,
    body: &ElasticBody,
    observe: &mut Observer<'_>,
) -> Result<Reported, SolveError> {
    with_corners(
        (model, body),
        |reported: &Reported| reported.summary.converged,
        observe,
        &mut |mut load_history, body, observe| {
            let model = load_history.model;
            match load_history.follow(&steps_of(model), observe) {
                Some(finished) if finished.outcome != Outcome::Canceled => {
                    load_history.system.threads = body.threads(observe);
                    let reported = report(model, body, &load_history.system, &finished, observe)?;
                    Ok((reported, load_history))
                }
                _ => Err(SolveError::Stopped),
            }
        },
    )
}

/// The load steps; a problem without steps is one step.
fn steps_of(model: &Model) -> Cow<'_, [Step]> {
    match &model.steps[..] {
        [] => Cow::Owned(vec![Step::whole()]),
        steps => Cow::Borrowed(steps),
    }
}

/// What the same path in other increments comes to.
#[derive(Default)]
struct Again {
    /// The quantities of its end; none if it did not converge.
    quantities: Vec<Quantity>,
    /// At the end of every step.
    forces: Vec<EndForces>,
    rounding: Option<Rounding>,
}

/// The same path in these steps, without reporting to the observer. The first history is then as it was: what a finer path
/// finds at the common ends of contacts changes no result, which is the same whether its errors are asked for or not.
fn again_in<'a>(
    first: LoadHistory<'a>,
    steps: &[Step],
    observe: &mut Observer<'_>,
) -> (LoadHistory<'a>, Again) {
    let quiet: &mut Observer<'_> = &mut algorithm::quiet(observe);
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

/// Notes how much twice the increments change the forces. The history is then as it was.
fn note_doubled<'a>(
    model: &Model,
    first: LoadHistory<'a>,
    steps: &[Step],
    summary: &mut Summary,
    observe: &mut Observer<'_>,
) -> LoadHistory<'a> {
    let twice = |step: &Step| Step {
        increments: 2 * step.increments,
        ..step.clone()
    };
    let twice: Vec<Step> = steps.iter().map(twice).collect();
    let rounding = first.rounding;
    let (first, second) = again_in(first, &twice, observe);
    let rounding = algorithm::rounding_of_forces([rounding, second.rounding]);
    let tolerance = model.controls.tolerance.max(rounding);
    if let Some(forces) = second.forces.last() {
        let second = forces.compared(summary, tolerance);
        algorithm::note_doubled_increments(summary, second);
    }
    first
}

/// Whether a next increment can start from this end: the thesis's own iteration settles in false states and
/// continues from them.
fn can_continue(outcome: Outcome) -> bool {
    matches!(outcome, Outcome::Converged | Outcome::FalseConvergence)
}

/// State while the load steps are solved.
struct LoadHistory<'a> {
    model: &'a Model,
    system: System<'a>,
    /// The part of the contacts that may touch.
    region: Region,
    /// The end of the last increment.
    last: Option<Finished>,
    /// Its level.
    level: Level,
    /// Whether the anchors have moved since then.
    anchors_moved: bool,
    rows: Vec<Iteration>,
    row_count: u32,
    increments: u32,
    cut_backs: u32,
    /// Common ends of contacts that were taken to be of one alone, and that both touch in some increment.
    of_both: BTreeSet<u32>,
    /// Of the increment so far that rounding leaves the largest residual of.
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

    /// Solves all steps for the numbers of their end.
    fn numbers(&mut self, observe: &mut Observer<'_>) -> Result<Numbers, SolveError> {
        let finished = self.follow(&steps_of(self.model), observe);
        let Some(finished) = finished.filter(|end| end.outcome != Outcome::Canceled) else {
            return Err(SolveError::Stopped);
        };
        let (contacts, warnings) =
            algorithm::numbers(self.model, &self.system, &finished, observe)?;
        Ok(Numbers {
            finished,
            contacts,
            iterations: self.row_count,
            warnings,
        })
    }

    /// Solves one step after the other until one does not converge: the last end.
    fn follow(&mut self, steps: &[Step], observe: &mut Observer<'_>) -> Option<Finished> {
        let mut last = None;
        for (number, step) in steps.iter().enumerate() {
            let (finished, _) = self.step(number as u32, step, observe);
            let hopeful = can_continue(finished.outcome);
            last = Some(finished);
            if !hopeful {
                break;
            }
        }
        last
    }

    /// Solves one step: its end, and its rows.
    fn step(
        &mut self,
        number: u32,
        step: &Step,
        observe: &mut Observer<'_>,
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
            let finished = self.advance(&path, place, from, to, 0, observe);
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

    /// Solves from one part of a step to another, in halves if that does not converge.
    fn advance(
        &mut self,
        path: &StepPath<'_>,
        (step, increment): (u32, &mut u32),
        from: f64,
        to: f64,
        halvings: u32,
        observe: &mut Observer<'_>,
    ) -> Finished {
        let finished = self.increment(path, (step, *increment), to, observe);
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
                let half =
                    self.advance(path, (step, increment), from, middle, halvings + 1, observe);
                if !can_continue(half.outcome) {
                    return half;
                }
                self.advance(path, (step, increment), middle, to, halvings + 1, observe)
            }
            _ => {
                *increment += 1;
                finished
            }
        }
    }

    /// Solves at one level; the next increment starts from a converged end.
    fn increment(
        &mut self,
        path: &StepPath<'_>,
        (step, increment): (u32, u32),
        to: f64,
        observe: &mut Observer<'_>,
    ) -> Finished {
        if let (Some(last), false) = (&self.last, self.anchors_moved) {
            self.system.move_anchors(&last.state.v, &last.bound);
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
        let finished = run_near(
            &self.system,
            controls,
            place,
            last,
            &mut self.region,
            observe,
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

/// From the level before a step to its end.
struct StepPath<'a> {
    from: Level,
    step: &'a Step,
    /// Power of the first obstacle's profile, where it has one.
    power: Option<f64>,
}

impl StepPath<'_> {
    /// The level at a part of the step, 0 … 1.
    fn level(&self, part: f64) -> Level {
        let between = |from: f64, to: f64| match part {
            1.0 => to,
            _ => from + part * (to - from),
        };
        let Level {
            indentation,
            tangential_displacement,
            loads,
            supports,
        } = self.from;
        let grown = match (self.step.spacing, self.power) {
            // a contact's width grows like the root of the indentation
            (Spacing::ContactWidth, Some(power))
                if indentation >= 0.0 && self.step.indentation >= 0.0 && part < 1.0 =>
            {
                let width = |factor: f64| factor.powf(1.0 / power);
                between(width(indentation), width(self.step.indentation)).powf(power)
            }
            _ => between(indentation, self.step.indentation),
        };
        Level {
            indentation: grown,
            tangential_displacement: between(
                tangential_displacement,
                self.step.tangential_displacement,
            ),
            loads: between(loads, self.step.loads),
            supports: between(supports, self.step.supports),
        }
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
        assert_eq!((half.indentation, half.loads), (0.45, 0.5));
        step.spacing = Spacing::ContactWidth;
        let half = at(&step, Some(2.0), 0.5);
        assert!((half.indentation - 0.225).abs() < 1e-15);
        assert_eq!(half.tangential_displacement, 0.15);
        assert_eq!(at(&step, None, 0.5).indentation, 0.45);
        assert_eq!(at(&step, Some(2.0), 1.0).indentation, 0.9);
    }
}
