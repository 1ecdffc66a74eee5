//! Errors where stick is so small, or alternates so often, that a mesh cannot show it.

use fastrand::Rng;
use serde_json::{Value, json};
use solver::problem::{AccuracyMode, AdaptiveRefine, Elasticity, Problem, Refine};
use solver::solution::{
    EstimatedQuantity, NodeState, QuantityName, Solution, Verdict, WarningCode,
};

use crate::catalogue;
use crate::support::{problem as problem_of, quiet, solve};

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

/// Under the incremental law points that have slipped stay at ε from where they are anchored, to the last digit: they slip in
/// the profile, and in the intervals.
#[test]
fn what_slips_in_the_profile_slips_in_the_intervals() {
    let half = [
        0.02, 0.04, 0.06, 0.08, 0.1, 0.12, 0.16, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0,
    ];
    let mut x: Vec<f64> = half.iter().rev().map(|x| -x).collect();
    x.push(0.0);
    x.extend(half);
    for coefficient in [0.2, 0.25, 0.3, 0.35, 0.4, 0.45] {
        let problem = json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"grid": {"x": x, "y": [-16, -8, -4, -2, -1, -0.5, -0.25, -0.15, -0.1, -0.06, -0.03, 0]}, "refine": 1},
            "materials": [{"youngs_modulus": 210000, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
            "contacts": [{"boundary": "top", "obstacle": {"kind": "circle", "radius": 10}, "indentation": 0.0028,
                "tangential_displacement": 0.0005, "friction": {"coefficient": coefficient, "nonlocal_radius": 0.03,
                "elastic_slip": 1e-4, "history": "incremental"}}],
            "steps": [{"name": "press", "increments": 32, "spacing": "contact_width"},
                {"name": "drag", "tangential_displacement": 1, "increments": 8}],
        });
        let solution = solve(&problem_of(&problem.to_string()));
        let (contact, profile) = (
            &solution.summary.contacts["top"],
            &solution.node_profiles["top"],
        );
        for (s, state) in profile.s.iter().zip(&profile.state) {
            let inside = |all: &[[f64; 2]]| all.iter().any(|[from, to]| from < s && s < to);
            assert!(
                !inside(&contact.stick) || *state == NodeState::Stick,
                "{coefficient}: {s}"
            );
            assert!(
                !inside(&contact.slip) || *state == NodeState::Slip,
                "{coefficient}: {s}"
            );
        }
        assert!(
            !contact.stick.is_empty() && !contact.slip.is_empty(),
            "{coefficient}"
        );
    }
}

/// The values and stated errors of a kind of quantity.
fn stated(problem: &Value, name: QuantityName) -> Vec<(f64, Option<f64>)> {
    let summary = solve(&problem_of(&problem.to_string())).summary;
    let all = summary.accuracy.unwrap().quantities.into_iter();
    all.filter(|q| q.quantity == name)
        .map(|q| (q.value, q.error))
        .collect()
}

/// A roller on a block that is symmetric about x = 0.
fn roller(refine: u32, indentation: f64, x: &[f64], y: &[f64], friction: &Value) -> Value {
    json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grid": {"x": x, "y": y}, "refine": refine},
        "materials": [{"youngs_modulus": 210_000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "left", "ux": 0}, {"boundary": "bottom", "ux": 0, "uy": 0}],
        "contacts": [{"boundary": "top", "obstacle": {"kind": "circle", "radius": 10}, "indentation": indentation, "friction": friction}],
    })
}

/// At small friction only a part beside the line of symmetry sticks, shorter than an edge: there σ_t jumps, and the pressure
/// has a peak of its own, which a mesh four times as fine shows. These are the worst cases that were met; without what is added
/// for unresolved jumps the factor was 3.8.
#[test]
fn a_part_that_sticks_within_an_edge_is_in_the_stated_errors() {
    let fine: Vec<f64> = (0..=20).map(|k| 0.02 * f64::from(k)).collect();
    let x = [&fine[..], &[0.46, 0.56, 0.75, 1.1, 1.8, 3.0, 5.0, 8.0]].concat();
    let y = [
        -8.0, -5.0, -3.0, -1.8, -1.1, -0.75, -0.5, -0.35, -0.24, -0.16, -0.1, -0.06, -0.03, 0.0,
    ];
    for (refine, indentation, coefficient) in
        [(1, 0.00935, 0.05), (2, 0.00476, 0.056), (2, 0.0007, 0.1)]
    {
        let friction =
            json!({"coefficient": coefficient, "nonlocal_radius": 0, "elastic_slip": 1e-6});
        let at = |refine: u32, name: QuantityName| {
            stated(&roller(refine, indentation, &x, &y, &friction), name)[0]
        };
        for name in [
            QuantityName::PeakNormalStress,
            QuantityName::PeakTangentialStress,
            QuantityName::TangentialForce,
        ] {
            let ((value, error), (finer, _)) = (at(refine, name), at(refine + 2, name));
            let (off, error) = ((value - finer).abs(), error.unwrap());
            assert!(
                off <= error,
                "{coefficient} {name:?}: {value} ± {error}, finer {finer}"
            );
            assert!(
                error <= 0.12 * value.abs(),
                "{coefficient} {name:?}: {value} ± {error}"
            );
        }
    }
}

