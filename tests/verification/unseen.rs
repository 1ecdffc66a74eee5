//! Random problems that the factors of the stated errors were not fitted to: other bodies, meshes, materials and supports than
//! those of the catalogue.

use fastrand::Rng;
use serde_json::{Value, json};
use solver::problem::Problem;

use crate::support::{Lattice, problem};

/// Contacts are about this wide on either side of their middle.
const HALF_WIDTH: f64 = 1.0;

fn between(dice: &mut Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * dice.f64()
}

/// The problem of this number.
pub(crate) fn case(number: u64) -> Problem {
    let mut dice = Rng::with_seed(!number);
    let dice = &mut dice;
    let round = dice.u32(0..5) == 0;
    let half = round || dice.u32(0..4) == 0;
    let shape = match dice.u32(0..6) {
        0 => Shape::Tapered(between(dice, -0.25, 0.4)),
        1 if !half => Shape::Leaning(between(dice, -0.4, 0.4)),
        2 => Shape::Round(between(dice, 8.0, 30.0)),
        _ => Shape::Block,
    };
    let body = Body::new(dice, half, shape);
    let modulus = 10f64.powf(between(dice, 0.0, 5.0));
    let (obstacle, depth) = obstacle(dice, &body, round);

    let analysis = match (round, dice.u32(0..2)) {
        (true, _) => json!({"kind": "axisymmetric"}),
        (_, 0) => json!({"kind": "plane_stress", "thickness": between(dice, 0.2, 3.0)}),
        _ => json!({"kind": "plane_strain"}),
    };
    let mut contact = json!({"boundary": "top", "obstacle": obstacle, "indentation": depth});
    if !half && dice.bool() {
        contact["tangential_displacement"] = json!(depth * between(dice, -1.0, 1.0));
    }
    let in_steps = dice.u32(0..7) == 0;
    if let Some(friction) = friction(dice, depth, modulus, in_steps) {
        contact["friction"] = friction;
    }
    let mut supports = vec![match dice.u32(0..4) {
        0 if half => json!({"boundary": "bottom", "uy": 0}),
        _ => json!({"boundary": "bottom", "ux": 0, "uy": 0}),
    }];
    if half {
        supports.push(json!({"boundary": "left", "ux": 0}));
    }
    if dice.u32(0..6) == 0 {
        supports.push(json!({"boundary": "right", "ux": 0, "uy": 0}));
    }
    let mut whole = json!({
        "analysis": analysis, "mesh": {"inline": body.mesh(dice)},
        "materials": body.materials(dice, modulus, round),
        "supports": supports, "contacts": [contact],
    });
    let small = 0.02 * depth * modulus;
    match dice.u32(0..6) {
        0 => {
            let traction = [between(dice, -small, small), between(dice, -small, small)];
            whole["loads"] = json!([{"boundary": "right", "traction": traction}]);
        }
        1 => {
            let force = [0.0, between(dice, -small, small)];
            whole["loads"] = json!([{"body_force": force}]);
        }
        _ => {}
    }
    if in_steps {
        whole["steps"] = json!([
            {"indentation": 1, "increments": dice.u32(1..4)},
            {"indentation": between(dice, 0.8, 1.2), "tangential_displacement": 1, "increments": dice.u32(1..4)},
        ]);
    }
    problem(&whole.to_string())
}

/// How a rectangle becomes a body.
#[derive(Clone, Copy, PartialEq)]
enum Shape {
    Block,
    /// Wider, or narrower, by this part at the bottom.
    Tapered(f64),
    /// Each unit of depth moved aside by so much.
    Leaning(f64),
    /// With a top of this radius.
    Round(f64),
}

/// Lines of a mesh, and what becomes of them.
struct Body {
    shape: Shape,
    /// Where the obstacle points to.
    center: f64,
    x: Vec<f64>,
    y: Vec<f64>,
    /// Columns and rows of a part that is missing at the upper right: a step.
    step: Option<[usize; 2]>,
}

impl Body {
    fn new(dice: &mut Rng, half: bool, shape: Shape) -> Self {
        let across = dice.u32(2..6);
        let fine = HALF_WIDTH / f64::from(across);
        let center = if half { 0.0 } else { between(dice, -0.3, 0.3) };
        let side = |dice: &mut Rng| {
            let mut lines = Vec::new();
            let (mut at, mut step) = (0.0, fine);
            let (reach, growth) = (between(dice, 1.1, 1.5), between(dice, 1.5, 3.0));
            let width = between(dice, 1.8, 6.0);
            while at < width - 0.6 * step {
                at += step * between(dice, 0.8, 1.2);
                lines.push(at.min(width));
                if at > reach {
                    step *= growth;
                }
            }
            lines
        };
        let right = side(dice);
        let fine_right = right.iter().filter(|x| **x < 1.5).count();
        let left = if half { Vec::new() } else { side(dice) };
        let mut x: Vec<f64> = left.iter().rev().map(|x| center - x).collect();
        x.push(center);
        let middle = x.len();
        x.extend(right.iter().map(|x| center + x));
        let (height, growth) = (between(dice, 1.5, 6.0), between(dice, 1.5, 2.5));
        let (mut y, mut step) = (vec![0.0], fine * between(dice, 0.5, 1.3));
        while y[y.len() - 1] > 0.6 * step - height {
            y.push((y[y.len() - 1] - step).max(-height));
            step *= growth;
        }
        y.reverse();
        let first = middle + fine_right + 1;
        let stepped = shape == Shape::Block && dice.u32(0..4) == 0 && first < x.len();
        let step = stepped.then(|| [first - 1, y.len() - 1 - (y.len() - 1).div_ceil(2)]);
        Body {
            shape,
            center,
            x,
            y,
            step: step.filter(|[_, row]| *row > 0),
        }
    }

