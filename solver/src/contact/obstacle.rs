//! Rigid obstacles: the part of a boundary that faces an obstacle, the obstacle's distance at the nodes, and its shape
//! between the nodes.

use std::ops::Range;

use super::curve::{Curve, Hit, Ray, Side};
use super::shape::{Corner, Shape};
use super::smooth::edge_normal;
use super::{ContactBoundary, HeldDirections, Profile, ROUNDING, edge_nodes, length_through};
use crate::element::edge3;
use crate::mesh::{Edge, Mesh};
use crate::problem::{Along, Obstacle};

/// The part of a boundary that faces an obstacle.
#[derive(Clone, Debug, PartialEq)]
pub struct Facing {
    /// Edges whose three nodes all face the obstacle, in connected runs.
    pub runs: Vec<FacingRun>,
    /// The ranges of the coordinate c of edges inside which the obstacle ends; these edges are left out.
    pub cut: Vec<[f64; 2]>,
    /// The edges inside which the obstacle ends, each with the length that the obstacle covers.
    pub cut_edges: Vec<(Edge, f64)>,
}

/// A chain of edges that face the obstacle, and the profile at its nodes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FacingRun {
    /// Consecutive edges.
    pub chain: Vec<Edge>,
    /// The obstacle at each node of the chain.
    pub profile: Vec<Profile>,
    /// Arc length of the first node from the start of the boundary.
    pub start: f64,
    /// The coordinate c of each node.
    pub coordinate: Vec<f64>,
    /// The obstacle between the nodes, and at the obstacle's corners.
    pub places: Vec<Place>,
}

/// A place of an edge at which the obstacle is evaluated: between the nodes, or at a corner of the obstacle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// The number of the edge in the chain.
    pub edge: usize,
    /// The place on the edge, −1 … 1.
    pub xi: f64,
    /// The body's normal at the place.
    pub normal: [f64; 2],
    /// The obstacle's distance and slope at the place.
    pub profile: Profile,
    /// The change of the obstacle's slope along t; positive at a kink that points at the body, 0 where the obstacle is
    /// smooth.
    pub kink: f64,
    /// How much nearer the obstacle is than the parabola through the profile at the edge's nodes (length); negative:
    /// farther.
    pub nearer: f64,
}

/// The places between the nodes of an edge where the obstacle is evaluated.
const BETWEEN: [f64; 6] = [-0.75, -0.5, -0.25, 0.25, 0.5, 0.75];

/// The largest part of the shortest edge that counts as rounding of coordinates.
const OF_AN_EDGE: f64 = 1e-3;

/// The largest number of places on one edge: a quarter where the obstacle is nearest, a quarter where it is farthest,
/// and the sharpest kinks.
const MOST_PLACES: usize = 32;

/// Finds the part of `boundary` (edges that follow one another) that faces the obstacle. `held`: as in
/// [`ContactBoundary::new`].
pub fn facing(
    mesh: &Mesh,
    boundary: &[Edge],
    held: &HeldDirections,
    obstacle: &Obstacle,
) -> Facing {
    let mut view = View::new(mesh, boundary, held, obstacle);
    let [low, high] = view.limits(obstacle);
    let rounding = view.rounding;
    let mut found = Facing {
        runs: Vec::new(),
        cut: Vec::new(),
        cut_edges: Vec::new(),
    };
    let ranges: Vec<[f64; 2]> = (0..boundary.len()).map(|k| view.range(k)).collect();
    let within = |k: usize| ranges[k][0] >= low - rounding && ranges[k][1] <= high + rounding;
    let runs = view.runs(boundary, &within);
    for (k, edge) in boundary.iter().enumerate() {
        let [least, most] = ranges[k];
        let touches = most > low + rounding && least < high - rounding;
        let in_run = runs.iter().any(|run| run.contains(&k));
        if touches && !in_run && (!within(k) || view.ends_inside(k, edge)) {
            found.cut.push([least, most]);
            found
                .cut_edges
                .push((*edge, most.min(high) - least.max(low)));
        }
    }
    for run in runs {
        view.end_at(run.clone(), &boundary[run.clone()]);
        found.runs.extend(view.run(run.clone(), &boundary[run]));
    }
    found
}

