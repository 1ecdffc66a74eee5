//! `signorini solve FILE`.

use std::process::{Command, Output, Stdio};

use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use suite::{example, example_json};

use crate::SIGNORINI;

fn solve(problem: &str, arguments: &[&str]) -> Output {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("problem.json");
    std::fs::write(&file, problem).unwrap();
    Command::new(SIGNORINI)
        .arg("solve")
        .arg(&file)
        .args(arguments)
        .output()
        .unwrap()
}

#[test]
fn a_converged_problem_is_summarized_and_exits_with_0() {
    let output = solve(&example("rectangular_punch"), &[]);
    assert_eq!(output.status.code(), Some(0));
    let summary = String::from_utf8(output.stdout).unwrap();
    assert!(
        summary.contains("converged after") && summary.contains("sha256:"),
        "{summary}"
    );
    let progress = String::from_utf8(output.stderr).unwrap();
    assert!(
        progress
            .lines()
            .filter(|line| line.contains("residual"))
            .count()
            > 3,
        "{progress}"
    );
}

/// A deck in Latin-1 with the line ends of an old system, and a problem with a byte order mark.
#[test]
fn files_of_other_systems_are_solved() {
    let folder = tempfile::tempdir().unwrap();
    let path = format!(
        "{}/../../tests/data/abaqus/ring-cpe8.inp",
        env!("CARGO_MANIFEST_DIR")
    );
    let deck = std::fs::read_to_string(path).unwrap();
    let deck = deck
        .replace("Quarter ring", "Prüfkörper")
        .replace('\n', "\r");
    let (inp, json) = (
        folder.path().join("deck.inp"),
        folder.path().join("problem.json"),
    );
    std::fs::write(&inp, deck.chars().map(|c| c as u8).collect::<Vec<u8>>()).unwrap();
    std::fs::write(&json, format!("\u{feff}{}", example("sheet"))).unwrap();
    for file in [inp, json] {
        let output = Command::new(SIGNORINI)
            .arg("solve")
            .arg(&file)
            .output()
            .unwrap();
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{}: {told}", file.display());
    }
}

#[test]
fn the_whole_document_can_go_to_standard_output() {
    let output = solve(&example("sheet"), &["-o", "-"]);
    assert_eq!(output.status.code(), Some(0));
    let document: Value = serde_json::from_slice(&output.stdout).unwrap();
    let names: Vec<&str> = document
        .as_object()
        .unwrap()
        .keys()
        .map(String::as_str)
        .collect();
    assert_eq!(names, ["fields", "history", "profiles", "steps", "summary"]);
    assert_eq!(
        document["history"].as_array().unwrap().len() as u64,
        document["summary"]["iterations"].as_u64().unwrap()
    );
}

#[test]
fn a_figure_is_named_before_the_extension() {
    let folder = tempfile::tempdir().unwrap();
    let drawn = |name: &str, more: &[&str]| {
        let file = folder.path().join(name);
        let to = [&["-o", file.to_str().unwrap()], more].concat();
        assert_eq!(solve(&example("sheet"), &to).status.code(), Some(0));
        std::fs::read_to_string(file).unwrap()
    };
    for (name, text) in [
        ("x.svg", "friction bound"),
        ("rho0.05.svg", "friction bound"),
        ("x.mesh.svg", "taper (contact)"),
        ("x.deformed.svg", "von Mises stress"),
        ("x.convergence.svg", "tolerance"),
    ] {
        let light = drawn(name, &[]);
        assert!(light.starts_with("<svg") && light.contains(text), "{name}");
        assert_ne!(light, drawn(name, &["--theme", "dark"]));
    }
}

#[test]
fn a_problem_that_does_not_converge_exits_with_9_and_is_still_written() {
    let mut problem = example_json("rectangular_punch");
    problem["solver"] = json!({ "max_iterations": 1 });
    let output = solve(&problem.to_string(), &["-o", "-"]);
    assert_eq!(output.status.code(), Some(9));
    let document: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(document["summary"]["outcome"], "not_converged");
}

