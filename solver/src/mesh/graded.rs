//! Refinement of single elements without hanging nodes: red for marked elements, green for their neighbours.
//!
//! A *red* division makes four elements of one; a quadrilateral much longer than wide is first halved across its
//! length, as often as still lets the refinement end (`halving`). Another element with a split side is *closed*
//! (divided along with that side), for the mesh of one solution only:
//!
//! ```text
//!   +-------+    +-------+    +---+---+    +-------+        +
//!   |\     /|    |   |   |    |   |   |    |\      |       /|\
//!   | \   / |    |   |   |    +---+   |    |  +----+      / | \
//!   |  \ /  |    |   |   |    |   |\  |    |  |    |     /  |  \
//!   +---+---+    +---+---+    (two sides that meet)    +---+---+
//! ```
//!
//! Closures are undone before the next refinement, so that angles do not shrink from mesh to mesh.

use std::collections::BTreeMap;

use super::curved::put_on_curve;
use super::halving::{Halving, halvings, must_divide};
use super::refine::Finer;
use super::{Edge, Mesh};
use crate::element::Element;
use crate::problem::Curve;

/// The largest number of rounds in which closures that would be inverted are replaced by divisions; closures of an
/// element that is itself almost inverted remain.
const MOST_UNFOLDING: u32 = 4;

/// The part of an element's contribution to the errors that is expected of all its parts together when it is divided:
/// more than of a smooth solution, and less than at a singularity.
const LEFT: f64 = 0.25;

/// A mesh whose elements are refined one by one, again and again.
#[derive(Clone)]
pub struct GradedMesh {
    /// The nodes, split sides and node sets, without what closures add.
    finer: Finer,
    /// The elements; some have split sides.
    elements: Vec<Part>,
    /// The halvings of the elements of the first mesh.
    halvings: Vec<Halving>,
    boundaries: BTreeMap<String, Vec<Edge>>,
    /// The elements of the first mesh, by group.
    groups: BTreeMap<String, Vec<u32>>,
    set_names: Vec<String>,
    added_midsides: Option<u32>,
    nodes_left_out: BTreeMap<String, u32>,
}

/// A part of an element of the first mesh.
#[derive(Clone, Copy)]
struct Part {
    element: Element,
    /// The element of the first mesh that contains this part.
    origin: u32,
    /// How often the element of the first mesh was halved to give this part.
    halved: u32,
    /// The contribution of this part to the errors, [`GradedMesh::set_contributions`].
    contribution: f64,
}

impl GradedMesh {
    /// Starts from a mesh without hanging nodes.
    pub fn new(mesh: &Mesh) -> Self {
        GradedMesh {
            finer: Finer::new(mesh),
            elements: (mesh.elements.iter().zip(0..))
                .map(|(element, origin)| Part {
                    element: *element,
                    origin,
                    halved: 0,
                    contribution: 0.0,
                })
                .collect(),
            halvings: halvings(mesh),
            boundaries: mesh.boundaries.clone(),
            groups: mesh.groups.clone(),
            set_names: mesh.node_sets.keys().cloned().collect(),
            added_midsides: mesh.added_midsides,
            nodes_left_out: mesh.nodes_left_out.clone(),
        }
    }

    /// The number of elements before closing; each is one element of the closed mesh or, if its sides are split,
    /// several.
    pub fn elements(&self) -> usize {
        self.elements.len()
    }

    /// Sets the contribution of every element to the errors. Where an element is divided, its parts get what is left of it.
    pub fn set_contributions(&mut self, contributions: &[f64]) {
        for (part, contribution) in self.elements.iter_mut().zip(contributions) {
            part.contribution = *contribution;
        }
    }

    /// The contributions of the elements to the errors, as set, or as expected of elements divided since.
    pub fn contributions(&self) -> Vec<f64> {
        self.elements.iter().map(|part| part.contribution).collect()
    }

    /// Divides the elements that are marked, and others until the rest can be closed.
    pub fn refine(&mut self, marked: &[bool]) {
        let mut marked = marked.to_vec();
        let mut unfolding = 0;
        while marked.contains(&true) {
            let parts = std::mem::take(&mut self.elements);
            for (part, marked) in parts.into_iter().zip(marked) {
                if marked {
                    self.divide(part)
                } else {
                    self.elements.push(part)
                }
            }
            let parts = self.elements.iter();
            marked = parts.map(|part| self.must_divide(&part.element)).collect();
            if !marked.contains(&true) && unfolding < MOST_UNFOLDING {
                unfolding += 1;
                marked = self.folded();
            }
        }
        for edges in self.boundaries.values_mut() {
            let mut finer = Vec::with_capacity(edges.len());
            for edge in edges.iter() {
                pieces(&self.finer, *edge, &mut finer);
            }
            *edges = finer;
        }
    }

