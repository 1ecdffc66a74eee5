//! Eigenvalues and singular vectors of small matrices.

use faer::Mat;
use faer::linalg::solvers::Solve;

/// A small matrix, by rows.
pub type Rows = Vec<Vec<f64>>;

/// The eigenvalues λ, as real and imaginary parts, with det(λ² A + λ B + C) = 0, for a regular A. `None` if the
/// iterations for them fail, or a matrix is not finite.
pub fn quadratic_eigenvalues(a: &Rows, b: &Rows, c: &Rows) -> Option<Vec<[f64; 2]>> {
    let n = a.len();
    let [a, b, c] = [a, b, c].map(matrix);
    let factor = a.partial_piv_lu();
    let (b, c) = (factor.solve(&b), factor.solve(&c));
    // (x, λ x) ↦ (λ x, −A⁻¹ C x − A⁻¹ B λ x)
    let companion = Mat::from_fn(2 * n, 2 * n, |i, j| match (i < n, j < n) {
        (true, true) => 0.0,
        (true, false) => f64::from(u8::from(i == j - n)),
        (false, true) => -c[(i - n, j)],
        (false, false) => -b[(i - n, j - n)],
    });
    let finite = (0..2 * n).all(|j| (0..2 * n).all(|i| companion[(i, j)].is_finite()));
    let found = finite.then(|| companion.eigenvalues())?.ok()?;
    Some(
        found
            .into_iter()
            .map(|value| [value.re, value.im])
            .collect(),
    )
}

/// The pairs of vectors (w, g) of the `count` smallest singular values of A: |A g| and |wᵀ A| equal the singular value.
/// `None` if A is not finite, or its decomposition fails.
pub fn near_null(a: &Rows, count: usize) -> Option<Vec<[Vec<f64>; 2]>> {
    let n = a.len();
    let finite = a.iter().flatten().all(|value| value.is_finite());
    let found = finite.then(|| matrix(a).svd())?.ok()?;
    let column = |of: faer::MatRef<'_, f64>, k: usize| (0..n).map(|i| of[(i, k)]).collect();
    let pair = |k: usize| [column(found.U(), k), column(found.V(), k)];
    Some((n.saturating_sub(count)..n).map(pair).collect())
}

fn matrix(rows: &Rows) -> Mat<f64> {
    Mat::from_fn(rows.len(), rows.len(), |i, j| rows[i][j])
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn eigenvalues_solve_their_equations_and_null_vectors_are_null() {
        // (λ − 2)(λ − 3) and λ² + 1
        let a = vec![vec![1.0, 0.0], vec![0.0, 1.0]];
        let b = vec![vec![-5.0, 0.0], vec![0.0, 0.0]];
        let c = vec![vec![6.0, 0.0], vec![0.0, 1.0]];
        let mut found = quadratic_eigenvalues(&a, &b, &c).unwrap();
        found.sort_by(|x, y| x[0].total_cmp(&y[0]).then(x[1].total_cmp(&y[1])));
        for (found, exact) in found
            .iter()
            .zip([[0.0, -1.0], [0.0, 1.0], [2.0, 0.0], [3.0, 0.0]])
        {
            assert!(
                (0..2).all(|k| (found[k] - exact[k]).abs() < 1e-12),
                "{found:?}"
            );
        }
        let singular = vec![vec![1.0, 2.0], vec![2.0, 4.0]];
        let [w, g] = near_null(&singular, 1).unwrap().remove(0);
        for i in 0..2 {
            assert!((singular[i][0] * g[0] + singular[i][1] * g[1]).abs() < 1e-12);
            assert!((singular[0][i] * w[0] + singular[1][i] * w[1]).abs() < 1e-12);
        }
    }
}
