//! What the numbers are held to: closed forms, invariants and the published discrete values.
//!
//! Each test opens with its source, its goal and the reason of its tolerance.
#![allow(clippy::unwrap_used, clippy::panic)]

mod balance;
mod cylinder;
mod examples;
mod flat_punch;
mod input;
mod patch;
mod support;
mod thick_cylinder;
