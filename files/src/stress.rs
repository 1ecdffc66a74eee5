//! Principal stresses and the von Mises stress. The only stress out of the plane is σ_zz, so that one principal stress
//! is σ_zz and the other two are those of Mohr's circle in the plane.

/// The stresses σ_xx, σ_yy, σ_xy, σ_zz at one point.
pub type Stress = [f64; 4];

/// Principal stresses of the 3×3 tensor, largest (most tensile) first.
pub fn principal([xx, yy, xy, zz]: Stress) -> [f64; 3] {
    let centre = 0.5 * (xx + yy);
    let radius = (0.5 * (xx - yy)).hypot(xy);
    let mut values = [centre + radius, centre - radius, zz];
    values.sort_by(|a, b| b.total_cmp(a));
    values
}

/// Equivalent stress of von Mises, with σ_zz also in plane strain.
pub fn von_mises([xx, yy, xy, zz]: Stress) -> f64 {
    let differences = (xx - yy).powi(2) + (yy - zz).powi(2) + (zz - xx).powi(2);
    (0.5 * differences + 3.0 * xy * xy).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn simple_states_have_the_values_of_the_textbook() {
        assert_eq!(principal([-3.0, 5.0, 0.0, 1.0]), [5.0, 1.0, -3.0]);
        assert_eq!(principal([0.0, 0.0, 2.0, 0.0]), [2.0, 0.0, -2.0]);
        assert_eq!(von_mises([7.0, 0.0, 0.0, 0.0]), 7.0);
        assert_eq!(von_mises([4.0, 4.0, 0.0, 4.0]), 0.0);
        assert!((von_mises([0.0, 0.0, 2.0, 0.0]) - 12f64.sqrt()).abs() < 1e-15);
    }

    #[test]
    fn principal_stresses_keep_the_invariants() {
        let stress @ [xx, yy, xy, zz] = [1.5, -2.0, 0.7, 0.4];
        let [a, b, c] = principal(stress);
        assert!(a >= b && b >= c);
        assert!((a + b + c - (xx + yy + zz)).abs() < 1e-14);
        assert!((a * b * c - zz * (xx * yy - xy * xy)).abs() < 1e-14);
        let same = 0.5 * ((a - b).powi(2) + (b - c).powi(2) + (c - a).powi(2));
        assert!((von_mises(stress) - same.sqrt()).abs() < 1e-14);
    }
}