/// The geometry of Γ_C along edges; the depth of the section does not matter.
fn along(mesh: &Mesh, chain: &[Edge], held: &HeldDirections) -> ContactBoundary {
    ContactBoundary::new(mesh, chain, 0.0, held, |_| 1.0)
}

/// The edges of `boundary` (edges that follow one another) inside which an obstacle ends, each with the place of the
/// end on it, −1 … 1. `deepest`: the largest indentation; where an edge is farther from a curve than this, the curve's
/// ends are left out.
pub fn ends_inside_edges(
    mesh: &Mesh,
    boundary: &[Edge],
    obstacle: &Obstacle,
    deepest: f64,
) -> Vec<(Edge, f64)> {
    // supports turn a normal by rounding only
    let free = HeldDirections::new();
    let view = View::new(mesh, boundary, &free, obstacle);
    let limits = if obstacle.ends_in_flanks() {
        given_ends(obstacle)
    } else {
        view.limits(obstacle)
    };
    let mut found = Vec::new();
    for (k, edge) in boundary.iter().enumerate() {
        for end in limits.into_iter().filter(|end| end.is_finite()) {
            found.extend(view.place_of(k, end).map(|xi| (*edge, xi)));
        }
        let ends = view.ends_of_sight(k, edge, deepest);
        found.extend(ends.into_iter().map(|xi| (*edge, xi)));
    }
    found
}

/// The range of the coordinate c between the `from` and `to` of an obstacle.
fn given_ends(obstacle: &Obstacle) -> [f64; 2] {
    let (from, to, _) = obstacle.span();
    [
        from.unwrap_or(f64::NEG_INFINITY),
        to.unwrap_or(f64::INFINITY),
    ]
}

/// A boundary and the obstacle as seen from it.
struct View<'a> {
    mesh: &'a Mesh,
    held: &'a HeldDirections,
    shape: Shape<'a>,
    along: Along,
    whole: ContactBoundary,
    /// The side of a curve that is rigid, for an obstacle that is a curve.
    rigid: Side,
    corners: Vec<Corner>,
    rounding: f64,
}

/// The obstacle as seen from a place.
#[derive(Clone, Copy)]
struct Seen {
    profile: Profile,
    /// The first and the last of a curve's pieces that meet at the point seen.
    pieces: [usize; 2],
}

impl<'a> View<'a> {
    fn new(
        mesh: &'a Mesh,
        boundary: &[Edge],
        held: &'a HeldDirections,
        obstacle: &'a Obstacle,
    ) -> Self {
        let shape = Shape::new(obstacle);
        let whole = along(mesh, boundary, held);
        // rounded coordinates are those of the whole boundary, but a mesh may be finer than that
        let edges = (0..boundary.len()).map(|k| {
            let [start, end, _] = whole.edge_arc(k);
            end - start
        });
        let shortest = edges.fold(f64::INFINITY, f64::min);
        let rounding = (ROUNDING * whole.s[whole.s.len() - 1]).min(OF_AN_EDGE * shortest);
        View {
            mesh,
            held,
            along: obstacle.span().2,
            rigid: match shape.in_space() {
                Some(curve) => rigid_side(curve, mesh, &whole, rounding),
                None => Side::Left,
            },
            corners: shape.corners(),
            rounding,
            shape,
            whole,
        }
    }

    /// The range of the coordinate c of an edge.
    fn range(&self, edge: usize) -> [f64; 2] {
        let c = edge_nodes(edge).map(|node| self.coordinate(node));
        [
            c.iter().fold(f64::INFINITY, |a, &b| a.min(b)),
            c.iter().fold(f64::NEG_INFINITY, |a, &b| a.max(b)),
        ]
    }

