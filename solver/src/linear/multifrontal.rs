//! The Cholesky factor of a body's stiffness by dense fronts, without a global matrix.
//!
//! Along the tree of a [`Dissection`], the front of a part is a dense matrix on the unknowns it owns (o) and on those of
//! its boundary (b). Of a part that is not divided it is the sum of its elements' matrices; of any other, what its halves
//! have left:
//!
//! ```text
//!   F = | F_oo  F_ob |      F_oo = L_oo L_ooᵀ      L_bo = F_bo L_oo⁻ᵀ      left: F_bb − L_bo L_boᵀ
//!       | F_bo  F_bb |
//! ```
//!
//! Unknowns are numbered in the order of their elimination, the kept ones last. These are never eliminated, so what the
//! whole mesh leaves is their Schur complement: Ŝ = A_cc − A_ci A_ii⁻¹ A_ic.

use faer::Accum;

use super::blocked::NoFactor;
use super::breaks::{Breaks, Stopped, untouched_zeros};
use super::dense::Dense;
use super::front::{Columns, FrontMatrix, Run, find_runs};
use super::fronts::{Front, Fronts, Piece, Space};
use super::parallel::for_each;

/// Unknowns of the largest element.
const ELEMENT: usize = 16;

/// One element's part of the matrix.
#[derive(Clone, Default)]
pub struct ElementMatrix {
    /// Its unknowns; none where a displacement is prescribed, or the element has fewer.
    pub unknowns: [Option<u32>; ELEMENT],
    /// Symmetric.
    pub entries: [[f64; ELEMENT]; ELEMENT],
}

/// The reason why there is no factor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FactorError {
    /// The matrix is not positive definite: a pivot is not positive.
    NotPositiveDefinite {
        /// Its unknown.
        unknown: usize,
    },
    /// An element's matrix is not finite.
    NonFinite,
    /// It does not fit into memory.
    TooLarge {
        /// What it would take.
        bytes: u64,
    },
    /// Stopped on request.
    Stopped,
}

impl From<Stopped> for FactorError {
    fn from(_: Stopped) -> Self {
        FactorError::Stopped
    }
}

/// L of the eliminated unknowns.
pub struct Factor {
    pub(super) fronts: Fronts,
    /// The columns of every front, each from the diagonal on.
    pub(super) values: Vec<f64>,
}

impl Factor {
    /// Factors the sum of the elements' matrices, and returns Ŝ with it. Each of `elements` puts the matrix of an element
    /// with a given number in place; there are as many threads as of these.
    pub fn new<E: FnMut(u32, &mut ElementMatrix) + Send>(
        fronts: Fronts,
        elements: Vec<E>,
        breaks: &mut Breaks<'_>,
    ) -> Result<(Self, Dense), FactorError> {
        let threads = elements.len();
        let bytes = fronts.bytes(threads);
        let too_large = FactorError::TooLarge { bytes };
        let mut values = untouched_zeros(fronts.len).ok_or(too_large)?;
        // all memory is taken by this thread, which has to answer for it
        let mut above = Memory::new(&fronts, fronts.above, threads).ok_or(too_large)?;
        let mut of_threads = Vec::with_capacity(threads);
        for element in elements {
            let memory = Memory::new(&fronts, fronts.branch, 1).ok_or(too_large)?;
            of_threads.push((memory, Assembly::new(element, fronts.unknowns)));
        }
        let bytes = Dense::bytes(fronts.kept);
        let schur = Dense::try_zero(fronts.kept, breaks)?;
        let mut schur = schur.ok_or(FactorError::TooLarge { bytes })?;
        let mut rest = &mut values[..];
        for group in fronts.pieces.chunk_by(|a, b| a.branch && b.branch) {
            let mut values = Vec::with_capacity(group.len());
            for piece in group {
                let (own, others) = rest.split_at_mut(piece.len);
                values.push(own);
                rest = others;
            }
            match group {
                [piece] if !piece.branch => {
                    let front = &fronts.fronts[piece.fronts.start];
                    let is_whole = piece.fronts.end == fronts.fronts.len();
                    let left = is_whole.then(|| schur.values_mut());
                    let assembly = of_threads.first_mut().map(|(_, assembly)| assembly);
                    above.eliminate(&fronts, front, left, assembly, values[0], breaks)?;
                }
                branches => {
                    let left = above.put(&fronts, branches);
                    let tasks = branches.iter().zip(left).zip(values);
                    for_each(
                        tasks,
                        &mut of_threads,
                        |(memory, assembly), ((branch, left), values), breaks| {
                            memory.eliminate_branch(&fronts, branch, left, assembly, values, breaks)
                        },
                        breaks,
                    )?;
                }
            }
        }
        schur.mirror(breaks)?;
        Ok((Factor { fronts, values }, schur))
    }

