//! Curves through points, and smooth curves near measured points.

/// A cubic spline: slope and curvature have no jumps. Its ends are not-a-knot, so that it reproduces every cubic. With
/// natural ends its curvature would be 0 there, and so would the pressure of a contact that begins at the first point,
/// as in every half model.
#[derive(Clone, Debug, PartialEq)]
pub struct Spline {
    x: Vec<f64>,
    y: Vec<f64>,
    /// The slope at every point.
    slope: Vec<f64>,
    /// Slopes up to this count as rounding: a symmetric curve is flat in its middle.
    flat: f64,
}

/// Slopes up to this fraction of the steepest are rounding.
const FLAT: f64 = 1e-12;

impl Spline {
    /// The spline through at least two points with strictly increasing x: a line through two, a parabola through three.
    pub fn new(x: Vec<f64>, y: Vec<f64>) -> Self {
        let steps: Vec<f64> = x.windows(2).map(|x| x[1] - x[0]).collect();
        let chords: Vec<f64> = y
            .windows(2)
            .zip(&steps)
            .map(|(y, step)| (y[1] - y[0]) / step)
            .collect();
        let slope = match x.len() {
            2 => vec![chords[0]; 2],
            3 => {
                let middle = (steps[1] * chords[0] + steps[0] * chords[1]) / (steps[0] + steps[1]);
                vec![2.0 * chords[0] - middle, middle, 2.0 * chords[1] - middle]
            }
            _ => not_a_knot(&steps, &chords),
        };
        let steepest = chords
            .iter()
            .fold(0.0f64, |most, chord| most.max(chord.abs()));
        Spline {
            x,
            y,
            slope,
            flat: FLAT * steepest,
        }
    }

    /// Value and slope at `at`, between the first and the last point.
    pub fn at(&self, at: f64) -> [f64; 2] {
        self.on_piece(self.piece(at), at)
    }

    /// The number of pieces between points.
    pub fn pieces(&self) -> usize {
        self.x.len() - 1
    }

    /// The ends of a piece.
    pub fn ends(&self, piece: usize) -> [f64; 2] {
        [self.x[piece], self.x[piece + 1]]
    }

    fn piece(&self, at: f64) -> usize {
        (self.x.partition_point(|x| *x <= at).max(1) - 1).min(self.pieces() - 1)
    }

    /// Value and slope of one piece's cubic, by Hermite's formula.
    pub fn on_piece(&self, k: usize, at: f64) -> [f64; 2] {
        let step = self.x[k + 1] - self.x[k];
        let part = (at - self.x[k]) / step;
        let chord = (self.y[k + 1] - self.y[k]) / step;
        let (start, end) = (self.slope[k] - chord, self.slope[k + 1] - chord);
        // the chord, and what the cubic has beyond it: 0 at both ends
        let beyond = part * (1.0 - part) * (start * (1.0 - part) - end * part);
        let change = start * (1.0 - part) * (1.0 - 3.0 * part) + end * part * (3.0 * part - 2.0);
        let value = self.y[k] + step * (part * chord + beyond);
        let slope = chord + change;
        let is_flat = slope.abs() <= self.flat;
        [value, if is_flat { 0.0 } else { slope }]
    }
}

