//! A dense symmetric system with some unknowns eliminated, and their recovery from the others.

use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::{
    solve_lower_triangular_in_place, solve_upper_triangular_in_place,
};
use faer::{Accum, MatMut, MatRef, Par};

use super::blocked;
use super::dense::{Dense, Unsolved};
use super::interrupt::{Interrupt, zeros};

/// The columns of the Cholesky factor L for the eliminated unknowns, which are the first ones.
pub struct Eliminated {
    size: usize,
    count: usize,
    /// The values by columns, each of `size` rows.
    columns: Vec<f64>,
}

impl Eliminated {
    /// Eliminates the first `count` of `size` unknowns of a positive definite A, given by its entries. Also returns the
    /// Schur complement for the other unknowns.
    pub fn new(
        size: usize,
        count: usize,
        entry: impl Fn(usize, usize) -> f64,
        interrupt: &mut Interrupt<'_>,
    ) -> Result<(Self, Dense), Unsolved> {
        let bytes = Dense::bytes(size);
        let values = zeros(size.saturating_mul(size), interrupt)?;
        let mut values = values.ok_or(Unsolved::TooLarge { bytes })?;
        for (j, column) in values.chunks_exact_mut(size.max(1)).enumerate() {
            (j..size).for_each(|i| column[i] = entry(i, j));
            interrupt.worked((size - j) as f64)?;
        }
        let a = MatMut::from_column_major_slice_mut(&mut values, size, size);
        blocked::eliminate(a, count, interrupt)?;
        let rest = size - count;
        let mut left = Dense::try_zero(rest, interrupt)?.ok_or(Unsolved::TooLarge { bytes })?;
        for j in 0..rest {
            let from = (count + j) * size + count;
            left.values_mut()[j * rest + j..(j + 1) * rest]
                .copy_from_slice(&values[from + j..from + rest]);
        }
        left.mirror(interrupt)?;
        values.truncate(count * size);
        values.shrink_to_fit();
        let eliminated = Eliminated {
            size,
            count,
            columns: values,
        };
        Ok((eliminated, left))
    }

    /// Reduces a right-hand side: L⁻¹ b for the eliminated unknowns, and the reduced right-hand side for the others.
    pub fn reduce(&self, b: &mut [f64]) {
        let (on_diagonal, below) = self.parts();
        let (own, rest) = b.split_at_mut(self.count);
        let mut own = MatMut::from_column_major_slice_mut(own, self.count, 1);
        let rest = MatMut::from_column_major_slice_mut(rest, self.size - self.count, 1);
        solve_lower_triangular_in_place(on_diagonal, own.as_mut(), Par::Seq);
        matmul(rest, Accum::Add, below, own.as_ref(), -1.0, Par::Seq);
    }

    /// Completes a solution, from the result of [`Eliminated::reduce`] for the eliminated unknowns and the solution for
    /// the others.
    pub fn expand(&self, x: &mut [f64]) {
        let (on_diagonal, below) = self.parts();
        let (own, rest) = x.split_at_mut(self.count);
        let mut own = MatMut::from_column_major_slice_mut(own, self.count, 1);
        let rest = MatRef::from_column_major_slice(rest, self.size - self.count, 1);
        matmul(
            own.as_mut(),
            Accum::Add,
            below.transpose(),
            rest,
            -1.0,
            Par::Seq,
        );
        solve_upper_triangular_in_place(on_diagonal.transpose(), own, Par::Seq);
    }

    fn parts(&self) -> (MatRef<'_, f64>, MatRef<'_, f64>) {
        MatRef::from_column_major_slice(&self.columns, self.size, self.count)
            .split_at_row(self.count)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// Elimination gives the same solution as the whole matrix, in one piece and in several blocks.
    #[test]
    fn the_reduced_system_has_the_same_solution() {
        for (n, count) in [(5, 2), (300, 130), (300, 0), (40, 40)] {
            let entry = |i: usize, j: usize| {
                if i == j {
                    n as f64
                } else {
                    ((7 * (i + j) + i * j) % 11) as f64 / 11.0
                }
            };
            let exact: Vec<f64> = (0..n).map(|i| (i as f64).sin()).collect();
            let row = |i: usize| (0..n).map(|j| entry(i, j) * exact[j]).sum();
            let mut b: Vec<f64> = (0..n).map(row).collect();
            let never = &mut || false;
            let (eliminated, left) =
                Eliminated::new(n, count, entry, &mut Interrupt::new(never)).unwrap();
            eliminated.reduce(&mut b);
            let remains = left.times(&exact[count..]);
            for (a, b) in remains.iter().zip(&b[count..]) {
                assert!((a - b).abs() < 1e-11, "{n} {count}: {a} {b}");
            }
            let mut x = [&b[..count], &exact[count..]].concat();
            eliminated.expand(&mut x);
            let off = x.iter().zip(&exact).map(|(a, b)| (a - b).abs());
            assert!(off.fold(0.0, f64::max) < 1e-13, "{n} {count}");
        }
    }
}
