//! From displacements to stresses, nodal forces and energy.

use crate::elasticity::Section;
use crate::elasticity::material::{COMPONENTS, Moduli, stress};
use crate::element::gauss::GAUSS_2;
use crate::element::quad8::{self, Mapped};
use crate::mesh::Mesh;

/// What the displacements mean for the body.
pub struct Recovered {
    /// Stress at every node: xx, yy, xy, zz (hoop), averaged over all elements that meet there.
    pub stress: Vec<[f64; COMPONENTS]>,
    /// Stress at every element's nodes, averaged over the elements of its own material.
    pub element_stress: Vec<[[f64; COMPONENTS]; 8]>,
    /// Positions of the integration points, element by element; ξ runs fastest.
    pub points: Vec<[f64; 2]>,
    /// Stress there, not averaged.
    pub point_stress: Vec<[f64; COMPONENTS]>,
    /// Force that the stresses exert at every node along x and y, ∫ Bᵀ σ (without 2π).
    pub internal_force: Vec<[f64; 2]>,
    /// ½ ∫ σ : ε (without 2π).
    pub strain_energy: f64,
}

/// Stresses at nodes are taken at the 2 × 2 superconvergent points of each element, carried to its
/// nodes by the bilinear map, and averaged over the elements that meet there.
///
/// `rule`: as in `assemble_element`.
pub fn recover(
    mesh: &Mesh,
    section: &Section,
    rule: &[(f64, f64)],
    displacements: &[[f64; 2]],
) -> Recovered {
    let mut own = Vec::with_capacity(mesh.elements.len());
    let mut internal_force = vec![[0.0; 2]; mesh.nodes.len()];
    let mut strain_energy = 0.0;
    let count = mesh.elements.len() * rule.len() * rule.len();
    let (mut points, mut point_stress) = (Vec::with_capacity(count), Vec::with_capacity(count));
    for (e, element) in mesh.elements.iter().enumerate() {
        let (nodes, moduli) = (mesh.element_nodes(element), section.moduli(e));
        let u = element.map(|n| displacements[n as usize]);
        for &(eta, w_eta) in rule {
            for &(xi, w_xi) in rule {
                let m = quad8::map(&nodes, xi, eta);
                let strain = strain_at(section, &m, &u);
                let stress = stress(moduli, &strain);
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
                let y = (0..8).map(|i| m.shape[i] * nodes[i][1]).sum();
                points.push([m.x, y]);
                point_stress.push(stress);
            }
        }
        own.push(at_nodes(section, moduli, &nodes, &u));
    }
    let averaged = |of_material: Option<usize>| average(mesh, section, &own, of_material);
    let stress = averaged(None);
    let mut element_stress = vec![[[0.0; COMPONENTS]; 8]; mesh.elements.len()];
    for material in 0..section.materials().len() {
        let single = section.materials().len() == 1;
        let of_material = if single {
            None
        } else {
            Some(averaged(Some(material)))
        };
        let nodal = of_material.as_ref().unwrap_or(&stress);
        for (e, element) in mesh.elements.iter().enumerate() {
            if section.material_of(e) == material {
                element_stress[e] = element.map(|n| nodal[n as usize]);
            }
        }
    }
    Recovered {
        stress,
        element_stress,
        points,
        point_stress,
        internal_force,
        strain_energy,
    }
}

/// Mean at every node of the stresses of its elements: of one material, or of all.
fn average(
    mesh: &Mesh,
    section: &Section,
    own: &[[[f64; COMPONENTS]; 8]],
    material: Option<usize>,
) -> Vec<[f64; COMPONENTS]> {
    let mut sum = vec![[0.0; COMPONENTS]; mesh.nodes.len()];
    let mut count = vec![0u32; mesh.nodes.len()];
    for (e, element) in mesh.elements.iter().enumerate() {
        if material.is_some_and(|m| section.material_of(e) != m) {
            continue;
        }
        for (i, &node) in element.iter().enumerate() {
            (0..COMPONENTS).for_each(|c| sum[node as usize][c] += own[e][i][c]);
            count[node as usize] += 1;
        }
    }
    let mean = |(s, n): (&[f64; COMPONENTS], &u32)| s.map(|v| v / f64::from((*n).max(1)));
    sum.iter().zip(&count).map(mean).collect()
}

/// Stress of an element at a place in master coordinates.
pub fn stress_at(
    section: &Section,
    moduli: &Moduli,
    nodes: &[[f64; 2]; 8],
    displacements: &[[f64; 2]; 8],
    [xi, eta]: [f64; 2],
) -> [f64; COMPONENTS] {
    let m = quad8::map(nodes, xi, eta);
    stress(moduli, &strain_at(section, &m, displacements))
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
fn at_nodes(
    section: &Section,
    moduli: &Moduli,
    nodes: &[[f64; 2]; 8],
    u: &[[f64; 2]; 8],
) -> [[f64; COMPONENTS]; 8] {
    let g = GAUSS_2[1].0;
    let points: [[[f64; COMPONENTS]; 2]; 2] = std::array::from_fn(|b| {
        std::array::from_fn(|a| {
            let m = quad8::map(nodes, GAUSS_2[a].0, GAUSS_2[b].0);
            stress(moduli, &strain_at(section, &m, u))
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
