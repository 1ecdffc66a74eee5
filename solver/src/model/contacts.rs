//! Checks of contact boundaries and the obstacles they face.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::axis::Axis;
use super::checks::{ALIGNED, Checks};
use super::contact_model::{AlongDirection, ContactModel};
use super::corners::Alone;
use super::level::Level;
use super::pair_checks::Faced;
use super::sliding;
use super::supports::Held;
use super::tool::Tool;
use crate::contact::obstacle::{self, FacingRun};
use crate::contact::{ContactBoundary, HeldDirections, Profile};
use crate::elasticity::Section;
use crate::error::{AllChecks, Checked, Reason};
use crate::friction::{Average, FrictionLaw};
use crate::mesh::{self, Edge, Mesh};
use crate::problem::{Algorithm, Condition, Contact, NormalOf, Obstacle, Problem, Step};
use crate::solution::WarningCode;

/// The friction law of a contact; `None` if the contact is frictionless.
pub(super) type Law = Option<FrictionLaw<Average>>;

/// The sharpest corner between two contact edges without a warning: 20° (angle).
const SHARPEST_TURN: f64 = 0.35;

/// The sharpest corner between two contact edges that is accepted: 45° (angle).
const SHARPEST_CORNER: f64 = 0.795;

/// Largest nonlocal radius, in lengths of the contact boundary. With a larger radius the average hardly depends on the
/// contact, and between two lines of symmetry the cost of the average grows with the radius.
const LARGEST_RADIUS: f64 = 10.0;

/// An obstacle's slope above this is intended, not an effect of rounded coordinates in a file.
const NO_SLOPE: f64 = 1e-3;

/// The sine of the smallest angle between two normals at a common node, or between a normal and a support: 6°. Below it
/// the two directions are hardly independent.
const LEAST_ANGLE: f64 = 0.1;

impl Checks {
    /// The valid contacts, and whether all are valid. `numbers`: for each contact, the result of checking its
    /// obstacle's numbers, and its friction law.
    pub(super) fn contacts(
        &mut self,
        mesh: &Mesh,
        section: &Section,
        axis: &Axis,
        problem: &Problem,
        numbers: Vec<(Checked, Option<FrictionLaw<Average>>)>,
        fixed: &BTreeMap<u32, Held>,
    ) -> (Vec<ContactModel>, Checked) {
        let mut all = AllChecks::default();
        let mut models: Vec<ContactModel> = Vec::new();
        let held = along_one_direction(fixed);
        for (i, numbers) in numbers.into_iter().enumerate() {
            let contact = self.contact(mesh, section, axis, &problem.contacts, &held, i, numbers);
            let Some(model) = all.check(contact) else {
                continue;
            };
            all.check(self.shared_nodes(&model, &models, problem));
            all.check(self.supported_contact_nodes(&model, &problem.steps, fixed));
            let unhindered = all.check(self.nodes_held_along_tool(&model, fixed));
            all.check(self.nodes_of_pair(mesh, &model, &models, fixed));
            all.check(self.tangential_force_borne(&model, &problem.steps));
            if unhindered.is_some() {
                all.check(self.moment_borne(&model, &problem.steps));
            }
            models.push(model);
        }
        all.check(self.oblique_supports(&models, fixed, problem));
        (models, all.finish(()))
    }

    /// Checks that profiles can be named in URLs.
    fn usable_names(&mut self, contact: &Contact, pointer: &str) -> Checked {
        let against = contact.against.as_ref();
        let names = [
            (Some(&contact.boundary), "boundary"),
            (against.map(|other| &other.boundary), "against/boundary"),
        ];
        let unusable = names.into_iter().find_map(|(name, field)| {
            let name = name.filter(|name| ["", ".", ".."].contains(&name.as_str()))?;
            Some((name, field))
        });
        if let Some((name, field)) = unusable {
            return Err(self.report(
                format!("{pointer}/{field}"),
                Reason::Malformed,
                format!("{name:?}"),
                "a name that can be part of a URL: not empty, and neither . nor ..",
                "Give these edges another name in the mesh, or name a part under /mesh/boundaries.",
            ));
        }
        Ok(())
    }

