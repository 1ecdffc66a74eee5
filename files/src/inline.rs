//! Removes the nodes and elements of an inline mesh from a JSON text while it is read.
//!
//! Nodes and elements are most of a large problem. They go from the pieces of a reader directly into the columns of the
//! mesh, and whoever reads the text from [`Extract`] finds an empty list in their place: a problem without its mesh is
//! small. A list with an unexpected character is passed on from that character, after as many simple items as were
//! removed, so that its faults are found at their places by the code that describes all other faults.

use std::io::{self, Read};

use solver::element::Element;
use solver::problem::InlineMesh;

/// The number of bytes that are requested from the reader at once. A list with a longer item is passed on.
const PIECE: usize = 1 << 16;

/// The number of items that are written at once in place of removed items.
const AT_ONCE: usize = 1 << 10;

/// The largest number of bytes of a name that is compared with the names that lead to the mesh.
const LONGEST_NAME: usize = 8;

/// A reader of a JSON text that removes the nodes and elements of the inline mesh at one place in it; other texts pass
/// unchanged.
pub(crate) struct Extract<R> {
    input: Input<R>,
    /// The names that lead to the mesh, from the outermost object on.
    way: &'static [&'static str],
    /// The number of names of `way` that lead to the present place in the text.
    inside: usize,
    /// The number of open brackets.
    depth: usize,
    /// The last string, or the current one.
    name: Vec<u8>,
    string: Option<InString>,
    /// What the value after the next colon is: an object on the way to the mesh, or a list of the mesh.
    awaited: Option<Awaited>,
    /// The list that is being removed.
    list: Option<List>,
    /// Simple items that must still be written in place of removed items.
    stand_ins: Option<StandIns>,
    /// Text that is to be passed on.
    out: Vec<u8>,
    sent: usize,
    /// The place where the text that was passed on ends.
    end: Place,
    nodes: Column<[f64; 2]>,
    elements: Column<Element>,
    places: Places,
}

/// The nodes and elements that [`Extract`] has removed from a text.
pub(crate) struct Taken {
    nodes: Column<[f64; 2]>,
    elements: Column<Element>,
    pub(crate) places: Places,
}

/// Pairs of places: in the text that was passed on, and the corresponding place in the original text.
#[derive(Default)]
pub(crate) struct Places(Vec<(Place, Place)>);

/// A place in a text: its line, from 1, and the number of bytes before it in that line.
#[derive(Clone, Copy, PartialEq, PartialOrd)]
struct Place {
    line: usize,
    column: usize,
}

#[derive(Clone, Copy)]
enum InString {
    Plain,
    /// Inside a string, after a backslash.
    Escaped,
}

#[derive(Clone, Copy)]
enum Awaited {
    Object,
    List(List),
}

#[derive(Clone, Copy)]
enum List {
    Nodes,
    Elements,
}

struct StandIns {
    text: &'static [u8],
    left: usize,
    first: bool,
}

/// The removed items of a list: all items, or those before the first unexpected character.
struct Column<T> {
    items: Vec<T>,
    state: State,
}

#[derive(PartialEq)]
enum State {
    Untouched,
    Beginning,
    Whole,
}

/// The pieces of text that a reader gives.
struct Input<R> {
    reader: R,
    piece: Vec<u8>,
    /// The start of the unused part of the piece.
    start: usize,
    end: usize,
    /// Whether the reader is at its end.
    ended: bool,
    /// The place of `start` in the text.
    place: Place,
}

