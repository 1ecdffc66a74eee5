//! The mesh with all its names, and values along named boundaries.

use super::estimate::{MOST_ADAPTIVE_ELEMENTS, MOST_ADAPTIVE_LINES};
use super::findings::{ALIGNED, Findings};
use crate::error::escape;
use crate::mesh::{self, Edge, External, Mesh};
use crate::problem::{AdaptiveRefine, Analysis, BoundaryPart, BoundaryValue, MeshInput, Refine};

/// Sides face one way when their normals differ by no more (degrees).
const SAME_DIRECTION: f64 = 1.0;

/// More refinements than this overflow any machine; the size itself is bounded by the caller.
const MOST_REFINEMENTS: u32 = 20;

impl Findings {
    /// The refined mesh with all its names, or `None` after saying why not.
    pub(super) fn mesh(
        &mut self,
        input: &MeshInput,
        external: Option<External>,
        analysis: &Analysis,
        contacts: usize,
    ) -> Option<Mesh> {
        let before = self.violations.len();
        let mut mesh = self.source(input, external);
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
        // what was read from a file was looked at there
        let faults = if input.grid.is_some() {
            // straight-sided grids need no look at their corners, and stay what they are when refined
            mesh::inverted(&mesh, false, |_| "/mesh".to_owned(), "")
        } else if input.inline.is_some() {
            let element = |e| format!("/mesh/inline/elements/{e}");
            mesh::inverted(&mesh, true, element, "")
        } else {
            Vec::new()
        };
        self.adopt(faults);
        if matches!(analysis, Analysis::Axisymmetric {})
            && let Some(node) = mesh.nodes.iter().position(|[r, _]| *r < 0.0)
        {
            self.say(
                match (&input.inline, &input.grid) {
                    (Some(_), _) => format!("/mesh/inline/nodes/{node}"),
                    (None, Some(_)) => "/mesh/grid/x".to_owned(),
                    _ => "/mesh".to_owned(),
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
        if input.grid.is_none() && refine > 0 {
            let whole = |_| "/mesh".to_owned();
            self.adopt(mesh::inverted(&mesh, false, whole, " of the refined mesh"));
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
        let lines = input
            .grid
            .as_ref()
            .map_or([0; 2], |grid| [grid.x.len(), grid.y.len()]);
        if lines[0] * lines[1] > MOST_ADAPTIVE_ELEMENTS
            || lines[0].max(lines[1]) > MOST_ADAPTIVE_LINES
        {
            self.say(
                "/mesh/refine",
                "too_large",
                format!("a first grid of {} × {} lines", lines[0], lines[1]),
                format!("at most {MOST_ADAPTIVE_ELEMENTS} elements and {MOST_ADAPTIVE_LINES} lines in a direction"),
                "Adaptive refinement starts coarse and makes no larger grid; give a coarse one, or a number of refinements.",
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

    /// The mesh as it is given, before it is refined.
    fn source(&mut self, input: &MeshInput, external: Option<External>) -> Option<Mesh> {
        let forms = [
            ("grid", input.grid.is_some()),
            ("inline", input.inline.is_some()),
            ("gmsh", input.gmsh.is_some()),
            ("abaqus", input.abaqus.is_some()),
            ("stored", input.stored.is_some()),
        ];
        let given: Vec<String> = forms
            .iter()
            .filter(|form| form.1)
            .map(|form| format!("`{}`", form.0))
            .collect();
        if given.len() != 1 {
            let got = match given.len() {
                0 => "none of them".to_owned(),
                _ => given.join(" and "),
            };
            self.say(
                "/mesh",
                "wrong_count",
                got,
                "exactly one of `grid`, `inline`, `gmsh`, `abaqus`, `stored`",
                "Give the mesh in one form.",
            );
            return None;
        }
        if let Some(grid) = &input.grid {
            let faults = mesh::grid_violations(grid, "/mesh/grid");
            let sound = faults.is_empty();
            self.violations.extend(faults);
            return sound.then(|| mesh::grid_mesh(grid));
        }
        if let Some(inline) = &input.inline {
            return mesh::inline_mesh(inline, "/mesh/inline")
                .map_err(|v| self.violations.extend(v))
                .ok();
        }
        match external {
            Some(Ok(found)) => {
                self.warnings.extend(found.warnings);
                Some(found.mesh)
            }
            Some(Err(faults)) => {
                self.violations.extend(faults);
                None
            }
            None => {
                self.absent(input);
                None
            }
        }
    }

    /// The caller has no mesh for what the problem names or quotes.
    fn absent(&mut self, input: &MeshInput) {
        match &input.stored {
            Some(hash) => self.say(
                "/mesh/stored",
                "unknown_mesh",
                hash,
                "a mesh that this service has stored",
                "Upload it first (POST /v1/meshes); `signorini solve` has no store: give the mesh itself.",
            ),
            None => self.say(
                "/mesh",
                "unknown_mesh",
                "a text that nobody has read",
                "a mesh that was read from it",
                "Read it before the problem is checked.",
            ),
        }
    }

    /// Names for parts of boundaries.
    pub(super) fn parts(&mut self, mesh: &mut Mesh, input: &MeshInput) {
        let original = mesh.boundaries.clone();
        let size = [0, 1]
            .map(|axis| mesh.extent(axis))
            .into_iter()
            .fold(0.0, f64::max);
        let mut surface = None;
        for (name, part) in &input.boundaries {
            let pointer = format!("/mesh/boundaries/{}", escape(name));
            if original.contains_key(name) {
                self.say(
                    &pointer,
                    "name_taken",
                    name,
                    "a name that the mesh does not have yet",
                    format!("It has {}.", names(original.keys())),
                );
                continue;
            }
            let edges = match &part.side {
                None => surface.get_or_insert_with(|| mesh.surface()),
                Some(side) => {
                    let Some(edges) = original.get(side) else {
                        self.say(
                            format!("{pointer}/side"),
                            "unknown_boundary",
                            side,
                            format!("one of {}", names(original.keys())),
                            "Check the spelling.",
                        );
                        continue;
                    };
                    edges
                }
            };
            if !self.direction(part, &pointer) {
                continue;
            }
            let ranges = part.corners.map(|[[x0, y0], [x1, y1]]| {
                [
                    Some([x0.min(x1), x0.max(x1)]),
                    Some([y0.min(y1), y0.max(y1)]),
                ]
            });
            let holds = |edge: &&Edge| {
                let nodes = mesh.edge_nodes(edge);
                nodes.iter().all(|place| {
                    within(&[part.x, part.y], place, size)
                        && ranges.is_none_or(|ranges| within(&ranges, place, size))
                }) && faces(part, &nodes)
            };
            let part: Vec<Edge> = edges.iter().filter(holds).copied().collect();
            if part.is_empty() {
                self.say(
                    &pointer,
                    "empty_boundary",
                    "no edge",
                    "at least one edge of the surface that fits all conditions at its three nodes",
                    "Put grid lines on the ends of the part; check the direction of the normal.",
                );
            }
            mesh.boundaries.insert(name.clone(), part);
        }
    }

    /// The conditions of a part that can be wrong by themselves.
    fn direction(&mut self, part: &BoundaryPart, pointer: &str) -> bool {
        if part.normal == Some([0.0, 0.0]) {
            self.say(
                format!("{pointer}/normal"),
                "out_of_range",
                "[0, 0]",
                "a direction",
                "E.g. [0, 1] for sides that face up.",
            );
            return false;
        }
        if part.normal.is_none() && part.angle.is_some() {
            self.say(
                format!("{pointer}/angle"),
                "not_used",
                "an angle without a `normal`",
                "both or neither",
                "It says how far a side may turn away from `normal`.",
            );
            return false;
        }
        let angle = part.angle.unwrap_or(SAME_DIRECTION);
        if !(0.0..=180.0).contains(&angle) {
            self.say(
                format!("{pointer}/angle"),
                "out_of_range",
                angle,
                "0 … 180 degrees",
                "The largest angle between a side's normal and `normal`.",
            );
            return false;
        }
        true
    }

    /// The nodes of a named set.
    pub(super) fn node_set<'a>(
        &mut self,
        mesh: &'a Mesh,
        name: &str,
        pointer: String,
    ) -> Option<&'a [u32]> {
        let found = mesh.node_sets.get(name);
        if found.is_none() {
            let expected = match mesh.node_sets.is_empty() {
                true => "a set of nodes; this mesh has none".to_owned(),
                false => format!("one of {}", names(mesh.node_sets.keys())),
            };
            self.say(
                pointer,
                "unknown_node_set",
                name,
                expected,
                "Inline meshes have `node_sets`, Gmsh files physical points, decks *NSET.",
            );
        }
        found.map(|nodes| &nodes[..])
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
                format!("one of {}", names(mesh.boundaries.keys())),
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

/// Whether a side faces the way that its part asks for.
fn faces(part: &BoundaryPart, nodes: &[[f64; 2]; 3]) -> bool {
    let Some([x, y]) = part.normal else {
        return true;
    };
    let least = part.angle.unwrap_or(SAME_DIRECTION).to_radians().cos();
    crate::contact::edge_normals(nodes)
        .iter()
        .all(|[nx, ny]| (nx * x + ny * y) / x.hypot(y) >= least - ALIGNED)
}

/// The names that exist, or the first of them.
fn names<'a>(known: impl ExactSizeIterator<Item = &'a String>) -> String {
    const SHOWN: usize = 20;
    let count = known.len();
    let shown: Vec<String> = known
        .take(SHOWN)
        .map(|name| format!("`{name:.80}`"))
        .collect();
    match count.saturating_sub(SHOWN) {
        0 => shown.join(", "),
        more => format!("{} and {more} more", shown.join(", ")),
    }
}
