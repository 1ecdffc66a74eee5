//! The mesh of a body: where its elements come from, and names for parts of it.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::ser::SerializeStruct;
use serde::{Deserialize, Serialize, Serializer};

use crate::element::Element;
use crate::error::{Reason, Violation, either};

/// The body cut into elements: exactly one of `grid`, `grids`, `inline`, `gmsh`, `abaqus`, `stored`; and names for
/// parts of it.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(try_from = "MeshFields")]
#[schemars(with = "MeshFields", extend("oneOf" = [
    {"required": ["grid"]},
    {"required": ["grids"]},
    {"required": ["inline"]},
    {"required": ["gmsh"]},
    {"required": ["abaqus"]},
    {"required": ["stored"]},
]))]
pub struct MeshInput {
    /// The source of the elements.
    pub source: MeshSource,
    /// How often every element is split into four, or the tolerance for adaptive refinement.
    pub refine: Refine,
    /// Further names for parts of boundaries.
    pub boundaries: BTreeMap<String, BoundaryPart>,
    /// Names for groups of elements.
    pub groups: BTreeMap<String, ElementRange>,
    /// Curves that boundaries lie on.
    pub curves: BTreeMap<String, Curve>,
}

/// The source of the elements.
#[derive(Clone, Debug, PartialEq)]
pub enum MeshSource {
    /// A grid of lines.
    Grid(Grid),
    /// Several grids, each a body of its own, by name.
    Grids(BTreeMap<String, Grid>),
    /// Nodes and elements, written out.
    Inline(InlineMesh),
    /// The text of a Gmsh mesh.
    Gmsh(String),
    /// The text of an Abaqus or CalculiX deck.
    Abaqus(String),
    /// The hash of a mesh that was uploaded to the service, `sha256:…`.
    Stored(String),
}

impl MeshInput {
    /// A mesh from `source`, without refinement or further names.
    pub fn new(source: MeshSource) -> Self {
        MeshInput {
            source,
            refine: Refine::default(),
            boundaries: BTreeMap::new(),
            groups: BTreeMap::new(),
            curves: BTreeMap::new(),
        }
    }

    /// The grids that the mesh is made of; none if its source is another.
    pub fn grids(&self) -> Vec<&Grid> {
        match &self.source {
            MeshSource::Grid(grid) => vec![grid],
            MeshSource::Grids(grids) => grids.values().collect(),
            _ => Vec::new(),
        }
    }

    /// The grid, if the source of the mesh is a grid.
    pub fn grid(&self) -> Option<&Grid> {
        match &self.source {
            MeshSource::Grid(grid) => Some(grid),
            _ => None,
        }
    }

    /// The grid, to be changed, if the source of the mesh is a grid.
    pub fn grid_mut(&mut self) -> Option<&mut Grid> {
        match &mut self.source {
            MeshSource::Grid(grid) => Some(grid),
            _ => None,
        }
    }

    /// The hash of the stored mesh, if the source of the mesh is a stored mesh.
    pub fn stored(&self) -> Option<&str> {
        match &self.source {
            MeshSource::Stored(hash) => Some(hash),
            _ => None,
        }
    }
}

/// The fields of a mesh as it is written; [`MeshInput`] checks that it has exactly one source.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct MeshFields {
    /// A grid of lines, with the boundaries `left`, `right`, `bottom`, `top`.
    #[serde(default)]
    grid: Option<Grid>,
    /// Several grids by name, each a separate body that lies where its lines are: the boundaries of a grid `roller` are
    /// `roller.left`, `roller.right`, `roller.bottom`, `roller.top`, and its elements are the group `roller`.
    #[serde(default)]
    grids: Option<BTreeMap<String, Grid>>,
    /// Nodes and elements, written out.
    #[serde(default)]
    inline: Option<InlineMesh>,
    /// The text of a Gmsh mesh (MSH 2.2 or 4.1, ASCII): physical curves become boundaries, physical
    /// surfaces groups, physical points node sets.
    #[serde(default)]
    gmsh: Option<String>,
    /// The text of an Abaqus or CalculiX deck: surfaces become boundaries, element sets groups, and node sets node sets
    /// and, where their nodes span edges, also boundaries. The deck's analysis is not used.
    #[serde(default)]
    abaqus: Option<String>,
    /// The hash of a mesh that was uploaded to the service, `sha256:…`.
    #[serde(default)]
    stored: Option<String>,
    /// How often every element is split into four (which multiplies the unknowns by four each time), or the tolerance
    /// for adaptive refinement.
    #[serde(default)]
    refine: Refine,
    /// Further names for parts of boundaries, e.g. `{"taper": {"side": "top", "x": [1, 3]}}`.
    #[serde(default)]
    boundaries: BTreeMap<String, BoundaryPart>,
    /// Names for groups of elements, e.g. `{"inclusion": {"x": [1, 2], "y": [-1, 0]}}`.
    #[serde(default)]
    groups: BTreeMap<String, ElementRange>,
    /// Curves that boundaries lie on, by the boundaries' names, e.g. `{"arc": {"kind": "circle", "center": [0, 0],
    /// "radius": 4}}`: the boundaries' nodes are moved there, also those that refinement adds. Elements that only have
    /// corners have straight sides, so that without a curve their body has corners.
    #[serde(default)]
    curves: BTreeMap<String, Curve>,
}