    /// Checks contact number `i` without regard to the other contacts, and makes its model.
    #[allow(clippy::too_many_arguments)] // all that a contact is made from
    fn contact(
        &mut self,
        mesh: &Mesh,
        section: &Section,
        axis: &Axis,
        contacts: &[Contact],
        held: &HeldDirections,
        i: usize,
        (sound, friction): (Checked, Option<FrictionLaw<Average>>),
    ) -> Checked<ContactModel> {
        let (contact, pointer) = (&contacts[i], format!("/contacts/{i}"));
        let obstacle = contact.obstacle.as_ref();
        let same = |other: &Contact| other.boundary == contact.boundary;
        if contacts[..i].iter().any(same) {
            return Err(self.report(
                format!("{pointer}/boundary"),
                Reason::NameTaken,
                &contact.boundary,
                "a boundary of its own for each contact",
                "Name parts of the boundary under /mesh/boundaries.",
            ));
        }
        let edges = self.boundary(mesh, &contact.boundary, format!("{pointer}/boundary"))?;
        self.usable_names(contact, &pointer)?;
        sound?;
        let corners: Vec<u32> = edges.iter().flat_map(|edge| [edge[0], edge[1]]).collect();
        let Faced {
            mut boundary,
            outward,
            run,
            cut,
            pair,
        } = match &contact.obstacle {
            Some(obstacle) => {
                let (run, cut) = self.facing_run(mesh, edges, held, obstacle, &pointer)?;
                let boundary =
                    ContactBoundary::new(mesh, &run.chain, run.start, held, |x| section.depth(x));
                Faced {
                    outward: boundary.normals.clone(),
                    boundary,
                    run,
                    cut,
                    pair: None,
                }
            }
            None => self.faced(mesh, section, axis, contact, edges, held, &pointer)?,
        };
        let radius = friction.as_ref().and_then(|law| law.bound.radius());
        self.sound(&boundary, axis, contact, radius, &run, &pointer)?;
        let turned = turn_normals(&mut boundary, &run, contact.used_normal(), held);
        let end_slopes = [0, run.profile.len() - 1].map(|i| run.profile[i].slope);
        let along = |(profile, turned): (&Profile, &[f64; 2])| profile.distance * turned[0];
        let profile: Vec<f64> = run.profile.iter().zip(&turned).map(along).collect();
        let direction = self.direction_of_push(contact, &boundary, &outward, &pointer)?;
        let push = match contact.direction {
            Some(_) => push_along(direction, &boundary),
            None => turned,
        };
        let nodes = [boundary.nodes[0], boundary.nodes[boundary.nodes.len() - 1]];
        Ok(ContactModel {
            name: contact.boundary.clone(),
            pointer,
            endless: obstacle
                .is_some_and(|obstacle| sliding::endless(mesh, &boundary, obstacle, &profile)),
            tool: Tool::new(contact, &boundary, direction),
            boundary,
            cut,
            profile,
            places: run.places,
            in_space: contact.gap.is_none() && obstacle.is_none_or(Obstacle::is_in_space),
            end_slopes,
            pair,
            indentation: contact.pushed(),
            push,
            along: contact
                .direction
                .and(obstacle)
                .map(|obstacle| AlongDirection {
                    direction,
                    obstacle: Arc::new(obstacle.clone()),
                }),
            outward,
            tangential_displacement: contact.tangential_displacement,
            normal: contact.used_normal(),
            condition: contact.condition,
            measured: matches!(
                obstacle,
                Some(Obstacle::Table {
                    smoothing: Some(_),
                    ..
                })
            ),
            last_points: obstacle.map_or([false; 2], |obstacle| {
                ends_inside(&corners, &nodes, obstacle)
            }),
            power: obstacle.and_then(Obstacle::power),
            friction,
        })
    }

    /// Checks the nodes that belong to two contacts. Two contacts may have a common end at a corner, where the two
    /// normals are the node's axes; no other node may belong to two contacts.
    fn shared_nodes(
        &mut self,
        model: &ContactModel,
        others: &[ContactModel],
        problem: &Problem,
    ) -> Checked {
        let places: BTreeMap<u32, usize> = model.boundary.nodes.iter().copied().zip(0..).collect();
        let mut corners: Vec<u32> = Vec::new();
        for other in others {
            for (j, node) in other.boundary.nodes.iter().enumerate() {
                let Some(&i) = places.get(node) else { continue };
                let end = |contact: &ContactModel, i: usize| {
                    (i == 0 || i + 1 == contact.boundary.nodes.len())
                        && contact.boundary.weights[i] > 0.0
                        && contact.condition != Condition::Bonded
                };
                let angle = cross(model.boundary.normals[i], other.boundary.normals[j]);
                let rigid = model.pair.is_none() && other.pair.is_none();
                let corner = rigid
                    && end(model, i)
                    && end(other, j)
                    && angle.abs() >= LEAST_ANGLE
                    && !corners.contains(node)
                    && problem.solver.algorithm != Algorithm::Thesis;
                if !corner {
                    let [x, y] = model.boundary.positions[i];
                    return Err(self.report(
                        format!("{}/boundary", model.pointer),
                        Reason::SharedNode,
                        format!("node {node} at ({x}, {y}), also in contact `{}`", other.name),
                        "contacts without common nodes, or with a common end at which two normals differ by more than 6°; none bonded, none against another body, and not with algorithm `thesis`",
                        "End one of the contacts one edge earlier with `from` or `to`.",
                    ));
                }
                corners.push(*node);
            }
        }
        Ok(())
    }

