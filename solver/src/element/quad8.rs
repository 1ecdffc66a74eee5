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

/// h_i(ξ, η).
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

/// dh_i/dξ and dh_i/dη.
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

/// What an integral over a real element needs at one of its points.
#[derive(Clone, Copy, Debug)]
pub struct Mapped {
    /// h_i.
    pub shape: [f64; 8],
    /// dh_i/dx and dh_i/dy.
    pub gradient: [[f64; 2]; 8],
    /// det J of the map; ≤ 0 where the element is inverted.
    pub det: f64,
    /// First coordinate: x, or the radius r.
    pub x: f64,
}

/// The map T_e of thesis (2.8) at (ξ, η), for an element with node positions `nodes`.
pub fn map(nodes: &[[f64; 2]; 8], xi: f64, eta: f64) -> Mapped {
    let (shape, local) = (shape(xi, eta), derivative(xi, eta));
    let mut jacobian = [[0.0; 2]; 2]; // jacobian[a][b] = dx_b / dξ_a
    for i in 0..8 {
        for a in 0..2 {
            for b in 0..2 {
                jacobian[a][b] += local[i][a] * nodes[i][b];
            }
        }
    }
    let [[j00, j01], [j10, j11]] = jacobian;
    let det = j00 * j11 - j01 * j10;
    let gradient = local.map(|[p, q]| [(j11 * p - j01 * q) / det, (j00 * q - j10 * p) / det]);
    let x = (0..8).map(|i| shape[i] * nodes[i][0]).sum();
    Mapped {
        shape,
        gradient,
        det,
        x,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_are_one_at_their_own_node_and_zero_at_the_others() {
        for (i, [xi, eta]) in NODES.into_iter().enumerate() {
            for (j, h) in shape(xi, eta).into_iter().enumerate() {
                assert_eq!(h, if i == j { 1.0 } else { 0.0 });
            }
        }
    }

    #[test]
    fn shapes_sum_to_one_and_derivatives_match_differences() {
        let (xi, eta, step) = (0.3, -0.6, 1e-6);
        assert!((shape(xi, eta).iter().sum::<f64>() - 1.0).abs() < 1e-15);
        let (exact, plus, minus) = (
            derivative(xi, eta),
            [shape(xi + step, eta), shape(xi, eta + step)],
            [shape(xi - step, eta), shape(xi, eta - step)],
        );
        for i in 0..8 {
            for a in 0..2 {
                let difference = (plus[a][i] - minus[a][i]) / (2.0 * step);
                assert!((exact[i][a] - difference).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn gradients_of_a_distorted_element_reproduce_a_linear_field() {
        let nodes = [
            [0.0, 0.0],
            [2.0, 0.1],
            [2.3, 1.7],
            [-0.2, 1.5],
            [1.0, -0.1],
            [2.2, 0.9],
            [1.0, 1.7],
            [-0.1, 0.8],
        ];
        let m = map(&nodes, 0.2, 0.4);
        let d = |b: usize| {
            (0..8)
                .map(|i| m.gradient[i][b] * (3.0 * nodes[i][0] - 2.0 * nodes[i][1]))
                .sum::<f64>()
        };
        assert!((d(0) - 3.0).abs() < 1e-14 && (d(1) + 2.0).abs() < 1e-14);
        assert!(m.det > 0.0);
    }
}
