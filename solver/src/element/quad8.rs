//! The 8-node quadrilateral master element, thesis (2.9).
//!
//! ```text
//!   4-----7-----3        η
//!   |           |        |
//!   8           6        +-- ξ        ξ, η in [−1, 1]
//!   |           |
//!   1-----5-----2
//! ```
//!
//! Corners counter-clockwise, then midsides, as Gmsh and Abaqus number it; the thesis numbers
//! round the edge (its corners are 1, 3, 5, 7).

/// Master coordinates of the nodes.
#[rustfmt::skip]
pub const NODES: [[f64; 2]; 8] = [
    [-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0],
    [ 0.0, -1.0], [1.0,  0.0], [0.0, 1.0], [-1.0, 0.0],
];

/// Sides as local nodes (corner, corner, midside), counter-clockwise.
pub const SIDES: [[usize; 3]; 4] = [[0, 1, 4], [1, 2, 5], [2, 3, 6], [3, 0, 7]];

/// The shape functions h_i(ξ, η).
#[rustfmt::skip]
pub fn shape(xi: f64, eta: f64) -> [f64; 8] {
    std::array::from_fn(|i| {
        let [a, b] = NODES[i];
        let (p, q) = (1.0 + xi * a, 1.0 + eta * b);
        match i {
            0..=3 => 0.25 * p * q * (xi * a + eta * b - 1.0),
            4 | 6 => 0.5 * (1.0 - xi * xi) * q,
            _     => 0.5 * p * (1.0 - eta * eta),
        }
    })
}

/// The bubble function, 0 on all sides, and its derivatives. With it the element has all functions of the 9-node
/// quadrilateral.
#[rustfmt::skip]
pub fn bubble(xi: f64, eta: f64) -> (f64, [f64; 2]) {
    let (p, q) = (1.0 - xi * xi, 1.0 - eta * eta);
    (p * q, [-2.0 * xi * q, -2.0 * eta * p])
}

/// The derivatives dh_i/dξ and dh_i/dη.
#[rustfmt::skip]
pub fn derivative(xi: f64, eta: f64) -> [[f64; 2]; 8] {
    std::array::from_fn(|i| {
        let [a, b] = NODES[i];
        let (p, q) = (1.0 + xi * a, 1.0 + eta * b);
        match i {
            0..=3 => [0.25 * a * q * (2.0 * xi * a + eta * b), 0.25 * b * p * (xi * a + 2.0 * eta * b)],
            4 | 6 => [-xi * q,                                 0.5 * b * (1.0 - xi * xi)],
            _     => [0.5 * a * (1.0 - eta * eta),             -eta * p],
        }
    })
}
