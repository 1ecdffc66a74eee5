//! Bodies that slide away: only friction holds them against some motion, and the loads push them along it by more than
//! friction can resist. They have no equilibrium, so iterations would diverge.

use crate::algorithm::opposite::FreeMotion;
use crate::algorithm::recorder::Measured;
use crate::algorithm::system::{Patch, Point, State, System};
use crate::elasticity::Dof;
use crate::error::rounded;
use crate::friction::{BoundLaw, Source};
use crate::model::{ContactModel, Hold, RigidMotion};
use crate::problem::Condition;

/// The largest relative differences of push and friction that count as equal: because of rounding, and because of the
/// error of the iterations.
const EQUAL: [f64; 2] = [1e-9, 1e-6];

/// The largest deviation from parallel or perpendicular of directions that count as such.
const ALIGNED: f64 = 1e-9;

/// How far a body that slides away is moved, in elastic slips: all of its friction then acts, also with `tanh`.
const MOVED: f64 = 20.0;

/// A body, or an obstacle under loads, that slides away.
#[derive(Clone, Debug)]
pub struct Slide {
    motion: RigidMotion,
    /// The boundary of the obstacle that slides away; none if the body does.
    obstacle: Option<String>,
    /// The power of the loads along the motion, with its sign (with 2π).
    push: f64,
    /// The power of the largest friction along the motion (with 2π).
    hold: f64,
    /// Whether `hold` is the largest friction that equilibrium permits, and not the friction at the computed pressure.
    certain: bool,
}

impl Slide {
    /// The message for users: the cause, both forces or moments, and what to do.
    pub(super) fn message(&self) -> String {
        let (kind, arm) = match self.motion.arm {
            None => ("a force of", 1.0),
            Some(arm) => ("a moment of", arm),
        };
        let [push, hold] = [self.push.abs(), self.hold].map(|f| rounded(arm * f));
        let verb = match self.motion.arm {
            None => "push",
            Some(_) => "turn",
        };
        let words = &self.motion.words;
        let (subject, remedy) = match &self.obstacle {
            None => (
                "the body".to_owned(),
                format!("Support the body against this motion, or {verb} it less."),
            ),
            Some(name) => (
                format!("the obstacle of contact `{name}`"),
                "Give a `tangential_displacement` in place of the force, a smaller force, or a spring by `stiffness`.".to_owned(),
            ),
        };
        let most = if self.certain {
            format!("at most {hold:?}: there is no equilibrium")
        } else {
            format!(
                "at most {hold:?} at the computed pressure; without more pressure there is no equilibrium"
            )
        };
        format!(
            "The loads {verb} {subject} with {kind} {push:?} {words}. Only friction resists this motion, and it can resist {most}. {remedy}"
        )
    }
}

/// The motion by which the body slides away, if that follows from equilibrium alone, whatever the pressure.
pub(super) fn certain(system: &System<'_>) -> Option<Slide> {
    let motions = motions(system, |_| true).into_iter();
    let slide = |motion: RigidMotion| {
        let moved = Moved::new(system, &motion);
        let push = moved.push(system);
        let [hold, most] = moved.most(system)?.map(|f| system.circumference * f);
        let slides = push.abs() > most * (1.0 + EQUAL[0]);
        slides.then_some(Slide {
            motion,
            obstacle: None,
            push,
            hold,
            certain: true,
        })
    };
    motions.filter_map(slide).next()
}

/// The motion by which the body slides away in a state at the end of iterations, by the contacts and pressure of the
/// state.
pub(super) fn found(system: &System<'_>, state: &State) -> Option<Slide> {
    let active = &state.active;
    let reactions = system.reactions(state);
    let bound = system.friction_bound(&system.pressures(&reactions));
    let motions = motions(system, |node| active[node]).into_iter();
    let slide = |motion: RigidMotion| {
        let moved = Moved::new(system, &motion);
        let (push, hold) = (moved.push(system), moved.hold(system, &bound));
        let slides = push.abs() > hold * (1.0 + EQUAL[1]) && !moved.stopped(system, active, push);
        slides.then_some(Slide {
            motion,
            obstacle: None,
            push,
            hold,
            certain: false,
        })
    };
    let of_body = motions.filter_map(slide).next();
    of_body.or_else(|| obstacle_found(system, &bound))
}

/// The obstacle that a tangential force slides along a straight contact against all friction, with these bounds.
fn obstacle_found(system: &System<'_>, bound: &[f64]) -> Option<Slide> {
    let opposite = system.opposite.as_ref()?;
    let along = opposite.motions.iter().filter(|free| free.motion == 1);
    let slide = |free: &FreeMotion| {
        let patch = &system.patches[free.patch];
        let tool = patch.contact.tool.as_ref()?;
        let straight = system.range(patch).len();
        let straight = (0..straight).all(|i| tool.row(i, 1)[0].abs() <= ALIGNED);
        let push = system.circumference * opposite.load(system.model, &system.level, free);
        let points = system.points.iter().zip(bound);
        let own = points.filter(|(point, _)| point.patch == free.patch);
        let hold = system.circumference * own.map(|(point, tau)| point.weight * tau).sum::<f64>();
        let slides = straight
            && tool.stiffness[1] == 0.0
            && patch.contact.condition == Condition::Unilateral
            && push.abs() > hold * (1.0 + EQUAL[1]);
        slides.then(|| Slide {
            motion: RigidMotion {
                words: "along the contact".to_owned(),
                moves: Vec::new(),
                arm: None,
            },
            obstacle: Some(patch.contact.name.clone()),
            push,
            hold,
            certain: false,
        })
    };
    along.filter_map(slide).next()
}

