//! One sparse Cholesky factorisation, with a chosen block of unknowns last.
//!
//! With the contact unknowns c last, A = L Lᵀ contains the Schur complement:
//!
//!   A = | A_ii  A_ic |     Ŝ = A_cc − A_ci A_ii⁻¹ A_ic = L_cc L_ccᵀ
//!       | A_ci  A_cc |

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::perm::PermRef;
use faer::sparse::SymbolicSparseColMatRef;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::amd;
use faer::sparse::linalg::cholesky::supernodal::{SupernodalLltRef, SymbolicSupernodalCholesky};
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::{Conj, MatMut, Par, Side};

use super::blocked::NoFactor;
use super::breaks::{Breaks, Stopped, zeros};
use super::supernodal;
use crate::linear::{Dense, Graph, SparseSymmetric};

/// Parallelism of one job: none. Two jobs use the two cores, and a second thread gave no speed-up.
const PAR: Par = Par::Seq;

/// The reason why there is no factor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FactorError {
    /// The matrix is not positive definite: a pivot is not positive.
    NotPositiveDefinite {
        /// Its unknown.
        unknown: usize,
    },
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

/// An order of elimination and the structure of the factor it leads to.
pub struct Ordering {
    symbolic: SymbolicCholesky<usize>,
    trailing: usize,
}

impl Ordering {
    /// Plans the factorisation of `matrix`: unknowns in `order`, the last `trailing` of which stay
    /// last. `order[new] = old`.
    pub fn new(
        matrix: &SparseSymmetric,
        order: &[usize],
        trailing: usize,
    ) -> Result<Self, FactorError> {
        let n = matrix.size();
        let mut inverse = vec![0; n];
        order
            .iter()
            .enumerate()
            .for_each(|(new, &old)| inverse[old] = new);
        let pattern =
            SymbolicSparseColMatRef::new_checked(n, n, &matrix.column_starts, None, &matrix.rows);
        let parameters = CholeskySymbolicParams {
            // only the supernodal factor offers its dense trailing block
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
            ..Default::default()
        };
        let ordering = SymmetricOrdering::Custom(PermRef::new_checked(order, &inverse, n));
        let symbolic = factorize_symbolic_cholesky(pattern, Side::Lower, ordering, parameters)
            .map_err(|_| too_large(n))?; // its only errors: index range and memory
        Ok(Ordering { symbolic, trailing })
    }

    /// What the factor takes.
    pub fn bytes(&self) -> u64 {
        8 * self.symbolic.len_val() as u64
    }

    fn structure(&self) -> &SymbolicSupernodalCholesky<usize> {
        match self.symbolic.raw() {
            SymbolicCholeskyRaw::Supernodal(structure) => structure,
            SymbolicCholeskyRaw::Simplicial(_) => {
                unreachable!("Ordering::new forces the supernodal factor")
            }
        }
    }

    /// The unknown at each place in the order of elimination, and the place of each unknown.
    fn permutation(&self) -> (&[usize], &[usize]) {
        match self.symbolic.perm() {
            Some(permutation) => permutation.arrays(),
            None => unreachable!("Ordering::new gives the order"),
        }
    }

    /// A fill-reducing order of the vertices of a graph (approximate minimum degree).
    /// `result[new] = old`.
    pub fn minimum_degree(graph: &Graph) -> Result<Vec<usize>, FactorError> {
        let n = graph.len();
        let mut starts = vec![0; n + 1];
        let mut rows = Vec::new();
        for v in 0..n {
            rows.extend(
                graph
                    .neighbours(v)
                    .iter()
                    .map(|&w| w as usize)
                    .filter(|&w| w > v),
            );
            starts[v + 1] = rows.len();
        }
        let (mut order, mut inverse) = (vec![0usize; n], vec![0usize; n]);
        let pattern = SymbolicSparseColMatRef::new_checked(n, n, &starts, None, &rows);
        let mut memory = MemBuffer::new(amd::order_scratch::<usize>(n, rows.len()));
        let control = amd::Control::default();
        amd::order(
            &mut order,
            &mut inverse,
            pattern,
            control,
            MemStack::new(&mut memory),
        )
        .map_err(|_| too_large(n))?;
        Ok(order)
    }
}

/// A structure that cannot even be planned: it needs more than a word for each unknown.
fn too_large(unknowns: usize) -> FactorError {
    FactorError::TooLarge {
        bytes: 8 * unknowns as u64,
    }
}

/// L of A = L Lᵀ.
pub struct Factor {
    ordering: Ordering,
    values: Vec<f64>,
}

