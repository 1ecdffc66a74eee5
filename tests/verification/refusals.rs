//! What `Model::new` refuses of materials, groups, supports, loads and obstacles, each with its pointer.

use serde_json::{Value, json};

use crate::input::{pair, pairs, violations};
use crate::support::{problem, solve};

/// Two by two elements on a clamped base, with one field (by its JSON Pointer) replaced.
fn with(changes: &[(&str, Value)]) -> solver::problem::Problem {
    problem(&text(changes))
}

fn text(changes: &[(&str, Value)]) -> String {
    let mut value = json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grid": {"x": [0, 1, 2], "y": [0, 1, 2]}, "groups": {}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
        "loads": [], "contacts": [],
    });
    for (pointer, new) in changes {
        *value.pointer_mut(pointer).unwrap() = new.clone();
    }
    value.to_string()
}

/// Asserts that exactly these violations (pointer, reason) come back, in any order: of its structure, or
/// where that is sound of what it means.
#[track_caller]
fn refused(changes: &[(&str, Value)], expected: &[(&str, &str)]) {
    let mut found = match files::parse(&text(changes)) {
        Ok(problem) => violations(&problem),
        Err(list) => pairs(list),
    };
    let mut expected: Vec<_> = expected.iter().map(|(p, r)| pair(p, r)).collect();
    found.sort();
    expected.sort();
    assert_eq!(found, expected);
}

fn steel(group: Option<&str>) -> Value {
    let mut material = json!({"youngs_modulus": 1000, "poissons_ratio": 0.3});
    if let Some(group) = group {
        material["group"] = json!(group);
    }
    material
}

#[test]
fn every_element_has_exactly_one_material() {
    let groups = json!({"left": {"x": [0, 1]}, "low": {"y": [0, 1]}, "right": {"x": [1, 2]}});
    let refused = |materials: Value, expected: &[(&str, &str)]| {
        refused(
            &[("/mesh/groups", groups.clone()), ("/materials", materials)],
            expected,
        );
    };
    let (left, low, right) = (Some("left"), Some("low"), Some("right"));
    refused(json!([]), &[("/materials", "too_few")]);
    refused(json!([steel(left)]), &[("/materials", "missing")]);
    refused(
        json!([steel(left), steel(low), steel(None)]),
        &[("/materials/1/group", "overlap")],
    );
    refused(
        json!([steel(left), steel(None), steel(None)]),
        &[("/materials/2/group", "wrong_count")],
    );
    refused(
        json!([steel(Some("lefft")), steel(None)]),
        &[("/materials/0/group", "unknown_group")],
    );
    let list = solver::check(
        &with(&[
            ("/mesh/groups", groups.clone()),
            ("/materials", json!([steel(Some("lefft")), steel(None)])),
        ]),
        None,
    )
    .unwrap_err();
    for name in ["left", "low", "right"] {
        assert!(list[0].expected.contains(name), "{}", list[0].expected);
    }
    for materials in [
        json!([steel(left), steel(right)]),
        json!([steel(left), steel(None)]),
    ] {
        let accepted = with(&[("/mesh/groups", groups.clone()), ("/materials", materials)]);
        assert!(solver::check(&accepted, None).is_ok());
    }
}

