//! The change of a quantity of the solution by small forces on the contact unknowns: the adjoint of the linearised
//! contact problem.
//!
//! The free unknowns F move. The unknowns A of nodes in contact and of held tangents do not move, but their reactions
//! change. With H = ∂r/∂v_F of [`newton`](super::newton), a quantity J(v, R, Q) of displacements v, normal reactions R
//! = (f̂ − Ŝ v)_A and tangential reactions Q = (Ŝ v − f̂)_A changes by z · δf̂,
//!
//!   Hᵀ z_F = J_v − Ŝ_FA J_R + Ŝ_FA J_Q,    z_A = J_R − Bᵀ z_F  or  −J_Q,
//!
//! where B = ∂(friction forces)/∂R. The values z are also displacements of the contact nodes: those of the dual
//! solution, by which the errors of the body's stresses are weighted.

use crate::algorithm::factors::{dense, free_dofs};
use crate::algorithm::newton::jacobian;
use crate::algorithm::opposite::Opposite;
use crate::algorithm::system::{Point, State, System};
use crate::elasticity::Dof;
use crate::linear::Interrupt;
use crate::observer::Observer;

/// The derivatives of a quantity by the contact unknowns and reactions.
#[derive(Clone, Debug)]
pub struct Gradient {
    /// The derivative by each contact unknown.
    pub displacement: Vec<f64>,
    /// The derivative by the normal reaction of each contact node.
    pub reaction: Vec<f64>,
    /// The derivative by the tangential reaction of each contact node whose tangent is held.
    pub held: Vec<f64>,
    /// The number of the unknown motion of an obstacle that the quantity is.
    pub motion: Option<usize>,
}

impl Gradient {
    /// The gradient of a constant: all derivatives are 0.
    pub fn zero(system: &System<'_>) -> Self {
        Gradient {
            displacement: vec![0.0; system.load.len()],
            reaction: vec![0.0; system.nodes.len()],
            held: vec![0.0; system.nodes.len()],
            motion: None,
        }
    }

    /// The gradient of an unknown motion of an obstacle.
    pub(super) fn of_motion(system: &System<'_>, opposite: &Opposite, motion: usize) -> Self {
        Gradient {
            displacement: opposite.gradient(motion),
            motion: Some(motion),
            ..Gradient::zero(system)
        }
    }

    /// Adds `factor` times the derivatives of σ_t = −τ φ at a point.
    pub(super) fn add_traction(
        &mut self,
        system: &System<'_>,
        state: &State,
        pressures: &[f64],
        bound: f64,
        point: &Point,
        factor: f64,
    ) {
        let (law, slip) = (system.law(point), system.slip(&state.v, point));
        self.add_slip(system, point, -factor * bound * law.phi_slope(slip));
        self.add_bound(system, state, pressures, point, factor);
    }

    /// Adds `factor` times the derivatives of σ_t = −τ φ at a point by the pressures on which the bound τ depends.
    pub(super) fn add_bound(
        &mut self,
        system: &System<'_>,
        state: &State,
        pressures: &[f64],
        point: &Point,
        factor: f64,
    ) {
        let (law, slip) = (system.law(point), system.slip(&state.v, point));
        let slope = law.bound.slope(point.source.nonlocal_pressure(pressures));
        let factor = -factor * law.phi(slip) * slope;
        if factor != 0.0 {
            for (node, weight) in system.reaction_weights(state, point) {
                self.reaction[node] += factor * weight;
            }
        }
    }

    /// Adds `factor` times the derivatives of the slip at a point.
    pub(super) fn add_slip(&mut self, system: &System<'_>, point: &Point, factor: f64) {
        for (node, shape) in point.nodes.iter().zip(point.shape) {
            if let Dof::Free(dof) = system.nodes[*node].tangent {
                self.displacement[dof] += factor * shape;
            }
        }
    }

    /// Adds `factor` times the derivatives of the pressure of a node.
    pub(super) fn add_pressure(&mut self, system: &System<'_>, node: usize, factor: f64) {
        for (other, weight) in system.pressure_weights(node, factor) {
            self.reaction[other] += weight;
        }
    }
}

