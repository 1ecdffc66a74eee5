//! The mesh with all its names, and values along named boundaries.

use std::collections::BTreeMap;

use super::checks::{ALIGNED, Checks, known, one_of};
use super::estimate::MOST_ADAPTIVE_ELEMENTS;
use crate::error::{AllChecks, Checked, Reason, Refused, escape};
use crate::mesh::{self, Edge, External, Mesh};
use crate::problem::{
    AdaptiveRefine, Analysis, BoundaryPart, BoundaryValue, Grid, MeshInput, MeshSource, Refine,
};
use crate::solution::WarningCode;

/// Sides face in the same direction if their normals differ by no more than this (degrees).
const SAME_DIRECTION: f64 = 1.0;

/// The largest number of refinements: more exceed any memory. The caller limits the size itself.
const MOST_REFINEMENTS: u32 = 20;

/// Stated errors are never below this fraction of a force, so that a smaller tolerance would never be met.
const LEAST_TOLERANCE: f64 = 1e-4;

impl Checks {
    /// Makes the mesh with all its names, which refer to the mesh before refinement, and refines it. A fault that
    /// concerns only a name is recorded in `all`.
    pub(super) fn mesh(
        &mut self,
        input: &MeshInput,
        external: Option<External>,
        analysis: &Analysis,
        contacts: usize,
        all: &mut AllChecks,
    ) -> Checked<Mesh> {
        let mesh = self.source(&input.source, external);
        let refine = match input.refine {
            Refine::Times(times) if times > MOST_REFINEMENTS => Err(self.report(
                "/mesh/refine",
                Reason::OutOfRange,
                times,
                format!("0 … {MOST_REFINEMENTS}"),
                "Each refinement makes four elements of one.",
            )),
            Refine::Times(times) => Ok(times),
            Refine::Adaptive(goal) => {
                let elements = mesh.as_ref().map_or(0, |mesh| mesh.elements.len());
                self.adaptive(&goal, elements, contacts).map(|()| 0)
            }
        };
        let mut mesh = mesh?;
        let (upright, radii) = (
            self.upright(&mesh, &input.source),
            self.radii(&mesh, input, analysis),
        );
        let refine = upright.and(radii).and(refine)?;
        let cuts = input.grids().into_iter().filter_map(mesh::largest_cut);
        if let Some((x, distance)) = cuts.max_by(|a, b| a.1.total_cmp(&b.1)) {
            let place = match input.grid() {
                Some(_) => "/mesh/grid",
                None => "/mesh/grids",
            };
            self.warn(
                WarningCode::StripCutsPolyline,
                place,
                format!("The strip deviates from its polyline by {distance:.3e} at x = {x}, between two grid lines. Put a grid line there."),
            );
        }
        if input.grids().is_empty() {
            self.unmerged = mesh::coincident_nodes(&mesh);
        }
        all.check(self.names(&mut mesh, input));
        mesh.order_boundaries();
        self.curves(&mut mesh, input, "")?;
        for _ in 0..refine {
            mesh = mesh::refine(&mesh);
            self.curves(&mut mesh, input, " of the refined mesh")?;
        }
        if input.grids().is_empty() && refine > 0 {
            let whole = |_| "/mesh".to_owned();
            let upright = mesh::check_inverted(&mesh, false, whole, " of the refined mesh");
            self.found.merge(upright)?;
        }
        Ok(mesh)
    }

    /// Adds further names for parts of boundaries and groups of elements.
    fn names(&mut self, mesh: &mut Mesh, input: &MeshInput) -> Checked {
        let mut all = AllChecks::default();
        all.check(self.parts(mesh, input));
        all.check(self.groups(mesh, input));
        all.finish(())
    }

