//! The thesis's own iteration, formulation 4.5: what it does at the thesis's parameters, and what the
//! limits of its integration cost.

use solver::problem::{Algorithm, Problem, ThesisOptions, ThesisPressure};
use solver::solution::{Outcome, Solution, WarningCode};

use crate::record::held;
use crate::support::{close, example, solve};

fn by_thesis(problem: &Problem, options: ThesisOptions, most: u32) -> Solution {
    let mut problem = problem.clone();
    problem.solver.algorithm = Algorithm::Thesis;
    problem.solver.max_iterations = most;
    problem.solver.thesis = Some(options);
    solver::solve(&problem, &mut ()).unwrap()
}

fn extrapolated(friction_force: u32, local_points: u32) -> ThesisOptions {
    ThesisOptions {
        pressure: ThesisPressure::Extrapolated,
        friction_force,
        local_points,
        ..ThesisOptions::default()
    }
}

/// Half a percent, as the published values were given: they come from an independent program.
#[test]
fn without_the_sign_it_settles_in_full_slip_and_reports_false_convergence() {
    let punch = example("rectangular_punch");
    let truth = solve(&punch).summary.tangential_force;
    close(truth, 14.169464, 1e-6);
    for (name, options, published) in [
        ("lumped", ThesisOptions::default(), 27.64),
        ("extrapolated", extrapolated(1, 0), 26.01),
    ] {
        let solution = by_thesis(&punch, options, 200);
        let summary = &solution.summary;
        let what = format!("false full slip, {name} pressure: T");
        held(
            0,
            &what,
            "example 1, 56 elements",
            summary.tangential_force,
            published,
            5e-3,
        );
        assert_eq!(summary.outcome, Outcome::FalseConvergence, "{name}");
        assert!(!summary.converged);
        assert!(
            (4..=12).contains(&summary.iterations),
            "{name}: {}",
            summary.iterations
        );
        // R_F does not show the error, the true residual does, and a warning reports it
        let last = &solution.history[solution.history.len() - 1];
        assert!(last.r_f.unwrap() <= 1e-10, "{name}");
        assert!(summary.residuals.monolithic > 0.1, "{name}");
        assert!(
            summary
                .warnings
                .iter()
                .any(|w| w.code == WarningCode::FalseConvergence)
        );
        // friction pushes along the motion where it moves at all
        let profile = &solution.node_profiles["top"];
        let along = (0..profile.s.len())
            .filter(|&i| profile.tangential_stress[i] * profile.tangential_displacement[i] > 0.0)
            .count();
        assert!(2 * along > profile.s.len(), "{name}: at {along} nodes only");
    }
}

#[test]
fn with_the_sign_it_falls_into_a_cycle_of_two() {
    let options = ThesisOptions {
        signed: true,
        ..ThesisOptions::default()
    };
    let summary = by_thesis(&example("rectangular_punch"), options, 200).summary;
    assert_eq!(summary.outcome, Outcome::ContactCycling);
    let received = summary
        .warnings
        .iter()
        .find(|w| w.code == WarningCode::ContactCycling);
    let message = &received.unwrap().message;
    assert!(
        message.contains("every 2 iterations") && message.contains("contact nodes [0, 1"),
        "{message}"
    );
}

/// Relaxed by .01 the signed iteration does arrive, in some two thousand steps: its own test is met before the true residual
/// is below the tolerance, and then it goes on until that is, and says so.
#[test]
fn with_relaxation_of_a_hundredth_it_converges_after_thousands_of_iterations() {
    let options = ThesisOptions {
        signed: true,
        relaxation: 0.01,
        ..ThesisOptions::default()
    };
    let summary = by_thesis(&example("rectangular_punch"), options, 20_000).summary;
    held(
        0,
        "signed and relaxed by .01: T",
        "example 1, 56 elements",
        summary.tangential_force,
        14.169464,
        1e-6,
    );
    assert!(
        (600..20_000).contains(&summary.iterations),
        "{}",
        summary.iterations
    );
    assert_eq!(summary.outcome, Outcome::Converged);
    assert!(summary.residuals.monolithic <= 1e-10);
    for name in ["annular_punch", "cylinder_on_end"] {
        let options = ThesisOptions {
            signed: true,
            relaxation: 0.01,
            ..ThesisOptions::default()
        };
        let problem = example(name);
        let force = by_thesis(&problem, options, 20_000).summary;
        assert_eq!(force.outcome, Outcome::Converged, "{name}");
        let expected = solve(&problem).summary.tangential_force;
        assert!(
            (force.tangential_force / expected - 1.0).abs() < 1e-8,
            "{name}"
        );
    }
}

