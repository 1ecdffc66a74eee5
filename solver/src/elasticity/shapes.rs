//! Elements of the same shape: results that depend on the shape alone are computed once for all of them.

use std::collections::HashMap;

use crate::elasticity::Section;
use crate::element::{AtNodes, Family, Jacobian};
use crate::mesh::Mesh;

/// The shape of an element with its material: elements with equal shapes are shifted copies with the same integrals.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shape {
    pub(super) family: Family,
    /// The number of the element's material.
    pub(super) material: u16,
    /// Positions of the nodes relative to the first one; in axisymmetry relative along the axis only.
    pub(super) nodes: AtNodes<[f64; 2]>,
    /// The error of the positions after a few rounded operations.
    rounding: f64,
}

impl Shape {
    /// The shape of an element of a mesh.
    pub(super) fn of(mesh: &Mesh, section: &Section, e: usize) -> Self {
        let element = &mesh.elements[e];
        let nodes = mesh.element_nodes(element);
        Shape::new(element.family(), &nodes, section, section.material_of(e))
    }

    /// The shape of an element with the node positions `nodes`.
    pub(super) fn new(
        family: Family,
        nodes: &AtNodes<[f64; 2]>,
        section: &Section,
        material: usize,
    ) -> Self {
        let mut nodes = *nodes;
        let own = nodes[..family.nodes()].iter().flatten();
        let largest = own.fold(0.0f64, |largest, c| largest.max(c.abs()));
        let [x, y] = nodes[0];
        let x = if section.axisymmetric() { 0.0 } else { x };
        let own = nodes.iter_mut().take(family.nodes());
        own.for_each(|node| *node = [node[0] - x, node[1] - y]);
        Shape {
            family,
            material: material as u16,
            nodes,
            rounding: ROUNDING * f64::EPSILON * largest,
        }
    }

    /// The derivatives of the element's map if they are the same everywhere: for a triangle with straight sides or a
    /// parallelogram, with midside nodes in the middle up to rounding. The nodes are then taken to lie exactly there.
    pub(super) fn affine(&self) -> Option<Jacobian> {
        let (places, last) = (self.family.places(), self.family.corners() - 1);
        let [first, along, up] = [0, 1, last].map(|i| self.nodes[i]);
        let size = places[1][0] - places[0][0]; // of the master element
        let sides = [along, up].map(|end| [0, 1].map(|b| (end[b] - first[b]) / size));
        let tolerance = self.rounding.min(OF_THICKNESS * self.thickness());
        let is_there = |(node, place): (&[f64; 2], &[f64; 2])| {
            let [xi, eta] = [0, 1].map(|a| place[a] - places[0][a]);
            let apart = [0, 1].map(|b| node[b] - first[b] - xi * sides[0][b] - eta * sides[1][b]);
            apart.iter().all(|apart| apart.abs() <= tolerance)
        };
        let mut nodes = self.nodes.iter().zip(places);
        nodes.all(is_there).then(|| Jacobian::new(sides))
    }

    /// The element's area divided by the longest distance between its corners, a measure of how thin the element is.
    fn thickness(&self) -> f64 {
        let corners = &self.nodes[..self.family.nodes() / 2];
        let (mut area, mut longest) = (0.0, 0.0f64);
        for (i, [x, y]) in corners.iter().enumerate() {
            let [next_x, next_y] = corners[(i + 1) % corners.len()];
            area += 0.5 * (x * next_y - next_x * y);
            let others = corners[i + 1..].iter();
            let distances = others.map(|[a, b]| (a - x).hypot(b - y));
            longest = distances.fold(longest, f64::max);
        }
        area.abs() / longest
    }

    /// Whether every node has the same relative position in both shapes, up to `tolerance`.
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

    /// A hash that is equal for shapes that differ by far less than `cell`, unless a coordinate lies at the edge of a
    /// cell.
    fn hash(&self, cell: f64) -> u64 {
        /// An offset so that no simple fraction lies at an edge of a cell.
        const OFFSET: f64 = 0.367_879;
        let cells = self.nodes.iter().flatten();
        let cells = cells.map(|x| (x / cell + OFFSET).floor() as i64 as u64);
        let start = u64::from(self.material) << 1 | u64::from(self.family == Family::Quad);
        cells.fold(start, |hash, cell| {
            (hash.rotate_left(5) ^ cell).wrapping_mul(0x9e37_79b9_7f4a_7c15)
        })
    }
}