    /// Checks that no radius is negative: in an axisymmetric body x is the radius.
    fn radii(&mut self, mesh: &Mesh, input: &MeshInput, analysis: &Analysis) -> Checked {
        let inside = |[r, _]: &[f64; 2]| *r < 0.0;
        let node = match analysis {
            Analysis::Axisymmetric {} => mesh.nodes.iter().position(inside),
            _ => None,
        };
        let Some(node) = node else { return Ok(()) };
        Err(self.report(
            match &input.source {
                MeshSource::Inline(_) => format!("/mesh/inline/nodes/{node}"),
                MeshSource::Grid(_) => "/mesh/grid/x".to_owned(),
                MeshSource::Grids(_) => "/mesh/grids".to_owned(),
                _ => "/mesh".to_owned(),
            },
            Reason::OutOfRange,
            format!("r = {}", mesh.nodes[node][0]),
            "r ≥ 0",
            "In an axisymmetric body x is the radius.",
        ))
    }

    /// Checks that adaptive refinement has a tolerance within its limits, a first mesh that is not too large, and a
    /// contact, whose errors it reduces.
    fn adaptive(&mut self, goal: &AdaptiveRefine, elements: usize, contacts: usize) -> Checked {
        let mut all = AllChecks::default();
        all.check(self.require(
            goal.tolerance > LEAST_TOLERANCE && goal.tolerance < 1.0,
            "/mesh/refine/tolerance",
            goal.tolerance,
            "1e-4 < tolerance < 1",
            "The largest relative error of a force, peak or extent; 0.01 is one percent. No error is known more accurately than 1e-4.",
        ));
        if elements > MOST_ADAPTIVE_ELEMENTS {
            all.fail(self.report(
                "/mesh/refine",
                Reason::TooLarge,
                format!("a first mesh of {elements} elements"),
                format!("at most {MOST_ADAPTIVE_ELEMENTS} elements"),
                "Adaptive refinement starts from a coarse mesh; give a coarser one, or a number of refinements.",
            ));
        }
        if contacts == 0 {
            all.fail(self.report(
                "/mesh/refine",
                Reason::NotUsed,
                "adaptive refinement without a contact",
                "a contact, or a number of refinements",
                "Adaptive refinement follows the forces, peak stresses and extents of contacts.",
            ));
        }
        all.finish(())
    }

    /// Adds names for groups of elements.
    fn groups(&mut self, mesh: &mut Mesh, input: &MeshInput) -> Checked {
        let mut all = AllChecks::default();
        let size = [0, 1]
            .map(|axis| mesh.extent(axis))
            .into_iter()
            .fold(0.0, f64::max);
        for (name, range) in &input.groups {
            let pointer = format!("/mesh/groups/{}", escape(name));
            if mesh.groups.contains_key(name) {
                all.fail(self.report(
                    &pointer,
                    Reason::NameTaken,
                    name,
                    "a name that the mesh does not have yet",
                    "An inline mesh names its own groups.",
                ));
                continue;
            }
            let holds = |e: &u32| {
                mesh.elements[*e as usize]
                    .iter()
                    .all(|n| within(&[range.x, range.y], &mesh.nodes[*n as usize], size))
            };
            let elements: Vec<u32> = (0..mesh.elements.len() as u32).filter(holds).collect();
            if elements.is_empty() {
                all.fail(self.report(
                    &pointer,
                    Reason::EmptyGroup,
                    "no element",
                    "at least one element whose nodes all lie in the range",
                    "Put grid lines on the edges of the group.",
                ));
            }
            let cut = (0..mesh.elements.len() as u32).find(|e| {
                let mut nodes = mesh.elements[*e as usize].iter();
                !holds(e)
                    && nodes
                        .any(|n| well_within(&[range.x, range.y], &mesh.nodes[*n as usize], size))
            });
            if let Some(e) = cut {
                let [x, y] = mesh.nodes[mesh.elements[e as usize][0] as usize];
                self.warn(
                    WarningCode::RangeCutsMesh,
                    &pointer,
                    format!("The range ends inside elements, such as the one with a corner at ({x}, {y}): only elements that lie in it as a whole, before the mesh is refined, belong to the group. Put grid lines on the ends of the range."),
                );
            }
            mesh.groups.insert(name.clone(), elements);
        }
        all.finish(())
    }

