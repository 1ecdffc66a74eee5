//! docs/verification.md, rows 26 and 27. Two elastic bodies and obstacles under loads against references: uniform stresses on any
//! meshes, one body in place of two bonded ones, a rigid obstacle in place of a stiff body, half-spaces of Hertz and of Cattaneo
//! and Mindlin, the orders of convergence, and the duality of loads and displacements on examples of the thesis.

use serde_json::{Value, json};
use solver::solution::{Solution, WarningCode};

use crate::record::{Line, held};
use crate::support::{Lattice, close, example, problem, solve};

/// Rows of the table: obstacles under loads, and two bodies.
const LOADS: u32 = 26;
const BODIES: u32 = 27;

fn solved(text: &Value) -> Solution {
    solve(&problem(&text.to_string()))
}

fn even(from: f64, to: f64, count: u32) -> Vec<f64> {
    (0..=count)
        .map(|k| from + (to - from) * f64::from(k) / f64::from(count))
        .collect()
}

/// Two blocks of distorted elements on one another, as wide as 1.
struct Blocks {
    kind: Value,
    /// The number of elements along the interface, of the lower block, which carries the law, and of the upper one.
    along: [usize; 2],
    /// Whether the elements of each are triangles.
    triangles: [bool; 2],
    /// The height of the interface at x.
    interface: fn(f64) -> f64,
    /// How far nodes are moved, in sides of elements.
    distorted: f64,
}

impl Blocks {
    fn mesh(&self) -> Value {
        let mut nodes: Vec<[f64; 2]> = Vec::new();
        let mut elements: Vec<Vec<usize>> = Vec::new();
        let (mut boundaries, mut groups, mut sets) = (json!({}), json!({}), json!({}));
        for (body, name) in ["lower", "upper"].into_iter().enumerate() {
            let n = self.along[body];
            let corner = |i: usize, j: usize| {
                let (u, v) = (i as f64 / n as f64, j as f64 / 2.0);
                let wave = |k: f64| self.distorted * (5.0 * u + k * v + 2.0 * body as f64).sin();
                let inside = |k: usize, most: usize| f64::from(u8::from(k > 0 && k < most));
                let x = u + inside(i, n) * wave(3.0) / n as f64;
                let v = v + inside(j, 2) * wave(7.0) / 2.0;
                let middle = (self.interface)(x);
                let y = match body {
                    0 => v * middle,
                    _ => middle + v * (1.2 - middle),
                };
                [x, y]
            };
            let lattice = Lattice::new(n, 2, |i, j| {
                let (a, b) = (corner(i / 2, j / 2), corner(i.div_ceil(2), j.div_ceil(2)));
                let [x, y] = [0, 1].map(|k| 0.5 * (a[k] + b[k]));
                // on the interface midside nodes are on the curve, too
                match (body, j) {
                    (0, 4) | (1, 0) => [x, (self.interface)(x)],
                    _ => [x, y],
                }
            });
            let (own, cells) = match self.triangles[body] {
                true => lattice.cut(|_| true),
                false => {
                    let cells = lattice.elements.iter().map(|cell| cell.to_vec());
                    (lattice.nodes.clone(), cells.collect())
                }
            };
            let (first, start) = (nodes.len(), elements.len());
            let sides = [
                ("bottom", lattice.edges(n, |k| (2 * n - k, 0))),
                ("top", lattice.edges(n, |k| (k, 4))),
                ("left", lattice.edges(2, |k| (0, k))),
                ("right", lattice.edges(2, |k| (2 * n, 4 - k))),
            ];
            for (side, edges) in sides {
                let edges: Vec<_> = edges.iter().map(|e| e.map(|node| node + first)).collect();
                boundaries[format!("{name}.{side}")] = json!(edges);
            }
            let corner = lattice.edges(2, |k| (0, k))[0][0] + first;
            sets[format!("{name}.corner")] = json!([corner]);
            nodes.extend(own);
            let moved = |cell: Vec<usize>| cell.into_iter().map(|node| node + first).collect();
            elements.extend(cells.into_iter().map(moved));
            groups[name] = json!((start..elements.len()).collect::<Vec<_>>());
        }
        json!({"inline": {"nodes": nodes, "elements": elements, "boundaries": boundaries, "groups": groups, "node_sets": sets}})
    }

