//! Adaptive refinement: the mesh-converged values of formulation 5.3 without a hand on the mesh.

use serde_json::json;
use solver::error::SolveError;
use solver::observer::Progress;
use solver::problem::{AdaptiveRefine, Problem, Refine};
use solver::solution::{Severity, Summary, WarningCode};

use crate::record::{held, keep_table};
use crate::support::{example, problem, quiet, solve, watching};

/// The error of the peak is below the tolerance.
#[test]
fn adaptive_refinement_finds_the_peak_of_example_1() {
    let mut problem = example("rectangular_punch");
    problem.mesh.refine = Refine::Adaptive(AdaptiveRefine { tolerance: 0.01 });
    let summary = solve(&problem).summary;
    let peak = summary.contacts["top"].peak_tangential_stress.unwrap();
    let mesh = format!(
        "adaptive to .01: {} meshes, {} unknowns",
        summary.refinements.len(),
        summary.dofs
    );
    held(
        0,
        "example 1, ρ = .01: max σ_t",
        &mesh,
        peak.value,
        249.6,
        0.01,
    );
    held(
        0,
        "example 1, ρ = .01: Y",
        &mesh,
        summary.normal_force,
        95.267,
        0.01,
    );
    held(
        0,
        "example 1, ρ = .01: T",
        &mesh,
        summary.tangential_force,
        14.231,
        0.01,
    );
    // the sequence is reported, and begins with the user's own mesh
    assert_eq!(summary.refinements[0].elements, 56);
    assert!((summary.refinements[0].peak_tangential_stress - 443.0).abs() < 1.0);
    assert!(
        summary
            .refinements
            .windows(2)
            .all(|pair| pair[1].elements > pair[0].elements)
    );
}

#[test]
fn adaptive_refinement_finds_the_values_of_a_smooth_contact() {
    let mut problem = example("cylinder");
    problem.mesh.refine = Refine::Adaptive(AdaptiveRefine { tolerance: 0.005 });
    let summary = solve(&problem).summary;
    let mesh = format!("adaptive to .005: {} unknowns", summary.dofs);
    held(
        0,
        "example 2, ρ = .03: Y",
        &mesh,
        summary.normal_force,
        312.870,
        0.005,
    );
    held(
        0,
        "example 2, ρ = .03: T",
        &mesh,
        summary.tangential_force,
        39.070,
        0.005,
    );
    let [_, half_width] = summary.contacts["top"].contact[0];
    held(
        0,
        "example 2: contact half-width",
        &mesh,
        half_width,
        2.1375,
        0.01,
    );
}

#[test]
fn adaptive_refinement_with_a_wrong_tolerance_or_no_contact_is_refused() {
    let mut problem = example("cylinder");
    problem.mesh.refine = Refine::Adaptive(AdaptiveRefine { tolerance: 1.5 });
    problem.contacts.clear();
    let found = solver::check(&problem, None).unwrap_err();
    let pointers: Vec<_> = found.iter().map(|v| v.pointer.as_str()).collect();
    assert_eq!(pointers, ["/mesh/refine/tolerance", "/mesh/refine"]);
}

fn to(tolerance: f64, mut problem: Problem) -> Problem {
    problem.mesh.refine = Refine::Adaptive(AdaptiveRefine { tolerance });
    problem
}

fn messages(summary: &Summary) -> Vec<&str> {
    let unfinished = |w: &&solver::solution::Warning| w.code == WarningCode::RefinementUnfinished;
    let warnings = summary.warnings.iter().filter(unfinished);
    warnings.map(|warning| warning.message.as_str()).collect()
}

/// Whether the reasons of the verdict say that the peak of σ_n has no limit.
fn without_a_limit(summary: &Summary) -> bool {
    let mut reasons = summary
        .accuracy
        .iter()
        .flat_map(|accuracy| &accuracy.reasons);
    reasons.any(|reason| {
        reason.starts_with("`peak_normal_stress` at contact `top` grows without limit")
    })
}

/// Forces and σ_t come to the tolerance; σ_n, which grows at the edge without limit, is named by the verdict, and nothing
/// is left to be warned of.
#[test]
fn at_a_sharp_edge_the_peak_without_a_limit_is_named() {
    let summary = solve(&to(0.02, example("rectangular_punch"))).summary;
    assert!(summary.refinements.last().unwrap().error.unwrap() <= 0.02);
    assert!(without_a_limit(&summary));
    let codes: Vec<_> = summary.warnings.iter().map(|w| w.code).collect();
    assert_eq!(codes, [WarningCode::SharpEdge]);
    assert_eq!(WarningCode::SharpEdge.severity(), Severity::Note);
    assert_eq!(
        messages(&solve(&to(0.02, example("cylinder"))).summary),
        [""; 0]
    );
}