#[test]
fn an_invalid_problem_exits_with_2_and_every_violation() {
    let mut problem = example_json("rectangular_punch");
    problem["materials"][0]["youngs_modulus"] = json!(0);
    problem["supports"][1]["boundary"] = json!("botom");
    let output = solve(&problem.to_string(), &[]);
    assert_eq!(output.status.code(), Some(2));
    let errors = String::from_utf8(output.stderr).unwrap();
    for pointer in ["/materials/0/youngs_modulus", "/supports/1/boundary"] {
        assert!(errors.contains(pointer), "{errors}");
    }
    assert_eq!(
        solve("{", &[]).status.code(),
        Some(2),
        "what is no JSON is invalid too"
    );
}

#[test]
fn a_missing_file_exits_with_1_in_one_line() {
    let output = Command::new(SIGNORINI)
        .args(["solve", "/nowhere/problem.json"])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(String::from_utf8(output.stderr).unwrap().lines().count(), 1);
}

/// Pulled off its obstacle, a body flies away: no solution, and no fault of the input that can be seen before.
#[test]
fn a_body_that_its_contacts_do_not_hold_exits_with_1() {
    let problem = json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grid": {"x": [0, 1, 2], "y": [0, 1]}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "left", "ux": 0}],
        "loads": [{"boundary": "top", "pressure": -5}],
        "contacts": [{"boundary": "bottom", "obstacle": {"kind": "flat"}}],
    });
    let output = solve(&problem.to_string(), &[]);
    assert_eq!(output.status.code(), Some(1));
    let errors = String::from_utf8(output.stderr).unwrap();
    assert!(errors.contains("nothing holds the body"), "{errors}");
}

/// Every code that a command ends with is in the help, 1 among them.
#[test]
fn the_help_lists_every_exit_code() {
    let help = |arguments: &[&str]| {
        let output = Command::new(SIGNORINI).args(arguments).output().unwrap();
        assert_eq!(output.status.code(), Some(0));
        String::from_utf8(output.stdout).unwrap()
    };
    let all = help(&["--help"]);
    let listed: Vec<&str> = all
        .lines()
        .skip_while(|line| *line != "Exit codes:")
        .skip(1)
        .collect();
    let codes: Vec<&str> = listed
        .iter()
        .filter_map(|line| line.split_whitespace().next())
        .collect();
    assert_eq!(
        codes,
        [
            "0", "1", "2", "3", "3", "4", "4", "5", "5", "6", "6", "7", "7", "8", "9"
        ],
        "{all}"
    );
    for command in ["solve", "serve", "doctor", "backup", "restore"] {
        let own = help(&["help", command]);
        let codes = own.lines().find(|line| line.contains("Exit code")).unwrap();
        assert!(
            codes.contains("2 ") && codes.contains("1 anything else"),
            "{own}"
        );
    }
    let warning = help(&["explain", "no-contact"]);
    assert!(
        warning.contains("never touches")
            && warning.contains("no_contact; severity: serious")
            && warning.contains("What to do. "),
        "{warning}"
    );
    assert!(help(&["explain"]).contains("mesh_too_coarse_for_radius"));
    let sweep = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../examples/sweeps/sheet.json"
    );
    let sweep = Command::new(SIGNORINI)
        .args(["solve", sweep])
        .output()
        .unwrap();
    let told = String::from_utf8_lossy(&sweep.stderr);
    assert!(told.contains("solve it with `signorini sweep`"), "{told}");
    assert_eq!(sweep.status.code(), Some(2));
    let unknown = Command::new(SIGNORINI)
        .args(["explain", "nonsense"])
        .output()
        .unwrap();
    assert_eq!(unknown.status.code(), Some(2));
}

