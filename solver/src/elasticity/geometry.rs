//! The part of element integrals that depends on the shape alone, computed once for all elements of the same shape.

use crate::elasticity::material::{COMPONENTS, Moduli};
use crate::elasticity::shapes::{Shape, Shapes};
use crate::elasticity::{Section, Springs};
use crate::element::{AtNodes, Family, GaussPoint, Jacobian, Tabulated};
use crate::mesh::Mesh;

/// Shape functions, derivatives and weight at one place of an element, which give the strain from the nodes (rows of
/// B).
#[derive(Clone, Debug)]
pub(super) struct Station {
    /// The shape functions h_i.
    pub(super) shape: AtNodes<f64>,
    /// The derivatives dh_i/dx.
    pub(super) dx: AtNodes<f64>,
    /// The derivatives dh_i/dy.
    pub(super) dy: AtNodes<f64>,
    /// The coefficients of the hoop strain: h_i / r in axisymmetry, else 0.
    pub(super) hoop: AtNodes<f64>,
    /// The weight of the place: weight of the rule × det J × depth.
    pub(super) weight: f64,
}

impl Station {
    /// `affine`: the derivatives of the element's map, if they are the same everywhere.
    #[inline(always)]
    fn new(
        section: &Section,
        (place, weight): &(Tabulated, f64),
        nodes: &AtNodes<[f64; 2]>,
        affine: Option<&Jacobian>,
    ) -> Self {
        let m = match affine {
            Some(jacobian) => place.map_with(jacobian, nodes),
            None => place.map(nodes),
        };
        let hoop = if section.axisymmetric() {
            m.shape.map(|h| h / m.x)
        } else {
            [0.0; 8]
        };
        Station {
            shape: m.shape,
            dx: m.gradient.map(|[x, _]| x),
            dy: m.gradient.map(|[_, y]| y),
            hoop,
            weight: weight * m.det * section.depth(m.x),
        }
    }

    /// The strain where the nodes are displaced by `ux` and `uy`.
    #[inline(always)]
    pub(super) fn strain(&self, ux: &AtNodes<f64>, uy: &AtNodes<f64>) -> [f64; COMPONENTS] {
        let mut strain = [0.0; COMPONENTS];
        for i in 0..8 {
            strain[0] += self.dx[i] * ux[i];
            strain[1] += self.dy[i] * uy[i];
            strain[2] += self.dy[i] * ux[i] + self.dx[i] * uy[i];
            strain[3] += self.hoop[i] * ux[i];
        }
        strain
    }

    /// Adds `factor` Bᵀ σ to the forces on the nodes.
    #[inline(always)]
    pub(super) fn add_force(
        &self,
        factor: f64,
        stress: &[f64; COMPONENTS],
        fx: &mut AtNodes<f64>,
        fy: &mut AtNodes<f64>,
    ) {
        let [xx, yy, xy, zz] = stress.map(|s| factor * s);
        for i in 0..8 {
            fx[i] += self.dx[i] * xx + self.dy[i] * xy + self.hoop[i] * zz;
            fy[i] += self.dy[i] * yy + self.dx[i] * xy;
        }
    }
}

/// A set of places of an element.
#[derive(Clone, Copy, Debug)]
pub(super) enum Points {
    /// The integration points.
    Rule,
    /// The superconvergent points.
    Stress,
}

/// The places of stations on the master elements, for each family.
pub(super) struct Masters {
    families: [Master; 2],
}

struct Master {
    /// The places of each set of points, with the weights of the rule.
    points: [Vec<(Tabulated, f64)>; 2],
    /// Σ w ∂h_i/∂ξ_p ∂h_j/∂ξ_q over the integration points, by p, q and i: the stiffness of elements with an affine map
    /// is a combination of these.
    products: [[AtNodes<AtNodes<f64>>; 2]; 2],
    to_nodes: AtNodes<[f64; 4]>,
}