    fn problem(&self) -> Value {
        json!({
            "analysis": self.kind,
            "mesh": self.mesh(),
            "materials": [
                {"group": "lower", "youngs_modulus": 1, "poissons_ratio": 0.3},
                {"group": "upper", "youngs_modulus": 3, "poissons_ratio": 0.2},
            ],
            "supports": [
                {"boundary": "lower.bottom", "uy": 0},
                {"boundary": "lower.left", "ux": 0},
                {"boundary": "upper.left", "ux": 0},
            ],
            "loads": [{"boundary": "upper.top", "traction": [0, -2]}],
            "contacts": [{"boundary": "lower.top", "against": {"boundary": "upper.bottom"}}],
            "solver": {"tolerance": 1e-12},
        })
    }
}

/// The largest difference of a stress at all nodes from a value.
fn off(stress: &[f64], value: f64) -> f64 {
    stress.iter().map(|s| (s - value).abs()).fold(0.0, f64::max)
}

fn flat(_: f64) -> f64 {
    0.5
}

const RATIOS: [[usize; 2]; 7] = [[3, 2], [2, 3], [3, 5], [7, 2], [1, 4], [4, 1], [2, 2]];

/// Distorted elements, triangles against quadrilaterals, and 2 × 2 points: uniform pressure.
#[test]
fn a_distorted_patch_is_exact() {
    let kinds = [
        json!({"kind": "plane_strain"}),
        json!({"kind": "plane_stress", "thickness": 0.7}),
        json!({"kind": "axisymmetric"}),
    ];
    for kind in kinds {
        for quadrature in [2, 3] {
            let mut worst = 0.0f64;
            for along in RATIOS {
                for triangles in [[false; 2], [true, false], [false, true], [true; 2]] {
                    let blocks = Blocks {
                        kind: kind.clone(),
                        along,
                        triangles,
                        interface: flat,
                        distorted: 0.2,
                    };
                    let mut whole = blocks.problem();
                    whole["quadrature"] = json!(quadrature);
                    let solution = solved(&whole);
                    worst = worst.max(off(&solution.fields.stress_yy, -2.0));
                }
            }
            let what = format!(
                "flat patch of two bodies, {}: largest error of σ_yy = 2",
                kind["kind"].as_str().unwrap()
            );
            let mesh = format!(
                "distorted, T6 and Q8 on either side, {quadrature} × {quadrature} points, 3:2 to 1:4 edges"
            );
            held(BODIES, &what, &mesh, worst, 0.0, 2e-12);
        }
    }
}

/// A block that only friction holds on another, both under uniform pressure and shear.
#[test]
fn a_sheared_patch_that_friction_holds_is_exact() {
    let (p, q) = (2.0, 0.35);
    for (kind, analysis) in [
        ("plane strain", json!({"kind": "plane_strain"})),
        (
            "plane stress",
            json!({"kind": "plane_stress", "thickness": 0.7}),
        ),
    ] {
        for history in ["total", "incremental"] {
            let mut worst = 0.0f64;
            for along in RATIOS {
                let blocks = Blocks {
                    kind: analysis.clone(),
                    along,
                    triangles: [along[0] > 2, false],
                    interface: flat,
                    distorted: 0.2,
                };
                let mut whole = blocks.problem();
                // of one material: else the slip is not uniform
                whole["materials"] = json!([{"youngs_modulus": 1, "poissons_ratio": 0.3}]);
                whole["supports"] = json!([
                    {"boundary": "lower.bottom", "uy": 0},
                    {"nodes": "lower.corner", "ux": 0},
                ]);
                whole["loads"] = json!([
                    {"boundary": "lower.bottom", "traction": [-q, 0]},
                    {"boundary": "lower.left", "traction": [0, -q]},
                    {"boundary": "lower.right", "traction": [0, q]},
                    {"boundary": "upper.left", "traction": [0, -q]},
                    {"boundary": "upper.right", "traction": [0, q]},
                    {"boundary": "upper.top", "traction": [q, -p]},
                ]);
                whole["contacts"][0]["friction"] = json!({
                    "coefficient": 0.3, "nonlocal_radius": 0, "elastic_slip": 0.01, "history": history,
                });
                let solution = solved(&whole);
                worst = worst.max(off(&solution.fields.stress_xy, q));
                worst = worst.max(off(&solution.fields.stress_yy, -p));
            }
            let what = format!(
                "sheared patch of two bodies, {kind}, {history} law, upper one held by friction: largest error of σ_xy and σ_yy"
            );
            held(
                BODIES,
                &what,
                "distorted, 3:2 to 1:4 edges",
                worst,
                0.0,
                1e-11,
            );
        }
    }
}

