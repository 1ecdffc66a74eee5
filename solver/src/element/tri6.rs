//! The 6-node triangular master element.
//!
//! ```text
//!   3
//!   | \           η
//!   6   5         |
//!   |     \       +-- ξ        ξ, η ≥ 0, ξ + η ≤ 1
//!   1---4---2
//! ```
//!
//! Corners counter-clockwise, then midsides, as Gmsh and Abaqus number it. The thesis has no
//! triangles.

/// Master coordinates of the nodes.
#[rustfmt::skip]
pub const NODES: [[f64; 2]; 6] = [
    [0.0, 0.0], [1.0, 0.0], [0.0, 1.0],
    [0.5, 0.0], [0.5, 0.5], [0.0, 0.5],
];

/// Sides as local nodes (corner, corner, midside), counter-clockwise.
pub const SIDES: [[usize; 3]; 3] = [[0, 1, 3], [1, 2, 4], [2, 0, 5]];

/// The shape functions h_i(ξ, η), followed by two zeros.
#[rustfmt::skip]
pub fn shape(xi: f64, eta: f64) -> [f64; 8] {
    let zeta = 1.0 - xi - eta;
    [
        zeta * (2.0 * zeta - 1.0), xi * (2.0 * xi - 1.0), eta * (2.0 * eta - 1.0),
        4.0 * zeta * xi,           4.0 * xi * eta,        4.0 * eta * zeta,
        0.0, 0.0,
    ]
}

/// The bubble function, 0 on all sides, and its derivatives.
#[rustfmt::skip]
pub fn bubble(xi: f64, eta: f64) -> (f64, [f64; 2]) {
    let zeta = 1.0 - xi - eta;
    (27.0 * xi * eta * zeta, [27.0 * eta * (zeta - xi), 27.0 * xi * (zeta - eta)])
}

/// The derivatives dh_i/dξ and dh_i/dη, followed by two zeros.
#[rustfmt::skip]
pub fn derivative(xi: f64, eta: f64) -> [[f64; 2]; 8] {
    let zeta = 1.0 - xi - eta;
    [
        [1.0 - 4.0 * zeta,   1.0 - 4.0 * zeta],
        [4.0 * xi - 1.0,     0.0],
        [0.0,                4.0 * eta - 1.0],
        [4.0 * (zeta - xi),  -4.0 * xi],
        [4.0 * eta,          4.0 * xi],
        [-4.0 * eta,         4.0 * (zeta - eta)],
        [0.0; 2], [0.0; 2],
    ]
}
