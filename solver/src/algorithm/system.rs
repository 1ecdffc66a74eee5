//! The problem reduced to Γ_C at one load level: contact nodes, friction points, and the forces between them.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::sync::Arc;

use crate::algorithm::opposite::{self, Opposite};
use crate::body::ElasticBody;
use crate::contact::AXIS_SHARE;
use crate::elasticity::Dof;
use crate::error::SolveError;
use crate::friction::{Average, Averaging, Chain, FrictionLaw, Source, largest_pressure};
use crate::linear::Dense;
use crate::model::{ContactModel, Level, Model};
use crate::observer::{Observer, go_on};
use crate::problem::{Condition, FrictionPoints};
use crate::solution::ObstacleMotion;

/// The part of the largest bound below which a friction point counts as open: its anchor then follows it.
const OPEN: f64 = 1e-12;

/// The part of the forces that displace a contact below which reactions are rounding: of these forces, and of normals by
/// coordinates a hundred times as large as the body. Of reactions that small no two digits would be known.
const ROUNDED: f64 = 1e-11;

/// The part of a contact's length within which nodes are equally near to an obstacle.
const NEAREST: f64 = 1e-9;

/// The data of the iterations; nodes and points of all contacts are in a row.
pub struct System<'a> {
    /// The condensed stiffness Ŝ; with unknown motions of obstacles that on displacements relative to them, S_w.
    pub stiffness: Arc<Dense>,
    /// The condensed load f̂ at this load level; with unknown motions of obstacles, or other bodies, f_w.
    pub load: Vec<f64>,
    /// What lies opposite the contacts and moves by unknowns: obstacles under loads, other bodies; none if all motions are given.
    pub opposite: Option<Arc<Opposite>>,
    /// What its unknowns at this load level follow from, beside the relative displacements (`Opposite::reduced`).
    pub opposite_at_rest: Vec<f64>,
    /// The contact nodes of all contacts.
    pub nodes: Vec<ContactNode>,
    /// Points where friction acts; none in a frictionless contact.
    pub points: Vec<Point>,
    /// The contacts of the model.
    pub patches: Vec<Patch<'a>>,
    /// The factor between a sum of nodal forces and a total force: 2π in axisymmetry, else 1.
    pub circumference: f64,
    /// The load level of `load`, and of gaps and drags of the nodes.
    pub level: Level,
    /// Whether the stiffness has rigid motions, of the body or of obstacles, that only contact can prevent.
    pub semidefinite: bool,
    /// The work that sliding has dissipated in the increments so far, under the incremental law (force × length,
    /// without 2π).
    pub dissipated: f64,
    /// The contacts, by their number in `patches`, that touched at the end of an earlier increment.
    pub touched: BTreeSet<usize>,
    /// A typical nodal force of this problem, for levels at which nothing acts: the force of the full loads, or the
    /// force on a contact node that is pushed by the indentation or the drag.
    pub reference_force: f64,
    /// The number of threads that may compute the fields of the whole body; 1 until more are free.
    pub threads: usize,
    /// The body, condensed to Γ_C.
    pub body: &'a ElasticBody,
    /// The whole problem.
    pub model: &'a Model,
}

/// One contact node: two unknowns, and a bound on the first of them.
///
/// A constraint is a bound on one unknown, and not a row of coefficients on several, also where two bodies meet: the unknown
/// is the displacement relative to the other body (docs/theory.md, "Where a second body enters").
#[derive(Clone, Copy, Debug)]
pub struct ContactNode {
    /// The unknown u_n; at a node beside the axis the part of u_n that [`AXIS_SHARE`] leaves.
    pub normal: Dof,
    /// The unknown u_t, if it is one of the components; at a node with oblique axes it counts as held, and `oblique`
    /// gives u_t.
    pub tangent: Dof,
    /// The axes of the node, if they are oblique.
    pub oblique: Option<Oblique>,
    /// Present if the node belongs to another contact alone: then `normal` and `tangent` are no unknowns.
    pub follows: Option<Follows>,
    /// The bound on `normal`, `normal` ≤ gap; infinite where there is no obstacle.
    pub gap: f64,
    /// Whether u_n = gap is prescribed, whatever the reaction.
    pub bonded: bool,
    /// The obstacle's own displacement d along t at this level.
    pub drag: f64,
    /// The prescribed u_t, if the node is held along t.
    pub held_tangent: Option<f64>,
    /// The area that belongs to the reaction of `normal`: ∫ h_i, and on the axis ∫ h₀ + h₁/8.
    pub weight: f64,
    /// Whether the node is on the axis of a body of revolution.
    pub on_axis: bool,
    /// For a midside node beside the axis: the node on the axis.
    pub beside_axis: Option<usize>,
}

impl ContactNode {
    /// The sum of the nodal forces of a unit reaction of `normal`.
    pub fn force(&self) -> f64 {
        match self.beside_axis {
            Some(_) => 1.0 - AXIS_SHARE,
            None => 1.0,
        }
    }

    /// Whether the node is on a line of symmetry, where u_t is held at 0.
    pub fn symmetric(&self) -> bool {
        match self.oblique {
            None => matches!(self.tangent, Dof::Fixed(value) if value == 0.0),
            Some(oblique) => oblique.symmetric,
        }
    }
}

