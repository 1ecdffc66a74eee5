//! Random problems of contact, each made from its number alone, for what has to hold on all problems and not only on
//! those that somebody thought of.

use fastrand::Rng;
use serde_json::{Value, json};
use solver::problem::{Analysis, Elasticity, Grid, Problem};

use crate::support::{Lattice, problem, union};

/// One problem of the catalogue.
pub(crate) struct Case {
    /// What it consists of, in words.
    pub(crate) words: String,
    /// The mesh is of the whole body; otherwise of its right half, or of the section of a body of revolution.
    whole: bool,
    pub(crate) problem: Problem,
}

/// Where the pressure has its largest gradient.
#[derive(Clone, Copy, PartialEq)]
enum Shape {
    /// It falls to zero at the end of contact.
    Smooth,
    /// It has no limit at a sharp edge, at half-width 1 or less.
    Edge(f64),
    /// It has no limit at the tip.
    Tip,
}

/// Half-widths of contacts are near 1, whatever the obstacle.
const WIDTH: f64 = 1.0;

/// The problem of this number.
pub(crate) fn case(number: u64) -> Case {
    let mut dice = Rng::with_seed(number);
    let dice = &mut dice;
    let body = one_of(dice, &["half", "half", "whole", "whole", "axisymmetric"]);
    let round = body == "axisymmetric";
    let center = match body {
        "whole" => between(dice, -0.4, 0.4),
        _ => 0.0,
    };
    let (obstacle, shape, depth) = obstacle(dice, round, center);
    let kind = obstacle["kind"].as_str().unwrap_or_default().to_owned();

    let (width, height) = (between(dice, 3.0, 9.0), between(dice, 2.0, 8.0));
    let across = dice.u32(2..9);
    let step = WIDTH / f64::from(across);
    let growth = between(dice, 1.3, 1.9);
    let lines = |from: f64, to: f64| crate::support::graded(from, to, step, growth);
    let fine: Vec<f64> = (0..=across * 3 / 2).map(|i| f64::from(i) * step).collect();
    let reach = fine[fine.len() - 1];
    let mut right = union(&[fine, lines(reach, width)]);
    if let Shape::Edge(edge) = shape {
        right = with_edge(right, edge, dice.u32(0..4));
    }
    let x: Vec<f64> = match body {
        "whole" => {
            let left = right.iter().map(|x| center - x);
            union(&[left.collect(), right.iter().map(|x| center + x).collect()])
        }
        _ => right,
    };
    let mut y = lines(0.0, -height);
    y.reverse();
    let triangles = dice.u32(0..4) == 0;
    let mesh = match triangles {
        false => json!({"grid": {"x": x, "y": y}}),
        true => triangles_of(&x, &y),
    };

    let analysis = match (round, dice.u32(0..3)) {
        (true, _) => json!({"kind": "axisymmetric"}),
        (_, 0) => json!({"kind": "plane_stress", "thickness": between(dice, 0.1, 2.0)}),
        _ => json!({"kind": "plane_strain"}),
    };
    let modulus = *pick(dice, &[1.0, 1000.0, 210_000.0]);
    let ratio = between(dice, 0.0, 0.45);
    let mut supports = vec![json!({"boundary": "bottom", "ux": 0, "uy": 0})];
    if body != "whole" {
        supports.push(json!({"boundary": "left", "ux": 0}));
        if dice.u32(0..4) == 0 {
            supports[0] = json!({"boundary": "bottom", "uy": 0});
        }
    }
    // half a body is half of a symmetric problem, which a drag is not
    let drag = match dice.u32(0..3) {
        0 if body == "whole" => depth * between(dice, -1.5, 1.5),
        _ => 0.0,
    };
    let (friction, law) = friction(dice, depth, modulus, round);
    let mut contact = json!({"boundary": "top", "obstacle": obstacle, "indentation": depth,
        "tangential_displacement": drag});
    if let Some(friction) = friction {
        contact["friction"] = friction;
    }
    let mut whole = json!({
        "analysis": analysis, "mesh": mesh,
        "materials": [{"youngs_modulus": modulus, "poissons_ratio": ratio}],
        "supports": supports, "contacts": [contact],
    });
    if dice.u32(0..6) == 0 && shape == Shape::Smooth {
        whole["contacts"][0]["normal"] = json!("obstacle");
    }
    let mut load = "";
    match dice.u32(0..8) {
        0 => {
            load = "pulled aside";
            let traction = [0.01 * depth * modulus * between(dice, -1.0, 1.0), 0.0];
            whole["loads"] = json!([{"boundary": "right", "traction": traction}]);
        }
        // pressed against the obstacle by a load: only contact holds it upright
        1 if shape == Shape::Smooth => {
            load = "pressed by a load";
            let pressure = 0.1 * depth * modulus * between(dice, 0.5, 1.5);
            whole["loads"] = json!([{"boundary": "bottom", "pressure": pressure}]);
            whole["contacts"][0]["indentation"] = json!(0);
            whole["supports"] = match body {
                "whole" => json!([{"boundary": "bottom", "ux": 0}]),
                _ => json!([{"boundary": "left", "ux": 0}]),
            };
        }
        2 => {
            load = "own weight";
            whole["loads"] = json!([{"body_force": [0, -0.01 * modulus * depth]}]);
        }
        _ => {}
    }
    let mut history = "";
    if dice.u32(0..6) == 0 {
        history = "in steps";
        let increments = dice.u32(1..5);
        whole["steps"] = json!([
            {"indentation": 1, "increments": increments, "spacing": *pick(dice, &["uniform", "contact_width"])},
            {"indentation": 1, "tangential_displacement": 1, "increments": increments},
        ]);
    }
    let elements = if triangles {
        "triangles"
    } else {
        "quadrilaterals"
    };
    Case {
        whole: body == "whole",
        words: format!(
            "{body} {kind}, {law}, drag {:.2}, {elements} {load} {history}",
            drag / depth
        ),
        problem: problem(&whole.to_string()),
    }
}

