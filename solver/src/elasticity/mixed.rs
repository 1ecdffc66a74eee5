//! The element of nearly incompressible materials, formulation 3.1: displacements of the nodes and of a bubble,
//! and a pressure that is linear in x and y, all but the first condensed inside the element.
//!
//!   u = Σ h_i u_i + b a,    θ̄ = Σ_k ψ_k ∫ ψ_k div u    (the dilatation's projection on the ψ_k)
//!   k = ∫ Bᵀ R B + κ Σ_k g_k g_kᵀ,    g_k = ∫ ψ_k mᵀ B    with R = `rest`, κ = `bulk` of the [`Split`]
//!
//! ψ_1, ψ_2, ψ_3 are orthonormal in the element and span 1, x and y. The pressure −κ θ̄ follows from the
//! displacements, so that k stays positive; with the bubble's rows b it is reduced to the nodes,
//!
//!   k_ij − k_ib k_bb⁻¹ k_bj,    f_i − k_ib k_bb⁻¹ f_b,    a = k_bb⁻¹ (f_b − k_bi u_i)
//!
//! Thermal strains ε₀ are taken off both parts: their dilatation is projected too, t_k = ∫ ψ_k mᵀε₀, and
//!
//!   f = ∫ Bᵀ R ε₀ + κ Σ_k g_k t_k

use crate::elasticity::Section;
use crate::elasticity::body_force::BodyForce;
use crate::elasticity::material::{COMPONENTS, Split, stress};
use crate::elasticity::thermal::ThermalStrain;
use crate::element::{AtNodes, Family, GaussPoint, Mapped};

/// The displacement components of the largest element with its bubble; the bubble comes after the nodes.
const SIZE: usize = 18;

/// The components of strain whose sum is the dilatation.
const NORMAL: [usize; 3] = [0, 1, 3];

/// One element of a nearly incompressible material.
pub struct Mixed<'a> {
    split: &'a Split,
    /// The number of nodes, which is also the index of the bubble.
    nodes: usize,
    frame: Frame,
    /// The vectors g_k, which give the projected dilatation from the displacements.
    dilatation: [[f64; SIZE]; 3],
    /// The rows of the bubble in the stiffness k.
    bubble: [[f64; SIZE]; 2],
    /// The flexibility of the bubble, k_bb⁻¹.
    flexibility: [[f64; 2]; 2],
    /// The integral ∫ b of the bubble function.
    volume: f64,
    /// The integrals ∫ b x and ∫ b y.
    moment: [f64; 2],
}

/// The strain matrix B of every node and of the bubble at an integration point.
type Strains = [[[f64; 2]; COMPONENTS]; SIZE / 2];

/// The pressure functions ψ_k of an element.
#[derive(Clone, Copy, Debug)]
struct Frame {
    centre: [f64; 2],
    /// The linear map from x − centre to ξ, η: the inverse of the element's map at its centre. ξ and η have the same
    /// magnitude in an element of any shape.
    to_master: [[f64; 2]; 2],
    /// The coefficients of ψ in (1, ξ, η): lower triangular.
    orthonormal: [[f64; 3]; 3],
}

impl Frame {
    fn monomials(&self, [x, y]: [f64; 2]) -> [f64; 3] {
        let (dx, dy) = (x - self.centre[0], y - self.centre[1]);
        let [xi, eta] = self.to_master.map(|[a, b]| a * dx + b * dy);
        [1.0, xi, eta]
    }

    /// The values of ψ_k at a position.
    fn functions(&self, position: [f64; 2]) -> [f64; 3] {
        let q = self.monomials(position);
        self.orthonormal.map(|row| dot(&row, &q))
    }

    /// The sum Σ_k c_k ψ_k at a position.
    fn combine(&self, coefficients: &[f64; 3], position: [f64; 2]) -> f64 {
        dot(coefficients, &self.functions(position))
    }
}