impl Factor {
    /// Factors `matrix`, which has the pattern that `ordering` was made for.
    pub fn new(
        matrix: &SparseSymmetric,
        ordering: Ordering,
        breaks: &mut Breaks<'_>,
    ) -> Result<Self, FactorError> {
        if matrix.size() == 0 {
            // a body that is held everywhere: its structure has neither supernodes nor a permutation
            let values = Vec::new();
            return Ok(Factor { ordering, values });
        }
        let bytes = ordering.bytes();
        let values = zeros(ordering.symbolic.len_val(), breaks)?;
        let mut values = values.ok_or(FactorError::TooLarge { bytes })?;
        let (unknowns, places) = ordering.permutation();
        let structure = ordering.structure();
        scatter(matrix, structure, places, &mut values);
        supernodal::factor(structure, &mut values, breaks).map_err(|error| match error {
            NoFactor::NotPositiveDefinite(pivot) => FactorError::NotPositiveDefinite {
                unknown: unknowns[pivot],
            },
            NoFactor::Stopped => FactorError::Stopped,
        })?;
        Ok(Factor { ordering, values })
    }

    /// Solves A x = b in place; `b` may hold several right-hand sides, one after the other.
    pub fn solve(&self, b: &mut [f64]) {
        let symbolic = &self.ordering.symbolic;
        let n = symbolic.nrows();
        let count = b.len().checked_div(n).unwrap_or(0);
        let mut memory = MemBuffer::new(symbolic.solve_in_place_scratch::<f64>(count, PAR));
        let rhs = MatMut::from_column_major_slice_mut(b, n, count);
        LltRef::new(symbolic, &self.values).solve_in_place_with_conj(
            Conj::No,
            rhs,
            PAR,
            MemStack::new(&mut memory),
        );
    }

    /// Ŝ = L_cc L_ccᵀ, the Schur complement of the trailing unknowns, in their order.
    pub fn trailing_schur_complement(&self, breaks: &mut Breaks<'_>) -> Result<Dense, FactorError> {
        let m = self.ordering.trailing;
        let bytes = Dense::bytes(m);
        let mut schur = Dense::try_zero(m, breaks)?.ok_or(FactorError::TooLarge { bytes })?;
        self.trailing_factor(&mut schur);
        schur.times_its_transpose(breaks)?;
        Ok(schur)
    }

    /// Puts L_cc into the lower triangle, by rows.
    fn trailing_factor(&self, l: &mut Dense) {
        let m = self.ordering.trailing;
        let n = self.ordering.symbolic.nrows();
        let first = n - m;
        if m == 0 {
            return; // an empty matrix has no supernodes to walk
        }
        let structure = self.ordering.structure();
        let factor = SupernodalLltRef::<usize, f64>::new(structure, &self.values);
        // Relaxation may merge the trailing columns into a larger supernode, or leave them in
        // several: walk the supernodes from the end.
        for s in (0..structure.n_supernodes()).rev() {
            if structure.supernode_end()[s] <= first {
                break;
            }
            let node = factor.supernode(s);
            let (start, block) = (node.start(), node.val());
            let columns = block.ncols();
            for j in 0..columns {
                if start + j < first {
                    continue;
                }
                let column = start + j - first;
                for i in j..columns {
                    l.row_mut(start + i - first)[column] = block[(i, j)];
                }
                for (r, &row) in node.pattern().iter().enumerate() {
                    l.row_mut(row - first)[column] = block[(columns + r, j)];
                }
            }
        }
    }
}

