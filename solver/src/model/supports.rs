//! Supports, loads, and whether the supports hold the body.

use std::collections::BTreeMap;

use super::findings::{ALIGNED, AXIS, Findings};
use crate::elasticity::Section;
use crate::mesh::{Edge, Mesh};
use crate::problem::{BoundaryValue, Load, Support};

impl Findings {
    /// Prescribed displacements by node. A body of revolution cannot leave its axis: there u_r = 0
    /// whether a support says so or not.
    pub(super) fn supports(
        &mut self,
        mesh: &Mesh,
        section: &Section,
        supports: &[Support],
    ) -> BTreeMap<u32, [Option<f64>; 2]> {
        let mut fixed: BTreeMap<u32, [Option<f64>; 2]> = BTreeMap::new();
        if section.axisymmetric() {
            let radius = mesh.nodes.iter().map(|[r, _]| *r).fold(0.0, f64::max);
            let on_axis = |n: &u32| mesh.nodes[*n as usize][0] <= AXIS * radius;
            for node in (0..mesh.nodes.len() as u32).filter(on_axis) {
                fixed.insert(node, [Some(0.0), None]);
            }
        }
        let size = supports
            .iter()
            .flat_map(|s| [s.ux, s.uy])
            .flatten()
            .map(largest)
            .fold(0.0, f64::max);
        for (i, support) in supports.iter().enumerate() {
            let pointer = format!("/supports/{i}");
            if support.ux.is_none() && support.uy.is_none() {
                self.say(
                    &pointer,
                    "empty",
                    "neither `ux` nor `uy`",
                    "at least one of them",
                    "Prescribe a displacement or remove the support.",
                );
            }
            let Some(edges) = self.boundary(mesh, &support.boundary, format!("{pointer}/boundary"))
            else {
                continue;
            };
            for (axis, (field, value)) in [("ux", support.ux), ("uy", support.uy)]
                .into_iter()
                .enumerate()
            {
                let Some(value) = value else { continue };
                let place = format!("{pointer}/{field}");
                let mut conflict = None;
                for (edge, values) in self.along(mesh, edges, value, place.clone()) {
                    for (node, value) in edge.into_iter().zip(values) {
                        let known = fixed.entry(node).or_default()[axis].get_or_insert(value);
                        if (*known - value).abs() > ALIGNED * size {
                            conflict = Some((node, *known, value));
                        }
                    }
                }
                if let Some((node, known, value)) = conflict {
                    let [x, y] = mesh.nodes[node as usize];
                    self.say(
                        place,
                        "conflict",
                        value,
                        format!(
                            "{known}, which another support (or the axis) prescribes at node {node} ({x}, {y})"
                        ),
                        "Two supports that share a node must agree there.",
                    );
                }
            }
        }
        fixed
    }

    pub(super) fn loads(&mut self, mesh: &Mesh, loads: &[Load]) -> Vec<(Edge, [f64; 3])> {
        let mut pressures = Vec::new();
        for (i, load) in loads.iter().enumerate() {
            if let Some(edges) = self.boundary(mesh, &load.boundary, format!("/loads/{i}/boundary"))
            {
                pressures.extend(self.along(
                    mesh,
                    edges,
                    load.pressure,
                    format!("/loads/{i}/pressure"),
                ));
            }
        }
        pressures
    }

    /// Every part of the body must be held against its rigid motions by supports.
    pub(super) fn freedom(
        &mut self,
        mesh: &Mesh,
        section: &Section,
        fixed: &BTreeMap<u32, [Option<f64>; 2]>,
    ) {
        for part in mesh.connected_parts() {
            if let Some((direction, node)) = free_motion(mesh, section, fixed, &part) {
                let [x, y] = mesh.nodes[node as usize];
                self.say(
                    "/supports",
                    "free_body",
                    format!("a body free to move: {direction}, e.g. node {node} at ({x}, {y})"),
                    "supports against every rigid motion (contact does not count: it may open)",
                    "Add a support with `ux` or `uy`. Parts that touch in a corner only do not hold each other.",
                );
            }
        }
    }
}

fn largest(value: BoundaryValue) -> f64 {
    match value {
        BoundaryValue::Constant(value) => value.abs(),
        BoundaryValue::Linear([start, end]) => start.abs().max(end.abs()),
    }
}

/// Displacement of a node.
type Motion<'a> = Box<dyn Fn(u32) -> [f64; 2] + 'a>;

/// A rigid motion of the nodes `part` that no support hinders, and the node that it moves most.
fn free_motion(
    mesh: &Mesh,
    section: &Section,
    fixed: &BTreeMap<u32, [Option<f64>; 2]>,
    part: &[u32],
) -> Option<(&'static str, u32)> {
    // Rotation is taken about the part's centre and scaled by its size, so that all motions compare.
    let mean =
        |a: usize| part.iter().map(|&n| mesh.nodes[n as usize][a]).sum::<f64>() / part.len() as f64;
    let centre = [mean(0), mean(1)];
    let arm = |n: u32| {
        let [x, y] = mesh.nodes[n as usize];
        [x - centre[0], y - centre[1]]
    };
    let size = part
        .iter()
        .map(|&n| {
            let [x, y] = arm(n);
            x.hypot(y)
        })
        .fold(0.0, f64::max);
    let motions: Vec<(&'static str, Motion<'_>)> = if section.axisymmetric() {
        vec![("along the axis", Box::new(|_| [0.0, 1.0]))]
    } else {
        vec![
            ("along x", Box::new(|_| [1.0, 0.0])),
            ("along y", Box::new(|_| [0.0, 1.0])),
            (
                "in rotation",
                Box::new(|n| {
                    let [x, y] = arm(n);
                    [-y / size, x / size]
                }),
            ),
        ]
    };
    // Gram–Schmidt on the motions as seen by the supports: what has nothing left is free.
    let mut seen: Vec<(Vec<f64>, &'static str)> = Vec::new();
    for (name, motion) in &motions {
        let mut values: Vec<f64> = Vec::new();
        for &node in part {
            let Some(fixed) = fixed.get(&node) else {
                continue;
            };
            let u = motion(node);
            values.extend((0..2).filter(|&a| fixed[a].is_some()).map(|a| u[a]));
        }
        for (other, _) in &seen {
            let dot: f64 = values.iter().zip(other).map(|(a, b)| a * b).sum();
            values
                .iter_mut()
                .zip(other)
                .for_each(|(a, b)| *a -= dot * b);
        }
        let norm = values.iter().map(|v| v * v).sum::<f64>().sqrt();
        if norm < ALIGNED {
            let moved = |n: &u32| {
                let [x, y] = motion(*n);
                x.hypot(y)
            };
            let node = part
                .iter()
                .copied()
                .max_by(|a, b| moved(a).total_cmp(&moved(b)))?;
            return Some((name, node));
        }
        values.iter_mut().for_each(|v| *v /= norm);
        seen.push((values, name));
    }
    None
}
