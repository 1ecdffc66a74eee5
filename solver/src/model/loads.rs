//! Checks loads and places them on the mesh.

use super::checks::Checks;
use super::nodes::{FirstSides, Forces};
use crate::elasticity::{EdgeLoad, LoadAxes, Loads, Section};
use crate::error::{AllChecks, Checked, Reason};
use crate::mesh::{Edge, Mesh};
use crate::problem::{BoundaryValue, Load, Material, Rotation};

/// A stress on a boundary.
struct Stress {
    axes: LoadAxes,
    /// The sign: −1 for a pressure, which pushes against the normal.
    sign: f64,
    values: [BoundaryValue; 2],
    /// The names of the fields in the load that have the two values.
    fields: [&'static str; 2],
}

impl Checks {
    pub(super) fn loads(
        &mut self,
        mesh: &Mesh,
        sides: &FirstSides<'_>,
        section: &Section,
        materials: &[Material],
        loads: &[Load],
    ) -> Checked<Loads> {
        let mut all = AllChecks::default();
        let mut found = Loads::default();
        let mut at_nodes = Vec::new();
        for (i, load) in loads.iter().enumerate() {
            let pointer = format!("/loads/{i}");
            all.check(self.load(mesh, section, load, &pointer, &mut found, &mut at_nodes));
        }
        found.nodal.extend(sides.carried(at_nodes));
        let of_mass = |load: &Load| matches!(load, Load::Gravity(_) | Load::Rotation(_));
        if let Some(first) = loads.iter().position(of_mass) {
            let densities = all.check(self.densities(materials, first));
            found.body_force.densities = densities.unwrap_or_default();
        }
        all.finish(found)
    }

