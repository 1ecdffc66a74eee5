//! One contact in the final state: forces, extents, peaks, columns, and what to warn of.

use super::Finished;
use super::system::{Patch, System};
use crate::contact::edge_nodes;
use crate::elasticity::Dof;
use crate::element::edge3;
use crate::element::gauss::GAUSS_3;
use crate::problem::{Condition, Friction, FrictionPoints};
use crate::solution::{ContactProfile, ContactSummary, NodeState, Outcome, Peak, Warning};

/// Samples per edge in the search for a peak, before it is narrowed down.
const SAMPLES: usize = 16;

/// Error of a smooth peak times the square of the number of elements across.
const SMOOTH_PEAK: f64 = 0.28;

/// Part of the friction force that cancels inside edges, from which on stick tractions oscillate.
const OSCILLATING: f64 = 3e-3;

/// One edge may hold this part of it for the sake of a motion that turns there.
const TURN: f64 = 0.02;

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
    system: &'a System<'a>,
    patch: &'a Patch<'a>,
    p: usize,
    v: &'a [f64],
    finished: &'a Finished,
    forces: &'a Forces,
    /// g at start, end and midside of every edge; in the total law nothing.
    anchors: Vec<[f64; 3]>,
    /// σ_t likewise, where it is not the law's: of the thesis's own iteration, and of bonded contacts.
    tractions: Option<Vec<[f64; 3]>>,
}

/// Nodal forces of a state, all contacts in a row.
pub(super) struct Forces {
    pub(super) reactions: Vec<f64>,
    pub(super) tangential_reactions: Vec<f64>,
    pub(super) pressures: Vec<f64>,
}

impl<'a> PatchView<'a> {
    pub(super) fn new(
        system: &'a System<'a>,
        p: usize,
        finished: &'a Finished,
        forces: &'a Forces,
    ) -> Self {
        let patch = &system.patches[p];
        let mut view = PatchView {
            system,
            patch,
            p,
            v: &finished.state.v,
            finished,
            forces,
            anchors: Vec::new(),
            tractions: None,
        };
        view.anchors = view.carried_to_nodes(&|g| system.points[g].anchor);
        if patch.contact.condition == Condition::Bonded {
            let shear = |i: usize| {
                let node = patch.first + i;
                forces.tangential_reactions[node] / system.nodes[node].weight
            };
            // on the axis there is no shear
            let stress = |i: usize| match system.nodes[patch.first + i].follows {
                Some(_) => 0.0,
                None => shear(i),
            };
            let edges = 0..patch.contact.boundary.edge_count();
            view.tractions = Some(edges.map(|edge| edge_nodes(edge).map(stress)).collect());
        } else if finished.own_tractions {
            view.tractions = Some(view.carried_to_nodes(&|g| finished.tractions[g]));
        }
        view
    }

    /// Values at friction points, carried to start, end and midside of every edge: the parabola
    /// through its three Gauss points, or the nodes' own.
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

    /// The largest |σ_t| that a prescribed bound exerts on edges of which no node touches.
    fn bound_beyond_contact(&self) -> Option<f64> {
        let friction = self.patch.contact.friction.as_ref()?;
        friction.bound.as_ref()?;
        let open = |node: usize| !self.active(node - self.patch.first);
        let points = self.system.points.iter().zip(&self.finished.tractions);
        let largest = points
            .filter(|(point, _)| point.patch == self.p && point.nodes.iter().all(|n| open(*n)))
            .fold(0.0f64, |most, (_, traction)| most.max(traction.abs()));
        (largest > 0.0).then_some(largest)
    }

    /// The edge under the peak of σ_t, where it is longer than ρ; unless all edges are, which was said
    /// before the solution.
    fn unresolved_radius(&self) -> Option<(f64, f64)> {
        let contact = &self.patch.contact;
        let friction = contact.friction.as_ref()?;
        friction.coefficient.filter(|mu| *mu > 0.0)?;
        let radius = friction.nonlocal_radius.filter(|radius| *radius > 0.0)?;
        let boundary = &contact.boundary;
        let length = |edge: usize| boundary.edge_arc(edge)[1] - boundary.edge_arc(edge)[0];
        let edges = || 0..boundary.edge_count();
        if edges().all(|edge| length(edge) > radius) {
            return None;
        }
        let size = |edge: usize| {
            let at = |xi: f64| self.tangential_stress_at(edge, xi).abs();
            at(-0.7).max(at(0.0)).max(at(0.7))
        };
        let under = edges().max_by(|&a, &b| size(a).total_cmp(&size(b)))?;
        // rounding of a grid whose lines are ρ apart
        (length(under) > radius * (1.0 + 1e-9)).then_some((length(under), radius))
    }

