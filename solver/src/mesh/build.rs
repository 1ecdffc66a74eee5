//! Builds a mesh from the nodes and elements of a file: second order, counter-clockwise, without unused nodes.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use super::{Edge, Mesh, key};
use crate::element::Element;
use crate::error::{AllChecks, Checked, Findings, Reason, Refused, Violation};
use crate::solution::{Warning, WarningCode};

/// Placeholder for the midsides of an element that has no midsides yet.
pub const NO_NODE: u32 = u32::MAX;

/// A mesh as read from a file. Labels are the numbers in the file, for messages.
#[derive(Debug, Default)]
pub struct RawMesh {
    /// The positions of the nodes.
    pub nodes: Vec<[f64; 2]>,
    /// Label of every node.
    pub node_labels: Vec<u64>,
    /// The elements, with nodes by their place in `nodes`; all midsides are [`NO_NODE`] if the file has only corners.
    pub elements: Vec<Element>,
    /// Label of every element.
    pub element_labels: Vec<u64>,
    /// Named lines as pairs of corners.
    pub lines: BTreeMap<String, Vec<[u32; 2]>>,
    /// Named groups of elements, by their places in `elements`.
    pub groups: BTreeMap<String, Vec<u32>>,
    /// Named sets of nodes.
    pub node_sets: BTreeMap<String, Vec<u32>>,
    /// Change of temperature at each node; empty if there is none.
    pub temperatures: Vec<f64>,
    /// Number of 9-node quadrilaterals whose centre node was dropped.
    pub without_centre: usize,
    /// A set of nodes that contains whole sides of the surface is a boundary too.
    pub sets_span_boundaries: bool,
}

/// Builds a mesh from the nodes and elements of a file, with warnings of what was changed.
///
/// # Errors
///
/// All violations of the mesh. Their pointers are empty: only the caller knows the origin of the file.
pub fn build(raw: RawMesh) -> Result<(Mesh, Vec<Warning>), Vec<Violation>> {
    let mut found = Findings::of_mesh("");
    let built = assemble(raw, &mut found);
    found.conclude(built)
}

fn assemble(mut raw: RawMesh, found: &mut Findings) -> Checked<(Mesh, Vec<Warning>)> {
    if raw.elements.is_empty() {
        return Err(found.report(
            "",
            Reason::TooFew,
            "no two-dimensional element",
            "at least one quadrilateral or triangle",
            "Mesh the surface, and save its elements (in Gmsh: put it in a physical group).",
        ));
    }
    distinct(&raw, found)?;
    // those of a large mesh take much memory, and no later message names a node
    raw.node_labels = Vec::new();
    let mut notes = Vec::new();
    let of_file = raw.nodes.len();
    let raised = normalize(&mut raw, &mut notes);
    if !raw.temperatures.is_empty() {
        raw.temperatures.resize(raw.nodes.len(), 0.0);
    }
    let (of_file, nodes_left_out) = drop_unused(&mut raw, of_file);
    let surface = Surface::new(&raw, found)?;
    let boundaries = surface.boundaries(&mut raw, &mut notes);
    let mut mesh = Mesh {
        nodes: raw.nodes,
        temperatures: raw.temperatures,
        elements: raw.elements,
        boundaries,
        groups: raw.groups,
        node_sets: raw.node_sets,
        added_midsides: raised.then_some(of_file),
        nodes_left_out,
        ..Mesh::default()
    };
    mesh.add_temperatures();
    let mut all = AllChecks::default();
    for (e, place, det) in mesh.inverted_elements(true) {
        all.fail(found.report(
            "",
            Reason::InvertedElement,
            format!(
                "element {} with det J = {det:.3e} at {place}",
                raw.element_labels[e]
            ),
            "det J > 0 at all Gauss points and at the nodes",
            "Move its nodes; a midside node far from the middle of its side inverts the element.",
        ));
    }
    all.finish((mesh, notes))
}

fn note(code: WarningCode, message: String) -> Warning {
    Warning {
        code,
        pointer: String::new(),
        message,
    }
}

/// Makes all elements counter-clockwise and of second order, with a note of what was changed; returns whether midsides
/// were added.
fn normalize(raw: &mut RawMesh, notes: &mut Vec<Warning>) -> bool {
    if raw.without_centre > 0 {
        notes.push(note(
            WarningCode::CentreNodesDropped,
            format!(
                "{} 9-node quadrilaterals became 8-node elements; their centre nodes were dropped.",
                raw.without_centre
            ),
        ));
    }
    let reversed = counter_clockwise(raw);
    if reversed > 0 {
        notes.push(note(
            WarningCode::ElementsReversed,
            format!("{reversed} elements were numbered clockwise and have been reversed."),
        ));
    }
    let raised = second_order(raw);
    if raised > 0 {
        notes.push(note(
            WarningCode::RaisedToSecondOrder,
            format!(
                "{raised} elements had only corners: midside nodes were added half-way between them. A curved side remains a polygon."
            ),
        ));
    }
    raised > 0
}

