//! The forces and peaks of a contact, and the intervals in which it touches, sticks and slips.

use std::cmp::Ordering;

use super::quantities::EndOfContact;
use super::{Highest, PatchView};
use crate::contact::{AXIS_SHARE, edge_nodes};
use crate::element::edge3;
use crate::element::gauss::GAUSS_3;
use crate::friction::BoundLaw;
use crate::problem::Condition;
use crate::solution::{ContactSummary, Outcome, Peak, Widths};

/// The number of samples per edge in the search for a peak, before its place is narrowed down.
const SAMPLES: usize = 16;

/// The extents of a contact, each as intervals of arc length, and their lengths with interpolated ends of contact.
struct Extents {
    contact: Vec<[f64; 2]>,
    stick: Vec<[f64; 2]>,
    slip: Vec<[f64; 2]>,
    widths: Widths,
}

impl PatchView<'_> {
    pub(in crate::algorithm) fn summary(&self) -> ContactSummary {
        let circumference = self.system.circumference;
        let range = self.system.range(self.patch);
        let points = self.system.points.iter().zip(&self.finished.tractions);
        let [tangential, friction] = self.system.tangential_forces(
            points.filter(|(point, _)| point.patch == self.p),
            &self.forces.tangential_reactions[range.clone()],
        );
        let Extents {
            contact,
            stick,
            slip,
            widths,
        } = self.extents();
        let tool = self.patch.contact.tool.as_ref();
        let with_point = tool.filter(|tool| tool.has_point);
        let [indentation, tangential_displacement, tilt] = self.motions;
        let loads = [0, 1, 2].map(|motion| circumference * self.load_of_obstacle(motion));
        ContactSummary {
            indentation: tool.map(|_| indentation),
            tangential_displacement: tool.map(|_| tangential_displacement),
            tilt: tool.map(|_| tilt),
            force: Some(match tool {
                Some(tool) => tool.force([loads[0], loads[1]]),
                None => self.resultant(),
            }),
            moment: with_point.map(|_| loads[2]),
            normal: self.patch.contact.normal,
            normal_force: circumference * self.system.normal_force(range, &self.forces.reactions),
            tangential_force: circumference * tangential,
            friction_force: circumference * friction,
            contact,
            stick,
            slip,
            peak_normal_stress: self.peak_normal_stress(),
            peak_tangential_stress: self.peak_tangential_stress(),
            widths,
        }
    }

    /// The load of the obstacle on the body along a motion of the obstacle (without 2π); 0 if it has neither a load nor a tilt.
    pub(in crate::algorithm) fn load_of_obstacle(&self, motion: usize) -> f64 {
        let Some(tool) = &self.patch.contact.tool else {
            return 0.0;
        };
        let row = |i: usize| tool.row(i, motion);
        let mut load = 0.0;
        for (i, node) in self.system.range(self.patch).enumerate() {
            let [mut against_n, along_t] = row(i);
            if let Some(end) = self.system.nodes[node].beside_axis {
                against_n -= AXIS_SHARE * row(end - self.patch.first)[0];
            }
            load += self.forces.reactions[node] * against_n;
            load += self.forces.tangential_reactions[node] * along_t;
        }
        let points = self.system.points.iter().zip(&self.finished.tractions);
        for (point, traction) in points.filter(|(point, _)| point.patch == self.p) {
            let along = |k: usize| point.shape[k] * row(point.nodes[k] - self.patch.first)[1];
            load += point.weight * traction * (0..3).map(along).sum::<f64>();
        }
        load
    }

    /// The intervals of contact between outermost nodes, divided into stick and slip by the slip e: |e| < ε sticks.
    fn extents(&self) -> Extents {
        let s = &self.patch.contact.boundary.s;
        let (mut contact, mut stick, mut slip) =
            (Vec::new(), Vec::<[f64; 2]>::new(), Vec::<[f64; 2]>::new());
        let mut widths = Widths {
            error: self.error_of_width(),
            ..Widths::default()
        };
        let ends = self.stick_ends();
        let mut i = 0;
        while i < self.count() {
            if !self.engaged(i) {
                i += 1;
                continue;
            }
            let first = i;
            while i + 1 < self.count() && self.engaged(i + 1) {
                i += 1;
            }
            let (from, to) = (s[first], s[i]);
            let beyond = [
                self.length_beyond(first, first.checked_sub(1)),
                self.length_beyond(i, Some(i + 1).filter(|next| *next < self.count())),
            ];
            if self.active(first) {
                contact.push([from, to]);
                widths.contact += beyond[0] + (to - from) + beyond[1];
            }
            // where slip reaches ε at a node and stays there, rounding decides whether there is a root
            let mut cuts = s[first..=i].to_vec();
            cuts.extend(ends.iter().filter(|c| **c > from && **c < to));
            cuts.sort_by(f64::total_cmp);
            cuts.dedup();
            if first == i {
                cuts.push(to);
            }
            for (piece, pair) in cuts.windows(2).enumerate() {
                let (list, length) = if self.sticks(0.5 * (pair[0] + pair[1])) {
                    (&mut stick, &mut widths.stick)
                } else {
                    (&mut slip, &mut widths.slip)
                };
                *length += pair[1] - pair[0];
                if piece == 0 {
                    *length += beyond[0];
                }
                if piece + 2 == cuts.len() {
                    *length += beyond[1];
                }
                // adjacent pieces in the same state are one
                match list.last_mut() {
                    Some([_, end]) if *end == pair[0] => *end = pair[1],
                    _ => list.push([pair[0], pair[1]]),
                }
            }
            i += 1;
        }
        Extents {
            contact,
            stick,
            slip,
            widths,
        }
    }

    /// The length of contact beyond its outermost node `inside`, up to the open node `outside` at most.
    ///
    /// At the end of a smooth contact in the plane, at the distance d from it, the pressure is K √d inside and the gap
    /// ⁴⁄₃ (K/E*) d^(3/2) outside, with any K. The pressure p at the one node and the gap g at the other, at the distance
    /// h, therefore give the part η = d/h of the open length: η^(3/2)/(1−η)^(1/2) = q with q = ¾ E* g/(p h), which is
    /// η³ + q²η − q² = 0. A node that just closes (g = 0) ends the contact, and so does one that just opens (p = 0): the
    /// end moves without a jump when the load changes.
    fn length_beyond(&self, inside: usize, outside: Option<usize>) -> f64 {
        let Some(outside) = outside.filter(|_| self.active(inside)) else {
            return 0.0;
        };
        let s = &self.patch.contact.boundary.s;
        let length = (s[outside] - s[inside]).abs();
        let gap = self.system.opening(self.v, self.patch.first + outside);
        let stiff = 0.75 * self.contact_modulus(inside) * gap.max(0.0);
        length * (1.0 - open_part(stiff, self.pressure(inside) * length))
    }

    /// The modulus E* of the material at a node (stress).
    fn contact_modulus(&self, i: usize) -> f64 {
        self.system.model.section.contact_modulus(self.material(i))
    }

    /// The material at a node.
    pub(super) fn material(&self, i: usize) -> usize {
        let model = self.system.model;
        let node = self.patch.contact.boundary.nodes[i];
        match model.section.materials() {
            [_] => 0,
            _ => {
                let mut elements = model.mesh.elements.iter();
                let there = elements.position(|element| element.contains(&node));
                there.map_or(0, |element| model.section.material_of(element))
            }
        }
    }

    /// The error of the length in contact: of each end what [`PatchView::quantities`] takes for it as a place, so that it
    /// bounds the end at the node and the interpolated one.
    fn error_of_width(&self) -> Option<f64> {
        let known = self.finished.outcome == Outcome::Converged
            && self.missed().is_empty()
            && self.overlap_without_contact() == 0.0;
        let of_end =
            |end: &EndOfContact| end.spacing + end.truncation + self.displaced_end(end.node);
        known.then(|| self.ends_of_contact().iter().map(of_end).sum())
    }

    fn sticks(&self, s: f64) -> bool {
        let Some(law) = &self.patch.law else {
            return self.patch.contact.condition == Condition::Bonded;
        };
        let boundary = &self.patch.contact.boundary;
        let node = boundary.s.partition_point(|node| *node < s);
        let edge = (node.saturating_sub(1) / 2).min(boundary.edge_count() - 1);
        law.sticks(self.slip_at(edge, edge3::invert(&boundary.edge_arc(edge), s)))
    }

    /// The arc lengths at which the size |e| of the slip equals ε, in order.
    fn stick_ends(&self) -> Vec<f64> {
        let boundary = &self.patch.contact.boundary;
        let at = |(edge, xi): (usize, f64)| {
            edge3::interpolate(&edge3::shape(xi), &boundary.edge_arc(edge))
        };
        let mut ends: Vec<f64> = self.turns().into_iter().map(at).collect();
        ends.sort_by(f64::total_cmp);
        ends.dedup();
        ends
    }

    /// The edges and the places on them at which the size |e| of the slip equals ε: on each edge roots of a quadratic.
    pub(super) fn turns(&self) -> Vec<(usize, f64)> {
        let edges = 0..self.patch.contact.boundary.edge_count();
        let on = |edge: usize| self.turns_on(edge).into_iter().map(move |xi| (edge, xi));
        edges.flat_map(on).collect()
    }

    /// The places on one edge at which the size |e| of the slip equals ε.
    fn turns_on(&self, edge: usize) -> Vec<f64> {
        let Some(law) = &self.patch.law else {
            return Vec::new();
        };
        let mut turns = Vec::new();
        let [start, end, middle] = [-1.0, 1.0, 0.0].map(|xi| self.slip_at(edge, xi));
        for target in [-law.elastic_slip, law.elastic_slip] {
            let (a, b, c) = (
                0.5 * (start + end) - middle,
                0.5 * (end - start),
                middle - target,
            );
            let roots = quadratic_roots(a, b, c).into_iter();
            turns.extend(roots.filter(|xi| xi.abs() <= 1.0));
        }
        turns
    }

    fn peak(&self, Highest { value, edge, xi }: Highest) -> Peak {
        let boundary = &self.patch.contact.boundary;
        let h = edge3::shape(xi);
        let at = |f: &dyn Fn(usize) -> f64| edge3::interpolate(&h, &edge_nodes(edge).map(f));
        Peak {
            value,
            s: at(&|i| boundary.s[i]),
            x: at(&|i| boundary.positions[i][0]),
            y: at(&|i| boundary.positions[i][1]),
        }
    }

    fn peak_normal_stress(&self) -> Option<Peak> {
        let highest = self.highest_pressure()?;
        Some(self.peak(Highest {
            value: -highest.value + 0.0,
            ..highest
        }))
    }

    /// The largest pressure and its place; none without contact.
    pub(super) fn highest_pressure(&self) -> Option<Highest> {
        let edges = 0..self.patch.contact.boundary.edge_count();
        let in_contact = edges.filter(|edge| edge_nodes(*edge).iter().any(|&i| self.active(i)));
        in_contact
            .flat_map(|edge| {
                let p = edge_nodes(edge).map(|i| self.pressure(i));
                // ends, and the vertex of the parabola where it lies inside
                let (a, b) = (0.5 * (p[0] + p[1]) - p[2], 0.5 * (p[1] - p[0]));
                let vertex = if a < 0.0 {
                    (-b / (2.0 * a)).clamp(-1.0, 1.0)
                } else {
                    0.0
                };
                [-1.0, 1.0, vertex].map(|xi| Highest {
                    value: edge3::interpolate(&edge3::shape(xi), &p),
                    edge,
                    xi,
                })
            })
            .max_by(|a, b| a.value.total_cmp(&b.value))
    }

    /// The places on an edge at which σ_t is known: the nodes, and the points where friction acts.
    fn places_of_law(&self) -> &'static [f64] {
        const WITH_GAUSS_POINTS: [f64; 5] = [-1.0, GAUSS_3[0].0, 0.0, GAUSS_3[2].0, 1.0];
        if self.at_gauss_points() {
            &WITH_GAUSS_POINTS
        } else {
            &[-1.0, 0.0, 1.0]
        }
    }

    fn peak_tangential_stress(&self) -> Option<Peak> {
        self.highest_traction().map(|highest| self.peak(highest))
    }

    /// The tangential stress σ_t that is largest in size, and its place; none without friction.
    pub(super) fn highest_traction(&self) -> Option<Highest> {
        *self
            .highest_traction
            .get_or_init(|| self.find_highest_traction())
    }

    fn find_highest_traction(&self) -> Option<Highest> {
        if self.patch.law.is_none() && self.tractions.is_none() {
            return None;
        }
        /// The relative difference of two values that count as equal: solutions within the tolerance differ by less.
        const EQUAL: f64 = 1e-9;
        let step = 2.0 / SAMPLES as f64;
        let (mut highest, mut most) = (None, 0.0f64);
        let edges = 0..self.patch.contact.boundary.edge_count();
        let rubbed: Vec<usize> = edges.clone().filter(|&edge| self.may_rub(edge)).collect();
        // nothing is highest where all is zero
        let edges = if rubbed.is_empty() {
            edges.rev().take(1).collect()
        } else {
            self.edges_with_highest(rubbed, 1.0 - EQUAL)
        };
        for edge in edges {
            let stress = |xi: f64| self.tangential_stress_at(edge, xi);
            // Between the points of the law u_t, a parabola, may overshoot to the other side of ε: a sign that no point
            // beside it has is not one of the solution.
            let points = self.places_of_law();
            let signs: Vec<Option<Ordering>> = points
                .iter()
                .map(|xi| stress(*xi).partial_cmp(&0.0))
                .collect();
            for k in 0..=SAMPLES {
                let xi = -1.0 + step * k as f64;
                let after = points.partition_point(|point| *point < xi);
                let beside = [after.saturating_sub(1), after.min(points.len() - 1)];
                let value = stress(xi);
                let sign = value.partial_cmp(&0.0);
                let seen = value == 0.0 || beside.iter().any(|i| signs[*i] == sign);
                // the last of those that are equal but for rounding, as the two of a symmetric problem
                if seen && (highest.is_none() || value.abs() >= (1.0 - EQUAL) * most) {
                    highest = Some(Highest { value, edge, xi });
                    most = most.max(value.abs());
                }
            }
        }
        let Highest {
            value,
            edge,
            xi: centre,
        } = highest?;
        let size = |xi: f64| value.signum() * self.tangential_stress_at(edge, xi);
        let (low, high) = ((centre - step).max(-1.0), (centre + step).min(1.0));
        // a peak where stick ends is a kink, whose place is known
        let turns = self.turns_on(edge).into_iter();
        let kinks = turns.filter(|xi| (low..=high).contains(xi));
        let places = kinks.chain([narrowed(&size, low, high)]);
        let larger = |best: (f64, f64), xi: f64| match size(xi) {
            size if size > best.0 => (size, xi),
            _ => best,
        };
        let (_, xi) = places.fold((size(centre), centre), larger);
        let value = self.tangential_stress_at(edge, xi);
        Some(Highest { value, edge, xi })
    }
}