/// The shapes that several elements of a mesh share, up to the rounding of their coordinates: a grid between
/// equidistant lines has one shape.
///
/// An element is treated as if it had exactly the shape of the first element that shares it. This moves its nodes by no
/// more than the error of their coordinates after a few rounded operations.
#[derive(Debug)]
pub(super) struct Shapes {
    /// The number of each element's shape; `None` if no other element shares it.
    of: Vec<Option<u16>>,
    /// The shapes that at least two elements share.
    pub(super) shared: Vec<Shape>,
}

/// The distance up to which nodes of equal shapes, or of an affine element from their places, may differ, in roundings of
/// the largest coordinate.
const ROUNDING: f64 = 16.0;

/// The same distance, as a part of the element's thickness.
const OF_THICKNESS: f64 = 1e-10;

/// The number of shape hashes that are looked up: the most frequent ones.
const MOST: usize = 512;

/// The number of different shapes with the same hash that are compared.
const MOST_COMPARED: usize = 4;

impl Shapes {
    /// Finds the shapes that elements of a mesh share.
    pub(super) fn new(mesh: &Mesh, section: &Section) -> Self {
        let largest = mesh.nodes.iter().flatten();
        let largest = largest.fold(0.0f64, |largest, c| largest.max(c.abs()));
        let rounding = ROUNDING * f64::EPSILON * largest;
        // rounding rarely leads into another cell
        let cell = f64::from(1 << 20) * rounding;
        let hash = |e: usize| {
            let shape = Shape::of(mesh, section, e);
            (shape.thickness() > cell).then(|| shape.hash(cell))
        };
        let hashes: Vec<Option<u64>> = (0..mesh.elements.len()).map(hash).collect();
        let numbers = frequent(&hashes);
        // by number, the shapes met with it, as places among all of them; each with the number of its elements
        let mut met: Vec<Vec<u16>> = vec![Vec::new(); numbers.len()];
        let mut known: Vec<(Shape, u32)> = Vec::new();
        let mut of = vec![None; mesh.elements.len()];
        for (e, hash) in hashes.into_iter().enumerate() {
            let Some(&number) = hash.and_then(|hash| numbers.get(&hash)) else {
                continue;
            };
            let shape = Shape::of(mesh, section, e);
            let tolerance = rounding.min(OF_THICKNESS * shape.thickness());
            let met = &mut met[usize::from(number)];
            let is_near = |place: &u16| known[usize::from(*place)].0.is_near(&shape, tolerance);
            let mut place = met.iter().copied().find(is_near);
            if place.is_none() && met.len() < MOST_COMPARED {
                place = Some(known.len() as u16);
                met.push(known.len() as u16);
                known.push((shape, 0));
            }
            if let Some(place) = place {
                known[usize::from(place)].1 += 1;
            }
            of[e] = place;
        }
        let mut shared = Vec::new();
        let places = known.into_iter().map(|(shape, count)| {
            (count > 1).then(|| {
                shared.push(shape);
                shared.len() as u16 - 1
            })
        });
        let places: Vec<Option<u16>> = places.collect();
        for place in &mut of {
            *place = place.and_then(|place| places[usize::from(place)]);
        }
        Shapes { of, shared }
    }

    /// The number of an element's shape; `None` if no other element shares it.
    pub(super) fn of(&self, e: usize) -> Option<usize> {
        self.of[e].map(usize::from)
    }
}

