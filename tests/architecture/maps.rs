//! The maps of the rooms, `# Where to look` in the documentation of a `mod.rs` or `lib.rs`, and the paths that pages name.

use std::collections::BTreeSet;

/// The places that a map leads to and that do not exist, as `FILE:LINE: …`.
///
/// Every name in backquotes in the last column of the table is a place: a file (with or without `.rs`) or a folder, as seen
/// from the folder of `file` or from the top. `exists` knows files and folders by their paths from the top.
pub(crate) fn astray(file: &str, text: &str, exists: &dyn Fn(&str) -> bool) -> Vec<String> {
    let folder = file.rsplit_once('/').map_or("", |(folder, _)| folder);
    let lines = text.lines().enumerate();
    let map = lines
        .skip_while(|(_, line)| *line != "//! # Where to look")
        .take_while(|(_, line)| line.starts_with("//!"));
    let rows = map.filter_map(|(at, line)| {
        let row = line.strip_prefix("//! |")?.trim_end_matches('|');
        Some((at, row.rsplit('|').next()?))
    });
    let places = rows.flat_map(|(at, column)| quoted(column).map(move |place| (at, place)));
    places
        .filter(|(_, place)| {
            !["", ".rs"]
                .iter()
                .any(|end| exists(&format!("{folder}/{place}{end}")) || exists(place))
        })
        .map(|(at, place)| format!("{file}:{}: there is no `{place}`", at + 1))
        .collect()
}

/// The paths that a page names and that do not exist, as `PAGE:LINE: …`.
///
/// A path is a word in backquotes that begins with the name of a folder at the top and a slash.
pub(crate) fn dead_paths(
    page: &str,
    text: &str,
    top: &BTreeSet<String>,
    exists: &dyn Fn(&str) -> bool,
) -> Vec<String> {
    let words = text.lines().enumerate().flat_map(|(at, line)| {
        let words = quoted(line).flat_map(str::split_whitespace);
        words.map(move |word| (at, word.trim_end_matches('/')))
    });
    let paths = words.filter(|(_, word)| {
        word.split_once('/')
            .is_some_and(|(first, _)| top.contains(first))
    });
    paths
        .filter(|(_, path)| !path.contains(['*', '{', '<']) && !exists(path))
        .map(|(at, path)| format!("{page}:{}: there is no `{path}`", at + 1))
        .collect()
}

/// What stands in backquotes in a line.
fn quoted(line: &str) -> impl Iterator<Item = &str> {
    line.split('`').skip(1).step_by(2)
}

#[test]
fn a_map_that_leads_nowhere_is_found_with_its_line() {
    let there = [
        "server/store/src/list.rs",
        "server/store/src/tests",
        "migrations",
    ];
    let exists = |path: &str| there.contains(&path);
    let map = "//! The store.
//!
//! `anything` before the map is free.
//!
//! # Where to look
//!
//! | subject | where |
//! |---|---|
//! | lists of `jobs` | `list`, `list.rs` |
//! | tests | `tests`; `migrations` |
//! | gone | `lost` |

mod list;
";
    assert_eq!(
        astray("server/store/src/lib.rs", map, &exists),
        ["server/store/src/lib.rs:11: there is no `lost`"]
    );
}

#[test]
fn a_dead_path_on_a_page_is_found_with_its_line() {
    let top = BTreeSet::from(["tests".to_owned()]);
    let exists = |path: &str| path == "tests/run";
    let page =
        "`tests/run --all` and `tests/run/`, `GET /v1/jobs`, `a/b`, `tests/*.py`\n`tests/ran`";
    assert_eq!(
        dead_paths("PAGE.md", page, &top, &exists),
        ["PAGE.md:2: there is no `tests/ran`"]
    );
}