impl Master {
    fn new(family: Family, quadrature: u32) -> Self {
        let tabulate = |points: &[GaussPoint]| -> Vec<(Tabulated, f64)> {
            let point = |point: &GaussPoint| (family.tabulate(point.place), point.weight);
            points.iter().map(point).collect()
        };
        let rule = tabulate(family.rule(quadrature));
        let mut products = [[[[0.0; 8]; 8]; 2]; 2];
        for (place, weight) in &rule {
            for (p, products) in products.iter_mut().enumerate() {
                for (q, products) in products.iter_mut().enumerate() {
                    for (row, di) in products.iter_mut().zip(place.derivative()) {
                        for (product, dj) in row.iter_mut().zip(place.derivative()) {
                            *product += weight * di[p] * dj[q];
                        }
                    }
                }
            }
        }
        let mut to_nodes = [[0.0; 4]; 8];
        for (weights, place) in to_nodes.iter_mut().zip(family.places()) {
            *weights = family.from_stress_points(*place);
        }
        Master {
            points: [rule, tabulate(family.stress_points())],
            products,
            to_nodes,
        }
    }

    /// Adds the stiffness of an element in the plane with an affine map, for displacements of node i along x_a and of
    /// node j along x_c:
    ///
    ///   k_ij^ac = det J × depth × Σ_pq (Σ_bd ∂ξ_p/∂x_b D_ab,cd ∂ξ_q/∂x_d) Σ w ∂h_i/∂ξ_p ∂h_j/∂ξ_q
    #[inline(always)]
    fn add_affine(&self, jacobian: &Jacobian, depth: f64, moduli: &Moduli, k: &mut Stiffness) {
        // the component of the strain that a displacement along a, differentiated by b, is part of
        const STRAIN: [[usize; 2]; 2] = [[0, 2], [2, 1]];
        let gradients = jacobian.inverse;
        for (a, of_a) in STRAIN.iter().enumerate() {
            for (c, of_c) in STRAIN.iter().enumerate() {
                for (p, products) in self.products.iter().enumerate() {
                    for (q, products) in products.iter().enumerate() {
                        let mut factor = 0.0;
                        for b in 0..2 {
                            for d in 0..2 {
                                factor +=
                                    gradients[p][b] * moduli[of_a[b]][of_c[d]] * gradients[q][d];
                            }
                        }
                        factor *= jacobian.det * depth;
                        for (k, products) in k.iter_mut().zip(products) {
                            (0..8).for_each(|j| k[a][c][j] += factor * products[j]);
                        }
                    }
                }
            }
        }
    }
}

impl Masters {
    /// Tabulates the master elements for a number of Gauss points; `quadrature` as in `assemble_element`.
    pub(super) fn new(quadrature: u32) -> Self {
        Masters {
            families: [Family::Quad, Family::Triangle].map(|f| Master::new(f, quadrature)),
        }
    }

    fn of(&self, family: Family) -> &Master {
        &self.families[family as usize]
    }

    /// The weights of the superconvergent points in the linear extrapolation to each node; zero for the two entries
    /// that a triangle has no nodes for.
    pub(super) fn to_nodes(&self, family: Family) -> &AtNodes<[f64; 4]> {
        &self.of(family).to_nodes
    }

    /// Writes the stations of elements of one shape.
    fn put_stations(
        &self,
        section: &Section,
        shape: &Shape,
        points: Points,
        stations: &mut Vec<Station>,
    ) {
        stations.clear();
        let places = &self.of(shape.family).points[points as usize];
        let affine = shape.affine();
        pulp::Arch::new().dispatch(|| {
            for place in places {
                stations.push(Station::new(section, place, &shape.nodes, affine.as_ref()));
            }
        });
    }

    /// The stiffness of elements of one shape, along x and y.
    pub(super) fn stiffness(&self, section: &Section, shape: &Shape) -> [[f64; 16]; 16] {
        let moduli = &section.materials()[usize::from(shape.material)];
        let master = self.of(shape.family);
        let mut k = [[[[0.0; 8]; 2]; 2]; 8];
        let affine = shape.affine();
        pulp::Arch::new().dispatch(|| match &affine {
            Some(jacobian) if !section.axisymmetric() => {
                master.add_affine(jacobian, section.depth(0.0), moduli, &mut k);
            }
            affine => {
                for place in &master.points[Points::Rule as usize] {
                    let station = Station::new(section, place, &shape.nodes, affine.as_ref());
                    add_stiffness(&station, moduli, &mut k);
                }
            }
        });
        symmetric(&k)
    }
}

/// The stiffness of an element by node and direction of i, then by direction and node of j, so that eight values are
/// computed at once.
type Stiffness = [[[[f64; 8]; 2]; 2]; 8];

