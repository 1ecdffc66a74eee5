//! The iterations on the nodes that may touch.
//!
//! Often most of a contact boundary is far from the obstacle. Where no node touches and no friction acts, the unknowns
//! follow from the other unknowns by a linear system. They are eliminated once, by a partial Cholesky factorisation of
//! Ŝ. Every method then works on the remaining system, whose matrices are as large as the part of the boundary that may
//! touch. The result is checked on the whole boundary: if an eliminated node would pass the obstacle, or friction would
//! act at one, the part is enlarged and the iterations continue.

use std::sync::Arc;

use crate::algorithm::convex::minimise;
use crate::algorithm::factors::{Factors, dense};
use crate::algorithm::finished::Finished;
use crate::algorithm::fixed_point::all_sticking;
use crate::algorithm::neighbour::follow;
use crate::algorithm::recorder::{Measured, Place};
use crate::algorithm::rounding;
use crate::algorithm::system::{ContactNode, Follows, Oblique, Patch, State, System};
use crate::elasticity::Dof;
use crate::friction::{BoundLaw, FrictionLaw, Source};
use crate::linear::{Dense, Eliminated};
use crate::observer::Observer;
use crate::problem::{Algorithm, Condition, FrictionPoints, SolverControls};
use crate::solution::{Iteration, Outcome};

/// The number of unknowns below which nothing is eliminated: the whole system costs next to nothing.
const LEAST: usize = 64;

/// The largest part of the unknowns that may remain for elimination to be worth its cost.
const WORTH: f64 = 0.7;

/// Parts of the boundary that may touch are widened on each side by this part of their length.
const MARGIN: f64 = 0.1;

/// Parts of the boundary are also widened on each side by this number of nodes.
const MARGIN_NODES: usize = 4;

/// Parts of the boundary that turned out too small are widened on each side by this part of their length.
const GROWTH: f64 = 0.5;

/// The largest total size (bytes) of the eliminated parts of the boundary that are kept, for problems that need them
/// again.
const KEPT_BYTES: u64 = 16 << 20;

/// The part of the boundary that may touch. It is kept from one load level to the next.
#[derive(Default)]
pub struct Region {
    near: Option<Arc<MayTouch>>,
    extent: Extent,
    /// Factors that neighbouring problems share.
    factors: Factors,
    /// Small parts of the boundary that were eliminated before.
    made: Vec<Arc<MayTouch>>,
}

/// The extent of a [`Region`].
#[derive(Clone, Default, PartialEq)]
pub struct Extent {
    /// By contact node: whether it may touch. Empty while that is unknown.
    touches: Vec<bool>,
    /// By contact node: whether its unknowns are to remain, since it may touch or friction may act there. None until
    /// that is decided.
    wanted: Option<Vec<bool>>,
    /// Whether nothing is eliminated, since that is not worth its cost for this system.
    whole: bool,
}

/// A system reduced to the unknowns of nodes that may touch, or where friction may act; the others are eliminated.
struct MayTouch {
    /// By contact node: whether its unknowns were requested to remain.
    wanted: Vec<bool>,
    /// By contact node: whether its unknowns remain.
    kept: Vec<bool>,
    /// The order of all unknowns: first the eliminated unknowns, then the others.
    order: Vec<usize>,
    eliminated: Eliminated,
    stiffness: Arc<Dense>,
    /// The numbers of the friction points whose nodes all remain.
    points: Vec<usize>,
    /// By contact: the kind of points where friction acts; none if the contact is frictionless.
    acting: Vec<Option<FrictionPoints>>,
}

/// Like [`run`](super::run), on the part of the boundary that may touch if elimination is worth its cost. `region`:
/// that of the last load level, for the same body and the same contact boundaries.
pub fn run_reduced(
    system: &System<'_>,
    controls: &SolverControls,
    place: Place,
    before: Option<&Finished>,
    region: &mut Region,
    observer: &mut dyn Observer,
) -> Finished {
    let mut history: Vec<Iteration> = Vec::new();
    let mut last = before.cloned();
    loop {
        let place = Place {
            rows: place.rows + history.len() as u32,
            ..place
        };
        region.prepare(system, controls, last.as_ref(), observer);
        let start = last.as_ref();
        let (mut finished, outside) = match &region.near {
            None => {
                let finished = super::run(system, controls, place, start, observer);
                (finished, Vec::new())
            }
            Some(near) => {
                let (part, load) = near.part(system);
                let start = start.map(|start| near.on_part(start));
                let found = super::run(&part, controls, place, start.as_ref(), observer);
                near.on_whole(system, controls, load, found)
            }
        };
        history.append(&mut finished.history);
        let unsettled = finished.outcome == Outcome::Converged
            && finished.rounding.is_none()
            && !finished.residuals.within(controls.tolerance);
        let settled = outside.is_empty() && !unsettled || finished.outcome == Outcome::Canceled;
        if region.near.is_none() || settled {
            return Finished {
                history,
                ..finished
            };
        }
        if outside.is_empty() {
            region.take_whole()
        } else {
            region.grow(&outside)
        }
        if finished.outcome == Outcome::Converged {
            last = Some(finished);
        }
    }
}

