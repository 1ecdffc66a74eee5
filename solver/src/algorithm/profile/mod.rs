//! The profile of one contact in the final state. Submodules have its forces, extents, peaks and warnings.
//!
//! # Where to look
//!
//! | subject | where |
//! |---|---|
//! | forces, extents and peaks | `extents` |
//! | the quantities that have a stated error | `quantities` |
//! | what nodes do not see of an obstacle | `between` |
//! | what the distances between nodes leave open | `resolution` |
//! | the ripple of σ_t where the body sticks | `ripple` |
//! | what a push along a direction leaves open | `displaced` |
//! | the force as a vector | `resultant` |
//! | the same along the other body | `facing` |
//! | materials that meet under the contact | `junction` |
//! | warnings about a contact | `warnings` |

mod between;
mod displaced;
mod extents;
mod facing;
mod junction;
mod polygon;
mod quantities;
mod resolution;
mod resultant;
mod ripple;
mod warnings;

pub use quantities::{Estimable, Quantity};

use std::borrow::Cow;
use std::cell::OnceCell;

use super::system::{Patch, System, shape_without_oblique};
use crate::algorithm::finished::Finished;
use crate::contact::edge_nodes;
use crate::element::edge3;
use crate::element::gauss::GAUSS_3;
use crate::friction::largest_pressure;
use crate::problem::{Condition, FrictionPoints};
use crate::solution::{ContactProfile, NodeState};

/// One contact in the final state.
pub(super) struct PatchView<'a> {
    system: &'a System<'a>,
    patch: &'a Patch<'a>,
    p: usize,
    /// The state, relative to an obstacle whose motion is unknown.
    v: &'a [f64],
    /// The displacements of the contact unknowns.
    displaced: Cow<'a, [f64]>,
    /// The indentation, tangential displacement and tilt of the obstacle.
    motions: [f64; 3],
    finished: &'a Finished,
    forces: &'a Forces,
    /// The displacement u_t − d relative to the obstacle, at the nodes.
    relative: Vec<f64>,
    /// The largest pressure at a node (stress).
    largest: f64,
    /// The arc lengths between which the pressure is not zero; none if nothing touches.
    pressed: Option<[f64; 2]>,
    /// The anchors g at start, end and midside of every edge, from which slip is measured; 0 under the total law.
    anchors: Vec<[f64; 3]>,
    /// The junction with the fastest growth of the pressure, computed when first needed.
    worst_junction: OnceCell<Option<Junction>>,
    /// Whether the first and the last node are corners of the body in which the pressure has a limit, computed when first
    /// needed.
    mild_corners: OnceCell<[bool; 2]>,
    /// The gaps of an obstacle that is pushed along a direction, computed when first needed.
    displaced_gaps: OnceCell<DisplacedGaps>,
    /// The averaged pressure and the friction bound at the nodes, computed when first needed.
    at_nodes: OnceCell<Vec<(f64, f64)>>,
    /// The largest tangential stress in size, found when first needed.
    highest_traction: OnceCell<Option<Highest>>,
    /// The places between nodes where a node is needed, found when first needed.
    missed: OnceCell<Vec<Missed>>,
    /// A function that is told the work done (multiplications). If it returns false, the results will not be used, and
    /// may be anything.
    go_on: &'a dyn Fn(f64) -> bool,
    /// σ_t at start, end and midside of every edge, if it does not follow from the law: in the thesis's own iteration
    /// and in bonded contacts.
    tractions: Option<Vec<[f64; 3]>>,
}

/// A stress that is largest in size, and its place.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Highest {
    /// The pressure, or σ_t with its sign (stress).
    value: f64,
    edge: usize,
    /// The place on the edge, from −1 to 1.
    xi: f64,
}

/// A point of the contact at which materials meet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Junction {
    s: f64,
    /// The exponent λ, if the pressure grows like a power r^(λ−1) of the distance r; none if it grows like its
    /// logarithm.
    exponent: Option<f64>,
    /// The pressure that each halving of the mesh adds at the junction (stress).
    growth: f64,
}

