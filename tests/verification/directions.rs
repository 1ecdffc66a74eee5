//! A `direction` of the indentation, in which gaps are linear, against the same obstacle drawn where the push leaves it.

use serde_json::{Value, json};
use solver::problem::Problem;
use solver::solution::{ErrorMethod, QuantityName, Solution, Verdict, WarningCode};

use crate::support::{Lattice, problem, solve};

/// A block 4 wide and 3 high, clamped at its foot, or a sector of a ring between two radii about the origin, clamped inside or
/// outside, so that the other side is the contact `face`.
fn body(kind: &str, contact: &Value) -> Problem {
    // midsides in the middle
    let depth = |j: usize| {
        let corner = |j: usize| (1.0 - j as f64 / 14.0).powi(2);
        0.5 * (corner(j - j % 2) + corner(j + j % 2))
    };
    let block = |i: usize, j: usize| [i as f64 / 25.0 - 2.0, -3.0 * depth(j)];
    // from left to right below the origin, seen from inside; or from right to left, seen from outside
    let sector = |inner: bool| {
        move |i: usize, j: usize| {
            let (u, depth) = (i as f64 / 100.0, depth(j));
            let (r, u) = match inner {
                true => (1.0 + depth, u),
                false => (1.0 - 0.5 * depth, 1.0 - u),
            };
            let angle = (-160.0 + 140.0 * u).to_radians();
            [r * angle.cos(), r * angle.sin()]
        }
    };
    let lattice = match kind {
        "block" => Lattice::new(50, 7, block),
        "hole" => Lattice::new(50, 7, sector(true)),
        _ => Lattice::new(50, 7, sector(false)),
    };
    let mut contact = contact.clone();
    contact["boundary"] = json!("face");
    let value = json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"inline": {"nodes": lattice.nodes, "elements": lattice.elements, "boundaries": {
            "foot": lattice.edges(50, |k| (k, 0)), "face": lattice.edges(50, |k| (k, 14)),
        }}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "foot", "ux": 0, "uy": 0}],
        "contacts": [contact],
    });
    problem(&value.to_string())
}

/// The lower half of a circle, by points.
fn arc(center: [f64; 2], radius: f64) -> Vec<[f64; 2]> {
    let angle = |k: i32| (-90.0 + 0.425 * f64::from(k)).to_radians();
    (-200..=200)
        .map(|k| {
            [
                center[0] + radius * angle(k).cos(),
                center[1] + radius * angle(k).sin(),
            ]
        })
        .collect()
}

fn polyline(points: Vec<[f64; 2]>) -> Value {
    json!({"kind": "polyline", "points": points, "interpolation": "cubic"})
}

fn told(solution: &Solution) -> bool {
    let mut all = solution.summary.warnings.iter();
    all.any(|w| w.code == WarningCode::DirectionIsLinear)
}

/// How the linear problem differs from its twin: forces and peaks within the stated errors, ends within them and a node; not
/// `good` where a force is off by more than 1 %. The relative difference of forces, and whether it is told.
fn compared(what: &str, linear: &Problem, twin: &Problem) -> (f64, bool) {
    let (own, other) = (solve(linear), solve(twin));
    let accuracy = own.summary.accuracy.as_ref().unwrap();
    let right = &other.summary.accuracy.as_ref().unwrap().quantities;
    let off = own.summary.normal_force / other.summary.normal_force - 1.0;
    for own in &accuracy.quantities {
        use QuantityName::*;
        let same = right.iter().filter(|q| q.quantity == own.quantity);
        let off = same
            .map(|q| (q.value - own.value).abs())
            .fold(f64::INFINITY, f64::min);
        let error = match own.quantity {
            NormalForce | TangentialForce | FrictionForce | PeakNormalStress
            | PeakTangentialStress => own.error,
            ContactStart | ContactEnd => own.error.map(|error| error + 0.04),
            _ => continue,
        };
        if error.is_none() && own.method != ErrorMethod::NoLimit {
            assert_eq!(accuracy.verdict, Verdict::Poor, "{what}: {own:?}");
        }
        assert!(
            error.is_none_or(|e| off <= e),
            "{what}: off {off} of {own:?}"
        );
    }
    let good = accuracy.verdict == Verdict::Good;
    assert!(!good || off.abs() < 0.01, "{what}: {off}");
    (off.abs(), told(&own))
}

const DIRECTIONS: [[f64; 2]; 4] = [[0.0, -1.0], [0.3, -1.0], [-0.8, -1.0], [1.2, -1.0]];

/// A circle, a parabola and a table along a straight side, and a circle by its points: the twin has its centre elsewhere.
#[test]
fn an_obstacle_before_a_straight_side_is_as_if_it_were_drawn_there() {
    let (mut large, mut count) = (0, 0);
    for kind in ["circle", "parabola", "table", "polyline"] {
        for (radius, depth) in [(1.0, 0.1), (1.0, 0.01), (4.0, 0.1)] {
            for [x, y] in DIRECTIONS {
                for normal in ["body", "obstacle"] {
                    let by = [depth * x, depth * y];
                    let at = |center: [f64; 2]| match kind {
                        "polyline" => polyline(arc([center[0], center[1] + radius], radius)),
                        "table" => {
                            let x: Vec<f64> = (-100..=100)
                                .map(|k| center[0] + 0.02 * radius.min(1.5) * f64::from(k))
                                .collect();
                            let gap = x.iter().map(|x| (x - center[0]).powi(2) / (2.0 * radius));
                            json!({"kind": kind, "x": x, "gap": gap.collect::<Vec<_>>(), "interpolation": "cubic"})
                        }
                        _ => json!({"kind": kind, "radius": radius, "center": center[0]}),
                    };
                    let indentation = depth * x.hypot(y);
                    let linear = json!({"obstacle": at([0.0, 0.0]), "normal": normal,
                        "direction": [x, y], "indentation": indentation});
                    let left = if kind == "polyline" { 0.0 } else { -by[1] };
                    let twin = json!({"obstacle": at(by), "normal": normal, "indentation": left});
                    let what = format!("{kind} {radius} {by:?} {normal}");
                    let [linear, twin] = [linear, twin].map(|c| body("block", &c));
                    let (off, told) = compared(&what, &linear, &twin);
                    assert!(off > 0.001 || !told || normal == "body", "{what}: {off}");
                    assert!(off < 0.01 || told, "{what}: {off}");
                    // straight on, nothing is linear
                    assert!(x != 0.0 || off < 1e-9 && !told, "{what}: {off}");
                    large += u32::from(off > 0.01);
                    count += 1;
                }
            }
        }
    }
    assert!(large > 8, "{large} of {count}");
}

