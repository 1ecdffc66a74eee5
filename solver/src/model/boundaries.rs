//! The mesh with all its names, and values along named boundaries.

use std::collections::BTreeMap;

use super::findings::{ALIGNED, Findings};
use crate::error::escape;
use crate::mesh::{self, Edge, Mesh};
use crate::problem::{AdaptiveRefine, Analysis, BoundaryValue, MeshInput, Refine};

/// More refinements than this overflow any machine; the size itself is bounded by the caller.
const MOST_REFINEMENTS: u32 = 20;

impl Findings {
    /// The refined mesh with all its names, or `None` after saying why not.
    pub(super) fn mesh(
        &mut self,
        input: &MeshInput,
        analysis: &Analysis,
        contacts: usize,
    ) -> Option<Mesh> {
        let before = self.violations.len();
        let mut mesh = match (&input.grid, &input.inline) {
            (Some(grid), None) => {
                self.violations
                    .extend(mesh::grid_violations(grid, "/mesh/grid"));
                (self.violations.len() == before).then(|| mesh::grid_mesh(grid))
            }
            (None, Some(inline)) => mesh::inline_mesh(inline, "/mesh/inline")
                .map_err(|v| self.violations.extend(v))
                .ok(),
            (grid, _) => {
                let got = if grid.is_some() {
                    "both `grid` and `inline`"
                } else {
                    "neither `grid` nor `inline`"
                };
                self.say(
                    "/mesh",
                    "wrong_count",
                    got,
                    "exactly one of `grid` and `inline`",
                    "Give the mesh in one of the two forms.",
                );
                None
            }
        };
        let refine = match input.refine {
            Refine::Times(times) => times,
            Refine::Adaptive(goal) => {
                self.adaptive(input, &goal, contacts);
                0
            }
        };
        if refine > MOST_REFINEMENTS {
            self.say(
                "/mesh/refine",
                "out_of_range",
                refine,
                format!("0 … {MOST_REFINEMENTS}"),
                "Each refinement makes four elements of one.",
            );
            mesh = None;
        }
        let mut mesh = mesh?;
        // straight-sided grids need no look at their corners, and stay what they are when refined
        let inline = input.inline.is_some();
        self.inverted(&mesh, inline, "");
        if matches!(analysis, Analysis::Axisymmetric {})
            && let Some(node) = mesh.nodes.iter().position(|[r, _]| *r < 0.0)
        {
            self.say(
                if input.inline.is_some() {
                    format!("/mesh/inline/nodes/{node}")
                } else {
                    "/mesh/grid/x".to_owned()
                },
                "out_of_range",
                format!("r = {}", mesh.nodes[node][0]),
                "r ≥ 0",
                "In an axisymmetric body x is the radius.",
            );
        }
        if self.violations.len() > before {
            return None;
        }
        if let Some((x, distance)) = input.grid.as_ref().and_then(mesh::largest_cut) {
            self.warn(
                "strip_cuts_polyline",
                "/mesh/grid",
                format!("The strip leaves its polyline by {distance:.3e} at x = {x}, between two grid lines. Put a grid line there."),
            );
        }
        for _ in 0..refine {
            mesh = mesh::refine(&mesh);
        }
        if inline && refine > 0 {
            self.inverted(&mesh, false, " of the refined mesh");
        }
        if self.violations.len() > before {
            return None;
        }
        self.parts(&mut mesh, input);
        self.groups(&mut mesh, input);
        Some(mesh)
    }

    /// What adaptive refinement needs: a tolerance, a grid to put lines into, a contact to watch.
    fn adaptive(&mut self, input: &MeshInput, goal: &AdaptiveRefine, contacts: usize) {
        self.require(
            goal.tolerance > 0.0 && goal.tolerance < 1.0,
            "/mesh/refine/tolerance".into(),
            goal.tolerance,
            "0 < tolerance < 1",
            "The relative change that is left; 0.01 is one percent.",
        );
        if input.grid.is_none() {
            self.say(
                "/mesh/refine",
                "not_used",
                "adaptive refinement of a mesh that is no grid",
                "a `grid`, or a number of refinements",
                "Lines can be put into a grid only; refine an inline mesh by a number.",
            );
        }
        if contacts == 0 {
            self.say(
                "/mesh/refine",
                "not_used",
                "adaptive refinement without a contact",
                "a contact, or a number of refinements",
                "It watches the forces and peak stresses of contacts.",
            );
        }
    }

    /// Names for groups of elements.
    fn groups(&mut self, mesh: &mut Mesh, input: &MeshInput) {
        let size = [0, 1]
            .map(|axis| mesh.extent(axis))
            .into_iter()
            .fold(0.0, f64::max);
        for (name, range) in &input.groups {
            let pointer = format!("/mesh/groups/{}", escape(name));
            if mesh.groups.contains_key(name) {
                self.say(
                    &pointer,
                    "name_taken",
                    name,
                    "a name that the mesh does not have yet",
                    "Groups of an inline mesh have names already.",
                );
                continue;
            }
            let holds = |e: &u32| {
                let nodes = mesh.element_nodes(&mesh.elements[*e as usize]);
                nodes
                    .iter()
                    .all(|place| within(&[range.x, range.y], place, size))
            };
            let elements: Vec<u32> = (0..mesh.elements.len() as u32).filter(holds).collect();
            if elements.is_empty() {
                self.say(
                    &pointer,
                    "empty_group",
                    "no element",
                    "at least one element whose nodes all lie in the range",
                    "Put grid lines on the edges of the group.",
                );
            }
            mesh.groups.insert(name.clone(), elements);
        }
    }