    /// The runs of edges whose nodes all face the obstacle along the normals that a contact of just this run has: at
    /// its ends the normal of the edge alone, else the mean of both edges. `within`: the edges between `from` and `to`.
    fn runs(&self, boundary: &[Edge], within: &dyn Fn(usize) -> bool) -> Vec<Range<usize>> {
        let mut runs: Vec<Range<usize>> = Vec::new();
        for k in (0..boundary.len()).filter(|k| within(*k)) {
            let [start, _, middle] = edge_nodes(k);
            if self.seen_from_node(middle).is_none() {
                continue;
            }
            match runs.last_mut() {
                Some(run) if run.end == k && self.seen_from_node(start).is_some() => run.end += 1,
                _ => runs.push(k..k + 1),
            }
        }
        for run in &mut runs {
            let seen = |k: usize| self.seen_along_own_normals(k, &boundary[k]);
            while run.start < run.end && !seen(run.start)[0] {
                run.start += 1;
            }
            while run.start < run.end && !seen(run.end - 1)[1] {
                run.end -= 1;
            }
        }
        runs.retain(|run| run.start < run.end);
        runs
    }

    /// The normals of an edge's nodes if the edge is a contact by itself.
    fn own_normals(&self, edge: &Edge) -> [[f64; 2]; 3] {
        let own = along(self.mesh, &[*edge], self.held);
        edge_nodes(0).map(|i| own.normals[i])
    }

    /// Which nodes of an edge see the obstacle along the edge's own normals.
    fn seen_along_own_normals(&self, k: usize, edge: &Edge) -> [bool; 3] {
        let (nodes, normals) = (edge_nodes(k), self.own_normals(edge));
        std::array::from_fn(|i| {
            let node = nodes[i];
            let place = self.whole.positions[node];
            let seen = self.seen_from_place(place, normals[i], self.coordinate(node));
            seen.is_some()
        })
    }

    /// Sets the normals along a run to the normals of a contact that ends where the run ends. `chain`: the edges of the
    /// run.
    fn end_at(&mut self, run: Range<usize>, chain: &[Edge]) {
        let normals = along(self.mesh, chain, self.held).normals;
        self.whole.normals[2 * run.start..=2 * run.end].copy_from_slice(&normals);
    }

    /// The obstacle along a run of edges; `None` if a node does not face it.
    fn run(&self, run: Range<usize>, chain: &[Edge]) -> Option<FacingRun> {
        let nodes = 2 * run.start..2 * run.end + 1;
        let seen: Option<Vec<Seen>> = nodes.clone().map(|i| self.seen_from_node(i)).collect();
        let seen = seen?;
        let mut places = Vec::new();
        for (edge, k) in run.clone().enumerate() {
            let found = self.places(k, edge_nodes(edge).map(|i| seen[i]));
            places.extend(found.into_iter().map(|place| Place { edge, ..place }));
        }
        Some(FacingRun {
            chain: chain.to_vec(),
            profile: seen.iter().map(|seen| seen.profile).collect(),
            start: self.whole.s[nodes.start],
            coordinate: nodes.map(|i| self.coordinate(i)).collect(),
            places,
        })
    }

    /// The range of the coordinate c that the obstacle covers.
    fn limits(&self, obstacle: &Obstacle) -> [f64; 2] {
        let ([from, to], [first, last]) = (given_ends(obstacle), self.shape.ends());
        [from.max(first), to.min(last)]
    }

