//! What a client asks for: plain data, the JSON of the API word for word.
//!
//! Strict: unknown names are refused everywhere. Only `analysis`, `mesh` and `materials` are
//! required, and in `friction` its three numbers. What the fields *mean together* is checked in
//! [`Model::new`](crate::model::Model::new); nothing here computes.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::element::Element;

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

/// Where the elements come from: exactly one of `grid`, `inline`, `gmsh`, `abaqus`, `stored`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeshInput {
    /// A grid of lines, with the boundaries `left`, `right`, `bottom`, `top`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grid: Option<Grid>,
    /// Nodes and elements, written out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inline: Option<InlineMesh>,
    /// The text of a Gmsh mesh (MSH 2.2 or 4.1, ASCII): physical curves become boundaries, physical
    /// surfaces groups, physical points node sets.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gmsh: Option<String>,
    /// The text of an Abaqus or CalculiX deck: surfaces and, where their nodes span edges, node sets
    /// become boundaries, element sets groups, node sets node sets. What it says of the analysis is
    /// not used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub abaqus: Option<String>,
    /// The hash of a mesh that was uploaded to the service, `sha256:…`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stored: Option<String>,
    /// How often every element is split, or the tolerance that a grid is refined to.
    #[serde(default)]
    pub refine: Refine,
    /// Further names for parts of boundaries, e.g. `{"taper": {"side": "top", "x": [1, 3]}}`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub boundaries: BTreeMap<String, BoundaryPart>,
    /// Names for groups of elements, e.g. `{"inclusion": {"x": [1, 2], "y": [-1, 0]}}`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub groups: BTreeMap<String, ElementRange>,
}

/// Refinement of a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Refine {
    /// Every element is split in two in each direction, this many times.
    Times(u32),
    /// A grid is refined towards the ends of its contacts until the results settle.
    Adaptive(AdaptiveRefine),
}

impl Default for Refine {
    fn default() -> Self {
        Refine::Times(0)
    }
}

/// Goal of adaptive refinement.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AdaptiveRefine {
    /// Largest relative change, from one mesh to the next finer one, of the total forces and of
    /// the peak stresses that have a limit (0 < tolerance < 1).
    pub tolerance: f64,
}

/// The elements whose nodes all lie within a range of x and of y, ends included.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ElementRange {
    /// Range of x.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub x: Option<[f64; 2]>,
    /// Range of y.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub y: Option<[f64; 2]>,
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
    /// Quadrilaterals and triangles.
    pub elements: Vec<Element>,
    /// Named boundaries: element sides as `[corner, corner, midside]`.
    #[serde(default)]
    pub boundaries: BTreeMap<String, Vec<[u32; 3]>>,
    /// Named groups of elements, by their numbers from 0.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub groups: BTreeMap<String, Vec<u32>>,
    /// Named sets of nodes, by their numbers from 0.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub node_sets: BTreeMap<String, Vec<u32>>,
}

/// The sides of the body's surface that fit every condition given, ends included.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BoundaryPart {
    /// The boundary to take a part of; absent: the whole surface.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub side: Option<String>,
    /// All three nodes of a side lie within this range of x.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub x: Option<[f64; 2]>,
    /// All three nodes of a side lie within this range of y.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub y: Option<[f64; 2]>,
    /// All three nodes of a side lie within this box, `[[x, y], [x, y]]`: two opposite corners.
    #[serde(default, skip_serializing_if = "Option::is_none", rename = "box")]
    pub corners: Option<[[f64; 2]; 2]>,
    /// The outward normal of a side points this way `[x, y]` at all three nodes, to `angle`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub normal: Option<[f64; 2]>,
    /// Largest angle between a side's normal and `normal`; 1 when absent (degrees).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub angle: Option<f64>,
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
    /// The direction that gap and normal displacement are measured along.
    #[serde(default)]
    pub normal: NormalOf,
    /// What the obstacle does to the body.
    #[serde(default)]
    pub condition: Condition,
    /// Absent: frictionless.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub friction: Option<Friction>,
}

/// Whose normal a contact uses. On a sloping obstacle they differ, and forces with them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum NormalOf {
    /// The body's outward normal, as in the thesis.
    #[default]
    Body,
    /// The normal of the obstacle where it faces the node; the gap is measured to the tangent there.
    Obstacle,
}

/// What the obstacle does to the body.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Condition {
    /// u_n ≤ gap, and only pressure: thesis (1.14).
    #[default]
    Unilateral,
    /// u_n = gap and u_t = d on all of Γ_C; stresses of either sign.
    Bonded,
    /// No obstacle: friction with a prescribed bound only.
    None,
}