/// A parabola through three values at the start, the middle and the end of an edge is nowhere on the edge larger in size
/// than this many times the largest of them.
const BETWEEN: f64 = 1.25;

impl PatchView<'_> {
    /// Those of some edges on which |σ_t| may reach the part `part` of its largest value at a node of them. On an edge much
    /// shorter than ρ the averaged pressure is nearly linear, so that its values at the nodes bound it: few edges are left
    /// on which it must be computed at many places.
    fn edges_with_highest(&self, mut edges: Vec<usize>, part: f64) -> Vec<usize> {
        let (None, Some(law)) = (&self.tractions, &self.patch.law) else {
            return edges;
        };
        let BoundLaw::Pressure { average, .. } = &law.bound else {
            return edges;
        };
        let pressures = self.own_pressures().iter();
        let most = BETWEEN * pressures.fold(0.0, |most, p| p.abs().max(most));
        let curvature = average.curvature_bound(most);
        if !curvature.is_finite() {
            return edges;
        }
        let at_nodes = self.averaged_and_bound_at_nodes();
        let largest_at_node = |edge: &usize| {
            let bounds = edge_nodes(*edge).map(|i| at_nodes[i].1);
            let stresses = bounds.iter().zip(self.slips_at_nodes(*edge));
            stresses.fold(0.0, |most: f64, (bound, slip)| {
                most.max((bound * law.phi(slip)).abs())
            })
        };
        let enough = part * edges.iter().map(largest_at_node).fold(0.0, f64::max);
        edges.retain(|edge| {
            let [start, end, middle] = self.patch.contact.boundary.edge_arc(*edge);
            let spacing = (middle - start).max(end - middle);
            let at_nodes = edge_nodes(*edge).map(|i| at_nodes[i].0);
            let averaged =
                at_nodes.into_iter().fold(0.0, f64::max) + 0.125 * curvature * spacing * spacing;
            let slip = BETWEEN
                * self
                    .slips_at_nodes(*edge)
                    .map(f64::abs)
                    .into_iter()
                    .fold(0.0, f64::max);
            law.bound.of_average(averaged, self.largest) * law.phi(slip) >= enough
        });
        edges
    }

    /// The slips at the start, the end and the middle of an edge.
    fn slips_at_nodes(&self, edge: usize) -> [f64; 3] {
        [-1.0, 1.0, 0.0].map(|xi| self.slip_at(edge, xi))
    }
}

