//! What a client asks for: plain data, the JSON of the API word for word.
//!
//! Strict: unknown names are refused everywhere. Only `analysis`, `mesh` and `materials` are
//! required, and in `friction` its three numbers. What the fields *mean together* is checked in
//! [`Model::new`](crate::model::Model::new); nothing here computes.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A contact problem in linear elasticity. Units are the client's own, used consistently.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Problem {
    /// A title for people; it does not enter `input_hash`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub title: Option<String>,
    /// The two-dimensional theory.
    pub analysis: Analysis,
    /// The body, cut into 8-node quadrilaterals.
    pub mesh: MeshInput,
    /// The material of the body.
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
    /// How to solve, and how far.
    #[serde(default)]
    pub solver: SolverControls,
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

/// Where the elements come from: exactly one of `grid` and `inline`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeshInput {
    /// A grid of lines, with the boundaries `left`, `right`, `bottom`, `top`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grid: Option<Grid>,
    /// Nodes and elements, written out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inline: Option<InlineMesh>,
    /// Every element is split in two in each direction, this many times.
    #[serde(default)]
    pub refine: u32,
    /// Further names for parts of boundaries, e.g. `{"taper": {"side": "top", "x": [1, 3]}}`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub boundaries: BTreeMap<String, BoundaryPart>,
}

/// Grid lines; with `top` or `bottom` a strip between two polylines.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Grid {
    /// Positions of the lines x = const, strictly increasing (length).
    pub x: Vec<f64>,
    /// Positions of the lines y = const, strictly increasing (length); for a strip the fractions
    /// of its height, from 0 to 1.
    pub y: Vec<f64>,
    /// Upper edge of a strip: points `[x, y]` with increasing x that span all of `x`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub top: Option<Vec<[f64; 2]>>,
    /// Lower edge of a strip; absent: y = 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bottom: Option<Vec<[f64; 2]>>,
}

/// A mesh written out in the problem.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InlineMesh {
    /// Node positions `[x, y]` (length).
    pub nodes: Vec<[f64; 2]>,
    /// Eight node numbers per element, from 0: four corners counter-clockwise, then the midsides
    /// of the sides 1–2, 2–3, 3–4, 4–1.
    pub elements: Vec<[u32; 8]>,
    /// Named boundaries: element sides as `[corner, corner, midside]`.
    #[serde(default)]
    pub boundaries: BTreeMap<String, Vec<[u32; 3]>>,
}

/// The sides of a named boundary that lie within a range of x and of y, ends included.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BoundaryPart {
    /// The boundary to take a part of.
    pub side: String,
    /// All three nodes of a side lie within this range of x.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub x: Option<[f64; 2]>,
    /// All three nodes of a side lie within this range of y.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub y: Option<[f64; 2]>,
}

/// Isotropic linear elasticity.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// E > 0 (stress).
    pub youngs_modulus: f64,
    /// −1 < ν < 0.5. Not the friction coefficient, which the thesis calls ν.
    pub poissons_ratio: f64,
    /// A name for people.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
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

/// Prescribed displacements on a boundary; what is not named stays free.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Support {
    /// Name of the boundary.
    pub boundary: String,
    /// Displacement along x (length).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ux: Option<BoundaryValue>,
    /// Displacement along y (length).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub uy: Option<BoundaryValue>,
}

/// A load on a boundary.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Load {
    /// Name of the boundary.
    pub boundary: String,
    /// Stress against the outward normal: positive pushes into the body.
    pub pressure: BoundaryValue,
}

/// A boundary that may touch a rigid obstacle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Contact {
    /// Name of the boundary.
    pub boundary: String,
    /// The obstacle that faces it.
    pub obstacle: Obstacle,
    /// How far the obstacle is pushed against the body (length, either sign):
    /// gap = profile − indentation.
    #[serde(default)]
    pub indentation: f64,
    /// Displacement of the obstacle along t, the outward normal turned clockwise (length).
    #[serde(default)]
    pub tangential_displacement: f64,
    /// Absent: frictionless.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub friction: Option<Friction>,
}

