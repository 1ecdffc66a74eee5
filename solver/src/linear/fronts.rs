//! The structure of a factor by fronts, planned before it is made: which front owns which unknowns, where its columns go,
//! and what waits meanwhile (the module `multifrontal` says how fronts make a factor).
//!
//! Of fronts that are alike only the first is worked on. What it leaves has a *slot*, if several fronts take it, and waits
//! there for the last of them.

use std::ops::{Deref, Range};

use super::alike::find_alike;
use super::dissection::Dissection;

/// Fronts of a lower depth are worked on one after the other, by all threads; each branch of the tree below them is left
/// to one thread. Two branches that hang on one front have about the same number of elements. A front that several take is
/// left to one thread with all that it needs, however high it stands.
const SHARED_DEPTH: u32 = 3;

/// So many numbers take some tenths of a second.
const LARGE: usize = 5_000_000;

/// The structure of a factor.
pub struct Fronts {
    /// In the order of their elimination.
    pub(super) fronts: Vec<Front>,
    /// The same in groups, in the same order.
    pub(super) pieces: Vec<Piece>,
    /// Those to be worked on, in the order of their columns in the factor.
    pub(super) order: Vec<u32>,
    /// What is done one after the other.
    pub(super) stages: Vec<Stage>,
    /// What waits for several fronts.
    pub(super) slots: Vec<Slot>,
    /// Elements in the order of the parts that are not divided.
    pub(super) elements: Vec<u32>,
    /// Unknowns of all boundaries: those of each front ascending, or in the order of the first front that it is like.
    rows: Vec<u32>,
    pub(super) unknowns: usize,
    pub(super) kept: usize,
    /// Numbers in the factor.
    pub(super) len: usize,
    /// Numbers in the columns of all fronts: more, if some are alike.
    len_of_all: usize,
    /// The fronts above the branches: their widest columns, and what the two stacks hold at most.
    pub(super) above: Space,
    /// The same of the branches, each for itself.
    pub(super) branch: Space,
    /// The most that the slots hold at once.
    in_slots: usize,
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
    /// The stack on which what it leaves waits, without a slot: what its halves leave is on the other one.
    pub(super) stack: usize,
    /// The slot in which it waits, if several fronts take it.
    pub(super) slot: Option<usize>,
}

/// Where what a front leaves waits for several others.
pub(super) struct Slot {
    /// Numbers in it.
    pub(super) len: usize,
    /// The stage in which it is taken for the last time.
    pub(super) last_stage: usize,
}

/// Fronts of unknowns that follow each other.
pub(super) struct Piece {
    pub(super) fronts: Range<usize>,
    /// Whether it is a branch of the tree, or one of the fronts above.
    pub(super) branch: bool,
}

/// Work on one front that all threads share, or several tasks that do not depend on each other.
pub(super) enum Stage {
    /// One front above the branches.
    Above(Task),
    /// Each is left to one thread.
    Each(Vec<Task>),
}

impl Stage {
    fn tasks(&self) -> &[Task] {
        match self {
            Stage::Above(task) => std::slice::from_ref(task),
            Stage::Each(tasks) => tasks,
        }
    }
}

/// Fronts that one thread works on, one after the other: the last one takes what the others leave.
pub(super) struct Task {
    /// First and end in `order`.
    pub(super) fronts: Range<usize>,
    /// Numbers in their columns of the factor.
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
    /// Plans the factor; `kept`: how many nodes the dissection keeps, `unknowns_of` a node; `kinds`: numbers that are equal
    /// for elements with the same matrix, if there are several.
    pub fn new<E: Deref<Target = [u32]>>(
        mut dissection: Dissection,
        elements: &[E],
        kinds: &[Option<u32>],
        unknowns_of: impl Fn(u32) -> usize,
        kept: usize,
    ) -> Self {
        let first_alike = find_alike(&mut dissection, elements, kinds);
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
        for (number, part) in dissection.parts.iter().enumerate() {
            let start = rows.len();
            for &place in dissection.boundary(number) {
                let place = place as usize;
                rows.extend((first[place]..first[place + 1]).map(|row| row as u32));
            }
            fronts.push(Front {
                halves: part.halves,
                elements: part.elements,
                first: first[part.own[0]],
                own: first[part.own[1]] - first[part.own[0]],
                rows: [start, rows.len()],
                values: 0,
                stack: (part.depth % 2) as usize,
                slot: None,
            });
        }
        let mut planned = Fronts {
            pieces: divide(&dissection),
            fronts,
            order: Vec::new(),
            stages: Vec::new(),
            slots: Vec::new(),
            len: 0,
            len_of_all: 0,
            elements: dissection.elements,
            rows,
            unknowns,
            kept: unknowns - eliminated,
            above: Space::default(),
            branch: Space::default(),
            in_slots: 0,
        };
        planned.find_slots(&first_alike);
        planned.find_stages(&first_alike);
        planned.place_columns(&first_alike);
        planned.find_last_stages();
        planned.find_space();
        planned
    }

