//! Reads the data lines of a deck: each line adds rows or values to the keyword before it.

use super::contact_parts::{ContactBlock, Turning};
use super::deck::Deck;
use super::element::Shape;
use super::part::Numbered;
use super::written::{
    DECIMAL_POINT, Distributed, Elastic, Expansion, Force, LOAD_OF_MASS, MOST_CONSTANTS, MassLoad,
    Name, On, Prescribed, Sides, Spring, Target, fields, number,
};
use solver::element::{Element, Family};
use solver::error::Reason;
use solver::mesh::NO_NODE;

/// What rows of loads act on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Rows {
    /// Sides of elements, `*DLOAD`.
    Sides,
    /// Surfaces, `*DSLOAD`.
    Surfaces,
    /// Nodes, `*CLOAD`.
    Nodes,
}

/// The keyword that the following data lines belong to.
pub(super) enum Block {
    Skip,
    Title,
    Nodes(Option<Name>),
    Elements(Elements),
    NodeSet {
        name: Name,
        of: Option<Name>,
        generate: bool,
    },
    ElementSet {
        name: Name,
        of: Option<Name>,
        generate: bool,
    },
    Surface(Name),
    NodeSurface(Name),
    Elastic(Elastic),
    Density,
    Spring(Spring),
    Orientation(Name),
    Amplitude(Name),
    Thickness,
    Expansion(Expansion),
    /// Temperatures of a step with their amplitude, if they have one; without the outer value initial ones.
    Temperatures(Option<Option<Name>>),
    Period,
    Contact(ContactBlock),
    /// Rows of `*BOUNDARY`, and the name of their amplitude.
    Boundary(Option<Name>),
    Load(Rows, Option<Name>),
    /// The data lines of `*INSTANCE` so far: the first moves a part, the second turns it.
    Instance(Vec<Vec<f64>>),
    /// A keyword that must not have data lines, by its name for messages.
    NoData(&'static str),
}

/// An `*ELEMENT` block whose data lines are being read.
pub(super) struct Elements {
    pub(super) shape: Shape,
    /// Whether the elements belong to a rigid surface.
    pub(super) is_rigid: bool,
    pub(super) set: Option<Name>,
    /// The numbers of an element (its own and its nodes') whose data continue on the next line.
    pub(super) pending: Vec<u64>,
    /// Whether the last line of an element of unknown size ended in a comma.
    pub(super) continued: bool,
}

/// The largest number of values of an amplitude that are kept: more than any curve of loads has.
const MOST_VALUES: usize = 1 << 16;

impl Deck {
    /// Reads one data line of a block.
    pub(super) fn data(&mut self, block: &mut Block, line: u64, text: &str) {
        if !matches!(block, Block::Skip | Block::Title) && self.has_long_name(line, text) {
            return self.forget(block);
        }
        match block {
            Block::Skip => {}
            Block::Title => {
                self.title
                    .get_or_insert_with(|| text.chars().take(200).collect());
            }
            Block::NoData(keyword) => {
                let expected = format!("no data after {keyword}");
                self.excess(line, text, &expected);
                *block = Block::Skip;
            }
            Block::Nodes(set) => self.node(set, line, text),
            Block::Elements(elements) => match elements.shape {
                Shape::Plane(family, count) => {
                    self.plane_elements(family, count, elements, line, text);
                }
                Shape::Line(count) => self.line_element(count, elements, line, text),
                Shape::Other(count) => self.other_element(count, elements, text),
            },
            Block::NodeSet { name, of, generate } => {
                if let Some(found) = self.members(*generate, line, text) {
                    self.node_set(name, of, line).extend(found);
                }
            }
            Block::ElementSet { name, of, generate } => {
                if let Some(found) = self.members(*generate, line, text) {
                    self.element_set(name, of, line).extend(found);
                }
            }
            Block::NodeSurface(name) => {
                if let Some(word) = fields(text).first() {
                    let target = self.target(word);
                    self.node_surface(name, line).push(target);
                }
            }
            Block::Surface(name) => self.side(name, line, text),
            Block::Elastic(elastic) => self.elastic_constants(elastic, line, text),
            Block::Density => self.density(line, text),
            Block::Spring(spring) => self.spring_data(spring, line, text),
            Block::Orientation(name) => {
                let values = self.numbers(line, text);
                if let Some(known) = self.orientations.get_mut(name)
                    && known.lines.len() < 3
                {
                    known.lines.push(values);
                }
            }
            Block::Amplitude(name) => {
                let values = self.numbers(line, text);
                if let Some(known) = self.amplitudes.get_mut(name) {
                    let room = MOST_VALUES - known.values.len().min(MOST_VALUES);
                    if values.len() > room {
                        known.other = Some(format!("more than {MOST_VALUES} numbers"));
                    }
                    known.values.extend(values.into_iter().take(room));
                }
            }
            Block::Thickness => {
                self.thickness(line, text);
                *block = Block::Skip;
            }
            Block::Expansion(expansion) => self.expansion(expansion, line, text),
            Block::Temperatures(amplitude) => self.temperature(amplitude, line, text),
            Block::Period => {
                self.period(text);
                *block = Block::Skip;
            }
            Block::Contact(block) => self.contact_data(block, line, text),
            Block::Boundary(amplitude) => {
                self.note_row(amplitude, line, text);
                self.boundary(amplitude, line, text);
            }
            Block::Load(rows, amplitude) => self.load(*rows, amplitude, line, text),
            Block::Instance(lines) => {
                let values = self.numbers(line, text);
                if lines.len() < 2 {
                    lines.push(values);
                } else {
                    self.excess(
                        line,
                        text,
                        "at most two lines after *INSTANCE: its translation, and its rotation",
                    );
                }
            }
        }
    }