    /// The place on an edge with the coordinate c, if the edge contains it.
    fn place_of(&self, edge: usize, c: f64) -> Option<f64> {
        let ends = edge_nodes(edge).map(|node| self.coordinate(node));
        let (low, high) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
        if c <= low + self.rounding || c >= high - self.rounding {
            return None;
        }
        let sign = (ends[1] - ends[0]).signum();
        let guess = edge3::invert(&ends.map(|end| sign * end), sign * c);
        if self.along == Along::X {
            return Some(guess);
        }
        // arc length to a new node is that of the part of the edge before it
        let positions = edge_nodes(edge).map(|node| self.whole.positions[node]);
        let length = |xi: f64| {
            let part = [-1.0, xi, 0.5 * (xi - 1.0)].map(|xi| edge3::map(&positions, xi).0);
            ends[0] + length_through(&part)
        };
        bisected(|xi| length(xi) < c, -1.0, 1.0)
    }

    /// The places where an edge faces an end of a curve along the edge's own normals. A curve that turns away from the
    /// edge before its end has no such place: its flank, steeper than 45°, is no place for a node. Nor does contact end
    /// at a corner of the body: there the next side faces the part of the obstacle that overlaps the body.
    fn ends_of_sight(&self, k: usize, edge: &Edge, deepest: f64) -> Vec<f64> {
        let Some(curve_ends) = self.shape.in_space().and_then(Curve::ends) else {
            return Vec::new();
        };
        let normals = self.own_normals(edge);
        let positions = edge_nodes(k).map(|node| self.whole.positions[node]);
        let faced = |xi: f64| {
            let (mut place, mut n, c) = self.place_between(k, xi, &normals);
            let mut rounding = self.rounding;
            if ![-1.0, 0.0, 1.0].contains(&xi) {
                // the normal that a node has if it is put there, and half the tolerance that it then has: it sees the curve
                (place, n) = (edge3::map(&positions, xi).0, edge_normal(&positions, xi));
                rounding *= 0.5;
            }
            let profile = self.seen_within(rounding, place, n, c)?.profile;
            Some((profile, [0, 1].map(|a| place[a] + profile.distance * n[a])))
        };
        let distance = |xi: f64| faced(xi).map(|(profile, _)| profile.distance);
        let touches = |xi: f64| distance(xi).is_some_and(|distance| distance <= deepest);
        if ![-1.0, 0.0, 1.0].into_iter().chain(BETWEEN).any(touches) {
            return Vec::new();
        }
        let [start, end, _] = edge_nodes(k);
        let round_corner = |xi: f64| {
            let corner = match xi {
                -1.0 => self.whole.corner(start),
                1.0 => self.whole.corner(end),
                _ => 0.0,
            };
            corner != 0.0 && distance(xi).is_some_and(|distance| distance < 0.0)
        };
        let end_in = |[first, last]: [f64; 2]| {
            let [from, to] = match [first, last].map(|xi| distance(xi).is_some()) {
                [true, false] => [first, last],
                [false, true] => [last, first],
                _ => return None,
            };
            if round_corner(from) {
                return None;
            }
            // the last place from which it is seen
            let xi = bisected(|xi| distance(xi).is_some(), from, to)?;
            let (profile, [x, y]) = faced(xi)?;
            let near = |[a, b]: [f64; 2]| (x - a).hypot(y - b) <= 1e3 * self.rounding;
            (profile.slope.abs() <= 1.0 && curve_ends.into_iter().any(near)).then_some(xi)
        };
        [[-1.0, 0.0], [0.0, 1.0]]
            .into_iter()
            .filter_map(end_in)
            .collect()
    }

    /// The coordinate c of a node.
    fn coordinate(&self, node: usize) -> f64 {
        match self.along {
            Along::X => self.whole.positions[node][0],
            Along::ArcLength => self.whole.s[node],
        }
    }

    fn seen_from_node(&self, node: usize) -> Option<Seen> {
        let (place, n) = (self.whole.positions[node], self.whole.normals[node]);
        self.seen_from_place(place, n, self.coordinate(node))
    }

    fn seen_from_place(&self, place: [f64; 2], n: [f64; 2], c: f64) -> Option<Seen> {
        self.seen_within(self.rounding, place, n, c)
    }

