//! Dense symmetric matrices.

use faer::linalg::solvers::Solve;
use faer::{Mat, Side};

/// A dense symmetric matrix, by columns, both triangles stored.
#[derive(Clone, Debug, PartialEq)]
pub struct Dense {
    size: usize,
    values: Vec<f64>,
}

impl Dense {
    /// All zeros.
    pub fn zero(size: usize) -> Self {
        Dense {
            size,
            values: vec![0.0; size * size],
        }
    }

    /// Number of rows.
    pub fn size(&self) -> usize {
        self.size
    }

    /// A column; being symmetric, also a row.
    pub fn column(&self, j: usize) -> &[f64] {
        &self.values[j * self.size..(j + 1) * self.size]
    }

    /// An entry.
    pub fn at(&self, i: usize, j: usize) -> f64 {
        self.values[j * self.size + i]
    }

    /// Sets the entries (i, j) and (j, i).
    pub fn set(&mut self, i: usize, j: usize, value: f64) {
        self.values[j * self.size + i] = value;
        self.values[i * self.size + j] = value;
    }

    /// A v.
    pub fn times(&self, v: &[f64]) -> Vec<f64> {
        (0..self.size)
            .map(|i| self.column(i).iter().zip(v).map(|(a, b)| a * b).sum())
            .collect()
    }
}

/// Solves (A + Σ aᵢⱼ eᵢeⱼᵀ) x = b: A positive definite, given by its entries; `additions` lists
/// (i, j, aᵢⱼ), symmetric. `None` when the sum is not positive definite.
pub fn solve_positive_definite(
    size: usize,
    entry: impl Fn(usize, usize) -> f64,
    additions: &[(usize, usize, f64)],
    b: &[f64],
) -> Option<Vec<f64>> {
    // the factorisation reads the lower triangle only
    let mut a = Mat::from_fn(size, size, |i, j| if i >= j { entry(i, j) } else { 0.0 });
    for &(i, j, value) in additions.iter().filter(|(i, j, _)| i >= j) {
        a[(i, j)] += value;
    }
    let factor = a.llt(Side::Lower).ok()?;
    let x = factor.solve(Mat::from_fn(size, 1, |i, _| b[i]));
    Some((0..size).map(|i| x[(i, 0)]).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_positive_definite_system_is_solved_and_an_indefinite_one_refused() {
        let a = |i: usize, j: usize| [[3.0, 1.5], [1.5, 3.0]][i][j];
        let additions = [(0, 0, 1.0), (0, 1, -0.5), (1, 0, -0.5)];
        let x = solve_positive_definite(2, a, &additions, &[6.0, 7.0]).unwrap();
        assert!((x[0] - 1.0).abs() < 1e-15 && (x[1] - 2.0).abs() < 1e-15);
        assert!(solve_positive_definite(1, |_, _| -1.0, &[], &[1.0]).is_none());
    }
}