/// An obstacle that touches over a half-width near 1, its shape and its indentation.
fn obstacle(dice: &mut Rng, round: bool, center: f64) -> (Value, Shape, f64) {
    let loads = between(dice, 0.6, 1.6);
    let kinds = [
        "flat",
        "circle",
        "parabola",
        "cone",
        "tilted",
        "power",
        "rounded_flat",
    ];
    match one_of(dice, &kinds) {
        "flat" => {
            let edge = between(dice, 0.5, 1.0);
            let obstacle = json!({"kind": "flat", "from": center - edge, "to": center + edge});
            (from_axis(obstacle, center), Shape::Edge(edge), 0.02 * loads)
        }
        "tilted" if center != 0.0 => {
            let (edge, slope) = (between(dice, 0.5, 1.0), between(dice, -0.01, 0.01));
            let obstacle = json!({"kind": "tilted", "slope": slope, "center": center, "from": center - edge,
                "to": center + edge});
            (obstacle, Shape::Edge(edge), 0.02 * loads)
        }
        "circle" => {
            let radius = between(dice, 6.0, 40.0);
            (
                json!({"kind": "circle", "radius": radius, "center": center}),
                Shape::Smooth,
                loads / radius,
            )
        }
        "cone" => {
            let angle: f64 = between(dice, 0.5, 5.0);
            let kind = if round { "cone" } else { "wedge" };
            let depth = loads * 1.2 * angle.to_radians().tan();
            (
                json!({"kind": kind, "angle": angle, "center": center}),
                Shape::Tip,
                depth,
            )
        }
        "power" => {
            let (coefficient, exponent) = (between(dice, 0.01, 0.08), between(dice, 1.5, 4.5));
            let obstacle = json!({"kind": "power", "coefficient": coefficient, "exponent": exponent, "center": center});
            (obstacle, Shape::Smooth, 2.0 * loads * coefficient)
        }
        "rounded_flat" => {
            let (half_width, radius) = (between(dice, 0.3, 0.8), between(dice, 2.0, 20.0));
            let obstacle = json!({"kind": "rounded_flat", "half_width": half_width, "radius": radius, "center": center});
            (obstacle, Shape::Smooth, 0.02 * loads)
        }
        _ => {
            let radius = between(dice, 6.0, 40.0);
            // dice of their own, so that all other problems stay as they are
            let mut dice = Rng::with_seed(radius.to_bits());
            let parabola = json!({"kind": "parabola", "radius": radius, "center": center});
            let obstacle = match dice.u32(0..2) {
                0 => parabola,
                _ => smooth_table(&mut dice, radius, center),
            };
            (obstacle, Shape::Smooth, loads / radius)
        }
    }
}