/// Puts the entries of A where L will have its own.
fn scatter(
    matrix: &SparseSymmetric,
    structure: &SymbolicSupernodalCholesky<usize>,
    places: &[usize],
    values: &mut [f64],
) {
    let supernodes = supernodal::supernode_of_columns(structure);
    for j in 0..matrix.size() {
        for entry in matrix.column_starts[j]..matrix.column_starts[j + 1] {
            let (i, j) = (places[matrix.rows[entry]], places[j]);
            let (row, column) = (i.max(j), i.min(j));
            let at = supernodal::place(structure, supernodes[column], row, column);
            values[at] = matrix.values[entry];
        }
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::*;

    /// A 9-point grid operator with a varying diagonal: connected, positive definite, irregular.
    fn grid_matrix(side: usize) -> (SparseSymmetric, Graph) {
        let n = side * side;
        let cells: Vec<[u32; 4]> = (0..side - 1)
            .flat_map(|j| {
                (0..side - 1).map(move |i| {
                    let a = (j * side + i) as u32;
                    let s = side as u32;
                    [a, a + 1, a + s, a + s + 1]
                })
            })
            .collect();
        let graph = Graph::from_cliques(n, cells.iter().map(|c| &c[..]));
        let mut matrix = SparseSymmetric::zero(n, |j, rows| {
            rows.push(j);
            rows.extend(
                graph
                    .neighbours(j)
                    .iter()
                    .map(|&i| i as usize)
                    .filter(|&i| i > j),
            );
        });
        for j in 0..n {
            matrix.add(j, j, 9.0 + (j % 7) as f64);
            for &i in graph.neighbours(j) {
                if (i as usize) > j {
                    matrix.add(i as usize, j, -1.0 - 0.1 * ((i as usize + j) % 3) as f64);
                }
            }
        }
        (matrix, graph)
    }

    fn factor(
        matrix: &SparseSymmetric,
        order: &[usize],
        trailing: usize,
    ) -> Result<Factor, FactorError> {
        let ordering = Ordering::new(matrix, order, trailing).unwrap();
        Factor::new(
            matrix,
            ordering,
            &mut Breaks::new(&mut || ControlFlow::Continue(())),
        )
    }

    fn schur(matrix: &SparseSymmetric, order: &[usize], trailing: usize) -> Dense {
        let factor = factor(matrix, order, trailing).unwrap();
        let go_on = &mut || ControlFlow::Continue(());
        factor
            .trailing_schur_complement(&mut Breaks::new(go_on))
            .unwrap()
    }

    /// Minimum degree on all but the trailing unknowns, which follow in their own order.
    fn order_with_trailing(graph: &Graph, trailing: &[usize]) -> Vec<usize> {
        let mut order = Ordering::minimum_degree(graph).unwrap();
        order.retain(|v| !trailing.contains(v));
        order.extend(trailing);
        order
    }

    #[test]
    fn the_trailing_block_is_the_dense_schur_complement() {
        let (matrix, graph) = grid_matrix(23);
        let n = matrix.size();
        // scattered, and not in ascending order: a permutation inside the block would show
        let trailing: Vec<usize> = (0..40).map(|k| (k * 211 + 17) % n).collect();
        let order = order_with_trailing(&graph, &trailing);
        let schur = schur(&matrix, &order, trailing.len());
        // dense: column c of Ŝ⁻¹ is the trailing part of A⁻¹ e_c
        let column = |k: usize| {
            let mut unit = vec![0.0; n];
            unit[k] = 1.0;
            matrix.times(&unit)
        };
        let dense: Vec<Vec<f64>> = (0..n).map(column).collect();
        let mut largest: f64 = 0.0;
        for (c, &dof) in trailing.iter().enumerate() {
            let mut unit = vec![0.0; n];
            unit[dof] = 1.0;
            let x = solve_dense(&dense, &unit);
            let trailing_part: Vec<f64> = trailing.iter().map(|&d| x[d]).collect();
            for (r, value) in schur.times(&trailing_part).into_iter().enumerate() {
                largest = largest.max((value - f64::from(u8::from(r == c))).abs());
            }
        }
        assert!(largest < 1e-13, "Ŝ (A⁻¹)_cc differs from 1 by {largest}");
    }

    /// Gaussian elimination, independent of faer.
    fn solve_dense(a: &[Vec<f64>], b: &[f64]) -> Vec<f64> {
        let (mut a, mut b, n) = (a.to_vec(), b.to_vec(), b.len());
        for k in 0..n {
            for i in k + 1..n {
                let factor = a[i][k] / a[k][k];
                if factor != 0.0 {
                    for j in k..n {
                        a[i][j] -= factor * a[k][j];
                    }
                    b[i] -= factor * b[k];
                }
            }
        }
        for k in (0..n).rev() {
            let sum: f64 = (k + 1..n).map(|j| a[k][j] * b[j]).sum();
            b[k] = (b[k] - sum) / a[k][k];
        }
        b
    }

    #[test]
    fn the_factor_solves_the_system() {
        let (matrix, graph) = grid_matrix(12);
        let exact: Vec<f64> = (0..144).map(|i| f64::from(i % 5) - 2.0).collect();
        let mut x = matrix.times(&exact);
        let order = order_with_trailing(&graph, &[]);
        factor(&matrix, &order, 0).unwrap().solve(&mut x);
        assert!(x.iter().zip(&exact).all(|(a, b)| (a - b).abs() < 1e-13));
    }

    #[test]
    fn an_empty_matrix_has_an_empty_factor() {
        let matrix = SparseSymmetric::zero(0, |_, _| {});
        assert_eq!(schur(&matrix, &[], 0).size(), 0);
        let factor = factor(&matrix, &[], 0).unwrap();
        factor.solve(&mut []);
    }

    /// The smallest and sparsest systems of a body: the factor must still have the form that contains its trailing
    /// block.
    #[test]
    fn tiny_and_diagonal_systems_have_their_trailing_block() {
        for n in 1..=4 {
            for trailing in 1..=n {
                let mut matrix = SparseSymmetric::zero(n, |j, rows| rows.push(j));
                (0..n).for_each(|j| matrix.add(j, j, 4.0 + j as f64));
                let order: Vec<usize> = (0..n).collect();
                let schur = schur(&matrix, &order, trailing);
                for k in 0..trailing {
                    let exact = 4.0 + (n - trailing + k) as f64;
                    assert!((schur.at(k, k) - exact).abs() < 1e-14, "{n}, {trailing}");
                }
            }
        }
    }

    #[test]
    fn a_singular_matrix_is_refused() {
        let mut matrix = SparseSymmetric::zero(2, |j, rows| rows.extend(j..2));
        matrix.add(0, 0, 1.0);
        matrix.add(1, 0, -2.0);
        matrix.add(1, 1, 1.0);
        let unknown = |order: &[usize]| factor(&matrix, order, 1).err();
        for (order, last) in [([0, 1], 1), ([1, 0], 0)] {
            let refused = FactorError::NotPositiveDefinite { unknown: last };
            assert_eq!(unknown(&order), Some(refused));
        }
    }
}
