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
use super::breaks::{Breaks, Stopped, zeros};
use super::dense::Dense;
use super::dissection::Dissection;
use super::front::{Columns, FrontMatrix, Run, find_runs};

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

/// The structure of a factor.
pub struct Fronts {
    fronts: Vec<Front>,
    /// Elements in the order of the parts that are not divided.
    elements: Vec<u32>,
    /// Unknowns of all boundaries, those of each front ascending.
    rows: Vec<u32>,
    unknowns: usize,
    kept: usize,
    /// Numbers in the factor.
    len: usize,
    /// The largest columns of a front.
    widest: usize,
    /// The most that waits on each of the two stacks.
    stacks: [usize; 2],
}

/// One front.
struct Front {
    halves: Option<[usize; 2]>,
    elements: [usize; 2],
    /// The first unknown it owns.
    first: usize,
    /// How many it owns.
    own: usize,
    /// Its boundary: first and end in `rows`.
    rows: [usize; 2],
    /// Where its columns begin in the factor.
    values: usize,
    /// The stack on which it waits: halves wait on the other one.
    stack: usize,
}

impl Front {
    fn boundary(&self) -> usize {
        self.rows[1] - self.rows[0]
    }

    fn height(&self) -> usize {
        self.own + self.boundary()
    }

    /// Numbers in its columns of L, each from the diagonal on.
    fn len(&self) -> usize {
        self.own * self.boundary() + self.own * (self.own + 1) / 2
    }
}

impl Fronts {
    /// Plans the factor; `kept`: how many nodes the dissection keeps, `unknowns_of` a node.
    pub fn new(dissection: Dissection, unknowns_of: impl Fn(u32) -> usize, kept: usize) -> Self {
        // the first unknown of every place
        let mut first = Vec::with_capacity(dissection.nodes.len() + 1);
        first.push(0);
        let mut unknowns = 0;
        for &node in &dissection.nodes {
            unknowns += unknowns_of(node);
            first.push(unknowns);
        }
        let eliminated = first[dissection.nodes.len() - kept];
        let (mut fronts, mut rows) = (Vec::with_capacity(dissection.parts.len()), Vec::new());
        let (mut len, mut widest) = (0, 0);
        for (number, part) in dissection.parts.iter().enumerate() {
            let start = rows.len();
            for &place in dissection.boundary(number) {
                let place = place as usize;
                rows.extend((first[place]..first[place + 1]).map(|row| row as u32));
            }
            let front = Front {
                halves: part.halves,
                elements: part.elements,
                first: first[part.own[0]],
                own: first[part.own[1]] - first[part.own[0]],
                rows: [start, rows.len()],
                values: len,
                stack: (part.depth % 2) as usize,
            };
            len += front.len();
            widest = widest.max(front.own * front.height());
            fronts.push(front);
        }
        let mut planned = Fronts {
            fronts,
            elements: dissection.elements,
            rows,
            unknowns,
            kept: unknowns - eliminated,
            len,
            widest,
            stacks: [0; 2],
        };
        planned.stacks = planned.highest_stacks();
        planned
    }

    /// What waits at most on each stack.
    fn highest_stacks(&self) -> [usize; 2] {
        let (mut tops, mut most) = ([0usize; 2], [0usize; 2]);
        let Some((_, below)) = self.fronts.split_last() else {
            return most;
        };
        for front in below {
            tops[front.stack] += front.boundary().pow(2);
            most[front.stack] = most[front.stack].max(tops[front.stack]);
            for half in front.halves.into_iter().flatten() {
                tops[1 - front.stack] -= self.fronts[half].boundary().pow(2);
            }
        }
        most
    }

    /// What the factor takes, and what waits while it is made (bytes).
    pub fn bytes(&self) -> u64 {
        8 * (self.len + self.widest + self.stacks[0] + self.stacks[1]) as u64
    }

    /// Number of those that are kept.
    pub fn kept(&self) -> usize {
        self.kept
    }

    fn rows(&self, front: &Front) -> &[u32] {
        &self.rows[front.rows[0]..front.rows[1]]
    }
}

/// L of the eliminated unknowns.
pub struct Factor {
    fronts: Fronts,
    /// The columns of every front, each from the diagonal on.
    values: Vec<f64>,
}