/// The axes of a node whose displacement is measured along its normal and another direction that is not perpendicular
/// to the normal: the normal of another contact, or the direction of a support. No friction acts on such a node: slip
/// is continued to it from the other two nodes of its edge, and friction forces are passed on to these nodes
/// (formulation 3.3).
#[derive(Clone, Copy, Debug)]
pub struct Oblique {
    /// The displacement along the other direction.
    pub other: Dof,
    /// The coefficients of u_n and `other` in u_t.
    pub(super) part: [f64; 2],
    /// Whether a line of symmetry passes through the node.
    pub symmetric: bool,
    /// Whether another contact begins where this one ends.
    pub shared: bool,
}

impl Oblique {
    /// The axes of a node that follows another contact: slip is continued to it, as to a common end that touches both.
    const OF_FOLLOWING: Self = Oblique {
        other: Dof::Fixed(0.0),
        part: [0.0; 2],
        symmetric: false,
        shared: true,
    };
}

/// A point of the load path, with what increments have accumulated up to there.
pub struct Path {
    /// The anchor g of every friction point.
    anchors: Vec<f64>,
    dissipated: f64,
    touched: BTreeSet<usize>,
    level: Level,
}

/// How a common end of two contacts that belongs to the other contact alone follows that contact: gives u_n and u_t.
#[derive(Clone, Copy, Debug)]
pub struct Follows {
    /// The displacements along the normal and the tangent of the other contact.
    pub dofs: [Dof; 2],
    /// The coefficients of these displacements in u_n.
    pub(super) normal: [f64; 2],
    /// The coefficients of these displacements in u_t.
    pub(super) tangent: [f64; 2],
}

impl Follows {
    fn along([a, b]: [f64; 2], dofs: [Dof; 2], v: &[f64]) -> f64 {
        a * value(dofs[0], v) + b * value(dofs[1], v)
    }
}

/// A point at which friction acts.
#[derive(Clone, Debug)]
pub struct Point {
    /// The contact of this point, by its place in the system.
    pub patch: usize,
    /// The arc length of the point.
    pub s: f64,
    /// The three nodes of the edge that the point is on.
    pub nodes: [usize; 3],
    /// The shape functions of these nodes at the point.
    pub shape: [f64; 3],
    /// The weight w_g of the point in integrals.
    pub weight: f64,
    /// The source of the friction bound: a given value, or the averaging row over the pressures of all nodes.
    pub source: Source,
    /// The anchor g, from which slip is measured; 0 under the total law.
    pub anchor: f64,
}

/// Averaging operators of contacts, with the rows that are computed already. Problems that differ in other numbers than
/// the radius share the operators.
#[derive(Default)]
pub struct Averages(Vec<(usize, Average, Averaging)>);

impl Averages {
    /// The largest number of operators that are kept, each with its rows.
    const MOST: usize = 16;

    /// The friction law of a contact with the operator that averages along its chain of edges.
    fn law(&mut self, patch: usize, law: &FrictionLaw<Average>, chain: Chain) -> FrictionLaw {
        law.along(|average| {
            // radii in turn come back after all others
            let known = self.0.iter().find(|(p, a, _)| (*p, a) == (patch, average));
            if let Some((_, _, averaging)) = known {
                return averaging.clone();
            }
            let averaging = Averaging::new(average, chain);
            if self.0.len() == Self::MOST {
                self.0.remove(0);
            }
            self.0.push((patch, *average, averaging.clone()));
            averaging
        })
    }
}

/// A contact of the model, in the system.
#[derive(Clone)]
pub struct Patch<'a> {
    /// The contact in the model.
    pub contact: &'a ContactModel,
    /// The number of the contact's first node.
    pub first: usize,
    /// The friction law; none if the contact is frictionless.
    pub law: Option<FrictionLaw>,
}

/// A state of the system: displacements and the contact set.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// The values of the contact unknowns.
    pub v: Vec<f64>,
    /// Whether each node is in contact.
    pub active: Vec<bool>,
}

impl<'a> System<'a> {
    /// Collects the contacts of a model on its condensed body, at full load. The observer is called at every friction
    /// point: a wide average along a long contact takes minutes.
    pub fn new(
        model: &'a Model,
        body: &'a ElasticBody,
        observer: &mut dyn Observer,
    ) -> Result<Self, SolveError> {
        System::with_averages(model, body, &mut Averages::default(), observer)
    }

