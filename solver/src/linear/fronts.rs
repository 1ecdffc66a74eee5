//! The structure of a factor by fronts, planned before it is made: which front owns which unknowns, where its columns go,
//! and what waits meanwhile (the module `multifrontal` says how fronts make a factor).

use std::ops::Range;

use super::dissection::Dissection;

/// Fronts of a lower depth are worked on one after the other, by all threads; each branch of the tree below them is left
/// to one thread. Two branches that hang on one front have about the same number of elements.
const SHARED_DEPTH: u32 = 3;

/// The structure of a factor.
pub struct Fronts {
    /// In the order of their elimination.
    pub(super) fronts: Vec<Front>,
    /// The same in groups, in the same order.
    pub(super) pieces: Vec<Piece>,
    /// Elements in the order of the parts that are not divided.
    pub(super) elements: Vec<u32>,
    /// Unknowns of all boundaries, those of each front ascending.
    rows: Vec<u32>,
    pub(super) unknowns: usize,
    pub(super) kept: usize,
    /// Numbers in the factor.
    pub(super) len: usize,
    /// The fronts above the branches: their widest columns, and what the two stacks hold at most.
    pub(super) above: Space,
    /// The same of the branches, each for itself.
    pub(super) branch: Space,
}

/// One front.
pub(super) struct Front {
    pub(super) halves: Option<[usize; 2]>,
    pub(super) elements: [usize; 2],
    /// The first unknown it owns.
    pub(super) first: usize,
    /// How many it owns.
    pub(super) own: usize,
    /// Its boundary: first and end in `rows`.
    rows: [usize; 2],
    /// Where its columns begin in the factor.
    pub(super) values: usize,
    /// The stack on which what it leaves waits: what its halves leave is on the other one.
    pub(super) stack: usize,
}

/// Fronts that one thread works on, one after the other.
pub(super) struct Piece {
    pub(super) fronts: Range<usize>,
    /// Whether it is a branch of the tree, or one of the fronts above.
    pub(super) branch: bool,
    /// Numbers in its columns of the factor.
    pub(super) len: usize,
}

/// What work on some fronts takes, in numbers.
#[derive(Clone, Copy, Default)]
pub(super) struct Space {
    /// The largest columns of a front.
    pub(super) widest: usize,
    /// The most that waits on each of the two stacks.
    pub(super) stacks: [usize; 2],
}

impl Space {
    /// Makes room for stacks of these sizes.
    fn hold(&mut self, stacks: [usize; 2]) {
        for (most, size) in self.stacks.iter_mut().zip(stacks) {
            *most = (*most).max(size);
        }
    }

    /// Divides memory: the columns, and the stacks.
    pub(super) fn divide<'a>(&self, values: &'a mut [f64]) -> (&'a mut [f64], [&'a mut [f64]; 2]) {
        let (columns, stacks) = values.split_at_mut(self.widest);
        let (even, odd) = stacks.split_at_mut(self.stacks[0]);
        (columns, [even, odd])
    }

    pub(super) fn len(&self) -> usize {
        self.widest + self.stacks[0] + self.stacks[1]
    }
}

impl Front {
    pub(super) fn boundary(&self) -> usize {
        self.rows[1] - self.rows[0]
    }

    pub(super) fn height(&self) -> usize {
        self.own + self.boundary()
    }

    /// Numbers in its columns of L, each from the diagonal on.
    pub(super) fn len(&self) -> usize {
        self.own * self.boundary() + self.own * (self.own + 1) / 2
    }
}

