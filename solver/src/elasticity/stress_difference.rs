//! The error of the stresses, estimated by the difference between stresses recovered at the nodes and those of the
//! elements (Zienkiewicz and Zhu): in the energy norm of every element, and weighted by the differences of other
//! fields.
//!
//!   ‖e‖² = ∫ (σ* − σ) : C⁻¹ (σ* − σ),   σ* = Σ h_i σ_i with the recovered nodal stresses σ_i

use crate::elasticity::geometry::{Elements, Points, Station};
use crate::elasticity::material::{COMPONENTS, Moduli, inverse, stress};
use crate::elasticity::mixed::{Mixed, OfNodes, dilatation};
use crate::elasticity::recovery::{Stresses, recover_nodal_stresses};
use crate::elasticity::{Recovered, Section};
use crate::element::{AtNodes, Element, Family, GaussPoint};
use crate::linear::{Interrupt, Stopped};

/// The difference σ* − σ at the integration points.
pub struct StressDifference {
    stress: Vec<[f64; COMPONENTS]>,
    /// θ̄ − div u at the integration points, as in [`Recovered`].
    dilatation_gap: Vec<f64>,
}

impl StressDifference {
    /// The difference for the stresses `recovered`, which were recovered from the same `elements`, and its norm in every
    /// element ((force × length)^½, without 2π). `threads`: the number of threads that do the work.
    pub fn new(
        elements: Elements<'_>,
        recovered: &Recovered,
        threads: usize,
        interrupt: &mut Interrupt<'_>,
    ) -> Result<(Self, Vec<f64>), Stopped> {
        let Elements { mesh, section, .. } = elements;
        let quadrature = elements.tables.quadrature;
        let count = recovered.points[0].len();
        let mut differences = Vec::with_capacity(count);
        let mut norms = Vec::with_capacity(mesh.elements.len());
        let shapes = [Family::Quad, Family::Triangle].map(|family| {
            let points = family.rule(quadrature).iter();
            points
                .map(|point| family.shape(point.place))
                .collect::<Vec<_>>()
        });
        let weights = weights(section);
        elements.for_each_chunk(
            threads,
            |elements, points| (Vec::with_capacity(points), Vec::with_capacity(elements)),
            |(differences, norms): &mut (Vec<_>, Vec<f64>), stations, chunk| {
                differences.clear();
                norms.clear();
                pulp::Arch::new().dispatch(|| {
                    for (e, element) in chunk.numbered() {
                        let smooth = recovered.at_nodes_of(e, element);
                        let weights = &weights[section.material_of(e)];
                        let rule = stations.of(e, Points::Rule);
                        let mut square = 0.0;
                        for (shape, station) in shapes[element.family() as usize].iter().zip(rule) {
                            let point = chunk.first_point + differences.len();
                            let stress = difference(shape, &smooth, &recovered.at_point(point));
                            let own = Difference { stress, gap: 0.0 };
                            square += station.weight * weights.density(&own, &own);
                            differences.push(stress);
                        }
                        norms.push(square.max(0.0).sqrt());
                    }
                });
            },
            |found, _| {
                differences.extend_from_slice(&found.0);
                norms.extend_from_slice(&found.1);
            },
            interrupt,
        )?;
        let found = StressDifference {
            stress: differences,
            dilatation_gap: recovered.dilatation_gap.clone(),
        };
        Ok((found, norms))
    }