impl Factor {
    /// Factors the sum of the elements' matrices, and returns Ŝ with it. `element` puts the one of a given number in
    /// place.
    pub fn new(
        fronts: Fronts,
        mut element: impl FnMut(u32, &mut ElementMatrix),
        breaks: &mut Breaks<'_>,
    ) -> Result<(Self, Dense), FactorError> {
        let bytes = fronts.bytes();
        let too_large = FactorError::TooLarge { bytes };
        let mut values = Vec::new();
        values
            .try_reserve_exact(fronts.len)
            .map_err(|_| too_large)?;
        let mut columns = zeros(fronts.widest, breaks)?.ok_or(too_large)?;
        let mut stacks = [Vec::new(), Vec::new()];
        for (stack, size) in stacks.iter_mut().zip(fronts.stacks) {
            *stack = zeros(size, breaks)?.ok_or(too_large)?;
        }
        let bytes = Dense::bytes(fronts.kept);
        let schur = Dense::try_zero(fronts.kept, breaks)?;
        let mut schur = schur.ok_or(FactorError::TooLarge { bytes })?;
        let mut tops = [0; 2];
        let mut scratch = Scratch {
            local: vec![0; fronts.unknowns],
            matrix: ElementMatrix::default(),
            runs: [Vec::new(), Vec::new()],
        };
        let last = fronts.fronts.len().wrapping_sub(1);
        for (number, front) in fronts.fronts.iter().enumerate() {
            let (height, boundary) = (front.height(), front.boundary());
            let [even, odd] = &mut stacks;
            let (mine, theirs) = match front.stack {
                0 => (even, &*odd),
                _ => (odd, &*even),
            };
            let top = tops[front.stack];
            let left = match number == last {
                true => schur.values_mut(),
                false => &mut mine[top..top + boundary * boundary],
            };
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
                    scratch.assemble(&fronts, front, &mut into, &mut element)?;
                    into.eliminate(breaks).map_err(failed)?;
                    into.reduce(Accum::Add, breaks)?;
                }
                Some(halves) => {
                    let [a, b] = halves.map(|half| fronts.fronts[half].boundary());
                    let end = tops[1 - front.stack];
                    let middle = end - b * b;
                    let start = middle - a * a;
                    let halves_left = [(a, &theirs[start..middle]), (b, &theirs[middle..end])];
                    tops[1 - front.stack] = start;
                    for (runs, half) in scratch.runs.iter_mut().zip(halves) {
                        let half = fronts.rows(&fronts.fronts[half]);
                        find_runs(half, (front.first, front.own), fronts.rows(front), runs);
                    }
                    for (runs, (size, from)) in scratch.runs.iter().zip(halves_left) {
                        into.add(runs, size, from, Columns::Own);
                    }
                    into.eliminate(breaks).map_err(failed)?;
                    into.reduce(Accum::Replace, breaks)?;
                    for (runs, (size, from)) in scratch.runs.iter().zip(halves_left) {
                        into.add(runs, size, from, Columns::Left);
                    }
                    breaks.after((a * a + b * b) as f64)?;
                }
            }
            for (j, column) in into.columns.chunks_exact(height.max(1)).enumerate() {
                values.extend_from_slice(&column[j..]);
            }
            if number != last {
                tops[front.stack] += boundary * boundary;
            }
        }
        schur.mirror(breaks)?;
        Ok((Factor { fronts, values }, schur))
    }

    /// From f of all unknowns: y = L⁻¹ f of the eliminated ones, and f̂ = f_c − A_ci A_ii⁻¹ f_i of the kept ones.
    pub fn forward(&self, f: &mut [f64]) {
        let mut v = Vec::new();
        for front in &self.fronts.fronts {
            self.gather(front, f, &mut v);
            let mut columns = self.columns(front);
            for j in 0..front.own {
                let (column, rest) = columns.split_at(v.len() - j);
                columns = rest;
                let (above, below) = v.split_at_mut(j + 1);
                above[j] /= column[0];
                let factor = above[j];
                let entries = below.iter_mut().zip(&column[1..]);
                entries.for_each(|(v, l)| *v -= factor * l);
            }
            f[front.first..front.first + front.own].copy_from_slice(&v[..front.own]);
            for (&row, v) in self.fronts.rows(front).iter().zip(&v[front.own..]) {
                f[row as usize] = *v;
            }
        }
    }

    /// From y = L⁻¹ f of the eliminated unknowns and u of the kept ones: u of all. Several fields at once.
    pub fn backward<const FIELDS: usize>(&self, u: &mut [[f64; FIELDS]]) {
        let mut v = Vec::new();
        for front in self.fronts.fronts.iter().rev() {
            self.gather(front, u, &mut v);
            let columns = self.columns(front);
            pulp::Arch::new().dispatch(|| backward_in_front(columns, front.own, &mut v));
            u[front.first..front.first + front.own].copy_from_slice(&v[..front.own]);
        }
    }

    /// Values of a front's unknowns.
    fn gather<T: Copy>(&self, front: &Front, all: &[T], into: &mut Vec<T>) {
        into.clear();
        into.extend_from_slice(&all[front.first..front.first + front.own]);
        let rows = self.fronts.rows(front).iter();
        into.extend(rows.map(|row| all[*row as usize]));
    }

    fn columns(&self, front: &Front) -> &[f64] {
        &self.values[front.values..front.values + front.len()]
    }
}

