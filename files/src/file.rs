//! A mesh file of any format, recognised by its first characters.

use std::io::{BufRead, BufReader};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{abaqus, gmsh, inline::Extract, source::ReadError};
use solver::error::{Reason, Violation, shortened};
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

/// The byte order mark that some editors write before a text.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// Reads a mesh file of any format, with warnings of what was changed. The format is recognised by its first
/// characters.
///
/// # Errors
///
/// [`ReadError::Io`] if the reader fails; [`ReadError::Invalid`] with all violations of the file, which name its lines.
pub fn read_mesh(mut reader: impl BufRead) -> Result<(MeshFormat, Mesh, Vec<Warning>), ReadError> {
    if reader
        .fill_buf()
        .map_err(ReadError::Io)?
        .starts_with(BYTE_ORDER_MARK)
    {
        reader.consume(BYTE_ORDER_MARK.len());
    }
    let start = reader.fill_buf().map_err(ReadError::Io)?;
    let first = start.iter().find(|byte| !byte.is_ascii_whitespace());
    match first {
        Some(b'$') => gmsh::read(reader).map(|(mesh, notes)| (MeshFormat::Gmsh, mesh, notes)),
        Some(b'*') => abaqus::read(reader).map(|(mesh, notes)| (MeshFormat::Abaqus, mesh, notes)),
        Some(b'{') => json(reader).map(|mesh| (MeshFormat::Json, mesh, Vec::new())),
        _ => Err(invalid(
            recognised(start).to_owned(),
            "a Gmsh mesh ($MeshFormat), an Abaqus or CalculiX deck (*HEADING, *NODE), or an inline mesh as JSON",
            "Send the file as it is, without multipart or compression.",
        )),
    }
}

/// A description of a file that is not a mesh, by its first bytes.
fn recognised(start: &[u8]) -> &'static str {
    const KNOWN: [(&[u8], &str); 14] = [
        (b"\x1f\x8b", "a file compressed with gzip"),
        (b"\x28\xb5\x2f\xfd", "a file compressed with zstd"),
        (b"BZh", "a file compressed with bzip2"),
        (b"\xfd7zXZ", "a file compressed with xz"),
        (b"PK\x03\x04", "a ZIP archive"),
        (b"\x89HDF", "an HDF5 file"),
        (b"CDF", "a NetCDF file (Exodus)"),
        (b"\xff\xfe", "a text in UTF-16"),
        (b"\xfe\xff", "a text in UTF-16"),
        (b"--", "a multipart form (with its boundary lines)"),
        (b"%PDF", "a PDF document"),
        (b"# vtk", "a VTK file"),
        (b"<", "an XML or HTML document"),
        (b"solid", "an STL surface"),
    ];
    let known = KNOWN.iter().find(|(first, _)| start.starts_with(first));
    match known {
        Some((_, what)) => what,
        None if start.iter().all(u8::is_ascii_whitespace) => "an empty file",
        None => "a file that begins differently",
    }
}

/// The largest number of characters of a parser's message that are quoted.
const LONGEST: usize = 300;

