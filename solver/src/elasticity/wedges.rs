//! Wedges of several materials that meet in a point of the surface: how stresses grow towards it.
//!
//! Near the point displacements are sums of r^λ g(θ), and stresses of r^(λ−1): they have no limit where some λ is between 0
//! and 1 (Bogy; Comninou with friction). The angle is divided in elements of straight sides around the point, on which
//! linear displacements are exact; virtual work in r and θ (the scaled boundary finite-element method of Song and Wolf) leaves
//!
//!   P(λ) g = (λ² E⁰ + λ (E¹ᵀ − E¹) − E²) g = 0
//!
//! and tractions on the two outer sides of −P g r^(λ−1). A traction that does not vanish in the point, where λ = 1 is an
//! eigenvalue too, leads to displacements of r ln r, and stresses of ln r.

use std::f64::consts::PI;

use super::material::Moduli;
use crate::element::edge3;
use crate::element::gauss::GAUSS_3;
use crate::linear::{Rows, least_squares, near_null, quadratic_eigenvalues};

/// The largest angle of an element.
const WIDEST: f64 = PI / 12.0;

/// The smallest λ that counts: smaller ones are rigid motions, with λ = 0, moved by rounding.
const LEAST: f64 = 0.05;

/// A λ closer to 1 than this counts as 1: on any mesh r^(λ−1) then looks like ln r.
const NEAR_ONE: f64 = 0.015;

/// A wedge of material between two directions (angles, counter-clockwise).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wedge {
    /// The angles where the wedge begins and ends.
    pub angles: [f64; 2],
    /// The material's moduli.
    pub moduli: Moduli,
}

/// The condition on an outer side of the wedges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Side {
    /// The side slides along a smooth obstacle or a line of symmetry. The number is the traction along the side as a
    /// part of the pressure: positive away from the point on the side where the wedges begin, and towards the point on
    /// the side where they end, which is the same tangent.
    Slides(f64),
    /// The side does not move.
    Sticks,
    /// Nothing touches the side.
    Free,
}

/// How the pressure on the sides grows towards the point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Growth {
    /// The smallest exponent λ, if it is below 1.
    pub exponent: Option<f64>,
    /// The size of the pressure's change when the distance grows by the factor e, caused by a unit traction along the
    /// rubbed sides.
    pub logarithm: f64,
}

/// How the pressure grows towards the point where wedges meet, each of which begins where the one before ends.
/// `rubbed`: on which sides the unit traction of [`Growth::logarithm`] acts. `None` if the growth cannot be computed.
pub fn growth(wedges: &[Wedge], sides: [Side; 2], rubbed: [bool; 2]) -> Option<Growth> {
    let pencil = Pencil::new(wedges, sides);
    let (quadratic, linear, constant) = pencil.restricted();
    let found = quadratic_eigenvalues(&quadratic, &linear, &constant)?;
    let below = found.iter().map(|[re, _]| *re);
    let below = below.filter(|re| (LEAST..1.0 - NEAR_ONE).contains(re));
    let exponent = below.reduce(f64::min);
    let ones = found
        .iter()
        .filter(|[re, im]| (re - 1.0).hypot(*im) <= NEAR_ONE)
        .count();
    Some(Growth {
        exponent,
        logarithm: pencil.logarithm(ones, rubbed)?,
    })
}

/// The matrices E⁰, E¹ᵀ − E¹ and −E² on all unknowns; the unknowns of the outer sides are along normal and tangent.
struct Pencil {
    quadratic: Rows,
    linear: Rows,
    constant: Rows,
    sides: [Side; 2],
}

