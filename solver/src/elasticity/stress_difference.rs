//! Stresses recovered at nodes are better than those of the elements: their difference stands for the error (Zienkiewicz
//! and Zhu), in the energy norm of every element, and weighted by the differences of other fields.
//!
//!   ‖e‖² = ∫ (σ* − σ) : C⁻¹ (σ* − σ),   σ* = Σ h_i σ_i with the recovered nodal stresses σ_i

use crate::elasticity::material::{COMPONENTS, Moduli, inverse, stress};
use crate::elasticity::mixed::dilatation;
use crate::elasticity::recovery::{ELEMENTS_PER_QUESTION, recover_nodal_stresses};
use crate::elasticity::{Recovered, Section, recover};
use crate::element::Element;
use crate::mesh::Mesh;

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
        let compliances = compliances(section);
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
        let compliances = compliances(section);
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

    /// The same products with the differences of several fields, by their displacements at the nodes. None if `stop`
    /// says so, which is asked now and then.
    ///
    /// Both σ* and σ of those fields are linear in what is known at the nodes, so that each element's integral is a sum
    /// over its nodes: the points of integration are visited once for all fields. Nearly incompressible elements, whose
    /// stress depends on more, are recovered field by field.
    pub fn products_with_fields(
        &self,
        mesh: &Mesh,
        section: &Section,
        quadrature: u32,
        fields: &[Vec<[f64; 2]>],
        stop: &mut dyn FnMut() -> bool,
    ) -> Option<Vec<Vec<f64>>> {
        if section.has_split() {
            let products = |u: &Vec<[f64; 2]>| {
                let recovered = recover(mesh, section, quadrature, u, [0.0; 2]);
                let other = StressDifference::new(mesh, quadrature, &recovered);
                (!stop()).then(|| self.products(mesh, section, quadrature, &other))
            };
            return fields.iter().map(products).collect();
        }
        let mut products = vec![vec![0.0; mesh.elements.len()]; fields.len()];
        for (material, compliance) in compliances(section).iter().enumerate() {
            let smooth = recover_nodal_stresses(mesh, section, material, fields, stop)?;
            let mut first = 0;
            for (e, element) in mesh.elements.iter().enumerate() {
                if e % ELEMENTS_PER_QUESTION == 0 && stop() {
                    return None;
                }
                let (family, nodes) = (element.family(), mesh.element_nodes(element));
                let rule = family.rule(quadrature);
                let own = &self.stress[first..first + rule.len()];
                first += rule.len();
                if section.material_of(e) != material {
                    continue;
                }
                // ∫ h_i C⁻¹ (σ* − σ), and the same as forces of a stress: ∫ B_iᵀ (σ* − σ)
                let mut by_stress = [[0.0; COMPONENTS]; 8];
                let mut by_displacement = [[0.0; 2]; 8];
                for (point, own) in rule.iter().zip(own) {
                    let m = family.map(&nodes, point.place);
                    let weight = point.weight * m.det * section.depth(m.x);
                    let strain: [f64; COMPONENTS] = std::array::from_fn(|i| {
                        (0..COMPONENTS)
                            .map(|j| compliance[i][j] * own[j])
                            .sum::<f64>()
                    });
                    for i in 0..family.nodes() {
                        let b = section.strain(m.shape[i], m.gradient[i], m.x);
                        for c in 0..COMPONENTS {
                            by_stress[i][c] += weight * m.shape[i] * strain[c];
                            for p in 0..2 {
                                by_displacement[i][p] += weight * b[c][p] * own[c];
                            }
                        }
                    }
                }
                for ((product, u), smooth) in products.iter_mut().zip(fields).zip(&smooth) {
                    let at_node = |(i, &node): (usize, &u32)| {
                        let (u, smooth) = (u[node as usize], smooth[node as usize]);
                        let recovered: f64 =
                            (0..COMPONENTS).map(|c| by_stress[i][c] * smooth[c]).sum();
                        recovered - (0..2).map(|p| by_displacement[i][p] * u[p]).sum::<f64>()
                    };
                    product[e] = element.iter().enumerate().map(at_node).sum();
                }
            }
        }
        Some(products)
    }

    /// The norm of the difference in every element ((force × length)^½, without 2π).
    pub fn norms(&self, mesh: &Mesh, section: &Section, quadrature: u32) -> Vec<f64> {
        let squares = self.stress_products(mesh, section, quadrature, self);
        let norm = |square: f64| square.max(0.0).sqrt();
        squares.into_iter().map(norm).collect()
    }
}