    /// Moves the nodes of a boundary onto its curve; if the boundary is too far from it, the nodes stay.
    pub fn put_on_curve(&mut self, boundary: &str, curve: &Curve) {
        if let Some(edges) = self.boundaries.get(boundary) {
            let _ = put_on_curve(&mut self.finer.nodes, edges, curve);
        }
    }

    /// The mesh without hanging nodes, and for each of its elements the number of the element of `self` that contains
    /// the element.
    pub fn closed(&self) -> (Mesh, Vec<u32>) {
        let mut finer = self.finer.clone();
        let (mut elements, mut parts) = (Vec::new(), Vec::new());
        let mut groups: BTreeMap<&String, Vec<u32>> =
            self.groups.keys().map(|name| (name, vec![])).collect();
        let mut groups_of: BTreeMap<u32, Vec<&String>> = BTreeMap::new();
        for (name, group) in &self.groups {
            for e in group {
                groups_of.entry(*e).or_default().push(name);
            }
        }
        for (part, number) in self.elements.iter().zip(0..) {
            for closing in closure(&mut finer, &part.element) {
                for name in groups_of.get(&part.origin).into_iter().flatten() {
                    let group = groups.entry(name).or_default();
                    group.push(elements.len() as u32);
                }
                elements.push(closing);
                parts.push(number);
            }
        }
        let mesh = Mesh {
            nodes: finer.nodes,
            elements,
            boundaries: self.boundaries.clone(),
            groups: groups
                .into_iter()
                .map(|(name, group)| (name.clone(), group))
                .collect(),
            node_sets: finer.sets.into_named(self.set_names.iter()),
            added_midsides: self.added_midsides,
            nodes_left_out: self.nodes_left_out.clone(),
            temperatures: finer.temperatures,
            lineage: finer.lineage,
        };
        (mesh, parts)
    }

    /// Adds the four parts of an element, or the two halves of a long one.
    fn divide(&mut self, part: Part) {
        let Part {
            element,
            origin,
            halved,
            contribution,
        } = part;
        let halving = self.halvings[origin as usize];
        let (children, halved): (Vec<Element>, u32) = match element {
            Element::Quad(p) if halved < halving.times => {
                let across = turned(p, halving.sides);
                for i in [0, 2] {
                    let (a, b) = (across[i], across[(i + 1) % 4]);
                    self.finer.split([a, b, across[4 + i]]);
                }
                let halves = halves(&mut self.finer, across).unwrap_or_default();
                // sides keep their numbers, which say how they are split
                let back = |half: Element| match half {
                    Element::Quad(p) => Element::Quad(turned(p, 4 - halving.sides)),
                    triangle => triangle,
                };
                (halves.into_iter().map(back).collect(), halved + 1)
            }
            _ => (self.finer.children(&element).to_vec(), halved),
        };
        let contribution = LEFT * contribution / children.len() as f64;
        self.elements
            .extend(children.into_iter().map(|element| Part {
                element,
                origin,
                halved,
                contribution,
            }));
    }

    /// Whether the sides of an element are split so often that it cannot be closed.
    fn must_divide(&self, element: &Element) -> bool {
        let split = element.sides().map(|[start, _, mid]| {
            let Some((first, second)) = self.finer.halves(mid, start) else {
                return 0;
            };
            let again = |half: u32| self.finer.halves(half, start).is_some();
            1 + u32::from(again(first) || again(second))
        });
        must_divide(element.family().corners(), split)
    }

    /// The elements whose closure would be inverted, because their sides are too curved.
    fn folded(&self) -> Vec<bool> {
        let mut finer = self.finer.clone();
        let mut folds = |part: &Part| {
            let closing = closure(&mut finer, &part.element);
            closing.len() > 1
                && closing.iter().any(|part| {
                    let nodes = part.gather(|n| finer.nodes[n as usize]);
                    let family = part.family();
                    let points = family.rule(3).iter().map(|point| point.place);
                    let mut places = points.chain(family.places().iter().copied());
                    !places.all(|place| family.map(&nodes, place).det > 0.0)
                })
        };
        let folded: Vec<bool> = self.elements.iter().map(&mut folds).collect();
        // what is folded itself is no better when it is divided
        let upright = |part: &Part| {
            let nodes = part.element.gather(|n| self.finer.nodes[n as usize]);
            let family = part.element.family();
            let mut places = family.places().iter();
            places.all(|place| family.map(&nodes, *place).det > 0.0)
        };
        let pairs = folded.iter().zip(&self.elements);
        pairs
            .map(|(folded, part)| *folded && upright(part))
            .collect()
    }
}

