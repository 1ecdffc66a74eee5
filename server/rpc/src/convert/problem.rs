//! Converts parts of a problem whose shape differs from the shape of their message: alternatives that JSON
//! distinguishes by their form or by which field is set, and lists of a fixed length.

use solver::{
    element::Element,
    error::Reason,
    problem::{
        BoundaryValue, Load, LoadFields, Material, MaterialFields, MeshInput, MeshSource,
        PrescribedBound, Refine,
    },
};

use super::{FromMessage, IntoMessage, Reader};
use crate::pb::{self, friction::Bound, mesh};

impl FromMessage<pb::Mesh> for MeshInput {
    fn from_message(message: pb::Mesh, read: &mut Reader) -> Option<Self> {
        let pb::Mesh {
            source,
            refinement,
            boundaries,
            groups,
            curves,
        } = message;
        let source = match source {
            Some(mesh::Source::Grid(grid)) => read.field("grid", grid).map(MeshSource::Grid),
            Some(mesh::Source::Grids(grids)) => {
                read.field("grids", grids.grids).map(MeshSource::Grids)
            }
            Some(mesh::Source::Inline(inline)) => {
                read.field("inline", inline).map(MeshSource::Inline)
            }
            Some(mesh::Source::Gmsh(text)) => Some(MeshSource::Gmsh(text)),
            Some(mesh::Source::Abaqus(text)) => Some(MeshSource::Abaqus(text)),
            Some(mesh::Source::Stored(hash)) => Some(MeshSource::Stored(hash)),
            None => read.missing("one of grid, grids, inline, gmsh, abaqus, stored"),
        };
        let refine = match refinement {
            Some(mesh::Refinement::Refine(times)) => Some(Refine::Times(times)),
            Some(mesh::Refinement::Adaptive(goal)) => {
                read.field("refine", goal).map(Refine::Adaptive)
            }
            None => Some(Refine::default()),
        };
        let boundaries = read.field("boundaries", boundaries);
        let groups = read.field("groups", groups);
        let curves = read.field("curves", curves);
        Some(MeshInput {
            source: source?,
            refine: refine?,
            boundaries: boundaries?,
            groups: groups?,
            curves: curves?,
        })
    }
}

impl From<MeshInput> for pb::Mesh {
    fn from(ours: MeshInput) -> Self {
        let MeshInput {
            source,
            refine,
            boundaries,
            groups,
            curves,
        } = ours;
        let source = match source {
            MeshSource::Grid(grid) => mesh::Source::Grid(grid.into()),
            MeshSource::Grids(grids) => mesh::Source::Grids(pb::Grids {
                grids: grids.into_message(),
            }),
            MeshSource::Inline(inline) => mesh::Source::Inline(inline.into()),
            MeshSource::Gmsh(text) => mesh::Source::Gmsh(text),
            MeshSource::Abaqus(text) => mesh::Source::Abaqus(text),
            MeshSource::Stored(hash) => mesh::Source::Stored(hash),
        };
        let refinement = match refine {
            Refine::Times(times) => mesh::Refinement::Refine(times),
            Refine::Adaptive(goal) => mesh::Refinement::Adaptive(goal.into()),
        };
        pb::Mesh {
            source: Some(source),
            refinement: Some(refinement),
            boundaries: boundaries.into_message(),
            groups: groups.into_message(),
            curves: curves.into_message(),
        }
    }
}

/// Implements the conversions of a type whose message has fields that exclude each other, by a struct with all of these
/// fields.
macro_rules! checked {
    ($($message:ty => $fields:ty => $ours:ty),*) => { $(
        impl FromMessage<$message> for $ours {
            fn from_message(message: $message, read: &mut Reader) -> Option<Self> {
                let fields = <$fields>::from_message(message, read)?;
                <$ours>::try_from(fields).map_or_else(|violation| read.violation(violation), Some)
            }
        }

        impl From<$ours> for $message {
            fn from(ours: $ours) -> Self {
                <$fields>::from(ours).into()
            }
        }
    )* };
}

checked!(pb::Material => MaterialFields => Material, pb::Load => LoadFields => Load);

/// Reads a boundary value: one number, or two.
impl FromMessage<pb::BoundaryValue> for BoundaryValue {
    fn from_message(message: pb::BoundaryValue, read: &mut Reader) -> Option<Self> {
        let pb::BoundaryValue { start, end } = message;
        match end {
            None => f64::from_message(start, read).map(BoundaryValue::Constant),
            Some(end) => {
                let (start, end) = (read.place(0, start), read.place(1, end));
                Some(BoundaryValue::Linear([start?, end?]))
            }
        }
    }
}

impl From<BoundaryValue> for pb::BoundaryValue {
    fn from(ours: BoundaryValue) -> Self {
        let (start, end) = match ours {
            BoundaryValue::Constant(start) => (start, None),
            BoundaryValue::Linear([start, end]) => (start, Some(end)),
        };
        pb::BoundaryValue { start, end }
    }
}

/// Reads a prescribed bound: a number, or a table.
impl FromMessage<Bound> for PrescribedBound {
    fn from_message(message: Bound, read: &mut Reader) -> Option<Self> {
        match message {
            Bound::ConstantBound(bound) => {
                f64::from_message(bound, read).map(PrescribedBound::Constant)
            }
            Bound::BoundTable(table) => {
                FromMessage::from_message(table, read).map(PrescribedBound::Table)
            }
        }
    }
}

impl IntoMessage<Bound> for PrescribedBound {
    fn into_message(self) -> Bound {
        match self {
            PrescribedBound::Constant(bound) => Bound::ConstantBound(bound),
            PrescribedBound::Table(table) => Bound::BoundTable(table.into()),
        }
    }
}

impl FromMessage<Vec<u32>> for Element {
    fn from_message(nodes: Vec<u32>, read: &mut Reader) -> Option<Self> {
        let found = nodes.len();
        let wrong = || read.wrong(Reason::WrongLength, numbers(found), "8 or 6 node numbers");
        Element::try_from(&nodes[..]).ok().or_else(wrong)
    }
}

impl IntoMessage<Vec<u32>> for Element {
    fn into_message(self) -> Vec<u32> {
        self.to_vec()
    }
}

impl<const N: usize> FromMessage<Vec<u32>> for [u32; N] {
    fn from_message(nodes: Vec<u32>, read: &mut Reader) -> Option<Self> {
        let found = nodes.len();
        let wrong = || read.wrong(Reason::WrongLength, numbers(found), &numbers(N));
        nodes.try_into().ok().or_else(wrong)
    }
}

impl<const N: usize> IntoMessage<Vec<u32>> for [u32; N] {
    fn into_message(self) -> Vec<u32> {
        self.to_vec()
    }
}

fn numbers(count: usize) -> String {
    format!("{count} node numbers")
}
