//! The thesis's own iteration (3.1), exactly as described there.
//!
//! This iteration exists because the thesis is our source, and because it shows which faults the other algorithms
//! correct: at the thesis's parameters it does not solve the problem (formulation 4.5). Friction enters as a load that
//! is one iteration old, and the gain of that loop, μS/ε × tangential compliance, is in the hundreds. Without the sign
//! of friction the iteration converges to a false state of full slip, in which friction pushes along the motion; with
//! the sign it falls into a cycle of two states. So the residuals of the result are those of the true problem, and the
//! outcome is `FalseConvergence` when they are large.
//!
//! Where the thesis leaves a choice: f̂ is a stress along t, so that K u = F − F̂ with σ_n < 0 pushes the body along
//! +t; the pressure is `lumped` (R/∫h) or `extrapolated` from internal Gauss points (3.3, file `rows`); it is averaged
//! by the mesh-free W, or with `local_points` as in 3.4.2 (file `average`); a Gauss point lies on Γ_C* where the nodes
//! on both sides of it do; R_F is divided by the relaxation factor.

mod average;
mod friction;
mod rows;

use crate::algorithm::convex::close;
use crate::algorithm::factors::{dense, free_dofs};
use crate::algorithm::finished::End;
use crate::algorithm::recorder::{Measured, Recorder, Row, relative_change};
use crate::algorithm::system::{ContactNode, State, System};
use crate::elasticity::Dof;
use crate::linear::solve_positive_definite;
use crate::observer::Observer;
use crate::problem::{ThesisOptions, ThesisPressure};
use crate::solution::{Outcome, Stage};
use friction::{Friction, relax, signed_ratio};
use rows::Rows;

/// The smallest relative decrease of the residual from row to row of the history, divided by the relaxation, with which
/// the iteration continues although the thesis's own test is met. R_F measures one full step, so that a relaxed
/// iteration on its way to a solution may meet the test a thousand rows before the residual is small. In a false state
/// the residual does not fall.
const STILL_FALLING: f64 = 0.1;

/// Runs the iteration; returns its result, and the tractions used for the final state.
pub(super) fn run(recorder: &mut Recorder<'_, '_>, observer: &mut dyn Observer) -> (End, Vec<f64>) {
    let system = recorder.system;
    let options = recorder.controls.thesis.clone().unwrap_or_default();
    let rows = Rows::new(system);
    let nothing = vec![0.0; system.points.len()];
    let mut friction = Friction {
        bound: nothing.clone(),
        traction: nothing,
    };
    let mut state = first_guess(system, &options);
    let mut normal_stress: Option<Vec<f64>> = None;
    let mut end: Option<(End, Vec<f64>)> = None;
    let (mut stopped, mut residual_before) = (false, f64::INFINITY);
    for _ in 0..recorder.controls.max_iterations {
        // steps 1 and 2; the iteration ends where the system cannot be solved
        let Some(v) = solve(system, &state.active, &friction.traction, observer) else {
            stopped = observer.stop();
            break;
        };
        state.v = v;
        // step 3
        let row_values = rows.evaluate(system, &state, &options);
        // step 4
        let next = next_contact(system, &state, &row_values.node_stress);
        let unchanged = next == state.active;
        // step 5
        let new = new_friction(system, &state, &next, &row_values, &options);
        // step 6
        let r_f = normal_stress
            .as_ref()
            .map(|before| relative_change(&row_values.node_stress, before) / options.relaxation);
        let settled = unchanged && r_f.is_some_and(|r_f| r_f <= recorder.controls.tolerance);
        normal_stress = Some(row_values.node_stress);

        let measured = Measured::new(system, state.clone(), friction.bound.clone());
        let row = Row {
            stage: Stage::Thesis,
            residual: measured.residuals.monolithic,
            contraction: None,
            inner: 1,
            tractions: friction.traction.clone(),
            own_r_f: r_f,
        };
        let told_to_stop = recorder.record(&measured, row, observer);
        // with relaxation the same states recur on the way to a solution; only full steps cycle
        let cycle = if options.relaxation == 1.0 {
            recorder.note(&state, r_f.unwrap_or(1.0))
        } else {
            None
        };
        let residual = measured.residuals.monolithic;
        let falling = residual <= (1.0 - STILL_FALLING * options.relaxation) * residual_before;
        residual_before = residual;
        let outcome = match (settled, told_to_stop, &cycle) {
            (true, _, _) if residual <= recorder.controls.tolerance => Outcome::Converged,
            (true, false, None) if falling => Outcome::NotConverged,
            (true, _, _) => Outcome::FalseConvergence,
            (_, true, _) => Outcome::Canceled,
            (_, _, Some(_)) => Outcome::ContactCycling,
            _ => Outcome::NotConverged,
        };
        let stop = outcome != Outcome::NotConverged;
        let reached = End {
            cycle,
            exhausted: true,
            ..End::new(measured, Stage::Thesis, outcome)
        };
        end = Some((reached, friction.traction.clone()));
        if stop {
            break;
        }
        relax(&mut friction, new, options.relaxation);
        state.active = next;
    }
    let (end, tractions) = end.unwrap_or_else(|| {
        let measured = Measured::new(system, state, friction.bound);
        let reached = End {
            exhausted: true,
            ..End::new(measured, Stage::Thesis, Outcome::NotConverged)
        };
        (reached, friction.traction)
    });
    let outcome = if stopped {
        Outcome::Canceled
    } else {
        end.outcome
    };
    (End { outcome, ..end }, tractions)
}

