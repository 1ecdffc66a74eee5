//! Chooses the member from whose solution another member of a sweep starts: in a grid, a member whose value on one axis
//! is the value before. The choice depends on the sweep alone, so that a member's numbers have the same bits whichever
//! members were solved before, by which worker, and when.

use super::check::Group;
use super::plan::{Plan, Values};

/// The number of consecutive members of a line of the grid that each start from the member before; the next member
/// starts from the first member of the line again. To solve one member alone, all members that it depends on are solved
/// before.
const CHAIN: usize = 64;

/// The member of a sweep from whose solution another member starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Neighbour {
    /// The number of this member.
    pub number: usize,
    /// The number of the line of the grid that both members are on, along one of its axes. Once the last member of a
    /// line is solved, the solutions of the members before it are not needed again for this line.
    pub line: usize,
    /// Whether the neighbour is the previous member in the group.
    pub adjacent: bool,
}

impl Plan {
    /// The number of possible values of `Neighbour::line`: 0, one for each path of the sweep, and one for members that
    /// start from the first member of their group for want of another.
    pub fn lines(&self) -> usize {
        self.paths.len() + 2
    }

    /// The member that the member at `place` of its group starts from; none for the first member of the group.
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
