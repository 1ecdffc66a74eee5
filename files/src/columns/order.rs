//! The order in which values at nodes are predicted: corners of elements first, then the midsides between them.

use solver::element::Element;

/// Stands for the corners of a node that is not a midside node. Such a node is predicted from the node before it.
const NONE: u32 = u32::MAX;

/// The order of the nodes of a mesh.
pub(super) struct NodeOrder {
    /// Each node, with the two corners of its side if it is a midside node, else [`NONE`].
    nodes: Vec<(u32, [u32; 2])>,
}

impl NodeOrder {
    /// The order of the nodes of a mesh. `nodes`: their number; all nodes of the elements are among them.
    pub(super) fn new(elements: &[Element], nodes: usize) -> NodeOrder {
        let mut between = vec![[NONE; 2]; nodes];
        for [a, b, middle] in elements.iter().flat_map(Element::sides) {
            between[middle as usize] = [a, b];
        }
        // a corner of one element is none of its own sides' midsides, but may be that of a badly made neighbour
        for element in elements {
            let corners = element.family().corners();
            element
                .iter()
                .take(corners)
                .for_each(|node| between[*node as usize] = [NONE; 2]);
        }
        let of_kind = |corner: bool| {
            let all = (0u32..).zip(&between);
            all.filter(move |(_, between)| (between[0] == NONE) == corner)
                .map(|(node, between)| (node, *between))
        };
        // of a filtered sequence nobody knows the length, and a list that grows by doubling is too large
        let mut ordered = Vec::with_capacity(nodes);
        ordered.extend(of_kind(true).chain(of_kind(false)));
        NodeOrder { nodes: ordered }
    }

    /// The number of nodes.
    pub(super) fn len(&self) -> usize {
        self.nodes.len()
    }

    /// The node at this place of the order.
    pub(super) fn node(&self, place: usize) -> usize {
        self.nodes[place].0 as usize
    }

    /// The predicted value at a node, from nodes before it in the order.
    pub(super) fn predict(&self, place: usize, values: &[f64]) -> f64 {
        match (self.nodes[place].1, place) {
            ([NONE, _], 0) => 0.0,
            ([NONE, _], _) => values[self.node(place - 1)],
            ([a, b], _) => 0.5 * (values[a as usize] + values[b as usize]),
        }
    }
}