#[test]
fn a_material_has_one_complete_form() {
    let refused = |material: Value, expected: &[(&str, &str)]| {
        refused(&[("/materials/0", material)], expected);
    };
    refused(
        json!({}),
        &[
            ("/materials/0/youngs_modulus", "missing"),
            ("/materials/0/poissons_ratio", "missing"),
        ],
    );
    let wood = json!({"e1": 100, "e2": 10, "nu12": 0.3, "g12": 5});
    refused(
        json!({"orthotropic": wood, "youngs_modulus": 5}),
        &[("/materials/0/youngs_modulus", "not_used")],
    );
    refused(
        json!({"orthotropic": wood}),
        &[
            ("/materials/0/orthotropic/e3", "missing"),
            ("/materials/0/orthotropic/nu13", "missing"),
            ("/materials/0/orthotropic/nu23", "missing"),
        ],
    );
    let mut whole = wood.clone();
    (whole["e3"], whole["nu13"], whole["nu23"]) = (json!(8), json!(0.25), json!(0.4));
    (whole["g12"], whole["e2"]) = (json!(-5), json!(0));
    refused(
        json!({"orthotropic": whole}),
        &[
            ("/materials/0/orthotropic/e2", "out_of_range"),
            ("/materials/0/orthotropic/g12", "out_of_range"),
        ],
    );
    // a third direction that is not needed
    let sheet = json!({"kind": "plane_stress", "thickness": 1});
    let accepted = with(&[
        ("/analysis", sheet),
        ("/materials/0", json!({"orthotropic": wood})),
    ]);
    assert!(solver::check(&accepted, None).is_ok());
    // nu12² > e1/e2: some strain would cost no energy
    let mut unstable = whole;
    (unstable["g12"], unstable["e2"], unstable["nu12"]) = (json!(5), json!(10), json!(4));
    refused(
        json!({"orthotropic": unstable}),
        &[("/materials/0/orthotropic", "out_of_range")],
    );
}

#[test]
fn groups_have_a_unique_name_and_an_element() {
    refused(
        &[("/mesh/groups", json!({"thin": {"x": [0.2, 0.8]}}))],
        &[("/mesh/groups/thin", "empty_group")],
    );
    let inline = json!({
        "nodes": [[0,0],[1,0],[1,1],[0,1],[0.5,0],[1,0.5],[0.5,1],[0,0.5]],
        "elements": [[0,1,2,3,4,5,6,7]], "boundaries": {"bottom": [[0,1,4]]}, "groups": {"all": [0]},
    });
    refused(
        &[("/mesh", json!({"inline": inline, "groups": {"all": {}}}))],
        &[("/mesh/groups/all", "name_taken")],
    );
    let mut stray = inline;
    stray["groups"]["all"] = json!([0, 1]);
    let found = violations(&with(&[("/mesh", json!({"inline": stray}))]));
    assert!(
        found[0].0.starts_with("/mesh/inline/groups/all"),
        "{found:?}"
    );
}

/// A range holds an element if all of its nodes lie there, whatever their number, and wherever the origin is.
#[test]
fn a_group_by_ranges_holds_triangles() {
    let square = json!({
        "nodes": [[2,5],[3,5],[3,6],[2,6],[2.5,5],[3,5.5],[2.5,6],[2,5.5],[2.5,5.5]],
        "elements": [[0,1,2,4,5,8], [0,2,3,8,6,7]],
        "boundaries": {"left": [[3,0,7]], "right": [[1,2,5]]},
    });
    let stiff = json!([{"youngs_modulus": 3000, "poissons_ratio": 0, "group": "stiff"}]);
    let supports =
        json!([{"boundary": "left", "ux": 0, "uy": 0}, {"boundary": "right", "ux": 0.01, "uy": 0}]);
    let fields = solve(&with(&[
        (
            "/mesh",
            json!({"inline": square, "groups": {"stiff": {"x": [2, 3], "y": [4, 7]}}}),
        ),
        ("/materials", stiff),
        ("/supports", supports),
    ]))
    .fields;
    assert!(
        fields
            .gauss
            .stress_xx
            .iter()
            .all(|s| (s - 30.0).abs() < 1e-10)
    );
}