    /// Checks supports along neither normal nor tangent: the normal and the support's direction become the axes of the
    /// node, if possible. At a common end of two contacts the axes are the two normals, and a support must be along one
    /// of them.
    fn oblique_supports(
        &mut self,
        contacts: &[ContactModel],
        fixed: &BTreeMap<u32, Held>,
        problem: &Problem,
    ) -> Checked {
        let mut all = AllChecks::default();
        let oblique = oblique(contacts, fixed, &Alone::new());
        for contact in contacts {
            let boundary = &contact.boundary;
            for (i, node) in boundary.nodes.iter().enumerate() {
                let (Some(held), Some([first, second])) = (fixed.get(node), oblique.get(node))
                else {
                    continue;
                };
                let along_an_axis = [*first, *second].map(|axis| held.along(axis).is_some());
                let corner = contacts
                    .iter()
                    .filter(|other| other.boundary.nodes.contains(node))
                    .count()
                    > 1;
                let accepted = along_an_axis.contains(&true)
                    && (corner
                        || cross(*first, *second).abs() >= LEAST_ANGLE
                            && contact.condition != Condition::Bonded
                            && problem.solver.algorithm != Algorithm::Thesis);
                if !accepted {
                    let (n, [x, y]) = (boundary.normals[i], boundary.positions[i]);
                    all.fail(self.report(
                        format!("{}/boundary", contact.pointer),
                        Reason::ObliqueSupport,
                        format!("node {node} at ({x}, {y}), normal ({:.4}, {:.4}), supported along one axis", n[0], n[1]),
                        "a support along the contact's normal or tangent, or along both axes; or at more than 6° to the normal, where the contact is not bonded, ends at no other contact and the algorithm is not `thesis`",
                        "End the contact one edge before the support with `from` or `to`.",
                    ));
                }
            }
        }
        all.finish(())
    }

    /// Checks that a contact boundary can carry a pressure, and that its obstacle and friction are valid on it.
    fn sound(
        &mut self,
        boundary: &ContactBoundary,
        axis: &Axis,
        contact: &Contact,
        radius: Option<f64>,
        run: &FacingRun,
        pointer: &str,
    ) -> Checked {
        let mut all = AllChecks::default();
        let last = boundary.nodes.len() - 1;
        let at = |i: usize| boundary.positions[i];
        let end_on_axis = |i: usize| (i == 0 || i == last) && axis.holds(at(i));
        if let Some(i) = (0..=last).find(|&i| !(boundary.weights[i] > 0.0 || end_on_axis(i))) {
            all.fail(self.report(
                format!("{pointer}/boundary"),
                Reason::NoArea,
                format!(
                    "node {} at {:?} with a contact area of {:.3e}",
                    boundary.nodes[i],
                    at(i),
                    boundary.weights[i]
                ),
                "a boundary with area at every node (in axisymmetry only an end may lie on the axis)",
                "Choose another boundary; keep midsides near the middle of their sides.",
            ));
        }
        let turn = |i: &usize| boundary.corner(*i).abs();
        if let Some(corner) = (2..last).find(|i| turn(i) > SHARPEST_CORNER) {
            all.fail(self.report(
                format!("{pointer}/boundary"),
                Reason::TurnsCorner,
                format!(
                    "a boundary that turns by {:.0}° at {:?}",
                    turn(&corner).to_degrees(),
                    at(corner)
                ),
                "a boundary without corners, where the normal is not defined",
                "Give each side a contact of its own, with names under /mesh/boundaries.",
            ));
        }
        // a flat does not depend on the coordinate, and a curve in space has none
        let obstacle = contact.obstacle.as_ref();
        let curved = obstacle.is_some_and(|shape| !shape.is_straight() && !shape.is_in_space());
        let grows = |pair: &[f64]| pair[1] > pair[0];
        let falls = |pair: &[f64]| pair[1] < pair[0];
        if curved && !run.coordinate.windows(2).all(grows) && !run.coordinate.windows(2).all(falls)
        {
            all.fail(self.report(
                format!("{pointer}/obstacle/along"),
                Reason::NotMonotonic,
                "a coordinate x that both increases and decreases along the boundary",
                "a coordinate that only increases or only decreases along the boundary",
                "Write \"along\": \"arc_length\".",
            ));
        }
        all.check(self.radius(boundary, radius, pointer));
        all.finish(())
    }

