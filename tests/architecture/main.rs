//! The code holds to ARCHITECTURE.md: its floors, its invariants that can be read from what a file names, and no
//! circles in any folder.
//!
//! What stands under `#[cfg(test)]` is free. A `mod.rs` that declares its children and shows what is theirs
//! (`pub use child::Thing`) does not use them; whoever imports `super::Thing` then uses the child. A `mod.rs` with code
//! that names a child does use it, and a child that names what `mod.rs` itself defines closes a circle.
#![allow(clippy::unwrap_used, clippy::panic)]

mod circles;
mod floors;
mod made_up;
mod rules;
mod syntax;
mod tokens;
mod tree;

use std::{fs, path::Path};

use floors::Floors;
use tree::{Sources, Tree};

/// Folders of the crates, and the names of their libraries.
const CRATES: [(&str, &str); 3] = [
    ("server", "service"),
    ("files", "files"),
    ("solver", "solver"),
];

#[test]
fn the_code_keeps_to_its_floors_and_goes_in_no_circle() {
    let top = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut sources = Sources::new();
    for (folder, _) in CRATES {
        read(&top, &format!("{folder}/src"), &mut sources);
    }
    assert!(sources.len() > 100, "{} files", sources.len());
    let tree = Tree::read(&sources, &CRATES);
    let page = fs::read_to_string(top.join("ARCHITECTURE.md")).unwrap();
    let floors = Floors::read(&page).unwrap_or_else(|error| panic!("{error}"));
    let broken = rules::broken(&tree, &floors);
    assert!(broken.is_empty(), "\n{}\n", broken.join("\n"));
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
