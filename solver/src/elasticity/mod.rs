//! A standard elastic program, thesis 1.3 and 2.2; independent of contact.
//!
//! # Where to look
//!
//! | subject | where |
//! |---|---|
//! | Hooke's law and its matrix | `material` |
//! | element stiffness, loads, numbering of unknowns | `assembly` |
//! | forces per volume | `body_force` |
//! | thermal strains | `thermal` |
//! | integrals shared by elements of one shape | `geometry`, `shapes` |
//! | work on all elements, on one thread or two | `chunks` |
//! | elements that do not lock | `mixed` |
//! | springs between the body and the ground | `springs` |
//! | stresses, nodal forces and energy | `recovery` |
//! | the error of stresses | `stress_difference` |
//! | how stresses grow where materials meet at the surface | `wedges` |

mod assembly;
mod body_force;
mod chunks;
mod geometry;
mod material;
mod mixed;
mod recovery;
mod shapes;
mod springs;
mod stress_difference;
mod thermal;
mod wedges;

pub use assembly::{
    Axes, Dof, DofMap, EdgeLoad, ElementStiffness, LoadAxes, Loads, add_inner_forces,
    assemble_element, assemble_loads,
};
pub use body_force::BodyForce;
pub use geometry::{ElementTables, Elements};
pub use material::{COMPONENTS, Moduli, Section, inverse, isotropic, orthotropic, stress};
pub use mixed::Mixed;
pub use recovery::{Deformed, Recovered, recover};
pub use springs::{Carriers, Springs, Stiffness};
pub use stress_difference::StressDifference;
pub use thermal::{Inner, Thermal};
pub use wedges::{Growth, Side, Wedge, growth};
