//! Curves in the plane as obstacles: where a normal of the body meets them.

use super::{Profile, ROUNDING};
use crate::problem::Interpolation;
use crate::spline::Spline;

/// A curve that an obstacle follows.
pub(super) enum Curve<'a> {
    /// A polyline, with its segments in blocks.
    Segments(&'a [[f64; 2]], Vec<Block>),
    /// A smooth line: the Bézier points of its cubic pieces, and the pieces in blocks.
    Smooth(Vec<Bezier>, Vec<Block>),
    /// A straight line through two points, without ends.
    Line([f64; 2], [f64; 2]),
}

/// The four Bézier points of a cubic: its two ends, and two points between them at which the tangents in the ends
/// point.
type Bezier = [[f64; 2]; 4];

/// Consecutive pieces of a curve, and a disc that contains them.
pub(super) struct Block {
    pieces: std::ops::Range<usize>,
    center: [f64; 2],
    radius: f64,
}

/// The number of pieces in a block.
const BLOCK: usize = 32;

/// A side of a curve, seen in the direction of the curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Side {
    Left,
    Right,
}

/// The place of a curve that a normal of the body faces.
pub(super) struct Hit {
    pub(super) profile: Profile,
    /// The first and the last of the pieces that meet at the place.
    pub(super) pieces: [usize; 2],
}

/// A place where the straight line through a normal of the body crosses a curve.
pub(super) struct Crossing {
    /// The profile at the crossing; its distance is negative if the crossing is behind the surface.
    profile: Profile,
    piece: usize,
    /// The side of the curve that is entered at the crossing in the direction of the normal.
    entered: Side,
}

/// A normal of the body: its foot `place`, the outward unit normal n, and the tangent t.
pub(super) struct Ray {
    pub(super) place: [f64; 2],
    pub(super) n: [f64; 2],
    pub(super) t: [f64; 2],
}

impl<'a> Curve<'a> {
    /// The curve through `points`, of which no two consecutive ones are equal.
    pub(super) fn through(points: &'a [[f64; 2]], interpolation: Interpolation) -> Self {
        match interpolation {
            Interpolation::Linear => {
                let ends = |k: usize| vec![points[k], points[k + 1]];
                Curve::Segments(points, blocks(points.len() - 1, ends))
            }
            Interpolation::Cubic => {
                let cubics = spline(points);
                let blocks = blocks(cubics.len(), |k| cubics[k].to_vec());
                Curve::Smooth(cubics, blocks)
            }
        }
    }

    /// The straight line through a point at an angle from x (degrees).
    pub(super) fn line(point: [f64; 2], angle: f64) -> Self {
        let (sine, cosine) = angle.to_radians().sin_cos();
        Curve::Line(point, [point[0] + cosine, point[1] + sine])
    }

    /// The two ends of the curve; `None` for a straight line or a closed curve.
    pub(super) fn ends(&self) -> Option<[[f64; 2]; 2]> {
        let [first, last] = match self {
            Curve::Segments(points, _) => [*points.first()?, *points.last()?],
            Curve::Smooth(cubics, _) => [cubics.first()?[0], cubics.last()?[3]],
            Curve::Line(..) => return None,
        };
        (first != last).then_some([first, last])
    }

    /// Where the straight line through a normal of the body crosses the curve.
    pub(super) fn crossings(&self, ray: &Ray, rounding: f64) -> Vec<Crossing> {
        let mut found: Vec<Crossing> = Vec::new();
        match self {
            Curve::Segments(points, blocks) => {
                for k in near(blocks, ray, rounding) {
                    let (start, end) = (points[k], points[k + 1]);
                    found.extend(on_segment(ray, start, end, [0.0, 1.0], k, rounding));
                }
            }
            Curve::Line(start, end) => {
                let endless = [f64::NEG_INFINITY, f64::INFINITY];
                found.extend(on_segment(ray, *start, *end, endless, 0, rounding));
            }
            Curve::Smooth(cubics, blocks) => {
                for k in near(blocks, ray, rounding) {
                    on_cubic(ray, &cubics[k], k, rounding, &mut found);
                }
            }
        }
        found
    }