impl<R: Read> Extract<R> {
    /// Prepares extraction from the text of a reader. `way`: the names that lead to the mesh, from the outermost object
    /// on; each at most [`LONGEST_NAME`] bytes long.
    pub(crate) fn new(reader: R, way: &'static [&'static str]) -> Self {
        Extract {
            input: Input {
                reader,
                piece: vec![0; PIECE],
                start: 0,
                end: 0,
                ended: false,
                place: Place::START,
            },
            way,
            inside: 0,
            depth: 0,
            name: Vec::with_capacity(LONGEST_NAME + 1),
            string: None,
            awaited: None,
            list: None,
            stand_ins: None,
            out: Vec::new(),
            sent: 0,
            end: Place::START,
            nodes: Column::empty(),
            elements: Column::empty(),
            places: Places::default(),
        }
    }

    /// The nodes and elements that were removed so far.
    pub(crate) fn taken(self) -> Taken {
        Taken {
            nodes: self.nodes,
            elements: self.elements,
            places: self.places,
        }
    }

    /// Makes more text to pass on, if there is more.
    fn advance(&mut self) -> io::Result<()> {
        if let Some(stand_ins) = &mut self.stand_ins {
            for _ in 0..stand_ins.left.min(AT_ONCE) {
                if !std::mem::take(&mut stand_ins.first) {
                    self.out.push(b',');
                }
                self.out.extend_from_slice(stand_ins.text);
            }
            stand_ins.left = stand_ins.left.saturating_sub(AT_ONCE);
            if stand_ins.left == 0 {
                self.stand_ins = None;
            }
            return Ok(());
        }
        match self.list {
            Some(list) => self.take(list),
            None => {
                if self.input.start == self.input.end {
                    self.input.fill()?;
                }
                self.pass();
                Ok(())
            }
        }
    }

    /// Passes the text on, up to the next list of nodes or elements.
    fn pass(&mut self) {
        let piece = &self.input.piece[self.input.start..self.input.end];
        let mut used = 0;
        while used < piece.len() && self.list.is_none() {
            let byte = piece[used];
            used += 1;
            match self.string {
                Some(InString::Escaped) => self.string = Some(InString::Plain),
                Some(InString::Plain) => match byte {
                    b'"' => self.string = None,
                    b'\\' => {
                        self.string = Some(InString::Escaped);
                        // no name of ours has one
                        self.name.resize(LONGEST_NAME + 1, b'\\');
                    }
                    _ if self.name.len() <= LONGEST_NAME => self.name.push(byte),
                    _ => {}
                },
                None => match byte {
                    b'"' => {
                        self.string = Some(InString::Plain);
                        self.name.clear();
                        self.awaited = None;
                    }
                    b':' => self.awaited = self.named(),
                    b',' => self.awaited = None,
                    b'{' => {
                        self.depth += 1;
                        let ours = matches!(self.awaited.take(), Some(Awaited::Object));
                        self.inside += usize::from(ours);
                    }
                    b'[' => match self.awaited.take() {
                        Some(Awaited::List(list)) => self.list = Some(list),
                        _ => self.depth += 1,
                    },
                    b'}' | b']' => {
                        self.depth = self.depth.saturating_sub(1);
                        self.inside = self.inside.min(self.depth.saturating_sub(1));
                    }
                    _ => {}
                },
            }
        }
        let passed = &piece[..used];
        self.out.extend_from_slice(passed);
        self.end.pass(passed);
        self.input.advance(used);
    }

    /// What the value after a colon is, if the name before the colon leads to the mesh or names a list of it.
    fn named(&self) -> Option<Awaited> {
        let directly = self.depth == self.inside + 1;
        match self.way.get(self.inside).filter(|_| directly) {
            Some(name) => (self.name == name.as_bytes()).then_some(Awaited::Object),
            None if directly => match self.name.as_slice() {
                b"nodes" if self.nodes.state == State::Untouched => {
                    Some(Awaited::List(List::Nodes))
                }
                b"elements" if self.elements.state == State::Untouched => {
                    Some(Awaited::List(List::Elements))
                }
                _ => None,
            },
            None => None,
        }
    }

    /// Removes items of a list, whose bracket is open, up to its end or to an unexpected character.
    fn take(&mut self, list: List) -> io::Result<()> {
        let input = &mut self.input;
        let (state, count, stand_in) = match list {
            List::Nodes => {
                let state = self.nodes.take(input, node)?;
                (state, self.nodes.items.len(), &b"[0,0]"[..])
            }
            List::Elements => {
                let state = self.elements.take(input, element)?;
                let stand_in = &b"[0,0,0,0,0,0]"[..];
                (state, self.elements.items.len(), stand_in)
            }
        };
        self.list = None;
        if state == State::Whole {
            self.out.push(b']');
            self.end.column += 1;
        } else {
            // its bracket is passed on with the rest
            self.depth += 1;
            self.end.column += (count * (stand_in.len() + 1)).saturating_sub(1);
            self.stand_ins = (count > 0).then_some(StandIns {
                text: stand_in,
                left: count,
                first: true,
            });
        }
        self.places.0.push((self.end, self.input.place));
        Ok(())
    }
}

