//! Stresses from displacements by Hooke's law, as a prediction: thesis 2.2, and formulation 3.
//!
//! The prediction repeats what the solver does for ordinary elements, in the same order of operations, with its own
//! copy of the formulas of the master elements (`version_1`). A change of one rounding there, or here, would make all
//! stored fields unreadable; the test in `stored.rs` with the files of `version_1` detects that. For nearly
//! incompressible elements the prediction is poor, which only costs space.

use solver::{
    elasticity::{COMPONENTS, Moduli, isotropic, orthotropic},
    element::{AtNodes, Element, Family},
    problem::{Analysis, Elasticity, Problem},
    solution::{Fields, GaussFields},
};

use super::version_1::{self, Place};

/// The largest number of materials for predicting stresses; a solved problem has few.
pub(super) const MOST_MATERIALS: usize = u8::MAX as usize;

/// The data of a problem by which its stresses are predicted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Law {
    /// Whether there is a hoop strain u_r / r.
    pub axisymmetric: bool,
    /// The moduli of each material of the problem (stress).
    pub moduli: Vec<Moduli>,
}

impl Law {
    /// The law of a problem.
    pub fn of(problem: &Problem) -> Law {
        let analysis = &problem.analysis;
        let moduli = |elasticity: &Elasticity| match elasticity {
            Elasticity::Isotropic {
                youngs_modulus,
                poissons_ratio,
            } => Some(isotropic(analysis, *youngs_modulus, *poissons_ratio)),
            Elasticity::Orthotropic(material) => orthotropic(analysis, material),
        };
        let materials = problem.materials.iter();
        Law {
            axisymmetric: matches!(analysis, Analysis::Axisymmetric {}),
            moduli: materials
                .filter_map(|material| moduli(&material.elasticity))
                .take(MOST_MATERIALS)
                .collect(),
        }
    }
}

/// The fields that are known when stresses are predicted.
pub(super) struct Known<'a> {
    x: &'a [f64],
    y: &'a [f64],
    ux: &'a [f64],
    uy: &'a [f64],
    elements: &'a [Element],
    order: u32,
}

impl<'a> Known<'a> {
    pub(super) fn of(fields: &'a Fields) -> Known<'a> {
        Known {
            x: &fields.x,
            y: &fields.y,
            ux: &fields.ux,
            uy: &fields.uy,
            elements: &fields.elements,
            order: fields.gauss.order,
        }
    }
}

/// The stresses at integration points.
pub(super) fn at_points(gauss: &GaussFields) -> [&Vec<f64>; 4] {
    [
        &gauss.stress_xx,
        &gauss.stress_yy,
        &gauss.stress_xy,
        &gauss.stress_zz,
    ]
}

/// The predicted places of integration points, and the predicted stresses.
pub(super) struct Stresses {
    /// The places of the integration points, x and y.
    pub(super) points: [Vec<f64>; 2],
    /// The stresses at the integration points.
    pub(super) at_points: [Vec<f64>; COMPONENTS],
    /// The stresses at nodes, averaged over the elements there.
    pub(super) at_nodes: [Vec<f64>; COMPONENTS],
}

/// Two elements have the same strains if the places of their nodes relative to the first node differ by at most this
/// part of the element's size.
const SAME_SHAPE: f64 = 1e-11;

/// The strains at one place of an element, as linear functions of the displacements of its nodes.
struct Strains {
    dx: AtNodes<f64>,
    dy: AtNodes<f64>,
    hoop: AtNodes<f64>,
}

impl Strains {
    fn new(place: &Place, nodes: &AtNodes<[f64; 2]>, axisymmetric: bool) -> Strains {
        let mapped = place.map(nodes);
        Strains {
            dx: mapped.gradient.map(|[x, _]| x),
            dy: mapped.gradient.map(|[_, y]| y),
            hoop: if axisymmetric {
                mapped.shape.map(|h| h / mapped.x)
            } else {
                [0.0; 8]
            },
        }
    }