/// The slopes at the points of a not-a-knot spline (its first two pieces are one cubic, and so are its last two), by
/// Gaussian elimination of tridiagonal equations; every pivot is positive.
fn not_a_knot(steps: &[f64], chords: &[f64]) -> Vec<f64> {
    let last = steps.len();
    // the equation of an end by its step, the next one and their chords: [own, neighbour, right-hand side]
    let end = |step: f64, next: f64, chord: f64, after: f64| {
        let both = step + next;
        let right = ((step + 2.0 * both) * next * chord + step * step * after) / both;
        [next, both, right]
    };
    let [own, neighbour, right] = end(steps[0], steps[1], chords[0], chords[1]);
    let (mut factor, mut value) = (vec![neighbour / own], vec![right / own]);
    for i in 1..last {
        let (before, after) = (steps[i - 1], steps[i]);
        let right = 3.0 * (after * chords[i - 1] + before * chords[i]);
        let pivot = 2.0 * (before + after) - after * factor[i - 1];
        factor.push(before / pivot);
        value.push((right - after * value[i - 1]) / pivot);
    }
    let [own, neighbour, right] = end(
        steps[last - 1],
        steps[last - 2],
        chords[last - 1],
        chords[last - 2],
    );
    let pivot = own - neighbour * factor[last - 1];
    let mut slope = vec![(right - neighbour * value[last - 1]) / pivot];
    for i in (0..last).rev() {
        slope.push(value[i] - factor[i] * slope[slope.len() - 1]);
    }
    slope.reverse();
    slope
}

/// The smoothed values f near `y` at the places `x`: of all f with Σ((y − f)/deviation)² ≤ number of points, the one
/// with the smallest ∫f‴² (Reinsch's criterion, with the third derivative and by differences). The pressure follows the
/// curvature of a profile: the usual penalty on the curvature itself would flatten it, most at the ends, while a
/// parabola has no penalty here and is recovered exactly under noise. If a parabola is within the deviation, it is the
/// result.
pub fn smoothed(x: &[f64], y: &[f64], deviation: f64) -> Vec<f64> {
    let count = x.len();
    let parabola = parabola(x, y);
    let rest: Vec<f64> = y.iter().zip(&parabola).map(|(y, p)| y - p).collect();
    let misfit = |f: &[f64]| {
        let square = |(rest, f): (&f64, &f64)| ((rest - f) / deviation).powi(2);
        rest.iter().zip(f).map(square).sum::<f64>()
    };
    let most = count as f64;
    if count < 4 || misfit(&vec![0.0; count]) <= most {
        return parabola;
    }
    // in units of the mean spacing
    let unit = (x[count - 1] - x[0]) / (count - 1) as f64;
    let places: Vec<f64> = x.iter().map(|at| (at - x[0]) / unit).collect();
    let rows = third_differences(&places);
    // the misfit grows with the weight of the penalty, from 0 to that of the parabola
    let (mut low, mut high) = (-SMOOTHEST, SMOOTHEST);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if misfit(&penalized(&rows, &rest, middle.exp2())) <= most {
            low = middle
        } else {
            high = middle
        }
    }
    let f = penalized(&rows, &rest, low.exp2());
    parabola.iter().zip(f).map(|(p, f)| p + f).collect()
}

/// The standard deviation of the noise of values `y` at the places `x`, whatever their smooth shape, by the distance of each
/// value from the cubic through two neighbours on either side; and its own relative standard deviation. `None` of fewer
/// than [`FEWEST_SCATTERED`] values.
pub fn scatter(x: &[f64], y: &[f64]) -> Option<[f64; 2]> {
    let distances = distances(x, y)?;
    let count = distances.len() as f64;
    let variance = distances.iter().map(|d| d * d).sum::<f64>() / count;
    // neighbouring distances are correlated: of even places by −0.8, 0.4, −0.11, 0.01, whose squares add up to 2.6
    Some([variance.sqrt(), (2.6 / (2.0 * count)).sqrt()])
}

