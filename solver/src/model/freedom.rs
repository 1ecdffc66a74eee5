//! Whether supports and contacts hold every part of the body against rigid motions.
//!
//! Elements that share a side form one rigid part; parts that share only single nodes are hinged there. Each part has
//! two translations and a rotation about its centre, scaled by its size, so that all three displace its farthest node
//! by 1 and no unit of length matters; in axisymmetry it has the translation along the axis only. What is held, and
//! every hinge, is a row of coefficients of these motions. The rows of a part are made orthonormal one by one; a part
//! with three of them is held, and holds its neighbours at the nodes that they share. What remains are parts alone,
//! with at most two rows, and mechanisms of hinged parts: their motions are the null space of all their rows, by
//! elimination with full pivoting.

use std::collections::{BTreeMap, BTreeSet};

use super::checks::{ALIGNED, Checks};
use super::contact_model::ContactModel;
use super::supports::Held;
use crate::elasticity::Section;
use crate::error::{AllChecks, Checked, Reason, Refused};
use crate::friction::{Average, FrictionLaw};
use crate::mesh::Mesh;
use crate::problem::Condition;

/// Parts in one mechanism that are examined: the elimination is cubic in them.
const MOST_HINGED: usize = 64;

/// Parts in all mechanisms together.
const MOST_IN_MECHANISMS: usize = 10 * MOST_HINGED;

/// Rows for each part of a mechanism. Parts that do not overlap share nodes in at most 3 k pairs, and a pair gives
/// four rows at most; each part has two of its own.
const MOST_ROWS: usize = 14;

/// A node and a direction (unit vector) it is held along.
pub(super) type Hold = (u32, [f64; 2]);

/// A rigid motion that nothing prevents.
pub(super) struct FreeMotion {
    /// The motion in words, after "free to move".
    pub words: String,
    /// A node that it moves.
    pub node: u32,
    /// The number of the part that moves, of how many.
    part: [usize; 2],
    /// Parts that move as one body.
    together: usize,
    /// Further motions of the same parts.
    more: usize,
    /// The motion is a rotation.
    turns: bool,
}

/// What is found of parts that nothing holds.
enum Unheld {
    Motion(FreeMotion),
    /// This many hinged parts, more than are examined; and one of their nodes.
    TooMany(usize, u32),
}

impl Checks {
    /// Every part of the body must be held against rigid motions, by supports or by contacts (if they touch).
    /// True if a contact is needed for that.
    pub(super) fn freedom(
        &mut self,
        mesh: &Mesh,
        section: &Section,
        fixed: &BTreeMap<u32, Held>,
        contacts: &[ContactModel],
    ) -> Checked<bool> {
        let mut held = directions(fixed);
        let parts = Parts::new(mesh, section.axisymmetric());
        if parts.unheld(&held).is_empty() {
            return Ok(false);
        }
        held.extend(contacts.iter().flat_map(hindered));
        let mut all = AllChecks::default();
        for unheld in parts.unheld(&held) {
            all.fail(self.unheld(mesh, &unheld, contacts.is_empty()));
        }
        all.finish(true)
    }

    fn unheld(&mut self, mesh: &Mesh, unheld: &Unheld, without_contacts: bool) -> Refused {
        let motion = match unheld {
            Unheld::Motion(motion) => motion,
            Unheld::TooMany(count, node) => {
                let [x, y] = mesh.nodes[*node as usize];
                return self.report(
                    "/mesh",
                    Reason::TooMany,
                    format!("{count} parts that hang together at single nodes only, e.g. at node {node} ({x}, {y}), and are not held one by one"),
                    format!("at most {MOST_HINGED} of them in one mechanism, and {MOST_IN_MECHANISMS} in all"),
                    "Elements that share a side (all three nodes of it) form one part: join them along sides, or support each part.",
                );
            }
        };
        let FreeMotion {
            words,
            node,
            part: [number, count],
            together,
            more,
            turns,
        } = motion;
        let [x, y] = mesh.nodes[*node as usize];
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
            (false, false) => format!("Add a support with {}.", towards(words)),
            (true, false) => {
                "Add a support at another place, along a direction that does not point to the centre of the rotation."
                    .to_owned()
            }
            _ => "Add supports with `ux` and `uy`; against rotation at two places.".to_owned(),
        };
        if *count > 1 {
            hint.push_str(
                " Parts hold each other along a side that they share, all three nodes of it; at a single node they are hinged, and without common nodes apart.",
            );
        }
        hint.push_str(&self.hint_to_merge(mesh));
        if !without_contacts {
            hint.push_str(" A contact holds along its normal, and along its tangent if it has friction or is bonded.");
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

/// The support that ends a translation.
fn towards(words: &str) -> &'static str {
    match words {
        "along x" => "`ux`",
        "along y" | "along the axis" => "`uy`",
        _ => "`ux` or `uy`",
    }
}

/// A rigid motion of a part of the body that neither the supports nor the given nodes and directions prevent.
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
        Unheld::Motion(motion) => Some((motion.words, motion.node)),
        // only with contacts that do not touch: the model was examined with all of them
        Unheld::TooMany(_, node) => Some(("at single nodes that join its parts".to_owned(), node)),
    }
}

