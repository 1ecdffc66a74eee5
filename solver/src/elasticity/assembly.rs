//! The stiffness and loads of elements on the unknowns of a body, thesis (2.18), (2.20), (2.27), (2.28).

use std::collections::HashMap;

use serde::Serialize;

use crate::elasticity::Section;
use crate::elasticity::body_force::BodyForce;
use crate::elasticity::geometry::{Elements, Masters};
use crate::elasticity::material::{COMPONENTS, stress};
use crate::elasticity::mixed::{Mixed, position};
use crate::elasticity::shapes::Shape;
use crate::elasticity::thermal::{Thermal, ThermalStrain};
use crate::element::gauss::GAUSS_3;
use crate::element::{AtNodes, Element, Family, edge3};
use crate::linear::ElementMatrix;
use crate::mesh::{Edge, Mesh};

/// One component of the displacement of a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Dof {
    /// The component is unknown: its number in the system.
    Free(usize),
    /// The component is prescribed: its value (length).
    Fixed(f64),
}

/// The axes of a node's two displacement components.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axes {
    /// The unit vectors along which the displacement is measured.
    pub along: [[f64; 2]; 2],
    /// The displacement vectors for which one component is 1 and the other 0: equal to `along` if the vectors of
    /// `along` are perpendicular, otherwise their dual basis. Components of a force are taken along `moves`.
    pub moves: [[f64; 2]; 2],
}

impl Axes {
    /// Axes along perpendicular unit vectors.
    pub fn perpendicular(along: [[f64; 2]; 2]) -> Self {
        Axes {
            along,
            moves: along,
        }
    }

    /// Axes along unit vectors that are not parallel.
    pub fn oblique(along: [[f64; 2]; 2]) -> Self {
        let [[a, b], [c, d]] = along;
        let det = a * d - b * c;
        Axes {
            along,
            moves: [[d / det, -c / det], [-b / det, a / det]],
        }
    }
}

/// Which displacements are unknown, and along which axes each node's two components are measured.
#[derive(Clone, Debug)]
pub struct DofMap {
    /// The two components of every node.
    pub dofs: Vec<[Dof; 2]>,
    /// The axes of the two components of every node; `None` where they are x and y.
    pub axes: Vec<Option<Axes>>,
    /// The number of unknowns.
    pub unknowns: usize,
}

impl DofMap {
    /// The displacements of every node along x and y, from the unknown components and from `supports` times the
    /// prescribed ones.
    pub fn displacements(&self, unknown: impl Fn(usize) -> f64, supports: f64) -> Vec<[f64; 2]> {
        let node = |(dofs, axes): (&[Dof; 2], &Option<Axes>)| {
            let [a, b] = dofs.map(|dof| match dof {
                Dof::Free(i) => unknown(i),
                Dof::Fixed(value) => supports * value,
            });
            match axes {
                None => [a, b],
                Some(axes) => {
                    let [n, t] = axes.moves;
                    [n[0] * a + t[0] * b, n[1] * a + t[1] * b]
                }
            }
        };
        self.dofs.iter().zip(&self.axes).map(node).collect()
    }

    /// The displacements of every node along x and y for several fields at once; prescribed components count as 0.
    pub fn displacements_together<const FIELDS: usize>(
        &self,
        unknowns: &[[f64; FIELDS]],
    ) -> Vec<[[f64; FIELDS]; 2]> {
        let node = |(dofs, axes): (&[Dof; 2], &Option<Axes>)| {
            let [a, b] = dofs.map(|dof| match dof {
                Dof::Free(i) => unknowns[i],
                Dof::Fixed(_) => [0.0; FIELDS],
            });
            let Some(axes) = axes else { return [a, b] };
            let [n, t] = axes.moves;
            [0, 1].map(|c| std::array::from_fn(|k| n[c] * a[k] + t[c] * b[k]))
        };
        self.dofs.iter().zip(&self.axes).map(node).collect()
    }

    /// The node that an unknown belongs to, and the direction of the unknown.
    pub fn place_of(&self, unknown: usize) -> (u32, [f64; 2]) {
        let is_it = |dof: &Dof| matches!(dof, Dof::Free(i) if *i == unknown);
        let places = self.dofs.iter().zip(&self.axes).enumerate();
        let found = places.flat_map(|(node, (dofs, axes))| {
            let axes = axes.map_or([[1.0, 0.0], [0.0, 1.0]], |axes| axes.along);
            let free = dofs.iter().zip(axes).filter(|(dof, _)| is_it(dof));
            free.map(move |(_, axis)| (node as u32, axis))
        });
        match found.into_iter().next() {
            Some(place) => place,
            None => unreachable!("every unknown belongs to a node"),
        }
    }

