//! The only door from a [`Problem`] to something that can be solved.
//!
//! `Model::new` checks everything and reports all violations at once; what it lets through is
//! numbered and can be trusted by every room above.

pub mod estimate;

use std::collections::BTreeMap;

use crate::contact::ContactBoundary;
use crate::contact::obstacle::{self, FacingRun};
use crate::elasticity::Section;
use crate::error::{Violation, escape};
use crate::mesh::{self, Edge, Mesh};
use crate::problem::{
    Analysis, BoundaryValue, Contact, Friction, Load, Material, MeshInput, Obstacle, Problem,
    SolverControls, Support,
};
use crate::solution::Warning;

/// More refinements than this overflow any machine; the size itself is bounded by the caller.
const MOST_REFINEMENTS: u32 = 20;

/// Directions count as equal to an axis, and prescribed values as equal, to this.
const ALIGNED: f64 = 1e-9;

/// A problem that can be solved.
#[derive(Clone, Debug)]
pub struct Model {
    /// The refined mesh.
    pub mesh: Mesh,
    /// Material and depth.
    pub section: Section,
    /// Prescribed displacements along x and y by node.
    pub fixed: BTreeMap<u32, [Option<f64>; 2]>,
    /// Edges under pressure, with the pressure at start, end and midside.
    pub pressures: Vec<(Edge, [f64; 3])>,
    /// Contact boundaries with their obstacles.
    pub contacts: Vec<ContactModel>,
    /// Tolerance and limits.
    pub controls: SolverControls,
    /// What the user should know already.
    pub warnings: Vec<Warning>,
}

/// A contact boundary and what it faces.
#[derive(Clone, Debug)]
pub struct ContactModel {
    /// Name of the boundary.
    pub name: String,
    /// JSON Pointer to the contact.
    pub pointer: String,
    /// Γ_C.
    pub boundary: ContactBoundary,
    /// Gap at each node: profile − indentation.
    pub gap: Vec<f64>,
    /// d, the obstacle's own tangential displacement.
    pub tangential_displacement: f64,
    /// Absent: frictionless.
    pub friction: Option<Friction>,
}

impl Model {
    /// Checks and numbers a problem.
    pub fn new(problem: &Problem) -> Result<Model, Vec<Violation>> {
        let mut checks = Checks::default();
        checks.finite(problem);
        // numbers that are not finite would make nonsense of every later check
        if !checks.violations.is_empty() {
            return Err(checks.violations);
        }
        checks.analysis(&problem.analysis);
        let material = checks.materials(&problem.materials);
        checks.controls(&problem.solver);
        for (i, contact) in problem.contacts.iter().enumerate() {
            checks.contact_numbers(contact, &format!("/contacts/{i}"));
        }
        let Some(mesh) = checks.mesh(&problem.mesh, &problem.analysis) else {
            return Err(checks.violations);
        };
        let (e, nu) = material.map_or((1.0, 0.0), |m| (m.youngs_modulus, m.poissons_ratio));
        let section = Section::new(problem.analysis, e, nu);
        let fixed = checks.supports(&mesh, &problem.supports);
        let pressures = checks.loads(&mesh, &problem.loads);
        let contacts = checks.contacts(&mesh, &section, &problem.contacts, &fixed);
        checks.freedom(&mesh, &section, &fixed);
        if !checks.violations.is_empty() {
            return Err(checks.violations);
        }
        checks.coarseness(&contacts);
        let (controls, warnings) = (problem.solver, checks.warnings);
        Ok(Model {
            mesh,
            section,
            fixed,
            pressures,
            contacts,
            controls,
            warnings,
        })
    }
}

#[derive(Default)]
struct Checks {
    violations: Vec<Violation>,
    warnings: Vec<Warning>,
}

impl Checks {
    fn say(
        &mut self,
        pointer: impl Into<String>,
        reason: &str,
        got: impl ToString,
        expected: impl Into<String>,
        hint: impl Into<String>,
    ) {
        self.violations.push(Violation {
            pointer: pointer.into(),
            reason: reason.to_owned(),
            got: got.to_string(),
            expected: expected.into(),
            hint: hint.into(),
        });
    }