/// The solution close to that of a neighbour, and the number of steps to it; none if there is no solution close to it.
/// The neighbour is a problem with the same body and contact boundaries and slightly different numbers. `before`: v of
/// the neighbour's own neighbour, if known; the steps then begin at the extrapolation of both.
pub fn follow_neighbour(
    system: &System<'_>,
    controls: &SolverControls,
    (neighbour, before): (&Finished, Option<&[f64]>),
    region: &mut Region,
    observer: &mut dyn Observer,
) -> Option<(Finished, u32)> {
    if controls.algorithm != Algorithm::Auto || system.semidefinite {
        return None;
    }
    region.prepare(system, controls, Some(neighbour), observer);
    let (near, factors) = (&region.near, &mut region.factors);
    let mut start = neighbour.state.clone();
    if let Some(before) = before {
        let pairs = start.v.iter_mut().zip(before);
        pairs.for_each(|(v, before)| *v += *v - before);
    }
    let Some(near) = near else {
        return follow_as_alone(system, controls, &start, factors, observer);
    };
    let (part, load) = near.part(system);
    let start = near.state_on_part(&start);
    let (found, steps) = follow_as_alone(&part, controls, &start, factors, observer)?;
    let (finished, outside) = near.on_whole(system, controls, load, found);
    let settled = outside.is_empty()
        && finished.rounding.is_none()
        && finished.residuals.within(controls.tolerance);
    settled.then_some((finished, steps))
}

/// The solution close to `start`, if steps from the problem's own frictionless state lead to the same solution; else
/// none. Beyond a fold, friction and pressure may support each other in a state that can only be reached from a
/// neighbour.
fn follow_as_alone(
    system: &System<'_>,
    controls: &SolverControls,
    start: &State,
    factors: &mut Factors,
    observer: &mut dyn Observer,
) -> Option<(Finished, u32)> {
    /// The largest relative difference of the friction bounds of one solution, far above the error that the tolerance
    /// permits.
    const AGREES: f64 = 1e-5;
    let (found, steps) = follow(system, controls, start, factors, observer)?;
    let given = |source: &Source| matches!(source, Source::Given(_));
    // a convex problem has one solution
    if system.points.iter().all(|point| given(&point.source)) {
        return Some((found, steps));
    }
    let none = vec![0.0; system.points.len()];
    let free = minimise(system, &none, &found.state, controls.tolerance, observer);
    let pressures = system.pressures(&system.reactions_of(&free.state, &free.elastic_force));
    let implied = system.friction_bound(&pressures);
    // without a pressure there is no friction: that is the solution
    let own = if implied.iter().all(|tau| *tau == 0.0) {
        implied
    } else {
        let start = all_sticking(system, &free.state);
        let own = follow(system, controls, &start, &mut Factors::default(), observer)?;
        own.0.bound
    };
    let most = own
        .iter()
        .chain(&found.bound)
        .fold(0.0f64, |a, b| a.max(*b));
    let mut pairs = own.iter().zip(&found.bound);
    let agree = pairs.all(|(a, b)| (a - b).abs() <= AGREES * most);
    agree.then_some((found, steps))
}

impl Region {
    /// The extent of the region.
    pub fn extent(&self) -> Extent {
        self.extent.clone()
    }

    /// Gives the region the extent of a neighbour's region. The last factors are used only if `with_last_factors`.
    pub fn reach(&mut self, extent: &Extent, with_last_factors: bool) {
        let same = self.extent == *extent;
        if !same {
            self.near = None;
            self.extent.clone_from(extent);
        }
        if !(same && with_last_factors) {
            self.factors.renew();
        }
    }

