//! What is held against the page and the sources.

use std::collections::{BTreeMap, BTreeSet};

use super::{
    circles::circles,
    floors::Floors,
    tree::{Place, Tree, Use},
};

/// A crate or module that only some may name: invariants 1 to 4 of ARCHITECTURE.md.
struct Reserved {
    /// What nobody else may name.
    path: &'static str,
    /// Who may, by the beginning of the file's path; in all crates, or in those of `within`.
    only: &'static [&'static str],
    within: &'static str,
}

#[rustfmt::skip]
const RESERVED: &[Reserved] = &[
    Reserved { path: "faer",        within: "",       only: &["solver/src/linear/"] },
    Reserved { path: "rusqlite",    within: "",       only: &["server/store/src/"] },
    Reserved { path: "std::time",   within: "solver/", only: &[] },
    Reserved { path: "std::thread", within: "solver/", only: &["solver/src/linear/parallel.rs"] },
    Reserved { path: "std::fs",     within: "solver/", only: &[] },
    Reserved { path: "std::net",    within: "solver/", only: &[] },
    Reserved { path: "std::env",    within: "solver/", only: &[] },
    Reserved { path: "std::fs",     within: "files/src/", only: &[] },
    Reserved { path: "std::net",    within: "files/src/", only: &[] },
    Reserved { path: "std::time",   within: "files/src/", only: &[] },
    Reserved { path: "crate::mesh",     within: "solver/src/friction/",   only: &[] },
    Reserved { path: "crate::contact",  within: "solver/src/elasticity/", only: &[] },
    Reserved { path: "crate::friction", within: "solver/src/elasticity/", only: &[] },
    Reserved { path: "crate::pb",   within: "",       only: &["server/rpc/src/", "server/cli/src/demo.rs"] },
];

/// Everything that is wrong, sorted.
pub(crate) fn broken(tree: &Tree, floors: &Floors) -> Vec<String> {
    let uses = tree.uses();
    let mut found = unknown_rooms(tree, floors);
    found.extend(upward(&uses, floors));
    found.extend(uses.iter().flat_map(reserved));
    found.extend(circular(&uses, tree));
    found.sort();
    found.dedup();
    found
}

/// Rooms that only the code has, or only the page.
fn unknown_rooms(tree: &Tree, floors: &Floors) -> Vec<String> {
    let mut found = Vec::new();
    for krate in floors.crates() {
        let (mut built, drawn) = (tree.rooms(krate), floors.rooms(krate));
        if floors.is_one_room(krate) {
            built.retain(|room| drawn.contains(room));
        }
        let missing = built.difference(&drawn);
        found.extend(
            missing.map(|room| format!("ARCHITECTURE.md: `{room}` of `{krate}` is missing")),
        );
        let gone = drawn.difference(&built);
        found.extend(gone.map(|room| format!("ARCHITECTURE.md: `{krate}` has no `{room}`")));
    }
    found
}

/// A room uses only rooms on lower floors, be it that a path leads through them or ends there. Every file is told
/// once for each room.
fn upward(uses: &[Use], floors: &Floors) -> Vec<String> {
    let mut found: BTreeMap<(&str, String), &Use> = BTreeMap::new();
    for used in uses {
        let from = &used.from;
        let from_room = room(from, floors);
        let own = floors.of(&from.krate, from_room);
        for to in &used.through {
            let to_room = room(to, floors);
            let inside = (&to.krate, to_room) == (&from.krate, from_room);
            // who has no floor has been named already
            if let (false, Some(own), Some(to_floor)) = (inside, own, floors.of(&to.krate, to_room))
                && to_floor <= own
            {
                let wrong = found
                    .entry((&used.file, name_of(to, floors)))
                    .or_insert(used);
                if used.line < wrong.line {
                    *wrong = used;
                }
            }
        }
    }
    let lines = found.into_iter().map(|((file, to), used)| {
        let Use {
            line,
            written,
            from,
            ..
        } = used;
        format!(
            "{file}:{line}: `{written}` leads from {} to {to}, which is no lower floor",
            name_of(from, floors)
        )
    });
    lines.collect()
}

/// The room of a module as the page draws it.
fn room<'a>(place: &'a Place, floors: &Floors) -> &'a str {
    match place.room() {
        "main" => "main",
        _ if floors.is_one_room(&place.krate) => "lib",
        room => room,
    }
}

fn name_of(place: &Place, floors: &Floors) -> String {
    format!("`{}` of `{}`", room(place, floors), place.krate)
}

/// What only some may name.
fn reserved(used: &Use) -> Vec<String> {
    let foreign = used.foreign.iter().map(|path| path.join("::"));
    let ours = used.through.last().map(|place| {
        let mut path = vec!["crate"];
        path.extend(place.path.iter().map(String::as_str));
        path.join("::")
    });
    let named: Vec<String> = foreign.chain(ours).collect();
    let broken = RESERVED.iter().filter(|rule| {
        let names = |path: &String| {
            path.split("::")
                .take(rule.path.split("::").count())
                .eq(rule.path.split("::"))
        };
        named.iter().any(names)
            && used.file.starts_with(rule.within)
            && !rule.only.iter().any(|start| used.file.starts_with(start))
    });
    broken
        .map(|rule| {
            let whose = match rule.only {
                [] => format!("nobody in {}", rule.within),
                only => only.join(", "),
            };
            format!(
                "{}:{}: `{}` is for {whose} alone",
                used.file, used.line, rule.path
            )
        })
        .collect()
}

/// In any folder, files (and folders in it) that use one another in a circle.
fn circular(uses: &[Use], tree: &Tree) -> Vec<String> {
    // by folder, who uses whom, and where
    let mut folders: BTreeMap<Place, BTreeMap<(String, String), &Use>> = BTreeMap::new();
    for used in uses {
        let Some(to) = used.through.last() else {
            continue;
        };
        let (from, to) = (tree.owner(&used.from), tree.owner(to));
        if to.krate != from.krate || to == from {
            continue;
        }
        let shared = from.path.iter().zip(&to.path).take_while(|(a, b)| a == b);
        let shared = shared.count();
        let name = |place: &Place| {
            let here = || "mod.rs".to_owned();
            place.path.get(shared).cloned().unwrap_or_else(here)
        };
        let folder = Place {
            krate: from.krate.clone(),
            path: from.path[..shared].to_vec(),
        };
        let between = (name(&from), name(&to));
        folders
            .entry(folder)
            .or_default()
            .entry(between)
            .or_insert(used);
    }
    let mut found = Vec::new();
    for (folder, between) in folders {
        let edges: BTreeSet<_> = between.keys().cloned().collect();
        for circle in circles(&edges) {
            let inside = |name: &String| circle.contains(name);
            let steps = between.iter().filter(|((a, b), _)| inside(a) && inside(b));
            let steps: Vec<_> = steps
                .map(|((a, b), used)| {
                    format!(
                        "\n    {}:{}: {a} uses {b} (`{}`)",
                        used.file, used.line, used.written
                    )
                })
                .collect();
            let place = [&[tree.sources(&folder.krate)], &folder.path[..]].concat();
            found.push(format!(
                "{}/: a circle of {}{}",
                place.join("/"),
                circle.join(", "),
                steps.concat()
            ));
        }
    }
    found
}
