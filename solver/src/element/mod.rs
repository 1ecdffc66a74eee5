//! Master elements and their integration, thesis 2.1 and 2.3: no mesh, no material.

pub mod edge3;
pub mod gauss;
pub mod quad8;
pub mod tri6;

pub use gauss::GaussPoint;

use std::fmt;
use std::ops::Deref;

use schemars::JsonSchema;
use serde::de::{Deserialize, Deserializer, Error, SeqAccess, Visitor};
use serde::{Serialize, Serializer};

/// An element by its nodes, from 0: corners counter-clockwise, then the midsides from the side
/// 1–2 on. In JSON a list of eight or six numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Element {
    /// The 8-node quadrilateral.
    Quad([u32; 8]),
    /// The 6-node triangle.
    Triangle([u32; 6]),
}

/// Values at the nodes of an element; the last two of a triangle are not used.
pub type AtNodes<T> = [T; 8];

/// The family of an element: what elements with the same number of nodes have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Family {
    /// Eight nodes, ξ and η from −1 to 1.
    Quad,
    /// Six nodes, ξ, η ≥ 0 and ξ + η ≤ 1.
    Triangle,
}

/// The quantities of an element's map at one point, for integrals over the real element.
#[derive(Clone, Copy, Debug)]
pub struct Mapped {
    /// The shape functions h_i.
    pub shape: AtNodes<f64>,
    /// The gradients dh_i/dx and dh_i/dy.
    pub gradient: AtNodes<[f64; 2]>,
    /// The determinant det J of the map; ≤ 0 where the element is inverted.
    pub det: f64,
    /// The first coordinate: x, or the radius r.
    pub x: f64,
}

impl Mapped {
    /// The derivatives of the master coordinates, dξ/dx, dξ/dy and dη/dx, dη/dy.
    pub fn master_gradients(&self, family: Family) -> [[f64; 2]; 2] {
        let mut gradients = [[0.0; 2]; 2];
        for (place, gradient) in family.places().iter().zip(&self.gradient) {
            for a in 0..2 {
                for b in 0..2 {
                    gradients[a][b] += place[a] * gradient[b];
                }
            }
        }
        gradients
    }
}

impl Element {
    /// The family of the element.
    pub fn family(&self) -> Family {
        match self {
            Element::Quad(_) => Family::Quad,
            Element::Triangle(_) => Family::Triangle,
        }
    }

    /// Gathers values at the element's nodes.
    pub fn gather<T: Copy + Default>(&self, value: impl Fn(u32) -> T) -> AtNodes<T> {
        let mut values = [T::default(); 8];
        for (slot, &node) in values.iter_mut().zip(self.iter()) {
            *slot = value(node);
        }
        values
    }

    /// A copy of the element with other node numbers.
    pub fn map_nodes(&self, number: impl Fn(u32) -> u32) -> Element {
        match self {
            Element::Quad(nodes) => Element::Quad(nodes.map(number)),
            Element::Triangle(nodes) => Element::Triangle(nodes.map(number)),
        }
    }

    /// The element's sides as nodes of the mesh (corner, corner, midside), counter-clockwise.
    pub fn sides(&self) -> impl Iterator<Item = [u32; 3]> + '_ {
        let side = |side: &[usize; 3]| side.map(|i| self[i]);
        self.family().sides().iter().map(side)
    }
}

impl Deref for Element {
    type Target = [u32];

    fn deref(&self) -> &[u32] {
        match self {
            Element::Quad(nodes) => nodes,
            Element::Triangle(nodes) => nodes,
        }
    }
}

impl TryFrom<&[u32]> for Element {
    type Error = String;

    fn try_from(nodes: &[u32]) -> Result<Self, String> {
        if let Ok(quad) = nodes.try_into() {
            return Ok(Element::Quad(quad));
        }
        if let Ok(triangle) = nodes.try_into() {
            return Ok(Element::Triangle(triangle));
        }
        Err(wrong_count(nodes.len()))
    }
}

fn wrong_count(count: usize) -> String {
    format!("{count} nodes, where an element has 8 (quadrilateral) or 6 (triangle)")
}

