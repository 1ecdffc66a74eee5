//! Blocks of data lines: what each line adds to the deck.

use super::deck::{
    Deck, Elastic, ElementType, Force, MOST_CONSTANTS, Name, Prescribed, Pressure, Target,
};
use solver::element::{Element, Family};
use solver::error::Reason;
use solver::mesh::NO_NODE;

/// The keyword that the following data lines belong to.
pub(super) enum Block {
    Skip,
    Title,
    Nodes(Option<Name>),
    Elements {
        kind: ElementType,
        set: Option<Name>,
        pending: Vec<u64>,
    },
    NodeSet {
        name: Name,
        generate: bool,
    },
    ElementSet {
        name: Name,
        generate: bool,
    },
    Surface(Name),
    NodeSurface(Name),
    Elastic {
        material: Option<Name>,
        elastic: Elastic,
    },
    Thickness,
    Boundary,
    Dload,
    Dsload,
    Cload,
    /// A keyword that allows no data lines here.
    NoData(&'static str),
}

impl Deck {
    /// One line of a block.
    pub(super) fn data(&mut self, block: &mut Block, line: u64, text: &str) {
        if !matches!(block, Block::Skip | Block::Title) && self.has_long_name(line, text) {
            return self.forget(block);
        }
        let words = text
            .split(',')
            .map(str::trim)
            .filter(|word| !word.is_empty());
        match block {
            Block::Skip => {}
            Block::Title => {
                self.title
                    .get_or_insert_with(|| text.chars().take(200).collect());
            }
            Block::NoData(keyword) => {
                let got = format!("`{text:.40}`");
                let expected = format!("no data after {keyword}");
                self.fault(
                    line,
                    Reason::Malformed,
                    got,
                    &expected,
                    "Remove the line, or add the keyword that it belongs to.",
                );
                *block = Block::Skip;
            }
            Block::Nodes(set) => self.node(set, line, text),
            Block::Elements { kind, set, pending } => {
                for word in words {
                    match word.parse() {
                        Ok(number) => pending.push(number),
                        Err(_) => {
                            self.fault(
                                line,
                                Reason::Malformed,
                                format!("`{word:.40}`"),
                                "a number of a node or element",
                                "Correct that line.",
                            );
                            // its next line begins another element, or continues this one: both are unknown
                            pending.clear();
                            self.incomplete.elements = true;
                            return;
                        }
                    }
                    if pending.len() == kind.nodes + 1 {
                        let numbers = std::mem::take(pending);
                        let (kind, set) = (*kind, set.clone());
                        self.element(kind, set, line, &numbers);
                    }
                }
            }
            Block::NodeSet { name, generate } => {
                if let Some(found) = self.members(*generate, line, text) {
                    self.node_set(name, line).extend(found);
                }
            }
            Block::ElementSet { name, generate } => {
                if let Some(found) = self.members(*generate, line, text) {
                    self.element_set(name, line).extend(found);
                }
            }
            Block::NodeSurface(name) => {
                let target = self.target(text.split(',').next().unwrap_or_default());
                self.node_set(name, line).push(target);
            }
            Block::Surface(name) => {
                let mut words = words;
                let (target, side) = (
                    words.next().unwrap_or_default(),
                    words.next().unwrap_or_default(),
                );
                let target = self.target(target);
                match side_number(side, 'S') {
                    Some(side) => self.surface(name, line).push((target, side)),
                    None => self.fault(
                        line,
                        Reason::Malformed,
                        format!("`{text:.40}`"),
                        "an element or a set of them, and S1 … S4",
                        "Name the sides of the surface.",
                    ),
                }
            }
            Block::Elastic { elastic, .. } => {
                // one more than any form has: the violation reports the excess
                let room = MOST_CONSTANTS + 1 - elastic.values.len().min(MOST_CONSTANTS);
                for word in words.take(room) {
                    match number(word) {
                        Some(value) => elastic.values.push(value),
                        None => {
                            elastic.unreadable = true;
                            self.doubt(
                                line,
                                format!("`{word:.40}`"),
                                "a number",
                                "Correct that line.",
                            );
                        }
                    }
                }
            }
            Block::Thickness => {
                if let (Some(section), Some(word)) =
                    (self.sections.last_mut(), words.into_iter().next())
                {
                    section.thickness = number(word);
                }
                *block = Block::Skip;
            }
            Block::Boundary => self.boundary(line, text),
            Block::Dload | Block::Dsload => {
                let words: Vec<&str> = words.collect();
                let surface = matches!(block, Block::Dsload);
                let side = match surface {
                    true => words
                        .get(1)
                        .filter(|w| w.eq_ignore_ascii_case("P"))
                        .map(|_| None),
                    false => words.get(1).and_then(|w| side_number(w, 'P')).map(Some),
                };
                match (side, words.get(2).and_then(|w| number(w))) {
                    (Some(side), Some(value)) => {
                        let target = self.target(words[0]);
                        self.pressures.push(Pressure {
                            line,
                            target,
                            side,
                            value,
                        });
                    }
                    _ => self.doubt(
                        line,
                        format!("`{text:.60}`"),
                        "a pressure: element or set, P1 … P4, value (*DSLOAD: surface, P, value)",
                        "Give other loads in a problem of Signorini.",
                    ),
                }
            }
            Block::Cload => {
                let words: Vec<&str> = words.collect();
                let component = words
                    .get(1)
                    .and_then(|w| w.parse().ok())
                    .filter(|c| (1..=2).contains(c));
                match (component, words.get(2).and_then(|w| number(w))) {
                    (Some(component), Some(value)) => {
                        let target = self.target(words[0]);
                        self.forces.push(Force {
                            line,
                            target,
                            component,
                            value,
                        });
                    }
                    _ => self.doubt(
                        line,
                        format!("`{text:.60}`"),
                        "a force: node or set, 1 or 2, value",
                        "Forces act along x (1) and y (2).",
                    ),
                }
            }
        }
    }

