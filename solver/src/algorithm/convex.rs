//! The inner problem, thesis (1.18)–(1.21): for a frozen friction bound τ, minimise the convex
//!
//!   J(v) = ½ vᵀŜv − f̂ᵀv + Σ_g w_g τ_g ψ_ε(u_t(g) − d)     subject to u_n ≤ gap
//!
//! First a primal–dual active set with semi-smooth Newton steps, which mostly needs one to five;
//! where that does not settle, projected Newton with a line search, which always does.

use crate::algorithm::system::{ContactNode, State, System};
use crate::elasticity::Dof;
use crate::friction::FrictionLaw;
use crate::linear::solve_positive_definite;

/// Steps of the active set before falling back.
const ACTIVE_SET_STEPS: u32 = 30;

/// Steps of projected Newton; a dozen are usual.
const PROJECTED_STEPS: u32 = 300;

/// The minimiser, as near as it was reached.
pub struct Minimum {
    /// The state.
    pub state: State,
    /// Newton steps taken.
    pub steps: u32,
    /// Its KKT residual.
    pub residual: f64,
}

/// Minimises J from `start` until the KKT residual is below `tolerance`.
pub fn minimise(system: &System<'_>, bound: &[f64], start: &State, tolerance: f64) -> Minimum {
    let by_active_set = active_set(system, bound, start, tolerance);
    if by_active_set.residual <= tolerance {
        return by_active_set;
    }
    let mut fallback = projected_newton(system, bound, &by_active_set.state, tolerance);
    fallback.steps += by_active_set.steps;
    if fallback.residual <= by_active_set.residual {
        fallback
    } else {
        by_active_set
    }
}

/// Guess the active set, solve for it with one Newton step, correct the guess.
fn active_set(system: &System<'_>, bound: &[f64], start: &State, tolerance: f64) -> Minimum {
    let mut state = start.clone();
    let mut best: Option<Minimum> = None;
    for step in 1..=ACTIVE_SET_STEPS {
        close(system, &mut state);
        let free: Vec<usize> = free_dofs(system, |i| state.active[i]);
        let force = gradient(system, &state.v, bound);
        let Some(delta) = newton_direction(system, bound, &state.v, &force, &free) else {
            break;
        };
        free.iter()
            .zip(&delta)
            .for_each(|(&dof, d)| state.v[dof] += d);
        let changed = update_active(system, bound, &mut state);
        let residual = system.kkt_residual(&state, bound);
        if best.as_ref().is_none_or(|b| residual < b.residual) {
            best = Some(Minimum {
                state: state.clone(),
                steps: step,
                residual,
            });
        }
        if !changed && residual <= tolerance {
            break;
        }
    }
    let steps = best.as_ref().map_or(0, |b| b.steps);
    best.unwrap_or(Minimum {
        state,
        steps,
        residual: f64::INFINITY,
    })
}

/// Puts active nodes onto the obstacle.
fn close(system: &System<'_>, state: &mut State) {
    for (node, active) in system.nodes.iter().zip(&state.active) {
        if let (true, Dof::Free(dof)) = (active, node.normal) {
            state.v[dof] = node.gap;
        }
    }
}

/// Keeps nodes that are pressed, adds nodes that have passed the obstacle; true on any change.
fn update_active(system: &System<'_>, bound: &[f64], state: &mut State) -> bool {
    let force = gradient(system, &state.v, bound);
    let mut changed = false;
    for (i, node) in system.nodes.iter().enumerate() {
        let Dof::Free(dof) = node.normal else {
            continue;
        };
        if node.follows.is_some() {
            continue;
        }
        let active = if state.active[i] {
            -force[dof] >= 0.0
        } else {
            state.v[dof] > node.gap
        };
        changed |= active != state.active[i];
        state.active[i] = active;
    }
    changed | follow(system, &mut state.active)
}

