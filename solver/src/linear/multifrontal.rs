//! The Cholesky factor of a body's stiffness by dense fronts, without a global matrix.
//!
//! Along the tree of a [`Dissection`], the front of a part is a dense matrix on the unknowns it owns (o) and on those
//! of its boundary (b). For a part that is not divided it is the sum of its elements' matrices; for any other, the sum
//! of its halves' Schur complements:
//!
//! ```text
//!   F = | F_oo  F_ob |      F_oo = L_oo L_ooᵀ      L_bo = F_bo L_oo⁻ᵀ      Schur complement: F_bb − L_bo L_boᵀ
//!       | F_bo  F_bb |
//! ```
//!
//! Unknowns are numbered in the order of their elimination, the kept ones last. The kept unknowns are never eliminated,
//! so the Schur complement of the whole mesh is on them: Ŝ = A_cc − A_ci A_ii⁻¹ A_ic.

use faer::Accum;

use super::blocked::NoFactor;
use super::dense::Dense;
use super::front::{Columns, FrontMatrix, Run, find_runs};
use super::fronts::{Front, Fronts, Space, Stage, Task};
use super::interrupt::{Interrupt, Stopped, untouched_zeros};
use super::parallel::for_each;

/// The number of unknowns of the largest element.
const ELEMENT: usize = 16;

/// The matrix of one element with its unknowns.
#[derive(Clone, Default)]
pub struct ElementMatrix {
    /// The unknowns of the element; `None` where a displacement is prescribed, and for nodes that a triangle does not
    /// have.
    pub unknowns: [Option<u32>; ELEMENT],
    /// The entries of the symmetric matrix.
    pub entries: [[f64; ELEMENT]; ELEMENT],
}

/// The reason why there is no factor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FactorError {
    /// The matrix is not positive definite: a pivot is not positive.
    NotPositiveDefinite {
        /// The unknown of the pivot that is not positive.
        unknown: usize,
    },
    /// An element's matrix is not finite.
    NonFinite,
    /// The factor does not fit into memory.
    TooLarge {
        /// The number of bytes that the factor would take.
        bytes: u64,
    },
    /// The observer stopped the work.
    Stopped,
}

impl From<Stopped> for FactorError {
    fn from(_: Stopped) -> Self {
        FactorError::Stopped
    }
}

/// The Cholesky factor L of the eliminated unknowns.
pub struct Factor {
    pub(super) fronts: Fronts,
    /// The columns of every front, each from the diagonal on.
    pub(super) values: Vec<f64>,
}

impl Factor {
    /// Factors the sum of the elements' matrices on `threads` threads; returns the factor and Ŝ, the Schur complement
    /// on the kept unknowns. `element`: writes the matrix of the element with a given number.
    pub fn new(
        fronts: Fronts,
        element: &(impl Fn(u32, &mut ElementMatrix) + Sync),
        threads: usize,
        interrupt: &mut Interrupt<'_>,
    ) -> Result<(Self, Dense), FactorError> {
        let bytes = fronts.bytes(threads);
        let too_large = FactorError::TooLarge { bytes };
        let mut values = untouched_zeros(fronts.len).ok_or(too_large)?;
        // all memory is taken by this thread, which has to answer for it
        let mut above = Memory::new(&fronts, fronts.above, threads).ok_or(too_large)?;
        let of_threads = (0..threads).map(|_| Memory::new(&fronts, fronts.branch, 1));
        let mut of_threads: Vec<_> = of_threads.collect::<Option<_>>().ok_or(too_large)?;
        let bytes = Dense::bytes(fronts.kept);
        let schur = Dense::try_zero(fronts.kept, interrupt)?;
        let mut schur = schur.ok_or(FactorError::TooLarge { bytes })?;
        let mut slots: Vec<Vec<f64>> = Vec::new();
        slots.resize_with(fronts.slots.len(), Vec::new);
        let mut rest = &mut values[..];
        for (k, stage) in fronts.stages.iter().enumerate() {
            match stage {
                Stage::Above(task) => {
                    let (values, others) = rest.split_at_mut(task.len);
                    rest = others;
                    let is_whole = k + 1 == fronts.stages.len();
                    let left = is_whole.then(|| schur.values_mut());
                    above.work_on(task, left, values, (&fronts, &slots, element), interrupt)?;
                }
                Stage::Each(tasks) => {
                    let mut filled = Vec::new();
                    for slot in fronts.slots_of(stage) {
                        let zeros = untouched_zeros(fronts.slots[slot].len).ok_or(too_large)?;
                        filled.push((slot, zeros));
                    }
                    let mut columns = Vec::with_capacity(tasks.len());
                    for task in tasks {
                        let (own, others) = rest.split_at_mut(task.len);
                        columns.push(own);
                        rest = others;
                    }
                    let left = above.put(&fronts, tasks, &mut filled);
                    let workers = threads.min(tasks.len());
                    for_each(
                        tasks.iter().zip(left).zip(columns),
                        &mut of_threads[..workers],
                        |memory, ((task, left), values), interrupt| {
                            let of_all = (&fronts, &slots[..], element);
                            memory.work_on(task, Some(left), values, of_all, interrupt)
                        },
                        interrupt,
                    )?;
                    for (slot, values) in filled {
                        slots[slot] = values;
                    }
                }
            }
            for (values, slot) in slots.iter_mut().zip(&fronts.slots) {
                if slot.last_stage == k {
                    *values = Vec::new();
                }
            }
        }
        schur.mirror(interrupt)?;
        Ok((Factor { fronts, values }, schur))
    }

