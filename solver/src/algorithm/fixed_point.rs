//! The outer sweeps, thesis (1.18)–(1.22) and 3.1: freeze the friction bound, solve the convex
//! problem, take the bound that its pressure implies, and again.

use std::collections::HashMap;
use std::ops::ControlFlow;

use crate::algorithm::convex::{Minimum, minimise};
use crate::algorithm::system::{State, System};
use crate::elasticity::Dof;
use crate::problem::SolverControls;
use crate::solution::{
    ContactCount, ForcePair, FrictionCount, Iteration, Observer, Outcome, Progress, Residuals,
    Stage,
};

/// The end of the sweeps.
pub struct Finished {
    /// The final state.
    pub state: State,
    /// The friction bound that it was solved with, at every friction point.
    pub bound: Vec<f64>,
    /// How it ended.
    pub outcome: Outcome,
    /// What produced the final state.
    pub stage: Stage,
    /// kkt, friction and monolithic; equilibrium is the body's to say.
    pub residuals: Residuals,
    /// Last q = |Δτ_k|/|Δτ_{k−1}|.
    pub contraction: Option<f64>,
    /// All rows.
    pub history: Vec<Iteration>,
    /// Period and nodes of a cycle of contact sets.
    pub cycle: Option<Cycle>,
}

/// Contact sets that repeat.
pub struct Cycle {
    /// Sweeps from one occurrence to the next.
    pub period: u32,
    /// Nodes that change state in between, numbered over all contacts.
    pub nodes: Vec<usize>,
}

/// Solves the frictionless problem, then sweeps over the friction bound.
///
/// Converged means: contact set unchanged, and the kkt, friction and monolithic residuals at or
/// below the tolerance (FORMULATION 4.4).
pub fn run(system: &System<'_>, controls: &SolverControls, observe: &mut Observer<'_>) -> Finished {
    let mut sweeps = Sweeps::new(system, controls);
    let frictionless = vec![0.0; system.points.len()];
    let mut stop = sweeps.solve(Stage::Frictionless, frictionless, &system.rest(), observe);
    for sweep in 0..controls.max_iterations {
        let nothing_to_sweep = system.points.is_empty();
        if nothing_to_sweep || stop.is_break() || sweeps.converged() || sweeps.cycle.is_some() {
            break;
        }
        let bound = sweeps.implied_bound.clone();
        // friction starts from u_t = d: every point sticks, and pulls with full stiffness
        let start = if sweep == 0 {
            sweeps.stuck()
        } else {
            sweeps.state.clone()
        };
        stop = sweeps.solve(Stage::Outer, bound, &start, observe);
    }
    sweeps.finish(stop.is_break())
}

struct Sweeps<'a> {
    system: &'a System<'a>,
    controls: &'a SolverControls,
    state: State,
    stage: Stage,
    bound: Vec<f64>,
    /// τ that the state's own pressure implies.
    implied_bound: Vec<f64>,
    pressures: Vec<f64>,
    residuals: Residuals,
    contact_changed: bool,
    /// |Δτ| of the last sweep.
    bound_change: Option<f64>,
    contraction: Option<f64>,
    history: Vec<Iteration>,
    /// Contact sets met, with the sweep and the friction residual there.
    met: HashMap<Vec<bool>, (usize, f64)>,
    sets: Vec<Vec<bool>>,
    cycle: Option<Cycle>,
}

impl<'a> Sweeps<'a> {
    fn new(system: &'a System<'a>, controls: &'a SolverControls) -> Self {
        Sweeps {
            system,
            controls,
            state: system.rest(),
            stage: Stage::Frictionless,
            bound: Vec::new(),
            implied_bound: Vec::new(),
            pressures: vec![0.0; system.nodes.len()],
            residuals: Residuals::default(),
            contact_changed: true,
            bound_change: None,
            contraction: None,
            history: Vec::new(),
            met: HashMap::new(),
            sets: Vec::new(),
            cycle: None,
        }
    }

    /// The present state with u_t = d at every contact node with friction.
    fn stuck(&self) -> State {
        let mut state = self.state.clone();
        for patch in self
            .system
            .patches
            .iter()
            .filter(|patch| patch.law.is_some())
        {
            for node in &self.system.nodes[patch.first..patch.first + patch.contact.gap.len()] {
                if let Dof::Free(dof) = node.tangent {
                    state.v[dof] = patch.contact.tangential_displacement;
                }
            }
        }
        state
    }

