//! The motion of a deck's rigid bodies in its steps, and the factors of its loads and supports.

use std::collections::{BTreeMap, BTreeSet};

use super::build::{Built, Row};
use super::contact_parts::WRITTEN_INSTEAD;
use super::replaced::Key;
use super::rigid::{Body, Moving};
use super::tool::Point;
use super::written::{Force, Pressure};

/// The motion of a reference node.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Motion {
    /// The displacement of the reference node at the end of each step.
    pub(super) ends: Vec<Point>,
}

/// The largest relative difference of values that count as equal, since numbers in files are rounded.
const SAME: f64 = 1e-9;

impl Built {
    /// Removes the rows of reference nodes from the prescribed displacements; returns the motion of each rigid body, or
    /// `None` for a motion that is refused.
    pub(super) fn take_motions(&mut self, axisymmetric: bool) -> Vec<Option<Motion>> {
        let count = self.deck.contact.steps.len().max(1);
        let bodies = std::mem::take(&mut self.tools.bodies);
        // displacements x, y, and the rotation, at the end of each step
        let mut held = vec![vec![[None::<f64>; 3]; count]; bodies.len()];
        let rows = std::mem::take(&mut self.tools.rows);
        for Moving { row, on, .. } in &rows {
            // what is wrong with an amplitude is told of the prescribed displacement
            let factor = row.amplitude.as_ref().map(|name| self.deck.factor(name));
            let value = row.value * factor.and_then(Result::ok).unwrap_or(1.0);
            let step = self.deck.contact.step_of(row.line);
            for (number, rotates) in on {
                for &component in &row.components {
                    let kind = match (component, rotates) {
                        (1 | 2, false) => component as usize - 1,
                        (6, false) | (3, true) => 2,
                        _ => continue,
                    };
                    let later = held[*number][step..].iter_mut();
                    later.for_each(|values| values[kind] = Some(value));
                }
            }
        }
        let alone: BTreeSet<u64> = rows
            .iter()
            .filter(|row| row.alone)
            .map(|row| row.row.line)
            .collect();
        self.prescribed.retain(|row| !alone.contains(&row.row.line));
        let motions = bodies.iter().zip(&held);
        let motions = motions
            .map(|(body, held)| self.motion(body, held, axisymmetric))
            .collect();
        self.tools.bodies = bodies;
        self.tools.rows = rows;
        motions
    }

    fn motion(
        &mut self,
        body: &Body,
        held: &[[Option<f64>; 3]],
        axisymmetric: bool,
    ) -> Option<Motion> {
        let last = held[held.len() - 1];
        if body.reference.is_none() {
            self.doubt(
                body.line,
                "*RIGID BODY",
                "REF NODE with one node",
                "Name one node, or a set of one.",
            );
            return None;
        }
        let turned = |values: &[Option<f64>; 3]| values[2].is_some_and(|angle| angle != 0.0);
        if held.iter().any(turned) {
            self.doubt(
                body.line,
                "a rigid body that rotates",
                "rotation 6 held at 0",
                "Rigid bodies are only displaced here.",
            );
            return None;
        }
        let components = ["1", "2", "6"].into_iter().zip(last);
        let free =
            components.filter(|(name, value)| value.is_none() && !(axisymmetric && *name != "2"));
        let free: Vec<&str> = free.map(|(name, _)| name).collect();
        if !free.is_empty() {
            let got = format!(
                "a rigid body whose reference node is free in {}",
                free.join(", ")
            );
            self.doubt(body.line, got, "displacements 1 and 2 and rotation 6 of its reference node prescribed by *BOUNDARY", WRITTEN_INSTEAD);
            return None;
        }
        let end = |values: &[Option<f64>; 3]| [0, 1].map(|k| values[k].unwrap_or(0.0));
        Some(Motion {
            ends: held.iter().map(end).collect(),
        })
    }

