//! What comes in and what goes out: readers, text and bytes, never paths.

// In.
pub mod abaqus;
pub mod gmsh;
pub mod json;

mod file;
mod source;

// Out: tables (CSV and JSON Lines are in `table`), fields, figures.
pub mod arrow;
pub mod fields;
pub mod npz;
pub mod plot;
pub mod stress;
pub mod table;
pub mod vtu;

mod number; // what these share

pub use file::{MeshFormat, read_mesh};
pub use source::ReadError;