    /// Converts a force on a node along x and y to forces on the node's two components.
    pub fn to_axes(&self, node: usize, [x, y]: [f64; 2]) -> [f64; 2] {
        match self.axes[node] {
            None => [x, y],
            Some(axes) => {
                let [n, t] = axes.moves;
                [n[0] * x + n[1] * y, t[0] * x + t[1] * y]
            }
        }
    }
}

/// Element stiffness k_ij = ∫ B_iᵀ D B_j, along x and y; 16 × 16, symmetric. The last four rows and columns of a
/// triangle are zero.
///
/// `material`: the number of the material in the section; a nearly incompressible one has the element of [`Mixed`],
/// with the full rule. `quadrature`: with 3 only the rigid modes have no stiffness; with 2 a quadrilateral has another
/// mode without stiffness, which its neighbours may or may not suppress.
pub fn assemble_element(
    family: Family,
    nodes: &[[f64; 2]; 8],
    section: &Section,
    material: usize,
    quadrature: u32,
) -> [[f64; 16]; 16] {
    let shape = Shape::new(family, nodes, section, material);
    stiffness(&Masters::new(quadrature), section, &shape)
}

/// The stiffness of elements of one shape, along x and y.
fn stiffness(masters: &Masters, section: &Section, shape: &Shape) -> [[f64; 16]; 16] {
    match section.split(usize::from(shape.material)) {
        Some(split) => Mixed::stiffness(section, split, shape.family, &shape.nodes),
        None => masters.stiffness(section, shape),
    }
}

/// The stiffness of a body's elements on the unknowns of the body.
pub struct ElementStiffness<'a> {
    elements: Elements<'a>,
    map: &'a DofMap,
    /// The matrices of the shapes that several elements share.
    of_shapes: Vec<[[f64; 16]; 16]>,
}

impl<'a> ElementStiffness<'a> {
    /// The stiffness of `elements` on the unknowns of `map`.
    pub fn new(elements: Elements<'a>, map: &'a DofMap) -> Self {
        let (tables, section) = (elements.tables, elements.section);
        let of_shape = |shape| stiffness(&tables.masters, section, shape);
        ElementStiffness {
            of_shapes: tables.shapes.shared.iter().map(of_shape).collect(),
            elements,
            map,
        }
    }

    /// Writes the matrix of an element to `matrix`.
    pub fn put(&self, e: u32, matrix: &mut ElementMatrix) {
        let Elements {
            mesh,
            section,
            springs,
            tables,
        } = self.elements;
        let (map, element) = (self.map, &mesh.elements[e as usize]);
        matrix.entries = match tables.shapes.of(e as usize) {
            Some(shape) => self.of_shapes[shape],
            None => {
                let shape = Shape::of(mesh, section, e as usize);
                stiffness(&tables.masters, section, &shape)
            }
        };
        let k = &mut matrix.entries;
        springs.add_to(e as usize, k);
        matrix.unknowns = [None; 16];
        for (i, &node) in element.iter().enumerate() {
            if let Some(axes) = map.axes[node as usize] {
                rotate(k, i, axes.moves);
            }
            for (a, dof) in map.dofs[node as usize].iter().enumerate() {
                if let Dof::Free(unknown) = *dof {
                    matrix.unknowns[2 * i + a] = Some(unknown as u32);
                }
            }
        }
    }

    /// The forces on the unknowns due to the prescribed displacements u_p, −K_fp u_p.
    pub fn load_of_supports(&self) -> Vec<f64> {
        let (mesh, map) = (self.elements.mesh, self.map);
        let mut load = vec![0.0; map.unknowns];
        let mut matrix = ElementMatrix::default();
        for (e, element) in mesh.elements.iter().enumerate() {
            let mut prescribed = [0.0; 16];
            for (i, &node) in element.iter().enumerate() {
                for (a, dof) in map.dofs[node as usize].iter().enumerate() {
                    if let Dof::Fixed(value) = *dof {
                        prescribed[2 * i + a] = value;
                    }
                }
            }
            if prescribed == [0.0; 16] {
                continue;
            }
            self.put(e as u32, &mut matrix);
            for (unknown, row) in matrix.unknowns.iter().zip(&matrix.entries) {
                if let Some(unknown) = unknown {
                    let force: f64 = row.iter().zip(prescribed).map(|(k, u)| k * u).sum();
                    load[*unknown as usize] -= force;
                }
            }
        }
        load
    }
}

