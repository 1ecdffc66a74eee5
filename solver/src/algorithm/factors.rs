//! Factorisations of H on the free unknowns, which are used again while they are accurate enough.

use crate::algorithm::system::System;
use crate::elasticity::Dof;
use crate::linear::{Cholesky, Dense, Interrupt, Unsolved};
use crate::observer::{Observer, Progress, take};

/// The free unknowns: normal displacements of nodes that are not `held`, and tangential displacements that are not
/// prescribed.
pub(super) fn free_dofs(system: &System<'_>, held: impl Fn(usize) -> bool) -> Vec<usize> {
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

/// The number that is added to the diagonal of H if Ŝ leaves rigid motions free. It keeps Newton's steps along such a
/// motion finite, though long, until contact stops the motion. After that the shift costs a step or two but no accuracy,
/// since the gradient does not depend on it.
pub(super) fn semidefinite_shift(system: &System<'_>) -> f64 {
    let size = system.stiffness.size().max(1);
    let diagonal: f64 = (0..system.stiffness.size())
        .map(|i| system.stiffness.at(i, i))
        .sum();
    1e-9 * diagonal / size as f64
}

/// Solves a problem with a dense matrix of this size, after asking the observer for the memory. None if there is no
/// solution or not enough memory, or the observer stops.
pub(super) fn dense<T>(
    size: usize,
    observer: &mut dyn Observer,
    solve: impl FnOnce(&mut Interrupt<'_>) -> Result<T, Unsolved>,
) -> Option<T> {
    let bytes = Dense::bytes(size);
    take(observer, bytes).ok()?;
    match solve(&mut Interrupt::new(&mut || observer.stop())) {
        Ok(x) => Some(x),
        Err(Unsolved::TooLarge { bytes }) => {
            observer.event(Progress::OutOfMemory { bytes });
            None
        }
        Err(Unsolved::Singular | Unsolved::Stopped) => None,
    }
}

/// The last factor of H = Ŝ + Σ w τ φ′ h hᵀ on some unknowns. The factor is used again as long as steps with it are
/// nearly as good as with a new factor: from sweep to sweep friction bounds change little.
#[derive(Default)]
pub(super) struct Factors {
    last: Option<(Vec<usize>, Cholesky)>,
    old: bool,
}

impl Factors {
    /// Makes sure that there is a factor on the free unknowns; true if a new factor was made, for the state v. None if
    /// H has no factor, or the observer stops.
    pub(super) fn prepare(
        &mut self,
        system: &System<'_>,
        bound: &[f64],
        v: &[f64],
        free: &[usize],
        observer: &mut dyn Observer,
    ) -> Option<bool> {
        let serves = |(unknowns, _): &(Vec<usize>, Cholesky)| unknowns == free && !self.old;
        if self.last.as_ref().is_some_and(serves) {
            return Some(false);
        }
        let room = self.last.take().map(|(_, factor)| factor);
        let factor = factor(system, bound, v, free, room, observer)?;
        self.last = Some((free.to_vec(), factor));
        self.old = false;
        Some(true)
    }

    /// The step −H⁻¹ ∇J on the unknowns of the factor, 0 on the others. `force`: ∇J.
    pub(super) fn direction(&self, force: &[f64]) -> Option<Vec<f64>> {
        let (free, factor) = self.last.as_ref()?;
        let mut moved: Vec<f64> = free.iter().map(|&dof| -force[dof]).collect();
        factor.solve(&mut moved);
        let mut direction = vec![0.0; force.len()];
        for (&dof, d) in free.iter().zip(moved) {
            direction[dof] = d;
        }
        direction.iter().all(|d| d.is_finite()).then_some(direction)
    }

    /// Makes the next [`prepare`](Self::prepare) compute a new factor.
    pub(super) fn renew(&mut self) {
        self.old = true;
    }
}

/// Computes the factor of H on the free unknowns. `room`: an old factor whose memory is used again.
fn factor(
    system: &System<'_>,
    bound: &[f64],
    v: &[f64],
    free: &[usize],
    room: Option<Cholesky>,
    observer: &mut dyn Observer,
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
    dense(free.len(), observer, |interrupt| {
        Cholesky::new(free.len(), elastic, &friction, room, interrupt)
    })
}
