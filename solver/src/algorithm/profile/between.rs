//! Finds where an obstacle reaches into the body or recedes from it between nodes, and kinks of the obstacle and corners
//! of the body, where the pressure is unbounded.

use std::collections::BTreeMap;
use std::f64::consts::{LN_2, PI};

use super::{Highest, Missed, PatchView};
use crate::contact::edge_nodes;
use crate::contact::obstacle::Place;
use crate::elasticity::Dof;
use crate::element::edge3;
use crate::friction::BoundLaw;
use crate::problem::{Condition, NormalOf};
use crate::solution::{Outcome, Warning, WarningCode};

/// The smallest severity with which a place is reported. In a contact that is resolved, a kink that points at the body
/// between nodes has up to 0.4, a smooth obstacle up to 0.11 (the random problems of `tests/verification`).
const SERIOUS: f64 = 0.5;

/// The factor on the pressure of a wave whose crests touch while the hollows between them do not; 1.1 would be enough
/// if the hollows almost touch.
const PARTIAL: f64 = 1.5;

/// The largest pressure, as a part of its peak, that a shape of the obstacle between the nodes may add without
/// counting. A circle adds less on any mesh that resolves its contact.
const SLIGHT: f64 = 1e-3;

/// The largest pressure, as a part of its mean, that a shape of the obstacle between the nodes may add without a
/// report, if no stated error of a peak contains it. This is the accuracy of peaks of a `fair` result.
const TELLING: f64 = 0.2;

/// The shortest length, as a part of the distance of the nodes, over which a slope is measured.
const SHORTEST: f64 = 1.0 / 16.0;

/// The largest penetration that counts as rounding, as a part of the length of the contact boundary.
const ROUNDING: f64 = 1e-9;

/// A kink shapes the pressure if each halving of the mesh adds more than this part of the peak pressure.
const SHAPING: f64 = 0.01;

/// A shape of the obstacle between the nodes of an edge, which the nodes do not see.
pub(super) struct Wave {
    pub(super) edge: usize,
    /// The largest distance of the obstacle from the parabola through the nodes (length).
    height: f64,
    /// The distance between the nodes on either side of the wave (length).
    spacing: f64,
    /// The pressure that the wave may add (stress).
    pub(super) pressure: f64,
}

/// A kink of the obstacle in contact, or a corner of the body in contact.
pub(super) struct Kink {
    pub(super) edge: usize,
    s: f64,
    /// The change of slope of the gap at the kink, > 0; infinite at an edge of the obstacle.
    change: f64,
    /// The angle by which the body's surface turns at the kink; 0 where the surface is smooth.
    turn: f64,
    /// Whether it is a corner of the other body.
    facing: bool,
    /// The pressure that each halving of the mesh adds at the kink (stress).
    growth: f64,
    /// The distance between the nodes on either side of the kink (length).
    spacing: f64,
    /// Whether the kink is on a line of symmetry and due, at least in part, to the mirror image.
    mirrored: bool,
}

/// A corner of the body.
pub(super) struct Corner {
    pub(super) node: usize,
    /// The angle by which the body's surface turns at the corner.
    pub(super) turn: f64,
    /// The change of slope of the gap at the corner; < 0 where the corner points into the body.
    pub(super) change: f64,
}

