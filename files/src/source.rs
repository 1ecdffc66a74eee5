//! Reads a file of mesh data by lines, words or bytes, and counts the lines.

use std::io::{self, BufRead};
use std::str::FromStr;

use solver::error::{Reason, Violation};

/// The longest line of a mesh file, so that a file that is not text does not fill the memory.
const LONGEST_LINE: usize = 1 << 20;

/// The byte order mark that some editors write before a text.
pub const BYTE_ORDER_MARK: char = '\u{feff}';

/// Decodes a text, also from a program for Windows or an old program: removes a byte order mark, and decodes a line as
/// Latin-1 if it is not UTF-8.
pub fn text(bytes: Vec<u8>) -> String {
    let text = String::from_utf8(bytes).unwrap_or_else(|error| {
        let lines = error
            .as_bytes()
            .split_inclusive(|byte| matches!(byte, b'\n' | b'\r'));
        lines.map(|line| decoded(line.to_vec())).collect()
    });
    match text.strip_prefix(BYTE_ORDER_MARK) {
        Some(rest) => rest.to_owned(),
        None => text,
    }
}

/// A line as text: UTF-8, or else Latin-1, in which every byte is a character.
fn decoded(bytes: Vec<u8>) -> String {
    String::from_utf8(bytes)
        .unwrap_or_else(|error| error.as_bytes().iter().map(|byte| *byte as char).collect())
}

/// The reason why a mesh could not be read.
#[derive(Debug)]
pub enum ReadError {
    /// The bytes could not be read.
    Io(io::Error),
    /// The violations of the file. Their pointers are empty, since only the caller knows where the file comes from.
    Invalid(Vec<Violation>),
}

impl ReadError {
    /// The violations of a text in memory; reading from memory does not fail.
    pub(crate) fn into_violations(self) -> Vec<Violation> {
        match self {
            ReadError::Invalid(violations) => violations,
            ReadError::Io(error) => vec![Violation::new(
                "",
                Reason::Malformed,
                error,
                "a readable text",
                "Send it again.",
            )],
        }
    }
}

/// A reader of words and bytes that counts lines.
pub(crate) struct Source<R> {
    reader: R,
    /// The current line without its end.
    text: String,
    /// The start of the next word in the line.
    at: usize,
    /// The number of the current line, from 1; in a binary section the number of the section's first line.
    pub(crate) line: u64,
    /// Whether the byte order differs from that of this machine.
    pub(crate) swapped: bool,
}

impl<R: BufRead> Source<R> {
    pub(crate) fn new(reader: R) -> Self {
        Source {
            reader,
            text: String::new(),
            at: 0,
            line: 0,
            swapped: false,
        }
    }

    /// Goes to the next line; false at the end of the file.
    pub(crate) fn advance(&mut self) -> Result<bool, ReadError> {
        let mut bytes = std::mem::take(&mut self.text).into_bytes();
        bytes.clear();
        self.at = 0;
        let ended = self.line_of(&mut bytes).map_err(ReadError::Io)?;
        if !ended && bytes.is_empty() {
            return Ok(false);
        }
        self.line += 1;
        if !ended && bytes.len() >= LONGEST_LINE {
            return Err(self.fault(
                Reason::Malformed,
                "a line longer than 1 MiB",
                "a mesh file",
                "Check that the file is a mesh.",
            ));
        }
        if bytes.contains(&0) {
            return Err(self.fault(
                Reason::Malformed,
                "bytes that are not text",
                "a text",
                "Save the file again; a binary file must be sent as it is.",
            ));
        }
        self.text = decoded(bytes);
        if self.line == 1 && self.text.starts_with(BYTE_ORDER_MARK) {
            self.text.drain(..BYTE_ORDER_MARK.len_utf8());
        }
        Ok(true)
    }