/// Points of a curve between a parabola and one of fourth order, joined smoothly.
fn smooth_table(dice: &mut Rng, radius: f64, center: f64) -> Value {
    let (count, reach) = (dice.u32(5..30), 2.5);
    let higher = between(dice, 0.0, 0.5);
    let gap = |x: f64| x * x / (2.0 * radius) * (1.0 + higher * x * x);
    // on both sides of the middle, also of half a body: its slope there is 0
    let place = |i: u32| reach * (2.0 * f64::from(i) / f64::from(count - 1) - 1.0);
    let x: Vec<f64> = (0..count).map(|i| center + place(i)).collect();
    let gap: Vec<f64> = (0..count).map(|i| gap(place(i))).collect();
    json!({"kind": "table", "x": x, "gap": gap, "interpolation": "cubic"})
}

/// An obstacle of half a body begins on its axis.
fn from_axis(mut obstacle: Value, center: f64) -> Value {
    if center == 0.0 {
        obstacle["from"] = json!(0.0);
    }
    obstacle
}

fn friction(dice: &mut Rng, depth: f64, modulus: f64, round: bool) -> (Option<Value>, String) {
    if dice.u32(0..10) == 0 {
        return (None, "frictionless".into());
    }
    let coefficient = between(dice, 0.05, 0.9);
    let radius = match dice.u32(0..4) {
        0 => 0.0,
        _ => between(dice, 0.02, 0.5),
    };
    let slip = depth * 10f64.powf(between(dice, -4.0, -1.5));
    let mut friction =
        json!({"coefficient": coefficient, "nonlocal_radius": radius, "elastic_slip": slip});
    let mut law = format!("μ {coefficient:.2} ρ {radius:.2} ε/δ {:.0e}", slip / depth);
    let mut set = |name: &str, value: Value| {
        law += &format!(" {name} {value}");
        friction[name] = value;
    };
    match dice.u32(0..12) {
        0 => set("kernel", json!("parabola")),
        1 => set("transition", json!("tanh")),
        2 | 3 => set("history", json!("incremental")),
        4 => set("points", json!("nodal")),
        5 if radius > 0.0 => set("cohesion", json!(1e-3 * modulus)),
        6 => set("shear_cap", json!(5e-3 * modulus)),
        7 if round && radius > 0.0 => set("measure", json!("surface")),
        _ => {}
    }
    (Some(friction), law)
}

/// Puts a line on the edge of the obstacle, and others that halve their distance to it.
fn with_edge(lines: Vec<f64>, edge: f64, halvings: u32) -> Vec<f64> {
    let nearest = lines.iter().copied().filter(|x| *x > 0.0);
    let nearest = nearest.min_by(|a, b| (a - edge).abs().total_cmp(&(b - edge).abs()));
    let mut lines: Vec<f64> = lines
        .into_iter()
        .map(|x| if Some(x) == nearest { edge } else { x })
        .collect();
    for _ in 0..halvings {
        let at = lines.iter().position(|x| *x == edge).unwrap_or(1);
        let (before, after) = (0.5 * (lines[at - 1] + edge), 0.5 * (edge + lines[at + 1]));
        lines.insert(at + 1, after);
        lines.insert(at, before);
    }
    lines
}

/// A grid with every cell cut in two triangles.
fn triangles_of(x: &[f64], y: &[f64]) -> Value {
    let at = |lines: &[f64], i: usize| match i % 2 {
        0 => lines[i / 2],
        _ => 0.5 * (lines[i / 2] + lines[i / 2 + 1]),
    };
    let (columns, rows) = (x.len() - 1, y.len() - 1);
    let lattice = Lattice::new(columns, rows, |i, j| [at(x, i), at(y, j)]);
    let (nodes, elements) = lattice.cut(|_| true);
    inline_of(&lattice, columns, rows, nodes, elements)
}

fn inline_of(
    lattice: &Lattice,
    columns: usize,
    rows: usize,
    nodes: Vec<[f64; 2]>,
    elements: Vec<Vec<usize>>,
) -> Value {
    json!({"inline": {"nodes": nodes, "elements": elements, "boundaries": {
        "top": lattice.edges(columns, |k| (k, 2 * rows)),
        "bottom": lattice.edges(columns, |k| (k, 0)),
        "left": lattice.edges(rows, |k| (0, k)),
        "right": lattice.edges(rows, |k| (2 * columns, k)),
    }}})
}

