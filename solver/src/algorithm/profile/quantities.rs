//! The quantities of a contact for which an error is stated, and their derivatives.

use super::between::Wave;
use super::{Highest, PatchView};
use crate::algorithm::adjoint::Gradient;
use crate::algorithm::system::Point;
use crate::contact::edge_nodes;
use crate::element::edge3;
use crate::friction::BoundLaw;
use crate::problem::Condition;
use crate::solution::{Outcome, QuantityName};

/// A quantity of a contact, and the parts of its error.
pub struct Quantity {
    /// The kind of quantity.
    pub name: QuantityName,
    /// The contact, by its place in the model.
    pub patch: usize,
    /// The value in the solution.
    pub value: f64,
    /// The derivatives; none if the quantity depends only on the places of the nodes.
    pub gradient: Option<Gradient>,
    /// The change of the quantity per change of the function that `gradient` belongs to: 1, except at an end of stick,
    /// which moves with the slip at that end.
    pub factor: f64,
    /// The error due to the places of the nodes, in the unit of the value. At an end of contact or of stick: the
    /// distance to the next node. At a peak of the pressure: the peak's distance from a smooth curve through the nodes
    /// around it. At a peak of σ_t: the change of friction if the motion turns near the peak. In friction forces:
    /// cancellation within edges, singularities, and stick between points.
    pub spacing: f64,
    /// The error because the law is evaluated at friction points only, in the unit of the value. In friction forces:
    /// the friction by the law between the points. Beside a peak of the pressure: a jump of σ_t. At a peak of σ_t: the
    /// change of the bound τ.
    pub between: f64,
    /// What the mesh does not resolve, in the unit of the value. Of a force: how far sides of elements are from a curve. Of a peak: the pressure where σ_t jumps beside it, or where
    /// sides of a smooth curve meet at an angle, and what a ripple of σ_t lifts its peak where the body sticks. Of an end of stick at a node, where friction just
    /// reaches its bound: the distance to the next node. Else 0.
    pub unresolved: f64,
    /// The error by truncation, if the obstacle ends inside an edge, which is left out: for extents the length that is
    /// left out, else the quantity times that length divided by the length of the contact.
    pub truncation: f64,
    /// The error of an indentation along a direction, in the unit of the value, in addition to the error by `gradient`
    /// and [`AlongContacts::displaced`](crate::algorithm::AlongContacts).
    pub displaced: f64,
    /// For a peak: the stress due to a shape of the obstacle between the nodes that they do not see; else 0.
    pub unseen: f64,
    /// The least error that a sharp end leaves, in the unit of the value: of friction forces on the edges there, and of a peak of
    /// σ_t there.
    pub sharp_end: f64,
    /// The edges at sharp ends, with their parts in any unit.
    pub sharp_end_at: Vec<(usize, f64)>,
    /// The edges of the contact that contribute to `spacing`, with their parts in any unit.
    pub spacing_at: Vec<(usize, f64)>,
    /// The edges of the contact that contribute to `between`, with their parts in any unit.
    pub between_at: Vec<(usize, f64)>,
    /// The edges on which the obstacle has a shape that the nodes do not see, with their parts in any unit.
    pub unseen_at: Vec<(usize, f64)>,
    /// The number of equal parts of the contact, of which one is modelled: two if it continues beyond a line of
    /// symmetry.
    pub images: f64,
    /// Whether an error can be stated.
    pub estimable: Estimable,
}

/// Whether an error of a quantity can be stated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Estimable {
    /// An error can be stated.
    Yes,
    /// The quantity has no limit as the mesh is refined.
    NoLimit,
    /// The quantity is an end of stick in a contact that has too many such ends for stated errors.
    TooMany,
    /// The obstacle reaches into the body between the nodes or recedes from it, with an unknown effect.
    Unseen,
}

/// An end of an interval of contact.
pub(super) struct EndOfContact {
    name: QuantityName,
    /// The outermost node in contact.
    pub(super) node: usize,
    /// The arc length of that node.
    s: f64,
    /// The length from the node to the end of the obstacle, if that is inside the next edge, which is left out of the
    /// contact.
    pub(super) truncation: f64,
    /// The distance between the outermost node in contact and the next node (length).
    pub(super) spacing: f64,
    /// The edge between the outermost node in contact and the next node.
    pub(super) edge: usize,
}

