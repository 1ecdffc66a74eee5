//! Keyword lines, `*NAME, PARAMETER=value, …`, and the block of data lines that each begins.

use super::block::{Block, Elements, Rows};
use super::deck::{Deck, Inside};
use super::element::{ElementType, Shape, Typed};
use super::part::{Part, RigidLines};
use super::supported::{
    IDLE, MOST_UNKNOWN, NOT_ELASTIC, NOT_WRITTEN_OUT, PARAMETERS, READ, UnknownKeyword,
};
use super::written::{
    Amplitude, Elastic, Expansion, Incomplete, MOST_NAMES, Name, Orientation, Replacement,
    Replaces, Section, fields,
};
use solver::error::Reason;

/// The largest number of parts, and the largest number of instances.
const MOST_PARTS: usize = 1 << 8;

/// How many times instances may repeat the content of all parts.
const MOST_TIMES: u64 = 8;

/// A keyword line, divided into the keyword's name and its parameters.
pub(super) struct Keyword {
    pub(super) name: String,
    pub(super) parameters: Vec<(String, Option<String>)>,
}

/// The name of a keyword with blanks, from a name without them, which CalculiX allows.
fn spaced(name: String) -> String {
    let mut known = READ.iter().chain(IDLE);
    let known = known.find(|known| known.replace(' ', "") == name);
    known.map_or(name, |known| (*known).to_owned())
}

/// Whether a parameter has this name, apart from blanks.
fn same(parameter: &str, name: &str) -> bool {
    let letters = |text: &str| text.chars().filter(|c| *c != ' ').collect::<String>();
    parameter == name || letters(parameter) == letters(name)
}

impl Keyword {
    pub(super) fn new(text: &str) -> Self {
        let mut parts = fields(&text[1..]).into_iter();
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
            name: spaced(words.join(" ").to_uppercase()),
            parameters: parts
                .filter(|part| !part.is_empty())
                .map(parameter)
                .collect(),
        }
    }

    pub(super) fn has(&self, name: &str) -> bool {
        self.parameters.iter().any(|p| same(&p.0, name))
    }

    pub(super) fn get(&self, name: &str) -> Option<&str> {
        let found = self.parameters.iter().find(|p| same(&p.0, name))?;
        found.1.as_deref().filter(|value| !value.is_empty())
    }

    pub(super) fn is(&self, name: &str, value: &str) -> bool {
        self.get(name)
            .is_some_and(|given| given.eq_ignore_ascii_case(value))
    }
}

/// The types of elements that a problem can have, in words.
const SOLIDS: &str = "CPE, CPS or CAX with 3, 4, 6 or 8 nodes (and R, I, H, M or T)";
/// Advice for elements that a problem cannot have.
pub(super) const REMOVE_ELEMENTS: &str = "Remove them from the problem, or use the deck as a mesh: there they are left out or name boundaries.";

/// Whether a type is a rigid line, in the plane or of a body of revolution.
fn is_rigid_line(kind: &str) -> bool {
    kind == "R2D2" || kind == "RAX2"
}

impl Deck {
    /// Begins the block of a keyword.
    pub(super) fn begin(&mut self, keyword: &Keyword, line: u64) -> Block {
        if self.names > MOST_NAMES {
            self.too_many_names(line);
            return Block::Skip;
        }
        if self.has_unknown_parameters(keyword, line) {
            return Block::Skip;
        }
        if let Some(block) = self.begin_contact(keyword, line) {
            return block;
        }
        match &keyword.name[..] {
            "HEADING" => Block::Title,
            "NODE" => self.node_block(keyword, line),
            "ELEMENT" => self.element_block(keyword, line),
            "NSET" => self.node_set_block(keyword, line),
            "ELSET" => self.element_set_block(keyword, line),
            "SURFACE" => self.surface_block(keyword, line),
            "MATERIAL" => self.material_block(keyword, line),
            "ELASTIC" => Block::Elastic(Elastic {
                line,
                kind: keyword.get("TYPE").unwrap_or("ISO").to_uppercase(),
                values: Vec::new(),
                unreadable: false,
            }),
            "EXPANSION" => {
                let kind = keyword.get("TYPE").unwrap_or("ISO").to_uppercase();
                Block::Expansion(Expansion {
                    line,
                    along_axes: kind.starts_with("ORTHO"),
                    unreadable: !(kind.starts_with("ISO") || kind.starts_with("ORTHO")),
                    ..Expansion::default()
                })
            }
            "DENSITY" => Block::Density,
            "SPRING" => self.spring_block(keyword, line),
            "TEMPERATURE" => self.temperature_block(keyword, line),
            "INITIAL CONDITIONS" => self.initial_conditions(keyword, line),
            "ORIENTATION" => self.orientation_block(keyword),
            "AMPLITUDE" => self.amplitude_block(keyword, line),
            "SOLID SECTION" => self.section_block(keyword, line),
            "BOUNDARY" => self.boundary_block(keyword, line),
            // those of one step only add to one another
            "DLOAD" => self.load_block(Rows::Sides, keyword, line),
            "DSLOAD" => self.load_block(Rows::Surfaces, keyword, line),
            "CLOAD" => self.load_block(Rows::Nodes, keyword, line),
            "STEP" => self.step_block(keyword, line),
            "STATIC" => self.static_block(keyword, line),
            "PART" | "END PART" | "ASSEMBLY" | "END ASSEMBLY" | "INSTANCE" | "END INSTANCE" => {
                self.part_block(keyword, line)
            }
            name if NOT_WRITTEN_OUT.contains(&name) => {
                self.here.incomplete = Incomplete::ALL;
                self.fault(
                    line,
                    Reason::Unsupported,
                    format!("*{name}"),
                    "nodes and elements written out in one file",
                    "Let the preprocessor write the whole mesh.",
                );
                Block::Skip
            }
            name if IDLE.contains(&name) => Block::Skip,
            name => match self.material() {
                Some(material) if NOT_ELASTIC.contains(&name) => {
                    material.other.push((line, format!("*{name}")));
                    Block::Skip
                }
                _ => self.unknown_keyword(name, line),
            },
        }
    }

