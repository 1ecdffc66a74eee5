//! The shape of a rigid surface: consecutive lines, arcs and parabolas, with the elastic body on the left.

/// A point or a direction in the plane.
pub(super) type Point = [f64; 2];

/// A part of a rigid surface, from its start to its end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Piece {
    Line([Point; 2]),
    /// An arc, the shorter way around its centre.
    Arc {
        ends: [Point; 2],
        center: Point,
    },
    /// A parabola by start, middle and end: the side of an element of second order, or a parabola of an analytical
    /// surface.
    Parabola([Point; 3]),
}

/// The largest angle (radians) between two pieces that is no corner, since coordinates in files are rounded.
const SMOOTH: f64 = 2e-3;

/// The largest angle (radians) of the parts that an arc is divided into.
const PART: f64 = 4e-3;

/// The number of parts that a parabola is divided into.
const PARTS: usize = 32;

/// The largest relative difference that counts as rounding in files.
const DIGITS: f64 = 1e-4;

/// A rigid surface in the form of an obstacle.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Outline {
    /// The points of the outline, from its start to its end.
    pub(super) points: Vec<Point>,
    /// How the points are joined.
    pub(super) joined: Joined,
}

/// How the points of an outline are joined.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Joined {
    /// By straight lines, exactly.
    Lines,
    /// By one circle, exactly. `convex`: the body is outside the circle.
    Circle {
        center: Point,
        radius: f64,
        convex: bool,
    },
    /// By a spline, which differs from the smooth curves by at most this length.
    Spline(f64),
    /// By straight lines in place of curves with corners; the lines differ from the curves by at most this length.
    Polygon(f64),
}

impl Piece {
    pub(super) fn start(&self) -> Point {
        match *self {
            Piece::Line([a, _]) | Piece::Arc { ends: [a, _], .. } | Piece::Parabola([a, ..]) => a,
        }
    }

    pub(super) fn end(&self) -> Point {
        match *self {
            Piece::Line([_, b]) | Piece::Arc { ends: [_, b], .. } | Piece::Parabola([.., b]) => b,
        }
    }

    /// The piece with all its points moved by the map `to`.
    pub(super) fn placed(self, to: impl Fn(Point) -> Point) -> Self {
        match self {
            Piece::Line(points) => Piece::Line(points.map(to)),
            Piece::Arc { ends, center } => Piece::Arc {
                ends: ends.map(&to),
                center: to(center),
            },
            Piece::Parabola(points) => Piece::Parabola(points.map(to)),
        }
    }

    /// The piece in the opposite direction.
    pub(super) fn reversed(self) -> Self {
        match self {
            Piece::Line([a, b]) => Piece::Line([b, a]),
            Piece::Arc {
                ends: [a, b],
                center,
            } => Piece::Arc {
                ends: [b, a],
                center,
            },
            Piece::Parabola([a, m, b]) => Piece::Parabola([b, m, a]),
        }
    }

    /// The side of an element of second order: a straight line if the midside node lies in the middle, else a parabola.
    pub(super) fn side([a, m, b]: [Point; 3]) -> Self {
        let off = length(minus(m, [0, 1].map(|i| 0.5 * (a[i] + b[i]))));
        if off <= 1e-9 * length(minus(b, a)) {
            Piece::Line([a, b])
        } else {
            Piece::Parabola([a, m, b])
        }
    }

    /// An arc between `ends`; none unless both are equally far from `center` and the arc is less than half a circle.
    pub(super) fn arc(ends: [Point; 2], center: Point) -> Option<Self> {
        let [from, to] = ends.map(|end| minus(end, center));
        let (r, s) = (length(from), length(to));
        let half = dot(from, to) <= -r * s * (1.0 - 1e-6);
        (r > 0.0 && (r - s).abs() <= DIGITS * r && !half && from != to)
            .then_some(Piece::Arc { ends, center })
    }

    /// The angle of an arc from its start to its end (radians, counter-clockwise positive).
    fn angle([a, b]: [Point; 2], center: Point) -> f64 {
        let (from, to) = (minus(a, center), minus(b, center));
        cross(from, to).atan2(dot(from, to))
    }