/// Reads the text that is passed on.
impl<R: Read> Read for Extract<R> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        if self.sent == self.out.len() {
            self.sent = 0;
            self.out.clear();
            while self.out.is_empty() && !self.is_at_end() {
                self.advance()?;
            }
        }
        let count = (&self.out[self.sent..]).read(into)?;
        self.sent += count;
        Ok(count)
    }
}

impl<R> Extract<R> {
    fn is_at_end(&self) -> bool {
        let input = &self.input;
        input.ended && input.start == input.end && self.list.is_none() && self.stand_ins.is_none()
    }
}

impl Taken {
    /// Puts the removed nodes and elements into the mesh that was read from the rest of the text.
    pub(crate) fn put(self, mesh: &mut InlineMesh) {
        self.nodes.put(&mut mesh.nodes);
        self.elements.put(&mut mesh.elements);
    }
}

impl Places {
    /// Converts line and column in the text that was passed on to those in the original text.
    pub(crate) fn original(&self, line: usize, column: usize) -> (usize, usize) {
        let place = Place { line, column };
        match self.0.iter().rev().find(|(passed, _)| *passed <= place) {
            Some((passed, original)) if passed.line == line => {
                (original.line, original.column + (column - passed.column))
            }
            Some((passed, original)) => (original.line + (line - passed.line), column),
            None => (line, column),
        }
    }

    /// The message of an error of `serde_json`, with the place in the original text.
    pub(crate) fn message(&self, error: &serde_json::Error) -> String {
        let text = error.to_string();
        let (line, column) = (error.line(), error.column());
        match text.strip_suffix(&format!(" at line {line} column {column}")) {
            Some(message) => {
                let (line, column) = self.original(line, column);
                format!("{message} at line {line} column {column}")
            }
            None => text,
        }
    }
}

impl Place {
    const START: Place = Place { line: 1, column: 0 };

    /// Moves the place to the end of a text that begins there.
    fn pass(&mut self, text: &[u8]) {
        // in bytes, many at once: checked additions of larger numbers take as long as reading the numbers of a mesh
        let ends = |part: &[u8]| {
            let each = part.iter().map(|byte| u8::from(*byte == b'\n'));
            usize::from(each.fold(0, u8::wrapping_add))
        };
        let lines: usize = text.chunks(usize::from(u8::MAX)).map(ends).sum();
        if lines == 0 {
            self.column += text.len();
        } else if let Some(last) = text.iter().rposition(|byte| *byte == b'\n') {
            (self.line, self.column) = (self.line + lines, text.len() - 1 - last);
        }
    }
}

impl<T> Column<T> {
    fn empty() -> Self {
        Column {
            items: Vec::new(),
            state: State::Untouched,
        }
    }

    /// Removes items until the list ends or has an unexpected character.
    fn take<R: Read>(
        &mut self,
        input: &mut Input<R>,
        item: impl Fn(&[u8], &mut usize) -> Result<T, Not>,
    ) -> io::Result<State> {
        let state = loop {
            let piece = &input.piece[input.start..input.end];
            let mut used = 0;
            let end = loop {
                let mut at = used;
                match next(piece, &mut at, self.items.is_empty(), &item) {
                    Ok(Some(taken)) => {
                        self.items.push(taken);
                        used = at;
                    }
                    Ok(None) => {
                        used = at;
                        break Some(State::Whole);
                    }
                    Err(Not::Expected) => break Some(State::Beginning),
                    Err(Not::Complete) => break None,
                }
            };
            input.advance(used);
            if let Some(end) = end {
                break end;
            }
            if !input.fill()? {
                break State::Beginning;
            }
        };
        self.items.shrink_to_fit();
        self.state = match state {
            State::Whole => State::Whole,
            _ => State::Beginning,
        };
        Ok(state)
    }

    fn put(self, into: &mut Vec<T>) {
        match self.state {
            State::Untouched => {}
            State::Whole => *into = self.items,
            // the list was read from where it was passed on, with something else in place of the first items
            State::Beginning => {
                for (place, item) in into.iter_mut().zip(self.items) {
                    *place = item;
                }
            }
        }
    }
}

impl<R: Read> Input<R> {
    /// Reads more text after the unused part; false if the reader is at its end or the piece is full.
    fn fill(&mut self) -> io::Result<bool> {
        self.piece.copy_within(self.start..self.end, 0);
        (self.start, self.end) = (0, self.end - self.start);
        if self.ended || self.end == self.piece.len() {
            return Ok(false);
        }
        let count = loop {
            match self.reader.read(&mut self.piece[self.end..]) {
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                read => break read?,
            }
        };
        self.end += count;
        self.ended = count == 0;
        Ok(count > 0)
    }

