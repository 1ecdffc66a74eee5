//! Description of a stored mesh.

use std::collections::BTreeMap;

use files::MeshFormat;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use solver::{
    MeshSize,
    contact::edge_length,
    element::Family,
    mesh::{Edge, Mesh},
    solution::{Warning, WarningCode},
};

use crate::time::Time;

/// A stored mesh, without its nodes and elements.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MeshInfo {
    /// The hash `sha256:…` of the file; a problem refers to it as `mesh.stored`.
    pub hash: String,
    /// The format of the file.
    pub format: MeshFormat,
    /// The size of the file (bytes).
    pub bytes: u64,
    /// The number of nodes, including midsides.
    pub nodes: u64,
    /// The number of 8-node elements.
    pub quadrilaterals: u64,
    /// The number of 6-node elements.
    pub triangles: u64,
    /// The number of displacement unknowns, before supports.
    pub dofs: u64,
    /// The ranges of x and y (length).
    pub extent: [[f64; 2]; 2],
    /// The named boundaries.
    pub boundaries: BTreeMap<String, BoundaryInfo>,
    /// The number of elements of each named group.
    pub groups: BTreeMap<String, u64>,
    /// The number of nodes of each named set.
    pub node_sets: BTreeMap<String, u64>,
    /// The quality of the elements.
    pub quality: Quality,
    /// Warnings about changes that were made to the mesh when it was read.
    pub warnings: Vec<Warning>,
    /// The time when the mesh was stored.
    pub created_at: Time,
}

/// Writes the stored form of a mesh: the mesh, followed by the list of added midsides, the number of nodes that the node
/// sets lost, and the temperatures at the nodes.
pub fn write_stored<W: std::io::Write>(mesh: &Mesh, to: W) -> postcard::Result<W> {
    postcard::to_io(
        &(
            mesh,
            mesh.added_midsides,
            &mesh.nodes_left_out,
            &mesh.temperatures,
        ),
        to,
    )
}

/// Reads a mesh from its stored form; the forms of earlier versions end earlier: after the mesh, the midsides or the
/// nodes left out.
pub fn read_stored(bytes: &[u8]) -> postcard::Result<Mesh> {
    let (mut mesh, rest): (Mesh, &[u8]) = postcard::take_from_bytes(bytes)?;
    if !rest.is_empty() {
        let (added, rest): (_, &[u8]) = postcard::take_from_bytes(rest)?;
        mesh.added_midsides = added;
        if !rest.is_empty() {
            let (left_out, rest): (_, &[u8]) = postcard::take_from_bytes(rest)?;
            mesh.nodes_left_out = left_out;
            if !rest.is_empty() {
                mesh.temperatures = postcard::from_bytes(rest)?;
            }
        }
    }
    Ok(mesh)
}

/// A named boundary of a stored mesh.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct BoundaryInfo {
    /// The number of element sides.
    pub edges: u64,
    /// The length of the boundary, along curved sides.
    pub length: f64,
}

/// How close the elements are to being inverted.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Quality {
    /// Smallest ratio of the smallest to the largest det J within an element: 1 is best, 0 is inverted.
    pub least_jacobian_ratio: f64,
    /// The number of the element with this ratio, from 0.
    pub worst_element: u64,
}

