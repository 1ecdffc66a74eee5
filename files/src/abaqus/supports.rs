//! Supports from the rows of `*BOUNDARY`. As in CalculiX, the last row that prescribes a displacement of a node is
//! used.

use std::collections::{BTreeMap, HashMap};

use super::build::{Built, Row};
use super::written::Prescribed;
use solver::problem::{BoundaryValue, Support};

/// The prescribed value of one displacement component at a set of nodes.
struct Entry<'a> {
    line: u64,
    set: &'a str,
    /// The component: 0 for x, 1 for y.
    component: usize,
    value: f64,
}

/// The supports of a deck.
pub(super) struct Supports {
    pub(super) list: Vec<Support>,
    /// Sets of nodes that the deck does not have: what is left of a set of the deck where later rows apply to its other
    /// nodes.
    pub(super) sets: BTreeMap<String, Vec<u32>>,
    /// For each overlap of supports: a set, and a message for the case that a problem uses this set.
    pub(super) overlaps: Vec<(String, String)>,
    /// The lines and targets of rows that prescribe displacements of no node, or nonzero displacements of nodes without
    /// an element.
    pub(super) of_no_element: Vec<(u64, String)>,
}

/// The supports that the rows of a deck prescribe.
pub(super) fn supports(built: &Built) -> Supports {
    let mut found = Supports {
        list: Vec::new(),
        sets: BTreeMap::new(),
        overlaps: Vec::new(),
        of_no_element: Vec::new(),
    };
    let mut holds: [Vec<Option<u32>>; 2] = [0, 1].map(|_| vec![None; built.raw.nodes.len()]);
    let entries = entries(&built.prescribed);
    let mut kept: Vec<(usize, String)> = Vec::new();
    for (place, entry) in entries.iter().enumerate().rev() {
        let all = built
            .raw
            .node_sets
            .get(entry.set)
            .map_or(&[][..], |set| set);
        let mut nodes: Vec<u32> = all
            .iter()
            .copied()
            .filter(|node| built.used[*node as usize])
            .collect();
        if nodes.is_empty() {
            // a reference point may be held
            if all.is_empty() || entry.value != 0.0 {
                found.of_no_element.push((entry.line, entry.set.to_owned()));
            }
            continue;
        }
        let holds = &mut holds[entry.component];
        let mut other: Option<(u32, &Entry<'_>)> = None;
        nodes.retain(|node| {
            let later = holds[*node as usize].map(|later| &entries[later as usize]);
            let differs = later.filter(|later| later.value != entry.value);
            other = other.or(differs.map(|later| (*node, later)));
            holds[*node as usize].get_or_insert(place as u32);
            differs.is_none()
        });
        let Some((node, later)) = other else {
            kept.push((place, entry.set.to_owned()));
            continue;
        };
        let name = format!(
            "{} (u{}, line {})",
            entry.set,
            ["x", "y"][entry.component],
            entry.line
        );
        let told = if nodes.is_empty() {
            later.set
        } else {
            &name[..]
        };
        let message = overlap(built, entry, node, later);
        found.overlaps.push((told.to_owned(), message));
        if !nodes.is_empty() {
            found.sets.insert(name.clone(), nodes);
            kept.push((place, name));
        }
    }
    found.overlaps.reverse();
    kept.reverse();
    let mut places: HashMap<String, usize> = HashMap::new();
    for (entry, set) in kept {
        let entry = &entries[entry];
        let place = *places.entry(set).or_insert_with_key(|set| {
            found.list.push(Support {
                nodes: Some(set.clone()),
                ..Support::default()
            });
            found.list.len() - 1
        });
        let value = Some(BoundaryValue::Constant(entry.value));
        match entry.component {
            0 => found.list[place].ux = value,
            _ => found.list[place].uy = value,
        }
    }
    found
}

/// The prescribed values in the order of the deck; of several values for one component of a set only the last.
fn entries(rows: &[Row<Prescribed>]) -> Vec<Entry<'_>> {
    let mut entries: Vec<Option<Entry<'_>>> = Vec::new();
    let mut places: HashMap<(&str, usize), usize> = HashMap::new();
    for Row { row, name } in rows {
        let (first, last) = row.components;
        for component in first as usize..=last as usize {
            let component = component - 1;
            if let Some(earlier) = places.insert((&name[..], component), entries.len()) {
                entries[earlier] = None;
            }
            entries.push(Some(Entry {
                line: row.line,
                set: name,
                component,
                value: row.value,
            }));
        }
    }
    entries.into_iter().flatten().collect()
}

fn overlap(built: &Built, entry: &Entry<'_>, node: u32, later: &Entry<'_>) -> String {
    let label = built.raw.node_labels[node as usize];
    let [x, y] = built.raw.nodes[node as usize];
    let Entry {
        line, set, value, ..
    } = entry;
    format!(
        "Node {label} at ({x}, {y}) belongs to `{set:.60}` (line {line}: u{} = {value}) and to `{:.60}` (line {}: {}). The later line is used there, as in CalculiX.",
        ["x", "y"][entry.component],
        later.set,
        later.line,
        later.value,
    )
}