impl Elements<'_> {
    /// A number for each element; elements with the same number have the same matrix on the same unknown components of
    /// their nodes. `None` for an element with a unique shape, or with springs.
    pub fn kinds(self, map: &DofMap) -> Vec<Option<u32>> {
        let (mut known, mut turned) = (HashMap::new(), HashMap::new());
        let mut kind = |(e, element): (usize, &Element)| {
            let shape = self.tables.shapes.of(e).filter(|_| !self.springs.has(e))?;
            let mut key = [shape as u32; 9];
            for (key, &node) in key[1..].iter_mut().zip(element.iter()) {
                let axes = map.axes[node as usize].map(|axes| {
                    let next = turned.len() as u32 + 1;
                    let bits = axes.moves.map(|axis| axis.map(f64::to_bits));
                    *turned.entry(bits).or_insert(next)
                });
                let [a, b] = map.dofs[node as usize].map(|dof| matches!(dof, Dof::Free(_)));
                *key = axes.unwrap_or(0) << 2 | u32::from(a) << 1 | u32::from(b);
            }
            let next = known.len() as u32;
            Some(*known.entry(key).or_insert(next))
        };
        let all = self.mesh.elements.iter();
        all.enumerate().map(&mut kind).collect()
    }
}

/// Turns the rows and columns of node `i` in a stiffness matrix to the node's axes: k ← Q k Qᵀ.
fn rotate(k: &mut [[f64; 16]; 16], i: usize, [n, t]: [[f64; 2]; 2]) {
    let (a, b) = (2 * i, 2 * i + 1);
    for column in 0..16 {
        let (x, y) = (k[a][column], k[b][column]);
        (k[a][column], k[b][column]) = (n[0] * x + n[1] * y, t[0] * x + t[1] * y);
    }
    for row in k.iter_mut() {
        let (x, y) = (row[a], row[b]);
        (row[a], row[b]) = (n[0] * x + n[1] * y, t[0] * x + t[1] * y);
    }
}

/// External forces on a body.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Loads {
    /// Stresses on edges.
    pub edges: Vec<EdgeLoad>,
    /// Forces per volume.
    pub body_force: BodyForce,
    /// Thermal strains.
    pub thermal: Thermal,
    /// Forces at nodes along x and y (without 2π).
    pub nodal: Vec<(u32, [f64; 2])>,
}

/// A stress on an edge, interpolated between start, end and midside.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct EdgeLoad {
    /// The edge that is loaded.
    pub edge: Edge,
    /// The directions of the two components.
    pub axes: LoadAxes,
    /// The two components (stress) at start, end and midside.
    pub values: [[f64; 2]; 3],
}

/// Axes of a stress on an edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum LoadAxes {
    /// x and y.
    Fixed,
    /// The outward normal, and t, the normal turned clockwise.
    Edge,
}

/// Nodal forces along x and y: F_i = ∫ t h_i ds + ∫ f h_i dA, thesis (2.20), (2.28).
pub fn assemble_loads(
    mesh: &Mesh,
    section: &Section,
    quadrature: u32,
    loads: &Loads,
) -> Vec<[f64; 2]> {
    let mut forces = vec![[0.0; 2]; mesh.nodes.len()];
    for load in &loads.edges {
        add_edge_load(mesh, section, load, &mut forces);
    }
    if !loads.body_force.is_zero() {
        for (e, element) in mesh.elements.iter().enumerate() {
            let (family, nodes) = (element.family(), mesh.element_nodes(element));
            let material = section.material_of(e);
            let rule = match section.split(material) {
                Some(_) => Mixed::rule(family),
                None => family.rule(quadrature),
            };
            for point in rule {
                let m = family.map(&nodes, point.place);
                let weight = point.weight * m.det * section.depth(m.x);
                let force = loads.body_force.at(material, position(&m, &nodes));
                for (i, &node) in element.iter().enumerate() {
                    for a in 0..2 {
                        forces[node as usize][a] += weight * m.shape[i] * force[a];
                    }
                }
            }
        }
    }
    for (node, [x, y]) in &loads.nodal {
        forces[*node as usize][0] += x;
        forces[*node as usize][1] += y;
    }
    forces
}

