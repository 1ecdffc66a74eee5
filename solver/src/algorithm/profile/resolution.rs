//! Errors of a contact's quantities due to the distances between nodes and between friction points. They are added to
//! the errors by recovery.

use std::collections::BTreeSet;

use super::quantities::WHOLE_BOUND;
use super::{Highest, PatchView};
use crate::contact::edge_nodes;
use crate::element::edge3;
use crate::element::gauss::GAUSS_3;
use crate::friction::BoundLaw;
use crate::problem::Condition;

/// The number of halvings of a quarter of an edge in the search for a jump: down to 1/256 of the quarter.
const HALVINGS: u32 = 8;

/// The number of equal parts of an edge between which σ_t is sampled in that search.
const EDGE_PARTS: usize = 40;

/// The parts at which the quarters of an edge begin in that search. They overlap. The middle of the edge, where a
/// symmetric problem has its jump, is neither the middle nor an end of any of them: there the jump would be halved.
const QUARTERS: [usize; 6] = [0, 6, 12, 18, 24, 30];

/// The largest number of edges with ends of stick, those under the largest pressure, at which a peak is looked for that the
/// mesh does not show: one at every end of a rough obstacle would take long.
const MOST_TURNS: usize = 4;

/// The number of nodes around the peak of the pressure through which a smooth curve is laid. Of curves through five and
/// through seven nodes, a cubic through seven agrees best with the errors of random problems
/// (`tests/verification/catalogue.rs`).
const AROUND: usize = 7;

/// The number of coefficients of a cubic.
const CUBIC: usize = 4;

/// The distance from a peak of σ_t, in half edges, within which the direction of friction may change; calibrated.
const TURN_REACH: f64 = 0.75;

/// The part of the change of friction from full slip to opposite slip that friction points resolve; calibrated.
const FOLLOWED: f64 = 0.3;

/// The largest number of friction points that stick in a row at a turn of the motion, and do not resolve it.
const FEW_STICK: usize = 3;

/// The error of the friction force where a part sticks between friction points, as a part of the friction between two of them;
/// calibrated.
const UNSEEN_STICK: f64 = 1.2;

/// What a jump of σ_t at a node takes from the tangential force of a bonded contact, as a part of the largest σ_t on an edge beside it
/// times the length of the edge: wedges show 0.22 (`tests/verification/bonded_wedges.rs`).
const OF_JUMP: f64 = 0.3;

/// The error of the friction force at a kink, as a part of the friction force on the edges beside the kink; calibrated.
const AT_KINKS: f64 = 0.2;

/// The least error of the friction force on an edge at a sharp end, as a part of this force: as much as flat punches show
/// (`tests/verification/sharp_ends.rs`).
const AT_SHARP_END: f64 = 0.07;

/// The least error of a peak of σ_t at a sharp end where the body sticks, as a part of the change of σ_t along the edge there: as
/// much as flat punches show (`tests/verification/sharp_ends.rs`).
const CUSP: f64 = 0.65;

/// The least error of a peak of σ_t that is the bound at a sharp end, as a part of itself, for a length of the edge there in nonlocal
/// radii: as much as flat punches show (`tests/verification/sharp_ends.rs`).
const OF_LAST_EDGE: f64 = 2.5;

/// The largest such error, as a part of the peak: on edges as long as the radius the bound is known to that.
const MOST_OF_BOUND: f64 = 0.2;

/// How near to a sharp end, in nonlocal radii, a peak is that the pressure at the end decides.
const NEAR_END: f64 = 0.1;

