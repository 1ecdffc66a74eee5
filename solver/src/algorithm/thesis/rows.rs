//! Values at the two rows of internal Gauss points nearest to Γ_C, and their extrapolation to the
//! boundary: thesis 3.3, 3.4.1 and figs 3.2 and 3.4.
//!
//! ```text
//!   ----o------o------o----   boundary: its own Gauss points, and its three nodes
//!       |      |      |
//!       x      x      x       nearest row     depth d₁ from the edge, in master coordinates
//!       |      |      |
//!       x      x      x       second row      depth d₂
//! ```
//!
//! A value is extrapolated from the rows to the boundary linearly, v = v₁ + (v₁ − v₂) d₁/(d₂ − d₁), and
//! from the boundary's Gauss points to the nodes linearly as well: an end from the two points next
//! to it, the midside from the middle point (from both with the 2 × 2 rule). A node that two edges
//! share has the mean of both.

use super::average::{self, linear};
use super::friction::{Friction, signed_ratio};
use crate::algorithm::system::{State, System};
use crate::contact::edge_nodes;
use crate::elasticity::Deformed;
use crate::element::{edge3, gauss, quad8};
use crate::problem::{ThesisOptions, ThesisPressure};

/// The two rows of Gauss points nearest to Γ_C, in the elements along it.
pub(super) struct Rows {
    edges: Vec<EdgeRows>,
    /// The Gauss points and weights in one direction.
    rule: &'static [(f64, f64)],
}

/// A contact edge and the element that it belongs to.
struct EdgeRows {
    patch: usize,
    /// The number of the edge in the contact.
    edge: usize,
    element: usize,
    /// The master coordinates of the edge's start, end and midside.
    side: [[f64; 2]; 3],
}

impl EdgeRows {
    /// The master coordinates of a place at ζ along the edge (−1 … 1) and `depth` below it (0 … 2).
    fn place(&self, zeta: f64, depth: f64) -> [f64; 2] {
        let [start, end, middle] = self.side;
        [0, 1].map(|a| middle[a] * (1.0 - depth) + 0.5 * zeta * (end[a] - start[a]))
    }
}

/// The values of a state at the rows and at the boundary.
pub(super) struct RowValues {
    /// σ_n at every contact node (≤ 0 in compression).
    pub(super) node_stress: Vec<f64>,
    /// The ratio φ with its sign, extrapolated to every friction point.
    pub(super) phi: Vec<f64>,
    /// By edge: σ_n on both rows, at every Gauss point.
    stress: Vec<[Vec<f64>; 2]>,
    /// By edge: φ with its sign on both rows, at every Gauss point.
    row_phi: Vec<[Vec<f64>; 2]>,
    /// The contact and the number of each edge.
    edges: Vec<(usize, usize)>,
    rule: &'static [(f64, f64)],
}

impl Rows {
    pub(super) fn new(system: &System<'_>) -> Self {
        let mesh = &system.model.mesh;
        // an edge on the surface has one element, known by the midside
        let mut owner = vec![None; mesh.nodes.len()];
        for (e, element) in mesh.elements.iter().enumerate() {
            for &side in element.family().sides() {
                owner[element[side[2]] as usize] = Some((e, side));
            }
        }
        let mut edges = Vec::new();
        for (p, patch) in system.patches.iter().enumerate() {
            let boundary = &patch.contact.boundary;
            for edge in 0..boundary.edge_count() {
                let middle = boundary.nodes[edge_nodes(edge)[2]] as usize;
                let Some((element, [a, b, m])) = owner[middle] else {
                    continue; // Model::new takes surface edges only
                };
                // sides run counter-clockwise, boundaries with the body on their right: b first
                edges.push(EdgeRows {
                    patch: p,
                    edge,
                    element,
                    side: [b, a, m].map(|local| quad8::NODES[local]),
                });
            }
        }
        Rows {
            edges,
            rule: gauss::of_order(system.model.quadrature),
        }
    }

    /// Evaluates a state at the rows and at the boundary, as far as the options need it.
    pub(super) fn evaluate(
        &self,
        system: &System<'_>,
        state: &State,
        options: &ThesisOptions,
    ) -> RowValues {
        let extrapolated = options.pressure == ThesisPressure::Extrapolated;
        let mut row_values = RowValues {
            node_stress: Vec::new(),
            phi: vec![0.0; system.points.len()],
            stress: Vec::new(),
            row_phi: Vec::new(),
            edges: self.edges.iter().map(|e| (e.patch, e.edge)).collect(),
            rule: self.rule,
        };
        if extrapolated || options.friction_force == 2 {
            let displacements = system.body.displacements(&state.v, &system.level);
            for rows in &self.edges {
                let (stress, phi) = self.evaluate_edge(system, rows, &displacements);
                row_values.stress.push(stress);
                row_values.row_phi.push(phi);
            }
            row_values.phi = row_values.to_points(system, &row_values.row_phi);
        }
        row_values.node_stress = if extrapolated {
            row_values.to_nodes(system)
        } else {
            let pressures = system.pressures(&system.reactions(state));
            pressures.iter().map(|p| -p).collect()
        };
        row_values
    }

