//! What a verdict promises: contacts that never touch, obstacles that end inside edges, materials that meet under a contact,
//! other solutions, and halves of symmetric problems.

use fastrand::Rng;
use serde_json::{Value, json};
use solver::family::{End, Family, Member, Start};
use solver::problem::Problem;
use solver::solution::{
    ErrorMethod, EstimatedQuantity, QuantityName, Solution, Verdict, WarningCode,
};

use crate::support::{Lattice, problem, solve};

fn solved(value: &Value) -> Solution {
    solve(&problem(&value.to_string()))
}

fn quantities(solution: &Solution, contact: &str) -> Vec<EstimatedQuantity> {
    let all = solution
        .summary
        .accuracy
        .as_ref()
        .unwrap()
        .quantities
        .iter();
    all.filter(|q| q.contact == contact).cloned().collect()
}

fn quantity(solution: &Solution, name: QuantityName) -> EstimatedQuantity {
    let all = &solution.summary.accuracy.as_ref().unwrap().quantities;
    all.iter().find(|q| q.quantity == name).unwrap().clone()
}

fn warns(solution: &Solution, code: WarningCode) -> bool {
    solution.summary.warnings.iter().any(|w| w.code == code)
}

/// A trapezoid on its foot, whose flanks lean by these angles to the horizontal (degrees), pressed from above; and obstacles
/// beside its flanks.
fn trapezoid(angles: [f64; 2], contacts: Vec<Value>) -> Value {
    let [left, right] = angles.map(|angle| 1.0 / angle.to_radians().tan());
    let body = Lattice::new(8, 4, |i, j| {
        let (u, v) = (i as f64 / 8.0 - 1.0, j as f64 / 8.0);
        let wide = 1.0 - (1.0 - v) * if u < 0.0 { -left } else { -right };
        [u * wide, v - 1.0]
    });
    json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"inline": {"nodes": body.nodes, "elements": body.elements, "boundaries": {
            "foot": body.edges(8, |k| (k, 0)), "top": body.edges(8, |k| (k, 8)),
            "left": body.edges(4, |k| (0, k)), "right": body.edges(4, |k| (16, k)),
        }}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "foot", "ux": 0, "uy": 0}],
        "contacts": contacts,
    })
}

/// A profile that was measured on a part of the surface only presses with its last point, where the surface may go on. A punch
/// ends at its own edge. Where the body itself ends in a right angle, the pressure of a smooth obstacle has a limit.
#[test]
fn the_last_point_of_a_profile_is_told_apart_from_an_edge() {
    let ends = |obstacle: Value| {
        let contact = json!({"boundary": "top", "obstacle": obstacle, "indentation": 0.02});
        let solution = solved(&trapezoid([90.0, 90.0], vec![contact]));
        let count = |code| {
            solution
                .summary
                .warnings
                .iter()
                .filter(|w| w.code == code)
                .count()
        };
        [
            WarningCode::ContactReachesObstacleEnd,
            WarningCode::SharpEdge,
        ]
        .map(count)
    };
    let table =
        |from: f64, to: f64| json!({"kind": "table", "x": [from, 0.1, to], "gap": [0, 0, 0]});
    assert_eq!(ends(table(-0.5, 0.5)), [2, 0]);
    assert_eq!(ends(table(-3.0, 0.5)), [1, 0]);
    assert_eq!(ends(table(-0.5, 3.0)), [1, 0]);
    assert_eq!(ends(table(-3.0, 3.0)), [0, 0]);
    assert_eq!(
        ends(json!({"kind": "polyline", "points": [[-0.5, 0], [0.5, 0]]})),
        [2, 0]
    );
    assert_eq!(
        ends(json!({"kind": "polyline", "points": [[-3, 0], [3, 0]]})),
        [0, 0]
    );
    assert_eq!(
        ends(json!({"kind": "flat", "from": -0.5, "to": 0.5})),
        [0, 2]
    );
}