    /// The mesh of the problem before it is refined.
    fn source(&mut self, source: &MeshSource, external: Option<External>) -> Checked<Mesh> {
        match source {
            MeshSource::Grid(grid) => {
                self.found.merge(mesh::check_grid(grid, "/mesh/grid"))?;
                Ok(mesh::grid_mesh(grid))
            }
            MeshSource::Grids(grids) => self.grids(grids),
            MeshSource::Inline(inline) => {
                let mesh = mesh::inline_mesh(inline.clone(), "/mesh/inline");
                self.found.merge(mesh)
            }
            MeshSource::Gmsh(_) | MeshSource::Abaqus(_) | MeshSource::Stored(_) => match external {
                Some(found) => {
                    let found = self.found.merge(found)?;
                    self.warnings.extend(found.warnings);
                    Ok(found.mesh)
                }
                None => Err(self.absent(source)),
            },
        }
    }

    /// The mesh of several grids, each with its name before those of its boundaries.
    fn grids(&mut self, grids: &BTreeMap<String, Grid>) -> Checked<Mesh> {
        let mut all = AllChecks::default();
        if grids.is_empty() {
            all.fail(self.report(
                "/mesh/grids",
                Reason::TooFew,
                "no grid",
                "at least one grid",
                "Give each body its lines, for example {\"shaft\": {\"x\": …, \"y\": …}, \"hub\": …}.",
            ));
        }
        for (name, grid) in grids {
            let pointer = format!("/mesh/grids/{}", escape(name));
            if name.is_empty() {
                all.fail(self.report(
                    &pointer,
                    Reason::Malformed,
                    "an empty name",
                    "a name",
                    "It begins the names of the boundaries, and names the group of the elements.",
                ));
            }
            all.check(self.found.merge(mesh::check_grid(grid, &pointer)));
        }
        all.finish(())?;
        let mut whole = Mesh::default();
        for (name, grid) in grids {
            whole.join(name, mesh::grid_mesh(grid));
        }
        Ok(whole)
    }

    /// Checks that no element is inverted or numbered clockwise.
    fn upright(&mut self, mesh: &Mesh, source: &MeshSource) -> Checked {
        self.found.merge(match source {
            // a grid has straight sides: its corners need no check, and refinement does not fold it
            MeshSource::Grid(_) | MeshSource::Grids(_) => {
                mesh::check_inverted(mesh, false, |_| "/mesh".to_owned(), "")
            }
            MeshSource::Inline(_) => {
                let element = |e| format!("/mesh/inline/elements/{e}");
                mesh::check_inverted(mesh, true, element, "")
            }
            // the elements of a file are checked when it is read
            MeshSource::Gmsh(_) | MeshSource::Abaqus(_) | MeshSource::Stored(_) => Ok(()),
        })
    }

    /// Reports that the caller passed no mesh, although the problem only names its mesh or contains it as text.
    fn absent(&mut self, source: &MeshSource) -> Refused {
        match source {
            MeshSource::Stored(hash) => self.report(
                "/mesh/stored",
                Reason::UnknownMesh,
                hash,
                "the hash of a stored mesh that can be read here",
                "Store the mesh first; where no meshes are stored, give the mesh itself.",
            ),
            _ => self.report(
                "/mesh",
                Reason::UnknownMesh,
                "a mesh given as text that was not parsed",
                "the parsed mesh",
                "Pass the mesh that `files::external_mesh` reads.",
            ),
        }
    }

