//! Divides the members that share a body into pieces, which several workers solve at the same time. Each member keeps its
//! neighbour, from whose solution it starts, so that its numbers have the same bits: a piece whose first members start from
//! others solves those first, at most some 64 for each axis.

use super::{check::Group, plan::Plan};

/// The smallest number of members of a piece: a piece makes its body anew.
const LEAST: usize = 500;

impl Plan {
    /// Divides groups of members that share a body, each into at most this many pieces; neighbours stay together. The plan then
    /// knows the groups that were divided.
    pub fn divide(&mut self, groups: Vec<Group>, most: usize) -> Vec<Group> {
        let mut pieces = vec![];
        for group in groups {
            let count = (group.len() / LEAST).clamp(1, most.max(1));
            let mut rest = 0;
            for piece in 1..count {
                let cut = self.start_of_line(&group, piece * group.len() / count);
                pieces.push(group[rest..cut].to_vec());
                rest = cut;
            }
            pieces.push(group[rest..].to_vec());
            if count > 1 {
                self.divided.push(group);
            }
        }
        pieces
    }

    /// The place near `place`, not before it, of a member that does not start from the one before; `place` if there is none near.
    fn start_of_line(&self, group: &Group, place: usize) -> usize {
        let near = place..group.len().min(place + LEAST / 4);
        let starts = |place: &usize| {
            let neighbour = self.neighbour(group, *place);
            neighbour.is_none_or(|neighbour| !neighbour.adjacent)
        };
        near.into_iter().find(starts).unwrap_or(place)
    }

    /// All members that share a body with this one, in order, if their group was divided.
    pub fn divided(&self, number: usize) -> Option<&Group> {
        let has = |group: &&Group| group.binary_search(&number).is_ok();
        self.divided.iter().find(has)
    }
}