impl TryFrom<MeshFields> for MeshInput {
    type Error = Violation;

    #[rustfmt::skip] // a source in a row
    fn try_from(fields: MeshFields) -> Result<MeshInput, Violation> {
        let MeshFields { grid, grids, inline, gmsh, abaqus, stored, refine, boundaries, groups, curves } = fields;
        let given = [
            ("grid", grid.is_some()),
            ("grids", grids.is_some()),
            ("inline", inline.is_some()),
            ("gmsh", gmsh.is_some()),
            ("abaqus", abaqus.is_some()),
            ("stored", stored.is_some()),
        ];
        let source = match (grid, grids, inline, gmsh, abaqus, stored) {
            (Some(grid), None,        None,         None,       None,       None)       => MeshSource::Grid(grid),
            (None,       Some(grids), None,         None,       None,       None)       => MeshSource::Grids(grids),
            (None,       None,        Some(inline), None,       None,       None)       => MeshSource::Inline(inline),
            (None,       None,        None,         Some(text), None,       None)       => MeshSource::Gmsh(text),
            (None,       None,        None,         None,       Some(text), None)       => MeshSource::Abaqus(text),
            (None,       None,        None,         None,       None,       Some(hash)) => MeshSource::Stored(hash),
            _ => return Err(Violation::new(
                "",
                Reason::WrongCount,
                either(&given),
                "exactly one of `grid`, `grids`, `inline`, `gmsh`, `abaqus`, `stored`",
                "Give the mesh in one form.",
            )),
        };
        Ok(MeshInput { source, refine, boundaries, groups, curves })
    }
}

/// Written by hand: a conversion to `MeshFields` would copy the mesh, which may be large.
impl Serialize for MeshInput {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let MeshInput {
            source,
            refine,
            boundaries,
            groups,
            curves,
        } = self;
        let named = [
            !boundaries.is_empty(),
            !groups.is_empty(),
            !curves.is_empty(),
        ];
        let count = 2 + named.into_iter().map(usize::from).sum::<usize>();
        let mut fields = serializer.serialize_struct("MeshInput", count)?;
        match source {
            MeshSource::Grid(grid) => fields.serialize_field("grid", grid)?,
            MeshSource::Grids(grids) => fields.serialize_field("grids", grids)?,
            MeshSource::Inline(inline) => fields.serialize_field("inline", inline)?,
            MeshSource::Gmsh(text) => fields.serialize_field("gmsh", text)?,
            MeshSource::Abaqus(text) => fields.serialize_field("abaqus", text)?,
            MeshSource::Stored(hash) => fields.serialize_field("stored", hash)?,
        }
        fields.serialize_field("refine", refine)?;
        if !boundaries.is_empty() {
            fields.serialize_field("boundaries", boundaries)?;
        }
        if !groups.is_empty() {
            fields.serialize_field("groups", groups)?;
        }
        if !curves.is_empty() {
            fields.serialize_field("curves", curves)?;
        }
        fields.end()
    }
}

/// Refinement of a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Refine {
    /// Every element is split in two in each direction, this many times.
    Times(u32),
    /// Elements are refined where errors come from, until all results are within a tolerance.
    Adaptive(AdaptiveRefine),
}

impl Default for Refine {
    fn default() -> Self {
        Refine::Times(0)
    }
}

/// The goal of adaptive refinement.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AdaptiveRefine {
    /// Largest relative error of the forces, the peak stresses that have a limit, and the ends of contact and stick, as
    /// in `summary.accuracy` (1e-4 < tolerance < 1): of a force or peak relative to its value, of a tangential force
    /// relative to the friction force, of an end relative to the length of the contact.
    pub tolerance: f64,
}

/// The elements whose nodes all lie within a range of x and of y, ends included, before the mesh is refined.
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

/// A curve that a boundary lies on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Curve {
    /// The kind of curve.
    pub kind: CurveKind,
    /// Center `[x, y]` of a circle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub center: Option<[f64; 2]>,
    /// Radius of a circle, > 0 (length).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius: Option<f64>,
}

/// Kinds of curves that boundaries lie on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CurveKind {
    /// A circle with `center` and `radius`. The corners of the boundary's elements must lie on it to 1e-4 of the
    /// radius; all nodes of the boundary are moved onto it.
    Circle,
    /// A smooth curve through the corners of the boundary's elements (a cubic spline), which stay where they are. The
    /// boundary must not turn by 45° or more at a node.
    Spline,
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
    /// The change of temperature at each node, for the load `nodal_temperature`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub temperatures: Vec<f64>,
}

/// The sides of the body's surface that meet every given condition, ends included, before the mesh is refined.
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
    /// The outward normal of a side has the direction `[x, y]` at all three nodes, within `angle`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub normal: Option<[f64; 2]>,
    /// Largest angle between a side's normal and `normal`; 1 when absent (degrees).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub angle: Option<f64>,
}
