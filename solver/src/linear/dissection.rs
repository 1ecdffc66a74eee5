//! An order of elimination for the nodes of a mesh in the plane: its elements are repeatedly halved by their centres,
//! and the nodes that two halves share are eliminated after both. In a grid a cut between two lines of elements is the
//! shortest; halves of a free mesh are improved (the module `bisection`).
//!
//! The result is a binary tree of *parts*. A part owns the nodes that lie in it alone, but in neither of its halves
//! alone; a part that is not divided owns all that lie in it alone. No part owns the nodes that are never eliminated
//! (`kept`). After its halves are eliminated, a part consists of the nodes it owns and its *boundary*: the nodes that
//! it shares with the rest of the body, and those that are never eliminated.

use std::ops::Deref;
use std::sync::Arc;

use super::bisection::Bisection;
use super::interrupt::{Interrupt, Stopped};
use super::parallel::for_each;

/// The largest number of elements of a part that is not divided: smaller parts cost more in overhead than they save in
/// arithmetic.
const LARGEST_LEAF: usize = 6;

/// The smaller half of a part has at least this share of the part's elements, so that the depth of the tree is of the
/// order of the logarithm of the number of elements.
const SMALLEST_SHARE: f64 = 0.25;

/// The smallest number of elements of a part whose halves two threads divide at the same time. One thread divides so many
/// in some milliseconds.
pub const SMALLEST_SHARED: usize = 1 << 12;

/// Centres whose distance is below this fraction of the extent lie on the same grid line.
const SAME_LINE: f64 = 1e-10;

/// The halves of a part with fewer elements are not improved.
const SMALLEST_IMPROVED: usize = 12;

/// The directions across which parts are cut: x, y and the diagonals.
const DIRECTIONS: [[f64; 2]; 4] = [[1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, -1.0]];

/// The part of a mesh that a dissection needs.
pub struct Cells<'a, E> {
    /// The nodes of every element.
    pub elements: &'a [E],
    /// The positions of the nodes.
    pub positions: &'a [[f64; 2]],
    /// Whether a node has unknowns; nodes without unknowns are left out.
    pub unknown: &'a [bool],
}

/// The dissection of a mesh: a binary tree of parts. Halves come before the part that they make up, so the last part is
/// the whole mesh.
#[derive(Default)]
pub struct Dissection {
    /// The parts.
    pub parts: Vec<Part>,
    /// All elements; those of each part are consecutive.
    pub elements: Vec<u32>,
    /// The nodes in the order of their elimination, followed by those that are never eliminated.
    pub nodes: Vec<u32>,
    /// The boundaries of all parts, as places in `nodes`. Each is sorted, unless the module `equal_parts` has put it
    /// into the order of an equal part.
    pub boundaries: Vec<u32>,
}

/// A part of a mesh: a range of elements, with the nodes it owns and its boundary.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Part {
    /// The numbers of the two halves; `None` for a part that is not divided.
    pub halves: Option<[usize; 2]>,
    /// The depth of the part in the tree.
    pub depth: u32,
    /// The range of the part's elements in [`Dissection::elements`]: first and end.
    pub elements: [usize; 2],
    /// The range of the nodes that the part owns in [`Dissection::nodes`]: first and end.
    pub own: [usize; 2],
    /// The range of the part's boundary in [`Dissection::boundaries`]: first and end.
    pub boundary: [usize; 2],
}

impl Dissection {
    /// Dissects a mesh on one thread, or on two if there are more. The nodes `kept`, each listed once, come last in their order; nodes without
    /// an element are left out.
    pub fn new<E: Deref<Target = [u32]> + Sync>(
        cells: &Cells<'_, E>,
        kept: &[u32],
        threads: usize,
    ) -> Self {
        let mut state = Halving::new(cells, kept);
        let mut elements: Vec<u32> = (0..cells.elements.len() as u32).collect();
        state.divide(&mut elements, 0, 0, threads);
        let mut dissection = Dissection {
            parts: state.parts,
            elements,
            nodes: state.nodes,
            boundaries: Vec::new(),
        };
        let kept = kept.iter().filter(|node| cells.unknown[**node as usize]);
        dissection.nodes.extend(kept);
        dissection.find_boundaries(cells);
        dissection
    }