/// The place of the largest value between two places with one peak between them, by golden section. The place is exact
/// to 10⁻⁵ of their distance, and the value of a smooth peak to the square of that.
fn narrowed(value: &dyn Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    const STEPS: usize = 24;
    let ratio = 0.5 * (5f64.sqrt() - 1.0);
    let inner = |low: f64, high: f64| [high - ratio * (high - low), low + ratio * (high - low)];
    let mut places = inner(low, high);
    let mut values = places.map(value);
    for _ in 0..STEPS {
        // one of the two inner places is an inner place of the next interval
        if values[0] < values[1] {
            low = places[0];
            places = [places[1], inner(low, high)[1]];
            values = [values[1], value(places[1])];
        } else {
            high = places[1];
            places = [inner(low, high)[0], places[0]];
            values = [value(places[0]), values[0]];
        }
    }
    0.5 * (low + high)
}

/// The solution η of η³ + q²η − q² = 0 from 0 to 1, for q = `gap`/`pressure`, both ≥ 0: the open part of the length between
/// two nodes. 1 if there is no pressure, whatever the gap.
fn open_part(gap: f64, pressure: f64) -> f64 {
    if pressure <= 0.0 || !gap.is_finite() {
        return 1.0;
    }
    if gap == 0.0 {
        return 0.0;
    }
    let q = gap / pressure;
    if q > LARGE_RATIO {
        return 1.0;
    }
    // the only real root, since the cubic grows; by the hyperbolic form, whose terms do not cancel
    let scale = 2.0 * q / 3f64.sqrt();
    scale * ((1.5 * 3f64.sqrt() / q).asinh() / 3.0).sinh()
}