    /// Reports a data line where none is allowed.
    fn excess(&mut self, line: u64, text: &str, expected: &str) {
        self.fault(
            line,
            Reason::Malformed,
            format!("`{text:.40}`"),
            expected,
            "Remove the line, or add the keyword that it belongs to.",
        );
    }

    /// Reads elastic constants.
    fn elastic_constants(&mut self, elastic: &mut Elastic, line: u64, text: &str) {
        // one more than any form has: the violation reports the excess
        let room = MOST_CONSTANTS + 1 - elastic.values.len().min(MOST_CONSTANTS);
        for (k, word) in fields(text).into_iter().take(room).enumerate() {
            let Some(value) = number(word) else {
                elastic.unreadable = true;
                let got = match word {
                    "" => format!("`{text:.60}`: constant {} is blank", k + 1),
                    _ => format!("`{word:.40}` for constant {}", k + 1),
                };
                self.doubt(
                    line,
                    got,
                    "a number for each elastic constant",
                    "Constants have no default: write every one of them, 0 too, as in `210000., 0.3`.",
                );
                continue;
            };
            elastic.values.push(value);
        }
    }

    /// Reads the thickness of a section.
    fn thickness(&mut self, line: u64, text: &str) {
        let words = fields(text);
        let Some(word) = words.first().filter(|word| !word.is_empty()) else {
            return;
        };
        // after a decimal point a comma is none: old decks have a number of integration points there
        let points = word.contains('.') && words.len() == 2 && words[1].parse::<u8>().is_ok();
        if words[1..].iter().any(|word| !word.is_empty()) && !points {
            let got = format!("`{text:.40}`");
            self.doubt(line, got, "the thickness alone", DECIMAL_POINT);
        }
        let thickness = number(word);
        if thickness.is_none() {
            self.doubt(
                line,
                format!("`{word:.40}`"),
                "the thickness, a number",
                "Write it alone on the line after *SOLID SECTION, as in `2.5`, or a comma alone for a thickness of 1.",
            );
        }
        if let Some(section) = self.here.sections.last_mut() {
            section.thickness = thickness;
        }
    }

    /// Reads the first increment and the time of a step.
    fn period(&mut self, text: &str) {
        let words = fields(text);
        let word = |k: usize| words.get(k).and_then(|word| number(word));
        // a period of 0 stands for that of 1 that a step has by itself
        self.period = word(1).filter(|period| *period > 0.0);
        self.contact.note_increments(word(0), self.period);
    }

