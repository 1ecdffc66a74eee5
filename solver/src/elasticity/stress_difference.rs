//! Stresses recovered at nodes are better than those of the elements: their difference stands for the error (Zienkiewicz
//! and Zhu), in the energy norm of every element, and weighted by the differences of other fields.
//!
//!   ‖e‖² = ∫ (σ* − σ) : C⁻¹ (σ* − σ),   σ* = Σ h_i σ_i with the recovered nodal stresses σ_i

use crate::elasticity::material::{COMPONENTS, Moduli, inverse, stress};
use crate::elasticity::mixed::dilatation;
use crate::elasticity::recovery::{ELEMENTS_PER_QUESTION, Undeformed, recover_nodal_stresses};
use crate::elasticity::{Recovered, Section};
use crate::element::{Element, GaussPoint, Mapped};
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
                differences.push(difference(&shape, smooth, own));
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
        let pairs = self.points().zip(other.points());
        integrate(mesh, section, quadrature, pairs)
    }

    /// The difference at every integration point.
    fn points(&self) -> impl Iterator<Item = Difference> {
        let gaps = self.dilatation_gap.iter().copied();
        let gaps = gaps.chain(std::iter::repeat(0.0));
        let pairs = self.stress.iter().zip(gaps);
        pairs.map(|(stress, gap)| Difference {
            stress: *stress,
            gap,
        })
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
            return self.products_field_by_field(mesh, section, quadrature, fields, stop);
        }
        let mut products = vec![vec![0.0; mesh.elements.len()]; fields.len()];
        for (material, Weights { compliance, .. }) in weights(section).iter().enumerate() {
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

    fn products_field_by_field(
        &self,
        mesh: &Mesh,
        section: &Section,
        quadrature: u32,
        fields: &[Vec<[f64; 2]>],
        stop: &mut dyn FnMut() -> bool,
    ) -> Option<Vec<Vec<f64>>> {
        let mut products = vec![vec![0.0; mesh.elements.len()]; fields.len()];
        for (material, weights) in weights(section).iter().enumerate() {
            let smooth = recover_nodal_stresses(mesh, section, material, fields, stop)?;
            let mut points = self.points();
            for (e, element) in mesh.elements.iter().enumerate() {
                if e % ELEMENTS_PER_QUESTION == 0 && stop() {
                    return None;
                }
                let (family, nodes) = (element.family(), mesh.element_nodes(element));
                let rule = family.rule(quadrature);
                let own: Vec<Difference> = points.by_ref().take(rule.len()).collect();
                if section.material_of(e) != material {
                    continue;
                }
                let map = |point: &GaussPoint| family.map(&nodes, point.place);
                let mapped: Vec<Mapped> = rule.iter().map(map).collect();
                let body = Undeformed::new(section, material, family, &nodes);
                for ((product, u), smooth) in products.iter_mut().zip(fields).zip(&smooth) {
                    let u = element.gather(|n| u[n as usize]);
                    let smooth = element.gather(|n| smooth[n as usize]);
                    let deformed = body.displaced(&u, [0.0; 2]);
                    for ((point, m), own) in rule.iter().zip(&mapped).zip(&own) {
                        let at = deformed.at(m, point.place);
                        let other = Difference {
                            stress: difference(&m.shape, &smooth, &at.stress),
                            gap: at.dilatation_gap,
                        };
                        product[e] += point.weight
                            * m.det
                            * section.depth(m.x)
                            * weights.density(own, &other);
                    }
                }
            }
        }
        Some(products)
    }

    /// The norm of the difference in every element ((force × length)^½, without 2π).
    pub fn norms(&self, mesh: &Mesh, section: &Section, quadrature: u32) -> Vec<f64> {
        let stress = self.points().map(|point| Difference { gap: 0.0, ..point });
        let squares = integrate(
            mesh,
            section,
            quadrature,
            stress.map(|point| (point, point)),
        );
        let norm = |square: f64| square.max(0.0).sqrt();
        squares.into_iter().map(norm).collect()
    }
}

/// What the two of every pair, one for each integration point, have in common in each element.
fn integrate(
    mesh: &Mesh,
    section: &Section,
    quadrature: u32,
    mut pairs: impl Iterator<Item = (Difference, Difference)>,
) -> Vec<f64> {
    let weights = weights(section);
    let product = |(e, element): (usize, &Element)| {
        let (family, nodes) = (element.family(), mesh.element_nodes(element));
        let weights = &weights[section.material_of(e)];
        let mut sum = 0.0;
        for (point, (own, other)) in family.rule(quadrature).iter().zip(&mut pairs) {
            let m = family.map(&nodes, point.place);
            sum += point.weight * m.det * section.depth(m.x) * weights.density(&own, &other);
        }
        sum
    };
    mesh.elements.iter().enumerate().map(product).collect()
}

/// Σ h_i σ_i − σ.
fn difference(
    shape: &[f64; 8],
    smooth: &[[f64; COMPONENTS]; 8],
    own: &[f64; COMPONENTS],
) -> [f64; COMPONENTS] {
    std::array::from_fn(|c| (0..8).map(|i| shape[i] * smooth[i][c]).sum::<f64>() - own[c])
}

/// The difference at a point.
#[derive(Clone, Copy)]
struct Difference {
    /// σ* − σ.
    stress: [f64; COMPONENTS],
    /// θ̄ − div u.
    gap: f64,
}

/// What the differences of a material are multiplied by.
struct Weights {
    /// C⁻¹.
    compliance: Moduli,
    /// κ, and κ (1 − κ mᵀC⁻¹m); 0 unless the material is nearly incompressible.
    bulk: f64,
    rest: f64,
}

impl Weights {
    /// What two fields have in common at a point (energy per volume): see [`StressDifference::products`].
    fn density(&self, own: &Difference, other: &Difference) -> f64 {
        let strain = stress(&self.compliance, &other.stress);
        let density: f64 = (0..COMPONENTS).map(|i| own.stress[i] * strain[i]).sum();
        if self.bulk == 0.0 {
            return density;
        }
        let of_own = dilatation(&stress(&self.compliance, &own.stress));
        let gaps = own.gap * dilatation(&strain) + other.gap * of_own;
        density + self.bulk * gaps - self.rest * own.gap * other.gap
    }
}

/// The weights of every material.
fn weights(section: &Section) -> Vec<Weights> {
    let of = |(material, moduli): (usize, &Moduli)| {
        let compliance = inverse(moduli).unwrap_or_default();
        let bulk = section.split(material).map_or(0.0, |split| split.bulk);
        let of_pressure = stress(&compliance, &[1.0, 1.0, 0.0, 1.0]);
        Weights {
            compliance,
            bulk,
            rest: bulk * (1.0 - bulk * dilatation(&of_pressure)),
        }
    };
    section.materials().iter().enumerate().map(of).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::ops::ControlFlow;

    use super::*;
    use crate::elasticity::recover;
    use crate::solution::Observer;

    /// In every kind of analysis, with two materials, quadrilaterals and triangles.
    #[test]
    fn products_of_fields_are_those_of_their_recovered_stresses() {
        for (kind, ratio) in [
            ("plane_strain", 0.2),
            ("plane_stress", 0.2),
            ("axisymmetric", 0.2),
            ("plane_strain", 0.4999),
            ("axisymmetric", 0.49),
        ] {
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
                    {"group": "right", "youngs_modulus": 10, "poissons_ratio": ratio}
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
