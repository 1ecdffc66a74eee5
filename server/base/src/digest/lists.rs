//! Large lists of numbers in canonical JSON, written piece by piece, on one thread or two.

use solver::element::Element;
use solver::linear::{Interrupt, Stopped, for_each_in_order};

use super::number::{self, ROOM, Recent};

/// A list of numbers, or of lists of numbers.
#[derive(Clone, Copy)]
pub(super) enum List<'a> {
    /// Numbers that rarely repeat.
    Numbers(&'a [f64]),
    /// Numbers that often repeat.
    Repeated(&'a [f64]),
    /// Positions.
    Places(&'a [[f64; 2]]),
    /// Elements, each with the numbers of its nodes.
    Elements(&'a [Element]),
    /// Small whole numbers.
    States(&'a [i8]),
}

impl List<'_> {
    fn len(&self) -> usize {
        match self {
            List::Numbers(list) | List::Repeated(list) => list.len(),
            List::Places(list) => list.len(),
            List::Elements(list) => list.len(),
            List::States(list) => list.len(),
        }
    }

    /// The first number that has no canonical form.
    pub(super) fn not_finite(&self) -> Option<f64> {
        let numbers = match self {
            List::Numbers(list) | List::Repeated(list) => list,
            List::Places(list) => list.as_flattened(),
            List::Elements(_) | List::States(_) => &[],
        };
        numbers.iter().copied().find(|value| !value.is_finite())
    }
}

/// The number of entries of a list that are written at once: up to 100 KiB of text.
const PIECE: usize = 1 << 10;

/// The largest text of an entry, an element: eight numbers of ten digits with their commas and brackets, and the free room
/// that the last one is written to.
const ENTRY: usize = 8 * 11 + 2 + ROOM;

/// The work on a piece, by which is counted when to ask whether to go on: some ten times in a megabyte of text.
const WORK_OF_A_PIECE: f64 = 1e7;

/// Writes lists, each with the text before it, on `threads` threads, at least one. `take` gets the text piece by piece, in order. An error if
/// `go_on` returned false.
pub(super) fn write(
    lists: &[(&str, List<'_>)],
    threads: usize,
    go_on: &mut dyn FnMut() -> bool,
    mut take: impl FnMut(&[u8]) + Send,
) -> Result<(), Stopped> {
    let pieces = lists.iter().flat_map(|(before, list)| {
        let starts = (0..list.len().max(1)).step_by(PIECE);
        starts.map(move |start| (*before, *list, start))
    });
    let most = lists.iter().map(|(_, list)| list.len()).max();
    let room = most.map_or(0, |most| most.min(PIECE) * ENTRY);
    let texts = (0..threads).map(|_| Text {
        bytes: Vec::with_capacity(room),
        recent: Recent::new(),
    });
    for_each_in_order(
        (pieces, WORK_OF_A_PIECE),
        &mut texts.collect::<Vec<_>>(),
        |text, piece| text.piece(*piece),
        |text, _| take(&text.bytes),
        &mut Interrupt::new(&mut || !go_on()),
    )
}

/// A piece of canonical JSON.
struct Text {
    bytes: Vec<u8>,
    recent: Recent,
}

impl Text {
    /// Writes the part of a list from the entry `start` on, and before the first one the text before the list.
    fn piece(&mut self, (before, list, start): (&str, List<'_>, usize)) {
        self.bytes.clear();
        if start == 0 {
            self.bytes.extend_from_slice(before.as_bytes());
            self.bytes.push(b'[');
        }
        let end = list.len().min(start + PIECE);
        match list {
            List::Numbers(list) => self.entries(start, &list[start..end], |text, value| {
                text.number(|_, room| number::write(*value, room));
            }),
            List::Repeated(list) => self.entries(start, &list[start..end], Text::repeated),
            List::Places(list) => self.entries(start, &list[start..end], |text, place| {
                text.bytes.push(b'[');
                text.entries(0, place, Text::repeated);
                text.bytes.push(b']');
            }),
            List::Elements(list) => self.entries(start, &list[start..end], |text, element| {
                text.bytes.push(b'[');
                text.entries(0, element, |text, node| {
                    text.number(|_, room| number::write_whole(*node, room));
                });
                text.bytes.push(b']');
            }),
            List::States(list) => self.entries(start, &list[start..end], |text, state| {
                text.repeated(&f64::from(*state));
            }),
        }
        if end == list.len() {
            self.bytes.push(b']');
        }
    }

    /// Writes entries; the first one has the number `start` in its list.
    #[inline]
    fn entries<T>(&mut self, start: usize, entries: &[T], write: impl Fn(&mut Self, &T)) {
        for (k, entry) in (start..).zip(entries) {
            if k > 0 {
                self.bytes.push(b',');
            }
            write(self, entry);
        }
    }

    #[inline]
    fn repeated(&mut self, value: &f64) {
        self.number(|recent, room| recent.write(*value, room));
    }

    /// Writes a number: `write` puts it into the free room, and returns its length.
    #[inline]
    fn number(&mut self, write: impl FnOnce(&mut Recent, &mut [u8; ROOM]) -> usize) {
        let length = self.bytes.len();
        self.bytes.extend_from_slice(&[0; ROOM]);
        if let Some(room) = self.bytes[length..].first_chunk_mut() {
            let own = write(&mut self.recent, room);
            self.bytes.truncate(length + own);
        }
    }
}
