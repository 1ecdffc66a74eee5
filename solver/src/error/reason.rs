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
    // What is written, whatever it means.
    /// A text or a value that cannot be read as what it should be.
    Malformed,
    /// A value of another type.
    WrongType,
    /// A name that means nothing here.
    UnknownName,
    /// None of the forms or words that may stand here.
    UnknownAlternative,
    /// A name that stands twice in one object.
    DuplicateName,
    /// Something that must be given is not.
    Missing,
    /// None, or several, of what exactly one is to be given.
    WrongCount,
    /// A list of another length than is needed.
    WrongLength,
    /// Fewer than are needed.
    TooFew,
    /// More than are taken.
    TooMany,
    /// A text longer than is taken.
    TooLong,
    /// Larger than can be afforded.
    TooLarge,
    /// NaN or infinity.
    NotFinite,
    /// A number out of its range.
    OutOfRange,
    /// Numbers that should grow from one to the next.
    NotIncreasing,
    /// Given where it has no effect, or beside what excludes it.
    NotUsed,
    /// Two values that cannot both hold.
    Conflict,

    // Names that refer to nothing, or to too much.
    /// No boundary of that name.
    UnknownBoundary,
    /// No group of elements of that name.
    UnknownGroup,
    /// No set of nodes of that name.
    UnknownNodeSet,
    /// No such mesh.
    UnknownMesh,
    /// A name that something else has already.
    NameTaken,

    // Files of meshes.
    /// A file that ends too early.
    Truncated,
    /// A kind of file, keyword or element that is not read.
    Unsupported,
    /// What a deck says of its analysis and has no meaning here.
    NotUnderstood,

    // Meshes.
    /// No node of that number.
    UnknownNode,
    /// No element of that number.
    UnknownElement,
    /// No side of an element.
    UnknownEdge,
    /// A node that is there already.
    RepeatedNode,
    /// An element that is there already.
    RepeatedElement,
    /// A side that is there already.
    RepeatedEdge,
    /// A point that is there already.
    RepeatedPoint,
    /// A node of no element.
    UnusedNode,
    /// Another node than the one in the middle of the side.
    WrongMidside,
    /// A side between two elements, where one of the surface is meant.
    InnerEdge,
    /// Neighbours that do not share a whole side.
    Nonconforming,
    /// An element that is folded, or numbered clockwise.
    InvertedElement,
    /// Nodes that do not lie in one plane.
    NotPlane,
    /// An edge that does not reach over all of the grid.
    DoesNotSpan,

    // Parts of a body.
    /// A rule that no side fits.
    EmptyBoundary,
    /// A rule that no element fits.
    EmptyGroup,
    /// Something that belongs to two where it may belong to one.
    Overlap,
    /// Edges that do not follow one another.
    NotAChain,
    /// A boundary with a corner, where there is no normal.
    TurnsCorner,
    /// A coordinate that takes the same value twice along the boundary.
    NotMonotonic,
    /// A node without contact area.
    NoArea,
    /// An obstacle that faces no edge of the boundary.
    CoversNothing,
    /// A node of two contacts.
    SharedNode,

    // What holds the body.
    /// A contact node supported along a direction that is neither normal nor tangent.
    ObliqueSupport,
    /// A support inside the obstacle.
    Impossible,
    /// A body that nothing holds.
    FreeBody,
}

impl Reason {
    /// The word.
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
    fn a_reason_is_written_as_its_one_word() {
        for reason in Reason::VARIANTS {
            let json = serde_json::to_string(reason).unwrap();
            assert_eq!(json, format!("\"{reason}\""));
        }
    }
}
