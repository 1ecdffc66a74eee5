//! From displacements to stresses, nodal forces and energy.

use crate::elasticity::Section;
use crate::elasticity::geometry::{Elements, Points, Station};
use crate::elasticity::material::{COMPONENTS, Moduli, stress};
use crate::elasticity::mixed::{Inside, Mixed, OfNodes, dilatation, position};
use crate::elasticity::thermal::{Inner, ThermalStrain};
use crate::element::{AtNodes, Element, Family, Mapped};
use crate::linear::{Interrupt, Stopped};
use crate::mesh::Mesh;

/// Stresses, forces and energy of a displacement field.
pub struct Recovered {
    /// Stress at every node: xx, yy, xy, zz (hoop), averaged over all elements that meet there.
    pub stress: Vec<[f64; COMPONENTS]>,
    /// Stress at the nodes of every element, averaged over the elements of the same material; empty if there is one
    /// material.
    element_stress: Vec<[[f64; COMPONENTS]; 8]>,
    /// Positions (x and y) of the integration points, element by element, as in [`Family::rule`].
    pub points: [Vec<f64>; 2],
    /// The components of the stress at the integration points, not averaged.
    pub point_stress: [Vec<f64>; COMPONENTS],
    /// θ̄ − div u at the integration points: the difference between projected and actual dilatation. Empty if there are
    /// no nearly incompressible elements.
    pub dilatation_gap: Vec<f64>,
    /// The force of the stresses on every node along x and y, ∫ Bᵀ σ (without 2π).
    pub internal_force: Vec<[f64; 2]>,
    /// The strain energy ½ ∫ σ : ε of the elastic strains (without 2π).
    pub strain_energy: f64,
    /// The work of the body force on the bubbles of nearly incompressible elements (without 2π).
    pub work_on_bubbles: f64,
}

impl Recovered {
    /// Stress at the nodes of an element, averaged over the elements of the same material.
    pub fn at_nodes_of(&self, e: usize, element: &Element) -> [[f64; COMPONENTS]; 8] {
        match self.element_stress.get(e) {
            Some(stress) => *stress,
            None => element.gather(|node| self.stress[node as usize]),
        }
    }

    /// Stress at an integration point.
    #[inline(always)]
    pub fn at_point(&self, point: usize) -> [f64; COMPONENTS] {
        std::array::from_fn(|c| self.point_stress[c][point])
    }
}

