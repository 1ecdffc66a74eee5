//! The quantities of a contact for which an error is stated, and what they depend on.

use super::PatchView;
use crate::algorithm::adjoint::Gradient;
use crate::algorithm::system::Point;
use crate::contact::edge_nodes;
use crate::element::edge3;
use crate::element::gauss::GAUSS_3;
use crate::solution::{Outcome, QuantityName};

/// A quantity of a contact.
pub struct Quantity {
    /// What it is.
    pub name: QuantityName,
    /// The contact, by its place in the model.
    pub patch: usize,
    /// Its value.
    pub value: f64,
    /// Its derivatives; none where only the place of the nodes matters.
    pub gradient: Option<Gradient>,
    /// Its error per change of what `gradient` is of; 1 but for the end of stick, which moves with the slip there.
    pub factor: f64,
    /// What the place of nodes and points alone leaves open, in the unit of the value.
    pub spacing: f64,
    /// What the law has between the points where friction acts, likewise.
    pub between: f64,
    /// No finer mesh approaches a limit of it.
    pub unlimited: bool,
    /// The obstacle reaches into the body between the nodes: what that changes is not known.
    pub unseen: bool,
}

/// Ends of stick with an error: each costs as much as another recovery of the stresses, and a rough obstacle has
/// hundreds.
const MOST_STICK_ENDS: usize = 8;

/// How far from a peak of σ_t its neighbourhood is looked at, in half edges.
const NEAR: f64 = 0.25;