    fn seen_within(&self, rounding: f64, place: [f64; 2], n: [f64; 2], c: f64) -> Option<Seen> {
        let t = tangent(n);
        if let Some(curve) = self.shape.in_space() {
            let ray = Ray { place, n, t };
            let Hit { profile, pieces } = curve.faced_by(&ray, self.rigid, rounding)?;
            return Some(Seen { profile, pieces });
        }
        let (distance, slope) = self.shape.at(c, rounding)?;
        let profile = Profile {
            distance,
            slope: slope * self.per_length(t),
        };
        Some(Seen {
            profile,
            pieces: [0; 2],
        })
    }

    /// The change of the coordinate c per length along t.
    fn per_length(&self, t: [f64; 2]) -> f64 {
        match self.along {
            Along::X => t[0],
            Along::ArcLength => 1.0,
        }
    }

    /// Position, normal and coordinate c at a place of an edge.
    fn place(&self, edge: usize, xi: f64) -> ([f64; 2], [f64; 2], f64) {
        let normals = edge_nodes(edge).map(|i| self.whole.normals[i]);
        self.place_between(edge, xi, &normals)
    }

    /// Position, normal and coordinate c at a place of an edge, for the given normals at its nodes.
    fn place_between(
        &self,
        edge: usize,
        xi: f64,
        normals: &[[f64; 2]; 3],
    ) -> ([f64; 2], [f64; 2], f64) {
        let (h, nodes) = (edge3::shape(xi), edge_nodes(edge));
        let along = |f: &dyn Fn(usize) -> f64| edge3::interpolate(&h, &nodes.map(f));
        let n = [0, 1].map(|a| edge3::interpolate(&h, &normals.map(|n| n[a])));
        let length = n[0].hypot(n[1]);
        (
            [0, 1].map(|a| along(&|i| self.whole.positions[i][a])),
            n.map(|x| x / length),
            along(&|i| self.coordinate(i)),
        )
    }

    fn seen_from_edge(&self, edge: usize, xi: f64) -> Option<Seen> {
        let (place, n, c) = self.place(edge, xi);
        self.seen_from_place(place, n, c)
    }

    /// Whether a curve ends inside an edge: some of the edge's nodes face the curve and others do not. Where the curve
    /// ends exactly at a node, no point of the edge beyond this node faces it. A straight line has no end: the body
    /// turns away from it.
    fn ends_inside(&self, k: usize, edge: &Edge) -> bool {
        const BESIDE: f64 = 1.0 / 64.0;
        let normals = self.own_normals(edge);
        let [start, end, middle] = self.seen_along_own_normals(k, edge);
        let ends = match self.shape.in_space() {
            Some(Curve::Line(..)) | None => false,
            Some(Curve::Segments(..) | Curve::Smooth(..)) => !(start && end && middle),
        };
        let beside = |is_seen: bool, xi: f64| {
            let (place, n, c) = self.place_between(k, xi, &normals);
            is_seen && self.seen_from_place(place, n, c).is_some()
        };
        ends && (middle || beside(start, -1.0 + BESIDE) || beside(end, 1.0 - BESIDE))
    }

