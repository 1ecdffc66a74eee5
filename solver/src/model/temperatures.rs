//! Changes of temperature, and the thermal strains that they cause.

use std::collections::HashMap;

use super::checks::{Checks, one_of};
use crate::elasticity::{BodyForce, COMPONENTS, Loads, Section, Thermal};
use crate::error::{AllChecks, Checked, Reason};
use crate::mesh::Mesh;
use crate::problem::{Elasticity, Load, Material};

/// The largest number of materials with different temperatures; a section numbers them by 16 bits.
const MOST: usize = 10_000;

/// A body's materials, divided where parts of them have other temperatures.
pub(super) struct Warmed {
    /// The section, in which elements of one number have one temperature.
    pub(super) section: Section,
    /// The material of the problem that each material of the section is.
    origin: Vec<usize>,
    thermal: Thermal,
}

impl Warmed {
    /// The other loads with the thermal strains; densities are those of the materials of this section.
    pub(super) fn added_to(self, loads: Loads) -> Loads {
        let densities = &loads.body_force.densities;
        let own = self.origin.iter();
        let densities = own.filter_map(|material| densities.get(*material));
        Loads {
            body_force: BodyForce {
                densities: densities.copied().collect(),
                ..loads.body_force
            },
            thermal: self.thermal,
            ..loads
        }
    }
}

impl Checks {
    /// Finds the thermal strains of a body; `None` if no load changes its temperature. A material of which groups have different temperatures becomes several: its
    /// stresses jump between them, and are not averaged.
    pub(super) fn temperatures(
        &mut self,
        mesh: &Mesh,
        section: &Section,
        materials: &[Material],
        loads: &[Load],
    ) -> Checked<Option<Warmed>> {
        let warms = |load: &Load| matches!(load, Load::Temperature(..) | Load::NodalTemperature(_));
        let Some(first) = loads.iter().position(warms) else {
            return Ok(None);
        };
        let mut all = AllChecks::default();
        let of_elements = all.check(self.temperatures_of_elements(mesh, loads));
        let factor = all.check(self.factor_at_nodes(mesh, loads));
        let expansions = all.check(self.expansions(materials, first));
        all.finish(())?;
        let (of_elements, factor, expansions) = (
            of_elements.unwrap_or_default(),
            factor.unwrap_or_default(),
            expansions.unwrap_or_default(),
        );
        let mut numbers: HashMap<(usize, u64), u16> = HashMap::new();
        let (mut origin, mut of_materials) = (Vec::new(), Vec::new());
        let mut material_of = Vec::with_capacity(of_elements.len());
        for (e, temperature) in of_elements.into_iter().enumerate() {
            let material = section.material_of(e);
            let number = *numbers
                .entry((material, temperature.to_bits()))
                .or_insert_with(|| {
                    origin.push(material);
                    of_materials.push(temperature);
                    origin.len().min(MOST) as u16 - 1
                });
            material_of.push(number);
        }
        if origin.len() > MOST {
            return Err(self.report(
                format!("/loads/{first}"),
                Reason::TooMany,
                format!(
                    "{} parts of the body with different temperatures",
                    origin.len()
                ),
                format!("at most {MOST}"),
                "Give temperatures that vary through the body at the nodes of the mesh.",
            ));
        }
        let moduli = origin.iter().map(|material| section.materials()[*material]);
        let moduli = moduli.collect();
        // a section in place of a faulty one has the material 0
        let expansion = origin
            .iter()
            .map(|material| expansions.get(*material).copied());
        let expansion = expansion.map(Option::unwrap_or_default);
        let at_nodes = mesh.temperatures.iter().map(|t| factor * t);
        Ok(Some(Warmed {
            section: Section::by_element(section.analysis(), moduli, material_of),
            thermal: Thermal {
                expansion: expansion.collect(),
                of_materials,
                at_nodes: at_nodes.filter(|_| factor != 0.0).collect(),
            },
            origin,
        }))
    }

    /// The change of temperature of each element, without that at the nodes.
    fn temperatures_of_elements(&mut self, mesh: &Mesh, loads: &[Load]) -> Checked<Vec<f64>> {
        let mut all = AllChecks::default();
        let mut found = vec![0.0; mesh.elements.len()];
        for (i, load) in loads.iter().enumerate() {
            let Load::Temperature(change, group) = load else {
                continue;
            };
            let Some(name) = group else {
                found.iter_mut().for_each(|t| *t += change);
                continue;
            };
            match mesh.groups.get(name) {
                Some(group) => group.iter().for_each(|e| found[*e as usize] += change),
                None => all.fail(self.report(
                    format!("/loads/{i}/group"),
                    Reason::UnknownGroup,
                    name,
                    one_of("a group", mesh.groups.keys()),
                    "Check the spelling, or name a group under /mesh/groups.",
                )),
            }
        }
        all.finish(found)
    }

    /// The factor of the temperatures that the mesh has at its nodes.
    fn factor_at_nodes(&mut self, mesh: &Mesh, loads: &[Load]) -> Checked<f64> {
        let mut sum = 0.0;
        for (i, load) in loads.iter().enumerate() {
            let Load::NodalTemperature(factor) = load else {
                continue;
            };
            sum += factor;
            if mesh.temperatures.is_empty() {
                return Err(self.report(
                    format!("/loads/{i}/nodal_temperature"),
                    Reason::NotUsed,
                    "a mesh without temperatures at its nodes",
                    "a mesh with them: `temperatures` of an inline mesh, or *TEMPERATURE of a deck",
                    "For one temperature of the body, or of a group of elements, give a `temperature`.",
                ));
            }
        }
        Ok(sum)
    }

    /// The strain of each material by one unit of temperature. `first`: the number of the first change of temperature.
    fn expansions(
        &mut self,
        materials: &[Material],
        first: usize,
    ) -> Checked<Vec<[f64; COMPONENTS]>> {
        let mut all = AllChecks::default();
        let mut found = Vec::new();
        for (i, material) in materials.iter().enumerate() {
            let (own, angle) = match &material.elasticity {
                Elasticity::Orthotropic(constants) => (constants.expansion, constants.angle),
                Elasticity::Isotropic { .. } => (None, 0.0),
            };
            match (material.expansion, own) {
                (Some(all_ways), None) => found.push([all_ways, all_ways, 0.0, all_ways]),
                (None, Some(along)) => found.push(turned(along, angle)),
                (None, None) => all.fail(self.report(
                    format!("/materials/{i}/expansion"),
                    Reason::Missing,
                    "nothing",
                    "the strain of the material by one unit of temperature",
                    format!("/loads/{first} changes the temperature of the body. For steel it is 1.2e-5 for each kelvin; a material that does not expand has 0."),
                )),
                (Some(_), Some(_)) => all.fail(self.report(
                    format!("/materials/{i}/expansion"),
                    Reason::NotUsed,
                    "an expansion beside that of `orthotropic`",
                    "one of them",
                    "Remove either.",
                )),
            }
        }
        all.finish(found)
    }
}

/// Strains along the axes of an orthotropic material, as components along x and y. `angle`: from x to axis 1 (degrees).
fn turned([first, second, third]: [f64; 3], angle: f64) -> [f64; COMPONENTS] {
    let (s, c) = angle.to_radians().sin_cos();
    [
        c * c * first + s * s * second,
        s * s * first + c * c * second,
        2.0 * c * s * (first - second),
        third,
    ]
}