fn distinct(raw: &RawMesh, found: &mut Findings) -> Checked {
    let mut all = AllChecks::default();
    for (element, label) in raw.elements.iter().zip(&raw.element_labels) {
        let repeated = (1..element.len())
            .find(|&i| element[i] != NO_NODE && element[..i].contains(&element[i]));
        if let Some(i) = repeated {
            all.fail(found.report(
                "",
                Reason::RepeatedNode,
                format!(
                    "node {} twice in element {label}",
                    raw.node_labels[element[i] as usize]
                ),
                "different nodes",
                "Collapsed elements are not supported; use triangles.",
            ));
        }
    }
    all.finish(())
}

/// Reverses elements that are numbered clockwise; returns their number.
fn counter_clockwise(raw: &mut RawMesh) -> usize {
    let mut reversed = 0;
    for element in &mut raw.elements {
        let corners = element.family().corners();
        let at = |i: usize| raw.nodes[element[i % corners] as usize];
        let area: f64 = (0..corners)
            .map(|i| at(i)[0] * at(i + 1)[1] - at(i + 1)[0] * at(i)[1])
            .sum();
        if area < 0.0 {
            *element = match *element {
                Element::Quad([a, b, c, d, ab, bc, cd, da]) => {
                    Element::Quad([a, d, c, b, da, cd, bc, ab])
                }
                Element::Triangle([a, b, c, ab, bc, ca]) => {
                    Element::Triangle([a, c, b, ca, bc, ab])
                }
            };
            reversed += 1;
        }
    }
    reversed
}

/// Adds missing midsides, shared with the neighbours; returns the number of elements that had no midsides.
fn second_order(raw: &mut RawMesh) -> usize {
    let lacks = |element: &Element| element[element.len() - 1] == NO_NODE;
    let lacking = raw.elements.iter().filter(|e| lacks(e)).count();
    if lacking == 0 {
        return 0;
    }
    // neighbours of second order have midsides already
    let mut middles: HashMap<(u32, u32), u32> = HashMap::new();
    for element in raw.elements.iter().filter(|e| !lacks(e)) {
        for [a, b, mid] in element.sides() {
            middles.insert(key(a, b), mid);
        }
    }
    let old = raw.nodes.len() as u32;
    for element in raw.elements.iter_mut().filter(|e| lacks(e)) {
        let corners = element.family().corners();
        let before = *element;
        let nodes: &mut [u32] = match element {
            Element::Quad(nodes) => nodes,
            Element::Triangle(nodes) => nodes,
        };
        for k in 0..corners {
            let (a, b) = (before[k], before[(k + 1) % corners]);
            nodes[corners + k] = *middles.entry(key(a, b)).or_insert_with(|| {
                let [p, q] = [a, b].map(|n| raw.nodes[n as usize]);
                raw.nodes.push([0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1])]);
                raw.nodes.len() as u32 - 1
            });
        }
    }
    // between two corners of a set the new midside belongs to it, as the straight side did
    if raw.sets_span_boundaries {
        let mut degree = vec![0; raw.nodes.len()];
        let new = || middles.iter().filter(|(_, mid)| **mid >= old);
        for ((a, b), _) in new() {
            degree[*a as usize] += 1;
            degree[*b as usize] += 1;
        }
        // each side with the corner that has fewer of them: a set is gone through once, also with the hub of a fan
        let mut sides: HashMap<u32, Vec<(u32, u32)>> = HashMap::new();
        for (&(a, b), &mid) in new() {
            let (few, other) = if degree[a as usize] <= degree[b as usize] {
                (a, b)
            } else {
                (b, a)
            };
            sides.entry(few).or_default().push((other, mid));
        }
        for set in raw.node_sets.values_mut() {
            set.sort_unstable();
            let held = |node: &u32| set.binary_search(node).is_ok();
            let of_corner = set.iter().filter_map(|corner| sides.get(corner)).flatten();
            let between = of_corner.filter(|(other, _)| held(other));
            let mut new: Vec<u32> = between.map(|(_, mid)| *mid).collect();
            new.sort_unstable();
            set.extend(new);
        }
    }
    lacking
}