    /// Ends a block: stores what it defines, or reports that it is incomplete.
    pub(super) fn end(&mut self, block: Block, line: u64) {
        match block {
            Block::Elements(Elements {
                shape: Shape::Plane(_, nodes),
                pending,
                ..
            }) if !pending.is_empty() => {
                self.here.incomplete.elements = true;
                let got = format!("{} numbers for element {}", pending.len() - 1, pending[0]);
                let expected = format!("{nodes} nodes");
                self.fault(
                    line,
                    Reason::Truncated,
                    got,
                    &expected,
                    "The last element before this line is not complete: write its other nodes, or correct TYPE= of *ELEMENT.",
                );
            }
            Block::Expansion(mut expansion) => {
                expansion.unreadable |= expansion.values.is_empty();
                if let Some(material) = self.material() {
                    let first = material.expansion.get_or_insert_with(|| expansion.clone());
                    first.depends_on_temperature |= first.values != expansion.values;
                }
            }
            Block::Elastic(elastic) => {
                let at = elastic.line;
                match self.material() {
                    Some(material) if material.elastic.is_none() => {
                        material.elastic = Some(elastic);
                    }
                    Some(_) => self.doubt(
                        at,
                        "*ELASTIC a second time for one material",
                        "*ELASTIC once for each material",
                        "Give the second one a material of its own.",
                    ),
                    None => self.doubt(
                        at,
                        "*ELASTIC",
                        "*ELASTIC after *MATERIAL, NAME=…",
                        "Name the material of these constants.",
                    ),
                }
            }
            Block::Instance(lines) => self.place(lines, line),
            Block::Spring(spring) => self.end_spring(spring),
            _ => {}
        }
    }

    /// Stores the position of an instance from its data lines. Nodes that the instance adds to its part are moved too.
    fn place(&mut self, lines: Vec<Vec<f64>>, line: u64) {
        let at = |row: usize, k: usize| {
            lines
                .get(row)
                .and_then(|values| values.get(k))
                .copied()
                .unwrap_or(0.0)
        };
        let moved = [at(0, 0), at(0, 1), at(0, 2)];
        let axis = [
            at(1, 3) - at(1, 0),
            at(1, 4) - at(1, 1),
            at(1, 5) - at(1, 2),
        ];
        let degrees = at(1, 6);
        let mut turned = None;
        if degrees != 0.0 {
            if axis[0] != 0.0 || axis[1] != 0.0 || axis[2] == 0.0 {
                self.fault(
                    line,
                    Reason::Unsupported,
                    format!(
                        "an instance turned by {degrees} degrees about ({}, {}, {})",
                        axis[0], axis[1], axis[2]
                    ),
                    "an axis along z, by two points",
                    "The body lies in the plane of x and y, and stays there.",
                );
            } else {
                turned = Some((
                    [at(1, 0), at(1, 1)],
                    (degrees * axis[2].signum()).to_radians(),
                ));
            }
        }
        self.placement = Some((moved, turned));
    }

    /// The numbers of a line of text; a blank field is 0.
    pub(super) fn numbers(&mut self, line: u64, text: &str) -> Vec<f64> {
        let mut values = Vec::new();
        for word in fields(text) {
            match number(word) {
                Some(value) => values.push(value),
                None => {
                    values.push(0.0);
                    if !word.is_empty() {
                        self.fault(
                            line,
                            Reason::Malformed,
                            format!("`{word:.40}` in `{text:.60}`"),
                            "a number",
                            "Write a number like `1.5` or `1.5E-3` there; a blank is 0.",
                        );
                    }
                }
            }
        }
        values
    }

    /// Records that a line of a block cannot be read, so that names or numbers which it defines are unknown.
    fn forget(&mut self, block: &Block) {
        match block {
            Block::Nodes(_) => self.here.incomplete.nodes = true,
            Block::Elements(_) => self.here.incomplete.elements = true,
            _ => self.here.incomplete.names = true,
        }
    }