    /// Adds names for parts of boundaries.
    fn parts(&mut self, mesh: &mut Mesh, input: &MeshInput) -> Checked {
        let mut all = AllChecks::default();
        let original = mesh.boundaries.clone();
        let size = [0, 1]
            .map(|axis| mesh.extent(axis))
            .into_iter()
            .fold(0.0, f64::max);
        let mut surface = None;
        for (name, part) in &input.boundaries {
            let pointer = format!("/mesh/boundaries/{}", escape(name));
            if original.contains_key(name) {
                all.fail(self.report(
                    &pointer,
                    Reason::NameTaken,
                    name,
                    "a name that the mesh does not have yet",
                    format!("It has {}.", known(original.keys())),
                ));
                continue;
            }
            let edges = match &part.side {
                None => surface.get_or_insert_with(|| mesh.surface()),
                Some(side) => {
                    let Some(edges) = original.get(side) else {
                        all.fail(self.report(
                            format!("{pointer}/side"),
                            Reason::UnknownBoundary,
                            side,
                            one_of("a boundary", original.keys()),
                            "Check the spelling.",
                        ));
                        continue;
                    };
                    edges
                }
            };
            if all.check(self.direction(part, &pointer)).is_none() {
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
            let own: Vec<Edge> = edges.iter().filter(holds).copied().collect();
            if own.is_empty() {
                all.fail(self.report(
                    &pointer,
                    Reason::EmptyBoundary,
                    "no edge",
                    "at least one edge of the surface that meets all conditions at its three nodes",
                    "Put grid lines on the ends of the part; check the direction of the normal.",
                ));
            }
            let given = [part.x, part.y];
            let cut = edges.iter().find_map(|edge| {
                let nodes = mesh.edge_nodes(edge);
                if own.contains(edge) || !faces(part, &nodes) {
                    return None;
                }
                let meets = |corner: &u32| {
                    let place = &mesh.nodes[*corner as usize];
                    let inside = well_within(&given, place, size)
                        && ranges.is_none_or(|ranges| well_within(&ranges, place, size));
                    let mut beside = own.iter().filter(|other| other[..2].contains(corner));
                    inside && beside.any(|other| goes_on(&nodes, &mesh.edge_nodes(other)))
                };
                let corner = edge[..2].iter().find(|corner| meets(corner))?;
                Some(mesh.nodes[*corner as usize])
            });
            if let Some([x, y]) = cut {
                self.warn(
                    WarningCode::RangeCutsMesh,
                    &pointer,
                    format!("The range ends inside an edge, beyond the corner at ({x}, {y}): only edges that lie in it as a whole, before the mesh is refined, belong to the boundary, which ends there. Put a grid line on the end of the range."),
                );
            }
            mesh.boundaries.insert(name.clone(), own);
        }
        all.finish(())
    }

    /// Checks the normal and the angle of a part.
    fn direction(&mut self, part: &BoundaryPart, pointer: &str) -> Checked {
        if part.normal == Some([0.0, 0.0]) {
            return Err(self.report(
                format!("{pointer}/normal"),
                Reason::OutOfRange,
                "[0, 0]",
                "a direction",
                "For example [0, 1] for sides that face up.",
            ));
        }
        if part.normal.is_none() && part.angle.is_some() {
            return Err(self.report(
                format!("{pointer}/angle"),
                Reason::NotUsed,
                "an angle without a `normal`",
                "both `normal` and `angle`, or neither",
                "`angle` is the largest angle between a side's normal and `normal`.",
            ));
        }
        let angle = part.angle.unwrap_or(SAME_DIRECTION);
        if !(0.0..=180.0).contains(&angle) {
            return Err(self.report(
                format!("{pointer}/angle"),
                Reason::OutOfRange,
                angle,
                "0 … 180 degrees",
                "`angle` is the largest angle between a side's normal and `normal`.",
            ));
        }
        Ok(())
    }

    /// The nodes of a named set.
    pub(super) fn node_set<'a>(
        &mut self,
        mesh: &'a Mesh,
        name: &str,
        pointer: String,
    ) -> Checked<&'a [u32]> {
        if let Some(nodes) = mesh.node_sets.get(name) {
            return Ok(nodes);
        }
        let expected = one_of("a set of nodes", mesh.node_sets.keys());
        Err(self.report(
            pointer,
            Reason::UnknownNodeSet,
            name,
            expected,
            "Node sets are `node_sets` of inline meshes, physical points of Gmsh files and *NSET of decks.",
        ))
    }

    /// The edges of a named boundary.
    pub(super) fn boundary<'a>(
        &mut self,
        mesh: &'a Mesh,
        name: &str,
        pointer: String,
    ) -> Checked<&'a [Edge]> {
        if let Some(edges) = mesh.boundaries.get(name) {
            return Ok(edges);
        }
        Err(self.report(
            pointer,
            Reason::UnknownBoundary,
            name,
            one_of("a boundary", mesh.boundaries.keys()),
            "Check the spelling, or name a part under /mesh/boundaries.",
        ))
    }

    /// Checks that a boundary is one chain with a start and an end, so that values can be given from the start to the
    /// end.
    pub(super) fn chain(&mut self, edges: &[Edge], pointer: String, hint: &str) -> Checked {
        let runs = mesh::runs(edges);
        let got = match &runs[..] {
            [run] if !mesh::is_closed(run) => return Ok(()),
            [_] => "a closed loop".to_owned(),
            runs => format!("a boundary of {} pieces", runs.len()),
        };
        let expected = "one chain of edges with two ends";
        Err(self.report(pointer, Reason::NotAChain, got, expected, hint))
    }

    /// The values of a boundary value at the start, end and midside of each edge.
    pub(super) fn along(
        &mut self,
        mesh: &Mesh,
        edges: &[Edge],
        value: BoundaryValue,
        pointer: String,
    ) -> Checked<Vec<[f64; 3]>> {
        let [start, end] = match value {
            BoundaryValue::Constant(value) => return Ok(vec![[value; 3]; edges.len()]),
            BoundaryValue::Linear(ends) => ends,
        };
        let hint = "A value from start to end needs a connected boundary with two ends; name a part of it under /mesh/boundaries.";
        self.chain(edges, pointer, hint)?;
        let s = crate::contact::arc_lengths(mesh, edges);
        let length = s[s.len() - 1];
        let at = |node: usize| start + (end - start) * s[node] / length;
        let on_edge = |k: usize| crate::contact::edge_nodes(k).map(at);
        Ok((0..edges.len()).map(on_edge).collect())
    }
}

