//! Combines the parts of a deck into one mesh, and names there what the rows of the deck refer to.

use std::collections::{BTreeMap, BTreeSet};

use super::contact_parts::{Analytical, Held, RigidBody};
use super::deck::Deck;
use super::element::Typed;
use super::keyword::REMOVE_ELEMENTS;
use super::names::{Key, Meant, Names, Room, unknown};
use super::part::{Numbered, Part, RigidLines};
use super::rigid::{Search, Tools};
use super::scope::{Kind, Scope};
use super::supported::{UnknownKeyword, report_unknown};
use super::warming::{Warming, give_temperatures};
use super::written::{
    Distributed, Force, Incomplete, Name, On, PlacedSpring, Prescribed, Section, Sides, Spring,
    Target, Temperature, numbered, on_line,
};
use crate::source::Plane;
use solver::error::{Findings, Reason, Violation};
use solver::mesh::{NO_NODE, RawMesh};

/// The number of members that all sets together may have per node and element, in addition to those that the deck
/// writes out: sets that contain sets are short in the deck, but may be very long when written out.
const MOST_TIMES: u64 = 16;

/// A row of a deck, with the name that its target has in the mesh.
pub(super) struct Row<T> {
    pub(super) row: T,
    pub(super) name: String,
}

/// A deck as a mesh, with the data that a problem needs in addition.
pub(super) struct Built {
    /// The deck, of which a problem uses materials, steps and contacts.
    pub(super) deck: Deck,
    pub(super) raw: RawMesh,
    /// The violations of the mesh.
    pub(super) faults: Findings,
    /// The parts of the deck that a problem cannot have.
    pub(super) doubts: Findings,
    pub(super) incomplete: Incomplete,
    pub(super) types: Vec<Typed>,
    pub(super) sections: Vec<Row<Section>>,
    pub(super) prescribed: Vec<Row<Prescribed>>,
    pub(super) pressures: Vec<Row<Distributed>>,
    pub(super) springs: Vec<PlacedSpring>,
    pub(super) forces: Vec<Row<Force>>,
    pub(super) warming: Warming,
    /// Whether each node belongs to a plane element.
    pub(super) used: Vec<bool>,
    pub(super) tools: Tools,
    /// For each contact pair: the names of its two surfaces in the mesh.
    pub(super) pairs: Vec<[String; 2]>,
    /// The same for each *CLEARANCE.
    pub(super) clearances: Vec<[String; 2]>,
}

impl Deck {
    /// Builds the mesh of the deck with all names, and lists the violations.
    pub(super) fn build(mut self) -> Built {
        let mut merged = Merged::default();
        let scopes = merged.add_all(&mut self);
        merged.apply_amplitudes(&self);
        let names = Names {
            deck: &self,
            scopes: &scopes,
        };
        let mut sets = merged.sets(&names);
        let tools = merged.take_tools(&names, &sets);
        let contact = &names.deck.contact;
        let pairs = merged.named_pairs(&names, contact.pairs.iter().map(|pair| &pair.surfaces));
        let clearances = contact.clearances.iter().map(|row| &row.surfaces);
        let clearances = merged.named_pairs(&names, clearances);
        let used = merged.used();
        merged.check_plane(&used);
        let sections = merged.named_sections(&names);
        let prescribed = merged.named_nodes(
            &names,
            |rows| &mut rows.prescribed,
            |row| (&row.target, row.line),
        );
        let forces = merged.named_nodes(
            &names,
            |rows| &mut rows.forces,
            |row| (&row.target, row.line),
        );
        let mut tools = tools;
        tools.note_loaded(forces.iter().map(|row| &row.name), &merged.raw.node_sets);
        let temperatures = std::mem::take(&mut merged.rows.temperatures);
        let warming = give_temperatures(&names, temperatures, &used, &mut merged.raw);
        let springs = merged.placed_springs(&names, &sets, &used);
        let pressures = merged.surfaces(&names, &mut sets);
        merged.groups(&names, sets.elements, &tools.members);
        merged.raw.sets_span_boundaries = true;
        let Merged {
            raw,
            faults,
            doubts,
            incomplete,
            types,
            ..
        } = merged;
        Built {
            deck: self,
            raw,
            faults,
            doubts,
            incomplete,
            types,
            sections,
            prescribed,
            pressures,
            forces,
            springs,
            warming,
            used,
            tools,
            pairs,
            clearances,
        }
    }
}

