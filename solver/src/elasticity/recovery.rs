//! From displacements to stresses, nodal forces and energy.

use crate::elasticity::Section;
use crate::elasticity::material::{COMPONENTS, stress};
use crate::elasticity::mixed::{Inside, Mixed, dilatation, position};
use crate::element::{AtNodes, Family, GaussPoint, Mapped};
use crate::mesh::Mesh;

/// Stresses, forces and energy of a displacement field.
pub struct Recovered {
    /// Stress at every node: xx, yy, xy, zz (hoop), averaged over all elements that meet there.
    pub stress: Vec<[f64; COMPONENTS]>,
    /// Stress at every element's nodes, averaged over the elements of its own material.
    pub element_stress: Vec<[[f64; COMPONENTS]; 8]>,
    /// Positions of the integration points, element by element, as in [`Family::rule`].
    pub points: Vec<[f64; 2]>,
    /// Stress there, not averaged.
    pub point_stress: Vec<[f64; COMPONENTS]>,
    /// θ̄ − div u there: what the pressure of nearly incompressible elements leaves out of the dilatation. Empty if
    /// there are none.
    pub dilatation_gap: Vec<f64>,
    /// Force that the stresses exert at every node along x and y, ∫ Bᵀ σ (without 2π).
    pub internal_force: Vec<[f64; 2]>,
    /// ½ ∫ σ : ε (without 2π).
    pub strain_energy: f64,
    /// Work of the body force on the bubbles of nearly incompressible elements (without 2π).
    pub work_on_bubbles: f64,
}

/// Stresses at nodes are taken at the superconvergent points of each element (2 × 2 of a
/// quadrilateral), carried to its nodes linearly, and averaged over the elements that meet there.
///
/// `quadrature`: as in `assemble_element`; `body_force`: the one (force/volume) that the displacements belong to.
pub fn recover(
    mesh: &Mesh,
    section: &Section,
    quadrature: u32,
    displacements: &[[f64; 2]],
    body_force: [f64; 2],
) -> Recovered {
    let mut own = Vec::with_capacity(mesh.elements.len());
    let mut internal_force = vec![[0.0; 2]; mesh.nodes.len()];
    let (mut strain_energy, mut work_on_bubbles) = (0.0, 0.0);
    let mut dilatation_gap = Vec::new();
    let (mut points, mut point_stress) = (Vec::new(), Vec::new());
    for (e, element) in mesh.elements.iter().enumerate() {
        let (family, nodes) = (element.family(), mesh.element_nodes(element));
        let u = element.gather(|n| displacements[n as usize]);
        let deformed = Deformed::new(
            section,
            section.material_of(e),
            family,
            &nodes,
            &u,
            body_force,
        );
        work_on_bubbles += deformed.work_on_bubble;
        let (rule, sampled) = (deformed.rule(quadrature), family.rule(quadrature));
        let mut sample = |at: &DeformedAt, m: &Mapped| {
            points.push(position(m, &nodes));
            point_stress.push(at.stress);
            if section.has_split() {
                dilatation_gap.push(at.dilatation_gap);
            }
        };
        for point in rule {
            let m = family.map(&nodes, point.place);
            let at = deformed.at(&m, point.place);
            let DeformedAt { strain, stress, .. } = at;
            let weight = point.weight * m.det * section.depth(m.x);
            strain_energy +=
                0.5 * weight * (0..COMPONENTS).map(|c| stress[c] * strain[c]).sum::<f64>();
            for (i, &node) in element.iter().enumerate() {
                let b = section.strain(m.shape[i], m.gradient[i], m.x);
                for p in 0..2 {
                    internal_force[node as usize][p] +=
                        weight * (0..COMPONENTS).map(|c| b[c][p] * stress[c]).sum::<f64>();
                }
            }
            if rule.len() == sampled.len() {
                sample(&at, &m);
            }
        }
        if rule.len() != sampled.len() {
            for point in sampled {
                let m = family.map(&nodes, point.place);
                sample(&deformed.at(&m, point.place), &m);
            }
        }
        own.push(deformed.at_nodes());
    }
    let averaged = |of_material: Option<usize>| average(mesh, section, &own, of_material);
    let stress = averaged(None);
    let mut element_stress = vec![[[0.0; COMPONENTS]; 8]; mesh.elements.len()];
    for material in 0..section.materials().len() {
        let single = section.materials().len() == 1;
        let of_material = if single {
            None
        } else {
            Some(averaged(Some(material)))
        };
        let nodal = of_material.as_ref().unwrap_or(&stress);
        for (e, element) in mesh.elements.iter().enumerate() {
            if section.material_of(e) == material {
                element_stress[e] = element.gather(|n| nodal[n as usize]);
            }
        }
    }
    Recovered {
        stress,
        element_stress,
        points,
        point_stress,
        dilatation_gap,
        internal_force,
        strain_energy,
        work_on_bubbles,
    }
}

