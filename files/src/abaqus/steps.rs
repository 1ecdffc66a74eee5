//! The motion of a deck's rigid bodies in its steps, and the factors of its loads and supports.

use std::collections::{BTreeMap, BTreeSet};

use super::build::{Built, Row};
use super::contact_parts::WRITTEN_INSTEAD;
use super::rigid::{Body, Moving};
use super::tool::Point;
use super::written::{Distributed, Force, Prescribed, on_line};
use solver::error::{Reason, Violation};

/// What moves a rigid body: along x, along y and around its reference node, a given displacement or rotation, or a load.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Motion {
    /// The place of the reference node.
    pub(super) reference: Point,
    /// Whether it may turn: a body of revolution may not.
    pub(super) may_turn: bool,
    /// Whether each is a load.
    pub(super) free: [bool; 3],
    /// At the end of each step: the displacements and the rotation, or the forces and the moment.
    pub(super) ends: Vec<[f64; 3]>,
}

/// The largest relative difference of values that count as equal, since numbers in files are rounded.
const SAME: f64 = 1e-9;

/// As many steps as a problem may have.
const MOST_STEPS: usize = 1000;

/// The largest number of prescribed displacements of nodes, each counted as often as a row names it: of 64,000 nodes in
/// each of 1,000 steps. More would take seconds.
const MOST_DISPLACEMENTS: usize = 1 << 27;

/// The largest number of motions of rigid bodies, likewise: of 300 bodies with three components in each of 1,000 steps.
const MOST_MOTIONS: usize = 1 << 20;