/// At a corner of the body on a smooth obstacle that goes on, the pressure has a limit up to a right angle, and the error of
/// its peak is stated; with friction, or in a wider corner, it has none.
#[test]
fn only_a_corner_with_a_pressure_without_a_limit_is_a_sharp_edge() {
    let friction = json!({"coefficient": 0.2, "nonlocal_radius": 0, "elastic_slip": 0.001});
    // of the foot, which those of the top complete to 180 degrees
    for (angles, friction, sharp) in [
        ([90.0, 90.0], None, 0),
        ([120.0, 100.0], None, 0),
        ([75.0, 120.0], None, 1),
        ([60.0, 80.0], None, 2),
        ([90.0, 90.0], Some(&friction), 2),
    ] {
        let mut contact =
            json!({"boundary": "top", "obstacle": {"kind": "flat"}, "indentation": 0.02});
        if let Some(friction) = friction {
            contact["friction"] = friction.clone();
        }
        let solution = solved(&trapezoid(angles, vec![contact]));
        let warnings = solution.summary.warnings.iter();
        let found = warnings
            .filter(|w| w.code == WarningCode::SharpEdge)
            .count();
        assert_eq!(found, sharp, "{angles:?} {friction:?}");
        let peak = quantity(&solution, QuantityName::PeakNormalStress);
        let without_limit = peak.method == ErrorMethod::NoLimit;
        assert_eq!(without_limit, sharp > 0, "{angles:?}: {peak:?}");
    }
}

/// Whatever the angle of the corner, the order of the contacts, and whether the other one has friction.
#[test]
fn a_contact_that_never_touches_changes_nothing() {
    let friction = json!({"coefficient": 0.7, "nonlocal_radius": 0.1, "elastic_slip": 0.001});
    let top = |indentation: f64| json!({"boundary": "top", "obstacle": {"kind": "flat"}, "indentation": indentation, "friction": friction});
    let away = |name: &str, rough: bool| {
        let mut contact = json!({"boundary": name, "obstacle": {"kind": "flat", "along": "arc_length"}, "indentation": -0.5});
        if rough {
            contact["friction"] = friction.clone();
        }
        contact
    };
    for angles in [[90.0, 90.0], [60.0, 90.0], [75.0, 120.0]] {
        let alone = solved(&trapezoid(angles, vec![top(0.02)]));
        assert!(warns(&alone, WarningCode::SharpEdge));
        for contacts in [
            vec![top(0.02), away("right", false)],
            vec![away("right", true), top(0.02)],
            vec![away("left", false), top(0.02), away("right", true)],
            vec![top(0.02), away("right", true), away("left", true)],
        ] {
            let other = solved(&trapezoid(angles, contacts.clone()));
            let (own, expected) = (quantities(&other, "top"), quantities(&alone, "top"));
            assert_eq!(own.len(), expected.len(), "{angles:?}");
            for (own, expected) in own.iter().zip(&expected) {
                assert_eq!(
                    (own.quantity, own.method),
                    (expected.quantity, expected.method)
                );
                for (a, b) in [
                    (Some(own.value), Some(expected.value)),
                    (own.error, expected.error),
                ] {
                    let close = match (a, b) {
                        // the sum of tractions of both ways is as good as 0
                        (Some(a), Some(b)) => (a - b).abs() <= 1e-6 * b.abs().max(1e-3),
                        (a, b) => a == b,
                    };
                    assert!(close, "{angles:?}: {own:?} {expected:?}");
                }
            }
            let ends = |s: &Solution| {
                let all = s.summary.warnings.iter();
                all.filter(|w| w.code == WarningCode::SharpEdge).count()
            };
            assert_eq!(ends(&other), ends(&alone));
            let numbers = |s: &Solution| s.history.iter().map(|row| row.k).collect::<Vec<_>>();
            let expected: Vec<u32> = (1..=other.history.len() as u32).collect();
            assert_eq!(numbers(&other), expected);
        }
    }
}

/// An obstacle that was far away and is not: pressed against both, the corner is of both, as if nothing had been guessed.
#[test]
fn a_contact_that_comes_to_touch_is_felt() {
    let contacts = |gap: f64| {
        vec![
            json!({"boundary": "top", "obstacle": {"kind": "flat"}, "indentation": 0.1}),
            json!({"boundary": "right", "obstacle": {"kind": "flat", "along": "arc_length"}, "indentation": -gap}),
        ]
    };
    // the side comes out by more than the gap
    let [touching, nearly] = [0.0, 1e-7].map(|gap| solved(&trapezoid([90.0; 2], contacts(gap))));
    for name in ["top", "right"] {
        let [a, b] = [&touching, &nearly].map(|s| s.summary.contacts[name].normal_force);
        assert!(a > 0.1 && (a - b).abs() < 1e-4 * a, "{name}: {a} {b}");
    }
}

