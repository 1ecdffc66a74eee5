//! Files that no program wrote: real ones changed in every way, and noise. Readers, problem parser and decoder of stored
//! fields may refuse them, in words; they may not panic, and not take memory or time out of all proportion to the file. A process of
//! its own, so that its memory is its own; the cases are the same in every run. A longer one: see `suite::fuzzing`.
#![allow(clippy::unwrap_used, clippy::panic)]

mod columns;

use std::path::Path;

use files::{ReadError, abaqus, read_mesh};
use solver::error::Violation;
use suite::fuzzing::{Figures, Target};

#[global_allocator]
static COUNTING: allocator::Counting = allocator::Counting;

/// Words that mean something to a reader of meshes.
const MESHES: [&str; 24] = [
    "$Nodes\n",
    "$EndNodes\n",
    "$Elements\n",
    "$Entities\n",
    "$PhysicalNames\n1\n1 1 \"top\"\n",
    "$Periodic\n",
    "$PartitionedEntities\n",
    "$EndMeshFormat\n",
    "$Nodes\n4000000000\n",
    "*NODE\n",
    "*NODE, NSET=a\n",
    "*ELEMENT, TYPE=CPE8\n",
    "*ELEMENT, TYPE=CPS3, ELSET=e\n",
    "*NSET, NSET=a, GENERATE\n1, 18446744073709551615, 1\n",
    "*NSET, NSET=a\na\n",
    "*NSET, NSET=b\na, a, b\n",
    "*ELSET, ELSET=e\ne, e\n",
    "*SURFACE, NAME=s\n1, S4\n",
    "*SURFACE, NAME=s\ne, S1\n",
    "*BOUNDARY\na, 1, 2\n",
    "*DLOAD\ne, P1, 1\n",
    "*STEP\n",
    "\x1f\u{8b}",
    "{\"nodes\": [], \"elements\": []}",
];

/// Words that mean something to the parser of problems.
const PROBLEMS: [&str; 28] = [
    "{",
    "]",
    "[[[[[[[[",
    "\"\\u0000\"",
    "\"\\ud800\"",
    "null",
    "true",
    "-0",
    "\"kind\": \"table\", \"x\": [0, 1], \"gap\": [0, 1]",
    "\"kind\": \"polyline\", \"points\": [[0, 0], [1, 0]]",
    "\"interpolation\": \"cubic\"",
    "\"smoothing\": {\"standard_deviation\": 1e-3}",
    "\"kind\": \"power\"",
    "\"inline\": {\"nodes\": [], \"elements\": []}",
    "\"boundaries\": {\"a\": {\"normal\": [1, 0]}}",
    "\"refine\": {\"tolerance\": 0.1}",
    "\"refine\": 2",
    "\"steps\": [{}]",
    "\"supports\": [{\"nodes\": \"a\", \"ux\": [0, 1]}]",
    "\"loads\": [{\"body_force\": [0, -1]}]",
    "\"loads\": [{\"boundary\": \"top\", \"normal\": 1, \"tangential\": 1}]",
    "\"orthotropic\": {\"e1\": 1, \"e2\": 1, \"nu12\": 0.3, \"g12\": 1}",
    "\"friction\": {\"bound\": {\"s\": [0, 1], \"bound\": [1, 1]}, \"elastic_slip\": 1}",
    "\"condition\": \"bonded\"",
    "\"along\": \"arc_length\"",
    "\"algorithm\": \"thesis\"",
    "\"kind\": \"axisymmetric\"",
    ",",
];

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

/// Attacks a reader; its memory may grow by a multiple of the largest input only.
fn attack(
    name: &str,
    seeds: Vec<Vec<u8>>,
    words: &[&str],
    cases: u64,
    read: impl Fn(&[u8]) -> String,
) -> Figures {
    let before = memory("VmHWM");
    let target = Target {
        name,
        seeds,
        words,
        cases,
    };
    let figures = target.attack(read);
    // many kinds of refusal were reached
    assert!(figures.answers > 20, "{figures:?}");
    // inputs have up to 128 KiB, the corpus some thousand of them; the tests run side by side
    // the kernel counts in batches: its highest figure may fall a little
    let grown = memory("VmHWM").saturating_sub(before);
    let grown = grown.saturating_sub(2 * figures.corpus as u64 * (16 << 10));
    assert!(grown < 128 << 20, "grown by {} MiB", grown >> 20);
    figures
}

