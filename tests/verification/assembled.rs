//! The stiffness of a whole body as one sparse matrix, which the solver never has: to hold its fronts against.

use std::collections::BTreeMap;

use faer::Side;
use faer::linalg::solvers::Solve;
use faer::sparse::{SparseColMat, Triplet};
use solver::elasticity::{DofMap, ElementStiffness, ElementTables, Section, Springs};
use solver::linear::ElementMatrix;
use solver::mesh::Mesh;

/// A symmetric matrix by its rows, all entries.
pub(crate) struct Assembled {
    rows: Vec<BTreeMap<usize, f64>>,
}

impl Assembled {
    /// The stiffness on the unknowns of `map`, and the load of its prescribed displacements.
    pub(crate) fn new(
        mesh: &Mesh,
        section: &Section,
        quadrature: u32,
        map: &DofMap,
    ) -> (Assembled, Vec<f64>) {
        let mut rows = vec![BTreeMap::new(); map.unknowns];
        let tables = &ElementTables::new(mesh, section, quadrature);
        let springs = Springs::default();
        let elements = tables.elements(mesh, section, &springs);
        let elements = ElementStiffness::new(elements, map);
        let mut matrix = ElementMatrix::default();
        for e in 0..mesh.elements.len() as u32 {
            elements.put(e, &mut matrix);
            for (row, entries) in matrix.unknowns.iter().zip(&matrix.entries) {
                let Some(row) = *row else { continue };
                for (column, value) in matrix.unknowns.iter().zip(entries) {
                    if let Some(column) = *column {
                        *rows[row as usize].entry(column as usize).or_insert(0.0) += value;
                    }
                }
            }
        }
        (Assembled { rows }, elements.load_of_supports())
    }

    pub(crate) fn size(&self) -> usize {
        self.rows.len()
    }

    /// All rows, with their zeros.
    pub(crate) fn dense(&self) -> Vec<Vec<f64>> {
        let row = |row: &BTreeMap<usize, f64>| {
            let mut whole = vec![0.0; self.size()];
            row.iter()
                .for_each(|(column, value)| whole[*column] = *value);
            whole
        };
        self.rows.iter().map(row).collect()
    }

    /// x of A x = b, by faer's sparse Cholesky factor.
    pub(crate) fn solve(&self, b: &[f64]) -> Vec<f64> {
        let entries = self.rows.iter().enumerate().flat_map(|(row, entries)| {
            let entry = move |(column, value): (&usize, &f64)| Triplet::new(row, *column, *value);
            entries.iter().map(entry)
        });
        let entries: Vec<_> = entries.collect();
        let n = self.size();
        let matrix = SparseColMat::try_new_from_triplets(n, n, &entries).unwrap();
        let factor = matrix.sp_cholesky(Side::Lower).unwrap();
        let x = factor.solve(faer::Col::from_fn(n, |i| b[i]));
        (0..n).map(|i| x[i]).collect()
    }
}