    /// Like [`System::new`], using the averages of earlier systems on this body and adding the averages of this system.
    pub fn with_averages(
        model: &'a Model,
        body: &'a ElasticBody,
        averages: &mut Averages,
        observer: &mut dyn Observer,
    ) -> Result<Self, SolveError> {
        let opposite = Opposite::new(model, body, observer)?.map(Arc::new);
        let stiffness = match &opposite {
            None => body.stiffness.clone(),
            Some(opposite) => opposite.stiffness.clone(),
        };
        let mut system = System {
            stiffness,
            load: Vec::new(),
            opposite_at_rest: Vec::new(),
            semidefinite: model.held_by_contact || opposite::free_motions(model).next().is_some(),
            opposite,
            nodes: Vec::new(),
            points: Vec::new(),
            patches: Vec::new(),
            circumference: model.section.circumference(),
            level: Level::FULL,
            dissipated: 0.0,
            touched: BTreeSet::new(),
            reference_force: 0.0,
            threads: 1,
            body,
            model,
        };
        for contact in &model.contacts {
            system.add(contact, averages, observer)?;
        }
        system.set_level(Level::FULL);
        let pushed = model.contacts.iter().flat_map(|contact| {
            let pushed = [contact.indentation, contact.tangential_displacement];
            pushed.into_iter().chain(contact.overlap())
        });
        let pushed = pushed.fold(0.0f64, |most, length| most.max(length.abs()));
        let loads = largest_size(&system.load);
        system.reference_force = (system.stiffest() * pushed).max(loads);
        Ok(system)
    }

    /// The force that a unit displacement of the stiffest contact unknown needs (force / length).
    fn stiffest(&self) -> f64 {
        let diagonal = (0..self.load.len()).map(|i| self.stiffness.at(i, i).abs());
        diagonal.fold(0.0, f64::max)
    }

    /// A nodal force like [`System::reference_force`] by the motion of the obstacle that loads move.
    pub fn force_by_motion(&self, v: &[f64]) -> f64 {
        let motion = self.motion_by_loads(v);
        let moved = motion.map_or(0.0, |motion| {
            let across = motion.tangential_displacement.abs();
            motion.indentation.abs().max(across)
        });
        self.stiffest() * moved
    }

    fn add(
        &mut self,
        contact: &'a ContactModel,
        averages: &mut Averages,
        observer: &mut dyn Observer,
    ) -> Result<(), SolveError> {
        let (first, boundary) = (self.nodes.len(), &contact.boundary);
        let axis = &self.model.axis;
        self.add_nodes(contact);
        let on_axis = |i: usize| axis.holds(boundary.positions[i]);
        let symmetric = |i: usize| on_axis(i) || self.nodes[first + i].symmetric();
        let chain = Chain {
            s: boundary.s.clone(),
            positions: boundary.positions.clone(),
            mirror_start: symmetric(0),
            mirror_end: symmetric(boundary.nodes.len() - 1),
        };
        let friction = contact.friction.as_ref().filter(|law| law.bound.acts());
        let law = friction.map(|law| averages.law(self.patches.len(), law, chain));
        if let Some(law) = &law {
            self.add_points(contact, first, law, observer)?;
        }
        self.patches.push(Patch {
            contact,
            first,
            law,
        });
        Ok(())
    }

    fn add_nodes(&mut self, contact: &ContactModel) {
        let (model, body) = (self.model, self.body);
        let (first, boundary) = (self.nodes.len(), &contact.boundary);
        let count = boundary.nodes.len();
        self.nodes.reserve(count);
        for i in 0..count {
            let [normal, tangent] = body.contact_dofs[first + i];
            let follows = follows(model, contact, i, [normal, tangent]);
            let oblique = match (&follows, body.tangents[first + i]) {
                (Some(_), _) => Some(Oblique::OF_FOLLOWING),
                (None, part) => part.map(|part| oblique(model, contact, i, tangent, part)),
            };
            let held = Dof::Fixed(0.0);
            let is_own = follows.is_none();
            self.nodes.push(ContactNode {
                normal: if is_own { normal } else { held },
                tangent: if oblique.is_none() { tangent } else { held },
                oblique,
                follows,
                gap: 0.0,
                bonded: is_own && contact.condition == Condition::Bonded,
                drag: 0.0,
                held_tangent: None,
                weight: boundary.weights[i],
                on_axis: is_own && model.axis.holds(boundary.positions[i]),
                beside_axis: None,
            });
        }
        for [end, beside] in model.axis.ends(&boundary.positions) {
            let [end, beside] = [first + end, first + beside];
            self.nodes[end].weight = AXIS_SHARE * self.nodes[beside].weight;
            let free = [end, beside].map(|i| matches!(self.nodes[i].normal, Dof::Free(_)));
            let open = model.open_on_axis.contains(&boundary.nodes[end - first]);
            self.nodes[beside].beside_axis = (free == [true; 2] && !open).then_some(end);
        }
    }