/// Row 23: chapter 4 finds both ways of evaluating the friction force "very similar"; they are, to a
/// few percent, on a mesh as coarse as this.
#[test]
fn both_ways_of_evaluating_the_friction_force_are_similar() {
    for (name, similar) in [("rectangular_punch", 0.04), ("cylinder", 0.01)] {
        let problem = example(name);
        let force = |way: u32| {
            by_thesis(&problem, extrapolated(way, 10), 200)
                .summary
                .tangential_force
        };
        let what = format!("{name}: T by way 2 of 3.2 against way 1");
        held(23, &what, "thesis mesh", force(2), force(1), similar);
    }
}

/// A step ends at its own level, also where every increment settles in a false state.
#[test]
fn after_a_false_state_the_increments_of_a_step_continue() {
    let punch = example("rectangular_punch");
    let whole = by_thesis(&punch, ThesisOptions::default(), 200).summary;
    let mut steps = punch.clone();
    steps.steps =
        serde_json::from_value(serde_json::json!([{"name": "a", "increments": 4}])).unwrap();
    let last = by_thesis(&steps, ThesisOptions::default(), 200).summary;
    assert_eq!(last.outcome, Outcome::FalseConvergence);
    close(last.normal_force, whole.normal_force, 1e-9);
    close(last.tangential_force, whole.tangential_force, 1e-9);
}

/// What the two-element limit of 3.4.2 and the interpolation that goes with it change on example 2 with
/// ρ = .05, elements of .05.
#[test]
fn the_two_element_limit_changes_example_2_little() {
    let difference = |radius: f64| {
        let mut problem = example("cylinder");
        problem.contacts[0]
            .friction
            .as_mut()
            .unwrap()
            .nonlocal_radius = Some(radius);
        let limited = by_thesis(&problem, extrapolated(1, 20), 200).summary;
        let free = by_thesis(&problem, extrapolated(1, 0), 200).summary;
        limited.tangential_force / free.tangential_force - 1.0
    };
    let wide = difference(0.05);
    held(
        23,
        "example 2, ρ = .05: change of T by the two-element limit",
        "thesis mesh",
        wide,
        0.0,
        0.03,
    );
}

/// The thesis's first guess, and what it cannot be used for.
#[test]
fn a_first_guess_is_used_and_wrong_options_are_refused() {
    let mut options = ThesisOptions::default();
    options.contact_guess.insert("top".to_owned(), [0.0, 0.3]);
    let punch = example("rectangular_punch");
    let solution = by_thesis(&punch, options.clone(), 200);
    assert!(solution.history[0].contact.active < 11);
    close(solution.summary.tangential_force, 27.64, 5e-3);

    let mut wrong = punch.clone();
    wrong.solver.thesis = Some(options.clone());
    let pointers = |problem: &Problem| -> Vec<String> {
        let list = solver::check(problem, None).unwrap_err();
        list.into_iter().map(|v| v.pointer).collect()
    };
    assert_eq!(pointers(&wrong), ["/solver/thesis"]);
    wrong.solver.algorithm = Algorithm::Thesis;
    options.relaxation = 0.0;
    options.friction_force = 3;
    options.local_points = 4;
    options.contact_guess.insert("side".to_owned(), [1.0, 1.0]);
    wrong.solver.thesis = Some(options);
    let friction = wrong.contacts[0].friction.as_mut().unwrap();
    friction.history = solver::problem::History::Incremental;
    friction.points = solver::problem::FrictionPoints::Nodal;
    friction.measure = solver::problem::Measure::Surface;
    let found = pointers(&wrong);
    for pointer in [
        "/solver/thesis/relaxation",
        "/solver/thesis/friction_force",
        "/solver/thesis/local_points",
        "/solver/thesis/contact_guess/side",
        "/contacts/0/friction/history",
        "/contacts/0/friction/points",
        "/contacts/0/friction/measure",
    ] {
        assert!(found.iter().any(|f| f == pointer), "{pointer} in {found:?}");
    }
}