/// A place between nodes where a node is needed: either the obstacle reaches into the body without resistance, or it
/// recedes from a body that touches it on both sides of the place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Missed {
    /// The contact, by its place in the model.
    pub patch: usize,
    /// The arc length of the place, from the start of the named boundary.
    pub s: f64,
    /// How far the obstacle reaches into the body at the place (length); negative if it recedes.
    pub penetration: f64,
    /// The distance between the nodes on either side of the place (length).
    pub spacing: f64,
    /// The force that would push a node at the place to the obstacle, divided by the largest nodal reaction; infinite
    /// if nothing touches.
    pub severity: f64,
}

/// The displaced obstacle at a contact node, compared with the obstacle whose gaps are linear in the indentation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DisplacedNode {
    /// How much larger the gap of the displaced obstacle along the contact's normal is (length).
    pub gap: f64,
    /// The angle by which the contact's normal is turned away from t; 0 if contact uses the body's normal.
    pub turn: f64,
}

/// The displaced obstacle at all nodes of a contact, compared with the obstacle whose gaps are linear in the
/// indentation.
#[derive(Clone, Debug, Default, PartialEq)]
pub(in crate::algorithm) struct DisplacedGaps {
    /// By node: the comparison; zero where the displaced gap is unknown.
    pub(in crate::algorithm) nodes: Vec<DisplacedNode>,
    /// The largest displacement of the obstacle along t at a node in contact that the obstacle faces no longer
    /// (length).
    past_end: f64,
}

/// The nodal forces of a state, with those of all contacts in a row.
pub(super) struct Forces {
    pub(super) reactions: Vec<f64>,
    pub(super) tangential_reactions: Vec<f64>,
    pub(super) pressures: Vec<f64>,
}

impl Forces {
    /// The nodal forces of a final state.
    pub(super) fn new(system: &System<'_>, finished: &Finished) -> Self {
        let elastic_force = &finished.elastic_force;
        let reactions = system.reactions_of(&finished.state, elastic_force);
        Forces {
            pressures: system.pressures(&reactions),
            tangential_reactions: system.tangential_reactions(elastic_force),
            reactions,
        }
    }
}

impl<'a> PatchView<'a> {
    pub(super) fn new(
        system: &'a System<'a>,
        p: usize,
        finished: &'a Finished,
        forces: &'a Forces,
        go_on: &'a dyn Fn(f64) -> bool,
    ) -> Self {
        let patch = &system.patches[p];
        let mut view = PatchView {
            system,
            patch,
            p,
            v: &finished.state.v,
            displaced: system.displaced(&finished.state.v),
            motions: system.obstacle_motions(&finished.state.v, p),
            finished,
            forces,
            relative: system
                .range(patch)
                .map(|i| {
                    let u_t = system.tangential_displacement(&finished.state.v, i);
                    u_t - system.nodes[i].drag
                })
                .collect(),
            largest: largest_pressure(&forces.pressures[system.range(patch)]),
            pressed: None,
            anchors: Vec::new(),
            worst_junction: OnceCell::new(),
            mild_corners: OnceCell::new(),
            displaced_gaps: OnceCell::new(),
            at_nodes: OnceCell::new(),
            highest_traction: OnceCell::new(),
            missed: OnceCell::new(),
            go_on,
            tractions: None,
        };
        view.pressed = view.pressed();
        view.anchors = view.carried_to_nodes(&|g| system.points[g].anchor);
        if patch.contact.condition == Condition::Bonded {
            let shear = |i: usize| {
                let node = patch.first + i;
                forces.tangential_reactions[node] / system.nodes[node].weight
            };
            // on the axis there is no shear
            let stress = |i: usize| {
                if system.nodes[patch.first + i].on_axis {
                    0.0
                } else {
                    shear(i)
                }
            };
            let edges = 0..patch.contact.boundary.edge_count();
            view.tractions = Some(edges.map(|edge| edge_nodes(edge).map(stress)).collect());
        } else if finished.own_tractions {
            view.tractions = Some(view.carried_to_nodes(&|g| finished.tractions[g]));
        }
        view
    }

    /// The arc lengths from the start of the first edge with a pressure to the end of the last.
    fn pressed(&self) -> Option<[f64; 2]> {
        let (s, pressures) = (&self.patch.contact.boundary.s, self.own_pressures());
        let first = pressures.iter().position(|p| *p != 0.0)?;
        let last = pressures.iter().rposition(|p| *p != 0.0)?;
        Some([s[first.saturating_sub(2)], s[(last + 2).min(s.len() - 1)]])
    }