/// The problem that a deck is converted to has the solution of the deck, and can be changed; what is no deck with a step,
/// or no deck at all, is told as `solve` tells it.
#[test]
fn a_deck_is_converted_to_a_problem_with_the_same_solution() {
    let top = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
    let deck = format!("{top}/tests/data/abaqus/roller-cpe8.inp");
    let run = |arguments: &[&str]| Command::new(SIGNORINI).args(arguments).output().unwrap();
    let converted = run(&["convert", &deck]);
    assert_eq!(converted.status.code(), Some(0));
    let told = String::from_utf8_lossy(&converted.stderr);
    assert!(told.contains("spline"), "as `solve` warns: {told}");
    let mut problem: Value = serde_json::from_slice(&converted.stdout).unwrap();
    let force = |output: &Output| {
        let text = String::from_utf8_lossy(&output.stdout);
        let line = text.lines().find(|line| line.starts_with("normal force"));
        line.unwrap_or_else(|| panic!("{text}")).to_owned()
    };
    let solved = solve(&problem.to_string(), &[]);
    assert_eq!(force(&solved), force(&run(&["solve", &deck])));
    let told = String::from_utf8_lossy(&solved.stdout);
    assert!(
        told.contains("spline"),
        "it has the differences from the deck: {told}"
    );
    problem["contacts"][0]["friction"] =
        json!({"coefficient": 0.5, "nonlocal_radius": 0.1, "elastic_slip": 1e-4});
    problem["mesh"]["refine"] = json!(1);
    assert_ne!(force(&solve(&problem.to_string(), &[])), force(&solved));

    let mesh = format!("{top}/tests/data/gmsh/fillet-mixed-msh41-binary.msh");
    assert_eq!(run(&["convert", &mesh]).status.code(), Some(2));
    assert_eq!(run(&["convert", "/nowhere.inp"]).status.code(), Some(1));
}

#[test]
fn the_files_of_the_documentation_are_written_and_those_that_are_there_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("a/b");
    let write = || {
        let output = Command::new(SIGNORINI)
            .arg("examples")
            .arg(&target)
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(0), "{output:?}");
        String::from_utf8(output.stdout).unwrap()
    };
    let first = write();
    assert!(
        first.contains("files written") && !first.contains("stay"),
        "{first}"
    );
    let problem = target.join("examples/sheet.json");
    std::fs::write(&problem, "mine").unwrap();
    let again = write();
    assert!(
        again.starts_with("0 files written") && again.contains("stay as they are"),
        "{again}"
    );
    assert_eq!(std::fs::read_to_string(&problem).unwrap(), "mine");
    let file = Command::new(SIGNORINI)
        .arg("examples")
        .arg(&problem)
        .output()
        .unwrap();
    assert_eq!(file.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&file.stderr).contains("cannot make the folder"));
}

#[test]
fn every_format_is_written_and_no_other_file_is_left() {
    let folder = tempfile::tempdir().unwrap();
    let names = [
        "p.json",
        "p.csv",
        "p.jsonl",
        "p.arrow",
        "p.npz",
        "p.vtu",
        "p.svg",
        "p.png",
        "p.deformed.pdf",
        "p.history.csv",
        "p.profile.arrow",
        "p.profile.top.csv",
        "p.fields.npz",
    ];
    std::fs::write(folder.path().join("p.csv"), "older").unwrap();
    let paths = names.map(|name| folder.path().join(name).to_str().unwrap().to_owned());
    let arguments: Vec<&str> = paths.iter().flat_map(|path| ["-o", path]).collect();
    let output = solve(&example("rectangular_punch"), &arguments);
    assert_eq!(output.status.code(), Some(0));
    assert!(
        output.stdout.is_empty(),
        "a file is requested, not a summary"
    );
    assert_eq!(
        std::fs::read_dir(folder.path()).unwrap().count(),
        names.len()
    );
    let read = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    let document: Value = serde_json::from_slice(&read("p.json")).unwrap();
    let csv = String::from_utf8(read("p.csv")).unwrap();
    let nodes = document["profiles"]["top"]["s"].as_array().unwrap().len();
    assert_eq!(csv.lines().count(), nodes + 1);
    assert_eq!(read("p.profile.top.csv"), read("p.csv"));
    assert_eq!(read("p.profile.arrow"), read("p.arrow"));
    let history = String::from_utf8(read("p.history.csv")).unwrap();
    let rows = document["history"].as_array().unwrap().len();
    assert_eq!(history.lines().count(), rows + 1);
    for (name, start) in [
        ("p.npz", &b"PK"[..]),
        ("p.vtu", b"<?xml"),
        ("p.svg", b"<svg"),
        ("p.png", b"\x89PNG"),
        ("p.deformed.pdf", b"%PDF-"),
    ] {
        assert!(read(name).starts_with(start), "{name}");
    }
}