    /// The end of a block, which must be complete.
    pub(super) fn end(&mut self, block: Block, line: u64) {
        match block {
            Block::Elements { kind, pending, .. } if !pending.is_empty() => {
                self.incomplete.elements = true;
                let got = format!("{} numbers for element {}", pending.len() - 1, pending[0]);
                let expected = format!("{} nodes", kind.nodes);
                self.fault(
                    line,
                    Reason::Truncated,
                    got,
                    &expected,
                    "The last element before this line is not complete.",
                );
            }
            Block::Elastic { material, elastic } => match material {
                Some(name) => {
                    self.materials.insert(name, elastic);
                }
                None => self.doubt(
                    elastic.line,
                    "*ELASTIC",
                    "*ELASTIC after *MATERIAL, NAME=…",
                    "Name the material of these constants.",
                ),
            },
            _ => {}
        }
    }

    /// A line of a block cannot be read: what it would have added is unknown.
    fn forget(&mut self, block: &Block) {
        match block {
            Block::Nodes(_) => self.incomplete.nodes = true,
            Block::Elements { .. } => self.incomplete.elements = true,
            _ => self.incomplete.names = true,
        }
    }

    fn node(&mut self, set: &Option<Name>, line: u64, text: &str) {
        let mut words = text.split(',').map(str::trim);
        let label = words.next().and_then(|w| w.parse::<u64>().ok());
        let mut place = [0.0; 3];
        let mut sound = label.is_some();
        for (axis, word) in words.by_ref().take(3).enumerate() {
            match number(word) {
                Some(value) => place[axis] = value,
                None => sound &= word.is_empty(),
            }
        }
        let Some(label) = label.filter(|_| sound) else {
            self.incomplete.nodes = true;
            self.fault(
                line,
                Reason::Malformed,
                format!("`{text:.60}`"),
                "a node: number, x, y",
                "Correct that line.",
            );
            return;
        };
        if self.raw.nodes.len() >= NO_NODE as usize || !self.nodes.add(label) {
            self.fault(
                line,
                Reason::RepeatedNode,
                format!("node {label} a second time"),
                "each node once",
                "Renumber it.",
            );
            return;
        }
        self.plane.add(label, place);
        if let Some(name) = set {
            self.node_set(name, line).push(Target::Label(label));
        }
        self.raw.nodes.push([place[0], place[1]]);
        self.raw.node_labels.push(label);
    }