/// The bonded state moved along a slide until all friction acts against it.
pub(super) fn slid(system: &System<'_>, bonded: Measured, slide: &Slide) -> Measured {
    let moved = Moved::new(system, &slide.motion);
    let laws = system.patches.iter().filter_map(|patch| patch.law.as_ref());
    let slip = laws.map(|law| law.elastic_slip).fold(0.0, f64::max);
    let anchors = system.points.iter().map(|point| point.anchor.abs());
    let far = (MOVED * slip + anchors.fold(0.0, f64::max)) * slide.push.signum();
    let mut state = bonded.state;
    for patch in &system.patches {
        for (i, node) in system.range(patch).enumerate() {
            if let Dof::Free(dof) = system.nodes[node].tangent {
                state.v[dof] += far * moved.along_tangent(patch, i);
            }
        }
    }
    Measured::new(system, state, bonded.implied_bound)
}

/// The rigid motions that only friction prevents, if the nodes in `touches` are in contact.
fn motions(system: &System<'_>, touches: impl Fn(usize) -> bool) -> Vec<RigidMotion> {
    let mut hindered = Vec::new();
    for patch in &system.patches {
        for (i, node) in system.range(patch).enumerate() {
            if patch.contact.condition != Condition::None && touches(node) {
                hindered.push(Hold::along_normal(patch.contact, i));
            }
            if system.nodes[node].held_tangent.is_some() {
                hindered.push(Hold::along_tangent(patch.contact, i));
            }
        }
    }
    system.model.free_motions(&hindered)
}

/// The displacement of every node by a rigid motion; `None` for nodes of parts that do not move.
struct Moved(Vec<Option<[f64; 2]>>);

impl Moved {
    fn new(system: &System<'_>, motion: &RigidMotion) -> Self {
        let mut moved = vec![None; system.model.mesh.nodes.len()];
        for (node, by) in &motion.moves {
            moved[*node as usize] = Some(*by);
        }
        Moved(moved)
    }

    /// The displacement of a contact node relative to what it faces; none if both are at rest.
    fn at_node(&self, contact: &ContactModel, i: usize) -> Option<[f64; 2]> {
        let of = |node: u32| self.0[node as usize];
        let own = of(contact.boundary.nodes[i]);
        let facing = contact.pair.as_ref().and_then(|pair| of(pair.nearest(i)?));
        match (own, facing) {
            (own, None) => own,
            (own, Some([x, y])) => {
                let [a, b] = own.unwrap_or_default();
                Some([a - x, b - y])
            }
        }
    }

    /// The power of the loads along the motion, with 2π.
    fn push(&self, system: &System<'_>) -> f64 {
        system.circumference * self.load(system, |moved| moved)
    }

    /// The sum over moved nodes of the load times a direction. `along`: the direction, from the displacement of a node.
    fn load(&self, system: &System<'_>, along: impl Fn([f64; 2]) -> [f64; 2]) -> f64 {
        let loads = system.body.nodal_loads.iter().zip(&self.0);
        let power = loads.filter_map(|(f, moved)| Some(dot(*f, along((*moved)?))));
        system.level.loads * power.sum::<f64>()
    }

    fn along_tangent(&self, patch: &Patch<'_>, i: usize) -> f64 {
        let moved = self.at_node(patch.contact, i).unwrap_or_default();
        dot(patch.contact.boundary.tangent(i), moved)
    }

    /// How far the motion moves a friction point along its tangent.
    fn at(&self, system: &System<'_>, point: &Point) -> f64 {
        let patch = &system.patches[point.patch];
        let along = |k: usize| self.along_tangent(patch, point.nodes[k] - patch.first);
        (0..3).map(|k| point.shape[k] * along(k)).sum()
    }

    /// The largest power of friction along the motion with these bounds, with 2π.
    fn hold(&self, system: &System<'_>, bound: &[f64]) -> f64 {
        let points = system.points.iter().zip(bound);
        let power = points.map(|(point, tau)| point.weight * tau * self.at(system, point).abs());
        system.circumference * power.sum::<f64>()
    }