    /// Extends the region to the whole boundary.
    fn take_whole(&mut self) {
        self.near = None;
        self.extent = Extent {
            whole: true,
            ..Extent::default()
        };
        self.factors.renew();
    }

    /// Eliminates the unknowns of nodes that may not touch, unless that is done already or not worth its cost.
    fn prepare(
        &mut self,
        system: &System<'_>,
        controls: &SolverControls,
        last: Option<&Finished>,
        observer: &mut dyn Observer,
    ) {
        // the thesis's own iteration is kept as printed, and a body that only contact holds has no factor of its own
        let whole = controls.algorithm == Algorithm::Thesis || system.semidefinite;
        if self.extent.whole || whole || system.load.len() < LEAST {
            self.near = None;
            return;
        }
        let acting = acting(system);
        if self.near.as_ref().is_some_and(|near| near.acting == acting) {
            return;
        }
        self.near = None;
        if self.extent.touches.is_empty() {
            self.extent.touches = may_touch(system, last);
        }
        if !self.extent.touches.contains(&true) {
            // contact that loads bring about is known after the first level
            self.extent.touches.clear();
            return;
        }
        let Extent {
            touches, wanted, ..
        } = &mut self.extent;
        let wanted = wanted.get_or_insert_with(|| rubbed(system, touches));
        self.factors.renew();
        let serves = |near: &&Arc<MayTouch>| near.wanted == *wanted && near.acting == acting;
        self.near = self.made.iter().find(serves).cloned();
        if self.near.is_some() {
            return;
        }
        match MayTouch::new(system, wanted.clone(), observer) {
            Some(near) => {
                let near = Arc::new(near);
                let bytes = near.bytes() + self.made.iter().map(|near| near.bytes()).sum::<u64>();
                if bytes <= KEPT_BYTES {
                    self.made.push(near.clone());
                }
                self.near = Some(near);
            }
            None => self.take_whole(),
        }
    }

    /// Enlarges the part of the boundary by the nodes `outside` and a margin. Unknowns must then be eliminated anew.
    fn grow(&mut self, outside: &[usize]) {
        let touches = &mut self.extent.touches;
        for &node in outside {
            touches[node] = true;
        }
        if let Some(near) = self.near.take() {
            for (touches, kept) in touches.iter_mut().zip(&near.kept) {
                *touches |= kept;
            }
        }
        *touches = widened(touches, GROWTH);
        self.extent.wanted = None;
        self.factors.renew();
    }
}

/// By contact node, whether it may touch: where the obstacle overlaps the body before it deforms, and where nodes
/// touched at the last level, with a margin. All nodes of a contact may touch if it has no obstacle, or a friction
/// bound that does not depend on its pressure.
fn may_touch(system: &System<'_>, last: Option<&Finished>) -> Vec<bool> {
    let steps = system.model.steps.iter().map(|step| step.indentation);
    let [pushed, ..] = system.level.motions;
    let mut deepest = system.level;
    deepest.motions[0] = steps.fold(pushed, f64::max);
    let mut touches = Vec::with_capacity(system.nodes.len());
    for patch in &system.patches {
        let by_pressure = |law: &FrictionLaw| matches!(law.bound, BoundLaw::Pressure { .. });
        let known = patch.contact.condition == Condition::Unilateral
            && patch.law.as_ref().is_none_or(by_pressure);
        let of_patch: Vec<bool> = system
            .range(patch)
            .enumerate()
            .map(|(i, node)| {
                !known
                    || patch.contact.gap(i, &deepest) < 0.0
                    || last.is_some_and(|last| last.state.active[node])
            })
            .collect();
        touches.extend(widened(&of_patch, MARGIN));
    }
    touches
}

/// Widens each run of marked nodes on both sides by a part of its length and by [`MARGIN_NODES`] nodes.
fn widened(nodes: &[bool], part: f64) -> Vec<bool> {
    let mut wide = nodes.to_vec();
    let mut end = 0;
    for run in nodes.chunk_by(|a, b| a == b) {
        let start = end;
        end += run.len();
        if run[0] {
            let margin = MARGIN_NODES + (part * run.len() as f64) as usize;
            let last = nodes.len().min(end + margin);
            wide[start.saturating_sub(margin)..last].fill(true);
        }
    }
    wide
}

