//! Reads a deck as a whole problem. A part of the deck that is not supported is a violation that names its line.

use std::collections::{BTreeMap, BTreeSet};
use std::mem::take;

use super::build::{Built, Row, key, sides_of_two};
use super::contact;
use super::element::{Theory, Typed};
use super::read::read;
use super::rigid::Body;
use super::steps::Motion;
use super::supports::supports;
use super::written::{
    DECIMAL_POINT, Distributed, Elastic, MOST_CONSTANTS, Name, On, Orientation, Section, numbered,
    on_line,
};
use crate::source::ReadError;
use solver::element::Element;
use solver::error::{Findings, Reason, Violation};
use solver::mesh::{Mesh, RawMesh};
use solver::problem::{
    Analysis, BoundaryValue, Elasticity, Load, Material, MeshInput, MeshSource, Orthotropic,
    Problem, SolverControls, Support,
};
use solver::solution::Warning;

/// Whether a deck has a step. A deck without a step is only a mesh.
pub fn has_step(text: &str) -> bool {
    let keyword = |line: &str| {
        let name = line.trim_start().split(',').next().unwrap_or_default();
        name.trim_end().eq_ignore_ascii_case("*STEP")
    };
    text.split(['\n', '\r']).any(keyword)
}

/// Reads the problem that a deck states: one linear static step, or several that move rigid bodies against the body.
/// The text itself becomes the problem's mesh.
///
/// # Errors
///
/// All violations of the deck, each with its line: a part that would change the solution and is not understood is
/// refused, never left out.
pub fn problem(text: &str) -> Result<Problem, Vec<Violation>> {
    problem_with_warnings(text).map(|(problem, _)| problem)
}

/// Reads the problem that a deck states like [`problem`], with a warning for each deviation from the deck.
///
/// # Errors
///
/// The errors of [`problem`].
pub fn problem_with_warnings(text: &str) -> Result<(Problem, Vec<Warning>), Vec<Violation>> {
    let deck = read(text.as_bytes()).map_err(ReadError::into_violations)?;
    let mut built = deck.build();
    if built.deck.steps == 0 {
        return Err(without_step(built.faults));
    }
    if let Some(violation) = built.too_long() {
        built.faults.add(violation);
        return Err(built.faults.into_violations());
    }
    let elastic = built.elastic();
    let mesh = if built.has_contacts() {
        Some(solver::mesh::build(take(&mut built.raw))?.0)
    } else {
        None
    };
    let (mut problem, warnings) = built.problem(elastic, mesh.as_ref())?;
    problem.mesh.source = MeshSource::Abaqus(text.to_owned());
    Ok((problem, warnings))
}

/// The problem of a deck without its contacts.
pub(super) struct ElasticPart {
    analysis: Analysis,
    quadrature: u32,
    motions: Vec<Option<Motion>>,
    /// The factors of loads and of supports at the end of each step.
    factors: Vec<[f64; 2]>,
    thickness: f64,
    materials: Vec<Material>,
    supports: Vec<Support>,
    loads: Vec<Load>,
}

impl Built {
    /// Whether the deck states a problem, of no more steps than one may have.
    pub(super) fn is_problem(&self) -> bool {
        self.deck.steps > 0 && self.too_long().is_none()
    }

    /// Whether contacts are made of the deck: they need its mesh.
    fn has_contacts(&self) -> bool {
        !self.pairs.is_empty() && self.faults.is_empty()
    }

    /// What the deck states without its contacts. Doubts are added to those of the deck.
    pub(super) fn elastic(&mut self) -> ElasticPart {
        let built = self;
        let analysis = analysis(built);
        let quadrature = quadrature(built);
        let motions = built.take_motions(matches!(analysis, Analysis::Axisymmetric {}));
        built.check_loads_of_tools();
        let of_temperatures = built.load_of_temperatures();
        let warms = of_temperatures.is_some();
        let factors = built.factors_of_steps(warms);
        built.keep_last_loads();
        let thickness = match analysis {
            Analysis::PlaneStrain {} => built.sections.first().and_then(|s| s.row.thickness),
            _ => None,
        };
        let thickness = thickness.unwrap_or(1.0);
        let materials = materials(built, warms);
        let supports = supports(built);
        for (line, name) in supports.of_no_element {
            let (what, ..) = built.not_meshed(&name);
            built.doubt(
                line,
                format!("a displacement of `{name:.60}`, {what}"),
                "nodes of plane elements, or the reference node of a *RIGID BODY",
                "Name nodes of the mesh. A rigid tool is moved by its reference node (REF NODE of *RIGID BODY), or by the `indentation` of a contact in a problem as JSON.",
            );
        }
        let mut held = supports.list;
        let springs = built.spring_supports(thickness).into_iter();
        held.extend(springs.map(|(support, _)| support));
        let mut loads = loads(built, &analysis, thickness);
        loads.extend(of_temperatures);
        ElasticPart {
            analysis,
            quadrature,
            motions,
            factors,
            thickness,
            materials,
            supports: held,
            loads,
        }
    }

