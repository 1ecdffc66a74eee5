//! Whether supports and contacts hold every part of the body against rigid motions.

mod parts;
mod words;

use std::collections::{BTreeMap, BTreeSet};

pub use parts::Hold;

use super::checks::{ALIGNED, Checks};
use super::contact_model::ContactModel;
use super::supports::Held;
use crate::elasticity::Section;
use crate::error::{AllChecks, Checked, Reason, Refused};
use crate::friction::{Average, FrictionLaw};
use crate::mesh::Mesh;
use crate::problem::Condition;
use parts::{Free, MOST_HINGED, MOST_IN_MECHANISMS, Motion, Part, Parts, Unheld};

impl Checks {
    /// Checks that every part of the body is held against rigid motions, by supports, springs or contacts (if they
    /// touch). Returns whether a contact is needed for that.
    pub(super) fn freedom(
        &mut self,
        mesh: &Mesh,
        section: &Section,
        fixed: &BTreeMap<u32, Held>,
        springs: &[Hold],
        contacts: &[ContactModel],
    ) -> Checked<bool> {
        let mut held = directions(fixed);
        held.extend(springs);
        let parts = Parts::new(mesh, section.axisymmetric());
        if parts.unheld(&held).is_empty() {
            return Ok(false);
        }
        held.extend(contacts.iter().flat_map(hindered));
        let mut all = AllChecks::default();
        for unheld in parts.unheld(&held) {
            all.fail(self.unheld(&parts, &unheld, contacts.is_empty()));
        }
        all.finish(true)
    }

    /// Checks that a load presses a body which along some motion is held by contact on one side only: pushing an
    /// obstacle against the body would only move it away. `loads`: the forces at every node.
    pub(super) fn pressed(
        &mut self,
        mesh: &Mesh,
        section: &Section,
        fixed: &BTreeMap<u32, Held>,
        springs: &[Hold],
        contacts: &[ContactModel],
        loads: &[[f64; 2]],
    ) -> Checked<()> {
        let bonded = |contact: &&ContactModel| contact.condition == Condition::Bonded;
        let glued = contacts.iter().filter(bonded).flat_map(hindered);
        let glued: Vec<Hold> = glued.chain(springs.iter().copied()).collect();
        for motion in free_motions(mesh, section, fixed, &glued) {
            let moves: BTreeMap<u32, [f64; 2]> = motion.moves.iter().copied().collect();
            if !held_on_one_side(&moves, contacts) || works(&moves, loads) {
                continue;
            }
            let words = &motion.words;
            return Err(self.report(
                "/supports",
                Reason::FreeBody,
                format!("a body that can move away {words} from the contact that holds it on one side only, with nothing to press it there"),
                "supports or contacts against every rigid motion, or a load that presses the body against its contact",
                format!("Pushing the obstacle against the body only moves the body away. Add a support with {}.", towards(words)),
            ));
        }
        Ok(())
    }

    fn unheld(&mut self, parts: &Parts<'_>, unheld: &Unheld, without_contacts: bool) -> Refused {
        let mesh = parts.mesh;
        let free = match unheld {
            Unheld::Free(free) => free,
            Unheld::TooMany(count, node) => {
                let [x, y] = mesh.nodes[*node as usize];
                return self.report(
                    "/mesh",
                    Reason::TooMany,
                    format!("{count} parts that are connected at single nodes only and not all held (one of their nodes is {node}, at ({x}, {y}))"),
                    format!("at most {MOST_HINGED} such parts in one mechanism, and {MOST_IN_MECHANISMS} in total"),
                    "Elements that share a side (all three nodes of it) form one part: join them along sides, or support each part.",
                );
            }
        };
        let (words, node, turns) = in_words(parts, free);
        let Free {
            number,
            together,
            more,
            ..
        } = free;
        let count = parts.parts.len();
        let [x, y] = mesh.nodes[node as usize];
        let what = match (count, together) {
            (1, _) => "a body".to_owned(),
            (_, 1) => format!("part {number} of {count} of the body"),
            _ => format!("{together} of {count} parts of the body, hinged to one another,"),
        };
        let more = match more {
            0 => String::new(),
            1 => "; and 1 more motion of parts hinged to it".to_owned(),
            more => format!("; and {more} more motions of parts hinged to it"),
        };
        let mut hint = match (turns, words.contains(" and ")) {
            (false, false) => format!("Add a support with {}.", towards(&words)),
            (true, false) => {
                "Add a support at another place, along a direction that does not point to the centre of the rotation."
                    .to_owned()
            }
            _ => "Add supports with `ux` and `uy`; against rotation at two places.".to_owned(),
        };
        if count > 1 {
            hint.push_str(
                " Parts hold each other along a side that they share with all three nodes; at a single node they are hinged, and without common nodes they are separate.",
            );
        }
        hint.push_str(&self.hint_to_merge(mesh));
        if !without_contacts {
            hint.push_str(" A contact holds the body along its normal, and along its tangent if it has friction or is bonded.");
        }
        self.report(
            "/supports",
            Reason::FreeBody,
            format!("{what} free to move: {words}, e.g. node {node} at ({x}, {y}){more}"),
            "supports or contacts against every rigid motion",
            hint,
        )
    }
}

