//! Obstacles given by points: their kinks, splines through the points and near them; and what lies between the nodes.

use fastrand::Rng;
use serde_json::{Value, json};
use solver::algorithm::{self, Missed, Place, System, report};
use solver::model::Model;
use solver::problem::{NormalOf, Problem, Refine};
use solver::solution::{
    ErrorMethod, EstimatedQuantity, QuantityName, Solution, Verdict, Warning, WarningCode,
};

use crate::support::{close, example, problem, quiet, solve};

/// The cylinder of example 2 with another obstacle, refined.
fn cylinder(obstacle: Value, refine: u32) -> Solution {
    let mut problem = example("cylinder");
    problem.contacts[0].obstacle = serde_json::from_value(obstacle).unwrap();
    problem.mesh.refine = Refine::Times(refine);
    solve(&problem)
}

/// A block of half-width 1 on a clamped base, without friction.
fn block(lines: &[f64], obstacle: Value, indentation: f64) -> Problem {
    let text = json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grid": {"x": lines, "y": [-2, -1, -0.5, -0.2, -0.1, -0.05, 0]}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
        "contacts": [{"boundary": "top", "obstacle": obstacle, "indentation": indentation}],
    });
    problem(&text.to_string())
}

/// Evenly spaced lines from −1 to 1, and others.
fn lines(spacing: f64, others: &[f64]) -> Vec<f64> {
    let count = (2.0 / spacing).round() as u32;
    let even = (0..=count).map(|i| -1.0 + 2.0 * f64::from(i) / f64::from(count));
    crate::support::union(&[even.collect(), others.to_vec()])
}

fn peak(solution: &Solution) -> f64 {
    -solution.summary.contacts["top"]
        .peak_normal_stress
        .unwrap()
        .value
}

fn warning(solution: &Solution, code: WarningCode) -> Option<&Warning> {
    solution.summary.warnings.iter().find(|w| w.code == code)
}

/// The peak of σ_n is said to have no limit.
fn unlimited(solution: &Solution) -> bool {
    let accuracy = solution.summary.accuracy.as_ref().unwrap();
    let mut peaks = accuracy.quantities.iter();
    let peak = peaks.find(|q| q.quantity == QuantityName::PeakNormalStress);
    peak.unwrap().method == ErrorMethod::NoLimit
}

/// Points of a profile from 0 to 4.
fn points(gap: impl Fn(f64) -> f64, count: usize) -> (Vec<f64>, Vec<f64>) {
    let place = |i: usize| 4.0 * i as f64 / (count - 1) as f64;
    let x: Vec<f64> = (0..count).map(place).collect();
    let gap = x.iter().map(|x| gap(*x)).collect();
    (x, gap)
}

fn table((x, gap): (Vec<f64>, Vec<f64>)) -> Value {
    json!({"kind": "table", "x": x, "gap": gap})
}

fn cubic(mut obstacle: Value) -> Value {
    obstacle["interpolation"] = json!("cubic");
    obstacle
}

fn parabola(x: f64) -> f64 {
    x * x / 16.0
}

fn circle(x: f64) -> f64 {
    8.0 - (64.0 - x * x).sqrt()
}

/// Straight lines between five points of a parabola give a peak that grows without limit, half as high again as that of
/// the parabola at once: it is warned of with the amount by which it grows, and the verdict names it. The spline is that
/// parabola, to rounding.
#[test]
fn five_points_with_straight_lines_are_kinks_and_with_a_spline_the_curve() {
    let coarse = cylinder(table(points(parabola, 5)), 2);
    let fine = cylinder(table(points(parabola, 5)), 3);
    let grown = peak(&fine) - peak(&coarse);
    for solution in [&coarse, &fine] {
        assert!(peak(solution) > 1.5 * 188.0);
        // E* Δ/(2π) ln 2 with Δ = 1/8: each half has the slope 1/16. The formula is that of a half-plane.
        let message = &warning(solution, WarningCode::KinkInContact)
            .unwrap()
            .message;
        let told = 1000.0 / 0.91 * 0.125 / (2.0 * std::f64::consts::PI) * 2f64.ln();
        assert!(message.contains(&format!("about {told:.3e}")), "{message}");
        assert!(message.contains("s = 0.0000"), "{message}");
        close(grown, told, 0.05);
        assert!(unlimited(solution));
        let reasons = &solution.summary.accuracy.as_ref().unwrap().reasons;
        let names = |reason: &String| {
            reason.contains("peak_normal_stress") && reason.contains("without limit")
        };
        assert!(reasons.iter().any(names), "{reasons:#?}");
    }
    let exact = cylinder(json!({"kind": "parabola", "radius": 8}), 2);
    let spline = cylinder(cubic(table(points(parabola, 5))), 2);
    close(peak(&spline), peak(&exact), 1e-9);
    close(
        spline.summary.normal_force,
        exact.summary.normal_force,
        1e-9,
    );
    for solution in [&exact, &spline] {
        assert_eq!(warning(solution, WarningCode::KinkInContact), None);
        assert!(!unlimited(solution));
    }
}