/// Declares the kinds of obstacle, each with the three fields that all of them have.
macro_rules! obstacles {
    ($($(#[$doc:meta])* $kind:ident { $($(#[$attribute:meta])* $field:ident: $type:ty,)* })*) => {
        /// Shape of a rigid obstacle: its distance from the boundary before it is pushed, as a
        /// function of a coordinate c along the boundary; or a curve in space.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
        #[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
        pub enum Obstacle {
            $($(#[$doc])* $kind {
                $($(#[$attribute])* $field: $type,)*
                /// Where the obstacle begins; absent: with the boundary.
                #[serde(default, skip_serializing_if = "Option::is_none")]
                from: Option<f64>,
                /// Where it ends; absent: with the boundary.
                #[serde(default, skip_serializing_if = "Option::is_none")]
                to: Option<f64>,
                /// What c is.
                #[serde(default)]
                along: Along,
            },)*
        }

        impl Obstacle {
            /// `from`, `to` and `along`, which every kind has.
            pub fn span(&self) -> (Option<f64>, Option<f64>, Along) {
                match *self {
                    $(Obstacle::$kind { from, to, along, .. } => (from, to, along),)*
                }
            }
        }
    };
}

obstacles! {
    /// Profile 0.
    Flat {}
    /// Profile R − √(R² − (c − center)²); there is no obstacle beyond R.
    Circle {
        /// R > 0 (length).
        radius: f64,
        /// Where the profile is zero.
        #[serde(default)]
        center: f64,
    }
    /// Profile (c − center)² / (2 radius).
    Parabola {
        /// Radius of curvature at the apex, > 0 (length).
        radius: f64,
        /// Where the profile is zero.
        #[serde(default)]
        center: f64,
    }
    /// Profile |c − center| tan(angle).
    Wedge {
        /// Between face and surface, 0 < angle < 90 (degrees).
        angle: f64,
        /// Where the profile is zero.
        #[serde(default)]
        center: f64,
    }
    /// Profile |c − center| tan(angle): a wedge of revolution.
    Cone {
        /// Between face and surface, 0 < angle < 90 (degrees).
        angle: f64,
        /// Where the profile is zero.
        #[serde(default)]
        center: f64,
    }
    /// Profile slope · (c − center).
    Tilted {
        /// Rise per length of c.
        slope: f64,
        /// Where the profile is zero.
        #[serde(default)]
        center: f64,
    }
    /// Profile coefficient · |c − center|^exponent.
    Power {
        /// > 0 (length^(1 − exponent)).
        coefficient: f64,
        /// ≥ 1.
        exponent: f64,
        /// Where the profile is zero.
        #[serde(default)]
        center: f64,
    }
    /// Profile 0 up to `half_width` from the center, then a circle that leaves it tangentially; there
    /// is no obstacle beyond half_width + radius.
    RoundedFlat {
        /// Half the width of the flat part, ≥ 0 (length).
        half_width: f64,
        /// Radius of the rounding, > 0 (length).
        radius: f64,
        /// Middle of the flat part.
        #[serde(default)]
        center: f64,
    }
    /// Profile by a table, linear between its points; there is no obstacle outside of it.
    Table {
        /// Coordinates c, strictly increasing.
        x: Vec<f64>,
        /// Profile there (length, any sign).
        gap: Vec<f64>,
    }
    /// A broken line in space; the profile is the distance along the body's normal.
    Polyline {
        /// Its points `[x, y]`.
        points: Vec<[f64; 2]>,
    }
    /// A straight line in space, without end; the profile is the distance along the body's normal.
    Line {
        /// A point `[x, y]` of it.
        point: [f64; 2],
        /// Angle from x to the line, counter-clockwise (degrees).
        angle: f64,
    }
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
/// σ_t = −τ φ_ε(|u_t − d|) sign(u_t − d), τ = min(shear_cap, cohesion + coefficient · S_ρ(p)) where
/// S_ρ(p) > 0; or with a prescribed `bound` τ.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Friction {
    /// μ ≥ 0 (the thesis's ν). Needed, but with a `bound`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub coefficient: Option<f64>,
    /// ρ ≥ 0 (length): the pressure is averaged over this distance. 0: Coulomb's local law. Needed,
    /// but with a `bound`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nonlocal_radius: Option<f64>,
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
    /// Where friction is evaluated.
    #[serde(default)]
    pub points: FrictionPoints,
    /// What the kernel is integrated over in axisymmetry.
    #[serde(default)]
    pub measure: Measure,
    /// Added to μ S wherever S > 0, ≥ 0 (stress).
    #[serde(default)]
    pub cohesion: f64,
    /// Largest τ, > 0 (stress); absent: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shear_cap: Option<f64>,
    /// A prescribed τ ≥ 0 (Tresca's law) instead of coefficient, radius, cohesion and cap. It acts on all
    /// of Γ_C, touched or not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bound: Option<PrescribedBound>,
}

/// A prescribed friction bound τ (stress).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum PrescribedBound {
    /// The same everywhere.
    Constant(f64),
    /// Linear between points of arc length; nothing outside of them.
    Table(BoundTable),
}

/// A friction bound by arc length.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BoundTable {
    /// Arc length from the first node of Γ_C, strictly increasing.
    pub s: Vec<f64>,
    /// τ there, ≥ 0 (stress).
    pub bound: Vec<f64>,
}

/// Where friction is evaluated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FrictionPoints {
    /// At three Gauss points per edge. On a coarse mesh and with a small elastic slip the
    /// tangential stress may oscillate inside stick.
    #[default]
    Gauss3,
    /// At the nodes; it does not oscillate.
    Nodal,
}

/// What the averaging kernel is integrated over in axisymmetry.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// Arc length along the meridian, as in the thesis.
    #[default]
    Line,
    /// The contact surface itself: rings of it.
    Surface,
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
    /// Friction depends on the displacement since the point last slipped: each point keeps an anchor,
    /// FORMULATION 1. For the linear transition only.
    Incremental,
}