/// Recovers stresses at nodes: taken at the superconvergent points of each element (2 × 2 of a quadrilateral),
/// extrapolated to its nodes linearly, and averaged over the elements that meet there.
///
/// `inner`: the forces per volume and thermal strains under which the displacements occur; `threads`: the number of threads
/// that do the work.
pub fn recover(
    elements: Elements<'_>,
    displacements: &[[f64; 2]],
    inner: &Inner<'_>,
    threads: usize,
    interrupt: &mut Interrupt<'_>,
) -> Result<Recovered, Stopped> {
    let Elements { mesh, section, .. } = elements;
    let quadrature = elements.tables.quadrature;
    let points = mesh
        .elements
        .iter()
        .map(|e| e.family().rule(quadrature).len())
        .sum();
    let column = || Vec::with_capacity(points);
    let mut found = Recovered {
        stress: Vec::new(),
        element_stress: Vec::new(),
        points: [column(), column()],
        point_stress: std::array::from_fn(|_| column()),
        dilatation_gap: match section.has_split() {
            true => column(),
            false => Vec::new(),
        },
        internal_force: vec![[0.0; 2]; mesh.nodes.len()],
        strain_energy: 0.0,
        work_on_bubbles: 0.0,
    };
    let mut at_nodes = Vec::with_capacity(mesh.elements.len());
    elements.for_each_chunk(
        threads,
        OfChunk::with_room,
        |own, stations, chunk| {
            own.clear();
            pulp::Arch::new().dispatch(|| {
                for (e, element) in chunk.numbered() {
                    let u = element.gather(|n| displacements[n as usize]);
                    let material = section.material_of(e);
                    if section.split(material).is_some() {
                        own.add_mixed(mesh, (section, material), (element, &u), quadrature, inner);
                        continue;
                    }
                    let (ux, uy) = (u.map(|u| u[0]), u.map(|u| u[1]));
                    let moduli = &section.materials()[material];
                    let thermal = inner.thermal_strain(element, material);
                    let elastic = |station: &Station| {
                        let strain = station.strain(&ux, &uy);
                        let of = thermal.as_ref();
                        of.map_or(strain, |thermal| thermal.elastic(&strain, &station.shape))
                    };
                    let nodes = mesh.element_nodes(element);
                    own.add(stations.of(e, Points::Rule), &nodes, moduli, elastic);
                    if section.has_split() {
                        own.dilatation_gap.resize(own.points[0].len(), 0.0);
                    }
                    let mut stresses = [[0.0; COMPONENTS]; 4];
                    for (own, station) in stresses.iter_mut().zip(stations.of(e, Points::Stress)) {
                        *own = stress(moduli, &elastic(station));
                    }
                    let to_nodes = elements.tables.masters.to_nodes(element.family());
                    own.at_nodes.push(carried(to_nodes, &stresses));
                }
            });
        },
        |own, chunk| {
            found.take(own, chunk.elements);
            at_nodes.extend_from_slice(&own.at_nodes);
        },
        interrupt,
    )?;
    found.average(mesh, section, &at_nodes);
    Ok(found)
}

/// What [`recover`] finds in a chunk of elements.
#[derive(Default)]
struct OfChunk {
    points: [Vec<f64>; 2],
    point_stress: [Vec<f64>; COMPONENTS],
    dilatation_gap: Vec<f64>,
    strain_energy: f64,
    work_on_bubbles: f64,
    /// By element: the stresses at its nodes, and the forces on them along x and along y.
    at_nodes: Vec<AtNodes<[f64; COMPONENTS]>>,
    forces: Vec<[AtNodes<f64>; 2]>,
}

impl OfChunk {
    /// Of no elements yet, with room for so many elements and integration points.
    fn with_room(elements: usize, points: usize) -> Self {
        let column = || Vec::with_capacity(points);
        OfChunk {
            points: [column(), column()],
            point_stress: std::array::from_fn(|_| column()),
            dilatation_gap: column(),
            at_nodes: Vec::with_capacity(elements),
            forces: Vec::with_capacity(elements),
            ..OfChunk::default()
        }
    }

    fn clear(&mut self) {
        let columns = self.points.iter_mut().chain(&mut self.point_stress);
        columns
            .chain([&mut self.dilatation_gap])
            .for_each(Vec::clear);
        self.at_nodes.clear();
        self.forces.clear();
        (self.strain_energy, self.work_on_bubbles) = (0.0, 0.0);
    }

    /// Adds the contribution of an element at its integration points, the stations `rule`; `elastic`: its elastic strain there.
    #[inline(always)]
    fn add(
        &mut self,
        rule: &[Station],
        nodes: &AtNodes<[f64; 2]>,
        moduli: &Moduli,
        elastic: impl Fn(&Station) -> [f64; COMPONENTS],
    ) {
        let (mut fx, mut fy) = ([0.0; 8], [0.0; 8]);
        for station in rule {
            let strain = elastic(station);
            let stress = stress(moduli, &strain);
            let density: f64 = (0..COMPONENTS).map(|c| stress[c] * strain[c]).sum();
            self.strain_energy += 0.5 * station.weight * density;
            station.add_force(station.weight, &stress, &mut fx, &mut fy);
            for a in 0..2 {
                self.points[a].push((0..8).map(|i| station.shape[i] * nodes[i][a]).sum());
            }
            (0..COMPONENTS).for_each(|c| self.point_stress[c].push(stress[c]));
        }
        self.forces.push([fx, fy]);
    }

