//! From displacements to stresses at nodes, nodal forces and energy.

use crate::elasticity::Section;
use crate::elasticity::material::COMPONENTS;
use crate::element::gauss::{GAUSS_2, GAUSS_3};
use crate::element::quad8::{self, Mapped};
use crate::mesh::Mesh;

/// What the displacements mean for the body.
pub struct Recovered {
    /// Stress at every node: xx, yy, xy, zz (hoop).
    pub stress: Vec<[f64; COMPONENTS]>,
    /// Force that the stresses exert at every node along x and y, ∫ Bᵀ σ (without 2π).
    pub internal_force: Vec<[f64; 2]>,
    /// ½ ∫ σ : ε (without 2π).
    pub strain_energy: f64,
}

/// Stresses at nodes are taken at the 2 × 2 superconvergent points of each element, carried to its
/// nodes by the bilinear map, and averaged over the elements that meet there.
pub fn recover(mesh: &Mesh, section: &Section, displacements: &[[f64; 2]]) -> Recovered {
    let mut sum = vec![[0.0; COMPONENTS]; mesh.nodes.len()];
    let mut count = vec![0u32; mesh.nodes.len()];
    let mut internal_force = vec![[0.0; 2]; mesh.nodes.len()];
    let mut strain_energy = 0.0;
    for element in &mesh.elements {
        let nodes = mesh.element_nodes(element);
        let u = element.map(|n| displacements[n as usize]);
        for (eta, w_eta) in GAUSS_3 {
            for (xi, w_xi) in GAUSS_3 {
                let m = quad8::map(&nodes, xi, eta);
                let strain = strain_at(section, &m, &u);
                let stress = section.stress(&strain);
                let weight = w_xi * w_eta * m.det * section.depth(m.x);
                strain_energy +=
                    0.5 * weight * (0..COMPONENTS).map(|c| stress[c] * strain[c]).sum::<f64>();
                for (i, &node) in element.iter().enumerate() {
                    let b = section.strain(m.shape[i], m.gradient[i], m.x);
                    for p in 0..2 {
                        internal_force[node as usize][p] +=
                            weight * (0..COMPONENTS).map(|c| b[c][p] * stress[c]).sum::<f64>();
                    }
                }
            }
        }
        for (i, stress) in at_nodes(section, &nodes, &u).into_iter().enumerate() {
            let node = element[i] as usize;
            (0..COMPONENTS).for_each(|c| sum[node][c] += stress[c]);
            count[node] += 1;
        }
    }
    let stress = sum
        .iter()
        .zip(&count)
        .map(|(s, &n)| s.map(|v| v / f64::from(n)))
        .collect();
    Recovered {
        stress,
        internal_force,
        strain_energy,
    }
}

fn strain_at(section: &Section, m: &Mapped, u: &[[f64; 2]; 8]) -> [f64; COMPONENTS] {
    let mut strain = [0.0; COMPONENTS];
    for i in 0..8 {
        let b = section.strain(m.shape[i], m.gradient[i], m.x);
        (0..COMPONENTS).for_each(|c| strain[c] += b[c][0] * u[i][0] + b[c][1] * u[i][1]);
    }
    strain
}

/// One element's stresses at its nodes: bilinear through the four superconvergent points.
fn at_nodes(section: &Section, nodes: &[[f64; 2]; 8], u: &[[f64; 2]; 8]) -> [[f64; COMPONENTS]; 8] {
    let g = GAUSS_2[1].0;
    let points: [[[f64; COMPONENTS]; 2]; 2] = std::array::from_fn(|b| {
        std::array::from_fn(|a| {
            let m = quad8::map(nodes, GAUSS_2[a].0, GAUSS_2[b].0);
            section.stress(&strain_at(section, &m, u))
        })
    });
    quad8::NODES.map(|[xi, eta]| {
        let (p, q) = (
            [0.5 * (1.0 - xi / g), 0.5 * (1.0 + xi / g)],
            [0.5 * (1.0 - eta / g), 0.5 * (1.0 + eta / g)],
        );
        std::array::from_fn(|c| {
            (0..2)
                .map(|b| (0..2).map(|a| p[a] * q[b] * points[b][a][c]).sum::<f64>())
                .sum()
        })
    })
}