/// The rows of all parts, each with the place of its scope.
#[derive(Default)]
struct Rows {
    sections: Vec<(usize, Section)>,
    prescribed: Vec<(usize, Prescribed)>,
    pressures: Vec<(usize, Distributed)>,
    forces: Vec<(usize, Force)>,
    temperatures: Vec<(usize, Temperature)>,
    springs: Vec<(usize, Spring)>,
    held: Vec<(usize, Held)>,
    rigid_bodies: Vec<(usize, RigidBody)>,
    analytical: Vec<(usize, Name, Analytical)>,
}

/// All parts of the deck merged into one.
#[derive(Default)]
struct Merged {
    raw: RawMesh,
    heights: Vec<f64>,
    lines: Vec<[u32; 3]>,
    numbered: Vec<Numbered>,
    types: Vec<Typed>,
    unused_type: Option<(u64, String)>,
    unknown_keywords: Vec<UnknownKeyword>,
    rigid_lines: Vec<RigidLines>,
    /// The line of the first elements SPRING1.
    first_spring: Option<u64>,
    rows: Rows,
    incomplete: Incomplete,
    /// The number of members of sets and surfaces as they are written.
    written: u64,
    faults: Findings,
    doubts: Findings,
}

/// The sets of elements of a deck, each as places among all numbered elements; and the room for further members of
/// sets.
struct Sets {
    elements: BTreeMap<Key, Vec<u32>>,
    room: Room,
}

impl Merged {
    /// Adds the assembly and all instances.
    fn add_all(&mut self, deck: &mut Deck) -> Vec<Scope> {
        let mut instances = std::mem::take(&mut deck.instances);
        if instances.is_empty() && !deck.parts.is_empty() {
            let parts = std::mem::take(&mut deck.parts);
            if parts.len() > 1 {
                let names: Vec<String> = parts
                    .keys()
                    .take(5)
                    .map(|name| format!("{name:.60}"))
                    .collect();
                self.incomplete = Incomplete::ALL;
                self.faults.add(Violation::new(
                    "",
                    Reason::Malformed,
                    format!("the parts {} without *INSTANCE", names.join(", ")),
                    "*ASSEMBLY with *INSTANCE, NAME=…, PART=…",
                    "List the parts of the body by *INSTANCE, with their positions.",
                ));
            } else {
                // a single part may stand for itself
                instances.extend(parts);
            }
        }
        let assembly = std::mem::take(&mut deck.here);
        let all = std::iter::once((None, assembly));
        let all = all.chain(instances.into_iter().map(|(name, part)| (Some(name), part)));
        let scopes: Vec<Scope> = all
            .enumerate()
            .map(|(place, (name, part))| self.add(place, name, part))
            .collect();
        report_unknown(std::mem::take(&mut self.unknown_keywords), &mut self.doubts);
        if self.raw.nodes.is_empty() && !self.incomplete.nodes {
            self.faults.add(Violation::new(
                "",
                Reason::TooFew,
                "a deck without *NODE",
                "nodes and elements",
                "Check that the file is an Abaqus or CalculiX deck (.inp), and that its parts have an *INSTANCE.",
            ));
        }
        if let Some((line, got)) = self
            .unused_type
            .take()
            .filter(|_| self.raw.elements.is_empty())
        {
            self.incomplete.elements = true;
            self.faults.add(on_line(
                line,
                Reason::Unsupported,
                got,
                "CPE, CPS or CAX with 3, 4, 6 or 8 nodes, or others of a plane",
                "Mesh with solid elements of plane strain, plane stress or axisymmetry.",
            ));
        }
        scopes
    }