    /// σ_n and φ at the Gauss points of both rows below an edge.
    fn evaluate_edge(
        &self,
        system: &System<'_>,
        rows: &EdgeRows,
        displacements: &[[f64; 2]],
    ) -> ([Vec<f64>; 2], [Vec<f64>; 2]) {
        let model = system.model;
        let patch = &system.patches[rows.patch];
        let element = &model.mesh.elements[rows.element];
        let nodes = model.mesh.element_nodes(element);
        let u = element.gather(|n| displacements[n as usize]);
        let positions = edge_nodes(rows.edge).map(|i| patch.contact.boundary.positions[i]);
        let deformed = Deformed::new(
            &model.section,
            model.section.material_of(rows.element),
            (element, &nodes),
            &u,
            &model.inner(&system.level),
        );
        let (mut stress, mut phi) = ([vec![], vec![]], [vec![], vec![]]);
        for (row, depth) in depths(self.rule).into_iter().enumerate() {
            for &(zeta, _) in self.rule {
                let [xi, eta] = rows.place(zeta, depth);
                let [dx, dy] = edge3::map(&positions, zeta).1;
                let length = dx.hypot(dy);
                let ([tx, ty], [nx, ny]) =
                    ([dx / length, dy / length], [-dy / length, dx / length]);
                let [xx, yy, xy, _] = deformed.stress_at([xi, eta]);
                stress[row].push(xx * nx * nx + 2.0 * xy * nx * ny + yy * ny * ny);
                let h = quad8::shape(xi, eta);
                let u_t: f64 = (0..8).map(|i| h[i] * (u[i][0] * tx + u[i][1] * ty)).sum();
                let drag = edge_nodes(rows.edge).map(|i| system.nodes[patch.first + i].drag);
                let slip = u_t - edge3::interpolate(&edge3::shape(zeta), &drag);
                phi[row].push(patch.law.as_ref().map_or(0.0, |law| law.phi(slip)));
            }
        }
        (stress, phi)
    }
}

/// The depths of the two nearest rows below an edge, in master coordinates.
fn depths(rule: &[(f64, f64)]) -> [f64; 2] {
    [1.0 + rule[0].0, 1.0 + rule[1].0]
}

/// Extrapolates values on both rows to the boundary, linearly.
fn to_boundary(rule: &[(f64, f64)], [near, far]: &[Vec<f64>; 2]) -> Vec<f64> {
    let [d1, d2] = depths(rule);
    let part = d1 / (d2 - d1);
    near.iter()
        .zip(far)
        .map(|(a, b)| a + part * (a - b))
        .collect()
}

impl RowValues {
    /// σ_n at the boundary's Gauss points of every edge.
    fn boundary_stress(&self) -> Vec<Vec<f64>> {
        self.stress
            .iter()
            .map(|rows| to_boundary(self.rule, rows))
            .collect()
    }

    fn to_nodes(&self, system: &System<'_>) -> Vec<f64> {
        let mut sum = vec![(0.0, 0.0); system.nodes.len()];
        for ((patch, edge), values) in self.edges.iter().zip(self.boundary_stress()) {
            let first = system.patches[*patch].first;
            for (i, zeta) in edge_nodes(*edge).into_iter().zip([-1.0, 1.0, 0.0]) {
                let entry: &mut (f64, f64) = &mut sum[first + i];
                entry.0 += linear(self.rule, &values, zeta);
                entry.1 += 1.0;
            }
        }
        sum.iter()
            .map(|(sum, count)| sum / f64::max(*count, 1.0))
            .collect()
    }

    /// Extrapolates values on the rows of every edge to the friction points.
    fn to_points(&self, system: &System<'_>, rows: &[[Vec<f64>; 2]]) -> Vec<f64> {
        let boundary: Vec<Vec<f64>> = rows
            .iter()
            .map(|rows| to_boundary(self.rule, rows))
            .collect();
        self.at_points(system, &boundary)
    }

    /// Interpolates values at the boundary's Gauss points of every edge to the friction points.
    fn at_points(&self, system: &System<'_>, boundary: &[Vec<f64>]) -> Vec<f64> {
        let mut values = Vec::with_capacity(system.points.len());
        for point in &system.points {
            let patch = &system.patches[point.patch];
            let edge = (point.nodes[2] - patch.first) / 2;
            let found = self.edges.iter().position(|e| *e == (point.patch, edge));
            let zeta = point.shape[1] - point.shape[0];
            values.push(found.map_or(0.0, |k| linear(self.rule, &boundary[k], zeta)));
        }
        values
    }