    /// Whether the cell of a column and a row, from below, is there.
    fn has(&self, column: usize, row: usize) -> bool {
        self.step
            .is_none_or(|[first, rows]| column < first || row < rows)
    }

    fn place(&self, x: f64, y: f64) -> [f64; 2] {
        let bottom = self.y[0];
        match self.shape {
            Shape::Block => [x, y],
            Shape::Tapered(more) => [x * (1.0 + more * y / bottom), y],
            Shape::Leaning(slope) => [x + slope * y, y],
            Shape::Round(radius) => {
                let sag = (x - self.center).powi(2) / (2.0 * radius);
                [x, y - sag * (1.0 - y / bottom)]
            }
        }
    }

    fn mesh(&self, dice: &mut Rng) -> Value {
        let (columns, rows) = (self.x.len() - 1, self.y.len() - 1);
        let jitter = if dice.u32(0..3) == 0 { 0.2 } else { 0.0 };
        let mut corners = vec![vec![[0.0; 2]; rows + 1]; columns + 1];
        for (i, column) in corners.iter_mut().enumerate() {
            for (j, corner) in column.iter_mut().enumerate() {
                *corner = [self.x[i], self.y[j]];
                let inside = (1..columns).contains(&i) && (1..rows).contains(&j);
                let at_step = self.step.is_some_and(|[c, r]| i >= c || j == r);
                if inside && !at_step {
                    let room = |lines: &[f64], k: usize| {
                        (lines[k + 1] - lines[k]).min(lines[k] - lines[k - 1])
                    };
                    corner[0] += jitter * room(&self.x, i) * between(dice, -1.0, 1.0);
                    corner[1] += jitter * room(&self.y, j) * between(dice, -1.0, 1.0);
                }
            }
        }
        let lattice = Lattice::new(columns, rows, |i, j| {
            let (low, high) = (corners[i / 2][j / 2], corners[i.div_ceil(2)][j.div_ceil(2)]);
            self.place(0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]))
        });
        let triangles = dice.u32(0..4);
        let there: Vec<bool> = (0..columns * rows)
            .map(|e| self.has(e % columns, e / columns))
            .collect();
        let cut: Vec<bool> = there
            .iter()
            .map(|there| match triangles {
                0 => true,
                1 => dice.bool(),
                _ => false,
            } && *there)
            .collect();
        let (nodes, elements) = lattice.cut(|e| cut[e]);
        // what is cut has two elements
        let mut cell = (0..columns * rows).flat_map(|e| vec![e; 1 + usize::from(cut[e])]);
        let mut soft = Vec::new();
        let mut kept: Vec<Vec<usize>> = Vec::new();
        for element in elements {
            let e = cell.next().unwrap();
            if there[e] {
                if 2 * (e / columns) < rows {
                    soft.push(kept.len());
                }
                kept.push(element);
            }
        }
        let mut number = vec![usize::MAX; nodes.len()];
        let mut used = Vec::new();
        for node in kept.iter().flatten() {
            if number[*node] == usize::MAX {
                number[*node] = used.len();
                used.push(nodes[*node]);
            }
        }
        let named = |edges: Vec<[usize; 3]>| -> Vec<[usize; 3]> {
            edges.iter().map(|edge| edge.map(|n| number[n])).collect()
        };
        let [top, side] = self.step.unwrap_or([columns, rows]);
        let elements: Vec<Vec<usize>> = kept
            .iter()
            .map(|element| element.iter().map(|n| number[*n]).collect())
            .collect();
        json!({"nodes": used, "elements": elements, "groups": {"deep": soft}, "boundaries": {
            "top": named(lattice.edges(top, |k| (k, 2 * rows))),
            "bottom": named(lattice.edges(columns, |k| (k, 0))),
            "left": named(lattice.edges(rows, |k| (0, k))),
            "right": named(lattice.edges(side, |k| (2 * columns, k))),
        }})
    }

    fn materials(&self, dice: &mut Rng, modulus: f64, round: bool) -> Value {
        let isotropic = |dice: &mut Rng, modulus: f64| json!({"youngs_modulus": modulus, "poissons_ratio": between(dice, 0.0, 0.45)});
        let own = match dice.u32(0..3) {
            0 if !round => {
                let other = modulus * between(dice, 0.3, 1.0);
                json!({"orthotropic": {"e1": modulus, "e2": other, "e3": modulus * between(dice, 0.3, 1.0),
                    "nu12": between(dice, 0.0, 0.3), "nu13": between(dice, 0.0, 0.2), "nu23": between(dice, 0.0, 0.2),
                    "g12": modulus * between(dice, 0.08, 0.5), "angle": between(dice, -90.0, 90.0)}})
            }
            _ => isotropic(dice, modulus),
        };
        if dice.u32(0..4) > 0 {
            return json!([own]);
        }
        let other = modulus * 10f64.powf(between(dice, -1.0, 1.0));
        let mut deep = isotropic(dice, other);
        deep["group"] = json!("deep");
        json!([own, deep])
    }
}