/// The work for evaluating the law at one friction point, in multiplications.
const WORK_OF_A_POINT: usize = 100;

/// By quantity J, the influence z of forces on the contact unknowns: dJ = z · δf̂. None if the linearised problem has
/// no unique solution, or the observer stops.
pub fn influences(
    system: &System<'_>,
    state: &State,
    gradients: &[&Gradient],
    observer: &mut dyn Observer,
) -> Option<Vec<Vec<f64>>> {
    let free = free_dofs(system, |i| state.active[i]);
    let mut place = vec![usize::MAX; system.load.len()];
    free.iter().enumerate().for_each(|(k, &dof)| place[dof] = k);
    let pressures = system.pressures(&system.reactions(state));
    let bound = system.friction_bound(&pressures);
    let mut rhs = Vec::with_capacity(free.len() * gradients.len());
    let mut fixed = Vec::new();
    let mut stop = || observer.stop();
    let interrupt = &mut Interrupt::new(&mut stop);
    for gradient in gradients {
        let mut z = vec![0.0; system.load.len()];
        for (i, node) in system.nodes.iter().enumerate() {
            if let (true, Dof::Free(dof)) = (state.active[i], node.normal) {
                z[dof] = gradient.reaction[i];
            }
            if let (Some(_), Dof::Free(dof)) = (node.held_tangent, node.tangent) {
                z[dof] = -gradient.held[i];
            }
        }
        let reflected = system.stiffness.times(&z);
        let columns = z.iter().filter(|z| **z != 0.0).count().max(1);
        interrupt.worked((columns * z.len()) as f64).ok()?;
        rhs.extend(
            free.iter()
                .map(|&dof| gradient.displacement[dof] - reflected[dof]),
        );
        fixed.push(z);
    }
    let solved = dense(free.len(), observer, |interrupt| {
        let known = (&bound[..], &pressures[..]);
        let mut h = jacobian(system, state, known, &free, &place, 0.0, interrupt)?;
        h.transpose(interrupt)?;
        h.solve(&rhs, interrupt)
    })?;
    let mut influences = fixed;
    let mut stop = || observer.stop();
    let interrupt = &mut Interrupt::new(&mut stop);
    for (k, z) in influences.iter_mut().enumerate() {
        let own = &solved[k * free.len()..(k + 1) * free.len()];
        free.iter()
            .zip(own)
            .for_each(|(&dof, value)| z[dof] = *value);
        interrupt
            .worked((z.len() + WORK_OF_A_POINT * system.points.len()) as f64)
            .ok()?;
        // friction follows the reactions: −Bᵀ z_F
        for point in &system.points {
            let law = system.law(point);
            let moved: f64 = (0..3)
                .filter_map(|i| match system.nodes[point.nodes[i]].tangent {
                    Dof::Free(dof) if place[dof] != usize::MAX => Some(point.shape[i] * z[dof]),
                    _ => None,
                })
                .sum();
            let slope = law.bound.slope(point.source.nonlocal_pressure(&pressures));
            let factor = point.weight * law.phi(system.slip(&state.v, point)) * slope * moved;
            if factor != 0.0 {
                for (node, weight) in system.reaction_weights(state, point) {
                    if let Dof::Free(dof) = system.nodes[node].normal {
                        z[dof] -= factor * weight;
                    }
                }
            }
        }
    }
    Some(influences)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::algorithm::{Place, Quantity, report, run};

    fn solve(system: &System<'_>) -> (State, Vec<Quantity>) {
        let quiet: &mut dyn Observer = &mut ();
        let controls = &system.model.controls;
        let finished = run(system, controls, Place::default(), None, quiet);
        // small forces that are none of the model's loads are missing in the balance of the result
        assert_eq!(finished.outcome, crate::solution::Outcome::Converged);
        let reported = report(system, &finished, quiet).unwrap();
        (finished.state, reported.along.quantities)
    }

    /// The predicted change z · δf̂ of each quantity under small forces on the contact equals the change found by
    /// solving again: with averaging, in axisymmetry with a node on the axis, without friction, and bonded.
    #[test]
    fn influences_are_what_small_forces_change() {
        let law =
            serde_json::json!({"coefficient": 0.4, "nonlocal_radius": 0.2, "elastic_slip": 1e-2});
        let pushed = serde_json::json!({"indentation": 0.1});
        let pressed = serde_json::json!({"normal_force": 60});
        let turned = serde_json::json!({"normal_force": 60, "tangential_force": 5, "moment": -20, "about": [0, 0.3]});
        let cases = [
            ("plane_strain", "unilateral", Some(law.clone()), &pushed),
            ("axisymmetric", "unilateral", Some(law.clone()), &pushed),
            ("plane_strain", "unilateral", None, &pushed),
            ("plane_strain", "bonded", None, &pushed),
            ("plane_strain", "unilateral", Some(law.clone()), &pressed),
            ("axisymmetric", "unilateral", Some(law.clone()), &pressed),
            ("plane_strain", "unilateral", Some(law), &turned),
            ("plane_strain", "bonded", None, &turned),
        ];
        for (kind, condition, friction, given) in cases {
            let mut problem = serde_json::json!({
                "analysis": {"kind": kind},
                "mesh": {"grid": {"x": [0, 0.2, 0.4, 0.6, 0.8, 1, 1.5, 2], "y": [-2, -1, -0.4, 0]}},
                "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
                "supports": [{"boundary": "left", "ux": 0}, {"boundary": "bottom", "uy": 0}],
                "contacts": [{"boundary": "top", "obstacle": {"kind": "parabola", "radius": 5},
                    "condition": condition}],
                "solver": {"tolerance": 1e-13}
            });
            if let Some(friction) = friction {
                problem["contacts"][0]["friction"] = friction;
            }
            let more = given.as_object().unwrap().clone();
            problem["contacts"][0].as_object_mut().unwrap().extend(more);
            if given == &turned {
                // a line of symmetry would hold the obstacle
                problem["supports"] = serde_json::json!([{"boundary": "bottom", "ux": 0, "uy": 0}]);
            }
            let problem = serde_json::from_value(problem).unwrap();
            let quiet: &mut dyn Observer = &mut ();
            let prepared = crate::prepare(&problem, None, quiet).unwrap();
            let mut system = System::new(&prepared.model, &prepared.body, quiet).unwrap();
            let (state, quantities) = solve(&system);
            let known: Vec<&Quantity> =
                quantities.iter().filter(|q| q.gradient.is_some()).collect();
            let gradients: Vec<&Gradient> =
                known.iter().filter_map(|q| q.gradient.as_ref()).collect();
            let z = influences(&system, &state, &gradients, quiet).unwrap();
            let load = system.load.clone();
            let forces: Vec<f64> = (0..load.len()).map(|i| 1e-4 * (i as f64).sin()).collect();
            let mut moved = |sign: f64| {
                system.load = load
                    .iter()
                    .zip(&forces)
                    .map(|(a, b)| a + sign * b)
                    .collect();
                let (_, quantities) = solve(&system);
                quantities
            };
            let (more, less) = (moved(1.0), moved(-1.0));
            for (quantity, z) in known.iter().zip(&z) {
                let value = |all: &[Quantity]| {
                    let nearest = |a: &&Quantity, b: &&Quantity| {
                        let off = |q: &Quantity| (q.value - quantity.value).abs();
                        off(a).total_cmp(&off(b))
                    };
                    let same = all.iter().filter(|q| q.name == quantity.name);
                    same.min_by(nearest).unwrap().value
                };
                let found = 0.5 * (value(&more) - value(&less));
                // an end of stick moves against the slip there
                let sign = if quantity.name == crate::solution::QuantityName::StickEnd {
                    -1.0
                } else {
                    1.0
                };
                let along: f64 = z.iter().zip(&forces).map(|(a, b)| a * b).sum();
                let expected = sign * quantity.factor * along;
                let size: f64 = z
                    .iter()
                    .zip(&forces)
                    .map(|(a, b)| (quantity.factor * a * b).abs())
                    .sum();
                assert!(
                    (found - expected).abs() <= 1e-4 * size + 1e-11 * quantity.value.abs(),
                    "{kind} {condition} {:?}: {found:e} for {expected:e}",
                    quantity.name
                );
            }
            assert!(known.len() >= 4, "{kind} {condition}");
        }
    }
}
