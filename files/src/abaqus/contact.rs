//! Translates the contacts of a deck: between a surface of a body and a rigid surface here, between bodies in `bodies`.

use std::collections::BTreeMap;

use super::contact_parts::{
    Adjust, Behavior, DeckContact, DeckFriction, Interaction, Pair, WRITTEN_INSTEAD,
};
use super::rigid::{MOST_POINTS, Tools};
use super::steps::{Motion, common_factors, largest};
use super::tool::{Joined, Outline, Piece, Point, chain, cross, dot, length, met, minus, outline};
use super::written::on_line;
use solver::error::{Reason, Violation};
use solver::mesh::{Edge, Mesh, runs};
use solver::problem::{
    Along, Contact, Friction, FrictionPoints, History, Interpolation, Kernel, Material, Measure,
    NormalOf, Normalization, Obstacle, SLIP_PART, Step, Transition,
};
use solver::solution::{Warning, WarningCode};

/// The default of Abaqus for the elastic slip, in lengths of an element's side.
const SLIP_TOLERANCE: f64 = 0.005;

/// The largest sine of the angle between two directions that count as parallel, since coordinates in files are rounded.
const STRAIGHT: f64 = 1e-6;

/// The largest gap that counts as closed, as a part of the body's size, since coordinates in files are rounded.
pub(super) const CLOSED: f64 = 1e-6;

/// The largest number of sides of a boundary at which the rigid surface in front of it is examined.
pub(super) const MOST_LOOKS: usize = 1000;

/// The contacts of a deck and its steps, with remarks.
#[derive(Default)]
pub(super) struct Translated {
    pub(super) contacts: Vec<Contact>,
    pub(super) steps: Vec<Step>,
    pub(super) remarks: Remarks,
}

/// The parts of a deck that contacts are made from.
pub(super) struct Source<'a> {
    pub(super) said: &'a DeckContact,
    /// For each contact pair: the names of its two surfaces in the mesh.
    pub(super) pairs: &'a [[String; 2]],
    /// The same for each *CLEARANCE.
    pub(super) clearances: &'a [[String; 2]],
    pub(super) tools: &'a Tools,
    pub(super) mesh: &'a Mesh,
    pub(super) materials: &'a [Material],
    /// The thickness of a body in plane strain, whose forces are per unit of it.
    pub(super) thickness: f64,
    /// The motion of each rigid body; `None` for a motion that was refused.
    pub(super) motions: &'a [Option<Motion>],
}

/// Violations and warnings about the contacts of a deck.
#[derive(Default)]
pub(super) struct Remarks {
    /// Parts of the deck that cannot be translated into a contact.
    pub(super) violations: Vec<Violation>,
    /// Differences between the translated contacts and the deck.
    pub(super) warnings: Vec<Warning>,
}

impl Remarks {
    pub(super) fn doubt(&mut self, line: u64, got: impl Into<String>, expected: &str, hint: &str) {
        let violation = on_line(line, Reason::NotUnderstood, got.into(), expected, hint);
        self.violations.push(violation);
    }

    /// Adds a violation and returns `None`: the contact cannot be translated.
    pub(super) fn refuse<T>(
        &mut self,
        line: u64,
        got: impl Into<String>,
        expected: &str,
        hint: &str,
    ) -> Option<T> {
        self.doubt(line, got, expected, hint);
        None
    }

    pub(super) fn differs(&mut self, message: String) {
        self.warnings.push(differs(message));
    }
}

/// The two surfaces of a contact pair: a boundary of the body, and a rigid surface.
struct Surfaces<'a> {
    boundary: &'a str,
    tool: &'a str,
    /// The number of the rigid body that the rigid surface belongs to.
    body: usize,
    pieces: &'a [Piece],
}

/// One contact, and its motion at the end of each step.
pub(super) struct Made {
    pub(super) contact: Contact,
    /// Whether each of the three motions is caused by a load.
    pub(super) free: [bool; 3],
    /// At the end of each step: what of [`MOTIONS_AND_LOADS`] the contact has, and 0 of the others.
    pub(super) moved: Vec<[f64; 6]>,
}

/// The factors of a step on the indentation, the tangential displacement, the tilt, the normal force, the tangential force and
/// the moment, if no contact has them.
const MOTIONS_AND_LOADS: [f64; 6] = [1.0, 0.0, 1.0, 1.0, 0.0, 1.0];

