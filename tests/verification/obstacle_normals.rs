//! `normal: obstacle`: gap and displacement along the obstacle's own normal, formulation 1.2.

use serde_json::{Value, json};
use solver::model::{ContactModel, Level, Model};
use solver::solution::WarningCode;

use crate::support::{problem, solve};

/// The top of a block (y = 1, 0 ≤ x ≤ 4) under an obstacle.
fn top(obstacle: Value, normal: &str) -> ContactModel {
    let text = json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grid": {"x": [0, 1, 2, 3, 4], "y": [0, 1]}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
        "contacts": [{"boundary": "top", "obstacle": obstacle, "indentation": 0.2, "normal": normal}],
    });
    Model::new(&problem(&text.to_string()), None)
        .unwrap()
        .contacts
        .remove(0)
}

#[track_caller]
fn near(a: f64, b: f64) {
    assert!((a - b).abs() < 1e-12, "{a}, not {b}");
}

/// A straight line at 30° through (0, 1.5): along the body's normal it is at 0.5 + x tan 30°; the
/// perpendicular distance of a node is that times cos 30°. The line pushed down by .2 is nearer by
/// .2 cos 30°.
#[test]
fn the_gap_to_a_line_is_its_perpendicular_distance() {
    let line = json!({"kind": "line", "point": [0, 1.5], "angle": 30});
    let (s, c) = 30f64.to_radians().sin_cos();
    let (body, own) = (top(line.clone(), "body"), top(line, "obstacle"));
    let mut half = Level::FULL;
    half.motions[0] = 0.5;
    for i in 0..9 {
        let distance = 0.5 + body.boundary.positions[i][0] * s / c;
        near(body.profile[i], distance);
        near(body.gap(i, &half), distance - 0.1);
        near(own.profile[i], distance * c);
        near(own.gap(i, &half), (distance - 0.1) * c);
        let (n, t) = (own.boundary.normals[i], own.boundary.tangent(i));
        near(n[0], -s);
        near(n[1], c);
        near(t[0], c);
        near(t[1], s);
    }
}

/// The same line as a slope, a table and a polyline.
#[test]
fn one_face_described_in_four_ways_is_one_obstacle() {
    let slope = 30f64.to_radians().tan();
    let at = |x: f64| 0.5 + slope * x;
    let line = top(
        json!({"kind": "line", "point": [0, 1.5], "angle": 30}),
        "obstacle",
    );
    for other in [
        json!({"kind": "tilted", "slope": slope, "center": -0.5 / slope}),
        json!({"kind": "table", "x": [0, 1.7, 4], "gap": [at(0.0), at(1.7), at(4.0)]}),
        json!({"kind": "polyline", "points": [[0, 1.0 + at(0.0)], [1.7, 1.0 + at(1.7)], [4, 1.0 + at(4.0)]]}),
    ] {
        let other = top(other, "obstacle");
        for i in 0..9 {
            near(other.profile[i], line.profile[i]);
            (0..2).for_each(|a| near(other.push[i][a], line.push[i][a]));
            (0..2).for_each(|a| near(other.boundary.normals[i][a], line.boundary.normals[i][a]));
        }
    }
}

/// On a circle of centre (2, 1 + R) the obstacle's normal out of the body points at the centre; the
/// tangent at the foot of the body's normal is at (R − √(R² − c²)) · cos of the turn.
#[test]
fn the_normal_of_a_circle_points_at_its_centre() {
    let radius = 5.0;
    let contact = top(
        json!({"kind": "circle", "radius": radius, "center": 2}),
        "obstacle",
    );
    for i in 0..9 {
        let c = contact.boundary.positions[i][0] - 2.0;
        let root = f64::sqrt(radius * radius - c * c);
        let [x, y] = contact.boundary.normals[i];
        near(x, -c / radius);
        near(y, root / radius);
        near(contact.profile[i], (radius - root) * root / radius);
    }
    assert_eq!(contact.power, Some(2.0));
}