    /// Adds the friction points of a contact, whose nodes begin at `first`.
    fn add_points(
        &mut self,
        contact: &ContactModel,
        first: usize,
        law: &FrictionLaw,
        observer: &mut dyn Observer,
    ) -> Result<(), SolveError> {
        let (patch, boundary) = (self.patches.len(), &contact.boundary);
        let own = &self.nodes[first..];
        self.points.reserve(boundary.friction_points.len());
        let mut add = |s: f64, nodes: [usize; 3], shape: [f64; 3], weight: f64| {
            self.points.push(Point {
                patch,
                s,
                nodes: nodes.map(|i| first + i),
                shape,
                weight,
                source: law.bound.source(s).shifted(first),
                anchor: 0.0,
            });
            go_on(observer)
        };
        match law.points {
            FrictionPoints::Gauss3 => {
                for p in &boundary.friction_points {
                    let shape = shape_without_oblique(own, p.nodes, p.shape);
                    add(p.s, p.nodes, shape, p.weight)?;
                }
            }
            // a node on the axis has no weight, and no friction
            FrictionPoints::Nodal => {
                for (i, node) in own.iter().enumerate() {
                    if self.model.axis.holds(boundary.positions[i]) {
                        continue;
                    }
                    let itself = [1.0, 0.0, 0.0];
                    let (nodes, shape) = match node.oblique {
                        None => ([i; 3], itself),
                        Some(_) => {
                            let nodes = if i == 0 { [0, 2, 1] } else { [i, i - 2, i - 1] };
                            (nodes, shape_without_oblique(own, nodes, itself))
                        }
                    };
                    add(boundary.s[i], nodes, shape, boundary.weights[i])?;
                }
            }
        }
        Ok(())
    }

    /// A friction point without weight, for evaluating the law at any place.
    pub(super) fn probe(
        &self,
        patch: usize,
        s: f64,
        nodes: [usize; 3],
        shape: [f64; 3],
        anchor: f64,
    ) -> Point {
        let (first, law) = (self.patches[patch].first, &self.patches[patch].law);
        Point {
            patch,
            s,
            nodes,
            shape: shape_without_oblique(&self.nodes, nodes, shape),
            weight: 0.0,
            source: match law {
                Some(law) => law.bound.source(s).shifted(first),
                None => Source::Given(0.0),
            },
            anchor,
        }
    }

    /// Resets what earlier increments have left to the start of the load path; returns what it was, with the level.
    pub fn restart(&mut self) -> Path {
        let anchors = self.points.iter_mut();
        Path {
            anchors: anchors
                .map(|point| std::mem::take(&mut point.anchor))
                .collect(),
            dissipated: std::mem::take(&mut self.dissipated),
            touched: std::mem::take(&mut self.touched),
            level: self.level,
        }
    }

    /// Returns to a path that [`System::restart`] gave.
    pub fn resume(&mut self, path: Path) {
        self.set_level(path.level);
        self.dissipated = path.dissipated;
        self.touched = path.touched;
        for (point, anchor) in self.points.iter_mut().zip(path.anchors) {
            point.anchor = anchor;
        }
    }

    /// Moves obstacles, loads and supports to a load level; anchors stay.
    pub fn set_level(&mut self, level: Level) {
        self.level = level;
        self.load = self.body.load(&level);
        if let Some(opposite) = &self.opposite {
            let load = std::mem::take(&mut self.load);
            (self.load, self.opposite_at_rest) = opposite.reduced(self.model, &level, &load);
        }
        for patch in &self.patches {
            let contact = patch.contact;
            for (i, node) in self.nodes[patch.first..].iter_mut().enumerate() {
                if i >= contact.boundary.nodes.len() {
                    break;
                }
                let [normal, tangent] =
                    self.body.contact_dofs[patch.first + i].map(|dof| match dof {
                        Dof::Fixed(value) => Dof::Fixed(level.supports * value),
                        free => free,
                    });
                match (&mut node.follows, &mut node.oblique) {
                    (Some(follows), _) => follows.dofs = [normal, tangent],
                    (None, None) => (node.normal, node.tangent) = (normal, tangent),
                    (None, Some(oblique)) => (node.normal, oblique.other) = (normal, tangent),
                }
                node.gap = match contact.condition {
                    Condition::None => f64::INFINITY,
                    _ => contact.gap(i, &level),
                };
                node.drag = contact.drag(i, &level);
                if let Some(opposite) = &self.opposite {
                    let [along_n, along_t] = opposite.prescribed(patch.first + i);
                    node.gap += level.supports * along_n;
                    node.drag += level.supports * along_t;
                }
                node.held_tangent = node.bonded.then_some(node.drag);
            }
        }
        for i in 0..self.nodes.len() {
            if let Some(end) = self.nodes[i].beside_axis
                && self.nodes[i].gap.is_finite()
            {
                self.nodes[i].gap -= AXIS_SHARE * self.nodes[end].gap;
            }
        }
    }

    /// A copy of the system with u_t = d prescribed at all nodes of contacts with friction, so that everything sticks.
    pub fn bonded(&self) -> Self {
        // without friction points, whose averages are most of a large system
        let mut bonded = System {
            stiffness: self.stiffness.clone(),
            load: self.load.clone(),
            opposite: self.opposite.clone(),
            opposite_at_rest: self.opposite_at_rest.clone(),
            nodes: self.nodes.clone(),
            points: Vec::new(),
            patches: self.patches.clone(),
            touched: self.touched.clone(),
            ..*self
        };
        for patch in bonded.patches.iter().filter(|patch| patch.law.is_some()) {
            let count = patch.contact.boundary.nodes.len();
            for node in &mut bonded.nodes[patch.first..patch.first + count] {
                node.held_tangent = Some(node.drag);
            }
        }
        bonded
    }

