//! Builds meshes that are written out in the problem.

use std::collections::{HashMap, HashSet};

use super::{Mesh, key};
use crate::error::{AllChecks, Checked, Findings, Reason, Violation, escape};
use crate::problem::InlineMesh;

/// Builds the mesh that a problem has written out; `pointer` is the mesh's place in the problem.
///
/// # Errors
///
/// All violations of the mesh's numbering.
pub fn inline_mesh(input: InlineMesh, pointer: &str) -> Result<Mesh, Vec<Violation>> {
    let mut found = Findings::of_mesh(pointer);
    let mesh = check(input, &mut found);
    found.conclude(mesh)
}

fn check(input: InlineMesh, found: &mut Findings) -> Checked<Mesh> {
    // the following needs valid numbers
    let used = numbers(&input, found)?;
    let mut all = AllChecks::default();
    for node in (0..input.nodes.len()).filter(|&n| !used[n]) {
        all.fail(found.report(
            format!("/nodes/{node}"),
            Reason::UnusedNode,
            "a node of no element",
            "every node in an element",
            "Remove the node.",
        ));
    }
    let sides = surface(&input, found, &mut all);
    let boundaries = input.boundaries.iter().filter_map(|(name, edges)| {
        let directed = all.check(directed(name, edges, &sides, found))?;
        Some((name.clone(), directed))
    });
    let boundaries = boundaries.collect();
    let temperatures = input.temperatures.len();
    if temperatures > 0 && temperatures != input.nodes.len() {
        all.fail(found.report(
            "/temperatures",
            Reason::WrongLength,
            format!("{temperatures} temperatures"),
            format!("{}, one for each node", input.nodes.len()),
            "Give 0 where the temperature does not change.",
        ));
    }
    all.finish(())?;
    Ok(Mesh {
        nodes: input.nodes,
        temperatures: input.temperatures,
        elements: input.elements,
        boundaries,
        groups: input.groups,
        node_sets: input.node_sets,
        ..Mesh::default()
    })
}

/// Checks nodes and elements by their numbers; returns which nodes are in use.
fn numbers(input: &InlineMesh, found: &mut Findings) -> Checked<Vec<bool>> {
    let mut all = AllChecks::default();
    let count = input.nodes.len() as u32;
    if input.elements.is_empty() {
        all.fail(found.report(
            "/elements",
            Reason::TooFew,
            "no element",
            "at least one element",
            "Give the elements as lists of eight or six nodes.",
        ));
    }
    let mut used = vec![false; input.nodes.len()];
    for (e, element) in input.elements.iter().enumerate() {
        for (i, &node) in element.iter().enumerate() {
            let place = || format!("/elements/{e}/{i}");
            if node >= count {
                all.fail(found.report(
                    place(),
                    Reason::UnknownNode,
                    node,
                    format!("a node below {count}"),
                    "Nodes are numbered from 0.",
                ));
            } else if element[..i].contains(&node) {
                all.fail(found.report(
                    place(),
                    Reason::RepeatedNode,
                    node,
                    "different nodes",
                    "Collapsed elements are not supported.",
                ));
            } else {
                used[node as usize] = true;
            }
        }
    }
    for (name, group) in &input.groups {
        let mut members = HashSet::with_capacity(group.len());
        for (i, e) in group.iter().enumerate() {
            let place = format!("/groups/{}/{i}", escape(name));
            if *e as usize >= input.elements.len() {
                all.fail(found.report(
                    place,
                    Reason::UnknownElement,
                    e,
                    format!("an element below {}", input.elements.len()),
                    "Elements are numbered from 0.",
                ));
            } else if !members.insert(*e) {
                all.fail(found.report(
                    place,
                    Reason::RepeatedElement,
                    e,
                    "each element once",
                    "Remove the repeated number.",
                ));
            }
        }
    }
    for (name, set) in &input.node_sets {
        let mut members = HashSet::with_capacity(set.len());
        for (i, node) in set.iter().enumerate() {
            let place = format!("/node_sets/{}/{i}", escape(name));
            if *node >= count {
                all.fail(found.report(
                    place,
                    Reason::UnknownNode,
                    node,
                    format!("a node below {count}"),
                    "Nodes are numbered from 0.",
                ));
            } else if !members.insert(*node) {
                all.fail(found.report(
                    place,
                    Reason::RepeatedNode,
                    node,
                    "each node once",
                    "A force on the set would act on it twice.",
                ));
            }
        }
    }
    for (name, edges) in &input.boundaries {
        if edges.is_empty() {
            all.fail(found.report(
                format!("/boundaries/{}", escape(name)),
                Reason::TooFew,
                "no edge",
                "at least one edge",
                "Remove the name or list its edges.",
            ));
        }
    }
    all.finish(used)
}

