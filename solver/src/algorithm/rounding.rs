//! The smallest residuals that rounding permits, formulation 4.4: no iteration gets below them.
//!
//! Displacements are known to a part η = 2⁻⁵² of themselves. Slip is a small difference of displacements, and friction
//! divides it by ε, so that σ_t is known to τ φ′ η (|u_t| + |d| + |g|) / ε only; elastic forces are known to η (|Ŝ| |v|
//! +
//! f̂|). Both are divided by the same scale as the residuals, so that no unit enters.

use crate::algorithm::recorder::Measured;
use crate::algorithm::system::{Point, State, System};
use crate::elasticity::Dof;
use crate::solution::Residuals;

/// The number of operations that round one after another: a sum, a product, the interpolation between nodes, the
/// division by ε.
const OPERATIONS: f64 = 4.0;

/// The largest residual from rounding with which a state counts as a solution. The estimated error of a force or a peak
/// is never a smaller part of it than this (formulation 3.9), and rounding should not add to that error. The actual
/// residual is mostly 30 times smaller than the bound, but depends on chance and on units, so the outcome follows from
/// the bound.
const MOST: f64 = 1e-4;

/// The number of states in a row with only rounding left after which no better state is expected.
pub(super) const PATIENCE: u32 = 5;

/// The rounding that keeps a residual above the tolerance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rounding {
    /// The largest residual of the state.
    pub residual: f64,
    /// The largest value of that residual which rounding may leave.
    pub floor: f64,
    /// The slip that is rounded most; `None` if elastic forces are rounded more, since displacements are large compared
    /// with those that strain the body.
    pub slip: Option<RoundedSlip>,
}

/// The slip at the friction point where rounding leaves most.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoundedSlip {
    /// The contact of the friction point, by its place in the system.
    pub patch: usize,
    /// The size |u_t| + |d| + |g| of the displacements whose difference is the slip (length).
    pub displacement: f64,
}

impl Rounding {
    /// Whether the state is a solution to all digits that matter.
    pub fn negligible(&self) -> bool {
        self.floor <= MOST
    }
}

/// The rounding in a state, and the floor of the friction residual. None if the residuals are within the tolerance, or
/// above it for other reasons than rounding.
pub(super) fn limit(
    system: &System<'_>,
    measured: &Measured,
    tolerance: f64,
) -> Option<(Rounding, f64)> {
    if measured.within(tolerance) {
        return None;
    }
    let (floors, slip) = floors(
        system,
        &measured.state,
        &measured.reactions,
        &measured.bound,
    );
    let r = &measured.residuals;
    let pairs = [
        (r.kkt, floors.kkt),
        (r.friction, floors.friction),
        (r.monolithic, floors.monolithic),
    ];
    let rounded = pairs.iter().all(|(r, floor)| *r <= floor.max(tolerance));
    let largest = pairs.into_iter().max_by(|(a, _), (b, _)| a.total_cmp(b));
    let (residual, floor) = largest.filter(|_| rounded)?;
    let rounding = Rounding {
        residual,
        floor,
        slip,
    };
    Some((rounding, floors.friction))
}

/// Whether a [`System::kkt_residual`] is above the tolerance because of rounding only. `reactions`: those of the state.
pub(super) fn is_rounding(
    system: &System<'_>,
    (state, reactions, bound): (&State, &[f64], &[f64]),
    residual: f64,
    tolerance: f64,
) -> bool {
    residual > tolerance && residual <= floors(system, state, reactions, bound).0.kkt
}

/// The largest value of each residual that rounding may leave, and the friction point where rounding leaves most, if
/// friction is rounded more than elastic forces.
fn floors(
    system: &System<'_>,
    state: &State,
    reactions: &[f64],
    bound: &[f64],
) -> (Residuals, Option<RoundedSlip>) {
    const ETA: f64 = OPERATIONS * f64::EPSILON;
    let v = &state.v;
    let mut elastic: Vec<f64> = system.load.iter().map(|f| f.abs()).collect();
    for (j, v) in v.iter().enumerate().filter(|(_, v)| **v != 0.0) {
        let column = elastic.iter_mut().zip(system.stiffness.column(j));
        column.for_each(|(sum, entry)| *sum += (entry * v).abs());
    }
    elastic.iter_mut().for_each(|sum| *sum *= ETA);

    let pressures = system.pressures(reactions);
    let reaction = |node: usize| match system.nodes[node].normal {
        Dof::Free(dof) => elastic[dof],
        Dof::Fixed(_) => 0.0,
    };
    let (mut of_slip, mut of_bound) = (vec![0.0f64; v.len()], vec![0.0f64; v.len()]);
    let (mut bound_change, mut worst) = (0.0f64, (0.0f64, None));
    for (point, tau) in system.points.iter().zip(bound) {
        let (law, slip) = (system.law(point), system.slip(v, point));
        let displacement = displacement(system, v, point);
        let unknown = ETA * displacement;
        let steepest = law.phi_slope((slip.abs() - unknown).max(0.0));
        let traction = tau * (steepest * unknown).min(2.0);
        if point.weight * traction > worst.0 {
            let patch = point.patch;
            let slip = RoundedSlip {
                patch,
                displacement,
            };
            worst = (point.weight * traction, Some(slip));
        }
        let average = point.source.nonlocal_pressure(&pressures);
        let weights = system.reaction_weights(state, point).into_iter();
        let pressure: f64 = weights.map(|(node, w)| w.abs() * reaction(node)).sum();
        let change = law.bound.slope(average) * pressure;
        bound_change = bound_change.max(change);
        for i in 0..3 {
            if let Dof::Free(dof) = system.nodes[point.nodes[i]].tangent {
                let share = point.weight * point.shape[i].abs();
                of_slip[dof] += share * traction;
                of_bound[dof] += share * law.phi(slip).abs() * change;
            }
        }
    }
    let scale = system.force_scale(state, reactions, bound);
    let largest = |sum: &dyn Fn(usize) -> f64| (0..v.len()).map(sum).fold(0.0, f64::max);
    let relative = |force: f64| if force == 0.0 { 0.0 } else { force / scale };
    let most = bound.iter().fold(0.0f64, |most, tau| most.max(*tau));
    let floors = Residuals {
        kkt: relative(largest(&|i| elastic[i] + of_slip[i])),
        friction: match bound_change {
            0.0 => 0.0,
            change => change / most.max(f64::MIN_POSITIVE),
        },
        monolithic: relative(largest(&|i| elastic[i] + of_slip[i] + of_bound[i])),
        equilibrium: 0.0,
    };
    let by_slip = largest(&|i| of_slip[i]) >= largest(&|i| elastic[i]);
    (floors, worst.1.filter(|_| by_slip))
}

/// The size |u_t| + |d| + |g| of the displacements whose difference is the slip at a point.
fn displacement(system: &System<'_>, v: &[f64], point: &Point) -> f64 {
    let size = |i: usize| {
        let node = point.nodes[i];
        let sum = system.tangential_displacement(v, node).abs() + system.nodes[node].drag.abs();
        point.shape[i].abs() * sum
    };
    (0..3).map(size).sum::<f64>() + point.anchor.abs()
}
