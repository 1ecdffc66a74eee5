//! ω_ρ and the averaged pressure S_ρ, thesis (1.2)–(1.4).
//!
//!   S(s) = ∫ ω_ρ(|s − y|) p(y) dy = Σ_j W_j(s) p_j,   p quadratic on each edge
//!
//! Mesh-free: the kernel is integrated over its exact support, split at the ends of edges and at
//! its own centre, whatever the number of edges under it (without the thesis's limit of
//! two, 3.4.2).

use std::collections::HashMap;
use std::f64::consts::TAU;
use std::sync::{Arc, LazyLock, Mutex, PoisonError};

use super::moments::{moments_up_to, shape, total_variation_of_slope};
use super::rings;
use crate::element::{edge3, gauss};
use crate::problem::{Kernel, Measure, Normalization};

/// The integral of exp(1/(x² − 1)) over (−1, 1).
const BUMP_INTEGRAL: f64 = 0.443_993_816_168_079;

/// The reciprocal 1 / ∫ exp(1/(r² − 1)) dA over the unit disc.
const BUMP_DISC: f64 = 2.143_565_775_8;

/// The integration rule for one piece of the kernel.
static FULL_RULE: LazyLock<Vec<(f64, f64)>> = LazyLock::new(|| gauss::rule(40));
/// The integration rule for a short piece of the kernel, on which the kernel varies little.
static SHORT_RULE: LazyLock<Vec<(f64, f64)>> = LazyLock::new(|| gauss::rule(12));
/// A piece is short if its length is below this fraction of ρ.
const SHORT: f64 = 0.1;

/// The largest length of a piece, as a fraction of ρ, and the number of Gauss points that are enough for it: the errors of
/// the weights of a row with pieces of this length have a sum of absolute values below 2·10⁻¹³, where the weights have a sum
/// of 1 (`few_points_are_enough_on_short_edges`).
const FEWER_POINTS: [(f64, usize); 5] = [(0.005, 4), (0.01, 5), (0.02, 6), (0.03, 7), (0.05, 10)];
static FEWER_RULES: LazyLock<Vec<Vec<(f64, f64)>>> = LazyLock::new(|| {
    let rules = FEWER_POINTS.iter();
    rules.map(|(_, points)| gauss::rule(*points)).collect()
});

/// The integration rule for a piece that is this fraction of ρ long, below [`SHORT`].
fn short_rule(part: f64) -> &'static [(f64, f64)] {
    let allowed = FEWER_POINTS.iter().position(|(most, _)| part <= *most);
    allowed.map_or(&SHORT_RULE, |k| &FEWER_RULES[k])
}

/// Over rings, where a kernel value takes longer to compute, [`SHORT_RULE`] is also used on a piece whose distance from
/// the kernel's ends exceeds this many times half its length. Away from the axis the error is 10⁻¹³.
const FAR: f64 = 3.0;
/// The integration rule over rings for a piece that is neither short, nor far from the kernel's ends, nor longer than
/// [`MIDDLE`].
static MIDDLE_RULE: LazyLock<Vec<(f64, f64)>> = LazyLock::new(|| gauss::rule(24));
/// The largest length of a piece with [`MIDDLE_RULE`], as a fraction of ρ.
const MIDDLE: f64 = 0.25;

/// The midside node of an edge counts as its middle within this fraction of the edge's length, the rounding of arc
/// length.
const STRAIGHT: f64 = 1e-12;

/// A radius below this fraction of the chain's length counts as 0, since arc length itself is less accurate: the law is
/// Coulomb's.
const LOCAL: f64 = 1e-9;

/// Γ_C as arc length, with positions where rings are used.
#[derive(Clone, Debug, PartialEq)]
pub struct Chain {
    /// Arc length at the nodes (corner, midside, corner, …).
    pub s: Vec<f64>,
    /// The nodes (r, z), for `Measure::Surface`; not used otherwise.
    pub positions: Vec<[f64; 2]>,
    /// Whether the pressure continues as an even function before the first node, which is on a line of symmetry.
    pub mirror_start: bool,
    /// Whether the pressure continues as an even function beyond the last node, which is on a line of symmetry.
    pub mirror_end: bool,
}

impl Chain {
    /// A chain with arc length only, without lines of symmetry.
    pub fn plain(s: Vec<f64>) -> Self {
        Chain {
            s,
            positions: Vec::new(),
            mirror_start: false,
            mirror_end: false,
        }
    }
}

/// The parameters of S_ρ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Average {
    /// The radius ρ ≥ 0 (length); 0: Coulomb's local law.
    pub radius: f64,
    /// The shape of ω_ρ.
    pub kernel: Kernel,
    /// The scale of ω_ρ.
    pub normalization: Normalization,
    /// The domain over which ω_ρ is integrated.
    pub measure: Measure,
}

/// The averaging operator of one chain.
#[derive(Clone, Debug)]
pub struct Averaging {
    chain: Arc<Chain>,
    /// The rows computed so far: friction points, profiles and the search for peaks need the same places many times.
    known: Arc<Mutex<KnownRows>>,
    radius: f64,
    kernel: Kernel,
    measure: Measure,
    /// The factor C of thesis (1.2).
    scale: f64,
    /// Whether the normalization is [`Normalization::Conserving`].
    conserving: bool,
}