    /// The unit tangents at start and end.
    fn tangents(&self) -> [Point; 2] {
        let along = match *self {
            Piece::Line([a, b]) => [minus(b, a); 2],
            Piece::Arc { ends, center } => {
                let sign = Piece::angle(ends, center).signum();
                ends.map(|end| {
                    let [x, y] = minus(end, center);
                    [-sign * y, sign * x]
                })
            }
            Piece::Parabola([a, m, b]) => [
                [0, 1].map(|i| 4.0 * m[i] - 3.0 * a[i] - b[i]),
                [0, 1].map(|i| 3.0 * b[i] + a[i] - 4.0 * m[i]),
            ],
        };
        along.map(|t| {
            let size = length(t);
            t.map(|x| x / size)
        })
    }

    /// Points along the piece, without its end, and the largest distance (length) between the piece and straight lines
    /// through the points. `finest`: the distance of points at the ends of a straight line, which grows towards its
    /// middle; `None`: only its start.
    fn points(&self, finest: Option<f64>) -> (Vec<Point>, f64) {
        match *self {
            Piece::Line([a, b]) => {
                let whole = length(minus(b, a));
                let mut at = vec![0.0];
                let mut step = finest.unwrap_or(whole) / whole;
                let mut next = step;
                while next < 0.5 && at.len() < 200 {
                    at.push(next);
                    step *= 2.0;
                    next += step;
                }
                let mirrored: Vec<f64> = at.iter().skip(1).rev().map(|u| 1.0 - u).collect();
                at.extend(mirrored);
                let place = |u: f64| [0, 1].map(|i| a[i] + u * (b[i] - a[i]));
                (at.into_iter().map(place).collect(), 0.0)
            }
            Piece::Arc { ends, center } => {
                let (angle, from) = (Piece::angle(ends, center), minus(ends[0], center));
                let parts = (angle.abs() / PART).ceil().max(1.0);
                let part = angle / parts;
                let place = |k: usize| {
                    let (sine, cosine) = (part * k as f64).sin_cos();
                    [
                        center[0] + cosine * from[0] - sine * from[1],
                        center[1] + sine * from[0] + cosine * from[1],
                    ]
                };
                let off = length(from) * (1.0 - (0.5 * part).cos());
                ((0..parts as usize).map(place).collect(), off)
            }
            Piece::Parabola([a, m, b]) => {
                let place = |k: usize| {
                    let u = k as f64 / PARTS as f64;
                    [0, 1].map(|i| {
                        (1.0 - u) * (1.0 - 2.0 * u) * a[i]
                            + 4.0 * u * (1.0 - u) * m[i]
                            + u * (2.0 * u - 1.0) * b[i]
                    })
                };
                let bulge = length([0, 1].map(|i| m[i] - 0.5 * (a[i] + b[i])));
                let off = bulge / (PARTS * PARTS) as f64;
                ((0..PARTS).map(place).collect(), off)
            }
        }
    }
}

/// Sorts pieces so that each begins where the previous one ends. `None` if they do not form one chain, or there are
/// none.
pub(super) fn chain(pieces: &[Piece]) -> Option<Vec<Piece>> {
    let key = |[x, y]: Point| [(x + 0.0).to_bits(), (y + 0.0).to_bits()];
    let mut starts = std::collections::BTreeMap::new();
    let mut ends = std::collections::BTreeSet::new();
    for (k, piece) in pieces.iter().enumerate() {
        if starts.insert(key(piece.start()), k).is_some() || !ends.insert(key(piece.end())) {
            return None;
        }
    }
    let mut heads = pieces.iter().filter(|p| !ends.contains(&key(p.start())));
    // a closed loop begins with its first piece
    let mut next = heads.next().or(pieces.first()).copied();
    if heads.next().is_some() {
        return None;
    }
    let mut sorted = Vec::with_capacity(pieces.len());
    while let Some(piece) = next {
        sorted.push(piece);
        let follower = starts.remove(&key(piece.end()));
        next = follower
            .map(|k| pieces[k])
            .filter(|_| sorted.len() < pieces.len());
    }
    (!sorted.is_empty() && sorted.len() == pieces.len()).then_some(sorted)
}

