//! Results that looked right and were not: each is right now, refused, or warned of.

use serde_json::{Value, json};
use solver::problem::{Problem, Refine};
use solver::solution::{Outcome, QuantityName, Summary, Verdict, WarningCode};

use crate::support::{example, problem, quiet, solve};

/// A whole block of half-width 2 and height 2 under an obstacle, in plane strain.
fn block(x: &[f64], obstacle: Value, indentation: f64, friction: Value) -> Problem {
    let text = json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grid": {"x": x, "y": [-2, -1, -0.5, -0.2, 0]}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
        "contacts": [{"boundary": "top", "obstacle": obstacle, "indentation": indentation, "friction": friction}],
    });
    problem(&text.to_string())
}

/// A contact whose tangential displacements are all prescribed, and whose nodes all touch, leaves no unknown free: errors
/// are stated all the same, by any algorithm.
#[test]
fn a_contact_without_free_unknowns_is_solved() {
    use solver::problem::{Algorithm, Support};
    let friction = json!({"coefficient": 0.3, "nonlocal_radius": 0.5, "elastic_slip": 1e-4});
    let mut held = block(
        &[-2.0, -1.0, 0.0, 1.0, 2.0],
        json!({"kind": "flat"}),
        0.05,
        friction,
    );
    let support = json!({"boundary": "top", "ux": 0});
    held.supports
        .push(serde_json::from_value::<Support>(support).unwrap());
    held.contacts[0].tangential_displacement = 0.02;
    for algorithm in [Algorithm::default(), Algorithm::Newton] {
        held.solver.algorithm = algorithm;
        let summary = solve(&held).summary;
        assert_eq!(summary.outcome, Outcome::Converged);
        assert!(summary.normal_force > 1.0 && summary.friction_force.abs() > 0.1);
    }
}

/// Cohesion acted where S is above zero by rounding, on one side and not on the other (the threshold itself is tested in
/// `friction/bound.rs`). What is symmetric stays so, to the tolerance of the iterations.
#[test]
fn cohesion_keeps_a_symmetric_problem_symmetric() {
    let line = |k: i32| 2.0 * f64::from(k.signum()) * (f64::from(k.abs()) / 20.0).powf(1.3);
    let x: Vec<f64> = (-20..=20).map(line).collect();
    for (k, radius) in (0..20).flat_map(|k| [(k, 0.1), (k, 0.3)]) {
        let friction = json!({"coefficient": 0.3, "nonlocal_radius": radius, "elastic_slip": 1e-4, "cohesion": 5});
        let obstacle = json!({"kind": "parabola", "radius": 8});
        let indentation = 0.01 + 0.002 * f64::from(k);
        let solution = solve(&block(&x, obstacle, indentation, friction));
        let stress = &solution.friction_profiles["top"].tangential_stress;
        let most = stress.iter().fold(0.0f64, |most, s| most.max(s.abs()));
        let mirrored = stress.iter().zip(stress.iter().rev());
        let off = mirrored.fold(0.0f64, |off, (a, b)| off.max((a + b).abs())) / most;
        assert!(
            off < 1e-9,
            "asymmetric by {off:.1e} at δ = {indentation}, ρ = {radius}"
        );
    }
}

/// A beam that touches an obstacle above its end without friction, and that the cohesion which acts as soon as it touches bends away
/// from it, has no equilibrium, whatever the radius: the cohesion is named, and not the stiffness.
#[test]
fn a_body_that_its_cohesion_lifts_off_has_no_equilibrium() {
    let beam = |radius: f64, cohesion: f64| {
        let text = json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"grid": {"x": [0, 0.5, 1, 1.5, 2], "y": [0, 0.25, 0.5]}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "left", "ux": 0, "uy": 0}],
            "contacts": [{
                "boundary": "top", "obstacle": {"kind": "flat", "from": 1}, "indentation": 0.001, "tangential_displacement": 0.02,
                "friction": {"coefficient": 0.3, "cohesion": cohesion, "nonlocal_radius": radius, "elastic_slip": 1e-3},
            }],
        });
        solver::solve(&problem(&text.to_string()), &mut quiet)
            .unwrap()
            .summary
    };
    for radius in [0.0, 0.5, 2.0] {
        let without = beam(radius, 0.0);
        assert!(without.outcome == Outcome::Converged && without.normal_force > 0.01);
        let lifted = beam(radius, 1.0);
        assert_eq!(lifted.outcome, Outcome::ContactCycling, "{radius}");
        let told = |code: WarningCode| lifted.warnings.iter().any(|w| w.code == code);
        assert!(told(WarningCode::CohesionJumps), "{:#?}", lifted.warnings);
        assert!(!told(WarningCode::OutOfBalance), "{:#?}", lifted.warnings);
    }
}

