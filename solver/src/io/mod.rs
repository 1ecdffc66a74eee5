//! What comes in and what goes out: text and bytes, never paths.

// In.
pub mod json;

// Out: tables (CSV and JSON Lines are in `table`), fields, figures.
pub mod arrow;
pub mod fields;
pub mod npz;
pub mod plot;
pub mod stress;
pub mod table;
pub mod vtu;

mod number; // what these share