/// The friction force of a prescribed bound under full slip is the bound times the length of the obstacle, wherever it ends.
#[test]
fn an_obstacle_that_ends_inside_an_edge_rubs_up_to_its_end() {
    let x: Vec<f64> = (-16..=16).map(|i| 0.25 * f64::from(i)).collect();
    for (half, obstacle) in [
        (
            2.45,
            json!({"kind": "parabola", "radius": 8, "from": -2.45, "to": 2.45}),
        ),
        (
            2.26,
            json!({"kind": "parabola", "radius": 8, "from": -2.26, "to": 2.26}),
        ),
        (
            2.4,
            json!({"kind": "polyline", "points": [[-2.4, 0.3], [-1.2, 0.1], [0, 0], [1.2, 0.1], [2.4, 0.3]]}),
        ),
        (
            1.97,
            json!({"kind": "table", "x": [-1.97, -0.5, 0.5, 1.97], "gap": [0.3, 0, 0, 0.3]}),
        ),
    ] {
        for refine in [json!(0), json!(1), json!({"tolerance": 0.02})] {
            let solution = solved(&json!({
                "analysis": {"kind": "plane_strain"},
                "mesh": {"grid": {"x": x, "y": [-4, -3, -2.2, -1.6, -1.1, -0.7, -0.4, -0.2, 0]}, "refine": refine},
                "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
                "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
                "contacts": [{"boundary": "top", "obstacle": obstacle, "indentation": 0.08, "tangential_displacement": 0.5,
                    "friction": {"bound": 3, "elastic_slip": 1e-4}}],
            }));
            let force = solution.summary.friction_force;
            assert!(
                (force - 6.0 * half).abs() < 1e-6,
                "{refine} {obstacle}: {force}"
            );
            assert!(!warns(&solution, WarningCode::ObstacleCutsEdge));
        }
    }
}

/// A block of two materials side by side under a round obstacle.
fn halves(second: f64, coefficient: f64, to: f64, refine: u32) -> Value {
    let x: Vec<f64> = (-16..=16).map(|i| 0.125 * f64::from(i)).collect();
    let mut contact = json!({"boundary": "top", "obstacle": {"kind": "parabola", "radius": 4}, "indentation": 0.15});
    if coefficient > 0.0 {
        contact["friction"] =
            json!({"coefficient": coefficient, "nonlocal_radius": 0.1, "elastic_slip": 1e-4});
    }
    json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grid": {"x": x, "y": [-2, -1.5, -1.1, -0.8, -0.6, -0.45, -0.3, -0.2, -0.1, 0]},
            "groups": {"second": {"x": [-2, to]}}, "refine": refine},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3},
            {"youngs_modulus": second, "poissons_ratio": 0.3, "group": "second"}],
        "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
        "contacts": [contact],
    })
}

/// Friction across the interface of two materials makes the pressure grow with the logarithm of the distance.
#[test]
fn the_pressure_where_materials_meet_has_no_limit() {
    for second in [5000.0, 200.0] {
        let mut peaks = Vec::new();
        for refine in [0, 1, 2] {
            let solution = solved(&halves(second, 0.2, 0.0, refine));
            let peak = quantity(&solution, QuantityName::PeakNormalStress);
            assert_eq!(
                (peak.method, peak.error),
                (ErrorMethod::NoLimit, None),
                "{second} {refine}"
            );
            assert!(warns(&solution, WarningCode::MaterialJunction));
            // what friction averages has one
            let traction = quantity(&solution, QuantityName::PeakTangentialStress);
            assert_ne!(traction.method, ErrorMethod::NoLimit);
            peaks.push(
                solution.summary.contacts["top"]
                    .peak_normal_stress
                    .unwrap()
                    .value,
            );
        }
        if second > 1000.0 {
            // and it does grow
            assert!(peaks[2] < 1.05 * peaks[0], "{peaks:?}");
        }
    }
}

/// Without friction a smooth obstacle is a line of symmetry, across which a straight interface goes on: no singularity. Nor
/// is there one of equal materials, or outside of the contact.
#[test]
fn materials_that_meet_without_a_singularity_give_no_warning() {
    for (what, second, coefficient, to) in [
        ("no friction", 5000.0, 0.0, 0.0),
        ("equal materials", 1000.0, 0.2, 0.0),
        ("outside", 5000.0, 0.2, -1.75),
    ] {
        let solution = solved(&halves(second, coefficient, to, 0));
        assert!(!warns(&solution, WarningCode::MaterialJunction), "{what}");
        let peak = quantity(&solution, QuantityName::PeakNormalStress);
        assert_ne!(peak.method, ErrorMethod::NoLimit, "{what}");
    }
}

