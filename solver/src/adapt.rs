//! `refine: {"tolerance": …}`: a grid is refined where its error lies until the results settle.
//!
//! Solves, splits the columns and rows of the grid with most of the estimated error (and those under a
//! peak of σ_t that are wider than a part of ρ), and repeats, so that a corner of a body or the edge of a
//! punch gets a graded mesh. The results have settled when the change by further meshes, extrapolated from
//! the last two changes, lies below the tolerance.

use std::collections::BTreeSet;
use std::ops::ControlFlow;

use crate::error::SolveError;
use crate::model::ContactModel;
use crate::model::estimate::{MOST_ADAPTIVE_ELEMENTS, MOST_ADAPTIVE_LINES};
use crate::problem::{AdaptiveRefine, Grid, MeshInput, Problem, Refine};
use crate::solution::{Observer, Progress, Refinement, Solution, Warning, WarningCode};

/// The columns and rows to be split hold this part of the squared error.
const BULK: f64 = 0.7;

/// Edges under a peak of σ_t are split until they are this part of ρ.
const PART_OF_RADIUS: f64 = 0.25;

/// Most meshes: each about halves the smallest element.
const MOST_MESHES: usize = 30;

/// A force below this part of the largest one is not compared.
const SMALL_FORCE: f64 = 1e-3;

/// Changes below this part of the tolerance count as settled without a trend.
const SETTLED: f64 = 0.1;

/// Solves on finer and finer grids; returns the finest solution with the sequence of meshes.
///
/// `contacts` are those of the problem, on any mesh; `solve` solves one problem without adaptive
/// refinement. The observer sees the phases of every mesh, its iterations (but no load steps) as tentative
/// ones, and those of the last mesh again once it is known to be the last.
pub fn run(
    problem: &Problem,
    goal: &AdaptiveRefine,
    contacts: &[ContactModel],
    solve: &dyn Fn(&Problem, &mut Observer<'_>) -> Result<Solution, SolveError>,
    observe: &mut Observer<'_>,
) -> Result<Solution, SolveError> {
    let mut problem = Problem {
        mesh: MeshInput {
            refine: Refine::Times(0),
            ..problem.mesh.clone()
        },
        ..problem.clone()
    };
    let mut sequence: Vec<Refinement> = Vec::new();
    loop {
        let mut warnings: Vec<Warning> = Vec::new();
        let mut stopped = false;
        let mut solution = solve(&problem, &mut |progress| {
            let answer = match progress {
                Progress::Iteration(row) => observe(Progress::Tentative(row)),
                Progress::Step(_) => observe(Progress::Pulse),
                Progress::Warning(warning) => {
                    warnings.push(warning.clone());
                    ControlFlow::Continue(())
                }
                other => observe(other),
            };
            stopped |= answer.is_break();
            answer
        })?;
        let results = WatchedResults::new(contacts, &solution);
        let change = sequence.last().map(|before| results.change(before));
        sequence.push(results.row(change));
        let grid = problem.mesh.grid();
        let split = grid.map(|grid| finer(grid, contacts, &solution));
        let elements = split.as_ref().map_or(0, |grid| grid.x.len() * grid.y.len());
        let lines = split
            .as_ref()
            .map_or(0, |grid| grid.x.len().max(grid.y.len()));
        let large = elements > MOST_ADAPTIVE_ELEMENTS || lines > MOST_ADAPTIVE_LINES;
        let done = stopped || !solution.summary.converged || settled(&sequence, goal.tolerance);
        if done || sequence.len() >= MOST_MESHES || large {
            if !done {
                warnings.push(unfinished(&sequence, goal.tolerance));
                solution.summary.warnings.extend(warnings.last().cloned());
            }
            solution.summary.refinements = sequence;
            for warning in &warnings {
                let _ = observe(Progress::Warning(warning));
            }
            for row in &solution.history {
                let _ = observe(Progress::Iteration(row));
            }
            return Ok(solution);
        }
        if let (Some(grid), Some(split)) = (problem.mesh.grid_mut(), split) {
            *grid = split;
        }
    }
}

/// Whether all further change, estimated from the last two changes, lies below the tolerance. Changes that
/// shrink by a ratio r from mesh to mesh add up to r/(1 − r) of the last one.
fn settled(sequence: &[Refinement], tolerance: f64) -> bool {
    let changes: Vec<f64> = sequence.iter().filter_map(|row| row.change).collect();
    let [.., before, last] = changes[..] else {
        return false;
    };
    let ratio = (last / before).clamp(0.5, 1.0);
    let rest = last * ratio / (1.0 - ratio).max(f64::EPSILON);
    rest <= tolerance || before.max(last) <= SETTLED * tolerance
}

fn unfinished(sequence: &[Refinement], tolerance: f64) -> Warning {
    let change = sequence
        .last()
        .and_then(|row| row.change)
        .unwrap_or(f64::NAN);
    Warning {
        code: WarningCode::RefinementUnfinished,
        pointer: "/mesh/refine/tolerance".to_owned(),
        message: format!(
            "After {} meshes the results still change by {change:.1e}, more than the tolerance {tolerance} allows. See summary.refinements; raise the tolerance, or give the grid more lines where the error is large.",
            sequence.len()
        ),
    }
}

/// Results compared from mesh to mesh.
struct WatchedResults<'a> {
    solution: &'a Solution,
    /// The peak of σ_n converges: no contact ends at a sharp edge.
    normal_peak: bool,
    /// The peak of σ_t converges: at a sharp edge only if friction averages.
    tangential_peak: bool,
}