    fn warn(&mut self, code: &str, pointer: &str, message: String) {
        self.warnings.push(Warning {
            code: code.to_owned(),
            pointer: pointer.to_owned(),
            message,
        });
    }

    fn require(&mut self, holds: bool, pointer: String, got: f64, expected: &str, hint: &str) {
        if !holds {
            self.say(pointer, "out_of_range", got, expected, hint);
        }
    }

    /// JSON has no other numbers, but protobuf has.
    fn finite(&mut self, problem: &Problem) {
        // serde_json writes a number that is not finite as null, and we never write null otherwise
        fn walk(value: &serde_json::Value, pointer: &mut String, found: &mut Vec<String>) {
            let length = pointer.len();
            match value {
                serde_json::Value::Null => found.push(pointer.clone()),
                serde_json::Value::Array(items) => {
                    for (i, item) in items.iter().enumerate() {
                        pointer.push_str(&format!("/{i}"));
                        walk(item, pointer, found);
                        pointer.truncate(length);
                    }
                }
                serde_json::Value::Object(fields) => {
                    for (name, item) in fields {
                        pointer.push('/');
                        pointer.push_str(&escape(name));
                        walk(item, pointer, found);
                        pointer.truncate(length);
                    }
                }
                _ => {}
            }
        }
        let mut found = Vec::new();
        if let Ok(value) = serde_json::to_value(problem) {
            walk(&value, &mut String::new(), &mut found);
        }
        for pointer in found {
            self.say(
                pointer,
                "not_finite",
                "NaN or infinity",
                "a finite number",
                "Check the computation that produced it.",
            );
        }
    }

    fn analysis(&mut self, analysis: &Analysis) {
        if let Analysis::PlaneStress { thickness } = *analysis {
            self.require(
                thickness > 0.0,
                "/analysis/thickness".into(),
                thickness,
                "a length > 0",
                "Forces are proportional to it.",
            );
        }
    }

