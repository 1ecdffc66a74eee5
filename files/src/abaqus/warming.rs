//! The changes of temperature at the nodes of a deck, from the first step on.

use super::names::{Meant, Names};
use super::scope::Kind;
use super::written::{Target, Temperature};
use solver::mesh::RawMesh;

/// The largest number of nodes to which rows give temperatures, each counted as often as a row names it.
pub(super) const MOST_TEMPERATURES: usize = 1 << 26;

/// What a deck says of the temperatures of its body.
#[derive(Default)]
pub(super) struct Warming {
    /// The first line by which a node of the body gets another temperature than at the beginning.
    pub(super) first: Option<u64>,
    /// The first line that changes a temperature again in a later step.
    pub(super) later: Option<u64>,
    /// The first line whose node or set is unknown, with the word for it.
    pub(super) unknown: Option<(u64, String)>,
    /// The first line after too many nodes.
    pub(super) too_many: Option<u64>,
}

/// Gives the nodes of `raw` the changes of temperature of the rows, which name a scope each; `used`: whether a node
/// belongs to the body; `step_of`: the step of a line.
pub(super) fn give_temperatures(
    names: &Names<'_>,
    mut rows: Vec<(usize, Temperature)>,
    used: &[bool],
    raw: &mut RawMesh,
) -> Warming {
    let mut found = Warming::default();
    if rows.is_empty() {
        return found;
    }
    // those at the beginning come first
    rows.sort_by_key(|(_, row)| (!row.is_initial, row.line));
    let mut initial = vec![0.0; raw.nodes.len()];
    let mut last: Option<Vec<f64>> = None;
    let mut count = 0;
    for (scope, row) in &rows {
        let Some(meant) = names.meant(Kind::Nodes, *scope, &row.target) else {
            let word = match &row.target {
                Target::Label(label) => label.to_string(),
                Target::Set(name) => name.to_string(),
                Target::Range(_) => String::new(),
            };
            found.unknown.get_or_insert((row.line, word));
            continue;
        };
        let single: Option<u32>;
        let nodes: &[u32] = match &meant {
            Meant::Label(scope, label) => {
                single = names.scopes[*scope].place(Kind::Nodes, *label);
                single.as_slice()
            }
            Meant::Set(_) => raw.node_sets.get(&names.of(&meant)).map_or(&[], |set| set),
        };
        count += nodes.len();
        if count > MOST_TEMPERATURES {
            found.too_many = Some(row.line);
            break;
        }
        if row.is_initial {
            nodes
                .iter()
                .for_each(|node| initial[*node as usize] = row.value);
            continue;
        }
        let last = last.get_or_insert_with(|| initial.clone());
        let later = names.deck.contact.step_of(row.line) > 0;
        for node in nodes.iter().map(|node| *node as usize) {
            if used[node] && row.value != last[node] {
                found.first.get_or_insert(row.line);
                if later {
                    found.later.get_or_insert(row.line);
                }
            }
            last[node] = row.value;
        }
    }
    let Some(mut last) = last.filter(|_| found.first.is_some()) else {
        return found;
    };
    last.iter_mut()
        .zip(&initial)
        .for_each(|(last, initial)| *last -= initial);
    raw.temperatures = last;
    found
}
