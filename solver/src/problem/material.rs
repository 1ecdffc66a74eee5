//! Linear elastic materials, and the elements that are made of them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::{Reason, Violation};

/// A linear elastic material: isotropic (`youngs_modulus` and `poissons_ratio`) or `orthotropic`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "MaterialFields", into = "MaterialFields")]
#[schemars(extend(
    "if" = {"required": ["orthotropic"]},
    "then" = {"properties": {"youngs_modulus": false, "poissons_ratio": false}},
    "else" = {"required": ["youngs_modulus", "poissons_ratio"]},
))]
pub struct Material {
    /// The elastic constants.
    pub elasticity: Elasticity,
    /// The group of elements with this material; absent: all elements without another material.
    pub group: Option<String>,
    /// A name for readers.
    pub name: Option<String>,
    /// Mass per volume ≥ 0, in units that belong to those of force, length and time; required where a load is `gravity`
    /// or `rotation`.
    pub density: Option<f64>,
    /// Strain by one unit of temperature, the same in all directions; required where a load is a change of temperature,
    /// unless `orthotropic` has its own.
    pub expansion: Option<f64>,
}

/// Constants of linear elasticity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Elasticity {
    /// Elastic constants that are the same in all directions.
    Isotropic {
        /// Young's modulus E > 0 (stress).
        youngs_modulus: f64,
        /// Poisson's ratio, −1 < ν < 0.5; above 0.48 elements use a formulation that does not lock.
        poissons_ratio: f64,
    },
    /// Elastic constants with three axes of symmetry, two of them in the plane.
    Orthotropic(Orthotropic),
}

/// The fields of a material as it is written; [`Material`] checks which of them may be combined.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MaterialFields {
    /// Young's modulus E > 0 (stress).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub youngs_modulus: Option<f64>,
    /// Poisson's ratio, −1 < ν < 0.5; use 0.49999 for an incompressible material. Not the friction coefficient, which
    /// the thesis calls ν.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub poissons_ratio: Option<f64>,
    /// Elastic constants with three axes of symmetry, two of them in the plane.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub orthotropic: Option<Orthotropic>,
    /// The group of elements with this material; absent: all elements without another material.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub group: Option<String>,
    /// A name for readers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Mass per volume ≥ 0; required where a load is `gravity` or `rotation`. Its unit belongs to those of force, length
    /// and time: with N, mm and s it is t/mm³, and that of steel is 7.85e-9.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub density: Option<f64>,
    /// Strain by one unit of temperature, the same in all directions; required where a load is `temperature` or
    /// `nodal_temperature`, unless `orthotropic` has its own. That of steel is 1.2e-5 for each kelvin.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub expansion: Option<f64>,
}

impl TryFrom<MaterialFields> for Material {
    type Error = Violation;

    fn try_from(fields: MaterialFields) -> Result<Material, Violation> {
        let MaterialFields {
            youngs_modulus,
            poissons_ratio,
            orthotropic,
            group,
            name,
            density,
            expansion,
        } = fields;
        let elasticity = match (youngs_modulus, poissons_ratio, orthotropic) {
            (Some(youngs_modulus), Some(poissons_ratio), None) => Elasticity::Isotropic {
                youngs_modulus,
                poissons_ratio,
            },
            (None, None, Some(orthotropic)) => Elasticity::Orthotropic(orthotropic),
            (None, _, None) => return Err(missing("youngs_modulus")),
            (Some(_), None, None) => return Err(missing("poissons_ratio")),
            (Some(_), _, Some(_)) => return Err(not_used("youngs_modulus")),
            (None, Some(_), Some(_)) => return Err(not_used("poissons_ratio")),
        };
        Ok(Material {
            elasticity,
            group,
            name,
            density,
            expansion,
        })
    }
}

fn missing(name: &str) -> Violation {
    Violation::new(
        format!("/{name}"),
        Reason::Missing,
        "nothing",
        format!("a value for `{name}`"),
        "Or give `orthotropic`.",
    )
}

fn not_used(name: &str) -> Violation {
    Violation::new(
        format!("/{name}"),
        Reason::NotUsed,
        "an isotropic constant together with `orthotropic`",
        "either isotropic constants or `orthotropic`",
        "Remove the isotropic constant, or remove `orthotropic`.",
    )
}

impl From<Material> for MaterialFields {
    fn from(material: Material) -> MaterialFields {
        let Material {
            elasticity,
            group,
            name,
            density,
            expansion,
        } = material;
        let named = MaterialFields {
            group,
            name,
            density,
            expansion,
            ..MaterialFields::default()
        };
        match elasticity {
            Elasticity::Isotropic {
                youngs_modulus,
                poissons_ratio,
            } => MaterialFields {
                youngs_modulus: Some(youngs_modulus),
                poissons_ratio: Some(poissons_ratio),
                ..named
            },
            Elasticity::Orthotropic(orthotropic) => MaterialFields {
                orthotropic: Some(orthotropic),
                ..named
            },
        }
    }
}

/// Orthotropic elasticity with the axes 1 and 2 in the plane and 3 across it (the hoop direction in
/// axisymmetry). ε_1 = σ_1/e1 − nu12 σ_2/e1 − nu13 σ_3/e1, and so on; nu_ij/e_i = nu_ji/e_j.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Orthotropic {
    /// Modulus along axis 1, > 0 (stress).
    pub e1: f64,
    /// Modulus along axis 2, > 0 (stress).
    pub e2: f64,
    /// Poisson's ratio −ε_2/ε_1 under σ_1 alone.
    pub nu12: f64,
    /// Shear modulus in the plane, > 0 (stress).
    pub g12: f64,
    /// Angle from x to axis 1, counter-clockwise (degrees).
    #[serde(default)]
    pub angle: f64,
    /// Modulus along axis 3, > 0 (stress); required unless the analysis is plane stress.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub e3: Option<f64>,
    /// Poisson's ratio −ε_3/ε_1 under σ_1 alone; required unless the analysis is plane stress.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nu13: Option<f64>,
    /// Poisson's ratio −ε_3/ε_2 under σ_2 alone; required unless the analysis is plane stress.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nu23: Option<f64>,
    /// Strains along the axes 1, 2 and 3 by one unit of temperature.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub expansion: Option<[f64; 3]>,
}
