//! Junctions: points where materials meet under a contact, and the pressure may have no limit.

use std::f64::consts::{LN_2, TAU};

use super::{Junction, PatchView};
use crate::contact::edge_nodes;
use crate::elasticity::{Side, Wedge, growth};
use crate::element::edge3;
use crate::problem::Condition;
use crate::solution::{Warning, WarningCode};

/// A junction shapes the pressure if each halving of the mesh adds more than this part of the peak pressure.
const SHAPING: f64 = 0.01;

/// The largest difference of angles that are equal, between sides of elements that meet in a node.
const SAME_ANGLE: f64 = 1e-6;

impl PatchView<'_> {
    /// The junction at which the pressure grows fastest; none if no junction shapes the pressure.
    pub(super) fn junction(&self) -> Option<Junction> {
        *self.worst_junction.get_or_init(|| {
            let highest = self.highest_pressure();
            let peak = highest
                .map(|highest| highest.value)
                .filter(|peak| *peak > 0.0)?;
            if self.patch.contact.condition == Condition::None
                || self.system.model.section.materials().len() < 2
            {
                return None;
            }
            let corners = (0..self.count()).step_by(2);
            let found = corners.filter_map(|i| self.junction_at(i));
            let worst = found.max_by(|a, b| a.growth.total_cmp(&b.growth));
            worst.filter(|junction| junction.growth > SHAPING * peak)
        })
    }

    pub(super) fn warn_of_junction(&self, warnings: &mut Vec<Warning>) {
        let Some(Junction {
            s,
            exponent,
            growth,
        }) = self.junction()
        else {
            return;
        };
        let peak = self.highest_pressure().map_or(1.0, |highest| highest.value);
        let how = match exponent {
            Some(exponent) => format!("like the power {:.3} of the distance", exponent - 1.0),
            None => "like the logarithm of the distance".to_owned(),
        };
        warnings.push(Warning {
            code: WarningCode::MaterialJunction,
            pointer: self.patch.contact.pointer.clone(),
            message: format!(
                "Materials meet in the contact, at s = {s:.4}: the pressure is unbounded there, and grows {how}. Each halving of the mesh adds about {growth:.3e}, {:.1} % of the peak. Forces converge, and σ_t does for nonlocal_radius > 0.",
                100.0 * growth / peak
            ),
        });
    }

    /// The junction at a node, with the growth of the pressure; none if no materials meet there.
    fn junction_at(&self, i: usize) -> Option<Junction> {
        let last = self.count() - 1;
        let inner = i > 0 && i < last;
        if !self.active(i) || !inner && !self.symmetric(i) || self.on_axis(i) {
            return None;
        }
        let wedges = self.wedges_at(i)?;
        let materials = wedges
            .windows(2)
            .any(|pair| pair[0].moduli != pair[1].moduli);
        if !materials {
            return None;
        }
        // in the order of the angles: the side before the node, and the one behind it
        let contact = [i > 0, i < last];
        let pressure = self.pressure(i).max(0.0);
        let stress = self.at_node(i, |edge, xi| self.tangential_stress_at(edge, xi));
        let power = |sides: [Side; 2]| {
            let exponent = growth(&wedges, sides, [false; 2])?.exponent?;
            Some((Some(exponent), ((1.0 - exponent).exp2() - 1.0) * pressure))
        };
        let sides =
            |side: Side| contact.map(|contact| if contact { side } else { Side::Slides(0.0) });
        let mut found: Vec<(Option<f64>, f64)> = Vec::new();
        if self.patch.contact.condition == Condition::Bonded {
            found.extend(power(sides(Side::Sticks)));
        } else {
            // where the bound is the pressure's own, so is the traction a part of it; else it has a limit
            let part = if self.averages_nothing() && pressure > 0.0 {
                stress / pressure
            } else {
                0.0
            };
            if let Some(found_here) = growth(&wedges, sides(Side::Slides(part)), contact) {
                let by_power = found_here
                    .exponent
                    .map(|exponent| (Some(exponent), ((1.0 - exponent).exp2() - 1.0) * pressure));
                found.extend(by_power);
                if part == 0.0 {
                    found.push((None, LN_2 * found_here.logarithm * stress.abs()));
                }
            }
            if self.sticks_unresolved(i) {
                found.extend(power(sides(Side::Sticks)));
            }
        }
        let (exponent, growth) = found.into_iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(Junction {
            s: self.patch.contact.boundary.s[i],
            exponent,
            growth,
        })
    }

    /// Whether a node sticks although the strain would move it by more than ε over the edges beside it: as far as the
    /// mesh sees, nothing slides there.
    fn sticks_unresolved(&self, i: usize) -> bool {
        let Some(law) = &self.patch.law else {
            return false;
        };
        let slip = self.at_node(i, |edge, xi| self.slip_at(edge, xi)).abs();
        let s = &self.patch.contact.boundary.s;
        let length = s[(i + 2).min(self.count() - 1)] - s[i.saturating_sub(2)];
        let modulus = self.system.model.section.modulus();
        slip < law.elastic_slip && self.pressure(i) / modulus * length > law.elastic_slip
    }

    pub(super) fn on_axis(&self, i: usize) -> bool {
        self.system.nodes[self.patch.first + i].on_axis
    }

    /// The wedges of material around a node, counter-clockwise from the edge before it to the edge after it. At an end
    /// of the boundary, the next side of the body's surface takes the place of the missing edge.
    pub(super) fn wedges_at(&self, i: usize) -> Option<Vec<Wedge>> {
        let (model, boundary) = (self.system.model, &self.patch.contact.boundary);
        let node = boundary.nodes[i];
        let last = self.count() - 1;
        let direction = |edge: usize, at: f64| {
            let positions = edge_nodes(edge).map(|k| boundary.positions[k]);
            let [dx, dy] = edge3::map(&positions, at).1;
            // away from the node
            f64::atan2(-at * dy, -at * dx)
        };
        // what the angles are measured from: the contact's own side
        let (from, before) = match i {
            0 => (direction(0, -1.0), false),
            _ => (direction(i / 2 - 1, 1.0), true),
        };
        let mut wedges: Vec<Wedge> = Vec::new();
        for (e, element) in model.mesh.elements.iter().enumerate() {
            let sides: Vec<[u32; 3]> = if element.contains(&node) {
                element.sides().collect()
            } else {
                continue;
            };
            let out = sides.iter().find(|side| side[0] == node);
            let back = sides.iter().find(|side| side[1] == node);
            let (Some(out), Some(back)) = (out, back) else {
                return None; // it is a midside
            };
            let angle = |side: &[u32; 3], at: f64| {
                let [dx, dy] = edge3::map(&model.mesh.edge_nodes(side), at).1;
                f64::atan2(-at * dy, -at * dx) - from
            };
            let start = angle(out, -1.0);
            let width = (angle(back, 1.0) - start).rem_euclid(TAU);
            let start = if before {
                (start + SAME_ANGLE).rem_euclid(TAU) - SAME_ANGLE
            } else {
                // all wedges end at the side that follows the node
                -((-start - SAME_ANGLE).rem_euclid(TAU) + SAME_ANGLE)
            };
            wedges.push(Wedge {
                angles: [start, start + width],
                moduli: model.section.materials()[model.section.material_of(e)],
            });
        }
        wedges.sort_by(|a, b| a.angles[0].total_cmp(&b.angles[0]));
        let mut joined: Vec<Wedge> = Vec::new();
        for wedge in wedges {
            let start = joined
                .last()
                .map_or(wedge.angles[0], |before| before.angles[1]);
            if (start - wedge.angles[0]).abs() > SAME_ANGLE {
                return None;
            }
            match joined.last_mut() {
                Some(before) if before.moduli == wedge.moduli => before.angles[1] = wedge.angles[1],
                _ => joined.push(Wedge {
                    angles: [start, wedge.angles[1]],
                    ..wedge
                }),
            }
        }
        for wedge in &mut joined {
            wedge.angles = wedge.angles.map(|angle| angle + from);
        }
        let inner = i > 0 && i < last;
        let spanned = inner.then(|| {
            let to = direction(i / 2, -1.0) - from;
            let end = joined.last().map_or(0.0, |wedge| wedge.angles[1] - from);
            (to - end + SAME_ANGLE).rem_euclid(TAU) <= 2.0 * SAME_ANGLE
        });
        (spanned != Some(false) && !joined.is_empty()).then_some(joined)
    }
}
