//! `assemble_element`, `assemble_stiffness`, `assemble_loads`: thesis (2.18), (2.20), (2.27), (2.28).

use crate::elasticity::Section;
use crate::elasticity::material::COMPONENTS;
use crate::element::gauss::GAUSS_3;
use crate::element::{edge3, quad8};
use crate::linear::{Graph, SparseSymmetric};
use crate::mesh::{Edge, Mesh};

/// One component of one node's displacement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Dof {
    /// Unknown, with its place in the system.
    Free(usize),
    /// Prescribed, with its value (length).
    Fixed(f64),
}

/// Which displacements are unknown, and along which axes each node's two components are measured.
#[derive(Clone, Debug)]
pub struct DofMap {
    /// Two components of every node.
    pub dofs: Vec<[Dof; 2]>,
    /// Axes of a node's two components as rows of a rotation; absent: x and y.
    pub axes: Vec<Option<[[f64; 2]; 2]>>,
    /// Number of unknowns.
    pub unknowns: usize,
}

impl DofMap {
    /// Displacements along x and y of every node, from the unknowns.
    pub fn displacements(&self, unknowns: &[f64]) -> Vec<[f64; 2]> {
        let node = |(dofs, axes): (&[Dof; 2], &Option<[[f64; 2]; 2]>)| {
            let [a, b] = dofs.map(|dof| match dof {
                Dof::Free(i) => unknowns[i],
                Dof::Fixed(value) => value,
            });
            match axes {
                None => [a, b],
                Some([n, t]) => [n[0] * a + t[0] * b, n[1] * a + t[1] * b],
            }
        };
        self.dofs.iter().zip(&self.axes).map(node).collect()
    }

    /// A vector per node along x and y, turned to the node's own axes.
    pub fn to_axes(&self, node: usize, [x, y]: [f64; 2]) -> [f64; 2] {
        match self.axes[node] {
            None => [x, y],
            Some([n, t]) => [n[0] * x + n[1] * y, t[0] * x + t[1] * y],
        }
    }
}

/// Element stiffness k_ij = ∫ B_iᵀ D B_j, along x and y; 16 × 16, symmetric.
///
/// `rule`: points and weights in each direction. Three points leave no more than the rigid modes
/// without stiffness; two leave one mode more, which neighbours may suppress or not.
pub fn assemble_element(
    nodes: &[[f64; 2]; 8],
    section: &Section,
    rule: &[(f64, f64)],
) -> [[f64; 16]; 16] {
    let mut k = [[0.0; 16]; 16];
    for &(eta, w_eta) in rule {
        for &(xi, w_xi) in rule {
            let m = quad8::map(nodes, xi, eta);
            let weight = w_xi * w_eta * m.det * section.depth(m.x);
            let b: [_; 8] = std::array::from_fn(|i| section.strain(m.shape[i], m.gradient[i], m.x));
            for j in 0..8 {
                for q in 0..2 {
                    let strain: [f64; COMPONENTS] = std::array::from_fn(|c| b[j][c][q]);
                    let stress = section.stress(&strain);
                    for i in 0..=j {
                        for p in 0..2 {
                            let work: f64 = (0..COMPONENTS).map(|c| b[i][c][p] * stress[c]).sum();
                            k[2 * i + p][2 * j + q] += weight * work;
                        }
                    }
                }
            }
        }
    }
    for i in 0..16 {
        for j in 0..i {
            k[i][j] = k[j][i];
        }
    }
    k
}

/// The stiffness of the unknowns, and the load −K_fp u_p of the prescribed displacements on them.
///
/// `graph`: neighbours among the nodes.
pub fn assemble_stiffness(
    mesh: &Mesh,
    section: &Section,
    map: &DofMap,
    graph: &Graph,
) -> (SparseSymmetric, Vec<f64>) {
    let mut node_of = vec![0u32; map.unknowns];
    for (node, dofs) in map.dofs.iter().enumerate() {
        for dof in dofs {
            if let Dof::Free(i) = dof {
                node_of[*i] = node as u32;
            }
        }
    }
    let mut stiffness = SparseSymmetric::zero(map.unknowns, |column, rows| {
        let node = node_of[column];
        for &other in graph.neighbours(node as usize).iter().chain([&node]) {
            for dof in map.dofs[other as usize] {
                if let Dof::Free(row) = dof
                    && row >= column
                {
                    rows.push(row);
                }
            }
        }
    });
    let mut load = vec![0.0; map.unknowns];
    for element in &mesh.elements {
        let mut k = assemble_element(&mesh.element_nodes(element), section, &GAUSS_3);
        for (i, &node) in element.iter().enumerate() {
            if let Some(axes) = map.axes[node as usize] {
                rotate(&mut k, i, axes);
            }
        }
        let dof = |local: usize| map.dofs[element[local / 2] as usize][local % 2];
        for i in 0..16 {
            let Dof::Free(row) = dof(i) else { continue };
            for j in 0..16 {
                match dof(j) {
                    Dof::Free(column) if column <= row => stiffness.add(row, column, k[i][j]),
                    Dof::Free(_) => {}
                    Dof::Fixed(value) => load[row] -= k[i][j] * value,
                }
            }
        }
    }
    (stiffness, load)
}

