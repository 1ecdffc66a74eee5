//! The rigid motions of a body, by its parts.
//!
//! Elements that share a side form one rigid part; parts that share only single nodes are hinged there. Each part has
//! two translations and a rotation about its centre, scaled by its size, so that all three displace its farthest node
//! by 1 and no unit of length matters; in axisymmetry it has the translation along the axis only. What is held, and
//! every hinge, is a row of coefficients of these motions. The rows of a part are made orthonormal one by one; a part
//! with three of them is held, and holds its neighbours at the nodes that they share. What remains are parts alone,
//! with at most two rows, and mechanisms of hinged parts: their motions are the null space of all their rows, by
//! elimination with full pivoting.

use std::collections::{BTreeMap, BTreeSet};

use super::super::checks::ALIGNED;
use super::super::contact_model::ContactModel;
use crate::mesh::Mesh;

/// The largest number of parts in one mechanism that are examined: the elimination is cubic in them.
pub(super) const MOST_HINGED: usize = 64;

/// The largest number of parts in all mechanisms together that are examined.
pub(super) const MOST_IN_MECHANISMS: usize = 10 * MOST_HINGED;

/// The number of rows for each part of a mechanism. k parts that do not overlap share nodes in at most 3 k pairs, and a
/// pair gives four rows at most; each part has two rows of its own.
const MOST_ROWS: usize = 14;

/// A node, and a direction along which it is held: by the ground, or by a node of another body that faces it.
#[derive(Clone, Copy, Debug)]
pub struct Hold {
    /// The node.
    pub node: u32,
    /// The direction (unit vector).
    pub direction: [f64; 2],
    /// The error of the direction, if it is the direction of a curved surface (angle).
    pub error: f64,
    /// The node of another body, relative to which it is held.
    pub facing: Option<u32>,
}

impl Hold {
    /// A contact node that is held along the normal.
    pub fn along_normal(contact: &ContactModel, i: usize) -> Hold {
        let boundary = &contact.boundary;
        Hold {
            facing: contact.pair.as_ref().and_then(|pair| pair.nearest(i)),
            node: boundary.nodes[i],
            direction: boundary.normals[i],
            error: boundary.normal_errors[i],
        }
    }

    /// A contact node that is held along the tangent.
    pub fn along_tangent(contact: &ContactModel, i: usize) -> Hold {
        Hold {
            direction: contact.boundary.tangent(i),
            ..Hold::along_normal(contact, i)
        }
    }
}

/// A place of a part, and a direction along which it is held.
#[derive(Clone, Copy, Debug)]
struct OnPart {
    part: u32,
    place: [f64; 2],
    direction: [f64; 2],
    /// As [`Hold::error`].
    error: f64,
}

/// What is known about parts that nothing holds.
pub(super) enum Unheld {
    Free(Free),
    /// Too many hinged parts to be examined: the number of parts, and one of their nodes.
    TooMany(usize, u32),
}

/// Rigid motions that nothing prevents.
pub(super) struct Free {
    /// The part that moves, or several that move as one.
    pub(super) moved: Part,
    pub(super) motions: Vec<Motion>,
    /// The number of the part that moves, or of the first of several.
    pub(super) number: usize,
    /// The number of parts that move as one.
    pub(super) together: usize,
    /// The number of further motions of parts hinged to the moving ones.
    pub(super) more: usize,
}

/// Translation along x, along y, and rotation (counter-clockwise, by 1/size) of a part.
pub(super) type Motion = [f64; 3];

/// The parts of a body, and where they are hinged.
pub(super) struct Parts<'a> {
    pub(super) mesh: &'a Mesh,
    pub(super) parts: Vec<Part>,
    /// The first part that each node belongs to.
    first: Vec<u32>,
    /// For each node that belongs to several parts, all its parts.
    pub(super) shared: BTreeMap<u32, Vec<u32>>,
    /// Motions that no part can have: in axisymmetry the first and the last.
    pub(super) never: &'static [Motion],
}