impl Pencil {
    fn new(wedges: &[Wedge], sides: [Side; 2]) -> Pencil {
        let mut elements: Vec<([f64; 2], &Moduli)> = Vec::new();
        for Wedge { angles, moduli } in wedges {
            let count = ((angles[1] - angles[0]) / WIDEST).ceil().max(1.0) as usize;
            let step = (angles[1] - angles[0]) / count as f64;
            let angle = |k: usize| angles[0] + step * k as f64;
            elements.extend((0..count).map(|k| ([angle(k), angle(k + 1)], moduli)));
        }
        let size = 2 * (2 * elements.len() + 1);
        let zero = || vec![vec![0.0; size]; size];
        let (mut e0, mut e1, mut e2) = (zero(), zero(), zero());
        for (k, ([from, to], moduli)) in elements.iter().enumerate() {
            let [start, end] = [from, to].map(|angle| [angle.cos(), angle.sin()]);
            let middle = [0, 1].map(|a| 0.5 * (start[a] + end[a]));
            let nodes = [2 * k, 2 * k + 2, 2 * k + 1];
            for (eta, weight) in GAUSS_3 {
                let ([x, y], [dx, dy]) = edge3::map(&[start, end, middle], eta);
                let det = x * dy - y * dx;
                let (h, slope) = (edge3::shape(eta), edge3::derivative(eta));
                // strains xx, yy, xy by unit displacements of each node: of u/r and of its change along the side
                let radial = h.map(|h| strains(h, [dy, -dx], det));
                let around = slope.map(|h| strains(h, [-y, x], det));
                for (i, a) in nodes.into_iter().enumerate() {
                    for (j, b) in nodes.into_iter().enumerate() {
                        for p in 0..2 {
                            for q in 0..2 {
                                let work = |left: &[[f64; 3]; 2], right: &[[f64; 3]; 2]| {
                                    weight * det * energy(moduli, &left[p], &right[q])
                                };
                                e0[2 * a + p][2 * b + q] += work(&radial[i], &radial[j]);
                                e1[2 * a + p][2 * b + q] += work(&around[i], &radial[j]);
                                e2[2 * a + p][2 * b + q] += work(&around[i], &around[j]);
                            }
                        }
                    }
                }
            }
        }
        let linear = (0..size).map(|i| (0..size).map(|j| e1[j][i] - e1[i][j]).collect());
        let mut pencil = Pencil {
            linear: linear.collect(),
            constant: e2
                .iter()
                .map(|row| row.iter().map(|e| -e).collect())
                .collect(),
            quadratic: e0,
            sides,
        };
        let (first, last) = (wedges[0].angles[0], wedges[wedges.len() - 1].angles[1]);
        // outward normals; the tangent is the normal turned clockwise
        let normals = [[first.sin(), -first.cos()], [-last.sin(), last.cos()]];
        for (node, [a, b]) in [0, size / 2 - 1].into_iter().zip(normals) {
            for matrix in [
                &mut pencil.quadratic,
                &mut pencil.linear,
                &mut pencil.constant,
            ] {
                turn(matrix, 2 * node, [[a, b], [b, -a]]);
            }
        }
        pencil
    }

    fn size(&self) -> usize {
        self.quadratic.len()
    }

    /// The unknowns of each outer side along its normal and its tangent.
    fn outer(&self) -> [[usize; 2]; 2] {
        let last = self.size() - 2;
        [[0, 1], [last, last + 1]]
    }

    /// The unknowns that are not held.
    fn free(&self) -> Vec<usize> {
        let held: Vec<usize> = self
            .outer()
            .into_iter()
            .zip(self.sides)
            .flat_map(|([n, t], side)| match side {
                Side::Slides(_) => vec![n],
                Side::Sticks => vec![n, t],
                Side::Free => vec![],
            })
            .collect();
        (0..self.size()).filter(|i| !held.contains(i)).collect()
    }

    /// The matrices on the free unknowns, where the tractions along sliding sides are parts of the pressure.
    fn restricted(&self) -> (Rows, Rows, Rows) {
        let free = self.free();
        let of = |matrix: &Rows| -> Rows {
            let row = |i: &usize| {
                let own = self
                    .outer()
                    .into_iter()
                    .zip(self.sides)
                    .find(|([_, t], _)| t == i);
                let rubs = match own {
                    // traction t = part · p, and p = −traction n
                    Some(([n, _], Side::Slides(part))) => Some((n, part)),
                    _ => None,
                };
                let entry =
                    |j: &usize| matrix[*i][*j] + rubs.map_or(0.0, |(n, part)| part * matrix[n][*j]);
                free.iter().map(entry).collect()
            };
            free.iter().map(row).collect()
        };
        (of(&self.quadratic), of(&self.linear), of(&self.constant))
    }