/// Refined twice, example 1 still has its peak of σ_t 7.6 % too high (formulation 5.3: 249.6), and nothing said so.
#[test]
fn a_peak_that_the_mesh_does_not_resolve_is_reported() {
    for (refine, verdict) in [(0, Verdict::Poor), (2, Verdict::Fair)] {
        let mut problem = example("rectangular_punch");
        problem.mesh.refine = Refine::Times(refine);
        let accuracy = solve(&problem).summary.accuracy.unwrap();
        let peak = |q: &&solver::solution::EstimatedQuantity| {
            q.quantity == QuantityName::PeakTangentialStress
        };
        let peak = accuracy.quantities.iter().find(peak).unwrap();
        let (off, stated) = ((peak.value - 249.6).abs(), peak.error.unwrap());
        assert!(off <= stated && stated <= 6.0 * off, "{off} for {stated}");
        assert_eq!(accuracy.verdict, verdict, "{:#?}", accuracy.reasons);
        let told = |reason: &String| reason.contains("peak_tangential_stress");
        assert!(accuracy.reasons.iter().any(told), "{:#?}", accuracy.reasons);
        println!("{verdict:?} {:#?}", accuracy.reasons);
    }
}

/// s counted from the first node that faces the obstacle: the same plate had its contact elsewhere under a line than under
/// a polyline that does not reach its corner. s is that of the boundary, whatever faces the obstacle; forces are equal.
#[test]
fn arc_length_counts_from_the_start_of_the_boundary() {
    let x: Vec<f64> = (-20..=20).map(|k| 0.1 * f64::from(k)).collect();
    let friction = json!({"coefficient": 0.3, "nonlocal_radius": 0.2, "elastic_slip": 1e-4});
    let table = |from: f64| {
        let at: Vec<f64> = x.iter().copied().filter(|x| *x >= from - 1e-9).collect();
        let gap: Vec<f64> = at.iter().map(|x| 0.0625 * x * x).collect();
        json!({"kind": "table", "x": at, "gap": gap})
    };
    let [whole, cut, named] = [
        (table(-2.0), None),
        (table(-1.5), None),
        (table(-2.0), Some(-1.5)),
    ]
    .map(|(mut obstacle, from)| {
        if let Some(from) = from {
            obstacle["from"] = json!(from);
        }
        solve(&block(&x, obstacle, 0.02, friction.clone()))
    });
    let profile = &whole.node_profiles["top"];
    assert!(
        profile
            .s
            .iter()
            .zip(&profile.x)
            .all(|(s, x)| (s - x - 2.0).abs() < 1e-12)
    );
    for part in [cut, named] {
        let (a, b) = (
            &whole.summary.contacts["top"],
            &part.summary.contacts["top"],
        );
        let ends = a.contact[0].iter().zip(&b.contact[0]);
        assert!(
            ends.into_iter().all(|(a, b)| (a - b).abs() < 1e-12),
            "{a:?} {b:?}"
        );
        let (p, q) = (
            a.peak_tangential_stress.as_ref(),
            b.peak_tangential_stress.as_ref(),
        );
        let (p, q) = (p.unwrap(), q.unwrap());
        assert!((p.s - q.s).abs() < 1e-9, "{p:?} {q:?}");
        let profile = &part.node_profiles["top"];
        assert!(
            profile
                .s
                .iter()
                .zip(&profile.x)
                .all(|(s, x)| (s - x - 2.0).abs() < 1e-12)
        );
        let close = (a.normal_force - b.normal_force).abs() < 1e-9 * a.normal_force;
        assert!(close, "{} {}", a.normal_force, b.normal_force);
    }
}