impl<'a> WatchedResults<'a> {
    fn new(contacts: &[ContactModel], solution: &'a Solution) -> Self {
        let warnings = &solution.summary.warnings;
        let normal_peak = !warnings
            .iter()
            .any(|w| w.code == WarningCode::ContactReachesObstacleEnd);
        let laws = contacts.iter().filter_map(|c| c.friction.as_ref());
        let averages = laws
            .into_iter()
            .all(|law| law.bound.radius().is_some_and(|r| r > 0.0));
        WatchedResults {
            solution,
            normal_peak,
            tangential_peak: normal_peak || averages,
        }
    }

    /// Largest |σ_t| and |σ_n| of all contacts.
    fn peaks(&self) -> (f64, f64) {
        let contacts = self.solution.summary.contacts.values();
        contacts.fold((0.0, 0.0), |(tangential, normal): (f64, f64), contact| {
            let size = |peak: &Option<crate::solution::Peak>| peak.map_or(0.0, |p| p.value.abs());
            (
                tangential.max(size(&contact.peak_tangential_stress)),
                normal.max(size(&contact.peak_normal_stress)),
            )
        })
    }

    fn row(&self, change: Option<f64>) -> Refinement {
        let summary = &self.solution.summary;
        let (peak_tangential_stress, peak_normal_stress) = self.peaks();
        Refinement {
            elements: self.solution.fields.elements.len() as u64,
            dofs: summary.dofs,
            normal_force: summary.normal_force,
            tangential_force: summary.tangential_force,
            friction_force: summary.friction_force,
            peak_tangential_stress,
            peak_normal_stress,
            change,
        }
    }

    /// Largest relative change of the forces, and of the peaks that converge.
    fn change(&self, before: &Refinement) -> f64 {
        let now = self.row(None);
        let relative = |a: f64, b: f64| {
            if a == b {
                0.0
            } else {
                (a - b).abs() / a.abs().max(b.abs())
            }
        };
        let largest = now.normal_force.abs().max(now.friction_force.abs());
        let mut change: f64 = 0.0;
        for (a, b) in [
            (now.normal_force, before.normal_force),
            (now.tangential_force, before.tangential_force),
            (now.friction_force, before.friction_force),
        ] {
            if a.abs().max(b.abs()) > SMALL_FORCE * largest {
                change = change.max(relative(a, b));
            }
        }
        if self.normal_peak {
            change = change.max(relative(now.peak_normal_stress, before.peak_normal_stress));
        }
        if self.tangential_peak {
            let (a, b) = (now.peak_tangential_stress, before.peak_tangential_stress);
            change = change.max(relative(a, b));
        }
        change
    }
}

/// The grid with more lines where the error is large.
fn finer(grid: &Grid, contacts: &[ContactModel], solution: &Solution) -> Grid {
    let (columns, rows) = (grid.x.len() - 1, grid.y.len() - 1);
    let (mut by_column, mut by_row) = (vec![0.0; columns], vec![0.0; rows]);
    // elements come row by row
    for (e, error) in solution.fields.element_error.iter().enumerate() {
        by_column[e % columns] += error * error;
        by_row[e / columns] += error * error;
    }
    let (mut split_columns, mut split_rows) = (bulk(&by_column), bulk(&by_row));
    under_peaks(
        contacts,
        solution,
        columns,
        &mut split_columns,
        &mut split_rows,
    );
    Grid {
        x: halved(&grid.x, &split_columns),
        y: halved(&grid.y, &split_rows),
        top: grid.top.clone(),
        bottom: grid.bottom.clone(),
    }
}