/// Of a circle the curvature of the spline is off by f⁗ h²/12, and by eleven times that at the ends of the table: with
/// f⁗ = 3/R³ and h = 1 by 4.3 % of 1/R within a part of h at the middle of the contact, 4.2 wide, which the pressure
/// feels by a quarter at most; with half the spacing by an eighth of it. As a polyline the same points are a curve by the
/// length of chords, which is as near.
#[test]
fn a_spline_through_few_points_of_a_circle_is_close_to_it() {
    let exact = cylinder(json!({"kind": "circle", "radius": 8}), 1);
    for (count, allowed) in [(5, 0.01), (9, 0.00125)] {
        let (x, gap) = points(circle, count);
        let in_space: Vec<_> = x.iter().zip(&gap).map(|(x, gap)| [*x, *gap]).collect();
        let line = json!({"kind": "polyline", "points": in_space});
        for obstacle in [cubic(table((x, gap))), cubic(line)] {
            let spline = cylinder(obstacle, 1);
            close(peak(&spline), peak(&exact), allowed);
            close(
                spline.summary.normal_force,
                exact.summary.normal_force,
                0.5 * allowed,
            );
            assert_eq!(warning(&spline, WarningCode::KinkInContact), None);
        }
    }
}

/// Points on both sides of the line of symmetry, an even number of them: the slope there is exactly 0, so that the node,
/// held along the tangent, may turn its normal to that of the obstacle.
#[test]
fn a_symmetric_spline_is_flat_at_the_line_of_symmetry() {
    let place = |i: i32| 4.0 * f64::from(2 * i - 11) / 11.0;
    let x: Vec<f64> = (0..12).map(place).collect();
    let gap: Vec<f64> = x.iter().map(|x| circle(*x)).collect();
    let in_space: Vec<_> = x.iter().zip(&gap).map(|(x, gap)| [*x, *gap]).collect();
    let line = json!({"kind": "polyline", "points": in_space});
    let mut exact = example("cylinder");
    exact.contacts[0].normal = Some(NormalOf::Obstacle);
    for obstacle in [cubic(table((x, gap))), cubic(line)] {
        let mut problem = exact.clone();
        problem.contacts[0].obstacle = serde_json::from_value(obstacle).unwrap();
        let (spline, exact) = (solve(&problem), solve(&exact));
        // curvature off by f⁗ h²/12 = 0.2 % between the ends
        close(peak(&spline), peak(&exact), 0.002);
        assert_eq!(warning(&spline, WarningCode::KinkInContact), None);
    }
}

/// So many points that no mesh in use resolves their kinks need no spline, and no warning.
#[test]
fn a_dense_table_is_no_kink() {
    let exact = cylinder(json!({"kind": "circle", "radius": 8}), 2);
    let dense = cylinder(table(points(circle, 401)), 2);
    close(peak(&dense), peak(&exact), 0.01);
    assert_eq!(warning(&dense, WarningCode::KinkInContact), None);
}

