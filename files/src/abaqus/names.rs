//! Resolves the names and numbers of a deck to places in a mesh.

use std::collections::BTreeMap;

use super::deck::{Deck, Target};
use crate::source::Labels;
use solver::error::{Findings, Reason, Violation};
use solver::mesh::RawMesh;

impl Deck {
    /// The name of the target of a load or support, as `into_raw` gives it to the mesh.
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

    /// The mesh with all its names, and its violations.
    pub(super) fn into_raw(mut self) -> (RawMesh, Findings) {
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
                for place in elements {
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
    faults: &mut Findings,
) -> BTreeMap<String, Vec<u32>> {
    let mut resolved: BTreeMap<String, Vec<u32>> = BTreeMap::new();
    for (name, members) in sets {
        let mut found = Vec::new();
        // sets may contain sets; one that contains itself is visited once
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
    faults: &mut Findings,
    got: &str,
    expected: &str,
    known: impl Iterator<Item = &'a String>,
) {
    let names: Vec<&str> = known.take(20).map(|name| &name[..]).collect();
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
}
