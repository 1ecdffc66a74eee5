//! What the noise of a measured obstacle leaves open: the problem is solved again for profiles that could have been
//! measured in place of the given one.
//!
//! The smoothed profile stands for the true one. Each sample adds noise of the declared standard deviation to it, is
//! smoothed in the same way, and is solved on the same mesh. Samples come in pairs of opposite noise: half the difference
//! of a pair scatters as a quantity does, and the mean of a pair shows how far smoothing and curvature shift it
//! (`accuracy::add_measurement`). The noise is a fixed sequence, so that equal problems give equal bits.

use crate::accuracy::{self, OnOtherMesh};
use crate::algorithm::quiet;
use crate::body::ElasticBody;
use crate::error::SolveError;
use crate::mesh::{ExternalMesh, Mesh};
use crate::model::Model;
use crate::observer::{Observer, Progress};
use crate::phase::Phase;
use crate::problem::{Obstacle, Problem, Smoothing};
use crate::solution::{Outcome, Solution};
use crate::spline::smoothed;
use crate::steps;

/// The number of pairs of samples.
const PAIRS: u32 = Smoothing::SAMPLES / 2;

/// The standard deviation of the points of an obstacle, if it is measured.
fn deviation(obstacle: &Obstacle) -> Option<f64> {
    match obstacle {
        Obstacle::Table { smoothing, .. } => smoothing.map(|given| given.standard_deviation),
        _ => None,
    }
}

/// Whether an obstacle of the problem is measured, so that its noise is part of the errors.
pub fn is_measured(problem: &Problem) -> bool {
    let mut obstacles = problem.contacts.iter().map(|contact| &contact.obstacle);
    obstacles.any(|obstacle| deviation(obstacle).is_some())
}

/// Adds what the noise of measured obstacles leaves open to the errors of a solution on this mesh. If the samples cannot be
/// solved, the errors are those of the mesh, and the verdict says so.
pub fn add_error(
    problem: &Problem,
    mesh: &Mesh,
    solution: &mut Solution,
    observer: &mut dyn Observer,
) {
    let summary = &mut solution.summary;
    if !is_measured(problem) || summary.outcome != Outcome::Converged {
        return;
    }
    let Some(accuracy) = &mut summary.accuracy else {
        return;
    };
    match samples(problem, mesh, observer) {
        Ok(pairs) => accuracy::add_measurement(accuracy, &pairs),
        Err(why) => accuracy::without_measurement(accuracy, &why),
    }
}

/// The quantities of pairs of samples, or the reason why there are none.
fn samples(
    problem: &Problem,
    mesh: &Mesh,
    observer: &mut dyn Observer,
) -> Result<Vec<[Vec<OnOtherMesh>; 2]>, String> {
    observer.event(Progress::Phase(Phase::Verify));
    let observer = &mut quiet(observer);
    let failed = |error: SolveError| match error {
        SolveError::Stopped => "solving them was stopped".to_owned(),
        error => error.to_string(),
    };
    let on_mesh = |problem: &Problem| {
        let model = Model::on_mesh(problem, ExternalMesh::from(mesh.clone()));
        model.map_err(|violations| {
            let first = violations.first();
            first.map_or(String::new(), |violation| violation.to_string())
        })
    };
    let first = on_mesh(problem)?;
    let body = ElasticBody::new(&first, observer).map_err(failed)?;
    let mut pairs = vec![];
    for pair in 0..PAIRS {
        let mut solved = |sign: f64| {
            let model = on_mesh(&sampled(problem, pair, sign))?;
            // an obstacle that turns normals, or faces other nodes, has a body of its own
            let own = if ElasticBody::same(&first, &model) {
                None
            } else {
                Some(ElasticBody::new(&model, observer).map_err(failed)?)
            };
            let body = own.as_ref().unwrap_or(&body);
            let reported = steps::run_to_compare(&model, body, observer).map_err(failed)?;
            if reported.summary.outcome != Outcome::Converged {
                return Err("one of them does not converge".to_owned());
            }
            let quantities = reported.along.quantities.iter();
            let finite = quantities.filter(|q| q.value.is_finite());
            let name = |patch: usize| &model.contacts[patch].name;
            Ok(finite
                .map(|q| OnOtherMesh::new(q, name(q.patch)))
                .collect::<Vec<_>>())
        };
        pairs.push([solved(1.0)?, solved(-1.0)?]);
    }
    Ok(pairs)
}

/// The problem with other noise on its measured obstacles.
fn sampled(problem: &Problem, pair: u32, sign: f64) -> Problem {
    let mut problem = problem.clone();
    for (number, contact) in problem.contacts.iter_mut().enumerate() {
        let Some(deviation) = deviation(&contact.obstacle) else {
            continue;
        };
        if let Obstacle::Table { x, gap, .. } = &mut contact.obstacle {
            let mut noise = Noise::new([u64::from(pair), number as u64]);
            *gap = smoothed(x, gap, deviation);
            gap.iter_mut()
                .for_each(|gap| *gap += sign * deviation * noise.next());
        }
    }
    problem
}

/// A fixed sequence of numbers that are nearly normally distributed, with mean 0 and standard deviation 1: sums of twelve
/// numbers that are evenly distributed, so that their bits do not depend on a library of functions.
struct Noise(u64);

impl Noise {
    fn new(seed: [u64; 2]) -> Noise {
        Noise((seed[0] << 32 | seed[1]).wrapping_mul(0x9e37_79b9_7f4a_7c15))
    }

    fn next(&mut self) -> f64 {
        (0..12).map(|_| self.even()).sum::<f64>() - 6.0
    }

    /// The next number between 0 and 1 (SplitMix64).
    fn even(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((bits ^ (bits >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_noise_has_mean_0_and_deviation_1_and_differs_between_pairs() {
        let mut noise = Noise::new([3, 1]);
        let all: Vec<f64> = (0..20_000).map(|_| noise.next()).collect();
        let count = all.len() as f64;
        let mean = all.iter().sum::<f64>() / count;
        let square = all.iter().map(|x| x * x).sum::<f64>() / count;
        let neighbours = all.windows(2).map(|w| w[0] * w[1]).sum::<f64>() / count;
        // four standard deviations of each
        assert!(mean.abs() < 4.0 / count.sqrt(), "{mean}");
        assert!(
            (square - 1.0).abs() < 4.0 * (2.0 / count).sqrt(),
            "{square}"
        );
        assert!(neighbours.abs() < 4.0 / count.sqrt(), "{neighbours}");
        assert_ne!(Noise::new([0, 0]).next(), Noise::new([1, 0]).next());
        assert_ne!(Noise::new([0, 0]).next(), Noise::new([0, 1]).next());
    }
}