    /// What several fronts take waits in slots.
    fn find_slots(&mut self, first_alike: &[usize]) {
        let mut takers = vec![0u8; self.fronts.len()];
        for number in firsts(first_alike) {
            for half in self.fronts[number].halves.into_iter().flatten() {
                let takers = &mut takers[first_alike[half]];
                *takers = takers.saturating_add(1);
            }
        }
        for number in 0..self.fronts.len() {
            let first = first_alike[number];
            if takers[first] < 2 {
                continue;
            }
            let slot = self.fronts[first].slot.unwrap_or_else(|| {
                self.slots.push(Slot {
                    len: self.fronts[first].boundary().pow(2),
                    last_stage: 0,
                });
                self.slots.len() - 1
            });
            self.fronts[number].slot = Some(slot);
        }
    }

    /// First what goes to slots, in stages, each after those that it needs; then the rest.
    fn find_stages(&mut self, first_alike: &[usize]) {
        let mut stage_of = vec![0; self.fronts.len()];
        let mut stages: Vec<Vec<usize>> = Vec::new();
        for number in firsts(first_alike) {
            let halves = self.fronts[number].halves.into_iter().flatten();
            let needed = halves.map(|half| match self.fronts[half].slot {
                None => stage_of[half],
                Some(_) => stage_of[first_alike[half]] + 1,
            });
            let stage = needed.max().unwrap_or(0);
            stage_of[number] = stage;
            if self.fronts[number].slot.is_some() {
                stages.resize_with(stages.len().max(stage + 1), Vec::new);
                stages[stage].push(number);
            }
        }
        let mut placed = vec![false; self.fronts.len()];
        for tops in stages {
            let tasks = tops.into_iter().map(|top| {
                let start = self.order.len();
                self.place_with_halves(top, &mut placed);
                self.task(start)
            });
            let tasks = tasks.collect();
            self.stages.push(Stage::Each(tasks));
        }
        let pieces = std::mem::take(&mut self.pieces);
        for group in pieces.chunk_by(|a, b| a.branch && b.branch) {
            let mut tasks = Vec::with_capacity(group.len());
            for piece in group {
                let start = self.order.len();
                let top = piece.fronts.end - 1;
                if first_alike[top] == top && !placed[top] {
                    self.place_with_halves(top, &mut placed);
                    tasks.push(self.task(start));
                }
            }
            match group {
                [piece] if !piece.branch => {
                    self.stages.extend(tasks.pop().map(Stage::Above));
                }
                _ if tasks.is_empty() => {}
                _ => self.stages.push(Stage::Each(tasks)),
            }
        }
        self.pieces = pieces;
    }

    /// Puts a front to the end of the order, after those not there yet whose columns it takes from the stacks.
    fn place_with_halves(&mut self, top: usize, placed: &mut [bool]) {
        for half in self.fronts[top].halves.into_iter().flatten() {
            if self.fronts[half].slot.is_none() && !placed[half] {
                self.place_with_halves(half, placed);
            }
        }
        placed[top] = true;
        self.order.push(top as u32);
    }

    fn task(&self, start: usize) -> Task {
        let fronts = start..self.order.len();
        let numbers = self.order[fronts.clone()].iter();
        let len = numbers.map(|number| self.fronts[*number as usize].len());
        Task {
            len: len.sum(),
            fronts,
        }
    }

    fn place_columns(&mut self, first_alike: &[usize]) {
        for &number in &self.order {
            let front = &mut self.fronts[number as usize];
            front.values = self.len;
            self.len += front.len();
        }
        for (number, &first) in first_alike.iter().enumerate() {
            self.fronts[number].values = self.fronts[first].values;
            self.len_of_all += self.fronts[number].len();
        }
    }

    /// The stages after which slots are free again.
    fn find_last_stages(&mut self) {
        for (k, stage) in self.stages.iter().enumerate() {
            let fronts = stage.tasks().iter().flat_map(|task| task.fronts.clone());
            for place in fronts {
                let front = &self.fronts[self.order[place] as usize];
                for half in front.halves.into_iter().flatten() {
                    if let Some(slot) = self.fronts[half].slot {
                        self.slots[slot].last_stage = k;
                    }
                }
            }
        }
    }