/// At the apex of a wedge, between its two faces, the mean of their slopes: the body's own normal.
#[test]
fn a_wedge_has_the_bodys_normal_at_its_apex() {
    let contact = top(
        json!({"kind": "wedge", "angle": 20, "center": 2}),
        "obstacle",
    );
    assert_eq!(contact.boundary.normals[4], [0.0, 1.0]);
    let (s, c) = 20f64.to_radians().sin_cos();
    for (i, sign) in [(3, 1.0), (5, -1.0)] {
        near(contact.boundary.normals[i][0], sign * s);
        near(contact.boundary.normals[i][1], c);
    }
    assert_eq!(contact.power, Some(1.0));
}

/// A boundary that runs against x: the bottom's t is −x, and the slope of its profile turns sign with it.
#[test]
fn a_lower_boundary_turns_its_normal_in_the_other_direction() {
    let text = json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grid": {"x": [0, 1, 2], "y": [0, 1]}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "top", "ux": 0, "uy": 0}],
        "contacts": [{"boundary": "bottom", "obstacle": {"kind": "tilted", "slope": 0.75}, "normal": "obstacle"}],
    });
    let contact = Model::new(&problem(&text.to_string()), None)
        .unwrap()
        .contacts
        .remove(0);
    // the obstacle falls away downwards to the right: its face is the line y = −.75 x
    for i in 0..5 {
        near(contact.boundary.normals[i][0], -0.6);
        near(contact.boundary.normals[i][1], -0.8);
        near(contact.profile[i], 0.6 * contact.boundary.positions[i][0]);
    }
}

/// Forces of a sloping face lie along its own normal: a block pressed down on an incline of slope 3/4
/// without friction, kept from sliding by a roller on its right, weighs W = Y cos α on it, and the
/// roller bears Y sin α. With the body's normal it would be Y = W.
#[test]
fn a_block_on_an_incline_is_pushed_sideways() {
    let force = |normal: &str| {
        let text = json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"grid": {"x": [0, 1, 1.5, 2], "y": [0, 1]}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "right", "ux": 0}],
            "loads": [{"body_force": [0, -4]}],
            "contacts": [{"boundary": "bottom", "obstacle": {"kind": "tilted", "slope": -0.75, "to": 1.5}, "normal": normal}],
        });
        solve(&problem(&text.to_string())).summary
    };
    let weight = 8.0;
    for (normal, exact) in [("obstacle", weight / 0.8), ("body", weight)] {
        let summary = force(normal);
        assert!(
            (summary.normal_force / exact - 1.0).abs() < 1e-10,
            "{normal}: {}",
            summary.normal_force
        );
        assert!(summary.residuals.equilibrium < 1e-10, "{normal}");
    }
}

/// A cylinder of R = 8 pushed by .1 into a block [0, 4] × [−8, 0], half of it; `friction` as JSON.
fn cylinder(normal: &str, friction: Value) -> solver::solution::Solution {
    let mut x: Vec<f64> = (0..=70).map(|k| f64::from(k) * 0.02).collect();
    x.extend(&crate::support::graded(1.4, 4.0, 0.02, 1.3)[1..]);
    let y: Vec<f64> = crate::support::graded(0.0, -8.0, 0.02, 1.3)
        .into_iter()
        .rev()
        .collect();
    let mut p = json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grid": {"x": x, "y": y}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "left", "ux": 0}, {"boundary": "bottom", "uy": 0}],
        "contacts": [{"boundary": "top", "normal": normal, "indentation": 0.1,
            "obstacle": {"kind": "circle", "radius": 8, "from": 0, "to": 1.4}}],
    });
    if !friction.is_null() {
        p["contacts"][0]["friction"] = friction;
    }
    solve(&problem(&p.to_string()))
}

