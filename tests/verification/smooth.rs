//! Where the surface of a body is smooth, and where it has a corner: half models, supports that meet, rigid motions.
//!
//! The sides of a discretised curve meet at tiny angles, or at small ones if they are few. None of them is a corner, and a
//! line of symmetry is one whatever the last normal is off by.

use serde_json::{Value, json};
use solver::error::Reason;
use solver::model::{Held, Model};

use crate::support::{close, problem, solve};

/// A sector of a ring about (0, 0), between two angles (degrees), in `around` × `across` elements of second order.
#[derive(Clone, Copy)]
pub(crate) struct Sector {
    /// Radii.
    pub(crate) radii: [f64; 2],
    /// Angles (degrees).
    pub(crate) angles: [f64; 2],
    pub(crate) around: usize,
    pub(crate) across: usize,
    /// Each quadrilateral as two triangles.
    pub(crate) triangles: bool,
    /// Sides are not curved.
    pub(crate) straight: bool,
    /// Elements differ in size.
    pub(crate) uneven: bool,
    /// The second radius as a part of the first: an ellipse.
    pub(crate) flat: f64,
    /// All is turned by this (degrees), and scaled.
    pub(crate) turned: f64,
    pub(crate) scale: f64,
    /// Digits after the first with which coordinates are printed.
    pub(crate) digits: usize,
}

impl Sector {
    pub(crate) fn new(radii: [f64; 2], angles: [f64; 2], around: usize) -> Self {
        Sector {
            radii,
            angles,
            around,
            across: 2,
            triangles: false,
            straight: false,
            uneven: false,
            flat: 1.0,
            turned: 0.0,
            scale: 1.0,
            digits: 16,
        }
    }

    /// A place turned, scaled and printed.
    pub(crate) fn placed(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let (s, c) = self.turned.to_radians().sin_cos();
        [c * x - s * y, s * x + c * y].map(|v| {
            let digits = self.digits;
            format!("{:.digits$e}", self.scale * v).parse().unwrap()
        })
    }

    /// The inline mesh: boundaries `inner`, `outer`, and `start` and `end` where the sector is no ring; `outer_0` and
    /// `outer_1` are the halves of `outer`.
    pub(crate) fn mesh(&self) -> Value {
        let whole = (self.angles[1] - self.angles[0] - 360.0).abs() < 1e-9;
        let (columns, rows) = (2 * self.around, 2 * self.across);
        let part = |k: usize| {
            let even = k as f64 / columns as f64;
            let wave = (std::f64::consts::TAU * 3.0 * even).sin();
            even + if self.uneven {
                0.12 / self.around as f64 * wave
            } else {
                0.0
            }
        };
        let at = |i: usize, j: usize| {
            let r = self.radii[0] + (self.radii[1] - self.radii[0]) * j as f64 / rows as f64;
            let angle = self.angles[0] + (self.angles[1] - self.angles[0]) * part(i);
            let (s, c) = angle.to_radians().sin_cos();
            [r * c, self.flat * r * s]
        };
        let mut nodes = Vec::new();
        let mut numbers = std::collections::BTreeMap::new();
        let mut node = |i: usize, j: usize| -> u32 {
            let i = if whole { i % columns } else { i };
            *numbers.entry((i, j)).or_insert_with(|| {
                let place = match self.straight && i % 2 == 1 {
                    true => {
                        let (a, b) = (at(i - 1, j), at(i + 1, j));
                        [0, 1].map(|k| 0.5 * (a[k] + b[k]))
                    }
                    false => at(i, j),
                };
                nodes.push(self.placed(place));
                nodes.len() as u32 - 1
            })
        };
        let mut elements: Vec<Vec<u32>> = Vec::new();
        let mut sides: [Vec<[u32; 3]>; 4] = Default::default();
        for a in 0..self.around {
            for b in 0..self.across {
                let (i, j) = (2 * a, 2 * b);
                // counter-clockwise: outwards, then on
                let corner = [(i, j), (i, j + 2), (i + 2, j + 2), (i + 2, j)];
                let mid = [(i, j + 1), (i + 1, j + 2), (i + 2, j + 1), (i + 1, j)];
                let c = corner.map(|(i, j)| node(i, j));
                let m = mid.map(|(i, j)| node(i, j));
                match self.triangles {
                    false => elements.push([c, m].concat()),
                    true => {
                        let middle = node(i + 1, j + 1);
                        // the two halves of a half disc are mirror images
                        let k = usize::from(self.angles[0] == -180.0 && 2 * a < self.around);
                        let at = |i: usize| (c[(i + k) % 4], m[(i + k) % 4]);
                        let [(p, pq), (q, qr), (r, rs), (s, sp)] = [at(0), at(1), at(2), at(3)];
                        elements.push(vec![p, q, r, pq, qr, middle]);
                        elements.push(vec![p, r, s, middle, rs, sp]);
                    }
                }
                if b == 0 {
                    sides[0].push([c[0], c[3], m[3]]);
                }
                if b + 1 == self.across {
                    sides[1].push([c[1], c[2], m[1]]);
                }
                if a == 0 {
                    sides[2].push([c[0], c[1], m[0]]);
                }
                if a + 1 == self.around {
                    sides[3].push([c[3], c[2], m[2]]);
                }
            }
        }
        let [inner, outer, start, end] = sides;
        let halves = outer.split_at(self.around / 2);
        let mut boundaries = json!({"inner": inner, "outer_0": halves.0, "outer_1": halves.1});
        boundaries["outer"] = json!(outer);
        if !whole {
            boundaries["start"] = json!(start);
            boundaries["end"] = json!(end);
        }
        json!({"inline": {"nodes": nodes, "elements": elements, "boundaries": boundaries}})
    }
}