    /// Reports parameters that are not known: a misspelt one would be left out, and another set, material or step read.
    /// True if nodes, elements or sets are not read for that.
    fn has_unknown_parameters(&mut self, keyword: &Keyword, line: u64) -> bool {
        let Some((of, known)) = PARAMETERS.iter().find(|(of, _)| *of == keyword.name) else {
            return false;
        };
        let names = keyword.parameters.iter().map(|(name, _)| &name[..]);
        let is_known = |name: &&str| known.iter().any(|known| same(name, known));
        let unknown: Vec<&str> = names.filter(|name| !is_known(name)).take(5).collect();
        if unknown.is_empty() {
            return false;
        }
        let got = format!("*{of} with {:.80}", unknown.join(", "));
        let expected = format!("*{of} with {}", known.join(", "));
        let hint =
            "Correct the name, or remove the parameter if the solution does not depend on it.";
        let of_mesh = matches!(*of, "NODE" | "ELEMENT" | "NSET" | "ELSET");
        if of_mesh {
            self.here.incomplete = Incomplete::ALL;
            self.fault(line, Reason::NotUnderstood, got, &expected, hint);
        } else {
            self.doubt(line, got, &expected, hint);
        }
        of_mesh
    }

    /// Reports that the deck has too many names of sets and surfaces.
    fn too_many_names(&mut self, line: u64) {
        if !std::mem::replace(&mut self.here.incomplete.names, true) {
            self.fault(
                line,
                Reason::TooMany,
                format!("more than {MOST_NAMES} names"),
                &format!("at most {MOST_NAMES} sets and surfaces"),
                "Leave out the sets that are not used.",
            );
        }
    }

    /// Records a keyword that is unknown or at a wrong place. At the end each such keyword is reported once.
    fn unknown_keyword(&mut self, name: &str, line: u64) -> Block {
        let known = &mut self.here.unknown_keywords;
        match known.iter().position(|known| known.name == name) {
            Some(place) => known[place].more += 1,
            None if known.len() < MOST_UNKNOWN => known.push(UnknownKeyword {
                name: name.to_owned(),
                line,
                more: 0,
            }),
            None => {}
        }
        Block::Skip
    }

    /// Records a keyword with `OP=NEW` in a step after the first, which ends supports or loads of earlier steps.
    fn note_replacement(&mut self, keyword: &Keyword, what: Replaces, line: u64) {
        if self.steps > 1 && keyword.is("OP", "NEW") {
            self.replacements.push(Replacement {
                line,
                keyword: keyword.name.clone(),
                what,
            });
        }
    }

    pub(super) fn named(&mut self, keyword: &Keyword, parameter: &str) -> Option<Name> {
        keyword.get(parameter).map(|name| self.spelled(name))
    }

    pub(super) fn nameless(&mut self, line: u64, keyword: &str, parameter: &str) -> Block {
        self.here.incomplete.names = true;
        self.fault(
            line,
            Reason::Malformed,
            keyword,
            &format!("{keyword}, {parameter}=…"),
            "Give it a name.",
        );
        Block::Skip
    }

