//! Sparse symmetric matrices and the graphs behind them.

/// An undirected graph without loops, in compressed rows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Graph {
    starts: Vec<usize>,
    neighbours: Vec<u32>,
}

impl Graph {
    /// Vertices that share a clique (an element's nodes, say) are neighbours.
    pub fn from_cliques<'a>(
        vertices: usize,
        cliques: impl Iterator<Item = &'a [u32]> + Clone,
    ) -> Self {
        // Cliques of each vertex first, then each vertex collects its neighbours once.
        let mut counts = vec![0usize; vertices + 1];
        cliques
            .clone()
            .for_each(|clique| clique.iter().for_each(|&v| counts[v as usize + 1] += 1));
        for v in 0..vertices {
            counts[v + 1] += counts[v];
        }
        let mut places = counts.clone();
        let all: Vec<&[u32]> = cliques.collect();
        let mut member = vec![0u32; counts[vertices]];
        for (c, clique) in all.iter().enumerate() {
            for &v in *clique {
                member[places[v as usize]] = c as u32;
                places[v as usize] += 1;
            }
        }
        let mut seen_by = vec![u32::MAX; vertices];
        let (mut starts, mut neighbours) = (vec![0], Vec::new());
        for v in 0..vertices {
            let begin = neighbours.len();
            seen_by[v] = v as u32;
            for &c in &member[counts[v]..counts[v + 1]] {
                for &w in all[c as usize] {
                    if seen_by[w as usize] != v as u32 {
                        seen_by[w as usize] = v as u32;
                        neighbours.push(w);
                    }
                }
            }
            neighbours[begin..].sort_unstable();
            starts.push(neighbours.len());
        }
        Graph { starts, neighbours }
    }

    /// Number of vertices.
    pub fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// True without vertices.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Sorted neighbours of a vertex.
    pub fn neighbours(&self, vertex: usize) -> &[u32] {
        &self.neighbours[self.starts[vertex]..self.starts[vertex + 1]]
    }
}

/// The lower triangle of a symmetric matrix by compressed columns, rows sorted, pattern fixed.
#[derive(Clone, Debug)]
pub struct SparseSymmetric {
    pub(super) column_starts: Vec<usize>,
    pub(super) rows: Vec<usize>,
    pub(super) values: Vec<f64>,
}

impl SparseSymmetric {
    /// A zero matrix; `column(j, rows)` appends the rows ≥ j of column j, in any order.
    pub fn zero(size: usize, mut column: impl FnMut(usize, &mut Vec<usize>)) -> Self {
        let (mut column_starts, mut rows) = (Vec::with_capacity(size + 1), Vec::new());
        column_starts.push(0);
        for j in 0..size {
            let begin = rows.len();
            column(j, &mut rows);
            rows[begin..].sort_unstable();
            column_starts.push(rows.len());
        }
        let values = vec![0.0; rows.len()];
        SparseSymmetric {
            column_starts,
            rows,
            values,
        }
    }

    /// Number of rows.
    pub fn size(&self) -> usize {
        self.column_starts.len() - 1
    }

    /// Adds to the entry (i, j); the pattern must hold it. One of (i, j), (j, i) is to be added.
    pub fn add(&mut self, i: usize, j: usize, value: f64) {
        let (row, column) = (i.max(j), i.min(j));
        let begin = self.column_starts[column];
        let rows = &self.rows[begin..self.column_starts[column + 1]];
        match rows.binary_search(&row) {
            Ok(place) => self.values[begin + place] += value,
            Err(_) => unreachable!("entry ({row}, {column}) lies outside the pattern"),
        }
    }

    /// Mean of the diagonal from row `first` on; of all of it where there is none.
    pub fn mean_diagonal(&self, first: usize) -> f64 {
        let rows = if first < self.size() {
            first..self.size()
        } else {
            0..self.size()
        };
        let count = rows.len().max(1) as f64;
        // rows are sorted, and none lies above the diagonal
        let diagonal = rows.map(|j| self.values.get(self.column_starts[j]).unwrap_or(&0.0));
        diagonal.sum::<f64>() / count
    }

    /// A v.
    pub fn times(&self, v: &[f64]) -> Vec<f64> {
        let mut product = vec![0.0; v.len()];
        for j in 0..self.size() {
            for place in self.column_starts[j]..self.column_starts[j + 1] {
                let (i, a) = (self.rows[place], self.values[place]);
                product[i] += a * v[j];
                if i != j {
                    product[j] += a * v[i];
                }
            }
        }
        product
    }

    /// True when every entry is finite.
    pub fn is_finite(&self) -> bool {
        self.values.iter().all(|v| v.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cliques_make_neighbours() {
        let cliques: [&[u32]; 2] = [&[0, 1, 2], &[2, 3]];
        let graph = Graph::from_cliques(4, cliques.into_iter());
        assert_eq!(graph.neighbours(2), [0, 1, 3]);
        assert_eq!(graph.neighbours(3), [2]);
    }

    #[test]
    fn the_product_uses_both_triangles() {
        let mut a = SparseSymmetric::zero(2, |j, rows| rows.extend(j..2));
        a.add(0, 0, 2.0);
        a.add(0, 1, 3.0);
        a.add(1, 1, 5.0);
        assert_eq!(a.times(&[1.0, 10.0]), [32.0, 53.0]);
    }
}
