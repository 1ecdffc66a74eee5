//! Resolves the names and numbers of a deck to places in a mesh.
//!
//! A part, each instance of it and the assembly have numbers and names of their own. In the assembly and in steps,
//! `INSTANCE.SET` and `INSTANCE.7` refer to an instance; a name alone refers to the assembly, or else to the only
//! instance that has it. In the mesh a set of the assembly is called `SET`, and a set of an instance `INSTANCE.SET`;
//! the latter also `SET` where no other instance and nothing in the assembly has that name.

use std::collections::{BTreeMap, BTreeSet};

use super::deck::Deck;
use super::scope::{Kind, Scope};
use super::written::{Name, Set, Target, on_line};
use solver::error::{Findings, Reason};

/// A set by the place of its scope and its name.
pub(super) type Key = (usize, Name);

/// The set or number that a target refers to.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Meant {
    Set(Key),
    Label(usize, u64),
}

/// The scopes of a deck, the assembly first, and its spelling of names.
pub(super) struct Names<'a> {
    pub(super) deck: &'a Deck,
    pub(super) scopes: &'a [Scope],
}

impl Names<'_> {
    /// The name that a set or surface of a scope gets in the mesh: `instance.name`, or `name` alone.
    pub(super) fn full(&self, scope: usize, name: &str) -> String {
        match &self.scopes[scope].name {
            None => name.to_owned(),
            Some(instance) => format!("{instance}.{name}"),
        }
    }

    /// The name of a target in the mesh.
    pub(super) fn of(&self, meant: &Meant) -> String {
        match meant {
            Meant::Set((scope, name)) => self.full(*scope, name),
            Meant::Label(scope, label) => self.full(*scope, &label.to_string()),
        }
    }

    /// The set or number that a target of a scope refers to.
    pub(super) fn meant(&self, kind: Kind, scope: usize, target: &Target) -> Option<Meant> {
        let has = |scope: usize, label: u64| self.scopes[scope].place(kind, label).is_some();
        match target {
            Target::Range(_) => None,
            Target::Label(label) => {
                let found = self.in_scopes(scope, |scope| has(scope, *label))?;
                Some(Meant::Label(found, *label))
            }
            Target::Set(word) => {
                let sets = |scope: usize| self.scopes[scope].sets(kind);
                if let Some((scope, name)) =
                    self.named(scope, word, |scope, name| sets(scope).contains_key(name))
                {
                    return Some(Meant::Set((scope, name)));
                }
                let (instance, rest) = self.dotted(scope, word)?;
                let label = rest.parse().ok().filter(|label| has(instance, *label))?;
                Some(Meant::Label(instance, label))
            }
        }
    }

    /// Resolves a name that is used in a scope: the scope that it refers to, and the name there. `has`: whether a scope
    /// has something of a name.
    pub(super) fn named(
        &self,
        scope: usize,
        word: &Name,
        has: impl Fn(usize, &Name) -> bool,
    ) -> Option<Key> {
        // a name may contain a dot
        if has(scope, word) {
            return Some((scope, word.clone()));
        }
        if scope == 0
            && let Some(name) = self
                .in_assembly(word)
                .and_then(|rest| self.deck.known(rest))
            && has(scope, name)
        {
            return Some((scope, name.clone()));
        }
        if let Some((instance, rest)) = self.dotted(scope, word) {
            let name = self.deck.known(rest)?;
            return has(instance, name).then(|| (instance, name.clone()));
        }
        // what has this name in the assembly is of another kind: the instance's is not meant
        if scope == 0 && self.scopes[0].defines(word) {
            return None;
        }
        let found = self.in_scopes(scope, |scope| has(scope, word))?;
        Some((found, word.clone()))
    }

    /// The scope `scope` if `has` is true for it; else, if `scope` is the assembly, the only instance for which it is
    /// true.
    fn in_scopes(&self, scope: usize, has: impl Fn(usize) -> bool) -> Option<usize> {
        if has(scope) {
            return Some(scope);
        }
        let instances = if scope == 0 {
            1..self.scopes.len()
        } else {
            0..0
        };
        let mut found = instances.filter(|instance| has(*instance));
        match (found.next(), found.next()) {
            (Some(only), None) => Some(only),
            _ => None,
        }
    }

    /// Divides `INSTANCE.NAME` in the assembly into the scope of the instance and the name there.
    fn dotted<'w>(&self, scope: usize, word: &'w str) -> Option<(usize, &'w str)> {
        if scope != 0 {
            return None;
        }
        let word = self.in_assembly(word).unwrap_or(word);
        // names of instances may contain a dot too
        [word.split_once('.'), word.rsplit_once('.')]
            .into_iter()
            .flatten()
            .find_map(|(start, rest)| Some((self.instance(start)?, rest)))
    }

    /// The rest of `ASSEMBLY.NAME` after the name of the assembly and the dot; none if a word begins differently.
    fn in_assembly<'w>(&self, word: &'w str) -> Option<&'w str> {
        let assembly = self.deck.assembly_name.as_deref()?;
        let (start, rest) = word.split_once('.')?;
        start.eq_ignore_ascii_case(assembly).then_some(rest)
    }

    /// The scope of the instance with this name.
    pub(super) fn instance(&self, name: &str) -> Option<usize> {
        let name = self.deck.known(name)?;
        let named = |scope: &Scope| scope.name.as_ref() == Some(name);
        self.scopes.iter().position(named)
    }

    /// The line where the assembly defines a set.
    pub(super) fn line_in_assembly(&self, name: &str) -> u64 {
        let scope = &self.scopes[0];
        let sets = [&scope.node_sets, &scope.element_sets, &scope.node_surfaces];
        let mut found = sets.iter().filter_map(|sets| sets.get(name));
        found.next().map_or(1, |set| set.line)
    }

    /// The advice for a target that does not exist.
    pub(super) fn remedy(&self, kind: Kind, scope: usize, target: &Target) -> String {
        match target {
            Target::Label(_) => self.scopes[scope].hint_of_numbers(kind),
            _ => kind.remedy().to_owned(),
        }
    }

    /// The existing names, for advice about a target that does not exist; empty if the target is a number.
    pub(super) fn known(&self, kind: Kind, target: &Target) -> Vec<String> {
        match target {
            Target::Label(_) => Vec::new(),
            _ => self.all_sets(kind),
        }
    }

    fn instances(&self) -> Vec<String> {
        let names = self.scopes.iter().filter_map(|scope| scope.name.as_deref());
        names.take(MOST_LISTED).map(str::to_owned).collect()
    }

    pub(super) fn all_sets(&self, kind: Kind) -> Vec<String> {
        let names = (0..self.scopes.len()).flat_map(|scope| {
            let sets = self.scopes[scope].sets(kind).keys();
            sets.map(move |name| self.full(scope, name))
        });
        names.take(MOST_LISTED).collect()
    }

    /// All sets of a kind as places in the mesh. `nodes_of`: adds the nodes of a set of elements to a list; false if
    /// there is no such set.
    pub(super) fn resolve(
        &self,
        kind: Kind,
        nodes_of: impl Fn(&Key, &mut Vec<u32>) -> bool,
        room: &mut Room,
        faults: &mut Findings,
    ) -> BTreeMap<Key, Vec<u32>> {
        let mut resolved = BTreeMap::new();
        for scope in 0..self.scopes.len() {
            for (name, set) in self.scopes[scope].sets(kind) {
                if room.is_used_up() {
                    return resolved;
                }
                let mut members = Members {
                    names: self,
                    kind: kind.named(),
                    name: self.full(scope, name),
                    line: set.line,
                    found: Vec::new(),
                    open: Vec::new(),
                    seen: BTreeSet::from([(scope, name.clone())]),
                    seen_elements: BTreeSet::new(),
                };
                members.open(scope, set, &nodes_of, room, faults);
                members.visit(&nodes_of, room, faults);
                let mut found = members.found;
                found.sort_unstable();
                found.dedup();
                found.shrink_to_fit();
                resolved.insert((scope, name.clone()), found);
            }
        }
        resolved
    }
}

