//! A stopwatch for the time of each phase and iteration of the solver.

use std::{collections::BTreeMap, time::Instant};

use solver::solution::{Iteration, Phase};
use strum::VariantArray;

use crate::event::TimedIteration;

/// The time of each phase (s), by its name.
pub type Timings = BTreeMap<String, f64>;

/// A stopwatch from the start of the solver.
pub(super) struct Stopwatch {
    start: Instant,
    current: Option<(Phase, Instant)>,
    times: Times,
    /// The number of the mesh of adaptive refinement that `times` are for; 0 without adaptive refinement.
    mesh: u32,
    /// The times of the iterations on the mesh before the present one.
    before: Vec<f64>,
}

/// The measured times.
#[derive(Clone, Debug)]
pub(super) struct Times {
    /// The time of every phase, 0 if it was not reached; verification is missing if it was not reached.
    pub(super) phases: Timings,
    /// Whether a body was factored.
    pub(super) factored: bool,
    /// The seconds from the start to the end of each iteration, in the order of their numbers.
    iterations: Vec<f64>,
}

impl Stopwatch {
    pub(super) fn new(parse_s: f64) -> Self {
        let phases = Phase::VARIANTS.iter();
        let phases = phases.filter(|phase| **phase != Phase::Verify);
        let mut phases: Timings = phases.map(|phase| (phase.as_str().into(), 0.0)).collect();
        phases.insert(Phase::Parse.as_str().into(), parse_s);
        Stopwatch {
            start: Instant::now(),
            current: None,
            times: Times {
                phases,
                factored: false,
                iterations: vec![],
            },
            mesh: 0,
            before: vec![],
        }
    }

    /// Records that adaptive refinement begins on the mesh with this number, or returns to the mesh before.
    pub(super) fn on_mesh(&mut self, number: u32) {
        let iterations = &mut self.times.iterations;
        if number > self.mesh {
            self.before = std::mem::take(iterations)
        } else {
            *iterations = std::mem::take(&mut self.before)
        }
        self.mesh = number;
    }

    /// Records that a phase begins, which ends the phase before.
    pub(super) fn enter(&mut self, phase: Phase) {
        let now = Instant::now();
        self.times.factored |= phase == Phase::Factor;
        if let Some((before, since)) = self.current.replace((phase, now)) {
            let seconds = self.times.phases.entry(before.as_str().into());
            *seconds.or_default() += (now - since).as_secs_f64();
        }
    }

    /// Records an iteration that may be repeated on another mesh under the same number.
    pub(super) fn done_tentatively(&mut self, row: &Iteration) {
        self.times.iterations.truncate(place(row));
        self.done(row);
    }

    /// Records that an iteration ends now, unless it was recorded before.
    pub(super) fn done(&mut self, row: &Iteration) {
        if self.times.iterations.len() <= place(row) {
            self.times
                .iterations
                .push(self.start.elapsed().as_secs_f64());
        }
    }

    /// An iteration with its recorded time.
    pub(super) fn timed(&self, row: Iteration) -> TimedIteration {
        self.times.timed(row)
    }

    /// The times so far.
    pub(super) fn times(&mut self) -> Times {
        if let Some((phase, _)) = self.current {
            self.enter(phase);
        }
        self.times.clone()
    }
}

impl Times {
    /// Iterations with their recorded times.
    pub(super) fn of(&self, rows: Vec<Iteration>) -> Vec<TimedIteration> {
        rows.into_iter().map(|row| self.timed(row)).collect()
    }

    fn timed(&self, row: Iteration) -> TimedIteration {
        let wall_s = self.iterations.get(place(&row)).copied();
        TimedIteration {
            row,
            wall_s: wall_s.unwrap_or_default(),
        }
    }
}

/// The index of an iteration in lists, since iterations are numbered from 1.
fn place(row: &Iteration) -> usize {
    (row.k as usize).saturating_sub(1)
}
