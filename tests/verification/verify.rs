//! `"accuracy": "verify"`: what the mesh split in two says of the errors.

use serde_json::{Value, json};
use solver::observer::{Observer, Progress};
use solver::problem::{AccuracyMode, Problem, Refine};
use solver::solution::{
    Accuracy, ErrorMethod, EstimatedQuantity, Phase, QuantityName, Solution, Verdict,
};

use crate::catalogue;
use crate::support::{close, example, graded, problem, quiet, solve, union, watching};

/// A Hertz cylinder, R = 8 and E* = 1000/0.91, on a block of 40; `h`: element size in the contact.
fn cylinder(h: f64, refine: u32) -> Problem {
    let fine: Vec<f64> = (0..=(1.2 / h).round() as usize)
        .map(|k| k as f64 * h)
        .collect();
    let x = union(&[fine, graded(1.2, 40.0, h, 1.35)]);
    let y: Vec<f64> = graded(0.0, -40.0, h, 1.35).into_iter().rev().collect();
    verify(&json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grid": {"x": x, "y": y}, "refine": refine},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "left", "ux": 0}, {"boundary": "bottom", "uy": 0}],
        "contacts": [{"boundary": "top", "obstacle": {"kind": "parabola", "radius": 8, "from": 0, "to": 2},
            "indentation": 0.3}],
    }))
}

fn verify(whole: &Value) -> Problem {
    let mut problem = problem(&whole.to_string());
    problem.solver.accuracy = Some(AccuracyMode::Verify);
    problem
}

fn accuracy(solution: &Solution) -> &Accuracy {
    solution.summary.accuracy.as_ref().unwrap()
}

fn quantity(accuracy: &Accuracy, name: QuantityName) -> &EstimatedQuantity {
    let mut all = accuracy.quantities.iter();
    all.find(|q| q.quantity == name).unwrap()
}

/// The same problem without verification, refined so often.
fn estimated(problem: &Problem, refine: u32) -> Solution {
    let mut problem = problem.clone();
    problem.solver.accuracy = Some(AccuracyMode::Estimate);
    problem.mesh.refine = Refine::Times(refine);
    solve(&problem)
}

/// The result is that of the problem without verification, bit by bit, and what it is compared with is that of one `refine`
/// more: for each of the examples, and with steps, unstructured meshes and friction that depends on the path.
#[test]
fn the_solution_stays_and_is_compared_with_one_refinement_more() {
    let mut problems: Vec<(String, Problem)> = suite::EXAMPLES
        .map(|name| (name.to_owned(), example(name)))
        .into();
    let mut stepped = example("cylinder");
    let friction = stepped.contacts[0].friction.as_mut().unwrap();
    friction.history = solver::problem::History::Incremental;
    stepped.steps = serde_json::from_value(json!([
        {"indentation": 1, "increments": 3},
        {"indentation": 0.8, "increments": 2},
    ]))
    .unwrap();
    problems.push(("in steps".to_owned(), stepped));
    problems.push(("unstructured".to_owned(), catalogue::unstructured(7)));
    for (name, mut problem) in problems {
        problem.mesh.refine = Refine::Times(1);
        problem.solver.accuracy = Some(AccuracyMode::Verify);
        let mut solution = solve(&problem);
        let own = estimated(&problem, 1);
        let verified = solution.summary.accuracy.take().unwrap();
        let estimates = own.summary.accuracy.clone().unwrap();
        solution.summary.accuracy = Some(estimates.clone());
        assert_eq!(solution, own, "{name}");
        assert_eq!(verified.verified, Some(true), "{name}");
        let [finer, coarser] = [2, 0].map(|refine| estimated(&problem, refine));
        let [finer, coarser] = [&finer, &coarser].map(accuracy);
        let mut compared = 0;
        for q in &verified.quantities {
            let of_kind = |accuracy: &Accuracy| -> Vec<f64> {
                let same =
                    |o: &&EstimatedQuantity| (o.quantity, &o.contact) == (q.quantity, &q.contact);
                accuracy
                    .quantities
                    .iter()
                    .filter(same)
                    .map(|o| o.value)
                    .collect()
            };
            let (here, there) = (of_kind(&estimates), of_kind(finer));
            if here.len() != there.len() {
                let told = |reason: &String| reason.contains("cannot be compared");
                assert!(verified.reasons.iter().any(told), "{name}: {q:?}");
                assert_ne!(q.method, ErrorMethod::MeshHalved);
                continue;
            }
            let place = here.iter().position(|value| *value == q.value).unwrap();
            compared += 1;
            assert_eq!(q.finer, Some(there[place]), "{name}: {q:?}");
            let size = |value: f64| match q.quantity {
                QuantityName::PeakTangentialStress => value.abs(),
                _ => value,
            };
            let difference = (size(q.value) - size(there[place])).abs();
            assert_eq!(q.difference, Some(difference), "{name}: {q:?}");
            if let Some(order) = q.order {
                let before = (size(of_kind(coarser)[place]) - size(q.value)).abs();
                assert_eq!(order, (before / difference).log2(), "{name}: {q:?}");
            }
        }
        assert!(compared >= 3, "{name}: {compared}");
    }
}

