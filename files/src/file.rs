//! A mesh file of any format, recognised by its first characters.

use std::io::BufRead;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{abaqus, gmsh, source::ReadError};
use solver::error::{Reason, Violation};
use solver::mesh::{Mesh, check_inverted, inline_mesh};
use solver::problem::InlineMesh;
use solver::solution::Warning;

/// Formats of mesh files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MeshFormat {
    /// MSH 2.2 or 4.1 of Gmsh.
    Gmsh,
    /// A deck of Abaqus or CalculiX.
    Abaqus,
    /// An inline mesh: `{"nodes": …, "elements": …}`.
    Json,
}

/// Reads a mesh file, with warnings of what was changed.
pub fn read_mesh(mut reader: impl BufRead) -> Result<(MeshFormat, Mesh, Vec<Warning>), ReadError> {
    let start = reader.fill_buf().map_err(ReadError::Io)?;
    let first = start.iter().find(|byte| !byte.is_ascii_whitespace());
    match first {
        Some(b'$') => gmsh::read(reader).map(|(mesh, notes)| (MeshFormat::Gmsh, mesh, notes)),
        Some(b'*') => abaqus::read(reader).map(|(mesh, notes)| (MeshFormat::Abaqus, mesh, notes)),
        Some(b'{') => json(reader).map(|mesh| (MeshFormat::Json, mesh, Vec::new())),
        _ => Err(invalid(
            "a file that begins differently".to_owned(),
            "a Gmsh mesh ($MeshFormat), an Abaqus or CalculiX deck (*HEADING, *NODE), or an inline mesh as JSON",
            "Send the file as it is, without multipart or compression.",
        )),
    }
}

fn json(reader: impl BufRead) -> Result<Mesh, ReadError> {
    let inline: InlineMesh = serde_json::from_reader(reader).map_err(|error| {
        if error.is_io() {
            return ReadError::Io(error.into());
        }
        invalid(
            error.to_string(),
            "an inline mesh: nodes, elements, boundaries, groups, node_sets",
            "See `InlineMesh` in /v1/schema/problem.json.",
        )
    })?;
    let mesh = inline_mesh(&inline, "").map_err(ReadError::Invalid)?;
    let upright = check_inverted(&mesh, true, |e| format!("/elements/{e}"), "");
    upright.map_err(ReadError::Invalid)?;
    Ok(mesh)
}

fn invalid(got: String, expected: &str, hint: &str) -> ReadError {
    let reason = Reason::Malformed;
    ReadError::Invalid(vec![Violation::new("", reason, got, expected, hint)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_format_is_recognised_by_its_first_characters() {
        let square = r#" {"nodes": [[0,0],[1,0],[1,1],[0,1],[0.5,0],[1,0.5],[0.5,1],[0,0.5]],
            "elements": [[0,1,2,3,4,5,6,7]], "boundaries": {"top": [[3,2,6]]}}"#;
        let (format, mesh, _) = read_mesh(square.as_bytes()).unwrap();
        assert_eq!((format, mesh.elements.len()), (MeshFormat::Json, 1));
        let reason = |text: &str| match read_mesh(text.as_bytes()) {
            Err(ReadError::Invalid(list)) => format!("{}: {}", list[0].pointer, list[0].reason),
            _ => "nothing".to_owned(),
        };
        assert_eq!(reason("solid cube"), ": malformed");
        assert_eq!(reason(""), ": malformed");
        assert_eq!(reason("$MeshFormat\n4.1 0 8\n"), ": truncated");
        assert_eq!(reason("*NODE\n1, 0, 0\n"), ": too_few");
        assert_eq!(
            reason(&square.replace("[1,1]", "[0.1,0.1]")),
            "/elements/0: inverted_element"
        );
        assert_eq!(reason(&square.replace("\"top\"", "top")), ": malformed");
    }
}
