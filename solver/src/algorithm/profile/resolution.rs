//! What the distances between nodes, and between the points where friction acts, leave open in the quantities of a
//! contact: parts of the errors that are stated, beside those by recovery.

use std::collections::BTreeSet;

use super::PatchView;
use crate::contact::edge_nodes;
use crate::element::edge3;
use crate::element::gauss::GAUSS_3;
use crate::friction::BoundLaw;

/// Halvings of an edge in the search for a jump: to 1/256 of a quarter of it.
const HALVINGS: u32 = 8;

/// What a kink leaves open in the friction force, as a part of that on the edges beside it: calibrated.
const AT_KINKS: f64 = 0.2;

impl PatchView<'_> {
    /// A value at ξ of an edge, which may lie on one of its neighbours.
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

    /// p at a place.
    pub(super) fn pressure_at(&self, edge: usize, xi: f64) -> f64 {
        edge3::interpolate(
            &edge3::shape(xi),
            &edge_nodes(edge).map(|i| self.pressure(i)),
        )
    }

    /// An edge and those beside it.
    pub(super) fn neighbours(&self, edge: usize) -> std::ops::RangeInclusive<usize> {
        let last = self.patch.contact.boundary.edge_count() - 1;
        edge.saturating_sub(1)..=(edge + 1).min(last)
    }

    /// The length of an edge times its depth: ∫ ds.
    pub(super) fn weight(&self, edge: usize) -> f64 {
        let places = &self.patch.contact.boundary.friction_points[3 * edge..3 * edge + 3];
        places.iter().map(|place| place.weight).sum()
    }

    /// How far σ_t jumps within a small part of an edge (stress). Beside a jump the pressure grows like the logarithm of
    /// the distance, down to the length over which σ_t changes: the change over the steepest half, the steepest quarter
    /// and so on, added up, is the jump times the logarithm of what part of the edge it takes.
    pub(super) fn jump_within(&self, edge: usize) -> f64 {
        let stress = |xi: f64| self.tangential_stress_at(edge, xi);
        let steepest = |quarter: u32| {
            let start = 0.5 * f64::from(quarter) - 1.0;
            let (mut low, mut high) = ((start, stress(start)), (start + 0.5, stress(start + 0.5)));
            let mut sum = (high.1 - low.1).abs();
            for _ in 0..HALVINGS {
                let place = 0.5 * (low.0 + high.0);
                let middle = (place, stress(place));
                if (middle.1 - low.1).abs() > (high.1 - middle.1).abs() {
                    high = middle;
                } else {
                    low = middle;
                }
                sum += (high.1 - low.1).abs();
            }
            sum
        };
        (0..4).map(steepest).fold(0.0, f64::max)
    }

    /// How much τ changes over half an edge on either side of a place (stress): a peak of σ_t is where stick ends, and
    /// moves with it.
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

    /// What is left open in the friction force, with its edges (force, without 2π): cohesion acts up to the end of the
    /// contact, which lies between two nodes; at a kink of the obstacle the pressure has no limit; and no friction point may
    /// feel that a part sticks ([`Self::unseen_stick`]).
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

    /// What kinks leave open, by the edges beside them (force, without 2π). How a kink lies between the nodes makes friction
    /// too large or too small: what several edges with kinks leave open adds up like the parts of a random sum.
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

    /// Where the motion turns, a part of the contact sticks. If all of it lies between two points where friction acts, or
    /// between a line of symmetry and the first of them, none feels it: the friction there, by edges (force, without 2π).
    fn unseen_stick(&self) -> Vec<(usize, f64)> {
        let Some(law) = &self.patch.law else {
            return Vec::new();
        };
        let own = self.system.points.iter().zip(&self.finished.tractions);
        let own = own.filter(|(point, _)| point.patch == self.p);
        let mut points: Vec<(f64, f64, bool)> = own
            .map(|(point, traction)| {
                let slips = self.system.slip(self.v, point).abs() >= law.elastic_slip;
                (point.s, *traction, slips)
            })
            .collect();
        let last = self.count() - 1;
        let s = &self.patch.contact.boundary.s;
        if let (true, Some(first)) = (self.symmetric(0), points.first().copied()) {
            points.insert(0, (2.0 * s[0] - first.0, -first.1, first.2));
        }
        if let (true, Some(end)) = (self.symmetric(last), points.last().copied()) {
            points.push((2.0 * s[last] - end.0, -end.1, end.2));
        }
        let mut found = Vec::new();
        for pair in points.windows(2) {
            let [(from, a, slips), (to, b, slips_too)] = [pair[0], pair[1]];
            if slips && slips_too && a * b < 0.0 {
                let (from, to) = (from.max(s[0]), to.min(s[last]));
                let edge = s
                    .partition_point(|node| *node < to)
                    .saturating_sub(1)
                    .min(last - 1)
                    / 2;
                let length = s[2 * edge + 2] - s[2 * edge];
                let weight = self.weight(edge) * (to - from) / length;
                found.push((edge, 0.5 * (a - b).abs() * weight));
            }
        }
        found
    }

    /// ∫|σ_t| over an edge (force, without 2π).
    fn friction_on(&self, edge: usize) -> f64 {
        self.weight(edge) * mean(|xi| self.tangential_stress_at(edge, xi).abs())
    }

    /// What the points where friction acts leave out: the differences of ∫σ_t over each edge, by the points and by many
    /// more (force, without 2π).
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
            let few = match self.at_gauss_points() {
                true => GAUSS_3
                    .iter()
                    .map(|(xi, w)| 0.5 * w * stress(*xi))
                    .sum::<f64>(),
                false => (stress(-1.0) + 4.0 * stress(0.0) + stress(1.0)) / 6.0,
            };
            differences.push(weight * (many - few));
        }
        differences
    }
}

/// The mean of a value over an edge, by many places.
fn mean(value: impl Fn(f64) -> f64) -> f64 {
    const SAMPLES: usize = 16;
    let sample = |k: usize| value(-1.0 + (2 * k + 1) as f64 / SAMPLES as f64);
    (0..SAMPLES).map(sample).sum::<f64>() / SAMPLES as f64
}