impl<'a> Mixed<'a> {
    /// The integration rule of an element: always the full one, since a smaller one would leave the bubble modes
    /// without stiffness.
    pub fn rule(family: Family) -> &'static [GaussPoint] {
        family.rule(3)
    }

    /// The element with the node positions `nodes`, of a material with the given split.
    pub fn new(
        section: &Section,
        split: &'a Split,
        family: Family,
        nodes: &AtNodes<[f64; 2]>,
    ) -> Self {
        Self::integrate(section, split, family, nodes, |_, _| {})
    }

    /// Integrates over the element. `visit`: called at every integration point with its weight and strain matrix.
    fn integrate(
        section: &Section,
        split: &'a Split,
        family: Family,
        nodes: &AtNodes<[f64; 2]>,
        mut visit: impl FnMut(f64, &Strains),
    ) -> Self {
        let count = family.nodes();
        let centre = family.map(nodes, family.centre());
        let mut element = Mixed {
            split,
            nodes: count,
            frame: Frame {
                centre: position(&centre, nodes),
                to_master: centre.master_gradients(family),
                orthonormal: [[0.0; 3]; 3],
            },
            dilatation: [[0.0; SIZE]; 3],
            bubble: [[0.0; SIZE]; 2],
            flexibility: [[0.0; 2]; 2],
            volume: 0.0,
            moment: [0.0; 2],
        };
        // of 1, ξ and η instead of the ψ_k, which follow from them
        let (mut mass, mut moments) = ([[0.0; 3]; 3], [[0.0; SIZE]; 3]);
        for point in Self::rule(family) {
            let m = family.map(nodes, point.place);
            let weight = point.weight * m.det * section.depth(m.x);
            let (shape, gradient) = bubble(family, &m, point.place);
            let mut strains = [[[0.0; 2]; COMPONENTS]; SIZE / 2];
            for i in 0..count {
                strains[i] = section.strain(m.shape[i], m.gradient[i], m.x);
            }
            strains[count] = section.strain(shape, gradient, m.x);
            let q = element.frame.monomials(position(&m, nodes));
            for i in 0..3 {
                (0..=i).for_each(|j| mass[i][j] += weight * q[i] * q[j]);
            }
            for (j, b) in strains[..=count].iter().enumerate() {
                for p in 0..2 {
                    let trace: f64 = NORMAL.iter().map(|c| b[*c][p]).sum();
                    (0..3).for_each(|k| moments[k][2 * j + p] += weight * q[k] * trace);
                }
            }
            for p in 0..2 {
                add_row(split, weight, &strains, count, p, &mut element.bubble[p]);
            }
            element.volume += weight * shape;
            let place = position(&m, nodes);
            (0..2).for_each(|a| element.moment[a] += weight * shape * place[a]);
            visit(weight, &strains);
        }
        element.frame.orthonormal = inverse_of_root(&mass);
        for (g, row) in element
            .dilatation
            .iter_mut()
            .zip(&element.frame.orthonormal)
        {
            *g = std::array::from_fn(|j| (0..3).map(|k| row[k] * moments[k][j]).sum());
        }
        for p in 0..2 {
            let row = element.volumetric_row(2 * count + p);
            (0..SIZE).for_each(|j| element.bubble[p][j] += row[j]);
        }
        let corner = |row: [f64; SIZE]| [row[2 * count], row[2 * count + 1]];
        let [[a, b], [c, d]] = element.bubble.map(corner);
        let det = a * d - b * c;
        element.flexibility = [[d / det, -b / det], [-c / det, a / det]];
        element
    }

    /// One row of the volumetric stiffness κ Σ_k g_k g_kᵀ.
    fn volumetric_row(&self, dof: usize) -> [f64; SIZE] {
        let own = self.dilatation.map(|g| self.split.bulk * g[dof]);
        std::array::from_fn(|j| (0..3).map(|k| own[k] * self.dilatation[k][j]).sum())
    }

    /// The stiffness of the nodes, along x and y; the last rows and columns are zero for a triangle.
    pub fn stiffness(
        section: &Section,
        split: &Split,
        family: Family,
        nodes: &AtNodes<[f64; 2]>,
    ) -> [[f64; 16]; 16] {
        let mut rows = [[0.0; SIZE]; 16];
        let element = Mixed::integrate(section, split, family, nodes, |weight, strains| {
            for i in 0..family.nodes() {
                for p in 0..2 {
                    add_row(split, weight, strains, i, p, &mut rows[2 * i + p]);
                }
            }
        });
        let mut k = [[0.0; 16]; 16];
        for i in 0..2 * element.nodes {
            let volumetric = element.volumetric_row(i);
            let own = element.bubble_from(&element.bubble.map(|row| row[i]));
            for j in 0..=i {
                let through = own[0] * element.bubble[0][j] + own[1] * element.bubble[1][j];
                k[i][j] = rows[i][j] + volumetric[j] - through;
                k[j][i] = k[i][j];
            }
        }
        k
    }

    /// The displacement of the bubble by a force on it, k_bb⁻¹ f.
    fn bubble_from(&self, force: &[f64; 2]) -> [f64; 2] {
        self.flexibility
            .map(|row| row[0] * force[0] + row[1] * force[1])
    }

    /// The force on the bubble by forces per volume, of an element of this material.
    pub fn force_on_bubble(&self, body_force: &BodyForce, material: usize) -> [f64; 2] {
        body_force.over(material, self.volume, self.moment)
    }

    /// The thermal strains of the element; all 0 without `strain`.
    pub(super) fn thermal(
        &self,
        section: &Section,
        family: Family,
        nodes: &AtNodes<[f64; 2]>,
        strain: Option<&ThermalStrain>,
    ) -> ThermalPart {
        let mut found = ThermalPart::default();
        let Some(thermal) = strain else { return found };
        for point in Self::rule(family) {
            let m = family.map(nodes, point.place);
            let weight = point.weight * m.det * section.depth(m.x);
            let strain = thermal.at(&m.shape).map(|strain| weight * strain);
            let psi = self.frame.functions(position(&m, nodes));
            (0..3).for_each(|k| found.dilatation[k] += psi[k] * dilatation(&strain));
            let stress = stress(&self.split.rest, &strain);
            let mut add = |i: usize, b: [[f64; 2]; COMPONENTS]| {
                for (b, s) in b.iter().zip(&stress) {
                    (0..2).for_each(|p| found.force[2 * i + p] += b[p] * s);
                }
            };
            for i in 0..self.nodes {
                add(i, section.strain(m.shape[i], m.gradient[i], m.x));
            }
            let (shape, gradient) = bubble(family, &m, point.place);
            add(self.nodes, section.strain(shape, gradient, m.x));
        }
        for (g, t) in self.dilatation.iter().zip(found.dilatation) {
            let factor = self.split.bulk * t;
            (0..SIZE).for_each(|j| found.force[j] += factor * g[j]);
        }
        found
    }

    /// The force on the bubble by forces per volume and thermal strains.
    pub(super) fn on_bubble(
        &self,
        body_force: &BodyForce,
        material: usize,
        thermal: &ThermalPart,
    ) -> [f64; 2] {
        let [x, y] = self.force_on_bubble(body_force, material);
        let b = 2 * self.nodes;
        [x + thermal.force[b], y + thermal.force[b + 1]]
    }

    /// The forces on the nodes by thermal strains, and by what acts on the bubble.
    pub(super) fn inner_forces(
        &self,
        body_force: &BodyForce,
        material: usize,
        thermal: &ThermalPart,
    ) -> AtNodes<[f64; 2]> {
        let mut forces = self.passed_on(&self.on_bubble(body_force, material, thermal));
        for (i, force) in forces.iter_mut().enumerate().take(self.nodes) {
            (0..2).for_each(|p| force[p] += thermal.force[2 * i + p]);
        }
        forces
    }

    /// The forces on the nodes equivalent to a force on the bubble: −k_ib k_bb⁻¹ f_b.
    pub fn passed_on(&self, force_on_bubble: &[f64; 2]) -> AtNodes<[f64; 2]> {
        let a = self.bubble_from(force_on_bubble);
        let mut forces = [[0.0; 2]; 8];
        for (i, force) in forces.iter_mut().enumerate().take(self.nodes) {
            *force = [0, 1].map(|p| {
                let dof = 2 * i + p;
                -(self.bubble[0][dof] * a[0] + self.bubble[1][dof] * a[1])
            });
        }
        forces
    }

    /// The state inside the element, from the displacements of its nodes, a force on the bubble and the projected
    /// dilatation t_k of thermal strains.
    pub fn inside(
        &self,
        u: &AtNodes<[f64; 2]>,
        force_on_bubble: &[f64; 2],
        thermal: &[f64; 3],
    ) -> Inside<'a> {
        let nodal = |row: &[f64; SIZE]| -> f64 {
            let nodes = u.iter().take(self.nodes).enumerate();
            nodes
                .map(|(i, u)| row[2 * i] * u[0] + row[2 * i + 1] * u[1])
                .sum()
        };
        let force = [0, 1].map(|p| force_on_bubble[p] - nodal(&self.bubble[p]));
        let bubble = self.bubble_from(&force);
        let b = 2 * self.nodes;
        let dilatation = |g: &[f64; SIZE]| nodal(g) + g[b] * bubble[0] + g[b + 1] * bubble[1];
        Inside {
            split: self.split,
            frame: self.frame,
            bubble,
            dilatation: std::array::from_fn(|k| dilatation(&self.dilatation[k]) - thermal[k]),
        }
    }
}