    fn node(&mut self, set: &Option<Name>, line: u64, text: &str) {
        let mut words = fields(text).into_iter();
        let label = words.next().and_then(|w| w.parse::<u64>().ok());
        let mut place = [0.0; 3];
        let mut sound = label.is_some();
        let mut height = "";
        for (axis, word) in words.by_ref().take(3).enumerate() {
            match number(word) {
                Some(value) => place[axis] = value,
                None => sound &= word.is_empty(),
            }
            height = word;
        }
        // decks have a zero after a blank z; after a number it may be the rest of one with a decimal comma
        let nothing =
            |word: &str| word.is_empty() || height.is_empty() && number(word) == Some(0.0);
        if words.any(|word| !nothing(word)) {
            self.here.incomplete.nodes = true;
            let got = format!("`{text:.60}`");
            let expected = "a node: its number, and at most x, y, z";
            self.fault(line, Reason::Malformed, got, expected, DECIMAL_POINT);
            return;
        }
        let Some(label) = label.filter(|_| sound) else {
            self.here.incomplete.nodes = true;
            self.fault(
                line,
                Reason::Malformed,
                format!("`{text:.60}`"),
                "a node: its number, a whole number > 0, and x, y",
                "Write it like `7, 0.5, 1.25`; a blank coordinate is 0, a blank number has no default.",
            );
            return;
        };
        let [x, y, z] = place;
        if self.here.nodes.len() >= NO_NODE as usize || !self.here.node_places.add(label) {
            // programs write a node again where it belongs to another set
            let known = self.here.node_places.get(label).map(|node| node as usize);
            let same =
                |node: usize| self.here.nodes[node] == [x, y] && self.here.heights[node] == z;
            if !known.is_some_and(same) {
                self.fault(
                    line,
                    Reason::RepeatedNode,
                    format!("node {label} a second time"),
                    "each node once, or the same coordinates again",
                    "Give one of the two another number, also in the elements and sets that name it.",
                );
                return;
            }
        } else {
            self.here.nodes.push([x, y]);
            self.here.heights.push(z);
            self.here.node_labels.push(label);
        }
        if let Some(name) = set {
            self.node_set(name, &None, line).push(Target::Label(label));
        }
    }

    /// Reads a data line with a plane element, whose numbers may continue on the next line.
    fn plane_elements(
        &mut self,
        family: Family,
        count: usize,
        Elements { set, pending, .. }: &mut Elements,
        line: u64,
        text: &str,
    ) {
        for (place, word) in fields(text).into_iter().enumerate() {
            let Ok(number) = word.parse() else {
                let got = match word {
                    "" => format!("`{text:.60}`: field {} is blank", place + 1),
                    _ => format!("`{word:.40}` in `{text:.60}`"),
                };
                self.fault(
                    line,
                    Reason::Malformed,
                    got,
                    "an element: its number, and the numbers of its nodes",
                    "Write whole numbers, as in `4, 1, 2, 12, 11`.",
                );
                // its next line begins another element, or continues this one: both are unknown
                pending.clear();
                self.here.incomplete.elements = true;
                return;
            };
            pending.push(number);
            if pending.len() == count + 1 {
                let numbers = std::mem::take(pending);
                self.element(family, set, line, &numbers);
            }
        }
    }

    /// Adds an element of a plane mesh. `numbers`: the number of the element, then the numbers of its nodes.
    fn element(&mut self, family: Family, set: &Option<Name>, line: u64, numbers: &[u64]) {
        let label = numbers[0];
        let mut nodes = [NO_NODE; 9];
        for (slot, number) in nodes.iter_mut().zip(&numbers[1..]) {
            let Some(node) = self.here.node_places.get(*number) else {
                self.here.incomplete.elements = true;
                if self.here.incomplete.nodes {
                    return; // it may be the node that could not be read
                }
                let hint = match self.here.node_places.ends() {
                    Some((first, last)) => format!(
                        "The nodes above have numbers from {first} to {last}, not necessarily all of them. Correct the number, or define the node by *NODE before the element."
                    ),
                    None => {
                        "No *NODE stands above. Define the nodes before the elements.".to_owned()
                    }
                };
                self.fault(
                    line,
                    Reason::UnknownNode,
                    format!("node {number} in element {label}"),
                    "the number of a node that an earlier *NODE defines",
                    &hint,
                );
                return;
            };
            *slot = node;
        }
        let place = Numbered::Plane(self.here.elements.len() as u32);
        if !self.number(label, place, set, line) {
            self.fault(
                line,
                Reason::RepeatedElement,
                format!("element {label} a second time"),
                "each element once",
                "Give one of the two another number, also in the sets that name it.",
            );
            return;
        }
        let [a, b, c, d, e, f, g, h, centre] = nodes;
        self.here.elements.push(match family {
            Family::Quad => Element::Quad([a, b, c, d, e, f, g, h]),
            Family::Triangle => Element::Triangle([a, b, c, d, e, f]),
        });
        self.here.with_centre += usize::from(centre != NO_NODE);
        self.here.element_labels.push(label);
    }

    /// Gives an element its number; false if another element has that number.
    fn number(&mut self, label: u64, place: Numbered, set: &Option<Name>, line: u64) -> bool {
        if !self.here.element_places.add(label) {
            return false;
        }
        self.here.numbered.push(place);
        if let Some(name) = set {
            self.element_set(name, &None, line)
                .push(Target::Label(label));
        }
        true
    }

