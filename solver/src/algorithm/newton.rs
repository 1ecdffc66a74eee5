//! Newton's method: one monolithic semi-smooth iteration for contact, friction and averaging together, formulation 4.3.
//! The friction bound is a function of the displacements here,
//!
//!   τ(v) = bound(W p),   p = P R,   R = f̂_n − Ŝ_n v on active nodes,
//!
//! and is differentiated:
//!
//!   H = Ŝ + Σ_g w τ φ′ h hᵀ − Σ_g w φ τ′ h (W P Ŝ_n)_g
//!
//! H is not symmetric. A step that does not reduce the residual is shortened to the smallest energy along it, for the
//! friction bound before the step; there is no other safeguard. If the iteration converges, it takes four to twenty
//! steps.

use crate::algorithm::convex::{close, least_along, update_active};
use crate::algorithm::factors::{dense, free_dofs, semidefinite_shift};
use crate::algorithm::finished::End;
use crate::algorithm::recorder::{Measured, Recorder, Row};
use crate::algorithm::rounding;
use crate::algorithm::system::{Point, State, System};
use crate::elasticity::Dof;
use crate::friction::{self, Source};
use crate::linear::{Dense, General, Interrupt, Unsolved};
use crate::observer::Observer;
use crate::solution::{Outcome, Stage};

/// The number of steps without progress after which the method gives up.
const PATIENCE: u32 = 20;

/// Iterates from a state; returns the best state reached.
pub(super) fn run(
    recorder: &mut Recorder<'_, '_>,
    start: &Measured,
    most_steps: u32,
    observer: &mut dyn Observer,
) -> End {
    let system = recorder.system;
    let tolerance = recorder.controls.tolerance;
    let mut end = End::new(start.clone(), Stage::Newton, Outcome::NotConverged);
    let mut state = start.state.clone();
    let (mut best, mut residual_before) = (f64::INFINITY, f64::INFINITY);
    let (mut since_best, mut rounded) = (0, 0);
    for _ in 0..most_steps {
        close(system, &mut state);
        let Some((measured, changed)) = next(system, &state, residual_before, observer) else {
            if observer.stop() {
                end.outcome = Outcome::Canceled;
            }
            return end;
        };
        state = measured.state.clone();
        let residual = measured.residuals.monolithic;
        residual_before = residual;
        let row = Row {
            stage: Stage::Newton,
            residual,
            contraction: None,
            inner: 1,
            tractions: system.tractions(&measured.state.v, &measured.bound),
            own_r_f: None,
        };
        let stopped = recorder.record(&measured, row, observer);
        let converged = !changed && measured.within(tolerance);
        since_best += 1;
        if residual < 0.9 * best || converged {
            (best, since_best) = (residual, 0);
            end.measured = measured;
        }
        if converged {
            end.outcome = Outcome::Converged;
            return end;
        }
        rounded = match rounding::limit(system, &end.measured, tolerance) {
            Some(_) => rounded + 1,
            None => 0,
        };
        if stopped {
            end.outcome = Outcome::Canceled;
            return end;
        }
        if rounded >= rounding::PATIENCE {
            end.outcome = Outcome::Converged;
            return end;
        }
        end.cycle = recorder.note(&state, residual);
        if end.cycle.is_some() {
            end.outcome = Outcome::ContactCycling;
            return end;
        }
        if since_best >= PATIENCE {
            break;
        }
    }
    end
}

/// The state after a step, and whether the contact set changed. The whole step is taken if it reduces the residual,
/// else the part of it with the smallest energy.
fn next(
    system: &System<'_>,
    state: &State,
    residual: f64,
    observer: &mut dyn Observer,
) -> Option<(Measured, bool)> {
    let target = step(system, state, observer)?;
    let reach = |part: f64| {
        let moved = state.v.iter().zip(&target).map(|(a, b)| a + part * (b - a));
        let mut reached = State {
            v: moved.collect(),
            active: state.active.clone(),
        };
        let force = system.elastic_force(&reached.v);
        let changed = update_active(system, &force, &mut reached);
        let bound = implied_bound(system, &reached, &force);
        let measured = Measured::with_force(system, reached, force, bound);
        (measured, changed)
    };
    let whole = reach(1.0);
    if whole.0.residuals.monolithic < residual {
        return Some(whole);
    }
    let direction: Vec<f64> = target.iter().zip(&state.v).map(|(a, b)| a - b).collect();
    let bound = implied_bound(system, state, &system.elastic_force(&state.v));
    let part = least_along(system, &bound, &state.v, &direction);
    Some(if part < 1.0 { reach(part) } else { whole })
}

fn implied_bound(system: &System<'_>, state: &State, force: &[f64]) -> Vec<f64> {
    system.friction_bound(&system.pressures(&system.reactions_of(state, force)))
}

