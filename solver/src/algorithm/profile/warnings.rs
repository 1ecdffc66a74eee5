//! Warnings about a contact.

use super::PatchView;
use crate::algorithm::system::Point;
use crate::contact::edge_nodes;
use crate::elasticity::{Dof, Side, growth};
use crate::friction::BoundLaw;
use crate::problem::{Condition, History, Measure, NormalOf, Normalization};
use crate::solution::{Outcome, Warning, WarningCode};

/// The relative error of the peak of a smooth pressure, times the square of the number of elements across the contact.
const SMOOTH_PEAK: f64 = 0.28;

/// The largest part of the friction force that may cancel inside edges before stick tractions count as oscillating.
const OSCILLATING: f64 = 3e-3;

/// The largest friction, as a part of the normal force, that cannot be distinguished from zero, as rounding leaves that
/// much. The same holds for ten times the tolerance, which the iterations leave: residuals are relative to the largest
/// reaction.
const UNKNOWN: f64 = 1e-9;

/// The part of the friction that the bound allows above which friction is meaningful however small it is.
const SLIGHT: f64 = 1e-3;

/// The part of the friction force that may cancel inside one edge without being an oscillation, since the motion may
/// turn there.
const TURN: f64 = 0.02;

/// The part of the friction that may act where the body does not touch without a note.
const MOST_BEYOND: f64 = 0.05;

/// The largest part of the friction that may be lost at the ends of the boundary without a warning.
const MOST_LOST: f64 = 0.05;

/// The largest distance from the obstacle at which a node may press, as a part of the largest normal displacement.
const MOST_EARLY: f64 = 0.01;

/// The largest displacement, as a part of the gap, that rounding leaves of a body after unloading.
const LEFT: f64 = 1e-12;

/// The largest slope of an obstacle at its middle, as a part of its slope over the first edge beside it.
const LEVEL: f64 = 1e-3;

/// The largest part of what a tilt does to the gap that may be left out.
const LEFT_OUT_OF_TILT: f64 = 0.05;

/// The largest rotation of an obstacle that counts as small (radians).
const LARGE_TILT: f64 = 0.05;

/// The smallest number of edges across a contact, of which half may be modelled, with which its pressure is reliable.
const FEWEST_EDGES: usize = 6;

/// A function that adds a warning about the contact.
type Warn<'a> = dyn FnMut(WarningCode, String) + 'a;

