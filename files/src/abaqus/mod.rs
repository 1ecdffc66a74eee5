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
//! | springs between nodes and the ground | `spring` |
//! | gravity, rotation and densities of a deck | `mass` |
//! | temperatures of a deck, and the expansion of materials | `temperature` |
//! | the changes of temperature at its nodes | `warming` |
//! | contact: reading its keywords | `interaction` |
//! | contact: rigid bodies, their shapes, their motion | `rigid`, `tool`, `steps` |
//! | contact: the contacts made of them | `contact` |
//! | contact: two elastic bodies | `bodies` |
//! | OP=NEW in later steps | `replaced` |

mod block;
mod bodies;
mod build;
mod contact;
mod contact_parts;
mod deck;
mod element;
mod interaction;
mod keyword;
mod mass;
mod names;
mod part;
mod problem;
mod read;
mod replaced;
mod rigid;
mod scope;
mod spring;
mod steps;
mod supported;
mod supports;
mod temperature;
mod tool;
mod warming;
mod written;

pub use problem::{has_step, problem, problem_with_warnings};

use std::collections::BTreeSet;
use std::io::BufRead;

use crate::source::ReadError;
use solver::mesh::{self, Mesh};
use solver::problem::{Contact, Problem};
use solver::solution::{Warning, WarningCode};

/// Reads the mesh of a deck, with warnings of what was changed. The analysis of the deck is not used, except that the
/// sets and faces that it loads get names: `SET P3` for a pressure on the third sides of the elements of SET, `7` for
/// the node 7.
///
/// # Errors
///
/// [`ReadError::Io`] if the reader fails; [`ReadError::Invalid`] with all violations of the deck, which name its lines.
pub fn read(reader: impl BufRead) -> Result<(Mesh, Vec<Warning>), ReadError> {
    read_for(reader, None)
}

/// Reads the mesh of a deck that a problem contains, with warnings of how that problem deviates from the deck, if it is
/// the deck's own.
pub(crate) fn read_for(
    reader: impl BufRead,
    problem: Option<&Problem>,
) -> Result<(Mesh, Vec<Warning>), ReadError> {
    let mut built = read::read(reader)?.build();
    let left_out = built.tools.warning();
    let supports = supports::supports(&built);
    let springs = built.spring_supports(1.0);
    let elastic = (problem.is_some() && built.is_problem()).then(|| built.elastic());
    let mut raw = std::mem::take(&mut built.raw);
    raw.node_sets.extend(supports.sets);
    for (support, nodes) in springs {
        raw.node_sets
            .extend(support.nodes.map(|name| (name, nodes)));
    }
    let faults = std::mem::take(&mut built.faults);
    let read = faults.into_result(raw).and_then(mesh::build);
    let (mesh, mut warnings) = read.map_err(ReadError::Invalid)?;
    warnings.extend(left_out);
    let Some(problem) = problem else {
        return Ok((mesh, warnings));
    };
    let held = problem.supports.iter();
    let held: BTreeSet<&str> = held
        .filter_map(|support| support.nodes.as_deref())
        .collect();
    let overlaps = supports.overlaps.into_iter();
    let overlaps = overlaps.filter(|(set, _)| held.contains(set.as_str()));
    warnings.extend(overlaps.map(|(_, message)| Warning {
        code: WarningCode::SupportsOverlap,
        pointer: String::new(),
        message,
    }));
    if let Some(Ok((deck, mut deviations))) = elastic.map(|part| built.problem(part, Some(&mesh)))
        && is_from_deck(problem, &deck)
    {
        if !is_of_deck(problem, &deck) {
            for deviation in &mut deviations {
                let message = &mut deviation.message;
                *message = format!("Of the deck, before it was changed: {message}");
            }
        }
        warnings.extend(deviations);
    }
    Ok((mesh, warnings))
}

/// Whether a problem is the one of a deck. Its mesh may be refined, and its solver be another.
fn is_of_deck(problem: &Problem, deck: &Problem) -> bool {
    deck.contacts == problem.contacts
        && deck.materials == problem.materials
        && deck.supports == problem.supports
        && deck.loads == problem.loads
}

/// Whether a problem was made from that of a deck, with some values changed: it has a contact of the same surface with
/// the same obstacle or, where the deck has no contact, the same supports and loads.
fn is_from_deck(problem: &Problem, deck: &Problem) -> bool {
    if deck.contacts.is_empty() {
        return deck.supports == problem.supports && deck.loads == problem.loads;
    }
    let of_deck = |own: &Contact| {
        let same =
            |other: &Contact| (&other.boundary, &other.obstacle) == (&own.boundary, &own.obstacle);
        deck.contacts.iter().any(same)
    };
    problem.contacts.iter().any(of_deck)
}
