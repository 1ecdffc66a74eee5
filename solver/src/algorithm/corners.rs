//! Decisions after a solution about the ends of contacts: which contact owns each common end, and which nodes on the
//! axis stay open.

use std::collections::BTreeSet;

use crate::algorithm::system::{Patch, State, System};
use crate::model::Alone;

/// The smallest penetration of an obstacle into the body, as a part of the length of the contact, that is not rounding.
const ROUNDING: f64 = 1e-10;

/// Common nodes of two contacts that were assigned to one contact alone, although the obstacle of the other contact
/// reaches into the body there.
pub fn touched_by_both(system: &System<'_>, state: &State) -> Vec<u32> {
    let mut found = Vec::new();
    for patch in &system.patches {
        let boundary = &patch.contact.boundary;
        let least = ROUNDING * boundary.length();
        for (i, node) in system.range(patch).enumerate() {
            let follows = system.nodes[node].follows.is_some();
            if follows && system.opening(&state.v, node) < -least {
                found.push(boundary.nodes[i]);
            }
        }
    }
    found
}

/// The better assignment of each common node to one contact, judged by `state`, or without a solution so far by `both`
/// alone. The nodes in `both` are known to touch both obstacles. None if the assignment does not change.
pub fn better(system: &System<'_>, state: Option<&State>, both: &BTreeSet<u32>) -> Option<Alone> {
    let model = system.model;
    let mut alone = model.alone.clone();
    alone.retain(|node, _| !both.contains(node));
    let Some(state) = state else {
        return (alone != model.alone).then_some(alone);
    };
    let touches = |c: usize| {
        let mut nodes = system.range(&system.patches[c]);
        nodes.any(|node| state.active[node])
    };
    let touches_at = |c: usize, node: u32| {
        let patch = &system.patches[c];
        let mut places = patch.contact.boundary.nodes.iter().zip(system.range(patch));
        places.any(|(n, i)| *n == node && state.active[i])
    };
    for (node, contacts) in model.common_nodes() {
        if both.contains(&node) {
            continue;
        }
        let at = contacts.map(|c| touches_at(c, node));
        let anywhere = contacts.map(touches);
        let only = match (at, anywhere) {
            ([true, false], _) | ([false, false], [true, false]) => contacts[0],
            ([false, true], _) | ([false, false], [false, true]) => contacts[1],
            _ => continue,
        };
        alone.insert(node, only);
    }
    (alone != model.alone).then_some(alone)
}

/// Nodes on the axis that are open while the midside node beside them is pressed, since the obstacle is hollow there.
pub fn open_on_axis(system: &System<'_>, state: &State) -> BTreeSet<u32> {
    let beside = |patch: &Patch<'_>, i: usize| {
        let end = system.nodes[i].beside_axis?;
        let pressed = state.active[i] && !state.active[end];
        pressed.then(|| patch.contact.boundary.nodes[end - patch.first])
    };
    let patches = system.patches.iter();
    let found = patches.flat_map(|patch| system.range(patch).filter_map(|i| beside(patch, i)));
    found.collect()
}

/// Whether a node on the axis that was set to stay open touches.
pub fn closed_on_axis(system: &System<'_>, state: &State) -> bool {
    let open = &system.model.open_on_axis;
    system.patches.iter().any(|patch| {
        let nodes = patch.contact.boundary.nodes.iter();
        let mut nodes = nodes.zip(system.range(patch));
        nodes.any(|(node, i)| state.active[i] && open.contains(node))
    })
}
