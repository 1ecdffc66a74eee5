//! The phases of a solution, in a module that `error` and `solution` both use.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use strum::{IntoStaticStr, VariantArray};

/// Phases of a solution, in their order; the caller times them.
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
    VariantArray,
)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum Phase {
    /// Reading the JSON (by the caller).
    Parse,
    /// Meshing and checking.
    Mesh,
    /// Computing the loads on the nodes.
    Assemble,
    /// Computing the order of elimination and the structure of the factor.
    Order,
    /// Computing element stiffnesses and the factor.
    Factor,
    /// Reducing the load to the contact boundary.
    Condense,
    /// Iterating contact and friction.
    Iterate,
    /// Back-substitution; computing stresses and profiles.
    Recover,
    /// Solving again to find errors: on the refined mesh with `"accuracy": "verify"`, for other profiles with a measured
    /// obstacle.
    Verify,
}

impl Phase {
    /// The name of the phase in the API.
    pub fn as_str(self) -> &'static str {
        self.into()
    }
}