/// By contact node, whether its unknowns must remain if the nodes in `touches` may touch: these nodes, nodes where
/// friction may act, and nodes that share unknowns with one of them.
fn rubbed(system: &System<'_>, touches: &[bool]) -> Vec<bool> {
    let mut kept = touches.to_vec();
    for point in &system.points {
        let rubs = match &point.source {
            Source::Given(_) => true,
            Source::Average(row) => {
                let under = touches[row.first..].iter().zip(&row.weights);
                under.into_iter().any(|(touches, w)| *touches && *w != 0.0)
            }
        };
        if rubs {
            point.nodes.iter().for_each(|&node| kept[node] = true);
        }
    }
    for (i, node) in system.nodes.iter().enumerate() {
        if let Some(end) = node.beside_axis {
            let any = kept[i] || kept[end];
            (kept[i], kept[end]) = (any, any);
        }
    }
    kept
}

impl MayTouch {
    /// Eliminates the unknowns of all nodes that are not in `kept`. None if that is not worth its cost, or the observer
    /// stops.
    fn new(system: &System<'_>, kept: Vec<bool>, observer: &mut dyn Observer) -> Option<Self> {
        let size = system.load.len();
        let mut keeps = vec![false; size];
        for (node, _) in system.nodes.iter().zip(&kept).filter(|(_, kept)| **kept) {
            for dof in unknowns(node) {
                keeps[dof] = true;
            }
        }
        let wanted = kept.clone();
        let (mut order, rest): (Vec<usize>, Vec<usize>) = (0..size).partition(|&i| !keeps[i]);
        if rest.len() as f64 > WORTH * size as f64 {
            return None;
        }
        let count = order.len();
        order.extend(rest);
        let entry = |i: usize, j: usize| system.stiffness.at(order[i], order[j]);
        let (eliminated, stiffness) = dense(size, observer, |interrupt| {
            Eliminated::new(size, count, entry, interrupt)
        })?;
        // a node of two contacts is kept with either of them
        let has_all = |node| unknowns(node).all(|dof| keeps[dof]);
        let kept: Vec<bool> = system.nodes.iter().map(has_all).collect();
        let on_kept = |&g: &usize| system.points[g].nodes.iter().all(|&node| kept[node]);
        Some(MayTouch {
            points: (0..system.points.len()).filter(on_kept).collect(),
            acting: acting(system),
            wanted,
            kept,
            order,
            eliminated,
            stiffness: Arc::new(stiffness),
        })
    }

    /// The memory that the reduced system takes (bytes).
    fn bytes(&self) -> u64 {
        let (all, kept) = (self.order.len() as u64, self.stiffness.size() as u64);
        8 * (all * (all - kept) + kept * kept)
    }

    /// The number of eliminated unknowns.
    fn count(&self) -> usize {
        self.order.len() - self.stiffness.size()
    }