/// The ratio q in [`open_part`] above which 1 − η ≈ q⁻² is below rounding.
const LARGE_RATIO: f64 = 1e7;

fn quadratic_roots(a: f64, b: f64, c: f64) -> Vec<f64> {
    let discriminant = b * b - 4.0 * a * c;
    if discriminant < 0.0 {
        return Vec::new();
    }
    // q avoids the difference of nearly equal numbers
    let q = -0.5 * (b + b.signum() * discriminant.sqrt());
    [q / a, c / q]
        .into_iter()
        .filter(|x| x.is_finite())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_peak_is_found_between_two_places() {
        let found = narrowed(&|x| 1.0 - (x - 0.3) * (x - 0.3), 0.0, 1.0);
        assert!((found - 0.3).abs() < 1e-5, "{found}");
    }

    #[test]
    fn the_open_part_solves_its_cubic_and_ends_at_the_nodes() {
        for q in [1e-6, 0.01, 0.3, 1.0, 5.0, 300.0, 1e6] {
            let part = open_part(q, 1.0);
            let left = part.powi(3) - q * q * (1.0 - part);
            assert!((0.0..=1.0).contains(&part), "{q} {part}");
            assert!(left.abs() <= 1e-9 * q.max(q * q), "{q} {part} {left}");
        }
        assert_eq!(open_part(0.0, 1.0), 0.0);
        assert_eq!(open_part(0.0, 0.0), 1.0);
        assert_eq!(open_part(1.0, 0.0), 1.0);
        assert_eq!(open_part(f64::INFINITY, 1.0), 1.0);
        assert!((open_part(1e8, 1.0) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn quadratics_and_lines_give_their_roots() {
        let mut roots = quadratic_roots(1.0, -3.0, 2.0);
        roots.sort_by(f64::total_cmp);
        assert_eq!(roots, [1.0, 2.0]);
        assert_eq!(quadratic_roots(0.0, 2.0, -1.0), [0.5]);
        assert!(quadratic_roots(1.0, 0.0, 1.0).is_empty());
    }
}
