//! Checks supports, and determines the displacements that they prescribe at nodes.

use std::collections::BTreeMap;

use serde::Serialize;

use super::axis::Axis;
use super::checks::{ALIGNED, Checks};
use super::nodes::FirstSides;
use crate::contact::{HeldDirections, smooth};
use crate::error::{AllChecks, Checked, Reason};
use crate::mesh::{Edge, Mesh};
use crate::problem::{BoundaryValue, Support};

/// The place where a support holds the body.
enum Place<'a> {
    Edges(&'a [Edge]),
    Nodes(&'a [u32]),
}

/// The displacements that supports prescribe at a node.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub enum Held {
    /// The displacement along one direction.
    Along {
        /// The direction (unit vector).
        direction: [f64; 2],
        /// The displacement along the direction (length).
        value: f64,
        /// How far the direction may deviate from the direction of the surface (angle); 0 along x and y.
        #[serde(skip)]
        error: f64,
    },
    /// The whole displacement along x and y.
    Both([f64; 2]),
}

impl Held {
    /// The prescribed displacement along a direction (unit vector); `None` if it is not prescribed.
    pub fn along(&self, along: [f64; 2]) -> Option<f64> {
        match *self {
            Held::Both(u) => Some(u[0] * along[0] + u[1] * along[1]),
            Held::Along {
                direction, value, ..
            } => {
                let cosine = direction[0] * along[0] + direction[1] * along[1];
                parallel(direction, along).then(|| value * cosine.signum())
            }
        }
    }

    /// Adds a displacement prescribed along a direction with an error. `Err`: the different value that is already
    /// prescribed. Directions that differ by no more than their errors are equal.
    fn and(self, along: [f64; 2], value: f64, error: f64, rounding: f64) -> Result<Self, f64> {
        let ([a, b], first, own) = match self {
            Held::Along {
                direction,
                value,
                error,
            } => (direction, value, error),
            Held::Both([x, y]) => {
                let known = x * along[0] + y * along[1];
                return if (known - value).abs() <= rounding {
                    Ok(self)
                } else {
                    Err(known)
                };
            }
        };
        let [c, d] = along;
        let det = a * d - b * c;
        if det.abs() <= (own + error).sin().max(ALIGNED) {
            let known = first * (a * c + b * d).signum();
            let exact = Held::Along {
                direction: along,
                value,
                error,
            };
            return match (known - value).abs() <= rounding {
                true if error < own => Ok(exact),
                true => Ok(self),
                false => Err(known),
            };
        }
        Ok(Held::Both([
            (first * d - value * b) / det,
            (value * a - first * c) / det,
        ]))
    }
}

fn parallel(a: [f64; 2], b: [f64; 2]) -> bool {
    (a[0] * b[1] - a[1] * b[0]).abs() <= ALIGNED
}

impl Checks {
    /// The prescribed displacements by node, from the valid supports; and whether all supports are valid. A body of
    /// revolution cannot leave its axis: there u_r = 0, with or without a support.
    pub(super) fn supports(
        &mut self,
        mesh: &Mesh,
        sides: &FirstSides<'_>,
        axis: &Axis,
        supports: &[Support],
    ) -> (BTreeMap<u32, Held>, Checked) {
        let mut fixed: BTreeMap<u32, Held> = BTreeMap::new();
        let on_axis = |n: &u32| axis.holds(mesh.nodes[*n as usize]);
        for node in (0..mesh.nodes.len() as u32).filter(on_axis) {
            let (direction, value, error) = ([1.0, 0.0], 0.0, 0.0);
            let held = Held::Along {
                direction,
                value,
                error,
            };
            fixed.insert(node, held);
        }
        let size = supports
            .iter()
            .flat_map(|s| [s.ux, s.uy, s.un, s.ut])
            .flatten()
            .map(largest)
            .fold(0.0, f64::max);
        let mut all = AllChecks::default();
        for (i, support) in supports.iter().enumerate() {
            let pointer = format!("/supports/{i}");
            all.check(self.support(mesh, support, &pointer, ALIGNED * size, &mut fixed));
        }
        for (direction, field) in [([1.0, 0.0], "ux"), ([0.0, 1.0], "uy")] {
            let prescribed = at_given_nodes(mesh, supports, field);
            for (node, value) in sides.between(&prescribed) {
                let held = fixed.get(&node).copied();
                let held = match held {
                    None => Held::Along {
                        direction,
                        value,
                        error: 0.0,
                    },
                    Some(held) if held.along(direction).is_none() => {
                        held.and(direction, value, 0.0, 0.0).unwrap_or(held)
                    }
                    Some(held) => held,
                };
                fixed.insert(node, held);
            }
        }
        (fixed, all.finish(()))
    }

