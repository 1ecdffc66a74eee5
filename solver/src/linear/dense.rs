//! Dense symmetric matrices.

use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};

use super::blocked::{self, NoFactor};
use super::interrupt::{Interrupt, PORTION, Stopped, zeros};

/// A dense symmetric matrix, by columns, both triangles stored.
#[derive(Clone, Debug, PartialEq)]
pub struct Dense {
    size: usize,
    values: Vec<f64>,
}

impl Dense {
    /// A matrix of zeros; `None` if it does not fit into memory.
    pub fn try_zero(size: usize, interrupt: &mut Interrupt<'_>) -> Result<Option<Self>, Stopped> {
        let values = zeros(size.saturating_mul(size), interrupt)?;
        Ok(values.map(|values| Dense { size, values }))
    }

    /// The memory for a matrix with `size` rows (bytes).
    pub fn bytes(size: usize) -> u64 {
        (size as u64).saturating_mul(size as u64).saturating_mul(8)
    }

    /// The number of rows.
    pub fn size(&self) -> usize {
        self.size
    }

    /// Column `j`, which is also row `j`, since the matrix is symmetric.
    pub fn column(&self, j: usize) -> &[f64] {
        &self.values[j * self.size..(j + 1) * self.size]
    }

    /// The entry in row `i` and column `j`.
    pub fn at(&self, i: usize, j: usize) -> f64 {
        self.values[j * self.size + i]
    }

    /// Sets the entries (i, j) and (j, i).
    pub fn set(&mut self, i: usize, j: usize, value: f64) {
        self.values[j * self.size + i] = value;
        self.values[i * self.size + j] = value;
    }

    /// All values by columns. A caller writes the lower triangle only; [`Dense::mirror`] completes the matrix.
    pub(super) fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }

    /// Copies the lower triangle to the upper one, by blocks that fit into the cache.
    pub(super) fn mirror(&mut self, interrupt: &mut Interrupt<'_>) -> Result<(), Stopped> {
        const TILE: usize = 32;
        let n = self.size;
        for first in (0..n).step_by(TILE) {
            for under in (first..n).step_by(TILE) {
                for i in under..n.min(under + TILE) {
                    for j in first..i.min(first + TILE) {
                        self.values[i * n + j] = self.values[j * n + i];
                    }
                }
            }
            interrupt.worked((TILE * (n - first)) as f64)?;
        }
        Ok(())
    }

    /// The product A v. It takes less time if blocks of `v` are zero.
    pub fn times(&self, v: &[f64]) -> Vec<f64> {
        let mut product = vec![0.0; self.size];
        pulp::Arch::new().dispatch(|| add_columns(&self.values, v, &mut product));
        product
    }
}

/// Adds v_j times the columns a_j of a matrix to `sum`, several columns at once, since each pass over `sum` is as long
/// as a column. The order of the additions does not depend on the machine.
#[inline(always)]
fn add_columns(columns: &[f64], v: &[f64], sum: &mut [f64]) {
    /// The number of columns that are added at once.
    const TOGETHER: usize = 8;
    let n = sum.len();
    for (columns, v) in columns.chunks(TOGETHER * n.max(1)).zip(v.chunks(TOGETHER)) {
        match <[f64; TOGETHER]>::try_from(v) {
            Ok(v) if v == [0.0; TOGETHER] => {}
            Ok(v) => {
                let column: [&[f64]; TOGETHER] =
                    std::array::from_fn(|j| &columns[j * n..(j + 1) * n]);
                for (i, sum) in sum.iter_mut().enumerate() {
                    let term = |j: usize| column[j][i] * v[j];
                    let halves = [
                        (term(0) + term(1)) + (term(2) + term(3)),
                        (term(4) + term(5)) + (term(6) + term(7)),
                    ];
                    *sum += halves[0] + halves[1];
                }
            }
            Err(_) => {
                for (column, v) in columns.chunks(n).zip(v) {
                    sum.iter_mut().zip(column).for_each(|(s, a)| *s += a * v);
                }
            }
        }
    }
}

