//! What `Model::new` refuses, all at once, and what the solver says of what it accepts.

use solver::error::{SolveError, Violation};
use solver::observer::Progress;
use solver::problem::{Contact, Elasticity, MeshSource, Problem};
use solver::solution::{Verdict, Warning, WarningCode};

use crate::support::{example, problem, solve, watching};

pub(crate) fn violations(problem: &Problem) -> Vec<(String, String)> {
    pairs(solver::check(problem, None).expect_err("a faulty problem was accepted"))
}

/// Pointer and reason of each.
pub(crate) fn pairs(list: Vec<Violation>) -> Vec<(String, String)> {
    list.iter().for_each(|Violation { expected, hint, .. }| {
        assert!(!expected.is_empty() && !hint.is_empty())
    });
    let pair = |v: Violation| (v.pointer, v.reason.to_string());
    list.into_iter().map(pair).collect()
}

pub(crate) fn pair(pointer: &str, reason: &str) -> (String, String) {
    (pointer.to_owned(), reason.to_owned())
}

/// A hundred violations are as many as are listed; what comes after them is refused all the same.
#[test]
fn a_fault_after_a_full_list_is_still_an_error() {
    // this used to panic: the table, alone on its boundary, was evaluated as if it had points
    let mut p = example("rectangular_punch");
    let bad = Contact {
        obstacle: serde_json::from_str(r#"{"kind": "circle", "radius": -1}"#).unwrap(),
        ..p.contacts[0].clone()
    };
    p.contacts.splice(0..0, vec![bad; 100]);
    p.contacts[100].boundary = "left".to_owned();
    p.contacts[100].obstacle =
        serde_json::from_str(r#"{"kind": "table", "x": [], "gap": []}"#).unwrap();
    let list = solver::check(&p, None).unwrap_err();
    assert_eq!(list.len(), 100);
    assert!(
        list[99].hint.contains(" more violations.)"),
        "{}",
        list[99].hint
    );

    // and this mesh was taken for one without radii below zero
    let mut p = example("cylinder_on_end");
    p.contacts = vec![p.contacts[0].clone(); 100];
    for contact in &mut p.contacts {
        contact.friction.as_mut().unwrap().elastic_slip = -1.0;
    }
    let grid = p.mesh.grid_mut().unwrap();
    grid.x.iter_mut().for_each(|x| *x -= 100.0);
    let list = solver::check(&p, None).unwrap_err();
    // the mesh is the last that is looked at: without one nothing else can be
    assert!(
        list[99].hint.ends_with("(1 more violation.)"),
        "{}",
        list[99].hint
    );
}

#[test]
fn all_numbers_out_of_range_are_reported_at_once() {
    let mut p = example("rectangular_punch");
    p.materials[0].elasticity = Elasticity::Isotropic {
        youngs_modulus: -1.0,
        poissons_ratio: 0.5,
    };
    p.solver.tolerance = 2.0;
    p.solver.max_iterations = 0;
    let friction = p.contacts[0].friction.as_mut().unwrap();
    (
        friction.coefficient,
        friction.nonlocal_radius,
        friction.elastic_slip,
    ) = (Some(-0.1), Some(-1.0), 0.0);
    p.supports[0].boundary = Some("lfet".to_owned());
    let found = violations(&p);
    for pointer in [
        "/materials/0/youngs_modulus",
        "/materials/0/poissons_ratio",
        "/solver/tolerance",
        "/solver/max_iterations",
        "/contacts/0/friction/coefficient",
        "/contacts/0/friction/nonlocal_radius",
        "/contacts/0/friction/elastic_slip",
    ] {
        assert!(
            found.contains(&pair(pointer, "out_of_range")),
            "{pointer} in {found:?}"
        );
    }
    assert!(found.contains(&pair("/supports/0/boundary", "unknown_boundary")));
    assert_eq!(found.len(), 8, "{found:?}");
}

#[test]
fn nan_and_infinity_are_refused_everywhere() {
    let mut p = example("cylinder");
    p.contacts[0].indentation = f64::NAN;
    p.mesh.grid_mut().unwrap().x[3] = f64::INFINITY;
    // in the order of the problem's fields
    assert_eq!(
        violations(&p),
        [
            pair("/mesh/grid/x/3", "not_finite"),
            pair("/contacts/0/indentation", "not_finite")
        ]
    );
    // those that are not listed are counted
    p.mesh.grid_mut().unwrap().x = vec![f64::NAN; 250];
    let list = solver::check(&p, None).unwrap_err();
    assert_eq!(list.len(), 100);
    assert!(
        list[99].hint.ends_with("(151 more violations.)"),
        "{}",
        list[99].hint
    );
}

#[test]
fn a_body_free_to_move_is_refused_with_node_and_direction() {
    let mut p = example("rectangular_punch");
    p.supports.remove(1); // the base: now only ux at the side
    p.contacts.clear();
    let list = solver::check(&p, None).unwrap_err();
    assert_eq!(list.len(), 1);
    assert!(
        list[0].got.contains("along y") && list[0].got.contains("node"),
        "{}",
        list[0].got
    );
    let mut round = example("cylinder_on_end");
    round.supports.remove(1);
    round.contacts.clear();
    assert!(
        solver::check(&round, None).unwrap_err()[0]
            .got
            .contains("along the axis")
    );
    // on the axis u_r = 0 needs no support: the same values without it
    let mut bare = example("cylinder_on_end");
    bare.supports.remove(0);
    assert_eq!(
        solve(&bare).summary.normal_force,
        solve(&example("cylinder_on_end")).summary.normal_force
    );
    let mut pinned = example("rectangular_punch");
    pinned.supports.clear();
    pinned.contacts.clear();
    assert!(
        solver::check(&pinned, None).unwrap_err()[0]
            .got
            .contains("along x")
    );
}

/// Contact could hold these bodies; it does not, since nothing presses them against the obstacle. Peers
/// answer "converged" here, with forces of rounding.
#[test]
fn a_body_not_held_by_its_contacts_is_an_error_with_its_motion() {
    for (name, motion) in [
        ("rectangular_punch", "along y"),
        ("cylinder_on_end", "along the axis"),
    ] {
        let mut p = example(name);
        p.supports.remove(1);
        let refused = solver::check(&p, None).err().unwrap();
        assert!(
            refused[0].got.contains(&format!(
                "{motion} from the contact that holds it on one side only"
            )),
            "{name}"
        );
        // a load along the motion may press or pull, as may those of some load steps: this one pulls
        p.loads = serde_json::from_value(serde_json::json!([{"body_force": [0, -1]}])).unwrap();
        assert!(solver::check(&p, None).is_ok(), "{name}");
        match solver::solve(&p, &mut ()) {
            Err(SolveError::Unheld { motion: found, .. }) => assert_eq!(found, motion, "{name}"),
            other => panic!("{name}: {:?}", other.map(|s| s.summary)),
        }
    }
}

/// A block on a rigid flat, pressed down from above and held by nothing else: the pressure below is
/// that above, to rounding.
#[test]
fn a_block_held_only_by_contact_is_in_equilibrium() {
    for friction in [
        "null",
        r#"{"coefficient": 0.3, "nonlocal_radius": 0.1, "elastic_slip": 1e-4}"#,
    ] {
        let json = format!(
            r#"{{"analysis": {{"kind": "plane_strain"}}, "mesh": {{"grid": {{"x": [0, 0.4, 1, 2], "y": [0, 0.7, 1]}}}},
                "materials": [{{"youngs_modulus": 1000, "poissons_ratio": 0.3}}], "loads": [{{"boundary": "top", "pressure": 5}}],
                "supports": [{{"boundary": "left", "ux": 0}}],
                "contacts": [{{"boundary": "bottom", "obstacle": {{"kind": "flat"}}, "indentation": -0.125, "friction": {friction}}}]}}"#
        );
        let solution = solve(&problem(&json.replace(r#", "friction": null"#, "")));
        assert!((solution.summary.normal_force - 10.0).abs() < 1e-9);
        assert!(solution.summary.residuals.equilibrium < 1e-9);
        if friction == "null" {
            let stress = &solution.node_profiles["bottom"].normal_stress;
            assert!(stress.iter().all(|s| (s + 5.0).abs() < 1e-9), "{stress:?}");
        }
    }
}

/// Pushed sideways, nothing but friction holds it: it sticks below μ N, and is not held above.
#[test]
fn a_block_held_only_by_friction_sticks_or_slides_away() {
    let solve = |push: f64| {
        let json = format!(
            r#"{{"analysis": {{"kind": "plane_strain"}}, "mesh": {{"grid": {{"x": [0, 1, 2, 3, 4], "y": [0, 0.5, 1]}}}},
                "materials": [{{"youngs_modulus": 1000, "poissons_ratio": 0}}],
                "loads": [{{"boundary": "top", "traction": [{push}, -5]}}],
                "contacts": [{{"boundary": "bottom", "obstacle": {{"kind": "flat"}},
                    "friction": {{"coefficient": 0.5, "nonlocal_radius": 0, "elastic_slip": 1e-4}}}}]}}"#
        );
        solver::solve(&problem(&json), &mut ())
    };
    let held = solve(1.0).unwrap().summary;
    assert!(held.converged, "{held:#?}");
    // t of a bottom edge runs along −x
    assert!((held.tangential_force - 4.0).abs() < 1e-8 && (held.normal_force - 20.0).abs() < 1e-8);
    let gone = solve(4.0);
    assert!(
        gone.as_ref().is_err() || !gone.as_ref().unwrap().summary.converged,
        "{gone:?}"
    );
}

#[test]
fn an_obstacle_that_covers_no_edge_is_refused_and_one_that_ends_beside_a_node_gives_a_warning() {
    let mut p = example("rectangular_punch");
    let obstacle = |json: &str| serde_json::from_str(json).unwrap();
    p.contacts[0].obstacle = obstacle(r#"{"kind": "flat", "from": 10, "to": 11}"#);
    assert_eq!(
        violations(&p),
        [pair("/contacts/0/obstacle", "covers_nothing")]
    );
    p.contacts[0].obstacle = obstacle(r#"{"kind": "flat", "from": 0, "to": 0.500001}"#);
    let codes: Vec<_> = solver::check(&p, None)
        .unwrap()
        .warnings
        .into_iter()
        .map(|w| w.code)
        .collect();
    assert!(codes.contains(&WarningCode::ObstacleCutsEdge), "{codes:?}");
    p.contacts[0].obstacle = obstacle(r#"{"kind": "circle", "radius": -8}"#);
    assert!(violations(&p).contains(&pair("/contacts/0/obstacle/radius", "out_of_range")));
}

#[test]
fn a_contact_with_a_corner_gives_a_warning() {
    let mut p = example("sheet");
    let part = p.mesh.boundaries.get_mut("taper").unwrap();
    (part.x, p.mesh.grid_mut().unwrap().top) =
        (None, Some(vec![[0.0, 1.0], [2.0, 0.4], [5.0, 1.0]]));
    p.contacts[0].obstacle =
        serde_json::from_str(r#"{"kind": "flat", "from": 0.5, "to": 4}"#).unwrap();
    let warnings = solver::check(&p, None).unwrap().warnings;
    let turn = warnings
        .iter()
        .find(|w| w.code == WarningCode::ContactTurns)
        .expect("no warning");
    assert!(turn.message.contains("28° at (2, 0.4)"), "{}", turn.message);
    assert!(
        solver::check(&example("sheet"), None)
            .unwrap()
            .warnings
            .iter()
            .all(|w| w.code != WarningCode::ContactTurns)
    );
}

#[test]
fn inverted_elements_are_reported_with_their_gauss_point() {
    let p = problem(
        r#"{"analysis": {"kind": "plane_strain"}, "materials": [{"youngs_modulus": 1, "poissons_ratio": 0}],
            "mesh": {"inline": {
                "nodes": [[0,0],[1,0],[1,1],[0,1],[0.5,0],[1,0.5],[0.5,1],[0,0.5]],
                "elements": [[0,3,2,1,7,6,5,4]], "boundaries": {"b": [[0,1,4]]}}},
            "supports": [{"boundary": "b", "ux": 0, "uy": 0}]}"#,
    );
    let list = solver::check(&p, None).unwrap_err();
    assert_eq!(
        (&list[0].pointer[..], list[0].reason.as_str()),
        ("/mesh/inline/elements/0", "inverted_element")
    );
    assert!(list[0].got.contains("Gauss point 0"), "{}", list[0].got);
}

#[test]
fn supports_that_contradict_each_other_or_hold_the_body_inside_the_obstacle_are_refused() {
    let mut p = example("rectangular_punch");
    p.supports[0].ux = Some(solver::problem::BoundaryValue::Constant(0.1));
    assert_eq!(violations(&p), [pair("/supports/1/ux", "conflict")]);
    let mut p = example("rectangular_punch");
    p.supports
        .push(serde_json::from_str(r#"{"boundary": "top", "uy": 0}"#).unwrap());
    assert_eq!(
        violations(&p),
        [pair("/contacts/0/indentation", "impossible")]
    );
}

/// Degenerate but valid: nothing left to solve, or nothing but contact unknowns.
#[test]
fn a_body_held_everywhere_and_one_element_alone_are_solved() {
    let text = |supports: &str, contacts: &str| {
        format!(
            r#"{{"analysis": {{"kind": "plane_strain"}}, "materials": [{{"youngs_modulus": 1000, "poissons_ratio": 0.3}}],
                "mesh": {{"grid": {{"x": [0, 1], "y": [0, 1]}}}}, "supports": [{supports}], "contacts": [{contacts}]}}"#
        )
    };
    let held = |name: &str| format!(r#"{{"boundary": "{name}", "ux": 0, "uy": 0}}"#);
    let all = ["left", "right", "top", "bottom"].map(held).join(",");
    let rest = solve(&problem(&text(&all, ""))).summary;
    assert_eq!(
        (rest.dofs, rest.normal_force.to_bits()),
        (0, 0),
        "zero, and not minus zero"
    );
    let apart = r#"{"boundary": "top", "obstacle": {"kind": "flat"}, "indentation": -0.1}"#;
    assert_eq!(solve(&problem(&text(&all, apart))).summary.contact_dofs, 0);
    let pressed = r#"{"boundary": "top", "obstacle": {"kind": "flat"}, "indentation": 0.1,
        "friction": {"coefficient": 0.3, "nonlocal_radius": 0.1, "elastic_slip": 1e-4}}"#;
    let summary = solve(&problem(&text(&held("bottom"), pressed))).summary;
    assert!(
        summary.normal_force > 100.0 && summary.tangential_force.abs() < 1e-10,
        "{summary:?}"
    );
}

#[test]
fn a_contact_that_never_engages_is_reported_with_its_smallest_gap() {
    let mut p = example("cylinder");
    p.contacts[0].indentation = -0.125;
    let solution = solve(&p);
    assert_eq!(solution.summary.normal_force, 0.0);
    let warning = solution
        .summary
        .warnings
        .iter()
        .find(|w| w.code == WarningCode::NoContact)
        .expect("no warning");
    let (gap, needed) = ("gap is 1.250000e-1", "above 0.000000e0");
    assert!(
        warning.message.contains(gap) && warning.message.contains(needed),
        "{}",
        warning.message
    );
    assert!(solution.summary.contacts["top"].contact.is_empty());
    let accuracy = solution.summary.accuracy.as_ref().unwrap();
    assert_eq!(
        accuracy.verdict,
        Verdict::Poor,
        "nothing touches: {accuracy:?}"
    );
    assert!(
        accuracy.reasons[0].contains("`no_contact`"),
        "{:?}",
        accuracy.reasons
    );
}

/// Of two contacts one stays open, which may be meant: the other's numbers are as good as they were.
#[test]
fn one_of_two_contacts_that_never_engages_limits_the_verdict() {
    let mut p = example("cylinder");
    p.mesh.refine = serde_json::from_str(r#"{"tolerance": 0.005}"#).unwrap();
    let mut stop = p.contacts[0].clone();
    stop.boundary = "right".into();
    stop.obstacle = serde_json::from_str(r#"{"kind": "flat", "along": "arc_length"}"#).unwrap();
    stop.indentation = -1.0;
    stop.friction = None;
    stop.tangential_displacement = 0.0;
    p.contacts.push(stop);
    let solution = solve(&p);
    let codes = solution.summary.warnings.iter().map(|w| w.code);
    assert_eq!(
        codes.filter(|code| *code == WarningCode::NoContact).count(),
        1
    );
    assert!(solution.summary.normal_force > 0.0);
    assert_eq!(
        solution.summary.accuracy.as_ref().unwrap().verdict,
        Verdict::Fair
    );
}

#[test]
fn an_iteration_limit_is_an_outcome_with_its_history() {
    let mut p = example("cylinder");
    p.solver.max_iterations = 2;
    let solution = solver::solve(&p, &mut ()).unwrap();
    assert_eq!(
        solution.summary.outcome,
        solver::solution::Outcome::NotConverged
    );
    assert_eq!(
        solution.history.len(),
        3,
        "one frictionless row and two sweeps"
    );
    assert!(
        !solution.summary.converged && solution.summary.residuals.friction > p.solver.tolerance
    );
}

#[test]
fn an_observer_that_stops_gets_the_last_state() {
    let mut rows = 0;
    let mut third = watching(|progress| {
        rows += u32::from(matches!(progress, Some(Progress::Iteration(_))));
        rows == 3
    });
    let solution = solver::solve(&example("cylinder"), &mut third).unwrap();
    assert_eq!(
        (solution.summary.outcome, solution.history.len()),
        (solver::solution::Outcome::Canceled, 3)
    );
}

#[test]
fn an_observer_that_stops_before_the_first_state_gets_an_error() {
    let end = solver::solve(&example("cylinder"), &mut watching(|_| true));
    assert_eq!(end, Err(solver::error::SolveError::Stopped));
}

/// What a running job can show of a problem in steps: every step but the last, as the solution of
/// the problem that ends there has it.
#[test]
fn an_observer_gets_the_solution_so_far_after_every_step_but_the_last() {
    let mut p = example("cylinder");
    let step = |indentation: f64, increments: u32| solver::problem::Step {
        indentation,
        increments,
        ..solver::problem::Step::whole()
    };
    p.steps = vec![step(0.3, 2), step(0.6, 1), step(1.0, 1)];
    let mut received = Vec::new();
    let solution = solver::solve(&p, &mut |progress: Progress<'_>| {
        if let Progress::Step(so_far) = progress {
            received.push(so_far.clone());
        }
    })
    .unwrap();
    assert_eq!(received.len(), 2);
    for (k, so_far) in received.iter().enumerate() {
        assert_eq!(so_far.fields, solver::solution::Fields::default());
        assert_eq!(so_far.steps, solution.steps[..=k]);
        let rows = so_far.history.len();
        assert_eq!(so_far.history, solution.history[..rows]);
        let mut p = p.clone();
        p.steps.truncate(k + 1);
        let mut shorter = solve(&p);
        // only the end of the last step is assessed
        assert!(shorter.summary.accuracy.take().is_some());
        let of_errors = |warning: &Warning| warning.code == WarningCode::PeakSignUnknown;
        shorter
            .summary
            .warnings
            .retain(|warning| !of_errors(warning));
        assert_eq!(so_far.summary, shorter.summary);
        assert_eq!(so_far.node_profiles, shorter.node_profiles);
        assert_eq!(so_far.friction_profiles, shorter.friction_profiles);
    }
    assert!(!solution.fields.ux.is_empty());

    let mut received = 0;
    for steps in [vec![], vec![step(1.0, 3)]] {
        p.steps = steps;
        solver::solve(&p, &mut |progress: Progress<'_>| {
            received += u32::from(matches!(progress, Progress::Step(_)));
        })
        .unwrap();
    }
    assert_eq!(received, 0, "one step has no partial result");
}

/// A mechanism must not come back as converged: two squares that touch in a corner only.
#[test]
fn parts_that_touch_in_a_corner_only_do_not_hold_each_other() {
    let p = problem(
        r#"{"analysis": {"kind": "plane_strain"}, "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "mesh": {"inline": {
                "nodes": [[0,0],[1,0],[1,1],[0,1],[0.5,0],[1,0.5],[0.5,1],[0,0.5],
                          [2,1],[2,2],[1,2],[1.5,1],[2,1.5],[1.5,2],[1,1.5]],
                "elements": [[0,1,2,3,4,5,6,7], [2,8,9,10,11,12,13,14]],
                "boundaries": {"base": [[0,1,4]], "top": [[10,9,13]]}}},
            "supports": [{"boundary": "base", "ux": 0, "uy": 0}],
            "loads": [{"boundary": "top", "pressure": [1, 2]}]}"#,
    );
    assert_eq!(violations(&p), [pair("/supports", "free_body")]);
}

/// What a contact's friction leaves open is the frictionless body, wherever the friction law starts.
#[test]
fn friction_that_never_acts_changes_nothing() {
    let mut p = example("sheet");
    p.contacts[0].indentation = -1.0;
    let with = solve(&p);
    p.contacts[0].friction = None;
    let without = solve(&p);
    assert_eq!(with.fields, without.fields);
    assert_eq!(
        with.node_profiles["taper"].tangential_displacement,
        without.node_profiles["taper"].tangential_displacement
    );
}

/// The row of history that an observer stops at and the result it gets are one state.
#[test]
fn a_solution_stopped_at_its_first_row_is_the_state_of_that_row() {
    for name in ["rectangular_punch", "sheet"] {
        let mut first = watching(|progress| matches!(progress, Some(Progress::Iteration(_))));
        let solution = solver::solve(&example(name), &mut first).unwrap();
        assert_eq!(solution.history.len(), 1);
        assert_eq!(
            solution.history[0].force.normal, solution.summary.normal_force,
            "{name}"
        );
    }
}

/// ρ far below the mesh's rounding is Coulomb's law; ρ far beyond the contact is refused.
#[test]
fn a_tiny_radius_is_local_and_a_huge_one_is_refused() {
    let with_radius = |radius: f64| {
        let mut p = example("rectangular_punch");
        p.contacts[0].friction.as_mut().unwrap().nonlocal_radius = Some(radius);
        p
    };
    let local = solve(&with_radius(0.0)).summary.tangential_force;
    for radius in [1e-300, 1e-12] {
        assert_eq!(solve(&with_radius(radius)).summary.tangential_force, local);
    }
    assert!((solve(&with_radius(1e-6)).summary.tangential_force / local - 1.0).abs() < 1e-3);
    for radius in [6.0, 1e12, 1e300] {
        let pointer = "/contacts/0/friction/nonlocal_radius";
        assert_eq!(
            violations(&with_radius(radius)),
            [pair(pointer, "out_of_range")]
        );
    }
}

/// A square with one midside moved along its side.
fn square_with_midside(x: f64, refine: u32) -> Problem {
    problem(&format!(
        r#"{{"analysis": {{"kind": "plane_strain"}}, "materials": [{{"youngs_modulus": 1000, "poissons_ratio": 0.3}}],
            "mesh": {{"refine": {refine}, "inline": {{
                "nodes": [[0,0],[1,0],[1,1],[0,1],[0.5,0],[1,0.5],[{x},1],[0,0.5]],
                "elements": [[0,1,2,3,4,5,6,7]], "boundaries": {{"base": [[0,1,4]], "top": [[3,2,6]]}}}}}},
            "supports": [{{"boundary": "base", "ux": 0, "uy": 0}}],
            "contacts": [{{"boundary": "top", "obstacle": {{"kind": "flat"}}, "indentation": 0.1}}]}}"#
    ))
}