/// Writes the element as a list of its nodes. Written by hand, like the `Deserialize` of elements: a list made for
/// every element of a large mesh takes longer than the text.
impl Serialize for Element {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.iter())
    }
}

impl<'de> Deserialize<'de> for Element {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_seq(Nodes)
    }
}

/// Reads the nodes of an element.
struct Nodes;

impl<'de> Visitor<'de> for Nodes {
    type Value = Element;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // as of any list
        f.write_str("a sequence")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Element, A::Error> {
        let (mut nodes, mut count) = ([0; 8], 0);
        while let Some(node) = list.next_element()? {
            if let Some(place) = nodes.get_mut(count) {
                *place = node;
            }
            count += 1;
        }
        match nodes.get(..count) {
            Some(nodes) => Element::try_from(nodes).map_err(A::Error::custom),
            None => Err(A::Error::custom(wrong_count(count))),
        }
    }
}

impl JsonSchema for Element {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Element".into()
    }

    fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({
            "description": "Node numbers from 0: eight of a quadrilateral or six of a triangle; corners counter-clockwise, then the midsides from the side 1–2 on.",
            "type": "array",
            "items": generator.subschema_for::<u32>(),
            "minItems": 6,
            "maxItems": 8,
            "not": {"minItems": 7, "maxItems": 7},
        })
    }
}

impl Family {
    /// The number of corners, and of sides.
    pub fn corners(self) -> usize {
        match self {
            Family::Quad => 4,
            Family::Triangle => 3,
        }
    }

    /// The number of nodes.
    pub fn nodes(self) -> usize {
        2 * self.corners()
    }

    /// Master coordinates of the nodes.
    pub fn places(self) -> &'static [[f64; 2]] {
        match self {
            Family::Quad => &quad8::NODES,
            Family::Triangle => &tri6::NODES,
        }
    }

    /// Sides as local nodes (corner, corner, midside), counter-clockwise.
    pub fn sides(self) -> &'static [[usize; 3]] {
        match self {
            Family::Quad => &quad8::SIDES,
            Family::Triangle => &tri6::SIDES,
        }
    }

    /// The shape functions h_i(ξ, η).
    pub fn shape(self, [xi, eta]: [f64; 2]) -> AtNodes<f64> {
        match self {
            Family::Quad => quad8::shape(xi, eta),
            Family::Triangle => tri6::shape(xi, eta),
        }
    }

    /// Master coordinates of the centre.
    pub fn centre(self) -> [f64; 2] {
        match self {
            Family::Quad => [0.0; 2],
            Family::Triangle => [1.0 / 3.0; 2],
        }
    }

    /// A function that is 1 at the centre and 0 on all sides, and its derivatives by ξ and η.
    pub fn bubble(self, [xi, eta]: [f64; 2]) -> (f64, [f64; 2]) {
        match self {
            Family::Quad => quad8::bubble(xi, eta),
            Family::Triangle => tri6::bubble(xi, eta),
        }
    }

    /// The rule of thesis 2.3 for quadrilaterals, 3 × 3 or 2 × 2 points, ξ running fastest; for triangles 7 points
    /// (degree 5) or 3 points (degree 2).
    pub fn rule(self, order: u32) -> &'static [GaussPoint] {
        match (self, order) {
            (Family::Quad, 2) => &gauss::QUAD_2,
            (Family::Quad, _) => &gauss::QUAD_3,
            (Family::Triangle, 2) => &gauss::TRIANGLE_2,
            (Family::Triangle, _) => &gauss::TRIANGLE_3,
        }
    }

    /// The points with the most accurate stresses. From these points stresses are extrapolated linearly to the nodes
    /// (bilinearly in a quadrilateral).
    pub fn stress_points(self) -> &'static [GaussPoint] {
        self.rule(2)
    }

    /// The weights of the stress points in the linear extrapolation to a place.
    pub fn from_stress_points(self, [xi, eta]: [f64; 2]) -> [f64; 4] {
        match self {
            Family::Quad => {
                let g = gauss::GAUSS_2[1].0;
                let (p, q) = (
                    [0.5 * (1.0 - xi / g), 0.5 * (1.0 + xi / g)],
                    [0.5 * (1.0 - eta / g), 0.5 * (1.0 + eta / g)],
                );
                [p[0] * q[0], p[1] * q[0], p[0] * q[1], p[1] * q[1]]
            }
            // 1 at its own point, 0 at the other two
            Family::Triangle => [
                5.0 / 3.0 - 2.0 * (xi + eta),
                2.0 * xi - 1.0 / 3.0,
                2.0 * eta - 1.0 / 3.0,
                0.0,
            ],
        }
    }

    /// The map T_e of thesis (2.8) at a place, for an element with node positions `nodes`.
    pub fn map(self, nodes: &AtNodes<[f64; 2]>, place: [f64; 2]) -> Mapped {
        self.tabulate(place).map(nodes)
    }

    /// Tabulates the shape functions at a place of the master element.
    pub fn tabulate(self, [xi, eta]: [f64; 2]) -> Tabulated {
        let (shape, derivative) = match self {
            Family::Quad => (quad8::shape(xi, eta), quad8::derivative(xi, eta)),
            Family::Triangle => (tri6::shape(xi, eta), tri6::derivative(xi, eta)),
        };
        Tabulated {
            nodes: self.nodes(),
            shape,
            derivative,
        }
    }
}

