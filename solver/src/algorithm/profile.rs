//! One contact in the final state: forces, extents, peaks, columns, and what to warn of.

use super::system::{Patch, System};
use crate::contact::edge_nodes;
use crate::elasticity::Dof;
use crate::element::edge3;
use crate::solution::{ContactProfile, ContactSummary, NodeState, Peak, Warning};

/// Samples per edge in the search for a peak, before it is narrowed down.
const SAMPLES: usize = 16;

/// Stick may turn once between two directions of slip; more often is the mesh's doing.
const FEWEST_REVERSALS: usize = 2;

/// Fewer edges than this across a contact say little about its pressure.
const FEWEST_EDGES: usize = 6;

/// Intervals of arc length.
struct Extents {
    contact: Vec<[f64; 2]>,
    stick: Vec<[f64; 2]>,
    slip: Vec<[f64; 2]>,
}

/// One contact in the final state.
pub(super) struct PatchView<'a> {
    pub(super) system: &'a System<'a>,
    pub(super) patch: &'a Patch<'a>,
    pub(super) p: usize,
    pub(super) v: &'a [f64],
    pub(super) active: &'a [bool],
    pub(super) reactions: &'a [f64],
    pub(super) pressures: &'a [f64],
    pub(super) bound: &'a [f64],
}