    fn advance(&mut self, used: usize) {
        let start = self.start;
        self.start += used;
        self.place.pass(&self.piece[start..self.start]);
    }
}

/// The reason why no further item could be read from a text.
enum Not {
    /// The text ends before the item does.
    Complete,
    /// The text continues with something else than an item.
    Expected,
}

/// Reads the next item of a list with the comma before it; `None` at the end of the list. `at`: the place in the text,
/// which moves behind the item.
fn next<T>(
    text: &[u8],
    at: &mut usize,
    first: bool,
    item: impl Fn(&[u8], &mut usize) -> Result<T, Not>,
) -> Result<Option<T>, Not> {
    match character(text, at)? {
        b']' => {
            *at += 1;
            return Ok(None);
        }
        b',' if !first => *at += 1,
        _ if first => {}
        _ => return Err(Not::Expected),
    }
    item(text, at).map(Some)
}

/// Reads a node: two numbers.
fn node(text: &[u8], at: &mut usize) -> Result<[f64; 2], Not> {
    expect(text, at, b'[')?;
    let x = real(text, at)?;
    expect(text, at, b',')?;
    let y = real(text, at)?;
    expect(text, at, b']')?;
    Ok([x, y])
}

/// Reads an element: eight or six whole numbers.
fn element(text: &[u8], at: &mut usize) -> Result<Element, Not> {
    let (mut nodes, mut count) = ([0; 8], 0);
    expect(text, at, b'[')?;
    for node in &mut nodes {
        *node = whole(text, at)?;
        count += 1;
        match character(text, at)? {
            b',' => *at += 1,
            _ => break,
        }
    }
    expect(text, at, b']')?;
    Element::try_from(&nodes[..count]).map_err(|_| Not::Expected)
}

/// The next character that is no space.
fn character(text: &[u8], at: &mut usize) -> Result<u8, Not> {
    loop {
        match text.get(*at) {
            Some(b' ' | b'\n' | b'\r' | b'\t') => *at += 1,
            Some(other) => return Ok(*other),
            None => return Err(Not::Complete),
        }
    }
}

fn expect(text: &[u8], at: &mut usize, expected: u8) -> Result<(), Not> {
    match character(text, at)? {
        found if found == expected => {
            *at += 1;
            Ok(())
        }
        _ => Err(Not::Expected),
    }
}

/// Reads a number as in RFC 8259, within double precision.
fn real(text: &[u8], at: &mut usize) -> Result<f64, Not> {
    character(text, at)?;
    let start = *at;
    if text[*at] == b'-' {
        *at += 1;
    }
    let first = *at;
    let whole = digits(text, at)?;
    if whole == 0 || (whole > 1 && text[first] == b'0') {
        return Err(Not::Expected);
    }
    if text[*at] == b'.' {
        *at += 1;
        if digits(text, at)? == 0 {
            return Err(Not::Expected);
        }
    }
    if let b'e' | b'E' = text[*at] {
        *at += 1;
        if let Some(b'+' | b'-') = text.get(*at) {
            *at += 1;
        }
        if digits(text, at)? == 0 {
            return Err(Not::Expected);
        }
    }
    let number = std::str::from_utf8(&text[start..*at]).ok();
    let number = number.and_then(|number| number.parse().ok());
    number
        .filter(|number: &f64| number.is_finite())
        .ok_or(Not::Expected)
}

/// Reads a whole number from 0, without fraction and exponent.
fn whole(text: &[u8], at: &mut usize) -> Result<u32, Not> {
    character(text, at)?;
    let start = *at;
    let count = digits(text, at)?;
    // ten digits of a u32
    if count == 0 || count > 10 || (count > 1 && text[start] == b'0') {
        return Err(Not::Expected);
    }
    let digit = |value: u64, digit: &u8| value * 10 + u64::from(digit - b'0');
    let value = text[start..*at].iter().fold(0, digit);
    u32::try_from(value).map_err(|_| Not::Expected)
}