    /// The product ∫ (σ* − σ) : C⁻¹ (σ* − σ)′ in every element (force × length, without 2π) with the differences
    /// (σ* − σ)′ of several other fields, given by their displacements at the nodes.
    ///
    /// In nearly incompressible elements the stress does not follow from the strain alone, and the product has more
    /// terms: with g = θ̄ − div u and t = tr C⁻¹ (σ* − σ),
    ///
    ///   … + κ (g t′ + t g′) − κ (1 − κ mᵀC⁻¹m) g g′
    ///
    /// Both σ* and σ of the other fields are linear in the nodal values, so that each element's integral is a sum over
    /// its nodes: the integration points are visited once for all fields.
    pub fn products<const FIELDS: usize>(
        &self,
        elements: Elements<'_>,
        fields: &[[[f64; FIELDS]; 2]],
        threads: usize,
        interrupt: &mut Interrupt<'_>,
    ) -> Result<[Vec<f64>; FIELDS], Stopped> {
        // the substitutions for the fields could not be stopped
        interrupt.ask()?;
        let Elements { mesh, section, .. } = elements;
        let quadrature = elements.tables.quadrature;
        let mut products = std::array::from_fn(|_| vec![0.0; mesh.elements.len()]);
        for (material, weights) in weights(section).iter().enumerate() {
            let split = section.split(material);
            let smooth = recover_nodal_stresses(elements, material, fields, threads, interrupt)?;
            elements.for_each_chunk(
                threads,
                |elements, _| Vec::with_capacity(elements),
                |found: &mut Vec<_>, stations, chunk| {
                    found.clear();
                    let mut first = chunk.first_point;
                    pulp::Arch::new().dispatch(|| {
                        for (e, element) in chunk.numbered() {
                            let family = element.family();
                            let own = first..first + family.rule(quadrature).len();
                            first = own.end;
                            if section.material_of(e) != material {
                                continue;
                            }
                            let in_common = match split {
                                None => {
                                    let own = &self.stress[own];
                                    let rule = stations.of(e, Points::Rule);
                                    InCommon::new(rule, own, &weights.compliance)
                                }
                                Some(split) => {
                                    let nodes = mesh.element_nodes(element);
                                    let body = Mixed::new(section, split, family, &nodes);
                                    let body = (section, &OfNodes::new(&body));
                                    let own = own.map(|point| self.point(point));
                                    let rule = family.rule(quadrature).iter().zip(own);
                                    InCommon::of_mixed(body, weights, (family, &nodes), rule)
                                }
                            };
                            found.push((e, in_common.with(element, fields, &smooth)));
                        }
                    });
                },
                |found, _| {
                    for (e, product) in found {
                        for (products, product) in products.iter_mut().zip(product) {
                            products[*e] = *product;
                        }
                    }
                },
                interrupt,
            )?;
        }
        Ok(products)
    }

    fn point(&self, point: usize) -> Difference {
        Difference {
            stress: self.stress[point],
            gap: self.dilatation_gap.get(point).copied().unwrap_or(0.0),
        }
    }
}

/// The coefficients of an element's products with any other field, as linear functions of the field's nodal values.
#[derive(Default)]
struct InCommon {
    /// Coefficients of the recovered stresses: ∫ h_i C⁻¹ (σ* − σ).
    by_stress: [[f64; 8]; COMPONENTS],
    /// Coefficients of the displacements along x, −∫ B_iᵀ (σ* − σ).
    by_ux: [f64; 8],
    by_uy: [f64; 8],
}

impl InCommon {
    #[inline(always)]
    fn new(rule: &[Station], own: &[[f64; COMPONENTS]], compliance: &Moduli) -> Self {
        let mut found = InCommon::default();
        for (station, own) in rule.iter().zip(own) {
            let strain = stress(compliance, own).map(|strain| station.weight * strain);
            found.add_smooth(&station.shape, &strain);
            let InCommon { by_ux, by_uy, .. } = &mut found;
            station.add_force(-station.weight, own, by_ux, by_uy);
        }
        found
    }