    /// Ends an increment: keeps which contacts touch, and moves the anchors of points that slide or are open with the
    /// slip by Δg, which dissipates τ|Δg|.
    pub fn end_increment(&mut self, State { v, active }: &State, bound: &[f64]) {
        let touch = |patch: &Patch<'_>| active[self.range(patch)].contains(&true);
        let touching = (0..self.patches.len()).filter(|&p| touch(&self.patches[p]));
        let touching: Vec<usize> = touching.collect();
        self.touched.extend(touching);
        let largest = bound.iter().fold(0.0f64, |a, b| a.max(*b));
        for (g, tau) in bound.iter().enumerate() {
            let point = &self.points[g];
            let slip = self.slip(v, point);
            let open = *tau <= OPEN * largest;
            let moved = self.law(point).anchor_move(slip, open);
            self.dissipated += point.weight * tau * moved.abs();
            self.points[g].anchor += moved;
        }
    }

    /// The work done against friction (without 2π): ∫τ φ |e| in this state, plus the work that sliding has dissipated
    /// before.
    pub fn work(&self, v: &[f64], bound: &[f64]) -> f64 {
        let points = self.points.iter().zip(bound);
        let work = points.map(|(point, tau)| {
            let slip = self.slip(v, point);
            point.weight * tau * self.law(point).phi(slip) * slip
        });
        self.dissipated + work.sum::<f64>()
    }

    /// The initial state: no displacement, and no nodes in contact but bonded nodes and, where a force presses the obstacle or a
    /// body floats on another, those nearest to what they face.
    pub fn rest(&self) -> State {
        let mut active: Vec<bool> = self.nodes.iter().map(|node| node.bonded).collect();
        for patch in &self.patches {
            let loads = patch.contact.tool.as_ref().map(|tool| tool.loads);
            // a body that only its contact with another holds is held by the nearest nodes, too
            let floats = patch.contact.pair.is_some() && self.model.held_by_contact;
            let pressed = matches!(loads, Some([Some(_), ..]));
            if !(floats || pressed) {
                continue;
            }
            let moment = loads.and_then(|loads| loads[2]);
            let range = self.range(patch);
            let gap = |i: usize| self.nodes[range.start + i].gap;
            let least = (0..range.len()).map(gap).fold(f64::INFINITY, f64::min);
            let equal = NEAREST * patch.contact.boundary.length();
            // an obstacle that may turn about a single node is not held
            let beside = if moment.is_some() { 2 } else { 0 };
            for i in (0..range.len()).filter(|i| gap(*i) <= least + equal) {
                let last = range.end.min(range.start + i + beside + 1);
                active[range.start + i.saturating_sub(beside)..last].fill(true);
            }
        }
        for (active, node) in active.iter_mut().zip(&self.nodes) {
            *active &= node.bonded || matches!(node.normal, Dof::Free(_));
        }
        State {
            v: vec![0.0; self.load.len()],
            active,
        }
    }

    /// The unknown motions of obstacles in a state, in the order of its tools.
    pub fn free_motions(&self, v: &[f64]) -> Vec<f64> {
        match &self.opposite {
            None => Vec::new(),
            Some(opposite) => opposite.motions(&self.opposite_at_rest, v),
        }
    }