/// The points of a measured table are hundreds of small kinks, some to each side: together they do not add up.
#[test]
fn many_small_kinks_do_not_add_up() {
    let x: Vec<f64> = (-50..=50).map(|i| 0.05 * f64::from(i)).collect();
    let mut dice = Rng::with_seed(1);
    let points: Vec<f64> = (-480..=480).map(|i| 0.005 * f64::from(i)).collect();
    let mut gap = |rough: f64| -> Vec<f64> {
        let of = |x: &f64| x * x / 8.0 + rough * (dice.f64() - 0.5);
        points.iter().map(of).collect()
    };
    let solution = |gap: Vec<f64>| {
        solved(&json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"grid": {"x": x, "y": [-3, -2.2, -1.6, -1.2, -0.9, -0.7, -0.5, -0.4, -0.3, -0.25, -0.2, -0.15, -0.1, -0.05, 0]}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
            "contacts": [{"boundary": "top", "obstacle": {"kind": "table", "x": points, "gap": gap}, "indentation": 0.1,
                "friction": {"coefficient": 0.3, "nonlocal_radius": 0.1, "elastic_slip": 1e-4}}],
        }))
    };
    let [rough, smooth] = [3e-4, 0.0].map(|rough| solution(gap(rough)));
    assert!(warns(&rough, WarningCode::KinkInContact));
    let (own, expected) = (
        quantity(&rough, QuantityName::FrictionForce),
        quantity(&smooth, QuantityName::FrictionForce),
    );
    let error = own.error.unwrap();
    assert!(
        (own.value - expected.value).abs() < error,
        "{own:?} {expected:?}"
    );
    assert!(error < 0.1 * own.value, "{own:?}");
}

/// A ring cannot widen; along its axis it moves as it likes, also pressed onto a shaft.
#[test]
fn a_ring_that_is_dragged_away_from_the_axis_is_reported() {
    let told = |boundary: &str, indentation: f64, drag: f64| {
        let value = json!({
            "analysis": {"kind": "axisymmetric"},
            "mesh": {"grid": {"x": [1, 1.5, 2, 2.5, 3], "y": [-2, -1.5, -1, -0.5, 0]}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
            "contacts": [{"boundary": boundary, "obstacle": {"kind": "flat", "along": "arc_length", "from": 0.5, "to": 1.5},
                "indentation": indentation, "tangential_displacement": drag,
                "friction": {"coefficient": 0.3, "nonlocal_radius": 0.1, "elastic_slip": 0.001}}],
        });
        let checked = solver::check(&problem(&value.to_string()), None).unwrap();
        checked
            .warnings
            .iter()
            .any(|w| w.code == WarningCode::RadialDrag)
    };
    assert!(told("top", 0.01, 0.05));
    assert!(!told("top", 0.01, 0.0));
    assert!(!told("right", 0.01, 0.05));
}

/// Thesis 4.3: the sheet is free or jammed, whatever the friction.
fn sheet(indentation: f64, coefficient: f64) -> Value {
    json!({
        "analysis": {"kind": "plane_stress", "thickness": 0.02},
        "mesh": {"grid": {"x": [0, 0.5, 1, 1.1, 1.2, 1.3, 1.4, 1.5, 1.6, 1.7, 1.8, 1.9, 2, 2.1, 2.2, 2.3, 2.4, 2.5, 2.6, 2.8, 3, 3.5, 4, 5],
            "y": [0, 0.5, 0.8, 1], "top": [[0, 1], [1, 1], [3, 0.5], [5, 0.5]]},
            "boundaries": {"taper": {"side": "top", "x": [1, 3]}}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "bottom", "uy": 0}, {"boundary": "right", "ux": 0.1}],
        "contacts": [{"boundary": "taper", "obstacle": {"kind": "parabola", "radius": 4, "center": 1.030_776_406_404_415_1, "along": "arc_length"},
            "indentation": indentation, "tangential_displacement": 1,
            "friction": {"coefficient": coefficient, "nonlocal_radius": 0.05, "elastic_slip": 1e-4}}],
    })
}