/// The free motions in words that follow "free to move"; a node that moves most by one of the motions; whether the
/// motions are only a rotation.
fn in_words(parts: &Parts<'_>, free: &Free) -> (String, u32, bool) {
    let (words, motion, turns) = parts.words(&free.moved, &free.motions);
    let moved = |node: &u32| {
        let place = parts.mesh.nodes[*node as usize];
        let [x, y] = free.moved.displacement(place, &motion);
        x.hypot(y)
    };
    let nodes = free.moved.nodes.iter();
    let node = nodes.max_by(|a, b| moved(a).total_cmp(&moved(b)));
    (words, node.copied().unwrap_or_default(), turns)
}

/// Whether a motion moves all nodes of contacts away from their obstacles, or all towards their obstacles, and none
/// along.
fn held_on_one_side(moves: &BTreeMap<u32, [f64; 2]>, contacts: &[ContactModel]) -> bool {
    let (mut away, mut towards, mut tangential) = (0.0f64, 0.0f64, 0.0f64);
    for contact in contacts {
        let boundary = &contact.boundary;
        for (i, node) in boundary.nodes.iter().enumerate() {
            let facing = contact.pair.as_ref().and_then(|pair| pair.nearest(i));
            let facing = facing.and_then(|node| moves.get(&node));
            let own = moves.get(node);
            if own.is_none() && facing.is_none() {
                continue;
            }
            let [own, facing] = [own, facing].map(|moved| moved.copied().unwrap_or_default());
            let moved = [own[0] - facing[0], own[1] - facing[1]];
            let along = |[x, y]: [f64; 2]| x * moved[0] + y * moved[1];
            let error = boundary.normal_errors[i] * moved[0].hypot(moved[1]);
            if contact.condition == Condition::Unilateral {
                let normal = along(boundary.normals[i]);
                if normal.abs() > error {
                    (away, towards) = (away.max(-normal), towards.max(normal));
                }
            }
            // friction may hold it, also where there is no obstacle
            let along_surface = along(boundary.tangent(i)).abs();
            if along_surface > error {
                tangential = tangential.max(along_surface);
            }
        }
    }
    away.max(towards) > ALIGNED && away.min(towards) <= ALIGNED && tangential <= ALIGNED
}

/// Whether loads do work along a motion.
fn works(moves: &BTreeMap<u32, [f64; 2]>, loads: &[[f64; 2]]) -> bool {
    let (mut power, mut most) = (0.0f64, 0.0f64);
    for (node, [x, y]) in moves {
        let [p, q] = loads[*node as usize];
        power += p * x + q * y;
        most += (p * x).abs() + (q * y).abs();
    }
    power.abs() > ALIGNED * most
}

/// The support that prevents the translation described by `words`.
fn towards(words: &str) -> &'static str {
    match words {
        "along x" => "`ux`",
        "along y" | "along the axis" => "`uy`",
        _ => "`ux` or `uy`",
    }
}

