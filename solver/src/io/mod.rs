//! What comes in and what goes out: text and bytes, never paths.

// In.
pub mod json;

// Out: tables (CSV and JSON Lines are in `table`), figures.
pub mod arrow;
pub mod npz;
pub mod plot;
pub mod table;

mod number; // what these share
