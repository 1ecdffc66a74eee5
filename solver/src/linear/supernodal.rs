//! The numerical Cholesky factor of a sparse matrix, supernode by supernode, with questions in between.
//!
//! This is faer's `factorize_supernodal_numeric_llt` on faer's structure and kernels. That function returns only when
//! all is done, which takes half a minute where a long contact is the last supernode, and no part of it can be called
//! alone.
//!
//! A supernode is a range of columns of L with the same rows below them: a dense block
//!
//! ```text
//!     columns
//!   ┌─────────┐
//!   │ L_ss    │ the columns' own rows
//!   ├─────────┤
//!   │ L_rs    │ the rows of its pattern, sorted
//!   └─────────┘
//! ```
//!
//! From the left: A_s − Σ_d L_d L_dᵀ over the supernodes d before s that have rows in it, then L_ss and L_rs.

use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::prelude::{Reborrow, ReborrowMut};
use faer::sparse::linalg::cholesky::supernodal::SymbolicSupernodalCholesky;
use faer::{Accum, MatMut, MatRef, Par};

use super::blocked::{NoFactor, STRIP, cholesky};
use super::breaks::{Breaks, PORTION};

type Structure = SymbolicSupernodalCholesky<usize>;

const NONE: usize = usize::MAX;

/// The supernode of every column.
pub(super) fn supernode_of_columns(structure: &Structure) -> Vec<usize> {
    let mut of = vec![0; structure.nrows()];
    for s in 0..structure.n_supernodes() {
        of[structure.supernode_begin()[s]..structure.supernode_end()[s]].fill(s);
    }
    of
}

/// Rows below a supernode.
fn pattern(structure: &Structure, s: usize) -> &[usize] {
    let start = structure.col_ptr_for_row_idx()[s];
    &structure.row_idx()[start..start + structure.nnz_per_super()[s]]
}

/// Where the values hold the entry (row, column) of supernode `s`.
pub(super) fn place(structure: &Structure, s: usize, row: usize, column: usize) -> usize {
    let (begin, end) = (structure.supernode_begin()[s], structure.supernode_end()[s]);
    let pattern = pattern(structure, s);
    let local = match row < end {
        true => row - begin,
        false => end - begin + pattern.partition_point(|r| *r < row),
    };
    structure.col_ptr_for_val()[s] + (column - begin) * (end - begin + pattern.len()) + local
}

/// Lines of a product that make one portion of work, where each takes this many multiplications.
fn portion(of_one: usize) -> usize {
    let lines = (PORTION / of_one.max(1) as f64) as usize;
    lines.clamp(FEWEST, STRIP)
}

/// Fewer lines at once would take far more time than their part.
const FEWEST: usize = 16;

/// From the entries of A at their places in `values` to those of L.
pub(super) fn factor(
    structure: &Structure,
    values: &mut [f64],
    breaks: &mut Breaks<'_>,
) -> Result<(), NoFactor> {
    let of = supernode_of_columns(structure);
    let count = structure.n_supernodes();
    // supernodes whose next row lies in a supernode, as lists: the first one of each, and each one's next
    let (mut first, mut next) = (vec![NONE; count], vec![NONE; count]);
    // rows of a pattern that have been used
    let mut used = vec![0; count];
    let mut local = vec![0; structure.nrows()];
    let (mut before, mut update) = (Vec::new(), Vec::new());
    for s in 0..count {
        let (begin, end) = (structure.supernode_begin()[s], structure.supernode_end()[s]);
        let below = pattern(structure, s);
        let (columns, rows) = (end - begin, end - begin + below.len());
        let own = (begin..end).chain(below.iter().copied());
        own.enumerate().for_each(|(i, row)| local[row] = i);
        let (done, rest) = values.split_at_mut(structure.col_ptr_for_val()[s]);
        let block = &mut rest[..rows * columns];

        before.clear();
        let mut d = first[s];
        while d != NONE {
            before.push(d);
            d = next[d];
        }
        before.sort_unstable(); // sums in one order, that of faer
        for &d in &before {
            let pattern_d = pattern(structure, d);
            let columns_d = structure.supernode_end()[d] - structure.supernode_begin()[d];
            let from = used[d];
            let inside = pattern_d[from..].partition_point(|row| *row < end);
            let all = MatRef::from_column_major_slice(
                &done[structure.col_ptr_for_val()[d]..]
                    [..(columns_d + pattern_d.len()) * columns_d],
                columns_d + pattern_d.len(),
                columns_d,
            );
            let pattern_d = &pattern_d[from..];
            let l = all.subrows(columns_d + from, pattern_d.len());
            let mut start = 0;
            while start < inside {
                let height = pattern_d.len() - start;
                let width = portion(height * columns_d).min(inside - start);
                if update.len() < width * height {
                    update.resize(width * height, 0.0);
                }
                let product = &mut update[..width * height];
                let into = MatMut::from_column_major_slice_mut(product, height, width);
                let (left, right) = (l.subrows(start, height), l.subrows(start, width));
                matmul(
                    into,
                    Accum::Replace,
                    left,
                    right.transpose(),
                    -1.0,
                    Par::Seq,
                );
                for (j, product) in product.chunks_exact(height).enumerate() {
                    let column = pattern_d[start + j] - begin;
                    let column = &mut block[column * rows..(column + 1) * rows];
                    let added = pattern_d[start + j..].iter().zip(&product[j..]);
                    added.for_each(|(&row, value)| column[local[row]] += value);
                }
                breaks.after((width * height * (columns_d + 4)) as f64)?;
                start += width;
            }
            used[d] += inside;
            if let Some(&row) = pattern_d.get(inside) {
                next[d] = std::mem::replace(&mut first[of[row]], d);
            }
        }

        let block = MatMut::from_column_major_slice_mut(block, rows, columns);
        let (mut on_diagonal, mut under) = block.split_at_row_mut(columns);
        cholesky(on_diagonal.rb_mut(), breaks).map_err(|error| match error {
            NoFactor::NotPositiveDefinite(pivot) => NoFactor::NotPositiveDefinite(begin + pivot),
            stopped => stopped,
        })?;
        // rows are independent of each other: a large block is solved in parts
        let part = portion(columns * columns);
        for start in (0..below.len()).step_by(part) {
            let height = part.min(below.len() - start);
            let under = under.rb_mut().subrows_mut(start, height);
            solve_lower_triangular_in_place(on_diagonal.rb(), under.transpose_mut(), Par::Seq);
            breaks.after((height * columns * columns) as f64 / 2.0)?;
        }
        if let Some(&row) = below.first() {
            next[s] = std::mem::replace(&mut first[of[row]], s);
        }
    }
    Ok(())
}
