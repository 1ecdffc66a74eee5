//! Distinct nodes at the same place: a crack along which the parts of a body are not connected.

use super::Mesh;

/// Nodes are at the same place if their distance is below this fraction of the shortest side that meets them: such a
/// thin slit is never intended, and files have six digits.
const SAME_PLACE: f64 = 3e-4;

/// The largest number of nodes that each node is compared with: in any useful mesh far fewer are as close along
/// `DIRECTION`.
const MOST_COMPARED: usize = 200;

/// A unit vector that hardly any line of nodes is perpendicular to, so that nodes that are neighbours in the order
/// along this vector are mostly close to each other.
const DIRECTION: [f64; 2] = [0.618_181_9, 0.786_035_2];

/// Pairs of nodes on the surface of the body at the same place, within rounding, in the order of the second nodes. Each
/// node is paired with the one before it, so that three nodes at one place make two pairs.
pub fn coincident_nodes(mesh: &Mesh) -> Vec<[u32; 2]> {
    let sizes = surface_sizes(mesh);
    let at = |node: u32| mesh.nodes[node as usize];
    let along = |node: u32| at(node)[0] * DIRECTION[0] + at(node)[1] * DIRECTION[1];
    let on_surface = |node: &u32| sizes[*node as usize] < f64::INFINITY;
    let mut sorted: Vec<(f64, u32)> = (0..mesh.nodes.len() as u32)
        .filter(on_surface)
        .map(|node| (along(node), node))
        .collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let size = |node: u32| sizes[node as usize];
    let mut other = vec![u32::MAX; mesh.nodes.len()];
    for (i, &(s, node)) in sorted.iter().enumerate() {
        for &(t, next) in sorted[i + 1..].iter().take(MOST_COMPARED) {
            let near = SAME_PLACE * size(node).min(size(next));
            if t - s > SAME_PLACE * size(node) {
                break;
            }
            let [[x0, y0], [x1, y1]] = [node, next].map(at);
            if (x1 - x0).hypot(y1 - y0) <= near {
                let [first, second] = [node.min(next), node.max(next)];
                let before = &mut other[second as usize];
                if *before == u32::MAX || first > *before {
                    *before = first;
                }
            }
        }
    }
    let pairs = other.into_iter().zip(0u32..);
    pairs
        .filter(|(first, _)| *first != u32::MAX)
        .map(|(first, second)| [first, second])
        .collect()
}

/// The shortest side at every node on the surface; infinite at other nodes. A side is identified by its midside node.
fn surface_sizes(mesh: &Mesh) -> Vec<f64> {
    let mut elements = vec![0u8; mesh.nodes.len()];
    let sides = || mesh.elements.iter().flat_map(|element| element.sides());
    for [_, _, mid] in sides() {
        elements[mid as usize] = elements[mid as usize].saturating_add(1);
    }
    let mut sizes = vec![f64::INFINITY; mesh.nodes.len()];
    for side in sides().filter(|[_, _, mid]| elements[*mid as usize] == 1) {
        let [[x0, y0], [x1, y1]] = [side[0], side[1]].map(|n| mesh.nodes[n as usize]);
        let length = (x1 - x0).hypot(y1 - y0);
        for node in side {
            let size = &mut sizes[node as usize];
            *size = size.min(length);
        }
    }
    sizes
}