    /// Adds the contribution of a nearly incompressible element, with its stresses at the nodes.
    fn add_mixed(
        &mut self,
        mesh: &Mesh,
        (section, material): (&Section, usize),
        (element, u): (&Element, &AtNodes<[f64; 2]>),
        quadrature: u32,
        inner: &Inner<'_>,
    ) {
        let (family, nodes) = (element.family(), mesh.element_nodes(element));
        let deformed = Deformed::new(section, material, (element, &nodes), u, inner);
        self.work_on_bubbles += deformed.work_on_bubble;
        let mut forces = [[0.0; 8]; 2];
        for point in Mixed::rule(family) {
            let m = family.map(&nodes, point.place);
            let DeformedAt { strain, stress, .. } = deformed.at(&m, point.place);
            let weight = point.weight * m.det * section.depth(m.x);
            self.strain_energy +=
                0.5 * weight * (0..COMPONENTS).map(|c| stress[c] * strain[c]).sum::<f64>();
            for i in 0..8 {
                let b = section.strain(m.shape[i], m.gradient[i], m.x);
                for (p, forces) in forces.iter_mut().enumerate() {
                    forces[i] += weight * (0..COMPONENTS).map(|c| b[c][p] * stress[c]).sum::<f64>();
                }
            }
        }
        self.forces.push(forces);
        for point in family.rule(quadrature) {
            let m = family.map(&nodes, point.place);
            let at = deformed.at(&m, point.place);
            let place = position(&m, &nodes);
            (0..2).for_each(|a| self.points[a].push(place[a]));
            (0..COMPONENTS).for_each(|c| self.point_stress[c].push(at.stress[c]));
            self.dilatation_gap.push(at.dilatation_gap);
        }
        self.at_nodes.push(deformed.at_nodes());
    }
}

impl Recovered {
    /// Adds what was found in a chunk of elements, which follow those of the chunks before.
    fn take(&mut self, found: &OfChunk, elements: &[Element]) {
        let columns = self.points.iter_mut().chain(&mut self.point_stress);
        let columns = columns.chain([&mut self.dilatation_gap]);
        let of_chunk = found.points.iter().chain(&found.point_stress);
        for (all, own) in columns.zip(of_chunk.chain([&found.dilatation_gap])) {
            all.extend_from_slice(own);
        }
        for (element, [fx, fy]) in elements.iter().zip(&found.forces) {
            for (i, &node) in element.iter().enumerate() {
                let force = &mut self.internal_force[node as usize];
                *force = [force[0] + fx[i], force[1] + fy[i]];
            }
        }
        self.strain_energy += found.strain_energy;
        self.work_on_bubbles += found.work_on_bubbles;
    }

    /// Averages the stresses of the elements at their common nodes.
    fn average(&mut self, mesh: &Mesh, section: &Section, own: &[[[f64; COMPONENTS]; 8]]) {
        let averaged = |of_material: Option<usize>| average(mesh, section, own, of_material);
        self.stress = averaged(None);
        if section.materials().len() == 1 {
            return;
        }
        self.element_stress = vec![[[0.0; COMPONENTS]; 8]; mesh.elements.len()];
        for material in 0..section.materials().len() {
            let nodal = averaged(Some(material));
            for (e, element) in mesh.elements.iter().enumerate() {
                if section.material_of(e) == material {
                    self.element_stress[e] = element.gather(|n| nodal[n as usize]);
                }
            }
        }
    }
}