    /// [`Growth::logarithm`] where λ = 1 is an eigenvalue `ones` times: u = r (g₁ + ln r g₀) with P(1) g₀ = 0 and
    /// P(1) g₁ + P′(1) g₀ + f = 0, which g₁ solves if w · (P′(1) g₀ + f) = 0 for all w with wᵀ P(1) = 0.
    fn logarithm(&self, ones: usize, rubbed: [bool; 2]) -> Option<f64> {
        if ones == 0 || rubbed == [false; 2] {
            return Some(0.0);
        }
        let free = self.free();
        let (quadratic, linear, constant) = self.restricted();
        let n = free.len();
        let combined = |q: f64, l: f64, c: f64| -> Rows {
            let entry =
                |i: usize, j: usize| q * quadratic[i][j] + l * linear[i][j] + c * constant[i][j];
            (0..n)
                .map(|i| (0..n).map(|j| entry(i, j)).collect())
                .collect()
        };
        let (at_one, slope) = (combined(1.0, 1.0, 1.0), combined(2.0, 1.0, 0.0));
        let pairs = near_null(&at_one, ones.min(n))?;
        let times = |matrix: &Rows, g: &[f64]| -> Vec<f64> {
            matrix.iter().map(|row| dot(row, g)).collect()
        };
        let tangents: Vec<usize> = self
            .outer()
            .iter()
            .zip(rubbed)
            .filter(|(_, rubbed)| *rubbed)
            .map(|([_, t], _)| *t)
            .collect();
        let load: Vec<f64> = free
            .iter()
            .map(|i| f64::from(u8::from(tangents.contains(i))))
            .collect();
        let columns: Vec<Vec<f64>> = pairs
            .iter()
            .map(|[_, g]| {
                let moved = times(&slope, g);
                pairs.iter().map(|[w, _]| dot(w, &moved)).collect()
            })
            .collect();
        let wanted: Vec<f64> = pairs.iter().map(|[w, _]| -dot(w, &load)).collect();
        let parts = least_squares(&columns, &wanted)?;
        let mut g = vec![0.0; self.size()];
        for ([_, own], part) in pairs.iter().zip(parts) {
            free.iter()
                .zip(own)
                .for_each(|(&i, own)| g[i] += part * own);
        }
        let change = self.outer().map(|[n, _]| {
            let of = |matrix: &Rows| dot(&matrix[n], &g);
            (of(&self.quadratic) + of(&self.linear) + of(&self.constant)).abs()
        });
        Some(change[0].max(change[1]))
    }
}

/// The strains ε_xx, ε_yy and γ_xy of unit displacements along x and y, for a shape function with given derivatives.
fn strains(h: f64, [a, b]: [f64; 2], det: f64) -> [[f64; 3]; 2] {
    let (dx, dy) = (h * a / det, h * b / det);
    [[dx, 0.0, dy], [0.0, dy, dx]]
}

/// The energy ε : D : ε′.
fn energy(moduli: &Moduli, left: &[f64; 3], right: &[f64; 3]) -> f64 {
    let of = |i: usize| dot(&moduli[i][..3], right);
    (0..3).map(|i| left[i] * of(i)).sum()
}