/// The problem of this number on an unstructured mesh: of a grid every inner crossing is moved, and some cells are cut
/// in two triangles; other meshes stay.
pub(crate) fn unstructured(number: u64) -> Problem {
    let mut problem = case(number).problem;
    let mut dice = Rng::with_seed(number);
    let Some(Grid { x, y, .. }) = problem.mesh.grid() else {
        return problem;
    };
    let (columns, rows) = (x.len() - 1, y.len() - 1);
    let mut corners = vec![vec![[0.0; 2]; rows + 1]; columns + 1];
    for (i, column) in corners.iter_mut().enumerate() {
        for (j, corner) in column.iter_mut().enumerate() {
            *corner = [x[i], y[j]];
            if (1..columns).contains(&i) && (1..rows).contains(&j) {
                let room = |lines: &[f64], k: usize| {
                    (lines[k + 1] - lines[k]).min(lines[k] - lines[k - 1])
                };
                corner[0] += 0.2 * room(x, i) * between(&mut dice, -1.0, 1.0);
                corner[1] += 0.2 * room(y, j) * between(&mut dice, -1.0, 1.0);
            }
        }
    }
    let lattice = Lattice::new(columns, rows, |i, j| {
        let (low, high) = (corners[i / 2][j / 2], corners[i.div_ceil(2)][j.div_ceil(2)]);
        [0, 1].map(|a| 0.5 * (low[a] + high[a]))
    });
    let cut: Vec<bool> = (0..columns * rows).map(|_| dice.bool()).collect();
    let (nodes, elements) = lattice.cut(|e| cut[e]);
    problem.mesh = serde_json::from_value(inline_of(&lattice, columns, rows, nodes, elements))
        .unwrap_or_else(|error| panic!("{number}: {error}"));
    problem
}

/// The problem of this number on a mesh of Gmsh's (`tests/data/gmsh/block.geo`), which knows nothing of the obstacle.
pub(crate) fn gmsh(number: u64) -> Problem {
    let Case {
        whole, mut problem, ..
    } = case(number);
    let part = if whole { "whole" } else { "half" };
    let family = one_of(&mut Rng::with_seed(!number), &["quad8", "tri6", "mixed"]);
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/data/gmsh");
    let path = format!("{folder}/block-{part}-{family}.msh");
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"));
    problem.mesh = serde_json::from_value(json!({"gmsh": text})).unwrap();
    problem
}

/// The problem of this number with a body of an orthotropic material; one of revolution stays as it is.
pub(crate) fn orthotropic(number: u64) -> Problem {
    let mut problem = case(number).problem;
    let dice = &mut Rng::with_seed(number);
    let Elasticity::Isotropic { youngs_modulus, .. } = problem.materials[0].elasticity else {
        return problem;
    };
    if !matches!(problem.analysis, Analysis::Axisymmetric {}) {
        let mut part = |low: f64, high: f64| youngs_modulus * between(dice, low, high);
        let material = json!({"orthotropic": {
            "e1": youngs_modulus, "e2": part(0.2, 1.5), "e3": part(0.2, 1.5), "g12": part(0.07, 0.6),
            "nu12": part(0.0, 0.25) / youngs_modulus, "nu13": part(0.0, 0.15) / youngs_modulus,
            "nu23": part(0.0, 0.15) / youngs_modulus, "angle": part(-90.0, 90.0) / youngs_modulus,
        }});
        problem.materials = vec![serde_json::from_value(material).unwrap()];
    }
    problem
}

/// The problem of this number on every second line of its grid; the outermost lines and that of an edge stay. Other meshes
/// stay.
pub(crate) fn coarse(number: u64) -> Problem {
    let mut problem = case(number).problem;
    let edges = problem.contacts[0].obstacle.as_ref().unwrap().span();
    if let Some(grid) = problem.mesh.grid_mut() {
        for lines in [&mut grid.x, &mut grid.y] {
            let last = lines.len() - 1;
            let kept = lines.iter().enumerate().filter(|(i, line)| {
                i % 2 == 0 || *i == last || edges.0 == Some(**line) || edges.1 == Some(**line)
            });
            *lines = kept.map(|(_, line)| *line).collect();
        }
    }
    problem
}

fn between(dice: &mut Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * dice.f64()
}

fn pick<'a, T>(dice: &mut Rng, some: &'a [T]) -> &'a T {
    &some[dice.usize(0..some.len())]
}

fn one_of<'a>(dice: &mut Rng, some: &[&'a str]) -> &'a str {
    some[dice.usize(0..some.len())]
}