/// Refinement gives every group the children of its elements: a stiff half stays that half.
#[test]
fn refinement_keeps_groups() {
    let bar = |mesh: Value, refine: u32| {
        let mut mesh = mesh;
        mesh["refine"] = json!(refine);
        // stretched side by side: the stress follows the material
        let fields = solve(&with(&[
            ("/mesh", mesh),
            (
                "/materials",
                json!([
                    {"youngs_modulus": 1000, "poissons_ratio": 0},
                    {"youngs_modulus": 3000, "poissons_ratio": 0, "group": "stiff"}
                ]),
            ),
            (
                "/supports",
                json!([{"boundary": "left", "ux": 0, "uy": 0}, {"boundary": "right", "ux": 0.02, "uy": 0}]),
            ),
        ]))
        .fields;
        let count = fields.elements.len();
        let stiff = (0..count).filter(|e| {
            let points = 9 * e..9 * e + 9;
            let stress = &fields.gauss.stress_xx[points.clone()];
            let upper = fields.gauss.y[9 * e] > 1.0;
            assert!(
                stress
                    .iter()
                    .all(|s| (s - if upper { 30.0 } else { 10.0 }).abs() < 1e-10)
            );
            upper
        });
        (stiff.count(), count)
    };
    let ranges =
        json!({"grid": {"x": [0, 1, 2], "y": [0, 1, 2]}, "groups": {"stiff": {"y": [1, 2]}}});
    let lattice = crate::support::Lattice::new(2, 2, |i, j| [0.5 * i as f64, 0.5 * j as f64]);
    let inline = json!({"inline": {
        "nodes": lattice.nodes, "elements": lattice.elements, "groups": {"stiff": [2, 3]},
        "boundaries": {"left": lattice.edges(2, |k| (0, k)), "right": lattice.edges(2, |k| (4, 4 - k))},
    }});
    for refine in 0..3 {
        let count = 4 << (2 * refine);
        assert_eq!(bar(ranges.clone(), refine), (count / 2, count));
        assert_eq!(bar(inline.clone(), refine), (count / 2, count));
    }
}

#[test]
fn only_3_or_2_gauss_points_are_offered() {
    let mut p = with(&[]);
    for order in [0, 1, 4] {
        p.quadrature = order;
        assert_eq!(violations(&p), [pair("/quadrature", "out_of_range")]);
    }
    p.quadrature = 2;
    assert!(solver::check(&p, None).is_ok());
}

#[test]
fn supports_name_one_pair_of_directions_and_no_corner() {
    let refused = |support: Value, expected: &[(&str, &str)]| {
        let base = json!({"boundary": "bottom", "ux": 0, "uy": 0});
        refused(&[("/supports", json!([base, support]))], expected);
    };
    refused(json!({"boundary": "top"}), &[("/supports/1", "too_few")]);
    refused(
        json!({"boundary": "top", "ux": 0, "un": 0}),
        &[("/supports/1", "wrong_count")],
    );
    // the side shares its lower node with the base
    refused(
        json!({"boundary": "left", "un": 0.1}),
        &[("/supports/1/un", "conflict")],
    );
    let corner = json!({"inline": {
        "nodes": [[0,0],[1,0],[1,1],[0,1],[0.5,0],[1,0.5],[0.5,1],[0,0.5]], "elements": [[0,1,2,3,4,5,6,7]],
        "boundaries": {"bottom": [[1,0,4]], "round": [[3,2,6], [2,1,5]]},
    }});
    let supports = json!([
        {"boundary": "bottom", "ux": 0, "uy": 0}, {"boundary": "round", "un": 0}
    ]);
    let found = violations(&with(&[("/mesh", corner), ("/supports", supports)]));
    assert!(
        found.contains(&pair("/supports/1/boundary", "turns_corner")),
        "{found:?}"
    );
}