    fn stress(&self, moduli: &Moduli, ux: &AtNodes<f64>, uy: &AtNodes<f64>) -> [f64; COMPONENTS] {
        let mut strain = [0.0; COMPONENTS];
        for i in 0..8 {
            strain[0] += self.dx[i] * ux[i];
            strain[1] += self.dy[i] * uy[i];
            strain[2] += self.dy[i] * ux[i] + self.dx[i] * uy[i];
            strain[3] += self.hoop[i] * ux[i];
        }
        moduli.map(|row| (0..COMPONENTS).fold(0.0, |sum, k| sum + row[k] * strain[k]))
    }
}

/// The master element of a family: its integration points, and the points from which stresses are extrapolated to
/// nodes.
struct Master {
    rule: Vec<Place>,
    shapes: Vec<AtNodes<f64>>,
    stress: Vec<Place>,
    to_nodes: AtNodes<[f64; 4]>,
}

impl Master {
    fn new(family: Family, order: u32) -> Master {
        let rule = version_1::rule(family, order);
        let mut to_nodes = [[0.0; 4]; 8];
        for (weights, place) in to_nodes.iter_mut().zip(version_1::places(family)) {
            *weights = version_1::from_stress_points(family, *place);
        }
        let tabulate = |places: &[[f64; 2]]| {
            let places = places.iter();
            places.map(|place| Place::new(family, *place)).collect()
        };
        let shapes = rule.iter().map(|place| version_1::shape(family, *place));
        Master {
            rule: tabulate(rule),
            shapes: shapes.collect(),
            stress: tabulate(version_1::stress_points(family)),
            to_nodes,
        }
    }
}

/// The strains of the last element, which are used again for following elements of the same shape.
struct Shape {
    family: Family,
    nodes: AtNodes<[f64; 2]>,
    at_points: Vec<Strains>,
    at_stress_points: Vec<Strains>,
}

impl Shape {
    fn new(
        family: Family,
        nodes: AtNodes<[f64; 2]>,
        masters: &[Master; 2],
        axisymmetric: bool,
    ) -> Shape {
        let master = &masters[family as usize];
        let strains = |places: &[Place]| {
            let strains = |place| Strains::new(place, &nodes, axisymmetric);
            places.iter().map(strains).collect()
        };
        Shape {
            family,
            at_points: strains(&master.rule),
            at_stress_points: strains(&master.stress),
            nodes,
        }
    }

    fn is(&self, family: Family, nodes: &AtNodes<[f64; 2]>) -> bool {
        let pairs = || self.nodes.iter().flatten().zip(nodes.iter().flatten());
        let size = self
            .nodes
            .iter()
            .flatten()
            .fold(0.0, |most: f64, c| most.max(c.abs()));
        self.family == family && pairs().all(|(a, b)| (a - b).abs() <= SAME_SHAPE * size)
    }
}

/// Visits the elements of a mesh one after another, each with its strains.
struct Walk<'a> {
    known: &'a Known<'a>,
    axisymmetric: bool,
    masters: [Master; 2],
    last: Option<Shape>,
}

impl<'a> Walk<'a> {
    fn new(known: &'a Known<'a>, law: &Law) -> Walk<'a> {
        Walk {
            known,
            axisymmetric: law.axisymmetric,
            masters: [Family::Quad, Family::Triangle]
                .map(|family| Master::new(family, known.order)),
            last: None,
        }
    }

    /// The positions of an element's nodes.
    fn nodes(&self, element: &Element) -> AtNodes<[f64; 2]> {
        element.gather(|n| [self.known.x[n as usize], self.known.y[n as usize]])
    }

    /// The displacements of an element's nodes.
    fn displacements(&self, element: &Element) -> (AtNodes<f64>, AtNodes<f64>) {
        (
            element.gather(|n| self.known.ux[n as usize]),
            element.gather(|n| self.known.uy[n as usize]),
        )
    }

    fn shape(&mut self, element: &Element) -> &Shape {
        let (family, mut nodes) = (element.family(), self.nodes(element));
        let [x, y] = nodes[0];
        let x = if self.axisymmetric { 0.0 } else { x };
        let own = nodes.iter_mut().take(family.nodes());
        own.for_each(|node| *node = [node[0] - x, node[1] - y]);
        let last = self.last.take().filter(|last| last.is(family, &nodes));
        let shape =
            last.unwrap_or_else(|| Shape::new(family, nodes, &self.masters, self.axisymmetric));
        self.last.insert(shape)
    }
}