/// One wedge as a formula, a table and a polyline: the same kink.
#[test]
fn a_kink_is_seen_in_every_form_of_obstacle() {
    let rise = 3f64.to_radians().tan();
    let at = |x: f64| rise * (x - 0.1).abs();
    let ends = [-1.0, 0.1, 1.0];
    let gap = ends.map(at);
    let in_space = ends.map(|x| [x, at(x)]);
    let mut reversed = in_space;
    reversed.reverse();
    let mut messages = Vec::new();
    for obstacle in [
        json!({"kind": "wedge", "angle": 3, "center": 0.1}),
        json!({"kind": "table", "x": ends, "gap": gap}),
        json!({"kind": "polyline", "points": in_space}),
        json!({"kind": "polyline", "points": reversed}),
        json!({"kind": "power", "coefficient": rise, "exponent": 1, "center": 0.1}),
    ] {
        // at a node, and between two
        for others in [&[0.1][..], &[]] {
            let solution = solve(&block(&lines(0.04, others), obstacle.clone(), 0.02));
            let kink = warning(&solution, WarningCode::KinkInContact).unwrap();
            assert!(kink.message.contains("s = 1.1000"), "{}", kink.message);
            assert!(kink.message.contains(&format!("{:.3e}", 2.0 * rise)));
            assert!(unlimited(&solution));
            if others.is_empty() {
                messages.push(kink.message.clone());
            }
        }
    }
    messages.dedup();
    assert_eq!(messages.len(), 1, "{messages:#?}");
    // one that is far from the contact, or points away from the body, does not shape the pressure
    let away = json!({"kind": "table", "x": [-1, -0.8, 0.8, 1], "gap": [0.5, 0, 0, 0.5]});
    let solution = solve(&block(
        &lines(0.05, &[]),
        json!({"kind": "table", "x": [-1, 0, 0.5, 1], "gap": [0.05, 0, 0.3, 1]}),
        0.01,
    ));
    let kink = warning(&solution, WarningCode::KinkInContact).unwrap();
    assert!(kink.message.contains("s = 1.0000"), "{}", kink.message);
    assert!(!kink.message.contains("sharpest"), "{}", kink.message);
    let solution = solve(&block(&lines(0.05, &[]), away, 0.01));
    let kink = warning(&solution, WarningCode::KinkInContact).unwrap();
    assert!(kink.message.contains("sharpest of 2"), "{}", kink.message);
}

/// A profile measured with noise is a sawtooth for the body; smoothed it gives the pressure of the profile.
/// The noise moves a curve that 81 points determine by about σ√(6/81) = 3·10⁻⁴ (six effective parameters), and its
/// curvature, over a third of the contact, by 3·10⁻⁴ · 12/0.7² of 1/R = 0.125, or 6 %.
#[test]
fn a_smoothed_profile_gives_the_pressure_of_the_one_without_noise() {
    let exact = cylinder(json!({"kind": "circle", "radius": 8}), 1);
    let pressure = |solution: &Solution| solution.node_profiles["top"].normal_stress.clone();
    let off = |solution: &Solution| {
        let pairs = pressure(solution).into_iter().zip(pressure(&exact));
        pairs.fold(0.0f64, |off, (a, b)| off.max((a - b).abs())) / peak(&exact)
    };
    for seed in 0..4 {
        let mut dice = Rng::with_seed(seed);
        // near enough to a normal distribution: six uniform numbers have the variance 1/2
        let mut noise = || 1e-3 * 2f64.sqrt() * (0..6).map(|_| dice.f64() - 0.5).sum::<f64>();
        let (x, mut gap) = points(circle, 81);
        gap.iter_mut().for_each(|gap| *gap += noise());
        let raw = cylinder(table((x.clone(), gap.clone())), 1);
        let rough = cylinder(cubic(table((x.clone(), gap.clone()))), 1);
        let mut obstacle = cubic(table((x, gap)));
        obstacle["smoothing"] = json!({"standard_deviation": 1e-3});
        let smooth = cylinder(obstacle.clone(), 1);
        assert!(off(&smooth) < 0.06, "{}", off(&smooth));
        assert!(off(&raw) > 0.2 && off(&rough) > 0.2);
        close(
            smooth.summary.normal_force,
            exact.summary.normal_force,
            0.01,
        );
        assert!(warning(&raw, WarningCode::KinkInContact).is_some());
        assert_eq!(warning(&smooth, WarningCode::KinkInContact), None);
        assert_eq!(warning(&smooth, WarningCode::SmoothingFlattens), None);
        // the same bits again
        assert_eq!(cylinder(obstacle, 1).node_profiles, smooth.node_profiles);
    }
}

