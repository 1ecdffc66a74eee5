//! Bodies that overlap an obstacle from the start, each compared with the same problem given in another way: the obstacle
//! just touches and is pushed, or the body is moved.
//!
//! What is in front of a surface and what is behind it is decided for lines and polylines alone; the problems they are
//! compared with need no such decision. Random bodies: discs, ellipses, blobs and blocks; holes and fillets; with curved and
//! straight sides, of quadrilaterals and triangles.

use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

use fastrand::Rng;
use serde_json::{Value, json};
use solver::contact::ContactBoundary;
use solver::model::Model;
use solver::solution::{Warning, WarningCode};

use crate::record::keep_table;
use crate::support::{Lattice, close, numbers, problem, quiet, solve};

/// Pairs of problems; `SIGNORINI_OVERLAPS` asks for others: `from..to`.
const NUMBERS: std::ops::Range<u64> = 0..2200;

/// Largest difference of two descriptions of the same gaps: rounding, and for smooth polylines the spline through 240 points
/// of a circle of radius R, off by 2·10⁻⁸ R at gaps from 10⁻⁴ R on.
const SAME: f64 = 1e-8;
/// Where an edge that a roller touches turns away from it, the edge is divided; under a table it is not.
const BY_ITS_END: f64 = 5e-3;

const BY_SPLINE: f64 = 1e-3;

/// A body with the boundaries `face` and `back`, the latter moved.
struct Body {
    words: String,
    mesh: Value,
    /// Whether the face surrounds a hole.
    hole: bool,
    /// About the size of the body, and the distance from `face` to `back`.
    size: f64,
    thickness: f64,
}

/// A rigid motion of the plane.
#[derive(Clone, Copy)]
struct Motion {
    angle: f64,
    shift: [f64; 2],
}

impl Motion {
    fn turn(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let (s, c) = self.angle.sin_cos();
        [c * x - s * y, s * x + c * y]
    }

    fn of(&self, place: [f64; 2]) -> [f64; 2] {
        let [x, y] = self.turn(place);
        [x + self.shift[0], y + self.shift[1]]
    }
}

