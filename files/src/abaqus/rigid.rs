//! Rigid bodies of a deck: their elements and surfaces, and the rows of `*BOUNDARY` that move them.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::contact_parts::{Analytical, Held, MadeOf, RigidBody};
use super::names::{Key, Meant, Names};
use super::part::Numbered;
use super::scope::Kind;
use super::tool::{Piece, Point};
use super::written::{Name, Sides, Target};
use solver::mesh::{NO_NODE, RawMesh};
use solver::solution::{Warning, WarningCode};

/// The rigid bodies of a deck, and their surfaces.
#[derive(Default)]
pub(super) struct Tools {
    pub(super) bodies: Vec<Body>,
    /// By name of a rigid surface in the mesh: the number of its rigid body, and its pieces, with the elastic body on
    /// their left.
    pub(super) by_surface: BTreeMap<String, (usize, Vec<Piece>)>,
    /// The places of plane elements of rigid bodies, which are not part of the elastic body.
    pub(super) elements: BTreeSet<u32>,
    /// The numbers of the plane elements of rigid bodies, in words, for a warning.
    pub(super) left_out: String,
    /// The places of all elements of rigid bodies among all elements.
    pub(super) members: BTreeSet<u32>,
    /// Rows of `*BOUNDARY` for reference nodes, in the order of the deck.
    pub(super) rows: Vec<Moving>,
    /// By the name of a set that `*CLOAD` names: its reference nodes, if it has any, and whether it has no other nodes.
    pub(super) loaded: BTreeMap<String, (BodyNodes, bool)>,
}

/// A rigid body.
pub(super) struct Body {
    pub(super) line: u64,
    /// The reference node, which moves the rigid body; `None` if the deck does not name a single node.
    pub(super) reference: Option<u32>,
    /// The node whose displacements are the rotations of the rigid body; `None` if the deck does not name a single node.
    pub(super) rotation: Option<u32>,
    /// Whether the rigid body shares nodes with the elastic body.
    pub(super) attached: bool,
}

/// The reference and rotation nodes in a row: for each the number of its rigid body, and whether it is the rotation node.
type BodyNodes = Arc<[(usize, bool)]>;

/// A row of `*BOUNDARY` for reference nodes.
pub(super) struct Moving {
    pub(super) row: Held,
    pub(super) on: BodyNodes,
    /// Whether the row holds no other nodes than reference nodes.
    pub(super) alone: bool,
}

/// The largest number of points of an obstacle.
pub(super) const MOST_POINTS: usize = 10_000;

impl Tools {
    /// Finds the reference nodes in sets of nodes that bear forces.
    pub(super) fn note_loaded<'a>(
        &mut self,
        names: impl Iterator<Item = &'a String>,
        sets: &BTreeMap<String, Vec<u32>>,
    ) {
        let single = single_nodes(&self.bodies);
        if single.is_empty() {
            return;
        }
        for name in names {
            if self.loaded.contains_key(name) {
                continue;
            }
            let nodes = sets.get(name).map_or(&[][..], |nodes| nodes);
            let on = nodes.iter().filter_map(|node| single.get(node).copied());
            let on: BodyNodes = on.collect();
            let alone = on.len() == nodes.len();
            self.loaded
                .insert(name.clone(), (on, alone && !nodes.is_empty()));
        }
    }

    /// Whether only reference nodes are in a set that bears a force.
    pub(super) fn bears_alone(&self, name: &str) -> bool {
        self.loaded.get(name).is_some_and(|(_, alone)| *alone)
    }

    /// The warning that names the elements of rigid bodies, which are left out of the mesh.
    pub(super) fn warning(&self) -> Option<Warning> {
        let count = self.elements.len();
        (count > 0).then(|| Warning {
            code: WarningCode::RigidElementsLeftOut,
            pointer: String::new(),
            message: format!(
                "{count} elements of a *RIGID BODY are not part of the elastic body and are left out: {}.",
                self.left_out
            ),
        })
    }
}

/// The parts of a mesh in which rigid bodies are searched.
pub(super) struct Search<'a> {
    pub(super) names: &'a Names<'a>,
    pub(super) raw: &'a RawMesh,
    pub(super) lines: &'a [[u32; 3]],
    pub(super) numbered: &'a [Numbered],
    /// The elements of sets, by their places in `numbered`.
    pub(super) elements: &'a BTreeMap<Key, Vec<u32>>,
}