/// The coefficients a, b and c of a distance from the axis, a r + b z + c, as a function of the position (r, z).
type Distance = [f64; 3];

/// The distance of the position itself from the axis: its coordinate r.
const OWN: Distance = [1.0, 0.0, 0.0];

/// A mirror image of the chain that continues it evenly beyond an end.
struct Image {
    /// The centre of the kernel, moved so that the image coincides with the chain.
    centre: f64,
    /// The image's distance from the axis, as a function of places of the chain.
    distance: Distance,
}

/// One row of the averaging matrix W: the weights of nodes from `first` on.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The first node with a weight.
    pub first: usize,
    /// The weights of `first` and the nodes after it.
    pub weights: Vec<f64>,
}

impl Row {
    /// The node after the last one with a weight.
    pub fn end(&self) -> usize {
        self.first + self.weights.len()
    }

    /// The averaged pressure Σ W_j p_j.
    pub fn apply(&self, pressure: &[f64]) -> f64 {
        self.weights
            .iter()
            .zip(&pressure[self.first..])
            .map(|(w, p)| w * p)
            .sum()
    }
}

/// Computed rows of W, by the bits of the arc length that they are for.
#[derive(Debug, Default)]
struct KnownRows {
    rows: HashMap<u64, Arc<Row>>,
    /// The total number of weights in all rows.
    weights: usize,
}

impl KnownRows {
    /// Stores a row, unless the stored rows have too many weights for each node of the chain already.
    fn add(&mut self, s: f64, row: &Arc<Row>, nodes: usize) {
        const MOST_FOR_A_NODE: usize = 256;
        // a row takes some space beside its weights
        let more = row.weights.len() + 16;
        if self.weights + more <= MOST_FOR_A_NODE * nodes {
            self.weights += more;
            self.rows.insert(s.to_bits(), row.clone());
        }
    }
}

impl Averaging {
    /// The averaging operator with the parameters `average` on a chain.
    pub fn new(average: &Average, chain: Chain) -> Self {
        let length = chain.s[chain.s.len() - 1] - chain.s[0];
        let radius = match average.radius {
            radius if radius < LOCAL * length => 0.0,
            radius => radius,
        };
        let disc = radius * radius;
        let scale = match (average.normalization, average.kernel, average.measure) {
            (Normalization::PeakOne, Kernel::Bump, _) => std::f64::consts::E,
            (Normalization::PeakOne, Kernel::Parabola, _) => 1.0,
            (_, Kernel::Bump, Measure::Line) => 1.0 / (BUMP_INTEGRAL * radius),
            (_, Kernel::Parabola, Measure::Line) => 0.75 / radius,
            (_, Kernel::Bump, Measure::Surface) => BUMP_DISC / disc,
            (_, Kernel::Parabola, Measure::Surface) => 2.0 / (std::f64::consts::PI * disc),
        };
        Averaging {
            chain: Arc::new(chain),
            known: Arc::default(),
            radius,
            kernel: average.kernel,
            measure: average.measure,
            scale,
            conserving: average.normalization == Normalization::Conserving,
        }
    }

    /// The part of ∫ω around a place on the chain that lies on the chain, in (0, 1]; beyond a line of symmetry the
    /// chain continues.
    pub fn part_inside(&self, s: f64) -> f64 {
        let (start, end) = (self.chain.s[0], self.chain.s[self.chain.s.len() - 1]);
        let reach = |distance: f64, mirrored: bool| {
            if mirrored {
                1.0
            } else {
                (distance / self.radius).clamp(0.0, 1.0)
            }
        };
        let before = reach(s - start, self.chain.mirror_start);
        let after = reach(end - s, self.chain.mirror_end);
        if self.radius == 0.0 || before >= 1.0 && after >= 1.0 {
            return 1.0;
        }
        let [low, middle, high, whole] =
            [-before, 0.0, after, 1.0].map(|to| moments_up_to(self.kernel, to)[0]);
        0.5 * (high - low) / (whole - middle)
    }

    /// The factor by which averaging reduces the amplitude of a pressure wave of wavelength `length`, relative to a
    /// uniform pressure.
    pub fn part_of_wave(&self, length: f64) -> f64 {
        if self.radius == 0.0 {
            return 1.0;
        }
        let (mut wave, mut whole) = (0.0, 0.0);
        for (xi, w) in FULL_RULE.iter() {
            let distance = 0.5 * (1.0 + xi) * self.radius;
            whole += w * self.omega(distance);
            wave += w * self.omega(distance) * (TAU * distance / length).cos();
        }
        wave / whole
    }

    /// The radius ρ (length); 0 where the law is local.
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// A bound of the second derivative |d²S/ds²| for a pressure that is nowhere larger in size than `most`: `most` times the
    /// total variation of ω′ (stress/length²). Infinite where S is no average along a line.
    pub fn curvature_bound(&self, most: f64) -> f64 {
        if self.radius == 0.0 || self.measure != Measure::Line {
            return f64::INFINITY;
        }
        // a conserving average divides by the part of the kernel inside the chain, which is smallest at the chain's ends
        let ends = [self.chain.s[0], self.chain.s[self.chain.s.len() - 1]];
        let inside = if self.conserving {
            ends.iter()
                .fold(1.0, |least: f64, s| least.min(self.part_inside(*s)))
        } else {
            1.0
        };
        most / inside * self.scale * total_variation_of_slope(self.kernel) / self.radius
    }