    fn inverted(&mut self, mesh: &Mesh, inline: bool, of: &str) {
        for (e, place, det) in mesh.inverted_elements(inline).into_iter().take(20) {
            let pointer = match (inline, of) {
                (true, "") => format!("/mesh/inline/elements/{e}"),
                _ => "/mesh".to_owned(),
            };
            self.say(
                pointer,
                "inverted_element",
                format!("element {e}{of} with det J = {det:.3e} at {place}"),
                "det J > 0 at all nine Gauss points and at the nodes",
                "List corners counter-clockwise, and keep midsides near the middle of their sides.",
            );
        }
    }

    /// Names for parts of boundaries.
    pub(super) fn parts(&mut self, mesh: &mut Mesh, input: &MeshInput) {
        let original = mesh.boundaries.clone();
        let size = [0, 1]
            .map(|axis| mesh.extent(axis))
            .into_iter()
            .fold(0.0, f64::max);
        for (name, part) in &input.boundaries {
            let pointer = format!("/mesh/boundaries/{}", escape(name));
            if original.contains_key(name) {
                self.say(
                    &pointer,
                    "name_taken",
                    name,
                    "a name that the mesh does not have yet",
                    format!("It has {}.", names(&original)),
                );
                continue;
            }
            let Some(edges) = original.get(&part.side) else {
                self.say(
                    format!("{pointer}/side"),
                    "unknown_boundary",
                    &part.side,
                    format!("one of {}", names(&original)),
                    "Check the spelling.",
                );
                continue;
            };
            let holds = |edge: &&Edge| {
                let nodes = mesh.edge_nodes(edge);
                nodes
                    .iter()
                    .all(|place| within(&[part.x, part.y], place, size))
            };
            let part: Vec<Edge> = edges.iter().filter(holds).copied().collect();
            if part.is_empty() {
                self.say(
                    &pointer,
                    "empty_boundary",
                    "no edge",
                    "at least one edge whose three nodes lie in the range",
                    "Put grid lines on the ends of the part.",
                );
            }
            mesh.boundaries.insert(name.clone(), part);
        }
    }

    /// The edges of a named boundary.
    pub(super) fn boundary<'a>(
        &mut self,
        mesh: &'a Mesh,
        name: &str,
        pointer: String,
    ) -> Option<&'a [Edge]> {
        let found = mesh.boundaries.get(name);
        if found.is_none() {
            self.say(
                pointer,
                "unknown_boundary",
                name,
                format!("one of {}", names(&mesh.boundaries)),
                "Check the spelling, or name a part under /mesh/boundaries.",
            );
        }
        found.map(|edges| &edges[..])
    }

    /// A boundary value at start, end and midside of every edge.
    pub(super) fn along(
        &mut self,
        mesh: &Mesh,
        edges: &[Edge],
        value: BoundaryValue,
        pointer: String,
    ) -> Vec<(Edge, [f64; 3])> {
        match value {
            BoundaryValue::Constant(value) => {
                edges.iter().map(|edge| (*edge, [value; 3])).collect()
            }
            BoundaryValue::Linear([start, end]) => {
                let runs = mesh::runs(edges);
                let [run] = &runs[..] else {
                    self.say(
                        pointer,
                        "not_a_chain",
                        format!("a boundary of {} pieces", runs.len()),
                        "one chain of edges",
                        "A value from start to end needs a boundary that hangs together.",
                    );
                    return Vec::new();
                };
                let s = crate::contact::arc_lengths(mesh, run);
                let length = s[s.len() - 1];
                let at = |node: usize| start + (end - start) * s[node] / length;
                run.iter()
                    .enumerate()
                    .map(|(k, edge)| (*edge, [at(2 * k), at(2 * k + 2), at(2 * k + 1)]))
                    .collect()
            }
        }
    }
}

/// Whether a place lies in the ranges of x and y, ends included.
fn within(ranges: &[Option<[f64; 2]>; 2], place: &[f64; 2], size: f64) -> bool {
    ranges.iter().zip(place).all(|(range, c)| {
        range.is_none_or(|[low, high]| *c >= low - ALIGNED * size && *c <= high + ALIGNED * size)
    })
}

/// The names that exist, or the first of them.
fn names(boundaries: &BTreeMap<String, Vec<Edge>>) -> String {
    const SHOWN: usize = 20;
    let shown: Vec<String> = boundaries
        .keys()
        .take(SHOWN)
        .map(|name| format!("`{name:.80}`"))
        .collect();
    match boundaries.len().saturating_sub(SHOWN) {
        0 => shown.join(", "),
        more => format!("{} and {more} more", shown.join(", ")),
    }
}
