//! Solutions of linear systems with a factor: upwards through the fronts for the forces, downwards for the
//! displacements.

use super::fronts::{Front, Piece};
use super::interrupt::{Interrupt, Stopped};
use super::multifrontal::Factor;
use super::parallel::for_each;

impl Factor {
    /// Replaces the forces f on all unknowns by y = L⁻¹ f for the eliminated unknowns, and by f̂ = f_c − A_ci A_ii⁻¹
    /// f_i for the kept ones.
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

    /// Replaces y = L⁻¹ f of the eliminated unknowns by their displacements u, given u of the kept unknowns. Solves for
    /// several fields at once, on `threads` threads.
    pub fn backward<const FIELDS: usize>(&self, u: &mut [[f64; FIELDS]], threads: usize) {
        // this thread takes the memory of all: it has to answer for it
        let tallest = self.fronts.tallest();
        let mut workspaces: Vec<_> = (0..threads).map(|_| Vec::with_capacity(tallest)).collect();
        let groups = self.fronts.pieces.chunk_by(|a, b| a.branch && b.branch);
        for group in groups.rev() {
            // what the pieces of a group need beside their own unknowns comes after all of them
            let fronts = |piece: &Piece| &self.fronts.fronts[piece.fronts.clone()];
            let end = group.last().and_then(|piece| fronts(piece).last());
            let end = end.map_or(0, |front| front.first + front.own);
            let (mut u, after) = u.split_at_mut(end);
            let mut tasks = Vec::with_capacity(group.len());
            for piece in group.iter().rev() {
                let first = fronts(piece).first().map_or(0, |front| front.first);
                let (others, own) = u.split_at_mut(first);
                u = others;
                tasks.push((fronts(piece), own));
            }
            let work =
                |v: &mut Vec<_>, (fronts, own): (&[Front], &mut [_]), _: &mut Interrupt<'_>| {
                    self.backward_in(fronts, own, (end, &*after), v);
                    Ok::<_, Stopped>(())
                };
            let never = &mut || false;
            let workspaces = &mut workspaces[..threads.min(tasks.len())];
            let tasks = tasks.into_iter();
            let _ = for_each(tasks, workspaces, work, &mut Interrupt::new(never));
        }
    }

    /// Does the work of [`Factor::backward`] for consecutive fronts. `own`: the unknowns that the fronts own; `after`:
    /// the unknowns from `end` on.
    fn backward_in<const FIELDS: usize>(
        &self,
        fronts: &[Front],
        own: &mut [[f64; FIELDS]],
        (end, after): (usize, &[[f64; FIELDS]]),
        v: &mut Vec<[f64; FIELDS]>,
    ) {
        let start = fronts.first().map_or(0, |front| front.first);
        for front in fronts.iter().rev() {
            let place = front.first - start;
            v.clear();
            v.extend_from_slice(&own[place..place + front.own]);
            let rows = self.fronts.rows(front).iter();
            v.extend(rows.map(|&row| match (row as usize).checked_sub(end) {
                Some(row) => after[row],
                None => own[row as usize - start],
            }));
            let columns = self.columns(front);
            pulp::Arch::new().dispatch(|| backward_in_front(columns, front.own, v));
            own[place..place + front.own].copy_from_slice(&v[..front.own]);
        }
    }

    /// Gathers the values of a front's unknowns from `all` in `into`.
    fn gather(&self, front: &Front, all: &[f64], into: &mut Vec<f64>) {
        into.clear();
        into.extend_from_slice(&all[front.first..front.first + front.own]);
        let rows = self.fronts.rows(front).iter();
        into.extend(rows.map(|row| all[*row as usize]));
    }

    fn columns(&self, front: &Front) -> &[f64] {
        &self.values[front.values..front.values + front.len()]
    }
}

/// Computes u for the unknowns that a front owns, from the last to the first: u_j = (y_j − Σ_{i > j} L_ij u_i) / L_jj.
#[inline(always)]
fn backward_in_front<const FIELDS: usize>(columns: &[f64], own: usize, v: &mut [[f64; FIELDS]]) {
    /// The number of independent partial sums of one field.
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