impl PatchView<'_> {
    fn count(&self) -> usize {
        self.patch.contact.gap.len()
    }

    fn active(&self, i: usize) -> bool {
        self.active[self.patch.first + i]
    }

    fn u_t(&self, i: usize) -> f64 {
        self.system
            .tangential_displacement(self.v, self.patch.first + i)
    }

    fn pressure(&self, i: usize) -> f64 {
        self.pressures[self.patch.first + i]
    }

    /// u_t − d along an edge.
    fn slip_at(&self, edge: usize, xi: f64) -> f64 {
        let u_t = edge_nodes(edge).map(|i| self.u_t(i));
        edge3::interpolate(&edge3::shape(xi), &u_t) - self.patch.contact.tangential_displacement
    }

    fn own_pressures(&self) -> &[f64] {
        &self.pressures[self.patch.first..self.patch.first + self.count()]
    }

    /// σ_t(s) = −τ(s) φ(u_t(s) − d), with W at this very s.
    fn tangential_stress_at(&self, edge: usize, xi: f64) -> f64 {
        let Some(law) = &self.patch.law else {
            return 0.0;
        };
        let s = edge3::interpolate(
            &edge3::shape(xi),
            &self.patch.contact.boundary.edge_arc(edge),
        );
        let averaged = law.averaging.row(s).apply(self.own_pressures());
        -law.bound(averaged) * law.phi(self.slip_at(edge, xi))
    }

    pub(super) fn summary(&self) -> ContactSummary {
        let circumference = self.system.circumference;
        let range = self.patch.first..self.patch.first + self.count();
        let (mut tangential, mut friction) = (0.0, 0.0);
        for (point, tau) in self
            .system
            .points
            .iter()
            .zip(self.bound)
            .filter(|(point, _)| point.patch == self.p)
        {
            let traction =
                point.weight * tau * self.system.law(point).phi(self.system.slip(self.v, point));
            tangential -= traction;
            friction += traction.abs();
        }
        let Extents {
            contact,
            stick,
            slip,
        } = self.extents();
        ContactSummary {
            normal_force: circumference * self.reactions[range].iter().sum::<f64>(),
            tangential_force: circumference * tangential,
            friction_force: circumference * friction,
            contact,
            stick,
            slip,
            peak_normal_stress: self.peak_normal_stress(),
            peak_tangential_stress: self.peak_tangential_stress(),
        }
    }

    /// Contact between its outermost nodes, and its division by |u_t − d| < ε.
    fn extents(&self) -> Extents {
        let s = &self.patch.contact.boundary.s;
        let (mut contact, mut stick, mut slip) =
            (Vec::new(), Vec::<[f64; 2]>::new(), Vec::<[f64; 2]>::new());
        let mut i = 0;
        while i < self.count() {
            if !self.active(i) {
                i += 1;
                continue;
            }
            let first = i;
            while i + 1 < self.count() && self.active(i + 1) {
                i += 1;
            }
            let (from, to) = (s[first], s[i]);
            contact.push([from, to]);
            let mut cuts = vec![from];
            cuts.extend(
                self.stick_ends()
                    .into_iter()
                    .filter(|c| *c > from && *c < to),
            );
            cuts.push(to);
            for pair in cuts.windows(2) {
                let list = if self.sticks(0.5 * (pair[0] + pair[1])) {
                    &mut stick
                } else {
                    &mut slip
                };
                // pieces that meet were divided for nothing
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
        }
    }

    fn sticks(&self, s: f64) -> bool {
        let Some(law) = &self.patch.law else {
            return false;
        };
        let boundary = &self.patch.contact.boundary;
        let edge = (0..boundary.edge_count())
            .find(|k| boundary.edge_arc(*k)[1] >= s)
            .unwrap_or(0);
        self.slip_at(edge, edge3::invert(&boundary.edge_arc(edge), s))
            .abs()
            < law.elastic_slip
    }

    /// Arc lengths at which |u_t − d| = ε: roots of a quadratic on each edge, in order.
    fn stick_ends(&self) -> Vec<f64> {
        let Some(law) = &self.patch.law else {
            return Vec::new();
        };
        let boundary = &self.patch.contact.boundary;
        let mut ends = Vec::new();
        for edge in 0..boundary.edge_count() {
            let [start, end, middle] =
                edge_nodes(edge).map(|i| self.u_t(i) - self.patch.contact.tangential_displacement);
            for target in [-law.elastic_slip, law.elastic_slip] {
                let (a, b, c) = (
                    0.5 * (start + end) - middle,
                    0.5 * (end - start),
                    middle - target,
                );
                for xi in quadratic_roots(a, b, c)
                    .into_iter()
                    .filter(|xi| xi.abs() <= 1.0)
                {
                    ends.push(edge3::interpolate(
                        &edge3::shape(xi),
                        &boundary.edge_arc(edge),
                    ));
                }
            }
        }
        ends.sort_by(f64::total_cmp);
        ends.dedup();
        ends
    }

    fn peak(&self, value: f64, edge: usize, xi: f64) -> Peak {
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
        let edges = 0..self.patch.contact.boundary.edge_count();
        let in_contact = edges.filter(|edge| edge_nodes(*edge).iter().any(|&i| self.active(i)));
        let best = in_contact
            .flat_map(|edge| {
                let p = edge_nodes(edge).map(|i| self.pressure(i));
                // ends, and the vertex of the parabola where it lies inside
                let (a, b) = (0.5 * (p[0] + p[1]) - p[2], 0.5 * (p[1] - p[0]));
                let vertex = if a < 0.0 {
                    (-b / (2.0 * a)).clamp(-1.0, 1.0)
                } else {
                    0.0
                };
                [-1.0, 1.0, vertex].map(|xi| (edge3::interpolate(&edge3::shape(xi), &p), edge, xi))
            })
            .max_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(self.peak(-best.0 + 0.0, best.1, best.2))
    }

    fn peak_tangential_stress(&self) -> Option<Peak> {
        self.patch.law.as_ref()?;
        let size = |edge: usize, xi: f64| self.tangential_stress_at(edge, xi).abs();
        let step = 2.0 / SAMPLES as f64;
        let samples = (0..self.patch.contact.boundary.edge_count())
            .flat_map(|edge| (0..=SAMPLES).map(move |k| (edge, -1.0 + step * k as f64)));
        let (_, edge, centre) = samples
            .map(|(edge, xi)| (size(edge, xi), edge, xi))
            .max_by(|a, b| a.0.total_cmp(&b.0))?;
        // golden section between the neighbouring samples
        let (mut low, mut high) = ((centre - step).max(-1.0), (centre + step).min(1.0));
        let ratio = 0.5 * (5f64.sqrt() - 1.0);
        for _ in 0..40 {
            let (a, b) = (high - ratio * (high - low), low + ratio * (high - low));
            if size(edge, a) < size(edge, b) {
                low = a
            } else {
                high = b
            }
        }
        let narrowed = 0.5 * (low + high);
        let xi = if size(edge, narrowed) > size(edge, centre) {
            narrowed
        } else {
            centre
        };
        Some(self.peak(self.tangential_stress_at(edge, xi), edge, xi))
    }

    pub(super) fn profile(&self) -> ContactProfile {
        let boundary = &self.patch.contact.boundary;
        let mut profile = ContactProfile::default();
        for i in 0..self.count() {
            let slip = self.u_t(i) - self.patch.contact.tangential_displacement;
            let (averaged, bound, phi) = match &self.patch.law {
                None => (0.0, 0.0, 0.0),
                Some(law) => {
                    let averaged = law.averaging.row(boundary.s[i]).apply(self.own_pressures());
                    (averaged, law.bound(averaged), law.phi(slip))
                }
            };
            let sticks = self
                .patch
                .law
                .as_ref()
                .is_some_and(|law| slip.abs() < law.elastic_slip);
            profile.s.push(boundary.s[i]);
            profile.x.push(boundary.positions[i][0]);
            profile.y.push(boundary.positions[i][1]);
            profile.gap.push(self.patch.contact.gap[i]);
            profile.normal_displacement.push(
                self.system
                    .normal_displacement(self.v, self.patch.first + i),
            );
            profile.tangential_displacement.push(self.u_t(i));
            profile.normal_stress.push(-self.pressure(i) + 0.0);
            profile.tangential_stress.push(-bound * phi + 0.0);
            profile.nonlocal_pressure.push(averaged);
            profile.friction_bound.push(bound);
            profile.friction_ratio.push(phi.abs());
            profile.state.push(match (self.active(i), sticks) {
                (false, _) => NodeState::Open,
                (true, true) => NodeState::Stick,
                (true, false) => NodeState::Slip,
            });
        }
        profile
    }

    pub(super) fn warn(&self, warnings: &mut Vec<Warning>) {
        let contact = self.patch.contact;
        let mut warn = |code: &str, message: String| {
            warnings.push(Warning {
                code: code.to_owned(),
                pointer: contact.pointer.clone(),
                message,
            });
        };
        let touching = (0..self.count()).filter(|&i| self.active(i)).count();
        if touching == 0 {
            let opening = |i: usize| {
                contact.gap[i]
                    - self
                        .system
                        .normal_displacement(self.v, self.patch.first + i)
            };
            let smallest = (0..self.count()).map(opening).fold(f64::INFINITY, f64::min);
            warn(
                "no_contact",
                format!(
                    "The body never touches the obstacle: the smallest gap is {smallest:.6e}. Indent by more than that to engage it."
                ),
            );
            return;
        }
        let edges = (0..contact.boundary.edge_count())
            .filter(|k| edge_nodes(*k).iter().all(|&i| self.active(i)))
            .count();
        if edges < FEWEST_EDGES {
            warn(
                "mesh_too_coarse_for_contact",
                format!(
                    "Only {edges} whole element(s) lie in the contact; at least {FEWEST_EDGES} are needed for a pressure to rely on. Refine the mesh there."
                ),
            );
        }
        let reversals = self.stick_reversals();
        if reversals >= FEWEST_REVERSALS {
            warn(
                "oscillating_stick",
                format!(
                    "The tangential stress changes its sign {reversals} times between neighbouring points that stick: the mesh does not resolve elastic_slip, and friction_force is too large. Refine the contact, or raise elastic_slip."
                ),
            );
        }
        let s = &contact.boundary.s;
        let ends = [0, self.count() - 1].map(|i| (s[i], self.active(i) && !self.symmetric(i)));
        for (s, _) in ends.into_iter().filter(|(_, pressed)| *pressed) {
            warn(
                "contact_reaches_obstacle_end",
                format!(
                    "The body presses against the very end of the obstacle, s = {s:.4}. At a sharp edge the pressure grows without limit as the mesh is refined: forces converge, and σ_t does for nonlocal_radius > 0, but the peak of σ_n does not. If the obstacle goes on there, extend it."
                ),
            );
        }
        let radius = contact.friction.map_or(0.0, |f| f.nonlocal_radius);
        let first = (0..self.count()).find(|&i| self.active(i));
        let last = (0..self.count()).rfind(|&i| self.active(i));
        if let (Some(first), Some(last)) = (first, last) {
            let mirrored = [first, last]
                .into_iter()
                .filter(|&i| self.symmetric(i))
                .count();
            let width = (s[last] - s[first]) * (1 + mirrored) as f64;
            if radius > width && width > 0.0 {
                warn(
                    "radius_exceeds_contact",
                    format!(
                        "The nonlocal radius {radius} is larger than the whole contact, {width:.4}: the averaged pressure, and friction with it, is smeared out beyond the contact."
                    ),
                );
            }
        }
    }

    /// How often φ changes its sign between neighbouring friction points inside stick.
    fn stick_reversals(&self) -> usize {
        let Some(law) = &self.patch.law else { return 0 };
        let largest = self.bound.iter().fold(0.0f64, |a, b| a.max(*b));
        let points = self.system.points.iter().zip(self.bound);
        let own: Vec<Option<f64>> = points
            .filter(|(point, _)| point.patch == self.p)
            .map(|(point, tau)| {
                let slip = self.system.slip(self.v, point);
                let sticks = slip.abs() < law.elastic_slip && *tau > 1e-3 * largest;
                // near zero a sign means nothing
                sticks.then(|| law.phi(slip)).filter(|phi| phi.abs() > 0.01)
            })
            .collect();
        let reverses = |pair: &&[Option<f64>]| matches!(pair, [Some(a), Some(b)] if a * b < 0.0);
        own.windows(2).filter(reverses).count()
    }

    /// A node on a line of symmetry: on the axis, or held along the tangent.
    fn symmetric(&self, i: usize) -> bool {
        let node = &self.system.nodes[self.patch.first + i];
        node.follows.is_some() || matches!(node.tangent, Dof::Fixed(value) if value == 0.0)
    }
}

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
    fn quadratics_and_lines_give_their_roots() {
        let mut roots = quadratic_roots(1.0, -3.0, 2.0);
        roots.sort_by(f64::total_cmp);
        assert_eq!(roots, [1.0, 2.0]);
        assert_eq!(quadratic_roots(0.0, 2.0, -1.0), [0.5]);
        assert!(quadratic_roots(1.0, 0.0, 1.0).is_empty());
    }
}
