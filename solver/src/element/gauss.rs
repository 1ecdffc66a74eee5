//! Gauss–Legendre integration on [−1, 1], thesis 2.3, and on the master elements.

/// An integration point in master coordinates, with its weight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GaussPoint {
    /// The master coordinates ξ and η.
    pub place: [f64; 2],
    /// The weight; the weights of all points of a rule add up to the area of the master element.
    pub weight: f64,
}

/// Points and weights of the 3-point rule, exact for polynomials of degree 5.
#[rustfmt::skip]
pub const GAUSS_3: [(f64, f64); 3] = [
    (-0.774_596_669_241_483_4, 5.0 / 9.0),
    ( 0.0,                     8.0 / 9.0),
    ( 0.774_596_669_241_483_4, 5.0 / 9.0),
];

/// Points and weights of the 2-point rule; its points are the superconvergent stress points of the
/// 8-node element.
#[rustfmt::skip]
pub const GAUSS_2: [(f64, f64); 2] = [
    (-0.577_350_269_189_625_7, 1.0),
    ( 0.577_350_269_189_625_7, 1.0),
];

/// The rule of 2 or 3 points, thesis 2.3.
pub fn of_order(order: u32) -> &'static [(f64, f64)] {
    if order == 2 { &GAUSS_2 } else { &GAUSS_3 }
}

/// 3 × 3 points of a quadrilateral, ξ running fastest.
pub const QUAD_3: [GaussPoint; 9] = product(&GAUSS_3);

/// 2 × 2 points of a quadrilateral, ξ running fastest.
pub const QUAD_2: [GaussPoint; 4] = product(&GAUSS_2);

const fn product<const N: usize, const M: usize>(rule: &[(f64, f64); N]) -> [GaussPoint; M] {
    let mut points = [GaussPoint {
        place: [0.0; 2],
        weight: 0.0,
    }; M];
    let mut k = 0;
    while k < M {
        let ((xi, w_xi), (eta, w_eta)) = (rule[k % N], rule[k / N]);
        points[k] = GaussPoint {
            place: [xi, eta],
            weight: w_xi * w_eta,
        };
        k += 1;
    }
    points
}

/// 3 points of a triangle, exact for polynomials of degree 2; the points with the most accurate stresses.
pub const TRIANGLE_2: [GaussPoint; 3] = [
    at(1.0 / 6.0, 1.0 / 6.0, 1.0 / 6.0),
    at(2.0 / 3.0, 1.0 / 6.0, 1.0 / 6.0),
    at(1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0),
];

/// 7 points of a triangle (Radon), exact for polynomials of degree 5: the centre, and on each median
/// at (6 ± √15)/21 with the weights (155 ± √15)/2400.
pub const TRIANGLE_3: [GaussPoint; 7] = {
    const ROOT: f64 = 3.872_983_346_207_417;
    const NEAR: f64 = (6.0 - ROOT) / 21.0;
    const FAR: f64 = (6.0 + ROOT) / 21.0;
    const W_NEAR: f64 = (155.0 - ROOT) / 2400.0;
    const W_FAR: f64 = (155.0 + ROOT) / 2400.0;
    [
        at(1.0 / 3.0, 1.0 / 3.0, 9.0 / 80.0),
        at(NEAR, NEAR, W_NEAR),
        at(1.0 - 2.0 * NEAR, NEAR, W_NEAR),
        at(NEAR, 1.0 - 2.0 * NEAR, W_NEAR),
        at(FAR, FAR, W_FAR),
        at(1.0 - 2.0 * FAR, FAR, W_FAR),
        at(FAR, 1.0 - 2.0 * FAR, W_FAR),
    ]
};

const fn at(xi: f64, eta: f64, weight: f64) -> GaussPoint {
    GaussPoint {
        place: [xi, eta],
        weight,
    }
}

/// Points and weights of the n-point rule.
///
/// The points are the roots of the Legendre polynomial P_n, by Newton's method from the usual
/// cosine guess; the weights are 2/((1 − x²) P_n′²). Written by hand: it is a dozen lines, and a
/// crate for it has a hundred other rules.
pub fn rule(n: usize) -> Vec<(f64, f64)> {
    let root = |i: usize| {
        let mut x = -(std::f64::consts::PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
        let mut slope = 1.0;
        for _ in 0..20 {
            let (value, derivative) = legendre(n, x);
            slope = derivative;
            let dx = value / derivative;
            x -= dx;
            if dx.abs() < 1e-16 {
                break;
            }
        }
        (x, 2.0 / ((1.0 - x * x) * slope * slope))
    };
    (0..n).map(root).collect()
}

/// The Legendre polynomial P_n(x) and its derivative, by the three-term recurrence.
fn legendre(n: usize, x: f64) -> (f64, f64) {
    let (mut previous, mut current) = (1.0, x);
    for k in 2..=n {
        let k = k as f64;
        let next = ((2.0 * k - 1.0) * x * current - (k - 1.0) * previous) / k;
        (previous, current) = (current, next);
    }
    (current, n as f64 * (x * current - previous) / (x * x - 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rule_of_n_points_integrates_degree_2n_minus_1_exactly() {
        for n in [2, 3, 12, 40] {
            for degree in 0..2 * n {
                let sum: f64 = rule(n).iter().map(|(x, w)| w * x.powi(degree as i32)).sum();
                let exact = if degree % 2 == 0 {
                    2.0 / (degree as f64 + 1.0)
                } else {
                    0.0
                };
                assert!(
                    (sum - exact).abs() < 1e-14,
                    "n = {n}, degree {degree}: {sum}"
                );
            }
        }
    }

    #[test]
    fn the_written_rules_are_the_computed_ones() {
        for ((x, w), (x3, w3)) in rule(3).into_iter().zip(GAUSS_3) {
            assert!((x - x3).abs() < 1e-15 && (w - w3).abs() < 1e-15);
        }
        assert!((rule(2)[1].0 - GAUSS_2[1].0).abs() < 1e-15);
    }

    /// The integral of ξ^a η^b over the master triangle is a! b! / (a + b + 2)!.
    #[test]
    fn the_rules_of_a_triangle_are_exact_to_their_degree() {
        let factorial = |n: i32| (1..=n).map(f64::from).product::<f64>();
        for (rule, degree) in [(&TRIANGLE_2[..], 2), (&TRIANGLE_3[..], 5)] {
            for a in 0..=degree {
                for b in 0..=degree - a {
                    let exact = factorial(a) * factorial(b) / factorial(a + b + 2);
                    let term = |p: &GaussPoint| p.weight * p.place[0].powi(a) * p.place[1].powi(b);
                    let sum: f64 = rule.iter().map(term).sum();
                    assert!((sum - exact).abs() < 1e-15, "{a}, {b}: {sum} for {exact}");
                }
            }
        }
    }
}
