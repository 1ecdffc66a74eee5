//! A part of a deck, with its own numbers and names, and its positions as instances.

use std::collections::BTreeMap;
use std::ops::Range;

use super::contact_parts::{Analytical, Held, RigidBody};
use super::element::Typed;
use super::supported::UnknownKeyword;
use super::written::{
    Distributed, Force, Incomplete, Name, Prescribed, Section, Set, Spring, Surface, Temperature,
};
use crate::source::Labels;
use solver::element::Element;
use solver::error::{Findings, Violation};

/// The kind of a numbered element, with its place in the list of that kind in its part.
#[derive(Clone, Copy, Debug)]
pub(super) enum Numbered {
    /// A plane element, by its place among the plane elements.
    Plane(u32),
    /// A line element, by its place among the line elements.
    Line(u32),
    /// An element that a plane mesh ignores.
    Other,
}

/// A block of rigid lines, which a problem can have only as the surface of a rigid body.
#[derive(Clone)]
pub(super) struct RigidLines {
    /// The line of the block's keyword.
    pub(super) line: u64,
    /// A description of the elements for messages.
    pub(super) what: String,
    /// The places of the lines among all numbered elements of their part.
    pub(super) places: Range<u32>,
}

/// The content of a part, of an instance of one, or of the assembly; a deck without parts is an assembly only.
#[derive(Clone, Default)]
pub(super) struct Part {
    pub(super) nodes: Vec<[f64; 2]>,
    /// The third coordinates of the nodes.
    pub(super) heights: Vec<f64>,
    pub(super) node_labels: Vec<u64>,
    pub(super) node_places: Labels,
    pub(super) elements: Vec<Element>,
    pub(super) element_labels: Vec<u64>,
    /// The nodes of line elements, the middle node last; it may be missing.
    pub(super) lines: Vec<[u32; 3]>,
    /// All elements with a number.
    pub(super) numbered: Vec<Numbered>,
    pub(super) element_places: Labels,
    /// The number of quadrilaterals with a node in their centre.
    pub(super) with_centre: usize,
    /// The first type of element that a plane mesh ignores, and its line.
    pub(super) unused_type: Option<(u64, String)>,
    /// Rigid lines, block by block.
    pub(super) rigid_lines: Vec<RigidLines>,
    pub(super) types: Vec<Typed>,
    pub(super) node_sets: BTreeMap<Name, Set>,
    pub(super) element_sets: BTreeMap<Name, Set>,
    /// Surfaces of nodes.
    pub(super) node_surfaces: BTreeMap<Name, Set>,
    pub(super) surfaces: BTreeMap<Name, Surface>,
    pub(super) sections: Vec<Section>,
    pub(super) prescribed: Vec<Prescribed>,
    pub(super) pressures: Vec<Distributed>,
    pub(super) forces: Vec<Force>,
    pub(super) temperatures: Vec<Temperature>,
    pub(super) springs: Vec<Spring>,
    /// The line of the first elements SPRING1.
    pub(super) first_spring: Option<u64>,
    pub(super) rigid_bodies: Vec<RigidBody>,
    pub(super) analytical: BTreeMap<Name, Analytical>,
    /// Every row of `*BOUNDARY`, with all its components.
    pub(super) held: Vec<Held>,
    /// Which data of the part are incomplete because a line could not be read.
    pub(super) incomplete: Incomplete,
    /// The unknown keywords of the part.
    pub(super) unknown_keywords: Vec<UnknownKeyword>,
    /// Violations in the part's mesh.
    pub(super) faults: Found,
    /// Violations for what the part has and a problem cannot have.
    pub(super) doubts: Found,
}

/// Violations in a part; they are reported only if an instance or the assembly uses the part.
#[derive(Clone, Default)]
pub(super) struct Found {
    listed: Vec<Violation>,
    more: usize,
}

impl Found {
    /// The largest number of violations that are kept for one part.
    const MOST: usize = 100;

    pub(super) fn add(&mut self, violation: impl FnOnce() -> Violation) {
        if self.listed.len() < Self::MOST {
            self.listed.push(violation());
        } else {
            self.more += 1;
        }
    }

    pub(super) fn add_to(self, findings: &mut Findings) {
        findings.extend(self.listed);
        findings.count(self.more);
    }
}

impl Part {
    /// How much an instance of the part repeats: nodes, elements, sets with their members, and rows.
    pub(super) fn size(&self) -> u64 {
        let sets = self.node_sets.values().chain(self.element_sets.values());
        let members: usize = sets.map(Set::written).sum();
        let sides: usize = self.surfaces.values().map(|s| s.sides.len()).sum();
        let names = self.node_sets.len() + self.element_sets.len() + self.surfaces.len();
        let pieces: usize = self.analytical.values().map(|s| 1 + s.pieces.len()).sum();
        let loads =
            self.pressures.len() + self.forces.len() + self.temperatures.len() + self.springs.len();
        let rows = self.sections.len() + self.prescribed.len() + self.held.len() + loads;
        let rigid = self.rigid_bodies.len() + self.rigid_lines.len() + pieces;
        let mesh = self.nodes.len() + self.numbered.len() + members + sides + names;
        (mesh + rows + rigid) as u64
    }

    /// Moves the part, then turns it by an angle (radians) about a point of the plane.
    pub(super) fn put(&mut self, moved: [f64; 3], turned: Option<([f64; 2], f64)>) {
        for node in &mut self.nodes {
            *node = [node[0] + moved[0], node[1] + moved[1]];
        }
        for height in &mut self.heights {
            *height += moved[2];
        }
        for surface in self.analytical.values_mut() {
            surface.place(|[x, y]| [x + moved[0], y + moved[1]]);
        }
        if let Some(([a, b], angle)) = turned {
            let (sin, cos) = exact(angle);
            for node in &mut self.nodes {
                let [x, y] = [node[0] - a, node[1] - b];
                *node = [a + cos * x - sin * y, b + sin * x + cos * y];
            }
            for surface in self.analytical.values_mut() {
                surface.place(|[x, y]| {
                    let [x, y] = [x - a, y - b];
                    [a + cos * x - sin * y, b + sin * x + cos * y]
                });
            }
        }
    }
}

/// The sine and cosine of an angle, exact for quarter turns, so that sides along an axis stay straight.
fn exact(angle: f64) -> (f64, f64) {
    let quarters = angle / std::f64::consts::FRAC_PI_2;
    if (quarters - quarters.round()).abs() > 1e-12 {
        return angle.sin_cos();
    }
    match (quarters.round() as i64).rem_euclid(4) {
        0 => (0.0, 1.0),
        1 => (1.0, 0.0),
        2 => (0.0, -1.0),
        _ => (-1.0, 0.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_instance_is_moved_and_then_turned() {
        let mut part = Part {
            nodes: vec![[1.0, 0.0], [3.0, 0.5]],
            heights: vec![0.0, 0.0],
            ..Part::default()
        };
        part.put(
            [1.0, 2.0, 0.5],
            Some(([1.0, 2.0], std::f64::consts::FRAC_PI_2)),
        );
        assert_eq!(part.nodes, [[1.0, 3.0], [0.5, 5.0]]);
        assert_eq!(part.heights, [0.5, 0.5]);
    }
}
