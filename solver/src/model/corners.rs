//! Common ends of two contacts. Where both contacts touch, the node's displacement is measured along both normals, and
//! no friction acts on it (formulation 3.3). Where only one touches, the node belongs to that one alone, with its
//! normal and tangent; the displacements that the other contact needs there follow from these.

use std::collections::BTreeMap;

use super::contact_model::ContactModel;
use super::level::Level;
use super::supports::Held;
use crate::problem::Step;

/// Each common node of two contacts that belongs to one of them alone, with the index of this contact in the model.
pub type Alone = BTreeMap<u32, usize>;

/// A first guess of the contact that each common node belongs to: the one whose obstacle overlaps the body there; both
/// if both obstacles do; the nearer one if none does. A contact with a prescribed friction bound counts as overlapping.
pub(super) fn guess(
    contacts: &[ContactModel],
    fixed: &BTreeMap<u32, Held>,
    steps: &[Step],
) -> Alone {
    let ends = Level::ends_of(steps);
    let nearest = |c: usize, node: u32| {
        let contact = &contacts[c];
        let place = contact.boundary.nodes.iter().position(|n| *n == node);
        let law = contact.friction.as_ref();
        match place {
            Some(i) if law.is_none_or(|law| law.bound.radius().is_some()) => {
                let gaps = ends.iter().map(|level| contact.gap(i, level));
                gaps.fold(f64::INFINITY, f64::min)
            }
            _ => f64::NEG_INFINITY,
        }
    };
    let mut alone = Alone::new();
    for (node, [a, b]) in common(contacts, fixed) {
        let gaps = [nearest(a, node), nearest(b, node)];
        if gaps.iter().any(|gap| *gap > 0.0) {
            alone.insert(node, if gaps[0] <= gaps[1] { a } else { b });
        }
    }
    alone
}

/// The nodes that belong to two contacts, with the indices of both in `contacts`; without supported nodes, which always
/// belong to both.
pub(super) fn common(
    contacts: &[ContactModel],
    fixed: &BTreeMap<u32, Held>,
) -> BTreeMap<u32, [usize; 2]> {
    let mut first: BTreeMap<u32, usize> = BTreeMap::new();
    let mut common = BTreeMap::new();
    for (c, contact) in contacts.iter().enumerate() {
        let nodes = &contact.boundary.nodes;
        for node in [nodes[0], nodes[nodes.len() - 1]] {
            if let Some(other) = first.insert(node, c)
                && !fixed.contains_key(&node)
            {
                common.insert(node, [other, c]);
            }
        }
    }
    common
}