/// At a kink of the obstacle the pressure has no limit: refinement ends, and says so.
#[test]
fn a_kink_of_the_obstacle_stands_in_the_way_and_is_named() {
    let mut kinked = example("cylinder");
    kinked.contacts[0].obstacle =
        serde_json::from_value(json!({"kind": "table", "x": [0, 1, 4], "gap": [0, 0.05, 0.9]}))
            .unwrap();
    let summary = solve(&to(0.01, kinked)).summary;
    let kink = |w: &solver::solution::Warning| w.code == WarningCode::KinkInContact;
    assert!(summary.warnings.iter().any(kink), "{:#?}", summary.warnings);
    assert!(summary.refinements.len() < 20);
    // the forces are known all the same
    let accuracy = summary.accuracy.as_ref().unwrap();
    let force = &accuracy.quantities[0];
    assert!(force.relative.unwrap() < 0.01, "{force:?}");
    assert!(without_a_limit(&summary), "{:#?}", accuracy.reasons);
}

/// The observer learns which mesh is being solved.
#[test]
fn every_mesh_is_named_while_it_is_solved() {
    let mut told = Vec::new();
    let problem = to(0.002, example("cylinder"));
    let solution = solver::solve(&problem, &mut |progress: Progress<'_>| {
        if let Progress::Refinement {
            number,
            elements,
            error,
        } = progress
        {
            told.push((number, elements, error));
        }
    });
    let solution = solution.unwrap();
    // and each time they are the same, to the last bit
    assert_eq!(solve(&problem), solution);
    let rows = solution.summary.refinements;
    let before = std::iter::once(None).chain(rows.iter().map(|row| row.error));
    let expected = (1..).zip(&rows).zip(before);
    assert!(
        told.iter()
            .copied()
            .eq(expected.map(|((k, row), error)| (k, row.elements, error)))
    );
    assert!(rows.len() > 2);
}

/// On whichever mesh it is told to stop, it does so.
#[test]
fn adaptive_refinement_stops_at_any_question() {
    let problem = to(0.002, example("cylinder"));
    let mut questions = 0;
    let mut counts = watching(|progress| {
        questions += usize::from(progress.is_none());
        false
    });
    let whole = solver::solve(&problem, &mut counts);
    assert!(whole.unwrap().summary.refinements.len() > 2);
    for stop_at in (0..questions).step_by(1 + questions / 40) {
        let (mut asked, mut after) = (0, 0);
        let mut stops = watching(|progress| {
            asked += usize::from(progress.is_none());
            after += u32::from(progress.is_none() && asked > stop_at);
            asked > stop_at
        });
        let stopped = solver::solve(&problem, &mut stops);
        // what is told at the end, once a last mesh is known, is told to whoever stops, too
        assert!(after <= 60, "{after} questions after {stop_at}");
        if let Err(error) = stopped {
            assert_eq!(error, SolveError::Stopped);
        }
    }
}

/// Allows meshes that need no more than some memory.
struct WithMemory {
    most: u64,
    /// The memory of each mesh that was asked about.
    asked: Vec<u64>,
}

impl solver::observer::Observer for WithMemory {
    fn event(&mut self, _: Progress<'_>) {}

    fn stop(&mut self) -> bool {
        false
    }

    fn may_use(&mut self, bytes: u64) -> bool {
        self.asked.push(bytes);
        bytes <= self.most
    }
}

/// Elements are divided several times for the next mesh. Where that mesh needs too much memory, they are divided once.
#[test]
fn a_mesh_that_is_too_large_is_tried_with_fewer_divisions() {
    let problem = to(0.001, example("cylinder"));
    let solve = |most: u64| {
        let mut observer = WithMemory {
            most,
            asked: Vec::new(),
        };
        let solution = solver::solve(&problem, &mut observer).unwrap();
        (solution.summary.refinements, observer.asked)
    };
    let (free, asked) = solve(u64::MAX);
    assert!(free.len() > 2, "{free:#?}");
    let refused = *asked.iter().max().unwrap();
    let place = asked.iter().position(|bytes| *bytes == refused).unwrap();
    let (bounded, again) = solve(refused - 1);
    assert_eq!(
        again[..=place],
        asked[..=place],
        "the same meshes up to the one that is refused"
    );
    assert!(again[place + 1] < refused, "{again:?}");
    let [.., before, last] = &free[..] else {
        panic!()
    };
    let next = &bounded[free.len() - 1];
    assert!(
        (before.elements + 1..last.elements).contains(&next.elements),
        "{bounded:#?}"
    );
}

/// The obstacle ends inside an edge: the first mesh has a node there, and so have all others.
#[test]
fn an_edge_that_the_obstacle_ends_in_is_divided_there() {
    let punch = |lines: serde_json::Value, refine: serde_json::Value| {
        let whole = json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"grid": {"x": lines, "y": [-4, -2, -1, -0.5, 0]}, "refine": refine},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "left", "ux": 0}, {"boundary": "bottom", "ux": 0, "uy": 0}],
            "contacts": [{"boundary": "top", "obstacle": {"kind": "flat", "to": 0.7}, "indentation": 0.01}],
        });
        solve(&problem(&whole.to_string())).summary
    };
    let tolerance = json!({"tolerance": 0.01});
    let (cut, fitted) = (
        punch(json!([0, 0.5, 1, 2, 4]), tolerance.clone()),
        punch(json!([0, 0.35, 0.7, 1.4, 2, 4]), tolerance),
    );
    assert!(cut.refinements.last().unwrap().error.unwrap() <= 0.01);
    let (a, b) = (cut.normal_force, fitted.normal_force);
    assert!((a / b - 1.0).abs() < 0.02, "{a} against {b}");
    let coarse = punch(json!([0, 0.5, 1, 2, 4]), json!(0)).normal_force;
    assert!((coarse / b - 1.0).abs() < 0.1, "{coarse} against {b}");
}

