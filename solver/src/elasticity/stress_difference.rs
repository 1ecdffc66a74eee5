//! Stresses recovered at nodes are better than those of the elements: their difference stands for the error (Zienkiewicz
//! and Zhu), in the energy norm of every element, and weighted by the differences of other fields.
//!
//!   ‖e‖² = ∫ (σ* − σ) : C⁻¹ (σ* − σ),   σ* = Σ h_i σ_i with the recovered nodal stresses σ_i

use crate::elasticity::geometry::{Elements, Stations};
use crate::elasticity::material::{COMPONENTS, Moduli, inverse, stress};
use crate::elasticity::mixed::dilatation;
use crate::elasticity::recovery::{
    ELEMENTS_PER_QUESTION, Stresses, TOGETHER, Undeformed, recover_nodal_stresses,
};
use crate::elasticity::{Recovered, Section};
use crate::element::{Element, Family, GaussPoint, Mapped};
use crate::mesh::Mesh;

/// σ* − σ at the integration points.
pub struct StressDifference {
    stress: Vec<[f64; COMPONENTS]>,
    /// As in [`Recovered`].
    dilatation_gap: Vec<f64>,
}

impl StressDifference {
    /// That of what was recovered of the same elements.
    pub fn new(elements: Elements<'_>, recovered: &Recovered) -> Self {
        let (mesh, quadrature) = (elements.mesh, elements.tables.quadrature);
        let mut differences = Vec::with_capacity(recovered.points[0].len());
        let shapes = [Family::Quad, Family::Triangle].map(|family| {
            let points = family.rule(quadrature).iter();
            points
                .map(|point| family.shape(point.place))
                .collect::<Vec<_>>()
        });
        pulp::Arch::new().dispatch(|| {
            for (e, element) in mesh.elements.iter().enumerate() {
                let smooth = recovered.at_nodes_of(e, element);
                for shape in &shapes[element.family() as usize] {
                    let own = recovered.at_point(differences.len());
                    differences.push(difference(shape, &smooth, &own));
                }
            }
        });
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
    pub fn products(&self, elements: Elements<'_>, other: &StressDifference) -> Vec<f64> {
        integrate(elements, self.points().zip(other.points()))
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

    /// The same products with the differences of [`TOGETHER`] fields, by their displacements at the nodes. None if
    /// `stop` says so, which is asked now and then.
    ///
    /// Both σ* and σ of those fields are linear in what is known at the nodes, so that each element's integral is a sum
    /// over its nodes: the points of integration are visited once for all fields. Nearly incompressible elements, whose
    /// stress depends on more, are recovered field by field.
    pub fn products_with_fields(
        &self,
        elements: Elements<'_>,
        fields: &[[[f64; TOGETHER]; 2]],
        stop: &mut dyn FnMut() -> bool,
    ) -> Option<Vec<Vec<f64>>> {
        let Elements { mesh, section, .. } = elements;
        let quadrature = elements.tables.quadrature;
        let mut products = vec![vec![0.0; mesh.elements.len()]; TOGETHER];
        let mut stations = elements.stations();
        for (material, weights) in weights(section).iter().enumerate() {
            let smooth =
                recover_nodal_stresses(mesh, section, material, &mut stations, fields, stop)?;
            let mut first = 0;
            for (k, elements) in mesh.elements.chunks(ELEMENTS_PER_QUESTION).enumerate() {
                if stop() {
                    return None;
                }
                pulp::Arch::new().dispatch(|| {
                    for (i, element) in elements.iter().enumerate() {
                        let e = k * ELEMENTS_PER_QUESTION + i;
                        let points = element.family().rule(quadrature).len();
                        let own = first..first + points;
                        first = own.end;
                        if section.material_of(e) != material {
                            continue;
                        }
                        let of_fields = (fields, &smooth[..]);
                        let product = if weights.bulk == 0.0 {
                            let stations = stations.of(e);
                            let compliance = &weights.compliance;
                            product(stations, &self.stress[own], compliance, element, of_fields)
                        } else {
                            let own: Vec<Difference> = own.map(|p| self.point(p)).collect();
                            let body = (section, material, weights);
                            mixed_product(mesh, body, (element, &own), quadrature, of_fields)
                        };
                        for (products, product) in products.iter_mut().zip(product) {
                            products[e] = product;
                        }
                    }
                });
            }
        }
        Some(products)
    }

    fn point(&self, point: usize) -> Difference {
        Difference {
            stress: self.stress[point],
            gap: self.dilatation_gap.get(point).copied().unwrap_or(0.0),
        }
    }

    /// The norm of the difference in every element ((force × length)^½, without 2π).
    pub fn norms(&self, elements: Elements<'_>) -> Vec<f64> {
        let stress = self.points().map(|point| Difference { gap: 0.0, ..point });
        let pairs = stress.map(|point| (point, point));
        let squares = integrate(elements, pairs);
        let norm = |square: f64| square.max(0.0).sqrt();
        squares.into_iter().map(norm).collect()
    }
}

/// Nodal values of several fields: their displacements, and their recovered stresses.
type OfFields<'a> = (&'a [[[f64; TOGETHER]; 2]], &'a [Stresses]);

/// What an element has in common with several fields.
#[inline(always)]
fn product(
    stations: &Stations,
    own: &[[f64; COMPONENTS]],
    compliance: &Moduli,
    element: &Element,
    (fields, smooth): OfFields<'_>,
) -> [f64; TOGETHER] {
    // ∫ h_i C⁻¹ (σ* − σ), and the same as forces of a stress: ∫ B_iᵀ (σ* − σ)
    let mut by_stress = [[0.0; 8]; COMPONENTS];
    let (mut by_ux, mut by_uy) = ([0.0; 8], [0.0; 8]);
    for (station, own) in stations.rule.iter().zip(own) {
        for (by_stress, row) in by_stress.iter_mut().zip(compliance) {
            let strain: f64 = (0..COMPONENTS).map(|j| row[j] * own[j]).sum();
            let strain = station.weight * strain;
            (0..8).for_each(|i| by_stress[i] += station.shape[i] * strain);
        }
        station.add_force(station.weight, own, &mut by_ux, &mut by_uy);
    }
    let mut product = [0.0; TOGETHER];
    for (i, &node) in element.iter().enumerate() {
        let ([ux, uy], smooth) = (&fields[node as usize], &smooth[node as usize]);
        for k in 0..TOGETHER {
            product[k] -= by_ux[i] * ux[k] + by_uy[i] * uy[k];
        }
        for (by_stress, smooth) in by_stress.iter().zip(smooth) {
            (0..TOGETHER).for_each(|k| product[k] += by_stress[i] * smooth[k]);
        }
    }
    product
}

/// The same of a nearly incompressible element.
fn mixed_product(
    mesh: &Mesh,
    (section, material, weights): (&Section, usize, &Weights),
    (element, own): (&Element, &[Difference]),
    quadrature: u32,
    (fields, smooth): OfFields<'_>,
) -> [f64; TOGETHER] {
    let (family, nodes) = (element.family(), mesh.element_nodes(element));
    let rule = family.rule(quadrature);
    let map = |point: &GaussPoint| family.map(&nodes, point.place);
    let mapped: Vec<Mapped> = rule.iter().map(map).collect();
    let body = Undeformed::new(section, material, family, &nodes);
    std::array::from_fn(|k| {
        let u = element.gather(|n| fields[n as usize].map(|u| u[k]));
        let smooth = element.gather(|n| smooth[n as usize].map(|stress| stress[k]));
        let deformed = body.displaced(&u, [0.0; 2]);
        let mut product = 0.0;
        for ((point, m), own) in rule.iter().zip(&mapped).zip(own) {
            let at = deformed.at(m, point.place);
            let other = Difference {
                stress: difference(&m.shape, &smooth, &at.stress),
                gap: at.dilatation_gap,
            };
            let weight = point.weight * m.det * section.depth(m.x);
            product += weight * weights.density(own, &other);
        }
        product
    })
}

/// What the two of every pair, one for each integration point, have in common in each element.
fn integrate(
    elements: Elements<'_>,
    mut pairs: impl Iterator<Item = (Difference, Difference)>,
) -> Vec<f64> {
    let Elements { mesh, section, .. } = elements;
    let weights = weights(section);
    let mut stations = elements.stations();
    let product = |e: usize| {
        let weights = &weights[section.material_of(e)];
        let mut sum = 0.0;
        for (station, (own, other)) in stations.of(e).rule.iter().zip(&mut pairs) {
            sum += station.weight * weights.density(&own, &other);
        }
        sum
    };
    (0..mesh.elements.len()).map(product).collect()
}

/// Σ h_i σ_i − σ.
#[inline(always)]
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
    use crate::elasticity::{ElementTables, recover};
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
            let (mesh, section, quadrature) = (&model.mesh, &model.section, model.quadrature);
            let tables = &ElementTables::new(mesh, section, quadrature);
            let elements = tables.elements(mesh, section);
            let field = |k: usize| -> Vec<[f64; 2]> {
                let at = |n: usize, a: usize| ((n * (3 + a) + k) as f64).sin();
                (0..mesh.nodes.len())
                    .map(|n| [at(n, 0), at(n, 1)])
                    .collect()
            };
            let difference =
                |u: &[[f64; 2]]| StressDifference::new(elements, &recover(elements, u, [0.0; 2]));
            let own = difference(&field(0));
            let fields: Vec<_> = (1..=TOGETHER).map(field).collect();
            let together: Vec<_> = (0..mesh.nodes.len())
                .map(|n| [0, 1].map(|a| std::array::from_fn(|k| fields[k][n][a])))
                .collect();
            let never = &mut || false;
            let found = own.products_with_fields(elements, &together, never);
            for (found, u) in found.unwrap().iter().zip(&fields) {
                let expected = own.products(elements, &difference(u));
                let size: f64 = expected.iter().map(|p| p.abs()).sum();
                for (a, b) in found.iter().zip(&expected) {
                    assert!((a - b).abs() <= 1e-12 * size, "{kind}: {a} for {b}");
                }
            }
            assert!(
                own.products_with_fields(elements, &together, &mut || true)
                    .is_none()
            );
        }
    }
}
