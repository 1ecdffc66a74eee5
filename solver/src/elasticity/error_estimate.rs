//! The error estimate of Zienkiewicz and Zhu: stresses recovered at nodes are better than those of
//! the elements; their difference, in the energy norm, estimates the error.
//!
//!   ‖e‖² = ∫ (σ* − σ) : C⁻¹ (σ* − σ),   σ* = Σ h_i σ_i with the recovered nodal stresses σ_i

use crate::elasticity::material::{COMPONENTS, Moduli, inverse, stress};
use crate::elasticity::mixed::dilatation;
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

/// σ* − σ at the integration points.
pub struct StressDifference {
    stress: Vec<[f64; COMPONENTS]>,
    /// As in [`Recovered`].
    dilatation_gap: Vec<f64>,
}

impl StressDifference {
    /// `quadrature`: the one that `recovered` was made with.
    pub fn new(mesh: &Mesh, quadrature: u32, recovered: &Recovered) -> Self {
        let mut stresses = recovered.point_stress.iter();
        let mut differences = Vec::with_capacity(stresses.len());
        for (e, element) in mesh.elements.iter().enumerate() {
            let (family, smooth) = (element.family(), &recovered.element_stress[e]);
            for (point, own) in family.rule(quadrature).iter().zip(&mut stresses) {
                let shape = family.shape(point.place);
                differences.push(std::array::from_fn(|c| {
                    (0..8).map(|i| shape[i] * smooth[i][c]).sum::<f64>() - own[c]
                }));
            }
        }
        StressDifference {
            stress: differences,
            dilatation_gap: recovered.dilatation_gap.clone(),
        }
    }

    /// ∫ (σ* − σ) : C⁻¹ (σ* − σ)′ of every element, with the difference of another field (force × length, without 2π).
    ///
    /// In nearly incompressible elements stress and strain are not those of each other, and the energy that the errors
    /// of both fields have in common is more: with g = θ̄ − div u and t = tr C⁻¹ (σ* − σ),
    ///
    ///   … + κ (g t′ + t g′) − κ (1 − κ mᵀC⁻¹m) g g′
    pub fn products(
        &self,
        mesh: &Mesh,
        section: &Section,
        quadrature: u32,
        other: &StressDifference,
    ) -> Vec<f64> {
        let mut products = self.stress_products(mesh, section, quadrature, other);
        if section.has_split() {
            self.add_dilatation(mesh, section, quadrature, other, &mut products);
        }
        products
    }

    fn stress_products(
        &self,
        mesh: &Mesh,
        section: &Section,
        quadrature: u32,
        other: &StressDifference,
    ) -> Vec<f64> {
        let compliances: Vec<Moduli> = section
            .materials()
            .iter()
            .map(|moduli| inverse(moduli).unwrap_or_default())
            .collect();
        let mut pairs = self.stress.iter().zip(&other.stress);
        let product = |(e, element): (usize, &Element)| {
            let (family, nodes) = (element.family(), mesh.element_nodes(element));
            let compliance = &compliances[section.material_of(e)];
            let mut sum = 0.0;
            for (point, (own, other)) in family.rule(quadrature).iter().zip(&mut pairs) {
                let m = family.map(&nodes, point.place);
                let mut density = 0.0;
                for i in 0..COMPONENTS {
                    for j in 0..COMPONENTS {
                        density += own[i] * compliance[i][j] * other[j];
                    }
                }
                sum += point.weight * m.det * section.depth(m.x) * density;
            }
            sum
        };
        mesh.elements.iter().enumerate().map(product).collect()
    }

    fn add_dilatation(
        &self,
        mesh: &Mesh,
        section: &Section,
        quadrature: u32,
        other: &StressDifference,
        products: &mut [f64],
    ) {
        let compliances: Vec<Moduli> = section
            .materials()
            .iter()
            .map(|moduli| inverse(moduli).unwrap_or_default())
            .collect();
        let own = self.stress.iter().zip(&self.dilatation_gap);
        let other = other.stress.iter().zip(&other.dilatation_gap);
        let mut pairs = own.zip(other);
        for (e, element) in mesh.elements.iter().enumerate() {
            let (family, nodes) = (element.family(), mesh.element_nodes(element));
            let material = section.material_of(e);
            let points = family.rule(quadrature).iter().zip(&mut pairs);
            let Some(split) = section.split(material) else {
                points.for_each(drop);
                continue;
            };
            let (compliance, bulk) = (&compliances[material], split.bulk);
            let of_pressure = stress(compliance, &[1.0, 1.0, 0.0, 1.0]);
            let rest = bulk * (1.0 - bulk * dilatation(&of_pressure));
            for (point, ((own, g), (other, g_other))) in points {
                let trace = |difference| dilatation(&stress(compliance, difference));
                let density = bulk * (g * trace(other) + g_other * trace(own)) - rest * g * g_other;
                let m = family.map(&nodes, point.place);
                products[e] += point.weight * m.det * section.depth(m.x) * density;
            }
        }
    }

    /// The norm of the difference, of every element and of the whole: the estimate.
    pub fn norms(&self, mesh: &Mesh, section: &Section, quadrature: u32) -> StressError {
        let squares = self.stress_products(mesh, section, quadrature, self);
        let squares: Vec<f64> = squares.into_iter().map(|square| square.max(0.0)).collect();
        StressError {
            total: squares.iter().sum::<f64>().sqrt(),
            elements: squares.iter().map(|square| square.sqrt()).collect(),
        }
    }
}