impl MeshInfo {
    /// The description of a mesh that was just read.
    pub fn new(
        hash: String,
        bytes: u64,
        (format, mesh, warnings): (MeshFormat, &Mesh, Vec<Warning>),
    ) -> MeshInfo {
        let quads = mesh.elements.iter().filter(|e| e.family() == Family::Quad);
        let quadrilaterals = quads.count() as u64;
        let range = |axis: usize| {
            mesh.nodes
                .iter()
                .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
                    [low.min(x[axis]), high.max(x[axis])]
                })
        };
        let boundary = |(name, edges): (&String, &Vec<Edge>)| {
            let length = edges.iter().map(|edge| edge_length(mesh, edge)).sum();
            let edges = edges.len() as u64;
            (name.clone(), BoundaryInfo { edges, length })
        };
        let count = |(name, list): (&String, &Vec<u32>)| (name.clone(), list.len() as u64);
        let (least_jacobian_ratio, worst) = mesh.worst_element();
        MeshInfo {
            hash,
            format,
            bytes,
            nodes: mesh.nodes.len() as u64,
            quadrilaterals,
            triangles: mesh.elements.len() as u64 - quadrilaterals,
            dofs: 2 * mesh.nodes.len() as u64,
            extent: [range(0), range(1)],
            boundaries: mesh.boundaries.iter().map(boundary).collect(),
            groups: mesh.groups.iter().map(count).collect(),
            node_sets: mesh.node_sets.iter().map(count).collect(),
            quality: Quality {
                least_jacobian_ratio,
                worst_element: worst as u64,
            },
            warnings,
            created_at: Time::now(),
        }
    }

    /// Whether an earlier version has stored the mesh without the number of its added midsides, which are then in its
    /// node sets.
    pub fn lacks_added_midsides(&self, mesh: &Mesh) -> bool {
        let raised = |warning: &Warning| warning.code == WarningCode::RaisedToSecondOrder;
        mesh.added_midsides.is_none() && self.warnings.iter().any(raised)
    }

    /// The numbers by which memory and time are estimated.
    pub fn size(&self) -> MeshSize {
        let edges = |(name, info): (&String, &BoundaryInfo)| (name.clone(), info.edges);
        MeshSize {
            elements: self.quadrilaterals + self.triangles,
            boundaries: self.boundaries.iter().map(edges).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use solver::element::Element;

    #[test]
    fn stored_meshes_are_read_also_as_earlier_versions_wrote_them() {
        let mesh = Mesh {
            nodes: vec![[0.0, 1.0]; 9],
            node_sets: BTreeMap::from([("top".to_owned(), vec![2, 3])]),
            added_midsides: Some(4),
            nodes_left_out: BTreeMap::from([("top".to_owned(), 1)]),
            temperatures: vec![20.0; 9],
            ..Mesh::default()
        };
        let stored = write_stored(&mesh, Vec::new()).unwrap();
        assert_eq!(read_stored(&stored).unwrap(), mesh);
        let left_out = (&mesh, mesh.added_midsides, &mesh.nodes_left_out);
        let read = read_stored(&postcard::to_io(&left_out, Vec::new()).unwrap()).unwrap();
        assert_eq!((read.nodes_left_out.len(), read.temperatures.len()), (1, 0));
        let with_midsides = postcard::to_io(&(&mesh, mesh.added_midsides), Vec::new()).unwrap();
        let read = read_stored(&with_midsides).unwrap();
        assert_eq!(
            (read.added_midsides, read.nodes_left_out.len()),
            (Some(4), 0)
        );
        let earlier = postcard::to_io(&mesh, Vec::new()).unwrap();
        let read = read_stored(&earlier).unwrap();
        assert_eq!(read.added_midsides, None);
        assert_eq!((read.nodes, read.node_sets), (mesh.nodes, mesh.node_sets));
    }

    /// A square whose upper side bulges, a parabola over 2 with rise 1, has the length of the arc.
    #[test]
    fn a_curved_boundary_has_the_length_of_its_arc() {
        let nodes = vec![
            [0.0, 0.0],
            [2.0, 0.0],
            [2.0, 2.0],
            [0.0, 2.0],
            [1.0, 0.0],
            [2.0, 1.0],
            [1.0, 3.0],
            [0.0, 1.0],
        ];
        let mesh = Mesh {
            nodes,
            elements: vec![Element::Quad([0, 1, 2, 3, 4, 5, 6, 7])],
            boundaries: BTreeMap::from([("top".to_owned(), vec![[3, 2, 6]])]),
            ..Mesh::default()
        };
        let info = MeshInfo::new(String::new(), 0, (MeshFormat::Gmsh, &mesh, Vec::new()));
        // ∫ √(1 + 4x²) dx over -1 … 1 = √5 + asinh(2)/2; the rule has an error of 1e-4 on so strong a bend
        let exact = 5f64.sqrt() + 0.5 * 2f64.asinh();
        let length = info.boundaries["top"].length;
        assert!((length / exact - 1.0).abs() < 3e-3, "{length} for {exact}");
    }
}
