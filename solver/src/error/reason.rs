//! The kinds of violation: one list of words that are stable for programs.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use strum::{IntoStaticStr, VariantArray};

/// A kind of violation.
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
pub enum Reason {
    // Values as they are written.
    /// A text or a value that cannot be read.
    Malformed,
    /// A value of the wrong type.
    WrongType,
    /// A name that is not known where it stands.
    UnknownName,
    /// A value that is none of the allowed forms or words.
    UnknownAlternative,
    /// A name that occurs twice in one object.
    DuplicateName,
    /// A required value that is absent.
    Missing,
    /// None or several values where exactly one is required.
    WrongCount,
    /// A list whose length is not the required one.
    WrongLength,
    /// Fewer items than required.
    TooFew,
    /// More items than allowed.
    TooMany,
    /// A text longer than allowed.
    TooLong,
    /// A problem that needs more memory than allowed.
    TooLarge,
    /// A number that is NaN or infinite.
    NotFinite,
    /// A number outside its range.
    OutOfRange,
    /// Numbers that do not increase.
    NotIncreasing,
    /// A value that has no effect where it stands, or excludes another value that is given.
    NotUsed,
    /// Two values that contradict each other.
    Conflict,

    // Names that refer to nothing, or that are taken.
    /// A boundary name that the mesh does not have.
    UnknownBoundary,
    /// An element group that the mesh does not have.
    UnknownGroup,
    /// A node set that the mesh does not have.
    UnknownNodeSet,
    /// A mesh that does not exist.
    UnknownMesh,
    /// A name that is in use already.
    NameTaken,

    // Files of meshes.
    /// A file that ends too early.
    Truncated,
    /// A kind of file, keyword or element that is not supported.
    Unsupported,
    /// A part of a deck's analysis that the solver does not support.
    NotUnderstood,

    // Meshes.
    /// A node number that the mesh does not have.
    UnknownNode,
    /// An element number that the mesh does not have.
    UnknownElement,
    /// A side that no element has.
    UnknownEdge,
    /// A node that occurs twice.
    RepeatedNode,
    /// An element that occurs twice.
    RepeatedElement,
    /// A side that occurs twice.
    RepeatedEdge,
    /// A point that occurs twice.
    RepeatedPoint,
    /// A node that belongs to no element.
    UnusedNode,
    /// A midside node other than the element's.
    WrongMidside,
    /// A side between two elements where a side of the surface is required.
    InnerEdge,
    /// Neighbours that do not share a whole side.
    Nonconforming,
    /// An element that is folded, or numbered clockwise.
    InvertedElement,
    /// Nodes that do not lie in one plane.
    NotPlane,
    /// An edge that does not span the whole grid.
    DoesNotSpan,

    // Parts of a body.
    /// A rule that matches no side.
    EmptyBoundary,
    /// A rule that matches no element.
    EmptyGroup,
    /// Something assigned twice where only one is allowed.
    Overlap,
    /// Edges that are not consecutive.
    NotAChain,
    /// A boundary with a corner, where the normal is not defined.
    TurnsCorner,
    /// A coordinate that takes the same value twice along the boundary.
    NotMonotonic,
    /// A node without contact area.
    NoArea,
    /// An obstacle that faces no edge of the boundary.
    CoversNothing,
    /// A node of two contacts.
    SharedNode,

    // Supports.
    /// A contact node supported along a direction that is neither normal nor tangent.
    ObliqueSupport,
    /// A support inside the obstacle.
    Impossible,
    /// A body that nothing holds.
    FreeBody,
}

impl Reason {
    /// The name of the reason in the API.
    pub fn as_str(self) -> &'static str {
        self.into()
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_and_display_write_a_reason_in_the_same_way() {
        for reason in Reason::VARIANTS {
            let json = serde_json::to_string(reason).unwrap();
            assert_eq!(json, format!("\"{reason}\""));
        }
    }
}