    /// Adds the displacements that a support prescribes to `fixed`. Two values agree if they differ by at most
    /// `rounding`.
    fn support(
        &mut self,
        mesh: &Mesh,
        support: &Support,
        pointer: &str,
        rounding: f64,
        fixed: &mut BTreeMap<u32, Held>,
    ) -> Checked {
        let mut all = AllChecks::default();
        let fields = [
            ("ux", support.ux),
            ("uy", support.uy),
            ("un", support.un),
            ("ut", support.ut),
        ];
        let named = fields.map(|(_, value)| value.is_some());
        if named == [false; 4] && support.stiffness.is_none() {
            all.fail(self.report(
                pointer,
                Reason::TooFew,
                "neither `ux` nor `uy` nor `un` nor `ut`, and no `stiffness`",
                "at least one of `ux`, `uy`, `un`, `ut` and `stiffness`",
                "Prescribe a displacement or springs, or remove the support.",
            ));
        }
        if let Some(stiffness) = &support.stiffness {
            all.check(self.stiffness(support, stiffness, &format!("{pointer}/stiffness")));
        }
        if (named[0] || named[1]) && (named[2] || named[3]) {
            return Err(self.report(
                pointer,
                Reason::WrongCount,
                "displacements along x, y and along normal, tangent",
                "one pair of directions",
                "Write two supports to prescribe both.",
            ));
        }
        let place = self.place(mesh, support, pointer)?;
        let normals = match place {
            Place::Edges(edges) if named[2] || named[3] => {
                let normals = self.normals(mesh, edges, &format!("{pointer}/boundary"));
                all.check(normals).unwrap_or_default()
            }
            Place::Nodes(_) if named[2] || named[3] => {
                return Err(self.report(
                    format!("{pointer}/nodes"),
                    Reason::NotUsed,
                    "`un` or `ut` on a set of nodes",
                    "`ux` and `uy`",
                    "A set of nodes has no normal; name a boundary.",
                ));
            }
            _ => BTreeMap::new(),
        };
        for (field, value) in fields {
            let Some(value) = value else { continue };
            let at = format!("{pointer}/{field}");
            let mut conflict = None;
            let Some(values) = all.check(self.at_nodes(mesh, &place, value, &at)) else {
                continue;
            };
            for (node, value) in values {
                let (direction, error) = match (field, normals.get(&node)) {
                    ("ux", _) => ([1.0, 0.0], 0.0),
                    ("uy", _) => ([0.0, 1.0], 0.0),
                    ("un", Some((n, error))) => (*n, *error),
                    ("ut", Some(([x, y], error))) => ([*y, -x], *error),
                    _ => continue,
                };
                let held = match fixed.get(&node) {
                    None => Ok(Held::Along {
                        direction,
                        value,
                        error,
                    }),
                    Some(held) => held.and(direction, value, error, rounding),
                };
                match held {
                    Ok(held) => drop(fixed.insert(node, held)),
                    Err(known) => conflict = Some((node, known, value)),
                }
            }
            if let Some((node, known, value)) = conflict {
                let [x, y] = mesh.nodes[node as usize];
                all.fail(self.report(
                    at,
                    Reason::Conflict,
                    value,
                    format!(
                        "{known}, which another support (or the axis) prescribes at node {node} ({x}, {y})"
                    ),
                    "Two supports that share a node must agree there.",
                ));
            }
        }
        all.finish(())
    }