/// Removes the nodes that belong to no element: points of the geometry, centres of 9-node elements. Returns how many of
/// the first `of_file` nodes remain, and how many nodes each set lost.
fn drop_unused(raw: &mut RawMesh, of_file: usize) -> (u32, BTreeMap<String, u32>) {
    let mut number = vec![NO_NODE; raw.nodes.len()];
    for &node in raw.elements.iter().flat_map(|e| e.iter()) {
        number[node as usize] = 0;
    }
    let first = number.iter().take(of_file);
    let remaining = first.filter(|number| **number != NO_NODE).count();
    let mut used = 0;
    for node in 0..number.len() {
        if number[node] != NO_NODE {
            number[node] = used;
            raw.nodes[used as usize] = raw.nodes[node];
            if !raw.temperatures.is_empty() {
                raw.temperatures[used as usize] = raw.temperatures[node];
            }
            used += 1;
        }
    }
    raw.nodes.truncate(used as usize);
    raw.temperatures.truncate(used as usize);
    for element in &mut raw.elements {
        *element = element.map_nodes(|n| number[n as usize]);
    }
    for line in raw.lines.values_mut().flatten() {
        *line = line.map(|n| number[n as usize]);
    }
    let mut left_out = BTreeMap::new();
    for (name, set) in &mut raw.node_sets {
        set.sort_unstable();
        set.dedup();
        let before = set.len();
        set.iter_mut().for_each(|n| *n = number[*n as usize]);
        set.retain(|n| *n != NO_NODE);
        if set.len() < before {
            left_out.insert(name.clone(), (before - set.len()) as u32);
        }
    }
    raw.node_sets.retain(|_, set| !set.is_empty());
    (remaining as u32, left_out)
}

/// For each side, identified by its midside node, the elements that have it.
struct Owners {
    /// For each node, the number of elements that have it as a midside.
    count: Vec<u8>,
    /// For each node, the first element that has it as a midside.
    first: Vec<u32>,
}

impl Owners {
    fn new(raw: &RawMesh, found: &mut Findings) -> Checked<Self> {
        let mut all = AllChecks::default();
        let mut owners = Owners {
            count: vec![0; raw.nodes.len()],
            first: vec![0; raw.nodes.len()],
        };
        for (e, element) in raw.elements.iter().enumerate() {
            for [a, b, mid] in element.sides() {
                let mid = mid as usize;
                if owners.count[mid] == 0 {
                    owners.first[mid] = e as u32;
                } else {
                    let first = owners.first[mid] as usize;
                    // the neighbour runs along the same side in the other direction
                    let shared = raw.elements[first].sides().any(|s| s == [b, a, mid as u32]);
                    if owners.count[mid] >= 2 || !shared {
                        all.fail(nonconforming(raw, first, e, found));
                    }
                }
                owners.count[mid] = owners.count[mid].saturating_add(1);
            }
        }
        all.finish(owners)
    }
}

/// The sides with only one element, directed with the body on the right, in the order of the elements. `count`: how
/// many elements have a node as a midside.
fn surface(elements: &[Element], count: &[u8]) -> Vec<Edge> {
    elements
        .iter()
        .flat_map(Element::sides)
        .filter(|[_, _, mid]| count[*mid as usize] == 1)
        .map(|[a, b, mid]| [b, a, mid])
        .collect()
}

/// The sides of the body's surface.
struct Surface {
    sides: Vec<Edge>,
    /// The two corners of each side with its index in `sides`, sorted.
    by_corners: Vec<((u32, u32), u32)>,
}

impl Surface {
    /// Finds the surface. Reports two sides between the same corners: they belong to neighbours that do not share a
    /// midside.
    fn new(raw: &RawMesh, found: &mut Findings) -> Checked<Self> {
        let owners = Owners::new(raw, found)?;
        let sides = surface(&raw.elements, &owners.count);
        let corners = sides.iter().map(|[a, b, _]| key(*a, *b));
        let mut by_corners: Vec<((u32, u32), u32)> = corners.zip(0..).collect();
        by_corners.sort_unstable();
        let mut all = AllChecks::default();
        for pair in by_corners.windows(2) {
            if pair[0].0 == pair[1].0 {
                let owner = |i: u32| owners.first[sides[i as usize][2] as usize] as usize;
                let [first, second] = [owner(pair[0].1), owner(pair[1].1)];
                all.fail(nonconforming(raw, first, second, found));
            }
        }
        all.finish(Surface { sides, by_corners })
    }