/// Hydrostatic pressure through an interface in the shape of a cosine, and its order of convergence.
#[test]
fn hydrostatic_pressure_goes_through_a_curved_interface() {
    let cosine = |x: f64| 0.5 + 0.1 * (std::f64::consts::PI * x).cos();
    let errors = |m: usize| {
        let blocks = Blocks {
            kind: json!({"kind": "plane_strain"}),
            along: [3 * m, 2 * m],
            triangles: [false; 2],
            interface: cosine,
            distorted: 0.0,
        };
        let mut whole = blocks.problem();
        whole["materials"] = json!([{"youngs_modulus": 1, "poissons_ratio": 0.3}]);
        whole["loads"] = json!([
            {"boundary": "lower.right", "pressure": 1},
            {"boundary": "upper.right", "pressure": 1},
            {"boundary": "upper.top", "pressure": 1},
        ]);
        let solution = solved(&whole);
        [
            off(&solution.fields.stress_yy, -1.0),
            off(&solution.node_profiles["lower.top"].normal_stress, -1.0),
        ]
    };
    let errors = [1, 2, 4, 8].map(errors);
    // stresses in the bodies; the pressures at nodes are constants of dual functions, which carry no slope
    let cases = [
        (0, "σ_yy in the bodies", 2e-4, 1.8),
        (1, "p at the nodes", 2e-3, 1.0),
    ];
    for (k, what, allowed, least) in cases {
        let order = (errors[1][k] / errors[3][k]).log2() / 2.0;
        Line {
            row: BODIES,
            what: &format!(
                "hydrostatic pressure 1 through a cosine of amplitude .1: largest error of {what}"
            ),
            mesh: "24:16 edges",
            expected: 0.0,
            computed: errors[3][k],
            allowed,
            order: Some(order),
        }
        .hold();
        assert!(order > least, "{what}: {errors:?}");
    }
}

/// A layer that is bonded to its substrate, as two bodies of matching meshes, against one body of two materials, under an
/// obstacle with friction.
#[test]
fn a_bonded_layer_is_one_body_of_two_materials() {
    let x = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.65, 0.9, 1.3, 2.0, 3.0];
    let (deep, layer) = ([-3.0, -2.0, -1.2, -0.7, -0.3], [-0.3, -0.15, 0.0]);
    let whole = [&deep[..], &layer[1..]].concat();
    let contact = |boundary: &str| {
        json!({"boundary": boundary, "obstacle": {"kind": "parabola", "radius": 4}, "indentation": 0.03,
            "friction": {"coefficient": 0.3, "nonlocal_radius": 0.1, "elastic_slip": 1e-4}})
    };
    let materials = json!([
        {"group": "substrate", "youngs_modulus": 1000, "poissons_ratio": 0.3},
        {"group": "layer", "youngs_modulus": 4000, "poissons_ratio": 0.2},
    ]);
    let one = json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {
            "grid": {"x": x, "y": whole},
            "groups": {"substrate": {"y": [-3, -0.3]}, "layer": {"y": [-0.3, 0]}},
        },
        "materials": materials,
        "supports": [{"boundary": "left", "ux": 0}, {"boundary": "bottom", "uy": 0}],
        "contacts": [contact("top")],
        "solver": {"tolerance": 1e-12},
    });
    let two = json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grids": {"substrate": {"x": x, "y": deep}, "layer": {"x": x, "y": layer}}},
        "materials": materials,
        "supports": [
            {"boundary": "substrate.left", "ux": 0},
            {"boundary": "layer.left", "ux": 0},
            {"boundary": "substrate.bottom", "uy": 0},
        ],
        "contacts": [
            contact("layer.top"),
            {"boundary": "layer.bottom", "against": {"boundary": "substrate.top"}, "condition": "bonded"},
        ],
        "solver": {"tolerance": 1e-12},
    });
    let (one, two) = (solved(&one), solved(&two));
    let (a, b) = (
        &one.summary.contacts["top"],
        &two.summary.contacts["layer.top"],
    );
    for (what, one, two) in [
        ("normal force", a.normal_force, b.normal_force),
        ("friction force", a.friction_force, b.friction_force),
        (
            "peak pressure",
            a.peak_normal_stress.unwrap().value,
            b.peak_normal_stress.unwrap().value,
        ),
    ] {
        let what = format!("layer bonded to its substrate, as one body of two materials: {what}");
        held(BODIES, &what, "matching meshes", two, one, 1e-10);
    }
}