/// Mean at every node of the stresses of its elements: of one material, or of all.
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

/// Elements between two questions whether to stop.
pub(super) const ELEMENTS_PER_QUESTION: usize = 1 << 14;

/// The stresses of several displacement fields at the nodes, averaged over the elements of one material, as
/// [`recover`] does; 0 at nodes of other materials. None if `stop` says so.
pub(super) fn recover_nodal_stresses(
    mesh: &Mesh,
    section: &Section,
    material: usize,
    fields: &[Vec<[f64; 2]>],
    stop: &mut dyn FnMut() -> bool,
) -> Option<Vec<Vec<[f64; COMPONENTS]>>> {
    let mut sums = vec![vec![[0.0; COMPONENTS]; mesh.nodes.len()]; fields.len()];
    let mut count = vec![0u32; mesh.nodes.len()];
    for (e, element) in mesh.elements.iter().enumerate() {
        if e % ELEMENTS_PER_QUESTION == 0 && stop() {
            return None;
        }
        if section.material_of(e) != material {
            continue;
        }
        let (family, nodes) = (element.family(), mesh.element_nodes(element));
        let points: Vec<Mapped> = family
            .stress_points()
            .iter()
            .map(|point| family.map(&nodes, point.place))
            .collect();
        let body = Undeformed::new(section, material, family, &nodes);
        for (sum, u) in sums.iter_mut().zip(fields) {
            let u = element.gather(|n| u[n as usize]);
            let deformed = body.displaced(&u, [0.0; 2]);
            let mut stresses = [[0.0; COMPONENTS]; 4];
            for ((own, m), point) in stresses.iter_mut().zip(&points).zip(family.stress_points()) {
                *own = deformed.at(m, point.place).stress;
            }
            let carried = carried_to_nodes(family, &stresses);
            for (own, &node) in carried.iter().zip(element.iter()) {
                (0..COMPONENTS).for_each(|c| sum[node as usize][c] += own[c]);
            }
        }
        element.iter().for_each(|&node| count[node as usize] += 1);
    }
    for sum in &mut sums {
        for (stress, n) in sum.iter_mut().zip(&count) {
            *stress = stress.map(|v| v / f64::from((*n).max(1)));
        }
    }
    Some(sums)
}

/// An element before its nodes are displaced.
pub(super) struct Undeformed<'a> {
    section: &'a Section,
    material: usize,
    family: Family,
    nodes: &'a AtNodes<[f64; 2]>,
    /// Of a nearly incompressible material.
    mixed: Option<Mixed<'a>>,
}

/// An element with the displacements of its nodes.
pub struct Deformed<'a> {
    section: &'a Section,
    material: usize,
    family: Family,
    nodes: &'a AtNodes<[f64; 2]>,
    u: &'a AtNodes<[f64; 2]>,
    /// Of a nearly incompressible material.
    inside: Option<Inside<'a>>,
    work_on_bubble: f64,
}