/// Turns the rows and columns of two unknowns, `first` and the next one, to `axes`.
fn turn(matrix: &mut Rows, first: usize, axes: [[f64; 2]; 2]) {
    for row in matrix.iter_mut() {
        let old = [row[first], row[first + 1]];
        (0..2).for_each(|k| row[first + k] = axes[k][0] * old[0] + axes[k][1] * old[1]);
    }
    let old = [matrix[first].clone(), matrix[first + 1].clone()];
    for k in 0..2 {
        let pairs = old[0].iter().zip(&old[1]);
        matrix[first + k] = pairs
            .map(|(a, b)| axes[k][0] * a + axes[k][1] * b)
            .collect();
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::elasticity::material::isotropic;
    use crate::problem::Analysis;

    fn wedge(from: f64, to: f64, modulus: f64) -> Wedge {
        Wedge {
            angles: [from, to].map(f64::to_radians),
            moduli: isotropic(&Analysis::PlaneStrain {}, modulus, 0.3),
        }
    }

    const SMOOTH: [Side; 2] = [Side::Slides(0.0); 2];

    /// A smooth flat obstacle is a line of symmetry: beside an interface at a right angle there is no exponent below 1, and
    /// only friction across two materials leads to a logarithm. A corner of 270° has those of |π/α ± 1|.
    /// A corner between a smooth obstacle and a free side is half of a wedge with free sides: stresses have a limit up to a right
    /// angle, where this is a half-plane, and none beyond.
    #[test]
    fn a_corner_on_a_smooth_obstacle_has_a_limit_up_to_a_right_angle() {
        for sides in [
            [Side::Slides(0.0), Side::Free],
            [Side::Free, Side::Slides(0.0)],
        ] {
            for (degrees, limited) in [
                (45.0, true),
                (80.0, true),
                (90.0, true),
                (100.0, false),
                (135.0, false),
            ] {
                let found = growth(&[wedge(0.0, degrees, 1.0)], sides, [false; 2]).unwrap();
                assert_eq!(found.exponent.is_none(), limited, "{degrees} {found:?}");
            }
            // the edge of a smooth punch on a half-plane
            let edge = growth(&[wedge(0.0, 180.0, 1.0)], sides, [false; 2]).unwrap();
            assert!((edge.exponent.unwrap() - 0.5).abs() < 0.01, "{edge:?}");
        }
    }

    #[test]
    fn smooth_sides_are_lines_of_symmetry() {
        for second in [1.0, 5.0] {
            let found = growth(
                &[wedge(180.0, 270.0, second), wedge(270.0, 360.0, 1.0)],
                SMOOTH,
                [true; 2],
            )
            .unwrap();
            assert_eq!(found.exponent, None);
            assert_eq!(found.logarithm > 1e-3, second > 1.0, "{found:?}");
        }
        let wide = growth(&[wedge(0.0, 270.0, 1.0)], SMOOTH, [false; 2]).unwrap();
        assert!(
            (wide.exponent.unwrap() - 1.0 / 3.0).abs() < 1e-3,
            "{wide:?}"
        );
    }

    /// A corner of angle α that is clamped on both sides has the λ of (κ sin λα)² = (λ sin α)², κ = 3 − 4ν.
    #[test]
    fn a_clamped_corner_has_its_exponent() {
        let (alpha, kappa) = (270f64.to_radians(), 3.0 - 4.0 * 0.3);
        let residual = |l: f64| (kappa * (l * alpha).sin()).powi(2) - (l * alpha.sin()).powi(2);
        let (mut low, mut high) = (0.4, 0.63);
        assert!(residual(low) * residual(high) < 0.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if residual(middle) * residual(low) > 0.0 {
                low = middle
            } else {
                high = middle
            }
        }
        let found = growth(&[wedge(0.0, 270.0, 1.0)], [Side::Sticks; 2], [false; 2]).unwrap();
        assert!(
            (found.exponent.unwrap() - low).abs() < 1e-3,
            "{found:?} {low}"
        );
    }

    /// With Coulomb's friction on a bonded interface the exponent depends on the direction of sliding.
    #[test]
    fn friction_that_follows_the_pressure_changes_the_exponent() {
        let body = [wedge(180.0, 270.0, 5.0), wedge(270.0, 360.0, 1.0)];
        let found = [-0.5, 0.5].map(|part| {
            growth(&body, [Side::Slides(part); 2], [false; 2])
                .unwrap()
                .exponent
        });
        assert!(
            found.iter().any(Option::is_some) && found[0] != found[1],
            "{found:?}"
        );
    }
}