    /// Interpolates values at friction points to start, end and midside of every edge: by the parabola through the
    /// three Gauss points of the edge, or directly if the points are the nodes.
    fn carried_to_nodes(&self, value: &dyn Fn(usize) -> f64) -> Vec<[f64; 3]> {
        let points = &self.system.points;
        let own: Vec<usize> = (0..points.len())
            .filter(|&g| points[g].patch == self.p)
            .collect();
        let edges = self.patch.contact.boundary.edge_count();
        if own.is_empty() {
            return vec![[0.0; 3]; edges];
        }
        if self.at_gauss_points() {
            let gauss = GAUSS_3[2].0;
            let parabola = |edge: usize| {
                let [low, middle, high] = [0, 1, 2].map(|k| value(own[3 * edge + k]));
                let slope = (high - low) / (2.0 * gauss);
                let curve = (high + low - 2.0 * middle) / (2.0 * gauss * gauss);
                [middle - slope + curve, middle + slope + curve, middle]
            };
            return (0..edges).map(parabola).collect();
        }
        // a node without a point lies on the axis, where nothing slides
        let mut nodal = vec![0.0; self.count()];
        for g in own {
            nodal[points[g].nodes[0] - self.patch.first] = value(g);
        }
        (0..edges)
            .map(|edge| edge_nodes(edge).map(|i| nodal[i]))
            .collect()
    }

    /// Whether friction acts at Gauss points, three on each edge, rather than at nodes.
    fn at_gauss_points(&self) -> bool {
        let friction = self.patch.contact.friction.as_ref();
        friction.is_some_and(|f| f.points == FrictionPoints::Gauss3)
    }

    fn count(&self) -> usize {
        self.patch.contact.boundary.nodes.len()
    }

    /// Whether friction may act at a node, which is in contact or has no obstacle.
    fn engaged(&self, i: usize) -> bool {
        self.active(i) || self.patch.contact.condition == Condition::None
    }

    fn active(&self, i: usize) -> bool {
        self.finished.state.active[self.patch.first + i]
    }

    /// The displacements of a node along n and t.
    fn displacement(&self, i: usize) -> [f64; 2] {
        let node = self.patch.first + i;
        [
            self.system.normal_displacement(&self.displaced, node),
            self.system.tangential_displacement(&self.displaced, node),
        ]
    }

    /// The gap at a node after all motions of the obstacle, or of another body.
    fn gap(&self, i: usize) -> f64 {
        let contact = self.patch.contact;
        if contact.pair.is_some() {
            let node = self.patch.first + i;
            return self.displacement(i)[0] + self.system.opening(self.v, node);
        }
        match &contact.tool {
            None => contact.gap(i, &self.system.level),
            Some(tool) => contact.profile[i] - tool.moved(i, &self.motions)[0],
        }
    }

    fn pressure(&self, i: usize) -> f64 {
        self.forces.pressures[self.patch.first + i]
    }

    /// The slip e = u_t − d − g at a place of an edge.
    fn slip_at(&self, edge: usize, xi: f64) -> f64 {
        let relative = edge_nodes(edge).map(|i| self.relative[i]);
        let h = edge3::shape(xi);
        // as at the friction points
        let own = &self.system.nodes[self.system.range(self.patch)];
        let moved = shape_without_oblique(own, edge_nodes(edge), h);
        edge3::interpolate(&moved, &relative) - edge3::interpolate(&h, &self.anchors[edge])
    }

    fn own_pressures(&self) -> &[f64] {
        &self.forces.pressures[self.system.range(self.patch)]
    }

    /// Whether friction may act somewhere on an edge, since there is pressure within the distance ρ.
    fn may_rub(&self, edge: usize) -> bool {
        let reach = self.patch.law.as_ref().and_then(|law| law.bound.reach());
        let [start, end, _] = self.patch.contact.boundary.edge_arc(edge);
        match (reach, self.pressed) {
            (Some(radius), Some([from, to])) => end + radius >= from && start - radius <= to,
            (Some(_), None) => self.tractions.is_some(),
            (None, _) => true,
        }
    }