fn body(dice: &mut Rng, straight_face: bool, motion: Motion) -> Body {
    let kinds: &[&str] = match straight_face {
        true => &["block"],
        false => &[
            "disc",
            "ellipse",
            "blob",
            "block",
            "hole",
            "elliptic hole",
            "fillet",
        ],
    };
    let kind = kinds[dice.usize(..kinds.len())];
    let (columns, rows) = (dice.usize(8..16), dice.usize(2..4));
    let size = 10f64.powf(2.0 * dice.f64() - 1.0);
    let wall = size * (0.15 + 0.5 * dice.f64());
    let span = match (kind, dice.u8(..3)) {
        ("fillet", _) => 0.5 * PI,
        (_, 0) => PI,
        _ => 0.6 + 2.4 * dice.f64(),
    };
    let middle = TAU * dice.f64();
    let flatter = 0.6 + 0.8 * dice.f64();
    let waves = [(); 3].map(|()| (0.04 * dice.f64(), TAU * dice.f64()));
    let lean = [dice.f64() - 0.5, dice.f64() - 0.5];
    let hole = matches!(kind, "hole" | "elliptic hole" | "fillet");
    // of the face, at an angle
    let radius = |angle: f64| {
        let factor = match kind {
            "ellipse" | "elliptic hole" => flatter / (flatter * angle.cos()).hypot(angle.sin()),
            "blob" => {
                let wave = |(k, (size, phase)): (usize, &(f64, f64))| {
                    size * ((k + 2) as f64 * angle + phase).cos()
                };
                1.0 + waves.iter().enumerate().map(wave).sum::<f64>()
            }
            _ => 1.0,
        };
        size * factor
    };
    let place = |i: usize, j: usize| {
        let (across, up) = (
            i as f64 / (2 * columns) as f64,
            j as f64 / (2 * rows) as f64,
        );
        if kind == "block" {
            let below = 1.0 - up;
            let x = size * (across - 0.5) * (1.0 + lean[0] * below) + lean[1] * wall * below;
            return motion.of([x, -wall * below]);
        }
        // clockwise, outwards
        let angle = middle + span * (0.5 - across);
        let r = radius(angle) + wall * if hole { up } else { up - 1.0 };
        motion.of([r * angle.cos(), r * angle.sin()])
    };
    let mut lattice = Lattice::new(columns, rows, place);
    let straight_sides = dice.u8(..3) == 0;
    if straight_sides {
        for element in lattice.elements.clone() {
            for k in 0..4 {
                let [a, b] = [element[k], element[(k + 1) % 4]].map(|n| lattice.nodes[n]);
                lattice.nodes[element[4 + k]] = [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
            }
        }
    }
    let cut = dice.u8(..3);
    let some: Vec<bool> = lattice.elements.iter().map(|_| dice.bool()).collect();
    let (nodes, elements) = lattice.cut(|e| cut == 1 || cut == 2 && some[e]);
    // with the body on the right
    let outer = lattice.edges(columns, |k| (k, 2 * rows));
    let inner = lattice.edges(columns, |k| (2 * columns - k, 0));
    let (face, back) = if hole { (inner, outer) } else { (outer, inner) };
    Body {
        words: format!(
            "{kind}, {} sides, {}",
            if straight_sides { "straight" } else { "curved" },
            ["quadrilaterals", "triangles", "both"][usize::from(cut)]
        ),
        mesh: json!({"inline": {"nodes": nodes, "elements": elements, "boundaries": {"face": face, "back": back}}}),
        hole,
        size,
        thickness: wall,
    }
}

/// A problem: `contact` has all but the boundary; `moved`: the displacement of the back.
fn with(body: &Body, mut contact: Value, moved: [f64; 2]) -> Value {
    contact["boundary"] = json!("face");
    json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": body.mesh,
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "back", "ux": moved[0], "uy": moved[1]}],
        "contacts": [contact],
    })
}

