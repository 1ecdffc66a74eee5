//! Problems and meshes from texts and files, results and figures as files: all input and output of `solver`. Bytes in,
//! bytes out, never a path.
//!
//! ```
//! let text = r#"{
//!     "analysis": {"kind": "plane_strain"},
//!     "mesh": {"grid": {"x": [0, 0.5, 1, 2], "y": [-2, -1, 0]}},
//!     "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
//!     "supports": [{"boundary": "left", "ux": 0}, {"boundary": "bottom", "ux": 0, "uy": 0}],
//!     "contacts": [{"boundary": "top", "obstacle": {"kind": "flat", "from": 0, "to": 1}, "indentation": 0.01}]
//! }"#;
//! let problem = files::parse(text).expect("a valid problem");
//! let solution = solver::solve(&problem, &mut ())?;
//! println!("normal force {}", solution.summary.normal_force);
//!
//! // the stresses along the contact as CSV, a line for each point
//! let csv = files::table::Table::of_profile(&solution.profiles["top"]).csv()?;
//! assert!(csv.starts_with("s,x,y,"));
//!
//! // every fault of a problem is reported with its place and advice
//! let violations = files::parse(&text.replace("indentation", "identation")).unwrap_err();
//! assert_eq!(violations[0].pointer, "/contacts/0/identation");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Where to look
//!
//! | subject | where |
//! |---|---|
//! | a problem from JSON | `json.rs` |
//! | JSON Schemas, and all violations of them | `schema` |
//! | bodies of requests | `body.rs` |
//! | large inline meshes | `inline.rs` |
//! | a mesh file of any format | `file.rs` |
//! | Gmsh | `gmsh.rs` |
//! | decks of Abaqus and CalculiX | `abaqus` |
//! | reading by lines with their numbers | `source.rs` |
//! | the mesh that a problem names or contains as text | `external.rs` |
//! | sweeps | `sweep` |
//! | the place in a text that a JSON Pointer names | `pointer` |
//! | columns of profiles and histories, as CSV and JSON Lines | `table.rs` |
//! | Arrow | `arrow.rs` |
//! | NumPy | `npz.rs` |
//! | fields as arrays | `fields.rs` |
//! | fields as JSON | `fields_json.rs` |
//! | fields as VTU | `vtu.rs` |
//! | principal stresses | `stress.rs` |
//! | fields as the service stores them | `columns` |
//! | the compressor of each thread | `deflate.rs` |
//! | figures | `plot` |

// In: problems as JSON, and sweeps of them; meshes as Gmsh files and as decks of Abaqus or CalculiX.
pub mod abaqus;
pub mod body;
pub mod gmsh;
pub mod json;

pub mod sweep;

pub mod pointer;

mod external;
mod file;
mod inline;
mod schema;
mod source;

// Out: tables (those that are text in `table`), fields (`columns`: as they are stored), figures.
pub mod arrow;
pub mod columns;
pub mod fields;
pub mod fields_json;
pub mod npz;
pub mod plot;
pub mod stress;
pub mod table;
pub mod vtu;

pub mod deflate; // what these share
mod number;

pub use external::external_mesh;
pub use file::{MeshFormat, read_mesh};
pub use json::{parse, read};
pub use schema::{meant, quoted, schema};
pub use source::{BYTE_ORDER_MARK, ReadError, text};

#[cfg(test)]
mod tests {
    #[test]
    #[should_panic(expected = "attempt to add with overflow")]
    fn an_overflow_is_a_panic_in_the_profile_that_ships() {
        let most = std::hint::black_box(u32::MAX);
        std::hint::black_box(most + 1);
    }
}