    /// Reads a data line with a line element; an element that cannot be read is left out of the mesh without a
    /// violation.
    fn line_element(&mut self, count: usize, elements: &Elements, line: u64, text: &str) {
        let words = fields(text);
        let Some(label) = words.first().and_then(|word| word.parse().ok()) else {
            return;
        };
        let mut nodes = [NO_NODE; 3];
        for (slot, word) in nodes.iter_mut().zip(&words[1..]).take(count) {
            let known = word.parse().ok();
            *slot = known
                .and_then(|label| self.here.node_places.get(label))
                .unwrap_or(NO_NODE);
        }
        let whole = nodes[..count].iter().all(|node| *node != NO_NODE);
        let place = if whole {
            Numbered::Line(self.here.lines.len() as u32)
        } else {
            Numbered::Other
        };
        if self.number(label, place, &elements.set, line) && whole {
            self.here.lines.push(nodes);
        }
        if elements.is_rigid
            && let Some(lines) = self.here.rigid_lines.last_mut()
        {
            lines.places.end = self.here.numbered.len() as u32;
        }
    }

    /// Reads a data line with an element that a plane mesh leaves out, but that sets may name.
    fn other_element(
        &mut self,
        count: Option<usize>,
        Elements {
            set,
            pending,
            continued,
            ..
        }: &mut Elements,
        text: &str,
    ) {
        let words = fields(text).into_iter().filter(|word| !word.is_empty());
        let numbers: Vec<u64> = words.map(|word| word.parse().unwrap_or_default()).collect();
        let begins = pending.is_empty() && !*continued;
        if begins && let Some(label) = numbers.first() {
            self.number(*label, Numbered::Other, set, 0);
        }
        match count {
            Some(count) => {
                pending.extend(numbers);
                if pending.len() > count {
                    pending.clear();
                }
            }
            None => *continued = text.trim_end().ends_with(','),
        }
    }

    /// Reads a data line of a surface: an element or set, and the number of a side. Without a number all sides of the
    /// elements on the body's surface are meant.
    fn side(&mut self, name: &Name, line: u64, text: &str) {
        let words = fields(text);
        let side = match words.get(1) {
            None => Some(Sides::Outer),
            // edges of shells are the sides of their plane
            Some(word) => match &word.to_uppercase()[..] {
                "SPOS" => Some(Sides::OfLine { left: true }),
                "SNEG" => Some(Sides::OfLine { left: false }),
                "END1" | "END2" | "CIRCUMFERENTIAL" | "S5" | "S6" | "SP" | "SN" => {
                    Some(Sides::None)
                }
                _ => side_number(word, &['S', 'E']).map(Sides::Number),
            },
        };
        match (words.first().filter(|word| !word.is_empty()), side) {
            (Some(word), Some(side)) => {
                let target = self.target(word);
                self.surface(name, line).push((target, side));
            }
            _ => self.fault(
                line,
                Reason::Malformed,
                format!("`{text:.40}`"),
                "an element or a set of elements, and a side S1 … S4",
                "Write the line like `TOP, S3`; `TOP` alone means all sides of its elements that lie on the surface of the body. The element or set must be given.",
            ),
        }
    }

    fn members(&mut self, generate: bool, line: u64, text: &str) -> Option<Vec<Target>> {
        let words = fields(text);
        if !generate {
            let written = words.into_iter().filter(|word| !word.is_empty());
            return Some(written.map(|word| self.target(word)).collect());
        }
        let numbers: Option<Vec<u64>> = words.iter().map(|word| word.parse().ok()).collect();
        let range = match numbers.as_deref() {
            Some([first, last]) => Some([*first, *last, 1]),
            Some([first, last, step]) if *step > 0 => Some([*first, *last, *step]),
            _ => None,
        };
        if range.is_none() {
            self.fault(
                line,
                Reason::Malformed,
                format!("`{text:.40}`"),
                "first number, last number, and a step > 0 if it is not 1",
                "With GENERATE a line is a range of numbers, as in `1, 21, 2`: names and blanks have no meaning there.",
            );
        }
        range.map(|range| vec![Target::Range(range.into())])
    }

