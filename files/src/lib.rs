//! Problems and meshes from texts and files, results and figures as files: all input and output
//! of `solver`. Bytes in, bytes out, never a path.

// In: problems as JSON, and sweeps of them; meshes as Gmsh files and as decks of Abaqus or CalculiX.
pub mod abaqus;
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

mod number; // what these share

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