    fn side(&self, [a, b]: [u32; 2]) -> Option<Edge> {
        let place = self
            .by_corners
            .binary_search_by_key(&key(a, b), |(corners, _)| *corners)
            .ok()?;
        Some(self.sides[self.by_corners[place].1 as usize])
    }

    /// The boundaries by the names of lines and of sets of nodes, with a note of lines that are not on the surface.
    fn boundaries(
        &self,
        raw: &mut RawMesh,
        notes: &mut Vec<Warning>,
    ) -> BTreeMap<String, Vec<Edge>> {
        let mut boundaries = BTreeMap::new();
        // a name of which lines lie inside is not that of the others: a load on these is not one on all
        let mut partial = BTreeSet::new();
        for (name, lines) in std::mem::take(&mut raw.lines) {
            let count = lines.len();
            let mut edges: Vec<Edge> = Vec::with_capacity(count);
            edges.extend(lines.into_iter().filter_map(|line| self.side(line)));
            let inside = count - edges.len();
            edges.sort_unstable();
            edges.dedup();
            if inside == 0 {
                if !edges.is_empty() {
                    boundaries.insert(name, edges);
                }
                continue;
            }
            let at_surface = format!("{name} at the surface");
            notes.push(lines_inside(&name, inside, &at_surface, edges.len()));
            if !edges.is_empty() {
                boundaries.entry(at_surface).or_insert(edges);
            }
            partial.insert(name);
        }
        if raw.sets_span_boundaries {
            self.add_sets(raw, &partial, &mut boundaries);
        }
        boundaries
    }

    /// Adds a boundary for each set of nodes whose name is free: the sides all of whose nodes are in the set.
    fn add_sets(
        &self,
        raw: &RawMesh,
        partial: &BTreeSet<String>,
        boundaries: &mut BTreeMap<String, Vec<Edge>>,
    ) {
        // the place of the side with this midside: sets are many, and each is gone through once
        let mut places = vec![NO_NODE; raw.nodes.len()];
        for ([_, _, mid], place) in self.sides.iter().zip(0..) {
            places[*mid as usize] = place;
        }
        let sets = raw.node_sets.iter();
        for (name, set) in sets.filter(|(name, _)| !partial.contains(*name)) {
            let held = |node: &u32| set.binary_search(node).is_ok();
            let place = |node: &u32| Some(places[*node as usize]).filter(|place| *place != NO_NODE);
            let mut own: Vec<u32> = set.iter().filter_map(place).collect();
            own.retain(|place| self.sides[*place as usize].iter().all(held));
            own.sort_unstable();
            if !own.is_empty() {
                let edges = own.iter().map(|place| self.sides[*place as usize]);
                let edges = edges.collect();
                boundaries.entry(name.clone()).or_insert(edges);
            }
        }
    }
}

/// The note that `inside` of the lines of `name` are no sides of the surface; the other `sides` lines are the boundary
/// `at_surface`.
fn lines_inside(name: &str, inside: usize, at_surface: &str, sides: usize) -> Warning {
    let rest = match sides {
        0 => "There is no boundary of that name.".to_owned(),
        sides => format!(
            "The boundary `{at_surface}` has the other {sides}; there is no boundary `{name}` with all of them."
        ),
    };
    note(
        WarningCode::LinesInside,
        format!(
            "{inside} lines of `{name}` are not sides of the body's surface and are left out. {rest}"
        ),
    )
}

fn nonconforming(raw: &RawMesh, first: usize, second: usize, found: &mut Findings) -> Refused {
    let [a, b] = [first, second].map(|e| raw.element_labels[e]);
    found.report(
        "",
        Reason::Nonconforming,
        format!("elements {a} and {b}, which do not share a whole side"),
        "at most two elements on a side, which share all three of its nodes",
        "Merge coincident nodes (in Gmsh: Coherence), and remove elements that overlap.",
    )
}