/// The displacements v after one Newton step; active nodes stay on the obstacle.
fn step(system: &System<'_>, state: &State, observer: &mut dyn Observer) -> Option<Vec<f64>> {
    let free = free_dofs(system, |i| state.active[i]);
    let mut place = vec![usize::MAX; system.load.len()];
    free.iter().enumerate().for_each(|(k, &dof)| place[dof] = k);
    let mut force = system.elastic_force(&state.v);
    let pressures = system.pressures(&system.reactions_of(state, &force));
    let bound = system.friction_bound(&pressures);
    system.add_traction_force(&system.tractions(&state.v, &bound), &mut force);
    let shift = if system.semidefinite {
        semidefinite_shift(system)
    } else {
        0.0
    };
    let rhs: Vec<f64> = free.iter().map(|&dof| -force[dof]).collect();
    let delta = dense(free.len(), observer, |interrupt| {
        let h = jacobian(
            system,
            state,
            (&bound, &pressures),
            &free,
            &place,
            shift,
            interrupt,
        )?;
        h.solve(&rhs, interrupt)
    })?;
    let mut v = state.v.clone();
    free.iter().zip(&delta).for_each(|(&dof, d)| v[dof] += d);
    Some(v)
}

/// The matrix H on the free unknowns. `place`: for each unknown, its position among the free unknowns.
pub(super) fn jacobian(
    system: &System<'_>,
    state: &State,
    (bound, pressures): (&[f64], &[f64]),
    free: &[usize],
    place: &[usize],
    shift: f64,
    interrupt: &mut Interrupt<'_>,
) -> Result<General, Unsolved> {
    let n = free.len();
    let bytes = Dense::bytes(n);
    let mut h = General::try_zero(n, interrupt)?.ok_or(Unsolved::TooLarge { bytes })?;
    for (j, &dof) in free.iter().enumerate() {
        let (column, elastic) = (h.column_mut(j), system.stiffness.column(dof));
        let entries = column.iter_mut().zip(free);
        entries.for_each(|(entry, &i)| *entry = elastic[i]);
        column[j] += shift;
        interrupt.worked(n as f64)?;
    }
    let mut couplings = Vec::new();
    for (point, tau) in system.points.iter().zip(bound) {
        let (law, slip) = (system.law(point), system.slip(&state.v, point));
        let rows: Vec<(usize, f64)> = (0..3)
            .filter_map(|i| match system.nodes[point.nodes[i]].tangent {
                Dof::Free(dof) if place[dof] != usize::MAX => Some((place[dof], point.shape[i])),
                _ => None,
            })
            .collect();
        let stiffness = point.weight * tau * law.phi_slope(slip);
        for &(row, a) in &rows {
            for &(column, b) in &rows {
                h.column_mut(column)[row] += stiffness * a * b;
            }
        }
        let slope = law.bound.slope(averaged(point, pressures));
        let Source::Average(average) = &point.source else {
            continue;
        };
        let coupling = point.weight * law.phi(slip) * slope;
        if coupling != 0.0 && !rows.is_empty() {
            couplings.push(Coupling {
                rows: rows
                    .into_iter()
                    .map(|(row, a)| (row, a * coupling))
                    .collect(),
                average,
            });
        }
    }
    add_couplings(system, state, &couplings, free, &mut h, interrupt)?;
    Ok(h)
}

/// How the pressures around a friction point change its traction.
struct Coupling<'a> {
    /// The rows of H that the traction acts on, with its parts there: by the derivative of the traction with respect to
    /// the averaged pressure.
    rows: Vec<(usize, f64)>,
    /// The average over the pressures.
    average: &'a friction::Row,
}

/// Adds to H that friction bounds depend on pressures, and pressures on all free unknowns. The pressures of some nodes at
/// a time: their part is a product of matrices.
fn add_couplings(
    system: &System<'_>,
    state: &State,
    couplings: &[Coupling<'_>],
    free: &[usize],
    h: &mut General,
    interrupt: &mut Interrupt<'_>,
) -> Result<(), Unsolved> {
    /// The number of nodes at a time: few enough that their matrices take little memory beside H.
    const AT_ONCE: usize = 64;
    let n = free.len();
    let first = couplings.iter().map(|c| c.average.first).min();
    let end = couplings.iter().map(|c| c.average.end()).max();
    let nodes: Vec<usize> = (first.unwrap_or(0)..end.unwrap_or(0))
        .filter(|node| state.active[*node])
        .collect();
    for nodes in nodes.chunks(AT_ONCE) {
        // by node: the derivatives of its pressure with respect to the free unknowns, and of the tractions with respect
        // to its pressure
        let mut pressures = vec![0.0; nodes.len() * n];
        let mut tractions = vec![0.0; nodes.len() * n];
        for (pressure, &node) in pressures.chunks_mut(n).zip(nodes) {
            for (other, weight) in system.pressure_weights(node, 1.0) {
                let (true, Dof::Free(dof)) = (state.active[other], system.nodes[other].normal)
                else {
                    continue;
                };
                // dR/dv = −Ŝ: the row of Ŝ is its column
                let column = system.stiffness.column(dof);
                let entries = pressure.iter_mut().zip(free);
                entries.for_each(|(entry, &dof)| *entry -= weight * column[dof]);
            }
        }
        for Coupling { rows, average } in couplings {
            let from = nodes.partition_point(|node| *node < average.first);
            let to = nodes.partition_point(|node| *node < average.end());
            for (column, &node) in nodes.iter().enumerate().take(to).skip(from) {
                let weight = average.weights[node - average.first];
                for (row, part) in rows {
                    tractions[column * n + row] += part * weight;
                }
            }
        }
        interrupt.worked((nodes.len() * (n + couplings.len())) as f64)?;
        h.add_product(&tractions, &pressures, interrupt)?;
    }
    Ok(())
}

fn averaged(point: &Point, pressures: &[f64]) -> f64 {
    point.source.nonlocal_pressure(pressures)
}
