//! The rules themselves, on crates of a few lines.

use super::{
    floors::Floors,
    rules,
    tree::{Sources, Tree},
};

const PAGE: &str = "
## Rooms and directions
```
service  main           starts
         lib            nothing
         high           on top
         pb             generated

store    lib            one room

solver   lib            nothing
         top            on top
         linear left    side by side
         low            below
```
";

/// Three sound crates in which some files are others.
fn broken(changes: &[(&str, &str)]) -> Vec<String> {
    let sound = [
        (
            "server/service/src/main.rs",
            "fn main() { service::high::go() }",
        ),
        (
            "server/service/src/lib.rs",
            "pub mod high; pub mod pb { pub struct Job; }",
        ),
        (
            "server/service/src/high.rs",
            "pub fn go() { store::look() }",
        ),
        (
            "server/store/src/lib.rs",
            "mod rows; mod list; pub use list::{look, List}; #[cfg(test)] use service::high;",
        ),
        (
            "server/store/src/rows.rs",
            "use solver::top::Top; use rusqlite::Row;",
        ),
        (
            "server/store/src/list.rs",
            "pub struct List; pub fn look() { super::rows::x() }",
        ),
        (
            "solver/src/lib.rs",
            "pub mod top; pub mod linear; mod left; mod low; pub use low::Low;",
        ),
        (
            "solver/src/top.rs",
            "use crate::left::{self, Left}; pub struct Top;",
        ),
        (
            "solver/src/left.rs",
            "pub struct Left; use crate::low::Low;",
        ),
        (
            "solver/src/linear/mod.rs",
            "use faer::Mat; use std::{fmt, iter};",
        ),
        (
            "solver/src/low.rs",
            "pub struct Low; #[cfg(test)] mod tests { use crate::top::Top; }",
        ),
    ];
    let sources = sound.iter().chain(changes);
    let sources: Sources = sources
        .map(|(file, text)| (file.to_string(), text.to_string()))
        .collect();
    let tree = Tree::read(&sources, &["server/service", "server/store", "solver"]);
    rules::broken(&tree, &Floors::read(PAGE).unwrap())
}

#[test]
fn a_sound_tree_has_no_faults() {
    assert_eq!(broken(&[]), [""; 0]);
}

#[test]
fn an_import_upward_or_sideways_is_found_with_its_line() {
    let found = broken(&[(
        "solver/src/low.rs",
        "pub struct Low;\nuse crate::{\n  top::Top};",
    )]);
    assert_eq!(found.len(), 2, "{found:?}");
    assert!(
        found[0].starts_with("solver/src/: a circle of left, low, top"),
        "{found:?}"
    );
    assert_eq!(
        found[1],
        "solver/src/low.rs:3: `crate::top::Top` leads from `low` of `solver` to `top` of `solver`, which is no lower floor"
    );
    for text in [
        "fn f() { crate::linear::g() }",
        "use super::linear as l;",
        "use super::*; fn f() { linear::g() }",
    ] {
        let found = broken(&[("solver/src/left.rs", text)]);
        assert_eq!(
            found.len(),
            1 + usize::from(text.contains('*')),
            "{text}: {found:?}"
        );
        assert!(found[0].starts_with("solver/src/left.rs:1: "), "{found:?}");
    }
}

#[test]
fn a_higher_crate_cannot_be_used_even_by_a_path_in_code() {
    let found = broken(&[(
        "solver/src/low.rs",
        "pub struct Low; fn f() { store::look() }",
    )]);
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(
        found[0].contains("from `low` of `solver` to `lib` of `store`"),
        "{found:?}"
    );
}

