//! Prescribed displacements, and values along a boundary.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A value on a boundary: constant, or linear by arc length from the boundary's start to its end.
/// A boundary runs with the body on its right (a top edge runs along +x).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum BoundaryValue {
    /// The same value everywhere.
    Constant(f64),
    /// Linear from `[start, end]`.
    Linear([f64; 2]),
}

/// Prescribed displacements on a boundary or a set of nodes, along x and y or (on a boundary) along
/// normal and tangent, and springs; other displacements stay free.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Support {
    /// Name of the boundary.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub boundary: Option<String>,
    /// Name of a set of nodes, instead of a boundary; a side is held where all its nodes are held, before the mesh is
    /// refined.
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
    /// Springs between the body and the ground: an elastic foundation of a boundary, or springs at nodes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stiffness: Option<SpringStiffness>,
}

/// The stiffness of springs between the body and the ground: on a boundary per area (stress per length: the foundation
/// pulls with the stress −c u), at a node of a set per node (force per length; in axisymmetry of the whole circle). Each
/// is ≥ 0, and one is > 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SpringStiffness {
    /// Along the outward normal of a boundary; 0 on a set of nodes.
    #[serde(default)]
    pub normal: f64,
    /// Along a boundary; 0 on a set of nodes.
    #[serde(default)]
    pub tangential: f64,
    /// Along x.
    #[serde(default)]
    pub x: f64,
    /// Along y.
    #[serde(default)]
    pub y: f64,
}