impl PatchView<'_> {
    /// Places where the obstacle reaches into the body between the nodes or recedes from it, at most one for each edge,
    /// the deepest first. Only what the nodes do not see counts: a smooth obstacle is a parabola between nodes, and its
    /// error at the ends of contact belongs to the errors of the mesh.
    pub(in crate::algorithm) fn missed(&self) -> &[Missed] {
        self.missed.get_or_init(|| self.find_missed())
    }

    fn find_missed(&self) -> Vec<Missed> {
        let contact = self.patch.contact;
        let mut found: Vec<(usize, Missed)> = Vec::new();
        if contact.condition != Condition::Unilateral || self.finished.outcome != Outcome::Converged
        {
            return Vec::new();
        }
        let s = &contact.boundary.s;
        let least = ROUNDING * s[s.len() - 1];
        let reactions = &self.forces.reactions[self.system.range(self.patch)];
        let largest = reactions.iter().fold(0.0f64, |most, r| most.max(*r));
        let without_error = self.waves_without_error();
        for place in &contact.places {
            // it counts by the nearer of the two, and one of them is known
            let stiffness = self.stiffness(place.edge);
            let slight = |unseen: f64| {
                let serious = stiffness * unseen / largest >= SERIOUS;
                unseen <= least || !(serious || without_error.contains(&place.edge))
            };
            if slight(place.nearer.abs()) {
                continue;
            }
            let penetration = match place.nearer > 0.0 {
                true => self.penetration(place),
                // nodes that do not touch say nothing of the obstacle between them
                false if self.touched_beside(place) => place.nearer,
                false => continue,
            };
            let unseen = if place.nearer > 0.0 {
                penetration.min(place.nearer)
            } else {
                -penetration
            };
            if slight(unseen) {
                continue;
            }
            let severity = stiffness * unseen / largest;
            let missed = Missed {
                patch: self.p,
                s: self.arc(place),
                penetration,
                spacing: self.spacing(place),
                severity,
            };
            match found.last_mut() {
                Some((edge, deepest)) if *edge == place.edge => {
                    if deepest.penetration.abs() < penetration.abs() {
                        *deepest = missed;
                    }
                }
                _ => found.push((place.edge, missed)),
            }
        }
        let mut found: Vec<Missed> = found.into_iter().map(|(_, missed)| missed).collect();
        let depth = |missed: &Missed| missed.penetration.abs();
        found.sort_by(|a, b| depth(b).total_cmp(&depth(a)));
        found
    }

    /// The shapes of the obstacle between nodes that the nodes do not see, one for each edge that has such a shape. A
    /// wave of height h and length λ presses with the amplitude π E* h/(2 λ) on a half-plane in full contact, and with
    /// more if only its crests touch. The length of a wave is taken as the distance of the nodes, or as shorter if the
    /// wave is steeper.
    pub(super) fn unseen_waves(&self) -> Vec<Wave> {
        let contact = self.patch.contact;
        if contact.condition != Condition::Unilateral {
            return Vec::new();
        }
        let s = &contact.boundary.s;
        let least = ROUNDING * s[s.len() - 1];
        let mut found: Vec<Wave> = Vec::new();
        for places in contact.places.chunk_by(|a, b| a.edge == b.edge) {
            let edge = places[0].edge;
            for [from, to] in [[-1.0, 0.0], [0.0, 1.0]] {
                let within = |place: &&Place| place.xi > from && place.xi < to;
                let own: Vec<&Place> = places.iter().filter(within).collect();
                let height = own.iter().fold(0.0f64, |most, p| most.max(p.nearer.abs()));
                if height <= least || !self.touched_beside(own[0]) {
                    continue;
                }
                let spacing = self.spacing(own[0]);
                let inside = own.iter().map(|place| (place.xi, place.nearer));
                let at_nodes = |xi: f64| std::iter::once((xi, 0.0));
                let heights = at_nodes(from).chain(inside).chain(at_nodes(to));
                let turns = turning_points(heights);
                // from hollow to crest it is half a wave; what begins at a node may be no wave
                let inside = &turns[1..turns.len() - 1];
                let rise = |pair: &[(f64, f64)]| {
                    let length = (pair[1].0 - pair[0].0).max(SHORTEST) * spacing;
                    (pair[1].1 - pair[0].1).abs() / (2.0 * length)
                };
                let steepest = inside.windows(2).map(rise).fold(0.0, f64::max);
                let wave = Wave {
                    edge,
                    height,
                    spacing,
                    pressure: steepest.max(height / spacing),
                };
                match found.last_mut() {
                    Some(most) if most.edge == edge => {
                        if wave.pressure > most.pressure {
                            *most = wave;
                        }
                    }
                    _ => found.push(wave),
                }
            }
        }
        if found.is_empty() {
            return found;
        }
        let moduli = self.contact_moduli();
        for wave in &mut found {
            wave.pressure *= PARTIAL * 0.5 * PI * moduli[wave.edge];
        }
        found.retain(|wave| wave.pressure > SLIGHT * self.largest);
        found
    }

    /// The edges with waves that matter and that no stated error contains, since the peak of the pressure has no limit
    /// and therefore no error. A kink between nodes has a warning of its own and is left out.
    fn waves_without_error(&self) -> Vec<usize> {
        let contact = self.patch.contact;
        let mut waves = self.unseen_waves();
        if waves.is_empty() || !self.pressure_without_limit() {
            return Vec::new();
        }
        let weights = &contact.boundary.weights;
        let nodes = (0..self.count()).filter(|i| self.active(*i));
        let (force, area) = nodes.fold((0.0, 0.0), |(force, area), i| {
            (force + weights[i] * self.pressure(i), area + weights[i])
        });
        let mean = force / area;
        let moduli = self.contact_moduli();
        let kinked = |edge: usize| {
            contact.places.iter().any(|place| {
                let [before, after] = self.beside(place.edge, place.xi);
                let growth = Self::growth(&moduli, edge, place.kink);
                place.edge == edge && before != after && growth > SHAPING * mean
            })
        };
        waves.retain(|wave| wave.pressure > TELLING * mean && !kinked(wave.edge));
        waves.iter().map(|wave| wave.edge).collect()
    }

    /// The stress that an unseen wave may add to |σ_t|: the product of μ, the amplitude that averaging leaves of a wave
    /// twice as long (the longest that nodes do not see), and the part of full friction at the largest slip. The wave
    /// itself moves the surface along t by less than the wave's height.
    pub(super) fn friction_of(&self, wave: &Wave) -> f64 {
        let Some(law) = &self.patch.law else {
            return 0.0;
        };
        let BoundLaw::Pressure {
            coefficient,
            average,
            ..
        } = &law.bound
        else {
            return 0.0;
        };
        let own = self.system.points.iter().filter(|g| g.patch == self.p);
        let slips = own.map(|point| self.system.slip(self.v, point).abs());
        let slip = slips.fold(0.0, f64::max) + wave.height;
        let [start, end, _] = self.patch.contact.boundary.edge_arc(wave.edge);
        let uniform: f64 = average.row(0.5 * (start + end)).weights.iter().sum();
        let left = uniform * average.part_of_wave(2.0 * wave.spacing).abs();
        coefficient * left * wave.pressure * law.phi(slip)
    }

    /// Whether the nodes on either side of a place are in contact.
    fn touched_beside(&self, place: &Place) -> bool {
        self.beside(place.edge, place.xi)
            .iter()
            .all(|&i| self.active(i))
    }

    pub(super) fn warn_of_missed(&self, warnings: &mut Vec<Warning>) {
        let missed = self.missed();
        let Some(worst) = missed.first() else { return };
        let others = match missed.len() {
            1 => String::new(),
            count => format!(", and at {} other places", count - 1),
        };
        let Missed {
            s,
            penetration,
            spacing,
            ..
        } = worst;
        let message = if *penetration > 0.0 {
            format!(
                "The obstacle reaches {penetration:.3e} into the body between two nodes, at s = {s:.4}{others}: the nodes are {spacing:.3e} apart, and between them nothing resists it. Forces and peaks are not those of this obstacle. Put a grid line there, or refine the mesh until it resolves the obstacle."
            )
        } else {
            format!(
                "The obstacle recedes by {:.3e} between two nodes that touch it, at s = {s:.4}{others}: the nodes are {spacing:.3e} apart, and the body presses there as if the obstacle were smooth. Forces and peaks are not those of this obstacle. Refine the mesh until it resolves the obstacle.",
                -penetration
            )
        };
        warnings.push(Warning {
            code: WarningCode::ObstacleBetweenNodes,
            pointer: self.patch.contact.pointer.clone(),
            message,
        });
    }

    pub(super) fn warn_of_kinks(&self, warnings: &mut Vec<Warning>) {
        let polygon = self.warn_of_polygon(warnings);
        // corners of a polygon are told of with it
        let alone = |s: f64| polygon.as_ref().is_none_or(|polygon| !polygon.has(s));
        self.warn_of_notches(alone, warnings);
        let mut kinks = self.kinks();
        kinks.retain(|kink| kink.turn == 0.0 && !kink.facing || alone(kink.s));
        let Some(sharpest) = kinks.iter().max_by(|a, b| a.growth.total_cmp(&b.growth)) else {
            return;
        };
        let Kink {
            s,
            change,
            turn,
            growth,
            spacing,
            mirrored,
            facing,
            edge: _,
        } = sharpest;
        let peak = self.highest_pressure().map_or(0.0, |highest| highest.value);
        let count = match kinks.len() {
            1 => String::new(),
            count => format!("; it is the sharpest of {count}"),
        };
        let part = match growth / peak {
            part if part < 1.0 => format!("{:.1} % of the peak", 100.0 * part),
            _ => "more than the whole peak now".to_owned(),
        };
        let (size, growth) = if change.is_finite() {
            (
                match turn {
                    0.0 => format!("its slope changes by {change:.3e}"),
                    turn => format!("its surface turns by {:.2}°", turn.to_degrees()),
                },
                format!(
                    "each halving of the mesh, whose nodes are {spacing:.3e} apart there, adds about {growth:.3e}, {part}"
                ),
            )
        } else {
            (
                "it has an edge there".to_owned(),
                format!(
                    "it grows with each halving of the mesh, whose nodes are {spacing:.3e} apart there"
                ),
            )
        };
        let (mirrored, symmetric) = if *mirrored {
            (
                ", where it meets its mirror image",
                " At a line of symmetry give the points on both sides of it.",
            )
        } else {
            ("", "")
        };
        let message = match (turn, &self.patch.contact.pair) {
            (0.0, Some(pair)) if *facing => format!(
                "`{}` has a corner in the contact, opposite s = {s:.4}: {size}{count}. The pressure is unbounded at a corner: {growth}. If the corners only come from straight sides of elements on a curve, mesh it with elements of second order, or name the curve under /mesh/curves; else round the corner.",
                pair.boundary
            ),
            (0.0, _) => format!(
                "The obstacle has a kink in the contact, at s = {s:.4}{mirrored}: {size}{count}. The pressure is unbounded at a kink: {growth}. If the kinks only come from the points of a table or a polyline, choose \"interpolation\": \"cubic\", with `smoothing` if they were measured; else round the edge.{symmetric}"
            ),
            _ => format!(
                "The body has a corner in the contact, at s = {s:.4}{mirrored}: {size}{count}. The pressure is unbounded at a corner: {growth}. Friction differs between its two sides. If the corners only come from straight sides of elements on a curve, mesh it with elements of second order, or name the curve under /mesh/curves; else round the corner."
            ),
        };
        let corners = kinks.iter().filter(|kink| kink.turn != 0.0).count();
        let code = match corners {
            0 | 1 => WarningCode::KinkInContact,
            _ => WarningCode::PolygonInContact,
        };
        warnings.push(Warning {
            code,
            pointer: self.patch.contact.pointer.clone(),
            message,
        });
    }

    /// Corners of the body at the nodes that count, with the change of slope that the obstacle leaves. An obstacle that
    /// follows the body's surface has the same corners, and leaves none.
    pub(super) fn body_corners(&self, counts: impl Fn(&usize) -> bool) -> Vec<Corner> {
        let contact = self.patch.contact;
        if !contact.in_space || contact.condition != Condition::Unilateral {
            return Vec::new();
        }
        let facing = self.facing_corners();
        let corner = |node: usize| {
            let turn = contact.boundary.corner(node);
            if turn == 0.0 {
                return None;
            }
            let facing = facing.iter().filter(|(_, at)| *at == [node; 2]);
            let facing: f64 = facing
                .map(|(corner, _)| 2.0 * f64::tan(0.5 * corner.turn))
                .sum();
            // places are in order
            let own = contact
                .places
                .partition_point(|place| place.edge + 1 < node / 2);
            let own = contact.places[own..].iter();
            let own = own.take_while(|place| place.edge <= node / 2);
            let own = own.filter(|place| {
                place.kink != 0.0 && self.beside(place.edge, place.xi) == [node; 2]
            });
            let obstacle = own.map(|place| place.kink).sum::<f64>();
            let change = 2.0 * (0.5 * turn).tan() + obstacle + facing;
            Some(Corner { node, turn, change })
        };
        let corners = (2..self.count() - 1).step_by(2).filter(counts);
        corners.filter_map(corner).collect()
    }

    /// Corners of the body in contact or beside it.
    fn corners_in_contact(&self) -> Vec<Corner> {
        self.body_corners(|i| (i - 1..=i + 1).any(|i| self.active(i)))
    }

    /// The pressure that each halving of the mesh adds where the slope of the gap changes (stress).
    fn growth(moduli: &[f64], edge: usize, change: f64) -> f64 {
        0.5 / PI * LN_2 * moduli[edge] * change
    }

    /// Warns of corners that point into the body: the obstacle does not reach into them, so that the nodes show one
    /// contact where there are two, one on each side of the corner.
    fn warn_of_notches(&self, alone: impl Fn(f64) -> bool, warnings: &mut Vec<Warning>) {
        let mut notches = self.corners_in_contact();
        let s = &self.patch.contact.boundary.s;
        notches.retain(|notch| notch.change < 0.0 && alone(s[notch.node]));
        let peak = match self.highest_pressure() {
            Some(Highest { value, .. }) if !notches.is_empty() && value > 0.0 => value,
            _ => return,
        };
        let moduli = self.contact_moduli();
        notches.retain(|Corner { node, change, .. }| {
            Self::growth(&moduli, node / 2, change.abs()) > SHAPING * peak
        });
        let sharpest = notches.iter().min_by(|a, b| a.change.total_cmp(&b.change));
        let Some(Corner { node, turn, .. }) = sharpest else {
            return;
        };
        let s = self.patch.contact.boundary.s[*node];
        let count = match notches.len() {
            1 => String::new(),
            count => format!("; it is the sharpest of {count}"),
        };
        warnings.push(Warning {
            code: WarningCode::KinkInContact,
            pointer: self.patch.contact.pointer.clone(),
            message: format!(
                "The body has a reentrant corner in the contact, at s = {s:.4}: its surface turns by {:.2}°{count}. What lies opposite does not reach into the corner, and on finer meshes the contact splits into one on each side of it, with other peaks. If the corners only come from straight sides of elements on a curve, mesh it with elements of second order, or name the curve under /mesh/curves.",
                turn.to_degrees()
            ),
        });
    }

    /// Kinks in contact that shape the pressure: kinks of the obstacle, corners of the body, and places where the
    /// obstacle meets its mirror image at a line of symmetry. Beside a kink with the change of slope Δ the pressure of
    /// a half-plane with the contact modulus E* grows like E* Δ/(2π) · ln(1/distance); on the axis of a cone like E*
    /// Δ/4 · ln(1/distance).
    pub(super) fn kinks(&self) -> Vec<Kink> {
        let contact = self.patch.contact;
        if contact.condition != Condition::Unilateral {
            return Vec::new();
        }
        let last = self.count() - 1;
        // each with the turn of the body's surface; its kink is the whole change of slope
        let mut found: Vec<(Place, f64)> = Vec::new();
        let corners = self.corners_in_contact();
        let own_corner = |nodes: [usize; 2]| corners.iter().any(|c| nodes == [c.node; 2]);
        for place in contact.places.iter().filter(|place| place.kink > 0.0) {
            let nodes = self.beside(place.edge, place.xi);
            let at_end = nodes == [0; 2] || nodes == [last; 2];
            if !at_end && !own_corner(nodes) && nodes.iter().any(|&i| self.active(i)) {
                found.push((*place, 0.0));
            }
        }
        let at = |node: usize, edge: usize, xi: f64, kink: f64| Place {
            edge,
            xi,
            normal: contact.boundary.normals[node],
            profile: Default::default(),
            kink,
            nearer: 0.0,
        };
        let facing = self.facing_corners().into_iter().filter(|(corner, nodes)| {
            let touches = nodes.iter().any(|i| self.active(*i));
            corner.sharp && corner.turn > 0.0 && touches && !own_corner(*nodes)
        });
        let facing: Vec<Place> = facing
            .map(|(corner, nodes)| {
                let change = 2.0 * f64::tan(0.5 * corner.turn);
                at(nodes[0], corner.edge, corner.xi, change)
            })
            .collect();
        for Corner { node, turn, change } in corners {
            if change > 0.0 {
                found.push((at(node, node / 2, -1.0, change), turn));
            }
        }
        for (end, slope) in [(0, contact.end_slopes[0]), (last, -contact.end_slopes[1])] {
            let xi = if end == 0 { -1.0 } else { 1.0 };
            let edge = if end == 0 { 0 } else { last / 2 - 1 };
            let own = contact.places.iter().filter(|place| {
                place.kink != 0.0
                    && self.beside(place.edge, place.xi) == [end; 2]
                    && place.edge == edge
            });
            let change = 2.0 * slope + own.map(|place| place.kink).sum::<f64>();
            if change > 0.0 && self.symmetric(end) && self.active(end) {
                // the body's corner, if most of the change is its own
                let turn = self.turn_at_image(end);
                let own = 2.0 * turn > change;
                found.push((at(end, edge, xi, change), if own { turn } else { 0.0 }));
            }
        }
        let peak = match self.highest_pressure() {
            Some(Highest { value, .. }) if value > 0.0 => value,
            _ => return Vec::new(),
        };
        let of_own = found.into_iter().map(|(place, turn)| (place, turn, false));
        let found: Vec<(Place, f64, bool)> = of_own
            .chain(facing.into_iter().map(|place| (place, 0.0, true)))
            .collect();
        if found.is_empty() {
            return Vec::new();
        }
        let moduli = self.contact_moduli();
        let kink = |(place, turn, facing): (Place, f64, bool)| {
            let change = place.kink;
            let node = self.patch.first + self.beside(place.edge, place.xi)[0];
            let on_axis = place.xi.abs() == 1.0 && self.system.nodes[node].on_axis;
            let growth = Self::growth(&moduli, place.edge, change);
            Kink {
                edge: place.edge,
                s: self.arc(&place),
                change,
                turn,
                facing,
                growth: if on_axis { 0.5 * PI * growth } else { growth },
                spacing: self.spacing(&place),
                mirrored: [0, last].contains(&self.beside(place.edge, place.xi)[0]),
            }
        };
        let kinks = found.into_iter().map(kink);
        kinks.filter(|kink| kink.growth > SHAPING * peak).collect()
    }

    /// How far the obstacle reaches into the body at a place, along the contact's normal.
    fn penetration(&self, place: &Place) -> f64 {
        let contact = self.patch.contact;
        let boundary = &contact.boundary;
        let h = edge3::shape(place.xi);
        // relative to an obstacle whose motion is unknown, as the gap
        let displacement = [0, 1].map(|a| {
            let at = |i: usize| {
                let (n, t) = (boundary.normals[i], boundary.tangent(i));
                let node = self.patch.first + i;
                let u_n = self.system.normal_displacement(self.v, node);
                let u_t = self.system.tangential_displacement(self.v, node);
                u_n * n[a] + u_t * t[a]
            };
            edge3::interpolate(&h, &edge_nodes(place.edge).map(at))
        });
        let (slope, n) = (place.profile.slope, place.normal);
        let slope = match contact.normal {
            NormalOf::Body | NormalOf::Mean => 0.0,
            NormalOf::Obstacle => slope,
        };
        let cosine = 1.0 / slope.hypot(1.0);
        let t = [n[1], -n[0]];
        let along = |a: usize| displacement[a] * cosine * (n[a] - slope * t[a]);
        let gap = match &contact.tool {
            None => {
                let pushed = self.system.level.motions[0] * contact.indentation;
                cosine * (place.profile.distance - pushed)
            }
            Some(tool) => {
                let given = tool.motions(&self.system.level);
                let moved = edge_nodes(place.edge).map(|i| tool.moved(i, &given)[0]);
                cosine * place.profile.distance - edge3::interpolate(&h, &moved)
            }
        };
        along(0) + along(1) - gap
    }

    /// The largest stiffness of the nodes of an edge against their normal displacements.
    fn stiffness(&self, edge: usize) -> f64 {
        let own = edge_nodes(edge).map(|i| match self.system.nodes[self.patch.first + i].normal {
            Dof::Free(dof) => self.system.stiffness.at(dof, dof),
            Dof::Fixed(_) => 0.0,
        });
        own.into_iter().fold(0.0, f64::max)
    }

    /// The nodes on either side of a place; if the place is at a node, that node twice.
    pub(super) fn beside(&self, edge: usize, xi: f64) -> [usize; 2] {
        let [start, end, middle] = edge_nodes(edge);
        match xi {
            -1.0 => [start; 2],
            0.0 => [middle; 2],
            1.0 => [end; 2],
            xi if xi < 0.0 => [start, middle],
            _ => [middle, end],
        }
    }

    /// The distance between the nodes on either side of a place, along the arc.
    fn spacing(&self, place: &Place) -> f64 {
        let [start, end, middle] = self.patch.contact.boundary.edge_arc(place.edge);
        match place.xi {
            xi if xi < 0.0 => middle - start,
            _ => end - middle,
        }
    }

    fn arc(&self, place: &Place) -> f64 {
        self.arc_at(place.edge, place.xi)
    }

    /// The arc length of a place of an edge.
    pub(super) fn arc_at(&self, edge: usize, xi: f64) -> f64 {
        let arc = self.patch.contact.boundary.edge_arc(edge);
        edge3::interpolate(&edge3::shape(xi), &arc)
    }

    /// The contact modulus E* of the material below every edge (stress): E/(1 − ν²), in plane stress E.
    pub(super) fn contact_moduli(&self) -> Vec<f64> {
        let boundary = &self.patch.contact.boundary;
        let model = self.system.model;
        // a midside node on the surface belongs to one element
        let midsides = (0..boundary.edge_count()).map(|k| (boundary.nodes[2 * k + 1], k));
        let edges: BTreeMap<u32, usize> = midsides.collect();
        let mut moduli = vec![0.0; edges.len()];
        for (e, element) in model.mesh.elements.iter().enumerate() {
            for edge in element.iter().filter_map(|node| edges.get(node)) {
                let d = model.section.materials()[model.section.material_of(e)];
                let n = boundary.normals[2 * edge + 1];
                let (across, along) = if n[1].abs() > n[0].abs() {
                    (1, 0)
                } else {
                    (0, 1)
                };
                moduli[*edge] = d[across][across] - d[across][along].powi(2) / d[along][along];
            }
        }
        moduli
    }
}

/// Of points (place, height) the first and the last, and the points between at which the height stops rising or
/// falling.
fn turning_points(points: impl Iterator<Item = (f64, f64)>) -> Vec<(f64, f64)> {
    let mut found: Vec<(f64, f64)> = Vec::new();
    for point in points {
        if let [.., (_, before), (_, last)] = found[..]
            && (last - before) * (point.1 - last) >= 0.0
        {
            found.pop();
        }
        found.push(point);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::turning_points;

    #[test]
    fn only_crests_and_hollows_are_turning_points() {
        let points = |heights: &[f64]| {
            let all = heights.iter().enumerate().map(|(k, h)| (k as f64, *h));
            let turns = turning_points(all).into_iter();
            turns.map(|(k, _)| k as usize).collect::<Vec<_>>()
        };
        assert_eq!(points(&[0.0, 1.0, 2.0, 1.0, 0.0]), [0, 2, 4]);
        assert_eq!(points(&[0.0, -1.0, 1.0, 0.0]), [0, 1, 2, 3]);
        assert_eq!(points(&[0.0, 0.0, 1.0, 1.0, 0.0]), [0, 3, 4]);
    }
}
