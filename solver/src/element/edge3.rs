//! The 3-node edge: the side of an 8-node element.
//!
//! ```text
//!   1-------3-------2      ξ = −1, 0, +1 at nodes 1, 3, 2: corners first, then the midside
//! ```
//!
//! The thesis has straight edges only (3.3); the quadratic map here is a superset.

/// The shape functions h_i(ξ).
#[rustfmt::skip]
pub fn shape(xi: f64) -> [f64; 3] {
    [
        0.5 * xi * (xi - 1.0),
        0.5 * xi * (xi + 1.0),
        1.0 - xi * xi,
    ]
}

/// The derivatives dh_i/dξ of the shape functions.
pub fn derivative(xi: f64) -> [f64; 3] {
    [xi - 0.5, xi + 0.5, -2.0 * xi]
}

/// The interpolated value Σ h_i v_i.
pub fn interpolate(h: &[f64; 3], v: &[f64; 3]) -> f64 {
    h[0] * v[0] + h[1] * v[1] + h[2] * v[2]
}

/// Position and dx/dξ at ξ of the edge through the points `x`.
pub fn map(x: &[[f64; 2]; 3], xi: f64) -> ([f64; 2], [f64; 2]) {
    let (h, dh) = (shape(xi), derivative(xi));
    let at = |f: &[f64; 3], a: usize| f[0] * x[0][a] + f[1] * x[1][a] + f[2] * x[2][a];
    ([at(&h, 0), at(&h, 1)], [at(&dh, 0), at(&dh, 1)])
}

/// The place ξ in [−1, 1] with Σ h_i(ξ) v_i = `value`, for v that grow along the edge; clamped to the ends.
pub fn invert(v: &[f64; 3], value: f64) -> f64 {
    // a ξ² + b ξ + c = 0; b > 0, and the root nearest to the edge is the one without cancellation
    let a = 0.5 * (v[0] + v[1]) - v[2];
    let b = 0.5 * (v[1] - v[0]);
    let c = v[2] - value;
    let xi = -2.0 * c / (b + (b * b - 4.0 * a * c).max(0.0).sqrt());
    xi.clamp(-1.0, 1.0)
}

/// The places ξ in [−1, 1] with Σ h_i(ξ) v_i = 0, up to two, including the ends within rounding; no place if all v are
/// 0.
pub fn zeros(v: &[f64; 3]) -> impl Iterator<Item = f64> {
    const ROUNDING: f64 = 1e-9;
    // what is not a number is no root
    roots(v)
        .into_iter()
        .filter(|xi| xi.abs() <= 1.0 + ROUNDING)
        .map(|xi| xi.clamp(-1.0, 1.0))
}

/// The two ξ with Σ h_i(ξ) v_i = 0, on the edge or beyond its ends; not finite where there is none.
pub fn roots(v: &[f64; 3]) -> [f64; 2] {
    // a ξ² + b ξ + c = 0, without cancellation
    let a = 0.5 * (v[0] + v[1]) - v[2];
    let b = 0.5 * (v[1] - v[0]);
    let c = v[2];
    let q = -0.5 * (b + b.signum() * (b * b - 4.0 * a * c).sqrt());
    [q / a, c / q]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_are_one_at_their_own_node_and_sum_to_one() {
        for (i, xi) in [-1.0, 1.0, 0.0].into_iter().enumerate() {
            for (j, h) in shape(xi).into_iter().enumerate() {
                assert_eq!(h, if i == j { 1.0 } else { 0.0 });
            }
        }
        assert!((shape(0.3).iter().sum::<f64>() - 1.0).abs() < 1e-15);
        assert!(derivative(0.3).iter().sum::<f64>().abs() < 1e-15);
    }

    #[test]
    fn zeros_of_a_parabola_are_found_on_the_edge() {
        let of = |f: &dyn Fn(f64) -> f64| {
            let mut found: Vec<f64> = zeros(&[f(-1.0), f(1.0), f(0.0)]).collect();
            found.sort_by(f64::total_cmp);
            found
        };
        let close = |found: Vec<f64>, exact: &[f64]| {
            assert_eq!(found.len(), exact.len(), "{found:?}");
            assert!(found.iter().zip(exact).all(|(a, b)| (a - b).abs() < 1e-14));
        };
        close(of(&|x| x * x - 0.25), &[-0.5, 0.5]);
        close(of(&|x| (x - 0.3) * (x - 4.0)), &[0.3]);
        close(of(&|x| x - 0.7), &[0.7]);
        close(of(&|x| (x + 1.0) * 3.0), &[-1.0]);
        close(of(&|x| x * x + 0.1), &[]);
        close(of(&|_| 2.0), &[]);
        close(of(&|_| 0.0), &[]);
    }

    #[test]
    fn inversion_finds_the_place_also_on_an_uneven_edge() {
        for v in [[0.0, 2.0, 1.0], [1.0, 3.0, 1.8], [-1.0, 1.0, 0.3]] {
            for xi in [-1.0, -0.4, 0.0, 0.7, 1.0] {
                let value = interpolate(&shape(xi), &v);
                assert!((invert(&v, value) - xi).abs() < 1e-14);
            }
        }
    }
}