/// Skips digits; returns how many there were.
fn digits(text: &[u8], at: &mut usize) -> Result<usize, Not> {
    let start = *at;
    while let Some(b'0'..=b'9') = text.get(*at) {
        *at += 1;
    }
    if *at < text.len() {
        Ok(*at - start)
    } else {
        Err(Not::Complete)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::panic)]
    use super::*;
    use solver::problem::{MeshSource, Problem};

    /// A reader that gives only a few bytes at a time.
    struct Drops<'a>(&'a [u8], usize);

    impl Read for Drops<'_> {
        fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
            let count = self.1.min(self.0.len()).min(into.len());
            into[..count].copy_from_slice(&self.0[..count]);
            self.0 = &self.0[count..];
            Ok(count)
        }
    }

    fn extract(text: &str, at_once: usize) -> (String, Taken) {
        let mut extract = Extract::new(Drops(text.as_bytes(), at_once), &["mesh", "inline"]);
        let mut rest = String::new();
        extract.read_to_string(&mut rest).unwrap();
        (rest, extract.taken())
    }

    #[test]
    fn nodes_and_elements_are_taken_and_empty_lists_left() {
        let text = "{\"title\": \"nodes\\\": [[1,2]]\", \"mesh\": {\"inline\": {\n \"nodes\": [ [0, -1.5e-3],\n [1E2 ,-0] ],\n \
                    \"elements\":[[0,1,2,3,4,5],[0,1,2,3,4,5,6,4294967295]],\"boundaries\": {\"nodes\": [[0,1,2]]}}}}";
        for at_once in [1, 2, 7, 1 << 20] {
            let (rest, taken) = extract(text, at_once);
            assert_eq!(
                rest,
                "{\"title\": \"nodes\\\": [[1,2]]\", \"mesh\": {\"inline\": {\n \"nodes\": [],\n \
                 \"elements\":[],\"boundaries\": {\"nodes\": [[0,1,2]]}}}}"
            );
            assert_eq!(taken.nodes.items, [[0.0, -1.5e-3], [100.0, 0.0]]);
            assert!(taken.nodes.items[1][1].is_sign_negative());
            let last = [0, 1, 2, 3, 4, 5, 6, u32::MAX];
            let triangle = Element::Triangle([0, 1, 2, 3, 4, 5]);
            assert_eq!(taken.elements.items, [triangle, Element::Quad(last)]);
        }
    }

    #[test]
    fn lists_elsewhere_are_left_as_they_are() {
        for text in [
            r#"{"nodes": [[0,0]], "mesh": {"nodes": [[0,0]]}}"#,
            r#"{"inline": {"nodes": [[0,0]]}, "mesh": [{"inline": {"nodes": [[0,0]]}}]}"#,
            r#"{"mesh": {"inline": {"groups": {"nodes": [[0,0]]}}, "nodes": [[0,0]]}}"#,
            r#"{"mesh": {"a": {"inline": {"nodes": [[0,0]]}}}, "inline": {"nodes": [[0,0]]}}"#,
            r#"{"mesh": "inline", "inline": {"nodes": [[0,0]]}}"#,
            r#"[{"mesh": {"inline": {"nodes": [[0,0]]}}}]"#,
            r#"{"mesh": {"inline": {"n\u006fdes": [[0,0]], "nodess": [[0,0]], "nodes": {}}}}"#,
            r#"{"mesh": {"inline": {"nodes": "#,
            "\"\\",
            "",
        ] {
            let (rest, taken) = extract(text, 3);
            assert_eq!(rest, text);
            assert!(taken.nodes.items.is_empty() && taken.places.0.is_empty());
        }
    }

    #[test]
    fn a_list_goes_on_in_the_text_where_it_is_not_as_expected() {
        let rest = |nodes: &str| {
            let text = format!(r#"{{"mesh":{{"inline":{{"nodes":[{nodes}"#);
            let (rest, taken) = extract(&text, 4);
            assert_eq!(taken.places.0.len(), 1, "{nodes}");
            rest.strip_prefix(r#"{"mesh":{"inline":{"nodes":["#)
                .unwrap()
                .to_owned()
        };
        for unusual in [
            "",
            " ",
            "[",
            "[1",
            "[1,",
            "[1,2",
            "[1,2,3]",
            "[1]",
            "[01,2]",
            "[1.,2]",
            "[.5,2]",
            "[+1,2]",
            "[-,2]",
            "[1e,2]",
            "[1e+,2]",
            "[1e999,2]",
            "[NaN,2]",
            "[1 2]",
            "[null,2]",
            "{}",
            "\"]\"",
            ",[1,2]",
            "[[1],2]",
        ] {
            assert_eq!(rest(unusual), unusual);
            assert_eq!(
                rest(&format!("[3,4], [5,6] , {unusual}}}")),
                format!("[0,0],[0,0] , {unusual}}}")
            );
        }
        let elements = |items: &str| {
            let text = format!(r#"{{"mesh":{{"inline":{{"elements":[[0,1,2,3,4,5],{items}]}}}}"#);
            extract(&text, 5).0
        };
        for unusual in [
            "[0,1,2,3,4]",
            "[0,1,2,3,4,5,6]",
            "[0,1,2,3,4,5,6,7,8]",
            "[0,1,2,3,4,5,]",
            "[0,1,2,3,4,-5]",
            "[0,1,2,3,4,5.0]",
            "[0,1,2,3,4,05]",
            "[0,1,2,3,4,4294967296]",
            "[0,1,2,3,4,99999999999999999999]",
        ] {
            let left = format!(r#"{{"mesh":{{"inline":{{"elements":[[0,0,0,0,0,0],{unusual}]}}}}"#);
            assert_eq!(elements(unusual), left);
        }
    }

    /// The items before a list was passed on keep their values, also if nothing is wrong there: for example with more
    /// space between two numbers than a piece holds.
    #[test]
    fn the_items_before_where_a_list_was_left_keep_their_values() {
        let space = " ".repeat(2 * PIECE);
        let body = format!(
            r#""nodes": [[1,2],[3,4],[5,{space}6],[7,8]], "elements": [[0,1,2,3,4,{space}5]]"#
        );
        let text = format!(
            r#"{{"mesh": {{"inline": {{{body}}}}}, "analysis": {{"kind": "plane_strain"}}, "materials": []}}"#
        );
        let problem: Problem = crate::parse(&text).unwrap();
        let MeshSource::Inline(mesh) = problem.mesh.source else {
            panic!("the mesh is inline");
        };
        assert_eq!(mesh.nodes, [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0], [7.0, 8.0]]);
        assert_eq!(mesh.elements, [Element::Triangle([0, 1, 2, 3, 4, 5])]);
    }

    /// Faults are the same as in the whole text: before, within and after the lists, and in a list that is passed on
    /// from its middle.
    #[test]
    fn faults_are_the_same_as_in_the_whole_text() {
        let good = "{\"title\": \"a\",\n \"mesh\": {\"inline\": {\"nodes\": [[0,0],[1,0],\n[1,1]], \"elements\": [[0,1,2,3,4,5],\n\
                    [0,1,2,3,4,5,6,7]], \"boundaries\": {\"b\": [[0,1,2]]}}},\n \"analysis\": {\"kind\": \"plane_strain\"}, \
                    \"materials\": []}\n";
        assert!(crate::parse(good).is_ok());
        for (from, to) in [
            ("\"a\"", "a"),
            ("\"a\"", "1"),
            ("[1,0]", "[1,0,0]"),
            ("[1,0]", "[1,null]"),
            ("[1,0]", "[1,1e999]"),
            ("[1,0]", "[1,0"),
            ("[1,1]]", "[1,1]"),
            ("[1,1]", "[1,\n\n01]"),
            ("6,7]", "6]"),
            ("6,7]", "6,7.5]"),
            ("6,7]", "6,1e1]"),
            ("6,7]", "6,-1]"),
            ("[0,1,2]]", "[0,1,2]"),
            ("[0,1,2]]", "[0,1,nul]]"),
            ("plane_strain", "plain_strain"),
            ("\"materials\": []", "\"materials\": 1, \"x\": []"),
            ("\"materials\": []", "\"materials\": [}"),
            ("\"boundaries\"", "\"nodes\": [[9,9]], \"boundaries\""),
            ("\"boundaries\"", "\"elements\": [], \"boundaries\""),
            ("\"inline\"", "\"grid\": {}, \"inline\""),
            (
                "\"mesh\"",
                "\"mesh\": {\"inline\": {\"nodes\": [[1,2]]}}, \"mesh\"",
            ),
            ("}\n", "}}\n"),
            (
                "[0,1,2]",
                "[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[",
            ),
        ] {
            assert!(good.contains(from), "{from}");
            let text = good.replacen(from, to, 1);
            let whole = crate::json::check(&text, &Places::default()).unwrap_err();
            assert_eq!(crate::parse(&text).unwrap_err(), whole, "{to}");
        }
    }
}