    /// Whether an obstacle that does not touch yet would stop the motion. `push`: its sign is the direction.
    fn stopped(&self, system: &System<'_>, active: &[bool], push: f64) -> bool {
        system.patches.iter().any(|patch| {
            let boundary = &patch.contact.boundary;
            let in_the_way = |i: usize| {
                let moved = self.at_node(patch.contact, i).unwrap_or_default();
                let error = boundary.normal_errors[i] * moved[0].hypot(moved[1]);
                !active[patch.first + i]
                    && push.signum() * dot(boundary.normals[i], moved) > ALIGNED + error
            };
            patch.contact.condition != Condition::None && (0..boundary.nodes.len()).any(in_the_way)
        })
    }

    /// The largest power of friction along the motion (without 2π), if it is known before solving: with prescribed
    /// bounds or caps, or if the sum of all pressures follows from equilibrium. The first value is for averaged
    /// pressures that are nowhere negative, the second for any averaged pressures: parabolas between nodes may be
    /// negative where contact ends.
    fn most(&self, system: &System<'_>) -> Option<[f64; 2]> {
        let (mut given, mut capped, mut cohesive) = (0.0, 0.0, 0.0);
        let mut coefficients = [0.0f64; 2];
        for (p, patch) in system.patches.iter().enumerate() {
            let Some(law) = &patch.law else { continue };
            let own = || system.points.iter().filter(|point| point.patch == p);
            let length: f64 = own().map(|g| g.weight * self.at(system, g).abs()).sum();
            match &law.bound {
                _ if length == 0.0 => {}
                BoundLaw::Prescribed(_) => {
                    given += own().map(|g| self.prescribed(system, g)).sum::<f64>();
                }
                BoundLaw::Pressure {
                    coefficient,
                    cohesion,
                    shear_cap,
                    ..
                } => {
                    capped += shear_cap * length;
                    cohesive += cohesion * length;
                    for (most, gain) in coefficients.iter_mut().zip(self.gain(system, p)) {
                        *most = most.max(coefficient * gain);
                    }
                }
            }
        }
        let pressed = if coefficients[1] > 0.0 {
            self.pressed(system).unwrap_or(f64::INFINITY)
        } else {
            0.0
        };
        let most = coefficients.map(|mu| given + capped.min(cohesive + mu * pressed));
        most[1].is_finite().then_some(most)
    }

    fn prescribed(&self, system: &System<'_>, point: &Point) -> f64 {
        match point.source {
            Source::Given(tau) => point.weight * tau * self.at(system, point).abs(),
            Source::Average(_) => 0.0,
        }
    }

    /// The largest power along the motion, per friction coefficient, that a unit reaction gives friction by the
    /// averaged pressure: 1 inside a contact, for unit motion. The second value, somewhat larger, leaves negative parts
    /// of the pressure out.
    fn gain(&self, system: &System<'_>, p: usize) -> [f64; 2] {
        let mut sums = vec![[0.0; 2]; system.nodes.len()];
        for point in system.points.iter().filter(|point| point.patch == p) {
            if let Source::Average(row) = &point.source {
                let moved = point.weight * self.at(system, point).abs();
                for (i, weight) in row.weights.iter().enumerate() {
                    for (node, moved) in system.pressure_weights(row.first + i, moved * weight) {
                        let [all, positive] = &mut sums[node];
                        *all += moved;
                        *positive += moved.max(0.0);
                    }
                }
            }
        }
        let gains = system.range(&system.patches[p]).map(|i| sums[i]);
        gains.fold([0.0; 2], |[a, b], [c, d]| [a.max(c), b.max(d)])
    }

    /// The sum of all reactions on the body that moves, if it follows from equilibrium: all contacts have the same
    /// normal, and nothing else holds the body.
    fn pressed(&self, system: &System<'_>) -> Option<f64> {
        let mut bonded = Vec::new();
        let mut normal: Option<[f64; 2]> = None;
        let mut inside = None;
        for patch in &system.patches {
            let boundary = &patch.contact.boundary;
            for i in 0..boundary.nodes.len() {
                if system.nodes[patch.first + i].bonded {
                    bonded.extend([
                        Hold::along_normal(patch.contact, i),
                        Hold::along_tangent(patch.contact, i),
                    ]);
                }
                let moves = self.at_node(patch.contact, i).is_some();
                if !moves || patch.contact.condition == Condition::None {
                    continue;
                }
                // where the other body alone moves, the pressures do not follow from the loads on this one
                let own = boundary.nodes[i];
                if patch.contact.pair.is_some() && self.0[own as usize].is_none() {
                    return None;
                }
                inside = Some(own);
                let n = boundary.normals[i];
                let first = *normal.get_or_insert(n);
                if (first[0] - n[0]).hypot(first[1] - n[1]) > ALIGNED {
                    return None;
                }
            }
        }
        let (normal, inside) = (normal?, inside?);
        let free = system.model.free_motions(&bonded);
        let own = |motion: &&RigidMotion| motion.moves.iter().any(|(node, _)| *node == inside);
        if free.iter().filter(own).count() < 3 {
            return None;
        }
        Some(self.load(system, |_| normal)).filter(|pressed| *pressed > 0.0)
    }
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}