/// A part of the body: elements that hold each other, as one rigid body.
#[derive(Clone)]
pub(super) struct Part {
    pub(super) nodes: Vec<u32>,
    pub(super) centre: [f64; 2],
    /// The distance of the farthest node from the centre (length).
    pub(super) size: f64,
    /// A row whose remainder is below this adds nothing, since coordinates are known only up to rounding.
    pub(super) tolerance: f64,
}

impl Part {
    pub(super) fn new(mesh: &Mesh, nodes: Vec<u32>) -> Part {
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

    /// A row of coefficients: the displacement of a place along a direction, for each motion.
    fn row(&self, place: [f64; 2], [a, b]: [f64; 2]) -> Motion {
        let [x, y] = [0, 1].map(|i| (place[i] - self.centre[i]) / self.size);
        [a, b, b * x - a * y]
    }

    /// A row of coefficients of the motions of another part, as a row of those of this part: the same motions of the plane.
    fn seen_from(&self, other: &Part, [a, b, c]: Motion) -> Motion {
        let [x, y] = [0, 1].map(|i| other.centre[i] - self.centre[i]);
        [a, b, (b * x - a * y + c * other.size) / self.size]
    }

    /// The displacement of a place by a motion.
    pub(super) fn displacement(&self, place: [f64; 2], motion: &Motion) -> [f64; 2] {
        [[1.0, 0.0], [0.0, 1.0]].map(|axis| dot(&self.row(place, axis), motion))
    }
}

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The component of `row` orthogonal to `rows`, which are orthonormal.
fn rest(rows: &[Motion], mut row: Motion) -> Motion {
    // twice is enough
    for _ in 0..2 {
        for other in rows {
            let part = dot(other, &row);
            (0..3).for_each(|i| row[i] -= part * other[i]);
        }
    }
    row
}

/// Makes `row` orthonormal to `rows` and adds it to them; a row in their span adds nothing.
pub(super) fn add(rows: &mut Vec<Motion>, row: Motion, tolerance: f64) {
    let row = rest(rows, row);
    let length = dot(&row, &row).sqrt();
    if rows.len() < 3 && length > tolerance {
        rows.push(row.map(|v| v / length));
    }
}

impl<'a> Parts<'a> {
    pub(super) fn new(mesh: &'a Mesh, axisymmetric: bool) -> Self {
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
            never: if axisymmetric {
                &[[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
            } else {
                &[]
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

    /// The free motions that remain if the nodes `held` are held.
    pub(super) fn unheld(&self, held: &[Hold]) -> Vec<Unheld> {
        let (single, relative) = self.on_parts(held);
        let rows = self.rows_of(single, &relative);
        let mut found = Vec::new();
        let mut examined = 0;
        for parts in self.mechanisms(&rows, &relative) {
            if let [part] = parts[..] {
                let number = part as usize;
                let free = null_space(&rows[number], 3, self.parts[number].tolerance);
                found.push(Unheld::Free(Free {
                    moved: self.parts[number].clone(),
                    motions: motions(&free),
                    number: number + 1,
                    together: 1,
                    more: 0,
                }));
                continue;
            }
            examined += parts.len();
            if parts.len() > MOST_HINGED || examined > MOST_IN_MECHANISMS {
                let node = self.parts[parts[0] as usize].nodes[0];
                found.push(Unheld::TooMany(parts.len(), node));
                continue;
            }
            found.extend(self.of_mechanism(&parts, &rows, &relative));
        }
        found
    }

    /// The rows that hold each part, directly or through parts that are held, and the groups of the others that are hinged to or
    /// face one another.
    pub(super) fn rows(&self, held: &[Hold]) -> (Vec<Vec<Motion>>, Vec<Vec<u32>>) {
        let (single, relative) = self.on_parts(held);
        let rows = self.rows_of(single, &relative);
        let mechanisms = self.mechanisms(&rows, &relative);
        (rows, mechanisms)
    }

    /// What holds a part by the ground, and what holds two parts relative to one another.
    fn on_parts(&self, held: &[Hold]) -> (Vec<OnPart>, Vec<(u32, OnPart)>) {
        let (mut single, mut relative) = (Vec::new(), Vec::new());
        for one in held {
            for &part in self.of(one.node).iter().filter(|part| **part != u32::MAX) {
                let own = OnPart {
                    part,
                    place: self.mesh.nodes[one.node as usize],
                    direction: one.direction,
                    error: one.error,
                };
                match one.facing {
                    None => single.push(own),
                    Some(node) => {
                        let others = self.of(node).iter().filter(|other| **other != u32::MAX);
                        relative.extend(others.map(|other| (*other, own)));
                    }
                }
            }
        }
        (single, relative)
    }

    /// The rows that hold each part, if those that face a part that is held are held by it.
    fn rows_of(&self, mut single: Vec<OnPart>, relative: &[(u32, OnPart)]) -> Vec<Vec<Motion>> {
        let mut used = vec![false; relative.len()];
        loop {
            let rows = self.rows_by_ground(&single);
            let is_held = |part: u32| rows[part as usize].len() == 3;
            let before = single.len();
            for ((other, own), used) in relative.iter().zip(&mut used) {
                if !*used && is_held(own.part) != is_held(*other) {
                    let part = if is_held(own.part) { *other } else { own.part };
                    single.push(OnPart { part, ..*own });
                    *used = true;
                }
            }
            if single.len() == before {
                return rows;
            }
        }
    }

    /// The rows that hold each part, directly or through hinges with parts that are held.
    fn rows_by_ground(&self, held: &[OnPart]) -> Vec<Vec<Motion>> {
        let mut rows: Vec<Vec<Motion>> = vec![self.never.to_vec(); self.parts.len()];
        let hold =
            |rows: &mut Vec<Vec<Motion>>, part: u32, place: [f64; 2], direction: [f64; 2]| {
                let (rows, part) = (&mut rows[part as usize], &self.parts[part as usize]);
                let row = part.row(place, direction);
                add(rows, row, part.tolerance);
            };
        let mut inexact: BTreeMap<u32, Vec<&OnPart>> = BTreeMap::new();
        for one in held {
            hold(&mut rows, one.part, one.place, one.direction);
            if one.error > 0.0 {
                inexact.entry(one.part).or_default().push(one);
            }
        }
        for (part, inexact) in inexact {
            if rows[part as usize].len() == 3 {
                let exact = held
                    .iter()
                    .filter(|one| one.error == 0.0 && one.part == part);
                let exact: Vec<&OnPart> = exact.collect();
                if let Some(firm) =
                    Self::firm(&self.parts[part as usize], self.never, &exact, &inexact)
                {
                    rows[part as usize] = firm;
                }
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
                let place = self.mesh.nodes[node as usize];
                for &other in others {
                    if rows[other as usize].len() == 3 {
                        continue;
                    }
                    hold(&mut rows, other, place, [1.0, 0.0]);
                    hold(&mut rows, other, place, [0.0, 1.0]);
                    if rows[other as usize].len() == 3 {
                        settled.push(other);
                    }
                }
            }
        }
        rows
    }

    /// The two rows that alone hold a part, if its third row is only an error of directions, as for a ring that can
    /// turn in a sleeve whose mesh is not an exact circle.
    fn firm(
        part: &Part,
        never: &[Motion],
        exact: &[&OnPart],
        inexact: &[&OnPart],
    ) -> Option<Vec<Motion>> {
        let row = |one: &OnPart| part.row(one.place, one.direction);
        let mut rows = never.to_vec();
        for one in exact {
            add(&mut rows, row(one), part.tolerance);
        }
        while rows.len() < 2 {
            // that which adds most hides least behind the errors of the others
            let rests = inexact.iter().map(|one| rest(&rows, row(one)));
            let most = rests.max_by(|a, b| dot(a, a).total_cmp(&dot(b, b)))?;
            let before = rows.len();
            add(&mut rows, most, part.tolerance);
            if rows.len() == before {
                return None;
            }
        }
        let [[a, b, c], [d, e, f]] = rows[..] else {
            return None;
        };
        let motion = [b * f - c * e, c * d - a * f, a * e - b * d];
        let in_error = |one: &&OnPart| {
            let [x, y] = part.displacement(one.place, &motion);
            let along = x * one.direction[0] + y * one.direction[1];
            along.abs() <= one.error * x.hypot(y) + part.tolerance
        };
        inexact.iter().all(in_error).then_some(rows)
    }

    /// Groups of parts that are not held and are hinged to one another, or held relative to one another.
    fn mechanisms(&self, rows: &[Vec<Motion>], relative: &[(u32, OnPart)]) -> Vec<Vec<u32>> {
        let free = |part: u32| rows[part as usize].len() < 3;
        let mut facing: BTreeMap<u32, BTreeSet<u32>> = BTreeMap::new();
        for (other, own) in relative {
            facing.entry(*other).or_default().insert(own.part);
            facing.entry(own.part).or_default().insert(*other);
        }
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
                for &other in facing.get(&part).into_iter().flatten() {
                    if free(other) && !std::mem::replace(&mut seen[other as usize], true) {
                        together.push(other);
                    }
                }
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

    /// The free motion of a group of hinged parts, if there is one.
    fn of_mechanism(
        &self,
        parts: &[u32],
        rows: &[Vec<Motion>],
        relative: &[(u32, OnPart)],
    ) -> Option<Unheld> {
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
        for ([p, q], row) in self.relative_rows(&place, relative) {
            let mut whole = vec![0.0; columns];
            let of_other = self.parts[q as usize].seen_from(&self.parts[p as usize], row);
            for (part, row) in [(p, row), (q, of_other.map(|v| -v))] {
                let start = 3 * place[&part];
                whole[start..start + 3].copy_from_slice(&row);
            }
            matrix.push(whole);
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
            return Some(Unheld::Free(Free {
                moved: whole,
                more: free.len().saturating_sub(as_one.len()),
                motions: motions(&as_one),
                number: parts[0] as usize + 1,
                together: parts.len(),
            }));
        }
        let size = |i: &usize| {
            let part = &motion[3 * i..3 * i + 3];
            dot(part, part)
        };
        let moved = (0..parts.len()).max_by(|a, b| size(a).total_cmp(&size(b)))?;
        let number = parts[moved] as usize;
        Some(Unheld::Free(Free {
            moved: self.parts[number].clone(),
            motions: vec![[0, 1, 2].map(|i| motion[3 * moved + i])],
            number: number + 1,
            together: 1,
            more: free.len() - 1,
        }))
    }

    /// What holds two unheld parts relative to one another: at most three independent rows for each pair, of the motions of the
    /// first.
    fn relative_rows(
        &self,
        place: &BTreeMap<u32, usize>,
        relative: &[(u32, OnPart)],
    ) -> Vec<([u32; 2], Motion)> {
        let mut pairs: BTreeMap<[u32; 2], Vec<Motion>> = BTreeMap::new();
        for (other, own) in relative {
            let inside = [other, &own.part]
                .into_iter()
                .all(|part| place.contains_key(part));
            if inside && *other != own.part {
                let pair = [(*other).min(own.part), (*other).max(own.part)];
                let part = &self.parts[pair[0] as usize];
                let row = part.row(own.place, own.direction);
                add(pairs.entry(pair).or_default(), row, part.tolerance);
            }
        }
        let each =
            |(pair, rows): ([u32; 2], Vec<Motion>)| rows.into_iter().map(move |row| (pair, row));
        pairs.into_iter().flat_map(each).collect()
    }

    /// Nodes that two unheld parts share, as (part, part, node): at most two for each pair, as far apart as possible,
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
    pub(super) fn as_one(
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
}

fn motions(of_three: &[Vec<f64>]) -> Vec<Motion> {
    of_three.iter().map(|v| [v[0], v[1], v[2]]).collect()
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