/// The mean stress at every node over the elements of one `material`, or over all elements if it is `None`.
fn average(
    mesh: &Mesh,
    section: &Section,
    own: &[[[f64; COMPONENTS]; 8]],
    material: Option<usize>,
) -> Vec<[f64; COMPONENTS]> {
    let mut sum = vec![[0.0; COMPONENTS]; mesh.nodes.len()];
    let mut count = vec![0u32; mesh.nodes.len()];
    for (e, element) in mesh.elements.iter().enumerate() {
        if material.is_some_and(|m| section.material_of(e) != m) {
            continue;
        }
        for (i, &node) in element.iter().enumerate() {
            (0..COMPONENTS).for_each(|c| sum[node as usize][c] += own[e][i][c]);
            count[node as usize] += 1;
        }
    }
    let mean = |(s, n): (&[f64; COMPONENTS], &u32)| s.map(|v| v / f64::from((*n).max(1)));
    sum.iter().zip(&count).map(mean).collect()
}

/// The components of the stress in each of several fields.
pub(super) type Stresses<const FIELDS: usize> = [[f64; FIELDS]; COMPONENTS];

/// The stresses of several displacement fields at the nodes, averaged over the elements of one material, as
/// [`recover`] does; 0 at nodes of other materials.
pub(super) fn recover_nodal_stresses<const FIELDS: usize>(
    elements: Elements<'_>,
    material: usize,
    fields: &[[[f64; FIELDS]; 2]],
    threads: usize,
    interrupt: &mut Interrupt<'_>,
) -> Result<Vec<Stresses<FIELDS>>, Stopped> {
    let Elements {
        mesh,
        section,
        tables,
        ..
    } = elements;
    let mut sums = vec![[[0.0; FIELDS]; COMPONENTS]; mesh.nodes.len()];
    let mut count = vec![0u32; mesh.nodes.len()];
    let moduli = &section.materials()[material];
    let split = section.split(material);
    elements.for_each_chunk(
        threads,
        |elements, _| Vec::with_capacity(elements),
        |found: &mut Vec<_>, stations, chunk| {
            found.clear();
            pulp::Arch::new().dispatch(|| {
                for (e, element) in chunk.numbered() {
                    if section.material_of(e) != material {
                        continue;
                    }
                    let own = match split {
                        Some(split) => {
                            let (family, nodes) = (element.family(), mesh.element_nodes(element));
                            let body = OfNodes::new(&Mixed::new(section, split, family, &nodes));
                            mixed_stresses_at_nodes(section, &body, (element, &nodes), fields)
                        }
                        None => {
                            let own = stations.of(e, Points::Stress);
                            let to_nodes = tables.masters.to_nodes(element.family());
                            stresses_at_nodes(own, to_nodes, moduli, element, fields)
                        }
                    };
                    found.push((element, own));
                }
            });
        },
        |found, _| {
            for (element, own) in found {
                for (&node, own) in element.iter().zip(own) {
                    count[node as usize] += 1;
                    for (sum, own) in sums[node as usize].iter_mut().zip(own) {
                        (0..FIELDS).for_each(|k| sum[k] += own[k]);
                    }
                }
            }
        },
        interrupt,
    )?;
    for (sum, n) in sums.iter_mut().zip(&count) {
        let scale = f64::from((*n).max(1)).recip();
        sum.iter_mut().flatten().for_each(|v| *v *= scale);
    }
    Ok(sums)
}

/// The stresses of several fields at the nodes of a nearly incompressible element.
#[inline(always)]
fn mixed_stresses_at_nodes<const FIELDS: usize>(
    section: &Section,
    body: &OfNodes<'_>,
    (element, nodes): (&Element, &AtNodes<[f64; 2]>),
    fields: &[[[f64; FIELDS]; 2]],
) -> [Stresses<FIELDS>; 8] {
    let family = element.family();
    let mut at_nodes = [[[0.0; FIELDS]; COMPONENTS]; 8];
    for (point, place) in family.stress_points().iter().enumerate() {
        let m = family.map(nodes, place.place);
        let of_nodes = body.at(section, (family, nodes), &m, place.place).stress();
        let mut stress = [[0.0; FIELDS]; COMPONENTS];
        for (i, &node) in element.iter().enumerate() {
            let [ux, uy] = &fields[node as usize];
            for (stress, row) in stress.iter_mut().zip(&of_nodes) {
                let (x, y) = (row[2 * i], row[2 * i + 1]);
                (0..FIELDS).for_each(|k| stress[k] += x * ux[k] + y * uy[k]);
            }
        }
        for (at_node, &place) in at_nodes.iter_mut().zip(family.places()) {
            let weight = family.from_stress_points(place)[point];
            for (all, own) in at_node.iter_mut().zip(&stress) {
                (0..FIELDS).for_each(|k| all[k] += weight * own[k]);
            }
        }
    }
    at_nodes
}

