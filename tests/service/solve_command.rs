//! `signorini solve FILE`.

use std::process::{Command, Output};

use serde_json::{Value, json};
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
fn a_converged_problem_is_summed_up_and_exits_with_0() {
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
fn a_figure_is_named_before_its_ending() {
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
fn a_problem_that_does_not_converge_exits_with_9_and_is_written_all_the_same() {
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
    let said = String::from_utf8(output.stderr).unwrap();
    for pointer in ["/materials/0/youngs_modulus", "/supports/1/boundary"] {
        assert!(said.contains(pointer), "{said}");
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
