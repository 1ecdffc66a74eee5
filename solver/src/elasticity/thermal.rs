//! Thermal strains: a body that is warmed expands, ε₀ = α T, and only the rest of its strain causes stress,
//! σ = D (ε − ε₀).
//!
//! Inside an element the temperature is interpolated by the shape functions. Where it is not linear, ε₀ varies faster than
//! the strain of the element can; at the superconvergent points, from which stresses are recovered, both agree.

use serde::Serialize;

use crate::elasticity::body_force::BodyForce;
use crate::elasticity::material::COMPONENTS;
use crate::element::{AtNodes, Element};

/// The changes of temperature in a body, and how much its materials expand.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Thermal {
    /// The strain of each material of the section by one unit of temperature: xx, yy, xy, zz. Empty if no temperature
    /// changes.
    pub expansion: Vec<[f64; COMPONENTS]>,
    /// The change of temperature of each material of the section, to which that at the nodes is added.
    pub of_materials: Vec<f64>,
    /// The change of temperature at each node of the mesh; empty if there is none.
    pub at_nodes: Vec<f64>,
}

impl Thermal {
    /// Whether there are no thermal strains.
    pub fn is_zero(&self) -> bool {
        self.expansion.is_empty()
    }

    /// The thermal strains of an element, multiplied by `factor`; `None` if there are none in the body.
    pub(super) fn of_element(
        &self,
        element: &Element,
        material: usize,
        factor: f64,
    ) -> Option<ThermalStrain> {
        let expansion = *self.expansion.get(material)?;
        let all = self.of_materials.get(material).copied().unwrap_or_default();
        let at = |node: u32| self.at_nodes.get(node as usize).copied();
        Some(ThermalStrain {
            expansion,
            temperature: element.gather(|node| factor * (all + at(node).unwrap_or_default())),
        })
    }
}

/// The thermal strains of one element.
#[derive(Clone, Copy, Debug)]
pub(super) struct ThermalStrain {
    /// The strain by one unit of temperature.
    expansion: [f64; COMPONENTS],
    /// The change of temperature at the nodes of the element.
    temperature: AtNodes<f64>,
}

impl ThermalStrain {
    /// The strain where the shape functions of the nodes have the values `shape`.
    pub(super) fn at(&self, shape: &AtNodes<f64>) -> [f64; COMPONENTS] {
        let nodes = shape.iter().zip(&self.temperature);
        let temperature: f64 = nodes.map(|(h, t)| h * t).sum();
        self.expansion.map(|strain| temperature * strain)
    }

    /// The elastic part of a strain, ε − ε₀.
    pub(super) fn elastic(
        &self,
        strain: &[f64; COMPONENTS],
        shape: &AtNodes<f64>,
    ) -> [f64; COMPONENTS] {
        let thermal = self.at(shape);
        std::array::from_fn(|c| strain[c] - thermal[c])
    }
}

/// What acts inside the elements of a body at a load level.
#[derive(Clone, Debug)]
pub struct Inner<'a> {
    /// The forces per volume.
    pub body_force: BodyForce,
    /// The thermal strains of the level 1.
    pub thermal: &'a Thermal,
    /// The factor of the thermal strains.
    pub factor: f64,
}

impl Inner<'_> {
    /// The thermal strains of an element.
    pub(super) fn thermal_strain(
        &self,
        element: &Element,
        material: usize,
    ) -> Option<ThermalStrain> {
        self.thermal.of_element(element, material, self.factor)
    }
}