/// The members of a set while they are looked up. Sets may contain sets; a set that contains itself is visited once.
struct Members<'a> {
    names: &'a Names<'a>,
    kind: Kind,
    name: String,
    line: u64,
    found: Vec<u32>,
    /// The sets that are being visited: of each the scope, the members left, and the nesting depth.
    open: Vec<(usize, std::slice::Iter<'a, Target>, usize)>,
    seen: BTreeSet<Key>,
    /// The sets of elements whose nodes were added to the set.
    seen_elements: BTreeSet<Key>,
}

impl<'a> Members<'a> {
    fn open(
        &mut self,
        scope: usize,
        set: &'a Set,
        nodes_of: &impl Fn(&Key, &mut Vec<u32>) -> bool,
        room: &mut Room,
        faults: &mut Findings,
    ) {
        // what is missing in a set is reported there, not in all that contain it
        let depth = self.open.last().map_or(0, |(_, _, depth)| depth + 1);
        for (instance, elements) in &set.of_elements {
            let scope = match instance {
                Some(instance) => self.names.instance(instance),
                None => Some(scope),
            };
            let target = Target::Set(elements.clone());
            let meant = scope.and_then(|scope| self.names.meant(Kind::Elements, scope, &target));
            let known = match meant {
                Some(Meant::Set(key)) if self.seen_elements.contains(&key) => true,
                Some(Meant::Set(key)) => {
                    let before = self.found.len();
                    let known = nodes_of(&key, &mut self.found);
                    let count = (self.found.len() - before) as u64;
                    if !room.take(count, self.line, &self.name, faults) {
                        return;
                    }
                    self.seen_elements.insert(key);
                    known
                }
                _ => false,
            };
            if !known && depth == 0 && !self.names.scopes[0].incomplete.names {
                let got = format!("`{elements:.60}` in the set `{:.60}`", self.name);
                unknown(
                    faults,
                    self.line,
                    &got,
                    "a set of elements (*ELSET)",
                    || self.names.all_sets(Kind::Elements),
                    Kind::Elements.remedy(),
                );
            }
        }
        for (instance, members) in &set.of_instances {
            match self.names.instance(instance) {
                Some(scope) => self.open.push((scope, members.iter(), depth)),
                None if self.names.scopes[0].incomplete.names || depth > 0 => {}
                None => {
                    let got = format!(
                        "the instance `{instance:.60}` of the set `{:.60}`",
                        self.name
                    );
                    unknown(
                        faults,
                        self.line,
                        &got,
                        "the name of an *INSTANCE",
                        || self.names.instances(),
                        "Correct INSTANCE=…, or leave it out where the deck has no *INSTANCE.",
                    );
                }
            }
        }
        self.open.push((scope, set.members.iter(), depth));
    }