impl Source<'_> {
    /// Translates all contacts. `others`: the factors of loads and of supports at the end of each step.
    pub(super) fn contacts(&self, others: &[[f64; 2]]) -> Translated {
        let mut found = Translated::default();
        if self.report_shared_sides(&mut found.remarks) {
            return found;
        }
        self.check_pairs(&mut found.remarks);
        if let Some(line) = self.said.perturbation {
            found.remarks.doubt(
                line,
                "*STEP, PERTURBATION in a deck with contact",
                "general steps",
                "A perturbation is linear: contact does not change in it. Remove PERTURBATION if the surfaces are to touch and to slip in this step.",
            );
        }
        let mut all = Vec::new();
        for (pair, surfaces) in self.said.pairs.iter().zip(self.pairs) {
            all.extend(self.contact(pair, surfaces, others, &mut found.remarks));
        }
        if all.len() < self.said.pairs.len() {
            return found; // with violations
        }
        let moved: Vec<&[[f64; 6]]> = all.iter().map(|made| &made.moved[..]).collect();
        let Some(factors) = common_factors(&moved, MOTIONS_AND_LOADS) else {
            let line = self.said.pairs.last().map_or(0, |pair| pair.line);
            found.remarks.doubt(
                line,
                "rigid bodies that several steps move or load in different proportions",
                "motions, and loads, in the same proportion in every step",
                WRITTEN_INSTEAD,
            );
            return found;
        };
        let friction = all.iter().any(|made| made.contact.friction.is_some());
        let loaded = [0, 1].map(|kind| others.iter().any(|other| other[kind] != 0.0));
        for made in all {
            let most = largest(&made.moved);
            let load = |k: usize| made.free[k].then_some(most[3 + k]);
            found.contacts.push(Contact {
                // of two bodies it is the interference
                indentation: if made.contact.against.is_some() {
                    0.0
                } else {
                    most[0]
                },
                tangential_displacement: most[1],
                tilt: (most[2] != 0.0).then_some(most[2]),
                normal_force: load(0),
                tangential_force: load(1),
                moment: load(2),
                ..made.contact
            });
        }
        if friction || others.len() > 1 {
            for (k, (factor, other)) in factors.iter().zip(others).enumerate() {
                let written = self.said.steps.get(k).and_then(|step| step.increments);
                if let Some(more) = written.filter(|n| friction && *n > MOST_INCREMENTS) {
                    found.remarks.differs(format!(
                        "Step {} begins with {more:.0} increments, but is solved in {MOST_INCREMENTS:.0}. Divide it into several steps if more are needed.",
                        k + 1
                    ));
                }
                found.steps.push(Step {
                    name: Some(self.said.name_of(k)),
                    indentation: factor[0],
                    tangential_displacement: factor[1],
                    tilt: factor[2],
                    normal_force: factor[3],
                    tangential_force: factor[4],
                    moment: factor[5],
                    loads: if loaded[0] { other[0] } else { 1.0 },
                    supports: if loaded[1] { other[1] } else { 1.0 },
                    increments: if friction { increments(written) } else { 1 },
                    ..Step::default()
                });
            }
        }
        found
    }

    /// Reports contact pairs whose boundary shares sides with that of an earlier pair; returns whether there are any.
    fn report_shared_sides(&self, remarks: &mut Remarks) -> bool {
        let mut owners: BTreeMap<Edge, (u64, &str)> = BTreeMap::new();
        let before = remarks.violations.len();
        for (Pair { line, .. }, surfaces) in self.said.pairs.iter().zip(self.pairs) {
            let mut bodies = surfaces.iter();
            let Some(name) = bodies.find(|name| !self.tools.by_surface.contains_key(*name)) else {
                continue;
            };
            let edges = self
                .mesh
                .boundaries
                .get(name)
                .map_or(&[][..], |edges| edges);
            let others = edges.iter().filter_map(|edge| owners.get(edge).copied());
            let others: Vec<(u64, &str)> = others.collect();
            if let Some((other, of)) = others.first() {
                let got = if of == name {
                    format!("`{name:.60}` in a second contact pair: the first is on line {other}")
                } else {
                    format!(
                        "`{name:.60}`, of which {} of {} sides belong to `{of:.60}` too, in the contact pair on line {other}",
                        others.len(),
                        edges.len()
                    )
                };
                remarks.doubt(
                    *line,
                    got,
                    "each side of the body in one contact pair",
                    "Divide the surface by *SURFACE into parts, and pair each part with the rigid surface that it can touch. Two rigid surfaces that move together may be one: write their lines into one *SURFACE, TYPE=SEGMENTS. In a problem as JSON, `contacts` name parts of the boundary, too.",
                );
            }
            for edge in edges {
                owners.entry(*edge).or_insert((*line, name));
            }
        }
        remarks.violations.len() > before
    }

    fn contact(
        &self,
        pair: &Pair,
        names: &[String; 2],
        others: &[[f64; 2]],
        remarks: &mut Remarks,
    ) -> Option<Made> {
        let line = pair.line;
        let rigid = |name: &String| self.tools.by_surface.contains_key(name);
        if !names.iter().any(rigid) {
            return self.between_bodies(pair, names, others.len(), remarks);
        }
        let surfaces = self.surfaces(pair, names, remarks)?;
        let placed = self.placed(pair, &surfaces, remarks)?;
        let interaction = self.interaction(pair, remarks);
        let shape = placed.shape(others);
        let friction = interaction.and_then(|i| i.friction.as_ref());
        let friction = friction.and_then(|said| {
            let way = shape.as_ref().map_or(0.0, Shape::way);
            self.friction(said, placed.edges, way, remarks)
        });
        let shape = match shape {
            Ok(shape) => shape,
            Err((got, expected)) => {
                let got = format!("{got} (the rigid surface `{:.60}`)", surfaces.tool);
                return remarks.refuse(line, got, expected, WRITTEN_INSTEAD);
            }
        };
        if let Some(message) = shape.message {
            remarks.differs(format!("*CONTACT PAIR on line {line}: {message}"));
        }
        if let Some(interaction) = interaction {
            let most = largest(&shape.moved)[0].abs();
            self.behavior(&interaction.behavior, placed.edges, most, remarks);
        }
        // of a body that only forces move the result states the moment about the reference node
        let turned = shape.moved.iter().any(|m| m[2] != 0.0);
        let has_point = turned || placed.motion.may_turn && shape.free.contains(&true);
        Some(Made {
            contact: Contact {
                boundary: surfaces.boundary.to_owned(),
                obstacle: Some(shape.obstacle),
                against: None,
                gap: None,
                indentation: 0.0,
                normal_force: None,
                direction: shape.direction,
                tangential_displacement: 0.0,
                tangential_force: None,
                tilt: None,
                moment: None,
                about: has_point.then_some(shape.about),
                stiffness: None,
                normal: Some(NormalOf::Obstacle),
                condition: Default::default(),
                friction,
            },
            free: shape.free,
            moved: shape.moved,
        })
    }

    /// The names of surfaces that a contact pair may have, in words.
    fn known_surfaces(&self) -> String {
        let list = |names: Vec<&str>| match names.len() {
            0 => "none".to_owned(),
            _ => {
                let names = names.into_iter().take(20);
                let names: Vec<String> = names.map(|name| format!("`{name:.60}`")).collect();
                names.join(", ")
            }
        };
        let body = self
            .mesh
            .boundaries
            .iter()
            .filter(|(_, edges)| !edges.is_empty());
        let rigid = self.tools.by_surface.keys();
        format!(
            "Surfaces of the body: {}; rigid surfaces: {}.",
            list(body.map(|(name, _)| name.as_str()).collect()),
            list(rigid.map(String::as_str).collect())
        )
    }

    /// Tells the boundary of the elastic body and the rigid surface of a contact pair apart.
    fn surfaces<'s>(
        &'s self,
        pair: &Pair,
        [first, second]: &'s [String; 2],
        remarks: &mut Remarks,
    ) -> Option<Surfaces<'s>> {
        let line = pair.line;
        if pair.tie.is_some() {
            return remarks.refuse(
                line,
                format!("*TIE of `{first:.60}` and `{second:.60}`, of which one is rigid"),
                "two surfaces of elastic bodies",
                "Hold the nodes that are tied to the rigid body by *BOUNDARY instead.",
            );
        }
        let rigid = [first, second].map(|name| self.tools.by_surface.get(name));
        let (boundary, tool, (body, pieces)) = match rigid {
            [None, Some(tool)] => (first, second, tool),
            [Some(tool), None] => (second, first, tool),
            _ => {
                return remarks.refuse(
                    line,
                    format!("a contact of two rigid surfaces, `{first:.60}` and `{second:.60}`"),
                    "a surface of an elastic body",
                    "Name a surface of deformable elements.",
                );
            }
        };
        Some(Surfaces {
            boundary,
            tool,
            body: *body,
            pieces,
        })
    }

    /// Finds the rigid surface of a contact pair, its motion, and the boundary of the body in front of which it lies.
    fn placed<'s>(
        &'s self,
        pair: &Pair,
        surfaces: &Surfaces<'_>,
        remarks: &mut Remarks,
    ) -> Option<Placed<'s>> {
        let (line, tool, name) = (pair.line, surfaces.tool, surfaces.boundary);
        let body = &self.tools.bodies[surfaces.body];
        if body.attached {
            return remarks.refuse(
                body.line,
                "a rigid body that shares nodes with the elastic body",
                "a rigid body by itself",
                "Support the shared nodes by *BOUNDARY instead.",
            );
        }
        let edges = self.sides(line, name, remarks)?;
        let Some(pieces) = chain(surfaces.pieces) else {
            return remarks.refuse(
                line,
                format!("the rigid surface `{tool:.60}`, which is not one continuous line"),
                "lines that follow one another, all with the body on the same side",
                WRITTEN_INSTEAD,
            );
        };
        let placed = Placed {
            mesh: self.mesh,
            edges,
            outline: outline(&pieces),
            motion: self.motions.get(surfaces.body)?.as_ref()?,
            thickness: self.thickness,
            size: self.size(),
        };
        let count = placed.outline.points.len();
        if count > MOST_POINTS {
            return remarks.refuse(
                line,
                format!("{count} points of the rigid surface `{tool:.60}`"),
                &format!("at most {MOST_POINTS}"),
                "Remove the parts that the body cannot touch.",
            );
        }
        if !placed.faces() {
            return remarks.refuse(
                line,
                format!("the rigid surface `{tool:.60}`, whose outer side does not face `{name:.60}`"),
                "a rigid surface with the body on its left: the normal is its direction turned counter-clockwise (SPOS of a rigid line, too)",
                "Write its segments in the opposite order, or name the other side.",
            );
        }
        if pair.adjust.is_some_and(|adjust| placed.is_moved_by(adjust)) {
            remarks.doubt(
                line,
                "*CONTACT PAIR with ADJUST, which moves nodes here",
                "nodes that lie on the rigid surface already, or beyond the distance",
                "Mesh the body so that it touches, and remove ADJUST.",
            );
        }
        Some(placed)
    }

    /// The sides of a surface of an elastic body.
    pub(super) fn sides(&self, line: u64, name: &str, remarks: &mut Remarks) -> Option<&[Edge]> {
        let edges = self.mesh.boundaries.get(name);
        if let Some(edges) = edges.filter(|edges| !edges.is_empty()) {
            return Some(edges);
        }
        remarks.refuse(
            line,
            format!("`{name:.60}` in a contact pair"),
            "a surface with sides of the elastic body's surface",
            &format!("Sides are those on the outside of the body: of a set of elements only S1 … S4 that no other element shares, of a set of nodes those of which all nodes are in it, midside nodes too. {}", self.known_surfaces()),
        )
    }

    /// The interaction that a pair names.
    pub(super) fn interaction(&self, pair: &Pair, remarks: &mut Remarks) -> Option<&Interaction> {
        let name = pair.interaction.as_ref()?;
        let interactions = &self.said.interactions;
        let found = interactions.get(name);
        if found.is_none() {
            let known = interactions.keys().take(20);
            let known: Vec<String> = known.map(|name| format!("{name:.60}")).collect();
            remarks.doubt(
                pair.line,
                format!("the interaction `{name:.60}`"),
                "a *SURFACE INTERACTION of that name",
                &format!("Known interactions: {}. Correct INTERACTION=…, or define it by *SURFACE INTERACTION, NAME=….", known.join(", ")),
            );
        }
        found
    }

    /// Translates friction into Coulomb's law, which depends on the load path; `None` if the contact is frictionless.
    /// `way`: how far the rigid surface is moved at most (length).
    pub(super) fn friction(
        &self,
        said: &DeckFriction,
        edges: &[Edge],
        way: f64,
        remarks: &mut Remarks,
    ) -> Option<Friction> {
        let line = said.line;
        let Some(coefficient) = said.coefficient else {
            return remarks.refuse(
                line,
                "*FRICTION without a coefficient",
                "a friction coefficient ≥ 0",
                "Give it on the line after *FRICTION.",
            );
        };
        if coefficient == 0.0 {
            return None;
        }
        let side = self.mean_side(edges);
        let at_once = said.stick_slope.is_some() || said.lagrange;
        let (elastic_slip, rule) = match (said.elastic_slip, said.slip_tolerance) {
            (Some(slip), _) => (slip, None),
            (None, Some(tolerance)) => (tolerance * side, None),
            // friction that is meant to act at once is not that of a length of the mesh
            (None, None) if at_once && way > 0.0 => (
                SLIP_PART * way,
                Some(format!("{SLIP_PART} of the way of the rigid surface")),
            ),
            (None, None) => (
                SLIP_TOLERANCE * side,
                Some(format!("{SLIP_TOLERANCE} of the mean side of the contact")),
            ),
        };
        if let Some(rule) = rule {
            let ours = format!("the elastic slip is {elastic_slip:.4e} here, {rule}");
            remarks.differs(match (said.stick_slope, said.lagrange) {
                (Some(slope), _) if way == 0.0 => format!("*FRICTION on line {line}: friction of the deck is a spring of {slope:e} until it reaches the coefficient times the pressure; {ours}, whatever the pressure. SLIP TOLERANCE or ELASTIC SLIP sets it."),
                (Some(slope), _) => format!("*FRICTION on line {line}: friction of the deck is a spring of {slope:e} until it reaches the coefficient times the pressure: at most {:.4e} (stress) over the way of the rigid surface. Where the coefficient times the pressure is more, the deck has less friction than this result: {ours}, whatever the pressure. SLIP TOLERANCE or ELASTIC SLIP sets it.", slope * way),
                (None, true) => format!("*FRICTION on line {line}: LAGRANGE sticks without slip; {ours}."),
                (None, false) => format!("*FRICTION on line {line} gives no elastic slip: {ours}. SLIP TOLERANCE or ELASTIC SLIP sets it."),
            });
        }
        Some(Friction {
            coefficient: Some(coefficient),
            nonlocal_radius: Some(0.0),
            elastic_slip,
            kernel: Kernel::default(),
            normalization: Normalization::default(),
            transition: Transition::default(),
            history: History::Incremental,
            points: FrictionPoints::Nodal,
            measure: Measure::default(),
            cohesion: 0.0,
            shear_cap: said.most_stress,
            bound: None,
        })
    }

    /// Checks the contact stiffness of the deck, since translated contacts are hard: warns by how much a stiff contact
    /// of the deck differs from a hard one, and refuses a soft one. `most`: the largest indentation.
    pub(super) fn behavior(
        &self,
        behavior: &Behavior,
        edges: &[Edge],
        most: f64,
        remarks: &mut Remarks,
    ) {
        match *behavior {
            Behavior::Hard => {}
            Behavior::Tied { line } => remarks.doubt(
                line,
                "PRESSURE-OVERCLOSURE=TIED of a rigid surface",
                "PRESSURE-OVERCLOSURE=HARD",
                "Hold the nodes that are tied to the rigid body by *BOUNDARY instead; or write a contact with \"condition\": \"bonded\" in a problem as JSON.",
            ),
            Behavior::Linear { line, slope } => {
                let stiffness = |material: &Material| match &material.elasticity {
                    solver::problem::Elasticity::Isotropic { youngs_modulus, .. } => {
                        *youngs_modulus
                    }
                    solver::problem::Elasticity::Orthotropic(o) => o.e1.max(o.e2),
                };
                let modulus = self.materials.iter().map(stiffness).fold(0.0, f64::max);
                let least = modulus / self.mean_side(edges);
                match slope {
                    Some(slope) if slope >= least => remarks.differs(format!(
                        "*SURFACE BEHAVIOR on line {line}: contact is hard here; in the deck the surfaces overlap by p/{slope:e} at a pressure p, {:.1e} for a thousandth of Young's modulus.",
                        1e-3 * modulus / slope
                    )),
                    _ => remarks.doubt(
                        line,
                        format!("a pressure of {} per length of overclosure", slope.unwrap_or(0.0)),
                        &format!("hard contact, or a slope of at least {least:e} (Young's modulus per side of an element), which is nearly hard"),
                        "Such a soft layer is no hard contact: include the layer in the mesh.",
                    ),
                }
            }
            Behavior::Exponential { line, clearance } => {
                // without a given motion the mesh is the measure
                let allowed = match most > 0.0 {
                    true => 0.01 * most,
                    false => 1e-3 * self.mean_side(edges),
                };
                match clearance {
                    Some(clearance) if clearance > 0.0 && clearance <= allowed => remarks.differs(format!(
                        "*SURFACE BEHAVIOR on line {line}: contact is hard here; in the deck pressure begins at a clearance of {clearance:e}."
                    )),
                    _ => remarks.doubt(
                        line,
                        format!("a pressure that begins at a clearance of {}", clearance.unwrap_or(0.0)),
                        &format!("hard contact, or a clearance of at most {allowed:.1e}"),
                        "Use PRESSURE-OVERCLOSURE=HARD.",
                    ),
                }
            }
        }
    }

    /// The mean length of the sides of a contact.
    pub(super) fn mean_side(&self, edges: &[Edge]) -> f64 {
        let side = |edge: &Edge| {
            let [a, b, _] = self.mesh.edge_nodes(edge);
            length(minus(b, a))
        };
        edges.iter().map(side).sum::<f64>() / edges.len() as f64
    }

    pub(super) fn size(&self) -> f64 {
        self.mesh.extent(0).max(self.mesh.extent(1))
    }
}