    fn materials<'a>(&mut self, materials: &'a [Material]) -> Option<&'a Material> {
        if materials.len() != 1 {
            self.say(
                "/materials",
                "wrong_count",
                format!("{} materials", materials.len()),
                "exactly one material",
                "The whole body has one material.",
            );
        }
        for (i, m) in materials.iter().enumerate() {
            let at = |field: &str| format!("/materials/{i}/{field}");
            self.require(
                m.youngs_modulus > 0.0,
                at("youngs_modulus"),
                m.youngs_modulus,
                "a stress > 0",
                "Young's modulus E.",
            );
            self.require(
                m.poissons_ratio > -1.0 && m.poissons_ratio < 0.5,
                at("poissons_ratio"),
                m.poissons_ratio,
                "−1 < Poisson's ratio < 0.5",
                "For a nearly incompressible body use a value such as 0.49.",
            );
        }
        materials.first()
    }

    fn controls(&mut self, controls: &SolverControls) {
        self.require(
            controls.tolerance >= 1e-14 && controls.tolerance < 1.0,
            "/solver/tolerance".into(),
            controls.tolerance,
            "a number from 1e-14 to below 1",
            "It bounds dimensionless residuals; 1e-10 is the default.",
        );
        self.require(
            (1..=100_000).contains(&controls.max_iterations),
            "/solver/max_iterations".into(),
            f64::from(controls.max_iterations),
            "1 … 100000 sweeps",
            "6 to 25 are usual.",
        );
    }

    fn contact_numbers(&mut self, contact: &Contact, pointer: &str) {
        if let Obstacle::Circle { radius, .. } | Obstacle::Parabola { radius, .. } =
            contact.obstacle
        {
            self.require(
                radius > 0.0,
                format!("{pointer}/obstacle/radius"),
                radius,
                "a length > 0",
                "The obstacle is convex towards the body.",
            );
        }
        if let (Some(from), Some(to), _) = obstacle::span(&contact.obstacle)
            && from >= to
        {
            self.say(
                format!("{pointer}/obstacle/to"),
                "out_of_range",
                to,
                format!("more than `from`, {from}"),
                "`from` and `to` are the ends of the obstacle.",
            );
        }
        let Some(friction) = &contact.friction else {
            return;
        };
        let at = |field: &str| format!("{pointer}/friction/{field}");
        self.require(
            friction.coefficient >= 0.0,
            at("coefficient"),
            friction.coefficient,
            "a number ≥ 0",
            "Leave `friction` out for frictionless contact.",
        );
        self.require(
            friction.nonlocal_radius >= 0.0,
            at("nonlocal_radius"),
            friction.nonlocal_radius,
            "a length ≥ 0",
            "0 is Coulomb's local law.",
        );
        self.require(
            friction.elastic_slip > 0.0,
            at("elastic_slip"),
            friction.elastic_slip,
            "a length > 0",
            "About 1e-4 of the contact's width; below 1e-5 nothing physical changes.",
        );
    }

    /// The refined mesh with all its names, or `None` after saying why not.
    fn mesh(&mut self, input: &MeshInput, analysis: &Analysis) -> Option<Mesh> {
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
        if input.refine > MOST_REFINEMENTS {
            self.say(
                "/mesh/refine",
                "out_of_range",
                input.refine,
                format!("0 … {MOST_REFINEMENTS}"),
                "Each refinement makes four elements of one.",
            );
            mesh = None;
        }
        let mut mesh = mesh?;
        for (e, g, det) in mesh.inverted_elements().into_iter().take(20) {
            self.say(
                if input.inline.is_some() {
                    format!("/mesh/inline/elements/{e}")
                } else {
                    "/mesh/grid".to_owned()
                },
                "inverted_element",
                format!("element {e} with det J = {det:.3e} at Gauss point {g}"),
                "det J > 0 at all nine Gauss points",
                "List corners counter-clockwise, and keep midsides near the middle of their sides.",
            );
        }
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
        for _ in 0..input.refine {
            mesh = mesh::refine(&mesh);
        }
        self.parts(&mut mesh, input);
        Some(mesh)
    }

    /// Names for parts of boundaries.
    fn parts(&mut self, mesh: &mut Mesh, input: &MeshInput) {
        let original = mesh.boundaries.clone();
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
            let size = mesh
                .nodes
                .iter()
                .flatten()
                .fold(0.0f64, |a, b| a.max(b.abs()));
            let within = |edge: &&Edge| {
                mesh.edge_nodes(edge).iter().all(|position| {
                    [part.x, part.y].iter().zip(position).all(|(range, c)| {
                        range.is_none_or(|[low, high]| {
                            *c >= low - ALIGNED * size && *c <= high + ALIGNED * size
                        })
                    })
                })
            };
            let part: Vec<Edge> = edges.iter().filter(within).copied().collect();
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
    fn boundary<'a>(&mut self, mesh: &'a Mesh, name: &str, pointer: String) -> Option<&'a [Edge]> {
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
    fn along(
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

    fn supports(&mut self, mesh: &Mesh, supports: &[Support]) -> BTreeMap<u32, [Option<f64>; 2]> {
        let mut fixed: BTreeMap<u32, [Option<f64>; 2]> = BTreeMap::new();
        for (i, support) in supports.iter().enumerate() {
            let pointer = format!("/supports/{i}");
            if support.ux.is_none() && support.uy.is_none() {
                self.say(
                    &pointer,
                    "empty",
                    "neither `ux` nor `uy`",
                    "at least one of them",
                    "Prescribe a displacement or remove the support.",
                );
            }
            let Some(edges) = self.boundary(mesh, &support.boundary, format!("{pointer}/boundary"))
            else {
                continue;
            };
            for (axis, (field, value)) in [("ux", support.ux), ("uy", support.uy)]
                .into_iter()
                .enumerate()
            {
                let Some(value) = value else { continue };
                let place = format!("{pointer}/{field}");
                let mut conflict = None;
                for (edge, values) in self.along(mesh, edges, value, place.clone()) {
                    for (node, value) in edge.into_iter().zip(values) {
                        let known = fixed.entry(node).or_default()[axis].get_or_insert(value);
                        if (*known - value).abs() > ALIGNED * known.abs().max(value.abs()) {
                            conflict = Some((node, *known, value));
                        }
                    }
                }
                if let Some((node, known, value)) = conflict {
                    let [x, y] = mesh.nodes[node as usize];
                    self.say(
                        place,
                        "conflict",
                        value,
                        format!(
                            "{known}, which another support prescribes at node {node} ({x}, {y})"
                        ),
                        "Two supports that share a node must agree there.",
                    );
                }
            }
        }
        fixed
    }

    fn loads(&mut self, mesh: &Mesh, loads: &[Load]) -> Vec<(Edge, [f64; 3])> {
        let mut pressures = Vec::new();
        for (i, load) in loads.iter().enumerate() {
            if let Some(edges) = self.boundary(mesh, &load.boundary, format!("/loads/{i}/boundary"))
            {
                pressures.extend(self.along(
                    mesh,
                    edges,
                    load.pressure,
                    format!("/loads/{i}/pressure"),
                ));
            }
        }
        pressures
    }

    fn contacts(
        &mut self,
        mesh: &Mesh,
        section: &Section,
        contacts: &[Contact],
        fixed: &BTreeMap<u32, [Option<f64>; 2]>,
    ) -> Vec<ContactModel> {
        let mut models: Vec<ContactModel> = Vec::new();
        for (i, contact) in contacts.iter().enumerate() {
            let pointer = format!("/contacts/{i}");
            if contacts[..i]
                .iter()
                .any(|other| other.boundary == contact.boundary)
            {
                self.say(
                    format!("{pointer}/boundary"),
                    "name_taken",
                    &contact.boundary,
                    "a boundary of its own for each contact",
                    "Name parts of it under /mesh/boundaries.",
                );
                continue;
            }
            let Some(edges) = self.boundary(mesh, &contact.boundary, format!("{pointer}/boundary"))
            else {
                continue;
            };
            let Some(run) = self.facing_run(mesh, edges, contact, &pointer) else {
                continue;
            };
            let boundary = ContactBoundary::new(mesh, &run.chain, |x| section.depth(x));
            if let Some((other, node)) = models.iter().find_map(|m| {
                m.boundary
                    .nodes
                    .iter()
                    .find(|n| boundary.nodes.contains(n))
                    .map(|n| (m.name.clone(), *n))
            }) {
                self.say(
                    format!("{pointer}/boundary"),
                    "shared_node",
                    format!("node {node}, also in contact `{other}`"),
                    "contacts without common nodes",
                    "End one of them an edge earlier with `from` or `to`.",
                );
            }
            let gap: Vec<f64> = run
                .profile
                .iter()
                .map(|profile| profile - contact.indentation)
                .collect();
            self.supported_contact_nodes(&boundary, &gap, fixed, &pointer);
            models.push(ContactModel {
                name: contact.boundary.clone(),
                pointer,
                boundary,
                gap,
                tangential_displacement: contact.tangential_displacement,
                friction: contact.friction,
            });
        }
        models
    }

    /// The part of the boundary that faces the obstacle: one chain.
    fn facing_run(
        &mut self,
        mesh: &Mesh,
        edges: &[Edge],
        contact: &Contact,
        pointer: &str,
    ) -> Option<FacingRun> {
        let runs = mesh::runs(edges);
        let [run] = &runs[..] else {
            self.say(
                format!("{pointer}/boundary"),
                "not_a_chain",
                format!("{} pieces", runs.len()),
                "one chain of edges",
                "Name each piece under /mesh/boundaries and give it a contact of its own.",
            );
            return None;
        };
        if run[0][0] == run[run.len() - 1][1] {
            self.say(
                format!("{pointer}/boundary"),
                "not_a_chain",
                "a closed loop",
                "a chain of edges with two ends",
                "Name a part of it.",
            );
            return None;
        }
        let mut facing = obstacle::facing(mesh, run, &contact.obstacle);
        for [low, high] in &facing.cut {
            self.warn(
                "obstacle_cuts_edge",
                &format!("{pointer}/obstacle"),
                format!("The obstacle ends inside the edge from {low} to {high}, which is left out of the contact. Put a grid line on the obstacle's end."),
            );
        }
        if facing.runs.len() == 1 {
            return facing.runs.pop();
        }
        let s = crate::contact::arc_lengths(mesh, run);
        let ([x0, y0], [x1, y1]) = (
            mesh.nodes[run[0][0] as usize],
            mesh.nodes[run[run.len() - 1][1] as usize],
        );
        let place = format!("{pointer}/obstacle");
        let extent = format!(
            "The boundary goes from ({x0}, {y0}) to ({x1}, {y1}) and is {} long.",
            s[s.len() - 1]
        );
        if facing.runs.is_empty() {
            self.say(
                place,
                "covers_nothing",
                "an obstacle that covers no edge of the boundary",
                "one that covers all three nodes of an edge at least",
                extent,
            );
        } else {
            self.say(
                place,
                "not_a_chain",
                format!(
                    "an obstacle that covers {} separate pieces",
                    facing.runs.len()
                ),
                "one piece",
                extent,
            );
        }
        None
    }

    /// A supported contact node keeps its two unknowns apart only where a support acts along the
    /// normal or along the tangent.
    fn supported_contact_nodes(
        &mut self,
        boundary: &ContactBoundary,
        gap: &[f64],
        fixed: &BTreeMap<u32, [Option<f64>; 2]>,
        pointer: &str,
    ) {
        for (i, node) in boundary.nodes.iter().enumerate() {
            let Some(values) = fixed.get(node) else {
                continue;
            };
            let ([nx, ny], [x, y]) = (boundary.normals[i], boundary.positions[i]);
            if values.iter().any(Option::is_none) && nx.abs().min(ny.abs()) > ALIGNED {
                self.say(
                    format!("{pointer}/boundary"), "oblique_support", format!("node {node} at ({x}, {y}), normal ({nx:.4}, {ny:.4}), supported along one axis"),
                    "a support along the contact's normal or tangent, or along both axes", "End the contact an edge before the support with `from` or `to`.",
                );
            }
            let normal_displacement = match *values {
                [Some(ux), Some(uy)] => Some(nx * ux + ny * uy),
                [Some(ux), None] if ny.abs() <= ALIGNED => Some(nx * ux),
                [None, Some(uy)] if nx.abs() <= ALIGNED => Some(ny * uy),
                _ => None,
            };
            if let Some(u_n) = normal_displacement
                && u_n > gap[i] + ALIGNED * gap[i].abs()
            {
                self.say(
                    format!("{pointer}/indentation"), "impossible", format!("node {node} at ({x}, {y}) held at u_n = {u_n} by a support, {} inside the obstacle", u_n - gap[i]),
                    "supports that leave the body outside the obstacle", "End the obstacle before the support with `from` or `to`.",
                );
                return;
            }
        }
    }

    /// Every part of the body must be held against its rigid motions by supports.
    fn freedom(&mut self, mesh: &Mesh, section: &Section, fixed: &BTreeMap<u32, [Option<f64>; 2]>) {
        for part in mesh.connected_parts() {
            if let Some((direction, node)) = free_motion(mesh, section, fixed, &part) {
                let [x, y] = mesh.nodes[node as usize];
                self.say(
                    "/supports",
                    "free_body",
                    format!("a body free to move: {direction}, e.g. node {node} at ({x}, {y})"),
                    "supports against every rigid motion (contact does not count: it may open)",
                    "Add a support with `ux` or `uy`.",
                );
            }
        }
    }

    /// Too few elements for the contact or for ρ is a warning, not an error.
    fn coarseness(&mut self, contacts: &[ContactModel]) {
        for contact in contacts {
            let Some(friction) = contact
                .friction
                .filter(|f| f.nonlocal_radius > 0.0 && f.coefficient > 0.0)
            else {
                continue;
            };
            let boundary = &contact.boundary;
            let shortest = (0..boundary.edge_count())
                .map(|k| {
                    let [a, b, _] = boundary.edge_arc(k);
                    b - a
                })
                .fold(f64::INFINITY, f64::min);
            if shortest > friction.nonlocal_radius {
                self.warn(
                    "mesh_too_coarse_for_radius",
                    &format!("{}/friction/nonlocal_radius", contact.pointer),
                    format!("The shortest contact edge ({shortest:.4}) is longer than the nonlocal radius ({}): the averaging is not resolved. Refine the mesh towards the ends of the contact.", friction.nonlocal_radius),
                );
            }
        }
    }
}