/// Nodes on the axis take the state of their neighbours; true on any change.
fn follow(system: &System<'_>, active: &mut [bool]) -> bool {
    let mut changed = false;
    for (i, node) in system.nodes.iter().enumerate() {
        if let Some([next, _]) = node.follows {
            changed |= active[i] != active[next];
            active[i] = active[next];
        }
    }
    changed
}

/// ∇J.
fn gradient(system: &System<'_>, v: &[f64], bound: &[f64]) -> Vec<f64> {
    let mut force = system.elastic_force(v);
    system.add_friction_force(v, bound, &mut force);
    force
}

/// Unknowns that are not held: all tangential ones, and the normal ones of nodes not `held`.
fn free_dofs(system: &System<'_>, held: impl Fn(usize) -> bool) -> Vec<usize> {
    let mut free = Vec::with_capacity(system.load.len());
    for (i, node) in system.nodes.iter().enumerate() {
        if let (Dof::Free(dof), false) = (node.normal, held(i)) {
            free.push(dof);
        }
        if let Dof::Free(dof) = node.tangent {
            free.push(dof);
        }
    }
    free
}

/// −H⁻¹ ∇J on the free unknowns, H = Ŝ + Σ w τ φ′ h hᵀ.
fn newton_direction(
    system: &System<'_>,
    bound: &[f64],
    v: &[f64],
    force: &[f64],
    free: &[usize],
) -> Option<Vec<f64>> {
    let mut place = vec![usize::MAX; system.load.len()];
    free.iter().enumerate().for_each(|(k, &dof)| place[dof] = k);
    // friction couples the nodes of one edge only: a short list of additions to a dense matrix
    let mut tangents = vec![Vec::<(usize, f64)>::new(); free.len()];
    for (point, tau) in system.points.iter().zip(bound) {
        let slope = point.weight * tau * system.law(point).phi_slope(system.slip(v, point));
        if slope == 0.0 {
            continue;
        }
        let dofs = point.nodes.map(|n| system.nodes[n].tangent);
        for a in 0..3 {
            for b in 0..3 {
                if let (Dof::Free(row), Dof::Free(column)) = (dofs[a], dofs[b]) {
                    tangents[place[row]]
                        .push((place[column], slope * point.shape[a] * point.shape[b]));
                }
            }
        }
    }
    let entry = |i: usize, j: usize| {
        let friction: f64 = tangents[i]
            .iter()
            .filter(|(column, _)| *column == j)
            .map(|(_, value)| value)
            .sum();
        system.stiffness.at(free[i], free[j]) + friction
    };
    let rhs: Vec<f64> = free.iter().map(|&dof| -force[dof]).collect();
    let direction = solve_positive_definite(free.len(), entry, &rhs)?;
    direction.iter().all(|d| d.is_finite()).then_some(direction)
}

/// Projected Newton (Bertsekas): hold the nodes that press against the obstacle, step in the
/// others, and let the step end on the obstacle where it would pass it.
///
/// A node on the axis is no inequality: it is locked to its neighbour's state, and the whole is
/// solved again when that state turns out different.
fn projected_newton(system: &System<'_>, bound: &[f64], start: &State, tolerance: f64) -> Minimum {
    let mut best = Minimum {
        state: start.clone(),
        steps: 0,
        residual: f64::INFINITY,
    };
    let mut locked = start.active.clone();
    follow(system, &mut locked);
    let mut steps = 0;
    for _ in 0..4 {
        let mut v = start.v.clone();
        project(system, &mut v, &locked);
        while steps < PROJECTED_STEPS {
            let mut force = gradient(system, &v, bound);
            let state = State {
                active: pressed(system, &v, &force, &locked),
                v: v.clone(),
            };
            let residual = system.kkt_residual(&state, bound);
            if residual < best.residual {
                best = Minimum {
                    state,
                    steps,
                    residual,
                };
            }
            if best.residual <= tolerance {
                break;
            }
            steps += 1;
            let held = binding(system, &v, &force, &locked);
            for (i, node) in system.nodes.iter().enumerate() {
                if let (true, Dof::Free(dof)) = (held[i], node.normal)
                    && node.follows.is_none()
                {
                    v[dof] = node.gap;
                }
            }
            force = gradient(system, &v, bound);
            let free = free_dofs(system, |i| held[i]);
            let Some(direction) = newton_direction(system, bound, &v, &force, &free) else {
                break;
            };
            let mut d = vec![0.0; v.len()];
            free.iter()
                .zip(direction)
                .for_each(|(&dof, value)| d[dof] = value);
            if !line_search(system, bound, &mut v, &d, &force, &locked) {
                break;
            }
        }
        let mut expected = best.state.active.clone();
        if !follow(system, &mut expected) {
            break;
        }
        locked = expected;
        best.residual = f64::INFINITY;
    }
    best.steps = steps;
    best
}