/// The largest number of ends of stick of a contact that have stated errors: each costs as much as another recovery of
/// the stresses. A rough obstacle has hundreds of ends, and if stick and slip alternate from point to point, the places
/// of the ends depend on the mesh.
const MOST_STICK_ENDS: usize = 8;

/// The least pressure at the end of a boundary, as a part of that at the node beside it, that shows contact up to the end: at
/// a sharp end the pressure grows, and that of a parabola which contact reaches just so is half (`tests/verification/sharp_ends.rs`).
const REACHES_END: f64 = 0.7;

/// The same, below which contact ends before the end of the boundary.
const NEXT_TO_NOTHING: f64 = 0.25;

/// The part of its bound above which friction counts as having reached it: no peak of σ_t is known as exactly as that.
pub(super) const WHOLE_BOUND: f64 = 1.0 - 1e-6;

/// The change of slip along an edge, as a part of ε, up to which the slip is constant apart from rounding: if it equals
/// ε, there is no end of stick. The incremental law leads to such slip where the load rests.
const STEADY: f64 = 1e-6;

fn limited(has_limit: bool) -> Estimable {
    if has_limit {
        Estimable::Yes
    } else {
        Estimable::NoLimit
    }
}

impl PatchView<'_> {
    /// The forces, peaks and extents of the contact. Empty if σ_t does not follow from the law, as in a false state of
    /// the thesis's own iteration.
    pub(in crate::algorithm) fn quantities(&self) -> Vec<Quantity> {
        if self.finished.own_tractions && self.finished.outcome != Outcome::Converged {
            return Vec::new();
        }
        let mut found = self.forces();
        found.extend(self.peaks());
        found.extend(self.ends());
        found.extend(self.motions_of_obstacle());
        self.add_truncation(&mut found);
        self.add_unseen(&mut found);
        self.add_displaced(&mut found);
        if !self.missed().is_empty() || self.overlap_without_contact() > 0.0 {
            for quantity in &mut found {
                if quantity.estimable == Estimable::Yes {
                    quantity.estimable = Estimable::Unseen;
                }
            }
        }
        found
    }

    /// Adds the error by truncation to all quantities except starts and ends of contact.
    fn add_truncation(&self, quantities: &mut [Quantity]) {
        let ends = self.ends_of_contact();
        let truncation: f64 = ends.iter().map(|end| end.truncation).sum();
        // a contact of one node is not resolved at all
        let part = match (ends.first(), ends.last()) {
            (Some(first), Some(last)) if truncation > 0.0 => {
                (truncation / (last.s - first.s)).min(1.0)
            }
            _ => 0.0,
        };
        let rubbed = self.system.circumference * self.prescribed_friction_left_out();
        let friction = self.summary().friction_force;
        for quantity in quantities {
            quantity.truncation = match quantity.name {
                QuantityName::ContactStart | QuantityName::ContactEnd => continue,
                QuantityName::StickEnd => truncation,
                QuantityName::TangentialForce | QuantityName::FrictionForce => {
                    rubbed.max(part * friction)
                }
                _ => part * quantity.value.abs(),
            };
        }
    }

    /// Adds the error of an indentation along a direction, if the displaced obstacle ends elsewhere.
    fn add_displaced(&self, quantities: &mut [Quantity]) {
        let part = self.displaced_part();
        for quantity in quantities {
            use QuantityName::{ContactEnd, ContactStart, StickEnd};
            match quantity.name {
                ContactStart | ContactEnd => {}
                StickEnd => quantity.displaced = part * self.contact_length(),
                _ => quantity.displaced = part * quantity.value.abs(),
            }
        }
    }

    /// Adds to peaks the error by shapes of the obstacle that the nodes do not see.
    fn add_unseen(&self, quantities: &mut [Quantity]) {
        let waves = self.unseen_waves();
        let most = |of_wave: &dyn Fn(&Wave) -> f64| waves.iter().map(of_wave).fold(0.0, f64::max);
        for quantity in quantities {
            quantity.unseen = match quantity.name {
                QuantityName::PeakNormalStress => most(&|wave| wave.pressure),
                QuantityName::PeakTangentialStress => {
                    let room = self.shear_cap() - quantity.value.abs();
                    most(&|wave| self.friction_of(wave)).min(room.max(0.0))
                }
                _ => 0.0,
            };
            quantity.unseen_at = waves.iter().map(|w| (w.edge, w.pressure)).collect();
        }
    }

    /// The largest bound τ that the law allows (stress); infinite without a cap.
    fn shear_cap(&self) -> f64 {
        match self.patch.law.as_ref().map(|law| &law.bound) {
            Some(BoundLaw::Pressure { shear_cap, .. }) => *shear_cap,
            _ => f64::INFINITY,
        }
    }

    /// The friction force of a prescribed bound on the parts of the contact that are left out (force, without 2π). A
    /// prescribed bound acts whether or not the body touches.
    fn prescribed_friction_left_out(&self) -> f64 {
        let Some(law) = self.patch.law.as_ref() else {
            return 0.0;
        };
        let BoundLaw::Prescribed(_) = law.bound else {
            return 0.0;
        };
        let boundary = &self.patch.contact.boundary;
        let last = self.count() - 1;
        let at_end = |(node, edge): (usize, usize)| {
            let [start, end, _] = boundary.edge_arc(edge);
            let depth = self.weight(edge) / (end - start);
            self.averaged_and_bound(boundary.s[node]).1 * depth * self.left_out(node)
        };
        [(0, 0), (last, last / 2 - 1)].into_iter().map(at_end).sum()
    }

    /// The length of the obstacle beyond the first or the last node of the boundary, given as `node`.
    fn left_out(&self, node: usize) -> f64 {
        let contact = &self.patch.contact;
        let number = contact.boundary.nodes[node];
        let here = contact
            .cut
            .iter()
            .filter(|(edge, _)| edge.contains(&number));
        here.map(|(_, covered)| covered).sum()
    }

    fn quantity(&self, name: QuantityName, value: f64, gradient: Option<Gradient>) -> Quantity {
        Quantity {
            name,
            patch: self.p,
            value,
            gradient,
            factor: 1.0,
            spacing: 0.0,
            between: 0.0,
            unresolved: 0.0,
            truncation: 0.0,
            displaced: 0.0,
            unseen: 0.0,
            sharp_end: 0.0,
            sharp_end_at: Vec::new(),
            spacing_at: Vec::new(),
            between_at: Vec::new(),
            unseen_at: Vec::new(),
            images: 1.0 + self.mirrored_ends() as f64,
            estimable: Estimable::Yes,
        }
    }

    /// The number of ends of the boundary that lie on lines of symmetry, beyond which the contact continues.
    pub(super) fn mirrored_ends(&self) -> usize {
        let goes_on = |i: &usize| self.engaged(*i) && self.symmetric(*i);
        [0, self.count() - 1].iter().filter(|i| goes_on(i)).count()
    }

    fn forces(&self) -> Vec<Quantity> {
        let (system, state) = (self.system, &self.finished.state);
        let range = system.range(self.patch);
        let circumference = system.circumference;
        let zero = || Gradient::zero(system);
        let mut normal = zero();
        for i in range.clone() {
            normal.reaction[i] = system.nodes[i].force();
        }
        let (mut tangential, mut size) = (zero(), zero());
        let pressures = &self.forces.pressures;
        let points = system.points.iter().zip(&self.finished.bound);
        for (point, bound) in points.filter(|(point, _)| point.patch == self.p) {
            let sign = -system.law(point).phi(system.slip(self.v, point)).signum();
            tangential.add_traction(system, state, pressures, *bound, point, point.weight);
            size.add_traction(system, state, pressures, *bound, point, sign * point.weight);
        }
        for i in range {
            tangential.held[i] = 1.0;
            size.held[i] = self.forces.tangential_reactions[i].signum();
        }
        let summary = self.summary();
        let forces = [
            (QuantityName::NormalForce, summary.normal_force, normal),
            (
                QuantityName::TangentialForce,
                summary.tangential_force,
                tangential,
            ),
            (QuantityName::FrictionForce, summary.friction_force, size),
        ];
        let (canceling, _) = self.oscillation();
        let by_edge = self.between_points();
        let left_open = self.open_friction();
        let open: f64 = left_open.iter().map(|(_, force)| force).sum();
        let bonded = self.bonded_at_kinks();
        let jumps: f64 = bonded.iter().map(|(_, force)| force).sum();
        let parabolas = self.part_of_parabolas();
        let canceling_at = self.canceling().into_iter().map(f64::abs).enumerate();
        let open_at: Vec<(usize, f64)> = canceling_at.chain(left_open).chain(bonded).collect();
        let between = [
            by_edge.iter().sum::<f64>(),
            by_edge.iter().map(|part| part.abs()).sum(),
        ];
        let at_sharp_ends = self.friction_at_sharp_ends();
        let sharp_end: f64 = at_sharp_ends.iter().map(|(_, force)| force).sum();
        let at = |parts: &[f64]| parts.iter().map(|part| part.abs()).enumerate().collect();
        let quantity = |(name, value, gradient)| Quantity {
            factor: circumference,
            spacing: match name {
                QuantityName::NormalForce => 0.0,
                QuantityName::TangentialForce => circumference * open,
                _ => circumference * (canceling + open),
            },
            between: match name {
                QuantityName::NormalForce => 0.0,
                QuantityName::TangentialForce => circumference * between[0].abs(),
                _ => circumference * between[1],
            },
            unresolved: parabolas * f64::abs(value)
                + match name {
                    QuantityName::NormalForce => 0.0,
                    _ => circumference * jumps,
                },
            sharp_end: match name {
                QuantityName::NormalForce => 0.0,
                _ => circumference * sharp_end,
            },
            sharp_end_at: at_sharp_ends.clone(),
            spacing_at: open_at.clone(),
            between_at: at(&by_edge),
            ..self.quantity(name, value, Some(gradient))
        };
        forces.into_iter().map(quantity).collect()
    }

    /// The motions of an obstacle under loads: those that the loads cause, and the indentation in any case, to which the others
    /// are compared.
    fn motions_of_obstacle(&self) -> Vec<Quantity> {
        let Some(opposite) = &self.system.opposite else {
            return Vec::new();
        };
        let tool = self.patch.contact.tool.as_ref();
        if tool.is_none_or(|tool| tool.free().next().is_none()) {
            return Vec::new();
        }
        let names = [
            QuantityName::Indentation,
            QuantityName::TangentialDisplacement,
            QuantityName::Tilt,
        ];
        let mut found = Vec::new();
        for (k, name) in names.into_iter().enumerate() {
            let number = opposite.number(self.p, k);
            if number.is_some() || k == 0 {
                let gradient = number.map(|n| Gradient::of_motion(self.system, opposite, n));
                found.push(self.quantity(name, self.motions[k], gradient));
            }
        }
        found
    }

    fn peaks(&self) -> Vec<Quantity> {
        let (system, state) = (self.system, &self.finished.state);
        let mut found = Vec::new();
        if let Some(highest) = self.highest_pressure() {
            let Highest { value, edge, xi } = highest;
            let mut gradient = Gradient::zero(system);
            for (i, shape) in edge_nodes(edge).into_iter().zip(edge3::shape(xi)) {
                gradient.add_pressure(system, self.patch.first + i, -shape);
            }
            let jumps: Vec<(usize, f64)> = self
                .neighbours(edge)
                .map(|edge| (edge, self.jump_within(edge).0))
                .collect();
            found.push(Quantity {
                spacing: self.off_smooth_pressure(value, edge, xi),
                spacing_at: vec![(edge, 1.0)],
                between: jumps.iter().fold(0.0, |most, (_, jump)| most.max(*jump)),
                between_at: jumps,
                unresolved: self.unresolved_pressure(highest) + self.pressure_of_parabolas(),
                estimable: limited(!self.pressure_without_limit()),
                ..self.quantity(QuantityName::PeakNormalStress, -value, Some(gradient))
            });
        }
        if let Some(highest) = self.highest_traction().filter(|_| self.patch.law.is_some()) {
            let Highest {
                value: stress,
                edge,
                xi,
            } = highest;
            let point = self.point(edge, xi);
            let mut gradient = Gradient::zero(system);
            let reached = system.law(&point).phi(system.slip(self.v, &point)).abs();
            let (bound, pressures) = (stress.abs() / reached, &self.forces.pressures);
            // where stick ends σ_t is the bound: by rounding the peak may lie on either side of that place
            if reached >= WHOLE_BOUND {
                gradient.add_bound(system, state, pressures, &point, 1.0);
            } else if bound.is_finite() {
                gradient.add_traction(system, state, pressures, bound, &point, 1.0);
            }
            let at_sharp_ends = self.traction_at_sharp_ends(highest, reached);
            found.push(Quantity {
                spacing: stress.abs() * self.turn_around(edge, xi),
                spacing_at: vec![(edge, 1.0)],
                between: self.change_of_bound(edge, xi),
                between_at: vec![(edge, 1.0)],
                unresolved: self.unresolved_bound(highest)
                    + self.ripple_at(highest)
                    + self.bound_of_parabolas(stress),
                sharp_end: at_sharp_ends.iter().fold(0.0, |most, at| most.max(at.1)),
                sharp_end_at: at_sharp_ends,
                estimable: limited(!self.averages_nothing() || !self.pressure_without_limit()),
                ..self.quantity(QuantityName::PeakTangentialStress, stress, Some(gradient))
            });
        }
        found
    }

    /// Whether the pressure grows without limit: at a sharp end of the obstacle, where materials meet, or slowly at a
    /// kink.
    pub(super) fn pressure_without_limit(&self) -> bool {
        let sharp = |i: usize| self.active(i) && self.may_be_sharp(i);
        sharp(0) || sharp(self.count() - 1) || !self.kinks().is_empty() || self.junction().is_some()
    }

    /// Whether the friction bound follows the pressure itself instead of its average.
    pub(super) fn averages_nothing(&self) -> bool {
        let friction = self.patch.contact.friction.as_ref();
        friction.is_some_and(|law| law.bound.radius() == Some(0.0))
    }

    /// The ends of contact and of stick, as quantities. An end of contact is known only to the distance between nodes; an
    /// end of stick is where the slip equals ±ε, so that its error follows from that of the slip at this place.
    fn ends(&self) -> Vec<Quantity> {
        let ends = self.ends_of_contact().into_iter();
        let quantity = |end: EndOfContact| Quantity {
            spacing: end.spacing,
            truncation: end.truncation,
            displaced: self.displaced_end(end.node),
            spacing_at: vec![(end.edge, 1.0)],
            ..self.quantity(end.name, end.s, None)
        };
        let mut found: Vec<Quantity> = ends.map(quantity).collect();
        let mut turns: Vec<(usize, f64, f64)> = self
            .turns()
            .into_iter()
            .map(|(edge, xi)| (edge, xi, self.slope_of_slip(edge, xi)))
            .collect();
        let touches = |edge: usize| edge_nodes(edge).iter().all(|&i| self.active(i));
        let steady = self
            .patch
            .law
            .as_ref()
            .map_or(0.0, |law| STEADY * law.elastic_slip);
        turns.retain(|(edge, _, slope)| touches(*edge) && slope.abs() > steady);
        // as many as of the whole, of which this may be a half
        let most = MOST_STICK_ENDS / (1 + self.mirrored_ends());
        let few = turns.len() <= most && !self.alternates(&turns);
        turns.truncate(most);
        for (edge, xi, slope) in turns {
            let point = self.point(edge, xi);
            let arc = self.patch.contact.boundary.edge_arc(edge);
            let length = 0.5 * (arc[1] - arc[0]);
            let mut gradient = Gradient::zero(self.system);
            gradient.add_slip(self.system, &point, 1.0);
            found.push(Quantity {
                factor: length / slope,
                spacing: length.abs(),
                spacing_at: vec![(edge, 1.0)],
                estimable: if few {
                    Estimable::Yes
                } else {
                    Estimable::TooMany
                },
                ..self.quantity(QuantityName::StickEnd, point.s, few.then_some(gradient))
            });
        }
        if few {
            let at_nodes = self.stick_ends_at_nodes(&found);
            found.extend(at_nodes);
        }
        found
    }

    /// Whether the body sticks, between slip to one and the same side, or slips, between parts that stick, on less than the length of
    /// an edge: another mesh has it elsewhere, or not at all. `turns`: the ends of stick, in order.
    fn alternates(&self, turns: &[(usize, f64, f64)]) -> bool {
        let boundary = &self.patch.contact.boundary;
        let at = |(edge, xi, _): &(usize, f64, f64)| {
            let arc = boundary.edge_arc(*edge);
            let side = self.slip_at(*edge, *xi) > 0.0;
            (
                edge3::interpolate(&edge3::shape(*xi), &arc),
                side,
                arc[1] - arc[0],
            )
        };
        let mut places: Vec<(f64, bool, f64)> = turns.iter().map(at).collect();
        places.sort_by(|a, b| a.0.total_cmp(&b.0));
        places.windows(2).any(|pair| {
            let ((start, side, length), (end, other, _)) = (pair[0], pair[1]);
            side == other && end > start && end - start < length
        })
    }

    /// The ends of stick that are no place where the slip passes ε: at a node the slip reaches ε, and stays there. `known`:
    /// the other ends.
    fn stick_ends_at_nodes(&self, known: &[Quantity]) -> Vec<Quantity> {
        let s = &self.patch.contact.boundary.s;
        let summary = self.summary();
        let of_contact = |end: f64| summary.contact.iter().flatten().any(|other| *other == end);
        let mut found = Vec::new();
        for end in summary
            .stick
            .iter()
            .flatten()
            .filter(|end| !of_contact(**end))
        {
            let Some(node) = s.iter().position(|s| s == end) else {
                continue;
            };
            let to_next = s.get(node + 1).map_or(0.0, |next| next - end);
            let spacing = node
                .checked_sub(1)
                .map_or(to_next, |before| to_next.max(end - s[before]));
            let near =
                |q: &Quantity| q.name == QuantityName::StickEnd && (q.value - end).abs() <= spacing;
            if !known.iter().any(near) {
                let edge = (node / 2).min(self.patch.contact.boundary.edge_count() - 1);
                found.push(Quantity {
                    unresolved: spacing,
                    spacing_at: vec![(edge, 1.0)],
                    between_at: vec![(edge, 1.0)],
                    ..self.quantity(QuantityName::StickEnd, *end, None)
                });
            }
        }
        found
    }

    /// The derivative de/dξ of the slip e along an edge, at ξ.
    fn slope_of_slip(&self, edge: usize, xi: f64) -> f64 {
        let step = 1e-4;
        (self.slip_at(edge, xi + step) - self.slip_at(edge, xi - step)) / (2.0 * step)
    }

    /// The starts and ends of all intervals of contact.
    pub(super) fn ends_of_contact(&self) -> Vec<EndOfContact> {
        let s = &self.patch.contact.boundary.s;
        let last = self.count() - 1;
        let mut found = Vec::new();
        for i in (0..=last).filter(|i| self.active(*i)) {
            if i == 0 || !self.active(i - 1) {
                found.push(EndOfContact {
                    name: QuantityName::ContactStart,
                    node: i,
                    s: s[i],
                    truncation: if i == 0 { self.left_out(0) } else { 0.0 },
                    spacing: match i {
                        0 => self.open_before_end(0, 1),
                        _ => s[i] - s[i - 1],
                    },
                    edge: i.saturating_sub(1) / 2,
                });
            }
            if i == last || !self.active(i + 1) {
                found.push(EndOfContact {
                    name: QuantityName::ContactEnd,
                    node: i,
                    s: s[i],
                    truncation: if i == last { self.left_out(last) } else { 0.0 },
                    spacing: if i == last {
                        self.open_before_end(last, last - 1)
                    } else {
                        s[i + 1] - s[i]
                    },
                    edge: i.min(last - 1) / 2,
                });
            }
        }
        found
    }

    /// How far before the end of the boundary contact may end (length): where the pressure falls towards the end, contact may
    /// end between the two outermost nodes; 0 where the pressure shows that it reaches the end. `end`: the last node of the
    /// boundary; `beside`: the node beside it.
    fn open_before_end(&self, end: usize, beside: usize) -> f64 {
        let goes_on = self.symmetric(end) || self.patch.contact.condition == Condition::Bonded;
        if goes_on || self.pressure(end) >= REACHES_END * self.pressure(beside) {
            return 0.0;
        }
        let s = &self.patch.contact.boundary.s;
        (s[end] - s[beside]).abs()
    }

    /// Whether contact ends before the end of the boundary, although its last node touches: the pressure there is next to
    /// nothing.
    pub(super) fn ends_before(&self, end: usize, beside: usize) -> bool {
        self.open_before_end(end, beside) > 0.0
            && self.pressure(end) < NEXT_TO_NOTHING * self.pressure(beside)
    }

    /// A point for evaluating the law at the place ξ of an edge, with the anchor interpolated there.
    fn point(&self, edge: usize, xi: f64) -> Point {
        let shape = edge3::shape(xi);
        let s = edge3::interpolate(&shape, &self.patch.contact.boundary.edge_arc(edge));
        let nodes = edge_nodes(edge).map(|i| self.patch.first + i);
        let anchor = edge3::interpolate(&shape, &self.anchors[edge]);
        self.system.probe(self.p, s, nodes, shape, anchor)
    }
}