    /// Step 5 of the thesis's iteration with extrapolated stresses. Way 1 of 3.2 carries σ_n and φ to the boundary and
    /// evaluates f̂ there; way 2 evaluates f̂ on both rows and carries it to the boundary (to carry the nodal integrals
    /// of f̂ instead is the same: both are linear, with equal weights on all rows).
    pub(super) fn friction(&self, system: &System<'_>, options: &ThesisOptions) -> Friction {
        let averaged = |stress: &[Vec<f64>]| self.bound(system, stress, options);
        if options.friction_force == 1 {
            let bound = averaged(&self.boundary_stress());
            let phi: Vec<Vec<f64>> = self
                .row_phi
                .iter()
                .map(|rows| to_boundary(self.rule, rows))
                .collect();
            return self.at_friction_points(system, &bound, &phi, options);
        }
        let row = |k: usize| -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
            let stress: Vec<Vec<f64>> = self.stress.iter().map(|rows| rows[k].clone()).collect();
            let phi = self.row_phi.iter().map(|rows| rows[k].clone()).collect();
            (averaged(&stress), phi)
        };
        let ((near_bound, near_phi), (far_bound, far_phi)) = (row(0), row(1));
        let near = self.at_friction_points(system, &near_bound, &near_phi, options);
        let far = self.at_friction_points(system, &far_bound, &far_phi, options);
        let carry = |near: Vec<f64>, far: Vec<f64>| to_boundary(self.rule, &[near, far]);
        Friction {
            bound: carry(near.bound, far.bound),
            traction: carry(near.traction, far.traction),
        }
    }

    /// The bound τ at the Gauss points of every edge, from σ_n at these points.
    fn bound(
        &self,
        system: &System<'_>,
        stress: &[Vec<f64>],
        options: &ThesisOptions,
    ) -> Vec<Vec<f64>> {
        let mut bound = Vec::with_capacity(stress.len());
        let largest = stress.iter().flatten().fold(0.0f64, |most, s| most.max(-s));
        for (k, (p, edge)) in self.edges.iter().enumerate() {
            let patch = &system.patches[*p];
            let Some(law) = &patch.law else {
                bound.push(vec![0.0; self.rule.len()]);
                continue;
            };
            // the limit of two elements: no further than the next element on each side
            let near = (k.saturating_sub(1)..(k + 2).min(self.edges.len()))
                .filter(|&other| self.edges[other].0 == *p);
            let neighbours: Vec<average::Stretch<'_>> = near
                .map(|other| {
                    let arc = patch.contact.boundary.edge_arc(self.edges[other].1);
                    average::Stretch {
                        from: arc[0],
                        to: arc[1],
                        values: &stress[other],
                    }
                })
                .collect();
            let arc = patch.contact.boundary.edge_arc(*edge);
            let at = |(zeta, _): &(f64, f64)| {
                let s = edge3::interpolate(&edge3::shape(*zeta), &arc);
                let average =
                    average::nonlocal(&law.bound, &neighbours, self.rule, options.local_points, s);
                law.bound.of_average(-average, largest)
            };
            bound.push(self.rule.iter().map(at).collect());
        }
        bound
    }

    fn at_friction_points(
        &self,
        system: &System<'_>,
        bound: &[Vec<f64>],
        phi: &[Vec<f64>],
        options: &ThesisOptions,
    ) -> Friction {
        let traction: Vec<Vec<f64>> = bound
            .iter()
            .zip(phi)
            .map(|(bound, phi)| {
                let pairs = bound.iter().zip(phi);
                pairs
                    .map(|(tau, phi)| tau * signed_ratio(*phi, options))
                    .collect()
            })
            .collect();
        Friction {
            bound: self.at_points(system, bound),
            traction: self.at_points(system, &traction),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linear_fields_are_carried_exactly() {
        for order in [2, 3] {
            let rule = gauss::of_order(order);
            let field = |zeta: f64, depth: f64| 3.0 + 2.0 * zeta - 0.7 * depth;
            let rows = depths(rule).map(|d| rule.iter().map(|(z, _)| field(*z, d)).collect());
            let boundary = to_boundary(rule, &rows);
            for ((zeta, _), value) in rule.iter().zip(&boundary) {
                assert!((value - field(*zeta, 0.0)).abs() < 1e-14);
            }
            for zeta in [-1.0, 0.0, 0.3, 1.0] {
                let value = linear(rule, &boundary, zeta);
                assert!((value - field(zeta, 0.0)).abs() < 1e-14);
            }
        }
    }
}