/// A rigid motion of a part of the body, or of several hinged parts as one.
#[derive(Clone, Debug)]
pub struct RigidMotion {
    /// In words, after "free to move".
    pub words: String,
    /// The nodes that move, and how: by 1 in a translation; in a rotation the farthest from the centre of the part by 1.
    pub moves: Vec<(u32, [f64; 2])>,
    /// In a rotation, the distance of that node (length): times the power of a force it is the moment.
    pub arm: Option<f64>,
}

/// All rigid motions that neither the supports nor the given nodes and directions prevent, but those that bend hinges.
pub(super) fn free_motions(
    mesh: &Mesh,
    section: &Section,
    fixed: &BTreeMap<u32, Held>,
    hindered: &[Hold],
) -> Vec<RigidMotion> {
    let mut held = directions(fixed);
    held.extend(hindered);
    let parts = Parts::new(mesh, section.axisymmetric());
    let rows = parts.rows(&held);
    let mut found = Vec::new();
    for together in parts.mechanisms(&rows) {
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

/// Nodes and the directions they are held along.
fn directions(fixed: &BTreeMap<u32, Held>) -> Vec<Hold> {
    let mut held = Vec::new();
    for (&node, what) in fixed {
        match what {
            Held::Along { direction, .. } => held.push((node, *direction)),
            Held::Both(_) => held.extend([(node, [1.0, 0.0]), (node, [0.0, 1.0])]),
        }
    }
    held
}

/// The motions of its nodes that a contact prevents while it touches.
fn hindered(contact: &ContactModel) -> Vec<Hold> {
    let holds = |law: &FrictionLaw<Average>| law.bound.holds();
    let normal = contact.condition != Condition::None;
    let tangent =
        contact.condition == Condition::Bonded || contact.friction.as_ref().is_some_and(holds);
    let boundary = &contact.boundary;
    let mut hindered = Vec::new();
    for (i, &node) in boundary.nodes.iter().enumerate() {
        if normal {
            hindered.push((node, boundary.normals[i]));
        }
        if tangent {
            hindered.push((node, boundary.tangent(i)));
        }
    }
    hindered
}

/// Translation along x, along y, and rotation (counter-clockwise, by 1/size) of a part.
type Motion = [f64; 3];

/// The parts of a body, and where they are hinged.
struct Parts<'a> {
    mesh: &'a Mesh,
    parts: Vec<Part>,
    /// The first part that each node belongs to.
    first: Vec<u32>,
    /// All parts of the nodes that belong to several.
    shared: BTreeMap<u32, Vec<u32>>,
    /// Motions that no part has: in axisymmetry the first and the last.
    never: &'static [Motion],
}

/// Elements that hold each other, as one rigid body.
struct Part {
    nodes: Vec<u32>,
    centre: [f64; 2],
    /// Distance of the farthest node from the centre (length).
    size: f64,
    /// A row whose remainder is below this adds nothing: coordinates are known to rounding only.
    tolerance: f64,
}

impl Part {
    fn new(mesh: &Mesh, nodes: Vec<u32>) -> Part {
        let at = |n: &u32| mesh.nodes[*n as usize];
        let count = nodes.len() as f64;
        let centre = [0, 1].map(|a| nodes.iter().map(|n| at(n)[a] / count).sum::<f64>());
        let distance = |from: [f64; 2]| {
            let away = |n: &u32| (at(n)[0] - from[0]).hypot(at(n)[1] - from[1]);
            nodes.iter().map(away).fold(0.0, f64::max)
        };
        let size = distance(centre).max(f64::MIN_POSITIVE);
        let rounding = 64.0 * f64::EPSILON * distance([0.0; 2]) / size;
        Part {
            centre,
            size,
            tolerance: ALIGNED.max(rounding),
            nodes,
        }
    }

    /// The displacement of a place along a direction, by each motion.
    fn row(&self, place: [f64; 2], [a, b]: [f64; 2]) -> Motion {
        let [x, y] = [0, 1].map(|i| (place[i] - self.centre[i]) / self.size);
        [a, b, b * x - a * y]
    }

    /// The displacement of a place by a motion.
    fn displacement(&self, place: [f64; 2], motion: &Motion) -> [f64; 2] {
        [[1.0, 0.0], [0.0, 1.0]].map(|axis| dot(&self.row(place, axis), motion))
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Makes a row orthonormal to others and adds it; a row that they contain adds nothing.
fn add(rows: &mut Vec<Motion>, mut row: Motion, tolerance: f64) {
    // twice is enough
    for _ in 0..2 {
        for other in rows.iter() {
            let part = dot(other, &row);
            (0..3).for_each(|i| row[i] -= part * other[i]);
        }
    }
    let length = dot(&row, &row).sqrt();
    if rows.len() < 3 && length > tolerance {
        rows.push(row.map(|v| v / length));
    }
}

impl<'a> Parts<'a> {
    fn new(mesh: &'a Mesh, axisymmetric: bool) -> Self {
        let mut first = vec![u32::MAX; mesh.nodes.len()];
        let mut shared: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        let parts: Vec<Part> = mesh
            .connected_parts()
            .into_iter()
            .map(|nodes| Part::new(mesh, nodes))
            .collect();
        for (number, part) in (0u32..).zip(&parts) {
            for &node in &part.nodes {
                match &mut first[node as usize] {
                    none if *none == u32::MAX => *none = number,
                    other => shared
                        .entry(node)
                        .or_insert_with(|| vec![*other])
                        .push(number),
                }
            }
        }
        Parts {
            mesh,
            parts,
            first,
            shared,
            never: match axisymmetric {
                true => &[[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
                false => &[],
            },
        }
    }

    /// The parts that a node belongs to.
    fn of(&self, node: u32) -> &[u32] {
        match self.shared.get(&node) {
            Some(parts) => parts,
            None => {
                let first = &self.first[node as usize];
                std::slice::from_ref(first)
            }
        }
    }

    /// The free motions that are left where these nodes are held.
    fn unheld(&self, held: &[Hold]) -> Vec<Unheld> {
        let rows = self.rows(held);
        let mut found = Vec::new();
        let mut examined = 0;
        for parts in self.mechanisms(&rows) {
            if let [part] = parts[..] {
                let number = part as usize;
                let free = null_space(&rows[number], 3, self.parts[number].tolerance);
                found.push(self.motion(&parts, number, &free));
                continue;
            }
            examined += parts.len();
            if parts.len() > MOST_HINGED || examined > MOST_IN_MECHANISMS {
                let node = self.parts[parts[0] as usize].nodes[0];
                found.push(Unheld::TooMany(parts.len(), node));
                continue;
            }
            found.extend(self.of_mechanism(&parts, &rows));
        }
        found
    }

    /// What holds each part: by itself, or by parts that are held.
    fn rows(&self, held: &[Hold]) -> Vec<Vec<Motion>> {
        let mut rows: Vec<Vec<Motion>> = vec![self.never.to_vec(); self.parts.len()];
        let hold = |rows: &mut Vec<Vec<Motion>>, part: u32, node: u32, direction: [f64; 2]| {
            let (rows, part) = (&mut rows[part as usize], &self.parts[part as usize]);
            let row = part.row(self.mesh.nodes[node as usize], direction);
            add(rows, row, part.tolerance);
        };
        for &(node, direction) in held {
            for &part in self.of(node).iter().filter(|part| **part != u32::MAX) {
                hold(&mut rows, part, node, direction);
            }
        }
        let mut settled: Vec<u32> = (0..self.parts.len() as u32)
            .filter(|part| rows[*part as usize].len() == 3)
            .collect();
        let mut passed: BTreeSet<u32> = BTreeSet::new();
        while let Some(part) = settled.pop() {
            for &node in &self.parts[part as usize].nodes {
                let Some(others) = self.shared.get(&node).filter(|_| passed.insert(node)) else {
                    continue;
                };
                for &other in others {
                    if rows[other as usize].len() == 3 {
                        continue;
                    }
                    hold(&mut rows, other, node, [1.0, 0.0]);
                    hold(&mut rows, other, node, [0.0, 1.0]);
                    if rows[other as usize].len() == 3 {
                        settled.push(other);
                    }
                }
            }
        }
        rows
    }

    /// Parts that are not held, those hinged to one another together.
    fn mechanisms(&self, rows: &[Vec<Motion>]) -> Vec<Vec<u32>> {
        let free = |part: u32| rows[part as usize].len() < 3;
        let mut seen = vec![false; self.parts.len()];
        let mut found = Vec::new();
        for start in (0..self.parts.len() as u32).filter(|part| free(*part)) {
            if std::mem::replace(&mut seen[start as usize], true) {
                continue;
            }
            let mut together = vec![start];
            let mut next = 0;
            while let Some(&part) = together.get(next) {
                next += 1;
                for node in &self.parts[part as usize].nodes {
                    for &other in self.shared.get(node).into_iter().flatten() {
                        if free(other) && !std::mem::replace(&mut seen[other as usize], true) {
                            together.push(other);
                        }
                    }
                }
            }
            together.sort_unstable();
            found.push(together);
        }
        found
    }

    /// The free motion of hinged parts, if there is one.
    fn of_mechanism(&self, parts: &[u32], rows: &[Vec<Motion>]) -> Option<Unheld> {
        let place: BTreeMap<u32, usize> = parts.iter().copied().zip(0..).collect();
        let columns = 3 * parts.len();
        let tolerance = parts
            .iter()
            .map(|part| self.parts[*part as usize].tolerance)
            .fold(0.0, f64::max);
        let mut matrix: Vec<Vec<f64>> = Vec::new();
        for (i, &part) in parts.iter().enumerate() {
            for row in &rows[part as usize] {
                let mut whole = vec![0.0; columns];
                whole[3 * i..3 * i + 3].copy_from_slice(row);
                matrix.push(whole);
            }
        }
        for [p, q, node] in self.hinges(&place) {
            let at = self.mesh.nodes[node as usize];
            for axis in [[1.0, 0.0], [0.0, 1.0]] {
                let mut whole = vec![0.0; columns];
                for (part, sign) in [(p, 1.0), (q, -1.0)] {
                    let row = self.parts[part as usize].row(at, axis);
                    let start = 3 * place[&part];
                    (0..3).for_each(|i| whole[start + i] = sign * row[i]);
                }
                matrix.push(whole);
            }
            if matrix.len() > MOST_ROWS * parts.len() {
                return Some(Unheld::TooMany(parts.len(), node));
            }
        }
        let free = null_space(&matrix, columns, tolerance);
        let motion = free.first()?;
        // first as one rigid body: hinged parts that nothing holds together
        let whole = Part::new(self.mesh, {
            let nodes = parts.iter().flat_map(|p| &self.parts[*p as usize].nodes);
            nodes
                .copied()
                .collect::<BTreeSet<u32>>()
                .into_iter()
                .collect()
        });
        let as_one = self.as_one(&whole, parts, rows, tolerance);
        if !as_one.is_empty() {
            return Some(self.described(&whole, parts, parts[0] as usize, &as_one, free.len()));
        }
        let size = |i: &usize| {
            let part = &motion[3 * i..3 * i + 3];
            dot(part, part)
        };
        let moved = (0..parts.len()).max_by(|a, b| size(a).total_cmp(&size(b)))?;
        let number = parts[moved] as usize;
        let own: Motion = [0, 1, 2].map(|i| motion[3 * moved + i]);
        let part = &self.parts[number];
        Some(self.described(
            part,
            &parts[moved..=moved],
            number,
            &[own.to_vec()],
            free.len(),
        ))
    }

    /// Nodes that two unheld parts share, as (part, part, node): for each pair at most two, as far apart as possible,
    /// since two hinges join them rigidly.
    fn hinges(&self, place: &BTreeMap<u32, usize>) -> Vec<[u32; 3]> {
        let mut pairs: BTreeMap<[u32; 2], Vec<u32>> = BTreeMap::new();
        let away = |a: u32, b: u32| {
            let [[x0, y0], [x1, y1]] = [a, b].map(|n| self.mesh.nodes[n as usize]);
            (x1 - x0).hypot(y1 - y0)
        };
        let nodes: BTreeSet<u32> = place
            .keys()
            .flat_map(|part| &self.parts[*part as usize].nodes)
            .copied()
            .filter(|node| self.shared.contains_key(node))
            .collect();
        for node in nodes {
            let parts: Vec<u32> = self.of(node).to_vec();
            let members: Vec<u32> = parts
                .into_iter()
                .filter(|p| place.contains_key(p))
                .collect();
            for pair in members.windows(2) {
                let nodes = pairs.entry([pair[0], pair[1]]).or_default();
                match nodes[..] {
                    [first, second] if away(first, node) > away(first, second) => nodes[1] = node,
                    [_, _] => {}
                    _ => nodes.push(node),
                }
            }
        }
        let each = |([p, q], nodes): (&[u32; 2], &Vec<u32>)| {
            let (p, q) = (*p, *q);
            nodes
                .iter()
                .map(move |node| [p, q, *node])
                .collect::<Vec<_>>()
        };
        pairs.iter().flat_map(each).collect()
    }

    /// The free motions of several parts as one rigid body.
    fn as_one(
        &self,
        whole: &Part,
        parts: &[u32],
        rows: &[Vec<Motion>],
        tolerance: f64,
    ) -> Vec<Vec<f64>> {
        let mut own = Vec::new();
        for &number in parts {
            let part = &self.parts[number as usize];
            // the motions of a part by those of the whole
            let [x, y] = whole.displacement(part.centre, &[0.0, 0.0, 1.0]);
            let scale = part.size / whole.size;
            for row in &rows[number as usize] {
                let [a, b, c] = *row;
                add(&mut own, [a, b, a * x + b * y + c * scale], tolerance);
            }
        }
        null_space(&own, 3, tolerance)
    }

    fn motion(&self, parts: &[u32], number: usize, free: &[Vec<f64>]) -> Unheld {
        self.described(&self.parts[number], parts, number, free, free.len())
    }

    /// Motions of a rigid part in words; `all`: how many motions there are, of all parts hinged to it.
    fn described(
        &self,
        part: &Part,
        together: &[u32],
        number: usize,
        free: &[Vec<f64>],
        all: usize,
    ) -> Unheld {
        let motions: Vec<Motion> = free.iter().map(|v| [v[0], v[1], v[2]]).collect();
        let (words, motion, turns) = self.words(part, &motions);
        let moved = |n: &u32| {
            let [x, y] = part.displacement(self.mesh.nodes[*n as usize], &motion);
            x.hypot(y)
        };
        let most = |a: &&u32, b: &&u32| moved(a).total_cmp(&moved(b));
        Unheld::Motion(FreeMotion {
            words,
            node: part.nodes.iter().max_by(most).copied().unwrap_or_default(),
            part: [number + 1, self.parts.len()],
            together: together.len(),
            more: all.saturating_sub(free.len()),
            turns,
        })
    }

    /// One to three motions in words, one of them, and whether they are a rotation alone.
    fn words(&self, part: &Part, motions: &[Motion]) -> (String, Motion, bool) {
        if !self.never.is_empty() {
            return ("along the axis".to_owned(), [0.0, 1.0, 0.0], false);
        }
        // one rotation, if any; the others without it are translations
        let turn = |motion: &&Motion| motion[2].abs();
        let most = motions.iter().max_by(|a, b| turn(a).total_cmp(&turn(b)));
        let scale = |m: &Motion| m[0].hypot(m[1]).max(m[2].abs());
        let rotation = most
            .filter(|m| m[2].abs() > 1e-6 * scale(m))
            .map(|m| m.map(|v| v / m[2]));
        let mut translations: Vec<Motion> = Vec::new();
        for motion in motions {
            let mut rest = *motion;
            if let Some(rotation) = rotation {
                (0..3).for_each(|i| rest[i] -= motion[2] * rotation[i]);
            }
            rest[2] = 0.0;
            if dot(&rest, &rest).sqrt() > 1e-6 * scale(motion) {
                add(&mut translations, rest, 1e-6 * scale(motion));
            }
        }
        let mut names: Vec<String> = match translations[..] {
            [_, _] => vec!["along x".to_owned(), "along y".to_owned()],
            [only] => vec![along(only)],
            _ => Vec::new(),
        };
        let turns = names.is_empty();
        let first = match (&translations[..], rotation) {
            ([_, _], _) => [1.0, 0.0, 0.0],
            ([only], _) => *only,
            (_, Some(rotation)) => rotation,
            _ => [0.0; 3],
        };
        match (rotation, &translations[..]) {
            (None, _) => {}
            (Some(_), [_, _]) => names.push("in rotation".to_owned()),
            (Some(mut rotation), translations) => {
                // the centre nearest to that of the part
                for other in translations {
                    let share = dot(other, &rotation);
                    (0..2).for_each(|i| rotation[i] -= share * other[i]);
                }
                names.push(format!(
                    "in rotation about {}",
                    self.centre(part, &rotation)
                ));
            }
        }
        let words = match &names[..] {
            [] => "in rotation".to_owned(),
            [only] => only.clone(),
            [others @ .., last] => format!("{} and {last}", others.join(", ")),
        };
        (words, first, turns)
    }

    /// Where a rotation (by 1) leaves a part in place: a node that it shares, or a position.
    fn centre(&self, part: &Part, rotation: &Motion) -> String {
        let centre = [
            part.centre[0] - rotation[1] * part.size,
            part.centre[1] + rotation[0] * part.size,
        ];
        let near = |node: &&u32| {
            let [x, y] = self.mesh.nodes[**node as usize];
            self.shared.contains_key(node)
                && (x - centre[0]).hypot(y - centre[1]) < 1e-6 * part.size
        };
        if let Some(node) = part.nodes.iter().find(near) {
            let [x, y] = self.mesh.nodes[*node as usize];
            return format!("node {node} at ({x}, {y}), where it is hinged to another part");
        }
        let [x, y] = centre.map(|c| rounded(c, part.size));
        format!("({x}, {y})")
    }
}

/// A translation in words.
fn along([x, y, _]: Motion) -> String {
    let length = x.hypot(y);
    let (x, y) = (x / length, y / length);
    match () {
        () if y.abs() < 1e-6 => "along x".to_owned(),
        () if x.abs() < 1e-6 => "along y".to_owned(),
        () => {
            let sign = x.signum();
            format!("along ({:.4}, {:.4})", sign * x, sign * y)
        }
    }
}

/// A coordinate to six digits of the size of its part.
fn rounded(value: f64, size: f64) -> f64 {
    let digit = 10f64.powf((size.log10() - 5.0).floor());
    let rounded = (value / digit).round() * digit;
    // the shortest number that is this multiple
    format!("{rounded:.9e}").parse().unwrap_or(value) + 0.0
}

/// A basis of the motions on which all rows are zero, by Gauss–Jordan elimination with full pivoting: coefficients
/// below the tolerance are zero, where rows and motions are of size 1.
fn null_space<R: AsRef<[f64]>>(rows: &[R], columns: usize, tolerance: f64) -> Vec<Vec<f64>> {
    let mut rows: Vec<Vec<f64>> = rows.iter().map(|row| row.as_ref().to_vec()).collect();
    let mut pivots: Vec<usize> = Vec::new();
    let mut is_pivot = vec![false; columns];
    while pivots.len() < rows.len() {
        let done = pivots.len();
        let (mut most, mut row, mut column) = (tolerance, usize::MAX, 0);
        for (i, values) in rows.iter().enumerate().skip(done) {
            for (j, value) in values.iter().enumerate() {
                if !is_pivot[j] && value.abs() > most {
                    (most, row, column) = (value.abs(), i, j);
                }
            }
        }
        if row == usize::MAX {
            break;
        }
        rows.swap(done, row);
        is_pivot[column] = true;
        pivots.push(column);
        let pivot = rows[done][column];
        let normal: Vec<f64> = rows[done].iter().map(|v| v / pivot).collect();
        for (i, values) in rows.iter_mut().enumerate() {
            let factor = values[column];
            if i != done && factor != 0.0 {
                values
                    .iter_mut()
                    .zip(&normal)
                    .for_each(|(v, n)| *v -= factor * n);
                values[column] = 0.0;
            }
        }
        rows[done] = normal;
    }
    let basis = |free: usize| {
        let mut motion = vec![0.0; columns];
        motion[free] = 1.0;
        for (row, &pivot) in rows.iter().zip(&pivots) {
            motion[pivot] = -row[free];
        }
        motion
    };
    (0..columns).filter(|j| !is_pivot[*j]).map(basis).collect()
}