    /// What the fronts above the branches take, the branches at most, and the slots.
    fn find_space(&mut self) {
        let (mut above, mut branches) = (Space::default(), Space::default());
        let mut tops = [0; 2];
        let whole = self.fronts.len() - 1;
        for stage in &self.stages {
            let is_above = matches!(stage, Stage::Above(_));
            for task in stage.tasks() {
                let fronts = self.order[task.fronts.clone()].iter();
                let fronts: Vec<&Front> = fronts.map(|n| &self.fronts[*n as usize]).collect();
                let columns = fronts.iter().map(|front| front.own * front.height());
                let space = match is_above {
                    true => &mut above,
                    false => &mut branches,
                };
                space.widest = columns.fold(space.widest, usize::max);
                // all but what the last one leaves waits on stacks of the task's own
                let Some((last, within)) = fronts.split_last() else {
                    continue;
                };
                let mut own = [0; 2];
                for front in within {
                    space.hold(self.put(front, &mut own));
                    self.take_halves(front, &mut own);
                }
                let is_whole = std::ptr::eq(*last, &self.fronts[whole]);
                // what the whole mesh leaves is Ŝ, and waits nowhere
                if !is_whole {
                    above.hold(self.put(last, &mut tops));
                    if is_above {
                        self.take_halves(last, &mut tops);
                    }
                }
            }
        }
        (self.above, self.branch) = (above, branches);
        self.in_slots = self.most_in_slots();
    }

    /// The most that the slots hold at once.
    fn most_in_slots(&self) -> usize {
        let (mut most, mut held) = (0, 0);
        for (k, stage) in self.stages.iter().enumerate() {
            let filled = self.slots_of(stage).map(|slot| self.slots[slot].len);
            held += filled.sum::<usize>();
            most = most.max(held);
            let freed = self.slots.iter().filter(|slot| slot.last_stage == k);
            held -= freed.map(|slot| slot.len).sum::<usize>();
        }
        most
    }

    /// The slots that a stage fills, in the order of its tasks.
    pub(super) fn slots_of(&self, stage: &Stage) -> impl Iterator<Item = usize> {
        let tasks = stage.tasks().iter();
        tasks.filter_map(|task| self.last(task).slot)
    }

    /// The last front of a task.
    pub(super) fn last(&self, task: &Task) -> &Front {
        &self.fronts[self.order[task.fronts.end - 1] as usize]
    }

    /// Puts what a front leaves on its stack; the sizes of both.
    fn put(&self, front: &Front, stacks: &mut [usize; 2]) -> [usize; 2] {
        if front.slot.is_none() {
            stacks[front.stack] += front.boundary().pow(2);
        }
        *stacks
    }

    /// Takes what its halves have left from their stack.
    fn take_halves(&self, front: &Front, stacks: &mut [usize; 2]) {
        for half in front.halves.into_iter().flatten() {
            let half = &self.fronts[half];
            if half.slot.is_none() {
                stacks[half.stack] -= half.boundary().pow(2);
            }
        }
    }

    /// What the factor takes, and what waits while it is made on so many threads, with the places of unknowns in fronts
    /// (bytes).
    pub fn bytes(&self, threads: usize) -> u64 {
        let waits = self.above.len() + threads * self.branch.len() + self.in_slots;
        let places = (threads + 1) * self.unknowns;
        8 * (self.len + waits) as u64 + 4 * places as u64
    }

    /// Rows of the tallest front.
    pub(super) fn tallest(&self) -> usize {
        self.fronts.iter().map(Front::height).max().unwrap_or(0)
    }

    /// Whether a second thread is worth its start for a factor.
    pub fn is_large(&self) -> bool {
        self.len > LARGE
    }

    /// Whether it is for fields, which go through all fronts.
    pub(super) fn has_large_fields(&self) -> bool {
        self.len_of_all > LARGE
    }

    /// Number of those that are kept.
    pub fn kept(&self) -> usize {
        self.kept
    }

    pub(super) fn rows(&self, front: &Front) -> &[u32] {
        &self.rows[front.rows[0]..front.rows[1]]
    }
}

/// The fronts that no earlier one is like.
fn firsts(first_alike: &[usize]) -> impl Iterator<Item = usize> {
    let all = first_alike.iter().enumerate();
    all.filter(|(number, first)| number == *first)
        .map(|(number, _)| number)
}

/// Divides fronts into pieces.
fn divide(dissection: &Dissection) -> Vec<Piece> {
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
        });
        start = number + 1;
    }
    pieces
}
