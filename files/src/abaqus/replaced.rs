//! Checks `OP=NEW` in steps after the first: it ends all supports, forces or pressures of earlier steps that its own
//! step does not repeat. If the step repeats all of them, `OP=NEW` has no effect; otherwise it is refused with the
//! names of what it ends.

use std::collections::BTreeMap;

use super::build::Built;
use super::contact_parts::WRITTEN_INSTEAD;
use super::written::{Replacement, Replaces};

/// Identifies a support or load: the component of the displacement or force (0: a pressure), and the target's name.
pub(super) type Key = (u64, String);

/// A row of a deck: its step, what it prescribes, its line, and its value.
type Stated = (usize, Key, u64, f64);

/// The supports or loads that act in a step, with the lines of their rows and their values.
type InForce = BTreeMap<Key, (u64, f64)>;

/// The largest number of names that a violation lists.
const MOST_NAMED: usize = 5;

impl Built {
    /// Reports keywords with `OP=NEW` that end supports or loads of earlier steps: the first one of each kind.
    pub(super) fn check_replaced(&mut self) {
        for what in [Replaces::Supports, Replaces::Forces, Replaces::Pressures] {
            let replacements = self.deck.replacements.iter();
            let mut by_step: BTreeMap<usize, &Replacement> = BTreeMap::new();
            for replacement in replacements.filter(|replacement| replacement.what == what) {
                let step = self.deck.contact.step_of(replacement.line);
                by_step.entry(step).or_insert(replacement);
            }
            if by_step.is_empty() {
                continue;
            }
            let found = self.first_end(&self.stated(what), &by_step, what);
            if let Some((line, got)) = found {
                self.doubt(
                    line,
                    got,
                    "a step that repeats everything that OP=NEW replaces, or one without OP=NEW",
                    &format!("Repeat in this step the supports or loads that it would end: those that end between steps cannot be translated. {WRITTEN_INSTEAD}"),
                );
            }
        }
    }

    /// All rows of the deck that state supports, forces or pressures, as `what` says, in the order of the deck.
    fn stated(&self, what: Replaces) -> Vec<Stated> {
        let step = |line: u64| self.deck.contact.step_of(line);
        match what {
            Replaces::Supports => {
                let of_nodes = self.prescribed.iter().flat_map(|row| {
                    let (first, last) = row.row.components;
                    let key = move |component| (component, row.name.clone());
                    let line = row.row.line;
                    (first..=last).map(move |component| (key(component), line, row.row.value))
                });
                let of_bodies = self.tools.rows.iter().flat_map(|moving| {
                    let row = &moving.row;
                    let body = |(number, rotates): &(usize, bool)| {
                        let node = if *rotates { "rotation" } else { "reference" };
                        let line = self.tools.bodies[*number].line;
                        format!("the {node} node of the *RIGID BODY on line {line}")
                    };
                    let keys = moving.on.iter().flat_map(move |on| {
                        let all = row.components.iter();
                        let moves = all
                            .filter(move |c| matches!((c, on.1), (1 | 2 | 6, false) | (3, true)));
                        moves.map(move |component| (*component, body(on)))
                    });
                    keys.map(|key| (key, row.line, row.value))
                });
                let mut all: Vec<Stated> = of_nodes
                    .chain(of_bodies)
                    .map(|(key, line, value)| (step(line), key, line, value))
                    .collect();
                all.sort_by_key(|(_, _, line, _)| *line);
                all
            }
            Replaces::Forces => {
                let rows = self.forces.iter();
                rows.map(|row| {
                    let key = (row.row.component, row.name.clone());
                    (step(row.row.line), key, row.row.line, row.row.value)
                })
                .collect()
            }
            Replaces::Pressures => {
                let rows = self.pressures.iter();
                rows.map(|row| {
                    (
                        step(row.row.line),
                        (0, row.name.clone()),
                        row.row.line,
                        row.row.value,
                    )
                })
                .collect()
            }
        }
    }

    /// The first keyword that ends a support or load: its line, and a text that names the keyword and what it ends.
    fn first_end(
        &self,
        rows: &[Stated],
        by_step: &BTreeMap<usize, &Replacement>,
        what: Replaces,
    ) -> Option<(u64, String)> {
        let mut in_force = InForce::new();
        let mut rows = rows.iter().peekable();
        for step in 0..self.deck.steps {
            let mut now = InForce::new();
            while let Some((_, key, line, value)) = rows.next_if(|row| row.0 == step) {
                let entry = now.entry(key.clone()).or_insert((*line, 0.0));
                // the last displacement holds; forces add
                let before = if what == Replaces::Supports {
                    0.0
                } else {
                    entry.1
                };
                *entry = (*line, before + value);
            }
            if let Some(replacement) = by_step.get(&step) {
                let ended = self.ended(&in_force, &now, what);
                if !ended.is_empty() {
                    let got = format!(
                        "*{}, OP=NEW, which ends {}",
                        replacement.keyword,
                        listed(&ended, what)
                    );
                    return Some((replacement.line, got));
                }
                in_force.clear();
            }
            in_force.extend(now);
        }
        None
    }

    /// The supports or loads in `before` that `now` does not repeat, with their lines. A force or pressure of 0 is left
    /// out, and so is a support of nodes that rows for other sets hold.
    fn ended<'a>(&self, before: &'a InForce, now: &InForce, what: Replaces) -> Vec<(&'a Key, u64)> {
        let supports = what == Replaces::Supports;
        let mut ended: Vec<(&Key, u64)> = before
            .iter()
            .filter(|(key, (_, value))| !now.contains_key(*key) && (supports || *value != 0.0))
            .map(|(key, (line, _))| (key, *line))
            .collect();
        if supports && !ended.is_empty() {
            let held = self.nodes_held(now.keys());
            ended.retain(|((component, name), _)| !self.is_held(*component, name, &held));
        }
        ended.sort_by_key(|(_, line)| *line);
        ended
    }

    /// For each node, whether the given supports hold its displacements in x and in y.
    fn nodes_held<'a>(&self, keys: impl Iterator<Item = &'a Key>) -> Vec<[bool; 2]> {
        let mut held = vec![[false; 2]; self.raw.nodes.len()];
        for (component, name) in keys {
            let nodes = self.raw.node_sets.get(name).into_iter().flatten();
            for node in nodes {
                // rotations are held by reference nodes only
                if let Some(held) = held[*node as usize].get_mut(*component as usize - 1) {
                    *held = true;
                }
            }
        }
        held
    }

    /// Whether the displacement `component` of all nodes of a set is held, by `held` of [`Built::nodes_held`].
    fn is_held(&self, component: u64, set: &str, held: &[[bool; 2]]) -> bool {
        let nodes = self.raw.node_sets.get(set);
        let of_node = |node: &u32| held[*node as usize].get(component as usize - 1) == Some(&true);
        nodes.is_some_and(|nodes| nodes.iter().all(of_node))
    }
}

/// Supports or loads as a list in words, such as `displacement 1 of L (line 3) and 2 others`.
fn listed(ended: &[(&Key, u64)], what: Replaces) -> String {
    let names: Vec<String> = ended
        .iter()
        .take(MOST_NAMED)
        .map(|((component, name), line)| match what {
            Replaces::Supports => {
                format!("displacement {component} of `{name:.120}` (line {line})")
            }
            Replaces::Forces => format!("force {component} on `{name:.60}` (line {line})"),
            Replaces::Pressures => format!("the load on `{name:.60}` (line {line})"),
        })
        .collect();
    match ended.len() - names.len() {
        0 => names.join(", "),
        more => format!("{} and {more} others", names.join(", ")),
    }
}