/// The thermal strains of an element.
#[derive(Default)]
pub(super) struct ThermalPart {
    /// The forces on the nodes and on the bubble.
    force: [f64; SIZE],
    /// The projected dilatation t_k.
    pub(super) dilatation: [f64; 3],
}

/// The state inside an element whose nodes are displaced.
pub struct Inside<'a> {
    split: &'a Split,
    frame: Frame,
    /// The displacement a of the bubble.
    pub bubble: [f64; 2],
    /// The coefficients of the projected dilatation θ̄, without that of thermal strains.
    dilatation: [f64; 3],
}

impl Inside<'_> {
    /// Adds the bubble's part to `strain`, the strain by the nodes' displacements at a place.
    pub fn add_strain(
        &self,
        section: &Section,
        family: Family,
        m: &Mapped,
        place: [f64; 2],
        strain: &mut [f64; COMPONENTS],
    ) {
        let (shape, gradient) = bubble(family, m, place);
        let b = section.strain(shape, gradient, m.x);
        (0..COMPONENTS).for_each(|c| strain[c] += dot2(&b[c], &self.bubble));
    }

    /// The projected dilatation θ̄ and the stress at a position, where `strain` is the elastic strain.
    pub fn stress(
        &self,
        strain: &[f64; COMPONENTS],
        position: [f64; 2],
    ) -> (f64, [f64; COMPONENTS]) {
        let dilatation = self.frame.combine(&self.dilatation, position);
        let mut stress = stress(&self.split.rest, strain);
        NORMAL
            .iter()
            .for_each(|c| stress[*c] += self.split.bulk * dilatation);
        (dilatation, stress)
    }
}