/// u of the unknowns that a front owns, from the last to the first: u_j = (y_j − Σ_{i > j} L_ij u_i) / L_jj.
#[inline(always)]
fn backward_in_front<const FIELDS: usize>(columns: &[f64], own: usize, v: &mut [[f64; FIELDS]]) {
    /// Sums of one field that do not wait for each other.
    const LANES: usize = 8;
    let (height, mut columns) = (v.len(), columns);
    for j in (0..own).rev() {
        let (rest, column) = columns.split_at(columns.len() - (height - j));
        columns = rest;
        let (diagonal, column) = (column[0], &column[1..]);
        let (above, below) = v.split_at_mut(j + 1);
        let mut sum = [0.0; FIELDS];
        if FIELDS == 1 {
            let mut sums = [0.0; LANES];
            let (l, u) = (column.chunks_exact(LANES), below.chunks_exact(LANES));
            let rest = l.remainder().iter().zip(u.remainder());
            sum[0] = rest.map(|(l, u)| l * u[0]).sum();
            for (l, u) in l.zip(u) {
                for k in 0..LANES {
                    sums[k] += l[k] * u[k][0];
                }
            }
            sum[0] += sums.iter().sum::<f64>();
        } else {
            for (l, u) in column.iter().zip(below) {
                for k in 0..FIELDS {
                    sum[k] += l * u[k];
                }
            }
        }
        for k in 0..FIELDS {
            above[j][k] = (above[j][k] - sum[k]) / diagonal;
        }
    }
}

/// What is used again from front to front.
struct Scratch {
    /// Places of unknowns in a front.
    local: Vec<u32>,
    matrix: ElementMatrix,
    runs: [Vec<Run>; 2],
}

impl Scratch {
    /// Adds the elements of a part that is not divided.
    fn assemble(
        &mut self,
        fronts: &Fronts,
        front: &Front,
        into: &mut FrontMatrix<'_>,
        element: &mut impl FnMut(u32, &mut ElementMatrix),
    ) -> Result<(), FactorError> {
        let own = (front.first..front.first + front.own).map(|row| row as u32);
        let unknowns = own.chain(fronts.rows(front).iter().copied());
        for (k, row) in unknowns.enumerate() {
            self.local[row as usize] = k as u32;
        }
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
    use std::ops::ControlFlow;

    use super::*;
    use crate::linear::dissection::Cells;
    use crate::linear::dissection::tests::{grid, lines};

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

        fn factor(&mut self) -> Result<(Factor, Dense), FactorError> {
            let fronts = self.fronts.take().unwrap();
            let go_on = &mut || ControlFlow::Continue(());
            Factor::new(
                fronts,
                |e, matrix| self.matrix(e, matrix),
                &mut Breaks::new(go_on),
            )
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
            let (factor, schur) = body.factor().unwrap();
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
            factor.backward(&mut u);
            assert!(largest_difference(&u.concat(), &solution) < 1e-12);
            let mut several: Vec<[f64; 3]> = reduced.iter().map(|f| [0.0, *f, -2.0 * f]).collect();
            factor.backward(&mut several);
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
        for bad in [0.0, -1.0, f64::NAN] {
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
            let refused = Factor::new(fronts, element, &mut Breaks::new(go_on)).err();
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
        let mut body = Body::new(150, 150, &[]);
        let fronts = body.fronts.take().unwrap();
        let mut asked = 0;
        let mut stop = || {
            asked += 1;
            ControlFlow::Break(())
        };
        let element = |e: u32, matrix: &mut ElementMatrix| body.matrix(e, matrix);
        let stopped = Factor::new(fronts, element, &mut Breaks::new(&mut stop)).err();
        assert_eq!((stopped, asked), (Some(FactorError::Stopped), 1));
    }
}
