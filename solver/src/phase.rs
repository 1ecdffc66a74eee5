//! The phases of a solution, which `error` and `solution` both use.

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
    /// Loads on the nodes.
    Assemble,
    /// The order of elimination, and the structure of the factor.
    Order,
    /// Stiffnesses of the elements, and the factor.
    Factor,
    /// Load reduced to the contact boundary.
    Condense,
    /// Contact and friction.
    Iterate,
    /// Back-substitution, stresses, profiles.
    Recover,
    /// Solving once more on the mesh split in two, with `"accuracy": "verify"` only.
    Verify,
}

impl Phase {
    /// The name that the API has for it.
    pub fn as_str(self) -> &'static str {
        self.into()
    }
}
