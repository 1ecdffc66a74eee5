//! The mesh of a problem that only names it by its hash, or contains it as text.

use solver::mesh::{External, ExternalMesh, Mesh};
use solver::problem::{MeshSource, Problem};
use solver::solution::Warning;

use crate::{abaqus, gmsh, source::ReadError};

/// The mesh of a problem that does not have it in readable form: read from the text in the problem, or `stored`, the
/// mesh that the problem names by its hash. `None` if the problem needs none or `stored` is missing. Violations and
/// warnings point to the place of the mesh in the problem.
pub fn external_mesh(problem: &Problem, stored: Option<Mesh>) -> Option<External> {
    match &problem.mesh.source {
        MeshSource::Grid(_) | MeshSource::Grids(_) | MeshSource::Inline(_) => None,
        MeshSource::Gmsh(text) => Some(at("/mesh/gmsh", gmsh::read(text.as_bytes()))),
        MeshSource::Abaqus(text) => {
            let read = abaqus::read_for(text.as_bytes(), Some(problem));
            Some(at("/mesh/abaqus", read))
        }
        MeshSource::Stored(_) => stored.map(|mesh| Ok(mesh.into())),
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
