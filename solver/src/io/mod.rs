//! What comes in and what goes out: readers and `String`s, never paths.

pub mod abaqus;
mod file;
pub mod gmsh;
pub mod json;
pub mod plot;
mod source;
pub use file::{MeshFormat, read_mesh};
pub use source::ReadError;
