//! A side of an element.

/// A side of an element on the surface of the body: start, end, midside node, so directed that the
/// body lies on the right (a top edge runs along +x). The outward normal is the direction turned
/// counter-clockwise; in other words t, the normal turned clockwise, is the direction.
pub type Edge = [u32; 3];