/// The largest number of rigid bodies, each counted in every step.
const MOST_ENDS: usize = 1 << 16;

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
            for (number, rotates) in on.iter() {
                for &component in &row.components {
                    let kind = match (component, rotates) {
                        (1 | 2, false) => component as usize - 1,
                        (6, false) | (3, true) => 2,
                        _ => continue,
                    };
                    held[*number][step][kind] = Some(value);
                }
            }
        }
        let mut loads = vec![vec![[None::<f64>; 3]; count]; bodies.len()];
        for Row { row, name } in &self.forces {
            let step = self.deck.contact.step_of(row.line);
            for (number, rotates) in self.tools.loaded.get(name).map_or(&[][..], |on| &on.0) {
                let kind = match (row.component, rotates) {
                    (1 | 2, false) => row.component as usize - 1,
                    (6, false) | (3, true) => 2,
                    _ => continue,
                };
                *loads[*number][step][kind].get_or_insert(0.0) += row.value;
            }
        }
        let later: Vec<[bool; 3]> = held
            .iter()
            .map(|ends| {
                [0, 1, 2].map(|k| ends[0][k].is_none() && ends.iter().any(|e| e[k].is_some()))
            })
            .collect();
        // what a step does not change stays
        for ends in held.iter_mut().chain(&mut loads) {
            for step in 1..count {
                for kind in 0..3 {
                    ends[step][kind] = ends[step][kind].or(ends[step - 1][kind]);
                }
            }
        }
        let alone: BTreeSet<u64> = rows
            .iter()
            .filter(|row| row.alone)
            .map(|row| row.row.line)
            .collect();
        self.prescribed.retain(|row| !alone.contains(&row.row.line));
        let motions = (0..bodies.len())
            .map(|k| self.motion(&bodies[k], &held[k], later[k], &loads[k], axisymmetric))
            .collect();
        self.tools.bodies = bodies;
        self.tools.rows = rows;
        motions
    }

    fn motion(
        &mut self,
        body: &Body,
        held: &[[Option<f64>; 3]],
        later: [bool; 3],
        loads: &[[Option<f64>; 3]],
        axisymmetric: bool,
    ) -> Option<Motion> {
        let Some(reference) = body.reference else {
            self.doubt(
                body.line,
                "*RIGID BODY",
                "REF NODE with one node",
                "Name one node, or a set of one.",
            );
            return None;
        };
        // a body of revolution moves along its axis only
        let moves = |k: usize| !axisymmetric || k == 1;
        let across =
            |end: &[Option<f64>; 3]| [0, 2].into_iter().any(|k| end[k].is_some_and(|u| u != 0.0));
        let loaded_across = (0..3).any(|k| {
            !moves(k)
                && loads
                    .iter()
                    .any(|end| end[k].is_some_and(|load| load != 0.0))
        });
        if axisymmetric && (held.iter().any(across) || loaded_across) {
            self.doubt(
                body.line,
                "a rigid body of revolution that moves radially or rotates, or is loaded so",
                "one that moves along the axis",
                "A ring that widens or tilts is no rigid body.",
            );
            return None;
        }
        let free = [0, 1, 2].map(|k| moves(k) && held[0][k].is_none());
        let named = |which: [bool; 3]| {
            let names = ["1", "2", "6"].into_iter().zip(which);
            let names = names.filter(|(_, is)| *is).map(|(name, _)| name);
            names.collect::<Vec<_>>().join(", ")
        };
        let loaded = |k: usize| {
            loads
                .iter()
                .any(|end| end[k].is_some_and(|load| load != 0.0))
        };
        let pushed = (0..3).any(|k| free[k] && loaded(k));
        if let Some(k) = (0..3).find(|&k| !free[k] && moves(k) && loaded(k)) {
            self.doubt(
                body.line,
                format!(
                    "a rigid body with a load (*CLOAD) along {} of its reference node, whose motion *BOUNDARY prescribes",
                    ["1", "2", "6"][k]
                ),
                "either a load or a prescribed motion, which needs no load",
                "Delete the row of *BOUNDARY if the load moves the body, or the row of *CLOAD.",
            );
            return None;
        }
        let late = [0, 1, 2].map(|k| free[k] && later[k]);
        if late.contains(&true) || free.contains(&true) && !pushed {
            let (which, when) = match (late.contains(&true), held.len()) {
                (true, _) => (late, " in the first step, and held later"),
                (false, 1) => (free, ""),
                (false, _) => (free, " in the first step"),
            };
            let got = format!(
                "a rigid body whose reference node is free in {}{when}",
                named(which)
            );
            self.doubt(
                body.line,
                got,
                "displacements 1 and 2 and rotation 6 of its reference node prescribed by *BOUNDARY, or a force or moment by *CLOAD along those that are free",
                WRITTEN_INSTEAD,
            );
            return None;
        }
        let end = |step: usize| {
            [0, 1, 2].map(|k| {
                let of = if free[k] { loads } else { held };
                of[step][k].filter(|_| moves(k)).unwrap_or(0.0)
            })
        };
        Some(Motion {
            reference: self.raw.nodes[reference as usize],
            may_turn: moves(2),
            free,
            ends: (0..held.len()).map(end).collect(),
        })
    }

    /// What a deck has too much of to be followed through its steps: steps, rigid bodies, or nodes that all rows of
    /// `*BOUNDARY` name.
    pub(super) fn too_long(&self) -> Option<Violation> {
        let (steps, bodies) = (&self.deck.contact.steps, &self.tools.bodies);
        let beyond_most = steps.get(MOST_STEPS).filter(|_| !self.pairs.is_empty());
        if let Some(step) = beyond_most {
            return Some(on_line(
                step.line,
                Reason::TooMany,
                format!("{} steps", steps.len()),
                &format!("at most {MOST_STEPS}"),
                "Use fewer steps: those that move a body on in one direction can be one step.",
            ));
        }
        if let Some(last) = bodies.last()
            && bodies.len() * steps.len() > MOST_ENDS
        {
            return Some(on_line(
                last.line,
                Reason::TooMany,
                format!("{} rigid bodies in {} steps", bodies.len(), steps.len()),
                &format!("at most {MOST_ENDS} rigid bodies, each counted in every step"),
                "Use fewer steps, or leave out the rigid bodies that nothing touches.",
            ));
        }
        let of_nodes = self.prescribed.iter().map(|Row { row, name }| {
            let components = (row.components.0..=row.components.1).count();
            let nodes = self.raw.node_sets.get(name).map_or(0, Vec::len);
            (row.line, components * nodes)
        });
        let moves = |moving: &Moving| {
            (
                moving.row.line,
                moving.row.components.len() * moving.on.len(),
            )
        };
        let forces = self.forces.iter().map(|Row { row, name }| {
            let on = self.tools.loaded.get(name);
            (row.line, on.map_or(0, |(on, _)| on.len()))
        });
        let of_tools = self.tools.rows.iter().map(moves).chain(forces);
        let line =
            beyond(of_nodes, MOST_DISPLACEMENTS).or_else(|| beyond(of_tools, MOST_MOTIONS))?;
        Some(on_line(
            line,
            Reason::TooMany,
            "one more row of *BOUNDARY, after many for large sets".to_owned(),
            &format!(
                "at most {MOST_DISPLACEMENTS} displacements of nodes, and {MOST_MOTIONS} of rigid bodies, each counted as often as rows name it"
            ),
            "Write each support once, and in later steps only those that change.",
        ))
    }

    /// The factors of loads and of prescribed displacements at the end of each step; in the last step both are 1 (0 if
    /// all values are 0). The values of each step must be in proportion to those of the last step, and are reported if
    /// they are not. `warms`: whether temperatures, which the first step changes, are one of the loads.
    pub(super) fn factors(&mut self, warms: bool) -> Vec<[f64; 2]> {
        let count = self.deck.contact.steps.len().max(1);
        if let Some((line, got)) = self.late_support() {
            self.doubt(
                line,
                got,
                "supports that hold from the first step on",
                "The support would hold the body from the beginning. Write it in the first step if that is intended. A support that begins later, which would also have to know what was displaced by then, is possible in no problem, in JSON neither.",
            );
        }
        let loads = self.values_of_loads();
        let nodes = self.used.len();
        let found = [
            (
                "loads",
                proportion(count, loads.len(), |give| {
                    for (step, load, value) in &loads {
                        give(*step, *load, *value);
                    }
                }),
            ),
            (
                "prescribed displacements",
                proportion(count, 2 * nodes, |give| {
                    self.each_support(|row, step, place| give(step, place, row.row.value));
                }),
            ),
        ];
        let found = found.map(|(what, found)| {
            found.unwrap_or_else(|step| {
                let line = self.deck.contact.steps.get(step).map_or(0, |step| step.line);
                self.doubt(
                    line,
                    format!("a step whose {what} are in another proportion to each other than in the last step"),
                    &format!("all {what} multiplied by one factor in each step"),
                    WRITTEN_INSTEAD,
                );
                vec![1.0; count]
            })
        });
        let [mut loads, supports] = found;
        if warms && loads.iter().all(|factor| *factor == 0.0) {
            loads = vec![1.0; count];
        }
        let other = loads.iter().position(|factor| (factor - 1.0).abs() > SAME);
        if let Some(step) = other.filter(|_| warms) {
            let line = self
                .deck
                .contact
                .steps
                .get(step)
                .map_or(0, |step| step.line);
            self.doubt(
                line,
                "a step with other loads than the last one, in a deck whose temperatures change",
                "loads that stay as the first step leaves them, as the temperatures do",
                WRITTEN_INSTEAD,
            );
        }
        loads
            .into_iter()
            .zip(supports)
            .map(|(l, s)| [l, s])
            .collect()
    }

    /// Calls `visit` for each displacement that the rows of `*BOUNDARY` prescribe for nodes of elements, in the order of
    /// the deck, with the row, its step, and the place of the displacement: twice the node, and 1 more for y. By node,
    /// since the rows of several sets may hold it.
    fn each_support<'a>(&'a self, mut visit: impl FnMut(&'a Row<Prescribed>, usize, usize)) {
        for support in &self.prescribed {
            let step = self.deck.contact.step_of(support.row.line);
            let nodes = self.raw.node_sets.get(&support.name).into_iter().flatten();
            for node in nodes.filter(|node| self.used[**node as usize]) {
                for component in support.row.components.0..=support.row.components.1 {
                    visit(support, step, 2 * *node as usize + component as usize - 1);
                }
            }
        }
    }

    /// The first row that adds a support in a later step to a node that was free: its line, and a text that names it.
    fn late_support(&self) -> Option<(u64, String)> {
        let mut held = vec![false; 2 * self.used.len()];
        let mut late = None;
        self.each_support(|row, step, place| {
            if !held[place] && step > 0 && late.is_none() {
                late = Some((row, 1 + place % 2));
            }
            held[place] = true;
        });
        let (Row { row, name }, component) = late?;
        let got =
            format!("a support that a later step adds: displacement {component} of `{name:.60}`");
        Some((row.line, got))
    }

    /// The values that loads have from a step on, in the order of the steps: the step, the number of the load, and the
    /// value. Rows of one step for the same load are summed.
    fn values_of_loads(&self) -> Vec<(usize, usize, f64)> {
        let pressures = self
            .pressures
            .iter()
            .map(|Row { row, name }| ((0, name), row.line, row.value));
        let on_mesh = |Row { name, .. }: &&Row<Force>| !self.tools.bears_alone(name);
        let forces = self
            .forces
            .iter()
            .filter(on_mesh)
            .map(|Row { row, name }| ((row.component, name), row.line, row.value));
        let mut numbers = BTreeMap::new();
        let mut sums: BTreeMap<(usize, usize), f64> = BTreeMap::new();
        for (load, line, value) in pressures.chain(forces) {
            let next = numbers.len();
            let number = *numbers.entry(load).or_insert(next);
            *sums
                .entry((self.deck.contact.step_of(line), number))
                .or_default() += value;
        }
        sums.into_iter()
            .map(|((step, load), value)| (step, load, value))
            .collect()
    }

    /// Keeps for each load only the rows of the last step that states it.
    pub(super) fn keep_last_loads(&mut self) {
        let steps = &self.deck.contact;
        let mut last: BTreeMap<String, usize> = BTreeMap::new();
        let pressure = |row: &Row<Distributed>| format!("p {}", row.name);
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

/// The line of the first row by which the sum of the counts exceeds `most`.
fn beyond(mut rows: impl Iterator<Item = (u64, usize)>, most: usize) -> Option<u64> {
    let mut sum = 0;
    let exceeds = |(_, count): &(u64, usize)| {
        sum += count;
        sum > most
    };
    rows.find(exceeds).map(|(line, _)| line)
}

/// The common factor of all values at the end of each step, in proportion to the last step; 0 if there are none. The
/// error is the first step whose values are not in proportion to those of the last step. `places`: the number of values,
/// each 0 until it is given; `values` gives the step, the place and the new value of each that changes, in the order
/// of the steps, and is called twice.
fn proportion(
    count: usize,
    places: usize,
    values: impl Fn(&mut dyn FnMut(usize, usize, f64)),
) -> Result<Vec<f64>, usize> {
    let mut ends = vec![0.0f64; places];
    values(&mut |_, place, value| ends[place] = value);
    let by_size = |a: &usize, b: &usize| ends[*a].abs().total_cmp(&ends[*b].abs());
    let largest = (0..places)
        .max_by(by_size)
        .filter(|place| ends[*place] != 0.0);
    let size = largest.map_or(0.0, |place| ends[place].abs());
    let mut now = vec![0.0f64; places];
    let mut factors: Vec<f64> = Vec::with_capacity(count);
    // the factors of the steps from the last one known to before `step`, in which nothing changes after the first
    let mut close = |now: &[f64], step: usize| {
        if factors.len() == step {
            return Ok(());
        }
        let factor = largest.map_or(0.0, |place| now[place] / ends[place]);
        let mut pairs = now.iter().zip(&ends);
        if !pairs.all(|(now, end)| (now - factor * end).abs() <= SAME * size.max(now.abs())) {
            return Err(factors.len());
        }
        factors.resize(step, factor);
        Ok(())
    };
    let mut found = Ok(());
    values(&mut |step, place, value| {
        if found.is_ok() {
            found = close(&now, step);
        }
        now[place] = value;
    });
    found?;
    close(&now, count)?;
    Ok(factors)
}

/// The factors on several quantities at the end of each step; `None` if the contacts do not share them. `moved`: the quantities
/// of each contact by step; `absent`: the factor on one that no contact has.
pub(super) fn common_factors<const N: usize>(
    moved: &[&[[f64; N]]],
    absent: [f64; N],
) -> Option<Vec<[f64; N]>> {
    let count = moved.first()?.len();
    let mut found = vec![absent; count];
    for kind in 0..N {
        let mut common: Option<Vec<f64>> = None;
        for contact in moved {
            let most = largest(contact)[kind];
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
        for (found, factor) in found.iter_mut().zip(common.into_iter().flatten()) {
            found[kind] = factor;
        }
    }
    Some(found)
}

/// The largest value of each quantity in all steps, by size but with its sign; the last one of equal size.
pub(super) fn largest<const N: usize>(moved: &[[f64; N]]) -> [f64; N] {
    std::array::from_fn(|kind| {
        let all = moved.iter().map(|m| m[kind]);
        all.fold(
            0.0,
            |most: f64, m| if m.abs() >= most.abs() { m } else { most },
        )
    })
}