impl Mesh {
    /// The sides of the body's surface, directed with the body on the right.
    pub fn surface(&self) -> Vec<Edge> {
        let mut count = vec![0u8; self.nodes.len()];
        for [_, _, mid] in self.elements.iter().flat_map(Element::sides) {
            count[mid as usize] = count[mid as usize].saturating_add(1);
        }
        surface(&self.elements, &count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A node set with both corners of a straight side gets its midside too, so that the side becomes a boundary.
    #[test]
    fn a_set_of_corners_is_the_boundary_between_them() {
        let mut raw = two_squares();
        raw.sets_span_boundaries = true;
        // a node may be named twice, and in any order
        raw.node_sets.insert("base".to_owned(), vec![3, 1, 2, 3]);
        let (mesh, _) = build(raw).unwrap();
        let x = |edge: &Edge| mesh.edge_nodes(edge).map(|[x, y]| [x, y]);
        let base: Vec<_> = mesh.boundaries["base"].iter().map(x).collect();
        assert_eq!(
            base,
            [
                [[1.0, 0.0], [0.0, 0.0], [0.5, 0.0]],
                [[2.0, 0.0], [1.0, 0.0], [1.5, 0.0]]
            ]
        );
        assert_eq!(mesh.node_sets["base"].len(), 5);
        assert!(!mesh.boundaries.contains_key("corner"));
    }

    /// Two unit squares side by side, corners only; the right one runs clockwise.
    fn two_squares() -> RawMesh {
        const NONE: u32 = NO_NODE;
        RawMesh {
            nodes: vec![
                [9.0, 9.0],
                [0.0, 0.0],
                [1.0, 0.0],
                [2.0, 0.0],
                [0.0, 1.0],
                [1.0, 1.0],
                [2.0, 1.0],
            ],
            node_labels: (10..17).collect(),
            elements: vec![
                Element::Quad([1, 2, 5, 4, NONE, NONE, NONE, NONE]),
                Element::Quad([2, 5, 6, 3, NONE, NONE, NONE, NONE]),
            ],
            element_labels: vec![100, 200],
            lines: BTreeMap::from([("top".to_owned(), vec![[4, 5], [6, 5], [5, 4], [2, 5]])]),
            node_sets: BTreeMap::from([("corner".to_owned(), vec![1, 0])]),
            ..RawMesh::default()
        }
    }

    #[test]
    fn missing_midsides_are_added_and_unused_nodes_removed() {
        let (mesh, notes) = build(two_squares()).unwrap();
        assert_eq!(mesh.nodes.len(), 13);
        assert_eq!(mesh.added_midsides, Some(6));
        assert_eq!(mesh.connected_parts().len(), 1);
        // one of its lines lies inside
        assert!(!mesh.boundaries.contains_key("top"));
        assert_eq!(mesh.boundaries["top at the surface"].len(), 2);
        for edge in &mesh.boundaries["top at the surface"] {
            let [[x0, y0], [x1, y1], [xm, _]] = mesh.edge_nodes(edge);
            assert!(y0 == 1.0 && y1 == 1.0 && x1 > x0 && xm == 0.5 * (x0 + x1));
        }
        assert_eq!(mesh.node_sets["corner"], [0]);
        let codes: Vec<WarningCode> = notes.iter().map(|w| w.code).collect();
        assert_eq!(
            codes,
            [
                WarningCode::ElementsReversed,
                WarningCode::RaisedToSecondOrder,
                WarningCode::LinesInside
            ]
        );
        assert_eq!(mesh.surface().len(), 6);
    }

    #[test]
    fn a_linear_square_shares_the_midside_of_a_quadratic_triangle() {
        let mut raw = two_squares();
        raw.nodes.extend([[1.5, 0.0], [1.6, 0.5], [1.0, 0.55]]);
        raw.node_labels.extend([17, 18, 19]);
        raw.elements[1] = Element::Triangle([2, 3, 5, 7, 8, 9]);
        let (mesh, _) = build(raw).unwrap();
        assert_eq!(mesh.connected_parts().len(), 1);
        // the side they share bends
        assert!(mesh.nodes.contains(&[1.0, 0.55]) && !mesh.nodes.contains(&[1.0, 0.5]));
    }

    #[test]
    fn faults_of_a_mesh_are_reported_with_the_numbers_of_the_file() {
        let reported = |raw: RawMesh| {
            let list = build(raw).unwrap_err();
            (list[0].reason, list[0].got.clone())
        };
        let mut raw = two_squares();
        raw.elements[0] = raw.elements[0].map_nodes(|n| if n == 4 { 1 } else { n });
        assert_eq!(
            reported(raw),
            (
                Reason::RepeatedNode,
                "node 11 twice in element 100".to_owned()
            )
        );
        let mut raw = two_squares();
        raw.elements.push(raw.elements[0]);
        raw.element_labels.push(300);
        let (reason, got) = reported(raw);
        assert!(
            reason == Reason::Nonconforming && got.contains("100") && got.contains("300"),
            "{got}"
        );
        let mut raw = two_squares();
        raw.nodes[5] = [0.4, 0.1];
        assert_eq!(reported(raw).0, Reason::InvertedElement);
        assert_eq!(reported(RawMesh::default()).0, Reason::TooFew);
    }
}