#[test]
fn a_load_has_one_form_and_its_own_place() {
    let refused = |load: Value, expected: &[(&str, &str)]| {
        refused(&[("/loads", json!([load]))], expected);
    };
    let one = [("/loads/0", "wrong_count")];
    refused(json!({"boundary": "top"}), &one);
    refused(
        json!({"boundary": "top", "pressure": 1, "traction": [0, 1]}),
        &one,
    );
    refused(
        json!({"boundary": "top", "pressure": 1, "tangential": 1}),
        &one,
    );
    refused(
        json!({"boundary": "top", "body_force": [0, 1]}),
        &[("/loads/0/boundary", "not_used")],
    );
    refused(json!({"normal": 1}), &[("/loads/0/boundary", "missing")]);
    refused(
        json!({"boundary": "roof", "nodal": [[0, 1]]}),
        &[("/loads/0/boundary", "unknown_boundary")],
    );
    refused(
        json!({"boundary": "top", "nodal": [[0, 1], [0, 1]]}),
        &[("/loads/0/nodal", "wrong_length")],
    );
}

#[test]
fn every_obstacle_has_its_numbers_checked() {
    let refused = |obstacle: Value, expected: &[(&str, &str)]| {
        let contact = json!({"boundary": "top", "obstacle": obstacle});
        let expected: Vec<_> = expected
            .iter()
            .map(|(field, reason)| (format!("/contacts/0/obstacle/{field}"), *reason))
            .collect();
        let expected: Vec<_> = expected.iter().map(|(p, r)| (&p[..], *r)).collect();
        refused(&[("/contacts", json!([contact]))], &expected);
    };
    let range = "out_of_range";
    for kind in ["circle", "parabola"] {
        refused(json!({"kind": kind, "radius": 0}), &[("radius", range)]);
    }
    refused(
        json!({"kind": "rounded_flat", "radius": -1, "half_width": -1}),
        &[("radius", range), ("half_width", range)],
    );
    for kind in ["wedge", "cone"] {
        for angle in [0, 90, -10] {
            refused(json!({"kind": kind, "angle": angle}), &[("angle", range)]);
        }
    }
    refused(
        json!({"kind": "power", "coefficient": 0, "exponent": 0.5}),
        &[("coefficient", range), ("exponent", range)],
    );
    refused(
        json!({"kind": "table", "x": [0, 2, 2], "gap": [0, 1]}),
        &[("x/2", "not_increasing"), ("gap", "wrong_length")],
    );
    refused(
        json!({"kind": "table", "x": [0], "gap": [0]}),
        &[("x", "too_few")],
    );
    let table = |count: usize| {
        let x: Vec<usize> = (0..count).collect();
        json!({"kind": "table", "x": x, "gap": vec![0; count], "interpolation": "cubic"})
    };
    let smoothed = |mut table: Value, deviation: f64| {
        table["smoothing"] = json!({"standard_deviation": deviation});
        table
    };
    let deviation = "smoothing/standard_deviation";
    refused(smoothed(table(3), 1.0), &[("x", "too_few")]);
    refused(smoothed(table(4), 0.0), &[(deviation, range)]);
    refused(smoothed(table(4), -1e-3), &[(deviation, range)]);
    refused(table(100_001), &[("x", "too_many")]);
    let mut linear = smoothed(table(4), 1.0);
    linear["interpolation"] = json!("linear");
    refused(linear.clone(), &[("interpolation", "not_used")]);
    linear.as_object_mut().unwrap().remove("interpolation");
    refused(linear, &[("interpolation", "not_used")]);
    // all at once
    refused(
        json!({"kind": "table", "x": [1, 0], "gap": [0], "smoothing": {"standard_deviation": 0}}),
        &[
            ("x/1", "not_increasing"),
            ("gap", "wrong_length"),
            (deviation, range),
            ("interpolation", "not_used"),
            ("x", "too_few"),
        ],
    );
    refused(
        json!({"kind": "table", "x": [0, 1], "gap": [0, 1], "interpolation": "quadratic"}),
        &[("interpolation", "unknown_alternative")],
    );
    refused(
        smoothed(table(4), 1.0)
            .as_object()
            .map(|table| {
                let mut table = table.clone();
                table["smoothing"] = json!({});
                json!(table)
            })
            .unwrap(),
        &[(deviation, "missing")],
    );
    refused(
        json!({"kind": "polyline", "points": [[0, 3], [1, 3]], "smoothing": {"standard_deviation": 1}}),
        &[("smoothing", "unknown_name")],
    );
    // differences that overflow
    let huge = |interpolation: &str| json!({"kind": "table", "x": [0, 1, 2, 3], "gap": [1e308, -1e308, 1e308, -1e308], "interpolation": interpolation});
    for interpolation in ["linear", "cubic"] {
        let contact = json!({"boundary": "top", "obstacle": huge(interpolation)});
        self::refused(
            &[("/contacts", json!([contact]))],
            &[("/contacts/0/obstacle", "not_finite")],
        );
    }
    let many: Vec<[usize; 2]> = (0..10_001).map(|i| [i, 3]).collect();
    refused(
        json!({"kind": "polyline", "points": many}),
        &[("points", "too_many")],
    );
    refused(
        json!({"kind": "polyline", "points": [[0, 3]]}),
        &[("points", "too_few")],
    );
    refused(
        json!({"kind": "polyline", "points": [[0, 3], [1, 3], [1, 3]]}),
        &[("points/2", "repeated_point")],
    );
    refused(
        json!({"kind": "flat", "from": 1, "to": 1}),
        &[("to", range)],
    );
}