/// With quadratic elements the pressure has order 2, and so have force and peak on average: how far the end of contact lies
/// from the next node differs from mesh to mesh, so that single orders scatter. The end itself moves from node to node.
#[test]
fn orders_of_a_hertz_cylinder_are_those_of_theory() {
    let widths = [0.12, 0.15, 0.2, 0.24, 0.3, 0.4];
    let solutions = widths.map(|h| solve(&cylinder(h, 1)));
    let mean = |name: QuantityName| {
        let orders = solutions
            .iter()
            .map(|s| quantity(accuracy(s), name).order.unwrap());
        orders.sum::<f64>() / widths.len() as f64
    };
    for name in [QuantityName::NormalForce, QuantityName::PeakNormalStress] {
        let order = mean(name);
        assert!((order - 2.0).abs() < 0.6, "{name:?}: {order}");
    }
    for (h, solution) in widths.iter().zip(&solutions) {
        // nodes are h/4 apart
        let end = quantity(accuracy(solution), QuantityName::ContactEnd);
        let steps = end.difference.unwrap() / (h / 8.0);
        assert!(
            (steps - steps.round()).abs() < 1e-6 && steps < 2.5,
            "{end:?}"
        );
        assert!(end.error.unwrap() >= 0.375 * h / 4.0 - 1e-12, "{end:?}");
    }
    // the end of contact is known well enough for `good`
    let (problem, solution) = (cylinder(widths[1], 1), &solutions[1]);
    let reference = estimated(&problem, 4);
    for name in [
        QuantityName::NormalForce,
        QuantityName::PeakNormalStress,
        QuantityName::ContactEnd,
    ] {
        let (own, fine) = (
            quantity(accuracy(solution), name),
            quantity(accuracy(&reference), name),
        );
        let off = (own.value - fine.value).abs();
        assert!(off <= own.error.unwrap(), "{name:?}: {off:.1e} of {own:?}");
        assert_eq!(own.method, ErrorMethod::MeshHalved);
    }
    let good = (Verdict::Good, &[][..]);
    assert_eq!(
        (accuracy(solution).verdict, &accuracy(solution).reasons[..]),
        good
    );
}

/// At the edge of a flat punch the pressure has no limit, which no comparison gives it; the force has.
#[test]
fn a_flat_punch_keeps_a_peak_without_a_limit() {
    let h = 0.05;
    let x = union(&[graded(0.5, 0.0, h, 1.3), graded(0.5, 20.0, h, 1.3)]);
    let y: Vec<f64> = graded(0.0, -20.0, h, 1.3).into_iter().rev().collect();
    let problem = verify(&json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grid": {"x": x, "y": y}, "refine": 1},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "left", "ux": 0}, {"boundary": "bottom", "ux": 0, "uy": 0}],
        "contacts": [{"boundary": "top", "obstacle": {"kind": "flat", "from": 0, "to": 0.5}, "indentation": 0.1}],
    }));
    let solution = solve(&problem);
    let verified = accuracy(&solution);
    let peak = quantity(verified, QuantityName::PeakNormalStress);
    assert_eq!(
        (peak.method, peak.error, peak.relative),
        (ErrorMethod::NoLimit, None, None)
    );
    // it grows like the root of the number of elements: the order is -1/2
    assert!(peak.finer.unwrap() < 1.3 * peak.value);
    assert!((peak.order.unwrap() + 0.5).abs() < 0.1, "{peak:?}");
    // a singularity of r^-1/2 at the edge: the force, of its energy, converges with order 1
    let force = quantity(verified, QuantityName::NormalForce);
    assert!((force.order.unwrap() - 1.0).abs() < 0.2, "{force:?}");
    let reference = estimated(&problem, 4);
    let off = (force.value - quantity(accuracy(&reference), QuantityName::NormalForce).value).abs();
    let error = force.error.unwrap();
    assert!(
        off <= error && error <= 3.0 * off,
        "{off:.2e} of {error:.2e}"
    );
    assert!(
        verified
            .reasons
            .iter()
            .any(|reason| reason.contains("without limit"))
    );
}