    /// The coefficients for a nearly incompressible element, whose stress depends on its bubble and pressure too.
    #[inline(always)]
    fn of_mixed<'a>(
        (section, body): (&Section, &OfNodes<'_>),
        weights: &Weights,
        (family, nodes): (Family, &AtNodes<[f64; 2]>),
        rule: impl Iterator<Item = (&'a GaussPoint, Difference)>,
    ) -> Self {
        let mut found = InCommon::default();
        for (point, own) in rule {
            let m = family.map(nodes, point.place);
            let weight = point.weight * m.det * section.depth(m.x);
            let (of_stress, of_gap) = weights.of_other(&own);
            let of_stress = of_stress.map(|s| weight * s);
            found.add_smooth(&m.shape, &of_stress);
            let at = body.at(section, (family, nodes), &m, point.place);
            let by_u = at.sum(&of_stress.map(|s| -s), weight * of_gap);
            for i in 0..8 {
                found.by_ux[i] += by_u[2 * i];
                found.by_uy[i] += by_u[2 * i + 1];
            }
        }
        found
    }

    /// Adds the product `of_stress` : σ* at a point, where σ* is interpolated from the recovered stresses at the nodes.
    #[inline(always)]
    fn add_smooth(&mut self, shape: &[f64; 8], of_stress: &[f64; COMPONENTS]) {
        for (by_stress, of_stress) in self.by_stress.iter_mut().zip(of_stress) {
            (0..8).for_each(|i| by_stress[i] += shape[i] * of_stress);
        }
    }

    /// The products with several fields, from their displacements and recovered stresses at the nodes.
    #[inline(always)]
    fn with<const FIELDS: usize>(
        &self,
        element: &Element,
        fields: &[[[f64; FIELDS]; 2]],
        smooth: &[Stresses<FIELDS>],
    ) -> [f64; FIELDS] {
        let mut product = [0.0; FIELDS];
        for (i, &node) in element.iter().enumerate() {
            let ([ux, uy], smooth) = (&fields[node as usize], &smooth[node as usize]);
            for k in 0..FIELDS {
                product[k] += self.by_ux[i] * ux[k] + self.by_uy[i] * uy[k];
            }
            for (by_stress, smooth) in self.by_stress.iter().zip(smooth) {
                (0..FIELDS).for_each(|k| product[k] += by_stress[i] * smooth[k]);
            }
        }
        product
    }
}

/// The difference σ* − σ = Σ h_i σ_i − σ at a point.
#[inline(always)]
fn difference(
    shape: &[f64; 8],
    smooth: &[[f64; COMPONENTS]; 8],
    own: &[f64; COMPONENTS],
) -> [f64; COMPONENTS] {
    std::array::from_fn(|c| (0..8).map(|i| shape[i] * smooth[i][c]).sum::<f64>() - own[c])
}

/// The difference of stress and dilatation at a point.
#[derive(Clone, Copy)]
struct Difference {
    /// The stress difference σ* − σ.
    stress: [f64; COMPONENTS],
    /// The dilatation gap θ̄ − div u.
    gap: f64,
}

/// The factors on stress differences and dilatation gaps in a material.
struct Weights {
    /// The compliance C⁻¹.
    compliance: Moduli,
    /// κ and κ (1 − κ mᵀC⁻¹m); 0 unless the material is nearly incompressible.
    bulk: f64,
    rest: f64,
}

impl Weights {
    /// The product of two differences at a point (energy per volume): see [`StressDifference::products`].
    fn density(&self, own: &Difference, other: &Difference) -> f64 {
        let (of_stress, of_gap) = self.of_other(own);
        let density: f64 = (0..COMPONENTS)
            .map(|c| of_stress[c] * other.stress[c])
            .sum();
        density + of_gap * other.gap
    }

    /// The factors of the stress and gap of `other` in [`Weights::density`].
    #[inline(always)]
    fn of_other(&self, own: &Difference) -> ([f64; COMPONENTS], f64) {
        let mut strain = stress(&self.compliance, &own.stress);
        if self.bulk == 0.0 {
            return (strain, 0.0);
        }
        let of_gap = self.bulk * dilatation(&strain) - self.rest * own.gap;
        let of_pressure = stress(&self.compliance, &[1.0, 1.0, 0.0, 1.0]);
        (0..COMPONENTS).for_each(|c| strain[c] += self.bulk * own.gap * of_pressure[c]);
        (strain, of_gap)
    }
}

/// The factors of [`Weights`] for every material.
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
    use super::*;
    use crate::elasticity::{ElementTables, recover};