fn json(reader: impl BufRead) -> Result<Mesh, ReadError> {
    let mut extract = Extract::new(reader, &[]);
    let read = serde_json::from_reader(BufReader::new(&mut extract));
    let taken = extract.taken();
    let mut inline: InlineMesh = read.map_err(|error| {
        if error.is_io() {
            return ReadError::Io(error.into());
        }
        // it quotes a name that may be as long as the file
        let text = taken.places.message(&error);
        let at = taken.places.original(error.line(), error.column());
        invalid(
            match text.len() {
                0..=LONGEST => text,
                _ => format!(
                    "{} at line {} column {}",
                    shortened(&text, LONGEST),
                    at.0,
                    at.1
                ),
            },
            "an inline mesh: nodes, elements, boundaries, groups, node_sets",
            "See `InlineMesh` in /v1/schema/problem.json.",
        )
    })?;
    taken.put(&mut inline);
    let mesh = inline_mesh(inline, "").map_err(ReadError::Invalid)?;
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
    fn a_name_as_long_as_the_file_is_quoted_by_its_beginning() {
        let text = format!("{{\"{}\": []}}", "element".repeat(10_000));
        let Err(ReadError::Invalid(violations)) = read_mesh(text.as_bytes()) else {
            panic!("it is no mesh");
        };
        let got = &violations[0].got;
        assert!(
            got.len() < 400 && got.ends_with("at line 1 column 70004"),
            "{got}"
        );
    }

    #[test]
    fn a_format_is_recognised_by_its_first_characters() {
        let square = r#" {"nodes": [[0,0],[1,0],[1,1],[0,1],[0.5,0],[1,0.5],[0.5,1],[0,0.5]],
            "elements": [[0,1,2,3,4,5,6,7]], "boundaries": {"top": [[3,2,6]]}}"#;
        let (format, mesh, _) = read_mesh(square.as_bytes()).unwrap();
        assert_eq!((format, mesh.elements.len()), (MeshFormat::Json, 1));
        let marked = format!("\u{feff}{square}");
        assert_eq!(read_mesh(marked.as_bytes()).unwrap().1, mesh);
        let reason = |text: &str| match read_mesh(text.as_bytes()) {
            Err(ReadError::Invalid(list)) => format!("{}: {}", list[0].pointer, list[0].reason),
            _ => "nothing".to_owned(),
        };
        assert_eq!(reason("solid cube"), ": malformed");
        assert_eq!(reason(""), ": malformed");
        for (start, name) in [
            (&b""[..], "an empty file"),
            (b" \n", "an empty file"),
            (b"\x1f\x8b\x08\0", "gzip"),
            (b"\x28\xb5\x2f\xfd\0", "zstd"),
            (b"--0123\r\nContent-Disposition: form-data", "multipart"),
            (b"Point(1) = {0, 0, 0};", "begins differently"),
        ] {
            let Err(ReadError::Invalid(list)) = read_mesh(start) else {
                panic!("{name} was read");
            };
            assert!(list[0].got.contains(name), "{}", list[0].got);
        }
        assert_eq!(reason("$MeshFormat\n4.1 0 8\n"), ": truncated");
        assert_eq!(reason("*NODE\n1, 0, 0\n"), ": too_few");
        assert_eq!(
            reason(&square.replace("[1,1]", "[0.1,0.1]")),
            "/elements/0: inverted_element"
        );
        assert_eq!(reason(&square.replace("\"top\"", "top")), ": malformed");
    }

    /// A fault is placed where it is in the whole file, also after lists that were removed from the text, and in a list
    /// that remains from its middle on.
    #[test]
    fn a_fault_is_placed_where_it_is_in_the_whole_file() {
        let square = "{\"nodes\": [[0,0],[1,0],\n[1,1],[0,1],[0.5,0],[1,0.5],[0.5,1],[0,0.5]],\n\
                      \"elements\": [[0,1,2,3,4,5,6,7]], \"boundaries\": {\"top\":\n [[3,2,6]]}}";
        for (from, to) in [
            ("[0,1],", "[0,1,2],"),
            ("[0,1],", "[0,\n-],"),
            ("[0,0.5]]", "[0,0.5]"),
            ("6,7]", "6]"),
            ("6,7]", "6,7.5]"),
            ("\"boundaries\"", "\"nodes\": [], \"boundaries\""),
            ("\"boundaries\"", "\"border\""),
            ("[3,2,6]", "[3,2]"),
            ("[3,2,6]", "[3,2,x]"),
            ("]}}", "]}}}"),
        ] {
            assert!(square.contains(from), "{from}");
            let text = square.replacen(from, to, 1);
            let whole = serde_json::from_reader::<_, InlineMesh>(text.as_bytes()).unwrap_err();
            let Err(ReadError::Invalid(list)) = read_mesh(text.as_bytes()) else {
                panic!("it is no mesh: {text}");
            };
            assert_eq!(list[0].got, whole.to_string());
        }
    }
}
