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

/// Solves A x = b for a general square A given by its columns. `None` when a solution is not finite.
pub fn solve_general(columns: &[Vec<f64>], b: &[f64]) -> Option<Vec<f64>> {
    let n = b.len();
    let a = Mat::from_fn(n, n, |i, j| columns[j][i]);
    let x = a.partial_piv_lu().solve(Mat::from_fn(n, 1, |i, _| b[i]));
    let x: Vec<f64> = (0..n).map(|i| x[(i, 0)]).collect();
    x.iter().all(|x| x.is_finite()).then_some(x)
}

/// The x for which |Σ x_k a_k − b| is least, by Gram–Schmidt; columns that the others nearly span
/// are left out. `None` without columns, or if the result is not finite.
pub fn least_squares(columns: &[Vec<f64>], b: &[f64]) -> Option<Vec<f64>> {
    /// A column whose remainder is below this part of the largest is left out.
    const SPANNED: f64 = 1e-8;
    let norm = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let largest = columns.iter().map(|c| norm(c)).fold(0.0, f64::max);
    // Gram–Schmidt, twice for safety, latest columns first: they matter most
    let mut basis: Vec<(usize, Vec<f64>)> = Vec::new();
    for (k, column) in columns.iter().enumerate().rev() {
        let mut rest = column.clone();
        for _ in 0..2 {
            for (_, q) in &basis {
                let dot: f64 = rest.iter().zip(q).map(|(a, b)| a * b).sum();
                rest.iter_mut().zip(q).for_each(|(a, b)| *a -= dot * b);
            }
        }
        let size = norm(&rest);
        if size > SPANNED * largest {
            rest.iter_mut().for_each(|x| *x /= size);
            basis.push((k, rest));
        }
    }
    if basis.is_empty() {
        return None;
    }
    // R x = Qᵀ b on the columns that were kept
    let m = basis.len();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mut x = vec![0.0; m];
    for i in (0..m).rev() {
        let known: f64 = (i + 1..m)
            .map(|j| dot(&basis[i].1, &columns[basis[j].0]) * x[j])
            .sum();
        x[i] = (dot(&basis[i].1, b) - known) / dot(&basis[i].1, &columns[basis[i].0]);
    }
    let mut weights = vec![0.0; columns.len()];
    basis
        .iter()
        .zip(&x)
        .for_each(|((k, _), x)| weights[*k] = *x);
    weights.iter().all(|w| w.is_finite()).then_some(weights)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_general_system_is_solved_and_a_singular_one_refused() {
        let columns = [vec![0.0, 2.0], vec![1.0, 3.0]];
        assert_eq!(solve_general(&columns, &[4.0, 14.0]), Some(vec![1.0, 4.0]));
        assert_eq!(
            solve_general(&[vec![0.0, 0.0], vec![1.0, 3.0]], &[4.0, 14.0]),
            None
        );
    }

    #[test]
    fn least_squares_leave_out_dependent_columns() {
        let columns = [vec![1.0, 1.0, 1.0], vec![0.0, 1.0, 2.0]];
        let line = least_squares(&columns, &[1.0, 2.0, 6.0]).unwrap();
        assert!((line[0] - 0.5).abs() < 1e-14 && (line[1] - 2.5).abs() < 1e-14);
        let twice = [columns[0].clone(), columns[1].clone(), columns[1].clone()];
        let line = least_squares(&twice, &[1.0, 2.0, 6.0]).unwrap();
        assert!((line[0] - 0.5).abs() < 1e-14 && (line[1] + line[2] - 2.5).abs() < 1e-14);
        assert!(least_squares(&[], &[1.0]).is_none());
        assert!(least_squares(&[vec![0.0]], &[1.0]).is_none());
    }

    #[test]
    fn a_positive_definite_system_is_solved_and_an_indefinite_one_refused() {
        let a = |i: usize, j: usize| [[3.0, 1.5], [1.5, 3.0]][i][j];
        let additions = [(0, 0, 1.0), (0, 1, -0.5), (1, 0, -0.5)];
        let x = solve_positive_definite(2, a, &additions, &[6.0, 7.0]).unwrap();
        assert!((x[0] - 1.0).abs() < 1e-15 && (x[1] - 2.0).abs() < 1e-15);
        assert!(solve_positive_definite(1, |_, _| -1.0, &[], &[1.0]).is_none());
    }
}
