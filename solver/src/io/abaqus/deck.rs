//! A deck, keyword by keyword.

use std::collections::{BTreeMap, HashMap};
use std::io::BufRead;

use crate::element::{Element, Family};
use crate::error::Violation;
use crate::io::source::{Labels, Plane, ReadError, Source};
use crate::mesh::{NO_NODE, RawMesh};

/// More faults than this say nothing new.
const MOST_LISTED: usize = 50;

/// The theory that a type of element stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Theory {
    PlaneStrain,
    PlaneStress,
    Axisymmetric,
}

/// What a set or a load refers to.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Target {
    Label(u64),
    /// First, last, step.
    Range(u64, u64, u64),
    Set(String),
}

/// One `*ELEMENT` type in use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ElementType {
    pub(super) theory: Theory,
    family: Family,
    nodes: usize,
    /// Integrated with the smaller rule.
    pub(super) reduced: bool,
}

impl ElementType {
    pub(super) fn is_triangle(&self) -> bool {
        self.family == Family::Triangle
    }
}

/// `*ELASTIC`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Elastic {
    pub(super) line: u64,
    pub(super) engineering_constants: bool,
    pub(super) values: Vec<f64>,
}

/// `*SOLID SECTION`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Section {
    pub(super) line: u64,
    pub(super) elements: String,
    pub(super) material: String,
    pub(super) thickness: Option<f64>,
}

/// A row of `*BOUNDARY`: components first … last (1: x, 2: y) have a value.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Prescribed {
    pub(super) line: u64,
    pub(super) target: Target,
    pub(super) components: (u64, u64),
    pub(super) value: f64,
}

/// A row of `*DLOAD` or `*DSLOAD`: a pressure on sides, or on a surface.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Pressure {
    pub(super) target: Target,
    /// Number of the side from 1; none: `target` is a surface.
    pub(super) side: Option<usize>,
    pub(super) value: f64,
}

/// A row of `*CLOAD`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Force {
    pub(super) line: u64,
    pub(super) target: Target,
    pub(super) component: u64,
    pub(super) value: f64,
}

/// Everything that was understood, and what was not.
#[derive(Default)]
pub(super) struct Deck {
    raw: RawMesh,
    nodes: Labels,
    elements: Labels,
    plane: Plane,
    node_sets: BTreeMap<String, Vec<Target>>,
    element_sets: BTreeMap<String, Vec<Target>>,
    /// Sides by element or set and number.
    surfaces: BTreeMap<String, Vec<(Target, usize)>>,
    /// The spelling of each name, by the name in capitals.
    spelling: HashMap<String, String>,
    pub(super) types: Vec<ElementType>,
    pub(super) materials: BTreeMap<String, Elastic>,
    pub(super) sections: Vec<Section>,
    pub(super) prescribed: Vec<Prescribed>,
    pub(super) pressures: Vec<Pressure>,
    pub(super) forces: Vec<Force>,
    pub(super) steps: usize,
    pub(super) title: Option<String>,
    /// What is wrong with the mesh.
    faults: Vec<Violation>,
    /// What of the analysis was not understood.
    pub(super) doubts: Vec<Violation>,
}

