//! The part of element integrals that depends on the shape alone, computed once for all elements of the same shape.

use crate::elasticity::Section;
use crate::elasticity::material::{COMPONENTS, Moduli};
use crate::elasticity::shapes::{Shape, Shapes};
use crate::element::{AtNodes, Family, GaussPoint, Tabulated};
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
    fn new(section: &Section, place: &Tabulated, weight: f64, nodes: &AtNodes<[f64; 2]>) -> Self {
        let m = place.map(nodes);
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

/// The stations of an element: its integration points and its superconvergent points.
#[derive(Clone, Debug)]
pub(super) struct Stations {
    /// Stations at the integration points.
    pub(super) rule: Vec<Station>,
    /// Stations at the superconvergent points.
    pub(super) stress: Vec<Station>,
    /// The weights of the superconvergent points in the linear extrapolation to each node; zero for the two entries
    /// that a triangle has no nodes for.
    pub(super) to_nodes: AtNodes<[f64; 4]>,
}

/// The places of stations on the master elements, for each family.
pub(super) struct Masters {
    families: [Master; 2],
}

struct Master {
    rule: Vec<(Tabulated, f64)>,
    stress: Vec<(Tabulated, f64)>,
    to_nodes: AtNodes<[f64; 4]>,
}

impl Master {
    fn new(family: Family, quadrature: u32) -> Self {
        let tabulate = |points: &[GaussPoint]| {
            let point = |point: &GaussPoint| (family.tabulate(point.place), point.weight);
            points.iter().map(point).collect()
        };
        let mut to_nodes = [[0.0; 4]; 8];
        for (weights, place) in to_nodes.iter_mut().zip(family.places()) {
            *weights = family.from_stress_points(*place);
        }
        Master {
            rule: tabulate(family.rule(quadrature)),
            stress: tabulate(family.stress_points()),
            to_nodes,
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

    /// The stations of elements of one shape.
    fn stations(&self, section: &Section, shape: &Shape) -> Stations {
        let master = self.of(shape.family);
        let at = |places: &[(Tabulated, f64)]| {
            let station = |(place, weight): &(Tabulated, f64)| {
                Station::new(section, place, *weight, &shape.nodes)
            };
            places.iter().map(station).collect()
        };
        Stations {
            rule: at(&master.rule),
            stress: at(&master.stress),
            to_nodes: master.to_nodes,
        }
    }

    /// The stiffness of elements of one shape, along x and y.
    pub(super) fn stiffness(&self, section: &Section, shape: &Shape) -> [[f64; 16]; 16] {
        let moduli = &section.materials()[usize::from(shape.material)];
        let master = self.of(shape.family);
        let mut k = [[[[0.0; 8]; 2]; 2]; 8];
        for (place, weight) in &master.rule {
            let station = Station::new(section, place, *weight, &shape.nodes);
            pulp::Arch::new().dispatch(|| add_stiffness(&station, moduli, &mut k));
        }
        symmetric(&k)
    }
}

/// The stiffness matrix with rows and columns ordered by node, then direction, made exactly symmetric: the triangles of
/// `k` may differ by rounding.
fn symmetric(k: &[[[[f64; 8]; 2]; 2]; 8]) -> [[f64; 16]; 16] {
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

/// Adds weight Bᵀ D B to k_ij; `k` is ordered by node and direction of i, then by direction and node of j, so that
/// eight values are computed at once.
#[inline(always)]
fn add_stiffness(station: &Station, moduli: &Moduli, k: &mut [[[[f64; 8]; 2]; 2]; 8]) {
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

/// The tables that are computed once for all elements of the same shape.
pub struct ElementTables {
    /// The number of Gauss points, as in `assemble_element`.
    pub quadrature: u32,
    pub(super) shapes: Shapes,
    pub(super) masters: Masters,
    /// The stations of every shape that several elements share.
    stations: Vec<Stations>,
}

impl ElementTables {
    /// The tables for the elements of `mesh`; `quadrature` as in `assemble_element`.
    pub fn new(mesh: &Mesh, section: &Section, quadrature: u32) -> Self {
        let (shapes, masters) = (Shapes::new(mesh, section), Masters::new(quadrature));
        let stations = |shape| masters.stations(section, shape);
        ElementTables {
            stations: shapes.shared.iter().map(stations).collect(),
            quadrature,
            shapes,
            masters,
        }
    }

    /// The elements of the mesh and section that the tables were made for.
    pub fn elements<'a>(&'a self, mesh: &'a Mesh, section: &'a Section) -> Elements<'a> {
        Elements {
            mesh,
            section,
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
    /// The tables for this mesh and section.
    pub tables: &'a ElementTables,
}

impl<'a> Elements<'a> {
    pub(super) fn stations(self) -> MeshStations<'a> {
        MeshStations {
            elements: self,
            own: None,
        }
    }
}

/// The stations of a mesh's elements.
pub(super) struct MeshStations<'a> {
    elements: Elements<'a>,
    /// The stations of the last element that has a unique shape.
    own: Option<Stations>,
}

impl MeshStations<'_> {
    /// The stations of an element.
    pub(super) fn of(&mut self, e: usize) -> &Stations {
        let Elements {
            mesh,
            section,
            tables,
            ..
        } = self.elements;
        match tables.shapes.of(e) {
            Some(shape) => &tables.stations[shape],
            None => {
                let shape = Shape::of(mesh, section, e);
                self.own.insert(tables.masters.stations(section, &shape))
            }
        }
    }
}