/// Strain and stress at a place of an element.
#[derive(Clone, Copy, Debug)]
pub(super) struct DeformedAt {
    strain: [f64; COMPONENTS],
    pub(super) stress: [f64; COMPONENTS],
    /// θ̄ − div u; 0 of other materials.
    pub(super) dilatation_gap: f64,
}

impl<'a> Undeformed<'a> {
    /// `material`: its number in the section.
    pub(super) fn new(
        section: &'a Section,
        material: usize,
        family: Family,
        nodes: &'a AtNodes<[f64; 2]>,
    ) -> Self {
        let split = section.split(material);
        Undeformed {
            section,
            material,
            family,
            nodes,
            mixed: split.map(|split| Mixed::new(section, split, family, nodes)),
        }
    }

    /// `body_force`: the one (force/volume) that the displacements belong to.
    pub(super) fn displaced(&self, u: &'a AtNodes<[f64; 2]>, body_force: [f64; 2]) -> Deformed<'a> {
        let (mut inside, mut work_on_bubble) = (None, 0.0);
        if let Some(mixed) = &self.mixed {
            let force = mixed.force_on_bubble(body_force);
            let state = mixed.inside(u, &force);
            work_on_bubble = force[0] * state.bubble[0] + force[1] * state.bubble[1];
            inside = Some(state);
        }
        Deformed {
            section: self.section,
            material: self.material,
            family: self.family,
            nodes: self.nodes,
            u,
            inside,
            work_on_bubble,
        }
    }
}

impl<'a> Deformed<'a> {
    /// `material`: its number in the section; `body_force`: the one (force/volume) that the displacements belong to.
    pub fn new(
        section: &'a Section,
        material: usize,
        family: Family,
        nodes: &'a AtNodes<[f64; 2]>,
        u: &'a AtNodes<[f64; 2]>,
        body_force: [f64; 2],
    ) -> Self {
        Undeformed::new(section, material, family, nodes).displaced(u, body_force)
    }

    /// The points of its integrals.
    fn rule(&self, quadrature: u32) -> &'static [GaussPoint] {
        match self.inside {
            Some(_) => Mixed::rule(self.family),
            None => self.family.rule(quadrature),
        }
    }

    /// Stress at a place in master coordinates.
    pub fn stress_at(&self, place: [f64; 2]) -> [f64; COMPONENTS] {
        let m = self.family.map(self.nodes, place);
        self.at(&m, place).stress
    }

    /// At a place in master coordinates, which is mapped to `m`.
    pub(super) fn at(&self, m: &Mapped, place: [f64; 2]) -> DeformedAt {
        let mut strain = self.strain_of_nodes(m);
        let Some(inside) = &self.inside else {
            return DeformedAt {
                strain,
                stress: stress(&self.section.materials()[self.material], &strain),
                dilatation_gap: 0.0,
            };
        };
        inside.add_strain(self.section, self.family, m, place, &mut strain);
        let (projected, stress) = inside.stress(&strain, position(m, self.nodes));
        DeformedAt {
            strain,
            stress,
            dilatation_gap: projected - dilatation(&strain),
        }
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

    /// Stresses at the nodes, carried from the superconvergent points.
    fn at_nodes(&self) -> [[f64; COMPONENTS]; 8] {
        let family = self.family;
        let mut points = [[0.0; COMPONENTS]; 4];
        for (stress, point) in points.iter_mut().zip(family.stress_points()) {
            *stress = self.stress_at(point.place);
        }
        carried_to_nodes(family, &points)
    }
}

/// The stresses at the superconvergent points of an element, carried to its nodes.
fn carried_to_nodes(family: Family, points: &[[f64; COMPONENTS]; 4]) -> [[f64; COMPONENTS]; 8] {
    let mut at_nodes = [[0.0; COMPONENTS]; 8];
    for (stress, &place) in at_nodes.iter_mut().zip(family.places()) {
        let weights = family.from_stress_points(place);
        *stress = std::array::from_fn(|c| (0..4).map(|k| weights[k] * points[k][c]).sum());
    }
    at_nodes
}