/// Whether a place lies in the ranges, and not at their ends; `size`: that of the body.
fn well_within(ranges: &[Option<[f64; 2]>; 2], place: &[f64; 2], size: f64) -> bool {
    const MARGIN: f64 = 1e-6;
    let mut pairs = ranges.iter().zip(place);
    pairs.all(|(range, x)| {
        range.is_none_or(|[least, most]| least + MARGIN * size < *x && *x < most - MARGIN * size)
    })
}

/// Whether two edges that share a corner have nearly the same direction, given by their nodes.
fn goes_on(one: &[[f64; 2]; 3], other: &[[f64; 2]; 3]) -> bool {
    /// The cosine of 20°.
    const STRAIGHT_ON: f64 = 0.94;
    let [a, b] = [one, other].map(|[[x0, y0], [x1, y1], _]| [x1 - x0, y1 - y0]);
    let cosine = (a[0] * b[0] + a[1] * b[1]) / (a[0].hypot(a[1]) * b[0].hypot(b[1]));
    cosine.abs() > STRAIGHT_ON
}

/// Whether a place lies in the ranges of x and y, ends included.
fn within(ranges: &[Option<[f64; 2]>; 2], place: &[f64; 2], size: f64) -> bool {
    ranges.iter().zip(place).all(|(range, c)| {
        range.is_none_or(|[low, high]| *c >= low - ALIGNED * size && *c <= high + ALIGNED * size)
    })
}

/// Whether the normal of a side, given by its nodes, has the direction that the boundary part requires.
fn faces(part: &BoundaryPart, nodes: &[[f64; 2]; 3]) -> bool {
    let Some([x, y]) = part.normal else {
        return true;
    };
    let angle = part.angle.unwrap_or(SAME_DIRECTION).to_radians();
    let least = (angle + crate::contact::smooth::direction_error(nodes))
        .min(std::f64::consts::PI)
        .cos();
    crate::contact::edge_normals(nodes)
        .iter()
        .all(|[nx, ny]| (nx * x + ny * y) / x.hypot(y) >= least - ALIGNED)
}
