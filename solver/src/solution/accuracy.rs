//! How far the numbers of a solution can be trusted.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use strum::IntoStaticStr;

/// How far the numbers of a solution can be trusted: what the mesh, and too few increments, may have done to each, and a
/// verdict.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Accuracy {
    /// The verdict on the whole.
    pub verdict: Verdict,
    /// Why it is not `good`, in words, the most serious reason first; what is good besides.
    pub reasons: Vec<String>,
    /// Every force, extent and peak with its error.
    pub quantities: Vec<EstimatedQuantity>,
    /// With `"accuracy": "verify"`: whether the problem was solved on the mesh split in two as well. If not, the errors are
    /// estimates, and the first reason says why. Absent unless asked for.
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
)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum Verdict {
    /// Every force is known to 1 %, every peak that has a limit and every extent to 5 %. Stated errors are at most three
    /// quarters of that, since one in twenty is too small.
    Good,
    /// To 5 % and 20 %; also where a contact has too many ends of stick to follow, or another number of ends on the mesh
    /// split in two, or a warning says that the mesh is too coarse.
    Fair,
    /// Something else is known to less than that, or not at all, or a second solution was found.
    Poor,
}

impl EstimatedQuantity {
    /// The parts of the error that no mesh makes smaller.
    pub fn beside_mesh(&self) -> f64 {
        self.increments.unwrap_or(0.0) + self.direction.unwrap_or(0.0)
    }

    /// The part of the error that the mesh causes.
    pub fn of_mesh(&self) -> Option<f64> {
        Some(self.error? - self.beside_mesh())
    }
}

impl Verdict {
    /// What it says, for people.
    pub fn in_words(self) -> &'static str {
        match self {
            Verdict::Good => {
                "good: forces to 1 %, extents and peaks with a limit to 5 %, or better"
            }
            Verdict::Fair => "fair: forces to 5 %, extents and peaks with a limit to 20 %",
            Verdict::Poor => "POOR: some numbers are not to be relied on",
        }
    }
}

/// A number of the solution with its error.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct EstimatedQuantity {
    /// What it is.
    pub quantity: QuantityName,
    /// The contact, by the name of its boundary.
    pub contact: String,
    /// Its value, as in the summary.
    pub value: f64,
    /// Its value on the mesh split in two; absent unless verified.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub finer: Option<f64>,
    /// How much the two differ (≥ 0); of peak tangential stresses, the size of which may occur twice with both signs,
    /// how much their sizes do.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub difference: Option<f64>,
    /// Observed order of convergence, log₂ of the difference to the mesh one refinement coarser over this one; absent where
    /// there is no such mesh (`refine` of 0 or by a tolerance), or a difference is only rounding.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub order: Option<f64>,
    /// The error that the mesh causes, under the incremental law the number of increments, and a linear `direction`, in the unit of the value;
    /// absent where the quantity has no limit, or nothing is known.
    pub error: Option<f64>,
    /// The part of `error` that the increments cause; absent where nothing depends on them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub increments: Option<f64>,
    /// The part of `error` that an indentation along a `direction` causes, in which gaps are linear; absent where they are those of
    /// the displaced obstacle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub direction: Option<f64>,
    /// The error as a part: of the value; of the friction force for a tangential one; of the length of the contact for
    /// an extent.
    pub relative: Option<f64>,
    /// How it was found.
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
    /// ∫p.
    NormalForce,
    /// ∫σ_t.
    TangentialForce,
    /// ∫|σ_t|.
    FrictionForce,
    /// Largest pressure, as a stress.
    PeakNormalStress,
    /// Largest |σ_t|, with its sign.
    PeakTangentialStress,
    /// Arc length at which an interval of contact begins.
    ContactStart,
    /// Arc length at which it ends.
    ContactEnd,
    /// Arc length between stick and slip.
    StickEnd,
}

/// How an error was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema, IntoStaticStr)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum ErrorMethod {
    /// The errors of the stresses (recovered against computed), weighted by their influence on the quantity.
    WeightedRecovery,
    /// The distance between nodes.
    NodeSpacing,
    /// The difference to the solution on the mesh split in two.
    MeshHalved,
    /// There is no limit that a finer mesh would approach.
    NoLimit,
    /// More ends of stick than are followed: where stick and slip alternate from point to point, another mesh has them
    /// elsewhere.
    TooMany,
    /// The error is not known; the reasons of the verdict say why.
    Unknown,
}
