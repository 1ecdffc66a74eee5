//! Obstacles that slide along the body, and what linear kinematics and lines of symmetry permit.

use std::collections::BTreeMap;

use super::axis::Axis;
use super::checks::{ALIGNED, Checks};
use super::contact_model::ContactModel;
use super::level::Level;
use super::supports::Held;
use crate::contact::ContactBoundary;
use crate::mesh::Mesh;
use crate::problem::{Obstacle, Step};
use crate::solution::WarningCode;

/// The cosine of the largest angle between two sides at which the surface counts as straight: 20°.
const STRAIGHT_ON: f64 = 0.94;

/// The largest angle between normals of a straight side, whose nodes have rounded coordinates: 0.06°.
const STRAIGHT: f64 = 1e-3;

impl Checks {
    /// Warns of an obstacle that is dragged along a contact with a line of symmetry at its end, or which ended there before it
    /// was dragged: the other half, which is not modelled, would be dragged the opposite way.
    pub(super) fn warn_of_dragged_symmetry(
        &mut self,
        mesh: &Mesh,
        contacts: &[ContactModel],
        fixed: &BTreeMap<u32, Held>,
        axis: &Axis,
        steps: &[Step],
    ) {
        let drags = |step: &Step| step.tangential_displacement != 0.0;
        let dragged = steps.is_empty() || steps.iter().any(drags);
        for contact in contacts {
            let boundary = &contact.boundary;
            let own = if dragged {
                contact.tangential_displacement
            } else {
                0.0
            };
            let on_axis = |i: usize| axis.holds(boundary.positions[i]);
            let held_at = |i: usize, node: u32| match fixed.get(&node) {
                Some(held @ Held::Along { .. }) => {
                    // along the body: normals of the obstacle need not be upright at the line of symmetry
                    let [x, y] = contact.outward[i];
                    held.along([y, -x]) == Some(0.0)
                }
                _ => false,
            };
            let ends = [0, boundary.nodes.len() - 1];
            // where the obstacle was dragged away from the line, the contact ends beside it
            let named = mesh.boundaries.get(&contact.name);
            let named = named.and_then(|edges| Some([edges.first()?[0], edges.last()?[1]]));
            let held = |i: usize| {
                let before = named.filter(|_| i == 0).map(|[start, _]| start);
                let after = named.filter(|_| i > 0).map(|[_, end]| end);
                let near = |node: &u32| {
                    let ([x, y], [u, v]) = (mesh.nodes[*node as usize], boundary.positions[i]);
                    (u - x).hypot(v - y) <= own.abs() * (1.0 + ALIGNED)
                };
                let beside = before.or(after).filter(near);
                held_at(i, boundary.nodes[i]) || beside.is_some_and(|node| held_at(i, node))
            };
            let Some(end) = ends.into_iter().find(|&i| on_axis(i) || held(i)) else {
                continue;
            };
            let pushed = contact.pushed_along_body(end);
            let tilt = match &contact.tool {
                Some(tool) => tool.motions(&Level::FULL)[2],
                None => 0.0,
            };
            let (field, moved) = if own != 0.0 {
                (
                    "tangential_displacement",
                    format!("displaced along it by {own}"),
                )
            } else if tilt != 0.0 {
                ("tilt", format!("turned by {tilt}"))
            } else if pushed.abs() > ALIGNED * contact.indentation.abs() {
                ("direction", format!("displaced along it by {pushed}"))
            } else {
                continue;
            };
            let [x, y] = boundary.positions[end];
            let (what, instead) = if on_axis(end) {
                (
                    "the axis",
                    "Remove the drag: a body of revolution cannot be dragged across its axis.",
                )
            } else {
                (
                    "a line of symmetry",
                    "Model the whole body, or leave that out. If the support is a wall rather than a symmetry line, end the contact one edge before it.",
                )
            };
            self.warn(
                WarningCode::SymmetricDrag,
                &format!("{}/{field}", contact.pointer),
                format!("The contact ends on {what}, at ({x}, {y}), and its obstacle is {moved}: beyond that end it would move the opposite way. {instead}"),
            );
        }
    }
}

/// A drag is radial if its radial component is more than this fraction of the drag.
const RADIAL: f64 = 1e-6;