    fn find_boundaries<E: Deref<Target = [u32]>>(&mut self, cells: &Cells<'_, E>) {
        let mut place = vec![None; cells.positions.len()];
        for (k, &node) in self.nodes.iter().enumerate() {
            place[node as usize] = Some(k as u32);
        }
        let mut found: Vec<u32> = Vec::new();
        for number in 0..self.parts.len() {
            found.clear();
            let part = &self.parts[number];
            let end = part.own[1] as u32;
            match part.halves {
                None => {
                    for &e in &self.elements[part.elements[0]..part.elements[1]] {
                        let nodes = cells.elements[e as usize].iter();
                        found.extend(nodes.filter_map(|node| place[*node as usize]));
                    }
                    found.retain(|place| *place >= end);
                    found.sort_unstable();
                    found.dedup();
                }
                Some([a, b]) => {
                    let (a, b) = (self.boundary(a), self.boundary(b));
                    merge(a, b, &mut found);
                    // what the part owns comes before what is eliminated later
                    let own = found.partition_point(|place| *place < end);
                    found.drain(..own);
                }
            }
            let first = self.boundaries.len();
            self.boundaries.extend_from_slice(&found);
            self.parts[number].boundary = [first, self.boundaries.len()];
        }
    }

    /// The boundary of a part, as places in `nodes`.
    pub fn boundary(&self, part: usize) -> &[u32] {
        let [first, end] = self.parts[part].boundary;
        &self.boundaries[first..end]
    }
}

/// Appends the union of two sorted lists to `into`.
fn merge(a: &[u32], b: &[u32], into: &mut Vec<u32>) {
    let (mut i, mut j) = (0, 0);
    while let (Some(&x), Some(&y)) = (a.get(i), b.get(j)) {
        into.push(x.min(y));
        i += usize::from(x <= y);
        j += usize::from(y <= x);
    }
    into.extend_from_slice(&a[i..]);
    into.extend_from_slice(&b[j..]);
}

/// The state while parts are halved.
struct Halving<'a, E> {
    cells: &'a Cells<'a, E>,
    centres: Arc<[[f64; 2]]>,
    /// Whether a node is owned by no part yet and will be eliminated.
    free: Vec<bool>,
    /// By node: the stamp of the half in which the node was seen last.
    seen: Vec<u32>,
    stamp: u32,
    keys: Vec<f64>,
    /// The data for improving halves, made when first needed.
    bisection: Option<Bisection<'a, E>>,
    parts: Vec<Part>,
    nodes: Vec<u32>,
}

/// A line across a part, perpendicular to one of the [`DIRECTIONS`].
#[derive(Clone, Copy)]
struct Cut {
    direction: usize,
    at: f64,
    /// Whether the cut lies between two lines of centres, as in a grid.
    between_lines: bool,
}

impl Cut {
    fn is_below(&self, centre: [f64; 2]) -> bool {
        along(self.direction, centre) < self.at
    }
}

/// The coordinate of a point along one of the [`DIRECTIONS`].
fn along(direction: usize, [x, y]: [f64; 2]) -> f64 {
    let [a, b] = DIRECTIONS[direction];
    a * x + b * y
}

impl<'a, E: Deref<Target = [u32]> + Sync> Halving<'a, E> {
    fn new(cells: &'a Cells<'a, E>, kept: &[u32]) -> Self {
        let centre = |element: &E| {
            let scale = 1.0 / element.len().max(1) as f64;
            let nodes = element.iter().map(|node| cells.positions[*node as usize]);
            let sum = nodes.fold([0.0; 2], |[x, y], node| [x + node[0], y + node[1]]);
            sum.map(|c| scale * c)
        };
        let mut free = cells.unknown.to_vec();
        kept.iter().for_each(|node| free[*node as usize] = false);
        Halving::with(cells, cells.elements.iter().map(centre).collect(), free)
    }

    fn with(cells: &'a Cells<'a, E>, centres: Arc<[[f64; 2]]>, free: Vec<bool>) -> Self {
        Halving {
            cells,
            centres,
            free,
            seen: vec![0; cells.positions.len()],
            stamp: 0,
            keys: Vec::with_capacity(cells.elements.len()),
            bisection: None,
            parts: Vec::new(),
            nodes: Vec::new(),
        }
    }

