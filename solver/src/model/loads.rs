//! Loads on the mesh.

use super::checks::Checks;
use crate::elasticity::{EdgeLoad, LoadAxes, Loads, Section};
use crate::error::{AllChecks, Checked, Reason};
use crate::mesh::{self, Edge, Mesh};
use crate::problem::{BoundaryValue, Load};

/// A stress on a boundary.
struct Stress {
    axes: LoadAxes,
    /// −1: a pressure pushes against the normal.
    sign: f64,
    values: [BoundaryValue; 2],
    /// Names of the two values in the load.
    fields: [&'static str; 2],
}

impl Checks {
    pub(super) fn loads(
        &mut self,
        mesh: &Mesh,
        section: &Section,
        loads: &[Load],
    ) -> Checked<Loads> {
        let mut all = AllChecks::default();
        let mut found = Loads::default();
        for (i, load) in loads.iter().enumerate() {
            all.check(self.load(mesh, section, load, &format!("/loads/{i}"), &mut found));
        }
        all.finish(found)
    }

    /// Adds one load to those `found`.
    fn load(
        &mut self,
        mesh: &Mesh,
        section: &Section,
        load: &Load,
        pointer: &str,
        found: &mut Loads,
    ) -> Checked {
        let ring = section.circumference();
        let zero = BoundaryValue::Constant(0.0);
        let (boundary, stress) = match load {
            Load::BodyForce([x, y]) => {
                found.body_force[0] += x;
                found.body_force[1] += y;
                return Ok(());
            }
            Load::Force(nodes, [x, y]) => {
                let nodes = self.node_set(mesh, nodes, format!("{pointer}/nodes"))?;
                let force = [x / ring, y / ring];
                found.nodal.extend(nodes.iter().map(|node| (*node, force)));
                return Ok(());
            }
            Load::Nodal(boundary, forces) => {
                let edges = self.boundary(mesh, boundary, format!("{pointer}/boundary"))?;
                let nodes =
                    self.nodes_in_order(edges, forces.len(), &format!("{pointer}/nodal"))?;
                let forces = forces.iter().map(|[x, y]| [x / ring, y / ring]);
                found.nodal.extend(nodes.into_iter().zip(forces));
                return Ok(());
            }
            Load::Pressure(boundary, pressure) => (
                boundary,
                Stress {
                    axes: LoadAxes::Edge,
                    sign: -1.0,
                    values: [*pressure, zero],
                    fields: ["pressure", "pressure"],
                },
            ),
            Load::Traction(boundary, traction) => (
                boundary,
                Stress {
                    axes: LoadAxes::Fixed,
                    sign: 1.0,
                    values: *traction,
                    fields: ["traction/0", "traction/1"],
                },
            ),
            Load::Normal(boundary, normal, tangential) => (
                boundary,
                Stress {
                    axes: LoadAxes::Edge,
                    sign: 1.0,
                    values: [*normal, tangential.unwrap_or(zero)],
                    fields: ["normal", "tangential"],
                },
            ),
            Load::Tangential(boundary, tangential) => (
                boundary,
                Stress {
                    axes: LoadAxes::Edge,
                    sign: 1.0,
                    values: [zero, *tangential],
                    fields: ["normal", "tangential"],
                },
            ),
        };
        self.stress(mesh, boundary, &stress, pointer, found)
    }

    /// Adds a stress on a boundary.
    fn stress(
        &mut self,
        mesh: &Mesh,
        boundary: &str,
        stress: &Stress,
        pointer: &str,
        found: &mut Loads,
    ) -> Checked {
        let edges = self.boundary(mesh, boundary, format!("{pointer}/boundary"))?;
        let [first, second] = [0, 1].map(|k| {
            let place = format!("{pointer}/{}", stress.fields[k]);
            self.along(mesh, edges, stress.values[k], place)
        });
        for ((edge, a), (_, b)) in first?.into_iter().zip(second?) {
            let values = [0, 1, 2].map(|k| [stress.sign * a[k], b[k]]);
            let axes = stress.axes;
            found.edges.push(EdgeLoad { edge, axes, values });
        }
        Ok(())
    }

    /// The nodes of a boundary from its start; there must be `count` of them.
    fn nodes_in_order(&mut self, edges: &[Edge], count: usize, pointer: &str) -> Checked<Vec<u32>> {
        let runs = mesh::runs(edges);
        let [run] = &runs[..] else {
            return Err(self.report(
                pointer,
                Reason::NotAChain,
                format!("a boundary of {} pieces", runs.len()),
                "one chain of edges",
                "Forces at nodes need a connected boundary.",
            ));
        };
        let mut nodes = vec![run[0][0]];
        run.iter()
            .for_each(|[_, end, mid]| nodes.extend([*mid, *end]));
        if nodes.len() != count {
            return Err(self.report(
                pointer,
                Reason::WrongLength,
                format!("{count} forces"),
                format!("{}, one for each node of the refined boundary", nodes.len()),
                "Corner, midside, corner, … from the boundary's start.",
            ));
        }
        Ok(nodes)
    }
}
