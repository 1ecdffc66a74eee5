//! Sweeps: one base problem, and many problems that differ from it in a few values, the members.
//!
//! A sweep is stored as text: the base problem with gaps for values, and the values. A member is that text with the
//! member's values filled in, which is then read as any other problem. The mesh of the base is not part of this text
//! unless the sweep changes it, so that a large mesh is read only once.
//!
//! # Where to look
//!
//! | subject | where |
//! |---|---|
//! | reading a definition, with all its violations | `read` |
//! | values of axes and points | `values` |
//! | pointers | `path` |
//! | the list of all members | `plan` |
//! | a member's text | `template` |
//! | checking the members and grouping those that share a body | `check` |
//! | members that differ in numbers only | `numbers` |
//! | the member that a member starts from | `neighbours` |
//! | members that share a body, divided among workers | `pieces` |

mod check;
mod neighbours;
mod numbers;
mod path;
mod pieces;
mod plan;
mod read;
mod template;
mod values;

pub use check::{Group, MOST_TOLD, groups, has_own_meshes};
pub use neighbours::Neighbour;
pub use numbers::{Problems, Read};
pub use path::{MOST_POINTER_BYTES, MOST_POINTER_TOKENS};
pub use plan::{MOST_BYTES, MOST_MEMBERS, MOST_PATHS, MOST_VALUE_BYTES, Mode, Plan};
pub use read::{Sweep, of_body, read};
pub use values::{Axis, Points, Spaced, Variation};

#[cfg(test)]
mod tests;