#[test]
fn a_contact_without_an_obstacle_needs_a_bound_and_a_bonded_one_no_friction() {
    let refused = |changes: Value, expected: &[(&str, &str)]| {
        let mut contact = json!({"boundary": "top", "obstacle": {"kind": "flat"}});
        for (name, value) in changes.as_object().unwrap() {
            contact[name] = value.clone();
        }
        refused(&[("/contacts", json!([contact]))], expected);
    };
    let coulomb = json!({"coefficient": 0.3, "nonlocal_radius": 0.1, "elastic_slip": 1e-4});
    let missing = [("/contacts/0/friction/bound", "missing")];
    refused(json!({"condition": "none"}), &missing);
    refused(json!({"condition": "none", "friction": coulomb}), &missing);
    refused(
        json!({"condition": "bonded", "friction": coulomb}),
        &[("/contacts/0/friction", "not_used")],
    );
}

/// A support that leaves the body outside the obstacle at the end of one step and not of another.
#[test]
fn a_supported_contact_node_stays_outside_the_obstacle_at_every_step() {
    let contact = json!([{"boundary": "top", "obstacle": {"kind": "flat"}, "indentation": 0.1}]);
    let held = |u_y: f64, steps: Value| {
        let mut p = with(&[
            ("/contacts", contact.clone()),
            (
                "/supports",
                json!([{"boundary": "bottom", "ux": 0, "uy": 0}, {"boundary": "top", "uy": u_y}]),
            ),
        ]);
        p.steps = serde_json::from_value(steps).unwrap();
        p
    };
    let impossible = [pair("/contacts/0/indentation", "impossible")];
    assert!(solver::check(&held(-0.15, json!([])), None).is_ok());
    assert_eq!(violations(&held(-0.05, json!([]))), impossible);
    let half = json!({"indentation": 0.5});
    assert!(solver::check(&held(-0.15, json!([half, {}])), None).is_ok());
    let more = json!({"indentation": 2});
    assert_eq!(
        violations(&held(-0.15, json!([half, more, {}]))),
        impossible
    );
    let lifted = json!({"supports": 0.5});
    assert_eq!(violations(&held(-0.15, json!([{}, lifted]))), impossible);
}

