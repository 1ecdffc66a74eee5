//! Decks of Abaqus and CalculiX (`.inp`): nodes, elements, sets and surfaces, and the supported
//! parts of the analysis.
//!
//! Written by hand: there is no crate for the format. A keyword begins with `*`, a comment with `**`,
//! data lines follow their keyword; names are compared without regard to case, as both programs do,
//! and kept as they were first written.

mod block;
mod deck;
mod keyword;
mod names;
mod problem;
mod read;

pub use problem::problem;

use std::io::BufRead;

use crate::source::ReadError;
use solver::mesh::{self, Mesh};
use solver::solution::Warning;

/// Reads the mesh of a deck, with warnings of what was changed. The analysis of the deck is not used, except that
/// the sets and faces that it loads get names: `SET P3` for a pressure on the third
/// sides of the elements of SET, `7` for the node 7.
pub fn read(reader: impl BufRead) -> Result<(Mesh, Vec<Warning>), ReadError> {
    let deck = read::read(reader)?;
    let (raw, faults) = deck.into_raw();
    let raw = faults.into_result(raw);
    raw.and_then(mesh::build).map_err(ReadError::Invalid)
}
