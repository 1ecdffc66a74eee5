//! Files that no program wrote: real ones with bytes, numbers and lines changed, and noise. Readers and
//! problem parser may refuse them, in words; they may not panic, and not take memory or time out of all
//! proportion to the file. A process of its own, so that its memory is its own; the cases are the same in
//! every run.
#![allow(clippy::unwrap_used, clippy::panic)]

use std::path::Path;

use files::{ReadError, abaqus, read_mesh};
use proptest::prelude::*;
use proptest::sample::Index;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};

/// What a number becomes.
const EXTREMES: [&str; 13] = [
    "0",
    "-1",
    "1",
    "2",
    "65536",
    "4294967295",
    "4294967296",
    "18446744073709551615",
    "-9223372036854775808",
    "1e308",
    "-1e-320",
    "nan",
    "inf",
];

/// Words that mean something to a reader.
const WORDS: [&str; 16] = [
    "$Nodes\n",
    "$EndNodes\n",
    "$Elements\n",
    "$Entities\n",
    "$PhysicalNames\n1\n1 1 \"top\"\n",
    "$Periodic\n",
    "*NODE\n",
    "*ELEMENT, TYPE=CPE8\n",
    "*NSET, NSET=a, GENERATE\n1, 18446744073709551615, 1\n",
    "*NSET, NSET=a\na\n",
    "*ELSET, ELSET=e\ne, e\n",
    "*SURFACE, NAME=s\n1, S4\n",
    "*STEP\n",
    "{",
    "]",
    "\"\\u0000\"",
];

/// One change of a file.
#[derive(Clone, Debug)]
enum Change {
    Byte(Index, u8),
    Remove(Index, usize),
    Repeat(Index, usize),
    Number(Index, usize),
    Insert(Index, usize),
    Cut(Index),
}

fn change() -> impl Strategy<Value = Change> {
    let at = any::<Index>;
    prop_oneof![
        2 => (at(), any::<u8>()).prop_map(|(i, b)| Change::Byte(i, b)),
        1 => (at(), 1..200usize).prop_map(|(i, n)| Change::Remove(i, n)),
        1 => (at(), 1..200usize).prop_map(|(i, n)| Change::Repeat(i, n)),
        4 => (at(), 0..EXTREMES.len()).prop_map(|(i, k)| Change::Number(i, k)),
        1 => (at(), 0..WORDS.len()).prop_map(|(i, k)| Change::Insert(i, k)),
        1 => at().prop_map(Change::Cut),
    ]
}

fn apply(file: &mut Vec<u8>, change: &Change) {
    if file.is_empty() {
        return;
    }
    let size = file.len();
    match change {
        Change::Byte(at, byte) => file[at.index(size)] = *byte,
        Change::Remove(at, count) => {
            let at = at.index(size);
            file.drain(at..size.min(at + count));
        }
        Change::Repeat(at, count) => {
            let at = at.index(size);
            let part = file[at..size.min(at + count)].to_vec();
            file.splice(at..at, part);
        }
        Change::Number(at, which) => {
            // the next number from there on
            let at = at.index(size);
            let digit = |b: &u8| b.is_ascii_digit();
            let Some(start) = file[at..].iter().position(digit).map(|k| at + k) else {
                return;
            };
            let end = file[start..]
                .iter()
                .position(|b| !digit(b))
                .map_or(size, |k| start + k);
            file.splice(start..end, EXTREMES[*which].bytes());
        }
        Change::Insert(at, which) => {
            let at = at.index(size);
            file.splice(at..at, WORDS[*which].bytes());
        }
        Change::Cut(at) => file.truncate(at.index(size)),
    }
}

/// Real files of a folder.
fn files(folder: &str, ending: &str) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
    let mut paths: Vec<_> = std::fs::read_dir(&folder)
        .unwrap_or_else(|error| panic!("{}: {error}", folder.display()))
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == ending))
        .collect();
    paths.sort();
    assert!(!paths.is_empty(), "no .{ending} in {}", folder.display());
    // a large one would take the time of many small ones
    paths
        .into_iter()
        .map(|path| std::fs::read(path).unwrap())
        .filter(|file| file.len() < 50_000)
        .collect()
}

fn memory(name: &str) -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find(|line| line.starts_with(name)).unwrap();
    line.split_whitespace()
        .nth(1)
        .unwrap()
        .parse::<u64>()
        .unwrap()
        << 10
}