/// An element as a linear function of the displacements of its nodes (x and y in turn), without a force on its bubble.
pub(super) struct OfNodes<'a> {
    split: &'a Split,
    frame: Frame,
    /// The displacement a of the bubble by a unit displacement of each node along x and y.
    bubble: [[f64; 16]; 2],
    /// The coefficients of the projected dilatation θ̄ by a unit displacement of each node along x and y.
    dilatation: [[f64; 16]; 3],
}

/// Strain and dilatation at one place of an element, as linear functions of the displacements of its nodes.
pub(super) struct OfNodesAt<'a> {
    split: &'a Split,
    /// The strain, including the bubble's part.
    strain: [[f64; 16]; COMPONENTS],
    /// The projected dilatation θ̄.
    projected: [f64; 16],
}

impl<'a> OfNodes<'a> {
    pub(super) fn new(element: &Mixed<'a>) -> Self {
        let b = 2 * element.nodes;
        let (mut bubble, mut dilatation) = ([[0.0; 16]; 2], [[0.0; 16]; 3]);
        for j in 0..b {
            let own = element.bubble_from(&element.bubble.map(|row| -row[j]));
            (0..2).for_each(|p| bubble[p][j] = own[p]);
            for (all, g) in dilatation.iter_mut().zip(&element.dilatation) {
                all[j] = g[j] + g[b] * own[0] + g[b + 1] * own[1];
            }
        }
        OfNodes {
            split: element.split,
            frame: element.frame,
            bubble,
            dilatation,
        }
    }

