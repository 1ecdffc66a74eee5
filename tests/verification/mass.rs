//! Loads of a body's mass: gravity, and rotation. Sources: equilibrium, and Timoshenko and Goodier, Theory of Elasticity,
//! article 32 (rotating discs), in plane strain by E/(1 − ν²) and ν/(1 − ν).

use serde_json::{Value, json};
use solver::problem::Problem;
use solver::solution::Solution;

use crate::record::held;
use crate::support::{Lattice, close, node, problem, solve};

const E: f64 = 1000.0;
const DENSITY: f64 = 2.5;
/// The inner and the outer radius of rings.
const RADII: [f64; 2] = [1.0, 2.0];

fn theories() -> [Value; 3] {
    [
        json!({"kind": "plane_stress", "thickness": 0.7}),
        json!({"kind": "plane_strain"}),
        json!({"kind": "axisymmetric"}),
    ]
}

/// What contact bears is what the parts weigh, each with its own density: an integral of constants, exact to rounding.
#[test]
fn contact_bears_the_weight_of_all_materials() {
    for analysis in theories() {
        let text = json!({
            "analysis": analysis,
            "mesh": {"grid": {"x": [1, 2, 3], "y": [0, 1, 2]}, "groups": {"upper": {"y": [1, 2]}}},
            "materials": [
                {"youngs_modulus": E, "poissons_ratio": 0.3, "density": 2},
                {"youngs_modulus": E, "poissons_ratio": 0.4999, "density": 5, "group": "upper"},
            ],
            "supports": [{"boundary": "left", "ux": 0}],
            "loads": [{"gravity": [0, -4]}, {"gravity": [0, 1]}, {"body_force": [0, -1]}],
            "contacts": [{"boundary": "bottom", "obstacle": {"kind": "flat"}}],
        });
        let area = match analysis["kind"].as_str().unwrap() {
            "axisymmetric" => std::f64::consts::PI * (9.0 - 1.0),
            _ => 2.0 * analysis["thickness"].as_f64().unwrap_or(1.0),
        };
        let found = solve(&problem(&text.to_string())).summary.normal_force;
        close(found, area * (3.0 * (2.0 + 5.0) + 2.0), 1e-12);
    }
}

/// A bar without Poisson's effect that rotates about a point: E u″ = −ρω² (x − x₀) along both axes. Quadratic elements
/// give the exact displacement at the ends of elements.
#[test]
fn a_bar_that_rotates_about_a_point_stretches() {
    let (omega, about, size) = (3.0, [-0.4, 0.3], [2.0, 1.5]);
    for analysis in &theories()[..2] {
        let text = json!({
            "analysis": analysis,
            "mesh": {"grid": {"x": [0, 0.7, size[0]], "y": [0, 0.5, size[1]]}},
            "materials": [{"youngs_modulus": E, "poissons_ratio": 0, "density": DENSITY}],
            "supports": [{"boundary": "left", "ux": 0}, {"boundary": "bottom", "uy": 0}],
            "loads": [{"rotation": {"angular_velocity": omega, "about": about}}],
        });
        let fields = solve(&problem(&text.to_string())).fields;
        let exact = |a: usize, x: f64| {
            let (l, x0) = (size[a], about[a]);
            let slope = 0.5 * l * l - x0 * l;
            DENSITY * omega * omega / E * (slope * x + 0.5 * x0 * x * x - x * x * x / 6.0)
        };
        let ends = [[0.0, 0.7, size[0]], [0.0, 0.5, size[1]]];
        for k in 0..fields.x.len() {
            for (a, x, u) in [
                (0, fields.x[k], fields.ux[k]),
                (1, fields.y[k], fields.uy[k]),
            ] {
                if ends[a].contains(&x) {
                    assert!(
                        (u - exact(a, x)).abs() < 1e-13,
                        "{u} at {x}, not {}",
                        exact(a, x)
                    );
                }
            }
        }
    }
}

/// A ring that rotates about its axis: radial displacement u = A r + B/r − k r³.
struct Ring {
    modulus: f64,
    poisson: f64,
    /// ρω²
    force: f64,
    constants: [f64; 2],
}