/// The smallest number of increments of a step with friction, which depends on the load path. A larger number in the
/// deck is used.
const FEWEST_INCREMENTS: f64 = 10.0;
/// The largest number of increments of a step with friction.
const MOST_INCREMENTS: f64 = 1000.0;

fn increments(written: Option<f64>) -> u32 {
    let written = written.unwrap_or(FEWEST_INCREMENTS).ceil();
    written.clamp(FEWEST_INCREMENTS, MOST_INCREMENTS) as u32
}

pub(super) fn differs(message: String) -> Warning {
    Warning {
        code: WarningCode::DeckDiffers,
        pointer: "/mesh/abaqus".to_owned(),
        message,
    }
}

/// A rigid surface in front of a boundary of the body.
struct Placed<'a> {
    mesh: &'a Mesh,
    edges: &'a [Edge],
    outline: Outline,
    motion: &'a Motion,
    /// The thickness of a body in plane strain, whose forces are per unit of it.
    thickness: f64,
    /// The size of the body (length).
    size: f64,
}

/// An obstacle and its motion, translated from a rigid surface.
struct Shape {
    obstacle: Obstacle,
    direction: Option<Point>,
    /// Whether each of the three motions is caused by a load.
    free: [bool; 3],
    /// At the end of each step: what of [`MOTIONS_AND_LOADS`] there is.
    moved: Vec<[f64; 6]>,
    /// The point that the obstacle turns about.
    about: Point,
    message: Option<String>,
}