/// Why a dense system has no solution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unsolved {
    /// The matrix is not positive definite, or has no inverse.
    Singular,
    /// The matrix does not fit into memory.
    TooLarge {
        /// The number of bytes that the matrix would take.
        bytes: u64,
    },
    /// The observer stopped the work.
    Stopped,
}

impl From<Stopped> for Unsolved {
    fn from(_: Stopped) -> Self {
        Unsolved::Stopped
    }
}

impl From<NoFactor> for Unsolved {
    fn from(error: NoFactor) -> Self {
        match error {
            NoFactor::NotPositiveDefinite(_) => Unsolved::Singular,
            NoFactor::Stopped => Unsolved::Stopped,
        }
    }
}

/// The factor L of Cholesky's factorisation A = L Lᵀ, in the lower triangle.
pub struct Cholesky {
    size: usize,
    values: Vec<f64>,
}

impl Cholesky {
    /// Factors A + Σ aᵢⱼ eᵢeⱼᵀ. `entry`: the entries of A; `additions`: the (i, j, aᵢⱼ), a symmetric list; the sum is
    /// positive definite. `room`: a factor that is no longer needed, whose memory is reused, since the first touch of
    /// memory takes as long as the factor of a small matrix.
    pub fn new(
        size: usize,
        entry: impl Fn(usize, usize) -> f64,
        additions: &[(usize, usize, f64)],
        room: Option<Cholesky>,
        interrupt: &mut Interrupt<'_>,
    ) -> Result<Self, Unsolved> {
        let bytes = Dense::bytes(size);
        let count = size.saturating_mul(size);
        let mut values = match room {
            Some(Cholesky { mut values, .. }) if values.capacity() >= count => {
                values.resize(count, 0.0);
                values
            }
            _ => zeros(count, interrupt)?.ok_or(Unsolved::TooLarge { bytes })?,
        };
        // the factorisation reads the lower triangle only
        for (j, column) in values.chunks_exact_mut(size.max(1)).enumerate() {
            (j..size).for_each(|i| column[i] = entry(i, j));
            interrupt.worked((size - j) as f64)?;
        }
        let mut a = MatMut::from_column_major_slice_mut(&mut values, size, size);
        for &(i, j, value) in additions.iter().filter(|(i, j, _)| i >= j) {
            a[(i, j)] += value;
        }
        blocked::cholesky(a, interrupt)?;
        Ok(Cholesky { size, values })
    }

    /// Solves A x = b; x overwrites b.
    pub fn solve(&self, b: &mut [f64]) {
        let l = MatRef::from_column_major_slice(&self.values, self.size, self.size);
        let b = MatMut::from_column_major_slice_mut(b, self.size, 1);
        blocked::solve_cholesky(l, b);
    }
}

/// Solves A x = b for a positive definite A, given by its entries `entry`.
pub fn solve_positive_definite(
    size: usize,
    entry: impl Fn(usize, usize) -> f64,
    b: &[f64],
    interrupt: &mut Interrupt<'_>,
) -> Result<Vec<f64>, Unsolved> {
    let mut x = b.to_vec();
    Cholesky::new(size, entry, &[], None, interrupt)?.solve(&mut x);
    Ok(x)
}

/// A general square matrix, by columns.
pub struct General {
    size: usize,
    values: Vec<f64>,
}

impl General {
    /// A matrix of zeros; `None` if it does not fit into memory.
    pub fn try_zero(size: usize, interrupt: &mut Interrupt<'_>) -> Result<Option<Self>, Stopped> {
        let values = zeros(size.saturating_mul(size), interrupt)?;
        Ok(values.map(|values| General { size, values }))
    }

    /// Column `j`, to be written.
    pub fn column_mut(&mut self, j: usize) -> &mut [f64] {
        &mut self.values[j * self.size..(j + 1) * self.size]
    }