impl Ring {
    /// In plane strain. `inner`: the displacement of the inner surface, if it is held; the outer one is free.
    fn new(nu: f64, omega: f64, inner: Option<f64>) -> Ring {
        let mut ring = Ring {
            modulus: E / (1.0 - nu * nu),
            poisson: nu / (1.0 - nu),
            force: DENSITY * omega * omega,
            constants: [0.0; 2],
        };
        // both conditions are linear in A and B
        let conditions = |ring: &Ring| {
            let [a, b] = RADII;
            let at_inner = match inner {
                Some(u) => ring.displacement(a) - u,
                None => ring.radial_stress(a),
            };
            [at_inner, ring.radial_stress(b)]
        };
        let rest = conditions(&ring);
        let columns = [[1.0, 0.0], [0.0, 1.0]].map(|constants| {
            let unit = Ring { constants, ..ring };
            let with = conditions(&unit);
            [with[0] - rest[0], with[1] - rest[1]]
        });
        let [[a, c], [b, d]] = columns;
        let det = a * d - b * c;
        ring.constants = [
            (b * rest[1] - d * rest[0]) / det,
            (c * rest[0] - a * rest[1]) / det,
        ];
        ring
    }

    fn cubic(&self) -> f64 {
        (1.0 - self.poisson * self.poisson) * self.force / (8.0 * self.modulus)
    }

    fn displacement(&self, r: f64) -> f64 {
        self.constants[0] * r + self.constants[1] / r - self.cubic() * r * r * r
    }

    fn strains(&self, r: f64) -> [f64; 2] {
        let [a, b] = self.constants;
        let k = self.cubic();
        [
            a - b / (r * r) - 3.0 * k * r * r,
            a + b / (r * r) - k * r * r,
        ]
    }

    fn radial_stress(&self, r: f64) -> f64 {
        let [radial, hoop] = self.strains(r);
        self.modulus / (1.0 - self.poisson * self.poisson) * (radial + self.poisson * hoop)
    }

    fn hoop_stress(&self, r: f64) -> f64 {
        let [radial, hoop] = self.strains(r);
        self.modulus / (1.0 - self.poisson * self.poisson) * (hoop + self.poisson * radial)
    }
}

/// A slice of a ring that is held along its axis.
fn slice(nu: f64, omega: f64, more: Value) -> Problem {
    let x: Vec<f64> = (0..=8).map(|i| 1.0 + f64::from(i) / 8.0).collect();
    let mut text = json!({
        "analysis": {"kind": "axisymmetric"},
        "mesh": {"grid": {"x": x, "y": [0, 0.25]}},
        "materials": [{"youngs_modulus": E, "poissons_ratio": nu, "density": DENSITY}],
        "supports": [{"boundary": "bottom", "uy": 0}, {"boundary": "top", "uy": 0}],
        "loads": [{"rotation": {"angular_velocity": omega}}],
    });
    let fields = more.as_object().unwrap().clone();
    text.as_object_mut().unwrap().extend(fields);
    problem(&text.to_string())
}

/// A quarter of a ring in plane strain about `centre`, with curved sides.
fn quarter(nu: f64, omega: f64, centre: [f64; 2]) -> Problem {
    let (radial, round) = (8, 8);
    let lattice = Lattice::new(radial, round, |i, j| {
        let (sin, cos) = (std::f64::consts::FRAC_PI_2 * j as f64 / (2 * round) as f64).sin_cos();
        let r = 1.0 + i as f64 / (2 * radial) as f64;
        [centre[0] + r * cos, centre[1] + r * sin]
    });
    problem(
        &json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"inline": {"nodes": lattice.nodes, "elements": lattice.elements, "boundaries": {
                "below": lattice.edges(radial, |k| (k, 0)),
                "side": lattice.edges(radial, |k| (k, 2 * round)),
            }}},
            "materials": [{"youngs_modulus": E, "poissons_ratio": nu, "density": DENSITY}],
            "supports": [{"boundary": "below", "uy": 0}, {"boundary": "side", "ux": 0}],
            "loads": [{"rotation": {"angular_velocity": omega, "about": centre}}],
        })
        .to_string(),
    )
}