    /// Whether a second thread is worth its start.
    pub fn is_large(&self) -> bool {
        self.fronts.is_large()
    }

    /// Entries of L.
    pub fn entries(&self) -> usize {
        self.values.len()
    }
}

/// Memory for fronts that are worked on one after the other, used again and again.
struct Memory {
    /// First the columns that a front owns; then two stacks with what fronts have left, until the front of the whole takes
    /// it: what its halves leave is on one stack, what it leaves itself goes to the other.
    values: Vec<f64>,
    space: Space,
    tops: [usize; 2],
    runs: [Vec<Run>; 2],
    /// How many work on one front.
    threads: usize,
}

impl Memory {
    fn new(fronts: &Fronts, space: Space, threads: usize) -> Option<Self> {
        let runs = || Vec::with_capacity(fronts.tallest());
        Some(Memory {
            values: untouched_zeros(space.len())?,
            space,
            tops: [0; 2],
            runs: [runs(), runs()],
            threads,
        })
    }

    /// Puts what branches are about to leave on the stacks.
    fn put(&mut self, fronts: &Fronts, branches: &[Piece]) -> Vec<&mut [f64]> {
        let (_, [even, odd]) = self.space.divide(&mut self.values);
        let mut free = [&mut even[self.tops[0]..], &mut odd[self.tops[1]..]];
        let mut left = Vec::with_capacity(branches.len());
        for branch in branches {
            let front = &fronts.fronts[branch.fronts.end - 1];
            let size = front.boundary().pow(2);
            let stack = std::mem::take(&mut free[front.stack]);
            let (own, rest) = stack.split_at_mut(size);
            free[front.stack] = rest;
            self.tops[front.stack] += size;
            left.push(own);
        }
        left
    }

    /// Eliminates what a branch owns; what the whole branch leaves goes to `left`.
    fn eliminate_branch<E: FnMut(u32, &mut ElementMatrix)>(
        &mut self,
        fronts: &Fronts,
        branch: &Piece,
        left: &mut [f64],
        assembly: &mut Assembly<E>,
        values: &mut [f64],
        breaks: &mut Breaks<'_>,
    ) -> Result<(), FactorError> {
        let (mut left, mut values) = (Some(left), values);
        for number in branch.fronts.clone() {
            let front = &fronts.fronts[number];
            let left = match number + 1 == branch.fronts.end {
                true => left.take(),
                false => None,
            };
            let (own, others) = values.split_at_mut(front.len());
            values = others;
            self.eliminate(fronts, front, left, Some(assembly), own, breaks)?;
        }
        Ok(())
    }

