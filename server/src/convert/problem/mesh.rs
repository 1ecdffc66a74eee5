//! Meshes.

use solver::{
    element::Element,
    error::escape,
    problem::{AdaptiveRefine, BoundaryPart, ElementRange, Grid, InlineMesh, MeshInput, Refine},
};

use super::Reader;
use crate::pb;

impl Reader {
    pub(super) fn mesh(&mut self, message: pb::Mesh) -> Option<MeshInput> {
        let pb::Mesh {
            source,
            refinement,
            boundaries,
            groups,
        } = message;
        let mut mesh = MeshInput {
            refine: match refinement {
                None => Refine::default(),
                Some(pb::mesh::Refinement::Refine(times)) => Refine::Times(times),
                Some(pb::mesh::Refinement::Adaptive(goal)) => Refine::Adaptive(AdaptiveRefine {
                    tolerance: self.number("/mesh/refine/tolerance", goal.tolerance),
                }),
            },
            ..MeshInput::default()
        };
        use pb::mesh::Source;
        match self.need("/mesh", source, "one of grid, inline, gmsh, abaqus, stored") {
            Some(Source::Grid(grid)) => mesh.grid = Some(self.grid(grid)),
            Some(Source::Inline(inline)) => mesh.inline = Some(self.inline(inline)),
            Some(Source::Gmsh(text)) => mesh.gmsh = Some(text),
            Some(Source::Abaqus(text)) => mesh.abaqus = Some(text),
            Some(Source::Stored(hash)) => mesh.stored = Some(hash),
            None => return None,
        }
        for (name, part) in boundaries {
            let part = self.part(&format!("/mesh/boundaries/{}", escape(&name)), part);
            mesh.boundaries.insert(name, part);
        }
        for (name, pb::ElementRange { x, y }) in groups {
            let at = format!("/mesh/groups/{}", escape(&name));
            let x = x.map(|range| self.range(&format!("{at}/x"), range));
            let y = y.map(|range| self.range(&format!("{at}/y"), range));
            mesh.groups.insert(name, ElementRange { x, y });
        }
        Some(mesh)
    }

    pub(super) fn range(&mut self, at: &str, pb::Range { start, end }: pb::Range) -> [f64; 2] {
        let start = self.number(&format!("{at}/0"), start);
        [start, self.number(&format!("{at}/1"), end)]
    }

    fn grid(&mut self, pb::Grid { x, y, top, bottom }: pb::Grid) -> Grid {
        let mut edge = |at: &str, points: Vec<pb::Point>| {
            (!points.is_empty()).then(|| self.points(at, points))
        };
        let (top, bottom) = (
            edge("/mesh/grid/top", top),
            edge("/mesh/grid/bottom", bottom),
        );
        Grid {
            x: self.numbers("/mesh/grid/x", x),
            y: self.numbers("/mesh/grid/y", y),
            top,
            bottom,
        }
    }

    fn part(&mut self, at: &str, message: pb::BoundaryPart) -> BoundaryPart {
        let pb::BoundaryPart {
            side,
            x,
            y,
            r#box,
            normal,
            angle,
        } = message;
        let corners = r#box.and_then(|pb::Box { from, to }| {
            let from = self.need(&format!("{at}/box/0"), from, "a corner")?;
            let to = self.need(&format!("{at}/box/1"), to, "a corner")?;
            let corners = self.points(&format!("{at}/box"), vec![from, to]);
            corners.try_into().ok()
        });
        BoundaryPart {
            side: Some(side).filter(|side| !side.is_empty()),
            x: x.map(|range| self.range(&format!("{at}/x"), range)),
            y: y.map(|range| self.range(&format!("{at}/y"), range)),
            corners,
            normal: normal.map(|normal| self.vector(&format!("{at}/normal"), normal)),
            angle: self.some_number(&format!("{at}/angle"), angle),
        }
    }

    fn element(&mut self, at: &str, nodes: Vec<u32>) -> Element {
        let found = nodes.len();
        Element::try_from(nodes).unwrap_or_else(|_| {
            self.wrong(
                at,
                "wrong_length",
                format!("{found} node numbers"),
                "8 or 6 node numbers",
            );
            Element::Triangle([0; 6])
        })
    }

    fn inline(
        &mut self,
        pb::InlineMesh {
            nodes,
            elements,
            boundaries,
            groups,
            node_sets,
        }: pb::InlineMesh,
    ) -> InlineMesh {
        let nodes = self.points("/mesh/inline/nodes", nodes);
        let elements = elements
            .into_iter()
            .enumerate()
            .map(|(i, element)| self.element(&format!("/mesh/inline/elements/{i}"), element.nodes))
            .collect();
        let boundaries = boundaries
            .into_iter()
            .map(|(name, list)| {
                let at = format!("/mesh/inline/boundaries/{}", escape(&name));
                let edges = list.edges.into_iter().enumerate();
                let edges = edges
                    .map(|(i, edge)| self.indices(&format!("{at}/{i}"), edge.nodes))
                    .collect();
                (name, edges)
            })
            .collect();
        InlineMesh {
            nodes,
            elements,
            boundaries,
            groups: groups
                .into_iter()
                .map(|(name, list)| (name, list.elements))
                .collect(),
            node_sets: node_sets
                .into_iter()
                .map(|(name, list)| (name, list.nodes))
                .collect(),
        }
    }
}
