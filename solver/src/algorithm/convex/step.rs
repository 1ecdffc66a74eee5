//! Parts of both methods: the gradient of J, a Newton step, and nodes that are held.

use crate::algorithm::system::{State, System};
use crate::elasticity::Dof;
use crate::linear::{Breaks, Dense, Unsolved, solve_positive_definite};
use crate::solution::{Observer, Progress};

/// The best approximation of the minimiser.
pub struct Minimum {
    /// The state.
    pub state: State,
    /// Newton steps taken.
    pub steps: u32,
    /// Its KKT residual.
    pub residual: f64,
    /// What is left of it above the tolerance is rounding.
    pub rounded: bool,
}

/// Aim at a tenth of the tolerance so that the error of the inner problem does not disturb the outer residuals.
/// Where rounding prevents that, the tolerance itself is enough.
pub(super) const AIM: f64 = 0.1;

/// Puts the nodes in contact onto the obstacle, and those held along t to their prescribed displacement.
pub(in crate::algorithm) fn close(system: &System<'_>, state: &mut State) {
    for (node, active) in system.nodes.iter().zip(&state.active) {
        if let (true, Dof::Free(dof)) = (active, node.normal) {
            state.v[dof] = node.gap;
        }
        if let (Dof::Free(dof), Some(held)) = (node.tangent, node.held_tangent) {
            state.v[dof] = held;
        }
    }
}

/// ∇J.
pub(super) fn gradient(system: &System<'_>, v: &[f64], bound: &[f64]) -> Vec<f64> {
    let mut force = system.elastic_force(v);
    system.add_traction_force(&system.tractions(v, bound), &mut force);
    force
}

/// Unknowns that are not held: the normal ones of nodes not `held`, and the tangential ones.
pub(in crate::algorithm) fn free_dofs(
    system: &System<'_>,
    held: impl Fn(usize) -> bool,
) -> Vec<usize> {
    let mut free = Vec::with_capacity(system.load.len());
    for (i, node) in system.nodes.iter().enumerate() {
        if let (Dof::Free(dof), false) = (node.normal, held(i)) {
            free.push(dof);
        }
        if let (Dof::Free(dof), None) = (node.tangent, node.held_tangent) {
            free.push(dof);
        }
    }
    free
}

/// Added to the diagonal of H where Ŝ leaves rigid motions free: a step along one is then long but
/// finite, until contact ends it. Where contact holds the body it costs a step or two but no accuracy, since the
/// gradient does not depend on it.
pub(in crate::algorithm) fn semidefinite_shift(system: &System<'_>) -> f64 {
    let size = system.stiffness.size().max(1);
    let diagonal: f64 = (0..system.stiffness.size())
        .map(|i| system.stiffness.at(i, i))
        .sum();
    1e-9 * diagonal / size as f64
}

/// The solution of a dense system of this size, for whose matrix the observer is asked first. None if there is none,
/// or the observer stops.
pub(in crate::algorithm) fn dense(
    size: usize,
    observe: &mut Observer<'_>,
    solve: impl FnOnce(&mut Breaks<'_>) -> Result<Vec<f64>, Unsolved>,
) -> Option<Vec<f64>> {
    let bytes = Dense::bytes(size);
    if observe(Progress::Needs { bytes }).is_break() {
        return None;
    }
    match solve(&mut Breaks::new(&mut || observe(Progress::Pulse))) {
        Ok(x) => Some(x),
        Err(Unsolved::TooLarge { bytes }) => {
            // the answer is given again at the next question
            let _ = observe(Progress::OutOfMemory { bytes });
            None
        }
        Err(Unsolved::Singular | Unsolved::Stopped) => None,
    }
}

/// −H⁻¹ ∇J on the free unknowns, H = Ŝ + Σ w τ φ′ h hᵀ. None if H has no factor, or the observer stops.
pub(super) fn newton_direction(
    system: &System<'_>,
    bound: &[f64],
    v: &[f64],
    force: &[f64],
    free: &[usize],
    observe: &mut Observer<'_>,
) -> Option<Vec<f64>> {
    let mut place = vec![usize::MAX; system.load.len()];
    free.iter().enumerate().for_each(|(k, &dof)| place[dof] = k);
    // friction couples the nodes of one edge only: a few additions to a dense matrix
    let mut friction = Vec::new();
    for (point, tau) in system.points.iter().zip(bound) {
        let slope = point.weight * tau * system.law(point).phi_slope(system.slip(v, point));
        if slope == 0.0 {
            continue;
        }
        let dofs = point.nodes.map(|n| system.nodes[n].tangent);
        for a in 0..3 {
            for b in 0..3 {
                if let (Dof::Free(row), Dof::Free(column)) = (dofs[a], dofs[b]) {
                    let value = slope * point.shape[a] * point.shape[b];
                    friction.push((place[row], place[column], value));
                }
            }
        }
    }
    let shift = if system.semidefinite {
        semidefinite_shift(system)
    } else {
        0.0
    };
    let elastic = |i: usize, j: usize| {
        let shift = if i == j { shift } else { 0.0 };
        system.stiffness.at(free[i], free[j]) + shift
    };
    let rhs: Vec<f64> = free.iter().map(|&dof| -force[dof]).collect();
    let direction = dense(free.len(), observe, |breaks| {
        solve_positive_definite(free.len(), elastic, &friction, &rhs, breaks)
    })?;
    direction.iter().all(|d| d.is_finite()).then_some(direction)
}