/// Rollers and balls pressed, or rollers also dragged, at small friction on random meshes: peaks and forces are within their stated
/// errors of those on a mesh four times as fine. `SIGNORINI_SMALL_FRICTION`: how many, 16 unless it is set.
#[test]
fn random_contacts_at_small_friction_are_within_their_stated_errors() {
    let count = std::env::var("SIGNORINI_SMALL_FRICTION");
    let count: u64 = count.map_or(16, |count| count.parse().unwrap());
    let fine: Vec<f64> = (0..=20).map(|k| 0.02 * f64::from(k)).collect();
    let half = [&fine[..], &[0.46, 0.56, 0.75, 1.1, 1.8, 3.0, 5.0, 8.0]].concat();
    let y = [
        -8.0, -5.0, -3.0, -1.8, -1.1, -0.75, -0.5, -0.35, -0.24, -0.16, -0.1, -0.06, -0.03, 0.0,
    ];
    let mirrored = half[1..].iter().rev().map(|x| -x);
    let whole: Vec<f64> = mirrored.chain(half.iter().copied()).collect();
    let (mut within, mut all) = (0, 0);
    for seed in 0..count {
        let mut dice = Rng::with_seed(seed);
        let mut between = |a: f64, b: f64| a * (b / a).powf(dice.f64());
        let (coefficient, elastic_slip) = (between(0.02, 0.2), between(3e-7, 1e-4));
        let (indentation, drag) = (between(6e-4, 0.011), between(2e-3, 0.2));
        let radius = [0.0, 0.0, 0.0, 0.01, 0.04][dice.usize(0..5)];
        let ratio = [0.1, 0.2, 0.3, 0.3, 0.45][dice.usize(0..5)];
        let friction = json!({"coefficient": coefficient, "nonlocal_radius": radius, "elastic_slip": elastic_slip});
        let dragged = seed % 3 == 2;
        let x = if dragged { &whole } else { &half };
        let refine = if dragged { 1 } else { dice.u32(1..3) };
        let at = |refine: u32| {
            let mut problem = roller(refine, indentation, x, &y, &friction);
            problem["materials"][0]["poissons_ratio"] = json!(ratio);
            let supports = problem["supports"].as_array_mut().unwrap();
            if dragged {
                supports.remove(0);
                problem["contacts"][0]["tangential_displacement"] = json!(drag * indentation);
            } else if seed % 2 == 0 {
                supports.remove(0);
                problem["analysis"]["kind"] = json!("axisymmetric");
            }
            let summary = solve(&problem_of(&problem.to_string())).summary;
            summary.accuracy.unwrap().quantities
        };
        let (own, finer) = (at(refine), at(refine + 2));
        for name in [
            QuantityName::PeakNormalStress,
            QuantityName::PeakTangentialStress,
            QuantityName::TangentialForce,
        ] {
            let first = |all: &[EstimatedQuantity]| {
                let first = all.iter().find(|q| q.quantity == name).unwrap();
                (first.value, first.error)
            };
            let ((value, Some(error)), (finer, _)) = (first(&own), first(&finer)) else {
                continue;
            };
            // of two equal peaks of opposite sign either may be the larger
            let off = match name {
                QuantityName::PeakTangentialStress => (value.abs() - finer.abs()).abs(),
                _ => (value - finer).abs(),
            };
            all += 1;
            within += usize::from(off <= error);
            assert!(
                off <= 1.4 * error,
                "{seed} {name:?}: {value} ± {error}, finer {finer}"
            );
        }
    }
    assert!(
        100 * within >= 95 * all && all > 2 * count as usize,
        "{within} of {all}"
    );
}

/// The contact grows from node to node: without averaging σ_t at the integration points has a ripple where the body sticks, and
/// its peak is not that of the curve. By a code for half-spaces, and with points at the nodes, it is 255.3.
#[test]
fn the_ripple_of_an_incremental_solution_is_in_the_error_of_its_peak() {
    let x = [
        0.0, 0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.07, 0.08, 0.09, 0.1, 0.11, 0.12, 0.14, 0.16,
        0.2, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0,
    ];
    let y = [
        -8.0, -4.0, -2.0, -1.0, -0.5, -0.25, -0.15, -0.1, -0.06, -0.03, 0.0,
    ];
    let solved = |radius: f64, increments: u32, name: QuantityName| {
        let friction = json!({"coefficient": 0.3, "nonlocal_radius": radius, "elastic_slip": 2.5e-6, "history": "incremental"});
        let mut problem = roller(2, 0.0025, &x, &y, &friction);
        problem["steps"] = json!([{"increments": increments, "spacing": "contact_width"}]);
        stated(&problem, name)
    };
    for increments in [32, 48] {
        let (value, error) = solved(0.0, increments, QuantityName::PeakTangentialStress)[0];
        assert!(
            (value - 255.3).abs() <= error.unwrap(),
            "{increments}: {value} ± {error:?}"
        );
    }
    // friction may reach its bound at a node: that end has an error, too
    for (radius, increments, end) in [(0.01, 64, 0.0690), (0.01, 128, 0.0690), (0.2, 32, 0.0506)] {
        let ends = solved(radius, increments, QuantityName::StickEnd);
        assert_eq!(ends.len(), 1, "{radius} {increments}: {ends:?}");
        let (value, error) = (ends[0].0, ends[0].1.unwrap());
        assert!(
            (value - end).abs() <= error && error < 0.01,
            "{radius} {increments}: {value} ± {error}"
        );
    }
}

