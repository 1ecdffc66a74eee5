//! Springs between a body and the ground: an elastic foundation of sides, and springs at single nodes.
//!
//! A foundation pulls with the stress −c u, where c is a stiffness per area (stress per length): its stiffness is
//! ∫ c h_i h_j ds, added to that of the element whose side it is. So springs change no ordering, and nothing but the matrices
//! of their elements.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::elasticity::Section;
use crate::element::edge3;
use crate::element::gauss::GAUSS_3;
use crate::mesh::{Edge, Mesh};

/// Stiffnesses of a foundation (stress per length), or of a spring at a node (force per length).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stiffness {
    /// Along the outward normal; 0 at a node.
    pub normal: f64,
    /// Along the surface; 0 at a node.
    pub tangential: f64,
    /// Along x and y.
    pub along: [f64; 2],
}

/// The springs of a body.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Springs {
    of_elements: BTreeMap<u32, Vec<Spring>>,
}

/// The stiffness of a spring on up to three nodes of an element.
#[derive(Clone, Debug, PartialEq, Serialize)]
struct Spring {
    /// The nodes.
    nodes: Edge,
    /// The places of the nodes in their element.
    places: [usize; 3],
    /// The matrix on the displacements of the nodes along x and y.
    matrix: [[f64; 6]; 6],
}

/// The elements that springs can belong to: of each node one element that has it.
pub struct Carriers {
    of_nodes: Vec<u32>,
}

impl Carriers {
    /// The carriers of a mesh.
    pub fn new(mesh: &Mesh) -> Carriers {
        let mut of_nodes = vec![u32::MAX; mesh.nodes.len()];
        for (e, element) in mesh.elements.iter().enumerate() {
            element
                .iter()
                .for_each(|node| of_nodes[*node as usize] = e as u32);
        }
        Carriers { of_nodes }
    }

    /// An element with this node, and the places of `nodes` in it; none for a node of no element.
    fn of(&self, mesh: &Mesh, node: u32, nodes: Edge) -> Option<(u32, [usize; 3])> {
        let e = self.of_nodes[node as usize];
        let element = mesh.elements.get(e as usize)?;
        let place = |node: u32| element.iter().position(|own| *own == node);
        let [a, b, c] = nodes.map(place);
        Some((e, [a?, b?, c?]))
    }
}

impl Springs {
    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.of_elements.is_empty()
    }

    /// Whether an element has a spring.
    pub fn has(&self, e: usize) -> bool {
        !self.is_empty() && self.of_elements.contains_key(&(e as u32))
    }

    /// Adds the foundation of a side on the surface.
    pub fn add_side(
        &mut self,
        mesh: &Mesh,
        section: &Section,
        carriers: &Carriers,
        edge: Edge,
        stiffness: Stiffness,
    ) {
        // a side of the surface is that of one element, which has its midside node alone
        let Some((e, places)) = carriers.of(mesh, edge[2], edge) else {
            return;
        };
        let nodes = mesh.edge_nodes(&edge);
        let mut matrix = [[0.0; 6]; 6];
        for (xi, w) in GAUSS_3 {
            let (h, ([x, _], [dx, dy])) = (edge3::shape(xi), edge3::map(&nodes, xi));
            let length = dx.hypot(dy);
            let own = stiffness.along_axes([dx / length, dy / length]);
            let weight = w * length * section.depth(x);
            for (i, j) in (0..9).map(|k| (k / 3, k % 3)) {
                for (a, b) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                    matrix[2 * i + a][2 * j + b] += weight * h[i] * h[j] * own[a][b];
                }
            }
        }
        self.add(e, edge, places, matrix);
    }

    /// Adds a spring at a node; its stiffness is without 2π.
    pub fn add_node(&mut self, mesh: &Mesh, carriers: &Carriers, node: u32, along: [f64; 2]) {
        let nodes = [node; 3];
        let Some((e, places)) = carriers.of(mesh, node, nodes) else {
            return;
        };
        let mut matrix = [[0.0; 6]; 6];
        (0..2).for_each(|a| matrix[a][a] = along[a]);
        self.add(e, nodes, places, matrix);
    }

    fn add(&mut self, e: u32, nodes: Edge, places: [usize; 3], matrix: [[f64; 6]; 6]) {
        self.of_elements.entry(e).or_default().push(Spring {
            nodes,
            places,
            matrix,
        });
    }

    /// Adds the springs of an element to its stiffness along x and y.
    pub fn add_to(&self, e: usize, stiffness: &mut [[f64; 16]; 16]) {
        if self.is_empty() {
            return;
        }
        for spring in self.of_elements.get(&(e as u32)).into_iter().flatten() {
            for (i, row) in spring.matrix.iter().enumerate() {
                for (j, value) in row.iter().enumerate() {
                    let [p, q] = [i, j].map(|k| 2 * spring.places[k / 2] + k % 2);
                    stiffness[p][q] += value;
                }
            }
        }
    }

    /// The forces of the springs on the body at each of their nodes, along x and y (without 2π): −K u.
    pub fn forces(&self, displacements: &[[f64; 2]]) -> Vec<(u32, [f64; 2])> {
        let mut found = Vec::new();
        for spring in self.of_elements.values().flatten() {
            let u: [f64; 6] =
                std::array::from_fn(|k| displacements[spring.nodes[k / 2] as usize][k % 2]);
            let force = |k: usize| -> f64 {
                -spring.matrix[k]
                    .iter()
                    .zip(u)
                    .map(|(k, u)| k * u)
                    .sum::<f64>()
            };
            let nodes = spring.nodes.iter().enumerate();
            found.extend(nodes.map(|(i, node)| (*node, [force(2 * i), force(2 * i + 1)])));
        }
        found
    }

    /// The energy ½ uᵀ K u of the springs (without 2π).
    pub fn energy(&self, displacements: &[[f64; 2]]) -> f64 {
        let work = |(node, [x, y]): (u32, [f64; 2])| {
            let [u, v] = displacements[node as usize];
            -0.5 * (x * u + y * v)
        };
        // of a spring at a node the first of its three equal nodes has all of the force
        self.forces(displacements).into_iter().map(work).sum()
    }
}

impl Stiffness {
    /// The matrix along x and y on a surface with this tangent (unit vector).
    fn along_axes(&self, [tx, ty]: [f64; 2]) -> [[f64; 2]; 2] {
        let (n, t) = (self.normal, self.tangential);
        let mixed = (t - n) * tx * ty;
        [
            [self.along[0] + t * tx * tx + n * ty * ty, mixed],
            [mixed, self.along[1] + t * ty * ty + n * tx * tx],
        ]
    }
}