    fn add(&mut self, place: usize, name: Option<Name>, mut part: Part) -> Scope {
        self.written += part.size();
        let (nodes, numbered) = (self.raw.nodes.len() as u32, self.numbered.len() as u32);
        let (elements, lines) = (self.raw.elements.len() as u32, self.lines.len() as u32);
        let moved = |node: u32| if node == NO_NODE { node } else { node + nodes };
        if nodes > 0 {
            for element in &mut part.elements {
                *element = element.map_nodes(moved);
            }
        }
        join(&mut self.raw.nodes, part.nodes);
        join(&mut self.raw.node_labels, part.node_labels);
        join(&mut self.heights, part.heights);
        join(&mut self.raw.elements, part.elements);
        join(&mut self.raw.element_labels, part.element_labels);
        self.lines
            .extend(part.lines.into_iter().map(|line| line.map(moved)));
        self.numbered
            .extend(part.numbered.into_iter().map(|element| match element {
                Numbered::Plane(place) => Numbered::Plane(place + elements),
                Numbered::Line(place) => Numbered::Line(place + lines),
                Numbered::Other => Numbered::Other,
            }));
        self.raw.without_centre += part.with_centre;
        for kind in part.types {
            if !self
                .types
                .iter()
                .any(|known| known.mechanics == kind.mechanics)
            {
                self.types.push(kind);
            }
        }
        self.unused_type = self.unused_type.take().or(part.unused_type);
        self.rigid_lines
            .extend(part.rigid_lines.into_iter().map(|lines| RigidLines {
                places: lines.places.start + numbered..lines.places.end + numbered,
                ..lines
            }));
        let rows = &mut self.rows;
        rows.sections
            .extend(part.sections.into_iter().map(|row| (place, row)));
        rows.prescribed
            .extend(part.prescribed.into_iter().map(|row| (place, row)));
        rows.pressures
            .extend(part.pressures.into_iter().map(|row| (place, row)));
        rows.forces
            .extend(part.forces.into_iter().map(|row| (place, row)));
        rows.temperatures
            .extend(part.temperatures.into_iter().map(|row| (place, row)));
        rows.springs
            .extend(part.springs.into_iter().map(|row| (place, row)));
        self.first_spring = self.first_spring.or(part.first_spring);
        rows.held
            .extend(part.held.into_iter().map(|row| (place, row)));
        rows.rigid_bodies
            .extend(part.rigid_bodies.into_iter().map(|body| (place, body)));
        let analytical = part.analytical.into_iter();
        rows.analytical
            .extend(analytical.map(|(name, surface)| (place, name, surface)));
        self.incomplete.add(part.incomplete);
        self.unknown_keywords.extend(part.unknown_keywords);
        part.faults.add_to(&mut self.faults);
        part.doubts.add_to(&mut self.doubts);
        Scope {
            name,
            incomplete: part.incomplete,
            node_places: part.node_places,
            nodes_from: nodes,
            element_places: part.element_places,
            elements_from: numbered,
            node_sets: part.node_sets,
            element_sets: part.element_sets,
            node_surfaces: part.node_surfaces,
            surfaces: part.surfaces,
        }
    }

    /// Finds the rigid bodies and removes their elements from the mesh.
    fn take_tools(&mut self, names: &Names<'_>, sets: &Sets) -> Tools {
        let search = Search {
            names,
            raw: &self.raw,
            lines: &self.lines,
            numbered: &self.numbered,
            elements: &sets.elements,
        };
        let held = std::mem::take(&mut self.rows.held);
        let mut tools = search.tools(&self.rows.rigid_bodies, &self.rows.analytical, held);
        for lines in &self.rigid_lines {
            let known = |place: u32| tools.members.contains(&place);
            if !(lines.places.clone().all(known) || self.incomplete.names) {
                self.doubts.add(on_line(
                    lines.line,
                    Reason::Unsupported,
                    format!("{} that belong to no *RIGID BODY", lines.what),
                    "rigid lines as the surface of a *RIGID BODY, ELSET=…, REF NODE=…",
                    REMOVE_ELEMENTS,
                ));
            }
        }
        if tools.elements.is_empty() {
            return tools;
        }
        let kept = |place: &u32| !tools.elements.contains(place);
        let kept: Vec<u32> = (0..self.raw.elements.len() as u32).filter(kept).collect();
        let mut number = vec![NO_NODE; self.raw.elements.len()];
        for (new, old) in kept.iter().enumerate() {
            number[*old as usize] = new as u32;
        }
        for element in &mut self.numbered {
            if let Numbered::Plane(place) = *element {
                *element = match number[place as usize] {
                    NO_NODE => Numbered::Other,
                    new => Numbered::Plane(new),
                };
            }
        }
        let raw = &mut self.raw;
        let left_out = tools
            .elements
            .iter()
            .map(|&k| raw.element_labels[k as usize]);
        tools.left_out = numbered("element", left_out);
        raw.elements = kept.iter().map(|&k| raw.elements[k as usize]).collect();
        raw.element_labels = kept
            .iter()
            .map(|&k| raw.element_labels[k as usize])
            .collect();
        tools
    }

