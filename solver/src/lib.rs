//! Frictional contact in linear elasticity with the nonlocal, nonlinear law of Oden and Pires.

pub mod error;
pub mod problem;
pub mod solution;