    /// Adds the product of a matrix `left`, by columns, and a matrix `right`, by rows. Rows of `left` before the first and after
    /// the last that are not zero cost nothing.
    pub fn add_product(
        &mut self,
        left: &[f64],
        right: &[f64],
        interrupt: &mut Interrupt<'_>,
    ) -> Result<(), Stopped> {
        let n = self.size;
        let inner = left.len().checked_div(n).unwrap_or(0);
        let zero = |row: &usize| (0..inner).all(|k| left[k * n + row] == 0.0);
        let low = (0..n).take_while(zero).count();
        let rows = n - low - (low..n).rev().take_while(zero).count();
        let left = MatRef::from_column_major_slice(left, n, inner).subrows(low, rows);
        let right = MatRef::from_row_major_slice(right, inner, n);
        // so few columns at once that whoever asks to stop does not wait for long
        let work = (rows * inner).max(1);
        let columns = (PORTION as usize / work).max(1);
        for first in (0..n).step_by(columns) {
            let count = columns.min(n - first);
            let part = &mut self.values[first * n..(first + count) * n];
            let part = MatMut::from_column_major_slice_mut(part, n, count);
            matmul(
                part.subrows_mut(low, rows),
                Accum::Add,
                left,
                right.subcols(first, count),
                1.0,
                Par::Seq,
            );
            interrupt.worked((work * count) as f64)?;
        }
        Ok(())
    }

    /// Transposes the matrix in place.
    pub fn transpose(&mut self, interrupt: &mut Interrupt<'_>) -> Result<(), Stopped> {
        /// The cost of reading one value across the columns, in multiplications.
        const ACROSS: usize = 8;
        for j in 0..self.size {
            for i in 0..j {
                self.values.swap(j * self.size + i, i * self.size + j);
            }
            interrupt.worked((ACROSS * j) as f64)?;
        }
        Ok(())
    }

    /// Solves A x = b for one right-hand side `b`, or for several stored one after another; the factors overwrite A.
    pub fn solve(mut self, b: &[f64], interrupt: &mut Interrupt<'_>) -> Result<Vec<f64>, Unsolved> {
        let n = self.size;
        let mut x = b.to_vec();
        let columns = b.len().checked_div(n).unwrap_or(0);
        let a = MatMut::from_column_major_slice_mut(&mut self.values, n, n);
        let b = MatMut::from_column_major_slice_mut(&mut x, n, columns);
        blocked::solve_lu(a, b, interrupt)?;
        if x.iter().all(|x| x.is_finite()) {
            Ok(x)
        } else {
            Err(Unsolved::Singular)
        }
    }
}