/// The lower half of a hollow disc, whole or half, pressed on a rigid line with friction.
fn pressed(sector: Sector, condition: &str) -> Value {
    let scale = sector.scale;
    let point = sector.placed([0.0, -sector.flat * sector.radii[1]]);
    let mut text = json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": sector.mesh(),
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "inner", "ux": 0, "uy": 0}],
        "contacts": [{
            "boundary": "outer", "indentation": 0.02 * scale, "condition": condition, "normal": "obstacle",
            "obstacle": {"kind": "line", "point": point, "angle": sector.turned},
            "friction": {"coefficient": 0.3, "nonlocal_radius": 0.1 * scale, "elastic_slip": 1e-5 * scale}
        }]
    });
    if condition == "bonded" {
        text["contacts"][0]
            .as_object_mut()
            .unwrap()
            .remove("friction");
    }
    if sector.angles[0] == -90.0 {
        // the line of symmetry, wherever it is turned to
        let mut all = text["supports"].as_array().unwrap().clone();
        all.push(json!({"boundary": "start", "un": 0}));
        text["supports"] = Value::Array(all);
    }
    text
}

/// A half of the body with a line of symmetry is half of the whole one: forces, and S_ρ on the line. Elements of 5.6° to
/// 45° and some of an ellipse, however the body lies and whatever its size; printed coordinates leave their error.
#[test]
fn half_a_disc_is_half_of_the_whole_one() {
    for (around, triangles, flat, turned, scale, digits) in [
        (16, false, 1.0, 0.0, 1.0, 16),
        (16, true, 1.0, 0.0, 1.0, 16),
        (8, false, 1.0, 33.0, 1.0, 16),
        (4, false, 1.0, 0.0, 1e-6, 16),
        (2, false, 1.0, 0.0, 1.0, 16),
        (8, true, 0.6, -71.0, 1e6, 16),
        (8, false, 1.5, 0.0, 1.0, 16),
        (16, false, 1.0, 12.0, 1.0, 7),
        (8, false, 1.0, 200.0, 1e3, 6),
    ] {
        let mut half = Sector::new([0.5, 1.0], [-90.0, 0.0], around);
        half.triangles = triangles;
        (half.flat, half.turned, half.scale, half.digits) = (flat, turned, scale, digits);
        let mut whole = half;
        (whole.angles, whole.around) = ([-180.0, 0.0], 2 * around);
        let case = format!("{around} {triangles} {flat} {turned} {scale} {digits}");
        let tolerance = if digits == 16 { 1e-8 } else { 1e-3 };
        let [half, whole] = [half, whole].map(|sector| {
            let solution = solve(&problem(&pressed(sector, "unilateral").to_string()));
            let profile = &solution.node_profiles["outer"];
            // the outer boundary runs clockwise: the lowest node is the last of the half
            let lowest = match sector.angles[0] == -90.0 {
                true => profile.s.len() - 1,
                false => profile.s.len() / 2,
            };
            let s = &solution.summary;
            (
                s.normal_force,
                s.friction_force,
                profile.nonlocal_pressure[lowest],
            )
        });
        println!("{case}: {half:?} {whole:?}");
        close(2.0 * half.0, whole.0, tolerance);
        close(2.0 * half.1, whole.1, 3.0 * tolerance);
        close(half.2, whole.2, 3.0 * tolerance);
    }
}