/// The face, or the part of it between two arc lengths, as a contact has it; none if an element is folded.
fn face(body: &Body, part: Option<[f64; 2]>) -> Option<ContactBoundary> {
    let mut flat = json!({"kind": "flat", "along": "arc_length"});
    if let Some([from, to]) = part {
        (flat["from"], flat["to"]) = (json!(from), json!(to));
    }
    let contact = json!({"obstacle": flat});
    let model = Model::new(&problem(&with(body, contact, [0.0; 2]).to_string()), None).ok()?;
    Some(model.contacts[0].boundary.clone())
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

fn cross(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

fn minus(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

/// Points in either order.
fn polyline(dice: &mut Rng, mut points: Vec<[f64; 2]>, interpolation: &str) -> Value {
    if dice.bool() {
        points.reverse();
    }
    json!({"kind": "polyline", "points": points, "interpolation": interpolation})
}

/// A straight obstacle that touches the face, and the same one by `overlap` further in: with the body held there, and with
/// the first one and the body moved. With the obstacle's own normal both are one problem.
fn straight(dice: &mut Rng, body: &Body, face: &ContactBoundary) -> Option<(String, [Value; 2])> {
    // a face that the body does not lie behind as a whole is not touched first by a line
    let foremost = dice.usize(1..face.nodes.len() - 1);
    let normal = face.normals[foremost];
    let reach = |i: usize| dot(face.positions[i], normal);
    let first = (0..face.nodes.len()).max_by(|&a, &b| reach(a).total_cmp(&reach(b)))?;
    let overlap = body.thickness * 10f64.powf(-3.0 + 2.6 * dice.f64());
    let along = [normal[1], -normal[0]];
    let kind = dice.usize(..3);
    let mut obstacle = |behind: f64| {
        let at = |part: f64| {
            [0, 1].map(|a| {
                face.positions[first][a] - behind * normal[a] + part * body.size * along[a]
            })
        };
        match kind {
            0 => {
                let turned = if dice.bool() { 180.0 } else { 0.0 };
                let angle = along[1].atan2(along[0]).to_degrees() + turned;
                json!({"kind": "line", "point": at(4.0 * dice.f64() - 2.0), "angle": angle})
            }
            1 => polyline(dice, vec![at(-5.0), at(5.0)], "linear"),
            _ => {
                let points = [-5.0, -2.0, -0.1, 0.7, 2.0, 5.0].map(at).to_vec();
                polyline(dice, points, "cubic")
            }
        }
    };
    let contact = |obstacle: Value| json!({"obstacle": obstacle, "normal": "obstacle"});
    let pair = [
        with(body, contact(obstacle(overlap)), [0.0; 2]),
        with(body, contact(obstacle(0.0)), normal.map(|n| overlap * n)),
    ];
    let words = ["line", "polyline of two points", "polyline of six points"][kind];
    Some((format!("{words}, body moved"), pair))
}

/// Points of a circle round `centre`, one of them in the direction `towards`: closed, or with a gap on the far side.
fn circle(
    centre: [f64; 2],
    radius: f64,
    points: usize,
    towards: [f64; 2],
    open: bool,
) -> Vec<[f64; 2]> {
    let foremost = towards[1].atan2(towards[0]);
    let whole = if open { TAU - 1.4 } else { TAU };
    let at = |k: usize| {
        let angle = foremost + whole * (k as f64 / points as f64 - 0.5);
        [
            centre[0] + radius * angle.cos(),
            centre[1] + radius * angle.sin(),
        ]
    };
    (0..=points).map(at).collect()
}

/// Points of a circle that a spline passes through.
const SMOOTH: usize = 240;

/// Distance along n to where that enters a circle ahead: the first crossing.
fn to_circle(place: [f64; 2], n: [f64; 2], centre: [f64; 2], radius: f64) -> Option<f64> {
    let to = minus(centre, place);
    let ahead = dot(to, n);
    let aside = ahead * ahead + radius * radius - dot(to, to);
    (ahead > 0.0 && aside > 0.0).then(|| ahead - aside.sqrt())
}

/// Distance along n to where that enters a convex polygon ahead.
fn to_polygon(place: [f64; 2], n: [f64; 2], centre: [f64; 2], points: &[[f64; 2]]) -> Option<f64> {
    let crossing = |side: &[[f64; 2]]| {
        let (along, to) = (minus(side[1], side[0]), minus(side[0], place));
        let part = cross(n, to) / cross(along, n);
        (part > -1e-9 && part < 1.0 + 1e-9).then(|| cross(along, to) / cross(along, n))
    };
    let crossings = points.windows(2).filter_map(crossing);
    let ahead = dot(minus(centre, place), n) > 0.0;
    crossings.filter(|_| ahead).min_by(f64::total_cmp)
}

/// A roller before the face, or a shaft in the hole, that overlaps the body; and the table of its distances along the face,
/// by the formula of the circle, of an obstacle that just touches and is pushed.
fn round(dice: &mut Rng, body: &Body, face: &ContactBoundary) -> Option<(String, [Value; 2])> {
    let foremost = dice.usize(1..face.nodes.len() - 1);
    let (place, normal) = (face.positions[foremost], face.normals[foremost]);
    let radius = match body.hole {
        true => body.size * (0.5 + 0.6 * dice.f64()),
        false => body.size * (0.2 + 2.0 * dice.f64()),
    };
    let overlap = body.thickness.min(radius) * 10f64.powf(-3.0 + 2.5 * dice.f64());
    let centre = [0, 1].map(|a| place[a] + (radius - overlap) * normal[a]);
    let corners = dice.bool();
    let count = if corners {
        2 * dice.usize(4..30)
    } else {
        SMOOTH
    };
    // from a hole the far side is seen
    let open = !body.hole && dice.bool();
    let points = circle(centre, radius, count, normal.map(|n| -n), open);
    let gap = |face: &ContactBoundary, i: usize| {
        let (place, n) = (face.positions[i], face.normals[i]);
        match corners {
            true => to_polygon(place, n, centre, &points),
            false => to_circle(place, n, centre, radius),
        }
    };
    // the whole edges round the first place that face the circle
    let faces = |k: usize| (2 * k..=2 * k + 2).all(|i| gap(face, i).is_some());
    let own = foremost.min(face.nodes.len() - 2) / 2;
    let start = (0..=own).rev().take_while(|k| faces(*k)).last()?;
    let end = (own..face.edge_count()).take_while(|k| faces(*k)).last()?;
    let part = [face.s[2 * start], face.s[2 * end + 2]];
    let face = crate::overlaps::face(body, Some(part))?;
    let gaps: Option<Vec<f64>> = (0..face.nodes.len()).map(|i| gap(&face, i)).collect();
    let gaps = gaps?;
    let deepest = gaps.iter().fold(f64::INFINITY, |a, b| a.min(*b));
    // deeper than half the wall it lies on the other side as well
    if -deepest > 0.45 * body.thickness {
        return None;
    }
    let table = json!({"kind": "table", "x": face.s, "along": "arc_length",
        "gap": gaps.iter().map(|gap| gap - deepest).collect::<Vec<f64>>()});
    let interpolation = if corners { "linear" } else { "cubic" };
    let mut pushed = json!({"obstacle": table, "indentation": -deepest});
    let mut line = polyline(dice, points, interpolation);
    (line["from"], line["to"], line["along"]) =
        (json!(part[0]), json!(part[1]), json!("arc_length"));
    let mut overlapping = json!({"obstacle": line});
    if dice.bool() {
        let friction = json!({"coefficient": 0.3, "nonlocal_radius": 0.1 * body.size,
            "elastic_slip": 0.01 * overlap});
        pushed["friction"] = friction.clone();
        overlapping["friction"] = friction;
    }
    let words = if body.hole {
        "shaft in a hole"
    } else {
        "roller"
    };
    let shape = if corners { "with corners" } else { "round" };
    let pair = [
        with(body, overlapping, [0.0; 2]),
        with(body, pushed, [0.0; 2]),
    ];
    Some((format!("{words}, {shape}: table pushed"), pair))
}

/// A roller on a straight face that lies along x: the formula of the circle, pushed, with either normal.
fn formula(dice: &mut Rng, body: &Body) -> Option<(String, [Value; 2])> {
    let radius = body.size * (0.6 + 2.0 * dice.f64());
    let centre = body.size * (dice.f64() - 0.5);
    let overlap = body.thickness.min(radius) * 10f64.powf(-3.0 + 2.0 * dice.f64());
    let normal = if dice.bool() { "body" } else { "obstacle" };
    let points = circle(
        [centre, radius - overlap],
        radius,
        SMOOTH,
        [0.0, -1.0],
        dice.bool(),
    );
    let in_space = json!({"obstacle": polyline(dice, points, "cubic"), "normal": normal});
    let pushed = json!({"obstacle": {"kind": "circle", "radius": radius, "center": centre},
        "indentation": overlap, "normal": normal});
    Some((
        format!("circle by its formula, normal of the {normal}"),
        [with(body, in_space, [0.0; 2]), with(body, pushed, [0.0; 2])],
    ))
}

/// A pair of problems, what they are, and their body; none where the dice give no body, or no overlap.
fn pair(number: u64) -> Option<(String, String, [Value; 2])> {
    let mut dice = Rng::with_seed(number);
    let along_x = number % 8 == 7;
    let shift = [(); 2].map(|()| 10.0 * (dice.f64() - 0.5));
    let motion = match along_x {
        true => Motion {
            angle: 0.0,
            shift: [0.0; 2],
        },
        false => Motion {
            angle: TAU * dice.f64(),
            shift,
        },
    };
    let body = body(&mut dice, along_x, motion);
    let face = face(&body, None)?;
    let (words, pair) = match () {
        () if along_x => formula(&mut dice, &body),
        () if body.hole || dice.bool() => round(&mut dice, &body, &face),
        () => straight(&mut dice, &body, &face),
    }?;
    Some((words, body.words, pair))
}

/// The normal force and the friction force; or why there are none.
fn forces(text: &Value) -> Result<[f64; 2], String> {
    let problem = problem(&text.to_string());
    let external = files::external_mesh(&problem, None);
    let solution = solver::solve_on(&problem, external, &mut quiet);
    let summary = solution.map_err(|error| error.to_string())?.summary;
    Ok([summary.normal_force, summary.friction_force])
}

/// What became of the pairs of one kind.
#[derive(Default)]
struct Row {
    pairs: u32,
    refused: u32,
    open: u32,
    largest: f64,
}

impl Row {
    /// Counts a pair; what is wrong with it.
    fn add(&mut self, ends: [Result<[f64; 2], String>; 2], allowed: f64) -> Option<String> {
        self.pairs += 1;
        let [a, b] = match ends {
            [Ok(a), Ok(b)] => [a, b],
            [Err(_), Err(_)] => {
                self.refused += 1;
                return None;
            }
            [a, b] => return Some(format!("{a:?}, and {b:?}")),
        };
        if a == b && a[0] == 0.0 {
            self.open += 1;
            return None;
        }
        let off = (0..2).map(|k| (a[k] - b[k]).abs()).fold(0.0, f64::max) / b[0];
        self.largest = self.largest.max(off);
        // not a number where nothing touches in one of them
        (off.is_nan() || off > allowed).then(|| format!("{a:?}, and {b:?}: off by {off:.1e}"))
    }
}

#[test]
fn an_overlap_is_the_same_problem_as_one_that_is_pushed_or_moved() {
    let mut rows: BTreeMap<String, Row> = BTreeMap::new();
    let mut wrong: Vec<String> = Vec::new();
    for number in numbers("SIGNORINI_OVERLAPS", NUMBERS) {
        let Some((words, body, pair)) = pair(number) else {
            continue;
        };
        let allowed = match () {
            () if words.contains("roller") => BY_ITS_END,
            () if words.contains("moved") || words.contains("corners") => SAME,
            () => BY_SPLINE,
        };
        let row = rows.entry(words.clone()).or_default();
        let fault = row.add(pair.each_ref().map(forces), allowed);
        wrong.extend(fault.map(|fault| format!("{number}: {words}; {body}: {fault}")));
    }
    let mut table = serde_json::Map::new();
    for (words, row) in &rows {
        println!("{words}: {} pairs, {:.0e}", row.pairs, row.largest);
        let line = json!({"pairs": row.pairs, "refused": row.refused, "open": row.open, "largest": row.largest});
        table.insert(words.clone(), line);
    }
    keep_table("overlaps", &json!({"rows": table}));
    assert!(wrong.is_empty(), "{}:\n{}", wrong.len(), wrong.join("\n"));
    let sum = |of: fn(&Row) -> u32| rows.values().map(of).sum::<u32>();
    let (pairs, idle) = (sum(|row| row.pairs), sum(|row| row.refused + row.open));
    assert!(50 * idle <= pairs, "{idle} of {pairs}");
}

/// A barrel-shaped underside, y = x²/(2 · 20) for 0 ≤ x ≤ 2, above a rigid floor: half of it.
fn barrel(columns: usize, rows: usize, floor: f64, moved: f64) -> Value {
    let lattice = Lattice::new(columns, rows, |i, j| {
        let (x, up) = (i as f64 / columns as f64, 0.5 * j as f64 / rows as f64);
        [x, x * x / 40.0 * (1.0 - up) + 2.0 * up]
    });
    let along = |j: usize| lattice.edges(columns, |k| (k, j));
    let middle = lattice.edges(rows, |k| (0, k));
    json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"inline": {"nodes": lattice.nodes, "elements": lattice.elements,
            "boundaries": {"sole": along(0), "lid": along(2 * rows), "middle": middle}}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "middle", "ux": 0}, {"boundary": "lid", "uy": -moved}],
        "contacts": [{"boundary": "sole", "normal": "obstacle",
            "obstacle": {"kind": "line", "point": [0, floor], "angle": 0}}],
    })
}