/// Appends the unsplit pieces of an edge to `into`, in order.
fn pieces(finer: &Finer, [a, b, mid]: Edge, into: &mut Vec<Edge>) {
    match finer.halves(mid, a) {
        None => into.push([a, b, mid]),
        Some((first, second)) => {
            pieces(finer, [a, mid, first], into);
            pieces(finer, [mid, b, second], into);
        }
    }
}

/// Divides an element with split sides into elements without split sides; returns the element itself if none is split.
fn closure(finer: &mut Finer, element: &Element) -> Vec<Element> {
    let split: Vec<usize> = element
        .sides()
        .enumerate()
        .filter(|(_, [start, _, mid])| finer.halves(*mid, *start).is_some())
        .map(|(k, _)| k)
        .collect();
    let closed = match (element, &split[..]) {
        (Element::Triangle(p), [k]) => bisected(finer, *p, *k),
        (Element::Quad(p), [k]) => fan(finer, turned(*p, *k)),
        (Element::Quad(p), [0, 2]) => halves(finer, *p),
        (Element::Quad(p), [1, 3]) => halves(finer, turned(*p, 1)),
        // sides that follow one another, from the first of them
        (Element::Quad(p), [0, 3]) => three(finer, turned(*p, 3)),
        (Element::Quad(p), [k, _]) => three(finer, turned(*p, *k)),
        _ => None,
    };
    closed.unwrap_or_else(|| vec![*element])
}

/// A quadrilateral numbered from another corner.
fn turned(p: [u32; 8], by: usize) -> [u32; 8] {
    std::array::from_fn(|i| p[i / 4 * 4 + (i + by) % 4])
}

/// Two triangles in place of a triangle whose side `k` is split.
fn bisected(finer: &mut Finer, p: [u32; 6], k: usize) -> Option<Vec<Element>> {
    let [a, b, c, ab, bc, ca] = std::array::from_fn(|i| p[i / 3 * 3 + (i + k) % 3]);
    let (first, second) = finer.halves(ab, a)?;
    let [inner] = finer.inside(&Element::Triangle([a, b, c, ab, bc, ca]), [[0.25, 0.5]]);
    Some(vec![
        Element::Triangle([a, ab, c, first, inner, ca]),
        Element::Triangle([ab, b, c, second, bc, inner]),
    ])
}

/// Three triangles in place of a quadrilateral whose first side is split.
fn fan(finer: &mut Finer, p: [u32; 8]) -> Option<Vec<Element>> {
    let [a, b, c, d, ab, bc, cd, da] = p;
    let (first, second) = finer.halves(ab, a)?;
    let [to_c, to_d] = finer.inside(&Element::Quad(p), [[0.5, 0.0], [-0.5, 0.0]]);
    Some(vec![
        Element::Triangle([a, ab, d, first, to_d, da]),
        Element::Triangle([ab, c, d, to_c, cd, to_d]),
        Element::Triangle([ab, b, c, second, bc, to_c]),
    ])
}

/// Two quadrilaterals in place of a quadrilateral whose first and third sides are split.
fn halves(finer: &mut Finer, p: [u32; 8]) -> Option<Vec<Element>> {
    let [a, b, c, d, ab, bc, cd, da] = p;
    let (south, north) = (finer.halves(ab, a)?, finer.halves(cd, c)?);
    let [centre] = finer.inside(&Element::Quad(p), [[0.0, 0.0]]);
    Some(vec![
        Element::Quad([a, ab, cd, d, south.0, centre, north.1, da]),
        Element::Quad([ab, b, c, cd, south.1, bc, north.0, centre]),
    ])
}

/// Three quadrilaterals in place of a quadrilateral whose first and second sides are split.
fn three(finer: &mut Finer, p: [u32; 8]) -> Option<Vec<Element>> {
    let [a, b, c, d, ab, bc, cd, da] = p;
    let (south, east) = (finer.halves(ab, a)?, finer.halves(bc, b)?);
    let [centre, to_south, to_east, to_d] = finer.inside(
        &Element::Quad(p),
        [[0.0, 0.0], [0.0, -0.5], [0.5, 0.0], [-0.5, 0.5]],
    );
    Some(vec![
        Element::Quad([a, ab, centre, d, south.0, to_south, to_d, da]),
        Element::Quad([ab, b, bc, centre, south.1, east.0, to_east, to_south]),
        Element::Quad([centre, bc, c, d, to_east, east.1, cd, to_d]),
    ])
}