    /// The problem of the deck, without its mesh, and a warning for each deviation from the deck. `mesh` may be missing
    /// where no contacts are made.
    pub(super) fn problem(
        mut self,
        elastic: ElasticPart,
        mesh: Option<&Mesh>,
    ) -> Result<(Problem, Vec<Warning>), Vec<Violation>> {
        let found = mesh.filter(|_| self.has_contacts()).map(|mesh| {
            let source = contact::Source {
                said: &self.deck.contact,
                pairs: &self.pairs,
                clearances: &self.clearances,
                tools: &self.tools,
                mesh,
                materials: &elastic.materials,
                thickness: elastic.thickness,
                motions: &elastic.motions,
            };
            source.contacts(&elastic.factors)
        });
        // those of the lines, of the analysis and of contacts, each as many as a list may have
        let mut violations = Findings::default();
        violations.extend(self.faults.into_violations());
        violations.extend(self.doubts.into_violations());
        let (mut contacts, mut steps, mut warnings) = (Vec::new(), Vec::new(), Vec::new());
        if let Some(found) = found {
            (contacts, steps, warnings) = (found.contacts, found.steps, found.remarks.warnings);
            violations.extend(found.remarks.violations);
        }
        let thickness = elastic.thickness;
        if thickness != 1.0 {
            warnings.push(contact::differs(format!(
                "In plane strain, forces of the result are per unit of thickness: the forces of the deck, for a thickness of {thickness}, are {thickness} times as large."
            )));
        }
        if !self.springs.is_empty() && matches!(elastic.analysis, Analysis::Axisymmetric {}) {
            warnings.push(contact::differs(
                "The stiffness of *SPRING is that of the whole ring, as in Abaqus. CalculiX takes it for that of a sector of two degrees: for the same result give 180 times as much here."
                    .to_owned(),
            ));
        }
        let problem = Problem {
            title: self.deck.title.take(),
            analysis: elastic.analysis,
            mesh: MeshInput::new(MeshSource::Abaqus(String::new())),
            materials: elastic.materials,
            supports: elastic.supports,
            loads: elastic.loads,
            contacts,
            steps,
            quadrature: elastic.quadrature,
            units: Default::default(),
            solver: SolverControls::default(),
        };
        violations.into_result((problem, warnings))
    }
}

/// The violations of a deck without a step, which is only a mesh: that it has none, and those of the mesh. Parts that a
/// problem cannot have are not reported.
fn without_step(mut faults: Findings) -> Vec<Violation> {
    faults.add(Violation::new(
        "",
        Reason::NotUnderstood,
        "a deck without *STEP",
        "one *STEP",
        "A deck without a step is a mesh: upload it, or include it in a problem as JSON, \"mesh\": {\"abaqus\": \"…\"}.",
    ));
    faults.into_violations()
}