/// Without a coarser mesh there is no order, and the reasons name the finer mesh.
#[test]
fn a_coarse_mesh_has_the_errors_that_the_finer_one_shows() {
    let solution = solve(&cylinder(1.2, 0));
    let verified = accuracy(&solution);
    assert!(
        verified
            .quantities
            .iter()
            .all(|q| q.order.is_none() && q.finer.is_some())
    );
    assert_eq!(verified.verdict, Verdict::Poor);
    let reason = &verified.reasons[0];
    assert!(reason.contains("on the refined mesh it is"), "{reason}");
}

/// A contact that reaches a second interval on the finer mesh only: what cannot be compared keeps its estimate and says so.
#[test]
fn an_interval_that_appears_keeps_the_estimate() {
    // a bump between the midside node and the corner of an edge, felt once there is a node
    let problem = verify(&json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grid": {"x": [-4, -3, -2, -1, 0, 1, 2, 3, 4], "y": [-6, -4, -2, -1, 0]}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
        "contacts": [{"boundary": "top", "indentation": 0.02, "obstacle": {"kind": "table",
            "x": [-4, -1, 0, 1, 2.15, 2.25, 2.35, 4], "gap": [0.5, 0.05, 0, 0.05, 0.2, 0, 0.2, 0.5]}}],
    }));
    let solution = solve(&problem);
    let verified = accuracy(&solution);
    println!("{verified:#?}");
    assert_eq!(verified.verified, Some(true));
    let alone = |reason: &&String| reason.contains("cannot be compared");
    let told: Vec<&String> = verified.reasons.iter().filter(alone).collect();
    assert_eq!(told.len(), 2, "{:#?}", verified.reasons);
    let ends = |q: &&EstimatedQuantity| q.quantity == QuantityName::ContactStart;
    let start = verified.quantities.iter().find(ends).unwrap();
    assert!(
        start.finer.is_none() && start.method != ErrorMethod::MeshHalved,
        "{start:?}"
    );
    assert!(verified.verdict >= Verdict::Fair);
}

/// Wherever the second solution is stopped, it does so at once: the first one stays, with estimates.
#[test]
fn a_stop_while_verifying_leaves_the_solution() {
    let mut problem = catalogue::case(1).problem;
    problem.solver.accuracy = Some(AccuracyMode::Verify);
    let own = {
        let mut problem = problem.clone();
        problem.solver.accuracy = Some(AccuracyMode::Estimate);
        solver::solve(&problem, &mut quiet).unwrap()
    };
    let mut questions = 0;
    let mut begun = None;
    let mut counts = watching(|progress| {
        let Some(progress) = progress else {
            questions += 1;
            return false;
        };
        if let Progress::Phase(Phase::Verify) = progress {
            assert!(
                begun.replace(questions + 1).is_none(),
                "one phase, in which all else is hidden"
            );
        } else {
            assert!(begun.is_none(), "{progress:?}");
        }
        false
    });
    solver::solve(&problem, &mut counts).unwrap();
    let begun = begun.unwrap();
    assert!(questions > begun + 40, "{begun} of {questions}");
    for stop_at in (begun..questions).step_by(1 + (questions - begun) / 30) {
        let (mut asked, mut after) = (0, 0);
        let mut stops = watching(|progress| {
            asked += usize::from(progress.is_none());
            after += usize::from(progress.is_none() && asked > stop_at);
            asked >= stop_at
        });
        let mut solution = solver::solve(&problem, &mut stops).unwrap();
        assert!(after <= 60, "{after} questions after {stop_at}");
        let left = solution.summary.accuracy.take().unwrap();
        let estimates = own.summary.accuracy.clone().unwrap();
        // what was compared by then is of use; else there are estimates, and a reason before all others
        if left.verified == Some(false) {
            assert_eq!(
                (left.verdict, &left.quantities),
                (estimates.verdict, &estimates.quantities)
            );
            assert!(
                left.reasons[0].contains("not verified: "),
                "{:?}",
                left.reasons
            );
            assert_eq!(left.reasons[1..], estimates.reasons);
        }
        solution.summary.accuracy = Some(estimates);
        assert_eq!(solution, own, "{stop_at}");
    }
}