    /// Reads a row of `*BOUNDARY`: node or set; first component; last component (the first if left out); value (0 if
    /// left out). A name may replace the components.
    fn boundary(&mut self, amplitude: &Option<Name>, line: u64, text: &str) {
        let words = fields(text);
        let word = |k: usize| words.get(k).copied().unwrap_or_default();
        let component = |k: usize| word(k).parse::<u64>().ok();
        let first = component(1);
        let components = match (first, &word(1).to_uppercase()[..]) {
            (Some(first), _) if word(2).is_empty() => Some((first, first)),
            (Some(first), _) => component(2).map(|last| (first, last)),
            (None, name) if words.len() == 2 => named_components(name),
            _ => None,
        };
        let value = match word(3) {
            "" => Some(0.0),
            word => number(word),
        };
        // the third displacement and the rotations of a plane body are always zero
        let known =
            |(first, last): &(u64, u64)| (1..=6).contains(first) && first <= last && *last <= 6;
        let row = components.filter(known).zip(value);
        match row.filter(|_| words.len() <= 4 && !word(0).is_empty()) {
            Some(((3.., _), 0.0)) => {}
            Some(((component @ (3 | 6), last), value)) if last == component => {
                let why =
                    format!("a value of {value} for a component that a plane body does not have");
                let got = format!("`{text:.60}`: {why}");
                self.note_turning(Turning {
                    line,
                    component,
                    doubt: (got, PRESCRIBED, COMPONENTS),
                });
            }
            Some(((first, last), value)) if first < 3 && (last < 3 || value == 0.0) => {
                let target = self.target(word(0));
                self.here.prescribed.push(Prescribed {
                    line,
                    target,
                    components: (first, last.min(2)),
                    value,
                    amplitude: amplitude.clone(),
                });
            }
            _ => {
                let why = match (components, value) {
                    _ if word(0).is_empty() => "the node or set is blank".to_owned(),
                    _ if words.len() > 4 => format!("{} fields", words.len()),
                    _ if words.len() == 1 || word(1).is_empty() => {
                        "the first component is blank, which has no default".to_owned()
                    }
                    (_, None) => format!("the value `{:.40}` is no number", word(3)),
                    (Some((3.., _)), Some(value)) if known(&components.unwrap_or_default()) => {
                        format!(
                            "a value of {value} for a component that a plane body does not have"
                        )
                    }
                    (Some(found), Some(value)) if known(&found) => {
                        format!("a value of {value} for components up to {}", found.1)
                    }
                    (Some((first, last)), _) => format!("components {first} to {last}"),
                    (None, _) if first.is_some() => {
                        format!("the last component `{:.40}` is no number", word(2))
                    }
                    (None, _) if named_components(&word(1).to_uppercase()).is_some() => {
                        format!("fields after the name `{:.40}`", word(1))
                    }
                    (None, _) => format!("`{:.40}` in place of a component", word(1)),
                };
                self.doubt(line, format!("`{text:.60}`: {why}"), PRESCRIBED, COMPONENTS);
            }
        }
    }

    /// Keeps a row of a rotation or a moment until it is known which nodes are those of rigid bodies.
    fn note_turning(&mut self, row: Turning) {
        /// As many as rigid bodies in steps have a use for.
        const MOST: usize = 1 << 16;
        if self.contact.turning.len() < MOST {
            self.contact.turning.push(row);
        } else {
            let (got, expected, hint) = row.doubt;
            self.doubt(row.line, got, expected, hint);
        }
    }