impl Built {
    /// Reports forces on rigid bodies that no contact passes on, or that several contacts would, each as a whole; and rows of rotations
    /// and moments at other nodes than theirs.
    fn check_loads_of_tools(&mut self) {
        let mut pairs = vec![0; self.tools.bodies.len()];
        for name in self.pairs.iter().flatten() {
            if let Some((body, _)) = self.tools.by_surface.get(name) {
                pairs[*body] += 1;
            }
        }
        let mut told: BTreeSet<usize> = BTreeSet::new();
        let mut doubts: Vec<(u64, String)> = Vec::new();
        for Row { row, name } in self.forces.iter().filter(|row| row.row.value != 0.0) {
            for (number, rotates) in self.tools.loaded.get(name).map_or(&[][..], |on| &on.0) {
                let line = self.tools.bodies[*number].line;
                if *rotates && row.component < 3 {
                    if told.insert(*number) {
                        let got = format!(
                            "a force on `{name:.60}`, the node of the rotations of the *RIGID BODY on line {line}"
                        );
                        doubts.push((row.line, got));
                    }
                } else if pairs[*number] != 1 && told.insert(*number) {
                    let got = format!(
                        "a force on `{name:.60}`, the reference node of the *RIGID BODY on line {line}, which is in {} contact pairs",
                        pairs[*number]
                    );
                    doubts.push((row.line, got));
                }
            }
        }
        for (line, got) in doubts {
            self.doubt(
                line,
                got,
                "a force on the reference node of a rigid body in one contact pair",
                "Write all lines that the body may touch as one surface, and pair it with one surface of the body.",
            );
        }
        let rows = std::mem::take(&mut self.deck.contact.turning);
        let lines: BTreeMap<u64, u64> = rows.iter().map(|row| (row.line, row.component)).collect();
        let turns = |line: u64, on: &[(usize, bool)], alone: bool| {
            let component = *lines.get(&line)?;
            let all = on.iter().all(|(_, rotates)| *rotates == (component == 3));
            (alone && all).then_some(line)
        };
        let held = self.tools.rows.iter();
        let held = held.filter_map(|row| turns(row.row.line, &row.on, row.alone));
        let forces = self.forces.iter().filter_map(|row| {
            let (on, alone) = self.tools.loaded.get(&row.name)?;
            turns(row.row.line, on, *alone)
        });
        let meant: BTreeSet<u64> = held.chain(forces).collect();
        for row in rows.into_iter().filter(|row| !meant.contains(&row.line)) {
            let (got, expected, hint) = row.doubt;
            self.doubt(row.line, got, expected, hint);
        }
    }

    pub(super) fn doubt(&mut self, line: u64, got: impl Into<String>, expected: &str, hint: &str) {
        let reason = Reason::NotUnderstood;
        self.doubts
            .add(on_line(line, reason, got.into(), expected, hint));
    }

    /// Why a set of nodes cannot be loaded or displaced: what the set is, what is expected, and advice.
    fn not_meshed(&self, set: &str) -> (String, &'static str, &'static str) {
        const MESHED: &str = "nodes of plane elements";
        let nodes = self.raw.node_sets.get(set).map_or(&[][..], |nodes| nodes);
        let Some(first) = nodes.first() else {
            let hint = "Name nodes in the set: the keyword that defines it has no data lines, or only sets without nodes.";
            return ("a set without nodes".to_owned(), MESHED, hint);
        };
        let of = |body: &&Body| {
            nodes
                .iter()
                .any(|node| [body.reference, body.rotation].contains(&Some(*node)))
        };
        if let Some(body) = self.tools.bodies.iter().find(of) {
            return (
                format!(
                    "the reference node of the *RIGID BODY on line {}",
                    body.line
                ),
                "a set of reference nodes only, or of nodes of plane elements only",
                "Write a row of its own for the reference node.",
            );
        }
        let label = self.raw.node_labels[*first as usize];
        let what = match nodes.len() {
            1 => format!("where node {label} belongs to no plane element"),
            count => {
                format!("whose {count} nodes (the first is {label}) belong to no plane element")
            }
        };
        (
            what,
            MESHED,
            "Name nodes of the mesh. A reference node acts through a *RIGID BODY with a *CONTACT PAIR only: *COUPLING, *MPC and *EQUATION are not read.",
        )
    }

    /// The factors of loads and of supports at the end of each step; a deck with several steps must have contacts.
    /// `warms`: whether temperatures are one of the loads.
    fn factors_of_steps(&mut self, warms: bool) -> Vec<[f64; 2]> {
        let steps = self.deck.steps;
        if steps == 1 || steps > 1 && !self.pairs.is_empty() {
            self.check_replaced();
            return self.factors(warms);
        }
        if let Some(second) = self.deck.contact.steps.get(1).map(|step| step.line) {
            self.doubt(
                second,
                format!("the second of {steps} steps"),
                "one *STEP",
                "Several steps are read where they move a rigid body (*CONTACT PAIR). Delete the others, or write a problem as JSON for each, with this deck as its mesh.",
            );
        }
        vec![[1.0; 2]; steps]
    }
}

fn beside(other: &Typed, first: &Typed) -> String {
    format!(
        "elements of type `{:.20}` beside those of type `{:.20}` on line {}",
        other.name, first.name, first.line
    )
}