impl Search<'_> {
    /// Finds the rigid bodies and their surfaces. `bodies`, `analytical`, `held`: definitions of rigid bodies,
    /// analytical surfaces and rows of `*BOUNDARY`, each with the place of its scope.
    pub(super) fn tools(
        &self,
        bodies: &[(usize, RigidBody)],
        analytical: &[(usize, Name, Analytical)],
        held: Vec<(usize, Held)>,
    ) -> Tools {
        let mut tools = Tools::default();
        if bodies.is_empty() {
            return tools;
        }
        // by the place of an element in `numbered`
        let mut owner: BTreeMap<u32, usize> = BTreeMap::new();
        let mut inside: BTreeMap<u32, usize> = BTreeMap::new();
        for (number, (scope, body)) in bodies.iter().enumerate() {
            match &body.made_of {
                MadeOf::Surface(word) => {
                    let is = |scope: usize, name: &Name| {
                        analytical.iter().any(|(s, n, _)| *s == scope && n == name)
                    };
                    let key = self.names.named(*scope, word, is);
                    let found = key.and_then(|(scope, name)| {
                        let mut all = analytical.iter();
                        let (.., surface) = all.find(|(s, n, _)| *s == scope && *n == name)?;
                        Some((self.names.full(scope, &name), surface.pieces.clone()))
                    });
                    if let Some((name, pieces)) = found {
                        tools.by_surface.insert(name, (number, pieces));
                    }
                }
                MadeOf::Elements(word) => {
                    let target = Target::Set(word.clone());
                    for element in &*self.elements_of(*scope, &target) {
                        owner.insert(*element, number);
                    }
                }
                MadeOf::Nodes(word) => {
                    for node in &*self.nodes_of(*scope, &Target::Set(word.clone())) {
                        // a node of several bodies counts for the first
                        inside.entry(*node).or_insert(number);
                    }
                }
            }
        }
        for (place, number) in self.held_by_nodes(&inside) {
            owner.entry(place).or_insert(number);
        }
        let elastic = self.elastic(&owner);
        let attached = self.attached(&owner, &inside, &elastic);
        let node = |scope: usize, target: &Target| match self.nodes_of(scope, target)[..] {
            [node] => Some(node),
            _ => None,
        };
        let known = |(number, (scope, body)): (usize, &(usize, RigidBody))| {
            let reference = node(*scope, &body.reference);
            let rotation = body.rotation.as_ref().and_then(|r| node(*scope, r));
            let shared = |node: Option<u32>| node.is_some_and(|node| elastic[node as usize]);
            Body {
                line: body.line,
                reference,
                rotation,
                attached: attached.contains(&number) || shared(reference) || shared(rotation),
            }
        };
        tools.bodies = bodies.iter().enumerate().map(known).collect();
        for (scope, place) in self.names.scopes.iter().enumerate() {
            for (name, surface) in &place.surfaces {
                if let Some(found) = self.rigid_sides(scope, &surface.sides, &owner) {
                    tools.by_surface.insert(self.names.full(scope, name), found);
                }
            }
        }
        tools.rows = self.rows(&tools.bodies, held);
        for place in owner.keys() {
            if let Numbered::Plane(place) = self.numbered[*place as usize] {
                tools.elements.insert(place);
            }
        }
        tools.members = owner.into_keys().collect();
        tools
    }

    fn elements_of(&self, scope: usize, target: &Target) -> Cow<'_, [u32]> {
        match self.names.meant(Kind::Elements, scope, target) {
            Some(Meant::Label(scope, label)) => {
                let place = self.names.scopes[scope].place(Kind::Elements, label);
                place.into_iter().collect()
            }
            Some(Meant::Set(key)) => members(self.elements.get(&key)),
            None => Cow::default(),
        }
    }

    fn nodes_of(&self, scope: usize, target: &Target) -> Cow<'_, [u32]> {
        match self.names.meant(Kind::Nodes, scope, target) {
            Some(Meant::Label(scope, label)) => {
                let place = self.names.scopes[scope].place(Kind::Nodes, label);
                place.into_iter().collect()
            }
            Some(meant) => members(self.raw.node_sets.get(&self.names.of(&meant))),
            None => Cow::default(),
        }
    }

    /// The nodes of an element.
    fn corners(&self, place: u32) -> Vec<u32> {
        let nodes: Vec<u32> = match self.numbered[place as usize] {
            Numbered::Plane(place) => self.raw.elements[place as usize].iter().copied().collect(),
            Numbered::Line(place) => self.lines[place as usize].to_vec(),
            Numbered::Other => Vec::new(),
        };
        nodes.into_iter().filter(|node| *node != NO_NODE).collect()
    }

    /// The elements whose nodes all belong to one rigid body.
    fn held_by_nodes(&self, inside: &BTreeMap<u32, usize>) -> Vec<(u32, usize)> {
        if inside.is_empty() {
            return Vec::new();
        }
        let body = |place: u32| {
            let nodes = self.corners(place);
            let first = *inside.get(nodes.first()?)?;
            let all = nodes.iter().all(|node| inside.get(node) == Some(&first));
            all.then_some((place, first))
        };
        (0..self.numbered.len() as u32).filter_map(body).collect()
    }

    /// Whether each node belongs to the elastic body, that is to plane elements of no rigid body.
    fn elastic(&self, owner: &BTreeMap<u32, usize>) -> Vec<bool> {
        let mut elastic = vec![false; self.raw.nodes.len()];
        for (place, kind) in self.numbered.iter().enumerate() {
            if matches!(kind, Numbered::Plane(_)) && !owner.contains_key(&(place as u32)) {
                for node in self.corners(place as u32) {
                    elastic[node as usize] = true;
                }
            }
        }
        elastic
    }

    /// The numbers of the rigid bodies that share nodes with the elastic body.
    fn attached(
        &self,
        owner: &BTreeMap<u32, usize>,
        inside: &BTreeMap<u32, usize>,
        elastic: &[bool],
    ) -> BTreeSet<usize> {
        let shares = |place: &u32| self.corners(*place).iter().any(|n| elastic[*n as usize]);
        let by_elements = owner.iter().filter(|(place, _)| shares(place));
        let by_nodes = inside.iter().filter(|(node, _)| elastic[**node as usize]);
        let all = by_elements.map(|(_, number)| *number);
        all.chain(by_nodes.map(|(_, number)| *number)).collect()
    }

    /// The rigid body that all sides of a surface belong to, and the sides; none if they do not belong to one body.
    fn rigid_sides(
        &self,
        scope: usize,
        sides: &[(Target, Sides)],
        owner: &BTreeMap<u32, usize>,
    ) -> Option<(usize, Vec<Piece>)> {
        let mut body = None;
        let mut pieces = Vec::new();
        for (target, side) in sides {
            for place in &*self.elements_of(scope, target) {
                let number = *owner.get(place)?;
                if body.is_some_and(|body| body != number) || pieces.len() > MOST_POINTS {
                    return None;
                }
                body = Some(number);
                pieces.push(self.side_of(*place, *side)?);
            }
        }
        body.map(|body| (body, pieces))
    }

    /// A side of an element, in the direction that has the element on the right; or a rigid line.
    fn side_of(&self, place: u32, side: Sides) -> Option<Piece> {
        let at = |node: u32| self.raw.nodes.get(node as usize).copied();
        let (element, side) = match (self.numbered[place as usize], side) {
            (Numbered::Line(place), Sides::OfLine { .. } | Sides::Outer) => {
                let [a, b, _] = self.lines[place as usize];
                let piece = Piece::Line([at(a)?, at(b)?]);
                return Some(match side {
                    Sides::OfLine { left: false } => piece.reversed(),
                    _ => piece,
                });
            }
            (Numbered::Plane(place), Sides::Number(side)) => {
                (self.raw.elements.get(place as usize)?, side)
            }
            _ => return None,
        };
        let corners = element.family().corners();
        if side > corners {
            return None;
        }
        let all: Option<Vec<Point>> = (0..corners).map(|k| at(element[k])).collect();
        let all = all?;
        let area: f64 = (0..corners)
            .map(|k| {
                let ([x0, y0], [x1, y1]) = (all[k], all[(k + 1) % corners]);
                x0 * y1 - x1 * y0
            })
            .sum();
        let (a, b) = (all[side - 1], all[side % corners]);
        let piece = match at(element[corners + side - 1]) {
            Some(middle) => Piece::side([a, middle, b]),
            None => Piece::Line([a, b]),
        };
        // counter-clockwise: the element is on the left of its sides
        Some(if area > 0.0 { piece.reversed() } else { piece })
    }

    /// The rows that move reference nodes.
    fn rows(&self, bodies: &[Body], mut held: Vec<(usize, Held)>) -> Vec<Moving> {
        let single = single_nodes(bodies);
        held.sort_by_key(|(_, row)| row.line);
        // many rows may name the same large set
        let mut known: BTreeMap<(usize, Target), (BodyNodes, bool)> = BTreeMap::new();
        let mut rows = Vec::new();
        for (scope, row) in held {
            let of_target = known.entry((scope, row.target.clone()));
            let (on, alone) = of_target.or_insert_with_key(|(scope, target)| {
                let nodes = self.nodes_of(*scope, target);
                let on = nodes.iter().filter_map(|node| single.get(node).copied());
                let on: BodyNodes = on.collect();
                let alone = on.len() == nodes.len();
                (on, alone)
            });
            if !on.is_empty() {
                let (on, alone) = (on.clone(), *alone);
                rows.push(Moving { row, on, alone });
            }
        }
        rows
    }
}

/// The reference and rotation nodes of rigid bodies: of each the number of its body, and whether it is the rotation node.
fn single_nodes(bodies: &[Body]) -> BTreeMap<u32, (usize, bool)> {
    let mut single: BTreeMap<u32, (usize, bool)> = BTreeMap::new();
    for (number, body) in bodies.iter().enumerate() {
        single.extend(body.reference.map(|node| (node, (number, false))));
        single.extend(body.rotation.map(|node| (node, (number, true))));
    }
    single
}

/// The members of a set; none of a set that there is not.
fn members(set: Option<&Vec<u32>>) -> Cow<'_, [u32]> {
    set.map_or_else(Cow::default, |set| Cow::from(&set[..]))
}
