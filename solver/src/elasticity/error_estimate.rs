//! The error estimate of Zienkiewicz and Zhu: stresses recovered at nodes are better than those of
//! the elements; their difference, in the energy norm, estimates the error.
//!
//!   ‖e‖² = ∫ (σ* − σ) : C⁻¹ (σ* − σ),   σ* = Σ h_i σ_i with the recovered nodal stresses σ_i

use crate::elasticity::material::{COMPONENTS, Moduli, inverse};
use crate::elasticity::{Recovered, Section};
use crate::element::Element;
use crate::mesh::Mesh;

/// The estimate, without 2π.
pub struct StressError {
    /// Norm of the error of every element ((force × length)^½).
    pub elements: Vec<f64>,
    /// Norm of the error of the whole.
    pub total: f64,
}

/// Compares recovered and element stresses at the integration points.
///
/// `quadrature`: the one that `recovered` was made with.
pub fn stress_error(
    mesh: &Mesh,
    section: &Section,
    quadrature: u32,
    recovered: &Recovered,
) -> StressError {
    let compliances: Vec<Moduli> = section
        .materials()
        .iter()
        .map(|moduli| inverse(moduli).unwrap_or_default())
        .collect();
    let mut stresses = recovered.point_stress.iter();
    let square = |(e, element): (usize, &Element)| {
        let (family, nodes) = (element.family(), mesh.element_nodes(element));
        let (smooth, compliance) = (
            &recovered.element_stress[e],
            &compliances[section.material_of(e)],
        );
        let mut square = 0.0;
        for (point, own) in family.rule(quadrature).iter().zip(&mut stresses) {
            let m = family.map(&nodes, point.place);
            let difference: [f64; COMPONENTS] = std::array::from_fn(|c| {
                (0..8).map(|i| m.shape[i] * smooth[i][c]).sum::<f64>() - own[c]
            });
            let mut density = 0.0;
            for i in 0..COMPONENTS {
                for j in 0..COMPONENTS {
                    density += difference[i] * compliance[i][j] * difference[j];
                }
            }
            square += point.weight * m.det * section.depth(m.x) * density;
        }
        square.max(0.0)
    };
    let squares: Vec<f64> = mesh.elements.iter().enumerate().map(square).collect();
    StressError {
        total: squares.iter().sum::<f64>().sqrt(),
        elements: squares.iter().map(|s| s.sqrt()).collect(),
    }
}
