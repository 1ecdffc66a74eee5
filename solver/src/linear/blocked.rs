//! Factorisations of dense matrices that can be interrupted: block by block, as faer computes them, with interruption
//! points between blocks. faer's own factorisations return only at the end, which takes minutes for the thousands of
//! unknowns of a long contact.
//!
//! A matrix of at most [`WHOLE`] rows is factored by faer in one piece.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{self as llt, LltError};
use faer::linalg::lu::partial_pivoting::factor as lu;
use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::linalg::triangular_solve::{
    solve_lower_triangular_in_place, solve_unit_lower_triangular_in_place,
    solve_upper_triangular_in_place,
};
use faer::prelude::{Reborrow, ReborrowMut};
use faer::{Accum, MatMut, Par};

use super::interrupt::{Interrupt, Stopped};

/// The largest number of rows of a matrix that is factored in one piece.
const WHOLE: usize = 256;

/// The number of columns of a block: the size that faer uses too, so that factors have the same bits as faer's.
const BLOCK: usize = 128;

/// The number of columns that a block updates before the next interruption point.
pub(super) const STRIP: usize = 256;

/// No parallelism inside faer: its parallel kernels do not promise the same bits.
const PAR: Par = Par::Seq;

/// Why there is no Cholesky factor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NoFactor {
    /// The pivot in this row is not positive.
    NotPositiveDefinite(usize),
    /// The observer stopped the work.
    Stopped,
}

impl From<Stopped> for NoFactor {
    fn from(_: Stopped) -> Self {
        NoFactor::Stopped
    }
}

/// Computes A = L Lᵀ in place, in the lower triangle; the upper one is neither read nor written, except within the
/// blocks on the diagonal.
pub(super) fn cholesky(a: MatMut<'_, f64>, interrupt: &mut Interrupt<'_>) -> Result<(), NoFactor> {
    let n = a.nrows();
    eliminate(a, n, interrupt)
}

/// Computes the first `count` columns of the Cholesky factor in place; the Schur complement replaces the other rows and
/// columns.
pub(super) fn eliminate(
    mut a: MatMut<'_, f64>,
    count: usize,
    interrupt: &mut Interrupt<'_>,
) -> Result<(), NoFactor> {
    let n = a.nrows();
    let block = if n <= WHOLE { n } else { BLOCK };
    let request = llt::cholesky_in_place_scratch::<f64>(block, PAR, Default::default());
    let mut memory = MemBuffer::new(request);
    for start in (0..count).step_by(block.max(1)) {
        let size = block.min(count - start);
        let rest = n - start - size;
        let (mut diagonal, _, mut below, mut trailing) = a
            .rb_mut()
            .submatrix_mut(start, start, n - start, n - start)
            .split_at_mut(size, size);
        let stack = MemStack::new(&mut memory);
        llt::cholesky_in_place(
            diagonal.rb_mut(),
            Default::default(),
            PAR,
            stack,
            Default::default(),
        )
        .map_err(|LltError::NonPositivePivot { index }| {
            NoFactor::NotPositiveDefinite(start + index)
        })?;
        solve_lower_triangular_in_place(diagonal.rb(), below.rb_mut().transpose_mut(), PAR);
        interrupt.worked((size * size * (size + rest)) as f64 / 2.0)?;
        // the lower triangle of what is left: trailing −= below belowᵀ, some columns at a time
        for first in (0..rest).step_by(STRIP) {
            let width = STRIP.min(rest - first);
            let rows = rest - first;
            let strip = trailing.rb_mut().submatrix_mut(first, first, rows, width);
            let (on_diagonal, under) = strip.split_at_row_mut(width);
            let (left, left_under) = below.rb().subrows(first, rows).split_at_row(width);
            triangular::matmul(
                on_diagonal,
                BlockStructure::TriangularLower,
                Accum::Add,
                left,
                BlockStructure::Rectangular,
                left.transpose(),
                BlockStructure::Rectangular,
                -1.0,
                PAR,
            );
            matmul(under, Accum::Add, left_under, left.transpose(), -1.0, PAR);
            interrupt.worked((rows * width * size) as f64)?;
        }
    }
    Ok(())
}

/// Solves L Lᵀ x = b in place, L from [`cholesky`].
pub(super) fn solve_cholesky(l: faer::MatRef<'_, f64>, mut b: MatMut<'_, f64>) {
    solve_lower_triangular_in_place(l, b.rb_mut(), PAR);
    solve_upper_triangular_in_place(l.transpose(), b, PAR);
}

/// Solves A x = b in place by P A = L U with partial pivoting; L and U overwrite A.
pub(super) fn solve_lu(
    mut a: MatMut<'_, f64>,
    mut b: MatMut<'_, f64>,
    interrupt: &mut Interrupt<'_>,
) -> Result<(), Stopped> {
    let n = a.nrows();
    let block = if n <= WHOLE { n } else { BLOCK };
    let request = lu::lu_in_place_scratch::<usize, f64>(n, block, PAR, Default::default());
    let mut memory = MemBuffer::new(request);
    let (mut order, mut inverse) = (vec![0usize; n], vec![0usize; n]);
    let mut swapped = vec![0.0; n];
    for start in (0..n).step_by(block.max(1)) {
        let size = block.min(n - start);
        let rows = n - start;
        let (order, inverse) = (&mut order[..rows], &mut inverse[..rows]);
        let (mut before, mut from) = a.rb_mut().subrows_mut(start, rows).split_at_col_mut(start);
        let (mut panel, mut after) = from.rb_mut().split_at_col_mut(size);
        let stack = MemStack::new(&mut memory);
        let (_, rows_taken) = lu::lu_in_place(
            panel.rb_mut(),
            order,
            inverse,
            PAR,
            stack,
            Default::default(),
        );
        // the panel's swaps of rows, in the columns beside it and in b
        let (taken, _) = rows_taken.arrays();
        let mut swap = |mut columns: MatMut<'_, f64>| {
            for j in 0..columns.ncols() {
                let mut column = columns.rb_mut().col_mut(j);
                (0..rows).for_each(|i| swapped[i] = column[taken[i]]);
                (0..rows).for_each(|i| column[i] = swapped[i]);
            }
        };
        swap(before.rb_mut());
        swap(after.rb_mut());
        swap(b.rb_mut().subrows_mut(start, rows));
        interrupt.worked((rows * size * size + 4 * rows * n) as f64)?;
        let (on_diagonal, below) = panel.rb().split_at_row(size);
        let rest = n - start - size;
        for first in (0..rest).step_by(STRIP) {
            let width = STRIP.min(rest - first);
            let strip = after.rb_mut().subcols_mut(first, width);
            let (mut upper, under) = strip.split_at_row_mut(size);
            solve_unit_lower_triangular_in_place(on_diagonal, upper.rb_mut(), PAR);
            matmul(under, Accum::Add, below, upper.rb(), -1.0, PAR);
            interrupt.worked((rows * width * size) as f64)?;
        }
    }
    solve_unit_lower_triangular_in_place(a.rb(), b.rb_mut(), PAR);
    solve_upper_triangular_in_place(a.rb(), b, PAR);
    Ok(())
}
