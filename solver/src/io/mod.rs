//! What comes in and what goes out: text and `String`s, never paths.

pub mod json;
pub mod plot;