    /// The factors of loads and of prescribed displacements at the end of each step; in the last step both are 1 (0 if
    /// all values are 0). The values of each step must be in proportion to those of the last step, and are reported if
    /// they are not.
    pub(super) fn factors(&mut self) -> Vec<[f64; 2]> {
        let steps = &self.deck.contact;
        let count = steps.steps.len().max(1);
        let mut loads = ByName::new();
        for Row { row, name } in &self.pressures {
            let rows = loads.entry((0, name.clone())).or_default();
            add(rows, steps.step_of(row.line), row.value);
        }
        for Row { row, name } in &self.forces {
            let rows = loads.entry((row.component, name.clone())).or_default();
            add(rows, steps.step_of(row.line), row.value);
        }
        // by node, since the rows of several sets may hold it
        let mut supports: BTreeMap<(u64, u32), Vec<(usize, f64)>> = BTreeMap::new();
        // the first row that a later step adds for a node that was free
        let mut late: Option<(u64, String)> = None;
        for Row { row, name } in &self.prescribed {
            let step = steps.step_of(row.line);
            let nodes = self.raw.node_sets.get(name).into_iter().flatten();
            let nodes = nodes.filter(|node| self.used[**node as usize]);
            for component in row.components.0..=row.components.1 {
                for node in nodes.clone() {
                    let rows = supports.entry((component, *node)).or_default();
                    if rows.is_empty() && step > 0 && late.is_none() {
                        let got = format!(
                            "a support that a later step adds: displacement {component} of `{name:.60}`"
                        );
                        late = Some((row.line, got));
                    }
                    rows.push((step, row.value));
                }
            }
        }
        if let Some((line, got)) = late {
            self.doubt(
                line,
                got,
                "supports that hold from the first step on",
                &format!("The support would hold the body from the beginning. Write it in the first step if that is intended. {WRITTEN_INSTEAD}"),
            );
        }
        let found = [
            ("loads", proportion(&loads, count)),
            ("prescribed displacements", proportion(&supports, count)),
        ];
        let found = found.map(|(what, found)| {
            found.unwrap_or_else(|step| {
                let line = self.deck.contact.steps.get(step).map_or(0, |step| step.0);
                self.doubt(
                    line,
                    format!("a step whose {what} are in another proportion to each other than in the last step"),
                    &format!("all {what} multiplied by one factor in each step"),
                    WRITTEN_INSTEAD,
                );
                vec![1.0; count]
            })
        });
        let [loads, supports] = found;
        loads
            .into_iter()
            .zip(supports)
            .map(|(l, s)| [l, s])
            .collect()
    }

    /// Keeps for each load only the rows of the last step that states it.
    pub(super) fn keep_last_loads(&mut self) {
        let steps = &self.deck.contact;
        let mut last: BTreeMap<String, usize> = BTreeMap::new();
        let pressure = |row: &Row<Pressure>| format!("p {}", row.name);
        let force = |row: &Row<Force>| format!("f{} {}", row.row.component, row.name);
        for row in &self.pressures {
            last.insert(pressure(row), steps.step_of(row.row.line));
        }
        for row in &self.forces {
            last.insert(force(row), steps.step_of(row.row.line));
        }
        let is_last = |key: String, line: u64| last.get(&key) == Some(&steps.step_of(line));
        self.pressures
            .retain(|row| is_last(pressure(row), row.row.line));
        self.forces.retain(|row| is_last(force(row), row.row.line));
    }
}

/// The values of each load with their steps, in the order of the deck.
type ByName = BTreeMap<Key, Vec<(usize, f64)>>;

/// Adds the value of a load in a step; values of the same step are summed.
fn add(rows: &mut Vec<(usize, f64)>, step: usize, value: f64) {
    match rows.last_mut() {
        Some((last, sum)) if *last == step => *sum += value,
        _ => rows.push((step, value)),
    }
}

/// The common factor of all values at the end of each step, in proportion to the last step; 0 if there are none. The
/// error is the first step whose values are not in proportion to those of the last step.
fn proportion<K>(rows: &BTreeMap<K, Vec<(usize, f64)>>, count: usize) -> Result<Vec<f64>, usize> {
    let at = |rows: &[(usize, f64)], step: usize| {
        let mut latest = rows.iter().rev();
        latest
            .find(|(s, _)| *s <= step)
            .map_or(0.0, |(_, value)| *value)
    };
    let ends: Vec<f64> = rows.values().map(|rows| at(rows, count - 1)).collect();
    let size = ends.iter().fold(0.0f64, |most, end| most.max(end.abs()));
    let factor = |step: usize| {
        let now: Vec<f64> = rows.values().map(|rows| at(rows, step)).collect();
        let most = now
            .iter()
            .zip(&ends)
            .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        let factor = most
            .filter(|_| size > 0.0)
            .map_or(0.0, |(now, end)| now / end);
        let fits = now
            .iter()
            .zip(&ends)
            .all(|(now, end)| (now - factor * end).abs() <= SAME * size.max(now.abs()));
        fits.then_some(factor).ok_or(step)
    };
    (0..count).map(factor).collect()
}

/// The factors of indentations and of tangential displacements at the end of each step; `None` if the contacts do not
/// share them. `moved`: both displacements of each contact by step.
pub(super) fn common_factors(moved: &[&[[f64; 2]]]) -> Option<Vec<[f64; 2]>> {
    let count = moved.first()?.len();
    let mut found = vec![[0.0; 2]; count];
    for kind in [0, 1] {
        let mut common: Option<Vec<f64>> = None;
        for contact in moved {
            let most = contact.iter().map(|m| m[kind]).fold(0.0, |most: f64, m| {
                if m.abs() >= most.abs() { m } else { most }
            });
            if most == 0.0 {
                continue;
            }
            let factors: Vec<f64> = contact.iter().map(|m| m[kind] / most).collect();
            match &common {
                Some(known)
                    if known
                        .iter()
                        .zip(&factors)
                        .any(|(a, b)| (a - b).abs() > SAME) =>
                {
                    return None;
                }
                Some(_) => {}
                None => common = Some(factors),
            }
        }
        let common = common.unwrap_or_else(|| vec![f64::from(u8::from(kind == 0)); count]);
        found
            .iter_mut()
            .zip(common)
            .for_each(|(found, factor)| found[kind] = factor);
    }
    Some(found)
}