    /// The obstacle between the nodes of an edge and at the obstacle's corners on the edge, in order of s. `nodes`: the
    /// obstacle as seen from the edge's start, end and midside.
    fn places(&self, edge: usize, nodes: [Seen; 3]) -> Vec<Place> {
        let mut found: Vec<Place> = Vec::new();
        let at_nodes = nodes.map(|seen| seen.profile.distance);
        let place = |xi: f64, normal: [f64; 2], profile: Profile, kink: f64| Place {
            edge,
            xi,
            normal,
            profile,
            kink,
            nearer: edge3::interpolate(&edge3::shape(xi), &at_nodes) - profile.distance,
        };
        let [start, end, middle] = nodes;
        let mut sight = vec![(-1.0, start), (0.0, middle), (1.0, end)];
        for xi in BETWEEN {
            if let Some(seen) = self.seen_from_edge(edge, xi) {
                let (_, n, _) = self.place(edge, xi);
                found.push(place(xi, n, seen.profile, 0.0));
                sight.push((xi, seen));
            }
        }
        sight.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (xi, corner) in self.corners_in(edge) {
            let (position, n, _) = self.place(edge, xi);
            let kink = corner.change * self.per_length(tangent(n)).abs();
            let seen = self.seen_from_place(position, n, corner.c);
            found.extend(seen.map(|seen| place(xi, n, seen.profile, kink)));
        }
        let joints = match self.shape.in_space() {
            Some(curve) => self.joints_in(curve, edge, &sight),
            None => Vec::new(),
        };
        for (xi, point, change) in joints {
            let (position, n, _) = self.place(edge, xi);
            let ahead = (0..2).map(|a| (point[a] - position[a]) * n[a]).sum::<f64>();
            if let Some(seen) = self.seen_from_edge(edge, xi) {
                // another part of the line may lie before it
                let hidden = (ahead - seen.profile.distance).abs() > 1e3 * self.rounding;
                let kink = if hidden { 0.0 } else { change };
                found.push(place(xi, n, seen.profile, kink));
            }
        }
        if found.len() > MOST_PLACES {
            const QUARTER: usize = MOST_PLACES / 4;
            found.sort_by(|a, b| b.nearer.total_cmp(&a.nearer));
            let farthest = found.split_off(found.len() - QUARTER);
            found[QUARTER..].sort_by(|a, b| b.kink.total_cmp(&a.kink));
            found.truncate(MOST_PLACES - QUARTER);
            found.extend(farthest);
        }
        found.sort_by(|a, b| a.xi.total_cmp(&b.xi));
        found
    }

    /// The corners of the obstacle on an edge. A corner at the edge's end belongs to the next edge, if there is one.
    fn corners_in(&self, edge: usize) -> Vec<(f64, Corner)> {
        let mut c = edge_nodes(edge).map(|node| self.coordinate(node));
        let falls = c[1] < c[0];
        let sign = if falls { -1.0 } else { 1.0 };
        c = c.map(|c| sign * c);
        let (low, high) = if falls { (-c[1], -c[0]) } else { (c[0], c[1]) };
        let last = edge + 1 == self.whole.edge_count();
        let first = self
            .corners
            .partition_point(|corner| corner.c < low - self.rounding);
        let near = |a: f64, b: f64| (a - b).abs() <= self.rounding;
        let mut found = Vec::new();
        for corner in &self.corners[first..] {
            if corner.c > high + self.rounding {
                break;
            }
            let at = sign * corner.c;
            let xi = match () {
                () if near(at, c[0]) => -1.0,
                () if near(at, c[1]) && !last => continue,
                () if near(at, c[1]) => 1.0,
                () if near(at, c[2]) => 0.0,
                () => edge3::invert(&c, at),
            };
            found.push((xi, *corner));
        }
        found
    }

    /// The joints between pieces of a curve that an edge faces, each with its place on the edge, its point, and the
    /// change of slope. `sight`: the obstacle seen from places of the edge, in the order of the places.
    fn joints_in(
        &self,
        curve: &Curve<'_>,
        edge: usize,
        sight: &[(f64, Seen)],
    ) -> Vec<(f64, [f64; 2], f64)> {
        let last = edge + 1 == self.whole.edge_count();
        let mut found: Vec<(f64, usize)> = Vec::new();
        for (xi, seen) in sight {
            // that at the end belongs to the next edge
            let joint = seen.pieces[1] == seen.pieces[0] + 1;
            if joint && (*xi < 1.0 || last) {
                found.push((*xi, seen.pieces[1]));
            }
        }
        for pair in sight.windows(2) {
            let [(low, a), (high, b)] = [pair[0], pair[1]];
            let between = match () {
                () if b.pieces[0] > a.pieces[1] => a.pieces[1] + 1..=b.pieces[0],
                () if b.pieces[1] < a.pieces[0] => b.pieces[1] + 1..=a.pieces[0],
                () => continue,
            };
            let facing = |joint| Some((self.faces(curve, edge, joint, [low, high])?, joint));
            found.extend(between.filter_map(facing));
        }
        let with_change = |(xi, joint)| {
            let (_, n, _) = self.place(edge, xi);
            let (point, change) = curve.joint(joint, n, tangent(n));
            (xi, point, change)
        };
        found.into_iter().map(with_change).collect()
    }

