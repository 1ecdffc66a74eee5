//! The formulas of the master elements by which version 1 of the format predicts, bit by bit as they were when that
//! version was made.
//!
//! The formulas are copied from `solver::element`: fields are stored as differences from these predictions, so that a
//! change of one rounding here would make all stored fields unreadable, while the solver may change its own formulas.

use solver::element::{AtNodes, Family};

/// The integration points in master coordinates.
pub(super) fn rule(family: Family, order: u32) -> &'static [[f64; 2]] {
    match (family, order) {
        (Family::Quad, 2) => &QUAD_2,
        (Family::Quad, _) => &QUAD_3,
        (Family::Triangle, 2) => &TRIANGLE_2,
        (Family::Triangle, _) => &TRIANGLE_3,
    }
}

/// The points, in master coordinates, from which stresses are extrapolated to the nodes.
pub(super) fn stress_points(family: Family) -> &'static [[f64; 2]] {
    rule(family, 2)
}

const GAUSS_3: [f64; 3] = [-0.774_596_669_241_483_4, 0.0, 0.774_596_669_241_483_4];
const GAUSS_2: [f64; 2] = [-0.577_350_269_189_625_7, 0.577_350_269_189_625_7];
const QUAD_3: [[f64; 2]; 9] = product(&GAUSS_3);
const QUAD_2: [[f64; 2]; 4] = product(&GAUSS_2);

/// The points of a rule in two dimensions; ξ runs fastest.
const fn product<const N: usize, const M: usize>(rule: &[f64; N]) -> [[f64; 2]; M] {
    let mut places = [[0.0; 2]; M];
    let mut k = 0;
    while k < M {
        places[k] = [rule[k % N], rule[k / N]];
        k += 1;
    }
    places
}

const TRIANGLE_2: [[f64; 2]; 3] = [
    [1.0 / 6.0, 1.0 / 6.0],
    [2.0 / 3.0, 1.0 / 6.0],
    [1.0 / 6.0, 2.0 / 3.0],
];

const TRIANGLE_3: [[f64; 2]; 7] = {
    const ROOT: f64 = 3.872_983_346_207_417;
    const NEAR: f64 = (6.0 - ROOT) / 21.0;
    const FAR: f64 = (6.0 + ROOT) / 21.0;
    [
        [1.0 / 3.0, 1.0 / 3.0],
        [NEAR, NEAR],
        [1.0 - 2.0 * NEAR, NEAR],
        [NEAR, 1.0 - 2.0 * NEAR],
        [FAR, FAR],
        [1.0 - 2.0 * FAR, FAR],
        [FAR, 1.0 - 2.0 * FAR],
    ]
};

/// The master coordinates of the nodes.
pub(super) fn places(family: Family) -> &'static [[f64; 2]] {
    match family {
        Family::Quad => &QUAD,
        Family::Triangle => &TRIANGLE,
    }
}

#[rustfmt::skip]
const QUAD: [[f64; 2]; 8] = [
    [-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0],
    [ 0.0, -1.0], [1.0,  0.0], [0.0, 1.0], [-1.0, 0.0],
];

#[rustfmt::skip]
const TRIANGLE: [[f64; 2]; 6] = [
    [0.0, 0.0], [1.0, 0.0], [0.0, 1.0],
    [0.5, 0.0], [0.5, 0.5], [0.0, 0.5],
];

/// The weights of the stress points in the linear map of stresses to a place (ξ, η).
pub(super) fn from_stress_points(family: Family, [xi, eta]: [f64; 2]) -> [f64; 4] {
    match family {
        Family::Quad => {
            let g = GAUSS_2[1];
            let (p, q) = (
                [0.5 * (1.0 - xi / g), 0.5 * (1.0 + xi / g)],
                [0.5 * (1.0 - eta / g), 0.5 * (1.0 + eta / g)],
            );
            [p[0] * q[0], p[1] * q[0], p[0] * q[1], p[1] * q[1]]
        }
        Family::Triangle => [
            5.0 / 3.0 - 2.0 * (xi + eta),
            2.0 * xi - 1.0 / 3.0,
            2.0 * eta - 1.0 / 3.0,
            0.0,
        ],
    }
}