#[test]
fn a_mesh_that_is_named_by_its_hash_is_read_from_its_file() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let quad = json!({
        "nodes": [[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0], [1, 0.5], [0.5, 1], [0, 0.5]],
        "elements": [[0, 1, 2, 3, 4, 5, 6, 7]],
        "boundaries": { "bottom": [[0, 1, 4]], "top": [[2, 3, 6]] },
    });
    std::fs::write(file("quad.json"), quad.to_string()).unwrap();
    std::fs::write(file("other.json"), format!("{quad}\n")).unwrap();
    let mut problem = json!({
        "analysis": { "kind": "plane_strain" },
        "mesh": { "inline": quad, "refine": 2 },
        "materials": [{ "youngs_modulus": 1000, "poissons_ratio": 0.3 }],
        "supports": [{ "boundary": "bottom", "ux": 0, "uy": 0 }],
        "contacts": [{ "boundary": "top", "obstacle": { "kind": "flat" }, "indentation": 0.01 }],
    });
    let of_inline = solve(&problem.to_string(), &["-o", "-"]);
    let digest = Sha256::digest(quad.to_string());
    let hash: String = digest.iter().map(|byte| format!("{byte:02x}")).collect();
    let hash = format!("sha256:{hash}");
    problem["mesh"] = json!({ "stored": hash, "refine": 2 });
    let problem = problem.to_string();
    let summary = |output: &std::process::Output| {
        let document: Value = serde_json::from_slice(&output.stdout).unwrap();
        document["summary"]["normal_force"].clone()
    };
    let of_file = solve(&problem, &["-o", "-", "--mesh", &file("quad.json")]);
    assert_eq!(of_file.status.code(), Some(0), "{of_file:?}");
    assert_eq!(summary(&of_file), summary(&of_inline));
    let figure = file("quad.mesh.svg");
    let drawn = solve(&problem, &["-o", &figure, "--mesh", &file("quad.json")]);
    assert_eq!(drawn.status.code(), Some(0), "{drawn:?}");
    for (arguments, said) in [
        (vec![], "give its file with --mesh"),
        (
            vec!["--mesh".to_owned(), file("other.json")],
            "this file has the hash",
        ),
        (vec!["--mesh".to_owned(), file("none.json")], "No such file"),
    ] {
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        let refused = solve(&problem, &arguments);
        assert_ne!(refused.status.code(), Some(0));
        let told = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert!(told.contains(said), "{told}");
    }
    let own = solve(&example("sheet"), &["--mesh", &file("quad.json")]);
    let told = String::from_utf8_lossy(&own.stderr).into_owned();
    assert!(told.contains("a mesh of its own"), "{told}");
}

#[test]
fn an_invalid_output_is_rejected_before_solving() {
    let mut two = example_json("rectangular_punch");
    two["supports"] = json!([{ "boundary": "left", "ux": 0 }]);
    let mut below = two["contacts"][0].clone();
    below["boundary"] = json!("bottom");
    two["contacts"].as_array_mut().unwrap().push(below);
    for (name, expected) in [
        ("p.xlsx", ".vtu"),
        ("p", ".json"),
        ("p.fields.csv", ".npz"),
        ("no-such-folder/p.csv", "no folder"),
        ("p.csv", "NAME.profile.top.csv"),
        ("p.profile.left.csv", "it has: top, bottom"),
    ] {
        let output = solve(&two.to_string(), &["-o", name]);
        assert_eq!(output.status.code(), Some(2), "{name}");
        let error = String::from_utf8(output.stderr).unwrap();
        assert!(
            error.contains(expected) && error.lines().count() == 1,
            "{error}"
        );
    }
}

#[test]
fn a_reader_that_closes_the_pipe_is_not_an_error() {
    for arguments in [&["openapi"][..], &["schema"], &["explain"]] {
        let mut command = Command::new(SIGNORINI);
        let child = command.args(arguments).stdout(Stdio::piped()).spawn();
        let mut child = child.unwrap();
        drop(child.stdout.take());
        assert_eq!(child.wait().unwrap().code(), Some(0), "{arguments:?}");
    }
}