impl Shape {
    /// How far the obstacle is moved at most by given displacements (length).
    fn way(&self) -> f64 {
        let most = largest(&self.moved);
        most[0].abs().max(most[1].abs())
    }
}

/// The reason why a rigid surface cannot be an obstacle: what the deck has, and what is expected.
type Unlike = (String, &'static str);

impl Placed<'_> {
    fn met(&self, (place, n): (Point, Point)) -> Option<(f64, Point)> {
        met(&self.outline.points, place, n, 0.1 * self.size)
    }

    /// Whether the outer side of the rigid surface faces the body at the place where both are nearest. True if the
    /// surface faces no node at all, which the checks of the obstacle report.
    fn faces(&self) -> bool {
        let hits = looks(self.mesh, self.edges).filter_map(|look| {
            let (distance, m) = self.met(look)?;
            Some((distance.abs(), dot(m, look.1)))
        });
        let nearest = hits.min_by(|a, b| a.0.total_cmp(&b.0));
        nearest.is_none_or(|(_, along)| along < 0.0)
    }

    /// Whether the parameter `ADJUST` of the deck would move nodes of the body.
    fn is_moved_by(&self, adjust: Adjust) -> bool {
        let closed = CLOSED * self.size;
        looks(self.mesh, self.edges).any(|look| {
            let distance = self.met(look).map(|(distance, _)| distance);
            distance.is_some_and(|distance| adjust.moves(distance, closed))
        })
    }

    /// The normal of the boundary if it is straight; none if it is curved.
    fn straight(&self) -> Option<Point> {
        let mut normals = self
            .edges
            .iter()
            .flat_map(|edge| solver::contact::edge_normals(&self.mesh.edge_nodes(edge)));
        let n = normals.next()?;
        let same = normals.all(|m| cross(n, m).abs() <= STRAIGHT && dot(n, m) > 0.0);
        same.then_some(n)
    }

    /// The normal of the rigid surface, towards the body, if the surface is straight; none if it is curved.
    fn flat(&self) -> Option<Point> {
        if self.outline.joined != Joined::Lines {
            return None;
        }
        let points = &self.outline.points;
        let whole = minus(points[points.len() - 1], points[0]);
        let size = length(whole);
        let along = whole.map(|x| x / size);
        let same = |pair: &[Point]| {
            let step = minus(pair[1], pair[0]);
            cross(along, step).abs() <= STRAIGHT * length(step) && dot(along, step) > 0.0
        };
        points.windows(2).all(same).then_some([-along[1], along[0]])
    }

    /// Translates the rigid surface and its motion to an obstacle.
    fn shape(&self, others: &[[f64; 2]]) -> Result<Shape, Unlike> {
        match (self.straight(), self.flat()) {
            (Some(n), _) => self.before_a_straight_side(n, others),
            (None, Some(q)) => self.straight_before_a_curve(q),
            (None, None) => self.curve_before_a_curve(),
        }
    }

    /// The motions and loads along the direction `push`, in which the rigid surface is pushed, and along the contact's tangent `t`,
    /// as [`MOTIONS_AND_LOADS`]; and whether each of the three motions is caused by a load.
    fn driven(&self, push: Point, t: Point) -> Result<([bool; 3], Vec<[f64; 6]>), Unlike> {
        let [x, y, turns] = self.motion.free;
        // a force and a displacement have no common component
        let along_x = push[1].abs() <= STRAIGHT;
        if x != y && !along_x && push[0].abs() > STRAIGHT {
            return Err((
                "a rigid body that is held along one axis and under a force along the other, in front of an oblique side".into(),
                "one that is held along both axes, or under forces along both",
            ));
        }
        let free = match along_x {
            true => [x, y, turns],
            false => [y, x, turns],
        };
        let alike = x == y;
        let along = |axis: Point, value: &[f64; 3], first: usize| match alike {
            true => axis[0] * value[0] + axis[1] * value[1],
            false => axis[first] * value[first],
        };
        let normal = usize::from(!along_x);
        let end = |value: &[f64; 3]| {
            let of = [
                along(push, value, normal),
                along(t, value, 1 - normal),
                value[2],
            ];
            let mut end = [0.0; 6];
            for k in 0..3 {
                match free[k] {
                    true => end[3 + k] = of[k] / self.thickness,
                    false => end[k] = of[k],
                }
            }
            end
        };
        Ok((free, self.motion.ends.iter().map(end).collect()))
    }

    /// Translates a rigid surface in front of a straight boundary with the outward normal `n`. Its motion against n is
    /// the indentation, and that along the tangent t the tangential displacement; a surface not parallel to the
    /// boundary is placed where it is along t at the end of the last step.
    fn before_a_straight_side(&self, n: Point, others: &[[f64; 2]]) -> Result<Shape, Unlike> {
        let t = [n[1], -n[0]];
        let (free, mut moved) = self.driven(n.map(|x| -x), t)?;
        let last = moved.last().map_or(0.0, |m| m[1]);
        let parallel = self.flat().is_some_and(|q| cross(q, n).abs() <= STRAIGHT);
        let shift = if parallel {
            [0.0; 2]
        } else {
            t.map(|x| last * x)
        };
        let turns = moved.iter().any(|m| m[2] != 0.0);
        if shift != [0.0; 2] && (free.contains(&true) || turns) {
            return Err((
                "a rigid body that is displaced along the face while a force or a rotation moves it".into(),
                "one that a force or a rotation moves where the deck places it along the face",
            ));
        }
        let shifted = |p: Point| [p[0] + shift[0], p[1] + shift[1]];
        let points: Vec<Point> = self.outline.points.iter().map(|p| shifted(*p)).collect();
        let mut about = shifted(self.motion.reference);
        let mut message = (shift != [0.0; 2] && others.len() > 1).then(|| {
            format!("the rigid surface is placed along the body where it is at the end of the last step, {last:e} from its start, for all steps.")
        });
        let foot = self.mesh.nodes[self.edges[0][0] as usize];
        // profiles begin at zero distance: the rest is part of the indentation, if nothing else moves meanwhile
        let alone = moved.iter().all(|m| m[1] == 0.0)
            && others
                .iter()
                .all(|[loads, supports]| *loads == 0.0 && *supports == 0.0);
        let obstacle = match self.outline.joined {
            Joined::Circle {
                center,
                radius,
                convex: true,
            } => {
                let center = shifted(center);
                let clearance = dot(minus(center, foot), n) - radius;
                let none = clearance.abs() <= 1e-9 * radius;
                if alone || free[0] {
                    about = [0, 1].map(|k| about[k] - clearance * n[k]);
                }
                if free[0] && !none {
                    message = Some(format!(
                        "the indentation of the result begins where the surfaces touch first; the rigid body of the deck moves {clearance:.4e} more."
                    ));
                }
                if alone && !free[0] {
                    moved.iter_mut().for_each(|m| m[0] -= clearance);
                }
                (alone || none || free[0]).then(|| self.circle(center, radius, t, &points))
            }
            _ => None,
        };
        let obstacle = obstacle.unwrap_or_else(|| {
            let reach = |p: &[Point]| span(p.iter().map(|p| dot(*p, t)));
            let [low, high] = reach(&points);
            let [from, to] = reach(&self.nodes());
            match self.flat() {
                Some(_) if low <= from && high >= to => line(&points),
                _ => {
                    let (obstacle, off) = polyline(points, self.outline.joined);
                    message = message.take().or(off);
                    obstacle
                }
            }
        });
        Ok(Shape {
            obstacle,
            direction: None,
            free,
            moved,
            about,
            message,
        })
    }

    /// A circular obstacle, as a profile along the boundary. It ends where the arc of the deck ends.
    fn circle(&self, center: Point, radius: f64, t: Point, points: &[Point]) -> Obstacle {
        let run = runs(self.edges);
        let start = run
            .first()
            .map_or([0.0; 2], |run| self.mesh.nodes[run[0][0] as usize]);
        let horizontal = t[1].abs() <= STRAIGHT;
        let coordinate = |p: Point| {
            if horizontal {
                p[0]
            } else {
                dot(minus(p, start), t)
            }
        };
        let [low, high] = span(points.iter().map(|p| coordinate(*p)));
        let middle = coordinate(center);
        let whole = 1e-6 * radius;
        Obstacle::Circle {
            radius,
            center: middle,
            from: (low > middle - radius + whole).then_some(low),
            to: (high < middle + radius - whole).then_some(high),
            along: if horizontal {
                Along::X
            } else {
                Along::ArcLength
            },
        }
    }

    /// Translates a straight rigid surface in front of a curved boundary. The normal of contact is the normal `q` of
    /// the rigid surface, towards the body, which is the same at all points.
    fn straight_before_a_curve(&self, q: Point) -> Result<Shape, Unlike> {
        // of the contact: n = −q
        let t = [-q[1], q[0]];
        let (free, moved) = self.driven(q, t)?;
        let reach = |p: &[Point]| span(p.iter().map(|p| dot(*p, t)));
        let ([low, high], [from, to]) = (reach(&self.outline.points), reach(&self.nodes()));
        let obstacle = if low <= from && high >= to {
            line(&self.outline.points)
        } else {
            polyline(self.outline.points.clone(), self.outline.joined).0
        };
        Ok(Shape {
            obstacle,
            direction: Some(q),
            free,
            moved,
            about: self.motion.reference,
            message: None,
        })
    }

    /// Translates a curved rigid surface in front of a curved boundary; the surface must be moved, or pushed by a force, in one
    /// direction.
    fn curve_before_a_curve(&self) -> Result<Shape, Unlike> {
        let [x, y, turns] = self.motion.free;
        // of a force along one axis the other one is held, and must be at rest
        let along = |u: &[f64; 3]| match (x, y) {
            (true, false) => [u[0], 0.0],
            (false, true) => [0.0, u[1]],
            _ => [u[0], u[1]],
        };
        let ends: Vec<Point> = self.motion.ends.iter().map(along).collect();
        let longer = |most: Point, u: &Point| if length(*u) > length(most) { *u } else { most };
        let most = ends.iter().fold([0.0; 2], longer);
        let size = length(most);
        let (obstacle, message) = polyline(self.outline.points.clone(), self.outline.joined);
        if size == 0.0 && !x && !y && !turns {
            return Ok(Shape {
                obstacle,
                direction: None,
                free: [false; 3],
                moved: self
                    .motion
                    .ends
                    .iter()
                    .map(|u| [0.0, 0.0, u[2], 0.0, 0.0, 0.0])
                    .collect(),
                about: self.motion.reference,
                message,
            });
        }
        let direction = most.map(|x| x / size);
        let rest = |u: &[f64; 3]| x != y && u[usize::from(x)] != 0.0;
        if size == 0.0
            || ends
                .iter()
                .any(|u| cross(direction, *u).abs() > STRAIGHT * size)
            || self.motion.ends.iter().any(rest)
        {
            return Err((
                "a curved rigid surface that is moved, or pushed by forces, in different directions along a curved boundary".into(),
                "one direction",
            ));
        }
        let (free, moved) = self.driven(direction, [-direction[1], direction[0]])?;
        Ok(Shape {
            obstacle,
            direction: Some(direction),
            free,
            moved,
            about: self.motion.reference,
            message,
        })
    }

    fn nodes(&self) -> Vec<Point> {
        self.edges
            .iter()
            .flatten()
            .map(|n| self.mesh.nodes[*n as usize])
            .collect()
    }
}

