//! What the verification tests share.

use solver::observer::{Observer, Progress};
use solver::problem::Problem;
use solver::solution::{Fields, Solution};

/// One of the five problems on meshes of the thesis's size.
pub(crate) fn example(name: &str) -> Problem {
    let path = format!("{}/data/thesis/{name}.json", env!("CARGO_MANIFEST_DIR"));
    problem(&std::fs::read_to_string(path).unwrap())
}

/// A problem from JSON.
pub(crate) fn problem(json: &str) -> Problem {
    files::parse(json).unwrap_or_else(|violations| panic!("{violations:#?}"))
}

/// Solves a problem that must converge.
pub(crate) fn solve(problem: &Problem) -> Solution {
    let external = files::external_mesh(problem, None);
    let solution = solver::solve_on(problem, external, &mut quiet).unwrap();
    assert!(solution.summary.converged, "{:#?}", solution.summary);
    solution
}

/// An observer that lets everything go on.
pub(crate) fn quiet(_: Progress<'_>) {}

/// An observer made of one function, which is called with all progress, and without at each question whether to stop;
/// it answers whether to stop from then on.
pub(crate) fn watching<F: FnMut(Option<Progress<'_>>) -> bool>(watch: F) -> Watching<F> {
    Watching {
        watch,
        stopped: false,
    }
}

pub(crate) struct Watching<F> {
    watch: F,
    stopped: bool,
}

impl<F: FnMut(Option<Progress<'_>>) -> bool> Observer for Watching<F> {
    fn event(&mut self, progress: Progress<'_>) {
        self.stopped |= (self.watch)(Some(progress));
    }

    fn stop(&mut self) -> bool {
        self.stopped |= (self.watch)(None);
        self.stopped
    }
}

/// The problems of the catalogue that the environment asks for, as `from..to`.
pub(crate) fn numbers(name: &str, otherwise: std::ops::Range<u64>) -> std::ops::Range<u64> {
    let asked = std::env::var(name).ok();
    let range = asked.as_deref().and_then(|text| {
        let (from, to) = text.split_once("..")?;
        Some(from.parse().ok()?..to.parse().ok()?)
    });
    range.unwrap_or(otherwise)
}

/// Asserts |got − expected| ≤ tolerance · |expected|.
#[track_caller]
pub(crate) fn close(got: f64, expected: f64, tolerance: f64) {
    let error = ((got - expected) / expected).abs();
    assert!(
        error <= tolerance,
        "got {got}, expected {expected}: off by {error:.2e}, allowed {tolerance:.0e}"
    );
}

/// The node nearest to (x, y).
pub(crate) fn node(fields: &Fields, x: f64, y: f64) -> usize {
    let distance = |k: &usize| (fields.x[*k] - x).hypot(fields.y[*k] - y);
    (0..fields.x.len())
        .min_by(|a, b| distance(a).total_cmp(&distance(b)))
        .unwrap()
}

/// Grid lines from `from` to `to`: the first step is `first`, each next one `growth` times the one
/// before, the last one what remains.
pub(crate) fn graded(from: f64, to: f64, first: f64, growth: f64) -> Vec<f64> {
    let direction = (to - from).signum();
    let (mut lines, mut step) = (vec![from], first);
    while (to - lines[lines.len() - 1]).abs() > 1.5 * step {
        lines.push(lines[lines.len() - 1] + direction * step);
        step *= growth;
    }
    lines.push(to);
    lines
}

/// Sorted union of grid lines; lines that are equal to rounding count once.
pub(crate) fn union(parts: &[Vec<f64>]) -> Vec<f64> {
    let mut lines: Vec<f64> = parts.concat();
    lines.sort_by(f64::total_cmp);
    lines.dedup_by(|a, b| (*a - *b).abs() < 1e-12);
    lines
}

/// An inline mesh of columns × rows of 8-node elements, deformed as its maker likes.
pub(crate) struct Lattice {
    pub(crate) nodes: Vec<[f64; 2]>,
    pub(crate) elements: Vec<[usize; 8]>,
    number: std::collections::BTreeMap<(usize, usize), usize>,
}

impl Lattice {
    /// `place(i, j)`: position of the node i half-elements to the right and j up.
    pub(crate) fn new(
        columns: usize,
        rows: usize,
        place: impl Fn(usize, usize) -> [f64; 2],
    ) -> Self {
        let (mut nodes, mut number) = (Vec::new(), std::collections::BTreeMap::new());
        for j in 0..=2 * rows {
            for i in (0..=2 * columns).filter(|i| i % 2 == 0 || j % 2 == 0) {
                number.insert((i, j), nodes.len());
                nodes.push(place(i, j));
            }
        }
        #[rustfmt::skip]
        const PLACES: [(usize, usize); 8] = [(0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1)];
        let cells = (0..rows).flat_map(|j| (0..columns).map(move |i| (2 * i, 2 * j)));
        let elements = cells
            .map(|(i, j)| PLACES.map(|(di, dj)| number[&(i + di, j + dj)]))
            .collect();
        Lattice {
            nodes,
            elements,
            number,
        }
    }

    /// Nodes and elements with those quadrilaterals that `which` names cut in two triangles.
    pub(crate) fn cut(&self, which: impl Fn(usize) -> bool) -> (Vec<[f64; 2]>, Vec<Vec<usize>>) {
        let (mut nodes, mut elements) = (self.nodes.clone(), Vec::new());
        for (e, p) in self.elements.iter().enumerate() {
            if !which(e) {
                elements.push(p.to_vec());
                continue;
            }
            let ([a, b], centre) = ([p[0], p[2]].map(|n| self.nodes[n]), nodes.len());
            nodes.push([0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])]);
            elements.push(vec![p[0], p[1], p[2], p[4], p[5], centre]);
            elements.push(vec![p[0], p[2], p[3], centre, p[6], p[7]]);
        }
        (nodes, elements)
    }

    /// Edges [start, end, midside] of `count` elements along a line of nodes; `at(k)`: half-steps.
    pub(crate) fn edges(
        &self,
        count: usize,
        at: impl Fn(usize) -> (usize, usize),
    ) -> Vec<[usize; 3]> {
        let edge = |k: usize| [2 * k, 2 * k + 2, 2 * k + 1].map(|k| self.number[&at(k)]);
        (0..count).map(edge).collect()
    }
}
