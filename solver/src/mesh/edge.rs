//! A side of an element.

/// A side of an element on the surface of the body: start, end, midside node, directed such that the body lies on the
/// right (a top edge runs along +x). The outward normal is the edge's direction turned counter-clockwise; the tangent
/// t, which is the normal turned clockwise, is the edge's direction.
pub type Edge = [u32; 3];