    /// The place of an edge in the given range whose normal meets a joint of the curve, if there is such a place.
    fn faces(
        &self,
        curve: &Curve<'_>,
        edge: usize,
        joint: usize,
        [mut low, mut high]: [f64; 2],
    ) -> Option<f64> {
        let ahead = |xi: f64| {
            let (place, n, _) = self.place(edge, xi);
            let t = tangent(n);
            let (point, _) = curve.joint(joint, n, t);
            (point[0] - place[0]) * t[0] + (point[1] - place[1]) * t[1]
        };
        for end in [low, high] {
            if ahead(end).abs() <= self.rounding {
                return Some(end);
            }
        }
        if ahead(low) < 0.0 || ahead(high) > 0.0 {
            return None;
        }
        // to rounding
        for _ in 0..50 {
            let middle = 0.5 * (low + high);
            if ahead(middle) > 0.0 {
                low = middle;
            } else {
                high = middle;
            }
        }
        Some(0.5 * (low + high))
    }
}

/// The last place from `from` towards `to` for which `holds` is true, by bisection; `None` if it is `from` itself.
fn bisected(holds: impl Fn(f64) -> bool, from: f64, to: f64) -> Option<f64> {
    let (mut inside, mut outside) = (from, to);
    // to rounding
    for _ in 0..60 {
        let middle = 0.5 * (inside + outside);
        if holds(middle) {
            inside = middle;
        } else {
            outside = middle;
        }
    }
    (inside != from).then_some(inside)
}

/// The tangent: n turned clockwise.
fn tangent([x, y]: [f64; 2]) -> [f64; 2] {
    [y, -x]
}

/// The rigid side of a curve, as most of the boundary sees it.
fn rigid_side(curve: &Curve<'_>, mesh: &Mesh, boundary: &ContactBoundary, rounding: f64) -> Side {
    let surface = mesh.surface();
    let mut left = 0.0;
    for (i, &place) in boundary.positions.iter().enumerate() {
        let n = boundary.normals[i];
        let ray = Ray {
            place,
            n,
            t: tangent(n),
        };
        let reach = depth(mesh, &surface, &ray, rounding);
        match curve.rigid_side(&ray, reach, rounding) {
            Some(Side::Left) => left += boundary.weights[i],
            Some(Side::Right) => left -= boundary.weights[i],
            None => {}
        }
    }
    if left >= 0.0 { Side::Left } else { Side::Right }
}