/// A body that is 10⁹ times as stiff in place of the obstacle of two examples of the thesis.
#[test]
fn a_stiff_body_is_the_obstacle_of_examples() {
    // the gap of two bodies is averaged over each node's share of the surface, which changes that of a circle
    for (name, obstacle, reach, allowed) in [
        ("rectangular_punch", "flat", 0.5, 1e-8),
        ("cylinder", "circle", 4.0, 2e-5),
    ] {
        let rigid = example(name);
        let depth = rigid.contacts[0].indentation;
        let rigid = solve(&rigid);
        let mut whole = serde_json::to_value(example(name)).unwrap();
        let grid = whole["mesh"]["grid"].take();
        let tool_x = even(0.0, reach, if obstacle == "flat" { 3 } else { 128 });
        let mut tool = json!({"x": tool_x, "y": [0, 0.5, 1]});
        let mut mesh = json!({"grids": {"block": grid}});
        if obstacle == "circle" {
            tool["top"] = json!([[0, 2], [reach, 2]]);
            let arc: Vec<[f64; 2]> = tool_x
                .iter()
                .map(|x| [*x, 8.0 - (64.0 - x * x).sqrt()])
                .collect();
            tool["bottom"] = json!(arc);
            mesh["curves"] =
                json!({"tool.bottom": {"kind": "circle", "center": [0, 8], "radius": 8}});
        }
        mesh["grids"]["tool"] = tool;
        whole["mesh"] = mesh;
        whole["materials"] = json!([
            {"group": "block", "youngs_modulus": 1e3, "poissons_ratio": 0.3},
            {"group": "tool", "youngs_modulus": 1e12, "poissons_ratio": 0.3},
        ]);
        whole["supports"] = json!([
            {"boundary": "block.left", "ux": 0},
            // the block is moved: the displacements of a body so stiff would be known to 10⁻⁷ of the forces only
            {"boundary": "block.bottom", "ux": 0, "uy": depth},
            {"boundary": "tool.left", "ux": 0},
            {"boundary": "tool.top", "ux": 0, "uy": 0},
        ]);
        let friction = whole["contacts"][0]["friction"].take();
        whole["contacts"] = json!([{"boundary": "block.top", "against": {"boundary": "tool.bottom"}, "normal": "body", "friction": friction}]);
        let elastic = solved(&whole);
        for (what, rigid, elastic) in [
            (
                "normal force",
                rigid.summary.normal_force,
                elastic.summary.normal_force,
            ),
            (
                "friction force",
                rigid.summary.friction_force,
                elastic.summary.friction_force,
            ),
        ] {
            let what = format!("{name} of the thesis with a body of 10⁹ E as its obstacle: {what}");
            held(BODIES, &what, "thesis mesh", elastic, rigid, allowed);
        }
    }
}