/// The material of each element that predicts the element's stresses best, found from these stresses.
pub(super) fn materials_by_element(fields: &Fields, law: &Law) -> Vec<u8> {
    if law.moduli.len() < 2 {
        return vec![0; fields.elements.len()];
    }
    let known = Known::of(fields);
    let mut walk = Walk::new(&known, law);
    let mut point = 0;
    let mut material = |element: &Element| {
        let (ux, uy) = walk.displacements(element);
        let actual = at_points(&fields.gauss).map(|column| column[point]);
        let strains = &walk.shape(element).at_points;
        let error = |moduli: &Moduli| -> f64 {
            let predicted = strains[0].stress(moduli, &ux, &uy);
            predicted
                .iter()
                .zip(&actual)
                .map(|(p, a)| (p - a).abs())
                .sum()
        };
        let errors: Vec<f64> = law.moduli.iter().map(error).collect();
        point += strains.len();
        let best = (0..=u8::MAX)
            .zip(&errors)
            .min_by(|(_, a), (_, b)| a.total_cmp(b));
        best.map_or(0, |(material, _)| material)
    };
    fields.elements.iter().map(&mut material).collect()
}

/// The predicted stresses; zero where an element has an unknown material.
pub(super) fn predicted_stresses(known: &Known<'_>, law: &Law, materials: &[u8]) -> Stresses {
    let mut walk = Walk::new(known, law);
    let nodes = known.x.len();
    let points = known
        .elements
        .iter()
        .map(|e| version_1::rule(e.family(), known.order).len())
        .sum();
    let column = || Vec::with_capacity(points);
    let mut found = Stresses {
        points: [column(), column()],
        at_points: std::array::from_fn(|_| column()),
        at_nodes: std::array::from_fn(|_| vec![0.0; nodes]),
    };
    let mut count = vec![0u32; nodes];
    let none = Moduli::default();
    for (element, material) in known.elements.iter().zip(materials) {
        let moduli = law.moduli.get(usize::from(*material)).unwrap_or(&none);
        let (positions, (ux, uy)) = (walk.nodes(element), walk.displacements(element));
        for shape in &walk.masters[element.family() as usize].shapes {
            for (axis, column) in found.points.iter_mut().enumerate() {
                column.push((0..8).fold(0.0, |sum, i| sum + shape[i] * positions[i][axis]));
            }
        }
        let to_nodes = walk.masters[element.family() as usize].to_nodes;
        let shape = walk.shape(element);
        for strains in &shape.at_points {
            let stress = strains.stress(moduli, &ux, &uy);
            found
                .at_points
                .iter_mut()
                .zip(stress)
                .for_each(|(column, s)| column.push(s));
        }
        let mut stresses = [[0.0; COMPONENTS]; 4];
        for (own, strains) in stresses.iter_mut().zip(&shape.at_stress_points) {
            *own = strains.stress(moduli, &ux, &uy);
        }
        for (&node, weights) in element.iter().zip(&to_nodes) {
            let node = node as usize;
            count[node] += 1;
            let mut own = [0.0; COMPONENTS];
            for (weight, stress) in weights.iter().zip(&stresses) {
                (0..COMPONENTS).for_each(|c| own[c] += weight * stress[c]);
            }
            found
                .at_nodes
                .iter_mut()
                .zip(own)
                .for_each(|(column, s)| column[node] += s);
        }
    }
    for column in &mut found.at_nodes {
        for (sum, count) in column.iter_mut().zip(&count) {
            *sum /= f64::from((*count).max(1));
        }
    }
    found
}