    /// The amplitude that a keyword of loads or supports names. Other parameters than the amplitude and `OP` are
    /// reported, since they would change the keyword's meaning.
    fn amplitude(&mut self, keyword: &Keyword, line: u64) -> Option<Name> {
        for (name, value) in &keyword.parameters {
            let known = match &name[..] {
                "AMPLITUDE" | "OP" => true,
                "TYPE" => keyword.name == "BOUNDARY" && keyword.is("TYPE", "DISPLACEMENT"),
                _ => false,
            };
            if !known {
                let value = value
                    .as_ref()
                    .map(|v| format!("={v:.40}"))
                    .unwrap_or_default();
                self.doubt(
                    line,
                    format!("*{} with {name:.40}{value}", keyword.name),
                    &format!("*{} without {name:.40}", keyword.name),
                    "Values are read as displacements or loads at the end of one linear step.",
                );
            }
        }
        self.named(keyword, "AMPLITUDE")
    }

    fn node_block(&mut self, keyword: &Keyword, line: u64) -> Block {
        if keyword.has("SYSTEM") || keyword.has("INPUT") {
            self.here.incomplete.nodes = true;
            self.fault(
                line,
                Reason::Unsupported,
                "*NODE with SYSTEM or INPUT",
                "coordinates x, y in the deck itself",
                "Write the nodes out.",
            );
        }
        Block::Nodes(self.named(keyword, "NSET"))
    }

    fn node_set_block(&mut self, keyword: &Keyword, line: u64) -> Block {
        let Some(name) = self.named(keyword, "NSET") else {
            return self.nameless(line, "*NSET", "NSET");
        };
        let of = self.named(keyword, "INSTANCE");
        match self.named(keyword, "ELSET") {
            Some(elements) => {
                self.nodes_of(&name, &of, elements, line);
                Block::NoData("*NSET with ELSET")
            }
            None => {
                self.node_set(&name, &of, line);
                Block::NodeSet {
                    name,
                    of,
                    generate: keyword.has("GENERATE"),
                }
            }
        }
    }

    fn element_set_block(&mut self, keyword: &Keyword, line: u64) -> Block {
        let Some(name) = self.named(keyword, "ELSET") else {
            return self.nameless(line, "*ELSET", "ELSET");
        };
        let of = self.named(keyword, "INSTANCE");
        self.element_set(&name, &of, line);
        Block::ElementSet {
            name,
            of,
            generate: keyword.has("GENERATE"),
        }
    }

    fn surface_block(&mut self, keyword: &Keyword, line: u64) -> Block {
        let Some(name) = self.named(keyword, "NAME") else {
            return self.nameless(line, "*SURFACE", "NAME");
        };
        let kind = keyword.get("TYPE").unwrap_or("ELEMENT").to_uppercase();
        match &kind[..] {
            "NODE" => Block::NodeSurface(name),
            // rigid surfaces of their own, and combinations of others, are no sides of elements: whoever names one is
            // told that it is unknown
            "ELEMENT" if !keyword.has("COMBINE") => {
                self.surface(&name, line);
                Block::Surface(name)
            }
            _ => Block::Skip,
        }
    }

    fn material_block(&mut self, keyword: &Keyword, line: u64) -> Block {
        self.material = self.named(keyword, "NAME");
        if let Some(name) = self.material.clone() {
            if self.materials.contains_key(&name) {
                self.doubt(
                    line,
                    format!("the material `{name:.60}` a second time"),
                    "each material once",
                    "Give one of the two materials another name.",
                );
            }
            self.materials.entry(name).or_default();
        }
        Block::NoData("*MATERIAL")
    }

    fn section_block(&mut self, keyword: &Keyword, line: u64) -> Block {
        let names = ["ELSET", "MATERIAL", "ORIENTATION"];
        let [Some(elements), Some(material), orientation] =
            names.map(|parameter| self.named(keyword, parameter))
        else {
            self.doubt(
                line,
                "*SOLID SECTION",
                "*SOLID SECTION with ELSET and MATERIAL",
                "Name the elements and their material.",
            );
            return Block::Skip;
        };
        self.here.sections.push(Section {
            line,
            elements,
            material,
            thickness: None,
            orientation,
        });
        Block::Thickness
    }

    fn boundary_block(&mut self, keyword: &Keyword, line: u64) -> Block {
        // the first in the first step decides whether those of the model remain
        let is_first = !std::mem::replace(&mut self.supported_in_step, true);
        if self.steps == 1 && is_first && keyword.is("OP", "NEW") {
            let instances = self.instances.iter_mut().map(|(_, part)| part);
            let parts = instances.chain(self.parts.values_mut());
            for part in parts.chain([&mut self.here]) {
                part.prescribed.clear();
                part.held.clear();
            }
        }
        self.note_replacement(keyword, Replaces::Supports, line);
        Block::Boundary(self.amplitude(keyword, line))
    }