impl PatchView<'_> {
    /// A value at ξ of an edge; a ξ beyond −1 … 1 is a place on the neighbouring edge.
    pub(super) fn along(
        &self,
        edge: usize,
        xi: f64,
        value: impl Fn(&Self, usize, f64) -> f64,
    ) -> f64 {
        let last = self.patch.contact.boundary.edge_count() - 1;
        match xi {
            _ if xi < -1.0 && edge > 0 => value(self, edge - 1, xi + 2.0),
            _ if xi > 1.0 && edge < last => value(self, edge + 1, xi - 2.0),
            _ => value(self, edge, xi.clamp(-1.0, 1.0)),
        }
    }

    /// The distance of the largest pressure from the peak of a smooth curve (stress): a cubic by least squares through
    /// the [`AROUND`] nearest nodes in contact, mirror images included. The whole pressure if there are too few nodes
    /// for a cubic.
    pub(super) fn off_smooth_pressure(&self, largest: f64, edge: usize, xi: f64) -> f64 {
        let arc = self.patch.contact.boundary.edge_arc(edge);
        let peak = edge3::interpolate(&edge3::shape(xi), &arc);
        let mut nodes = self.pressed_nodes_near(edge);
        let distance = |node: &[f64; 3]| (node[0] - peak).abs();
        nodes.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
        nodes.truncate(AROUND);
        let reach = nodes.last().map_or(0.0, distance);
        if nodes.len() < CUBIC || reach == 0.0 {
            return largest.abs();
        }
        let within: Vec<[f64; 3]> = nodes
            .iter()
            .map(|[s, pressure, weight]| [(s - peak) / reach, *pressure, *weight])
            .collect();
        (highest_of_cubic(&within) - largest).abs()
    }

    /// Arc length, pressure and weight (the length of the boundary that belongs to it) of each node in contact on the
    /// edges near `edge`, including nodes beyond a line of symmetry.
    fn pressed_nodes_near(&self, edge: usize) -> Vec<[f64; 3]> {
        let s = &self.patch.contact.boundary.s;
        let last = self.count() - 1;
        let nodes = 2 * edge.saturating_sub(AROUND / 2)..=(2 * (edge + 1 + AROUND / 2)).min(last);
        let mirrors: Vec<usize> = [0, last]
            .into_iter()
            .filter(|end| self.symmetric(*end))
            .collect();
        let mut found = Vec::new();
        for i in nodes.filter(|i| self.active(*i)) {
            // ∫ h_i
            let weight = match i % 2 {
                1 => 4.0 * (s[i + 1] - s[i - 1]),
                _ => s[(i + 2).min(last)] - s[i.saturating_sub(2)],
            };
            let mut weight = weight / 6.0;
            for end in &mirrors {
                if i == *end {
                    weight *= 2.0;
                } else {
                    found.push([2.0 * s[*end] - s[i], self.pressure(i), weight]);
                }
            }
            found.push([s[i], self.pressure(i), weight]);
        }
        found
    }

    /// The part of the change of friction from full slip to opposite slip that happens around a place, without what the
    /// points there resolve: between them u_t is a parabola, and a peak of σ_t may be due to that parabola.
    pub(super) fn turn_around(&self, edge: usize, xi: f64) -> f64 {
        const STEPS: i32 = 6;
        let Some(law) = &self.patch.law else {
            return 0.0;
        };
        let at = |k: i32| xi + TURN_REACH * f64::from(k) / f64::from(STEPS);
        let ratios = (-STEPS..=STEPS).map(|k| law.phi(self.along(edge, at(k), Self::slip_at)));
        let (low, high) = ratios.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), phi| {
            (low.min(phi), high.max(phi))
        });
        (0.5 * (high - low) - FOLLOWED).max(0.0)
    }

    /// The numbers of an edge and its neighbours.
    pub(super) fn neighbours(&self, edge: usize) -> std::ops::RangeInclusive<usize> {
        let last = self.patch.contact.boundary.edge_count() - 1;
        edge.saturating_sub(1)..=(edge + 1).min(last)
    }

    /// The length of an edge times its depth: ∫ ds.
    pub(super) fn weight(&self, edge: usize) -> f64 {
        let places = &self.patch.contact.boundary.friction_points[3 * edge..3 * edge + 3];
        places.iter().map(|place| place.weight).sum()
    }

    /// The jump of σ_t within a small part of an edge, times a logarithm (stress). Beside a jump the pressure grows
    /// like the logarithm of the distance, down to the length over which σ_t changes. Here the changes over the
    /// steepest half, the steepest quarter and so on are added, which gives the jump times the logarithm of the part of
    /// the edge that it takes. Twice: from a quarter of the edge on; and from the whole edge on, without what a steady
    /// change has of that sum.
    pub(super) fn jump_within(&self, edge: usize) -> (f64, f64) {
        let stress = |xi: f64| self.tangential_stress_at(edge, xi);
        let place = |k: usize| (2.0 * k as f64 - EDGE_PARTS as f64) / EDGE_PARTS as f64;
        let sampled: Vec<f64> = (0..=EDGE_PARTS).map(|k| stress(place(k))).collect();
        let variation = |from: usize, length: usize| -> f64 {
            let steps = sampled[from..=from + length].windows(2);
            steps.map(|pair| (pair[1] - pair[0]).abs()).sum()
        };
        let steepest = |from: usize| {
            let [mut low, mut high] = [from, from + EDGE_PARTS / 4].map(|k| (place(k), sampled[k]));
            let mut sum = (high.1 - low.1).abs();
            for _ in 0..HALVINGS {
                let middle = 0.5 * (low.0 + high.0);
                let middle = (middle, stress(middle));
                if (middle.1 - low.1).abs() > (high.1 - middle.1).abs() {
                    high = middle;
                } else {
                    low = middle;
                }
                sum += (high.1 - low.1).abs();
            }
            let around = from.saturating_sub(EDGE_PARTS / 8).min(EDGE_PARTS / 2);
            // the whole edge, a half, a quarter and so on, without twice the whole: a steady change gives nothing
            let jumps = variation(around, EDGE_PARTS / 2) + sum - variation(0, EDGE_PARTS);
            (sum, jumps.max(0.0))
        };
        let larger = |a: (f64, f64), b: (f64, f64)| (a.0.max(b.0), a.1.max(b.1));
        QUARTERS.map(steepest).into_iter().fold((0.0, 0.0), larger)
    }

    /// The pressure that jumps of σ_t on an edge and its neighbours add at the jump, and the mesh does not resolve (stress):
    /// (β/π) q ln 2 for each halving in which the jump q stays whole. Beyond a line of symmetry the jump goes on, which makes
    /// it twice that; around an axis it goes on in all directions, which makes it π times that.
    pub(super) fn pressure_at_jumps(&self, edge: usize) -> f64 {
        let last = self.patch.contact.boundary.edge_count() - 1;
        let at = |edge: usize| {
            let node = 2 * edge + 1;
            let ends = [(0, 0), (last, 2 * last + 2)].into_iter();
            let own = ends.filter(|(of, _)| *of == edge);
            let around = own.map(|(_, end)| match self.symmetric(end) {
                true if self.on_axis(end) => std::f64::consts::PI,
                true => 2.0,
                false => 1.0,
            });
            let coupling = self.system.model.section.coupling(self.material(node));
            around.fold(1.0, f64::max) * coupling * std::f64::consts::LN_2 / std::f64::consts::PI
                * self.jump_within(edge).1
        };
        // where the motion turns at a node, each of the two edges there has half of the jump
        self.neighbours(edge).map(at).sum()
    }

    /// What that pressure adds to the bound τ at a place of an edge, averaged over the nonlocal radius (stress).
    pub(super) fn bound_at_jumps(&self, edge: usize, xi: f64) -> f64 {
        let Some(BoundLaw::Pressure { average, .. }) =
            self.patch.law.as_ref().map(|law| &law.bound)
        else {
            return 0.0;
        };
        let arc = self.patch.contact.boundary.edge_arc(edge);
        let seen = ((arc[1] - arc[0]) / average.radius()).min(1.0);
        let s = edge3::interpolate(&edge3::shape(xi), &arc);
        let (averaged, bound) = self.averaged_and_bound(s);
        if averaged > 0.0 {
            seen * self.pressure_at_jumps(edge) * bound / averaged
        } else {
            0.0
        }
    }

    /// What jumps of σ_t may add to a peak of the pressure (stress): at the peak, or at another place where stick ends, whose
    /// own peak the mesh does not show.
    pub(super) fn unresolved_pressure(&self, Highest { value, edge, .. }: Highest) -> f64 {
        let there = self.turns_under_pressure().into_iter();
        let there =
            there.map(|(turn, _, pressure)| pressure + self.pressure_at_jumps(turn) - value);
        there.fold(self.pressure_at_jumps(edge), f64::max)
    }

    /// What jumps of σ_t add to the bound τ at the place of a peak of σ_t, or at another place where stick ends, over the peak
    /// (stress).
    pub(super) fn unresolved_bound(&self, Highest { value, edge, xi }: Highest) -> f64 {
        let there = self.turns_under_pressure().into_iter();
        let there = there.map(|(turn, xi, _)| {
            let reached = self.tangential_stress_at(turn, xi).abs();
            reached + self.bound_at_jumps(turn, xi) - value.abs()
        });
        there.fold(self.bound_at_jumps(edge, xi), f64::max)
    }

    /// The least error of the friction force on the edges at sharp ends, where the pressure, of which friction is an average, is known
    /// only roughly, by edge (force, without 2π).
    pub(super) fn friction_at_sharp_ends(&self) -> Vec<(usize, f64)> {
        let on_edge = |edge: usize| {
            let [start, end, _] = self.patch.contact.boundary.edge_arc(edge);
            let points = self.system.points.iter().zip(&self.finished.tractions);
            let own = points
                .filter(|(point, _)| point.patch == self.p && (start..=end).contains(&point.s));
            let friction: f64 = own
                .map(|(point, stress)| (point.weight * stress).abs())
                .sum();
            (edge, AT_SHARP_END * self.growth_at_end(edge) * friction)
        };
        self.sharp_ends().into_iter().map(on_edge).collect()
    }

    /// The least error of a peak of σ_t at sharp ends, by edge at such an end (stress): the largest counts. Where the body sticks, slip
    /// grows like a root of the distance, which no element follows; where it slips, the peak is the bound. `reached`: σ_t as a part of
    /// the friction bound.
    pub(super) fn traction_at_sharp_ends(
        &self,
        Highest { value, edge, xi }: Highest,
        reached: f64,
    ) -> Vec<(usize, f64)> {
        if reached >= WHOLE_BOUND {
            return self.bound_at_sharp_ends(value, edge, xi);
        }
        if !self.sharp_ends().contains(&edge) {
            return Vec::new();
        }
        let last = self.count() - 1;
        let inner = if edge == 0 { 1.0 } else { -1.0 };
        let inner = self.tangential_stress_at(edge, inner).abs();
        let end = if edge == 0 { 0 } else { last };
        let bound = self.averaged_and_bound_at_nodes()[end].1;
        let room = (bound.max(value.abs() / reached) - value.abs()).max(0.0);
        vec![(edge, (CUSP * (value.abs() - inner).max(0.0)).min(room))]
    }

    /// The least error of a peak of σ_t that is the friction bound, near sharp ends (stress): most of the average is the pressure
    /// of the edge at the end, whose place the mesh does not know.
    fn bound_at_sharp_ends(&self, value: f64, edge: usize, xi: f64) -> Vec<(usize, f64)> {
        let radius = self.patch.law.as_ref().and_then(|law| law.bound.reach());
        let Some(radius) = radius.filter(|radius| *radius > 0.0) else {
            return Vec::new();
        };
        let boundary = &self.patch.contact.boundary;
        let s = edge3::interpolate(&edge3::shape(xi), &boundary.edge_arc(edge));
        let of_end = |at: usize| {
            let [start, end, _] = boundary.edge_arc(at);
            let length = end - start;
            let place = if at == 0 { start } else { end };
            // longer edges are warned of
            let near = length <= radius && (s - place).abs() <= length.max(NEAR_END * radius);
            let part = (OF_LAST_EDGE * self.growth_at_end(at) * length / radius).min(MOST_OF_BOUND);
            near.then_some((at, value.abs() * part))
        };
        self.sharp_ends().into_iter().filter_map(of_end).collect()
    }

    /// How much the pressure grows along an edge towards the end of the boundary, as a part of the pressure at the other end of the
    /// edge, 0 … 1: at a corner of the body it may hardly grow.
    fn growth_at_end(&self, edge: usize) -> f64 {
        let [start, end, _] = edge_nodes(edge).map(|i| self.pressure(i));
        let (inner, outer) = if edge == 0 {
            (end, start)
        } else {
            (start, end)
        };
        ((outer - inner) / inner.max(f64::MIN_POSITIVE)).clamp(0.0, 1.0)
    }

    /// The edges at the ends of the boundary up to which contact reaches, and where its pressure has no limit.
    fn sharp_ends(&self) -> Vec<usize> {
        let last = self.count() - 1;
        let sharp = |i: &usize| self.active(*i) && self.may_be_sharp(*i);
        let ends = [0, last].into_iter().filter(sharp);
        ends.map(|i| i.saturating_sub(1) / 2).collect()
    }

    /// The edges with ends of stick, each with the place of one on it and the largest pressure at its nodes; if there are
    /// many, those with the largest pressure.
    fn turns_under_pressure(&self) -> Vec<(usize, f64, f64)> {
        let mut turns = self.turns();
        turns.dedup_by_key(|(edge, _)| *edge);
        let largest = |edge: usize| {
            edge_nodes(edge)
                .map(|i| self.pressure(i))
                .into_iter()
                .fold(0.0, f64::max)
        };
        let mut turns: Vec<(usize, f64, f64)> = turns
            .into_iter()
            .map(|(edge, xi)| (edge, xi, largest(edge)))
            .collect();
        turns.sort_by(|a, b| b.2.total_cmp(&a.2));
        turns.truncate(MOST_TURNS);
        turns
    }

    /// The larger change of τ over half an edge on either side of a place (stress): a peak of σ_t is at an end of stick
    /// and moves with that end.
    pub(super) fn change_of_bound(&self, edge: usize, xi: f64) -> f64 {
        let bound = |view: &Self, edge: usize, xi: f64| {
            let arc = view.patch.contact.boundary.edge_arc(edge);
            let s = edge3::interpolate(&edge3::shape(xi), &arc);
            view.averaged_and_bound(s).1
        };
        let here = bound(self, edge, xi);
        let change = |xi: f64| (self.along(edge, xi, bound) - here).abs();
        change(xi - 1.0).max(change(xi + 1.0))
    }

    /// The error of the friction force by edge (force, without 2π). Cohesion acts up to the end of the contact, which
    /// lies between two nodes; at a kink of the obstacle the pressure has no limit; and a part that sticks may lie
    /// between the friction points ([`Self::unseen_stick`]).
    pub(super) fn open_friction(&self) -> Vec<(usize, f64)> {
        let Some(law) = &self.patch.law else {
            return Vec::new();
        };
        let mut found = Vec::new();
        if let BoundLaw::Pressure { cohesion, .. } = &law.bound
            && *cohesion > 0.0
        {
            let s = &self.patch.contact.boundary.s;
            for end in self.ends_of_contact() {
                let length = s[2 * end.edge + 2] - s[2 * end.edge];
                let weight = self.weight(end.edge) * end.spacing / length;
                found.push((end.edge, cohesion * weight));
            }
        }
        found.extend(self.open_at_kinks());
        found.extend(self.unseen_stick());
        found
    }

    /// The error of the friction force at kinks, by the edges beside them (force, without 2π). A kink makes friction
    /// too large or too small, depending on the kink's place between nodes, so that the errors of several edges add up
    /// like random numbers.
    fn open_at_kinks(&self) -> Vec<(usize, f64)> {
        let with_kinks: BTreeSet<usize> = self.kinks().iter().map(|kink| kink.edge).collect();
        let beside: BTreeSet<usize> = with_kinks
            .iter()
            .flat_map(|e| self.neighbours(*e))
            .collect();
        let part = AT_KINKS / (with_kinks.len().max(1) as f64).sqrt();
        let open = |edge: usize| (edge, part * self.friction_on(edge));
        beside.into_iter().map(open).collect()
    }

    /// The error of the tangential force of a bonded contact at kinks of its obstacle, by the edges beside them (force, without 2π):
    /// there σ_t jumps from one side to the other, and is zero at a node on the kink.
    pub(super) fn bonded_at_kinks(&self) -> Vec<(usize, f64)> {
        let contact = self.patch.contact;
        if contact.condition != Condition::Bonded {
            return Vec::new();
        }
        let last = self.count() - 1;
        let places = contact.places.iter().filter(|place| place.kink != 0.0);
        let mut beside: BTreeSet<usize> = places
            .flat_map(|place| self.neighbours(place.edge))
            .collect();
        for (end, slope) in [(0, contact.end_slopes[0]), (last, contact.end_slopes[1])] {
            if slope != 0.0 && self.symmetric(end) {
                beside.insert(end.saturating_sub(1) / 2);
            }
        }
        let jump = |edge: usize| {
            let stresses = [-1.0, 0.0, 1.0].map(|xi| self.tangential_stress_at(edge, xi).abs());
            (
                edge,
                OF_JUMP * self.weight(edge) * stresses.into_iter().fold(0.0, f64::max),
            )
        };
        beside.into_iter().map(jump).collect()
    }

    /// By edge, the friction on parts that stick where the motion turns, if few friction points are inside (force, without
    /// 2π): the part lies between two friction points, or between a line of symmetry and the first point; or it ends
    /// somewhere between one of few points that stick and the next one.
    fn unseen_stick(&self) -> Vec<(usize, f64)> {
        let Some(law) = &self.patch.law else {
            return Vec::new();
        };
        let own = self.system.points.iter().zip(&self.finished.tractions);
        let own = own.filter(|(point, _)| point.patch == self.p);
        let mut points: Vec<(f64, f64, bool)> = own
            .map(|(point, traction)| {
                let slips = !law.sticks(self.system.slip(self.v, point));
                (point.s, *traction, slips)
            })
            .collect();
        let last_node = self.count() - 1;
        let s = &self.patch.contact.boundary.s;
        // beyond a line of symmetry: images of the points up to the first one that slips
        let slips = |point: &(f64, f64, bool)| point.2;
        for (node, backwards) in [(0, false), (last_node, true)] {
            if !self.symmetric(node) {
                continue;
            }
            if backwards {
                points.reverse();
            }
            let first = points.iter().position(slips).unwrap_or(points.len());
            let near = points
                .iter()
                .take(first + 1)
                .filter(|point| point.0 != s[node]);
            let images: Vec<_> = near.map(|p| (2.0 * s[node] - p.0, -p.1, p.2)).collect();
            points.splice(0..0, images.into_iter().rev());
            if backwards {
                points.reverse();
            }
        }
        let mut found = Vec::new();
        let slipping: Vec<usize> = (0..points.len()).filter(|i| points[*i].2).collect();
        for pair in slipping.windows(2) {
            let (first, last) = (points[pair[0]], points[pair[1]]);
            let inside = pair[1] - pair[0] - 1;
            if inside > FEW_STICK || first.1 * last.1 >= 0.0 {
                continue;
            }
            let part = UNSEEN_STICK / (inside + 1) as f64;
            for steps in points[pair[0]..=pair[1]].windows(2) {
                let [(from, a, _), (to, b, _)] = [steps[0], steps[1]];
                let (from, to) = (from.max(s[0]), to.min(s[last_node]));
                if to <= from {
                    continue;
                }
                let after = s.partition_point(|node| *node < to).saturating_sub(1);
                let edge = after.min(last_node - 1) / 2;
                let length = s[2 * edge + 2] - s[2 * edge];
                let weight = self.weight(edge) * (to - from) / length;
                found.push((edge, part * (a - b).abs() * weight));
            }
        }
        found
    }

    /// The friction ∫|σ_t| over an edge (force, without 2π).
    fn friction_on(&self, edge: usize) -> f64 {
        self.weight(edge) * mean(|xi| self.tangential_stress_at(edge, xi).abs())
    }

    /// By edge, the error of the friction force because the law is evaluated at the friction points only: the
    /// difference between ∫σ_t by many more points and by these points (force, without 2π).
    pub(super) fn between_points(&self) -> Vec<f64> {
        let boundary = &self.patch.contact.boundary;
        if self.patch.law.is_none() {
            return Vec::new();
        }
        let mut differences = Vec::with_capacity(boundary.edge_count());
        for (edge, places) in boundary.friction_points.chunks(3).enumerate() {
            let weight: f64 = places.iter().map(|place| place.weight).sum();
            let stress = |xi: f64| self.tangential_stress_at(edge, xi);
            let many = mean(stress);
            let few = if self.at_gauss_points() {
                GAUSS_3
                    .iter()
                    .map(|(xi, w)| 0.5 * w * stress(*xi))
                    .sum::<f64>()
            } else {
                (stress(-1.0) + 4.0 * stress(0.0) + stress(1.0)) / 6.0
            };
            differences.push(weight * (many - few));
        }
        differences
    }
}