/// Nodes of a boundary, each with the outward normal of a side there; of a long boundary only some.
pub(super) fn looks<'a>(
    mesh: &'a Mesh,
    edges: &'a [Edge],
) -> impl Iterator<Item = (Point, Point)> + 'a {
    let stride = edges.len().div_ceil(MOST_LOOKS).max(1);
    edges.iter().step_by(stride).flat_map(|edge| {
        let nodes = mesh.edge_nodes(edge);
        let normals = solver::contact::edge_normals(&nodes);
        [0, 2, 1].map(|k| (nodes[k], normals[k]))
    })
}

fn span(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
        [low.min(x), high.max(x)]
    })
}

/// A straight obstacle without ends, through the first and the last of some points.
fn line(points: &[Point]) -> Obstacle {
    let step = minus(points[points.len() - 1], points[0]);
    Obstacle::Line {
        point: points[0],
        angle: step[1].atan2(step[0]).to_degrees(),
        from: None,
        to: None,
        along: Along::X,
    }
}

/// An obstacle through points, and a message that tells its distance from the curves of the deck; no message if that is
/// 0.
fn polyline(points: Vec<Point>, joined: Joined) -> (Obstacle, Option<String>) {
    let nearer = match joined {
        Joined::Spline(_) => " (that is the distance of straight lines; the spline is nearer)",
        _ => "",
    };
    let (interpolation, off) = match joined {
        Joined::Lines => (Interpolation::Linear, 0.0),
        Joined::Polygon(off) => (Interpolation::Linear, off),
        Joined::Spline(off) => (Interpolation::Cubic, off),
        Joined::Circle { radius, .. } => (Interpolation::Cubic, radius * 2e-6),
    };
    let how = match interpolation {
        Interpolation::Linear => "straight lines",
        Interpolation::Cubic => "a spline",
    };
    let message = (off > 0.0).then(|| {
        format!("the curves of the rigid surface are replaced by {how} through {} of their points, within {off:.1e}{nearer}.", points.len())
    });
    let obstacle = Obstacle::Polyline {
        points,
        interpolation,
        from: None,
        to: None,
        along: Along::X,
    };
    (obstacle, message)
}