    /// Whether the fronts are so large that computing fields is worth a second thread.
    pub fn has_large_fields(&self) -> bool {
        self.fronts.has_large_fields()
    }

    /// The number of stored entries of L: equal fronts share their columns.
    pub fn entries(&self) -> usize {
        self.values.len()
    }
}

/// The memory of one thread for the fronts that it computes one after another; it is reused.
struct Memory {
    /// First the columns that a front owns, then two stacks for the Schur complements of fronts without a slot, until
    /// another front needs them: the complements of a front's halves are on one stack, and the front's own goes to the
    /// other.
    values: Vec<f64>,
    space: Space,
    tops: [usize; 2],
    assembly: Assembly,
    /// The number of threads that work on one front.
    threads: usize,
}

/// The data that all threads read: the plan, the contents of its slots, and the matrices of elements.
type OfAll<'a, E> = (&'a Fronts, &'a [Vec<f64>], &'a E);

impl Memory {
    fn new(fronts: &Fronts, space: Space, threads: usize) -> Option<Self> {
        Some(Memory {
            values: untouched_zeros(space.len())?,
            space,
            tops: [0; 2],
            assembly: Assembly::new(fronts),
            threads,
        })
    }

    /// The places where the last fronts of `tasks` store their Schur complements: on the stacks, or in slots.
    fn put<'a>(
        &'a mut self,
        fronts: &Fronts,
        tasks: &[Task],
        slots: &'a mut [(usize, Vec<f64>)],
    ) -> Vec<&'a mut [f64]> {
        let (_, [even, odd]) = self.space.divide(&mut self.values);
        let mut free = [&mut even[self.tops[0]..], &mut odd[self.tops[1]..]];
        let mut slots = slots.iter_mut();
        let mut left = Vec::with_capacity(tasks.len());
        for task in tasks {
            let front = fronts.last(task);
            left.push(match front.slot {
                Some(_) => slots.next().map_or(&mut [][..], |(_, slot)| &mut slot[..]),
                None => {
                    let (stack, size) = (front.stack, front.boundary().pow(2));
                    let (own, rest) = std::mem::take(&mut free[stack]).split_at_mut(size);
                    free[stack] = rest;
                    self.tops[stack] += size;
                    own
                }
            });
        }
        left
    }

    /// Computes the columns of a task's fronts. The Schur complement of the last front goes to `left`; without `left`
    /// it waits on a stack.
    fn work_on<E: Fn(u32, &mut ElementMatrix)>(
        &mut self,
        task: &Task,
        left: Option<&mut [f64]>,
        values: &mut [f64],
        of_all: OfAll<'_, E>,
        interrupt: &mut Interrupt<'_>,
    ) -> Result<(), FactorError> {
        let (mut left, mut values) = (left, values);
        for place in task.fronts.clone() {
            let front = &of_all.0.fronts[of_all.0.order[place] as usize];
            let left = if place + 1 == task.fronts.end {
                left.take()
            } else {
                None
            };
            let (own, others) = values.split_at_mut(front.len());
            values = others;
            self.eliminate(front, left, own, of_all, interrupt)?;
        }
        Ok(())
    }

    /// Computes the columns of a front. Its Schur complement goes to `left`; without `left` it waits on a stack.
    fn eliminate<E: Fn(u32, &mut ElementMatrix)>(
        &mut self,
        front: &Front,
        left: Option<&mut [f64]>,
        values: &mut [f64],
        (fronts, slots, element): OfAll<'_, E>,
        interrupt: &mut Interrupt<'_>,
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
        self.assembly.place(fronts, front);
        match front.halves {
            None => {
                into.left.fill(0.0);
                self.assembly
                    .add_elements(fronts, front, element, &mut into)?;
                into.eliminate(threads, interrupt).map_err(failed)?;
                into.reduce(Accum::Add, threads, interrupt)?;
            }
            Some(halves) => {
                let halves = halves.map(|half| &fronts.fronts[half]);
                let top = &mut self.tops[1 - front.stack];
                // the later one is on top
                let mut take = |half: &Front| match half.slot {
                    Some(slot) => &slots[slot][..],
                    None => {
                        let end = *top;
                        *top -= half.boundary().pow(2);
                        &theirs[*top..end]
                    }
                };
                let b = take(halves[1]);
                let halves_left = [take(halves[0]), b];
                for (runs, half) in self.assembly.runs.iter_mut().zip(halves) {
                    find_runs(fronts.rows(half), &self.assembly.local, runs);
                }
                let added = self.assembly.runs.iter().zip(halves_left);
                for (runs, from) in added.clone() {
                    into.add(runs, from, Columns::Own);
                }
                into.eliminate(threads, interrupt).map_err(failed)?;
                into.reduce(Accum::Replace, threads, interrupt)?;
                for (runs, from) in added {
                    into.add(runs, from, Columns::Left);
                    interrupt.worked(from.len() as f64)?;
                }
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

/// The assembly of fronts: which entries are added where.
struct Assembly {
    matrix: ElementMatrix,
    /// By unknown: its place in the front that is being assembled.
    local: Vec<u32>,
    /// For each half of the front, the runs of its boundary in the front.
    runs: [Vec<Run>; 2],
}

impl Assembly {
    fn new(fronts: &Fronts) -> Self {
        let runs = || Vec::with_capacity(fronts.tallest());
        Assembly {
            matrix: ElementMatrix::default(),
            local: vec![0; fronts.unknowns],
            runs: [runs(), runs()],
        }
    }

    /// Records the places of a front's unknowns.
    fn place(&mut self, fronts: &Fronts, front: &Front) {
        let own = (front.first..front.first + front.own).map(|row| row as u32);
        let unknowns = own.chain(fronts.rows(front).iter().copied());
        for (k, row) in unknowns.enumerate() {
            self.local[row as usize] = k as u32;
        }
    }

    /// Adds the matrices of a front's elements; the front is that of a part that is not divided.
    fn add_elements(
        &mut self,
        fronts: &Fronts,
        front: &Front,
        element: &impl Fn(u32, &mut ElementMatrix),
        into: &mut FrontMatrix<'_>,
    ) -> Result<(), FactorError> {
        for &e in &fronts.elements[front.elements[0]..front.elements[1]] {
            element(e, &mut self.matrix);
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
    use super::*;
    use crate::linear::dissection::tests::{grid, lines};
    use crate::linear::dissection::{Cells, Dissection};

    /// A made-up body: cells with positive definite matrices on nodes with 0, 1 or 2 unknowns.
    struct Body {
        elements: Vec<Vec<u32>>,
        /// The kind of each cell, if cells of one kind have the same matrix; else each cell has its own.
        of_kinds: Option<Vec<Option<u32>>>,
        /// The first unknown of each node, in the order of elimination, and how many it has.
        unknowns: Vec<(usize, usize)>,
        fronts: Option<Fronts>,
    }

    impl Body {
        /// A body of cells that are all different.
        fn new(x: usize, y: usize, kept: &[u32]) -> Self {
            let count = |node: u32| (3 + node as usize * 5 % 7) / 3 % 3;
            let (elements, positions) = grid(&lines(x), &lines(y));
            Body::of(elements, &positions, kept, count, None)
        }

        /// A body of cells of a few kinds, between lines that are `x` and `y` cells apart; some nodes in the first
        /// column have no unknowns, or one. Cells beyond two thirds of x are of another kind.
        fn of_kinds(x: usize, y: usize, kept: &[u32]) -> Self {
            let (mut elements, mut positions) = grid(&lines(x), &lines(y));
            let count = move |node: u32| match node as usize % (2 * (x + 1)) {
                0 => 0,
                column if column == x + 1 => 1,
                _ => 2,
            };
            let kind = |e: usize| {
                let [first, _, _, last] = [0, 1, 2, 3].map(|i| count(elements[e][i]));
                let beyond = usize::from(e % x > 2 * x / 3);
                // one in a corner is like no other
                (e > 0).then_some((9 * beyond + 3 * first + last) as u32)
            };
            let kinds: Vec<_> = (0..elements.len()).map(kind).collect();
            // a body of its own besides, of the same cells
            elements.extend(elements.clone().into_iter().map(|cell| {
                cell.into_iter()
                    .map(|node| node + positions.len() as u32)
                    .collect()
            }));
            let kinds: Vec<Option<u32>> = [&kinds, &kinds].into_iter().flatten().copied().collect();
            let beside: Vec<_> = positions.iter().map(|[x, y]| [x + 100.0, *y]).collect();
            let nodes = positions.len() as u32;
            positions.extend(beside);
            Body::of(
                elements,
                &positions,
                kept,
                move |node| count(node % nodes),
                Some(kinds),
            )
        }

        fn of(
            elements: Vec<Vec<u32>>,
            positions: &[[f64; 2]],
            kept: &[u32],
            count: impl Fn(u32) -> usize,
            of_kinds: Option<Vec<Option<u32>>>,
        ) -> Self {
            let unknown: Vec<bool> = (0..positions.len() as u32).map(|n| count(n) > 0).collect();
            let cells = Cells {
                elements: &elements,
                positions,
                unknown: &unknown,
            };
            let dissection = Dissection::new(&cells, kept, 1);
            let (mut unknowns, mut next) = (vec![(0, 0); positions.len()], 0);
            for &node in &dissection.nodes {
                unknowns[node as usize] = (next, count(node));
                next += count(node);
            }
            let kept = kept.iter().filter(|node| unknown[**node as usize]).count();
            let none = vec![None; elements.len()];
            let kinds = of_kinds.as_ref().unwrap_or(&none);
            let fronts = Some(Fronts::new(dissection, &elements, kinds, count, kept));
            Body {
                elements,
                of_kinds,
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
            let of_kind = self.of_kinds.as_ref().map(|kinds| kinds[e as usize]);
            let own = of_kind.flatten().unwrap_or(e) as usize;
            for i in 0..ELEMENT {
                for j in 0..ELEMENT {
                    let off = (((i * j + own) % 5) as f64 - 2.0) / 20.0;
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
            let never = &mut || false;
            let element = |e: u32, matrix: &mut ElementMatrix| self.matrix(e, matrix);
            Factor::new(fronts, &element, threads, &mut Interrupt::new(never))
        }
    }

    /// The solution by Gaussian elimination.
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

    /// The Schur complement of the whole equals the dense one, in meshes of one part and of many, with no node kept,
    /// with some, and with nearly all.
    #[test]
    fn the_schur_complement_equals_the_dense_one() {
        let all: Vec<u32> = (0..30 * 3).collect();
        let cases: [(usize, usize, &[u32]); 5] = [
            (1, 1, &[2]),
            (2, 2, &[]),
            (17, 14, &[3, 200, 11, 80, 81, 82, 0]),
            (29, 2, &all[..80]),
            (29, 2, &all),
        ];
        let bodies = cases.map(|(x, y, kept)| Body::new(x, y, kept));
        let kept = [150, 151, 152, 153, 154, 155, 11, 12, 13, 2, 1];
        let repeated = [(9, 8, &kept[..]), (8, 5, &kept[6..]), (2, 30, &[])];
        let repeated = repeated.map(|(x, y, kept)| Body::of_kinds(x, y, kept));
        for mut body in bodies.into_iter().chain(repeated) {
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
            let never = &mut || false;
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
            let refused = Factor::new(fronts, &element, threads, &mut Interrupt::new(never)).err();
            let expected = if bad.is_nan() {
                FactorError::NonFinite
            } else {
                FactorError::NotPositiveDefinite { unknown: 7 }
            };
            assert_eq!(refused, Some(expected));
        }
    }

    /// The factorisation of a mesh that takes several portions of work stops when it is told to.
    #[test]
    fn a_factor_stops_when_it_is_told_to() {
        for threads in [1, 2] {
            let mut body = Body::new(150, 150, &[]);
            let fronts = body.fronts.take().unwrap();
            let mut asked = 0;
            let mut stop = || {
                asked += 1;
                true
            };
            let element = |e: u32, matrix: &mut ElementMatrix| body.matrix(e, matrix);
            let stopped =
                Factor::new(fronts, &element, threads, &mut Interrupt::new(&mut stop)).err();
            assert_eq!((stopped, asked), (Some(FactorError::Stopped), 1));
        }
    }

    /// Two threads compute the same factor as one, also with fronts above the branches that are wide enough to be
    /// divided, and with branches of one part.
    #[test]
    fn two_threads_make_the_same_factor_as_one() {
        let kept: Vec<u32> = (0..400).collect();
        let bodies = [
            (false, 150, 150, &kept[..]),
            (false, 700, 2, &kept[..3]),
            (false, 3, 1, &[]),
            (true, 200, 150, &kept[..]),
            (true, 100, 2, &[]),
        ];
        for (of_kinds, x, y, kept) in bodies {
            let [one, two] = [1, 2].map(|threads| {
                let mut body = if of_kinds {
                    Body::of_kinds(x, y, kept)
                } else {
                    Body::new(x, y, kept)
                };
                body.factor(threads).unwrap()
            });
            let all: usize = one.0.fronts.fronts.iter().map(Front::len).sum();
            if of_kinds {
                assert!(3 * one.0.entries() < all)
            } else {
                assert_eq!(one.0.entries(), all)
            }
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
