//! Chooses the member from whose solution another member starts: one that differs from it in one value of a grid, by
//! one place. The choice depends on the sweep alone, so that a member's numbers have the same bits whichever members
//! were solved before, by which worker, and when.

use super::check::Group;
use super::plan::{Plan, Values};

/// The number of consecutive members of a line that start from each other; the next one starts from the first of them
/// again. Solving one member again requires those before it.
const CHAIN: usize = 64;

/// The member that another one starts from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Neighbour {
    /// The number of that member.
    pub number: usize,
    /// The number of the line that both are on, along an axis of the grid: once its last member is known, those before
    /// it on the line are not needed again.
    pub line: usize,
    /// Whether the neighbour is the previous member in the group.
    pub adjacent: bool,
}

impl Plan {
    /// The number of lines that members of a group are on.
    pub fn lines(&self) -> usize {
        self.paths.len() + 2
    }

    /// The member that the one at a place of its group starts from; none for the first, which is alone on line 0.
    pub fn neighbour(&self, group: &Group, place: usize) -> Option<Neighbour> {
        let (first, number) = (*group.first()?, *group.get(place)?);
        if place == 0 {
            return None;
        }
        let found = |number: usize, line: usize| Neighbour {
            number,
            line,
            adjacent: group[place - 1] == number,
        };
        let axes = match &self.values {
            Values::Grid(axes) => axes,
            Values::Zip(_) | Values::List(_) => {
                let number = match place % CHAIN {
                    0 => first,
                    _ => group[place - 1],
                };
                return Some(found(number, 1));
            }
        };
        // the fastest axis comes last: the first member of a line along it begins from the line before
        let mut step = 1;
        for (axis, values) in axes.iter().enumerate().rev() {
            let index = number / step % values.len().max(1);
            let before = match index {
                0 => None,
                _ if index.is_multiple_of(CHAIN) => Some(number - step * index),
                _ => Some(number - step),
            };
            if let Some(number) = before.filter(|before| group.binary_search(before).is_ok()) {
                return Some(found(number, axis + 1));
            }
            step *= values.len().max(1);
        }
        Some(found(first, self.lines() - 1))
    }
}