/// An obstacle that touches over a half-width near 1, and its indentation.
fn obstacle(dice: &mut Rng, body: &Body, round: bool) -> (Value, f64) {
    let center = body.center;
    let loads = between(dice, 0.5, 1.3);
    let radius = between(dice, 5.0, 50.0);
    if let Shape::Round(radius) = body.shape {
        let line = json!({"kind": "line", "point": [center, 0.0], "angle": 0.0});
        return (line, loads / radius);
    }
    let edge = |side: f64| {
        let lines = body.x.iter().filter(|x| (**x - center) * side > 0.0);
        let off = |x: &f64| ((x - center).abs() - 0.8).abs();
        lines
            .copied()
            .min_by(|a, b| off(a).total_cmp(&off(b)))
            .unwrap_or(center)
    };
    match dice.u32(0..8) {
        0 => {
            let mut flat = json!({"kind": "flat", "from": edge(-1.0), "to": edge(1.0)});
            if dice.bool() && body.x[0] < center {
                flat["kind"] = json!("tilted");
                flat["center"] = json!(center);
                flat["slope"] = json!(between(dice, -0.008, 0.008));
            }
            (flat, 0.02 * loads)
        }
        1 => {
            let angle = between(dice, 0.5, 4.0);
            let kind = if round { "cone" } else { "wedge" };
            let wedge = json!({"kind": kind, "angle": angle, "center": center});
            (wedge, 1.2 * loads * f64::to_radians(angle).tan())
        }
        2 => {
            let (coefficient, exponent) = (between(dice, 0.01, 0.06), between(dice, 2.0, 4.0));
            let power = json!({"kind": "power", "coefficient": coefficient, "exponent": exponent, "center": center});
            (power, 2.0 * loads * coefficient)
        }
        3 => {
            let rounded = json!({"kind": "rounded_flat", "half_width": between(dice, 0.2, 0.7), "radius": radius, "center": center});
            (rounded, loads / radius)
        }
        4 | 5 => {
            let (count, higher) = (dice.u32(9..40), between(dice, 0.0, 0.3));
            let lean = if body.x[0] < center {
                between(dice, -0.1, 0.1)
            } else {
                0.0
            };
            let x = |i: u32| 2.0 * f64::from(i) / f64::from(count - 1) - 1.0;
            let gap = |x: f64| 4.5 * x * x / radius * (1.0 + lean * x + higher * x * x);
            let places: Vec<f64> = (0..count).map(|i| center + 3.0 * x(i)).collect();
            let gaps: Vec<f64> = (0..count).map(|i| gap(x(i))).collect();
            let table =
                json!({"kind": "table", "x": places, "gap": gaps, "interpolation": "cubic"});
            (table, loads / radius)
        }
        6 => (
            json!({"kind": "circle", "radius": radius, "center": center}),
            loads / radius,
        ),
        _ => (
            json!({"kind": "parabola", "radius": radius, "center": center}),
            loads / radius,
        ),
    }
}

fn friction(dice: &mut Rng, depth: f64, modulus: f64, in_steps: bool) -> Option<Value> {
    if dice.u32(0..7) == 0 && !in_steps {
        return None;
    }
    let radius = match dice.u32(0..5) {
        0 | 1 => 0.0,
        _ => between(dice, 0.05, 0.4),
    };
    let slip = depth * 10f64.powf(between(dice, -3.5, -1.5));
    let mut friction = json!({"coefficient": between(dice, 0.1, 0.8), "nonlocal_radius": radius, "elastic_slip": slip});
    match dice.u32(0..10) {
        _ if in_steps => friction["history"] = json!("incremental"),
        0 => friction["transition"] = json!("tanh"),
        1 => friction["points"] = json!("nodal"),
        2 => friction["shear_cap"] = json!(4e-3 * modulus),
        3 => friction["normalization"] = json!("conserving"),
        _ => {}
    }
    Some(friction)
}