    /// Divides the part with `elements`, which begin at `first` among all elements, and returns the part's number.
    fn divide(&mut self, elements: &mut [u32], first: usize, depth: u32, threads: usize) -> usize {
        let mut part = Part {
            depth,
            elements: [first, first + elements.len()],
            ..Part::default()
        };
        let mut own = Vec::new();
        if elements.len() <= LARGEST_LEAF {
            // so that equal parts are recognised: halving has left them in any order
            elements.sort_unstable();
            for &e in elements.iter() {
                let nodes = self.cells.elements[e as usize].iter();
                for &node in nodes {
                    if std::mem::replace(&mut self.free[node as usize], false) {
                        own.push(node);
                    }
                }
            }
        } else {
            let cut = self.best_cut(elements);
            let mut middle = self.part_by(elements, cut);
            let is_exact = cut.is_some_and(|cut| cut.between_lines);
            if !is_exact && elements.len() >= SMALLEST_IMPROVED {
                let bisection = match self.bisection.take() {
                    Some(bisection) => bisection,
                    None => self.new_bisection(),
                };
                middle = self
                    .bisection
                    .insert(bisection)
                    .improve(elements, middle, &self.free);
            }
            let (low, high) = elements.split_at_mut(middle);
            // before the halves take what is theirs
            self.shared(low, high, &mut own);
            own.iter()
                .for_each(|node| self.free[*node as usize] = false);
            // the other of x and y, or of the diagonals
            let other = cut.map_or(1, |cut| cut.direction ^ 1);
            let position = |node: &u32| along(other, self.cells.positions[*node as usize]);
            own.sort_unstable_by(|a, b| position(a).total_cmp(&position(b)).then(a.cmp(b)));
            let places = [first, first + middle];
            part.halves = Some(self.divide_halves([low, high], places, depth + 1, threads));
        }
        part.own[0] = self.nodes.len();
        self.nodes.append(&mut own);
        part.own[1] = self.nodes.len();
        self.parts.push(part);
        self.parts.len() - 1
    }

    /// Divides two halves, which begin at `places`, and returns their numbers. They have no free node in common: if two
    /// threads divide them at the same time, the parts are those that one thread finds.
    fn divide_halves(
        &mut self,
        [low, high]: [&mut [u32]; 2],
        places: [usize; 2],
        depth: u32,
        threads: usize,
    ) -> [usize; 2] {
        if threads < 2 || low.len() + high.len() < SMALLEST_SHARED {
            return [
                self.divide(low, places[0], depth, 1),
                self.divide(high, places[1], depth, 1),
            ];
        }
        let mut other = Halving::with(self.cells, self.centres.clone(), self.free.clone());
        // all memory is taken by this thread, which has to answer for it
        self.reserve(low.len());
        other.reserve(high.len());
        if self.bisection.is_some() {
            other.bisection = Some(self.new_bisection());
        }
        let mut numbers = [0; 2];
        let halves = [(&mut *self, low), (&mut other, high)];
        let divided = for_each(
            halves.into_iter().zip(places).zip(&mut numbers),
            &mut [(); 2],
            |(), (((state, half), first), number), _| {
                *number = state.divide(half, first, depth, 1);
                Ok(())
            },
            &mut Interrupt::new(&mut || false),
        );
        if let Err(Stopped) = divided {
            unreachable!("nothing stops it");
        }
        let (nodes, parts) = (self.nodes.len(), self.parts.len());
        self.nodes.append(&mut other.nodes);
        self.parts.extend(other.parts.into_iter().map(|part| Part {
            halves: part.halves.map(|halves| halves.map(|half| half + parts)),
            own: part.own.map(|place| place + nodes),
            ..part
        }));
        [numbers[0], numbers[1] + parts]
    }

    /// Takes the memory for dividing so many elements.
    fn reserve(&mut self, elements: usize) {
        self.keys.reserve(elements);
        self.nodes.reserve(self.cells.positions.len());
        self.parts.reserve(elements / 2);
    }

