//! Parts of both methods: the gradient of J, a Newton step, and nodes that are held.

use crate::algorithm::system::{State, System};
use crate::elasticity::Dof;
use crate::linear::{Breaks, Cholesky, Dense, Unsolved};
use crate::solution::{Observer, Progress};

/// The best approximation of the minimiser.
pub struct Minimum {
    /// The state.
    pub state: State,
    /// Newton steps taken.
    pub steps: u32,
    /// Ŝ v − f̂ of it.
    pub elastic_force: Vec<f64>,
    /// Its KKT residual.
    pub residual: f64,
    /// What is left of it above the tolerance is rounding.
    pub rounded: bool,
}

/// Aim at a tenth of the tolerance so that the error of the inner problem does not disturb the outer residuals.
/// Where rounding prevents that, the tolerance itself is enough.
pub(super) const AIM: f64 = 0.1;

/// Puts the nodes in contact onto the obstacle, and those held along t to their prescribed displacement; true if any of
/// them moves.
pub(in crate::algorithm) fn close(system: &System<'_>, state: &mut State) -> bool {
    let mut moved = false;
    let mut put = |v: &mut f64, to: f64| {
        moved |= *v != to;
        *v = to;
    };
    for (node, active) in system.nodes.iter().zip(&state.active) {
        if let (true, Dof::Free(dof)) = (active, node.normal) {
            put(&mut state.v[dof], node.gap);
        }
        if let (Dof::Free(dof), Some(held)) = (node.tangent, node.held_tangent) {
            put(&mut state.v[dof], held);
        }
    }
    moved
}

/// ∇J from Ŝ v − f̂.
pub(super) fn gradient(
    system: &System<'_>,
    v: &[f64],
    elastic_force: &[f64],
    bound: &[f64],
) -> Vec<f64> {
    let mut force = elastic_force.to_vec();
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

/// Dense work on a matrix of this size, for which the observer is asked first. None if it has no solution, or the
/// observer stops.
pub(in crate::algorithm) fn dense<T>(
    size: usize,
    observe: &mut Observer<'_>,
    solve: impl FnOnce(&mut Breaks<'_>) -> Result<T, Unsolved>,
) -> Option<T> {
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

/// The last factor of H = Ŝ + Σ w τ φ′ h hᵀ on some unknowns. It serves again as long as steps with it are nearly as
/// good as with a new one: from sweep to sweep friction bounds change little.
#[derive(Default)]
pub(in crate::algorithm) struct Factors {
    last: Option<(Vec<usize>, Cholesky)>,
    old: bool,
}

impl Factors {
    /// Has a factor on the free unknowns: true if it is a new one, for this state. None if H has no factor, or the observer
    /// stops.
    pub(in crate::algorithm) fn prepare(
        &mut self,
        system: &System<'_>,
        bound: &[f64],
        v: &[f64],
        free: &[usize],
        observe: &mut Observer<'_>,
    ) -> Option<bool> {
        let serves = |(unknowns, _): &(Vec<usize>, Cholesky)| unknowns == free && !self.old;
        if self.last.as_ref().is_some_and(serves) {
            return Some(false);
        }
        let room = self.last.take().map(|(_, factor)| factor);
        let factor = factor(system, bound, v, free, room, observe)?;
        self.last = Some((free.to_vec(), factor));
        self.old = false;
        Some(true)
    }

    /// −H⁻¹ ∇J on the unknowns that it was prepared for.
    pub(in crate::algorithm) fn direction(
        &self,
        free: &[usize],
        force: &[f64],
    ) -> Option<Vec<f64>> {
        let (_, factor) = self.last.as_ref()?;
        let mut direction: Vec<f64> = free.iter().map(|&dof| -force[dof]).collect();
        factor.solve(&mut direction);
        direction.iter().all(|d| d.is_finite()).then_some(direction)
    }

    /// Gives the last factor up.
    pub(in crate::algorithm) fn renew(&mut self) {
        self.old = true;
    }
}

/// The factor of H on the free unknowns.
fn factor(
    system: &System<'_>,
    bound: &[f64],
    v: &[f64],
    free: &[usize],
    room: Option<Cholesky>,
    observe: &mut Observer<'_>,
) -> Option<Cholesky> {
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
    dense(free.len(), observe, |breaks| {
        Cholesky::new(free.len(), elastic, &friction, room, breaks)
    })
}