    fn visit(
        &mut self,
        nodes_of: &impl Fn(&Key, &mut Vec<u32>) -> bool,
        room: &mut Room,
        faults: &mut Findings,
    ) {
        let (names, kind, what) = (self.names, self.kind, self.kind.what());
        while let Some((scope, members, depth)) = self.open.last_mut() {
            let (scope, told) = (*scope, *depth > 0);
            let Some(target) = members.next() else {
                self.open.pop();
                continue;
            };
            if !room.take(1, self.line, &self.name, faults) {
                break;
            }
            let place = &names.scopes[scope];
            let numbers = place.incomplete_numbers(kind);
            if let Target::Range(range) = target {
                // numbers in between need not exist
                let [first, last, step] = **range;
                let (inside, visited) = place.range(kind, (first, last, step), room.left);
                room.take(visited, self.line, &self.name, faults);
                if inside.is_empty() && !(numbers || told || room.is_used_up()) {
                    let got = format!("{what}s {first} to {last} in the set `{:.60}`", self.name);
                    unknown(
                        faults,
                        self.line,
                        &got,
                        &format!("a range that contains numbers of {what}s"),
                        Vec::new,
                        &place.hint_of_numbers(kind),
                    );
                }
                self.found.extend(inside);
                continue;
            }
            match (target, names.meant(kind, scope, target)) {
                (_, Some(Meant::Label(scope, label))) => {
                    self.found.extend(names.scopes[scope].place(kind, label));
                }
                (_, Some(Meant::Set(key))) => {
                    let inner = names.scopes[key.0].sets(kind).get(&key.1);
                    let scope = key.0;
                    if let (Some(inner), true) = (inner, self.seen.insert(key)) {
                        self.open(scope, inner, nodes_of, room, faults);
                    }
                }
                (_, None) if told => {}
                (Target::Set(_), None)
                    if place.incomplete.names || names.scopes[0].incomplete.names => {}
                (Target::Set(other), None) => unknown(
                    faults,
                    self.line,
                    &format!("`{other:.60}` in the set `{:.60}`", self.name),
                    &format!("{} or a set (*{})", kind.one(), kind.keyword()),
                    || names.all_sets(kind),
                    kind.remedy(),
                ),
                (Target::Label(label), None) if !numbers => {
                    let got = format!("{what} {label} in the set `{:.60}`", self.name);
                    unknown(
                        faults,
                        self.line,
                        &got,
                        &format!("the number of {}", kind.one()),
                        Vec::new,
                        &place.hint_of_numbers(kind),
                    );
                }
                _ => {}
            }
        }
    }
}

/// How many members of sets may still be visited: sets that contain sets would otherwise take too long.
pub(super) struct Room {
    most: u64,
    left: u64,
}

impl Room {
    pub(super) fn new(most: u64) -> Self {
        Room { most, left: most }
    }

    /// Takes `count` members from the room; false if there is not enough, which is reported once.
    pub(super) fn take(
        &mut self,
        count: u64,
        line: u64,
        name: &str,
        faults: &mut Findings,
    ) -> bool {
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

    pub(super) fn is_used_up(&self) -> bool {
        self.most == 0
    }
}

/// The largest number of names that a hint lists.
const MOST_LISTED: usize = 20;

/// Reports an unknown name or number. `known`: the existing names; `remedy`: advice that follows them.
pub(super) fn unknown(
    faults: &mut Findings,
    line: u64,
    got: &str,
    expected: &str,
    known: impl FnOnce() -> Vec<String>,
    remedy: &str,
) {
    if faults.is_full() {
        return faults.count(1);
    }
    let names: Vec<String> = known()
        .iter()
        .take(MOST_LISTED)
        .map(|name| format!("{name:.60}"))
        .collect();
    let hint = if names.is_empty() {
        remedy.to_owned()
    } else {
        format!("Known names: {}. {remedy}", names.join(", "))
    };
    faults.add(on_line(
        line,
        Reason::UnknownName,
        got.to_owned(),
        expected,
        &hint,
    ));
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
        for (text, name, line) in [
            ("*DLOAD\nALL, P4, 5.\n", "ALL P4", 12),
            ("*SURFACE, NAME=LEFT\nALL, S4\n", "LEFT", 11),
        ] {
            let Err(ReadError::Invalid(list)) = read(text) else {
                panic!("{text} was read");
            };
            let got = format!("line {line}: side 4 of the triangle 20 in `{name}`");
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
