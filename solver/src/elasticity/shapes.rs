//! Elements of the same shape: what depends on the shape alone is computed once for all of them.

use std::collections::HashMap;

use crate::elasticity::Section;
use crate::element::{AtNodes, Family};
use crate::mesh::Mesh;

/// What distinguishes elements: those that are equal here are moved onto each other by a shift that changes no integral.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shape {
    pub(super) family: Family,
    /// The number of its material.
    pub(super) material: u16,
    /// Positions relative to the first node; in axisymmetry along the axis only.
    pub(super) nodes: AtNodes<[f64; 2]>,
}

impl Shape {
    /// The shape of an element of a mesh.
    pub(super) fn of(mesh: &Mesh, section: &Section, e: usize) -> Self {
        let element = &mesh.elements[e];
        let nodes = mesh.element_nodes(element);
        Shape::new(element.family(), &nodes, section, section.material_of(e))
    }

    /// The shape of an element with these nodes.
    pub(super) fn new(
        family: Family,
        nodes: &AtNodes<[f64; 2]>,
        section: &Section,
        material: usize,
    ) -> Self {
        let mut nodes = *nodes;
        let [x, y] = nodes[0];
        let x = if section.axisymmetric() { 0.0 } else { x };
        let own = nodes.iter_mut().take(family.nodes());
        own.for_each(|node| *node = [node[0] - x, node[1] - y]);
        Shape {
            family,
            material: material as u16,
            nodes,
        }
    }

    /// The smaller of its extents along x and y.
    fn extent(&self) -> f64 {
        let along = |a: usize| {
            let own = self.nodes.iter().take(self.family.nodes());
            let ends = own.map(|node| node[a]);
            let ends = ends.fold((f64::MAX, f64::MIN), |(low, high), c| {
                (low.min(c), high.max(c))
            });
            ends.1 - ends.0
        };
        along(0).min(along(1))
    }

    /// Whether every node has the same place up to `tolerance`.
    fn is_near(&self, other: &Shape, tolerance: f64) -> bool {
        let pairs = self
            .nodes
            .iter()
            .flatten()
            .zip(other.nodes.iter().flatten());
        self.family == other.family
            && self.material == other.material
            && pairs.fold(true, |near, (a, b)| near & ((a - b).abs() <= tolerance))
    }

    /// A number that is the same for shapes that differ by far less than `cell`, unless one lies at the edge of a cell.
    fn hash(&self, cell: f64) -> u64 {
        /// So that no simple fraction lies at an edge.
        const OFFSET: f64 = 0.367_879;
        let cells = self.nodes.iter().flatten();
        let cells = cells.map(|x| (x / cell + OFFSET).floor() as i64 as u64);
        let start = u64::from(self.material) << 1 | u64::from(self.family == Family::Quad);
        cells.fold(start, |hash, cell| {
            (hash.rotate_left(5) ^ cell).wrapping_mul(0x9e37_79b9_7f4a_7c15)
        })
    }
}

/// The shapes that several elements of a mesh have, up to the rounding of their coordinates: a grid between equidistant
/// lines has one.
///
/// An element of such a shape is treated as if it had exactly that of the first one. This moves its nodes by no more than
/// their coordinates are in doubt after a few operations with rounding.
#[derive(Clone, Debug, Default)]
pub(super) struct Shapes {
    /// By element.
    of: Vec<Option<u16>>,
    /// Each is that of two elements at least.
    pub(super) shared: Vec<Shape>,
}

/// Places in units in the last place of the largest coordinate that shapes may differ by.
const ROUNDING: f64 = 16.0;

/// And in extents of the element.
const OF_EXTENT: f64 = 1e-10;

/// Shapes that are looked for: where a mesh has more, most are those of one element.
const MOST: usize = 1024;

/// A shape is compared with no more others than these.
const MOST_COMPARED: usize = 8;

impl Shapes {
    /// Those of a mesh.
    pub(super) fn new(mesh: &Mesh, section: &Section) -> Self {
        let largest = mesh.nodes.iter().flatten();
        let largest = largest.fold(0.0f64, |largest, c| largest.max(c.abs()));
        let rounding = ROUNDING * f64::EPSILON * largest;
        // rounding rarely leads into another cell
        let cell = f64::from(1 << 20) * rounding;
        let (mut known, mut counts): (Vec<Shape>, Vec<u32>) = (Vec::new(), Vec::new());
        let mut by_hash: HashMap<u64, Vec<u16>> = HashMap::new();
        let mut last = 0;
        let mut of = vec![None; mesh.elements.len()];
        for (e, of) in of.iter_mut().enumerate() {
            let shape = Shape::of(mesh, section, e);
            let extent = shape.extent();
            if extent < cell {
                continue;
            }
            let tolerance = rounding.min(OF_EXTENT * extent);
            let is_near = |place: &u16| {
                let other = known.get(usize::from(*place));
                other.is_some_and(|other| shape.is_near(other, tolerance))
            };
            // most often that of the element before
            let place = match is_near(&last) {
                true => Some(last),
                false => {
                    let places = by_hash.entry(shape.hash(cell)).or_default();
                    let found = places.iter().copied().find(is_near);
                    let is_new =
                        found.is_none() && known.len() < MOST && places.len() < MOST_COMPARED;
                    found.or_else(|| {
                        is_new.then(|| {
                            places.push(known.len() as u16);
                            known.push(shape);
                            counts.push(0);
                            known.len() as u16 - 1
                        })
                    })
                }
            };
            if let Some(place) = place {
                counts[usize::from(place)] += 1;
                last = place;
            }
            *of = place;
        }
        let mut shared = Vec::new();
        let numbers = known.into_iter().zip(counts).map(|(shape, count)| {
            (count > 1).then(|| {
                shared.push(shape);
                shared.len() as u16 - 1
            })
        });
        let numbers: Vec<Option<u16>> = numbers.collect();
        for place in &mut of {
            *place = place.and_then(|place| numbers[usize::from(place)]);
        }
        Shapes { of, shared }
    }

    /// The number of an element's shape; none if no other element has it.
    pub(super) fn of(&self, e: usize) -> Option<usize> {
        self.of[e].map(usize::from)
    }
}