    /// Friction acts at Gauss points, three an edge.
    fn at_gauss_points(&self) -> bool {
        let friction = self.patch.contact.friction.as_ref();
        friction.is_some_and(|f| f.points == FrictionPoints::Gauss3)
    }

    fn count(&self) -> usize {
        self.patch.contact.boundary.nodes.len()
    }

    /// True where friction may act: in contact, or without any obstacle.
    fn engaged(&self, i: usize) -> bool {
        self.active(i) || self.patch.contact.condition == Condition::None
    }

    fn active(&self, i: usize) -> bool {
        self.finished.state.active[self.patch.first + i]
    }

    fn u_t(&self, i: usize) -> f64 {
        self.system
            .tangential_displacement(self.v, self.patch.first + i)
    }

    fn pressure(&self, i: usize) -> f64 {
        self.forces.pressures[self.patch.first + i]
    }

    /// e = u_t − d − g along an edge.
    fn slip_at(&self, edge: usize, xi: f64) -> f64 {
        let drag = |i: usize| self.system.nodes[self.patch.first + i].drag;
        let relative = edge_nodes(edge).map(|i| self.u_t(i) - drag(i));
        let h = edge3::shape(xi);
        edge3::interpolate(&h, &relative) - edge3::interpolate(&h, &self.anchors[edge])
    }

    fn own_pressures(&self) -> &[f64] {
        &self.forces.pressures[self.system.range(self.patch)]
    }

    /// S_ρ and τ at arc length s.
    fn averaged_and_bound(&self, s: f64) -> (f64, f64) {
        let Some(law) = &self.patch.law else {
            return (0.0, 0.0);
        };
        let source = law.bound.source(s);
        let pressures = self.own_pressures();
        (
            source.nonlocal_pressure(pressures),
            law.bound.bound(&source, pressures),
        )
    }

    /// σ_t(s) = −τ(s) φ(e(s)), with W at this very s.
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

    /// A value at a node: the mean of those of the edges that meet there.
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

    pub(super) fn summary(&self) -> ContactSummary {
        let circumference = self.system.circumference;
        let range = self.system.range(self.patch);
        let (mut tangential, mut friction) = (0.0, 0.0);
        let points = self.system.points.iter().zip(&self.finished.tractions);
        for (point, traction) in points.filter(|(point, _)| point.patch == self.p) {
            tangential += point.weight * traction;
            friction += point.weight * traction.abs();
        }
        for held in &self.forces.tangential_reactions[range.clone()] {
            tangential += held;
            friction += held.abs();
        }
        let Extents {
            contact,
            stick,
            slip,
        } = self.extents();
        ContactSummary {
            normal: self.patch.contact.normal,
            normal_force: circumference * self.forces.reactions[range].iter().sum::<f64>(),
            tangential_force: circumference * tangential,
            friction_force: circumference * friction,
            contact,
            stick,
            slip,
            peak_normal_stress: self.peak_normal_stress(),
            peak_tangential_stress: self.peak_tangential_stress(),
        }
    }

