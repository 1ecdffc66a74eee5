//! Another elastic body in place of an obstacle: which of its nodes each node of a contact follows.

/// The body that faces a contact.
#[derive(Clone, Debug, PartialEq)]
pub struct Pair {
    /// The name of its boundary.
    pub boundary: String,
    /// The nodes of that boundary that the contact follows, and those between them, in order: a chain of whole edges.
    pub nodes: Vec<u32>,
    /// The arc length of each from the start of that boundary.
    pub s: Vec<f64>,
    /// The place of each.
    pub positions: Vec<[f64; 2]>,
    /// The outward normal of the other body at each.
    pub normals: Vec<[f64; 2]>,
    /// The share of the surface of each, ∫h times the depth; 0 on the axis.
    pub weights: Vec<f64>,
    /// P: by node of the contact, nodes of the other body by their places in `nodes`, with weights that add up to 1.
    pub rows: Vec<Vec<(usize, f64)>>,
    /// By node of the contact: the angle between its normal and the mean of the normals of both bodies; zero where it uses that mean.
    pub turned: Vec<f64>,
    /// Where sides of the other body meet at an angle, in front of the contact: only of bodies whose gap is that of their meshes.
    pub corners: Vec<FacingCorner>,
}

/// A place where sides of the other body meet at an angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FacingCorner {
    /// The edge of the contact that it faces.
    pub edge: usize,
    /// The place on that edge, −1 … 1.
    pub xi: f64,
    /// The angle by which the other body's surface turns; positive where it points at the contact.
    pub turn: f64,
    /// Whether that is a corner, and not a curve through parabolic sides.
    pub sharp: bool,
    /// The length of the longer of the two sides.
    pub side: f64,
}

impl Pair {
    /// The node of the other body that a node of the contact follows most.
    pub fn nearest(&self, i: usize) -> Option<u32> {
        let most = self.rows[i].iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(self.nodes[most.0])
    }
}