    /// Puts the columns of a front into the factor; what it leaves goes to `left`, or waits on its stack.
    fn eliminate<E: FnMut(u32, &mut ElementMatrix)>(
        &mut self,
        fronts: &Fronts,
        front: &Front,
        left: Option<&mut [f64]>,
        assembly: Option<&mut Assembly<E>>,
        values: &mut [f64],
        breaks: &mut Breaks<'_>,
    ) -> Result<(), FactorError> {
        let (height, boundary, threads) = (front.height(), front.boundary(), self.threads);
        let (columns, [even, odd]) = self.space.divide(&mut self.values);
        let (own, theirs) = match front.stack {
            0 => (even, &*odd),
            _ => (odd, &*even),
        };
        let left = left.unwrap_or_else(|| {
            let top = &mut self.tops[front.stack];
            let start = *top;
            *top += boundary * boundary;
            &mut own[start..*top]
        });
        let columns = &mut columns[..height * front.own];
        columns.fill(0.0);
        let mut into = FrontMatrix {
            own: front.own,
            height,
            columns,
            left,
        };
        let failed = |error: NoFactor| match error {
            NoFactor::NotPositiveDefinite(pivot) => FactorError::NotPositiveDefinite {
                unknown: front.first + pivot,
            },
            NoFactor::Stopped => FactorError::Stopped,
        };
        match front.halves {
            None => {
                into.left.fill(0.0);
                if let Some(assembly) = assembly {
                    assembly.add(fronts, front, &mut into)?;
                }
                into.eliminate(threads, breaks).map_err(failed)?;
                into.reduce(Accum::Add, threads, breaks)?;
            }
            Some(halves) => {
                let [a, b] = halves.map(|half| fronts.fronts[half].boundary());
                let end = self.tops[1 - front.stack];
                let middle = end - b * b;
                let start = middle - a * a;
                let halves_left = [(a, &theirs[start..middle]), (b, &theirs[middle..end])];
                self.tops[1 - front.stack] = start;
                for (runs, half) in self.runs.iter_mut().zip(halves) {
                    let half = fronts.rows(&fronts.fronts[half]);
                    find_runs(half, (front.first, front.own), fronts.rows(front), runs);
                }
                for (runs, (size, from)) in self.runs.iter().zip(halves_left) {
                    into.add(runs, size, from, Columns::Own);
                }
                into.eliminate(threads, breaks).map_err(failed)?;
                into.reduce(Accum::Replace, threads, breaks)?;
                for (runs, (size, from)) in self.runs.iter().zip(halves_left) {
                    into.add(runs, size, from, Columns::Left);
                }
                breaks.after((a * a + b * b) as f64)?;
            }
        }
        let mut values = values;
        for (j, column) in into.columns.chunks_exact(height.max(1)).enumerate() {
            let (own, others) = values.split_at_mut(height - j);
            own.copy_from_slice(&column[j..]);
            values = others;
        }
        Ok(())
    }
}

/// Adds elements to fronts that are not divided.
struct Assembly<E> {
    element: E,
    matrix: ElementMatrix,
    /// Places of unknowns in a front.
    local: Vec<u32>,
}

impl<E: FnMut(u32, &mut ElementMatrix)> Assembly<E> {
    fn new(element: E, unknowns: usize) -> Self {
        Assembly {
            element,
            matrix: ElementMatrix::default(),
            local: vec![0; unknowns],
        }
    }