    /// Reads a row of loads: the target, the kind of load or the component, and the value (0 if left out).
    fn load(&mut self, rows: Rows, amplitude: &Option<Name>, line: u64, text: &str) {
        let words = fields(text);
        let word = |k: usize| words.get(k).copied().unwrap_or_default();
        let value = match word(2) {
            "" => Some(0.0),
            word => number(word),
        };
        let of_mass = rows == Rows::Sides && MassLoad::is_kind(word(1));
        // a load of the mass without a target acts on all elements
        let value = value.filter(|_| of_mass || words.len() <= 3 && !word(0).is_empty());
        let amplitude = amplitude.clone();
        // 6, and 3 of a rotation node, is the moment on a rigid body
        let component = word(1).parse().ok().filter(|c| [1, 2, 3, 6].contains(c));
        let on = match rows {
            Rows::Surfaces => word(1).eq_ignore_ascii_case("P").then_some(On::Surface),
            _ if of_mass => {
                MassLoad::read(word(1), words.get(3..).unwrap_or_default()).map(On::Mass)
            }
            _ => side_number(word(1), &['P']).map(On::Side),
        };
        match (rows, value, on, component) {
            (Rows::Nodes, Some(value), _, Some(component)) => {
                if component > 2 {
                    self.note_turning(Turning {
                        line,
                        component,
                        doubt: (
                            format!("`{text:.60}`: {}", unlike_load(&words, "component")),
                            FORCE,
                            BLANK,
                        ),
                    });
                }
                let target = self.target(word(0));
                self.here.forces.push(Force {
                    line,
                    target,
                    component,
                    value,
                    amplitude,
                });
            }
            (Rows::Nodes, ..) => self.doubt(
                line,
                format!("`{text:.60}`: {}", unlike_load(&words, "component")),
                FORCE,
                BLANK,
            ),
            (_, Some(value), Some(on), _) => {
                let target = self.target(word(0));
                self.here.pressures.push(Distributed {
                    line,
                    target,
                    on,
                    value,
                    amplitude,
                });
            }
            _ => {
                let (expected, hint) = match rows {
                    _ if of_mass => (
                        LOAD_OF_MASS,
                        "A blank set is that of all elements. All numbers after the value are the direction, or a point and the direction; a blank one is 0, and the direction must not be 0.",
                    ),
                    Rows::Surfaces => (
                        "a pressure: surface, P, value",
                        "A blank value is 0; the surface and P have no default. Give shear as `tangential` of a load in a problem as JSON, with this deck as its mesh.",
                    ),
                    _ => (
                        "a pressure: element or set, P1 … P4, value",
                        "A blank value is 0; the element and P1 … P4 have no default. Gravity is GRAV, rotation CENTRIF; other loads are not computed.",
                    ),
                };
                self.doubt(
                    line,
                    format!("`{text:.60}`: {}", unlike_load(&words, "kind of load")),
                    expected,
                    hint,
                );
            }
        }
    }
}

/// What a row of `*BOUNDARY` is, and advice.
const PRESCRIBED: &str = "node or set, first component, last component, value; or node or set, a name like XSYMM or ENCASTRE";
const COMPONENTS: &str = "Components are 1 (x) and 2 (y), and 6 at the reference node of a *RIGID BODY. A blank last component means the first one alone, a blank value 0. Temperatures and other unknowns cannot be prescribed.";

/// What a row of `*CLOAD` is, and advice.
const FORCE: &str =
    "a force: node or set, 1 (x) or 2 (y), or 6 (the moment on a rigid body), value";
const BLANK: &str = "A blank value is 0; the node and the component have no default. Moments have a meaning at the reference node of a *RIGID BODY only, forces out of the plane have none.";

/// Says why a row of loads is invalid. `second`: the meaning of the row's second field, in words.
fn unlike_load(words: &[&str], second: &str) -> String {
    match words {
        [] | ["", ..] => "the target of the load is blank".to_owned(),
        [_] | [_, "", ..] => format!("the {second} is blank, which has no default"),
        [_, _, value, rest @ ..]
            if !value.is_empty() && number(value).is_none() && rest.is_empty() =>
        {
            format!("the value `{value:.40}` is no number")
        }
        [_, kind, ..] if words.len() <= 3 => format!("the {second} `{kind:.40}`"),
        _ => format!(
            "{} fields, with the {second} `{:.40}`",
            words.len(),
            words[1]
        ),
    }
}

/// The first and the last component (1: x, 2: y, 3: z) that a name such as `XSYMM` in `*BOUNDARY` holds at 0; none for
/// an unknown name. Components outside the plane are left out, unless the name holds no others (`ZSYMM`).
pub(super) fn named_components(name: &str) -> Option<(u64, u64)> {
    match name {
        "PINNED" | "ENCASTRE" | "ZASYMM" => Some((1, 2)),
        "XSYMM" | "YASYMM" => Some((1, 1)),
        "YSYMM" | "XASYMM" => Some((2, 2)),
        "ZSYMM" => Some((3, 3)),
        _ => None,
    }
}

/// The number of a side written as S1 … S4 or P1 … P4.
fn side_number(word: &str, letters: &[char]) -> Option<usize> {
    let rest = word.strip_prefix(|c: char| letters.contains(&c.to_ascii_uppercase()))?;
    rest.parse().ok().filter(|side| (1..=4).contains(side))
}
