//! One dense front: the Schur complements of its halves are added, the unknowns that it owns are eliminated, and its
//! boundary is reduced (the module `multifrontal` explains how fronts make a factor).

use std::iter;

use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::prelude::{Reborrow, ReborrowMut};
use faer::{Accum, MatMut, MatRef, Par};

use super::blocked::{NoFactor, STRIP, cholesky};
use super::interrupt::{Interrupt, PORTION, Stopped};
use super::parallel::for_each;

/// The lower triangle of a front while it is computed.
pub(super) struct FrontMatrix<'a> {
    /// The number of columns that the front owns.
    pub(super) own: usize,
    /// The number of rows: the unknowns that the front owns, and its boundary.
    pub(super) height: usize,
    /// The columns that the front owns, each of `height` rows.
    pub(super) columns: &'a mut [f64],
    /// The columns of the front's boundary, each with one row for each unknown of the boundary.
    pub(super) left: &'a mut [f64],
}

impl FrontMatrix<'_> {
    /// An entry of the lower triangle.
    pub(super) fn entry(&mut self, row: usize, column: usize) -> &mut f64 {
        let (own, height) = (self.own, self.height);
        match column.checked_sub(own) {
            None => &mut self.columns[column * height + row],
            Some(column) => &mut self.left[column * (height - own) + row - own],
        }
    }

    /// Adds the Schur complement `from` of a half to some of the front's columns. If the half has its unknowns in
    /// another order than the front, entries of its lower triangle that are above the diagonal here are added below it.
    pub(super) fn add(&mut self, runs: &[Run], from: &[f64], which: Columns) {
        let size = runs.iter().map(|run| run.len).sum::<usize>();
        for (k, run) in runs.iter().enumerate() {
            for j in 0..run.len {
                let column = &from[(run.from + j) * size..(run.from + j + 1) * size];
                let to = run.to + j;
                // the rest of this run from the diagonal on, then the runs after it
                self.add_to_column(to, to, &column[run.from + j..run.from + run.len], which);
                for other in &runs[k + 1..] {
                    let entries = &column[other.from..other.from + other.len];
                    if other.to > to {
                        self.add_to_column(to, other.to, entries, which)
                    } else {
                        for (i, entry) in entries.iter().enumerate() {
                            let entry = std::slice::from_ref(entry);
                            self.add_to_column(other.to + i, to, entry, which);
                        }
                    }
                }
            }
        }
    }

    /// Adds `entries` to consecutive entries of a column, if it is one of the columns `which`.
    #[inline(always)]
    fn add_to_column(&mut self, column: usize, row: usize, entries: &[f64], which: Columns) {
        let boundary = self.height - self.own;
        let into = match (which, column.checked_sub(self.own)) {
            (Columns::Own, None) => &mut self.columns[column * self.height + row..],
            (Columns::Left, Some(column)) => &mut self.left[column * boundary + row - self.own..],
            _ => return,
        };
        add(into, entries);
    }

    /// Replaces F_oo and F_bo by L_oo and L_bo, on `threads` threads (o: own unknowns, b: boundary).
    pub(super) fn eliminate(
        &mut self,
        threads: usize,
        interrupt: &mut Interrupt<'_>,
    ) -> Result<(), NoFactor> {
        let (own, height) = (self.own, self.height);
        if own <= NARROW {
            eliminate_narrow(self.columns, height, own)?;
            interrupt.worked((own * own * height) as f64)?;
            return Ok(());
        }
        let block = MatMut::from_column_major_slice_mut(self.columns, height, own);
        let (mut on_diagonal, below) = block.split_at_row_mut(own);
        cholesky(on_diagonal.rb_mut(), interrupt)?;
        // rows are independent of each other: a large block is solved in parts
        let part = portion(own * own);
        let mut rest = Some(below);
        let parts = iter::from_fn(|| {
            let below = rest.take().filter(|below| below.nrows() > 0)?;
            let rows = part.min(below.nrows());
            let (part, below) = below.split_at_row_mut(rows);
            rest = Some(below);
            Some(part)
        });
        let on_diagonal = on_diagonal.rb();
        let solve = |(): &mut (), part: MatMut<'_, f64>, interrupt: &mut Interrupt<'_>| {
            let rows = part.nrows();
            solve_lower_triangular_in_place(on_diagonal, part.transpose_mut(), Par::Seq);
            interrupt.worked((rows * own * own) as f64 / 2.0)
        };
        let threads = threads.min((height - own).div_ceil(part)).max(1);
        Ok(for_each(parts, &mut vec![(); threads], solve, interrupt)?)
    }

    /// Computes F_bb − L_bo L_boᵀ, or −L_bo L_boᵀ alone, in the lower triangle, on `threads` threads (o: own unknowns,
    /// b: boundary).
    pub(super) fn reduce(
        &mut self,
        accum: Accum,
        threads: usize,
        interrupt: &mut Interrupt<'_>,
    ) -> Result<(), Stopped> {
        let (own, boundary) = (self.own, self.height - self.own);
        if own == 0 && accum == Accum::Replace {
            self.left.fill(0.0);
            return Ok(());
        }
        let columns = MatRef::from_column_major_slice(self.columns, self.height, own);
        let l = columns.subrows(own, boundary);
        let left = MatMut::from_column_major_slice_mut(self.left, boundary, boundary);
        // from the diagonal on; the first ones are the longest
        let mut rest = Some(left);
        let strips = iter::from_fn(|| {
            let left = rest.take().filter(|left| left.ncols() > 0)?;
            let width = STRIP.min(left.ncols());
            let start = boundary - left.ncols();
            let (strip, left) = left.split_at_col_mut(width);
            rest = Some(left);
            Some((start, strip.subrows_mut(start, boundary - start)))
        });
        let reduce = |(): &mut (),
                      (start, strip): (usize, MatMut<'_, f64>),
                      interrupt: &mut Interrupt<'_>| {
            let (rows, width) = (strip.nrows(), strip.ncols());
            let (on_diagonal, under) = strip.split_at_row_mut(width);
            let (l, l_under) = l.subrows(start, rows).split_at_row(width);
            if width <= FULL {
                matmul(on_diagonal, accum, l, l.transpose(), -1.0, Par::Seq);
            } else {
                triangular::matmul(
                    on_diagonal,
                    BlockStructure::TriangularLower,
                    accum,
                    l,
                    BlockStructure::Rectangular,
                    l.transpose(),
                    BlockStructure::Rectangular,
                    -1.0,
                    Par::Seq,
                );
            }
            matmul(under, accum, l_under, l.transpose(), -1.0, Par::Seq);
            interrupt.worked((rows * width * own) as f64)
        };
        let threads = threads.min(boundary.div_ceil(STRIP)).max(1);
        for_each(strips, &mut vec![(); threads], reduce, interrupt)
    }
}