/// Puts v where the constraints allow it.
fn project(system: &System<'_>, v: &mut [f64], locked: &[bool]) {
    for (i, node) in system.nodes.iter().enumerate() {
        let Dof::Free(dof) = node.normal else {
            continue;
        };
        match node.follows {
            Some(_) if locked[i] => v[dof] = node.gap,
            Some(_) => {}
            None => v[dof] = v[dof].min(node.gap),
        }
    }
}

/// The active set that a point stands for: nodes on the obstacle and pressed against it.
fn pressed(system: &System<'_>, v: &[f64], force: &[f64], locked: &[bool]) -> Vec<bool> {
    let state = |(i, node): (usize, &ContactNode)| match (node.normal, node.follows) {
        (Dof::Fixed(_), _) => false,
        (_, Some(_)) => locked[i],
        (Dof::Free(dof), None) => v[dof] >= node.gap && -force[dof] >= 0.0,
    };
    system.nodes.iter().enumerate().map(state).collect()
}

/// Bertsekas' set: nodes so near to the obstacle, for the force on them, that a step would reach it.
fn binding(system: &System<'_>, v: &[f64], force: &[f64], locked: &[bool]) -> Vec<bool> {
    // nearness is measured by the natural residual: it shrinks as the solution is approached
    let mut natural: f64 = 0.0;
    for node in system.nodes.iter().filter(|node| node.follows.is_none()) {
        if let Dof::Free(dof) = node.normal {
            let step = -force[dof] / system.stiffness.at(dof, dof);
            natural = natural.max(step.min(node.gap - v[dof]).abs());
        }
    }
    let holds = |(i, node): (usize, &ContactNode)| match (node.normal, node.follows) {
        (Dof::Fixed(_), _) => true,
        (_, Some(_)) => locked[i],
        (Dof::Free(dof), None) => {
            let near = natural.min(-force[dof] / system.stiffness.at(dof, dof));
            force[dof] < 0.0 && node.gap - v[dof] <= near
        }
    };
    system.nodes.iter().enumerate().map(holds).collect()
}

/// Moves v along d: exactly to the minimum where no obstacle blocks the way, else by Armijo's rule
/// along the projected path. False when nothing more can be gained.
fn line_search(
    system: &System<'_>,
    bound: &[f64],
    v: &mut Vec<f64>,
    d: &[f64],
    force: &[f64],
    locked: &[bool],
) -> bool {
    let slope: f64 = force.iter().zip(d).map(|(g, d)| g * d).sum();
    if slope >= 0.0 {
        return false;
    }
    let blocked_at = system
        .nodes
        .iter()
        .filter(|node| node.follows.is_none())
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
        project(system, &mut trial, locked);
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

/// J along a line v + α d.
struct Along<'a> {
    slope: f64,
    curvature: f64,
    /// w τ, u_t − d, its change along d, and the law, at the friction points that matter.
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

    /// dJ/dα.
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

    /// J(1) − J(0).
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

    /// The α in (0, most] with the least J: the derivative grows, so its root is bracketed.
    fn minimum(&self, most: f64) -> f64 {
        if self.derivative(most) <= 0.0 {
            return most;
        }
        let (mut low, mut high) = (0.0, most);
        // halving to the last digit costs little: no matrix is touched
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
