//! The plan of a factor by fronts: which front owns which unknowns, where its columns are stored, and where Schur
//! complements wait (the module `multifrontal` explains how fronts make a factor).
//!
//! Of equal fronts only the first one is computed. If several fronts need its Schur complement, this waits in a *slot*
//! until the last of them has used it.

use std::ops::{Deref, Range};

use super::dissection::Dissection;
use super::equal_parts::find_equal_parts;

/// The depth in the tree at which branches begin. Fronts above are computed one after another, each by all threads;
/// every branch is computed by one thread, and two branches of one front have about the same number of elements. A
/// front that several others need is computed by one thread, with all that it depends on, at any depth.
const SHARED_DEPTH: u32 = 3;

/// A factor with more values than this takes some tenths of a second, so that a second thread is worth its start.
const LARGE: usize = 5_000_000;

/// The plan of a factor by fronts.
pub struct Fronts {
    /// The fronts in the order of their elimination.
    pub(super) fronts: Vec<Front>,
    /// The fronts in groups, in the order of their elimination.
    pub(super) pieces: Vec<Piece>,
    /// The fronts that are computed, in the order of their columns in the factor.
    pub(super) order: Vec<u32>,
    /// The stages of the computation, one after another.
    pub(super) stages: Vec<Stage>,
    /// The places for Schur complements that several fronts need.
    pub(super) slots: Vec<Slot>,
    /// The elements in the order of the parts that are not divided.
    pub(super) elements: Vec<u32>,
    /// The unknowns of the boundaries of all fronts; those of each front are ascending, or in the order of the first
    /// front that equals it.
    rows: Vec<u32>,
    pub(super) unknowns: usize,
    pub(super) kept: usize,
    /// The number of values in the factor.
    pub(super) len: usize,
    /// The number of values in the columns of all fronts: larger than `len` if some fronts are equal.
    len_of_all: usize,
    /// The memory for the fronts above the branches: the widest columns, and the largest size of the two stacks.
    pub(super) above: Space,
    /// The memory for one branch: the widest columns, and the largest size of the two stacks.
    pub(super) branch: Space,
    /// The largest size of all slots at one time.
    in_slots: usize,
}

/// One front of the factor: the dense matrix of a part of the dissection.
pub(super) struct Front {
    pub(super) halves: Option<[usize; 2]>,
    pub(super) elements: [usize; 2],
    /// The first unknown that the front owns.
    pub(super) first: usize,
    /// The number of unknowns that the front owns.
    pub(super) own: usize,
    /// The range of the front's boundary in [`Fronts::rows`]: first and end.
    rows: [usize; 2],
    /// The place in the factor where the front's columns begin.
    pub(super) values: usize,
    /// The stack for the front's Schur complement if it has no slot; those of its halves are on the other stack.
    pub(super) stack: usize,
    /// The slot for the front's Schur complement, if several fronts need it.
    pub(super) slot: Option<usize>,
}

/// A place where the Schur complement of a front waits for several other fronts.
pub(super) struct Slot {
    /// The number of values in the slot.
    pub(super) len: usize,
    /// The stage in which the slot is used for the last time.
    pub(super) last_stage: usize,
}

/// Fronts with consecutive unknowns.
pub(super) struct Piece {
    pub(super) fronts: Range<usize>,
    /// Whether the piece is a branch of the tree rather than a front above the branches.
    pub(super) branch: bool,
}

/// One stage of the computation: a front that all threads share, or several independent tasks.
pub(super) enum Stage {
    /// One front above the branches, computed by all threads.
    Above(Task),
    /// Tasks that are each computed by one thread.
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

/// Fronts that one thread computes one after another; the last front uses the Schur complements of the others.
pub(super) struct Task {
    /// The range of the task's fronts in [`Fronts::order`].
    pub(super) fronts: Range<usize>,
    /// The number of values in the fronts' columns of the factor.
    pub(super) len: usize,
}

/// The memory for working on some fronts, in numbers of values.
#[derive(Clone, Copy, Default)]
pub(super) struct Space {
    /// The largest size of the columns of a front.
    pub(super) widest: usize,
    /// The largest size of each of the two stacks.
    pub(super) stacks: [usize; 2],
}

impl Space {
    /// Enlarges the stacks to hold the sizes `stacks`.
    fn hold(&mut self, stacks: [usize; 2]) {
        for (most, size) in self.stacks.iter_mut().zip(stacks) {
            *most = (*most).max(size);
        }
    }

    /// Divides a piece of memory into the columns and the two stacks.
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