/// Two bodies with quarters of cylinders, or a flat in place of the lower one, pressed by half of the load: the grids, and the scale
/// of lengths.
fn cylinders(radii: [Option<f64>; 2], width: f64, scale: f64, count: u32) -> Value {
    let outside = [1.4, 1.7, 2.2, 3.0, 4.5, 7.0, 11.0, 20.0];
    let near = even(0.0, 1.2, count);
    let x: Vec<f64> = [&near[..], &outside].concat();
    let width = |radius: Option<f64>| match radius {
        None => x.clone(),
        Some(_) => x.iter().copied().filter(|x| *x <= width).collect(),
    };
    let scaled = |lines: &[f64]| lines.iter().map(|x| scale * x).collect::<Vec<_>>();
    let mut mesh = json!({"grids": {}, "curves": {}});
    for (name, radius, up) in [("lower", radii[0], -1.0), ("upper", radii[1], 1.0)] {
        let across = scaled(&width(radius));
        // with the surface at y = 0
        let mut y: Vec<f64> = scaled(&x).iter().map(|x| up * x).collect();
        let (side, far) = match up > 0.0 {
            true => ("bottom", "top"),
            false => ("top", "bottom"),
        };
        if up < 0.0 {
            y.reverse();
        }
        let mut grid = json!({"x": across, "y": y});
        if let Some(radius) = radius {
            let rise = |x: f64| up * (radius - (radius * radius - x * x).sqrt());
            let arc: Vec<[f64; 2]> = across.iter().map(|x| [*x, rise(*x)]).collect();
            let last = across[across.len() - 1];
            grid[side] = json!(arc);
            grid[far] = json!([[0, up * 20.0 * scale], [last, up * 20.0 * scale]]);
            let part: Vec<f64> = y.iter().map(|y| (y / (20.0 * scale)).abs()).collect();
            grid["y"] = match up > 0.0 {
                true => json!(part),
                false => json!(part.iter().map(|v| 1.0 - v).collect::<Vec<_>>()),
            };
            mesh["curves"][format!("{name}.{side}")] =
                json!({"kind": "circle", "center": [0, up * radius], "radius": radius});
        }
        mesh["grids"][name] = grid;
    }
    mesh
}

/// Half-space values of two rollers on blocks, with the orders of convergence.
#[test]
fn rollers_on_blocks_are_near_those_of_half_spaces() {
    for (what, radius, moduli, ratios, load, p0, allowed) in [
        (
            "Hertz, E 1000 and 3000, R 10, P 50",
            10.0,
            [1000.0, 3000.0],
            [0.3, 0.2],
            50.0,
            35.971_414_02,
            2e-3,
        ),
        (
            "roller of steel on a block, R 50, 35 kN/mm",
            50.0,
            [70e3, 210e3],
            [0.3, 0.3],
            35e3,
            3585.362,
            2e-2,
        ),
    ] {
        let [e, s] = moduli;
        let star = 1.0 / ((1.0 - ratios[0] * ratios[0]) / e + (1.0 - ratios[1] * ratios[1]) / s);
        let a = (4.0 * load * radius / (std::f64::consts::PI * star)).sqrt();
        close(2.0 * load / (std::f64::consts::PI * a), p0, 1e-6);
        let scale = a / 0.884_896_785;
        let peak = |count: u32| {
            let mesh = cylinders([None, Some(radius)], 4.5, scale, count);
            let solution = solved(&json!({
                "analysis": {"kind": "plane_strain"},
                "mesh": mesh,
                "materials": [
                    {"group": "lower", "youngs_modulus": e, "poissons_ratio": ratios[0]},
                    {"group": "upper", "youngs_modulus": s, "poissons_ratio": ratios[1]},
                ],
                "supports": [
                    {"boundary": "lower.bottom", "uy": 0},
                    {"boundary": "lower.left", "ux": 0},
                    {"boundary": "upper.left", "ux": 0},
                ],
                "loads": [{"boundary": "upper.top", "traction": [0, -0.5 * load / (4.5 * scale)]}],
                "contacts": [{"boundary": "lower.top", "against": {"boundary": "upper.bottom"}}],
            }));
            -solution.summary.contacts["lower.top"]
                .peak_normal_stress
                .unwrap()
                .value
        };
        let peaks = [6, 12, 24, 48].map(peak);
        let differences: Vec<f64> = peaks.windows(2).map(|p| (p[1] - p[0]).abs()).collect();
        let order = (differences[0] / differences[2]).log2() / 2.0;
        Line {
            row: BODIES,
            what: &format!("{what}: p₀"),
            mesh: "48 elements on 1.2 of .885 a, sides of 20 a",
            expected: p0,
            computed: peaks[3],
            allowed,
            order: Some(order),
        }
        .hold();
    }
}