/// What a push across the body drags along, with friction: as a tangential displacement does that of an obstacle drawn where the
/// push leaves it.
#[test]
fn a_push_across_the_body_drags_it() {
    for kind in ["circle", "parabola"] {
        for (radius, depth) in [(1.0, 0.05), (4.0, 0.1)] {
            for [x, y] in DIRECTIONS {
                for (coefficient, nonlocal_radius) in [(0.2, 0.0), (0.5, 0.3)] {
                    let by = [depth * x, depth * y];
                    let friction = json!({"coefficient": coefficient, "elastic_slip": 0.01 * depth,
                        "nonlocal_radius": nonlocal_radius});
                    let at =
                        |center: f64| json!({"kind": kind, "radius": radius, "center": center});
                    let linear = json!({"obstacle": at(0.0), "direction": [x, y],
                        "indentation": depth * x.hypot(y), "friction": friction});
                    let twin = json!({"obstacle": at(by[0]), "indentation": -by[1],
                        "tangential_displacement": by[0], "friction": friction});
                    let what = format!("{kind} {radius} {by:?} {coefficient}");
                    let [linear, twin] = [linear, twin].map(|c| body("block", &c));
                    let (off, told) = compared(&what, &linear, &twin);
                    assert!(off < 0.01 || told, "{what}: {off}");
                }
            }
        }
    }
}

/// At a circle's flank its side is vertical: a node there is below no point of it, however the body moves.
#[test]
fn a_node_at_the_flank_of_a_circle_does_not_touch_it() {
    for push in [
        json!({}),
        json!({"direction": [0.5, -1.0]}),
        json!({"direction": [-0.5, -1.0]}),
    ] {
        for center in [0.0, 0.04, 0.24] {
            // nodes lie at every .04
            let mut contact = json!({"obstacle": {"kind": "circle", "radius": 1.0, "center": center},
                "normal": "obstacle", "indentation": 0.05});
            contact
                .as_object_mut()
                .unwrap()
                .extend(push.as_object().unwrap().clone());
            let solution = solve(&body("block", &contact));
            let [start, end] = solution.summary.contacts["face"].contact[0];
            assert_eq!(
                solution.summary.contacts["face"].contact.len(),
                1,
                "{contact}"
            );
            assert!(end - start < 1.2, "{contact}: {start} {end}");
        }
    }
}

/// A pin in a hole and a saddle on a shaft, pushed and drawn back.
#[test]
fn a_curve_before_a_curved_side_is_as_if_it_were_drawn_there() {
    let (mut large, mut small) = (0, 0);
    for (kind, radius, center) in [
        ("hole", 0.9, [0.0, -0.1]),
        ("hole", 0.5, [0.0, -0.5]),
        ("hole", 0.9, [0.05, -0.2]),
        ("shaft", 1.5, [0.0, 0.5]),
    ] {
        for normal in ["body", "obstacle"] {
            for [x, y] in DIRECTIONS {
                for depth in [0.002, 0.03, 0.1] {
                    // a shaft is pressed from below; what overlaps by the most is drawn back
                    let sign = match (kind, center[1]) {
                        ("shaft", _) => -1.0,
                        (_, -0.2) => -0.7,
                        _ => 1.0,
                    };
                    let by = [sign * depth * x, sign * depth * y];
                    let moved = [center[0] + by[0], center[1] + by[1]];
                    let indentation = sign * depth * x.hypot(y);
                    let linear = json!({"obstacle": polyline(arc(center, radius)), "normal": normal,
                        "direction": [x, y], "indentation": indentation});
                    let twin = json!({"obstacle": polyline(arc(moved, radius)), "normal": normal});
                    let what = format!("{kind} {radius} {by:?} {normal}");
                    let [linear, twin] = [linear, twin].map(|c| body(kind, &c));
                    let (off, told) = compared(&what, &linear, &twin);
                    assert!(off < 0.015 || told, "{what}: {off}");
                    large += u32::from(off > 0.01);
                    small += u32::from(!told);
                }
            }
        }
    }
    assert!(large > 10 && small > 10, "{large} {small}");
}

/// Pushed along the body, an obstacle that only touches it goes into it; the linear gaps say nothing of that.
#[test]
fn an_obstacle_that_only_the_displacement_brings_to_the_body_is_reported() {
    let contact = json!({"obstacle": polyline(arc([0.0, -0.1], 0.899)), "normal": "obstacle",
        "direction": [1, 0], "indentation": 0.3});
    let solution = solve(&body("hole", &contact));
    assert!(told(&solution), "{:?}", solution.summary.warnings);
}
