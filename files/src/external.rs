//! The mesh of a problem that only names it by its hash, or contains it as text.

use std::collections::BTreeSet;

use solver::mesh::{External, ExternalMesh, Mesh};
use solver::problem::{MeshSource, Problem};
use solver::solution::Warning;

use crate::{abaqus, gmsh, source::ReadError};

/// The mesh of a problem that does not have it in readable form: read from the text in the problem, or `stored`, the
/// mesh that the problem names by its hash. `None` if the problem needs none or `stored` is missing. Violations and
/// warnings point to the place of the mesh in the problem.
pub fn external_mesh(problem: &Problem, stored: Option<Mesh>) -> Option<External> {
    match &problem.mesh.source {
        MeshSource::Grid(_) | MeshSource::Inline(_) => None,
        MeshSource::Gmsh(text) => Some(at("/mesh/gmsh", gmsh::read(text.as_bytes()))),
        MeshSource::Abaqus(text) => {
            let sets = problem
                .supports
                .iter()
                .filter_map(|support| support.nodes.as_deref());
            let sets: BTreeSet<&str> = sets.collect();
            let read = abaqus::read_for(text.as_bytes(), |set| sets.contains(set));
            let mut external = at("/mesh/abaqus", read);
            if let Ok(external) = &mut external {
                external.warnings.extend(of_deck(problem, text));
            }
            Some(external)
        }
        MeshSource::Stored(_) => stored.map(|mesh| Ok(mesh.into())),
    }
}

/// What a problem does not take over from the deck that it has as its mesh, if it is the problem of that deck: its mesh may
/// be refined, and its solver be another.
fn of_deck(problem: &Problem, text: &str) -> Vec<Warning> {
    if !abaqus::has_step(text) {
        return vec![];
    }
    match abaqus::problem_with_warnings(text) {
        Ok((deck, warnings))
            if deck.contacts == problem.contacts
                && deck.materials == problem.materials
                && deck.supports == problem.supports
                && deck.loads == problem.loads =>
        {
            warnings
        }
        Ok(_) | Err(_) => vec![],
    }
}

fn at(pointer: &str, read: Result<(Mesh, Vec<Warning>), ReadError>) -> External {
    let pointer = || pointer.to_owned();
    match read {
        Ok((mesh, mut warnings)) => {
            warnings
                .iter_mut()
                .for_each(|warning| warning.pointer = pointer());
            Ok(ExternalMesh { mesh, warnings })
        }
        Err(error) => {
            let mut violations = error.into_violations();
            violations
                .iter_mut()
                .for_each(|violation| violation.pointer = pointer());
            Err(violations)
        }
    }
}