/// The shape functions and their derivatives at a place of the master element.
#[derive(Clone, Debug)]
pub struct Tabulated {
    nodes: usize,
    shape: AtNodes<f64>,
    /// The derivatives dh_i/dξ and dh_i/dη.
    derivative: AtNodes<[f64; 2]>,
}

/// The derivatives of an element's map T_e at a place.
#[derive(Clone, Copy, Debug)]
pub struct Jacobian {
    /// The determinant of dx_b/dξ_a; ≤ 0 where the element is inverted.
    pub det: f64,
    /// The derivatives of the master coordinates, dξ_a/dx_b.
    pub inverse: [[f64; 2]; 2],
}

impl Jacobian {
    /// The derivatives of the map, from dx_b/dξ_a.
    #[inline(always)]
    pub fn new([[j00, j01], [j10, j11]]: [[f64; 2]; 2]) -> Self {
        let det = j00 * j11 - j01 * j10;
        Jacobian {
            det,
            inverse: [[j11 / det, -j10 / det], [-j01 / det, j00 / det]],
        }
    }
}

impl Tabulated {
    /// Maps the place to an element with node positions `nodes`.
    #[inline(always)]
    pub fn map(&self, nodes: &AtNodes<[f64; 2]>) -> Mapped {
        let mut jacobian = [[0.0; 2]; 2]; // jacobian[a][b] = dx_b / dξ_a
        for i in 0..self.nodes {
            for a in 0..2 {
                for b in 0..2 {
                    jacobian[a][b] += self.derivative[i][a] * nodes[i][b];
                }
            }
        }
        self.map_with(&Jacobian::new(jacobian), nodes)
    }

    /// Maps the place to an element with node positions `nodes`, whose map has these derivatives there.
    #[inline(always)]
    pub fn map_with(&self, jacobian: &Jacobian, nodes: &AtNodes<[f64; 2]>) -> Mapped {
        let [xi, eta] = jacobian.inverse;
        let gradient = self
            .derivative
            .map(|[p, q]| [xi[0] * p + eta[0] * q, xi[1] * p + eta[1] * q]);
        let x = (0..self.nodes).map(|i| self.shape[i] * nodes[i][0]).sum();
        Mapped {
            shape: self.shape,
            gradient,
            det: jacobian.det,
            x,
        }
    }