/// Shape of a rigid obstacle: its distance from the boundary before it is pushed, as a function
/// of a coordinate c along the boundary.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Obstacle {
    /// Profile 0.
    Flat {
        /// Where the obstacle begins; absent: with the boundary.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        from: Option<f64>,
        /// Where it ends; absent: with the boundary.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        to: Option<f64>,
        /// What c is.
        #[serde(default)]
        along: Along,
    },
    /// Profile R − √(R² − (c − center)²); there is no obstacle beyond R.
    Circle {
        /// R > 0 (length).
        radius: f64,
        /// Where the profile is zero.
        #[serde(default)]
        center: f64,
        /// Where the obstacle begins; absent: with the boundary.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        from: Option<f64>,
        /// Where it ends; absent: with the boundary.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        to: Option<f64>,
        /// What c is.
        #[serde(default)]
        along: Along,
    },
    /// Profile (c − center)² / (2 radius).
    Parabola {
        /// Radius of curvature at the apex, > 0 (length).
        radius: f64,
        /// Where the profile is zero.
        #[serde(default)]
        center: f64,
        /// Where the obstacle begins; absent: with the boundary.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        from: Option<f64>,
        /// Where it ends; absent: with the boundary.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        to: Option<f64>,
        /// What c is.
        #[serde(default)]
        along: Along,
    },
}

/// The coordinate c along a contact boundary.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Along {
    /// The position x.
    #[default]
    X,
    /// Arc length from the start of the named boundary, along t.
    ArcLength,
}

/// The nonlocal, nonlinear friction law of Oden and Pires, thesis (1.8):
/// σ_t = −μ S_ρ(p) φ_ε(|u_t − d|) sign(u_t − d).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Friction {
    /// μ ≥ 0 (the thesis's ν).
    pub coefficient: f64,
    /// ρ ≥ 0 (length): the pressure is averaged over this distance. 0: Coulomb's local law.
    pub nonlocal_radius: f64,
    /// ε > 0 (length): tangential displacement at which the friction bound is reached.
    pub elastic_slip: f64,
    /// Shape of the averaging kernel.
    #[serde(default)]
    pub kernel: Kernel,
    /// Scale of the averaging kernel.
    #[serde(default)]
    pub normalization: Normalization,
    /// φ_ε, from stick to slip.
    #[serde(default)]
    pub transition: Transition,
    /// What friction remembers.
    #[serde(default)]
    pub history: History,
}

/// Shape of the averaging kernel ω_ρ, thesis 1.2.1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Kernel {
    /// C exp(ρ²/(x² − ρ²)), thesis (1.2).
    #[default]
    Bump,
    /// C (1 − x²/ρ²).
    Parabola,
}

/// Scale of the averaging kernel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Normalization {
    /// ∫ω = 1 on a line: tends to Coulomb's law as ρ → 0.
    #[default]
    UnitIntegral,
    /// ω(0) = 1, the thesis's words taken literally; friction then vanishes with ρ.
    PeakOne,
}

/// φ_ε, thesis (1.7).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Transition {
    /// min(|u|/ε, 1), thesis (1.7b).
    #[default]
    Linear,
    /// tanh(|u|/ε), thesis (1.7a).
    Tanh,
}

/// What friction remembers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum History {
    /// Friction depends on the total displacement, as in the thesis.
    #[default]
    Total,
}

/// How to solve, and how far.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SolverControls {
    /// The strategy.
    #[serde(default)]
    pub algorithm: Algorithm,
    /// All residuals are dimensionless; each must fall below this (0 < tolerance < 1).
    #[serde(default = "default_tolerance")]
    pub tolerance: f64,
    /// Most outer sweeps over the friction bound (≥ 1).
    #[serde(default = "default_max_iterations")]
    pub max_iterations: u32,
}

/// The strategy of solution.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Algorithm {
    /// Frictionless first, then sweeps over the friction bound, each a convex problem.
    #[default]
    Auto,
}

fn default_tolerance() -> f64 {
    1e-10
}

fn default_max_iterations() -> u32 {
    200
}

impl Default for SolverControls {
    fn default() -> Self {
        Self {
            algorithm: Algorithm::Auto,
            tolerance: default_tolerance(),
            max_iterations: default_max_iterations(),
        }
    }
}