/// What `report` finds between the nodes.
fn missed(problem: &Problem) -> Vec<Missed> {
    let prepared = solver::prepare(problem, None, &mut quiet).unwrap();
    let (model, body) = (&prepared.model, &prepared.body);
    let system = System::new(model, body, &mut quiet).unwrap();
    let finished = algorithm::run(&system, &model.controls, Place::default(), None, &mut quiet);
    let reported = report(&system, &finished, &mut quiet);
    reported.unwrap().along.missed
}

/// A ridge of height 0.01 on a flat face, between the nodes 0.05 apart: the body did not feel it, and nothing said so.
#[test]
fn a_ridge_between_nodes_is_reported() {
    let ridge =
        json!({"kind": "table", "x": [-1, 0.31, 0.312, 0.314, 1], "gap": [0, 0, -0.01, 0, 0]});
    let hidden = block(&lines(0.05, &[]), ridge.clone(), 0.02);
    let solution = solve(&hidden);
    let between = warning(&solution, WarningCode::ObstacleBetweenNodes).unwrap();
    for part in ["1.000e-2", "s = 1.3120", "2.500e-2 apart"] {
        assert!(between.message.contains(part), "{}", between.message);
    }
    let accuracy = solution.summary.accuracy.as_ref().unwrap();
    assert_eq!(accuracy.verdict, Verdict::Poor);
    assert!(accuracy.quantities.iter().all(|q| q.error.is_none()));
    assert!(
        accuracy.reasons[0].contains("between the nodes"),
        "{:#?}",
        accuracy.reasons
    );
    let found = missed(&hidden);
    assert_eq!(found.len(), 1);
    close(found[0].s, 1.312, 1e-9);
    close(found[0].penetration, 0.01, 1e-9);
    // nodes on the ridge see it, and the peak is another one
    let seen = block(&lines(0.05, &[0.31, 0.312, 0.314]), ridge, 0.02);
    assert!(missed(&seen).is_empty());
    let seen = solve(&seen);
    assert_eq!(warning(&seen, WarningCode::ObstacleBetweenNodes), None);
    assert!(peak(&seen) > 50.0 * peak(&solution));
}

/// Wedges between two nodes: a steep one touches no node, one of the same depth in a finer mesh two of them.
#[test]
fn a_wedge_between_nodes_is_reported() {
    for (normal, kind) in [("body", "wedge"), ("obstacle", "wedge"), ("body", "cone")] {
        let wedge = json!({"kind": kind, "angle": 80, "center": 0.0137});
        let mut problem = block(&lines(0.05, &[]), wedge, 0.005);
        problem.contacts[0].normal = serde_json::from_value(json!(normal)).unwrap();
        let solution = solve(&problem);
        assert_eq!(solution.summary.normal_force, 0.0);
        let between = warning(&solution, WarningCode::ObstacleBetweenNodes).unwrap();
        assert!(
            between.message.contains("s = 1.0137") && between.message.contains("5.000e-3"),
            "{}",
            between.message
        );
        let open = warning(&solution, WarningCode::NoContact).unwrap();
        assert!(open.message.contains("No node touches"), "{}", open.message);
        let accuracy = solution.summary.accuracy.as_ref().unwrap();
        assert_eq!(accuracy.verdict, Verdict::Poor);
    }
    // nothing is near a wedge that does not reach the body
    let above = json!({"kind": "wedge", "angle": 80, "center": 0.0137});
    let solution = solve(&block(&lines(0.05, &[]), above, -0.005));
    assert_eq!(warning(&solution, WarningCode::ObstacleBetweenNodes), None);
    let open = warning(&solution, WarningCode::NoContact).unwrap();
    assert!(open.message.contains("never touches"), "{}", open.message);
}

/// A stamp drawn as a line with upright or overhanging sides, on a plate that is seen beside it: its edges are kinks
/// without a measure, at nodes and between them.
#[test]
fn the_edges_of_a_stamp_drawn_in_space_are_kinks() {
    for side in [0.5, 0.4, 0.6] {
        let stamp = [
            [-1.0, 1.0],
            [-side, 1.0],
            [-0.5, 0.0],
            [0.5, 0.0],
            [side, 1.0],
            [1.0, 1.0],
        ];
        for spacing in [0.05, 0.07] {
            let stamp = json!({"kind": "polyline", "points": stamp});
            let solution = solve(&block(&lines(spacing, &[]), stamp, 0.01));
            let steep = side == 0.6;
            let kink = warning(&solution, WarningCode::KinkInContact).unwrap();
            assert!(
                kink.message.contains("sharpest of 2"),
                "{side} {spacing}: {}",
                kink.message
            );
            assert_eq!(
                kink.message.contains("it has an edge there"),
                !steep,
                "{}",
                kink.message
            );
            assert!(unlimited(&solution));
        }
    }
}

