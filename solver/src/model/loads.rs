//! Loads: each in exactly one of its forms.

use super::findings::Findings;
use crate::elasticity::{EdgeLoad, LoadAxes, Loads, Section};
use crate::mesh::{self, Edge, Mesh};
use crate::problem::{BoundaryValue, Load};

impl Findings {
    pub(super) fn loads(&mut self, mesh: &Mesh, section: &Section, loads: &[Load]) -> Loads {
        let mut found = Loads::default();
        for (i, load) in loads.iter().enumerate() {
            let pointer = format!("/loads/{i}");
            if !self.one_form(load, &pointer) {
                continue;
            }
            if let Some([x, y]) = load.body_force {
                found.body_force[0] += x;
                found.body_force[1] += y;
                continue;
            }
            if let Some(force) = load.force {
                self.forces(mesh, section, load, force, &pointer, &mut found);
                continue;
            }
            let Some(name) = load.boundary.as_ref().filter(|_| load.nodes.is_none()) else {
                let (field, got) = match load.nodes {
                    Some(_) => ("nodes", "a set of nodes for a load that is no `force`"),
                    None => ("boundary", "nothing"),
                };
                self.say(
                    format!("{pointer}/{field}"),
                    if load.nodes.is_some() { "not_used" } else { "missing" },
                    got,
                    "the name of a boundary",
                    "Stresses act on a boundary, a `force` on `nodes`, a body force on the whole body.",
                );
                continue;
            };
            let Some(edges) = self.boundary(mesh, name, format!("{pointer}/boundary")) else {
                continue;
            };
            if let Some(forces) = &load.nodal {
                let ring = section.circumference();
                let nodes = self.nodes_in_order(edges, forces.len(), &format!("{pointer}/nodal"));
                let forces = forces.iter().map(|[x, y]| [x / ring, y / ring]);
                found.nodal.extend(nodes.into_iter().zip(forces));
                continue;
            }
            let zero = BoundaryValue::Constant(0.0);
            let (axes, values, names) = match (load.pressure, load.traction) {
                (Some(pressure), _) => (LoadAxes::Edge, [pressure, zero], ["pressure", "pressure"]),
                (_, Some(traction)) => (LoadAxes::Fixed, traction, ["traction/0", "traction/1"]),
                _ => (
                    LoadAxes::Edge,
                    [load.normal.unwrap_or(zero), load.tangential.unwrap_or(zero)],
                    ["normal", "tangential"],
                ),
            };
            // a pressure pushes against the normal
            let sign = if load.pressure.is_some() { -1.0 } else { 1.0 };
            let [first, second] = [0, 1]
                .map(|k| self.along(mesh, edges, values[k], format!("{pointer}/{}", names[k])));
            for ((edge, a), (_, b)) in first.into_iter().zip(second) {
                let values = [0, 1, 2].map(|k| [sign * a[k], b[k]]);
                found.edges.push(EdgeLoad { edge, axes, values });
            }
        }
        found
    }

    /// The same force on every node of a set.
    fn forces(
        &mut self,
        mesh: &Mesh,
        section: &Section,
        load: &Load,
        [x, y]: [f64; 2],
        pointer: &str,
        found: &mut Loads,
    ) {
        let (Some(name), None) = (&load.nodes, &load.boundary) else {
            self.say(
                format!("{pointer}/nodes"),
                "missing",
                "no set of nodes",
                "the name of a set of nodes, and no boundary",
                "A `force` acts on each node of a set; on a boundary give `nodal` forces or a traction.",
            );
            return;
        };
        if let Some(nodes) = self.node_set(mesh, name, format!("{pointer}/nodes")) {
            let ring = section.circumference();
            let force = [x / ring, y / ring];
            found.nodal.extend(nodes.iter().map(|node| (*node, force)));
        }
    }

    fn one_form(&mut self, load: &Load, pointer: &str) -> bool {
        let forms = [
            ("pressure", load.pressure.is_some()),
            ("traction", load.traction.is_some()),
            (
                "normal, tangential",
                load.normal.is_some() || load.tangential.is_some(),
            ),
            ("nodal", load.nodal.is_some()),
            ("force", load.force.is_some()),
            ("body_force", load.body_force.is_some()),
        ];
        let given: Vec<&str> = forms.iter().filter(|f| f.1).map(|f| f.0).collect();
        if given.len() != 1 {
            let got = match given.len() {
                0 => "a load without a value".to_owned(),
                _ => given.join(" and "),
            };
            self.say(
                pointer,
                "wrong_count",
                got,
                "exactly one of `pressure`, `traction`, `normal` and `tangential`, `nodal`, `force`, `body_force`",
                "Write a load for each.",
            );
            return false;
        }
        if load.body_force.is_some() && (load.boundary.is_some() || load.nodes.is_some()) {
            let field = if load.boundary.is_some() {
                "boundary"
            } else {
                "nodes"
            };
            self.say(
                format!("{pointer}/{field}"),
                "not_used",
                "a place for a body force",
                "none: it acts on the whole body",
                "Remove it, or give a traction.",
            );
            return false;
        }
        true
    }

    /// The nodes of a boundary from its start, when there are `count` of them.
    fn nodes_in_order(&mut self, edges: &[Edge], count: usize, pointer: &str) -> Vec<u32> {
        let runs = mesh::runs(edges);
        let [run] = &runs[..] else {
            self.say(
                pointer,
                "not_a_chain",
                format!("a boundary of {} pieces", runs.len()),
                "one chain of edges",
                "Forces node by node need a boundary that hangs together.",
            );
            return Vec::new();
        };
        let mut nodes = vec![run[0][0]];
        run.iter()
            .for_each(|[_, end, mid]| nodes.extend([*mid, *end]));
        if nodes.len() != count {
            self.say(
                pointer,
                "wrong_length",
                format!("{count} forces"),
                format!("{}, one for each node of the refined boundary", nodes.len()),
                "Corner, midside, corner, … from the boundary's start.",
            );
            return Vec::new();
        }
        nodes
    }
}