/// Adds the forces of thermal strains, ∫ Bᵀ D ε₀, to those on the nodes, and the effect of these strains and of the body
/// force on the bubbles of nearly incompressible elements: the `forces` of [`assemble_loads`] add up to the load, and
/// become the right-hand side of the stiffness, from which the bubbles are eliminated.
pub fn add_inner_forces(
    mesh: &Mesh,
    section: &Section,
    quadrature: u32,
    loads: &Loads,
    forces: &mut [[f64; 2]],
) {
    let on_bubbles = section.has_split() && !loads.body_force.is_zero();
    if loads.thermal.is_zero() && !on_bubbles {
        return;
    }
    for (e, element) in mesh.elements.iter().enumerate() {
        let material = section.material_of(e);
        let (family, nodes) = (element.family(), mesh.element_nodes(element));
        let thermal = loads.thermal.of_element(element, material, 1.0);
        let own = match (section.split(material), &thermal) {
            (Some(split), _) => {
                let mixed = Mixed::new(section, split, family, &nodes);
                let strain = mixed.thermal(section, family, &nodes, thermal.as_ref());
                mixed.inner_forces(&loads.body_force, material, &strain)
            }
            (None, Some(thermal)) => {
                forces_of_strain(section, material, family, &nodes, quadrature, thermal)
            }
            (None, None) => continue,
        };
        for (&node, own) in element.iter().zip(own) {
            (0..2).for_each(|a| forces[node as usize][a] += own[a]);
        }
    }
}

/// The forces on the nodes of an element that is not nearly incompressible by thermal strains, ∫ Bᵀ D ε₀.
fn forces_of_strain(
    section: &Section,
    material: usize,
    family: Family,
    nodes: &AtNodes<[f64; 2]>,
    quadrature: u32,
    thermal: &ThermalStrain,
) -> AtNodes<[f64; 2]> {
    let mut forces = [[0.0; 2]; 8];
    // the rule of the stiffness: a free body that expands has no stress with any rule
    for point in family.rule(quadrature) {
        let m = family.map(nodes, point.place);
        let weight = point.weight * m.det * section.depth(m.x);
        let stress = stress(&section.materials()[material], &thermal.at(&m.shape));
        for (i, force) in forces.iter_mut().enumerate().take(family.nodes()) {
            let b = section.strain(m.shape[i], m.gradient[i], m.x);
            for (c, s) in stress.iter().enumerate().take(COMPONENTS) {
                (0..2).for_each(|a| force[a] += weight * b[c][a] * s);
            }
        }
    }
    forces
}