#[test]
fn a_midside_far_off_its_middle_is_refused() {
    for x in [0.24, 0.25, 0.76, 1.2] {
        for refine in 0..3 {
            let found = violations(&square_with_midside(x, refine));
            assert!(
                found.contains(&pair("/mesh/inline/elements/0", "inverted_element")),
                "{x}: {found:?}"
            );
        }
    }
    let force = |refine| {
        solve(&square_with_midside(0.4, refine))
            .summary
            .normal_force
    };
    assert!(
        (force(1) / force(2) - 1.0).abs() < 0.05,
        "a gently moved one converges"
    );
}

#[test]
fn contacts_without_area_normal_or_coordinate_are_refused() {
    let mut axis = example("cylinder_on_end");
    axis.supports.remove(0);
    axis.contacts[0].boundary = "left".to_owned();
    axis.contacts[0].obstacle = serde_json::from_str(r#"{"kind": "flat"}"#).unwrap();
    assert!(violations(&axis).contains(&pair("/contacts/0/boundary", "no_area")));

    let mut wall = example("rectangular_punch");
    wall.contacts[0].boundary = "right".to_owned();
    wall.contacts[0].obstacle = serde_json::from_str(r#"{"kind": "circle", "radius": 8}"#).unwrap();
    let found = violations(&wall);
    assert!(
        found.contains(&pair("/contacts/0/obstacle/along", "not_monotonic")),
        "{found:?}"
    );

    let mut corner = square_with_midside(0.5, 0);
    let MeshSource::Inline(inline) = &mut corner.mesh.source else {
        panic!("it is written out");
    };
    inline
        .boundaries
        .insert("top".to_owned(), vec![[3, 2, 6], [2, 1, 5]]);
    assert!(violations(&corner).contains(&pair("/contacts/0/boundary", "turns_corner")));
}

/// A hostile problem costs little: many violations are counted, long lists refused.
#[test]
fn long_lists_of_faults_are_shortened() {
    let mut p = example("rectangular_punch");
    let stray = solver::problem::Support {
        boundary: Some("nowhere".to_owned()),
        ..p.supports[0].clone()
    };
    p.supports.extend(std::iter::repeat_n(stray.clone(), 500));
    let list = solver::check(&p, None).unwrap_err();
    assert_eq!(list.len(), 100);
    assert!(list[99].hint.contains("400 more"), "{}", list[99].hint);
    p.supports.extend(std::iter::repeat_n(stray, 5000));
    assert_eq!(violations(&p), [pair("/supports", "too_many")]);

    let faults = vec![r#"{"a": 0}"#; 20_000].join(",");
    let list = files::parse(&format!(r#"{{"supports": [{faults}]}}"#)).unwrap_err();
    assert_eq!(list.len(), 100);
}

/// Far from the origin differences of coordinates lose digits: the inner problem must notice that
/// no more can be had, instead of trying to the end.
#[test]
fn a_body_far_from_the_origin_needs_few_inner_steps() {
    let mut p = example("rectangular_punch");
    let shift = 1e5;
    let grid = p.mesh.grid_mut().unwrap();
    grid.x
        .iter_mut()
        .chain(&mut grid.y)
        .for_each(|c| *c += shift);
    p.contacts[0].obstacle = serde_json::from_str(&format!(
        r#"{{"kind": "flat", "from": {shift}, "to": {}}}"#,
        shift + 0.5
    ))
    .unwrap();
    let solution = solve(&p);
    let steps: u32 = solution.history.iter().map(|row| row.inner).sum();
    assert!(steps < 60, "{steps} inner steps");
    let home = solve(&example("rectangular_punch")).summary.normal_force;
    assert!((solution.summary.normal_force / home - 1.0).abs() < 1e-6);
}