/// The step to which the ordinates of a curve through points are rounded, a power of ten, if rounding changes its curvature by
/// more than a tenth from point to point. `x` increases strictly.
///
/// The distance c of a point from the chord of its neighbours is the curvature there. Rounding scatters c by a part of the
/// step, however smooth the curve is; points on straight pieces, where c is 0, do not count.
pub fn rounding(x: &[f64], y: &[f64]) -> Option<f64> {
    const FEWEST: usize = 8;
    const MOST_DIGITS: i32 = 9;
    const LEAST: f64 = 0.1;
    /// Rounding scatters c by about half a step; what scatters it more is another shape, or noise.
    const MOST: f64 = 1.5;
    let whole = |factor: f64| {
        y.iter()
            .all(|y| (y * factor - (y * factor).round()).abs() <= 1e-6)
    };
    let step = (0..=MOST_DIGITS)
        .map(|digits| 10f64.powi(digits))
        .find(|factor| whole(*factor))?
        .recip();
    let from_chord = |(x, y): (&[f64], &[f64])| {
        let chord = y[0] + (y[2] - y[0]) * (x[1] - x[0]) / (x[2] - x[0]);
        y[1] - chord
    };
    let triples = x.windows(3).zip(y.windows(3));
    let all: Vec<f64> = triples.map(from_chord).collect();
    let bent = all.iter().filter(|c| c.abs() > 1e-3 * step).count();
    let mean = all.iter().sum::<f64>().abs() / all.len().max(1) as f64;
    let changes = all.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    let scatter = changes.sum::<f64>() / all.len().max(2) as f64;
    let rounded = scatter > LEAST * step.max(mean) && scatter < MOST * step;
    (bent >= FEWEST && rounded).then_some(step)
}

/// The standard deviation of values that look like measured ones: their distances from cubics through neighbours change
/// sign from place to place, as 7 of 10 do of noise, while those of a shape keep it, and those of single kinks are few.
pub fn noise(x: &[f64], y: &[f64]) -> Option<f64> {
    /// The part of all pairs of neighbours above which a profile looks measured.
    const MOST_ALIKE: f64 = 0.5;
    /// The part of the standard deviation below which a distance may be rounding.
    const SLIGHT: f64 = 0.1;
    /// The median distance of normal noise of deviation 1.
    const MEDIAN: f64 = 0.6745;
    let distances = distances(x, y)?;
    // single kinks and edges do not change the median
    let mut sizes: Vec<f64> = distances.iter().map(|d| d.abs()).collect();
    let (_, median, _) = sizes.select_nth_unstable_by(distances.len() / 2, f64::total_cmp);
    let deviation = *median / MEDIAN;
    let turns = |pair: &&[f64]| {
        pair[0] * pair[1] < 0.0 && pair.iter().all(|d| d.abs() > SLIGHT * deviation)
    };
    let turning = distances.windows(2).filter(turns).count();
    let all = distances.len() - 1;
    (turning as f64 > MOST_ALIKE * all as f64).then_some(deviation)
}

/// The distance of each value, but for two at either end, from the cubic through two neighbours on either side, divided by
/// the standard deviation that it has where values have 1. `None` of fewer than [`FEWEST_SCATTERED`] values.
fn distances(x: &[f64], y: &[f64]) -> Option<Vec<f64>> {
    if x.len() < FEWEST_SCATTERED {
        return None;
    }
    let distance = |i: usize| {
        let near = [i - 2, i - 1, i + 1, i + 2];
        let weight = |j: usize| {
            let others = near.iter().filter(|k| **k != j);
            others
                .map(|&k| (x[i] - x[k]) / (x[j] - x[k]))
                .product::<f64>()
        };
        let (mut rest, mut variance) = (y[i], 1.0);
        for j in near {
            let weight = weight(j);
            rest -= weight * y[j];
            variance += weight * weight;
        }
        rest / variance.sqrt()
    };
    Some((2..x.len() - 2).map(distance).collect())
}

/// The fewest values of which the scatter is known well enough to be compared with anything.
pub const FEWEST_SCATTERED: usize = 20;

/// The bound of |log₂ √λ| for the weight λ of the penalty, in units of the mean spacing: far beyond the values at which
/// 100,000 points are not smoothed at all, or to a parabola.
const SMOOTHEST: f64 = 120.0;

/// The number of halvings of the interval of log₂ √λ, which give λ to 10⁻⁸.
const HALVINGS: u32 = 36;