    /// Contact between its outermost nodes, and its division by |e| < ε.
    fn extents(&self) -> Extents {
        let s = &self.patch.contact.boundary.s;
        let (mut contact, mut stick, mut slip) =
            (Vec::new(), Vec::<[f64; 2]>::new(), Vec::<[f64; 2]>::new());
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
            if self.active(first) {
                contact.push([from, to]);
            }
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
            return self.patch.contact.condition == Condition::Bonded;
        };
        let boundary = &self.patch.contact.boundary;
        let edge = (0..boundary.edge_count())
            .find(|k| boundary.edge_arc(*k)[1] >= s)
            .unwrap_or(0);
        self.slip_at(edge, edge3::invert(&boundary.edge_arc(edge), s))
            .abs()
            < law.elastic_slip
    }

    /// Arc lengths at which |e| = ε: roots of a quadratic on each edge, in order.
    fn stick_ends(&self) -> Vec<f64> {
        let Some(law) = &self.patch.law else {
            return Vec::new();
        };
        let boundary = &self.patch.contact.boundary;
        let mut ends = Vec::new();
        for edge in 0..boundary.edge_count() {
            let [start, end, middle] = [-1.0, 1.0, 0.0].map(|xi| self.slip_at(edge, xi));
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
        if self.patch.law.is_none() && self.tractions.is_none() {
            return None;
        }
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
            let (averaged, bound) = self.averaged_and_bound(boundary.s[i]);
            let law = self.patch.law.as_ref();
            let phi = |edge, xi| law.map_or(0.0, |law| law.phi(self.slip_at(edge, xi)));
            let sticks = match law {
                None => self.patch.contact.condition == Condition::Bonded,
                Some(law) => {
                    self.at_node(i, |edge, xi| self.slip_at(edge, xi)).abs() < law.elastic_slip
                }
            };
            let ratio = self.at_node(i, phi);
            let stress = match &self.tractions {
                None => -bound * ratio,
                Some(_) => self.at_node(i, |edge, xi| self.tangential_stress_at(edge, xi)),
            };
            profile.s.push(boundary.s[i]);
            profile.x.push(boundary.positions[i][0]);
            profile.y.push(boundary.positions[i][1]);
            profile
                .gap
                .push(self.patch.contact.gap(i, self.system.level.indentation));
            profile.normal_displacement.push(
                self.system
                    .normal_displacement(self.v, self.patch.first + i),
            );
            profile.tangential_displacement.push(self.u_t(i));
            profile.normal_stress.push(-self.pressure(i) + 0.0);
            profile.tangential_stress.push(stress + 0.0);
            profile.nonlocal_pressure.push(averaged);
            profile.friction_bound.push(bound);
            profile.friction_ratio.push(ratio.abs());
            profile.state.push(state(self.engaged(i), sticks));
        }
        profile
    }

    /// The columns where friction acts, see [`ContactProfile`]; `nodal` are those at the nodes.
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
        let law = self.patch.law.as_ref();
        let places = self.patch.contact.boundary.friction_points.iter();
        for (k, place) in places.enumerate() {
            let (edge, xi) = (k / 3, GAUSS_3[k % 3].0);
            let along = |column: &[f64]| {
                edge3::interpolate(&place.shape, &place.nodes.map(|i| column[i])) + 0.0
            };
            let (averaged, bound) = self.averaged_and_bound(place.s);
            let slip = self.slip_at(edge, xi);
            let stress = match own.get(k) {
                Some(&g) => tractions[g],
                None => self.tangential_stress_at(edge, xi),
            };
            let sticks = match law {
                None => self.patch.contact.condition == Condition::Bonded,
                Some(law) => slip.abs() < law.elastic_slip,
            };
            let [start, end, middle] = place.nodes;
            let beside = [[start, middle], [middle; 2], [middle, end]][k % 3];
            profile.s.push(place.s);
            profile.x.push(along(&nodal.x));
            profile.y.push(along(&nodal.y));
            profile.gap.push(along(&nodal.gap));
            profile
                .normal_displacement
                .push(along(&nodal.normal_displacement));
            profile
                .tangential_displacement
                .push(along(&nodal.tangential_displacement));
            profile.normal_stress.push(along(&nodal.normal_stress));
            profile.tangential_stress.push(stress + 0.0);
            profile.nonlocal_pressure.push(averaged);
            profile.friction_bound.push(bound);
            profile
                .friction_ratio
                .push(law.map_or(0.0, |law| law.phi(slip)).abs());
            let engaged = beside.iter().all(|&i| self.engaged(i));
            profile.state.push(state(engaged, sticks));
        }
        profile
    }

    pub(super) fn warn(&self, warnings: &mut Vec<Warning>) {
        self.warn_of_oscillation(warnings);
        self.warn_of_contact(warnings);
    }

    fn warn_of_contact(&self, warnings: &mut Vec<Warning>) {
        let contact = self.patch.contact;
        let mut warn = |code: &str, message: String| {
            warnings.push(Warning {
                code: code.to_owned(),
                pointer: contact.pointer.clone(),
                message,
            });
        };
        let jumps = |f: &Friction| f.cohesion > 0.0 && f.nonlocal_radius == Some(0.0);
        let settled = matches!(
            self.finished.outcome,
            Outcome::Converged | Outcome::Canceled
        );
        if !settled && contact.friction.as_ref().is_some_and(jumps) {
            warn(
                "cohesion_jumps",
                "The friction bound jumps by the cohesion where the pressure ends; without a nonlocal radius the nodes there may come and go for ever. Give a radius of an element or more.".to_owned(),
            );
        }
        let touching = (0..self.count()).filter(|&i| self.active(i)).count();
        if contact.condition != Condition::Unilateral {
            return;
        }
        if touching == 0 {
            let opening = |i: usize| {
                contact.gap(i, self.system.level.indentation)
                    - self
                        .system
                        .normal_displacement(self.v, self.patch.first + i)
            };
            let nearest = (0..self.count()).min_by(|&a, &b| opening(a).total_cmp(&opening(b)));
            let smallest = nearest.map_or(f64::INFINITY, opening);
            // untouched, the body does not feel the obstacle: what the gap lacks is what to indent by
            let engages = |i: usize| {
                let moved = self
                    .system
                    .normal_displacement(self.v, self.patch.first + i);
                (contact.profile[i] - moved) / contact.push[i][0]
            };
            let needed = (0..self.count()).map(engages).fold(f64::INFINITY, f64::min);
            warn(
                "no_contact",
                format!(
                    "The body never touches the obstacle: the smallest gap is {smallest:.6e}. An indentation above {needed:.6e} engages it."
                ),
            );
            return;
        }
        if let Some(tau) = self.bound_beyond_contact() {
            warn(
                "bound_beyond_contact",
                format!(
                    "The prescribed friction bound acts on all of the boundary, as Tresca's law has it: up to {tau:.3e} also where the body does not touch. Give it as a table over s that ends with the contact."
                ),
            );
        }
        if let Some((length, radius)) = self.unresolved_radius() {
            warn(
                "mesh_too_coarse_for_radius",
                format!(
                    "The edge under the peak of σ_t ({length:.3e}) is longer than the nonlocal radius ({radius}): the averaging is not resolved there. Refine the mesh."
                ),
            );
        }
        let edges = (0..contact.boundary.edge_count())
            .filter(|k| edge_nodes(*k).iter().all(|&i| self.active(i)))
            .count();
        if edges < FEWEST_EDGES {
            warn(
                "mesh_too_coarse_for_contact",
                format!(
                    "Only {edges} whole element(s) lie in the contact; at least {FEWEST_EDGES} are needed for a pressure to rely on. {} Refine the mesh there.",
                    self.peak_uncertainty(edges)
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
        let radius = contact
            .friction
            .as_ref()
            .and_then(|f| f.nonlocal_radius)
            .unwrap_or(0.0);
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

    /// How far the peak pressure may be off with so few elements in contact. The worst of many meshes
    /// of Hertz's cylinder is .28/n², n elements across the whole contact (`tests/verification`).
    fn peak_uncertainty(&self, edges: usize) -> String {
        let count = self.count();
        let pressed = [0, count - 1].into_iter().filter(|&i| self.active(i));
        let (mirrored, sharp): (Vec<usize>, Vec<usize>) = pressed.partition(|&i| self.symmetric(i));
        let across = edges * (1 + mirrored.len());
        if across == 0 {
            "Nothing is known of its peak.".to_owned()
        } else if !sharp.is_empty() {
            "At the obstacle's end its peak has no limit.".to_owned()
        } else {
            let off = 100.0 * SMOOTH_PEAK / (across * across) as f64;
            format!("A smooth pressure's peak is then off by up to {off:.1} %.")
        }
    }

    /// Inside an edge the tangential stress changes its sign where the motion turns, mostly once. What
    /// else cancels inside edges is an oscillation of stick tractions, and `friction_force` is too
    /// large by about that much.
    fn warn_of_oscillation(&self, warnings: &mut Vec<Warning>) {
        let points = self.system.points.iter().zip(&self.finished.tractions);
        let own: Vec<f64> = points
            .filter(|(point, _)| point.patch == self.p)
            .map(|(point, traction)| point.weight * traction)
            .collect();
        if !self.at_gauss_points() {
            return; // friction at nodes does not oscillate
        }
        let cancels = |edge: &[f64]| {
            let size: f64 = edge.iter().map(|force| force.abs()).sum();
            size - edge.iter().sum::<f64>().abs()
        };
        let total: f64 = own.iter().map(|force| force.abs()).sum();
        let mut canceling: f64 = own.chunks(3).map(cancels).sum();
        // the motion may turn once, within a coarse edge; but not from the full bound one way to the
        // full bound the other way
        let reached: Vec<bool> = self
            .system
            .points
            .iter()
            .zip(self.finished.tractions.iter().zip(&self.finished.bound))
            .filter(|(point, _)| point.patch == self.p)
            .map(|(_, (traction, tau))| traction.abs() >= *tau)
            .collect();
        let turns = own.chunks(3).zip(reached.chunks(3));
        let turn = turns
            .filter(|(_, reached)| reached.iter().filter(|r| **r).count() < 2)
            .map(|(edge, _)| cancels(edge))
            .fold(0.0, f64::max);
        if turn < TURN * total {
            canceling -= turn;
        }
        if canceling > OSCILLATING * total {
            warnings.push(Warning {
                code: "oscillating_stick".to_owned(),
                pointer: self.patch.contact.pointer.clone(),
                message: format!(
                    "The tangential stress oscillates between the friction points of single edges: the mesh does not resolve elastic_slip, and friction_force is too large by about {:.1} %. Refine the contact, raise elastic_slip, or choose \"points\": \"nodal\".",
                    100.0 * canceling / total
                ),
            });
        }
    }

    /// A node on a line of symmetry: on the axis, or held along the tangent.
    fn symmetric(&self, i: usize) -> bool {
        let node = &self.system.nodes[self.patch.first + i];
        node.follows.is_some() || matches!(node.tangent, Dof::Fixed(value) if value == 0.0)
    }
}

fn state(engaged: bool, sticks: bool) -> NodeState {
    match (engaged, sticks) {
        (false, _) => NodeState::Open,
        (true, true) => NodeState::Stick,
        (true, false) => NodeState::Slip,
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