/// The first contact set Γ_C*⁽¹⁾: the user's guess by arc length, else all of Γ_C.
fn first_guess(system: &System<'_>, options: &ThesisOptions) -> State {
    let mut state = system.rest();
    for patch in &system.patches {
        let guess = options.contact_guess.get(&patch.contact.name);
        let s = &patch.contact.boundary.s;
        for (i, node) in system.range(patch).enumerate() {
            state.active[node] = guess.is_none_or(|[s0, s1]| (*s0..=*s1).contains(&s[i]));
        }
    }
    state
}

/// Steps 1 and 2 of the thesis's iteration: solves K u = F − F̂ with u_n = s on Γ_C* and σ_n = 0 off it. None if there
/// is no solution, or the observer stops.
fn solve(
    system: &System<'_>,
    active: &[bool],
    traction: &[f64],
    observer: &mut dyn Observer,
) -> Option<Vec<f64>> {
    let mut state = State {
        v: vec![0.0; system.load.len()],
        active: active.to_vec(),
    };
    close(system, &mut state);
    let free = free_dofs(system, |i| active[i]);
    let mut force = system.elastic_force(&state.v);
    system.add_traction_force(traction, &mut force);
    let rhs: Vec<f64> = free.iter().map(|&dof| -force[dof]).collect();
    let entry = |i: usize, j: usize| system.stiffness.at(free[i], free[j]);
    let solved = dense(free.len(), observer, |interrupt| {
        solve_positive_definite(free.len(), entry, &rhs, interrupt)
    })?;
    free.iter()
        .zip(solved)
        .for_each(|(&dof, value)| state.v[dof] += value);
    state.v.iter().all(|x| x.is_finite()).then_some(state.v)
}

/// Step 4 of the thesis's iteration: a node of Γ_C* with σ_n > 0 leaves Γ_C*; a node off Γ_C* with u_n ≥ s enters it.
fn next_contact(system: &System<'_>, state: &State, node_stress: &[f64]) -> Vec<bool> {
    let stays = |(i, node): (usize, &ContactNode)| match node.normal {
        Dof::Fixed(_) => false,
        _ if state.active[i] => node_stress[i] <= 0.0,
        Dof::Free(dof) => state.v[dof] >= node.gap,
    };
    system.nodes.iter().enumerate().map(stays).collect()
}

/// Step 5 of the thesis's iteration: f̂ = τ φ along Γ_C*, and 0 elsewhere; along +t, or against the motion with the
/// option `signed`.
fn new_friction(
    system: &System<'_>,
    state: &State,
    next: &[bool],
    row_values: &rows::RowValues,
    options: &ThesisOptions,
) -> Friction {
    let mut friction = match options.pressure {
        ThesisPressure::Extrapolated if options.local_points > 0 => {
            row_values.friction(system, options)
        }
        _ => averaged(system, state, row_values, options),
    };
    for (g, point) in system.points.iter().enumerate() {
        let [start, end, middle] = point.nodes;
        let xi = point.shape[1] - point.shape[0];
        let touches = next[middle] && (xi >= 0.0 || next[start]) && (xi <= 0.0 || next[end]);
        if !touches {
            friction.bound[g] = 0.0;
            friction.traction[g] = 0.0;
        }
    }
    friction
}

/// The bound τ at every friction point, by the mesh-free average of the nodal pressures, and the traction. φ is taken
/// at the point (way 1 of 3.2) or extrapolated from the two nearest rows of internal Gauss points (way 2).
fn averaged(
    system: &System<'_>,
    state: &State,
    row_values: &rows::RowValues,
    options: &ThesisOptions,
) -> Friction {
    let pressures: Vec<f64> = row_values
        .node_stress
        .iter()
        .map(|stress| -stress)
        .collect();
    let bound = system.friction_bound(&pressures);
    let traction = system.points.iter().zip(&bound).enumerate();
    let traction = traction.map(|(g, (point, tau))| {
        let phi = match options.friction_force {
            1 => system.law(point).phi(system.slip(&state.v, point)),
            _ => row_values.phi[g],
        };
        tau * signed_ratio(phi, options)
    });
    Friction {
        traction: traction.collect(),
        bound,
    }
}