/// The values of the least-squares parabola, by polynomials that are orthogonal over the places.
fn parabola(x: &[f64], y: &[f64]) -> Vec<f64> {
    let sum = |of: &dyn Fn(usize) -> f64| (0..x.len()).map(of).sum::<f64>();
    let count = x.len() as f64;
    let half = 0.5 * (x[x.len() - 1] - x[0]);
    let mean = sum(&|i| (x[i] - x[0]) / half) / count;
    let first: Vec<f64> = x.iter().map(|at| (at - x[0]) / half - mean).collect();
    let squares = sum(&|i| first[i] * first[i]);
    let shift = sum(&|i| first[i].powi(3)) / squares;
    let second: Vec<f64> = first
        .iter()
        .map(|p| p * (p - shift) - squares / count)
        .collect();
    let level = sum(&|i| y[i]) / count;
    let part = |basis: &[f64]| {
        let norm = sum(&|i| basis[i] * basis[i]);
        if norm > 0.0 {
            sum(&|i| basis[i] * (y[i] - level)) / norm
        } else {
            0.0
        }
    };
    let (slope, curve) = (part(&first), part(&second));
    (0..x.len())
        .map(|i| level + slope * first[i] + curve * second[i])
        .collect()
}

/// The third derivative over each four consecutive points, times the root of the length that the derivative represents.
fn third_differences(x: &[f64]) -> Vec<[f64; 4]> {
    let row = |x: &[f64]| {
        let root = ((x[3] - x[0]) / 3.0).sqrt();
        std::array::from_fn(|i| {
            let others = (0..4).filter(|j| *j != i);
            let product: f64 = others.map(|j| x[i] - x[j]).product();
            6.0 * root / product
        })
    };
    x.windows(4).map(row).collect()
}

/// The f with the smallest Σ(y − f)² + weight² Σ(row · f)², by rotations: the normal equations would lose twice as many
/// digits.
fn penalized(rows: &[[f64; 4]], y: &[f64], weight: f64) -> Vec<f64> {
    let mut triangle = [[0.0; 5]; 4];
    let mut done: Vec<[f64; 5]> = Vec::with_capacity(y.len());
    for (k, y) in y.iter().enumerate() {
        insert(&mut triangle, [1.0, 0.0, 0.0, 0.0, *y]);
        if let Some([a, b, c, d]) = rows.get(k) {
            insert(
                &mut triangle,
                [weight * a, weight * b, weight * c, weight * d, 0.0],
            );
        }
        done.push(triangle[0]);
        let shifted = |[_, b, c, d, right]: [f64; 5]| [b, c, d, 0.0, right];
        triangle = [
            shifted(triangle[1]),
            shifted(triangle[2]),
            shifted(triangle[3]),
            [0.0; 5],
        ];
    }
    let mut f = vec![0.0; y.len() + 3];
    for (k, row) in done.iter().enumerate().rev() {
        let known: f64 = (1..4).map(|j| row[j] * f[k + j]).sum();
        f[k] = (row[4] - known) / row[0];
    }
    f.truncate(y.len());
    f
}

