//! Parts that both methods for the convex problem use: the gradient of J, and the displacements of held nodes.

use crate::algorithm::system::{State, System};
use crate::elasticity::Dof;

/// The best approximation of the minimiser of J that a method has found.
pub struct Minimum {
    /// The state with the smallest residual found.
    pub state: State,
    /// The number of Newton steps.
    pub steps: u32,
    /// The elastic force Ŝ v − f̂ of the state.
    pub elastic_force: Vec<f64>,
    /// The KKT residual of the state.
    pub residual: f64,
    /// Whether a residual above the tolerance is only rounding.
    pub rounded: bool,
}

/// The part of the tolerance that the methods aim at, so that the error of the inner problem does not disturb the outer
/// residuals. If rounding prevents that, the tolerance itself is enough.
pub(super) const AIM: f64 = 0.1;

/// Puts the nodes in contact onto the obstacle, and nodes held along t at their prescribed displacement; true if any
/// node moves.
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

/// The gradient ∇J at v. `elastic_force`: Ŝ v − f̂.
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