/// Numbers for the hashes that occur most often, and at least twice.
fn frequent(hashes: &[Option<u64>]) -> HashMap<u64, u16> {
    let mut sorted: Vec<u64> = hashes.iter().flatten().copied().collect();
    sorted.sort_unstable();
    let runs = sorted.chunk_by(|a, b| a == b).filter(|run| run.len() > 1);
    let mut runs: Vec<(usize, u64)> = runs.map(|run| (run.len(), run[0])).collect();
    runs.sort_unstable_by(|a, b| b.cmp(a));
    runs.truncate(MOST);
    let numbered = runs.into_iter().enumerate();
    numbered
        .map(|(number, (_, hash))| (hash, number as u16))
        .collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::elasticity::isotropic;
    use crate::element::Element;
    use crate::problem::Analysis;

    /// A mesh of quadrilaterals between lines.
    fn mesh(x: &[f64], y: &[f64]) -> Mesh {
        let mut mesh = Mesh::default();
        for y in y.windows(2) {
            for x in x.windows(2) {
                let first = mesh.nodes.len() as u32;
                let corners = [[x[0], y[0]], [x[1], y[0]], [x[1], y[1]], [x[0], y[1]]];
                mesh.nodes.extend(corners);
                let middle = |a: usize| {
                    let ([ax, ay], [bx, by]) = (corners[a], corners[(a + 1) % 4]);
                    [0.5 * (ax + bx), 0.5 * (ay + by)]
                };
                mesh.nodes.extend([0, 1, 2, 3].map(middle));
                mesh.elements
                    .push(Element::Quad(std::array::from_fn(|i| first + i as u32)));
            }
        }
        mesh
    }

    fn lines(count: usize, step: f64) -> Vec<f64> {
        (0..=count).map(|i| i as f64 * step).collect()
    }

    fn section(analysis: Analysis) -> Section {
        Section::uniform(analysis, isotropic(&analysis, 1000.0, 0.3))
    }

    fn numbers(mesh: &Mesh, section: &Section) -> Vec<Option<usize>> {
        let shapes = Shapes::new(mesh, section);
        (0..mesh.elements.len()).map(|e| shapes.of(e)).collect()
    }

    /// Equidistant computed lines make one shape, though widths differ in the last digits: a third and a tenth have no
    /// exact form.
    #[test]
    fn computed_equidistant_lines_make_one_shape() {
        let mesh = mesh(&lines(40, 1.0 / 3.0), &lines(30, 0.1));
        let plane = section(Analysis::PlaneStrain {});
        assert_eq!(numbers(&mesh, &plane), vec![Some(0); 1200]);
        // in axisymmetry a column has its own radius
        let found = numbers(&mesh, &section(Analysis::Axisymmetric {}));
        assert_eq!(found[0], found[40]);
        assert_eq!(
            found[..40]
                .iter()
                .collect::<std::collections::BTreeSet<_>>()
                .len(),
            40
        );
    }

    #[test]
    fn elements_that_differ_by_more_than_rounding_share_no_shape() {
        let plane = section(Analysis::PlaneStrain {});
        let mut mesh = mesh(&lines(3, 1.0), &lines(1, 1.0));
        assert_eq!(numbers(&mesh, &plane), [Some(0); 3]);
        mesh.nodes[4][1] += 1e-9;
        assert_eq!(numbers(&mesh, &plane), [None, Some(0), Some(0)]);
        // a corner is enough, and two that are alike again share
        for e in [1, 2] {
            mesh.nodes[8 * e + 2][0] += 1e-12;
        }
        assert_eq!(numbers(&mesh, &plane), [None, Some(0), Some(0)]);
    }

    /// Thin oblique layers share a shape only if they are equal at their own scale: at 10⁻⁸ of the body's size,
    /// rounding moves lines by a relevant part of the thickness.
    #[test]
    fn thin_elements_share_only_what_is_equal_for_them() {
        let plane = section(Analysis::PlaneStrain {});
        let mut mesh = mesh(&lines(20, 1e-3), &lines(1, 1e-7));
        for [x, y] in &mut mesh.nodes {
            [*x, *y] = [0.6 * *x - 0.8 * *y + 1.0, 0.8 * *x + 0.6 * *y + 1.0];
        }
        let shapes = Shapes::new(&mesh, &plane);
        for e in 0..20 {
            let Some(shared) = shapes.of(e).map(|number| &shapes.shared[number]) else {
                continue;
            };
            let own = Shape::of(&mesh, &plane, e);
            let pairs = own
                .nodes
                .iter()
                .flatten()
                .zip(shared.nodes.iter().flatten());
            assert!(
                pairs
                    .into_iter()
                    .all(|(a, b)| (a - b).abs() <= 1e-10 * 1e-7)
            );
        }
    }

    /// Shapes of a grid are found even if thousands of elements of a free mesh come before it.
    #[test]
    fn frequent_shapes_are_found_among_very_many() {
        let widths: Vec<f64> = (0..3000)
            .map(|i| i as f64 + 1e-8 * (i * i) as f64)
            .collect();
        let mut mesh = mesh(&widths, &[0.0, 1.0]);
        let grid = super::tests::mesh(&lines(10, 0.5), &lines(10, 0.25));
        let offset = mesh.nodes.len() as u32;
        mesh.nodes.extend(grid.nodes);
        for element in grid.elements {
            let nodes = std::array::from_fn(|i| element[i] + offset);
            mesh.elements.push(Element::Quad(nodes));
        }
        let found = numbers(&mesh, &section(Analysis::PlaneStrain {}));
        assert!(
            found[2999..]
                .iter()
                .all(|number| number.is_some() && *number == found[2999])
        );
    }
}