    fn new_bisection(&self) -> Bisection<'a, E> {
        Bisection::new(self.cells.elements, self.cells.positions.len())
    }

    /// The cut that the fewest nodes lie on; `None` if all centres coincide.
    fn best_cut(&mut self, elements: &[u32]) -> Option<Cut> {
        let mut best: Option<(usize, Cut)> = None;
        for direction in 0..DIRECTIONS.len() {
            // a grid is cut along its lines
            if direction == 2 && best.is_some_and(|(_, cut)| cut.between_lines) {
                break;
            }
            if let Some(cut) = self.middle(elements, direction) {
                let shared = self.count_shared(elements, cut);
                if best.is_none_or(|(fewest, _)| shared < fewest) {
                    best = Some((shared, cut));
                }
            }
        }
        best.map(|(_, cut)| cut)
    }

    /// The cut between two lines of centres that is closest to the middle.
    fn middle(&mut self, elements: &[u32], direction: usize) -> Option<Cut> {
        let keys = &mut self.keys;
        keys.clear();
        let centres = elements.iter().map(|e| self.centres[*e as usize]);
        keys.extend(centres.map(|centre| along(direction, centre)));
        let count = keys.len();
        let (below, &mut middle, above) =
            keys.select_nth_unstable_by(count / 2, |a, b| a.total_cmp(b));
        let bounds = |(low, high): (f64, f64), key: &f64| (low.min(*key), high.max(*key));
        let (low, _) = below.iter().fold((middle, middle), bounds);
        let (_, high) = above.iter().fold((middle, middle), bounds);
        let same = SAME_LINE * (high - low);
        // the line of centres through the middle, and the lines beside it
        let (mut before, mut from) = (f64::NEG_INFINITY, middle);
        let (mut after, mut to) = (f64::INFINITY, middle);
        let (mut count_before, mut count_until) = (0usize, 0usize);
        for &key in keys.iter() {
            if key < middle - same {
                before = before.max(key);
                count_before += 1;
            } else if key > middle + same {
                after = after.min(key);
            } else {
                from = from.min(key);
                to = to.max(key);
                count_until += 1;
            }
        }
        // as many on one line as a quarter of the side of a square, not two centres of a free mesh by chance
        let between_lines = count_until > 1 && 16 * count_until.pow(2) > count;
        count_until += count_before;
        let off = |n: usize| (n as f64 / count as f64 - 0.5).abs();
        let (off_before, off_after) = (off(count_before), off(count_until));
        if off_before.min(off_after) > 0.5 - SMALLEST_SHARE {
            return None;
        }
        let at = if off_before <= off_after {
            0.5 * (before + from)
        } else {
            0.5 * (to + after)
        };
        Some(Cut {
            direction,
            at,
            between_lines,
        })
    }

    /// Moves the elements below the cut before the others, and returns the number of elements below it.
    fn part_by(&self, elements: &mut [u32], cut: Option<Cut>) -> usize {
        let Some(cut) = cut else {
            return elements.len() / 2;
        };
        let mut low = 0;
        for i in 0..elements.len() {
            if cut.is_below(self.centres[elements[i] as usize]) {
                elements.swap(low, i);
                low += 1;
            }
        }
        // rounding may put all of them on one side of a cut between two neighbouring numbers
        match low {
            0 => elements.len() / 2,
            low if low == elements.len() => elements.len() / 2,
            low => low,
        }
    }

    /// The number of free nodes that have elements on both sides of a cut.
    fn count_shared(&mut self, elements: &[u32], cut: Cut) -> usize {
        let (low, high) = self.stamps();
        let below = |e: &&u32| cut.is_below(self.centres[**e as usize]);
        for &e in elements.iter().filter(below) {
            for &node in self.cells.elements[e as usize].iter() {
                self.seen[node as usize] = low;
            }
        }
        let mut count = 0;
        for &e in elements.iter().filter(|e| !below(e)) {
            for &node in self.cells.elements[e as usize].iter() {
                if self.seen[node as usize] == low {
                    self.seen[node as usize] = high;
                    count += usize::from(self.free[node as usize]);
                }
            }
        }
        count
    }

    /// Appends to `into` the free nodes that belong to elements of both halves.
    fn shared(&mut self, low: &[u32], high: &[u32], into: &mut Vec<u32>) {
        let (in_low, in_both) = self.stamps();
        for &e in low {
            for &node in self.cells.elements[e as usize].iter() {
                self.seen[node as usize] = in_low;
            }
        }
        for &e in high {
            for &node in self.cells.elements[e as usize].iter() {
                if self.seen[node as usize] == in_low {
                    self.seen[node as usize] = in_both;
                    if self.free[node as usize] {
                        into.push(node);
                    }
                }
            }
        }
    }

    /// Two new stamps, which no node has yet.
    fn stamps(&mut self) -> (u32, u32) {
        self.stamp += 2;
        (self.stamp - 1, self.stamp)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A grid of four-node cells between lines along x and y; nodes are numbered along x first.
    pub(in crate::linear) fn grid(x: &[f64], y: &[f64]) -> (Vec<Vec<u32>>, Vec<[f64; 2]>) {
        let positions = y.iter().flat_map(|y| x.iter().map(|x| [*x, *y])).collect();
        let columns = x.len();
        let cell = |i: usize, j: usize| {
            let corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)];
            corners.map(|(i, j)| (j * columns + i) as u32).to_vec()
        };
        let cells = (0..y.len() - 1).flat_map(|j| (0..columns - 1).map(move |i| (i, j)));
        (cells.map(|(i, j)| cell(i, j)).collect(), positions)
    }

    pub(in crate::linear) fn lines(count: usize) -> Vec<f64> {
        (0..=count).map(|i| 0.1 * i as f64).collect()
    }

    fn dissect(x: &[f64], y: &[f64], kept: &[u32]) -> (Dissection, Vec<Vec<u32>>) {
        let (elements, positions) = grid(x, y);
        let unknown = vec![true; positions.len()];
        let cells = Cells {
            elements: &elements,
            positions: &positions,
            unknown: &unknown,
        };
        (Dissection::new(&cells, kept, 1), elements)
    }

    #[test]
    fn every_part_has_the_nodes_and_the_boundary_that_its_elements_give_it() {
        let kept = [3, 77, 12, 0];
        let (found, elements) = dissect(&lines(11), &lines(8), &kept);
        let count = 12 * 9;
        let mut all = found.nodes.clone();
        assert_eq!(all.split_off(count - kept.len()), kept);
        all.extend(kept);
        all.sort_unstable();
        assert!(all.into_iter().eq(0..count as u32), "every node once");
        for (number, part) in found.parts.iter().enumerate() {
            let range = part.elements[0]..part.elements[1];
            let (inside, before) = (
                &found.elements[range.clone()],
                &found.elements[..range.start],
            );
            let outside: Vec<u32> = before
                .iter()
                .chain(&found.elements[range.end..])
                .copied()
                .collect();
            let touched =
                |by: &[u32], node: u32| by.iter().any(|e| elements[*e as usize].contains(&node));
            let [first, end] = part.own;
            for &node in &found.nodes[first..end] {
                assert!(touched(inside, node) && !touched(&outside, node) && !kept.contains(&node));
            }
            let boundary: Vec<u32> = (end as u32..count as u32)
                .filter(|place| {
                    let node = found.nodes[*place as usize];
                    touched(inside, node) && (touched(&outside, node) || kept.contains(&node))
                })
                .collect();
            assert_eq!(found.boundary(number), boundary);
            match part.halves {
                None => assert!(range.len() <= LARGEST_LEAF),
                Some([a, b]) => {
                    let [a, b] = [a, b].map(|half| &found.parts[half]);
                    assert!(a.elements == [range.start, a.elements[1]]);
                    assert!(b.elements == [a.elements[1], range.end]);
                    assert_eq!([a.depth, b.depth], [part.depth + 1; 2]);
                }
            }
        }
        assert_eq!(
            found.parts.last().map(|part| part.elements),
            Some([0, elements.len()])
        );
    }

    /// A graded grid is dissected like an even one: only the number of lines matters, not where they are.
    #[test]
    fn a_graded_grid_is_dissected_as_an_even_one() {
        let graded: Vec<f64> = (0..=40).map(|i| 1.3f64.powi(i)).collect();
        let sizes = |x: &[f64], y: &[f64]| -> Vec<usize> {
            let (found, _) = dissect(x, y, &[]);
            (0..found.parts.len())
                .map(|part| found.boundary(part).len())
                .collect()
        };
        let even = sizes(&lines(40), &lines(40));
        assert_eq!(sizes(&graded, &lines(40)), even);
        // that of a 20 × 10 part with three sides inside
        assert_eq!(even.iter().max(), Some(&51));
    }

    /// A free mesh is dissected nearly as well as a grid: moving the nodes of a grid at random, so that no centres lie
    /// on lines, costs little.
    #[test]
    fn a_free_mesh_is_dissected_nearly_as_well_as_a_grid() {
        let (elements, mut positions) = grid(&lines(60), &lines(60));
        let unknown = vec![true; positions.len()];
        let cost = |positions: &[[f64; 2]]| {
            let (elements, unknown) = (&elements[..], &unknown[..]);
            let cells = Cells {
                elements,
                positions,
                unknown,
            };
            let found = Dissection::new(&cells, &[], 1);
            let entries = found.parts.iter().enumerate().map(|(number, part)| {
                let own = part.own[1] - part.own[0];
                own * (own + 1) / 2 + own * found.boundary(number).len()
            });
            entries.sum::<usize>()
        };
        let on_lines = cost(&positions);
        for (k, [x, y]) in positions.iter_mut().enumerate() {
            let (moved, angle) = (0.03, 0.4f64);
            let at = [
                *x + moved * (k as f64 * 1.7).sin(),
                *y + moved * (k as f64 * 2.3).cos(),
            ];
            *x = angle.cos() * at[0] - angle.sin() * at[1];
            *y = angle.sin() * at[0] + angle.cos() * at[1];
        }
        let moved = cost(&positions);
        assert!(4 * moved < 5 * on_lines, "{moved} {on_lines}");
    }

    /// A grid, and a bent one, whose halves are improved, are dissected equally on one thread and on two.
    #[test]
    fn two_threads_find_the_parts_of_one() {
        let (elements, mut positions) = grid(&lines(80), &lines(70));
        assert!(elements.len() > SMALLEST_SHARED);
        let unknown = vec![true; positions.len()];
        for bend in [0.0, 0.03] {
            for (k, [x, _]) in positions.iter_mut().enumerate() {
                *x += bend * (k as f64 * 1.7).sin();
            }
            let cells = Cells {
                elements: &elements,
                positions: &positions,
                unknown: &unknown,
            };
            let [one, two] = [1, 2].map(|threads| Dissection::new(&cells, &[7, 3], threads));
            assert_eq!(one.parts, two.parts);
            assert_eq!(one.elements, two.elements);
            assert_eq!(one.nodes, two.nodes);
            assert_eq!(one.boundaries, two.boundaries);
        }
    }

    #[test]
    fn a_strip_is_cut_across() {
        for (x, y) in [(1, 500), (500, 1), (3, 200)] {
            let (found, _) = dissect(&lines(x), &lines(y), &[]);
            let widest = (0..found.parts.len())
                .map(|part| found.boundary(part).len())
                .max();
            // two cuts across, and some nodes between them in the smallest parts
            assert!(widest <= Some(2 * (x.min(y) + 1) + 2), "{widest:?}");
            assert!(found.parts.iter().all(|part| part.depth <= 9));
        }
    }

    #[test]
    fn elements_with_the_same_centre_are_divided_too() {
        let elements: Vec<Vec<u32>> = (0..1000).map(|e| vec![e, 1000]).collect();
        let positions = vec![[1.0, 2.0]; 1001];
        let cells = Cells {
            elements: &elements,
            positions: &positions,
            unknown: &[true; 1001],
        };
        let found = Dissection::new(&cells, &[], 1);
        assert_eq!(found.nodes.len(), 1001);
        assert_eq!(found.nodes.last(), Some(&1000));
        assert!(found.parts.iter().all(|part| part.depth <= 8));
    }

    #[test]
    fn nodes_without_unknowns_and_without_elements_are_left_out() {
        let (elements, mut positions) = grid(&lines(4), &lines(4));
        positions.push([9.0, 9.0]);
        let mut unknown = vec![true; positions.len()];
        unknown[6] = false;
        let cells = Cells {
            elements: &elements,
            positions: &positions,
            unknown: &unknown,
        };
        let found = Dissection::new(&cells, &[6, 7], 1);
        assert_eq!(found.nodes.len(), 24);
        assert_eq!(found.nodes.last(), Some(&7));
        let nothing = Cells::<Vec<u32>> {
            elements: &[],
            positions: &[],
            unknown: &[],
        };
        assert_eq!(Dissection::new(&nothing, &[], 1).parts.len(), 1);
    }
}