impl PatchView<'_> {
    pub(in crate::algorithm) fn warn(&self, warnings: &mut Vec<Warning>) {
        self.warn_of_oscillation(warnings);
        self.warn_of_missed(warnings);
        self.warn_of_displaced(warnings);
        self.warn_of_tilt(warnings);
        self.warn_of_kinks(warnings);
        self.warn_of_junction(warnings);
        self.warn_of_turning_normals(warnings);
        self.forget_far_ends(warnings);
        self.warn_of_contact(warnings);
    }

    /// Removes the warning about an end of the obstacle that cuts an edge, if the contact does not reach as far.
    fn forget_far_ends(&self, warnings: &mut Vec<Warning>) {
        let contact = self.patch.contact;
        // at a line of symmetry the boundary ends, and not the obstacle
        let mut ends = [0, self.count() - 1].into_iter();
        let reached = ends.any(|end| self.active(end) && !self.symmetric(end));
        if reached || contact.condition != Condition::Unilateral {
            return;
        }
        warnings.retain(|warning| {
            let own = warning.pointer.strip_suffix("/obstacle") == Some(&contact.pointer);
            warning.code != WarningCode::ObstacleCutsEdge || !own
        });
    }

    fn warn_of_contact(&self, warnings: &mut Vec<Warning>) {
        let contact = self.patch.contact;
        let warn = &mut |code: WarningCode, message: String| {
            warnings.push(Warning {
                code,
                pointer: contact.pointer.clone(),
                message,
            });
        };
        self.warn_of_jumps(warn);
        if contact.condition != Condition::Unilateral {
            return;
        }
        let mut touching = (0..self.count()).filter(|&i| self.active(i));
        let Some(first) = touching.next() else {
            let (code, how) = match self.system.touched.contains(&self.p) {
                true => (WarningCode::ContactOpened, "no longer touches"),
                false => (WarningCode::NoContact, "never touches"),
            };
            let how = format!("{how} {}", contact.opposite());
            warn(code, self.without_contact(&how));
            return;
        };
        let last = touching.next_back().unwrap_or(first);
        if let Some(tau) = self.bound_beyond_contact() {
            warn(
                WarningCode::BoundBeyondContact,
                format!(
                    "The prescribed friction bound acts on the whole boundary, as in Tresca's law: up to {tau:.3e} also where the body does not touch {}. Give it as a table over s that ends with the contact.",
                    contact.opposite()
                ),
            );
        }
        self.warn_of_coarse_mesh(warn);
        self.warn_of_total_law(first, last, warn);
        self.warn_of_closing(warn);
        self.warn_of_ends(first, last, warn);
    }

    /// Warns of a friction bound that jumps as a function of the pressure, so that the iterations do not come to rest.
    fn warn_of_jumps(&self, warn: &mut Warn<'_>) {
        let settled = matches!(
            self.finished.outcome,
            Outcome::Converged | Outcome::Canceled
        );
        let law = self.patch.contact.friction.as_ref().map(|law| &law.bound);
        if let Some(BoundLaw::Pressure {
            cohesion, average, ..
        }) = law
            && *cohesion > 0.0
            && !settled
        {
            let message = match average.radius {
                0.0 => {
                    "The friction bound jumps by the cohesion where the pressure ends; without a nonlocal radius the nodes there may enter and leave contact endlessly. Give a radius of at least one element."
                }
                _ => {
                    "The friction bound jumps by the cohesion where the averaged pressure ends, and from nothing as soon as the body touches at all: where that friction lifts it off again, there is no equilibrium. Press it further, or give less cohesion."
                }
            };
            warn(WarningCode::CohesionJumps, message.to_owned());
        }
    }

    /// Warns of an obstacle that turns too far for a small rotation.
    pub(super) fn warn_of_tilt(&self, warnings: &mut Vec<Warning>) {
        let [.., tilt] = self.motions;
        if tilt.abs() > LARGE_TILT {
            warnings.push(Warning {
                code: WarningCode::LargeTilt,
                pointer: self.patch.contact.pointer.clone(),
                message: format!(
                    "The obstacle turns by {tilt:.3} radians ({:.1}°), but gaps are linear in the tilt, as of a small rotation. Draw the obstacle nearer to its final position, or hold it against turning.",
                    tilt.to_degrees()
                ),
            });
        }
        let tool = self.patch.contact.tool.as_ref();
        let turns = tool.is_some_and(|tool| tilt != 0.0 || tool.loads[2].is_some());
        let left_out = self.part_of_tilt_left_out();
        if turns && left_out > LEFT_OUT_OF_TILT {
            warnings.push(Warning {
                code: WarningCode::LargeTilt,
                pointer: self.patch.contact.pointer.clone(),
                message: format!(
                    "A rotation about `about` moves the obstacle along the body, too, and with \"normal\": \"body\" its shape does not follow: that leaves out up to {:.0} % of what the rotation does to the gap, and the moment is that of pressures along the body's normals. Give \"normal\": \"obstacle\" and a `direction`, or an `about` near the contact if only the slope of the obstacle is meant.",
                    100.0 * left_out
                ),
            });
        }
    }

    /// What a unit tilt would do to the gap by moving the obstacle's shape along the body, which contact along the body's normals
    /// leaves out: the largest of it in the contact, as a part of what the tilt does to the gap.
    fn part_of_tilt_left_out(&self) -> f64 {
        let contact = self.patch.contact;
        let (Some(tool), NormalOf::Body) = (&contact.tool, contact.normal) else {
            return 0.0;
        };
        let s = &contact.boundary.s;
        let (mut left_out, mut done) = (0.0f64, 0.0f64);
        for i in (1..self.count() - 1).filter(|&i| self.active(i)) {
            let slope = (contact.profile[i + 1] - contact.profile[i - 1]) / (s[i + 1] - s[i - 1]);
            left_out = left_out.max((tool.row(i, 2)[1] * slope).abs());
            // a contact of one node, which may be that about which the obstacle turns, is as long as its neighbours are apart
            let beside = [i - 1, i, i + 1].map(|i| tool.row(i, 2)[0].abs());
            done = beside.into_iter().fold(done, f64::max);
        }
        if left_out > 0.0 { left_out / done } else { 0.0 }
    }

    /// The message for a body that touches the obstacle at no node: how far the obstacle is from it.
    fn without_contact(&self, how: &str) -> String {
        let contact = self.patch.contact;
        let moved = |i: usize| {
            self.system
                .normal_displacement(self.v, self.patch.first + i)
        };
        let opening = |i: usize| self.system.opening(self.v, self.patch.first + i);
        let nearest = (0..self.count()).min_by(|&a, &b| opening(a).total_cmp(&opening(b)));
        let smallest = nearest.map_or(f64::INFINITY, opening);
        if let Some(pair) = &contact.pair {
            return format!(
                "The body {how}: the smallest gap to `{}` is {smallest:.6e}.",
                pair.boundary
            );
        }
        // without contact the obstacle does not deform the body: the missing indentation is the gap
        let engages = |i: usize| (contact.profile[i] - moved(i)) / contact.push[i][0];
        // a push in a direction of its own may lead away from some nodes
        let nearer = |i: &usize| contact.push[*i][0] > 0.0;
        let nodes = (0..self.count()).filter(nearer);
        let needed = nodes.map(engages).fold(f64::INFINITY, f64::min);
        let needed = match needed {
            needed if needed.abs() <= LEFT * smallest.abs() => 0.0,
            needed => needed,
        };
        if self.missed().is_empty() {
            format!(
                "The body {how}: the smallest gap is {smallest:.6e}. There is contact if the indentation is above {needed:.6e}."
            )
        } else {
            format!(
                "No node touches the obstacle, although it reaches into the body between two nodes: the smallest gap at a node is {smallest:.6e}. A node touches if the indentation is above {needed:.6e}."
            )
        }
    }

    /// Warns of a mesh that is too coarse for the nonlocal radius, the contact or the gap at the axis.
    fn warn_of_coarse_mesh(&self, warn: &mut Warn<'_>) {
        if let Some((length, radius)) = self.unresolved_radius() {
            warn(
                WarningCode::MeshTooCoarseForRadius,
                format!(
                    "The edge under the peak of σ_t ({length:.3e}) is longer than the nonlocal radius ({radius}): the averaging is not resolved there. Refine the mesh."
                ),
            );
        }
        let edges = (0..self.patch.contact.boundary.edge_count())
            .filter(|k| edge_nodes(*k).iter().all(|&i| self.active(i)))
            .count();
        // with those beyond lines of symmetry
        let across = edges * (1 + self.mirrored_ends());
        if across < FEWEST_EDGES {
            warn(
                WarningCode::MeshTooCoarseForContact,
                format!(
                    "Only {across} whole element(s) lie in the contact; at least {FEWEST_EDGES} are needed for a reliable pressure. {} Refine the mesh there.",
                    self.peak_uncertainty(across)
                ),
            );
        }
        if let Some(opening) = self.pressed_beside_open_axis() {
            warn(
                WarningCode::MeshTooCoarseForContact,
                format!(
                    "The node on the axis is open, and the midside node beside it is pressed although it is still {opening:.3e} away from the obstacle: the gap at the axis lies within the first element, where the pressure and the displacements are wrong. Refine the mesh there, or end the obstacle's profile where it begins."
                ),
            );
        }
    }

    /// Notes that the total law is not Coulomb's law along the way to the end: where the contact grows while it is pressed, or
    /// several load steps lead there, and a part of the contact sticks. `first` and `last`: the outermost nodes in contact.
    fn warn_of_total_law(&self, first: usize, last: usize, warn: &mut Warn<'_>) {
        let contact = self.patch.contact;
        let law = contact.friction.as_ref();
        if law.is_none_or(|law| law.history != History::Total) {
            return;
        }
        let points = self.system.points.iter().zip(&self.finished.tractions);
        let mut rubbed =
            points.filter(|(point, traction)| point.patch == self.p && **traction != 0.0);
        let sticks = |point: &Point| {
            let slip = self.system.slip(self.v, point);
            self.system.law(point).sticks(slip)
        };
        if !rubbed.any(|(point, _)| sticks(point)) {
            return;
        }
        // an end that the obstacle, the body or a line of symmetry has is there from the beginning
        let given = |i: usize| [0, self.count() - 1].contains(&i);
        let why = if !(given(first) && given(last)) {
            "the contact grows while it is pressed"
        } else if self.system.model.steps.len() > 1 {
            "several load steps lead to this state"
        } else {
            return;
        };
        warn(
            WarningCode::TotalLaw,
            format!(
                "Friction follows the total law, by the displacements at the end alone, and {why}: with \"history\": \"incremental\", Coulomb's law along the way, stick zones and tangential forces are others, often by tens of per cent."
            ),
        );
    }

    /// Warns where the total law counts as slip what closes the gap, since the gap closes across the normals of the contact.
    fn warn_of_closing(&self, warn: &mut Warn<'_>) {
        let contact = self.patch.contact;
        let law = contact.friction.as_ref();
        let Some(law) = law.filter(|law| law.history == History::Total) else {
            return;
        };
        let slope = |i: usize| match (&contact.pair, &contact.along) {
            (Some(pair), _) => pair.turned[i],
            (None, Some(_)) if contact.push[i][0] > 0.0 => contact.push[i][1] / contact.push[i][0],
            _ => 0.0,
        };
        let touching = (0..self.count()).filter(|i| self.active(*i));
        let most = touching
            .map(|i| (contact.profile[i] * slope(i)).abs())
            .fold(0.0, f64::max);
        if most > law.elastic_slip {
            let instead = match (&contact.pair, contact.normal) {
                (Some(_), _) => "\"normal\": \"mean\", or ",
                (None, NormalOf::Body) => "\"normal\": \"obstacle\", or ",
                _ => "",
            };
            warn(
                WarningCode::ClosingCountsAsSlip,
                format!(
                    "The gap closes across the normals of the contact: before anything touches, up to {most:.3e} of that way lies along the surface, and the total law counts it as slip, which exceeds elastic_slip ({:.3e}). Give {instead}\"history\": \"incremental\" with enough increments.",
                    law.elastic_slip
                ),
            );
        }
    }

    /// Warns of contact at the ends of the obstacle, and of averages that reach beyond ends. `first` and `last`: the
    /// outermost nodes in contact.
    fn warn_of_ends(&self, first: usize, last: usize, warn: &mut Warn<'_>) {
        let contact = self.patch.contact;
        let s = &contact.boundary.s;
        let sharp = |i: &usize| self.active(*i) && self.may_be_sharp(*i);
        for end in [0, self.count() - 1].into_iter().filter(sharp) {
            let limits = "the pressure grows without limit as the mesh is refined: forces converge, and σ_t does for nonlocal_radius > 0, but the peak of σ_n does not";
            let at = s[end];
            if contact.last_points[usize::from(end > 0)] {
                warn(
                    WarningCode::ContactReachesObstacleEnd,
                    format!(
                        "The body presses against the last point of the obstacle, s = {at:.4}. If the obstacle continues there, give more points; if it ends there, {limits}."
                    ),
                );
            } else {
                warn(
                    WarningCode::SharpEdge,
                    format!("The contact ends at a sharp edge, s = {at:.4}: there {limits}."),
                );
            }
        }
        let free = |i: &usize| !self.symmetric(*i);
        let mut ends = [0, self.count() - 1].into_iter().filter(free);
        if let Some(end) = ends.find(|end| self.is_half_of_obstacle(*end)) {
            let at = s[end];
            warn(
                WarningCode::SymmetryMissing,
                format!(
                    "The middle of the obstacle lies at an end of the contact boundary, s = {at:.4}, where the side of the body is free: it may bulge there. If the body goes on there, symmetric to what is modelled, support that side perpendicular to it (`ux`: 0 for a vertical one); if the obstacle is meant to be elsewhere, give its `center`."
                ),
            );
        }
        let lost = self.lost_at_ends();
        if lost > MOST_LOST {
            warn(
                WarningCode::FrictionLostAtEnd,
                format!(
                    "The averaged pressure reaches beyond the end of the contact boundary, and {:.1} % of the friction is lost there: at full sliding the friction force would be {:.3} of μ times the normal force. Choose a smaller nonlocal_radius, or \"normalization\": \"conserving\".",
                    100.0 * lost,
                    1.0 - lost
                ),
            );
        }
        let beyond = self.friction_beyond_contact();
        if beyond > MOST_BEYOND {
            warn(
                WarningCode::FrictionBeyondContact,
                format!(
                    "{:.0} % of the friction acts where the body does not touch: the averaged pressure, and friction with it, reaches beyond the contact by the nonlocal radius.",
                    100.0 * beyond
                ),
            );
        }
        let radius = contact.friction.as_ref().and_then(|f| f.bound.radius());
        let ends = [first, last].into_iter();
        let mirrored = ends.filter(|&i| self.symmetric(i)).count();
        let width = (s[last] - s[first]) * (1 + mirrored) as f64;
        if let Some(radius) = radius.filter(|radius| *radius > width && width > 0.0) {
            warn(
                WarningCode::RadiusExceedsContact,
                format!(
                    "The nonlocal radius {radius} is larger than the whole contact, {width:.4}: the averaged pressure, and friction with it, extends beyond the contact."
                ),
            );
        }
    }

    /// Whether the obstacle is level at this end of the boundary and recedes from the body along it, as half of a symmetric
    /// one does. A free corner may sink away from it: then only the obstacle's lowest point counts as its middle.
    fn is_half_of_obstacle(&self, end: usize) -> bool {
        let contact = self.patch.contact;
        if contact.pair.is_some() {
            return false;
        }
        let (s, profile) = (&contact.boundary.s, &contact.profile);
        if !self.active(end) && profile.iter().any(|height| *height < profile[end]) {
            return false;
        }
        // the second node of the first or the last edge that is no midside node
        let inner = if end == 0 { 2 } else { end - 2 };
        let rise = (profile[inner] - profile[end]) / (s[inner] - s[end]).abs();
        let slope = contact.end_slopes[usize::from(end > 0)];
        rise > 0.0 && slope.abs() <= LEVEL * rise
    }

    /// The part of ∫|σ_t| at places without pressure.
    fn friction_beyond_contact(&self) -> f64 {
        let law = self.patch.contact.friction.as_ref();
        if law.and_then(|law| law.bound.radius()).unwrap_or(0.0) == 0.0 {
            return 0.0;
        }
        let (mut beyond, mut whole) = (0.0, 0.0);
        let points = self.system.points.iter().zip(&self.finished.tractions);
        for (point, traction) in points.filter(|(point, _)| point.patch == self.p) {
            let active = &self.finished.state.active;
            let touches = point.nodes.iter().any(|&node| active[node]);
            let friction = point.weight * traction.abs();
            whole += friction;
            beyond += if touches { 0.0 } else { friction };
        }
        if whole > 0.0 { beyond / whole } else { 0.0 }
    }

    /// The part of ∫p that averaging moves beyond the ends of the contact boundary, where no friction acts.
    fn lost_at_ends(&self) -> f64 {
        let averages = self.patch.law.as_ref().map(|law| &law.bound);
        let (
            Some(BoundLaw::Pressure { average, .. }),
            Some(BoundLaw::Pressure { average: given, .. }),
        ) = (
            averages,
            self.patch.contact.friction.as_ref().map(|law| &law.bound),
        )
        else {
            return 0.0;
        };
        if given.normalization != Normalization::UnitIntegral || given.measure != Measure::Line {
            return 0.0;
        }
        let pressures = &self.forces.pressures;
        let (mut lost, mut whole) = (0.0, 0.0);
        for place in &self.patch.contact.boundary.friction_points {
            let pressure: f64 = (0..3)
                .map(|i| place.shape[i] * pressures[self.patch.first + place.nodes[i]])
                .sum();
            if pressure == 0.0 {
                continue;
            }
            whole += place.weight * pressure;
            lost += place.weight * pressure * (1.0 - average.part_inside(place.s));
        }
        if whole > 0.0 { lost / whole } else { 0.0 }
    }

    /// The possible error of the peak pressure with few elements in contact, as a sentence. The worst of many meshes of
    /// Hertz's cylinder is 0.28/n², with n elements across the whole contact (`tests/verification`).
    fn peak_uncertainty(&self, across: usize) -> String {
        let mut ends = [0, self.count() - 1].into_iter();
        if across == 0 {
            "The error of its peak is unknown.".to_owned()
        } else if ends.any(|i| self.active(i) && self.may_be_sharp(i)) {
            "At the sharp end of the contact the pressure is unbounded: its peak grows with every finer mesh.".to_owned()
        } else {
            let off = 100.0 * SMOOTH_PEAK / (across * across) as f64;
            format!("The peak of a smooth pressure is then wrong by up to {off:.1} %.")
        }
    }

    /// Warns of stick tractions that oscillate: that change their sign inside an edge, or have a ripple. Inside an edge the tangential
    /// stress changes its sign where the motion turns, mostly once. Any other cancellation inside edges is an oscillation, and
    /// `friction_force` is too large by about the part that cancels.
    fn warn_of_oscillation(&self, warnings: &mut Vec<Warning>) {
        let (canceling, total) = self.oscillation();
        let message = match self.large_ripple() {
            _ if self.is_noise(total) => return,
            _ if canceling > OSCILLATING * total => format!(
                "The tangential stress oscillates between the friction points of single edges: the mesh does not resolve elastic_slip, and friction_force is too large by about {:.1} %. Refine the contact, raise elastic_slip, or choose \"points\": \"nodal\".",
                100.0 * canceling / total
            ),
            Some(part) => format!(
                "Where the body sticks, the tangential stress rises and falls within each edge, by about {:.0} % of its peak. Forces are right; single values of the tangential stress are not, and a place where it just reaches the friction bound may be due to that. Refine the contact, raise elastic_slip, or read means over edges.",
                100.0 * part
            ),
            None => return,
        };
        warnings.push(Warning {
            code: WarningCode::OscillatingStick,
            pointer: self.patch.contact.pointer.clone(),
            message,
        });
    }

    /// Whether a friction force (without 2π) is only rounding: if nothing slides, as under a uniform pressure with ν =
    /// 0, the tangential stress may have any sign.
    fn is_noise(&self, friction: f64) -> bool {
        let (system, p) = (self.system, self.p);
        let pressed = system.normal_force(system.range(self.patch), &self.forces.reactions);
        let scale = if pressed > 0.0 {
            pressed
        } else {
            system.reference_force
        };
        let points = system.points.iter().zip(&self.finished.bound);
        let own = points.filter(|(point, _)| point.patch == p);
        let most: f64 = own.map(|(point, tau)| point.weight * tau).sum();
        let known = f64::max(UNKNOWN, 10.0 * system.model.controls.tolerance);
        friction <= known * scale && friction <= SLIGHT * most
    }

    /// The part of the friction force that cancels inside edges, except where the motion turns; and the whole friction
    /// force (both without 2π).
    pub(super) fn oscillation(&self) -> (f64, f64) {
        let points = self.system.points.iter().zip(&self.finished.tractions);
        let own: Vec<f64> = points
            .filter(|(point, _)| point.patch == self.p)
            .map(|(point, traction)| point.weight * traction)
            .collect();
        if !self.at_gauss_points() {
            return (0.0, 0.0); // friction at nodes does not oscillate
        }
        let total: f64 = own.iter().map(|force| force.abs()).sum();
        let mut canceling: f64 = own.chunks(3).map(cancels).sum();
        // the motion may turn once, within a coarse edge; but not from the full bound in one direction to
        // the full bound in the other
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
        (canceling, total)
    }

    /// By edge, the part of the friction force that cancels inside the edge (force, without 2π).
    pub(super) fn canceling(&self) -> Vec<f64> {
        let points = self.system.points.iter().zip(&self.finished.tractions);
        let own = points.filter(|(point, _)| point.patch == self.p);
        let own: Vec<f64> = own
            .map(|(point, traction)| point.weight * traction)
            .collect();
        if self.at_gauss_points() {
            own.chunks(3).map(cancels).collect()
        } else {
            Vec::new()
        }
    }

    /// The distance from the obstacle at which the midside node beside an open node on the axis is pressed, by u₁ −
    /// u₀/8 ≤ s₁ − s₀/8 (formulation 3.5); none if the distance is small compared with the displacements.
    fn pressed_beside_open_axis(&self) -> Option<f64> {
        let first = self.patch.first;
        let moved = |i: usize| self.displacement(i)[0].abs();
        let largest = (0..self.count()).map(moved).fold(0.0, f64::max);
        let opening = |i: usize| {
            let end = self.system.nodes[first + i].beside_axis?;
            let pressed = self.active(i) && !self.finished.state.active[end];
            pressed.then(|| self.system.opening(self.v, first + i))
        };
        let openings = (0..self.count()).filter_map(opening);
        openings
            .reduce(f64::max)
            .filter(|opening| *opening > MOST_EARLY * largest)
    }

    /// Whether a node lies on a line of symmetry: it is on the axis, or held along the tangent.
    pub(super) fn symmetric(&self, i: usize) -> bool {
        let node = &self.system.nodes[self.patch.first + i];
        node.on_axis || node.symmetric()
    }

    /// Whether the contact may end at a node with a pressure without a limit: the node is not on a line of symmetry, not in a
    /// corner that another obstacle touches too, and not a corner of the body in which the pressure has a limit.
    pub(super) fn may_be_sharp(&self, i: usize) -> bool {
        let (system, node) = (self.system, self.patch.contact.boundary.nodes[i]);
        let others = (0..system.patches.len()).filter(|p| *p != self.p);
        let mut there = others.flat_map(|p| {
            let patch = &system.patches[p];
            patch.contact.boundary.nodes.iter().zip(system.range(patch))
        });
        let touched = there.any(|(other, k)| *other == node && self.finished.state.active[k]);
        let beside = if i == 0 { 1 } else { i - 1 };
        !self.symmetric(i) && !touched && !self.is_mild_corner(i) && !self.ends_before(i, beside)
    }

    /// Whether the body itself ends at the first or the last node of the boundary, on an obstacle that goes on, in a corner so
    /// narrow that the pressure has a limit: up to a right angle, if the material is isotropic. Only without friction, whose
    /// traction at the corner no pressure alone can balance.
    fn is_mild_corner(&self, i: usize) -> bool {
        let ends = self.mild_corners.get_or_init(|| {
            let last = self.count() - 1;
            [0, last].map(|end| self.has_limit_in_corner(end))
        });
        ends[usize::from(i > 0)]
    }

    fn has_limit_in_corner(&self, i: usize) -> bool {
        /// A corner that is wider has no limit, whatever the material.
        const WIDEST: f64 = 0.75 * std::f64::consts::PI;
        let node = &self.system.nodes[self.patch.first + i];
        let slides_freely = self.patch.contact.condition == Condition::Unilateral
            && self.patch.law.is_none()
            && node.oblique.is_none()
            && matches!(node.tangent, Dof::Free(_));
        if !slides_freely || !self.active(i) {
            return false;
        }
        let Some(wedges) = self.wedges_at(i) else {
            return false;
        };
        let angle: f64 = wedges.iter().map(|w| w.angles[1] - w.angles[0]).sum();
        let contact = [i > 0, i == 0];
        let sides = contact.map(|contact| {
            if contact {
                Side::Slides(0.0)
            } else {
                Side::Free
            }
        });
        angle <= WIDEST
            && growth(&wedges, sides, [false; 2]).is_some_and(|growth| growth.exponent.is_none())
    }

    /// The largest |σ_t| that a prescribed bound exerts on edges without a node in contact; none without such friction.
    fn bound_beyond_contact(&self) -> Option<f64> {
        let BoundLaw::Prescribed(_) = self.patch.contact.friction.as_ref()?.bound else {
            return None;
        };
        let open = |node: usize| !self.active(node - self.patch.first);
        let points = self.system.points.iter().zip(&self.finished.tractions);
        let largest = points
            .filter(|(point, _)| point.patch == self.p && point.nodes.iter().all(|n| open(*n)))
            .fold(0.0f64, |most, (_, traction)| most.max(traction.abs()));
        (largest > 0.0).then_some(largest)
    }

    /// The length of the edge under the peak of σ_t, and ρ, if the edge is longer than ρ. None if it is not, and if all
    /// edges are longer, which has a warning before the solution.
    fn unresolved_radius(&self) -> Option<(f64, f64)> {
        let contact = &self.patch.contact;
        let radius = contact.friction.as_ref()?.bound.averaged_over()?;
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
        let sizes = edges().map(|edge| (size(edge), edge));
        let (_, under) = sizes.max_by(|a, b| a.0.total_cmp(&b.0))?;
        // rounding of a grid whose lines are ρ apart
        (length(under) > radius * (1.0 + 1e-9)).then_some((length(under), radius))
    }
}

/// The sum of the sizes of the forces at the points of an edge, less the size of their sum: what cancels.
fn cancels(edge: &[f64]) -> f64 {
    let size: f64 = edge.iter().map(|force| force.abs()).sum();
    size - edge.iter().sum::<f64>().abs()
}
