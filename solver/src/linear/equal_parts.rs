//! Finds equal parts of a dissection: parts with elements of the same kinds, connected in the same way. They have the
//! same Schur complement and the same columns of the factor. A grid between equidistant lines has few different parts.

use std::collections::HashMap;
use std::ops::Deref;

use super::dissection::Dissection;

/// Marks a node that is not in the first half.
const NEW: u32 = u32::MAX;

/// For each part, the number of the first part that equals it. The own nodes of equal parts are in the same order
/// already; the boundaries of later parts are put into the order of the first one.
///
/// `kinds`: a number for each element; elements with the same number have the same matrix and the same unknown nodes.
/// An element without a number equals no other.
pub(super) fn find_equal_parts<E: Deref<Target = [u32]>>(
    dissection: &mut Dissection,
    elements: &[E],
    kinds: &[Option<u32>],
) -> Vec<usize> {
    let mut search = Search {
        place: vec![
            None;
            elements
                .iter()
                .flat_map(|e| e.iter())
                .max()
                .map_or(0, |n| *n as usize + 1)
        ],
        numbers: vec![(0, 0); dissection.nodes.len()],
        stamp: 0,
        places: Vec::new(),
        key: Vec::new(),
    };
    for (k, &node) in dissection.nodes.iter().enumerate() {
        search.place[node as usize] = Some(k as u32);
    }
    let mut known: HashMap<Box<[u32]>, usize> = HashMap::new();
    // of the first of several parts, its boundary in numbers of `places`
    let mut orders: HashMap<usize, Vec<u32>> = HashMap::new();
    // by part: the first like it, and whether others may be
    let mut firsts: Vec<(usize, bool)> = Vec::with_capacity(dissection.parts.len());
    for number in 0..dissection.parts.len() {
        let part = &dissection.parts[number];
        let described = match part.halves {
            None => search.describe_elements(
                &dissection.elements[part.elements[0]..part.elements[1]],
                elements,
                kinds,
            ),
            Some(halves) => {
                let of_halves = halves.map(|half| firsts[half]);
                of_halves.iter().all(|(_, repeats)| *repeats) && {
                    let boundaries = halves.map(|half| dissection.boundary(half));
                    search.describe_halves(of_halves.map(|(first, _)| first), boundaries);
                    true
                }
            }
        };
        if !described {
            firsts.push((number, false));
            continue;
        }
        let numbers = &search.numbers;
        let own = (part.own[0]..part.own[1]).map(|place| numbers[place].1);
        search.key.extend(own);
        let [start, end] = part.boundary;
        match known.get(&search.key[..]) {
            None => {
                known.insert(search.key.as_slice().into(), number);
                let boundary = dissection.boundaries[start..end].iter();
                orders.insert(
                    number,
                    boundary.map(|place| numbers[*place as usize].1).collect(),
                );
                firsts.push((number, true));
            }
            Some(&first) => {
                let boundary = &mut dissection.boundaries[start..end];
                for (place, number) in boundary.iter_mut().zip(&orders[&first]) {
                    *place = search.places[*number as usize];
                }
                firsts.push((first, true));
            }
        }
    }
    firsts.into_iter().map(|(first, _)| first).collect()
}

/// The search for equal parts, which are described by keys of numbers.
struct Search {
    /// The place of each node in the order of elimination; `None` for a node that is left out.
    place: Vec<Option<u32>>,
    /// By place: the stamp of the part for which the place was last numbered, and its number there.
    numbers: Vec<(u32, u32)>,
    stamp: u32,
    /// The places of the nodes of the part being described, in the order of their numbers.
    places: Vec<u32>,
    /// The key of the part being described: it is equal for parts that are equal up to the order of their own nodes.
    key: Vec<u32>,
}

impl Search {
    /// Describes a part that is not divided; returns whether another part may equal it.
    fn describe_elements<E: Deref<Target = [u32]>>(
        &mut self,
        part: &[u32],
        elements: &[E],
        kinds: &[Option<u32>],
    ) -> bool {
        self.start();
        self.key.push(part.len() as u32);
        for &e in part {
            let Some(kind) = kinds[e as usize] else {
                return false;
            };
            self.key.push(kind);
        }
        for &e in part {
            for &node in elements[e as usize].iter() {
                if let Some(place) = self.place[node as usize] {
                    let number = self.number(place).unwrap_or(self.places.len() as u32 - 1);
                    self.key.push(number);
                }
            }
        }
        true
    }

    /// Describes a divided part by the first parts that equal its two halves, and by the boundaries of the halves.
    fn describe_halves(&mut self, firsts: [usize; 2], boundaries: [&[u32]; 2]) {
        self.start();
        // the key of a part that is not divided begins with the number of its elements, which is not 0
        self.key.push(0);
        self.key.extend(firsts.map(|first| first as u32));
        for &place in boundaries[0] {
            self.number(place);
        }
        for &place in boundaries[1] {
            let number = self.number(place).unwrap_or(NEW);
            self.key.push(number);
        }
    }

    fn start(&mut self) {
        self.stamp += 1;
        self.places.clear();
        self.key.clear();
    }

    /// The number of a place; `None` if the place is new, in which case it gets the next number.
    fn number(&mut self, place: u32) -> Option<u32> {
        let (stamp, number) = &mut self.numbers[place as usize];
        if *stamp == self.stamp {
            return Some(*number);
        }
        (*stamp, *number) = (self.stamp, self.places.len() as u32);
        self.places.push(place);
        None
    }
}