impl PatchView<'_> {
    /// Forces, peaks and extents. None where σ_t does not follow from the law: in a false state of the thesis's own
    /// iteration.
    pub(in crate::algorithm) fn quantities(&self) -> Vec<Quantity> {
        if self.finished.own_tractions && self.finished.outcome != Outcome::Converged {
            return Vec::new();
        }
        let mut found = self.forces();
        found.extend(self.peaks());
        found.extend(self.ends());
        let unseen = !self.missed().is_empty();
        found
            .iter_mut()
            .for_each(|quantity| quantity.unseen = unseen);
        found
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
            unlimited: false,
            unseen: false,
        }
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
        let between = self.between_points();
        let quantity = |(name, value, gradient)| Quantity {
            factor: circumference,
            spacing: match name {
                QuantityName::FrictionForce => circumference * canceling,
                _ => 0.0,
            },
            between: match name {
                QuantityName::NormalForce => 0.0,
                QuantityName::TangentialForce => circumference * between[0].abs(),
                _ => circumference * between[1],
            },
            ..self.quantity(name, value, Some(gradient))
        };
        forces.into_iter().map(quantity).collect()
    }

    /// What the points where friction acts leave out: the differences of ∫σ_t over each edge, by the points and by many
    /// more; their sum, and that without signs (force, without 2π).
    fn between_points(&self) -> [f64; 2] {
        const SAMPLES: usize = 16;
        let boundary = &self.patch.contact.boundary;
        if self.patch.law.is_none() {
            return [0.0; 2];
        }
        let mut sum = [0.0; 2];
        for (edge, places) in boundary.friction_points.chunks(3).enumerate() {
            let weight: f64 = places.iter().map(|place| place.weight).sum();
            let stress = |xi: f64| self.tangential_stress_at(edge, xi);
            let sample = |k: usize| stress(-1.0 + (2 * k + 1) as f64 / SAMPLES as f64);
            let many = (0..SAMPLES).map(sample).sum::<f64>() / SAMPLES as f64;
            let few = match self.at_gauss_points() {
                true => GAUSS_3
                    .iter()
                    .map(|(xi, w)| 0.5 * w * stress(*xi))
                    .sum::<f64>(),
                false => (stress(-1.0) + 4.0 * stress(0.0) + stress(1.0)) / 6.0,
            };
            sum[0] += weight * (many - few);
            sum[1] += weight * (many - few).abs();
        }
        sum
    }

    fn peaks(&self) -> Vec<Quantity> {
        let (system, state) = (self.system, &self.finished.state);
        let mut found = Vec::new();
        if let Some((pressure, edge, xi)) = self.highest_pressure() {
            let mut gradient = Gradient::zero(system);
            for (i, shape) in edge_nodes(edge).into_iter().zip(edge3::shape(xi)) {
                gradient.add_pressure(system, self.patch.first + i, -shape);
            }
            let unlimited = self.pressure_without_limit();
            found.push(Quantity {
                unlimited,
                ..self.quantity(QuantityName::PeakNormalStress, -pressure, Some(gradient))
            });
        }
        if let (Some((stress, edge, xi)), Some(_)) = (self.highest_traction(), &self.patch.law) {
            let point = self.point(edge, xi);
            let mut gradient = Gradient::zero(system);
            let bound = stress.abs() / system.law(&point).phi(system.slip(self.v, &point)).abs();
            if bound.is_finite() {
                let pressures = &self.forces.pressures;
                gradient.add_traction(system, state, pressures, bound, &point, 1.0);
            }
            let beside =
                [xi - NEAR, xi + NEAR].map(|xi| self.tangential_stress_near(edge, xi).abs());
            found.push(Quantity {
                spacing: stress.abs() - beside[0].min(beside[1]),
                unlimited: self.averages_nothing() && self.pressure_without_limit(),
                ..self.quantity(QuantityName::PeakTangentialStress, stress, Some(gradient))
            });
        }
        found
    }

    /// The pressure grows without limit at a sharp end of the obstacle and, slowly, at a kink.
    fn pressure_without_limit(&self) -> bool {
        let sharp = |i: usize| self.active(i) && self.may_be_sharp(i);
        sharp(0) || sharp(self.count() - 1) || !self.kinks().is_empty()
    }

    /// The bound follows the pressure itself, and not its average.
    fn averages_nothing(&self) -> bool {
        let friction = self.patch.contact.friction.as_ref();
        friction.is_some_and(|law| law.bound.radius() == Some(0.0))
    }

    /// σ_t at a place that may lie on the next edge.
    fn tangential_stress_near(&self, edge: usize, xi: f64) -> f64 {
        let last = self.patch.contact.boundary.edge_count() - 1;
        match xi {
            _ if xi < -1.0 && edge > 0 => self.tangential_stress_at(edge - 1, xi + 2.0),
            _ if xi > 1.0 && edge < last => self.tangential_stress_at(edge + 1, xi - 2.0),
            _ => self.tangential_stress_at(edge, xi.clamp(-1.0, 1.0)),
        }
    }

    /// The ends of contact lie between two nodes; those of stick move with the slip.
    fn ends(&self) -> Vec<Quantity> {
        let s = &self.patch.contact.boundary.s;
        let last = self.count() - 1;
        let mut found = Vec::new();
        for i in 0..=last {
            if !self.active(i) {
                continue;
            }
            let end = |name, spacing| Quantity {
                spacing,
                ..self.quantity(name, s[i], None)
            };
            if i == 0 || !self.active(i - 1) {
                let spacing = if i == 0 { 0.0 } else { s[i] - s[i - 1] };
                found.push(end(QuantityName::ContactStart, spacing));
            }
            if i == last || !self.active(i + 1) {
                let spacing = if i == last { 0.0 } else { s[i + 1] - s[i] };
                found.push(end(QuantityName::ContactEnd, spacing));
            }
        }
        let mut turns = self.turns();
        turns.truncate(MOST_STICK_ENDS);
        for (edge, xi) in turns {
            let touches = edge_nodes(edge).iter().all(|&i| self.active(i));
            let point = self.point(edge, xi);
            let step = 1e-4;
            let slope =
                (self.slip_at(edge, xi + step) - self.slip_at(edge, xi - step)) / (2.0 * step);
            let arc = self.patch.contact.boundary.edge_arc(edge);
            let length = 0.5 * (arc[1] - arc[0]);
            if !touches || slope == 0.0 {
                continue;
            }
            let mut gradient = Gradient::zero(self.system);
            gradient.add_slip(self.system, &point, 1.0);
            found.push(Quantity {
                factor: length / slope,
                spacing: length.abs(),
                ..self.quantity(QuantityName::StickEnd, point.s, Some(gradient))
            });
        }
        found
    }

    /// A point at which the law is evaluated beside those of the solution, with the anchor of its place.
    fn point(&self, edge: usize, xi: f64) -> Point {
        let shape = edge3::shape(xi);
        let s = edge3::interpolate(&shape, &self.patch.contact.boundary.edge_arc(edge));
        let nodes = edge_nodes(edge).map(|i| self.patch.first + i);
        let anchor = edge3::interpolate(&shape, &self.anchors[edge]);
        self.system.probe(self.p, s, nodes, shape, anchor)
    }
}