/// A bonded contact that ends on a line of symmetry is accepted, and is half of the whole.
#[test]
fn a_bonded_half_is_half_of_the_whole() {
    for around in [2, 8] {
        let half = Sector::new([0.5, 1.0], [-90.0, -50.0], around);
        let mut whole = half;
        (whole.angles, whole.around) = ([-130.0, -50.0], 2 * around);
        let [half, whole] = [half, whole].map(|sector| {
            solve(&problem(&pressed(sector, "bonded").to_string()))
                .summary
                .normal_force
        });
        close(2.0 * half, whole, 1e-9);
    }
}

/// A ring that turns in a sleeve, held along the normals of the whole circle or of two halves of it: the same, a rotation
/// without energy. (On uneven elements the discrete ring is no circle, and is held a little.)
#[test]
fn a_ring_turns_in_a_sleeve_of_two_halves() {
    for (around, triangles, uneven, turned, scale, digits) in [
        (8, false, false, 0.0, 1.0, 16),
        (4, false, false, 0.0, 1.0, 16),
        (12, true, false, 17.0, 1e-6, 16),
        (40, false, false, 0.0, 1e6, 7),
        (12, false, true, 0.0, 1.0, 16),
        (24, false, false, 5.0, 1.0, 6),
    ] {
        let mut ring = Sector::new([1.0, 2.0], [0.0, 360.0], around);
        (ring.triangles, ring.uneven, ring.turned) = (triangles, uneven, turned);
        (ring.scale, ring.digits) = (scale, digits);
        let energy = |names: &[&str]| {
            let mut supports = vec![json!({"boundary": "inner", "ut": 0.01 * scale})];
            supports.extend(names.iter().map(|name| json!({"boundary": name, "un": 0})));
            let text = json!({
                "analysis": {"kind": "plane_strain"},
                "mesh": ring.mesh(),
                "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
                "supports": supports
            });
            solve(&problem(&text.to_string())).summary.energy / scale.powi(2)
        };
        let (whole, halves) = (energy(&["outer"]), energy(&["outer_0", "outer_1"]));
        println!("{around} {triangles} {uneven} {digits}: {whole:e} {halves:e}");
        assert!(
            (whole - halves).abs() <= 1e-9 * whole.abs() + 1e-12,
            "{whole:e} {halves:e}"
        );
        // two nodes held take 0.1
        let most = if uneven {
            1e-2
        } else if digits < 16 {
            1e-6
        } else {
            1e-15
        };
        assert!(halves.abs() <= most, "{halves:e}");
    }
}

/// Where nothing holds the ring against rotation, it is free, also if its sides are no circle but for their error.
#[test]
fn a_ring_in_a_sleeve_is_free_to_turn() {
    for (around, uneven, digits) in [
        (8, false, 16),
        (12, true, 16),
        (40, true, 16),
        (24, false, 7),
    ] {
        let mut ring = Sector::new([1.0, 2.0], [0.0, 360.0], around);
        (ring.uneven, ring.digits, ring.turned) = (uneven, digits, 8.0);
        let model = |flat: f64| {
            let text = json!({
                "analysis": {"kind": "plane_strain"},
                "mesh": Sector { flat, ..ring }.mesh(),
                "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
                "supports": [{"boundary": "outer_0", "un": 0}, {"boundary": "outer_1", "un": 0}]
            });
            Model::new(&problem(&text.to_string()), None)
        };
        let found = model(1.0).unwrap_err();
        let free = &found[0];
        assert_eq!(free.reason, Reason::FreeBody, "{found:#?}");
        assert!(free.got.contains("in rotation about"), "{}", free.got);
        // an oval one is held
        assert!(model(0.7).is_ok());
    }
}

/// Long bodies that are held along the normal of a short side are held.
#[test]
fn a_slender_body_is_held_by_the_normals_of_its_short_side() {
    let text = json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grid": {"x": [0, 1, 10, 100, 1000], "y": [0, 1]}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "left", "un": 0, "ut": 0}]
    });
    assert!(Model::new(&problem(&text.to_string()), None).is_ok());
}