/// The vertical load as an independent finite element program (GetFEM) finds it with either normal, full
/// load: a tenth of a percent, for its mesh is another.
#[test]
fn the_vertical_loads_agree_with_another_program_for_both_normals() {
    let friction =
        json!({"coefficient": 0.3, "nonlocal_radius": 0, "elastic_slip": 1e-6, "points": "nodal"});
    for (normal, friction, published) in [
        ("body", Value::Null, 49.602),
        ("body", friction.clone(), 50.038),
        ("obstacle", Value::Null, 49.954),
        ("obstacle", friction, 50.251),
    ] {
        let name = if friction.is_null() {
            "frictionless"
        } else {
            "μ = .3"
        };
        let solution = cylinder(normal, friction);
        let profile = &solution.node_profiles["top"];
        // the vertical part of p m and σ_t t, by Simpson's rule
        let vertical = |i: usize| {
            let slope = match normal {
                "body" => 0.0,
                _ => profile.x[i] / (64.0 - profile.x[i] * profile.x[i]).sqrt(),
            };
            (-profile.normal_stress[i] - profile.tangential_stress[i] * slope) / slope.hypot(1.0)
        };
        let load: f64 = (0..profile.s.len() - 1)
            .step_by(2)
            .map(|k| {
                (profile.s[k + 2] - profile.s[k]) / 6.0
                    * (vertical(k) + 4.0 * vertical(k + 1) + vertical(k + 2))
            })
            .sum();
        let what = format!("cylinder, normal of the {normal}, {name}: vertical load");
        crate::record::held(
            0,
            &what,
            "block 4 × 8, h = .02",
            2.0 * load,
            published,
            1e-3,
        );
    }
}

/// The obstacle moves straight down, and what sticks to its sloping face with it; before that a node
/// meets the face along the face's normal. Only the elastic slip lies between.
#[test]
fn points_that_stick_to_a_sloping_face_move_with_it() {
    let friction =
        json!({"coefficient": 50, "nonlocal_radius": 0, "elastic_slip": 1e-6, "points": "nodal"});
    let solution = cylinder("obstacle", friction);
    let (fields, profile) = (&solution.fields, &solution.node_profiles["top"]);
    let mut stuck = 0;
    for i in 0..profile.s.len() {
        if profile.state[i] != solver::solution::NodeState::Stick {
            continue;
        }
        let (x, sine) = (profile.x[i], profile.x[i] / 8.0);
        let distance = profile.gap[i] + 0.1 * (1.0 - sine * sine).sqrt();
        let node = (0..fields.x.len())
            .find(|&n| fields.x[n] == x && fields.y[n] == 0.0)
            .unwrap();
        assert!(
            (fields.ux[node] + distance * sine).abs() < 1.001e-6,
            "x = {x}: u_x = {}, met at {}",
            fields.ux[node],
            -distance * sine
        );
        stuck += 1;
    }
    assert!(stuck > 20, "{stuck}");
}

/// A curve that runs round the body faces each side with the part in front of it: the one behind, though
/// nearer, lies beyond the body's other side.
#[test]
fn an_obstacle_behind_the_body_is_not_in_contact() {
    let text = json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grid": {"x": [0, 1, 2], "y": [-4, -2, 0]}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
        "contacts": [{"boundary": "top", "obstacle": {"kind": "polyline", "points": [[-1, 5], [9, 5], [9, -4.5], [-1, -4.5]]}}],
    });
    let model = |text: &Value| Model::new(&problem(&text.to_string()), None).unwrap();
    assert!(
        model(&text).contacts[0]
            .profile
            .iter()
            .all(|gap| (gap - 5.0).abs() < 1e-12)
    );
    // one that cuts the surface from the start is felt, though there is more of it in front
    let mut cut = text;
    cut["contacts"][0]["obstacle"]["points"] = json!([[-1, 5], [9, 5], [9, -0.1], [-1, -0.1]]);
    assert!(
        model(&cut).contacts[0]
            .profile
            .iter()
            .all(|gap| (gap + 0.1).abs() < 1e-12)
    );
}

