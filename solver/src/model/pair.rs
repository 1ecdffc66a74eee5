//! Another elastic body in place of an obstacle: which of its nodes each node of a contact follows.

/// The body that faces a contact.
#[derive(Clone, Debug, PartialEq)]
pub struct Pair {
    /// The name of its boundary.
    pub boundary: String,
    /// The nodes of that boundary, in order.
    pub nodes: Vec<u32>,
    /// P: by node of the contact, nodes of the other body by their places in `nodes`, with weights that add up to 1.
    pub rows: Vec<Vec<(usize, f64)>>,
}

impl Pair {
    /// The node of the other body that a node of the contact follows most.
    pub fn nearest(&self, i: usize) -> Option<u32> {
        let most = self.rows[i].iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(self.nodes[most.0])
    }
}