/// The outline of consecutive pieces.
pub(super) fn outline(pieces: &[Piece]) -> Outline {
    let last = pieces.last().map(Piece::end);
    if pieces.iter().all(|piece| matches!(piece, Piece::Line(_))) {
        let points = pieces.iter().map(Piece::start).chain(last).collect();
        let joined = Joined::Lines;
        return Outline { points, joined };
    }
    let corner = |pair: &[Piece]| {
        let ([_, before], [after, _]) = (pair[0].tangents(), pair[1].tangents());
        cross(before, after).atan2(dot(before, after)).abs() > SMOOTH
    };
    let smooth = !pieces.windows(2).any(corner);
    // the parts of curves beside a line
    let spacing = |piece: &Piece| match *piece {
        Piece::Line(_) => None,
        Piece::Arc { ends, center } => Some(PART * length(minus(ends[0], center))),
        Piece::Parabola([a, _, b]) => Some(length(minus(b, a)) / PARTS as f64),
    };
    let finest = pieces
        .iter()
        .filter_map(spacing)
        .fold(f64::INFINITY, f64::min);
    let (mut points, mut most) = (Vec::new(), 0.0f64);
    for piece in pieces {
        let (found, off) = piece.points(Some(finest).filter(|_| smooth));
        points.extend(found);
        most = most.max(off);
    }
    points.extend(last);
    let joined = match circle(pieces) {
        Some((center, radius, convex)) => Joined::Circle {
            center,
            radius,
            convex,
        },
        None if smooth => Joined::Spline(most),
        None => Joined::Polygon(most),
    };
    Outline { points, joined }
}

/// The circle that all pieces are arcs of, in one direction: its centre, its radius, and whether the body, on the left
/// of the pieces, is outside the circle. `None` if there is none.
fn circle(pieces: &[Piece]) -> Option<(Point, f64, bool)> {
    /// The relative difference of radii up to which arcs belong to one circle.
    const SAME: f64 = 1e-6;
    let arc = |piece: &Piece| match *piece {
        Piece::Arc { ends, center } => Some((
            center,
            length(minus(ends[0], center)),
            Piece::angle(ends, center) > 0.0,
        )),
        _ => None,
    };
    let (center, radius, turns) = arc(pieces.first()?)?;
    let same = |piece: &Piece| {
        arc(piece).is_some_and(|(c, r, t)| {
            length(minus(c, center)) <= SAME * radius
                && (r - radius).abs() <= SAME * radius
                && t == turns
        })
    };
    pieces.iter().all(same).then_some((center, radius, !turns))
}

/// The intersection, nearest to `place`, of the normal `n` at a place of the body with a rigid surface through
/// `points`, at most the distance `behind` behind the place. Returns the distance along n, and the surface's own unit
/// normal there, which points to the left of the surface's direction.
pub(super) fn met(points: &[Point], place: Point, n: Point, behind: f64) -> Option<(f64, Point)> {
    let t = [n[1], -n[0]];
    let hit = |pair: &[Point]| {
        let [a, b] = [0, 1].map(|k| dot(minus(pair[k], place), t));
        if a == b || a.min(b) > 0.0 || a.max(b) < 0.0 {
            return None;
        }
        let u = a / (a - b);
        let step = minus(pair[1], pair[0]);
        let meet = [0, 1].map(|i| pair[0][i] + u * step[i]);
        let size = length(step);
        let distance = dot(minus(meet, place), n);
        (distance >= -behind).then_some((distance, [-step[1] / size, step[0] / size]))
    };
    let hits = points.windows(2).filter_map(hit);
    hits.min_by(|a, b| a.0.abs().total_cmp(&b.0.abs()))
}

pub(super) fn minus(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1]]
}

pub(super) fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

pub(super) fn cross(a: Point, b: Point) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

pub(super) fn length(a: Point) -> f64 {
    a[0].hypot(a[1])
}
