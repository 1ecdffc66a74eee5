//! Projected Newton (Bertsekas 1982) with a line search: slower, but J decreases at every step.

use super::step::{AIM, Minimum, close, gradient};
use crate::algorithm::factors::{Factors, free_dofs};
use crate::algorithm::rounding::{PATIENCE, is_rounding};
use crate::algorithm::system::{ContactNode, State, System};
use crate::elasticity::Dof;
use crate::friction::FrictionLaw;
use crate::observer::Observer;

/// The largest number of steps; a dozen are usual.
const PROJECTED_STEPS: u32 = 300;

/// Minimises J by projected Newton (Bertsekas): holds the nodes that press against the obstacle, steps in the other
/// unknowns, and cuts the step off where it would pass the obstacle.
pub(super) fn run(
    system: &System<'_>,
    bound: &[f64],
    start: &State,
    tolerance: f64,
    factors: &mut Factors,
    observer: &mut dyn Observer,
) -> Minimum {
    let mut best = Minimum {
        state: start.clone(),
        elastic_force: system.elastic_force(&start.v),
        steps: 0,
        residual: f64::INFINITY,
        rounded: false,
    };
    let mut begin = start.clone();
    close(system, &mut begin);
    let (mut v, mut steps) = (begin.v, 0);
    project(system, &mut v);
    while steps < PROJECTED_STEPS {
        let mut elastic_force = system.elastic_force(&v);
        let mut force = gradient(system, &v, &elastic_force, bound);
        let state = State {
            active: pressed(system, &v, &force),
            v: v.clone(),
        };
        let residual = system.kkt_residual(&state, &elastic_force, bound);
        if residual < best.residual {
            best = Minimum {
                state,
                elastic_force: elastic_force.clone(),
                steps,
                residual,
                rounded: false,
            };
        }
        let stale = steps - best.steps.min(steps);
        let patient = stale < PATIENCE;
        best.rounded = !patient && {
            let reactions = system.reactions_of(&best.state, &best.elastic_force);
            let known = (&best.state, &reactions[..], bound);
            is_rounding(system, known, best.residual, tolerance)
        };
        let arrived = best.residual <= AIM * tolerance
            || best.residual <= tolerance && !patient
            || best.rounded;
        if arrived || observer.stop() {
            break;
        }
        steps += 1;
        let held = binding(system, &v, &force);
        for (i, node) in system.nodes.iter().enumerate() {
            if let (true, Dof::Free(dof)) = (held[i], node.normal)
                && !node.bonded
            {
                v[dof] = node.gap;
            }
        }
        elastic_force = system.elastic_force(&v);
        force = gradient(system, &v, &elastic_force, bound);
        let free = free_dofs(system, |i| held[i]);
        // J decreases along the direction of a new factor
        factors.renew();
        let prepared = factors.prepare(system, bound, &v, &free, observer);
        let Some(d) = prepared.and_then(|_| factors.direction(&force)) else {
            break;
        };
        if !line_search(system, bound, &mut v, &d, &force) {
            break;
        }
    }
    best.steps = steps;
    best
}

/// Projects the displacements v onto the constraints: no node passes the obstacle, and bonded nodes are on it.
fn project(system: &System<'_>, v: &mut [f64]) {
    for node in &system.nodes {
        let Dof::Free(dof) = node.normal else {
            continue;
        };
        v[dof] = if node.bonded {
            node.gap
        } else {
            v[dof].min(node.gap)
        };
    }
}

/// The active set at v: the nodes on the obstacle that are pressed against it. `force`: ∇J.
fn pressed(system: &System<'_>, v: &[f64], force: &[f64]) -> Vec<bool> {
    let state = |node: &ContactNode| match node.normal {
        Dof::Fixed(_) => false,
        Dof::Free(dof) => node.bonded || v[dof] >= node.gap && -force[dof] >= 0.0,
    };
    system.nodes.iter().map(state).collect()
}

/// Bertsekas' set: nodes so close to the obstacle, considering the force on them, that a step would reach it. `force`:
/// ∇J.
fn binding(system: &System<'_>, v: &[f64], force: &[f64]) -> Vec<bool> {
    // nearness is measured by the natural residual: it shrinks as the solution is approached
    let mut natural: f64 = 0.0;
    for node in system.nodes.iter().filter(|node| !node.bonded) {
        if let Dof::Free(dof) = node.normal {
            let step = -force[dof] / system.stiffness.at(dof, dof);
            natural = natural.max(step.min(node.gap - v[dof]).abs());
        }
    }
    let holds = |node: &ContactNode| match node.normal {
        Dof::Fixed(_) => true,
        Dof::Free(dof) => {
            let near = natural.min(-force[dof] / system.stiffness.at(dof, dof));
            node.bonded || force[dof] < 0.0 && node.gap - v[dof] <= near
        }
    };
    system.nodes.iter().map(holds).collect()
}

