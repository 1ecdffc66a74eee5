//! From displacements to stresses, nodal forces and energy.

use crate::elasticity::Section;
use crate::elasticity::material::{COMPONENTS, Moduli, stress};
use crate::element::{Family, Mapped};
use crate::mesh::Mesh;

/// Stresses, forces and energy of a displacement field.
pub struct Recovered {
    /// Stress at every node: xx, yy, xy, zz (hoop), averaged over all elements that meet there.
    pub stress: Vec<[f64; COMPONENTS]>,
    /// Stress at every element's nodes, averaged over the elements of its own material.
    pub element_stress: Vec<[[f64; COMPONENTS]; 8]>,
    /// Positions of the integration points, element by element, as in [`Family::rule`].
    pub points: Vec<[f64; 2]>,
    /// Stress there, not averaged.
    pub point_stress: Vec<[f64; COMPONENTS]>,
    /// Force that the stresses exert at every node along x and y, ∫ Bᵀ σ (without 2π).
    pub internal_force: Vec<[f64; 2]>,
    /// ½ ∫ σ : ε (without 2π).
    pub strain_energy: f64,
}

/// Stresses at nodes are taken at the superconvergent points of each element (2 × 2 of a
/// quadrilateral), carried to its nodes linearly, and averaged over the elements that meet there.
///
/// `quadrature`: as in `assemble_element`.
pub fn recover(
    mesh: &Mesh,
    section: &Section,
    quadrature: u32,
    displacements: &[[f64; 2]],
) -> Recovered {
    let mut own = Vec::with_capacity(mesh.elements.len());
    let mut internal_force = vec![[0.0; 2]; mesh.nodes.len()];
    let mut strain_energy = 0.0;
    let (mut points, mut point_stress) = (Vec::new(), Vec::new());
    for (e, element) in mesh.elements.iter().enumerate() {
        let (nodes, moduli) = (mesh.element_nodes(element), section.moduli(e));
        let (family, u) = (
            element.family(),
            element.gather(|n| displacements[n as usize]),
        );
        for point in family.rule(quadrature) {
            let m = family.map(&nodes, point.place);
            let strain = strain_at(section, &m, &u);
            let stress = stress(moduli, &strain);
            let weight = point.weight * m.det * section.depth(m.x);
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
        own.push(at_nodes(section, moduli, family, &nodes, &u));
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
                element_stress[e] = element.gather(|n| nodal[n as usize]);
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

/// Elements between two questions whether to stop.
pub(super) const ELEMENTS_PER_QUESTION: usize = 1 << 14;

/// The stresses of several displacement fields at the nodes, averaged over the elements of one material, as
/// [`recover`] does; 0 at nodes of other materials. None if `stop` says so.
pub(super) fn recover_nodal_stresses(
    mesh: &Mesh,
    section: &Section,
    material: usize,
    fields: &[Vec<[f64; 2]>],
    stop: &mut dyn FnMut() -> bool,
) -> Option<Vec<Vec<[f64; COMPONENTS]>>> {
    let mut sums = vec![vec![[0.0; COMPONENTS]; mesh.nodes.len()]; fields.len()];
    let mut count = vec![0u32; mesh.nodes.len()];
    for (e, element) in mesh.elements.iter().enumerate() {
        if e % ELEMENTS_PER_QUESTION == 0 && stop() {
            return None;
        }
        if section.material_of(e) != material {
            continue;
        }
        let (family, nodes) = (element.family(), mesh.element_nodes(element));
        let points: Vec<Mapped> = family
            .stress_points()
            .iter()
            .map(|point| family.map(&nodes, point.place))
            .collect();
        for (sum, u) in sums.iter_mut().zip(fields) {
            let u = element.gather(|n| u[n as usize]);
            let mut stresses = [[0.0; COMPONENTS]; 4];
            for (own, m) in stresses.iter_mut().zip(&points) {
                *own = stress(section.moduli(e), &strain_at(section, m, &u));
            }
            let carried = carried_to_nodes(family, &stresses);
            for (own, &node) in carried.iter().zip(element.iter()) {
                (0..COMPONENTS).for_each(|c| sum[node as usize][c] += own[c]);
            }
        }
        element.iter().for_each(|&node| count[node as usize] += 1);
    }
    for sum in &mut sums {
        for (stress, n) in sum.iter_mut().zip(&count) {
            *stress = stress.map(|v| v / f64::from((*n).max(1)));
        }
    }
    Some(sums)
}

/// Stress of an element at a place in master coordinates.
pub fn stress_at(
    section: &Section,
    moduli: &Moduli,
    family: Family,
    nodes: &[[f64; 2]; 8],
    displacements: &[[f64; 2]; 8],
    place: [f64; 2],
) -> [f64; COMPONENTS] {
    let m = family.map(nodes, place);
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

/// One element's stresses at its nodes, carried from its superconvergent points.
fn at_nodes(
    section: &Section,
    moduli: &Moduli,
    family: Family,
    nodes: &[[f64; 2]; 8],
    u: &[[f64; 2]; 8],
) -> [[f64; COMPONENTS]; 8] {
    let mut points = [[0.0; COMPONENTS]; 4];
    for (stress, point) in points.iter_mut().zip(family.stress_points()) {
        *stress = stress_at(section, moduli, family, nodes, u, point.place);
    }
    carried_to_nodes(family, &points)
}

/// The stresses at the superconvergent points of an element, carried to its nodes.
fn carried_to_nodes(family: Family, points: &[[f64; COMPONENTS]; 4]) -> [[f64; COMPONENTS]; 8] {
    let mut at_nodes = [[0.0; COMPONENTS]; 8];
    for (stress, &place) in at_nodes.iter_mut().zip(family.places()) {
        let weights = family.from_stress_points(place);
        *stress = std::array::from_fn(|c| (0..4).map(|k| weights[k] * points[k][c]).sum());
    }
    at_nodes
}