    /// The averaged pressure S_ρ and the bound τ at arc length s.
    fn averaged_and_bound(&self, s: f64) -> (f64, f64) {
        let Some(law) = &self.patch.law else {
            return (0.0, 0.0);
        };
        // most of a long boundary is further than ρ from any pressure, which the mirrors of lines of symmetry are too
        if let Some(radius) = law.bound.reach()
            && self
                .pressed
                .is_none_or(|[from, to]| s + radius < from || s - radius > to)
        {
            return (0.0, 0.0);
        }
        // a wide average along a long contact takes long, and there are many places
        if !(self.go_on)(0.0) {
            return (0.0, 0.0);
        }
        let source = law.bound.source(s);
        (self.go_on)(law.bound.work(&source) as f64);
        let pressures = self.own_pressures();
        (
            source.nonlocal_pressure(pressures),
            law.bound.bound(&source, pressures, self.largest),
        )
    }

    /// The averaged pressure S_ρ and the bound τ at the nodes.
    fn averaged_and_bound_at_nodes(&self) -> &[(f64, f64)] {
        self.at_nodes.get_or_init(|| {
            let s = self.patch.contact.boundary.s.iter();
            s.map(|s| self.averaged_and_bound(*s)).collect()
        })
    }

    /// The tangential stress σ_t(s) = −τ(s) φ(e(s)) at a place of an edge, with W evaluated at its arc length s.
    fn tangential_stress_at(&self, edge: usize, xi: f64) -> f64 {
        let h = edge3::shape(xi);
        if let Some(tractions) = &self.tractions {
            return edge3::interpolate(&h, &tractions[edge]);
        }
        let Some(law) = &self.patch.law else {
            return 0.0;
        };
        let s = edge3::interpolate(&h, &self.patch.contact.boundary.edge_arc(edge));
        -self.averaged_and_bound(s).1 * law.phi(self.slip_at(edge, xi))
    }

    /// The value at a node: the mean of the values on the edges that meet there.
    fn at_node(&self, i: usize, value: impl Fn(usize, f64) -> f64) -> f64 {
        if i % 2 == 1 {
            return value(i / 2, 0.0);
        }
        let before = (i > 0).then(|| value(i / 2 - 1, 1.0));
        let after = (i + 1 < self.count()).then(|| value(i / 2, -1.0));
        match (before, after) {
            (Some(a), Some(b)) => 0.5 * (a + b),
            (a, b) => a.or(b).unwrap_or(0.0),
        }
    }

    pub(super) fn profile(&self) -> ContactProfile {
        let boundary = &self.patch.contact.boundary;
        let mut profile = ContactProfile::default();
        for i in 0..self.count() {
            let (averaged, bound) = self.averaged_and_bound_at_nodes()[i];
            let law = self.patch.law.as_ref();
            let phi = |edge, xi| law.map_or(0.0, |law| law.phi(self.slip_at(edge, xi)));
            let sticks = match law {
                None => self.patch.contact.condition == Condition::Bonded,
                Some(law) => law.sticks(self.at_node(i, |edge, xi| self.slip_at(edge, xi))),
            };
            let ratio = self.at_node(i, phi);
            let stress = match &self.tractions {
                None => -bound * ratio,
                Some(_) => self.at_node(i, |edge, xi| self.tangential_stress_at(edge, xi)),
            };
            profile.s.push(boundary.s[i]);
            profile.x.push(boundary.positions[i][0]);
            profile.y.push(boundary.positions[i][1]);
            let [u_n, u_t] = self.displacement(i);
            profile.gap.push(self.gap(i));
            profile.normal_displacement.push(u_n);
            profile.tangential_displacement.push(u_t);
            profile.normal_stress.push(-self.pressure(i) + 0.0);
            profile.tangential_stress.push(stress + 0.0);
            profile.nonlocal_pressure.push(averaged);
            profile.friction_bound.push(bound);
            profile.friction_ratio.push(ratio.abs());
            profile.state.push(state(self.engaged(i), sticks));
        }
        profile
    }

