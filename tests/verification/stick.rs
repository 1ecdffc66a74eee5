//! docs/verification.md, rows 15, 18, 19, 22 and 23: where punches and cylinders stick, and what averaging does
//! to their pressure.

use serde_json::{Value, json};
use solver::problem::Problem;
use solver::solution::{Solution, Summary, WarningCode};

use crate::record::{Line, held};
use crate::support::{close, example, graded, problem, solve, union};

const A: f64 = 0.5;

/// A half model of a block under a contact at the top.
fn block(kind: &str, nu: f64, x: &[f64], size: f64, fine: f64, contact: &Value) -> Value {
    let end = x[x.len() - 1];
    let lines = union(&[x.to_vec(), graded(end, size, fine, 1.4)]);
    let y: Vec<f64> = graded(0.0, -size, fine, 1.4).into_iter().rev().collect();
    json!({
        "analysis": {"kind": kind},
        "mesh": {"grid": {"x": lines, "y": y}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": nu}],
        "supports": [{"boundary": "left", "ux": 0}, {"boundary": "bottom", "ux": 0, "uy": 0}],
        "contacts": [contact],
    })
}

/// Lines of a punch of half-width A, graded to its edge.
fn punch_lines(edge: f64) -> Vec<f64> {
    union(&[graded(A, 0.0, edge, 1.02), graded(A, 1.0, edge, 1.3)])
}

fn punch(kind: &str, nu: f64, size: f64, extra: Value) -> Value {
    let mut contact = json!({"boundary": "top", "obstacle": {"kind": "flat", "from": 0, "to": A}, "indentation": 0.1});
    if let Value::Object(fields) = extra {
        fields
            .into_iter()
            .for_each(|(name, value)| contact[name] = value);
    }
    block(kind, nu, &punch_lines(2e-4), size * A, 2e-4, &contact)
}

fn solved(value: &Value) -> Solution {
    solve(&problem(&value.to_string()))
}

fn stick_ratio(summary: &Summary) -> f64 {
    let contact = &summary.contacts["top"];
    contact.stick[0][1] / contact.contact[0][1]
}

/// Row 15. Bonded flat punch in axisymmetry: P/P₀ = (1−ν) ln(3−4ν)/(1−2ν), both on the same mesh.
#[test]
fn a_bonded_punch_needs_more_load() {
    for (nu, exact) in [(0.3, 1.028627), (0.0, 1.098612)] {
        let load = |extra: Value| {
            solved(&punch("axisymmetric", nu, 400.0, extra))
                .summary
                .normal_force
        };
        let ratio = load(json!({"condition": "bonded"})) / load(json!({}));
        let formula = (1.0 - nu) * f64::ln(3.0 - 4.0 * nu) / (1.0 - 2.0 * nu);
        close(formula, exact, 1e-6);
        // the loads' own mesh errors cancel: a tenth of a percent
        held(
            15,
            &format!("bonded punch, ν = {nu}: P/P₀"),
            "block of 400 a, edge at 4e-4 a",
            ratio,
            exact,
            1e-3,
        );
    }
}

/// Row 18, coupled: where a flat punch sticks, Coulomb limit, on a block of 4,000 a. 1 %. With an
/// elastic slip far below 1e-6 it is the elements that tell stick from slip, and c moves by theirs.
#[test]
fn a_flat_punch_sticks_up_to_its_published_radius() {
    for (kind, nu, exact) in [
        ("plane_strain", 0.3, 0.6891),
        ("axisymmetric", 0.3, 0.8960),
        ("plane_strain", 0.0, 0.1774),
        ("axisymmetric", 0.0, 0.5032),
    ] {
        let friction = json!({"coefficient": 0.3, "nonlocal_radius": 0, "elastic_slip": 1e-6, "points": "nodal"});
        let with = solved(&punch(kind, nu, 4000.0, json!({"friction": friction}))).summary;
        let what = format!("flat punch, {kind}, ν = {nu}: c/a");
        held(
            18,
            &what,
            "block of 4,000 a, edge at 4e-4 a",
            stick_ratio(&with),
            exact,
            0.01,
        );
        let without = solved(&punch(kind, nu, 4000.0, json!({})))
            .summary
            .normal_force;
        let ratio = with.normal_force / without;
        assert!(ratio > 1.001, "friction must matter: {ratio}");
        if (kind, nu) == ("axisymmetric", 0.3) {
            held(
                18,
                "flat punch, axisymmetric, ν = .3: P/P₀",
                "block of 4,000 a",
                ratio,
                1.02430,
                1e-3,
            );
        }
    }
}

/// Row 18, uncoupled: the frictionless reactions as loads, no obstacle, and the bound τ = μ p₀
/// prescribed; K(√(1−k²))/K(k) = β/μ.
#[test]
fn a_prescribed_bound_has_the_stick_zone_of_the_elliptic_integral() {
    let base = punch("plane_strain", 0.3, 4000.0, json!({}));
    let first = solved(&base);
    let profile = &first.node_profiles["top"];
    let count = profile.s.len();
    let pressure: Vec<f64> = profile.normal_stress.iter().map(|s| -s).collect();
    let mut forces = vec![[0.0; 2]; count];
    for k in (0..count - 1).step_by(2) {
        let length = profile.s[k + 2] - profile.s[k];
        for (i, share) in [(k, 1.0), (k + 1, 4.0), (k + 2, 1.0)] {
            forces[i][1] -= pressure[i] * share / 6.0 * length;
        }
    }
    let total: f64 = forces.iter().map(|f| -f[1]).sum();
    close(total, first.summary.normal_force, 1e-12);
    for (mu, exact) in [(0.2, 0.40579), (0.3, 0.74379), (0.5, 0.96776)] {
        let mut p = base.clone();
        p["mesh"]["boundaries"] = json!({"punch": {"side": "top", "x": [0, A]}});
        p["loads"] = json!([{"boundary": "punch", "nodal": forces}]);
        let bound: Vec<f64> = pressure.iter().map(|p| mu * p).collect();
        p["contacts"] = json!([{"boundary": "punch", "condition": "none", "obstacle": {"kind": "flat"},
            "friction": {"elastic_slip": 1e-7, "points": "nodal", "bound": {"s": profile.s, "bound": bound}}}]);
        let solution = solved(&p);
        let contact = &solution.summary.contacts["punch"];
        assert!(contact.contact.is_empty() && contact.normal_force == 0.0);
        let what = format!("given bound, μ = {mu}: c/a");
        held(
            18,
            &what,
            "block of 4,000 a, edge at 4e-4 a",
            contact.stick[0][1] / A,
            exact,
            0.01,
        );
    }
}

/// A parabola pushed until it touches to about a = 1, or a flat punch.
fn parabola(kind: &str, elements: usize, history: &str, increments: u32) -> Problem {
    let h = 1.05 / elements as f64;
    let x: Vec<f64> = (0..=elements).map(|k| k as f64 * h).collect();
    // the indentation that touches to a = 1 on this block, in the plane
    let indentation = if kind == "axisymmetric" {
        0.125
    } else {
        0.5625
    };
    let contact = json!({"boundary": "top", "indentation": indentation,
        "obstacle": {"kind": "parabola", "radius": 8, "from": 0, "to": 1.05},
        "friction": {"coefficient": 0.3, "nonlocal_radius": 0, "elastic_slip": 1e-6, "history": history, "points": "nodal"}});
    let mut p = block(kind, 0.3, &x, 4000.0, h, &contact);
    p["steps"] = json!([{"increments": increments, "spacing": "contact_width", "tangential_displacement": 1}]);
    p["solver"] = json!({"tolerance": 1e-8});
    problem(&p.to_string())
}

/// Row 19. Cylinders and spheres tell the laws apart. Total law: c/a = .2963 and .5186.
#[test]
fn the_total_law_sticks_least_under_a_parabola() {
    for (kind, exact) in [("plane_strain", 0.2963), ("axisymmetric", 0.5186)] {
        let ratio = stick_ratio(&solve(&parabola(kind, 150, "total", 1)).summary);
        held(
            19,
            &format!("parabola, {kind}, total law: c/a"),
            "block of 4,000 a, 150 elements",
            ratio,
            exact,
            0.01,
        );
    }
}

/// Row 19, incremental law in the plane: .6891, which 80 steps of equal contact width come near to.
#[test]
fn the_incremental_law_depends_on_the_path_in_the_plane() {
    let ratio = stick_ratio(&solve(&parabola("plane_strain", 150, "incremental", 80)).summary);
    held(
        19,
        "parabola, plane_strain, incremental law: c/a",
        "block of 4,000 a, 150 elements, 80 steps",
        ratio,
        0.6891,
        0.01,
    );
}

/// And in axisymmetry: .8960.
#[test]
fn the_incremental_law_depends_on_the_path_in_axisymmetry() {
    let ratio = stick_ratio(&solve(&parabola("axisymmetric", 150, "incremental", 80)).summary);
    held(
        19,
        "parabola, axisymmetric, incremental law: c/a",
        "block of 4,000 a, 150 elements, 80 steps",
        ratio,
        0.8960,
        0.01,
    );
}

/// The number of steps matters less and less, and `check_increments` says by how much.
#[test]
fn more_increments_change_less() {
    let ratio =
        |n: u32| stick_ratio(&solve(&parabola("plane_strain", 60, "incremental", n)).summary);
    let (ten, twenty, forty) = (ratio(10), ratio(20), ratio(40));
    assert!(ten < twenty && twenty < forty, "{ten}, {twenty}, {forty}");
    Line {
        row: 19,
        what: "parabola, incremental law: change of c/a from 20 to 40 steps, per that from 10 to 20",
        mesh: "60 elements",
        expected: 0.5,
        computed: (forty - twenty) / (twenty - ten),
        allowed: 0.6,
        order: None,
    }
    .hold();
    let mut p = parabola("plane_strain", 60, "incremental", 10);
    p.solver.check_increments = true;
    let summary = solve(&p).summary;
    let doubled = summary.doubled_increments.unwrap();
    let direct = solve(&parabola("plane_strain", 60, "incremental", 20)).summary;
    close(doubled.tangential_force, direct.tangential_force, 1e-9);
    assert!(!doubled.agrees && doubled.change > 1e-4);
    assert!(
        summary
            .warnings
            .iter()
            .any(|w| w.code == WarningCode::IncrementsMatter)
    );
}

/// Row 19. Under a flat punch all points move along from the start: both laws agree to 1e-9 for any
/// number of steps.
#[test]
fn under_a_flat_punch_both_laws_agree() {
    let mut p = example("rectangular_punch");
    p.mesh.refine = solver::problem::Refine::Times(1);
    p.solver.tolerance = 1e-12;
    let total = solve(&p).summary;
    p.contacts[0].friction.as_mut().unwrap().history = solver::problem::History::Incremental;
    for steps in [1, 2, 4, 16, 64] {
        let mut step = solver::problem::Step::whole();
        step.increments = steps;
        p.steps = vec![step];
        let summary = solve(&p).summary;
        assert_eq!(summary.increments, steps);
        for (name, found, expected) in [
            ("Y", summary.normal_force, total.normal_force),
            ("T", summary.tangential_force, total.tangential_force),
        ] {
            let what = format!("flat punch, incremental in {steps} steps: {name}");
            held(19, &what, "example 1 refined once", found, expected, 1e-9);
        }
    }
}

/// Row 22. The pressure of a flat punch, averaged with ρ = .008: at the middle, at the edge, and its
/// largest value. A friction of 1e-9 changes nothing and has the average computed.
#[test]
fn the_averaged_pressure_of_a_punch_has_its_published_values() {
    let friction = json!({"coefficient": 1e-9, "nonlocal_radius": 0.008, "elastic_slip": 1e-4});
    let contact = json!({"boundary": "top", "obstacle": {"kind": "flat", "from": 0, "to": A}, "indentation": 0.1, "friction": friction});
    let lines = union(&[graded(A, 0.0, 2e-5, 1.1), graded(A, 1.0, 2e-5, 1.3)]);
    let solution = solved(&block(
        "plane_strain",
        0.3,
        &lines,
        200.0 * A,
        2e-5,
        &contact,
    ));
    let profile = &solution.node_profiles["top"];
    let load = 2.0 * solution.summary.normal_force;
    let average: Vec<f64> = profile
        .nonlocal_pressure
        .iter()
        .map(|s| A * s / load)
        .collect();
    let mesh = "block of 200 a, edge at 4e-5 a";
    let last = average.len() - 1;
    held(
        22,
        "flat punch, ρ = .008: a S(0)/P",
        mesh,
        average[0],
        0.318316,
        2e-3,
    );
    held(
        22,
        "flat punch, ρ = .008: a S(a)/P",
        mesh,
        average[last],
        2.252435,
        5e-3,
    );
    let largest = (0..=last)
        .max_by(|&i, &j| average[i].total_cmp(&average[j]))
        .unwrap();
    held(
        22,
        "flat punch, ρ = .008: largest a S/P",
        mesh,
        average[largest],
        2.785839,
        5e-3,
    );
    held(
        22,
        "flat punch, ρ = .008: where, x/a",
        mesh,
        profile.x[largest] / A,
        0.992538,
        1e-3,
    );
}

/// Row 23. As ρ → 0 the law tends to Coulomb's; as ρ grows the peak of σ_t falls at a sharp edge, and
/// hardly moves without one.
#[test]
fn averaging_lowers_the_peak_at_an_edge_and_vanishes_with_its_radius() {
    let with_radius = |name: &str, radius: f64| {
        let mut p = example(name);
        p.mesh.refine = solver::problem::Refine::Times(3);
        p.contacts[0].friction.as_mut().unwrap().nonlocal_radius = Some(radius);
        solve(&p).summary
    };
    let punch = |radius: f64| with_radius("rectangular_punch", radius);
    let local = punch(0.0).tangential_force;
    let off = |radius: f64| (punch(radius).tangential_force / local - 1.0).abs();
    let (wide, narrow) = (off(0.02), off(0.0025));
    assert!(narrow < 0.5 * wide, "{wide} → {narrow}");
    held(
        23,
        "example 1, ρ = .0025 against Coulomb's law: T",
        "refined three times",
        narrow,
        0.0,
        0.02,
    );
    let peak = |summary: &Summary| {
        summary
            .contacts
            .values()
            .next()
            .unwrap()
            .peak_tangential_stress
            .unwrap()
            .value
            .abs()
    };
    for (name, radii) in [
        ("rectangular_punch", [0.008, 0.01, 0.015]),
        ("annular_punch", [0.02, 0.05, 0.13]),
        ("cylinder_on_end", [0.008, 0.01, 0.015]),
    ] {
        let peaks = radii.map(|radius| peak(&with_radius(name, radius)));
        assert!(
            peaks[0] > 1.05 * peaks[1] && peaks[1] > 1.05 * peaks[2],
            "{name}: {peaks:?}"
        );
    }
    let smooth = [0.01, 0.05].map(|radius| peak(&with_radius("cylinder", radius)));
    held(
        23,
        "cylinder: peak σ_t at ρ = .05 against .01",
        "refined three times",
        smooth[1],
        smooth[0],
        0.01,
    );
}

/// What holds a bonded contact is among the forces that are compared: the total law does not depend on the
/// increments, whatever holds the body.
#[test]
fn forces_that_hold_a_bonded_contact_are_compared_too() {
    let problem: solver::problem::Problem = serde_json::from_value(serde_json::json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grid": {"x": [0, 1, 2, 3, 4], "y": [-2, -1, 0]}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "contacts": [
            {"boundary": "bottom", "obstacle": {"kind": "flat"}, "condition": "bonded"},
            {"boundary": "top", "obstacle": {"kind": "circle", "radius": 8, "center": 2.5}, "indentation": 0.1,
             "tangential_displacement": 0.02,
             "friction": {"coefficient": 0.3, "nonlocal_radius": 0.1, "elastic_slip": 1e-4}}
        ],
        "steps": [{"tangential_displacement": 1}],
        "solver": {"check_increments": true, "check_uniqueness": true}
    }))
    .unwrap();
    let summary = solve(&problem).summary;
    let held = &summary.contacts["bottom"];
    assert!(held.friction_force > 0.1 * summary.contacts["top"].friction_force);
    let doubled = summary.doubled_increments.unwrap();
    assert!(doubled.agrees, "{doubled:?}");
    close(doubled.friction_force, summary.friction_force, 1e-8);
    let other = summary.uniqueness.unwrap();
    close(other.tangential_force, summary.tangential_force, 1e-8);
}
