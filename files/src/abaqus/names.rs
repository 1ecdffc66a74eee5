//! Resolves the names and numbers of a deck to places in a mesh.

use std::collections::{BTreeMap, BTreeSet};

use super::deck::{Deck, Incomplete, Name, Set, Surface, Target, on_line};
use crate::source::Labels;
use solver::error::{Findings, Reason, Violation};
use solver::mesh::RawMesh;

/// How often all sets together may name a node or an element on average, beside what the deck writes out: sets that
/// contain sets are short in the deck, and may be very long when written out.
const MOST_TIMES: u64 = 16;

impl Deck {
    /// The name of the target of a load or support, as `into_raw` gives it to the mesh.
    pub(super) fn name_of(target: &Target, side: Option<usize>) -> String {
        let name = match target {
            Target::Label(label) => label.to_string(),
            Target::Set(name) => name.to_string(),
            Target::Range(range) => format!("{}-{}:{}", range[0], range[1], range[2]),
        };
        match side {
            Some(side) => format!("{name} P{side}"),
            None => name,
        }
    }

    /// The mesh with all its names, and its violations.
    pub(super) fn into_raw(mut self) -> (RawMesh, Findings) {
        let mut faults = std::mem::take(&mut self.faults);
        let mut room = self.room();
        let incomplete = self.incomplete;
        let elements = Labelled {
            labels: &self.elements,
            what: "element",
            keyword: "ELSET",
            incomplete: incomplete.elements,
        };
        let nodes = Labelled {
            labels: &self.nodes,
            what: "node",
            keyword: "NSET",
            incomplete: incomplete.nodes,
        };
        let element_sets = resolve(
            &self.element_sets,
            elements,
            incomplete,
            &mut room,
            &mut faults,
        );
        let node_sets = resolve(&self.node_sets, nodes, incomplete, &mut room, &mut faults);
        let surfaces = std::mem::take(&mut self.surfaces);
        let mut surfaces: Vec<(String, Surface)> = surfaces
            .into_iter()
            .map(|(name, surface)| (name.to_string(), surface))
            .collect();
        // a deck may load the same side many times
        let mut loaded = BTreeSet::new();
        for pressure in &self.pressures {
            if let Some(side) = pressure.side {
                let name = Deck::name_of(&pressure.target, Some(side));
                if loaded.insert(name.clone()) {
                    let (line, sides) = (pressure.line, vec![(pressure.target.clone(), side)]);
                    surfaces.push((name, Surface { line, sides }));
                }
            }
        }
        for (name, surface) in surfaces {
            let mut lines = Vec::new();
            for (target, side) in surface.sides {
                let single;
                let elements: Option<&[u32]> = match &target {
                    Target::Label(label) => {
                        single = self.elements.get(*label).map(|e| [e]);
                        single.as_ref().map(|e| &e[..])
                    }
                    Target::Set(set) => element_sets.get(set).map(|set| &set[..]),
                    Target::Range(..) => None,
                };
                let Some(elements) = elements else {
                    let label = matches!(target, Target::Label(_));
                    if !(incomplete.names || label && incomplete.elements) {
                        let got =
                            format!("`{}` in the surface `{name}`", Deck::name_of(&target, None));
                        unknown(
                            &mut faults,
                            &got,
                            "an element or a set of elements",
                            element_sets.keys(),
                        );
                    }
                    continue;
                };
                if !room.take(elements.len() as u64, surface.line, &name, &mut faults) {
                    break;
                }
                for &place in elements {
                    let element = &self.raw.elements[place as usize];
                    let corners = element.family().corners();
                    if side > corners {
                        let label = self.raw.element_labels[place as usize];
                        faults.add(Violation::new(
                            "",
                            Reason::UnknownEdge,
                            format!("side {side} of the triangle {label} in `{name:.60}`"),
                            "sides 1 … 3 of a triangle",
                            "Name the sides of triangles and of quadrilaterals in sets of their own.",
                        ));
                        break;
                    }
                    lines.push([element[side - 1], element[side % corners]]);
                }
            }
            self.raw.lines.entry(name).or_default().extend(lines);
        }
        let named = |sets: BTreeMap<Name, Vec<u32>>| -> BTreeMap<String, Vec<u32>> {
            sets.into_iter()
                .map(|(name, set)| (name.to_string(), set))
                .collect()
        };
        self.raw.groups = named(element_sets);
        self.raw.node_sets = named(node_sets);
        // a node by itself is a set of one
        let single = self.prescribed.iter().map(|row| &row.target);
        for target in single.chain(self.forces.iter().map(|row| &row.target)) {
            match target {
                Target::Label(label) => match self.nodes.get(*label) {
                    Some(node) => {
                        self.raw.node_sets.insert(label.to_string(), vec![node]);
                    }
                    None if incomplete.nodes => {}
                    None => unknown(
                        &mut faults,
                        &format!("node {label}"),
                        "a node of *NODE",
                        self.raw.node_sets.keys(),
                    ),
                },
                Target::Set(name)
                    if !incomplete.names && !self.raw.node_sets.contains_key(&**name) =>
                {
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

    /// The room for the members of all sets and surfaces.
    fn room(&self) -> Room {
        let sets = self.node_sets.values().chain(self.element_sets.values());
        let written: usize = sets.map(|set| set.members.len()).sum();
        let sides: usize = self
            .surfaces
            .values()
            .map(|surface| surface.sides.len())
            .sum();
        let mesh = (self.raw.nodes.len() + self.raw.elements.len()) as u64;
        let most = (1 << 16) + 2 * (written + sides) as u64 + MOST_TIMES * mesh;
        Room { most, left: most }
    }
}

/// How many members of sets may still be visited.
struct Room {
    most: u64,
    left: u64,
}

impl Room {
    /// Takes some of it; reports, once, that there is not enough.
    fn take(&mut self, count: u64, line: u64, name: &str, faults: &mut Findings) -> bool {
        if let Some(left) = self.left.checked_sub(count) {
            self.left = left;
            return true;
        }
        if self.most > 0 {
            faults.add(on_line(
                line,
                Reason::TooMany,
                format!(
                    "all sets and surfaces up to `{name:.60}` have more than {} members",
                    self.most
                ),
                "at most 16 times as many as there are nodes and elements",
                "Write sets that contain sets only where they are used.",
            ));
        }
        (self.most, self.left) = (0, 0);
        false
    }

    fn is_used_up(&self) -> bool {
        self.most == 0
    }
}

/// The numbers of nodes or of elements, and the words for them.
#[derive(Clone, Copy)]
struct Labelled<'a> {
    labels: &'a Labels,
    what: &'static str,
    keyword: &'static str,
    /// A missing one may be on a line that could not be read.
    incomplete: bool,
}

/// Sets as places in the mesh.
fn resolve(
    sets: &BTreeMap<Name, Set>,
    labelled: Labelled<'_>,
    incomplete: Incomplete,
    room: &mut Room,
    faults: &mut Findings,
) -> BTreeMap<Name, Vec<u32>> {
    let Labelled {
        labels,
        what,
        keyword,
        incomplete: numbers,
    } = labelled;
    let mut resolved: BTreeMap<Name, Vec<u32>> = BTreeMap::new();
    for (name, set) in sets {
        let mut found = Vec::new();
        // sets may contain sets; one that contains itself is visited once
        let mut open = vec![set.members.iter()];
        let mut seen = BTreeSet::from([name]);
        while let Some(members) = open.last_mut() {
            let Some(target) = members.next() else {
                open.pop();
                continue;
            };
            if !room.take(1, set.line, name, faults) {
                break;
            }
            // what is missing in a set is reported there, not in all that contain it
            let told = open.len() > 1;
            match target {
                Target::Label(label) => match labels.get(*label) {
                    Some(place) => found.push(place),
                    None if numbers || told => {}
                    None => unknown(
                        faults,
                        &format!("{what} {label} in the set `{name:.60}`"),
                        &format!("a number that a {what} has"),
                        NONE.iter(),
                    ),
                },
                // numbers in between need not exist
                Target::Range(range) => {
                    let [first, last, step] = **range;
                    let (inside, visited) = labels.range(first, last, step, room.left);
                    room.take(visited, set.line, name, faults);
                    if inside.is_empty() && !(numbers || told || room.is_used_up()) {
                        unknown(
                            faults,
                            &format!("{what}s {first} to {last} in the set `{name:.60}`"),
                            &format!("numbers that {what}s have"),
                            NONE.iter(),
                        );
                    }
                    found.extend(inside);
                }
                Target::Set(other) => match sets.get_key_value(other) {
                    Some((key, inner)) => {
                        if seen.insert(key) {
                            open.push(inner.members.iter());
                        }
                    }
                    None if incomplete.names || told => {}
                    None => unknown(
                        faults,
                        &format!("`{other:.60}` in the set `{name:.60}`"),
                        &format!("a {what} or a set (*{keyword})"),
                        sets.keys(),
                    ),
                },
            }
        }
        found.sort_unstable();
        found.dedup();
        found.shrink_to_fit();
        resolved.insert(name.clone(), found);
        if room.is_used_up() {
            break;
        }
    }
    resolved
}

/// No names to list.
const NONE: [&str; 0] = [];

fn unknown<'a, S: AsRef<str> + 'a>(
    faults: &mut Findings,
    got: &str,
    expected: &str,
    known: impl Iterator<Item = &'a S>,
) {
    if faults.is_full() {
        return faults.count(1);
    }
    let names: Vec<String> = known
        .take(20)
        .map(|name| format!("{:.60}", name.as_ref()))
        .collect();
    let hint = match names.is_empty() {
        true => "Correct the number.".to_owned(),
        false => format!("Known names: {}.", names.join(", ")),
    };
    faults.add(Violation::new("", Reason::UnknownName, got, expected, hint));
}

#[cfg(test)]
mod tests {
    use super::super::read;
    use super::*;
    use crate::source::ReadError;

    /// A square and a triangle in one set.
    const MIXED: &str = "*NODE\n1, 0, 0\n2, 1, 0\n3, 1, 1\n4, 0, 1\n5, 2, 0\n\
        *ELEMENT, TYPE=CPE4, ELSET=ALL\n10, 1, 2, 3, 4\n*ELEMENT, TYPE=CPE3, ELSET=ALL\n20, 2, 5, 3\n";

    #[test]
    fn a_fourth_side_of_a_triangle_is_a_violation() {
        let read = |text: &str| read(format!("{MIXED}{text}").as_bytes());
        let (mesh, _) = read("*DLOAD\nALL, P1, 5.\n").unwrap();
        assert_eq!(mesh.boundaries["ALL P1"].len(), 2);
        for (text, name) in [
            ("*DLOAD\nALL, P4, 5.\n", "ALL P4"),
            ("*SURFACE, NAME=LEFT\nALL, S4\n", "LEFT"),
        ] {
            let Err(ReadError::Invalid(list)) = read(text) else {
                panic!("{text} was read");
            };
            let got = format!("side 4 of the triangle 20 in `{name}`");
            assert_eq!((list[0].reason, &list[0].got), (Reason::UnknownEdge, &got));
        }
    }

    fn faults(deck: &str) -> Vec<String> {
        let Err(ReadError::Invalid(list)) = read(deck.as_bytes()) else {
            panic!("it was read");
        };
        list.into_iter().map(|v| v.got).collect()
    }

    #[test]
    fn sets_of_sets_are_read_up_to_a_multiple_of_the_mesh() {
        let nested = |sets: usize, of: usize| {
            let labels: String = (0..of).map(|_| "1, 2, 3, 4, 5\n").collect();
            let sets: String = (0..sets)
                .map(|k| format!("*NSET, NSET=S{k}\nA\n"))
                .collect();
            format!("{MIXED}*NSET, NSET=A\n{labels}{sets}")
        };
        let (mesh, _) = read(nested(100, 10).as_bytes()).unwrap();
        assert_eq!(mesh.node_sets["S99"].len(), 11); // with the midsides between them
        let found = faults(&nested(2000, 2000));
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(
            found[0].starts_with("line ") && found[0].contains("members"),
            "{found:?}"
        );
    }

    #[test]
    fn chains_and_circles_of_sets_are_resolved() {
        let chain: String = (0..200)
            .map(|k| format!("*NSET, NSET=S{k}\nS{}\n", k + 1))
            .collect();
        let deck = format!("{MIXED}{chain}*NSET, NSET=S200\n1, 2, S0\n");
        let (mesh, _) = read(deck.as_bytes()).unwrap();
        assert_eq!(mesh.node_sets["S0"], mesh.node_sets["S200"]);
        assert_eq!(mesh.node_sets["S0"].len(), 3);
    }

    #[test]
    fn a_bad_line_is_one_violation_whatever_needs_it() {
        let good = format!(
            "{MIXED}*NSET, NSET=A\n1, 2\n*SURFACE, NAME=S\nALL, S1\n*DLOAD\n10, P1, 5.\n*BOUNDARY\nA, 1\n2, 2\n"
        );
        assert!(read(good.as_bytes()).is_ok());
        for (sound, bad) in [
            ("2, 1, 0\n", "2, 1, O\n"),
            ("2, 1, 0\n", "two, 1, 0\n"),
            ("10, 1, 2, 3, 4\n", "10, 1, 2, 3, x\n"),
            ("10, 1, 2, 3, 4\n", "10, 1, 2, 3\n"),
            ("TYPE=CPE4", "TYPE=C3D8"),
            ("NSET=A\n", "\n"),
            ("NAME=S\n", "\n"),
            ("*NODE\n", "*INCLUDE, INPUT=nodes.inp\n"),
        ] {
            assert!(good.contains(sound), "{sound}");
            let found = faults(&good.replacen(sound, bad, 1));
            assert_eq!(found.len(), 1, "{bad:?}: {found:?}");
        }
    }

    #[test]
    fn a_long_name_is_refused() {
        let long = "N".repeat(300);
        for deck in [
            format!("{MIXED}*NSET, NSET={long}\n1\n"),
            format!("{MIXED}*NSET, NSET=A\n{long}\n"),
        ] {
            let found = faults(&deck);
            assert_eq!(found.len(), 1);
            assert!(found[0].contains("of 300 bytes"), "{found:?}");
        }
    }
}