#[test]
fn the_verdict_on_one_of_two_solutions_is_not_good() {
    for accuracy in ["estimate", "verify"] {
        let mut value = sheet(-0.04, 0.8);
        value["solver"] = json!({"check_uniqueness": true, "accuracy": accuracy});
        let solution = solved(&value);
        assert!(warns(&solution, WarningCode::NotUnique));
        let accuracy = solution.summary.accuracy.unwrap();
        assert_eq!(accuracy.verdict, Verdict::Poor);
        let told = accuracy
            .reasons
            .iter()
            .filter(|r| r.contains("second solution"));
        assert_eq!(told.count(), 1, "{:?}", accuracy.reasons);
    }
}

/// Where a warning says that the mesh is too coarse, stated errors promise too much: a flat on four elements is 1.9 of them off,
/// and was `good`. On six elements and more, and where they are shorter than the radius, they hold and the verdict is `good`.
#[test]
fn beside_the_warning_of_a_coarse_mesh_no_verdict_is_good() {
    let block = |across: u32, friction: Option<f64>, accuracy: &str| {
        let side = 4.0 / f64::from(across);
        let lines = |count: u32| -> Vec<f64> { (0..=count).map(|i| side * f64::from(i)).collect() };
        let mut contact =
            json!({"boundary": "top", "obstacle": {"kind": "flat"}, "indentation": 0.05});
        if let Some(radius) = friction {
            contact["friction"] =
                json!({"coefficient": 0.05, "nonlocal_radius": radius, "elastic_slip": 0.01});
        }
        let solution = solved(&json!({
            "analysis": {"kind": "plane_stress", "thickness": 0.5},
            "mesh": {"grid": {"x": lines(across), "y": lines(across / 2)}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
            "contacts": [contact],
            "solver": {"accuracy": accuracy},
        }));
        let coarse = [
            WarningCode::MeshTooCoarseForContact,
            WarningCode::MeshTooCoarseForRadius,
        ]
        .into_iter()
        .filter(|code| warns(&solution, *code))
        .map(|code| code.as_str())
        .collect::<Vec<_>>();
        let accuracy = solution.summary.accuracy.clone().unwrap();
        for code in &coarse {
            let told = accuracy.reasons.iter().any(|r| r.contains(code));
            assert!(told, "{code}: {:?}", accuracy.reasons);
        }
        (coarse, accuracy.verdict, solution.summary.normal_force)
    };
    // of 64 and 128 elements, whose force converges like the side
    let right = 51.2838;
    for accuracy in ["estimate", "verify"] {
        let (coarse, verdict, force) = block(4, None, accuracy);
        assert_eq!(coarse, ["mesh_too_coarse_for_contact"]);
        assert_eq!(verdict, Verdict::Fair);
        assert!((force - right).abs() > 0.12);
    }
    for across in [6, 8, 16] {
        let (coarse, verdict, force) = block(across, None, "estimate");
        assert_eq!((coarse.len(), verdict), (0, Verdict::Good));
        assert!((force - right).abs() < 0.01 * right);
    }
    for (radius, coarse, verdict) in [
        (0.1, &["mesh_too_coarse_for_radius"][..], Verdict::Fair),
        (0.3, &[][..], Verdict::Good),
    ] {
        let found = block(16, Some(radius), "estimate");
        assert_eq!((&found.0[..], found.1), (coarse, verdict));
    }
}

/// Across the fold, from either side, every row is its member's own solution.
#[test]
fn rows_of_a_sweep_do_not_depend_on_the_order_of_members() {
    let quiet = &mut ();
    let up: Vec<f64> = (-6..=2).map(|i| 0.01 * f64::from(i)).collect();
    let down: Vec<f64> = up.iter().rev().copied().collect();
    let mut jammed = 0;
    for coefficient in [0.8, 1.2, 2.0] {
        for order in [&up, &down] {
            let problems: Vec<Problem> = order
                .iter()
                .map(|d| problem(&sheet(*d, coefficient).to_string()))
                .collect();
            let mut family = Family::new(&problems[0], None, quiet).unwrap();
            let mut end: Option<End> = None;
            for (problem, d) in problems.iter().zip(order) {
                let start = end.as_ref().map_or(Start::Anew, Start::Next);
                let (member, own_end) = family.member(problem, start, quiet).unwrap();
                end = own_end.or(end);
                let own = Member::of(&solver::solve(problem, quiet).unwrap().summary);
                assert_eq!(member.outcome, own.outcome);
                let off = (member.normal_force - own.normal_force).abs();
                assert!(
                    off <= 1e-7 * own.normal_force.max(1.0),
                    "{coefficient} {d}: {} {}",
                    member.normal_force,
                    own.normal_force
                );
                jammed += usize::from(own.normal_force > 1.0);
            }
        }
    }
    assert!(jammed > 10, "{jammed}");
}

/// Half of a symmetric problem and the whole of it state the same relative errors of forces, extents and the highest pressure,
/// and without friction have one verdict. (Peaks of σ_t and ends of stick are those of one side, which a small force on the
/// whole may move without the other: their errors are not those of the half.)
#[test]
fn half_and_whole_state_the_same_errors() {
    let mut seen = Vec::new();
    for (obstacle, indentation) in [
        (json!({"kind": "parabola", "radius": 8}), 0.05),
        (json!({"kind": "parabola", "radius": 4}), 0.1),
        (json!({"kind": "circle", "radius": 6}), 0.2),
        (json!({"kind": "wedge", "angle": 4}), 0.08),
        (
            json!({"kind": "rounded_flat", "half_width": 0.4, "radius": 0.5}),
            0.03,
        ),
    ] {
        for coefficient in [0.0, 0.1, 0.4] {
            for spacing in [0.2, 0.1, 0.05] {
                let model = |from: i32| {
                    let count = (2.0 / spacing) as i32;
                    let mut x: Vec<f64> = (from.max(-count)..=count)
                        .map(|i| spacing * f64::from(i))
                        .collect();
                    x.push(4.0);
                    if from < 0 {
                        x.insert(0, -4.0);
                    }
                    let supports = match from < 0 {
                        true => json!([{"boundary": "bottom", "ux": 0, "uy": 0}]),
                        false => {
                            json!([{"boundary": "bottom", "ux": 0, "uy": 0}, {"boundary": "left", "ux": 0}])
                        }
                    };
                    let mut contact = json!({"boundary": "top", "obstacle": obstacle, "indentation": indentation});
                    if coefficient > 0.0 {
                        contact["friction"] = json!({"coefficient": coefficient, "nonlocal_radius": 0.1, "elastic_slip": 1e-4});
                    }
                    let y: Vec<f64> = [4.0, 2.0, 1.0]
                        .into_iter()
                        .chain((0..6).map(|k| 0.1 * f64::from(5 - k)))
                        .map(|y| -y)
                        .collect();
                    solved(&json!({
                        "analysis": {"kind": "plane_strain"},
                        "mesh": {"grid": {"x": x, "y": y}},
                        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
                        "supports": supports,
                        "contacts": [contact],
                    }))
                };
                let [half, whole] = [model(0), model(-1000)].map(|s| s.summary);
                assert!((2.0 * half.normal_force / whole.normal_force - 1.0).abs() < 1e-6);
                let [half, whole] = [half, whole].map(|s| s.accuracy.unwrap());
                let kink = obstacle["kind"] == "wedge";
                for (name, most) in [
                    // what stands out is judged alike, and the rest of the weighted errors cancels or is small
                    (QuantityName::NormalForce, 0.02),
                    (QuantityName::ContactEnd, 1e-9),
                    // at a line of symmetry stresses are recovered from one side only
                    (QuantityName::PeakNormalStress, 0.2),
                    // a kink at a node is one edge's, in the whole as well
                    (QuantityName::FrictionForce, if kink { 0.8 } else { 0.2 }),
                ] {
                    let of = |all: &[EstimatedQuantity]| {
                        all.iter()
                            .find(|q| q.quantity == name)
                            .and_then(|q| q.relative)
                    };
                    let (a, b) = (of(&half.quantities), of(&whole.quantities));
                    let close = match (a, b) {
                        (Some(a), Some(b)) => (a - b).abs() <= most * b + 1e-9,
                        (a, b) => a == b,
                    };
                    assert!(
                        close,
                        "{obstacle} {coefficient} {spacing} {name:?}: {a:?} {b:?}"
                    );
                }
                if coefficient == 0.0 {
                    assert_eq!(half.verdict, whole.verdict, "{obstacle} {spacing}");
                }
                seen.push(half.verdict);
            }
        }
    }
    for verdict in [Verdict::Good, Verdict::Fair, Verdict::Poor] {
        assert!(seen.contains(&verdict), "{seen:?}");
    }
}