    /// Checks that the nonlocal radius of a contact suits the length of its boundary.
    pub(super) fn radius(
        &mut self,
        boundary: &ContactBoundary,
        radius: Option<f64>,
        pointer: &str,
    ) -> Checked {
        let most = LARGEST_RADIUS * boundary.length();
        match radius {
            Some(radius) if radius > most => Err(self.report(
                format!("{pointer}/friction/nonlocal_radius"),
                Reason::OutOfRange,
                radius,
                format!("at most {most}, ten times the length of the contact boundary"),
                "The radius is a material length, much smaller than the contact.",
            )),
            _ => Ok(()),
        }
    }

    /// The part of a boundary that faces the obstacle, which must be one chain, and the edges inside which the obstacle
    /// ends.
    pub(super) fn facing_run(
        &mut self,
        mesh: &Mesh,
        edges: &[Edge],
        held: &HeldDirections,
        obstacle: &Obstacle,
        pointer: &str,
    ) -> Checked<(FacingRun, Vec<(Edge, f64)>)> {
        let run = &self.one_chain(mesh, edges, &format!("{pointer}/boundary"), false)?[..];
        let mut facing = obstacle::facing(mesh, run, held, obstacle);
        for [low, high] in &facing.cut {
            self.warn(
                WarningCode::ObstacleCutsEdge,
                &format!("{pointer}/obstacle"),
                format!("The obstacle ends inside the edge from {low} to {high}, which is left out of the contact. Put a grid line on the obstacle's end."),
            );
        }
        let pieces = facing.runs.len();
        if let (Some(run), 1) = (facing.runs.pop(), pieces) {
            let finite =
                |profile: &Profile| profile.distance.is_finite() && profile.slope.is_finite();
            let Some(i) = run.profile.iter().position(|profile| !finite(profile)) else {
                return Ok((run, facing.cut_edges));
            };
            return Err(self.report(
                format!("{pointer}/obstacle"),
                Reason::NotFinite,
                format!(
                    "a distance of {} at c = {}",
                    run.profile[i].distance, run.coordinate[i]
                ),
                "an obstacle at a finite distance",
                "Its numbers are too large to compute with; choose other units.",
            ));
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
        let (reason, got, expected) = match pieces {
            0 => (
                Reason::CoversNothing,
                "an obstacle that covers no edge of the boundary".to_owned(),
                "an obstacle that covers all three nodes of at least one edge",
            ),
            _ => (
                Reason::NotAChain,
                format!("an obstacle that covers {pieces} separate pieces"),
                "one piece",
            ),
        };
        Err(self.report(place, reason, got, expected, extent))
    }

    /// Checks that no support holds a contact node inside the obstacle at the end of any step, nor a bonded node away
    /// from its obstacle.
    pub(super) fn supported_contact_nodes(
        &mut self,
        contact: &ContactModel,
        steps: &[Step],
        fixed: &BTreeMap<u32, Held>,
    ) -> Checked {
        let (boundary, pointer) = (&contact.boundary, &contact.pointer);
        let ends = Level::ends_of(steps);
        let bonded = contact.condition == Condition::Bonded;
        // another body moves
        if contact.pair.is_some() {
            return Ok(());
        }
        for (i, node) in boundary.nodes.iter().enumerate() {
            let Some(held) = fixed.get(node) else {
                continue;
            };
            let (n, t, [x, y]) = (
                boundary.normals[i],
                boundary.tangent(i),
                boundary.positions[i],
            );
            let (along_n, along_t) = (held.along(n), held.along(t));
            for level in ends.iter().filter(|_| bonded) {
                let wanted = [contact.gap(i, level), contact.drag(i, level)];
                for (prescribed, wanted) in [along_n, along_t].into_iter().zip(wanted) {
                    let Some(u) = prescribed.map(|u| level.supports * u) else {
                        continue;
                    };
                    if (u - wanted).abs() > ALIGNED * u.abs().max(wanted.abs()) {
                        return Err(self.report(
                            format!("{pointer}/condition"),
                            Reason::Conflict,
                            format!("node {node} at ({x}, {y}) held at {u} by a support"),
                            format!("{wanted}, where the bonded obstacle holds it"),
                            "Use `from` or `to` to let the contact end one edge before the support, or let the support and the obstacle agree.",
                        ));
                    }
                }
            }
            let Some(u_n) = along_n else { continue };
            for level in &ends {
                let (u_n, gap) = (level.supports * u_n, contact.gap(i, level));
                let free = contact.condition == Condition::None;
                if !free && u_n > gap + ALIGNED * gap.abs() {
                    return Err(self.report(
                        format!("{pointer}/indentation"),
                        Reason::Impossible,
                        format!("node {node} at ({x}, {y}) held at u_n = {u_n} by a support, {} inside the obstacle", u_n - gap),
                        "supports that leave the body outside the obstacle",
                        "Use `from` or `to` to let the obstacle end before the support.",
                    ));
                }
            }
        }
        Ok(())
    }

    /// Warns of contacts whose results may be inaccurate.
    pub(super) fn warn_about_contacts(&mut self, contacts: &[ContactModel]) {
        for contact in contacts {
            self.corners(contact);
            self.coarseness(contact);
        }
    }

    /// Warns of corners between two edges, where the normal is not unique.
    fn corners(&mut self, contact: &ContactModel) {
        let boundary = &contact.boundary;
        for corner in 0..boundary.nodes.len() {
            let angle = boundary.corner(corner).abs();
            if angle > SHARPEST_TURN {
                let ([x, y], angle) = (boundary.positions[corner], angle.to_degrees());
                self.warn(
                    WarningCode::ContactTurns,
                    &format!("{}/boundary", contact.pointer),
                    format!("The contact boundary turns by {angle:.0}° at ({x}, {y}), where the mean of the two normals is used. Give each side a contact of its own, or mesh the rounding."),
                );
                return;
            }
        }
    }

    fn coarseness(&mut self, contact: &ContactModel) {
        let law = contact.friction.as_ref();
        let Some(radius) = law.and_then(|law| law.bound.averaged_over()) else {
            return;
        };
        let boundary = &contact.boundary;
        let length = |edge| boundary.edge_arc(edge)[1] - boundary.edge_arc(edge)[0];
        let shortest = (0..boundary.edge_count())
            .map(length)
            .fold(f64::INFINITY, f64::min);
        if shortest > radius {
            self.warn(
                WarningCode::MeshTooCoarseForRadius,
                &format!("{}/friction/nonlocal_radius", contact.pointer),
                format!("The shortest contact edge ({shortest:.3e}) is longer than the nonlocal radius ({radius}): the averaging is not resolved. Refine the mesh towards the ends of the contact."),
            );
        }
    }
}

/// The nodes that supports hold along one direction only, each with this direction and its error.
fn along_one_direction(fixed: &BTreeMap<u32, Held>) -> HeldDirections {
    let one = |(node, held): (&u32, &Held)| match *held {
        Held::Along {
            direction, error, ..
        } => Some((*node, (direction, error))),
        Held::Both(_) => None,
    };
    fixed.iter().filter_map(one).collect()
}

/// Divides sides of contacts where their obstacles end, so that the ends are at nodes and no edge is left out.
/// `contacts`: each with whether its obstacle is sound; the others are skipped, since the problem is refused anyway.
pub(super) fn put_nodes_at_ends<'a>(
    mesh: &mut Mesh,
    contacts: impl Iterator<Item = (&'a Contact, bool)>,
    steps: &[Step],
) {
    /// The largest number of ends of one obstacle inside edges: its two ends, and the places where a curve is hidden.
    const MOST_ENDS: usize = 16;
    let factors = steps.iter().map(|step| step.indentation.abs());
    let most = factors.fold(1.0, f64::max);
    for (contact, _) in contacts.filter(|(_, sound)| *sound) {
        for _ in 0..MOST_ENDS {
            let Some(edges) = mesh.boundaries.get(&contact.boundary) else {
                break;
            };
            let runs = mesh::runs(edges);
            let [run] = &runs[..] else { break };
            // one at a time: an edge may have two, and of a divided edge the places are new
            // a friction bound that is given acts whether or not the body touches
            let everywhere = contact
                .friction
                .as_ref()
                .is_some_and(|law| law.bound.is_some());
            // how far a load pushes is unknown
            let deepest = if everywhere || contact.is_tool() {
                f64::INFINITY
            } else {
                most * contact.indentation.abs()
            };
            let Some(shape) = &contact.obstacle else {
                break;
            };
            let ends = obstacle::ends_inside_edges(mesh, run, shape, deepest);
            let mut ends = ends.into_iter();
            if !ends.any(|(edge, xi)| mesh.divide_side(edge, xi)) {
                break;
            }
        }
    }
}

/// The contact nodes with oblique axes: where two contacts meet that both touch, their normals; else the normal and the
/// direction of a support that is neither normal nor tangent.
pub(super) fn oblique(
    contacts: &[ContactModel],
    fixed: &BTreeMap<u32, Held>,
    alone: &Alone,
) -> BTreeMap<u32, [[f64; 2]; 2]> {
    let mut first: BTreeMap<u32, [f64; 2]> = BTreeMap::new();
    let mut axes = BTreeMap::new();
    for (c, contact) in contacts.iter().enumerate() {
        let boundary = &contact.boundary;
        for (&node, &n) in boundary.nodes.iter().zip(&boundary.normals) {
            if alone.get(&node).is_some_and(|owner| *owner != c) {
                continue;
            }
            if let Some(other) = first.insert(node, n) {
                axes.insert(node, [other, n]);
            }
        }
    }
    for (node, n) in first {
        if let Some(held @ Held::Along { direction, .. }) = fixed.get(&node)
            && held.along(n).is_none()
            && held.along([n[1], -n[0]]).is_none()
        {
            axes.entry(node).or_insert([n, *direction]);
        }
    }
    axes
}

fn cross(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

/// Turns the normals of the boundary to those of the obstacle, if the contact uses the obstacle's normals. Returns the
/// components of a unit push along normal and tangent at each node. The obstacle's normal is m = (n − p′ t)/√(1 + p′²),
/// with the slope p′ of the profile; the push is along −n.
fn turn_normals(
    boundary: &mut ContactBoundary,
    run: &FacingRun,
    normal: NormalOf,
    held: &HeldDirections,
) -> Vec<[f64; 2]> {
    let mut push = vec![[1.0, 0.0]; boundary.nodes.len()];
    if normal != NormalOf::Obstacle {
        return push;
    }
    for (i, push) in push.iter_mut().enumerate() {
        // where a support holds the tangent, what its direction may be off by is no slope
        let off = held.get(&boundary.nodes[i]).map(|(_, error)| *error);
        let slope = match (run.profile[i].slope, off) {
            (slope, Some(error)) if slope.abs() <= error.clamp(ALIGNED, NO_SLOPE) => 0.0,
            (slope, _) => slope,
        };
        let cosine = 1.0 / slope.hypot(1.0);
        let (n, t) = (boundary.normals[i], boundary.tangent(i));
        // + 0.0 turns −0 into 0, so that an axis-parallel normal is exactly that
        boundary.normals[i] = [0, 1].map(|a| cosine * (n[a] - slope * t[a]) + 0.0);
        *push = [cosine, -cosine * slope + 0.0];
    }
    push
}

/// The components of a unit push along a direction, against the contact's normal m and along its t, at each node.
fn push_along([x, y]: [f64; 2], boundary: &ContactBoundary) -> Vec<[f64; 2]> {
    let length = x.hypot(y);
    let parts = |i: usize| {
        let (m, t) = (boundary.normals[i], boundary.tangent(i));
        // + 0.0 turns −0 into 0
        [
            -(x * m[0] + y * m[1]) / length + 0.0,
            (x * t[0] + y * t[1]) / length + 0.0,
        ]
    };
    (0..boundary.nodes.len()).map(parts).collect()
}
/// Whether an obstacle that is given by points ends at these two nodes, which are the ends of a contact: the boundary goes
/// on there. `corners`: the ends of all edges of the boundary.
fn ends_inside(corners: &[u32], nodes: &[u32; 2], obstacle: &Obstacle) -> [bool; 2] {
    let by_points = matches!(obstacle, Obstacle::Table { .. } | Obstacle::Polyline { .. });
    let sides = |node: u32| corners.iter().filter(|corner| **corner == node).count();
    nodes.map(|node| by_points && sides(node) > 1)
}