    /// The boundary or the set of nodes that a support names.
    fn place<'a>(
        &mut self,
        mesh: &'a Mesh,
        support: &Support,
        pointer: &str,
    ) -> Checked<Place<'a>> {
        match (&support.boundary, &support.nodes) {
            (Some(name), None) => self
                .boundary(mesh, name, format!("{pointer}/boundary"))
                .map(Place::Edges),
            (None, Some(name)) => self
                .node_set(mesh, name, format!("{pointer}/nodes"))
                .map(Place::Nodes),
            (boundary, _) => {
                let got = match boundary {
                    Some(_) => "both `boundary` and `nodes`",
                    None => "neither `boundary` nor `nodes`",
                };
                Err(self.report(
                    pointer,
                    Reason::WrongCount,
                    got,
                    "exactly one of `boundary` and `nodes`",
                    "Name the place of the support.",
                ))
            }
        }
    }

    /// A value at every node of the place; nodes of two edges occur twice.
    fn at_nodes(
        &mut self,
        mesh: &Mesh,
        place: &Place<'_>,
        value: BoundaryValue,
        pointer: &str,
    ) -> Checked<Vec<(u32, f64)>> {
        match (place, value) {
            (Place::Edges(edges), _) => {
                let values = self.along(mesh, edges, value, pointer.to_owned())?;
                let pairs = edges.iter().zip(values);
                Ok(pairs
                    .flat_map(|(edge, values)| edge.iter().copied().zip(values))
                    .collect())
            }
            (Place::Nodes(nodes), BoundaryValue::Constant(value)) => {
                Ok(nodes.iter().map(|node| (*node, value)).collect())
            }
            (Place::Nodes(_), BoundaryValue::Linear(_)) => Err(self.report(
                pointer,
                Reason::NotUsed,
                "a value from start to end on a set of nodes",
                "one number",
                "A set of nodes has no start; name a boundary.",
            )),
        }
    }

    /// Unit outward normals at the nodes of a boundary, and their possible errors (angle); the mean of both edges at a
    /// slight corner, also at an end where the surface continues smoothly.
    fn normals(&mut self, mesh: &Mesh, edges: &[Edge], pointer: &str) -> Checked<HeldDirections> {
        /// The length |n₁ + n₂|/2 of the mean normal at a turn of 45°.
        const SHARPEST: f64 = 0.923;
        #[derive(Default)]
        struct Sum {
            normals: [f64; 2],
            count: f64,
            error: f64,
        }
        let mut sums: BTreeMap<u32, Sum> = BTreeMap::new();
        let mut add = |node: u32, [x, y]: [f64; 2], error: f64| {
            let sum = sums.entry(node).or_default();
            sum.normals = [sum.normals[0] + x, sum.normals[1] + y];
            sum.count += 1.0;
            sum.error = error.max(sum.error);
        };
        for edge in edges {
            let side = mesh.edge_nodes(edge);
            let error = smooth::direction_error(&side);
            let normals = crate::contact::edge_normals(&side).into_iter();
            (edge.iter().zip(normals)).for_each(|(node, normal)| add(*node, normal, error));
        }
        for (node, normal) in smooth::normals_beyond(mesh, edges) {
            add(node, normal, 0.0);
        }
        let mut normals = BTreeMap::new();
        let mut corner = None;
        for (node, sum) in sums {
            let [x, y] = sum.normals;
            let length = x.hypot(y);
            if length < SHARPEST * sum.count {
                corner = Some(node);
            }
            // + 0.0 turns −0 into 0, so that an axis-parallel normal is exactly that
            let normal = [x / length + 0.0, y / length + 0.0];
            normals.insert(node, (normal, sum.error));
        }
        if let Some(node) = corner {
            let [x, y] = mesh.nodes[node as usize];
            return Err(self.report(
                pointer,
                Reason::TurnsCorner,
                format!("a boundary that turns by more than 45° at ({x}, {y})"),
                "a boundary without corners (at a corner the normal is not defined)",
                "Give each side a support of its own, with names under /mesh/boundaries.",
            ));
        }
        Ok(normals)
    }
}

/// The displacements that supports of node sets prescribe along x or y at nodes of the first mesh.
fn at_given_nodes(mesh: &Mesh, supports: &[Support], field: &str) -> BTreeMap<u32, f64> {
    let mut prescribed = BTreeMap::new();
    for support in supports {
        let value = match field {
            "ux" => support.ux,
            _ => support.uy,
        };
        let set = support.nodes.as_ref();
        let set = set.and_then(|name| mesh.node_sets.get(name));
        if let (Some(BoundaryValue::Constant(value)), Some(set)) = (value, set) {
            let nodes = mesh.given_nodes(set).into_iter();
            prescribed.extend(nodes.map(|node| (node, value)));
        }
    }
    prescribed
}

fn largest(value: BoundaryValue) -> f64 {
    match value {
        BoundaryValue::Constant(value) => value.abs(),
        BoundaryValue::Linear([start, end]) => start.abs().max(end.abs()),
    }
}
