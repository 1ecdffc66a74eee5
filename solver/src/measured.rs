//! What the noise of a measured obstacle leaves open: the problem is solved again for profiles that could have been
//! measured in place of the given one.
//!
//! The smoothed profile stands for the true one. Each sample adds noise of the declared standard deviation to it, is
//! smoothed in the same way, and is solved on the same mesh. Samples come in pairs of opposite noise: half the difference
//! of a pair scatters as a quantity does, and the mean of a pair shows how far smoothing and curvature shift it
//! (`accuracy::add_measurement`). The noise is a fixed sequence, so that equal problems give equal bits, and evened out
//! (`evened`).

use crate::accuracy::{self, OnOtherMesh};
use crate::algorithm::quiet;
use crate::body::ElasticBody;
use crate::error::SolveError;
use crate::mesh::{ExternalMesh, Mesh};
use crate::model::Model;
use crate::observer::{Observer, Progress};
use crate::phase::Phase;
use crate::problem::{Contact, Obstacle, Problem, Smoothing};
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
    let mut obstacles = problem
        .contacts
        .iter()
        .filter_map(|contact| contact.obstacle.as_ref());
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
    let curves = curves(problem);
    let mut pairs = vec![];
    for pair in 0..PAIRS as usize {
        let mut solved = |sign: f64| {
            let model = on_mesh(&sampled(problem, &curves, pair, sign))?;
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

/// The smoothed curve of a measured obstacle, and the noise that its pairs of samples add.
struct Curve {
    gap: Vec<f64>,
    deviation: f64,
    noise: Vec<Vec<f64>>,
}

/// By contact, the curve of its obstacle if that is measured.
fn curves(problem: &Problem) -> Vec<Option<Curve>> {
    let contacts = problem.contacts.iter().enumerate();
    let curve = |(number, contact): (usize, &Contact)| match &contact.obstacle {
        Some(obstacle @ Obstacle::Table { x, gap, .. }) => {
            deviation(obstacle).map(|deviation| Curve {
                gap: smoothed(x, gap, deviation),
                deviation,
                noise: evened(number, gap.len()),
            })
        }
        _ => None,
    };
    contacts.map(curve).collect()
}

/// The problem with other noise on its measured obstacles.
fn sampled(problem: &Problem, curves: &[Option<Curve>], pair: usize, sign: f64) -> Problem {
    let mut problem = problem.clone();
    for (contact, curve) in problem.contacts.iter_mut().zip(curves) {
        if let (Some(Obstacle::Table { gap, .. }), Some(curve)) = (&mut contact.obstacle, curve) {
            let points = curve.gap.iter().zip(&curve.noise[pair]);
            *gap = points
                .map(|(gap, noise)| gap + sign * curve.deviation * noise)
                .collect();
        }
    }
    problem
}

/// A fixed sequence of numbers that are nearly normally distributed, with mean 0 and standard deviation 1: sums of twelve
/// numbers that are evenly distributed, so that their bits do not depend on a library of functions.
struct Noise(u64);

impl Noise {
    fn new(seed: [u64; 2]) -> Noise {
        // mixed, since the sequence itself goes on by a fixed step
        Noise(mixed(
            (seed[0] << 32 | seed[1]).wrapping_mul(0x9e37_79b9_7f4a_7c15),
        ))
    }

    fn next(&mut self) -> f64 {
        (0..12).map(|_| self.even()).sum::<f64>() - 6.0
    }

    /// The next number between 0 and 1 (SplitMix64).
    fn even(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        (mixed(self.0) >> 11) as f64 / (1u64 << 53) as f64
    }
}

fn mixed(mut bits: u64) -> u64 {
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ (bits >> 31)
}

/// The noise of all pairs at the points of an obstacle, in standard deviations.
///
/// A quantity that responds to the noise of point j by a_j scatters by (Σ a_j²)^½. Twelve pairs by chance show that to a fifth, and for
/// the same number of points are off to the same side in every problem. A force responds smoothly; so the parts of the noise along
/// the polynomials over the points of degrees 0 to 11 are replaced by numbers that are uncorrelated over the pairs, and smooth
/// responses scatter as they should.
fn evened(number: usize, count: usize) -> Vec<Vec<f64>> {
    let of_pair = |pair: u32| {
        let mut noise = Noise::new([u64::from(pair), number as u64]);
        (0..count).map(|_| noise.next()).collect()
    };
    let mut noise: Vec<Vec<f64>> = (0..PAIRS).map(of_pair).collect();
    let polynomials = polynomials(count, (PAIRS as usize).min(count));
    let mut rows: Vec<Vec<f64>> = vec![];
    for polynomial in &polynomials {
        let parts: Vec<f64> = noise.iter().map(|one| dot(one, polynomial)).collect();
        let Some(row) = normal_to(&rows, parts.clone()) else {
            continue;
        };
        for ((one, part), even) in noise.iter_mut().zip(parts).zip(&row) {
            let more = f64::from(PAIRS).sqrt() * even - part;
            let values = one.iter_mut().zip(polynomial);
            values.for_each(|(value, p)| *value += more * p);
        }
        rows.push(row);
    }
    noise
}

/// Polynomials over `count` points, orthogonal on them and of length 1, of all degrees below `degrees`.
fn polynomials(count: usize, degrees: usize) -> Vec<Vec<f64>> {
    let place = |j: usize| (2.0 * j as f64 + 1.0) / count as f64 - 1.0;
    let mut found: Vec<Vec<f64>> = vec![];
    for _ in 0..degrees {
        let next = match found.last() {
            None => vec![1.0; count],
            Some(last) => last.iter().enumerate().map(|(j, p)| place(j) * p).collect(),
        };
        found.extend(normal_to(&found, next));
    }
    found
}

/// A vector of length 1 along `vector` without its parts along `others`, which are orthogonal and of length 1; none if nothing
/// is left.
fn normal_to(others: &[Vec<f64>], mut vector: Vec<f64>) -> Option<Vec<f64>> {
    // twice: the first time leaves rounding
    for other in others.iter().chain(others) {
        let part = dot(&vector, other);
        vector
            .iter_mut()
            .zip(other)
            .for_each(|(v, o)| *v -= part * o);
    }
    let length = dot(&vector, &vector).sqrt();
    vector.iter_mut().for_each(|v| *v /= length);
    (length > 1e-9).then_some(vector)
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
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
        // that of another obstacle is another
        let [mut one, mut other] = [0, 1].map(|number| Noise::new([0, number]));
        let product: f64 = (0..20_000).map(|_| one.next() * other.next()).sum();
        assert!(product.abs() < 4.0 * count.sqrt(), "{product}");
    }

    /// The scatter of responses over a part of the points, wherever it is, from the pairs: that of the whole is exact.
    #[test]
    fn the_pairs_show_the_scatter_of_smooth_responses() {
        for count in [2, 5, 12, 13, 31, 41, 81, 121, 400] {
            let noise = evened(0, count);
            assert_eq!(noise, evened(0, count));
            for (part, most) in [(1.0, 1e-6), (0.5, 0.15), (0.25, 0.25)] {
                for first in 0..=8 {
                    let middle = (1.0 - part) * (f64::from(first) / 4.0 - 1.0);
                    let at = |j: usize| ((2 * j + 1) as f64 / count as f64 - 1.0 - middle) / part;
                    let bump = |x: f64| {
                        if part == 1.0 {
                            1.0
                        } else {
                            (1.0 - x * x).max(0.0).sqrt()
                        }
                    };
                    let response: Vec<f64> = (0..count).map(|j| bump(at(j))).collect();
                    let size = dot(&response, &response);
                    if size == 0.0 {
                        continue;
                    }
                    let all: f64 = noise.iter().map(|one| dot(one, &response).powi(2)).sum();
                    let scatter = (all / f64::from(PAIRS) / size).sqrt();
                    assert!(
                        (scatter - 1.0).abs() < most,
                        "{count} {part} {first}: {scatter}"
                    );
                }
            }
        }
    }
}