/// Cattaneo and Mindlin with two equal elastic cylinders: pressed and then dragged by a load, or both at once by the total law.
#[test]
fn two_equal_cylinders_stick_inside_as_cattaneo_and_mindlin_say() {
    let (radius, mu, load, drag) = (8.0, 0.2, 10.0, 0.936_16);
    let star = 200.0 / (2.0 * (1.0 - 0.3 * 0.3));
    let a = (4.0 * load * 0.5 * radius / (std::f64::consts::PI * star)).sqrt();
    close(a, 0.680778, 1e-6);
    let count = 24;
    for history in ["total", "incremental"] {
        let half = cylinders([Some(radius); 2], 7.0, a / 0.884_896_785, count);
        // the mirror image of each grid, since shear is not symmetric
        let mut mesh = half.clone();
        for name in ["lower", "upper"] {
            let grid = &mut mesh["grids"][name];
            let mirrored = |list: &Value, of: fn(&Value) -> Value| -> Vec<Value> {
                let list = list.as_array().unwrap();
                list[1..]
                    .iter()
                    .rev()
                    .map(of)
                    .chain(list.iter().cloned())
                    .collect()
            };
            let number = |x: &Value| json!(-x.as_f64().unwrap());
            let point = |p: &Value| json!([-p[0].as_f64().unwrap(), p[1]]);
            let x = mirrored(&grid["x"], number);
            grid["x"] = json!(x);
            for side in ["top", "bottom"] {
                let points = mirrored(&grid[side], point);
                grid[side] = json!(points);
            }
        }
        let width = 2.0 * 7.0 * a / 0.884_896_785;
        let steps = match history {
            "total" => json!([]),
            _ => json!([
                {"supports": 1, "loads": 0, "increments": 8},
                {"supports": 1, "loads": 1, "increments": 8},
            ]),
        };
        let problem = |depth: f64| {
            json!({
                "analysis": {"kind": "plane_strain"},
                "mesh": mesh,
                "materials": [{"youngs_modulus": 200, "poissons_ratio": 0.3}],
                "supports": [
                    {"boundary": "lower.bottom", "ux": 0, "uy": 0},
                    {"boundary": "upper.top", "uy": -depth},
                ],
                "loads": [{"boundary": "upper.top", "traction": [drag / width, 0]}],
                "contacts": [{"boundary": "lower.top", "against": {"boundary": "upper.bottom"},
                    "friction": {"coefficient": mu, "nonlocal_radius": 0, "elastic_slip": 1e-5, "history": history, "points": "nodal"}}],
                "steps": steps,
            })
        };
        // the depth that needs the load, by the secant rule
        let force = |depth: f64| solved(&problem(depth)).summary.normal_force;
        let (mut d0, mut d1) = (0.4, 0.5);
        let mut f0 = force(d0) - load;
        let mut f1 = force(d1) - load;
        for _ in 0..6 {
            if f1.abs() < 1e-4 * load {
                break;
            }
            (d0, d1, f0) = (d1, d1 - f1 * (d1 - d0) / (f1 - f0), f1);
            f1 = force(d1) - load;
        }
        let solution = solved(&problem(d1));
        let contact = &solution.summary.contacts["lower.top"];
        close(contact.normal_force, load, 1e-3);
        close(contact.tangential_force.abs(), drag, 1e-6);
        let codes: Vec<WarningCode> = solution.summary.warnings.iter().map(|w| w.code).collect();
        assert!(!codes.contains(&WarningCode::NormalsDiffer), "{codes:?}");
        let p0 = 2.0 * load / (std::f64::consts::PI * a);
        let c = a * (1.0 - drag / (mu * load)).sqrt();
        close(c, 0.496511, 1e-6);
        let profile = &solution.node_profiles["lower.top"];
        let exact = |x: f64| {
            let part = |b: f64| (1.0 - (x / b).powi(2)).max(0.0).sqrt();
            mu * p0 * (part(a) - c / a * part(c))
        };
        let sum =
            |f: &dyn Fn(usize) -> f64| (0..profile.x.len()).map(|i| f(i).powi(2)).sum::<f64>();
        let off = sum(&|i| profile.tangential_stress[i].abs() - exact(profile.x[i]));
        let whole = sum(&|i| exact(profile.x[i]));
        let what = format!(
            "Cattaneo and Mindlin, two equal cylinders, {history} law: error of σ_t by mean squares"
        );
        held(
            BODIES,
            &what,
            "24 elements on 1.2 of .885 a a side",
            (off / whole).sqrt(),
            0.0,
            0.05,
        );
    }
}