/// Rows and columns of node `i`, turned to its axes: k ← Q k Qᵀ.
fn rotate(k: &mut [[f64; 16]; 16], i: usize, [n, t]: [[f64; 2]; 2]) {
    let (a, b) = (2 * i, 2 * i + 1);
    for column in 0..16 {
        let (x, y) = (k[a][column], k[b][column]);
        (k[a][column], k[b][column]) = (n[0] * x + n[1] * y, t[0] * x + t[1] * y);
    }
    for row in k.iter_mut() {
        let (x, y) = (row[a], row[b]);
        (row[a], row[b]) = (n[0] * x + n[1] * y, t[0] * x + t[1] * y);
    }
}

/// Nodal forces along x and y of pressures on edges: F_i = −∫ p n h_i, thesis (2.28).
///
/// `loads`: an edge and the pressure at its start, end and midside, interpolated between them.
pub fn assemble_loads(mesh: &Mesh, section: &Section, loads: &[(Edge, [f64; 3])]) -> Vec<[f64; 2]> {
    let mut forces = vec![[0.0; 2]; mesh.nodes.len()];
    for (edge, pressure) in loads {
        let nodes = mesh.edge_nodes(edge);
        for (xi, w) in GAUSS_3 {
            let (h, ([x, _], [dx, dy])) = (edge3::shape(xi), edge3::map(&nodes, xi));
            let p = edge3::interpolate(&h, pressure) * w * section.depth(x);
            for (i, &node) in edge.iter().enumerate() {
                // (−dy, dx) is the outward normal times the length
                forces[node as usize][0] += p * dy * h[i];
                forces[node as usize][1] -= p * dx * h[i];
            }
        }
    }
    forces
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::Analysis;

    const SQUARE: [[f64; 2]; 8] = [
        [1.0, 0.0],
        [2.0, 0.1],
        [2.2, 1.0],
        [1.0, 0.9],
        [1.5, 0.05],
        [2.1, 0.55],
        [1.6, 0.95],
        [1.0, 0.45],
    ];

    #[test]
    fn rigid_motions_cost_no_force() {
        let plane = Section::new(Analysis::PlaneStrain {}, 1000.0, 0.3);
        let round = Section::new(Analysis::Axisymmetric {}, 1000.0, 0.3);
        let no_force = |section: &Section, motion: &dyn Fn([f64; 2]) -> [f64; 2]| {
            let u: Vec<f64> = SQUARE.iter().flat_map(|&x| motion(x)).collect();
            for row in assemble_element(&SQUARE, section, &GAUSS_3) {
                let force: f64 = row.iter().zip(&u).map(|(a, b)| a * b).sum();
                assert!(force.abs() < 1e-11, "{force}");
            }
        };
        no_force(&plane, &|_| [1.0, 0.0]);
        no_force(&plane, &|_| [0.0, 1.0]);
        no_force(&plane, &|[x, y]| [-y, x]);
        no_force(&round, &|_| [0.0, 1.0]);
    }

    #[test]
    fn a_uniform_pressure_loads_an_edge_one_four_one() {
        let mesh = Mesh {
            nodes: vec![[0.0, 0.0], [3.0, 0.0], [1.5, 0.0]],
            ..Mesh::default()
        };
        let section = Section::new(Analysis::PlaneStress { thickness: 0.5 }, 1.0, 0.0);
        let forces = assemble_loads(&mesh, &section, &[([0, 1, 2], [4.0; 3])]);
        for (node, share) in [(0, 1.0 / 6.0), (1, 1.0 / 6.0), (2, 4.0 / 6.0)] {
            assert!((forces[node][1] + 4.0 * 3.0 * 0.5 * share).abs() < 1e-14);
            assert_eq!(forces[node][0], 0.0);
        }
    }
}
