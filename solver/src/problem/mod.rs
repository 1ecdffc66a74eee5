//! What a client asks for: plain data, the JSON of the API word for word.
//!
//! Strict: unknown names are refused everywhere. Only `analysis`, `mesh` and `materials` are
//! required, and in `friction` its three numbers. What the fields *mean together* is checked in
//! [`Model::new`](crate::model::Model::new); nothing here computes.

mod contact;
mod mesh;
mod solver;

pub use contact::{
    Along, BoundTable, Condition, Contact, Friction, FrictionPoints, History, Kernel, Measure,
    NormalOf, Normalization, Obstacle, PrescribedBound, Transition,
};
pub use mesh::{AdaptiveRefine, BoundaryPart, ElementRange, Grid, InlineMesh, MeshInput, Refine};
pub use solver::{Algorithm, SolverControls, Spacing, Step, ThesisOptions, ThesisPressure};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A contact problem in linear elasticity. Units are the client's own, used consistently.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Problem {
    /// A title for people; it does not enter `input_hash`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub title: Option<String>,
    /// What the units are called; for figures, and no number is converted.
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
    /// Load steps, one after the other. Empty: one step to the values as they are given.
    #[serde(default)]
    pub steps: Vec<Step>,
    /// Gauss points of an element in each direction, 3 or 2 (thesis 2.3).
    #[serde(default = "default_quadrature")]
    pub quadrature: u32,
    /// How to solve, and how far.
    #[serde(default)]
    pub solver: SolverControls,
}

/// Names of the client's units, as axes show them (each at most 20 characters): `{"length": "mm",
/// "force": "N", "stress": "MPa"}`. Absent: no unit is shown.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Units {
    /// Of coordinates, displacements, radii.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub length: Option<String>,
    /// Of total forces.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub force: Option<String>,
    /// Of moduli, pressures, stresses.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stress: Option<String>,
}

/// The two-dimensional theory of the body.
// The braces matter: an internally tagged *unit* variant would accept unknown fields.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Analysis {
    /// ε_z = 0; forces are per unit of thickness.
    PlaneStrain {},
    /// σ_z = 0 in a sheet.
    PlaneStress {
        /// Thickness of the sheet (length, > 0); forces include it.
        thickness: f64,
    },
    /// A body of revolution: x is the radius r ≥ 0, y is the axis z. Total forces include 2π.
    /// Nodes on the axis stay there (u_r = 0) without a support.
    Axisymmetric {},
}
/// Linear elasticity: isotropic (`youngs_modulus` and `poissons_ratio`) or `orthotropic`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// E > 0 (stress).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub youngs_modulus: Option<f64>,
    /// −1 < ν < 0.5. Not the friction coefficient, which the thesis calls ν.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub poissons_ratio: Option<f64>,
    /// Three axes of symmetry, two of them in the plane.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub orthotropic: Option<Orthotropic>,
    /// The group of elements that is made of it; absent: all that no other material names.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub group: Option<String>,
    /// A name for people.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
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
    /// −ε_2/ε_1 under σ_1 alone.
    pub nu12: f64,
    /// Shear modulus in the plane, > 0 (stress).
    pub g12: f64,
    /// Angle from x to axis 1, counter-clockwise (degrees).
    #[serde(default)]
    pub angle: f64,
    /// Modulus along axis 3, > 0 (stress); needed but in plane stress.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub e3: Option<f64>,
    /// −ε_3/ε_1 under σ_1 alone; needed but in plane stress.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nu13: Option<f64>,
    /// −ε_3/ε_2 under σ_2 alone; needed but in plane stress.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nu23: Option<f64>,
}

/// A value on a boundary: constant, or linear by arc length from the boundary's start to its end.
/// A boundary runs with the body on its right (a top edge runs along +x).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum BoundaryValue {
    /// The same everywhere.
    Constant(f64),
    /// `[start, end]`.
    Linear([f64; 2]),
}

/// Prescribed displacements on a boundary or a set of nodes, along x and y or (on a boundary) along
/// normal and tangent; what is not named stays free.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Support {
    /// Name of the boundary.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub boundary: Option<String>,
    /// Name of a set of nodes instead.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nodes: Option<String>,
    /// Displacement along x (length).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ux: Option<BoundaryValue>,
    /// Displacement along y (length).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub uy: Option<BoundaryValue>,
    /// Displacement along the outward normal (length).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub un: Option<BoundaryValue>,
    /// Displacement along t, the outward normal turned clockwise (length).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ut: Option<BoundaryValue>,
}

/// A load in one of its forms: on a boundary `pressure`, or `traction`, or `normal` and
/// `tangential`, or `nodal`; on a set of nodes `force`; on the whole body `body_force`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Load {
    /// Name of the boundary; none for a body force.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub boundary: Option<String>,
    /// Name of a set of nodes, for `force`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nodes: Option<String>,
    /// Stress against the outward normal: positive pushes into the body.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pressure: Option<BoundaryValue>,
    /// Stress along x and along y.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub traction: Option<[BoundaryValue; 2]>,
    /// Stress along the outward normal: positive pulls.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub normal: Option<BoundaryValue>,
    /// Stress along t, the outward normal turned clockwise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tangential: Option<BoundaryValue>,
    /// Forces `[fx, fy]` on the boundary's nodes (corner, midside, corner, …) from its start; in
    /// axisymmetry on the whole ring.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nodal: Option<Vec<[f64; 2]>>,
    /// Force `[fx, fy]` on each node of the set; in axisymmetry on the whole ring.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub force: Option<[f64; 2]>,
    /// Force per volume along x and y.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body_force: Option<[f64; 2]>,
}

/// Gauss points of an element in each direction, where a problem says nothing of them.
pub fn default_quadrature() -> u32 {
    3
}
