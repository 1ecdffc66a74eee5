//! Changes of temperature. Sources: Timoshenko and Goodier, Theory of Elasticity, chapter 13 (thermal stress); Timoshenko,
//! Analysis of bi-metal thermostats, J. Opt. Soc. Am. 11 (1925).

use serde_json::{Value, json};
use solver::problem::Problem;
use solver::solution::{Solution, Verdict};

use crate::record::held;
use crate::support::{Lattice, close, node, problem, solve};

const E: f64 = 1000.0;
const EXPANSION: f64 = 2e-4;
const WARMER: f64 = 30.0;

fn theories() -> [Value; 3] {
    [
        json!({"kind": "plane_stress", "thickness": 0.7}),
        json!({"kind": "plane_strain"}),
        json!({"kind": "axisymmetric"}),
    ]
}

fn material(nu: f64) -> Value {
    json!({"youngs_modulus": E, "poissons_ratio": nu, "expansion": EXPANSION})
}

/// The largest stress in size: xx, yy, xy of all nodes.
fn largest_in_plane(solution: &Solution) -> f64 {
    let fields = &solution.fields;
    let all = [&fields.stress_xx, &fields.stress_yy, &fields.stress_xy];
    let all = all.into_iter().flatten();
    all.fold(0.0f64, |most, stress| most.max(stress.abs()))
}

/// A quarter of a ring with curved sides, half of its quadrilaterals cut in two triangles: held by its lines of symmetry, or
/// as a body of revolution, about an axis at a distance, by its lower end.
fn curved(
    analysis: &Value,
    nu: f64,
    temperature: impl Fn([f64; 2]) -> f64,
    loads: Value,
) -> Problem {
    let revolved = analysis["kind"] == "axisymmetric";
    let (radial, round) = (3, 4);
    let lattice = Lattice::new(radial, round, |i, j| {
        let (sin, cos) = (std::f64::consts::FRAC_PI_2 * j as f64 / (2 * round) as f64).sin_cos();
        let r = 1.0 + i as f64 / (2 * radial) as f64;
        [r * cos + f64::from(u8::from(revolved)), r * sin]
    });
    let (nodes, elements) = lattice.cut(|e| e % 2 == 0);
    let temperatures: Vec<f64> = nodes.iter().map(|place| temperature(*place)).collect();
    let mut supports = vec![json!({"boundary": "below", "uy": 0})];
    if !revolved {
        supports.push(json!({"boundary": "side", "ux": 0}));
    }
    problem(
        &json!({
            "analysis": analysis,
            "mesh": {"inline": {"nodes": nodes, "elements": elements, "temperatures": temperatures, "boundaries": {
                "below": lattice.edges(radial, |k| (k, 0)),
                "side": lattice.edges(radial, |k| (k, 2 * round)),
            }}},
            "materials": [material(nu)],
            "supports": supports,
            "loads": loads,
        })
        .to_string(),
    )
}

/// A body that may expand has no stress in its plane and grows in proportion, in elements of any shape and family.
#[test]
fn a_free_body_expands_without_stress() {
    for analysis in theories() {
        for nu in [0.3, 0.4999] {
            for loads in [
                json!([{"temperature": WARMER}]),
                json!([{"nodal_temperature": 0.5}]),
                json!([{"temperature": 20}, {"nodal_temperature": 0.25}, {"temperature": -5}]),
            ] {
                let warm = curved(&analysis, nu, |_| 2.0 * WARMER, loads);
                let solution = solve(&warm);
                let strain = EXPANSION * WARMER;
                // near ν = ½ the bulk modulus, 5,000 times the other, multiplies rounding
                let rounding = if nu == 0.3 { 1e-11 } else { 1e-8 };
                let plane_strain = analysis["kind"] == "plane_strain";
                let growth = if plane_strain {
                    (1.0 + nu) * strain
                } else {
                    strain
                };
                let fields = &solution.fields;
                for k in 0..fields.x.len() {
                    for (u, x) in [(fields.ux[k], fields.x[k]), (fields.uy[k], fields.y[k])] {
                        assert!(
                            (u - growth * x).abs() < rounding * strain,
                            "{analysis} {nu}: {u} at {x}"
                        );
                    }
                    if plane_strain {
                        close(fields.stress_zz[k], -E * strain, 1e3 * rounding);
                    }
                }
                let stress = largest_in_plane(&solution);
                assert!(
                    stress < 1e3 * rounding * E * strain,
                    "{analysis} {nu}: {stress}"
                );
            }
        }
    }
}