/// A rigid motion of a part of the body that neither the supports nor the given holds prevent, in words, and a node
/// that moves.
pub(super) fn motion_left(
    mesh: &Mesh,
    section: &Section,
    fixed: &BTreeMap<u32, Held>,
    hindered: &[Hold],
) -> Option<(String, u32)> {
    let mut held = directions(fixed);
    held.extend(hindered);
    let parts = Parts::new(mesh, section.axisymmetric());
    match parts.unheld(&held).into_iter().next()? {
        Unheld::Free(free) => {
            let (words, node, _) = in_words(&parts, &free);
            Some((words, node))
        }
        // only with contacts that do not touch: the model was examined with all of them
        Unheld::TooMany(_, node) => Some(("at single nodes that join its parts".to_owned(), node)),
    }
}

/// A rigid motion of a part of the body, or of several hinged parts as one.
#[derive(Clone, Debug)]
pub struct RigidMotion {
    /// The motion in words, after "free to move".
    pub words: String,
    /// The nodes that move, with their displacements: of length 1 in a translation; in a rotation, of length 1 at the
    /// node farthest from the centre of the part.
    pub moves: Vec<(u32, [f64; 2])>,
    /// In a rotation, the distance of the farthest node from the centre (length): the work of a force in the motion,
    /// times `arm`, is the force's moment.
    pub arm: Option<f64>,
}

/// All rigid motions that neither the supports nor the given holds prevent, except those that bend hinges.
pub(super) fn free_motions(
    mesh: &Mesh,
    section: &Section,
    fixed: &BTreeMap<u32, Held>,
    hindered: &[Hold],
) -> Vec<RigidMotion> {
    let mut held = directions(fixed);
    held.extend(hindered);
    let parts = Parts::new(mesh, section.axisymmetric());
    let (rows, mechanisms) = parts.rows(&held);
    let mut found = Vec::new();
    for together in mechanisms {
        let nodes = together
            .iter()
            .flat_map(|p| &parts.parts[*p as usize].nodes);
        let nodes: BTreeSet<u32> = nodes.copied().collect();
        let whole = Part::new(mesh, nodes.into_iter().collect());
        for motion in parts.as_one(&whole, &together, &rows, whole.tolerance) {
            let motion: Motion = [motion[0], motion[1], motion[2]];
            let (words, ..) = parts.words(&whole, &[motion]);
            let turn = motion[2].abs();
            let length = if turn > 1e-6 {
                turn
            } else {
                motion[0].hypot(motion[1])
            };
            let motion = motion.map(|m| m / length);
            let moved = |node: &u32| {
                let place = mesh.nodes[*node as usize];
                (*node, whole.displacement(place, &motion))
            };
            found.push(RigidMotion {
                words,
                moves: whole.nodes.iter().map(moved).collect(),
                arm: (turn > 1e-6).then_some(whole.size),
            });
        }
    }
    found
}

/// The nodes that supports hold, with the directions.
fn directions(fixed: &BTreeMap<u32, Held>) -> Vec<Hold> {
    let mut held = Vec::new();
    for (&node, what) in fixed {
        match *what {
            Held::Along {
                direction, error, ..
            } => held.push(Hold {
                node,
                direction,
                error,
                facing: None,
            }),
            Held::Both(_) => held.extend([[1.0, 0.0], [0.0, 1.0]].map(|direction| Hold {
                node,
                direction,
                error: 0.0,
                facing: None,
            })),
        }
    }
    held
}

/// The motions of a contact's nodes that the contact prevents while it touches.
fn hindered(contact: &ContactModel) -> Vec<Hold> {
    let holds = |law: &FrictionLaw<Average>| law.bound.holds();
    let normal = contact.condition != Condition::None;
    let tangent =
        contact.condition == Condition::Bonded || contact.friction.as_ref().is_some_and(holds);
    let boundary = &contact.boundary;
    let mut hindered = Vec::new();
    for i in 0..boundary.nodes.len() {
        if normal {
            hindered.push(Hold::along_normal(contact, i));
        }
        if tangent {
            hindered.push(Hold::along_tangent(contact, i));
        }
    }
    hindered
}