    /// Reads the bytes of the next line, up to the longest allowed; returns whether the line's end was found: a line
    /// feed, a carriage return, or a carriage return and a line feed.
    fn line_of(&mut self, bytes: &mut Vec<u8>) -> io::Result<bool> {
        while bytes.len() < LONGEST_LINE {
            let piece = match self.reader.fill_buf() {
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                piece => piece?,
            };
            if piece.is_empty() {
                return Ok(false);
            }
            let piece = &piece[..piece.len().min(LONGEST_LINE - bytes.len())];
            let end = piece.iter().position(|byte| matches!(byte, b'\n' | b'\r'));
            let read = end.unwrap_or(piece.len());
            bytes.extend_from_slice(&piece[..read]);
            let returned = end.is_some_and(|end| piece[end] == b'\r');
            self.reader.consume(read + usize::from(end.is_some()));
            if returned && self.reader.fill_buf()?.first() == Some(&b'\n') {
                self.reader.consume(1);
            }
            if end.is_some() {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// The rest of the current line. Its words then count as read.
    pub(crate) fn text(&mut self) -> &str {
        self.at = self.text.len();
        &self.text
    }

    /// The next word, on the current line or a later one. `what`: its meaning, for the message if there is none.
    pub(crate) fn word(&mut self, what: &str) -> Result<&str, ReadError> {
        loop {
            let rest = &self.text[self.at..];
            let trimmed = rest.trim_start();
            if !trimmed.is_empty() {
                let start = self.text.len() - trimmed.len();
                let length = trimmed.find(char::is_whitespace).unwrap_or(trimmed.len());
                self.at = start + length;
                return Ok(&self.text[start..start + length]);
            }
            if !self.advance()? {
                return Err(self.fault(
                    Reason::Truncated,
                    "the end of the file",
                    what,
                    "The file is cut off; save or send it again.",
                ));
            }
        }
    }

    /// The next word as a number. `what`: its meaning, for messages.
    pub(crate) fn number<T: FromStr>(&mut self, what: &str) -> Result<T, ReadError> {
        let word = self.word(what)?;
        match word.parse() {
            Ok(number) => Ok(number),
            Err(_) => {
                let got = format!("`{word:.40}`");
                Err(self.fault(Reason::Malformed, &got, what, "Correct that word. If nobody has edited the file, the lines before may have more or fewer words than their section says: save the mesh again."))
            }
        }
    }

    /// The next bytes of a binary section. `what`: their meaning, for messages.
    pub(crate) fn bytes<const N: usize>(&mut self, what: &str) -> Result<[u8; N], ReadError> {
        let mut bytes = [0; N];
        match self.reader.read_exact(&mut bytes) {
            Ok(()) => {
                if self.swapped {
                    bytes.reverse();
                }
                Ok(bytes)
            }
            Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => Err(self.fault(
                Reason::Truncated,
                "the end of the file",
                what,
                "The file is cut off; save or send it again.",
            )),
            Err(error) => Err(ReadError::Io(error)),
        }
    }

    /// The error that the current line has a fault.
    pub(crate) fn fault(&self, reason: Reason, got: &str, expected: &str, hint: &str) -> ReadError {
        let got = format!("line {}: {got}", self.line);
        ReadError::Invalid(vec![Violation::new("", reason, got, expected, hint)])
    }
}

/// The places of nodes or elements by their numbers in the file. Mostly numbers are dense and kept in a list; numbers
/// far beyond are kept in a map, so that one large number does not fill the memory.
#[derive(Clone, Default)]
pub(crate) struct Labels {
    dense: Vec<u32>,
    sparse: std::collections::BTreeMap<u64, u32>,
    count: u32,
    /// The smallest and the largest number so far.
    ends: Option<(u64, u64)>,
}

impl Labels {
    /// Gives the next node or element this number; false, without effect, if another one has it.
    pub(crate) fn add(&mut self, label: u64) -> bool {
        if self.get(label).is_some() {
            return false;
        }
        let place = self.count;
        match usize::try_from(label) {
            Ok(label) if label <= 4 * place as usize + 1024 => {
                if self.dense.len() <= label {
                    self.dense.resize(label + 1, u32::MAX);
                }
                self.dense[label] = place;
            }
            _ => {
                self.sparse.insert(label, place);
            }
        }
        self.count += 1;
        let (first, last) = self.ends.unwrap_or((label, label));
        self.ends = Some((first.min(label), last.max(label)));
        true
    }

    /// The smallest and the largest number; none if there are no numbers.
    pub(crate) fn ends(&self) -> Option<(u64, u64)> {
        self.ends
    }

    /// The places of all existing numbers among first, first + step, … up to last, and how many numbers were examined,
    /// at most one more than `most`. The range may be very wide: only existing numbers are examined, and each wanted
    /// number at most once.
    pub(crate) fn range(&self, first: u64, last: u64, step: u64, most: u64) -> (Vec<u32>, u64) {
        let (mut found, mut visited) = (Vec::new(), 0);
        if first > last {
            return (found, visited);
        }
        let wanted = |label: u64| (label - first).is_multiple_of(step);
        let inside = (first..=last.min(self.dense.len() as u64)).step_by(step.max(1) as usize);
        for label in inside.take_while(|label| *label < self.dense.len() as u64) {
            visited += 1;
            if visited > most {
                return (found, visited);
            }
            let place = self.dense[label as usize];
            if place != u32::MAX {
                found.push(place);
            }
        }
        if (last - first) / step < self.sparse.len() as u64 {
            for label in (first..=last).step_by(step as usize) {
                visited += 1;
                if visited > most {
                    break;
                }
                found.extend(self.sparse.get(&label));
            }
            return (found, visited);
        }
        for (label, place) in self.sparse.range(first..=last) {
            visited += 1;
            if visited > most {
                break;
            }
            found.extend(wanted(*label).then_some(*place));
        }
        (found, visited)
    }

    /// The place, in the order of the file, of the node or element with this number.
    pub(crate) fn get(&self, label: u64) -> Option<u32> {
        let dense = usize::try_from(label).ok().and_then(|l| self.dense.get(l));
        dense
            .copied()
            .filter(|place| *place != u32::MAX)
            .or_else(|| self.sparse.get(&label).copied())
    }
}

/// Checks that all nodes lie in one plane z = const.
pub(crate) struct Plane {
    lowest: (f64, u64),
    highest: (f64, u64),
    extent: f64,
}

impl Default for Plane {
    fn default() -> Self {
        Plane {
            lowest: (f64::INFINITY, 0),
            highest: (f64::NEG_INFINITY, 0),
            extent: 0.0,
        }
    }
}

impl Plane {
    pub(crate) fn add(&mut self, label: u64, [x, y, z]: [f64; 3]) {
        if z < self.lowest.0 {
            self.lowest = (z, label);
        }
        if z > self.highest.0 {
            self.highest = (z, label);
        }
        self.extent = self.extent.max(x.abs()).max(y.abs());
    }

    /// The violation for nodes that do not lie in one plane z = const.; none if they do.
    pub(crate) fn fault(&self) -> Option<Violation> {
        /// The largest relative difference of z that counts as rounding, in files with some nine digits.
        const FLAT: f64 = 1e-9;
        let ((low, at_low), (high, at_high)) = (self.lowest, self.highest);
        (high - low > FLAT * self.extent.max(high.abs())).then(|| {
            Violation::new(
                "",
                Reason::NotPlane,
                format!("z = {low} at node {at_low} and {high} at node {at_high}"),
                "one z for all nodes",
                "The body lies in the plane of x and y (axisymmetric: x is r, y is z of the body).",
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_continue_on_the_next_line_and_faults_name_their_line() {
        let mut source = Source::new(&b"1 2\r\n\n  x 4"[..]);
        assert_eq!(source.number::<u32>("a number").unwrap(), 1);
        assert_eq!(source.number::<u32>("a number").unwrap(), 2);
        let Err(ReadError::Invalid(list)) = source.number::<u32>("a node number") else {
            panic!("x is not a number");
        };
        assert_eq!(list[0].got, "line 3: `x`");
        assert_eq!(source.number::<f64>("a number").unwrap(), 4.0);
        assert!(source.word("more").is_err());
    }

    #[test]
    fn a_line_ends_with_a_line_feed_a_carriage_return_or_both() {
        for text in ["a\nb\n\nc", "a\rb\r\rc\r", "a\r\nb\r\n\r\nc\r\n"] {
            // also where a piece of the reader ends between both
            let mut source = Source::new(io::BufReader::with_capacity(1, text.as_bytes()));
            let mut lines = Vec::new();
            while source.advance().unwrap() {
                lines.push(source.text().to_owned());
            }
            assert_eq!(lines, ["a", "b", "", "c"]);
        }
        let mut source = Source::new(&b"\xef\xbb\xbf\xfc\n\xc3\xbc\nx\0"[..]);
        assert!(source.advance().unwrap());
        assert!(source.advance().unwrap());
        assert_eq!(source.text(), "ü");
        assert!(source.advance().is_err());
    }

    #[test]
    fn labels_may_be_dense_or_sparse_and_are_unique() {
        let mut labels = Labels::default();
        for label in [1, 2, 3, u64::MAX, 1 << 40] {
            assert!(labels.add(label), "{label}");
        }
        assert!(!labels.add(2) && !labels.add(u64::MAX));
        assert_eq!(
            [3, u64::MAX].map(|l| labels.get(l)),
            [Some(2), Some(3)].map(|x| x)
        );
        assert_eq!(labels.get(77), None);
    }

    #[test]
    fn a_range_visits_each_wanted_number_at_most_once() {
        let mut labels = Labels::default();
        for label in (1..=100).chain([u64::MAX - 4, u64::MAX]) {
            assert!(labels.add(label));
        }
        let all = |first, last, step| labels.range(first, last, step, 1000).0;
        assert_eq!(all(1, 10, 3), [0, 3, 6, 9]);
        assert_eq!(all(99, u64::MAX, 1), [98, 99, 100, 101]);
        assert_eq!(
            all(0, u64::MAX, 5),
            (4..100).step_by(5).chain([101]).collect::<Vec<_>>()
        );
        assert_eq!(all(u64::MAX, u64::MAX, 1), [101]);
        assert!(all(10, 1, 1).is_empty());
        // with what exists, not with how far it reaches
        assert!(labels.range(0, u64::MAX, 1, 1_000_000).1 < 2000);
        assert_eq!(labels.range(1, 100, 1, 7).1, 8);
    }
}