/// The stiffness matrix with rows and columns ordered by node, then direction, made exactly symmetric: the triangles of
/// `k` may differ by rounding.
fn symmetric(k: &Stiffness) -> [[f64; 16]; 16] {
    let mut whole = [[0.0; 16]; 16];
    for row in 0..16 {
        for column in 0..=row {
            let value = k[row / 2][row % 2][column % 2][column / 2];
            whole[row][column] = value;
            whole[column][row] = value;
        }
    }
    whole
}

/// Adds weight Bᵀ D B to k_ij.
#[inline(always)]
fn add_stiffness(station: &Station, moduli: &Moduli, k: &mut Stiffness) {
    let Station {
        dx,
        dy,
        hoop,
        weight,
        ..
    } = station;
    // stresses of unit displacements along x and y, times the weight
    let mut stress = [[[0.0; 8]; COMPONENTS]; 2];
    for (c, row) in moduli.iter().enumerate() {
        let [xx, yy, xy, zz] = row.map(|d| weight * d);
        for j in 0..8 {
            stress[0][c][j] = xx * dx[j] + xy * dy[j] + zz * hoop[j];
            stress[1][c][j] = yy * dy[j] + xy * dx[j];
        }
    }
    for i in 0..8 {
        for (q, stress) in stress.iter().enumerate() {
            let [xx, yy, xy, zz] = stress;
            for j in 0..8 {
                k[i][0][q][j] += dx[i] * xx[j] + dy[i] * xy[j] + hoop[i] * zz[j];
                k[i][1][q][j] += dy[i] * yy[j] + dx[i] * xy[j];
            }
        }
    }
}

/// The largest number of integration points of an element.
pub(super) const MOST_POINTS: usize = 9;

/// The tables that are computed once for all elements of the same shape.
pub struct ElementTables {
    /// The number of Gauss points, as in `assemble_element`.
    pub quadrature: u32,
    pub(super) shapes: Shapes,
    pub(super) masters: Masters,
    /// The stations of every shape that several elements share, for each set of points.
    stations: Vec<[Vec<Station>; 2]>,
}

impl ElementTables {
    /// The tables for the elements of `mesh`; `quadrature` as in `assemble_element`.
    pub fn new(mesh: &Mesh, section: &Section, quadrature: u32) -> Self {
        let (shapes, masters) = (Shapes::new(mesh, section), Masters::new(quadrature));
        let stations = |shape| {
            [Points::Rule, Points::Stress].map(|points| {
                let mut stations = Vec::new();
                masters.put_stations(section, shape, points, &mut stations);
                stations
            })
        };
        ElementTables {
            stations: shapes.shared.iter().map(stations).collect(),
            quadrature,
            shapes,
            masters,
        }
    }

    /// The elements of the mesh and section that the tables were made for, with the springs of the body.
    pub fn elements<'a>(
        &'a self,
        mesh: &'a Mesh,
        section: &'a Section,
        springs: &'a Springs,
    ) -> Elements<'a> {
        Elements {
            mesh,
            section,
            springs,
            tables: self,
        }
    }
}

/// The elements of a mesh, with their materials and tables.
#[derive(Clone, Copy)]
pub struct Elements<'a> {
    /// The nodes of the elements.
    pub mesh: &'a Mesh,
    /// The materials of the elements.
    pub section: &'a Section,
    /// The springs between the body and the ground.
    pub springs: &'a Springs,
    /// The tables for this mesh and section.
    pub tables: &'a ElementTables,
}

impl<'a> Elements<'a> {
    pub(super) fn stations(self) -> MeshStations<'a> {
        MeshStations {
            elements: self,
            own: Vec::with_capacity(MOST_POINTS),
        }
    }
}

/// The stations of a mesh's elements.
pub(super) struct MeshStations<'a> {
    elements: Elements<'a>,
    /// Stations of the last element that has a unique shape.
    own: Vec<Station>,
}