    /// The derivatives dh_i/dξ and dh_i/dη.
    pub fn derivative(&self) -> &AtNodes<[f64; 2]> {
        &self.derivative
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FAMILIES: [Family; 2] = [Family::Quad, Family::Triangle];

    #[test]
    fn shapes_are_one_at_their_own_node_and_zero_at_the_others() {
        for family in FAMILIES {
            for (i, &place) in family.places().iter().enumerate() {
                for (j, h) in family.shape(place).into_iter().enumerate() {
                    assert_eq!(h, if i == j { 1.0 } else { 0.0 }, "{family:?}");
                }
            }
        }
    }

    #[test]
    fn shapes_sum_to_one_and_derivatives_match_differences() {
        let (xi, eta, step) = (0.3, 0.4, 1e-6);
        for family in FAMILIES {
            let sum: f64 = family.shape([xi, eta]).iter().sum();
            assert!((sum - 1.0).abs() < 1e-15);
            let exact = match family {
                Family::Quad => quad8::derivative(xi, eta),
                Family::Triangle => tri6::derivative(xi, eta),
            };
            for a in 0..2 {
                let shifted = |by: f64| {
                    let mut place = [xi, eta];
                    place[a] += by;
                    family.shape(place)
                };
                let (plus, minus) = (shifted(step), shifted(-step));
                for i in 0..8 {
                    let difference = (plus[i] - minus[i]) / (2.0 * step);
                    assert!((exact[i][a] - difference).abs() < 1e-9);
                }
            }
        }
    }

    #[test]
    fn a_bubble_is_one_at_the_centre_and_vanishes_on_the_sides() {
        for family in FAMILIES {
            assert!((family.bubble(family.centre()).0 - 1.0).abs() < 1e-15);
            for &[a, b, _] in family.sides() {
                let (a, b) = (family.places()[a], family.places()[b]);
                let on_side = [0, 1].map(|k| 0.3 * a[k] + 0.7 * b[k]);
                assert!(family.bubble(on_side).0.abs() < 1e-15, "{family:?}");
            }
            let (place, step) = ([0.3, 0.4], 1e-6);
            for a in 0..2 {
                let shifted = |by: f64| {
                    let mut place = place;
                    place[a] += by;
                    family.bubble(place).0
                };
                let difference = (shifted(step) - shifted(-step)) / (2.0 * step);
                assert!((family.bubble(place).1[a] - difference).abs() < 1e-8);
            }
        }
    }

    #[test]
    fn gradients_of_a_distorted_element_reproduce_a_linear_field() {
        let quad = [
            [0.0, 0.0],
            [2.0, 0.1],
            [2.3, 1.7],
            [-0.2, 1.5],
            [1.0, -0.1],
            [2.2, 0.9],
            [1.0, 1.7],
            [-0.1, 0.8],
        ];
        let triangle = [
            [0.0, 0.0],
            [2.0, 0.1],
            [0.3, 1.7],
            [1.0, -0.1],
            [1.2, 1.0],
            [0.1, 0.8],
            [0.0; 2],
            [0.0; 2],
        ];
        for (family, nodes) in [(Family::Quad, quad), (Family::Triangle, triangle)] {
            let m = family.map(&nodes, [0.2, 0.4]);
            let d = |b: usize| {
                (0..family.nodes())
                    .map(|i| m.gradient[i][b] * (3.0 * nodes[i][0] - 2.0 * nodes[i][1]))
                    .sum::<f64>()
            };
            assert!((d(0) - 3.0).abs() < 1e-14 && (d(1) + 2.0).abs() < 1e-14);
            assert!(m.det > 0.0);
        }
    }

    #[test]
    fn a_linear_stress_is_extrapolated_exactly() {
        let linear = |[xi, eta]: [f64; 2]| 3.0 - 2.0 * xi + 0.7 * eta;
        for family in FAMILIES {
            for &place in family.places() {
                let weights = family.from_stress_points(place);
                let carried: f64 = family
                    .stress_points()
                    .iter()
                    .zip(weights)
                    .map(|(point, w)| w * linear(point.place))
                    .sum();
                assert!((carried - linear(place)).abs() < 1e-14, "{family:?}");
            }
        }
    }

    #[test]
    fn an_element_is_a_list_of_eight_or_six_numbers() {
        let quad: Element = serde_json::from_str("[0,1,2,3,4,5,6,7]").unwrap();
        assert_eq!(quad.family(), Family::Quad);
        let triangle: Element = serde_json::from_str("[0,1,2,3,4,5]").unwrap();
        assert_eq!(triangle.sides().last(), Some([2, 0, 5]));
        assert_eq!(serde_json::to_string(&triangle).unwrap(), "[0,1,2,3,4,5]");
        let error = serde_json::from_str::<Element>("[0,1,2,3,4,5,6]").unwrap_err();
        assert!(error.to_string().contains("7 nodes"));
    }
}
