//! Surfaces that stand for a curve and are not that curve: polygons and parabolas by the sides of elements, of the body and of
//! one that faces it, which refinement keeps.

use std::f64::consts::PI;

use super::PatchView;
use crate::contact::edge_nodes;
use crate::contact::smooth;
use crate::model::FacingCorner;
use crate::problem::Condition;
use crate::solution::{Warning, WarningCode};

/// The largest ratio of angles, and of lengths, of neighbouring sides of a polygon that stands for a curve.
const ALIKE: f64 = 3.0;

/// The least number of corners of such a polygon, mirror images included: the two corners of a chamfer are no polygon.
const CORNERS: usize = 3;

/// The pressure of a corner, as a part of the peak, with which a polygon counts: `good` promises peaks to 5 %.
const TELLING: f64 = 0.05;

/// The height of a side's arc, as a part of the largest overlap of body and obstacle, above which forces may be wrong by more
/// than the 5 % of the verdict `fair`, as rings of straight sides on a pin are (`tests/verification/curves.rs`).
const COARSE: f64 = 0.03;

/// The part of the peak from which on the angles between parabolic sides are told.
const SHOWN: f64 = 0.005;

/// A polygon in place of a curve, in contact.
pub(super) struct Polygon {
    /// The number of corners on the boundary.
    count: usize,
    /// The largest angle by which the surface turns at one of them.
    turn: f64,
    /// The length of the longest side.
    side: f64,
    /// The height of an arc over a side, as the part that `part_of_overlap` returns.
    height: Option<f64>,
    /// The arc lengths of its first and its last corner.
    ends: [f64; 2],
    /// Whether it is the surface of the other body.
    facing: bool,
}

impl Polygon {
    /// Whether a place belongs to the polygon.
    pub(super) fn has(&self, s: f64) -> bool {
        self.ends[0] <= s && s <= self.ends[1]
    }
}

/// The sharpest corner of such a polygon: 20° (angle). Sharper ones are bevels.
const SHARPEST: f64 = 0.35;

/// The least overlap of body and obstacle that is not rounding, as a part of the length of the boundary.
const ROUNDING: f64 = 1e-9;

/// A corner of the surface: its arc length, and the angle by which the surface turns there.
type Turn = (f64, f64);