/// Moves v along d: exactly to the minimum of J if no obstacle blocks the way, else by Armijo's rule along the
/// projected path. False if J cannot be reduced further.
fn line_search(
    system: &System<'_>,
    bound: &[f64],
    v: &mut Vec<f64>,
    d: &[f64],
    force: &[f64],
) -> bool {
    let slope: f64 = force.iter().zip(d).map(|(g, d)| g * d).sum();
    if slope >= 0.0 {
        return false;
    }
    let blocked_at = system
        .nodes
        .iter()
        .filter(|node| !node.bonded)
        .filter_map(|node| match node.normal {
            Dof::Free(dof) if d[dof] > 0.0 => Some((node.gap - v[dof]) / d[dof]),
            _ => None,
        })
        .fold(f64::INFINITY, f64::min);
    let along = Along::new(system, bound, v, d, slope);
    if blocked_at >= 1.0 {
        let step = along.minimum(blocked_at.min(4.0));
        v.iter_mut().zip(d).for_each(|(v, d)| *v += step * d);
        return step > 0.0;
    }
    let mut step = 1.0;
    for _ in 0..60 {
        let mut trial: Vec<f64> = v.iter().zip(d).map(|(v, d)| v + step * d).collect();
        project(system, &mut trial);
        let moved: Vec<f64> = trial.iter().zip(v.iter()).map(|(a, b)| a - b).collect();
        let predicted: f64 = force.iter().zip(&moved).map(|(g, m)| g * m).sum();
        let path = Along::new(system, bound, v, &moved, predicted);
        if predicted < 0.0 && path.change() <= 1e-4 * predicted {
            *v = trial;
            return true;
        }
        step *= 0.5;
    }
    false
}

/// The α in (0, 1] with the smallest J along v + α d; 1 if J does not decrease along d.
pub(in crate::algorithm) fn least_along(
    system: &System<'_>,
    bound: &[f64],
    v: &[f64],
    d: &[f64],
) -> f64 {
    let force = gradient(system, v, &system.elastic_force(v), bound);
    let slope: f64 = force.iter().zip(d).map(|(g, d)| g * d).sum();
    if slope < 0.0 {
        Along::new(system, bound, v, d, slope).minimum(1.0)
    } else {
        1.0
    }
}

/// J along the line v + α d, as a function of α.
struct Along<'a> {
    slope: f64,
    curvature: f64,
    /// For each friction point with a bound at which the slip changes along d: w τ, the slip at v, its change along d,
    /// and the law.
    friction: Vec<(f64, f64, f64, &'a FrictionLaw)>,
}

impl<'a> Along<'a> {
    fn new(system: &'a System<'_>, bound: &[f64], v: &[f64], d: &[f64], slope: f64) -> Self {
        let curvature = system
            .stiffness
            .times(d)
            .iter()
            .zip(d)
            .map(|(a, b)| a * b)
            .sum();
        let mut friction = Vec::new();
        for (point, tau) in system.points.iter().zip(bound) {
            let change: f64 = (0..3)
                .map(|i| match system.nodes[point.nodes[i]].tangent {
                    Dof::Free(dof) => point.shape[i] * d[dof],
                    Dof::Fixed(_) => 0.0,
                })
                .sum();
            if *tau > 0.0 && change != 0.0 {
                friction.push((
                    point.weight * tau,
                    system.slip(v, point),
                    change,
                    system.law(point),
                ));
            }
        }
        Along {
            slope,
            curvature,
            friction,
        }
    }

    /// The derivative dJ/dα.
    fn derivative(&self, alpha: f64) -> f64 {
        let friction: f64 = self
            .friction
            .iter()
            .map(|(weight, slip, change, law)| {
                weight * change * (law.phi(slip + alpha * change) - law.phi(*slip))
            })
            .sum();
        self.slope + alpha * self.curvature + friction
    }

    /// The change J(1) − J(0).
    fn change(&self) -> f64 {
        let friction: f64 = self
            .friction
            .iter()
            .map(|(weight, slip, change, law)| {
                weight * (law.psi(slip + change) - law.psi(*slip) - law.phi(*slip) * change)
            })
            .sum();
        self.slope + 0.5 * self.curvature + friction
    }

    /// The α in (0, `most`] with the smallest J. The derivative grows with α, so its root is bracketed.
    fn minimum(&self, most: f64) -> f64 {
        if self.derivative(most) <= 0.0 {
            return most;
        }
        let (mut low, mut high) = (0.0, most);
        // halving to the last digit is cheap: it needs no matrix
        for _ in 0..80 {
            let middle = 0.5 * (low + high);
            if self.derivative(middle) <= 0.0 {
                low = middle
            } else {
                high = middle
            }
        }
        if low > 0.0 { low } else { high }
    }
}
