//! The mesh that a problem only names or quotes.

use solver::mesh::{External, ExternalMesh, Mesh};
use solver::problem::Problem;
use solver::solution::Warning;

use crate::{ReadError, abaqus, gmsh};

/// The mesh that a problem does not hold itself: `stored`, where its caller has it, or read from the text
/// that the problem quotes. `None` where it needs none. What is wrong with it, and what was changed on the
/// way, points to its place in the problem.
pub fn external_mesh(problem: &Problem, stored: Option<Mesh>) -> Option<External> {
    let mesh = &problem.mesh;
    match (&mesh.gmsh, &mesh.abaqus) {
        (Some(text), None) => Some(at("/mesh/gmsh", gmsh::read(text.as_bytes()))),
        (None, Some(text)) => Some(at("/mesh/abaqus", abaqus::read(text.as_bytes()))),
        (None, None) => stored.map(|mesh| Ok(mesh.into())),
        // the problem is refused as it stands
        (Some(_), Some(_)) => None,
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