    /// The kernel ω_ρ at a distance.
    pub fn omega(&self, distance: f64) -> f64 {
        self.scale * shape(self.kernel, distance / self.radius)
    }

    /// The row of W at arc length s. For ρ = 0 the row interpolates between nodes: Coulomb's law.
    pub fn row(&self, s: f64) -> Arc<Row> {
        let known = || self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(row) = known().rows.get(&s.to_bits()) {
            return row.clone();
        }
        let row = Arc::new(self.integrated_row(s));
        known().add(s, &row, self.chain.s.len());
        row
    }

    /// The work of computing a row (multiplications).
    pub fn work(&self, row: &Row) -> usize {
        let of_a_weight = match self.measure {
            Measure::Line => 500,
            Measure::Surface => 3000,
        };
        of_a_weight * row.weights.len()
    }

    fn integrated_row(&self, s: f64) -> Row {
        let mut parts: Vec<(usize, [f64; 3])> = Vec::new();
        let mut add = |edge: usize, weights: [f64; 3]| parts.push((edge, weights));
        if self.radius == 0.0 {
            let edge = self.edge_at(s);
            add(edge, edge3::shape(edge3::invert(&self.arc(edge), s)));
        } else {
            let ring = match self.measure {
                Measure::Line => None,
                Measure::Surface => Some(self.distance_from_axis(s)),
            };
            for image in self.images(s) {
                self.integrate(&image, ring, &mut add);
            }
        }
        let edges = parts.iter().map(|(edge, _)| *edge);
        let (Some(first), Some(last)) = (edges.clone().min(), edges.max()) else {
            return Row {
                first: 0,
                weights: Vec::new(),
            };
        };
        let mut row = Row {
            first: 2 * first,
            weights: vec![0.0; 2 * (last - first) + 3],
        };
        for (edge, weights) in parts {
            let start = 2 * (edge - first);
            for (node, weight) in [start, start + 2, start + 1].into_iter().zip(weights) {
                row.weights[node] += weight;
            }
        }
        row
    }

    /// The distance from the axis at arc length s.
    fn distance_from_axis(&self, s: f64) -> f64 {
        let edge = self.edge_at(s);
        let h = edge3::shape(edge3::invert(&self.arc(edge), s));
        edge3::interpolate(&h, &self.distances(edge, OWN)).max(0.0)
    }

    /// The distances from the axis at the nodes of an edge.
    fn distances(&self, edge: usize, [a, b, c]: Distance) -> [f64; 3] {
        [2 * edge, 2 * edge + 2, 2 * edge + 1].map(|i| {
            let [r, z] = self.chain.positions[i];
            a * r + b * z + c
        })
    }

    /// The kernel around a place at distance r from the axis, integrated over a ring of radius
    /// `ring` that lies `along` away on the meridian, per length of meridian:
    ///
    ///   ∫ ω(d) ring dθ,   d² = along² + 4 r ring sin²(θ/2)
    fn ring_omega(&self, along: f64, r: f64, ring: f64) -> f64 {
        let rest = self.radius * self.radius - along * along;
        let product = 4.0 * r * ring;
        if rest <= 0.0 || ring <= 0.0 {
            return 0.0;
        }
        if rest <= rings::LARGEST * product {
            let b = rest / (self.radius * self.radius);
            return self.scale * ring * rings::around(self.kernel, b, rest / product);
        }
        // the ring lies within the kernel up to this angle, or altogether
        let half_sine = (rest / product).sqrt().min(1.0);
        let most = 2.0 * half_sine.asin();
        let around: f64 = FULL_RULE
            .iter()
            .map(|(xi, w)| {
                let sine = (0.25 * most * (1.0 + xi)).sin();
                w * self.omega((along * along + product * sine * sine).sqrt())
            })
            .sum();
        // twice, for both directions; ½ from the rule's own length of two
        around * most * ring
    }