/// The fewest entries that together hold `BULK` of the sum.
fn bulk(squares: &[f64]) -> BTreeSet<usize> {
    let mut order: Vec<usize> = (0..squares.len()).collect();
    order.sort_by(|&a, &b| squares[b].total_cmp(&squares[a]).then(a.cmp(&b)));
    let total: f64 = squares.iter().sum();
    let mut held = 0.0;
    let mut chosen = BTreeSet::new();
    for i in order {
        if held >= BULK * total || squares[i] == 0.0 {
            break;
        }
        held += squares[i];
        chosen.insert(i);
    }
    chosen
}

/// Columns and rows with an edge within ρ of a peak of σ_t that is longer than a part of ρ.
fn under_peaks(
    contacts: &[ContactModel],
    solution: &Solution,
    columns: usize,
    split_columns: &mut BTreeSet<usize>,
    split_rows: &mut BTreeSet<usize>,
) {
    let fields = &solution.fields;
    for contact in contacts {
        let radius = contact.friction.as_ref().and_then(|f| f.bound.radius());
        let peak = solution
            .summary
            .contacts
            .get(&contact.name)
            .and_then(|c| c.peak_tangential_stress);
        let (Some(radius), Some(peak)) = (radius.filter(|r| *r > 0.0), peak) else {
            continue;
        };
        for (e, element) in fields.elements.iter().enumerate() {
            for &[a, b, _] in element.family().sides() {
                let place = |local: usize| {
                    let node = element[local] as usize;
                    [fields.x[node], fields.y[node]]
                };
                let ([x0, y0], [x1, y1]) = (place(a), place(b));
                let length = (x1 - x0).hypot(y1 - y0);
                let along =
                    ((peak.x - x0) * (x1 - x0) + (peak.y - y0) * (y1 - y0)) / (length * length);
                let nearest = along.clamp(0.0, 1.0);
                let distance =
                    (peak.x - x0 - nearest * (x1 - x0)).hypot(peak.y - y0 - nearest * (y1 - y0));
                if length > PART_OF_RADIUS * radius && distance < radius {
                    // sides 0 and 2 run along a row and belong to a column
                    if [a, b] == [0, 1] || [a, b] == [2, 3] {
                        split_columns.insert(e % columns);
                    } else {
                        split_rows.insert(e / columns);
                    }
                }
            }
        }
    }
}

/// Lines with one more in the middle of each interval of `split`.
fn halved(lines: &[f64], split: &BTreeSet<usize>) -> Vec<f64> {
    let mut finer = Vec::with_capacity(lines.len() + split.len());
    for (i, line) in lines.iter().enumerate() {
        finer.push(*line);
        if split.contains(&i) && i + 1 < lines.len() {
            finer.push(0.5 * (line + lines[i + 1]));
        }
    }
    finer
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_intervals_with_most_of_the_error_are_halved() {
        let split = bulk(&[0.1, 5.0, 0.0, 4.0]);
        assert_eq!(split, BTreeSet::from([1, 3]));
        let lines = halved(&[0.0, 1.0, 2.0, 4.0, 5.0], &split);
        assert_eq!(lines, [0.0, 1.0, 1.5, 2.0, 4.0, 4.5, 5.0]);
        assert!(bulk(&[0.0, 0.0]).is_empty());
    }

    fn after(changes: &[f64]) -> Vec<Refinement> {
        let row = |change: Option<f64>| Refinement {
            elements: 0,
            dofs: 0,
            normal_force: 0.0,
            tangential_force: 0.0,
            friction_force: 0.0,
            peak_tangential_stress: 0.0,
            peak_normal_stress: 0.0,
            change,
        };
        std::iter::once(row(None))
            .chain(changes.iter().map(|c| row(Some(*c))))
            .collect()
    }

    #[test]
    fn one_small_change_or_slowly_shrinking_ones_are_not_settled() {
        assert!(!settled(&after(&[0.005]), 0.01));
        assert!(settled(&after(&[0.01, 0.005]), 0.01));
        // 0.9 of each change is still to come: together nine times the last
        assert!(!settled(&after(&[0.005, 0.0045]), 0.01));
        assert!(settled(&after(&[0.0009, 0.0009]), 0.01));
    }
}