impl Fronts {
    /// Plans the factor; `kept`: how many nodes the dissection keeps, `unknowns_of` a node.
    pub fn new(dissection: Dissection, unknowns_of: impl Fn(u32) -> usize, kept: usize) -> Self {
        // the first unknown of every place
        let mut first = Vec::with_capacity(dissection.nodes.len() + 1);
        first.push(0);
        let mut unknowns = 0;
        for &node in &dissection.nodes {
            unknowns += unknowns_of(node);
            first.push(unknowns);
        }
        let eliminated = first[dissection.nodes.len() - kept];
        let (mut fronts, mut rows) = (Vec::with_capacity(dissection.parts.len()), Vec::new());
        let mut len = 0;
        for (number, part) in dissection.parts.iter().enumerate() {
            let start = rows.len();
            for &place in dissection.boundary(number) {
                let place = place as usize;
                rows.extend((first[place]..first[place + 1]).map(|row| row as u32));
            }
            let front = Front {
                halves: part.halves,
                elements: part.elements,
                first: first[part.own[0]],
                own: first[part.own[1]] - first[part.own[0]],
                rows: [start, rows.len()],
                values: len,
                stack: (part.depth % 2) as usize,
            };
            len += front.len();
            fronts.push(front);
        }
        let mut planned = Fronts {
            pieces: divide(&dissection, &fronts),
            fronts,
            len,
            elements: dissection.elements,
            rows,
            unknowns,
            kept: unknowns - eliminated,
            above: Space::default(),
            branch: Space::default(),
        };
        (planned.above, planned.branch) = planned.space();
        planned
    }

    /// What the fronts above the branches take, and the branches at most.
    fn space(&self) -> (Space, Space) {
        let (mut above, mut branches) = (Space::default(), Space::default());
        let mut tops = [0; 2];
        for piece in &self.pieces {
            let fronts = &self.fronts[piece.fronts.clone()];
            let space = match piece.branch {
                true => &mut branches,
                false => &mut above,
            };
            let columns = fronts.iter().map(|front| front.own * front.height());
            space.widest = columns.fold(space.widest, usize::max);
            // within a branch all but what it leaves waits on stacks of its own
            let Some((last, within)) = fronts.split_last() else {
                continue;
            };
            let mut own = [0; 2];
            for front in within {
                space.hold(self.put(front, &mut own));
                self.take_halves(front, &mut own);
            }
            // what the whole mesh leaves is Ŝ, and waits nowhere
            if piece.fronts.end < self.fronts.len() {
                above.hold(self.put(last, &mut tops));
                if !piece.branch {
                    self.take_halves(last, &mut tops);
                }
            }
        }
        (above, branches)
    }

    /// Puts what a front leaves on its stack; the sizes of both.
    fn put(&self, front: &Front, stacks: &mut [usize; 2]) -> [usize; 2] {
        stacks[front.stack] += front.boundary().pow(2);
        *stacks
    }

    /// Takes what its halves have left from the other stack.
    fn take_halves(&self, front: &Front, stacks: &mut [usize; 2]) {
        for half in front.halves.into_iter().flatten() {
            stacks[1 - front.stack] -= self.fronts[half].boundary().pow(2);
        }
    }

    /// What the factor takes, and what waits while it is made on so many threads (bytes).
    pub fn bytes(&self, threads: usize) -> u64 {
        8 * (self.len + self.above.len() + threads * self.branch.len()) as u64
    }

    /// Rows of the tallest front.
    pub(super) fn tallest(&self) -> usize {
        self.fronts.iter().map(Front::height).max().unwrap_or(0)
    }

    /// Whether a second thread is worth its start.
    pub fn is_large(&self) -> bool {
        /// Numbers in the factor: it takes some tenths of a second.
        const LARGE: usize = 5_000_000;
        self.len > LARGE
    }

    /// Number of those that are kept.
    pub fn kept(&self) -> usize {
        self.kept
    }

    pub(super) fn rows(&self, front: &Front) -> &[u32] {
        &self.rows[front.rows[0]..front.rows[1]]
    }
}

/// Divides fronts into pieces.
fn divide(dissection: &Dissection, fronts: &[Front]) -> Vec<Piece> {
    let mut pieces: Vec<Piece> = Vec::new();
    let mut start = 0;
    for (number, part) in dissection.parts.iter().enumerate() {
        let whole = number + 1 == dissection.parts.len();
        let ends_branch = match part.halves {
            _ if whole || part.depth > SHARED_DEPTH => false,
            Some(_) => part.depth == SHARED_DEPTH,
            None => true,
        };
        let above = whole || (part.depth < SHARED_DEPTH && part.halves.is_some());
        if !ends_branch && !above {
            continue;
        }
        pieces.push(Piece {
            fronts: start..number + 1,
            branch: ends_branch,
            len: fronts[start..=number].iter().map(Front::len).sum(),
        });
        start = number + 1;
    }
    pieces
}
