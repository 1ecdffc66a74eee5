//! Errors where stick is so small, or alternates so often, that a mesh cannot show it.

use solver::problem::{AccuracyMode, AdaptiveRefine, Elasticity, Problem, Refine};
use solver::solution::{EstimatedQuantity, QuantityName, Solution, Verdict, WarningCode};

use crate::catalogue;
use crate::support::{quiet, solve};

fn of_kind(solution: &Solution, name: QuantityName) -> Vec<&EstimatedQuantity> {
    let accuracy = solution.summary.accuracy.as_ref().unwrap();
    let all = accuracy.quantities.iter();
    all.filter(|q| q.quantity == name).collect()
}

/// The motion turns in the middle of the contact, and all that sticks there lies between two friction points: both slip, to
/// opposite sides. The friction force is 1 % too large, of which stresses and displacements tell nothing.
#[test]
fn the_friction_force_may_be_off_by_stick_that_no_point_feels() {
    let mut problem = catalogue::case(608).problem;
    let mut at = |refine: u32| {
        problem.mesh.refine = Refine::Times(refine);
        solve(&problem)
    };
    let (own, fine) = (at(1), at(3));
    let profile = &own.friction_profiles["top"];
    let slip = problem.contacts[0].friction.as_ref().unwrap().elastic_slip;
    let pressed = profile
        .normal_stress
        .iter()
        .zip(&profile.tangential_displacement);
    let mut pressed = pressed.filter(|(stress, _)| **stress < 0.0);
    assert!(
        pressed.all(|(_, u)| u.abs() >= slip),
        "no friction point sticks"
    );
    let [own, fine] = [&own, &fine].map(|s| of_kind(s, QuantityName::FrictionForce)[0]);
    let off = (own.value - fine.value).abs();
    assert!(
        off > 0.01 * own.value && off <= own.error.unwrap(),
        "{own:?}, off {off}"
    );
}

/// A flat punch on a nearly incompressible body, dragged, with a slip of a ten-thousandth: the tangential stress oscillates.
fn alternating() -> Problem {
    let mut problem = catalogue::case(51).problem;
    let Elasticity::Isotropic { poissons_ratio, .. } = &mut problem.materials[0].elasticity else {
        panic!("isotropic");
    };
    *poissons_ratio = 0.4999;
    problem
}

/// Where stick and slip alternate, no error of their ends is stated, on one mesh or two, and the reason is told once.
#[test]
fn too_many_ends_of_stick_have_no_error_and_say_so_once() {
    for mode in [AccuracyMode::Estimate, AccuracyMode::Verify] {
        let mut problem = alternating();
        problem.solver.accuracy = Some(mode);
        let solution = solve(&problem);
        let ends = of_kind(&solution, QuantityName::StickEnd);
        assert!(ends.len() > 4, "{ends:?}");
        for end in ends {
            let method = <&str>::from(end.method);
            assert_eq!((end.error, end.finer, method), (None, None, "too_many"));
        }
        let accuracy = solution.summary.accuracy.as_ref().unwrap();
        let told = accuracy
            .reasons
            .iter()
            .filter(|reason| reason.contains("`stick_end`"));
        let told: Vec<&String> = told.collect();
        assert!(
            told.len() == 1 && told[0].contains("too many ends of stick"),
            "{told:?}"
        );
        assert_ne!(accuracy.verdict, Verdict::Good);
    }
}

/// They do not keep refinement from its tolerance.
#[test]
fn too_many_ends_of_stick_do_not_stand_in_the_way_of_a_tolerance() {
    let mut problem = alternating();
    problem.mesh.refine = Refine::Adaptive(AdaptiveRefine { tolerance: 0.1 });
    let solution = solver::solve(&problem, &mut quiet).unwrap();
    for warning in &solution.summary.warnings {
        let named = warning.message.contains("stick_end");
        assert!(
            warning.code != WarningCode::RefinementUnfinished || !named,
            "{}",
            warning.message
        );
    }
}