/// The largest value of a cubic through points by least squares, within half of the reach of the points. Each point has
/// a place between −1 and 1, a value, and a weight.
fn highest_of_cubic(points: &[[f64; 3]]) -> f64 {
    const SAMPLES: usize = 41;
    let sample = |k: usize| -0.5 + k as f64 / (SAMPLES - 1) as f64;
    let places: Vec<f64> = points
        .iter()
        .map(|point| point[0])
        .chain((0..SAMPLES).map(sample))
        .collect();
    // Gram and Schmidt: polynomials orthogonal on the points, evaluated at the samples too
    let product = |a: &[f64], b: &[f64]| -> f64 {
        let terms = points.iter().zip(a).zip(b);
        terms.map(|((point, a), b)| point[2] * a * b).sum()
    };
    let mut rest: Vec<f64> = points.iter().map(|point| point[1]).collect();
    let mut curve = vec![0.0; SAMPLES];
    let mut basis: Vec<Vec<f64>> = Vec::new();
    for degree in 0..CUBIC {
        let mut next: Vec<f64> = places.iter().map(|x| x.powi(degree as i32)).collect();
        for other in &basis {
            let part = product(&next, other) / product(other, other);
            next.iter_mut().zip(other).for_each(|(a, b)| *a -= part * b);
        }
        let part = product(&rest, &next) / product(&next, &next);
        rest.iter_mut().zip(&next).for_each(|(a, b)| *a -= part * b);
        let at_samples = curve.iter_mut().zip(&next[points.len()..]);
        at_samples.for_each(|(a, b)| *a += part * b);
        basis.push(next);
    }
    curve.into_iter().fold(f64::NEG_INFINITY, f64::max)
}