/// A body that cannot move at all: σ = −E α T/(1 − 2ν).
#[test]
fn a_body_that_is_held_everywhere_is_compressed() {
    for nu in [0.0, 0.3, 0.4999] {
        let text = json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"grid": {"x": [0, 0.6, 2], "y": [0, 1, 1.5]}},
            "materials": [material(nu)],
            "supports": (["left", "right", "top", "bottom"].map(|b| json!({"boundary": b, "ux": 0, "uy": 0}))),
            "loads": [{"temperature": WARMER}],
        });
        let fields = solve(&problem(&text.to_string())).fields;
        let pressed = -E * EXPANSION * WARMER / (1.0 - 2.0 * nu);
        for stress in [&fields.stress_xx, &fields.stress_yy, &fields.stress_zz] {
            stress.iter().for_each(|s| close(*s, pressed, 1e-10));
        }
    }
}

/// A held sheet of an orthotropic material: σ₁ = −E₁ (α₁ + ν₂₁ α₂) T/(1 − ν₁₂ ν₂₁), along its axes.
#[test]
fn an_orthotropic_material_expands_along_its_axes() {
    let (e1, e2, nu12) = (2000.0, 500.0, 0.2);
    let nu21 = nu12 * e2 / e1;
    let (a1, a2) = (1e-4, 3e-4);
    let along = -e1 * (a1 + nu21 * a2) * WARMER / (1.0 - nu12 * nu21);
    let across = -e2 * (a2 + nu12 * a1) * WARMER / (1.0 - nu12 * nu21);
    for angle in [0.0, 90.0, 30.0] {
        let text = json!({
            "analysis": {"kind": "plane_stress", "thickness": 2},
            "mesh": {"grid": {"x": [0, 1], "y": [0, 1]}},
            "materials": [{"orthotropic": {"e1": e1, "e2": e2, "nu12": nu12, "g12": 400, "angle": angle, "expansion": [a1, a2, 7]}}],
            "supports": (["left", "right", "top", "bottom"].map(|b| json!({"boundary": b, "ux": 0, "uy": 0}))),
            "loads": [{"temperature": WARMER}],
        });
        let fields = solve(&problem(&text.to_string())).fields;
        let (s, c) = f64::to_radians(angle).sin_cos();
        close(fields.stress_xx[0], c * c * along + s * s * across, 1e-10);
        close(fields.stress_yy[0], s * s * along + c * c * across, 1e-10);
        assert!((fields.stress_xy[0] - c * s * (along - across)).abs() < 1e-10 * across.abs());
    }
}