/// One load step: factors on the values given elsewhere, reached in equal or growing increments
/// from those of the step before (from nothing at first).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Step {
    /// A name for people.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Factor on the indentation of every contact at the end of the step.
    #[serde(default = "one")]
    pub indentation: f64,
    /// Factor on the tangential displacement of every obstacle.
    #[serde(default)]
    pub tangential_displacement: f64,
    /// Factor on all loads.
    #[serde(default = "one")]
    pub loads: f64,
    /// Factor on all prescribed displacements.
    #[serde(default = "one")]
    pub supports: f64,
    /// Increments of the step (≥ 1).
    #[serde(default = "one_increment")]
    pub increments: u32,
    /// How the indentation grows from increment to increment.
    #[serde(default)]
    pub spacing: Spacing,
}

/// How the indentation grows inside a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Spacing {
    /// By equal amounts.
    #[default]
    Uniform,
    /// So that the contact grows by equal widths: δ_k = δ (k/n)^m for a profile of power m.
    ContactWidth,
}

impl Step {
    /// Everything as it is given, at once.
    pub fn whole() -> Self {
        Step {
            name: None,
            indentation: 1.0,
            tangential_displacement: 1.0,
            loads: 1.0,
            supports: 1.0,
            increments: 1,
            spacing: Spacing::Uniform,
        }
    }
}

fn one() -> f64 {
    1.0
}

fn one_increment() -> u32 {
    1
}

/// How to solve, and how far.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SolverControls {
    /// The strategy.
    #[serde(default)]
    pub algorithm: Algorithm,
    /// All residuals are dimensionless; each must fall below this (0 < tolerance < 1).
    #[serde(default = "default_tolerance")]
    pub tolerance: f64,
    /// Most outer sweeps over the friction bound, per increment (≥ 1).
    #[serde(default = "default_max_iterations")]
    pub max_iterations: u32,
    /// Solve once more from the bonded state, and say whether the two solutions agree.
    #[serde(default)]
    pub check_uniqueness: bool,
    /// Solve once more with twice the increments, and say how much the result changes.
    #[serde(default)]
    pub check_increments: bool,
    /// Choices that the thesis leaves to its user; for `algorithm: thesis` only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub thesis: Option<ThesisOptions>,
}

/// The strategy of solution, FORMULATION 4.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Algorithm {
    /// Sweeps; where they contract badly, accelerated; where that fails, Newton.
    #[default]
    Auto,
    /// Sweeps over the friction bound, each a convex problem, with Anderson acceleration.
    FixedPoint,
    /// One semi-smooth Newton iteration for everything, the averaging included.
    Newton,
    /// The thesis's own iteration (3.1), to the letter. At the thesis's parameters it does not
    /// solve the problem; the result says so.
    Thesis,
}

/// Choices of the thesis's own iteration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ThesisOptions {
    /// First guess of the contact Γ_C*: `[s0, s1]` of arc length by boundary; absent: all of Γ_C.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub contact_guess: BTreeMap<String, [f64; 2]>,
    /// Way of evaluating the friction force, thesis 3.2: 1 at the boundary's own Gauss points, 2 along
    /// the two nearest rows of internal Gauss points, carried to the boundary linearly.
    #[serde(default = "first_way")]
    pub friction_force: u32,
    /// Where the normal stress comes from.
    #[serde(default)]
    pub pressure: ThesisPressure,
    /// Local Gauss points that the kernel is integrated with in each element, thesis 3.4.2, no further
    /// than the next element; for extrapolated pressure only. 0: the mesh-free average of nodal values.
    #[serde(default)]
    pub local_points: u32,
    /// Part of the new friction force that is taken over (0 < relaxation ≤ 1).
    #[serde(default = "one")]
    pub relaxation: f64,
    /// Let friction oppose the motion, as (1.8) means it, instead of acting along t throughout.
    #[serde(default)]
    pub signed: bool,
}

impl Default for ThesisOptions {
    fn default() -> Self {
        ThesisOptions {
            contact_guess: BTreeMap::new(),
            friction_force: first_way(),
            pressure: ThesisPressure::default(),
            local_points: 0,
            relaxation: one(),
            signed: false,
        }
    }
}

/// Where the thesis's iteration takes the normal stress from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ThesisPressure {
    /// Nodal reactions / ∫h.
    #[default]
    Lumped,
    /// Stresses at internal Gauss points carried to the boundary, thesis 3.3.
    Extrapolated,
}

fn first_way() -> u32 {
    1
}

fn default_quadrature() -> u32 {
    3
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
            check_uniqueness: false,
            check_increments: false,
            thesis: None,
        }
    }
}