/// Waves of an obstacle with the length of the spacing of the nodes, and a crest at every node: 0.025 long, on a parabola.
fn ripples(kind: &str, interpolation: &str, height: f64) -> Value {
    let x: Vec<f64> = (-240..=240).map(|k| f64::from(k) / 240.0).collect();
    let wave = |x: f64| 0.5 * height * (1.0 - (80.0 * std::f64::consts::PI * x).cos());
    let gap = x.iter().map(|x| parabola(*x) + wave(*x));
    match kind {
        "table" => {
            json!({"kind": kind, "x": x, "gap": gap.collect::<Vec<f64>>(), "interpolation": interpolation})
        }
        _ => {
            let points: Vec<[f64; 2]> = x
                .iter()
                .copied()
                .zip(gap)
                .map(|(x, gap)| [x, gap])
                .collect();
            json!({"kind": kind, "points": points, "interpolation": interpolation})
        }
    }
}

/// An obstacle of which the nodes see the crests alone is as smooth for them as the parabola through these: it recedes between
/// them, which is told whatever it is given by, and no error is stated. Nodes in its hollows see it.
#[test]
fn an_obstacle_that_recedes_between_nodes_is_reported() {
    let smooth = solve(&block(
        &lines(0.05, &[]),
        ripples("table", "cubic", 0.0),
        0.04,
    ));
    assert_ne!(
        smooth.summary.accuracy.as_ref().unwrap().verdict,
        Verdict::Poor
    );
    assert_eq!(warning(&smooth, WarningCode::ObstacleBetweenNodes), None);
    for kind in ["table", "polyline"] {
        for interpolation in ["linear", "cubic"] {
            let obstacle = ripples(kind, interpolation, 0.004);
            let solution = solve(&block(&lines(0.05, &[]), obstacle, 0.04));
            close(peak(&solution), peak(&smooth), 1e-4);
            let between = warning(&solution, WarningCode::ObstacleBetweenNodes).unwrap();
            for part in ["recedes by 4.000e-3", "2.500e-2 apart"] {
                assert!(between.message.contains(part), "{}", between.message);
            }
            let accuracy = solution.summary.accuracy.as_ref().unwrap();
            assert_eq!(accuracy.verdict, Verdict::Poor);
            assert!(accuracy.quantities.iter().all(|q| q.error.is_none()));
        }
    }
}

/// Waves too low for that are in the error of the peak, and what they take from the indentation in those of the forces: by a
/// mesh that resolves them. Adaptive refinement does, where it began with a mesh that saw nothing of them.
#[test]
fn low_waves_between_nodes_are_in_the_errors() {
    for height in [4e-4, 4e-5] {
        let with = |refine: u32| {
            let mut problem = block(&lines(0.05, &[]), ripples("table", "cubic", height), 0.04);
            problem.mesh.refine = Refine::Times(refine);
            solve(&problem)
        };
        let (coarse, fine) = (with(0), with(3));
        assert!(peak(&fine) > 1.02 * peak(&coarse));
        for (name, value) in [
            (QuantityName::PeakNormalStress, peak(&fine)),
            (QuantityName::NormalForce, fine.summary.normal_force),
        ] {
            let accuracy = coarse.summary.accuracy.as_ref().unwrap();
            let own = accuracy
                .quantities
                .iter()
                .find(|q| q.quantity == name)
                .unwrap();
            let off = (own.value.abs() - value).abs();
            assert!(off <= own.error.unwrap(), "{height}: off {off} of {own:?}");
        }
    }
    let mut adaptive = block(&lines(0.05, &[]), ripples("table", "cubic", 0.004), 0.04);
    adaptive.mesh.refine = serde_json::from_value(json!({"tolerance": 0.005})).unwrap();
    let solution = solve(&adaptive);
    assert!(solution.summary.refinements.len() > 2);
    assert_eq!(warning(&solution, WarningCode::ObstacleBetweenNodes), None);
    assert!(
        peak(&solution)
            > 3.0
                * peak(&solve(&block(
                    &lines(0.05, &[]),
                    ripples("table", "cubic", 0.0),
                    0.04
                )))
    );
}

