//! Loads: each in exactly one of its forms.

use super::checks::Checks;
use crate::elasticity::{EdgeLoad, LoadAxes, Loads, Section};
use crate::error::{All, Checked, Reason};
use crate::mesh::{self, Edge, Mesh};
use crate::problem::{BoundaryValue, Load};

impl Checks {
    pub(super) fn loads(
        &mut self,
        mesh: &Mesh,
        section: &Section,
        loads: &[Load],
    ) -> Checked<Loads> {
        let mut all = All::default();
        let mut found = Loads::default();
        for (i, load) in loads.iter().enumerate() {
            all.take(self.load(mesh, section, load, &format!("/loads/{i}"), &mut found));
        }
        all.then(found)
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
        self.one_form(load, pointer)?;
        if let Some([x, y]) = load.body_force {
            found.body_force[0] += x;
            found.body_force[1] += y;
            return Ok(());
        }
        if let Some(force) = load.force {
            return self.forces(mesh, section, load, force, pointer, found);
        }
        let Some(name) = load.boundary.as_ref().filter(|_| load.nodes.is_none()) else {
            let (field, reason, got) = match load.nodes {
                Some(_) => (
                    "nodes",
                    Reason::NotUsed,
                    "a set of nodes for a load that is no `force`",
                ),
                None => ("boundary", Reason::Missing, "nothing"),
            };
            return Err(self.say(
                format!("{pointer}/{field}"),
                reason,
                got,
                "the name of a boundary",
                "Stresses act on a boundary, a `force` on `nodes`, a body force on the whole body.",
            ));
        };
        let edges = self.boundary(mesh, name, format!("{pointer}/boundary"))?;
        if let Some(forces) = &load.nodal {
            let ring = section.circumference();
            let nodes = self.nodes_in_order(edges, forces.len(), &format!("{pointer}/nodal"))?;
            let forces = forces.iter().map(|[x, y]| [x / ring, y / ring]);
            found.nodal.extend(nodes.into_iter().zip(forces));
            return Ok(());
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
        let [first, second] =
            [0, 1].map(|k| self.along(mesh, edges, values[k], format!("{pointer}/{}", names[k])));
        for ((edge, a), (_, b)) in first?.into_iter().zip(second?) {
            let values = [0, 1, 2].map(|k| [sign * a[k], b[k]]);
            found.edges.push(EdgeLoad { edge, axes, values });
        }
        Ok(())
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
    ) -> Checked {
        let (Some(name), None) = (&load.nodes, &load.boundary) else {
            return Err(self.say(
                format!("{pointer}/nodes"),
                Reason::Missing,
                "no set of nodes",
                "the name of a set of nodes, and no boundary",
                "A `force` acts on each node of a set; on a boundary give `nodal` forces or a traction.",
            ));
        };
        let nodes = self.node_set(mesh, name, format!("{pointer}/nodes"))?;
        let ring = section.circumference();
        let force = [x / ring, y / ring];
        found.nodal.extend(nodes.iter().map(|node| (*node, force)));
        Ok(())
    }

    fn one_form(&mut self, load: &Load, pointer: &str) -> Checked {
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
            return Err(self.say(
                pointer,
                Reason::WrongCount,
                got,
                "exactly one of `pressure`, `traction`, `normal` and `tangential`, `nodal`, `force`, `body_force`",
                "Write a load for each.",
            ));
        }
        if load.body_force.is_some() && (load.boundary.is_some() || load.nodes.is_some()) {
            let field = if load.boundary.is_some() {
                "boundary"
            } else {
                "nodes"
            };
            return Err(self.say(
                format!("{pointer}/{field}"),
                Reason::NotUsed,
                "a place for a body force",
                "none: it acts on the whole body",
                "Remove it, or give a traction.",
            ));
        }
        Ok(())
    }

    /// The nodes of a boundary from its start, when there are `count` of them.
    fn nodes_in_order(&mut self, edges: &[Edge], count: usize, pointer: &str) -> Checked<Vec<u32>> {
        let runs = mesh::runs(edges);
        let [run] = &runs[..] else {
            return Err(self.say(
                pointer,
                Reason::NotAChain,
                format!("a boundary of {} pieces", runs.len()),
                "one chain of edges",
                "Forces node by node need a boundary that hangs together.",
            ));
        };
        let mut nodes = vec![run[0][0]];
        run.iter()
            .for_each(|[_, end, mid]| nodes.extend([*mid, *end]));
        if nodes.len() != count {
            return Err(self.say(
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
