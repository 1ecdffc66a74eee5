//! Keyword lines: `*NAME, PARAMETER=value, …`, and the block of data that each begins.

use super::block::Block;
use super::deck::{Deck, Elastic, ElementType, Incomplete, MOST_NAMES, Name, Section, Theory};
use solver::element::Family;
use solver::error::Reason;

/// A keyword line in parts.
pub(super) struct Keyword {
    name: String,
    parameters: Vec<(String, Option<String>)>,
}

impl Keyword {
    pub(super) fn new(text: &str) -> Self {
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
    /// The block that a keyword begins; `material` is the last one that was named.
    pub(super) fn begin(
        &mut self,
        keyword: &Keyword,
        line: u64,
        material: &mut Option<Name>,
    ) -> Block {
        let names = self.node_sets.len() + self.element_sets.len() + self.surfaces.len();
        if names > MOST_NAMES {
            if !std::mem::replace(&mut self.incomplete.names, true) {
                let (got, expected) = (
                    format!("more than {MOST_NAMES} names"),
                    format!("at most {MOST_NAMES} sets and surfaces"),
                );
                self.fault(
                    line,
                    Reason::TooMany,
                    got,
                    &expected,
                    "Leave out the sets that are not used.",
                );
            }
            return Block::Skip;
        }
        match &keyword.name[..] {
            "HEADING" => Block::Title,
            "NODE" => {
                if keyword.has("SYSTEM") || keyword.has("INPUT") {
                    self.incomplete.nodes = true;
                    self.fault(line, Reason::Unsupported, "*NODE with SYSTEM or INPUT", "coordinates x, y in the deck itself", "Write the nodes out.");
                }
                Block::Nodes(keyword.get("NSET").map(|name| self.spelled(name)))
            }
            "ELEMENT" => self.element_block(keyword, line),
            "NSET" => match keyword.get("NSET").map(|name| self.spelled(name)) {
                Some(name) => {
                    self.node_set(&name, line);
                    Block::NodeSet { name, generate: keyword.has("GENERATE") }
                }
                None => self.nameless(line, "*NSET", "NSET"),
            },
            "ELSET" => match keyword.get("ELSET").map(|name| self.spelled(name)) {
                Some(name) => {
                    self.element_set(&name, line);
                    Block::ElementSet { name, generate: keyword.has("GENERATE") }
                }
                None => self.nameless(line, "*ELSET", "ELSET"),
            },
            "SURFACE" => match keyword.get("NAME").map(|name| self.spelled(name)) {
                Some(name) if keyword.get("TYPE").is_some_and(|t| t.eq_ignore_ascii_case("NODE")) => Block::NodeSurface(name),
                Some(name) => {
                    self.surface(&name, line);
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
                let elastic = Elastic { line, engineering_constants, values: Vec::new(), unreadable: false };
                Block::Elastic { material: material.clone(), elastic }
            }
            "SOLID SECTION" => {
                let name = |deck: &mut Self, parameter: &str| keyword.get(parameter).map(|name| deck.spelled(name));
                match (name(self, "ELSET"), name(self, "MATERIAL")) {
                    (Some(elements), Some(material)) => {
                        if keyword.has("ORIENTATION") {
                            self.doubt(line, "*SOLID SECTION with ORIENTATION", "materials along x and y", "Give `orthotropic.angle` in a problem of Signorini.");
                        }
                        self.sections.push(Section { line, elements, material, thickness: None });
                        Block::Thickness
                    }
                    _ => {
                        self.doubt(line, "*SOLID SECTION", "*SOLID SECTION with ELSET and MATERIAL", "Name the elements and their material.");
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
                    self.doubt(line, "*STEP, NLGEOM", "a linear step", "Displacements are assumed small; remove NLGEOM.");
                }
                Block::Skip
            }
            // requests for output, and options for solving a linear step, have no effect here
            "STATIC" | "END STEP" | "DENSITY" | "NODE PRINT" | "EL PRINT" | "NODE FILE" | "EL FILE"
            | "NODE OUTPUT" | "ELEMENT OUTPUT" | "OUTPUT" | "CONTACT FILE" | "CONTACT PRINT" | "SECTION PRINT"
            | "ENERGY PRINT" | "PREPRINT" | "PRINT" | "RESTART" | "MONITOR" | "FILE FORMAT" | "NODE RESPONSE"
            // one part in one place is the same as no part
            | "PART" | "END PART" | "ASSEMBLY" | "END ASSEMBLY" | "INSTANCE" | "END INSTANCE" => match &keyword.name[..] {
                "INSTANCE" => Block::NoData("*INSTANCE without data (moving or rotating a part is not supported)"),
                _ => Block::Skip,
            },
            "INCLUDE" | "NGEN" | "NFILL" | "NCOPY" | "NMAP" | "ELGEN" | "ELCOPY" | "SYSTEM" | "TRANSFORM" => {
                self.incomplete = Incomplete { nodes: true, elements: true, names: true };
                self.fault(line, Reason::Unsupported, format!("*{}", keyword.name), "nodes and elements written out in one file", "Let the preprocessor write the whole mesh.");
                Block::Skip
            }
            name => {
                self.doubt(line, format!("*{name:.60}"), "a supported keyword", "*NODE, *ELEMENT, *NSET, *ELSET, *SURFACE, *MATERIAL, *ELASTIC, *SOLID SECTION, *BOUNDARY, *DLOAD, *DSLOAD, *CLOAD, *STEP, *STATIC and requests for output are supported.");
                Block::Skip
            }
        }
    }

    fn nameless(&mut self, line: u64, keyword: &str, parameter: &str) -> Block {
        self.incomplete.names = true;
        self.fault(
            line,
            Reason::Malformed,
            keyword,
            &format!("{keyword}, {parameter}=…"),
            "Give it a name.",
        );
        Block::Skip
    }

    /// A keyword that supports only the parameters `known`, since others change its meaning.
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
                    &format!("*{} without {name:.40}", keyword.name),
                    "Values are those at the end of one linear step.",
                );
            }
        }
        block
    }

    fn element_block(&mut self, keyword: &Keyword, line: u64) -> Block {
        let name = keyword.get("TYPE").unwrap_or_default().to_uppercase();
        let set = keyword.get("ELSET").map(|name| self.spelled(name));
        if let Some(name) = &set {
            self.element_set(name, line);
        }
        let Some(kind) = element_type(&name) else {
            self.incomplete.elements = true;
            self.fault(
                line,
                Reason::Unsupported,
                format!("elements of type `{name:.20}`"),
                "CPE, CPS or CAX with 3, 4, 6 or 8 nodes (and R for reduced integration)",
                "Mesh with solid elements of plane strain, plane stress or axisymmetry.",
            );
            return Block::Skip;
        };
        if !self.types.contains(&kind) {
            self.types.push(kind);
        }
        Block::Elements {
            kind,
            set,
            pending: Vec::new(),
        }
    }
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