/// A finer mesh that does not fit into memory, a finer one that does not converge.
#[test]
fn a_finer_mesh_that_cannot_be_solved_leaves_the_solution_and_says_why() {
    let problem = cylinder(0.3, 0);
    /// Stops when the verification begins; the most memory that was asked for before.
    #[derive(Default)]
    struct Estimates {
        largest: u64,
        verifies: bool,
    }
    impl Observer for Estimates {
        fn event(&mut self, progress: Progress<'_>) {
            self.verifies |= matches!(progress, Progress::Phase(Phase::Verify));
        }

        fn stop(&mut self) -> bool {
            self.verifies
        }

        fn may_use(&mut self, bytes: u64) -> bool {
            self.largest = self.largest.max(bytes);
            true
        }
    }
    let mut estimates = Estimates::default();
    let own = solver::solve(&problem, &mut estimates).unwrap();
    let reason = |solution: &Solution| {
        assert_eq!(accuracy(solution).verified, Some(false));
        assert_eq!(accuracy(solution).quantities, accuracy(&own).quantities);
        assert!(solution.summary.converged);
        accuracy(solution).reasons[0].clone()
    };
    assert!(
        reason(&own).contains("was stopped (canceled, or"),
        "{}",
        reason(&own)
    );
    /// Allows no more memory than was needed without a verification.
    struct Limited(u64);
    impl Observer for Limited {
        fn event(&mut self, _: Progress<'_>) {}

        fn may_use(&mut self, bytes: u64) -> bool {
            bytes <= self.0
        }
    }
    let outgrown = solver::solve(&problem, &mut Limited(estimates.largest));
    let outgrown = reason(&outgrown.unwrap());
    assert!(outgrown.contains("more memory than there is"), "{outgrown}");

    // as many sweeps as the coarse mesh needs, which are not enough for the finer one
    let mut problem = example("rectangular_punch");
    problem.solver.accuracy = Some(AccuracyMode::Verify);
    let needed = |refine: u32| estimated(&problem, refine).summary.iterations;
    assert!(needed(1) > needed(0), "{} and {}", needed(0), needed(1));
    let mut fewest = None;
    for most in 1..=needed(0) {
        problem.solver.max_iterations = most;
        let solution = solver::solve(&problem, &mut quiet).unwrap();
        if solution.summary.converged {
            fewest = Some(solution);
            break;
        }
        assert_eq!(accuracy(&solution).verified, Some(false));
        assert_eq!(accuracy(&solution).verdict, Verdict::Poor);
    }
    let fewest = fewest.unwrap();
    let told = &accuracy(&fewest).reasons[0];
    assert!(told.contains("the iterations did not converge"), "{told}");
}

/// The last mesh of adaptive refinement is verified, unless split in two it would be larger than such meshes may be.
#[test]
fn the_last_mesh_of_adaptive_refinement_is_verified() {
    let mut problem = cylinder(0.6, 0);
    problem.mesh.refine = serde_json::from_value(json!({"tolerance": 0.05})).unwrap();
    let (solution, last) = solver::solve_with_mesh(&problem, None, &mut quiet).unwrap();
    let verified = accuracy(&solution);
    assert_eq!(verified.verified, Some(true));
    let halved = solver::mesh::refine(&last);
    let finer = solver::prepare_on_mesh(&problem, halved, &mut quiet).unwrap();
    let finer = finer.solve(&mut quiet).unwrap();
    let force = quantity(verified, QuantityName::NormalForce);
    assert_eq!(force.finer, Some(finer.summary.normal_force));
    assert_eq!((force.method, force.order), (ErrorMethod::MeshHalved, None));

    // 600 elements at the contact is what refinement may make of few
    let lines: Vec<f64> = (0..=400).map(|k| f64::from(k) * 0.01).collect();
    problem.mesh.grid_mut().unwrap().x = lines;
    let model = solver::model::Model::new(&problem, None).unwrap();
    let estimate = model.estimate(&problem);
    problem.solver.accuracy = Some(AccuracyMode::Estimate);
    let without = model.estimate(&problem);
    assert!(estimate.memory_bytes > without.memory_bytes && estimate.dofs == without.dofs);
}

/// What is admitted counts the finer mesh; what has nothing to compare is refused.
#[test]
fn the_finer_mesh_is_counted_and_a_contact_is_needed() {
    let problem = cylinder(0.2, 1);
    let told = |problem: &Problem| solver::check(problem, None).unwrap().estimate;
    let mut finer = problem.clone();
    finer.solver.accuracy = Some(AccuracyMode::Estimate);
    let own = told(&finer);
    finer.mesh.refine = Refine::Times(2);
    let (verified, finer) = (told(&problem), told(&finer));
    assert_eq!(verified.dofs, own.dofs);
    assert!(verified.memory_bytes >= finer.memory_bytes);
    assert!(verified.memory_bytes < 3 * finer.memory_bytes / 2);
    assert!(verified.run_s > finer.run_s);
    let first = solver::estimate(&problem, None).unwrap();
    assert!(first.memory_bytes <= verified.memory_bytes);

    let mut alone = problem.clone();
    alone.contacts.clear();
    let refused = solver::check(&alone, None).unwrap_err();
    let violation = refused
        .iter()
        .find(|v| v.pointer == "/solver/accuracy")
        .unwrap();
    assert_eq!(violation.got, "`verify` without a contact");

    let mut endless = problem;
    let mut refused = |times: u32| {
        endless.mesh.refine = Refine::Times(times);
        solver::estimate(&endless, None).err().map(|v| v.pointer)
    };
    let places: Vec<_> = (0..20).map(&mut refused).collect();
    // the own mesh fits in one case more
    let first = places.iter().position(Option::is_some).unwrap();
    assert_eq!(places[first].as_deref(), Some("/solver/accuracy"));
    assert_eq!(places[first + 1].as_deref(), Some("/mesh/refine"));
}

/// What touches on the finer mesh only is said to.
#[test]
fn a_contact_that_appears_is_reported() {
    let bump = |x: [f64; 3]| {
        verify(&json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"grid": {"x": [-4, -3, -2, -1, 0, 1, 2, 3, 4], "y": [-6, -4, -2, -1, 0]}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
            "contacts": [{"boundary": "top", "indentation": 0.02, "obstacle": {"kind": "table",
                "x": [-4, x[0], x[1], x[2], 4], "gap": [0.5, 0.2, 0, 0.2, 0.5]}}],
        }))
    };
    let solution = solve(&bump([2.15, 2.25, 2.35]));
    let verified = accuracy(&solution);
    assert_eq!(solution.summary.normal_force, 0.0);
    let force = quantity(verified, QuantityName::NormalForce);
    println!("{verified:#?}");
    assert!(force.finer.unwrap() > 0.0 && force.difference == force.finer);
    assert_eq!(verified.verdict, Verdict::Poor);
    for told in [
        "0 of `contact_start` on this mesh and 1 on the refined one",
        "0 of `peak_normal_stress` on this mesh and 1",
    ] {
        let told = |reason: &String| reason.contains(told);
        assert!(verified.reasons.iter().any(told), "{:#?}", verified.reasons);
    }
}

/// Bad values are refused where they are, with what is possible.
#[test]
fn other_modes_are_refused() {
    let mut whole = serde_json::to_value(cylinder(0.6, 0)).unwrap();
    assert_eq!(whole["solver"]["accuracy"], "verify");
    for (value, got) in [
        (json!("exact"), "exact"),
        (json!(true), "true"),
        (json!(1), "1"),
    ] {
        whole["solver"]["accuracy"] = value;
        let refused = files::parse(&whole.to_string()).unwrap_err();
        assert_eq!(refused.len(), 1, "{refused:#?}");
        assert_eq!(refused[0].pointer, "/solver/accuracy");
        assert!(refused[0].got.contains(got), "{refused:#?}");
        assert!(refused[0].expected.contains("verify"), "{refused:#?}");
    }
    // what is not asked for is not written: fingerprints stay
    whole["solver"].as_object_mut().unwrap().remove("accuracy");
    let parsed = files::parse(&whole.to_string()).unwrap();
    let written = serde_json::to_value(parsed).unwrap();
    assert!(written["solver"].get("accuracy").is_none());
    close(
        written["solver"]["tolerance"].as_f64().unwrap(),
        1e-10,
        1e-12,
    );
}