/// The mean of a value over an edge, from many places.
fn mean(value: impl Fn(f64) -> f64) -> f64 {
    const SAMPLES: usize = 16;
    let sample = |k: usize| value(-1.0 + (2 * k + 1) as f64 / SAMPLES as f64);
    (0..SAMPLES).map(sample).sum::<f64>() / SAMPLES as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_is_found_again_and_a_zigzag_is_smoothed() {
        let points = |value: &dyn Fn(f64, usize) -> f64| -> Vec<[f64; 3]> {
            let place = |k: usize| (k as f64 - 3.0) / 3.0;
            let point = |k: usize| [place(k), value(place(k), k), [1.0, 4.0][k % 2]];
            (0..7).map(point).collect()
        };
        // largest at x = ⅓, which lies between two of the samples
        let cubic = |x: f64, _: usize| 2.0 + x - x.powi(2) - x.powi(3);
        let highest = highest_of_cubic(&points(&cubic));
        let exact = cubic(1.0 / 3.0, 0);
        assert!(highest <= exact && highest > exact - 1e-3, "{highest}");
        let zigzag = |_: f64, k: usize| 1.0 + [0.1, -0.1][k % 2];
        let highest = highest_of_cubic(&points(&zigzag));
        assert!((0.9..1.05).contains(&highest), "{highest}");
    }
}
