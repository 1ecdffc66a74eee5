//! The shape of an obstacle: its distance as a function of the coordinate c, or a curve; and what follows from the shape
//! alone.

use super::curve::Curve;
use crate::problem::{Interpolation, Obstacle};
use crate::spline::{Spline, smoothed};

/// The end of a circle, where its flank is almost vertical: below its centre by this fraction of its radius.
const FLANK: f64 = 1e-3;

/// The properties that follow from the shape of an obstacle, wherever it is.
impl Obstacle {
    /// The exponent of the profile, if it is a power of the distance from its center.
    pub(crate) fn power(&self) -> Option<f64> {
        match self {
            Obstacle::Circle { .. } | Obstacle::Parabola { .. } => Some(2.0),
            Obstacle::Wedge { .. } | Obstacle::Cone { .. } => Some(1.0),
            Obstacle::Power { exponent, .. } => Some(*exponent),
            Obstacle::Flat { .. }
            | Obstacle::Tilted { .. }
            | Obstacle::RoundedFlat { .. }
            | Obstacle::Table { .. }
            | Obstacle::Polyline { .. }
            | Obstacle::Line { .. } => None,
        }
    }

    /// Whether sliding along itself leaves the obstacle unchanged.
    pub(crate) fn is_straight(&self) -> bool {
        matches!(self, Obstacle::Flat { .. } | Obstacle::Line { .. })
    }

    /// Whether the obstacle is a curve in the plane, which has no coordinate c.
    pub(crate) fn is_in_space(&self) -> bool {
        matches!(self, Obstacle::Line { .. } | Obstacle::Polyline { .. })
    }

    /// Whether the obstacle is made of several straight pieces.
    pub(crate) fn has_kinks(&self) -> bool {
        match self {
            Obstacle::Table {
                x, interpolation, ..
            } => x.len() > 2 && *interpolation == Interpolation::Linear,
            Obstacle::Polyline {
                points,
                interpolation,
                ..
            } => points.len() > 2 && *interpolation == Interpolation::Linear,
            _ => false,
        }
    }

    /// Whether the obstacle ends in flanks, at which no node is put as at other ends.
    pub(super) fn ends_in_flanks(&self) -> bool {
        matches!(self, Obstacle::RoundedFlat { .. })
    }
}

/// A place where the obstacle has a kink, or may be nearer to the body than on both sides of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Corner {
    /// The coordinate c of the place.
    pub(super) c: f64,
    /// The change of the profile's slope at the place, along growing c; positive where the obstacle points at the body.
    pub(super) change: f64,
}

/// An obstacle, with its splines.
pub(super) enum Shape<'a> {
    /// A formula, or a table interpolated by straight lines.
    Of(&'a Obstacle),
    /// A table interpolated by a spline.
    Smooth(Spline),
    /// A curve, which has no coordinate c.
    InSpace(Curve<'a>),
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
            } => Shape::InSpace(Curve::through(points, *interpolation)),
            Obstacle::Line { point, angle, .. } => Shape::InSpace(Curve::line(*point, *angle)),
            other => Shape::Of(other),
        }
    }

    /// The curve, if the shape is a curve.
    pub(super) fn in_space(&self) -> Option<&Curve<'a>> {
        match self {
            Shape::InSpace(curve) => Some(curve),
            Shape::Of(_) | Shape::Smooth(_) => None,
        }
    }

    /// The range of the coordinate c that the obstacle covers. A circle has no ends: contact never comes near its
    /// vertical flank.
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

    /// The places where the profile is not smooth, or may be nearer to the body than on both sides, in order of c.
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

    /// The obstacle's distance before it is pushed, and the derivative of the distance by c, at coordinate c. `None`
    /// where there is no obstacle, and for curves.
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
}

/// The distance and its derivative by c, where the profile is a formula or a table with straight lines.
fn formula(obstacle: &Obstacle, c: f64, rounding: f64) -> Option<(f64, f64)> {
    // a circle of radius R that leaves the surface at x = 0
    let round = |radius: f64, x: f64| {
        let root = (radius * radius - x * x).max(0.0).sqrt();
        // at its flank, where its side is vertical, no point is below it: there it faces the body as if it were level
        let slope = if root <= FLANK * radius {
            0.0
        } else {
            x / root
        };
        (x.abs() <= radius + rounding).then_some((radius - root, slope))
    };
    // 0 at 0: the mean of both sides. A node lies at a kink only up to rounding.
    let sign = |x: f64| if x.abs() <= rounding { 0.0 } else { x.signum() };
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

/// The value at `at`, linear between the points of a table, and its slope; at a point the mean of both slopes.
fn tabulated(x: &[f64], y: &[f64], at: f64, rounding: f64) -> Option<(f64, f64)> {
    let last = x.len() - 1;
    if at < x[0] - rounding || at > x[last] + rounding {
        return None;
    }
    let slope = |k: usize| (y[k + 1] - y[k]) / (x[k + 1] - x[k]);
    let k = (x.partition_point(|x| *x <= at + rounding).max(1) - 1).min(last - 1);
    let distance = y[k] + slope(k) * (at - x[k]);
    let mean = if k > 0 && at - x[k] <= rounding {
        0.5 * (slope(k - 1) + slope(k))
    } else {
        slope(k)
    };
    Some((distance, mean))
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
        for beside in [1.0 - 1e-15, 1.0 + 1e-15] {
            let slope = profile(&wedge, beside, 1e-12).map(|(_, slope)| slope);
            assert_eq!(slope, Some(0.0));
        }
    }

    #[test]
    fn a_table_has_ends_and_the_mean_slope_at_kinks() {
        let (x, y) = ([0.0, 1.0, 3.0], [1.0, 0.0, 4.0]);
        assert_eq!(tabulated(&x, &y, 1.0, 1e-12), Some((0.0, 0.5)));
        for beside in [1.0 - 1e-15, 1.0 + 1e-15] {
            let slope = tabulated(&x, &y, beside, 1e-12).map(|(_, slope)| slope);
            assert_eq!(slope, Some(0.5));
        }
        assert_eq!(tabulated(&x, &y, 3.0, 1e-12), Some((4.0, 2.0)));
        assert_eq!(tabulated(&x, &y, 3.1, 1e-12), None);
    }
}
