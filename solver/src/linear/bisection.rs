//! Improves the two halves of a part of a mesh: elements move to the other half as long as fewer nodes then belong to
//! both (Fiduccia and Mattheyses, 1982).
//!
//! In each round, of all elements with a node in both halves the element that leaves the fewest such nodes moves first,
//! even if the number of these nodes increases; each element moves once. Then all moves after the best state are
//! undone. Rounds are repeated until a round brings no improvement.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::ops::Deref;

/// The share of the elements that each half keeps at least, unless it has fewer from the start.
const SMALLEST_SHARE: f64 = 0.4;

/// The largest number of rounds.
const ROUNDS: usize = 4;

/// The number of moves without a better state after which a round ends.
const PATIENCE: usize = 60;

/// A mesh, and the data of its elements while a part of it is improved.
pub(super) struct Bisection<'a, E> {
    elements: &'a [E],
    /// The elements of every node: those of node n are `around[starts[n]..starts[n + 1]]`.
    starts: Vec<u32>,
    around: Vec<u32>,
    /// By element: a number that identifies the part and the half that the element was last in.
    half: Vec<u32>,
    /// By element: the stamp of the round in which the element last moved.
    went: Vec<u32>,
    /// By element: the stamp of the round in which the element's gain was last computed.
    known: Vec<u32>,
    /// By element: the stamp of the last move after which the element's gain was computed anew.
    seen: Vec<u32>,
    stamp: u32,
    /// By element: by how much the number of nodes in both halves decreases if the element moves.
    gains: Vec<i32>,
    /// By node: the number of the node's elements in each half.
    counts: Vec<[u32; 2]>,
    waiting: BinaryHeap<(i32, Reverse<u32>)>,
    gone: Vec<u32>,
}

impl<'a, E: Deref<Target = [u32]>> Bisection<'a, E> {
    pub(super) fn new(elements: &'a [E], nodes: usize) -> Self {
        let mut starts = vec![0u32; nodes + 1];
        let all = || elements.iter().enumerate();
        for (_, element) in all() {
            element
                .iter()
                .for_each(|node| starts[*node as usize + 1] += 1);
        }
        for node in 0..nodes {
            starts[node + 1] += starts[node];
        }
        let mut next = starts.clone();
        let mut around = vec![0; starts[nodes] as usize];
        for (e, element) in all() {
            for &node in element.iter() {
                let place = &mut next[node as usize];
                around[*place as usize] = e as u32;
                *place += 1;
            }
        }
        let count = elements.len();
        Bisection {
            elements,
            starts,
            around,
            half: vec![0; count],
            went: vec![0; count],
            known: vec![0; count],
            seen: vec![0; count],
            stamp: 0,
            gains: vec![0; count],
            counts: vec![[0; 2]; nodes],
            waiting: BinaryHeap::new(),
            gone: Vec::new(),
        }
    }

    /// Improves the halves of a part, given as the first `middle` elements of `part` and the others; returns the new
    /// size of the first half. Only nodes that are `free` count.
    pub(super) fn improve(&mut self, part: &mut [u32], middle: usize, free: &[bool]) -> usize {
        let all = self.elements;
        let low = self.next_stamp();
        let high = self.next_stamp();
        for &e in part.iter() {
            all[e as usize]
                .iter()
                .for_each(|node| self.counts[*node as usize] = [0; 2]);
        }
        for (i, &e) in part.iter().enumerate() {
            let half = usize::from(i >= middle);
            self.half[e as usize] = [low, high][half];
            for &node in all[e as usize].iter() {
                self.counts[node as usize][half] += 1;
            }
        }
        let mut sizes = [middle, part.len() - middle];
        let least = (SMALLEST_SHARE * part.len() as f64) as usize;
        let least = least.min(sizes[0]).min(sizes[1]);
        for _ in 0..ROUNDS {
            if !self.round(part, [low, high], &mut sizes, least, free) {
                break;
            }
        }
        let mut first = 0;
        for i in 0..part.len() {
            if self.half[part[i] as usize] == low {
                part.swap(first, i);
                first += 1;
            }
        }
        first
    }

    /// Lets each element move once; returns whether fewer nodes are in both halves afterwards.
    fn round(
        &mut self,
        part: &[u32],
        halves: [u32; 2],
        sizes: &mut [usize; 2],
        least: usize,
        free: &[bool],
    ) -> bool {
        let all = self.elements;
        let round = self.next_stamp();
        self.waiting.clear();
        self.gone.clear();
        for &e in part {
            let in_both = |node: &u32| {
                let [low, high] = self.counts[*node as usize];
                low > 0 && high > 0 && free[*node as usize]
            };
            if all[e as usize].iter().any(in_both) {
                self.wait(e, round, halves, free);
            }
        }
        let difference = |sizes: &[usize; 2]| sizes[0].abs_diff(sizes[1]);
        let (mut gain, mut best, mut until) = (0, (0, Reverse(difference(sizes))), 0);
        while let Some((of_element, Reverse(e))) = self.waiting.pop() {
            let own = e as usize;
            let half = usize::from(self.half[own] == halves[1]);
            let outdated = self.went[own] == round || self.gains[own] != of_element;
            if outdated || sizes[half] <= least {
                continue;
            }
            self.went[own] = round;
            self.gone.push(e);
            gain += of_element;
            let this = self.next_stamp();
            self.go(e, halves, sizes);
            for &node in all[own].iter() {
                let counts = self.counts[node as usize];
                // else it makes no difference to any element
                let matters = counts[half] < 2 || counts[1 - half] < 3;
                if !matters || !free[node as usize] {
                    continue;
                }
                for k in self.starts[node as usize]..self.starts[node as usize + 1] {
                    let other = self.around[k as usize];
                    let place = other as usize;
                    let in_part = halves.contains(&self.half[place]);
                    if in_part && self.went[place] != round && self.seen[place] != this {
                        self.seen[place] = this;
                        self.wait(other, round, halves, free);
                    }
                }
            }
            let state = (gain, Reverse(difference(sizes)));
            if state > best {
                (best, until) = (state, self.gone.len());
            }
            if self.gone.len() - until > PATIENCE {
                break;
            }
        }
        for k in (until..self.gone.len()).rev() {
            self.go(self.gone[k], halves, sizes);
        }
        best.0 > 0
    }