/// Changes files one to five times and gives them to `read`, which says whether they were taken.
fn attack(files: &[Vec<u8>], cases: u32, read: impl Fn(&[u8]) -> bool) {
    let config = Config {
        cases,
        failure_persistence: None,
        ..Config::default()
    };
    let rng = TestRng::deterministic_rng(RngAlgorithm::ChaCha);
    let mut runner = TestRunner::new_with_rng(config, rng);
    let (taken, refused) = (std::cell::Cell::new(0), std::cell::Cell::new(0));
    let strategy = (any::<Index>(), prop::collection::vec(change(), 1..6));
    let before = memory("VmHWM");
    let ran = runner.run(&strategy, |(which, changes)| {
        let mut file = files[which.index(files.len())].clone();
        changes.iter().for_each(|change| apply(&mut file, change));
        let count = if read(&file) { &taken } else { &refused };
        count.set(count.get() + 1);
        Ok(())
    });
    ran.unwrap_or_else(|failure| panic!("{failure}"));
    // both ends of the readers were reached
    assert!(
        taken.get() > 0 && refused.get() > cases / 10,
        "{taken:?} taken, {refused:?} refused"
    );
    // the largest file has 50 kB; the tests run side by side
    let grown = memory("VmHWM") - before;
    assert!(grown < 64 << 20, "grown by {} MiB", grown >> 20);
}

fn read(file: &[u8]) -> bool {
    match read_mesh(file) {
        Ok((_, mesh, _)) => {
            assert!(!mesh.elements.is_empty());
            let nodes = mesh.nodes.len() as u32;
            assert!(mesh.elements.iter().all(|e| e.iter().all(|n| *n < nodes)));
            assert!(
                mesh.boundaries
                    .values()
                    .flatten()
                    .flatten()
                    .all(|n| *n < nodes)
            );
            assert!(mesh.node_sets.values().flatten().all(|n| *n < nodes));
            assert!(mesh.nodes.iter().flatten().all(|x| x.is_finite()));
            true
        }
        Err(ReadError::Invalid(violations)) => {
            assert!(!violations.is_empty());
            assert!(
                violations
                    .iter()
                    .all(|v| !v.got.is_empty() && v.got.len() < 2000 && !v.hint.is_empty())
            );
            false
        }
        Err(ReadError::Io(error)) => panic!("a text in memory cannot be read: {error}"),
    }
}

#[test]
fn changed_gmsh_files_are_read_or_refused() {
    attack(&files("data/gmsh", "msh"), 60_000, read);
}

#[test]
fn changed_decks_are_read_or_refused() {
    attack(&files("data/abaqus", "inp"), 40_000, read);
    attack(
        &files("data/abaqus", "inp"),
        4000,
        |file| match std::str::from_utf8(file) {
            Ok(text) => abaqus::problem(text).is_ok(),
            Err(_) => false,
        },
    );
}

/// The whole way of a submitted problem up to the first assembly: parsed and checked.
#[test]
fn changed_problems_are_checked_or_refused() {
    let problems = files("../examples", "json");
    attack(&problems, 40_000, |file| {
        let Ok(text) = std::str::from_utf8(file) else {
            return false;
        };
        match files::parse(text) {
            // what would be refused for its size is not meshed
            Ok(problem) => {
                !solver::estimate(&problem, None).is_ok_and(|told| told.memory_bytes <= 16 << 20)
                    || solver::check(&problem, files::external_mesh(&problem, None)).is_ok()
            }
            Err(violations) => {
                assert!(!violations.is_empty());
                false
            }
        }
    });
}

#[test]
fn noise_is_refused() {
    let config = Config {
        cases: 2000,
        failure_persistence: None,
        ..Config::default()
    };
    let rng = TestRng::deterministic_rng(RngAlgorithm::ChaCha);
    let noise = prop::collection::vec(any::<u8>(), 0..2000);
    let starts = prop::sample::select(vec![
        "",
        "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n",
        "$MeshFormat\n4.1 1 8\n\u{1}\0\0\0\n$EndMeshFormat\n$Nodes\n",
        "*NODE\n",
        "{",
    ]);
    TestRunner::new_with_rng(config, rng)
        .run(&(starts, noise), |(start, noise)| {
            let file = [start.as_bytes(), &noise].concat();
            assert!(!read(&file));
            let _ = files::parse(&String::from_utf8_lossy(&file));
            Ok(())
        })
        .unwrap_or_else(|failure| panic!("{failure}"));
}