/// Checks the edges of a boundary; returns the edges, each with the body on its right.
fn directed(
    name: &str,
    edges: &[[u32; 3]],
    sides: &HashMap<(u32, u32), Side>,
    found: &mut Findings,
) -> Checked<Vec<[u32; 3]>> {
    let mut all = AllChecks::default();
    let mut directed = Vec::with_capacity(edges.len());
    let mut named = HashSet::with_capacity(edges.len());
    for (i, &[a, b, mid]) in edges.iter().enumerate() {
        let (reason, got, expected, hint) = match sides.get(&key(a, b)) {
            _ if !named.insert(key(a, b)) => (
                Reason::RepeatedEdge,
                format!("{a}–{b} once more"),
                "each edge once".to_owned(),
                "A load on the edge would count twice.",
            ),
            Some(side) if side.elements == 1 && side.mid == mid => {
                directed.push(side.directed);
                continue;
            }
            Some(side) if side.elements == 1 => (
                Reason::WrongMidside,
                format!("midside {mid}"),
                side.mid.to_string(),
                "An edge is [corner, corner, midside].",
            ),
            Some(_) => (
                Reason::InnerEdge,
                format!("{a}–{b}, between two elements"),
                "an edge of the surface".to_owned(),
                "Boundaries lie on the surface of the body.",
            ),
            None => (
                Reason::UnknownEdge,
                format!("{a}–{b}"),
                "the two corners of an element's side".to_owned(),
                "An edge is [corner, corner, midside].",
            ),
        };
        let place = format!("/boundaries/{}/{i}", escape(name));
        all.fail(found.report(place, reason, got, expected, hint));
    }
    all.finish(directed)
}

struct Side {
    elements: u32,
    mid: u32,
    /// The side as an edge with the body on its right.
    directed: [u32; 3],
}

/// All sides by their corners; reports neighbours that do not share a midside.
fn surface(
    input: &InlineMesh,
    found: &mut Findings,
    all: &mut AllChecks,
) -> HashMap<(u32, u32), Side> {
    let mut sides: HashMap<(u32, u32), Side> = HashMap::with_capacity(2 * input.elements.len());
    for (e, element) in input.elements.iter().enumerate() {
        for (k, [a, b, mid]) in element.sides().enumerate() {
            let side = sides.entry(key(a, b)).or_insert(Side {
                elements: 0,
                mid,
                directed: [b, a, mid],
            });
            side.elements += 1;
            if side.mid != mid {
                all.fail(found.report(
                    format!("/elements/{e}/{}", element.family().corners() + k),
                    Reason::Nonconforming,
                    format!("midside {mid}"),
                    format!("midside {}, as the neighbour has it", side.mid),
                    "Neighbours share all three nodes of a side.",
                ));
            } else if side.elements > 2 {
                all.fail(found.report(
                    format!("/elements/{e}"),
                    Reason::Nonconforming,
                    format!("a third element on the side {a}–{b}"),
                    "at most two elements on a side",
                    "Remove the overlapping element.",
                ));
            }
        }
    }
    sides
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::element::Element;
    use std::collections::BTreeMap;

    fn square() -> InlineMesh {
        InlineMesh {
            temperatures: Vec::new(),
            nodes: vec![
                [0.0, 0.0],
                [1.0, 0.0],
                [1.0, 1.0],
                [0.0, 1.0],
                [0.5, 0.0],
                [1.0, 0.5],
                [0.5, 1.0],
                [0.0, 0.5],
            ],
            elements: vec![Element::Quad([0, 1, 2, 3, 4, 5, 6, 7])],
            boundaries: BTreeMap::from([("top".to_owned(), vec![[3, 2, 6]])]),
            groups: BTreeMap::new(),
            node_sets: BTreeMap::new(),
        }
    }

    #[test]
    fn a_boundary_edge_is_directed_with_the_body_on_its_right() {
        for edge in [[3, 2, 6], [2, 3, 6]] {
            let mut input = square();
            input.boundaries.insert("top".to_owned(), vec![edge]);
            assert_eq!(
                inline_mesh(input.clone(), "").unwrap().boundaries["top"],
                [[3, 2, 6]]
            );
        }
    }

    #[test]
    fn unknown_and_repeated_nodes_and_unknown_edges_are_reported() {
        let mut input = square();
        input.elements[0] = Element::Quad([0, 1, 99, 1, 4, 5, 6, 7]);
        let pointers: Vec<_> = inline_mesh(input.clone(), "/mesh/inline")
            .unwrap_err()
            .into_iter()
            .map(|v| v.pointer)
            .collect();
        assert_eq!(
            pointers,
            ["/mesh/inline/elements/0/2", "/mesh/inline/elements/0/3"]
        );

        let mut input = square();
        input.nodes.push([5.0, 5.0]);
        input
            .boundaries
            .insert("top".to_owned(), vec![[3, 1, 6], [3, 2, 5], [2, 3, 6]]);
        let reasons: Vec<_> = inline_mesh(input.clone(), "")
            .unwrap_err()
            .into_iter()
            .map(|v| v.reason)
            .collect();
        assert_eq!(
            reasons,
            [
                Reason::UnusedNode,
                Reason::UnknownEdge,
                Reason::WrongMidside,
                Reason::RepeatedEdge
            ]
        );
    }

    #[test]
    fn a_long_list_of_the_same_fault_is_counted() {
        let mut input = square();
        input.nodes.extend((0..100).map(|i| [f64::from(i), 9.0]));
        let list = inline_mesh(input.clone(), "").unwrap_err();
        assert_eq!(list.len(), 20);
        assert!(list[19].hint.contains("80 more"));
    }
}
