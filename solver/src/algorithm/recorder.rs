//! Measures, records and reports the states of every algorithm.

use std::collections::HashMap;

use crate::algorithm::factors::Factors;
use crate::algorithm::system::{State, System};
use crate::observer::{Observer, Progress};
use crate::problem::SolverControls;
use crate::solution::{ContactCount, ForcePair, FrictionCount, Iteration, Residuals, Stage};

/// The place of the iterations in the load history.
#[derive(Clone, Copy, Debug, Default)]
pub struct Place {
    /// The number of the load step, from 0.
    pub step: u32,
    /// The number of the increment within the step, from 0.
    pub increment: u32,
    /// The number of rows that the history has already.
    pub rows: u32,
}

/// A state, the friction bound used for it, and the quantities that follow from both.
#[derive(Clone)]
pub(super) struct Measured {
    pub(super) state: State,
    /// The friction bound τ at every friction point.
    pub(super) bound: Vec<f64>,
    /// The friction bound τ that the state's own pressure implies.
    pub(super) implied_bound: Vec<f64>,
    /// The elastic force Ŝ v − f̂.
    pub(super) elastic_force: Vec<f64>,
    pub(super) reactions: Vec<f64>,
    pub(super) pressures: Vec<f64>,
    /// The residuals kkt, friction and monolithic; equilibrium is computed from the body later.
    pub(super) residuals: Residuals,
    /// The largest |τ − implied τ| (stress).
    pub(super) bound_change: f64,
}

impl Measured {
    pub(super) fn new(system: &System<'_>, state: State, bound: Vec<f64>) -> Self {
        let elastic_force = system.elastic_force(&state.v);
        Measured::with_force(system, state, elastic_force, bound)
    }

    /// Measures a state whose elastic force Ŝ v − f̂ is known.
    pub(super) fn with_force(
        system: &System<'_>,
        state: State,
        elastic_force: Vec<f64>,
        bound: Vec<f64>,
    ) -> Self {
        let reactions = system.reactions_of(&state, &elastic_force);
        let pressures = system.pressures(&reactions);
        let implied_bound = system.friction_bound(&pressures);
        let bound_change = largest_difference(&implied_bound, &bound);
        // the largest bound, old or new: formulation 4.4, safe where one of them is zero
        let scale = implied_bound
            .iter()
            .chain(&bound)
            .fold(0.0f64, |a, &b| a.max(b));
        let residuals = Residuals {
            kkt: system.kkt_residual(&state, &elastic_force, &bound),
            friction: if bound_change == 0.0 || !system.presses(&reactions) {
                0.0
            } else {
                bound_change / scale
            },
            monolithic: system.kkt_residual(&state, &elastic_force, &implied_bound),
            equilibrium: 0.0,
        };
        Measured {
            state,
            bound,
            implied_bound,
            elastic_force,
            reactions,
            pressures,
            residuals,
            bound_change,
        }
    }

    /// Whether every residual is at or below the tolerance.
    pub(super) fn within(&self, tolerance: f64) -> bool {
        self.residuals.within(tolerance)
    }
}

/// The largest relative difference of residuals that count as equal: a cycle repeats residuals, an approach does not.
const SAME: f64 = 0.01;

/// The parts of a row of the history that do not follow from its state.
pub(super) struct Row {
    pub(super) stage: Stage,
    /// The residual that the method of this stage reduces.
    pub(super) residual: f64,
    pub(super) contraction: Option<f64>,
    /// The number of Newton steps inside the iteration.
    pub(super) inner: u32,
    /// The tangential stress σ_t at every friction point.
    pub(super) tractions: Vec<f64>,
    /// The change R_F as the stage computes it; `None`: it is computed from the nodal pressures.
    pub(super) own_r_f: Option<f64>,
}

/// A cycle of the iterations: states that repeat.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cycle {
    /// The number of iterations from one occurrence of a state to the next.
    pub period: u32,
    /// Contact nodes that change between contact and gap, or whose friction points change between
    /// stick and slip, numbered over all contacts.
    pub nodes: Vec<usize>,
}

/// Records the history of one increment.
pub(super) struct Recorder<'s, 'a> {
    pub(super) system: &'s System<'a>,
    pub(super) controls: &'s SolverControls,
    pub(super) place: Place,
    pub(super) history: Vec<Iteration>,
    before: Option<(Vec<bool>, Vec<f64>)>,
    /// Whether the contact set of the last row differs from that of the row before.
    pub(super) contact_changed: bool,
    /// By code of each state so far: its number and its residual.
    met: HashMap<Vec<u8>, (usize, f64)>,
    states: Vec<Vec<u8>>,
    /// Factors that the convex problems of all sweeps share.
    pub(super) factors: Factors,
}

impl<'s, 'a> Recorder<'s, 'a> {
    pub(super) fn new(system: &'s System<'a>, controls: &'s SolverControls, place: Place) -> Self {
        Recorder {
            system,
            controls,
            place,
            history: Vec::new(),
            before: None,
            contact_changed: true,
            met: HashMap::new(),
            states: Vec::new(),
            factors: Factors::default(),
        }
    }