/// A block under a shape with waves of a height and a length, shifted by a phase, that is pressed and dragged with friction μ, ρ:
/// a parabola, or a flat that ends with the block, where the peak of σ_n has no limit.
fn waves(
    base: &str,
    [height, length, phase]: [f64; 3],
    friction: [f64; 2],
    spacing: f64,
) -> Problem {
    let count = (64.0 / length) as i32;
    let x: Vec<f64> = (0..=count)
        .map(|k| -1.0 + 2.0 * f64::from(k) / f64::from(count))
        .collect();
    let wave =
        |x: f64| 0.5 * height * (1.0 - (2.0 * std::f64::consts::PI * x / length + phase).cos());
    let gap = |x: f64| match base {
        "parabola" => parabola(x) + wave(x),
        _ => wave(x),
    };
    let gaps = x.iter().map(|x| gap(*x)).collect();
    let indentation = if base == "parabola" { 0.04 } else { 0.02 };
    let mut problem = block(&lines(spacing, &[]), cubic(table((x, gaps))), indentation);
    let contact = &mut problem.contacts[0];
    contact.tangential_displacement = 0.01;
    let [coefficient, radius] = friction;
    if coefficient > 0.0 {
        let law =
            json!({"coefficient": coefficient, "nonlocal_radius": radius, "elastic_slip": 1e-3});
        contact.friction = Some(serde_json::from_value(law).unwrap());
    }
    problem
}

/// Waves as long as the nodes are apart, and half as long, on coarse meshes: what they do to forces and to both peaks, by a mesh
/// that resolves them, is within the stated errors, whatever the radius that friction is averaged over, and where σ_n has no limit.
#[test]
fn waves_between_nodes_are_in_the_errors_of_friction() {
    let (mut compared, mut friction) = (0, 0);
    for base in ["parabola", "flat"] {
        for [height, length, phase] in [
            [1e-3, 0.125, 0.0],
            [1e-3, 0.0625, 0.0],
            [2e-4, 0.125, 2.0],
            [2e-4, 0.0625, 2.0],
        ] {
            for law in [[0.0, 0.0], [0.1, 0.0], [0.1, 0.02], [0.5, 0.02], [0.5, 0.1]] {
                let mut problem = waves(base, [height, length, phase], law, 0.25);
                let coarse = solve(&problem).summary;
                problem.mesh.refine = Refine::Times(3);
                let fine = solve(&problem).summary.accuracy.unwrap().quantities;
                let verdict = coarse.accuracy.as_ref().unwrap().verdict;
                assert_ne!(verdict, Verdict::Good, "{base} {height} {length} {law:?}");
                for own in &coarse.accuracy.unwrap().quantities {
                    use QuantityName::*;
                    let Some(error) = own.error.filter(|error| *error > 0.0) else {
                        continue;
                    };
                    if matches!(own.quantity, ContactStart | ContactEnd | StickEnd) {
                        continue;
                    }
                    let other = fine.iter().find(|q| q.quantity == own.quantity).unwrap();
                    let off = (own.value.abs() - other.value.abs()).abs();
                    assert!(
                        off <= error,
                        "{base} {height} {length} {phase} {law:?}: off {off} of {own:?}"
                    );
                    compared += 1;
                    friction += i32::from(own.quantity == PeakTangentialStress);
                }
            }
        }
    }
    assert!(compared > 60 && friction > 15, "{compared} {friction}");
}