fn add_edge_load(mesh: &Mesh, section: &Section, load: &EdgeLoad, forces: &mut [[f64; 2]]) {
    let nodes = mesh.edge_nodes(&load.edge);
    for (xi, w) in GAUSS_3 {
        let (h, ([x, _], [dx, dy])) = (edge3::shape(xi), edge3::map(&nodes, xi));
        let [p, q] = [0, 1].map(|c| edge3::interpolate(&h, &load.values.map(|v| v[c])));
        let length = dx.hypot(dy);
        // t lies along the edge; n is t turned counter-clockwise
        let stress = match load.axes {
            LoadAxes::Fixed => [p, q],
            LoadAxes::Edge => [(q * dx - p * dy) / length, (q * dy + p * dx) / length],
        };
        let weight = w * length * section.depth(x);
        for (i, &node) in load.edge.iter().enumerate() {
            for a in 0..2 {
                forces[node as usize][a] += weight * stress[a] * h[i];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::elasticity::{ElementTables, isotropic};
    use crate::element::Element;
    use crate::problem::Analysis;

    const SQUARE: [[f64; 2]; 8] = [
        [1.0, 0.0],
        [2.0, 0.1],
        [2.2, 1.0],
        [1.0, 0.9],
        [1.5, 0.05],
        [2.1, 0.55],
        [1.6, 0.95],
        [1.0, 0.45],
    ];

    #[test]
    fn rigid_motions_cost_no_force() {
        let no_force = |analysis: Analysis, motion: &dyn Fn([f64; 2]) -> [f64; 2]| {
            let moduli = isotropic(&analysis, 1000.0, 0.3);
            let section = Section::uniform(analysis, moduli);
            let u: Vec<f64> = SQUARE.iter().flat_map(|&x| motion(x)).collect();
            for row in assemble_element(Family::Quad, &SQUARE, &section, 0, 3) {
                let force: f64 = row.iter().zip(&u).map(|(a, b)| a * b).sum();
                assert!(force.abs() < 1e-11, "{force}");
            }
        };
        let plane = Analysis::PlaneStrain {};
        no_force(plane, &|_| [1.0, 0.0]);
        no_force(plane, &|_| [0.0, 1.0]);
        no_force(plane, &|[x, y]| [-y, x]);
        no_force(Analysis::Axisymmetric {}, &|_| [0.0, 1.0]);
    }

    fn sheet() -> Section {
        let analysis = Analysis::PlaneStress { thickness: 0.5 };
        Section::uniform(analysis, isotropic(&analysis, 1.0, 0.0))
    }

    #[test]
    fn uniform_stresses_load_the_nodes_of_an_edge_by_one_four_one() {
        // a top edge: n = (0, 1), t = (1, 0)
        let mesh = Mesh {
            nodes: vec![[0.0, 0.0], [3.0, 0.0], [1.5, 0.0]],
            ..Mesh::default()
        };
        for axes in [LoadAxes::Fixed, LoadAxes::Edge] {
            let load = EdgeLoad {
                edge: [0, 1, 2],
                axes,
                values: [[4.0, -2.0]; 3],
            };
            let loads = Loads {
                edges: vec![load],
                ..Loads::default()
            };
            let [x, y] = match axes {
                LoadAxes::Fixed => [4.0, -2.0],
                LoadAxes::Edge => [-2.0, 4.0],
            };
            let forces = assemble_loads(&mesh, &sheet(), 3, &loads);
            for (node, share) in [(0, 1.0 / 6.0), (1, 1.0 / 6.0), (2, 4.0 / 6.0)] {
                assert!((forces[node][0] - x * 1.5 * share).abs() < 1e-14);
                assert!((forces[node][1] - y * 1.5 * share).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn a_body_force_adds_up_to_force_times_volume() {
        let mesh = Mesh {
            nodes: SQUARE.to_vec(),
            elements: vec![Element::Quad([0, 1, 2, 3, 4, 5, 6, 7])],
            ..Mesh::default()
        };
        let loads = Loads {
            body_force: BodyForce {
                constant: [0.0, -3.0],
                ..BodyForce::default()
            },
            nodal: vec![(2, [7.0, 0.0])],
            ..Loads::default()
        };
        let forces = assemble_loads(&mesh, &sheet(), 3, &loads);
        let total: f64 = forces.iter().map(|f| f[1]).sum();
        // straight sides: the shoelace formula
        let corners = [0, 1, 2, 3].map(|i| SQUARE[i]);
        let area: f64 = (0..4)
            .map(|i| {
                let ([x0, y0], [x1, y1]) = (corners[i], corners[(i + 1) % 4]);
                0.5 * (x0 * y1 - x1 * y0)
            })
            .sum();
        assert!((total + 3.0 * 0.5 * area).abs() < 1e-13);
        assert_eq!(forces[2][0], 7.0);
    }

    /// A mesh of two rows of quadrilaterals and triangles between computed lines, of two materials, one nearly
    /// incompressible.
    fn mixed(kind: &str) -> crate::model::Model {
        let mut analysis = serde_json::json!({"kind": kind});
        if kind == "plane_stress" {
            analysis["thickness"] = 0.7.into();
        }
        // quadrilaterals, in the first columns, have no node in the middle
        let is_used = |i: u32, j: u32| i.is_multiple_of(2) || j.is_multiple_of(2) || i > 6;
        // nodes at half steps: those between the lines are the midside nodes
        let nodes: Vec<[f64; 2]> = (0..=4)
            .flat_map(|j| (0..=12).map(move |i| (i, j)))
            .filter(|(i, j)| is_used(*i, *j))
            .map(|(i, j)| [1.0 + 0.05 * f64::from(i), f64::from(j) / 6.0])
            .collect();
        let before = |n: u32| (0..n).filter(|k| !is_used(k % 13, k / 13)).count() as u32;
        let at = |i: u32, j: u32| 13 * j + i - before(13 * j + i);
        let with_midsides = |corners: &[[u32; 2]]| -> Vec<u32> {
            let next = corners.iter().cycle().skip(1);
            let middle = |([a, b], [c, d]): (&[u32; 2], &[u32; 2])| at((a + c) / 2, (b + d) / 2);
            let ends = corners.iter().map(|[i, j]| at(*i, *j));
            ends.chain(corners.iter().zip(next).map(middle)).collect()
        };
        let (mut elements, mut groups) = (Vec::new(), [Vec::new(), Vec::new()]);
        for (row, column) in (0..2).flat_map(|row| (0..6).map(move |column| (row, column))) {
            let (i, j, first) = (2 * column, 2 * row, elements.len());
            let [a, b, c, d] = [[i, j], [i + 2, j], [i + 2, j + 2], [i, j + 2]];
            if column < 3 {
                elements.push(with_midsides(&[a, b, c, d]))
            } else {
                elements.extend([[a, b, c], [a, c, d]].map(|corners| with_midsides(&corners)));
            }
            groups[row as usize].extend(first..elements.len());
        }
        let side = |a: [u32; 2], b: [u32; 2]| {
            let middle = at((a[0] + b[0]) / 2, (a[1] + b[1]) / 2);
            [at(a[0], a[1]), at(b[0], b[1]), middle]
        };
        let along = |j: u32| -> Vec<_> {
            (0..6)
                .map(|column| side([2 * column, j], [2 * column + 2, j]))
                .collect()
        };
        let problem = serde_json::json!({
            "analysis": analysis,
            "mesh": {"inline": {
                "nodes": nodes, "elements": elements,
                "groups": {"low": groups[0], "high": groups[1]},
                "boundaries": {
                    "bottom": along(0), "top": along(4),
                    "left": [side([0, 0], [0, 2]), side([0, 2], [0, 4])]
                }
            }, "refine": 2},
            "materials": [
                {"group": "low", "youngs_modulus": 1000, "poissons_ratio": 0.3},
                {"group": "high", "youngs_modulus": 10, "poissons_ratio": if kind == "plane_stress" { 0.2 } else { 0.4999 }}
            ],
            "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}, {"boundary": "left", "ux": 0}],
            "contacts": [{"boundary": "top", "obstacle": {"kind": "flat"}, "indentation": 0.1}]
        });
        let problem = serde_json::from_value(problem).unwrap();
        crate::prepare(&problem, None, &mut ()).unwrap().model
    }

    /// Elements assembled by shape have the same matrix as each element assembled by itself.
    #[test]
    fn elements_of_a_shape_have_the_matrix_of_each_of_them() {
        for kind in ["plane_strain", "plane_stress", "axisymmetric"] {
            let model = mixed(kind);
            let (mesh, section, quadrature) = (&model.mesh, &model.section, model.quadrature);
            let tables = &ElementTables::new(mesh, section, quadrature);
            let elements = tables.elements(mesh, section, &model.springs);
            let free = |n: usize| [Dof::Free(2 * n), Dof::Free(2 * n + 1)];
            let mut map = DofMap {
                dofs: (0..mesh.nodes.len()).map(free).collect(),
                axes: vec![None; mesh.nodes.len()],
                unknowns: 2 * mesh.nodes.len(),
            };
            let all = ElementStiffness::new(elements, &map);
            let mut matrix = ElementMatrix::default();
            let mut shared = 0;
            for (e, element) in mesh.elements.iter().enumerate() {
                let nodes = mesh.element_nodes(element);
                let (family, material) = (element.family(), section.material_of(e));
                let own = assemble_element(family, &nodes, section, material, quadrature);
                all.put(e as u32, &mut matrix);
                let size = own.iter().flatten().fold(0.0f64, |m, k| m.max(k.abs()));
                for (a, b) in own.iter().flatten().zip(matrix.entries.iter().flatten()) {
                    assert!((a - b).abs() <= 1e-9 * size, "{kind}, element {e}: {a} {b}");
                }
                shared += usize::from(tables.shapes.of(e).is_some());
            }
            assert!(2 * shared > mesh.elements.len(), "{kind}: {shared}");
            // a held component and other axes make another kind, on all elements of the node
            let kinds = elements.kinds(&map);
            let same: Vec<usize> = (0..kinds.len())
                .filter(|e| kinds[*e].is_some() && kinds[*e] == kinds[0])
                .collect();
            assert!(same.len() > 3 && kinds[0].is_some(), "{kind}: {same:?}");
            map.dofs[mesh.elements[same[1]][0] as usize][1] = Dof::Fixed(0.0);
            map.axes[mesh.elements[same[2]][0] as usize] =
                Some(Axes::perpendicular([[0.6, 0.8], [0.8, -0.6]]));
            let kinds = elements.kinds(&map);
            let of_three = [same[1], same[2], same[same.len() - 1]].map(|e| kinds[e]);
            let differ = (0..3).all(|i| of_three[i] != of_three[(i + 1) % 3]);
            assert!(differ, "{kind}: {of_three:?}");
        }
    }
}