/// Rotates one more row [4 coefficients, right-hand side] into an upper triangle of such rows.
fn insert(triangle: &mut [[f64; 5]; 4], mut row: [f64; 5]) {
    for (i, own) in triangle.iter_mut().enumerate() {
        let length = own[i].hypot(row[i]);
        if length == 0.0 {
            continue;
        }
        let (cosine, sine) = (own[i] / length, row[i] / length);
        for j in i..5 {
            let (a, b) = (own[j], row[j]);
            own[j] = cosine * a + sine * b;
            row[j] = cosine * b - sine * a;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A parabola of radius 8, its ordinates rounded: told where the step is a large part of what a point lies off the chord,
    /// spacing²/16; and neither where it is small, nor of straight pieces, nor of exact whole numbers.
    #[test]
    fn rounded_points_are_told_where_rounding_bends_their_curve() {
        let parabola = |spacing: f64, digits: i32| {
            let x: Vec<f64> = (-60..=60).map(|k| spacing * f64::from(k)).collect();
            let factor = 10f64.powi(digits);
            let y: Vec<f64> = x
                .iter()
                .map(|x| (factor * x * x / 16.0).round() / factor)
                .collect();
            rounding(&x, &y)
        };
        for spacing in [0.05, 0.03, 0.025, 0.02, 0.015, 0.01, 0.005] {
            for digits in [3, 4] {
                let step = parabola(spacing, digits);
                let expected = 10f64.powi(-digits);
                assert!(
                    step.is_some_and(|step| (step / expected - 1.0).abs() < 1e-12),
                    "{spacing} {digits}: {step:?}"
                );
            }
        }
        assert_eq!(
            [0.05, 0.03, 0.02].map(|spacing| parabola(spacing, 7)),
            [None; 3]
        );
        let whole: Vec<f64> = (0..20).map(f64::from).collect();
        let squares: Vec<f64> = whole.iter().map(|x| x * x).collect();
        let roof: Vec<f64> = whole.iter().map(|x| (x - 7.3).abs()).collect();
        assert_eq!(
            [rounding(&whole, &squares), rounding(&whole, &roof)],
            [None; 2]
        );
    }

    #[test]
    fn a_spline_reproduces_cubics_also_at_its_ends() {
        let f = |x: f64| 0.3 - x + 0.2 * x * x - 0.7 * x * x * x;
        let slope = |x: f64| -1.0 + 0.4 * x - 2.1 * x * x;
        let x = vec![0.0, 0.1, 0.7, 1.0, 1.9];
        let spline = Spline::new(x.clone(), x.iter().map(|x| f(*x)).collect());
        for k in 0..=38 {
            let at = 0.05 * f64::from(k);
            let [value, change] = spline.at(at);
            assert!((value - f(at)).abs() < 1e-13, "{at}");
            assert!((change - slope(at)).abs() < 1e-12, "{at}");
        }
        // an even number of points of a symmetric curve, one of which only rounding keeps from its place
        let x = [-1.1, -0.7, -0.1, 0.1, 0.7, 1.1 * (1.0 + 1e-16)];
        let even = Spline::new(x.to_vec(), x.iter().map(|x| x.cosh()).collect());
        assert_eq!(even.at(0.0)[1], 0.0);
        let line = Spline::new(vec![0.0, 2.0], vec![1.0, 2.0]);
        assert_eq!(line.at(0.5), [1.25, 0.5]);
        let parabola = Spline::new(vec![0.0, 1.0, 3.0], vec![0.0, 1.0, 9.0]);
        assert!((parabola.at(2.0)[0] - 4.0).abs() < 1e-15);
        assert!((parabola.at(3.0)[1] - 6.0).abs() < 1e-15);
    }

    /// A spline converges with the fourth power of the spacing: twice the points have 1/16 of the error, up to the
    /// ends.
    #[test]
    fn a_spline_converges_with_the_fourth_power_of_the_spacing() {
        let worst = |count: usize| {
            let x: Vec<f64> = (0..=count).map(|i| i as f64 / count as f64).collect();
            let spline = Spline::new(x.clone(), x.iter().map(|x| x.exp()).collect());
            (0..1000).fold(0.0f64, |worst, k| {
                let at = k as f64 / 999.0;
                worst.max((spline.at(at)[0] - at.exp()).abs())
            })
        };
        let ratio = worst(20) / worst(40);
        assert!((13.0..19.0).contains(&ratio), "{ratio}");
    }

    /// Noise of standard deviation 1 without randomness: two multiplicative sequences added.
    fn noise(count: usize) -> Vec<f64> {
        let uniform = |i: usize, seed: u64| {
            let mut z = (i as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ seed;
            z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            (z >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        };
        (0..count)
            .map(|i| (uniform(i, 1) + uniform(i, 2)) * 6f64.sqrt())
            .collect()
    }

    #[test]
    fn smoothing_meets_its_criterion_and_lessens_the_noise() {
        for count in [8, 50, 1000, 20_000] {
            let x: Vec<f64> = (0..count)
                .map(|i| 4.0 * i as f64 / (count - 1) as f64)
                .collect();
            // not a parabola: three waves
            let exact: Vec<f64> = x.iter().map(|x| (4.0 * x).sin()).collect();
            let noise: Vec<f64> = noise(count).iter().map(|e| 0.01 * e).collect();
            let y: Vec<f64> = exact.iter().zip(&noise).map(|(y, e)| y + e).collect();
            let f = smoothed(&x, &y, 0.01);
            let misfit: f64 = (0..count).map(|i| ((y[i] - f[i]) / 0.01).powi(2)).sum();
            assert!(
                (misfit / count as f64 - 1.0).abs() < 1e-3,
                "{count}: {misfit}"
            );
            let size = |of: &dyn Fn(usize) -> f64| {
                ((0..count).map(|i| of(i).powi(2)).sum::<f64>() / count as f64).sqrt()
            };
            let (left, was) = (size(&|i| f[i] - exact[i]), size(&|i| noise[i]));
            // what a deviation that is not quite that of the noise takes away, and the noise of the few numbers, less
            // than 30, that make up three waves
            let few = 0.01f64.powi(2) * 30.0 / count as f64;
            let most = (0.01f64.powi(2) - was * was).abs() + few;
            // eight points cannot follow three waves
            assert!(count == 8 || left * left < most, "{count}: {left} of {was}");
        }
    }

    #[test]
    fn a_parabola_is_recovered_under_noise_and_exact_data_are_kept() {
        let x: Vec<f64> = (0..=100).map(|i| 0.04 * f64::from(i)).collect();
        let exact: Vec<f64> = x.iter().map(|x| x * x / 16.0).collect();
        let noise = noise(101);
        let y: Vec<f64> = exact
            .iter()
            .zip(&noise)
            .map(|(y, e)| y + 1e-3 * e)
            .collect();
        let f = smoothed(&x, &y, 1.2e-3);
        // three coefficients from 101 points: the error at an end is 3σ/√101
        let off = f.iter().zip(&exact).map(|(f, e)| (f - e).abs());
        assert!(off.fold(0.0, f64::max) < 6e-4);
        // with a deviation far below the spacing of the numbers nothing is moved
        let same = smoothed(&x, &y, 1e-30);
        let moved = same.iter().zip(&y).map(|(f, y)| (f - y).abs());
        assert!(moved.fold(0.0, f64::max) < 1e-15);
        // very uneven places and extreme deviations stay finite
        let x = [0.0, 1e-9, 1.0, 1.0 + 1e-9, 2.0, 1e6];
        for deviation in [1e-300, 1e-6, 1.0, 1e300] {
            let f = smoothed(&x, &[0.0, 1.0, 0.0, 1.0, 0.0, 1.0], deviation);
            assert!(f.iter().all(|f| f.is_finite()), "{deviation}: {f:?}");
        }
    }

    #[test]
    fn the_scatter_is_that_of_the_noise_whatever_the_shape() {
        // a fixed sequence between -1 and 1, whose deviation is 1/√3
        let mut bits = 7u64;
        let mut noise = || {
            bits = bits
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            (bits >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        };
        for count in [40, 400] {
            let x: Vec<f64> = (0..count)
                .map(|i| {
                    let at = i as f64 / (count - 1) as f64;
                    at + 0.3 * at * at
                })
                .collect();
            let y: Vec<f64> = x
                .iter()
                .map(|x| 0.5 * x * x + (3.0 * x).sin() + 1e-3 * 3f64.sqrt() * noise())
                .collect();
            let [found, relative] = scatter(&x, &y).unwrap();
            assert!(
                (found / 1e-3 - 1.0).abs() < 4.0 * relative,
                "{count}: {found}"
            );
        }
        assert_eq!(scatter(&[0.0; 19], &[0.0; 19]), None);
    }
}