    /// Adds the elements of a part that is not divided.
    fn add(
        &mut self,
        fronts: &Fronts,
        front: &Front,
        into: &mut FrontMatrix<'_>,
    ) -> Result<(), FactorError> {
        let own = (front.first..front.first + front.own).map(|row| row as u32);
        let unknowns = own.chain(fronts.rows(front).iter().copied());
        for (k, row) in unknowns.enumerate() {
            self.local[row as usize] = k as u32;
        }
        for &e in &fronts.elements[front.elements[0]..front.elements[1]] {
            (self.element)(e, &mut self.matrix);
            let ElementMatrix { unknowns, entries } = &self.matrix;
            if !entries.iter().flatten().all(|entry| entry.is_finite()) {
                return Err(FactorError::NonFinite);
            }
            let local = |unknown: u32| self.local[unknown as usize] as usize;
            let places = unknowns.map(|unknown| unknown.map(local));
            for (row, entries) in places.iter().zip(entries) {
                let Some(row) = *row else { continue };
                for (column, value) in places.iter().zip(entries) {
                    if let Some(column) = column.filter(|column| *column <= row) {
                        *into.entry(row, column) += value;
                    }
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::ops::ControlFlow;

    use super::*;
    use crate::linear::dissection::tests::{grid, lines};
    use crate::linear::dissection::{Cells, Dissection};

    /// A made-up body: cells with positive definite matrices on nodes with 0, 1 or 2 unknowns.
    struct Body {
        elements: Vec<Vec<u32>>,
        /// The first unknown of each node, in the order of elimination, and how many it has.
        unknowns: Vec<(usize, usize)>,
        fronts: Option<Fronts>,
    }

    impl Body {
        fn new(x: usize, y: usize, kept: &[u32]) -> Self {
            let (elements, positions) = grid(&lines(x), &lines(y));
            let count = |node: u32| (3 + node as usize * 5 % 7) / 3 % 3;
            let unknown: Vec<bool> = (0..positions.len() as u32).map(|n| count(n) > 0).collect();
            let cells = Cells {
                elements: &elements,
                positions: &positions,
                unknown: &unknown,
            };
            let dissection = Dissection::new(&cells, kept);
            let (mut unknowns, mut next) = (vec![(0, 0); positions.len()], 0);
            for &node in &dissection.nodes {
                unknowns[node as usize] = (next, count(node));
                next += count(node);
            }
            let kept = kept.iter().filter(|node| unknown[**node as usize]).count();
            let fronts = Some(Fronts::new(dissection, count, kept));
            Body {
                elements,
                unknowns,
                fronts,
            }
        }

        fn matrix(&self, e: u32, matrix: &mut ElementMatrix) {
            *matrix = ElementMatrix::default();
            for (i, &node) in self.elements[e as usize].iter().enumerate() {
                let (first, count) = self.unknowns[node as usize];
                (0..count).for_each(|a| matrix.unknowns[2 * i + a] = Some((first + a) as u32));
            }
            for i in 0..ELEMENT {
                for j in 0..ELEMENT {
                    let off = (((i * j + e as usize) % 5) as f64 - 2.0) / 20.0;
                    matrix.entries[i][j] = if i == j { 1.0 } else { off };
                }
            }
        }

        fn dense(&self) -> Vec<Vec<f64>> {
            let n = self.unknowns.iter().map(|(_, count)| count).sum();
            let mut dense = vec![vec![0.0; n]; n];
            let mut matrix = ElementMatrix::default();
            for e in 0..self.elements.len() as u32 {
                self.matrix(e, &mut matrix);
                for (row, entries) in matrix.unknowns.iter().zip(&matrix.entries) {
                    for (column, value) in matrix.unknowns.iter().zip(entries) {
                        if let (Some(row), Some(column)) = (row, column) {
                            dense[*row as usize][*column as usize] += value;
                        }
                    }
                }
            }
            dense
        }

        fn factor(&mut self, threads: usize) -> Result<(Factor, Dense), FactorError> {
            let fronts = self.fronts.take().unwrap();
            let go_on = &mut || ControlFlow::Continue(());
            let element = |e: u32, matrix: &mut ElementMatrix| self.matrix(e, matrix);
            Factor::new(fronts, vec![element; threads], &mut Breaks::new(go_on))
        }
    }

    /// Gaussian elimination.
    fn solve_dense(a: &[Vec<f64>], b: &[f64]) -> Vec<f64> {
        let (mut a, mut b, n) = (a.to_vec(), b.to_vec(), b.len());
        for k in 0..n {
            for i in k + 1..n {
                let factor = a[i][k] / a[k][k];
                (k..n).for_each(|j| a[i][j] -= factor * a[k][j]);
                b[i] -= factor * b[k];
            }
        }
        for k in (0..n).rev() {
            let sum: f64 = (k + 1..n).map(|j| a[k][j] * b[j]).sum();
            b[k] = (b[k] - sum) / a[k][k];
        }
        b
    }

    fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
        assert_eq!(a.len(), b.len());
        a.iter()
            .zip(b)
            .fold(0.0, |most, (a, b)| (a - b).abs().max(most))
    }

    /// In meshes of one part and of many, with nothing kept, some nodes, and nearly all.
    #[test]
    fn what_is_left_of_the_whole_is_the_dense_schur_complement() {
        let all: Vec<u32> = (0..30 * 3).collect();
        let cases: [(usize, usize, &[u32]); 5] = [
            (1, 1, &[2]),
            (2, 2, &[]),
            (17, 14, &[3, 200, 11, 80, 81, 82, 0]),
            (29, 2, &all[..80]),
            (29, 2, &all),
        ];
        for (x, y, kept) in cases {
            let mut body = Body::new(x, y, kept);
            let dense = body.dense();
            let n = dense.len();
            let (factor, schur) = body.factor(1).unwrap();
            let m = schur.size();
            let force: Vec<f64> = (0..n).map(|i| (i as f64).sin()).collect();
            // f̂ is what Ŝ makes of the solution's kept unknowns
            let solution = solve_dense(&dense, &force);
            let mut reduced = force.clone();
            factor.forward(&mut reduced);
            let expected = schur.times(&solution[n - m..]);
            assert!(largest_difference(&reduced[n - m..], &expected) < 1e-12);
            // and with these unknowns given, the others follow; in several fields at once
            reduced[n - m..].copy_from_slice(&solution[n - m..]);
            let mut u: Vec<[f64; 1]> = reduced.iter().map(|f| [*f]).collect();
            factor.backward(&mut u, 1);
            assert!(largest_difference(&u.concat(), &solution) < 1e-12);
            let mut several: Vec<[f64; 3]> = reduced.iter().map(|f| [0.0, *f, -2.0 * f]).collect();
            factor.backward(&mut several, 2);
            for (k, scale) in [0.0, 1.0, -2.0].into_iter().enumerate() {
                let found: Vec<f64> = several.iter().map(|u| u[k]).collect();
                let expected: Vec<f64> = solution.iter().map(|u| scale * u).collect();
                assert!(largest_difference(&found, &expected) < 1e-12, "field {k}");
            }
            // columns of Ŝ⁻¹ are the kept part of solutions
            for k in 0..m {
                let mut unit = vec![0.0; n];
                unit[n - m + k] = 1.0;
                let column = solve_dense(&dense, &unit).split_off(n - m);
                assert!(largest_difference(&schur.times(&column), &unit[n - m..]) < 1e-12);
            }
        }
    }

    #[test]
    fn a_matrix_that_is_not_positive_definite_is_refused_with_its_unknown() {
        for (threads, bad) in [(1, 0.0), (1, -1.0), (1, f64::NAN), (2, 0.0), (2, f64::NAN)] {
            let mut body = Body::new(9, 7, &[5]);
            let fronts = body.fronts.take().unwrap();
            let go_on = &mut || ControlFlow::Continue(());
            let element = |e: u32, matrix: &mut ElementMatrix| {
                body.matrix(e, matrix);
                for (i, unknown) in matrix.unknowns.iter().enumerate() {
                    if *unknown == Some(7) {
                        matrix.entries[i] = [0.0; ELEMENT];
                        matrix.entries.iter_mut().for_each(|row| row[i] = 0.0);
                        matrix.entries[i][i] = bad;
                    }
                }
            };
            let refused =
                Factor::new(fronts, vec![element; threads], &mut Breaks::new(go_on)).err();
            let expected = match bad.is_nan() {
                true => FactorError::NonFinite,
                false => FactorError::NotPositiveDefinite { unknown: 7 },
            };
            assert_eq!(refused, Some(expected));
        }
    }

    /// Of a mesh that takes some portions of work.
    #[test]
    fn a_factor_stops_when_it_is_told_to() {
        for threads in [1, 2] {
            let mut body = Body::new(150, 150, &[]);
            let fronts = body.fronts.take().unwrap();
            let mut asked = 0;
            let mut stop = || {
                asked += 1;
                ControlFlow::Break(())
            };
            let element = |e: u32, matrix: &mut ElementMatrix| body.matrix(e, matrix);
            let elements = vec![element; threads];
            let stopped = Factor::new(fronts, elements, &mut Breaks::new(&mut stop)).err();
            assert_eq!((stopped, asked), (Some(FactorError::Stopped), 1));
        }
    }

    /// With fronts above the branches that are wide enough to be worked on in parts, and branches of one part.
    #[test]
    fn two_threads_make_the_same_factor_as_one() {
        let kept: Vec<u32> = (0..400).collect();
        for (x, y, kept) in [(150, 150, &kept[..]), (700, 2, &kept[..3]), (3, 1, &[])] {
            let [one, two] = [1, 2].map(|threads| Body::new(x, y, kept).factor(threads).unwrap());
            assert_eq!(one.1, two.1);
            assert_eq!(one.0.values, two.0.values);
            assert_eq!(one.0.fronts.len, one.0.values.len());
            let u = |i: usize| [(i as f64).sin(), (i as f64).cos()];
            let [one, two] = [1, 2].map(|threads| {
                let mut u: Vec<[f64; 2]> = (0..one.0.fronts.unknowns).map(u).collect();
                one.0.backward(&mut u, threads);
                u
            });
            assert_eq!(one, two);
        }
    }
}
