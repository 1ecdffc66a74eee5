//! A scope of names: the assembly or an instance of a part, with its own numbers and names.

use std::collections::BTreeMap;

use super::written::{Incomplete, Name, Set, Surface};
use crate::source::Labels;

/// The kinds of sets: of nodes, of elements, and surfaces of nodes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    Nodes,
    Elements,
    /// Surfaces of nodes.
    NodeSurfaces,
}

impl Kind {
    pub(super) fn what(self) -> &'static str {
        match self {
            Kind::Elements => "element",
            _ => "node",
        }
    }

    pub(super) fn one(self) -> &'static str {
        match self {
            Kind::Elements => "an element",
            _ => "a node",
        }
    }

    /// The advice for an unknown name or number of this kind.
    pub(super) fn remedy(self) -> &'static str {
        match self {
            Kind::Elements => {
                "Correct the name, or define the set by *ELSET or by ELSET=… of *ELEMENT."
            }
            _ => "Correct the name, or define the set by *NSET or by NSET=… of *NODE.",
        }
    }

    /// The kind of sets that may be members of a set of this kind: a surface of nodes may contain sets of nodes.
    pub(super) fn named(self) -> Kind {
        match self {
            Kind::Elements => Kind::Elements,
            _ => Kind::Nodes,
        }
    }

    pub(super) fn keyword(self) -> &'static str {
        match self {
            Kind::Elements => "ELSET",
            _ => "NSET",
        }
    }
}

/// The assembly or an instance: its names, and the places of its nodes and elements in the mesh.
pub(super) struct Scope {
    /// The name of the instance; none for the assembly.
    pub(super) name: Option<Name>,
    pub(super) incomplete: Incomplete,
    pub(super) node_places: Labels,
    pub(super) nodes_from: u32,
    pub(super) element_places: Labels,
    pub(super) elements_from: u32,
    pub(super) node_sets: BTreeMap<Name, Set>,
    pub(super) element_sets: BTreeMap<Name, Set>,
    pub(super) node_surfaces: BTreeMap<Name, Set>,
    pub(super) surfaces: BTreeMap<Name, Surface>,
}

impl Scope {
    pub(super) fn sets(&self, kind: Kind) -> &BTreeMap<Name, Set> {
        match kind {
            Kind::Nodes => &self.node_sets,
            Kind::Elements => &self.element_sets,
            Kind::NodeSurfaces => &self.node_surfaces,
        }
    }

    /// Whether this scope has a set or surface with this name.
    pub(super) fn defines(&self, name: &Name) -> bool {
        self.node_sets.contains_key(name)
            || self.element_sets.contains_key(name)
            || self.node_surfaces.contains_key(name)
            || self.surfaces.contains_key(name)
    }

    fn labels(&self, kind: Kind) -> (&Labels, u32) {
        match kind {
            Kind::Elements => (&self.element_places, self.elements_from),
            _ => (&self.node_places, self.nodes_from),
        }
    }

    /// The place in the mesh of the node or element with this number.
    pub(super) fn place(&self, kind: Kind, label: u64) -> Option<u32> {
        let (labels, from) = self.labels(kind);
        Some(labels.get(label)? + from)
    }

    /// The places in the mesh of a range of numbers, and how many numbers were examined.
    pub(super) fn range(
        &self,
        kind: Kind,
        (first, last, step): (u64, u64, u64),
        most: u64,
    ) -> (Vec<u32>, u64) {
        let (labels, from) = self.labels(kind);
        let (mut places, visited) = labels.range(first, last, step, most);
        places.iter_mut().for_each(|place| *place += from);
        (places, visited)
    }

    /// The advice for an unknown number, which says which numbers exist.
    pub(super) fn hint_of_numbers(&self, kind: Kind) -> String {
        let (labels, _) = self.labels(kind);
        let (what, keyword) = match kind {
            Kind::Elements => ("elements", "*ELEMENT"),
            _ => ("nodes", "*NODE"),
        };
        let of = match &self.name {
            Some(instance) => format!(" of the instance `{instance:.60}`"),
            None => String::new(),
        };
        match labels.ends() {
            Some((first, last)) => format!(
                "The {what}{of} have numbers from {first} to {last}, not necessarily all of them. Correct the number, or define it by {keyword}."
            ),
            None => format!(
                "There are no {what}{of} here. Define them by {keyword}, or name those of an instance as INSTANCE.NUMBER."
            ),
        }
    }

    /// Whether a missing number may be on a line that could not be read.
    pub(super) fn incomplete_numbers(&self, kind: Kind) -> bool {
        match kind {
            Kind::Elements => self.incomplete.elements,
            _ => self.incomplete.nodes,
        }
    }
}
