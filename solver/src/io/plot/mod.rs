//! Figures as SVG.

mod figure;
mod profile;

pub use figure::{Curve, Look, Panel, figure};
pub use profile::profile_svg;