/// A top that falls from x = 1 on, and an obstacle along one of its two parts that ends at the corner between them: the
/// contact ends there, with the normal of its own edge, and gaps are measured along that. Obstacles parallel to the part
/// press on it as a flat does, as overlaps and pushed, whatever they are made of. 68.519 of an independent program.
#[test]
fn an_obstacle_that_ends_at_a_corner_is_measured_along_the_normal_of_its_contact() {
    let force = |mut obstacle: Value, end: Value, indentation: f64, normal: &str| {
        for (key, value) in end.as_object().unwrap() {
            obstacle[key] = value.clone();
        }
        let text = json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"grid": {"x": [0, 0.5, 1, 1.5, 2], "y": [0, 0.5, 1], "top": [[0, 1], [1, 1], [2, 0.64]]}, "refine": 1},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
            "contacts": [{"boundary": "top", "obstacle": obstacle, "indentation": indentation, "normal": normal}],
        });
        solve(&problem(&text.to_string())).summary.normal_force
    };
    let fall = f64::atan2(-0.36, 1.0);
    let parts = [
        ([0.0, 1.0], 0.0, 1.0, json!({"to": 1})),
        ([1.0, 1.0], fall, 0.36f64.hypot(1.0), json!({"from": 1})),
    ];
    for ([x, y], angle, length, end) in parts {
        let flat = force(json!({"kind": "flat"}), end.clone(), 0.05, "body");
        if angle == 0.0 {
            crate::support::close(flat, 68.51903584687838, 1e-9);
        }
        for distance in [0.2, 0.0, -0.05] {
            let (s, c) = angle.sin_cos();
            let at = |along: f64| [x + along * c - distance * s, y + along * s + distance * c];
            let line = json!({"kind": "line", "point": at(0.3), "angle": angle.to_degrees()});
            let longer = json!({"kind": "polyline", "points": [at(-1.0), at(3.0)]});
            let smooth = json!({"kind": "polyline", "points": [at(3.0), at(0.4), at(-1.0)], "interpolation": "cubic"});
            let as_long = json!({"kind": "polyline", "points": [at(0.0), at(length)]});
            let ended = [line, longer, smooth].map(|obstacle| (obstacle, end.clone()));
            for (obstacle, end) in ended.into_iter().chain([(as_long, json!({}))]) {
                for normal in ["body", "obstacle"] {
                    let own = force(obstacle.clone(), end.clone(), distance + 0.05, normal);
                    crate::support::close(own, flat, 1e-9);
                }
            }
        }
    }
}

/// The indentation that a warning names is the obstacle's own, not its part along a turned normal.
#[test]
fn the_indentation_that_engages_a_sloping_obstacle_is_measured_along_its_push() {
    let solution = |indentation: f64| {
        let text = json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"grid": {"x": [0, 1, 1.5, 2], "y": [0, 1]}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
            "contacts": [{"boundary": "top", "normal": "obstacle", "indentation": indentation,
                "obstacle": {"kind": "tilted", "slope": -1, "center": 3, "to": 2}}],
        });
        solve(&problem(&text.to_string()))
    };
    let open = solution(0.72);
    let message = &open
        .summary
        .warnings
        .iter()
        .find(|w| w.code == WarningCode::NoContact)
        .unwrap()
        .message;
    assert!(
        message.contains("contact if the indentation is above 1.000000e0"),
        "{message}"
    );
    assert_eq!(solution(0.99).summary.normal_force, 0.0);
    assert!(solution(1.01).summary.normal_force > 0.0);
}

/// Tresca's bound acts on the whole boundary; where the body does not touch, a warning reports it.
#[test]
fn a_given_bound_beyond_the_contact_is_warned_of() {
    let bound = |bound: Value| {
        let solution = cylinder("body", json!({"elastic_slip": 1e-4, "bound": bound}));
        let mut codes = solution.summary.warnings.into_iter().map(|w| w.code);
        codes.any(|code| code == WarningCode::BoundBeyondContact)
    };
    assert!(bound(json!(5)));
    assert!(!bound(json!({"s": [0, 0.5], "bound": [5, 5]})));
}
