//! The code holds to ARCHITECTURE.md: its floors, its invariants that can be read from what a file names, and no
//! circles in any folder. Files that it, CONTRIBUTING.md, SECURITY.md and the maps of the rooms name exist.
//!
//! What stands under `#[cfg(test)]` is free. A `mod.rs` that declares its children and shows what is theirs
//! (`pub use child::Thing`) does not use them; whoever imports `super::Thing` then uses the child. A `mod.rs` with code
//! that names a child does use it, and a child that names what `mod.rs` itself defines closes a circle.
#![allow(clippy::unwrap_used, clippy::panic)]

mod circles;
mod floors;
mod made_up;
mod maps;
mod rules;
mod syntax;
mod tokens;
mod tree;

use std::{collections::BTreeSet, fs, path::Path};

use floors::Floors;
use tree::{Sources, Tree};

/// Folders of the crates; each has the name of its library.
const CRATES: [&str; 9] = [
    "server/cli",
    "server/app",
    "server/web",
    "server/rpc",
    "server/service",
    "server/store",
    "server/base",
    "files",
    "solver",
];

#[test]
fn the_code_keeps_to_its_floors_and_goes_in_no_circle() {
    let top = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut sources = Sources::new();
    for folder in CRATES {
        read(&top, &format!("{folder}/src"), &mut sources);
    }
    assert!(sources.len() > 100, "{} files", sources.len());
    let tree = Tree::read(&sources, &CRATES);
    let page = fs::read_to_string(top.join("ARCHITECTURE.md")).unwrap();
    let floors = Floors::read(&page).unwrap_or_else(|error| panic!("{error}"));
    let broken = rules::broken(&tree, &floors);
    assert!(broken.is_empty(), "\n{}\n", broken.join("\n"));
}

#[test]
fn maps_and_pages_name_files_that_exist() {
    let top = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let exists = |path: &str| top.join(path).exists();
    let mut sources = Sources::new();
    for folder in CRATES {
        read(&top, &format!("{folder}/src"), &mut sources);
    }
    let maps = sources
        .iter()
        .filter(|(_, text)| text.contains("//! # Where to look"));
    assert!(maps.clone().count() > 10, "{} maps", maps.count());
    let mut wrong: Vec<String> = maps
        .flat_map(|(file, text)| maps::astray(file, text, &exists))
        .collect();
    let entries = fs::read_dir(&top).unwrap();
    let mut names: BTreeSet<String> = entries
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.remove("target"); // what a build has made need not be there
    for page in ["ARCHITECTURE.md", "CONTRIBUTING.md", "SECURITY.md"] {
        let text = fs::read_to_string(top.join(page)).unwrap();
        wrong.extend(maps::dead_paths(page, &text, &names, &exists));
    }
    assert!(wrong.is_empty(), "\n{}\n", wrong.join("\n"));
}

fn read(top: &Path, folder: &str, sources: &mut Sources) {
    for entry in fs::read_dir(top.join(folder)).unwrap() {
        let entry = entry.unwrap();
        let path = format!("{folder}/{}", entry.file_name().to_str().unwrap());
        if entry.file_type().unwrap().is_dir() {
            read(top, &path, sources);
        } else if path.ends_with(".rs") {
            sources.insert(path, fs::read_to_string(entry.path()).unwrap());
        }
    }
}