/// The stresses of several fields at the nodes of an element.
#[inline(always)]
fn stresses_at_nodes<const FIELDS: usize>(
    stations: &[Station],
    to_nodes: &AtNodes<[f64; 4]>,
    moduli: &Moduli,
    element: &Element,
    fields: &[[[f64; FIELDS]; 2]],
) -> [Stresses<FIELDS>; 8] {
    let mut at_nodes = [[[0.0; FIELDS]; COMPONENTS]; 8];
    for (point, station) in stations.iter().enumerate() {
        let mut strain = [[0.0; FIELDS]; COMPONENTS];
        for (i, &node) in element.iter().enumerate() {
            let [ux, uy] = &fields[node as usize];
            let (dx, dy, hoop) = (station.dx[i], station.dy[i], station.hoop[i]);
            for k in 0..FIELDS {
                strain[0][k] += dx * ux[k];
                strain[1][k] += dy * uy[k];
                strain[2][k] += dy * ux[k] + dx * uy[k];
                strain[3][k] += hoop * ux[k];
            }
        }
        let mut stress = [[0.0; FIELDS]; COMPONENTS];
        for (stress, row) in stress.iter_mut().zip(moduli) {
            for (strain, d) in strain.iter().zip(row) {
                (0..FIELDS).for_each(|k| stress[k] += d * strain[k]);
            }
        }
        for (at_node, weights) in at_nodes.iter_mut().zip(to_nodes) {
            let weight = weights[point];
            for (all, own) in at_node.iter_mut().zip(&stress) {
                (0..FIELDS).for_each(|k| all[k] += weight * own[k]);
            }
        }
    }
    at_nodes
}

/// Extrapolates the stresses from the superconvergent points to the nodes.
#[inline(always)]
fn carried(
    to_nodes: &AtNodes<[f64; 4]>,
    points: &[[f64; COMPONENTS]; 4],
) -> AtNodes<[f64; COMPONENTS]> {
    let mut at_nodes = [[0.0; COMPONENTS]; 8];
    for (at_node, weights) in at_nodes.iter_mut().zip(to_nodes) {
        for (weight, point) in weights.iter().zip(points) {
            (0..COMPONENTS).for_each(|c| at_node[c] += weight * point[c]);
        }
    }
    at_nodes
}

/// An element with the displacements of its nodes.
pub struct Deformed<'a> {
    section: &'a Section,
    material: usize,
    family: Family,
    nodes: &'a AtNodes<[f64; 2]>,
    u: &'a AtNodes<[f64; 2]>,
    thermal: Option<ThermalStrain>,
    /// The state inside an element of a nearly incompressible material; `None` for other materials.
    inside: Option<Inside<'a>>,
    work_on_bubble: f64,
}

/// Elastic strain and stress at a place of an element.
#[derive(Clone, Copy, Debug)]
struct DeformedAt {
    strain: [f64; COMPONENTS],
    stress: [f64; COMPONENTS],
    /// The difference θ̄ − div u, both without thermal strains; 0 in materials that are not nearly incompressible.
    dilatation_gap: f64,
}