/// A sheet whose temperature is linear in x and y bends without stress: its displacements are quadratic.
#[test]
fn a_sheet_with_a_linear_temperature_bends_without_stress() {
    let lattice = Lattice::new(3, 2, |i, j| [i as f64 / 3.0, j as f64 / 4.0]);
    let [t0, tx, ty] = [10.0, 25.0, -40.0];
    let temperatures: Vec<f64> = lattice
        .nodes
        .iter()
        .map(|[x, y]| t0 + tx * x + ty * y)
        .collect();
    let text = json!({
        "analysis": {"kind": "plane_stress", "thickness": 1},
        "mesh": {"inline": {"nodes": lattice.nodes, "elements": lattice.elements, "temperatures": temperatures,
            "boundaries": {}, "node_sets": {"origin": [0], "beside": [lattice.edges(1, |k| (k, 0))[0][1]]}}, "refine": 1},
        "materials": [material(0.3)],
        "supports": [{"nodes": "origin", "ux": 0, "uy": 0}, {"nodes": "beside", "uy": 0}],
        "loads": [{"nodal_temperature": 1}],
    });
    let solution = solve(&problem(&text.to_string()));
    let stress = largest_in_plane(&solution);
    assert!(stress < 1e-8 * E * EXPANSION * 65.0, "{stress}");
    // u_y = α (T₀ y + T_x x y + T_y (y² − x²)/2), turned so that the second support rests
    let fields = &solution.fields;
    let turn = EXPANSION * ty * 0.5 * (2.0 / 3.0);
    for k in 0..fields.x.len() {
        let (x, y) = (fields.x[k], fields.y[k]);
        let up = EXPANSION * (t0 * y + tx * x * y + 0.5 * ty * (y * y - x * x)) + turn * x;
        assert!(
            (fields.uy[k] - up).abs() < 1e-12,
            "{} instead of {up} at {x}, {y}",
            fields.uy[k]
        );
    }
}

/// A ring that is cooled onto a rigid shaft is a ring with the interference by which it would have shrunk; Lamé's pressure
/// in plane stress.
#[test]
fn a_ring_shrinks_onto_its_shaft() {
    let x: Vec<f64> = (0..=16).map(|i| 1.0 + f64::from(i) / 16.0).collect();
    let ring = |loads: Value, interference: f64| {
        let text = json!({
            "analysis": {"kind": "axisymmetric"},
            "mesh": {"grid": {"x": x, "y": [0, 0.25]}},
            "materials": [material(0.3)],
            "supports": [{"boundary": "bottom", "uy": 0}],
            "loads": loads,
            "contacts": [{"boundary": "left", "obstacle": {"kind": "flat", "along": "arc_length"}, "indentation": interference,
                "friction": {"coefficient": 0.2, "nonlocal_radius": 0.02, "elastic_slip": 1e-5}}],
        });
        solve(&problem(&text.to_string())).summary
    };
    let shrinks = EXPANSION * WARMER;
    let cooled = ring(json!([{"temperature": -WARMER}]), 0.0);
    // free along the axis: without friction the closed form holds; friction restrains the shrinking of the cooled one
    let lame = E * shrinks / ((4.0 + 1.0) / (4.0 - 1.0) + 0.3) * 2.0 * std::f64::consts::PI * 0.25;
    close(cooled.normal_force, lame, 5e-3);
    assert!(cooled.friction_force != 0.0);
    let still = ring(
        json!([{"temperature": -WARMER}, {"temperature": WARMER}]),
        shrinks,
    );
    let plain = ring(json!([]), shrinks);
    close(still.normal_force, plain.normal_force, 1e-12);
    close(plain.normal_force, lame, 5e-3);
    held(
        0,
        "ring shrunk onto a shaft: force",
        "16 elements across, μ = 0.2",
        cooled.normal_force,
        lame,
        5e-3,
    );
}

/// Layers of one modulus of which one expands: the strip of total height h has the curvature 3 α T/(2 h). By groups of one
/// material, or by materials.
#[test]
fn a_strip_of_two_layers_bends() {
    let (length, height) = (10.0, 0.5);
    let x: Vec<f64> = (0..=40).map(|i| length * f64::from(i) / 40.0).collect();
    let strip = |materials: Value, loads: Value| {
        let text = json!({
            "analysis": {"kind": "plane_stress", "thickness": 1},
            "mesh": {"grid": {"x": x, "y": [0, 0.125, 0.25, 0.375, height]}, "groups": {"upper": {"y": [0.25, height]}}},
            "materials": materials,
            "supports": [{"boundary": "left", "ux": 0, "uy": 0}],
            "loads": loads,
        });
        solve(&problem(&text.to_string()))
    };
    let group = strip(
        json!([material(0.3)]),
        json!([{"temperature": WARMER, "group": "upper"}]),
    );
    let cold = json!({"youngs_modulus": E, "poissons_ratio": 0.3, "expansion": 0});
    let mut warm = material(0.3);
    warm["group"] = "upper".into();
    let materials = strip(json!([cold, warm]), json!([{"temperature": WARMER}]));
    let slope = |solution: &Solution, x: f64| {
        let at = |y: f64| solution.fields.ux[node(&solution.fields, x, y)];
        (at(0.0) - at(height)) / height
    };
    for solution in [&group, &materials] {
        let curvature = (slope(solution, 7.5) - slope(solution, 2.5)) / 5.0;
        close(curvature, -1.5 * EXPANSION * WARMER / height, 1e-6);
    }
    for (a, b) in group.fields.uy.iter().zip(&materials.fields.uy) {
        assert!((a - b).abs() < 1e-12, "{a}, not {b}");
    }
    let found = (slope(&group, 7.5) - slope(&group, 2.5)) / 5.0;
    held(
        0,
        "strip of two layers, one heated: curvature",
        "4 elements high",
        found,
        -1.5 * EXPANSION * WARMER / height,
        1e-6,
    );
}