    fn element(&mut self, kind: ElementType, set: Option<Name>, line: u64, numbers: &[u64]) {
        let label = numbers[0];
        let mut nodes = [NO_NODE; 8];
        for (slot, number) in nodes.iter_mut().zip(&numbers[1..]) {
            let Some(node) = self.nodes.get(*number) else {
                self.incomplete.elements = true;
                if self.incomplete.nodes {
                    return; // it may be the node that could not be read
                }
                self.fault(
                    line,
                    Reason::UnknownNode,
                    format!("node {number} in element {label}"),
                    "a node of an earlier *NODE",
                    "Correct the number.",
                );
                return;
            };
            *slot = node;
        }
        if !self.elements.add(label) {
            self.fault(
                line,
                Reason::RepeatedElement,
                format!("element {label} a second time"),
                "each element once",
                "Renumber it.",
            );
            return;
        }
        let [a, b, c, d, e, f, g, h] = nodes;
        self.raw.elements.push(match (kind.family, kind.nodes) {
            (Family::Quad, _) => Element::Quad([a, b, c, d, e, f, g, h]),
            (Family::Triangle, 3) => Element::Triangle([a, b, c, NO_NODE, NO_NODE, NO_NODE]),
            (Family::Triangle, _) => Element::Triangle([a, b, c, d, e, f]),
        });
        self.raw.element_labels.push(label);
        if let Some(name) = set {
            self.element_set(&name, line).push(Target::Label(label));
        }
    }

    fn members(&mut self, generate: bool, line: u64, text: &str) -> Option<Vec<Target>> {
        let words: Vec<&str> = text
            .split(',')
            .map(str::trim)
            .filter(|w| !w.is_empty())
            .collect();
        if !generate {
            return Some(words.into_iter().map(|word| self.target(word)).collect());
        }
        let numbers: Vec<u64> = words.iter().filter_map(|word| word.parse().ok()).collect();
        match numbers[..] {
            [first, last] if words.len() == 2 => Some(vec![Target::Range([first, last, 1].into())]),
            [first, last, step] if step > 0 => {
                Some(vec![Target::Range([first, last, step].into())])
            }
            _ => {
                self.fault(
                    line,
                    Reason::Malformed,
                    format!("`{text:.40}`"),
                    "first, last, step",
                    "Correct that line.",
                );
                None
            }
        }
    }

    fn boundary(&mut self, line: u64, text: &str) {
        let words: Vec<&str> = text
            .split(',')
            .map(str::trim)
            .filter(|w| !w.is_empty())
            .collect();
        let component = |k: usize| words.get(k).and_then(|w| w.parse::<u64>().ok());
        let named = words.get(1).map(|w| w.to_uppercase());
        let components = match (
            component(1),
            words.get(2).is_some(),
            component(2),
            named.as_deref(),
        ) {
            (Some(first), true, Some(last), _) => Some((first, last)),
            (Some(first), false, _, _) => Some((first, first)),
            (_, false, _, Some("PINNED" | "ENCASTRE")) => Some((1, 2)),
            (_, false, _, Some("XSYMM")) => Some((1, 1)),
            (_, false, _, Some("YSYMM")) => Some((2, 2)),
            _ => None,
        };
        let value = words.get(3).map_or(Some(0.0), |word| number(word));
        // the third displacement and the rotations of a plane body are always zero
        let known =
            |(first, last): &(u64, u64)| (1..=6).contains(first) && first <= last && *last <= 6;
        match (components.filter(known), value) {
            (Some((3.., _)), Some(0.0)) => {}
            (Some((first, last)), Some(value)) if first < 3 && (last < 3 || value == 0.0) => {
                let target = self.target(words[0]);
                let components = (first, last.min(2));
                self.prescribed.push(Prescribed {
                    line,
                    target,
                    components,
                    value,
                });
            }
            _ => self.doubt(
                line,
                format!("`{text:.60}`"),
                "node or set, first and last component (1: x, 2: y), value",
                "Only displacements can be prescribed.",
            ),
        }
    }
}

/// Fortran writes exponents with D.
fn number(word: &str) -> Option<f64> {
    let parsed = word
        .parse()
        .or_else(|_| word.replace(['d', 'D'], "e").parse());
    parsed.ok().filter(|value: &f64| value.is_finite())
}

/// S1 … S4, P1 … P4.
fn side_number(word: &str, letter: char) -> Option<usize> {
    let rest = word.strip_prefix([letter, letter.to_ascii_lowercase()])?;
    rest.parse().ok().filter(|side| (1..=4).contains(side))
}