/// The x with the smallest |Σ x_k a_k − b| for the `columns` a_k, by Gram–Schmidt. Columns that depend almost linearly
/// on the others are left out. `None` without columns, or if the result is not finite.
pub fn least_squares(columns: &[Vec<f64>], b: &[f64]) -> Option<Vec<f64>> {
    /// A column whose remainder is below this fraction of the largest column is left out.
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
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// Runs work without stopping it.
    fn go_on<T>(work: impl FnOnce(&mut Interrupt<'_>) -> T) -> T {
        work(&mut Interrupt::new(&mut || false))
    }

    fn general(size: usize, entry: impl Fn(usize, usize) -> f64) -> General {
        let mut a = go_on(|interrupt| General::try_zero(size, interrupt))
            .unwrap()
            .unwrap();
        (0..size).for_each(|j| (0..size).for_each(|i| a.column_mut(j)[i] = entry(i, j)));
        a
    }

    /// Irregular numbers between −½ and ½.
    fn number(i: usize, j: usize) -> f64 {
        let mixed = (i * 7919 + j * 104_729 + i * j * 31 + 12_345) % 10_007;
        mixed as f64 / 10_007.0 - 0.5
    }

    #[test]
    fn a_general_system_is_solved_and_a_singular_one_refused() {
        let solve = |columns: [[f64; 2]; 2]| {
            go_on(|interrupt| general(2, |i, j| columns[j][i]).solve(&[4.0, 14.0], interrupt))
        };
        assert_eq!(solve([[0.0, 2.0], [1.0, 3.0]]), Ok(vec![1.0, 4.0]));
        let singular = solve([[0.0, 0.0], [1.0, 3.0]]);
        assert_eq!(singular, Err(Unsolved::Singular));
    }

    /// Systems of any size are solved by blocks: in one piece, in several blocks, and not a multiple of a block. Some
    /// diagonals are zero, so that rows must be exchanged.
    #[test]
    fn systems_of_any_size_are_solved_by_blocks() {
        for n in [1, 5, 64, 255, 256, 257, 300, 511, 700] {
            let exact: Vec<f64> = (0..n).map(|i| number(i, 3)).collect();
            let entry = |i: usize, j: usize| {
                if i == j && i.is_multiple_of(3) {
                    0.0
                } else {
                    number(i, j)
                }
            };
            let row = |i: usize| (0..n).map(|j| entry(i, j) * exact[j]).sum();
            let b: Vec<f64> = (0..n).map(row).collect();
            if n > 1 {
                let x = go_on(|interrupt| general(n, entry).solve(&b, interrupt)).unwrap();
                let off = x.iter().zip(&exact).map(|(a, b)| (a - b).abs());
                assert!(off.fold(0.0, f64::max) < 1e-8, "{n}");
            }
            // symmetric and diagonally dominant
            let entry = |i: usize, j: usize| {
                let off = number(i.max(j), i.min(j));
                if i == j { n as f64 } else { off }
            };
            let row = |i: usize| (0..n).map(|j| entry(i, j) * exact[j]).sum();
            let b: Vec<f64> = (0..n).map(row).collect();
            let x = go_on(|interrupt| solve_positive_definite(n, entry, &b, interrupt)).unwrap();
            let off = x.iter().zip(&exact).map(|(a, b)| (a - b).abs());
            assert!(off.fold(0.0, f64::max) < 1e-13, "{n}");
        }
    }

    #[test]
    fn a_late_pivot_that_is_not_positive_is_found_in_its_block() {
        let entry = |i: usize, j: usize| match (i == j, i) {
            (true, 600) => -1.0,
            (true, _) => 1.0,
            (false, _) => 0.0,
        };
        let b = vec![1.0; 700];
        let refused = go_on(|interrupt| solve_positive_definite(700, entry, &b, interrupt));
        assert_eq!(refused, Err(Unsolved::Singular));
    }

    /// Every kind of dense work with 1,500 unknowns, which are several portions, stops at the first interruption point.
    #[test]
    fn dense_work_stops_when_it_is_told_to() {
        let n = 1500;
        let b = vec![1.0; n];
        let mut asked = 0;
        let mut stop = || {
            asked += 1;
            true
        };
        let entry = |i: usize, j: usize| if i == j { 1.0 } else { 0.0 };
        let solved = solve_positive_definite(n, entry, &b, &mut Interrupt::new(&mut stop));
        assert_eq!(solved, Err(Unsolved::Stopped));
        let solved = general(n, entry).solve(&b, &mut Interrupt::new(&mut stop));
        assert_eq!(solved, Err(Unsolved::Stopped));
        assert_eq!(asked, 2);
    }

    #[test]
    fn a_matrix_that_fits_into_no_memory_is_refused() {
        assert_eq!(
            go_on(|interrupt| Dense::try_zero(1 << 31, interrupt)),
            Ok(None)
        );
        assert!(
            go_on(|interrupt| General::try_zero(usize::MAX, interrupt))
                .unwrap()
                .is_none()
        );
        assert_eq!(Dense::bytes(1 << 40), u64::MAX);
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
        let a: fn(usize, usize) -> f64 = |i, j| [[3.0, 1.5], [1.5, 3.0]][i][j];
        let additions = [(0, 0, 1.0), (0, 1, -0.5), (1, 0, -0.5)];
        let solve = |a: fn(usize, usize) -> f64, additions: &[_]| {
            go_on(|interrupt| {
                let mut x = vec![6.0, 7.0];
                Cholesky::new(2, a, additions, None, interrupt)?.solve(&mut x);
                Ok(x)
            })
        };
        let x = solve(a, &additions).unwrap();
        assert!((x[0] - 1.0).abs() < 1e-15 && (x[1] - 2.0).abs() < 1e-15);
        let indefinite: fn(usize, usize) -> f64 = |i, j| [[3.0, 4.0], [4.0, 3.0]][i][j];
        assert_eq!(solve(indefinite, &[]), Err(Unsolved::Singular));
    }
}