impl MeshStations<'_> {
    /// The stations of an element at a set of its points.
    pub(super) fn of(&mut self, e: usize, points: Points) -> &[Station] {
        let Elements {
            mesh,
            section,
            tables,
            ..
        } = self.elements;
        match tables.shapes.of(e) {
            Some(shape) => &tables.stations[shape][points as usize],
            None => {
                let shape = Shape::of(mesh, section, e);
                let masters = &tables.masters;
                masters.put_stations(section, &shape, points, &mut self.own);
                &self.own
            }
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::elasticity::isotropic;
    use crate::problem::Analysis;

    /// A triangle with straight sides and a parallelogram, away from the origin, with midside nodes in the middle up to
    /// rounding.
    fn affine(family: Family) -> AtNodes<[f64; 2]> {
        let mut nodes = [[0.0; 2]; 8];
        for (node, [xi, eta]) in nodes.iter_mut().zip(family.places()) {
            *node = [7.1 + 0.3 * xi - 0.11 * eta, -3.3 + 0.07 * xi + 0.9 * eta];
        }
        nodes
    }

    /// What an affine map makes equal everywhere is computed once: stiffness and stations are those of the general map.
    #[test]
    fn elements_with_an_affine_map_have_the_integrals_of_the_general_map() {
        let analyses = [
            Analysis::PlaneStrain {},
            Analysis::PlaneStress { thickness: 0.7 },
            Analysis::Axisymmetric {},
        ];
        for (analysis, quadrature) in analyses.iter().flat_map(|a| [(a, 2), (a, 3)]) {
            let mut moduli = isotropic(analysis, 1000.0, 0.3);
            // as of a turned orthotropic material
            for (a, b, coupling) in [(0, 2, 37.0), (1, 2, -21.0)] {
                (moduli[a][b], moduli[b][a]) = (coupling, coupling);
            }
            let section = Section::uniform(*analysis, moduli);
            let masters = Masters::new(quadrature);
            for family in [Family::Quad, Family::Triangle] {
                let shape = Shape::new(family, &affine(family), &section, 0);
                assert!(shape.affine().is_some(), "{family:?}");
                let mut k = [[[[0.0; 8]; 2]; 2]; 8];
                for place in &masters.of(family).points[Points::Rule as usize] {
                    let general = Station::new(&section, place, &shape.nodes, None);
                    add_stiffness(&general, &section.materials()[0], &mut k);
                }
                let (own, general) = (masters.stiffness(&section, &shape), symmetric(&k));
                let size = general.iter().flatten().fold(0.0f64, |m, k| m.max(k.abs()));
                for (a, b) in own.iter().flatten().zip(general.iter().flatten()) {
                    let apart = (a - b).abs() / size;
                    assert!(
                        apart < 1e-14,
                        "{analysis:?} {quadrature} {family:?}: {apart}"
                    );
                }
                for points in [Points::Rule, Points::Stress] {
                    let mut stations = Vec::new();
                    masters.put_stations(&section, &shape, points, &mut stations);
                    let places = &masters.of(family).points[points as usize];
                    assert_eq!(stations.len(), places.len());
                    for (own, place) in stations.iter().zip(places) {
                        let general = Station::new(&section, place, &shape.nodes, None);
                        let numbers = |s: &Station| [s.dx, s.dy, s.hoop, [s.weight; 8]];
                        for (a, b) in numbers(own).iter().zip(numbers(&general)) {
                            let size = b.iter().fold(0.0f64, |m, b| m.max(b.abs()));
                            let mut pairs = a.iter().zip(b);
                            let near = pairs.all(|(a, b)| (a - b).abs() <= 1e-13 * size);
                            assert!(near, "{family:?}: {a:?} {b:?}");
                        }
                    }
                }
            }
        }
    }

    /// A midside node that is off the middle by more than rounding, a trapezoid, and an element so thin that rounding
    /// matters are integrated by the general map.
    #[test]
    fn only_what_is_affine_up_to_rounding_is_taken_for_it() {
        let analysis = Analysis::PlaneStrain {};
        let section = Section::uniform(analysis, isotropic(&analysis, 1000.0, 0.3));
        let is_affine = |family, nodes: &AtNodes<[f64; 2]>| {
            Shape::new(family, nodes, &section, 0).affine().is_some()
        };
        for family in [Family::Quad, Family::Triangle] {
            for (node, off, expected) in [(4, 1e-15, true), (4, 1e-13, false), (2, 1e-12, false)] {
                let mut nodes = affine(family);
                nodes[node][1] += off;
                assert_eq!(
                    is_affine(family, &nodes),
                    expected,
                    "{family:?} {node} {off}"
                );
            }
            let mut thin = affine(family).map(|[x, y]| [x, 1e-9 * (y + 3.3) - 3.3]);
            thin[4][1] += 1e-15;
            assert!(!is_affine(family, &thin), "{family:?}");
        }
        let mut trapezoid = affine(Family::Quad);
        for (node, by) in [(2, 0.1), (5, 0.05), (6, 0.05)] {
            trapezoid[node][0] += by;
        }
        assert!(!is_affine(Family::Quad, &trapezoid));
    }
}