/// What the data lines that follow belong to.
enum Block {
    Skip,
    Title,
    Nodes(Option<String>),
    Elements {
        kind: ElementType,
        set: Option<String>,
        pending: Vec<u64>,
    },
    NodeSet {
        name: String,
        generate: bool,
    },
    ElementSet {
        name: String,
        generate: bool,
    },
    Surface(String),
    NodeSurface(String),
    Elastic {
        material: Option<String>,
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

/// A keyword line in parts.
struct Keyword {
    name: String,
    parameters: Vec<(String, Option<String>)>,
}

impl Keyword {
    fn new(text: &str) -> Self {
        let mut parts = text[1..].split(',').map(str::trim);
        // blanks count as one
        let words: Vec<&str> = parts
            .next()
            .unwrap_or_default()
            .split_whitespace()
            .collect();
        let parameter = |part: &str| {
            let (name, value) = match part.split_once('=') {
                Some((name, value)) => {
                    (name.trim(), Some(value.trim().trim_matches('"').to_owned()))
                }
                None => (part, None),
            };
            (name.to_uppercase(), value)
        };
        Keyword {
            name: words.join(" ").to_uppercase(),
            parameters: parts
                .filter(|part| !part.is_empty())
                .map(parameter)
                .collect(),
        }
    }

    fn has(&self, name: &str) -> bool {
        self.parameters.iter().any(|p| p.0 == name)
    }

    fn get(&self, name: &str) -> Option<&str> {
        let found = self.parameters.iter().find(|p| p.0 == name)?;
        found.1.as_deref()
    }
}

impl Deck {
    pub(super) fn read(reader: impl BufRead) -> Result<Self, ReadError> {
        let mut source = Source::new(reader);
        let mut deck = Deck::default();
        let mut block = Block::NoData("the first keyword");
        let mut material: Option<String> = None;
        while source.advance()? {
            let line = source.line;
            let mut text = source.text().trim().to_owned();
            if text.is_empty() || text.starts_with("**") {
                continue;
            }
            if !text.starts_with('*') {
                deck.data(&mut block, line, &text);
                continue;
            }
            // a keyword goes on in the next line where it ends in a comma
            while text.ends_with(',') && source.advance()? {
                text.push_str(source.text().trim());
            }
            deck.end(block, line);
            block = deck.begin(&Keyword::new(&text), line, &mut material);
        }
        let line = source.line;
        deck.end(block, line);
        if deck.raw.nodes.is_empty() {
            deck.fault(
                line,
                "too_few",
                "a deck without *NODE",
                "nodes and elements",
                "Is it an Abaqus or CalculiX deck (.inp)?",
            );
        }
        deck.faults.extend(deck.plane.fault());
        Ok(deck)
    }

    fn fault(
        &mut self,
        line: u64,
        reason: &str,
        got: impl Into<String>,
        expected: &str,
        hint: &str,
    ) {
        say(&mut self.faults, line, reason, got.into(), expected, hint);
    }

    pub(super) fn doubt(&mut self, line: u64, got: impl Into<String>, expected: &str, hint: &str) {
        say(
            &mut self.doubts,
            line,
            "not_understood",
            got.into(),
            expected,
            hint,
        );
    }

    /// The name as it was first written.
    fn spelled(&mut self, name: &str) -> String {
        let known = self.spelling.entry(name.to_uppercase());
        known.or_insert_with(|| name.to_owned()).clone()
    }

    fn target(&mut self, word: &str) -> Target {
        let word = word.trim().trim_matches('"');
        match word.parse() {
            Ok(label) => Target::Label(label),
            // an assembly's sets may name their instance: INSTANCE.SET
            Err(_) => Target::Set(self.spelled(word.rsplit('.').next().unwrap_or(word))),
        }
    }

    fn begin(&mut self, keyword: &Keyword, line: u64, material: &mut Option<String>) -> Block {
        match &keyword.name[..] {
            "HEADING" => Block::Title,
            "NODE" => {
                if keyword.has("SYSTEM") || keyword.has("INPUT") {
                    self.fault(line, "unsupported", "*NODE with SYSTEM or INPUT", "coordinates x, y in the deck itself", "Write the nodes out.");
                }
                Block::Nodes(keyword.get("NSET").map(|name| self.spelled(name)))
            }
            "ELEMENT" => self.element_block(keyword, line),
            "NSET" => match keyword.get("NSET").map(|name| self.spelled(name)) {
                Some(name) => {
                    self.node_sets.entry(name.clone()).or_default();
                    Block::NodeSet { name, generate: keyword.has("GENERATE") }
                }
                None => self.nameless(line, "*NSET", "NSET"),
            },
            "ELSET" => match keyword.get("ELSET").map(|name| self.spelled(name)) {
                Some(name) => {
                    self.element_sets.entry(name.clone()).or_default();
                    Block::ElementSet { name, generate: keyword.has("GENERATE") }
                }
                None => self.nameless(line, "*ELSET", "ELSET"),
            },
            "SURFACE" => match keyword.get("NAME").map(|name| self.spelled(name)) {
                Some(name) if keyword.get("TYPE").is_some_and(|t| t.eq_ignore_ascii_case("NODE")) => Block::NodeSurface(name),
                Some(name) => {
                    self.surfaces.entry(name.clone()).or_default();
                    Block::Surface(name)
                }
                None => self.nameless(line, "*SURFACE", "NAME"),
            },
            "MATERIAL" => {
                *material = keyword.get("NAME").map(|name| self.spelled(name));
                Block::NoData("*MATERIAL")
            }
            "ELASTIC" => {
                let kind = keyword.get("TYPE").unwrap_or("ISO").to_uppercase();
                let engineering_constants = kind == "ENGINEERING CONSTANTS";
                if !engineering_constants && kind != "ISO" && kind != "ISOTROPIC" {
                    self.doubt(line, format!("*ELASTIC, TYPE={kind:.40}"), "TYPE=ISO or TYPE=ENGINEERING CONSTANTS", "Give the constants in one of these forms.");
                }
                let elastic = Elastic { line, engineering_constants, values: Vec::new() };
                Block::Elastic { material: material.clone(), elastic }
            }
            "SOLID SECTION" => {
                let name = |deck: &mut Self, parameter: &str| keyword.get(parameter).map(|name| deck.spelled(name));
                match (name(self, "ELSET"), name(self, "MATERIAL")) {
                    (Some(elements), Some(material)) => {
                        if keyword.has("ORIENTATION") {
                            self.doubt(line, "*SOLID SECTION with ORIENTATION", "materials along x and y", "Give `orthotropic.angle` in a problem of our own.");
                        }
                        self.sections.push(Section { line, elements, material, thickness: None });
                        Block::Thickness
                    }
                    _ => {
                        self.doubt(line, "*SOLID SECTION", "it with ELSET and MATERIAL", "Say which elements are made of what.");
                        Block::Skip
                    }
                }
            }
            "BOUNDARY" => self.plain(keyword, line, &["OP"], Block::Boundary),
            "DLOAD" => self.plain(keyword, line, &["OP"], Block::Dload),
            "DSLOAD" => self.plain(keyword, line, &["OP"], Block::Dsload),
            "CLOAD" => self.plain(keyword, line, &["OP"], Block::Cload),
            "STEP" => {
                self.steps += 1;
                if keyword.has("NLGEOM") && !keyword.get("NLGEOM").is_some_and(|v| v.eq_ignore_ascii_case("NO")) {
                    self.doubt(line, "*STEP, NLGEOM", "a linear step", "Displacements are small here; remove NLGEOM.");
                }
                Block::Skip
            }
            // what a deck says of its output, and of how a linear step is to be solved, changes nothing here
            "STATIC" | "END STEP" | "DENSITY" | "NODE PRINT" | "EL PRINT" | "NODE FILE" | "EL FILE"
            | "NODE OUTPUT" | "ELEMENT OUTPUT" | "OUTPUT" | "CONTACT FILE" | "CONTACT PRINT" | "SECTION PRINT"
            | "ENERGY PRINT" | "PREPRINT" | "PRINT" | "RESTART" | "MONITOR" | "FILE FORMAT" | "NODE RESPONSE"
            // one part in one place is as good as none
            | "PART" | "END PART" | "ASSEMBLY" | "END ASSEMBLY" | "INSTANCE" | "END INSTANCE" => match &keyword.name[..] {
                "INSTANCE" => Block::NoData("*INSTANCE, for it must stand where its part does"),
                _ => Block::Skip,
            },
            "INCLUDE" | "NGEN" | "NFILL" | "NCOPY" | "NMAP" | "ELGEN" | "ELCOPY" | "SYSTEM" | "TRANSFORM" => {
                self.fault(line, "unsupported", format!("*{}", keyword.name), "nodes and elements written out in one file", "Let the preprocessor write the whole mesh.");
                Block::Skip
            }
            name => {
                self.doubt(line, format!("*{name:.60}"), "a keyword that is understood", "*NODE, *ELEMENT, *NSET, *ELSET, *SURFACE, *MATERIAL, *ELASTIC, *SOLID SECTION, *BOUNDARY, *DLOAD, *DSLOAD, *CLOAD, *STEP, *STATIC and requests for output are.");
                Block::Skip
            }
        }
    }

    fn nameless(&mut self, line: u64, keyword: &str, parameter: &str) -> Block {
        self.fault(
            line,
            "malformed",
            keyword,
            &format!("{keyword}, {parameter}=…"),
            "Give it a name.",
        );
        Block::Skip
    }

    /// A keyword whose parameters would change its meaning.
    fn plain(&mut self, keyword: &Keyword, line: u64, known: &[&str], block: Block) -> Block {
        for (name, value) in &keyword.parameters {
            if !known.contains(&&name[..])
                || value
                    .as_deref()
                    .is_some_and(|v| v.eq_ignore_ascii_case("NEW"))
            {
                self.doubt(
                    line,
                    format!("*{} with {name:.40}", keyword.name),
                    "it without that",
                    "Values are those at the end of one linear step.",
                );
            }
        }
        block
    }

    fn element_block(&mut self, keyword: &Keyword, line: u64) -> Block {
        let name = keyword.get("TYPE").unwrap_or_default().to_uppercase();
        let Some(kind) = element_type(&name) else {
            self.fault(
                line,
                "unsupported",
                format!("elements of type `{name:.20}`"),
                "CPE, CPS or CAX with 3, 4, 6 or 8 nodes (and R for reduced integration)",
                "Mesh with solid elements of plane strain, plane stress or axisymmetry.",
            );
            return Block::Skip;
        };
        if !self.types.contains(&kind) {
            self.types.push(kind);
        }
        let set = keyword.get("ELSET").map(|name| self.spelled(name));
        if let Some(name) = &set {
            self.element_sets.entry(name.clone()).or_default();
        }
        Block::Elements {
            kind,
            set,
            pending: Vec::new(),
        }
    }

    fn data(&mut self, block: &mut Block, line: u64, text: &str) {
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
                    "malformed",
                    got,
                    &expected,
                    "Remove the line, or name what it is.",
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
                                "malformed",
                                format!("`{word:.40}`"),
                                "a number of a node or element",
                                "Correct that line.",
                            );
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
                    self.node_sets
                        .entry(name.clone())
                        .or_default()
                        .extend(found);
                }
            }
            Block::ElementSet { name, generate } => {
                if let Some(found) = self.members(*generate, line, text) {
                    self.element_sets
                        .entry(name.clone())
                        .or_default()
                        .extend(found);
                }
            }
            Block::NodeSurface(name) => {
                let target = self.target(text.split(',').next().unwrap_or_default());
                self.node_sets.entry(name.clone()).or_default().push(target);
            }
            Block::Surface(name) => {
                let mut words = words;
                let (target, side) = (
                    words.next().unwrap_or_default(),
                    words.next().unwrap_or_default(),
                );
                let target = self.target(target);
                match side_number(side, 'S') {
                    Some(side) => self
                        .surfaces
                        .entry(name.clone())
                        .or_default()
                        .push((target, side)),
                    None => self.fault(
                        line,
                        "malformed",
                        format!("`{text:.40}`"),
                        "an element or a set of them, and S1 … S4",
                        "Say which sides the surface is made of.",
                    ),
                }
            }
            Block::Elastic { elastic, .. } => {
                for word in words {
                    match number(word) {
                        Some(value) => elastic.values.push(value),
                        None => self.doubt(
                            line,
                            format!("`{word:.40}`"),
                            "a number",
                            "Correct that line.",
                        ),
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
                            target,
                            side,
                            value,
                        });
                    }
                    _ => self.doubt(
                        line,
                        format!("`{text:.60}`"),
                        "a pressure: element or set, P1 … P4, value (*DSLOAD: surface, P, value)",
                        "Give other loads in a problem of our own.",
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

    /// The block ends: what was begun must be complete.
    fn end(&mut self, block: Block, line: u64) {
        match block {
            Block::Elements { kind, pending, .. } if !pending.is_empty() => {
                let got = format!("{} numbers for element {}", pending.len() - 1, pending[0]);
                let expected = format!("{} nodes", kind.nodes);
                self.fault(
                    line,
                    "truncated",
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
                    "it after *MATERIAL, NAME=…",
                    "Say whose constants these are.",
                ),
            },
            _ => {}
        }
    }

    fn node(&mut self, set: &Option<String>, line: u64, text: &str) {
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
            self.fault(
                line,
                "malformed",
                format!("`{text:.60}`"),
                "a node: number, x, y",
                "Correct that line.",
            );
            return;
        };
        if self.raw.nodes.len() >= NO_NODE as usize || !self.nodes.add(label) {
            self.fault(
                line,
                "repeated_node",
                format!("node {label} once more"),
                "each node once",
                "Renumber it.",
            );
            return;
        }
        self.plane.add(label, place);
        if let Some(name) = set {
            self.node_sets
                .entry(name.clone())
                .or_default()
                .push(Target::Label(label));
        }
        self.raw.nodes.push([place[0], place[1]]);
        self.raw.node_labels.push(label);
    }

