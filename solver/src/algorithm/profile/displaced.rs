//! The error of a push along a direction that is not the normal: gaps are linear in the indentation, as if the obstacle
//! kept the normal and the slope that each node faced at first, but those of the displaced obstacle differ.

use super::{DisplacedGaps, DisplacedNode, PatchView};
use crate::contact::Displaced;
use crate::problem::{Condition, NormalOf};
use crate::solution::{Warning, WarningCode};

/// The largest error of gaps without a warning, as its mean weighted by the pressure and a part of the largest gap or
/// overlap in contact: it changes forces by as much or twice as much.
const TOLD_OF_FORCES: f64 = 0.004;

/// The largest error of an end of contact without a warning, as a part of the contact's length.
const TOLD_OF_ENDS: f64 = 0.025;

/// The largest difference of gaps, as a part of the length of the contact boundary, that is rounding of places on a
/// curve.
const ROUNDING: f64 = 1e-8;

/// The work for the displaced gap of one node, in multiplications.
const WORK_OF_A_NODE: f64 = 2e3;

impl PatchView<'_> {
    /// The gaps of the displaced obstacle relative to the linear gaps; zero if the contact has no direction.
    pub(in crate::algorithm) fn displaced_gaps(&self) -> &DisplacedGaps {
        self.displaced_gaps.get_or_init(|| {
            let contact = self.patch.contact;
            let mut found = DisplacedGaps {
                nodes: vec![DisplacedNode::default(); self.count()],
                past_end: 0.0,
            };
            let (Some(along), true) = (&contact.along, contact.condition != Condition::None) else {
                return found;
            };
            let by = self.obstacle_displacement(along.direction);
            let displaced = Displaced::new(&along.obstacle, &contact.boundary, &contact.outward);
            let least = ROUNDING * contact.boundary.length();
            for i in 0..self.count() {
                if !(self.go_on)(WORK_OF_A_NODE) {
                    return found;
                }
                match self.beside_linear(i, by, &displaced) {
                    Some(node) if node.gap.abs() > least => found.nodes[i] = node,
                    Some(_) => {}
                    None if self.active(i) => {
                        let n = contact.outward[i];
                        let ahead = (by[0] * n[1] - by[1] * n[0]).abs();
                        found.past_end = found.past_end.max(ahead);
                    }
                    None => {}
                }
            }
            found
        })
    }

    /// The displacement of the obstacle along its direction; of one that moves as a rigid body, also perpendicular to it. The
    /// gap of a tilted obstacle is taken as linear.
    fn obstacle_displacement(&self, [a, b]: [f64; 2]) -> [f64; 2] {
        let [pushed, along, _] = self.motions;
        match self.patch.contact.tool {
            None => [pushed * a, pushed * b],
            Some(_) => [pushed * a - along * b, pushed * b + along * a],
        }
    }

    /// The constraint at a node by the displaced obstacle, compared with the linear one; none if the displaced obstacle
    /// does not face the node. u_n ≤ gap is a condition on the displacement along the body's normal m, but the
    /// displaced obstacle may have another normal. `by`: the displacement of the obstacle.
    fn beside_linear(
        &self,
        i: usize,
        by: [f64; 2],
        displaced: &Displaced<'_>,
    ) -> Option<DisplacedNode> {
        let contact = self.patch.contact;
        let (m, n) = (contact.boundary.normals[i], contact.outward[i]);
        let t = [n[1], -n[0]];
        let cosine = dot(m, n);
        let distance = contact.profile[i] / cosine;
        let before = displaced.profile(i, [0.0; 2], distance)?;
        let near = before.distance + dot(by, n) - before.slope * dot(by, t);
        let after = displaced.profile(i, by, near)?;
        let (slope, change, moved) = match contact.normal {
            NormalOf::Body | NormalOf::Mean => (0.0, 0.0, 0.0),
            NormalOf::Obstacle => {
                let slope = -dot(m, t) / cosine;
                let tangent = contact.boundary.tangent(i);
                let [u_n, u_t] = self.displacement(i);
                let moved = u_n * dot(m, t) + u_t * dot(tangent, t);
                (slope, after.slope - slope, moved)
            }
        };
        let linear = distance + dot(by, n) - slope * dot(by, t);
        Some(DisplacedNode {
            gap: cosine * (after.distance - linear + change * moved),
            turn: cosine * cosine * change,
        })
    }

    /// The largest difference of gaps at a node in contact, and the largest gap or overlap there (lengths); none if the
    /// difference is too small for a warning.
    fn told(&self) -> Option<(f64, f64)> {
        let found = self.displaced_gaps();
        let reactions = &self.forces.reactions[self.system.range(self.patch)];
        let (mut most, mut largest, mut moment, mut force) = (0.0f64, 0.0f64, 0.0, 0.0);
        for i in (0..self.count()).filter(|i| self.active(*i)) {
            most = most.max(found.nodes[i].gap.abs());
            largest = largest.max(self.gap(i).abs());
            moment += reactions[i] * found.nodes[i].gap;
            force += reactions[i];
        }
        let ends = self.ends_of_contact();
        let ends = ends.iter().map(|end| self.displaced_end(end.node));
        let farthest = ends.fold(0.0, f64::max);
        let told = f64::abs(moment) > TOLD_OF_FORCES * force * largest
            || farthest > TOLD_OF_ENDS * self.contact_length();
        (told && (most > 0.0 || found.past_end > 0.0))
            .then_some((most.max(found.past_end), largest))
    }

    /// How far the displaced obstacle reaches into the body (length), if nothing touches the linear obstacle; else 0.
    pub(super) fn overlap_without_contact(&self) -> f64 {
        let found = self.displaced_gaps();
        if (0..self.count()).any(|i| self.active(i)) {
            return 0.0;
        }
        let overlap = |i: usize| match found.nodes[i].gap {
            0.0 => 0.0,
            more => -(self.system.opening(self.v, self.patch.first + i) + more),
        };
        (0..self.count()).map(overlap).fold(0.0, f64::max)
    }

    /// The error of an end of contact at a node (length): the distance over which the linear gap, from its smallest
    /// value on, changes by as much as the displaced gap differs at the node. If the displaced obstacle faces the node
    /// no longer, at least the distance by which the obstacle ends elsewhere.
    pub(super) fn displaced_end(&self, end: usize) -> f64 {
        let found = self.displaced_gaps();
        let s = &self.patch.contact.boundary.s;
        let gap = |i: usize| self.gap(i);
        let touching = (0..self.count()).filter(|i| self.active(*i));
        let (Some(deepest), more) = (
            touching.min_by(|a, b| gap(*a).total_cmp(&gap(*b))),
            found.nodes[end].gap.abs(),
        ) else {
            return 0.0;
        };
        if more == 0.0 {
            return found.past_end;
        }
        let (rise, length) = (gap(end) - gap(deepest), (s[end] - s[deepest]).abs());
        // of a parabola the slope at the end is twice the mean one; no farther than the contact is long
        let slope = 2.0 * rise / length;
        let all = self.contact_length();
        found.past_end.max((more / slope).min(all)).min(all)
    }

    /// The length from the first node in contact to the last node in contact.
    pub(super) fn contact_length(&self) -> f64 {
        let s = &self.patch.contact.boundary.s;
        let first = (0..self.count()).find(|i| self.active(*i));
        let last = (0..self.count()).rfind(|i| self.active(*i));
        match (first, last) {
            (Some(first), Some(last)) => s[last] - s[first],
            _ => 0.0,
        }
    }

    /// The part of the contact, 0 … 1, by which the displaced obstacle ends elsewhere.
    pub(super) fn displaced_part(&self) -> f64 {
        let past_end = self.displaced_gaps().past_end;
        if past_end > 0.0 {
            (past_end / self.contact_length()).min(1.0)
        } else {
            0.0
        }
    }

    pub(super) fn warn_of_displaced(&self, warnings: &mut Vec<Warning>) {
        let instead = "Gaps are linear in the indentation. Draw the obstacle in its final position with an `indentation` of 0, or push it less far.";
        let overlap = self.overlap_without_contact();
        let message = match (overlap > 0.0, self.told()) {
            (true, _) => format!(
                "Nothing touches, but the obstacle that is pushed along its `direction` would reach {overlap:.3e} into the body. {instead}"
            ),
            (false, Some((most, largest))) => format!(
                "The obstacle is pushed so far along its `direction` that gaps in the contact are wrong by up to {most:.3e}; the largest gap or overlap there is {largest:.3e}. {instead} The stated errors include the effect."
            ),
            (false, None) => return,
        };
        warnings.push(Warning {
            code: WarningCode::DirectionIsLinear,
            pointer: format!("{}/direction", self.patch.contact.pointer),
            message,
        });
    }
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}