    /// The names in the mesh of pairs of surfaces; an unknown name is kept as it is written.
    fn named_pairs<'n>(
        &self,
        names: &Names<'_>,
        pairs: impl Iterator<Item = &'n [Name; 2]>,
    ) -> Vec<[String; 2]> {
        let has = |scope: usize, name: &Name| {
            let rigid = |(s, n, _): &(usize, Name, Analytical)| *s == scope && n == name;
            names.scopes[scope].surfaces.contains_key(name)
                || names.scopes[scope].node_surfaces.contains_key(name)
                || self.rows.analytical.iter().any(rigid)
        };
        let full = |word: &Name| match names.named(0, word, has) {
            Some((scope, name)) => names.full(scope, &name),
            None => word.to_string(),
        };
        pairs.map(|[a, b]| [full(a), full(b)]).collect()
    }

    /// Whether each node belongs to a plane element.
    fn used(&self) -> Vec<bool> {
        let mut used = vec![false; self.raw.nodes.len()];
        for element in &self.raw.elements {
            for node in element.iter().filter(|node| **node != NO_NODE) {
                used[*node as usize] = true;
            }
        }
        used
    }

    /// Checks that the nodes of plane elements lie in one plane; other nodes, like reference points, may be anywhere.
    fn check_plane(&mut self, used: &[bool]) {
        let mut plane = Plane::default();
        for (node, height) in self
            .heights
            .drain(..)
            .enumerate()
            .filter(|(node, _)| used[*node])
        {
            let [x, y] = self.raw.nodes[node];
            plane.add(self.raw.node_labels[node], [x, y, height]);
        }
        self.faults.extend(plane.fault());
    }

    /// Resolves all sets, and gives sets of nodes their names in the mesh.
    fn sets(&mut self, names: &Names<'_>) -> Sets {
        let mesh = (self.raw.nodes.len() + self.numbered.len()) as u64;
        let mut room = Room::new((1 << 16) + 2 * self.written + MOST_TIMES * mesh);
        let none = |_: &Key, _: &mut Vec<u32>| false;
        let elements = names.resolve(Kind::Elements, none, &mut room, &mut self.faults);
        let nodes_of = |key: &Key, found: &mut Vec<u32>| {
            let Some(set) = elements.get(key) else {
                return false;
            };
            found.extend(set.iter().flat_map(|element| self.nodes_of(*element)));
            true
        };
        let mut faults = Findings::default();
        let nodes = names.resolve(Kind::Nodes, nodes_of, &mut room, &mut faults);
        let surfaces = names.resolve(Kind::NodeSurfaces, nodes_of, &mut room, &mut faults);
        self.faults.extend(faults.into_violations());
        for (name, set) in exported(names, nodes, &mut self.faults) {
            self.raw.node_sets.insert(name, set);
        }
        for (name, set) in exported(names, surfaces, &mut self.faults) {
            self.raw.node_sets.entry(name).or_insert(set);
        }
        Sets { elements, room }
    }

    /// Adds the sets of elements to the mesh under their names: as groups, and as boundaries where they contain line
    /// elements.
    ///
    /// `rigid`: places of the elements of rigid bodies, whose lines are no boundary of the elastic body.
    fn groups(
        &mut self,
        names: &Names<'_>,
        elements: BTreeMap<Key, Vec<u32>>,
        rigid: &BTreeSet<u32>,
    ) {
        for (name, set) in exported(names, elements, &mut self.faults) {
            let plane = |element: &u32| match self.numbered[*element as usize] {
                Numbered::Plane(place) => Some(place),
                _ => None,
            };
            let group: Vec<u32> = set.iter().filter_map(plane).collect();
            let lines: Vec<[u32; 2]> = set
                .iter()
                .filter(|element| !rigid.contains(element))
                .filter_map(|element| self.ends(*element))
                .collect();
            // a surface of the same name is another thing, and comes first
            if !lines.is_empty() {
                self.raw.lines.entry(name.clone()).or_insert(lines);
            }
            // a set of lines only is no group
            if !group.is_empty() {
                self.raw.groups.insert(name, group);
            }
        }
    }

    /// The nodes of an element.
    fn nodes_of(&self, element: u32) -> impl Iterator<Item = u32> + '_ {
        let (element, line) = match self.numbered[element as usize] {
            Numbered::Plane(place) => (Some(&self.raw.elements[place as usize]), None),
            Numbered::Line(place) => (None, Some(&self.lines[place as usize])),
            Numbered::Other => (None, None),
        };
        let element = element.into_iter().flat_map(|element| element.iter());
        let all = element.chain(line.into_iter().flatten());
        all.copied().filter(|node| *node != NO_NODE)
    }

    /// The end nodes of a line element: of its three nodes the two that are farthest apart, since programs write the
    /// middle node in different places.
    fn ends(&self, element: u32) -> Option<[u32; 2]> {
        let Numbered::Line(place) = self.numbered[element as usize] else {
            return None;
        };
        let [a, b, c] = self.lines[place as usize];
        if c == NO_NODE {
            return (b != NO_NODE).then_some([a, b]);
        }
        let far = |[p, q]: [u32; 2]| {
            let [p, q] = [p, q].map(|node| self.raw.nodes[node as usize]);
            (p[0] - q[0]).hypot(p[1] - q[1])
        };
        let pairs = [[a, b], [a, c], [b, c]];
        pairs.into_iter().max_by(|p, q| far(*p).total_cmp(&far(*q)))
    }

    /// The springs at the nodes of their elements; elements SPRING1 without *SPRING are refused.
    fn placed_springs(
        &mut self,
        names: &Names<'_>,
        sets: &Sets,
        used: &[bool],
    ) -> Vec<PlacedSpring> {
        let is_spring = |merged: &Merged, element: &u32| match merged.numbered[*element as usize] {
            Numbered::Line(place) => merged.lines[place as usize][1] == NO_NODE,
            _ => false,
        };
        let mut covered: BTreeSet<u32> = BTreeSet::new();
        let mut found = Vec::new();
        for (scope, spring) in std::mem::take(&mut self.rows.springs) {
            let target = Target::Set(spring.elements.clone());
            let meant = names.meant(Kind::Elements, scope, &target);
            let elements = match &meant {
                Some(Meant::Set(key)) => sets.elements.get(key).map_or(&[][..], |set| set),
                _ => &[],
            };
            let nodes: Vec<u32> = elements.iter().flat_map(|e| self.nodes_of(*e)).collect();
            let springs_only = elements.iter().all(|e| is_spring(self, e));
            let sound = springs_only && nodes.iter().all(|node| used[*node as usize]);
            if elements.is_empty() || !sound {
                if !self.incomplete.names {
                    self.doubts.add(on_line(
                        spring.line,
                        Reason::NotUnderstood,
                        format!("*SPRING of `{:.60}`", spring.elements),
                        "a set of elements SPRING1 at nodes of plane elements",
                        "Springs between two nodes (SPRING2, SPRINGA) are not computed.",
                    ));
                }
                continue;
            }
            covered.extend(elements);
            let name = meant.map_or_else(String::new, |meant| names.of(&meant));
            found.push(PlacedSpring {
                spring,
                name,
                nodes,
            });
        }
        let all = (0..self.numbered.len() as u32).filter(|e| is_spring(self, e));
        if let Some(line) = self.first_spring
            && all.into_iter().any(|e| !covered.contains(&e))
        {
            self.doubts.add(on_line(
                line,
                Reason::NotUnderstood,
                "elements SPRING1 without *SPRING".to_owned(),
                "*SPRING, ELSET=… for each of them",
                "Give their stiffness, or remove them.",
            ));
        }
        found
    }

    /// Multiplies each value of a row by the factor of the row's amplitude at the end of the step.
    fn apply_amplitudes(&mut self, deck: &Deck) {
        let rows = &mut self.rows;
        let prescribed = rows.prescribed.iter_mut();
        let prescribed = prescribed.map(|(_, row)| (row.line, &row.amplitude, &mut row.value));
        let pressures = rows.pressures.iter_mut();
        let pressures = pressures.map(|(_, row)| (row.line, &row.amplitude, &mut row.value));
        let forces = rows.forces.iter_mut();
        let forces = forces.map(|(_, row)| (row.line, &row.amplitude, &mut row.value));
        let temperatures = rows.temperatures.iter_mut();
        let temperatures = temperatures.map(|(_, row)| (row.line, &row.amplitude, &mut row.value));
        let others = pressures.chain(forces).chain(temperatures);
        let all: Vec<_> = prescribed.chain(others).collect();
        // the amplitudes of what acts in each step
        let mut acting: BTreeMap<usize, BTreeSet<Option<Name>>> = BTreeMap::new();
        for (line, amplitude, value) in &all {
            if **value != 0.0 {
                let step = deck.contact.step_of(*line);
                acting.entry(step).or_default().insert((*amplitude).clone());
            }
        }
        for (line, amplitude, value) in all {
            let Some(name) = amplitude else { continue };
            let in_step = acting.get(&deck.contact.step_of(line));
            let alone = in_step.is_none_or(|others| others.len() == 1);
            let off = || {
                deck.off_the_way(name, line, alone)
                    .filter(|_| *value != 0.0)
            };
            match deck.factor(name) {
                Ok(_) if deck.has_friction() && deck.turns(name, line) => self.doubts.add(on_line(
                    line,
                    Reason::NotUnderstood,
                    format!("the amplitude `{name:.60}`, which rises and falls within the step, in a deck with friction"),
                    "an amplitude that only rises, or only falls",
                    "Friction depends on the way to the end: write a *STEP for each part of the amplitude.",
                )),
                Ok(_) if deck.has_friction() && off().is_some() => self.doubts.add(on_line(
                    line,
                    Reason::NotUnderstood,
                    format!("the amplitude `{name:.60}`, {}, in a deck with friction", off().unwrap_or_default()),
                    "amplitudes that begin at 0 and rise together: all loads and displacements of a step are increased in proportion",
                    "Friction depends on the way to the end: leave the amplitude out, so that the load rises over the step, or write a *STEP for each part of the way.",
                )),
                Ok(factor) => *value *= factor,
                Err(got) => self.doubts.add(on_line(
                    line,
                    Reason::NotUnderstood,
                    got,
                    "*AMPLITUDE with a table of times and factors",
                    "Give the values at the end of the step.",
                )),
            }
        }
    }

    fn named_sections(&mut self, names: &Names<'_>) -> Vec<Row<Section>> {
        let mut found = Vec::new();
        for (scope, row) in std::mem::take(&mut self.rows.sections) {
            let target = Target::Set(row.elements.clone());
            match names.meant(Kind::Elements, scope, &target) {
                Some(meant) => found.push(Row {
                    name: names.of(&meant),
                    row,
                }),
                None if self.incomplete.names => {}
                None => unknown(
                    &mut self.doubts,
                    row.line,
                    &format!("the element set `{:.60}` of *SOLID SECTION", row.elements),
                    "a set of elements (*ELSET)",
                    || names.all_sets(Kind::Elements),
                    Kind::Elements.remedy(),
                ),
            }
        }
        found
    }

    /// Converts rows that name nodes to rows with the names of sets in the mesh, in the order of the deck; a single
    /// node becomes a set of one.
    fn named_nodes<T>(
        &mut self,
        names: &Names<'_>,
        rows: impl Fn(&mut Rows) -> &mut Vec<(usize, T)>,
        target: impl Fn(&T) -> (&Target, u64),
    ) -> Vec<Row<T>> {
        let mut rows = std::mem::take(rows(&mut self.rows));
        rows.sort_by_key(|(_, row)| target(row).1);
        let mut found = Vec::new();
        for (scope, row) in rows {
            let (to, line) = target(&row);
            let Some(meant) = names.meant(Kind::Nodes, scope, to) else {
                let label = matches!(to, Target::Label(_));
                if !(self.incomplete.names || label && self.incomplete.nodes) {
                    let hint = names.remedy(Kind::Nodes, scope, to);
                    self.unknown_target(
                        line,
                        &word(to),
                        "a node or a set of nodes",
                        || names.known(Kind::Nodes, to),
                        &hint,
                    );
                }
                continue;
            };
            let name = names.of(&meant);
            if let Meant::Label(scope, label) = meant {
                let node = names.scopes[scope].place(Kind::Nodes, label);
                self.raw
                    .node_sets
                    .entry(name.clone())
                    .or_insert_with(|| node.into_iter().collect());
            }
            found.push(Row { row, name });
        }
        found
    }

    fn unknown_target(
        &mut self,
        line: u64,
        got: &str,
        expected: &str,
        known: impl FnOnce() -> Vec<String>,
        remedy: &str,
    ) {
        unknown(
            &mut self.doubts,
            line,
            &format!("`{got:.60}`"),
            expected,
            known,
            remedy,
        );
    }

    /// The elements that a row of `*DLOAD` acts on; otherwise it is reported.
    fn elements_meant(
        &mut self,
        names: &Names<'_>,
        scope: usize,
        row: &Distributed,
    ) -> Option<Meant> {
        let meant = names.meant(Kind::Elements, scope, &row.target);
        let label = matches!(row.target, Target::Label(_));
        if meant.is_none() && !(self.incomplete.names || label && self.incomplete.elements) {
            let hint = names.remedy(Kind::Elements, scope, &row.target);
            self.unknown_target(
                row.line,
                &word(&row.target),
                "an element or a set of elements",
                || names.known(Kind::Elements, &row.target),
                &hint,
            );
        }
        meant
    }

    /// Adds the surfaces of the deck, and the sides that the deck loads, to the mesh; returns the rows of pressures.
    fn surfaces(&mut self, names: &Names<'_>, sets: &mut Sets) -> Vec<Row<Distributed>> {
        let mut building = Building {
            names,
            sets,
            twice: None,
        };
        let mut known = BTreeSet::new();
        for (scope, place) in names.scopes.iter().enumerate() {
            for (name, surface) in &place.surfaces {
                let full = names.full(scope, name);
                let lines = building.lines(self, scope, &full, surface.line, &surface.sides);
                known.insert((scope, name.clone()));
                if let Some(lines) = lines {
                    self.raw.lines.insert(full, lines);
                }
            }
        }
        // as of sets, the name without that of the instance
        let mut short: BTreeMap<&Name, Option<usize>> = BTreeMap::new();
        for (scope, name) in &known {
            let only = short.entry(name);
            only.and_modify(|only| *only = None)
                .or_insert(Some(*scope).filter(|scope| *scope > 0));
        }
        for (name, scope) in short {
            let scope = scope.filter(|_| !names.scopes[0].defines(name));
            let full = scope.map(|scope| names.full(scope, name));
            if let Some(lines) = full.and_then(|full| self.raw.lines.get(&full)).cloned() {
                self.raw.lines.insert(name.to_string(), lines);
            }
        }
        let mut rows = std::mem::take(&mut self.rows.pressures);
        rows.sort_by_key(|(_, row)| row.line);
        let mut found = Vec::new();
        let mut loaded = BTreeSet::new();
        for (scope, row) in rows {
            if row.on == On::Surface {
                let Target::Set(name) = &row.target else {
                    self.unknown_target(
                        row.line,
                        &word(&row.target),
                        "a surface (*SURFACE)",
                        Vec::new,
                        "*DSLOAD acts on surfaces: define one by *SURFACE, or load sides of elements by *DLOAD.",
                    );
                    continue;
                };
                match names.named(scope, name, |scope, name| {
                    known.contains(&(scope, name.clone()))
                }) {
                    Some((scope, name)) => {
                        let name = names.full(scope, &name);
                        if self.raw.lines.contains_key(&name) {
                            found.push(Row { row, name });
                        } else {
                            let known = "a surface of sides of plane elements";
                            let remedy = "A pressure acts on sides: name elements and S1 … S4 in that surface, or its elements alone for all sides of the body's surface.";
                            self.unknown_target(row.line, &name, known, Vec::new, remedy);
                        }
                    }
                    None if self.incomplete.names => {}
                    None => self.unknown_target(
                        row.line,
                        name,
                        "a surface (*SURFACE)",
                        || {
                            let known = known.iter().take(20);
                            known
                                .map(|(scope, name)| names.full(*scope, name))
                                .collect()
                        },
                        "Correct the name, or define the surface by *SURFACE.",
                    ),
                }
                continue;
            }
            let meant = match &row.on {
                On::Mass(_) if row.is_of_all() => None,
                _ => match self.elements_meant(names, scope, &row) {
                    None => continue,
                    meant => meant,
                },
            };
            let of = meant.map_or_else(String::new, |meant| names.of(&meant));
            if let On::Mass(load) = &row.on {
                let name = format!("{of} {load}");
                found.push(Row { row, name });
                continue;
            }
            let On::Side(side) = row.on else { continue };
            let name = format!("{of} P{side}");
            // a deck may load the same side many times
            if loaded.insert(name.clone()) {
                let sides = [(row.target.clone(), Sides::Number(side))];
                let lines = building.lines(self, scope, &name, row.line, &sides);
                self.raw
                    .lines
                    .entry(name.clone())
                    .or_insert(lines.unwrap_or_default());
            }
            found.push(Row { row, name });
        }
        found
    }
}