    /// The strain and dilatation at a place in master coordinates, which is mapped to `m`; `nodes`: the positions of
    /// the element's nodes.
    #[inline(always)]
    pub(super) fn at(
        &self,
        section: &Section,
        (family, nodes): (Family, &AtNodes<[f64; 2]>),
        m: &Mapped,
        place: [f64; 2],
    ) -> OfNodesAt<'a> {
        let mut strain = [[0.0; 16]; COMPONENTS];
        for i in 0..8 {
            let b = section.strain(m.shape[i], m.gradient[i], m.x);
            for (strain, b) in strain.iter_mut().zip(b) {
                (strain[2 * i], strain[2 * i + 1]) = (b[0], b[1]);
            }
        }
        let (shape, gradient) = bubble(family, m, place);
        let b = section.strain(shape, gradient, m.x);
        for (strain, b) in strain.iter_mut().zip(b) {
            (0..16).for_each(|j| strain[j] += b[0] * self.bubble[0][j] + b[1] * self.bubble[1][j]);
        }
        let psi = self.frame.functions(position(m, nodes));
        OfNodesAt {
            split: self.split,
            strain,
            projected: std::array::from_fn(|j| {
                (0..3).map(|k| psi[k] * self.dilatation[k][j]).sum()
            }),
        }
    }
}

impl OfNodesAt<'_> {
    /// The components of the stress, as linear functions of the displacements of the nodes.
    #[inline(always)]
    pub(super) fn stress(&self) -> [[f64; 16]; COMPONENTS] {
        std::array::from_fn(|c| {
            let mut unit = [0.0; COMPONENTS];
            unit[c] = 1.0;
            self.sum(&unit, 0.0)
        })
    }

    /// The linear function `stress` : σ + `gap` (θ̄ − div u).
    #[inline(always)]
    pub(super) fn sum(&self, stress: &[f64; COMPONENTS], gap: f64) -> [f64; 16] {
        let Split { rest, bulk, .. } = self.split;
        let mut of_strain: [f64; COMPONENTS] =
            std::array::from_fn(|d| (0..COMPONENTS).map(|c| stress[c] * rest[c][d]).sum());
        NORMAL.iter().for_each(|c| of_strain[*c] -= gap);
        let of_projected = bulk * dilatation(stress) + gap;
        std::array::from_fn(|j| {
            let strain = (0..COMPONENTS).map(|d| of_strain[d] * self.strain[d][j]);
            strain.sum::<f64>() + of_projected * self.projected[j]
        })
    }
}

/// Adds the part ∫ Bᵀ R B of one integration point to the row for displacement `p` of node `i`, up to that node.
fn add_row(
    split: &Split,
    weight: f64,
    strains: &Strains,
    i: usize,
    p: usize,
    row: &mut [f64; SIZE],
) {
    let strain = std::array::from_fn(|c| weight * strains[i][c][p]);
    let stress = stress(&split.rest, &strain);
    for (j, b) in strains[..=i].iter().enumerate() {
        for q in 0..2 {
            row[2 * j + q] += (0..COMPONENTS).map(|c| b[c][q] * stress[c]).sum::<f64>();
        }
    }
}

/// The dilatation ε_xx + ε_yy + ε_zz.
pub(super) fn dilatation(strain: &[f64; COMPONENTS]) -> f64 {
    NORMAL.iter().map(|c| strain[*c]).sum()
}

/// The bubble function at a place, and its derivatives by x and y.
fn bubble(family: Family, m: &Mapped, place: [f64; 2]) -> (f64, [f64; 2]) {
    let (value, [p, q]) = family.bubble(place);
    let [xi, eta] = m.master_gradients(family);
    (value, [0, 1].map(|d| p * xi[d] + q * eta[d]))
}

/// The position (x, y) of a mapped place.
pub(super) fn position(m: &Mapped, nodes: &AtNodes<[f64; 2]>) -> [f64; 2] {
    [m.x, (0..8).map(|i| m.shape[i] * nodes[i][1]).sum()]
}