/// A parabola, pressed in many increments and then dragged a little, on edges of 1/6 that `refine` halves.
fn dragged_parabola(refine: u32, center: f64, drag: f64, points: &str) -> Value {
    let mut x: Vec<f64> = (0..=7).map(|k| f64::from(k) / 6.0).collect();
    let mut step = 1.0 / 6.0;
    while x[x.len() - 1] < 30.0 {
        step *= 1.6;
        x.push(x[x.len() - 1] + step);
    }
    let y: Vec<f64> = x.iter().rev().map(|x| -x).collect();
    let x: Vec<f64> = [&y[..y.len() - 1], &x].concat();
    json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grid": {"x": x, "y": y}, "refine": refine},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0}],
        "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
        "contacts": [{
            "boundary": "top",
            "obstacle": {"kind": "parabola", "radius": 40, "center": center},
            "indentation": 0.025,
            "tangential_displacement": drag,
            "friction": {"coefficient": 1, "nonlocal_radius": 0.1, "elastic_slip": 5e-4, "history": "incremental", "points": points},
        }],
        "steps": [
            {"increments": 64, "spacing": "contact_width", "tangential_displacement": 0},
            {"increments": 8, "tangential_displacement": 1},
        ],
    })
}

/// With averaging, too, the ripple lifts the peak, which then touches the bound: it is in the error, and told. Points at the
/// nodes and meshes up to four times as fine lead to 5.8.
#[test]
fn the_ripple_beside_an_end_of_stick_is_in_the_error_and_told() {
    let right = 5.8;
    for refine in [1, 2] {
        let problem = dragged_parabola(refine, 0.23, -0.003, "gauss3");
        let solution = solve(&problem_of(&problem.to_string()));
        let peak = of_kind(&solution, QuantityName::PeakTangentialStress)[0];
        let error = peak.error.unwrap();
        assert!((peak.value + right).abs() <= error, "{refine}: {peak:?}");
        let told = solution.summary.warnings.iter();
        let mut told = told.filter(|w| w.code == WarningCode::OscillatingStick);
        assert!(
            told.next()
                .is_some_and(|w| w.message.contains("rises and falls within each edge"))
        );
    }
}

/// Pressed alone, or dragged a little, an obstacle has nearly the same σ_t at both ends of stick: which is larger is chance, and told;
/// of one that is dragged far nothing is.
#[test]
fn a_peak_whose_sign_is_not_known_is_told() {
    let told = |center: f64, drag: f64| {
        let problem = dragged_parabola(1, center, drag, "nodal");
        let warnings = solve(&problem_of(&problem.to_string())).summary.warnings;
        warnings
            .iter()
            .any(|w| w.code == WarningCode::PeakSignUnknown)
    };
    assert!(told(0.02, 0.0));
    assert!(told(0.0, 0.0));
    assert!(!told(0.0, 0.02));
}

/// A part that sticks on less than an edge, between slip to one side, is not on finer meshes: its ends have no error.
#[test]
fn stick_on_less_than_an_edge_has_no_stated_ends() {
    let problem = json!({
        "analysis": {"kind": "plane_stress", "thickness": 2},
        "mesh": {
            "grid": {"x": [0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.2, 2, 4], "y": [-4, -2, -1, -0.5, -0.25, -0.1, 0]},
            "refine": {"tolerance": 0.01},
        },
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.218}],
        "supports": [{"boundary": "left", "ux": 0}, {"boundary": "bottom", "ux": 0, "uy": 0}],
        "contacts": [{
            "boundary": "top",
            "obstacle": {"kind": "wedge", "angle": 2.613125700489011},
            "indentation": 0.0432,
            "friction": {"coefficient": 0.063, "nonlocal_radius": 0.05, "elastic_slip": 0.00011031350622729267, "history": "incremental"},
        }],
        "steps": [{"increments": 16}],
    });
    let solution = solve(&problem_of(&problem.to_string()));
    let stick = &solution.summary.contacts["top"].stick;
    assert!(
        stick.len() > 1,
        "the sliver is gone, and with it this test: {stick:?}"
    );
    for end in of_kind(&solution, QuantityName::StickEnd) {
        assert_eq!(end.error, None, "{end:?}");
    }
    assert_eq!(solution.summary.accuracy.unwrap().verdict, Verdict::Fair);
}