/// A curved body from a file, of triangles: the forces of a much finer uniform mesh.
#[test]
fn a_mesh_from_a_file_is_refined() {
    let path = format!(
        "{}/data/gmsh/hertz-tri6-msh41-binary.msh",
        env!("CARGO_MANIFEST_DIR")
    );
    let (mesh, _) = files::gmsh::read(&std::fs::read(path).unwrap()[..]).unwrap();
    let inline =
        json!({"nodes": mesh.nodes, "elements": mesh.elements, "boundaries": mesh.boundaries});
    let text = |refine: serde_json::Value| {
        json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"inline": inline, "refine": refine},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "axis", "ux": 0}, {"boundary": "base", "ux": 0, "uy": 0}],
            "contacts": [{"boundary": "contact", "indentation": 0.2, "obstacle": {"kind": "parabola", "radius": 8}}],
        })
        .to_string()
    };
    let fine = solve(&problem(&text(json!(1)))).summary;
    let own = solve(&problem(&text(json!({"tolerance": 0.002})))).summary;
    assert!(
        own.refinements.last().unwrap().error.unwrap() <= 0.002,
        "{:#?}",
        own.refinements
    );
    assert!(own.refinements.len() > 1);
    assert!((own.normal_force / fine.normal_force - 1.0).abs() < 0.002);
    let peak = |summary: &Summary| {
        summary.contacts["contact"]
            .peak_normal_stress
            .unwrap()
            .value
    };
    assert!((peak(&own) / peak(&fine) - 1.0).abs() < 0.004);
}

/// Errors of Y, T and max |σ_t| (where it has a limit) against a reference, and the unknowns that they took.
#[test]
fn adaptive_meshes_need_fewer_unknowns_than_uniform_ones() {
    let results = |summary: &Summary| {
        let peak = summary.contacts["top"].peak_tangential_stress.unwrap();
        [
            summary.normal_force,
            summary.tangential_force,
            peak.value.abs(),
        ]
    };
    let mut lines = Vec::new();
    for name in ["rectangular_punch", "cylinder", "annular_punch"] {
        let reference = results(&solve(&to(0.002, example(name))).summary);
        let error = |summary: &Summary| {
            let pairs = results(summary).into_iter().zip(reference);
            pairs.map(|(a, b)| (a / b - 1.0).abs()).fold(0.0, f64::max)
        };
        let adaptive = solve(&to(0.01, example(name))).summary;
        let all: u64 = adaptive.refinements.iter().map(|row| row.dofs).sum();
        let mut uniform = (0, f64::INFINITY);
        for times in 0..=5 {
            let mut problem = example(name);
            problem.mesh.refine = Refine::Times(times);
            let summary = solver::solve(&problem, &mut quiet).unwrap().summary;
            uniform = (summary.dofs, error(&summary));
            if uniform.1 <= error(&adaptive).max(0.01) {
                break;
            }
        }
        assert!(error(&adaptive) <= 0.01);
        lines.push(json!({"example": name, "meshes": adaptive.refinements.len(), "unknowns": adaptive.dofs,
            "all": all, "error": error(&adaptive), "uniform": uniform.0, "uniform_error": uniform.1}));
    }
    let sum = |key: &str| {
        lines
            .iter()
            .map(|line| line[key].as_u64().unwrap())
            .sum::<u64>()
    };
    assert!(2 * sum("all") < sum("uniform"), "{lines:#?}");
    keep_table("adaptive", &json!(lines));
}

/// A ridge of .01 between nodes .05 apart: no node touches it at first. The mesh is refined there until it is felt.
#[test]
fn a_ridge_between_the_nodes_is_found() {
    let problem = problem(
        r#"{
            "analysis": {"kind": "plane_strain"},
            "mesh": {"grid": {"x": [0, 0.5, 1, 1.5, 2], "y": [-2, -1, -0.5, 0]}, "refine": {"tolerance": 0.05}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
            "contacts": [{"boundary": "top", "indentation": 0.01, "obstacle": {"kind": "table",
                "x": [0, 0.83, 0.88, 0.93, 2], "gap": [0.03, 0.03, 0, 0.03, 0.03], "interpolation": "cubic"}}]
        }"#,
    );
    let solution = solve(&problem);
    assert!(solution.summary.normal_force > 0.0);
    let missed = WarningCode::ObstacleBetweenNodes;
    let warnings = &solution.summary.warnings;
    assert!(warnings.iter().all(|w| w.code != missed), "{warnings:?}");
    assert!(solution.summary.refinements.len() > 3);
}
