//! The shape of an obstacle: its distance as a function of the coordinate c, or a curve in space that is met along the
//! body's normal.

use super::spline::{Spline, smoothed};
use crate::problem::{Interpolation, Obstacle};

/// Positions count as equal within this part of a length: they coincide with grid lines only up to rounding.
pub(super) const ROUNDING: f64 = 1e-9;

/// Distance and slope of an obstacle at a place on the boundary.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Profile {
    /// Distance along the body's normal (length); the indentation is not yet subtracted.
    pub distance: f64,
    /// Its change per length along t; the mean of both sides at a kink.
    pub slope: f64,
}

/// A place where an obstacle may be nearer to the body than beside it, or has a kink.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Corner {
    /// The coordinate c.
    pub(super) c: f64,
    /// The change of the profile's slope there, along growing c; positive where the obstacle points at the body.
    pub(super) change: f64,
}

/// An obstacle, with its splines.
pub(super) enum Shape<'a> {
    /// A formula, or a table with straight lines.
    Of(&'a Obstacle),
    /// A smooth table.
    Smooth(Spline),
    /// A broken line in space.
    Segments(&'a [[f64; 2]]),
    /// A smooth line in space: the Bézier points of its cubics.
    Curve(Vec<Bezier>),
    /// A straight line in space through a point along a direction, without ends.
    Line([f64; 2], [f64; 2]),
}

/// The four points of a cubic: its ends, and two between that its tangents there point at.
type Bezier = [[f64; 2]; 4];

/// Where a normal meets a curve in space.
pub(super) struct Hit {
    pub(super) profile: Profile,
    /// The first and the last of the pieces that meet there.
    pub(super) pieces: [usize; 2],
}

/// A normal of the body: its foot n, t, and how far the body reaches along −n.
pub(super) struct Ray {
    pub(super) place: [f64; 2],
    pub(super) n: [f64; 2],
    pub(super) t: [f64; 2],
    pub(super) depth: f64,
}

impl<'a> Shape<'a> {
    pub(super) fn new(obstacle: &'a Obstacle) -> Self {
        match obstacle {
            Obstacle::Table {
                x,
                gap,
                interpolation: Interpolation::Cubic,
                smoothing,
                ..
            } => {
                let gap = match smoothing {
                    Some(smoothing) => smoothed(x, gap, smoothing.standard_deviation),
                    None => gap.clone(),
                };
                Shape::Smooth(Spline::new(x.clone(), gap))
            }
            Obstacle::Polyline {
                points,
                interpolation,
                ..
            } => match interpolation {
                Interpolation::Linear => Shape::Segments(points),
                Interpolation::Cubic => Shape::Curve(curve(points)),
            },
            Obstacle::Line { point, angle, .. } => {
                let (sine, cosine) = angle.to_radians().sin_cos();
                Shape::Line(*point, [point[0] + cosine, point[1] + sine])
            }
            other => Shape::Of(other),
        }
    }

    /// A curve in space, which has no coordinate c.
    pub(super) fn in_space(&self) -> bool {
        !matches!(self, Shape::Of(_) | Shape::Smooth(_))
    }

    /// The ends of the obstacle in the coordinate c. A circle has none: contact does not come near to where it stands
    /// upright.
    pub(super) fn ends(&self) -> [f64; 2] {
        match self {
            Shape::Of(Obstacle::Table { x, .. }) => [x[0], x[x.len() - 1]],
            Shape::Of(Obstacle::RoundedFlat {
                half_width,
                radius,
                center,
                ..
            }) => {
                let half = half_width + radius;
                [center - half, center + half]
            }
            Shape::Smooth(spline) => [spline.ends(0)[0], spline.ends(spline.pieces() - 1)[1]],
            _ => [f64::NEG_INFINITY, f64::INFINITY],
        }
    }

    /// The places between which the profile is smooth, or has no extremum, in order of c.
    pub(super) fn corners(&self) -> Vec<Corner> {
        let smooth = |c: f64| Corner { c, change: 0.0 };
        match *self {
            Shape::Of(Obstacle::Table { x, gap, .. }) => {
                let slope = |k: usize| (gap[k + 1] - gap[k]) / (x[k + 1] - x[k]);
                let inside = (1..x.len() - 1).map(|k| Corner {
                    c: x[k],
                    change: slope(k) - slope(k - 1),
                });
                inside.collect()
            }
            Shape::Of(Obstacle::Wedge { angle, center, .. })
            | Shape::Of(Obstacle::Cone { angle, center, .. }) => vec![Corner {
                c: *center,
                change: 2.0 * angle.to_radians().tan(),
            }],
            Shape::Of(Obstacle::Power {
                coefficient,
                exponent,
                center,
                ..
            }) => vec![Corner {
                c: *center,
                change: if *exponent == 1.0 {
                    2.0 * coefficient
                } else {
                    0.0
                },
            }],
            Shape::Of(Obstacle::Circle { center, .. } | Obstacle::Parabola { center, .. }) => {
                vec![smooth(*center)]
            }
            Shape::Of(Obstacle::RoundedFlat {
                half_width, center, ..
            }) => vec![
                smooth(center - half_width),
                smooth(*center),
                smooth(center + half_width),
            ],
            Shape::Smooth(ref spline) => {
                let inside = 1..spline.pieces();
                inside.map(|k| smooth(spline.ends(k)[0])).collect()
            }
            _ => Vec::new(),
        }
    }

    /// Distance before the obstacle is pushed, and its change with c, at coordinate c; `None` where there is no
    /// obstacle, and for curves in space.
    pub(super) fn at(&self, c: f64, rounding: f64) -> Option<(f64, f64)> {
        match self {
            Shape::Of(obstacle) => formula(obstacle, c, rounding),
            Shape::Smooth(spline) => {
                let [first, last] = self.ends();
                let within = c >= first - rounding && c <= last + rounding;
                within.then(|| spline.at(c).into())
            }
            _ => None,
        }
    }

    /// Where a normal of the body meets a curve in space.
    pub(super) fn met_by(&self, ray: &Ray, rounding: f64) -> Option<Hit> {
        let mut hits: Vec<Hit> = Vec::new();
        match self {
            Shape::Of(_) | Shape::Smooth(_) => {}
            Shape::Segments(points) => {
                for (k, pair) in points.windows(2).enumerate() {
                    hits.extend(on_segment(ray, pair[0], pair[1], [0.0, 1.0], k, rounding));
                }
            }
            Shape::Line(start, end) => {
                let endless = [f64::NEG_INFINITY, f64::INFINITY];
                hits.extend(on_segment(ray, *start, *end, endless, 0, rounding));
            }
            Shape::Curve(cubics) => {
                for (k, cubic) in cubics.iter().enumerate() {
                    on_cubic(ray, cubic, k, rounding, &mut hits);
                }
            }
        }
        // an obstacle behind the body faces its other side
        hits.retain(|hit| hit.profile.distance >= -ray.depth);
        let nearest = hits
            .iter()
            .map(|hit| hit.profile.distance.abs())
            .fold(f64::INFINITY, f64::min);
        // two segments meet in a kink: the mean of their slopes
        hits.retain(|hit| hit.profile.distance.abs() <= nearest + rounding);
        let count = hits.len() as f64;
        let slope = hits.iter().map(|hit| hit.profile.slope).sum::<f64>() / count;
        let (first, last) = (hits.first()?, hits.last()?);
        Some(Hit {
            profile: Profile {
                slope,
                ..first.profile
            },
            pieces: [first.pieces[0], last.pieces[0]],
        })
    }

    /// The point between piece `k − 1` and piece `k` of a curve in space, and the change of the profile's slope there,
    /// seen along the normal `n`.
    pub(super) fn joint(&self, k: usize, n: [f64; 2], t: [f64; 2]) -> ([f64; 2], f64) {
        match self {
            Shape::Segments(points) => {
                let side = |k: usize| {
                    let direction = [0, 1].map(|a| points[k + 1][a] - points[k][a]);
                    (dot(direction, n), dot(direction, t))
                };
                let ((rise, along), (next_rise, next_along)) = (side(k - 1), side(k));
                let upright = |rise: f64, along: f64| along.abs() <= ROUNDING * rise.abs();
                let change = match (upright(rise, along), upright(next_rise, next_along)) {
                    // the edge of a face that overhangs
                    (false, false) if along * next_along < 0.0 => f64::INFINITY,
                    (false, false) => (next_rise / next_along - rise / along) * along.signum(),
                    (false, true) => next_rise * f64::INFINITY,
                    (true, false) => -rise * f64::INFINITY,
                    (true, true) => 0.0,
                };
                (points[k], change)
            }
            Shape::Curve(cubics) => (cubics[k][0], 0.0),
            Shape::Of(_) | Shape::Smooth(_) | Shape::Line(..) => ([f64::NAN; 2], 0.0),
        }
    }
}

fn formula(obstacle: &Obstacle, c: f64, rounding: f64) -> Option<(f64, f64)> {
    // a circle of radius R that leaves the surface at x = 0
    let round = |radius: f64, x: f64| {
        let root = (radius * radius - x * x).max(0.0).sqrt();
        let slope = x / root.max(ROUNDING * radius);
        (x.abs() <= radius + rounding).then_some((radius - root, slope))
    };
    // 0 at 0: the mean of both sides
    let sign = |x: f64| if x == 0.0 { 0.0 } else { x.signum() };
    match *obstacle {
        Obstacle::Flat { .. } => Some((0.0, 0.0)),
        Obstacle::Circle { radius, center, .. } => round(radius, c - center),
        Obstacle::Parabola { radius, center, .. } => {
            let x = c - center;
            Some((x * x / (2.0 * radius), x / radius))
        }
        Obstacle::Wedge { angle, center, .. } | Obstacle::Cone { angle, center, .. } => {
            let (x, tangent) = (c - center, angle.to_radians().tan());
            Some((x.abs() * tangent, sign(x) * tangent))
        }
        Obstacle::Tilted { slope, center, .. } => Some((slope * (c - center), slope)),
        Obstacle::Power {
            coefficient,
            exponent,
            center,
            ..
        } => {
            let x = c - center;
            let slope = coefficient * exponent * x.abs().powf(exponent - 1.0) * sign(x);
            Some((coefficient * x.abs().powf(exponent), slope))
        }
        Obstacle::RoundedFlat {
            half_width,
            radius,
            center,
            ..
        } => {
            let x = c - center;
            let beyond = (x.abs() - half_width).max(0.0);
            round(radius, beyond).map(|(distance, slope)| (distance, sign(x) * slope))
        }
        Obstacle::Table { ref x, ref gap, .. } => tabulated(x, gap, c, rounding),
        // curves in space are met along the normal instead
        Obstacle::Polyline { .. } | Obstacle::Line { .. } => None,
    }
}

/// Linear between the points of a table; at a point the mean of both slopes.
fn tabulated(x: &[f64], y: &[f64], at: f64, rounding: f64) -> Option<(f64, f64)> {
    let last = x.len() - 1;
    if at < x[0] - rounding || at > x[last] + rounding {
        return None;
    }
    let slope = |k: usize| (y[k + 1] - y[k]) / (x[k + 1] - x[k]);
    let k = (x.partition_point(|x| *x <= at).max(1) - 1).min(last - 1);
    let distance = y[k] + slope(k) * (at - x[k]);
    let mean = if k > 0 && at - x[k] <= rounding {
        0.5 * (slope(k - 1) + slope(k))
    } else {
        slope(k)
    };
    Some((distance, mean))
}

/// Where a normal meets the straight line from `start` to `end`, if the parameter between them is in its range.
fn on_segment(
    ray: &Ray,
    start: [f64; 2],
    end: [f64; 2],
    [least, most]: [f64; 2],
    piece: usize,
    rounding: f64,
) -> Option<Hit> {
    let Ray { place, n, t, .. } = *ray;
    let direction = [end[0] - start[0], end[1] - start[1]];
    let length = direction[0].hypot(direction[1]);
    let across = direction[0] * t[0] + direction[1] * t[1];
    if across.abs() <= ROUNDING * length {
        return None; // seen end on
    }
    let towards = [place[0] - start[0], place[1] - start[1]];
    let part = (towards[0] * t[0] + towards[1] * t[1]) / across;
    let slack = rounding / length;
    if part < least - slack || part > most + slack {
        return None;
    }
    let meet = [
        start[0] + part * direction[0] - place[0],
        start[1] + part * direction[1] - place[1],
    ];
    Some(Hit {
        profile: Profile {
            distance: meet[0] * n[0] + meet[1] * n[1],
            slope: (direction[0] * n[0] + direction[1] * n[1]) / across,
        },
        pieces: [piece; 2],
    })
}

/// The spline through points of a plane, by the length of the chords.
fn curve(points: &[[f64; 2]]) -> Vec<Bezier> {
    let mut length = vec![0.0];
    for pair in points.windows(2) {
        let chord = (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]);
        length.push(length[length.len() - 1] + chord);
    }
    let splines = [0, 1].map(|a| {
        Spline::new(
            length.clone(),
            points.iter().map(|point| point[a]).collect(),
        )
    });
    let cubic = |k: usize| {
        let [from, to] = splines[0].ends(k);
        let third = (to - from) / 3.0;
        let [x, y] = [&splines[0], &splines[1]].map(|spline| {
            let ([start, before], [end, after]) =
                (spline.on_piece(k, from), spline.on_piece(k, to));
            [start, start + third * before, end - third * after, end]
        });
        std::array::from_fn(|i| [x[i], y[i]])
    };
    (0..splines[0].pieces()).map(cubic).collect()
}