/// The shape functions h_i(ξ, η).
#[rustfmt::skip]
pub(super) fn shape(family: Family, [xi, eta]: [f64; 2]) -> AtNodes<f64> {
    let zeta = 1.0 - xi - eta;
    match family {
        Family::Quad => std::array::from_fn(|i| {
            let [a, b] = QUAD[i];
            let (p, q) = (1.0 + xi * a, 1.0 + eta * b);
            match i {
                0..=3 => 0.25 * p * q * (xi * a + eta * b - 1.0),
                4 | 6 => 0.5 * (1.0 - xi * xi) * q,
                _     => 0.5 * p * (1.0 - eta * eta),
            }
        }),
        Family::Triangle => [
            zeta * (2.0 * zeta - 1.0), xi * (2.0 * xi - 1.0), eta * (2.0 * eta - 1.0),
            4.0 * zeta * xi,           4.0 * xi * eta,        4.0 * eta * zeta,
            0.0, 0.0,
        ],
    }
}

/// The derivatives dh_i/dξ and dh_i/dη of the shape functions.
#[rustfmt::skip]
fn derivative(family: Family, [xi, eta]: [f64; 2]) -> AtNodes<[f64; 2]> {
    let zeta = 1.0 - xi - eta;
    match family {
        Family::Quad => std::array::from_fn(|i| {
            let [a, b] = QUAD[i];
            let (p, q) = (1.0 + xi * a, 1.0 + eta * b);
            match i {
                0..=3 => [0.25 * a * q * (2.0 * xi * a + eta * b), 0.25 * b * p * (xi * a + 2.0 * eta * b)],
                4 | 6 => [-xi * q,                                 0.5 * b * (1.0 - xi * xi)],
                _     => [0.5 * a * (1.0 - eta * eta),             -eta * p],
            }
        }),
        Family::Triangle => [
            [1.0 - 4.0 * zeta,   1.0 - 4.0 * zeta],
            [4.0 * xi - 1.0,     0.0],
            [0.0,                4.0 * eta - 1.0],
            [4.0 * (zeta - xi),  -4.0 * xi],
            [4.0 * eta,          4.0 * xi],
            [-4.0 * eta,         4.0 * (zeta - eta)],
            [0.0; 2], [0.0; 2],
        ],
    }
}

/// A place of the master element, with the shape functions there.
pub(super) struct Place {
    nodes: usize,
    shape: AtNodes<f64>,
    derivative: AtNodes<[f64; 2]>,
}

/// A place in an element, with the shape functions there.
pub(super) struct Mapped {
    pub(super) shape: AtNodes<f64>,
    /// The derivatives dh_i/dx and dh_i/dy of the shape functions.
    pub(super) gradient: AtNodes<[f64; 2]>,
    /// The first coordinate of the place: x, or the radius.
    pub(super) x: f64,
}

impl Place {
    pub(super) fn new(family: Family, place: [f64; 2]) -> Place {
        Place {
            nodes: family.nodes(),
            shape: shape(family, place),
            derivative: derivative(family, place),
        }
    }

    /// The place in an element with node positions `nodes`.
    pub(super) fn map(&self, nodes: &AtNodes<[f64; 2]>) -> Mapped {
        let mut jacobian = [[0.0; 2]; 2]; // jacobian[a][b] = dx_b / dξ_a
        for i in 0..self.nodes {
            for a in 0..2 {
                for b in 0..2 {
                    jacobian[a][b] += self.derivative[i][a] * nodes[i][b];
                }
            }
        }
        let [[j00, j01], [j10, j11]] = jacobian;
        let det = j00 * j11 - j01 * j10;
        let gradient = self
            .derivative
            .map(|[p, q]| [(j11 * p - j01 * q) / det, (j00 * q - j10 * p) / det]);
        Mapped {
            shape: self.shape,
            gradient,
            x: (0..self.nodes).map(|i| self.shape[i] * nodes[i][0]).sum(),
        }
    }
}