/// Two straight sides that meet at 1°, 2° or 5°: each support holds along its own normal, and the common node entirely.
/// At 0.001° it is one straight side.
#[test]
fn a_corner_of_a_degree_is_one() {
    for (degrees, is_corner) in [
        (0.0, false),
        (0.001, false),
        (1.0f64, true),
        (2.0, true),
        (5.0, true),
    ] {
        let rise = degrees.to_radians().tan();
        let text = json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {
                "grid": {"x": [0, 0.5, 1, 1.5, 2], "y": [0, 0.5, 1], "top": [[0, 1], [1, 1], [2, 1.0 - rise]]},
                "boundaries": {"a": {"side": "top", "x": [0, 1]}, "b": {"side": "top", "x": [1, 2]}}
            },
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "a", "un": 0}, {"boundary": "b", "un": 0}, {"boundary": "left", "ux": 0}]
        });
        let model = Model::new(&problem(&text.to_string()), None).unwrap();
        let node = model
            .mesh
            .nodes
            .iter()
            .position(|p| *p == [1.0, 1.0])
            .unwrap();
        let both = matches!(model.fixed[&(node as u32)], Held::Both(_));
        assert_eq!(both, is_corner, "{degrees}°");
    }
}

/// A straight support along x and one along the normal of an arc that goes on from it hold their common node once.
#[test]
fn a_flat_that_goes_over_into_an_arc_is_smooth() {
    // a stadium: its lower flat and an arc of few elements beside it
    for around in [2, 3, 8] {
        let arc = |t: f64| [1.0 + t.sin(), 1.0 - t.cos()];
        let inside = |t: f64| [1.0 + 0.4 * t.sin(), 1.0 - 0.4 * t.cos()];
        let steps = 2 * around;
        let angle = |k: usize| 0.5 * std::f64::consts::PI * k as f64 / steps as f64;
        // columns: the flat from x = 0 to 1, then the arc
        let place = |k: usize, j: usize| {
            let (low, high) = match k {
                0..=2 => ([0.5 * k as f64, 0.0], [0.5 * k as f64, 0.6]),
                _ => (arc(angle(k - 2)), inside(angle(k - 2))),
            };
            [0, 1].map(|a| low[a] + 0.5 * j as f64 * (high[a] - low[a]))
        };
        let columns = steps + 3;
        let node = |k: usize, j: usize| 3 * k + j;
        let nodes: Vec<[f64; 2]> = (0..3 * columns).map(|n| place(n / 3, n % 3)).collect();
        let mut elements = Vec::new();
        let mut below = Vec::new();
        for k in (0..columns - 1).step_by(2) {
            elements.push(vec![
                node(k, 0),
                node(k + 2, 0),
                node(k + 2, 2),
                node(k, 2),
                node(k + 1, 0),
                node(k + 2, 1),
                node(k + 1, 2),
                node(k, 1),
            ]);
            below.push([node(k, 0), node(k + 2, 0), node(k + 1, 0)]);
        }
        // the middle node of an element is no node: number the others only
        let mut used: Vec<usize> = elements.concat();
        used.sort_unstable();
        used.dedup();
        let number = |n: &usize| used.binary_search(n).unwrap();
        let nodes: Vec<[f64; 2]> = used.iter().map(|n| nodes[*n]).collect();
        let elements: Vec<Vec<usize>> = elements
            .iter()
            .map(|e| e.iter().map(number).collect())
            .collect();
        let below: Vec<Vec<usize>> = below
            .iter()
            .map(|e| e.iter().map(number).collect())
            .collect();
        let text = json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"inline": {"nodes": nodes, "elements": elements,
                "boundaries": {"flat": [below[0]], "arc": below[1..]}}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "arc", "un": 0}, {"boundary": "flat", "uy": 0}]
        });
        let model = Model::new(&problem(&text.to_string()), None).unwrap();
        let node = model
            .mesh
            .nodes
            .iter()
            .position(|p| *p == [1.0, 0.0])
            .unwrap();
        match model.fixed[&(node as u32)] {
            Held::Along { direction, .. } => assert_eq!(direction, [0.0, 1.0], "{around}"),
            both => panic!("{around}: {both:?}"),
        }
    }
}
