//! Obstacles under loads that nothing holds: neither pressure nor friction of the final state resists one of their motions.

use crate::algorithm::finished::Finished;
use crate::algorithm::system::{Patch, Point, State, System};
use crate::error::SolveError;
use crate::problem::Condition;
use crate::solution::Outcome;

/// The rotation by its moment (radians) beyond which an obstacle has run away: rotations are small ones.
const TURNED_OVER: f64 = 1.0;

/// Checks that nothing moves an obstacle without end: that contact and friction of a converged state resist all its unknown
/// motions, and that it is not turned over, also where iterations do not converge.
pub(super) fn held(system: &System<'_>, finished: &Finished) -> Result<(), SolveError> {
    if finished.outcome == Outcome::Converged {
        resisted(system, &finished.state, &finished.bound)?;
    }
    match finished.outcome {
        Outcome::Canceled => Ok(()),
        _ if finished.slide.is_some() => Ok(()),
        _ => not_turned_over(system, &finished.state),
    }
}

fn not_turned_over(system: &System<'_>, state: &State) -> Result<(), SolveError> {
    for (p, patch) in system.patches.iter().enumerate() {
        // glue and springs hold it, however far it turns
        let tool = patch.contact.tool.as_ref();
        let turns = patch.contact.condition == Condition::Unilateral
            && tool.is_some_and(|tool| tool.loads[2].is_some() && tool.stiffness[2] == 0.0);
        let [.., tilt] = system.obstacle_motions(&state.v, p);
        if turns && tilt.abs() > TURNED_OVER {
            return Err(unheld(patch, 2));
        }
    }
    Ok(())
}

fn unheld(patch: &Patch<'_>, motion: usize) -> SolveError {
    SolveError::ObstacleUnheld {
        contact: patch.contact.name.clone(),
        motion: MOTIONS[motion].to_owned(),
    }
}

/// Checks that contact and friction of a state resist all unknown motions of obstacles. `bound`: the friction bound.
fn resisted(system: &System<'_>, state: &State, bound: &[f64]) -> Result<(), SolveError> {
    for (p, patch) in system.patches.iter().enumerate() {
        let Some(tool) = &patch.contact.tool else {
            continue;
        };
        let free: Vec<usize> = tool.free().collect();
        // lengths of the contact in place of angles, so that all motions are lengths
        let arm = 2.0 / patch.contact.boundary.length();
        let scaled = |row: [f64; 3]| {
            let unit = |k: &usize| row[*k] * if *k == 2 { arm } else { 1.0 };
            free.iter().map(unit).collect::<Vec<f64>>()
        };
        let along = |i: usize, a: usize| scaled([0, 1, 2].map(|k| tool.row(i, k)[a]));
        let mut rows: Vec<Vec<f64>> = Vec::new();
        for (i, node) in system.range(patch).enumerate() {
            if state.active[node] {
                rows.push(along(i, 0));
            }
            if system.nodes[node].held_tangent.is_some() {
                rows.push(along(i, 1));
            }
        }
        let points = system.points.iter().zip(bound);
        let rubs = points.filter(|(point, tau)| point.patch == p && **tau > 0.0);
        let slip = |point: &Point| system.slip(&state.v, point);
        // between neighbouring points that slip to opposite sides some place sticks, although no point does
        let signs: Vec<(usize, bool)> = rubs
            .clone()
            .map(|(point, _)| (point.nodes[2], slip(point) > 0.0))
            .collect();
        let turns = signs.windows(2).any(|pair| {
            let neighbours = pair[0].0.abs_diff(pair[1].0) <= 2;
            neighbours && pair[0].1 != pair[1].1
        });
        for (point, _) in rubs {
            if turns || system.law(point).sticks(slip(point)) {
                let nodes = point.nodes.map(|node| node - patch.first);
                rows.extend(nodes.map(|i| along(i, 1)));
            }
        }
        for k in free.iter().filter(|k| tool.stiffness[**k] > 0.0) {
            rows.push(scaled([0, 1, 2].map(|other| f64::from(other == *k))));
        }
        if let Some(k) = first_dependent(&rows, free.len()) {
            return Err(unheld(patch, free[k]));
        }
    }
    Ok(())
}

/// The unknown motions in words.
const MOTIONS: [&str; 3] = [
    "it moves away from the body, or into it, freely",
    "it slides along the body freely",
    "it turns over freely: it tips over the end of the contact, or rolls on it",
];

/// The number of the first column of a matrix, given by its rows, that depends on the columns before it; none if all are
/// independent.
fn first_dependent(rows: &[Vec<f64>], columns: usize) -> Option<usize> {
    /// The part of a column that must be left beside the columns before it.
    const LEFT: f64 = 1e-6;
    let mut basis: Vec<Vec<f64>> = Vec::new();
    for k in 0..columns {
        let mut column: Vec<f64> = rows.iter().map(|row| row[k]).collect();
        let size = norm(&column);
        for other in &basis {
            let part: f64 = column.iter().zip(other).map(|(c, o)| c * o).sum();
            column
                .iter_mut()
                .zip(other)
                .for_each(|(c, o)| *c -= part * o);
        }
        let left = norm(&column);
        if left <= LEFT * size.max(LEFT) {
            return Some(k);
        }
        basis.push(column.into_iter().map(|c| c / left).collect());
    }
    None
}

fn norm(column: &[f64]) -> f64 {
    column.iter().map(|c| c * c).sum::<f64>().sqrt()
}