    /// The place of the curve that a normal of the body faces, if the obstacle is rigid on the side `rigid` of the
    /// curve.
    ///
    /// A place ahead of the surface is faced. A place behind it is faced only if the surface there lies inside the
    /// obstacle: the normal enters the rigid side at that place and does not leave it before the surface. Where the
    /// normal leaves the rigid side, the curve faces another side of the body.
    pub(super) fn faced_by(&self, ray: &Ray, rigid: Side, rounding: f64) -> Option<Hit> {
        let mut crossings = self.crossings(ray, rounding);
        let [ahead, behind] = nearest(&crossings, rounding);
        let behind = behind.filter(|crossing| crossing.entered == rigid);
        let at = |crossing: &Crossing, distance: f64| {
            (crossing.profile.distance - distance).abs() <= rounding
        };
        let distance = match [ahead, behind].map(|one| one.map(|one| one.profile.distance)) {
            [Some(ahead), Some(behind)] => {
                let enters = |crossing: &Crossing| at(crossing, ahead) && crossing.entered == rigid;
                if ahead <= -behind && crossings.iter().any(enters) {
                    ahead
                } else {
                    behind
                }
            }
            [ahead, behind] => ahead.or(behind)?,
        };
        crossings.retain(|crossing| at(crossing, distance));
        // at the edge of an overhanging face the normal meets that too, from inside
        if crossings.iter().any(|crossing| crossing.entered == rigid) {
            crossings.retain(|crossing| crossing.entered == rigid);
        }
        // two segments meet in a kink: the mean of their slopes
        let count = crossings.len() as f64;
        let slopes = crossings.iter().map(|crossing| crossing.profile.slope);
        let slope = slopes.sum::<f64>() / count;
        let (first, last) = (crossings.first()?, crossings.last()?);
        Some(Hit {
            profile: Profile {
                slope,
                ..first.profile
            },
            pieces: [first.piece, last.piece],
        })
    }

    /// The profile at one of the crossings of a normal of the body with the curve: the crossing whose distance is
    /// nearest to `distance`.
    pub(super) fn crossing_near(&self, ray: &Ray, rounding: f64, distance: f64) -> Option<Profile> {
        let crossings = self.crossings(ray, rounding).into_iter();
        let profiles = crossings.map(|crossing| crossing.profile);
        let off = |profile: &Profile| (profile.distance - distance).abs();
        profiles.min_by(|a, b| off(a).total_cmp(&off(b)))
    }

    /// The side of the curve that is rigid, judged along one normal; `None` if the normal does not cross the curve.
    /// `reach`: how far the body extends along −n (length).
    pub(super) fn rigid_side(&self, ray: &Ray, reach: f64, rounding: f64) -> Option<Side> {
        let crossings = self.crossings(ray, rounding);
        match nearest(&crossings, rounding) {
            [None, None] => None,
            [Some(ahead), None] => Some(ahead.entered),
            [None, Some(behind)] => {
                // behind the body it faces another side of it
                let inside = behind.profile.distance >= -reach;
                Some(if inside {
                    behind.entered
                } else {
                    behind.entered.other()
                })
            }
            [Some(ahead), Some(behind)] => {
                // the surface lies inside the obstacle, or between two parts of it
                let overlap = -behind.profile.distance;
                let inside = overlap < ahead.profile.distance && overlap <= 0.5 * reach;
                Some(if inside {
                    behind.entered
                } else {
                    ahead.entered
                })
            }
        }
    }

    /// The point between pieces `k − 1` and `k` of a curve, and the change of the profile's slope at this point, seen
    /// along the normal `n`.
    pub(super) fn joint(&self, k: usize, n: [f64; 2], t: [f64; 2]) -> ([f64; 2], f64) {
        match self {
            Curve::Segments(points, _) => {
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
            Curve::Smooth(cubics, _) => (cubics[k][0], 0.0),
            // it has no joints
            Curve::Line(start, _) => (*start, 0.0),
        }
    }
}

impl Side {
    fn other(self) -> Side {
        match self {
            Side::Left => Side::Right,
            Side::Right => Side::Left,
        }
    }