    /// The motion of the obstacle that loads move, if there is one such obstacle.
    pub fn motion_by_loads(&self, v: &[f64]) -> Option<ObstacleMotion> {
        let loaded = |patch: &Patch<'_>| {
            let tool = patch.contact.tool.as_ref();
            tool.is_some_and(|tool| tool.free().next().is_some())
        };
        let mut loaded = (0..self.patches.len()).filter(|p| loaded(&self.patches[*p]));
        let (Some(patch), None) = (loaded.next(), loaded.next()) else {
            return None;
        };
        let [indentation, tangential_displacement, tilt] = self.obstacle_motions(v, patch);
        Some(ObstacleMotion {
            indentation,
            tangential_displacement,
            tilt,
        })
    }

    /// The motions of the obstacle of a contact in a state: indentation, tangential displacement and tilt.
    pub fn obstacle_motions(&self, v: &[f64], patch: usize) -> [f64; 3] {
        let contact = self.patches[patch].contact;
        let given = match &contact.tool {
            None => {
                let [pushed, along, _] = self.level.motions;
                [
                    pushed * contact.indentation,
                    along * contact.tangential_displacement,
                    0.0,
                ]
            }
            Some(tool) => tool.motions(&self.level),
        };
        let Some(opposite) = &self.opposite else {
            return given;
        };
        let free = opposite::of_patch(&opposite.motions, &self.free_motions(v), patch);
        std::array::from_fn(|k| given[k] + free[k])
    }

    /// The displacements of the contact unknowns in a state, which itself is relative to obstacles whose motion is unknown.
    pub fn displaced<'b>(&self, v: &'b [f64]) -> Cow<'b, [f64]> {
        match &self.opposite {
            None => Cow::Borrowed(v),
            Some(opposite) => Cow::Owned(opposite.displaced(v, &self.free_motions(v))),
        }
    }

    /// The displacements of the contact unknowns in the dual solution of a quantity, z + P (A⁻¹ e − A⁻¹PᵀŜ z). `z`: its influence
    /// on displacements relative to obstacles; `motion`: the unknown motion that the quantity is, if it is one.
    pub fn dual_of_body(&self, z: &[f64], motion: Option<usize>) -> Vec<f64> {
        let Some(opposite) = &self.opposite else {
            return z.to_vec();
        };
        let own = opposite.unit_at_rest(motion);
        opposite.displaced(z, &opposite.motions(&own, z))
    }

    /// The energy of the springs of obstacles less the work of the loads on obstacles (without 2π).
    pub fn energy_of_obstacles(&self, v: &[f64]) -> f64 {
        let Some(opposite) = &self.opposite else {
            return 0.0;
        };
        let q = self.free_motions(v);
        let energy = opposite.motions.iter().zip(&q).map(|(free, q)| {
            let load = opposite.load(self.model, &self.level, free);
            (0.5 * opposite.spring(self.model, free) * q - load) * q
        });
        energy.sum()
    }

    /// The nodes of a contact, as a range.
    pub fn range(&self, patch: &Patch<'_>) -> std::ops::Range<usize> {
        patch.first..patch.first + patch.contact.boundary.nodes.len()
    }

    /// The normal displacement u_n of a node.
    pub fn normal_displacement(&self, v: &[f64], node: usize) -> f64 {
        if let Some(follows) = &self.nodes[node].follows {
            return Follows::along(follows.normal, follows.dofs, v);
        }
        let own = |node: usize| value(self.nodes[node].normal, v);
        match self.nodes[node].beside_axis {
            Some(end) => own(node) + AXIS_SHARE * own(end),
            None => own(node),
        }
    }

    /// The distance of a node from the obstacle: gap − u_n.
    pub fn opening(&self, v: &[f64], node: usize) -> f64 {
        if self.nodes[node].follows.is_some() {
            return self.nodes[node].gap - self.normal_displacement(v, node);
        }
        let own = |node: usize| self.nodes[node].gap - value(self.nodes[node].normal, v);
        match self.nodes[node].beside_axis {
            Some(end) => own(node) + AXIS_SHARE * own(end),
            None => own(node),
        }
    }

    /// The tangential displacement u_t of a node.
    pub fn tangential_displacement(&self, v: &[f64], node: usize) -> f64 {
        let node = &self.nodes[node];
        if let Some(follows) = &node.follows {
            return Follows::along(follows.tangent, follows.dofs, v);
        }
        match node.oblique {
            None => value(node.tangent, v),
            Some(Oblique { other, part, .. }) => {
                part[0] * value(node.normal, v) + part[1] * value(other, v)
            }
        }
    }

    /// The displacement relative to the obstacle, u_t − d, at a friction point.
    fn relative_displacement(&self, v: &[f64], point: &Point) -> f64 {
        let relative = |node: usize| self.tangential_displacement(v, node) - self.nodes[node].drag;
        (0..3)
            .map(|i| point.shape[i] * relative(point.nodes[i]))
            .sum()
    }

    /// The slip e = u_t − d − g at a friction point, which friction acts against.
    pub fn slip(&self, v: &[f64], point: &Point) -> f64 {
        self.relative_displacement(v, point) - point.anchor
    }

    /// The law at a friction point.
    pub fn law(&self, point: &Point) -> &FrictionLaw {
        match &self.patches[point.patch].law {
            Some(law) => law,
            None => unreachable!("a contact without a law has no friction points"),
        }
    }

    /// The elastic force Ŝ v − f̂ on the contact unknowns.
    pub fn elastic_force(&self, v: &[f64]) -> Vec<f64> {
        self.stiffness
            .times(v)
            .iter()
            .zip(&self.load)
            .map(|(a, b)| a - b)
            .collect()
    }

    /// The tangential stress σ_t = −τ φ at every friction point (along t).
    pub fn tractions(&self, v: &[f64], bound: &[f64]) -> Vec<f64> {
        // a node belongs to several points
        let relative = |i: usize| self.tangential_displacement(v, i) - self.nodes[i].drag;
        let relative: Vec<f64> = (0..self.nodes.len()).map(relative).collect();
        let traction = |(point, tau): (&Point, &f64)| {
            let moved: f64 = (0..3)
                .map(|i| point.shape[i] * relative[point.nodes[i]])
                .sum();
            -tau * self.law(point).phi(moved - point.anchor)
        };
        self.points.iter().zip(bound).map(traction).collect()
    }

    /// Adds the nodal forces −Σ w σ_t h of tangential tractions to `force`, on the left-hand side, thesis (2.29).
    pub fn add_traction_force(&self, tractions: &[f64], force: &mut [f64]) {
        for (point, traction) in self.points.iter().zip(tractions) {
            for i in 0..3 {
                if let Dof::Free(dof) = self.nodes[point.nodes[i]].tangent {
                    force[dof] -= point.weight * traction * point.shape[i];
                }
            }
        }
    }

    /// The reactions R = f̂_n − (Ŝ v)_n of the obstacle on active nodes; exactly 0 on the other nodes.
    pub fn reactions(&self, state: &State) -> Vec<f64> {
        self.reactions_of(state, &self.elastic_force(&state.v))
    }

    /// Like [`System::reactions`], from the elastic force Ŝ v − f̂ (`force`), which takes a product with a dense
    /// matrix.
    pub(super) fn reactions_of(&self, state: &State, force: &[f64]) -> Vec<f64> {
        let reaction = |(node, active): (&ContactNode, &bool)| match node.normal {
            Dof::Free(dof) if *active => -force[dof],
            _ => 0.0,
        };
        self.nodes.iter().zip(&state.active).map(reaction).collect()
    }

    /// The tangential forces of the obstacle on nodes whose tangential displacement is held; exactly 0 on the other
    /// nodes. `force`: Ŝ v − f̂.
    pub(super) fn tangential_reactions(&self, force: &[f64]) -> Vec<f64> {
        let reaction = |node: &ContactNode| match (node.tangent, node.held_tangent) {
            (Dof::Free(dof), Some(_)) => force[dof],
            _ => 0.0,
        };
        self.nodes.iter().map(reaction).collect()
    }

    /// The sums ∫σ_t and ∫|σ_t| over friction points with these tractions, and over the forces `held` on nodes that are
    /// held along t (without 2π).
    pub fn tangential_forces<'b>(
        &self,
        tractions: impl Iterator<Item = (&'b Point, &'b f64)>,
        held: &[f64],
    ) -> [f64; 2] {
        let friction = tractions.map(|(point, traction)| point.weight * traction);
        friction
            .chain(held.iter().copied())
            .fold([0.0; 2], |[sum, size], f| [sum + f, size + f.abs()])
    }

    /// The nodal pressures p = R / ∫h, with a correction beside the axis so that the profile adds up to the reactions
    /// (formulation 3.5); exactly 0 where there is no reaction.
    pub fn pressures(&self, reactions: &[f64]) -> Vec<f64> {
        let nodes = self.nodes.iter().zip(reactions);
        let mut pressures: Vec<f64> = nodes
            .map(|(node, reaction)| reaction / node.weight)
            .collect();
        for (i, node) in self.nodes.iter().enumerate() {
            if let Some(end) = node.beside_axis
                && reactions[i] != 0.0
            {
                pressures[i] += AXIS_SHARE * (pressures[end] - pressures[i]);
            }
        }
        pressures
    }

    /// `factor` times the pressure of a node in contact, as a sum over reactions: returns nodes and their weights.
    pub fn pressure_weights(
        &self,
        node: usize,
        factor: f64,
    ) -> impl Iterator<Item = (usize, f64)> + use<> {
        let area = self.nodes[node].weight;
        let (own, beside) = match self.nodes[node].beside_axis {
            // what is taken from the node goes to the one on the axis, whose area is that part of its own
            Some(end) => (1.0 - AXIS_SHARE, Some((end, factor / area))),
            None => (1.0, None),
        };
        std::iter::once((node, own * factor / area)).chain(beside)
    }

    /// The averaged pressure at a point as a sum over reactions, by W P: returns nodes in contact and their weights.
    pub fn reaction_weights(&self, state: &State, point: &Point) -> Vec<(usize, f64)> {
        let Source::Average(row) = &point.source else {
            return Vec::new();
        };
        let mut weights: Vec<(usize, f64)> = Vec::with_capacity(row.weights.len());
        for (i, &weight) in row.weights.iter().enumerate().filter(|(_, w)| **w != 0.0) {
            let node = row.first + i;
            if state.active[node] {
                let parts = self.pressure_weights(node, weight);
                weights.extend(parts.filter(|(other, _)| state.active[*other]));
            }
        }
        weights
    }

    /// The normal force ∫p on some nodes, from the reactions of the nodes (without 2π).
    pub fn normal_force(&self, nodes: std::ops::Range<usize>, reactions: &[f64]) -> f64 {
        nodes.map(|i| self.nodes[i].force() * reactions[i]).sum()
    }

    /// The friction bound τ at every friction point, thesis (1.3): also where the body is open but within ρ of contact.
    pub fn friction_bound(&self, pressures: &[f64]) -> Vec<f64> {
        let of_patch = |patch| largest_pressure(&pressures[self.range(patch)]);
        let largest: Vec<f64> = self.patches.iter().map(of_patch).collect();
        let bound = |point: &Point| {
            let law = &self.law(point).bound;
            law.bound(&point.source, pressures, largest[point.patch])
        };
        self.points.iter().map(bound).collect()
    }

    /// The largest force or complementarity defect for a given friction bound, divided by the largest nodal reaction.
    /// If nothing presses, it is divided by the largest load or friction force or, since a body may be at rest again,
    /// by the problem's own force. `elastic`: Ŝ v − f̂ of the state.
    pub(super) fn kkt_residual(&self, state: &State, elastic: &[f64], bound: &[f64]) -> f64 {
        let mut friction = vec![0.0; state.v.len()];
        self.add_traction_force(&self.tractions(&state.v, bound), &mut friction);
        self.kkt_residual_of(state, elastic, &friction)
    }

    /// Like [`System::kkt_residual`], with friction forces from [`System::add_traction_force`].
    pub(super) fn kkt_residual_of(&self, state: &State, elastic: &[f64], friction: &[f64]) -> f64 {
        let force: Vec<f64> = elastic.iter().zip(friction).map(|(a, b)| a + b).collect();
        let reactions = self.reactions_of(state, elastic);
        let mut defect: f64 = 0.0;
        for (i, node) in self.nodes.iter().enumerate() {
            if let Dof::Free(dof) = node.tangent {
                defect = defect.max(match node.held_tangent {
                    Some(d) => (self.stiffness.at(dof, dof) * (state.v[dof] - d)).abs(),
                    None => force[dof].abs(),
                });
            }
            let Dof::Free(dof) = node.normal else {
                continue;
            };
            let opening = node.gap - state.v[dof];
            let stiffness = self.stiffness.at(dof, dof);
            defect = defect.max(match (state.active[i], node.bonded) {
                (true, false) => (stiffness * opening).abs().max(-reactions[i]),
                (true, true) => (stiffness * opening).abs(),
                (false, _) => force[dof].abs().max(-stiffness * opening),
            });
        }
        // a problem without any force has no scale, and no defect
        if defect == 0.0 {
            0.0
        } else {
            defect / self.scale(&reactions, friction)
        }
    }

    /// The force, > 0, by which the KKT residual divides.
    pub fn force_scale(&self, state: &State, reactions: &[f64], bound: &[f64]) -> f64 {
        let mut friction = vec![0.0; state.v.len()];
        self.add_traction_force(&self.tractions(&state.v, bound), &mut friction);
        self.scale(reactions, &friction)
    }

    fn scale(&self, reactions: &[f64], friction: &[f64]) -> f64 {
        let scale = if self.presses(reactions) {
            largest_size(reactions)
        } else {
            let acting = largest_size(&self.load).max(largest_size(friction));
            acting.max(self.reference_force)
        };
        scale.max(f64::MIN_POSITIVE)
    }

    /// Whether the reactions of some contact are more than the rounding of the forces that displace it. Those to a given normal force
    /// are, however small it is.
    pub(super) fn presses(&self, reactions: &[f64]) -> bool {
        self.patches.iter().any(|patch| {
            let range = self.range(patch);
            let largest = largest_size(&reactions[range.clone()]);
            let tool = patch.contact.tool.as_ref();
            if tool.is_some_and(|tool| tool.loads[0].is_some() && tool.stiffness[0] == 0.0) {
                return largest > 0.0;
            }
            let displacing = self.nodes[range].iter().flat_map(|node| {
                let dofs = [node.normal, node.tangent];
                dofs.map(|dof| match dof {
                    Dof::Free(dof) => self.load[dof].abs(),
                    Dof::Fixed(_) => 0.0,
                })
            });
            largest > ROUNDED * displacing.fold(0.0, f64::max)
        })
    }
}