fn analysis(built: &mut Built) -> Analysis {
    let first = built.types.first().cloned();
    let theory = first
        .as_ref()
        .map_or(Theory::PlaneStrain, |kind| kind.mechanics.theory);
    let mut others = built.types.iter();
    let other = others.find(|kind| kind.mechanics.theory != theory).cloned();
    if let (Some(first), Some(other)) = (first, other) {
        built.doubt(
            other.line,
            beside(&other, &first),
            "one of CPE (plane strain), CPS (plane stress) and CAX (revolution) for all elements",
            "Change the types of either, or leave out the elements that do not belong to the body.",
        );
    }
    let thicknesses: Vec<(u64, Option<f64>)> = built
        .sections
        .iter()
        .map(|s| (s.row.line, s.row.thickness))
        .collect();
    let first = thicknesses.first().and_then(|(_, thickness)| *thickness);
    for (line, thickness) in thicknesses {
        let wanted = first.unwrap_or(1.0);
        if theory != Theory::Axisymmetric && thickness.unwrap_or(1.0) != wanted {
            built.doubt(
                line,
                format!("a thickness of {}", thickness.unwrap_or(1.0)),
                &format!("{wanted}"),
                "A plane body has one thickness.",
            );
        }
    }
    match theory {
        Theory::PlaneStrain => Analysis::PlaneStrain {},
        Theory::PlaneStress => Analysis::PlaneStress {
            thickness: first.unwrap_or(1.0),
        },
        Theory::Axisymmetric => Analysis::Axisymmetric {},
    }
}

/// The number of Gauss points in each direction for quadrilaterals; in a mesh of triangles 2, which gives the three
/// points that Abaqus and CalculiX use. In a mixed mesh triangles get the rule of the quadrilaterals, which is at least
/// as accurate.
fn quadrature(built: &mut Built) -> u32 {
    let is_quad = |kind: &&Typed| !kind.mechanics.is_triangle();
    let quads: Vec<Typed> = built.types.iter().filter(is_quad).cloned().collect();
    let Some(first) = quads.first() else {
        return 2;
    };
    let reduced = first.mechanics.reduced;
    if let Some(other) = quads.iter().find(|kind| kind.mechanics.reduced != reduced) {
        built.doubt(
            other.line,
            beside(other, first),
            "full integration of all elements, or reduced integration (R) of all",
            "Add or remove the R in the element types of either.",
        );
    }
    if reduced { 2 } else { 3 }
}

/// The materials of the body; `warms`: whether its temperature changes.
fn materials(built: &mut Built, warms: bool) -> Vec<Material> {
    let mut materials = Vec::new();
    let load_of_mass = built.first_mass_load();
    let mut densities: BTreeSet<&Name> = BTreeSet::new();
    let sections = std::mem::take(&mut built.sections);
    let known = std::mem::take(&mut built.deck.materials);
    // a material is reported once, however many sections have it
    let mut told: BTreeSet<&Name> = BTreeSet::new();
    for Row { row, name } in &sections {
        // a section of trusses or springs: what they are is told where they are
        if !built.raw.groups.contains_key(name) {
            continue;
        }
        let definition = known.get(&row.material);
        let Some((definition, elastic)) = definition.and_then(|m| Some((m, m.elastic.as_ref()?)))
        else {
            if !built.incomplete.names && told.insert(&row.material) {
                let got = if known.contains_key(&row.material) {
                    format!("the material `{:.60}` without *ELASTIC", row.material)
                } else {
                    format!("the unknown material `{:.60}`", row.material)
                };
                let names = known.keys().take(20);
                let names: Vec<String> = names.map(|name| format!("{name:.60}")).collect();
                let hint = if names.is_empty() {
                    "The deck has no *MATERIAL: define it by *MATERIAL, NAME=… with *ELASTIC."
                        .to_owned()
                } else {
                    format!(
                        "Known materials: {}. Correct MATERIAL=…, or give it *ELASTIC.",
                        names.join(", ")
                    )
                };
                built.doubt(
                    row.line,
                    got,
                    "a *MATERIAL of that name with *ELASTIC",
                    &hint,
                );
            }
            continue;
        };
        if told.contains(&row.material) {
            continue;
        }
        let load = load_of_mass.filter(|_| densities.insert(&row.material));
        let density = built.density_of(&row.material, definition, load);
        for (line, got) in &definition.other {
            told.insert(&row.material);
            built.doubt(
                *line,
                got.clone(),
                "a linear elastic material",
                "Remove it, if the material stays elastic.",
            );
        }
        match elasticity(elastic) {
            Some(mut elasticity) => {
                if let Elasticity::Orthotropic(constants) = &mut elasticity {
                    constants.angle = angle(built, row);
                }
                let mut material = Material {
                    density,
                    expansion: None,
                    elasticity,
                    group: Some(name.clone()),
                    name: Some(row.material.to_string()),
                };
                built.expand(definition, warms, &mut material);
                materials.push(material);
            }
            None if elastic.unreadable || !told.insert(&row.material) => {}
            None => {
                let (got, expected, hint) = constants(elastic);
                built.doubt(elastic.line, got, expected, hint);
            }
        }
    }
    // the deck's definitions stay where checks look for them
    built.deck.materials = known;
    materials
}