/// A column between a base and a rigid plate at a distance: σ = −E (α T/2 − g/L) if one half of it is heated. Stresses jump
/// between the halves, across the column: nothing is averaged there, so that no error is seen.
#[test]
fn half_of_a_column_is_heated_and_meets_a_plate() {
    let (length, gap) = (2.0, 1e-3);
    for analysis in theories() {
        let text = json!({
            "analysis": analysis,
            "mesh": {"grid": {"x": [1, 1.5, 2], "y": [0, 0.5, 1, 1.5, length]}, "groups": {"lower": {"y": [0, 1]}}},
            "materials": [material(0.0)],
            "supports": [{"boundary": "bottom", "uy": 0}, {"boundary": "left", "ux": 0}, {"boundary": "right", "ux": 0}],
            "loads": [{"temperature": WARMER, "group": "lower"}],
            "contacts": [{"boundary": "top", "obstacle": {"kind": "flat"}, "indentation": -gap}],
        });
        let area = match analysis["kind"].as_str().unwrap() {
            "axisymmetric" => std::f64::consts::PI * (4.0 - 1.0),
            _ => analysis["thickness"].as_f64().unwrap_or(1.0),
        };
        let solution = solve(&problem(&text.to_string()));
        let pressure = E * (0.5 * EXPANSION * WARMER - gap / length);
        // inside a body of revolution whose radii rest, the hoop stress changes nothing: ν = 0
        close(solution.summary.normal_force, area * pressure, 1e-10);
        let errors = solution.fields.element_error.iter();
        let most = errors.fold(0.0f64, |most, e| most.max(e.abs()));
        assert!(most < 1e-9, "{analysis}: {most}");
        let accuracy = solution.summary.accuracy.unwrap();
        assert_eq!(accuracy.verdict, Verdict::Good, "{analysis}");
    }
}

/// The factor of `loads` in load steps multiplies temperatures.
#[test]
fn a_factor_of_loads_multiplies_temperatures() {
    for nu in [0.3, 0.4999] {
        let ends = |steps: Value, loads: Value| {
            let text = json!({
                "analysis": {"kind": "plane_strain"},
                "mesh": {"grid": {"x": [0, 1, 2], "y": [0, 0.5, 1]}},
                "materials": [material(nu)],
                "supports": [{"boundary": "left", "ux": 0, "uy": 0}],
                "loads": loads,
                "steps": steps,
            });
            solve(&problem(&text.to_string())).fields
        };
        let stepped = ends(
            json!([{"loads": 0.5, "increments": 2}, {"loads": 0.25}]),
            json!([{"temperature": 4.0 * WARMER}]),
        );
        let whole = ends(json!([]), json!([{"temperature": WARMER}]));
        for (a, b) in [
            (&stepped.ux, &whole.ux),
            (&stepped.stress_yy, &whole.stress_yy),
            (&stepped.stress_zz, &whole.stress_zz),
        ] {
            let size = b.iter().fold(0.0f64, |most, b| most.max(b.abs()));
            let same = a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-10 * size);
            assert!(same, "{nu}");
        }
    }
}