/// The work of friction was below zero in monotone pressing, −0.1 ε ∫|σ_t|: ∫ τ φ Δu counted what the pressure made of an
/// elastic slip without a work, and took it off when the slip receded. It is what sliding dissipates, and the elastic slip
/// with its stress: never negative, never less after more sliding, and in one increment that of the total law.
#[test]
fn the_work_of_friction_is_never_negative() {
    let pressed = |history: &str, elastic_slip: f64, steps: Value| {
        let mut problem = example("cylinder");
        problem.mesh.refine = Refine::Times(1);
        problem.steps = serde_json::from_value(steps).unwrap();
        let friction = problem.contacts[0].friction.as_mut().unwrap();
        friction.history = serde_json::from_value(json!(history)).unwrap();
        friction.elastic_slip = elastic_slip;
        solve(&problem)
    };
    for elastic_slip in [1e-2, 1e-3, 1e-4] {
        for increments in [1, 4, 16] {
            let pressed = pressed(
                "incremental",
                elastic_slip,
                json!([{"increments": increments}]),
            );
            let work = pressed.summary.friction_work;
            assert!(
                work > 0.0,
                "{work} at ε = {elastic_slip}, {increments} increments"
            );
        }
        let [once, total] =
            ["incremental", "total"].map(|history| pressed(history, elastic_slip, json!([{}])));
        let [once, total] = [once, total].map(|solution| solution.summary.friction_work);
        assert!((once / total - 1.0).abs() < 1e-12, "{once} {total}");
    }
    // in and out again, twice: dissipation only grows, and what the elastic slip adds is below ε ∫τ
    let steps = json!([{"increments": 4}, {"indentation": 0.5, "increments": 4}, {"increments": 4}, {"indentation": 0.2, "increments": 4}]);
    let cycled = pressed("incremental", 1e-3, steps);
    let ends = cycled.steps.windows(2);
    for (before, after) in ends.map(|pair| (&pair[0].summary, &pair[1].summary)) {
        let elastic = 1e-3 * before.friction_force;
        assert!(after.friction_work > before.friction_work - elastic);
    }
    let [first, last] = [0, 3].map(|k| cycled.steps[k].summary.friction_work);
    assert!(last > 1.05 * first, "{first} {last}");
}

/// A block of ν = 0 under a flat: nothing slides, friction is 1e-13 of the rounding of displacements, of any sign, and a
/// warning said that it oscillates. It is silent now, whatever ε, μ and the units; it is not where stick oscillates with a
/// friction force that is small only by its unit, and where μ is tiny nothing sticks and nothing oscillates:
/// friction is μN but for the 5 % that the average loses at the edge.
#[test]
fn friction_that_is_rounding_does_not_oscillate() {
    let oscillates = |summary: &Summary| {
        let mut codes = summary.warnings.iter().map(|w| w.code);
        codes.any(|code| code == WarningCode::OscillatingStick)
    };
    let scaled =
        |lines: &[f64], length: f64| -> Vec<f64> { lines.iter().map(|x| x * length).collect() };
    for (length, stiffness) in [(1.0, 1.0), (1e-6, 1e9), (1e6, 1e-9), (1e-6, 1e-9)] {
        for (slip, coefficient) in [
            (1e-2, 0.3),
            (1e-4, 0.3),
            (1e-8, 0.3),
            (1e-12, 0.3),
            (1e-4, 1e-13),
            (1e-4, 10.0),
        ] {
            let text = json!({
                "analysis": {"kind": "plane_strain"},
                "mesh": {"grid": {"x": scaled(&[-2.0, -1.5, -1.0, -0.5, 0.1, 0.5, 1.0, 1.6, 2.0], length), "y": scaled(&[-2.0, -1.0, -0.5, 0.0], length)}},
                "materials": [{"youngs_modulus": 1000.0 * stiffness, "poissons_ratio": 0}],
                "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
                "contacts": [{"boundary": "top", "obstacle": {"kind": "flat"}, "indentation": 0.2 * length,
                    "friction": {"coefficient": coefficient, "nonlocal_radius": 0.1 * length, "elastic_slip": slip * length}}],
            });
            let summary = solve(&problem(&text.to_string())).summary;
            assert!(summary.friction_force < 1e-12 * summary.normal_force);
            assert!(
                !oscillates(&summary),
                "ε = {slip}, μ = {coefficient}, lengths × {length}"
            );
        }
        let punch = |slip: f64, coefficient: f64| {
            let text = json!({
                "analysis": {"kind": "plane_strain"},
                "mesh": {"grid": {"x": scaled(&[0.0, 0.2, 0.35, 0.43, 0.475, 0.5, 0.6, 1.2, 4.0], length), "y": scaled(&[-4.0, -2.5, -1.5, -0.75, -0.35, -0.15, -0.05, 0.0], length)}},
                "materials": [{"youngs_modulus": 1000.0 * stiffness, "poissons_ratio": 0.3}],
                "supports": [{"boundary": "left", "ux": 0}, {"boundary": "bottom", "ux": 0, "uy": 0}],
                "contacts": [{"boundary": "top", "obstacle": {"kind": "flat", "from": 0, "to": 0.5 * length}, "indentation": 0.25 * length,
                    "friction": {"coefficient": coefficient, "nonlocal_radius": 0.01 * length, "elastic_slip": slip * length}}],
            });
            solve(&problem(&text.to_string())).summary
        };
        assert!(oscillates(&punch(1e-6, 0.3)) && !oscillates(&punch(1e-4, 0.3)));
        let tiny = punch(1e-6, 1e-13);
        let part = tiny.friction_force / (1e-13 * tiny.normal_force);
        assert!(!oscillates(&tiny) && part > 0.9 && part < 1.0, "{part}");
    }
}