/// A convex side of second order keeps its midside nodes where the floor lies inside it. Forces of the lid moved on a floor
/// that it just touches.
#[test]
fn a_convex_side_that_overlaps_a_floor_keeps_its_midside_nodes() {
    let force = |text: Value| solve(&problem(&text.to_string())).summary.normal_force;
    close(force(barrel(20, 8, 0.0, 0.01)), 3.4504, 1e-4);
    close(force(barrel(20, 8, 0.01, 0.0)), 3.4504, 1e-4);
    close(force(barrel(40, 12, 0.0, 0.022)), 9.3934, 1e-4);
    close(force(barrel(40, 12, 0.002, 0.02)), 9.3934, 1e-4);
}

/// Half a disc of radius 4 with a bore of radius 1, pushed by 0.08 onto a floor at an angle (degrees) through its lowest
/// point for that angle: as a line in either direction, and as a polyline. Two elements are in contact, of which the force
/// is known to a part in a hundred.
fn half_disc(angle: f64, kind: &str) -> Value {
    const RADII: [f64; 9] = [1.0, 1.8, 2.4, 2.9, 3.3, 3.6, 3.8, 3.9, 4.0];
    let lattice = Lattice::new(30, 8, |i, j| {
        // the rim below, from the right to the left
        let angle = -PI * i as f64 / 60.0;
        let r = match j % 2 {
            0 => RADII[j / 2],
            _ => 0.5 * (RADII[j / 2] + RADII[j / 2 + 1]),
        };
        [r * angle.cos(), r * angle.sin()]
    });
    let (sine, cosine) = angle.to_radians().sin_cos();
    let at = |part: f64| [4.0 * sine + part * cosine, -4.0 * cosine + part * sine];
    let obstacle = match kind {
        "line" => json!({"kind": kind, "point": at(0.7), "angle": angle}),
        "line the other way" => json!({"kind": "line", "point": at(0.7), "angle": angle + 180.0}),
        _ => json!({"kind": kind, "points": [at(-9.0), at(9.0)]}),
    };
    json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"inline": {"nodes": lattice.nodes, "elements": lattice.elements, "boundaries": {
            "rim": lattice.edges(30, |k| (k, 16)), "bore": lattice.edges(30, |k| (k, 0))}}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "bore", "ux": 0, "uy": 0}],
        "contacts": [{"boundary": "rim", "obstacle": obstacle, "indentation": 0.08}],
    })
}

