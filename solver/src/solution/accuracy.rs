//! How far the numbers of a solution can be trusted.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use strum::{EnumString, IntoStaticStr, VariantArray};

/// The accuracy of a solution: the error of each number due to the mesh and to too few increments, and a verdict.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Accuracy {
    /// The verdict on the whole solution.
    pub verdict: Verdict,
    /// Why the verdict is not `good`, in words, the most serious reason first; also remarks on a `good` result.
    pub reasons: Vec<String>,
    /// Every force, extent and peak with its error.
    pub quantities: Vec<EstimatedQuantity>,
    /// With `"accuracy": "verify"`: whether the problem was also solved on the refined mesh. If not, the errors are
    /// estimates, and the first reason says why. Absent unless requested.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub verified: Option<bool>,
}

/// Whether a solution can be relied on.
#[derive(
    Clone,
    Copy,
    Debug,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    Serialize,
    Deserialize,
    JsonSchema,
    IntoStaticStr,
    EnumString,
    VariantArray,
)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum Verdict {
    /// Every force is accurate to 1 %, every extent and every peak that has a limit to 5 %. Stated errors are below these
    /// limits, since one stated error in twenty is too small.
    Good,
    /// Forces are accurate to 5 %, extents and peaks to 20 %. Also the verdict where a contact has too many ends of
    /// stick to state their errors, or another number of ends on the refined mesh, or a warning says that the mesh is
    /// too coarse.
    Fair,
    /// A number is less accurate than in a `fair` solution, or its error is unknown for another reason than there, or a
    /// second solution was found.
    Poor,
}

impl EstimatedQuantity {
    /// The parts of the error that a finer mesh does not reduce.
    pub fn beside_mesh(&self) -> f64 {
        [self.increments, self.direction, self.measurement]
            .into_iter()
            .flatten()
            .sum()
    }

    /// The part of the error due to the mesh.
    pub fn of_mesh(&self) -> Option<f64> {
        Some(self.error? - self.beside_mesh())
    }
}

impl Verdict {
    /// The meaning of the verdict, for people.
    pub fn in_words(self) -> &'static str {
        match self {
            Verdict::Good => {
                "good: forces to 1 % (tangential force: of the friction force), extents to 5 % of the contact, peaks with a limit to 5 %, or better"
            }
            Verdict::Fair => {
                "fair: forces to 5 % (tangential force: of the friction force), extents to 20 % of the contact, peaks with a limit to 20 %"
            }
            Verdict::Poor => "POOR: some numbers are not reliable",
        }
    }
}

/// A number of the solution with its error.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct EstimatedQuantity {
    /// The kind of quantity.
    pub quantity: QuantityName,
    /// The contact, by the name of its boundary.
    pub contact: String,
    /// The value, as in the summary.
    pub value: f64,
    /// The value on the refined mesh; absent unless verified.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub finer: Option<f64>,
    /// The difference between `value` and `finer` (≥ 0); for a peak tangential stress, whose size may occur twice with
    /// both signs, the difference of the sizes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub difference: Option<f64>,
    /// The observed order of convergence: log₂ of the difference to the mesh one refinement coarser divided by
    /// `difference`. Absent where there is no such mesh (`refine` of 0 or by a tolerance), or a difference is only
    /// rounding.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub order: Option<f64>,
    /// The error in the unit of the value: due to the mesh, under the incremental law also to the number of increments,
    /// to a `direction` of the indentation, and to the noise of a measured obstacle. Absent where the quantity has no limit, or the error is unknown.
    pub error: Option<f64>,
    /// The part of `error` due to the number of increments; absent where the result does not depend on increments.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub increments: Option<f64>,
    /// The part of `error` due to an indentation along a `direction`, in which gaps are linear; absent where gaps are
    /// exact.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub direction: Option<f64>,
    /// The part of `error` due to the standard deviation of the points of a measured obstacle; absent without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub measurement: Option<f64>,
    /// The error relative to the value; for a tangential force relative to the friction force, for an extent relative
    /// to the length of the contact, for a tangential displacement or a tilt of an obstacle relative to at least its
    /// indentation, and that by length of the contact. Where nothing rubs, errors of friction are relative to what presses.
    pub relative: Option<f64>,
    /// How the error was found.
    pub method: ErrorMethod,
}

/// A force, a peak or an end of an extent.
#[derive(
    Clone,
    Copy,
    Debug,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    Serialize,
    Deserialize,
    JsonSchema,
    IntoStaticStr,
)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum QuantityName {
    /// The normal force ∫p.
    NormalForce,
    /// The tangential force ∫σ_t.
    TangentialForce,
    /// The friction force ∫|σ_t|.
    FrictionForce,
    /// The largest pressure, as a stress.
    PeakNormalStress,
    /// The largest |σ_t|, with its sign.
    PeakTangentialStress,
    /// The arc length at which an interval of contact begins.
    ContactStart,
    /// The arc length at which an interval of contact ends.
    ContactEnd,
    /// An arc length between stick and slip.
    StickEnd,
    /// The indentation of an obstacle under loads.
    Indentation,
    /// The tangential displacement of an obstacle under loads.
    TangentialDisplacement,
    /// The tilt of an obstacle under loads (radians).
    Tilt,
}

impl QuantityName {
    /// Whether the quantity is a motion of an obstacle.
    pub fn is_motion(self) -> bool {
        matches!(
            self,
            QuantityName::Indentation | QuantityName::TangentialDisplacement | QuantityName::Tilt
        )
    }

    /// Whether the quantity is an end of contact or stick: a place, not a force or a stress.
    pub fn is_extent(self) -> bool {
        matches!(
            self,
            QuantityName::ContactStart | QuantityName::ContactEnd | QuantityName::StickEnd
        )
    }
}

/// How an error was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema, IntoStaticStr)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum ErrorMethod {
    /// By the errors of the stresses (recovered against computed), weighted by their influence on the quantity.
    WeightedRecovery,
    /// By the distance between nodes.
    NodeSpacing,
    /// By the difference to the solution on the refined mesh, with every element split in two.
    MeshHalved,
    /// No error: the quantity has no limit as the mesh is refined.
    NoLimit,
    /// No error: there are too many ends of stick, or some within the length of an edge. Where stick and slip alternate from point to point, their places
    /// depend on the mesh.
    TooMany,
    /// The error is unknown; the reasons of the verdict say why.
    Unknown,
}