    fn load_block(&mut self, rows: Rows, keyword: &Keyword, line: u64) -> Block {
        let replaces = match rows {
            Rows::Sides | Rows::Surfaces => Replaces::Pressures,
            Rows::Nodes => Replaces::Forces,
        };
        self.note_replacement(keyword, replaces, line);
        Block::Load(rows, self.amplitude(keyword, line))
    }

    fn step_block(&mut self, keyword: &Keyword, line: u64) -> Block {
        self.steps += 1;
        self.supported_in_step = false;
        if keyword.has("NLGEOM") && !keyword.is("NLGEOM", "NO") {
            self.doubt(
                line,
                "*STEP, NLGEOM",
                "a linear step",
                "Displacements are assumed small; remove NLGEOM.",
            );
        }
        if keyword.has("PERTURBATION") {
            self.contact.perturbation.get_or_insert(line);
        }
        Block::Skip
    }

    fn static_block(&mut self, keyword: &Keyword, line: u64) -> Block {
        for name in ["RIKS", "STABILIZE"] {
            if keyword.has(name) {
                self.doubt(
                    line,
                    format!("*STATIC, {name}"),
                    "a linear static step",
                    "Remove that parameter.",
                );
            }
        }
        Block::Period
    }

    fn orientation_block(&mut self, keyword: &Keyword) -> Block {
        let Some(name) = self.named(keyword, "NAME") else {
            return Block::Skip;
        };
        let system = keyword.get("SYSTEM").unwrap_or("RECTANGULAR");
        let straight = system.eq_ignore_ascii_case("RECTANGULAR");
        let offsets =
            keyword.is("DEFINITION", "NODES") || keyword.is("DEFINITION", "OFFSET TO NODES");
        let orientation = Orientation {
            curved: !straight || offsets || keyword.has("LOCAL DIRECTIONS"),
            lines: Vec::new(),
        };
        self.orientations.insert(name.clone(), orientation);
        Block::Orientation(name)
    }

    fn amplitude_block(&mut self, keyword: &Keyword, line: u64) -> Block {
        let Some(name) = self.named(keyword, "NAME") else {
            return Block::Skip;
        };
        let other = keyword.parameters.iter().find(|(name, _)| match &name[..] {
            "NAME" | "TIME" => false,
            "DEFINITION" => !keyword.is("DEFINITION", "TABULAR"),
            "VALUE" => !keyword.is("VALUE", "RELATIVE"),
            _ => true,
        });
        let amplitude = Amplitude {
            line,
            other: other.map(|(name, value)| match value {
                Some(value) => format!("{name}={value}"),
                None => name.clone(),
            }),
            values: Vec::new(),
        };
        self.amplitudes.insert(name.clone(), amplitude);
        Block::Amplitude(name)
    }

    fn element_block(&mut self, keyword: &Keyword, line: u64) -> Block {
        let name = keyword.get("TYPE").unwrap_or_default().to_uppercase();
        let set = self.named(keyword, "ELSET");
        if let Some(name) = &set {
            self.element_set(name, &None, line);
        }
        if keyword.has("INPUT") {
            self.here.incomplete.elements = true;
            self.fault(
                line,
                Reason::Unsupported,
                "*ELEMENT with INPUT",
                "elements in the deck itself",
                "Write the elements out.",
            );
        }
        let kind = ElementType::new(&name);
        let is_rigid = is_rigid_line(&name);
        let got = format!("elements of type `{name:.20}`");
        match kind.mechanics {
            Some(mechanics) => {
                let mut known = self.here.types.iter();
                if !known.any(|known| known.mechanics == mechanics) {
                    self.here.types.push(Typed {
                        mechanics,
                        line,
                        name: name.clone(),
                    });
                }
            }
            None if kind.idle => {}
            None if name == "SPRING1" => {
                self.here.first_spring.get_or_insert(line);
            }
            None if is_rigid => {
                let next = self.here.numbered.len() as u32;
                self.here.rigid_lines.push(RigidLines {
                    line,
                    what: got.clone(),
                    places: next..next,
                });
            }
            None => self.doubt(line, got.clone(), SOLIDS, REMOVE_ELEMENTS),
        }
        if matches!(kind.shape, Shape::Other(_)) {
            self.here.unused_type.get_or_insert((line, got));
        }
        Block::Elements(Elements {
            shape: kind.shape,
            is_rigid,
            set,
            pending: Vec::new(),
            continued: false,
        })
    }