/// Fronts that own at most this many columns are eliminated by a simple loop, which costs less than the call of one of
/// faer's kernels.
const NARROW: usize = 24;

/// The largest size of a diagonal block that is computed as a whole, although its lower triangle would be enough.
const FULL: usize = 64;

/// The number of rows of a product that make one portion of work. `of_one`: the multiplications for one row.
fn portion(of_one: usize) -> usize {
    /// The fewest rows of a portion: with fewer, the work would be far less efficient.
    const FEWEST: usize = 16;
    let lines = (PORTION / of_one.max(1) as f64) as usize;
    lines.clamp(FEWEST, STRIP)
}

/// Replaces the first `own` columns of the front by columns of L, several at a time, so that each column to the right
/// of these is read and written only once for all of them.
fn eliminate_narrow(columns: &mut [f64], height: usize, own: usize) -> Result<(), NoFactor> {
    const AT_ONCE: usize = 4;
    pulp::Arch::new().dispatch(|| {
        for start in (0..own).step_by(AT_ONCE) {
            let end = own.min(start + AT_ONCE);
            for k in start..end {
                let (done, rest) = columns.split_at_mut((k + 1) * height);
                let column = &mut done[k * height + k..];
                let pivot = column[0];
                if pivot.is_nan() || pivot <= 0.0 {
                    return Err(NoFactor::NotPositiveDefinite(k));
                }
                let scale = 1.0 / pivot.sqrt();
                column.iter_mut().for_each(|l| *l *= scale);
                let others = rest.chunks_exact_mut(height).take(end - k - 1);
                for (j, other) in others.enumerate() {
                    let factor = column[j + 1];
                    let entries = other[k + 1 + j..].iter_mut().zip(&column[j + 1..]);
                    entries.for_each(|(a, l)| *a -= factor * l);
                }
            }
            if end - start < AT_ONCE {
                break;
            }
            let (done, rest) = columns.split_at_mut(end * height);
            let block: [&[f64]; AT_ONCE] =
                std::array::from_fn(|i| &done[(start + i) * height..(start + i + 1) * height]);
            for (column, j) in rest.chunks_exact_mut(height).zip(end..own) {
                let [p, q, r, s] = block.map(|column| &column[j..]);
                let factors = [p[0], q[0], r[0], s[0]];
                let l = p.iter().zip(q).zip(r.iter().zip(s));
                for (a, ((p, q), (r, s))) in column[j..].iter_mut().zip(l) {
                    *a -= (factors[0] * p + factors[1] * q) + (factors[2] * r + factors[3] * s);
                }
            }
        }
        Ok(())
    })
}