/// Temperatures at the nodes of the first mesh are the same field on finer meshes, also graded ones, and where a side is
/// divided at the end of an obstacle.
#[test]
fn refinement_keeps_the_temperatures_at_nodes() {
    let block = |refine: Value| {
        let lattice = Lattice::new(4, 2, |i, j| [i as f64 / 4.0, j as f64 / 4.0 - 1.0]);
        let temperature = |[x, y]: [f64; 2]| 40.0 + 30.0 * x * x + 20.0 * y;
        let temperatures: Vec<f64> = lattice
            .nodes
            .iter()
            .map(|place| temperature(*place))
            .collect();
        let text = json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"inline": {"nodes": lattice.nodes, "elements": lattice.elements, "temperatures": temperatures,
                "boundaries": {"below": lattice.edges(4, |k| (k, 0)), "top": lattice.edges(4, |k| (k, 4))}}, "refine": refine},
            "materials": [material(0.3)],
            "supports": [{"boundary": "below", "ux": 0, "uy": 0}],
            "loads": [{"nodal_temperature": 1}],
            "contacts": [{"boundary": "top", "obstacle": {"kind": "parabola", "radius": 10, "center": 0.83},
                "indentation": 0.01}, ],
        });
        solve(&problem(&text.to_string())).summary
    };
    let fine = block(json!(4)).normal_force;
    let graded = block(json!({"tolerance": 0.002}));
    close(graded.normal_force, fine, 4e-3);
    assert!(graded.refinements.len() > 1);
}

#[test]
fn temperatures_need_expansions_and_what_they_name() {
    let base = json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grid": {"x": [1, 2], "y": [0, 1, 2]}, "groups": {"upper": {"y": [1, 2]}}},
        "materials": [
            {"youngs_modulus": E, "poissons_ratio": 0.3},
            {"orthotropic": {"e1": 1, "e2": 1, "e3": 1, "nu12": 0, "nu13": 0, "nu23": 0, "g12": 1, "expansion": [1, 1, 1]},
                "expansion": 1, "group": "upper"},
        ],
        "supports": [{"boundary": "bottom", "uy": 0, "ux": 0}],
        "loads": [{"temperature": 5, "group": "lower"}, {"nodal_temperature": 1}],
    });
    let violations = solver::check(&problem(&base.to_string()), None).unwrap_err();
    let mut found: Vec<_> = violations
        .iter()
        .map(|v| (&v.pointer[..], v.reason.as_str()))
        .collect();
    found.sort_unstable();
    assert_eq!(
        found,
        [
            ("/loads/0/group", "unknown_group"),
            ("/loads/1/nodal_temperature", "not_used"),
            ("/materials/0/expansion", "missing"),
            ("/materials/1/expansion", "not_used"),
        ]
    );
    for (change, pointer) in [
        (r#"{"boundary":"top","temperature""#, "/loads/0/boundary"),
        (r#"{"nodes":"top","temperature""#, "/loads/0"),
    ] {
        let text = json!({"temperature": 5}).to_string();
        let placed = base
            .to_string()
            .replace(r#"{"group":"lower","temperature":5}"#, &text);
        let violations = files::parse(&placed.replace(r#"{"temperature""#, change)).unwrap_err();
        assert_eq!(violations[0].pointer, pointer, "{violations:?}");
    }
    let few = json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"inline": {"nodes": [[0, 0], [1, 0], [0, 1], [0.5, 0], [0.5, 0.5], [0, 0.5]], "elements": [[0, 1, 2, 3, 4, 5]],
            "boundaries": {"side": [[2, 0, 5]]}, "temperatures": [1, 2]}},
        "materials": [material(0.3)],
        "supports": [{"boundary": "side", "uy": 0, "ux": 0}],
    });
    let violations = solver::check(&problem(&few.to_string()), None).unwrap_err();
    assert_eq!(
        violations[0].pointer, "/mesh/inline/temperatures",
        "{violations:?}"
    );
}