    fn element(&mut self, kind: ElementType, set: Option<String>, line: u64, numbers: &[u64]) {
        let label = numbers[0];
        let mut nodes = [NO_NODE; 8];
        for (slot, number) in nodes.iter_mut().zip(&numbers[1..]) {
            let Some(node) = self.nodes.get(*number) else {
                self.fault(
                    line,
                    "unknown_node",
                    format!("node {number} in element {label}"),
                    "a node of *NODE, which stands before its elements",
                    "Correct the number.",
                );
                return;
            };
            *slot = node;
        }
        if !self.elements.add(label) {
            self.fault(
                line,
                "repeated_element",
                format!("element {label} once more"),
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
            self.element_sets
                .entry(name)
                .or_default()
                .push(Target::Label(label));
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
            [first, last] if words.len() == 2 => Some(vec![Target::Range(first, last, 1)]),
            [first, last, step] if step > 0 => Some(vec![Target::Range(first, last, step)]),
            _ => {
                self.fault(
                    line,
                    "malformed",
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
        // the third displacement and the rotations of a plane body are zero anyway
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

    /// The name of what a load or support refers to; as `into_raw` gives it to the mesh.
    pub(super) fn name_of(target: &Target, side: Option<usize>) -> String {
        let name = match target {
            Target::Label(label) => label.to_string(),
            Target::Set(name) => name.clone(),
            Target::Range(first, last, step) => format!("{first}-{last}:{step}"),
        };
        match side {
            Some(side) => format!("{name} P{side}"),
            None => name,
        }
    }

    /// The mesh with all its names, and what is wrong with it.
    pub(super) fn into_raw(mut self) -> (RawMesh, Vec<Violation>) {
        let mut faults = std::mem::take(&mut self.faults);
        let element_sets = resolve(
            &self.element_sets,
            &self.elements,
            "element",
            "elset",
            &mut faults,
        );
        let node_sets = resolve(&self.node_sets, &self.nodes, "node", "nset", &mut faults);
        let mut surfaces: Vec<(String, Vec<(Target, usize)>)> =
            std::mem::take(&mut self.surfaces).into_iter().collect();
        for pressure in &self.pressures {
            if let Some(side) = pressure.side {
                surfaces.push((
                    Deck::name_of(&pressure.target, Some(side)),
                    vec![(pressure.target.clone(), side)],
                ));
            }
        }
        for (name, sides) in surfaces {
            let mut lines = Vec::new();
            for (target, side) in sides {
                let elements = match &target {
                    Target::Label(label) => self.elements.get(*label).map(|e| vec![e]),
                    Target::Set(set) => element_sets.get(set).cloned(),
                    Target::Range(..) => None,
                };
                let Some(elements) = elements else {
                    unknown(
                        &mut faults,
                        &format!("`{}` in the surface `{name}`", Deck::name_of(&target, None)),
                        "an element or a set of elements",
                        element_sets.keys(),
                    );
                    continue;
                };
                for element in elements {
                    let element = &self.raw.elements[element as usize];
                    let corners = element.family().corners();
                    if side <= corners {
                        lines.push([element[side - 1], element[side % corners]]);
                    }
                }
            }
            self.raw.lines.entry(name).or_default().extend(lines);
        }
        self.raw.groups = element_sets;
        self.raw.node_sets = node_sets;
        // a node by itself is a set of one
        let single = self.prescribed.iter().map(|row| &row.target);
        for target in single.chain(self.forces.iter().map(|row| &row.target)) {
            match target {
                Target::Label(label) => match self.nodes.get(*label) {
                    Some(node) => {
                        self.raw.node_sets.insert(label.to_string(), vec![node]);
                    }
                    None => unknown(
                        &mut faults,
                        &format!("node {label}"),
                        "a node of *NODE",
                        self.raw.node_sets.keys(),
                    ),
                },
                Target::Set(name) if !self.raw.node_sets.contains_key(name) => {
                    unknown(
                        &mut faults,
                        &format!("the node set `{name:.60}`"),
                        "a node or a set of nodes",
                        self.raw.node_sets.keys(),
                    );
                }
                _ => {}
            }
        }
        self.raw.sets_span_boundaries = true;
        (self.raw, faults)
    }
}

/// Sets as places in the mesh.
fn resolve(
    sets: &BTreeMap<String, Vec<Target>>,
    labels: &Labels,
    what: &str,
    keyword: &str,
    faults: &mut Vec<Violation>,
) -> BTreeMap<String, Vec<u32>> {
    let mut resolved: BTreeMap<String, Vec<u32>> = BTreeMap::new();
    for (name, members) in sets {
        let mut found = Vec::new();
        // sets of sets; a set that holds itself ends where it was seen
        let mut open: Vec<&Target> = members.iter().rev().collect();
        let mut seen = vec![name];
        while let Some(target) = open.pop() {
            match target {
                Target::Label(label) => match labels.get(*label) {
                    Some(place) => found.push(place),
                    None => unknown(
                        faults,
                        &format!("{what} {label} in the set `{name:.60}`"),
                        &format!("a number that a {what} has"),
                        [].iter(),
                    ),
                },
                // numbers in between need not exist
                Target::Range(first, last, step) => {
                    let inside = labels.range(*first, *last, *step);
                    if inside.is_empty() {
                        unknown(
                            faults,
                            &format!("{what}s {first} to {last} in the set `{name:.60}`"),
                            &format!("numbers that {what}s have"),
                            [].iter(),
                        );
                    }
                    found.extend(inside);
                }
                Target::Set(other) => match sets.get_key_value(other) {
                    Some((key, inner)) => {
                        if !seen.contains(&key) {
                            seen.push(key);
                            open.extend(inner.iter().rev());
                        }
                    }
                    None => unknown(
                        faults,
                        &format!("`{other:.60}` in the set `{name:.60}`"),
                        &format!("a {what} or a set (*{})", keyword.to_uppercase()),
                        sets.keys(),
                    ),
                },
            }
        }
        found.sort_unstable();
        found.dedup();
        resolved.insert(name.clone(), found);
    }
    resolved
}

fn unknown<'a>(
    faults: &mut Vec<Violation>,
    got: &str,
    expected: &str,
    known: impl Iterator<Item = &'a String>,
) {
    let names: Vec<&str> = known.take(20).map(|name| &name[..]).collect();
    let hint = match names.is_empty() {
        true => "Correct the number.".to_owned(),
        false => format!("There are {}.", names.join(", ")),
    };
    if faults.len() < MOST_LISTED {
        faults.push(Violation {
            pointer: String::new(),
            reason: "unknown_name".to_owned(),
            got: got.to_owned(),
            expected: expected.to_owned(),
            hint,
        });
    }
}

fn say(
    list: &mut Vec<Violation>,
    line: u64,
    reason: &str,
    got: String,
    expected: &str,
    hint: &str,
) {
    if list.len() < MOST_LISTED {
        list.push(Violation {
            pointer: String::new(),
            reason: reason.to_owned(),
            got: format!("line {line}: {got}"),
            expected: expected.to_owned(),
            hint: hint.to_owned(),
        });
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

fn element_type(name: &str) -> Option<ElementType> {
    let theory = match name.get(..3)? {
        "CPE" => Theory::PlaneStrain,
        "CPS" => Theory::PlaneStress,
        "CAX" => Theory::Axisymmetric,
        _ => return None,
    };
    let (family, nodes, reduced) = match &name[3..] {
        "3" => (Family::Triangle, 3, false),
        "6" => (Family::Triangle, 6, false),
        "4" | "4I" | "4R" => (Family::Quad, 4, false),
        "8" => (Family::Quad, 8, false),
        "8R" => (Family::Quad, 8, true),
        _ => return None,
    };
    Some(ElementType {
        theory,
        family,
        nodes,
        reduced,
    })
}