/// How far the body extends from a place of its surface along −n (length).
fn depth(mesh: &Mesh, surface: &[Edge], ray: &Ray, rounding: f64) -> f64 {
    let Ray { place, n, t } = *ray;
    let mut least = f64::INFINITY;
    for edge in surface {
        let nodes = mesh.edge_nodes(edge);
        let part = |axis: [f64; 2]| {
            nodes.map(|[x, y]| (x - place[0]) * axis[0] + (y - place[1]) * axis[1])
        };
        let (beside, ahead) = (part(t), part(n));
        for xi in edge3::zeros(&beside) {
            let behind = -edge3::interpolate(&edge3::shape(xi), &ahead);
            // the side that the place lies on is left there
            if behind > rounding {
                least = least.min(behind);
            }
        }
    }
    least
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::grid_mesh;
    use crate::problem::{Along, Grid, Interpolation};

    fn face(x: &[f64], obstacle: &Obstacle) -> Facing {
        let mesh = grid_mesh(&Grid {
            x: x.to_vec(),
            y: vec![0.0, 1.0],
            top: None,
            bottom: None,
        });
        facing(
            &mesh,
            &mesh.boundaries["top"],
            &HeldDirections::new(),
            obstacle,
        )
    }

    #[test]
    fn a_flat_covers_the_edges_between_its_ends_and_reports_cut_edges() {
        let punch = Obstacle::Flat {
            from: Some(1.0),
            to: Some(2.5),
            along: Along::X,
        };
        let found = face(&[0.0, 1.0, 2.0, 3.0, 4.0], &punch);
        assert_eq!(found.runs.len(), 1);
        assert_eq!(
            (found.runs[0].chain.len(), found.runs[0].profile.clone()),
            (1, vec![Profile::default(); 3])
        );
        assert_eq!(found.cut, [[2.0, 3.0]]);
    }

    #[test]
    fn a_circle_ends_at_its_radius_and_a_parabola_does_not() {
        let (from, to, along) = (None, None, Along::X);
        let circle = Obstacle::Circle {
            radius: 2.0,
            center: 0.0,
            from,
            to,
            along,
        };
        let found = face(&[0.0, 1.0, 2.0, 3.0], &circle);
        let exact = [
            0.0,
            2.0 - 3.75f64.sqrt(),
            2.0 - 3f64.sqrt(),
            2.0 - 1.75f64.sqrt(),
            2.0,
        ];
        assert!(
            found.runs[0]
                .profile
                .iter()
                .zip(exact)
                .all(|(a, b)| (a.distance - b).abs() < 1e-15)
        );
        let parabola = Obstacle::Parabola {
            radius: 2.0,
            center: 1.0,
            from,
            to,
            along,
        };
        let found = face(&[0.0, 1.0, 3.0], &parabola);
        let seen = |f: fn(&Profile) -> f64| found.runs[0].profile.iter().map(f).collect::<Vec<_>>();
        assert_eq!(seen(|p| p.distance), [0.25, 0.0625, 0.0, 0.25, 1.0]);
        assert_eq!(seen(|p| p.slope), [-0.5, -0.25, 0.0, 0.5, 1.0]);
    }

    #[test]
    fn arc_length_counts_from_the_start_of_the_boundary() {
        let punch = Obstacle::Flat {
            from: Some(0.0),
            to: Some(1.0),
            along: Along::ArcLength,
        };
        let found = face(&[5.0, 6.0, 8.0], &punch);
        assert_eq!(found.runs[0].chain.len(), 1);
    }

    /// A roof over a flat top has the right distances and slopes along the top's normal, and is no obstacle beside it.
    #[test]
    fn curves_in_space_are_met_along_the_normal() {
        let (from, to, along) = (None, None, Along::X);
        let points = vec![[0.5, 1.0], [1.5, 2.0], [2.5, 1.0]];
        let roof = Obstacle::Polyline {
            points,
            interpolation: Interpolation::Linear,
            from,
            to,
            along,
        };
        let found = face(&[0.0, 0.5, 1.5, 2.5, 3.0], &roof);
        assert_eq!(found.runs.len(), 1);
        let run = &found.runs[0];
        assert_eq!(run.chain.len(), 2);
        let close = |a: f64, b: f64| (a - b).abs() < 1e-12;
        for (profile, (distance, slope)) in
            run.profile
                .iter()
                .zip([(0.0, 1.0), (0.5, 1.0), (1.0, 0.0), (0.5, -1.0), (0.0, -1.0)])
        {
            assert!(
                close(profile.distance, distance) && close(profile.slope, slope),
                "{profile:?}"
            );
        }
        let line = Obstacle::Line {
            point: [0.0, 1.5],
            angle: 45.0,
            from,
            to,
            along,
        };
        let seen = face(&[0.0, 2.0], &line).runs[0].profile.clone();
        assert!(close(seen[2].distance, 2.5) && close(seen[2].slope, 1.0));
    }
}