    /// Adds one load to `found`, or to the forces `at_nodes` of the first mesh.
    fn load(
        &mut self,
        mesh: &Mesh,
        section: &Section,
        load: &Load,
        pointer: &str,
        found: &mut Loads,
        at_nodes: &mut Vec<Forces>,
    ) -> Checked {
        let ring = section.circumference();
        let zero = BoundaryValue::Constant(0.0);
        let (boundary, stress) = match load {
            Load::BodyForce(force) => {
                let sum = &mut found.body_force.constant;
                (0..2).for_each(|a| sum[a] += force[a]);
                return Ok(());
            }
            Load::Gravity(gravity) => return self.gravity(section, *gravity, pointer, found),
            Load::Rotation(rotation) => return self.rotation(section, rotation, pointer, found),
            // thermal strains are found with the materials
            Load::Temperature(..) | Load::NodalTemperature(_) => return Ok(()),
            Load::Force(nodes, force) => {
                let pointer = format!("{pointer}/nodes");
                if let Some(count) = mesh.nodes_left_out.get(nodes) {
                    return Err(self.report(
                        pointer,
                        Reason::UnusedNode,
                        format!("{count} nodes of `{nodes}` that belong to no element"),
                        "nodes of elements only",
                        "A force on them would not act on the body: leave these nodes out of the set, or connect them to an element.",
                    ));
                }
                let set = self.node_set(mesh, nodes, pointer)?;
                let force = force.map(|f| f / ring);
                let given = mesh.given_nodes(set).into_iter();
                at_nodes.push(given.map(|node| (node, force)).collect());
                return Ok(());
            }
            Load::Nodal(boundary, forces) => {
                let edges = self.boundary(mesh, boundary, format!("{pointer}/boundary"))?;
                let (nodes, first) =
                    self.nodes_in_order(mesh, edges, forces.len(), format!("{pointer}/nodal"))?;
                let forces = forces.iter().map(|force| force.map(|f| f / ring));
                let forces = nodes.into_iter().zip(forces);
                if first {
                    at_nodes.push(forces.collect())
                } else {
                    found.nodal.extend(forces)
                }
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

    /// Adds the acceleration of gravity.
    fn gravity(
        &mut self,
        section: &Section,
        acceleration: [f64; 2],
        pointer: &str,
        found: &mut Loads,
    ) -> Checked {
        let sum = &mut found.body_force.acceleration;
        (0..2).for_each(|a| sum[a] += acceleration[a]);
        if section.axisymmetric() && acceleration[0] != 0.0 {
            return Err(self.report(
                format!("{pointer}/gravity/0"),
                Reason::NotUsed,
                acceleration[0],
                "0 in axisymmetry",
                "Gravity across its axis bends a body of revolution, which is no axisymmetric state. A force along r is a `body_force`, the centrifugal force a `rotation`.",
            ));
        }
        Ok(())
    }

    /// Adds the acceleration ω² (place − axis) of a rotation.
    fn rotation(
        &mut self,
        section: &Section,
        rotation: &Rotation,
        pointer: &str,
        found: &mut Loads,
    ) -> Checked {
        let squared = rotation.angular_velocity * rotation.angular_velocity;
        let force = &mut found.body_force;
        if !section.axisymmetric() {
            for (a, about) in rotation.about.unwrap_or_default().into_iter().enumerate() {
                force.growth[a] += squared;
                force.acceleration[a] -= squared * about;
            }
            return Ok(());
        }
        force.growth[0] += squared;
        match rotation.about {
            None => Ok(()),
            Some([x, y]) => Err(self.report(
                format!("{pointer}/rotation/about"),
                Reason::NotUsed,
                format!("[{x}, {y}]"),
                "nothing in axisymmetry",
                "A body of revolution rotates about its own axis: remove `about`.",
            )),
        }
    }

    /// The densities of all materials. `first`: the number of the first load that acts on the mass.
    fn densities(&mut self, materials: &[Material], first: usize) -> Checked<Vec<f64>> {
        let mut all = AllChecks::default();
        let mut densities = Vec::new();
        for (i, material) in materials.iter().enumerate() {
            if material.density.is_none() {
                all.fail(self.report(
                    format!("/materials/{i}/density"),
                    Reason::Missing,
                    "nothing",
                    "the mass per volume of the material",
                    format!("/loads/{first} acts on the mass of the body. With N, mm and s a density is in t/mm³: 7.85e-9 for steel. A material without mass has the density 0."),
                ));
            }
            densities.extend(material.density);
        }
        all.finish(densities)
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
        for ((edge, a), b) in edges.iter().zip(first?).zip(second?) {
            let values = [0, 1, 2].map(|k| [stress.sign * a[k], b[k]]);
            let (edge, axes) = (*edge, stress.axes);
            found.edges.push(EdgeLoad { edge, axes, values });
        }
        Ok(())
    }

    /// The nodes of a boundary from its start on, if there are `count` of them on the first mesh (then with `true`) or
    /// on this mesh (then with `false`).
    fn nodes_in_order(
        &mut self,
        mesh: &Mesh,
        edges: &[Edge],
        count: usize,
        pointer: String,
    ) -> Checked<(Vec<u32>, bool)> {
        let hint = "Forces at nodes need a connected boundary with a start and an end.";
        self.chain(edges, pointer.clone(), hint)?;
        let parts = edges.iter().filter_map(|edge| mesh.part(edge));
        let mut first: Vec<Edge> = parts.map(|part| part.side).collect();
        first.dedup();
        for (edges, is_first) in [(&first[..], true), (edges, false)] {
            if 2 * edges.len() + 1 == count {
                let start = edges.first().map(|edge| edge[0]);
                let others = edges.iter().flat_map(|[_, end, mid]| [*mid, *end]);
                return Ok((start.into_iter().chain(others).collect(), is_first));
            }
        }
        let expected = 2 * first.len() + 1;
        Err(self.report(
            pointer,
            Reason::WrongLength,
            format!("{count} forces"),
            format!("{expected}, one for each node of the boundary before it is refined"),
            "Corner, midside, corner, … from the boundary's start.",
        ))
    }
}