    /// Adds an element to those that may move, unless it is waiting with the same gain already.
    fn wait(&mut self, e: u32, round: u32, halves: [u32; 2], free: &[bool]) {
        let place = e as usize;
        let half = usize::from(self.half[place] == halves[1]);
        let gains = self.elements[place].iter().map(|&node| {
            let counts = self.counts[node as usize];
            match (free[node as usize], counts[half], counts[1 - half]) {
                (false, ..) | (true, 1, 0) => 0,
                (true, _, 0) => -1,
                (true, own, _) => i32::from(own == 1),
            }
        });
        let gain = gains.sum();
        if self.known[place] != round || self.gains[place] != gain {
            self.known[place] = round;
            self.gains[place] = gain;
            self.waiting.push((gain, Reverse(e)));
        }
    }

    /// Moves an element to the other half.
    fn go(&mut self, e: u32, halves: [u32; 2], sizes: &mut [usize; 2]) {
        let half = usize::from(self.half[e as usize] == halves[1]);
        self.half[e as usize] = halves[1 - half];
        sizes[half] -= 1;
        sizes[1 - half] += 1;
        for &node in self.elements[e as usize].iter() {
            let counts = &mut self.counts[node as usize];
            counts[half] -= 1;
            counts[1 - half] += 1;
        }
    }

    fn next_stamp(&mut self) -> u32 {
        self.stamp += 1;
        self.stamp
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::dissection::tests::{grid, lines};

    /// The number of nodes in both halves.
    fn shared(elements: &[Vec<u32>], low: &[u32], high: &[u32], free: &[bool]) -> usize {
        let has =
            |part: &[u32], node: u32| part.iter().any(|e| elements[*e as usize].contains(&node));
        let nodes = 0..free.len() as u32;
        let in_both = |node: &u32| free[*node as usize] && has(low, *node) && has(high, *node);
        nodes.filter(in_both).count()
    }

    /// The numbers of nodes that two halves of a grid of 20 × 20 cells share before and after the improvement, and the
    /// number of elements of each half after it; `first`: whether the cell in a column and a row is in the first half
    /// before.
    fn improved(free: &[bool], first: impl Fn(usize, usize) -> bool) -> (usize, usize, [usize; 2]) {
        let (elements, positions) = grid(&lines(20), &lines(20));
        let (mut part, high): (Vec<u32>, Vec<u32>) =
            (0..400).partition(|e| first(*e as usize % 20, *e as usize / 20));
        let before = shared(&elements, &part, &high, free);
        let middle = part.len();
        part.extend(high);
        let mut halves = Bisection::new(&elements, positions.len());
        let middle = halves.improve(&mut part, middle, free);
        let (low, high) = part.split_at(middle);
        let after = shared(&elements, low, high, free);
        let mut all = part.clone();
        all.sort_unstable();
        assert!(all.into_iter().eq(0..400), "no element is lost");
        (before, after, [low.len(), high.len()])
    }

    #[test]
    fn a_jagged_cut_becomes_straight() {
        let teeth = |x: usize, y: usize| x < 10 + y % 3;
        let (before, after, sizes) = improved(&[true; 441], teeth);
        assert!(before > 27, "{before}");
        assert_eq!(after, 21);
        assert!(sizes.iter().all(|size| *size >= 160), "{sizes:?}");
    }

    /// Bisection stay within their share and do not get worse: the diagonal of a square is longer than its side, but no
    /// small step from it is shorter.
    #[test]
    fn halves_stay_within_their_share_and_become_no_worse() {
        let (before, after, sizes) = improved(&[true; 441], |x, y| x < y || (x == y && x < 10));
        assert!(after <= before, "{before} {after}");
        assert!(sizes.iter().all(|size| *size >= 160), "{sizes:?}");
        // halves that are smaller from the beginning become no smaller
        let (before, after, sizes) = improved(&[true; 441], |x, y| x < 4 && y < 5);
        assert!(after <= before && sizes[0] >= 20, "{sizes:?}");
    }

    #[test]
    fn nodes_that_are_not_free_cost_nothing() {
        // those of three columns have gone: a cut there is for nothing
        let free: Vec<bool> = (0..441)
            .map(|node| !(9..12).contains(&(node % 21)))
            .collect();
        let (before, after, _) = improved(&free, |x, y| x < 11 + y % 3);
        assert!(before > 0);
        assert_eq!(after, 0);
    }

    #[test]
    fn the_best_cut_stays() {
        let (before, after, sizes) = improved(&[true; 441], |x, _| x < 10);
        assert_eq!((before, after, sizes), (21, 21, [200; 2]));
    }

    /// One node may have more elements than a number of 16 bits holds, as in a fan of triangles.
    #[test]
    fn one_node_may_have_very_many_elements() {
        let elements: Vec<Vec<u32>> = (0..140_000).map(|e| vec![e, 140_000]).collect();
        let mut part: Vec<u32> = (0..140_000).collect();
        let mut halves = Bisection::new(&elements, 140_001);
        assert_eq!(halves.improve(&mut part, 70_000, &[true; 140_001]), 70_000);
    }
}