    /// The number of values in the front's columns of L, each from the diagonal on.
    pub(super) fn len(&self) -> usize {
        self.own * self.boundary() + self.own * (self.own + 1) / 2
    }
}

impl Fronts {
    /// Plans the factor. `kinds`: a number for each element, equal for elements with the same matrix and the same
    /// unknown nodes, or `None`. `unknowns_of`: the number of unknowns of a node. `kept`: the number of nodes that the
    /// dissection does not eliminate.
    pub fn new<E: Deref<Target = [u32]>>(
        mut dissection: Dissection,
        elements: &[E],
        kinds: &[Option<u32>],
        unknowns_of: impl Fn(u32) -> usize,
        kept: usize,
    ) -> Self {
        let first_equal = find_equal_parts(&mut dissection, elements, kinds);
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
        planned.find_slots(&first_equal);
        planned.find_stages(&first_equal);
        planned.place_columns(&first_equal);
        planned.find_last_stages();
        planned.find_space();
        planned
    }

    /// Assigns slots to Schur complements that several fronts need.
    fn find_slots(&mut self, first_equal: &[usize]) {
        let mut takers = vec![0u8; self.fronts.len()];
        for number in firsts(first_equal) {
            for half in self.fronts[number].halves.into_iter().flatten() {
                let takers = &mut takers[first_equal[half]];
                *takers = takers.saturating_add(1);
            }
        }
        for number in 0..self.fronts.len() {
            let first = first_equal[number];
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

    /// Plans the stages: first the fronts with slots, each after the fronts that it depends on; then the others.
    fn find_stages(&mut self, first_equal: &[usize]) {
        let mut stage_of = vec![0; self.fronts.len()];
        let mut stages: Vec<Vec<usize>> = Vec::new();
        for number in firsts(first_equal) {
            let halves = self.fronts[number].halves.into_iter().flatten();
            let needed = halves.map(|half| match self.fronts[half].slot {
                None => stage_of[half],
                Some(_) => stage_of[first_equal[half]] + 1,
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
                if first_equal[top] == top && !placed[top] {
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

    /// Appends a front to the order, after the fronts whose Schur complements it takes from the stacks, if these are
    /// not in the order yet.
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

    fn place_columns(&mut self, first_equal: &[usize]) {
        for &number in &self.order {
            let front = &mut self.fronts[number as usize];
            front.values = self.len;
            self.len += front.len();
        }
        for (number, &first) in first_equal.iter().enumerate() {
            self.fronts[number].values = self.fronts[first].values;
            self.len_of_all += self.fronts[number].len();
        }
    }

    /// Finds the stage after which each slot is free again.
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

    /// Computes the memory for the fronts above the branches, for the largest branch, and for the slots.
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
                let space = if is_above { &mut above } else { &mut branches };
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

    /// The largest size of all slots at one time.
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

    /// Adds the Schur complement of a front to the sizes of the stacks; returns both sizes.
    fn put(&self, front: &Front, stacks: &mut [usize; 2]) -> [usize; 2] {
        if front.slot.is_none() {
            stacks[front.stack] += front.boundary().pow(2);
        }
        *stacks
    }

    /// Removes the Schur complements of both halves of a front from the sizes of the stacks.
    fn take_halves(&self, front: &Front, stacks: &mut [usize; 2]) {
        for half in front.halves.into_iter().flatten() {
            let half = &self.fronts[half];
            if half.slot.is_none() {
                stacks[half.stack] -= half.boundary().pow(2);
            }
        }
    }

    /// The memory for the factor and for its computation on `threads` threads, with the places of unknowns in fronts
    /// (bytes).
    pub fn bytes(&self, threads: usize) -> u64 {
        let waits = self.above.len() + threads * self.branch.len() + self.in_slots;
        let places = (threads + 1) * self.unknowns;
        8 * (self.len + waits) as u64 + 4 * places as u64
    }

    /// The number of rows of the tallest front.
    pub(super) fn tallest(&self) -> usize {
        self.fronts.iter().map(Front::height).max().unwrap_or(0)
    }

    /// Whether the factor is so large that computing it is worth a second thread.
    pub fn is_large(&self) -> bool {
        self.len > LARGE
    }

    /// Whether the fronts are so large that computing fields, which pass through all fronts, is worth a second thread.
    pub(super) fn has_large_fields(&self) -> bool {
        self.len_of_all > LARGE
    }

    /// The number of unknowns that are not eliminated.
    pub fn kept(&self) -> usize {
        self.kept
    }

    pub(super) fn rows(&self, front: &Front) -> &[u32] {
        &self.rows[front.rows[0]..front.rows[1]]
    }
}

/// The numbers of the fronts that equal no earlier front.
fn firsts(first_equal: &[usize]) -> impl Iterator<Item = usize> {
    let all = first_equal.iter().enumerate();
    all.filter(|(number, first)| number == *first)
        .map(|(number, _)| number)
}

/// Divides the fronts into pieces: branches, and the fronts above them.
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
