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
        match self.need("/mesh", source, "one of grid, inline") {
            Some(pb::mesh::Source::Grid(grid)) => mesh.grid = Some(self.grid(grid)),
            Some(pb::mesh::Source::Inline(inline)) => mesh.inline = Some(self.inline(inline)),
            None => return None,
        }
        for (name, pb::BoundaryPart { side, x, y }) in boundaries {
            let at = format!("/mesh/boundaries/{}", escape(&name));
            let x = x.map(|range| self.range(&format!("{at}/x"), range));
            let y = y.map(|range| self.range(&format!("{at}/y"), range));
            mesh.boundaries.insert(name, BoundaryPart { side, x, y });
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
        }
    }
}