    /// The integration rule for the kernel around `centre` between two places on one side of it; `ring` as of
    /// [`Averaging::integrate`].
    fn rule(&self, [a, b]: [f64; 2], centre: f64, ring: Option<f64>) -> &'static [(f64, f64)] {
        let part = (b - a) / self.radius;
        let far_from_axis = ring.is_some_and(|r| r > 2.0 * self.radius) && !self.conserving;
        let smooth = match (self.kernel, ring) {
            (Kernel::Bump, None) => true,
            // divided by the part of the kernel inside the chain, which has a kink at ρ from its ends
            (Kernel::Parabola, None) => !self.conserving,
            (Kernel::Bump, Some(_)) => far_from_axis,
            (Kernel::Parabola, Some(_)) => false,
        };
        if part < SHORT {
            return if smooth {
                short_rule(part)
            } else {
                &SHORT_RULE
            };
        }
        let to_end = 1.0 - (0.5 * (a + b) - centre).abs() / self.radius;
        match () {
            () if !far_from_axis => &FULL_RULE,
            () if to_end >= 0.5 * FAR * part => &SHORT_RULE,
            () if part <= MIDDLE => &MIDDLE_RULE,
            () => &FULL_RULE,
        }
    }

    /// Integrates the kernel at an image's centre, edge by edge, also outside the chain. `ring`: the distance of the
    /// kernel's centre from the axis, if the kernel is integrated over the image's rings. `add`: receives the weights
    /// of an edge.
    fn integrate(&self, image: &Image, ring: Option<f64>, add: &mut impl FnMut(usize, [f64; 3])) {
        let centre = image.centre;
        let (low, high) = (centre - self.radius, centre + self.radius);
        let cubed = ring.is_some() && self.kernel == Kernel::Parabola;
        for edge in self.edge_at(low)..self.chain.s.len() / 2 {
            let arc = self.arc(edge);
            if arc[0] >= high {
                break;
            }
            let (a, b) = (arc[0].max(low), arc[1].min(high));
            if ring.is_none() && self.by_moments(&arc) && a < b {
                add(edge, self.weights_by_moments(&arc, centre, [a, b]));
                continue;
            }
            let radii = ring.map_or([0.0; 3], |_| self.distances(edge, image.distance));
            if ring.is_some() && radii.iter().all(|r| *r <= 0.0) {
                continue; // across the axis: these are rings of the chain itself
            }
            let middle = centre.clamp(a, b.max(a));
            let straight = is_straight(&arc);
            let mut weights = [0.0; 3];
            for (a, b) in [(a, middle), (middle, b)] {
                let length = b - a;
                if length <= 0.0 {
                    continue;
                }
                let rule = self.rule([a, b], centre, ring);
                for (xi, w) in rule {
                    let part = 0.5 * (1.0 + xi);
                    // over rings the parabola ends as a power 3/2 of the distance, which a square makes a cube
                    let (y, w) = match () {
                        () if !cubed => (a + length * part, *w),
                        () if b == high => {
                            let rest = 1.0 - part;
                            (b - length * rest * rest, 2.0 * w * rest)
                        }
                        () if a == low => (a + length * part * part, 2.0 * w * part),
                        () => (a + length * part, *w),
                    };
                    let shape = edge3::shape(if straight {
                        (2.0 * y - arc[0] - arc[1]) / (arc[1] - arc[0])
                    } else {
                        edge3::invert(&arc, y)
                    });
                    let omega = match ring {
                        None => self.omega(y - centre),
                        Some(r) => {
                            self.ring_omega(y - centre, r, edge3::interpolate(&shape, &radii))
                        }
                    };
                    let inside = if self.conserving {
                        self.part_inside(y)
                    } else {
                        1.0
                    };
                    let factor = 0.5 * length * w * omega / inside;
                    (0..3).for_each(|i| weights[i] += factor * shape[i]);
                }
            }
            add(edge, weights);
        }
    }

    /// Whether the weights of an edge follow from moments of the kernel: its shape functions are parabolas of arc length;
    /// it is not so short compared with ρ that differences of moments lose digits; and the kernel does not vary along it.
    fn by_moments(&self, arc: &[f64; 3]) -> bool {
        is_straight(arc)
            && arc[1] - arc[0] >= SHORT * self.radius
            && !(self.conserving && arc[..2].iter().any(|s| self.part_inside(*s) < 1.0))
    }

    /// The integrals ∫ ω h_i between two places of an edge.
    fn weights_by_moments(
        &self,
        &[start, end, _]: &[f64; 3],
        centre: f64,
        between: [f64; 2],
    ) -> [f64; 3] {
        let moments = between.map(|y| {
            let t = (y - centre) / self.radius;
            moments_up_to(self.kernel, t.clamp(-1.0, 1.0))
        });
        let scale = self.scale * self.radius;
        let m: [f64; 3] = std::array::from_fn(|k| scale * (moments[1][k] - moments[0][k]));
        // ξ = from + by t
        let half = 0.5 * (end - start);
        let (from, by) = ((centre - 0.5 * (start + end)) / half, self.radius / half);
        let first = from * m[0] + by * m[1];
        let second = from * from * m[0] + 2.0 * from * by * m[1] + by * by * m[2];
        [
            0.5 * (second - first),
            0.5 * (second + first),
            m[0] - second,
        ]
    }

    /// The chain continued evenly at its mirrors, for a kernel at s: integrating a kernel over the mirrored pressure
    /// equals integrating the mirrored kernel over the pressure. Rings are mirrored in space.
    fn images(&self, s: f64) -> Vec<Image> {
        let (start, end) = (self.chain.s[0], self.chain.s[self.chain.s.len() - 1]);
        let reaches = |i: &Image| i.centre > start - self.radius && i.centre < end + self.radius;
        let image = |centre: f64, distance: Distance| Image { centre, distance };
        let at_start = |distance: Distance| self.reflected(distance, false);
        let at_end = |distance: Distance| self.reflected(distance, true);
        let mirrored = match (self.chain.mirror_start, self.chain.mirror_end) {
            (false, false) => vec![],
            (true, false) => vec![image(2.0 * start - s, at_start(OWN))],
            (false, true) => vec![image(2.0 * end - s, at_end(OWN))],
            (true, true) => {
                let period = 2.0 * (end - start);
                let most = (self.radius / period).ceil() as i64 + 1;
                // two reflections move the chain by a period, forwards or backwards
                let moved = |k: i64| {
                    (0..k.abs()).fold(OWN, |distance, _| {
                        if k > 0 {
                            at_start(at_end(distance))
                        } else {
                            at_end(at_start(distance))
                        }
                    })
                };
                let shifted = (-most..=most)
                    .filter(|k| *k != 0)
                    .map(|k| image(s + k as f64 * period, moved(-k)));
                let turned = (-most..=most)
                    .map(|k| image(2.0 * start - s + k as f64 * period, at_start(moved(k))));
                shifted.chain(turned).collect()
            }
        };
        std::iter::once(image(s, OWN))
            .chain(mirrored)
            .filter(reaches)
            .collect()
    }

    /// The function `distance` for places that are first reflected in the line across the chain's start or end: x → x −
    /// 2 t (x − e)·t with the tangent t at the end e. At the axis this line is the axis.
    fn reflected(&self, distance: Distance, at_end: bool) -> Distance {
        let x = &self.chain.positions;
        let n = x.len();
        if n == 0 {
            return distance;
        }
        let [e, middle, other] = if at_end {
            [n - 1, n - 2, n - 3]
        } else {
            [0, 1, 2]
        }
        .map(|i| x[i]);
        let along: [f64; 2] = std::array::from_fn(|i| 4.0 * middle[i] - 3.0 * e[i] - other[i]);
        let length = along[0].hypot(along[1]);
        let t = if e[0] <= LOCAL * length {
            [1.0, 0.0]
        } else {
            along.map(|c| c / length)
        };
        let [a, b, c] = distance;
        let part = 2.0 * (a * t[0] + b * t[1]);
        let offset = e[0] * t[0] + e[1] * t[1];
        [a - part * t[0], b - part * t[1], c + part * offset]
    }

    fn arc(&self, edge: usize) -> [f64; 3] {
        let s = &self.chain.s;
        [s[2 * edge], s[2 * edge + 2], s[2 * edge + 1]]
    }

    /// The edge at arc length s; beyond the chain's ends its first or its last edge.
    fn edge_at(&self, s: f64) -> usize {
        let after = self.chain.s.partition_point(|&node| node <= s);
        (after.max(1) - 1).min(self.chain.s.len() - 2) / 2
    }
}