#[test]
fn adaptive_refinement_needs_a_tolerance_and_a_contact() {
    let contacts = json!([{"boundary": "top", "obstacle": {"kind": "flat"}}]);
    let grid = json!({"x": [0, 1, 2], "y": [0, 1, 2]});
    for tolerance in [0.0, 1.0, -0.1, 1e-4] {
        let mesh = json!({"grid": grid, "refine": {"tolerance": tolerance}});
        refused(
            &[("/mesh", mesh), ("/contacts", contacts.clone())],
            &[("/mesh/refine/tolerance", "out_of_range")],
        );
    }
    let mesh = json!({"grid": grid, "refine": {"tolerance": 0.01}});
    refused(&[("/mesh", mesh.clone())], &[("/mesh/refine", "not_used")]);
    let accepted = with(&[("/mesh", mesh), ("/contacts", contacts.clone())]);
    assert!(solver::check(&accepted, None).is_ok());
    let inline = json!({
        "nodes": [[0,0],[1,0],[1,1],[0,1],[0.5,0],[1,0.5],[0.5,1],[0,0.5]], "elements": [[0,1,2,3,4,5,6,7]],
        "boundaries": {"bottom": [[1,0,4]], "top": [[3,2,6]]},
    });
    // on any mesh
    let mesh = json!({"inline": inline, "refine": {"tolerance": 0.01}});
    let accepted = with(&[("/mesh", mesh), ("/contacts", contacts)]);
    assert!(solver::check(&accepted, None).is_ok());
}

#[test]
fn the_thesis_supports_no_triangles_and_no_element_has_seven_nodes() {
    let mesh = json!({"inline": {"nodes": [[0,0],[1,0],[0,1],[0.5,0],[0.5,0.5],[0,0.5]], "elements": [[0,1,2,3,4,5]],
        "boundaries": {"bottom": [[1,0,3]], "left": [[0,2,5]]}}});
    let contacts = json!([{"boundary": "left", "obstacle": {"kind": "flat"}}]);
    let with_triangle = [("/mesh", mesh.clone()), ("/contacts", contacts)];
    assert!(solver::check(&with(&with_triangle), None).is_ok());
    let mut thesis = with(&with_triangle);
    thesis.solver.algorithm = solver::problem::Algorithm::Thesis;
    assert_eq!(violations(&thesis), [pair("/solver/algorithm", "not_used")]);
    let text = serde_json::to_string(&with(&with_triangle)).unwrap();
    let violations = files::parse(&text.replace("[0,1,2,3,4,5]", "[0,1,2,3,4,5,5]")).unwrap_err();
    assert_eq!(violations[0].pointer, "/mesh/inline/elements/0");
    assert!(
        violations[0].got.contains("7 item") && violations[0].expected.contains("6 or 8"),
        "{}",
        violations[0]
    );
}

#[test]
fn a_problem_that_exceeds_all_memory_is_refused() {
    let contacts = json!([{"boundary": "top", "obstacle": {"kind": "flat"}}]);
    let lines: Vec<u32> = (0..=1500).collect();
    let mesh = json!({"grid": {"x": lines, "y": lines}, "refine": {"tolerance": 0.01}});
    refused(
        &[("/mesh", mesh.clone()), ("/contacts", contacts)],
        &[("/mesh/refine", "too_large")],
    );
    let mut adaptive = with(&[]);
    adaptive.mesh = serde_json::from_value(mesh).unwrap();
    let told = solver::estimate(&adaptive, None).unwrap();
    assert!(told.memory_bytes > 10 << 30);
    let steps = vec![json!({"increments": 10_000}); 3];
    let mut p = with(&[]);
    p.steps = serde_json::from_value(json!(steps)).unwrap();
    assert_eq!(violations(&p), [pair("/steps", "too_many")]);
}

#[test]
fn a_bonded_obstacle_and_a_support_must_agree() {
    let bonded = |indentation: f64| json!([{"boundary": "top", "obstacle": {"kind": "flat"}, "indentation": indentation, "condition": "bonded"}]);
    let held = json!([{"boundary": "bottom", "ux": 0, "uy": 0}, {"boundary": "right", "uy": 0}]);
    refused(
        &[("/contacts", bonded(-0.2)), ("/supports", held.clone())],
        &[("/contacts/0/condition", "conflict")],
    );
    let agreed = with(&[("/contacts", bonded(0.0)), ("/supports", held)]);
    assert!(solver::check(&agreed, None).is_ok());
}