impl<'a> Deformed<'a> {
    /// An element with the positions of its nodes, which are displaced. `material`: the number of its material in the
    /// section; `inner`: the forces per volume and thermal strains under which the displacements occur.
    pub fn new(
        section: &'a Section,
        material: usize,
        (element, nodes): (&Element, &'a AtNodes<[f64; 2]>),
        u: &'a AtNodes<[f64; 2]>,
        inner: &Inner<'_>,
    ) -> Self {
        let family = element.family();
        let thermal = inner.thermal_strain(element, material);
        let (mut inside, mut work_on_bubble) = (None, 0.0);
        if let Some(split) = section.split(material) {
            let mixed = Mixed::new(section, split, family, nodes);
            let strains = mixed.thermal(section, family, nodes, thermal.as_ref());
            let force = mixed.on_bubble(&inner.body_force, material, &strains);
            let state = mixed.inside(u, &force, &strains.dilatation);
            let applied = mixed.force_on_bubble(&inner.body_force, material);
            work_on_bubble = applied[0] * state.bubble[0] + applied[1] * state.bubble[1];
            inside = Some(state);
        }
        Deformed {
            section,
            material,
            family,
            nodes,
            u,
            thermal,
            inside,
            work_on_bubble,
        }
    }

    /// Stress at a place in master coordinates.
    pub fn stress_at(&self, place: [f64; 2]) -> [f64; COMPONENTS] {
        let m = self.family.map(self.nodes, place);
        self.at(&m, place).stress
    }

    /// Elastic strain and stress at a place in master coordinates, which is mapped to `m`.
    fn at(&self, m: &Mapped, place: [f64; 2]) -> DeformedAt {
        let mut strain = self.strain_of_nodes(m);
        let Some(inside) = &self.inside else {
            let strain = self.elastic(&strain, m);
            return DeformedAt {
                strain,
                stress: stress(&self.section.materials()[self.material], &strain),
                dilatation_gap: 0.0,
            };
        };
        inside.add_strain(self.section, self.family, m, place, &mut strain);
        let strain = self.elastic(&strain, m);
        let (projected, stress) = inside.stress(&strain, position(m, self.nodes));
        DeformedAt {
            strain,
            stress,
            dilatation_gap: projected - dilatation(&strain),
        }
    }

    /// The elastic part of a strain.
    fn elastic(&self, strain: &[f64; COMPONENTS], m: &Mapped) -> [f64; COMPONENTS] {
        let thermal = self.thermal.as_ref();
        thermal.map_or(*strain, |thermal| thermal.elastic(strain, &m.shape))
    }

    fn strain_of_nodes(&self, m: &Mapped) -> [f64; COMPONENTS] {
        let (section, u) = (self.section, self.u);
        let mut strain = [0.0; COMPONENTS];
        for i in 0..8 {
            let b = section.strain(m.shape[i], m.gradient[i], m.x);
            (0..COMPONENTS).for_each(|c| strain[c] += b[c][0] * u[i][0] + b[c][1] * u[i][1]);
        }
        strain
    }

    /// The stresses at the nodes, extrapolated from the superconvergent points.
    fn at_nodes(&self) -> [[f64; COMPONENTS]; 8] {
        let family = self.family;
        let mut points = [[0.0; COMPONENTS]; 4];
        for (stress, point) in points.iter_mut().zip(family.stress_points()) {
            *stress = self.stress_at(point.place);
        }
        carried_to_nodes(family, &points)
    }
}

/// Extrapolates the stresses from the superconvergent points of an element to its nodes.
fn carried_to_nodes(family: Family, points: &[[f64; COMPONENTS]; 4]) -> [[f64; COMPONENTS]; 8] {
    let mut at_nodes = [[0.0; COMPONENTS]; 8];
    for (stress, &place) in at_nodes.iter_mut().zip(family.places()) {
        let weights = family.from_stress_points(place);
        *stress = std::array::from_fn(|c| (0..4).map(|k| weights[k] * points[k][c]).sum());
    }
    at_nodes
}