    /// The side of a curve that is entered along n. `across`: the component of the curve's direction along t.
    fn entered(across: f64) -> Side {
        if across > 0.0 {
            Side::Left
        } else {
            Side::Right
        }
    }
}

/// The nearest crossing ahead of the surface or on it, and the nearest one behind it.
fn nearest(crossings: &[Crossing], rounding: f64) -> [Option<&Crossing>; 2] {
    let size = |crossing: &&Crossing| crossing.profile.distance.abs();
    let least = |ahead: bool| {
        let own = crossings
            .iter()
            .filter(|crossing| (crossing.profile.distance >= -rounding) == ahead);
        own.min_by(|a, b| size(a).total_cmp(&size(b)))
    };
    [least(true), least(false)]
}

/// The crossing of a normal with the straight line from `start` to `end`, if the parameter along the line is in the
/// given range.
fn on_segment(
    ray: &Ray,
    start: [f64; 2],
    end: [f64; 2],
    [least, most]: [f64; 2],
    piece: usize,
    rounding: f64,
) -> Option<Crossing> {
    let Ray { place, n, t } = *ray;
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
    Some(Crossing {
        profile: Profile {
            distance: meet[0] * n[0] + meet[1] * n[1],
            slope: (direction[0] * n[0] + direction[1] * n[1]) / across,
        },
        piece,
        entered: Side::entered(across),
    })
}

/// The spline through points of the plane, parametrised by the length of the chords.
fn spline(points: &[[f64; 2]]) -> Vec<Bezier> {
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

/// Slopes of a curve up to this count as rounding: a symmetric curve is flat in its middle.
const FLAT: f64 = 1e-12;

/// Divides pieces into blocks. `points`: for a piece, points that the piece lies between.
fn blocks(count: usize, points: impl Fn(usize) -> Vec<[f64; 2]>) -> Vec<Block> {
    let block = |first: usize| {
        let pieces = first..count.min(first + BLOCK);
        let all: Vec<[f64; 2]> = pieces.clone().flat_map(&points).collect();
        let middle = |a: usize| {
            let along = all.iter().map(|point| point[a]);
            let low = along.clone().fold(f64::INFINITY, f64::min);
            0.5 * (low + along.fold(f64::NEG_INFINITY, f64::max))
        };
        let center = [middle(0), middle(1)];
        let distance = |point: &[f64; 2]| (point[0] - center[0]).hypot(point[1] - center[1]);
        let radius = all.iter().map(distance).fold(0.0, f64::max);
        Block {
            pieces,
            center,
            radius,
        }
    };
    (0..count).step_by(BLOCK).map(block).collect()
}

/// The pieces of the blocks that a normal of the body passes through.
fn near(blocks: &[Block], ray: &Ray, rounding: f64) -> impl Iterator<Item = usize> {
    let Ray { place, t, .. } = *ray;
    let passes = move |block: &&Block| {
        let [x, y] = block.center;
        let aside = dot([x - place[0], y - place[1]], t).abs();
        // what is not a number is not left out
        aside.is_nan() || aside <= block.radius * (1.0 + ROUNDING) + 2.0 * rounding
    };
    blocks
        .iter()
        .filter(passes)
        .flat_map(|block| block.pieces.clone())
}

/// The number of parts of a cubic; each crosses a normal at most once.
const PARTS: usize = 8;

/// The largest number of steps to find a crossing.
const STEPS: usize = 60;

/// Adds the crossings of a normal with one cubic of a curve.
fn on_cubic(ray: &Ray, cubic: &Bezier, k: usize, rounding: f64, found: &mut Vec<Crossing>) {
    let Ray { place, n, t } = *ray;
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
            found.push(Crossing {
                profile: Profile { distance, slope },
                piece: k,
                entered: Side::entered(across),
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
        // Newton's method, and a halving where it leaves the interval
        let mut u = 0.5 * (low + high);
        for _ in 0..STEPS {
            let [value, change] = at(beside, u);
            if (value <= 0.0) == rises {
                low = u;
            } else {
                high = u;
            }
            let newton = u - value / change;
            let next = if newton > low && newton < high {
                newton
            } else {
                0.5 * (low + high)
            };
            let settled = (next - u).abs() <= f64::EPSILON;
            u = next;
            if settled {
                break;
            }
        }
        add(u);
    }
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}