/// Builds boundaries from the sides of elements, by name.
struct Building<'a> {
    names: &'a Names<'a>,
    sets: &'a mut Sets,
    /// The sides that two elements share, as corners; `None` until they are needed.
    twice: Option<Vec<(u32, u32)>>,
}

impl Building<'_> {
    /// The corners of the named sides of elements; none if a target has sides that plane elements lack.
    fn lines(
        &mut self,
        merged: &mut Merged,
        scope: usize,
        name: &str,
        line: u64,
        sides: &[(Target, Sides)],
    ) -> Option<Vec<[u32; 2]>> {
        let mut lines = Vec::new();
        for (target, side) in sides {
            let single;
            let elements: &[u32] = match self.names.meant(Kind::Elements, scope, target) {
                Some(Meant::Label(scope, label)) => {
                    single = self.names.scopes[scope].place(Kind::Elements, label);
                    single.as_slice()
                }
                Some(Meant::Set(key)) => self.sets.elements.get(&key).map_or(&[][..], |set| set),
                None => {
                    let label = matches!(target, Target::Label(_));
                    if !(merged.incomplete.names || label && merged.incomplete.elements) {
                        let got = format!("`{:.60}` in the surface `{name:.60}`", word(target));
                        unknown(
                            &mut merged.faults,
                            line,
                            &got,
                            "an element or a set of elements",
                            || self.names.known(Kind::Elements, target),
                            &self.names.remedy(Kind::Elements, scope, target),
                        );
                    }
                    continue;
                }
            };
            if !self
                .sets
                .room
                .take(elements.len() as u64, line, name, &mut merged.faults)
            {
                break;
            }
            for place in elements {
                let Numbered::Plane(place) = merged.numbered[*place as usize] else {
                    continue;
                };
                let element = &merged.raw.elements[place as usize];
                let corners = element.family().corners();
                let between = |side: usize| [element[side], element[(side + 1) % corners]];
                match *side {
                    Sides::None | Sides::OfLine { .. } => return None,
                    Sides::Number(side) if side > corners => {
                        let label = merged.raw.element_labels[place as usize];
                        merged.faults.add(on_line(
                            line,
                            Reason::UnknownEdge,
                            format!("side {side} of the triangle {label} in `{name:.60}`"),
                            "sides 1 … 3 of a triangle",
                            "Name the sides of triangles and of quadrilaterals in sets of their own.",
                        ));
                        break;
                    }
                    Sides::Number(side) => lines.push(between(side - 1)),
                    Sides::Outer => {
                        let twice = self.twice.get_or_insert_with(|| sides_of_two(&merged.raw));
                        let outer = |ends: &[u32; 2]| twice.binary_search(&key(*ends)).is_err();
                        lines.extend((0..corners).map(between).filter(outer));
                    }
                }
            }
        }
        Some(lines)
    }
}