    /// The columns of [`ContactProfile`] at the points where friction acts. `nodal`: the columns at the nodes.
    pub(super) fn friction_profile(&self, nodal: &ContactProfile) -> ContactProfile {
        let (points, tractions) = (&self.system.points, &self.finished.tractions);
        let own: Vec<usize> = (0..points.len())
            .filter(|&g| points[g].patch == self.p)
            .collect();
        let mut profile = ContactProfile::default();
        if !own.is_empty() && !self.at_gauss_points() {
            for g in own {
                profile.push_row(nodal, points[g].nodes[0] - self.patch.first);
                profile.tangential_stress.pop();
                profile.tangential_stress.push(tractions[g] + 0.0);
            }
            return profile;
        }
        let places = self.patch.contact.boundary.friction_points.iter();
        for (k, place) in places.enumerate() {
            let (edge, xi) = (k / 3, GAUSS_3[k % 3].0);
            let stress = match own.get(k) {
                Some(&g) => tractions[g],
                None => self.tangential_stress_at(edge, xi),
            };
            self.push_place(&mut profile, nodal, (edge, xi), place.s, stress);
        }
        profile
    }

    /// The columns of [`ContactProfile`] at the places of the peaks, in order of arc length, with σ_t by the law there.
    /// `nodal`: the columns at the nodes.
    pub(super) fn peak_profile(&self, nodal: &ContactProfile) -> ContactProfile {
        let pressure = self.highest_pressure();
        let traction = self.highest_traction();
        let places = [pressure, traction].into_iter().flatten();
        let arc = |Highest { edge, xi, .. }| {
            let h = edge3::shape(xi);
            let s = edge3::interpolate(&h, &self.patch.contact.boundary.edge_arc(edge));
            (s, (edge, xi))
        };
        let mut places: Vec<(f64, (usize, f64))> = places.map(arc).collect();
        places.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut profile = ContactProfile::default();
        for (s, (edge, xi)) in places {
            let stress = self.tangential_stress_at(edge, xi);
            self.push_place(&mut profile, nodal, (edge, xi), s, stress);
        }
        profile
    }

    /// Adds a row for the place ξ of an edge, with the given σ_t. The place is open if one of the nodes beside it is
    /// open.
    fn push_place(
        &self,
        profile: &mut ContactProfile,
        nodal: &ContactProfile,
        (edge, xi): (usize, f64),
        s: f64,
        stress: f64,
    ) {
        let nodes = edge_nodes(edge);
        let shape = edge3::shape(xi);
        let along = |column: &[f64]| edge3::interpolate(&shape, &nodes.map(|i| column[i])) + 0.0;
        let law = self.patch.law.as_ref();
        let (averaged, bound) = self.averaged_and_bound(s);
        let slip = self.slip_at(edge, xi);
        let sticks = match law {
            None => self.patch.contact.condition == Condition::Bonded,
            Some(law) => law.sticks(slip),
        };
        let [start, end, middle] = nodes;
        let beside = match xi {
            _ if xi <= -1.0 => [start; 2],
            _ if xi < 0.0 => [start, middle],
            0.0 => [middle; 2],
            _ if xi < 1.0 => [middle, end],
            _ => [end; 2],
        };
        let engaged = beside.iter().all(|&i| self.engaged(i));
        let ratio = law.map_or(0.0, |law| law.phi(slip)).abs();
        for (column, value) in [
            (&mut profile.s, s),
            (&mut profile.x, along(&nodal.x)),
            (&mut profile.y, along(&nodal.y)),
            (&mut profile.gap, along(&nodal.gap)),
            (
                &mut profile.normal_displacement,
                along(&nodal.normal_displacement),
            ),
            (
                &mut profile.tangential_displacement,
                along(&nodal.tangential_displacement),
            ),
            (&mut profile.normal_stress, along(&nodal.normal_stress)),
            (&mut profile.tangential_stress, stress + 0.0),
            (&mut profile.nonlocal_pressure, averaged),
            (&mut profile.friction_bound, bound),
            (&mut profile.friction_ratio, ratio),
        ] {
            column.push(value);
        }
        profile.state.push(state(engaged, sticks));
    }
}

fn state(engaged: bool, sticks: bool) -> NodeState {
    match (engaged, sticks) {
        (false, _) => NodeState::Open,
        (true, true) => NodeState::Stick,
        (true, false) => NodeState::Slip,
    }
}