/// Where the peak of σ_n has no limit, waves that the nodes do not see are told by the mean pressure, and refinement sees them.
#[test]
fn refinement_finds_waves_where_the_pressure_has_no_limit() {
    let size = [1e-3, 0.125, 0.0];
    let smooth = solve(&waves("flat", [0.0, 0.125, 0.0], [0.0; 2], 0.25));
    assert_eq!(warning(&smooth, WarningCode::ObstacleBetweenNodes), None);
    // without friction the peak has a limit in the right angles at the ends of the body, and an error that contains the waves
    let frictionless = solve(&waves("flat", size, [0.0; 2], 0.25));
    assert!(!unlimited(&frictionless));
    assert_eq!(
        frictionless.summary.accuracy.unwrap().verdict,
        Verdict::Poor
    );
    for law in [[0.3, 0.05], [0.3, 0.02]] {
        let mut problem = waves("flat", size, law, 0.25);
        let coarse = solve(&problem);
        assert!(unlimited(&coarse));
        assert!(warning(&coarse, WarningCode::ObstacleBetweenNodes).is_some());
        let accuracy = coarse.summary.accuracy.as_ref().unwrap();
        assert_eq!(accuracy.verdict, Verdict::Poor);
        problem.mesh.refine = Refine::Times(4);
        let fine = solve(&problem).summary;
        problem.mesh.refine = serde_json::from_value(json!({"tolerance": 0.05})).unwrap();
        let adaptive = solve(&problem);
        assert!(adaptive.summary.refinements.len() > 2);
        assert_eq!(warning(&adaptive, WarningCode::ObstacleBetweenNodes), None);
        close(adaptive.summary.normal_force, fine.normal_force, 0.01);
        let friction = [&adaptive.summary, &fine].map(|s| s.friction_force);
        assert!((friction[0] - friction[1]).abs() <= 0.02 * friction[1]);
        // each crest touches on its own
        let crests = [&adaptive.summary, &fine].map(|s| s.contacts["top"].contact.len());
        assert!(crests[0] == crests[1] && crests[0] > 10, "{crests:?}");
    }
}

/// A smooth tooth in space, between the nodes of the upright side of a body: places are found along any boundary.
#[test]
fn a_curve_in_space_is_seen_between_nodes() {
    let tooth = [
        [1.5, -2.0],
        [1.5, -1.3],
        [1.0, -1.12],
        [1.5, -1.0],
        [1.5, 0.0],
    ];
    for (points, interpolation) in [
        (tooth.to_vec(), "linear"),
        (tooth.iter().rev().copied().collect(), "linear"),
        (tooth.to_vec(), "cubic"),
    ] {
        let obstacle =
            json!({"kind": "polyline", "points": points, "interpolation": interpolation});
        let mut problem = block(&lines(0.25, &[]), obstacle, 0.01);
        problem.contacts[0].boundary = "right".into();
        let found = missed(&problem);
        assert_eq!(found.len(), 1, "{found:?}");
        // s runs down from the top
        close(found[0].s, 1.12, 0.01);
        close(found[0].penetration, 0.01, 0.2);
    }
}

/// The side from 0.4 to 0.5 is divided where a table or a polyline ends, and the contact ends there; next to a node it is not,
/// and the contact ends at 0.4, which is told. So it is where a rounded face ends in its flank.
#[test]
fn an_obstacle_that_ends_inside_an_edge_has_a_node_there_whatever_its_kind() {
    let x: Vec<f64> = (-10..=10).map(|i| f64::from(i) / 10.0).collect();
    let ends = |end: f64, text: Value| {
        let problem = block(&x, text, 0.01);
        let checked = solver::check(&problem, None).unwrap();
        let boundary = Model::new(&problem, None).unwrap().contacts[0]
            .boundary
            .clone();
        let last = boundary.positions[boundary.nodes.len() - 1][0];
        let expected = if end < 0.4001 { 0.4 } else { end };
        assert!((last - expected).abs() < 1e-8, "{last} {end}");
        let cut = |w: &&Warning| w.code == WarningCode::ObstacleCutsEdge;
        let found: Vec<_> = checked.warnings.iter().filter(cut).collect();
        assert!(
            found.iter().all(|w| w
                .message
                .contains(&format!("{:.1}", (10.0 * end).floor() / 10.0))
                || w.message.contains("-0.5")),
            "{found:#?}"
        );
        found.len()
    };
    for (end, cut) in [(0.49, 0), (0.41, 0), (0.4995, 0), (0.5, 0), (0.400_005, 1)] {
        let obstacles = [
            json!({"kind": "flat", "from": -0.5, "to": end}),
            json!({"kind": "table", "x": [-0.5, end], "gap": [0, 0]}),
            cubic(json!({"kind": "table", "x": [-0.5, 0, end], "gap": [0, 0, 0]})),
            json!({"kind": "polyline", "points": [[-0.5, 0], [end, 0]]}),
            cubic(json!({"kind": "polyline", "points": [[-0.5, 0], [0, 0], [end, 0]]})),
        ];
        for obstacle in obstacles {
            // a curve in space is looked at 1/64 of the side from the node, and so little of it is not seen
            let told = if obstacle["kind"] == "polyline" {
                0
            } else {
                cut
            };
            assert_eq!(ends(end, obstacle.clone()), told, "{obstacle}");
        }
    }
    let rounded = json!({"kind": "rounded_flat", "half_width": 0.2, "radius": 0.29});
    let checked = solver::check(&block(&x, rounded, 0.01), None).unwrap();
    let cut = |w: &&Warning| w.code == WarningCode::ObstacleCutsEdge;
    assert_eq!(checked.warnings.iter().filter(cut).count(), 2);
}