/// The sides that two elements share, each by its two corners, sorted.
pub(super) fn sides_of_two(raw: &RawMesh) -> Vec<(u32, u32)> {
    let mut sides: Vec<(u32, u32)> = raw
        .elements
        .iter()
        .flat_map(|element| {
            let corners = element.family().corners();
            (0..corners).map(move |k| key([element[k], element[(k + 1) % corners]]))
        })
        .collect();
    sides.sort_unstable();
    let mut last = None;
    sides.retain(|side| last.replace(*side) == Some(*side));
    sides.dedup();
    sides
}

/// Identifies a side by its two corners, whatever their order.
pub(super) fn key([a, b]: [u32; 2]) -> (u32, u32) {
    (a.min(b), a.max(b))
}

/// Sets under their names in the mesh. A set of an instance has two names: `INSTANCE.SET`, and `SET` alone if no other
/// instance or the assembly has that name.
fn exported(
    names: &Names<'_>,
    sets: BTreeMap<Key, Vec<u32>>,
    faults: &mut Findings,
) -> BTreeMap<String, Vec<u32>> {
    let mut exported: BTreeMap<String, Vec<u32>> = BTreeMap::new();
    let mut short: BTreeMap<Name, Option<Vec<u32>>> = BTreeMap::new();
    for ((scope, name), set) in sets {
        if scope > 0 {
            let known = short.entry(name.clone());
            known
                .and_modify(|other| *other = None)
                .or_insert_with(|| Some(set.clone()));
        }
        let full = names.full(scope, &name);
        if exported.contains_key(&full) {
            faults.add(on_line(
                names.line_in_assembly(&full),
                Reason::DuplicateName,
                format!("the set `{full:.120}` of the assembly, and a set of an instance with the same full name"),
                "sets of the assembly that are not named INSTANCE.SET like those of instances",
                "Rename the set of the assembly, also in the keywords that name it.",
            ));
        }
        exported.insert(full, set);
    }
    for (name, set) in short {
        if let Some(set) = set.filter(|_| !names.scopes[0].defines(&name)) {
            exported.entry(name.to_string()).or_insert(set);
        }
    }
    exported
}

/// A target as text, as the deck names it.
fn word(target: &Target) -> String {
    match target {
        Target::Label(label) => label.to_string(),
        Target::Set(name) => name.to_string(),
        Target::Range(range) => format!("{}-{}:{}", range[0], range[1], range[2]),
    }
}

/// Appends the list `more` to `all`, without a copy if `all` is empty.
fn join<T>(all: &mut Vec<T>, mut more: Vec<T>) {
    if all.is_empty() {
        *all = more;
    } else {
        all.append(&mut more);
    }
}
