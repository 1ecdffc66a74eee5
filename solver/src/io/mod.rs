//! What comes in and what goes out: readers and `String`s, never paths.

pub mod abaqus;
pub mod gmsh;
pub mod json;
pub mod plot;
mod source;
pub use source::ReadError;