    /// Adds a row to the history and shows it to the observer; returns whether to stop.
    pub(super) fn record(
        &mut self,
        measured: &Measured,
        row: Row,
        observer: &mut dyn Observer,
    ) -> bool {
        let (system, active) = (self.system, &measured.state.active);
        let none = vec![false; active.len()];
        let previous = self.before.as_ref().map_or(&none, |(active, _)| active);
        let changes = |from: bool| {
            let pairs = previous.iter().zip(active);
            pairs
                .filter(|(before, after)| **before == from && **after != from)
                .count() as u32
        };
        let contact = ContactCount {
            active: active.iter().filter(|a| **a).count() as u32,
            entered: changes(false),
            left: changes(true),
        };
        let r_f = row.own_r_f.or_else(|| {
            let (_, pressures) = self.before.as_ref()?;
            Some(relative_change(&measured.pressures, pressures))
        });
        let (slip, stick) = slipping(system, &measured.state, &measured.implied_bound);
        let points = system.points.iter().zip(&row.tractions);
        let friction: f64 = points
            .map(|(point, traction)| point.weight * traction)
            .sum();
        let held: f64 = system
            .tangential_reactions(&measured.elastic_force)
            .iter()
            .sum();
        let iteration = Iteration {
            k: self.place.rows + self.history.len() as u32 + 1,
            stage: row.stage,
            step: self.place.step,
            increment: self.place.increment,
            residual: row.residual,
            friction_residual: measured.residuals.friction,
            r_f,
            tolerance: self.controls.tolerance,
            contact,
            friction: FrictionCount { slip, stick },
            force: ForcePair {
                normal: system.circumference
                    * system.normal_force(0..system.nodes.len(), &measured.reactions),
                tangential: system.circumference * (friction + held),
            },
            motion: system.motion_by_loads(&measured.state.v),
            contraction: row.contraction,
            inner: row.inner,
        };
        observer.event(Progress::Iteration(&iteration));
        self.history.push(iteration);
        self.contact_changed = contact.entered + contact.left > 0;
        self.before = Some((active.clone(), measured.pressures.clone()));
        observer.stop()
    }

    /// Records contact and slip of a state. Returns a cycle if the same state occurred before with the same residual,
    /// and other states since then.
    pub(super) fn note(&mut self, state: &State, residual: f64) -> Option<Cycle> {
        let code = code(self.system, state);
        let now = self.states.len();
        let mut cycle = None;
        if let Some((before, residual_before)) = self.met.get(&code)
            && (residual - residual_before).abs() <= SAME * residual_before
        {
            let between = &self.states[*before..];
            let moves = |place: usize| between.iter().any(|other| other[place] != code[place]);
            let mut nodes: Vec<usize> =
                (0..self.system.nodes.len()).filter(|&i| moves(i)).collect();
            for (g, point) in self.system.points.iter().enumerate() {
                if moves(self.system.nodes.len() + g) {
                    let nearest = (0..3).max_by(|&a, &b| point.shape[a].total_cmp(&point.shape[b]));
                    nodes.extend(nearest.map(|i| point.nodes[i]));
                }
            }
            nodes.sort_unstable();
            nodes.dedup();
            if !nodes.is_empty() {
                let period = (now - before) as u32;
                cycle = Some(Cycle { period, nodes });
            }
        }
        self.met.insert(code.clone(), (now, residual));
        self.states.push(code);
        cycle
    }

    /// Forgets the recorded states, when another method begins.
    pub(super) fn forget(&mut self) {
        self.met.clear();
        self.states.clear();
    }
}

/// A code of a state: the contact of every node, and the slip of every friction point (backward, stick or forward).
fn code(system: &System<'_>, state: &State) -> Vec<u8> {
    let contact = state.active.iter().map(|active| u8::from(*active));
    let slip = system.points.iter().map(|point| {
        let (slip, limit) = (system.slip(&state.v, point), system.law(point).elastic_slip);
        match slip.abs() < limit {
            true => 1,
            false if slip < 0.0 => 0,
            false => 2,
        }
    });
    contact.chain(slip).collect()
}

/// The number of friction points that slip, and of those that stick; points without a bound do not count.
fn slipping(system: &System<'_>, state: &State, bound: &[f64]) -> (u32, u32) {
    let (mut slip, mut stick) = (0, 0);
    let points = system.points.iter().zip(bound);
    for (point, _) in points.filter(|(_, tau)| **tau > 0.0) {
        let slides = !system.law(point).sticks(system.slip(&state.v, point));
        *(if slides { &mut slip } else { &mut stick }) += 1;
    }
    (slip, stick)
}

/// The relative change R_F of thesis 3.5, ‖σ_n − σ_n′‖ / ‖σ_n′‖, from σ_n′ (`before`) to σ_n (`now`). If nothing
/// touched before, the change is relative to σ_n.
pub(super) fn relative_change(now: &[f64], before: &[f64]) -> f64 {
    let change: f64 = now.iter().zip(before).map(|(a, b)| (a - b) * (a - b)).sum();
    let scale: f64 = before.iter().map(|b| b * b).sum();
    let own: f64 = now.iter().map(|a| a * a).sum();
    if change == 0.0 {
        0.0
    } else {
        (change / if scale > 0.0 { scale } else { own }).sqrt()
    }
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max)
}