/// The angle of the first direction of a section's material (degrees), which matters only for orthotropic materials.
fn angle(built: &mut Built, section: &Section) -> f64 {
    let Some(name) = &section.orientation else {
        return 0.0;
    };
    let angle = built.deck.orientations.get(name).map(Orientation::angle);
    match angle {
        Some(Some(angle)) => angle,
        found => {
            let got = match found {
                Some(_) => format!("the orientation `{name:.60}`"),
                None => format!("the unknown orientation `{name:.60}`"),
            };
            built.doubt(
                section.line,
                got,
                "*ORIENTATION with two points in the plane of x and y, and a rotation about 3 at most",
                "Give `orthotropic.angle` of a material in a problem as JSON, with this deck as its mesh.",
            );
            0.0
        }
    }
}

impl Orientation {
    /// The angle from x to the first direction of the material (degrees); none if the orientation is not in the plane.
    fn angle(&self) -> Option<f64> {
        let points = self.lines.first().filter(|_| !self.curved)?;
        let at = |k: usize| points.get(k).copied().unwrap_or(0.0);
        let (origin, a, b) = (
            [at(6), at(7), at(8)],
            [at(0), at(1), at(2)],
            [at(3), at(4), at(5)],
        );
        let [a, b] = [a, b].map(|p| [p[0] - origin[0], p[1] - origin[1], p[2] - origin[2]]);
        let cross = a[0] * b[1] - a[1] * b[0];
        if a[2] != 0.0 || b[2] != 0.0 || cross == 0.0 {
            return None;
        }
        let further = match self.lines.get(1).map(|line| &line[..]) {
            None | Some([]) => 0.0,
            // about the third direction, which points along z or against it
            Some([3.0]) => 0.0,
            Some([3.0, angle]) => angle * cross.signum(),
            Some([_, 0.0]) => 0.0,
            Some(_) => return None,
        };
        Some(a[1].atan2(a[0]).to_degrees() + further)
    }
}

fn elasticity(elastic: &Elastic) -> Option<Elasticity> {
    // a temperature may follow
    match (&elastic.kind[..], &elastic.values[..]) {
        // with a decimal comma in 0,3 there seems to be a temperature of 3 after a ratio of 0
        ("ISO" | "ISOTROPIC", [_, 0.0, _]) => None,
        ("ISO" | "ISOTROPIC", [e, nu] | [e, nu, _]) => Some(Elasticity::Isotropic {
            youngs_modulus: *e,
            poissons_ratio: *nu,
        }),
        (
            "ENGINEERING CONSTANTS",
            [e1, e2, e3, nu12, nu13, nu23, g12, _, _]
            | [e1, e2, e3, nu12, nu13, nu23, g12, _, _, _],
        ) => Some(Elasticity::Orthotropic(Orthotropic {
            e1: *e1,
            e2: *e2,
            nu12: *nu12,
            g12: *g12,
            angle: 0.0,
            e3: Some(*e3),
            nu13: Some(*nu13),
            nu23: Some(*nu23),
            expansion: None,
        })),
        _ => None,
    }
}

