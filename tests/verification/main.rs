//! What the numbers are held to: closed forms, invariants and the published discrete values.
//!
//! Each test opens with its source, its goal and the reason of its tolerance.
#![allow(clippy::unwrap_used, clippy::panic)]

mod abaqus_files;
mod adaptive;
mod annular_punch;
mod balance;
mod calibration;
mod catalogue;
mod contact_patch;
mod cook;
mod cylinder;
mod disc_pressure;
mod error_estimate;
mod even_profiles;
mod examples;
mod flat_punch;
mod gmsh_files;
mod graded;
mod held_by_contact;
mod hertz_sphere;
mod input;
mod invariance;
mod lift_off;
mod loads;
mod manufactured;
mod oblique;
mod obstacle_normals;
mod patch;
mod profiles;
mod random;
mod record;
mod refusals;
mod robustness;
mod sliding;
mod stick;
mod support;
mod thesis;
mod thick_cylinder;
mod tolerance;
mod traps;