/// The inverse L⁻¹ of the lower Cholesky factor of M = L Lᵀ.
fn inverse_of_root(m: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let a = m[0][0].sqrt();
    let (b, c) = (m[1][0] / a, m[2][0] / a);
    let d = (m[1][1] - b * b).sqrt();
    let e = (m[2][1] - b * c) / d;
    let f = (m[2][2] - c * c - e * e).sqrt();
    [
        [1.0 / a, 0.0, 0.0],
        [-b / (a * d), 1.0 / d, 0.0],
        [(b * e - c * d) / (a * d * f), -e / (d * f), 1.0 / f],
    ]
}

fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn dot2(a: &[f64; 2], b: &[f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::elasticity::isotropic;
    use crate::problem::Analysis;

    const QUAD: [[f64; 2]; 8] = [
        [1.0, 0.0],
        [2.0, 0.1],
        [2.2, 1.0],
        [1.0, 0.9],
        [1.5, 0.0],
        [2.1, 0.6],
        [1.6, 1.0],
        [0.95, 0.45],
    ];

    fn section(analysis: Analysis, nu: f64) -> Section {
        Section::uniform(analysis, isotropic(&analysis, 1000.0, nu))
    }

    #[test]
    fn the_pressures_functions_are_orthonormal_in_elements_of_any_shape() {
        // 1000 times as long as wide, and turned
        let thin = QUAD.map(|[x, y]| {
            let (a, b) = (1000.0 * x, y);
            [1e4 + 0.8 * a - 0.6 * b, 0.6 * a + 0.8 * b]
        });
        for nodes in [QUAD, thin] {
            for (family, analysis) in [
                (Family::Quad, Analysis::PlaneStrain {}),
                (Family::Quad, Analysis::Axisymmetric {}),
                (Family::Triangle, Analysis::PlaneStrain {}),
            ] {
                let mut nodes = nodes;
                if family == Family::Triangle {
                    let middle =
                        |a: usize, b: usize| [0, 1].map(|c| 0.5 * (nodes[a][c] + nodes[b][c]));
                    (nodes[3], nodes[4], nodes[5]) = (middle(0, 1), middle(1, 2), middle(2, 0));
                }
                let section = section(analysis, 0.499);
                let split = section.split(0).unwrap();
                let element = Mixed::new(&section, split, family, &nodes);
                for i in 0..3 {
                    for j in 0..3 {
                        let sum: f64 = Mixed::rule(family)
                            .iter()
                            .map(|point| {
                                let m = family.map(&nodes, point.place);
                                let weight = point.weight * m.det * section.depth(m.x);
                                let at = position(&m, &nodes);
                                let unit = |k: usize| {
                                    let mut c = [0.0; 3];
                                    c[k] = 1.0;
                                    element.frame.combine(&c, at)
                                };
                                weight * unit(i) * unit(j)
                            })
                            .sum();
                        let expected = f64::from(u8::from(i == j));
                        assert!((sum - expected).abs() < 1e-9, "{family:?} {i} {j}: {sum}");
                    }
                }
            }
        }
    }

    /// The displacement of the bubble minimises the element's energy.
    #[test]
    fn the_bubble_minimises_the_energy() {
        let section = section(Analysis::PlaneStrain {}, 0.4999);
        let element = Mixed::new(&section, section.split(0).unwrap(), Family::Quad, &QUAD);
        let u = QUAD.map(|[x, y]| [0.01 * x * y + 0.003 * y * y, -0.02 * x * x]);
        let body_force = BodyForce {
            constant: [3.0, -5.0],
            ..BodyForce::default()
        };
        let force = element.force_on_bubble(&body_force, 0);
        let inside = element.inside(&u, &force, &[0.0; 3]);
        for p in 0..2 {
            let mut residual = force[p]
                - dot2(
                    &[element.bubble[p][16], element.bubble[p][17]],
                    &inside.bubble,
                );
            let mut size = force[p].abs();
            for (i, u) in u.iter().enumerate() {
                for q in 0..2 {
                    residual -= element.bubble[p][2 * i + q] * u[q];
                    size += (element.bubble[p][2 * i + q] * u[q]).abs();
                }
            }
            assert!(residual.abs() < 1e-13 * size, "{residual:e} of {size:e}");
        }
    }
}