    /// Products with fields equal those computed from their recovered stresses, in every kind of analysis, with two
    /// materials, quadrilaterals and triangles; all of it on one thread and on two, with the same bits.
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
                }, "refine": 3},
                "materials": [
                    {"group": "left", "youngs_modulus": 1000, "poissons_ratio": 0.3},
                    {"group": "right", "youngs_modulus": 10, "poissons_ratio": ratio}
                ],
                "supports": [{"boundary": "low", "ux": 0, "uy": 0}],
                "contacts": [{"boundary": "high", "obstacle": {"kind": "flat"}, "indentation": 0.1}]
            });
            let problem = serde_json::from_value(problem).unwrap();
            let model = crate::prepare(&problem, None, &mut ()).unwrap().model;
            let (mesh, section, quadrature) = (&model.mesh, &model.section, model.quadrature);
            let tables = &ElementTables::new(mesh, section, quadrature);
            let elements = tables.elements(mesh, section, &model.springs);
            let field = |k: usize| -> Vec<[f64; 2]> {
                let at = |n: usize, a: usize| ((n * (3 + a) + k) as f64).sin();
                (0..mesh.nodes.len())
                    .map(|n| [at(n, 0), at(n, 1)])
                    .collect()
            };
            let never = &mut || false;
            let interrupt = &mut Interrupt::new(never);
            let inner = model.inner(&crate::model::Level::FULL);
            let difference = |u: &[[f64; 2]], interrupt: &mut Interrupt<'_>| {
                let [one, two] = [1, 2].map(|threads| {
                    let recovered = recover(elements, u, &inner, threads, interrupt).unwrap();
                    let found = StressDifference::new(elements, &recovered, threads, interrupt);
                    let (own, norms) = found.unwrap();
                    let sums = (recovered.internal_force, recovered.strain_energy);
                    (own, (recovered.stress, recovered.points, sums, norms))
                });
                assert_eq!(one.0.stress, two.0.stress);
                assert_eq!(one.1, two.1);
                one.0
            };
            let weights = weights(section);
            let mut stations = elements.stations();
            let mut product = |e: usize, [a, b]: [&StressDifference; 2]| -> f64 {
                let points = mesh.elements[..e]
                    .iter()
                    .map(|e| e.family().rule(quadrature).len());
                let rule = stations.of(e, Points::Rule).iter().zip(points.sum()..);
                let density = |k| weights[section.material_of(e)].density(&a.point(k), &b.point(k));
                rule.map(|(station, k)| station.weight * density(k)).sum()
            };
            let own = difference(&field(0), interrupt);
            let fields: Vec<_> = (1..=5).map(field).collect();
            let together: Vec<[[f64; 5]; 2]> = (0..mesh.nodes.len())
                .map(|n| [0, 1].map(|a| std::array::from_fn(|k| fields[k][n][a])))
                .collect();
            let found = own.products(elements, &together, 1, interrupt);
            let on_two = own.products(elements, &together, 2, interrupt);
            assert_eq!(found, on_two);
            for (found, u) in found.unwrap().iter().zip(&fields) {
                let other = difference(u, interrupt);
                let expected = (0..mesh.elements.len()).map(|e| product(e, [&own, &other]));
                let expected: Vec<f64> = expected.collect();
                let size: f64 = expected.iter().map(|p| p.abs()).sum();
                for (a, b) in found.iter().zip(&expected) {
                    assert!((a - b).abs() <= 1e-12 * size, "{kind}: {a} for {b}");
                }
            }
            let stop = &mut || true;
            let stopped = own.products(elements, &together, 2, &mut Interrupt::new(stop));
            assert_eq!(stopped, Err(Stopped));
        }
    }
}
