//! Decks of Abaqus and CalculiX (`.inp`): nodes, elements, sets and surfaces, and the supported parts of the analysis.
//!
//! The reader is written by hand, since there is no crate for the format. A keyword begins with `*`, a comment with
//! `**`; data lines follow their keyword. Names are compared without regard to case, as both programs do, and kept as
//! they were first written.
//!
//! As a mesh a deck needs elements of a plane and nothing else: other elements are left out or, if they are lines, name
//! boundaries, and the deck's analysis is not read. As a problem, everything that changes the solution must be
//! understood.
//!
//! # Where to look
//!
//! | subject | where |
//! |---|---|
//! | lines, keywords and data | `read`, `keyword`, `block` |
//! | which keywords are supported | `supported` |
//! | rows, sets, sections and materials as read | `written` |
//! | data about contact as read | `contact_parts` |
//! | all data of a deck | `deck` |
//! | types of elements | `element` |
//! | parts, instances and the assembly | `part`, `scope` |
//! | resolving names and numbers | `names` |
//! | one mesh from all parts | `build` |
//! | a deck as a problem | `problem` |
//! | supports of a deck | `supports` |
//! | temperatures of a deck | `temperature` |
//! | contact: reading its keywords | `interaction` |
//! | contact: rigid bodies, their shapes, their motion | `rigid`, `tool`, `steps` |
//! | contact: the contacts made of them | `contact` |
//! | OP=NEW in later steps | `replaced` |

mod block;
mod build;
mod contact;
mod contact_parts;
mod deck;
mod element;
mod interaction;
mod keyword;
mod names;
mod part;
mod problem;
mod read;
mod replaced;
mod rigid;
mod scope;
mod steps;
mod supported;
mod supports;
mod temperature;
mod tool;
mod written;

pub use problem::{has_step, problem, problem_with_warnings};

use std::io::BufRead;

use crate::source::ReadError;
use solver::mesh::{self, Mesh};
use solver::solution::{Warning, WarningCode};

/// Reads the mesh of a deck, with warnings of what was changed. The analysis of the deck is not used, except that the
/// sets and faces that it loads get names: `SET P3` for a pressure on the third sides of the elements of SET, `7` for
/// the node 7.
///
/// # Errors
///
/// [`ReadError::Io`] if the reader fails; [`ReadError::Invalid`] with all violations of the deck, which name its lines.
pub fn read(reader: impl BufRead) -> Result<(Mesh, Vec<Warning>), ReadError> {
    read_for(reader, |_| false)
}

/// Reads the mesh of a deck that a problem contains. `holds`: whether the problem has a support on a given set of
/// nodes; if overlapping rows of `*BOUNDARY` have reduced that set, a warning says so.
pub(crate) fn read_for(
    reader: impl BufRead,
    holds: impl Fn(&str) -> bool,
) -> Result<(Mesh, Vec<Warning>), ReadError> {
    let mut built = read::read(reader)?.build();
    let left_out = built.tools.warning();
    let supports = supports::supports(&built);
    built.raw.node_sets.extend(supports.sets);
    let raw = built.faults.into_result(built.raw);
    let read = raw.and_then(mesh::build).map_err(ReadError::Invalid);
    let overlaps = supports.overlaps.into_iter().filter(|(set, _)| holds(set));
    let overlaps = overlaps.map(|(_, message)| Warning {
        code: WarningCode::SupportsOverlap,
        pointer: String::new(),
        message,
    });
    read.map(|(mesh, mut warnings)| {
        warnings.extend(left_out);
        warnings.extend(overlaps);
        (mesh, warnings)
    })
}