#[test]
fn a_crate_that_is_one_room_uses_none_above_it_and_a_name_after_two_colons_is_a_crate() {
    let found = broken(&[("server/store/src/rows.rs", "use service::high::go;")]);
    assert_eq!(
        found,
        [
            "server/store/src/rows.rs:1: `service::high::go` leads from `lib` of `store` to `high` of `service`, which is no lower floor"
        ]
    );
    let own = (
        "server/store/src/lib.rs",
        "mod service; mod rows; mod list; pub use list::{look, List};",
    );
    let found = broken(&[
        own,
        ("server/store/src/service.rs", "use ::service::high::go;"),
    ]);
    assert_eq!(found.len(), 1, "{found:?}");
}

#[test]
fn a_circle_of_files_is_found_even_by_what_their_folder_shows() {
    let found = broken(&[("server/store/src/rows.rs", "use super::List;")]);
    assert_eq!(found.len(), 1, "{found:?}");
    let expected = [
        "server/store/src/: a circle of list, rows",
        "    server/store/src/list.rs:1: list uses rows (`super::rows::x`)",
        "    server/store/src/rows.rs:1: rows uses list (`super::List`)",
    ];
    assert_eq!(found[0].lines().collect::<Vec<_>>(), expected);
}

#[test]
fn a_front_door_with_code_of_its_own_is_a_file_like_others() {
    let door = "mod rows; mod list; pub use list::{look, List}; pub struct Door(rows::Row);";
    assert_eq!(broken(&[("server/store/src/lib.rs", door)]), [""; 0]);
    let child = ("server/store/src/rows.rs", "use super::Door;");
    let found = broken(&[("server/store/src/lib.rs", door), child]);
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(
        found[0].starts_with("server/store/src/: a circle of mod.rs, rows"),
        "{found:?}"
    );
    // what it shows and also works with, it uses
    let door = "mod rows; mod list; pub use rows::Row; pub struct Door(Row); pub use list::look;";
    let found = broken(&[("server/store/src/lib.rs", door), child]);
    assert!(
        found[0].starts_with("server/store/src/: a circle of mod.rs, rows"),
        "{found:?}"
    );
}

#[test]
fn names_of_one_owner_are_not_visible_to_others() {
    for (file, text, rule) in [
        (
            "solver/src/top.rs",
            "use faer::Mat;",
            "`faer` is for solver/src/linear/ alone",
        ),
        (
            "server/service/src/high.rs",
            "fn f() { rusqlite::params() }",
            "`rusqlite` is for server/store/src/ alone",
        ),
        (
            "solver/src/low.rs",
            "use std::{fmt, time::Instant};",
            "`std::time` is for nobody in solver/ alone",
        ),
        (
            "solver/src/low.rs",
            "use std::thread as t;",
            "`std::thread` is for solver/src/linear/parallel.rs alone",
        ),
        (
            "server/service/src/high.rs",
            "use crate::pb::Job;",
            "`crate::pb` is for server/rpc/src/",
        ),
    ] {
        let found = broken(&[(file, text)]);
        assert_eq!(found.len(), 1, "{text}: {found:?}");
        assert!(
            found[0].starts_with(&format!("{file}:1: {rule}")),
            "{found:?}"
        );
    }
}

#[test]
fn rooms_that_only_the_page_or_only_the_code_has_are_found() {
    let found = broken(&[
        (
            "solver/src/lib.rs",
            "pub mod top; pub mod linear; mod left; mod new; pub struct Low;",
        ),
        ("solver/src/left.rs", ""),
        ("solver/src/new.rs", ""),
    ]);
    assert_eq!(
        found,
        [
            "ARCHITECTURE.md: `new` of `solver` is missing",
            "ARCHITECTURE.md: `solver` has no `low`"
        ]
    );
}

#[test]
fn a_macro_that_is_called_by_its_bare_name_counts() {
    let found = broken(&[
        (
            "solver/src/top.rs",
            "macro_rules! most { () => {} } use crate::left::Left;",
        ),
        ("solver/src/low.rs", "pub struct Low; most!();"),
    ]);
    assert_eq!(found.len(), 2, "{found:?}");
    assert!(
        found[1].contains("`crate::top::most` leads from `low`"),
        "{found:?}"
    );
}