/// A floor that is a little tilted meets the straight line through the normals of the disc's ends far away, behind one of
/// them: that is no overlap. With two elements in contact, forces vary with the tilt by a part in a hundred.
#[test]
fn a_tilted_floor_behind_the_end_of_a_disc_is_no_overlap() {
    for angle in [0.0, 0.5, -0.5, 0.02, 1e-6, 3.0, -6.0] {
        let mut forces = Vec::new();
        for kind in ["line", "line the other way", "polyline"] {
            let solution = solve(&problem(&half_disc(angle, kind).to_string()));
            forces.push(solution.summary.normal_force);
            let cut = |w: &Warning| w.code == WarningCode::ObstacleCutsEdge;
            // a straight line has no end
            let told = kind != "polyline" && solution.summary.warnings.iter().any(cut);
            assert!(!told, "{kind} at {angle}");
        }
        println!("{angle}: {forces:?}");
        close(forces[0], 44.9, 1e-2);
        close(forces[1], forces[0], 1e-9);
        // an edge is divided where the polyline ends
        close(forces[2], forces[0], 1e-6);
    }
}

/// A floor that ends where a curved side still looks at it has one node there for each of its ends, however long it is: the
/// side is divided where its own normal passes the end. Divided again beside that, it was made of needles, and the solution
/// did not converge.
#[test]
fn a_curved_side_is_divided_once_at_each_end_of_a_floor() {
    for (angle, normal) in [(0.0, "obstacle"), (0.5, "body"), (-3.0, "body")] {
        let mut text = half_disc(angle, "line");
        text["contacts"][0]["normal"] = json!(normal);
        let endless = solve(&problem(&text.to_string()));
        let (sine, cosine) = f64::to_radians(angle).sin_cos();
        let at = |part: f64| [4.0 * sine + part * cosine, -4.0 * cosine + part * sine];
        for half in [3.1, 4.4, 5.7, 7.3, 9.0, 14.0] {
            text["contacts"][0]["obstacle"] =
                json!({"kind": "polyline", "points": [at(-half), at(half)]});
            // a bound acts up to the ends, though nothing touches there
            text["contacts"][0]["friction"] = json!({"bound": 1e-9, "elastic_slip": 1e-3});
            let problem = problem(&text.to_string());
            let solution = solve(&problem);
            // a quadrilateral becomes three triangles, with four nodes more; where the side is steeper than 45° it is left out
            let more = Model::new(&problem, None).unwrap().mesh.nodes.len() - 797;
            let cut = |w: &&Warning| w.code == WarningCode::ObstacleCutsEdge;
            let told = solution.summary.warnings.iter().filter(cut).count();
            assert!(
                more.is_multiple_of(4) && more / 4 <= 2,
                "{half} at {angle}: {more}"
            );
            assert!(
                more == 8 || told > 0 || half > 4.0,
                "{half} at {angle}: {more}"
            );
            // of the ends, far from the contact, only the triangles are felt
            let forces = [&solution, &endless].map(|s| s.summary.normal_force);
            close(forces[0], forces[1], 1e-5);
        }
    }
}

