//! Checks springs between the body and the ground, and places them on the mesh.

use super::checks::Checks;
use super::freedom::Hold;
use crate::contact::{edge_normals, smooth};
use crate::elasticity::{Carriers, Section, Springs, Stiffness};
use crate::error::{AllChecks, Checked, Reason};
use crate::mesh::{Edge, Mesh};
use crate::problem::{SpringStiffness, Support};

/// The springs of a body, and the directions in which they hold its nodes.
#[derive(Default)]
pub(super) struct Held {
    pub(super) springs: Springs,
    pub(super) holds: Vec<Hold>,
}

impl Checks {
    /// Checks the stiffness of a support's springs.
    pub(super) fn stiffness(
        &mut self,
        support: &Support,
        stiffness: &SpringStiffness,
        pointer: &str,
    ) -> Checked {
        let SpringStiffness {
            normal,
            tangential,
            x,
            y,
        } = *stiffness;
        let mut all = AllChecks::default();
        let fields = [
            ("normal", normal),
            ("tangential", tangential),
            ("x", x),
            ("y", y),
        ];
        for (name, value) in fields {
            all.check(self.require(
                value >= 0.0,
                format!("{pointer}/{name}"),
                value,
                "a stiffness ≥ 0",
                "On a boundary stress per length, at a node force per length; leave out a direction without springs.",
            ));
        }
        if fields.iter().all(|(_, value)| *value == 0.0) {
            all.fail(self.report(
                pointer,
                Reason::TooFew,
                "no stiffness above 0",
                "at least one of `normal`, `tangential`, `x` and `y` > 0",
                "Give a stiffness, or remove the springs.",
            ));
        }
        if support.nodes.is_some() && (normal != 0.0 || tangential != 0.0) {
            all.fail(self.report(
                pointer,
                Reason::NotUsed,
                "`normal` or `tangential` on a set of nodes",
                "`x` and `y`",
                "A set of nodes has no normal; name a boundary.",
            ));
        }
        all.finish(())
    }
}

/// The springs of all supports whose places and numbers are valid.
pub(super) fn springs(mesh: &Mesh, section: &Section, supports: &[Support]) -> Held {
    let mut held = Held::default();
    let given = supports.iter().filter_map(|s| Some((s, s.stiffness?)));
    let given: Vec<(&Support, SpringStiffness)> = given.collect();
    if given.is_empty() {
        return held;
    }
    let carriers = Carriers::new(mesh);
    for (support, given) in given {
        let stiffness = Stiffness {
            normal: given.normal,
            tangential: given.tangential,
            along: [given.x, given.y],
        };
        let edges = support
            .boundary
            .as_ref()
            .and_then(|name| mesh.boundaries.get(name));
        for edge in edges.into_iter().flatten() {
            held.springs
                .add_side(mesh, section, &carriers, *edge, stiffness);
            held.hold_side(mesh, edge, &stiffness);
        }
        let nodes = support
            .nodes
            .as_ref()
            .and_then(|name| mesh.node_sets.get(name));
        for node in nodes.map(|set| mesh.given_nodes(set)).into_iter().flatten() {
            let along = stiffness.along.map(|k| k / section.circumference());
            held.springs.add_node(mesh, &carriers, node, along);
            held.hold(node, [1.0, 0.0], 0.0, along[0]);
            held.hold(node, [0.0, 1.0], 0.0, along[1]);
        }
    }
    held
}

impl Held {
    fn hold_side(&mut self, mesh: &Mesh, edge: &Edge, stiffness: &Stiffness) {
        let side = mesh.edge_nodes(edge);
        let error = smooth::direction_error(&side);
        for (node, [x, y]) in edge.iter().zip(edge_normals(&side)) {
            self.hold(*node, [x, y], error, stiffness.normal);
            self.hold(*node, [y, -x], error, stiffness.tangential);
            self.hold(*node, [1.0, 0.0], 0.0, stiffness.along[0]);
            self.hold(*node, [0.0, 1.0], 0.0, stiffness.along[1]);
        }
    }

    fn hold(&mut self, node: u32, direction: [f64; 2], error: f64, stiffness: f64) {
        if stiffness > 0.0 {
            self.holds.push(Hold {
                node,
                direction,
                error,
                facing: None,
            });
        }
    }
}