/// Whether the midside node of an edge lies in its middle, so that its shape functions are parabolas of arc length.
fn is_straight(&[start, end, middle]: &[f64; 3]) -> bool {
    (start + end - 2.0 * middle).abs() <= STRAIGHT * (end - start)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::friction::tests::average;

    fn averaging(
        radius: f64,
        kernel: Kernel,
        s: Vec<f64>,
        mirror_start: bool,
        mirror_end: bool,
    ) -> Averaging {
        let average = Average {
            kernel,
            ..average(radius)
        };
        Averaging::new(
            &average,
            Chain {
                s,
                positions: Vec::new(),
                mirror_start,
                mirror_end,
            },
        )
    }

    fn with_midsides(corners: &[f64]) -> Vec<f64> {
        let mut s = vec![corners[0]];
        for pair in corners.windows(2) {
            s.extend([0.5 * (pair[0] + pair[1]), pair[1]]);
        }
        s
    }

    fn even(edges: usize, length: f64) -> Vec<f64> {
        with_midsides(
            &(0..=edges)
                .map(|k| length * k as f64 / edges as f64)
                .collect::<Vec<_>>(),
        )
    }

    #[test]
    fn waves_are_averaged_as_rows_average_them() {
        let s = even(400, 2.0);
        for kernel in [Kernel::Bump, Kernel::Parabola] {
            for (radius, length) in [(0.0, 0.3), (0.02, 0.3), (0.3, 0.3), (0.3, 1.0)] {
                let average = averaging(radius, kernel, s.clone(), false, false);
                let wave: Vec<f64> = s.iter().map(|s| (TAU * (s - 1.0) / length).cos()).collect();
                let left = average.row(1.0).apply(&wave);
                let part = average.part_of_wave(length);
                assert!(
                    (part - left).abs() < 1e-5,
                    "{radius} {length}: {part} {left}"
                );
            }
        }
    }

    /// Forty points integrate the bump to 1.4e-11: hence the tolerance 1e-10 here and below. The average of a piecewise
    /// quadratic interpolant is exact to degree 2; degree 4 is interpolated on fine edges, with an error of the fourth
    /// power of their length.
    #[test]
    fn moments_of_the_bump_are_exact_on_any_mesh() {
        let (rho, x) = (0.3, 1.03);
        for s in [
            even(1, 2.0),
            even(3, 2.0),
            even(400, 2.0),
            with_midsides(&[0.0, 0.9, 1.02, 1.0201, 1.3, 2.0]),
        ] {
            let row = averaging(rho, Kernel::Bump, s.clone(), false, false).row(x);
            let moment =
                |f: fn(f64) -> f64| row.apply(&s.iter().map(|&y| f(y)).collect::<Vec<_>>());
            assert!((moment(|_| 1.0) - 1.0).abs() < 1e-10);
            assert!((moment(|y| y) - x).abs() < 1e-10);
            assert!((moment(|y| y * y) - (x * x + 0.1581136363 * rho * rho)).abs() < 1e-10);
        }
        let s = even(400, 2.0);
        let row = averaging(rho, Kernel::Bump, s.clone(), false, false).row(x);
        let fourth = row.apply(&s.iter().map(|y| y.powi(4)).collect::<Vec<_>>());
        let exact = x.powi(4) + 0.9486818178 * x * x * rho * rho + 0.0529818180 * rho.powi(4);
        assert!((fourth - exact).abs() < 1e-9, "{}", fourth - exact);
    }

    /// On edges as short as each rule of [`FEWER_POINTS`] allows, weights differ from integrals by twenty points by what
    /// is promised there: all of a row together by 2·10⁻¹³. Edges begin anywhere beside the kernel's ends.
    #[test]
    fn few_points_are_enough_on_short_edges() {
        let exact = gauss::rule(20);
        for kernel in [Kernel::Bump, Kernel::Parabola] {
            for (part, points) in FEWER_POINTS {
                // just below the limit: rounding must not choose the next rule
                let part = part * (1.0 - 1e-9);
                let edges = (2.0 / part) as usize + 3;
                let s = even(edges, edges as f64 * part);
                let average = averaging(1.0, kernel, s.clone(), false, false);
                for place in [0.0, 0.13, 0.5, 0.77] {
                    let at = 1.0 + (1.0 + place) * part;
                    let row = average.row(at);
                    let mut off = 0.0;
                    let mut weights = vec![0.0; s.len()];
                    for edge in 0..edges {
                        let (low, high) =
                            (s[2 * edge].max(at - 1.0), s[2 * edge + 2].min(at + 1.0));
                        for (xi, w) in exact.iter().filter(|_| high > low) {
                            let y = 0.5 * (low + high + xi * (high - low));
                            let shape = edge3::shape((y - s[2 * edge + 1]) / (0.5 * part));
                            let factor = 0.5 * (high - low) * w * average.omega(y - at);
                            let nodes = [2 * edge, 2 * edge + 2, 2 * edge + 1];
                            nodes
                                .iter()
                                .zip(shape)
                                .for_each(|(i, h)| weights[*i] += factor * h);
                        }
                    }
                    for (node, weight) in weights.iter().enumerate() {
                        let found = node.checked_sub(row.first).and_then(|i| row.weights.get(i));
                        off += (found.unwrap_or(&0.0) - weight).abs();
                    }
                    assert!(off < 2e-13, "{kernel:?}, {points} points: {off:e}");
                }
            }
        }
    }

    /// The second differences of an average are below the bound of its curvature, also where a conserving average divides by
    /// the part of the kernel inside the chain, and where ρ is longer than the chain.
    #[test]
    fn the_curvature_of_an_average_has_a_bound() {
        let s = even(200, 2.0);
        // a pressure that jumps where the kernel's slope changes fastest, and one that fills a chain or an end of it
        let jumps: Vec<f64> = (s
            .iter()
            .map(|s| if (0.8..1.2).contains(s) { 3.0 } else { -3.0 }))
        .collect();
        let at_an_end: Vec<f64> = s.iter().map(|s| if *s < 0.1 { 3.0 } else { 0.0 }).collect();
        for kernel in [Kernel::Bump, Kernel::Parabola] {
            for (radius, conserving) in [0.1, 0.3, 0.5, 1.5, 4.0]
                .into_iter()
                .flat_map(|r| [(r, false), (r, true)])
            {
                let average = Averaging::new(
                    &Average {
                        radius,
                        kernel,
                        normalization: if conserving {
                            Normalization::Conserving
                        } else {
                            Normalization::UnitIntegral
                        },
                        measure: Measure::Line,
                    },
                    Chain::plain(s.clone()),
                );
                let step = 0.01 * radius.min(1.0);
                let bound = average.curvature_bound(1.25 * 3.0);
                let mut most = 0.0f64;
                for p in [&jumps, &at_an_end, &vec![3.0; s.len()]] {
                    let at = |k: usize| average.row(k as f64 * step).apply(p);
                    let curved = |k: usize| (at(k + 1) - 2.0 * at(k) + at(k - 1)) / (step * step);
                    let last = (2.0 / step) as usize - 1;
                    most = (1..last).map(|k| curved(k).abs()).fold(most, f64::max);
                }
                assert!(
                    most < bound,
                    "{kernel:?} {radius} {conserving}: {most} {bound}"
                );
                // it is of use: not much larger than it must be
                assert!(
                    conserving || radius > 0.5 || bound < 8.0 * most,
                    "{kernel:?} {radius}: {most} {bound}"
                );
            }
        }
    }

    #[test]
    fn the_parabola_has_unit_integral_and_second_moment_a_fifth() {
        let (rho, x, s) = (0.2, 0.8, even(7, 2.0));
        let row = averaging(rho, Kernel::Parabola, s.clone(), false, false).row(x);
        assert!((row.apply(&vec![1.0; s.len()]) - 1.0).abs() < 1e-14);
        let second = row.apply(&s.iter().map(|y| y * y).collect::<Vec<_>>());
        assert!((second - (x * x + rho * rho / 5.0)).abs() < 1e-14);
    }

    #[test]
    fn a_mirror_continues_the_pressure_evenly_even_when_the_radius_exceeds_the_first_edges() {
        // p = 1 + s² is even: averaged near s = 0 it must not depend on the end of the chain
        let (rho, s) = (0.5, with_midsides(&[0.0, 0.1, 0.3, 2.0]));
        let p: Vec<f64> = s.iter().map(|y| 1.0 + y * y).collect();
        for x in [0.0, 0.05, 0.2, 0.45] {
            let mean = averaging(rho, Kernel::Bump, s.clone(), true, false)
                .row(x)
                .apply(&p);
            assert!((mean - (1.0 + x * x + 0.1581136363 * rho * rho)).abs() < 1e-10);
            let mirrored: Vec<f64> = s.iter().rev().map(|y| 2.0 - y).collect();
            let q: Vec<f64> = p.iter().rev().copied().collect();
            let other = averaging(rho, Kernel::Bump, mirrored, false, true)
                .row(2.0 - x)
                .apply(&q);
            assert!((mean - other).abs() < 1e-10);
        }
        let cut = averaging(rho, Kernel::Bump, s.clone(), false, false)
            .row(0.0)
            .apply(&vec![1.0; s.len()]);
        assert!(
            (cut - 0.5).abs() < 1e-10,
            "without a mirror S is halved at the end"
        );
    }

    #[test]
    fn between_two_mirrors_a_constant_stays_one_for_any_radius() {
        for rho in [0.1, 1.0, 3.7, 25.0] {
            let s = even(5, 1.0);
            for x in [0.0, 0.37, 1.0] {
                let row = averaging(rho, Kernel::Bump, s.clone(), true, true).row(x);
                assert!(
                    (row.apply(&vec![1.0; s.len()]) - 1.0).abs() < 1e-10,
                    "ρ = {rho}"
                );
            }
        }
    }

    #[test]
    fn radius_zero_interpolates() {
        let s = even(4, 1.0);
        let p: Vec<f64> = s.iter().map(|y| y * y).collect();
        let mean = averaging(0.0, Kernel::Bump, s, false, false)
            .row(0.33)
            .apply(&p);
        assert!((mean - 0.33 * 0.33).abs() < 1e-15);
    }

    /// On a flat surface the surface kernel averages p(r) over a disc: ∫ω = 1 and the second moment
    /// follow from the bump itself; S(r²) = r² + m ρ², m = ∫ω |x|² dA / ρ².
    #[test]
    fn the_surface_kernel_averages_over_discs() {
        let rule = gauss::rule(60);
        let moment = |k: i32| -> f64 {
            let f = |x: f64| (-1.0 / (1.0 - x * x)).exp() * x.powi(k + 1);
            rule.iter()
                .map(|(xi, w)| std::f64::consts::PI * w * f(0.5 * (1.0 + xi)))
                .sum()
        };
        let m = moment(2) / moment(0);
        let rho = 0.3;
        let s = with_midsides(&[0.0, 0.1, 0.25, 0.6, 1.1, 1.7, 2.5]);
        let surface = Average {
            measure: Measure::Surface,
            ..average(rho)
        };
        let chain = Chain {
            positions: flat(&s),
            ..Chain::plain(s.clone())
        };
        let averaging = Averaging::new(&surface, chain);
        let p: Vec<f64> = s.iter().map(|r| r * r).collect();
        for r in [0.0, 0.02, 0.2, 0.31, 1.3, 2.1] {
            let row = averaging.row(r);
            let one = row.apply(&vec![1.0; s.len()]);
            assert!((one - 1.0).abs() < 1e-8, "r = {r}: S(1) = {one}");
            let second = row.apply(&p);
            assert!((second - r * r - m * rho * rho).abs() < 1e-8, "r = {r}");
        }
        // far from the axis it differs from the line kernel by O(ρ²/r)
        let line = averaging_of_line(rho, &s).row(2.1).apply(&p);
        let difference = averaging.row(2.1).apply(&p) - line;
        assert!(difference.abs() > 1e-4 && difference.abs() < rho * rho);
    }

    /// Rows over rings have the weights of an integral by many points in both directions, on edges shorter and longer
    /// than ρ, and near the axis.
    #[test]
    fn rows_over_rings_are_integrals_over_the_surface() {
        let rule = gauss::rule(40);
        let corners: [&[f64]; 3] = [
            &[0.0, 0.1, 0.25, 0.6, 1.1, 1.7, 2.5],
            &[2.0, 2.04, 2.1, 2.17, 2.25, 2.3, 2.38, 2.45, 2.5, 2.7],
            &[1.0, 3.0, 3.5],
        ];
        for (kernel, corners) in [Kernel::Bump, Kernel::Bump, Kernel::Parabola]
            .into_iter()
            .zip(corners)
        {
            let s = with_midsides(corners);
            for rho in [0.11, 0.3, 0.7] {
                let average = Average {
                    kernel,
                    measure: Measure::Surface,
                    ..average(rho)
                };
                let chain = Chain {
                    positions: flat(&s),
                    ..Chain::plain(s.clone())
                };
                let averaging = Averaging::new(&average, chain);
                for place in [0.02, 0.3, 0.52, 0.97] {
                    let at = s[0] + place * (s[s.len() - 1] - s[0]);
                    let ring = |y: f64| {
                        let rest = rho * rho - (y - at) * (y - at);
                        let half_sine = (rest / (4.0 * at * y)).sqrt().min(1.0);
                        let most = 2.0 * half_sine.asin();
                        let quarters = (0..4).flat_map(|k| {
                            rule.iter().map(move |(xi, w)| {
                                (0.25 * (f64::from(k) + 0.5 + 0.5 * xi), 0.125 * w)
                            })
                        });
                        quarters
                            .map(|(part, w)| {
                                let sine = (0.5 * part * most).sin();
                                let squared = (y - at) * (y - at) + 4.0 * at * y * sine * sine;
                                2.0 * y * w * most * averaging.omega(squared.sqrt())
                            })
                            .sum::<f64>()
                    };
                    let mut exact = vec![0.0; s.len()];
                    for edge in 0..corners.len() - 1 {
                        let arc = [s[2 * edge], s[2 * edge + 2], s[2 * edge + 1]];
                        let (from, to) = (arc[0].max(at - rho), arc[1].min(at + rho));
                        for piece in 0..32 {
                            let length = (to - from) / 32.0;
                            for (xi, w) in rule.iter().filter(|_| length > 0.0) {
                                let y = from + length * (f64::from(piece) + 0.5 + 0.5 * xi);
                                let h = edge3::shape(edge3::invert(&arc, y));
                                let factor = 0.5 * length * w * ring(y);
                                for (node, h) in
                                    [2 * edge, 2 * edge + 2, 2 * edge + 1].into_iter().zip(h)
                                {
                                    exact[node] += factor * h;
                                }
                            }
                        }
                    }
                    let row = averaging.row(at);
                    let size: f64 = exact.iter().map(|w| w.abs()).sum();
                    for (node, exact) in exact.iter().enumerate() {
                        let found = node
                            .checked_sub(row.first)
                            .and_then(|i| row.weights.get(i))
                            .unwrap_or(&0.0);
                        // what forty points leave of a kernel under one long edge; of the parabola's rings, whose size begins
                        // like the power 3/2 of the distance
                        let left = if kernel == Kernel::Bump { 2e-11 } else { 1e-8 };
                        assert!(
                            (found - exact).abs() <= left * size,
                            "{kernel:?} {rho} {at} {node}: {found} {exact}"
                        );
                    }
                }
            }
        }
    }

    /// The positions of rings in a plane.
    fn flat(s: &[f64]) -> Vec<[f64; 2]> {
        s.iter().map(|r| [*r, 0.0]).collect()
    }

    fn over_rings(rho: f64, s: &[f64], positions: Vec<[f64; 2]>, mirrors: [bool; 2]) -> Averaging {
        let average = Average {
            measure: Measure::Surface,
            ..average(rho)
        };
        let chain = Chain {
            s: s.to_vec(),
            positions,
            mirror_start: mirrors[0],
            mirror_end: mirrors[1],
        };
        Averaging::new(&average, chain)
    }

    #[test]
    fn an_even_pressure_over_rings_stays_beside_mirrors() {
        let ring = with_midsides(&[3.0, 3.1, 3.25, 3.6, 4.0]);
        let disc = with_midsides(&[0.0, 0.1, 0.4, 1.0]);
        // ρ beyond the contact too; up to the first or last mirror that is missing
        for (s, mirrors, rho, places) in [
            (&ring, [true, false], 0.4, [3.0, 3.02, 3.5]),
            (&ring, [false, true], 0.4, [3.5, 3.9, 4.0]),
            (&ring, [true, true], 0.7, [3.0, 3.3, 4.0]),
            (&ring, [true, true], 2.5, [3.0, 3.3, 4.0]),
            (&disc, [true, false], 0.4, [0.0, 0.1, 0.6]),
            (&disc, [true, true], 0.4, [0.0, 0.7, 1.0]),
            (&disc, [true, true], 3.3, [0.0, 0.7, 1.0]),
        ] {
            let averaging = over_rings(rho, s, flat(s), mirrors);
            for at in places {
                let one = averaging.row(at).apply(&vec![1.0; s.len()]);
                assert!((one - 1.0).abs() < 1e-8, "{mirrors:?} {rho} {at}: {one}");
            }
        }
    }

    /// Rings of the outside of a barrel r = 3 − z²/4 that is cut where it is widest and mirrored are those of the whole
    /// barrel.
    #[test]
    fn rings_beyond_a_mirror_are_those_of_the_whole() {
        let [half, whole] = [0.0, -1.0].map(|low| {
            let edges = (8.0 * (1.0 - low)) as usize;
            let s: Vec<f64> = (0..=2 * edges).map(|k| low + k as f64 / 16.0).collect();
            let positions = s.iter().map(|z| [3.0 - 0.25 * z * z, *z]).collect();
            let averaging = over_rings(0.3, &s, positions, [low == 0.0, false]);
            let p: Vec<f64> = s.iter().map(|z| 1.0 + z * z).collect();
            [0.0, 0.1, 0.2].map(|at| averaging.row(at).apply(&p))
        });
        for (half, whole) in half.iter().zip(whole) {
            assert!((half - whole).abs() < 1e-10, "{half} {whole}");
        }
    }

    fn averaging_of_line(radius: f64, s: &[f64]) -> Averaging {
        averaging(radius, Kernel::Bump, s.to_vec(), false, false)
    }
}