    fn part_block(&mut self, keyword: &Keyword, line: u64) -> Block {
        let name = self.named(keyword, "NAME");
        match (&keyword.name[..], std::mem::take(&mut self.inside), name) {
            ("PART", Inside::Assembly, Some(name)) => {
                self.assembly = std::mem::take(&mut self.here);
                self.inside = Inside::Part(name);
            }
            ("INSTANCE", Inside::Assembly, Some(name)) => {
                let part = self.instantiated(keyword, line);
                self.assembly = std::mem::replace(&mut self.here, part);
                self.inside = Inside::Instance(name);
                return Block::Instance(Vec::new());
            }
            ("END PART", Inside::Part(name), _) => {
                let part = std::mem::replace(&mut self.here, std::mem::take(&mut self.assembly));
                self.written += part.size();
                if self.parts.len() >= MOST_PARTS || self.parts.contains_key(&name) {
                    let got = format!("the part `{name:.60}`");
                    let expected = format!("at most {MOST_PARTS} parts, each once");
                    self.fault(
                        line,
                        Reason::TooMany,
                        got,
                        &expected,
                        "Leave out the parts that are not used.",
                    );
                } else {
                    self.parts.insert(name, part);
                }
            }
            ("END INSTANCE", Inside::Instance(name), _) => {
                if let Some((moved, turned)) = self.placement.take() {
                    self.here.put(moved, turned);
                }
                let part = std::mem::replace(&mut self.here, std::mem::take(&mut self.assembly));
                if self.instances.len() > MOST_PARTS {
                    return Block::Skip;
                }
                if self.instances.iter().any(|(known, _)| *known == name) {
                    let got = format!("the instance `{name:.60}` a second time");
                    self.fault(
                        line,
                        Reason::DuplicateName,
                        got,
                        "each instance once",
                        "Rename one of the two, also where INSTANCE.NAME refers to its sets.",
                    );
                }
                self.instances.push((name, part));
            }
            ("ASSEMBLY", inside, name) => {
                self.inside = inside;
                self.assembly_name = name;
            }
            ("END ASSEMBLY", inside, _) => self.inside = inside,
            (keyword, inside, name) => {
                let place = match &inside {
                    Inside::Assembly => "outside of one".to_owned(),
                    Inside::Part(part) => format!("in the part `{part:.60}`"),
                    Inside::Instance(instance) => format!("in the instance `{instance:.60}`"),
                };
                self.inside = inside;
                let named = if name.is_some() { "" } else { " without NAME" };
                self.fault(
                    line,
                    Reason::Malformed,
                    format!("*{keyword}{named} {place}"),
                    "*PART, NAME=… to *END PART, and in the assembly *INSTANCE, NAME=…, PART=… to *END INSTANCE",
                    "End one part or instance before the next.",
                );
            }
        }
        Block::Skip
    }

    /// A copy of the part that an instance names. The first instance beyond the limit is reported and kept, without
    /// content; those after it are neither.
    fn instantiated(&mut self, keyword: &Keyword, line: u64) -> Part {
        if self.instances.len() > MOST_PARTS {
            return Part::default();
        }
        let Some(name) = self.named(keyword, "PART") else {
            self.here.incomplete = Incomplete::ALL;
            self.fault(
                line,
                Reason::Unsupported,
                "*INSTANCE without PART",
                "*INSTANCE, NAME=…, PART=…",
                "Write the part into the deck.",
            );
            return Part::default();
        };
        let Some(part) = self.parts.get(&name) else {
            self.here.incomplete = Incomplete::ALL;
            let names: Vec<&str> = self.parts.keys().take(20).map(|name| &**name).collect();
            let hint = format!("Known parts: {}.", names.join(", "));
            self.fault(
                line,
                Reason::UnknownName,
                format!("the part `{name:.60}`"),
                "the name of an earlier *PART",
                &hint,
            );
            return Part::default();
        };
        self.instantiated += part.size();
        let most = (1 << 14) + MOST_TIMES * self.written;
        if self.instances.len() < MOST_PARTS && self.instantiated <= most {
            return part.clone();
        }
        self.here.incomplete = Incomplete::ALL;
        let got = format!(
            "{} instances with {} nodes, elements, members of sets and rows",
            self.instances.len() + 1,
            self.instantiated
        );
        let expected = format!(
            "at most {MOST_PARTS} instances, and {MOST_TIMES} times what the parts contain"
        );
        self.fault(
            line,
            Reason::TooMany,
            got,
            &expected,
            "Write a smaller assembly.",
        );
        Part::default()
    }
}
