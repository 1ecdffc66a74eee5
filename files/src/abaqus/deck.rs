//! The content of a deck: the supported parts, and the violations of the others.

use std::collections::{BTreeMap, HashMap};

use crate::source::{Labels, Plane};
use solver::element::Family;
use solver::error::{Findings, Reason, Violation};
use solver::mesh::RawMesh;

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
    /// First, last, step.
    Range(u64, u64, u64),
    Set(String),
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

/// The supported parts of a deck, and the violations.
#[derive(Default)]
pub(super) struct Deck {
    pub(super) raw: RawMesh,
    pub(super) nodes: Labels,
    pub(super) elements: Labels,
    pub(super) plane: Plane,
    pub(super) node_sets: BTreeMap<String, Vec<Target>>,
    pub(super) element_sets: BTreeMap<String, Vec<Target>>,
    /// Sides by element or set and number.
    pub(super) surfaces: BTreeMap<String, Vec<(Target, usize)>>,
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
        self.faults
            .add(on_line(line, reason, got.into(), expected, hint));
    }

    pub(super) fn doubt(&mut self, line: u64, got: impl Into<String>, expected: &str, hint: &str) {
        let reason = Reason::NotUnderstood;
        self.doubts
            .add(on_line(line, reason, got.into(), expected, hint));
    }

    /// The name as it was first written.
    pub(super) fn spelled(&mut self, name: &str) -> String {
        let known = self.spelling.entry(name.to_uppercase());
        known.or_insert_with(|| name.to_owned()).clone()
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

fn on_line(line: u64, reason: Reason, got: String, expected: &str, hint: &str) -> Violation {
    Violation::new("", reason, format!("line {line}: {got}"), expected, hint)
}