/// A flat punch from −3 to an end between lines 1 apart is known within its errors, against one on a grid with a line on that
/// end.
#[test]
fn an_obstacle_that_ends_between_grid_lines_is_known_within_its_errors() {
    let y: Vec<f64> = (0..=16)
        .map(|k| 40.0 - 1.4f64.powi(k))
        .filter(|y| *y > 0.0)
        .collect();
    let y: Vec<f64> = [0.0]
        .into_iter()
        .chain(y.into_iter().rev())
        .chain([40.0])
        .collect();
    let punch = |x: Vec<f64>, end: f64, refine: u32| {
        let problem = json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"grid": {"x": x, "y": y}, "refine": refine},
            "materials": [{"youngs_modulus": 210_000, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
            "contacts": [{"boundary": "top", "obstacle": {"kind": "flat", "from": -3, "to": end},
                "indentation": 0.05,
                "friction": {"coefficient": 0.3, "nonlocal_radius": 0.5, "elastic_slip": 1e-4}}],
        });
        let solution = solve(&crate::support::problem(&problem.to_string()));
        let accuracy = solution.summary.accuracy.unwrap();
        let all = accuracy.quantities.into_iter();
        let of = |name: QuantityName| move |q: &EstimatedQuantity| q.quantity == name;
        let names = [
            QuantityName::NormalForce,
            QuantityName::FrictionForce,
            QuantityName::ContactEnd,
        ];
        let all: Vec<EstimatedQuantity> = all.collect();
        names.map(|name| all.iter().find(|q| of(name)(q)).unwrap().clone())
    };
    for (end, refine) in [(3.24, 2), (3.45, 1), (3.95, 0), (3.12, 3)] {
        let x: Vec<f64> = (-40..=40).map(f64::from).collect();
        let own = punch(x.clone(), end, refine);
        let mut on_end: Vec<f64> = x
            .into_iter()
            .chain([-3.05, -2.95, end - 0.05, end, end + 0.05])
            .collect();
        on_end.sort_by(f64::total_cmp);
        on_end.dedup();
        let fine = punch(on_end, end, 3);
        for (own, fine) in own.iter().zip(&fine) {
            let (off, error) = ((own.value - fine.value).abs(), own.error.unwrap());
            assert!(off <= error + 1e-9, "{end}: off {off:.1e} of {own:?}");
        }
    }
}

#[test]
fn a_standard_deviation_in_another_unit_gives_a_warning() {
    let mut obstacle = cubic(table(points(circle, 21)));
    for (deviation, flattens) in [(1e-3, false), (1.0, true)] {
        obstacle["smoothing"] = json!({"standard_deviation": deviation});
        let checked = solver::check(&block(&lines(0.1, &[]), obstacle.clone(), 0.01), None);
        let mut codes = checked.unwrap().warnings.into_iter().map(|w| w.code);
        assert_eq!(
            codes.any(|code| code == WarningCode::SmoothingFlattens),
            flattens
        );
    }
}

/// A profile that was shifted by its lowest point is displaced by the error of that point.
#[test]
fn a_profile_whose_lowest_point_is_zero_gives_a_warning() {
    for (shift, told) in [(0.0, true), (1e-6, false)] {
        let mut obstacle = cubic(table(points(|x| circle(x) + shift, 21)));
        obstacle["smoothing"] = json!({"standard_deviation": 1e-3});
        let checked = solver::check(&block(&lines(0.1, &[]), obstacle.clone(), 0.01), None);
        let mut codes = checked.unwrap().warnings.into_iter().map(|w| w.code);
        assert_eq!(
            codes.any(|code| code == WarningCode::LowestPointIsZero),
            told
        );
    }
}