/// The kind of a refusal: of the first violation the reason, where it is, and what was expected, without numbers.
fn kind(violations: &[Violation]) -> String {
    assert!(!violations.is_empty());
    for v in violations {
        let size = v.pointer.len() + v.got.len() + v.expected.len() + v.hint.len();
        assert!(
            !v.got.is_empty() && !v.hint.is_empty() && size < 8000,
            "{v:?}"
        );
    }
    assert!(violations.len() <= 120, "{} violations", violations.len());
    let (first, digit) = (&violations[0], |c: char| c.is_ascii_digit());
    let depth = first.pointer.matches('/').count();
    // a name from the input itself is not a kind
    let words = first
        .expected
        .split(['$', '`', '"'])
        .next()
        .unwrap_or_default();
    let words: String = words.chars().filter(|c| !digit(*c)).take(30).collect();
    format!("{} {depth} {words}", first.reason)
}

fn read(file: &[u8]) -> String {
    match read_mesh(file) {
        Ok((format, mesh, notes)) => {
            assert!(!mesh.elements.is_empty());
            let nodes = mesh.nodes.len() as u32;
            assert!(mesh.elements.iter().all(|e| e.iter().all(|n| *n < nodes)));
            let mut edges = mesh.boundaries.values().flatten().flatten();
            assert!(edges.all(|n| *n < nodes));
            assert!(mesh.node_sets.values().flatten().all(|n| *n < nodes));
            assert!(mesh.nodes.iter().flatten().all(|x| x.is_finite()));
            let notes: Vec<_> = notes.iter().map(|note| note.code).collect();
            format!("{format:?} {} {notes:?}", mesh.boundaries.len().min(9))
        }
        Err(ReadError::Invalid(violations)) => kind(&violations),
        Err(ReadError::Io(error)) => panic!("a text in memory cannot be read: {error}"),
    }
}

#[test]
fn changed_gmsh_files_are_read_or_refused() {
    attack("gmsh", files("data/gmsh", "msh"), &MESHES, 30_000, read);
}

#[test]
fn changed_decks_are_read_or_refused() {
    let decks = files("data/abaqus", "inp");
    attack("decks", decks.clone(), &MESHES, 20_000, read);
    attack(
        "decks-as-problems",
        decks,
        &MESHES,
        4000,
        |file| match abaqus::problem(&String::from_utf8_lossy(file)) {
            Ok(problem) => format!("{:?} {}", problem.analysis, problem.loads.len().min(9)),
            Err(violations) => kind(&violations),
        },
    );
}

#[test]
fn changed_inline_meshes_are_read_or_refused() {
    let square = r#"{"nodes": [[0,0],[1,0],[1,1],[0,1],[0.5,0],[1,0.5],[0.5,1],[0,0.5]],
        "elements": [[0,1,2,3,4,5,6,7]], "boundaries": {"top": [[3,2,6]]}, "groups": {"a": [0]}, "node_sets": {"b": [1]}}"#;
    attack("inline", vec![square.into()], &MESHES, 20_000, read);
}

/// The whole way of a submitted problem up to the first assembly: parsed and checked.
#[test]
fn changed_problems_are_checked_or_refused() {
    let problems = files("data/thesis", "json");
    attack("problems", problems, &PROBLEMS, 20_000, |file| {
        match files::parse(&String::from_utf8_lossy(file)) {
            // what would be refused for its size is not meshed
            Ok(problem)
                if !solver::estimate(&problem, None)
                    .is_ok_and(|told| told.memory_bytes <= 16 << 20) =>
            {
                "large".to_owned()
            }
            Ok(problem) => match solver::check(&problem, files::external_mesh(&problem, None)) {
                Ok(_) => format!("sound {}", problem.contacts.len().min(3)),
                Err(violations) => "unsound ".to_owned() + &kind(&violations),
            },
            Err(violations) => kind(&violations),
        }
    });
}