/// A rigid motion of the nodes `part` that no support hinders, and the node that it moves most.
fn free_motion(
    mesh: &Mesh,
    section: &Section,
    fixed: &BTreeMap<u32, [Option<f64>; 2]>,
    part: &[u32],
) -> Option<(&'static str, u32)> {
    // Rotation is taken about the part's centre and scaled by its size, so that all motions compare.
    let mean =
        |a: usize| part.iter().map(|&n| mesh.nodes[n as usize][a]).sum::<f64>() / part.len() as f64;
    let centre = [mean(0), mean(1)];
    let arm = |n: u32| {
        let [x, y] = mesh.nodes[n as usize];
        [x - centre[0], y - centre[1]]
    };
    let size = part
        .iter()
        .map(|&n| {
            let [x, y] = arm(n);
            x.hypot(y)
        })
        .fold(0.0, f64::max);
    let motions: Vec<(&'static str, Box<dyn Fn(u32) -> [f64; 2]>)> = if section.axisymmetric() {
        vec![("along the axis", Box::new(|_| [0.0, 1.0]))]
    } else {
        vec![
            ("along x", Box::new(|_| [1.0, 0.0])),
            ("along y", Box::new(|_| [0.0, 1.0])),
            (
                "in rotation",
                Box::new(|n| {
                    let [x, y] = arm(n);
                    [-y / size, x / size]
                }),
            ),
        ]
    };
    // Gram–Schmidt on the motions as seen by the supports: what has nothing left is free.
    let mut seen: Vec<(Vec<f64>, &'static str)> = Vec::new();
    for (name, motion) in &motions {
        let mut values: Vec<f64> = Vec::new();
        for &node in part {
            let Some(fixed) = fixed.get(&node) else {
                continue;
            };
            let u = motion(node);
            values.extend((0..2).filter(|&a| fixed[a].is_some()).map(|a| u[a]));
        }
        for (other, _) in &seen {
            let dot: f64 = values.iter().zip(other).map(|(a, b)| a * b).sum();
            values
                .iter_mut()
                .zip(other)
                .for_each(|(a, b)| *a -= dot * b);
        }
        let norm = values.iter().map(|v| v * v).sum::<f64>().sqrt();
        if norm < ALIGNED {
            let moved = |n: &u32| {
                let [x, y] = motion(*n);
                x.hypot(y)
            };
            let node = part
                .iter()
                .copied()
                .max_by(|a, b| moved(a).total_cmp(&moved(b)))?;
            return Some((name, node));
        }
        values.iter_mut().for_each(|v| *v /= norm);
        seen.push((values, name));
    }
    None
}

fn names(boundaries: &BTreeMap<String, Vec<Edge>>) -> String {
    boundaries
        .keys()
        .map(|name| format!("`{name}`"))
        .collect::<Vec<_>>()
        .join(", ")
}
