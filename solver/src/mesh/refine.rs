//! Splitting every element in four, every side in two.

use crate::element::{Element, edge3};
use crate::mesh::{Edge, Mesh};

/// New nodes lie half-way between the old ones, in master coordinates.
const STEP: f64 = 0.5;

/// And a quarter from the sides of a triangle.
const QUARTER: f64 = 0.25;

/// Every element becomes four, every edge two; new nodes lie on the parent's own map, so that
/// curved sides stay the curves they are.
pub fn refine(mesh: &Mesh) -> Mesh {
    let mut nodes = mesh.nodes.clone();
    // An edge is known by its midside node: halves[mid] = (start corner, first half's midside, second's).
    let mut halves: Vec<Option<(u32, u32, u32)>> = vec![None; mesh.nodes.len()];
    let mut sets = Sets::new(mesh);
    let mut split = |nodes: &mut Vec<[f64; 2]>, [a, b, mid]: Edge| -> (u32, u32) {
        let (start, first, second) = *halves[mid as usize].get_or_insert_with(|| {
            let ends = [a, b, mid].map(|n| nodes[n as usize]);
            let number = nodes.len() as u32;
            nodes.push(edge3::map(&ends, -STEP).0);
            nodes.push(edge3::map(&ends, STEP).0);
            sets.inherit(&[a, b, mid], number..number + 2);
            (a, number, number + 1)
        });
        if start == a {
            (first, second)
        } else {
            (second, first)
        }
    };
    let mut elements = Vec::with_capacity(4 * mesh.elements.len());
    let mut inner = Vec::with_capacity(mesh.elements.len());
    for parent in &mesh.elements {
        let (family, positions) = (parent.family(), parent.gather(|n| nodes[n as usize]));
        let inside = |nodes: &mut Vec<[f64; 2]>, place: [f64; 2]| {
            let h = family.shape(place);
            let at = |a: usize| (0..family.nodes()).map(|i| h[i] * positions[i][a]).sum();
            nodes.push([at(0), at(1)]);
            nodes.len() as u32 - 1
        };
        let halves: Vec<(u32, u32)> = parent.sides().map(|side| split(&mut nodes, side)).collect();
        let first_inside = nodes.len() as u32;
        match (parent, &halves[..]) {
            (Element::Quad(p), &[south, east, north, west]) => {
                let centre = inside(&mut nodes, [0.0, 0.0]);
                let [to_south, to_east, to_north, to_west] =
                    [[0.0, -STEP], [STEP, 0.0], [0.0, STEP], [-STEP, 0.0]]
                        .map(|place| inside(&mut nodes, place));
                #[rustfmt::skip]
                elements.extend([
                    [p[0], p[4], centre, p[7], south.0, to_south, to_west, west.1],
                    [p[4], p[1], p[5], centre, south.1, east.0, to_east, to_south],
                    [centre, p[5], p[2], p[6], to_east, east.1, north.0, to_north],
                    [p[7], centre, p[6], p[3], to_west, to_north, north.1, west.0],
                ].map(Element::Quad));
            }
            (Element::Triangle(p), &[first, second, third]) => {
                // the sides of the triangle in the middle, each across one corner
                let [across_0, across_1, across_2] =
                    [[QUARTER, QUARTER], [STEP, QUARTER], [QUARTER, STEP]]
                        .map(|place| inside(&mut nodes, place));
                #[rustfmt::skip]
                elements.extend([
                    [p[0], p[3], p[5], first.0, across_0, third.1],
                    [p[3], p[1], p[4], first.1, second.0, across_1],
                    [p[5], p[4], p[2], across_2, second.1, third.0],
                    [p[3], p[4], p[5], across_1, across_2, across_0],
                ].map(Element::Triangle));
            }
            _ => unreachable!("a quadrilateral has four sides, a triangle three"),
        }
        inner.push(first_inside..nodes.len() as u32);
    }
    let boundaries = mesh
        .boundaries
        .iter()
        .map(|(name, edges)| {
            let children = edges.iter().flat_map(|&[a, b, mid]| {
                let (first, second) = split(&mut nodes, [a, b, mid]);
                [[a, mid, first], [mid, b, second]]
            });
            (name.clone(), children.collect())
        })
        .collect();
    for (parent, inside) in mesh.elements.iter().zip(inner) {
        sets.inherit(parent, inside);
    }
    // the children of an element follow one another
    let four = |e: &u32| (0..4).map(|child| 4 * e + child).collect::<Vec<u32>>();
    let groups = mesh.groups.iter();
    let groups = groups
        .map(|(name, group)| (name.clone(), group.iter().flat_map(four).collect()))
        .collect();
    Mesh {
        nodes,
        elements,
        boundaries,
        groups,
        node_sets: sets.into_named(mesh),
    }
}

/// Which sets each node is in: a new node is in those that hold all nodes of its side or element.
struct Sets {
    of_node: std::collections::HashMap<u32, Vec<usize>>,
}

impl Sets {
    fn new(mesh: &Mesh) -> Self {
        let mut of_node: std::collections::HashMap<u32, Vec<usize>> = Default::default();
        for (k, set) in mesh.node_sets.values().enumerate() {
            for node in set {
                of_node.entry(*node).or_default().push(k);
            }
        }
        Sets { of_node }
    }

    fn inherit(&mut self, parents: &[u32], children: std::ops::Range<u32>) {
        let Some(sets) = self.of_node.get(&parents[0]) else {
            return;
        };
        let holds = |k: &usize, node: &u32| self.of_node.get(node).is_some_and(|s| s.contains(k));
        let all = |k: &&usize| parents.iter().all(|node| holds(k, node));
        let common: Vec<usize> = sets.iter().filter(all).copied().collect();
        for child in children.filter(|_| !common.is_empty()) {
            self.of_node.insert(child, common.clone());
        }
    }

    fn into_named(self, mesh: &Mesh) -> std::collections::BTreeMap<String, Vec<u32>> {
        let mut sets = vec![Vec::new(); mesh.node_sets.len()];
        for (node, of) in self.of_node {
            of.into_iter().for_each(|k| sets[k].push(node));
        }
        sets.iter_mut().for_each(|set| set.sort_unstable());
        mesh.node_sets.keys().cloned().zip(sets).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::grid_mesh;
    use crate::problem::Grid;

    #[test]
    fn refining_a_grid_is_the_grid_with_halved_lines() {
        let coarse = Grid {
            x: vec![0.0, 1.0, 4.0],
            y: vec![-2.0, 0.0],
            top: None,
            bottom: None,
        };
        let fine = Grid {
            x: vec![0.0, 0.5, 1.0, 2.5, 4.0],
            y: vec![-2.0, -1.0, 0.0],
            top: None,
            bottom: None,
        };
        let (refined, direct) = (refine(&grid_mesh(&coarse)), grid_mesh(&fine));
        let sorted = |mesh: &Mesh| {
            let mut nodes = mesh.nodes.clone();
            nodes.sort_by(|a, b| a.partial_cmp(b).unwrap());
            nodes
        };
        assert_eq!(sorted(&refined), sorted(&direct));
        assert_eq!(refined.elements.len(), direct.elements.len());
        assert!(refined.inverted_elements(true).is_empty());
        for (name, edges) in &refined.boundaries {
            let place = |mesh: &Mesh, e: &Edge| mesh.edge_nodes(e);
            let expected: Vec<_> = direct.boundaries[name]
                .iter()
                .map(|e| place(&direct, e))
                .collect();
            assert_eq!(
                edges.iter().map(|e| place(&refined, e)).collect::<Vec<_>>(),
                expected,
                "{name}"
            );
        }
    }
}
