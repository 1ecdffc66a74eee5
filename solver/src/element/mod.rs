//! Master elements and their integration, thesis 2.1 and 2.3: no mesh, no material.

pub mod edge3;
pub mod gauss;
pub mod quad8;