    /// The reduced system; and f̂ of all unknowns, reduced and in the order of [`MayTouch::order`], for
    /// [`MayTouch::on_whole`].
    fn part<'a>(&'a self, system: &System<'a>) -> (System<'a>, Vec<f64>) {
        let mut load: Vec<f64> = self.order.iter().map(|&dof| system.load[dof]).collect();
        self.eliminated.reduce(&mut load);
        let count = self.count();
        let mut number = vec![None; self.order.len()];
        for (i, &dof) in self.order[count..].iter().enumerate() {
            number[dof] = Some(i);
        }
        // other nodes neither touch nor rub: their displacements do not matter
        let renumbered = |dof: Dof| match dof {
            Dof::Free(dof) => number[dof].map_or(Dof::Fixed(0.0), Dof::Free),
            fixed => fixed,
        };
        let node = |(node, kept): (&ContactNode, &bool)| ContactNode {
            normal: renumbered(node.normal),
            tangent: renumbered(node.tangent),
            oblique: node.oblique.map(|oblique| Oblique {
                other: renumbered(oblique.other),
                ..oblique
            }),
            follows: node.follows.map(|follows| Follows {
                dofs: follows.dofs.map(renumbered),
                ..follows
            }),
            gap: if *kept { node.gap } else { f64::INFINITY },
            ..*node
        };
        let part = System {
            stiffness: self.stiffness.clone(),
            opposite: None,
            opposite_at_rest: Vec::new(),
            load: load[count..].to_vec(),
            nodes: system.nodes.iter().zip(&self.kept).map(node).collect(),
            points: self
                .points
                .iter()
                .map(|&g| system.points[g].clone())
                .collect(),
            patches: system.patches.clone(),
            touched: system.touched.clone(),
            ..*system
        };
        (part, load)
    }

    /// Restricts a state of the whole system to the reduced system.
    fn state_on_part(&self, whole: &State) -> State {
        let kept = self.order[self.count()..].iter();
        State {
            v: kept.map(|&dof| whole.v[dof]).collect(),
            active: whole.active.clone(),
        }
    }

    /// Restricts the result of iterations on the whole system to a start on the reduced system.
    fn on_part(&self, whole: &Finished) -> Finished {
        Finished {
            state: self.state_on_part(&whole.state),
            // nothing begins from forces
            elastic_force: Vec::new(),
            bound: self.points.iter().map(|&g| whole.bound[g]).collect(),
            ..whole.clone()
        }
    }

    /// Extends the result on the reduced system to the whole system and measures it there. Also returns the eliminated
    /// nodes that would pass the obstacle, or at which friction would act.
    fn on_whole(
        &self,
        system: &System<'_>,
        controls: &SolverControls,
        load: Vec<f64>,
        found: Finished,
    ) -> (Finished, Vec<usize>) {
        let mut x = load;
        x[self.count()..].copy_from_slice(&found.state.v);
        self.eliminated.expand(&mut x);
        let mut v = vec![0.0; x.len()];
        for (&dof, x) in self.order.iter().zip(x) {
            v[dof] = x;
        }
        let state = State {
            v,
            active: found.state.active.clone(),
        };
        let on_all = |of_part: &[f64]| {
            let mut all = vec![0.0; system.points.len()];
            let values = self.points.iter().zip(of_part);
            values.for_each(|(&g, value)| all[g] = *value);
            all
        };
        let measured = Measured::new(system, state, on_all(&found.bound));
        let limit = match found.outcome {
            Outcome::Converged | Outcome::NotConverged => {
                rounding::limit(system, &measured, controls.tolerance)
            }
            _ => None,
        };
        let (outcome, rounding) = match limit {
            Some((rounding, _)) if rounding.negligible() => (Outcome::Converged, Some(rounding)),
            Some((rounding, _)) => (Outcome::NotConverged, Some(rounding)),
            None => (found.outcome, None),
        };
        // eliminated nodes that would pass the obstacle, or that friction would act on
        let passes =
            |&node: &usize| !self.kept[node] && system.opening(&measured.state.v, node) < 0.0;
        let mut outside: Vec<usize> = (0..system.nodes.len()).filter(passes).collect();
        let points = system.points.iter().zip(&measured.implied_bound);
        for (point, _) in points.filter(|(_, tau)| **tau > 0.0) {
            outside.extend(point.nodes.iter().filter(|&&node| !self.kept[node]));
        }
        let finished = Finished {
            tractions: on_all(&found.tractions),
            state: measured.state,
            elastic_force: measured.elastic_force,
            bound: measured.bound,
            residuals: measured.residuals,
            outcome,
            rounding,
            ..found
        };
        (finished, outside)
    }
}

/// By contact, the kind of points where friction acts; none if the contact is frictionless.
fn acting(system: &System<'_>) -> Vec<Option<FrictionPoints>> {
    let points = |patch: &Patch<'_>| patch.law.as_ref().map(|law| law.points);
    system.patches.iter().map(points).collect()
}

/// The unknowns of a contact node.
fn unknowns(node: &ContactNode) -> impl Iterator<Item = usize> + use<> {
    let other = node.oblique.map(|oblique| oblique.other);
    [Some(node.normal), Some(node.tangent), other]
        .into_iter()
        .flatten()
        .filter_map(|dof| match dof {
            Dof::Free(dof) => Some(dof),
            Dof::Fixed(_) => None,
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_widened_on_both_sides() {
        let mut nodes = vec![false; 60];
        nodes[20..30].fill(true);
        let wide = widened(&nodes, 0.5);
        let first = wide.iter().position(|w| *w);
        let count = wide.iter().filter(|w| **w).count();
        assert_eq!((first, count), (Some(20 - 9), 10 + 2 * 9));
        nodes[0] = true;
        assert_eq!(widened(&nodes, 0.0).iter().filter(|w| **w).count(), 5 + 18);
        assert!(!widened(&[false; 3], 0.5).contains(&true));
    }
}