impl PatchView<'_> {
    /// The polygon in contact that stands for a curve, if there is one, of the body or of one that faces it: the sharper one.
    pub(super) fn polygon(&self) -> Option<Polygon> {
        let own = self.polygon_through(&self.corners_with_images());
        let facing = self.polygon_through(&self.corners_of_other());
        let facing = facing.map(|polygon| Polygon {
            facing: true,
            ..polygon
        });
        let both = [own, facing].into_iter().flatten();
        both.max_by(|a, b| a.turn.total_cmp(&b.turn))
    }

    /// The polygon that corners make: neighbours that turn alike, at alike distances, to which what is opposite does not conform.
    fn polygon_through(&self, corners: &[Turn]) -> Option<Polygon> {
        let contact = self.patch.contact;
        let peak = self.highest_pressure().map(|highest| highest.value)?;
        if !contact.in_space || contact.condition != Condition::Unilateral || peak <= 0.0 {
            return None;
        }
        let s = &contact.boundary.s;
        if corners.len() < CORNERS {
            return None;
        }
        let modulus = self.contact_moduli().into_iter().fold(0.0, f64::max);
        let alike = |pair: &[Turn]| {
            let turns = pair[1].1 / pair[0].1;
            (1.0 / ALIKE..ALIKE).contains(&turns)
        };
        let mut found: Option<Polygon> = None;
        let mut start = 0;
        for end in 1..=corners.len() {
            let goes_on = end < corners.len() && alike(&corners[end - 1..=end]) && {
                let length = |k: usize| corners[k].0 - corners[k - 1].0;
                end - start < 2 || (1.0 / ALIKE..ALIKE).contains(&(length(end) / length(end - 1)))
            };
            if goes_on {
                continue;
            }
            let run = &corners[start..end];
            start = end;
            if run.len() < CORNERS {
                continue;
            }
            let sides = run.windows(2).map(|pair| pair[1].0 - pair[0].0);
            let side = sides.fold(0.0, f64::max);
            let (from, to) = (run[0].0 - side, run[run.len() - 1].0 + side);
            let near = s.partition_point(|s| *s < from)..s.partition_point(|s| *s <= to);
            let turn = run
                .iter()
                .fold(0.0f64, |most, corner| most.max(corner.1.abs()));
            // full contact with arcs of height side · turn / 8 takes the pressure π E* height / (2 side)
            let matters = PI / 16.0 * modulus * turn > TELLING * peak && turn <= SHARPEST;
            if !matters
                || !near.into_iter().any(|i| self.active(i))
                || found.as_ref().is_some_and(|known| known.turn >= turn)
            {
                continue;
            }
            let inside = |corner: &&Turn| (s[0]..=s[s.len() - 1]).contains(&corner.0);
            found = Some(Polygon {
                count: run.iter().filter(inside).count(),
                turn,
                side,
                height: self.part_of_overlap(side * turn / 8.0),
                ends: [run[0].0, run[run.len() - 1].0],
                facing: false,
            });
        }
        found
    }

    /// What the peak of the pressure may have from places in contact where parabolic sides that stand for a smooth curve meet at
    /// an angle (stress): half of what full contact with such sides takes. Refinement keeps the parabolas.
    pub(super) fn pressure_of_parabolas(&self) -> f64 {
        let [turn, _] = self.parabolas();
        if turn == 0.0 {
            return 0.0;
        }
        let modulus = self.contact_moduli().into_iter().fold(0.0, f64::max);
        PI / 32.0 * modulus * turn
    }

    /// What forces may have from the same, as a part of them: the height of the curve over a side, in overlaps.
    pub(super) fn part_of_parabolas(&self) -> f64 {
        let [_, height] = self.parabolas();
        match height > 0.0 {
            true => self.part_of_overlap(height).unwrap_or(0.0),
            false => 0.0,
        }
    }

    /// The largest angle at which parabolic sides in contact meet, and the largest height of a curve over them that such angles
    /// show, side · angle / 8; those of two bodies are added.
    fn parabolas(&self) -> [f64; 2] {
        let contact = self.patch.contact;
        if !contact.in_space || contact.condition != Condition::Unilateral {
            return [0.0; 2];
        }
        let boundary = &contact.boundary;
        let length = |edge: usize| boundary.edge_arc(edge)[1] - boundary.edge_arc(edge)[0];
        let facing = self.facing_corners();
        let there = |i: usize| -> f64 {
            let here = facing.iter().filter(|(_, at)| *at == [i; 2]);
            here.map(|(corner, _)| corner.turn).sum()
        };
        let inside = |i: usize| i.is_multiple_of(2) && i > 0 && i + 1 < self.count();
        let counts = |i: usize| inside(i) && self.active(i) && boundary.corner(i) == 0.0;
        let smooth = (0..self.count()).filter(|i| counts(*i));
        let side = |i: usize| length(i / 2 - 1).max(length(i / 2));
        let inner = smooth.map(|i| (boundary.turn(i) + there(i), side(i)));
        let ends = [0, self.count() - 1].into_iter();
        let ends =
            ends.filter(|i| self.active(*i) && self.symmetric(*i) && self.turn_at_image(*i) == 0.0);
        let at_images = ends.map(|end| {
            let [before, after] = self.sides_at_image(end);
            let edge = if end == 0 { 0 } else { end / 2 - 1 };
            (smooth::turn(&before, &after), length(edge))
        });
        // where a corner faces a node between two sides, both turns are counted there
        let apart = facing.iter().filter(|(corner, at)| {
            let counted = at[0] == at[1] && counts(at[0]);
            !corner.sharp && !counted && at.iter().any(|i| self.active(*i))
        });
        let others = apart.map(|(corner, _)| (corner.turn, corner.side));
        let most = |turns: &mut dyn Iterator<Item = (f64, f64)>| {
            turns.fold([0.0f64; 2], |[most, height], (turn, side)| {
                [most.max(turn.abs()), height.max(turn.abs() * side / 8.0)]
            })
        };
        let own = most(&mut inner.chain(at_images));
        let others = most(&mut others.into_iter());
        [0, 1].map(|k| own[k] + others[k])
    }

    /// The places where sides of the other body meet at an angle, each with the nodes on either side of it.
    pub(super) fn facing_corners(&self) -> Vec<(FacingCorner, [usize; 2])> {
        let pair = self.patch.contact.pair.as_ref();
        let corners = pair.map_or(&[][..], |pair| &pair.corners);
        let beside = |corner: &FacingCorner| (*corner, self.beside(corner.edge, corner.xi));
        corners.iter().map(beside).collect()
    }

    /// The corners of the other body's surface that the body does not have, too, in order.
    fn corners_of_other(&self) -> Vec<Turn> {
        let boundary = &self.patch.contact.boundary;
        let facing = self.facing_corners().into_iter();
        let sharp = facing.filter(|(corner, at)| {
            let conforms = at[0] == at[1] && boundary.corner(at[0]) != 0.0;
            corner.sharp && !conforms
        });
        let mut corners: Vec<Turn> = sharp
            .map(|(corner, _)| (self.arc_at(corner.edge, corner.xi), corner.turn))
            .collect();
        corners.sort_by(|a, b| a.0.total_cmp(&b.0));
        corners
    }

    /// The same of a peak σ_t = `stress` where the bound follows the pressure itself.
    pub(super) fn bound_of_parabolas(&self, stress: f64) -> f64 {
        match self.highest_pressure() {
            Some(highest) if self.averages_nothing() && highest.value > 0.0 => {
                self.pressure_of_parabolas() * stress.abs() / highest.value
            }
            _ => 0.0,
        }
    }

    /// The corners of the surface that the obstacle does not have, too, with mirror images of the first and last ones beyond
    /// lines of symmetry, in order.
    fn corners_with_images(&self) -> Vec<Turn> {
        let boundary = &self.patch.contact.boundary;
        let (s, last) = (&boundary.s, self.count() - 1);
        let own = self.body_corners(|_| true).into_iter();
        let mut corners: Vec<Turn> = own
            .filter(|corner| corner.change.abs() > 0.5 * corner.turn.abs())
            .map(|corner| (s[corner.node], corner.turn))
            .collect();
        let images = |corners: &[Turn], end: usize| -> Vec<Turn> {
            let image = |(at, turn): Turn| (2.0 * s[end] - at, turn);
            corners.iter().copied().map(image).collect()
        };
        if self.symmetric(0) {
            let near = corners
                .iter()
                .take(CORNERS)
                .copied()
                .rev()
                .collect::<Vec<_>>();
            let turn = self.turn_at_image(0);
            let middle = (turn != 0.0).then_some((s[0], turn));
            let before = images(&near, 0).into_iter().chain(middle);
            corners.splice(0..0, before);
        }
        if self.symmetric(last) {
            let near = corners
                .iter()
                .rev()
                .take(CORNERS)
                .copied()
                .collect::<Vec<_>>();
            let turn = self.turn_at_image(last);
            let middle = (turn != 0.0).then_some((s[last], turn));
            corners.extend(middle.into_iter().chain(images(&near, last)));
        }
        corners
    }

    /// The angle by which the surface turns where it meets its mirror image, at an end of the boundary on a line of symmetry,
    /// which is perpendicular to the tangent of the contact there; 0 where it is smooth.
    pub(super) fn turn_at_image(&self, end: usize) -> f64 {
        let [before, after] = self.sides_at_image(end);
        smooth::corner(&before, &after)
    }

    /// The side at an end of the boundary on a line of symmetry, and its mirror image, in order.
    fn sides_at_image(&self, end: usize) -> [smooth::Side; 2] {
        let boundary = &self.patch.contact.boundary;
        let edge = if end == 0 {
            0
        } else {
            boundary.edge_count() - 1
        };
        let side = edge_nodes(edge).map(|i| boundary.positions[i]);
        // on the axis a contact's tangent may be that of a cone
        let t = if self.on_axis(end) {
            [1.0, 0.0]
        } else {
            boundary.tangent(end)
        };
        let place = boundary.positions[end];
        let mirrored = side.map(|[x, y]| {
            let along = (x - place[0]) * t[0] + (y - place[1]) * t[1];
            [x - 2.0 * along * t[0], y - 2.0 * along * t[1]]
        });
        // the image runs the other way
        let image = [mirrored[1], mirrored[0], mirrored[2]];
        if end == 0 {
            [image, side]
        } else {
            [side, image]
        }
    }

    /// A height as a part of the largest overlap of body and obstacle before deformation, or of the deepest displacement of the
    /// body in contact if that is larger: loads press bodies together without an overlap. Of two bodies it is a part of the largest
    /// gap or overlap that contact closes.
    fn part_of_overlap(&self, height: f64) -> Option<f64> {
        let contact = self.patch.contact;
        let touching = (0..self.count()).filter(|i| self.active(*i));
        let overlap = match contact.pair {
            None => {
                let gaps = (0..self.count()).map(|i| self.gap(i));
                let moved = touching.map(|i| self.displacement(i)[0]);
                -gaps.chain(moved).fold(0.0, f64::min)
            }
            // either body may be displaced as a whole
            Some(_) => touching
                .map(|i| contact.gap(i, &self.system.level).abs())
                .fold(0.0, f64::max),
        };
        (overlap > ROUNDING * contact.boundary.length()).then_some(height / overlap)
    }

    /// Tells that the sides of elements are not the curve that they stand for, where the peak shows it.
    fn warn_of_parabolas(&self, warnings: &mut Vec<Warning>) {
        let peak = self.highest_pressure().map_or(0.0, |highest| highest.value);
        let part = self.pressure_of_parabolas() / peak;
        if !part.is_finite() || part <= SHOWN {
            return;
        }
        let of_forces = self.part_of_parabolas();
        let forces = match of_forces > SHOWN {
            true => format!(" and forces {:.1} %", 100.0 * of_forces),
            false => String::new(),
        };
        let advice = match self.patch.contact.pair {
            None => "",
            Some(_) => " A known overlap or distance of the bodies is best given by `gap`.",
        };
        warnings.push(Warning {
            code: match of_forces > COARSE {
                true => WarningCode::PolygonTooCoarse,
                false => WarningCode::KinkInContact,
            },
            pointer: self.patch.contact.pointer.clone(),
            message: format!(
                "The sides of elements in contact are parabolas that meet at small angles. The peak of the pressure may be {:.1} %{forces} off that of a smooth curve, which its stated error contains. Unless the curve is named under /mesh/curves, refinement keeps the angles: name it, or begin with more elements.{advice}",
                100.0 * part
            ),
        });
    }

    /// Tells of a polygon in place of a curve, and returns it.
    pub(super) fn warn_of_polygon(&self, warnings: &mut Vec<Warning>) -> Option<Polygon> {
        let Some(polygon) = self.polygon() else {
            self.warn_of_parabolas(warnings);
            return None;
        };
        let Polygon {
            count,
            turn,
            side,
            height,
            facing,
            ..
        } = polygon;
        let opposite = self.patch.contact.opposite();
        let surface = match (facing, &self.patch.contact.pair) {
            (true, Some(pair)) => format!(
                "The surface of `{}`, which the body touches,",
                pair.boundary
            ),
            _ => "The surface in contact".to_owned(),
        };
        let coarse = height.is_some_and(|height| height > COARSE);
        let part = match height {
            Some(height) => format!(
                ", which is {:.1} % of the overlap of the body and {opposite}: forces may be wrong by about as much",
                100.0 * height
            ),
            None => String::new(),
        };
        warnings.push(Warning {
            code: if coarse {
                WarningCode::PolygonTooCoarse
            } else {
                WarningCode::PolygonInContact
            },
            pointer: self.patch.contact.pointer.clone(),
            message: format!(
                "{surface} is a polygon: it turns by up to {:.2}° at {count} corners, between sides of up to {side:.4e}. Refinement keeps the corners, and the stated errors are those of the polygon. If it stands for a curve, that curve is {:.2e} off the middle of a side{part}. Name the curve under /mesh/curves, or mesh it with elements of second order whose midside nodes are on it.",
                turn.to_degrees(),
                side * turn / 8.0
            ),
        });
        Some(polygon)
    }
}