/// A box round the body: what lies behind a side is for another side, also where that overlaps it, and whichever way round
/// the box is drawn.
#[test]
fn each_side_meets_the_obstacle_in_front_of_it() {
    let gaps = |side: &str, points: Value| {
        let text = json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"grid": {"x": [0, 0.5, 1, 1.5, 2], "y": [-1, -0.5, 0]}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "left", "ux": 0, "uy": 0}],
            "contacts": [{"boundary": side, "obstacle": {"kind": "polyline", "points": points, "from": 0.5}}],
        });
        let mut model = Model::new(&problem(&text.to_string()), None).unwrap();
        model.contacts.remove(0).profile
    };
    // 2 above the body, and 0.05 inside its lower side
    let mut points = vec![[-1, 2], [3, 2], [3, -1], [-1, -1], [-1, 2]]
        .into_iter()
        .map(|[x, y]: [i32; 2]| [f64::from(x), f64::from(y) + if y < 0 { 0.05 } else { 0.0 }])
        .collect::<Vec<_>>();
    for _ in 0..2 {
        points.reverse();
        for (side, gap) in [("top", 2.0), ("bottom", -0.05), ("right", 1.0)] {
            let found = gaps(side, json!(points));
            assert!(
                found.iter().all(|own| (own - gap).abs() < 1e-12),
                "{side}: {found:?}"
            );
        }
    }
    // a roller that is almost half as deep in the body as that is thick, and one above it
    let round = |y: f64, radius: f64| {
        let at = |k: i32| {
            let angle = TAU * f64::from(k) / 80.0;
            [1.0 + radius * angle.cos(), y + radius * angle.sin()]
        };
        json!((0..=80).map(at).collect::<Vec<_>>())
    };
    let nearest = |y: f64| {
        gaps("top", round(y, 5.0))
            .into_iter()
            .fold(f64::INFINITY, f64::min)
    };
    close(nearest(4.55), -0.45, 1e-9);
    close(nearest(5.4), 0.4, 1e-9);
}