/// Displacements within 1e-5 at eight elements, as under Lamé's pressure, and 1e-3 with ν = .4999: there the force is balanced
/// by a pressure that is quadratic in r, and linear in each element (7.3e-4, and 1.0e-4 at sixteen elements). Stresses of a
/// surface are extrapolated to it: 1 %.
#[test]
fn a_ring_that_rotates_has_the_displacements_and_stresses_of_the_closed_form() {
    let omega = 4.0;
    for (nu, allowed) in [(0.3, 1e-5), (0.4999, 1e-3)] {
        let exact = Ring::new(nu, omega, None);
        let centre = [7.0, -3.0];
        let plane = solve(&quarter(nu, omega, centre)).fields;
        let revolved = solve(&slice(nu, omega, json!({}))).fields;
        for (kind, fields, hoop, [x, y]) in [
            ("plane strain", &plane, &plane.stress_yy, centre),
            ("axisymmetric", &revolved, &revolved.stress_zz, [0.0; 2]),
        ] {
            for r in RADII {
                let k = node(fields, x + r, y);
                close(fields.ux[k], exact.displacement(r), allowed);
                close(hoop[k], exact.hoop_stress(r), 0.01);
            }
            if nu == 0.3 {
                let what = format!("rotating ring, {kind}: u(a)");
                let (found, exact) = (fields.ux[node(fields, x + 1.0, y)], exact.displacement(1.0));
                held(0, &what, "8 elements across", found, exact, allowed);
            }
        }
    }
}

/// A ring on a rigid shaft with interference: the pressure falls with the square of the speed, and the ring leaves the
/// shaft at the speed at which the free ring has grown by the interference.
#[test]
fn a_ring_leaves_its_shaft_when_it_rotates_fast_enough() {
    let interference = 2e-3;
    let shaft = json!({"contacts": [{"boundary": "left", "obstacle": {"kind": "flat", "along": "arc_length"},
        "indentation": interference}]});
    let unit = Ring::new(0.3, 1.0, None).displacement(1.0);
    let leaves = (interference / unit).sqrt();
    let pressed = |part: f64| -> Solution { solve(&slice(0.3, part * leaves, shaft.clone())) };
    let area = 2.0 * std::f64::consts::PI * 0.25;
    for part in [0.0, 0.5, 0.9, 0.99] {
        let pressure = -Ring::new(0.3, part * leaves, Some(interference)).radial_stress(1.0);
        let found = pressed(part).summary.normal_force / area;
        let full = -Ring::new(0.3, 0.0, Some(interference)).radial_stress(1.0);
        assert!(
            (found - pressure).abs() < 1e-4 * full,
            "{part}: {found}, not {pressure}"
        );
    }
    assert_eq!(pressed(1.01).summary.normal_force, 0.0);
}

/// In load steps the factor of `loads` multiplies ω².
#[test]
fn a_factor_of_loads_multiplies_the_centrifugal_force() {
    let whole = solve(&slice(0.3, 2.0, json!({}))).fields;
    let quarter = json!({"steps": [{"loads": 0.5, "increments": 2}, {"loads": 0.25}]});
    let stepped = solve(&slice(0.3, 4.0, quarter)).fields;
    for (a, b) in stepped.ux.iter().zip(&whole.ux) {
        assert!((a - b).abs() < 1e-13 * whole.ux[0].abs(), "{a}, not {b}");
    }
}

#[test]
fn loads_of_the_mass_need_densities_and_a_known_axis() {
    let base = json!({
        "analysis": {"kind": "axisymmetric"},
        "mesh": {"grid": {"x": [1, 2], "y": [0, 1, 2]}, "groups": {"upper": {"y": [1, 2]}}},
        "materials": [
            {"youngs_modulus": E, "poissons_ratio": 0.3},
            {"youngs_modulus": E, "poissons_ratio": 0.3, "density": -1, "group": "upper"},
        ],
        "supports": [{"boundary": "bottom", "uy": 0}],
        "loads": [{"gravity": [1, -1]}, {"rotation": {"angular_velocity": 1, "about": [0, 0]}}],
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
            ("/loads/0/gravity/0", "not_used"),
            ("/loads/1/rotation/about", "not_used"),
            ("/materials/0/density", "missing"),
            ("/materials/1/density", "out_of_range"),
        ]
    );
    let on_a_boundary = base
        .to_string()
        .replace(r#"{"gravity""#, r#"{"boundary":"top","gravity""#);
    let violations = files::parse(&on_a_boundary).unwrap_err();
    assert_eq!(violations[0].pointer, "/loads/0/boundary", "{violations:?}");
}