fn add(into: &mut [f64], from: &[f64]) {
    into.iter_mut().zip(from).for_each(|(a, b)| *a += b);
}

/// The columns of a front to which something is added.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Columns {
    /// The columns that the front owns.
    Own,
    /// The columns of the front's boundary.
    Left,
}

/// A run of unknowns that are consecutive both in a half and in the front that contains it.
pub(super) struct Run {
    /// The place of the run's first unknown in the boundary of the half.
    from: usize,
    /// The place of the run's first unknown in the front.
    to: usize,
    len: usize,
}

/// Finds the runs of a half's boundary in the front that contains it. `local`: the places of unknowns in the front.
pub(super) fn find_runs(half: &[u32], local: &[u32], runs: &mut Vec<Run>) {
    runs.clear();
    for (from, &row) in half.iter().enumerate() {
        let to = local[row as usize] as usize;
        match runs.last_mut() {
            Some(run) if run.to + run.len == to => run.len += 1,
            _ => runs.push(Run { from, to, len: 1 }),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// Large fronts are computed in blocks: one that is wide enough for blocks, and one whose reduction takes several
    /// strips.
    #[test]
    fn large_fronts_are_computed_in_blocks() {
        let (own, height) = (150, 150 + STRIP + 100);
        let entry = |i: usize, j: usize| {
            let off = ((i * 7 + j * 7) % 11) as f64 / 100.0;
            if i == j { height as f64 } else { off }
        };
        let mut columns: Vec<f64> = (0..own)
            .flat_map(|j| (0..height).map(move |i| entry(i, j)))
            .collect();
        let boundary = height - own;
        let mut left: Vec<f64> = (own..height)
            .flat_map(|j| (own..height).map(move |i| entry(i, j)))
            .collect();
        let mut front = FrontMatrix {
            own,
            height,
            columns: &mut columns,
            left: &mut left,
        };
        let never = &mut || false;
        let interrupt = &mut Interrupt::new(never);
        front.eliminate(1, interrupt).unwrap();
        front.reduce(Accum::Add, 1, interrupt).unwrap();
        let mut narrow: Vec<f64> = (0..own)
            .flat_map(|j| (0..height).map(move |i| entry(i, j)))
            .collect();
        eliminate_narrow(&mut narrow, height, own).unwrap();
        for j in 0..own {
            for i in j..height {
                let at = j * height + i;
                assert!((columns[at] - narrow[at]).abs() < 1e-12, "{i}, {j}");
            }
        }
        for j in 0..boundary {
            for i in j..boundary {
                let sum: f64 = (0..own)
                    .map(|k| narrow[k * height + own + i] * narrow[k * height + own + j])
                    .sum();
                let expected = entry(own + i, own + j) - sum;
                assert!(
                    (left[j * boundary + i] - expected).abs() < 1e-11,
                    "{i}, {j}"
                );
            }
        }
    }
}