fn largest_size(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |most, value| most.max(value.abs()))
}

/// How the node i of a contact follows another contact; none unless the node belongs to that other contact alone.
/// `dofs`: the displacements along the normal and the tangent of that other contact.
fn follows(model: &Model, contact: &ContactModel, i: usize, dofs: [Dof; 2]) -> Option<Follows> {
    let node = contact.boundary.nodes[i];
    let owner = &model.contacts[*model.alone.get(&node)?];
    let there = owner.boundary.nodes.iter().position(|n| *n == node)?;
    if owner.name == contact.name {
        return None;
    }
    let axes = [owner.boundary.normals[there], owner.boundary.tangent(there)];
    let by_axes = |[x, y]: [f64; 2]| axes.map(|[a, b]| x * a + y * b);
    Some(Follows {
        dofs,
        normal: by_axes(contact.boundary.normals[i]),
        tangent: by_axes(contact.boundary.tangent(i)),
    })
}

/// The axes of a contact node whose displacement along `other` is not perpendicular to the normal.
fn oblique(model: &Model, contact: &ContactModel, i: usize, other: Dof, part: [f64; 2]) -> Oblique {
    let node = contact.boundary.nodes[i];
    let with_it = |contact: &&ContactModel| contact.boundary.nodes.contains(&node);
    let shared = model.contacts.iter().filter(with_it).count() > 1;
    let held = matches!(other, Dof::Fixed(value) if value == 0.0);
    Oblique {
        other,
        part,
        symmetric: held && !shared && contact.held_along_surface(i, &model.oblique[&node]),
        shared,
    }
}

/// The shape functions of an edge (start, end, midside) without nodes that have oblique axes: their values are replaced
/// by those of the straight line through the other two nodes. The shape functions still add up to 1.
pub(super) fn shape_without_oblique(
    nodes: &[ContactNode],
    edge: [usize; 3],
    [a, b, m]: [f64; 3],
) -> [f64; 3] {
    match [edge[0], edge[1]].map(|i| nodes[i].oblique.is_some()) {
        [false, false] => [a, b, m],
        [true, false] => [0.0, b - a, m + 2.0 * a],
        [false, true] => [a - b, 0.0, m + 2.0 * b],
        [true, true] => [0.0, 0.0, a + b + m],
    }
}

fn value(dof: Dof, v: &[f64]) -> f64 {
    match dof {
        Dof::Free(i) => v[i],
        Dof::Fixed(value) => value,
    }
}
