//! A standard elastic program, thesis 1.3 and 2.2; no word of contact.

mod assembly;
mod material;
mod recovery;

pub use assembly::{Dof, DofMap, assemble_element, assemble_loads, assemble_stiffness};
pub use material::{COMPONENTS, Section};
pub use recovery::{Recovered, recover};