    /// One convex problem and all that is measured of its solution.
    fn solve(
        &mut self,
        stage: Stage,
        bound: Vec<f64>,
        start: &State,
        observe: &mut Observer<'_>,
    ) -> ControlFlow<()> {
        let Minimum {
            state,
            steps,
            residual,
        } = minimise(
            self.system,
            &bound,
            start,
            self.controls.tolerance,
            &mut || observe(Progress::Pulse),
        );
        let changes = |from: bool| {
            let pairs = self.state.active.iter().zip(&state.active);
            pairs
                .filter(|(before, after)| **before == from && **after != from)
                .count() as u32
        };
        let contact = ContactCount {
            active: state.active.iter().filter(|a| **a).count() as u32,
            entered: changes(false),
            left: changes(true),
        };
        let reactions = self.system.reactions(&state);
        let pressures = self.system.pressures(&reactions);
        let r_f = (!self.history.is_empty()).then(|| relative_change(&pressures, &self.pressures));
        let implied = self.system.friction_bound(&pressures);
        let change = largest_difference(&implied, &bound);
        // the largest bound, old or new: FORMULATION 4, guarded where one of them is nothing
        let scale = implied.iter().chain(&bound).fold(0.0f64, |a, &b| a.max(b));
        self.contraction = match self.bound_change {
            Some(before) if stage == Stage::Outer && before > 0.0 && change > 0.0 => {
                Some(change / before)
            }
            _ => None,
        };
        self.bound_change = Some(change).filter(|_| stage == Stage::Outer);
        self.residuals.kkt = residual;
        self.residuals.friction = if change == 0.0 { 0.0 } else { change / scale };
        self.residuals.monolithic = self.system.kkt_residual(&state, &implied);
        self.contact_changed = contact.entered + contact.left > 0;
        let (slip, stick) = self.slipping(&state, &implied);
        let tangential = self.system.points.iter().zip(&bound).map(|(point, tau)| {
            -point.weight
                * tau
                * self
                    .system
                    .law(point)
                    .phi(self.system.slip(&state.v, point))
        });
        let mut row = Iteration {
            k: self.history.len() as u32 + 1,
            stage,
            step: 0,
            residual,
            friction_residual: self.residuals.friction,
            r_f,
            tolerance: self.controls.tolerance,
            contact,
            friction: FrictionCount { slip, stick },
            force: ForcePair {
                normal: self.system.circumference * reactions.iter().sum::<f64>(),
                tangential: self.system.circumference * tangential.sum::<f64>(),
            },
            contraction: self.contraction,
            inner: steps,
            wall_s: 0.0,
        };
        let answer = observe(Progress::Iteration(&mut row));
        self.history.push(row);
        (self.state, self.bound, self.implied_bound) = (state, bound, implied);
        (self.pressures, self.stage) = (pressures, stage);
        if stage == Stage::Outer {
            self.note_contact_set();
        }
        answer
    }

    fn slipping(&self, state: &State, bound: &[f64]) -> (u32, u32) {
        let (mut slip, mut stick) = (0, 0);
        for (point, _) in self
            .system
            .points
            .iter()
            .zip(bound)
            .filter(|(_, tau)| **tau > 0.0)
        {
            let slides =
                self.system.slip(&state.v, point).abs() >= self.system.law(point).elastic_slip;
            *(if slides { &mut slip } else { &mut stick }) += 1;
        }
        (slip, stick)
    }

    fn converged(&self) -> bool {
        let tolerance = self.controls.tolerance;
        let settled = self.system.points.is_empty()
            || self.stage == Stage::Frictionless
            || !self.contact_changed;
        settled
            && self.residuals.kkt <= tolerance
            && self.residuals.friction <= tolerance
            && self.residuals.monolithic <= tolerance
    }

    /// Notes the contact set; a cycle is one met before, after others, without progress of the
    /// friction residual since.
    fn note_contact_set(&mut self) {
        let (sweep, set, residual) = (
            self.sets.len(),
            self.state.active.clone(),
            self.residuals.friction,
        );
        if let Some((before, residual_before)) = self.met.get(&set)
            && residual > 0.5 * residual_before
        {
            let between = &self.sets[*before..];
            let moves = |node: &usize| between.iter().any(|other| other[*node] != set[*node]);
            let nodes: Vec<usize> = (0..set.len()).filter(moves).collect();
            if !nodes.is_empty() {
                self.cycle = Some(Cycle {
                    period: (sweep - before) as u32,
                    nodes,
                });
            }
        }
        self.met.insert(set.clone(), (sweep, residual));
        self.sets.push(set);
    }

    fn finish(self, stopped: bool) -> Finished {
        let outcome = match (self.converged(), stopped, &self.cycle) {
            (true, _, _) => Outcome::Converged,
            (_, true, _) => Outcome::Canceled,
            (_, _, Some(_)) => Outcome::ContactCycling,
            _ => Outcome::NotConverged,
        };
        Finished {
            state: self.state,
            bound: self.bound,
            outcome,
            stage: self.stage,
            residuals: self.residuals,
            contraction: self.contraction,
            history: self.history,
            cycle: self.cycle,
        }
    }
}

/// R_F of thesis 3.5: ‖σ_n − σ_n′‖ / ‖σ_n′‖, guarded where nothing touched before.
fn relative_change(now: &[f64], before: &[f64]) -> f64 {
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