impl Checks {
    /// Warns of an obstacle of revolution that is dragged away from the axis or towards it: a rigid obstacle can only
    /// move along its axis. Along a cone a motion along the axis is a drag together with an indentation, whose radial
    /// components cancel.
    pub(super) fn warn_of_radial_drag(
        &mut self,
        contacts: &[ContactModel],
        axis: &Axis,
        steps: &[Step],
    ) {
        let ends = Level::ends_of(steps);
        for contact in contacts {
            let boundary = &contact.boundary;
            let last = boundary.nodes.len() - 1;
            // a contact that ends on the axis is told of with its line of symmetry
            if [0, last].iter().any(|&i| axis.holds(boundary.positions[i])) {
                continue;
            }
            let radial = |level: &Level| {
                let pushed = level.motions[0] * contact.indentation;
                let along = level.motions[1] * contact.tangential_displacement;
                // a ring that is pressed onto a cylinder along the axis is only thicker than the gap
                let of_drag = |i: usize| along * boundary.tangent(i)[0];
                let of_all = |i: usize| {
                    let (n, t, [a, b]) =
                        (boundary.normals[i], boundary.tangent(i), contact.push[i]);
                    of_drag(i) - pushed * (a * n[0] - b * t[0])
                };
                let most = |of_node: &dyn Fn(usize) -> f64| {
                    (0..=last).map(|i| of_node(i).abs()).fold(0.0, f64::max)
                };
                let least = RADIAL * along.abs();
                most(&of_drag) > least && most(&of_all) > least
            };
            if !ends.iter().any(radial) {
                continue;
            }
            let d = contact.tangential_displacement;
            self.warn(
                WarningCode::RadialDrag,
                &format!("{}/tangential_displacement", contact.pointer),
                format!("The obstacle is displaced along the contact by {d}, which moves it away from the axis or towards it: a rigid body of revolution cannot widen or shrink, and can only move along its axis. Remove the displacement or, where only a sector slides, model the sector in plane strain."),
            );
        }
    }
}

/// Whether sliding changes neither gap nor place of a contact: a straight obstacle without ends along a straight side
/// of the body with a corner at each end.
pub(super) fn endless(
    mesh: &Mesh,
    boundary: &ContactBoundary,
    obstacle: &Obstacle,
    profile: &[f64],
) -> bool {
    let unbounded = matches!(obstacle.span(), (None, None, _));
    let [a, b] = boundary.normals[0];
    let errors = &boundary.normal_errors;
    let same = |([c, d], error): (&[f64; 2], &f64)| {
        (a * d - b * c).abs() <= (error + errors[0]).min(STRAIGHT)
    };
    let even = boundary.normals.iter().zip(errors).all(same);
    let parallel = profile
        .iter()
        .all(|p| (p - profile[0]).abs() <= ALIGNED * boundary.length());
    unbounded && obstacle.is_straight() && even && parallel && !goes_on(mesh, boundary)
}

/// Whether the surface of the body continues straight beyond an end of a boundary.
fn goes_on(mesh: &Mesh, boundary: &ContactBoundary) -> bool {
    let nodes = &boundary.nodes;
    let ends = [
        [nodes[0], nodes[1]],
        [nodes[nodes.len() - 1], nodes[nodes.len() - 2]],
    ];
    // sides at the ends by their midsides, and how many elements have each
    let mut sides: BTreeMap<(usize, u32), u32> = BTreeMap::new();
    for [p, q, mid] in mesh.elements.iter().flat_map(|element| element.sides()) {
        for (e, [end, own]) in ends.into_iter().enumerate() {
            if (p == end || q == end) && mid != own {
                *sides.entry((e, mid)).or_default() += 1;
            }
        }
    }
    let direction = |from: u32, to: u32| {
        let [[x0, y0], [x1, y1]] = [from, to].map(|n| mesh.nodes[n as usize]);
        let length = (x1 - x0).hypot(y1 - y0);
        [(x1 - x0) / length, (y1 - y0) / length]
    };
    let surface = sides.into_iter().filter(|(_, count)| *count == 1);
    surface.into_iter().any(|((e, mid), _)| {
        let [end, own] = ends[e];
        let ([a, b], [c, d]) = (direction(own, end), direction(end, mid));
        a * c + b * d > STRAIGHT_ON
    })
}