/// Slopes of a curve in space up to this are rounding: a symmetric one is flat in its middle.
const FLAT: f64 = 1e-12;

/// Parts of a cubic, in each of which it crosses a normal at most once.
const PARTS: usize = 8;

/// Halvings of such a part: to rounding.
const HALVINGS: usize = 50;

/// Where a normal meets one cubic of a curve.
fn on_cubic(ray: &Ray, cubic: &Bezier, k: usize, rounding: f64, hits: &mut Vec<Hit>) {
    let Ray { place, n, t, .. } = *ray;
    let part_along = |axis: [f64; 2]| cubic.map(|p| dot([p[0] - place[0], p[1] - place[1]], axis));
    // a cubic lies between its Bézier points
    let beside = part_along(t);
    if beside.iter().all(|b| *b > rounding) || beside.iter().all(|b| *b < -rounding) {
        return;
    }
    let ahead = part_along(n);
    // value and change of a component
    let at = |[a, b, c, d]: [f64; 4], u: f64| {
        let v = 1.0 - u;
        let value = v * v * (v * a + 3.0 * u * b) + u * u * (3.0 * v * c + u * d);
        let change = 3.0 * (v * v * (b - a) + 2.0 * u * v * (c - b) + u * u * (d - c));
        [value, change]
    };
    let mut add = |u: f64| {
        let ([distance, rise], [_, across]) = (at(ahead, u), at(beside, u));
        if across.abs() > ROUNDING * rise.hypot(across) {
            let slope = match rise / across {
                slope if slope.abs() <= FLAT => 0.0,
                slope => slope,
            };
            hits.push(Hit {
                profile: Profile { distance, slope },
                pieces: [k; 2],
            });
        }
    };
    // an end counts within rounding
    let at_end = [beside[0], beside[3]].map(|b| b.abs() <= rounding);
    for (u, _) in [0.0, 1.0].into_iter().zip(at_end).filter(|(_, is)| *is) {
        add(u);
    }
    let side = |u: f64| at(beside, u)[0] <= 0.0;
    for i in 0..PARTS {
        if (i == 0 && at_end[0]) || (i + 1 == PARTS && at_end[1]) {
            continue;
        }
        let [mut low, mut high] = [i, i + 1].map(|i| i as f64 / PARTS as f64);
        let rises = side(low);
        if rises == side(high) {
            continue;
        }
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if side(middle) == rises {
                low = middle;
            } else {
                high = middle;
            }
        }
        add(0.5 * (low + high));
    }
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::{Along, Smoothing};

    fn profile(obstacle: &Obstacle, c: f64, rounding: f64) -> Option<(f64, f64)> {
        Shape::new(obstacle).at(c, rounding)
    }

    #[test]
    fn every_profile_has_the_slope_of_its_distance() {
        let (from, to, along) = (None, None, Along::X);
        let kinds = [
            Obstacle::Circle {
                radius: 5.0,
                center: 0.7,
                from,
                to,
                along,
            },
            Obstacle::Wedge {
                angle: 20.0,
                center: 0.7,
                from,
                to,
                along,
            },
            Obstacle::Cone {
                angle: 5.0,
                center: -0.2,
                from,
                to,
                along,
            },
            Obstacle::Tilted {
                slope: 0.3,
                center: 0.1,
                from,
                to,
                along,
            },
            Obstacle::Power {
                coefficient: 0.4,
                exponent: 3.0,
                center: 0.6,
                from,
                to,
                along,
            },
            Obstacle::RoundedFlat {
                half_width: 0.5,
                radius: 2.0,
                center: 0.9,
                from,
                to,
                along,
            },
            Obstacle::Table {
                x: vec![0.0, 0.8, 2.0],
                gap: vec![1.0, 0.0, 3.0],
                interpolation: Interpolation::Linear,
                smoothing: None,
                from,
                to,
                along,
            },
        ];
        let measured = Obstacle::Table {
            x: vec![0.0, 0.4, 0.9, 1.2, 1.6, 2.0],
            gap: vec![1.0, 0.4, 0.1, 0.2, 0.1, 0.6],
            interpolation: Interpolation::Cubic,
            smoothing: Some(Smoothing {
                standard_deviation: 0.02,
            }),
            from,
            to,
            along,
        };
        let step = 1e-6;
        for obstacle in kinds.into_iter().chain([measured]) {
            for c in [0.05, 0.5, 1.1, 1.9] {
                let at = |c| profile(&obstacle, c, 0.0).unwrap();
                let difference = (at(c + step).0 - at(c - step).0) / (2.0 * step);
                assert!((at(c).1 - difference).abs() < 1e-8, "{obstacle:?} at {c}");
            }
        }
        let rounded = Obstacle::RoundedFlat {
            half_width: 0.5,
            radius: 2.0,
            center: 0.0,
            from,
            to,
            along,
        };
        assert_eq!(profile(&rounded, 0.4, 0.0), Some((0.0, 0.0)));
        assert_eq!(profile(&rounded, 2.6, 0.0), None);
        let wedge = Obstacle::Wedge {
            angle: 45.0,
            center: 1.0,
            from,
            to,
            along,
        };
        assert_eq!(profile(&wedge, 1.0, 0.0), Some((0.0, 0.0)));
    }

    #[test]
    fn a_table_has_ends_and_the_mean_slope_at_kinks() {
        let (x, y) = ([0.0, 1.0, 3.0], [1.0, 0.0, 4.0]);
        assert_eq!(tabulated(&x, &y, 1.0, 1e-12), Some((0.0, 0.5)));
        assert_eq!(tabulated(&x, &y, 3.0, 1e-12), Some((4.0, 2.0)));
        assert_eq!(tabulated(&x, &y, 3.1, 1e-12), None);
    }
}