/// C⁻¹ of every material.
fn compliances(section: &Section) -> Vec<Moduli> {
    let moduli = section.materials().iter();
    moduli
        .map(|moduli| inverse(moduli).unwrap_or_default())
        .collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::ops::ControlFlow;

    use super::*;
    use crate::solution::Observer;

    /// In every kind of analysis, with two materials, quadrilaterals and triangles.
    #[test]
    fn products_of_fields_are_those_of_their_recovered_stresses() {
        for kind in ["plane_strain", "plane_stress", "axisymmetric"] {
            let mut analysis = serde_json::json!({"kind": kind});
            if kind == "plane_stress" {
                analysis["thickness"] = 1.into();
            }
            let problem = serde_json::json!({
                "analysis": analysis,
                "mesh": {"inline": {
                    "nodes": [
                        [0, 0], [1, 0], [2, 0], [0, 1], [1.1, 1], [2, 1], [0.5, 0], [1.05, 0.5], [0.55, 1], [0, 0.5],
                        [1.5, 0], [2, 0.5], [1.5, 0.5], [1.55, 1]
                    ],
                    "elements": [[0, 1, 4, 3, 6, 7, 8, 9], [1, 2, 5, 10, 11, 12], [1, 5, 4, 12, 13, 7]],
                    "groups": {"left": [0], "right": [1, 2]},
                    "boundaries": {"low": [[0, 1, 6], [1, 2, 10]], "high": [[3, 4, 8], [4, 5, 13]]}
                }, "refine": 1},
                "materials": [
                    {"group": "left", "youngs_modulus": 1000, "poissons_ratio": 0.3},
                    {"group": "right", "youngs_modulus": 10, "poissons_ratio": 0.2}
                ],
                "supports": [{"boundary": "low", "ux": 0, "uy": 0}],
                "contacts": [{"boundary": "high", "obstacle": {"kind": "flat"}, "indentation": 0.1}]
            });
            let problem = serde_json::from_value(problem).unwrap();
            let quiet: &mut Observer<'_> = &mut |_| ControlFlow::Continue(());
            let model = crate::prepare(&problem, None, quiet).unwrap().model;
            let (mesh, section, order) = (&model.mesh, &model.section, model.quadrature);
            let field = |k: usize| -> Vec<[f64; 2]> {
                let at = |n: usize, a: usize| ((n * (3 + a) + k) as f64).sin();
                (0..mesh.nodes.len())
                    .map(|n| [at(n, 0), at(n, 1)])
                    .collect()
            };
            let difference = |u: &[[f64; 2]]| {
                StressDifference::new(mesh, order, &recover(mesh, section, order, u, [0.0; 2]))
            };
            let (own, fields) = (difference(&field(0)), [field(1), field(2)]);
            let never = &mut || false;
            let found = own.products_with_fields(mesh, section, order, &fields, never);
            for (found, u) in found.unwrap().iter().zip(&fields) {
                let expected = own.products(mesh, section, order, &difference(u));
                let size: f64 = expected.iter().map(|p| p.abs()).sum();
                for (a, b) in found.iter().zip(&expected) {
                    assert!((a - b).abs() <= 1e-12 * size, "{kind}: {a} for {b}");
                }
            }
            assert!(
                own.products_with_fields(mesh, section, order, &fields, &mut || true)
                    .is_none()
            );
        }
    }
}