/// A rectangular seal of nearly incompressible rubber between two walls, as obstacles or as bodies of 10⁹ E.
#[test]
fn a_seal_between_two_walls_is_that_between_two_obstacles() {
    let friction = json!({"coefficient": 0.4, "nonlocal_radius": 0.1, "elastic_slip": 1e-3});
    let seal = json!({"x": even(0.0, 2.0, 16), "y": even(0.0, 1.0, 8)});
    let rubber = json!({"group": "seal", "youngs_modulus": 5, "poissons_ratio": 0.4995});
    let rigid = json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grids": {"seal": seal}},
        "materials": [rubber],
        "supports": [{"boundary": "seal.left", "ux": 0}],
        "contacts": [
            {"boundary": "seal.top", "obstacle": {"kind": "flat"}, "indentation": 0.05, "friction": friction},
            {"boundary": "seal.bottom", "obstacle": {"kind": "flat"}, "indentation": 0.05, "friction": friction},
        ],
    });
    let wall = |y: [f64; 3]| json!({"x": even(0.0, 3.0, 5), "y": y});
    let elastic = json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grids": {"seal": seal, "roof": wall([1.0, 1.2, 1.4]), "floor": wall([-0.4, -0.2, 0.0])}},
        "materials": [
            rubber,
            {"group": "roof", "youngs_modulus": 5e9, "poissons_ratio": 0.3},
            {"group": "floor", "youngs_modulus": 5e9, "poissons_ratio": 0.3},
        ],
        "supports": [
            {"boundary": "seal.left", "ux": 0},
            {"boundary": "roof.left", "ux": 0},
            {"boundary": "floor.left", "ux": 0},
            {"boundary": "roof.top", "ux": 0, "uy": -0.05},
            {"boundary": "floor.bottom", "ux": 0, "uy": 0.05},
        ],
        "contacts": [
            {"boundary": "seal.top", "against": {"boundary": "roof.bottom"}, "friction": friction},
            {"boundary": "seal.bottom", "against": {"boundary": "floor.top"}, "friction": friction},
        ],
    });
    let (rigid, elastic) = (solved(&rigid), solved(&elastic));
    for side in ["seal.top", "seal.bottom"] {
        let [a, b] = [&rigid, &elastic].map(|s| &s.summary.contacts[side]);
        for (what, a, b) in [
            ("normal force", a.normal_force, b.normal_force),
            ("friction force", a.friction_force, b.friction_force),
        ] {
            let what = format!("seal, ν = .4995, between walls of 10⁹ E: {what} at {side}");
            held(BODIES, &what, "16 × 8 elements", b, a, 1e-6);
        }
    }
}

/// Examples of the thesis by their displacement; then by the force that it needs.
#[test]
fn examples_are_the_same_by_load_and_by_displacement() {
    for name in ["rectangular_punch", "cylinder"] {
        let mut by_displacement = example(name);
        by_displacement.solver.tolerance = 1e-12;
        let depth = by_displacement.contacts[0].indentation;
        let first = solve(&by_displacement).summary;
        let mut by_load = by_displacement.clone();
        by_load.contacts[0].indentation = 0.0;
        by_load.contacts[0].normal_force = Some(first.normal_force);
        let second = solve(&by_load).summary;
        let contact = second.contacts.values().next().unwrap();
        for (what, found, right) in [
            ("indentation", contact.indentation.unwrap(), depth),
            ("normal force", second.normal_force, first.normal_force),
            (
                "friction force",
                second.friction_force,
                first.friction_force,
            ),
        ] {
            let what = format!(
                "{name} of the thesis, loaded by the force that its displacement needs: {what}"
            );
            held(LOADS, &what, "thesis mesh", found, right, 1e-8);
        }
    }
}
