//! The problem: plain data, exactly the JSON of the API.
//!
//! Strict: unknown names are refused everywhere, and so are objects without exactly one of their forms. Only
//! `analysis`, `mesh` and `materials` are required, and in `friction` only `elastic_slip` in all cases. Combinations of
//! fields are checked in [`Model::new`](crate::model::Model::new); nothing is computed here.

mod contact;
mod load;
mod material;
mod mesh;
mod solver;
mod support;

pub use contact::{
    Against, Along, BodyGap, BoundTable, Condition, Contact, Friction, FrictionPoints, History,
    Interpolation, Kernel, Measure, NormalOf, Normalization, Obstacle, ObstacleStiffness,
    PrescribedBound, SLIP_PART, Smoothing, Transition, elastic_slip_rule,
};
pub use load::{Load, LoadFields, Rotation};
pub use material::{Elasticity, Material, MaterialFields, Orthotropic};
pub use mesh::{
    AdaptiveRefine, BoundaryPart, Curve, CurveKind, ElementRange, Grid, InlineMesh, MeshInput,
    MeshSource, Refine,
};
pub use solver::{
    AccuracyMode, Algorithm, SolverControls, Spacing, Step, ThesisOptions, ThesisPressure,
};
pub use support::{BoundaryValue, SpringStiffness, Support};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A contact problem in linear elasticity. The client chooses consistent units.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Problem {
    /// A title for readers; it does not enter `input_hash`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub title: Option<String>,
    /// Names of the units, for figures; no number is converted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub units: Option<Units>,
    /// The two-dimensional theory.
    pub analysis: Analysis,
    /// The body, cut into 8-node quadrilaterals and 6-node triangles.
    pub mesh: MeshInput,
    /// The materials of the body: one, or one for each group of elements.
    pub materials: Vec<Material>,
    /// Prescribed displacements, Γ_D of thesis (1.12).
    #[serde(default)]
    pub supports: Vec<Support>,
    /// Prescribed tractions, Γ_F of thesis (1.13).
    #[serde(default)]
    pub loads: Vec<Load>,
    /// Boundaries that face a rigid obstacle, Γ_C of thesis (1.14). Empty: a plain elastic problem.
    #[serde(default)]
    pub contacts: Vec<Contact>,
    /// Load steps, one after another. Empty: one step to the given values.
    #[serde(default)]
    pub steps: Vec<Step>,
    /// Gauss points of an element in each direction, 3 or 2 (thesis 2.3); elements of nearly incompressible materials
    /// always have 3.
    #[serde(default = "default_quadrature")]
    pub quadrature: u32,
    /// Algorithm, tolerance and limits.
    #[serde(default)]
    pub solver: SolverControls,
}

/// Names of the client's units, as axes show them (each at most 20 characters): `{"length": "mm",
/// "force": "N", "stress": "MPa"}`. Absent: no unit is shown. Units change no number; a warning tells if common ones do
/// not belong together.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Units {
    /// Unit of coordinates, displacements and radii.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub length: Option<String>,
    /// Unit of total forces.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub force: Option<String>,
    /// Unit of moduli, pressures and stresses.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stress: Option<String>,
}

/// The two-dimensional theory of the body.
// The braces matter: an internally tagged *unit* variant would accept unknown fields.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Analysis {
    /// Plane strain, ε_z = 0; forces are per unit of thickness.
    PlaneStrain {},
    /// Plane stress, σ_z = 0 in a sheet.
    PlaneStress {
        /// Thickness of the sheet (length, > 0); forces include it.
        thickness: f64,
    },
    /// A body of revolution: x is the radius r ≥ 0, y is the axis z. Total forces include 2π.
    /// Nodes on the axis stay there (u_r = 0) without a support.
    Axisymmetric {},
}

/// The number of Gauss points of an element in each direction if a problem does not give one.
pub fn default_quadrature() -> u32 {
    3
}
