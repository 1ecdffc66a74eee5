//! The content of a deck: the supported parts, and the violations of the others.

use std::collections::{BTreeMap, HashMap};
use std::rc::Rc;

use crate::source::{Labels, Plane};
use solver::element::Family;
use solver::error::{Findings, Reason, Violation};
use solver::mesh::RawMesh;

/// A name of a set, surface or material, stored once however often the deck uses it.
pub(super) type Name = Rc<str>;

/// Characters of a name; Abaqus and CalculiX allow 80. A line may be a million times as long, and every entry of a
/// set is compared with names.
pub(super) const LONGEST_NAME: usize = 256;

/// Names of sets and surfaces: each takes hundreds of bytes, and is compared with the whole surface of the mesh.
pub(super) const MOST_NAMES: usize = 1 << 16;

/// Constants of a material.
pub(super) const MOST_CONSTANTS: usize = 10;

/// The theory of a type of element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Theory {
    PlaneStrain,
    PlaneStress,
    Axisymmetric,
}

/// The target of a set or a load.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Target {
    Label(u64),
    /// First, last, step; in a box, since labels are many and ranges few.
    Range(Box<[u64; 3]>),
    Set(Name),
}

/// One `*ELEMENT` type in use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ElementType {
    pub(super) theory: Theory,
    pub(super) family: Family,
    pub(super) nodes: usize,
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
    /// A line of the constants could not be read, and a violation says so.
    pub(super) unreadable: bool,
}

/// `*SOLID SECTION`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Section {
    pub(super) line: u64,
    pub(super) elements: Name,
    pub(super) material: Name,
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
    pub(super) line: u64,
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

/// A set as it is written.
#[derive(Clone, Debug, Default)]
pub(super) struct Set {
    /// The line that begins it.
    pub(super) line: u64,
    pub(super) members: Vec<Target>,
}

/// A surface as it is written: sides by element or set and number.
#[derive(Clone, Debug, Default)]
pub(super) struct Surface {
    /// The line that begins it.
    pub(super) line: u64,
    pub(super) sides: Vec<(Target, usize)>,
}

/// Which parts of a deck are not all known, since a line of them could not be read.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Incomplete {
    pub(super) nodes: bool,
    pub(super) elements: bool,
    /// Names of sets, surfaces and materials.
    pub(super) names: bool,
}

/// The supported parts of a deck, and the violations.
#[derive(Default)]
pub(super) struct Deck {
    pub(super) raw: RawMesh,
    pub(super) nodes: Labels,
    pub(super) elements: Labels,
    pub(super) plane: Plane,
    pub(super) node_sets: BTreeMap<Name, Set>,
    pub(super) element_sets: BTreeMap<Name, Set>,
    /// Sides by element or set and number.
    pub(super) surfaces: BTreeMap<Name, Surface>,
    /// The spelling of each name, by the name in capitals.
    spelling: HashMap<String, Name>,
    /// The parts of which a line could not be read: what is missing there is no second violation.
    pub(super) incomplete: Incomplete,
    pub(super) types: Vec<ElementType>,
    pub(super) materials: BTreeMap<Name, Elastic>,
    pub(super) sections: Vec<Section>,
    pub(super) prescribed: Vec<Prescribed>,
    pub(super) pressures: Vec<Pressure>,
    pub(super) forces: Vec<Force>,
    pub(super) steps: usize,
    pub(super) title: Option<String>,
    /// Violations of the mesh.
    pub(super) faults: Findings,
    /// Parts of the analysis that are not supported.
    pub(super) doubts: Findings,
}

impl Deck {
    pub(super) fn fault(
        &mut self,
        line: u64,
        reason: Reason,
        got: impl Into<String>,
        expected: &str,
        hint: &str,
    ) {
        if self.faults.is_full() {
            return self.faults.count(1);
        }
        self.faults
            .add(on_line(line, reason, got.into(), expected, hint));
    }

    pub(super) fn doubt(&mut self, line: u64, got: impl Into<String>, expected: &str, hint: &str) {
        if self.doubts.is_full() {
            return self.doubts.count(1);
        }
        let reason = Reason::NotUnderstood;
        self.doubts
            .add(on_line(line, reason, got.into(), expected, hint));
    }

    /// The name as it was first written.
    pub(super) fn spelled(&mut self, name: &str) -> Name {
        let capitals = name.to_uppercase();
        match self.spelling.get(&capitals) {
            Some(known) => known.clone(),
            // more names than a deck may define: this one is unknown anyway
            None if self.spelling.len() > 2 * MOST_NAMES => name.into(),
            None => self.spelling.entry(capitals).or_insert(name.into()).clone(),
        }
    }

    /// A set of nodes, which begins on this line if it is new.
    pub(super) fn node_set(&mut self, name: &Name, line: u64) -> &mut Vec<Target> {
        set(&mut self.node_sets, name, line)
    }

    /// A set of elements, which begins on this line if it is new.
    pub(super) fn element_set(&mut self, name: &Name, line: u64) -> &mut Vec<Target> {
        set(&mut self.element_sets, name, line)
    }

    /// A surface, which begins on this line if it is new.
    pub(super) fn surface(&mut self, name: &Name, line: u64) -> &mut Vec<(Target, usize)> {
        let known = self.surfaces.entry(name.clone());
        let new = || Surface {
            line,
            ..Surface::default()
        };
        &mut known.or_insert_with(new).sides
    }

    /// Whether a name or number of a line is too long; reports it.
    pub(super) fn has_long_name(&mut self, line: u64, text: &str) -> bool {
        let long = |word: &str| word.trim().len() > LONGEST_NAME;
        let Some(word) = text.split([',', '=']).find(|word| long(word)) else {
            return false;
        };
        let got = format!("`{:.40}…` of {} bytes", word.trim(), word.trim().len());
        let expected = format!("names and numbers of at most {LONGEST_NAME} characters");
        self.fault(line, Reason::TooLong, got, &expected, "Shorten the name.");
        true
    }

    pub(super) fn target(&mut self, word: &str) -> Target {
        let word = word.trim().trim_matches('"');
        match word.parse() {
            Ok(label) => Target::Label(label),
            // sets of an assembly may be named with their instance: INSTANCE.SET
            Err(_) => Target::Set(self.spelled(word.rsplit('.').next().unwrap_or(word))),
        }
    }
}

fn set<'a>(sets: &'a mut BTreeMap<Name, Set>, name: &Name, line: u64) -> &'a mut Vec<Target> {
    let new = || Set {
        line,
        ..Set::default()
    };
    &mut sets.entry(name.clone()).or_insert_with(new).members
}

pub(super) fn on_line(
    line: u64,
    reason: Reason,
    got: String,
    expected: &str,
    hint: &str,
) -> Violation {
    Violation::new("", reason, format!("line {line}: {got}"), expected, hint)
}