/// What the deck has, what is expected, and what to do, for elastic constants that are not understood.
fn constants(elastic: &Elastic) -> (String, &'static str, &'static str) {
    const OF_ONE_TEMPERATURE: &str = "Write the constants of one temperature in that order; other forms of elasticity must be converted.";
    let known = ["ISO", "ISOTROPIC", "ENGINEERING CONSTANTS"].contains(&&elastic.kind[..]);
    if !known {
        let got = format!("*ELASTIC, TYPE={:.40}", elastic.kind);
        let expected = "TYPE=ISO or TYPE=ENGINEERING CONSTANTS";
        return (got, expected, OF_ONE_TEMPERATURE);
    }
    if let [e, 0.0, third] = elastic.values[..] {
        return (
            format!("E = {e}, ν = 0, and {third} as a temperature"),
            "E, ν; a ν of 0 without a temperature",
            DECIMAL_POINT,
        );
    }
    let got = match elastic.values.len() {
        count @ ..=MOST_CONSTANTS => format!("{count} elastic constants"),
        _ => format!("more than {MOST_CONSTANTS} elastic constants"),
    };
    (
        got,
        "E, ν; or E1, E2, E3, ν12, ν13, ν23, G12, G13, G23; at one temperature",
        OF_ONE_TEMPERATURE,
    )
}

/// The numbers, in words, of the elements at those of `sides` that lie inside the body, where two elements share a
/// side. `inner`: all such sides of the mesh, sorted.
fn elements_at(raw: &RawMesh, sides: &[[u32; 2]], inner: &[(u32, u32)]) -> String {
    let inside = sides.iter().map(|ends| key(*ends));
    let inside: BTreeSet<(u32, u32)> = inside
        .filter(|side| inner.binary_search(side).is_ok())
        .collect();
    let has_one = |element: &Element| {
        let corners = element.family().corners();
        (0..corners).any(|k| inside.contains(&key([element[k], element[(k + 1) % corners]])))
    };
    let places = (0..raw.elements.len()).filter(|place| has_one(&raw.elements[*place]));
    numbered("element", places.map(|place| raw.element_labels[place]))
}

/// Translates the loads. Forces are divided by `thickness`, the thickness of a body in plane strain: in a problem they
/// are per unit of thickness. On a body of revolution a force acts on the whole ring, as in Abaqus and CalculiX.
fn loads(built: &mut Built, analysis: &Analysis, thickness: f64) -> Vec<Load> {
    let pressures = std::mem::take(&mut built.pressures);
    let mut loads = built.mass_loads(&pressures, analysis);
    let of_mass = |row: &Row<Distributed>| matches!(row.row.on, On::Mass(_));
    let inner = if pressures.iter().all(of_mass) {
        Vec::new()
    } else {
        sides_of_two(&built.raw)
    };
    // a deck may load the same sides many times
    let mut counted: BTreeMap<String, (usize, usize)> = BTreeMap::new();
    for Row { row, name } in pressures.into_iter().filter(|row| !of_mass(row)) {
        let count = || {
            let sides = built.raw.lines.get(&name).map_or(&[][..], |sides| sides);
            let is_inside = |ends: &&[u32; 2]| inner.binary_search(&key(**ends)).is_ok();
            (sides.len(), sides.iter().filter(is_inside).count())
        };
        match *counted.entry(name.clone()).or_insert_with(count) {
            (0, _) => built.doubt(
                row.line,
                format!("a pressure on `{name:.60}`, which has no side"),
                "sides of plane elements",
                "Name elements of the plane.",
            ),
            (_, 0) => loads.push(Load::Pressure(name, BoundaryValue::Constant(row.value))),
            (all, inside) => built.doubt(
                row.line,
                format!(
                    "a pressure on `{name:.60}`: {inside} of its {all} sides lie inside the body, at {}",
                    elements_at(&built.raw, &built.raw.lines[&name], &inner)
                ),
                "sides on the surface of the body",
                "Load only the elements at the surface, or give forces at the nodes inside by *CLOAD.",
            ),
        }
    }
    let mut used: BTreeMap<String, bool> = BTreeMap::new();
    for Row { row, name } in std::mem::take(&mut built.forces) {
        if built.tools.bears_alone(&name) {
            continue;
        }
        // told with the rows for rigid bodies
        if ![1, 2].contains(&row.component) {
            continue;
        }
        let count = || {
            let nodes = built.raw.node_sets.get(&name);
            let mut nodes = nodes.into_iter().flatten();
            nodes.any(|node| built.used[*node as usize])
        };
        if !*used.entry(name.clone()).or_insert_with(count) {
            let (what, expected, hint) = built.not_meshed(&name);
            built.doubt(
                row.line,
                format!("a force on `{name:.60}`, {what}"),
                expected,
                hint,
            );
            continue;
        }
        let value = row.value / thickness;
        let force = if row.component == 1 {
            [value, 0.0]
        } else {
            [0.0, value]
        };
        loads.push(Load::Force(name, force));
    }
    loads
}
